"""Strip that is fed: material passes labels that stay, against strips that move along whole."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from anmstrip.driver.explain import report
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium
from anmstrip.timestepping.formulas import AffineVelocity

STIFFNESS = 2e8


def tables(**others: Any) -> dict[str, Any]:
    """A section over one roller, pulled back by 10 kN/m, that is driven and released."""
    scene = {
        "strip": {"kinematics": "section", "width": 0.4, "thickness": 1e-3},
        "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
        "contact": {},
        "friction": {"coefficient": 0.3, "speed": 2e-5},
        "threading": {"tension": 1e4, "entry": [-2.0, 0.0, -0.4], "exit": [2.0, 0.0, -0.9]},
        "rollers": [{"name": "r1", "radius": 0.3, "centre": [0.0, 0.0, -0.3], "wrap": "over"}],
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [
            {"name": "start", "duration": 0.1, "rollers": {"r1": {"surface_speed": 1.0}},
             "entry": {"release": True, "tension": 1.2e4}},
            {"name": "convey", "duration": 0.1},
        ],
        "solver": {"tolerance": 1e-5},
    }  # fmt: skip
    return {**scene, **others}


def done(scene: dict[str, Any]) -> Run:
    run = Run(Scene.model_validate(scene))
    for _ in run:
        pass
    assert run.outcome.done, run.message
    return run


def facts(run: Run) -> list[float]:
    """Tensions at the ends, force and torque of the roller, speed of the strip."""
    assert run.state is not None
    reading = run.state.rollers["r1"]
    tensions = [run.state.tension(end) for end in ("entry", "exit")]
    return [*tensions, float(np.linalg.norm(reading.resultant)), reading.torque]


def test_a_threaded_strip_is_fed_unless_its_shape_or_its_ends_speak_against_it() -> None:
    def fed(**others: Any) -> bool:
        return bool(Run(Scene.model_validate(tables(**others))).scene.strip.feed)

    strip = tables()["strip"]
    assert fed()
    assert not fed(strip={**strip, "feed": False})
    moved = {"name": "pull", "duration": 1.0, "entry": {"move": [-0.1, 0.0, 0.0]}}
    assert not fed(stages=[moved])
    shell = {**strip, "kinematics": "shell", "cells": (8, 2)}
    assert not fed(strip={**shell, "imperfection": {"mode": 1, "amplitude": 1e-4}})


def test_strip_that_lies_on_rollers_is_fed_if_both_ends_are_pulled() -> None:
    """A plate that nothing pulls ends where it ends; so does one whose end stays held."""

    def fed(force: float, *, release: bool) -> bool:
        given = tables()
        del given["threading"], given["rollers"][0]["wrap"]
        given["strip"] = {**given["strip"], "length": 4.0}
        pull = {"name": "pull", "duration": 1.0, "friction": False}
        start = {"name": "start", "duration": 0.1, "entry": {"release": release}}
        turning = {"r1": {"surface_speed": 1.0}}
        given["stages"] = [
            pull | {"exit": {"force": [force, 0.0, 0.0]}},
            start | {"rollers": turning},
        ]
        return bool(Run(Scene.model_validate(given)).scene.strip.feed)

    assert fed(1e4, release=True)
    assert not fed(1e4, release=False)
    assert not fed(0.0, release=True)


@pytest.mark.slow
def test_a_fed_strip_does_what_one_does_that_moves_along_whole() -> None:
    """In time, from the start on; the spans behind and ahead of the roller differ by the travel.

    The strip that moves along has points of contact that pass the roller one after another, and a
    mesh that is fine all along what passes: its tensions ripple by some 1e-4.
    """
    fine = {**tables()["strip"], "refined": 0.01, "cells": (100, 1)}
    fed, whole = (done(tables(strip={**fine, "feed": feed})) for feed in (True, False))
    np.testing.assert_allclose(facts(fed), facts(whole), rtol=1e-3)
    assert fed.cost.expansions < 0.3 * whole.cost.expansions


def test_a_metre_over_a_driven_roller_takes_few_tangents() -> None:
    scene = tables(
        stages=[
            {"name": "start", "duration": 0.2, "rollers": {"r1": {"surface_speed": 1.0}},
             "entry": {"release": True}},
            {"name": "run", "duration": 0.9},
        ],
        solver={"tolerance": 1e-3},
    )  # fmt: skip
    run = done(scene)
    assert run.march.conveyed == pytest.approx(1.0, rel=2e-3)  # metres that have passed
    assert run.cost.expansions <= 60


def test_what_passes_is_the_travel_of_the_roller_less_creep_and_stretch() -> None:
    """In the end the strip comes in at c with c λ(T_in) about V within the slip of the law."""
    run = done(tables(stages=[tables()["stages"][0], {"name": "run", "duration": 2.0}]))
    state, told = run.state, run.facts()["feed"]
    assert state is not None and state.strip_speed is not None
    stretch = 1.0 + 1.2e4 / STIFFNESS
    assert state.strip_speed * stretch == pytest.approx(1.0, abs=1e-4)
    assert told["length"] == pytest.approx(0.05 + 2.0, rel=2e-4)
    assert told["mass"] == pytest.approx(7850.0 * 1e-3 * 0.4 * told["length"])
    light = {key: value for key, value in tables()["material"].items() if key != "density"}
    assert Run(Scene.model_validate(tables(material=light))).facts()["feed"]["mass"] is None
    velocity = state.material_velocity.reshape(-1, 2)[run.assembly.strip.node_values]
    np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), 1.0, atol=1e-4)


@pytest.mark.parametrize("end", ["entry", "exit"])
def test_a_held_end_lets_pass_what_it_would_move(end: str) -> None:
    """An end that moves by V along the strip: c times its stretch is V; its label stays."""
    threading = {"tension": 1e4, "entry": [-2.0, 0.0, 0.0], "exit": [2.0, 0.0, -0.6]}
    drawn = Run(Scene.model_validate(tables(threading=threading))).march.course.outward
    along = -drawn["entry"] if end == "entry" else drawn["exit"]
    pull = {
        "name": "pull", "duration": 0.1, end: {"velocity": list(0.5 * along)},
        "rollers": {"r1": {"surface_speed": 0.5}},
    }  # fmt: skip
    if end == "exit":
        pull["entry"] = {"release": True, "tension": 1e4}
    edges = {"entry": {"fixed": ["x", "z"]}, end: {"fixed": ["x", "z"]}}
    stages = [pull, {"name": "run", "duration": 1.0}]
    state = done(tables(threading=threading, stages=stages, edges=edges)).state
    assert state is not None and state.strip_speed is not None
    stretch = 1.0 + state.tension(end) / STIFFNESS
    assert state.strip_speed * stretch == pytest.approx(0.5, rel=1e-5)
    assert state.tension("exit" if end == "entry" else "entry") == pytest.approx(1e4, rel=1e-3)


@pytest.mark.parametrize("feed", [True, False])
def test_a_speed_of_an_end_is_the_velocity_along_the_strip_there(feed: bool) -> None:
    """The entry lies at 55°: the number typed is the size of the vector that was drawn."""
    threading = {"tension": 1e4, "entry": [-1.0, 0.0, -1.0], "exit": [2.0, 0.0, -0.6]}
    drawn = Run(Scene.model_validate(tables(threading=threading)))
    along = -drawn.march.course.outward["entry"]
    assert np.degrees(np.arctan2(along[2], along[0])) == pytest.approx(55.0, abs=10.0)
    ends = []
    for given in ({"speed": 0.5}, {"velocity": list(0.5 * along)}):
        stages = [{"name": "pull", "duration": 0.05, "entry": given}]
        scene = tables(threading=threading, stages=stages)
        scene["strip"]["feed"] = feed
        scene["rollers"][0]["drive"] = "idle"
        run = done(scene)
        assert run.state is not None
        ends.append((run.scene.friction.speed, run.cost.expansions, *run.state.full))
    np.testing.assert_allclose(*ends, rtol=1e-3, atol=5e-5)  # bent beside its end


def test_the_speed_of_an_end_is_along_the_strip_as_it_hangs_there() -> None:
    """A run that sags comes in at 10°, by which its speed was wrong by 1/cos 10°."""
    scene = tables(
        threading={"tension": 400.0, "entry": [-4.0, 0.0, 0.0], "exit": [1.0, 0.0, -0.6]},
        stages=[
            {"name": "weight", "gravity": [0.0, 0.0, -9.81], "friction": False},
            {"name": "start", "duration": 1.0, "entry": {"speed": 1.0}},
            {"name": "run", "duration": 2.0},
        ],
    )
    scene["strip"]["thickness"] = 5e-4
    scene["material"]["density"] = 7850.0
    scene["rollers"] = [
        {"name": "r1", "radius": 0.4, "centre": [0.0, 0.0, -0.4], "wrap": "over", "drive": "idle"}
    ]
    state = done(scene).state
    assert state is not None
    assert state.strip_speed == pytest.approx(1.0, rel=1e-5)
    assert state.rollers["r1"].surface_speed == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize(("angle", "moved"), [(0.0, 0.0), (0.5, 0.0), (10.0, 0.1 * 0.5 * 0.1)])
def test_a_velocity_typed_with_few_digits_is_that_of_the_strip(angle: float, moved: float) -> None:
    """Up to 1° beside the strip it is fed, beyond the end itself moves across it."""
    scene = tables()
    _, direction = Run(Scene.model_validate(scene)).assembly.thread.middle.at(np.zeros(1), 0)
    turn = np.arctan2(direction[1, 0], direction[0, 0]) + np.radians(angle)
    velocity = [0.1 * float(np.cos(turn)), 0.0, 0.1 * float(np.sin(turn))]
    scene["rollers"][0]["drive"] = "idle"
    scene["stages"] = [{"name": "run", "duration": 0.1, "entry": {"velocity": velocity}}]
    run = done(scene)
    strip, state = run.assembly.strip, run.state
    last = strip.nodal(state.full)[strip.edges["entry"].values[0]]
    first = run.assembly.thread.ends_in_space(strip)[0]
    across = np.hypot(*(last - first[[0, 2]]))
    assert across == pytest.approx(moved * np.sin(np.radians(angle)), rel=1e-6, abs=1e-12)


def test_a_fed_strip_goes_on_from_a_stationary_state_without_a_jump() -> None:
    stages = [
        {"name": "steady", "steady": True, "strip": {"speed": 1.0 / (1.0 + 1.1e4 / STIFFNESS)},
         "rollers": {"r1": {"surface_speed": 1.0}}},
        {"name": "run", "duration": 1.0},
    ]  # fmt: skip
    run, tensions = Run(Scene.model_validate(tables(stages=stages))), []
    for step in run:
        if step.stage == "run" or step.state.control == 1.0:
            tensions.append(step.state.tension("entry"))
    assert run.outcome.done, run.message
    np.testing.assert_allclose(tensions[1:], tensions[1], rtol=1e-6)
    assert run.stages["run"]["tangents"] <= 15


def test_the_tangent_is_the_derivative_of_the_residual() -> None:
    """Of friction in its own direction of a strip that is not at rest, and of the passage."""
    run = done(tables(stages=tables()["stages"][:1], solver={"tolerance": 1e-3}))
    march, rng = run.march, np.random.default_rng(0)
    plan = march.course.plan(run.scene.course[-1], {})
    free, rate = plan.supports.free, 30.0
    v = march.velocity[free] + 1e-5 * rng.standard_normal(len(free))
    v[-1] = 1.0
    u = march.full[free]
    velocity = AffineVelocity(rate, v - rate * u, np.zeros_like(u))
    equations = Equilibrium(plan.model, plan.supports, plan.controls, velocity)
    series = equations.recurrence(u, 1.0, 2)
    direction = rng.standard_normal(len(free)) / plan.model.units[free] * 1e-7
    tangent = series.tangent() @ direction
    plus, minus = (equations.residual(u + s * direction, 1.0) for s in (0.5, -0.5))
    scale = np.abs(tangent).max()
    np.testing.assert_allclose(plus - minus, tangent, atol=1e-5 * scale)


def test_heat_along_a_fed_strip_stays_where_it_is_in_space() -> None:
    """What a furnace makes of a line does not change while it runs on: rollers that turn with hot
    strip keep its speed V (1 + α ΔT), and bearings take what they took."""
    heat, torque, speed, tension = 600.0, 20.0, 2.0, 6e3
    along = ((0.0, 0.0), (3.0, 0.0), (5.0, 1.0), (9.0, 1.0), (11.0, 0.2))
    rollers = [
        {"name": name, "radius": 0.3, "centre": centre, "wrap": wrap, "drive": "idle"}
        for name, centre, wrap in (
            ("a", (0.0, 0.0, -0.3), "over"),
            ("b", (3.0, 0.0, -2.0), "under"),
            ("c", (6.0, 0.0, -0.3), "over"),
        )
    ]
    tables = {
        "strip": {
            "kinematics": "section", "width": 1.0, "thickness": 0.5e-3,
            "temperature": {"across": (heat,), "along": along},
        },
        "material": {"young": 2e11, "poisson": 0.3, "expansion": 1.25e-5},
        "contact": {},
        "friction": {"coefficient": 0.25},
        "threading": {
            "tension": tension, "entry": (-3.0, 0.0, 0.0), "exit": (10.0, 0.0, 0.0),
        },
        "edges": {"entry": {"fixed": ("x", "z")}},
        "rollers": [{**roller, "bearing": torque} for roller in rollers],
        "stages": [
            {
                "name": "run", "steady": True, "strip": {"speed": speed},
                "exit": {"tension": tension},
            },
            {"name": "on", "duration": 5.0},
        ],
    }  # fmt: skip
    run = Scene.model_validate(tables).run()
    ends = {step.stage: step.state for step in run}
    for state in (ends["run"], ends["on"]):
        held = tension - 3.0 * torque / 0.3
        assert state.tension("entry") == pytest.approx(held, abs=0.1)
        assert state.rollers["b"].surface_speed == pytest.approx(
            speed * (1.0 + 1.25e-5 * heat), rel=2e-4
        )
    assert run.cost.factorisations < 60


def test_strip_that_slides_as_its_entry_holds_it_is_told_so_and_runs_once_let_go() -> None:
    """A drawing of a line says nothing of how its ends are led."""
    places = {"a": (0.0, -0.3, "over"), "b": (1.0, -0.9, "under")}
    turning = {name: {"surface_speed": 0.5} for name in places}
    line = tables(
        friction={"coefficient": 0.2},
        rollers=[{"name": name, "radius": 0.3, "centre": [x, 0.0, z], "wrap": wrap}
                 for name, (x, z, wrap) in places.items()],
        threading={"tension": 1e4, "entry": [-1.0, 0.0, -0.6], "exit": [2.0, 0.0, -0.4]},
        stages=[{"name": "start", "duration": 2.0, "rollers": turning}],
    )  # fmt: skip
    held = Scene.from_tables(line, "line.toml").run()
    *_, last = held
    told = report(held)
    assert last.state.strip_speed == 0.0 and "slides over all driven rollers" in told
    (setting,) = re.findall(r"Its entry holds it. To let it run, try --set (\S+)", told)
    running = Scene.from_tables(line, "line.toml", [setting]).run()
    *_, last = running
    assert running.outcome.done and last.state.strip_speed == pytest.approx(0.5, rel=1e-3)
    assert "holds it" not in report(running) and "slides over" not in report(running)


def test_a_roller_faster_than_a_led_entry_is_told_what_lets_it_carry_the_strip() -> None:
    """Strip between them is stretched on and on, however small the draw, until it slips."""
    led = {"speed": 1.0}
    line = tables(
        friction={"coefficient": 0.4},
        rollers=[{"name": "a", "radius": 0.3, "centre": [0.0, 0.0, 0.0], "wrap": "over"}],
        threading={"tension": 2e4, "entry": [-2.0, 0.0, 0.3], "exit": [1.0, 0.0, -2.0]},
        stages=[
            {"name": "draw", "duration": 1.0, "entry": led, "exit": {"tension": 4e4},
             "rollers": {"a": {"surface_speed": 1.001}}},
            {"name": "settle", "duration": 10.0},
        ],
    )  # fmt: skip
    drawn = Scene.from_tables(line, "line.toml").run()
    (*_,) = drawn
    cure = "try entry.tension and entry.release = true instead of entry.speed in stage draw"
    told = " ".join(report(drawn).split())
    assert "slides over a" in told and cure in told
    led.clear()
    led |= {"tension": 3e4, "release": True}
    running = Scene.from_tables(line, "line.toml").run()
    *_, last = running
    assert last.state.tension("entry") == pytest.approx(3e4, rel=1e-3)
    assert "slides over" not in report(running) and "gives it a speed" not in report(running)
