"""A finished run as its files tell it, beside the scene as it was typed."""

from __future__ import annotations

import csv
import json
import tomllib
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
from numpy.typing import NDArray

from field_statics import Belt, Circle, belt, bent_belt, capstan, lift_off, normal_force

Array = NDArray[np.float64]

THREADED_BY = 1.0
"""End of the stage that lays a threaded strip around its rolls (s)."""

CONE = 0.01
"""Share by which friction in full slip may miss f times the normal force, by its law."""


class Line:
    """A line of rolls and what has come out.

    Parameters
    ----------
    scene : Path
        TOML file.
    results : Path
        Directory of the run.
    """

    def __init__(self, scene: Path, results: Path) -> None:
        self.scene: dict[str, Any] = tomllib.loads(scene.read_text(encoding="utf8"))
        self.results = results
        strip, material = self.scene["strip"], self.scene["material"]
        self.width, self.thickness = strip["width"], strip["thickness"]
        self.stiffness = material["young"] * self.thickness  # E t (N/m)
        self.bending = self.stiffness * self.thickness**2 / 12.0 / (1.0 - material["poisson"] ** 2)
        self.weight = 9.81 * material.get("density", 0.0) * self.thickness  # Pa
        self.friction = self.scene.get("friction", {}).get("coefficient", 0.0)
        self.threading = self.scene.get("threading")
        self.rolls = {
            roll.get("name", f"r{i}"): roll for i, roll in enumerate(self.scene["rollers"], start=1)
        }
        self.wrapped = [name for name, roll in self.rolls.items() if "wrap" in roll]

    # What has come out

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The file of the run's end."""
        return json.loads((self.results / "summary.json").read_text(encoding="utf8"))

    @cached_property
    def history(self) -> list[dict[str, Any]]:
        """Rows of the history; what is no text is a number, what is empty left out."""
        with (self.results / "history.csv").open(encoding="utf8", newline="") as file:
            return [
                {k: v if k == "stage" else float(v) for k, v in row.items() if v}
                for row in csv.DictReader(file)
            ]

    def end_of(self, stage: str) -> dict[str, Any]:
        """Last row of a stage."""
        return [row for row in self.history if row["stage"] == stage][-1]

    def tangents(self, stage: str) -> int:
        """Tangents that a stage took."""
        return int(self.summary["stages"][stage]["tangents"])

    def roll(self, name: str) -> dict[str, float]:
        """What the summary says of a roll."""
        return self.summary["rollers"][name]

    def tension(self, edge: str) -> float:
        """Tension of an end (N/m)."""
        return float(self.summary["edges"][edge]["tension"])

    @cached_property
    def states(self) -> list[tuple[float, Path]]:
        """Times and files of the strip's states."""
        sets = ElementTree.parse(self.results / "strip.pvd").iter("DataSet")
        return [(float(s.attrib["timestep"]), self.results / s.attrib["file"]) for s in sets]

    def state(self, time: float | None = None) -> State:
        """First state from a time on, or the last one."""
        later = [path for t, path in self.states if time is not None and t >= time]
        return State(later[0] if later else self.states[-1][1])

    # What statics says

    def circles(self, moved: bool = False) -> list[Circle]:
        """Rolls that the strip is threaded around, where they were or where they went."""
        circles = []
        for name in self.wrapped:
            roll = self.rolls[name]
            x, _, z = np.add(roll["centre"], self.moved(name) if moved else np.zeros(3))
            sense = 1 if roll["wrap"] == "over" else -1
            circles.append(Circle(complex(x, z), roll["radius"], sense))
        return circles

    def moved(self, name: str) -> Array:
        """Where a roll has been moved in the end, from where it was (m)."""
        moves = [s.get("rollers", {}).get(name, {}).get("move") for s in self.scene["stages"]]
        return np.array(([[0.0, 0.0, 0.0], *(m for m in moves if m is not None)])[-1])

    @property
    def ends(self) -> tuple[complex, complex]:
        """Entry and exit of the threaded strip."""
        entry, exit = (complex(p[0], p[2]) for p in map(self.threading.get, ("entry", "exit")))
        return entry, exit

    def string(self, moved: bool = False) -> Belt:
        """Way of a string around the rolls."""
        entry, exit = self.ends
        return belt(entry, self.circles(moved), exit)

    def straights(self, tension: float, moved: bool = False) -> Belt:
        """Straight parts of the strip with its bending stiffness."""
        entry, exit = self.ends
        return bent_belt(entry, self.circles(moved), exit, tension, self.bending)

    def tight_side(self, low: float, name: str, turn: float) -> float:
        """Tension before a roll in full slip (N/m)."""
        friction = self.rolls[name].get("friction", self.friction)
        return capstan(low, friction, turn, self.bending, self.rolls[name]["radius"])

    # What has to agree

    def expect_ends(self, within: float, **tensions: float) -> None:
        """Entry and exit bear these tensions (N/m)."""
        for edge, expected in tensions.items():
            found = self.tension(edge)
            assert abs(found / expected - 1.0) < within, f"{edge} bears {found}, not {expected} N/m"

    def expect_travel(self, expected: float, within: float = 0.005) -> None:
        """The strip has gone that far (m).

        Half a percent is for the creep, the half thickness between face and middle of the strip
        (t/2r), and steps in time; a millimetre for what tensions stretch.
        """
        found = self.conveyed()
        assert abs(found - expected) < within * abs(expected) + 1e-3, f"{found}, not {expected} m"

    def conveyed(self, time: float = np.inf) -> float:
        """How far the strip has gone up to a time (m), or in all."""
        if "conveyed" in self.history[-1]:
            return float([row for row in self.history if row["time"] <= time][-1]["conveyed"])
        return self.pulled(time)

    def pulled(self, time: float = np.inf) -> float:
        """How far the strip at the exit has gone up to a time (m), or in all.

        At the end without what the runs have taken up, which came from there.
        """
        _, exit = self.ends
        heading = np.exp(1j * self.string().headings[-1])
        x, _, z = self.state(None if time == np.inf else time).end("exit")
        held = self.summary.get("feed", {}).get("taken_up", 0.0) if time == np.inf else 0.0
        return float(((complex(x, z) - exit) * np.conj(heading)).real) - held

    def expect_speed(self, expected: float) -> None:
        """Both ends move at that speed (m/s); 0.5 % as for the travel."""
        for edge in ("entry", "exit"):
            found = float(np.linalg.norm(self.state().end(edge, "velocity")))
            assert abs(found - expected) < 0.005 * max(abs(expected), 1.0), f"{edge}: {found} m/s"

    def expect_idle(self, *names: str, share: float = 0.01) -> None:
        """These rolls neither pull nor brake, but for a share of the tension."""
        for name in names:
            drag = abs(self.roll(name)["drag"]) / self.width
            assert drag < share * self.roll(name)["tension_in"], f"{name} pulls by {drag} N/m"

    def expect_pressed(
        self, tension: float, *names: str, within: float = 0.02, moved: bool = False
    ) -> None:
        """Rolls bear what a strip of that tension presses on them; all if none is named.

        Two percent are for the next order of the lift-off angle, and for the mesh there.
        """
        turns = dict(zip(self.wrapped, self.straights(tension, moved).turns, strict=True))
        for name in names or self.wrapped:
            radius = self.rolls[name]["radius"]
            expected = self.width * normal_force(tension, turns[name], self.bending, radius)
            found = self.roll(name)["normal_force"]
            assert abs(found / expected - 1.0) < within, f"{name} bears {found}, not {expected} N"

    def expect_wraps(self, tension: float, moved: bool = False) -> None:
        """Contact is as long as the turn less both lift-off angles; a tenth of a radian is mesh."""
        turns = self.straights(tension, moved).turns
        for name, turn in zip(self.wrapped, turns, strict=True):
            angle = lift_off(tension, self.bending, self.rolls[name]["radius"])
            arc, found = max(0.0, turn - 2.0 * angle), self.roll(name)["wrap"]
            slack = max(0.1, 0.05 * turn)
            assert arc - slack < found < turn + slack, f"{name} is wrapped by {found}, not {arc}"

    def expect_slipping(self, *names: str) -> None:
        """These rolls rub with f times their normal force: the law in full slip, to 1 %."""
        for name in names:
            roll = self.roll(name)
            share = abs(roll["drag"]) / (self.friction * roll["normal_force"])
            assert abs(share - 1.0) < CONE, f"{name} rubs with {share} of its capacity"

    def expect_slip_chain(self, exit: float, within: float = 0.01, moved: bool = False) -> None:
        """All rolls slip, and tensions grow by Euler and Eytelwein from the exit backwards.

        One percent: twice half a percent, that of the friction law and that of bending's next
        order and the mesh.
        """
        expected = exit
        turns = self.straights(exit, moved).turns
        for name, turn in reversed(list(zip(self.wrapped, turns, strict=True))):
            expected = self.tight_side(expected, name, turn)
            found = self.roll(name)["tension_in"]
            assert abs(found / expected - 1.0) < within, f"{found} before {name}, not {expected}"
        self.expect_slipping(*self.wrapped)
        self.expect_ends(within, entry=expected, exit=exit)

    def expect_sound(self) -> None:
        """Whatever the scene: finite, pushing, inside the cone, each roll in balance."""
        assert self.summary["status"] == "done", self.summary["message"]
        rate_free = {s.get("name") for s in self.scene["stages"] if s.get("friction") is False}
        for row in self.history:
            assert all(isfinite(v) for k, v in row.items() if k != "stage"), row
            for name in self.rolls:
                pressed, rubbed = row[f"{name}_normal_force"], abs(row[f"{name}_drag"])
                assert pressed >= 0.0, row
                # the law is bounded by f
                capacity = 0.0 if row["stage"] in rate_free else self.friction * pressed
                assert rubbed <= (1.0 + CONE) * capacity + 1e-9 * self.stiffness, (name, row)
        if self.weight or not self.wrapped:
            return
        for name in self.wrapped:
            # moments about the axis: the strip's own, D/r, is the same on both sides
            roll = self.roll(name)
            tensions = roll["tension_in"], roll["tension_out"]
            pulled, least = abs(tensions[0] - tensions[1]), 0.005 * max(tensions)
            missing = abs(abs(roll["drag"]) / self.width - pulled)
            assert missing < 0.02 * pulled + least, f"{name}: {roll['drag']} N, {tensions} N/m"


