"""How the controls of a stage move what is held."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from threaded import ONE, scene_of

from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import StageProblem
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course


def plans(*stages: dict[str, Any], friction: bool = True) -> list[StageProblem]:
    """The stages of a section that is held at its entry, over a roller far below."""
    tables: dict[str, Any] = {
        "strip": {
            "kinematics": "section", "length": 2.0, "width": 1.0, "thickness": 1e-3,
            "cells": [4, 1],
        },
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3},
        "friction": {"coefficient": 0.3, "speed": 1e-3},
        "rollers": [{"name": "r1", "radius": 0.5, "centre": [0.0, 0.0, -2.0]}],
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [{"friction": friction, **stage} for stage in stages],
    }  # fmt: skip
    scene = Scene.model_validate(tables)
    course, found = Course(Assembly(scene)), []
    for stage in scene.course:
        found.append(course.plan(stage, {}))
        course.finish(stage)
    return found


def entry(plan: StageProblem, control: float) -> tuple[float, float]:
    """Displacement and velocity of the entry along x."""
    strip = plan.model.strip
    place = 2 * strip.edges["entry"].values[0]
    zero = np.zeros(len(plan.supports.free))
    return plan.supports.full(zero, control)[place], plan.moving(control)[place]


def test_a_velocity_is_reached_linearly_and_kept() -> None:
    """0 to 0.4 m/s over 2 s, then a stage that does not name it, then to rest."""
    first, second, third = plans(
        {"duration": 2.0, "entry": {"velocity": [0.4, 0.0, 0.0]}},
        {"duration": 1.0},
        {"duration": 4.0, "entry": {"velocity": [0.0, 0.0, 0.0]}},
    )
    for share in (0.0, 0.25, 1.0):
        t = 2.0 * share
        assert entry(first, share) == pytest.approx((0.1 * t * t, 0.2 * t), abs=1e-15)
        assert entry(second, share) == pytest.approx((0.4 + 0.4 * share, 0.4))
    assert entry(third, 0.0) == pytest.approx((0.8, 0.4))
    assert entry(third, 0.5) == pytest.approx((0.8 + 0.4 * 2.0 - 0.1 * 2.0, 0.2))
    assert entry(third, 1.0) == pytest.approx((1.6, 0.0))
    assert second.continues(first)
    assert third.continues(second)


def test_a_move_ends_a_velocity() -> None:
    _, second, third = plans(
        {"duration": 1.0, "entry": {"velocity": [0.4, 0.0, 0.0]}},
        {"duration": 1.0, "entry": {"move": [0.5, 0.0, 0.0]}},
        {"duration": 1.0},
    )
    assert entry(second, 0.5) == pytest.approx((0.35, 0.3))
    assert entry(third, 1.0) == pytest.approx((0.5, 0.0))
    assert not third.continues(second)


def test_without_friction_the_way_is_straight() -> None:
    (plan,) = plans({"duration": 2.0, "entry": {"velocity": [0.4, 0.0, 0.0]}}, friction=False)
    assert entry(plan, 0.5)[0] == pytest.approx(0.2)
    assert entry(plan, 1.0)[0] == pytest.approx(0.4)


def test_what_jumps_begins_anew() -> None:
    """A roller that starts to move, an edge that is let go."""
    first, second, third = plans(
        {"duration": 1.0},
        {"duration": 1.0, "rollers": {"r1": {"move": [0.0, 0.0, 0.1]}}},
        {"duration": 1.0, "entry": {"release": True}},
    )
    assert not second.continues(first)
    assert not third.continues(second)


def test_a_stage_is_still_if_nothing_is_asked_to_move() -> None:
    """Not while an edge or a surface is brought to a speed, keeps it, or is stopped."""
    speeds = [{"rollers": {"r1": {"surface_speed": speed}}} for speed in (0.2, 0.0)]
    edge = [{"entry": {"velocity": [speed, 0.0, 0.0]}} for speed in (0.4, 0.0)]
    load = {"exit": {"force": [1e3, 0.0, 0.0]}}
    course = [{}, speeds[0], {}, speeds[1], {}, edge[0], {}, edge[1], {}, load, {}]
    found = [plan.still for plan in plans(*({"duration": 1.0, **stage} for stage in course))]
    assert found == [stage == {} and i in (0, 4, 8, 10) for i, stage in enumerate(course)]


@pytest.mark.parametrize(
    ("begin", "others", "back", "ahead"),
    [
        ({"entry": {"velocity": [-0.4, 0.0, 0.0]}}, {}, 0.1, 0.0),
        ({"exit": {"velocity": [0.3, 0.0, 0.4]}}, {"exit": {"fixed": ["x", "z"]}}, 0.0, 0.125),
        ({"rollers": {"a": {"surface_speed": 0.4}}}, {}, 0.0, 0.0),
        ({"entry": {"release": True}, "rollers": {"a": {"surface_speed": 0.4}}}, {}, 0.0, 0.1),
    ],
)
def test_mesh_is_fine_where_strip_comes_to_lie_on_a_roller(
    begin: dict[str, Any], others: dict[str, Any], back: float, ahead: float
) -> None:
    """It goes with the edges that are held, else with the rollers; 0.1 s to come to speed."""
    tables = {
        "rollers": [{**ONE["rollers"][0], "centre": (0.2, 0.0, -0.5)}],
        "edges": {"entry": {"fixed": ["x", "z"]}, **others},
        "friction": {"coefficient": 0.3, "speed": 1e-3},
        "strip": {"cells": [16, 1], "refined": 0.025, "feed": False},
    }
    rest, moved = (
        Assembly(scene_of({**ONE, **tables, "stages": stages}))
        for stages in ([{"duration": 0.3}], [{"duration": 0.1, **begin}, {"duration": 0.2}])
    )
    (lo, hi), (low, high) = (_fine_stretch(each) for each in (rest, moved))
    assert lo - low == pytest.approx(ahead, abs=1e-9)
    assert high - hi == pytest.approx(back, abs=1e-9)


def _fine_stretch(assembly: Assembly) -> tuple[float, float]:
    """Where the finest elements of a strip begin and end."""
    x = np.unique(assembly.strip.nodes[0])
    fine = np.flatnonzero(np.diff(x) < 0.03)
    return float(x[fine[0]]), float(x[fine[-1] + 1])


@pytest.mark.parametrize("pull", [0.0, 100.0])
def test_a_released_end_keeps_what_was_pulled_and_not_what_friction_made_of_it(pull: float) -> None:
    """A sheet settles on its rollers; where nothing pulls, they carry it free of forces."""
    tables = {
        "strip": {"kinematics": "section", "length": 0.8, "width": 1.0, "thickness": 2e-3},
        "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
        "friction": {"coefficient": 0.3},
        "rollers": [
            {"name": f"r{k}", "radius": 0.1, "centre": [0.3 * k - 0.3, 0.0, -0.1]} for k in range(4)
        ],
        "edges": {"entry": {"fixed": ["x"]}},
        "stages": [
            {"name": "settle", "duration": 1.0, "gravity": [0.0, 0.0, -9.81],
             "exit": {"force": [pull, 0.0, 0.0]}},
            {"name": "carry", "duration": 0.2, "entry": {"release": True},
             "rollers": {f"r{k}": {"surface_speed": 0.5} for k in range(4)}},
        ],
    }  # fmt: skip
    if not pull:
        del tables["stages"][0]["exit"]
    run = Scene.model_validate(tables).run()
    ends = {step.stage: step.state for step in run}
    assert run.outcome.done, run.message
    held, carried = ends["settle"], ends["carry"]
    borne = held.edge_force("entry")[0]
    assert borne < -0.1  # 0.36 N/m by friction alone, as it comes to lie
    kept = carried.controls["entry.force"][0]
    assert kept == (pytest.approx(borne, rel=1e-9) if pull else pytest.approx(0.0, abs=1e-9))
    if not pull:  # else the strip is fed, and its labels stay
        assert carried.along_end("entry", carried.full) == pytest.approx(0.05, abs=1e-5)


def test_middle_of_a_released_edge_keeps_its_y() -> None:
    """After a move of 1 mm aside that bends a strip in its plane; so does what holds it there."""
    scene = Scene.model_validate(
        {
            "strip": {"length": 1.0, "width": 0.2, "thickness": 1e-3, "cells": [6, 2]},
            "material": {"young": 2e11, "poisson": 0.3},
            "edges": {
                "entry": {"fixed": ["x", "y", "z"], "centred": True},
                "exit": {"fixed": ["y", "z"], "centred": True},
            },
            "stages": [
                {"name": "pull", "exit": {"force": [1e3, 0.0, 0.0]}},
                {"name": "move", "exit": {"move": [0.0, 1e-3, 0.0]}},
                {"name": "let_go", "exit": {"release": True}},
            ],
        }
    )
    ends = {step.stage: step.state for step in scene.run()}
    held, free = ends["move"], ends["let_go"]
    strip = held.plan.model.strip
    middle = strip.edges["exit"].nodes[len(strip.edges["exit"].nodes) // 2]
    y = [strip.nodal(state.full)[strip.node_values[middle], 1] for state in (held, free)]
    assert y == pytest.approx([1e-3, 1e-3], rel=1e-9)
    forces = [state.edge_force("exit")[1] for state in (held, free)]
    assert forces[1] == pytest.approx(forces[0], rel=1e-3) and abs(forces[0]) > 100.0


def test_tension_of_an_end_leaves_out_what_holds_it_aside() -> None:
    """A tight strip of which the exit is moved aside by a fiftieth of its width."""
    scene = Scene.model_validate(
        {
            "strip": {"length": 1.0, "width": 0.2, "thickness": 1e-3, "cells": [6, 2]},
            "material": {"young": 2e11, "poisson": 0.3},
            "edges": {name: {"fixed": [*"xyz"][n:]} for n, name in enumerate(("entry", "exit"))},
            "stages": [
                {"name": "pull", "exit": {"force": [1e5, 0.0, 0.0]}},
                {"name": "move", "exit": {"move": [0.0, 4e-3, 0.0]}},
            ],
        }
    )
    *_, last = scene.run()
    state = last.state
    for name, sign in (("entry", -1.0), ("exit", 1.0)):
        force, along = state.edge_force(name), state.plan.model.strip.edge_tangent(name, state.full)
        assert abs(force[1]) > 0.05 * abs(force[0])
        expected = sign * force @ along / np.linalg.norm(along) / 0.2
        assert state.tension(name) == pytest.approx(expected, rel=5e-4)
