"""A run in words and tables: before it is made, when nothing is solved, and at its end."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Iterable, Iterator, Sequence
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from anmstrip.advice import warnings
from anmstrip.advice.preview import Preview
from anmstrip.advice.units import MIN_FLATNESS
from anmstrip.equilibrium import StageProblem
from anmstrip.errors import InputError, Mistake, printable, require_parent
from anmstrip.mechanics.effects import Effect, LawEffect, LinearEffect, LoadEffect
from anmstrip.results.files import error_rows
from anmstrip.scene.checks import held_along, moved_ends
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.scene.tables import EDGE_NAMES, ENDS, FieldSpec
from anmstrip.simulation import defaults
from anmstrip.simulation.problem import Assembly, flat_gap, naturals
from anmstrip.taylor.series import record

if TYPE_CHECKING:
    from anmstrip.driver.run import Run
    from anmstrip.results.rollers import RollerReading
    from anmstrip.results.state import State

MEGABYTE = 2.0**20

INTERNAL_CONTROLS = {
    *("strip.held", "strip.growth", "strip.softening", "strip.weakening"),
    *(f"{end}.{kind}" for end in ENDS for kind in ("unevenness", "slack")),
    *(f"{edge}.uneven_force" for edge in EDGE_NAMES),
    "yielding",
}
"""Controls that follow from others, and are typed by nobody."""

SPEED_WORDS = ("speed", "passing")
"""Last words of controls that are speeds: what has one moves though the speed stays."""

DISPLAYED_ZERO = 1e-12
"""Number of a table below which it is round-off, whatever its unit."""

LONG_ESTIMATE = 3.0
"""Time (s) from which on that of an estimate of errors is told."""

POINTS_PER_PIECE = 400
"""Of each run and each wrap of a drawn strip."""


def explain(scene: SceneSpec) -> str:
    """Describe effects, what is left out, rollers, stages, levels, scales and warnings.

    Raises
    ------
    InputError
        Mistakes that only the mesh shows.
    """
    return text_of(explanation(scene))


def text_of(parts: Iterable[str | Table], width: int = 100) -> str:
    """Return sentences and tables as text, so many characters wide.

    Tables of numbers, with units in their heads, have one space between columns instead of two
    where numbers would be folded.
    """
    stream = StringIO()
    console = Console(file=stream, width=width, no_color=True, highlight=False)
    free = console.options.update(max_width=1000)
    for part in parts:
        wide = console.measure(part, options=free).maximum > width
        if wide and isinstance(part, Table) and any("\n" in str(c.header) for c in part.columns):
            part.padding = (0, 1, 0, 0)
        console.print(part, markup=False)
    return stream.getvalue().rstrip()


def explanation(scene: SceneSpec) -> Iterator[str | Table]:
    """Yield sentences and tables of what a run would do."""
    assembly = Assembly(scene)
    preview = Preview.of(assembly)
    found, own = warnings.levels(preview), assembly.kinematics.name
    yield printable(scene.title or scene.name)
    yield size_words(assembly)
    if defaults.loose_across(scene):
        yield "Nothing else holds the strip in y: the middle of the entry is (edges.entry.centred)."
    elif defaults.free_across(scene):
        width = scene.strip.width
        guides = [roller.name for roller in scene.rollers if defaults.guides_strip(roller, width)]
        shape = f" and the shape of {', '.join(map(str, guides))} alone keep" if guides else ""
        yield f"No edge is held in y: friction{shape or ' alone keeps'} the strip on its rollers."
    if assembly.growth is not None:
        yield (
            "The mesh follows rollers that move, and stays on them where loads or heat lengthen "
            "the strip: the runs between them take strip up, or give it off."
        )
        yield from gathered_lines(assembly)
    yield effect_table(preview)
    if (bent := scene.strip.imperfection) is not None:
        words = f"by mode {bent.mode} of buckling at the end of stage {scene.course[0].name}"
        yield f"Bent without stress by {bent.amplitude:g} m, {words}."
    yield from (f"Unstressed: {line}." for line in shape_lines(preview))
    yield from (f"Left out: {line}" for line in left_out(preview))
    if scene.rollers:
        yield geometry_table(preview)
    yield stage_table(preview)
    yield level_table(found, own)
    against = {level.kinematics.name: "; ".join(level.against) for level in found if level.against}
    yield from (f"Not {name}: {reasons}." for name, reasons in against.items())
    best = warnings.justified_level(found)
    chosen = ", as chosen" if best.kinematics.name == own else ""
    yield f"These numbers justify: {best.kinematics.name}{chosen}. {best.lost}."
    if scene.contact is not None and scene.rollers:
        law, given = assembly.signorini, scene.contact.constants or scene.contact.onset
        resolved = "" if given else ", as the mesh resolves"
        faces = ", on the faces of the strip" if assembly.faces else ""
        yield f"Contact{faces}: {law.words}, setting in over {law.width:.3g} m{resolved}."
    yield from rate_lines(scene, assembly)
    scales = assembly.scales
    yield (
        f"Errors are relative to {scales.length:g} m (positions), {scales.force:g} N (imbalance) "
        f"and {scales.membrane:g} N/m (membrane forces); tolerance {scene.solver.tolerance:g}, "
        f"order {assembly.order}{', the cheapest' if scene.solver.order is None else ''}."
    )
    if assembly.can_halve and (seconds := assembly.estimate_seconds) > LONG_ESTIMATE:
        told = (
            f"on elements of half the length, takes about {warnings.time_words(seconds)} each time"
        )
        yield f"To estimate the errors by the mesh, {told}."
    if lighter := lighter_stages(assembly):
        yield f"Before larger forces act, relative to {lighter}."
    yield from unusual(scene)
    yield from (f"Warning: {line}" for line in warnings.warnings(preview))


def gathered_lines(assembly: Assembly) -> Iterator[str]:
    """Yield what nips have pushed into each run by the end of stages."""
    assert assembly.thread is not None
    stages = [(s.name, assembly.gathered_in(s)[0]) for s in assembly.scene.stages]
    for run, (first, last) in enumerate(pairwise(assembly.thread.rollers), 1):
        if any(held[run] for _, held in stages):
            told = ", ".join(f"{held[run]:.3g} m by the end of {name}" for name, held in stages)
            yield f"Between the nips {first.name} and {last.name} strip gathers: {told}."


def size_words(assembly: Assembly) -> str:
    """Return the sizes of the strip and its mesh, where it is flat, and whether it is fed."""
    scene, strip, ends = assembly.scene, assembly.strip, ""
    h, led = strip.cell_sizes[0], scene.threading is not None and not scene.strip.feed
    if led and any(moved_ends(scene.threading, scene.edges, scene.stages)):
        ends = ", of finite length: its ends move, and no fresh strip follows"
    if scene.threading is None and not assembly.closed:
        begin, end = strip.span + assembly.origin[0]
        ends = f", flat from x = {begin:g} m (entry) to {end:g} m (exit)"
    if scene.strip.feed:
        ends += ", fed: fresh strip follows what has left"
    return (
        f"Strip {strip.length:g} m × {strip.width:g} m × {strip.thickness:g} m, "
        f"{strip.mesh.t.shape[1]} elements {h.min():.3g} to {h.max():.3g} m long, "
        f"{strip.unknowns} unknowns, kinematics {scene.strip.kinematics}{ends}."
    )


def lighter_stages(assembly: Assembly) -> str:
    """Return the units of membrane forces (N/m) of stages before the largest forces of a scene."""
    units = [(s.name, assembly.scales_in(s).membrane) for s in assembly.scene.course]
    return ", ".join(f"{u:g} N/m in stage {name}" for name, u in units if 2.0 * u < units[-1][1])


def rate_lines(scene: SceneSpec, assembly: Assembly) -> Iterator[str]:
    """Yield the rates that the laws of flow and friction refer to, and where they come from."""
    if (p := scene.material.plasticity) is not None:
        rate, why = p.reference_rate or assembly.usual_rate, "" if p.reference_rate else ", a guess"
        wide = scene.strip.kinematics == "section" and not p.uniaxial
        held = " times 2/√3, since a section does not contract across," * wide
        yield f"Flow: at the yield stress{held} at a strain rate of {rate:.3g} 1/s{why}."
    if scene.friction is not None and assembly.friction is not None:
        speed = assembly.friction.speed
        why = "" if scene.friction.speed else f", {origin_of_slip_speed(scene, speed)}"
        why += words_at_rest(assembly)
        yield f"Friction: {scene.friction.law}, V_c = {speed:.3g} m/s{why}."


def origin_of_slip_speed(scene: SceneSpec, speed: float) -> str:
    """Return where the V_c (m/s) of a scene that does not give it comes from."""
    creep = defaults.elastic_creep(scene)
    if speed > 1.01 * defaults.CREEP_SHARE * creep:
        slip = defaults.slip_of_held_strip(scene)
        return f"a thousandth of the {slip:.2g} m/s at which the held strip comes to slip"
    under = "" if any(defaults.given_tensions(scene)) else " under a usual strain"
    return f"a tenth of the elastic creep of {creep:.2g} m/s{under}"


def words_at_rest(assembly: Assembly) -> str:
    """Return V_c of the stages in which the line stands, where it is another."""
    words = ""
    for stage in assembly.scene.stages:
        law, usual = assembly.law_of_slip(stage), assembly.friction
        if law is not None and usual is not None and law.speed != usual.speed:
            words += f"; {law.speed:.3g} m/s in {stage.name}, where the line stands"
    return words


def unusual(scene: SceneSpec) -> Iterator[str]:
    """Yield what is done otherwise than in most runs."""
    if scene.strip.refined == "auto":
        share = scene.solver.mesh_share
        yield (
            "The run is repeated on elements of half the length until the mesh makes tensions "
            f"wrong by less than {share:g} of the largest."
        )
    for key in ("young", "yield_stress"):
        if pairs := getattr(scene.material, f"{key}_at"):
            at, share = pairs[-1]
            yield f"material.{key} depends on the temperature: {share:g} of it is left at {at:g} K."
    if scene.solver.method == "newton":
        yield "Paths are followed by Newton's method in load steps, to compare with series."


def plain_table(title: str, *columns: str) -> Table:
    """Return an empty table, its first column to the left and the others to the right."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right", overflow="fold")
    return table


