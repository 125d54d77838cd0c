"""Large deflections of shells with published tables: the problems, and the tables.

Source of problems and tables: Sze, Liu & Lo, *Popular benchmark problems for geometric nonlinear
analysis of shells*, Finite Elem. Anal. Des. 40 (2004) 1551–1569.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.bifurcations import SingularPoint, watch_singular_points
from anmstrip.continuation.follow import PathStep, Settings, follow
from anmstrip.continuation.newton import Corrected
from anmstrip.continuation.path import Cost, Path
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.geometry import reference_surface
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid, simple_support, symmetry
from anmstrip.linalg.solvers import Remembering, SparseSolver
from anmstrip.mechanics.effects import Controls, Effect, LoadEffect
from anmstrip.mechanics.loads import edge_force, edge_moment
from anmstrip.mechanics.shell import KirchhoffLove, Membrane, isometric_bending
from harness import ROOT
from newton_methods import RiksSettings, arc_steps

Array = NDArray[np.float64]

TABLES = ROOT / "examples" / "benchmarks" / "tables"

ROOF_RADIUS, ROOF_HALF_LENGTH, ROOF_ANGLE, ROOF_LOAD = 2540.0, 254.0, 0.1, 3000.0
"""mm, mm, rad, N; E in N/mm²."""

GRADING = 1.5
"""Power that makes elements small under a point force, where moments grow like a logarithm."""


@dataclass(frozen=True)
class Benchmark:
    """Equations whose control is the share of the full load, and displacements to read."""

    name: str
    equations: Equilibrium
    rows: NDArray[np.int64]  # unknowns that are read, shape (m,)
    weights: Array  # averages over an edge, shape (readings, m)
    labels: tuple[str, ...]  # of the readings
    table: str  # name of the published table
    columns: tuple[int, ...]  # of the table: share of the load, then the readings
    target: float = 1.0  # control at the end of the table
    snaps: bool = False  # whether the load turns back on the way

    @property
    def start(self) -> Array:
        """The unloaded state, shape (free,)."""
        return np.zeros(len(self.equations.supports.free))

    def reading(self, u: Array) -> Array:
        """Return displacements as the table lists them, shape (readings,)."""
        return self.weights @ self.equations.supports.full(u, 0.0)[self.rows]

    @property
    def published(self) -> Array:
        """Rows (share of the load, readings...) of the table."""
        return published(self.table)[:, list(self.columns)]


def published(name: str) -> Array:
    """Return a published table, comments and heading left out."""
    text = (TABLES / f"{name}.csv").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])


def end_shear(cells: int = 16, *, curved: bool = True, thickness: float = 0.1) -> Benchmark:
    """Return the cantilever of 10 × 1 under a dead force of 4 at its end: −U and W of the tip.

    Another thickness changes E so that the bending stiffness stays.
    """
    strip = _strip(10.0, cells, thickness)
    equations = _loaded(strip, edge_force(strip, "exit"), (0.0, 0.0, 4.0), 10.0, curved)
    return _tip("end shear", equations, "sze_cantilever_end_shear", (0, 1, 2), strip)


def end_moment(cells: int = 16, *, curved: bool = True) -> Benchmark:
    """Return the strip of 12 × 1 rolled up to a full circle by a moment at its end.

    The table's columns are those of the exact solution without stretch.
    """
    strip = _strip(12.0, cells, 0.1)
    full = 2.0 * np.pi * strip.bending_stiffness / 12.0
    equations = _loaded(strip, edge_moment(strip, "exit"), full, 12.0, curved)
    return _tip("end moment", equations, "sze_cantilever_end_moment", (0, 2, 4), strip)


def slit_plate(cells: tuple[int, int] = (5, 40), *, curved: bool = True) -> Benchmark:
    """Return the annulus, radii 6 and 10, slit along a radius: one side clamped, the other lifted.

    A rectangle of radius and angle carries the elements: no edge is approximated.
    """
    mesh = grid(np.linspace(6.0, 10.0, cells[0] + 1), np.linspace(0.0, 2 * np.pi, cells[1] + 1))
    flat = reference_surface(
        lambda r, angle: np.stack([r * np.cos(angle), r * np.sin(angle), 0.0 * r])
    )
    strip = Strip(mesh, 0.03, Material(21e6, 0.0), surface=flat)
    load = edge_force(strip, "left")
    equations = _loaded(strip, load, (0.0, 0.0, 0.8), 10.0, curved, "right", 3.2)
    edge = strip.edges["left"].values
    return Benchmark(
        "slit annular plate", equations, 3 * edge[[0, -1]] + 2, np.eye(2),
        ("W inside", "W outside"), "sze_slit_annular_plate", (0, 1, 2),
    )  # fmt: skip


def hinged_roof(thickness: float = 12.7, cells: int = 8, *, whole: bool = False) -> Benchmark:
    """Return the cylindrical roof, hinged along its straight edges, pressed down at its centre.

    A quarter with its symmetry, or the whole, which may lose it.
    """
    shares = np.linspace(-1.0 if whole else 0.0, 1.0, cells + 1)
    shares = np.sign(shares) * np.abs(shares) ** GRADING
    xs, angles = ROOF_HALF_LENGTH * shares, ROOF_ANGLE * shares
    roof = reference_surface(
        lambda x, a: ROOF_RADIUS * np.stack([x / ROOF_RADIUS, np.sin(a), np.cos(a)])
    )
    strip = Strip(grid(xs, angles), thickness, Material(3102.75, 0.3), surface=roof)
    held = [simple_support(strip, "left", component) for component in range(3)]
    if whole:
        held += [simple_support(strip, "right", component) for component in range(3)]
    else:
        held += [symmetry(strip, "entry", 0), symmetry(strip, "right", 1)]
    force = ROOF_LOAD * (1.0 if whole else 0.25)
    node = strip.node_values[np.abs(strip.mesh.p).sum(axis=0).argmin()]
    point = LoadEffect("point force", "point.force", np.zeros(strip.scalars), strip.kinematics)
    point.load[node] = 1.0
    supports = Supports.at_rest(strip.unknowns, np.unique(np.concatenate(held)))
    effects: list[Effect] = [Membrane(strip), KirchhoffLove(strip), point]
    model = Model(strip, Pattern(strip), effects, Scales(10.0, force, 1.0))
    equations = Equilibrium(model, supports, _growing(point.control, (0.0, 0.0, -force)))
    table = f"sze_hinged_roof_t{thickness:g}".replace(".", "p")
    return Benchmark(
        f"hinged roof, t = {thickness:g}", equations, np.array([3 * node + 2]), -np.eye(1),
        ("−W centre",), table, (0, 1), float(published(table)[-1, 0]), snaps=True,
    )  # fmt: skip


def _strip(length: float, cells: int, thickness: float) -> Strip:
    mesh = grid(np.linspace(0.0, length, cells + 1), np.array([-0.5, 0.5]))
    return Strip(mesh, thickness, Material(1200.0 / thickness**3, 0.0))


def _growing(control: str, value: float | Sequence[float]) -> Controls:
    slope = np.asarray(value, dtype=float)
    return Controls({control: np.zeros_like(slope)}, {control: slope})


def _loaded(
    strip: Strip,
    load: Effect,
    full: float | Sequence[float],
    length: float,
    curved: bool,
    clamped: str = "entry",
    force: float | None = None,
) -> Equilibrium:
    """Return equations of a strip with one edge clamped and one load."""
    pattern = Pattern(strip)
    bending: Effect = KirchhoffLove(strip) if curved else isometric_bending(strip, pattern)
    size = force or strip.bending_stiffness / length**2 * 4.0
    model = Model(strip, pattern, [Membrane(strip), bending, load], Scales(length, size, size))
    supports = Supports.at_rest(strip.unknowns, strip.clamp(clamped))
    return Equilibrium(model, supports, _growing(load.control, full))  # type: ignore[union-attr]


def _tip(
    name: str, equations: Equilibrium, table: str, columns: tuple[int, ...], strip: Strip
) -> Benchmark:
    edge = strip.edges["exit"].values
    rows = np.concatenate([3 * edge, 3 * edge + 2])
    weights = np.kron(np.diag([-1.0, 1.0]), np.full((1, len(edge)), 1.0 / len(edge)))
    return Benchmark(name, equations, rows, weights, ("−U tip", "W tip"), table, columns)


SAMPLES = 40
"""Points of a branch that are drawn and compared."""


def settings(order: int = 20, tolerance: float = 1e-4, *, rational: bool = True) -> Settings:
    """Return settings along the arc, as quotients unless told otherwise."""
    return Settings(order=order, tolerance=tolerance, arclength=True, rational=rational)


@dataclass(frozen=True)
class Followed:
    """A benchmark followed to the end of its table."""

    benchmark: Benchmark
    steps: tuple[PathStep, ...]
    points: tuple[SingularPoint, ...]  # if they were looked for
    tangents: int  # of the path itself
    seconds: float

    @cached_property
    def curve(self) -> Array:
        """Rows (share of the load, readings...) along the whole path."""
        rows = [(self.benchmark.start, 0.0)]
        for step in self.steps:
            lengths = np.linspace(0.0, step.branch.length, SAMPLES + 1)[1:]
            rows += [step.branch(a) for a in lengths]
        return np.array([[control, *self.benchmark.reading(u)] for u, control in rows])

    @property
    def ends(self) -> Array:
        """Rows at the ends of the steps."""
        return self.curve[::SAMPLES]

    @property
    def folds(self) -> list[float]:
        """Loads at limit points, as they stand in the series."""
        return [step.branch(a)[1] for step in self.steps for a in step.branch.folds]

    def at(self, loads: Array) -> Array:
        """Return rows (share of the load, readings...) at given loads, which must not turn back."""
        path = Path(tuple(step.branch for step in self.steps))
        return np.array([[load, *self.benchmark.reading(path(load))] for load in loads])


def followed(benchmark: Benchmark, choices: Settings, *, watch: bool = False) -> Followed:
    """Follow a benchmark by series, and look for singular points if asked."""
    solver, cost, begin = Remembering(SparseSolver()), Cost(), time.perf_counter()
    options = {"solver": solver, "settings": choices, "target": benchmark.target, "cost": cost}
    path = follow(benchmark.equations, benchmark.start, **options)
    steps, points = [], []
    for step, found in (
        watch_singular_points(benchmark.equations, path, solver, choices)
        if watch
        else ((s, []) for s in path)
    ):
        steps.append(step)
        points += found
    seconds = time.perf_counter() - begin
    return Followed(benchmark, tuple(steps), tuple(points), cost.factorisations, seconds)


@dataclass(frozen=True)
class Iterated:
    """A benchmark followed by Newton's method."""

    steps: tuple[Corrected, ...]
    tangents: int
    seconds: float


