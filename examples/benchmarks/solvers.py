"""Linear solvers, and what a step costs, against the number of unknowns.

Tangents with friction of a strip that lies around a roller; longer strips of a few widths.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from statistics import median
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from anmstrip.continuation.expansion import Cost, Parameter, expand
from anmstrip.driver.run import Run
from anmstrip.equilibrium import Equilibrium
from anmstrip.linalg.direct import BandPlan, PardisoPlan, SuperLUPlan, pardiso_is_there
from anmstrip.linalg.factors import Factors
from anmstrip.linalg.solvers import SparseSolver, planned
from effects import equations_at_end
from figures import Plot, curves, exponent
from harness import Report, Sheet, main
from strips import growing

Array = NDArray[np.float64]
T = TypeVar("T")

ORDER = 20

STRIPS = {
    2: (40, 160, 640, 2560, 5550),
    8: (24, 100, 400, 1850),
    20: (25, 80, 320, 790),
    40: (50, 100, 200),
}
"""Elements across → elements along, longer than wide; up to 2e5 unknowns."""

QUICK = {2: (20, 40, 80), 8: (12, 24)}

WIDEST = 700
"""Half bandwidth above which the band is not tried."""

LEAST = 4000
"""Unknowns from which on the growth of a step's cost is fitted."""


@dataclass(frozen=True)
class Direct:
    """One solver on one tangent; seconds of the processor."""

    across: int
    unknowns: int
    half_band: int
    solver: str
    factorisation: float  # of a known pattern
    solves: float  # ``ORDER`` back-substitutions
    pattern: float  # further time of the first factorisation
    refinements: int  # steps of refinement of a solution
    residual: float  # largest, over the largest entries of K x and b (scaled)
    chosen: str  # marked where the program takes it


@dataclass(frozen=True)
class Expansion:
    """One expansion, split by phases, in seconds."""

    across: int
    unknowns: int
    solver: str
    series: float
    tangent: float
    factorisation: float
    solves: float
    ratio: float  # series over all the rest

    @property
    def whole(self) -> float:
        """Seconds of the whole expansion."""
        return self.series + self.tangent + self.factorisation + self.solves


def study(quick: bool = False) -> Report:
    """All solvers and expansions on all strips."""
    solved: list[Direct] = []
    steps: list[Expansion] = []
    for across, lengths in (QUICK if quick else STRIPS).items():
        for along in lengths:
            equations, u, control = lying((along, across))
            matrix = equations.recurrence(u, control, 1).tangent()
            solved += list(_solvers(across, matrix))
            steps.append(expansion(across, equations, u, control))
    return Report(
        name="solvers",
        title="Linear solvers, and what a step costs, against size",
        data=_sheet("", solved),
        sheets=(
            _sheet("Linear solvers", solved, NOTE),
            _sheet("Steps", steps, STEPS),
            _growth(steps),
        ),
        figures={
            "solvers.png": curves(*_solver_plots(solved)),
            "solvers-steps.png": curves(*_step_plots(steps)),
        },
    )


NOTE = (
    f"Tangents with friction of a strip around a roller; {ORDER} back-substitutions. Where the "
    "tangent is symmetric and positive definite, the band is three times cheaper (Cholesky)."
)

STEPS = (
    f"Medians of three expansions of order {ORDER}. The ratio of the series to tangent, "
    "factorisation and back-substitutions together should be at most 1."
)


def _sheet(title: str, rows: Sequence[Direct] | Sequence[Expansion], note: str = "") -> Sheet:
    names = tuple(field.name.replace("_", " ") for field in fields(rows[0]))
    return Sheet(title, names, tuple(astuple(row) for row in rows), note)


def lying(cells: tuple[int, int]) -> tuple[Equilibrium, Array, float]:
    """A shell laid around a roller, where a stage with friction begins; nothing is solved."""
    scene = dict(growing("shell", cells))["friction"]
    run = Run(scene)
    a, march = run.assembly, run.march
    assert a.thread is not None
    march.full = a.thread.guess(a.strip, a.pattern)
    march.course.finish(scene.course[0])
    run.state = march.here(march.course.plan(scene.course[1], {}))
    return equations_at_end(run)


# solvers ------------------------------------------------------------------------------


def _solvers(across: int, matrix: csc_matrix) -> Iterator[Direct]:
    chosen, band = type(planned(matrix)), BandPlan(matrix)
    kinds: list[type[BandPlan | SuperLUPlan]] = [BandPlan] if band.width <= WIDEST else []
    kinds += [SuperLUPlan, *([PardisoPlan] if pardiso_is_there() else [])]
    for kind in kinds:
        yield direct(across, matrix, kind, band.width, kind is chosen)


