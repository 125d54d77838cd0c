"""Events of a run: a roller that comes, rubs and goes again, dated by the series of the steps."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.mechanics.laws import corner_speed
from anmstrip.results import files as history
from anmstrip.results.events import Event, without_flickers

LIFTED = {
    "strip": {"length": 2.0, "width": 1.0, "thickness": 1e-3, "cells": [8, 2],
              "refined": 0.05, "kinematics": "section"},
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {"stiffness": 1e10, "eta": 10.0, "delta": 1e-3},
    "rollers": [{"name": "r", "radius": 0.5, "centre": [0.0, 0.0, -0.52]}],
    "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
    "stages": [
        {"name": "pull", "duration": 1.0, "friction": False, "exit": {"force": [1e4, 0.0, 0.0]}},
        {"name": "up", "duration": 1.0, "friction": False,
         "rollers": {"r": {"move": [0.0, 0.0, 0.1]}}},
        {"name": "down", "duration": 1.0, "friction": False,
         "rollers": {"r": {"move": [0.0, 0.0, 0.0]}}},
    ],
    "output": {"events": True},
    "solver": {"tolerance": 1e-6},
}  # fmt: skip
"""A roller rises by 100 mm under a strip that lies 20 mm above it, and sinks back."""


def scene(**changes: Any) -> Scene:
    return Scene.model_validate({**LIFTED, **changes})


@pytest.fixture(scope="module")
def lifted(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Event], list[Any], Path]:
    """Events, and before and after every step."""
    directory = tmp_path_factory.mktemp("lifted")
    run = scene().run(directory)
    steps = list(run)
    assert run.outcome.done, run.message
    return [event for step in steps for event in step.events], steps, directory


def test_the_roller_touches_and_leaves_when_it_must(lifted: Any) -> None:
    """It rises and sinks at 0.1 m/s through the plane at 20 mm: at 1.2 s and at 2.8 s.

    A tenth of T/r on the first point alone takes a lift by 1.6 mm; the way down is that up.
    """
    events, _, _ = lifted
    whole = [event for event in events if event.point is None]
    assert [(event.stage, event.kind) for event in whole] == [
        ("up", "contact made"),
        ("down", "contact lost"),
    ]
    assert [event.time for event in whole] == pytest.approx([1.2, 2.8], abs=0.02)
    assert whole[0].time + whole[1].time == pytest.approx(4.0, abs=2e-5)
    first = next(event for event in events if event.kind == "contact made")
    assert (first.x, first.y) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_every_point_that_touches_leaves_again(lifted: Any) -> None:
    events, _, _ = lifted
    made = Counter(e.point for e in events if e.kind == "contact made" and e.point is not None)
    lost = Counter(e.point for e in events if e.kind == "contact lost" and e.point is not None)
    assert len(made) >= 2
    assert made == lost


def test_dates_are_roots_of_the_states(lifted: Any) -> None:
    """At its date the gap of the state, computed anew, is that of the event."""
    events, steps, _ = lifted
    checked = 0
    for before, step in pairwise(steps):
        for event in step.events:
            if event.point is None:
                continue
            state = step.state.at(event.time, before.state).contacts["r"]
            assert state.gap[event.point] == pytest.approx(event.gap, abs=1e-12)
            assert event.step is None  # along paths, whose polynomials are the solution
            checked += 1
    assert checked >= 4
    assert sorted(event.time for event in events) == [event.time for event in events]


def test_the_table(lifted: Any) -> None:
    events, _, directory = lifted
    table = history.read_history(directory / "events.csv")
    assert list(table["time"]) == [event.time for event in events]
    assert list(table["kind"]) == [event.kind for event in events]
    assert np.isnan(np.asarray(table["point"])[[e.point is None for e in events]]).all()


def test_resumed_runs_have_the_same_table(lifted: Any, tmp_path: Path) -> None:
    events, _, whole = lifted
    run = scene().run(tmp_path)
    for step in run:
        if step.stage == "down" and step.events:
            run.interrupted()
            break
    for _ in scene().run(tmp_path, resume=True):
        pass
    assert (tmp_path / "events.csv").read_text() == (whole / "events.csv").read_text()
    assert len(events) >= 6


def threaded() -> str:
    """A strip pulled over a roller that it is threaded around."""
    strip = {"kinematics": "section", "width": 1.0, "thickness": 1e-3}
    threading = {"tension": 1e4, "entry": [-2.0, 0.0, 0.0], "exit": [0.5, 0.0, -2.0]}
    tables = {
        "strip": strip,
        "material": {"young": 2e11, "poisson": 0.3},
        "threading": threading,
        "rollers": [{"radius": 0.5, "centre": [0.0, 0.0, -0.5], "wrap": "over"}],
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [{"duration": 1.0, "friction": False}],
    }
    return json.dumps(tables)


@pytest.mark.parametrize("laid", [False, True])
def test_without_events_nothing_is_imported_or_written(tmp_path: Path, laid: bool) -> None:
    code = (
        "import sys, json\nfrom anmstrip import Scene\n"
        "scene = Scene.model_validate(json.loads(sys.argv[1]))\n"
        "assert all(not step.events for step in scene.run(sys.argv[2]))\n"
        "found = [name for name in sys.modules if name.startswith('anmstrip.')]\n"
        "assert not [name for name in found if name.endswith(('.events', '.stretch'))]\n"
        "unused = ('spatial', 'optimize', 'integrate', 'interpolate', 'special')\n"
        "assert not {'scipy.' + name for name in unused} & set(sys.modules)\n"
    )
    flat = scene(stages=LIFTED["stages"][:1], output={}).model_dump_json(exclude_none=True)
    short = threaded() if laid else flat
    subprocess.run([sys.executable, "-c", code, short, str(tmp_path)], check=True)
    assert not (tmp_path / "events.csv").exists()


RUBBED = {
    "friction": {"law": "norton-hoff", "coefficient": 0.3, "speed": 1e-3},
    "stages": [
        *LIFTED["stages"][:2],
        {"name": "rest", "duration": 1.0},
        {"name": "turn", "duration": 1.0, "rollers": {"r": {"surface_speed": 0.1}}},
        {"name": "stop", "duration": 1.0, "rollers": {"r": {"surface_speed": 0.0}}},
        {"name": "hold", "duration": 0.2},
    ],
    "solver": {"tolerance": 1e-4},
}  # fmt: skip


def test_stick_and_slip() -> None:
    """All points stick, slip when the roller turns under the held strip, and stick again."""
    run = Run(scene(**RUBBED))
    steps = list(run)
    assert run.outcome.done, run.message
    events = [event for step in steps for event in step.events]
    whole = [(e.stage, e.kind) for e in events if e.point is None]
    assert whole[0] == ("up", "contact made")
    assert ("turn", "slip") in whole
    assert whole[-1][1] == "stick"
    stuck = [e.time for e in events if e.point is None][-1]
    assert stuck == pytest.approx(5.0006, abs=2e-3)  # the roller comes to rest at 5 s
    assert not [e for e in events if e.stage == "rest" and e.kind == "slip"]
    corner = run.watch.speeds[0]
    rubbed = [e for e in events if e.kind in ("stick", "slip") and e.point is not None]
    assert [e.kind for e in rubbed] == ["slip", "stick"]  # one point bears all of the load
    assert rubbed[0].time == pytest.approx(3.00922, abs=1e-4)  # at 1e-6
    assert [e.slip for e in rubbed] == pytest.approx([corner] * len(rubbed), rel=1e-6)
    last = steps[-1].state.contacts["r"]
    assert np.linalg.norm(last.slip, axis=0)[last.touching].max() < corner


def test_a_roller_that_few_points_touch_is_not_dated_with_every_one_that_passes() -> None:
    """It slips and sticks as they pass: dated, these took 27 of 28 tangents."""
    tables = {
        "strip": {"kinematics": "section", "length": 4.0, "width": 0.5, "thickness": 5e-4},
        "material": {"young": 2e11, "poisson": 0.3},
        "friction": {"coefficient": 0.3},
        "rollers": [
            {"name": "lift", "radius": 0.2, "centre": [0.0, 0.0, -0.21]},
            {"name": "top", "radius": 0.1, "centre": [1.0, 0.0, 0.2], "drive": "idle",
             "bearing": 1.0},
        ],
        "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
        "stages": [
            {"name": "pull", "friction": False, "duration": 1.0, "exit": {"tension": 5e3}},
            {"name": "lift", "friction": False, "duration": 1.0,
             "rollers": {"lift": {"move": [0.0, 0.0, 0.31]}}},
            {"name": "turn", "duration": 0.15, "rollers": {"lift": {"angular_speed": 2.0}}},
            {"name": "convey", "duration": 0.15, "entry": {"speed": 0.4}},
        ],
    }  # fmt: skip
    tangents, passing = [], 0
    for events in (False, True):
        run = Run(Scene.model_validate({**tables, "output": {"events": events}}))
        for step in run:
            passing += sum(e.roller == "top" and e.point is not None for e in step.events)
        assert run.outcome.done
        tangents.append(run.cost.expansions)
    assert passing > 15
    assert tangents[1] < 2 * tangents[0]


RISING: dict[str, Any] = {
    "strip": {"kinematics": "section", "length": 3.0, "width": 0.8, "thickness": 6e-4},
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {},
    "friction": {"coefficient": 0.25},
    "rollers": [{"name": "r", "radius": 0.2, "centre": [0.0, 0.0, -0.20001]}],
    "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}},
    "stages": [
        {"name": "start", "duration": 0.3, "exit": {"move": [1e-3, 0.0, 0.0]},
         "rollers": {"r": {"move": [0.0, 0.0, 0.02], "surface_speed": 1.0}}},
    ],
    "output": {"events": True},
}  # fmt: skip


@pytest.mark.parametrize("most", [1, 4, 12])
def test_the_first_step_that_is_watched_may_have_an_event_of_a_roller(
    most: int, tmp_path: Path
) -> None:
    """A run that goes on from its files looks at its points anew, and halves that step, too."""
    rising = Scene.model_validate(RISING)
    list(rising.run(tmp_path / "whole"))
    few = Scene.from_tables(RISING, "rising.toml", [f"solver.max_steps={most}"])
    list(few.run(tmp_path / "broken"))
    list(rising.run(tmp_path / "broken", resume=True))
    whole, broken = ((tmp_path / n / "events.csv").read_text() for n in ("whole", "broken"))
    assert whole == broken and whole.count("\n") > 2


def test_a_first_step_of_fixed_length_is_halved_for_its_events() -> None:
    run = Scene.from_tables(RISING, "rising.toml", ["solver.time_step=0.1"]).run()
    events = [event for step in run for event in step.events]
    assert run.outcome.done and any(event.point is None for event in events)


def test_what_a_roller_is_again_at_the_end_of_a_long_step_is_not_told() -> None:
    """A polynomial of 0.17 s had a roller under 900 N lose the strip, and touch it again."""
    kinds = ("slip", "contact lost", "contact made", "stick", "contact lost")
    whole = [Event(0.1 * k, "run", kind, "b") for k, kind in enumerate(kinds)]
    point = Event(0.15, "run", "slip", "b", point=3)
    assert without_flickers([*whole[:4], point]) == (point,)
    assert without_flickers([whole[0], point, *whole[1:]]) == (point, whole[4])
    other = replace(whole[1], roller="a")
    assert without_flickers([*whole[:4], other]) == (other,)


LOOPER = {
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 5e-4},
    "material": {"young": 2e11, "poisson": 0.3},
    "friction": {"coefficient": 0.3},
    "threading": {"tension": 8e3, "entry": [-1.0, 0.0, 0.2], "exit": [1.6, 0.0, 0.2]},
    "rollers": [
        {"name": "in", "radius": 0.2, "centre": [0.0, 0.0, 0.0], "wrap": "over"},
        {"name": "looper", "radius": 0.2, "centre": [0.6, 0.0, -1.0], "wrap": "under",
         "drive": "idle"},
    ],
    "stages": [
        {"name": "start", "duration": 0.5, "entry": {"release": True},
         "rollers": {"in": {"surface_speed": 1.0}}},
        {"name": "loop", "duration": 1.0, "rollers": {"looper": {"move": [0.0, 0.0, 0.1]}}},
    ],
    "output": {"events": True},
}  # fmt: skip


def test_nothing_slips_because_a_roller_begins_to_move() -> None:
    """The velocity jumps there, and is not in between in the first step."""
    run = Scene.from_tables(LOOPER, "looper.toml").run()
    slips = [e for step in run if step.stage == "loop" for e in step.events if e.kind == "slip"]
    assert run.outcome.done and not slips
    looping = np.array(run.history["stage"]) == "loop"
    corner = corner_speed(run.assembly.friction)
    assert max(run.history[f"{name}_max_slip"][looping].max() for name in ("in", "looper")) < corner
