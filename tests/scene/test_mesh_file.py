"""Strips from mesh files, and what is refused of them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from skfem import MeshTri

from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.fem.strip import grid
from anmstrip.simulation.problem import Assembly

XS, YS = np.array([-1.0, -0.3, 0.0, 0.3, 1.0]), np.array([-0.4, 0.0, 0.4])


def tables(**strip: Any) -> dict[str, Any]:
    return {
        "strip": {"thickness": 1e-3, **strip},
        "material": {"young": 2e11, "poisson": 0.3},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
        "stages": [
            {"name": "pull", "duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}},
            {"name": "lift", "duration": 1.0, "exit": {"force": [1e4, 0.0, 100.0]}},
        ],
    }


def scene_of(mesh: Path, **others: Any) -> Scene:
    return Scene.model_validate({**tables(mesh=str(mesh)), **others})


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Path]:
    """Write a mesh, made of given cells and named edges, in Gmsh's format 2."""

    def write(points: Any, cells: list[Any], edges: dict[str, Any]) -> Path:
        lines = [np.asarray(pairs) for pairs in edges.values()]
        numbers = [np.full(len(c[1]), 99) for c in cells]
        numbers += [np.full(len(pairs), i + 1) for i, pairs in enumerate(lines)]
        mesh = meshio.Mesh(
            np.column_stack([points, np.zeros(len(points))]),
            [*cells, *(("line", pairs) for pairs in lines)],
            cell_data={"gmsh:physical": numbers, "gmsh:geometrical": numbers},
            field_data={name: np.array([i + 1, 1]) for i, name in enumerate(edges)},
        )
        path = tmp_path / "strip.msh"
        meshio.gmsh.write(path, mesh, "2.2", binary=False)
        return path

    return write


def generated(leave_out: tuple[str, ...] = (), shuffle: int = 3) -> tuple[Any, Any, Any]:
    """Points, quadrilaterals and edges of the grid, numbered at random."""
    mesh = grid(XS, YS)
    order = np.random.default_rng(shuffle).permutation(mesh.p.shape[1])
    place = np.argsort(order)
    edges = {n: place[mesh.facets[:, f]].T for n, f in mesh.boundaries.items()}
    edges = {name: pairs for name, pairs in edges.items() if name not in leave_out}
    return mesh.p[:, order].T, [("quad", place[mesh.t].T)], edges


def test_scene_of_a_file_is_that_of_the_numbers(written: Callable[..., Path]) -> None:
    own = Scene.model_validate(tables(length=2.0, width=0.8, cells=[4, 2]))
    uniform = grid(np.linspace(-1, 1, 5), np.linspace(-0.4, 0.4, 3))
    edges = {n: uniform.facets[:, f].T for n, f in uniform.boundaries.items()}
    file = scene_of(written(uniform.p.T, [("quad", uniform.t.T)], edges))
    runs = [own.run(), file.run()]
    steps = [list(run) for run in runs]
    assert all(run.outcome.done for run in runs)
    assert len(steps[0]) == len(steps[1]) > 1
    np.testing.assert_array_equal(runs[0].assembly.strip.mesh.p, runs[1].assembly.strip.mesh.p)
    np.testing.assert_allclose(runs[1].march.full, runs[0].march.full, atol=1e-12)
    assert np.abs(runs[0].march.full).max() > 1e-3


def test_file_is_read_whatever_its_numbering(written: Callable[..., Path]) -> None:
    strip = Assembly(scene_of(written(*generated()))).strip
    np.testing.assert_allclose(strip.mesh.p, grid(XS, YS).p, atol=1e-15)
    assert set(strip.edges) == {"entry", "exit", "left", "right"}
    np.testing.assert_allclose(strip.mesh.p[1, strip.edges["entry"].nodes], YS)


def refused(scene: Scene) -> dict[str, str]:
    """Key and expectation of all mistakes."""
    with pytest.raises(InputError) as caught:
        scene.run()
    assert all(m.hint and str(m) for m in caught.value.mistakes)
    return {m.key: m.expected for m in caught.value.mistakes}


def test_missing_exit_is_told_by_the_stages_that_need_it(written: Callable[..., Path]) -> None:
    found = refused(scene_of(written(*generated(leave_out=("exit",)))))
    assert {"stages.pull.exit", "stages.lift.exit", "strip.mesh"} <= set(found)


def test_missing_entry_and_exit(written: Callable[..., Path]) -> None:
    found = refused(scene_of(written(*generated(leave_out=("exit", "entry")))))
    assert {"edges.entry", "stages.pull.exit", "strip.mesh"} <= set(found)


def test_no_named_edges_at_all(written: Callable[..., Path]) -> None:
    points, cells, _ = generated()
    assert "edges.entry" in refused(scene_of(written(points, cells, {})))


def test_lines_alone_are_refused(written: Callable[..., Path]) -> None:
    points, _, edges = generated()
    assert "quadrilateral" in refused(scene_of(written(points, [], edges)))["strip.mesh"]


@pytest.mark.parametrize("bend", ["skewed", "turned"])
def test_other_quadrilaterals_are_refused(written: Callable[..., Path], bend: str) -> None:
    points, cells, edges = generated()
    matrix = {"skewed": [[1.0, 0.3], [0.0, 1.0]], "turned": [[0.8, -0.6], [0.6, 0.8]]}[bend]
    found = refused(scene_of(written(points @ np.array(matrix).T, cells, edges)))
    assert "rectangles" in found["strip.mesh"]


