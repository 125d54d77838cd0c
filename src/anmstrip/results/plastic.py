"""What is read off a section that has yielded: along it, through its thickness, by roller."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.mechanics.plasticity import Plasticity
from anmstrip.results.fields import Readable

COLUMNS = ("residual_curvature", "elongation", "plastic_share", "plastic_strain", "yield_power")
"""Columns of ``profile.csv`` for strip that can yield."""

LAYER_COLUMNS = ("time", "arc_length", "height", "stress", "plastic_strain", "residual_stress")

FLOWS = 0.9
"""Share of the present yield stress from which on a layer counts as flowing.  With n = 51 its rate
is 0.5 % of the reference rate there; in a bend the stress falls from it to 0 within the core."""


@dataclass(frozen=True)
class RollerBend:
    """The sharpest bend at a roller, between the middles of the spans on both sides."""

    curvature: float  # κ, positive with a stretched top (1/m)
    moment: float  # N
    plastic_share: float  # of the thickness that flows
    residual_curvature: float  # of the strip unloaded behind it (1/m)
    elongation: float  # plastic, of the middle, since the entry
    yield_power: float  # W, of the flow between the middles of the spans


class YieldedStrip:
    """A state of a section that can yield, at its quadrature points from the entry on.

    Parameters
    ----------
    state : Readable
    effect : Plasticity

    Attributes
    ----------
    x : ndarray, shape (points,)
        Arc length (m) of the strip as it is cut.
    """

    def __init__(self, state: Readable, effect: Plasticity) -> None:
        self.state, self.effect, self.strip = state, effect, effect.strip
        strip = self.strip
        x = np.asarray(strip.basis.global_coordinates())[0].ravel()
        order, layers = np.argsort(x), effect.layers
        self.x = x[order] - strip.mesh.p[0].min()
        values = effect.operator.apply(state.full)
        self.stress = np.asarray(effect.stresses(values, state.controls))[:, order]
        self.internal = np.asarray(effect.internal(values))[..., order]
        self.strain, self.curvature = self.internal[0], -np.asarray(effect.bent(values))[order]
        self.force = layers.weights @ self.stress
        self.moment = (layers.weights * layers.heights) @ self.stress

    @classmethod
    def of(cls, state: Readable) -> YieldedStrip | None:
        """Return what is read off the layers of a state, None where nothing can yield."""
        return None if state.plasticity is None else cls(state, state.plasticity)

    @cached_property
    def residual_curvature(self) -> Array:
        """κ − M/D (1/m), what is left when the moment is taken away."""
        return self.curvature - self.moment / self.strip.bending_stiffness

    @cached_property
    def elongation(self) -> Array:
        """Plastic strain of the middle surface: ∫ε_p dζ/t, over the share of ε_x in E' ε."""
        layers = self.effect.layers
        return (layers.weights @ self.strain) / (layers.weights.sum() * self.effect.share)

    @cached_property
    def residual_stress(self) -> Array:
        """σ − N/t − 12 M ζ/t³ (Pa), left when force and moment are taken away, (layers, points)."""
        heights, t = self.effect.layers.heights, self.strip.thickness
        return self.stress - self.force / t - np.outer(12.0 * heights / t**3, self.moment)

    @cached_property
    def plastic_share(self) -> Array:
        """Share of the thickness that flows or is about to.

        Between two layers of which one flows the stress changes by E' κ per height in the part
        that does not, and not at all in the other.
        """
        height = self.effect.layers.heights
        slope = np.maximum(self.effect.modulus * np.abs(self.curvature), np.finfo(float).tiny)
        flows = np.abs(self.effect.flow.driving(self.stress, self.internal)) > FLOWS
        gaps = np.diff(height)[:, None]
        elastic = np.minimum(np.abs(np.diff(self.stress, axis=0)) / slope, gaps)
        plastic = np.where(flows[1:] | flows[:-1], gaps - elastic, 0.0)
        return np.asarray(plastic.sum(axis=0) / np.ptp(height))

    @cached_property
    def power(self) -> Array:
        """Power of the flow per length of strip, W ∫σ ε_p' dζ (W/m)."""
        strip, weights = self.strip, self.effect.layers.weights
        rates = self.effect.flow.rates(self.stress, self.internal, self.state.controls["yielding"])
        if not self.effect.operator.flows:
            return np.zeros_like(self.x)
        speed = 1.0 if self.effect.rate_dependent else self.state.strip_speed
        return np.asarray(strip.width * (weights @ (self.stress * rates[0])) * speed)

    def columns(self, x: Array) -> dict[str, Array]:
        """Return the columns of a profile, and moment and curvature, at places along the strip."""
        faces = np.abs(self.strain[[0, -1]]).max(axis=0)
        found = {
            "residual_curvature": self.residual_curvature,
            "elongation": self.elongation,
            "plastic_share": self.plastic_share,
            "plastic_strain": faces,
            "yield_power": self.power,
            "moment": self.moment,
        }
        return {name: np.interp(x, self.x, values) for name, values in found.items()}

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield rows of ``layers.csv``, one for every layer at every quadrature point."""
        heights = self.effect.layers.heights
        for p, x in enumerate(self.x):
            for k, height in enumerate(heights):
                stresses = float(self.stress[k, p]), float(self.strain[k, p])
                values = self.state.time, float(x), float(height), *stresses
                row = (*values, float(self.residual_stress[k, p]))
                yield dict(zip(LAYER_COLUMNS, row, strict=True))

    def rollers(self) -> dict[str, RollerBend]:
        """Return the sharpest bend at every roller that the strip touches."""
        begin = self.strip.mesh.p[0].min()
        middles = {n: c.middle - begin for n, c in self.state.contacts.items() if c.touching.any()}
        names = sorted(middles, key=lambda name: middles[name])
        places = np.array([middles[name] for name in names])
        if not names:
            return {}
        ends = np.concatenate([[-np.inf], 0.5 * (places[1:] + places[:-1]), [np.inf]])
        found = {}
        for name, low, high in zip(names, ends[:-1], ends[1:], strict=True):
            here = np.flatnonzero((self.x >= low) & (self.x < high))
            p = here[np.abs(self.curvature[here]).argmax()]
            readings = (self.curvature, self.moment, self.plastic_share, self.residual_curvature)
            power = np.trapezoid(self.power[here], self.x[here])
            values = (*(r[p] for r in readings), self.elongation[here[-1]], power)
            found[name] = RollerBend(*map(float, values))
        return found
