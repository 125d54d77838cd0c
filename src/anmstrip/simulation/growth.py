"""Strip that the runs between rollers take up and give off where rollers move or loads change.

Labels of a fed strip that stay on rollers come to hold more of it where these move apart or where
it hangs through, and less where heat or tension lengthens it (an arbitrary Lagrangian-Eulerian
description whose mesh moves as it is told): S(X, t), with g = ∂S/∂X = 1 on rollers but for heat.
Material passes a label with c − ∂S/∂t, and v = ∂r/∂t + (c − ∂S/∂t)/g ∂r/∂X.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.integrate import trapezoid

from anmstrip.arrays import Array
from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.string_path import NoTangentError, NotTouchedError
from anmstrip.scene.tables import FieldSpec
from anmstrip.simulation import meshing
from anmstrip.simulation.defaults import boundary_layer, open_stages, thermal_growth
from anmstrip.simulation.threading import Thread

RAMP_SHARE = 0.25
"""Share of a run over which g leaves 1 at both of its ends; with 0.05, 0.25 and 0.5 a dancer takes
45 tangents to the same tensions."""

MIN_GROWTH, MAX_GROWTH = 0.01, 100.0
"""Bounds of g, so that elements neither vanish nor become endless; beyond, labels are carried off
their rollers, and points of contact pass again.  A carriage 8 m away that was drawn with runs of
0.4 m takes 15 tangents; with the bounds 0.1 and 10 it is lost after 600."""


@dataclass(frozen=True)
class Growth:
    """Shapes of g between rollers, and by heat.

    Attributes
    ----------
    thread : Thread
        The way of the strip at the beginning, with n rollers.
    x : ndarray, shape (nodes,)
        Labels of the lines of nodes (m), between which g is linear, as r,X may be.
    shapes : ndarray, shape (nodes, n + 1 + temperatures)
        Of g − 1.  Those of runs have the integral 1; 0 for a run without a node away from its
        rollers.  Those of temperatures keep labels where they are.
    temperatures : tuple of FieldSpec
        That stages give.
    others : tuple of LooseRoller
        Rollers without a wrap that are pressed into runs.
    """

    thread: Thread
    x: Array
    shapes: Array
    temperatures: tuple[FieldSpec, ...] = ()
    others: tuple[meshing.LooseRoller, ...] = ()

    @classmethod
    def of(cls, layout: meshing.Layout, x: Array) -> Growth:
        """Return the shapes on given lines of nodes, away from where the strip lifts off."""
        scene, thread, layer = layout.scene, layout.thread, boundary_layer(layout.scene)
        assert thread is not None
        ends = [[x[0], x[0]]]
        for roller in thread.rollers:
            first, last = np.transpose([each[roller.name] for each in layout.arcs])
            beside = meshing.fine_beside(layer, meshing.wanted_size(scene, roller.radius, layer))
            ends.append([float(first.min()) - beside, float(last.max()) + beside])
        ends.append([x[-1], x[-1]])
        shapes = []
        for (_, begin), (end, _) in pairwise(ends):
            inside = np.minimum(x - begin, end - x) / (RAMP_SHARE * abs(end - begin) or 1.0)
            shape = np.clip(inside, 0.0, 1.0)
            whole = float(trapezoid(shape, x))
            shapes.append(shape / whole if whole > 0.0 else 0.0 * x)
        given = [stage.strip.temperature for stage in open_stages(scene)]
        temperatures = tuple({repr(each): each for each in given if each is not None}.values())
        shapes += [thermal_growth(scene, each, x - x[0]) for each in temperatures]
        return cls(thread, x, np.stack(shapes, axis=1), temperatures, tuple(layout.pressed))

    @property
    def rollers(self) -> list[Roller]:
        """Rollers on whose places it depends how much strip runs hold."""
        return [*self.thread.rollers, *(other.roller for other in self.others)]

    @property
    def nothing(self) -> Array:
        """Shares of the shapes at the beginning, (shapes,)."""
        return np.zeros(self.shapes.shape[1])

    def held(
        self,
        centres: Mapping[str, Array],
        before: Array,
        loads: meshing.Loads | None = None,
        temperature: FieldSpec | None = None,
        gathered: Array | float = 0.0,
    ) -> Array:
        """Shares of the shapes, (shapes,): of runs the strip (m) that they hold besides.

        Parameters
        ----------
        centres : mapping
            Roller → centre (m).
        before : ndarray, shape (shapes,)
            Of which runs stay where the taut strip does not touch all rollers.
        loads : Loads, optional
            By which runs hang.
        temperature : FieldSpec, optional
            That the strip comes to (K); without, or of another scene, it stays.
        gathered : ndarray, shape (runs,), optional
            Unstressed strip (m) that nips have pushed into runs.
        """
        runs = len(self.thread.rollers) + 1
        warm = before[runs:]
        if temperature in self.temperatures:
            warm = np.array([float(each == temperature) for each in self.temperatures])
        heat = self.shapes[:, runs:] @ warm
        return np.append(self._of_runs(centres, before[:runs], loads, heat, gathered), warm)

    def _of_runs(
        self,
        centres: Mapping[str, Array],
        before: Array,
        loads: meshing.Loads | None,
        heat: Array,
        gathered: Array | float,
    ) -> Array:
        """Unstressed strip (m) that runs hold beyond that of the beginning, (n + 1,)."""
        thread, shapes = self.thread, self.shapes[:, : len(before)]
        moved = [replace(r, centre=tuple(map(float, centres[r.name]))) for r in self.rollers]
        with suppress(NotTouchedError, NoTangentError):
            now = replace(thread, rollers=moved[: len(thread.rollers)], given=thread.length)
            runs = meshing.lengths_of_runs(*meshing.threaded_around(thread, self.others, moved))
            longer = runs - meshing.lengths_of_runs(thread)
            if loads is not None:
                longer += meshing.taken_up(now, loads, runs)
            longer /= thread.stretches.along[0]  # fed: uniform
            longer += gathered
            longer *= 1.0 + trapezoid(shapes.T * heat, self.x)
            peaks, least = shapes.max(axis=0), MIN_GROWTH - 1.0 - min(0.0, float(heat.min()))
            bounded = np.clip(peaks * longer, least, MAX_GROWTH - 1.0)
            return np.divide(bounded, peaks, out=np.zeros_like(peaks), where=peaks > 0.0)
        return before

    def at(self, x: Array, held: Array) -> Array:
        """g at labels, shape of x."""
        return 1.0 + np.interp(x, self.x, self.shapes @ held)

    def up_to(self, x: Array, held: Array) -> Array:
        """∂S between the entry and labels, S − X (m), or its rate, shape of x."""
        nodal = self.shapes @ held
        steps = 0.5 * np.diff(self.x) * (nodal[1:] + nodal[:-1])
        place = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 1)
        here = 0.5 * (x - self.x[place]) * (nodal[place] + np.interp(x, self.x, nodal))
        return np.append(0.0, np.cumsum(steps))[place] + here


DIFFERENCE_SHARE = 1e-4
"""Share of a load over which a central difference, wrong by its square, tells how strip hangs."""


@dataclass(frozen=True)
class Hanging:
    """The material that runs hold at the end of a stage, as its loads change.

    Attributes
    ----------
    growth : Growth
    centres : mapping
        Roller → centre (m).
    loads : Loads
    gravity, thickness, width : float
        m/s², and of the strip (m).
    """

    growth: Growth
    centres: Mapping[str, Array]
    loads: meshing.Loads
    gravity: float
    thickness: float
    width: float

    def changed(self, key: str) -> Array:
        """Strip (m) that runs take up per unit of a parameter, (shapes,); 0 if it is no load."""
        loads, growth = self.loads, self.growth
        arms = {f"rollers.{r.name}.torque": r.radius * self.width for r in growth.thread.rollers}
        scales = {
            "gravity": self.gravity,
            "strip.thickness": self.thickness,
            "exit.tension": loads.exit,
            "exit.force": loads.exit,
            "entry.tension": loads.entry or 0.0,
        } | {name: arm * loads.exit for name, arm in arms.items()}
        if not (step := DIFFERENCE_SHARE * scales.get(key, 0.0)):
            return growth.nothing
        sides = []
        for h in (-step, step):
            if key in ("gravity", "strip.thickness"):
                now = replace(loads, weight=loads.weight * (1.0 + h / scales[key]))
            elif key in arms:
                name = key.split(".")[1]
                gains = {n: g - h / arms[key] * (n == name) for n, g in loads.gains.items()}
                now = replace(loads, gains=gains)
            elif key == "entry.tension":
                now = replace(loads, entry=scales[key] + h)
            else:
                now = replace(loads, exit=loads.exit + h)
            sides.append(growth.held(self.centres, growth.nothing, now))
        return np.asarray(sides[1] - sides[0]) / (2.0 * step)
