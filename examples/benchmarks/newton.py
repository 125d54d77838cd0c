"""Series beside Newton's method, on the same equations, to the same final error.

Newton's method is given what is known to help, one thing after the other: a guess from the last
three states, a line search, steps as long as they converge, tangents that are kept; and stress and
pressure as unknowns of points' own, which need no line search.  In time both follow the same
backward differences with the same error control; only the path of each step differs.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from anmstrip.continuation.follow import PathSolver, Settings, follow
from anmstrip.continuation.newton import LoadSteps, NewtonPath
from anmstrip.continuation.path import Cost, Outcome
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.linalg.solvers import SparseSolver
from cantilever import cantilever, tip
from harness import Cell, Report, Sheet, main
from newton_methods import ByWayOf, Mixed, Own
from strips import capstan, pressed, threaded

PLAIN = LoadSteps(tolerance=1e-6)
GUESSED = replace(PLAIN, degree=2)
SEARCHED = replace(GUESSED, halvings=8)
LONG = replace(SEARCHED, wanted=12, most=40)
STRAIGHT = replace(PLAIN, degree=1)
AT_ONCE = replace(PLAIN, first=1.0, most=50)


def mixed(steps: LoadSteps, *, stress: bool = True, pressure: bool = True) -> NewtonPath:
    """Newton's method with unknowns of points' own."""
    return NewtonPath(steps, iteration=partial(Mixed, own=Own(stress, pressure)))


METHODS: dict[str, PathSolver] = {
    "series": follow,
    "Newton": NewtonPath(PLAIN),
    "+ guess": NewtonPath(GUESSED),
    "+ line search": NewtonPath(SEARCHED),
    "+ long steps": NewtonPath(LONG),
    "+ tangents kept": NewtonPath(replace(LONG, kept=0.05)),
    "+ loose": NewtonPath(replace(LONG, kept=0.05, tolerance=1e-4)),
    "independent stress": mixed(SEARCHED, pressure=False),
    "primal-dual contact": mixed(GUESSED, stress=False),
    "both": mixed(GUESSED),
    "both, straight guess": mixed(STRAIGHT),
    "the same, loose": mixed(replace(STRAIGHT, tolerance=1e-4)),
}
"""Every line with + has what the ones before have; those of points' own unknowns have the guess,
and, with contact as it was, the line search."""

FAR: dict[str, PathSolver] = {
    **METHODS,
    "+ longest steps": NewtonPath(replace(SEARCHED, wanted=40, most=100)),
}
"""For penalties; on graded contact such steps take three times as many tangents, or lose the way
and end elsewhere."""

GRADED_FIRST = "series by way of graded contact"
"""On a penalty: see :class:`~newton_methods.ByWayOf`."""

BENT: dict[str, PathSolver] = {
    **{name: METHODS[name] for name in ("series", "Newton", "+ guess")},
    "at once": NewtonPath(AT_ONCE),
    "independent stress": mixed(AT_ONCE),
}
"""For the cantilever: its imbalance has to grow before it falls, so a line search only delays."""

TOLERANCE = 1e-3
"""Of the series, and of the steps in time; final states are nearer to the reference."""

STRICT = 1e-8
"""Of the iterations of the reference: round-off leaves E t/T times the last digit, 1e-10."""

COLUMNS = ("problem", "method", "steps", "factorisations", "residuals", "seconds", "error")


@dataclass(frozen=True)
class Trial:
    """A run of one method on one problem."""

    steps: int  # accepted, of load and of time
    cost: Cost
    seconds: float  # of the processor
    value: float  # that the answer is judged by
    outcome: Outcome

    def row(self, problem: str, method: str, exact: float) -> tuple[Cell, ...]:
        """Return the cells of the columns."""
        counts = (self.steps, self.cost.factorisations, self.cost.residuals, self.seconds)
        error = abs(self.value / exact - 1.0) if self.outcome.done else np.inf
        return (problem, method, *counts, error)


Problem = Callable[[PathSolver, float], Trial]
"""Solved by a method, to a tolerance."""


def study(quick: bool = False) -> Report:
    """Compare all methods on all problems."""
    refined = 0.1 if quick else 0.025
    mesh = ("section", 2, refined)
    shell = ("shell", 2 if quick else 8, refined)
    problems: dict[str, Problem] = {
        "cantilever": lambda by, eps: bent(by, eps, 8 if quick else 16),
        "press, section": of_scene(lambda eps: graded(pressed(*mesh, eps)), _normal_force),
        "press, shell": of_scene(lambda eps: graded(pressed(*shell, eps)), _normal_force),
        "capstan, section": of_scene(lambda eps: graded(capstan(*mesh, eps)), _tension_ratio),
        "capstan, shell": of_scene(lambda eps: graded(capstan(*shell, eps)), _tension_ratio),
        "press, penalty": of_scene(lambda eps: pressed(*mesh, eps), _normal_force),
        "capstan, penalty": of_scene(lambda eps: capstan(*mesh, eps), _tension_ratio),
        "threaded": of_scene(lambda eps: threaded(*mesh, eps), _tension_ratio),
    }
    for name in ("cantilever", "press, section", "capstan, section"):
        for by in (follow, mixed(STRAIGHT)):  # kernels are compiled once: that is not timed
            problems[name](by, TOLERANCE)
    law = Run(graded(pressed(*mesh, TOLERANCE))).march.assembly.signorini
    far = {**FAR, GRADED_FIRST: ByWayOf(law, PLAIN)}
    rows = [row for name, problem in problems.items() for row in _rows(name, problem, far)]
    return Report(
        name="newton",
        title="Series beside Newton's method",
        data=Sheet("All trials", COLUMNS, tuple(rows)),
        sheets=(Sheet("Cost", COLUMNS, tuple(rows), NOTE), _quotients(rows)),
    )


NOTE = (
    "A strip pulled down over a roller, without and with friction, as a section and as a shell of "
    "eight elements across, on contact as sharp as the mesh "
    "resolves and, the section, on a penalty of 1e10 Pa/m, and one that is threaded: its "
    "guess comes to rest by Newton's iteration in all lines. Seconds of the processor. Error: "
    "relative, of the tip's deflection, the roller's normal force "
    f"and the ratio of tensions, inf where it stopped. Series and steps in time to {TOLERANCE:g}, "
    f"Newton's iterations to {PLAIN.tolerance:g} of the forces, to 1e-4 in the loose lines; "
    "both follow the same backward differences. Stress and pressure are unknowns of points' own in "
    "the lines that say so. By way of graded contact: the series where nothing depends on time are "
    "those of the contact that the mesh resolves, and the end of a stage is corrected to the "
    "penalty by Newton's method with such unknowns."
)


def _rows(name: str, problem: Problem, far: dict[str, PathSolver]) -> list[tuple[Cell, ...]]:
    methods, settings = (BENT, PLAIN) if name == "cantilever" else (METHODS, SEARCHED)
    if name.endswith("penalty"):
        methods = far
    strict = problem(NewtonPath(replace(settings, tolerance=STRICT)), 0.1 * TOLERANCE)
    assert strict.outcome.done
    return [
        problem(by, TOLERANCE).row(name, method, strict.value) for method, by in methods.items()
    ]


def _quotients(rows: list[tuple[Any, ...]]) -> Sheet:
    """The best of Newton's lines that come to the same state, over the series."""
    found: list[tuple[Cell, ...]] = []
    for problem, method, _, tangents, _, seconds, _ in rows:
        if "series" not in method:
            continue
        others = [row for row in rows if row[0] == problem and "series" not in row[1]]
        good = [row for row in others if row[-1] <= TOLERANCE]
        fewest, fastest = (min(row[i] for row in good) for i in (3, 5))
        found.append((problem, method, fewest / tangents, fastest / seconds))
    columns = ("problem", "over", "factorisations", "seconds")
    return Sheet("Best of Newton's method over the series", columns, tuple(found))


