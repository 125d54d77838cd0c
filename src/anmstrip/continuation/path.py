"""Paths of R(u, λ) = 0: equations, branches, tolerances, counters of work, and how a path ends."""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.polynomial.polynomial import polymul, polysub

from anmstrip.arrays import Array
from anmstrip.linalg.direct import Factors
from anmstrip.taylor.polynomials import derivative_coefficients, first_root, roots_within, value_at

TINY = float(np.finfo(float).tiny)


class Recurrence(Protocol):
    """The orders R_k of R at one point, found one after the other.

    1. ``residual`` is order 0, shape (n,).
    2. For each order k from 1 on but the last, ``correct(k, u_k, λ_k)`` is called once, and
       ``advance(k + 1)`` after it.
    3. ``tangent`` and ``control_derivative`` are called before any order is fixed.
    """

    residual: Array

    def tangent(self) -> Any:
        """∂R/∂u, in the form that the linear solver takes."""

    def control_derivative(self) -> Array:
        """∂R/∂λ, shape (n,)."""

    def advance(self, k: int) -> Array:
        """Order k of R, k ≥ 2, as if u_k = 0 and λ_k = 0."""

    def correct(self, k: int, u: Array, control: float) -> None:
        """Fix order k of the unknowns."""


class Equations(Protocol):
    """R(u, λ) = 0 and the scales in which its user measures errors.

    1. ``recurrence(u, λ, order).residual`` and ``residual(u, λ)`` agree to round-off.
    2. ``imbalance`` is a norm; tolerances are in its unit, which is that of the problem's forces.
    3. ``metric`` holds the weights of the unknowns in the inner product of changes of state, such
       that the length of a change is dimensionless.
    4. ``unaccelerated`` is asked for by Newton's method alone.
    5. ``smoother`` is asked for where a path stalls at corners of the laws.
    6. A class that inherits from this one knows no series beforehand, has no interior check unless
       it writes one, no velocities, and no corners.
    """

    @property
    def metric(self) -> Array | float:
        """Weights of the unknowns, shape (n,) or ()."""

    def recurrence(self, u: Array, control: float, order: int) -> Recurrence:
        """Start the series at a point."""

    def residual(self, u: Array, control: float) -> Array:
        """R(u, λ) in plain numbers, shape (n,)."""

    def imbalance(self, residual: Array) -> float:
        """Size of a residual in units of the problem's own forces."""

    def known(self, u: Array, control: float, order: int) -> tuple[Recurrence, Factors] | None:
        """Series at a point and factors of its tangent where somebody has had them made, or None.

        They are handed over: who asks again gets nothing.
        """
        return None

    def interior_check(self, branch: Branch) -> float | None:
        """Parameter inside a branch at which something acts that neither end shows, or None."""
        return None

    def unaccelerated(self) -> Array | None:
        """Unknowns (n,) at λ = 1 of a step in time whose velocities stay; None without any."""
        return None

    def round_off(self, u: Array, control: float) -> float:
        """Imbalance that the last digits of a state are worth; none by default."""
        return 0.0

    def smoother(self, width: float) -> tuple[Equations, Equations] | None:
        """The same with the corners of its laws so many times as wide, and the path at λ = 1 along
        which they narrow to the given ones; None without corners."""
        return None


def inner(equations: Equations, u: Array, w: Array) -> float:
    """Dimensionless inner product of two changes of state."""
    return float((u * equations.metric) @ w)


def size(equations: Equations, u: Array) -> float:
    """Length of a change of state in the equations' own scales."""
    return math.sqrt(max(inner(equations, u, u), 0.0))


class Timer:
    """Adds the seconds spent inside to a phase; hundreds of them are part of one expansion."""

    __slots__ = ("begin", "phase", "seconds")

    def __init__(self, seconds: dict[str, float], phase: str) -> None:
        self.seconds, self.phase = seconds, phase

    def __enter__(self) -> None:
        self.begin = time.perf_counter()

    def __exit__(self, *failure: object) -> None:
        spent = time.perf_counter() - self.begin
        self.seconds[self.phase] = self.seconds.get(self.phase, 0.0) + spent


@dataclass
class Cost:
    """Counters of work, and the seconds that it took; ``most`` bounds the expansions."""

    expansions: int = 0
    factorisations: int = 0
    solves: int = 0
    residuals: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    most: float = float("inf")

    def timed(self, phase: str) -> Timer:
        """Add the seconds spent inside to ``phase``."""
        return Timer(self.seconds, phase)