def effect_table(preview: Preview) -> Table:
    """Return the effects with their points, unknowns, memory and stages."""
    table = plain_table("Effects", "effect", "points", "unknowns", "memory (MB)", "in stages")
    found: dict[str, tuple[Effect, list[StageProblem]]] = {}
    for plan in preview.plans:
        for effect in plan.model.effects:
            found.setdefault(effect.name, (effect, []))[1].append(plan)
    for i, (name, (effect, acting)) in enumerate(found.items()):
        own = str(preview.assembly.strip.unknowns) if i == 0 else "0"
        if name == "plasticity":
            own = str(preview.assembly.unknowns - preview.assembly.coupled)
        used = memory(effect, preview.assembly.order, acting[0]) / MEGABYTE
        stages = ", ".join(plan.name for plan in acting)
        table.add_row(name, str(effect.points), own, f"{used:.2f}", stages)
    return table


def memory(effect: Effect, order: int, plan: StageProblem) -> float:
    """Return the bytes of the series of a law at all its points, else of its constants."""
    if isinstance(effect, LinearEffect):
        return effect.block.nbytes
    if isinstance(effect, LoadEffect):
        return effect.load.nbytes
    assert isinstance(effect, LawEffect)
    operator, controls = effect.operator, plan.controls.at(0.0)
    x, law = operator.apply(np.zeros(plan.model.unknowns)), effect.law
    return record(lambda x: law(x, x, controls), x, points=operator.points).nbytes(order)


