"""A sheet that wrinkles because it is stretched between two grips.

3.5 × 1, thickness 2e-4, ν = 0.45.  Expected: flat up to a strain of 0.00235, then wrinkles along
the pull, 0.202 apart at the onset and 0.149 at four times that strain, 13 thicknesses high.
Cerda and Mahadevan's 2 √π (D/T)^(1/4) √L gives these within 3 % when L is the length of the
wrinkles; with the length between the grips it gives 14 % more at the end.  The wrinkled quarter and
the buckling mode are written for ParaView.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from anmstrip.continuation.bifurcations import SingularPoint, switch_branch, watch_singular_points
from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Cost
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid, grip, symmetry
from anmstrip.linalg.solvers import Remembering, SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.shell import Membrane, isometric_bending
from anmstrip.results.fields import FieldSampler
from anmstrip.results.vtk import write_surface

LENGTH, WIDTH, THICKNESS, POISSON = 3.5, 1.0, 2e-4, 0.45  # E = 1 does not matter

STRAIN = 4.0 * 5.9e4 * THICKNESS**2
"""Mean strain at the control 1, about four times that of the onset."""

SETTINGS = Settings(order=15, tolerance=1e-6, arclength=True, rational=True)


def stretched_sheet(cells: tuple[int, int]) -> Equilibrium:
    """Return equations of a quarter: grip at x = 0, symmetry at x = L/2 and y = 0."""
    mesh = grid(np.linspace(0, LENGTH / 2, cells[0] + 1), np.linspace(0, WIDTH / 2, cells[1] + 1))
    strip = Strip(mesh, THICKNESS, Material(1.0, POISSON))
    pattern, tension = Pattern(strip), THICKNESS * STRAIN
    effects = [Membrane(strip), isometric_bending(strip, pattern)]
    model = Model(strip, pattern, effects, Scales(WIDTH, tension * WIDTH, tension))
    held = [grip(strip, "entry"), symmetry(strip, "exit", 0), symmetry(strip, "right", 1)]
    rest = Supports.at_rest(strip.unknowns, np.unique(np.concatenate(held)))
    pull = np.zeros(strip.unknowns)
    pull[3 * strip.edges["entry"].values] = -STRAIN * LENGTH / 2
    return Equilibrium(model, Supports(rest.free, rest.start, pull), Controls({}))


def onset(sheet: Equilibrium) -> SingularPoint:
    """Return the first bifurcation of the flat sheet."""
    solver, start = Remembering(SparseSolver()), np.zeros(len(sheet.supports.free))
    steps = follow(sheet, start, solver=solver, settings=SETTINGS)
    found = watch_singular_points(sheet, steps, solver, SETTINGS, stop=True)
    return next(points[0] for _, points in found if points)


def profile(sheet: Equilibrium, u: np.ndarray, edge: str, axis: int) -> CubicHermiteSpline:
    """Return the heights along a line of symmetry, as the elements have them."""
    strip, nodes = sheet.model.strip, sheet.model.strip.edges[edge].nodes
    z = sheet.supports.full(u, 0.0).reshape(-1, 3)[:, 2]
    values, slopes = (z[strip.dofs(name)[nodes]] for name in ("u", ("u_x", "u_y")[axis]))
    return CubicHermiteSpline(strip.mesh.p[axis, nodes], values, slopes)


def wavelengths(
    sheet: Equilibrium, shape: np.ndarray, u: np.ndarray, control: float
) -> tuple[float, float]:
    """Return the wavelength of a shape across, and that of the formula with its own length."""
    turns = profile(sheet, shape, "exit", 1).derivative().roots(extrapolate=False)
    crest, x = profile(sheet, shape, "right", 0), np.linspace(0.0, LENGTH / 2, 500)
    length = np.pi * np.sqrt((crest(x) ** 2).sum() / (crest(x, 1) ** 2).sum())
    membrane = sheet.model.effects[0]
    assert isinstance(membrane, Membrane)
    forces, weights = membrane.at(sheet.supports.full(u, control))[0, 0], membrane.operator.weights
    stiffness = sheet.model.strip.bending_stiffness / (forces @ weights / weights.sum())
    formula = 2.0 * np.sqrt(np.pi * length) * stiffness**0.25
    return 2.0 * float(turns[turns > 1e-2 * WIDTH].min()), float(formula)


def main(cells: tuple[int, int], directory: Path) -> None:
    """Stretch it to the onset, and then to four times that strain."""
    sheet, cost, solver = stretched_sheet(cells), Cost(), SparseSolver()
    point = onset(sheet)
    start, pace = switch_branch(sheet, point, 0.3 * THICKNESS, solver, 1e-6, cost)
    *_, last = follow(sheet, start, solver=solver, settings=SETTINGS, pace=pace, cost=cost)
    u, control = last.branch.end
    for label, shape, state, share in (
        ("onset", point.mode, point.u, point.control),
        ("end", u, u, control),
    ):
        wave, formula = wavelengths(sheet, shape, state, share)
        print(f"{label} at strain {share * STRAIN:.4f}: {wave:.4f}, formula {formula:.4f}")
        assert abs(wave / formula - 1.0) < 0.08
    height = abs(float(profile(sheet, u, "exit", 1)(0.0))) / THICKNESS
    print(f"{height:.2f} t high, {cost.factorisations} tangents")
    surface = FieldSampler(sheet.model.strip)
    moved = surface.interpolate(sheet.supports.full(u, 0.0))
    mode = surface.interpolate(sheet.supports.change(point.mode, 0.0))
    directory.mkdir(parents=True, exist_ok=True)
    fields = {"displacement": moved, "mode": mode}
    write_surface(directory / "wrinkles.vtu", surface.reference.T + moved, surface.cells, fields)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="14 × 18 elements of a quarter")
    parser.add_argument("-o", type=Path, default=Path("results/sheet"), help="where to write")
    given = parser.parse_args()
    main((14, 18) if given.quick else (16, 24), given.o)
