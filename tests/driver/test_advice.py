"""Every message that proposes a setting, on a scene that causes it: what is typed cures it."""

from __future__ import annotations

import ast
import copy
import json
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import test_diagnosis
import test_forewarnings
from test_diagnosis import stalled
from test_forewarnings import BRIDLE, LAY, PULL, WRONG, changed

import anmstrip
from anmstrip.advice.diagnosis import Failure, diagnosis
from anmstrip.advice.preview import Preview
from anmstrip.advice.units import other_units
from anmstrip.advice.warnings import OTHER_RULES, SERIOUS_RULES, warnings
from anmstrip.continuation.path import Outcome
from anmstrip.driver.run import Run
from anmstrip.driver.scene import RefinedRun, Scene
from anmstrip.simulation import march
from anmstrip.simulation.problem import Assembly
from pinch_rolls import DRAWN

FLAT, SHORT = test_forewarnings.TABLES, test_diagnosis.TABLES


def typed(message: str) -> list[str]:
    """Settings that a message tells to type, as they are pasted."""
    found = re.findall(r"--set (?:'([^']+)'(?=\s|$)|([\w.]+=\S+))", message)
    return [quoted or plain for quoted, plain in found]


def told(tables: dict[str, Any], settings: Sequence[str] = ()) -> list[str]:
    """All warnings before a run."""
    return warnings(Preview.of(Assembly(Scene.from_tables(tables, "line.toml", settings))))


def ended(tables: dict[str, Any], settings: Sequence[str] = (), most: int = 1500) -> Run:
    """A run with some settings more, to its end."""
    bounded = {**tables, "solver": {"max_tangents": most, **tables.get("solver", {})}}
    run = Run(Scene.from_tables(bounded, "line.toml", settings))
    for _ in run:
        pass
    return run


@cache
def done(text: str) -> str:
    """What a run stops with, nothing if it is done."""
    run = ended(ast.literal_eval(text))
    return "" if run.outcome.done else run.message


def merged(tables: dict[str, Any], **others: Any) -> dict[str, Any]:
    """A copy of a scene with other tables, or other values in them."""
    found = copy.deepcopy(tables)
    for name, table in others.items():
        both = isinstance(table, dict) and name in found
        found[name] = {**found[name], **table} if both else table
    return found


ARCH: dict[str, Any] = {
    "strip": {"kinematics": "section", "length": 1.0, "width": 0.1, "thickness": 5e-4,
              "coil_set": 4e-4},
    "material": {"young": 2e11, "poisson": 0.0},
    "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}},
    "rollers": [{"radius": 0.05, "centre": [0.0, 0.0, 0.1]}],
    "stages": [
        {"name": "bow", "exit": {"move": [-2e-3, 0.0, 0.0]}},
        {"name": "press", "rollers": {"r1": {"move": [0.0, 0.0, -0.06]}}},
    ],
}  # fmt: skip
"""A bow that a roller presses down until it snaps through."""


# before a run ------------------------------------------------------------------------------------

FREE = {"name": "last", "duration": 1.0, "entry": {"release": True}}
FLAT_LAID = merged(FLAT, stages=[PULL])
LOOSE = merged(
    BRIDLE,
    rollers=[{**roller, "drive": "idle"} for roller in BRIDLE["rollers"]],
    stages=[BRIDLE["stages"][0], {"name": "start", "duration": 0.1, "entry": {"release": True}}],
)
TOUCHING = merged(  # from 1.005 of the sum of the radii into one another
    changed(("rollers.1.centre", [0.0, 0.0, -0.603]), ("threading.exit", [4.3, 0.0, -0.8])),
    stages=[
        BRIDLE["stages"][0],
        {"name": "run", "duration": 1.0, "rollers": {"b": {"move": [0.0, 0.0, 0.1]}}},
    ],
)
OVER_ITS_ENTRY = merged(  # a roller that was drawn at random
    BRIDLE,
    strip={"thickness": 4e-4},
    rollers=[
        {"name": "a", "radius": 0.21, "centre": [1.9, 0.0, -0.21], "wrap": "over"},
        {"name": "b", "radius": 0.5, "centre": [0.04, 0.0, -0.58], "wrap": "under"},
    ],
    threading={"tension": 1.4e4, "entry": [0.0, 0.0, 0.0], "exit": [-0.47, 0.0, -0.03]},
    stages=[{"name": "run", "duration": 0.25, "rollers": {"b": {"move": [-0.14, 0.0, 0.17]}}}],
)
BILLY = merged(  # an idle roller below the strip is pushed up
    BRIDLE,
    rollers=[
        {"name": "a", "radius": 0.3, "centre": [0.0, 0.0, -0.3], "wrap": "over"},
        {"name": "billy", "radius": 0.1, "centre": [1.5, 0.0, -0.12], "drive": "idle"},
        {"name": "b", "radius": 0.3, "centre": [3.0, 0.0, -0.3], "wrap": "over"},
    ],
    threading={"entry": [-2.0, 0.0, -0.5], "exit": [5.0, 0.0, -0.5]},
    stages=[{"name": "push", "duration": 1.0, "rollers": {"billy": {"move": [0.0, 0.0, 0.08]}}}],
)
UPRIGHT = merged(
    BRIDLE,
    rollers=[{"name": "a", "radius": 0.3, "centre": [0.0, 0.0, -5.0], "wrap": "under"}],
    threading={"tension": 200.0, "entry": [-0.31, 0.0, 0.0], "exit": [0.31, 0.0, 0.0]},
    stages=[{"name": "hang", "duration": 1.0, "friction": False, "gravity": [0.0, 0.0, -9.81]}],
)
LET_GO = merged(
    BRIDLE,
    strip={"thickness": 1e-4},
    rollers=[{"name": "a", "radius": 0.2, "centre": [0.0, 0.0, -0.2], "wrap": "over"}],
    threading={"tension": 1e3, "entry": [-1.0, 0.0, 0.0], "exit": [1.0, 0.0, -0.5]},
    stages=[{"name": "last", "duration": 1.0, "friction": False, "exit": {"tension": 0.0}}],
)
CAPSTAN = merged(  # of which a steady stage asks more than e^(fπ/2)
    BRIDLE,
    friction={"coefficient": 0.15},
    rollers=[{"name": "a", "radius": 0.4, "centre": [0.0, 0.0, 0.0], "wrap": "over"}],
    threading={"tension": 1.4e4, "entry": [-3.0, 0.0, 0.4], "exit": [0.4, 0.0, -3.0]},
    stages=[{"name": "run", "steady": True, "entry": {"tension": 1.4e4},
             "exit": {"tension": 7e3}, "rollers": {"a": {"surface_speed": 3.0}}}],
)  # fmt: skip
BENT = merged(CAPSTAN, material={"young": 2e11, "poisson": 0.3, "yield_stress": 2e8}, stages=[
    {**CAPSTAN["stages"][0], "exit": {"tension": 1.2e4}}])  # fmt: skip
