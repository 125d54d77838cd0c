"""Taylor series in time for index-1 systems, explicit in time.

Solved are R(u, v, t) = 0 with u' = v, where ∂R/∂v has less than full rank:
some directions are driven by velocities, the others are algebraic.  With the
two sets of directions P and Q frozen at the start of a step,

* the driven part of u_p is known from order p − 1 of v: P u_p = P v_{p−1} / p,
* the algebraic part of u_p follows from the rows of R on which velocities do
  not act, with the tangent ∂R/∂u; it completes v_{p−1} = p u_p,
* the driven part of v_p follows from the other rows, with the slope ∂R/∂v.

Source: Béchet, Lejeune & Potier-Ferry (2010), §3, for (P, Q) = (t, n), the
tangent and the normal of the obstacle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .continuation import Outcome, PathStopped
from .expansion import Cost
from .power_series import Series, Tape, derivative_coefficients, horner

Array = NDArray[np.float64]
Residual = Callable[[Any, Any, Any], Any]
"""``residual(u, v, t)`` of arrays (n,), (n,), () → (n,), written in numpy."""

CONSISTENT = 1e-3
"""A start is consistent when Newton's correction is this fraction of the tolerance."""


@dataclass(frozen=True)
class TimeSeries:
    """Taylor series of u in time on [start, end].

    Attributes
    ----------
    coefficients : ndarray, shape (order + 1, n)
    start, end : float
    error : float
        Estimated error that the step adds to u.
    """

    coefficients: Array
    start: float
    end: float
    error: float = 0.0

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""
        a = t - self.start
        return horner(self.coefficients, a), horner(derivative_coefficients(self.coefficients), a)


class PiecewiseSeries:
    """Time series end to end, callable at any time inside.

    Attributes
    ----------
    pieces : tuple of TimeSeries
    knots : ndarray, shape (number of pieces + 1,)
        Times at which they meet.
    errors : ndarray, shape (number of pieces,)
        What each adds to the error of u.
    """

    def __init__(self, pieces: Sequence[TimeSeries]) -> None:
        self.pieces = tuple(pieces)
        self.knots = np.array([pieces[0].start, *(p.end for p in pieces)])
        self.errors = np.array([p.error for p in pieces])

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""
        i = int(np.searchsorted(self.knots[1:], t))
        return self.pieces[min(i, len(self.pieces) - 1)](t)


@dataclass(frozen=True)
class Point:
    """The equations at one state: residual, derivatives, and the split of directions.

    Attributes
    ----------
    tape : Tape
        Recording of the residual, for the orders to come.
    u, v, residual : Series, shape (n,)
    stiffness, damping : ndarray, shape (n, n)
        ∂R/∂u and ∂R/∂v.
    driven, algebraic : tuple of ndarray
        Rows of R (r, n) and directions (n, r) on which velocities act, and the rest.
    """

    tape: Tape
    u: Series
    v: Series
    residual: Series
    stiffness: Array
    damping: Array
    driven: tuple[Array, Array]
    algebraic: tuple[Array, Array]

    @classmethod
    def at(cls, residual: Residual, u: Array, v: Array, t: float, order: int = 0) -> Point:
        """Trace the residual once."""
        tape = Tape(order)
        us, vs, ts = tape.variable(u), tape.variable(v), tape.variable(t)
        ts.coefficients[1:2] = 1.0
        r = residual(us, vs, ts)
        unit = np.eye(len(u))
        stiffness = tape.derivative(r, {us: unit}).T
        damping = tape.derivative(r, {vs: unit}).T
        left, values, right = np.linalg.svd(damping)
        smallest = 1e-12 * np.abs(stiffness).max() + 1e-10 * values[0]
        rank = int((values > smallest).sum())
        driven, algebraic = (left[:, :rank].T, right[:rank].T), (left[:, rank:].T, right[rank:].T)
        return cls(tape, us, vs, r, stiffness, damping, driven, algebraic)

    def algebraic_part(self, r: Array) -> Array:
        """Change of u in algebraic directions that takes ``r`` out of the algebraic rows."""
        rows, Q = self.algebraic
        if not len(rows):
            return np.zeros(len(r))
        return Q @ np.linalg.solve(rows @ self.stiffness @ Q, -rows @ r)

    def driven_part(self, r: Array) -> Array:
        """Change of v in driven directions that takes ``r`` out of the driven rows."""
        rows, P = self.driven
        return P @ np.linalg.solve(rows @ self.damping @ P, -rows @ r)

    def correction(self) -> tuple[Array, Array]:
        """Newton's step to R = 0: algebraic part of u, driven part of v."""
        shift = self.algebraic_part(self.residual.value)
        return shift, self.driven_part(self.residual.value + self.stiffness @ shift)


