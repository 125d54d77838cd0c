"""Labels of fed strip stay on their rollers where loads lengthen it; held strip is what it is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from test_hanging import done

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.driver.stationary import OperatingMap
from anmstrip.mechanics.string_path import catenary
from anmstrip.simulation.problem import Assembly

HEARTH: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 1.25, "thickness": 1.2e-3},
    "material": {"young": 1.6e11, "poisson": 0.3, "density": 7850.0, "expansion": 1.4e-5},
    "contact": {},
    "friction": {"coefficient": 0.3},
    "threading": {"tension": 6e3, "entry": (0.0, 0.0, 0.0), "exit": (24.0, 0.0, 0.0)},
    "rollers": [
        {
            "name": f"h{k}", "radius": 0.075, "centre": (2.0 * k - 1.0, 0.0, -0.075),
            "wrap": "over", "drive": "idle",
        }
        for k in range(1, 13)
    ],
    "edges": {"entry": {"fixed": ("x", "z")}, "exit": {"fixed": ("z",)}},
    "stages": [
        {
            "name": "run", "steady": True, "gravity": (0.0, 0.0, -9.81),
            "strip": {"speed": 2.0}, "exit": {"tension": 6e3},
        }
    ],
}  # fmt: skip

HOT = "stages.run.strip.temperature={ across = [700.0], along = [[0.0, 0.0], [8.0, 1.0]] }"


@pytest.mark.parametrize("heat", [(), (HOT,)], ids=["cold", "hot"])
def test_strip_on_hearth_rolls_keeps_its_tension(heat: tuple[str, ...]) -> None:
    """Idle rolls at one level leave the tension as it is: it is that of the exit."""
    run = done(HEARTH, *heat)
    state = run.state
    assert state is not None and run.cost.expansions < 50
    assert state.tension("entry") == pytest.approx(6e3, rel=4e-4)
    weight = 7850.0 * 1.2e-3 * 9.81 * 1.25 * 24.0
    told = run.facts()["feed"]["taken_up"]
    if heat:
        warmth = lambda x: 700.0 * min(x / 8.0, 1.0)  # noqa: E731
        given_off, _ = quad(lambda x: 1.0 / (1.0 + 1.4e-5 * warmth(x)) - 1.0, 0.0, 24.0)
        assert told == pytest.approx(given_off, rel=1e-2)
        weight *= 1.0 + given_off / 24.0
    carried = sum(roller.normal_force for roller in state.rollers.values())
    ends = state.edge_force("entry")[2] + state.edge_force("exit")[2]
    assert carried + ends == pytest.approx(weight, rel=1e-3)


def test_uneven_strip_may_touch_its_rollers_along_lines() -> None:
    """Nothing differs along an arc that has no length: the contact of a shell sets in as usual."""
    shell = {**HEARTH["strip"], "kinematics": "shell", "cells": (30, 2)}
    warm = "stages.run.strip.temperature={ across = [0.0, 0.0, 40.0] }"
    given = HEARTH | {"strip": shell}
    onsets = [
        Assembly(Scene.from_tables(given, "line.toml", settings)).signorini.width
        for settings in ((), (warm,))
    ]
    assert onsets[0] == pytest.approx(onsets[1], rel=1e-12)


def film(tension: float) -> dict[str, Any]:
    """A film over idlers above and below, threaded under 100 N/m."""
    rollers = [
        {
            "name": f"i{k}", "radius": 0.06, "centre": (0.5 * k, 0.0, 3.0 * (k % 2)),
            "wrap": "over" if k % 2 else "under", "drive": "idle", "bearing": 0.05,
        }
        for k in range(1, 9)
    ]  # fmt: skip
    run = {"name": "run", "steady": True, "strip": {"speed": 2.0}, "exit": {"tension": tension}}
    return {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": 5e-5},
        "material": {"young": 4e9, "poisson": 0.3},
        "contact": {},
        "friction": {"coefficient": 0.25},
        "threading": {"tension": 100.0, "entry": (0.0, 0.0, 0.0), "exit": (4.5, 0.0, 3.0)},
        "rollers": rollers,
        "edges": {"entry": {"fixed": ("x", "z")}},
        "stages": [run],
    }


def test_film_stays_on_its_rollers_as_it_is_stretched() -> None:
    """By a thousandth, 30 mm of its way; bearings then leave 0.05 N m/0.06 m on every idler."""
    run = done(film(400.0), "solver.tolerance=1e-5")
    assert run.state is not None and run.cost.expansions < 40
    gain = 0.05 / 0.06 / 1.0
    assert run.state.tension("entry") == pytest.approx(400.0 - 8.0 * gain, rel=2e-4)
    for k, passage in enumerate(run.state.passages, start=1):
        assert passage.tensions[1] == pytest.approx(400.0 - (8 - k) * gain, rel=5e-4)
    told = run.facts()["feed"]["taken_up"]
    strain = 300.0 / (4e9 * 5e-5)
    assert told == pytest.approx(-strain * _path_length(run), rel=0.05)


def test_labels_stay_along_a_map() -> None:
    """Where the last control of a map pulls, as at the end of the scene: back to 100 N/m."""
    scene = Scene.from_tables(film(400.0), "line.toml")
    found = OperatingMap(scene, ["exit.tension=400:100:4"])
    for _ in found:
        pass
    state = found.run.state
    assert found.done and state is not None, found.message
    assert found.run.cost.expansions < 40
    last = found.curves[0].pieces[-1].plan.controls.at(1.0)
    assert np.abs(last["strip.held"]).max() < 2e-4  # by the bearings; of 400 N/m 5e-3


def _path_length(run: Run) -> float:
    assert run.state is not None
    x, z = run.state.along("x"), run.state.along("z")
    return float(np.hypot(np.diff(x), np.diff(z)).sum())


HELD: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 1e-3, "bending": False},
    "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0, "expansion": 1.2e-5},
    "contact": {},
    "friction": {"coefficient": 0.2},
    "threading": {"tension": 2e4, "entry": (-2.0, 0.0, -1.0), "exit": (2.0, 0.0, -1.0)},
    "rollers": [{"name": "r1", "radius": 0.5, "centre": (0.0, 0.0, -0.5), "wrap": "over"}],
    "edges": {"entry": {"fixed": ("x", "z")}, "exit": {"fixed": ("x", "z")}},
}


def held_tension(rise: float, warmth: float, weight: float) -> float:
    """Tension (N/m) at the ends of strip of given length over the roller (statics)."""
    radius, stiffness = 0.5, 2e8

    def way(up: float, tension: float, weight: float) -> float:
        """Of the catenary that leaves the roller along its tangent."""

        def hung(angle: float) -> tuple[float, float]:
            off = np.array([np.sin(angle), np.cos(angle) - 1.0]) * radius + [0.0, up]
            chord = np.array([2.0, -1.0]) - off
            longer, first, _ = catenary(chord, weight, tension)
            slope = np.arctan2(chord[1], chord[0]) - first
            return float(slope + angle), radius * angle + float(np.hypot(*chord)) + longer

        angle = brentq(lambda angle: hung(angle)[0], 0.4, 0.7)
        return 2.0 * hung(angle)[1]

    cut = way(0.0, 2e4, 0.0) / (1.0 + 2e4 / stiffness)

    def missing(tension: float) -> float:
        mean = tension + 0.5 * weight  # of the ends and the top, 1 m above
        stretched = cut * (1.0 + mean / stiffness + 1.2e-5 * warmth)
        return way(rise, tension, weight) - stretched

    return float(brentq(missing, 5e3, 1e5))


def stages_of_held_strip() -> Iterator[Any]:
    yield "rises", {"rollers": {"r1": {"move": (0.0, 0.0, 1e-3)}}}, (1e-3, 0.0, 0.0)
    yield "warm", {"strip": {"temperature": 5.0}}, (0.0, 5.0, 0.0)
    yield "heavy", {"gravity": (0.0, 0.0, -98.1)}, (0.0, 0.0, 7850.0 * 1e-3 * 98.1)


@pytest.mark.parametrize(
    ("change", "loads"), [pytest.param(s, w, id=name) for name, s, w in stages_of_held_strip()]
)
def test_strip_between_two_held_ends_is_stretched(change: Any, loads: Any) -> None:
    """Nothing passes the ends: what a roller, heat or weight changes is borne by its tension."""
    stage = {"name": "change", "friction": False} | change
    run = done(HELD | {"stages": [stage]})
    assert run.state is not None
    assert run.state.tension("exit") == pytest.approx(held_tension(*loads), abs=200.0)
    assert run.facts()["feed"]["taken_up"] == 0.0


@pytest.mark.parametrize("steady", [True, False])
def test_line_rests_where_nothing_rubs(steady: bool) -> None:
    """A stage without friction is independent of time: the line does not walk off meanwhile."""
    speed = {"strip": {"speed": 2.0}} if steady else {"entry": {"speed": 2.0}, "duration": 0.5}
    runs = {"steady": steady, "rollers": {"r1": {"surface_speed": 2.0}}} | speed
    edges = {"entry": {"fixed": ("x", "z")}}
    stages = [{"name": "run"} | runs, {"name": "pause", "friction": False}]
    run = done(HELD | {"edges": edges, "stages": stages})
    assert run.state is not None and run.cost.expansions < 40
    way = np.stack([run.state.along(name) for name in "xz"])
    assert way[:, 0] == pytest.approx([-2.0, -1.0], abs=1e-6)
    assert way[:, -1] == pytest.approx([2.0, -1.0], abs=2e-3)
    assert run.state.tension("entry") == pytest.approx(2e4, rel=1e-4)
