"""A run goes on only from a checkpoint of its own scene, and only from a whole one."""

from __future__ import annotations

import errno
import json
import os
import shlex
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from anmstrip.cli import next_command
from anmstrip.driver import recorder
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.results.files import load_checkpoint, save_checkpoint
from anmstrip.scene.schema import Override

SCENE = """
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

[[stages]]
name = "lift"
duration = 1.0
exit.move = [0.0, 0.0, 0.2]
"""

Spoil = Callable[[dict[str, Any], dict[str, Any]], object]


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A scene file, and the directory of a run of it that was interrupted."""
    directory = tmp_path_factory.mktemp("begun")
    scene = directory / "scene.toml"
    scene.write_text(SCENE, encoding="utf-8")
    run = Scene.load(scene).run(directory / "results")
    next(iter(run))
    run.interrupted()
    return scene, directory / "results"


@pytest.mark.parametrize(
    "settings",
    [
        {"strip.thickness": "2e-3"},
        {"strip.cells": "[10, 1]", "material.young": "1e11"},
        {"stages.lift.exit.move": "[0.0, 0.0, 0.3]"},
        {"stages.pull.name": '"tug"'},
        {"edges.exit.centred": "true"},
        {"solver.tolerance": "1e-7"},
        {"output.times": "[0.5]"},
        {"rollers": '[{ name = "r", radius = 0.1, centre = [0.0, 0.0, -0.2] }]'},
    ],
)
def test_another_scene_is_refused_with_the_keys_that_differ(
    begun: tuple[Path, Path], tmp_path: Path, settings: dict[str, str]
) -> None:
    scene, results = begun
    copy = shutil.copytree(results, tmp_path / "copy")
    files = {path: path.read_bytes() for path in copy.iterdir()}
    with pytest.raises(InputError) as caught:
        Scene.load(scene, [f"{k}={v}" for k, v in settings.items()]).run(copy, resume=True)
    named = " ".join(mistake.key for mistake in caught.value.mistakes)
    assert all(key.removesuffix(".name") in named for key in settings)
    assert {path: path.read_bytes() for path in copy.iterdir()} == files
    typed = [m.hint for m in caught.value.mistakes if m.hint.startswith("--set ")]
    Scene.load(scene, [f"{k}={v}" for k, v in settings.items()] + [shlex.split(t)[1].rstrip(",")
                       for t in typed])  # fmt: skip


@pytest.mark.parametrize("content", [None, b"\xff\xfe\n", b""])
def test_a_table_that_is_gone_or_spoilt_is_told(
    begun: tuple[Path, Path], tmp_path: Path, content: bytes | None
) -> None:
    scene, results = begun
    copy = shutil.copytree(results, tmp_path / "copy")
    (copy / "history.csv").unlink()
    if content is not None:
        (copy / "history.csv").write_bytes(content)
    with pytest.raises(InputError, match=r"history\.csv"):
        Scene.load(scene).run(copy, resume=True)


def test_only_what_was_typed_is_named_as_changed(tmp_path: Path) -> None:
    """V_c follows from the friction coefficient; that strip is fed from the end that is let go."""
    turned = '{ name = "r", radius = 0.5, centre = [0.0, 0.0, -0.501] }'
    friction = f"rollers = [{turned}]\nfriction.coefficient = 0.2\n"
    stage = "\n[[stages]]\nduration = 1.0\n"
    path = tmp_path / "scene.toml"
    path.write_text(friction + SCENE + f"{stage}exit.velocity = [0.0, 0.0, 0.1]\n{stage}entry"
                    ".force = [0.0, 0.0, 0.0]\n", encoding="utf-8")  # fmt: skip
    run = Scene.load(path).run(tmp_path / "results")
    next(iter(run))
    run.interrupted()
    given = {"friction.coefficient": "0.3", "stages.stage3.entry.release": "true"}
    for key, value in given.items():
        with pytest.raises(InputError) as caught:
            Scene.load(path, [f"{key}={value}"]).run(tmp_path / "results", resume=True)
        assert [mistake.key for mistake in caught.value.mistakes] == [key]
    with pytest.raises(InputError) as caught:
        Scene.load(path, ["friction.speed=0.1"]).run(tmp_path / "results", resume=True)
    assert [mistake.key for mistake in caught.value.mistakes] == ["friction.speed"]


def test_a_directory_of_another_scene_is_refused_in_one_sentence(
    begun: tuple[Path, Path], tmp_path: Path
) -> None:
    """Not key by key, with values that cannot all be typed."""
    _, results = begun
    copy = Path(shutil.copytree(results, tmp_path / "copy"))
    other = Path(__file__).parents[2] / "examples" / "bridle.toml"
    with pytest.raises(InputError, match=r"another scene: \d+ keys differ") as refused:
        Scene.load(other).run(copy, resume=True)
    assert len(refused.value.mistakes) == 1


def test_bounds_of_the_work_may_differ(begun: tuple[Path, Path], tmp_path: Path) -> None:
    scene, results = begun
    copy = shutil.copytree(results, tmp_path / "copy")
    settings = ["solver.max_steps=77", "solver.max_tangents=88", 'title="other words"']
    run = Scene.load(scene, settings).run(copy, resume=True)
    *_, last = run
    assert run.outcome.done
    assert last.state.edge_force("exit")[0] == pytest.approx(1e4, rel=1e-6)


def test_another_mesh_of_the_same_name_is_refused(tmp_path: Path) -> None:
    meshes = Path(__file__).parents[2] / "meshes"
    one, other = sorted(meshes.glob("*.msh"))[:2]
    mesh = shutil.copy(one, tmp_path / "strip.msh")
    text = SCENE.replace("length = 4.0\nwidth = 1.0\n", f'mesh = "{Path(mesh).name}"\n')
    text = text.replace("cells = [8, 1]\n", "").replace('"section"', '"shell"')
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    scene = Scene.load(tmp_path / "scene.toml")
    scene.run(tmp_path / "results").interrupted()
    scene.run(tmp_path / "results", resume=True)
    mesh = shutil.copy(other, tmp_path / "strip.msh")
    with pytest.raises(InputError, match=r"strip\.mesh") as caught:
        scene.run(tmp_path / "results", resume=True)
    assert "--set" not in str(caught.value)  # a file's content cannot be typed


SPOILS: dict[str, Spoil] = {
    "no scene": lambda a, f: f.pop("input"),
    "scene of another kind": lambda a, f: f.update(input=[1]),
    "stage beyond": lambda a, f: f.update(stage=2),
    "stage negative": lambda a, f: f.update(stage=-1),
    "stage a text": lambda a, f: f.update(stage="pull"),
    "steps missing": lambda a, f: f.pop("steps"),
    "reached a list": lambda a, f: f.update(reached=[1.0]),
    "time nan": lambda a, f: f.update(time=float("nan")),
    "released unknown": lambda a, f: f.update(released=["nowhere"]),
    "stages of text": lambda a, f: f.update(stages={"pull": "x"}),
    "effects half": lambda a, f: f.update(effects={"membrane": {"points": 3}}),
    "snaps of numbers": lambda a, f: f.update(snaps=[1.0]),
    "turned unknown": lambda a, f: f.update(turned={"r1": 0.0}),
    "rows negative": lambda a, f: f.update(rows=-1),
    "rows too many": lambda a, f: f.update(rows=1000),
    "times without states": lambda a, f: f.update(times=[0.0]),
    "pace half": lambda a, f: f.update(pace={"control": 0.5}),
    "forward without array": lambda a, f: f.update(forward=0.5),
    "full missing": lambda a, f: a.pop("full"),
    "full short": lambda a, f: a.update(full=a["full"][:-1]),
    "full nan": lambda a, f: a.update(full=np.full_like(a["full"], np.nan)),
    "full of integers": lambda a, f: a.update(full=a["full"].astype(int)),
    "velocity of two axes": lambda a, f: a.update(velocity=a["velocity"][None]),
    "unknown array": lambda a, f: a.update({"value.nowhere.force": np.zeros(3)}),
    "moved of two": lambda a, f: a.update({"moved.exit": np.zeros(2)}),
}


@pytest.mark.parametrize("name", SPOILS)
def test_a_checkpoint_made_by_hand_is_refused(
    begun: tuple[Path, Path], tmp_path: Path, name: str
) -> None:
    scene, results = begun
    copy = shutil.copytree(results, tmp_path / "copy")
    arrays, facts = load_checkpoint(copy / "checkpoint.npz")
    facts = json.loads(json.dumps(facts))
    if name == "moved of two":
        facts["stage"], arrays["moved.exit"], arrays["speed.exit"] = 1, np.zeros(3), np.zeros(3)
    SPOILS[name](arrays, facts)
    save_checkpoint(copy / "checkpoint.npz", arrays, facts)
    with pytest.raises(InputError, match=r"damaged|rows"):
        Scene.load(scene).run(copy, resume=True)


def test_a_checkpoint_of_another_program_is_refused(
    begun: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its version, and by the number of unknowns that the program makes of the scene."""
    scene, results = begun
    copy = shutil.copytree(results, tmp_path / "copy")
    with monkeypatch.context() as patched:
        patched.setattr(recorder, "version", lambda name: "0.0.1")
        with pytest.raises(InputError, match="another version"):
            Scene.load(scene).run(copy, resume=True)
    arrays, facts = load_checkpoint(copy / "checkpoint.npz")
    del facts["signature"], arrays["velocity"]
    arrays["full"] = arrays["full"][:-2]
    facts["signature"] = recorder.signature(arrays, facts)
    save_checkpoint(copy / "checkpoint.npz", arrays, facts)
    with pytest.raises(InputError, match=f"{len(arrays['full'])} unknowns"):
        Scene.load(scene).run(copy, resume=True)


