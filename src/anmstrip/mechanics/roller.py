"""Rigid rollers that turn about their axis and may be moved; cylindrical, tapered or crowned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from itertools import zip_longest
from typing import Any

import numpy as np

from anmstrip.arrays import Array, Index


@dataclass(frozen=True)
class Sides:
    """Conical sides, the same on both; numbers, or arrays (points,)."""

    slope: Any  # α, by which the radius falls for each metre
    begin: Any  # b (m), half the length of the cylinder between them
    rounding: Any  # w (m), over which the edge is rounded

    def fall(self, s: Any) -> Any:
        """α/2 (d(s − b) + d(s + b) − 2 d(b)), d(x) = √(x² + w²): how far the radius falls (m)."""
        here = self._distance(s - self.begin) + self._distance(s + self.begin)
        return (here - 2.0 * self._distance(self.begin)) * (0.5 * self.slope)

    def rate(self, s: Any) -> Any:
        """Derivative of :meth:`fall`."""
        ends = (s - self.begin, s + self.begin)
        return sum(x / self._distance(x) for x in ends) * (0.5 * self.slope)

    def _distance(self, x: Any) -> Any:
        return np.sqrt(x * x + self.rounding * self.rounding)


NO_SIDES = Sides(0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Projection:
    """Points seen from a roller's surface; arrays or series."""

    gap: Any  # h (m), shape (points,)
    across: Any  # vector from the axis in the roller's frame, (2, points)
    distance: Any  # ρ, its length (m), (points,)
    slope: Any = None  # R' of the profile, (points,); None for a cylinder
    ratio: Any = None  # R / r, (points,); None for a cylinder

    @property
    def radial(self) -> Any:
        """Unit vector e_ρ away from the axis in the roller's frame, (2, points)."""
        return self.across / self.distance


@dataclass(frozen=True)
class Roller:
    """A roller, or several of them at once with one for each point.

    Its surface is one of revolution about the line c + s a, with the radius
    R(s) = r + c_1 s + c_2 s² + … less what conical sides take off.  Of several rollers,
    made by :func:`combine`, all numbers are arrays over trailing points, so that the same
    operations serve them all.
    """

    name: str
    radius: Any  # r (m)
    centre: Any  # c (m), shape (3,)
    axis: Any = (0.0, 1.0, 0.0)  # a, any length; turning about y moves the top towards +x
    crown: Sequence[Any] = ()  # c_1, c_2, … (1, 1/m, …)
    sides: Sides | None = None
    half: Any = 0.0  # distance (m) from the face of the strip that touches it to the mid-surface
    sense: Any = 1.0  # of a positive surface speed: 1 right-handed about the axis, −1 against it
    several: tuple[Roller, ...] = ()
    which: Index | None = None  # number of each point's roller among several, (points,)

    @property
    def members(self) -> tuple[Roller, ...]:
        """Several rollers, or this one."""
        return self.several or (self,)

    def of(self, values: Sequence[Any]) -> Any:
        """Values at the points, (..., points), from one for each roller; one alone as it is."""
        return values[0] if self.which is None else at_points(values, self.which)

    def seen_by(self, points: int) -> Index:
        """Return the number of the roller that each of so many points sees, (points,)."""
        return np.zeros(points, dtype=np.int64) if self.which is None else self.which

    def restricted(self, points: Index) -> Roller:
        """The same for some of the points."""
        return self if self.which is None else combine(self.several, self.which[points])

    @cached_property
    def unit_axis(self) -> Array:
        """a / |a|, shape (3[, points])."""
        a = np.asarray(self.axis, dtype=float)
        return a / np.linalg.norm(a, axis=0)

    @cached_property
    def frame(self) -> Array:
        """Rows e_1, e_2, a: right-handed, e_1 as near to z as it can; (3, 3[, points])."""
        if self.which is not None:
            return np.asarray(self.of([roller.frame for roller in self.several]))
        a = self.unit_axis
        up = np.eye(3)[2] if abs(a[2]) < 0.9 else np.eye(3)[0]
        first = up - (up @ a) * a
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(a, first), a])

    @cached_property
    def cross_matrix(self) -> Array:
        """Matrix of the cross product with the axis, a × v, of one roller; shape (3, 3)."""
        first, second, _ = self.frame
        return np.outer(second, first) - np.outer(first, second)

    @property
    def is_cylinder(self) -> bool:
        """Whether the radius is the same everywhere."""
        return self.sides is None and not self.crown

    @property
    def is_across(self) -> bool:
        """Whether it is a cylinder along y, of which every section looks the same."""
        return self.is_cylinder and not (self.axis[0] or self.axis[2])

    @property
    def rows(self) -> int:
        """Number of directions of the frame that the gap depends on."""
        return 2 if self.is_cylinder else 3

    def radius_at(self, s: Any) -> Any:
        """R(s) (m)."""
        radius = polynomial((self.radius, *self.crown), s)
        return radius if self.sides is None else radius - self.sides.fall(s)

    def slope_at(self, s: Any) -> Any:
        """R'(s)."""
        slope = polynomial([k * c for k, c in enumerate(self.crown, start=1)] or [0.0], s)
        return slope if self.sides is None else slope - self.sides.rate(s)

    def section(self, y: Any) -> tuple[Array, Array]:
        """Return centre and radius (m) in planes at y, the latter to the middle of the strip.

        Shapes (2, planes), of x and z, and (planes,).
        """
        s = (y - self.centre[1]) / self.unit_axis[1]
        point = np.asarray(self.centre)[:, None] + self.unit_axis[:, None] * s
        return point[[0, 2]], self.radius_at(s) + self.half

    def project(self, y: Any) -> Projection:
        """Gap and directions of points.

        h = (ρ − R(s)) / √(1 + R'²) − t/2, exact for cylinders and cones, of first order else; the
        half thickness t/2 is left out where rollers touch the mid-surface.

        Parameters
        ----------
        y : array or Series, shape (2 or 3, points)
            Position relative to the centre in the roller's frame; only a cylinder does without
            the third.
        """
        across = y if self.is_cylinder else y[:2]
        distance = np.sqrt(np.einsum("i...,i...->...", across, across))
        if self.is_cylinder:
            return Projection(distance - (self.radius + self.half), across, distance)
        radius, slope = self.radius_at(y[2]), self.slope_at(y[2])
        gap = (distance - radius) / np.sqrt(slope * slope + 1.0) - self.half
        return Projection(gap, across, distance, slope, radius / self.radius)

    def normal(self, at: Projection, size: Any = 1.0) -> Any:
        """Unit normal in the frame, (e_ρ, −R') / √(1 + R'²), times a size; shape (rows, points)."""
        if at.slope is None:
            return at.across * (size / at.distance)
        share = size / np.sqrt(at.slope * at.slope + 1.0)
        radial = at.across * (share / at.distance)
        return np.stack([radial[0], radial[1], at.slope * share * -1.0])

    def tangents(self, at: Projection, directions: int) -> Any:
        """Unit tangents of the surface in the frame: of turning, and the meridian.

        Parameters
        ----------
        at : Projection
        directions : int
            2 for the plane across the axis, where turning is all there is; 3 in space.

        Returns
        -------
        array or Series, shape (directions − 1, directions, points)
        """
        radial = at.radial
        first, second = radial[0], radial[1]
        if directions == 2:
            return np.stack([second * -1.0, first])[None]
        zero, one = np.zeros(first.shape), np.ones(first.shape)
        turning = np.stack([second * -1.0, first, zero])
        if at.slope is None:
            return np.stack([turning, np.stack([zero, zero, one])])
        inverse = 1.0 / np.sqrt(at.slope * at.slope + 1.0)
        outwards = radial * (at.slope * inverse)
        return np.stack([turning, np.stack([outwards[0], outwards[1], inverse])])


