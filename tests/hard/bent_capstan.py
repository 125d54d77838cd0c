"""Tensions of a strip that resists bending, in full slip around a roller: closed forms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from strips import RADIUS

Array = NDArray[np.float64]


def arc_ratio(f: float, angle: float, stiff: float) -> float:
    """Ratio of tensions in full slip around an arc, with bending, D/(T2 R²) = ``stiff``.

    Beyond the arc elasticas turn by α = 2 asin(√(D/T)/2R), to its curvature, and lean on its ends
    with T sin α; so that T1 (cos α1 − f sin α1) = T2 (cos α2 + f sin α2) e^(f (θ − α1 − α2)).
    """

    def excess(ratio: float) -> float:
        first, second = lift_off(np.array([stiff / ratio, stiff]))
        low = (np.cos(second) + f * np.sin(second)) * np.exp(f * (angle - first - second))
        return float(ratio * (np.cos(first) - f * np.sin(first)) - low)

    return brentq(excess, 0.5, 2.0 * np.exp(f * angle), xtol=1e-14)


def lift_off(stiff: Array) -> Array:
    """Angles α = 2 asin(√(D/T)/2R) that an elastica turns to an arc's curvature; D/(T R²) given."""
    return np.asarray(2.0 * np.arcsin(0.5 * np.sqrt(stiff)))


def line_tension(bending: float, angle: float) -> float:
    """Tension (N/m) below which the arc of contact is a line, D/(4R² sin²(θ/4))."""
    return float(bending / (4.0 * RADIUS**2 * np.sin(0.25 * angle) ** 2))


def line_ratio(f: float, angle: float) -> float:
    """Ratio of tensions where a strip turns by an angle about one line and slips there.

    Elasticas with the tensions T1, T2 turn by α1, α2 up to the line, with equal moments
    2 √(D T) sin(α/2); the reaction leans by f: T1 cos α1 − T2 cos α2 = f (T1 sin α1 + T2 sin α2).
    """

    def leaning(first: float) -> tuple[float, float]:
        second = angle - first
        ratio = (np.sin(0.5 * second) / np.sin(0.5 * first)) ** 2
        pulled = ratio * (np.cos(first) - f * np.sin(first))
        return float(ratio), float(pulled - np.cos(second) - f * np.sin(second))

    return leaning(brentq(lambda a: leaning(a)[1], 0.1 * angle, 0.5 * angle, xtol=1e-14))[0]
