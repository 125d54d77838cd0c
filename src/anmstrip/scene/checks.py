"""Checks between the tables of a scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from inspect import signature
from math import hypot
from typing import Any, NamedTuple

import numpy as np

from anmstrip.arrays import Array
from anmstrip.errors import Mistake, nearest
from anmstrip.scene.tables import (
    EDGE_NAMES,
    ENDS,
    I_UNIT,
    STAGE_KEYS,
    THREADING,
    ContactSpec,
    EdgeControl,
    EdgeSpec,
    FieldSpec,
    FrictionSpec,
    MaterialSpec,
    OutputSpec,
    RollerSpec,
    StageSpec,
    StripSpec,
    ThreadingSpec,
    missing,
)

Mistakes = Iterator[Mistake]
Rollers = tuple[RollerSpec, ...]
Stages = tuple[StageSpec, ...]
Edges = Mapping[str, EdgeSpec]
Friction = FrictionSpec | None
Contact = ContactSpec | None
Threading = ThreadingSpec | None

DISPLACEMENTS = {"shell": "xyz", "section": "xz", "plate": "z"}
"""Displacements that a level has; holding another one is harmless, moving or loading it is not."""

WHY_NOT = {"section": 'a "section" has no width', "plate": 'a "plate" only moves up and down'}

NEXT_KINEMATICS = {"section": 'kinematics = "shell"', "plate": 'kinematics = "section"'}
"""The next level, which has more displacements."""

DRIVES = {"surface_speed": "speed", "angular_speed": "speed", "torque": "torque"}
"""Drive of a roller by the control of it that a stage gives."""

PARALLEL_COSINE = 0.99
"""Least cosine of the angle between axes that count as parallel."""

MIN_AXIS_ACROSS = 0.9
"""Least component along y of the unit axis of a roller that the strip is threaded around."""

MAX_THREADED_STRAIN = 0.05
"""Largest strain of a threaded strip: metals yield long before."""

MIN_MODULUS = 1e6
"""Least Young's modulus of a strip (Pa), that of soft rubber."""

ROUND_OFF = 1e-12
"""Relative error of a sum of durations or lengths, at most."""

MILLIMETRE_RATIO = 10.0
"""Radius over the distance to the next axis from which on it was typed in millimetres.

Those of a line are a hundredth of that or more, and in millimetres a thousand times as large.
"""


def edge_controls(stages: Stages) -> Iterator[tuple[str, str, EdgeControl]]:
    """Yield the key, the edge and the control of every edge in every stage."""
    for stage in stages:
        for name, control in stage.edges.items():
            yield f"stages.{stage.name}.{name}", name, control


def held_in_stages(
    edges: Edges, stages: Stages
) -> Iterator[tuple[str, str, EdgeControl, tuple[str, ...], bool]]:
    """Yield the same with the components that the edge holds then, and whether it was let go."""
    released: set[str] = set()
    for key, name, control in edge_controls(stages):
        if control.release:
            released.add(name)
        fixed = edges[name].fixed if name in edges and name not in released else ()
        yield key, name, control, fixed, name in released


def nonzero(vector: tuple[float, float, float] | None) -> list[str]:
    """Return the names of the components of a vector that are not zero."""
    return [name for name, value in zip("xyz", vector or (), strict=False) if value != 0]


def duplicates(key: str, tables: Rollers | Stages) -> Mistakes:
    """Yield rollers or stages that have the name of another."""
    names = [table.name for table in tables]
    for name, count in Counter(names).items():
        if count > 1:
            free = next(f"{name}_{i}" for i in range(2, 999) if f"{name}_{i}" not in names)
            expected = f"a name of its own; {count} {key} have this one"
            yield Mistake("", f"{key}.{name}.name", name, expected, f'name = "{free}"')


def known_edges(strip: StripSpec, edges: Edges, stages: Stages) -> Mistakes:
    """Yield names of edges that a strip without mesh file does not have."""
    if strip.mesh is not None:  # its own names; checked when it is read
        return
    known = ENDS if strip.kinematics == "section" else EDGE_NAMES
    given = [(f"edges.{name}", name, "the name of an edge", known) for name in edges]
    wanted = "a known key or the name of an edge", (*known, *STAGE_KEYS)
    given += [(key, name, *wanted) for key, name, _ in edge_controls(stages)]
    for key, name, expected, words in given:
        if name in EDGE_NAMES and name not in known:
            sides = 'entry or exit: a "section" has no width, hence no sides'
            yield Mistake("", key, name, sides, 'take it out, or kinematics = "shell"')
        elif name not in known:
            yield Mistake("", key, name, expected, nearest(name, words))


def known_rollers(rollers: Rollers, stages: Stages) -> Mistakes:
    """Yield rollers of stages that the scene does not have, unless one may be a doubled name's."""
    known = [roller.name for roller in rollers]
    for stage in stages if len(set(known)) == len(known) else ():
        for name in stage.rollers:
            if name not in known:
                key = f"stages.{stage.name}.rollers.{name}"
                yield Mistake("", key, name, "the name of a roller", nearest(name, known))


