"""Runs that are killed or interrupted at any instant, and go on as if nothing had happened."""

from __future__ import annotations  # noqa: I001

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip.results import files as checkpoint, files as history
from anmstrip.results.vtk import read_collection as listed
from anmstrip.results.vtk import read_surface
from anmstrip.driver.scene import Scene

TABLES = """
[strip]
length = 4.0
width = 1.0
thickness = 1.0e-3
cells = [16, 2]
refined = 0.1
kinematics = "section"

[material]
young = 2.0e11
poisson = 0.3

[contact]
stiffness = 1.0e10
eta = 10.0
delta = 1.0e-3

[friction]
coefficient = 0.3
speed = 1.0

[[rollers]]
name = "r1"
radius = 0.5
centre = [0.0, 0.0, -0.501]
axis = [0.0, 1.0, 0.0]

[edges.entry]
fixed = ["x", "z"]

[[stages]]
name = "tension"
duration = 1.0
friction = false
exit.force = [1.0e4, 0.0, 0.0]

[[stages]]
name = "wrap"
duration = 1.0
friction = false
entry.move = [0.0, 0.0, -0.45]
exit.force = [1.0e4, 0.0, -5773.5]

[[stages]]
name = "turn"
duration = 0.5
rollers.r1.surface_speed = 1.0

[solver]
tolerance = 1.0e-5

[output]
every = 3
"""

PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    "from anmstrip.driver import recorder; recorder.CHECKPOINT_SECONDS = 0.1;"
    "from anmstrip.cli import main; main()"
)
"""The command line, saving more often than it would, since the run is short.

Background jobs of a shell ignore Ctrl-C, and hand that down.
"""


@dataclass(frozen=True)
class Whole:
    """A run that nobody stopped."""

    scene: Path
    directory: Path
    rows: int


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    directory = tmp_path_factory.mktemp("whole")
    scene = directory / "scene.toml"
    scene.write_text(TABLES, encoding="utf-8")
    whole = Whole(scene, directory / "results", 0)
    finished(whole, whole.directory)
    return replace(whole, rows=rows_of(whole.directory))


class started:  # noqa: N801 - reads as a verb
    """A run in a process of its own, which is gone after the block."""

    def __init__(self, scene: Path, directory: Path, resume: bool) -> None:
        arguments = ["run", str(scene), "-o", str(directory), "--quiet"]
        self.command = [sys.executable, "-c", PROGRAM, *arguments, *["--resume"] * resume]
        self.log = directory.with_suffix(".log")

    def __enter__(self) -> subprocess.Popen[bytes]:
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(self.command, stdout=log, stderr=log)
        return self.process

    def __exit__(self, *error: object) -> None:
        self.process.kill()
        self.process.wait()


def rows_of(directory: Path) -> int:
    """Steps in the history so far."""
    path = directory / "history.csv"
    return max(path.read_bytes().count(b"\n") - 1, 0) if path.exists() else 0


def signalled(whole: Whole, directory: Path, stop: Stop, sign: signal.Signals) -> bool:
    """Start or go on, and send a signal; whether it came before the end."""
    resume = (directory / "checkpoint.npz").exists()
    with started(whole.scene, directory, resume) as process:
        while rows_of(directory) < stop.rows and process.poll() is None:
            time.sleep(0.002)
        time.sleep(stop.seconds)
        os.kill(process.pid, sign)
        return process.wait(timeout=60) != 0


def finished(whole: Whole, directory: Path) -> None:
    """Go on to the end."""
    resume = (directory / "checkpoint.npz").exists()
    with started(whole.scene, directory, resume) as process:
        status = process.wait(timeout=120)
    assert status == 0, directory.with_suffix(".log").read_text()


