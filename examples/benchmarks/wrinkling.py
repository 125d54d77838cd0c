"""Strips that wrinkle at a roller, crowned or out of line: scenes, and where wrinkles begin."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from anmstrip.continuation.path import Outcome, PathStopped
from anmstrip.driver.scene import Scene
from anmstrip.fem.operators import CellOperator
from anmstrip.fem.sampling import quadrature_points
from anmstrip.results.state import State
from anmstrip.results.wrinkles import Wrinkling, buckling, mode_heights
from anmstrip.simulation.march import March, Step
from anmstrip.simulation.problem import Assembly

SPEED = 0.5
"""Of a roller that turns, and of the strip on it (m/s)."""

EXPONENT, CREEP = 0.1, 1e-3
"""Of friction: q, and V_c (m/s)."""

ON_THE_WAY = 1e-3
"""Tolerance of scenes in time."""


@dataclass(frozen=True)
class Mesh:
    """Elements: along (off the roller) and across, and their length over the roller (m)."""

    cells: tuple[int, int]
    refined: float

    def __str__(self) -> str:
        return f"{self.cells[0]} × {self.cells[1]}, {1e3 * self.refined:g} mm"


@dataclass(frozen=True)
class Crowned:
    """A strip 1 m wide, 0.8 m of it before and behind a roller that is thicker in the middle."""

    crown: float  # by which the radius is smaller at the strip's edges than in the middle (m)
    tension: float  # of the threaded strip (N/m)
    mesh: Mesh
    thickness: float = 2e-4  # m
    # length (m) of the cylinder in the middle, beside conical sides; left out: a parabola
    flat: float | None = None

    width, radius, free, wrap = 1.0, 0.4, 0.8, np.radians(10.0)

    @property
    def profile(self) -> dict[str, Any]:
        """Table of the roller's profile."""
        half = 0.5 * self.width
        if self.flat is None:
            return {"crown": [0.0, -self.crown / half**2]}
        taper = self.crown / (half - 0.5 * self.flat)
        return {"sides": {"taper": taper, "flat": self.flat, "rounding": 0.1 * self.width}}

    def eased(self, tension: float, **strip: Any) -> Scene:
        """Return a scene in which the tension is lowered, or raised; nothing rubs."""
        solver = {"tolerance": 1e-6, "order": 15}
        ease = {"name": "ease", "duration": 1.0, "exit": {"force": self._pull(tension)}}
        return self._scene([ease], strip, solver=solver)

    def conveyed(self, way: float, friction: float, pulled: float | None = None) -> Scene:
        """Return a scene in which the roller takes the strip along by a way (m).

        It comes to speed in 0.025 m.  Over another such way it is pulled harder, if that is given
        (N/m).  It runs from exit to entry: the exit is pulled where it is held up, and the entry
        is drawn away as fast as the roller turns.
        """
        turn = {"rollers": {"r1": {"surface_speed": -SPEED}}}
        half = 0.5 * self.wrap
        away = {"velocity": [-SPEED * float(np.cos(half)), 0.0, -SPEED * float(np.sin(half))]}
        start = {"name": "start", "duration": 0.1, "entry": away, **turn}
        run = {"name": "run", "duration": way / SPEED - 0.05, **turn}
        stages = [{"name": "hold", "duration": 0.1}, start, run]
        if pulled is not None:
            harder = {"exit": {"force": self._pull(pulled)}, **turn}
            stages.append({"name": "pull", "duration": way / SPEED, **harder})
        return self._scene(stages, {}, **rubbing(friction))

    def _pull(self, tension: float) -> list[float]:
        """Return the force at the exit (N/m), which is held up."""
        return [float(tension * np.cos(0.5 * self.wrap)), 0.0, 0.0]

    def _scene(self, stages: list[dict[str, Any]], strip: dict[str, Any], **others: Any) -> Scene:
        half = 0.5 * self.wrap
        x = self.radius * np.sin(half) + self.free * np.cos(half)
        z = self.radius * (np.cos(half) - 1.0) - self.free * np.sin(half)
        roller = {"radius": self.radius, **self.profile}
        return _made(
            {"width": self.width, "thickness": self.thickness, "feed": False, **strip},
            self.mesh,
            roller,
            threading={"tension": self.tension, "entry": [-x, 0.0, z], "exit": [x, 0.0, z]},
            edges={"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
            stages=stages,
            **others,
        )


@dataclass(frozen=True)
class Skewed:
    """A strip 0.5 m wide and 0.1 mm thick, led straight for 0.6 m onto a roller out of line.

    It does not contract across (ν = 0), so that its entry can be held all along without any
    stress.
    """

    yaw: float  # angle of the roller's axis, in the plane of the strip (rad)
    tension: float  # N/m
    mesh: Mesh

    width, thickness, radius, before, behind, wrap = 0.5, 1e-4, 0.2, 0.6, 0.3, np.radians(40.0)

    def conveyed(self, way: float, friction: float) -> Scene:
        """Return a scene in which entry and roller take the strip along by a way (m).

        They come to speed in 0.005 m.  Without friction it is left where threading brings it.
        """
        turn = {"rollers": {"r1": {"surface_speed": SPEED}}}
        start = {"name": "start", "duration": 0.02, "entry": {"velocity": [SPEED, 0.0, 0.0]}}
        run = {"name": "run", "duration": way / SPEED - 0.01}
        if not friction:
            return self._scene([{"name": "rest", "duration": 1.0}])
        stages = [{"name": "hold", "duration": 0.02}, {**start, **turn}, run]
        return self._scene(stages, **rubbing(friction))

    def _scene(self, stages: list[dict[str, Any]], **others: Any) -> Scene:
        down, r = self.wrap, self.radius
        x = r * np.sin(down) + self.behind * np.cos(down)
        z = r * (np.cos(down) - 1.0) - self.behind * np.sin(down)
        ends = {"entry": [-self.before, 0.0, 0.0], "exit": [x, 0.0, z]}
        return _made(
            {"width": self.width, "thickness": self.thickness, "feed": False},
            self.mesh,
            {"radius": r, "axis": [self.yaw, 1.0, 0.0]},
            material={"young": 2e11, "poisson": 0.0},
            threading={"tension": self.tension, **ends},
            edges={"entry": {"fixed": ["x", "y", "z"]}},
            stages=stages,
            **others,
        )


def rubbing(friction: float) -> dict[str, Any]:
    """Return the tables of friction, and of what it takes to solve with it."""
    law = {"coefficient": friction, "law": "norton-hoff", "exponent": EXPONENT, "speed": CREEP}
    return {"friction": law, "solver": {"tolerance": ON_THE_WAY}}


def _made(strip: dict[str, Any], mesh: Mesh, roller: dict[str, Any], **others: Any) -> Scene:
    """Return a scene with what both have in common: steel, contact, a roller below the origin."""
    own = {"name": "r1", "centre": [0.0, 0.0, -roller["radius"]], "wrap": "over", **roller}
    tables = {
        "strip": {**strip, "cells": mesh.cells, "refined": mesh.refined},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3},
        "rollers": [own],
    }
    return Scene.model_validate({**tables, **others})


