"""Runs that stop early: what they say, and what they leave."""

from __future__ import annotations  # noqa: I001

import copy
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from test_forewarnings import BRIDLE

from anmstrip.continuation.path import Evidence, NO_EVIDENCE, Outcome, PathStopped
from anmstrip.driver import budget
from anmstrip.advice.diagnosis import Failure, diagnosis, forewarned, slack, turning_point
from anmstrip.advice.preview import Preview
from anmstrip.driver.explain import report
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.results import files as checkpoint
from anmstrip.results import files as history
from anmstrip.results.vtk import read_collection as listed
from anmstrip.results.vtk import read_surface
from anmstrip.scene.schema import Override
from anmstrip.simulation import march as running

TENSION = {
    "name": "tension", "duration": 1.0, "friction": False, "exit": {"force": [1e4, 0.0, 0.0]},
}  # fmt: skip
WRAP = {
    "name": "wrap", "duration": 1.0, "friction": False,
    "entry": {"move": [0.0, 0.0, -0.1]}, "exit": {"force": [1e4, 0.0, -1e3]},
}  # fmt: skip
TURN = {"name": "turn", "duration": 0.01, "rollers": {"r1": {"surface_speed": 1.0}}}
TABLES: dict[str, Any] = {
    "strip": {
        "length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [16, 2], "refined": 0.1,
        "kinematics": "section",
    },
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {"stiffness": 1e10, "eta": 10.0, "delta": 1e-3},
    "friction": {"coefficient": 0.3, "speed": 1.0},
    "rollers": [{"name": "r1", "radius": 0.5, "centre": [0.0, 0.0, -0.501]}],
    "edges": {"entry": {"fixed": ["x", "z"]}},
    "stages": [TENSION, WRAP, TURN],
    "solver": {"tolerance": 1e-3},
    "output": {"every": 5},
}  # fmt: skip
SHELL = {"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [8, 2], "refined": 0.25}
SECOND = {"name": "r2", "radius": 0.5, "centre": [0.0, 0.0, 0.51]}


def pulled(force: float) -> dict[str, Any]:
    """Stages with another largest force."""
    exits = {"exit": {"force": [force, 0.0, 0.0]}}
    return {"stages": [{**TENSION, **exits}, {**WRAP, **exits}, TURN]}


def scene(**tables: Any) -> Scene:
    return Scene.model_validate(copy.deepcopy({**TABLES, **tables}))


@cache
def wrapped() -> Run:
    """The scene run to its end."""
    run = scene().run()
    for _ in run:
        pass
    assert run.outcome.done, run.message
    return run


def told(run: Run, stopped: PathStopped, changed: Scene | None = None) -> str:
    """What would be said had the last stage of a run stopped at its end, in a changed scene."""
    other = run if changed is None else changed.run()
    assert run.state is not None
    return diagnosis(Failure(other.assembly, other.scene.course[-1], run.state, stopped))


def stalled(evidence: Evidence = NO_EVIDENCE, detail: str = "") -> PathStopped:
    return PathStopped(Outcome.STALLED, 0.5, detail, evidence)


def imbalance_at(run: Run, x: float, component: int) -> Evidence:
    """An imbalance at the node that is nearest to x."""
    strip, plan = run.assembly.strip, run.state.plan
    node = int(np.abs(strip.nodes[0] - x).argmin())
    full = np.zeros(strip.unknowns)
    full[strip.count * strip.node_values[node] + component] = 1.0
    return Evidence(residual=full[plan.supports.free])


def typed(message: str) -> list[str]:
    """The settings that a message tells to type, as they are pasted: up to the next space."""
    found = re.findall(r"--set (?:'([^']+)'(?=\s|$)|(\S+))", message)
    return [quoted or plain for quoted, plain in found]


def test_what_is_told_can_be_typed() -> None:
    messages = list(all_messages())
    settings = [text for message in messages for text in typed(message)]
    assert len(settings) >= 6
    for text in settings:
        data = Override.parse(text).applied_to(wrapped().scene.to_dict())
        Scene.model_validate(data)


def test_a_pin_that_stiff_ribbon_slides_over_is_told_a_wider_onset() -> None:
    """Twice the tension was told, with which it stopped as well; by what is told it slides."""
    tables = {
        "strip": {"thickness": 2e-4, "width": 5e-3, "kinematics": "section"},
        "material": {"young": 1.15e11, "poisson": 0.34},
        "rollers": [{"name": "pin", "radius": 4e-3, "centre": [0.0, 0.0, 0.0], "wrap": "over"}],
        "threading": {"tension": 400.0, "entry": [-0.05, 0, -0.0866], "exit": [0.05, 0, -0.0866]},
        "friction": {"coefficient": 0.15},
        "stages": [{"name": "draw", "steady": True, "strip": {"speed": 0.3}}],
    }
    run = Run(Scene.from_tables(tables, "pin.toml"))
    list(run)
    assert "touches pin along a line" in run.message
    (setting,) = typed(run.message)
    assert setting.startswith("contact.onset=")
    run = Run(Scene.from_tables(tables, "pin.toml", [setting]))
    list(run)
    assert run.outcome.done and run.state is not None
    pin = run.state.rollers["pin"]
    assert -pin.drag / pin.normal_force == pytest.approx(0.15, rel=0.02)


def test_what_a_turning_point_had_changed_is_told_with_its_sign() -> None:
    back = {**TURN, "rollers": {"r1": {"surface_speed": -1.0}}}
    assembly = scene(stages=[TENSION, WRAP, back]).run().assembly
    plan = Preview.of(assembly).plans[-1]
    facts = {name: getattr(plan, name) for name in ("controls", "start", "duration")}
    state: Any = SimpleNamespace(plan=SimpleNamespace(in_time=False, **facts), control=0.4)
    fold = PathStopped(Outcome.FOLD, 0.5)
    fold.farthest = 0.5
    words = turning_point(Failure(assembly, assembly.scene.course[-1], state, fold))
    assert words == " at t = 2.005 s with rollers.r1.surface_speed of -0.5"


def all_messages() -> Iterator[str]:
    run = wrapped()
    place = imbalance_at(run, 0.0, 1)
    yield told(run, stalled(place), scene(**pulled(100.0)))
    yield told(run, stalled(place), scene(**pulled(1e6)))
    yield told(run, PathStopped(Outcome.TOO_MANY_STEPS, 0.5))
    yield told(run, stalled(), scene(friction={"coefficient": 0.3, "speed": 1e-12}))
    yield told(run, stalled(), scene(solver={"tolerance": 1e-11}))
    yield told(run, PathStopped(Outcome.FOLD, 0.5))
    yield told(run, stalled(), scene(solver={"order": 4}))
    yield free_in("x")
    yield free_in("z")


def test_strip_that_clamps_press_across_is_not_told_to_be_pulled_harder() -> None:
    clamped = {"fixed": ["x", "y", "z"]}
    pull = {"name": "pull", "exit": {"move": [0.06, 0.0, 0.0]}}
    run = Scene.model_validate({
        "strip": {"length": 0.4, "width": 0.16, "thickness": 1e-4},
        "material": {"young": 3.5e6, "poisson": 0.49},
        "edges": {"entry": clamped, "exit": clamped},
        "stages": [pull],
    }).run()  # fmt: skip
    for _ in run:
        pass
    message = told(run, stalled())
    assert "and buckles. It is pulled by" in message
    assert "may not contract at the entry and the exit, held in y" in message
    assert message.endswith("Try a smaller pull in stage pull.")


def free_in(component: str) -> str:
    held = [c for c in "xz" if c != component]
    run = scene(edges={"entry": {"fixed": held}}, stages=[TENSION]).run()
    for _ in run:
        pass
    return run.message if not run.outcome.done else told(run, stalled())


def test_stage_time_node_and_roller_are_named() -> None:
    run = wrapped()
    place = imbalance_at(run, 0.0, 1)
    message = told(run, stalled(place, "a detail"), scene(**pulled(100.0)))
    assert message.startswith("Stopped in stage turn at t = 2.01 s: ")
    assert "a detail; worst at x = 0 m (in z, at roller r1)." in message
    far = told(run, stalled(imbalance_at(run, 2.0, 0)))
    assert "worst at x = 2 m (in x)." in far
    assert "stages.turn.rollers.r1.surface_speed: try a smaller change" in far
    heat = {"name": "heat", "duration": 1.0, "strip": {"temperature": 50.0}}
    heated = scene(
        stages=[*TABLES["stages"][:-1], heat], material={**TABLES["material"], "expansion": 1e-5}
    )
    hot = told(run, stalled(imbalance_at(run, 2.0, 0)), heated)
    assert "Stage heat changes stages.heat.strip.temperature: try a smaller change" in hot
    let_go = {**TURN, "entry": {"release": True}}  # nothing that could be smaller
    far = told(run, stalled(imbalance_at(run, 2.0, 0)), scene(stages=[TENSION, WRAP, let_go]))
    assert "Stage turn changes stages.turn.rollers.r1.surface_speed: try" in far


def test_a_place_of_a_threaded_line_is_the_one_that_is_drawn() -> None:
    """Also of an element that is pressed; labels count from the middle of the strip."""
    tables = copy.deepcopy(BRIDLE)
    places = [roller["centre"] for roller in tables["rollers"]]
    for place in (*places, tables["threading"]["entry"], tables["threading"]["exit"]):
        place[0], place[2] = place[0] + 50.0, place[2] + 7.0
    run = Scene.model_validate(tables).run()
    next(iter(run))
    middle = 0.5 * sum(run.assembly.thread.arcs["a"])
    message = told(run, stalled(imbalance_at(run, middle, 1)))
    at = re.search(r"worst at x = (\S+) m, z = (\S+) m \(in z, at roller a\)", message)
    assert at is not None, message
    distance = np.hypot(float(at[1]) - 50.0, float(at[2]) - 7.0)
    assert distance == pytest.approx(0.3, abs=0.01)
    squeezed = replace(run.state, full=0.99 * run.state.full)
    pressed = slack(Failure(run.assembly, run.scene.course[0], squeezed, stalled()))
    at = re.search(r"pressed at x = (\S+) m, z = (\S+) m with", pressed or "")
    assert at is not None and 45.0 < float(at[1]) < 55.0, pressed


def test_heat_that_presses_a_strip_is_named() -> None:
    """Where its strains differ by more than what presses, and then instead of the tension."""
    tables = copy.deepcopy(BRIDLE)
    tables["material"]["expansion"] = 1.2e-5
    tables["strip"]["temperature"] = {"across": [300.0], "along": [[1.0, 0.0], [1.5, 1.0]]}
    run = Scene.model_validate(tables).run()
    next(iter(run))
    longer = 1.2e-5 * 300.0
    largest = longer * (1.0 + 0.5 * longer) * run.assembly.strip.tensile_stiffness
    for share, named in ((0.999, True), (0.98, False)):
        squeezed = replace(run.state, full=share * run.state.full)
        found = slack(Failure(run.assembly, run.scene.course[0], squeezed, stalled())) or ""
        pressed = re.search(r"with (\S+) N/m, and buckles", found)
        assert pressed is not None and (float(pressed[1]) < largest) == named, found
        assert (
            f"strip.temperature varies so much over it that this alone may press it by "
            f"{largest:.3g} N/m" in found
        ) == named
        assert ("threading.tension=" in found) != named


def test_long_fibres_press_a_threaded_shell_by_what_they_exceed_the_mean() -> None:
    """E t times 20 I-units at the edges; what was told was the range, of 30."""
    tables = copy.deepcopy(BRIDLE)
    tables["strip"] |= {"kinematics": "shell", "flatness": {"across": [0.0, 0.0, 120.0]}}
    tables["strip"]["finer"] = 0.3
    run = Scene.model_validate(tables).run()
    next(iter(run))
    squeezed = replace(run.state, full=0.9999 * run.state.full)
    found = slack(Failure(run.assembly, run.scene.course[0], squeezed, stalled())) or ""
    told = re.search(r"strip.flatness varies so much .* may press it by (\S+) N/m", found)
    assert told is not None, found
    expected = run.assembly.strip.tensile_stiffness * 1.2e-3 * (0.25 - 1.0 / 12.0)
    assert 0.75 < float(told[1]) / expected < 1.01  # points are inside of the edges


def test_derivatives_are_compared_as_forces_and_lengths() -> None:
    run = wrapped()
    plan, strip = run.state.plan, run.assembly.strip
    units = plan.model.units[plan.supports.free]
    slopes = ~np.isin(plan.supports.free, strip.unknowns_of(strip.node_values))
    assert slopes.any()
    for evidence in (
        Evidence(residual=np.where(slopes, 1.0, 2.0) / units),
        Evidence(motion=np.where(slopes, 1.0, 2.0) * units),
    ):
        number = int(np.flatnonzero(~slopes)[0])
        assert diagnosis_place(run, evidence) == diagnosis_place(run, Evidence(unknown=number))


def diagnosis_place(run: Run, evidence: Evidence) -> str:
    return str(Failure(run.assembly, run.scene.course[-1], run.state, stalled(evidence)).location)


def test_what_is_not_finite_comes_first() -> None:
    run = wrapped()
    residual = imbalance_at(run, 0.0, 1).residual
    residual[-1] = np.nan
    found = diagnosis_place(run, Evidence(residual=residual))
    assert found == diagnosis_place(run, Evidence(unknown=len(residual) - 1))


@pytest.mark.parametrize("component", ["x", "z"])
def test_component_that_nothing_holds(component: str) -> None:
    message = free_in(component)
    assert f"Nothing holds the strip in {component}." in message
    assert typed(message) == ['edges.entry.fixed=["x", "z"]']


def test_strip_that_may_glide_across() -> None:
    run = scene(strip=SHELL, stages=[TENSION]).run()
    for _ in run:
        pass
    assert typed(told(run, stalled())) == ["edges.entry.centred=true"]


@pytest.mark.slow
@pytest.mark.parametrize("steady", [True, False])
def test_errors_of_a_strip_that_runs_away_are_not_told(tmp_path: Path, steady: bool) -> None:
    """It has no state to be wrong by, on any mesh: friction on 222° holds a ratio of 2.17."""
    surfaces = BRIDLE["stages"][-1]["rollers"]
    start = {"steady": True} if steady else {"duration": 0.1}
    entry = {"tension": 1e4} if steady else {"tension": 1e4, "release": True}
    pull = {"name": "run", **start, "rollers": surfaces, "entry": entry, "exit": {"tension": 3e4}}
    run = Scene.model_validate({**BRIDLE, "stages": [pull]}).run(tmp_path)
    for _ in run:
        pass
    assert "the strip runs away" in run.message
    assert run.state.tension("exit") == pytest.approx(1e4 * np.exp(0.773), rel=0.02)
    assert not any("elements of half the length" in told for told in run.warnings)
    assert set(run.errors().values()) == {None}
    assert "Estimated errors" not in report(run)


def test_no_errors_are_told_where_the_balance_is_not_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its tangent may be singular, which made laws wrong by a hundred times the tension."""
    monkeypatch.setattr(budget, "balance_state", lambda *_: None)
    run = scene(stages=[TENSION, WRAP]).run(tmp_path)
    for _ in run:
        pass
    assert run.outcome.done, run.message
    assert set(run.errors().values()) == {None}
    assert not any("elements of half the length" in told for told in run.warnings)


def test_rollers_that_squeeze_the_strip() -> None:
    press = {"name": "press", "duration": 1.0, "friction": False}
    press["rollers"] = {"r2": {"move": [0.0, 0.0, -0.02]}}
    run = scene(rollers=[*TABLES["rollers"], SECOND], stages=[TENSION, press]).run()
    for _ in run:
        pass
    message = told(run, stalled())
    assert "Rollers r1 and r2 are -0.009 m apart and squeeze the strip." in message
    assert typed(message) == ["stages.press.rollers.r2.move=[0, 0, -0.0101]"]


def test_strip_under_no_tension() -> None:
    run = scene(stages=[{**WRAP, "exit": {}}]).run()
    for _ in run:
        break
    message = told(run, stalled())
    assert "The strip is under no tension" in message
    assert typed(message) == ["stages.wrap.exit.force=[1e+04, 0.0, 0.0]"]


def test_strip_that_is_pressed() -> None:
    held = {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}}
    push = {"name": "push", "duration": 1.0, "exit": {"move": [-1e-2, 0.0, 0.0]}}
    run = scene(edges=held, stages=[{**push, "friction": False}], rollers=[]).run()
    for _ in run:
        pass
    message = told(run, stalled())
    assert re.search(
        r"The strip is pressed at x = \S+ m with 4\.\d+e\+05 N/m, and buckles", message
    )
    assert "a larger x in stages.push.exit.move" in message


def test_a_stop_is_not_laid_to_a_stage_that_comes_later() -> None:
    """Strip that no roller carries faster than it comes is told of the stage in which it is so."""
    speeds = {each["name"]: {"surface_speed": 1.0} for each in BRIDLE["rollers"]}
    run_up = {"name": "run", "steady": True, "rollers": speeds, "strip": {"speed": 1.0}}
    run = Scene.model_validate({**BRIDLE, "stages": [run_up]}).run()
    threaded = next(iter(run)).state
    threading, last = (
        forewarned(Failure(run.assembly, stage, threaded, stalled())) for stage in run.scene.course
    )
    assert threading is None
    assert last is not None and "in stage run" in last


def test_long_elements_over_a_roller() -> None:
    run = wrapped()
    message = told(run, stalled(imbalance_at(run, 0.0, 1)), scene(**pulled(1e6)))
    assert "Elements of 0.0982 m over roller r1 are long against √(D/T) = 0.00428 m." in message
    assert typed(message) == ["strip.refined=0.00107"]


def test_friction_that_is_too_steep() -> None:
    message = told(wrapped(), stalled(), scene(friction={"coefficient": 0.3, "speed": 1e-12}))
    assert "Friction turns round within 1e-12 m/s" in message
    assert typed(message) == ["friction.speed=9e-09"]
    law = {"law": "norton-hoff", "coefficient": 0.3, "omega": 0.1, "speed": 1e-12}
    message = told(wrapped(), stalled(), scene(friction=law))  # whose corner is ω V_c wide
    assert "Friction turns round within 1e-13 m/s" in message
    assert typed(message) == ["friction.speed=9e-08"]


def test_series_of_few_terms() -> None:
    message = told(wrapped(), stalled(), scene(solver={"order": 4}))
    assert "Series of order 4 are short. Try --set solver.order=" in message
    assert "Series" not in told(wrapped(), stalled(), scene(solver={"order": 12}))


def test_tolerance_near_round_off() -> None:
    message = told(wrapped(), stalled(), scene(solver={"tolerance": 1e-11}))
    assert "near round-off" in message
    (text,) = typed(message)
    assert 1e-10 < Override.parse(text).value < 1e-5


def test_every_outcome_has_words_once() -> None:
    run = wrapped()
    for outcome in set(Outcome) - {Outcome.DONE, Outcome.INTERRUPTED}:
        message = told(run, PathStopped(outcome, 0.5, "a detail"))
        assert message.count(outcome.value) == message.count("a detail") == 1
        assert re.search("[Tt]ry ", message)


def stopping(outcome: Outcome, after: int) -> Any:
    """A follower that stops after some steps."""
    follow = running.follow

    def follow_and_stop(*given: Any, **named: Any) -> Iterator[Any]:
        for number, step in enumerate(follow(*given, **named)):
            if number == after:
                raise PathStopped(outcome, 0.5, "a detail")
            yield step

    return follow_and_stop


@pytest.mark.parametrize("after", [0, 3])
@pytest.mark.parametrize("outcome", sorted(set(Outcome) - {Outcome.DONE}, key=lambda o: o.name))
def test_every_end_leaves_files_to_go_on_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, outcome: Outcome, after: int
) -> None:
    short = scene(stages=[TENSION, WRAP])
    with monkeypatch.context() as patch:
        patch.setattr(running, "follow", stopping(outcome, after))
        run = short.run(tmp_path)
        for _ in run:
            pass
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert (summary["status"], summary["message"]) == (outcome.name.lower(), run.message)
    assert (
        len(history.read_history(tmp_path / "history.csv")["time"]) == summary["steps"] == run.steps
    )
    entries = listed(tmp_path / "strip.pvd")
    assert entries
    assert all(np.isfinite(read_surface(tmp_path / e.file).points).all() for e in entries)
    assert checkpoint.load_checkpoint(tmp_path / "checkpoint.npz")[1]["steps"] == run.steps
    again = short.run(tmp_path, resume=True)
    for _ in again:
        pass
    assert again.outcome.done
    files = [e.file for e in listed(tmp_path / "strip.pvd")]
    assert len(set(files)) == len(files) >= 2


@pytest.mark.parametrize("across", [True, False])
def test_a_tangent_that_does_not_fit_into_memory(
    across: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was computed is kept, and what is typed has fewer unknowns."""
    roller = TABLES["rollers"][0] | ({"crown": [0.0, -1e-4]} if across else {})
    tables = copy.deepcopy({**TABLES, "strip": SHELL, "rollers": [roller]})

    def full(*_: Any) -> None:
        raise MemoryError

    run = Scene.from_tables(tables, "line.toml").run(tmp_path / "results")
    steps, begun = iter(run), list[Any]()
    while not begun or begun[-1].stage != "wrap":
        begun.append(next(steps))
    with monkeypatch.context() as patched:
        patched.setattr("anmstrip.linalg.direct.BandPlan.factorise", full)
        begun += steps
    assert "do not fit into memory" in run.message
    assert (tmp_path / "results" / "checkpoint.npz").exists()
    summary = json.loads((tmp_path / "results" / "summary.json").read_text(encoding="utf8"))
    assert summary["steps"] == len(begun)
    assert summary["status"] == "too_large"
    again = Scene.from_tables(tables, "line.toml", typed(run.message)).run()
    assert 1.2 * again.assembly.unknowns < run.assembly.unknowns


def test_what_was_told_of_the_stage_that_stops_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    sentences = ["it slides in stage wrap", "it stands in stage turn", "it turns"]
    monkeypatch.setattr("anmstrip.advice.warnings.serious_as_meant", lambda _: sentences)
    assert "It stands" in told(wrapped(), stalled())
    sentences.pop(1)
    assert "It slides" in told(wrapped(), stalled())
    doubted = ["stages.turn.exit.tension = 1 is in N/m", "threading.tension = 1 is in N/m"]
    monkeypatch.setattr("anmstrip.advice.diagnosis.other_units", lambda _: doubted)
    assert " and ".join(doubted) in told(wrapped(), stalled())


def test_a_run_stops_where_strip_is_stretched_to_twice_its_length() -> None:
    """Pulled by its own length, of which it has all that was computed."""
    pull = {"name": "pull", "duration": 1.0, "exit": {"move": [8.0, 0.0, 0.0]}}
    held = {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}}
    run = scene(stages=[pull], edges=held, rollers=[], friction=None, contact=None).run()
    *_, last = run
    assert run.outcome is Outcome.OVERSTRETCHED
    assert "more than twice its length" in run.message
    assert last.state.tension("exit") > 2e11 * 1e-3
    assert run.state is last.state