def controls_of_drives(rollers: Rollers, stages: Stages, friction: Friction) -> Mistakes:
    """Yield controls that a roller's drive does not have, and rollers that nothing turns."""
    drive = {roller.name: roller.drive for roller in rollers}
    for name, kind in drive.items():
        if kind != "speed" and friction is None:
            expected = '"speed", since without a table [friction] nothing turns the roller'
            hint = "[friction]\ncoefficient = 0.2"
            yield Mistake("", f"rollers.{name}.drive", kind, expected, hint)
    for stage in stages:
        for name, control in stage.rollers.items():
            for key, needed in DRIVES.items():
                value = getattr(control, key)
                if value is not None and drive.get(name, needed) != needed:
                    place = f"stages.{stage.name}.rollers.{name}.{key}"
                    expected = f'nothing, since the roller has drive = "{drive[name]}"'
                    yield Mistake("", place, value, expected, f'drive = "{needed}", or no {key}')


def flat_plates(strip: StripSpec, friction: Friction, threading: Threading) -> Mistakes:
    """Yield what needs a strip that moves along, or is bent far."""
    if strip.kinematics != "plate":
        return
    why = {
        "stays nearly flat, so it is not threaded": threading,
        "does not move along, so nothing rubs": friction,
    }
    for reason, given in why.items():
        if given is not None:
            expected = f'"shell" or "section": a plate {reason}'
            yield Mistake("", "strip.kinematics", "plate", expected, NEXT_KINEMATICS["plate"])
    if strip.feed:
        yield Mistake("", "strip.feed", True, "false: a plate does not move along", "feed = false")


def rollers_of_a_section(strip: StripSpec, rollers: Rollers) -> Mistakes:
    """Yield rollers that are not the same all across."""
    if strip.kinematics != "section":
        return
    for roller in rollers:
        for key, value in roller.profile.items():
            place = f"rollers.{roller.name}.{key}"
            expected = f'no {key}, since "section" has no width'
            yield Mistake("", place, value, expected, NEXT_KINEMATICS["section"])
        if roller.axis[0] or roller.axis[2]:
            expected = 'an axis along y, since "section" has no width'
            along_y = abs(roller.axis[1]) >= MIN_AXIS_ACROSS * hypot(*roller.axis)
            hint = NEXT_KINEMATICS["section"] if along_y else "axis = [0.0, 1.0, 0.0]"
            yield Mistake("", f"rollers.{roller.name}.axis", roller.axis, expected, hint)


def known_directions(strip: StripSpec, stages: Stages) -> Mistakes:
    """Yield motion, force and gravity along what a level does not have."""
    level = strip.kinematics
    given = []
    for stage in stages:
        for name, control in stage.edges.items():
            for key in ("move", "velocity", "force"):
                place = f"stages.{stage.name}.{name}.{key}"
                given.append((place, f"{name}.{key}", getattr(control, key)))
        given.append((f"stages.{stage.name}.gravity", "gravity", stage.gravity))
        for name, roller in stage.rollers.items() if level == "section" else ():
            short = f"rollers.{name}.move"
            given.append((f"stages.{stage.name}.{short}", short, roller.move))
    for key, short, vector in given:
        # along x the force on a plate's exit is its tension
        seen = "xz" if (level, short) == ("plate", "exit.force") else DISPLACEMENTS[level]
        unseen = [c for c in nonzero(vector) if c not in seen]
        if vector is not None and unseen:
            kept = [v if c in seen else 0.0 for c, v in zip("xyz", vector, strict=True)]
            if unseen == ["y"] and not any(kept):  # upwards in other programs
                kept[2] = vector[1]
            expected = f"0 along {' and '.join(unseen)}: {WHY_NOT[level]}"
            hint = f"{short} = {kept}, or {NEXT_KINEMATICS[level]}"
            yield Mistake("", key, vector, expected, hint)


def tensions_and_moments(strip: StripSpec, stages: Stages) -> Mistakes:
    """Yield tensions that a plate does not look at, and moments where nothing bends or turns far.

    A plate's own tension is that of ``exit.force``.
    """
    plate = strip.kinematics == "plate"
    for key, name, control in edge_controls(stages):
        if plate and control.tension is not None:
            expected = 'nothing: the tension of a "plate" is the x of exit.force (N/m)'
            hint = f"exit.force = [{control.tension:g}, 0.0, 0.0]"
            yield Mistake("", f"{key}.tension", control.tension, expected, hint)
        elif control.tension is not None and name not in ENDS:
            expected = "entry or exit, the ends of the strip"
            yield Mistake("", f"{key}.tension", control.tension, expected, "exit.tension = 1.0e4")
        if control.moment is not None and (plate or not strip.bending):
            expected = 'nothing: a strip without bending has no moments, a "plate" takes none'
            hint = NEXT_KINEMATICS["plate"] if strip.bending else "bending = true"
            yield Mistake("", f"{key}.moment", control.moment, expected, hint)


def held_components(edges: Edges, stages: Stages) -> Mistakes:
    """Yield motion of free components and force on held ones; a release frees them all."""
    conveyed = {f"stages.{stage.name}.entry" for stage in stages if stage.steady}
    for place, name, control, fixed, released in held_in_stages(edges, stages):
        release = f"{name}.release = true in this stage or an earlier one"
        for key in ("move", "velocity"):
            value = getattr(control, key)
            if free := [c for c in nonzero(value) if c not in fixed]:
                expected = f"0 in {', '.join(free)}: not held on this edge, so it cannot be moved"
                wanted = ", ".join(f'"{c}"' for c in "xyz" if c in (*fixed, *free))
                hint = f"[edges.{name}]\nfixed = [{wanted}]"
                hint = f"{name}.force = […], for it was released" if released else hint
                yield Mistake("", f"{place}.{key}", value, expected, hint)
        if both := [c for c in nonzero(control.force) if c in fixed]:
            expected = f"0 in {', '.join(both)}: the component is held; its reaction follows"
            yield Mistake("", f"{place}.force", control.force, expected, f"0.0 there, or {release}")
        if control.tension and {"x", "z"} <= set(fixed) and place not in conveyed:
            expected = "0: x and z are held, which take it; their reaction follows"
            yield Mistake("", f"{place}.tension", control.tension, expected, release)


