"""A rigid roller that turns about its axis and may be moved; cylindrical, tapered or crowned.

Seen in its own frame: two directions across the axis, and the axis.  A profile
R(s) = r + Σ c_k s^k along the axis, s measured from the centre, gives the surface

    ρ = R(s),  gap h = (ρ − R)/w,  normal (e_ρ − R' a)/w,  meridian (R' e_ρ + a)/w

with w = √(1 + R'²): exact normal, and a gap that is exact to first order in the
distance (for cylinders at any distance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """Where points are, as a roller sees them; arrays or series.

    Attributes
    ----------
    gap : shape (points,)
        h (m).
    radial : shape (2, points)
        Unit vector e_ρ away from the axis, in the roller's frame.
    slope : shape (points,), or None
        R' of the profile, ``None`` for a cylinder.
    ratio : shape (points,), or None
        R / r, ``None`` for a cylinder.
    """

    gap: Any
    radial: Any
    slope: Any = None
    ratio: Any = None


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
    crown : tuple of float
        c_1, c_2, … (m, per metre, …): the radius at s is r + c_1 s + c_2 s² + …
    """

    name: str
    radius: float
    centre: tuple[float, float, float]
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    crown: tuple[float, ...] = ()

    @cached_property
    def unit_axis(self) -> Array:
        """a, shape (3,)."""
        a = np.asarray(self.axis, dtype=float)
        return a / np.linalg.norm(a)

    @cached_property
    def frame(self) -> Array:
        """Rows e_1, e_2, a: right-handed, e_1 as near to z as it can; shape (3, 3)."""
        a = self.unit_axis
        up = np.eye(3)[2] if abs(a[2]) < 0.9 else np.eye(3)[0]
        first = up - (up @ a) * a
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(a, first), a])

    def radius_at(self, s: Any) -> Any:
        """R(s) (m)."""
        return polynomial((self.radius, *self.crown), s)

    def slope_at(self, s: Any) -> Any:
        """R'(s)."""
        return polynomial([k * c for k, c in enumerate(self.crown, start=1)], s)

    def seen(self, y: Any) -> Place:
        """Gap and directions of points.

        Parameters
        ----------
        y : array or Series, shape (2 or 3, points)
            Position relative to the centre in the roller's frame; the third is needed with
            a crown.
        """
        across = y[:2] if self.crown else y
        distance = np.sqrt(np.einsum("i...,i...->...", across, across))
        if not self.crown:
            return Place(distance - self.radius, across / distance)
        radius, slope = self.radius_at(y[2]), self.slope_at(y[2])
        gap = (distance - radius) / np.sqrt(slope * slope + 1.0)
        return Place(gap, across / distance, slope, radius / self.radius)

    @property
    def rows(self) -> int:
        """How many directions of its frame the gap depends on."""
        return 3 if self.crown else 2

    def normal(self, place: Place) -> Any:
        """Unit normal in the frame, shape (rows, points)."""
        if place.slope is None:
            return place.radial
        inverse = 1.0 / np.sqrt(place.slope * place.slope + 1.0)
        radial = place.radial * inverse
        return np.stack([radial[0], radial[1], place.slope * inverse * -1.0])

    def tangents(self, place: Place, directions: int) -> Any:
        """Unit tangents of the surface in the frame: of turning, and the meridian.

        Parameters
        ----------
        place : Place
        directions : int
            2 for the plane across the axis, where turning is all there is; 3 in space.

        Returns
        -------
        array or Series, shape (directions − 1, directions, points)
        """
        first, second = place.radial[0], place.radial[1]
        if directions == 2:
            return np.stack([second * -1.0, first])[None]
        zero, one = np.zeros(first.shape), np.ones(first.shape)
        turning = np.stack([second * -1.0, first, zero])
        if place.slope is None:
            return np.stack([turning, np.stack([zero, zero, one])])
        inverse = 1.0 / np.sqrt(place.slope * place.slope + 1.0)
        outwards = place.radial * (place.slope * inverse)
        return np.stack([turning, np.stack([outwards[0], outwards[1], inverse])])


def polynomial(coefficients: Sequence[float], s: Any) -> Any:
    """Σ coefficients_k s^k of an array or series, by Horner's rule."""
    value = s * 0.0 + coefficients[-1]
    for c in coefficients[-2::-1]:
        value = value * s + c
    return value