def check_readable(directory: Path) -> None:
    """Whatever is there can be read, and belongs together."""
    rows = 0
    if (directory / "history.csv").exists():
        table = history.read_history(directory / "history.csv")
        rows = len(table["time"])
        assert list(table["step"]) == list(range(1, rows + 1))
        assert (np.diff(table["time"]) > 0.0).all()
    for name in ("strip", "rollers"):
        if (directory / f"{name}.pvd").exists():
            entries = listed(directory / f"{name}.pvd")
            assert len({entry.file for entry in entries}) == len(entries)
            assert all(np.diff([entry.time for entry in entries]) > 0.0)
            for entry in entries:
                surface = read_surface(directory / entry.file)
                assert np.isfinite(surface.points).all()
    if (directory / "checkpoint.npz").exists():
        _, facts = checkpoint.load_checkpoint(directory / "checkpoint.npz")
        assert facts["rows"]["history.csv"] == facts["steps"] <= rows
    if (directory / "summary.json").exists():
        summary = summary_of(directory)
        assert summary["status"]
        assert summary["message"]


def summary_of(directory: Path) -> Any:
    return json.loads((directory / "summary.json").read_text(encoding="utf-8"))


def check_same(whole: Whole, directory: Path) -> None:
    """State, tensions and history of both runs, to 1e-12."""
    mine, theirs = (
        checkpoint.load_checkpoint(d / "checkpoint.npz")[0] for d in (directory, whole.directory)
    )
    length = Scene.load(whole.scene).strip.length
    np.testing.assert_allclose(mine["full"], theirs["full"], rtol=0.0, atol=1e-12 * length)
    found, wanted = summary_of(directory), summary_of(whole.directory)
    assert found["status"] == wanted["status"] == "done"
    for edge, values in wanted["edges"].items():
        assert found["edges"][edge]["tension"] == pytest.approx(values["tension"], rel=1e-12)
    assert found["steps"] == wanted["steps"]
    assert found["tangents"] >= wanted["tangents"]
    ours, reference = (
        history.read_history(d / "history.csv") for d in (directory, whole.directory)
    )
    np.testing.assert_allclose(ours["time"], reference["time"], rtol=1e-12)
    tables = [history.read_history(d / "profile.csv") for d in (directory, whole.directory)]
    np.testing.assert_allclose(*(table["time"] for table in tables), rtol=1e-12)
    np.testing.assert_allclose(*(table["z"] for table in tables), atol=1e-12 * length)
    entries = [listed(d / "strip.pvd") for d in (directory, whole.directory)]
    assert [e.file for e in entries[0]] == [e.file for e in entries[1]]
    files = {path.name for path in directory.iterdir()}
    assert files == {path.name for path in whole.directory.iterdir()}


@dataclass(frozen=True)
class Stop:
    """An instant: some time (s) after a number of steps."""

    rows: int
    seconds: float


def instants(whole: Whole, count: int, seed: int) -> Iterator[list[Stop]]:
    """For each of a number of runs when to stop it, every other one twice."""
    random = np.random.default_rng(seed)
    for number in range(count):
        rows = np.sort(random.integers(1, whole.rows - 10, 1 + number % 2))
        yield [Stop(int(n), float(random.uniform(0.0, 0.03))) for n in rows]


SIGNALS = (
    *(signal.SIGKILL, signal.SIGINT),
    pytest.param(
        signal.SIGTERM, marks=pytest.mark.slow
    ),  # the command handles it as it does SIGINT
)


@pytest.mark.parametrize("runs", [1, pytest.param(12, marks=pytest.mark.slow)])
@pytest.mark.parametrize("sign", SIGNALS)
def test_stopped_runs_end_where_the_other_did(
    whole: Whole, tmp_path: Path, runs: int, sign: signal.Signals
) -> None:
    stopped = []
    for number, stops in enumerate(instants(whole, runs, seed=runs)):
        directory = tmp_path / str(number)
        for stop in stops:
            stopped.append(signalled(whole, directory, stop, sign))
            check_readable(directory)
            if sign is not signal.SIGKILL and stopped[-1]:
                check_nothing_lost(directory)
                assert "Next: anmstrip run" in directory.with_suffix(".log").read_text()
        finished(whole, directory)
        check_readable(directory)
        check_same(whole, directory)
    assert sum(stopped) >= runs


def check_nothing_lost(directory: Path) -> None:
    """After an interruption all files tell of the same steps."""
    summary, rows = summary_of(directory), history.read_history(directory / "history.csv")["time"]
    assert summary["status"] in ("interrupted", "done")
    assert checkpoint.load_checkpoint(directory / "checkpoint.npz")[1]["steps"] == summary["steps"]
    assert summary["steps"] == len(rows)
