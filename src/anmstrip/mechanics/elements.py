"""C1 elements that stay exact far from the origin.

scikit-fem builds its globally defined elements from monomials of the global
coordinates, which loses digits like (distance / element size)³.  Here the same
elements are built from monomials about each element's own centre, in units of
its own size.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem.element import DiscreteField, ElementQuadBFS
from skfem.element.element_global import ElementGlobal

Array = NDArray[np.float64]


class CentredMixin(ElementGlobal):
    """Mixin for scikit-fem's :class:`ElementGlobal`: local coordinates (x − c)/h.

    c is the mean of an element's vertices, h its extent in each direction.
    """

    V: Any = None

    def _eval_dofs(self, mesh: Any, tind: Any = None) -> Array:
        """Local monomials under the degrees of freedom, shape (elements, dofs, monomials)."""
        corners = mesh.p[:, mesh.t].swapaxes(0, 1)
        self.centre = corners.mean(axis=0)
        self.extent = np.ptp(corners, axis=0)
        places = {"v": (corners - self.centre) / self.extent}
        size = len(self._pbasis[()])
        dofs = np.empty((mesh.t.shape[1], size, size))
        for j in range(size):
            monomials = {diff: self._scaled(self._pbasis[diff][j], diff) for diff in self._pbasis}
            for i in range(size):
                dofs[:, i, j] = self.gdof(monomials, places, i)
        return dofs

    def _scaled(self, monomial: Any, diff: tuple[int, ...]) -> Any:
        factor = np.prod([self.extent[d] for d in diff], axis=0) if diff else 1.0
        return lambda *x: monomial(*x) / factor

    def gbasis(self, mapping: Any, X: Array, i: int, tind: Any = None) -> Any:
        """Value, gradient and Hessian of basis function ``i`` at reference points."""
        if self.V is None:
            self._pbasis_init(self.maxdeg, self.dim, self.derivatives, self.tensorial_basis)
            self.V = np.linalg.inv(self._eval_dofs(mapping.mesh))
        chosen = np.arange(mapping.mesh.t.shape[1]) if tind is None else tind
        centre, extent = self.centre[:, chosen, None], self.extent[:, chosen, None]
        x = (mapping.F(X, tind=chosen) - centre) / extent
        weights = self.V[chosen, :, i]
        parts: list[Array] = []
        for k in range(3):
            part = np.zeros((self.dim,) * k + x[0].shape)
            for diff in np.ndindex(*(self.dim,) * k):
                factor = np.prod([extent[d] for d in diff], axis=0) if diff else 1.0
                for weight, monomial in zip(weights.T, self._pbasis[diff], strict=True):
                    part[diff] += weight[:, None] * monomial(*x)
                part[diff] /= factor
            parts.append(part)
        return (DiscreteField(value=parts[0], grad=parts[1], hess=parts[2]),)


class BognerFoxSchmit(CentredMixin, ElementQuadBFS):
    """Bicubic C1 element on axis-aligned quadrilaterals."""
