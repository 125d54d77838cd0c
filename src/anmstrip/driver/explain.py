"""What a run of a scene would do, in words and tables; nothing is solved."""

from __future__ import annotations

from collections.abc import Iterator
from io import StringIO

import numpy as np
from rich.console import Console
from rich.table import Table

from anmstrip.driver.string_estimate import Way
from anmstrip.driver.warnings import Rung, justified, ladder, walked, warnings
from anmstrip.equilibrium import StageProblem
from anmstrip.mechanics.effects import Effect, LawEffect, LinearEffect, LoadEffect
from anmstrip.mechanics.roller import Roller
from anmstrip.scene.schema import SceneSpec
from anmstrip.simulation.problem import Assembly, flat_gap
from anmstrip.taylor.series import record

MEGABYTE = 2.0**20

REASONS = {
    "shell": "The cheaper levels would miss what is said above",
    "section": "Nothing is said to vary across the width, and any rotation is allowed",
    "plate": "Slopes stay small and nothing moves along the strip",
}
"""Why a level is enough."""


def explain(scene: SceneSpec) -> str:
    """Describe effects, what is left out, rollers, stages, scales and warnings.

    Parameters
    ----------
    scene : SceneSpec

    Returns
    -------
    str

    Raises
    ------
    InputError
        Mistakes that only the mesh shows.
    """
    assembly = Assembly(scene)
    plans, ways = (list(found) for found in zip(*walked(assembly), strict=True))
    rungs = ladder(assembly, ways)
    stream = StringIO()
    console = Console(file=stream, width=100, no_color=True, highlight=False)
    console.print(scene.title or scene.name, markup=False)
    console.print(_strip_line(assembly), markup=False)
    console.print(_effect_table(assembly, plans))
    if (bent := scene.strip.imperfection) is not None:
        words = f"by mode {bent.mode} of buckling at the end of stage {scene.course[0].name}"
        console.print(f"Bent without stress by {bent.amplitude:g} m, {words}.", markup=False)
    for line in _left_out(assembly, plans):
        console.print(f"Left out: {line}", markup=False)
    if scene.rollers:
        console.print(_roller_table(assembly, ways))
    console.print(_stage_table(plans))
    console.print(_ladder_table(rungs, assembly.kinematics.name))
    for line in _verdict(rungs, assembly.kinematics.name):
        console.print(line, markup=False)
    if scene.contact is not None and scene.rollers:
        console.print(_contact_line(assembly), markup=False)
    console.print(_scale_line(assembly), markup=False)
    for line in [*_blind(rungs, assembly.kinematics.name), *warnings(assembly, plans, ways)]:
        console.print(f"Warning: {line}", markup=False)
    return stream.getvalue().rstrip()


def _strip_line(assembly: Assembly) -> str:
    strip = assembly.strip
    h = strip.cell_sizes[0]
    fed = ", fed: fresh strip follows what has left" if assembly.scene.strip.feed else ""
    return (
        f"Strip {strip.length:g} m × {strip.width:g} m × {strip.thickness:g} m, "
        f"{strip.mesh.t.shape[1]} elements {h.min():.3g} to {h.max():.3g} m long, "
        f"{strip.unknowns} unknowns, kinematics {assembly.scene.strip.kinematics}{fed}."
    )


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    return table


def _effect_table(assembly: Assembly, plans: list[StageProblem]) -> Table:
    table = _table("Effects", "effect", "points", "unknowns", "memory (MB)", "in stages")
    order = assembly.order
    found: dict[str, tuple[Effect, list[StageProblem]]] = {}
    for plan in plans:
        for effect in plan.model.effects:
            found.setdefault(effect.name, (effect, []))[1].append(plan)
    for i, (name, (effect, acting)) in enumerate(found.items()):
        own = str(assembly.strip.unknowns) if i == 0 else "0"
        memory = f"{_memory(effect, order, acting[0]):.2f}"
        stages = ", ".join(plan.name for plan in acting)
        table.add_row(name, str(effect.points), own, memory, stages)
    return table


def _memory(effect: Effect, order: int, plan: StageProblem) -> float:
    """Megabytes: of the series of a law at all its points, else of the constants."""
    if isinstance(effect, LinearEffect):
        return effect.block.nbytes / MEGABYTE
    if isinstance(effect, LoadEffect):
        return effect.load.nbytes / MEGABYTE
    assert isinstance(effect, LawEffect)
    operator, controls = effect.operator, plan.controls.at(0.0)
    x, law = operator.apply(np.zeros(plan.model.strip.unknowns)), effect.law
    program = record(lambda x: law(x, x, controls), x, points=operator.points)
    return program.nbytes(order) / MEGABYTE


