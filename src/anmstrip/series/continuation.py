"""Following a path: branches, each accepted on the residual at its end.

Three things apart: :func:`anmstrip.series.expansion.expand` makes a branch,
:func:`validated` decides how far it holds, :func:`follow` strings branches
together until the target.  Whoever iterates over :func:`follow` is the observer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from .expansion import Cost, Equations, Parameter, expand, term_range
from .linear_solvers import LinearSolver, SingularTangentError
from .path import Branch

Array = NDArray[np.float64]

SHRINKING = 0.7
"""A step shorter than this fraction of the last one counts as shrinking."""

PATIENCE = 3
"""Shrinking steps in a row after which the control is given up for arclength."""


class Outcome(Enum):
    """How a path ended; the value is the sentence for the user."""

    DONE = "reached the end"
    FOLD = "the control cannot be increased further: the path turned back at a limit point"
    STALLED = "steps became too short: the path has a singular point here"
    SINGULAR = "the tangent is singular: something is not held, or a bifurcation"
    TOO_MANY_STEPS = "the allowed number of steps was used up"
    NOT_FINITE = "the equations gave values that are not finite"

    @property
    def done(self) -> bool:
        """Whether the path was completed."""
        return self is Outcome.DONE


class PathStopped(Exception):  # noqa: N818 - an outcome, not a programming error
    """A path ended before its target.

    Attributes
    ----------
    outcome : Outcome
    control : float
        Where.
    """

    def __init__(self, outcome: Outcome, control: float, detail: str = "") -> None:
        super().__init__(f"{outcome.value} (at {control:.6g}){': ' + detail if detail else ''}")
        self.outcome = outcome
        self.control = control


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
    """

    order: int = 20
    tolerance: float = 1e-6
    max_steps: int = 1000
    shortest: float = 1e-9
    arclength: bool = False
    give_way: bool = True


@dataclass(frozen=True)
class Step:
    """One accepted branch.

    Attributes
    ----------
    branch : Branch
    imbalance : float
        Residual at its end, in units of the problem's forces.
    fold : float or None
        Control at a limit point passed inside the branch.
    """

    branch: Branch
    imbalance: float
    fold: float | None = None


def follow(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: Settings,
    start: float = 0.0,
    target: float = 1.0,
    cost: Cost | None = None,
) -> Iterator[Step]:
    """Accepted steps of the path from (u, start) to the control ``target``.

    Raises
    ------
    PathStopped
        With an outcome that says why the target was not reached.
    """
    cost = Cost() if cost is None else cost
    follower = _Follower(equations, solver, settings, start, target, cost)
    control = start
    for _ in range(settings.max_steps):
        step = follower.step(u, control)
        yield step
        u, control = step.branch.end
        if follower.arrived(control):
            return
    raise PathStopped(Outcome.TOO_MANY_STEPS, control)


