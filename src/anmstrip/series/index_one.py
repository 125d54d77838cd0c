"""Index-1 systems R(u, v, t) = 0 with u' = v, looked at in one state.

∂R/∂v has less than full rank: some directions of u are driven by velocities,
the others are algebraic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .outcome import Outcome, PathStopped
from .power_series import Series, Tape

Array = NDArray[np.float64]
Residual = Callable[[Any, Any, Any], Any]
"""``residual(u, v, t)`` of arrays (n,), (n,), () → (n,), written in numpy."""

CONSISTENT = 1e-3
"""A state is consistent when Newton's correction is this fraction of the tolerance."""

MOST_ITERATIONS = 500
"""Of Newton's method: far away a saturating law, like |v|^q, lets it come nearer by a third."""

TINY = float(np.finfo(float).tiny)


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

    @property
    def growth_rate(self) -> float:
        """Rate at which neighbouring solutions drift apart (1/s; negative: come together).

        Of the error, the driven part obeys c' = −κ c, where the algebraic part has
        been eliminated; the rate is the largest eigenvalue of the symmetric part of
        −κ.  The turning of the directions during a step is neglected.
        """
        rows, P = self.driven
        if not len(rows):
            return -np.inf
        whole = np.stack([p + self.algebraic_part(self.stiffness @ p) for p in P.T], axis=1)
        kappa = np.linalg.solve(rows @ self.damping @ P, rows @ self.stiffness @ whole)
        return float(np.linalg.eigvalsh(-0.5 * (kappa + kappa.T))[-1])


def consistent(
    residual: Residual,
    u: Array,
    v: Array,
    t: float,
    tolerance: float = 1e-9,
    rate_tolerance: float | None = None,
) -> tuple[Array, Array]:
    """State nearby with R = 0, by Newton's method on algebraic u and driven v.

    The residual must fall from step to step, else the step is halved: a friction
    law saturates, and full steps from far away would diverge.

    Parameters
    ----------
    residual : callable
    u, v : ndarray, shape (n,)
    t : float
    tolerance, rate_tolerance : float
        Errors of u and v beside which the last corrections are negligible; the
        second is the first per unit of time if not given.

    Raises
    ------
    PathStopped
    """
    allowed = tolerance if rate_tolerance is None else rate_tolerance
    for _ in range(MOST_ITERATIONS):
        point = Point.at(residual, u, v, t)
        shift, kick = point.correction()
        if max(_ratio(shift, tolerance, u), _ratio(kick, allowed, v)) <= CONSISTENT:
            return u + shift, v + kick
        size, part = np.abs(point.residual.value).max(), 1.0
        while part > 1e-6 and size_of(residual, u + part * shift, v + part * kick, t) >= size:
            part *= 0.5
        u, v = u + part * shift, v + part * kick
    raise PathStopped(Outcome.STALLED, t, "no velocity satisfies the friction law here")


def size_of(residual: Residual, u: Array, v: Array, t: float) -> float:
    """Largest entry of the residual, infinite where it is not a number."""
    with np.errstate(all="ignore"):
        return float(np.nan_to_num(np.abs(residual(u, v, t)).max(), nan=np.inf))


def stretch(v: Array, speed: float) -> float:
    """√(1 + |v|²/V²): error at equal times over the distance of the curves (V t, u)."""
    return float(np.hypot(1.0, np.abs(v).max() / speed))


def _ratio(change: Array, allowed: float, value: Array) -> float:
    """Largest change in units of what is allowed, or of round-off if that is more."""
    unit = max(allowed, 1e-9 * float(np.abs(value).max()), TINY)
    return float(np.abs(change).max()) / unit
