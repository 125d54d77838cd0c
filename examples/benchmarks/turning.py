"""A strip that lies on a roller, ready for the roller to turn: what studies of friction share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Motion, StageProblem
from anmstrip.results.state import State
from anmstrip.simulation.march import March
from anmstrip.simulation.problem import Assembly

Array = NDArray[np.float64]


def altered(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    """The same scene with other numbers; dotted keys as for ``--set``."""
    texts = [f"{key}={value}" for key, value in changes.items()]
    return Scene.from_tables(scene.to_dict(), Path("study"), texts)


def wrapped(scene: Scene) -> Array:
    """All unknowns at the end of the last stage but one."""
    run = Run(scene)
    last = scene.course[-1].name
    for step in run:
        if step.stage == last:
            break
        full = run.march.full
    return full


class Turning:
    """The last stage of a scene, from a given state.

    Parameters
    ----------
    scene : Scene
    full : ndarray, shape (unknowns,)
        Where the stage before has ended.
    """

    def __init__(self, scene: Scene, full: Array) -> None:
        self.march = March(Assembly(scene))
        self.march.full = full
        for stage in scene.course[:-1]:
            self.march.course.finish(stage)
        self.plan: StageProblem = self.march.course.plan(scene.course[-1], {})

    @property
    def motion(self) -> Motion:
        """Equations of the stage."""
        plan = self.plan
        return Motion(plan.model, plan.supports, plan.controls, plan.start, plan.duration)

    def followed(self) -> State:
        """State at the end, by series; ``march.cost`` counts what it took."""
        for arrival in self.march.through(self.plan, 100_000):
            self.march.accept(arrival)
        return arrival.state

    def ending(self, u: Array, v: Array) -> State:
        """State at the end with given free unknowns and their velocities."""
        full, velocity = self.plan.supports.full(u, 1.0), self.plan.moving(1.0)
        velocity[self.plan.supports.free] = v
        return State(self.plan, self.plan.start + self.plan.duration, 1.0, full, velocity)