def clamped_edges(strip: StripSpec, threading: Threading, edges: Edges, stages: Stages) -> Mistakes:
    """Yield clamps on what is not flat or does not bend, and moments on clamped edges."""
    for name, edge in edges.items():
        if edge.clamped and (threading or not strip.bending):
            expected = "no clamp: a strip without bending has no slope to hold"
            if threading:
                expected = "no clamp, which is for flat strip: threaded strip turns at its ends"
            yield Mistake("", f"edges.{name}.clamped", True, expected, "clamped = false")
    for place, name, control, _, released in held_in_stages(edges, stages):
        if control.moment and name in edges and edges[name].clamped and not released:
            expected = "nothing: this edge is clamped; the moment follows (N)"
            hint = f"[edges.{name}]\nclamped = false"
            yield Mistake("", f"{place}.moment", control.moment, expected, hint)


def released_for_good(edges: Edges, stages: Stages) -> Mistakes:
    """Yield edges let go that nothing held, and those to be held again once they were let go."""
    by = dict[str, str]()
    for stage in stages:
        for name, control in stage.edges.items():
            if control.release:
                by.setdefault(name, stage.name)
                if name not in edges or not (edges[name].fixed or edges[name].clamped):
                    expected = "no release: this edge is not held, so there is nothing to let go"
                    hint = f'[edges.{name}]\nfixed = ["x", "z"]'
                    yield Mistake("", f"stages.{stage.name}.{name}.release", True, expected, hint)
            elif name in by and "release" in control.model_fields_set:
                expected = f"nothing: stage {by[name]} lets this edge go for good"
                hint = f"nothing; take it out here, or {name}.release out of stage {by[name]}"
                yield Mistake("", f"stages.{stage.name}.{name}.release", False, expected, hint)


def pulled_once(threading: Threading, edges: Edges, stages: Stages) -> Mistakes:
    """Yield forces on ends of a threaded line that the tension of the same stage replaces.

    Elsewhere they act besides a tension, as they do where the end is held in z.
    """
    for key, _, control, fixed, _ in held_in_stages(edges, stages) if threading else ():
        if "z" not in fixed and None not in (control.force, control.tension):
            expected = "either the force or the tension of this end, which replaces it, not both"
            hint = "one of them; take one out"
            yield Mistake("", f"{key}.tension", control.tension, expected, hint)


def speeds_at_ends(strip: StripSpec, edges: Edges, stages: Stages) -> Mistakes:
    """Yield speeds of what is no held end of the strip, and of a plate, which stays in place."""
    for key, name, control, held, released in held_in_stages(edges, stages):
        if control.speed is None:
            continue
        if strip.kinematics == "plate":
            expected, hint = 'nothing: a "plate" does not move along', NEXT_KINEMATICS["plate"]
        elif name not in ENDS:
            expected = "entry or exit, the ends of the strip"
            hint = f"entry.speed = {control.speed}"
        elif not {"x", "z"} & {*held}:
            expected = "nothing: this end is not held, so that the strip's speed follows"
            hint = f'[edges.{name}]\nfixed = ["x", "z"]'
            if released:
                hint = f"{name}.force = […], for it was released"
        else:
            continue
        yield Mistake("", f"{key}.speed", control.speed, expected, hint)


def tables_of_temperature(strip: StripSpec, material: MaterialSpec, stages: Stages) -> Mistakes:
    """Yield tables over the temperature of strip that has none, or another than they tell of."""
    given = [s.temperature for s in (strip, *(stage.strip for stage in stages)) if s.temperature]
    samples = np.concatenate([[0.0], *(np.ravel(field.samples) for field in given)])
    coldest, warmest = float(samples.min()), float(samples.max())
    for key in ("young_at", "yield_stress_at"):
        if not (pairs := getattr(material, key)):
            continue
        wider = [list(pair) for pair in pairs]
        if not given:
            expected = "no table without a temperature: strip.temperature, or that of a stage"
            yield Mistake("", f"material.{key}", pairs, expected, "strip.temperature = 80.0")
            continue
        if coldest < pairs[0][0]:
            wider.insert(0, [coldest, pairs[0][1]])
        if warmest > pairs[-1][0]:
            wider.append([warmest, pairs[-1][1]])
        if len(wider) > len(pairs):
            expected = f"pairs from the coldest strip to the warmest, {coldest:g} to {warmest:g} K"
            yield Mistake("", f"material.{key}", pairs, expected, f"{key} = {wider}")


