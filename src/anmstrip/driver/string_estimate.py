"""Estimates of wraps and slopes from the path of a taut string."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.string_path import (
    End,
    FixedEnd,
    NoTangentError,
    NotTouchedError,
    StraightEnd,
    string_path,
)
from anmstrip.simulation.meshing import bending_stiffness, largest_force
from anmstrip.simulation.stages import Course
from anmstrip.simulation.threading import SENSES

ENDS = ("entry", "exit")


@dataclass(frozen=True)
class StringEstimate:
    """The strip at the end of a stage, seen as a taut string."""

    turns: dict[str, float]  # wraps of the rollers that are touched (rad)
    senses: dict[str, str]  # "over" or "under", of those
    slope: float  # steepest angle to the flat strip, sag included (rad)


def string_estimate(course: Course) -> StringEstimate:
    """Lay a taut string over or under the rollers, where they are at the end of a stage.

    An end that is held is where it was moved to, a free one runs in the direction of its
    force.  Rollers that a taut string would not touch are left out, and those that lie along
    the strip.  A string sags by q L / 2 T, a beam by at most q L³ / 6 D; both carry together.
    """
    a, values = course.assembly, course.values
    weight = a.material.density * a.strip.thickness * abs(values.get("gravity", np.zeros(3))[2])
    load, length = float(weight + abs(values.get("pressure", 0.0))), a.strip.length
    stiffness = 2.0 * largest_force(a.scene) / length + 6.0 * bending_stiffness(a.scene) / length**3
    sag = float(np.arctan(load / stiffness if stiffness else np.inf)) if load else 0.0
    entry, exit = (_end(course, name) for name in ENDS)
    rollers: list[tuple[Roller, float]] = []
    if a.scene.contact is not None and a.thread is not None:
        rollers = list(zip(a.thread.rollers, a.thread.senses, strict=True))
    elif a.scene.contact is not None:
        crossing = [roller for roller in a.rollers if abs(roller.unit_axis[1]) > 0.1]
        for roller in sorted(crossing, key=lambda roller: roller.centre[0]):
            rollers.append((roller, SENSES["over" if roller.centre[2] < 0.0 else "under"]))
    while rollers:
        centres, radii = [], []
        for roller, _ in rollers:
            centre, axis = values[f"rollers.{roller.name}.centre"], roller.unit_axis
            s = -centre[1] / axis[1]
            centres.append((centre + s * axis)[[0, 2], None])
            radii.append([float(roller.radius_at(s))])
        try:
            path = string_path(centres, radii, [float(sense) for _, sense in rollers], entry, exit)
        except (NotTouchedError, NoTangentError) as error:
            del rollers[min(error.index, len(rollers) - 1)]
            continue
        angles = path.angles[0::2, 0]
        slopes = np.arctan2(np.sin(angles), np.cos(angles))
        return StringEstimate(
            {r.name: float(t) for (r, _), t in zip(rollers, path.arcs.turn[:, 0], strict=True)},
            {r.name: "over" if sense > 0.0 else "under" for r, sense in rollers},
            float(np.abs(slopes).max()) + sag,
        )
    if isinstance(entry, FixedEnd) and isinstance(exit, FixedEnd):
        along = np.subtract(exit.position, entry.position)
        return StringEstimate({}, {}, float(abs(np.arctan2(along[1], along[0]))) + sag)
    slope = max(abs(end.angle) for end in (entry, exit) if isinstance(end, StraightEnd))
    return StringEstimate({}, {}, float(slope) + sag)


def _end(course: Course, name: str) -> End:
    """Place of an end, or the direction in which it is pulled."""
    x, edges = course.assembly.strip.mesh.p[0], course.assembly.scene.edges
    if name in edges and "z" in edges[name].fixed:  # released ones stay about where they were
        moved = course.moved.get(name, np.zeros(3))
        return FixedEnd([(x.max() if name == "exit" else x.min()) + moved[0], moved[2]])
    force = np.asarray(course.values.get(f"{name}.force", np.zeros(3)))
    force = force if name == "exit" else -force
    return StraightEnd(0.25 * float(np.ptp(x)), float(np.arctan2(force[2], force[0])))
