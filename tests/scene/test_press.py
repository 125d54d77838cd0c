"""Rollers that given forces press on the strip, as those of nips by their cylinders."""

from __future__ import annotations

import copy
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista

from anmstrip.advice.physics import largest_held_tension, pulled_at_both_ends
from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import warnings
from anmstrip.driver.explain import explain
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.driver.sensitivities import sensitivities
from anmstrip.errors import InputError
from anmstrip.results.state import State
from anmstrip.simulation.problem import Assembly

PULL, PRESS, COEFFICIENT = 2000.0, 5000.0, 0.3
THICKNESS = 1e-3

PINCH: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 1.0, "thickness": THICKNESS},
    "material": {"young": 2.1e11, "poisson": 0.3},
    "friction": {"coefficient": COEFFICIENT},
    "threading": {"tension": PULL, "entry": [-1.0, 0.0, 0.0], "exit": [2.0, 0.0, -0.1]},
    "rollers": [
        {"name": "bottom", "radius": 0.15, "centre": [0.0, 0.0, -0.1505], "wrap": "over"},
        {"name": "top", "radius": 0.15, "centre": [0.0, 0.0, 0.1605], "press": PRESS},
    ],
    "stages": [
        {
            "name": "start", "duration": 1.0, "entry": {"release": True, "tension": PULL},
            "rollers": {"bottom": {"surface_speed": 1.0}, "top": {"surface_speed": 1.0}},
        },
        {
            "name": "pull", "duration": 1.0, "exit": {"tension": 3000.0},
            "rollers": {"top": {"press": 2.0 * PRESS}},
        },
    ],
}  # fmt: skip
"""Pinch rolls as drawn, the upper one 10 mm open."""

LEVEL = {**PINCH, "threading": {"tension": PULL, "entry": [-1.0, 0.0, 0.0], "exit": [2.0, 0, 0]}}
"""The same in a straight line, with the top of the lower one at the lower face of the strip."""

SNUBBER: dict[str, Any] = {
    **PINCH,
    "threading": {"tension": 1e4, "entry": [-1.5, 0.0, 0.4], "exit": [-1.5, 0.0, -0.4]},
    "rollers": [
        {"name": "drum", "radius": 0.4, "centre": [0.0, 0.0, 0.0], "wrap": "over"},
        {
            "name": "snubber", "radius": 0.1, "centre": [0.55, 0.0, 0.0], "drive": "idle",
            "press": 2e4,
        },
    ],
    "stages": [
        {
            "name": "run", "steady": True, "rollers": {"drum": {"surface_speed": 2.0}},
            "entry": {"tension": 1e4}, "exit": {"tension": 1.4e4},
        },
        {"name": "less", "steady": True, "rollers": {"snubber": {"press": 4e3}}},
    ],
}  # fmt: skip
"""A roll that holds the strip down on a drum."""

FLAT: dict[str, Any] = {
    **PINCH,
    "strip": {"kinematics": "shell", "length": 1.0, "width": 0.2, "thickness": THICKNESS},
    "rollers": [
        {"name": "low", "radius": 0.1, "centre": [0.0, 0.0, -0.1005]},
        {
            "name": "top", "radius": 0.08, "centre": [0.0, 0.0, 0.12], "drive": "idle",
            "press": 1500.0,
        },
    ],
    "edges": {"entry": {"fixed": ["x", "y", "z"]}, "exit": {"fixed": ["y", "z"]}},
    "stages": [
        {"name": "pull", "friction": False, "exit": {"force": [2000.0, 0.0, 0.0]}},
        {
            "name": "drive", "duration": 1.0, "rollers": {"low": {"surface_speed": 1.0}},
            "entry": {"release": True, "force": [-1800.0, 0.0, 0.0]},
            "exit": {"force": [1400.0, 0.0, 0.0]},
        },
    ],
}  # fmt: skip
del FLAT["threading"]
FLAT["solver"] = {"tolerance": 1e-5}
"""Straight strip that pinch rolls draw through."""


def states(scene: Scene, directory: Path | None = None) -> list[State]:
    """All accepted states of a run that ends."""
    run = scene.run(directory) if directory else Run(scene)
    found = [step.state for step in run]
    assert run.outcome.done, run.message
    return found


def pressing(state: State, roller: str) -> float:
    """Force (N) on the strip by a roller, towards the one across."""
    other = next(name for name in state.contacts if name != roller)
    way = state.centre(other) - state.centre(roller)
    return float(state.contacts[roller].resultant @ way / np.linalg.norm(way))


