"""Meshes from files: rectangles or triangles in the plane z = 0, with named edges."""

from __future__ import annotations

import contextlib
import io
import warnings
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skfem import Mesh, MeshQuad
from skfem.io import from_meshio

from anmstrip.arrays import Array
from anmstrip.errors import InputError, nearest
from anmstrip.scene.schema import SceneSpec
from anmstrip.scene.tables import ENDS, LARGEST_NUMBER

ZERO_LENGTH = 1e-6
"""Lengths below this share of an element's size count as none."""

FARTHEST_ORIGIN = 1e7
"""Distance from the origin, in sizes of the mesh, at which its file has kept nine digits of it."""

CELL_NODES = {"triangle": 3, "quad": 4}
"""Of a cell."""

NAMING_ADVICE = (
    "name the sides in the mesh file: physical groups of lines (Gmsh, .msh) or node sets "
    "(Abaqus, .inp); most other formats, .vtk and .vtu too, keep no names of lines"
)
"""Advice for a mesh without names."""

EXAMPLE_ADVICE = "see meshes/README.md for meshes that are right and the commands that make them"
"""Advice for a mesh that cannot be used."""


class MeshError(ValueError):
    """A mesh cannot be used: the message says what it should be, the hint what to do."""

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
    if not (np.abs(used) <= LARGEST_NUMBER).all():
        raise MeshError(f"nodes at finite places, at most {LARGEST_NUMBER:g} m away")
    farthest, size = float(np.abs(used).max()), float(np.ptp(used, axis=0).max())
    if farthest > FARTHEST_ORIGIN * size:
        found = f"they are {farthest:.3g} m from the origin, {farthest / size:.2g} times the size"
        expected = f"nodes of which digits are left: {found} of the mesh"
        raise MeshError(expected, "the mesh with its origin near it")
    height = np.abs(used[:, 2:]).max(initial=0.0)
    if height > ZERO_LENGTH * size:
        raise MeshError(f"a flat mesh in the plane z = 0 (a node is {height:g} m off)")