@pytest.mark.slow
def test_a_run_stops_where_strip_has_run_away() -> None:
    """An idle roller is lifted off the strip; what is left of the wrap does not hold 6 kN/m.

    26° at f = 0.3 hold 1.146 times 5 kN/m less what the line law leaves; it went on to 1e5 m/s.
    """
    idle = {"radius": 0.2, "drive": "idle"}
    tables = {
        "strip": {"kinematics": "section", "width": 0.8, "thickness": 4e-4},
        "material": {"young": 2e11, "poisson": 0.3},
        "friction": {"coefficient": 0.3},
        "threading": {"tension": 5e3, "entry": [-1.0, 0.0, -0.6], "exit": [3.0, 0.0, -0.6]},
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "rollers": [
            {"name": "a", "radius": 0.2, "centre": [0.0, 0.0, -0.2], "wrap": "over"},
            {**idle, "name": "m", "centre": [1.0, 0.0, 0.1], "wrap": "under", "bearing": 4.0},
            {**idle, "name": "c", "centre": [2.0, 0.0, -0.2], "wrap": "over"},
        ],
        "stages": [
            {"name": "run", "steady": True, "entry": {"tension": 5e3}, "exit": {"tension": 6e3},
             "rollers": {"a": {"surface_speed": 1.0}}},
            {"name": "lift", "duration": 1.0, "rollers": {"m": {"move": [0.0, 0.0, 0.2]}}},
        ],
        "solver": {"tolerance": 1e-2, "max_tangents": 1000},
    }  # fmt: skip
    run = Scene.from_tables(tables, "lift.toml").run()
    *_, last = run
    assert run.outcome is Outcome.RAN_AWAY
    assert re.search(r"It slides over a \(2[56]\S*°, 5000 and 59\S+ N/m\)", run.message)
    assert last.state.strip_speed > 1e3


