"""Doubts about a scene before it runs, and what they say when it stops."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from anmstrip.driver.scene import Scene
from anmstrip.driver.warnings import Preview, serious, warnings
from anmstrip.simulation.problem import Assembly

PULL = {
    "name": "pull", "duration": 1.0, "friction": False, "exit": {"force": [1e4, 0.0, 0.0]},
}  # fmt: skip
LAY = {
    "name": "lay", "duration": 1.0,
    "entry": {"move": [0.0, 0.0, -0.8]}, "exit": {"force": [1e4, 0.0, -4e3]},
}  # fmt: skip
TABLES: dict[str, Any] = {
    "strip": {"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [16, 1], "refined": 0.1,
              "kinematics": "section"},
    "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
    "contact": {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3},
    "friction": {"coefficient": 0.3, "speed": 1.0},
    "rollers": [{"name": "r1", "radius": 0.3, "centre": [0.0, 0.0, -0.301]}],
    "edges": {"entry": {"fixed": ["x", "z"]}},
    "stages": [PULL, LAY],
}  # fmt: skip


def preview_of(tables: dict[str, Any]) -> Preview:
    return Preview.of(Assembly(Scene.model_validate(tables)))


def doubts(
    key: str = "", value: Any = None, last: dict[str, Any] | None = None, friction: bool = True
) -> list[str]:
    """Of the scene with one entry changed, and perhaps with a stage more."""
    tables = copy.deepcopy(TABLES)
    if key:
        table, entry = key.split(".")
        tables[table][entry] = value
    if last is not None:
        tables["stages"].append({"name": "last", "duration": 1.0, "friction": friction, **last})
    preview = preview_of(tables)
    found = serious(preview)
    assert warnings(preview)[: len(found)] == found
    return found


def test_a_sound_scene_gives_no_cause() -> None:
    assert doubts() == []
    assert doubts(last={"rollers": {"r1": {"surface_speed": 1.0}}}) == []
    assert doubts(last={"gravity": [0.0, 0.0, -9.81]}) == []
    assert doubts(last={"entry": {"release": True}}) == []  # friction holds what pulled before


@pytest.mark.parametrize(
    ("key", "value", "words", "hint"),
    [
        ("strip.refined", 0.25, "elements of 0.25 m cannot follow its radius", "refined=0.07"),
        ("contact.stiffness", 1e5, "sinks 0.36 m into roller r1", "contact.stiffness=1e+07"),
    ],
)
def test_what_cannot_lie_on_a_roller(key: str, value: float, words: str, hint: str) -> None:
    (found,) = doubts(key, value)
    assert words in found
    assert hint in found


@pytest.mark.parametrize(
    ("contact", "refined", "hint"),
    [({"onset": 0.05}, 0.1, "contact.onset=0.003"), ({}, 2.0, "strip.refined=0.07")],
)
def test_contact_that_is_felt_far_from_a_roller(
    contact: dict[str, float], refined: float, hint: str
) -> None:
    """A wide onset, given or of a coarse mesh, where the strip hardly turns."""
    tables = copy.deepcopy(TABLES) | {"contact": contact, "stages": TABLES["stages"][:1]}
    tables["strip"] |= {"cells": [2, 1], "refined": refined}
    (found,) = serious(preview_of(tables))
    assert "m away from roller r1, of radius 0.3 m" in found
    assert hint in found
    assert doubts() == []


@pytest.mark.parametrize(("pressure", "hint"), [(None, 0.003), (1.0, 0.0003)])
def test_graded_contact_is_made_harder_by_its_onset(pressure: float | None, hint: float) -> None:
    """Wide beside the smaller of two rollers, or under a pressure far below T/r."""
    given = {"onset": 0.1} if pressure is None else {"onset": 0.1, "pressure": pressure}
    tables = copy.deepcopy(TABLES) | {"contact": given}
    tables["rollers"].append({"name": "r2", "radius": 3.0, "centre": [0.0, 0.0, -9.0]})
    found = [told for told in serious(preview_of(tables)) if "r1" in told]
    assert len(found) == 1
    assert "into roller r1" in found[0]
    assert f"Try --set contact.onset={hint:.1g}" in found[0]
    tables["contact"]["onset"] = hint
    assert serious(preview_of(tables)) == []


@pytest.mark.parametrize(
    ("last", "friction", "words", "hint"),
    [
        ({"entry": {"release": True}}, False, "nothing holds the strip in x", "entry.release"),
        (
            {"entry": {"release": True}, "exit": {"force": [2e4, 0.0, 0.0]}},
            True,
            "only friction holds the strip in x in stage last, which pulls at its exit",
            "stages.last.exit.force",
        ),
        ({"exit": {"force": [0.0, 0.0, 0.0]}}, True, "without tension", "exit.force=[1.1e+03"),
        ({"gravity": [0.0, 0.0, -981.0]}, True, "the strip weighs 3.1e+04 N/m", "larger tension"),
    ],
)
def test_what_has_no_equilibrium(
    last: dict[str, Any], friction: bool, words: str, hint: str
) -> None:
    (found,) = doubts(last=last, friction=friction)
    assert words in found
    assert hint in found


def test_a_slack_strip_is_pulled_before_it_rubs() -> None:
    rubbing = {**PULL, "friction": True}
    tables = {**copy.deepcopy(TABLES), "stages": [rubbing, LAY]}
    (found,) = serious(preview_of(tables))
    assert "pulls a slack strip" in found
    assert "stages.pull.friction=false" in found
