"""The strip: mid-surface, mesh, named edges and C1 basis.

Reference configuration: flat in the plane z = 0, x along the strip (entry at
its smallest x), y across.  Every component of the displacement is a scalar
field of the C1 basis; degree of freedom s of component c has the number 3 s + c.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, MeshQuad

from .elements import BognerFoxSchmit

Array = NDArray[np.float64]
Index = NDArray[np.int64]

EDGES = ("entry", "exit", "left", "right")


@dataclass(frozen=True)
class Material:
    """Isotropic linear elasticity.

    Attributes
    ----------
    young : float
        E (Pa).
    poisson : float
        ν.
    density : float
        ρ (kg/m³).
    """

    young: float
    poisson: float
    density: float = 0.0


@dataclass(frozen=True)
class Edge:
    """A named edge of the strip.

    Attributes
    ----------
    name : str
    nodes : ndarray of int
        Mesh nodes on it, in the order along the edge.
    values : ndarray of int
        Scalar degrees of freedom "value" of these nodes.
    slopes : ndarray of int
        Scalar degrees of freedom "derivative along the edge".
    load : ndarray, shape (scalars,)
        ∫ φ ds of the cubic traces: generalised force of a unit force per length.
    length : float
        m.
    """

    name: str
    nodes: Index
    values: Index
    slopes: Index
    load: Array
    length: float


class Strip:
    """Thin sheet with a C1 discretization.

    Parameters
    ----------
    mesh : skfem.MeshQuad
        Axis-aligned rectangles, with named boundaries.
    thickness : float
        t (m).
    material : Material
    """

    def __init__(self, mesh: MeshQuad, thickness: float, material: Material) -> None:
        self.mesh = mesh
        self.thickness = thickness
        self.material = material
        self.basis = Basis(mesh, BognerFoxSchmit(), intorder=6)

    @property
    def membrane_stiffness(self) -> float:
        """E t / (1 − ν²) (N/m)."""
        return self.material.young * self.thickness / (1.0 - self.material.poisson**2)

    @property
    def bending_stiffness(self) -> float:
        """D = E t³ / 12 (1 − ν²) (N m)."""
        return self.membrane_stiffness * self.thickness**2 / 12.0

    @property
    def scalars(self) -> int:
        """Number of degrees of freedom of one component."""
        return int(self.basis.N)

    @property
    def unknowns(self) -> int:
        """Number of degrees of freedom of the three components."""
        return 3 * self.scalars

    @property
    def nodes(self) -> Array:
        """Reference positions of the mesh nodes, shape (3, nodes)."""
        return np.vstack([self.mesh.p, np.zeros(self.mesh.p.shape[1])])

    @property
    def node_values(self) -> Index:
        """Scalar degree of freedom "value" of every mesh node."""
        return self.basis.nodal_dofs[0]

    @property
    def length(self) -> float:
        """Extent along x (m)."""
        return float(np.ptp(self.mesh.p[0]))

    @property
    def width(self) -> float:
        """Extent along y (m)."""
        return float(np.ptp(self.mesh.p[1]))

    @cached_property
    def cell_sizes(self) -> Array:
        """Extent of every element in x and y, shape (2, elements)."""
        return np.ptp(self.mesh.p[:, self.mesh.t], axis=1)

    @cached_property
    def dof_lengths(self) -> Array:
        """Unit of every scalar degree of freedom in lengths: 1, 1/h_x, 1/h_y, 1/(h_x h_y).

        h is the mean size of the elements around the node.
        """
        count = np.bincount(self.mesh.t.ravel(), minlength=self.mesh.p.shape[1])
        hx, hy = (
            np.bincount(self.mesh.t.ravel(), np.tile(s, 4), self.mesh.p.shape[1]) / count
            for s in self.cell_sizes
        )
        lengths = np.empty(self.scalars)
        units = np.stack([np.ones_like(hx), 1.0 / hx, 1.0 / hy, 1.0 / (hx * hy)])
        lengths[self.basis.nodal_dofs] = units
        return lengths

    @cached_property
    def edges(self) -> dict[str, Edge]:
        """All named edges."""
        return {name: self._edge(name) for name in (self.mesh.boundaries or {})}

    def clamp(self, name: str) -> Index:
        """Unknowns that a rigid clamp holds on an edge: positions and tangent plane.

        With the values and slopes of the nodes, the cubic traces of r and of its
        derivative across the edge are held all along it.
        """
        scalars = self.basis.nodal_dofs[:, self.edges[name].nodes].ravel()
        return np.sort((3 * scalars[:, None] + np.arange(3)).ravel())

    def _edge(self, name: str) -> Edge:
        facets = np.asarray(self.mesh.boundaries[name])
        nodes = np.unique(self.mesh.facets[:, facets])
        along = int(np.argmax(np.ptp(self.mesh.p[:, nodes], axis=1)))
        nodes = nodes[np.argsort(self.mesh.p[along, nodes])]
        values = self.basis.nodal_dofs[0, nodes]
        slopes = self.basis.nodal_dofs[1 + along, nodes]
        h = np.diff(self.mesh.p[along, nodes])
        load = np.zeros(self.scalars)
        for ends in (slice(None, -1), slice(1, None)):
            load[values[ends]] += h / 2.0
        load[slopes[:-1]] += h**2 / 12.0
        load[slopes[1:]] -= h**2 / 12.0
        return Edge(name, nodes, values, slopes, load, float(h.sum()))


def grid(xs: Array, ys: Array) -> MeshQuad:
    """Rectangular mesh with the four edges named, nodes numbered along the strip.

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


def renumbered(mesh: MeshQuad) -> MeshQuad:
    """The same mesh with nodes numbered along x, then y, which makes matrices narrow.

    Boundaries keep their names.
    """
    scale = 1e-9 * np.ptp(mesh.p, axis=1).max()
    order = np.lexsort((mesh.p[1], np.round(mesh.p[0] / scale) * scale))
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    middles = {
        name: mesh.p[:, mesh.facets[:, np.asarray(facets)]].mean(axis=1)
        for name, facets in (mesh.boundaries or {}).items()
    }
    sorted_mesh = MeshQuad(mesh.p[:, order], place[mesh.t])
    return sorted_mesh.with_boundaries(
        {name: _facets_at(sorted_mesh, points) for name, points in middles.items()}
    )


def _facets_at(mesh: MeshQuad, points: Array) -> Index:
    """Numbers of the boundary facets whose midpoints are given, shape (2, m)."""
    facets = mesh.boundary_facets()
    middles = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    distance = np.abs(middles[:, :, None] - points[:, None, :]).sum(axis=0)
    return facets[np.unique(distance.argmin(axis=0))]
