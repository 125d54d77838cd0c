"""Regularised friction: tangential reaction from normal reaction and slip velocity.

Slip velocities are arrays with the components on the first axis; the laws run
on floats and on series.  |v|_reg = √(v·v + ω² V_c²).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np


def regular_norm(v: Any, floor: float) -> Any:
    """√(v·v + floor²), components of ``v`` on the first axis."""
    return np.sqrt(np.einsum("i...,i...->...", v, v) + floor**2)


@dataclass(frozen=True)
class NortonHoff:
    """R_T = −f R_N |v|_reg^(q−1) v / V_c^q: equations (2) and (5d).

    Invertible, and not bounded by f: at |v| = 10 V_c and q = 0.1 the ratio
    |R_T|/R_N is 1.26 f.

    Attributes
    ----------
    coefficient : float, or ndarray of shape (points,)
        f.
    exponent : float
        q in (0, 1]; 0 would be Coulomb's law.
    omega : float
        ω, width of the smoothed corner in units of V_c.
    speed : float
        V_c (m/s).
    """

    coefficient: Any
    exponent: float
    omega: float
    speed: float

    def __call__(self, normal: Any, slip: Any) -> Any:
        """Tangential reaction, components on the first axis."""
        magnitude = regular_norm(slip * (1.0 / self.speed), self.omega)
        strength = normal * magnitude ** (self.exponent - 1.0)
        return slip * strength * (-self.coefficient / self.speed)

    def share(self, slip: Any) -> Any:
        """|R_T|/(f R_N) in steady slip at given speeds."""
        s = np.abs(slip) / self.speed
        return s * (s * s + self.omega**2) ** ((self.exponent - 1.0) / 2.0)

    def effective(self, slip: float) -> float:
        """Ratio |R_T|/R_N in steady slip at the given speed."""
        return float(self.coefficient * self.share(slip))


@dataclass(frozen=True)
class Tanh:
    """R_T = −f R_N tanh(|v|_reg / V_c) v / |v|_reg: bounded by f.

    Attributes as in :class:`NortonHoff`, without exponent; ω only keeps the
    direction of slip smooth at rest.
    """

    coefficient: Any
    omega: float
    speed: float

    def __call__(self, normal: Any, slip: Any) -> Any:
        """Tangential reaction, components on the first axis."""
        magnitude = regular_norm(slip * (1.0 / self.speed), self.omega)
        strength = normal * np.tanh(magnitude) / magnitude
        return slip * strength * (-self.coefficient / self.speed)

    def share(self, slip: Any) -> Any:
        """|R_T|/(f R_N) in steady slip at given speeds."""
        s = np.abs(slip) / self.speed
        m = np.hypot(s, self.omega)
        return np.tanh(m) * s / m

    def effective(self, slip: float) -> float:
        """Ratio |R_T|/R_N in steady slip at the given speed."""
        return float(self.coefficient * self.share(slip))


FrictionLaw = NortonHoff | Tanh


def corner_speed(law: FrictionLaw) -> float:
    """Slip speed (m/s) that separates stick from slip: 1 − |R_T|/(f R_N) = |v|/V_c.

    Coulomb's law asks for |R_T| ≤ f R_N, v = 0 or |R_T| = f R_N, v ≠ 0; between the two a
    regular law goes round a corner, in whose middle both defects are equal.  As it sharpens
    (q, ω → 0) the speed tends to 0, and the ratio to 1.
    """
    return _speed_where(law, lambda share, speed: share + speed - 1.0)


def cone_speed(law: FrictionLaw) -> float:
    """Slip speed (m/s) from which |R_T| exceeds f R_N; infinite if it never does."""
    return _speed_where(law, lambda share, speed: share - 1.0)


def _speed_where(law: FrictionLaw, excess: Callable[[float, float], float]) -> float:
    """Where an increasing function of |R_T|/(f R_N) and |v|/V_c vanishes."""
    from scipy.optimize import brentq  # noqa: PLC0415 (a quarter of a second)

    unit = replace(law, coefficient=1.0)

    def value(logarithm: float) -> float:
        speed = float(np.exp(logarithm))
        return excess(unit.effective(law.speed * speed), speed)

    largest = 100.0
    if value(largest) <= 0.0:
        return np.inf
    return law.speed * float(np.exp(brentq(value, -largest, largest)))