def shape_lines(preview: Preview) -> Iterator[str]:
    """Yield what the strip would be like unstressed, from the beginning and by stages.

    With the mean across, at the rollers in their order, of what varies along.
    """
    scene, units = preview.assembly.scene, {"temperature": "K", "flatness": "I-units"}
    thread = preview.assembly.thread
    shapes = [("", scene.strip), *((f" in stage {s.name}", s.strip) for s in scene.stages)]
    for when, shape in shapes:
        for key, given in shape.natural.items():
            if not isinstance(given, FieldSpec):
                value = f"{given:g} 1/m"
            else:
                low, high = given.samples.min(), given.samples.max()
                value = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
                value += f" {units[key]}"
                if given.along and thread is not None:
                    places = 0.5 * thread.length + np.mean([*thread.arcs.values()], axis=1)
                    means = zip(thread.arcs, given.means(places), strict=True)
                    at = ", ".join(f"{mean:.3g} at {name}" for name, mean in means)
                    value += f", in the mean across {at}"
            yield f"{key.replace('_', ' ')} {value}{when}"


def left_out(preview: Preview) -> list[str]:
    """Return the effects that do not act, with what in the scene says so."""
    scene, names = preview.assembly.scene, {e.name for p in preview.plans for e in p.model.effects}
    follows, bent = (any(n.startswith(f"{k} on") for n in names) for k in ("tension", "moment"))
    rubs = any(plan.in_time or plan.steady for plan in preview.plans)
    still = scene.friction is not None and not rubs
    bends, uneven = scene.strip.bending, naturals(scene)
    acting = {
        "membrane (a plate has the tension that exit.force gives it).": "membrane" in names,
        "bending (strip.bending = false): no boundary layer, any curvature is free.": bends,
        "contact (no rollers).": scene.contact,
        "friction (no table [friction]): nothing depends on velocity.": scene.friction,
        "friction (switched off in every stage): nothing depends on velocity.": not still,
        "weight (no stage has gravity).": "weight" in names,
        "pressure (no stage has it).": "pressure" in names,
        "tension that turns with the strip (no end has it).": follows,
        "moments on edges (no stage has entry.moment or exit.moment).": bent,
        "plasticity (no table [material.plasticity]): the strip is elastic.": "plasticity" in names,
        "heat, flatness, camber, coil set (no such key in [strip]): flat if unstressed.": uneven,
        "inertia, which is not modelled.": False,
    }
    return [line for line, acts in acting.items() if not acts]


