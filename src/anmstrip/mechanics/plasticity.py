"""Plastic flow of a section, in layers through its thickness.

The flow law gives the rate from the stress, ε_p' = ε₀ (σ/σ_y)ⁿ with an odd integer n, which is
the inverse of Norton's and Hoff's law, Perzyna's without a threshold (Lemaitre and Chaboche,
Mechanics of Solid Materials, section 6.4), and a polynomial: nothing is singular at rest, and for
large n the stress hardly depends on the rate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.legendre import Legendre

from anmstrip.arrays import Array
from anmstrip.fem.geometry import dot, normal_vector, normal_work
from anmstrip.fem.operators import InternalOperator
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.effects import LawEffect
from anmstrip.mechanics.shell import eigencurvature, eigenstrain


def lobatto(count: int) -> tuple[Array, Array]:
    """Return points in [−1, 1] and weights of Lobatto's rule, which includes both ends.

    Weights 2/(n (n − 1) P_{n−1}(x)²), n the count (Abramowitz and Stegun, 25.4.32).
    """
    last = Legendre.basis(count - 1)
    points = np.concatenate([[-1.0], last.deriv().roots(), [1.0]])
    return points, 2.0 / (count * (count - 1) * last(points) ** 2)


@dataclass(frozen=True)
class FlowLaw:
    """ε_p' = ε₀ sⁿ, s = (σ − H_k ε_p)/(σ_y + H_i p), with the accumulated strain p' = ε₀ sⁿ⁺¹.

    Where a fibre flows |s| is about 1, and p the length of its plastic path.
    """

    yield_stress: float  # σ_y (Pa)
    exponent: int  # n, odd
    rate: float  # ε₀ (1/s), or per length of strip (1/m) in stationary states
    isotropic: float = 0.0  # H_i (Pa)
    kinematic: float = 0.0  # H_k (Pa)
    equivalent: float = 1.0  # von Mises stress over that of a flowing fibre

    @property
    def variables(self) -> int:
        """Internal variables of a fibre: ε_p, and p if it hardens isotropically."""
        return 2 if self.isotropic else 1

    def driving(self, stress: Any, internal: Any) -> Any:
        """Return s, (layers, points), from σ (Pa) and the internal variables."""
        overstress = stress - internal[0] * self.kinematic
        if not self.isotropic:
            return overstress * (1.0 / self.yield_stress)
        return overstress / (internal[1] * self.isotropic + self.yield_stress)

    def rates(self, stress: Any, internal: Any, share: Any) -> Any:
        """Rates of the internal variables, of their shape (variables, layers, points).

        Parameters
        ----------
        stress : array or Series, shape (layers, points)
            σ (Pa).
        internal : array or Series, shape (variables, layers, points)
        share : float or Series
            By which s is multiplied, 0 for a strip that does not yield yet.
        """
        s = self.driving(stress, internal) * share
        flow = np.power(s, self.exponent) * self.rate
        return np.stack([flow, flow * s]) if self.isotropic else np.stack([flow])


@dataclass(frozen=True)
class Layers:
    """Points through the thickness at which fibres flow.

    Attributes
    ----------
    heights : ndarray, shape (layers,)
        ζ (m) above the middle.
    weights : ndarray, shape (layers,)
        m; their sum is the thickness.
    """

    heights: Array
    weights: Array

    @classmethod
    def of(cls, thickness: float, count: int) -> Layers:
        """Return so many layers by Lobatto's rule, the first and the last on the faces."""
        points, weights = lobatto(count)
        return cls(0.5 * thickness * points, 0.5 * thickness * weights)


