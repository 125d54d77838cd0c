"""The meshes that come with the program, and the script that writes them."""

from __future__ import annotations

import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

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


def test_file_is_what_the_documented_command_writes(tmp_path: Path) -> None:
    (command,) = [
        line.split("`")[3]
        for line in (MESHES / "README.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| `strip_refined.msh`")
    ]
    written = tmp_path / "strip.msh"
    arguments = command.replace("meshes/strip_refined.msh", str(written)).split()[2:]
    subprocess.run([sys.executable, SCRIPT, *arguments], check=True)
    assert written.read_text(encoding="utf-8") == REFINED.read_text(encoding="utf-8")


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
