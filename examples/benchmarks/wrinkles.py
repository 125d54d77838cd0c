"""A stretched sheet that wrinkles between its grips: onset, wavelength, imperfection.

Between grips that keep its width a stretched sheet contracts most in the middle, so that there is a
little compression across, and above a critical strain wrinkles along.  Their wavelength is

    λ = 2 √π (D/T)^(1/4) √L,

with the tension T and the length L of the wrinkles.  Source: Cerda & Mahadevan, *Geometry and
physics of wrinkling*, Phys. Rev. Lett. 90 (2003).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from anmstrip.continuation.bifurcations import SingularPoint, switch_branch, watch_singular_points
from anmstrip.continuation.follow import follow
from anmstrip.continuation.path import Cost, PathStopped
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid, grip, symmetry
from anmstrip.linalg.solvers import Remembering, SparseSolver
from anmstrip.mechanics.effects import Controls, Effect
from anmstrip.mechanics.shell import KirchhoffLove, Membrane, isometric_bending
from figures import Line, drawn
from harness import Cell, Report, Sheet, main
from shell_problems import settings

Array = NDArray[np.float64]

LENGTH, WIDTH, POISSON = 3.5, 1.0, 0.45
"""Of the sheet between its grips (m, m, 1); E = 1 Pa does not matter."""

CHOICES = settings(15, 1e-6)
"""Of all paths; to 1e-5 of the tension a sheet that is all but perfect does not find its way."""

FROM_SLACK = settings(15, 1e-9)
"""Of the path of a bent sheet: it begins slack, where all forces are far below those at the end,
and to 1e-7 it may lose its way."""

VISIBLE = 0.02
"""Share of the highest crest from which on another one is counted."""

BEYOND = 4.0
"""Strain at the end of a path, over that at the onset."""

CRITICAL = 5.9e4
"""Strain at the onset over (t/W)², for the first guess."""

THIN = 2e-4
"""Thickness (m) at which meshes and imperfections are compared."""


@dataclass(frozen=True)
class Stretched:
    """A quarter of the sheet, pulled by its grip; the control is the share of ``strain``."""

    thickness: float  # m
    strain: float  # mean strain at the control 1
    cells: tuple[int, int]  # along and across
    # displacement of the reference without stress, shape (unknowns,)
    imperfection: Array | None = None

    @cached_property
    def strip(self) -> Strip:
        """Grip at x = 0, planes of symmetry at x = L/2 and y = 0."""
        nx, ny = self.cells
        mesh = grid(np.linspace(0.0, LENGTH / 2, nx + 1), np.linspace(0.0, WIDTH / 2, ny + 1))
        return Strip(mesh, self.thickness, Material(1.0, POISSON))

    @cached_property
    def equations(self) -> Equilibrium:
        """Equations of the free unknowns."""
        strip, pattern = self.strip, Pattern(self.strip)
        membrane = Membrane(strip, self.imperfection)
        effects: list[Effect] = [membrane, self._bending(pattern)]
        tension = self.thickness * self.strain
        model = Model(strip, pattern, effects, Scales(WIDTH, tension * WIDTH, tension))
        planes = [symmetry(strip, "exit", 0), symmetry(strip, "right", 1)]
        held = np.unique(np.concatenate([grip(strip, "entry"), *planes]))
        rest = Supports.at_rest(strip.unknowns, held)
        slope = np.zeros(strip.unknowns)
        slope[3 * strip.edges["entry"].values] = -self.strain * LENGTH / 2
        return Equilibrium(model, Supports(rest.free, rest.start, slope), Controls({}))

    def _bending(self, pattern: Pattern) -> Effect:
        """Return the bending; an imperfect sheet is bent without moments."""
        if self.imperfection is None:
            return isometric_bending(self.strip, pattern)
        return KirchhoffLove(self.strip, self.imperfection)

    @property
    def start(self) -> Array:
        """The slack state, shape (free,)."""
        whole = np.zeros(self.strip.unknowns) if self.imperfection is None else self.imperfection
        return whole[self.equations.supports.free]

    def heights(self, u: Array) -> CubicHermiteSpline:
        """Return z(y) in the middle of the sheet, as the elements have it."""
        return self._along(u, "exit", 1)

    def _along(self, u: Array, edge: str, axis: int) -> CubicHermiteSpline:
        nodes = self.strip.edges[edge].nodes
        z = self.equations.supports.full(u, 0.0).reshape(-1, 3)[:, 2]
        places = self.strip.mesh.p[axis, nodes]
        names = ("u", "u_x" if axis == 0 else "u_y")
        return CubicHermiteSpline(places, *(z[self.strip.dofs(name)[nodes]] for name in names))

    def wavelength(self, u: Array) -> float:
        """Return twice the distance from the crest in the middle to the trough beside it (m)."""
        turns = self.heights(u).derivative().roots(extrapolate=False)
        return 2.0 * float(turns[turns > 1e-2 * WIDTH].min())

    def amplitude(self, u: Array) -> float:
        """Return the height of the crest in the middle (m)."""
        return abs(float(self.heights(u)(0.0)))

    def wrinkled_length(self, u: Array) -> float:
        """Return L of the half wave sin(π x/L) that is as steep in the mean as the crest (m)."""
        crest = self._along(u, "right", 0)
        x = np.linspace(0.0, LENGTH / 2, 500)
        return float(np.pi * np.sqrt((crest(x) ** 2).sum() / (crest(x, 1) ** 2).sum()))

    def formula(self, u: Array, control: float, length: float = LENGTH) -> float:
        """Return the wavelength of wrinkles of a length (m)."""
        stiffness = self.strip.bending_stiffness / self.tension(u, control)
        return float(2.0 * np.sqrt(np.pi * length) * stiffness**0.25)

    def tension(self, u: Array, control: float) -> float:
        """Return the force over width (N/m)."""
        membrane = self.equations.model.effects[0]
        assert isinstance(membrane, Membrane)
        full = self.equations.supports.full(u, control)
        forces = membrane.at(full)[0, 0]
        weights = membrane.operator.weights
        return float(forces @ weights / weights.sum())


def sheet_of(thickness: float, cells: tuple[int, int], beyond: float = BEYOND) -> Stretched:
    """A sheet that is stretched some times as far as wrinkles need."""
    return Stretched(thickness, beyond * CRITICAL * thickness**2 / WIDTH**2, cells)


def onset(sheet: Stretched) -> SingularPoint:
    """Return the first bifurcation of the flat sheet.

    Raises
    ------
    PathStopped
        From the path, if it cannot be followed.
    ValueError
        If the sheet stays flat.
    """
    solver = Remembering(SparseSolver())
    steps = follow(sheet.equations, sheet.start, solver=solver, settings=CHOICES)
    for _, points in watch_singular_points(sheet.equations, steps, solver, CHOICES, stop=True):
        if points:
            return points[0]
    raise ValueError("the sheet stays flat")


def wrinkled(sheet: Stretched, point: SingularPoint, cost: Cost) -> Iterator[tuple[Array, float]]:
    """Return states on the way from the onset to the full stretch."""
    solver = SparseSolver()
    for share in (0.3, 0.1, 1.0):
        try:
            u, pace = switch_branch(
                sheet.equations, point, share * sheet.thickness, solver, 1e-6, cost
            )
            break
        except PathStopped:
            continue
    for step in follow(sheet.equations, u, solver=solver, settings=CHOICES, pace=pace, cost=cost):
        yield step.branch.end


# report --------------------------------------------------------------------------


def study(quick: bool = False) -> Report:
    """Find wrinkles by thickness, on three meshes, and with an imperfection."""
    cells = ((12, 14), (12, 16), (14, 18)) if quick else ((14, 18), (16, 24), (24, 36))
    stretches = [(4e-4, BEYOND), (1e-4, BEYOND), (4e-5, BEYOND), (4e-5, 20.0)]
    shown = stretches[:2] if quick else stretches
    main, profiles = _thickness_sheet(shown, cells[-1] if quick else (16, 32))
    return Report(
        name="wrinkles",
        title="Wrinkles of a stretched sheet",
        data=main,
        sheets=(main, _mesh_sheet(THIN, cells), _imperfection_sheet(THIN, cells[0])),
        figures={"wrinkles.png": drawn(profiles, "y / W", "z / t")},
    )


def _ended(sheet: Stretched) -> tuple[SingularPoint, Array, float, Cost]:
    """Return the onset, and state, control and cost at the full stretch."""
    point, cost = onset(sheet), Cost()
    *_, (u, control) = wrinkled(sheet, point, cost)
    return point, u, control, cost


def _thickness_sheet(
    stretches: list[tuple[float, float]], cells: tuple[int, int]
) -> tuple[Sheet, dict[str, list[Line]]]:
    rows: list[tuple[Cell, ...]] = []
    panels: dict[str, list[Line]] = {}
    for thickness, beyond in stretches:
        sheet = sheet_of(thickness, cells, beyond)
        point, cost = onset(sheet), Cost()
        path = [(point.mode, point.control), *wrinkled(sheet, point, cost)]
        for u, control in (path[0], path[-1]):
            length, wave = sheet.wrinkled_length(u), sheet.wavelength(u)
            first = u is point.mode
            state = point.u if first else u
            shares = [wave / sheet.formula(state, control, part) - 1.0 for part in (LENGTH, length)]
            strain = control * sheet.strain
            rows.append((thickness, "onset" if first else "end", strain, wave, length,
                         *(100.0 * share for share in shares),
                         None if first else sheet.amplitude(u) / thickness,
                         None if first else cost.factorisations))  # fmt: skip
        y = np.linspace(0.0, WIDTH / 2, 200)
        panels[f"t / W = {thickness:g}, {beyond:g} × onset"] = [
            Line("end", y, sheet.heights(path[-1][0])(y) / thickness)
        ]
    columns = ("thickness", "at", "strain", "wavelength", "wrinkled length", "off, whole (%)",
               "off, own (%)", "amplitude / t", "tangents")  # fmt: skip
    note = (
        f"Quarter of a sheet of {LENGTH:g} × {WIDTH:g}, ν = {POISSON:g}, {cells[0]} × {cells[1]} "
        "elements. Off the formula with the whole length between the grips, which wrinkles do "
        "not reach, the less so at the onset; and with the wrinkles' own length."
    )
    return Sheet("Onset and wavelength by thickness", columns, tuple(rows), note), panels


def _mesh_sheet(thickness: float, meshes: tuple[tuple[int, int], ...]) -> Sheet:
    rows: list[tuple[Cell, ...]] = []
    for cells in meshes:
        sheet = sheet_of(thickness, cells)
        point, u, _, _ = _ended(sheet)
        rows.append((f"{cells[0]} × {cells[1]}", point.control * sheet.strain, sheet.wavelength(u),
                     sheet.amplitude(u) / thickness, _crests(sheet, u)))  # fmt: skip
    columns = (
        "elements",
        "strain at the onset",
        "wavelength",
        "amplitude / t",
        "crests, half width",
    )
    note = f"Thickness {thickness:g}. Crests and troughs above {VISIBLE:g} of the highest."
    return Sheet("Three meshes", columns, tuple(rows), note)


def _crests(sheet: Stretched, u: Array) -> int:
    """Return crests and troughs in half the width that can be seen; near the edge they fade."""
    heights = sheet.heights(u)
    ends = [0.0, *heights.roots(extrapolate=False), WIDTH / 2]
    highest = [np.abs(heights(np.linspace(a, b, 50))).max() for a, b in pairwise(ends)]
    return int((np.array(highest) > VISIBLE * max(highest)).sum())


def _imperfection_sheet(thickness: float, cells: tuple[int, int]) -> Sheet:
    """The perfect sheet beside sheets that are bent by its mode a little."""
    sheet = sheet_of(thickness, cells)
    point, u, _, _ = _ended(sheet)
    rows: list[tuple[Cell, ...]] = [(0.0, sheet.amplitude(u) / thickness, None)]
    for share in (1e-3, 1e-2, 1e-1):
        bent = imperfect(sheet, point, share * thickness)
        cost = Cost()
        *_, last = follow(bent.equations, bent.start, solver=SparseSolver(),
                          settings=FROM_SLACK, cost=cost)  # fmt: skip
        height = bent.amplitude(last.branch.end[0]) / thickness
        rows.append((share, height, cost.factorisations))
    columns = ("imperfection / t", "amplitude / t at the end", "tangents")
    note = "Without one, from the bifurcation; with one, along the path from the slack sheet."
    return Sheet("Imperfection by the buckling mode", columns, tuple(rows), note)


def imperfect(sheet: Stretched, point: SingularPoint, amplitude: float) -> Stretched:
    """The same sheet, bent without stress by its mode, with that height of the crest (m)."""
    shape = sheet.equations.supports.change(point.mode, 0.0)
    scale = amplitude / sheet.amplitude(point.mode)
    return Stretched(sheet.thickness, sheet.strain, sheet.cells, scale * shape)


if __name__ == "__main__":
    main(study)
