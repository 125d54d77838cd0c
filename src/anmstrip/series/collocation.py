"""Collocation in Radau's points by branches: R(u, v, t) = 0 with u' = v, to any order.

On a step u is a polynomial of degree s that meets the equations in s points, the last of
them the end of the step.  The method is L-stable for every s, its stages have order s and
its steps 2s − 1, and its polynomial is an answer at all times.  Started is from the
polynomial of the step before, run on; what imbalance R_0 that has is taken away along

    R(u_1 … u_s; λ) = (1 − λ) R_0,    λ ∈ [0, 1]

(:func:`anmstrip.continuation.follow.follow`), so that where the guess is good one tangent
of the s n unknowns serves the whole step.  A path that would need several is given up for a
shorter step: where the solution bends sharply that costs less.

For a handful of unknowns: all stages are solved at once, and the residual is looked at in
all of them by one call.

Source: Hairer & Wanner, *Solving ODEs II* (1996), §IV.5 for the formula, §IV.8 for the
choice of steps; the path is this project's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Cost
from anmstrip.continuation.follow import Settings, Step, follow
from anmstrip.timestepping.functions import TracedRecurrence
from anmstrip.continuation.status import Outcome, PathStopped
from anmstrip.linalg.solvers import LinearSolver
from anmstrip.series.radau import Piece, Rule
from anmstrip.timestepping.index_one import Residual, consistent

Array = NDArray[np.float64]

ORDER = 12
"""Of the branches: the guess is near, so that few terms do."""

RESIDUAL_SHARE = 1e-3
"""Tolerance of the residual over that of the error in time.

