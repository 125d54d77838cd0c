"""A rigid cylinder that turns about its axis and may be moved."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Roller:
    """Geometry of a roller.

    Attributes
    ----------
    name : str
    radius : float
        r (m).
    centre : tuple of float
        A point c of the axis (m).
    axis : tuple of float
        Direction a, any length, right-handed: a positive surface speed moves
        the top of a roller along y towards +x.
    """

    name: str
    radius: float
    centre: tuple[float, float, float]
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)

    @cached_property
    def unit_axis(self) -> Array:
        """a, shape (3,)."""
        a = np.asarray(self.axis, dtype=float)
        return a / np.linalg.norm(a)

    @cached_property
    def across(self) -> Array:
        """I − a aᵀ, shape (3, 3)."""
        return np.eye(3) - np.outer(self.unit_axis, self.unit_axis)

    @cached_property
    def turning(self) -> Array:
        """Matrix of a × ·, shape (3, 3)."""
        x, y, z = self.unit_axis
        return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])

    def gap(self, x: Any, centre: Any) -> tuple[Any, Any]:
        """Gap h and unit normal n at positions x.

        Parameters
        ----------
        x : array or Series, shape (3, points)
        centre : array or Series, shape (3,)

        Returns
        -------
        gap : shape (points,)
        normal : shape (3, points)
        """
        d = np.einsum("ij,j...->i...", self.across, x - centre[:, None])
        distance = np.sqrt(np.einsum("i...,i...->...", d, d))
        return distance - self.radius, d / distance

    def surface_velocity(self, normal: Any, speed: Any, centre_velocity: Any) -> Any:
        """V = ċ + Ω r a × n, shape (3, points), for a surface speed Ω r."""
        return np.einsum("ij,j...->i...", self.turning, normal) * speed + centre_velocity[:, None]
