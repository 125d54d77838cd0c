"""Geometry: levels of description, normals, and curved references with their frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anmstrip.arrays import Array
from anmstrip.taylor.series import taylor_series


class Kinematics:
    """A level of description: which displacements of which points are unknown.

    Parameters
    ----------
    name : str
    components : tuple of int
        Of x, y, z (0, 1, 2).
    directions : int
        Of the reference: 2 for a surface, 1 for a line along the strip.

    Attributes
    ----------
    count : int
        Number of unknown components.
    chosen : ndarray, shape (components, 3)
        Rows of the identity that belong to the components.
    flat : ndarray, shape (components, directions, 1)
        Tangent vectors of the flat reference.
    """

    def __init__(self, name: str, components: tuple[int, ...], directions: int) -> None:
        self.name, self.components, self.directions = name, components, directions
        self.count, self.chosen = len(components), np.eye(3)[list(components)]
        self.flat = np.ascontiguousarray(self.chosen[:, :directions, None])

    def pick(self, vector: ArrayLike) -> Array:
        """Components of vectors in space, components on the last axis."""
        return np.asarray(vector, dtype=float)[..., list(self.components)]

    def embed(self, values: Array) -> Array:
        """Vectors in space of components on the first axis, shape (3, ...)."""
        whole = np.zeros((3, *values.shape[1:]))
        whole[list(self.components)] = values
        return whole

    def place(self, component: int) -> int | None:
        """Number of a component of space among the unknown ones, ``None`` if it is not."""
        return self.components.index(component) if component in self.components else None


SHELL = Kinematics("shell", (0, 1, 2), 2)
SECTION = Kinematics("section", (0, 2), 1)
PLATE = Kinematics("plate", (2,), 2)
KINEMATICS = {level.name: level for level in (PLATE, SECTION, SHELL)}

LEVI_CIVITA = np.zeros((3, 3, 3))
LEVI_CIVITA[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
LEVI_CIVITA[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0
"""ε_ijk in (a × b)_i = ε_ijk a_j b_k."""

QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
"""Turns the tangent of a section to its normal, in the plane (x, z)."""


def dot(a: Any, b: Any) -> Any:
    """a · b, components first."""
    return np.einsum("i...,i...->...", a, b)


def cross(a: Any, b: Any) -> Any:
    """a × b, components first."""
    return np.einsum("ik...,k...->i...", np.einsum("ijk,j...->ik...", LEVI_CIVITA, a), b)


def normal_vector(tangents: Any) -> Any:
    """m, normal to a surface or a section and as long as the area that it stands for.

    r,1 × r,2 of a surface; r,x turned by a right angle, in the plane (x, z), of a section.

    Parameters
    ----------
    tangents : array or Series, shape (components, directions, points)

    Returns
    -------
    array or Series, shape (components, points)
    """
    if tangents.shape[1] == 1:
        return np.einsum("ij,j...->i...", QUARTER_TURN, tangents[:, 0])
    return cross(tangents[:, 0], tangents[:, 1])


def normal_work(tangents: Any, p: Any) -> list[Any]:
    """Vectors q_a in p · δm = Σ q_a · δr,a, m of :func:`normal_vector`, (components, points)."""
    if tangents.shape[1] == 1:
        return [np.einsum("ij,j...->i...", QUARTER_TURN.T, p)]
    return [cross(tangents[:, 1], p), cross(p, tangents[:, 0])]


DERIVATIVE_PAIRS = {1: ((0, 0),), 2: ((0, 0), (1, 1), (0, 1))}
"""Second derivatives that are kept, by the number of directions."""


@dataclass(frozen=True)
class Jet:
    """A surface at points of the parameter plane, with first and second derivatives."""

    position: Array  # R (m), shape (3, points)
    tangents: Array  # R,a, shape (3, 2, points)
    seconds: Array  # R,ab, shape (3, 2, 2, points)


ReferenceSurface = Callable[[Array], Jet]
"""A surface as a function of points of the parameter plane, (2, points)."""


@dataclass(frozen=True)
class Frames:
    """Orthonormal frames of a reference at points, and how derivatives are taken in them.

    A flat sheet in its own coordinates has neither G nor Γ, and one point for all.
    """

    tangents: Array  # e_α, shape (components, directions, points or 1)
    seconds: Array  # R;αβ for αβ in DERIVATIVE_PAIRS, shape (components, pairs, points or 1)
    density: Array  # √det A_ab, area over that in the parameter plane, (points or 1,)
    inverse: Array | None = None  # G^a_α, shape (2, 2, points)
    christoffel: Array | None = None  # Γ^c_ab, shape (2, 2, 2, points)

    @classmethod
    def of(cls, jet: Jet) -> Frames:
        """Frames of a curved surface; all three components are unknown."""
        first, second = jet.tangents, jet.seconds
        metric = np.einsum("iap,ibp->pab", first, first)
        factor = np.linalg.cholesky(metric)  # R,a = L_aα e_α
        inverse = np.linalg.inv(factor).transpose(2, 1, 0)
        contravariant = np.linalg.inv(metric).transpose(1, 2, 0)
        christoffel = np.einsum("cdp,idp,iabp->cabp", contravariant, first, second)
        covariant = second - np.einsum("cabp,icp->iabp", christoffel, first)
        seconds = np.einsum("aip,bjp,cabp->cijp", inverse, inverse, covariant)
        tangents = np.einsum("aip,cap->cip", inverse, first)
        seconds = np.stack([seconds[:, a, b] for a, b in DERIVATIVE_PAIRS[2]], axis=1)
        return cls(tangents, seconds, np.sqrt(np.linalg.det(metric)), inverse, christoffel)

    def covector(self, normal: Array) -> Array:
        """Normal of an edge in the plane, (directions, elements, points of one), as c_α.

        Shape (directions, points), of any length.
        """
        flat = normal.reshape(len(normal), -1)
        return flat if self.inverse is None else np.einsum("aip,ap->ip", self.inverse, flat)

    def gradient(self, field: Array) -> Array:
        """u;α from u,a, shape (directions, elements, points of one)."""
        if self.inverse is None:
            return field
        return np.einsum("aiep,aep->iep", self.inverse.reshape(2, 2, *field.shape[1:]), field)

    def hessian(self, gradient: Array, hessian: Array) -> list[Array]:
        """u;αβ for αβ in :data:`DERIVATIVE_PAIRS`, from u,a and u,ab."""
        pairs = DERIVATIVE_PAIRS[len(gradient)]
        if self.inverse is None or self.christoffel is None:
            return [hessian[a, b] for a, b in pairs]
        shape = gradient.shape[1:]
        inv = self.inverse.reshape(2, 2, *shape)
        christoffel = self.christoffel.reshape(2, 2, 2, *shape)
        covariant = hessian - np.einsum("cabep,cep->abep", christoffel, gradient)
        return [np.einsum("aep,bep,abep->ep", inv[:, i], inv[:, j], covariant) for i, j in pairs]


def reference_surface(function: Callable[[Any, Any], Any]) -> ReferenceSurface:
    """A reference surface R(x, y).

    Parameters
    ----------
    function : callable
        ``function(x, y)`` of arrays (points,) → R, (3, points), written in numpy.

    Examples
    --------
    >>> cylinder = reference_surface(lambda x, y: np.stack([x, 2.0 * np.sin(y), 2.0 * np.cos(y)]))
    >>> float(cylinder(np.zeros((2, 1))).seconds[2, 1, 1, 0])
    -2.0
    """

    def jet(points: Array) -> Jet:
        (x, y), zero = points, np.zeros_like(points[0])
        ways = [([x, dx + zero, zero], [y, dy + zero, zero]) for dx, dy in ((1, 0), (0, 1), (1, 1))]
        along, across, both = (taylor_series(function, *way) for way in ways)
        mixed = both[2] - along[2] - across[2]
        seconds = np.stack([[2.0 * along[2], mixed], [mixed, 2.0 * across[2]]])
        tangents = np.stack([along[1], across[1]], axis=1)
        return Jet(along[0], tangents, seconds.transpose(2, 0, 1, 3))

    return jet