def geometry_table(preview: Preview) -> Table:
    """Return the rollers: radii at the strip's sides, places, senses, distances, wraps and sides.

    Where the strip passes and how the roller turns are seen with x to the right and z upwards.
    """
    strip, thread = preview.assembly.strip, preview.assembly.thread
    turning = clockwise_rollers(preview)
    wraps = {} if thread is None else thread.turns
    last = "wrap (°), side" if thread else "gap to the flat strip, wrap (°), side"
    columns = ("radius (m)", "centre (m)", "axis", "passed", "turns", last)
    table = plain_table("Rollers", "roller", *columns)
    for roller in preview.assembly.rollers:
        radius = f"{roller.radius:g}"
        if not roller.is_cylinder:
            left, right = np.sort(strip.nodes[1])[[0, -1]] + strip.origin[1]
            place = roller.centre[1] + strip.origin[1]
            low, high = (roller.radius_at(y - place) for y in (left, right))
            radius += f"; {low:g} at y = {left:g} m, {high:g} at y = {right:g} m"
        turn = wraps.get(roller.name, preview.turn(roller))
        sides = [s.senses[roller.name] for s in preview.strings if roller.name in s.senses]
        touched = sides and (thread or turn > 0.0 or flat_gap(strip, roller) <= 0.0)
        wrap = f"{np.degrees(turn):.4g}°, {sides[0]}" if touched else "not touched"
        if (press := preview.assembly.specs[roller.name].press) is not None:
            wrap = f"pressed with {press:g} N"
        kind = preview.assembly.specs[roller.name].drive
        drive = f", {kind}" if kind != "speed" else ""
        centre = ", ".join(f"{c:g}" for c in np.add(roller.centre, strip.origin))
        axis = ", ".join(f"{c:.3g}" for c in roller.unit_axis)
        turns = ("" if roller.name in turning else "anti") + "clockwise" + drive
        wrap = wrap if thread is not None else f"{flat_gap(strip, roller):.3g} m, {wrap}"
        table.add_row(roller.name, radius, centre, axis, preview.passes(roller), turns, wrap)
    return table


