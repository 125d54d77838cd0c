"""Radau's points: the polynomial through them, its slopes and its error.

Source: Hairer & Wanner, *Solving ODEs II* (1996), §IV.5; Berrut & Trefethen, *Barycentric
Lagrange interpolation*, SIAM Review 46 (2004), for its evaluation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi

Array = NDArray[np.float64]

TINY = float(np.finfo(float).tiny)

SLOWEST = 0.8
"""Ratio of coefficients, near a kink, beyond which a polynomial tells nothing of its error."""


class Rule:
    """Radau's s points with 0 as nodes of a polynomial on [0, 1].

    Parameters
    ----------
    stages : int
        s ≥ 2.

    Attributes
    ----------
    points : ndarray, shape (s,)
        0 < c_1 < … < c_s = 1.
    derivative : ndarray, shape (s, s)
        Slopes in the points of the polynomial with given values there, and 0 at 0.
    last : ndarray, shape (3, s)
        Makes its three highest Legendre coefficients.
    """

    def __init__(self, stages: int) -> None:
        self.points = np.append(0.5 * (roots_jacobi(stages - 1, 1, 0)[0] + 1.0), 1.0)
        self.nodes = np.append(0.0, self.points)
        apart = self.nodes[:, None] - self.nodes + np.eye(stages + 1)
        self.weights = 1.0 / apart.prod(axis=1)
        slopes = self.weights / self.weights[:, None] / apart
        np.fill_diagonal(slopes, 0.0)
        np.fill_diagonal(slopes, -slopes.sum(axis=1))
        self.derivative = slopes[1:, 1:]
        legendre = np.polynomial.legendre.legvander(2.0 * self.nodes - 1.0, stages)
        self.last = np.linalg.inv(legendre)[-3:, 1:]

    def error(self, changes: Array) -> float:
        """Of the polynomial: its last coefficient, and as many as a slow decay would add.

        The last may vanish by chance: it counts at least what the decay of the two before
        lets expect.
        """
        first, before, last = np.abs(self.last @ changes.T)
        last = np.maximum(last, before * np.minimum(1.0, before / np.maximum(first, TINY)))
        ratio = np.minimum(last / np.maximum(before, TINY), SLOWEST)
        return float((last / (1.0 - ratio)).max())

    def interpolating(self, x: Array) -> Array:
        """Matrix, shape (len(x), s), from values in the points to those at x."""
        apart = x[:, None] - self.nodes
        found = (apart == 0.0).astype(float)
        between = ~found.any(axis=1)
        parts = self.weights / apart[between]
        found[between] = parts / parts.sum(axis=1, keepdims=True)
        return found[:, 1:]


@dataclass(frozen=True)
class Piece:
    """The solution on one step.

    Attributes
    ----------
    rule : Rule
    start, end : float
        Times.
    u : ndarray, shape (n,)
        State at the start.
    changes : ndarray, shape (n, s)
        From there to the points.
    error : float
        Estimated, of u within the step.
    branches : int
        Tangents that it took.
    """

    rule: Rule
    start: float
    end: float
    u: Array
    changes: Array
    error: float = 0.0
    branches: int = 0
    passing: float = 0.0

    def change(self, x: Array) -> Array:
        """Change of u, shape (n, len(x)), at fractions x of the step."""
        return self.changes @ self.rule.interpolating(x).T

    @property
    def rates(self) -> Array:
        """Velocities in the points, shape (n, s)."""
        return self.changes @ self.rule.derivative.T / (self.end - self.start)

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""
        x = np.array([(t - self.start) / (self.end - self.start)])
        far = self.rule.interpolating(x)
        still = 1.0 - far.sum()  # what 0 weighs
        v = self.rates @ far.T + still * self._first_rate()
        return self.u + self.change(x)[:, 0], v[:, 0]

    def _first_rate(self) -> Array:
        slopes = self.rule.weights[1:] / self.rule.weights[0] / -self.rule.points
        return (self.changes @ slopes / (self.end - self.start))[:, None]
