"""Sensitivities of stationary states against differences of runs with other data."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip import Scene
from anmstrip.driver.sensitivities import STENCIL, sensitivities
from anmstrip.results.state import State
from anmstrip.simulation.meshing import Layout
from stationary import corrected

SIZES = {"tension": 1e4, "torque": 2.5e3, "speed": 2.0, "offset": 1.0}
"""Of readings: tension, and its moment about a roller."""

ROUND_OFF = 2e-11
"""Of readings over their sizes: forces are E t, 2e4 tensions, times strains."""

LOADS = ("entry.tension", "exit.force", "exit.tension", "pressure", "gravity")

DRIVES = ("drive", "bearing")

BOUND = 1e-5
"""Of the difference, over the largest sensitivity of the same kind to the parameter."""

LINE: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 0.5, "thickness": 1e-3, "refined": 0.1},
    "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
    "contact": {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3},
    "friction": {"law": "tanh", "coefficient": 0.3, "speed": 1e-4},
    "threading": {"tension": 1e4, "entry": (-0.4, 0.0, 0.0), "exit": (2.0, 0.0, 0.5)},
    "rollers": [
        {
            "name": "a", "radius": 0.4, "centre": (0, 0, 1.5), "wrap": "over",
            "drive": "idle", "bearing": 20.0,
        },
        {"name": "b", "radius": 0.4, "centre": (0.8, 0, 0), "wrap": "under"},
        {
            "name": "c", "radius": 0.4, "centre": (1.6, 0, 1.5), "wrap": "over",
            "drive": "torque", "friction": 0.25,
        },
    ],
    "edges": {"entry": {"fixed": ["x", "z"]}},
    "stages": [
        {
            "name": "run", "steady": True, "entry": {"tension": 1.05e4},
            "rollers": {"b": {"surface_speed": 2.0}, "c": {"torque": 60.0}},
        }
    ],
    "solver": {"tolerance": 1e-4},
}  # fmt: skip

SHELL: dict[str, Any] = {
    **LINE,
    "strip": {**LINE["strip"], "kinematics": "shell", "cells": (8, 2), "refined": 0.15},
    "threading": {"tension": 1e4, "entry": (-1.0, 0.0, 0.0), "exit": (0.5, 0.0, -1.0)},
    "rollers": [
        {
            "name": "a", "radius": 0.5, "centre": (0, 0, -0.5), "wrap": "over",
            "axis": (1e-3, 1.0, 0.0), "crown": (0.0, -1e-4),
        },
    ],
    "edges": {"entry": {"fixed": ["x", "y", "z"]}},
    "stages": [
        {
            "name": "run", "steady": True, "strip": {"speed": 0.99994},
            "gravity": (0.0, 0.0, -9.81), "pressure": 50.0, "exit": {"tension": 1.01e4},
            "rollers": {"a": {"surface_speed": 1.0}},
        }
    ],
}  # fmt: skip


def at(tables: dict[str, Any], key: str, by: float) -> tuple[dict[str, Any], float]:
    """Tables with a parameter changed by a share of its scale, and that change."""
    made = json.loads(json.dumps(tables))
    stage, (head, *path) = made["stages"][0], key.split(".")
    last = [head, *path][-1]
    if key == "exit.force":
        tension = stage.get("exit", tables["threading"])["tension"]
        stage["exit"] = {"tension": tension * (1.0 + by)}
        return made, tension * by
    if key.endswith((".yaw", ".crown")):
        roller = made["rollers"][0]
        if key.endswith("crown"):
            roller["crown"][1] += 1e-3 * by
            return made, 1e-3 * by
        x, y, _ = roller["axis"]
        angle = 1e-2 * by
        roller["axis"] = [
            x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), 0.0,
        ]  # fmt: skip
        return made, angle
    table = made if head in ("friction", "material") or key == "strip.thickness" else stage
    if key == "gravity":
        table["gravity"][2] *= 1.0 + by
        return made, -tables["stages"][0]["gravity"][2] * by
    for part in [head, *path][:-1]:
        table = table[part]
    value = table[last]
    table[last] = value * (1.0 + by)
    return made, value * by


def stationary(tables: dict[str, Any], like: State | None, patch: pytest.MonkeyPatch) -> State:
    """The state of a run, on the mesh and with the reach of friction of another one if given.

    Corrected to round-off by Newton's method.
    """
    if like is not None:
        model, problem = like.plan.model, "anmstrip.simulation.problem"
        patch.setattr(Layout, "mesh", model.strip.mesh)
        patch.setattr(f"{problem}.largest_force", lambda _: model.scales.tension)
    run = Scene.model_validate(tables).run()
    *_, last = run
    assert run.outcome.done, run.message
    return corrected(last.state)


def read(state: State, start: State) -> dict[str, float]:
    """What is read off a state, tensions at rollers and offsets at places of another."""
    strip, width = state.plan.model.strip, state.plan.model.strip.width
    places = {name: passed.places for passed in start.passages for name in passed.names}
    found = {f"{name}_tension": state.tension(name) for name in ("entry", "exit")}
    found["strip_speed"] = float(state.strip_speed or np.nan)
    force = state.edge_force("entry")
    for name, reading in state.rollers.items():
        arc = start.contacts[name].arc
        pulls = force, force + reading.resultant
        slopes, pushes = state.slope(places[name]), state.pressure_before(places[name])
        for word, x, pull, slope, push in zip(
            ("in", "out"), arc, pulls, slopes, pushes, strict=True
        ):
            along, load = slope / np.linalg.norm(slope), push + state.weight_before(x)
            found[f"{name}_tension_{word}"] = -(pull + load) @ along / width
        force = pulls[1]
        found[f"{name}_torque"] = reading.torque
        found[f"{name}_surface_speed"] = reading.surface_speed
        if strip.kinematics.count == 3:
            found[f"{name}_offset"] = state.offset(arc[0])
    return found


@pytest.mark.parametrize("kind", ["line", pytest.param("shell", marks=pytest.mark.slow)])
def test_sensitivities_are_differences(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of runs on either side, on the same mesh and with the same laws: to 1e-5."""
    tables = LINE if kind == "line" else SHELL
    start = stationary(tables, None, monkeypatch)
    own = ["friction" in roller for roller in tables["rollers"]]
    found = sensitivities(start, own)
    speeds = {"strip.speed", "rollers.a.surface_speed"} if kind == "shell" else set()
    expected = {"line": 7, "shell": 10}[kind]
    idle = {"rollers.a.torque"} if kind == "line" else set()
    assert len(found.keys() - idle) == expected, sorted(found)
    for key in found.keys() - idle:
        step = (
            1e-7
            if key in speeds
            else 1e-4
            if key.endswith(("yaw", "crown"))
            else 2e-4
            if key in LOADS
            else 1e-3
        )
        rows, change = [], 0.0
        for by in (-step, step):
            changed, change = at(tables, key, by)
            rows.append(read(stationary(changed, start, monkeypatch), start))
        differences = {name: (rows[1][name] - rows[0][name]) / (2.0 * change) for name in rows[0]}
        for kind_of, reading in SIZES.items():
            names = [name for name in differences if kind_of in name]
            size = max((abs(differences[name]) for name in names), default=0.0)
            for name in names:
                bound = BOUND * size + ROUND_OFF * reading / abs(change)
                assert abs(found[key][name] - differences[name]) < bound, (key, name)


