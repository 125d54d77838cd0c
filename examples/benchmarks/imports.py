"""Modules of mechanics that an effect imports, looked at in processes of their own.

This module imports no more than what assembles and expands a scene, so that what is found
is the scene's doing.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from tempfile import TemporaryDirectory

from anmstrip.continuation.expansion import Parameter, expand
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium, Motion
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course, uniform_stretch
from anmstrip.timestepping.formulas import AffineVelocity
from harness import Sheet, ask
from strips import TENSION, growing

CELLS = (12, 2)


def import_sheet() -> Sheet:
    """Return modules that every step imports beyond the steps before it, and those of any run."""
    rows = []
    for function, plus in (("of_effects", "+ "), ("of_a_run", "")):
        reply = ask(__file__, function)
        assert reply.said is not None, reply.outcome
        rows += [(f"{plus}{added}", ", ".join(names) or "none") for added, names in reply.said]
    note = (
        "What is imported for the first time when a scene is built and expanded once; last, when "
        "the first of these scenes is run to its end and its states are written."
    )
    return Sheet("Modules of mechanics", ("added", "imported"), tuple(rows), note)


def of_effects() -> Iterator[tuple[str, list[str]]]:
    """Yield effects in the order in which they are added, with the modules that each brings."""
    known: set[str] = set()
    for added, scene in growing("section", CELLS):
        expand_once(scene)
        yield added, sorted(_mechanics() - known)
        known = _mechanics()


def of_a_run() -> Iterator[tuple[str, list[str]]]:
    """Yield what a run imports on top of the membrane alone, whatever the scene."""
    _, scene = next(growing("section", CELLS))
    expand_once(scene)
    known = _mechanics()
    with TemporaryDirectory() as directory:
        for _ in scene.run(directory):
            pass
    yield "a run of the first, written", sorted(_mechanics() - known)


def _mechanics() -> set[str]:
    """Return the modules of mechanics imported so far, by their short names."""
    prefix = "anmstrip.mechanics."
    return {name.removeprefix(prefix) for name in sys.modules if name.startswith(prefix)}


def expand_once(scene: Scene) -> None:
    """Build a scene and expand its last stage, at the state where it is laid or stretched."""
    a = Assembly(scene)
    course = Course(a)
    for stage in scene.course:
        plan = course.plan(stage, {})
        course.finish(stage)
    full = uniform_stretch(a, TENSION, {}) if a.thread is None else a.laid
    u = full[plan.supports.free]
    rest, equations = 0.0 * u, Equilibrium(plan.model, plan.supports, plan.controls)
    if plan.in_time:
        motion = Motion(plan.model, plan.supports, plan.controls, plan.start, plan.duration)
        velocity = AffineVelocity(1.0 / plan.duration, rest, rest)
        equations = motion.during(plan.start, plan.duration, velocity, u)
    start = rest if plan.in_time else u
    expand(equations, start, 0.0, order=3, solver=SparseSolver(), parameter=Parameter(1.0))


if __name__ == "__main__":
    print(json.dumps(list({"of_effects": of_effects, "of_a_run": of_a_run}[sys.argv[1]]())))