def natural_shapes(strip: StripSpec, material: MaterialSpec, stages: Stages) -> Mistakes:
    """Yield eigenstrain and eigencurvature that a strip cannot have, or not as much."""
    shapes = [("strip", strip), *((f"stages.{s.name}.strip", s.strip) for s in stages)]
    value: object
    each = ((place, shape, *item) for place, shape in shapes for item in shape.natural.items())
    for place, shape, key, given in each:
        where, curved, value = f"{place}.{key}", key in ("coil_set", "crossbow"), given
        along: tuple[tuple[float, float], ...] = ()
        if isinstance(given, FieldSpec):
            value, along = given.model_dump(exclude_defaults=True), given.along
        if strip.kinematics == "plate":
            expected = 'nothing: a "plate" stays stressed as exit.force says'
            yield Mistake("", where, value, expected, NEXT_KINEMATICS["plate"])
        elif strip.kinematics == "section" and key in shape.varying_across:
            expected = 'nothing that varies across: a "section" has no width'
            yield Mistake("", where, value, expected, NEXT_KINEMATICS["section"])
        elif curved and not strip.bending:
            expected = "nothing: a strip without bending has no moments"
            yield Mistake("", where, value, expected, "bending = true")
        elif key == "temperature" and material.expansion is None:
            mistake = missing(MaterialSpec, "expansion")
            expected = f"{mistake.expected}, since {where} is given"
            yield replace(mistake, key="material.expansion", expected=expected)
        elif along and strip.feed and key != "temperature":
            expected = "no table along: a fed strip is the same all along, but for its heat"
            yield Mistake("", f"{where}.along", list(along), expected, "feed = false")
        elif along and strip.length is not None and along[-1][0] > strip.length:
            expected = f"distances from the entry up to the strip's length {strip.length:g} (m)"
            hint = f"along = [[0.0, 1.0], [{strip.length:g}, 1.0]]"
            yield Mistake("", f"{where}.along", list(along), expected, hint)
        else:
            yield from moderate_strain(where, key, given, strip, material)


def strain_units(strip: StripSpec, material: MaterialSpec) -> dict[str, float]:
    """Return the largest strain of a strip by one unit of its heat, flatness and camber."""
    camber = 0.5 * (strip.width or 0.0)
    return {"temperature": material.expansion or 0.0, "flatness": I_UNIT, "camber": camber}


def moderate_strain(
    where: str, key: str, given: Any, strip: StripSpec, material: MaterialSpec
) -> Mistakes:
    """Yield an eigenstrain that no metal has, most often in another unit."""
    faces = 0.5 * strip.thickness
    unit = {**strain_units(strip, material), "coil_set": faces, "crossbow": faces}[key]
    largest = float(np.abs(given.samples if isinstance(given, FieldSpec) else given).max())
    if unit * largest > MAX_THREADED_STRAIN:
        name = {"temperature": "K", "flatness": "I-units of 1e-5"}.get(key, "1/m")
        expected = (
            f"at most {MAX_THREADED_STRAIN / unit:.3g} ({name}); {largest:.3g} would be a strain "
            f"of {100.0 * unit * largest:.3g} %"
        )
        hint = f"{key} = {0.01 * MAX_THREADED_STRAIN / unit:.2g}"
        yield Mistake("", where, largest, expected, hint)


def moved_ends(
    threading: Threading, edges: Edges, stages: Stages
) -> Iterator[tuple[str, float | tuple[float, ...]]]:
    """Yield motions, key and value, by which the strip between its ends moves or stretches.

    That is where an end is moved to a place, and where both are held and one has a velocity.  An
    end of a threaded line that a single direction is held of, as the height of its exit, is only
    guided.
    """
    for stage, held in held_along(threading, edges, stages):
        for name, end in stage.edges.items():
            if end.move is not None:
                yield f"stages.{stage.name}.{name}.move", end.move
            for key in ("velocity", "speed"):
                value = getattr(end, key)
                if value is not None and {"entry", "exit"} <= held:
                    yield f"stages.{stage.name}.{name}.{key}", value


def held_along(
    threading: Threading, edges: Edges, stages: Stages
) -> Iterator[tuple[StageSpec, set[str]]]:
    """Yield stages, and which edges are held along the strip during each."""
    along = {"x"} if threading is None else {"x", "z"}
    held = {name for name, edge in edges.items() if along <= {*edge.fixed}}
    for stage in stages:
        held = held - {name for name, end in stage.edges.items() if end.release}
        yield stage, held


def ends_of_a_fed_strip(
    strip: StripSpec, threading: Threading, edges: Edges, stages: Stages
) -> Mistakes:
    """Yield motions of ends of a fed strip that material cannot pass."""
    for key, value in moved_ends(threading, edges, stages) if strip.feed else ():
        expected = "nothing beside strip.feed: a fed strip passes ends that stay, one of them free"
        hint = "feed = false, or release = true at the other end"
        yield Mistake("", key, value, expected, hint)


def gravity_has_density(material: MaterialSpec, stages: Stages) -> Mistakes:
    """Yield a density that gravity lacks."""
    weighing = [stage.name for stage in stages if stage.gravity is not None]
    if weighing and material.density is None:
        mistake = missing(MaterialSpec, "density")
        expected = f"{mistake.expected}, since stage {weighing[0]} has gravity"
        yield replace(mistake, key="material.density", expected=expected)


def known_laws_are_sharpened(friction: Friction, contact: Contact) -> Mistakes:
    """Yield laws of one's own that "auto" cannot sharpen."""
    own = (friction is not None and ":" in friction.law) or (contact and contact.law)
    if friction is not None and friction.regularisation == "auto" and own:
        expected = '"fixed": only the built-in laws are known well enough to be sharpened'
        yield Mistake("", "friction.regularisation", "auto", expected, 'regularisation = "fixed"')


