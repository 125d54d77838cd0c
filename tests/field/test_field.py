"""Thirty lines as an engineer would type them, run with all defaults, against statics.

Each scene says only what a drawing says: geometry, material, tensions, speeds, coefficient of
friction.  Its header says where the line is from, and what is expected and why; its check, below,
reads nothing but the run's files and knows nothing but closed forms (`field_statics.py`).  Every
run has a minute of one core.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from collections.abc import Callable
from itertools import pairwise
from math import cos, exp, pi, tan
from pathlib import Path

import numpy as np
import pytest

from field_line import Line
from field_statics import Circle, beam_on_supports, belt, bent_belt, capstan, catenary, normal_force

SCENES = {path.stem: path for path in sorted(Path(__file__).parent.glob("[0-9][0-9]_*.toml"))}

SECONDS = 600
"""Processor time at which a run is killed: ten times what a slow machine takes."""

RESTING = 15
"""Most tangents of a stage in which nothing moves."""

RUN = """
import resource, sys
resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv.pop(1)),) * 2)
from anmstrip.cli import main
sys.exit(main(sys.argv[1:]))
"""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def deflector_roll(line: Line) -> None:
    line.expect_ends(0.005, entry=2.0e4, exit=2.0e4)
    line.expect_travel(1.5)
    line.expect_speed(2.0)
    line.expect_idle("r1")
    line.expect_pressed(2.0e4)
    line.expect_wraps(2.0e4)


def snub_roll_held(line: Line) -> None:
    line.expect_slip_chain(exit=1.0e4)
    line.expect_wraps(1.0e4)


def s_wrap_bridle_slip(line: Line) -> None:
    line.expect_slip_chain(exit=1.0e4)


def four_roll_bridle(line: Line) -> None:
    line.expect_ends(0.005, entry=4.0e4, exit=1.0e4)
    line.expect_travel(0.75)
    line.expect_speed(1.0)
    for name, turn in zip(line.wrapped, line.straights(2.0e4).turns, strict=True):
        roll = line.roll(name)
        low, high = roll["tension_out"], roll["tension_in"]
        assert high > 0.98 * low, f"{name} brakes"
        # 2 %: the friction law, and bending's next order at 10 kN/m
        assert high < 1.02 * line.tight_side(low, name, turn), f"{name} holds too much"
    pulled = sum(abs(line.roll(name)["drag"]) for name in line.wrapped) / line.width
    assert abs(pulled / 3.0e4 - 1.0) < 0.02  # as much if a roll brakes by a hundredth of it


def drag_bars(line: Line) -> None:
    turns = dict(zip(line.wrapped, line.straights(3.0e4).turns, strict=True))
    for name, turn in turns.items():  # bars that stand hold back: the tight side is behind them
        roll = line.roll(name)
        behind = line.tight_side(roll["tension_in"], name, turn)
        assert abs(roll["tension_out"] / behind - 1.0) < 0.01, f"{name}: {roll}, not {behind} N/m"
    line.expect_slipping(*line.wrapped)
    line.expect_ends(0.01, entry=3.0e4 * exp(-line.friction * sum(turns.values())), exit=3.0e4)


def catenary_furnace(line: Line) -> None:
    tension = 6.4e3
    line.expect_ends(0.005, entry=tension, exit=tension)
    state = line.state()
    circles = [  # the straight parts of a bent strip pass a roll at this distance
        Circle(c.centre, c.radius + line.bending / (2.0 * tension * c.radius), c.sense)
        for c in line.circles()
    ]
    directrix = state.end("exit")[2] - tension / line.weight
    hung = catenary(*circles, directrix=directrix)
    between = (state.points[:, 0] > 0.5) & (state.points[:, 0] < 17.5)
    lowest = state.points[between, 2].min()
    sag = 0.5 - hung.lowest
    assert abs(lowest - hung.lowest) < 0.01 * sag, f"{lowest}, not {hung.lowest} m"
    # 1 %: read where contact begins and ends, some centimetres below the tops
    for name, top in (("left", 0.5), ("right", 1.5)):
        for side in ("tension_in", "tension_out"):
            expected = line.weight * (top - directrix)
            assert abs(line.roll(name)[side] / expected - 1.0) < 0.01


def zinc_pot(line: Line) -> None:
    line.expect_ends(0.005, entry=2.0e4, exit=2.0e4)
    line.expect_travel(1.0)
    line.expect_speed(2.0)
    line.expect_idle("sink", "correcting", "stabilising", share=0.02)
    line.expect_pressed(2.0e4, "sink")
    # 5 %: half the thickness on either side of 20 mm of deflection
    line.expect_pressed(2.0e4, "correcting", "stabilising", within=0.05)


def cooling_tower(line: Line) -> None:
    foot, weight, height = 1.0e4, line.weight, 30.0
    threaded = line.end_of("weight")
    top = foot + weight * height
    # the level run sags, and the arc's own weight presses: ∫ (T + w r n_z) + w r n_z over it
    turn = 0.5 * pi + 0.5 * weight * 5.0 / top
    expected = line.width * (turn * top + 2.0 * weight * 1.0)
    for name in ("first", "second"):
        assert abs(threaded[f"{name}_normal_force"] / expected - 1.0) < 0.015
    for edge in ("entry", "exit"):
        assert abs(threaded[f"{edge}_tension"] / foot - 1.0) < 0.005
    line.expect_travel(0.75)
    before, after = line.roll("first")["tension_in"], line.roll("second")["tension_out"]
    # 0.5 %: contact begins and ends up to λ = √(D/T) below the axes
    assert abs(before / top - 1.0) < 0.005
    assert abs(after / top - 1.0) < 0.005


def looper(line: Line) -> None:
    line.expect_ends(0.005, entry=1.5e4, exit=1.5e4)
    line.expect_travel(-1.2)
    line.expect_pressed(1.5e4, moved=True)
    line.expect_wraps(1.5e4, moved=True)


def dancer(line: Line) -> None:
    assert line.conveyed() == 0.0  # the entry is held: what comes in from the exit pulls it along
    assert abs(line.pulled() + 0.4) < 0.003
    line.expect_slipping("dancer", "g2")
    turns = dict(zip(line.wrapped, line.string(moved=True).turns, strict=True))
    behind = line.tight_side(2.0e3, "g2", turns["g2"])
    before = line.tight_side(behind, "dancer", turns["dancer"])
    assert abs(line.roll("g2")["tension_in"] / behind - 1.0) < 0.01
    assert abs(line.roll("dancer")["tension_in"] / before - 1.0) < 0.01
    through = before * exp(-line.friction * turns["g1"])
    assert 0.99 * through < line.tension("entry") < 1.01 * before


def billy_roll(line: Line) -> None:
    tension = 6.0e4
    line.expect_ends(0.005, entry=tension, exit=tension)
    left, right = line.circles()
    billy = Circle(complex(1.5, -0.02), 0.1, 1)
    entry, exit = line.ends
    turns = bent_belt(entry, [left, billy, right], exit, tension, line.bending).turns
    for name, turn in zip(line.rolls, turns, strict=True):
        radius = line.rolls[name]["radius"]
        expected = line.width * normal_force(tension, turn, line.bending, radius)
        # 2 %: slopes of 5 % in what is linear in them, and the mesh
        assert abs(line.roll(name)["normal_force"] / expected - 1.0) < 0.02, name


def film_drive(line: Line) -> None:
    line.expect_ends(0.005, entry=400.0, exit=100.0)
    # 1 %: what comes in is longer than unstressed strip by 400 N/m / Et, as is the span before
    line.expect_travel(1.8, within=0.01)
    speeds = [np.linalg.norm(line.state().end(e, "velocity")) for e in ("entry", "exit")]
    creep = (400.0 - 100.0) / line.stiffness
    # 3 %: the entry's 400 N/m are read 0.5 % right, the exit's 2 %
    assert abs((1.0 - speeds[1] / speeds[0]) / creep - 1.0) < 0.03, speeds


def coating_line(line: Line) -> None:
    line.expect_ends(0.005, entry=150.0, exit=200.0)
    line.expect_travel(0.9)
    line.expect_speed(1.0)
    tensions = [line.roll(name)["tension_in"] for name in line.wrapped]
    tensions.append(line.roll("r4")["tension_out"])
    assert abs(tensions[0] / 150.0 - 1.0) < 0.01
    assert abs(tensions[-1] / 200.0 - 1.0) < 0.01
    # rolls may pull against each other, by what creep makes of equal speeds
    assert all(0.97 * 150.0 < tension < 1.03 * 200.0 for tension in tensions), tensions
    for name, turn, (before, after) in zip(
        line.wrapped, line.string().turns, pairwise(tensions), strict=True
    ):
        held = capstan(min(before, after), line.friction, turn, 0.0, 1.0)
        assert max(before, after) < 1.01 * held, f"{name} holds too much"


def paper_emergency_stop(line: Line) -> None:
    line.expect_travel(1.5)
    line.expect_speed(0.0)
    for row in line.history:
        if row["stage"] in ("run", "stop"):
            for edge in ("entry", "exit"):
                assert abs(row[f"{edge}_tension"] / 250.0 - 1.0) < 0.01, row
    line.expect_pressed(250.0)


def aluminium_foil(line: Line) -> None:
    line.expect_slip_chain(exit=1.0e3)
    assert abs(line.tension("entry") / 1.0e3 / exp(0.3 * pi) - 1.0) < 0.01


def plate_on_roller_table(line: Line) -> None:
    lying = line.end_of("weight")
    places = [roll["centre"][0] for roll in line.rolls.values()]
    _, *expected = beam_on_supports((-2.0, 2.0), places, line.weight, line.bending, 6.0e3)
    mean = line.weight * 4.0 / 4.0
    for name, reaction in zip(line.rolls, expected, strict=True):
        found = lying[f"{name}_normal_force"] / line.width
        # 5 % of a mean load: a plate bent by millimetres touches beside the top
        assert abs(found - reaction) < 0.05 * mean, f"{name} bears {found}, not {reaction} N/m"
    pushed = sum(line.roll(name)["normal_force"] for name in line.rolls)
    pulled = sum(line.summary["edges"][edge]["force"][2] for edge in ("entry", "exit"))
    # 1 %: normals lean by some hundredths, and friction pulls along the slope
    assert abs((pushed + pulled) / (line.weight * 4.0 * line.width) - 1.0) < 0.01
    line.expect_travel(0.375)
    line.expect_speed(0.5)


def raised_roller(line: Line) -> None:
    # the pull stays level at 40 kN/m, so that the tension is that over the slope's cosine
    right = line.state().end("exit")[0]
    lifted = Circle(complex(0.0, -0.12), 0.2, 1)
    path = bent_belt(-2.0, [lifted], complex(right, 0.0), 4.0e4, line.bending)
    slope = 0.5 * path.turns[0]
    expected = 2.0 * 4.0e4 * tan(slope) * line.width
    # 2 %: half the thickness is 1.25 % of 80 mm
    assert abs(line.roll("r1")["normal_force"] / expected - 1.0) < 0.02
    line.expect_ends(0.005, entry=4.0e4 / cos(slope), exit=4.0e4 / cos(slope))


def press_roll(line: Line) -> None:
    tension, right = 3.0e4, line.state().end("exit")[0]
    rolls = [Circle(complex(x, -0.15), 0.15, 1) for x in (-1.0, 1.0)]
    pressed = Circle(complex(0.0, 0.18 - 0.13), 0.15, -1)
    way = [rolls[0], pressed, rolls[1]]
    turns = bent_belt(-2.5, way, complex(right, 0.0), tension, line.bending).turns
    after = tension * exp(line.friction * turns[2])
    before = after * exp(line.friction * turns[1])
    assert abs(line.roll("hold_down")["tension_out"] / after - 1.0) < 0.01
    assert abs(line.roll("hold_down")["tension_in"] / before - 1.0) < 0.01
    assert 0.99 * tension < line.tension("entry") < 1.01 * before
    line.expect_slipping("hold_down", "right")
    expected = line.width * normal_force(
        0.5 * (before + after), turns[1], line.bending, pressed.radius
    )
    # 3 %: twice half the thickness is 1.5 % of 100 mm, slopes of 10 % in what is linear in them
    assert abs(line.roll("hold_down")["normal_force"] / expected - 1.0) < 0.03


def reversing_strip(line: Line) -> None:
    line.expect_ends(0.005, entry=2.5e4, exit=2.5e4)
    gone = max(line.conveyed(row["time"]) for row in line.history if row["stage"] != "threading")
    assert abs(gone / 0.55 - 1.0) < 0.02  # read at an instant next to that of turning
    assert abs(line.conveyed()) < 0.005 * gone
    line.expect_idle("left", "right", share=0.02)


def bridle_stop_rest(line: Line) -> None:
    line.expect_ends(0.005, entry=1.2e4, exit=1.0e4)
    line.expect_travel(0.9)
    assert abs(line.conveyed() - line.conveyed(1.5 + 1e-9)) < 1e-3
    assert line.tangents("rest") <= RESTING


def tension_step_rest(line: Line) -> None:
    line.expect_ends(0.005, exit=1.3e4)
    # 2 %: what a regularised law lets through of a rise of 8 % while it creeps
    assert 0.995 * 1.2e4 < line.tension("entry") < 1.02 * 1.2e4
    assert line.tangents("rest") <= RESTING


def break_out(line: Line) -> None:
    line.expect_ends(0.005, exit=1.0e3)
    turns = line.straights(1.0e3).turns
    held = 1.0e3 * exp(line.friction * sum(turns))
    # 2 %: the law, and turns of a strip that is stiff under so little tension
    assert 0.99 * 1.0e3 < line.tension("entry") < 1.02 * held


def profiled(line: Line, tension: float, difference: float) -> None:
    """Middle above edges, symmetric, mean as pulled; `difference` of radii (m)."""
    line.expect_ends(0.005, entry=tension, exit=tension)
    y, force = line.state().across("membrane_force", 0.0)
    # 2 %: what pictures lose between elements
    assert np.abs(force - np.interp(-y, y, force)).max() < 0.02 * tension
    mean = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(y)) / np.ptp(y))
    # 2 %: with bending's part of the membrane force on an arc, 3 D/2R²
    assert abs(mean / tension - 1.0) < 0.02
    most = line.stiffness * difference / line.rolls["r1"]["radius"]
    above = force[np.argmin(np.abs(y))] - 0.5 * (force[0] + force[-1])
    assert 0.1 * most < above < most, f"{above} of {most} N/m"


def crowned_roll(line: Line) -> None:
    profiled(line, 1.6e4, 1.6e-4 * 0.5**2)


def misaligned_roll(line: Line) -> None:
    line.expect_travel(0.2)

    def place(time: float | None) -> float:
        state = line.state(time)
        near = np.hypot(state.points[:, 0], state.points[:, 2] + 0.4) < 0.4 * 1.01
        return float(state.fields["displacement"][near, 1].mean())

    walked = place(None) - place(1.0 - 1e-9)
    # less than it sticks, by the slope that the strip has won: y/L × 3/2, a tenth in the end
    assert -1.05 * 4.0e-4 < walked < -0.8 * 4.0e-4, f"{walked} m"


def conical_sides(line: Line) -> None:
    profiled(line, 9.0e3, 2.0e-4 * (0.25 - 0.1))


def titanium_pull_back(line: Line) -> None:
    line.expect_slip_chain(exit=2.4e4)
    line.expect_wraps(2.4e4)


def copper_overspeed(line: Line) -> None:
    line.expect_slip_chain(exit=3.0e3)
    line.expect_travel(0.4)


def annealing_furnace(line: Line) -> None:
    line.expect_ends(0.005, entry=6.0e3, exit=6.0e3)
    line.expect_idle(*line.wrapped, share=0.05)
    line.expect_pressed(6.0e3, within=0.03)  # of a tension that may differ by some hundredths
    line.expect_wraps(6.0e3)
    line.expect_speed(1.0)


def standing_line(line: Line) -> None:
    line.expect_ends(0.002, entry=1.4e4, exit=1.4e4)
    line.expect_idle("upper", "lower", share=0.005)
    line.expect_pressed(1.4e4)
    upper, lower = (line.roll(name)["normal_force"] for name in line.wrapped)
    assert abs(upper / lower - 1.0) < 0.005
    assert line.tangents("hold") <= RESTING


def symmetric_pull(line: Line) -> None:
    line.expect_ends(0.005, entry=1.2e4, exit=1.2e4)
    a, b = line.roll("a"), line.roll("b")
    assert abs(a["normal_force"] / b["normal_force"] - 1.0) < 0.005
    assert abs(abs(a["drag"]) - abs(b["drag"])) < 0.005 * 1.2e4 * line.width
    line.expect_idle("m", share=0.005)
    assert 0.99 * 1.0e4 < a["tension_out"] < 1.1e4


CHECKS: dict[str, Callable[[Line], None]] = {
    name: globals()[name.partition("_")[2]] for name in SCENES
}


def test_thirty_scenes_are_bare_and_explained() -> None:
    """Nothing numerical is typed, and each header says what is expected."""
    assert len(SCENES) == 30
    allowed = {
        "strip": {"kinematics", "length", "width", "thickness", "feed"},
        "contact": set(),
        "friction": {"coefficient"},
        "threading": {"tension", "entry", "exit"},
    }
    for name, path in SCENES.items():
        text = path.read_text(encoding="utf8")
        scene = tomllib.loads(text)
        assert text.startswith("# "), name
        assert "\n# Expected: " in text, name
        assert not {"solver", "output"} & scene.keys(), name
        for table, keys in allowed.items():
            assert scene.get(table, {}).keys() <= keys, (name, table)


def test_statics() -> None:
    """The closed forms agree with what can be said without them."""
    half = belt(-1.0 + 1j, [Circle(0j, 1.0, 1)], -1.0 - 1j)
    assert half.turns[0] == pytest.approx(pi)
    crossed = belt(-2.0 + 1j, [Circle(0j, 1.0, 1), Circle(2.0 - 2j, 1.0, -1)], 4.0 - 3j)
    assert crossed.turns == pytest.approx((0.5 * pi, 0.5 * pi))
    assert crossed.runs == pytest.approx((2.0, 2.0, 2.0))
    assert capstan(1.0, 0.3, pi, 0.0, 1.0) == pytest.approx(exp(0.3 * pi))
    for turn in (0.19, 0.2, 0.21):  # from a line to an arc without a jump
        assert normal_force(1.0, turn, 0.01, 1.0) == pytest.approx(turn, rel=2e-3)
    hung = catenary(Circle(0j, 1e-6, 1), Circle(10.0 + 0j, 1e-6, 1), -50.0)
    assert hung.middle == pytest.approx(5.0)
    assert hung.lowest == pytest.approx(-(10.0**2) / 8.0 / 50.0, rel=0.01)
    # three equal spans, pinned and propped: 0.4, 1.1, 1.1, 0.4 of a span's load
    reactions = beam_on_supports((0.0, 3.0), [1.0, 2.0, 3.0], 1.0, 1.0, 0.0)
    assert reactions == pytest.approx([0.4, 1.1, 1.1, 0.4], abs=1e-6)


@pytest.mark.slow
@pytest.mark.field
@pytest.mark.parametrize("name", SCENES)
def test_scene_ends_right_at_the_first_run(name: str, tmp_path: Path) -> None:
    """Exit status 0, and right by statics."""
    command = [sys.executable, "-c", RUN, str(SECONDS), "run", str(SCENES[name])]
    finished = subprocess.run(
        [*command, "-o", str(tmp_path), "--quiet"],
        env=os.environ | dict.fromkeys(THREADS, "1"),
        capture_output=True,
        text=True,
        check=False,
    )
    ending = "took more than its time" if finished.returncode < 0 else finished.stderr[-2000:]
    assert finished.returncode == 0, ending
    line = Line(SCENES[name], tmp_path)
    line.expect_sound()
    CHECKS[name](line)