def first_speeds(preview: Preview) -> tuple[dict[str, float], bool]:
    """Return the first speed (m/s) that each roller is given, and whether strip travels backwards.

    It does if all do that have a wrap and a speed.
    """
    thread = preview.assembly.thread
    ends = [plan.controls.at(1.0) for plan in preview.plans]
    names = [roller.name for roller in preview.assembly.rollers]
    told = {name: [float(end[f"rollers.{name}.surface_speed"]) for end in ends] for name in names}
    given = {name: speed for name, v in told.items() if (speed := next(filter(None, v), 0.0))}
    driving = [given[name] for name in given if thread is not None and name in thread.turns]
    return given, bool(driving) and max(driving) < 0.0


def clockwise_rollers(preview: Preview) -> set[str]:
    """Return which rollers turn clockwise, by name; those without a speed go with the strip."""
    given, backwards = first_speeds(preview)
    senses = {r.name: r.sense * float(r.unit_axis[1]) for r in preview.assembly.rollers}
    travel = -1.0 if backwards else 1.0
    return {name for name, sense in senses.items() if sense * given.get(name, travel) >= 0.0}


def draw_line(scene: SceneSpec, picture: Path) -> None:
    """Draw strip, rollers, wraps and directions from the side.

    A threaded line as it begins, another one as its stages leave it.

    Raises
    ------
    InputError
        A picture of no known kind or in no directory, or mistakes that only the mesh shows.
    """
    from anmstrip.pictures.curves import SUFFIXES, Wheel, draw_layout

    if picture.suffix.lower() not in SUFFIXES:
        expected = f"the name of a file that ends in {', '.join(SUFFIXES)}"
        hint = f"--picture {shlex.quote(str(picture.with_suffix('.png')))}"
        raise InputError([Mistake("--picture", "", str(picture), expected, hint)])
    require_parent("--picture", picture)
    preview = Preview.of(Assembly(scene))
    assembly, thread = preview.assembly, preview.assembly.thread
    path, turns = preview.strings[-1].path, preview.strings[-1].turns
    controls = preview.plans[-1].controls.at(1.0)
    if thread is not None:
        path, turns, controls = thread.middle, thread.turns, preview.plans[0].controls.at(0.0)
    half, origin = 0.5 * assembly.strip.length, assembly.origin[[0, 2]]
    line, wheels, arcs = np.array([[-half, half], [0.0, 0.0]]), [], {}
    turning = clockwise_rollers(preview)
    if path is not None:
        joints = np.arange(len(path.starts))
        places = np.linspace(0.0, joints[-1], POINTS_PER_PIECE * joints[-1] + 1)
        line = path.at(np.interp(places, joints, path.starts[:, 0]), 0)[0]
        ends = zip(path.arcs.start[:, 0], path.arcs.end[:, 0], strict=True)
        for name, (start, end) in zip(turns, ends, strict=True):
            arcs[name] = path.at(np.linspace(start, end, POINTS_PER_PIECE), 0)[0] + origin[:, None]
    for roller, spec in zip(assembly.rollers, scene.rollers, strict=True):
        centre = np.asarray(controls[f"rollers.{roller.name}.centre"])[[0, 2]] + origin
        wrap = f"\n{np.degrees(turns[roller.name]):.4g}°" if roller.name in arcs else ""
        kind = "" if spec.drive == "speed" else f"\n{spec.drive}"
        kind += "" if spec.press is None else f"\n{spec.press:g} N"
        arc = arcs.get(roller.name, np.zeros((2, 0)))
        caption = roller.name + wrap + kind
        wheels.append(Wheel(centre, roller.radius, roller.name in turning, caption, arc))
    _, backwards = first_speeds(preview)
    draw_layout(picture, scene.title or scene.name, line + origin[:, None], wheels, backwards)


