"""What is left out of a scene: slip speed, mesh, onset of contact."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threaded import ended, roller, scene_of

from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import coarse_mesh
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.fem.sampling import ContactOperator
from anmstrip.simulation.defaults import elastic_creep
from anmstrip.simulation.meshing import LENGTH_GROWTH, Zone, graded_nodes
from anmstrip.simulation.problem import Assembly

FIELD = sorted((Path(__file__).parents[1] / "field").glob("*.toml"))
LINE: dict[str, Any] = {  # over one roller by 90°: 4 m level, then 1.5 m down
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 1e-3},
    "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
    "contact": {},
    "friction": {"coefficient": 0.2},
    "threading": {"tension": 1e4, "entry": [-4.0, 0.0, 0.0], "exit": [0.5, 0.0, -2.0]},
    "rollers": [{"name": "r1", "radius": 0.5, "centre": [0.0, 0.0, -0.5], "wrap": "over"}],
    "edges": {"entry": {"fixed": ["x", "z"]}},
    "stages": [
        {"duration": 0.5, "entry": {"release": True}, "rollers": {"r1": {"surface_speed": 2.0}}}
    ],
}
LAYER = (2e11 * 1e-9 / 12.0 / 0.91 / 1e4) ** 0.5
"""√(D/T) = 42.8 mm"""


def assembly(*stages: dict[str, Any], **tables: dict[str, Any]) -> Assembly:
    """The line with other stages, and with some values in its tables."""
    scene = copy.deepcopy(LINE)
    for name, values in tables.items():
        scene[name] = {**scene[name], **values}
    if stages:
        scene["stages"] = list(stages)
    return Assembly(Scene.model_validate(scene))


def speed(*stages: dict[str, Any], **tables: dict[str, Any]) -> float:
    """V_c (m/s)."""
    law = assembly(*stages, **tables).friction
    assert law is not None
    return law.speed


def test_contact_is_implied_by_rollers() -> None:
    bare = {key: value for key, value in LINE.items() if key != "contact"}
    assert Scene.model_validate(bare).contact == Scene.model_validate(LINE).contact
    assert Scene.from_tables(bare, "s", ["contact.onset=1e-5"]).contact.onset == 1e-5
    roller = {"radius": 0.5, "centre": [0.0, 0.0, -0.6]}
    flat = {**bare, "strip": {**LINE["strip"], "length": 4.0}, "rollers": [roller]}
    for name in ("friction", "threading"):
        del flat[name]
    flat["stages"] = [{"duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}}]
    assert Scene.model_validate(flat).contact == Scene.model_validate(LINE).contact
    assert Scene.model_validate({**flat, "rollers": []}).contact is None


def test_strip_is_threaded_against_its_entry() -> None:
    """Which needs no table, and keeps what it says besides; belts and flat strip have none."""
    bare = {key: value for key, value in LINE.items() if key != "edges"}
    assert Scene.model_validate(bare).edges == Scene.model_validate(LINE).edges
    centred = Scene.from_tables(bare, "s", ["edges.entry.centred=false"]).edges["entry"]
    assert centred.fixed == ("x", "z") and centred.centred is False
    with pytest.raises(InputError, match="x and z held, to thread against"):
        Scene.from_tables(bare, "s", ['edges.entry.fixed=["y"]'])
    belt = Path(__file__).parents[2] / "examples" / "belt.toml"
    assert not Scene.load(belt).edges
    flat = {**bare, "strip": {**LINE["strip"], "length": 4.0}, "rollers": []}
    del flat["threading"], flat["friction"]
    flat["stages"] = [{"duration": 1.0, "gravity": [0.0, 0.0, -9.81]}]
    assert not Scene.model_validate(flat).edges


def test_slip_speed_is_a_tenth_of_the_elastic_creep() -> None:
    """V f T/(E t)/10, by the least tension of note; a typed one stays."""
    assert speed() == pytest.approx(0.1 * 2.0 * 0.2 * 1e4 / 2e8, rel=1e-12)
    let_go = {"duration": 1.0, "entry": {"release": True}}
    stop = {**let_go, "rollers": {"r1": {"angular_speed": 8.0}}, "exit": {"tension": 5e3}}
    assert speed(stop) == pytest.approx(0.1 * 4.0 * 0.2 * 5e3 / 2e8, rel=1e-12)
    broken = {**let_go, "rollers": {"r1": {"angular_speed": 4.0}}, "exit": {"tension": 10.0}}
    assert speed(broken) == pytest.approx(0.1 * 2.0 * 0.2 * 1e3 / 2e8, rel=1e-12)
    assert speed(friction={"speed": 1e-3}) == 1e-3
    assert speed(friction={"coefficient": 0.0}) > 0.0


def test_slip_speed_of_held_strip_is_a_share_of_that_at_which_it_begins_to_slip() -> None:
    """√(2 V s/τ) as its shortest run, 1.58 m, is stretched by s = l T/(E t); V where that is less.

    Only where nothing sticks in the end: usual where a roller stops, follows, or is moved.
    """
    turn = {"duration": 1.0, "rollers": {"r1": {"surface_speed": 2.0}}}
    usual = 0.1 * 2.0 * 0.2 * 1e4 / 2e8
    slower = {"duration": 1.0, "rollers": {"r1": {"surface_speed": 0.5}}}
    way = np.hypot(0.5, 1.5) * 1e4 / 2e8

    def begins(slip: float, time: float = 1.0) -> Any:
        return pytest.approx(1e-3 * np.sqrt(2.0 * slip * way / time), rel=1e-12)

    assert speed(turn) == begins(2.0)
    assert speed(turn | {"duration": 0.1}) == begins(2.0, 0.1)
    assert speed(turn | {"duration": 1e-5}) == pytest.approx(1e-3 * 2.0, rel=1e-12)
    assert speed(turn, slower) == begins(0.5)
    assert speed({**turn, "entry": {"speed": 1.2}}) == begins(0.8)
    stop, back, carried = ({"rollers": {"r1": {"surface_speed": v}}} for v in (0.0, -1.0, 2.0))
    moved = {"rollers": {"r1": {"move": [0.0, 0.0, 0.1]}}}
    for other in (stop, back, moved, {**carried, "entry": {"speed": 2.0}}):
        assert speed(turn, {"duration": 1.0, **other}) == pytest.approx(usual, rel=1e-12)
    standing = {**LINE["rollers"][0], "name": "r2", "centre": [-2.0, 0.0, -0.5]}
    both = LINE | {"rollers": [standing, *LINE["rollers"]], "stages": [turn]}
    law = Assembly(Scene.model_validate(both)).friction
    assert law is not None
    assert law.speed == pytest.approx(usual, rel=1e-12)
    long = LINE | {"strip": {**LINE["strip"], "length": 1.2}, "threading": {"tension": 1e4}}
    law = Assembly(Scene.model_validate(long | {"stages": [turn]})).friction
    assert law is not None
    assert law.speed == pytest.approx(1e-3 * np.sqrt(4.0 * 1.2 * 1e4 / 2e8), rel=1e-12)


def test_a_line_that_stands_after_it_has_run_hardly_creeps() -> None:
    """By 1e-4 of what its shortest span, 1.58 m, is stretched by, and only while it stands."""
    run, stop, wait, again = (
        {"duration": time, "rollers": {"r1": {"surface_speed": v}} if v is not None else {}}
        for time, v in ((1.0, 2.0), (1.0, 0.0), (5.0, None), (1.0, 1.0))
    )
    usual, span = 0.1 * 2.0 * 0.2 * 1e4 / 2e8, np.hypot(0.5, 1.5)
    moved = {"duration": 5.0, "rollers": {"r1": {"move": [0.0, 0.0, 0.1]}}}
    long = {"duration": 3600.0}
    at_rest = 1e-4 * span * 1e4 / 2e8 / 5.0
    for line, resting, wanted in (
        ((wait, run, stop), None, usual),
        ((run, stop, wait), 2, at_rest),
        ((run, stop, wait, again), 2, at_rest),
        ((run, stop, long), 2, at_rest * 5.0 / 3600.0),
        ((run, stop, moved), None, usual),
    ):
        given = assembly(*line)
        for number, stage in enumerate(given.scene.course[1:]):
            friction = given.friction_in(stage)
            assert friction is not None
            found = friction.law_of_slip.speed
            assert found == pytest.approx(wanted if number == resting else usual, rel=1e-12)
    given = assembly(run, stop, wait, friction={"coefficient": 0.2, "speed_at_rest": 1e-5})
    friction = given.friction_in(given.scene.course[3])
    assert friction is not None
    assert friction.law_of_slip.speed == pytest.approx(1e-5, rel=1e-12)


def test_a_roller_that_is_pressed_in_while_the_line_stands_leaves_its_tension() -> None:
    """e^(fθ) times the exit's on the way in, and as much after ten minutes in which nothing moves.

    The strip slipped by then; what its velocity is as the roller stops is no imbalance.
    """
    rolls = [
        {"name": name, "radius": 0.3, "centre": [x, 0.0, z], "wrap": wrap}
        for name, x, z, wrap in (
            ("a", 0.0, 0.3, "under"), ("mid", 2.0, -0.3, "over"), ("b", 4.0, 0.3, "under"),
        )
    ]  # fmt: skip
    rolls[1] |= {"drive": "idle", "bearing": 0.0}
    turn = {name: {"surface_speed": 1.0} for name in ("a", "b")}
    stop = {name: {"surface_speed": 0.0} for name in ("a", "b")}
    tables = {
        **{key: LINE[key] for key in ("strip", "material", "contact", "friction")},
        "rollers": rolls,
        "threading": {"tension": 1e4, "entry": [-2.0, 0.0, 1.0], "exit": [6.0, 0.0, 1.0]},
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [
            {"name": "start", "duration": 1.0, "rollers": turn,
             "entry": {"release": True, "tension": 1e4}},
            {"name": "stop", "duration": 1.0, "rollers": stop},
            {"name": "press", "duration": 5.0, "rollers": {"mid": {"move": [0.0, 0.0, 0.02]}}},
            {"name": "stand", "duration": 600.0},
        ],
    }  # fmt: skip
    run, tensions = Scene.model_validate(tables).run(), dict[str, float]()
    for step in run:
        tensions[step.stage] = step.state.rollers["mid"].tension_in or 0.0
    assert run.outcome.done, run.message
    assert tensions["press"] > 1.05e4
    assert tensions["stand"] == pytest.approx(tensions["press"], rel=2e-3)
    assert run.stages["stand"]["tangents"] < 20


def test_a_line_that_stands_slips_as_tensions_and_heat_ask_for() -> None:
    """V_c is a hundredth of the speed at which they stretch its shortest span, beside the creep."""
    run, stop = ({"duration": 1.0, "rollers": {"r1": {"surface_speed": v}}} for v in (2.0, 0.0))
    creep, way = 1e-4 * 1e4 / 2e8, np.hypot(0.5, 1.5) / 60.0
    material = {**LINE["material"], "expansion": 1.2e-5}
    for change, strain in (
        ({"exit": {"tension": 1.2e4}}, 0.2 * 1e4 / 2e8),
        ({"exit": {"tension": 0.7e4}}, 0.3 * 1e4 / 2e8),
        ({"strip": {"temperature": 5.0}}, 6e-5),
    ):
        given = assembly(run, stop, {"duration": 60.0, **change}, material=material)
        law = given.law_of_slip(given.scene.stages[-1])
        assert law is not None
        least = min(1e4, change.get("exit", {}).get("tension", 1e4)) / 1e4
        assert law.speed == pytest.approx((least * creep + 1e-2 * strain) * way, rel=1e-9)


def test_drag_of_an_idler_stays_where_a_line_stands() -> None:
    """T out less T in is the bearing's torque over radius and width, 80 N/m, while it runs.

    With the V_c of a line that only runs all of it has crept away after 5 s.  To stand costs
    nothing: friction and bearings begin in balance with the other V_c.
    """
    idler = {"name": "i", "radius": 0.25, "centre": [-2.0, 0.0, 0.25], "wrap": "under"}
    tables = {**LINE, "rollers": [{**idler, "drive": "idle", "bearing": 20.0}, *LINE["rollers"]]}
    tables |= {
        "threading": {"tension": 1e4, "entry": [-4.0, 0.0, 1.0], "exit": [0.5, 0.0, -2.0]},
        "stages": [
            {**LINE["stages"][0], "entry": {"release": True, "tension": 1e4}},
            {"duration": 0.5, "rollers": {"r1": {"surface_speed": 0.0}}},
            {"duration": 5.0},
        ],
    }
    drags, spent = [], []
    for friction in ({}, {"speed_at_rest": 0.1 * 2.0 * 0.2 * 1e4 / 2e8}):
        law = {"friction": {"coefficient": 0.2, **friction}, "solver": {"tolerance": 1e-4}}
        run = Scene.model_validate(tables | law).run()
        *_, last = run
        reading = last.state.rollers["i"]
        assert reading.tension_in is not None
        assert reading.tension_out is not None
        drags.append(reading.tension_out - reading.tension_in)
        spent.append(run.stages["stage3"]["tangents"])
    assert drags[0] == pytest.approx(80.0, rel=0.05)
    assert spent[0] <= 4
    assert drags[1] < 20.0


def test_slip_speed_where_nothing_turns_is_a_displacement_over_the_time() -> None:
    still = {"duration": 4.0, "friction": False}
    moved = {"duration": 2.0, "rollers": {"r1": {"move": [0.0, 0.0, 0.3]}}}
    strain = 0.2 * 1e4 / 2e8
    assert speed(still, moved) == pytest.approx(0.1 * strain * 0.3 / 2.0, rel=1e-12)
    step = {"duration": 5.0, "exit": {"tension": 2e4}}
    assert speed(step) == pytest.approx(0.1 * strain * 0.2 * 0.5 / 5.0, rel=1e-12)


def test_slip_speed_of_strip_that_nothing_pulls_is_that_at_a_usual_strain() -> None:
    laid = {
        **{key: LINE[key] for key in ("material", "contact", "friction")},
        "strip": {**LINE["strip"], "length": 4.0},
        "rollers": [{"radius": 0.5, "centre": [0.0, 0.0, -0.5]}],
        "edges": {"entry": {"fixed": ["x"]}},
        "stages": [{"duration": 1.0, "rollers": {"r1": {"surface_speed": 2.0}}}],
    }
    law = Assembly(Scene.model_validate(laid)).friction
    assert law is not None
    assert law.speed == pytest.approx(1e-3 * np.sqrt(2.0 * 2.0 * 4.0 * 1e-4), rel=1e-12)
    laid["stages"].append({"duration": 1.0, "rollers": {"r1": {"surface_speed": 0.0}}})
    law = Assembly(Scene.model_validate(laid)).friction
    assert law is not None
    assert law.speed == pytest.approx(0.1 * 2.0 * 0.2 * 1e-4, rel=1e-12)


def test_slip_speed_is_among_what_was_used() -> None:
    scene = assembly().scene
    assert scene.to_dict()["friction"] == {
        "law": "algebraic", "parameters": {}, "coefficient": 0.2, "speed": speed(),
        "regularisation": "fixed",
    }  # fmt: skip
    assert 0.1 * elastic_creep(scene) == speed()


def cells(given: Assembly) -> tuple[np.ndarray, np.ndarray]:
    """Middles and lengths of the elements along x."""
    x = np.unique(np.round(given.strip.mesh.p[0], 12))
    return 0.5 * (x[1:] + x[:-1]), np.diff(x)


def test_elements_are_a_quarter_of_the_boundary_layer_where_the_strip_lifts_off() -> None:
    """Over the 0.5 m that pass, 2 √(D/T) more on either side; then they grow, to a tenth."""
    given = assembly(strip={"feed": False})
    assert given.thread is not None
    (on, off), half = given.thread.arcs["r1"], 0.5 * given.thread.length
    middles, lengths = cells(given)
    for place in (on, off):
        near = (middles > place - 2.0 * LAYER - 0.5) & (middles < place + 2.0 * LAYER)
        assert lengths[near].max() < 1.05 * 0.25 * LAYER
    assert lengths.max() > 0.8 * 2.0 * half / 20.0
    growth = np.maximum(lengths[1:] / lengths[:-1], lengths[:-1] / lengths[1:])
    assert growth.max() < 1.0 + 2.0 * 0.15
    assert len(lengths) < 200
    # without travel only the lift-off itself, and the middle of the arc has larger ones
    rest = assembly({"duration": 1.0})
    middles, lengths = cells(rest)
    middle = np.abs(middles - 0.5 * (on + off)) < 0.1
    assert 0.4 * LAYER < lengths[middle].max() < 0.51 * LAYER
    assert len(lengths) < 120


def test_elements_resolve_a_plastic_hinge() -> None:
    """Rollers 60 mm apart bend strip of 1 mm beyond κ_e = 3.15 1/m: a quarter of 0.2 of 30 mm."""
    rollers = [
        {"name": n, "radius": 0.05, "centre": [0.06 * k, 0.0, z], "wrap": w, "drive": "idle"}
        for k, (n, z, w) in enumerate(
            [("a", -0.05, "over"), ("b", 0.047, "under"), ("c", -0.05, "over")]
        )
    ]
    scene = copy.deepcopy(LINE) | {
        "rollers": rollers,
        "threading": {"tension": 1e4, "entry": [-0.2, 0.0, 0.0], "exit": [0.32, 0.0, 0.0]},
        "stages": [{"steady": True, "strip": {"speed": 1.0}}],
    }

    def longest(**material: Any) -> float:
        given = Assembly(Scene.model_validate(scene | {"material": LINE["material"] | material}))
        assert given.thread is not None
        middles, lengths = cells(given)
        first, last = given.thread.arcs["b"]
        return float(lengths[(middles > first) & (middles < last)].max())

    assert longest() > 0.005
    yields = {"yield_stress": 3e8, "plasticity": {}}
    assert longest(**yields) < 0.0016
    assert longest(yield_stress=3e9, plasticity={}) == longest()


def test_the_onset_is_not_that_of_an_arc_shorter_than_an_element() -> None:
    """Taut strip touches this roller over 1 mm; elements beside it are of r/8 = 62.5 mm."""
    flat = {"threading": {"entry": [-4.0, 0.0, 0.0], "exit": [4.0, 0.0, -0.008]}}
    given = assembly({"duration": 1.0}, strip={"refined": 0.0625}, **flat)
    assert given.strip.cell_sizes[0].min() < 0.01
    assert given.signorini.width == pytest.approx((0.25 * 0.5 * 0.0625) ** 2 / 1.0, rel=1e-9)


def test_a_roller_that_moves_has_fine_elements_where_it_goes() -> None:
    """A carriage that rises shifts the labels on the next roller by twice as much."""
    scene = copy.deepcopy(LINE) | {
        "rollers": [
            {"name": "a", "radius": 0.3, "centre": [0.0, 0.0, 0.0], "wrap": "under"},
            {"name": "b", "radius": 0.3, "centre": [0.6, 0.0, 2.0], "wrap": "over"},
            {"name": "c", "radius": 0.3, "centre": [1.2, 0.0, 0.0], "wrap": "under"},
        ],
        "threading": {"tension": 1e4, "entry": [-2.0, 0.0, -0.3], "exit": [3.0, 0.0, -0.3]},
        "stages": [{"duration": 1.0, "rollers": {"b": {"move": [0.0, 0.0, 0.5]}}}],
    }
    carried = scene | {"strip": {**scene["strip"], "feed": False}}
    given, fed = (Assembly(Scene.model_validate(each)) for each in (carried, scene))
    assert given.thread is not None
    middles, lengths = cells(given)
    _, off = given.thread.arcs["c"]
    assert lengths[(middles > off) & (middles < off + 1.0)].max() < 1.05 * 0.25 * LAYER
    count, (middles, lengths) = len(lengths), cells(fed)  # labels follow the carriage
    assert lengths[(middles > off) & (middles < off + 1.0)].max() > 0.3 * LAYER
    assert len(lengths) < 0.8 * count


def test_elements_across_are_even_and_more_where_the_profile_varies() -> None:
    shell = {"kinematics": "shell"}
    plain = assembly(strip=shell)
    assert len(np.unique(plain.strip.mesh.p[1])) == 5
    crowned = copy.deepcopy(LINE)
    crowned["strip"] |= shell
    crowned["rollers"][0]["crown"] = [0.0, -2e-4]
    assert len(np.unique(Assembly(Scene.model_validate(crowned)).strip.mesh.p[1])) == 9


@pytest.mark.parametrize("path", FIELD, ids=lambda path: path.stem)
def test_a_bare_scene_is_bounded(path: Path) -> None:
    assert Assembly(Scene.load(path)).strip.unknowns <= 12_000


def test_a_film_is_not_resolved_below_what_a_string_needs() -> None:
    """√(D/T) = 0.2 mm; a 64th of the radius is 7.8 mm."""
    film = assembly(
        {"duration": 1.0}, strip={"thickness": 2e-5}, material={"young": 4.5e9},
        threading={"tension": 100.0},
    )  # fmt: skip
    assert cells(film)[1].min() == pytest.approx(0.5 / 64.0, rel=0.05)


def test_a_plate_does_not_float_on_its_weight_by_a_share_of_its_thickness() -> None:
    """By p₀ exp(−h/w): the gap under ρ g t beside a pressure T/r 130 times as large."""
    fall = {"duration": 1.0, "gravity": [0.0, 0.0, -9.81]}
    for stage, load in ((fall, 7850.0 * 9.81 * 1e-3), ({"duration": 1.0, "pressure": -50.0}, 50.0)):
        law = assembly(stage, strip={"cells": [40, 1], "refined": 0.1}).signorini
        assert law.pressure == pytest.approx(2e4)
        assert 0.04e-3 < float(law.gap(load)) <= 0.0501e-3


@pytest.mark.parametrize(
    ("thickness", "pitch", "radius", "overhang"),
    [(0.05, 0.6, 0.3, 0.1), (0.008, 0.4, 0.1, 0.135), (0.03, 1.0, 0.15, 0.175)],
)
@pytest.mark.parametrize("above", [None, 0.5])
def test_rollers_bear_a_stiff_plate_as_supports_do(
    thickness: float, pitch: float, radius: float, overhang: float, above: float | None
) -> None:
    """Clapeyron's three moments, to 2 % of a mean load; it was 25, 17 and 15 %.

    And 35, 7 and 11 % under a roller far above, whose gap counted for all.
    """
    count, width, load = 5, 2.0, 7850.0 * 9.81 * thickness
    places = pitch * (np.arange(count) - 0.5 * (count - 1))
    moments = np.full(count, -0.5 * load * overhang**2)
    inner = 4.0 * np.eye(count - 2) + np.eye(count - 2, k=1) + np.eye(count - 2, k=-1)
    right = np.full(count - 2, -0.5 * load * pitch**2)
    right[[0, -1]] -= moments[[0, -1]]
    moments[1:-1] = np.linalg.solve(inner, right)
    lines = np.full(count, load * pitch)
    lines[[0, -1]] = load * (0.5 * pitch + overhang)
    steps = np.diff(moments) / pitch
    lines[:-1] += steps
    lines[1:] -= steps
    tables = {
        "strip": {"kinematics": "section", "length": 2 * (float(places[-1]) + overhang),
                  "width": width, "thickness": thickness},
        "material": {"young": 2.05e11, "poisson": 0.3, "density": 7850.0},
        "contact": {},
        "friction": {"coefficient": 0.25},
        "rollers": [{"radius": radius, "centre": [x, 0.0, -radius]} for x in places.tolist()],
        "edges": {"entry": {"fixed": ["x"]}},
        "stages": [{"duration": 1.0, "gravity": [0.0, 0.0, -9.81]}],
    }  # fmt: skip
    if above is not None:
        tables["rollers"].append({"radius": radius, "centre": [0.3 * pitch, 0.0, radius + above]})
    *_, last = Scene.model_validate(tables).run()
    found = [reading.normal_force / width for reading in last.state.rollers.values()]
    assert found[:count] == pytest.approx(lines, abs=0.02 * lines.mean())


@pytest.mark.parametrize("thickness", [0.02, 0.05])
def test_rollers_bear_a_plate_that_is_threaded_over_them_as_supports_do(thickness: float) -> None:
    """Three moments, with the entry as the first support; to 2 % of a mean load; it was 3 and 17 %.

    The tension, of 1 kN/m, is a hundredth of what a pitch of the plate resists with.
    """
    pitch, count, width, load = 1.5, 5, 2.5, 7850.0 * 9.81 * thickness
    moments = np.zeros(count + 1)
    moments[-1] = -0.5 * load * pitch**2
    inner = 4.0 * np.eye(count - 1) + np.eye(count - 1, k=1) + np.eye(count - 1, k=-1)
    right = np.full(count - 1, -1.5 * load * pitch**2 / 3.0)
    right[-1] -= moments[-1]
    moments[1:-1] = np.linalg.solve(inner, right)
    lines = np.full(count + 1, load * pitch)
    lines[[0, -1]] = load * np.array([0.5, 1.5]) * pitch
    steps = np.diff(moments) / pitch
    lines[:-1] += steps
    lines[1:] -= steps
    places = pitch * (1.0 + np.arange(count))
    tables = {
        "strip": {"kinematics": "section", "width": width, "thickness": thickness},
        "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
        "friction": {"coefficient": 0.3},
        "threading": {"tension": 1e3, "entry": [0, 0, 0], "exit": [6.0 * pitch, 0, 0]},
        "rollers": [
            {"radius": 0.2, "centre": [x, 0.0, -0.2], "wrap": "over"} for x in places.tolist()
        ],
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [{"friction": False, "gravity": [0.0, 0.0, -9.81]}],
    }
    *_, last = Scene.model_validate(tables).run()
    found = [reading.normal_force / width for reading in last.state.rollers.values()]
    assert found == pytest.approx(lines[1:], abs=0.02 * lines.mean())


def carried(thickness: float, pitch: float, travel: float) -> dict[str, Any]:
    """A plate of eight pitches that lies on eight of eleven rollers, and is carried on by them."""
    places = pitch * (np.arange(11) - 3.5)
    speeds = {f"r{k + 1}": {"surface_speed": 0.5} for k in range(len(places))}
    return {
        "strip": {"kinematics": "section", "length": 8.0 * pitch, "width": 2.0,
                  "thickness": thickness},
        "material": {"young": 2.05e11, "poisson": 0.3, "density": 7850.0},
        "friction": {"coefficient": 0.25},
        "rollers": [{"radius": 0.1, "centre": [x, 0.0, -0.1]} for x in places.tolist()],
        "edges": {"entry": {"fixed": ["x"]}},
        "stages": [
            {"name": "settle", "duration": 1.0, "gravity": [0.0, 0.0, -9.81]},
            {"name": "carry", "duration": 4.0 * travel, "entry": {"release": True},
             "rollers": speeds},
        ],
    }  # fmt: skip


def test_a_plate_that_travels_from_roller_to_roller_is_fine_all_along() -> None:
    """Zones that overlap have nothing between them; they were cut by as much, to 0.2 m pieces."""
    strip = Assembly(Scene.model_validate(carried(0.02, 0.4, 0.4))).strip
    assert strip.cell_sizes[0].max() <= 0.1 / 8.0 * 1.001
    assert strip.contact_parts > 1
    points = ContactOperator(strip)  # each part carries its own share: cubics are integrated
    x, half = points.reference[0], 0.5 * 8.0 * 0.4
    for power in range(4):
        integral = 2.0 * (half ** (power + 1) - (-half) ** (power + 1)) / (power + 1)
        assert points.weights @ x**power == pytest.approx(integral, rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_rollers_bear_a_carried_plate_as_they_bore_it() -> None:
    """A pitch farther every roller bears what the one before bore, to 1 % of a mean load."""
    *_, last = Scene.model_validate(carried(0.02, 0.4, 0.4)).run()
    loads = [reading.normal_force for reading in last.state.rollers.values()]
    weight = 7850.0 * 9.81 * 0.02 * 2.0 * 3.2
    assert sum(loads) == pytest.approx(weight, rel=1e-3)
    settled = {**carried(0.02, 0.4, 0.4)}
    settled["stages"] = settled["stages"][:1]
    *_, first = Scene.model_validate(settled).run()
    before = [reading.normal_force for reading in first.state.rollers.values()]
    assert loads[1:] == pytest.approx(before[:-1], abs=0.01 * weight / 8.0)
    assert loads[0] < 1e-3 * weight


def test_elements_are_as_short_as_the_nearest_zones_ask_for() -> None:
    """Whatever is looked at of each: the lengths are the envelope over all of them."""
    rng = np.random.default_rng(5)
    begins = np.sort(rng.uniform(-0.95, 0.9, 30)) * 50.0
    zones = [
        Zone(begin, begin + rng.uniform(0.0, 2.0), 10.0 ** rng.uniform(-2.0, 0.0))
        for begin in begins
    ]
    nodes = graded_nodes(50.0, zones, 5.0)
    middles, sizes = 0.5 * (nodes[1:] + nodes[:-1]), np.diff(nodes)
    away = [np.maximum(np.maximum(z.first - middles, middles - z.last), 0.0) for z in zones]
    asked = np.min([z.size + LENGTH_GROWTH * a for z, a in zip(zones, away, strict=True)], axis=0)
    ratio = sizes / np.minimum(asked, 5.0)
    assert ratio.max() < 1.2
    assert ratio.min() > 0.8


def test_a_roller_that_is_only_grazed_has_no_element_without_length() -> None:
    """The strip lifts on and off at the same place, twice a mark of a node."""
    nodes = graded_nodes(14.0, [Zone(-12.6, -12.4, 0.02)], 1.4, [-12.5, -12.5, -12.5 + 1e-9])
    assert np.abs(nodes + 12.5).min() < 1e-9
    assert np.diff(nodes).min() > 0.01


def test_long_lines_have_more_unknowns_and_are_told_how_many() -> None:
    """Three hundred for each of sixty rollers, where twelve thousand in all would be too few."""
    rollers = [
        roller(f"r{i}", 0.8 * i, 15.0 * (i % 2), 0.4, "over" if i % 2 else "under")
        for i in range(60)
    ]
    threading = {"tension": 1e4, "entry": (-0.4, 0.0, 7.5), "exit": (47.6, 0.0, 7.5)}
    scene = scene_of({"rollers": rollers, "threading": threading}, contact={}).to_dict()
    del scene["strip"]["cells"]
    scene["contact"] = {}
    preview = Preview.of(Assembly(Scene.model_validate(scene)))
    assert 17500 < preview.assembly.strip.unknowns < 18400
    (words,) = coarse_mesh(preview)
    advice = re.search(
        r"a mesh by default has about 18000 unknowns\. Shorter ones need (\d+) unknowns\. "
        r"Try --set strip\.finer=([\d.]+)(?: or less travel)?$", words,
    )  # fmt: skip
    assert advice is not None
    scene["strip"]["finer"] = float(advice[2])
    preview = Preview.of(Assembly(Scene.model_validate(scene)))
    assert not list(coarse_mesh(preview))
    assert preview.assembly.strip.unknowns == int(advice[1])


TOWER = {
    "strip": {"width": 1.8, "thickness": 0.7e-3},
    "material": {"young": 2.1e11, "poisson": 0.3},
    "threading": {"tension": 7e3, "entry": [-2.0, 0.0, 0.0], "exit": [6.0, 0.0, 0.0]},
    "edges": {"entry": {"fixed": ["x", "z"]}},
    "rollers": [
        {"radius": 0.4, "centre": [float(k), 0.0, z], "wrap": wrap}
        for k, (z, wrap) in enumerate([(0.4, "under"), (8.0, "over")] * 2 + [(0.4, "under")])
    ],
    "stages": [{"friction": False, "duration": 1.0}],
}
FOIL = {
    **TOWER,
    "strip": {"width": 0.6, "thickness": 35e-6},
    "material": {"young": 1.2e11, "poisson": 0.34},
    "threading": {"tension": 1e3, "entry": [-0.5, 0.0, 0.0], "exit": [1.5, 0.0, 0.0]},
    "rollers": [
        {"radius": 0.06, "centre": [0.5 * k, 0.0, z], "wrap": wrap}
        for k, (z, wrap) in enumerate([(-0.06, "over"), (-0.4, "under"), (-0.06, "over")])
    ],
}


def coarse(tables: dict[str, Any], *settings: str) -> tuple[list[str], int]:
    """What is told of a coarse mesh, and its unknowns."""
    assembly = Assembly(Scene.from_tables(tables, "line.toml", settings))
    return list(coarse_mesh(Preview(assembly, (), ()))), assembly.strip.unknowns


@pytest.mark.parametrize("tables", [TOWER, FOIL], ids=["tower", "foil"])
@pytest.mark.parametrize("given", [0.0, 0.5, 1.1, 1.3, 2.0])
def test_the_first_factor_that_is_told_suffices(tables: dict[str, Any], given: float) -> None:
    """Across a whole number of elements they need not shrink in proportion."""
    settings = [f"strip.finer={given}"] * (given > 0.0)
    told, _ = coarse(tables, *settings)
    for words in told:
        assert (f"with strip.finer = {given:g}. Shorter ones need" in words) == bool(settings)
        advice = re.search(
            r" (\d+) unknowns\. Try --set (strip\.finer=[\d.]+) or less travel$", words
        )
        assert advice is not None, words
        assert coarse(tables, advice[2]) == ([], int(advice[1]))


def test_what_many_unknowns_cost_is_told_instead_of_an_advice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def thin(radius: float) -> dict[str, Any]:
        return {**TOWER, "rollers": [{**roller, "radius": radius} for roller in TOWER["rollers"]]}

    tight = "threading.tension=2e5"
    (words,), _ = coarse(thin(0.1), tight)
    found = re.search(
        r"--set (strip\.finer=[\d.]+) makes them so short, but with (\d+) unknowns, for which "
        r"`anmstrip explain` alone takes about \d+ GB and \d+ s\.$", words,
    )  # fmt: skip
    assert found is not None, words
    assert coarse(thin(0.1), tight, found[1]) == ([], int(found[2]))
    with monkeypatch.context() as small:  # else the key that is told would be refused
        small.setattr("anmstrip.advice.warnings.memory_of_machine", lambda: 1e9)
        (words,), _ = coarse(thin(0.1), tight)
    assert words.endswith("Shorter ones do not fit into the 1 GB of this machine."), words
    monkeypatch.setattr("anmstrip.advice.warnings.MAX_ELEMENTS", 5000)
    (words,), _ = coarse(thin(0.1), tight)
    assert re.search(r"Shorter ones would be \d+, more than a mesh may have\.$", words), words


def test_a_shell_that_does_not_fit_into_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before it is made; what is proposed fits."""
    memory = "anmstrip.simulation.meshing.memory_of_machine"
    monkeypatch.setattr(memory, lambda: 1e9)
    with pytest.raises(InputError, match=r"fits into the 1 GB of this machine") as refused:
        _ = Assembly(Scene.from_tables(TOWER, "tower", ["strip.finer=8"])).strip
    (mistake,) = refused.value.mistakes
    assert mistake.key == "strip.finer" and mistake.value == 8.0
    finer = float(mistake.hint.removeprefix("finer = "))
    assert (
        Assembly(Scene.from_tables(TOWER, "tower", [f"strip.finer={finer}"])).strip.unknowns
        < 25_000
    )
    with pytest.raises(InputError, match=r"and no cells"):
        _ = Assembly(Scene.from_tables(TOWER, "tower", ["strip.cells=[400, 40]"])).strip
    monkeypatch.undo()
    monkeypatch.delattr("os.sysconf")  # as on Windows
    assert Assembly(Scene.from_tables(TOWER, "tower")).strip.unknowns > 0