def direct(
    across: int,
    matrix: csc_matrix,
    kind: type[BandPlan | SuperLUPlan],
    width: int,
    chosen: bool,
) -> Direct:
    """Time one solver on one matrix."""
    first, (plan, _) = _timed(lambda: _factorised(kind, matrix))
    again, factors = _timed(lambda: plan.factorise(matrix))
    b = matrix @ np.cos(np.arange(matrix.shape[0]))
    spent, x = _timed(lambda: _solved(factors, b))
    size = (np.abs(matrix) @ np.abs(x) + np.abs(b)).max()
    return Direct(
        across,
        matrix.shape[0],
        width,
        plan.name,
        again,
        spent,
        first - again,
        getattr(factors, "steps", 0),
        float(np.abs(matrix @ x - b).max() / size),
        "chosen" if chosen else "",
    )


def _factorised(
    kind: type[BandPlan | SuperLUPlan], matrix: csc_matrix
) -> tuple[BandPlan | SuperLUPlan, Factors]:
    plan = kind(matrix)
    return plan, plan.factorise(matrix)


def _solved(factors: Factors, b: Array) -> Array:
    for _ in range(ORDER):
        x = factors.solve(b)
    return x


def _timed(work: Callable[[], T]) -> tuple[float, T]:
    begin = time.process_time()
    found = work()
    return time.process_time() - begin, found


# steps --------------------------------------------------------------------------------


def expansion(
    across: int, equations: Equilibrium, u: Array, control: float, repeats: int = 3
) -> Expansion:
    """Time expansions where a strip lies; the first, which finds patterns, does not count."""
    samples, solver = [], SparseSolver()
    for _ in range(repeats + 1):
        cost = Cost()
        expand(
            equations,
            u,
            control,
            order=ORDER,
            solver=solver,
            parameter=Parameter(1.0),
            cost=cost,
        )
        samples.append(cost.seconds)
    phases = ("series", "tangent", "factorisation", "back-substitution")
    series, *rest = (median(sample[phase] for sample in samples[1:]) for phase in phases)
    tangent, factorisation, solves = rest
    ratio = series / sum(rest)
    return Expansion(across, len(u), solver.name, series, tangent, factorisation, solves, ratio)


def _growth(steps: Sequence[Expansion]) -> Sheet:
    """Return the exponents of the cost of a step against the number of unknowns, for each width."""
    rows = []
    for across, own in _by_width(steps).items():
        long = [s for s in own if s.unknowns >= LEAST] or own
        p = exponent([s.unknowns for s in long], [s.whole for s in long])
        rows.append((across, len(long), long[0].unknowns, long[-1].unknowns, p))
    columns = ("across", "strips", "from (unknowns)", "to", "exponent")
    note = "Whole cost of a step ~ unknowns^p along the strip; p should be at most 1.2."
    return Sheet("Growth of the cost of a step", columns, tuple(rows), note)


def _by_width(steps: Sequence[Expansion]) -> dict[int, list[Expansion]]:
    return {a: [s for s in steps if s.across == a] for a in dict.fromkeys(s.across for s in steps)}


def _solver_plots(rows: Sequence[Direct]) -> Iterator[Plot]:
    """A plot for each width: a factorisation and its back-substitutions."""
    for across in dict.fromkeys(row.across for row in rows):
        own = [row for row in rows if row.across == across]
        lines = {
            name: (
                [float(r.unknowns) for r in own if r.solver == name],
                [r.factorisation + r.solves for r in own if r.solver == name],
            )
            for name in dict.fromkeys(row.solver for row in own)
        }
        yield Plot(f"unknowns, {across} across", f"s per factorisation and {ORDER} solves", lines)


def _step_plots(steps: Sequence[Expansion]) -> Iterator[Plot]:
    whole, ratio = {}, {}
    for across, own in _by_width(steps).items():
        sizes = [float(s.unknowns) for s in own]
        whole[f"{across} across"] = (sizes, [s.whole for s in own])
        ratio[f"{across} across"] = (sizes, [s.ratio for s in own])
    yield Plot("unknowns", "s per step", whole)
    yield Plot("unknowns", "series / linear algebra", ratio, ("log", "linear"))


if __name__ == "__main__":
    main(study)
