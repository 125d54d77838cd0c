"""Meshes of rectangles and of triangles from files of many kinds, and what is wrong with some."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import skfem

from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.fem.strip import grid, renumbered
from anmstrip.scene.mesh_file import read_mesh

EDGES = {"entry": (0, -1.0), "exit": (0, 1.0), "left": (1, 0.4), "right": (1, -0.4)}
NODES = np.random.default_rng(2).permutation(15)
"""Numbers in the file of the grid's nodes."""

Parts = tuple[Any, Any, dict[str, Any]]


def parts(kind: str) -> Parts:
    """Points (n, 3), cells and lines of named edges; triangles are of all shapes."""
    mesh = grid(np.array([-1.0, -0.3, 0.0, 0.3, 1.0]), np.array([-0.4, 0.0, 0.4]))
    points = np.zeros((15, 3))
    points[NODES, :2] = mesh.p.T
    edges = {name: NODES[mesh.facets[:, f]].T for name, f in mesh.boundaries.items()}
    cells = NODES[mesh.t].T
    if kind == "triangle":
        inner = np.flatnonzero((np.abs(points[:, :2]) < [0.9, 0.3]).all(axis=1))
        points[inner, :2] += np.random.default_rng(4).uniform(-0.1, 0.1, (len(inner), 2))
        cells = np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 3, 2]]])
    return points, cells, edges