@pytest.mark.parametrize(
    ("tables", "roller", "forces"),
    [
        (PINCH, "top", {"threading": 5e3, "start": 5e3, "pull": 1e4}),
        (LEVEL, "top", {"threading": 5e3, "start": 5e3, "pull": 1e4}),
        (SNUBBER, "snubber", {"threading": 2e4, "run": 2e4, "less": 4e3}),
        (FLAT, "top", {"pull": 1500.0, "drive": 1500.0}),
    ],
    ids=["pinch", "level", "snubber", "flat"],
)
def test_the_force_is_what_is_given(
    tables: dict[str, Any], roller: str, forces: dict[str, float]
) -> None:
    """In every state, between the stages linear as all that changes."""
    ends = dict[str, float]()
    for state in states(Scene.model_validate(copy.deepcopy(tables))):
        now = pressing(state, roller)
        given = float(state.controls[f"rollers.{roller}.press"])
        assert now == pytest.approx(given, rel=1e-5, abs=0.5)  # of 400 N by which it is pulled
        ends[state.plan.name] = now
    assert ends == pytest.approx(forces, rel=1e-5)


def test_what_it_presses_on_bears_it_beside_the_tension() -> None:
    """Statics: the forces of both, and of the tensions by their directions, are in balance."""
    last = states(Scene.model_validate(PINCH))[-1]
    low, top = (last.contacts[name].resultant for name in ("bottom", "top"))
    ends = last.edge_force("entry") + last.edge_force("exit")
    assert low + top == pytest.approx(-ends, abs=1.0)
    assert low[2] == pytest.approx(1e4 + 3000.0 * 0.05, rel=3e-3)


def drawn_through(pull: float, **solver: Any) -> Run:
    """Pinch rolls that stop strip which is pulled away at its exit (N/m)."""
    tables = copy.deepcopy(PINCH)
    tables["stages"][1] = {"name": "pull", "duration": 1.0, "exit": {"tension": pull}}
    tables["solver"] = solver
    run = Run(Scene.model_validate(tables))
    for _ in run:
        pass
    return run


def test_friction_of_the_force_is_the_limit() -> None:
    """Coulomb: both rollers hold 2 f F, and the wrap f T θ beside it."""
    limit = PULL + 2.0 * COEFFICIENT * PRESS
    held, lost = drawn_through(0.97 * limit), drawn_through(1.03 * limit, max_tangents=60)
    assert held.outcome.done, held.message
    assert not lost.outcome.done
    told = {pull: " ".join(warned(drawn(pull))) for pull in (0.8 * limit, 1.03 * limit)}
    assert "runs away" not in told[0.8 * limit]
    assert "runs away" not in " ".join(warned(drawn(0.8 * limit, "contact.faces=false")))
    assert "the strip runs away. Try" in told[1.03 * limit]
    assert "may run away. Try" in " ".join(warned(drawn(0.97 * limit)))
    (key, force) = re.findall(r"--set (rollers\.top\.press)=(\d+)", told[1.03 * limit])[0]
    scene = drawn(1.03 * limit, f"{key}={force}")
    assert "runs away" not in " ".join(warned(scene))
    assert states(scene)


def drawn(pull: float, *settings: str) -> Scene:
    """The scene of such a pull (N/m)."""
    tables = copy.deepcopy(PINCH)
    tables["stages"][1] = {"name": "pull", "duration": 1.0, "exit": {"tension": pull}}
    return Scene.from_tables(tables, "pinch.toml", settings)


def warned(scene: Scene) -> list[str]:
    """All warnings before a run."""
    return warnings(Preview.of(Assembly(scene)))


def test_torques_of_pinch_rolls_hold_what_their_force_lets_them() -> None:
    """Rolls with 150 N m each on radii of 0.15 m add 2 000 N/m, of 3 000 that friction bears."""
    tables = copy.deepcopy(PINCH)
    for roller in tables["rollers"]:
        roller["drive"] = "torque"
    both = {name: {"torque": 150.0} for name in ("bottom", "top")}
    tables["stages"] = [
        {"name": "run", "steady": True, "strip": {"speed": 1.0}, "exit": {"tension": PULL}}
    ]
    tables["stages"][0]["rollers"] = both
    scene = Scene.model_validate(tables)
    (*_, last) = states(scene)
    assert last.tension("entry") == pytest.approx(PULL + 2000.0, rel=1e-3)
    assert all(r.torque == pytest.approx(150.0) for r in last.rollers.values())
    assert not any("turns through" in line for line in warned(scene))
    for control in both.values():
        control["torque"] = 260.0  # of 225 N m by the force, and 4.5 by the wrap
    told = [line for line in warned(Scene.model_validate(tables)) if "turns through" in line]
    assert len(told) == 2 and "in its nip, which is 2.3e+02 N m" in told[0]


