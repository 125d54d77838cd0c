"""Linear solvers, and what a step costs, against the number of unknowns.

Tangents with friction of a strip that lies around a roller; longer strips of a few widths.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from statistics import median

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from anmstrip.continuation.expansion import Parameter, expand
from anmstrip.continuation.path import Cost
from anmstrip.driver.run import Run
from anmstrip.equilibrium import Equilibrium
from anmstrip.linalg.direct import BandPlan, PardisoPlan, SuperLUPlan, pardiso_is_there
from anmstrip.linalg.solvers import SparseSolver, fastest_plan
from effects import equations_at_end
from figures import Plot, curves, exponent
from harness import Report, Sheet, main
from strips import growing

Array = NDArray[np.float64]

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
    """Time all solvers and expansions on all strips."""
    solved: list[Direct] = []
    steps: list[Expansion] = []
    for across, lengths in (QUICK if quick else STRIPS).items():
        for along in lengths:
            equations, u, control = lying((along, across))
            solved += solvers_of(across, equations.recurrence(u, control, 1).tangent())
            steps.append(expansion(across, equations, u, control))
    widths = dict.fromkeys(s.across for s in steps)
    own = {across: [s for s in steps if s.across == across] for across in widths}
    return Report(
        name="solvers",
        title="Linear solvers, and what a step costs, against size",
        data=_sheet("", solved),
        sheets=(
            _sheet("Linear solvers", solved, NOTE),
            _sheet("Steps", steps, STEPS),
            _growth(own),
        ),
        figures={
            "solvers.png": curves(*_solver_plots(solved)),
            "solvers-steps.png": curves(*_step_plots(own)),
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
    """Return equations, state and control where a stage with friction begins, with nothing solved.

    The shell is laid around a roller.
    """
    scene = dict(growing("shell", cells))["friction"]
    run = Run(scene)
    a, march = run.assembly, run.march
    assert a.thread is not None
    march.full = a.thread.guess(a.strip, a.pattern)
    march.course.finish(scene.course[0])
    run.state = march.here(march.course.plan(scene.course[1], {}))
    return equations_at_end(run)


def solvers_of(across: int, matrix: csc_matrix) -> Iterator[Direct]:
    """Time every solver that is there on one matrix."""
    chosen, width = type(fastest_plan(matrix)), BandPlan(matrix).width
    b = matrix @ np.cos(np.arange(matrix.shape[0]))
    kinds = [BandPlan] if width <= WIDEST else []
    for kind in [*kinds, SuperLUPlan, *([PardisoPlan] if pardiso_is_there() else [])]:
        clock = [time.process_time()]
        plan = kind(matrix)
        plan.factorise(matrix)
        clock.append(time.process_time())
        factors = plan.factorise(matrix)
        clock.append(time.process_time())
        for _ in range(ORDER):
            x = factors.solve(b)
        clock.append(time.process_time())
        first, again, spent = np.diff(clock).tolist()
        size = (np.abs(matrix) @ np.abs(x) + np.abs(b)).max()
        residual = float(np.abs(matrix @ x - b).max() / size)
        times = (again, spent, first - again, getattr(factors, "steps", 0), residual)
        mark = "chosen" if kind is chosen else ""
        yield Direct(across, matrix.shape[0], width, plan.name, *times, mark)


def expansion(across: int, equations: Equilibrium, u: Array, control: float) -> Expansion:
    """Time three expansions where a strip lies, after one that finds patterns."""
    samples, solver = [], SparseSolver()
    for _ in range(4):
        cost = Cost()
        choices = {"solver": solver, "parameter": Parameter(1.0), "cost": cost}
        expand(equations, u, control, order=ORDER, **choices)
        samples.append(cost.seconds)
    phases = ("series", "tangent", "factorisation", "back-substitution")
    series, *rest = (median(sample[phase] for sample in samples[1:]) for phase in phases)
    return Expansion(across, len(u), solver.name, series, *rest, series / sum(rest))


def _growth(steps: Mapping[int, Sequence[Expansion]]) -> Sheet:
    """Return the exponents of the cost of a step against the unknowns, for each width."""
    rows = []
    for across, own in steps.items():
        long = [s for s in own if s.unknowns >= LEAST] or own
        p = exponent([s.unknowns for s in long], [s.whole for s in long])
        rows.append((across, len(long), long[0].unknowns, long[-1].unknowns, p))
    columns = ("across", "strips", "from (unknowns)", "to", "exponent")
    note = "Whole cost of a step ~ unknowns^p along the strip; p should be at most 1.2."
    return Sheet("Growth of the cost of a step", columns, tuple(rows), note)


def _solver_plots(rows: Sequence[Direct]) -> Iterator[Plot]:
    """Yield a plot for each width: a factorisation and its back-substitutions."""
    for across in dict.fromkeys(row.across for row in rows):
        lines: dict[str, tuple[list[float], list[float]]] = {}
        for r in (row for row in rows if row.across == across):
            x, y = lines.setdefault(r.solver, ([], []))
            x.append(float(r.unknowns))
            y.append(r.factorisation + r.solves)
        yield Plot(f"unknowns, {across} across", f"s per factorisation and {ORDER} solves", lines)


def _step_plots(steps: Mapping[int, Sequence[Expansion]]) -> Iterator[Plot]:
    lines = {f"{across} across": own for across, own in steps.items()}
    sizes = {name: [float(s.unknowns) for s in own] for name, own in lines.items()}
    whole = {name: (sizes[name], [s.whole for s in own]) for name, own in lines.items()}
    ratio = {name: (sizes[name], [s.ratio for s in own]) for name, own in lines.items()}
    yield Plot("unknowns", "s per step", whole)
    yield Plot("unknowns", "series / linear algebra", ratio, ("log", "linear"))


if __name__ == "__main__":
    main(study)
