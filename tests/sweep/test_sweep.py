"""Parameter studies: what varies, what is written, and what a killed worker leaves."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from importlib import util
from pathlib import Path
from typing import Any, cast
from unittest.mock import Mock

import pytest
from click.testing import CliRunner, Result

from anmstrip import cli as command
from anmstrip.cli import main
from anmstrip.driver import sweep as scenes
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.driver.sweep import Sweep, folder_name, parse_variation, row_of
from anmstrip.errors import InputError
from anmstrip.pictures.curves import save_figure, sweep_figure
from anmstrip.results import files as history

CAPSTAN = Path(__file__).parents[2] / "examples" / "capstan.toml"

COARSE = ('strip.kinematics="section"', "strip.refined=0.1", "solver.tolerance=1e-4")
"""About two seconds of a scene with contact and friction."""

PULL = """
[strip]
length = 1.0
width = 1.0
thickness = 1.0e-3
cells = [4, 2]
kinematics = "section"

[material]
young = 2.0e11
poisson = 0.3

[edges.entry]
fixed = ["x", "z"]

[[stages]]
name = "pull"
duration = 1.0
exit.force = [1.0e4, 0.0, 0.0]
"""


@pytest.fixture
def pull(tmp_path: Path) -> Path:
    """A scene of some milliseconds."""
    path = tmp_path / "pull.toml"
    path.write_text(PULL, encoding="utf-8")
    return path


def typed(*arguments: object) -> Result:
    result = CliRunner().invoke(main, ["sweep", *map(str, arguments)])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


class Job:
    """Something done, or the error that it ended in."""

    def __init__(
        self, done: dict[str, Any] | None, error: Exception | None, lost: bool = False
    ) -> None:
        self.result, self.exception, self.cancelled = lambda: done, lambda: error, lambda: lost


class Direct:
    """Stands in for dask's client: runs on the spot; beyond a number of scenes, fails."""

    def __init__(
        self, scenes: int = 1000, error: Exception | None = None, lost: bool = False
    ) -> None:
        self.left, self.error, self.lost = scenes, error, lost

    def submit(self, function: Any, *given: Any, pure: bool) -> Job:
        assert not pure  # the same scene on another day is another job
        self.left -= 1
        if self.left < 0:
            return Job(None, self.error, self.lost)
        return Job(function(*given), None)

    def cancel(self, jobs: list[Job]) -> None:
        self.cancelled = jobs


@pytest.fixture
def direct(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("distributed.as_completed", reversed)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("friction.coefficient=0.1:0.5:9", (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5)),
        ("solver.order=10:20:3", (10, 15, 20)),
        ("solver.order=10:20:4", (10.0, 13.3333333333, 16.6666666667, 20.0)),
        ("friction.speed=1e-3, 1e-2,1.0", (1e-3, 1e-2, 1.0)),
        ("friction.speed=.1,-.5", (0.1, -0.5)),
        ('friction.law="tanh","norton-hoff"', ("tanh", "norton-hoff")),
        ("strip.cells=[16, 2],[32, 2]", ([16, 2], [32, 2])),
        ("strip.bending=true,false", (True, False)),
        ('strip.mesh="a:b:c"', ("a:b:c",)),
    ],
)
def test_values(text: str, values: tuple[Any, ...]) -> None:
    key, found = parse_variation(text)
    assert (key, found) == (text.partition("=")[0], values)
    assert [type(v) for v in found] == [type(v) for v in values]


@pytest.mark.parametrize(
    "text",
    ["", "f", "=1,2", "f=", "f=1:2", "f=1:2:0", "f=1:2:x", "f=1:1:3", "f=1:2:1", "f=nan:1:3",
     "f=a,b", "f=1,1", "f=1:2:1000000", "f=1:2:3:4", "f=1,\n2", "f=1979-05-27"],
)  # fmt: skip
def test_values_that_are_none(text: str) -> None:
    with pytest.raises(InputError) as refused:
        parse_variation(text)
    (mistake,) = refused.value.mistakes
    assert mistake.file == f"--vary {text}"
    parse_variation(shlex.split(mistake.hint.partition(", or ")[0])[1])  # can be typed


def test_what_is_told_to_type_instead_is_of_the_same_key() -> None:
    for text, hint in [("f=.1:.2", "f=.1:.2:9"), ("f=tanh, b-c", """'f="tanh","b-c"'""")]:
        with pytest.raises(InputError) as refused:
            parse_variation(text)
        assert refused.value.mistakes[0].hint == f"--vary {hint}"