class State:
    """A written state of the strip."""

    def __init__(self, path: Path) -> None:
        mesh = meshio.read(path)
        self.points = np.asarray(mesh.points, dtype=float)
        self.fields = {name: np.asarray(v, dtype=float) for name, v in mesh.point_data.items()}
        self.reference = self.points - self.fields["displacement"]

    def at(self, edge: str) -> NDArray[np.bool_]:
        """Points of an end."""
        x = self.reference[:, 0]
        place = x.min() if edge == "entry" else x.max()
        return np.abs(x - place) < 1e-6 * np.ptp(x)

    def end(self, edge: str, field: str | None = None) -> Array:
        """Mean position of an end, or of a field there."""
        values = self.points if field is None else self.fields[field]
        return values[self.at(edge)].mean(axis=0)

    def across(self, field: str, x: float) -> tuple[Array, Array]:
        """The y and the values of a field on the line of points nearest to a reference x."""
        columns = np.round(self.reference[:, 0], 6)
        nearest = columns[np.argmin(np.abs(columns - x))]
        chosen = columns == nearest
        y, inverse = np.unique(np.round(self.reference[chosen, 1], 6), return_inverse=True)
        values = self.fields[field][chosen]
        values = values if values.ndim == 1 else values[:, 0]
        return y, np.bincount(inverse, values) / np.bincount(inverse)
