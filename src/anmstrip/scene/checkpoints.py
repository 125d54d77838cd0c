"""What a checkpoint holds of a run, and how a run goes on from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.series.implicit_dae import Memory

if TYPE_CHECKING:
    from anmstrip.scene.run import Run

Array = NDArray[np.float64]


def packed(run: Run) -> tuple[dict[str, Array], dict[str, Any]]:
    """Arrays and plain facts from which :func:`unpack` restores a run."""
    course = run.course
    arrays = {"full": run.full, "velocity": run.velocity}
    arrays |= {f"moved.{name}": value for name, value in course.moved.items()}
    arrays |= {f"begun.{name}": value for name, value in course.begun.items()}
    arrays |= {f"value.{name}": value for name, value in course.values.items()}
    if run.feed is not None:
        arrays |= {f"home.{name}": value for name, value in run.feed.home.items()}
    facts: dict[str, Any] = {
        "stage": run.first_stage,
        "steps": run.steps,
        "expansions": run.cost.expansions,
        "factorisations": run.cost.factorisations,
        "seconds": run.seconds,
        "reached": run.reached,
        "time": 0.0 if run.state is None else run.state.time,
        "course_time": course.time,
        "released": sorted(course.released),
        "stages": run.stages,
        "effects": run.effects,
        "fed": 0 if run.feed is None else run.feed.elements,
    }
    if run.memory is not None:
        facts["times"], facts["next_step"] = list(run.memory.times), run.memory.step
        arrays["states"], arrays["v"] = np.array(run.memory.states), run.memory.v
    return arrays, facts


def unpack(run: Run, arrays: Mapping[str, Array], facts: Mapping[str, Any]) -> None:
    """Bring a new run to where a packed one was."""
    run.full, run.velocity = arrays["full"], arrays["velocity"]
    run.first_stage, run.steps, run.reached = facts["stage"], facts["steps"], facts["reached"]
    run.cost.expansions = facts["expansions"]
    run.cost.factorisations = facts["factorisations"]
    run.spent, run.stages, run.effects = facts["seconds"], facts["stages"], facts["effects"]
    run.course.time, run.course.released = facts["course_time"], set(facts["released"])
    kept = {"moved": run.course.moved, "begun": run.course.begun, "value": run.course.values}
    if run.feed is not None:
        kept["home"], run.feed.elements = run.feed.home, facts["fed"]
    for name, value in arrays.items():
        kind, _, key = name.partition(".")
        if kind in kept:
            kept[kind][key] = value
    if "times" in facts:
        states = tuple(arrays["states"])
        run.memory = Memory(tuple(facts["times"]), states, arrays["v"], facts["next_step"])