def test_directories_are_names_of_files_and_differ() -> None:
    values = [0.5, "a/b", "a b", "a" * 300, "a" * 301, [16, 2]]
    names = [folder_name({"strip.mesh": value}) for value in values]
    assert names[0] == "strip.mesh=0.5"
    assert len(set(names)) == len(names)
    assert all(len(name) < 120 and "/" not in name and '"' not in name for name in names)


def test_all_mistakes_at_once_and_nothing_is_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    ended = typed(
        CAPSTAN, "-o", out, "--set", "strip.widht=1", "--vary", "friction.coefficient=-1,0.2,0.3",
        "--vary", "strip.thickness=1e-3,-2e-3",
    )  # fmt: skip
    assert ended.exit_code == 2
    for words in (
        "--vary friction.coefficient=-1: friction.coefficient\n",
        "--vary strip.thickness=-0.002: strip.thickness\n",
        "width (the nearest known one)",
    ):
        assert ended.stderr.count(words) == 1  # though told by several scenes
    assert not out.exists()


def test_a_key_that_is_unknown_is_told_once(tmp_path: Path) -> None:
    ended = typed(CAPSTAN, "-o", tmp_path / "out", "--vary", "strip.thicknes=1e-3,2e-3,3e-3")
    assert ended.exit_code == 2
    assert ended.stderr.count("thickness (the nearest known one)") == 1
    assert "--vary strip.thicknes=0.001: strip.thicknes\n" in ended.stderr