LARGEST_PATH_IMBALANCE = 1e-2
"""Largest imbalance on a rate-free path; at 0.1 some paths stall."""

NEGLIGIBLE_SHARE = 0.01
"""Share of a quantity that is not seen in it: a residual in an error in time, the instant in which
a start settles in the first step, the last digit of the time in the shortest one, and V_c in the
speed of a surface that turns round, at which strip begins anew.
With 0.03 and 0.001 of this speed strip that turns round on four rollers takes 80 and 91 tangents
instead of 76, without a new beginning 1 140."""


@dataclass(frozen=True)
class Tolerances:
    """Bounds that follow from the tolerance of a scene; forces and lengths in the problem's scales.

    The tolerance itself bounds the errors in time, of position in the whole duration and of tension
    at any time, the imbalance of a state that Newton's method has corrected, and the distance, over
    the length scale, below which a place is not known.
    """

    tolerance: float  # of a scene, relative

    @property
    def path(self) -> float:
        """Largest imbalance at the end of a branch of a rate-free path."""
        return min(self.tolerance, LARGEST_PATH_IMBALANCE)

    @property
    def time_residual(self) -> float:
        """Largest imbalance at the end of a branch within a time step."""
        return NEGLIGIBLE_SHARE * self.tolerance


class Outcome(Enum):
    """Outcome of a path; the value is the sentence for the user."""

    DONE = "reached the end"
    FOLD = "the control cannot be increased further: the path turned back at a limit point"
    STALLED = "steps became too short to go on"
    SINGULAR = "the tangent is singular: something is not held, or a bifurcation"
    TOO_MANY_STEPS = "the allowed number of steps was used up; allow more"
    TOO_MANY_TANGENTS = "the allowed number of tangents was used up; allow more"
    INTERRUPTED = "it was interrupted"
    NOT_ENDED = "it has not ended"
    NOT_FINITE = "the equations gave values that are not finite"
    OVERSTRETCHED = "the strip is stretched to more than twice its length, as no elastic strip is"
    RAN_AWAY = "the strip runs away, a thousand times as fast as the line"
    SPUN = (
        "a roller turns a thousand times as fast as the line, and what comes next cannot catch it"
    )
    TOO_LARGE = "the factors of the tangent do not fit into memory"

    @property
    def done(self) -> bool:
        """Whether the path was completed."""
        return self is Outcome.DONE


@dataclass(frozen=True)
class Evidence:
    """Unknowns at which a path failed, as far as it shows."""

    unknown: int | None = None  # number of the one whose pivot vanished, or that is not finite
    residual: Array | None = None  # (n,), imbalance that stays, or the first that comes
    motion: Array | None = None  # (n,), change that goes wrong: error of a step, way back of a fold


NO_EVIDENCE = Evidence()


class PathStopped(Exception):  # noqa: N818
    """A path ended before its target, at ``control``, for the reason ``outcome``.

    ``detail`` says what else is known, ``evidence`` which unknowns show it, ``farthest`` up to
    which control the path has led, and ``width`` how many times as wide as the given ones corners
    of laws are with which the target was reached, where that is known.
    """

    farthest: float | None = None
    width: float | None = None

    def __init__(
        self, outcome: Outcome, control: float, detail: str = "", evidence: Evidence = NO_EVIDENCE
    ) -> None:
        super().__init__(f"{outcome.value} (at {control:.6g}){': ' + detail if detail else ''}")
        self.outcome, self.control, self.detail = outcome, control, detail
        self.evidence = evidence


