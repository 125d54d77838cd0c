"""Scenes of the studies, as tables: one strip of steel, one roller, effects one at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from anmstrip.driver.scene import Scene

TENSION, RADIUS = 1.0e4, 0.5
CONTACT = {"stiffness": 1.0e10, "eta": 10.0, "delta": 1.0e-3}
FRICTION = {"coefficient": 0.3, "exponent": 0.05, "omega": 0.1, "speed": 1.0}
MATERIAL = {"young": 2.0e11, "poisson": 0.3, "density": 7850.0}
GRAVITY = [0.0, 0.0, -9.81]

PLATE_STEPS = ("tension", "bending", "weight", "contact", "moving roller", "pressure")
STEPS = ("membrane", "bending", "weight", "contact", "moving roller", "friction", "pressure")
"""Effects in the order in which they are added."""


def steps_of(level: str) -> tuple[str, ...]:
    """What is added one after the other at a level of kinematics."""
    return PLATE_STEPS if level == "plate" else STEPS


def growing(level: str, cells: tuple[int, int]) -> Iterator[tuple[str, Scene]]:
    """The same strip with one effect more at a time.

    With contact it is threaded over a roller; a plate, which is not threaded, is pulled down
    on one at both ends, to half a degree.

    Parameters
    ----------
    level : str
    cells : tuple of int
        Along, across; the elements are all of one size.

    Yields
    ------
    added, scene
    """
    steps = steps_of(level)
    for count, added in enumerate(steps, start=1):
        on = frozenset(steps[:count])
        tables = {
            "strip": _strip(level, cells, on),
            "material": MATERIAL,
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
            "stages": _stages(level, on),
            "solver": {"tolerance": 1e-3},
            **(_rolled(level, on) if "contact" in on else {}),
        }
        yield added, Scene.model_validate(tables)


def _strip(level: str, cells: tuple[int, int], on: frozenset[str]) -> dict[str, Any]:
    table = {"width": 1.0, "thickness": 1.0e-3, "cells": list(cells), "refined": 10.0}
    table |= {"kinematics": level, "bending": "bending" in on}
    threaded = "contact" in on and level != "plate"
    return table if threaded else {**table, "length": 4.0}


def _rolled(level: str, on: frozenset[str]) -> dict[str, Any]:
    """Tables of the roller and what it does."""
    tables: dict[str, Any] = {"contact": CONTACT}
    roller = {"name": "r1", "radius": RADIUS, "centre": [0.0, 0.0, -RADIUS - 1e-3]}
    if level != "plate":
        ends = {"entry": [-2.0, 0.0, -0.5], "exit": [2.0, 0.0, -0.5]}
        tables["threading"] = {"tension": TENSION, **ends}
        roller["wrap"] = "over"
    if "friction" in on:
        tables["friction"] = FRICTION
    return {**tables, "rollers": [roller]}


def _stages(level: str, on: frozenset[str]) -> list[dict[str, Any]]:
    """The last stage has all effects; without friction it is rate-free."""
    last: dict[str, Any] = {"name": "last", "duration": 0.02}
    if "weight" in on:
        last["gravity"] = GRAVITY
    if "moving roller" in on:
        last["rollers"] = {"r1": {"move": [0.0, 0.0, 2e-3]}}
    if "friction" in on:
        last["rollers"]["r1"]["surface_speed"] = 0.1
    if "pressure" in on:
        last["pressure"] = 10.0
    if level == "plate":
        down = {"move": [0.0, 0.0, -0.0175]}
        return [_pull(), {**last, "entry": down, "exit": {**down, "force": [1.1e4, 0.0, 0.0]}}]
    more = {"force": [1.1 * TENSION, 0.0, 0.0]}
    return [last] if "contact" in on else [_pull(), {**last, "exit": more}]


def _pull() -> dict[str, Any]:
    return {"name": "pull", "duration": 1.0, "exit": {"force": [TENSION, 0.0, 0.0]}}


def capstan(
    level: str, across: int, refined: float, tolerance: float, *, stiffer: float | None = 1.0
) -> Scene:
    """A strip held at its entry while the roller turns under it for 0.6 s.

    ``stiffer`` is a factor on the stiffness of contact; None leaves contact to the mesh.
    """
    strip = {"length": 4.0, "width": 1.0, "thickness": 1.0e-3, "cells": [16, across]}
    wrap = {"entry": {"move": [0.0, 0.0, -0.45]}, "exit": {"force": [TENSION, 0.0, -5773.5]}}
    return Scene.model_validate(
        {
            "strip": {**strip, "refined": refined, "kinematics": level},
            "material": MATERIAL,
            "contact": _contact(stiffer),
            "friction": FRICTION,
            "rollers": [{"name": "r1", "radius": RADIUS, "centre": [0.0, 0.0, -RADIUS - 1e-3]}],
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
            "stages": [
                {**_pull(), "friction": False},
                {"name": "wrap", "duration": 1.0, "friction": False, **wrap},
                {"name": "turn", "duration": 0.6, "rollers": {"r1": {"surface_speed": 1.0}}},
            ],
            "solver": {"tolerance": tolerance},
        }
    )


def _contact(stiffer: float | None) -> dict[str, float]:
    if stiffer is None:
        return {}
    return {**CONTACT, "stiffness": stiffer * CONTACT["stiffness"]}


def threaded(
    level: str, across: int, refined: float, tolerance: float, *, stiffer: float | None = 1.0
) -> Scene:
    """The same capstan, the strip laid around the roller at once instead of pulled down on it."""
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
    """A strip pulled down over a roller at one end, without friction."""
    down = {"entry": {"move": [0.0, 0.0, -1.0]}, "exit": {"force": [TENSION, 0.0, -5773.5]}}
    strip = {"length": 4.0, "width": 1.0, "thickness": 1.0e-3, "cells": [16, across]}
    return Scene.model_validate(
        {
            "strip": {**strip, "refined": refined, "kinematics": level},
            "material": MATERIAL,
            "contact": CONTACT,
            "rollers": [{"name": "r1", "radius": RADIUS, "centre": [0.0, 0.0, -RADIUS - 1e-3]}],
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
            "stages": [_pull(), {"name": "press", "duration": 1.0, **down}],
            "solver": {"tolerance": tolerance},
        }
    )


def lightly_wrapped(level: str, degrees: float, cells: tuple[int, int], refined: float) -> Scene:
    """A strip between two ends that a roller lifts in the middle, without friction."""
    lifted = 2.0 * float(np.tan(0.5 * np.radians(degrees))) + 1e-3
    up = {"r1": {"move": [0.0, 0.0, lifted]}}
    strip = {"length": 4.0, "width": 1.0, "thickness": 1.0e-3, "cells": list(cells)}
    return Scene.model_validate(
        {
            "strip": {**strip, "refined": refined, "kinematics": level},
            "material": MATERIAL,
            "contact": CONTACT,
            "rollers": [{"name": "r1", "radius": RADIUS, "centre": [0.0, 0.0, -RADIUS - 1e-3]}],
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
            "stages": [
                _pull(),
                {
                    "name": "lift",
                    "duration": 1.0,
                    "rollers": up,
                },
            ],
            "solver": {"tolerance": 1e-6},
        }
    )
