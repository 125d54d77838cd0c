"""Plastic flow of a strip, in layers through its thickness.

The flow law gives the rate from the stress, ε_p' = ε₀ (σ/σ_y)ⁿ with an odd integer n, which is
the inverse of Norton's and Hoff's law, Perzyna's without a threshold (Lemaitre and Chaboche,
Mechanics of Solid Materials, section 6.4), and a polynomial: nothing is singular at rest, and for
large n the stress hardly depends on the rate.  A section flows along itself; a shell in plane
stress, as von Mises has it (Simo and Taylor, Int. J. Numer. Meth. Engng. 22, 1986).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.fem.geometry import DERIVATIVE_PAIRS, dot
from anmstrip.fem.operators import InternalOperator
from anmstrip.mechanics.effects import LawEffect, Values
from anmstrip.mechanics.shell import KirchhoffLove, Membrane, moduli, weaken

VON_MISES = {1: np.eye(1), 3: np.array([[1.0, -0.5, 0.0], [-0.5, 1.0, 0.0], [0.0, 0.0, 3.0]])}
"""A in σ_eq² = σ · A σ of a fibre's stress, and of (xx, yy, xy) in plane stress."""


TINY = float(np.finfo(float).tiny)

ADDED_SHARE = 0.1
"""Of the tolerance, that the flow in one step may make wrong of forces: strip that is pulled into
flow, unloaded and loaded again between held ends is then wrong by 1.3 times the tolerance after 110
tangents, and with all of it by nine times after 74."""


