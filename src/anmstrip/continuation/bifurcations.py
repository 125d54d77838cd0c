"""Limit points and bifurcations: found from series, confirmed by inertia, and branched off from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import islice
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.expansion import Parameter, expand
from anmstrip.continuation.follow import Pace, PathStep, Settings
from anmstrip.continuation.path import (
    Branch,
    Cost,
    Equations,
    Outcome,
    PathStopped,
    Recurrence,
    inner,
    size,
)
from anmstrip.linalg.direct import Factors
from anmstrip.linalg.solvers import LinearSolver, Remembering

PERTURBATION = 1e-6
"""Force of the pushed branch, as a share of what moves the path along."""

POLE_DISTANCE = 1e-3
"""Distance to a pole, in steps, from which the first two orders reach it."""

LIMIT_POINT_OFFSET = 1e-3
"""Distance from a limit point, in steps, at which the inertia is looked at."""

CORRECTION_ORDER = 6
"""Order of the series that brings a point into equilibrium."""

MAX_POINT_ITERATIONS = 20

Mark = tuple[float, int]
"""Parameter of a branch, and negative eigenvalues there."""


class Kind(Enum):
    """Kind of a singular point; the value is the word for the user."""

    LIMIT = "limit point"
    BIFURCATION = "bifurcation"


@dataclass(frozen=True)
class SingularPoint:
    """A point of a path at which the tangent is singular."""

    kind: Kind
    u: Array  # (n,)
    control: float
    mode: Array  # null vector of the tangent, of length 1 in the equations' own scales, (n,)
    before: int  # negative eigenvalues of the tangent at the start of the step with the point
    after: int  # and at its end


def watch_singular_points(
    equations: Equations,
    steps: Iterable[PathStep],
    solver: Remembering,
    settings: Settings,
    cost: Cost | None = None,
    *,
    stop: bool = False,
) -> Iterator[tuple[PathStep, list[SingularPoint]]]:
    """Steps of a path with the singular points in each.

    Parameters
    ----------
    equations : Equations
    steps : iterable of PathStep
        From :func:`anmstrip.continuation.follow.follow` with the same solver.
    solver : Remembering
    settings : Settings
        Those of the path.
    cost : Cost, optional
        Counters for the tangents that singular points take, and for the one at the end.
    stop : bool
        End with the step that holds the first singular point, and look for no other.

    Raises
    ------
    PathStopped
        As the steps do, after the last of them.
    """
    finder = _Finder(equations, solver.solver, settings, Cost() if cost is None else cost)
    held: tuple[PathStep, int] | None = None
    stopped: PathStopped | None = None
    following = iter(steps)
    while True:
        try:
            step = next(following, None)
        except PathStopped as end:
            step, stopped = None, end
        if step is not None:
            now = solver.factors.negatives
        elif held is not None:
            now = finder.negatives(*held[0].branch.end)
        if held is not None:
            found = list(islice(finder.points(*held, now), 1 if stop else None))
            yield held[0], found
            if stop and found:
                return
        if step is None:
            break
        held = (step, now)
    if stopped is not None:
        raise stopped


class _Finder:
    """Looks for the singular points of a step."""

    def __init__(
        self, equations: Equations, solver: LinearSolver, settings: Settings, cost: Cost
    ) -> None:
        self.equations, self.solver = equations, Remembering(solver)
        self.settings, self.cost = settings, cost

    def negatives(self, u: Array, control: float) -> int:
        """Negative eigenvalues at a point, for one more tangent."""
        self.cost.factorisations += 1
        return self.solver.factorise(self.equations.recurrence(u, control, 1).tangent()).negatives

    def points(self, step: PathStep, before: int, after: int) -> Iterator[SingularPoint]:
        """Singular points in order; bifurcations where limit points do not explain the inertia."""
        branch, folds = step.branch, step.branch.folds
        change = abs(after - before)
        hidden = change > len(folds) or bool((change - len(folds)) % 2)
        low = (0.0, before)
        aside = LIMIT_POINT_OFFSET * branch.length
        for fold in folds:
            if hidden:
                yield from self._bifurcations(branch, low, self._mark(branch, fold - aside))
                low = self._mark(branch, fold + aside)
            here = self._about(branch, fold)
            near = min(here.turns, key=abs, default=0.0)
            direction = here.direction(near)[0]
            mode = direction / size(self.equations, direction)
            yield SingularPoint(Kind.LIMIT, *here(near), mode, before, after)
        if hidden:
            yield from self._bifurcations(branch, low, (branch.length, after))

    def _mark(self, branch: Branch, a: float) -> Mark:
        return a, self.negatives(*branch(a))

    def _bifurcations(self, branch: Branch, low: Mark, high: Mark) -> Iterator[SingularPoint]:
        """Bifurcations in a piece of a branch whose inertia is known at both ends."""
        if low[1] == high[1]:
            return
        a, u, control, mode = self._bifurcation(branch, low[0], high[0], low[1])
        below, above = low, high
        if abs(low[1] - high[1]) > 1:
            aside = LIMIT_POINT_OFFSET * branch.length
            below = self._mark(branch, a - aside) if a - aside > low[0] else low
            above = self._mark(branch, a + aside) if a + aside < high[0] else high
        if below != low:
            yield from self._bifurcations(branch, low, below)
        yield SingularPoint(Kind.BIFURCATION, u, control, mode, below[1], above[1])
        if above != high:
            yield from self._bifurcations(branch, above, high)

    def _bifurcation(
        self, branch: Branch, low: float, high: float, before: int
    ) -> tuple[float, Array, float, Array]:
        """Parameter, state, control and mode at a pole of the response."""
        a = 0.5 * (low + high)
        for _ in range(MAX_POINT_ITERATIONS):
            here = self._about(branch, a)
            low, high = (a, high) if self.solver.factors.negatives == before else (low, a)
            response = self._response(here)
            pole = inner(self.equations, *response) / size(self.equations, response[1]) ** 2
            if abs(pole) < POLE_DISTANCE * branch.length:
                here = Branch(here.u[:3], here.control[:3], 1.0, here.residual)
                break
            a = a + pole if low < a + pole < high else 0.5 * (low + high)
            pole = 0.0
        u, control = here(pole)
        return a + pole, u, control, response[1] / size(self.equations, response[1])

    def _about(self, branch: Branch, a: float) -> Branch:
        """Series about a point of a branch, which is brought into equilibrium before.

        Its parameter is the branch's, shifted by a.
        """
        u, control = branch(a)
        direction = branch.direction(a)
        for order, moving in ((CORRECTION_ORDER, 0.0), (self.settings.order, 1.0)):
            scale = moving * np.hypot(size(self.equations, direction[0]), direction[1])
            parameter = Parameter(scale, arclength=True, forward=direction)
            here = expand(
                self.equations, u, control,
                order=order, solver=self.solver, parameter=parameter, cost=self.cost,
            )  # fmt: skip
            if not moving:
                u, control = here(1.0)
        self.parameter = parameter
        return here.cut(branch.length)

    def _response(self, here: Branch) -> tuple[Array, Array]:
        """The last two orders of the answer to a push; the tangent is that of the branch."""
        factors = self.solver.factors
        push = np.cos(np.arange(1.0, len(here.residual) + 1.0) ** 2)
        answer = factors.solve(push)
        push *= PERTURBATION * size(self.equations, here.u[1]) / size(self.equations, answer)
        equations, u, control = _Pushed(self.equations, push), here.u[0], float(here.control[0])
        ways: dict[str, Any] = {"solver": _GivenFactors(factors), "parameter": self.parameter}
        pushed = expand(equations, u, control, order=here.order, **ways)
        return pushed.u[-2] - here.u[-2], pushed.u[-1] - here.u[-1]


class _GivenFactors:
    """A solver that has its factors already."""

    def __init__(self, factors: Factors) -> None:
        self.factors = factors

    def factorise(self, matrix: Any) -> Factors:
        return self.factors


class _Pushed(Equations):
    """Equations with a force that grows with the path parameter."""

    def __init__(self, equations: Equations, push: Array) -> None:
        self.equations, self.push = equations, push

    def recurrence(self, u: Array, control: float, order: int) -> Recurrence:
        recurrence = self.equations.recurrence(u, control, order)
        recurrence.residual = recurrence.residual + self.push
        return recurrence

    def residual(self, u: Array, control: float) -> Array:
        return self.equations.residual(u, control)

    @property
    def metric(self) -> Array | float:
        return self.equations.metric

    def imbalance(self, residual: Array) -> float:
        return self.equations.imbalance(residual)


def switch_branch(
    equations: Equations,
    point: SingularPoint,
    distance: float,
    solver: LinearSolver,
    tolerance: float,
    cost: Cost | None = None,
) -> tuple[Array, Pace]:
    """A state on the path that crosses another at a bifurcation, and the pace to go on with.

    By Newton's method among the states that are ``distance`` from the bifurcation along its
    mode; the sign chooses the side.

    Parameters
    ----------
    distance : float
        In the equations' own scales.
    tolerance : float
        Imbalance of the state.

    Raises
    ------
    PathStopped
        If the method does not converge.
    """
    cost = Cost() if cost is None else cost
    u, control = point.u + distance * point.mode, point.control
    for _ in range(MAX_POINT_ITERATIONS):
        recurrence = equations.recurrence(u, control, 1)
        if equations.imbalance(recurrence.residual) <= tolerance:
            forward = (np.sign(distance) * point.mode, 0.0)
            return u, Pace(control, abs(distance), arclength=True, forward=forward)
        factors = solver.factorise(recurrence.tangent())
        cost.factorisations += 1
        free = -factors.solve(recurrence.residual)
        per_control = -factors.solve(recurrence.control_derivative())
        missing = distance - inner(equations, point.mode, u + free - point.u)
        change = missing / inner(equations, point.mode, per_control)
        u, control = u + free + change * per_control, control + change
    raise PathStopped(Outcome.STALLED, control, "no state found on the other path")