class Plasticity(LawEffect):
    """What plastic strains take from the forces and moments of a section, and how they grow.

    A fibre at the height ζ bears σ = E' (e E − ζ χ − ε_p), with the membrane strain E and the
    change of curvature χ of :mod:`anmstrip.mechanics.shell`.  A wide strip bends in plane strain,
    E' = E/(1−ν²), and contracts across under tension, e = 1 − ν², as its membrane and its bending
    do; it flows in plane strain too, which the yield stress of ``flow`` has to say.  The residual
    has −∫E' ε_p dζ and ∫ζ E' ε_p dζ beside the elastic N and M, and the flow law of all layers.

    Controls: ``yielding``, the share by which stresses count in the flow law.

    Parameters
    ----------
    strip : Strip
        A flat section.
    flow : FlowLaw
        In time or, where the operator has slopes, along the strip.
    layers : Layers
    operator : InternalOperator
        To the first and second derivatives, and to the internal variables.
    """

    name = "plasticity"
    operator: InternalOperator

    def __init__(
        self,
        strip: Strip,
        flow: FlowLaw,
        layers: Layers,
        operator: InternalOperator,
    ) -> None:
        self.strip, self.flow, self.layers, self.operator = strip, flow, layers, operator
        self.rate_dependent = operator.flows and operator.slopes is None
        self.modulus = 12.0 * strip.bending_stiffness / strip.thickness**3
        self.share = strip.tensile_stiffness / (self.modulus * strip.thickness)

    @property
    def units(self) -> Array:
        """Force (N) that a rate of 1 of each internal variable stands for, (internal unknowns,)."""
        cells, strip = self.operator.cells, self.strip
        spacing = cells.weights / strip.depth
        length = np.repeat(strip.cell_sizes[0], cells.per_element)
        along = spacing / length if self.operator.slopes is None else spacing
        each = np.multiply.outer(self.modulus * strip.depth * self.layers.weights, along)
        return np.tile(each.ravel(), self.flow.variables)

    def internal(self, x: Any) -> Any:
        """Internal variables, (variables, layers, points), from the operator's values."""
        begin, m = self.operator.strains, len(self.layers.heights)
        parts = [x[begin + k * m : begin + (k + 1) * m] for k in range(self.flow.variables)]
        return np.stack(parts)

    def bent(self, x: Any) -> Any:
        """Return n · r,xx (1/m), (points,), from the operator's values."""
        m = normal_vector((x[:4:2] + self.strip.kinematics.flat[:, 0])[:, None])
        return dot(m, x[1:4:2]) / np.sqrt(dot(m, m))

    def stresses(self, x: Any, controls: Mapping[str, Any]) -> Any:
        """Return σ (Pa), (layers, points), from the operator's values."""
        tangent = x[:4:2] + self.strip.kinematics.flat[:, 0]
        stretch, bent = (dot(tangent, tangent) - 1.0) * 0.5, self.bent(x)
        if (own := eigenstrain(self.strip, controls)) is not None:
            stretch = stretch - own[0, 0]
        if (own := eigencurvature(controls)) is not None:
            bent = bent + own[0]
        strain = stretch * self.share - bent * self.layers.heights[:, None]
        return (strain - self.internal(x)[0]) * self.modulus

    def resultants(self, x: Any) -> tuple[Any, Any]:
        """Return what ε_p adds to N (N/m) and to the moment (N) against n · r,xx, (points,)."""
        strains, layers = self.internal(x)[0], self.layers
        force = np.einsum("l,l...->...", -self.modulus * layers.weights, strains)
        first = self.modulus * layers.weights * layers.heights
        return force, np.einsum("l,l...->...", first, strains)

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Forces against the derivatives, and rates of the internal variables less their law."""
        tangent, second = x[:4:2] + self.strip.kinematics.flat[:, 0], x[1:4:2]
        force, moment = self.resultants(x)
        m = normal_vector(tangent[:, None])
        size = np.sqrt(dot(m, m))
        n, s = m / size, second * moment
        p = (s - n * dot(n, s)) / size
        against_tangent, against_second = (
            tangent * force + normal_work(tangent[:, None], p)[0],
            n * moment,
        )
        forces = [f[c] for c in range(2) for f in (against_tangent, against_second)]
        if not self.operator.flows:
            return np.stack(forces)
        share = controls["yielding"]
        law = self.flow.rates(self.stresses(x, controls), self.internal(x), share)
        rates = self.operator.rates(x, v)
        grown = [law[k, i] for k in range(law.shape[0]) for i in range(law.shape[1])]
        return np.stack([*forces, *(rates[i] - flow for i, flow in enumerate(grown))])