def stage_table(preview: Preview) -> Table:
    """Return the stages with their times, free unknowns and paths, and what moves in them.

    Speeds that are what they were before are told to be so.
    """
    columns = ("from (s)", "to (s)", "free unknowns", "path", "what moves")
    table = plain_table("Stages", "stage", *columns)
    typed, strip = dict[str, str](), preview.assembly.strip
    for stage, plan, _ in preview:
        typed |= typed_keys(stage)
        moving = sorted(set(plan.controls.slope) - INTERNAL_CONTROLS)
        for name in preview.assembly.scene.edges:
            unknowns = strip.unknowns_of(strip.edges[name].trace)
            moving += [f"{name}.move"] * bool(np.any(plan.supports.slope[unknowns]))
        shown = dict.fromkeys(typed.get(key, key) for key in moving)
        speeds = {k: v for k, v in plan.controls.at(1.0).items() if k.endswith(SPEED_WORDS)}
        turning = dict.fromkeys(typed.get(key, key) for key, v in speeds.items() if np.any(v))
        shown |= {f"{key}, as before": None for key in turning if key not in shown}
        times = (f"{time:g}" for time in (plan.start, plan.start + plan.duration))
        free, what = str(len(plan.supports.free)), "\n".join(shown) or "nothing"
        table.add_row(plan.name, *times, free, path_of(plan), what)
    return table


def typed_keys(stage: StageSpec) -> dict[str, str]:
    """Return the keys by which a stage gives controls that are not called so themselves.

    A tension of a threaded line is a force in the direction in which it goes on; the speed of strip
    that passes a held end is that of its labels, or of the end itself.
    """
    typed = dict[str, str]()
    for name, edge in stage.edges.items():
        if edge.force is not None or edge.tension is not None:
            typed[f"{name}.force"] = f"{name}.{'tension' if edge.force is None else 'force'}"
        for word in ("move", "velocity", "speed"):
            if getattr(edge, word) is not None:
                typed["strip.passing"] = typed[f"{name}.move"] = f"{name}.{word}"
    for name, roller in stage.rollers.items():
        if roller.surface_speed is not None or roller.angular_speed is not None:
            word = "surface" if roller.angular_speed is None else "angular"
            typed[f"rollers.{name}.surface_speed"] = f"rollers.{name}.{word}_speed"
        typed[f"rollers.{name}.centre"] = f"rollers.{name}.move"
    return typed


def path_of(plan: StageProblem) -> str:
    """Return what kind of path a stage is."""
    if plan.steady:
        return "stationary states, in the control"
    rates = " and ".join(e.name for e in plan.model.effects if e.rate_dependent)
    return f"implicit in time ({rates})" if plan.in_time else "rate-free, in the control"


def level_table(found: Sequence[warnings.Level], own: str) -> Table:
    """Return the levels of kinematics with their unknowns, points and costs."""
    columns = ("unknowns", "points", "cost of an expansion (estimate)", "represents this scene")
    table = plain_table("Kinematics", "level", *columns)
    for level in found:
        name, size = level.kinematics.name, level.size
        counts = ("–", "–") if size is None else (str(size.unknowns), str(size.points))
        cost = "–" if level.cost is None else f"× {level.cost:.2g}"
        chosen = f"{name}, chosen" if name == own else name
        table.add_row(chosen, *counts, cost, "no" if level.against else "yes")
    return table


SLIDING_SHARE = 0.5
"""Share of friction from which on strip that sticks nowhere is said to slide.  With less of it
fibres creep to and fro, as over a crown, and rollers carry the strip all the same."""

TENSION_DIGITS = 0.1
"""Tension over the tolerance times what pulls the strip, below which it is a zero as solved."""

TORQUE_DIGITS = 1e-7
"""Torque over that of the normal force at the radius, below which it is a zero as it is solved."""

RUNAWAY_SLIP = 30.0
"""Slip over the largest given speed that no roller of a line has."""


