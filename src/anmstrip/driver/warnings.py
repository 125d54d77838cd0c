"""Warnings before a scene runs: its mesh, forces, friction and level of kinematics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.driver.string_estimate import ENDS, Way, way
from anmstrip.equilibrium import StageProblem
from anmstrip.fem.geometry import KINEMATICS, Kinematics
from anmstrip.mechanics.roller import Roller
from anmstrip.simulation.meshing import QUARTER, boundary_layer, largest_force
from anmstrip.simulation.problem import Assembly, size_of
from anmstrip.simulation.stages import Course

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


def walked(assembly: Assembly) -> Iterator[tuple[StageProblem, Way]]:
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


BENT = 0.5
"""Turn (rad) within one element over a roller that it cannot follow."""

SUNK = 0.1
"""Share of a roller's radius that a strip may sink into it, pressed by its tension."""

FAINT = 1e-2
"""Share of the largest force below which an end that was pulled is slack."""


def warnings(
    assembly: Assembly, plans: Sequence[StageProblem] = (), ways: Sequence[Way] = ()
) -> list[str]:
    """All of them; plans and ways as from :func:`anmstrip.driver.warnings.walked`."""
    told = [*serious(assembly, plans, ways), *_mesh_warnings(assembly)]
    return [*told, *_friction_warnings(assembly), *_stress_warnings(assembly)]


def serious(
    assembly: Assembly, plans: Sequence[StageProblem] = (), ways: Sequence[Way] = ()
) -> list[str]:
    """Those for which a run may stop."""
    if not plans or not ways:
        plans, ways = (list(found) for found in zip(*walked(assembly), strict=True))
    if largest_force(assembly.scene) == 0.0:
        return []
    found = [*_roller_doubts(assembly, ways)] if assembly.scene.contact is not None else []
    found += [*_pulled_slack(assembly, plans), *_not_held(assembly, plans)]
    return [*found, *_slack(assembly, plans), *_heavy(assembly, plans)]


def _roller_doubts(assembly: Assembly, ways: Sequence[Way]) -> Iterator[str]:
    """Elements that cannot follow a roller, contact that sets in far out or lets the strip sink."""
    tension = largest_force(assembly.scene)
    x = assembly.strip.mesh.p[0, assembly.strip.mesh.t].mean(axis=0)
    for roller in assembly.rollers:
        turn = max((way.turns.get(roller.name, 0.0) for way in ways), default=0.0)
        over, least = _over(assembly, roller, x), QUARTER * roller.radius
        h = assembly.strip.cell_sizes[0, over].max() if over.any() else 0.0
        if min(h / roller.radius, turn) > BENT:
            yield (
                f"roller {roller.name} turns the strip by {np.degrees(turn):.0f}°, and elements of "
                f"{h:.2g} m cannot follow its radius of {roller.radius:.2g} m. "
                f"Try --set strip.refined={least:.1g}."
            )
        depth = -float(assembly.signorini.gap(np.float64(tension / roller.radius)))
        if depth > SUNK * roller.radius and turn > SUNK:
            yield (
                f"pressed by T/r = {tension / roller.radius:.2g} Pa the strip sinks {depth:.2g} m "
                f"into roller {roller.name}, of radius {roller.radius:.2g} m. "
                f"Try --set {_harder(assembly, roller, tension / roller.radius, depth)}."
            )
        elif (width := _onset(assembly)) > SUNK * roller.radius:
            given = assembly.scene.contact is not None and assembly.scene.contact.onset is not None
            keys = f"strip.refined={least:.1g}", f"contact.onset={SUNK**2 * roller.radius:.1g}"
            yield (
                f"contact sets in {width:.2g} m away from roller {roller.name}, of radius "
                f"{roller.radius:.2g} m. Try --set {keys[given]}."
            )


def _onset(assembly: Assembly) -> float:
    """Gap (m) over which contact without a penalty sets in."""
    contact = assembly.scene.contact
    return assembly.signorini.width if contact is not None and contact.constants is None else 0.0


def _harder(assembly: Assembly, roller: Roller, pressure: float, depth: float) -> str:
    """Setting of the scene's own law with which the strip sinks in by a hundredth of the radius.

    The gap of a graded law goes with its onset.
    """
    contact, least = assembly.scene.contact, SUNK**2 * roller.radius
    assert contact is not None
    if contact.constants is not None:
        return f"contact.stiffness={pressure / least:.1g}"
    width = assembly.signorini.width
    return f"contact.onset={width * least / depth:.1g}"


def _pulled_slack(assembly: Assembly, plans: Sequence[StageProblem]) -> Iterator[str]:
    """A first stage that pulls the slack strip while it may rub, in time from no stiffness on."""
    first = plans[0]
    ends = [first.controls.at(share).get("exit.force", np.zeros(3)) for share in (0.0, 1.0)]
    if assembly.thread is None and first.in_time and not np.any(ends[0]) and np.any(ends[1]):
        yield (
            f"stage {first.name} pulls a slack strip, which has no stiffness across, while it may "
            f"rub. Try --set stages.{first.name}.friction=false, to pull it before."
        )