PLACES = (-1.6, -0.8, 0.0, 0.8, 1.6, 2.4)
PLATE = {  # which nothing holds but the rollers that carry it on
    "strip": {"kinematics": "section", "length": 4.0, "width": 2.0, "thickness": 0.02},
    "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
    "contact": {},
    "friction": {"coefficient": 0.3},
    "rollers": [{"radius": 0.15, "centre": [x, 0.0, -0.15]} for x in PLACES],
    "stages": [
        {"name": "settle", "duration": 1.0, "gravity": [0.0, 0.0, -9.81]},
        {"name": "carry", "duration": 0.5,
         "rollers": {f"r{k + 1}": {"surface_speed": 1.0} for k in range(len(PLACES))}},
    ],
}  # fmt: skip
LIFTED = merged(PLATE, rollers=[{"radius": 0.15, "centre": [x, 0.0, -0.155]} for x in PLACES])
ABOVE = merged(PLATE, rollers=[{"radius": 0.15, "centre": [x, 0.0, -0.1507]} for x in PLACES])
TIPPING = merged(  # drawn as if the plate began at x = 0
    PLATE,
    rollers=[{"radius": 0.15, "centre": [x, 0.0, -0.15]} for x in (0.4, 1.2, 2.0, 2.8, 3.6)],
    edges={"entry": {"fixed": ["x"]}},
    stages=PLATE["stages"][:1],
)
UNRUBBED: dict[str, Any] = {  # an idler with bearings that nothing turns
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 4e-4},
    "material": {"young": 2.1e11, "poisson": 0.3},
    "friction": {"coefficient": 0.3},
    "threading": {"tension": 5e3, "entry": [-2.0, 0.0, 0.2], "exit": [0.2, 0.0, -2.0]},
    "rollers": [{"name": "d", "radius": 0.2, "centre": [0.0, 0.0, 0.0], "wrap": "over",
                 "drive": "idle", "bearing": 20.0, "friction": 0.0}],
    "stages": [{"name": "run", "steady": True, "strip": {"speed": 1.0}}],
}  # fmt: skip
LET_GO_BEFORE: dict[str, Any] = {  # by the stage in time that follows a steady one
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 4e-4},
    "material": {"young": 2.1e11, "poisson": 0.3},
    "friction": {"coefficient": 0.3},
    "threading": {"tension": 5e3, "entry": [-2.0, 0.0, 0.2], "exit": [0.2, 0.0, -2.0]},
    "rollers": [{"name": "d", "radius": 0.2, "centre": [0.0, 0.0, 0.0], "wrap": "over"}],
    "stages": [
        {"name": "run", "steady": True, "entry": {"tension": 5e3}, "exit": {"tension": 6e3},
         "rollers": {"d": {"surface_speed": 2.0}}},
        {"name": "stop", "duration": 0.5, "rollers": {"d": {"surface_speed": 0.0}}},
        {"name": "slack", "friction": False, "exit": {"tension": 2e3}},
    ],
}  # fmt: skip
BRAKED_ALONE: dict[str, Any] = {  # at rest: 500 + 889 N/m by the brake, against 1100 N/m
    "strip": {"kinematics": "section", "width": 0.75, "thickness": 3e-4},
    "material": {"young": 2.1e11, "poisson": 0.3},
    "friction": {"coefficient": 0.2},
    "threading": {"tension": 1.1e3, "entry": [-2.0, 0.0, 0.3], "exit": [4.0, 0.0, -1.0]},
    "rollers": [
        {"name": "brake", "radius": 0.3, "centre": [0.0, 0.0, 0.0], "wrap": "over",
         "drive": "torque", "friction": 0.5},
        {"name": "turn", "radius": 0.15, "centre": [-1.5, 0.0, -2.0], "wrap": "under",
         "drive": "idle"},
        {"name": "drive", "radius": 0.3, "centre": [3.0, 0.0, -1.3], "wrap": "over"},
    ],
    "stages": [
        {"name": "on", "duration": 1.0, "entry": {"release": True, "tension": 500.0},
         "rollers": {"brake": {"torque": -130.0}}},
        {"name": "more", "duration": 1.0, "rollers": {"brake": {"torque": -200.0}}},
    ],
}  # fmt: skip
BENDER: dict[str, Any] = {  # drawn as if the plate began at x = 0
    "strip": {"kinematics": "section", "length": 0.8, "width": 0.5, "thickness": 6e-3},
    "material": {"young": 2.1e11, "poisson": 0.3, "yield_stress": 3e8, "plasticity": {}},
    "contact": {},
    "rollers": [
        {"name": "l", "radius": 0.05, "centre": [0.2, 0.0, -0.05]},
        {"name": "r", "radius": 0.05, "centre": [0.6, 0.0, -0.05]},
        {"name": "top", "radius": 0.05, "centre": [0.4, 0.0, 0.05]},
    ],
    "edges": {"entry": {"fixed": ["x"]}},
    "stages": [
        {"name": "press", "duration": 1.0, "rollers": {"top": {"move": [0.0, 0.0, -8e-3]}}},
        {"name": "lift", "duration": 1.0, "rollers": {"top": {"move": [0.0, 0.0, 0.0]}}},
    ],
}
BLOWN = merged(
    BRIDLE,
    threading={"tension": 1e4, "entry": [-2.0, 0.0, 0.0], "exit": [2.0, 0.0, -1.0]},
    rollers=[{"name": "r", "radius": 0.3, "centre": [0.0, 0.0, -0.3], "wrap": "over"}],
    edges={"entry": {"fixed": ["x", "z"]}},
    stages=[{"name": "run", "steady": True, "pressure": 1.7e3, "entry": {"tension": 1e4},
             "rollers": {"r": {"surface_speed": 1.0}}}],
)  # fmt: skip
FLOATED = merged(  # on rollers at pass line, by gas that bears more than its weight
    BLOWN,
    threading={"tension": 1.5e3, "entry": [-1.0, 0.0, 0.0], "exit": [13.0, 0.0, 0.0]},
    rollers=[{"name": name, "radius": 0.3, "centre": [x, 0.0, -0.3], "wrap": "over"}
             for name, x in (("in", 0.0), ("out", 12.0))],
    edges={"exit": {"fixed": ["z"]}},
    stages=[{**BLOWN["stages"][0], "pressure": 110.0, "gravity": [0.0, 0.0, -9.81],
             "entry": {"tension": 1.5e3},
             "rollers": {name: {"surface_speed": 1.0} for name in ("in", "out")}}],
)  # fmt: skip
DRAWN_BACK = merged(  # from right to left, to pass above the roller
    BLOWN,
    threading={"entry": [2.0, 0.0, -0.6], "exit": [-2.0, 0.0, -0.6]},
    edges={"exit": {"fixed": ["z"]}},
    stages=[{**BLOWN["stages"][0], "pressure": 0.0}],
)
STRETCHED = merged(
    BLOWN,
    material={"yield_stress": 2e8, "plasticity": {}},
    stages=[{"name": "run", "steady": True, "rollers": {"r": {"surface_speed": 1.0}},
             "entry": {"tension": 2.86e5}, "exit": {"tension": 2.86e5}}],
)  # fmt: skip
SLACK_BELT: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 0.5, "thickness": 8e-4},
    "material": {"young": 2e11, "poisson": 0.3, "expansion": 1.2e-5},
    "contact": {},
    "friction": {"coefficient": 0.2},
    "threading": {"tension": 2e4, "closed": True},
    "rollers": [
        {"name": "a", "radius": 0.3, "centre": [0.0, 0.0, 0.0], "wrap": "right"},
        {"name": "b", "radius": 0.3, "centre": [3.0, 0.0, 0.0], "wrap": "right", "drive": "idle"},
    ],
    "stages": [{"name": "run", "steady": True, "strip": {"temperature": 60.0},
                "rollers": {"a": {"surface_speed": 2.0}}}],
}  # fmt: skip
"""E t α ΔT = 115 kN/m against 20 kN/m: it stopped at steps that were too short, and said no why."""