@pytest.mark.parametrize(("torque", "pull"), [(20.0, 1780.0), (20.0, 1950.0), (70.0, 1780.0)])
def test_what_torques_in_a_nip_hold_is_told(torque: float, pull: float) -> None:
    """20 N m on 0.1 m and a width of 0.5 m hold 400 N/m, and bearings 100 more or less.

    Of the 1 400 N/m that 70 N m make friction bears 900.
    """
    tables = copy.deepcopy(FLAT)
    tables["strip"]["width"] = 0.5
    low, _ = tables["rollers"]
    low["drive"], low["bearing"] = "torque", 5.0
    stage = tables["stages"][1]
    stage["entry"]["force"], stage["rollers"] = [-pull, 0.0, 0.0], {"low": {"torque": torque}}
    preview = Preview.of(Assembly(Scene.model_validate(tables)))
    assert ("runs away" not in " ".join(warnings(preview))) is ((torque, pull) == (20.0, 1780.0))
    (pulled,) = pulled_at_both_ends(preview)
    most = {20.0: 1400.0 + 400.0 + 100.0, 70.0: 1400.0 + 900.0}
    assert largest_held_tension(preview, "entry", pulled) == pytest.approx(most[torque], rel=1e-3)


@pytest.mark.parametrize("tables", [PINCH, SNUBBER], ids=["pinch", "snubber"])
def test_the_force_goes_with_no_mesh_and_no_law(tables: dict[str, Any]) -> None:
    """Tensions and forces are the same on a mesh twice as fine, and by a law half as wide."""
    read = []
    for strip, contact in (({}, {}), ({"finer": 2.0}, {}), ({}, {"onset": 1e-5})):
        made = copy.deepcopy(tables)
        made["strip"] |= strip
        made["contact"] = contact
        last = states(Scene.model_validate(made))[-1]
        forces = [roller.normal_force for roller in last.rollers.values()]
        read.append(np.array([*forces, last.tension("entry"), last.tension("exit")]))
    for other in read[1:]:
        assert other == pytest.approx(read[0], rel=1e-3)


def test_how_far_it_is_drawn_open_does_not_matter() -> None:
    lasts = []
    for height in (0.1505, 0.1605, 0.3):
        tables = copy.deepcopy(PINCH)
        tables["rollers"][1]["centre"] = [0.0, 0.0, height]
        lasts.append(states(Scene.model_validate(tables))[-1])
    for one, other in pairwise(lasts):
        assert one.centre("top") == pytest.approx(other.centre("top"), abs=1e-12)
        assert one.full == pytest.approx(other.full, abs=1e-9)


def test_the_picture_has_it_where_it_is(tmp_path: Path) -> None:
    """Closer by the way on which the pressure of its force is that of the law."""
    *_, last = states(Scene.model_validate(PINCH), tmp_path)
    files = sorted((tmp_path / "rollers").glob("*.vtu")) or sorted(tmp_path.rglob("rollers_*.vtu"))
    points = np.asarray(pyvista.read(files[-1]).points)
    low, top = points[points[:, 2] < 0.0], points[points[:, 2] > 0.0]
    apart = top[:, 2].mean() - low[:, 2].mean()
    assert apart == pytest.approx((last.centre("top") - last.centre("bottom"))[2], abs=1e-7)
    assert last.contact is not None
    law, squeeze = last.contact.signorini, 0.3 + THICKNESS - apart
    x = np.linspace(-0.02, 0.02, 20_001)
    borne = np.trapezoid(law(0.5 * (x**2 / 0.15 - squeeze)), x)  # by straight strip
    assert borne == pytest.approx(2.0 * PRESS, rel=0.03)