def report(run: Run, told: Collection[str] = ()) -> str:
    """Describe the last state of a run by roller, its ends, what it may be wrong by, and warn.

    Warnings that were told before are left out.
    """
    parts: list[str | Table] = []
    if (state := run.reported) is not None:
        if state.rollers:
            parts.append(roller_table(state, run.scene.solver.tolerance))
        parts += bend_table(state)
        if (level := run.flow.level) is not None:
            parts.append(f"By its rate, the strip flows at {level:.3f} times its yield stress.")
        ends = (f"{state.tension(name):.6g} N/m at the {name}" for name in ENDS)
        held = state.clamp_moments(run.scene.clamped)
        jaws = (f"{moment:.6g} N at the {name}" for name, moment in held.items())
        moments = f" Moment {' and '.join(jaws)}." if held else ""
        parts.append(f"Tension {' and '.join(ends)}.{moments}")
        if speed := state.strip_speed:
            law = run.assembly.friction
            goes = "creeps" if law is not None and abs(speed) <= law.speed else "runs"
            parts.append(f"The strip {goes} at {speed:.6g} m/s, as unstressed strip.")
        latent, manifest = (run.flatness.get(f"{k}_flatness") for k in ("latent", "manifest"))
        if latent is not None and manifest is not None and latent >= MIN_FLATNESS:
            mean = f"{latent:.3g} I-units latent in the mean along the strip"
            parts.append(f"Flatness: {mean}, {manifest:.3g} in waves where they are highest.")
        touched = warnings.touched_drives(state, run.scene)
        slid = [n for n in touched if (state.rollers[n].capacity_used or 0.0) > SLIDING_SHARE]
        slid = [n for n in slid if warnings.slides(touched[n])]
        if slid:
            turning = any(contact.surface_speed for contact in touched.values())
            every = turning and len(slid) == len(touched) > 1
            where = "all driven rollers that it touches" if every else None
            parts.append(f"The strip slides over {where or ', '.join(slid)}.")
            if turning and len(slid) == len(touched):
                parts += holding_ends(run.scene, state)
        parts += runaway_slips(state)
        if any(part is not None for part in run.errors().values()):
            parts.append(error_table(run))
    fresh = (warning for warning in run.warnings if warning not in told)
    return text_of([*parts, *(f"Warning: {warning}" for warning in fresh)])


def holding_ends(scene: SceneSpec, state: State) -> Iterator[str]:
    """Yield which end holds or leads fed strip, and what lets it run with its rollers."""
    stages = held_along(scene.threading, scene.edges, scene.stages)
    held = {stage.name: ends for stage, ends in stages}.get(state.plan.name, set())
    turning = [
        stage.name
        for stage in scene.stages
        if any(c.surface_speed or c.angular_speed for c in stage.rollers.values())
    ]
    if state.strip_speed is None or not turning or len(held) != 1:
        return
    (end,) = held
    led = [s.name for s in scene.stages if (edge := s.edges.get(end)) and edge.speed]
    if state.strip_speed == 0.0:
        key = f"stages.{turning[0]}.{end}.release"
        yield f"Its {end} holds it. To let it run, try --set {key}=true"
    elif led:
        yield (
            f"Its {end} gives it a speed, which these rollers do not change. To let them carry it, "
            f"try {end}.tension and {end}.release = true instead of {end}.speed in stage {led[0]}"
        )


def runaway_slips(state: State) -> Iterator[str]:
    """Yield slips that are no speeds of a line: friction holds the strip at none."""
    for name, reading in state.rollers.items():
        if slip_runs_away(state, reading):
            yield (
                f"The slip on {name} is no speed of the line, beside {state.plan.fastest:.3g} m/s: "
                "friction does not hold the strip there, whatever the slip."
            )


def slip_runs_away(state: State, reading: RollerReading) -> bool:
    """Return whether slip is many times what rollers and strip are given in the stage."""
    return bool(reading.max_slip > RUNAWAY_SLIP * state.plan.fastest > 0.0)


