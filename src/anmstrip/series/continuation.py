"""Following a path: branches, each accepted on the residual at its end.

Three things apart: :func:`anmstrip.series.expansion.expand` makes a branch,
:func:`anmstrip.series.range_of_validity.validated` decides how far it holds,
:func:`follow` strings branches together until the target.  Whoever iterates over
:func:`follow` is the observer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .expansion import Cost, Equations, Parameter, expand, size
from .linear_solvers import LinearSolver, NonFiniteTangentError, SingularTangentError
from .outcome import Outcome, PathStopped
from .path import Branch
from .power_series import horner
from .range_of_validity import errors, validated

Array = NDArray[np.float64]

SHRUNK = 0.4
"""Fraction of its length to which a step shrinks, ever shorter, before the control is given up."""

PATIENCE = 3
"""Steps in a row, each shorter than the last, that this takes at least."""

STEEPER = 1.25
"""Growth of |du/dλ| over these steps that tells a limit point from a contact being made.

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
        self.shrinking: list[tuple[float, float]] = []

    def arrived(self, control: float) -> bool:
        """Whether the control has reached the target, to round-off."""
        round_off = max(1e-14 * abs(self.whole), 2.0 * np.spacing(abs(self.target)))
        return bool(abs(self.target - control) <= round_off)

    def step(self, u: Array, control: float) -> Step:
        """Expand, validate, and adapt."""
        if self.settings.give_way and self._gives_way():
            self.arclength = True
        parameter = self._parameter(u, control)
        try:
            branch = self._expanded(u, control, parameter)
        except SingularTangentError as error:
            finite = not isinstance(error, NonFiniteTangentError)
            outcome = Outcome.SINGULAR if finite else Outcome.NOT_FINITE
            raise PathStopped(outcome, control, str(error)) from error
        branch, imbalance = validated(
            self.equations, branch, self.settings.tolerance, parameter.reach, self.cost
        )
        if self.arclength:
            branch, imbalance = self._cut_at_target(branch, imbalance)
        elif branch.length == parameter.reach:
            branch = _landed(branch, self.target)
        return self._adapted(branch, imbalance, parameter)

    def _parameter(self, u: Array, control: float) -> Parameter:
        remaining = self.target - control
        if self.arclength:
            forward = self.forward or (np.zeros_like(u), self.whole)
            return Parameter(self.last, np.inf, True, forward)
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

    def _gives_way(self) -> bool:
        if len(self.shrinking) <= PATIENCE:
            return False
        (first, flat), (last, steep) = self.shrinking[0], self.shrinking[-1]
        return last < SHRUNK * first and steep > STEEPER * flat

    def _cut_at_target(self, branch: Branch, imbalance: float) -> tuple[Branch, float]:
        a = branch.reaches(self.target)
        if a is None:
            return branch, imbalance
        branch = _landed(branch.cut(a), self.target)
        return branch, errors(self.equations, branch, a, self.cost)[1]

    def _adapted(self, branch: Branch, imbalance: float, parameter: Parameter) -> Step:
        covered = branch.length * abs(parameter.scale)
        if covered < self.settings.shortest * abs(self.whole):
            raise PathStopped(Outcome.STALLED, float(branch.control[0]))
        if self.shrinking and covered >= self.last:
            self.shrinking = []
        direction = branch.direction(branch.length)
        along = abs(direction[1])
        steepness = size(self.equations, direction[0]) / along if along > 0.0 else np.inf
        self.shrinking.append((covered, steepness))
        self.last = covered
        fold = branch.fold() if self.arclength else None
        if self.arclength:
            self.forward = direction
            self._check_return(branch)
        return Step(branch, imbalance, None if fold is None else branch(fold)[1])

    def _check_return(self, branch: Branch) -> None:
        control = branch.end[1]
        if (control - self.start) * np.sign(self.whole) < -abs(self.whole):
            raise PathStopped(Outcome.FOLD, control)


def _landed(branch: Branch, target: float) -> Branch:
    """The same branch with an end control that equals the target to the last digit."""
    control = branch.control.copy()
    for _ in range(2):
        control[1] += (target - horner(control, branch.length)) / branch.length
    return replace(branch, control=control)
