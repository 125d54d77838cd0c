"""Which level of kinematics the numbers of a scene justify; nothing is solved.

The ladder has three rungs, see :mod:`anmstrip.mechanics.kinematics`.  What a level would
cost follows from its counts; whether it is enough follows from what the scene does across
its width, and from the slopes of a taut string laid where the stages put the strip.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from anmstrip.mechanics.kinematics import KINEMATICS, Kinematics
from anmstrip.scene.build import Assembly
from anmstrip.scene.costs import size_of
from anmstrip.scene.stages import Course, Plan
from anmstrip.scene.taut import ENDS, Way, way

STEEPEST = np.radians(5.0)
"""Slope up to which a plate is offered: it errs by slope²/2, which is 0.4 % there."""

LOST = {
    "shell": "nothing is lost",
    "section": "lost is what the width does: anticlastic edges{edges}, contraction that the held "
    "ends prevent, wrinkles, wandering",
    "plate": "lost is motion in the plane: the tension stays as given, and slopes of {slope:.2g}° "
    "cost {error:.2g} % (slope²/2)",
}


@dataclass(frozen=True)
class Rung:
    """One level of the ladder, for one scene.

    Attributes
    ----------
    level : Kinematics
    unknowns, points : int or None
        ``None`` where the scene's mesh cannot be used at this level.
    cost : float or None
        Estimated seconds of an expansion over those at the scene's own level.
    against : tuple of str
        What the scene has that the level cannot see; empty if it can be used.
    lost : str
        What the level leaves out even so.
    """

    level: Kinematics
    unknowns: int | None
    points: int | None
    cost: float | None
    against: tuple[str, ...]
    lost: str


def walked(assembly: Assembly) -> Iterator[tuple[Plan, Way]]:
    """Stages as they would be solved, with the way of the strip at the end of each."""
    course = Course(assembly)
    for stage in assembly.scene.course:
        plan = course.plan(stage, {})
        course.finish(stage)
        yield plan, way(course)


def ladder(assembly: Assembly, ways: list[Way]) -> list[Rung]:
    """The three levels, the cheapest first."""
    sizes = {name: size_of(assembly, level) for name, level in KINEMATICS.items()}
    own = sizes[assembly.kinematics.name]
    assert own is not None
    slope = max((w.slope for w in ways), default=0.0)
    against = {"shell": (), "section": (*_across(assembly),), "plate": (*_large(assembly, ways),)}
    facts = {"edges": _edges(assembly), "slope": np.degrees(slope), "error": 50.0 * slope**2}
    rungs = []
    for name in ("section", "plate", "shell"):
        size, lost = sizes[name], LOST[name].format(**facts)
        if size is None:
            rungs.append(Rung(KINEMATICS[name], None, None, None, against[name], lost))
            continue
        cost = size.seconds(assembly.order) / own.seconds(assembly.order)
        rungs.append(Rung(KINEMATICS[name], size.unknowns, size.points, cost, against[name], lost))
    return rungs


def justified(rungs: list[Rung]) -> Rung:
    """The cheapest level that sees all that the scene has."""
    return min((r for r in rungs if not r.against and r.cost is not None), key=_cost)


def _cost(rung: Rung) -> float:
    return np.inf if rung.cost is None else rung.cost


def _edges(assembly: Assembly) -> str:
    radii = [r.radius for r in assembly.rollers]
    if not radii or not assembly.scene.strip.bending:
        return ""
    return f" (about √(r t) = {np.sqrt(min(radii) * assembly.strip.thickness):.2g} m wide)"


# what it cannot see ------------------------------------------------------------


def _across(assembly: Assembly) -> Iterator[str]:
    """What a section, without width, does not see."""
    scene = assembly.scene
    if scene.strip.mesh is not None:
        yield "the mesh comes from a file, which may have holes or any outline"
    for roller in scene.rollers:
        if roller.axis[0] or roller.axis[2]:
            yield f"the axis of {roller.name} is not along y"
        if roller.profile:
            yield f"{roller.name} is crowned or tapered"
    for stage in scene.stages:
        if stage.gravity is not None and stage.gravity[1]:
            yield f"stage {stage.name} has gravity across the strip"
        for name, c in stage.edges.items():
            given = (c.force, c.move, c.velocity)
            if name in ENDS and any(v is not None and v[1] for v in given):
                yield f"stage {stage.name} pulls or moves {name} across the strip"
    touched = {*scene.edges, *(name for stage in scene.stages for name in stage.edges)}
    for name in sorted(touched - {*ENDS}):
        yield f"{name}, a side, is held, pulled or moved"


def _large(assembly: Assembly, ways: list[Way]) -> Iterator[str]:
    """What a plate, with small slopes and nothing in its plane, does not see."""
    scene = assembly.scene
    if any(assembly.frictional(stage) for stage in scene.course):
        yield "friction moves the strip along"
    if scene.strip.feed:
        yield "the strip is fed, so it moves along"
    steepest = max(ways, key=lambda w: w.slope)
    if steepest.slope > STEEPEST:
        yield _steep(steepest)
    if scene.threading is not None:
        yield "[threading] lays the strip around rollers"
    for stage in scene.stages:
        for name, c in stage.edges.items():
            if any(v is not None and (v[0] or v[1]) for v in (c.move, c.velocity)):
                yield f"stage {stage.name} moves {name} in the plane"
            if c.tension is not None:
                yield f"{name}.tension in stage {stage.name}: only exit.force pulls a plate"
            elif c.force is not None and any(c.force[name == "exit" : 2]):
                yield f"stage {stage.name} pulls {name} in the plane, not by exit.force along x"


def _steep(found: Way) -> str:
    wraps = ", ".join(f"{n} by {np.degrees(t):.3g}°" for n, t in found.turns.items() if t > 0.0)
    wrapped = f", wrapping {wraps}" if wraps else ""
    error = "beyond all small slopes" if found.slope > 1.0 else f"{50.0 * found.slope**2:.0f} %"
    return (
        f"slopes reach {np.degrees(found.slope):.3g}°{wrapped}: the error, slope²/2, would be "
        f"{error} (bound {np.degrees(STEEPEST):.0f}°)"
    )
