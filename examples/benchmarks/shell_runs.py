"""Benchmarks of shells followed by series and by Newton's method, and how far off they are."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.bifurcations import Remembering, SingularPoint, watched
from anmstrip.continuation.expansion import Cost
from anmstrip.continuation.follow import Settings, Step, follow
from anmstrip.continuation.newton import Corrected
from anmstrip.continuation.path import Path
from anmstrip.linalg.solvers import SparseSolver
from riks import RiksSettings, arc_steps
from shell_problems import Benchmark

Array = NDArray[np.float64]

SAMPLES = 40
"""Points of a branch that are drawn and compared."""


def settings(order: int = 20, tolerance: float = 1e-4, *, rational: bool = True) -> Settings:
    """Along the arc, as quotients unless told otherwise."""
    return Settings(order=order, tolerance=tolerance, arclength=True, rational=rational)


@dataclass(frozen=True)
class Followed:
    """A benchmark followed to the end of its table.

    Attributes
    ----------
    benchmark : Benchmark
    steps : tuple of Step
    points : tuple of SingularPoint
        If they were looked for.
    tangents : int
        Of the path itself.
    seconds : float
    """

    benchmark: Benchmark
    steps: tuple[Step, ...]
    points: tuple[SingularPoint, ...]
    tangents: int
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
        """Rows (share of the load, readings...) at given loads, which must not turn back."""
        path = Path(tuple(step.branch for step in self.steps))
        return np.array([[load, *self.benchmark.reading(path(load))] for load in loads])


def followed(benchmark: Benchmark, choices: Settings, *, watch: bool = False) -> Followed:
    """Follow a benchmark by series."""
    solver, cost = Remembering(SparseSolver()), Cost()
    begin = time.perf_counter()
    steps = follow(
        benchmark.equations,
        benchmark.start,
        solver=solver,
        settings=choices,
        target=benchmark.target,
        cost=cost,
    )
    if watch:
        pairs = list(watched(benchmark.equations, steps, solver, choices))
    else:
        pairs = [(step, []) for step in steps]
    seconds = time.perf_counter() - begin
    points = tuple(point for _, found in pairs for point in found)
    taken = tuple(step for step, _ in pairs)
    return Followed(benchmark, taken, points, cost.factorisations, seconds)


@dataclass(frozen=True)
class Iterated:
    """A benchmark followed by Newton's method.

    Attributes
    ----------
    steps : tuple of Corrected
    tangents : int
    seconds : float
    """

    steps: tuple[Corrected, ...]
    tangents: int
    seconds: float


def iterated(benchmark: Benchmark, tolerance: float = 1e-4) -> Iterated:
    """Follow a benchmark by Newton's method along the arc."""
    cost, begin = Cost(), time.perf_counter()
    steps = tuple(
        arc_steps(
            benchmark.equations,
            benchmark.start,
            solver=SparseSolver(),
            settings=RiksSettings(tolerance=tolerance),
            target=benchmark.target,
            cost=cost,
        )
    )
    return Iterated(steps, cost.factorisations, time.perf_counter() - begin)


def miss(found: Followed, expected: Array) -> float:
    """Largest error of a path, as a share of the largest displacement.

    At the loads of the expected rows; where the load turns back, their distance from the path
    as a curve, with load and displacement in units of their largest values.
    """
    size = np.abs(expected).max(axis=0)
    if found.benchmark.snaps:
        return float(_distances(expected / size, found.curve / size).max())
    inside = expected[(expected[:, 0] > 0.0) & (expected[:, 0] <= found.curve[-1, 0])]
    return float((np.abs(found.at(inside[:, 0]) - inside)[:, 1:] / size[1:].max()).max())


def _distances(points: Array, line: Array) -> Array:
    """Of points from a polygonal line, shape (points,)."""
    start, along = line[:-1], np.diff(line, axis=0)
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    from_start = points[:, None] - start
    share = np.clip((from_start * along).sum(axis=2) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(from_start - share[..., None] * along, axis=2).min(axis=1))