@pytest.mark.parametrize(
    ("given", "hint"),
    [
        ("friction.coefficient=[0.1, 0.2]", "--vary friction.coefficient=0.1,0.2"),
        ("strip.cells=[[16, 2], [32, 2]]", "--vary 'strip.cells=[16, 2],[32, 2]'"),
        ("strip.cells=[16, 2, 3]", "cells = [16, 2]"),
    ],
)
def test_values_that_are_typed_as_one_list(tmp_path: Path, given: str, hint: str) -> None:
    """Unless its first entry is not right either."""
    ended = typed(CAPSTAN, "-o", tmp_path / "out", "--vary", given)
    assert ended.exit_code == 2
    assert f"type:     {hint}\n" in ended.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "at least one key that varies"),
        (("--vary", "f", "--vary", "x=1:2"), "--vary f\n"),
        (("--vary", "f", "--vary", "x=1:2"), "--vary x=1:2\n"),
        (("--vary", "strip.width=1,2", "--vary", "strip.width=3"), "every key once"),
        (("--vary", "a=1:9:999", "--vary", "b=1:9:999"), "at most 100000 scenes"),
        (("--vary", "strip..width=1,2"), "a dotted key"),
        (("--vary", "strip.width=1,2", "--set", "strip.width=3"), "since strip.width varies"),
        (("--vary", "strip.cells=[9, 2],[8, 2]", "--set", "strip={}"), "since strip.cells varies"),
        # no mistake of the tables, but of the rollers that a run would build
        (
            ("--vary", "rollers.r1.centre=[0.0, 0.0, 0.0],[0.0, 0.0, -0.501]"),
            "outside the flat strip",
        ),
    ],
)
def test_wrong_variations(tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    ended = typed(CAPSTAN, "-o", tmp_path / "out", *arguments)
    assert ended.exit_code == 2
    assert words in ended.stderr
    assert not (tmp_path / "out").exists()


def test_without_dask(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(
        command, "find_spec", lambda name: None if name == "distributed" else util.find_spec(name)
    )
    ended = typed(CAPSTAN, "-o", tmp_path / "out", "--vary", "friction.coefficient=0.1,0.2")
    assert (ended.exit_code, ended.stdout) == (2, "")
    assert ended.stderr.count("\n") == 1
    assert 'pip install "dask[distributed]"' in ended.stderr


def test_a_scheduler_that_is_not_there(
    monkeypatch: pytest.MonkeyPatch, pull: Path, tmp_path: Path
) -> None:
    monkeypatch.setattr("anmstrip.driver.sweep.SCHEDULER_TIMEOUT", 0.2)
    ended = typed(
        pull,
        "-o",
        tmp_path / "out",
        "--vary",
        "strip.length=1,2",
        "--scheduler",
        "tcp://127.0.0.1:9",
    )
    assert ended.exit_code == 2
    assert "tcp://127.0.0.1:9" in ended.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_sigterm_interrupts_a_sweep_as_ctrl_c_does(
    monkeypatch: pytest.MonkeyPatch, pull: Path, tmp_path: Path
) -> None:
    """It says how to go on; it died without a word."""

    whole = Sweep.run

    def stopped(study: Sweep, client: Any) -> Any:
        for words in whole(study, client):
            os.kill(os.getpid(), signal.SIGTERM)
            yield words

    monkeypatch.setattr(Sweep, "run", stopped)
    told = typed(pull, "-o", tmp_path / "out", "--vary", "strip.length=1,2", "--workers", 1)
    assert told.exit_code == 1
    assert "Interrupted. Next: the same command, which goes on from here." in told.stdout


@pytest.mark.slow
def test_on_workers(pull: Path, tmp_path: Path) -> None:
    """By the command, with dask's processes: rows are what run writes, in their order."""
    out = tmp_path / "out"
    options = ("--vary", "strip.length=3.0:1.0:3", "--set", "strip.width=2.0", "--workers", "2")
    ended = typed(pull, "-o", out, *options)
    assert ended.exit_code == 0, ended.output
    assert "3 of 3 scenes done." in ended.stdout
    assert ended.stderr.count(" of 3 scenes, strip.length=") == 3
    rows = history.read_history(out / "sweep.csv")
    assert list(rows["strip.length"]) == [3.0, 2.0, 1.0]
    assert rows["status"] == ["done"] * 3
    for number, length in enumerate(("3.0", "2.0", "1.0")):
        direct = tmp_path / length
        settings = ["--set", f"strip.length={length}", "--set", "strip.width=2.0"]
        CliRunner().invoke(main, ["run", str(pull), "-o", str(direct), "--no-report", *settings])
        wanted = row_of(json.loads((direct / "summary.json").read_text(encoding="utf-8")))
        for name in ("steps", "tangents", "entry_tension", "exit_tension"):
            assert rows[name][number] == wanted[name]
        written = {path.name for path in (out / str(rows["directory"][number])).iterdir()}
        assert written == {"input.json", *(path.name for path in direct.iterdir())}
    assert (out / "sweep.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("direct")
def test_a_cluster_that_goes_away_leaves_its_table(
    monkeypatch: pytest.MonkeyPatch, pull: Path, tmp_path: Path
) -> None:
    lost = Direct(scenes=2, lost=True)
    monkeypatch.setattr("distributed.as_completed", list)
    monkeypatch.setattr(scenes, "local_workers", lambda count: nullcontext(lost))
    options = (pull, "-o", tmp_path / "out", "--vary", "strip.length=1,2,3")
    ended = typed(*options)
    assert ended.exit_code == 1
    assert "2 of 3 scenes done" in ended.stdout
    assert "Interrupted: the scheduler has gone. Next: the same command" in ended.stdout
    rows = history.read_history(tmp_path / "out" / "sweep.csv")
    assert rows["status"] == ["done", "done", "waiting"]
    monkeypatch.setattr(scenes, "local_workers", lambda count: nullcontext(Direct()))
    again = typed(*options)
    assert again.exit_code == 0
    assert "3 of 3 scenes done, 2 of them ended before" in again.stdout


@pytest.mark.usefixtures("direct")
@pytest.mark.parametrize("error", [OSError, RuntimeError])
def test_a_sweep_given_up_after_its_cluster(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch, pull: Path, tmp_path: Path
) -> None:
    """As when a caller's loop fails inside ``with local_workers()``: nothing more is said."""
    gone = Direct()
    monkeypatch.setattr(gone, "cancel", Mock(side_effect=error("IOLoop is closed")))
    running = Sweep(pull, ["strip.length=1,2"], directory=tmp_path / "out").run(cast(Any, gone))
    next(running)
    running.close()
    cast(Mock, gone.cancel).assert_called_once()


@pytest.mark.slow
def test_a_killed_scheduler(tmp_path: Path) -> None:
    """Killed after the first scene: one sentence, the table, and the rest next time.

    The worker stands still from then on, so that it cannot finish before, on any machine.
    """
    program = Path(sys.executable).with_name("dask")
    log, where = (tmp_path / "log").open("w"), tmp_path / "scheduler.json"
    where.touch()
    out, options = tmp_path / "out", [o for text in COARSE for o in ("--set", text)]
    typed_before = [CAPSTAN, "-o", out, "--vary", "friction.coefficient=0.1:0.4:6", *options]
    given = {"stdout": log, "stderr": log}
    server = subprocess.Popen(
        [program, "scheduler", "--port", "0", "--dashboard-address", ":0",
         "--scheduler-file", where], **given,
    )  # fmt: skip
    processes = [server]
    try:
        # The scheduler opens its file before it writes into it.
        while not where.read_text().endswith("\n}"):
            time.sleep(0.1)
            assert server.poll() is None
        address = json.loads(where.read_text())["address"]
        worker = subprocess.Popen(
            [program, "worker", "--no-nanny", "--nthreads", "1", address], **given
        )
        processes.append(worker)
        command = [sys.executable, "-m", "anmstrip.cli", "sweep", *map(str, typed_before)]
        sweep = subprocess.Popen(
            [*command, "--scheduler", address], stdout=-1, stderr=-1, text=True
        )
        table = out / "sweep.csv"
        while not (table.exists() and "done" in table.read_text()):
            time.sleep(0.01)
            assert sweep.poll() is None
        worker.send_signal(signal.SIGSTOP)
        server.kill()
        told, errors = sweep.communicate(timeout=120)
    finally:
        for process in processes:
            process.kill()
            process.wait()
        log.close()
    assert sweep.returncode == 1
    assert "Traceback" not in told + errors
    assert "Interrupted: the scheduler has gone. Next: the same command" in told
    assert "done" in history.read_history(out / "sweep.csv")["status"]
    again = typed(*typed_before, "--workers", 1)
    assert again.exit_code == 0, again.output
    assert "6 of 6 scenes done" in again.stdout


def test_scenes_are_sharpened_if_they_say_so(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """From the beginning, whatever an interrupted one has left."""
    begun: list[bool] = []

    def sharpened(scene: Scene, where: Path, effects: Any, resume: bool = False) -> Any:
        assert not effects
        begun.append(resume)
        (where / "summary.json").write_text('{"sharpened": [{}]}', encoding="utf-8")
        (where / "checkpoint.npz").touch()
        return iter(())

    monkeypatch.setattr("anmstrip.driver.scene.SharpenedRun", sharpened)
    scene = Scene.load(CAPSTAN, ['friction.regularisation="auto"'])
    for _ in range(2):
        assert scenes.run_scene(scene, tmp_path) == {"sharpened": [{}]}
    assert begun == [False, False]


@pytest.mark.usefixtures("direct")
def test_what_has_ended_is_not_run_again(pull: Path, tmp_path: Path) -> None:
    def sweep(values: str) -> Sweep:
        return Sweep(pull, [f"strip.length={values}"], directory=tmp_path / "out")

    first = sweep("1.0,2.0,3.0")
    failing = Direct(scenes=2, error=RuntimeError("no\nmemory"))
    assert [e.fraction for e in first.run(failing)] == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert len(failing.cancelled) == 3
    assert [row["status"] for row in first.rows] == ["done", "done", "failed"]
    assert first.rows[2]["message"] == "RuntimeError: no memory"
    before = (tmp_path / "out" / "strip.length=1.0" / "summary.json").stat().st_mtime_ns
    again = sweep("1.0,2.0,3.0,4.0")
    assert again.waiting == [2, 3]
    assert again.rows[0] == first.rows[0]
    assert len(list(again.run(Direct()))) == 2
    assert not again.stopped
    assert (tmp_path / "out" / "strip.length=1.0" / "summary.json").stat().st_mtime_ns == before
    pull.write_text(PULL.replace("1.0e4", "2.0e4"), encoding="utf-8")
    other = sweep("1.0,2.0")  # another scene under the same name
    assert other.waiting == [0, 1]
    assert len(list(other.run(Direct()))) == 2
    assert other.rows[0]["exit_tension"] == pytest.approx(2.0e4)


@pytest.mark.usefixtures("direct")
def test_a_scene_that_stops_early(pull: Path, tmp_path: Path) -> None:
    """It has its row, the others go on, and the status says so."""
    text = PULL.replace("1.0e4, 0.0", "1.0e4, 100.0").replace("cells = [4, 2]", "cells = [8, 2]")
    pull.write_text(
        text.replace("exit.force = [1.0e4, 100.0, 0.0]", "exit.force = [10.0, 0.0, 5.0]")
    )
    study = Sweep(pull, ["solver.max_steps=1,1000"], directory=tmp_path / "out")
    list(study.run(Direct()))
    assert [row["status"] for row in study.rows] == ["too_many_steps", "done"]
    ended = typed(pull, "-o", tmp_path / "out", "--vary", "solver.max_steps=1,1000")
    assert ended.exit_code == 1
    assert "1 of 2 scenes done" in ended.stdout
    assert "solver.max_steps=1: too_many_steps: " in ended.stdout


def test_an_unfinished_scene_goes_on_from_its_checkpoint(
    monkeypatch: pytest.MonkeyPatch, pull: Path, tmp_path: Path
) -> None:
    text = PULL.replace("[1.0e4, 0.0, 0.0]", "[10.0, 0.0, 5.0]")
    text += text[text.index("[[stages]]") :].replace("pull", "more").replace("5.0]", "9.0]")
    pull.write_text(text, encoding="utf-8")
    scene, directory = Scene.load(pull), tmp_path / "out"
    whole = scenes.run_scene(scene, tmp_path / "whole")
    assert len(whole["stages"]) == 2

    class Killed(BaseException):
        pass

    begun: list[bool] = []

    def killed_once(scene: Scene, where: Path, resume: bool, effects: Any) -> Any:
        assert not effects
        begun.append(resume)
        for step in Run(scene, where, resume):
            yield step
            if step.stage == "more" and not resume:
                raise Killed

    monkeypatch.setattr("anmstrip.driver.scene.Run", killed_once)
    with pytest.raises(Killed):
        scenes.run_scene(scene, directory)
    assert scenes.ended_summary(scene, directory) is None
    summary = scenes.run_scene(scene, directory)
    assert begun == [False, True]
    assert summary["steps"] == whole["steps"]
    assert row_of(summary)["exit_tension"] == row_of(whole)["exit_tension"]
    assert scenes.ended_summary(scene, directory) == summary


@pytest.mark.parametrize(
    "varied",
    [
        {"a": [0.1, 0.2, 0.3]},
        {"law": ["tanh", "norton-hoff"]},
        {"a": [1.0, 10.0, 100.0], "law": ["tanh", "norton-hoff"]},
        {"a": [0.1, 0.2], "b": [float(n) for n in range(9)]},
        {"a": [0.1, 0.2], "b": [1, 2], "cells": [[16, 2], [32, 2]]},
    ],
)
@pytest.mark.parametrize("ended", [True, False])
def test_figures(varied: dict[str, list[Any]], ended: bool, tmp_path: Path) -> None:
    """Also of a sweep of which nothing has ended."""
    from itertools import product

    rows = [dict(zip(varied, values, strict=True)) for values in product(*varied.values())]
    for number, row in enumerate(rows[: -1 if ended else 0]):
        row |= {"r1_tension_ratio": 1.0 + number, "r2_tension_ratio": None}
    save_figure(sweep_figure(rows, list(varied)), tmp_path / "sweep.png")
    assert (tmp_path / "sweep.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_killed_workers_lose_nothing(tmp_path: Path) -> None:
    """Both workers are killed in the midst of their scenes, after one has ended."""
    from anmstrip.driver.sweep import local_workers

    study = Sweep(CAPSTAN, ["friction.coefficient=0.1:0.4:4"], COARSE, directory=tmp_path / "out")
    with local_workers(workers=2) as client:
        running = study.run(client)
        first = study.directory / next(running).row["directory"]
        wait_for_steps(study, 2)
        begun = {path: stamp(path) for path in study.directory.glob("f*/input.json")}
        done = stamp(first / "summary.json")
        for pid in client.run(os.getpid).values():
            os.kill(pid, signal.SIGKILL)
        assert len(list(running)) == 3
    assert not study.stopped
    assert stamp(first / "summary.json") == done
    assert len(begun) >= 2
    assert {path: stamp(path) for path in begun} == begun  # gone on with
    for variant, row in zip(study.variants, study.rows, strict=True):
        wanted = row_of(scenes.run_scene(variant.scene, tmp_path / variant.directory.name))
        for name, value in wanted.items():
            if name.startswith("r1_"):
                expected = None if value is None else pytest.approx(value, rel=1e-12)
                assert row[name] == expected, name
        assert row["steps"] == wanted["steps"]


def stamp(path: Path) -> int:
    """When a file was written."""
    return path.stat().st_mtime_ns


def wait_for_steps(study: Sweep, checkpoints: int) -> None:
    """Until so many scenes are on their way, well into their second stage."""
    until = time.monotonic() + 120.0
    while time.monotonic() < until:
        going = [study.variants[number].directory for number in study.waiting]
        rows = [
            history.read_history(d / "history.csv")["step"]
            for d in going
            if (d / "checkpoint.npz").exists()
        ]
        if len([r for r in rows if len(r) > 5]) >= min(checkpoints, len(going)):
            return
        time.sleep(0.05)
    raise AssertionError("no scene is on its way")