Velocities are changes of u over short steps, and the next guess is made with them.
"""

ROUND_OFF = 16
"""Smallest tolerance of the residual, in spacings of the numbers that it is made of."""

AIM = 0.5
"""Error of the next step that is aimed at, over what is allowed."""

GROWTH, SHRINKAGE = 4.0, 0.4
"""Largest ratio of successive steps; that after a path that would need too many tangents."""

MOST_BRANCHES = 3
"""Tangents of one step from which on a shorter one is cheaper."""


class Stages:
    """Equations of one step, for :func:`anmstrip.continuation.follow.follow`.

    The unknowns are the changes of u to all points; λ takes the imbalance away.  A
    residual is measured by the change of u that takes it away.
    """

    metric = 1.0

    def __init__(self, residual: Residual, rule: Rule, u: Array, t: float, h: float) -> None:
        self.function, self.u, self.shape = residual, u[:, None], (len(u), len(rule.points))
        self.times, self.derivative = t + h * rule.points, rule.derivative / h
        self.size = float(max(np.abs(u).max(), np.abs(self.times).max()))
        self.softness = np.zeros((0, 0))

    def _stacked(self, changes: Array, control: float) -> Array:
        rates = np.einsum("ij,nj->ni", self.derivative, changes)
        return self.function(self.u + changes, rates, self.times)

    def recurrence(self, u: Array, control: float, order: int) -> TracedRecurrence:
        """Start the series at a point."""
        found = TracedRecurrence(self._stacked, u, control, order, self.shape)
        self.softness = np.abs(np.linalg.pinv(found.tangent()))
        return found

    def residual(self, u: Array, control: float) -> Array:
        """R in all points, one after the other."""
        return np.ravel(self._stacked(u.reshape(self.shape), control))

    def imbalance(self, residual: Array) -> float:
        """Largest change of u that takes a residual away."""
        return float((self.softness @ np.abs(residual)).max())


def integrate(  # noqa: PLR0913
    residual: Residual,
    u: Array,
    v: Array,
    span: tuple[float, float],
    *,
    solver: LinearSolver,
    tolerance: float,
    stages: int = 8,
    first: float = 5e-3,
    cost: Cost | None = None,
) -> Iterator[Piece]:
    """Steps of the collocation.

    The last Legendre coefficients of u on a step may reach the tolerance.  They are its error
    in time, inside and at the end, where solutions do not drift apart; where they do, see
    :func:`anmstrip.timestepping.index_one.controlled`.

    Parameters
    ----------
    residual : callable
        ``residual(u, v, t)`` of arrays (n, s), (n, s), (s,) → (n, s), written in numpy: a
        function of one state that broadcasts over a trailing axis.
    u, v : ndarray, shape (n,)
        Start; made consistent.
    span : tuple of float
    solver : LinearSolver
        Of s n unknowns.
    tolerance : float
        Error of u, in its own unit.
    stages : int
        s.
    first : float
        First step, over the span.
    cost : Cost, optional
        Counters to add to.

    Raises
    ------
    PathStopped
    """
    cost, (t, end) = Cost() if cost is None else cost, span
    stepper = _Stepper(residual, Rule(stages), solver, tolerance, cost)
    u, v = consistent(residual, u, v, t, tolerance)
    h = first * (end - t)
    before = Piece(stepper.rule, t - h, t, u - h * v, np.outer(h * v, stepper.rule.points))
    pace = _Pace(h, 0.0, 0.0)
    while t < end:
        piece, pace = stepper.step(before, pace, end)
        yield piece
        before, t = piece, piece.end


@dataclass(frozen=True)
class _Pace:
    """Length to try next; length and error, over what is allowed, of the last step."""

    next: float
    length: float
    error: float


@dataclass(frozen=True)
class _Stepper:
    residual: Residual
    rule: Rule
    solver: LinearSolver
    tolerance: float
    cost: Cost

    def step(self, before: Piece, pace: _Pace, end: float) -> tuple[Piece, _Pace]:
        """Try, estimate, and shorten until the error is allowed."""
        t, h, barred = before.end, pace.next, False
        while h > 1e-14 * (end - before.start):
            new = end if h >= (end - t) * (1.0 - 1e-10) else t + h
            h = new - t
            piece = self._tried(before, new)
            ratio = self._ratio(piece.error / self.tolerance)
            if piece.error <= self.tolerance:
                return piece, self._next(piece, pace, min(ratio, 1.0) if barred else ratio)
            h, barred = h * (SHRINKAGE if piece.error == np.inf else max(ratio, 0.1)), True
        raise PathStopped(Outcome.STALLED, t, "no step keeps the tolerance")

    def _ratio(self, error: float) -> float:
        """Of the step that would have the error aimed at to that which has this one."""
        return float((AIM / max(error, 1e-8)) ** (1.0 / len(self.rule.points)))

    def _next(self, piece: Piece, pace: _Pace, ratio: float) -> _Pace:
        """Go on changing the step as the solution has made it change (Gustafsson)."""
        h, error = piece.end - piece.start, max(piece.error / self.tolerance, 1e-8)
        if pace.length:
            trend = h / pace.length * self._ratio(error) / self._ratio(pace.error)
            ratio *= min(1.0, max(trend, 0.3))
        return _Pace(h * min(ratio, GROWTH), h, error)

    def _tried(self, before: Piece, new: float) -> Piece:
        """The polynomial on a step; its error is infinite where the path is too long."""
        t, u = before.end, before.u + before.changes[:, -1]
        h = new - t
        stages = Stages(self.residual, self.rule, u, t, h)
        guess = min(self._guesses(before, h), key=lambda g: _largest(stages.residual(g, 0.0)))
        taken = self.cost.expansions
        try:
            last = self._followed(stages, guess)
        except (PathStopped, np.linalg.LinAlgError):
            return Piece(self.rule, t, new, u, guess.reshape(stages.shape), np.inf)
        changes = last.branch.end[0].reshape(stages.shape)
        taken = self.cost.expansions - taken
        return Piece(self.rule, t, new, u, changes, self.rule.error(changes), taken)

    def _guesses(self, before: Piece, h: float) -> Iterator[Array]:
        """Changes to the points, shape (n s,): the polynomial before run on, and its slope."""
        ahead = self.rule.points * h
        on = before.change(1.0 + ahead / (before.end - before.start))
        yield (on - before.changes[:, -1:]).ravel()
        yield np.outer(before.rates[:, -1], ahead).ravel()

    def _followed(self, stages: Stages, guess: Array) -> Step:
        """Last branch on the way to λ = 1, or to where too little is left to be seen.

        Unless it will take too many.
        """
        settings = Settings(
            order=ORDER,
            tolerance=max(RESIDUAL_SHARE * self.tolerance, ROUND_OFF * np.spacing(stages.size)),
            max_steps=MOST_BRANCHES,
            shortest=1e-6,
            give_way=False,
        )
        branches = follow(stages, guess, solver=self.solver, settings=settings, cost=self.cost)
        for count, found in enumerate(branches, start=1):
            if found.imbalance <= settings.tolerance:
                return found
            if found.pace.control * MOST_BRANCHES < count:
                raise PathStopped(Outcome.TOO_MANY_STEPS, found.pace.control)
        return found


def _largest(residual: Array) -> float:
    """Largest entry, infinite where it is not a number."""
    return float(np.nan_to_num(np.abs(residual).max(), nan=np.inf))
