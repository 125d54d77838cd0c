"""Following a path: branches, each accepted on the residual at its end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Cost, Equations, Parameter, expand, size
from anmstrip.continuation.path import Branch
from anmstrip.continuation.quotients import cleared, stretched
from anmstrip.continuation.status import Evidence, Outcome, PathStopped
from anmstrip.continuation.validity import errors, excess, validated
from anmstrip.linalg.solvers import LinearSolver, NonFiniteTangentError, SingularTangentError

Array = NDArray[np.float64]

SHRUNK = 0.4
"""Fraction of its length to which a step shrinks, ever shorter, before the control is given up."""

PATIENCE = 3
"""Steps in a row, each shorter and steeper than the last, that this takes at least."""

STEEPER = 1.25
"""Growth of |du/dλ| over all shortened steps that tells a limit point from a contact being made.

Near a limit point |du/dλ| grows like the inverse root of the distance, by 1.6 when
the steps shrink to SHRUNK.
"""


@dataclass(frozen=True)
class Settings:
    """Choices of the path follower.

    Attributes
    ----------
    order : int
        Highest order of the series.
    tolerance : float
        Largest imbalance at the end of a branch, in units of the problem's forces.
    max_steps : int
        Bound on the number of branches.
    shortest : float
        Smallest step, as a fraction of the whole way, that is not called stalled.
    arclength : bool
        Start with arclength at once.
    give_way : bool
        Change to arclength where steps in the control keep shrinking.
    rational : bool
        Let branches go on as quotients of polynomials where the series end.
    unhurried : float
        Share of the way ahead over which a small imbalance is taken away at least.
    """

    order: int = 20
    tolerance: float = 1e-6
    max_steps: int = 1000
    shortest: float = 1e-9
    arclength: bool = False
    give_way: bool = True
    rational: bool = False
    unhurried: float = 0.0


@dataclass(frozen=True)
class Pace:
    """How the last steps went: with the state, all that the next one depends on.

    Attributes
    ----------
    control : float
        Where the path has come to.
    last : float
        Length of the last step, in the control or along the arc.
    shrinking : tuple of (float, float)
        Length and |du/dλ| of the latest steps, each shorter than the one before.
    arclength : bool
        Whether arclength is followed.
    forward : tuple or None
        Direction (u, λ) of travel along the arc.
    """

    control: float
    last: float
    shrinking: tuple[tuple[float, float], ...] = ()
    arclength: bool = False
    forward: tuple[Array, float] | None = None


@dataclass(frozen=True)
class Step:
    """One accepted branch.

    Attributes
    ----------
    branch : Branch
    imbalance : float
        Residual at its end, in units of the problem's forces.
    pace : Pace
        What a later call needs to go on from its end as if never interrupted.
    fold : float or None
        Control at a limit point passed inside the branch.
    """

    branch: Branch
    imbalance: float
    pace: Pace
    fold: float | None = None


class PathSolver(Protocol):
    """What follows a path: :func:`follow`, or what it is compared with."""

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
    ) -> Iterator[Step]:
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
) -> Iterator[Step]:
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
    for _ in range(settings.max_steps):
        step = follower.step(u, pace)
        yield step
        u, pace = step.branch.end[0], step.pace
        if follower.arrived(pace.control):
            return
    raise PathStopped(Outcome.TOO_MANY_STEPS, pace.control)


class _Follower:
    """Chooses parameter and scale of the next branch from the pace of the last ones."""

    def __init__(
        self,
        equations: Equations,
        solver: LinearSolver,
        settings: Settings,
        start: float,
        target: float,
        cost: Cost,
    ) -> None:
        self.equations, self.solver, self.settings = equations, solver, settings
        self.start, self.target, self.cost = start, target, cost
        self.whole = target - start

    def arrived(self, control: float) -> bool:
        """Whether the control has reached the target, to round-off."""
        round_off = max(1e-14 * abs(self.whole), 2.0 * np.spacing(abs(self.target)))
        return bool(abs(self.target - control) <= round_off)

    def step(self, u: Array, pace: Pace) -> Step:
        """Expand, validate, and adapt."""
        if self.settings.give_way and _gives_way(pace.shrinking):
            pace = replace(pace, arclength=True)
        parameter = self._parameter(u, pace)
        branch = self._expanded(u, pace.control, parameter)
        if pace.arclength:
            branch = cleared(self.equations, branch)
        branch, imbalance = self._accepted(branch, parameter.reach)
        if pace.arclength:
            branch, imbalance = self._cut_at_target(branch, imbalance)
        elif branch.length == parameter.reach:
            branch = branch.landed(self.target)
        fold = branch.fold() if pace.arclength else None
        passed = None if fold is None else branch(fold)[1]
        return Step(branch, imbalance, self._adapted(branch, parameter, pace), passed)

    def _parameter(self, u: Array, pace: Pace) -> Parameter:
        remaining, unhurried = self.target - pace.control, self.settings.unhurried
        if pace.arclength:
            forward = pace.forward or (np.zeros_like(u), self.whole)
            return Parameter(pace.last, np.inf, True, forward, unhurried, abs(remaining))
        scale = np.copysign(min(pace.last, abs(remaining)), remaining)
        return Parameter(scale, remaining / scale, unhurried=unhurried)

    def _expanded(self, u: Array, control: float, parameter: Parameter) -> Branch:
        try:
            return expand(
                self.equations,
                u,
                control,
                order=self.settings.order,
                solver=self.solver,
                parameter=parameter,
                tolerance=self.settings.tolerance,
                cost=self.cost,
            )
        except SingularTangentError as error:
            finite = not isinstance(error, NonFiniteTangentError)
            outcome = Outcome.SINGULAR if finite else Outcome.NOT_FINITE
            evidence = Evidence(unknown=error.unknown)
            raise PathStopped(outcome, control, str(error), evidence) from error

    def _accepted(self, series: Branch, reach: float) -> tuple[Branch, float]:
        """The branch up to where it holds, inside and at its end."""
        tolerance = self.settings.tolerance
        while True:
            given = (self.equations, series, tolerance, reach, self.cost)
            quotient = stretched(*given) if self.settings.rational else None
            branch, imbalance = quotient or validated(*given)
            hidden = getattr(self.equations, "hidden", None)
            inside = None if hidden is None else hidden(branch)
            if inside is None or self._holds(branch, inside):
                return branch, imbalance
            reach = inside

    def _holds(self, branch: Branch, a: float) -> bool:
        tolerance = self.settings.tolerance
        return errors(self.equations, branch, a, self.cost, tolerance)[0] <= tolerance

    def _cut_at_target(self, branch: Branch, imbalance: float) -> tuple[Branch, float]:
        a = branch.reaches(self.target)
        if a is None:
            return branch, imbalance
        branch = branch.cut(a).landed(self.target)
        return branch, errors(self.equations, branch, a, self.cost)[1]

    def _adapted(self, branch: Branch, parameter: Parameter, pace: Pace) -> Pace:
        """Pace after a branch."""
        covered = branch.length * abs(parameter.scale)
        if covered < self.settings.shortest * abs(self.whole):
            evidence = Evidence(residual=self._first_excess(branch))
            raise PathStopped(Outcome.STALLED, float(branch.control[0]), "", evidence)
        direction, control = branch.direction(branch.length), branch.end[1]
        along = abs(direction[1])
        steepness = size(self.equations, direction[0]) / along if along > 0.0 else np.inf
        shorter = pace.shrinking if covered < pace.last else ()
        shrinking = (*shorter, (covered, float(steepness)))
        if not pace.arclength:
            return Pace(control, covered, shrinking)
        self._check_return(control, direction[0])
        return Pace(control, covered, shrinking, True, direction)

    def _first_excess(self, branch: Branch) -> Array:
        """Imbalance that comes beyond a branch; at its end, where that is not finite."""
        beyond = excess(self.equations, branch, 2.0 * branch.length, self.cost)
        if np.isfinite(beyond).all():
            return beyond
        return excess(self.equations, branch, branch.length, self.cost)

    def _check_return(self, control: float, motion: Array) -> None:
        if (control - self.start) * np.sign(self.whole) < -abs(self.whole):
            raise PathStopped(Outcome.FOLD, control, "", Evidence(motion=motion))


def _gives_way(shrinking: tuple[tuple[float, float], ...]) -> bool:
    """Whether steps shrink, and the path steepens step by step, as before a limit point."""
    if len(shrinking) <= PATIENCE:
        return False
    lengths, slopes = zip(*shrinking, strict=True)
    steeper = all(b > a for a, b in pairwise(slopes[-PATIENCE - 1 :]))
    return lengths[-1] < SHRUNK * lengths[0] and steeper and slopes[-1] > STEEPER * slopes[0]
