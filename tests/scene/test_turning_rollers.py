"""Rollers that a torque or the strip turns, in runs: statics, speeds, travel, messages."""

from __future__ import annotations

from copy import deepcopy
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from threaded import ended, roller, scene_of

from anmstrip.advice.warnings import Preview, serious
from anmstrip.driver.explain import explain, report
from anmstrip.driver.scene import Scene
from anmstrip.simulation.problem import Assembly

RADIUS, WIDTH, SPEED = 0.2, 0.5, 0.2

LINE: dict[str, Any] = {
    "strip": {"thickness": 5e-4, "width": WIDTH, "refined": 0.03},
    "friction": {"law": "tanh", "coefficient": 0.3, "speed": 1e-3},
    "threading": {"tension": 1e4, "entry": (-0.2, 0.0, -0.6), "exit": (0.8, 0.0, -0.4)},
    "rollers": [
        roller("a", 0.0, 0.0, RADIUS, "over"),
        roller("b", 0.5, -0.2, RADIUS, "under", axis=(0.0, -1.0, 0.0)),
    ],
    "stages": [
        {"name": "hold", "duration": 0.1},
        {"name": "start", "duration": 0.1, "entry": {"velocity": [0.0, 0.0, SPEED]}},
        {"name": "run", "duration": 0.1},
    ],
    "solver": {"tolerance": 1e-3},
}  # fmt: skip
"""Two rollers, the axis of the second turned round; the entry lets the strip go at a speed."""


def turned(first: dict[str, Any], second: dict[str, Any], **controls: Any) -> Scene:
    """The line with other drives, and controls of its first stage."""
    line = deepcopy(LINE)
    line["rollers"] = [
        table | own for table, own in zip(line["rollers"], (first, second), strict=True)
    ]
    line["stages"][0]["rollers"] = controls
    return scene_of(line)


@pytest.fixture(scope="module")
def braked() -> Any:
    """An idler with bearings and a roller with a torque."""
    drives = {"drive": "idle", "bearing": 40.0}, {"drive": "torque"}
    line = turned(*drives, b={"torque": 60.0})
    solver = line.solver.model_copy(update={"time_step": 2e-3})  # for the ways of the rollers
    return ended(line.model_copy(update={"solver": solver}))


def test_tensions_are_those_of_moments_about_the_axes(braked: Any) -> None:
    """Bearings of 40 N m over 0.2 m and 0.5 m brake by 400 N/m, a torque of 60 N m pulls by 600.

    Tensions of the bent strip act at the radius, to a share of its strain and to the tolerance.
    """
    _, state = braked
    a, b = state.rollers["a"], state.rollers["b"]
    assert a.tension_out - a.tension_in == pytest.approx(400.0, abs=10.0)
    assert b.tension_in - b.tension_out == pytest.approx(600.0, abs=10.0)
    assert (a.bearing_torque, b.bearing_torque) == pytest.approx((40.0, 0.0), rel=1e-3)
    assert (a.torque, b.torque) == pytest.approx((-40.0, 60.0), abs=0.01)
    assert (a.drag, b.drag) == pytest.approx((-200.0, 300.0), abs=0.05)
    assert b.tension_out == pytest.approx(1e4, rel=1e-3)


