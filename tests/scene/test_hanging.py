"""Strip that hangs through under its weight: its labels stay on the rollers, its ends in place."""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from anmstrip.driver.explain import explain
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.driver.sensitivities import sensitivities
from anmstrip.mechanics.string_path import catenary
from anmstrip.results.rollers import RollerPassage
from anmstrip.results.state import State
from anmstrip.simulation.meshing import Layout
from anmstrip.simulation.problem import Assembly
from stationary import corrected

WEIGHT, TENSION, SPAN = 7850.0 * 5e-4 * 9.81, 2500.0, 30.0

FURNACE: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 1.3, "thickness": 5e-4},
    "material": {"young": 1.4e11, "poisson": 0.3, "density": 7850.0},
    "contact": {},
    "friction": {"coefficient": 0.2},
    "threading": {"tension": TENSION, "entry": (-3.0, 0.0, -2.0), "exit": (SPAN + 3.0, 0.0, -2.0)},
    "rollers": [
        {"name": "a", "radius": 0.4, "centre": (0, 0, 0), "wrap": "over", "drive": "idle"},
        {
            "name": "b", "radius": 0.4, "centre": (SPAN, 0, 0), "wrap": "over",
            "drive": "idle", "bearing": 25.0,
        },
    ],
    "edges": {"entry": {"fixed": ("x", "z")}},
    "stages": [{"name": "run", "steady": True, "gravity": (0, 0, -9.81), "strip": {"speed": 1.0}}],
}  # fmt: skip


STRICT = "solver.tolerance=1e-7"


def done(tables: dict[str, Any], *settings: str) -> Run:
    run = Run(Scene.from_tables(tables, "line.toml", settings))
    for _ in run:
        pass
    assert run.outcome.done, run.message
    return run


@pytest.mark.parametrize("length", [30.0, 100.0, 3000.0])
@pytest.mark.parametrize("rise", [0.0, 8.0])
def test_catenary_between_two_points(length: float, rise: float) -> None:
    """Integrated along the strip from its end: there its slope and tension are as they say."""
    pull, weight = 2e4 + 38.0 * abs(rise), 38.0 * 30.0 / length
    longer, first, last = catenary(np.array([length, rise]), weight, pull)
    chord, angle = np.hypot(length, rise), np.arctan2(rise, length)
    s = np.linspace(0.0, chord + longer, 20001)
    along, up = pull * np.cos(angle + last), pull * np.sin(angle + last)
    slope = np.arctan2(up - weight * (s[-1] - s), along)
    assert slope[0] == pytest.approx(angle - first, rel=1e-9, abs=1e-12)
    assert np.trapezoid(np.cos(slope), s) == pytest.approx(length, rel=1e-9)
    assert np.trapezoid(np.sin(slope), s) == pytest.approx(rise, abs=1e-7 * length)


def test_strip_hangs_between_rollers_and_its_ends_stay() -> None:
    """As the catenary that both rollers leave tangentially; without growth its end slid 0.28 m."""
    run = done(FURNACE)
    state = run.state
    assert state is not None
    places = np.stack([state.along("x"), state.along("z")])
    assert places[:, -1] == pytest.approx([SPAN + 3.0, -2.0], abs=0.08)
    assert places[:, 0] == pytest.approx([-3.0, -2.0], abs=1e-6)
    tension, height = state.along("tension"), places[1]
    behind = state.along("x") > SPAN + 1.0
    expected = TENSION + WEIGHT * (height - height[-1])
    assert tension[behind] == pytest.approx(expected[behind], rel=1e-3)
    before = (places[0] > 1.0) & (places[0] < SPAN - 1.0)
    assert tension[before] == pytest.approx(expected[before] - 25.0 / (0.4 * 1.3), rel=1e-3)
    # of level spans: T at the lowest point H, w a = H, sag a (cosh(x/a) − 1) from lift-off to it
    middle = int(np.argmin(np.where(before, height, np.inf)))
    a, x = tension[middle] / WEIGHT, places[0, before] - places[0, middle]
    sag = height[before] - height[middle]
    assert sag == pytest.approx(a * (np.cosh(x / a) - 1.0), abs=2e-3)
    assert state.rollers["a"].surface_speed == pytest.approx(1.0, abs=1e-4)
    assert run.cost.expansions < 70


