"""Rollers as solids: they have a radius everywhere, and stand clear of each other."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import hypot
from typing import TYPE_CHECKING

from anmstrip.scene.errors import Mistake

if TYPE_CHECKING:
    from anmstrip.scene.tables import RollerSpec, StripSpec

Vector = tuple[float, ...]

GENTLE = {
    "crown": "crown = [0.0, -{:g}]",
    "taper": "taper = {:g}",
    "sides": "sides = {{ taper = {:g}, flat = 0.5, rounding = 0.05 }}",
}
"""Profiles, with one to type instead."""

PARALLEL = 0.99
"""Least cosine of the angle between axes that count as parallel."""


def profiles(strip: StripSpec, rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """Yield profiles without a radius somewhere across the strip."""
    half = 0.5 * (strip.width or 0.0)
    for roller in rollers:
        places = [(2.0 * i / 32 - 1.0) * half - roller.centre[1] for i in range(33)]
        least = min(float(roller.shape.radius_at(s)) for s in places)
        if not least > 0.0:
            key, value = next(iter(roller.profile.items()))
            expected = f"a radius above 0 all across the strip; it falls to {least:.3g} (m)"
            hint = GENTLE[key].format(1e-3 * roller.radius)
            yield Mistake("", f"rollers.{roller.name}.{key}", value, expected, hint)


def apart(rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """Yield parallel rollers that overlap: axes closer than the sum of the radii."""
    for first, second in combinations(rollers, 2):
        least = first.radius + second.radius
        if abs(_product(_unit(first.axis), _unit(second.axis))) < PARALLEL:
            continue
        offset = _offset(first, second)
        distance = hypot(*offset)
        if distance < least * (1.0 - 1e-9):
            expected = (
                f"at least {least:g} m, the sum of both radii, between the axes of {first.name} "
                f"and {second.name}, which overlap; now {distance:.4g} (m)"
            )
            key, hint = f"rollers.{second.name}.centre", _further(second, offset, least)
            yield Mistake("", key, list(second.centre), expected, hint)


def _offset(first: RollerSpec, second: RollerSpec) -> Vector:
    """From the axis of the first to the centre of the second, square to the axis (m)."""
    axis = _unit(first.axis)
    way = tuple(b - a for a, b in zip(first.centre, second.centre, strict=True))
    along = _product(way, axis)
    return tuple(w - along * a for w, a in zip(way, axis, strict=True))


def _further(roller: RollerSpec, offset: Vector, least: float) -> str:
    """What to type to have a roller pushed out of another, and a little more."""
    distance = hypot(*offset)
    direction = (0.0, 0.0, 1.0) if distance == 0.0 else tuple(o / distance for o in offset)
    push = 1.01 * least - distance
    place = [f"{c + push * d:.4g}" for c, d in zip(roller.centre, direction, strict=True)]
    return f"centre = [{', '.join(place)}], or smaller radii"


def _unit(vector: Vector) -> Vector:
    length = hypot(*vector)
    return tuple(component / length for component in vector)


def _product(a: Vector, b: Vector) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))