HEATED = merged(
    changed(("edges.exit", {"fixed": ["x", "z"]}), ("material.expansion", 1.2e-5)),
    stages=[{"name": "heat", "friction": False, "strip": {"temperature": 60.0}}],
)
FOUGHT = merged(  # with the speed of a roller as such, not of the strip that it carries
    DRAWN,
    stages=[{**DRAWN["stages"][0], "entry": {"tension": 4e3},
             "rollers": {"lower": {"surface_speed": 1.0}, "upper": {"angular_speed": 10.0}}}],
)  # fmt: skip
PULLED_OFF = merged(
    SLACK_BELT,
    threading={"closed": False, "tension": 1e4, "entry": [-2.0, 0, -0.2], "exit": [2.0, 0, -0.2]},
    rollers=[{"name": "a", "radius": 0.4, "centre": [0.0, 0.0, -0.4], "wrap": "over"}],
    edges={"entry": {"fixed": ["x", "z"]}},
    stages=[
        {"name": "pull", "friction": False, "rollers": {"a": {"surface_speed": 1.0}},
         "exit": {"force": [9e3, 0.0, 3e3]}},
    ],
)  # fmt: skip

SWAPPED = merged(  # the strip doubles back to either roller
    BRIDLE,
    threading={"tension": 1e4, "entry": [2.4, 0.0, -1.6], "exit": [-4.0, 0.0, 0.0]},
    rollers=[{"name": "deflector", "radius": 0.25, "centre": [0.0, 0.0, -0.25], "wrap": "over"},
             {"name": "reel", "radius": 0.3, "centre": [2.0, 0.0, -1.5], "wrap": "over"}],
    stages=[{"name": "run", "steady": True, "entry": {"tension": 1e4},
             "rollers": {n: {"surface_speed": 1.0} for n in ("deflector", "reel")}}],
)  # fmt: skip
HEARTH = merged(  # idle supports bear three quarters of the weight, and hold their bearings' 4 N/m
    BRIDLE,
    strip={"width": 1.5, "thickness": 1.5e-3},
    material={"young": 1e11, "poisson": 0.3, "density": 7850.0},
    friction={"coefficient": 0.3},
    threading={"tension": 5e3, "entry": [-1.0, 0.0, 0.0], "exit": [13.0, 0.0, 0.0]},
    rollers=[{"name": "in", "radius": 0.15, "centre": [0.0, 0.0, -0.15], "wrap": "over"},
             *({"radius": 0.08, "centre": [x, 0.0, -0.08], "drive": "idle", "bearing": 0.5}
               for x in (3.0, 6.0, 9.0)),
             {"name": "out", "radius": 0.15, "centre": [12.0, 0.0, -0.15], "wrap": "over"}],
    edges={"exit": {"fixed": ["z"]}},
    stages=[{"name": "run", "steady": True, "gravity": [0.0, 0.0, -9.81],
             "entry": {"tension": 5e3}, "exit": {"tension": 5.2e3},
             "rollers": {name: {"surface_speed": 1.0} for name in ("in", "out")}}],
)  # fmt: skip
DEEP_LOOP = merged(  # w l = 38.5 N/m² · 4 m; the least pull of a level catenary is 0.7544 of that
    BRIDLE,
    strip={"width": 0.1, "thickness": 5e-4},
    material={"young": 2e11, "poisson": 0.3, "density": 7850.0},
    threading={"tension": 500.0, "entry": [-1.0, 0.0, 0.0], "exit": [5.0, 0.0, 0.0]},
    rollers=[{"name": n, "radius": 0.15, "centre": [x, 0.0, -0.15], "wrap": "over"}
             for n, x in (("a", 0.0), ("b", 4.0))],
    edges={"exit": {"fixed": ["z"]}},
    stages=[{"name": "hang", "friction": False, "gravity": [0.0, 0.0, -9.81],
             "exit": {"tension": 100.0}}],
)  # fmt: skip

