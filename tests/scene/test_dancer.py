"""Lines of which rollers move while strip runs: dancers and loopers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

from anmstrip.driver.explain import explain
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.results.wrinkles import free_spans
from claims import Claim

TENSION, SPEED, STROKE, DRAG = 3000.0, 1.0, 0.4, 2.0


def dancer(kinematics: str = "section", **others: Any) -> dict[str, Any]:
    """Three idlers, of which the middle one is lowered while the line runs."""
    idler = {"radius": 0.15, "drive": "idle", "bearing": DRAG}
    places = {
        "top1": (0.0, 0.0, "over"),
        "dancer": (0.3, -1.0, "under"),
        "top2": (0.6, 0.0, "over"),
    }
    scene = {
        "strip": {"kinematics": kinematics, "width": 1.0, "thickness": 3e-4},
        "material": {"young": 2.1e11, "poisson": 0.3, "density": 7850.0},
        "contact": {},
        "friction": {"coefficient": 0.2},
        "threading": {
            "tension": TENSION, "entry": [-2.0, 0.0, 0.15], "exit": [2.6, 0.0, 0.15],
        },
        "rollers": [
            {**idler, "name": name, "centre": [x, 0.0, z], "wrap": wrap}
            for name, (x, z, wrap) in places.items()
        ],
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [
            {"name": "start", "duration": 1.0, "entry": {"speed": SPEED}},
            {"name": "run", "duration": 1.0},
            {"name": "stroke", "duration": 2.0, "rollers": {"dancer": {"move": [0, 0, -STROKE]}}},
            {"name": "after", "duration": 2.0},
        ],
    }  # fmt: skip
    return {**scene, **others}


def ends(scene: dict[str, Any]) -> tuple[Run, dict[str, Any]]:
    """The run, and the last state of every stage."""
    run = Run(Scene.model_validate(scene))
    found = {step.stage: step.state for step in run}
    assert run.outcome.done, run.message
    return run, found


def last_row(run: Run, stage: str) -> dict[str, Any]:
    """The last of a stage in ``history.csv``."""
    (*_, number) = np.flatnonzero(np.array(run.history["stage"]) == stage)
    return {key: column[number] for key, column in run.history.items()}


def test_dancer_is_lowered_while_the_line_runs(claim: Claim) -> None:
    """The way grows by twice the stroke, so that every strand in turn runs slower."""
    run, found = ends(dancer())
    rate = STROKE / 2.0
    for k, (name, reading) in enumerate(found["stroke"].rollers.items()):
        claim(f"{name} (m/s)", reading.surface_speed, SPEED - k * rate, 2e-3, "kinematics")
        assert reading.torque == pytest.approx(-DRAG, rel=1e-2)  # read while the labels move
    for k, (name, reading) in enumerate(found["after"].rollers.items()):
        claim(f"{name} after (m/s)", reading.surface_speed, SPEED, 1e-4, "kinematics")
        before = TENSION - (3 - k) * DRAG / 0.15
        claim(f"{name} T in (N/m)", reading.tension_in, before, 1e-4, "statics")
    assert run.cost.expansions < 80
    feed = run.facts()["feed"]
    left = feed["length"] - feed["taken_up"]
    claim("left at the exit (m)", left, 0.5 + 1.0 + 2.0 * 0.6 + 2.0, 0.003, "kinematics")


def test_dancer_of_a_line_that_is_held_at_its_exit(claim: Claim) -> None:
    """What it takes up comes from the entry then, where the strip runs faster."""
    held = {"fixed": ["x", "z"]}
    stages = dancer()["stages"]
    stages[0] = {
        "name": "start", "duration": 1.0,
        "entry": {"release": True, "tension": TENSION}, "exit": {"speed": SPEED},
    }  # fmt: skip
    stages[3] = {**stages[3], "strip": {"temperature": 100.0}}
    material = {"young": 2.1e11, "poisson": 0.3, "density": 7850.0, "expansion": 1.2e-5}
    given = {"edges": {"entry": held, "exit": held}, "stages": stages, "material": material}
    run, found = ends(dancer(**given))
    rate = STROKE / 2.0
    for k, reading in enumerate(found["stroke"].rollers.values()):
        assert reading.surface_speed == pytest.approx(SPEED + (2 - k) * rate, abs=2e-3)
    row = last_row(run, "stroke")
    assert row["entry_speed"] == pytest.approx(SPEED + 2.0 * rate, rel=2e-3)
    assert row["exit_speed"] == row["strip_speed"] == pytest.approx(SPEED, rel=1e-3)
    row = last_row(run, "after")  # leaves warm, and gives α ΔT of itself off, at the entry
    strain, stretch = 1.2e-5 * 100.0, TENSION / 2.1e11 / 3e-4
    left = SPEED / (1.0 + strain) / (1.0 + stretch)
    claim("exit, warm (m/s)", row["exit_speed"], left, 1e-5, "kinematics")
    assert row["strip_speed"] == row["exit_speed"]
    length = found["after"].unstressed_length(found["after"].plan.model.strip.span[1])
    given_off = strain * length / 2.0
    claim("entry, warm (m/s)", row["entry_speed"], left - given_off, 1e-4, "kinematics")
    assert run.cost.expansions < 80


def test_what_is_read_along_strip_that_runs_hold() -> None:
    """Tension is even between rollers, and arc length counts unstressed strip."""
    run, found = ends(dancer())
    state = found["stroke"]
    x, z, length, tension = (state.along(n) for n in ("x", "z", "arc_length", "tension"))
    steps = np.hypot(np.diff(x), np.diff(z))
    free = (np.abs(x - 0.15) < 0.01) & (z > -1.2) & (z < -0.2)
    assert tension[free] == pytest.approx(TENSION - 2.0 * DRAG / 0.15, rel=1e-3)
    stretch = steps.sum() / length[-1] - 1.0
    assert stretch == pytest.approx(TENSION / 2.1e11 / 3e-4, rel=0.2)
    places = state.material_velocity[
        state.plan.model.strip.unknowns_of(state.plan.model.strip.node_values)
    ].reshape(-1, 2)
    speeds = np.hypot(*places.T)
    rate = STROKE / 2.0
    assert speeds[0] == pytest.approx(SPEED, rel=1e-3)
    assert speeds[-1] == pytest.approx(SPEED - 2.0 * rate, rel=1e-3)
    row = last_row(run, "stroke")
    unstressed = speeds[[0, -1]] / (1.0 + TENSION / 2.1e11 / 3e-4)
    assert [row["entry_speed"], row["exit_speed"]] == pytest.approx(unstressed, rel=1e-5)


@pytest.mark.slow
def test_labels_that_are_carried_along_come_to_the_same() -> None:
    """The same line with labels that are material, and so with all of the strip that passes."""
    stages = [
        {"name": "down", "duration": 1.0, "rollers": {"dancer": {"move": [0.0, 0.0, -0.02]}}},
        {"name": "rest", "duration": 1.0},
    ]
    scene = dancer(stages=stages)
    _, fed = ends(scene)
    _, carried = ends({**scene, "strip": {**scene["strip"], "feed": False}})
    for name, reading in carried["rest"].rollers.items():
        own = fed["rest"].rollers[name]
        assert own.tension_in == pytest.approx(reading.tension_in, rel=1e-3)
        assert own.wrap == pytest.approx(reading.wrap, rel=5e-3)


def test_weight_of_what_runs_hold_counts() -> None:
    """Tension falls by ρ g t per height, also where labels hold half as much again."""
    gravity = {"name": "weigh", "friction": False, "gravity": [0.0, 0.0, -9.81]}
    _, found = ends(dancer(stages=[gravity, *dancer()["stages"]]))
    rollers = found["after"].rollers
    low, high = rollers["dancer"].tension_in, rollers["top1"].tension_out
    assert high - low == pytest.approx(7850.0 * 3e-4 * 9.81 * (1.0 + STROKE), rel=0.02)


def test_shapes_hold_what_the_way_grows_by() -> None:
    run = Run(Scene.model_validate(dancer()))
    assert "The mesh follows rollers that move" in explain(run.scene)
    growth = run.assembly.growth
    assert growth is not None
    centres = {r.name: np.array(r.centre) for r in growth.thread.rollers}
    still = np.zeros(len(centres) + 1)
    assert growth.held(centres, still) == pytest.approx(still, abs=1e-12)
    centres["dancer"] = centres["dancer"] - np.array([0.0, 0.0, STROKE])
    held = growth.held(centres, still)
    x = np.linspace(growth.x[0], growth.x[-1], 200_001)
    g = growth.at(x, held)
    assert trapezoid(g - 1.0, x) == pytest.approx(held.sum(), rel=1e-6)
    assert growth.up_to(x[-1], held) == pytest.approx(held.sum(), rel=1e-12)
    middle = 0.5 * sum(growth.thread.arcs["dancer"])
    until = x <= middle
    expected = trapezoid(g[until] - 1.0, x[until])
    assert growth.up_to(np.array(middle), held) == pytest.approx(expected, rel=1e-4)
    for first, last in growth.thread.arcs.values():
        assert growth.at(np.linspace(first, last, 9), held) == pytest.approx(1.0, abs=1e-12)
    centres["dancer"] = centres["dancer"] + np.array([0.0, 0.0, 50.0])
    assert np.array_equal(growth.held(centres, held), held)


def test_a_span_that_has_grown_wrinkles_as_one_of_its_length() -> None:
    down = {"name": "down", "duration": 1.0, "friction": False}
    scene = dancer("shell", stages=[{**down, "rollers": {"dancer": {"move": [0, 0, -STROKE]}}}])
    _, found = ends({**scene, "strip": {**scene["strip"], "cells": (48, 2)}})
    spans = [list(free_spans(found[stage])) for stage in ("threading", "down")]
    for before, after in zip(*spans, strict=True):
        length = before.end - before.start
        assert after.end - after.start == pytest.approx(length, rel=2e-3)  # of its labels
        grown = length + STROKE * ("dancer" in (before.before, before.after))
        for span, long in ((before, length), (after, grown)):
            q, d = np.pi / long, 2.1e11 * 3e-4**3 / 12.0 / 0.91
            expected = 2.0 * q * np.sqrt(d * (d * q**2 + TENSION)) + 2.0 * d * q**2
            assert span.bearable == pytest.approx(expected, rel=5e-3)


def stationary(height: float, move: float) -> tuple[Run, Any]:
    """The line between two drives, with the dancer drawn at a height and moved from there."""
    given = {"top1": {"surface_speed": SPEED}, "top2": {"surface_speed": SPEED}}
    moved = {"dancer": {"move": [0.0, 0.0, move]}} if move else {}
    entry = {"tension": TENSION}
    scene = dancer(
        stages=[{"name": "run", "steady": True, "entry": entry, "rollers": {**given, **moved}}]
    )
    for roller in scene["rollers"]:
        if roller["name"] != "dancer":
            roller["drive"] = "speed"
            del roller["bearing"]
        else:
            roller["centre"] = [0.3, 0.0, height]
    run, found = ends(scene)
    return run, found["run"].rollers["dancer"]


@pytest.mark.slow
def test_dancer_that_comes_so_near_that_labels_leave_their_rollers() -> None:
    """Where labels hold less strip than they did, as much less of it passes them."""
    _, reading = stationary(-1.0, 0.9)
    assert reading.surface_speed == pytest.approx(SPEED, rel=1e-3)
    assert reading.max_slip < 1e-3 * SPEED


def test_carriage_that_goes_twenty_times_as_far_as_it_was_drawn() -> None:
    """It pulls as where it is drawn there."""
    run, moved = stationary(-0.4, -6.0)
    _, drawn = stationary(-6.4, 0.0)
    for side in ("tension_in", "tension_out", "normal_force"):
        assert getattr(moved, side) == pytest.approx(getattr(drawn, side), rel=2e-3)
    assert run.cost.expansions <= 40


def test_a_steady_line_keeps_the_tension_of_its_entry_through_a_stroke() -> None:
    """Strip slides into place as a roller has moved, and is then pulled as before: 80 N m."""
    tables = {
        "strip": {"kinematics": "section", "width": 0.8, "thickness": 4e-4},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {},
        "friction": {"coefficient": 0.3},
        "threading": {"tension": 5e3, "entry": [-1.0, 0.0, -0.6], "exit": [3.0, 0.0, -0.6]},
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "rollers": [
            {"name": "a", "radius": 0.2, "centre": [0.0, 0.0, -0.2], "wrap": "over"},
            {"name": "m", "radius": 0.2, "centre": [1.0, 0.0, -0.4], "wrap": "under",
             "drive": "idle"},
        ],
        "stages": [
            {"name": "run", "steady": True, "entry": {"tension": 5e3}, "exit": {"tension": 5.5e3},
             "rollers": {"a": {"surface_speed": 1.0}}},
            {"name": "stroke", "duration": 1.0, "rollers": {"m": {"move": [0.0, 0.0, -0.2]}}},
            {"name": "again", "steady": True},
        ],
    }  # fmt: skip
    run = Scene.from_tables(tables, "stroke.toml").run()
    *_, last = run
    assert run.outcome.done, run.message
    assert last.state.tension("entry") == pytest.approx(5e3, rel=1e-3)
    assert last.state.tension("exit") == pytest.approx(5.5e3, rel=1e-6)
    assert last.state.rollers["a"].torque == pytest.approx(-80.0, rel=1e-2)


@pytest.mark.parametrize(
    ("wrap", "thickness", "tension"),
    [("under", 1e-4, 4e3), (None, 1e-4, 4e3), ("under", 2e-3, 2e4)],
)
def test_ends_of_strip_that_a_roller_is_moved_into_go_as_the_last_roller(
    wrap: str | None, thickness: float, tension: float, claim: Claim
) -> None:
    """The roller before the exit sticks: its surface passes as much strip as leaves.

    What enters and does not leave is taken up, by a string on three rollers 0.3 m apart; stiff
    strip takes up less, so that its exit sways.
    """
    names = {"l1": (0.0, -0.1, "over"), "u": (0.3, 0.1, wrap), "l2": (0.6, -0.1, "over")}
    tables = {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": thickness},
        "material": {"young": 2.1e11, "poisson": 0.3},
        "friction": {"coefficient": 0.2},
        "threading": {"tension": tension, "entry": [-1.0, 0.0, 0.0], "exit": [1.6, 0.0, 0.0]},
        "rollers": [
            {"name": name, "radius": 0.1, "centre": [x, 0.0, z], "drive": "idle"}
            | ({} if side is None else {"wrap": side})
            for name, (x, z, side) in names.items()
        ],
        "stages": [
            {"name": "start", "duration": 1.0, "entry": {"speed": 0.5}},
            {"name": "in", "duration": 2.0, "rollers": {"u": {"move": [0.0, 0.0, -0.02]}}},
        ],
    }
    run = Scene.from_tables(tables, "in.toml").run()
    for _ in run:
        pass
    history = {name: np.array(column) for name, column in run.history.items()}
    moving = history["stage"] == "in"
    rolling = 2e-5 if thickness < 1e-3 else 2e-4  # the line on which stiff strip rolls off moves
    for speed, at in ((history["exit_speed"], "l2"), (history["entry_speed"], "l1")):
        stretched = speed[moving] * (1.0 + tension / 2.1e11 / thickness)
        assert stretched == pytest.approx(history[f"{at}_surface_speed"][moving], rel=rolling)
    gone = history["entry_speed"] - history["exit_speed"]
    between = np.trapezoid(gone[moving], history["time"][moving])
    taken = run.facts()["feed"]["taken_up"]
    told = f"taken up by {thickness:g} m of strip on a roller with wrap {wrap} (m)"
    claim(told, taken, between, 0.01, "speeds of the ends")
    angle = np.arctan(0.02 / 0.3)
    for _ in range(50):  # l cos θ + 2 r sin θ = 0.3, l sin θ + 2 r (1 − cos θ) = 0.02
        run_length = (0.3 - 0.2 * np.sin(angle)) / np.cos(angle)
        angle = np.arcsin((0.02 - 0.2 * (1.0 - np.cos(angle))) / run_length)
    way = 2.0 * (run_length + 0.2 * angle - 0.3)
    if thickness < 1e-3:
        claim(f"{told}, thin", taken, way, 0.02, "a string")


def test_a_roller_without_a_wrap_is_pressed_deep_into_a_run(claim: Claim) -> None:
    """What the run takes up comes past the exit, which stays; it was drawn onto the last roller.

    Nothing takes tension off without friction; the entry had 2723 N/m of 3000.
    """
    radius, half, depth = 0.1, 1.0, 0.6  # below the pass line, between rollers 2 m apart
    tables = {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": 2e-4},
        "material": {"young": 2.1e11, "poisson": 0.3},
        "friction": {"coefficient": 0.2},
        "threading": {"tension": 3e3, "entry": [-0.5, 0.0, 0.0], "exit": [2.3, 0.0, 0.0]},
        "rollers": [
            {"name": name, "radius": radius, "centre": [x, 0.0, z], "drive": "idle"}
            | ({"wrap": "over"} if z < 0.0 else {})
            for name, x, z in (("a", 0.0, -0.1), ("press", 1.0, 0.12), ("b", 2.0, -0.1))
        ],
        "stages": [
            {"name": "press", "friction": False,
             "rollers": {"press": {"move": [0.0, 0.0, -depth - 0.02]}}},
        ],
    }  # fmt: skip
    run = Scene.from_tables(tables, "press.toml").run()
    *_, last = run
    state = last.state
    assert state.tension("entry") == pytest.approx(3e3, abs=0.1)
    for reading in state.rollers.values():
        assert reading.tension_in == pytest.approx(3e3, rel=1e-3)
    # a tangent on the insides of two circles, 2 r apart across its ends
    apart = np.hypot(half, depth - 2.0 * radius)
    angle = np.arctan2(depth - 2.0 * radius, half) + np.arcsin(2.0 * radius / apart)
    way = 2.0 * (np.sqrt(apart**2 - 4.0 * radius**2) + 2.0 * radius * angle - half)
    taken = run.facts()["feed"]["taken_up"]
    claim("taken up by a roller pressed in by 0.6 m (m)", taken, way, 0.002, "a string")
    assert run.cost.expansions < 400
    assert not [words for words in run.warnings if "touched by nothing" in words]
