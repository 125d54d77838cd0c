"""Regularised laws of unilateral contact and of friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from anmstrip.arrays import NumbersInRange


def root_reaction(gap: Any, product: Any, stiffness: float) -> Any:
    """Positive root R of R (R/K + h) = p, without cancellation for either sign of h.

    Parameters
    ----------
    gap : array or Series
        h, negative for penetration.
    product : array or Series
        p, same shape.
    stiffness : float
        K.
    """
    free = gap > 0.0
    root = np.sqrt(gap * gap + product * (4.0 / stiffness)) + np.where(free, gap, -gap)
    return np.where(free, product * 2.0 / root, root * (0.5 * stiffness))


class ContactLaw:
    """Reaction R of an obstacle as a function of the gap h.

    1. A subclass has ``__call__(gap)``: the reaction (Pa, or N), positive and falling with the
       gap, of arrays and of power series alike.
    2. ``width`` (m) is the gap over which the reaction sets in: a step may not cross more unseen.
    3. ``faint`` is the reaction below which nothing counts as touching.
    """

    width: float
    faint: float

    def __call__(self, gap: Any) -> Any:
        """Return the reaction at a gap."""
        raise NotImplementedError

    def gap(self, reaction: Any) -> Any:
        """Return the gap at a reaction, the inverse of the law."""
        from scipy.optimize import brentq

        def inverse(wanted: float) -> float:
            reach = self.width
            while (
                float(self(np.float64(reach))) > wanted or float(self(np.float64(-reach))) < wanted
            ):
                reach *= 2.0
            return float(brentq(lambda h: float(self(np.float64(h))) - wanted, -reach, reach))

        return np.vectorize(inverse)(reaction)

    def sharper(self, share: float) -> ContactLaw:
        """Return the law whose gaps are all smaller by a share, at the same reactions."""
        return ScaledGaps(self, 1.0 - share)

    @property
    def words(self) -> str:
        """Description for a report."""
        return type(self).__name__


@dataclass(frozen=True)
class DerivedLaw(ContactLaw):
    """A law that follows from another one, with its width and its faintest reaction."""

    law: ContactLaw

    @property
    def width(self) -> float:  # type: ignore[override]
        """Gap (m) over which the reaction sets in."""
        return self.law.width

    @property
    def faint(self) -> float:  # type: ignore[override]
        """Reaction below which nothing counts as touching."""
        return self.law.faint


@dataclass(frozen=True)
class ScaledGaps(DerivedLaw):
    """A law with all gaps multiplied by a number."""

    ratio: float

    def __call__(self, gap: Any) -> Any:
        """Reaction at a gap."""
        return self.law(gap * (1.0 / self.ratio))

    def gap(self, reaction: Any) -> Any:
        """Gap at a reaction."""
        return self.ratio * self.law.gap(reaction)

    @property
    def width(self) -> float:  # type: ignore[override]
        """Gap (m) over which the reaction sets in."""
        return self.ratio * self.law.width


DIFFERENCE_SHARE = 1e-4
"""Share of a law's width over which its slope is taken: right to 1e-9."""


@dataclass(frozen=True)
class TangentBeyond(DerivedLaw):
    """A law up to a reaction, and its tangent beyond.

    Newton's method so comes out of a roller at once, of which exp(−h/w) leaves one w in each
    iteration.
    """

    largest: float  # reaction (Pa)

    @cached_property
    def least(self) -> float:
        """Gap (m) at that reaction."""
        return float(self.law.gap(np.float64(self.largest)))

    @cached_property
    def slope(self) -> float:
        """Slope −dR/dh there (Pa/m), by a central difference."""
        around = self.least + DIFFERENCE_SHARE * self.law.width * np.array([-1.0, 1.0])
        return float(np.subtract(*self.law(around)) / np.ptp(around))

    def __call__(self, gap: Any) -> Any:
        """Reaction at a gap."""
        beyond = np.where(gap < self.least, self.least - gap, gap * 0.0)
        return self.law(gap + beyond) + beyond * self.slope

    def gap(self, reaction: Any) -> Any:
        """Gap at a reaction."""
        inside = np.minimum(reaction, self.largest)
        return self.law.gap(inside) - (reaction - inside) / self.slope