def refined_mesh_is_estimated(
    strip: StripSpec, material: MaterialSpec, friction: Friction, stages: Stages
) -> Mistakes:
    """Yield what keeps ``refined = "auto"`` from its goal."""
    if strip.refined != "auto":
        return
    why = []
    steady = strip.kinematics == "section" and all(stage.steady for stage in stages)
    if material.plasticity is not None and not steady:
        why.append(": of strip that can yield it is estimated in steady stages of a section alone")
    if friction is not None and friction.regularisation == "auto":
        why.append(', since friction.regularisation = "auto" repeats the run as well')
    for reason in why:
        yield Mistake("", "strip.refined", "auto", f"a length{reason}", "refined = 0.025")


def rollers_have_friction(friction: Friction, rollers: Rollers) -> Mistakes:
    """Yield rollers with a coefficient of their own in a scene without friction."""
    for roller in rollers:
        if friction is None and roller.friction is not None:
            expected = "a table [friction] as well, for all rollers"
            hint = f"[friction]\ncoefficient = {roller.friction:g}"
            yield Mistake("", f"rollers.{roller.name}.friction", roller.friction, expected, hint)


def stages_have_friction(friction: Friction, stages: Stages) -> Mistakes:
    """Yield stages that ask for friction in a scene without."""
    for stage in stages:
        if friction is None and stage.friction and "friction" in stage.model_fields_set:
            expected = "false, since the scene has no [friction]"
            hint = "friction = false, or a table [friction] with its coefficient"
            yield Mistake("", f"stages.{stage.name}.friction", True, expected, hint)


def steady_stages(
    friction: Friction, rollers: Rollers, edges: Edges, stages: Stages, threading: Threading
) -> Mistakes:
    """Yield what a stationary state cannot be without, and what cannot be in it."""
    speed, held = None, edges["entry"].fixed if "entry" in edges else ()
    closed = threading is not None and threading.closed
    for stage in stages:
        key, given = f"stages.{stage.name}", stage.strip.speed
        tension = stage.edge("entry").tension
        speed = speed if given is None else given
        if not stage.steady:
            if given is not None:
                expected = "nothing, or steady = true: in time the strip's speed follows"
                yield Mistake("", f"{key}.strip.speed", given, expected, "steady = true")
            continue
        if friction is None or not rollers or not stage.friction:
            expected = "false without friction on rollers: nothing carries the strip"
            hint = "a table [friction] and no friction = false in this stage, or steady = false"
            yield Mistake("", f"{key}.steady", True, expected, hint)
        if not closed and not {"x", "z"} <= set(held):
            expected = "x and z held: a stationary state counts its labels from the entry"
            hint = 'fixed = ["x", "z"]'
            yield Mistake("", "edges.entry.fixed", list(held) or None, expected, hint)
        if given is not None and tension is not None:
            expected = "either the strip's speed or the tension at the entry: the other follows"
            yield Mistake("", f"{key}.entry.tension", tension, expected, "one; take the other out")
        elif tension is not None:
            if all(roller.drive != "speed" for roller in rollers):
                expected = "strip.speed instead: no roller has a speed, and torques do not fix it"
                yield Mistake("", f"{key}.entry.tension", tension, expected, "strip.speed = 1.0")
            speed = np.nan
        elif speed is None and not closed:
            expected = "the speed of the strip (m/s), or the tension at its entry, entry.tension"
            yield Mistake("", f"{key}.strip.speed", None, expected, "strip.speed = 1.0")
        for name, control in stage.edges.items():
            for word in ("velocity", "speed", "release"):
                if value := getattr(control, word):
                    expected = "nothing in a steady stage: strip.speed carries the strip through"
                    yield Mistake("", f"{key}.{name}.{word}", value, expected, "take it out")


def yielding_strip(material: MaterialSpec, strip: StripSpec) -> Mistakes:
    """Yield plastic flow of what has no layers, or whose layers could not be followed."""
    if material.plasticity is None:
        return
    if strip.kinematics == "plate":
        expected = '"shell" or "section" beside [material.plasticity]: a plate has no stretch'
        yield Mistake("", "strip.kinematics", "plate", expected, 'kinematics = "shell"')
    if not strip.bending:
        expected = "true beside [material.plasticity], whose layers bend"
        yield Mistake("", "strip.bending", strip.bending, expected, "bending = true")
    if strip.kinematics == "shell" and material.plasticity.uniaxial:
        expected = "false on a shell, whose layers flow in plane stress"
        yield Mistake("", "material.plasticity.uniaxial", True, expected, "no uniaxial")
    if strip.feed:
        expected = "no feed beside [material.plasticity]: strip that yields is not relabelled"
        yield Mistake("", "strip.feed", strip.feed, expected, "no feed, or no plasticity")


def threading_partners(threading: Threading, rollers: Rollers) -> Mistakes:
    """Yield what is missing: the table, or a side for some roller."""
    wrapped = [roller for roller in rollers if roller.wrap is not None]
    if threading is None:
        if wrapped:
            hint, key = "[threading]\ntension = 1.0e4", f"rollers.{wrapped[0].name}.wrap"
            yield Mistake("", key, wrapped[0].wrap, "a table [threading] as well", hint)
        return
    if not wrapped:
        hint = 'wrap = "over" in a table of [[rollers]]'
        expected = (
            "a roller that says its side; or no table: strip that begins straight has "
            f"strip.length, and a first stage with exit.force = [{threading.tension:g}, 0.0, 0.0]"
        )
        yield Mistake("", "threading", None, expected, hint)