def test_an_exit_that_is_guided_on_its_way_down_stays() -> None:
    """At 40° it is held in z alone, and lets 0.33 m pass, by which it would slide in x."""
    state = done(FURNACE | {"edges": {"exit": {"fixed": ("z",)}}}).state
    assert state is not None
    assert [state.along(axis)[-1] for axis in "xz"] == pytest.approx([SPAN + 3.0, -2.0], abs=0.02)


def test_strip_that_hangs_passes_its_labels_at_its_own_speed() -> None:
    """Everywhere, whatever the labels hold: c (1 + ε)."""
    state = done(FURNACE).state
    assert state is not None and state.velocity is not None
    strip = state.plan.model.strip
    speeds = np.linalg.norm(strip.nodal(state.velocity)[strip.node_values], axis=1)
    assert np.ptp(state.controls["strip.growth"]) > 0.01
    assert speeds == pytest.approx(np.ones(len(speeds)), rel=1e-4)


@pytest.mark.slow
def test_a_line_whose_runs_hang_deeply_is_done() -> None:
    """50 m: without growth 3 236 tangents, 1.1 m of strip drawn from its end."""
    tables = copy.deepcopy(FURNACE)
    tables["threading"]["exit"] = (53.0, 0.0, -2.0)
    tables["rollers"][1]["centre"] = (50.0, 0.0, 0.0)
    run = done(tables)
    assert run.state is not None
    assert run.state.along("x")[-1] == pytest.approx(53.0, abs=0.05)
    assert run.state.along("z").min() == pytest.approx(-4.77, abs=0.02)
    assert run.cost.expansions < 600


def tensions(state: State, passages: Sequence[RollerPassage]) -> dict[str, float]:
    """At the entry, and along the strip beside given passages of rollers."""
    force, width = state.edge_force("entry"), state.plan.model.strip.width
    found = {"entry_tension": state.tension("entry")}
    for passage in passages:
        (name,) = passage.names
        for word, x, place in zip(("in", "out"), passage.arc, passage.places, strict=True):
            force = force + state.rollers[name].resultant * (word == "out")
            along = state.slope(place) / np.linalg.norm(state.slope(place))
            found[f"{name}_tension_{word}"] = (
                -float((force + state.weight_before(x)) @ along) / width
            )
    return found