@dataclass(frozen=True)
class Signorini(NumbersInRange):
    """R (R/K + h) = η (δ − h): the paper's law (5c).

    Repulsive for h < δ only; beyond it tends to the small attraction −η.
    """

    stiffness: float  # K (N/m, or Pa/m)
    eta: float  # η (N, or Pa)
    delta: float  # δ (m), where (5c) vanishes; η < K δ

    def __call__(self, gap: Any) -> Any:
        """Reaction at a gap."""
        return root_reaction(gap, (self.delta - gap) * self.eta, self.stiffness)

    def gap(self, reaction: Any) -> Any:
        """Inverse law: h = (η δ − R²/K) / (R + η)."""
        return (self.eta * self.delta - reaction**2 / self.stiffness) / (reaction + self.eta)


@dataclass(frozen=True)
class RepulsiveSignorini(NumbersInRange, ContactLaw):
    """R (R/K + h) = η δ: everywhere repulsive, for surfaces with distant nodes.

    It agrees with (5c) where |h| ≪ δ and decays like η δ/h, so that a strip
    feels no attraction from a roller that it does not touch.
    """

    stiffness: float  # K (N/m, or Pa/m)
    eta: float  # η (N, or Pa)
    delta: float  # δ (m), where (5c) vanishes; η < K δ

    def __call__(self, gap: Any) -> Any:
        """Reaction at a gap."""
        return root_reaction(gap, gap * 0.0 + self.eta * self.delta, self.stiffness)

    def gap(self, reaction: Any) -> Any:
        """Inverse law: h = η δ/R − R/K."""
        return self.eta * self.delta / reaction - reaction / self.stiffness

    @property
    def width(self) -> float:  # type: ignore[override]
        """Gap (m) over which the reaction sets in."""
        return 2.0 * float(np.sqrt(self.eta * self.delta / self.stiffness))

    @property
    def faint(self) -> float:  # type: ignore[override]
        """Reaction below which nothing counts as touching."""
        return self.eta

    @property
    def words(self) -> str:
        """Description for a report."""
        return f"K = {self.stiffness:.3g} Pa/m"


SATURATION_DEPTH = 100.0
"""Depth over the width from which a graded reaction grows no more: 1e43 times its pressure is more
than any strip bears, and still a number."""


@dataclass(frozen=True)
class GradedSignorini(NumbersInRange, ContactLaw):
    """R = p₀ exp(−h/w), for surfaces: an onset of contact of given width.

    A strip pressed by p₀ lies on the surface, h = 0, and sinks by w for every factor of e in the
    pressure.  The law has no singularity anywhere, and friction does not reach far.
    """

    pressure: float  # p₀ (Pa)
    width: float  # w (m)

    def __call__(self, gap: Any) -> Any:
        """Reaction at a gap, at most that at a depth of ``SATURATION_DEPTH`` widths."""
        deepest = -SATURATION_DEPTH * self.width
        seen = np.where(gap < deepest, deepest, gap)
        return np.exp(seen * (-1.0 / self.width)) * self.pressure

    def gap(self, reaction: Any) -> Any:
        """Inverse law: h = −w log(R/p₀)."""
        return np.log(reaction / self.pressure) * -self.width

    @property
    def faint(self) -> float:  # type: ignore[override]
        """Reaction below which nothing counts as touching: at gaps of 6.9 w."""
        return 1e-3 * self.pressure

    @property
    def words(self) -> str:
        """Description for a report."""
        return f"without penetration at {self.pressure:.3g} Pa"


def regular_norm(v: Any, floor: float) -> Any:
    """√(v·v + floor²), components of ``v`` on the first axis."""
    return np.sqrt(np.einsum("i...,i...->...", v, v) + floor**2)


