"""Following a path: branches, each accepted on the residual at its end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.expansion import (
    Parameter,
    excess_imbalance,
    expand,
    longest_quotient,
    residual_error,
    validate,
    without_progression,
)
from anmstrip.continuation.path import Branch, Cost, Equations, Evidence, Outcome, PathStopped, size
from anmstrip.linalg.direct import NonFiniteTangentError, SingularTangentError
from anmstrip.linalg.solvers import LinearSolver

STEP_REDUCTION = 0.4
"""Fraction of its length to which a step shrinks, ever shorter, before the control is given up."""

MIN_REDUCTIONS = 3
"""Steps in a row, each shorter and steeper than the last, that this takes at least."""

LIMIT_POINT_GROWTH = 1.25
"""Growth of |du/dλ| over all shortened steps that tells a limit point from a contact being made.

Near a limit point |du/dλ| grows like the inverse root of the distance, by 1.6 when
the steps shrink to STEP_REDUCTION.
"""

START_OF_PATH = 1e-6
"""Share of a path on which steps may be shorter than elsewhere, in proportion to what is covered,
down to this share of the shortest.  It has no effect on paths of steps in time.  Flat strip of
0.5 mm that hangs over 30 m without tension bends by its thickness under 1e-8 of its weight; it is
hung in 27 tangents."""


Relaxation = Literal["branch", "ahead", "whole"]
"""Over what a small imbalance is taken away: the next branch, all of the way that is left, or as
slowly as over the whole way.  Friction of faint pressure answers to haste with fast motion."""


@dataclass(frozen=True)
class Settings:
    """Choices of the path follower."""

    order: int = 20  # highest order of the series
    tolerance: float = 1e-6  # largest imbalance at the end of a branch
    max_steps: int = 1000  # bound on the number of branches
    shortest: float = 1e-9  # smallest step that is not called stalled, over the whole way
    arclength: bool = False  # start with arclength at once
    give_way: bool = True  # change to arclength where steps in the control keep shrinking
    rational: bool = False  # let branches go on as quotients of polynomials
    relaxation: Relaxation = "branch"
    backwards: float = 1.0  # share of the whole way that the path may turn back before its start


@dataclass(frozen=True)
class Pace:
    """Past of a path: with the state, all that the next step depends on."""

    control: float  # where the path has come to
    last: float  # length of the last step, in the control or along the arc
    shrinking: tuple[tuple[float, float], ...] = ()  # length, |du/dλ| of ever shorter steps
    arclength: bool = False  # whether arclength is followed
    forward: tuple[Array, float] | None = None  # direction (u, λ) of travel along the arc
    taken: int = 0  # branches


@dataclass(frozen=True)
class PathStep:
    """One accepted branch."""

    branch: Branch
    imbalance: float  # residual at its end, in units of the problem's forces
    pace: Pace  # what a later call needs to go on from its end as if never interrupted
    tangent: float = 0.0  # place on the branch to which the last factors belong


class PathSolver(Protocol):
    """Anything that follows a path as :func:`follow` does."""

    def __call__(
        self,
        equations: Equations,
        u: Array,
        *,
        solver: LinearSolver,
        settings: Settings,
        start: float = 0.0,
        target: float = 1.0,
        pace: Pace | None = None,
        cost: Cost | None = None,
    ) -> Iterator[PathStep]:
        """Accepted steps of the path from (u, start) to the control ``target``."""


def follow(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: Settings,
    start: float = 0.0,
    target: float = 1.0,
    pace: Pace | None = None,
    cost: Cost | None = None,
) -> Iterator[PathStep]:
    """Accepted steps of the path from (u, start) to the control ``target``.

    Parameters
    ----------
    equations : Equations
    u : ndarray, shape (n,)
    solver : LinearSolver
    settings : Settings
    start, target : float
        Controls between which the whole path lies.
    pace : Pace, optional
        Of the last step of an interrupted path, to go on from its end, u.
    cost : Cost, optional
        Counters to add to.

    Raises
    ------
    PathStopped
        With an outcome that says why the target was not reached.
    """
    cost = Cost() if cost is None else cost
    follower = _Follower(equations, solver, settings, start, target, cost)
    pace = pace or Pace(start, abs(target - start), arclength=settings.arclength)
    round_off = max(1e-14 * abs(target - start), 2.0 * np.spacing(abs(target)))
    farthest, sense = pace.control, np.sign(target - start)
    for _ in range(settings.max_steps):
        try:
            step = follower.step(u, pace)
        except PathStopped as stopped:
            stopped.farthest = farthest
            raise
        controls = step.branch.many(np.linspace(0.0, step.branch.length, 9))[1]
        farthest = float(sense * max(sense * farthest, *(sense * controls)))
        yield step
        u, pace = step.branch.end[0], step.pace
        if abs(target - pace.control) <= round_off:
            return
    raise PathStopped(Outcome.TOO_MANY_STEPS, pace.control)


@dataclass(frozen=True)
class _Follower:
    """Chooses parameter and scale of the next branch from the pace of the last ones."""

    equations: Equations
    solver: LinearSolver
    settings: Settings
    start: float
    target: float
    cost: Cost

    def step(self, u: Array, pace: Pace) -> PathStep:
        """Expand, validate, and adapt."""
        settings, remaining = self.settings, self.target - pace.control
        ways = {"branch": 0.0, "ahead": remaining, "whole": self.target - self.start}
        relaxation = abs(ways[settings.relaxation])
        arclength = pace.arclength or (settings.give_way and _nears_limit_point(pace.shrinking))
        if arclength:
            forward = pace.forward or (np.zeros_like(u), self.target - self.start)
            parameter = Parameter(pace.last, np.inf, True, forward, relaxation)
        else:
            scale = np.copysign(min(pace.last, abs(remaining)), remaining)
            parameter = Parameter(scale, remaining / scale, relaxation=relaxation)
        try:
            branch = expand(
                self.equations, u, pace.control, order=settings.order, solver=self.solver,
                parameter=parameter, tolerance=settings.tolerance, cost=self.cost,
            )  # fmt: skip
        except SingularTangentError as error:
            finite = not isinstance(error, NonFiniteTangentError)
            outcome = Outcome.SINGULAR if finite else Outcome.NOT_FINITE
            evidence = Evidence(unknown=error.unknown)
            raise PathStopped(outcome, pace.control, str(error), evidence) from error
        if arclength:
            branch = without_progression(self.equations, branch, settings.tolerance, self.cost)
        branch, imbalance = self._accepted(branch, parameter.reach)
        if not arclength and branch.length == parameter.reach:
            branch = branch.landed(self.target)
        elif arclength and (a := branch.reaches(self.target)) is not None:
            branch = branch.cut(a).landed(self.target)
            imbalance = residual_error(self.equations, branch, a, self.cost)[1]
            if imbalance > settings.tolerance:  # too soon: in the control it is gone by then
                return self.step(u, Pace(pace.control, abs(remaining), taken=pace.taken))
        return PathStep(branch, imbalance, self._next_pace(branch, parameter, pace))

    def _accepted(self, series: Branch, reach: float) -> tuple[Branch, float]:
        """The branch up to where it holds, inside and at its end."""
        tolerance = self.settings.tolerance
        while True:
            given = (self.equations, series, tolerance, reach, self.cost)
            quotient = longest_quotient(*given) if self.settings.rational else None
            branch, imbalance = quotient or validate(*given)
            inside = self.equations.interior_check(branch)
            if inside is None:
                return branch, imbalance
            if residual_error(self.equations, branch, inside, self.cost, tolerance)[0] <= tolerance:
                return branch, imbalance
            reach = inside

    def _next_pace(self, branch: Branch, parameter: Parameter, pace: Pace) -> Pace:
        """Pace after a branch; raises if that is too short, or has turned back for good."""
        whole = self.target - self.start
        covered = branch.length * abs(parameter.scale)
        travelled = (covered + abs(float(branch.control[0]) - self.start)) / abs(whole)
        share = float(np.clip(travelled / START_OF_PATH, START_OF_PATH, 1.0))
        if covered < share * self.settings.shortest * abs(whole):
            residual = excess_imbalance(self.equations, branch, 2.0 * branch.length, self.cost)
            if not np.isfinite(residual).all():
                residual = excess_imbalance(self.equations, branch, branch.length, self.cost)
            evidence = Evidence(residual=residual)
            raise PathStopped(Outcome.STALLED, float(branch.control[0]), "", evidence)
        direction, control = branch.direction(branch.length), branch.end[1]
        along = abs(direction[1])
        steepness = size(self.equations, direction[0]) / along if along > 0.0 else np.inf
        shorter = pace.shrinking if covered < pace.last else ()
        shrinking = (*shorter, (covered, float(steepness)))
        if not parameter.arclength:
            return Pace(control, covered, shrinking, taken=pace.taken + 1)
        if (control - self.start) * np.sign(whole) < -self.settings.backwards * abs(whole):
            raise PathStopped(Outcome.FOLD, control, "", Evidence(motion=direction[0]))
        return Pace(control, covered, shrinking, True, direction, pace.taken + 1)


def _nears_limit_point(shrinking: tuple[tuple[float, float], ...]) -> bool:
    """Whether steps shrink, and the path steepens step by step, as before a limit point."""
    if len(shrinking) <= MIN_REDUCTIONS:
        return False
    lengths, slopes = zip(*shrinking, strict=True)
    steeper = all(b > a for a, b in pairwise(slopes[-MIN_REDUCTIONS - 1 :]))
    shorter = lengths[-1] < STEP_REDUCTION * lengths[0]
    return shorter and steeper and slopes[-1] > LIMIT_POINT_GROWTH * slopes[0]