@pytest.mark.parametrize("key", ["gravity", "exit.force", "strip.thickness"])
@pytest.mark.slow
def test_sensitivities_are_those_of_lines_whose_ends_stay(
    key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Differences of runs, in which strip hangs deeper or less; entry tensions else 20 % off."""
    run = done(FURNACE, STRICT)
    assert run.state is not None
    step = 2e-3 if key == "strip.thickness" else 1e-3  # above what is left of imbalance
    state, rows = corrected(run.state), []
    found = sensitivities(state, [False] * 2, run.assembly.hanging(state.plan))[key]
    mesh, growth = run.assembly.strip.mesh, run.assembly.growth
    problem, tension = "anmstrip.simulation.problem", run.assembly.scales.tension
    monkeypatch.setattr(Layout, "mesh", mesh)
    monkeypatch.setattr(f"{problem}.largest_force", lambda _: tension)
    monkeypatch.setattr(Assembly, "growth", growth)
    scale = {"gravity": 9.81, "exit.force": TENSION, "strip.thickness": 5e-4}[key]
    for changed in (scale * (1.0 - step), scale * (1.0 + step)):
        tables = copy.deepcopy(FURNACE)
        if key == "gravity":
            tables["stages"][0]["gravity"] = (0.0, 0.0, -changed)
        elif key == "exit.force":
            tables["stages"][0]["exit"] = {"tension": changed}
        else:
            tables["strip"]["thickness"] = changed
        changed_run = done(tables, STRICT)
        assert changed_run.state is not None
        rows.append(tensions(corrected(changed_run.state), state.passages))
    differences = {n: (rows[1][n] - rows[0][n]) / (2.0 * step * scale) for n in rows[0]}
    largest = max(map(abs, differences.values()))
    for name, difference in differences.items():
        assert found[name] == pytest.approx(difference, abs=1e-5 * largest), name


@pytest.mark.parametrize("at_once", [False, True], ids=["one after the other", "at once"])
def test_strip_is_hung_by_its_ends(at_once: bool) -> None:
    """An elastic catenary, whose weight is put on before, or while, its ends are brought together.

    H with x = H s/E t + 2 H/q asinh(q s/2H) between the ends of strip of the length s, and T = √(H²
    + (q s/2)²) there; on bending, D/T = 1 mm², nothing depends.
    """
    length, nearer, stiffness, q = 30.0, 0.3, 2e11 * 5e-4, WEIGHT
    course = [{"gravity": [0.0, 0.0, -9.81]}, {"exit": {"move": [-nearer, 0.0, 0.0]}}]
    course = [course[0] | course[1]] if at_once else course
    ends = {name: {"fixed": ["x", "z"]} for name in ("entry", "exit")}
    tables = {
        "strip": {"kinematics": "section", "length": length, "width": 1.0, "thickness": 5e-4},
        "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
        "edges": ends,
        "stages": [{"duration": 1.0, **stage} for stage in course],
    }
    *_, last = Scene.from_tables(tables, "hung.toml").run()

    def apart(h: float) -> float:
        return float(h * length / stiffness + 2.0 * h / q * np.arcsinh(0.5 * q * length / h))

    h = brentq(lambda h: apart(h) - (length - nearer), 1e2, 1e5)
    tension = np.hypot(h, 0.5 * q * length)
    assert last.state.tension("entry") == pytest.approx(tension, rel=1e-3)
    assert last.state.along("z").min() == pytest.approx((h - tension) / q, rel=1e-3)
    assert last.tangents <= 30


def supported(steady: bool, ahead: float, gravity: float = 9.81) -> dict[str, Any]:
    """A run of 16 m over three supports onto which weight alone presses it, and which run ahead."""
    supports = [
        {"name": f"h{k}", "radius": 0.1, "centre": (4.0 * k, 0.0, -0.1)} for k in range(1, 4)
    ]
    last = {"name": "out", "radius": 0.4, "centre": (16.0, 0.0, -0.4), "wrap": "over"}
    later = [] if steady else [{"name": "on", "duration": 0.2}]
    speeds = {each["name"]: {"surface_speed": 1.0 + ahead} for each in supports}
    return {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": 1e-3},
        "material": FURNACE["material"],
        "contact": {},
        "friction": {"coefficient": 0.2},
        "threading": {"tension": 1000.0, "entry": (0.0, 0.0, 0.0), "exit": (17.0, 0.0, -0.8)},
        "rollers": [*supports, last],
        "edges": FURNACE["edges"],
        "stages": [
            {"name": "weight", "friction": False, "gravity": (0.0, 0.0, -gravity)},
            {
                "name": "run",
                "steady": True,
                "strip": {"speed": 1.0},
                "rollers": {**speeds, "out": {"surface_speed": 1.0}},
            },
            *later,
        ],
    }


@pytest.mark.parametrize("steady", [True, False])
def test_supports_slip_by_what_they_run_ahead(steady: bool) -> None:
    """Labels of the run hold 1.005 times the strip, which passes them with as much less.

    It hangs between supports 4 m apart, and not over 16 m: by w² L³/24 T² = 14.0 mm each.
    """
    run = done(supported(steady, 5e-3))
    state, hanging = run.state, run.assembly.hanging(run.state.plan)
    assert state is not None and hanging is not None
    held = hanging.growth.held(hanging.centres, np.zeros(2), hanging.loads)
    w, tension = 77.009, 1e3 + 77.009 * 0.8  # at the height of the supports
    assert held[0] == pytest.approx(4.0 * w**2 * 4.0**3 / (24.0 * tension**2), rel=0.03)
    assert run.cost.expansions <= 300
    for name in ("h1", "h2", "h3"):
        reading = state.rollers[name]
        assert reading.max_slip == pytest.approx(5e-3, rel=0.02)
        assert reading.torque == pytest.approx(0.2 * reading.normal_force * 0.1, rel=0.01)


@pytest.mark.slow
def test_sensitivities_of_strip_on_supports(monkeypatch: pytest.MonkeyPatch) -> None:
    """Differences of runs on the same labels, by the laws of the first."""
    rows, step, settings = [], 1e-4, (STRICT, "friction.speed=2e-3")
    run = done(supported(True, 1e-5), *settings)
    assert run.state is not None
    state = corrected(run.state)
    found = sensitivities(state, [False] * 4, run.assembly.hanging(state.plan))["gravity"]
    mesh, growth, law = run.assembly.strip.mesh, run.assembly.growth, run.assembly.signorini
    monkeypatch.setattr(Layout, "mesh", mesh)
    monkeypatch.setattr(Assembly, "growth", growth)
    monkeypatch.setattr(Assembly, "signorini", law)
    for share in (1.0 - step, 1.0 + step):
        changed = done(supported(True, 1e-5, 9.81 * share), *settings).state
        assert changed is not None
        rows.append(tensions(corrected(changed), state.passages))
    for name in rows[0]:
        difference = (rows[1][name] - rows[0][name]) / (2.0 * step * 9.81)
        assert found[name] == pytest.approx(difference, rel=2e-3), name


@pytest.mark.slow
def test_a_strip_that_hangs_too_slack_is_told_its_least_tension() -> None:
    """Between rollers strip of weight q hangs under no less than the least of its catenaries.

    From a catenary that leaves rollers of radius r, l apart, at the angle θ it rises to their tops:
    T = q (a/cos θ + r (1 - cos θ)) with a arsinh tan θ = l/2 - r sin θ, and D/2r² as it is bent
    there.  On elements of half the length it is 0.4 % more than that.  The path does not go on
    beyond the state in which its stage began.
    """
    tables: dict[str, Any] = {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": 1e-4},
        "material": {"young": 7e10, "poisson": 0.33, "density": 2700.0},
        "friction": {"coefficient": 0.3},
        "threading": {"tension": 15.0, "entry": [-1.0, 0.0, -1.0], "exit": [4.0, 0.0, -1.0]},
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "rollers": [
            {"name": name, "radius": 0.3, "centre": [x, 0.0, -0.3], "wrap": "over"}
            for name, x in (("a", 0.0), ("b", 3.0))
        ],
        "stages": [
            {"name": "weight", "friction": False, "gravity": [0.0, 0.0, -9.81]},
            {"name": "slack", "friction": False, "exit": {"tension": 2.0}},
        ],
    }
    run = Scene.model_validate(tables).run()
    states = [step.state for step in run]
    found = re.search(r"limit point at t = (\S+) s with exit.tension of (\S+);", run.message)
    assert found is not None, run.message
    times = [state.time for state in states]
    last = states[times.index(max(times))]
    assert float(found[1]) == pytest.approx(last.time, abs=0.02)
    assert float(found[2]) == pytest.approx(15.0 - 13.0 * (float(found[1]) - 2.0), rel=0.01)

    def tension(angle: float) -> float:
        hanging = (1.5 - 0.3 * np.sin(angle)) / np.arcsinh(np.tan(angle)) / np.cos(angle)
        return float(2700.0 * 9.81 * 1e-4 * (hanging + 0.3 * (1.0 - np.cos(angle))))

    least = minimize_scalar(tension, bounds=(0.2, 1.4), method="bounded").fun
    least += 7e10 * 1e-12 / (12.0 * (1.0 - 0.33**2)) / (2.0 * 0.3**2)
    assert last.rollers["b"].tension_in == pytest.approx(least, rel=0.02)
    assert min(times[times.index(last.time) :]) > 1.95


def test_states_of_a_line_that_hangs_as_it_begins_are_in_balance() -> None:
    """What the sagging runs hold is kept with the weight that hangs them, before rollers turn."""
    rollers = [{"name": name, "radius": 0.3, "centre": [x, 0.0, -0.3], "wrap": "over"}
               for name, x in (("a", 0.0), ("b", 20.0))]  # fmt: skip
    scene = Scene(
        strip={"kinematics": "section", "width": 1.0, "thickness": 1e-3},
        material={"young": 2e11, "poisson": 0.3, "density": 7800.0},
        contact={},
        friction={"coefficient": 0.2},
        threading={"tension": 5e3, "entry": [-2.0, 0.0, -0.5], "exit": [22.0, 0.0, -0.5]},
        rollers=rollers,
        edges={"entry": {"fixed": ["x", "z"]}},
        stages=[{"name": "run", "steady": True, "gravity": [0.0, 0.0, -9.81],
                 "strip": {"speed": 1.0},
                 "rollers": {name: {"surface_speed": 1.0} for name in "ab"}}],
    )  # fmt: skip
    steps = [step for step in scene.run() if step.stage == "run"]
    assert len(steps) > 3
    for step in steps:
        assert step.residual < 1.1e-3
        assert step.state.tension("exit") == pytest.approx(5e3, rel=1e-4)


def hearth(**stage: Any) -> dict[str, Any]:
    """Strip on three driven rollers that it only touches, 1.5 m apart, in the middle of a crown."""
    rollers = [{"name": f"h{k}", "radius": 0.1, "centre": (1.5 * k, 0.0, -0.1), "wrap": "over",
                "crown": (0.0, -1.4e-3)} for k in range(3)]  # fmt: skip
    speeds = {each["name"]: {"surface_speed": 2.0} for each in rollers}
    return {
        "strip": {"kinematics": "shell", "width": 1.2, "thickness": 8e-4, "refined": 0.04},
        "material": {"young": 1.5e11, "poisson": 0.3, "density": 7800.0},
        "friction": {"coefficient": 0.25},
        "threading": {"tension": 4e3, "entry": (-1.5, 0.0, 0.0), "exit": (4.5, 0.0, 0.0)},
        "rollers": rollers,
        "edges": {"entry": {"centred": True}, "exit": {"fixed": ("z",)}},
        "stages": [
            {"name": "run", "steady": True, "gravity": (0, 0, -9.81), "rollers": speeds, **stage}
        ],
    }


def test_weight_is_put_on_where_points_come_to_bear_one_by_one() -> None:
    """Every roller bears the weight of half the runs beside it; 270 tangents on the usual mesh."""
    run = done(hearth(entry={"tension": 3975.0}))
    assert run.state is not None and run.cost.expansions <= 80
    load = 7800.0 * 8e-4 * 9.81 * 1.2 * 1.5
    for reading in run.state.rollers.values():
        assert reading.normal_force == pytest.approx(load, rel=0.02)


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_friction_by_weight_holds_what_pulls(share: float) -> None:
    """Rollers on which strip only lies hold f times its weight there, of 4.5 m of it."""
    held = 0.25 * 7800.0 * 8e-4 * 9.81 * 4.5
    told = explain(Scene.from_tables(hearth(entry={"tension": 4e3 - share * held}), "hearth.toml"))
    assert ("only friction holds" in told) == (share > 1.0)


def test_loops_begin_to_run_in_balance() -> None:
    """With the tension that they hang by; it was 85 kN/m, that of the line before it had weight."""
    xs = (0.0, 10.0, 20.0, 30.0)
    scene = Scene(
        strip={"kinematics": "section", "width": 1.0, "thickness": 5e-4},
        material={"young": 2e11, "poisson": 0.3, "density": 7850.0},
        friction={"coefficient": 0.2, "speed": 1e-4},
        threading={"tension": 500.0, "entry": [-3.0, 0.0, 0.0], "exit": [33.0, 0.0, 0.0]},
        rollers=[{"radius": 0.3, "centre": [x, 0.0, -0.3], "wrap": "over"} for x in xs],
        edges={"exit": {"fixed": ["z"]}},
        stages=[{"name": "run", "steady": True, "gravity": [0.0, 0.0, -9.81],
                 "entry": {"tension": 495.0},
                 "rollers": {f"r{k}": {"surface_speed": 1.0} for k in range(1, 5)}}],
    )  # fmt: skip
    run = scene.run()
    steps = [step for step in run if step.stage == "run"]
    assert run.outcome.done, run.message
    assert max(step.residual for step in steps) < 1.1e-3
    sag = steps[-1].state.along("z").min()
    assert sag == pytest.approx(-7850.0 * 5e-4 * 9.81 * 10.0**2 / (8.0 * 475.0), rel=0.05)


def test_rollers_on_which_strip_slips_both_ways_end_in_balance() -> None:
    """The middle of a crown drives strip on, its sides hold it back: torques are its change of T.

    Corrections turned back and forth: torques were up to 25 % wrong at the tolerance of 1e-3.
    """
    run = Scene.from_tables(hearth(entry={"tension": 3970.0}), "line.toml").run()
    *_, last = run
    assert run.outcome.done and last.residual < 1e-6
    for reading in last.state.rollers.values():
        drag = 1.2 * (reading.tension_in - reading.tension_out) * 0.1
        assert reading.torque == pytest.approx(drag, rel=0.02)  # radii differ by 0.5 %
    assert last.state.rollers["h2"].tension_out == pytest.approx(4e3, rel=1e-4)
