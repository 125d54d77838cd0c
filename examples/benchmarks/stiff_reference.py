"""The pulled sliding point to fourteen digits, without anything of the series wing.

With s = tanh w the spring force and v = ε sinh w, friction is met identically, and

    w' = cosh² w (U' − ε sinh w)

has no corner: between sticking and sliding w changes by asinh(1/ε).  It is solved piece by
piece by Chebyshev collocation of degree 24, each piece short enough that the coefficients
fall to round-off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BarycentricInterpolator

Array = NDArray[np.float64]

DEGREE = 24

SMALLEST = 1e-13
"""Size of the last coefficients beside the largest w."""


def pull(t: Array) -> Array:
    """Return U, the place of the spring's other end: ∫ 1 + ½ sin 2t."""
    return t + 0.25 * (1.0 - np.cos(2.0 * t))


def pull_speed(t: Array) -> Array:
    """Return U'."""
    return 1.0 + 0.5 * np.sin(2.0 * t)


class Reference:
    """The solution u(t) for t in [0, end].

    Parameters
    ----------
    epsilon, end : float

    Attributes
    ----------
    knots : list of float
        Ends of the pieces.
    """

    def __init__(self, epsilon: float, end: float) -> None:
        self.epsilon, self.knots, w = epsilon, [0.0], 0.0
        self.pieces: list[BarycentricInterpolator] = []
        self.nodes = -np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
        self.slopes = _slopes(self.nodes)
        self.coefficients = np.linalg.inv(np.polynomial.chebyshev.chebvander(self.nodes, DEGREE))
        t, h = 0.0, 0.1
        while t < end:
            h = min(h, end - t) if end - t - h > 1e-9 else end - t
            found = self._piece(t, h, w)
            tail = np.inf if found is None else self._tail(found)
            if found is None or tail > SMALLEST:
                h *= 0.6
                continue
            times = t + 0.5 * h * (self.nodes + 1.0)
            self.pieces.append(BarycentricInterpolator(times, found))
            t, w = t + h, float(found[-1])
            self.knots.append(t)
            h *= 1.6 if tail < 0.01 * SMALLEST else 1.1

    def __call__(self, t: ArrayLike) -> Array:
        """Return the state at times ``t``."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        place = np.clip(np.searchsorted(self.knots, times) - 1, 0, len(self.pieces) - 1)
        w = np.empty_like(times)
        for i in np.unique(place):
            w[place == i] = self.pieces[i](times[place == i])
        return pull(times) - np.tanh(w)

    def _tail(self, w: Array) -> float:
        return float(np.abs(self.coefficients @ w)[-3:].max() / max(1.0, np.abs(w).max()))

    def _piece(self, t: float, h: float, start: float) -> Array | None:
        """Return w in the nodes from t to t + h, by Newton's method; None without convergence."""
        times = t + 0.5 * h * (self.nodes + 1.0)
        D, epsilon = self.slopes * 2.0 / h, self.epsilon
        w = np.full(len(times), start)
        for _ in range(60):
            with np.errstate(all="ignore"):
                steep, dw = np.cosh(w) ** -2, D @ w
                wrong = dw * steep - pull_speed(times) + epsilon * np.sinh(w)
                own = epsilon * np.cosh(w) - 2.0 * np.tanh(w) * steep * dw
                tangent = (D * steep[:, None] + np.diag(own))[1:, 1:]
            if not np.isfinite(tangent).all():
                return None
            change = np.linalg.solve(tangent, -wrong[1:])
            w[1:] += change * min(1.0, 1.0 / np.abs(change).max())
            if np.abs(change).max() < 1e-12:
                return w
        return None


def _slopes(nodes: Array) -> Array:
    """Return the differentiation matrix of the polynomial through Chebyshev's nodes."""
    signs = (-1.0) ** np.arange(len(nodes))
    signs[[0, -1]] *= 2.0
    slopes = np.outer(signs, 1.0 / signs) / (nodes[:, None] - nodes + np.eye(len(nodes)))
    return np.asarray(slopes - np.diag(slopes.sum(axis=1)))