class _Follower:
    """Chooses parameter and scale of the next branch from the last ones."""

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
        self.arclength = settings.arclength
        self.forward: tuple[Array, float] | None = None
        self.last = abs(self.whole)
        self.shrinking = 0

    def arrived(self, control: float) -> bool:
        """Whether the control has reached the target, to round-off."""
        return abs(self.target - control) <= 1e-14 * abs(self.whole)

    def step(self, u: Array, control: float) -> Step:
        """Expand, validate, and adapt."""
        if not self.arclength and self.shrinking >= PATIENCE and self.settings.give_way:
            self.arclength = True
        parameter = self._parameter(control)
        try:
            branch = self._expanded(u, control, parameter)
        except SingularTangentError as error:
            raise PathStopped(Outcome.SINGULAR, control, str(error)) from error
        branch, imbalance = validated(
            self.equations, branch, self.settings.tolerance, parameter.reach, self.cost
        )
        if not self.arclength and branch.length == parameter.reach:
            branch = _landed(branch, self.target)
        return self._adapted(branch, imbalance, parameter)

    def _parameter(self, control: float) -> Parameter:
        remaining = self.target - control
        if self.arclength:
            scale = self.last
            forward = self.forward or (np.zeros(0), 0.0)
            known = self.forward is not None
            return Parameter(scale, np.inf, True, forward if known else None)
        scale = np.copysign(min(self.last, abs(remaining)), remaining)
        return Parameter(scale, remaining / scale)

    def _expanded(self, u: Array, control: float, parameter: Parameter) -> Branch:
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

    def _adapted(self, branch: Branch, imbalance: float, parameter: Parameter) -> Step:
        if self.arclength:
            a = branch.reaches(self.target)
            if a is not None:
                branch = branch.cut(a)
        covered = branch.length * abs(parameter.scale)
        if covered < self.settings.shortest * abs(self.whole):
            raise PathStopped(Outcome.STALLED, float(branch.control[0]))
        self.shrinking = self.shrinking + 1 if covered < SHRINKING * self.last else 0
        self.last = covered
        fold = branch.fold() if self.arclength else None
        if self.arclength:
            self.forward = branch.direction(branch.length)
            self._check_return(branch)
        return Step(branch, imbalance, None if fold is None else branch(fold)[1])

    def _check_return(self, branch: Branch) -> None:
        control = branch.end[1]
        if (control - self.start) * np.sign(self.whole) < -abs(self.whole):
            raise PathStopped(Outcome.FOLD, control)


def _landed(branch: Branch, target: float) -> Branch:
    """The same branch with an end control that equals the target to the last digit."""
    control = branch.control.copy()
    control[1] = (target - control[0]) / branch.length
    return replace(branch, control=control)


def validated(
    equations: Equations, branch: Branch, tolerance: float, reach: float, cost: Cost
) -> tuple[Branch, float]:
    """Cut a branch where its own equation is met to the tolerance.

    The range at which the last terms reach the tolerance is a guess; it is
    corrected by the residual, which grows like a^(N+1), in both directions.

    Returns
    -------
    branch : Branch
        With a verified length, at most ``reach``.
    imbalance : float
        Residual at its end.

    Raises
    ------
    PathStopped
        If no length is found.
    """
    order = branch.order
    guess = min(term_range(equations, branch, tolerance), reach)
    if not np.isfinite(guess):
        guess = 1.0
    error, imbalance = _errors(equations, branch, guess, cost)
    longer = _predicted(guess, error, tolerance, order)
    if error <= tolerance and longer > 1.05 * guess and guess < reach:
        trial = min(longer, 2.0 * guess, reach)
        better = _errors(equations, branch, trial, cost)
        if better[0] <= tolerance:
            return branch.cut(trial), better[1]
    while error > tolerance:
        guess *= np.clip(_predicted(1.0, error, tolerance, order), 0.2, 0.9)
        if guess < 1e-9:
            raise PathStopped(
                Outcome.STALLED if np.isfinite(error) else Outcome.NOT_FINITE,
                float(branch.control[0]),
                f"the series does not meet the tolerance {tolerance:g} at any length",
            )
        error, imbalance = _errors(equations, branch, guess, cost)
    return branch.cut(guess), imbalance


def _predicted(length: float, error: float, tolerance: float, order: int) -> float:
    """Length at which an error that grows like a^(N+1) would be half the tolerance."""
    if not np.isfinite(error):
        return 0.2 * length
    if error == 0.0:
        return np.inf
    return length * (0.5 * tolerance / error) ** (1.0 / (order + 1))


def _errors(equations: Equations, branch: Branch, a: float, cost: Cost) -> tuple[float, float]:
    """Imbalance at a, against the carried one and against zero."""
    cost.residuals += 1
    with cost.timed("residual"), np.errstate(over="ignore", invalid="ignore"):
        residual = equations.residual(*branch(a))
    carried = branch.residual * (1.0 - a / branch.carried_over)
    own = equations.imbalance(residual - carried)
    return (own if np.isfinite(own) else np.inf), equations.imbalance(residual)