def scene_of(path: Path, edge: str = "entry") -> Scene:
    return Scene.model_validate(
        {
            "strip": {"thickness": 1e-3, "mesh": str(path)},
            "material": {"young": 2e11, "poisson": 0.3},
            "edges": {edge: {"fixed": ["x", "z"]}},
            "stages": [{"name": "pull", "duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}}],
        }
    )


def gmsh(path: Path, kind: str, made: Parts, version: str, surface: int = 1) -> None:
    """Physical groups, the surface's first; lines and surfaces are numbered on their own."""
    points, cells, edges = made
    blocks = [("line", lines) for lines in edges.values()] + [(kind, cells)]
    tags = [np.full(len(lines), k + 1) for k, lines in enumerate(edges.values())]
    tags.append(np.full(len(cells), surface))
    owners = np.tile([2, surface], (len(points), 1))
    for name in ("left", "right", "entry", "exit"):
        owners[edges[name]] = [1, list(edges).index(name) + 1]
    names = {name: np.array([k + 1, 1]) for k, name in enumerate(edges)}
    mesh = meshio.Mesh(
        points,
        blocks,
        point_data={"gmsh:dim_tags": owners} if version == "4.1" else {},
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"sheet": np.array([surface, 2]), **names},
    )
    meshio.gmsh.write(path, mesh, version, binary=False)


def nodes(path: Path, kind: str, made: Parts) -> None:
    points, cells, edges = made
    sets = {name: np.unique(lines) for name, lines in edges.items()}
    sets["every"] = np.arange(len(points))
    meshio.Mesh(points, [(kind, cells)], point_sets=sets).write(path)


def lines(path: Path, kind: str, made: Parts) -> None:
    points, cells, edges = made
    blocks = [(kind, cells)] + [("line", pairs) for pairs in edges.values()]
    empty = np.empty(0, dtype=int)
    sets = {
        name: [
            np.arange(len(data)) if k == own + 1 else empty for k, (_, data) in enumerate(blocks)
        ]
        for own, name in enumerate(edges)
    }
    meshio.Mesh(points, blocks, cell_sets=sets).write(path)


def saved_by_scikit_fem(path: Path, kind: str, made: Parts) -> None:
    points, cells, edges = made
    mesh = {"quad": skfem.MeshQuad, "triangle": skfem.MeshTri}[kind](points[:, :2].T, cells.T)
    sides = np.sort(mesh.facets.T, axis=1).tolist()
    named = {n: np.array([sides.index(sorted(p)) for p in e.tolist()]) for n, e in edges.items()}
    mesh.with_boundaries(named).save(str(path))


def nameless(path: Path, kind: str, made: Parts) -> None:
    points, cells, edges = made
    blocks = [(kind, cells), ("line", np.concatenate(list(edges.values())))]
    meshio.Mesh(points, blocks).write(path, "gmsh22" if path.suffix == ".msh" else None)


FORMATS: dict[str, tuple[str, Callable[..., None], tuple[Any, ...]]] = {
    "gmsh 2": ("strip.msh", gmsh, ("2.2",)),
    "gmsh 4": ("strip.msh", gmsh, ("4.1",)),
    "abaqus, sets of nodes": ("strip.inp", nodes, ()),
    "abaqus, sets of lines": ("strip.inp", lines, ()),
    "vtk of scikit-fem": ("strip.vtk", saved_by_scikit_fem, ()),
    "vtu of scikit-fem": ("strip.vtu", saved_by_scikit_fem, ()),
}


@pytest.mark.parametrize("kind", ["quad", "triangle"])
@pytest.mark.parametrize("name", FORMATS)
def test_format_keeps_cells_and_names(tmp_path: Path, name: str, kind: str) -> None:
    file, write, more = FORMATS[name]
    made = parts(kind)
    write(tmp_path / file, kind, made, *more)
    mesh = renumbered(read_mesh(scene_of(tmp_path / file)))
    assert type(mesh) is {"quad": skfem.MeshQuad, "triangle": skfem.MeshTri}[kind]
    np.testing.assert_array_less(-1e-12, np.diff(mesh.p[0]))
    order = np.lexsort(made[0].T[1::-1])
    np.testing.assert_allclose(mesh.p.T, made[0][order, :2], atol=1e-12)
    place = np.argsort(order)
    assert sorted(map(sorted, mesh.t.T.tolist())) == sorted(map(sorted, place[made[1]].tolist()))
    assert set(mesh.boundaries) == set(EDGES)
    for edge, (axis, position) in EDGES.items():
        facets = mesh.facets[:, mesh.boundaries[edge]]
        assert facets.shape[1] == (2 if axis == 0 else 4)
        np.testing.assert_allclose(mesh.p[axis, facets], position)


def mistakes(scene: Scene) -> dict[str, Any]:
    """What is found wrong, by its key."""
    with pytest.raises(InputError) as caught:
        read_mesh(scene)
    return {mistake.key: mistake for mistake in caught.value.mistakes}


@pytest.mark.parametrize("file", ["strip.vtk", "strip.vtu", "strip.mesh", "strip.msh"])
def test_file_without_names_tells_how_to_name(tmp_path: Path, file: str) -> None:
    nameless(tmp_path / file, "triangle", parts("triangle"))
    found = mistakes(scene_of(tmp_path / file))
    assert set(found) == {"edges.entry", "stages.pull.exit", "strip.mesh"}
    for mistake in found.values():
        for word in ("physical groups", ".msh", "node sets", ".inp", ".vtu"):
            assert word in mistake.hint


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_lines_inside_are_no_edge(tmp_path: Path, kind: str) -> None:
    points, cells, edges = parts(kind)
    edges["seam"] = np.array([[NODES[6], NODES[7]], [NODES[7], NODES[8]]])
    gmsh(tmp_path / "strip.msh", kind, (points, cells, edges), "2.2")
    assert set(read_mesh(scene_of(tmp_path / "strip.msh")).boundaries) == set(EDGES)
    (key,) = found = mistakes(scene_of(tmp_path / "strip.msh", "seam"))
    assert key == "edges.seam"
    assert "boundary" in found[key].expected


def test_nodes_of_no_cell_are_left_out(tmp_path: Path) -> None:
    """Gmsh writes the middle of a circle's arc."""
    points, cells, edges = parts("triangle")
    points = np.insert(points, 4, [[0.1, 0.1, 0.0]], axis=0)
    cells = cells + (cells >= 4)
    edges = {name: lines + (lines >= 4) for name, lines in edges.items()}
    gmsh(tmp_path / "strip.msh", "triangle", (points, cells, edges), "2.2")
    mesh = read_mesh(scene_of(tmp_path / "strip.msh"))
    assert mesh.p.shape == (2, 15)
    np.testing.assert_allclose(mesh.p[0, mesh.facets[:, mesh.boundaries["exit"]]], 1.0)


def flat_triangle(points: Any, cells: Any) -> tuple[Any, Any]:
    points[cells[3, 2]] = points[cells[3, :2]].mean(axis=0)
    return points, cells


def repeated_node(points: Any, cells: Any) -> tuple[Any, Any]:
    cells[3, 1] = cells[3, 0]
    return points, cells


def not_merged(points: Any, cells: Any) -> tuple[Any, Any]:
    """A slit along y = 0, from x = 0 on."""
    row = NODES[[7, 10, 13]]
    upper = points[cells, 1].mean(axis=1) > 0.0
    points = np.vstack([points, points[row]])
    for k, node in enumerate(row):
        cells[upper] = np.where(cells[upper] == node, 15 + k, cells[upper])
    return points, cells


def hanging(points: Any, cells: Any) -> tuple[Any, Any]:
    """One of two neighbours is cut through the middle of their side."""
    side = NODES[[6, 7]]
    k = np.flatnonzero(np.isin(cells, side).sum(axis=1) == 2)[0]
    (apex,) = set(cells[k]) - set(side)
    points = np.vstack([points, points[side].mean(axis=0)])
    halves = [[apex, end, 15] for end in side]
    return points, np.vstack([np.delete(cells, k, axis=0), halves])


def twice(points: Any, cells: Any) -> tuple[Any, Any]:
    return points, np.vstack([cells, cells[3:4]])


def tangled(points: Any, cells: Any) -> tuple[Any, Any]:
    """A node inside is drawn beyond its neighbours, so that triangles lie on others."""
    inside = np.abs(points[:, :2]).sum(axis=1).argmin()
    points[inside, 0] += 0.75 * np.ptp(points[:, 0])
    return points, cells


def lifted(points: Any, cells: Any) -> tuple[Any, Any]:
    points[4, 2] = 0.01
    return points, cells


def unknown_place(points: Any, cells: Any) -> tuple[Any, Any]:
    points[4, 0] = np.nan
    return points, cells


@pytest.mark.parametrize(
    ("spoil", "about"),
    [
        (flat_triangle, "with an area"),
        (repeated_node, "with an area"),
        (not_merged, "share their nodes"),
        (hanging, "share whole sides"),
        (twice, "cover others"),
        (tangled, "cover others"),
        (lifted, "0.01 m off"),
        (unknown_place, "finite"),
    ],
)
def test_spoilt_triangles_are_refused(tmp_path: Path, spoil: Any, about: str) -> None:
    points, cells, edges = parts("triangle")
    gmsh(tmp_path / "strip.msh", "triangle", (*spoil(points, cells), edges), "2.2")
    found = mistakes(scene_of(tmp_path / "strip.msh"))
    assert set(found) == {"strip.mesh"}
    assert about in found["strip.mesh"].expected
    assert found["strip.mesh"].hint


def test_a_crossed_rectangle_is_refused(tmp_path: Path) -> None:
    points, cells, edges = parts("quad")
    cells[2] = cells[2, [0, 2, 1, 3]]
    gmsh(tmp_path / "strip.msh", "quad", (points, cells, edges), "2.2")
    assert "rectangles" in mistakes(scene_of(tmp_path / "strip.msh"))["strip.mesh"].expected


OTHERS = {
    "quad, triangle": [("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]])],
    "tetra": [("tetra", [[0, 1, 2, 5]])],
    "triangle6": [("triangle6", [[0, 1, 2, 3, 4, 5]])],
}


@pytest.mark.parametrize("found", OTHERS)
def test_other_cells_are_refused_by_name(tmp_path: Path, found: str) -> None:
    points = np.random.default_rng(1).uniform(size=(6, 3)) * [1.0, 1.0, 0.0]
    cells = [(kind, np.array(data)) for kind, data in OTHERS[found]]
    meshio.Mesh(points, cells).write(tmp_path / "strip.vtu")
    expected = mistakes(scene_of(tmp_path / "strip.vtu"))["strip.mesh"].expected
    assert expected.endswith(f"({found} were found)")


def test_meshes_of_the_project_are_read() -> None:
    folder = Path(__file__).parents[2] / "meshes"
    files = sorted(folder.glob("*.msh"))
    assert len(files) >= 4
    for path in files:
        mesh = read_mesh(scene_of(path))
        assert set(EDGES) <= set(mesh.boundaries)
        assert len(mesh.boundaries["entry"]) >= 2


def test_reading_prints_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nameless(tmp_path / "strip.vtk", "quad", parts("quad"))
    (tmp_path / "strip.inp").write_text("nonsense")
    capsys.readouterr()
    for name in ("strip.vtk", "strip.inp"):
        assert mistakes(scene_of(tmp_path / name))
    assert capsys.readouterr() == ("", "")