def iterated(benchmark: Benchmark, tolerance: float = 1e-4) -> Iterated:
    """Follow a benchmark by Newton's method along the arc."""
    cost, begin = Cost(), time.perf_counter()
    options = {"solver": SparseSolver(), "settings": RiksSettings(tolerance=tolerance)}
    options |= {"target": benchmark.target, "cost": cost}
    steps = tuple(arc_steps(benchmark.equations, benchmark.start, **options))
    return Iterated(steps, cost.factorisations, time.perf_counter() - begin)


def miss(found: Followed, expected: Array) -> float:
    """Return the largest error of a path, as a share of the largest displacement.

    At the loads of the expected rows; where the load turns back, their distance from the path
    as a curve, with load and displacement in units of their largest values.
    """
    size = np.abs(expected).max(axis=0)
    if found.benchmark.snaps:
        return float(_distances(expected / size, found.curve / size).max())
    inside = expected[(expected[:, 0] > 0.0) & (expected[:, 0] <= found.curve[-1, 0])]
    return float((np.abs(found.at(inside[:, 0]) - inside)[:, 1:] / size[1:].max()).max())


def _distances(points: Array, line: Array) -> Array:
    """Return distances of points from a polygonal line, shape (points,)."""
    start, along = line[:-1], np.diff(line, axis=0)
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    from_start = points[:, None] - start
    share = np.clip((from_start * along).sum(axis=2) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(from_start - share[..., None] * along, axis=2).min(axis=1))