def integrate(
    residual: Residual,
    u: Array,
    v: Array,
    span: tuple[float, float],
    *,
    order: int = 19,
    tolerance: float = 1e-4,
    max_steps: int = 100_000,
    cost: Cost | None = None,
) -> Iterator[TimeSeries]:
    """Steps of the explicit Taylor scheme.

    A step ends where Newton's correction of the truncated series (one iteration,
    with the derivatives there) is still small.  Its algebraic part is the error
    of the algebraic unknowns.  Its driven part Δv is the defect u' − v(u, t) of
    the series, which grows like a^N along the step a: the step adds
    |Δv| a/(N + 1) to the error of u.  That may be ``tolerance`` a/T in a span T,
    so |Δv| ≤ (N + 1) ``tolerance``/T for all steps alike.

    Guaranteed, as far as these leading terms go: in a problem whose solutions
    do not drift apart (∂R/∂u and ∂R/∂v of one sign) the error of u stays below
    the tolerance at all times.  Where they do, see
    :func:`anmstrip.series.global_error.controlled`.

    Parameters
    ----------
    residual : callable
        ``residual(u, v, t)`` of arrays (n,), (n,), () → (n,), written in numpy.
    u, v : ndarray, shape (n,)
        Start; algebraic u and driven v are made consistent by Newton's method.
    span : tuple of float
    order : int
        N.
    tolerance : float
        Error of u, in its own unit, that all steps together may make.

    Yields
    ------
    TimeSeries

    Raises
    ------
    PathStopped
    """
    cost = Cost() if cost is None else cost
    stepper = _Stepper(residual, order, tolerance, span[1] - span[0], cost)
    t, end = span
    for _ in range(max_steps):
        piece = stepper.step(u, v, t, end)
        yield piece
        t = piece.end
        if t >= end:
            return
        u, v = piece(t)
    raise PathStopped(Outcome.TOO_MANY_STEPS, t)


@dataclass(frozen=True)
class _Stepper:
    """Expand and validate, with the allowed corrections of u and of v."""

    residual: Residual
    order: int
    tolerance: float
    whole: float
    cost: Cost

    @property
    def defect(self) -> float:
        """Allowed |Δv|."""
        return (self.order + 1) * self.tolerance / self.whole

    def step(self, u: Array, v: Array, t: float, end: float) -> TimeSeries:
        """The longest series from t on that keeps the tolerance."""
        u, v = self.consistent(u, v, t)
        with self.cost.timed("series"):
            u_orders, v_last = _orders(Point.at(self.residual, u, v, t, self.order))
        self.cost.expansions += 1
        self.cost.factorisations += 1
        length = min(self.guess(u_orders, v_last), end - t)
        while length > 1e-12 * self.whole:
            stop = end if length >= (end - t) * (1.0 - 1e-12) else t + length
            piece = TimeSeries(u_orders, t, stop)
            excess, defect = self.excess(piece)
            if excess <= 1.0:
                return TimeSeries(u_orders, t, stop, defect * (stop - t) / (self.order + 1))
            shorter = (0.5 / excess) ** (1.0 / self.order) if np.isfinite(excess) else 0.0
            length *= min(max(shorter, 0.2), 0.95)
        raise PathStopped(Outcome.STALLED, t, f"no step above {length:.2g} keeps the tolerance")

    def consistent(self, u: Array, v: Array, t: float) -> tuple[Array, Array]:
        """State nearby with R = 0, by Newton's method on algebraic u and driven v.

        The residual must fall from step to step, else the step is halved: the
        friction law saturates, and full steps from far away would diverge.
        """
        for _ in range(50):
            point = Point.at(self.residual, u, v, t)
            shift, kick = point.correction()
            left = max(_ratio(shift, self.tolerance, u), _ratio(kick, self.defect, v))
            if left <= CONSISTENT:
                return u + shift, v + kick
            size, part = np.abs(point.residual.value).max(), 1.0
            while part > 1e-6 and self.size(u + part * shift, v + part * kick, t) >= size:
                part *= 0.5
            u, v = u + part * shift, v + part * kick
        raise PathStopped(Outcome.STALLED, t, "no velocity satisfies the friction law here")

    def size(self, u: Array, v: Array, t: float) -> float:
        """Largest entry of the residual."""
        with np.errstate(all="ignore"):
            return float(np.nan_to_num(np.abs(self.residual(u, v, t)).max(), nan=np.inf))

    def guess(self, u: Array, v_last: Array) -> float:
        """Length at which the last two terms of the velocity reach the allowed defect."""
        N = self.order
        terms = [(N, np.abs(v_last).max()), (N - 1, N * np.abs(u[N]).max())]
        lengths = [(self.defect / x) ** (1.0 / k) for k, x in terms if x > 0.0 and k > 0]
        return min(lengths, default=np.inf)

    def excess(self, piece: TimeSeries) -> tuple[float, float]:
        """Correction at the end over what is allowed, and |Δv|."""
        self.cost.residuals += 1
        with np.errstate(all="ignore"):
            u, v = piece(piece.end)
            if not np.isfinite(self.residual(u, v, piece.end)).all():
                return np.inf, np.inf
            shift, kick = Point.at(self.residual, u, v, piece.end).correction()
        defect = float(np.abs(kick).max())
        return max(float(np.abs(shift).max()) / self.tolerance, defect / self.defect), defect


def _ratio(change: Array, allowed: float, value: Array) -> float:
    """Largest change in units of what is allowed, or of round-off if that is more."""
    unit = max(allowed, 1e-9 * float(np.abs(value).max()))
    return float(np.abs(change).max()) / unit


def _orders(point: Point) -> tuple[Array, Array]:
    """Coefficients of u, order by order, and the last one of v."""
    tape, u, v, r = point.tape, point.u.coefficients, point.v.coefficients, point.residual
    P = point.driven[1]
    coupled = len(point.algebraic[0]) > 0
    for p in range(1, tape.order + 1):
        u[p] = P @ (P.T @ v[p - 1]) / p
        tape.advance(p)
        if coupled:
            u[p] += point.algebraic_part(r.coefficients[p])
            tape.correct(p - 1, {point.v: p * u[p] - v[p - 1]})
            tape.advance(p)
        tape.correct(p, {point.v: point.driven_part(r.coefficients[p])})
    return u.copy(), v[-1].copy()