LAID_AND_PULLED = {
    "strip": {"kinematics": "section", "length": 5.0, "width": 1.0, "thickness": 1e-3},
    "material": {"young": 7e10, "poisson": 0.3, "density": 2700.0},
    "contact": {},
    "rollers": [{"radius": 0.02, "centre": [x, 0.0, -0.02]} for x in (-2.4, -1.2, 0.0, 1.2, 2.4)],
    "edges": {"entry": {"fixed": ["x"]}},
    "stages": [{"name": "lay", "gravity": [0.0, 0.0, -9.81], "exit": {"tension": 22258.0}}],
}
JAWS = {name: {"fixed": ["x", "z"], "clamped": True} for name in ("entry", "exit")}
DRAWN_OUT = {
    "strip": {"kinematics": "section", "length": 1.0, "width": 0.2, "thickness": 1e-3},
    "material": {"young": 2e11, "poisson": 0.3},
    "edges": JAWS,
    "stages": [{"name": "draw", "exit": {"move": [1e-3, 0.0, 0.0]}},
               {"name": "let_go", "exit": {"release": True}}],
}  # fmt: skip
STEEP_PLATE = {
    "strip": {"kinematics": "plate", "length": 4.0, "width": 1.0, "thickness": 1e-3},
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {},
    "rollers": [{"radius": 0.5, "centre": [0.0, 0.0, -0.5]}],
    "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
    "stages": [{"exit": {"force": [1e4, 0.0, 0.0]}, "rollers": {"r1": {"move": [0.0, 0.0, 0.4]}}}],
}  # fmt: skip
MORE: list[tuple[dict[str, Any], str, list[str]]] = [
    (DRAWN_OUT, "the strip does not spring back", []),
    (SLACK_BELT, "in stage run lengthens the strip by 0.00072 of its length", []),
    (HEATED, "in stage heat lengthens the strip by 0.00072 of its length", []),
    (PULLED_OFF, "comes off roller a in stage pull, as stages.pull.exit.force turns its exit", []),
    (FOUGHT, "carry it on at 1 m/s and at -1 m/s, against each other", []),
    (STRETCHED, "286 MPa, beyond 231 MPa, at which all of the strip flows, on and on",
     ["stages.run.exit.tension=8e4", "stages.run.entry.tension=8e4"]),
    (merged(STRETCHED, material={"plasticity": {"isotropic_hardening": 5e8}}),
     "beyond 264 MPa, at which all of the strip stretches by more than 5 %",
     ["stages.run.exit.tension=8e4", "stages.run.entry.tension=8e4"]),
    (DRAWN_BACK, "passes below roller r by it", []),
    (BLOWN, "strip leaves roller r", []),
    (FLOATED, "leaves roller in", []),
    (merged(BLOWN, stages=[{**BLOWN["stages"][0], "pressure": -3e4}]), "of 2.1 m is no arc", []),
    (changed(("strip.kinematics", None)), "nothing varies across the strip", []),
    (STEEP_PLATE, "kinematics plate does not see that slopes reach", []),
    (merged(FLAT, strip={"refined": 0.25}), "cannot follow its radius", []),
    (merged(FLAT, contact={"stiffness": 1e5}), "the strip sinks 0.36 m into roller r1", []),
    (merged(FLAT, contact={"stiffness": None, "eta": None, "delta": None, "onset": 0.1,
                           "pressure": 1.0}), "into roller r1", []),
    (merged(FLAT_LAID, contact={"stiffness": None, "eta": None, "delta": None, "onset": 0.05}),
     "contact sets in", []),
    (merged(FLAT_LAID, contact={"stiffness": None, "eta": None, "delta": None},
            strip={"cells": [2, 1], "refined": 2.0}), "contact sets in", []),
    (changed(("contact.onset", 1e-13)), "contact.onset = 1e-13 m is near round-off", []),
    (LAID_AND_PULLED, "the tension of the exit in stage lay turns with the strip", []),
    (merged(LAID_AND_PULLED, stages=[{"name": "lay", "gravity": [0.0, 0.0, -9.81]},
                                     {"name": "float", "pressure": 148.0}]),
     "is more than the strip weighs, 26.5 Pa, and lifts it off", []),
    (merged(FLAT, stages=[{**PULL, "friction": True}, LAY]), "pulls a slack strip", []),
    (merged(FLAT, stages=[PULL, LAY, {**FREE, "friction": False}]),
     "nothing holds the strip in x in stage last", []),
    (UNRUBBED, "nothing rubs on the idle roller d: it stands", []),
    (LET_GO_BEFORE, "nothing holds the strip in x in stage slack", []),
    (LOOSE, "nothing says how fast the strip runs in stage start", []),
    (merged(FLAT, stages=[PULL, LAY, {"name": "last", "duration": 1.0,
                                      "exit": {"force": [0.0, 0.0, 0.0]}}]),
     "leaves the strip without tension", []),
    (LET_GO, "leaves the strip without tension", []),
    (DEEP_LOOP, "between a and b is pulled by 100 N/m, and hangs by no less than 116", []),
    (HEARTH, "friction, torques, bearings and weight hold 5.15e+03 N/m there",
     ["stages.run.exit.tension=5.1e3"]),
    (SWAPPED, "m inside of roller reel",
     ["threading.entry=[-4.0, 0, 0]", "threading.exit=[2.4, 0, -1.6]"]),
    (UPRIGHT, "weighs 385 N/m, and 200 N/m pull it: it slides down", []),
    (TOUCHING, "moves a and b 0.097 m into one another", ["stages.run.rollers.b.move=[0, 0, 0]"]),
    (OVER_ITS_ENTRY, "moves b 0.078 m over the entry of the strip", []),
    (changed(("stages.1.friction", False)), "roller a turns, but nothing rubs on it", []),
    (changed(("stages.1.rollers.b.surface_speed", 0.5)), "roller b goes at 0.5 m/s",
     ['rollers.b.drive="idle"', 'stages.run.rollers.b={}']),
    (changed(("friction", {"law": "norton-hoff", "coefficient": 0.2, "speed": 1e-8})),
     "acts as 0.283", ['friction.law="algebraic"']),
    (changed(("rollers.0.centre", [0.0, 0.0, 0.4]), ("stages.1.entry.tension", 4e4)),
     "the strip runs away", ["friction.coefficient=0.5"]),
    (CAPSTAN, "and on 90° of wrap friction holds 1.26 times", ["friction.coefficient=0.45"]),
    (LIFTED, "in stage settle nothing holds the strip in x", []),
    (BENT, "bending over a gives 275 MPa", ["material.plasticity={}"]),
    (BENT, "bending over a gives 275 MPa", ["rollers.a.radius=0.56"]),
    (CAPSTAN, "there is no stationary state", ["stages.run.entry.tension=8.8e3"]),
    (TIPPING, "tips over in stage settle: the rollers below it, from x = 0.4 to 2 m",
     [f"rollers.r{k + 1}.centre=[{x}, 0.0, -0.15]" for k, x in enumerate(PLACES[:5])]),
    (BRAKED_ALONE, "pulls at its entry by 500 N/m against 1.1e+03 N/m", []),
    (BENDER, "roller r is 0.2 m past an end of the strip, which lies from x = -0.4 to 0.4 m",
     [f"rollers.{name}.centre=[{x}, 0, {z}]" for name, x, z in
      (("l", -0.2, -0.05), ("r", 0.2, -0.05), ("top", 0.0, 0.05))]),
]  # fmt: skip
"""Scenes, words of what is told of them, and what is typed of advice that leaves a choice."""

