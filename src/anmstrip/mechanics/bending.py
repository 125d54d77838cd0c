"""Bending of a flat reference: the isometric energy, quadratic in the deformation.

½ D ∫ [(1 − ν) ∇²r : ∇²r + ν |Δr|²], exact for isometric deformations.  Otherwise it has
more than Kirchhoff–Love by the tangential parts r,a · r,bc, derivatives of the membrane strain,
squared.  Source: Bartels,
*Approximation of large bending isometries with discrete Kirchhoff triangles*,
SIAM J. Numer. Anal. 51 (2013).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .cells import Pattern, hessians
from .effects import LinearEffect
from .strip import Strip

Array = NDArray[np.float64]

FLAT = 1e-10
"""Curvature times thickness that is round-off."""


def isometric_bending(strip: Strip, pattern: Pattern) -> LinearEffect:
    """Bending as a constant matrix.

    Parameters
    ----------
    strip : Strip
    pattern : Pattern

    Returns
    -------
    LinearEffect

    Raises
    ------
    ValueError
        If the reference is curved.
    """
    if np.abs(strip.frames().seconds).max() * strip.thickness > FLAT:
        raise ValueError("isometric bending is for flat references; take KirchhoffLove")
    operator = hessians(strip)
    block = np.zeros(pattern.couplings)
    operator.add_bilinear(stiffness(strip), pattern, block)
    return LinearEffect("bending", operator.points, block, pattern)


def stiffness(strip: Strip) -> Array:
    """D [(1−ν) A : B + ν tr A tr B] for (xx, yy, xy) of symmetric A, B; shape (3, 3), N m.

    Of a section D alone, shape (1, 1): it does not bend across.
    """
    nu = strip.material.poisson
    if strip.kinematics.directions == 1:
        return np.full((1, 1), strip.bending_stiffness)
    return strip.bending_stiffness * np.array(
        [[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 2.0 * (1.0 - nu)]]
    )


def moduli(strip: Strip) -> Array:
    """Moments (xx, yy, xy) of unit curvatures (κ_xx, κ_yy, κ_xy), shape (3, 3), N m.

    A section carries M_yy = ν M_xx, since it cannot bend across.
    """
    d, nu = strip.bending_stiffness, strip.material.poisson
    return d * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 1.0 - nu]])
