"""Scenes of the benchmarks: one strip of steel, one roller, effects one at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from anmstrip.driver.scene import Scene

TENSION, RADIUS = 1.0e4, 0.5  # N/m, m
CONTACT = {"stiffness": 1.0e10, "eta": 10.0, "delta": 1.0e-3}
FRICTION = {"law": "norton-hoff", "coefficient": 0.3, "exponent": 0.05, "omega": 0.1, "speed": 1.0}
MATERIAL = {"young": 2.0e11, "poisson": 0.3, "density": 7850.0}
SHEET = {"feed": False, "width": 1.0, "thickness": 1.0e-3}
ROLLER = {"name": "r1", "radius": RADIUS, "centre": [0.0, 0.0, -RADIUS - 1e-3]}
HELD = {"entry": {"fixed": ["x", "z"], "centred": True}}
CARRIED = {**HELD, "exit": {"fixed": ["z"]}}
PULL = {"name": "pull", "duration": 1.0, "exit": {"force": [TENSION, 0.0, 0.0]}}
DOWN = [TENSION, 0.0, -5773.5]  # N/m at the exit, 30° down

PLATE_STEPS = ("tension", "bending", "weight", "contact", "moving roller", "pressure")
STEPS = ("membrane", "bending", "weight", "contact", "moving roller", "friction", "pressure")


def steps_of(level: str) -> tuple[str, ...]:
    """Return the effects in the order in which :func:`growing` adds them."""
    return PLATE_STEPS if level == "plate" else STEPS


def growing(level: str, cells: tuple[int, int]) -> Iterator[tuple[str, Scene]]:
    """Yield the effect that was added, and the scene with all effects up to it.

    With contact the strip is threaded over a roller; a plate, which is not threaded, is pulled
    down on one at both ends, to half a degree.  The last stage has all effects; without friction
    it is rate-free.  Elements, ``cells`` along and across, are all of one size.
    """
    plate, steps = level == "plate", steps_of(level)
    for count, added in enumerate(steps, start=1):
        on = frozenset(steps[:count])
        strip = {**SHEET, "cells": list(cells), "refined": 10.0, "kinematics": level}
        strip["bending"] = "bending" in on
        tables = {"material": MATERIAL, "edges": CARRIED, "solver": {"tolerance": 1e-3}}
        roller, last = dict(ROLLER), {"name": "last", "duration": 0.02}
        threaded = "contact" in on and not plate
        if threaded:
            ends = {"entry": [-2.0, 0.0, -0.5], "exit": [2.0, 0.0, -0.5]}
            tables["threading"], roller["wrap"] = {"tension": TENSION, **ends}, "over"
        else:
            strip["length"] = 4.0
        if "weight" in on:
            last["gravity"] = [0.0, 0.0, -9.81]
        if "contact" in on:
            tables |= {"contact": CONTACT, "rollers": [roller]}
        if "moving roller" in on:
            last["rollers"] = {"r1": {"move": [0.0, 0.0, 2e-3]}}
        if "friction" in on:
            tables["friction"] = FRICTION
            last["rollers"]["r1"]["surface_speed"] = 0.1
        if "pressure" in on:
            last["pressure"] = 10.0
        if plate:
            down = {"move": [0.0, 0.0, -0.0175]}
            last |= {"entry": down, "exit": {**down, "force": [1.1 * TENSION, 0.0, 0.0]}}
        elif not threaded:
            last["exit"] = {"force": [1.1 * TENSION, 0.0, 0.0]}
        stages = [last] if threaded else [PULL, last]
        yield added, Scene.model_validate({"strip": strip, "stages": stages, **tables})


def _scene(
    level: str, cells: list[int], refined: float, tolerance: float, stages: list[Any], **more: Any
) -> Scene:
    """Return a scene of 4 m of strip above the roller."""
    strip = {**SHEET, "length": 4.0, "cells": cells, "refined": refined, "kinematics": level}
    tables = {"material": MATERIAL, "contact": CONTACT, "rollers": [ROLLER], "edges": HELD}
    solver = {"tolerance": tolerance}
    return Scene.model_validate(
        {**tables, "strip": strip, "stages": stages, "solver": solver} | more
    )


def capstan(
    level: str, across: int, refined: float, tolerance: float, *, stiffer: float | None = 1.0
) -> Scene:
    """Return a strip held at its entry while the roller turns under it for 0.6 s.

    ``stiffer`` is a factor on the stiffness of contact; None leaves contact to the mesh.
    """
    wrap = {"entry": {"move": [0.0, 0.0, -0.45]}, "exit": {"force": DOWN}}
    stages = [
        {**PULL, "friction": False},
        {"name": "wrap", "duration": 1.0, "friction": False, **wrap},
        {"name": "turn", "duration": 0.6, "rollers": {"r1": {"surface_speed": 1.0}}},
    ]
    stiff = {} if stiffer is None else {**CONTACT, "stiffness": stiffer * CONTACT["stiffness"]}
    cells = [16, across]
    return _scene(level, cells, refined, tolerance, stages, contact=stiff, friction=FRICTION)


def threaded(
    level: str, across: int, refined: float, tolerance: float, *, stiffer: float | None = 1.0
) -> Scene:
    """Return the same capstan, laid around the roller at once instead of pulled down on it."""
    whole = capstan(level, across, refined, tolerance, stiffer=stiffer).to_dict()
    down = np.radians(30.0)
    leaves = RADIUS * np.array([np.sin(down), 0.0, np.cos(down) - 1.0])
    end = leaves + 1.65 * np.array([np.cos(down), 0.0, -np.sin(down)])
    ends = {"entry": [-2.0, 0.0, -0.45], "exit": end.round(4).tolist()}
    whole["strip"].pop("length")
    whole["rollers"][0].update(centre=[0.0, 0.0, -RADIUS], wrap="over")
    whole["threading"] = {"tension": TENSION / np.cos(down), **ends}
    whole["stages"] = whole["stages"][2:]
    return Scene.model_validate(whole)


def pressed(level: str, across: int, refined: float, tolerance: float) -> Scene:
    """Return a strip pulled down over a roller at one end, without friction."""
    down = {"entry": {"move": [0.0, 0.0, -1.0]}, "exit": {"force": DOWN}}
    stages = [PULL, {"name": "press", "duration": 1.0, **down}]
    return _scene(level, [16, across], refined, tolerance, stages)


def lightly_wrapped(level: str, degrees: float, cells: tuple[int, int], refined: float) -> Scene:
    """Return a strip between two ends that a roller lifts in the middle, without friction."""
    lifted = 2.0 * float(np.tan(0.5 * np.radians(degrees))) + 1e-3
    lift = {"name": "lift", "duration": 1.0, "rollers": {"r1": {"move": [0.0, 0.0, lifted]}}}
    return _scene(level, list(cells), refined, 1e-6, [PULL, lift], edges=CARRIED)