# problems ------------------------------------------------------------------------


def graded(scene: Scene) -> Scene:
    """The same with contact as sharp as its mesh resolves."""
    return Scene.model_validate({**scene.to_dict(), "contact": {}})


def bent(method: PathSolver, tolerance: float, cells: int) -> Trial:
    """The cantilever; the series follow the arc."""
    equations, cost = cantilever(cells), Cost()
    series = method is follow
    settings = Settings(tolerance=tolerance, arclength=series, rational=series)
    begin, u = time.process_time(), np.zeros(len(equations.supports.free))
    steps = list(method(equations, u, solver=SparseSolver(), settings=settings, cost=cost))
    seconds = time.process_time() - begin
    across = float(tip(equations, steps[-1].branch.end[0])[1])
    return Trial(len(steps), cost, seconds, across, Outcome.DONE)


def of_scene(scene: Callable[[float], Scene], value: Callable[[Run], float]) -> Problem:
    """A scene as a problem."""

    def solved(method: PathSolver, tolerance: float) -> Trial:
        run = Run(scene(tolerance))
        run.march.follow = method
        begin = time.process_time()
        steps = sum(1 for _ in run)
        seconds = time.process_time() - begin
        return Trial(steps, run.cost, seconds, value(run), run.outcome)

    return solved


def _normal_force(run: Run) -> float:
    assert run.state is not None
    return run.state.rollers["r1"].normal_force


def _tension_ratio(run: Run) -> float:
    assert run.state is not None
    return run.state.rollers["r1"].tension_ratio or np.nan


if __name__ == "__main__":
    main(study)
