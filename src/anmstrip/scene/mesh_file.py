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
from numpy.typing import NDArray
from skfem import Mesh
from skfem.io import from_meshio

from anmstrip.mechanics.strip import renumbered
from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.mesh_checks import Unfit, check_flat, check_shapes
from anmstrip.scene.wording import nearest

if TYPE_CHECKING:
    from anmstrip.scene.schema import Scene

Index = NDArray[np.int64]
Chosen = NDArray[np.bool_]

NAMING = (
    "name the sides in the mesh file: physical groups of lines (Gmsh, .msh) or node sets "
    "(Abaqus, .inp); most other formats, .vtk and .vtu too, keep no names of lines"
)
_BELOW = "vertex", "line"
_EXAMPLES = "see meshes/README.md for meshes that are right and the commands that make them"


def read_mesh(scene: Scene) -> Mesh:
    """Mesh of a scene's file, nodes numbered along the strip.

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
    return renumbered(mesh)


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


def _unknown_edges(scene: Scene, known: list[str], file: str) -> Iterator[Mistake]:
    wanted = [(f"edges.{name}", name) for name in scene.edges]
    wanted += [(f"stages.{s.name}.{name}", name) for s in scene.stages for name in s.edges]
    for key, name in wanted:
        if name not in known:
            expected = "an edge on the boundary that the mesh names"
            yield Mistake(file, key, name, expected, nearest(name, known) if known else NAMING)
    for name in ("entry", "exit"):
        if name not in known:
            yield Mistake(file, "strip.mesh", name, "edges named entry and exit", NAMING)
