"""Wrinkles before a roller that is crowned, and before one that is out of line.

A strip of 1 m × 0.2 mm over a roller that is 0.8 mm thinner at the strip's edges: smooth at 22
kN/m, and as the tension is lowered, about to wrinkle at 18.0 kN/m, 0.16 m apart, as
2 √π (D/T)^(1/4) √L says within 2 %.  A strip of 0.5 m × 0.1 mm that is led straight onto a roller
5 mrad out of line: with friction it is carried to the side, sheared, and after 0.03 m it wrinkles
askew, 2.0 thicknesses high after 0.04 m; without friction it stays smooth.  The second is written
for ParaView, with a picture of the moment across.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from anmstrip import Scene
from anmstrip.fem.operators import CellOperator
from anmstrip.pictures.render import render
from anmstrip.results.state import State
from anmstrip.results.wrinkles import Wrinkling, buckling, mode_heights

CONTACT = {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3}

NEAR = 1.01
"""Growth of the compression that would buckle the strip, at what is called the onset."""


def crowned_scene(cells: tuple[int, int], refined: float) -> Scene:
    """Return a strip over a crowned roller whose tension is lowered from 22 to 15 kN/m."""
    radius, free, half, crown, width = 0.4, 0.8, np.radians(5.0), 8e-4, 1.0
    x = radius * np.sin(half) + free * np.cos(half)
    z = radius * (np.cos(half) - 1.0) - free * np.sin(half)
    ease = {"exit": {"force": [1.5e4 * float(np.cos(half)), 0.0, 0.0]}}
    tables: dict[str, Any] = {
        "strip": {"width": width, "thickness": 2e-4, "cells": cells, "refined": refined,
                  "feed": False},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": CONTACT,
        "rollers": [{"name": "r1", "centre": [0.0, 0.0, -radius], "wrap": "over",
                     "radius": radius, "crown": [0.0, -crown / (0.5 * width) ** 2]}],
        "threading": {"tension": 2.2e4, "entry": [-x, 0.0, z], "exit": [x, 0.0, z]},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
        "stages": [{"name": "ease", "duration": 1.0, **ease}],
        "solver": {"tolerance": 1e-6, "order": 15},
    }  # fmt: skip
    return Scene.model_validate(tables)


def skewed_scene(cells: tuple[int, int], refined: float, way: float, friction: float) -> Scene:
    """Return a strip that is conveyed by a way (m) onto a roller 5 mrad out of line.

    Without friction it stays where threading brings it.  ν = 0, so that the entry can be held all
    along without any stress.
    """
    radius, before, behind, wrap, speed = 0.2, 0.6, 0.3, np.radians(40.0), 0.5
    x = radius * np.sin(wrap) + behind * np.cos(wrap)
    z = radius * (np.cos(wrap) - 1.0) - behind * np.sin(wrap)
    turn = {"rollers": {"r1": {"surface_speed": speed}}}
    away = {"entry": {"velocity": [speed, 0.0, 0.0]}}
    tables: dict[str, Any] = {
        "strip": {"width": 0.5, "thickness": 1e-4, "cells": cells, "refined": refined,
                  "feed": False},
        "material": {"young": 2e11, "poisson": 0.0},
        "contact": CONTACT,
        "rollers": [{"name": "r1", "centre": [0.0, 0.0, -radius], "wrap": "over",
                     "radius": radius, "axis": [5e-3, 1.0, 0.0]}],
        "threading": {"tension": 1e4, "entry": [-before, 0.0, 0.0], "exit": [x, 0.0, z]},
        "edges": {"entry": {"fixed": ["x", "y", "z"]}},
        "stages": [{"name": "rest", "duration": 1.0}],
    }  # fmt: skip
    if friction:
        tables |= {
            "friction": {
                "coefficient": friction,
                "law": "norton-hoff",
                "exponent": 0.1,
                "speed": 1e-3,
            },
            "solver": {"tolerance": 1e-3},
            "stages": [
                {"name": "hold", "duration": 0.02},
                {"name": "start", "duration": 0.02, **away, **turn},
                {"name": "run", "duration": way / speed - 0.01},
            ],
        }
    return Scene.model_validate(tables)


def factor(state: State) -> float:
    """Return the growth of the compression at which the strip would buckle."""
    return float(buckling(state, 1)[0][0])


def onset(scene: Scene) -> State:
    """Return the state in which the strip is about to buckle, inside a step of its path."""
    end = next(step.state for step in scene.run() if factor(step.state) < NEAR)
    assert end.branch is not None
    length = end.branch.length
    return end.inside(brentq(lambda a: factor(end.inside(a)) - NEAR, 0.0, length, rtol=1e-4))


def crowned(cells: tuple[int, int], refined: float) -> None:
    """Find the tension below which a strip wrinkles over a crown, and the wavelength."""
    state = onset(crowned_scene(cells, refined))
    strip, tension = state.plan.model.strip, state.tension("exit")
    operator = CellOperator(strip, (0, 1))
    mode = mode_heights(state, buckling(state, 1)[1][:, 0])
    height, *slopes = operator.apply(mode)[2] ** 2 @ operator.weights
    along, across = (2.0 * np.pi * np.sqrt(height / slope) for slope in slopes)
    formula = 2.0 * np.sqrt(0.5 * np.pi * along) * (strip.bending_stiffness / tension) ** 0.25
    print(f"crown 0.8 mm: wrinkles below {tension:.0f} N/m, {across:.4f} m apart, "
          f"by the formula {formula:.4f} m")  # fmt: skip
    assert abs(across / formula - 1.0) < 0.1


def skewed(cells: tuple[int, int], refined: float, way: float, directory: Path) -> None:
    """Compare the heights of wrinkles without and with friction."""
    for name, friction in (("without", 0.0), ("with", 0.3)):
        scene = skewed_scene(cells, refined, way, friction)
        *_, last = scene.run(directory if friction else None)
        wrinkling = Wrinkling(last.state)
        heights = wrinkling.amplitudes()
        assert heights is not None
        print(f"{name} friction: {heights[0] / scene.strip.thickness:.3f} t high")
    for warning in wrinkling.warnings:
        print(warning)
    print(*render(directory, "bending_moment.yy"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarse meshes, a shorter way")
    parser.add_argument("-o", type=Path, default=Path("results/roller_wrinkles"), help="where to")
    given = parser.parse_args()
    if given.quick:
        crowned((12, 12), 1e-2)
        skewed((8, 6), 2e-2, 0.01, given.o)
    else:
        crowned((16, 16), 7.5e-3)
        skewed((14, 12), 1.2e-2, 0.04, given.o)
