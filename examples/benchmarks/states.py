"""Errors of path and time at every accepted state, estimated and true, in eight scenes.

The truth comes from a run with a far stricter tolerance on the same mesh and laws, interpolated
between its steps by the polynomials of its own formulas.  The largest error of a tension at the
ends and beside every roller counts over the tension scale, that of a position over the length.
"""

from __future__ import annotations

import warnings
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.driver.budget import part
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.results.state import State
from harness import Cell, Report, Sheet, main

TOLERANCES = tuple(10.0**-k for k in range(3, 9))

Tables = dict[str, Any]


def line(
    strip: Tables, tension: float, ends: Tables, rollers: list[Tables], stages: list[Tables],
    friction: float | None = None, **more: Any,
) -> Tables:
    """Return the tables of a threaded strip that is held at its entry."""
    steel = {"young": 2e11, "poisson": 0.3, "density": 7850.0}
    tables: Tables = {
        "strip": {"kinematics": "section", **strip}, "material": steel, "contact": {},
        "threading": {"tension": tension, **ends}, "rollers": rollers,
        "edges": {"entry": {"fixed": ["x", "z"]}}, "stages": stages, **more,
    }
    return tables if friction is None else tables | {"friction": {"coefficient": friction}}


def roller(name: str, radius: float, x: float, z: float, wrap: str, **more: Any) -> Tables:
    """Return the table of a roller."""
    return {"name": name, "radius": radius, "centre": [x, 0.0, z], "wrap": wrap, **more}


def speeds(**given: float) -> Tables:
    """Return what rollers are driven at (m/s) at the end of a stage."""
    return {name: {"surface_speed": speed} for name, speed in given.items()}


SCENES: dict[str, Tables] = {
    "brake bar, section": line(
        {"width": 0.6, "thickness": 3e-4}, 4e3,
        {"entry": [-0.8, 0.0, 0.1], "exit": [0.5, 0.0, -0.7]},
        [roller("bar", 0.12, 0.0, 0.0, "over")],
        [{"name": "go", "duration": 0.4, "entry": {"velocity": [0.3, 0.0, 0.0]}},
         {"name": "slow", "duration": 0.3, "entry": {"velocity": [0.05, 0.0, 0.0]}}], 0.18,
    ),
    "pair of rolls, section": line(
        {"width": 0.9, "thickness": 6e-4}, 6e3,
        {"entry": [-1.2, 0.0, 0.35], "exit": [1.5, 0.0, -1.25]},
        [roller("a", 0.3, 0.0, 0.0, "over"), roller("b", 0.3, 0.25, -0.9, "under")],
        [{"name": "turn", "duration": 0.3, "rollers": speeds(a=0.4)},
         {"name": "both", "duration": 0.3, "rollers": speeds(b=0.6)}], 0.12,
    ),
    "tension up and down, section": line(
        {"width": 1.1, "thickness": 4e-4}, 9e3,
        {"entry": [-1.0, 0.0, -0.25], "exit": [0.9, 0.0, 0.8]},
        [roller("r", 0.25, 0.0, 0.0, "under")],
        [{"name": "up", "duration": 0.5, "exit": {"tension": 1.3e4}},
         {"name": "down", "duration": 0.5, "exit": {"tension": 7e3}}], 0.3,
    ),
    "sag and lift, section": line(
        {"width": 1.0, "thickness": 5e-4}, 3e3,
        {"entry": [0.0, 0.0, 0.0], "exit": [3.2, 0.0, -0.1]},
        [roller("lift", 0.2, 1.5, 0.1, "over")],
        [{"name": "weight", "duration": 1.0, "gravity": [0.0, 0.0, -9.81]},
         {"name": "lift", "duration": 1.0, "rollers": {"lift": {"move": [0.1, 0.0, 0.25]}}},
         {"name": "pull", "duration": 1.0, "exit": {"tension": 5e3}}],
    ),
    "started line, shell": line(
        {"kinematics": "shell", "width": 0.5, "thickness": 4e-4, "cells": [12, 2]}, 5e3,
        {"entry": [-0.7, 0.0, 0.0], "exit": [0.3, 0.0, -0.7]},
        [roller("r", 0.2, 0.0, -0.2, "over")],
        [{"name": "start", "duration": 0.3, "rollers": speeds(r=0.2)}], 0.2,
    ),
    "roller moved in, shell": line(
        {"kinematics": "shell", "width": 0.4, "thickness": 5e-4, "cells": [16, 2]}, 4e3,
        {"entry": [-0.8, 0.0, 0.0], "exit": [0.8, 0.0, 0.0]},
        [roller("r", 0.15, 0.0, -0.16, "over", axis=[0.01, 1.0, 0.0])],
        [{"name": "in", "duration": 1.0, "rollers": {"r": {"move": [0.0, 0.0, 0.1]}}}],
    ),
    "barrel, shell": line(
        {"kinematics": "shell", "width": 0.6, "thickness": 6e-4, "cells": [12, 4]}, 8e3,
        {"entry": [-0.9, 0.0, 0.0], "exit": [0.3, 0.0, -0.9]},
        [roller("r", 0.25, 0.0, -0.25, "over", crown=[0.0, -0.003])],
        [{"name": "pull", "duration": 1.0, "exit": {"tension": 1.4e4}}],
    ),
    "steady out of line, shell": line(
        {"kinematics": "shell", "width": 0.5, "thickness": 5e-4, "cells": [16, 2]}, 6e3,
        {"entry": [-1.0, 0.0, 0.0], "exit": [0.3, 0.0, -0.8]},
        [roller("r", 0.2, 0.0, -0.2, "over", axis=[0.001, 1.0, 0.0])],
        [{"name": "run", "steady": True, "entry": {"tension": 5.5e3},
          "rollers": speeds(r=0.3)}], 0.25,
    ),
}  # fmt: skip
"""Four sections and four shells, in time, along a path and steady."""


@dataclass(frozen=True)
class Kept:
    """Accepted states of a run, and what is needed between them."""

    run: Run
    states: list[State]
    past: list[Any]  # of each, its ``Step.past``
    orders: list[int]
    estimates: list[Any]

    def at(self, time: float) -> State:
        """Return the state at an instant."""
        place = min(bisect_left([s.time for s in self.states], time), len(self.states) - 1)
        state = self.states[place]
        if abs(state.time - time) < 1e-12 * self.run.end_time:
            return state
        return state.at(time, self.states[place - 1] if place else None)


def solved(tables: Tables, tolerance: float, **solver: Any) -> Kept:
    """Return a run with its accepted states.

    Raises
    ------
    RuntimeError
        It stops before its end.
    """
    run = Scene.model_validate(tables | {"solver": {"tolerance": tolerance, **solver}}).run()
    kept = Kept(run, [], [], [], [])
    for step in run:
        kept.states.append(step.state)
        kept.past.append(step.past)
        kept.orders.append(step.order)
    if not run.outcome.done:
        raise RuntimeError(run.message)
    return kept


def errors(found: Kept, exact: Kept) -> Array:
    """Return the true errors of tensions and positions of every state, (states, 2), in scales."""
    scales, rows = found.run.assembly.scales, []
    for state in found.states:
        if state.plan.name == "threading" and state.control < 1.0:
            continue  # its path depends on the first guess
        other = exact.at(state.time)
        wrong = part(state, other, other.full - state.full)
        rows.append((wrong["tension"] / scales.tension, wrong["position"] / scales.length))
    return np.array(rows)