def _left_out(assembly: Assembly, plans: list[StageProblem]) -> Iterator[str]:
    scene = assembly.scene
    active = {effect.name for plan in plans for effect in plan.model.effects}
    if assembly.membrane is None:
        yield "membrane (a plate has the tension that exit.force gives it)."
    if not scene.strip.bending:
        yield "bending (strip.bending = false): no boundary layer, any curvature is free."
    if scene.contact is None:
        yield "contact (no table [contact]): the rollers are only drawn."
    if scene.friction is None:
        yield "friction (no table [friction]): nothing depends on velocity."
    elif not any(plan.in_time for plan in plans):
        yield "friction (switched off in every stage): nothing depends on velocity."
    if "weight" not in active:
        yield "weight (no stage has gravity)."
    if "pressure" not in active:
        yield "pressure (no stage has it)."
    if not any(name.startswith("tension on") for name in active):
        yield "tension that follows the strip (no stage has entry.tension or exit.tension)."
    if not any(name.startswith("moment on") for name in active):
        yield "moments on edges (no stage has entry.moment or exit.moment)."
    yield "inertia, plasticity, heat: not modelled."


def _roller_table(assembly: Assembly, ways: list[Way]) -> Table:
    last = "wrap (°), side" if assembly.thread else "gap to the flat strip, wrap (°), side"
    table = _table("Rollers", "roller", "radius (m)", "centre (m)", "axis", last)
    for roller in assembly.rollers:
        centre = ", ".join(f"{c:g}" for c in roller.centre)
        axis = ", ".join(f"{c:.3g}" for c in roller.unit_axis)
        table.add_row(
            roller.name, _radius(assembly, roller), centre, axis, _wrapping(assembly, roller, ways)
        )
    return table


def _radius(assembly: Assembly, roller: Roller) -> str:
    """The radius; below the strip's sides too where it is another there."""
    if roller.is_cylinder:
        return f"{roller.radius:g}"
    left, right = (assembly.strip.nodes[1].min(), assembly.strip.nodes[1].max())
    low, high = (roller.radius_at(y - roller.centre[1]) for y in (left, right))
    return f"{roller.radius:g}; {low:g} at y = {left:g} m, {high:g} at y = {right:g} m"


def _wrapping(assembly: Assembly, roller: Roller, ways: list[Way]) -> str:
    """How far a roller is wrapped and on which side, and how far away it is at first."""
    turn = max((w.turns.get(roller.name, 0.0) for w in ways), default=0.0)
    if assembly.thread is not None and roller.name in assembly.thread.turns:
        turn = assembly.thread.turns[roller.name]
    sides = [w.senses[roller.name] for w in ways if roller.name in w.senses]
    wrap = f"{np.degrees(turn):.4g}°, {sides[0]}" if sides else "not touched"
    if assembly.thread is not None:
        return wrap
    return f"{flat_gap(assembly.strip, roller):.3g} m, {wrap}"


def _stage_table(plans: list[StageProblem]) -> Table:
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


def _ladder_table(rungs: list[Rung], own: str) -> Table:
    columns = ("unknowns", "points", "cost of an expansion (estimate)", "sees this scene")
    table = _table("Kinematics", "level", *columns)
    for rung in rungs:
        counts = ["–" if n is None else str(n) for n in (rung.unknowns, rung.points)]
        cost = "–" if rung.cost is None else f"× {rung.cost:.2g}"
        name = f"{rung.level.name}, chosen" if rung.level.name == own else rung.level.name
        table.add_row(name, *counts, cost, "no" if rung.against else "yes")
    return table


def _verdict(rungs: list[Rung], own: str) -> Iterator[str]:
    """Why not the others, and what the numbers justify."""
    for rung in rungs:
        if rung.against:
            yield f"Not {rung.level.name}: {'; '.join(rung.against)}."
    best = justified(rungs)
    chosen = ", as chosen" if best.level.name == own else ""
    name = best.level.name
    yield f"These numbers justify: {name}{chosen}. {REASONS[name]}; {best.lost}."


def _blind(rungs: list[Rung], own: str) -> Iterator[str]:
    """What the scene has and its own level does not see."""
    for rung in rungs:
        if rung.level.name == own and rung.against:
            yield f"kinematics {own} does not see that {'; '.join(rung.against)}."


def _contact_line(assembly: Assembly) -> str:
    law, spec = assembly.signorini, assembly.scene.contact
    assert spec is not None
    own = "" if spec.constants or spec.onset else ", as the mesh resolves"
    return f"Contact: {law.words}, setting in over {law.width:.3g} m{own}."


def _scale_line(assembly: Assembly) -> str:
    s, solver = assembly.scales, assembly.scene.solver
    chosen = ", the cheapest" if solver.order is None else ""
    return (
        f"Errors are relative to {s.length:g} m (positions), {s.force:g} N (imbalance) and "
        f"{s.tension:g} N/m (membrane forces); "
        f"tolerance {solver.tolerance:g}, order {assembly.order}{chosen}."
    )
