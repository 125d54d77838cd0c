"""Runs of whole scenes: what they find, what they write, and what is left after a stop."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip.continuation.path import Outcome
from anmstrip.driver.run import Run, Step
from anmstrip.driver.scene import Scene
from anmstrip.results import files as checkpoint
from anmstrip.results import files as history
from anmstrip.results.vtk import read_collection as listed
from anmstrip.results.vtk import read_surface

EXAMPLES = Path(__file__).parents[2] / "examples"
CAPSTAN, PRESS = EXAMPLES / "capstan.toml", EXAMPLES / "press.toml"
COARSE = ["strip.refined=0.1", "solver.tolerance=1e-4", "output.every=5"]
SMALL = [
    "strip.refined=0.2", "solver.tolerance=1e-3", "stages.turn.duration=0.1", "output.every=2",
]  # fmt: skip
GENTLE = [
    "strip.refined=0.2", "solver.tolerance=1e-3", "stages.press.exit.force=[1e4, 0.0, 0.0]",
    "stages.press.entry.move=[0.0, 0.0, -0.02]",
]  # fmt: skip

FIELDS = {
    "displacement", "velocity", "normal_pressure", "friction_traction", "slip_velocity", "gap",
    "membrane_force", "bending_moment", "von_mises", "mean_curvature", "arc_length", "tension",
    "contact_status", "normal",
}  # fmt: skip
COLUMNS = [
    "stage", "time", "step", "tangents", "order", "range", "residual",
    "entry_tension", "exit_tension", "r1_normal_force", "r1_drag", "r1_wrap", "r1_max_slip",
    "r1_surface_speed", "r1_torque",
]  # fmt: skip


class Finished:
    """A run to its end with its directory."""

    def __init__(self, scene: Scene, directory: Path) -> None:
        self.directory = directory
        self.run: Run = scene.run(directory)
        self.steps: list[Step] = list(self.run)
        self.last = self.steps[-1].state

    def times_of_every(self, n: int) -> list[float]:
        last = self.steps[-1].step
        chosen = [step.time for step in self.steps if step.step % n == 0 or step.step == last]
        return [0.0, *chosen]

    def steps_of(self, stage: str) -> list[Step]:
        return [step for step in self.steps if step.stage == stage]

    @property
    def summary(self) -> Any:
        return json.loads((self.directory / "summary.json").read_text(encoding="utf-8"))

    @property
    def history(self) -> Any:
        return history.read_history(self.directory / "history.csv")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Finished]:
    """Run a scene file with overrides, each once."""
    found: dict[tuple[Path, tuple[str, ...]], Finished] = {}

    def run(scene: Path, overrides: list[str]) -> Finished:
        key = (scene, tuple(overrides))
        if key not in found:
            loaded = Scene.load(scene, overrides)
            found[key] = Finished(loaded, tmp_path_factory.mktemp(scene.stem))
        return found[key]

    return run


@pytest.fixture(scope="module")
def capstan(finished: Callable[..., Finished]) -> Finished:
    return finished(CAPSTAN, COARSE)


@pytest.fixture(scope="module")
def small(finished: Callable[..., Finished]) -> Finished:
    return finished(CAPSTAN, SMALL)


def test_capstan(capstan: Finished) -> None:
    """e^(f_eff θ) less the correction for bending: 1.2508, to the accuracy of the mesh."""
    assert capstan.run.outcome is Outcome.DONE
    assert capstan.run.message.startswith("Done")
    reading = capstan.last.rollers["r1"]
    assert reading.tension_ratio == pytest.approx(1.2508, rel=5e-3)
    assert capstan.steps[-1].tension_ratio == reading.tension_ratio
    assert reading.max_slip == pytest.approx(1.0, rel=1e-3)
    assert reading.cone_violation == 0.0
    balance = capstan.last.edge_force("entry") + capstan.last.edge_force("exit") + reading.resultant
    assert np.abs(balance).max() < 1e-3 * 1e4
    moment_arm = (reading.tension_in - reading.tension_out) / reading.drag
    assert moment_arm == pytest.approx(1.0, rel=5e-3)


def test_steps_lead_from_the_start_to_the_end(capstan: Finished) -> None:
    times = [step.time for step in capstan.steps]
    assert (np.diff(times) > 0.0).all()
    assert times[-1] == pytest.approx(2.6) == capstan.steps[-1].end_time
    assert [step.step for step in capstan.steps] == list(range(1, len(times) + 1))
    assert capstan.steps[-1].fraction == pytest.approx(1.0)
    assert list(dict.fromkeys(step.stage for step in capstan.steps)) == ["tension", "wrap", "turn"]


def test_history_has_a_row_for_every_step(capstan: Finished) -> None:
    table = capstan.history
    assert list(table) == COLUMNS
    assert table["step"].tolist() == [step.step for step in capstan.steps]
    assert table["time"].tolist() == [step.time for step in capstan.steps]
    assert table["tangents"].tolist() == [step.tangents for step in capstan.steps]
    assert set(table["stage"]) == {"tension", "wrap", "turn"}
    assert all(np.isfinite(table[name]).all() for name in COLUMNS[1:])
    assert (table["residual"] <= 1e-4).all()
    assert table["exit_tension"][-1] == pytest.approx(np.hypot(1e4, 5773.5), rel=1e-3)
    ratio = table["entry_tension"][-1] / table["exit_tension"][-1]
    assert ratio == pytest.approx(capstan.steps[-1].tension_ratio, rel=1e-3)


def test_summary_has_what_is_promised(capstan: Finished) -> None:
    summary = capstan.summary
    assert {
        "status", "message", "unknowns", "steps", "tangents", "wall_seconds", "effects",
        "stages", "rollers", "edges", "input", "versions",
    } <= set(summary)  # fmt: skip
    assert (summary["status"], summary["steps"]) == ("done", len(capstan.steps))
    assert summary["unknowns"] == capstan.run.assembly.strip.unknowns
    assert {
        "normal_force", "drag", "wrap", "tension_in", "tension_out", "tension_ratio",
        "creep_speed", "cone_violation",
    } <= set(summary["rollers"]["r1"])  # fmt: skip
    assert summary["edges"]["exit"]["tension"] == pytest.approx(11547.0, rel=1e-3)
    assert Scene.model_validate(summary["input"]).to_dict() == summary["input"]
    names = {"membrane", "bending", "contact", "friction", "force on exit"}
    assert set(summary["effects"]) == names
    assert all(effect["seconds"] > 0.0 for effect in summary["effects"].values())
    assert "scipy" in summary["versions"]


def test_counters_are_honest(capstan: Finished) -> None:
    cost, summary = capstan.run.cost, capstan.summary
    assert summary["tangents"] == cost.expansions == capstan.steps[-1].tangents > 0
    looks = 2  # at strip that is pressed across: it does not wrinkle by far
    assert 0 <= summary["factorisations"] - summary["tangents"] <= looks
    assert cost.factorisations == summary["factorisations"]
    for counter in ("steps", "tangents"):
        assert sum(stage[counter] for stage in summary["stages"].values()) == summary[counter]
    seconds = sum(stage["seconds"] for stage in summary["stages"].values())
    told = seconds + summary["seconds"]["errors"]
    assert 0.5 * summary["wall_seconds"] < told <= summary["wall_seconds"]
    assert summary["tangents"] < 1.3 * summary["steps"]


def test_states_are_listed_and_complete(capstan: Finished) -> None:
    for name in ("strip", "rollers"):
        entries = listed(capstan.directory / f"{name}.pvd")
        assert [entry.time for entry in entries] == capstan.times_of_every(5)
        assert all((capstan.directory / entry.file).stat().st_size > 0 for entry in entries)
    surface = read_surface(capstan.directory / listed(capstan.directory / "strip.pvd")[-1].file)
    assert set(surface.fields) == FIELDS
    assert surface.cells.shape == (capstan.run.assembly.strip.mesh.nelements, 16)
    assert all(np.isfinite(values).all() for values in surface.fields.values())
    pressure, traction = (surface.fields[n] for n in ("normal_pressure", "friction_traction"))
    assert pressure.min() >= 0.0
    assert pressure.max() > 1e4
    ratio = np.linalg.norm(traction, axis=1).max() / pressure.max()
    assert ratio == pytest.approx(0.2986, rel=0.01)
    assert surface.fields["von_mises"].max() < 1e9
    tension, x = surface.fields["membrane_force"][:, 0], surface.points[:, 0]
    after = tension[x > 1.0]
    assert after.size
    assert after == pytest.approx(11547.0, rel=0.05)
    assert tension[x < -1.0].mean() == pytest.approx(1.25 * 11547.0, rel=0.02)


def test_curvature_over_the_roller_is_its_own(capstan: Finished) -> None:
    surface = read_surface(capstan.directory / listed(capstan.directory / "strip.pvd")[-1].file)
    over = surface.fields["normal_pressure"] > 1e4
    assert over.any()
    mean = surface.fields["mean_curvature"][over].mean()
    assert abs(mean) == pytest.approx(0.5 / 0.5, rel=0.3)


def pressed_as_a_beam(found: Finished, element: float) -> tuple[float, float]:
    """Check the arc in contact against the beam on a cylinder; tension and stiffness."""
    strip, reading = found.run.assembly.strip, found.last.rollers["r1"]
    d, tension, radius = strip.bending_stiffness, reading.tension_out, 0.5
    entry, exit_ = found.last.edge_force("entry"), found.last.edge_force("exit")
    turned = np.arccos(-(entry @ exit_) / np.linalg.norm(entry) / np.linalg.norm(exit_))
    lift_off = 2.0 * np.arcsin(np.sqrt(d / tension) / (2.0 * radius))
    assert reading.wrap == pytest.approx(turned - 2.0 * lift_off, abs=element / radius)
    return d, tension


def test_strip_without_friction_has_no_velocity(finished: Callable[..., Finished]) -> None:
    press = finished(PRESS, GENTLE)
    assert press.run.outcome.done
    assert all(step.state.velocity is None for step in press.steps)
    assert not press.run.march.velocity.any()
    assert not any("friction" in name for name in press.summary["effects"])
    assert set(press.summary["effects"]) == {"membrane", "bending", "contact", "force on exit"}
    surface = read_surface(press.directory / listed(press.directory / "strip.pvd")[-1].file)
    for name in ("velocity", "slip_velocity", "friction_traction"):
        assert not surface.fields[name].any()
    reading = press.last.rollers["r1"]
    assert (reading.drag, reading.max_slip, reading.creep_speed) == (0.0, 0.0, 0.0)
    assert reading.normal_force > 0.0
    assert reading.tension_ratio == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
def test_pressure_in_the_arc(finished: Callable[..., Finished]) -> None:
    """(T − D/2R²)/R, mean over the width and over the inner half of the arc."""
    sharp = ["contact.onset=2e-6"]  # else contact is felt before it bears
    found = finished(PRESS, ["strip.refined=0.05", "solver.tolerance=1e-4", *sharp])
    d, tension = pressed_as_a_beam(found, 0.05)
    state = found.last.contacts["r1"]
    normal = state.normal[:, state.touching].sum(axis=1)
    across = np.cross(state.roller.unit_axis, normal)
    angle = np.arctan2(across @ state.normal, normal @ state.normal)
    inner = np.abs(angle) < 0.25 * found.last.rollers["r1"].wrap
    assert inner.sum() > 20
    mean = (state.pressure * state.area)[inner].sum() / state.area[inner].sum()
    assert mean == pytest.approx((tension - d / (2.0 * 0.5**2)) / 0.5, rel=0.02)


def test_states_at_given_times(finished: Callable[..., Finished]) -> None:
    found = finished(PRESS, [*GENTLE, "output.times=[0.25, 1.3, 1.31, 2.0]"])
    for name in ("strip", "rollers"):
        entries = listed(found.directory / f"{name}.pvd")
        assert [entry.time for entry in entries] == [0.25, 1.3, 1.31, 2.0]
    tip = [
        read_surface(found.directory / entry.file).fields["displacement"][:, 2].min()
        for entry in listed(found.directory / "strip.pvd")
    ]
    np.testing.assert_allclose(tip, [0.0, -0.006, -0.0062, -0.02], rtol=1e-6, atol=1e-12)
    assert len(found.history["time"]) == len(found.steps)


def test_state_inside_a_rate_free_step_is_in_equilibrium(finished: Callable[..., Finished]) -> None:
    found = finished(PRESS, GENTLE)
    longest = int(np.argmax(np.diff([step.time for step in found.steps]))) + 1
    before, state = found.steps[longest - 1].state, found.steps[longest].state
    inside = state.at(0.5 * (before.time + state.time), before)
    free = state.plan.supports.free
    for found_state in (inside, state):
        assert np.abs(found_state.imbalance[free]).max() < 2e-3 * 1e4
    assert state.at(state.time, before) is state


def test_state_inside_a_step_in_time(capstan: Finished) -> None:
    """In equilibrium, and near both ends like these."""
    before, state = capstan.steps[-2].state, capstan.steps[-1].state
    h = state.time - before.time
    near = state.at(state.time - 1e-4 * h, before)
    slip = state.rollers["r1"].max_slip
    np.testing.assert_allclose(near.velocity, state.velocity, atol=1e-3 * slip)
    np.testing.assert_allclose(near.full, state.full, atol=1e-6)
    start = state.at(before.time + 1e-9 * h, before)
    np.testing.assert_allclose(start.full, before.full, atol=1e-9)
    inside, free = state.at(state.time - 0.5 * h, before), state.plan.supports.free
    assert np.abs(inside.imbalance[free]).max() < 1e-5 * state.tension("exit")


def test_plain_surfaces(finished: Callable[..., Finished]) -> None:
    found = finished(PRESS, [*GENTLE, "output.smooth=false", "output.every=1000"])
    _, entry = listed(found.directory / "strip.pvd")
    surface = read_surface(found.directory / entry.file)
    assert surface.cells.shape == (9 * found.run.assembly.strip.mesh.nelements, 4)
    assert entry.time == pytest.approx(2.0)


def test_every_nth_step_is_written(finished: Callable[..., Finished]) -> None:
    found = finished(PRESS, [*GENTLE, "output.every=3"])
    entries = listed(found.directory / "strip.pvd")
    assert [entry.time for entry in entries] == found.times_of_every(3)


def short(**others: Any) -> dict[str, Any]:
    """A tensioned strip of a few elements, as tables."""
    return {
        "strip": {"length": 2.0, "width": 0.5, "thickness": 1e-3, "cells": [8, 2]},
        "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
        "stages": [{"duration": 1.0, "friction": False, "exit": {"force": [1e4, 0.0, 0.0]}}],
        "solver": {"tolerance": 1e-4},
        **others,
    }


ROLLER = {
    "contact": {"stiffness": 1e8, "eta": 100.0, "delta": 1e-3},
    "rollers": [{"radius": 0.5, "centre": [0.0, 0.0, -0.501], "axis": [0.0, 1.0, 0.0]}],
}


def test_weight_is_carried_by_the_ends(tmp_path: Path) -> None:
    tables = short()
    tables["edges"]["exit"] = {"fixed": ["z"]}
    del tables["stages"][0]["friction"]
    tables["stages"].append({"duration": 1.0, "gravity": [0.0, 0.0, -9.81]})
    found = Finished(Scene.model_validate(tables), tmp_path)
    assert found.run.outcome.done
    total = found.last.edge_force("entry") + found.last.edge_force("exit")
    mass = 7850.0 * 1e-3 * 2.0 * 0.5
    assert total[2] == pytest.approx(9.81 * mass, rel=1e-6)
    assert found.last.edge_force("entry")[2] == pytest.approx(0.5 * total[2], rel=1e-6)
    assert abs(total[0]) < 1e-3 * 1e4
    sag = -found.last.full.reshape(-1, 3)[found.run.assembly.strip.node_values, 2].min()
    assert sag == pytest.approx(9.81 * 7.85 * 2.0**2 / 8.0 / 1e4, rel=0.02)
    assert all(step.state.velocity is None for step in found.steps)
    assert found.summary["rollers"] == {}
    assert not (tmp_path / "rollers.pvd").exists()


def test_roller_that_is_moved_presses() -> None:
    """2 T sin α of the two straight parts, α from the slope between end and roller."""
    tables = short(**ROLLER)
    tables["edges"]["exit"] = {"fixed": ["z"]}
    tables["stages"].append({"duration": 1.0, "rollers": {"r1": {"move": [0.0, 0.0, 0.021]}}})
    del tables["stages"][0]["friction"]
    run = Scene.model_validate(tables).run()
    *_, last = run
    assert run.outcome.done, run.message
    state = last.state
    np.testing.assert_allclose(state.controls["rollers.r1.centre"], [0.0, 0.0, -0.48])
    reading = state.rollers["r1"]
    balance = state.edge_force("entry") + state.edge_force("exit") + reading.resultant
    assert np.abs(balance).max() < 1e-3 * 1e4
    assert reading.normal_force == pytest.approx(2.0 * 5e3 * 0.02, rel=0.1)


def test_released_edge_keeps_its_tension(tmp_path: Path) -> None:
    """The reaction becomes a load, also when the release is where a run was resumed."""
    tables = short(
        **ROLLER,
        friction={
            "law": "norton-hoff",
            "coefficient": 0.3,
            "exponent": 0.1,
            "omega": 0.1,
            "speed": 1.0,
        },
    )
    tables["strip"]["kinematics"] = "section"
    tables["solver"]["tolerance"] = 1e-3
    tables["stages"] += [
        {"name": "wrap", "duration": 1.0, "friction": False, "entry": {"move": [0.0, 0.0, -0.02]}},
        {"name": "free", "duration": 0.001, "entry": {"release": True}},
    ]
    scene = Scene.model_validate(tables)
    found = Finished(scene, tmp_path / "whole")
    assert found.run.outcome.done, found.run.message
    held = [step.state for step in found.steps if step.stage == "wrap"][-1]
    np.testing.assert_allclose(
        found.last.edge_force("entry"), held.edge_force("entry"), atol=1e-2 * 1e4
    )
    np.testing.assert_allclose(
        found.last.controls["entry.force"], held.edge_force("entry") / 0.5, atol=1e-6 * 1e4
    )
    assert found.summary["edges"]["entry"]["tension"] == pytest.approx(1e4, rel=0.01)
    resumed = interrupted(scene, tmp_path / "half", len(found.steps_of("wrap")) + 1)
    np.testing.assert_array_equal(
        resumed.state.controls["entry.force"], found.last.controls["entry.force"]
    )
    np.testing.assert_allclose(resumed.march.full, found.run.march.full, atol=1e-12)


def interrupted(scene: Scene, directory: Path, after: int) -> Run:
    """Interrupt after a number of steps, and go on to the end."""
    run = scene.run(directory)
    for step in run:
        if step.step == after:
            break
    run.interrupted()
    assert run.outcome is Outcome.INTERRUPTED
    again = scene.run(directory, resume=True)
    for _ in again:
        pass
    return again


@pytest.mark.parametrize("where", ["wrap", "turn"])
def test_resumed_run_ends_where_the_other_did(small: Finished, tmp_path: Path, where: str) -> None:
    """In time nothing differs; a rate-free step is cut elsewhere, and round-off differs."""
    wrap = len(small.steps_of("wrap"))
    after = {"wrap": 1 + wrap // 2, "turn": wrap + 8}[where]
    run = interrupted(small.run.scene, tmp_path, after)
    assert run.outcome.done, run.message
    units = np.repeat(run.assembly.strip.dof_lengths, 3)
    assert np.abs((run.march.full - small.run.march.full) / units).max() < (
        1e-10 if where == "wrap" else 1e-14
    )
    table = history.read_history(tmp_path / "history.csv")
    assert (np.diff(table["time"]) > 0.0).all()
    assert table["step"].tolist() == list(range(1, run.steps + 1))
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    for counter in ("steps", "tangents"):
        assert sum(stage[counter] for stage in summary["stages"].values()) == summary[counter]
    entries = listed(tmp_path / "strip.pvd")
    times = table["time"].tolist()
    odd_end = times[-1:] if len(times) % 2 else []
    assert [entry.time for entry in entries] == [0.0, *times[1::2], *odd_end]
    assert len({entry.file for entry in entries}) == len(entries)
    assert run.recorder.turned == pytest.approx(small.run.recorder.turned)
    rows = history.read_history(tmp_path / "profile.csv")["time"]
    assert sorted(set(rows)) == [entry.time for entry in entries]
    assert len(rows) % len(entries) == 0


def test_finished_run_that_is_resumed_stays_what_it_was(small: Finished, tmp_path: Path) -> None:
    directory = shutil.copytree(small.directory, tmp_path / "copy")
    again = small.run.scene.run(directory, resume=True)
    assert list(again) == []
    assert again.outcome.done
    found = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
    for key in ("rollers", "edges", "steps", "tangents", "status"):
        assert found[key] == small.summary[key]
    assert found["rollers"]["r1"]["normal_force"] > 0.0


@pytest.mark.parametrize("most", [3, pytest.param(6, marks=pytest.mark.slow)])
def test_run_that_stops_early_says_where(tmp_path: Path, most: int) -> None:
    ended = command("run", CAPSTAN, "-o", tmp_path, *options([*SMALL, f"solver.max_steps={most}"]))
    assert ended.returncode == 1
    assert "stage wrap" in ended.stdout
    assert "Traceback" not in ended.stderr
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert (summary["status"], summary["steps"]) == ("too_many_steps", most)
    assert "stage wrap" in summary["message"]
    checkpoint.load_checkpoint(tmp_path / "checkpoint.npz")


def options(overrides: list[str]) -> list[str]:
    return [part for text in overrides for part in ("--set", text)]


PROGRAM = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it
from anmstrip.cli import main
main()
"""
COMMAND = [sys.executable, "-c", PROGRAM]


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=120
    )


