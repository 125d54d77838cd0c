"""Operators between degrees of freedom and quadrature points, and sparse matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix

from anmstrip.arrays import Array, Index
from anmstrip.fem.strip import Strip
from anmstrip.linalg.bordered import Bordered


@dataclass
class Blocks:
    """Entries of a tangent, to which every effect adds its own."""

    pairs: Array  # (components, components, couplings): row component, column component, coupling
    columns: Array  # (unknowns of the strip, others): a full column for each other unknown
    rows: Array  # (others, unknowns of the strip)
    corner: Array  # (others, others)


class Pattern:
    """Sparsity of the tangent, fixed: couplings of scalars, for all pairs of components."""

    def __init__(self, strip: Strip) -> None:
        self.scalars, self.count = strip.scalars, strip.count
        dofs = strip.basis.element_dofs.astype(np.int64)  # their pairs are numbered below
        row, column = (x.ravel() for x in np.broadcast_arrays(dofs[:, None, :], dofs[None, :, :]))
        keys, self.places = np.unique(column * self.scalars + row, return_inverse=True)
        local = self.places.reshape(len(dofs), len(dofs), -1)
        self.cells = np.ascontiguousarray(local.transpose(2, 0, 1)).reshape(local.shape[2], -1)
        self.places = self.cells.ravel()
        self.column, self.row = np.divmod(keys, self.scalars)

    @property
    def couplings(self) -> int:
        """Number of coupled pairs of scalars."""
        return len(self.row)

    def zeros(self, others: int = 0) -> Blocks:
        """Empty blocks; others is the number of unknowns besides those of the strip."""
        n, pairs = self.count * self.scalars, (self.count, self.count, self.couplings)
        shapes = pairs, (n, others), (others, n), (others, others)
        return Blocks(*(np.zeros(shape) for shape in shapes))

    def sum_of_rows(self, weights: Array, blocks: Blocks) -> Array:
        """Weighted sum of the rows of the strip's unknowns, shape (unknowns of the strip,)."""
        each = weights.reshape(-1, self.count)[self.row]
        summed = np.einsum("ni,ijn->jn", each, blocks.pairs)
        columns = [np.bincount(self.column, each, self.scalars) for each in summed]
        return np.ravel(np.stack(columns, axis=1))

    def restricted(self, free: Index) -> Restriction:
        """Maker of sparse matrices over the free unknowns."""
        return Restriction(self, free)


class Restriction:
    """Blocks to a sparse matrix over the free unknowns; the pattern is found once."""

    def __init__(self, pattern: Pattern, free: Index) -> None:
        m = pattern.count
        n = m * pattern.scalars
        self.others, free = free[free >= n] - n, free[free < n]
        self.free = free
        i, j = np.mgrid[:m, :m][:, :, :, None]
        rows, columns = m * pattern.row + i, m * pattern.column + j
        numbers = np.arange(1, m * m * pattern.couplings + 1, dtype=float)
        full = coo_matrix((numbers, (rows.ravel(), columns.ravel())), shape=(n, n)).tocsc()
        part = full[:, free].tocsr()[free].tocsc()
        part.sort_indices()
        self.shape = part.shape
        self.indices, self.indptr = part.indices, part.indptr
        self.source = part.data.astype(np.int64) - 1

    def matrix(self, blocks: Blocks) -> csc_matrix | Bordered:
        """Tangent over the free unknowns, shape (free, free)."""
        data = blocks.pairs.reshape(-1)[self.source]
        inner = csc_matrix((data, self.indices, self.indptr), shape=self.shape)
        if not len(self.others):
            return inner
        columns, rows = blocks.columns[np.ix_(self.free, self.others)], blocks.rows[self.others]
        return Bordered(
            inner, columns, rows[:, self.free], blocks.corner[np.ix_(self.others, self.others)]
        )


@dataclass(frozen=True)
class Part:
    """Rows of an operator that are the same matrix for several components.

    Of the components c of one kind, row + k step + c stride is the k-th derivative.
    """

    matrix: csr_matrix  # (derivatives · points, scalars)
    weights: Array  # (derivatives · points,)
    first: int = 0  # unknown
    count: int = 1  # components
    row: int = 0
    step: int = 1
    stride: int = 1


