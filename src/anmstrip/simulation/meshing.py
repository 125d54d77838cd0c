"""The mesh of a rectangular strip: finer where rollers will be."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from skfem import MeshLine, MeshQuad

from anmstrip.arrays import Array
from anmstrip.fem.strip import grid, line
from anmstrip.mechanics.roller import Roller
from anmstrip.scene.schema import SceneSpec
from anmstrip.scene.tables import RollerControl

if TYPE_CHECKING:
    from anmstrip.simulation.threading import Thread


MOST_ELEMENTS = 250_000
"""Of a strip; the tangent of a shell of so many takes tens of gigabytes."""

QUARTER = 0.25
"""Share of the boundary layer √(D/T) that an element over a roller may cover."""

NEAR_LIFT = 2.0
"""Boundary layers on both sides of a place where a standing mesh lifts on or off that are fine."""

GROWTH = 0.15
"""Growth of the element length per length of strip beyond.  With 0.15 the difference of tensions
over a roller is within 0.1 % of that on an evenly fine mesh, with 0.3 within 0.3 %, with 0.6 within
1 %; with twice ``NEAR_LIFT`` it changes by 0.02 %."""

ARC = 0.05
"""Longest element inside the arc of a standing mesh, over the radius.  The tension of a strip that
sticks is off by 7e-5 of itself with 0.1, by 1e-6 with 0.05: a cubic stretches on a circle."""


def largest_force(scene: SceneSpec) -> float:
    """Largest tension or edge force of all stages (N/m), 0 if there is none."""
    forces = [0.0 if scene.threading is None else scene.threading.tension]
    for stage in scene.stages:
        for control in stage.edges.values():
            forces.append(abs(control.tension or 0.0))
            forces.append(float(np.linalg.norm(control.force or (0.0,))))
    return max(forces)


def bending_stiffness(scene: SceneSpec) -> float:
    """D (N m), zero for a strip that does not resist bending."""
    m, t = scene.material, scene.strip.thickness
    return m.young * t**3 / (12.0 * (1.0 - m.poisson**2)) if scene.strip.bending else 0.0


def boundary_layer(scene: SceneSpec) -> float:
    """√(D/T) (m) of the largest tension; infinite without tension."""
    tension = largest_force(scene)
    return float(np.sqrt(bending_stiffness(scene) / tension)) if tension > 0.0 else np.inf


def strip_mesh(
    scene: SceneSpec, rollers: Sequence[Roller], thread: Thread | None
) -> MeshQuad | MeshLine:
    """Rectangles, or lines of a section, finer over and near the rollers.

    The fine part covers a quarter of each roller's circumference on both sides of its axis,
    or the arc on which a threaded strip touches it, and the stretch that is carried over it.
    A strip that is fed is fine everywhere: all of it comes to pass the rollers.  A mesh that
    stands still is fine where the strip lifts on and off alone.
    """
    spec = scene.strip
    assert spec.width is not None and spec.cells is not None
    length = spec.length if thread is None else thread.length
    assert length is not None
    half, coarse = length / 2.0, length / spec.cells[0]
    fine = spec.refined or QUARTER * boundary_layer(scene) or np.inf
    zones = list[tuple[float, float]]()
    if scene.contact is not None and fine < coarse:
        zones = fine_zones(scene, rollers, thread, half)
    if spec.feed:
        zones = [(-half, half)] if zones else []
    section, layer = spec.kinematics == "section", max(boundary_layer(scene), fine / QUARTER)
    standing = thread if zones and _stands(scene) else None
    if standing is not None:
        near = NEAR_LIFT * layer
        zones = [(x - near, x + near) for arc in standing.arcs.values() for x in arc]
    _bearable(scene, half, zones, fine, 1 if section else spec.cells[1])
    if standing is None:
        xs = lines_of_nodes(half, zones, fine, coarse)
    else:
        xs = graded_nodes(half, standing, near, fine, coarse)
    if section:
        return line(xs)
    return grid(xs, np.linspace(-spec.width / 2.0, spec.width / 2.0, spec.cells[1] + 1))


def _bearable(
    scene: SceneSpec, half: float, zones: list[tuple[float, float]], fine: float, across: int
) -> None:
    """Refuse more elements than fit into a computer, before they are made."""
    assert scene.strip.cells is not None
    along = scene.strip.cells[0] + sum(hi - lo for lo, hi in zones) / fine
    if not along * across <= MOST_ELEMENTS:
        key, now = ("refined", fine) if zones else ("cells", list(scene.strip.cells))
        finest = 2.0 * half * across / (0.5 * MOST_ELEMENTS)
        expected = (
            f"at most {MOST_ELEMENTS} elements; {along * across:.3g} would come from elements of "
            f"{fine if zones else 2.0 * half / along:.3g} m"
        )
        hint = f"refined = {finest:.1g}" if zones else "cells = [16, 2]"
        raise scene.refused(f"strip.{key}", now, expected, hint)


def lines_of_nodes(
    half: float, zones: list[tuple[float, float]], fine: float, coarse: float
) -> Array:
    """Coordinates from −half to half, at most fine apart in the zones and coarse elsewhere."""
    marks = sorted({-half, half, *(x for zone in zones for x in zone)})
    xs = [np.array([-half])]
    for a, b in pairwise(marks):
        inside = any(lo <= a and b <= hi for lo, hi in zones)
        count = max(1, int(np.ceil((b - a) / (fine if inside else coarse) - 1e-9)))
        xs.append(np.linspace(a, b, count + 1)[1:])
    return np.concatenate(xs)


def _stands(scene: SceneSpec) -> bool:
    """Whether the strip lifts on and off at the same labels throughout."""
    moves = [c.move for stage in scene.stages for c in stage.edges.values()]
    moves += [c.move for stage in scene.stages for c in stage.rollers.values()]
    steady = all(stage.steady or not stage.friction for stage in scene.stages)
    return steady and not scene.strip.feed and not any(moves)


def graded_nodes(half: float, thread: Thread, near: float, fine: float, coarse: float) -> Array:
    """Coordinates from −half to half, fine where the strip lifts on and off, growing away from it.

    These places are nodes: a string has corners of its curvature there.  The length of the
    elements is at most ``fine`` up to ``near`` of them, grows by ``GROWTH`` per length beyond, to
    ``ARC`` radii on a roller and to ``coarse`` elsewhere.
    """
    x = np.linspace(-half, half, 1 + int(np.ceil(8.0 * half / fine)))
    sizes = np.full_like(x, coarse)
    for roller in thread.rollers:
        first, last = thread.arcs[roller.name]
        sizes[(first < x) & (x < last)] = min(coarse, ARC * roller.radius)
    lifts = np.sort(np.ravel(list(thread.arcs.values())))
    place = np.clip(np.searchsorted(lifts, x), 1, len(lifts) - 1)
    distance = np.minimum(np.abs(x - lifts[place - 1]), np.abs(lifts[place] - x))
    sizes = np.minimum(sizes, fine + GROWTH * np.maximum(distance - near, 0.0))
    passed = np.cumsum(np.append(0.0, 0.5 * np.diff(x) * (1.0 / sizes[1:] + 1.0 / sizes[:-1])))
    xs = [np.array([-half])]
    for a, b in pairwise(np.interp([-half, *lifts, half], x, passed)):
        xs.append(np.interp(np.linspace(a, b, int(np.ceil(b - a)) + 1)[1:], passed, x))
    return np.concatenate(xs)


def fine_zones(
    scene: SceneSpec, rollers: Sequence[Roller], thread: Thread | None, half: float
) -> list[tuple[float, float]]:
    """Stretches of strip, in the reference, that come to lie on rollers."""
    zones, united = [], list[tuple[float, float]]()
    threaded = {} if thread is None else thread.arcs
    margin = 4.0 * min(boundary_layer(scene), half)
    back, ahead = _carried(scene, rollers, thread)
    for roller in rollers:
        reach = 0.5 * np.pi * roller.radius
        middle = roller.centre[0] if thread is None else thread.passing(crossing(roller))[0]
        first, last = middle - reach, middle + reach
        if roller.name in threaded:
            first, last = threaded[roller.name]
            first, last = first - margin, last + margin
        zones.append((max(-half, float(first - ahead)), min(half, float(last + back))))
    for lo, hi in sorted((lo, hi) for lo, hi in zones if lo < hi):
        if united and lo <= united[-1][1]:
            united[-1] = (united[-1][0], max(hi, united[-1][1]))
        else:
            united.append((lo, hi))
    return united


def crossing(roller: Roller) -> Array:
    """Point (x, z) in which the axis of a roller crosses the plane y = 0, or its centre."""
    centre, axis = np.asarray(roller.centre, dtype=float), roller.unit_axis
    return (centre - axis * (centre[1] / axis[1] if axis[1] else 0.0))[[0, 2]]


def carrying_sense(roller: Roller, thread: Thread | None) -> float:
    """+1 if turning right-handed about its axis a roller carries the strip on, else −1."""
    forwards = np.copysign(1.0, roller.unit_axis[1])
    if thread is None:
        return float(forwards if roller.centre[2] <= 0.0 else -forwards)
    wrapped = dict(zip((r.name for r in thread.rollers), thread.senses, strict=True))
    return float(forwards * wrapped.get(roller.name, thread.passing(crossing(roller))[1]))


def surface_speed(control: RollerControl | None, roller: Roller) -> float | None:
    """Surface speed (m/s, in the roller's sense) that a stage ends with, None if it stays."""
    if control is None:
        return None
    if control.angular_speed is None:
        return control.surface_speed
    return roller.sense * roller.radius * control.angular_speed


def _carried(
    scene: SceneSpec, rollers: Sequence[Roller], thread: Thread | None
) -> tuple[float, float]:
    """Largest travel of the strip, backwards and forwards (m).

    That of the edges that are held, or of any roller's surface where none is or one is let go: a
    roller that stands does not hold a strip that others carry over it.  Where only torques drive
    the strip, its travel is not known, and all of it may pass.
    """
    held = [edge for edge, spec in scene.edges.items() if spec.fixed]
    ways = []
    if not held or any(c.release for stage in scene.stages for c in stage.edges.values()):
        drives = {roller.drive for roller in scene.rollers}
        if "torque" in drives and "speed" not in drives:
            return np.inf, np.inf
        for roller in rollers:
            sense = carrying_sense(roller, thread) * roller.sense
            own = [surface_speed(s.rollers.get(roller.name), roller) for s in scene.stages]
            ways.append(_travel(scene, [None if s is None else sense * s for s in own]))
    else:
        for edge in held:
            controls = [stage.edges.get(edge) for stage in scene.stages]
            given = [None if c is None else c.velocity for c in controls]
            speeds = [None if v is None else np.copysign(np.linalg.norm(v), v[0]) for v in given]
            ways.append(_travel(scene, speeds))
    return max((b for b, _ in ways), default=0.0), max((a for _, a in ways), default=0.0)


def _travel(scene: SceneSpec, speeds: list[float | None]) -> tuple[float, float]:
    """Farthest backwards and forwards (m), by the speeds at the ends of the stages."""
    speed = travel = lowest = highest = 0.0
    for stage, given in zip(scene.stages, speeds, strict=True):
        new = speed if given is None else given
        travel += 0.0 if stage.steady else 0.5 * (speed + new) * stage.duration
        speed, lowest, highest = new, min(lowest, travel), max(highest, travel)
    return -lowest, highest
