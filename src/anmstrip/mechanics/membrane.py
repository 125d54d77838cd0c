"""Membrane: Green–Lagrange strain with a plane-stress law, any rotation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import gradients
from .strip import Strip

Array = NDArray[np.float64]


def plane_stress(strip: Strip) -> Array:
    """C (N/m) in N = C : E, shape (d, d, d, d) for d directions.

    E t/(1−ν²) [ν δ δ + (1−ν) sym] of a surface.  A section is free to contract across,
    N_yy = 0, which leaves E t.
    """
    if strip.kinematics.directions == 1:
        return np.full((1, 1, 1, 1), strip.tensile_stiffness)
    nu = strip.material.poisson
    d = np.eye(2)
    spherical = np.einsum("ab,cd->abcd", d, d)
    symmetric = 0.5 * (np.einsum("ac,bd->abcd", d, d) + np.einsum("ad,bc->abcd", d, d))
    return strip.membrane_stiffness * (nu * spherical + (1.0 - nu) * symmetric)


class Membrane:
    """Membrane forces of a strip.

    With the tangent vectors r,a (columns of an array): E = ½ (r,a · r,b − δ_ab),
    N = C : E, and the first Piola stress is r,a N_ab.  Derivatives are those of
    :mod:`anmstrip.mechanics.surfaces`, along orthonormal frames of the reference.

    Parameters
    ----------
    strip : Strip
    imperfection : ndarray, shape (unknowns,), optional
        Displacement of the reference that makes no stress.
    """

    name = "membrane"
    rate_dependent = False

    def __init__(self, strip: Strip, imperfection: Array | None = None) -> None:
        self.operator = gradients(strip)
        self.stiffness = plane_stress(strip)
        self.flat = strip.frames().tangents
        self.metric = np.eye(strip.kinematics.directions)[:, :, None]
        if imperfection is not None:
            natural = self.flat + self.operator.apply(imperfection)
            self.metric = np.einsum("iap,ibp->abp", natural, natural)

    def near(self, full: Array, controls: Mapping[str, Any]) -> Membrane:
        """Everywhere."""
        return self

    def forces(self, tangents: Any, natural: Array | None = None) -> Any:
        """N (N/m), shape (d, d, points), from tangent vectors (components, d, points).

        At other points than those of quadrature an imperfect strip needs its natural tangent
        vectors there, of the same shape.
        """
        metric = self.metric if natural is None else np.einsum("iap,ibp->abp", natural, natural)
        strain = (np.einsum("ia...,ib...->ab...", tangents, tangents) - metric) * 0.5
        return np.einsum("abcd,cd...->ab...", self.stiffness, strain)

    def at(self, full: Array) -> Array:
        """N (N/m) of a state at the quadrature points, shape (d, d, points)."""
        return np.asarray(self.forces(self.operator.apply(full) + self.flat))

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """First Piola stress (N/m) from the displacement gradient, (components, d, points)."""
        tangents = x + self.flat
        return np.einsum("ia...,ab...->ib...", tangents, self.forces(tangents))

    def change(self, full: Array, change: Array) -> Array:
        """Membrane forces that a small change of state makes, shape (d, d, points)."""
        tangents = self.operator.apply(full) + self.flat
        product = np.einsum("ia...,ib...->ab...", tangents, self.operator.apply(change))
        return np.einsum("abcd,cd...->ab...", self.stiffness, product)


def principal(forces: Array) -> tuple[Array, Array]:
    """Principal membrane forces (N/m), ascending, (points, d), and directions (points, d, d).

    Parameters
    ----------
    forces : ndarray, shape (d, d, points)
    """
    found = np.linalg.eigh(np.moveaxis(forces, -1, 0))
    return found.eigenvalues, found.eigenvectors
