"""The strip: mid-surface, mesh, named edges and C1 basis; which of its unknowns are held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from skfem import Basis, BilinearForm, FacetBasis, LinearForm, Mesh, MeshLine, MeshQuad, MeshTri

from anmstrip.arrays import Array, Index, NumbersInRange, require_number
from anmstrip.errors import Named
from anmstrip.fem.elements import Argyris, BognerFoxSchmit, Hermite
from anmstrip.fem.geometry import DERIVATIVE_PAIRS, SHELL, Frames, Kinematics, ReferenceSurface
from anmstrip.linalg.solvers import Bordered

ELEMENTS = {MeshLine: (Hermite, 6), MeshQuad: (BognerFoxSchmit, 6), MeshTri: (Argyris, 8)}
"""C1 element of every kind of mesh, and the degree of polynomials integrated exactly.

Enough for products of first derivatives: the membrane of the flat strip, and bending.
"""


@dataclass(frozen=True)
class Material(NumbersInRange):
    """Isotropic linear elasticity."""

    young: float  # E (Pa)
    poisson: float  # ν
    density: float = 0.0  # ρ (kg/m³)
    expansion: float = 0.0  # α (1/K)


@dataclass(frozen=True)
class Edge:
    """A named edge of the strip."""

    name: str
    facets: Index  # of the mesh
    nodes: Index  # of the mesh, in the order along the edge
    values: Index  # scalar degrees of freedom "value" of these nodes
    trace: Index  # that hold it: values, and derivatives along it where that is x or y
    strip: Strip

    @property
    def load(self) -> Array:
        """∫ φ ds, generalised force of a unit force per length, shape (scalars,)."""
        return self._integrals[0]

    @property
    def length(self) -> float:
        """Length (m)."""
        return self._integrals[1]

    @cached_property
    def mass(self) -> Array:
        """∫ φ_i φ_j ds of its ``trace``, by which forces per length make forces."""
        basis = self.strip.edge_basis(self.name)
        form = BilinearForm(lambda u, v, w: w["share"] * u * v)
        whole = form.assemble(basis, share=self.strip.weights(basis) / basis.dx)
        return np.asarray(whole[self.trace][:, self.trace].toarray())

    @cached_property
    def _integrals(self) -> tuple[Array, float]:
        strip = self.strip
        if strip.mesh.dim() == 1:
            load = np.zeros(strip.scalars)
            load[self.values] = strip.depth
            return load, strip.depth
        basis = strip.edge_basis(self.name)
        load = strip.integrals(basis)
        load[np.abs(load) * strip.dof_lengths < 1e-12 * np.abs(load).max()] = 0.0
        return load, float(strip.weights(basis).sum())


@dataclass(eq=False, repr=False)
class Strip:
    """Thin sheet with a C1 discretization.

    Parameters
    ----------
    mesh : skfem.Mesh
        Axis-aligned rectangles or triangles, or lines for a section; with named boundaries.
    thickness : float
        t (m).
    material : Material
    kinematics : Kinematics
        Which displacements are unknown.
    width : float
        W (m) of a section; a surface has its own.
    surface : ReferenceSurface, optional
        Where a point of the mesh's plane lies in space; for a shell.

    Attributes
    ----------
    origin : ndarray, shape (3,)
        Place (m) in the scene's coordinates of the local origin from which positions count.
    flat_origin : ndarray, shape (2,)
        The same of the flat strip: where the mesh file has what is (0, 0) here.
    contact_parts : int
        Equal parts of an element of a section, each with its own points of contact.
    basis : skfem.Basis
        C1 functions, and quadrature.
    count, scalars, unknowns : int
        Numbers of unknown components, of degrees of freedom of one of them, and of all.
    node_values : ndarray of int, shape (nodes,)
        Scalar degree of freedom "value" of every mesh node.
    nodes : ndarray, shape (3, nodes)
        Reference positions of the mesh nodes.
    span : tuple of float
        Reference x (m) of the nodes at the beginning and at the end.
    cell_sizes : ndarray, shape (dimensions, elements)
        Extent of every element in x (and y) (m).
    areas : ndarray, shape (elements,)
        Area of every element (m²).
    length, width : float
        Extents along x and y (m).
    depth : float
        Width (m) that is not meshed: that of a section, 1 of a surface.
    mass : float
        ρ t, per area (kg/m²).
    tensile_stiffness, membrane_stiffness : float
        E t and E t / (1 − ν²) (N/m).
    bending_stiffness : float
        D = E t³ / 12 (1 − ν²) (N m).
    """

    mesh: Mesh
    thickness: float
    material: Material
    kinematics: Kinematics = SHELL
    width: float = 1.0
    surface: ReferenceSurface | None = None

    def __post_init__(self) -> None:
        mesh, material, width, thickness = self.mesh, self.material, self.width, self.thickness
        for name, value in (("thickness", thickness), ("width", width)):
            require_number(self, name, value)
        self.origin, self.flat_origin, self.contact_parts = np.zeros(3), np.zeros(2), 1
        element, degree = next(e for kind, e in ELEMENTS.items() if isinstance(mesh, kind))
        self.basis = Basis(mesh, element(), intorder=degree)
        self.count, self.scalars = self.kinematics.count, int(self.basis.N)
        self.unknowns = self.count * self.scalars
        self.node_values = self.dofs("u")
        self.cell_sizes = np.ptp(mesh.p[:, mesh.t], axis=1)
        self.length, *across = np.ptp(mesh.p, axis=1).tolist()
        self.depth, self.width = (1.0, *across) if across else (width, width)
        self.mass = material.density * thickness
        self.tensile_stiffness = material.young * thickness
        self.membrane_stiffness = self.tensile_stiffness / (1.0 - material.poisson**2)
        self.bending_stiffness = self.membrane_stiffness * thickness**2 / 12.0
        self.nodes: Array = self.in_space(mesh.p)
        self.span = float(self.nodes[0].min()), float(self.nodes[0].max())
        self.areas: Array = self.weights().sum(axis=1)

    def nodal(self, full: Array) -> Array:
        """Values of the degrees of freedom, (scalars, components), of all unknowns of a model."""
        return full[: self.unknowns].reshape(-1, self.count)

    def edge_tangent(self, name: str, full: Array) -> Array:
        """Mean of ∂r/∂X over the nodes of an edge, shape (3,)."""
        slopes = self.nodal(full)[self.dofs("u_x")[self.edges[name].nodes]].mean(axis=0)
        return np.array([1.0, 0.0, 0.0]) + self.kinematics.embed(slopes)

    def flat_slopes(self, unknowns: int) -> Array:
        """Return ∂x/∂X = 1 of the flat strip's nodes at its place among all unknowns, else 0."""
        slopes = np.zeros(unknowns)
        if 0 in self.kinematics.components:
            self.nodal(slopes)[self.dofs("u_x"), 0] = 1.0
        return slopes

    @cached_property
    def lines(self) -> tuple[Array, Index]:
        """Reference x (m) of the lines of nodes across the strip, and the line of each node."""
        places = self.nodes[0]  # unrounded: the same to the last bit in other units
        _, first, number = np.unique(np.round(places, 9), return_index=True, return_inverse=True)
        return places[first], number

    def in_space(self, points: Array) -> Array:
        """Reference positions of points of the mesh, shape (3, ...)."""
        if self.surface is not None:
            return self.surface(points.reshape(2, -1)).position.reshape(3, *points.shape[1:])
        return np.concatenate([points, np.zeros((3 - len(points), *points.shape[1:]))])

    def frames(self, basis: Any = None) -> Frames:
        """Frames of the reference at the quadrature points of the strip, or of another basis."""
        if self.surface is None:
            level = self.kinematics
            straight = np.zeros((level.count, len(DERIVATIVE_PAIRS[level.directions]), 1))
            return Frames(level.flat, straight, np.ones(1))
        points = np.asarray((self.basis if basis is None else basis).global_coordinates())
        return Frames.of(self.surface(points.reshape(2, -1)))

    def weights(self, basis: Any = None) -> Array:
        """Area, or length of an edge, of every quadrature point, (elements, points of one)."""
        basis = self.basis if basis is None else basis
        dx = np.asarray(basis.dx) * self.depth
        if self.surface is None:
            return dx
        if not isinstance(basis, FacetBasis):
            return dx * self.frames(basis).density.reshape(dx.shape)
        jet = self.surface(np.asarray(basis.global_coordinates()).reshape(2, -1))
        normal = np.asarray(basis.normals).reshape(2, -1)
        along = jet.tangents[:, 1] * normal[0] - jet.tangents[:, 0] * normal[1]
        return dx * np.linalg.norm(along, axis=0).reshape(dx.shape)

    def integrals(self, basis: Any = None) -> Array:
        """Return the integrals of all functions over the strip, or an edge of it, (scalars,)."""
        basis = self.basis if basis is None else basis
        form = LinearForm(lambda v, w: w["share"] * v)
        return np.asarray(form.assemble(basis, share=self.weights(basis) / basis.dx))

    def dofs(self, name: str) -> Index:
        """Scalar degrees of freedom of the nodes by name: u, u_x, u_y, u_xy, ..."""
        return self.basis.nodal_dofs[self.basis.elem.dofnames.index(name)]

    @cached_property
    def dof_lengths(self) -> Array:
        """Unit of every scalar degree of freedom in lengths: 1, 1/h_x, 1/h_y, 1/(h_x h_y), ...

        h is the mean size of the elements around the node.
        """
        t = self.mesh.t
        count = np.bincount(t.ravel())
        sizes = [np.bincount(t.ravel(), np.tile(s, len(t))) / count for s in self.cell_sizes]
        around = dict(zip("xy", sizes, strict=False))
        lengths = np.empty(self.scalars)
        for name, dofs in zip(self.basis.elem.dofnames, self.basis.nodal_dofs, strict=False):
            lengths[dofs] = 1.0 / np.prod([around[d] for d in name[2:]], axis=0, initial=1.0)
        for dofs in self.basis.facet_dofs:
            lengths[dofs] = 1.0 / np.array(sizes)[:, self.mesh.facets].mean(axis=(0, 1))
        return lengths

    @cached_property
    def edges(self) -> dict[str, Edge]:
        """All named edges."""
        return Named((name, self._edge(name)) for name in (self.mesh.boundaries or {}))

    def unknowns_of(self, scalars: Index) -> Index:
        """Numbers of all components of scalar degrees of freedom, sorted."""
        numbers = self.count * np.asarray(scalars)[:, None] + np.arange(self.count)
        return np.sort(numbers.ravel())

    def edge_unknowns(self, name: str, *held: Sequence[int]) -> Index:
        """Unknowns on a straight edge, by the order of the derivative across it.

        Parameters
        ----------
        name : str
        *held : sequence of int
            Components of space of the derivatives of order 0, 1, 2 across the edge; those
            along it follow.
        """
        edge, basis, level = self.edges[name], self.basis, self.kinematics
        across = "xy"[int(np.ptp(self.mesh.p[0, edge.nodes]) > 0.0)]
        names = zip(basis.elem.dofnames, basis.nodal_dofs, strict=False)
        rows = [(name[2:].count(across), dofs[edge.nodes]) for name, dofs in names]
        rows += [(1, dofs[edge.facets]) for dofs in basis.facet_dofs]
        unknowns = [
            self.count * dofs + level.components.index(component)
            for order, dofs in rows
            for component in held[order]
            if component in level.components
        ]
        return np.unique(np.concatenate(unknowns))

    def clamp(self, name: str) -> Index:
        """Unknowns that a rigid clamp holds on an edge: positions and tangent plane.

        With them the traces of r and of its derivative across the edge are held all along it;
        the second derivative across, the clamp's moment, stays free.
        """
        every = self.kinematics.components
        return self.edge_unknowns(name, every, every, ())

    def edge_basis(self, name: str) -> FacetBasis:
        """Quadrature along an edge."""
        return FacetBasis(self.mesh, self.basis.elem, facets=self.edges[name].facets, intorder=8)

    def _edge(self, name: str) -> Edge:
        facets = np.asarray(self.mesh.boundaries[name])
        nodes = np.unique(self.mesh.facets[:, facets])
        along = int(np.argmax(np.ptp(self.mesh.p[:, nodes], axis=1)))
        nodes = nodes[np.argsort(self.mesh.p[along, nodes])]
        extent = np.ptp(self.mesh.p[:, nodes], axis=1)
        straight = self.mesh.dim() > 1 and extent.min() <= 1e-9 * extent.max()
        names = ["u", *(f"u_{'xy'[along] * k}" for k in (1, 2))] if straight else ["u"]
        known = [n for n in names if n in self.basis.elem.dofnames]
        trace = np.concatenate([self.dofs(n)[nodes] for n in known])
        return Edge(name, facets, nodes, self.node_values[nodes], trace, self)


