"""Estimates of wraps and slopes from the path of a taut string."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.string_path import (
    Belt,
    End,
    NoTangentError,
    NotTouchedError,
    Point,
    Straight,
    belt,
)
from anmstrip.simulation.meshing import bending_stiffness, largest_force
from anmstrip.simulation.stages import Course
from anmstrip.simulation.threading import SENSES

Array = NDArray[np.float64]

ENDS = ("entry", "exit")


@dataclass(frozen=True)
class Way:
    """Where a stage leaves the strip, seen as a taut string.

    Attributes
    ----------
    turns : dict
        Roller → wrap (rad), of those that are touched.
    senses : dict
        Roller → "over" or "under", of those.
    slope : float
        Steepest angle to the flat strip (rad), sag included.
    """

    turns: dict[str, float]
    senses: dict[str, str]
    slope: float


def way(course: Course) -> Way:
    """The strip as a taut string over or under the rollers, at the end of a stage.

    An end that is held is where it was moved to, a free one runs in the direction of its
    force.  Rollers that a taut string would not touch are left out.
    """
    rollers, ends = _candidates(course), [_end(course, name) for name in ENDS]
    while rollers:
        try:
            path = _belt(course, rollers, ends)
        except (NotTouchedError, NoTangentError) as error:
            del rollers[min(error.index, len(rollers) - 1)]
            continue
        turn, angles = path.arcs.turn[:, 0], path.angles[0::2, 0]
        names = [roller.name for roller, _ in rollers]
        return Way(
            dict(zip(names, (float(t) for t in turn), strict=True)),
            {r.name: "over" if sense > 0.0 else "under" for r, sense in rollers},
            float(np.abs(_turned(angles)).max()) + _sag(course),
        )
    return Way({}, {}, _straight(*ends) + _sag(course))


def _candidates(course: Course) -> list[tuple[Roller, float]]:
    """Rollers that can be touched, in their order along the strip, with their senses."""
    a = course.assembly
    if a.scene.contact is None:
        return []
    crossing = [r for r in a.rollers if abs(r.unit_axis[1]) > 0.1]
    if a.thread is not None:
        sides = zip(a.thread.rollers, a.thread.senses, strict=True)
        return [(roller, float(sense)) for roller, sense in sides]
    crossing.sort(key=lambda r: r.centre[0])
    return [(r, SENSES["over" if r.centre[2] < 0.0 else "under"]) for r in crossing]


def _belt(course: Course, rollers: list[tuple[Roller, float]], ends: list[End]) -> Belt:
    centres, radii = [], []
    for roller, _ in rollers:
        centre, axis = course.values[f"rollers.{roller.name}.centre"], roller.unit_axis
        s = -centre[1] / axis[1]
        centres.append((centre + s * axis)[[0, 2], None])
        radii.append([float(roller.radius_at(s))])
    return belt(centres, radii, [sense for _, sense in rollers], *ends)


def _end(course: Course, name: str) -> End:
    """Where an end is, or in which direction it is pulled."""
    x, edges = course.assembly.strip.mesh.p[0], course.assembly.scene.edges
    forward = 1.0 if name == "exit" else -1.0
    if name in edges and "z" in edges[name].fixed:  # released ones stay about where they were
        moved = course.moved.get(name, np.zeros(3))
        return Point([(x.max() if name == "exit" else x.min()) + moved[0], moved[2]])
    force = forward * np.asarray(course.values.get(f"{name}.force", np.zeros(3)))
    return Straight(0.25 * float(np.ptp(x)), float(np.arctan2(force[2], force[0])))


def _straight(entry: End, exit: End) -> float:
    """Slope of a strip that touches no roller (rad)."""
    if isinstance(entry, Point) and isinstance(exit, Point):
        along = np.subtract(exit.position, entry.position)
        return float(abs(np.arctan2(along[1], along[0])))
    return float(max(abs(end.angle) for end in (entry, exit) if isinstance(end, Straight)))


def _sag(course: Course) -> float:
    """Slope by weight and pressure (rad): q L / 2 T of a string, at most q L³ / 6 D of a beam."""
    a, values = course.assembly, course.values
    t, length = a.strip.thickness, a.strip.length
    weight = a.material.density * t * abs(values.get("gravity", np.zeros(3))[2])
    load = float(weight + abs(values.get("pressure", 0.0)))
    stiffness = 2.0 * largest_force(a.scene) / length + 6.0 * bending_stiffness(a.scene) / length**3
    return 0.0 if load == 0.0 else float(np.arctan(load / stiffness if stiffness else np.inf))


def _turned(angles: Array) -> Array:
    """Angles in (−π, π]."""
    return np.arctan2(np.sin(angles), np.cos(angles))
