"""Where a quasi-static motion is unstable: neighbouring solutions leave it on their own.

Of R(u, v, t) = 0 with u' = v, a small disturbance of the driven unknowns obeys D c' = −S c, with
the slope D of the resistance to motion and the rate-free tangent S, from which the algebraic
unknowns have been eliminated.  Friction alone always resists (D > 0), so that a negative S says
that the equilibrium without rates is unstable: the state runs away, at the rate −S/D that the
regularised law allows, to an equilibrium elsewhere or for ever.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .global_error import TimePath
from .index_one import Point, Residual

Array = NDArray[np.float64]

MANY = 10.0
"""Powers of e by which neighbours would drift apart in the whole time, that count as unstable."""


@dataclass(frozen=True)
class Instability:
    """A stretch of time in which a motion was unstable.

    Attributes
    ----------
    start, end : float
        s; from the first to the last such step.
    pivot : float
        Lowest pivot of the rate-free tangent along the motion there (N/m).
    rate : float
        Largest rate at which it left its equilibria (1/s).
    distance : float
        By which the state has changed meanwhile (its own unit).
    """

    start: float
    end: float
    pivot: float
    rate: float
    distance: float

    def __str__(self) -> str:
        return (
            f"Unstable from t = {self.start:.6g} s to {self.end:.6g} s: the rate-free tangent has "
            f"the negative pivot {self.pivot:.3g} N/m along the motion, so that Coulomb's law has "
            f"no equilibrium to follow; the regularised law moved on by {self.distance:.3g} m, "
            f"at up to {self.rate:.2g} times its distance per second."
        )


def pivot(residual: Residual, u: Array, v: Array, t: float) -> tuple[float, float]:
    """Pivot S of the rate-free tangent along the motion, and the growth rate −S/D there.

    Both are positive and negative as for a spring and a dashpot, whatever the sign of the
    residual; a state without resistance to motion has the pivot ∞.
    """
    point = Point.at(residual, u, v, t)
    rows, P = point.driven
    if not len(rows):
        return np.inf, -np.inf
    whole = np.stack([p + point.algebraic_part(point.stiffness @ p) for p in P.T], axis=1)
    resistance, tangent = rows @ point.damping @ P, rows @ point.stiffness @ whole
    along = P.T @ v
    length = float(np.linalg.norm(along))
    along = along / length if length > 0.0 else np.eye(len(along))[0]
    D, S = along @ resistance @ along, along @ tangent @ along
    return float(S * np.sign(D)), float(-S / D)


def instabilities(residual: Residual, path: TimePath) -> list[Instability]:
    """Stretches in which a computed motion is unstable, in the order of time."""
    whole = path.knots[-1] - path.knots[0]
    found: list[Instability] = []
    current: list[tuple[float, float, float]] = []
    for t in [*path.knots[1:], np.inf]:
        S, rate = pivot(residual, *path(t), t) if np.isfinite(t) else (np.inf, -np.inf)
        if rate * whole > MANY:
            current.append((float(t), S, rate))
        elif current:
            start, end = current[0][0], current[-1][0]
            moved = np.abs(path(min(t, path.knots[-1]))[0] - path(start)[0]).max()
            lowest, fastest = min(c[1] for c in current), max(c[2] for c in current)
            found.append(Instability(start, end, lowest, fastest, float(moved)))
            current = []
    return found