def grid(xs: Array, ys: Array) -> MeshQuad:
    """Rectangular mesh with the four edges named, nodes numbered along the strip.

    The first side of an element is along y.

    Parameters
    ----------
    xs, ys : ndarray
        Increasing coordinates of the lines of nodes (m).
    """
    return renumbered(MeshQuad.init_tensor(xs, ys)).with_boundaries(
        {
            "entry": lambda x: np.isclose(x[0], xs[0]),
            "exit": lambda x: np.isclose(x[0], xs[-1]),
            "right": lambda x: np.isclose(x[1], ys[0]),
            "left": lambda x: np.isclose(x[1], ys[-1]),
        }
    )


def line(xs: Array) -> MeshLine:
    """Mesh of a section with its two ends named.

    Parameters
    ----------
    xs : ndarray
        Increasing coordinates of the nodes (m).
    """
    return MeshLine(xs).with_boundaries(
        {"entry": lambda x: np.isclose(x[0], xs[0]), "exit": lambda x: np.isclose(x[0], xs[-1])}
    )


def renumbered(mesh: Mesh) -> Mesh:
    """The same mesh with nodes numbered along x, then y, which makes matrices narrow.

    Boundaries keep their names.
    """
    scale = 1e-9 * np.ptp(mesh.p, axis=1).max()
    order = np.lexsort((mesh.p[1], np.round(mesh.p[0] / scale) * scale))
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    sorted_mesh = type(mesh)(np.ascontiguousarray(mesh.p[:, order]), place[mesh.t])
    nodes = np.sort(place[mesh.facets], axis=0)
    number = np.lexsort(nodes[::-1]).argsort()  # facets are in the order of their nodes
    named = (mesh.boundaries or {}).items()
    return sorted_mesh.with_boundaries({n: np.sort(number[facets]) for n, facets in named})


