"""Points shared between elements, operators at them, and projections onto the basis."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import SuperLU, splu
from skfem.element import DiscreteField

from anmstrip.arrays import Array, Index
from anmstrip.fem.operators import Blocks, CellOperator, LinearOperator, Part, Pattern
from anmstrip.fem.strip import Strip
from anmstrip.taylor.program import COMPILED


@dataclass(frozen=True)
class Patches:
    """The same points on every element, shared between neighbours."""

    cells: Index  # numbers of each element's points, (elements, points of one)
    reference: Array  # their reference positions, (3, points)
    functions: list[DiscreteField]  # each basis function there, (elements, points of one)


def shape_of(strip: Strip) -> str:
    """Kind of the elements: line, quad or triangle."""
    return {2: "line", 3: "triangle", 4: "quad"}[len(strip.mesh.t)]


def stations(strip: Strip, x: Array) -> tuple[Array, Index]:
    """Return places (m) along the strip, ascending, and the number of each x (m) among them.

    Of triangles, whose points do not stand in lines, places are as far apart as an element is long.
    """
    sizes, triangles = strip.cell_sizes[0], shape_of(strip) == "triangle"
    unit = float(sizes.mean() if triangles else 1e-6 * sizes.min())
    places, number = np.unique(np.round(x / unit), return_inverse=True)
    return places * unit, number


def patches(strip: Strip, local: Array) -> Patches:
    """Points of all elements, given those of the reference element, (dimensions, points)."""
    basis = strip.basis
    cells, points = join_points(basis.mapping.F(local), strip)
    functions = [basis.elem.gbasis(basis.mapping, local, i)[0] for i in range(basis.Nbfun)]
    return Patches(cells, strip.in_space(points), functions)


def unit_grid(*counts: int) -> Array:
    """Grid of the unit interval or square, number i + n j, shape (dimensions, points)."""
    steps = (np.linspace(0.0, 1.0, n) for n in counts)
    return np.stack([x.ravel() for x in np.meshgrid(*steps)])


def join_points(grid: Array, strip: Strip) -> tuple[Index, Array]:
    """Number the points of element grids so that neighbours share them.

    Parameters
    ----------
    grid : ndarray, shape (dimensions, elements, points of one)
    strip : Strip

    Returns
    -------
    cells : ndarray of int, shape (elements, points of one)
    points : ndarray, shape (dimensions, points)
    """
    unit = 1e-6 * strip.cell_sizes.min()
    flat = grid.reshape(len(grid), -1)
    keys = np.round((flat - flat.min(axis=1)[:, None]) / unit).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=1, return_index=True, return_inverse=True)
    return inverse.reshape(grid.shape[1:]), flat[:, first]


SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0

TRIANGLE = np.repeat([1 / 90, 16 / 225, 81 / 320, 49**2 / 14400], [3, 3, 1, 3])


def contact_shares(strip: Strip) -> Array:
    """Return the weights of an element's contact points, as shares of its area.

    Positive, and exact for the element's own functions, so that a uniform pressure is carried
    without bending: cubics in each coordinate, quintics on triangles.
    """
    kind, parts = shape_of(strip), strip.contact_parts
    if kind == "triangle":
        return TRIANGLE
    along = np.zeros(1 + 2 * parts)
    for part in range(parts):
        along[2 * part : 2 * part + 3] += SIMPSON / parts
    return along if kind == "line" else np.outer(along, SIMPSON).ravel()


def contact_lines(strip: Strip) -> Index:
    """Lines of three contact points on an element, on quadrilaterals both ways, (lines, 3)."""
    kind, count = shape_of(strip), 1 + 2 * strip.contact_parts
    if kind == "triangle":
        return np.array([[0, 3, 1], [1, 4, 2], [0, 5, 2]])
    numbers = np.arange(count if kind == "line" else 3 * count).reshape(count, -1)
    along = sliding_window_view(numbers.T, 3, axis=1)[:, ::2].reshape(-1, 3)
    return along if kind == "line" else np.concatenate([numbers, along])


CACHE_SIZE = 4
"""Latest choices of points, for what is near a roller hardly changes within a step."""


T = TypeVar("T")


def remember(parts: dict[bytes, T], points: Index, make: Callable[[Index], T]) -> T:
    """Object of a choice of points, made anew if it is none of the latest ones."""
    key = points.tobytes()
    if key not in parts:
        while len(parts) >= CACHE_SIZE:
            parts.pop(next(iter(parts)))
        parts[key] = make(points)
    return parts[key]


class ContactOperator(LinearOperator):
    """Values at the points where contact is looked at, with areas as weights.

    The points are nodes, middles of sides and centres of the elements, on triangles three
    more.  Nodes alone would leave a cubic element free to bow into the roller between them:
    on two elements across, the pressure of a wrapped strip was off by half of its value;
    so it was at the nodes of triangles with a rule exact for cubics alone.

    Attributes
    ----------
    cells : ndarray of int, shape (elements, points of one)
        Points of each element.
    reference : ndarray, shape (3, points)
        Reference positions.
    points : int
        Number of points.
    weights : ndarray, shape (points,)
        Area that belongs to each point (m²).
    unknowns : int
        Of the strip.
    chosen : ndarray of int, shape (points,)
        Their numbers in the whole strip.
    width : float
        Of the strip (m).
    whole : ContactOperator
        That of all points, of which this is a part.
    lines : ndarray of int, shape (lines, 3)
        Lines of three points of an element.
    """

    def __init__(self, strip: Strip) -> None:
        self.whole = self
        self.count, self.width = strip.count, strip.width
        patch = patches(strip, contact_points(strip))
        self.cells, self.reference = patch.cells, patch.reference
        self.chosen: Index = np.arange(self.reference.shape[1], dtype=np.int64)
        self.table: Array = np.stack([np.asarray(f) for f in patch.functions], axis=-1)
        self.functions = patch.functions
        self.shares = strip.areas[:, None] * contact_shares(strip)
        self.lines = contact_lines(strip)
        self.weights: Array = np.bincount(self.cells.ravel(), self.shares.ravel()).astype(float)
        self.points = len(self.weights)
        self.matrix = self._at_points(strip, self.table)
        self.unknowns = strip.unknowns
        self.parts: dict[bytes, Self] = {}

    def _at_points(self, strip: Strip, table: Array) -> csr_matrix:
        """Return what takes scalars to points, from a table by elements."""
        count, first = strip.basis.Nbfun, np.unique(self.cells, return_index=True)[1]
        rows = table.reshape(-1, count)[first]
        columns = np.repeat(strip.basis.element_dofs.T, self.cells.shape[1], axis=0)[first]
        index = (np.repeat(np.arange(len(first)), count), columns.ravel())
        matrix = csr_matrix((rows.ravel(), index), shape=(len(first), strip.scalars))
        matrix.eliminate_zeros()
        return matrix

    @cached_property
    def owners(self) -> Index:
        """Elements of each point, −1 where there are fewer, shape (points, most of one)."""
        points = self.cells.ravel()
        order, count = np.argsort(points, kind="stable"), np.bincount(points)
        place = np.arange(len(points)) - np.repeat(np.cumsum(count) - count, count)
        found = np.full((len(count), count.max()), -1)
        found[points[order], place] = order // self.cells.shape[1]
        return found

    def restricted(self, points: Index) -> Self:
        """The same on some of the points, also several times; it keeps the cells of all."""
        if np.array_equal(points, np.arange(len(self.chosen))):
            return self
        return remember(self.parts, points, self._part)

    def _part(self, points: Index) -> Self:
        part = copy(self)
        for made in ("matrices", "nearby"):
            vars(part).pop(made, None)
        part.parts = {}
        part.chosen, part.points = self.chosen[points], len(points)
        part.reference, part.weights = self.reference[:, points], self.weights[points]
        part.matrix = self.matrix[points]
        return part

    @cached_property
    def matrices(self) -> tuple[list[Part], list[Part]]:  # type: ignore[override]
        """L as sparse matrices, and that of which forces are the transposed."""
        parts = [Part(self.matrix, self.weights, count=self.count)]
        return parts, parts

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L, J[j, i] of shape (count, count, points), over these points' cells."""
        self._add_tangent(derivative, self.table, pattern, blocks)

    def _add_tangent(
        self, derivative: Array, inputs: Array, pattern: Pattern, blocks: Blocks
    ) -> None:
        """Add Lᵀ w J M, where the table of M is another one than that of L."""
        near, weights, transposed = self.nearby
        flat = derivative.reshape(self.count**2, -1)
        summed = [np.bincount(self.chosen, each, self.whole.points) for each in flat]
        every: Array = np.take(summed, self.cells[near], axis=1)
        table, places = inputs[near], pattern.cells[near]
        if COMPILED and inputs is self.table:
            from anmstrip.taylor.compiled import add_blocks

            at_points = every.reshape(len(every), -1)
            add_blocks(table[:, :, None], weights, at_points, places, blocks.pairs, symmetric=False)
            return
        for (j, i), each in zip(np.ndindex(self.count, self.count), every, strict=True):
            local = transposed @ ((each * weights)[:, :, None] * table)
            blocks.pairs[i, j] += np.bincount(places.ravel(), local.ravel(), pattern.couplings)

    @cached_property
    def nearby(self) -> tuple[Index, Array, Array]:
        """Elements of these points, the areas of their points, and the transposed functions."""
        touched = np.zeros(len(self.cells) + 1, dtype=bool)  # the last for points with fewer owners
        touched[self.whole.owners[self.chosen]] = True
        near = np.flatnonzero(touched[:-1])
        return near, self.shares[near], np.ascontiguousarray(self.table[near].swapaxes(1, 2))


