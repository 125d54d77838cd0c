"""Whatever is typed, and wherever it is written: a correct state or one structured outcome."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from anmstrip.cli import main
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.results.files import load_checkpoint
from anmstrip.results.vtk import read_collection as listed
from anmstrip.results.vtk import read_surface
from anmstrip.simulation.problem import Assembly
from fuzz_reader import fuzzed, read_mesh_of, read_one
from random_scenes import MOST_TANGENTS, Dice, ending_of, from_seed, tables_of

QUICK = """
[strip]
length = 4.0
width = 1.0
thickness = 1.0e-3
cells = [8, 1]
kinematics = "section"

[material]
young = 2.0e11
poisson = 0.3

[edges.entry]
fixed = ["x", "z"]

[edges.exit]
fixed = ["z"]

[[stages]]
name = "pull"
duration = 1.0
exit.force = [1.0e4, 0.0, 0.0]
"""


@pytest.mark.parametrize("first", [0, pytest.param(1_000, marks=pytest.mark.slow)])
def test_reader_gives_a_scene_or_mistakes(first: int) -> None:
    """Fuzzed as by ``python tests/hard/fuzz_reader.py --count 1000000``."""
    tally = fuzzed(range(first, first + 1_000))
    assert tally.crashes == ()
    assert tally.scenes > 50
    assert tally.refused > 500


@pytest.mark.parametrize(("of", "count"), [("override", 500), ("checkpoint", 500), ("mesh", 200)])
def test_other_readers_give_a_result_or_mistakes(of: str, count: int) -> None:
    """Fuzzed as by ``python tests/hard/fuzz_reader.py --of checkpoint --count 100000``."""
    tally = fuzzed(range(count), of)
    assert tally.crashes == ()
    assert tally.scenes
    assert tally.refused > count // 2


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("seed", "words"),
    [(5_000_750, "nodes at finite places"), (5_006_144, "cells of nodes that exist")],
)
def test_meshes_that_had_ended_in_a_traceback(seed: int, words: str) -> None:
    """A node whose square overflows, and cells of one node."""
    assert words in str(read_mesh_of(seed))


@settings(max_examples=100, deadline=None)
@given(st.integers(10**9, 10**12))
def test_reader_never_raises_anything_else(seed: int) -> None:
    assert isinstance(read_one(seed), Scene | InputError)


@pytest.mark.parametrize(
    ("name", "setting", "words"),
    [
        ("small_deflection", "strip.thickness=1e-9", "at most 250000 elements"),
        ("press", "strip.refined=1e-9", "at most 250000 elements"),
        ("press", "strip.cells=[100000, 100000]", "at most 250000 elements"),
        ("press", "strip.thickness=1e-300", "numbers are at most 1e+30"),
        ("press", "rollers.r1.radius=1e200", "numbers are at most 1e+30"),
    ],
)
def test_absurd_sizes_are_refused_before_they_fill_the_memory(
    name: str, setting: str, words: str
) -> None:
    example = Path(__file__).parents[2] / "examples" / f"{name}.toml"
    with pytest.raises(InputError) as caught:
        Assembly(Scene.load(example, [setting])).strip  # noqa: B018 - makes the mesh
    assert words in str(caught.value)


def test_threaded_strip_that_would_sink_through_its_roller_is_refused() -> None:
    example = Path(__file__).parents[2] / "examples" / "bridle.toml"
    soft = Scene.load(example, ["contact.stiffness=1e4", "contact.eta=1.0", "contact.delta=1e-3"])
    with pytest.raises(InputError, match=r"sink .* m into roller upper"):
        Assembly(soft).thread  # noqa: B018 - looks for the way


@pytest.mark.slow
@settings(max_examples=4, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=70, max_size=70))
def test_valid_scenes_end_in_an_outcome(numbers: list[float]) -> None:
    """No traceback, nothing on disk that is no number, equilibrium at the end."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        end = ending_of(tables_of(Dice(iter([*numbers, *[0.5] * 200]).__next__)))
    assert end.faults == ()
    assert end.status
    assert end.tangents <= MOST_TANGENTS


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_scenes(seed: int) -> None:
    """The first of ``python tests/hard/random_scenes.py --count 2000``."""
    end = ending_of(from_seed(seed))
    assert end.faults == ()
    assert end.message or end.status == "done"


def test_a_run_stops_at_the_tangents_that_it_may_make(tmp_path: Path) -> None:
    """Steps in time that are tried again and again count as well."""
    tables = from_seed(5)
    tables["solver"]["max_tangents"] = 30
    run = Scene.from_tables(tables, tmp_path / "scene.toml").run()
    assert list(run)
    assert run.cost.expansions == 30
    assert "the allowed number of tangents was used up" in run.message
    assert "Try --set solver.max_tangents=60" in run.message  # nothing to resume


# disks ---------------------------------------------------------------------------

LIMITED = (
    "import resource, sys; import anmstrip.driver.run, anmstrip.results.vtk;"
    "from anmstrip.cli import main;"
    "resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)),) * 2); main()"
)
"""The command line where no file may grow beyond a number of bytes."""