def _not_held(assembly: Assembly, plans: Sequence[StageProblem]) -> Iterator[str]:
    """Stages from which on no edge holds the strip in x, nor friction what is changed there."""
    holding = {name for name, edge in assembly.scene.edges.items() if "x" in edge.fixed}
    names = {plan.name for plan in plans}
    for stage in (stage for stage in assembly.scene.stages if stage.name in names and holding):
        holding -= {name for name, edge in stage.edges.items() if edge.release}
        pulled = [name for name, edge in stage.edges.items() if edge.force or edge.tension]
        rubs = assembly.frictional(stage)
        if holding or (rubs and not pulled):
            continue
        who, key = ("only friction", "force") if rubs else ("nothing", "release")
        what = f", which pulls at its {pulled[0]}" if rubs else ""
        yield (
            f"{who} holds the strip in x in stage {stage.name}{what}. "
            f"Try it without stages.{stage.name}.{(pulled or ['entry'])[0]}.{key}."
        )


def _slack(assembly: Assembly, plans: Sequence[StageProblem]) -> Iterator[str]:
    """Stages at whose end an end that was pulled no longer is."""
    largest, strip = largest_force(assembly.scene), assembly.strip
    stiff = assembly.scene.strip.bending
    bearable = strip.bending_stiffness * (np.pi / strip.length) ** 2 if stiff else 0.0
    for plan in plans:
        end = plan.controls.at(1.0)
        force = end.get("exit.force")
        if force is None or "exit.tension" in end or largest < 10.0 * bearable:
            continue
        before = np.linalg.norm(plan.controls.at(0.0)["exit.force"])
        if np.linalg.norm(force) < FAINT * largest < before:
            yield (
                f"stage {plan.name} leaves the strip without tension, which is what holds it in "
                f"shape. Try --set 'stages.{plan.name}.exit.force=[{0.1 * largest:.2g}, 0.0, 0.0]'."
            )


def _heavy(assembly: Assembly, plans: Sequence[StageProblem]) -> Iterator[str]:
    """Stages whose weight is more than the tension can carry without a deep sag."""
    largest, strip = largest_force(assembly.scene), assembly.strip
    for plan in plans:
        gravity = np.linalg.norm(plan.controls.at(1.0).get("gravity", np.zeros(3)))
        weight = gravity * strip.material.density * strip.thickness * strip.length
        if weight > largest:
            yield (
                f"in stage {plan.name} the strip weighs {weight:.2g} N/m, {weight / largest:.2g} "
                "times its tension, and sags deeply. Try a larger tension, or gravity from the "
                "first stage on."
            )


def _mesh_warnings(assembly: Assembly) -> Iterator[str]:
    layer = boundary_layer(assembly.scene)
    if assembly.scene.contact is None or not np.isfinite(layer):
        return
    x = assembly.strip.mesh.p[0, assembly.strip.mesh.t].mean(axis=0)
    coarse: dict[str, list[str]] = {}
    for roller in assembly.rollers:
        over = _over(assembly, roller, x)
        if over.any() and (h := assembly.strip.cell_sizes[0, over].max()) > 1.01 * QUARTER * layer:
            coarse.setdefault(f"{h:.3g} m", []).append(roller.name)
    for size, names in coarse.items():
        yield (
            f"elements over {', '.join(names)} are {size} long; a quarter of the boundary layer "
            f"√(D/T) = {layer:.3g} m would be {QUARTER * layer:.3g} m (strip.refined)."
        )


def _over(assembly: Assembly, roller: Roller, x: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Elements, by their middles x in the reference, that come to lie on a roller."""
    if assembly.thread is None:
        return np.abs(x - roller.centre[0]) <= 0.5 * np.pi * roller.radius
    if roller.name not in assembly.thread.arcs:
        return np.zeros(x.shape, dtype=bool)
    if assembly.scene.strip.feed:
        return np.ones(x.shape, dtype=bool)
    first, last = assembly.thread.arcs[roller.name]
    return (first <= x) & (x <= last)


def _friction_warnings(assembly: Assembly) -> Iterator[str]:
    law, tension = assembly.friction, largest_force(assembly.scene)
    if law is None or tension == 0.0:
        return
    speeds = [
        abs(control.surface_speed)
        for stage in assembly.scene.stages
        for control in stage.rollers.values()
        if control.surface_speed
    ]
    stiffness = assembly.material.young * assembly.strip.thickness
    creep = max(speeds, default=0.0) * law.coefficient * tension / stiffness
    if creep and law.speed > 10.0 * creep:
        yield (
            f"friction.speed V_c = {law.speed:g} m/s is far above the elastic creep of a driven "
            f"strip, about {creep:.2g} m/s: rollers will slip visibly "
            f"(V_c = {creep:.1g} is honest)."
        )


def _stress_warnings(assembly: Assembly) -> Iterator[str]:
    limit = assembly.scene.material.yield_stress
    m, t = assembly.material, assembly.strip.thickness
    if limit is None or assembly.scene.contact is None or not assembly.scene.strip.bending:
        return
    for roller in assembly.rollers:
        stress = m.young * t / (2.0 * roller.radius * (1.0 - m.poisson**2))
        if stress > limit:
            yield (
                f"bending over {roller.name} gives {stress / 1e6:.0f} MPa at the surface, "
                f"above the yield stress {limit / 1e6:.0f} MPa; plasticity is not modelled."
            )