def test_a_roller_with_a_torque_is_driven(braked: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """So the strip is said to slide over it, as it would be of one with a speed."""
    run, _ = braked
    monkeypatch.setattr("anmstrip.advice.warnings.slides", lambda contact: True)
    monkeypatch.setattr("anmstrip.driver.explain.SLIDING_SHARE", 0.0)
    assert "The strip slides over b." in report(run)


def test_free_rollers_turn_with_the_strip(braked: Any) -> None:
    """But for the slip that their friction needs, V_c atanh of its share of the cone."""
    run, state = braked
    for number, name in enumerate(("a", "b")):
        reading = state.rollers[name]
        share = abs(reading.drag) / (0.3 * reading.normal_force)
        assert reading.surface_speed == pytest.approx(SPEED, abs=2e-3 * np.arctanh(share) + 1e-3)
        travel = state.full[run.assembly.strip.unknowns + number]
        assert travel == pytest.approx(SPEED * 0.05 + SPEED * 0.1, rel=0.01)


def test_an_idler_neither_pulls_nor_brakes() -> None:
    travel, before = 0.0, None
    for step in turned({"drive": "idle"}, {"drive": "idle"}).run():
        state = step.state
        travel += 0.0 if before is None else state.surface_travel("a", before)
        before = state
    assert travel == pytest.approx(SPEED * 0.15, rel=0.01)
    for reading in state.rollers.values():
        assert abs(reading.torque) < 0.01
        assert reading.tension_in == pytest.approx(reading.tension_out, rel=1e-3)
        assert reading.surface_speed == pytest.approx(SPEED, rel=5e-3)


@pytest.mark.parametrize(
    ("tables", "stage", "key"),
    [
        ({"drive": "idle"}, {"surface_speed": 1.0}, "stages.hold.rollers.a.surface_speed"),
        ({"drive": "idle"}, {"torque": 1.0}, "stages.hold.rollers.a.torque"),
        ({"drive": "torque"}, {"angular_speed": 1.0}, "stages.hold.rollers.a.angular_speed"),
        ({}, {"torque": 1.0}, "stages.hold.rollers.a.torque"),
        ({"bearing": 1.0}, {}, "rollers.a.bearing"),
        ({}, {"surface_speed": 1.0, "angular_speed": 1.0}, "stages.hold.rollers.a.angular_speed"),
    ],
)
def test_controls_that_a_drive_does_not_have(
    tables: dict[str, Any], stage: dict[str, Any], key: str
) -> None:
    with pytest.raises(ValidationError) as error:
        turned(tables, {}, a=stage)
    assert key.rpartition(".")[2] in str(error.value)


def test_explain_names_the_drives() -> None:
    text = explain(turned({"drive": "idle"}, {"drive": "torque"}))
    assert "clockwise, idle" in text
    assert "anticlockwise, torque" in text


def test_what_turns_needs_friction() -> None:
    line = deepcopy(LINE)
    line["rollers"][0]["drive"] = "idle"
    del line["friction"]
    with pytest.raises(ValidationError, match="nothing turns the roller"):
        scene_of(line)


def fed() -> Scene:
    """Strip without end over an idler, to a roller that drives it; the entry is let go."""
    line = deepcopy(LINE)
    line["strip"] |= {"feed": True, "refined": 0.05, "cells": (30, 2)}
    line["rollers"][0] |= {"drive": "idle", "bearing": 10.0}
    line["stages"][1] = {
        "name": "start", "duration": 0.1, "entry": {"release": True},
        "rollers": {"b": {"surface_speed": 0.8}},
    }  # fmt: skip
    return scene_of(line)


def test_a_fed_line_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    """What passes goes on: 0.12 m."""
    *_, last = fed().run()
    steps = iter(fed().run(tmp_path))
    while next(steps).stage != "run":
        pass
    steps.close()  # type: ignore[attr-defined]
    again = fed().run(tmp_path, resume=True)
    *_, end = again
    assert again.march.conveyed == pytest.approx(0.12, rel=2e-3)
    np.testing.assert_array_equal(end.state.full, last.state.full)
    assert end.tangents == last.tangents
    assert end.state.rollers["a"].torque == pytest.approx(-10.0, rel=1e-3)


def test_a_line_that_runs_loose_is_told_and_the_advice_holds_it() -> None:
    """Without it any speed is in equilibrium; with it the strip rests."""
    line = deepcopy(LINE)
    for table in line["rollers"]:
        table["drive"] = "idle"
    line["stages"][1] = {"name": "start", "duration": 0.1, "entry": {"release": True}}
    told = serious(Preview.of(Assembly(scene_of(line))))
    (found,) = [words for words in told if "how fast the strip runs in stage start" in words]
    key, _, value = found.partition("--set ")[2].partition("=")
    assert key == "rollers.a.bearing"
    line["rollers"][0]["bearing"] = float(value)
    scene = scene_of(line)
    assert not [words for words in serious(Preview.of(Assembly(scene))) if "how fast" in words]
    _, state = ended(scene)
    assert abs(state.rollers["a"].surface_speed) < 1e-3


def test_events_see_the_speed_of_a_free_roller() -> None:
    """An idler takes up the strip's speed: its points slip by much less than that.

    Each event is dated within the step in time in which it was found, and to no less than its
    length where it concerns a single point.
    """
    line = deepcopy(LINE)
    line["rollers"][0]["drive"] = "idle"
    line["output"] = {"events": True}
    steps = list(scene_of(line).run())
    found = [e for step in steps for e in step.events if e.roller == "a" and e.slip is not None]
    assert found
    for before, step in pairwise(steps):
        begin, end = before.state.time, step.state.time
        for event in step.events if step.state.plan.in_time else ():
            assert event.step <= (end - begin) * (1.0 + 1e-9)
            assert begin <= event.time <= end
        if step.state.plan.in_time and not any(event.point is None for event in step.events):
            lengths = [event.step for event in step.events]
            assert lengths == pytest.approx([end - begin] * len(lengths), rel=1e-9)
    assert any(e.step is not None for e in found)
    assert max(e.slip for e in found) < 0.1 * SPEED


def test_a_roller_that_nothing_touches_rests_in_a_steady_line() -> None:
    """Its bearing brakes nothing; that of the other takes 100 N m over 0.2 m and 1 m."""
    idle = {"radius": 0.2, "drive": "idle", "wrap": "over"}
    rollers = [
        {**idle, "name": "turned", "centre": [0.0, 0.0, -0.2], "bearing": 100.0},
        {"name": "stand_by", "radius": 0.06, "centre": [-0.5, 0.0, 0.1], "drive": "idle",
         "bearing": 3.0},
    ]  # fmt: skip
    tables = {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": 5e-4},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {},
        "friction": {"coefficient": 0.3},
        "threading": {"tension": 4e3, "entry": [-1.0, 0.0, 0.0], "exit": [0.2, 0.0, -1.0]},
        "rollers": rollers,
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [
            {"name": "run", "steady": True, "strip": {"speed": 1.0}, "exit": {"tension": 4e3}}
        ],
        "solver": {"max_tangents": 20},
    }
    *_, last = Scene.from_tables(tables, "line.toml").run()
    reading = last.state.rollers
    assert last.state.tension("entry") == pytest.approx(3500.0, rel=1e-3)
    assert reading["stand_by"].surface_speed == 0.0
    assert reading["turned"].surface_speed == pytest.approx(1.0, rel=1e-3)