def test_the_middle_of_a_centred_edge_is_a_node_beside_corners_of_flatness() -> None:
    """A strip slit in two, whose steep middle takes no room for a node between its corners."""
    steps = [[-0.5, 0.0], [-0.01, 0.0], [0.01, 6.0], [0.5, 6.0]]
    slit = {**TOWER, "strip": {**TOWER["strip"], "flatness": {"table": steps}}}
    strip = Assembly(Scene.from_tables(slit, "tower", ["edges.entry.centred=true"])).strip
    places = np.unique((strip.mesh.p[1] / strip.width).round(9))
    assert {-0.01, 0.0, 0.01} <= set(places)
    with pytest.raises(InputError, match="an even number across") as refused:
        odd = ["edges.entry.centred=true", "strip.cells=[16, 3]"]
        _ = Assembly(Scene.from_tables(TOWER, "tower", odd)).strip
    assert [m.hint for m in refused.value.mistakes] == ["cells = [16, 4]"]


def test_a_step_of_tension_at_a_standstill_leaves_what_friction_holds() -> None:
    """Two seconds later, 16 kN/m e^(−f π/2) within 1 %; with V_c five times as large 1.7 %."""
    tables = {
        **LINE,
        "strip": {"kinematics": "section", "width": 1.2, "thickness": 8e-4},
        "friction": {"coefficient": 0.25},
        "rollers": [{"name": "r1", "radius": 0.4, "centre": [0.0, 0.0, -0.4], "wrap": "over"}],
        "threading": {"tension": 1e4, "entry": [-2.0, 0.0, 0.0], "exit": [0.4, 0.0, -2.0]},
        "stages": [{"name": "step", "duration": 0.5, "exit": {"tension": 1.6e4}},
                   {"name": "rest", "duration": 2.0}],
    }  # fmt: skip
    run, state = ended(Scene.model_validate(tables))
    held = 1.6e4 * np.exp(-0.25 * np.pi / 2.0)
    assert state.tension("entry") == pytest.approx(held, rel=0.01)
    assert run.cost.expansions <= 100