@dataclass(frozen=True)
class Branch:
    """One truncated series of a path parameter a, valid on [0, length].

    It may be a quotient: then u and control hold the numerators.
    """

    u: Array  # coefficients of the unknowns, (order + 1, n)
    control: Array  # coefficients of the control λ (load factor, or time), (order + 1,)
    length: float  # range of validity in a
    residual: Array  # initial imbalance R_0, (n,): R(a) = R_0 (1 − a / carried_over)
    carried_over: float = 1.0
    forces: tuple[float, float] = (0.0, 0.0)  # imbalance at a = 1 without the last two terms each
    denominator: Array = field(default_factory=lambda: np.array([1.0, 0.0]))  # begins with 1
    aim: float | None = None  # control at the end, where known: a quotient has it to round-off

    @property
    def order(self) -> int:
        """Highest order present."""
        return len(self.u) - 1

    def __call__(self, a: float) -> tuple[Array, float]:
        """State and control at parameter ``a``."""
        q = value_at(self.denominator, a)
        return value_at(self.u, a) / q, float(value_at(self.control, a) / q)

    def many(self, a: Array) -> tuple[Array, Array]:
        """States (m, n) and controls (m,) at parameters ``a``."""
        powers = np.vander(a, max(len(self.u), len(self.denominator)), increasing=True)
        q = powers[:, : len(self.denominator)] @ self.denominator
        powers = powers[:, : len(self.u)] / q[:, None]
        return powers @ self.u, powers @ self.control

    @cached_property
    def end(self) -> tuple[Array, float]:
        """State and control at the end of the range."""
        u, control = self(self.length)
        return u, control if self.aim is None else self.aim

    def direction(self, a: float) -> tuple[Array, float]:
        """Derivatives of state and control with respect to a."""
        u, control = self(a)
        q, rates = value_at(self.denominator, a), (self.denominator, self.u, self.control)
        slope, direction, along = (value_at(derivative_coefficients(c), a) for c in rates)
        return (direction - slope * u) / q, float((along - slope * control) / q)

    def cut(self, length: float) -> Branch:
        """The same series on another range."""
        return replace(self, length=length, aim=None)

    def reaches(self, control: float) -> float | None:
        """Smallest a in (0, length] at which the control has the given value."""
        shifted = np.asarray(polysub(self.control, control * self.denominator), dtype=np.float64)
        return first_root(shifted, self.length)

    @property
    def folds(self) -> list[float]:
        """All a in (0, length] at which the control turns back, in their order."""
        return roots_within(self._turning, self.length)

    @property
    def turns(self) -> list[float]:
        """All a in [−length, length] except 0 at which the control turns back."""
        mirrored = self._turning * (-1.0) ** np.arange(len(self._turning))
        return [*self.folds, *(-a for a in roots_within(mirrored, self.length))]

    @property
    def _turning(self) -> Array:
        """Coefficients of a polynomial that vanishes where dλ/da does."""
        q = self.denominator
        left = polymul(derivative_coefficients(self.control), q)
        slope = polysub(left, polymul(self.control, derivative_coefficients(q)))
        return np.asarray(slope, dtype=np.float64)

    def landed(self, control: float) -> Branch:
        """The same branch with an end control that has the given value."""
        moved = replace(self, control=self.control.copy(), aim=control)
        q = value_at(self.denominator, self.length)
        for _ in range(2):
            miss = control - value_at(moved.control, self.length) / q
            moved.control[1] += miss * q / self.length
        return moved


@dataclass(frozen=True)
class Path:
    """Branches end to end.

    Calling a path with a control value gives the state at the first point where
    the control has it; :meth:`at` takes the running parameter instead.
    """

    branches: tuple[Branch, ...]

    @property
    def knots(self) -> Array:
        """Running parameter at the ends of the branches, starting with 0."""
        return np.concatenate([[0.0], np.cumsum([b.length for b in self.branches])])

    def at(self, s: float) -> tuple[Array, float]:
        """State and control at running parameter ``s``."""
        knots = self.knots
        i = min(max(bisect_right(knots, s) - 1, 0), len(self.branches) - 1)
        return self.branches[i](s - knots[i])

    def __call__(self, control: float) -> Array:
        """State where the control first takes the given value.

        Raises
        ------
        ValueError
            If the path does not reach it.
        """
        if self.branches and control == self.branches[0].control[0]:
            return self.branches[0].u[0]
        for branch in self.branches:
            if (a := branch.reaches(control)) is not None:
                return branch(a)[0]
        raise ValueError(f"the path does not reach the control {control!r}")


def lagrange(times: tuple[float, ...], new: float) -> Array:
    """Values at ``new`` of the Lagrange polynomials of some instants, shape (instants,)."""
    nodes, values = np.array(times), np.empty(len(times))
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        values[j] = np.prod((new - others) / (node - others))
    return values


def extrapolate(times: tuple[float, ...], states: tuple[Array, ...], new: float) -> Array:
    """Value at ``new`` of the polynomial through all given past states."""
    return lagrange(times, new) @ np.array(states)