@dataclass(frozen=True)
class Scales:
    """Units in which errors are measured."""

    length: float  # m, for positions
    force: float  # N, for imbalances
    tension: float  # N/m, of what pulls or bends the strip
    yielding: float = 0.0  # N/m, that of bending at which strip begins to flow, if nothing pulls

    @property
    def membrane(self) -> float:
        """Unit of errors of membrane forces (N/m)."""
        return max(self.tension, self.yielding)


@dataclass(frozen=True)
class Joint:
    """The exit of an endless strip goes on as its entry: u_exit = u_entry + jump."""

    entry: Index  # unknowns
    exit: Index  # those that follow
    jump: Array  # minus the way from entry to exit in the reference (m)

    def closed(self, full: Array, jump: float = 1.0) -> Array:
        """Return all unknowns, or changes of them without the jump, with those of the exit."""
        full[self.exit] = full[self.entry] + jump * self.jump
        return full

    def gathered(self, total: Array) -> Array:
        """Return a residual of all unknowns with that of the exit added to the entry's."""
        total = total.copy()
        total[self.entry] += total[self.exit]
        return total

    def folded(self, matrix: csc_matrix | Bordered, chosen: Index, free: Index) -> Any:
        """Return a tangent over free unknowns, from that over these and the exit's, (chosen,)."""
        places = np.arange(chosen.max() + 1)
        places[self.exit] = self.entry
        rows = np.flatnonzero(np.isin(places[chosen], free))
        columns = np.searchsorted(free, places[chosen[rows]])
        fold = csc_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(chosen), len(free)))
        if not isinstance(matrix, Bordered):
            return csc_matrix(fold.T @ matrix @ fold)
        inner = csc_matrix(fold.T @ matrix.inner @ fold)
        return Bordered(inner, fold.T @ matrix.columns, matrix.rows @ fold, matrix.corner)