@dataclass(frozen=True)
class FlowLaw:
    """ε_p' = ε₀ s_eqⁿ⁻¹ A s, with s = (σ − X)/R and s_eq² = s · A s.

    X = H_k A⁻¹ ε_p is the back stress, R = σ_y + H_i p the yield stress as it grows with
    p' = ε₀ s_eqⁿ⁺¹.  Where material flows s_eq is about 1, and p the length of its plastic path.
    Strain has twice the shear of the tensor; A is :data:`VON_MISES`.  Another hardening is another
    ``resistance``, another yield surface another ``normal``.
    """

    yield_stress: float  # σ_y (Pa)
    exponent: int  # n, odd
    rate: float  # ε₀ (1/s), or per length of strip (1/m) in stationary states
    isotropic: float = 0.0  # H_i (Pa)
    kinematic: float = 0.0  # H_k (Pa)
    equivalent: float = 1.0  # von Mises stress over that of a flowing fibre

    @property
    def hardens(self) -> bool:
        """Whether p matters."""
        return bool(self.isotropic) or type(self).resistance is not FlowLaw.resistance

    def variables(self, directions: int) -> int:
        """Return how many internal variables a layer has: ε_p, and p if it matters."""
        return len(VON_MISES[3 if directions > 1 else 1]) + self.hardens

    def resistance(self, path: Any) -> Any:
        """Return R (Pa), positive, from p, both (layers, points)."""
        return path * self.isotropic + self.yield_stress

    def normal(self, s: Any) -> Any:
        """Return A s of the shape of s, (1 or 3, layers, points); s · A s is s_eq²."""
        return np.einsum("kl,l...->k...", VON_MISES[s.shape[0]], s)

    def driving(self, stress: Any, internal: Any) -> Any:
        """Return s, (1 or 3, layers, points), from σ (Pa) and the internal variables."""
        d = stress.shape[0]
        if self.kinematic:
            back = self.kinematic * np.linalg.inv(VON_MISES[d])
            stress = stress - np.einsum("kl,l...->k...", back, internal[:d])
        if not self.hardens:
            return stress * (1.0 / self.yield_stress)
        return stress / self.resistance(internal[d])

    def rates(self, stress: Any, internal: Any, share: Any) -> Any:
        """Rates of the internal variables, of their shape (variables, layers, points).

        Parameters
        ----------
        stress : array or Series, shape (1 or 3, layers, points)
            σ (Pa).
        internal : array or Series, shape (variables, layers, points)
        share : float or Series
            By which s is multiplied, 0 for a strip that does not yield yet.
        """
        s = self.driving(stress, internal) * share
        normal = self.normal(s)
        square = dot(s, normal)
        speed = np.power(square, self.exponent // 2) * self.rate
        flow = [speed * normal[k] for k in range(normal.shape[0])]
        return np.stack([*flow, speed * square] if self.hardens else flow)

    def level(self, s: Array) -> Array:
        """Return s_eq, (layers, points), from s."""
        return np.asarray(np.sqrt(dot(s, self.normal(s))))

    def mises(self, stress: Array) -> Array:
        """Return the equivalent stress σ_eq (Pa) of stress, (1 or 3, ...)."""
        form = VON_MISES[len(stress)]
        return self.equivalent * np.sqrt(np.einsum("k...,kl,l...->...", stress, form, stress))


class Plasticity(LawEffect):
    """Share of plastic strains in the forces and moments of a strip, and how they grow.

    A layer at the height ζ bears σ = C (E − ζ χ − ε_p), with the membrane strain E and the change
    of curvature χ of :mod:`anmstrip.mechanics.shell`, and C of plane stress.  A section bends in
    plane strain, C = E' = E/(1−ν²), and contracts across under tension, which takes the share
    1 − ν² of E, as its membrane and its bending do; it flows in plane strain too, which the yield
    stress of ``flow`` has to say.  The residual has −∫C ε_p dζ and ∫ζ C ε_p dζ beside the elastic
    N and M, and the flow law of all layers.

    Controls: ``yielding``, the share by which stresses count in the flow law; of warm strip
    ``strip.softening`` and ``strip.weakening``, what E and the yield stress have lost.

    Parameters
    ----------
    membrane : Membrane
    bending : KirchhoffLove
        Of a flat strip, whose strain and change of curvature these are.
    flow : FlowLaw
        In time or, where the operator has slopes, along the strip.
    operator : InternalOperator
        To the first and second derivatives, and to the internal variables of all layers.
    """

    name = "plasticity"
    operator: InternalOperator

    def __init__(
        self, membrane: Membrane, bending: KirchhoffLove, flow: FlowLaw, operator: InternalOperator
    ) -> None:
        self.membrane, self.bending = membrane, bending
        self.flow, self.layers, self.operator = flow, operator.layers, operator
        self.seeds = operator.seeds
        strip = self.strip = membrane.strip
        self.rate_dependent = operator.flows and operator.slopes is None
        self.modulus = 12.0 * strip.bending_stiffness / strip.thickness**3
        section = strip.kinematics.directions == 1
        self.twice = np.ones(1) if section else np.array([1.0, 1.0, 2.0])
        self.moduli = 12.0 / strip.thickness**3 * moduli(strip)[: len(self.twice)]
        self.moduli = self.moduli[:, : len(self.twice)] / self.twice
        self.contracting = 1.0 - strip.material.poisson**2 if section else 1.0

    @property
    def units(self) -> Array:
        """Force (N) that a rate of 1 of each internal variable stands for, (internal unknowns,)."""
        cells, strip = self.operator.cells, self.strip
        spacing = cells.weights / strip.depth
        length = np.repeat(strip.cell_sizes[0], cells.per_element)
        along = spacing / length if self.operator.slopes is None else spacing
        each = np.multiply.outer(self.modulus * strip.depth * self.layers.weights, along)
        return np.tile(each.ravel(), self.operator.variables)

    def derivatives(self, x: Any) -> Any:
        """Return r,a and r,ab, (components, directions + pairs, points)."""
        k = self.operator.cells.components
        parts = [x[c * k : (c + 1) * k] for c in range(self.operator.cells.count)]
        return np.stack(parts) + self.bending.reference

    def internal(self, x: Any) -> Any:
        """Internal variables, (variables, layers, points), from the operator's values."""
        begin, m = self.operator.strains, len(self.layers.heights)
        count = self.operator.variables
        return np.stack([x[begin + k * m : begin + (k + 1) * m] for k in range(count)])

    def stresses(self, x: Any, controls: Values) -> Any:
        """Return σ (Pa) as xx or (xx, yy, xy), (1 or 3, layers, points)."""
        derivatives, internal = self.derivatives(x), self.internal(x)
        tangents = derivatives[:, : self.bending.directions]
        strain = self.membrane.strain(tangents, controls)
        bent, heights = self.bending.change(derivatives, controls), self.layers.heights[:, None]
        pairs = DERIVATIVE_PAIRS[self.bending.directions]
        each = [
            strain[a, b] * (self.contracting * twice) - bent[k] * (heights * twice) - internal[k]
            for k, ((a, b), twice) in enumerate(zip(pairs, self.twice, strict=True))
        ]
        return weaken(np.einsum("kl,l...->k...", self.moduli, np.stack(each)), controls)

    def resultants(self, x: Any, controls: Values) -> tuple[Any, Any]:
        """Return what ε_p adds to N (N/m) and to M (N) against n · r,ab, (pairs, points)."""
        strains, layers = self.internal(x)[: len(self.twice)], self.layers
        weights = -layers.weights, layers.weights * layers.heights
        summed = (np.einsum("l,kl...->k...", each, strains) for each in weights)
        force, moment = (np.einsum("kl,l...->k...", self.moduli, each) for each in summed)
        return weaken(force, controls), weaken(moment, controls)

    def tensor(self, force: Any) -> Any:
        """Return the components (d, d, ...) of xx or (xx, yy, xy)."""
        index = np.array([[0, 2], [2, 1]])[: self.bending.directions, : self.bending.directions]
        return np.stack([np.stack([force[k] for k in row]) for row in index])

    def added_forces(self, full: Array, controls: Values) -> Array:
        """Return what ε_p adds to the membrane forces (N/m) of all unknowns, (d, d, points)."""
        return np.asarray(self.tensor(self.resultants(self.operator.apply(full), controls)[0]))

    def resultant_changes(self, full: Array, change: Array) -> tuple[Array, Array]:
        """Changes of forces (N/m) and moments (N) by one of all unknowns, (1 or 3, points)."""
        before, after = (self.stresses(self.operator.apply(x), {}) for x in (full, full + change))
        each, layers = after - before, self.layers
        force = np.einsum("l,klp->kp", layers.weights, each)
        return force, np.einsum("l,klp->kp", layers.weights * layers.heights, each)

    def stress_error(self, full: Array, change: Array, tension: float) -> float:
        """Root mean square of the forces of a change of all unknowns, over a tenth of a tension.

        Or of its moments, over that of first yield, if that is larger.  What flow makes wrong of
        forces (N/m) adds up where it begins and ends.
        """
        weights = self.strip.weights().ravel()
        units = ADDED_SHARE * tension, self.flow.yield_stress * self.strip.thickness**2 / 6.0
        return max(
            float(np.sqrt(np.einsum("kp,kp,p->", x, x, weights) / weights.sum())) / unit
            for x, unit in zip(self.resultant_changes(full, change), units, strict=True)
        )

    def share(self, controls: Values) -> Any:
        """Return the factor of s: the share by which stresses count, over that left of σ_y."""
        counted = controls["yielding"]
        loss = controls.get("strip.weakening")
        return counted if loss is None else counted / (1.0 - loss)

    def less_rate_dependent(self, full: Array, controls: Values) -> Array | None:
        """Return the derivative of the residual, (unknowns,), by a share that 1/n loses.

        That of the rates, which are in proportion to s_eqⁿ⁻¹, is n ln s_eq times them.
        """
        if not self.operator.flows:
            return None
        x, share = self.operator.apply(full), self.share(controls)
        stress, internal = self.stresses(x, controls), self.internal(x)
        level = self.flow.level(self.flow.driving(stress, internal) * share)
        slope = self.flow.exponent * np.log(np.maximum(level, TINY))
        rates = self.flow.rates(stress, internal, share) * slope
        still = np.zeros((self.operator.strains, self.operator.points))
        return self.operator.gather(np.vstack([still, -rates.reshape(-1, rates.shape[-1])]))

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Forces against the derivatives, and rates of the internal variables less their law."""
        derivatives, d = self.derivatives(x), self.bending.directions
        force, moment = self.resultants(x, controls)
        work = self.bending.work(derivatives, moment * self.twice[:, None])
        stretched = np.einsum("ia...,ab...->ib...", derivatives[:, :d], self.tensor(force))
        count, pairs = work.shape[0], work.shape[1] - d
        along = [[stretched[c, a] + work[c, a] for a in range(d)] for c in range(count)]
        forces = [
            f for c in range(count) for f in (*along[c], *(work[c, d + k] for k in range(pairs)))
        ]
        if not self.operator.flows:
            return np.stack(forces)
        law = self.flow.rates(self.stresses(x, controls), self.internal(x), self.share(controls))
        rates = self.operator.rates(x, v)
        grown = [law[k, i] for k in range(law.shape[0]) for i in range(law.shape[1])]
        return np.stack([*forces, *(rates[i] - flow for i, flow in enumerate(grown))])