FOLLOWED = {
    "material.young = 200000 is in Pa": ["material.young=2e11", "threading.tension=5e3"],
    "was it meant in GPa": ["material.young=2e11", "threading.tension=5e3"],
    "0.1 m inside of roller c": ["rollers.c.centre=[-2.0, 0.0, 0.41]"],
    "roller c is touched by nothing: the strip passes at 0.1 m": ["rollers.c.centre=[-2, 0, 0.2]"],
    "the strip comes off roller a in stage run": ["stages.run.rollers.b.move=[0, 0, 0.2]"],
    "which pulls at its entry by 4e+04 N/m against 1e+04 N/m, and on 222° of wrap friction "
    "holds 2.16 times": ["stages.run.entry.tension=2.1e4"],
    "on 111° of wrap friction holds 1.47 times": ["stages.run.entry.tension=1.4e4"],
    "on 222° of wrap friction holds 1.62 times": ["friction.coefficient=0.68"],
    "friction holds 1.33 times": ["stages.run.entry.tension=1.3e4"],
    "bending over a, b gives 1110 MPa at the surface, a strain of 0.51 %": ["strip.thickness=1e-3"],
    "a stress of 600 MPa, beyond 500 MPa": [
        "stages.run.entry.tension=1.5e5", "stages.run.exit.tension=1.5e5",
    ],
    "in stage run a span of the strip weighs": ["threading.tension=2e4"],
}  # fmt: skip
"""The same of the lines of ``test_forewarnings.py``."""

LONG = (
    "stage run moves a and b 0.1 m into one another",
    "was it meant in strains",
    "strip.flatness = 0.0001 is in I-units",
    "in stage settle nothing holds the strip in x",
    "in stage run a span of the strip weighs",
)
"""What takes long to cure."""

SAID = [(changed(*changes), words, FOLLOWED.get(words, [])) for changes, words, _ in WRONG] + MORE


@pytest.mark.parametrize(
    ("tables", "words", "chosen"),
    [pytest.param(*s, marks=[pytest.mark.slow] * (s[1] in LONG), id=s[1][:40]) for s in SAID],
)
def test_what_is_told_before_a_run_is_cured_by_what_is_typed(
    tables: dict[str, Any], words: str, chosen: list[str]
) -> None:
    """The warning is gone, and the run is done."""
    before = told(tables)
    found = [line for line in before if words in line]
    assert len(found) == 1, before
    settings = chosen or typed(found[0])
    assert settings, found
    begin = re.split(r"[\d=]", found[0])[0]
    assert not [line for line in told(tables, settings) if line.startswith(begin)]
    scene = Scene.from_tables(tables, "line.toml", settings)
    assert not done(repr(scene.to_dict()))


def test_a_plate_that_rubs_from_the_start_needs_no_hold() -> None:
    """Friction under its own weight holds it as it settles, and carries it on."""
    assert not told(PLATE)
    run = Run(Scene.from_tables({**PLATE, "stages": PLATE["stages"][:1]}, "plate.toml"))
    *_, last = run
    assert run.outcome.done, run.message
    assert abs(last.state.full).max() < 1e-3 * PLATE["strip"]["length"]


def test_an_idler_on_which_nothing_rubs_stands() -> None:
    """Its bearings went on against the air for 5 500 tangents."""
    run = Scene.from_tables(UNRUBBED, "line.toml").run()
    *_, last = run
    assert run.outcome.done and run.cost.expansions < 20
    (roller,) = last.state.rollers.values()
    assert abs(roller.surface_speed) < 1e-6
    assert roller.tension_in == pytest.approx(roller.tension_out, rel=1e-6)


# where a run stops -------------------------------------------------------------------------------

STEEP = {
    "name": "wrap",
    "duration": 0.5,
    "friction": False,
    "entry": {"move": [0.0, 0.0, -0.45]},
    "exit": {"force": [1e4, 0.0, -5773.5]},
}
TURNING = {
    **SHORT,
    "contact": {"pressure": 2e4, "onset": 1e-4},
    "stages": [test_diagnosis.TENSION, STEEP, {**test_diagnosis.TURN, "duration": 0.4}],
}
HELD = {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}}
PUSH = {"name": "push", "duration": 2.0, "exit": {"move": [-0.01, 0.0, 0.0]}}
LIFT = {"name": "lift", "duration": 1.0, "friction": False, "entry": {"move": [0.0, 0.0, -0.45]}}
PRESS = {"name": "press", "duration": 1.0, "friction": False,
         "rollers": {"r2": {"move": [0.0, 0.0, -0.02]}}}  # fmt: skip
HEAVY = {"name": "heavy", "duration": 1.0, "friction": False, "gravity": [0.0, 0.0, -9.81]}

BOWED = {  # by heat between jaws, of which one then opens: it snaps
    "strip": {"kinematics": "section", "length": 1.0, "width": 0.2, "thickness": 1e-3,
              "imperfection": {"mode": 1, "amplitude": 1e-4}},
    "material": {"young": 2e11, "poisson": 0.3, "expansion": 1.2e-5},
    "edges": JAWS,
    "stages": [{"name": "heat", "strip": {"temperature": 20.0}},
               {"name": "let_go", "exit": {"release": True}}],
}  # fmt: skip
PULLED = changed(("stages.1.entry.tension", 1e6), ("stages.1.exit.tension", 1e6))

LOOP: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 1e-3, "finer": 2.0},
    "material": {"young": 2.1e11, "poisson": 0.3, "density": 7850.0},
    "friction": {"coefficient": 0.3},
    "threading": {"tension": 1e3, "entry": [-1.5, 0.0, 0.0], "exit": [7.5, 0.0, 0.0]},
    "rollers": [
        {"name": "a", "radius": 0.5, "centre": [0.0, 0.0, -0.5], "wrap": "over"},
        {"name": "b", "radius": 0.5, "centre": [6.0, 0.0, -0.5], "wrap": "over"},
    ],
    "edges": {"exit": {"fixed": ["z"]}},
    "stages": [{
        "name": "run", "steady": True, "gravity": [0.0, 0.0, -9.81],
        "entry": {"tension": 400.0}, "exit": {"tension": 400.0},
        "rollers": {"a": {"surface_speed": 0.5}, "b": {"surface_speed": 0.5}},
    }],
}  # fmt: skip
"""Strip that hangs through between two rollers, each of which it touches along a line."""