@pytest.mark.parametrize("drive", ["idle", "torque"])
def test_pull_roll_that_cannot_take_the_work_of_bending_is_named(drive: str) -> None:
    """Two idlers that yield the strip cost 110 N/m; 0.2° at f = 0.15 hold 30 of 50 kN/m.

    A roller with a torque does not hold it either, though it sticks.
    """
    tables = {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": 6e-4},
        "material": {"young": 2e11, "poisson": 0.3, "yield_stress": 2.2e8, "plasticity": {}},
        "friction": {"coefficient": 0.15},
        "threading": {"tension": 5e4, "entry": [-0.3, 0.0, 0.0], "exit": [0.9, 0.0, 0.0]},
        "rollers": [
            {"name": "u1", "radius": 0.025, "centre": [0.0, 0.0, -0.02], "wrap": "over",
             "drive": drive},
            {"name": "u2", "radius": 0.025, "centre": [0.1, 0.0, 0.02], "wrap": "under",
             "drive": "idle"},
            {"name": "pull", "radius": 0.4, "centre": [0.5, 0.0, -0.4], "wrap": "over"},
        ],
        "stages": [{"name": "level", "steady": True, "entry": {"tension": 5e4},
                    "rollers": {"pull": {"surface_speed": 1.0}}}],
        "solver": {"tolerance": 1e-2},
    }  # fmt: skip
    run = Scene.from_tables(tables, "level.toml").run()
    for _ in run:
        pass
    assert not run.outcome.done
    assert re.search(
        r"It slides over pull \(0\.\d+°, \d+ and \d+ N/m\)\. Try more wrap", run.message
    )


