"""Errors of path and time at every accepted state, estimated and true, in eight scenes.

The truth comes from a run to a tenth of the strictest tolerance on the same mesh and laws, solved
for at the same instants.  The largest error of a tension at the ends and beside every roller counts
over the tension scale, that of a position over the length.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from anmstrip.driver.budget import largest_differences
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.mechanics.shell import Membrane
from anmstrip.results.state import State
from harness import Cell, Report, Sheet, main

TOLERANCES = tuple(10.0**-k for k in range(3, 8))

Tables = dict[str, Any]


def line(
    strip: Tables,
    tension: float,
    ends: Tables,
    rollers: list[Tables],
    stages: list[Tables],
    friction: float | None = None,
    **more: Any,
) -> Tables:
    """Return the tables of a threaded strip that is held at its entry."""
    steel = {"young": 2e11, "poisson": 0.3, "density": 7850.0}
    tables: Tables = {
        "strip": {"kinematics": "section", **strip},
        "material": steel,
        "contact": {},
        "threading": {"tension": tension, **ends},
        "rollers": rollers,
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": stages,
        **more,
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
        {"entry": [-1.2, 0.0, 0.0], "exit": [0.15, 0.0, -0.6]},
        [roller("guide", 0.15, 0.0, -0.15, "over"),
         {"name": "r", "radius": 0.1, "centre": [-0.6, 0.0, -0.11], "axis": [0.01, 1.0, 0.0]}],
        [{"name": "in", "duration": 1.0, "rollers": {"r": {"move": [0.0, 0.0, 0.06]}}}],
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


LEAST = dict.fromkeys(SCENES, 1e-5) | dict.fromkeys(list(SCENES)[:3], 1e-6)
LEAST["sag and lift, section"] = 1e-7
LEAST["started line, shell"] = 1e-4
"""Strictest tolerance of a scene: a tenth of it takes minutes in time, and is near round-off."""

COLUMNS = ("scene", "tolerance", "states", "tangents", "tension", "position", "estimate / truth")
NOTE = (
    "Tension and position: largest true error of all accepted states over the tolerance. Estimate: "
    "the largest error of a membrane force that errors.csv tells, over the largest true one; of "
    "states that are right to a thousandth of the tolerance it is left out."
)
SEEN = 1e-3


@dataclass(frozen=True)
class Solved:
    """A run with its accepted states, and what it tells of the errors of their membrane forces."""

    run: Run
    states: list[State]
    told: list[float | None]

    @classmethod
    def of(cls, tables: Tables, tolerance: float) -> Solved:
        """Solve a scene.

        Raises
        ------
        RuntimeError
            It stops before its end.
        """
        run = Scene.model_validate(tables | {"solver": {"tolerance": tolerance}}).run()
        found = cls(run, [], [])
        for step in run:
            found.states.append(step.state)
            found.told.append(run.budget.of_solver(step.state, run.march).get("membrane_force"))
        if not run.outcome.done:
            raise RuntimeError(run.message)
        return found

    def at(self, time: float) -> State:
        """Return the state at an instant."""
        place = bisect_left([state.time for state in self.states], time)
        place = min(place, len(self.states) - 1)
        return self.states[place].at(time, self.states[place - 1] if place else None)


def compared(found: Solved, exact: Solved) -> Iterator[tuple[float, float, float, float]]:
    """Yield the errors of states: tension, position and membrane force, and what is told of it.

    In the scales of the tolerance.  The way to the first threaded state is one of its own.
    """
    scales = found.run.assembly.scales
    for state, told in zip(found.states, found.told, strict=True):
        if told is None or (state.plan.name == "threading" and state.control < 1.0):
            continue
        other = exact.at(state.time)
        wrong, moved = (
            largest_differences(state, other, other.full - state.full),
            other.full - state.full,
        )
        membrane = next(e for e in state.plan.model.effects if isinstance(e, Membrane))
        force = float(np.abs(membrane.change(other.full, moved, state.controls)).max())
        tensions = np.array([wrong["tension"], force, told]) / scales.tension
        yield float(tensions[0]), wrong["position"] / scales.length, *map(float, tensions[1:])


def rows(name: str, tolerances: Sequence[float]) -> Iterator[tuple[Cell, ...]]:
    """Yield the rows of a scene."""
    exact = Solved.of(SCENES[name], 0.1 * min(tolerances))
    for tolerance in tolerances:
        found = Solved.of(SCENES[name], tolerance)
        tension, position, force, told = np.array(list(compared(found, exact))).max(axis=0)
        seen = told / force if force > SEEN * tolerance else None
        counts = tolerance, len(found.states), found.run.cost.expansions
        yield name, *counts, tension / tolerance, position / tolerance, seen


def study(quick: bool = False) -> Report:
    """All scenes and tolerances, or two of both."""
    chosen = {name: [t for t in TOLERANCES if t >= LEAST[name]] for name in SCENES}
    if quick:
        chosen = {name: chosen[name][:2] for name in list(SCENES)[:4:3]}
    found = tuple(row for name, tolerances in chosen.items() for row in rows(name, tolerances))
    sheet = Sheet("Errors of path and time at accepted states", COLUMNS, found, NOTE)
    return Report("states", "The tolerance at every accepted state", sheet, (sheet,))


if __name__ == "__main__":
    main(study)
