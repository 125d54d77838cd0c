"""Statics of strips over rolls in closed form, apart from the program that is tested."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import asin, cos, cosh, exp, log, pi, sin, sinh, sqrt, tan

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fsolve


@dataclass(frozen=True)
class Circle:
    """A roll in the plane of the strip."""

    centre: complex  # x + i z (m)
    radius: float  # m
    sense: int  # +1: the strip turns to the right around it ("over"), −1: to the left


@dataclass(frozen=True)
class Belt:
    """A string around circles: straight runs, turns between them."""

    headings: tuple[float, ...]  # of the runs (rad), 0 along +x, anticlockwise
    turns: tuple[float, ...]  # angles of wrap (rad), at least 0
    runs: tuple[float, ...]  # lengths of the runs (m)


def belt(entry: complex, circles: Iterable[Circle], exit: complex) -> Belt:
    """Go from the entry around the circles to the exit, along common tangents.

    A line of heading t that has circles of signed radii ρ, ρ' at distance d = c' − c on its right
    (ρ > 0) or left has |d| sin(arg d − t) = ρ − ρ'.
    """
    given = list(circles)
    points = [entry, *(c.centre for c in given), exit]
    radii = [0.0, *(c.sense * c.radius for c in given), 0.0]
    headings, runs = [], []
    for i in range(len(points) - 1):
        d, across = points[i + 1] - points[i], radii[i] - radii[i + 1]
        headings.append(float(np.angle(d)) - asin(across / abs(d)))
        runs.append(sqrt(abs(d) ** 2 - across**2))
    turns = []
    for i, circle in enumerate(given):
        turn = (circle.sense * (headings[i] - headings[i + 1]) + 1e-9) % (2.0 * pi) - 1e-9
        turns.append(max(turn, 0.0))
    return Belt(tuple(headings), tuple(turns), tuple(runs))


def lift_off(tension: float, bending: float, radius: float) -> float:
    """Angle by which a bent strip leaves a roll before its straight part would touch (rad)."""
    return 2.0 * asin(min(1.0, sqrt(bending / tension) / (2.0 * radius)))


def bent_belt(
    entry: complex, circles: Iterable[Circle], exit: complex, tension: float, bending: float
) -> Belt:
    """Straight parts of a strip that resists bending, D (N m), under one tension (N/m).

    They are those of a string around larger circles.  Where the strip lies on an arc, the moment
    D/R at its end sets the straight part off by D/TR − D/2TR; where it touches along a line, it
    passes λ tan(θ/2) below the corner of its straight parts, λ = √(D/T).
    """
    given = list(circles)
    length = sqrt(bending / tension)
    larger = given
    for _ in range(50):
        path = belt(entry, larger, exit)
        larger = []
        for circle, turn in zip(given, path.turns, strict=True):
            radius = circle.radius
            if turn > 2.0 * lift_off(tension, bending, radius):
                radius += bending / (2.0 * tension * radius)
            else:
                radius = (radius + length * tan(0.5 * turn)) * cos(0.5 * turn)
            larger.append(Circle(circle.centre, radius, circle.sense))
    return path


def normal_force(tension: float, turn: float, bending: float, radius: float) -> float:
    """Sum of the pressure of a strip on a roll without friction (N/m).

    The arc bears T − D/2R² per angle, both its ends a line load T sin θ_L; a strip that touches
    along a line bears the change of its direction, 2 T sin(θ/2).
    """
    angle = lift_off(tension, bending, radius)
    if turn <= 2.0 * angle:
        return 2.0 * tension * sin(0.5 * turn)
    arc = turn - 2.0 * angle
    return (tension - bending / (2.0 * radius**2)) * arc + 2.0 * tension * sin(angle)


def capstan(low: float, friction: float, turn: float, bending: float, radius: float) -> float:
    """Tension on the tight side of a roll in full slip (N/m), from that on the slack side.

    ln(T₂/T₁) = f θ − (1 + f²) D/2R² (1/T₁ − 1/T₂).
    """
    high = low * exp(friction * turn)
    for _ in range(50):
        less = (1.0 + friction**2) * bending / (2.0 * radius**2) * (1.0 / low - 1.0 / high)
        high = low * exp(friction * turn - less)
    return high


@dataclass(frozen=True)
class Catenary:
    """z = z₀ + a cosh((x − x₀)/a), on which the tension is the weight per length times z − z₀."""

    directrix: float  # z₀ (m)
    parameter: float  # a (m)
    middle: float  # x₀ (m)

    @property
    def lowest(self) -> float:
        """Height of the lowest point (m)."""
        return self.directrix + self.parameter


def catenary(first: Circle, second: Circle, directrix: float) -> Catenary:
    """Hang a string between two circles that it goes over, its directrix being known."""

    def misses(unknowns: NDArray[np.float64]) -> list[float]:
        a, x0, *headings = unknowns
        missed = []
        for circle, t in zip((first, second), headings, strict=True):
            point = circle.centre + circle.radius * complex(-sin(t), cos(t))
            missed.append(sinh((point.real - x0) / a) - tan(t))
            missed.append(directrix + a * cosh((point.real - x0) / a) - point.imag)
        return missed

    d = second.centre - first.centre
    height = 0.5 * (first.centre + second.centre).imag - directrix
    guess = [height, 0.5 * (first.centre + second.centre).real, -0.5 * abs(d) / height, 0.1]
    a, x0, *_ = fsolve(misses, guess, xtol=1e-12)
    return Catenary(directrix, float(a), float(x0))


def beam_on_supports(
    span: tuple[float, float], supports: list[float], load: float, bending: float, tension: float
) -> list[float]:
    """Reactions of a beam in tension on supports that only push up (N/m).

    The beam, D w'''' − T w'' = −q, is pinned at the left and free at the right, where the pull T
    stays level; cubic elements, of which the supports are nodes.

    Returns
    -------
    list of float
        Of the pin, then of the supports.
    """
    begin, end = span
    count = round((end - begin) / 0.01)
    x, h = np.linspace(begin, end, count + 1), (end - begin) / count
    bend = np.array(
        [
            [12.0, 6 * h, -12.0, 6 * h],
            [6 * h, 4 * h * h, -6 * h, 2 * h * h],
            [-12.0, -6 * h, 12.0, -6 * h],
            [6 * h, 2 * h * h, -6 * h, 4 * h * h],
        ]
    )
    pull = np.array(
        [
            [36.0, 3 * h, -36.0, 3 * h],
            [3 * h, 4 * h * h, -3 * h, -h * h],
            [-36.0, -3 * h, 36.0, -3 * h],
            [3 * h, -h * h, -3 * h, 4 * h * h],
        ]
    )
    matrix, force = np.zeros((2 * count + 2,) * 2), np.zeros(2 * count + 2)
    for i in range(count):
        place = slice(2 * i, 2 * i + 4)
        matrix[place, place] += bending / h**3 * bend + tension / (30.0 * h) * pull
        force[place] -= load * h * np.array([0.5, h / 12.0, 0.5, -h / 12.0])
    nodes = [2 * int(np.argmin(np.abs(x - s))) for s in supports]
    active = list(nodes)
    for _ in range(20):
        held = [0, *active]
        free = np.setdiff1d(np.arange(len(force)), held)
        w = np.zeros(len(force))
        w[free] = np.linalg.solve(matrix[np.ix_(free, free)], force[free])
        reaction = matrix @ w - force
        changed = [n for n in nodes if (reaction[n] > 0.0 if n in active else w[n] < 0.0)]
        if changed == active:
            break
        active = changed
    return [float(reaction[n]) if n in held else 0.0 for n in (0, *nodes)]


def slip_arc(tight: float, slack: float, friction: float) -> float:
    """Part of the wrap on which a driven strip slips (rad); it sticks on the rest."""
    return abs(log(tight / slack)) / friction
