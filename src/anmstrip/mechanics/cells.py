"""Linear operators from degrees of freedom to points, and back.

Effects see the strip through these: a cell operator gives derivatives at
quadrature points, a contact operator gives values at surface points.  Each can apply
itself, gather point forces into generalised forces (its transpose with
weights), and add Lᵀ w J L to a tangent.
"""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix
from skfem.element import DiscreteField

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


SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0


class ContactOperator:
    """Values at the points where contact is looked at, with areas as weights.

    The points are nodes, middles of sides and centres of the elements, the weights
    Simpson's.  Nodes alone would leave a cubic element free to bow into the roller
    between them: on two elements across, the pressure of a wrapped strip was off
    by half of its value.

    Attributes
    ----------
    cells : ndarray of int, shape (elements, 9)
        Points of each element, number i + 3 j of its grid.
    reference : ndarray, shape (3, points)
        Reference positions.
    weights : ndarray, shape (points,)
        Area that belongs to each point (m²).
    chosen : ndarray of int, shape (points,)
        Their numbers in the whole strip.
    """

    def __init__(self, strip: Strip) -> None:
        basis = strip.basis
        self.cells, self.reference, functions = patches(strip, 3)
        self.chosen: Index = np.arange(self.reference.shape[1], dtype=np.int64)
        self.table: Array = np.stack([np.asarray(f) for f in functions], axis=-1)
        shares = np.outer(SIMPSON, SIMPSON).ravel()
        self.shares = np.prod(strip.cell_sizes, axis=0)[:, None] * shares
        total = np.bincount(self.cells.ravel(), self.shares.ravel())
        self.weights: Array = total.astype(float)
        first = np.unique(self.cells, return_index=True)[1]
        rows = self.table.reshape(-1, basis.Nbfun)[first]
        columns = np.repeat(basis.element_dofs.T, len(shares), axis=0)[first]
        index = (np.repeat(self.chosen, basis.Nbfun), columns.ravel())
        self.matrix = csr_matrix((rows.ravel(), index), shape=(len(first), strip.scalars))
        self.matrix.eliminate_zeros()
        self.transposed = self.matrix.T.tocsr()

    def restricted(self, points: Index) -> ContactOperator:
        """The same on some of the points; it keeps the cells of all."""
        if len(points) == len(self.chosen):
            return self
        part = copy(self)
        part.chosen = self.chosen[points]
        part.reference, part.weights = self.reference[:, points], self.weights[points]
        part.matrix = self.matrix[points]
        part.transposed = part.matrix.T.tocsr()
        return part

    @property
    def points(self) -> int:
        """Number of points."""
        return len(self.weights)

    def apply(self, full: Array) -> Array:
        """Values of the three components, shape (3, points)."""
        return np.ascontiguousarray((self.matrix @ full.reshape(-1, 3)).T)

    def gather(self, forces: Array) -> Array:
        """Generalised forces of forces per area, shape (3, points) → (unknowns,)."""
        return (self.transposed @ (forces * self.weights).T).ravel()

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Array) -> None:
        """Add Lᵀ w J L, J[j, i] of shape (3, 3, points), over the cells of these points."""
        every = np.zeros((3, 3, self.cells.max() + 1))
        every[:, :, self.chosen] = derivative
        active = np.abs(every).max(axis=(0, 1)) > 0.0
        near = np.flatnonzero(active[self.cells].any(axis=1))
        table, places = self.table[near], pattern.places.reshape(len(self.cells), -1)[near].ravel()
        transposed = np.ascontiguousarray(table.swapaxes(1, 2))
        weighted = every[:, :, self.cells[near]] * self.shares[near]
        for i in range(3):
            for j in range(3):
                local = transposed @ (weighted[j, i][:, :, None] * table)
                blocks[i, j] += np.bincount(places, local.ravel(), pattern.couplings)


def patches(strip: Strip, n: int) -> tuple[Index, Array, list[DiscreteField]]:
    """Grids of n × n points on every element, shared between neighbours.

    Returns
    -------
    cells : ndarray of int, shape (elements, n²)
        Points of each element, number i + n j of its grid.
    reference : ndarray, shape (3, points)
        Reference positions.
    functions : list of DiscreteField
        Every basis function on the grids, each (elements, n²).
    """
    basis = strip.basis
    local = unit_grid(n)
    cells, points = joined(basis.mapping.F(local), strip)
    functions = [basis.elem.gbasis(basis.mapping, local, i)[0] for i in range(basis.Nbfun)]
    return cells, np.vstack([points, np.zeros(points.shape[1])]), functions


def unit_grid(n: int) -> Array:
    """n × n grid of the unit square, number i + n j, shape (2, n²)."""
    steps = np.linspace(0.0, 1.0, n)
    return np.stack([x.ravel() for x in np.meshgrid(steps, steps)])


def joined(grid: Array, strip: Strip) -> tuple[Index, Array]:
    """Number the points of element grids so that neighbours share them.

    Parameters
    ----------
    grid : ndarray, shape (2, elements, points of one)
    strip : Strip

    Returns
    -------
    cells : ndarray of int, shape (elements, points of one)
    points : ndarray, shape (2, points)
    """
    unit = 1e-6 * strip.cell_sizes.min()
    flat = grid.reshape(2, -1)
    keys = np.round((flat - flat.min(axis=1)[:, None]) / unit).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=1, return_index=True, return_inverse=True)
    return inverse.reshape(grid.shape[1:]), flat[:, first]