def test_slack_strip_that_does_not_bend_is_told_to_bend() -> None:
    """Under its weight alone, at the first step, it has no stiffness at all."""
    tables = {
        "strip": {"kinematics": "section", "length": 6.0, "width": 1.0, "thickness": 5e-4,
                  "bending": False},
        "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
        "edges": {end: {"fixed": ["x", "z"]} for end in ("entry", "exit")},
        "stages": [{"gravity": [0.0, 0.0, -9.81]}],
    }  # fmt: skip
    run = Run(Scene.from_tables(tables, "loop.toml"))
    list(run)
    assert "without bending nothing else. Try --set strip.bending=true, or" in run.message
    run = Run(Scene.from_tables(tables, "loop.toml", ["strip.bending=true"]))
    list(run)
    assert run.outcome.done


def test_strip_that_has_not_come_to_rest_has_no_readings(tmp_path: Path) -> None:
    """As it is laid, a roller may press it by 1e46 N: nothing of that is a result."""
    scene = Scene.load("examples/line.toml", ["solver.max_tangents=1"])
    run = Run(scene, tmp_path)
    for _ in run:
        pass
    assert not run.outcome.done and run.steps == 0 and run.state is not None
    assert "Rollers at" not in report(run) and "Tension" not in report(run)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["rollers"] == {} and summary["edges"] == {}