class CellOperator:
    """Derivatives at quadrature points of elements, along the reference's directions.

    Parameters
    ----------
    strip : Strip
    orders : sequence of int
        0 for the value, 1 for first, 2 for second derivatives (xx, yy, xy; of a section xx).
    basis : skfem basis, optional
        Whose quadrature it is: all elements by default, those along an edge for a
        ``FacetBasis``.
    """

    def __init__(self, strip: Strip, orders: Sequence[int], basis: Any = None) -> None:
        quadrature = strip.basis if basis is None else basis
        frames = strip.frames(basis)
        rows = []
        for (field,) in quadrature.basis:
            gradient = np.asarray(field.grad)
            parts: list[list[Array]] = [[np.asarray(field)], [*frames.gradient(gradient)], []]
            if 2 in orders:
                parts[2] = frames.hessian(gradient, field.hess)
            rows.append([part for order in orders for part in parts[order]])
        fields = np.array(rows)
        self.count = strip.count
        self.local, self.components, self.elements, self.per_element = fields.shape
        table = fields.transpose(2, 1, 3, 0).reshape(self.elements, -1, self.local)
        self.table: Array = np.ascontiguousarray(table)
        self.weights: Array = strip.weights(quadrature).ravel()
        each = np.tile(self.weights.reshape(self.elements, -1), self.components)
        self.weighted: Array = np.ascontiguousarray(table.swapaxes(1, 2) * each[:, None])
        self.dofs = np.ascontiguousarray(quadrature.element_dofs.T)
        self.cells: Index | None = None if basis is None else np.asarray(basis.tind)
        entries = np.ones(self.dofs.size)
        index = (self.dofs.ravel(), np.arange(self.dofs.size))
        self.sum = csr_matrix((entries, index), shape=(strip.scalars, self.dofs.size))

    @property
    def points(self) -> int:
        """Number of quadrature points."""
        return self.elements * self.per_element

    def apply(self, full: Array) -> Array:
        """Derivatives of the unknown components, shape (count, components, points)."""
        values = (
            self.table @ full[: self.sum.shape[0] * self.count].reshape(-1, self.count)[self.dofs]
        )
        values = values.reshape(self.elements, self.components, self.per_element, self.count)
        return values.transpose(3, 1, 0, 2).reshape(self.count, self.components, -1)

    @cached_property
    def matrices(self) -> tuple[list[Part], list[Part]]:
        """L as sparse matrices, and that of which forces are the transposed."""
        table = self.table.reshape(self.elements, self.components, self.per_element, self.local)
        rows = table.swapaxes(0, 1).reshape(-1, self.local)
        columns = np.repeat(self.dofs, self.per_element, axis=0).ravel()
        starts = np.arange(0, rows.size + 1, self.local)
        index = (np.tile(columns, self.components), starts)
        matrix = csr_matrix((rows.ravel(), *index), shape=(len(rows), self.sum.shape[0]))
        weights = np.tile(self.weights, self.components)
        parts = [Part(matrix, weights, count=self.count, stride=self.components)]
        return parts, parts

    def gather(self, forces: Array) -> Array:
        """Generalised forces of point forces, shape (count, components, points) → (unknowns,)."""
        each = forces.reshape(self.count, self.components, self.elements, -1)
        columns = each.transpose(2, 1, 3, 0).reshape(self.elements, -1, self.count)
        return (self.sum @ (self.weighted @ columns).reshape(-1, self.count)).ravel()

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L.

        Parameters
        ----------
        derivative : ndarray, shape (count, components, count, components, points)
            J[j, b, i, a]: change of force (i, a) with derivative (j, b).
        """
        m, k = self.count, self.components
        each = derivative.reshape(m, k, m, k, self.elements, -1)
        table = self.table.reshape(self.elements, k, self.per_element, self.local)
        for i in range(m):
            for j in range(m):
                middle = np.einsum("baeq,ebqn->eaqn", each[j, :, i], table)
                local = self.weighted @ middle.reshape(self.elements, -1, self.local)
                self._add(local, pattern, blocks.pairs[i, j])

    def add_bilinear(self, matrix: Array, pattern: Pattern, block: Array) -> None:
        """Add Lᵀ w M L, one constant M (components, components), to one block of scalars."""
        table = self.table.reshape(self.elements, self.components, self.per_element, self.local)
        middle = np.einsum("ab,ebqn->eaqn", matrix, table)
        self._add(self.weighted @ middle.reshape(self.table.shape), pattern, block)

    def _add(self, local: Array, pattern: Pattern, block: Array) -> None:
        """Sum element matrices (elements, row, column) into a block."""
        places = pattern.places if self.cells is None else pattern.cells[self.cells].ravel()
        block += np.bincount(places, local.ravel(), pattern.couplings)
