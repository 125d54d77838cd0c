"""A line is solved alike wherever its scene has its origin, and told in the scene's coordinates."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from anmstrip.driver.scene import Scene
from anmstrip.fem.strip import grid
from anmstrip.results.files import read_history
from anmstrip.results.vtk import read_collection, read_surface

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
SMALLEST = README.partition("```toml\n")[2].partition("```")[0]

ENDS = {"entry": (-2.0, 0.0, -1.0), "exit": (2.0, 0.0, -1.0)}

Moved = Callable[[np.ndarray], dict[str, Any]]


def threaded(place: np.ndarray) -> dict[str, Any]:
    """The smallest scene of the README, moved."""
    tables = tomllib.loads(SMALLEST)
    tables["threading"] |= {name: list(end + place) for name, end in ENDS.items()}
    for roller in tables["rollers"]:
        roller["centre"] = list(roller["centre"] + place)
    tables["output"] = {"events": True, "every": 20}
    tables["stages"][0]["duration"] = 0.01
    return tables


def ended(scene: Scene, directory: Path) -> dict[str, Any]:
    """What a run has cost and written, positions as they stand in its files."""
    run = scene.run(directory)
    *_, last = run
    assert run.outcome.done, run.message
    strip, rollers = (
        read_surface(directory / read_collection(directory / f"{name}.pvd")[-1].file)
        for name in ("strip", "rollers")
    )
    history = read_history(directory / "history.csv")
    return {
        "tangents": run.cost.expansions,
        "history": np.array([v for k, v in history.items() if k not in ("stage", "residual")]),
        "points": strip.points,
        "displacement": strip.fields["displacement"],
        "pressure": strip.fields["normal_pressure"],
        "rollers": rollers.points,
        "events": read_history(directory / "events.csv"),
        "reading": last.state.rollers["r1"],
    }


def check_same(found: dict[str, Any], near: dict[str, Any], place: np.ndarray) -> None:
    """The same work, numbers to 1e-9, and positions moved."""
    assert found["tangents"] == near["tangents"]
    np.testing.assert_allclose(found["history"], near["history"], rtol=1e-9, atol=1e-9)
    scale = np.abs(near["pressure"]).max()
    np.testing.assert_allclose(found["pressure"], near["pressure"], rtol=0.0, atol=1e-9 * scale)
    room = 1e-9 + 4.0 * np.spacing(np.abs(place).max())
    for points in ("points", "rollers"):
        np.testing.assert_allclose(found[points] - place, near[points], rtol=0.0, atol=room)
    for quantity in ("normal_force", "drag", "wrap", "tension_in", "tension_out"):
        there, here = (getattr(end["reading"], quantity) for end in (found, near))
        assert there == pytest.approx(here, rel=1e-9)


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The line at the origin."""
    scene = Scene.from_tables(threaded(np.zeros(3)), "near.toml")
    return ended(scene, tmp_path_factory.mktemp("near"))


@pytest.mark.parametrize(
    "place", [(10.0, 0.0, 0.0), (1e3, 0.0, -2e3), (1e6, 0.0, 1e6)], ids=["10 m", "km", "1000 km"]
)
def test_a_threaded_line_is_the_same_far_away(
    near: dict[str, Any], tmp_path: Path, place: tuple[float, ...]
) -> None:
    there = np.array(place)
    far = ended(Scene.from_tables(threaded(there), "far.toml"), tmp_path / "far")
    check_same(far, near, there)
    moved = far["displacement"] - near["displacement"]  # from a flat strip that has not moved
    np.testing.assert_allclose(moved - there, 0.0, atol=1e-9 + 4.0 * np.spacing(there.max()))
    np.testing.assert_allclose(far["events"]["x"], near["events"]["x"], atol=1e-9)
    top = near["points"][near["pressure"] > 0.1 * near["pressure"].max()]
    np.testing.assert_allclose(np.hypot(top[:, 0], top[:, 2] + 0.5), 0.5, atol=1e-3)


@pytest.mark.parametrize("place", [(1e3, -50.0, 0.0), (1e6, 1e6, 0.0)], ids=["km", "1000 km"])
def test_a_mesh_is_the_same_far_away(tmp_path: Path, place: tuple[float, ...]) -> None:
    near, far = (
        ended(meshed(np.array(there), tmp_path / name), tmp_path / name / "results")
        for there, name in (((0.0, 0.0, 0.0), "near"), (place, "far"))
    )
    check_same(far, near, np.array(place))
    np.testing.assert_allclose(far["displacement"], near["displacement"], atol=1e-9)
    for axis, name in enumerate("xy"):
        there, here = far["events"][name], near["events"][name]
        assert len(here)
        np.testing.assert_allclose(there - place[axis], here, atol=1e-9)


def meshed(place: np.ndarray, directory: Path) -> Scene:
    """A shell on a mesh from a file, pulled and lowered onto a roller."""
    mesh = grid(np.arange(-1.0, 1.125, 0.125), np.array([-0.25, 0.0, 0.25]))
    points = np.column_stack([mesh.p.T + place[:2], np.zeros(mesh.p.shape[1])])
    lines = {name: mesh.facets[:, facets].T for name, facets in mesh.boundaries.items()}
    numbers = [np.full(mesh.nelements, 99)]
    numbers += [np.full(len(pairs), i + 1) for i, pairs in enumerate(lines.values())]
    directory.mkdir()
    meshio.gmsh.write(
        directory / "strip.msh",
        meshio.Mesh(
            points,
            [("quad", mesh.t.T), *(("line", pairs) for pairs in lines.values())],
            cell_data={"gmsh:physical": numbers, "gmsh:geometrical": numbers},
            field_data={name: np.array([i + 1, 1]) for i, name in enumerate(lines)},
        ),
        "2.2",
        binary=True,
    )
    tables = {
        "strip": {"mesh": "strip.msh", "thickness": 1e-3},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {"onset": 1e-3, "pressure": 1e4},
        "rollers": [
            {"radius": 0.5, "axis": [0.0, 1.0, 0.0], "centre": list(place - (0.0, 0.0, 0.51))}
        ],
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
        "stages": [
            {"name": "pull", "duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}},
            {"name": "down", "duration": 1.0, "entry": {"move": [0.0, 0.0, -0.03]},
             "exit": {"move": [0.0, 0.0, -0.03]}},
        ],
        "output": {"events": True},
        "solver": {"tolerance": 1e-4},
    }  # fmt: skip
    return Scene.from_tables(tables, directory / "scene.toml")
