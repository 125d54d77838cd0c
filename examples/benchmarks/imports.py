"""Which modules of mechanics an effect imports: looked at in processes of their own.

This module imports no more than what assembles and expands a scene, so that what is found
is the scene's doing.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from tempfile import TemporaryDirectory
from typing import Any

from anmstrip.continuation.expansion import Parameter, expand
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium, Motion, StageProblem
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course, stretched
from anmstrip.timestepping.formulas import AffineVelocity
from harness import Sheet, ask
from strips import TENSION, growing

CELLS = (12, 2)


def import_sheet() -> Sheet:
    """Modules that every step imports beyond the steps before it, and those of any run."""
    rows = [(f"+ {added}", _listed(modules)) for added, modules in _elsewhere("grown")]
    rows += [(what, _listed(modules)) for what, modules in _elsewhere("of_a_run")]
    note = (
        "What is imported for the first time when a scene is built and expanded once; last, when "
        "the first of these scenes is run to its end and its states are written."
    )
    return Sheet("Modules of mechanics", ("added", "imported"), tuple(rows), note)


def _listed(modules: list[str]) -> str:
    return ", ".join(modules) or "none"


def _elsewhere(function: str) -> list[tuple[str, list[str]]]:
    """Return the pairs that a function of this module yields in a process of its own."""
    reply = ask(__file__, function)
    assert reply.said is not None, reply.outcome
    return [(added, modules) for added, modules in reply.said]


def grown() -> Iterator[tuple[str, list[str]]]:
    """Effects in the order in which they are added, each with the modules that it brings."""
    known: set[str] = set()
    for added, scene in growing("section", CELLS):
        expanded_once(scene)
        yield added, sorted(_mechanics() - known)
        known = _mechanics()


def of_a_run() -> Iterator[tuple[str, list[str]]]:
    """What a run imports on top of the membrane alone, whatever the scene."""
    _, scene = next(growing("section", CELLS))
    expanded_once(scene)
    known = _mechanics()
    with TemporaryDirectory() as directory:
        for _ in scene.run(directory):
            pass
    yield "a run of the first, written", sorted(_mechanics() - known)


def _mechanics() -> set[str]:
    """Modules of mechanics imported so far, by their short names."""
    prefix = "anmstrip.mechanics."
    return {name.removeprefix(prefix) for name in sys.modules if name.startswith(prefix)}


def expanded_once(scene: Scene) -> None:
    """Build a scene and expand its last stage, at the state where it is laid or stretched."""
    assembly = Assembly(scene)
    course = Course(assembly)
    for stage in scene.course:
        plan = course.plan(stage, {})
        course.finish(stage)
    full = (
        stretched(assembly, TENSION)
        if assembly.thread is None
        else assembly.thread.guess(assembly.strip, assembly.pattern)
    )
    u = full[plan.supports.free]
    parameter = Parameter(1.0)
    expand(_equations(plan, u), 0.0 * u if plan.in_time else u, 0.0, order=3,
           solver=SparseSolver(), parameter=parameter)  # fmt: skip


def _equations(plan: StageProblem, u: Any) -> Equilibrium:
    if not plan.in_time:
        return Equilibrium(plan.model, plan.supports, plan.controls)
    motion = Motion(plan.model, plan.supports, plan.controls, plan.start, plan.duration)
    rest = AffineVelocity(1.0 / plan.duration, 0.0 * u, 0.0 * u)
    return motion.during(plan.start, plan.duration, rest, u)


if __name__ == "__main__":
    print(json.dumps(list({"grown": grown, "of_a_run": of_a_run}[sys.argv[1]]())))