Array = NDArray[np.float64]

ONSET = 1.01
"""Growth of the compression that is called the onset.

A strip leans into those wrinkles that its roller has bent it a little towards, and holds the
factor just above 1.
"""

DATED = 1e-3
"""Error of an onset, as a share of the step that it lies in."""

SEEN = 0.2
"""Height of a crest that is counted, over the highest."""

MOST_STEPS = 500


@dataclass(frozen=True)
class Onset:
    """A state in which the strip begins to wrinkle."""

    state: State
    tension: float  # N/m
    compression: float  # N/m
    heights: Array  # mode, along the normals, as heights of the flat strip, shape (unknowns,)

    @cached_property
    def wrinkling(self) -> Wrinkling:
        """Spans and compressions of the state."""
        return Wrinkling(self.state)

    @cached_property
    def wavelengths(self) -> tuple[float, float]:
        """2π times the mean height over the mean slope, along and across (m)."""
        operator = CellOperator(self.state.plan.model.strip, (0, 1))
        height, *slopes = operator.apply(self.heights)[2] ** 2 @ operator.weights
        along, across = (2.0 * np.pi * np.sqrt(height / slope) for slope in slopes)
        return float(along), float(across)

    @property
    def formula(self) -> float:
        """2 √π (D/T)^(1/4) √L with half a wavelength along as the length of the wrinkles."""
        stiffness = self.state.plan.model.strip.bending_stiffness / self.tension
        return float(2.0 * np.sqrt(0.5 * np.pi * self.wavelengths[0]) * stiffness**0.25)

    @property
    def profile(self) -> tuple[Array, Array]:
        """y and height across the strip where the mode is highest."""
        strip, z = self.state.plan.model.strip, self.heights.reshape(-1, 3)[:, 2]
        value, slope = (z[strip.dofs(name)] for name in ("u", "u_y"))
        there = np.isclose(strip.nodes[0], strip.nodes[0][np.abs(value).argmax()])
        y = np.linspace(strip.nodes[1].min(), strip.nodes[1].max(), 300)
        return y, CubicHermiteSpline(strip.nodes[1][there], value[there], slope[there])(y)

    @cached_property
    def crests(self) -> tuple[float, float]:
        """Wavelength (m) across the crests, and their angle to the strip (rad).

        The mean square slope is largest across the crests, which are turned towards +y at the
        exit if the angle is positive.
        """
        operator = CellOperator(self.state.plan.model.strip, (0, 1))
        height, *slopes = operator.apply(self.heights)[2]
        squares = np.einsum("ip,jp,p->ij", slopes, slopes, operator.weights)
        (_, steepest), axes = np.linalg.eigh(squares)
        wave = 2.0 * np.pi * np.sqrt(height**2 @ operator.weights / steepest)
        return float(wave), float(-np.arctan(axes[0, 1] / axes[1, 1]))

    @property
    def map(self) -> tuple[Array, Array, Array]:
        """x, y and height of the mode at the quadrature points of the flat strip."""
        strip = self.state.plan.model.strip
        x, y = quadrature_points(strip)[:2]
        return x, y, CellOperator(strip, (0, 1)).apply(self.heights)[2, 0]

    @property
    def count(self) -> int:
        """Crests and troughs across the strip where the mode is highest."""
        height = self.profile[1]
        turns = np.flatnonzero(np.diff(np.sign(np.diff(height)))) + 1
        return int(np.sum(np.abs(height[turns]) > SEEN * np.abs(height).max()))

    @property
    def place(self) -> str:
        """Name of the span in which the mode is highest, by its ends."""
        strip, z = self.state.plan.model.strip, self.heights.reshape(-1, 3)[:, 2]
        x = strip.nodes[0, np.abs(z[strip.node_values]).argmax()]
        nearest = min(self.wrinkling.spans, key=lambda span: abs(x - 0.5 * (span.start + span.end)))
        return f"{nearest.before} to {nearest.after}"


