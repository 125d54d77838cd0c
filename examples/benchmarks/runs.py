"""Runs of scenes, and of their last stages from a given state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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


def finished(scene: Scene) -> Run:
    """Run a scene to its end."""
    run = Run(scene)
    for _ in run:
        pass
    assert run.outcome.done, run.message
    return run


def altered(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    """Return the same scene with other numbers; dotted keys as for ``--set``."""
    texts = [f"{key}={value}" for key, value in changes.items()]
    return Scene.from_tables(scene.to_dict(), Path("study"), texts)


def wrapped(scene: Scene) -> Array:
    """Return all unknowns at the end of the last stage but one."""
    run = Run(scene)
    last = scene.course[-1].name
    for step in run:
        if step.stage == last:
            break
        full = run.march.full
    return full


class Turning:
    """The last stage of a scene, from given unknowns ``full``, where the stage before has ended."""

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

    def states(self) -> Iterator[State]:
        """Yield the states at the ends of steps by series; ``march.cost`` counts their cost."""
        for arrival in self.march.through(self.plan, 100_000):
            self.march.accept(arrival)
            yield arrival.state

    def ending(self, u: Array, v: Array) -> State:
        """Return the state at the end with given free unknowns and their velocities."""
        full, velocity = self.plan.supports.full(u, 1.0), self.plan.moving(1.0)
        velocity[self.plan.supports.free] = v
        return State(self.plan, self.plan.start + self.plan.duration, 1.0, full, velocity)
