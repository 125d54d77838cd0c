"""The meshes that come with the program, and the script that writes them."""

from __future__ import annotations

import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
import skfem

MESHES = Path(__file__).parents[1] / "meshes"
SCRIPT = MESHES / "make_strip.py"
REFINED = MESHES / "strip_refined.msh"
SIDES = {"entry": (0, -2.0), "exit": (0, 2.0), "left": (1, 0.5), "right": (1, -0.5)}


@pytest.fixture(scope="module")
def mesh() -> skfem.MeshQuad:
    return skfem.MeshQuad.load(REFINED)


@pytest.fixture(scope="module")
def write() -> Callable[[list[str]], None]:
    return runpy.run_path(str(SCRIPT))["main"]


@pytest.mark.parametrize("name", SIDES)
def test_named_edge_is_its_whole_side(mesh: skfem.MeshQuad, name: str) -> None:
    axis, position = SIDES[name]
    facets = mesh.facets[:, mesh.boundaries[name]]
    assert facets.size
    np.testing.assert_allclose(mesh.p[axis, facets], position, rtol=1e-12)
    along = mesh.p[1 - axis, facets]
    assert np.abs(along[1] - along[0]).sum() == pytest.approx(1.0 if axis == 0 else 4.0)


def test_no_other_names(mesh: skfem.MeshQuad) -> None:
    assert set(mesh.boundaries) == set(SIDES)
    assert set(mesh.subdomains) == {"strip"}
    assert mesh.subdomains["strip"].size == mesh.nelements == 72


def test_elements_are_rectangles_and_finer_in_the_middle(mesh: skfem.MeshQuad) -> None:
    corners = mesh.p[:, mesh.t]
    np.testing.assert_allclose(corners[:, 0] + corners[:, 2], corners[:, 1] + corners[:, 3])
    length, width = np.ptp(corners, axis=1)
    assert (length * width).sum() == pytest.approx(4.0)
    middle = np.abs(corners[0].mean(axis=0)) < 0.6
    np.testing.assert_allclose(length[middle], 0.05)
    assert length[~middle].min() > 0.2
    assert length.max() <= 0.25


def commands() -> dict[str, list[str]]:
    """Script and arguments of every file that README.md documents, without the output."""
    lines = (MESHES / "README.md").read_text(encoding="utf-8").splitlines()
    rows = [line.split("`") for line in lines if line.startswith("| `")]
    return {row[1]: row[3].split()[1:-2] for row in rows}


def test_every_file_is_documented() -> None:
    assert set(commands()) == {path.name for path in MESHES.glob("*.msh")}


@pytest.mark.parametrize("name", commands())
def test_file_is_what_the_documented_command_writes(tmp_path: Path, name: str) -> None:
    """The same numbers of nodes, to the last rounded decimal of their places."""
    written, arguments = tmp_path / name, commands()[name]
    subprocess.run([sys.executable, *arguments, "-o", written], check=True, cwd=MESHES.parent)
    ours, theirs = (meshio.gmsh.read(path) for path in (MESHES / name, written))
    np.testing.assert_allclose(theirs.points, ours.points, rtol=0, atol=2e-7)
    assert len(ours.cells) == len(theirs.cells) > 4
    for one, other in zip(ours.cells, theirs.cells, strict=True):
        np.testing.assert_array_equal(other.data, one.data)
    assert set(ours.field_data) == set(theirs.field_data)
    for group, number in ours.field_data.items():
        np.testing.assert_array_equal(theirs.field_data[group], number)


def test_uniform_strip_is_of_squares() -> None:
    mesh = skfem.MeshQuad.load(MESHES / "strip_uniform.msh")
    assert set(mesh.boundaries) == set(SIDES)
    np.testing.assert_allclose(np.ptp(mesh.p[:, mesh.t], axis=1), 0.25)


def angles(mesh: skfem.MeshTri) -> np.ndarray:
    """All angles, shape (3, triangles), degrees."""
    corners = mesh.p[:, mesh.t]
    after, before = (np.roll(corners, shift, axis=1) - corners for shift in (-1, 1))
    lengths = np.linalg.norm(after, axis=0) * np.linalg.norm(before, axis=0)
    return np.degrees(np.arccos((after * before).sum(axis=0) / lengths))