@pytest.mark.parametrize("axes", [[-1.0, -1.0], [-1.0, 1.0], []])
def test_a_mesh_that_does_not_run_from_entry_to_exit_along_x_is_refused(
    written: Callable[..., Path], axes: list[float]
) -> None:
    """Turned round, mirrored, or along y: what pulls the exit would push it."""
    points, cells, edges = generated()
    points = points * axes if axes else points[:, ::-1]
    assert "a mesh along x" in refused(scene_of(written(points, cells, edges)))["strip.mesh"]


@pytest.mark.parametrize("aside", [3.0, 2.0])
def test_two_islands_are_refused(written: Callable[..., Path], aside: float) -> None:
    """Apart, or with a corner in common, which holds nothing."""
    points, ((kind, cells),), edges = generated()
    up = 0.0 if aside > 2.0 else 0.8
    everything = np.concatenate([points, np.add(points, (aside, up))])
    if up:  # the upper right corner of the one is the lower left one of the other
        here, there = (
            int(np.abs(everything - corner).sum(axis=1)[half].argmin()) + half.start
            for corner, half in (([1.0, 0.4], slice(0, 15)), ([1.0, 0.4], slice(15, 30)))
        )
        second = np.where(cells + 15 == there, here, cells + 15)
    else:
        second = cells + 15
    found = refused(scene_of(written(everything, [(kind, np.concatenate([cells, second]))], edges)))
    assert "2 parts" in found["strip.mesh"]


@pytest.mark.parametrize("distance", [1e9, 1e15, 1e300])
def test_nodes_without_digits_are_refused(written: Callable[..., Path], distance: float) -> None:
    points, cells, edges = generated()
    found = refused(scene_of(written(np.add(points, (distance, 0.0)), cells, edges)))
    assert "strip.mesh" in found
    assert "digits" in found["strip.mesh"] or distance > 1e9


@pytest.mark.parametrize("text", ["", "nonsense", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nod"])
@pytest.mark.parametrize("name", ["strip.msh", "strip.vtk", "strip.unknown"])
def test_corrupt_file_is_refused(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    assert "strip.mesh" in refused(scene_of(path))


def test_cut_file_is_refused(written: Callable[..., Path]) -> None:
    path = written(*generated())
    path.write_bytes(path.read_bytes()[:400])
    assert "strip.mesh" in refused(scene_of(path))


ROLLER = {"radius": 0.5, "axis": [0.0, 1.0, 0.0]}


@pytest.mark.parametrize("height", [-0.4, 0.0, 0.45])
def test_roller_inside_the_strip_is_refused(written: Callable[..., Path], height: float) -> None:
    rollers = [{**ROLLER, "name": "low", "centre": [0.0, 0.0, height]}]
    (key,) = refused(scene_of(written(*generated()), rollers=rollers))
    assert key == "rollers.low.centre"


def test_roller_that_touches_is_taken(written: Callable[..., Path]) -> None:
    rollers = [{**ROLLER, "centre": [0.0, 0.0, -0.5]}]
    assert scene_of(written(*generated()), rollers=rollers).run().steps == 0


def test_small_roller_between_two_nodes_is_found() -> None:
    """Its surface reaches through an element without touching any node."""
    scene = tables(length=4.0, width=1.0, cells=[4, 2])
    roller = {"name": "small", "radius": 0.1, "centre": [0.5, 0.0, -0.05], "axis": [0.0, 1.0, 0.0]}
    (key,) = refused(Scene.model_validate({**scene, "rollers": [roller]}))
    assert key == "rollers.small.centre"


def test_centred_needs_a_node_in_the_middle() -> None:
    found = refused(Scene.model_validate(tables(length=2.0, width=0.8, cells=[4, 3])))
    assert set(found) == {"strip.cells"}


def test_plate_on_supports_bends_the_same_at_any_angle(written: Callable[..., Path]) -> None:
    """0.00406235 q a⁴/D (Navier); slopes along y were held on its oblique edges: 29 % too stiff."""
    x, c, s = np.linspace(-0.5, 0.5, 5), np.cos(np.pi / 9.0), np.sin(np.pi / 9.0)
    mesh = MeshTri.init_tensor(x, x)
    sides = {"entry": (0, -0.5), "exit": (0, 0.5), "left": (1, 0.5), "right": (1, -0.5)}
    edges = {
        name: mesh.facets[:, mesh.facets_satisfying(lambda p, k=k, at=at: np.isclose(p[k], at))].T
        for name, (k, at) in sides.items()
    }
    path = written((np.array([[c, -s], [s, c]]) @ mesh.p).T, [("triangle", mesh.t.T)], edges)
    scene = Scene(
        strip={"mesh": str(path), "thickness": 0.01},
        material={"young": 2e11, "poisson": 0.3},
        edges={name: {"fixed": ["x", "y", "z"] if name == "entry" else ["z"]} for name in sides},
        stages=[{"name": "press", "pressure": 100.0}],
    )
    *_, last = scene.run()
    strip = last.state.plan.model.strip
    middle = strip.nodal(last.state.full)[strip.node_values][:, 2].max()
    stiffness = 2e11 * 1e-6 / 12.0 / (1.0 - 0.3**2)
    assert middle == pytest.approx(0.00406235 * 100.0 / stiffness, rel=2e-2)