def one_length(threading: Threading, strip: StripSpec, rollers: Rollers) -> Mistakes:
    """Yield a length that is missing, or given besides both ends from which it follows.

    Of a threaded strip the ends are proposed, as far beside the rollers as these are apart.
    """
    both = threading is not None and None not in (threading.entry, threading.exit)
    both |= threading is not None and threading.closed
    given = strip.length is not None or strip.mesh is not None
    if both and given:
        key, value = ("length", strip.length) if strip.mesh is None else ("mesh", str(strip.mesh))
        expected = "nothing, since the ends of [threading] say the length"
        yield Mistake("", f"strip.{key}", value, expected, f"either {key} or threading.exit")
    if both or given:
        return
    wrapped = [roller for roller in rollers if roller.wrap is not None]
    if threading is None or not wrapped:
        yield replace(missing(StripSpec, "length"), key="strip.length")
        return
    centres = np.array([roller.centre for roller in wrapped])
    apart = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    run = np.copysign(apart.max(initial=5.0 * wrapped[0].radius), centres[-1, 0] - centres[0, 0])
    for name, roller, beside in zip(ENDS, (wrapped[0], wrapped[-1]), (-run, run), strict=True):
        if getattr(threading, name) is None:
            up = 0.9 * roller.radius * (1.0 if roller.wrap == "over" else -1.0)  # touches it
            place = [f"{at:.6g}" for at in (roller.centre[0] + beside, 0.0, roller.centre[2] + up)]
            expected = "a place (m), as strip.length is not given either"
            hint = f"{name} = [{', '.join(place)}]"
            yield Mistake("", f"threading.{name}", None, expected, hint)


def held_entry(threading: Threading, edges: Edges) -> Mistakes:
    """Yield an entry that gives way when the exit is pulled."""
    fixed = edges["entry"].fixed if "entry" in edges else ()
    if threading is not None and not threading.closed and not {"x", "z"} <= set(fixed):
        hint = '[edges.entry]\nfixed = ["x", "z"]'
        expected = "x and z held, to thread against"
        yield Mistake("", "edges.entry.fixed", list(fixed) or None, expected, hint)


def across(strip: StripSpec, rollers: Rollers, stages: Stages) -> dict[str, object]:
    """Return what varies across the width, or is out of line with it."""
    given: dict[str, object] = {}
    for roller in rollers:
        given |= {f"rollers.{roller.name}.{key}": shape for key, shape in roller.profile.items()}
        if roller.axis[0] or roller.axis[2]:
            given[f"rollers.{roller.name}.axis"] = roller.axis
    for place, shaped in (("strip", strip), *((f"stages.{s.name}.strip", s.strip) for s in stages)):
        typed = shaped.model_dump(exclude_defaults=True)
        given |= {f"{place}.{key}": typed[key] for key in shaped.varying_across}
    return given


def closed_strip(
    threading: Threading,
    strip: StripSpec,
    material: MaterialSpec,
    rollers: Rollers,
    edges: Edges,
    stages: Stages,
) -> Mistakes:
    """Yield what an endless strip cannot have: ends, a width that bends, stages in time."""
    if threading is None or not threading.closed:
        return
    ends: dict[str, object] = {f"threading.{name}": getattr(threading, name) for name in ENDS}
    ends |= {f"edges.{name}": "a table" for name in ENDS if name in edges}
    ends |= {key: name for key, name, _ in edge_controls(stages)}
    speeds = {f"stages.{stage.name}.strip.speed": stage.strip.speed for stage in stages}
    yields = {"material.plasticity": None if material.plasticity is None else "a table"}
    reasons: dict[str, Mapping[str, object]] = {
        "an endless strip has no ends": ends,
        "the strip's speed follows": speeds,
        "an endless strip does not yield": yields,
        "an endless strip is a section, which has no width": across(strip, rollers, stages),
    }
    for why, given in reasons.items():
        for key in (key for key, value in given.items() if value is not None):
            expected = f"nothing beside threading.closed = true: {why}"
            yield Mistake("", key, given[key], expected, "take it out")
    if strip.kinematics != "section":
        expected = '"section" beside threading.closed = true'
        yield Mistake("", "strip.kinematics", strip.kinematics, expected, 'kinematics = "section"')
    if sum(roller.wrap is not None for roller in rollers) < 2:
        expected = "at least two rollers with a wrap, round which an endless strip runs"
        yield Mistake("", "rollers", len(rollers), expected, 'wrap = "left"')
    for stage in stages:
        key = f"stages.{stage.name}"
        if not stage.steady and stage.friction:
            expected = "true, or friction = false: an endless strip has no stages in time"
            yield Mistake("", f"{key}.steady", False, expected, "steady = true")
        if stage.steady and all(roller.drive != "speed" for roller in rollers):
            expected = 'a roller with drive = "speed": torques alone do not fix the speed'
            yield Mistake("", f"{key}.rollers", None, expected, 'drive = "speed"')


def own_name(stages: Stages) -> Mistakes:
    """Yield a stage that has the name of the threading."""
    if any(stage.name == THREADING for stage in stages):
        key = f"stages.{THREADING}.name"
        yield Mistake("", key, THREADING, "another name: [threading] has this one", 'name = "run"')