def test_a_checkpoint_without_what_a_later_program_keeps_is_refused(
    begun: tuple[Path, Path], tmp_path: Path
) -> None:
    scene, results = begun
    copy = shutil.copytree(results, tmp_path / "copy")
    arrays, facts = load_checkpoint(copy / "checkpoint.npz")
    del facts["signature"], facts["linear_solver"]
    facts["signature"] = recorder.signature(arrays, facts)
    save_checkpoint(copy / "checkpoint.npz", arrays, facts)
    with pytest.raises(InputError, match=r"another version .* without 'linear_solver'"):
        Scene.load(scene).run(copy, resume=True)


def test_the_next_command_is_what_was_typed() -> None:
    settings = ("friction.coefficient=0.2", "strip.cells=[40, 4]", 'title="it\'s"')
    given = Path("a b/scene.toml"), Path("my results"), settings
    words = shlex.split(next_command(*given, resume=True))
    assert shlex.split(next_command(*given, resume=False)) == words[:-1]
    assert words[:5] == ["anmstrip", "run", "a b/scene.toml", "-o", "my results"]
    assert words[-1] == "--resume"
    assert words[6:-1:2] == list(settings)
    assert [Override.parse(text).value for text in words[6:-1:2]] == [0.2, [40, 4], "it's"]