@pytest.mark.slow
def test_least_membrane_force_is_that_of_the_spans(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its change follows the least principal force at the same point of the strip."""
    start = stationary(SHELL, None, monkeypatch)
    found = sensitivities(start, [False])
    x = start.contacts["a"].arc
    layer = np.sqrt(start.plan.model.strip.bending_stiffness / 1e4)
    strip = start.plan.model.strip
    places = np.asarray(strip.basis.mapping.F(strip.basis.X))[0].ravel()
    free = (places < x[0] - 4.0 * layer) | (places > x[1] + 4.0 * layer)
    place = np.flatnonzero(free)[start.principal_forces[free, 0].argmin()]
    for key, step in (("friction.coefficient", 1e-3), ("strip.thickness", 1e-3)):
        difference = 0.0
        for by, weight in STENCIL:
            changed, change = at(SHELL, key, by * step)
            state = stationary(changed, start, monkeypatch)
            difference += weight * by / change * state.principal_forces[place, 0]
        assert found[key]["least_membrane_force"] == pytest.approx(difference, rel=1e-5)


def test_summary_has_them(tmp_path: Path) -> None:
    """Only after a steady stage; written with all their digits."""
    run = Scene.model_validate(LINE).run(tmp_path)
    *_, last = run
    written = json.loads((tmp_path / "summary.json").read_text(encoding="utf8"))["sensitivities"]
    found = sensitivities(last.state, [False, False, True])
    found["exit.tension"] = found.pop("exit.force")  # that [threading] gives
    assert written == found
    tables = {**LINE, "stages": [{"duration": 1.0, "friction": False}]}
    rollers = [{k: v for k, v in r.items() if k not in DRIVES} for r in LINE["rollers"]]
    run = Scene.model_validate({**tables, "rollers": rollers}).run(tmp_path / "rest")
    *_, last = run
    assert "sensitivities" not in json.loads((tmp_path / "rest" / "summary.json").read_text("utf8"))
