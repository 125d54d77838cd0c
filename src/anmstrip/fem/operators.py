"""Operators between degrees of freedom and quadrature points, and sparse matrices."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, eye, kron

from anmstrip.arrays import Array, Index
from anmstrip.fem.strip import Strip
from anmstrip.linalg.direct import SingularTangentError
from anmstrip.linalg.solvers import WIDEST_BORDER, Bordered
from anmstrip.taylor.program import COMPILED


@dataclass
class Blocks:
    """Entries of a tangent, to which every effect adds its own."""

    pairs: Array  # (components, components, couplings): row component, column component, coupling
    strip: int  # unknowns of the strip
    others: int  # unknowns that follow these
    internal: Eliminated | Chained | None = None  # unknowns of points' own
    border: list[tuple[Index, Index, Array]] = dataclasses.field(default_factory=list)

    def add(self, rows: Any, columns: Any, values: Array) -> None:
        """Add entries of rows and columns of other unknowns, by the numbers of the unknowns."""
        row, column, value = np.broadcast_arrays(rows, columns, values)
        self.border.append((row.ravel(), column.ravel(), value.ravel()))

    @property
    def entries(self) -> tuple[Index, Index, Array]:
        """Rows, columns and values of all that was added; what stands at one place adds up."""
        none = np.zeros(0, dtype=np.int64)
        rows, columns, values = zip((none, none, np.zeros(0)), *self.border, strict=True)
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)


class Pattern:
    """Sparsity of the tangent, fixed: couplings of scalars, for all pairs of components.

    Attributes
    ----------
    couplings : int
        Number of coupled pairs of scalars.
    """

    def __init__(self, strip: Strip) -> None:
        self.scalars, self.count = strip.scalars, strip.count
        dofs = strip.basis.element_dofs.astype(np.int64)  # their pairs are numbered below
        row, column = (x.ravel() for x in np.broadcast_arrays(dofs[:, None, :], dofs[None, :, :]))
        keys, self.places = np.unique(column * self.scalars + row, return_inverse=True)
        local = self.places.reshape(len(dofs), len(dofs), -1)
        self.cells = np.ascontiguousarray(local.transpose(2, 0, 1)).reshape(local.shape[2], -1)
        self.places = self.cells.ravel()
        self.column, self.row = (x.astype(np.int32) for x in np.divmod(keys, self.scalars))
        self.couplings = len(keys)
        self.restrictions: dict[bytes, Restriction] = {}

    def zeros(self, others: int = 0) -> Blocks:
        """Empty blocks; others is the number of unknowns besides those of the strip."""
        pairs = np.zeros((self.count, self.count, self.couplings))
        return Blocks(pairs, self.count * self.scalars, others)

    def sum_of_rows(self, weights: Array, blocks: Blocks) -> Array:
        """Weighted sum of the rows of the strip's unknowns, shape (unknowns of the strip,)."""
        each = weights.reshape(-1, self.count)[self.row]
        summed = np.einsum("ni,ijn->jn", each, blocks.pairs)
        columns = [np.bincount(self.column, each, self.scalars) for each in summed]
        return np.ravel(np.stack(columns, axis=1))

    def restricted(self, free: Index) -> Restriction:
        """Maker of sparse matrices over the free unknowns, remembered."""
        key = free.tobytes()
        if key not in self.restrictions:
            self.restrictions[key] = Restriction(self, free)
        return self.restrictions[key]