def roller_table(state: State, tolerance: float) -> Table:
    """Return what every roller does, in units that stand in the heads of the columns.

    A slip that runs away is a dash: it is that of the step at which the run stopped, and no speed.
    """
    heads = ("wrap\n(°)", "T in\n(N/m)", "T out\n(N/m)", "normal\n(N)", "torque\n(N m)")
    more = ("slip\n(m/s)", "slides\n(°)", "friction\nused", "load on\n(N/m)", "load off\n(N/m)")
    sideways = ("offset\n(mm)",) * any(r.offset is not None for r in state.rollers.values())
    table = plain_table(f"Rollers at t = {state.time:.6g} s", "\nroller", *heads, *more, *sideways)
    least = TENSION_DIGITS * tolerance * state.plan.model.scales.tension
    for name, r in state.rollers.items():
        used = "–" if r.capacity_used is None else f"{round(100.0 * r.capacity_used, 3):.3g} %"
        turns = TORQUE_DIGITS * r.normal_force * state.contacts[name].roller.radius
        tensions = (above(t, least) for t in (r.tension_in, r.tension_out))
        values = (np.degrees(r.wrap), *tensions, r.normal_force, above(r.torque, turns))
        read = None if slip_runs_away(state, r) else r.max_slip, r.line_load_in, r.line_load_out
        slip, *loads = (cell(value, ".3g") for value in read)
        arc = cell(None if r.slip_arc is None else np.degrees(r.slip_arc), ".3g")
        offset = () if r.offset is None else (f"{round(1e3 * r.offset, 3) + 0.0:.3f}",)
        table.add_row(name, *map(cell, values), slip, arc, used, *loads, *offset)
    return table


def above(value: float | None, least: float) -> float | None:
    """Return a value, or 0 where it is smaller than what can be told from it."""
    return 0.0 if value is not None and abs(value) <= least else value


def bend_table(state: State) -> list[str | Table]:
    """Return the sharpest bend at every roller of strip that can yield, and what it leaves.

    Of strip that no roller touches its largest curl.  What a steady line delivers is a sentence.
    """
    from anmstrip.results.plastic import YieldedStrip

    title = "Bends, and the curl and crossbow of unloaded strip behind the roller"
    heads = ("curvature\n(1/m)", "moment\n(N)", "plastic\nshare", "curl\n(1/m)", "crossbow\n(1/m)")
    table = plain_table(title, "\nroller", *heads, "elongation\n(1)", "power\n(W)")
    layers, parts = YieldedStrip.of(state), list[str | Table]()
    if layers is None:
        return []
    bends = layers.rollers()
    if not bends:
        left, place = layers.largest_curl
        if abs(left) > DISPLAYED_ZERO:
            where = f"{cell(left)} 1/m, {cell(place)} m from the entry"
            parts.append(f"The largest curl that is left in the strip, unloaded: {where}.")
        return parts
    for name, b in bends.items():
        values = b.curl, b.crossbow, b.elongation, b.yield_power
        share, told = f"{100.0 * b.plastic_share:.3g} %", [cell(value) for value in values]
        table.add_row(name, cell(b.curvature), cell(b.moment), share, *told)
    if state.plan.steady:
        last = [*bends.values()][-1]
        across = "" if last.crossbow is None else f" and a crossbow of {cell(last.crossbow)} 1/m"
        parts.append(f"Delivered, unloaded: a curl of {cell(last.curl)} 1/m{across}.")
    return [table, *parts]


def cell(value: float | None, form: str = ".4g") -> str:
    """Return a number of a table, without an exponent up to seven digits; a dash for none.

    What is less than round-off of the numbers it follows from is 0.

    Examples
    --------
    >>> cell(14753.2), cell(0.0123456), cell(3.2e9), cell(3e-17), cell(None)
    ('14753', '0.01235', '3.2e+09', '0', '–')
    """
    if value is None:
        return "–"
    value = value if abs(value) > DISPLAYED_ZERO else 0.0
    return format(value, ".0f" if 1e3 <= abs(value) < 1e7 else form)


def error_table(run: Run) -> Table:
    """Return the estimated errors of the last state, by what makes them."""
    heads, rows = error_rows(run.errors())
    heads = ["\n".join(head.rpartition(" ")[::2]) for head in heads]  # units below
    table = plain_table("Estimated errors, the largest of each kind", *heads)
    for row in rows:
        table.add_row(*row)
    return table