@pytest.mark.parametrize("most", [0, 100, 2_000, 3_000])
def test_file_that_cannot_be_written(tmp_path: Path, most: int) -> None:
    """Whichever file it is, as on a full disk: one sentence, and the others can be read."""
    scene, results = tmp_path / "scene.toml", tmp_path / "results"
    scene.write_text(QUICK, encoding="utf-8")
    typed = [str(most), "run", str(scene), "-o", str(results), "--quiet"]
    found = subprocess.run(
        [sys.executable, "-c", LIMITED, *typed], capture_output=True, text=True, check=False
    )
    assert found.returncode == 1
    assert "Traceback" not in found.stderr
    assert found.stderr.startswith(f"Stopped: {results}")
    assert os.strerror(errno.EFBIG) in found.stderr
    for entry in listed(results / "strip.pvd") if (results / "strip.pvd").exists() else ():
        assert len(read_surface(results / entry.file).points)


def test_full_disk_at_any_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The n-th file does not fit, for every n of the run; the rest stays readable."""
    scene = tmp_path / "scene.toml"
    scene.write_text(QUICK, encoding="utf-8")
    real, calls, ends = os.fsync, iter(range(0)), list[object]()

    def full(file: int) -> None:
        if next(calls, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(file)

    monkeypatch.setattr("os.fsync", full)
    for fitting in range(50):
        calls, results = iter(range(fitting)), tmp_path / f"results{fitting}"
        result = CliRunner().invoke(main, ["run", str(scene), "-o", str(results), "--quiet"])
        if result.exit_code == 0:
            break
        assert result.exit_code == 1, result.output
        assert isinstance(result.exception, SystemExit)
        assert result.stderr.startswith(f"Stopped: {results}")
        assert "No space left on device." in result.stderr
        assert not list(results.glob(".*.part"))
        calls = iter(range(10**6))  # there is room again: nothing was lost but time
        resumed = ["--resume"] * (results / "checkpoint.npz").exists()
        again = CliRunner().invoke(main, ["run", str(scene), "-o", str(results), *resumed])
        assert again.exit_code == 0, again.output
        ends.append(load_checkpoint(results / "checkpoint.npz")[0]["full"])
    assert fitting > 3
    np.testing.assert_allclose(ends, [ends[0]] * len(ends), rtol=0.0, atol=1e-12)
    assert json.loads((results / "summary.json").read_text(encoding="utf-8"))["status"] == "done"


@contextmanager
def nobody() -> Iterator[None]:
    """Without the rights of root, which may write anywhere."""
    before = os.geteuid()
    if before == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(before)


@pytest.mark.parametrize("there", [True, False])
def test_directory_that_may_not_be_written(tmp_path: Path, there: bool) -> None:
    open_to_all = Path(tempfile.mkdtemp())
    open_to_all.chmod(0o755)
    scene, shut = open_to_all / "scene.toml", open_to_all / "shut"
    scene.write_text(QUICK, encoding="utf-8")
    typed = ["run", str(scene), "--quiet", "-o"]
    assert CliRunner().invoke(main, [*typed, str(tmp_path / "first")]).exit_code == 0
    shut.mkdir(mode=0o555)
    with nobody():
        result = CliRunner().invoke(main, [*typed, str(shut if there else shut / "results")])
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit)
    assert result.stderr.startswith(str(shut))
    assert "a directory that can be made and written (Permission denied)" in result.stderr
    assert "another directory for the results" in result.stderr
    assert not list(shut.iterdir())
    shutil.rmtree(open_to_all)


def test_results_below_a_file(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(QUICK, encoding="utf-8")
    result = CliRunner().invoke(main, ["run", str(scene), "-o", str(scene / "results")])
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert "Not a directory" in result.stderr


def test_as_many_points_near_rollers_as_there_are_rollers() -> None:
    """Compiled kernels must not take rollers for points where both are two."""
    end = ending_of(from_seed(3038, graded=0.0))
    assert (end.status, end.faults) == ("done", ())


def test_doubts_are_told_with_the_end_of_the_tangents(tmp_path: Path) -> None:
    """More tangents alone would not help a strip of elements as long as its roller is wide."""
    tables = from_seed(97)
    tables["solver"]["max_tangents"] = 30
    run = Scene.from_tables(tables, tmp_path / "scene.toml").run()
    assert list(run)
    assert "max_tangents=60 but roller r" in run.message
    assert "cannot follow its radius" in run.message


@pytest.mark.slow
def test_point_of_a_strip_that_snaps() -> None:
    """Friction of 0.67 on one point, with no equilibrium beside its neighbours: passed.

    It moves by 6e-10 m, where the run may err by 6e-5 m, and is not told.
    """
    end = ending_of(from_seed(4, graded=0.0))
    assert (end.status, end.faults) == ("done", ())
    assert "ran away" not in end.message


def test_the_last_tangent_in_a_snap_that_was_looked_for() -> None:
    """It is told as such, not as steps that became too short."""
    end = ending_of(from_seed(31105, 60))
    assert (end.status, end.tangents, end.faults) == ("too_many_tangents", 60, ())


def test_a_strip_that_begins_deep_inside_a_roller() -> None:
    """What its first file says of pressures are numbers."""
    end = ending_of(from_seed(30604, 60))
    assert (end.status, end.faults) == ("done", ())