class Restriction:
    """Blocks to a sparse matrix over the free unknowns; the pattern is found once."""

    def __init__(self, pattern: Pattern, free: Index) -> None:
        m = pattern.count
        n = m * pattern.scalars
        self.chosen, free = free, free[free < n]
        place = np.full(n, -1, dtype=np.int32)
        place[free] = np.arange(len(free))
        i, j = np.mgrid[:m, :m].astype(np.int32)[:, :, :, None]
        rows, columns = place[m * pattern.row + i].ravel(), place[m * pattern.column + j].ravel()
        numbers = np.flatnonzero((rows >= 0) & (columns >= 0))
        entries = numbers, (rows[numbers], columns[numbers])
        self.part = coo_matrix(entries, shape=(len(free), len(free))).tocsc()
        self.part.sort_indices()
        self.source = self.part.data

    def matrix(self, blocks: Blocks) -> csc_matrix | Bordered:
        """Tangent over the free unknowns, shape (free, free)."""
        inner = copy(self.part)  # a new one would be checked, for longer than it takes to make
        inner.data = blocks.pairs.reshape(-1)[self.source]
        n = inner.shape[0]
        m = len(self.chosen) - n
        if not m:
            return inner
        place = np.full(blocks.strip + blocks.others, -1)
        place[self.chosen] = np.arange(n + m)
        rows, columns, values = blocks.entries
        rows, columns = place[rows], place[columns]
        right, below = (rows >= 0) & (columns >= n), (rows >= n) & (columns >= 0) & (columns < n)
        last = assemble_entries(columns[right] - n, rows[right], values[right], (m, n + m)).T
        first = assemble_entries(rows[below] - n, columns[below], values[below], (m, n))
        corner = last[n:] if isinstance(last, np.ndarray) else last[n:].toarray()
        return Bordered(inner, last[:n], first, corner)


def assemble_entries(rows: Index, columns: Index, values: Array, shape: tuple[int, int]) -> Any:
    """Return entries as a matrix, full unless it is wider than a border is eliminated with."""
    if min(shape) > WIDEST_BORDER:
        return csr_matrix((values, (rows, columns)), shape=shape)
    return np.bincount(rows * shape[1] + columns, values, shape[0] * shape[1]).reshape(shape)


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


