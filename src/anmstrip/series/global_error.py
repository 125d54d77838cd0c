"""From the errors of single steps to the error of a whole integration.

A step's error lives on in the later ones: neighbouring solutions of
R(u, v, t) = 0, u' = v come together or drift apart like exp ∫ μ dt, with the
logarithmic norm μ of the linearised equation.  Where friction gives way to
elasticity (a snap) they drift apart by orders of magnitude, and no control of
single steps can know it beforehand.  So the growth is measured along a computed
solution, and the integration repeated with a smaller tolerance if need be.

Source: Hairer, Nørsett & Wanner, *Solving ODEs I* (1993), §I.10 for the growth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from .index_one import Point, Residual, stretch

Array = NDArray[np.float64]

NODES = np.array([0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)])
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


class TimePath(Protocol):
    """A computed solution."""

    knots: Array
    """Ends of its steps, shape (m + 1,)."""

    errors: Array
    """What each step adds to the error of u for good, shape (m,)."""

    passing: Array
    """Error of u at the end of each step that the next takes away, shape (m,)."""

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""

    def polynomials(self) -> Iterator[tuple[float, float, Array]]:
        """Start, length and coefficients (order + 1, n) of its pieces."""


T = TypeVar("T", bound=TimePath)


@dataclass(frozen=True)
class Controlled(Generic[T]):
    """A solution with its estimated error.

    Attributes
    ----------
    path : TimePath
    error : float
        Estimate of the largest error of u at any time.
    passes : int
        Integrations that it took.
    """

    path: T
    error: float
    passes: int


def estimated(residual: Residual, path: TimePath) -> Array:
    """Estimated error of u at the knots of a path, shape (m + 1,)."""
    total, errors = 0.0, [0.0]
    for start, end, error in zip(path.knots[:-1], path.knots[1:], path.errors, strict=True):
        times = start + (end - start) * NODES
        rates = np.array([Point.at(residual, *path(t), t).growth_rate for t in times])
        grown = np.exp(min((end - start) * float(WEIGHTS @ rates), 700.0))
        total = total * grown + error
        errors.append(total)
    return np.array(errors) + np.array([0.0, *path.passing])


def controlled(
    run: Callable[[float], T],
    residual: Residual,
    tolerance: float,
    *,
    speed: float = np.inf,
    max_passes: int = 6,
) -> Controlled[T]:
    """Integrate until the estimated error of u is below the tolerance at all times.

    In motion faster than V an error along the way is a shift in time, and
    measured as such: an error e at the velocity v counts as e/√(1 + |v|²/V²),
    the distance of the solutions as curves in (V t, u).  With V = 1 m/s and a
    tolerance of 1e-4 m, a snap is then right to 1e-4 s and 1e-4 m; at equal
    times no number of digits would do where v is 1e7 m/s.

    Parameters
    ----------
    run : callable
        ``run(tolerance)`` integrates; the errors of its steps may add up to its
        argument.
    residual : callable
        R(u, v, t), for the growth of errors.
    tolerance : float
    speed : float
        V; infinite for errors at equal times.
    max_passes : int

    Returns
    -------
    Controlled
        Its error is above the tolerance only if all passes did not suffice.
    """
    allowed = tolerance
    for passes in range(1, max_passes + 1):
        path = run(allowed)
        slowness = [1.0 / stretch(path(t)[1], speed) for t in path.knots]
        error = float((estimated(residual, path) * slowness).max())
        if error <= tolerance or passes == max_passes:
            break
        allowed *= 0.5 * tolerance / error
    return Controlled(path, error, passes)
