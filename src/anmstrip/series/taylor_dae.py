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

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .continuation import Outcome, PathStopped
from .expansion import Cost
from .power_series import Series, Tape, derivative_coefficients, horner

Array = NDArray[np.float64]
Residual = Callable[..., Series]


@dataclass(frozen=True)
class TimeSeries:
    """Taylor series of u in time on [start, end].

    Attributes
    ----------
    coefficients : ndarray, shape (order + 1, n)
    start, end : float
    imbalance : float
        Largest residual at the end.
    """

    coefficients: Array
    start: float
    end: float
    imbalance: float = 0.0

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""
        a = t - self.start
        return horner(self.coefficients, a), horner(derivative_coefficients(self.coefficients), a)


class PiecewiseSeries:
    """Time series end to end, callable at any time inside."""

    def __init__(self, pieces: list[TimeSeries]) -> None:
        self.pieces = pieces
        self.ends = np.array([p.end for p in pieces])

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""
        i = min(int(np.searchsorted(self.ends, t)), len(self.pieces) - 1)
        return self.pieces[i](t)


@dataclass(frozen=True)
class _Point:
    """Where a step starts, with the split of directions frozen there."""

    tape: Tape
    u: Series
    v: Series
    t: Series
    residual: Series
    stiffness: Array
    damping: Array
    driven: Array
    algebraic: Array


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

    Parameters
    ----------
    residual : callable
        ``residual(u, v, t)`` of arrays (n,), (n,), () → (n,), written in numpy.
    u, v : ndarray, shape (n,)
        Start; the driven part of ``v`` is made consistent by Newton's method.
    span : tuple of float
    order : int
    tolerance : float
        Error in u that all steps together may make, and largest residual at the
        end of a step, both in the problem's own units.

    Raises
    ------
    PathStopped
    """
    cost = Cost() if cost is None else cost
    t, end = span
    previous = end - t
    for _ in range(max_steps):
        u, v = _consistent(residual, u, v, t, tolerance)
        with cost.timed("series"):
            coefficients = _series(_point(residual, u, v, t, order))
        cost.expansions += 1
        cost.factorisations += 1
        step, imbalance = _validated(residual, coefficients, t, end, tolerance, cost)
        if step < 1e-12 * (end - span[0]):
            raise PathStopped(Outcome.STALLED, t, f"a step of {step:.3g} after {previous:.3g}")
        previous = step
        stop = end if step >= end - t else t + step
        piece = TimeSeries(coefficients, t, stop, imbalance)
        yield piece
        u, v = piece(stop)
        t = stop
        if t >= end:
            return
    raise PathStopped(Outcome.TOO_MANY_STEPS, t)


def _point(residual: Residual, u: Array, v: Array, t: float, order: int) -> _Point:
    tape = Tape(order)
    us, vs, ts = tape.variable(u), tape.variable(v), tape.variable(t)
    ts.coefficients[1:2] = 1.0
    r = residual(us, vs, ts)
    unit = np.eye(len(u))
    stiffness = tape.derivative(r, {us: unit}).T
    damping = tape.derivative(r, {vs: unit}).T
    left, values, right = np.linalg.svd(damping)
    rank = int((values > 1e-12 * np.abs(stiffness).max() + 1e-10 * values.max()).sum())
    del left
    driven, algebraic = right[:rank].T, right[rank:].T
    return _Point(tape, us, vs, ts, r, stiffness, damping, driven, algebraic)


def _consistent(
    residual: Residual, u: Array, v: Array, t: float, tolerance: float
) -> tuple[Array, Array]:
    """State and velocity nearby with R = 0: Newton on algebraic u and driven v."""
    for _ in range(50):
        point = _point(residual, u, v, t, 0)
        r = point.residual.value
        if np.abs(r).max() <= 1e-3 * tolerance:
            return u, v
        P, Q = point.driven, point.algebraic
        if Q.shape[1]:
            shift = Q @ np.linalg.solve(Q.T @ point.stiffness @ Q, -Q.T @ r)
            u, r = u + shift, r + point.stiffness @ shift
        v = v + P @ np.linalg.solve(P.T @ point.damping @ P, -P.T @ r)
    raise PathStopped(Outcome.STALLED, t, "no velocity satisfies the friction law here")


def _series(point: _Point) -> Array:
    """Coefficients of u, order by order."""
    tape, u, v, r = point.tape, point.u.coefficients, point.v.coefficients, point.residual
    P, Q = point.driven, point.algebraic
    slope = P.T @ point.damping @ P
    normal = Q.T @ point.stiffness @ Q
    for p in range(1, tape.order + 1):
        u[p] = P @ (P.T @ v[p - 1]) / p
        tape.advance(p)
        if Q.shape[1]:
            y = Q @ np.linalg.solve(normal, -Q.T @ r.coefficients[p])
            tape.correct(p, {point.u: y})
            late = p * y - Q @ (Q.T @ v[p - 1])
            tape.correct(p - 1, {point.v: late})
            tape.advance(p)
        z = P @ np.linalg.solve(slope, -P.T @ r.coefficients[p])
        tape.correct(p, {point.v: z})
    return u.copy()


def _validated(
    residual: Residual, u: Array, t: float, end: float, tolerance: float, cost: Cost
) -> tuple[float, float]:
    """Step on which the last two terms and the residual stay below the tolerance."""
    order = len(u) - 1
    step = end - t
    for k in (order - 1, order):
        last = float(np.abs(u[k]).max())
        if last > 0.0:
            step = min(step, (tolerance / last) ** (1.0 / k))
    velocity = derivative_coefficients(u)
    while True:
        cost.residuals += 1
        with np.errstate(all="ignore"):
            r = residual(horner(u, step), horner(velocity, step), np.float64(t + step))
        error = float(np.abs(r).max())
        if error <= tolerance or step < 1e-300:
            return step, error
        shorter = (0.5 * tolerance / error) ** (1.0 / order) if np.isfinite(error) else 0.0
        step *= min(max(shorter, 0.2), 0.9)