def stopped(directory: Path, sign: signal.Signals) -> subprocess.Popen[str]:
    """Start a run, and signal it once it has listed three states."""
    arguments = ["run", CAPSTAN, "-o", directory, "--quiet", *options(SMALL)]
    process = subprocess.Popen(
        [*COMMAND, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        deadline = time.monotonic() + 60.0
        while len(entries_of(directory)) < 3:
            assert process.poll() is None, process.stderr.read()
            assert time.monotonic() < deadline
            time.sleep(0.02)
        os.kill(process.pid, sign)
        process.communicate(timeout=60)
    finally:
        process.kill()
    return process


def entries_of(directory: Path) -> tuple[Any, ...]:
    path = directory / "strip.pvd"
    return listed(path) if path.exists() else ()


@pytest.mark.slow
def test_killed_run_can_be_read_and_resumed(small: Finished, tmp_path: Path) -> None:
    process = stopped(tmp_path, signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    pyvista = pytest.importorskip("pyvista", exc_type=ImportError)
    reader = pyvista.get_reader(str(tmp_path / "strip.pvd"))
    assert 3 <= len(reader.time_values) < len(small.steps)
    for number in range(len(reader.time_values)):
        reader.set_active_time_point(number)
        block = reader.read()[0]
        assert set(block.point_data) >= FIELDS
    table = history.read_history(tmp_path / "history.csv")
    assert len(table["time"]) >= len(reader.time_values)
    _, facts = checkpoint.load_checkpoint(tmp_path / "checkpoint.npz")
    assert 1 <= facts["steps"] <= len(table["time"])
    assert not (tmp_path / "summary.json").exists()
    ended = command("run", CAPSTAN, "-o", tmp_path, "--resume", *options(SMALL))
    assert (ended.returncode, "Traceback" in ended.stderr) == (0, False), ended.stderr
    found, facts = checkpoint.load_checkpoint(tmp_path / "checkpoint.npz")
    np.testing.assert_allclose(found["full"], small.run.march.full, rtol=1e-9, atol=1e-10)
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["status"] == "done"
    assert not list(tmp_path.glob("*.tmp*"))


def test_interrupted_run_writes_what_it_has(tmp_path: Path) -> None:
    process = stopped(tmp_path, signal.SIGINT)
    assert process.returncode == 1
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "interrupted"
    assert summary["steps"] >= 3
    assert re.search("interrupted", summary["message"])
    _, facts = checkpoint.load_checkpoint(tmp_path / "checkpoint.npz")
    assert facts["steps"] == summary["steps"]
    assert summary["rollers"]["r1"]["tension_out"] > 0.0


def test_newtons_method_takes_the_steps_that_it_may() -> None:
    scene = Scene.load(PRESS, [*GENTLE, 'solver.method="newton"', "solver.max_steps=2"])
    run = scene.run()
    assert len(list(run)) == 2
    assert run.outcome is Outcome.TOO_MANY_STEPS
