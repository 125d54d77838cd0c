"""C1 elements that stay exact far from the origin."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import perm, prod
from typing import Any

import numpy as np
from skfem.element import DiscreteField, ElementLineHermite, ElementQuadBFS, ElementTriArgyris
from skfem.element.element_global import ElementGlobal

from anmstrip.arrays import Array

Orders = tuple[int, ...]
"""Directions of a derivative one after the other: () value, (0,) d/dx, (0, 1) d²/dx dy."""


class CentredMixin(ElementGlobal):
    """Mixin for scikit-fem's :class:`ElementGlobal`: local coordinates (x − c)/h.

    c is the mean of an element's vertices, h its extent in each direction.  Basis function
    i is Σ_m V_mi X^m with the inverse V of the matrix of all monomials X^m under
    all degrees of freedom.  An object serves one mesh.
    """

    V: Any = None
    ready: tuple[tuple[Any, Any], dict[int, DiscreteField]] = (None, None), {}  # for gbasis

    @property
    def highest(self) -> int:
        """Highest power of one coordinate."""
        return self.maxdeg // 2 if self.tensorial_basis else int(self.maxdeg)

    @property
    def exponents(self) -> list[tuple[int, ...]]:
        """Powers of the coordinates in every monomial."""
        every = np.ndindex(*(self.highest + 1,) * self.dim)
        return [e for e in every if self.tensorial_basis or sum(e) <= self.highest]

    @property
    def orders(self) -> list[Orders]:
        """Value, first and second derivatives."""
        return [orders for k in range(3) for orders in np.ndindex(*(self.dim,) * k)]

    def _eval_dofs(self, mesh: Any, tind: Any = None) -> Array:
        """Local monomials under the degrees of freedom, shape (elements, dofs, monomials)."""
        corners = mesh.p[:, mesh.t].swapaxes(0, 1)
        self.centre, self.extent = corners.mean(axis=0), np.ptp(corners, axis=0)
        places = {"v": (corners - self.centre) / self.extent}
        if self.facet_dofs:
            middles, places["n"] = facet_normals(mesh)
            places["e"] = (middles - self.centre) / self.extent
        size = len(self.exponents)
        dofs = np.empty((mesh.t.shape[1], size, size))
        for j, exponents in enumerate(self.exponents):
            monomial = {orders: self._derivative(exponents, orders) for orders in self.orders}
            for i in range(size):
                dofs[:, i, j] = self.gdof(monomial, places, i)
        return dofs

    def _derivative(self, exponents: tuple[int, ...], orders: Orders) -> Callable[..., Array]:
        """Physical derivative of a monomial as a function of local coordinates."""
        scale = np.prod(self.extent[list(orders)], axis=0)
        return lambda *x: (
            differentiate([exponents], orders, powers(np.stack(x), self.highest))[0] / scale
        )

    def gbasis(self, mapping: Any, X: Array, i: int, tind: Any = None) -> Any:
        """Value, gradient and Hessian of basis function ``i`` at reference points.

        All are found at once, when the first is asked for, and then given away one by one.
        """
        (points, elements), found = self.ready
        if points is not X or elements is not tind or i not in found:
            found = dict(enumerate(self._fields(mapping, X, tind)))
            self.ready = (X, tind), found
        return (found.pop(i),)

    def _fields(self, mapping: Any, X: Array, tind: Any) -> Iterator[DiscreteField]:
        """Yield all basis functions at reference points."""
        if self.V is None:
            self.V = inverse(self._eval_dofs(mapping.mesh))
        chosen = np.arange(mapping.mesh.t.shape[1]) if tind is None else tind
        centre, extent = self.centre[:, chosen, None], self.extent[:, chosen, None]
        table = powers((mapping.F(X, tind=chosen) - centre) / extent, self.highest)
        weights, known = self.V[chosen].swapaxes(1, 2), dict[Orders, Array]()
        for orders in self.orders:
            if (mirrored := tuple(sorted(orders))) not in known:
                monomials = differentiate(self.exponents, orders, table).swapaxes(0, 1)
                scale = np.prod(extent[list(orders)], axis=0)
                known[orders] = (weights @ monomials).swapaxes(0, 1) / scale
            known[orders] = known[mirrored]
        for i in range(weights.shape[1]):
            parts = [
                np.reshape([known[o][i] for o in self.orders if len(o) == k], shape)
                for k, shape in enumerate([(self.dim,) * k + table.shape[2:] for k in range(3)])
            ]
            yield DiscreteField(value=parts[0], grad=parts[1], hess=parts[2])


def inverse(dofs: Array) -> Array:
    """Inverses of matrices whose rows have units of their own, which must not choose pivots."""
    units = np.abs(dofs).max(axis=2, keepdims=True)
    return np.linalg.inv(dofs / units) / units.swapaxes(1, 2)


def powers(x: Array, highest: int) -> Array:
    """x^0, x^1, ... of coordinates, shape (highest + 1, dimensions, ...)."""
    table = np.ones((highest + 1, *x.shape))
    for k in range(highest):
        table[k + 1] = table[k] * x
    return table


def differentiate(exponents: Sequence[tuple[int, ...]], orders: Orders, table: Array) -> Array:
    """Derivatives of monomials from the powers of their coordinates, shape (monomials, ...)."""
    factors = []
    for d, powers_of in enumerate(zip(*exponents, strict=True)):
        count = orders.count(d)
        falling = np.array([perm(e, count) for e in powers_of])
        lowered = table[np.maximum(np.array(powers_of) - count, 0), d]
        factors.append(lowered * falling.reshape(-1, *(1,) * (lowered.ndim - 1)))
    return np.asarray(prod(factors))


def facet_normals(mesh: Any) -> tuple[Array, Array]:
    """Middles and unit normals of the facets of all triangles, as scikit-fem directs them.

    A normal is outward on the boundary; inside, it lies to the right of the way from the
    node of higher to the node of lower number, so that neighbours agree.

    Returns
    -------
    middles, normals : ndarray, shape (3, 2, elements)
        Facets in scikit-fem's order: between the vertices 0 and 1, 1 and 2, 0 and 2.
    """
    ends = mesh.p[:, mesh.facets]
    along = ends[:, 0] - ends[:, 1]
    normals = np.stack([along[1], -along[0]]) / np.linalg.norm(along, axis=0)
    middles = ends.mean(axis=1)
    boundary = mesh.boundary_facets()
    inside = mesh.p[:, mesh.t[:, mesh.f2t[0, boundary]]].mean(axis=1)
    outwards = np.sum(normals[:, boundary] * (middles[:, boundary] - inside), axis=0)
    normals[:, boundary] *= np.sign(outwards)
    return middles[:, mesh.t2f].swapaxes(0, 1), normals[:, mesh.t2f].swapaxes(0, 1)


class BognerFoxSchmit(CentredMixin, ElementQuadBFS):
    """Bicubic C1 element on axis-aligned rectangles: u, u_x, u_y, u_xy at the nodes."""


class Argyris(CentredMixin, ElementTriArgyris):
    """Quintic C1 element on triangles (Argyris, Fried, Scharpf, 1968).

    At the nodes u, u_x, u_y, u_xx, u_xy, u_yy; in the middles of the facets the derivative
    along the normal of :func:`facet_normals`.
    """


class Hermite(CentredMixin, ElementLineHermite):
    """Cubic C1 element on lines: u, u_x at the nodes."""