def test_two_runs_into_one_directory(begun: tuple[Path, Path], tmp_path: Path) -> None:
    """The second is refused before it touches anything, and the first ends as if alone."""
    scene, _ = begun
    first = Scene.load(scene).run(tmp_path)
    steps = iter(first)
    next(steps)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InputError, match=r"run\.interrupted\(\) of the run in this Python"):
        Scene.load(scene).run(tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert list(steps)
    assert first.outcome.done
    assert not (tmp_path / ".running").exists()


def test_a_directory_emptied_under_a_run_is_not_refilled(
    begun: tuple[Path, Path], tmp_path: Path
) -> None:
    scene, _ = begun
    steps = iter(Scene.load(scene).run(tmp_path / "results"))
    next(steps)
    for path in (tmp_path / "results").iterdir():
        path.unlink()
    with pytest.raises(FileNotFoundError, match="taken away") as caught:
        list(steps)
    assert caught.value.filename == str(tmp_path / "results")
    assert not list((tmp_path / "results").iterdir())


def test_a_table_taken_away_under_a_run_is_not_begun_again(
    begun: tuple[Path, Path], tmp_path: Path
) -> None:
    scene, _ = begun
    steps = iter(Scene.load(scene).run(tmp_path))
    next(steps)
    (tmp_path / "history.csv").unlink()
    with pytest.raises(FileNotFoundError) as caught:
        list(steps)
    assert caught.value.filename == str(tmp_path / "history.csv")


@pytest.mark.parametrize("steps", [0, 1])
def test_error_leaves_the_directory_to_the_next_run(
    tmp_path: Path, begun: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, steps: int
) -> None:
    """Also while its traceback lives on; before any file and while one is written."""
    scene, full = Scene.load(begun[0]), False

    def fsync(_: int) -> None:
        if full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.fsync", fsync)
    full = not steps
    with pytest.raises(OSError, match="No space left") as caught:
        for _ in scene.run(tmp_path):
            full = True
    full = False
    assert next(iter(scene.run(tmp_path))).step == 1
    assert caught.tb is not None


@pytest.mark.parametrize(("durations", "last"), [((0.7, 0.1), 0.8), ((0.1, 0.7, 0.1, 0.1), 1.0)])
@pytest.mark.parametrize("interrupted", [False, True])
def test_all_times_that_are_asked_for_are_written(
    tmp_path: Path, durations: tuple[float, ...], last: float, interrupted: bool
) -> None:
    """Also the beginning, of a run that went on after an interruption, and the end by round-off."""
    stages = [{"name": f"s{n}", "duration": d} for n, d in enumerate(durations)]
    tables = {
        "strip": {"kinematics": "section", "length": 1.0, "width": 1.0, "thickness": 1e-3,
                  "cells": [4, 1]},
        "material": {"young": 2e11, "poisson": 0.3},
        "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
        "stages": [{**stages[0], "exit": {"force": [1e3, 0.0, 0.0]}}, *stages[1:]],
        "output": {"times": [0.0, 0.05, last]},
    }  # fmt: skip
    scene = Scene.from_tables(tables, "times.toml")
    run = scene.run(tmp_path)
    if interrupted:
        run.interrupted()
        run = scene.run(tmp_path, resume=True)
    list(run)
    assert run.outcome.done
    written = ElementTree.parse(tmp_path / "strip.pvd").iter("DataSet")
    assert [float(entry.get("timestep", "nan")) for entry in written] == pytest.approx(
        [0.0, 0.05, last]
    )


def test_a_run_that_had_ended_keeps_its_solver_when_it_is_resumed(tmp_path: Path) -> None:
    """Nothing is left to factorise, and summary.json said that no solver was chosen."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE, encoding="utf-8")
    names = []
    for resume in (False, True):
        list(Scene.load(scene).run(tmp_path / "results", resume=resume))
        summary = json.loads((tmp_path / "results" / "summary.json").read_text(encoding="utf-8"))
        names.append(summary["linear_solver"])
    assert names[0] == names[1] != "none yet"


def test_pictures_of_an_earlier_run_do_not_stay_beside_the_results_of_another(
    tmp_path: Path,
) -> None:
    """They showed another strip than the tables; what is not written by the program stays."""
    stale = [f"picture{rest}" for rest in (".png", "_side.png", "_side.svg", "_side.pdf")]
    for name in [*stale, "movie.gif", "report.html", "notes.txt"]:
        (tmp_path / name).write_text("earlier", encoding="utf-8")
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    next(iter(Scene.load(path).run(tmp_path)))
    left = {name.name for name in tmp_path.iterdir()}
    assert {"notes.txt", "scene.toml"} <= left
    assert not left & {*stale, "movie.gif", "report.html"}


def test_a_loop_that_was_left_goes_on_in_the_same_python(tmp_path: Path) -> None:
    """By what is told; the next run was told to take another directory."""
    scene = Scene.from_tables(tomllib.loads(SCENE), "line.toml")
    whole, first = scene.run(), scene.run(tmp_path)
    *_, last = whole
    for _ in first:
        break
    first.interrupted()
    second = scene.run(tmp_path, resume=True)
    *_, step = second
    assert second.outcome.done
    assert step.step == last.step
    np.testing.assert_array_equal(step.state.full, last.state.full)
