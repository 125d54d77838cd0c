"""What a checkpoint holds of a run, and how a run goes on from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.series.backward_differences import Memory
from anmstrip.series.continuation import Pace

if TYPE_CHECKING:
    from anmstrip.scene.run import Run

Array = NDArray[np.float64]


def packed(run: Run) -> tuple[dict[str, Array], dict[str, Any]]:
    """Arrays and plain facts from which :func:`unpack` restores a run."""
    march, course = run.march, run.march.course
    arrays = {"full": march.full, "velocity": march.velocity}
    arrays |= {f"moved.{name}": value for name, value in course.moved.items()}
    arrays |= {f"speed.{name}": value for name, value in course.speeds.items()}
    arrays |= {f"begun.{name}": value for name, value in course.begun.items()}
    arrays |= {f"value.{name}": value for name, value in course.values.items()}
    if march.feed is not None:
        arrays |= {f"home.{name}": value for name, value in march.feed.home.items()}
    facts: dict[str, Any] = {
        "stage": run.first_stage,
        "steps": run.steps,
        "expansions": run.cost.expansions,
        "factorisations": run.cost.factorisations,
        "seconds": run.seconds,
        "reached": march.reached,
        "time": 0.0 if run.state is None else run.state.time,
        "course_time": course.time,
        "released": sorted(course.released),
        "stages": run.stages,
        "effects": run.effects,
        "snaps": run.snaps,
        "slack": march.slack,
        "fed": 0 if march.feed is None else march.feed.elements,
    }
    if march.memory is not None:
        facts["times"], facts["next_step"] = list(march.memory.times), march.memory.step
        facts["time_order"] = march.memory.order
        arrays["states"], arrays["v"] = np.array(march.memory.states), march.memory.v
    if march.pace is not None:
        facts["pace"] = {
            "control": march.pace.control,
            "last": march.pace.last,
            "shrinking": march.pace.shrinking,
            "arclength": march.pace.arclength,
        }
        if march.pace.forward is not None:
            arrays["forward"], facts["forward"] = march.pace.forward
    return arrays, facts


def unpack(run: Run, arrays: Mapping[str, Array], facts: Mapping[str, Any]) -> None:
    """Bring a new run to where a packed one was."""
    march = run.march
    march.full, march.velocity = arrays["full"], arrays["velocity"]
    run.first_stage, run.steps, march.reached = facts["stage"], facts["steps"], facts["reached"]
    run.cost.expansions = facts["expansions"]
    run.cost.factorisations = facts["factorisations"]
    run.spent, run.stages, run.effects = facts["seconds"], facts["stages"], facts["effects"]
    run.snaps = facts["snaps"]
    march.course.time, march.course.released = facts["course_time"], set(facts["released"])
    kept = {
        "moved": march.course.moved,
        "begun": march.course.begun,
        "speed": march.course.speeds,
        "value": march.course.values,
    }
    if march.feed is not None:
        kept["home"], march.feed.elements = march.feed.home, facts["fed"]
    for name, value in arrays.items():
        kind, _, key = name.partition(".")
        if kind in kept:
            kept[kind][key] = value
    march.slack = facts["slack"]
    if "pace" in facts:
        forward = (arrays["forward"], facts["forward"]) if "forward" in facts else None
        march.pace = Pace(
            facts["pace"]["control"],
            facts["pace"]["last"],
            tuple((a, b) for a, b in facts["pace"]["shrinking"]),
            facts["pace"]["arclength"],
            forward,
        )
    if "times" in facts:
        states = tuple(arrays["states"])
        march.memory = Memory(
            tuple(facts["times"]), states, arrays["v"], facts["next_step"], facts["time_order"]
        )