class FrictionLaw:
    """Tangential reaction R_T as a function of the normal reaction and of the slip velocity.

    A subclass is a frozen dataclass with at least the fields ``coefficient`` (f, a number or one
    for each point) and ``speed`` (V_c, m/s), and has ``__call__(normal, slip)``: the reaction,
    against the slip, proportional to f, of arrays and of power series alike.
    """

    coefficient: Any
    speed: float

    @property
    def growth(self) -> float:
        """Power of the speed with which the reaction grows in full slip: 0 where it is bounded."""
        return 0.0

    def __call__(self, normal: Any, slip: Any) -> Any:
        """Return the tangential reaction, components on the first axis."""
        raise NotImplementedError

    def with_coefficient(self, coefficient: Any) -> Self:
        """Return the law with another coefficient, or one for each point."""
        return replace(self, coefficient=coefficient)  # type: ignore[type-var]

    def sharper(self, share: float) -> Self:
        """Return the law nearer to Coulomb's by a share: with V_c so much smaller."""
        return replace(self, speed=(1.0 - share) * self.speed)  # type: ignore[type-var]

    def share(self, slip: Any) -> Any:
        """Return |R_T|/(f R_N) in steady slip at given speeds (m/s)."""
        unit = self.with_coefficient(1.0)
        speed = np.abs(np.asarray(slip, dtype=float))
        return -unit(np.ones_like(speed), speed[None])[0]

    def effective(self, slip: float) -> float:
        """Return |R_T|/R_N in steady slip at a speed (m/s)."""
        return float(self.coefficient * self.share(slip))


@dataclass(frozen=True)
class NortonHoff(NumbersInRange, FrictionLaw):
    """R_T = −f R_N |v|_reg^(q−1) v / V_c^q: equations (2) and (5d).

    Invertible, and not bounded by f: at |v| = 10 V_c and q = 0.1 the ratio
    |R_T|/R_N is 1.26 f.
    """

    coefficient: Any  # f, a number or (points,)
    exponent: float  # q in (0, 1]; 0 would be Coulomb's law
    omega: float  # ω, width of the smoothed corner in units of V_c
    speed: float  # V_c (m/s)

    @property
    def growth(self) -> float:
        """q: power of the speed with which the reaction grows in full slip."""
        return self.exponent

    def __call__(self, normal: Any, slip: Any) -> Any:
        """Tangential reaction, components on the first axis."""
        magnitude = regular_norm(slip * (1.0 / self.speed), self.omega)
        strength = normal * magnitude ** (self.exponent - 1.0)
        return slip * strength * (-self.coefficient / self.speed)

    def sharper(self, share: float) -> NortonHoff:
        """Return the law nearer to Coulomb's by a share: with q and ω so much smaller."""
        left = 1.0 - share
        return replace(self, exponent=left * self.exponent, omega=left * self.omega)


@dataclass(frozen=True)
class Algebraic(NumbersInRange, FrictionLaw):
    """R_T = −f R_N v / √(v·v + V_c²): bounded by f, which it nears like 1 − V_c²/2v².

    At ten times V_c it is 0.995 f R_N, and it keeps a slope in slip: tanh, which nears f
    exponentially, leaves a strip in full slip without any, so that nothing says how fast.
    """

    coefficient: Any  # f, a number or (points,)
    speed: float  # V_c (m/s)

    def __call__(self, normal: Any, slip: Any) -> Any:
        """Tangential reaction, components on the first axis."""
        strength = normal / regular_norm(slip * (1.0 / self.speed), 1.0)
        return slip * strength * (-self.coefficient / self.speed)


@dataclass(frozen=True)
class Tanh(NumbersInRange, FrictionLaw):
    """R_T = −f R_N tanh(|v|_reg / V_c) v / |v|_reg: bounded by f."""

    coefficient: Any  # f, a number or (points,)
    omega: float  # ω, which only keeps the direction of slip smooth at rest
    speed: float  # V_c (m/s)

    def __call__(self, normal: Any, slip: Any) -> Any:
        """Tangential reaction, components on the first axis."""
        magnitude = regular_norm(slip * (1.0 / self.speed), self.omega)
        strength = normal * np.tanh(magnitude) / magnitude
        return slip * strength * (-self.coefficient / self.speed)


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
    """Speed at which an increasing function of |R_T|/(f R_N) and |v|/V_c vanishes."""
    from scipy.optimize import brentq

    unit = law.with_coefficient(1.0)

    def value(logarithm: float) -> float:
        speed = float(np.exp(logarithm))
        return excess(unit.effective(law.speed * speed), speed)

    largest = 100.0
    if value(largest) <= 0.0:
        return np.inf
    return law.speed * float(np.exp(brentq(value, -largest, largest)))