@dataclass(eq=False)
class LinearOperator:
    """L, from unknowns to points, as its sparse matrices say.

    Attributes
    ----------
    points : int
    matrices : tuple of lists of Part
        L, its parts in the order of their rows, and that of which forces are the transposed.
    """

    points: int
    matrices: tuple[list[Part], list[Part]]

    def apply(self, full: Array) -> Array:
        """Return L u, shape (components, points)."""
        rows = []
        for part in self.matrices[0]:
            own = full[part.first : part.first + part.count * part.matrix.shape[1]]
            rows.append((part.matrix @ own.reshape(-1, part.count)).T)
        joined = rows[0] if len(rows) == 1 else np.vstack(rows)
        return np.ascontiguousarray(joined)  # or sums of some points round otherwise

    def gather(self, forces: Array) -> Array:
        """Return Lᵀ w f, (components, points) → (unknowns,)."""
        parts = self.matrices[1]
        total = np.zeros(max(part.first + part.count * part.matrix.shape[1] for part in parts))
        for part in parts:
            own = (forces[part.row : part.row + part.count] * part.weights).T
            found = (part.matrix.T @ own).ravel()
            total[part.first : part.first + len(found)] += found
        return total

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L, J[j, i] of shape (inputs, outputs, points), but for strip with strip.

        Parts of other unknowns have at most one entry at a point.
        """
        for out, given in product(*self.matrices[::-1]):
            if max(out.first, given.first) < blocks.strip:
                continue
            one, many = (given, out) if given.first >= blocks.strip else (out, given)
            point = np.repeat(np.arange(self.points), np.diff(many.matrix.indptr))
            entry = np.flatnonzero(np.diff(one.matrix.indptr)[point])
            point = point[entry]
            single = one.matrix.indptr[point]
            a, b = (entry, single) if one is given else (single, entry)
            i, j = np.arange(out.count)[:, None], np.arange(given.count)[:, None, None]
            rows = out.first + i + out.count * out.matrix.indices[a].astype(np.int64)
            columns = given.first + j + given.count * given.matrix.indices[b].astype(np.int64)
            weights = out.weights[point] * out.matrix.data[a] * given.matrix.data[b]
            blocks.add(rows, columns, derivative[given.row + j, out.row + i, point] * weights)


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
    symmetric : bool, optional
        Whether the laws between its derivatives and forces have a potential.

    Attributes
    ----------
    points : int
        Number of quadrature points.
    by_point : ndarray, shape (points, components, local)
        Derivatives of the local functions at every point.
    """

    def __init__(
        self, strip: Strip, orders: Sequence[int], basis: Any = None, symmetric: bool = False
    ) -> None:
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
        self.count, self.symmetric = strip.count, symmetric
        self.local, self.components, self.elements, self.per_element = fields.shape
        table = fields.transpose(2, 3, 1, 0).reshape(self.elements, -1, self.local)
        self.table: Array = np.ascontiguousarray(table)  # point by point
        self.points = self.elements * self.per_element
        self.by_point = self.table.reshape(-1, self.components, self.local)
        self.weights: Array = strip.weights(quadrature).ravel()
        each = np.repeat(self.weights, self.components).reshape(self.elements, -1)
        self.weighted: Array = np.ascontiguousarray(table.swapaxes(1, 2) * each[:, None])
        self.dofs = np.ascontiguousarray(quadrature.element_dofs.T)
        self.cells: Index | None = None if basis is None else np.asarray(basis.tind)
        entries = np.ones(self.dofs.size)
        index = (self.dofs.ravel(), np.arange(self.dofs.size))
        self.sum = csr_matrix((entries, index), shape=(strip.scalars, self.dofs.size))

    def apply(self, full: Array) -> Array:
        """Derivatives of the unknown components, shape (count, components, points)."""
        own = full[: self.sum.shape[0] * self.count].reshape(-1, self.count)
        by_point = (self.table @ own[self.dofs]).reshape(-1, self.components, self.count)
        return np.ascontiguousarray(by_point.transpose(2, 1, 0))

    @cached_property
    def matrices(self) -> tuple[list[Part], list[Part]]:
        """L as sparse matrices, and that of which forces are the transposed."""
        rows = self.by_point.swapaxes(0, 1).reshape(-1, self.local)
        columns = np.repeat(self.dofs, self.per_element, axis=0).ravel()
        index = (np.tile(columns, self.components), np.arange(0, rows.size + 1, self.local))
        matrix = csr_matrix((rows.ravel(), *index), shape=(len(rows), self.sum.shape[0]))
        weights = np.tile(self.weights, self.components)
        parts = [Part(matrix, weights, count=self.count, stride=self.components)]
        return parts, parts

    def gather(self, forces: Array) -> Array:
        """Generalised forces of point forces, shape (count, components, points) → (unknowns,)."""
        each = forces.reshape(self.count, self.components, -1)
        columns = each.transpose(2, 1, 0).reshape(self.elements, -1, self.count)
        return (self.sum @ (self.weighted @ columns).reshape(-1, self.count)).ravel()

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L.

        Parameters
        ----------
        derivative : ndarray, shape (count, components, count, components, points)
            J[j, b, i, a]: change of force (i, a) with derivative (j, b).
        """
        m, k = self.count, self.components
        if COMPILED:
            from anmstrip.taylor.compiled import add_blocks

            table = self.table.reshape(self.elements, self.per_element, k, self.local)
            places = pattern.cells if self.cells is None else pattern.cells[self.cells]
            rows = derivative.reshape(m * k * m * k, -1)
            add_blocks(table, self.weights, rows, places, blocks.pairs, self.symmetric)
            return
        for j, each in enumerate(derivative.reshape(m, k, m * k, -1)):
            middle = np.ascontiguousarray(each.transpose(2, 1, 0)) @ self.by_point
            middle = middle.reshape(-1, m, k, self.local)
            for i in range(m):
                local = self.weighted @ middle[:, i].reshape(self.table.shape)
                self._add(local, pattern, blocks.pairs[i, j])

    def add_elements(self, local: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add matrices of elements, shape (elements, count, local, count, local)."""
        for i, j in np.ndindex(self.count, self.count):
            self._add(local[:, i, :, j], pattern, blocks.pairs[i, j])

    def add_bilinear(self, matrix: Array, pattern: Pattern, block: Array) -> None:
        """Add Lᵀ w M L, one constant M (components, components), to one block of scalars."""
        middle = (matrix @ self.by_point).reshape(self.table.shape)
        self._add(self.weighted @ middle, pattern, block)

    def _add(self, local: Array, pattern: Pattern, block: Array) -> None:
        """Sum element matrices (elements, row, column) into a block."""
        places = pattern.places if self.cells is None else pattern.cells[self.cells].ravel()
        block += np.bincount(places, local.ravel(), pattern.couplings)


