"""Regularised unilateral contact: reaction as a function of the gap.

All laws run on floats and on series.  Those of a penalty are closed roots of a quadratic; their
stiffness K and constant η are forces per length and forces for a single node, or pressures per
length and pressures for a surface.

What lets a strip touch a roller point by point costs one corner of the path each, and the more
tangents the sharper it is; an onset that lies between two points is not resolved either, and the
pressure alternates.  :class:`GradedSignorini` is given the width of its onset.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


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
    root = np.sqrt(gap * gap + product * (4.0 / stiffness))
    pressed = (root - gap) * (0.5 * stiffness)
    free = gap > 0.0
    if not np.any(free):
        return pressed
    apart = product * 2.0 / (root + np.where(free, gap, -gap))
    return np.where(free, apart, pressed)


@dataclass(frozen=True)
class Signorini:
    """R (R/K + h) = η (δ − h): the paper's law (5c).

    Repulsive for h < δ only; beyond it tends to the small attraction −η.

    Attributes
    ----------
    stiffness : float
        K (N/m, or Pa/m).
    eta : float
        η (N, or Pa).
    delta : float
        δ (m), the gap at which the reaction vanishes; η < K δ.
    """

    stiffness: float
    eta: float
    delta: float

    def __call__(self, gap: Any) -> Any:
        """Reaction at a gap."""
        return root_reaction(gap, (self.delta - gap) * self.eta, self.stiffness)

    def gap(self, reaction: Any) -> Any:
        """Inverse law: h = (η δ − R²/K) / (R + η)."""
        return (self.eta * self.delta - reaction**2 / self.stiffness) / (reaction + self.eta)


@dataclass(frozen=True)
class RepulsiveSignorini:
    """R (R/K + h) = η δ: everywhere repulsive, for surfaces with distant nodes.

    It agrees with (5c) where |h| ≪ δ and decays like η δ/h, so that a strip
    feels no attraction from a roller that it does not touch.  Attributes as in
    :class:`Signorini`.
    """

    stiffness: float
    eta: float
    delta: float

    def __call__(self, gap: Any) -> Any:
        """Reaction at a gap."""
        return root_reaction(gap, gap * 0.0 + self.eta * self.delta, self.stiffness)

    def gap(self, reaction: Any) -> Any:
        """Inverse law: h = η δ/R − R/K."""
        return self.eta * self.delta / reaction - reaction / self.stiffness

    @property
    def width(self) -> float:
        """Gap (m) over which the reaction sets in."""
        return 2.0 * float(np.sqrt(self.eta * self.delta / self.stiffness))

    @property
    def faint(self) -> float:
        """Reaction below which nothing counts as touching."""
        return self.eta

    @property
    def words(self) -> str:
        """For a report."""
        return f"K = {self.stiffness:.3g} Pa/m"


DEEPEST = 100.0
"""Depth over the width from which a graded reaction grows no more: 1e43 times its pressure is more
than any strip bears, and still a number."""


@dataclass(frozen=True)
class GradedSignorini:
    """R = p₀ exp(−h/w), for surfaces: an onset of contact of given width.

    A strip pressed by p₀ lies on the surface, h = 0, and sinks by w for every factor of e in the
    pressure.  The law has no singularity anywhere, and friction does not reach far.

    Attributes
    ----------
    pressure : float
        p₀ (Pa).
    width : float
        w (m).
    """

    pressure: float
    width: float

    def __call__(self, gap: Any) -> Any:
        """Reaction at a gap, at most that at a depth of ``DEEPEST`` widths."""
        deepest = -DEEPEST * self.width
        inside = gap < deepest
        if np.any(inside):
            gap = np.where(inside, deepest, gap)
        return np.exp(gap * (-1.0 / self.width)) * self.pressure

    def gap(self, reaction: Any) -> Any:
        """Inverse law: h = −w log(R/p₀)."""
        return np.log(reaction / self.pressure) * -self.width

    @property
    def faint(self) -> float:
        """Reaction below which nothing counts as touching: at gaps of 4.6 w."""
        return 0.01 * self.pressure

    @property
    def words(self) -> str:
        """For a report."""
        return f"without penetration at {self.pressure:.3g} Pa"