def threading_ends(threading: Threading) -> Mistakes:
    """Yield ends to one side: the way lies in the plane y = 0."""
    ends = (threading.entry, threading.exit) if threading else ()
    for name, place in zip(ENDS, ends, strict=False):
        if place is not None and place[1] != 0.0:
            expected = "0 along y: the middle of the strip runs in the plane y = 0 (m)"
            hint = f"{name} = [{place[0]:g}, 0.0, {place[2]:g}]"
            yield Mistake("", f"threading.{name}", place, expected, hint)


def borne_tension(threading: Threading, strip: StripSpec, material: MaterialSpec) -> Mistakes:
    """Yield a tension that no metal strip bears, most often in another unit."""
    stiffness = material.young * strip.thickness
    if threading is None or threading.closed:  # belts of rubber are stretched more
        return
    if threading.tension <= MAX_THREADED_STRAIN * stiffness:
        return
    if (meant := meant_modulus(material.young)) is not None:
        unit, better = meant
        expected = (
            f"at least {MIN_MODULUS:g} (Pa), as rubber has, to bear threading.tension = "
            f"{threading.tension:g} N/m; was it meant in {unit}?"
        )
        yield Mistake("", "material.young", material.young, expected, f"young = {better:.3g}")
    else:
        percent = 100.0 * threading.tension / stiffness
        expected = (
            f"at most {MAX_THREADED_STRAIN * stiffness:.3g} (N per metre of width); this would "
            f"stretch the strip by {percent:.3g} %, with young × thickness = {stiffness:.3g} N/m"
        )
        hint = f"tension = {1e-4 * stiffness:.3g}, or another young or thickness"
        yield Mistake("", "threading.tension", threading.tension, expected, hint)


def borne_moments(strip: StripSpec, material: MaterialSpec, stages: Stages) -> Mistakes:
    """Yield moments that bend the faces of a strip by more than a metal bears."""
    plate = material.young / (1.0 - material.poisson**2)
    most = MAX_THREADED_STRAIN * plate * strip.thickness**2 / 6.0
    for key, _, control in edge_controls(stages):
        if abs(moment := control.moment or 0.0) > most:
            expected = (
                f"at most {most:.3g} (N m per metre of width); this would strain its faces by "
                f"{100.0 * MAX_THREADED_STRAIN * abs(moment) / most:.3g} %"
            )
            hint = f"moment = {0.01 * most * np.sign(moment):.2g}"
            yield Mistake("", f"{key}.moment", moment, expected, hint)


def meant_modulus(young: float) -> tuple[str, float] | None:
    """Return the unit in which a Young's modulus was typed that no strip has, and it in Pa.

    Examples
    --------
    >>> meant_modulus(2e5), meant_modulus(210.0), meant_modulus(2e11)
    (('MPa', 200000000000.0), ('GPa', 210000000000.0), None)
    """
    if young >= MIN_MODULUS:
        return None
    unit, factor = ("GPa", 1e9) if young < 1e3 else ("MPa", 1e6)
    return unit, factor * young


def wrapped_axes(rollers: Rollers) -> Mistakes:
    """Yield axes along the strip: threading cuts rollers by planes y = const."""
    for roller in rollers:
        if roller.wrap is not None and abs(roller.axis[1]) < MIN_AXIS_ACROSS * hypot(*roller.axis):
            key = f"rollers.{roller.name}.axis"
            expected = "an axis nearly along y, since it says its wrap"
            yield Mistake("", key, roller.axis, expected, "axis = [0.0, 1.0, 0.0]")


def separate_rollers(rollers: Rollers) -> Mistakes:
    """Yield rollers that overlap a parallel one before: axes closer than the sum of the radii."""
    large: dict[str, tuple[float, float]] = {}  # radius, and distance to an axis within it
    radii = np.array([r.radius for r in rollers])
    centres = np.array([r.centre for r in rollers]).reshape(-1, 3).T.copy()
    axes = np.array([np.array(r.axis) / hypot(*r.axis) for r in rollers]).reshape(-1, 3).T.copy()
    for i, second in enumerate(rollers):
        axis, way = axes[:, i], centres[:, i, None] - centres[:, :i]
        offset = way - axis[:, None] * (axis @ way)
        distance, least = np.sqrt(np.sum(offset * offset, axis=0)), radii[:i] + second.radius
        parallel = np.abs(axis @ axes[:, :i]) >= PARALLEL_COSINE
        if not (overlap := parallel & (distance < least * (1.0 - 1e-9))).any():
            continue
        j = int(np.where(overlap, distance - least, np.inf).argmin())
        far = float(distance[j])
        absurd = [r for r in (rollers[j], second) if 0.0 < MILLIMETRE_RATIO * far < r.radius]
        if absurd:
            large |= {roller.name: (roller.radius, far) for roller in absurd}
            continue
        expected = (
            f"at least {least[j]:g} m, the sum of both radii, between the axes of "
            f"{rollers[j].name} and {second.name}, which overlap; now {distance[j]:.4g} (m)"
        )
        x, y, z = second.centre
        centre = np.array([x, 0.0, y])  # y upwards, as in other programs
        if z or np.linalg.norm(np.cross(axis, centre - centres[:, j])) < least[j]:
            away = offset[:, j] / distance[j] if distance[j] else np.array([0.0, 0.0, 1.0])
            centre = second.centre + (1.01 * least[j] - distance[j]) * away
        hint = f"centre = [{', '.join(f'{c:.4g}' for c in centre)}], or smaller radii"
        yield Mistake("", f"rollers.{second.name}.centre", list(second.centre), expected, hint)
    for name, (radius, far) in large.items():
        meant = {"mm": 1e-3 * radius, "µm": 1e-6 * radius, "another unit": 0.1 * far}
        unit = next(unit for unit, better in meant.items() if better < far)
        expected = f"less than {far:.4g} (m), the way to the next axis; was it meant in {unit}?"
        hint = f"radius = {meant[unit]:g}"
        yield Mistake("", f"rollers.{name}.radius", radius, expected, hint)