def upwind_differences(strip: Strip) -> csr_matrix:
    """Return backward differences along the strip, at its quadrature points, (points, points).

    Of a section, or of rectangles in rows: every line of points along the strip is a chain of its
    own.  Before the entry stands zero.  Of a flow law they make the backward Euler method along the
    strip, which for stress that hardly depends on the rate is a return to the yield surface at
    every point.
    """
    x, *across = np.asarray(strip.basis.global_coordinates()).reshape(strip.mesh.dim(), -1)
    y = np.round(across[0] / strip.width, 9) if across else np.zeros_like(x)
    order = np.lexsort((x, y))
    first = np.diff(y[order], prepend=np.inf) != 0.0
    steps = np.where(first, x[order] - strip.mesh.p[0].min(), np.diff(x[order], prepend=0.0))
    on = np.flatnonzero(~first)
    index = np.concatenate([order, order[on]]), np.concatenate([order, order[on - 1]])
    values = np.concatenate([1.0 / steps, -1.0 / steps[on]])
    return csr_matrix((values, index), shape=(len(x), len(x)))


@dataclass(frozen=True)
class Layers:
    """Points through the thickness at which fibres flow.

    Attributes
    ----------
    heights : ndarray, shape (layers,)
        ζ (m) above the middle.
    weights : ndarray, shape (layers,)
        m; their sum is the thickness.
    """

    heights: Array
    weights: Array

    @classmethod
    def of(cls, thickness: float, count: int) -> Layers:
        """Return at least five layers at equal distances, the first and the last on the faces.

        By the trapezoidal rule with Gregory's corrections, exact for cubic polynomials (Davis and
        Rabinowitz, Methods of Numerical Integration, 2.9).  Stress jumps where the elastic core
        is: layers that are closer at the faces have too few about it.
        """
        weights = np.ones(count)
        for ends in (np.s_[:3], np.s_[:-4:-1]):
            weights[ends] += np.array([3.0 / 8.0, 7.0 / 6.0, 23.0 / 24.0]) - 1.0
        return cls(np.linspace(-0.5, 0.5, count) * thickness, weights * thickness / (count - 1))