def sides(mesh: skfem.MeshTri, facets: np.ndarray | slice = slice(None)) -> np.ndarray:
    """Lengths of facets."""
    return np.linalg.norm(np.diff(mesh.p[:, mesh.facets[:, facets]], axis=1)[:, 0], axis=0)


TRIANGLES = {"strip_triangles.msh": (2.0, 4.0, 32.0), "strip_hole.msh": (1.0, None, 34.0)}
"""Half length, area and least angle; the hole's area is that of its polygon."""


@pytest.mark.parametrize("name", TRIANGLES)
def test_triangles_are_well_shaped_named_and_symmetric(name: str) -> None:
    half, area, least = TRIANGLES[name]
    path = MESHES / name
    mesh = skfem.MeshTri.load(path)
    assert path.stat().st_size < 2e5
    assert angles(mesh).min() > least
    assert angles(mesh).max() < 110.0
    named = np.concatenate(list(mesh.boundaries.values()))
    assert sorted(named) == sorted(mesh.boundary_facets())
    for edge, (axis, position) in SIDES.items():
        place = np.sign(position) * (half, 0.5)[axis]
        np.testing.assert_allclose(mesh.p[axis, mesh.facets[:, mesh.boundaries[edge]]], place)
    for mirror in ([-1.0, 1.0], [1.0, -1.0]):
        image = mesh.p * np.array(mirror)[:, None]
        np.testing.assert_array_equal(image[:, np.lexsort(image)], mesh.p[:, np.lexsort(mesh.p)])
    if area is None:
        corners = len(mesh.boundaries["hole"])
        area = 2.0 - 0.5 * corners * 0.2**2 * np.sin(2.0 * np.pi / corners)
    assert skfem.Basis(mesh, mesh.elem()).dx.sum() == pytest.approx(area, rel=1e-6)


def test_triangles_are_finer_over_the_roller() -> None:
    mesh = skfem.MeshTri.load(MESHES / "strip_triangles.msh")
    middle = np.abs(mesh.p[0, mesh.facets].mean(axis=0))
    assert 0.09 < sides(mesh)[middle < 0.8].mean() < 0.12
    assert sides(mesh)[middle < 0.8].max() < 0.15
    assert sides(mesh)[middle > 1.7].mean() > 0.22
    assert sides(mesh).max() < 0.35


def test_hole_is_round_and_fine_at_its_rim() -> None:
    mesh = skfem.MeshTri.load(MESHES / "strip_hole.msh")
    rim = np.asarray(mesh.boundaries["hole"])
    assert len(rim) > 36
    np.testing.assert_allclose(np.linalg.norm(mesh.p[:, mesh.facets[:, rim]], axis=0), 0.2, 1e-6)
    assert sides(mesh, rim).max() < 0.03
    assert sides(mesh).max() > 0.1


@pytest.mark.parametrize(
    "wrong", [["--size", "0.3"], ["--hole", "0.45"], ["--hole", "0.05"], ["--growth", "1"]]
)
def test_triangles_that_cannot_be_made_are_refused(tmp_path: Path, wrong: list[str]) -> None:
    command = [sys.executable, MESHES / "make_triangles.py", *wrong, "-o", tmp_path / "strip.msh"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "error:" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("begin", "end", "along"), [(-1.0, 1.0, 4), (-1.0, 0.0, 3), (0.0, 0.1, 3)])
def test_refinement_may_reach_the_ends(
    tmp_path: Path, write: Callable[[list[str]], None], begin: float, end: float, along: int
) -> None:
    path = tmp_path / "strip.msh"
    sizes = ["--length", "2", "--width", "1", "--cells", "2", "2", "--refined", "0.5"]
    write([*sizes, "--from", str(begin), "--to", str(end), "-o", str(path)])
    mesh = skfem.MeshQuad.load(path)
    assert set(mesh.boundaries) == set(SIDES)
    assert mesh.boundaries["left"].size == along


@pytest.mark.parametrize("wrong", [["--cells", "16", "1"], ["--from", "3"], ["--width", "-1"]])
def test_what_cannot_be_meshed_is_refused(
    tmp_path: Path,
    write: Callable[[list[str]], None],
    wrong: list[str],
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as stopped:
        write([*wrong, "-o", str(tmp_path / "strip.msh")])
    assert stopped.value.code == 2
    assert "error:" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
