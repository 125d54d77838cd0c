"""Taylor series in time for index-1 systems, explicit in time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PPoly

from anmstrip.arrays import Array
from anmstrip.continuation.equations import TINY, Cost, Outcome, PathStopped
from anmstrip.taylor.polynomials import derivative_coefficients, value_at
from anmstrip.taylor.series import recorded
from anmstrip.timestepping.index_one import (
    Point,
    Residual,
    TimePath,
    find_consistent_state,
    residual_size,
    time_stretch,
)

MAX_EXPLICIT_STEPS = 200_000

MAX_ERROR_RATE = 1.5
"""Largest error per time over that which would use the tolerance up evenly.

What is left near the end would allow any velocity there.
"""

LENGTHENING_SHARE = 0.1
"""Share of what a step may err below which a longer one is tried: its last terms had told of a
shorter one."""


@dataclass(frozen=True)
class TimeSeries:
    """Taylor series of u in time on [start, end]."""

    coefficients: Array  # (order + 1, n)
    start: float
    end: float
    error: float = 0.0  # estimated error of u that the step hands on to the next
    passing: float = 0.0  # estimated error of its algebraic part, which the next takes away

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""
        a = t - self.start
        rates = derivative_coefficients(self.coefficients)
        return value_at(self.coefficients, a), value_at(rates, a)


def join_series(pieces: Sequence[TimeSeries]) -> TimePath:
    """Time series end to end, callable at any time inside."""
    knots = [pieces[0].start, *(p.end for p in pieces)]
    curve = PPoly(np.stack([p.coefficients[::-1] for p in pieces], axis=1), knots)
    errors, passing = np.array([(p.error, p.passing) for p in pieces]).T
    return TimePath(curve, errors, passing)


def integrate_explicitly(
    residual: Residual,
    u: Array,
    v: Array,
    span: tuple[float, float],
    *,
    order: int = 19,
    tolerance: float = 1e-4,
    speed: float = np.inf,
    cost: Cost | None = None,
) -> Iterator[TimeSeries]:
    """Steps of the explicit Taylor scheme.

    A step ends where Newton's correction of the truncated series (one iteration,
    with the derivatives there) is still small.  Its algebraic part is the error
    of the algebraic unknowns.  Its driven part Δv is the defect u' − v(u, t) of
    the series, which grows like a^N along the step a: the step adds
    |Δv| a/(N + 1) to the error of u.  That may be ε a/T, where T is the time that is
    left and ε what the steps before have left of ``tolerance``, so |Δv| ≤ (N + 1) ε/T,
    or half as much again as an even share if that is less; in motion faster than V by
    √(1 + |v|²/V²) more, for an error along the way is a shift in time, and counted as
    such.

    Guaranteed, as far as these leading terms go: in a problem whose solutions
    do not drift apart (∂R/∂u and ∂R/∂v of one sign) the error of u stays below
    the tolerance at all times.  Where they do, see
    :func:`anmstrip.timestepping.index_one.integrate_controlled`.

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
    speed : float
        V, from which on motion counts as fast; infinite for errors at equal times.

    Yields
    ------
    TimeSeries

    Raises
    ------
    PathStopped
    """
    cost = Cost() if cost is None else cost
    stepper = _Stepper(recorded(residual), order, tolerance, span[1] - span[0], speed, cost)
    left, (t, end) = tolerance, span
    for _ in range(MAX_EXPLICIT_STEPS):
        rate = min(left / (end - t), MAX_ERROR_RATE * tolerance / stepper.whole)
        piece = replace(stepper, rate=rate).step(u, v, t, end)
        yield piece
        left -= piece.error / time_stretch(piece(piece.end)[1], speed)
        t = piece.end
        if t >= end:
            return
        u, v = piece(t)
    raise PathStopped(Outcome.TOO_MANY_STEPS, t)


@dataclass(frozen=True)
class _Stepper:
    """Expand and validate, with the allowed corrections of u, and of u per time by those of v."""

    residual: Residual
    order: int
    tolerance: float
    whole: float
    speed: float
    cost: Cost
    rate: float = 0.0

    def allowed(self, v: Array) -> float:
        """Largest |Δv| at the velocity v."""
        return (self.order + 1) * self.rate * time_stretch(v, self.speed)

    def step(self, u: Array, v: Array, t: float, end: float) -> TimeSeries:
        """The longest series from t on that keeps the tolerance."""
        u, v = find_consistent_state(self.residual, u, v, t, self.tolerance, self.allowed(v))
        with self.cost.timed("series"):
            point = Point.at(self.residual, u, v, t, self.order)
            u_orders, v_last = _orders(point, self.order)
        self.cost.expansions += 1
        self.cost.factorisations += 1
        series, N = TimeSeries(u_orders, t, end), self.order
        terms = [(N, np.abs(v_last).max()), (N - 1, N * np.abs(u_orders[N]).max())]
        guesses = [(self.allowed(v) / x) ** (1.0 / k) for k, x in terms if x > 0.0 and k > 0]
        length = min(guesses, default=np.inf)  # where the last two terms of u' reach the defect
        while True:
            if length < 1e-12 * self.whole:
                reason = f"no step above {length:.2g} keeps the tolerance"
                raise PathStopped(Outcome.STALLED, t, reason)
            piece, excess = self.tried(series, length)
            if excess <= 1.0:
                break
            length = (piece.end - t) * min(max(self.longer(excess), 0.2), 0.95)
        if excess < LENGTHENING_SHARE and piece.end < end:
            further = (piece.end - t) * min(self.longer(excess), 2.0)
            longer, excess = self.tried(series, further)
            return longer if excess <= 1.0 else piece
        return piece

    def longer(self, excess: float) -> float:
        """Length, over that of a piece, at which it would err by half of what it may."""
        if not np.isfinite(excess):
            return 0.0
        return float((0.5 / max(excess, TINY)) ** (1.0 / self.order))

    def tried(self, piece: TimeSeries, length: float) -> tuple[TimeSeries, float]:
        """So much of a piece, with its errors, and these over what they may be."""
        ahead = piece.end - piece.start
        if length < ahead * (1.0 - 1e-12):
            piece = replace(piece, end=piece.start + length)
        piece = self.judged(piece)
        rate = self.rate * time_stretch(piece(piece.end)[1], self.speed)
        share = (piece.end - piece.start) * rate
        return piece, max(piece.passing / self.tolerance, piece.error / share)

    def judged(self, piece: TimeSeries) -> TimeSeries:
        """The piece with its errors, from Newton's correction at its end."""
        self.cost.residuals += 1
        with np.errstate(all="ignore"):
            u, v = piece(piece.end)
            if not np.isfinite(residual_size(self.residual, u, v, piece.end)):
                return replace(piece, error=np.inf, passing=np.inf)
            shift, kick = Point.at(self.residual, u, v, piece.end).correction()
        inherited = float(np.abs(kick).max()) * (piece.end - piece.start) / (self.order + 1)
        return replace(piece, error=inherited, passing=float(np.abs(shift).max()))


def _orders(point: Point, order: int) -> tuple[Array, Array]:
    """Coefficients of u, order by order, and the last one of v."""
    u, v = np.zeros((2, order + 1, len(point.u)))
    u[0], v[0] = point.u, point.v
    P = point.driven[1]
    coupled = len(point.algebraic[0]) > 0
    for p in range(1, order + 1):
        u[p] = P @ (P.T @ v[p - 1]) / p
        time = 1.0 if p == 1 else None
        residual = point.orders.advance(p, u[p], None, time)
        if coupled:
            u[p] += point.algebraic_part(residual)
            point.orders.correct(None, p * u[p] - v[p - 1])
            v[p - 1] = p * u[p]
            residual = point.orders.advance(p, u[p], None, time)
        v[p] = point.driven_part(residual)
        point.orders.correct(None, v[p])
    return u, v[-1]
