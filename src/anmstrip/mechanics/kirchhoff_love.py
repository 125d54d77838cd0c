"""Bending after Kirchhoff and Love, of flat and of curved references.

    ½ ∫ D [(1 − ν) κ : κ + ν (tr κ)²],    κ_ab = b_ab − B_ab,
    b_ab = n · r,ab,    n = m / |m|,    m = r,1 × r,2

Source: Koiter, *On the nonlinear theory of thin elastic shells*, Proc. Kon. Ned. Akad. Wet.
B 69 (1966), in frames of the reference (:mod:`anmstrip.mechanics.surfaces`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .bending import stiffness
from .cells import bends
from .normals import dot, normals
from .strip import Strip

Array = NDArray[np.float64]


class KirchhoffLove:
    """Moments of a strip against its change of curvature.

    Parameters
    ----------
    strip : Strip
        A shell or a section.
    imperfection : ndarray, shape (unknowns,), optional
        Displacement of the reference that makes no moment.
    """

    name = "bending"
    rate_dependent = False

    def __init__(self, strip: Strip, imperfection: Array | None = None) -> None:
        frames = strip.frames()
        self.operator = bends(strip)
        self.normals = normals(strip.kinematics)
        self.directions = strip.kinematics.directions
        self.stiffness = stiffness(strip)
        self.reference = np.concatenate([frames.tangents, frames.seconds], axis=1)
        natural = 0.0 if imperfection is None else self.operator.apply(imperfection)
        self.curvature = self.bent(self.reference + natural)

    def near(self, full: Array, controls: Mapping[str, Any]) -> KirchhoffLove:
        """Everywhere."""
        return self

    def bent(self, derivatives: Any) -> Any:
        """b (1/m) as (xx, yy, xy), (pairs, points), from r,a and r,ab."""
        m = self.normals.vector(derivatives[:, : self.directions])
        second = derivatives[:, self.directions :]
        return np.einsum("ik...,i...->k...", second, m) / np.sqrt(dot(m, m))

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Forces against the derivatives, (components, directions + pairs, points).

        With the moments M and s = Σ M_ab r,ab: M_ab n against δr,ab, and what
        p = (s − n n · s) / |m| makes with δm against δr,a.
        """
        derivatives = x + self.reference
        tangents, second = derivatives[:, : self.directions], derivatives[:, self.directions :]
        m = self.normals.vector(tangents)
        size = np.sqrt(dot(m, m))
        n = m / size
        bent = np.einsum("ik...,i...->k...", second, n)
        moments = np.einsum("kl,l...->k...", self.stiffness, bent - self.curvature)
        s = np.einsum("ik...,k...->i...", second, moments)
        p = (s - n * dot(n, s)) / size
        against = [n * moments[k] for k in range(len(self.stiffness))]
        return np.stack([*self.normals.works(tangents, p), *against], axis=1)
