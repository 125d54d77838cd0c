"""The observer of a run: writes what happens, so that it can be read at any moment."""

from __future__ import annotations

import platform
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.results.fields import Surface
from anmstrip.results.files import History, save_checkpoint, write_summary
from anmstrip.results.state import State
from anmstrip.results.vtk import (
    Collection,
    Cylinder,
    roller_length,
    subdivided,
    write_rollers,
    write_surface,
)
from anmstrip.simulation.problem import Assembly

if TYPE_CHECKING:
    from anmstrip.results.events import Event

Array = NDArray[np.float64]

CHECKPOINT_SECONDS = 2.0
"""Least time between two checkpoints inside a stage."""

STALE = ("checkpoint.npz", "summary.json")
"""What an earlier run in the same directory left, and no longer belongs to anything."""

STEP_COLUMNS = ("stage", "time", "step", "tangents", "order", "range", "residual")

EVENT_COLUMNS = ("time", "stage", "kind", "roller", "point", "x", "y", "gap", "slip")


class Recorder:
    """Writes history, states, checkpoint and summary of a run into a directory.

    Parameters
    ----------
    assembly : Assembly
    directory : Path
    resumed : mapping or None
        Facts of the checkpoint of an earlier run.
    """

    def __init__(
        self, assembly: Assembly, directory: Path, resumed: Mapping[str, Any] | None = None
    ) -> None:
        self.assembly, self.directory = assembly, directory
        directory.mkdir(parents=True, exist_ok=True)
        columns = (*STEP_COLUMNS, "entry_tension", "exit_tension", *self._roller_columns())
        history = directory / "history.csv"
        if resumed is None:
            self.rows, self.states, reached = 0, 0, -1.0
            self.history = History(history, columns)
            for stale in (*directory.glob("*.pvd"), *map(directory.joinpath, STALE)):
                stale.unlink(missing_ok=True)
            self.strip = Collection(directory / "strip.pvd")
            self.rollers = Collection(directory / "rollers.pvd")
        else:
            self.rows, reached = resumed["rows"], resumed["time"]
            self.history = History.reopened(history, columns, self.rows)
            self.strip = Collection.reopened(directory / "strip.pvd", reached)
            self.rollers = Collection.reopened(directory / "rollers.pvd", reached)
            self.states = len(self.strip.entries)
        self.events = self._events(resumed)
        self.due = [t for t in assembly.scene.output.times or () if t > reached]
        touching = None if assembly.contact is None else assembly.contact_operator
        bends, bent = assembly.bending is not None, assembly.imperfection
        self.surface = Surface(assembly.strip, assembly.membrane, touching, bends, bent)
        nothing = dict.fromkeys((r.name for r in assembly.rollers), 0.0)
        self.turned = nothing if resumed is None else dict(resumed["turned"])
        self.last_checkpoint = 0.0

    def _events(self, resumed: Mapping[str, Any] | None) -> History | None:
        """Table of what happens, if the scene asks for it."""
        self.event_rows = 0 if resumed is None else resumed.get("event_rows", 0)
        path = self.directory / "events.csv"
        if not self.assembly.scene.output.events:
            path.unlink(missing_ok=True)
            return None
        if resumed is None or not self.event_rows:
            return History(path, EVENT_COLUMNS)
        return History.reopened(path, EVENT_COLUMNS, self.event_rows)

    def _roller_columns(self) -> list[str]:
        names = ("normal_force", "drag", "wrap", "max_slip")
        return [f"{r.name}_{name}" for r in self.assembly.rollers for name in names]

    def row(self, state: State, facts: Mapping[str, Any]) -> None:
        """Add one accepted step to the history."""
        values = dict(facts)
        for edge in ("entry", "exit"):
            values[f"{edge}_tension"] = state.tension(edge)
        for name, reading in state.rollers.items():
            for column in ("normal_force", "drag", "wrap", "max_slip"):
                values[f"{name}_{column}"] = getattr(reading, column)
        self.history.append(values)
        self.rows += 1

    def happened(self, events: Iterable[Event]) -> None:
        """Add what has happened in a step."""
        for event in events:
            assert self.events is not None
            self.events.append(asdict(event))
            self.event_rows += 1

    def observe(self, step: int, before: State | None, state: State) -> None:
        """Write what is wanted of an accepted step: its end, or instants inside."""
        output = self.assembly.scene.output
        while self.due and self.due[0] <= state.time:
            inside = state.at(self.due.pop(0), before)
            self._turn(inside, before)
            self.write_state(inside)
            before = inside
        self._turn(state, before)
        if output.times is None and step % output.every == 0:
            self.write_state(state)

    def write_state(self, state: State) -> None:
        """Write the surface and the rollers, and list them."""
        number = f"{self.states:05d}"
        fields = self.surface.fields(state)
        points = self.surface.reference.T + fields["displacement"]
        smooth = self.assembly.scene.output.smooth
        cells = self.surface.cells if smooth else subdivided(self.surface.cells)
        write_surface(self.directory / f"strip_{number}.vtu", points, cells, fields)
        self.strip.add(state.time, f"strip_{number}.vtu")
        if self.assembly.rollers:
            write_rollers(self.directory / f"rollers_{number}.vtu", self._cylinders(state))
            self.rollers.add(state.time, f"rollers_{number}.vtu")
        self.states += 1

    def _cylinders(self, state: State) -> list[Cylinder]:
        length = roller_length(self.assembly.strip.width)
        return [
            Cylinder(
                tuple(state.controls[f"rollers.{r.name}.centre"]),
                tuple(r.unit_axis),
                r.radius,
                length,
                self.turned[r.name] / r.radius,
                None if r.is_cylinder else r.radius_at,
            )
            for r in self.assembly.rollers
        ]

    def _turn(self, state: State, before: State | None) -> None:
        """Add the surface's travel since a state, for the rollers' pictures."""
        h = state.time - (state.plan.start if before is None else before.time)
        for name in self.turned:
            speed = float(state.controls[f"rollers.{name}.surface_speed"])
            slope = float(state.plan.controls.rate(f"rollers.{name}.surface_speed"))
            self.turned[name] += h * (speed - 0.5 * slope * h / state.plan.duration)

    def checkpoint(
        self, arrays: Mapping[str, Array], facts: Mapping[str, Any], force: bool = False
    ) -> None:
        """Save what is needed to go on, at most every few seconds unless forced."""
        now = time.monotonic()
        if not force and now - self.last_checkpoint < CHECKPOINT_SECONDS:
            return
        self.last_checkpoint = now
        counters = {"rows": self.rows, "states": self.states, "turned": self.turned}
        counters["event_rows"] = self.event_rows
        save_checkpoint(self.directory / "checkpoint.npz", arrays, {**facts, **counters})

    def summary(self, facts: Mapping[str, Any], state: State | None) -> None:
        """Write ``summary.json``."""
        edges: dict[str, Any] = {}
        rollers: dict[str, Any] = {}
        if state is not None:
            strip = self.assembly.strip
            edges = {
                name: {"tension": state.tension(name), "force": state.edge_force(name)}
                for name in strip.edges
                if name in ("entry", "exit")
            }
            rollers = {
                name: {
                    key: getattr(reading, key)
                    for key in (
                        "normal_force", "drag", "wrap", "tension_in", "tension_out",
                        "tension_ratio", "max_slip", "creep_speed", "cone_violation",
                    )
                }
                for name, reading in state.rollers.items()
            }  # fmt: skip
            for name, cost in state.regularisation.items():
                rollers[name] |= {
                    "sticking_creep": cost.sticking_creep,
                    "penetration": cost.penetration,
                    "regularisation_effect": {
                        "creep": cost.by_creep,
                        "cone": cost.by_cone,
                        "penetration": cost.by_penetration,
                        "total": cost.effect,
                    },
                }
        write_summary(
            self.directory / "summary.json",
            {
                **facts,
                "rollers": rollers,
                "edges": edges,
                "input": self.assembly.scene.to_dict(),
                "versions": versions(),
            },
        )


def versions() -> dict[str, str]:
    """Versions of this program and of what it stands on."""
    packages = ("anmstrip", "numpy", "scipy", "scikit-fem", "meshio", "pyvista")
    return {"python": platform.python_version(), **{name: version(name) for name in packages}}
