"""What a mesh from a file must be before a strip is made of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from skfem import Mesh, MeshQuad

Array = NDArray[np.float64]

NEARLY = 1e-6
"""Lengths below this share of an element's size count as none."""


class Unfit(ValueError):  # noqa: N818
    """A mesh cannot be used; the message says what it should be.

    Parameters
    ----------
    expected : str
    hint : str
        What to do; empty if examples help more.
    """

    def __init__(self, expected: str, hint: str = "") -> None:
        super().__init__(expected)
        self.hint = hint


def check_flat(points: ArrayLike, cells: ArrayLike) -> None:
    """Refuse nodes of cells that are no numbers or not in the plane z = 0.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array
    cells : (m, k) array of int
    """
    used = np.asarray(points, dtype=float)[np.unique(cells)]
    if not np.isfinite(used).all():
        raise Unfit("nodes at finite places")
    height = np.abs(used[:, 2:]).max(initial=0.0)
    if height > NEARLY * np.ptp(used, axis=0).max():
        raise Unfit(f"a flat mesh in the plane z = 0 (a node is {height:g} m off)")


def check_shapes(mesh: Mesh) -> None:
    """Refuse elements of no use, and neighbours that are not joined.

    Parameters
    ----------
    mesh : skfem.MeshQuad or skfem.MeshTri
    """
    if isinstance(mesh, MeshQuad):
        _check_rectangles(mesh)
    else:
        _check_triangles(mesh)
    _check_joined(mesh)


def _check_triangles(mesh: Mesh) -> None:
    corners = mesh.p[:, mesh.t]
    (x1, y1), (x2, y2) = (corners[:, k] - corners[:, 0] for k in (1, 2))
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=0).max(axis=0)
    flat = np.abs(x1 * y2 - x2 * y1) <= NEARLY * longest**2
    if flat.any():
        place = _told(corners.mean(axis=1)[:, flat])
        raise Unfit(f"triangles with an area ({flat.sum()} have none, the first at {place})")


def _check_rectangles(mesh: Mesh) -> None:
    corners = mesh.p[:, mesh.t]
    low, high = corners.min(axis=1), corners.max(axis=1)
    room = NEARLY * (high - low)
    near = np.abs(corners - low[:, None]) <= room[:, None]
    near |= np.abs(corners - high[:, None]) <= room[:, None]
    bent = np.abs(corners[:, 0] - corners[:, 1] + corners[:, 2] - corners[:, 3]) > 4.0 * room
    wrong = ~near.all(axis=(0, 1)) | bent.any(axis=0) | (high <= low).any(axis=0)
    if wrong.any():
        place = _told(corners.mean(axis=1)[:, wrong])
        raise Unfit(
            f"rectangles with sides along x and y ({wrong.sum()} are none, the first at {place})",
            "cut the quadrilaterals into triangles, which may have any shape",
        )


def _check_joined(mesh: Mesh) -> None:
    """Refuse nodes at one place, and nodes in the middle of a neighbour's side."""
    ends = mesh.p[:, mesh.facets[:, mesh.boundary_facets()]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    pairs = cKDTree(mesh.p.T).query_pairs(NEARLY * lengths.min(), output_type="ndarray")
    if len(pairs):
        raise Unfit(
            f"neighbours that share their nodes ({len(pairs)} pairs of nodes lie at one place, "
            f"the first at {_told(mesh.p[:, pairs[:, 0]])})",
            "merge nodes at the same place, in Gmsh: Coherence Mesh",
        )
    hanging = _hanging(ends, lengths)
    if hanging.size:
        raise Unfit(
            f"neighbours that share whole sides ({hanging.shape[1]} nodes lie inside the side of "
            f"another element, the first at {_told(hanging)})",
            "refine without hanging nodes, or use triangles",
        )


def _hanging(ends: Array, lengths: Array) -> Array:
    """Nodes of the boundary that lie inside one of its sides (2, 2, sides), shape (2, n)."""
    nodes = np.unique(ends.reshape(2, -1), axis=1)
    found: set[int] = set()
    near = cKDTree(nodes.T).query_ball_point(ends.mean(axis=1).T, (0.5 - NEARLY) * lengths)
    for k, candidates in enumerate(near):
        (x, y), (dx, dy) = ends[:, 0, k], ends[:, 1, k] - ends[:, 0, k]
        aside = np.abs((nodes[0, candidates] - x) * dy - (nodes[1, candidates] - y) * dx)
        found.update(np.asarray(candidates)[aside < NEARLY * lengths[k] ** 2].tolist())
    return nodes[:, sorted(found)]


def _told(places: Array) -> str:
    return "({:g}, {:g})".format(*places[:, 0])