class RepeatedOperator(ContactOperator):
    """The points of a contact operator several times, one after the other; made if asked for.

    Parameters
    ----------
    once : ContactOperator
        At all points.
    times : int
    """

    def __init__(self, once: ContactOperator, times: int) -> None:
        self.whole, self.times, self.parts, self.points = once, times, {}, times * once.points
        self.count, self.width, self.cells = once.count, once.width, once.cells
        self.table, self.shares = once.table, once.shares

    def __getattr__(self, name: str) -> Any:
        """Make what there is of every point: ``chosen``, ``weights``, ``reference``, matrices."""
        kept = "chosen", "weights", "reference", "matrix"
        if name not in kept:
            raise AttributeError(name)
        made = self.whole._part(np.tile(self.whole.chosen, self.times))
        vars(self).update({key: getattr(made, key) for key in kept})
        return vars(self)[name]

    def restricted(self, points: Index) -> ContactOperator:  # type: ignore[override]
        """The same on some of the points, of the operator that is repeated."""
        return self.whole.restricted(points % self.whole.points)


class SlopeOperator(ContactOperator):
    """Values and derivatives along x at the contact points: both go in, forces come out."""

    def __init__(self, strip: Strip) -> None:
        super().__init__(strip)
        self.slope_table = np.stack([np.asarray(f.grad)[0] for f in self.functions], axis=-1)
        self.slopes = self._at_points(strip, self.slope_table)

    def _part(self, points: Index) -> Self:
        part = super()._part(points)
        part.slopes = self.slopes[points]
        return part

    @cached_property
    def matrices(self) -> tuple[list[Part], list[Part]]:  # type: ignore[override]
        """L as sparse matrices, and that of which forces are the transposed."""
        values = super().matrices[1]
        slopes = Part(self.slopes, self.weights, count=self.count, row=self.count)
        return [*values, slopes], values

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w (J_0 L + J_1 L,x), J of shape (2 count, count, points)."""
        self._add_tangent(derivative[: self.count], self.table, pattern, blocks)
        self._add_tangent(derivative[self.count :], self.slope_table, pattern, blocks)


class RollerUnknowns(NamedTuple):
    """Unknowns of rollers, one for each, that points see."""

    which: Index  # number of that of each point's roller, below 0 if it has none, (points,)
    size: int  # how many there are
    first: int  # number of the first of them among all unknowns

    @property
    def matrix(self) -> csr_matrix:
        """Matrix from them to the points, zero where there is none, shape (points, size)."""
        points = np.flatnonzero(self.which >= 0)
        index, shape = (points, self.which[points]), (len(self.which), self.size)
        return csr_matrix((np.ones(len(points)), index), shape=shape)


class RollerOperator(LinearOperator):
    """Values at contact points of the strip, and below them unknowns of the rollers they see.

    Parameters
    ----------
    contact : ContactOperator
    seen : RollerUnknowns
        One row for each.
    """

    def __init__(self, contact: ContactOperator, *seen: RollerUnknowns) -> None:
        self.contact, self.points = contact, contact.points
        self.seen = [(unknowns.matrix, unknowns.first) for unknowns in seen]

    @property
    def weights(self) -> Array:
        """Area that belongs to each point (m²)."""
        return self.contact.weights

    @property
    def matrices(self) -> tuple[list[Part], list[Part]]:  # type: ignore[override]
        """L as sparse matrices, and that of which forces are the transposed."""
        found = []
        for own in self.contact.matrices:
            row = sum(part.count for part in own)
            seen = enumerate(self.seen, row)
            found.append([*own, *(Part(m, self.weights, first, row=k) for k, (m, first) in seen)])
        return found[0], found[1]

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L, J[j, i] of shape (inputs, outputs, points)."""
        inputs, outputs = (sum(part.count for part in own) for own in self.contact.matrices)
        self.contact.add_tangent(derivative[:inputs, :outputs], pattern, blocks)
        super().add_tangent(derivative, pattern, blocks)