@dataclass(eq=False)
class InternalOperator:
    """Derivatives at quadrature points, and unknowns that belong to each point alone.

    Of a law with unknowns of its own: it has the equations for them, as many, below its forces.
    They are the last unknowns of a model, variable by variable, of each one layer by layer.

    Parameters
    ----------
    cells : CellOperator
    place : int
        Number of the first of these unknowns in a model.
    variables : int
        How many each layer has.  Layers do not see each other; forces are integrals over the
        thickness of functions that are linear in the unknowns and in the height.
    layers : Layers
    slopes : csr_matrix, optional
        From values at the points to derivatives along the strip, shape (points, points): those of
        the own unknowns follow behind them, and their equations are solved for the whole strip.
    flows : bool, optional
        Whether there are equations for the own unknowns; else they are held.

    Attributes
    ----------
    points : int
        Number of quadrature points.
    """

    cells: CellOperator
    place: int
    variables: int
    layers: Layers
    slopes: csr_matrix | None = None
    flows: bool = True

    def __post_init__(self) -> None:
        self.cells, self.points = copy(self.cells), self.cells.points
        self.cells.symmetric = False  # flow has no potential
        self.own = self.variables * len(self.layers.heights)
        self.strains = self.cells.count * self.cells.components

    @cached_property
    def seeds(self) -> Array:
        """Changes of strains and own unknowns that the tangent needs, none of their slopes.

        Of each variable of all layers at once, the same and like the height: what forces are
        linear in, and what is zero between layers, follows from those.
        """
        others = self.own if self.slopes is None else 2 * self.own
        strains = np.eye(self.strains, self.strains + others)
        if not self.flows:
            return strains
        shapes = np.kron(np.eye(self.variables), [np.ones_like(self.layers.heights)])
        shapes = np.vstack([shapes, shapes * np.tile(self.layers.heights, self.variables)])
        whole = np.zeros((len(shapes), self.strains + others))
        whole[:, self.strains : self.strains + self.own] = shapes
        return np.vstack([strains, whole])

    @cached_property
    def chain(self) -> Chain:
        """Places in a tangent of what is carried along the strip."""
        return Chain(self)

    @cached_property
    def matrices(self) -> tuple[list[Part], list[Part]]:
        """L as sparse matrices, and that of which forces are the transposed."""
        inputs, outputs = self.cells.matrices
        ones = np.ones(self.own * self.points)
        same = Part(csr_matrix(eye(len(ones))), ones, self.place, row=self.strains)
        inputs = [*inputs, same]
        if self.slopes is not None:
            along = csr_matrix(kron(eye(self.own), self.slopes))
            inputs.append(Part(along, ones, self.place, row=self.strains + self.own))
        return inputs, [*outputs, same] if self.flows else outputs

    def values(self, full: Array) -> Array:
        """Return the own unknowns, shape (own, points)."""
        return full[self.place : self.place + self.own * self.points].reshape(self.own, -1)

    def apply(self, full: Array) -> Array:
        """Return derivatives, own unknowns and their slopes, shape (components, points)."""
        values = self.values(full)
        rows = [self.cells.apply(full).reshape(self.strains, -1), values]
        return np.vstack(rows if self.slopes is None else [*rows, (self.slopes @ values.T).T])

    def rates(self, x: Any, v: Any) -> Any:
        """Return the rates of the own unknowns, or their slopes, from values and their rates."""
        return v[self.strains :] if self.slopes is None else x[self.strains + self.own :]

    def gather(self, forces: Array) -> Array:
        """Return generalised forces, and the own equations if there are any, (unknowns,)."""
        shape = (self.cells.count, self.cells.components, -1)
        on_strip = self.cells.gather(forces[: self.strains].reshape(shape))
        if not self.flows:
            return on_strip
        total = np.zeros(self.place + self.own * self.points)
        total[: len(on_strip)] = on_strip
        total[self.place :] = forces[self.strains :].ravel()
        return total

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L, J[j, i] of change j and force i, without the own unknowns if they flow."""
        q, derivative = self.strains, derivative.copy() if self.flows else derivative  # kept
        on_strains = derivative[:q, :q]
        if self.flows and self.slopes is not None:
            blocks.internal = chained = Chained(self, derivative)
            self.cells.add_elements(chained.on_elements, pattern, blocks)
        elif self.flows:
            blocks.internal = eliminated = Eliminated(self, derivative)
            on_strains = on_strains - eliminated.relief
        shape = (self.cells.count, self.cells.components) * 2
        self.cells.add_tangent(on_strains.reshape(*shape, -1), pattern, blocks)


class Eliminated:
    """Unknowns z of points, g = A L u + C z, that act on the others as Lᵀ w Fᵀ S z.

    C couples the variables of each layer alone, and S z are the k integrals of z and ζ z through
    the thickness that make forces.  These work on strains F L u, and layers feel no others by the
    principle of virtual work: A = X F, with fewer columns than L u has components.

    Parameters
    ----------
    operator : InternalOperator
    derivative : ndarray
        J[j, i] of change j along the seeds and result i, points last.
    slopes : ndarray, shape (points,), optional
        Derivatives of slopes by the unknowns that they are of, part of C.

    Attributes
    ----------
    numbers : slice or ndarray of int
        Of the points, in whose order everything else stands.
    """

    numbers: slice | Index = slice(None)

    def __init__(
        self, operator: InternalOperator, derivative: Array, slopes: Array | float = 0.0
    ) -> None:
        self.operator, q, v = operator, operator.strains, operator.variables
        layers = operator.layers
        moments = np.stack([np.ones_like(layers.heights), layers.heights])
        sizes = (moments**2) @ layers.weights
        self.shapes = moments * layers.weights / sizes[:, None]
        own = derivative[q : q + v, q:].reshape(v, v, -1, operator.points)
        own = own + np.eye(v)[..., None, None] * slopes
        try:
            inverse = np.asarray(np.linalg.inv(own.transpose(3, 2, 1, 0)))  # (points, layers, v, v)
        except np.linalg.LinAlgError as error:
            raise SingularTangentError("a layer flows without resistance") from error
        self.inverse = points_last(inverse)
        largest = np.abs(derivative[q:, :q]).max(axis=(1, 2))
        self.acting = np.flatnonzero(largest)
        self.units = largest[self.acting, None]
        self.felt = derivative[q:, :q][self.acting] / self.units[..., None]  # F, (k, q, points)
        rows = self.felt.transpose(2, 0, 1)
        back = rows.swapaxes(1, 2) @ np.linalg.inv(rows @ rows.swapaxes(1, 2))  # F Fᵀ (F Fᵀ)⁻¹ = 1
        by_strains = derivative[:q, q:].transpose(2, 1, 0) @ back  # X, (points, v · layers, k)
        by_strains = by_strains.reshape(operator.points, v, -1, len(self.acting)).swapaxes(1, 2)
        self.flown = inverse @ by_strains  # C⁻¹ X, (points, layers, v, k)
        self.by_strains = points_last(self.flown)

    def integrals(self, own: Array) -> Array:
        """Return S z of z, (..., layers, v, changes), shape (..., k, changes)."""
        whole = np.einsum("sl,...lvj->...svj", self.shapes, own)
        shape = (*own.shape[:-3], -1, own.shape[-1])
        return np.asarray(whole.reshape(shape)[..., self.acting, :] * self.units)

    @property
    def relief(self) -> Array:
        """Fᵀ S C⁻¹ A as J[j, i], shape (strains, strains, points)."""
        rows = self.felt.transpose(2, 0, 1)
        forces = rows.swapaxes(1, 2) @ (self.integrals(self.flown) @ rows)
        return np.asarray(forces.transpose(2, 1, 0))

    def solved(self, own: Array) -> Array:
        """Return C⁻¹ g, shape (v, layers, points), of g, (own unknowns,)."""
        each = own.reshape(self.operator.variables, -1, self.operator.points)[..., self.numbers]
        return np.einsum("vwlp,wlp->vlp", self.inverse, each)

    def freed(self, full: Array, solved: Array) -> Array:
        """Return C⁻¹ (g − A L u), shape (v, layers, points), from C⁻¹ g."""
        strains = self.operator.cells.apply(full).reshape(self.operator.strains, -1)
        felt = np.einsum("kqp,qp->kp", self.felt, strains[:, self.numbers])
        return solved - np.einsum("vklp,kp->vlp", self.by_strains, felt)

    def gathered(self, z: Array) -> Array:
        """Return Lᵀ w Fᵀ S z, shape (unknowns of the strip,)."""
        cells = self.operator.cells
        forces = np.empty((self.operator.strains, cells.points))
        whole = np.einsum("sl,vlp->svp", self.shapes, z).reshape(-1, cells.points)
        integrals = whole[self.acting] * self.units
        forces[:, self.numbers] = np.einsum("kqp,kp->qp", self.felt, integrals)
        return cells.gather(forces.reshape(cells.count, cells.components, -1))

    def numbered(self, z: Array) -> Array:
        """Return z in the order of its unknowns, shape (own unknowns,)."""
        found = np.empty_like(z)
        found[..., self.numbers] = z
        return found.ravel()

    def reduced(self, solved: Array) -> tuple[Array, Array]:
        """Return Lᵀ w Fᵀ S C⁻¹ g, (unknowns of the strip,), and what is left of g: nothing."""
        return self.gathered(solved), np.zeros(0)

    def recovered(self, full: Array, kept: Array, solved: Array) -> Array:
        """Return z = C⁻¹ (g − A L u), shape (own unknowns,)."""
        del kept
        return self.numbered(self.freed(full, solved))


def of_lines(x: Array, count: int) -> Array:
    """Return (points, k, ...), line by line, as (lines, points of a line · k, ...)."""
    each = x.reshape(count, -1, *x.shape[1:]).swapaxes(0, 1)
    return np.ascontiguousarray(each).reshape(len(each), -1, *x.shape[2:])


def points_last(x: Array) -> Array:
    """Return (points, layers, v, changes) as (v, changes, layers, points)."""
    return np.ascontiguousarray(x.transpose(2, 3, 1, 0))


class Chained(Eliminated):
    """The same where what flows is carried along: C z = g − A L u + z₋/h, z₋ of the point before.

    Of a line of points in an element the last unknowns s are kept, the others are eliminated: with
    z_i = Z_i (s₋, F L u of all points up to i), s₋ of the element before, the equations that are
    left are s − Z_last (s₋, F L u) = what g makes of it.

    Attributes
    ----------
    carried : ndarray, shape (v, v, layers, points of a line, lines)
        C⁻¹/h.
    strains : ndarray, shape (lines, points of a line · k, count · local)
        F L of the element's u.
    weights : ndarray, shape (lines, points of a line · k, 1)
        Of the points, by which S z is multiplied.
    of_strains : ndarray, shape (lines, points of a line · k, points of a line · k)
        S z by F L u.
    scale : ndarray, shape (lines, own)
        By which the equations of s are multiplied, for entries as large as those of forces.
    values : ndarray
        All entries, in the order of :class:`Chain`.
    """

    def __init__(self, operator: InternalOperator, derivative: Array) -> None:
        assert operator.slopes is not None
        cells, order, v = operator.cells, operator.chain.order, operator.variables
        self.numbers, self.lines = order.ravel(), order.shape
        slopes = operator.slopes.diagonal()[self.numbers]
        super().__init__(operator, derivative[..., self.numbers], slopes)
        self.carried = (self.inverse * slopes).reshape(*self.inverse.shape[:3], *self.lines)
        carried = np.ascontiguousarray(self.carried.transpose(3, 4, 2, 0, 1))
        count, lines = self.lines
        rows = np.ascontiguousarray(self.felt.transpose(2, 0, 1))
        k = rows.shape[1]
        by_functions = rows.reshape(len(rows), -1, cells.components) @ cells.by_point[self.numbers]
        self.strains = of_lines(by_functions.reshape(len(rows), k, -1), count)
        weights = np.broadcast_to(cells.weights[self.numbers, None, None], (count * lines, k, 1))
        self.weights = of_lines(weights, count)
        flown = self.flown.reshape(*carried.shape[:-1], k)
        self.of_strains = np.zeros((lines, count * k, count * k))
        by_start = np.empty((lines, count * k, v * len(self.shapes[0])))
        response = np.eye(v)
        for i, there in enumerate(carried):
            response = np.concatenate([there @ response, -flown[i]], axis=-1)  # of s₋, F L u
            on = np.s_[:, i * k : (i + 1) * k]
            self.of_strains[*on, : (i + 1) * k] = self.integrals(response[..., v:])
            own = np.einsum("sl,glvw->gsvwl", self.shapes, response[..., :v])
            by_start[on] = own.reshape(lines, -1, by_start.shape[-1])[:, self.acting] * self.units
        forces = self.strains.swapaxes(1, 2) @ (self.weights * by_start)
        each = np.abs(forces).max(axis=1).reshape(lines, v, -1)
        # by layer: p has no forces before strip flows
        self.scale = np.tile(each.max(axis=1), v) / operator.chain.largest[:, None]
        last = response.swapaxes(1, 2) * -self.scale.reshape(lines, v, -1, 1)
        on_u = last[..., v:].reshape(lines, -1, count * k) @ self.strains
        self.values = np.concatenate([x.ravel() for x in (forces, on_u, last[..., :v], self.scale)])

    @property
    def on_elements(self) -> Array:
        """Forces by u without s, shape (elements, count, local, count, local)."""
        cells = self.operator.cells
        forces = self.strains.swapaxes(1, 2) @ (self.weights * (self.of_strains @ self.strains))
        whole = forces.reshape(cells.elements, self.lines[1] // cells.elements, -1).sum(axis=1)
        return whole.reshape(-1, *(cells.count, cells.local) * 2)

    def _along(self, z: Array, before: Array | None = None) -> Array:
        """Return z with what is carried on, also from s₋ if there is any, (v, layers, lines)."""
        each = z.reshape(*z.shape[:2], *self.lines)
        for i in range(self.lines[0]):
            if before is not None:
                each[:, :, i] += np.einsum("vwlg,wlg->vlg", self.carried[:, :, :, i], before)
            before = each[:, :, i]
        return z

    def reduced(self, solved: Array) -> tuple[Array, Array]:
        """Return what g makes of forces, (unknowns of the strip,), and of the equations of s."""
        z = self._along(solved.copy())
        return self.gathered(z), z[..., -self.lines[1] :].ravel() * self.scale.T.ravel()

    def recovered(self, full: Array, kept: Array, solved: Array) -> Array:
        """Return z, shape (own unknowns,), with s."""
        before, last = self.operator.chain.before, kept.reshape(*solved.shape[:2], -1)
        start = np.where(before < 0, 0.0, last[..., before])
        return self.numbered(self._along(self.freed(full, solved), start))


class Chain:
    """Lines of points in elements, places of the entries of :class:`Chained`, and an order.

    Strip is eliminated from the entry on, element by element: its own unknowns once all points that
    they reach have been, and the last unknowns of a line in an element.

    Attributes
    ----------
    order : ndarray of int, shape (points of a line, lines)
        Numbers of the points, from the entry on.
    before : ndarray of int, shape (lines,)
        Number of the line that goes on in each, -1 at the entry.
    largest : ndarray, shape (lines,)
        Largest entry of L.
    rows, columns : ndarray of int
        By numbers of the strip's unknowns, s after them, variable by variable, layer by layer.
    steps : ndarray of int, shape (unknowns of the strip + unknowns s,)
        Number, from the entry on, of the last element that an unknown belongs to.
    """

    def __init__(self, operator: InternalOperator) -> None:
        assert operator.slopes is not None
        cells, m, v, points = operator.cells, operator.own, operator.variables, operator.points
        slopes = operator.slopes.tocoo()
        on = slopes.row != slopes.col
        before, after = np.full((2, points), -1)
        before[slopes.row[on]], after[slopes.col[on]] = slopes.col[on], slopes.row[on]
        element = np.arange(points) // cells.per_element
        order = [np.flatnonzero((before < 0) | (element[before] != element))]
        lines = len(order[0])
        for _ in range(points // lines - 1):
            order.append(after[order[-1]])
        self.order = np.stack(order)
        line = np.empty(points, dtype=np.int64)
        line[self.order] = np.arange(lines)
        self.before = np.where(before[order[0]] < 0, -1, line[before[order[0]]])
        self.largest = np.abs(cells.by_point[self.order]).max(axis=(0, 2, 3))
        n = cells.count * cells.sum.shape[0]
        last = n + np.arange(m * lines).reshape(m, lines).T
        carried = np.where(self.before[:, None] < 0, -1, last[self.before])
        on = cells.count * cells.dofs[element[order[0]], None].astype(np.int64)
        strip = on + np.arange(cells.count)[:, None]  # (lines, count, local)

        by_layer = (lines, v, -1)
        entries = (
            (strip[..., None], carried[:, None, None]),
            (last[:, :, None, None], strip[:, None]),
            (last.reshape(by_layer)[..., None], carried.reshape(by_layer).swapaxes(1, 2)[:, None]),
            (last, last),
        )
        rows, columns = zip(*(np.broadcast_arrays(*pair) for pair in entries), strict=True)
        self.rows, self.columns = (np.concatenate([x.ravel() for x in p]) for p in (rows, columns))
        steps, at = np.zeros(lines, dtype=np.int64), self.before
        while (at >= 0).any():
            steps += at >= 0
            at = np.where(at < 0, at, self.before[at])
        last_step = np.zeros(cells.sum.shape[0], dtype=np.int64)
        on_elements = np.empty(cells.elements, dtype=np.int64)
        on_elements[element[order[0]]] = steps
        np.maximum.at(last_step, cells.dofs, on_elements[:, None])
        self.steps = np.concatenate([np.repeat(last_step, cells.count), np.tile(steps, m)])