def test_sensitivity_to_the_force() -> None:
    """Against the difference of two runs on the same mesh, with the same laws."""

    def last(press: float) -> State:
        tables = copy.deepcopy(SNUBBER)
        tables["stages"][1]["rollers"]["snubber"]["press"] = press
        tables["solver"] = {"tolerance": 1e-8}
        del tables["stages"][0]["entry"]
        tables["stages"][0]["strip"] = {"speed": 1.99}  # it slips all along
        return states(Scene.model_validate(tables))[-1]

    step = 20.0
    more, less = last(4e3 + step), last(4e3 - step)
    found = sensitivities(last(4e3), (False, False))["rollers.snubber.press"]
    for end in ("entry", "exit"):
        slope = (more.tension(end) - less.tension(end)) / (2.0 * step)
        assert found[f"{end}_tension"] == pytest.approx(slope, abs=2e-5)
    torque = (more.rollers["drum"].torque - less.rollers["drum"].torque) / (2.0 * step)
    assert found["drum_torque"] == pytest.approx(torque, abs=2e-5)
    assert abs(torque) > 0.05


def test_the_same_line_in_millimetres() -> None:
    """As many tangents, and the same force."""
    made = copy.deepcopy(PINCH)
    large, per_area = 1e3, 1e-6
    made["strip"] |= {"width": large, "thickness": THICKNESS * large}
    made["material"]["young"] *= per_area
    course = made["threading"]
    course |= {end: [large * c for c in course[end]] for end in ("entry", "exit")}
    course["tension"] /= large
    for roller in made["rollers"]:
        roller |= {"radius": large * roller["radius"]}
        roller["centre"] = [large * c for c in roller["centre"]]
    start, pull = made["stages"]
    start["entry"]["tension"] /= large
    pull["exit"]["tension"] /= large
    start["rollers"] = {name: {"surface_speed": large} for name in ("bottom", "top")}
    runs = [Run(Scene.model_validate(tables)) for tables in (PINCH, made)]
    for run in runs:
        for _ in run:
            pass
    first, second = runs
    assert first.cost.expansions == second.cost.expansions
    assert first.state is not None and second.state is not None
    forces = [run.contacts["top"].resultant for run in (first.state, second.state)]
    assert forces[1] == pytest.approx(forces[0], rel=1e-4, abs=1e-2)


def test_explain_tells_it() -> None:
    words = explain(Scene.model_validate(PINCH))
    assert "pressed with 5000 N" in words and "rollers.top.press" in words
    assert "leave a gap" not in words


@pytest.mark.parametrize(
    ("change", "key", "expected"),
    [
        (
            {"rollers.0.axis": [1.0, 1.0, 0.0], "rollers.0.wrap": None},
            "rollers.top.press", "without a parallel roller on the other side",
        ),
        ({"rollers.0.press": 10.0}, "rollers.bottom.press", "beside which top is to press"),
        (
            {"rollers.0.press": 10.0, "rollers.0.wrap": None}, "rollers.top.press",
            "against which it presses, is pressed itself",
        ),
        (
            {"stages.0.rollers.top.move": [0.0, 0.0, -1e-3]}, "stages.start.rollers.top.move",
            "rollers.top.press says where it is",
        ),
        (
            {"stages.0.rollers.bottom.move": [0.0, 0.0, 1e-3]}, "stages.start.rollers.bottom.move",
            "rollers.top.press says where it is",
        ),
        ({"rollers.1.press": None}, "stages.pull.rollers.top.press", "says with what it begins"),
        ({"rollers.1.press": -5.0}, "rollers.top.press", "above 0"),
        ({"rollers.1.press": "5 kN"}, "rollers.top.press", "a number, without quotes and unit"),
    ],
)  # fmt: skip
def test_what_cannot_be_pressed_is_refused(change: dict[str, Any], key: str, expected: str) -> None:
    tables: Any = copy.deepcopy(PINCH)
    for path, value in change.items():
        *way, last = path.split(".")
        table = tables
        for part in way:
            table = table[int(part)] if isinstance(table, list) else table[part]
        if value is None:
            del table[last]
        else:
            table[last] = value
    with pytest.raises(InputError) as caught:
        Scene(**tables)
    found = {mistake.key: mistake for mistake in caught.value.mistakes}
    assert expected in found[key].expected
    assert found[key].hint
    if found[key].value == "5 kN":
        assert found[key].hint == "press = 5000.0"


def test_tandem_pinch_rolls_press_on_the_rollers_below() -> None:
    """Drawn so far open that their neighbour on the same side is nearer."""
    tables = copy.deepcopy(FLAT)
    low, top = tables["rollers"]
    tables["rollers"] = [
        {**roller, "name": f"{roller['name']}{k}", "centre": [x, 0.0, z]}
        for k, x in enumerate((-0.11, 0.11))
        for roller, z in ((low, -0.1005), (top, 0.2))
    ]
    tables["strip"]["kinematics"] = "section"
    tables["stages"][1]["rollers"] = {f"low{k}": {"surface_speed": 1.0} for k in range(2)}
    *_, last = states(Scene.model_validate(tables))
    forces = [last.rollers[f"top{k}"].normal_force for k in range(2)]
    assert forces == pytest.approx([1500.0, 1500.0], rel=3e-3)


