"""Rigid rollers that turn about their axis and may be moved; cylindrical, tapered or crowned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Sides:
    """Conical sides, the same on both: numbers, or one for each point.

    Attributes
    ----------
    slope : float, or ndarray of shape (points,)
        α, by which the radius falls for each metre.
    begin : float, or ndarray
        b (m): half the length of the cylinder between them.
    rounding : float, or ndarray
        w (m).
    """

    slope: Any
    begin: Any
    rounding: Any

    def fall(self, s: Any) -> Any:
        """By how much the radius is smaller at s than at the centre (m)."""
        here = self._distance(s - self.begin) + self._distance(s + self.begin)
        return (here - 2.0 * self._distance(self.begin)) * (0.5 * self.slope)

    def rate(self, s: Any) -> Any:
        """Derivative of it."""
        ends = (s - self.begin, s + self.begin)
        return sum(x / self._distance(x) for x in ends) * (0.5 * self.slope)

    def _distance(self, x: Any) -> Any:
        return np.sqrt(x * x + self.rounding * self.rounding)


NO_SIDES = Sides(0.0, 0.0, 1.0)


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


class Revolved:
    """A surface of revolution, or several of them with one for each point.

    Attributes
    ----------
    radius : float, or ndarray of shape (points,)
        r (m).
    crown : sequence of float, or of ndarray
        c_1, c_2, …
    sides : Sides or None
    """

    radius: Any
    crown: Sequence[Any]
    sides: Sides | None

    @property
    def is_cylinder(self) -> bool:
        """Whether the radius is the same everywhere."""
        return self.sides is None and not self.crown

    def radius_at(self, s: Any) -> Any:
        """R(s) (m)."""
        radius = polynomial((self.radius, *self.crown), s)
        return radius if self.sides is None else radius - self.sides.fall(s)

    def slope_at(self, s: Any) -> Any:
        """R'(s)."""
        slope = polynomial([k * c for k, c in enumerate(self.crown, start=1)] or [0.0], s)
        return slope if self.sides is None else slope - self.sides.rate(s)

    def seen(self, y: Any) -> Place:
        """Gap and directions of points.

        Parameters
        ----------
        y : array or Series, shape (2 or 3, points)
            Position relative to the centre in the roller's frame; only a cylinder does without
            the third.
        """
        across = y if self.is_cylinder else y[:2]
        distance = np.sqrt(np.einsum("i...,i...->...", across, across))
        if self.is_cylinder:
            return Place(distance - self.radius, across / distance)
        radius, slope = self.radius_at(y[2]), self.slope_at(y[2])
        gap = (distance - radius) / np.sqrt(slope * slope + 1.0)
        return Place(gap, across / distance, slope, radius / self.radius)

    @property
    def rows(self) -> int:
        """How many directions of its frame the gap depends on."""
        return 2 if self.is_cylinder else 3

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


@dataclass(frozen=True)
class Roller(Revolved):
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
        c_1, c_2, … (1, per metre, …): the radius at s is r + c_1 s + c_2 s² + …
    sides : Sides or None
        Conical sides, by which it is smaller.
    """

    name: str
    radius: float
    centre: tuple[float, float, float]
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    crown: tuple[float, ...] = ()
    sides: Sides | None = None

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

    @property
    def members(self) -> tuple[Roller, ...]:
        """Itself: it stands for all rollers that are looked at."""
        return (self,)

    def of(self, values: Sequence[Any]) -> Any:
        """What belongs to a point, of one value for each roller."""
        return values[0]

    def restricted(self, points: Index) -> Roller:
        """The same for some of the points."""
        return self


@dataclass(frozen=True)
class Rollers(Revolved):
    """Several rollers at once: every point is seen by one of them.

    What is computed for one roller is computed for all in the same operations.

    Attributes
    ----------
    members : tuple of Roller
    which : ndarray of int, shape (points,)
        Number of the roller that sees each point.
    """

    members: tuple[Roller, ...]
    which: Index

    @cached_property
    def radius(self) -> Array:
        """r of each point's roller, shape (points,)."""
        return np.asarray(self.of([roller.radius for roller in self.members]))

    @cached_property
    def crown(self) -> Sequence[Array]:  # type: ignore[override]
        """Coefficients of each point's roller, zero where it has fewer."""
        most = max(len(roller.crown) for roller in self.members)
        padded = [(*r.crown, *(most - len(r.crown)) * (0.0,)) for r in self.members]
        return [np.asarray(self.of(c)) for c in zip(*padded, strict=True)]

    @cached_property
    def sides(self) -> Sides | None:  # type: ignore[override]
        """Of each point's roller, level where it has none."""
        if all(roller.sides is None for roller in self.members):
            return None
        given = [astuple(roller.sides or NO_SIDES) for roller in self.members]
        return Sides(*(np.asarray(self.of(values)) for values in zip(*given, strict=True)))

    @cached_property
    def frame(self) -> Array:
        """Frame of each point's roller, shape (3, 3, points)."""
        return np.asarray(self.of([roller.frame for roller in self.members]))

    def of(self, values: Sequence[Any]) -> Any:
        """What belongs to each point, of one value for each roller, (..., points)."""
        return np.stack(list(values), axis=-1)[..., self.which]

    def restricted(self, points: Index) -> Rollers:
        """The same for some of the points."""
        return Rollers(self.members, self.which[points])


def together(rollers: Sequence[Roller], points: int) -> Roller | Rollers:
    """Rollers that each look at all points: first all of them for the first roller, then…"""
    if len(rollers) == 1:
        return rollers[0]
    return Rollers(tuple(rollers), np.repeat(np.arange(len(rollers)), points))


def polynomial(coefficients: Sequence[float], s: Any) -> Any:
    """Σ coefficients_k s^k of an array or series, by Horner's rule."""
    value = s * 0.0 + coefficients[-1]
    for c in coefficients[-2::-1]:
        value = value * s + c
    return value