class Partner(NamedTuple):
    """The roller against which another one is pressed."""

    name: str
    way: Array  # unit vector towards it, (3,)
    gap: float  # m


def pressed_against(rollers: Rollers, roller: RollerSpec) -> Partner | None:
    """Return the parallel roller that is nearest to one, None if there is none.

    Rather one that is not pressed itself, as a neighbour on the same side may be.
    """
    axis = np.asarray(roller.axis) / hypot(*roller.axis)
    found: dict[tuple[bool, float], Partner] = {}
    for other in rollers:
        way = np.subtract(other.centre, roller.centre)
        way = way - way @ axis * axis
        distance = float(np.linalg.norm(way))
        parallel = abs(axis @ other.axis) > PARALLEL_COSINE * hypot(*other.axis)
        gap = distance - other.radius - roller.radius
        if parallel and distance:
            found[other.press is not None, gap] = Partner(other.name, way / distance, gap)
    return found[min(found)] if found else None


def pressed_rollers(rollers: Rollers, stages: Stages) -> Mistakes:
    """Yield forces of rollers that press on nothing, and rollers that cannot be pressed."""
    pressed = {roller.name: roller for roller in rollers if roller.press is not None}
    kept = dict[str, str]()
    for name, roller in pressed.items():
        key, hint, expected = f"rollers.{name}.press", f"no press of {name}", ""
        partner = pressed_against(rollers, roller)
        if partner is None:
            expected = "nothing, without a parallel roller on the other side of the strip"
        elif roller.wrap is not None:
            expected = f"nothing on a roller with a wrap, beside which {partner.name} is to press"
            hint = f"rollers.{partner.name}.press = {roller.press:g}, and no press of {name}"
        elif partner.name in pressed and partner.name in kept:
            expected = f"nothing, since {partner.name}, against which it presses, is pressed itself"
        else:
            kept |= {name: name, partner.name: name}
        if expected:
            yield Mistake("", key, roller.press, expected, hint)
    for stage in stages:
        for name, control in stage.rollers.items():
            place = f"stages.{stage.name}.rollers.{name}"
            if control.press is not None and name not in pressed:
                expected = f"nothing, unless rollers.{name}.press says with what it begins (N)"
                hint = f"press = {control.press:g} in the table of {name} as well"
                yield Mistake("", f"{place}.press", control.press, expected, hint)
            if control.move is not None and name in kept:
                expected = f"nothing, since rollers.{kept[name]}.press says where it is"
                hint = f"no move, or no press of {kept[name]}"
                yield Mistake("", f"{place}.move", control.move, expected, hint)


def times_of_the_run(threading: Threading, stages: Stages, output: OutputSpec) -> Mistakes:
    """Yield times to write that the run does not reach."""
    end = sum(stage.duration for stage in stages) + (threading.duration if threading else 0.0)
    reached = [time for time in output.times or () if time <= end * (1.0 + ROUND_OFF)]
    if output.times and len(reached) < len(output.times):
        expected = f"times up to the end of the run at {end:.10g} (s)"
        hint = f"times = {reached or [end]}"
        yield Mistake("", "output.times", output.times[-1], expected, hint)


RULES: tuple[Callable[..., Iterable[Mistake]], ...] = (
    lambda rollers: duplicates("rollers", rollers), lambda stages: duplicates("stages", stages),
    known_edges, known_rollers, controls_of_drives, closed_strip, flat_plates, rollers_of_a_section,
    known_directions, tensions_and_moments, held_components, speeds_at_ends, clamped_edges,
    released_for_good, pulled_once, tables_of_temperature, natural_shapes, ends_of_a_fed_strip,
    gravity_has_density, known_laws_are_sharpened, refined_mesh_is_estimated,
    rollers_have_friction, stages_have_friction, steady_stages, yielding_strip,
    threading_partners, one_length, held_entry, own_name, threading_ends, borne_tension,
    borne_moments, wrapped_axes, separate_rollers, pressed_rollers, times_of_the_run,
)  # fmt: skip
"""Rules between the tables of a scene; their parameters are the names of the tables they need.

Where two find fault with the same key the first one is told, so what a level of kinematics
cannot have at all stands before what else is wrong with it.
"""


KEY_RULES = (known_rollers, gravity_has_density)
"""Those that ask of a stage which keys it has, and for no values."""


def check_scene(
    tables: Mapping[str, Any], rules: Iterable[Callable[..., Iterable[Mistake]]] = RULES
) -> Mistakes:
    """Yield what is wrong between those tables of a scene that are right in themselves.

    Parameters
    ----------
    tables : mapping
        Tables by name; a rule whose tables are not all there is left out.
    rules : iterable of callable, optional
    """
    told: set[str] = set()
    for rule in rules:
        needed = signature(rule).parameters
        if needed.keys() <= tables.keys():
            found = list(rule(**{name: tables[name] for name in needed}))
            yield from (mistake for mistake in found if mistake.key not in told)
            told.update(mistake.key for mistake in found)
