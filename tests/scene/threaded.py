"""Scenes that are threaded, as tables, and what their runs end with."""

from __future__ import annotations

from typing import Any

import numpy as np

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.results.state import State

YOUNG, DENSITY = 2e11, 7850.0


def roller(name: str, x: float, z: float, radius: float, wrap: str, **others: Any) -> Any:
    return {"name": name, "radius": radius, "centre": (x, 0.0, z), "wrap": wrap, **others}


ONE = {
    "threading": {"tension": 1e4, "entry": (-2.0, 0.0, -1.0), "exit": (2.0, 0.0, -1.0)},
    "rollers": [roller("a", 0.0, -0.5, 0.5, "over")],
}
BRIDLE = {
    "strip": {"length": 8.0},
    "rollers": [roller("a", 0.0, -0.5, 0.5, "over"), roller("b", 0.6, -1.4, 0.5, "under")],
}
TOWER = {
    "strip": {"thickness": 5e-4, "refined": 0.04},
    "threading": {"tension": 1e4, "entry": (-0.4, 0.0, 0.0), "exit": (4.4, 0.0, 0.0)},
    "rollers": [
        roller(f"r{i}", 1.0 * i, 0.0 if i % 2 else 3.0, 0.4, "under" if i % 2 else "over")
        for i in range(5)
    ],
}
LEVELLER = {
    "strip": {"thickness": 5e-4, "length": 3.0, "cells": (30, 2)},
    "threading": {"tension": 2e4},
    "rollers": [
        roller(f"r{i}", 0.25 * i, 0.08 if i % 2 else -0.1, 0.1, "under" if i % 2 else "over")
        for i in range(5)
    ],
}


def scene_of(tables: dict[str, Any], kinematics: str = "section", **others: Any) -> Scene:
    """A steel strip of 1 mm that is threaded and then left alone."""
    made: dict[str, Any] = {
        "strip": {"width": 0.5, "thickness": 1e-3, "cells": (16, 2), "kinematics": kinematics},
        "material": {"young": YOUNG, "poisson": 0.3, "density": DENSITY},
        "contact": {"stiffness": 1e10, "eta": 10.0, "delta": 1e-3},
        "threading": {"tension": 1e4},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
        "stages": [{"duration": 1.0}],
    }
    for part in (tables, others):
        for name, table in part.items():
            both = isinstance(table, dict) and name in made
            made[name] = {**made[name], **table} if both else table
    return Scene.model_validate(made)


def ended(scene: Scene) -> tuple[Run, State]:
    """A run to its end, and the last state."""
    run = scene.run()
    *_, last = run
    assert run.outcome.done, run.message
    return run, last.state


def values(run: Run, state: State) -> Any:
    """Positions of the nodes, shape (3, nodes)."""
    strip = run.assembly.strip
    own = strip.nodal(state.full)[strip.node_values]
    return strip.nodes + strip.kinematics.embed(own.T) + strip.origin[:, None]


def turned(state: State) -> float:
    """Angle between the forces at the two ends (rad)."""
    entry, exit_ = state.edge_force("entry"), state.edge_force("exit")
    cosine = -(entry @ exit_) / np.linalg.norm(entry) / np.linalg.norm(exit_)
    return float(np.arccos(cosine))
