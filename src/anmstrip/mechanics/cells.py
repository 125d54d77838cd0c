"""Linear operators from degrees of freedom to points, and back.

Effects see the strip through these: a cell operator gives derivatives at
quadrature points, a node operator gives values at mesh nodes.  Each can apply
itself, gather point forces into generalised forces (its transpose with
weights), and add Lᵀ w J L to a tangent.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix

from .strip import Strip

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Pattern:
    """Sparsity of the tangent, fixed: couplings of scalars, three by three components.

    ``blocks`` arrays have the shape (3, 3, couplings): row component, column
    component, coupling.
    """

    def __init__(self, strip: Strip) -> None:
        self.scalars = strip.scalars
        dofs = strip.basis.element_dofs
        row, column = (x.ravel() for x in np.broadcast_arrays(dofs[:, None, :], dofs[None, :, :]))
        keys, self.places = np.unique(column * self.scalars + row, return_inverse=True)
        local = self.places.reshape(len(dofs), len(dofs), -1)
        self.places = np.ascontiguousarray(local.transpose(2, 0, 1)).ravel()
        self.column, self.row = np.divmod(keys, self.scalars)

    @property
    def couplings(self) -> int:
        """Number of coupled pairs of scalars."""
        return len(self.row)

    def zeros(self) -> Array:
        """Empty blocks."""
        return np.zeros((3, 3, self.couplings))

    def diagonal(self, scalars: Index) -> Index:
        """Couplings of the given scalars with themselves."""
        return np.searchsorted(self.column * self.scalars + self.row, scalars * (self.scalars + 1))

    def restricted(self, free: Index) -> Restriction:
        """Maker of sparse matrices over the free unknowns."""
        return Restriction(self, free)


class Restriction:
    """Blocks to a sparse matrix over the free unknowns; the pattern is found once."""

    def __init__(self, pattern: Pattern, free: Index) -> None:
        n = 3 * pattern.scalars
        i, j = np.mgrid[:3, :3][:, :, :, None]
        rows, columns = 3 * pattern.row + i, 3 * pattern.column + j
        numbers = np.arange(1, 9 * pattern.couplings + 1, dtype=float)
        full = coo_matrix((numbers, (rows.ravel(), columns.ravel())), shape=(n, n)).tocsc()
        part = full[:, free].tocsr()[free].tocsc()
        part.sort_indices()
        self.shape = part.shape
        self.indices, self.indptr = part.indices, part.indptr
        self.source = part.data.astype(np.int64) - 1

    def matrix(self, blocks: Array) -> csc_matrix:
        """Tangent over the free unknowns, shape (free, free)."""
        data = blocks.reshape(-1)[self.source]
        return csc_matrix((data, self.indices, self.indptr), shape=self.shape)


class CellOperator:
    """Derivatives of the basis at the quadrature points of all elements.

    Parameters
    ----------
    strip : Strip
    derivatives : sequence of ndarray, each (dofs per element, elements, points per element)
        One array for each component of the derivative.
    """

    def __init__(self, strip: Strip, derivatives: list[Array]) -> None:
        basis = np.stack(derivatives)
        self.components, self.local, self.elements, self.per_element = basis.shape
        table = basis.transpose(2, 0, 3, 1).reshape(self.elements, -1, self.local)
        self.table: Array = np.ascontiguousarray(table)
        self.transposed: Array = np.ascontiguousarray(table.swapaxes(1, 2))
        self.weights: Array = strip.basis.dx.ravel()
        self.dofs = np.ascontiguousarray(strip.basis.element_dofs.T)
        entries = np.ones(self.dofs.size)
        index = (self.dofs.ravel(), np.arange(self.dofs.size))
        self.sum = csr_matrix((entries, index), shape=(strip.scalars, self.dofs.size))

    @property
    def points(self) -> int:
        """Number of quadrature points."""
        return self.elements * self.per_element

    def apply(self, full: Array) -> Array:
        """Derivatives of the three components, shape (3, components, points)."""
        values = self.table @ full.reshape(-1, 3)[self.dofs]
        values = values.reshape(self.elements, self.components, self.per_element, 3)
        return values.transpose(3, 1, 0, 2).reshape(3, self.components, -1)

    def gather(self, forces: Array) -> Array:
        """Generalised forces of point forces, shape (3, components, points) → (unknowns,)."""
        weighted = (forces * self.weights).reshape(3, self.components, self.elements, -1)
        local = self.transposed @ weighted.transpose(2, 1, 3, 0).reshape(self.elements, -1, 3)
        return (self.sum @ local.reshape(-1, 3)).ravel()

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Array) -> None:
        """Add Lᵀ w J L.

        Parameters
        ----------
        derivative : ndarray, shape (3, components, 3, components, points)
            J[j, b, i, a]: change of force (i, a) with derivative (j, b).
        """
        shape = (3, self.components, 3, self.components, self.elements, self.per_element)
        weighted = (derivative * self.weights).reshape(shape)
        table = self.table.reshape(self.elements, self.components, self.per_element, self.local)
        for i in range(3):
            for j in range(3):
                middle = np.einsum("baeq,ebqn->eaqn", weighted[j, :, i], table)
                local = self.transposed @ middle.reshape(self.elements, -1, self.local)
                self._add(local, pattern, blocks[i, j])

    def add_bilinear(self, matrix: Array, pattern: Pattern, block: Array) -> None:
        """Add Lᵀ w M L, one constant M (components, components), to one block of scalars."""
        weights = self.weights.reshape(self.elements, 1, self.per_element, 1)
        table = self.table.reshape(self.elements, self.components, self.per_element, self.local)
        middle = np.einsum("ab,ebqn->eaqn", matrix, table) * weights
        self._add(self.transposed @ middle.reshape(self.table.shape), pattern, block)

    def _add(self, local: Array, pattern: Pattern, block: Array) -> None:
        """Sum element matrices (elements, row, column) into a block."""
        block += np.bincount(pattern.places, local.ravel(), pattern.couplings)


class NodeOperator:
    """Values at mesh nodes, with areas as weights."""

    def __init__(self, strip: Strip, pattern: Pattern) -> None:
        self.values = strip.node_values
        self.unknowns = strip.unknowns
        self.weights = strip.tributary_areas
        self.diagonal = pattern.diagonal(self.values)

    @property
    def points(self) -> int:
        """Number of nodes."""
        return len(self.values)

    def apply(self, full: Array) -> Array:
        """Values of the three components, shape (3, nodes)."""
        return np.ascontiguousarray(full.reshape(-1, 3)[self.values].T)

    def gather(self, forces: Array) -> Array:
        """Generalised forces of forces per area, shape (3, nodes) → (unknowns,)."""
        total = np.zeros((self.unknowns // 3, 3))
        total[self.values] = (forces * self.weights).T
        return total.ravel()

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Array) -> None:
        """Add Lᵀ w J L, J[j, i] of shape (3, 3, nodes)."""
        blocks[:, :, self.diagonal] += (derivative * self.weights).swapaxes(0, 1)
