"""What a user should know before a scene runs: doubts about its mesh, its forces, its friction.

A doubt that concerns the solution's existence, or whether the mesh can follow it, is serious: a
run that stops is told of it first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.roller import Roller
from anmstrip.scene.build import Assembly
from anmstrip.scene.ladder import walked
from anmstrip.scene.meshing import QUARTER, boundary_layer, largest_force
from anmstrip.scene.stages import Plan
from anmstrip.scene.taut import Way

BENT = 0.5
"""Turn (rad) within one element over a roller that it cannot follow."""

SUNK = 0.1
"""Share of a roller's radius that a strip may sink into it, pressed by its tension."""

FAINT = 1e-2
"""Share of the largest force below which an end that was pulled is slack."""


def warnings(assembly: Assembly, plans: Sequence[Plan] = (), ways: Sequence[Way] = ()) -> list[str]:
    """All of them; plans and ways as from :func:`anmstrip.scene.ladder.walked`."""
    told = [*serious(assembly, plans, ways), *_mesh_warnings(assembly)]
    return [*told, *_friction_warnings(assembly), *_stress_warnings(assembly)]


def serious(assembly: Assembly, plans: Sequence[Plan] = (), ways: Sequence[Way] = ()) -> list[str]:
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


def _pulled_slack(assembly: Assembly, plans: Sequence[Plan]) -> Iterator[str]:
    """A first stage that pulls the slack strip while it may rub, in time from no stiffness on."""
    first = plans[0]
    ends = [first.controls.at(share).get("exit.force", np.zeros(3)) for share in (0.0, 1.0)]
    if assembly.thread is None and first.in_time and not np.any(ends[0]) and np.any(ends[1]):
        yield (
            f"stage {first.name} pulls a slack strip, which has no stiffness across, while it may "
            f"rub. Try --set stages.{first.name}.friction=false, to pull it before."
        )


def _not_held(assembly: Assembly, plans: Sequence[Plan]) -> Iterator[str]:
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


def _slack(assembly: Assembly, plans: Sequence[Plan]) -> Iterator[str]:
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


def _heavy(assembly: Assembly, plans: Sequence[Plan]) -> Iterator[str]:
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