def test_rollers_may_have_the_names_of_ends() -> None:
    """A roller that turns is not the held end, which stands, whatever it is called."""
    turn = {"duration": 1.0, "rollers": {"r1": {"surface_speed": 2.0}}}
    named = {**LINE["rollers"][0], "name": "entry"}
    other = {"duration": 1.0, "rollers": {"entry": {"surface_speed": 2.0}}}
    law = Assembly(Scene.model_validate(LINE | {"rollers": [named], "stages": [other]})).friction
    assert law is not None and law.speed == speed(turn)


def test_strip_that_its_exit_pulls_is_fine_where_it_will_pass() -> None:
    """Though its entry is let go, and no roller turns: r/8 over all labels that pass."""
    tables = {
        "strip": {"kinematics": "section", "width": 0.5, "thickness": 5e-4, "feed": False},
        "material": {"young": 2e11, "poisson": 0.3},
        "friction": {"coefficient": 0.3},
        "threading": {"tension": 2e3, "entry": [-4.0, 0.0, 0.0], "exit": [3.0, 0.0, -0.7]},
        "rollers": [{"name": "bar", "radius": 0.3, "centre": [0.0, 0.0, -0.3], "wrap": "over"}],
        "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}},
        "stages": [{"name": "pull", "duration": 4.0, "entry": {"release": True},
                    "exit": {"speed": 0.6}}],
    }  # fmt: skip
    line = Assembly(Scene.from_tables(tables, "pulled.toml"))
    assert line.layout.travel == pytest.approx((0.0, 1.2))
    first, last = line.thread.arcs["bar"]
    nodes = line.strip.mesh.p[0]
    passing = np.sort(nodes[(nodes > first - 1.2) & (nodes < last)])
    assert np.diff(passing).max() < 1.05 * 0.3 / 8.0