@pytest.mark.parametrize("force", [10.0, -10.0])
def test_strip_that_turns_about_its_only_support_is_no_column(force: float, tmp_path: Path) -> None:
    """Pulled, it hangs from its hinge; pressed, it stands on it: told, whatever it bears."""
    tables = {
        "strip": {"kinematics": "section", "length": 1.0, "width": 0.5, "thickness": 1e-3},
        "material": {"young": 2.1e11, "poisson": 0.3},
        "edges": {"entry": {"fixed": ("x", "z")}},
        "stages": [{"exit": {"force": (force, 0.0, 0.0)}}],
    }
    run = Run(Scene.from_tables(tables, "hinge.toml"), tmp_path)
    for _ in run:
        pass
    assert run.outcome.done, run.message
    assert any("it turns freely" in words for words in run.warnings) == (force < 0.0)


def test_strip_that_runs_away_from_a_standing_line_stops_the_run() -> None:
    """No speed is given: it went on to 140 km/s, in steps of a millisecond."""
    from test_advice import BRAKED_ALONE  # 889 N/m by the brake, where the exit holds 660

    run = Scene.from_tables(BRAKED_ALONE, "line.toml", ["solver.max_tangents=4000"]).run()
    *_, last = run
    assert run.outcome is Outcome.RAN_AWAY and "as fast as the line" in run.message
    assert last.stage == "more"