def onset(scene: Scene) -> Onset:
    """Return the first state of the last stage in which the strip is about to buckle.

    Raises
    ------
    PathStopped
        From the path.
    ValueError
        If the strip stays smooth, or is wrinkled from the beginning.
    """
    (found,) = onsets(scene, (ONSET,))
    if found is None:
        raise ValueError("the strip stays smooth")
    return found


def onsets(scene: Scene, levels: Sequence[float]) -> list[Onset | None]:
    """Return first states of the last stage with factors down to some levels, the highest first.

    Raises
    ------
    PathStopped
        From the path, before the first of them.
    ValueError
        If the strip is wrinkled when that stage begins.
    """
    found: list[Onset | None] = []
    steps = _last_stage(scene)
    before = next(steps).state
    if _factor(before) < levels[0]:
        raise ValueError("the strip is wrinkled before the last stage; begin at another tension")
    try:
        for arrival in steps:
            factor = _factor(arrival.state)
            while factor < levels[len(found)]:
                found.append(_dated(arrival, before, levels[len(found)]))
                if len(found) == len(levels):
                    return found
            before = arrival.state
    except PathStopped:
        if not found:
            raise
    return found + [None] * (len(levels) - len(found))


def _last_stage(scene: Scene) -> Iterator[Step]:
    """Yield the beginning of the last stage, and its steps."""
    march, course = March(Assembly(scene)), scene.course
    for left, stage in zip(range(len(course))[::-1], course, strict=True):
        plan = march.planned(stage, None)
        for arrival in march.through(plan, MOST_STEPS):
            march.accept(arrival)
            if not left:
                yield arrival
        if left == 1:
            yield arrival
        march.finish(stage, plan)


def _factor(state: State) -> float:
    """Return the growth of the compression at which the strip would buckle."""
    return float(buckling(state, 1)[0][0])


def _dated(arrival: Step, before: State, level: float) -> Onset:
    """The onset inside a step."""
    end = arrival.state
    branch = end.branch
    length = end.time - before.time if branch is None else branch.length

    def state(a: float) -> State:
        if branch is None:
            return end.at(before.time + a, before)
        return end.inside(a)

    found = state(brentq(lambda a: _factor(state(a)) - level, 0.0, length, xtol=DATED * length))
    heights = mode_heights(found, buckling(found, 1)[1][:, 0])
    return Onset(found, found.tension("exit"), Wrinkling(found).compression, heights)


@dataclass(frozen=True)
class Ended:
    """The end of a run."""

    state: State
    wrinkling: Wrinkling
    tangents: int
    outcome: Outcome = Outcome.DONE  # of the run, which may have stopped before its end

    @property
    def factor(self) -> float:
        """Growth of the compression at which the strip would buckle."""
        return _factor(self.state)

    @property
    def heights(self) -> list[float]:
        """Heights of the wrinkles in every span, over the thickness."""
        found = self.wrinkling.amplitudes()
        assert found is not None
        return [height / self.state.plan.model.strip.thickness for height in found]

    @property
    def lean(self) -> float:
        """Largest difference in height between both sides of the strip, over the thickness."""
        strip = self.state.plan.model.strip
        z = self.state.full.reshape(-1, 3)[strip.node_values, 2]
        here, there = (np.lexsort(np.round([side * strip.nodes[1], strip.nodes[0]], 9))
                       for side in (1.0, -1.0))  # fmt: skip
        return float(np.abs(z[here] - z[there]).max()) / strip.thickness


def ended(scene: Scene, directory: Path | None = None) -> Ended:
    """Run a scene as far as it goes, and write it if a directory is given."""
    run = scene.run(directory)
    *_, last = run
    return Ended(last.state, Wrinkling(last.state), run.cost.expansions, run.outcome)