@dataclass(frozen=True)
class Supports:
    """Free unknowns, and the motion of the others.

    u = start + λ slope + λ (λ − 1) bow, where the bow is that of a velocity that changes
    linearly.
    """

    free: Index  # numbers of the free unknowns
    start: Array  # (unknowns,); at the free ones what they are counted from
    slope: Array  # (unknowns,); zero at the free ones
    bow: Array | None = None  # (unknowns,), of a whole stage in time; a path in λ is straight
    joint: Joint | None = None  # of an endless strip

    @classmethod
    def at_rest(cls, unknowns: int, held: Index) -> Supports:
        """Some of the unknowns held at zero, the others free."""
        zero = np.zeros(unknowns)
        return cls(np.setdiff1d(np.arange(unknowns), held), zero, zero)

    def full(self, u: Array, control: float) -> Array:
        """All unknowns from the free ones, shape (unknowns,)."""
        whole = self.start + control * self.slope
        if self.bow is not None:
            whole += control * (control - 1.0) * self.bow
        whole[self.free] += u
        return whole if self.joint is None else self.joint.closed(whole)

    def rate(self, control: float) -> Array:
        """du/dλ of what is held, zero elsewhere, shape (unknowns,)."""
        bent = 0.0 if self.bow is None else (2.0 * control - 1.0) * self.bow
        return self.slope + bent

    def change(self, u: Array, control: float) -> Array:
        """Change of all unknowns with a change of the free ones and of λ."""
        whole = control * self.slope
        whole[self.free] = u
        return whole if self.joint is None else self.joint.closed(whole, 0.0)

    def gathered(self, total: Array) -> Array:
        """Residual of the free unknowns, from that of all."""
        return (total if self.joint is None else self.joint.gathered(total))[self.free]


def simple_support(strip: Strip, name: str, component: int) -> Index:
    """Unknowns that fix one component of space all along a straight edge of the mesh."""
    return strip.edge_unknowns(name, [component], (), ())


def grip(strip: Strip, name: str) -> Index:
    """Unknowns that fix positions all along an edge of a flat strip, and slopes out of its plane.

    Unlike :meth:`Strip.clamp` this leaves strains in the plane free, for strips that are pulled.
    """
    return strip.edge_unknowns(name, strip.kinematics.components, [2], ())


def symmetry(strip: Strip, name: str, component: int) -> Index:
    """Unknowns that vanish where an edge lies in a plane of symmetry.

    That component of space, normal to the plane, is odd across the edge, the others even.
    """
    others = [c for c in strip.kinematics.components if c != component]
    return strip.edge_unknowns(name, [component], others, [component])