def check_shapes(mesh: Mesh) -> None:
    """Refuse elements of no use, and neighbours that are not joined.

    Parameters
    ----------
    mesh : skfem.MeshQuad or skfem.MeshTri
    """
    corners = mesh.p[:, mesh.t]
    middles = corners.mean(axis=1)
    if isinstance(mesh, MeshQuad):
        low, high = corners.min(axis=1), corners.max(axis=1)
        room = ZERO_LENGTH * (high - low)
        aside = np.minimum(np.abs(corners - low[:, None]), np.abs(corners - high[:, None]))
        near = aside <= room[:, None]
        bent = np.abs(corners[:, 0] - corners[:, 1] + corners[:, 2] - corners[:, 3]) > 4.0 * room
        wrong = ~near.all(axis=(0, 1)) | bent.any(axis=0) | (high <= low).any(axis=0)
        kind, more = "rectangles with sides along x and y", "are none"
        hint = "cut the quadrilaterals into triangles, which may have any shape"
    else:
        (x1, y1), (x2, y2) = (corners[:, k] - corners[:, 0] for k in (1, 2))
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=0).max(axis=0)
        wrong = np.abs(x1 * y2 - x2 * y1) <= ZERO_LENGTH * longest**2
        kind, more, hint = "triangles with an area", "have none", ""
    if wrong.any():
        found = f"{wrong.sum()} {more}, the first at {point_text(middles[:, wrong])}"
        raise MeshError(f"{kind} ({found})", hint)
    if (covered := overlapping(mesh)).any():
        found = f"{covered.sum()} cover others, the first at {point_text(middles[:, covered])}"
        raise MeshError(f"elements side by side ({found})", "take elements out that lie on others")
    ends = mesh.p[:, mesh.facets[:, mesh.boundary_facets()]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    pairs = cKDTree(mesh.p.T).query_pairs(ZERO_LENGTH * lengths.min(), output_type="ndarray")
    if len(pairs):
        place = point_text(mesh.p[:, pairs[:, 0]])
        found = f"{len(pairs)} pairs of nodes lie at one place, the first at {place}"
        hint = "merge nodes at the same place, in Gmsh: Coherence Mesh"
        raise MeshError(f"neighbours that share their nodes ({found})", hint)
    hanging = hanging_nodes(ends, lengths)
    if hanging.size:
        place, inside = point_text(hanging), "nodes lie inside the side of another element"
        found = f"{hanging.shape[1]} {inside}, the first at {place}"
        hint = "refine without hanging nodes, or use triangles"
        raise MeshError(f"neighbours that share whole sides ({found})", hint)
    inner = mesh.f2t[:, mesh.f2t[1] >= 0]
    joined = coo_array((np.ones(inner.shape[1]), tuple(inner)), shape=2 * (mesh.nelements,))
    count, island = connected_components(joined, directed=False)
    if count > 1:
        place = point_text(middles[:, island != island[0]])
        found = f"{count} parts were found, another begins at {place}"
        raise MeshError(f"one strip, joined by whole sides ({found})", "one scene for each part")


def overlapping(mesh: Mesh) -> NDArray[np.bool_]:
    """Return which elements lie on the same side of a side as another one, (elements,)."""
    x, y = mesh.p[:, mesh.t] - mesh.p[:, mesh.t[:1]]
    left = x[1] * y[2] > x[2] * y[1]
    round_left = np.where(left, mesh.t, mesh.t[::-1]).astype(np.int64)
    sides = round_left * mesh.p.shape[1] + np.roll(round_left, -1, axis=0)
    _, number, count = np.unique(sides, return_inverse=True, return_counts=True)
    return np.asarray((count[number].reshape(sides.shape) > 1).any(axis=0))


def hanging_nodes(ends: Array, lengths: Array) -> Array:
    """Return the nodes of the boundary that lie inside one of its sides.

    Parameters
    ----------
    ends : (2, 2, sides) array
        Coordinates of the two ends of each side.
    lengths : (sides,) array

    Returns
    -------
    (2, n) array
    """
    nodes = np.unique(ends.reshape(2, -1), axis=1)
    found: set[int] = set()
    near = cKDTree(nodes.T).query_ball_point(ends.mean(axis=1).T, (0.5 - ZERO_LENGTH) * lengths)
    for k, candidates in enumerate(near):
        (x, y), (dx, dy) = ends[:, 0, k], ends[:, 1, k] - ends[:, 0, k]
        aside = np.abs((nodes[0, candidates] - x) * dy - (nodes[1, candidates] - y) * dx)
        found.update(np.asarray(candidates)[aside < ZERO_LENGTH * lengths[k] ** 2].tolist())
    return nodes[:, sorted(found)]


def point_text(points: Array) -> str:
    """Return the coordinates of the first of some points (2, n)."""
    return "({:g}, {:g})".format(*points[:, 0])


def read_mesh(scene: SceneSpec) -> Mesh:
    """Return the mesh of a scene's file, with the names of its edges.

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
    path = Path(str(scene.strip.mesh))
    try:
        mesh = named_mesh(read_silently(path))
        check_shapes(mesh)
    except MeshError as error:
        hint = error.hint or EXAMPLE_ADVICE
        raise scene.refused("strip.mesh", str(path), str(error), hint) from error
    known = sorted(mesh.boundaries or {})
    wanted = [(f"edges.{name}", name) for name in scene.edges]
    wanted += [(f"stages.{s.name}.{name}", name) for s in scene.stages for name in s.edges]
    expected = "an edge on the boundary that the mesh names"
    hints = {name: nearest(name, known) if known else NAMING_ADVICE for _, name in wanted}
    told = [(key, name, expected, hints[name]) for key, name in wanted]
    told += [("strip.mesh", name, "edges named entry and exit", NAMING_ADVICE) for name in ENDS]
    mistakes = [scene.mistake(*words) for words in told if words[1] not in known]
    if mistakes:
        raise InputError(mistakes)
    entry, exit_ = (mesh.p[:, mesh.facets[:, mesh.boundaries[name]]].mean((1, 2)) for name in ENDS)
    x, y = exit_ - entry
    if x <= abs(y):
        given = f"entry at {point_text(entry[:, None])}, exit at {point_text(exit_[:, None])}"
        hint = "turn the mesh, or name its edges the other way round"
        expected = "a mesh along x, from the entry at the least x to the exit at the greatest"
        raise scene.refused("strip.mesh", given, expected, hint)
    return mesh


def read_silently(path: Path) -> meshio.Mesh:
    """Return the contents of a file, as meshio reads it; it neither prints nor leaves Python."""
    silence = io.StringIO()
    try:
        with (
            warnings.catch_warnings(),
            contextlib.redirect_stdout(silence),
            contextlib.redirect_stderr(silence),
        ):
            warnings.simplefilter("ignore")
            return meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio exits where no reader is right
        reason = str(error) or type(error).__name__
        expected = f"a mesh of quadrilaterals or triangles that meshio reads ({reason})"
        raise MeshError(expected) from error


def named_mesh(raw: meshio.Mesh) -> Mesh:
    """Return the quadrilaterals or triangles of a file, with names of sides of the boundary.

    A set of lines is an edge if all of them lie on the boundary; a set of nodes is one if each
    of them is an end of a side between two of the set.  Nodes of no cell are left out.
    """
    kinds = {block.type for block in raw.cells if len(block.data)} - {"vertex", "line"}
    if len(kinds) != 1 or not kinds <= set(CELL_NODES):
        found = f"{', '.join(sorted(kinds))} were found" if kinds else "no cells were found"
        raise MeshError(f"quadrilaterals alone or triangles alone, of straight sides ({found})")
    (kind,) = kinds
    cells = raw.get_cells_type(kind).astype(np.int64)
    whole = cells.shape[1:] == (CELL_NODES[kind],)
    if not whole or cells.min() < 0 or cells.max() >= len(raw.points):
        raise MeshError("cells of nodes that exist (it is damaged)")
    check_flat(raw.points, cells)
    own = [name for name in raw.cell_data if name.startswith("skfem:")]
    saved = {name: [raw.get_cell_data(name, kind)] for name in own}
    mesh = from_meshio(meshio.Mesh(raw.points[:, :2], [(kind, cells)], cell_data=saved))
    boundary = mesh.boundary_facets()
    sides = mesh.facets[:, boundary].T
    edges = {name: np.asarray(facets) for name, facets in (mesh.boundaries or {}).items()}
    for name, nodes in raw.point_sets.items():
        chosen = np.isin(sides, nodes).all(axis=1)
        if chosen.any() and np.isin(nodes, sides[chosen]).all():
            edges[name] = boundary[chosen]
    for name, lines in line_sets(raw).items():
        size = 1 + max(sides.max(initial=0), lines.max(initial=0))
        own, given = (np.sort(pairs, axis=1) @ [size, 1] for pairs in (sides, lines))
        if np.isin(given, own).all():
            edges[name] = boundary[np.isin(own, given)]
    used, cells = np.unique(mesh.t, return_inverse=True)
    cells = cells.reshape(mesh.t.shape)
    if kind == "quad":  # the first side of rectangles along y, as in a grid
        first = np.abs(np.diff(mesh.p[:, mesh.t[:2]], axis=1)[:, 0])
        cells = np.where(first[0] > first[1], np.roll(cells, 1, axis=0), cells)
    smaller = type(mesh)(mesh.p[:, used], cells)
    return smaller.with_boundaries(edges)  # facets are in the order of their nodes, which stays


def line_sets(raw: meshio.Mesh) -> dict[str, NDArray[np.int64]]:
    """Return the lines (n, 2) of every named group: physical groups and sets of cells."""
    tags = raw.cell_data.get("gmsh:physical", [np.empty(0)] * len(raw.cells))
    found: dict[str, list[NDArray[np.int64]]] = {}
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