def test_strip_has_to_run_between_them() -> None:
    tables = copy.deepcopy(PINCH)
    tables["rollers"][1]["centre"] = [0.0, 0.0, -0.5]
    with pytest.raises(InputError, match="strip that runs between top and bottom"):
        explain(Scene.model_validate(tables))


def test_the_roller_across_has_to_touch_flat_strip() -> None:
    """The pressed one, which closes onto it, was told to be inside the strip."""
    tables = copy.deepcopy(FLAT)
    tables["rollers"][0]["centre"][2] = -0.106
    with pytest.raises(InputError) as caught:
        explain(Scene.from_tables(tables, "flat.toml"))
    (mistake,) = caught.value.mistakes
    assert mistake.key == "rollers.low.centre" and "which top presses on it" in mistake.expected
    words = f"rollers.low.{mistake.hint.replace(' ', '')}"
    scene = Scene.from_tables(tables, "flat.toml", [words])
    assert scene.rollers[0].centre == (0.0, 0.0, -0.1005)
    explain(scene)


def test_the_force_that_is_told_of_a_gap_can_be_typed() -> None:
    """The run with it ends, and has it."""
    tables = copy.deepcopy(SNUBBER)
    tables["rollers"][1] |= {"centre": [0.5009, 0.0, 0.0]}
    del tables["rollers"][1]["press"]
    del tables["stages"][1]
    scene = Scene.from_tables(tables, "drum.toml")
    (words,) = (line for line in warned(scene) if "nip" in line)
    key, force = re.findall(r"To give it instead, --set (\S+)=(\S+)\.$", words)[0]
    *_, last = states(Scene.from_tables(tables, "drum.toml", [f"{key}={force}"]))
    assert key == "rollers.snubber.press"
    assert pressing(last, "snubber") == pytest.approx(float(force), rel=1e-5)


def test_a_resumed_run_ends_in_the_same_state(tmp_path: Path) -> None:
    scene = Scene.model_validate(PINCH)
    *_, whole = states(scene)
    run = scene.run(tmp_path)
    for number, _ in enumerate(run):
        if number == 15:
            break
    run.interrupted()
    *_, step = scene.run(tmp_path, resume=True)
    np.testing.assert_array_equal(step.state.full, whole.full)


def test_what_presses_on_a_drum_does_not_hide_the_rest_of_its_wrap() -> None:
    """Foil on half a turn under two rolls: its lift-on was read at the first of them, 13° in.

    The tension before the drum was 487 N/m for 500, its line load there 441 N/m for some 2.
    """
    tables = copy.deepcopy(SNUBBER)
    tables["strip"] |= {"width": 0.6, "thickness": 50e-6}
    tables["material"] = {"young": 7e10, "poisson": 0.33}
    ends = {"entry": [-1.0, 0.0, 0.3], "exit": [-1.0, 0.0, -0.3]}
    tables["threading"] = {"tension": 500.0, **ends}
    drum = {"name": "drum", "radius": 0.3, "centre": [0.0, 0.0, 0.0], "wrap": "over"}
    idle = {"radius": 0.06, "drive": "idle"}
    up = {"name": "up", "centre": [0.1, 0.0, 0.4], "press": 200.0, **idle}
    down = {"name": "down", "centre": [0.1, 0.0, -0.4], "press": 100.0, **idle}
    tables["rollers"] = [drum, up, down]
    tables["stages"] = [tables["stages"][0]]
    tables["stages"][0] |= {"entry": {"tension": 500.0}, "exit": {"tension": 800.0}}
    tables["contact"] = {"onset": 2.7e-7}  # by default loads are spread over more than bends
    *_, last = states(Scene.model_validate(tables))
    read = last.rollers["drum"]
    assert (read.tension_in, read.tension_out) == pytest.approx((500.0, 800.0), rel=1e-3)
    assert np.degrees(read.wrap) == pytest.approx(180.0, abs=1.0)
    assert read.line_load_in is not None and read.line_load_in < 5.0
    assert [pressing(last, name) for name in ("up", "down")] == pytest.approx([200.0, 100.0])