def contact_points(strip: Strip) -> Array:
    """Contact points of the reference element, (dimensions, points).

    Nodes, middles of sides and centre, of each of the equal parts along an element; on triangles
    also the three points with the barycentric coordinates 1/7, 1/7, 5/7.
    """
    kind = shape_of(strip)
    if kind != "triangle":
        across = [] if kind == "line" else [3]  # the first side of an element is along y
        return unit_grid(*across, 1 + 2 * strip.contact_parts)
    nodes = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    middles = [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5]]
    inner = [[1 / 3, 1 / 7, 5 / 7, 1 / 7], [1 / 3, 1 / 7, 1 / 7, 5 / 7]]
    return np.hstack([nodes, middles, inner])


@lru_cache(maxsize=4)
def quadrature_points(strip: Strip) -> Array:
    """Reference positions of the quadrature points, shape (3, points)."""
    points = np.asarray(strip.basis.mapping.F(strip.basis.X))
    return strip.in_space(points.reshape(len(points), -1))


def l2_projection(strip: Strip, pattern: Pattern, displacement: Array) -> Array:
    """Unknowns whose displacement is nearest to a given one.

    Parameters
    ----------
    displacement : ndarray, shape (3, points)
        At the quadrature points (m); components that are not unknown are left out.

    Returns
    -------
    ndarray, shape (unknowns,)
    """
    (operator, factors), units = mass_factors(strip, pattern), strip.dof_lengths[:, None]
    right = operator.gather(strip.kinematics.pick(displacement.T).T[:, None])
    return np.ravel(factors.solve(right.reshape(-1, strip.count) * units) * units)


