"""Meshes from files: rectangles or triangles in the plane z = 0, with named edges."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import meshio
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from skfem import Mesh, MeshQuad
from skfem.io import from_meshio

from anmstrip.errors import InputError, Mistake
from anmstrip.scene.messages import nearest

if TYPE_CHECKING:
    from anmstrip.scene.schema import SceneSpec

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


Index = NDArray[np.int64]
Chosen = NDArray[np.bool_]

NAMING = (
    "name the sides in the mesh file: physical groups of lines (Gmsh, .msh) or node sets "
    "(Abaqus, .inp); most other formats, .vtk and .vtu too, keep no names of lines"
)
_BELOW = "vertex", "line"
_EXAMPLES = "see meshes/README.md for meshes that are right and the commands that make them"


def read_mesh(scene: SceneSpec) -> Mesh:
    """Mesh of a scene's file, with the names of its edges.

    Any file that meshio reads will do.  Edges are sides of the boundary with a name: groups
    of lines, sets of nodes, or boundaries that scikit-fem saved.

    Returns
    -------
    skfem.MeshQuad or skfem.MeshTri
        Axis-aligned rectangles, or triangles.

    Raises
    ------
    InputError
        Unreadable, other or mixed cells, not flat, cells without area or not joined, or edges of
        the scene missing.
    """
    path, file = Path(str(scene.strip.mesh)), str(scene.source or "scene")
    try:
        raw = _read(path)
        mesh = _with_edges(_unnamed(raw), raw)
        check_shapes(mesh)
    except Unfit as error:
        expected, hint = str(error), error.hint or _EXAMPLES
        raise InputError([Mistake(file, "strip.mesh", str(path), expected, hint)]) from error
    if mistakes := list(_unknown_edges(scene, sorted(mesh.boundaries or {}), file)):
        raise InputError(mistakes)
    return mesh


def _read(path: Path) -> meshio.Mesh:
    try:
        with warnings.catch_warnings(), _silent():
            warnings.simplefilter("ignore")
            return meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio leaves Python where no reader is right
        reason = str(error) or type(error).__name__
        raise Unfit(
            f"a mesh of quadrilaterals or triangles that meshio reads ({reason})"
        ) from error


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Keep meshio from printing."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        yield


def _unnamed(raw: meshio.Mesh) -> Mesh:
    """Quadrilaterals or triangles of a file, on all of its nodes."""
    kinds = {block.type for block in raw.cells if len(block.data)} - set(_BELOW)
    if kinds not in ({"quad"}, {"triangle"}):
        found = f"{', '.join(sorted(kinds))} were found" if kinds else "no cells were found"
        raise Unfit(f"quadrilaterals alone or triangles alone, of straight sides ({found})")
    (kind,) = kinds
    cells = _gathered(raw, kind, [block.data for block in raw.cells]).astype(np.int64)
    if cells.min() < 0 or cells.max() >= len(raw.points):
        raise Unfit("cells of nodes that exist (it is damaged)")
    check_flat(raw.points, cells)
    saved = {
        name: [_gathered(raw, kind, blocks)]
        for name, blocks in raw.cell_data.items()
        if name.startswith("skfem:")
    }
    return from_meshio(meshio.Mesh(raw.points[:, :2], [(kind, cells)], cell_data=saved))


def _gathered(raw: meshio.Mesh, kind: str, blocks: list[Any]) -> NDArray[Any]:
    """What belongs to all cells of one kind, out of what belongs to each block."""
    chosen = [values for block, values in zip(raw.cells, blocks, strict=True) if block.type == kind]
    return np.concatenate([np.asarray(values) for values in chosen])


def _with_edges(mesh: Mesh, raw: meshio.Mesh) -> Mesh:
    """Name the sides that lie on the boundary, and leave out nodes that no cell uses.

    Facets are numbered in the order of their nodes, which stays the same.
    """
    boundary = mesh.boundary_facets()
    sides = mesh.facets[:, boundary].T
    named = {name: _sides_of_nodes(sides, nodes) for name, nodes in _node_sets(raw).items()}
    named |= {name: _sides_of_lines(sides, pairs) for name, pairs in _line_sets(raw).items()}
    edges = {name: np.asarray(facets) for name, facets in (mesh.boundaries or {}).items()}
    edges |= {name: boundary[chosen] for name, chosen in named.items() if chosen.any()}
    used, cells = np.unique(mesh.t, return_inverse=True)
    smaller = type(mesh)(mesh.p[:, used], cells.reshape(mesh.t.shape))
    return smaller.with_boundaries(edges)


def _sides_of_lines(sides: Index, pairs: Index) -> Chosen:
    """Which sides are among lines; none if a line is not on the boundary."""
    return _among(sides, pairs) & _among(pairs, sides).all()


def _sides_of_nodes(sides: Index, nodes: Index) -> Chosen:
    """Which sides are between nodes of a set; none if a node is on none of them."""
    chosen = np.isin(sides, nodes).all(axis=1)
    covered = np.isin(nodes, sides[chosen]).all()
    return np.asarray(chosen & covered)


def _among(pairs: Index, others: Index) -> Chosen:
    """Which pairs of nodes are among others, in whatever direction, shape (pairs,)."""
    size = 1 + max(pairs.max(initial=0), others.max(initial=0))
    first, second = (np.sort(p, axis=1) @ np.array([size, 1]) for p in (pairs, others))
    return np.isin(first, second)


def _line_sets(raw: meshio.Mesh) -> Mapping[str, Index]:
    """Lines of every named group, shape (lines, 2): physical groups and sets of cells."""
    tags = raw.cell_data.get("gmsh:physical", [np.empty(0)] * len(raw.cells))
    found: dict[str, list[Index]] = {}
    for k, block in enumerate(raw.cells):
        if block.type != "line":
            continue
        for name, (tag, dimension) in raw.field_data.items():
            if dimension == 1:
                found.setdefault(name, []).append(block.data[np.asarray(tags[k]) == tag])
        for name, sets in raw.cell_sets.items():
            if not name.startswith("gmsh:") and sets[k] is not None:
                found.setdefault(name, []).append(block.data[np.asarray(sets[k], dtype=np.int64)])
    joined = {name: np.concatenate(lines).astype(np.int64) for name, lines in found.items()}
    return {name: lines for name, lines in joined.items() if len(lines)}


def _node_sets(raw: meshio.Mesh) -> Mapping[str, Index]:
    return {name: np.asarray(n, dtype=np.int64) for name, n in raw.point_sets.items() if len(n)}


def _unknown_edges(scene: SceneSpec, known: list[str], file: str) -> Iterator[Mistake]:
    wanted = [(f"edges.{name}", name) for name in scene.edges]
    wanted += [(f"stages.{s.name}.{name}", name) for s in scene.stages for name in s.edges]
    for key, name in wanted:
        if name not in known:
            expected = "an edge on the boundary that the mesh names"
            yield Mistake(file, key, name, expected, nearest(name, known) if known else NAMING)
    for name in ("entry", "exit"):
        if name not in known:
            yield Mistake(file, "strip.mesh", name, "edges named entry and exit", NAMING)
