"""Membrane: Green–Lagrange strain with a plane-stress law, any rotation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import CellOperator
from .strip import Strip

Array = NDArray[np.float64]

FLAT = np.eye(3, 2)[:, :, None]
"""Tangent vectors of the flat reference, (component, direction, 1)."""


def plane_stress(strip: Strip) -> Array:
    """C (N/m) in N = C : E, shape (2, 2, 2, 2); E t/(1−ν²) [ν δ δ + (1−ν) sym]."""
    nu = strip.material.poisson
    d = np.eye(2)
    spherical = np.einsum("ab,cd->abcd", d, d)
    symmetric = 0.5 * (np.einsum("ac,bd->abcd", d, d) + np.einsum("ad,bc->abcd", d, d))
    return strip.membrane_stiffness * (nu * spherical + (1.0 - nu) * symmetric)


class Membrane:
    """Membrane forces of a strip.

    With the tangent vectors r,a (columns of a 3 × 2 array): E = ½ (r,a · r,b − δ_ab),
    N = C : E, and the first Piola stress is r,a N_ab.

    Parameters
    ----------
    strip : Strip
    """

    name = "membrane"
    rate_dependent = False

    def __init__(self, strip: Strip) -> None:
        gradients = [field[0].grad for field in strip.basis.basis]
        self.operator = CellOperator(strip, [np.stack([g[a] for g in gradients]) for a in range(2)])
        self.stiffness = plane_stress(strip)

    def near(self, full: Array, controls: Mapping[str, Any]) -> Membrane:
        """Everywhere."""
        return self

    def forces(self, tangents: Any) -> Any:
        """N (N/m), shape (2, 2, points), from tangent vectors (3, 2, points)."""
        strain = (np.einsum("ia...,ib...->ab...", tangents, tangents) - np.eye(2)[:, :, None]) * 0.5
        return np.einsum("abcd,cd...->ab...", self.stiffness, strain)

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """First Piola stress (N/m) from the displacement gradient, both (3, 2, points)."""
        tangents = x + FLAT
        return np.einsum("ia...,ab...->ib...", tangents, self.forces(tangents))

    def change(self, full: Array, change: Array) -> Array:
        """Membrane forces that a small change of state makes, shape (2, 2, points)."""
        tangents = self.operator.apply(full) + FLAT
        product = np.einsum("ia...,ib...->ab...", tangents, self.operator.apply(change))
        return np.einsum("abcd,cd...->ab...", self.stiffness, product)