@lru_cache(maxsize=2)
def mass_factors(strip: Strip, pattern: Pattern) -> tuple[CellOperator, SuperLU]:
    """Return values at the quadrature points, and the factors of their scaled mass matrix."""
    operator, block = CellOperator(strip, [0]), np.zeros(pattern.couplings)
    operator.add_bilinear(np.eye(1), pattern, block)
    units = strip.dof_lengths  # that make the matrix well conditioned
    scaled = block * units[pattern.row] * units[pattern.column]
    mass = csc_matrix((scaled, (pattern.row, pattern.column)), 2 * (strip.scalars,))
    return operator, splu(mass)


def displacement_at(strip: Strip, full: Array, places: Array) -> Array:
    """Return the displacement at places of the flat strip, on any of its meshes.

    Parameters
    ----------
    strip : Strip
    full : ndarray, shape (unknowns,)
    places : ndarray, shape (1, points) or (2, points)
        x, and y (m), which is 0 if left out, and of which a section knows nothing.

    Returns
    -------
    ndarray, shape (3, points)
    """
    known, dimensions = np.zeros((2, places.shape[1])), strip.mesh.dim()
    known[: len(places)] = places
    own = strip.mesh.p
    inside = np.clip(known[:dimensions], own.min(axis=1)[:, None], own.max(axis=1)[:, None])
    values = strip.basis.probes(inside) @ strip.nodal(full)
    return np.asarray(strip.kinematics.embed(values.T))
