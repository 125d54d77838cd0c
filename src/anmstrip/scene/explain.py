"""What a run of a scene would do, in words and tables; nothing is solved."""

from __future__ import annotations

from collections.abc import Iterator
from io import StringIO

import numpy as np
from rich.console import Console
from rich.table import Table

from anmstrip.mechanics.effects import Effect, LinearEffect, LoadEffect
from anmstrip.scene.build import Assembly
from anmstrip.scene.meshing import QUARTER, boundary_layer, largest_force
from anmstrip.scene.schema import Scene
from anmstrip.scene.stages import Course, Plan
from anmstrip.series.power_series import Tape

MEGABYTE = 2.0**20


def explain(scene: Scene) -> str:
    """Describe effects, what is left out, rollers, stages, scales and warnings.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    str

    Raises
    ------
    InputError
        Mistakes that only the mesh shows.
    """
    assembly = Assembly(scene)
    plans = list(_plans(assembly))
    stream = StringIO()
    console = Console(file=stream, width=100, no_color=True, highlight=False)
    console.print(scene.title or scene.name, markup=False)
    console.print(_strip_line(assembly), markup=False)
    console.print(_effect_table(assembly, plans))
    for line in _left_out(assembly, plans):
        console.print(f"Left out: {line}", markup=False)
    if scene.rollers:
        console.print(_roller_table(assembly))
    console.print(_stage_table(plans))
    console.print(_scale_line(assembly), markup=False)
    for line in warnings(assembly):
        console.print(f"Warning: {line}", markup=False)
    return stream.getvalue().rstrip()


def _plans(assembly: Assembly) -> Iterator[Plan]:
    course = Course(assembly)
    for stage in assembly.scene.course:
        yield course.plan(stage, {})
        course.finish(stage)


def _strip_line(assembly: Assembly) -> str:
    strip = assembly.strip
    h = strip.cell_sizes[0]
    return (
        f"Strip {strip.length:g} m × {strip.width:g} m × {strip.thickness:g} m, "
        f"{strip.mesh.t.shape[1]} elements {h.min():.3g} to {h.max():.3g} m long, "
        f"{strip.unknowns} unknowns, kinematics {assembly.scene.strip.kinematics}."
    )


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    return table


def _effect_table(assembly: Assembly, plans: list[Plan]) -> Table:
    table = _table("Effects", "effect", "points", "unknowns", "memory (MB)", "in stages")
    order = assembly.scene.solver.order
    found: dict[str, tuple[Effect, list[Plan]]] = {}
    for plan in plans:
        for effect in plan.model.effects:
            found.setdefault(effect.name, (effect, []))[1].append(plan)
    for name, (effect, acting) in found.items():
        own = str(assembly.strip.unknowns) if name == "membrane" else "0"
        memory = f"{_memory(effect, order, acting[0]):.2f}"
        stages = ", ".join(plan.name for plan in acting)
        table.add_row(name, str(_points(effect)), own, memory, stages)
    return table


def _points(effect: Effect) -> int:
    if isinstance(effect, LinearEffect):
        return effect.points
    return 0 if isinstance(effect, LoadEffect) else effect.operator.points


def _memory(effect: Effect, order: int, plan: Plan) -> float:
    """Megabytes: of the series of a law at all its points, else of the constants."""
    if isinstance(effect, LinearEffect):
        return effect.block.nbytes / MEGABYTE
    if isinstance(effect, LoadEffect):
        return effect.load.nbytes / MEGABYTE
    tape = Tape(1)
    x = tape.variable(effect.operator.apply(np.zeros(plan.model.strip.unknowns)))
    effect.law(x, x, plan.controls.at(0.0))
    return tape.nbytes / MEGABYTE * (order + 1) / 2


def _left_out(assembly: Assembly, plans: list[Plan]) -> Iterator[str]:
    scene = assembly.scene
    active = {effect.name for plan in plans for effect in plan.model.effects}
    if scene.contact is None:
        yield "contact (no table [contact]): the rollers are only drawn."
    if scene.friction is None:
        yield "friction (no table [friction]): nothing depends on velocity."
    elif not any(plan.in_time for plan in plans):
        yield "friction (switched off in every stage): nothing depends on velocity."
    if "weight" not in active:
        yield "weight (no stage has gravity)."
    yield "inertia, plasticity, heat: not modelled."


def _roller_table(assembly: Assembly) -> Table:
    table = _table("Rollers", "roller", "radius (m)", "centre (m)", "axis", "gap to the flat strip")
    for roller in assembly.rollers:
        away = assembly.strip.nodes - np.asarray(roller.centre)[:, None]
        gap = roller.seen(roller.frame[: roller.rows] @ away).gap
        centre = ", ".join(f"{c:g}" for c in roller.centre)
        axis = ", ".join(f"{c:.3g}" for c in roller.unit_axis)
        table.add_row(roller.name, f"{roller.radius:g}", centre, axis, f"{gap.min():.3g} m")
    return table


def _stage_table(plans: list[Plan]) -> Table:
    table = _table("Stages", "stage", "from (s)", "to (s)", "free unknowns", "path", "what moves")
    for plan in plans:
        path = "implicit in time (friction)" if plan.in_time else "rate-free, in the control"
        moving = sorted(plan.controls.slope)
        moving += ["held edges"] if np.any(plan.supports.slope) else []
        table.add_row(
            plan.name,
            f"{plan.start:g}",
            f"{plan.start + plan.duration:g}",
            str(len(plan.supports.free)),
            path,
            ", ".join(moving) or "nothing",
        )
    return table


def _scale_line(assembly: Assembly) -> str:
    s, solver = assembly.scales, assembly.scene.solver
    return (
        f"Errors are relative to {s.length:g} m (positions), {s.force:g} N (imbalance) and "
        f"{s.tension:g} N/m (membrane forces); "
        f"tolerance {solver.tolerance:g}, order {solver.order}."
    )


def warnings(assembly: Assembly) -> list[str]:
    """What a user should know before running."""
    return [*_mesh_warnings(assembly), *_friction_warnings(assembly), *_stress_warnings(assembly)]


def _mesh_warnings(assembly: Assembly) -> Iterator[str]:
    layer = boundary_layer(assembly.scene)
    if assembly.scene.contact is None or not np.isfinite(layer):
        return
    x = assembly.strip.mesh.p[0, assembly.strip.mesh.t].mean(axis=0)
    for roller in assembly.rollers:
        over = np.abs(x - roller.centre[0]) <= 0.5 * np.pi * roller.radius
        if over.any() and (h := assembly.strip.cell_sizes[0, over].max()) > 1.01 * QUARTER * layer:
            yield (
                f"elements over {roller.name} are {h:.3g} m long; a quarter of the boundary layer "
                f"√(D/T) = {layer:.3g} m would be {QUARTER * layer:.3g} m (strip.refined)."
            )


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
    if limit is None or assembly.scene.contact is None:
        return
    for roller in assembly.rollers:
        stress = m.young * t / (2.0 * roller.radius * (1.0 - m.poisson**2))
        if stress > limit:
            yield (
                f"bending over {roller.name} gives {stress / 1e6:.0f} MPa at the surface, "
                f"above the yield stress {limit / 1e6:.0f} MPa; plasticity is not modelled."
            )