STOPS: dict[str, tuple[dict[str, Any], str, list[str]]] = {
    "too_many_steps": (
        merged(TURNING, solver={"tolerance": 1e-4, "max_tangents": 20}), "the allowed number", [],
    ),
    "not_held": (
        merged(SHORT, edges={"entry": {"fixed": ["z"]}}, stages=[test_diagnosis.TENSION]),
        "Nothing holds the strip in x", [],
    ),
    "round_off": (merged(BRIDLE, solver={"tolerance": 1e-10}), "near round-off", []),
    "stiff_strip": (
        changed(("strip.thickness", 4e-3), ("threading.tension", 1200.0)),
        "bends over √(D/T) = 0.99 m", [],
    ),
    "slack": (
        merged(SHORT, stages=[{**LIFT, "exit": {"force": [1e-3, 0.0, 0.0]}}]),
        "under no tension", [],
    ),
    "slack, by a tension": (
        merged(SHORT, stages=[{**LIFT, "exit": {"tension": 1e-3}}]),
        "Try --set stages.lift.exit.tension=1e+04", [],
    ),
    "slack, rubbing": (
        merged(SHORT, stages=[{**LIFT, "friction": True}], solver={"tolerance": 1e-7}),
        "under no tension", [],
    ),
    "slack, pressed": (
        merged(SHORT, material={"density": 7850.0}, stages=[HEAVY], edges={
            "entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}}),
        "and buckles", [],
    ),
    "snapping": (
        ARCH, "Try at most 0.82 of what stage press moves",
        ["stages.press.rollers.r1.move=[0.0, 0.0, -0.0492]"],
    ),
    "slack, pushed": (
        merged(SHORT, strip={"refined": 0.25, "coil_set": 1e-9}, edges=HELD, stages=[PUSH],
               rollers=[], solver={"max_tangents": 12}),
        "Try a larger x in stages.push.exit.move.", ["stages.push.exit.move=[0.01, 0.0, 0.0]"],
    ),
    "slack, let go": (
        BOWED, "Try a larger x in stages.heat.exit.move, before",
        ["stages.heat.exit.move=[2.399e-4, 0.0, 0.0]"],
    ),
    "sharp_contact": (
        merged(TURNING, contact={"onset": 1e-11}, solver={"tolerance": 1e-4}),
        "Contact sets in over 1e-11 m", [],
    ),
    "stiff_friction": (
        merged(SHORT, friction={"coefficient": 0.3, "speed": 1e-15, "law": "tanh"}),
        "Friction turns round", [],
    ),
    "sharp_friction": (LOOP, "there is a stationary state at the end of the stage", []),
    "low_order": (
        merged(SHORT, solver={"order": 2, "tolerance": 1e-6, "max_tangents": 300}),
        "Series of order 2 are short", [],
    ),
    "forewarned": (changed(("threading.tension", 9.0)), "was it meant in MPa", []),
}  # fmt: skip
"""Scenes that stop, words of what is told then, and what is typed of advice with a choice."""


@pytest.mark.parametrize("rule", STOPS)
def test_a_run_that_stops_is_done_with_what_is_typed(rule: str) -> None:
    tables, words, chosen = STOPS[rule]
    run = ended(tables)
    assert not run.outcome.done
    assert words.lower() in run.message.lower()
    settings = chosen or typed(run.message)
    assert settings, run.message
    again = ended(tables, settings)
    assert again.outcome.done, again.message


@pytest.mark.slow
def test_a_plate_that_is_held_to_settle_is_let_go_where_rollers_turn() -> None:
    """It then is carried as they turn, 0.25 m, and slips on none of those that it lies on."""
    advice = ['edges.entry.fixed=["x"]', "stages.carry.entry.release=true"]
    for tables in (ABOVE, LIFTED):  # where it touches its rollers, and where not yet
        begun = ended(tables, most=20)
        assert begun.state is not None
        stopped = Failure(begun.assembly, begun.scene.course[0], begun.state, stalled())
        assert typed(diagnosis(stopped)) == advice
    for tables in (PLATE, ABOVE):
        run = ended(tables, advice)
        assert run.outcome.done and run.state is not None
        lying = [r for r in run.state.rollers.values() if r.normal_force > 100.0]
        assert len(lying) > 2 and max(r.max_slip for r in lying) < 1e-3
    together = merged(LIFTED, stages=[{**PLATE["stages"][1], **PLATE["stages"][0]}])
    (found,) = [line for line in told(together) if "nothing holds" in line]
    assert "turn the rollers in a later stage, with entry.release = true there" in found
    settling = told(merged(LIFTED, stages=PLATE["stages"][:1]))
    (found,) = [line for line in settling if "holds the strip in x" in line]
    assert found.endswith("""Try --set 'edges.entry.fixed=["x"]'""")


GRAZED = merged(  # as high as those beside it, which bend the strip up by D/2rT = 1.5 mm
    BRIDLE,
    strip={"width": 1.2},
    rollers=[
        {"name": "a", "radius": 0.3, "centre": [0.0, 0.0, -0.3], "wrap": "over"},
        {"name": "c", "radius": 0.2, "centre": [1.5, 0.0, -0.1999], "wrap": "over",
         "drive": "idle"},
        {"name": "b", "radius": 0.3, "centre": [3.0, 0.0, -0.3], "wrap": "over"},
    ],
    threading={"tension": 2e4, "entry": [-1.0, 0.0, -1.0], "exit": [4.0, 0.0, -1.0]},
    stages=[
        {
            "name": "run", "steady": True,
            "entry": {"tension": 2e4}, "exit": {"tension": 1.99e4},
            "rollers": {"a": {"surface_speed": 2.0}, "b": {"surface_speed": 2.0}},
        }
    ],
)  # fmt: skip


def test_an_idler_that_bent_strip_does_not_touch_stands_still_and_is_told(tmp_path: Path) -> None:
    """Nothing but the air holds it; put up by twice the gap it is turned by the strip."""
    found = []
    for settings in ([], ["rollers.c.centre=[1.5, 0.0, -0.197]"]):
        run = Scene.from_tables(GRAZED, "line.toml", settings).run(tmp_path / str(len(settings)))
        for _ in run:
            pass
        assert run.outcome.done and run.state is not None, run.message
        told_of = [line for line in run.warnings if "roller c is touched by nothing" in line]
        found.append((told_of, run.state.rollers["c"]))
    (((words,), untouched), (nothing, touched)) = found
    gap = 18.3 / (2.0 * 0.3 * 2e4) - 1e-4  # D/2rT, less what it stands above the others
    assert f"passes at {gap:.2g}"[:13] in words and words.endswith("if it should")
    assert not nothing and untouched.surface_speed == 0.0
    assert touched.surface_speed == pytest.approx(2.0, rel=1e-3) and touched.normal_force > 10.0


def test_shorter_elements_do_not_blunt_friction() -> None:
    """They were halved for more than five minutes, on a path that friction stops on all of them."""
    run = Scene.from_tables(merged(LOOP, strip={"refined": "auto"}), "loop.toml").run()
    assert isinstance(run, RefinedRun)
    for _ in run:
        pass
    assert len(run.passes) == 1
    assert "Try --set friction.speed=" in run.message


def test_a_line_that_turned_back_is_left_where_it_had_come_to(tmp_path: Path) -> None:
    """Its tables are of that state, and not of one that it came back to."""
    run = Scene.from_tables(LOOP, "loop.toml").run(tmp_path)
    times = [step.time for step in run]
    assert run.outcome is Outcome.FOLD and run.state is not None
    assert run.state.time == max(times) > times[-1] + 0.1
    assert run.message.startswith(f"Stopped in stage run at t = {max(times):.6g} s")
    assert f"turned back at a limit point at t = {max(times):.4g}"[:-1] in run.message
    told = json.loads((tmp_path / "summary.json").read_text())["rollers"]["a"]
    assert told["tension_in"] == pytest.approx(run.state.rollers["a"].tension_in)


SUPPORTED = merged(
    BRIDLE,
    strip={"width": 1.3, "thickness": 5e-4},
    material={"young": 1.4e11},
    threading={"tension": 2500.0, "entry": [-3.0, 0.0, -2.0], "exit": [78.0, 0.0, -2.0]},
    rollers=[
        {"radius": 0.4, "centre": [25.0 * k, 0.0, z], "wrap": "over", "drive": "idle", "bearing": m}
        for k, (z, m) in enumerate(((0.0, 0.0), (0.01, 25.0), (0.01, 25.0), (0.0, 0.0)))
    ],
    stages=[{"name": "run", "steady": True, "gravity": [0.0, 0.0, -9.81], "strip": {"speed": 1.0}}],
)


def test_tolerances_above_round_off_are_reached() -> None:
    """A layer at the start of a stage, in which hardly anything moves, asks for no less than that.

    With 1e-6 of the tolerance allowed in it, or 1e-8, steps of one of these became too short.
    """
    for tolerance in (2e-10, 1e-11):
        run = ended(merged(SHORT, solver={"tolerance": tolerance}), most=400)
        assert run.outcome.done, run.message


FURNACE = merged(
    SUPPORTED,
    strip={"width": 1.0, "thickness": 1e-3},
    material={"density": 7800.0},
    threading={"tension": 4e3, "entry": [-1.0, 0.0, -2.0], "exit": [21.0, 0.0, -2.0]},
    edges={"entry": {"fixed": ["x", "z"]}},
    rollers=[
        {"name": "in", "radius": 0.3, "centre": [0.0, 0.0, -0.3], "wrap": "over"},
        {"name": "mid", "radius": 0.2, "centre": [10.0, 0.0, -0.2], "wrap": "over",
         "drive": "idle", "bearing": 2.0},
        {"name": "out", "radius": 0.3, "centre": [20.0, 0.0, -0.3], "wrap": "over"},
    ],
    stages=[
        {"name": "run", "steady": True, "gravity": [0.0, 0.0, -9.81], "entry": {"tension": 4e3},
         "rollers": {"in": {"surface_speed": 0.5}, "out": {"surface_speed": 0.5}}},
    ],
)  # fmt: skip


@pytest.mark.parametrize(
    "tables, name, drag",
    [
        (SUPPORTED, "r2", 25.0),
        (FURNACE, "mid", 2.0),
        (merged(FURNACE, material={"yield_stress": 1.5e8, "plasticity": {}}), "mid", 2.0),
    ],
    ids=("supports", "furnace", "strip that yields"),
)
def test_weight_is_put_on_before_strip_runs(tables: dict[str, Any], name: str, drag: float) -> None:
    """Only weight presses strip onto rollers at pass line, which hold back their drag."""
    run = Run(Scene.from_tables(tables, "line.toml", ["solver.max_tangents=250"]))
    states = [step.state for step in run]
    assert run.outcome.done, run.message
    assert run.state is not None
    assert all(s.controls["gravity"][2] == -9.81 for s in states if s.plan.steady)
    assert run.state.rollers[name].torque == pytest.approx(-drag, rel=0.02)
    assert run.state.rollers[name].max_slip < 1e-4


@pytest.mark.slow
def test_a_loop_on_short_elements_hangs_before_it_runs() -> None:
    """That takes 220 states; given up after 200, the run took 927 tangents."""
    settings = ["strip.finer=4", "friction.speed=1.3e-7", "solver.max_tangents=500"]
    run = Run(Scene.from_tables(LOOP, "loop.toml", settings))
    states = [step.state for step in run]
    assert run.outcome.done, run.message
    assert all(s.controls["gravity"][2] == -9.81 for s in states if s.plan.steady)


@pytest.mark.slow
def test_weight_that_cannot_be_put_on_in_few_states_has_a_stage_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(march, "MAX_WEIGHING_STATES", 1)
    heavy = [{**r, "bearing": 4.0 * r["bearing"]} for r in SUPPORTED["rollers"]]
    scene = merged(SUPPORTED, rollers=heavy)
    run = ended(scene)
    found = re.search(r"own with friction = false and gravity = (\[.*\])\.", run.message)
    assert found, run.message
    (steady,) = SUPPORTED["stages"]
    weight = {"name": "weight", "friction": False, "gravity": ast.literal_eval(found[1])}
    run = ended(merged(scene, stages=[weight, {**steady, "gravity": None}]))
    assert run.outcome.done, run.message


@pytest.mark.slow
def test_a_line_pulled_a_hundred_times_as_much_is_done_on_long_elements() -> None:
    """Its boundary layer becomes shorter than elements of 40 mm, which stopped it."""
    for refined in (None, 0.04, 0.1):
        run = ended(merged(PULLED, strip={"refined": refined}))
        assert run.outcome.done, run.message


def test_a_mesh_that_is_too_coarse_is_cured(tmp_path: Path) -> None:
    """At the end of a run, by its estimated errors."""
    given = ["strip.refined=0.8", "strip.cells=[4, 2]", "solver.tolerance=1e-3"]
    found = []
    for settings in (given, [*given, 'strip.refined="auto"']):
        run = Scene.from_tables(TURNING, "line.toml", settings).run(tmp_path / str(len(settings)))
        for _ in run:
            pass
        found.append([line for line in run.warnings if "elements of half the length" in line])
    assert typed(found[0][0]) == ['strip.refined="auto"']
    assert not found[1]


def test_a_mesh_that_does_not_keep_its_tolerance_is_cured(tmp_path: Path) -> None:
    """It was told in the table of errors alone, up to a tenth of the tension."""
    given = ["strip.refined=0.2", "solver.tolerance=1e-3"]
    tight = [*given, "solver.mesh_tolerance=2e-3"]
    found = []
    for k, settings in enumerate((given, tight, [*tight, 'strip.refined="auto"'])):
        run = Scene.from_tables(TURNING, "line.toml", settings).run(tmp_path / str(k))
        for _ in run:
            pass
        found.append([line for line in run.warnings if "elements of half the length" in line])
    (line,) = found[1]
    assert "above solver.mesh_tolerance = 0.002 of" in line
    assert typed(line) == ['strip.refined="auto"']
    assert not found[0] and not found[2]


BRAKED = merged(
    CAPSTAN,
    rollers=[{**CAPSTAN["rollers"][0], "drive": "torque"}],
    stages=[
        {"name": "run", "duration": 0.2, "entry": {"speed": 1.0}},
        {"name": "brake", "duration": 1.0, "rollers": {"a": {"torque": -1300.0}}},
    ],
)
PUSHED = merged(
    SHORT, strip={"refined": 0.25, "coil_set": 1e-9}, edges=HELD, stages=[PUSH], rollers=[]
)


CARRIED = merged(  # on past an exit that is held
    BRIDLE,
    edges={"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}},
    stages=[
        {"name": "run", "steady": True, "strip": {"speed": 1.0}},
        {"name": "on", "duration": 0.1},
    ],
    rollers=[{**roller, "drive": "idle"} for roller in BRIDLE["rollers"]],
)


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        (BRAKED, "roller a turns through under the strip: of its torque of -1300 N m"),
        (PUSHED, "the strip is pressed by 4.98e+05 N/m over 4 m"),
        (
            CARRIED,
            "(taken for a strain of 0.5 %, as there is no material.yield_stress): what is held",
        ),
    ],
)
def test_what_a_last_state_shows_is_cured(
    tables: dict[str, Any], words: str, tmp_path: Path
) -> None:
    """A brake ran backwards at 2e7 m/s and straight strip bore 500 MPa, without a word."""

    def warned(settings: Sequence[str], name: str) -> list[str]:
        run = Scene.from_tables(tables, "line.toml", settings).run(tmp_path / name)
        for _ in run:
            pass
        assert run.outcome.done, run.message
        return [line for line in run.warnings if words in line]

    (line,) = warned([], "typed")
    assert not warned(typed(line), "cured")


# all of them -------------------------------------------------------------------------------------

ELSEWHERE = {
    "curled_edges": "of sections that shells replace, in test_curled_edges.py",
    "many_tangents": "test_forewarnings.py",
    "smaller_torques": "words of beyond_capacity",
    "given_force": "words of nip_forces, in test_press.py",
    "closer_rollers": "words of beyond_capacity and others, in test_nip.py and test_press.py",
    "pulled_off": "words of untouched_roller",
    "rates_of_labels": "of a user's own effects, in test_own_effects.py",
    "squeezed": "test_diagnosis.py, test_nip.py",
    "sharp_line": "test_diagnosis.py",
    "sharp_nip": "test_nip.py",
    "tips_over": "told where nothing pulls, among what is told before a run",
    "lifted_off": "of an idler that bent strip does not touch",
    "pulled_twice": "test_forewarnings.py",
    "undriven": "test_steady.py",
    "standing_idlers": "test_steady.py",
    "heavy_bearings": "test_forewarnings.py",
    "proposed_keys": "reads what others propose",
    "spinning_rollers": "of what a last state shows",
    "buckled_section": "of what a last state shows",
    "bowed_instead": "of buckled_section, in test_imperfection.py and test_clamps.py",
    "wrinkled_instead": "test_clamps.py",
    "held_across": "test_reported_plasticity.py",
    "overstretched": "of what a last state shows",
    "guessed_rate": "test_reported_plasticity.py",
    "coarse_hinges": "test_reported_plasticity.py",
    "unresolved_waves": "test_wrinkle_onsets.py",
    "turned_axis": "test_forewarnings.py",
    "where_it_slides": "test_diagnosis.py",
    "_read": "of a map, in test_operating_map.py",
    "beside_rollers": "of a state beside its rollers, in test_steady.py",
    "uneven_heat": "test_diagnosis.py",
    "pressed_by_ends": "test_diagnosis.py",
    "sinking_exit": "test_forewarnings.py",
    "slipping_nips": "test_loops.py",
    "uneven_fibres": "test_forewarnings.py",
    "loose_fibres": "test_forewarnings.py",
    "raised_tensions": "of loose_fibres, in test_forewarnings.py",
    "too_large": "test_diagnosis.py",
    "asked_too_much": "test_diagnosis.py",
    "more_tension": "slack, and test_random_lines.py of a threaded line",
    "coarse": "of the line pulled a hundred times as much",
    "of_mesh": "the budget, of a mesh that is too coarse",
    "propose_one_mesh": "reads what others propose, in test_wrinkle_onsets.py",
    "shorter": "of the budget, in test_wrinkle_onsets.py",
    "holding_ends": "of what a last state shows, in test_feeding.py",
    "useless": "test_reported_errors.py",
    "of_path": "test_reported_errors.py",
    "motions_at": "test_freedom.py",
    "motion_words": "test_freedom.py",
    "differences": "test_resume.py",
    "finer_mesh": "coarse_mesh, and two rules in test_units.py",
    "shorter_elements": "coarse_mesh, in test_defaults.py",
    "unheld_words": "unheld_strip, not_held",
    "why_speed_is_free": "released_strip",
    "yielding_instead": "beyond_yield",
    "stays_elastic": "of a last state, in test_reported_plasticity.py",
    "below_round_off": "round_off, strict_tolerance",
    "typed_speed": "unequal_speeds, opposed_nip",
    "typed_place": "closer_rollers, in test_nip.py",
    "shorter_move": "meeting_rollers, roller_over_an_end",
    "refuse_both": "test_sweep.py",
    "variants": "test_sweep.py",
    "unknown_name": "of a response, in test_reported_response.py",
}
"""Functions that propose something and have another name or place."""


def proposing(path: Path) -> set[str]:
    """Functions of a module that propose something, in other strings than their docstrings."""
    found = set()
    for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(function, ast.FunctionDef):
            told = ast.get_docstring(function, clean=False)
            texts = (node.value for node in ast.walk(function) if isinstance(node, ast.Constant))
            if any(re.search(r"\b[Tt]ry |--set ", t) for t in texts if str(t) == t != told):
                found.add(function.name)
    return found


def test_every_function_that_proposes_a_setting_is_tested() -> None:
    root = Path(anmstrip.__file__).parent
    files = [*root.glob("advice/*.py"), *root.glob("driver/*.py")]
    wanted = set().union(*map(proposing, files)) - set(ELSEWHERE) - set(STOPS)
    scenes = [Scene.from_tables(tables, "line.toml") for tables, _, _ in SAID]
    previews = [Preview.of(Assembly(scene)) for scene in scenes]
    all_of_them = (other_units, *SERIOUS_RULES, *OTHER_RULES)
    rules = [rule for rule in all_of_them if rule.__name__ in wanted]
    assert wanted == {rule.__name__ for rule in rules}
    for rule in rules:
        assert any(any(True for _ in rule(preview)) for preview in previews), rule.__name__


def test_rules_read_the_stages_up_to_a_stop() -> None:
    """As where a threaded strip that both ends hold stops while it is laid on."""
    for tables, _, _ in SAID:
        whole = Preview.of(Assembly(Scene.from_tables(tables, "line.toml")))
        for until in range(1, len(whole.plans)):
            seen = replace(whole, plans=whole.plans[:until], strings=whole.strings[:until])
            assert [stage.name for stage in seen.stages] == [plan.name for plan in seen.plans]
            for rule in SERIOUS_RULES:
                assert all(rule(seen)), rule.__name__