def combine(rollers: Sequence[Roller], which: Index) -> Roller:
    """Several rollers as one, which has arrays over the points for numbers.

    Parameters
    ----------
    rollers : sequence of Roller
    which : ndarray of int, shape (points,)
        Number of the roller that sees each point; one roller alone sees all of them.
    """
    return rollers[0] if len(rollers) == 1 else SeveralRollers(rollers, which)


def _of_all(field: str) -> Any:
    """Numbers of all points' rollers, made when they are first asked for."""
    return cached_property(lambda self: self.of([getattr(r, field) for r in self.several]))


class SeveralRollers(Roller):
    """Several rollers as :func:`combine` makes them; numbers are made if asked for."""

    def __init__(self, rollers: Sequence[Roller], which: Index) -> None:
        name = " and ".join(roller.name for roller in rollers)
        vars(self).update(name=name, several=tuple(rollers), which=which)

    radius, centre, axis, half, sense = map(_of_all, ("radius", "centre", "axis", "half", "sense"))

    @cached_property
    def crown(self) -> tuple[Any, ...]:
        """Coefficients c_1, c_2, … of all points' rollers, 0 where one has fewer."""
        crowns = zip_longest(*(roller.crown for roller in self.several), fillvalue=0.0)
        return tuple(self.of(each) for each in crowns)

    @cached_property
    def sides(self) -> Sides | None:
        """Conical sides of all points' rollers, if any of them has some."""
        if not any(roller.sides for roller in self.several):
            return None
        sides = (astuple(roller.sides or NO_SIDES) for roller in self.several)
        return Sides(*map(self.of, zip(*sides, strict=True)))


def placed(rollers: Sequence[Roller], controls: Mapping[str, Any]) -> list[Roller]:
    """Return rollers where values of the controls have them."""
    return [replace(r, centre=tuple(controls[f"rollers.{r.name}.centre"])) for r in rollers]


def at_points(values: Sequence[Any], which: Index) -> Any:
    """Value of each point's roller, (..., points), from one for each roller."""
    return np.stack(list(values), axis=-1)[..., which]


def polynomial(coefficients: Sequence[float], s: Any) -> Any:
    """Σ coefficients_k s^k of an array or series, by Horner's rule."""
    value = s * 0.0 + coefficients[-1]
    for c in coefficients[-2::-1]:
        value = value * s + c
    return value
