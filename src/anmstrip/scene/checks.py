"""Checks between the tables of a scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import combinations
from math import hypot
from typing import Any

from anmstrip.errors import Mistake
from anmstrip.scene.messages import missing, nearest
from anmstrip.scene.stage_tables import EdgeControl, StageSpec
from anmstrip.scene.tables import (
    EDGE_NAMES,
    ENDS,
    THREADING,
    ContactSpec,
    EdgeSpec,
    FrictionSpec,
    MaterialSpec,
    RollerSpec,
    StripSpec,
    ThreadingSpec,
)


def unique_rollers(rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """Yield rollers that have the name of another."""
    yield from _duplicates("rollers", [roller.name for roller in rollers])


def unique_stages(stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield stages that have the name of another."""
    yield from _duplicates("stages", [stage.name for stage in stages])


def _duplicates(key: str, names: list[str]) -> Iterator[Mistake]:
    for name, count in Counter(names).items():
        if count > 1:
            free = next(f"{name}_{i}" for i in range(2, 999) if f"{name}_{i}" not in names)
            expected = f"a name of its own; {count} {key} have this one"
            yield Mistake("", f"{key}.{name}.name", name, expected, f'name = "{free}"')


def known_edges(
    strip: StripSpec, edges: Mapping[str, EdgeSpec], stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    """Yield names of edges that a strip without mesh file does not have."""
    if strip.mesh is not None:  # its own names; checked when it is read
        return
    known = ENDS if strip.kinematics == "section" else EDGE_NAMES
    for name in edges:
        if name not in known:
            yield _no_edge(f"edges.{name}", name, "the name of an edge", known)
    for stage in stages:
        own = [field for field in type(stage).model_fields if field != "edges"]
        for name in stage.edges:
            if name not in known:
                key, expected = f"stages.{stage.name}.{name}", "a known key or the name of an edge"
                yield _no_edge(key, name, expected, known, own)


def _no_edge(
    key: str, name: str, expected: str, known: tuple[str, ...], others: Iterable[str] = ()
) -> Mistake:
    """An edge that is not there: misspelt, or a side of a section."""
    if name in EDGE_NAMES:
        expected = 'entry or exit: a "section" has no width, hence no sides'
        return Mistake("", key, name, expected, 'take it out, or kinematics = "shell"')
    return Mistake("", key, name, expected, nearest(name, [*known, *others]))


def known_rollers(
    rollers: tuple[RollerSpec, ...], stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    """Yield rollers of stages that the scene does not have."""
    known = [roller.name for roller in rollers]
    for stage in stages:
        for name in stage.rollers:
            if name not in known:
                key = f"stages.{stage.name}.rollers.{name}"
                yield Mistake("", key, name, "the name of a roller", nearest(name, known))


def held_components(
    edges: Mapping[str, EdgeSpec], stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    """Yield motion of free components and force on held ones; a release frees them all."""
    held = {name: tuple(table.fixed) for name, table in edges.items()}
    released: set[str] = set()
    for stage in stages:
        for name, control in stage.edges.items():
            if control.release:
                released.add(name)
            fixed = () if name in released else held.get(name, ())
            for mistake in _misplaced(name, control, fixed, name in released):
                yield replace(mistake, key=f"stages.{stage.name}.{name}.{mistake.key}")


def _misplaced(
    name: str, control: EdgeControl, fixed: tuple[str, ...], released: bool
) -> Iterator[Mistake]:
    for key in ("move", "velocity"):
        value = getattr(control, key)
        if free := [c for c in nonzero(value) if c not in fixed]:
            expected = f"0 in {', '.join(free)}: not held on this edge, so it cannot be moved"
            wanted = ", ".join(f'"{c}"' for c in "xyz" if c in (*fixed, *free))
            hint = f"[edges.{name}]\nfixed = [{wanted}]"
            hint = f"{name}.force = […], for it was released" if released else hint
            yield Mistake("", key, value, expected, hint)
    if both := [c for c in nonzero(control.force) if c in fixed]:
        expected = f"0 in {', '.join(both)}: the component is held; its reaction follows"
        hint = f"0.0 there, or {name}.release = true in this stage or an earlier one"
        yield Mistake("", "force", control.force, expected, hint)
    if control.tension and {"x", "z"} <= set(fixed):
        expected = "0: x and z are held, which take it; their reaction follows"
        hint = f"{name}.release = true in this stage or an earlier one"
        yield Mistake("", "tension", control.tension, expected, hint)


def nonzero(vector: tuple[float, float, float] | None) -> list[str]:
    """Components of a vector that are not zero, by name."""
    return [name for name, value in zip("xyz", vector or (), strict=False) if value != 0]


def tensions(stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield tensions that are not at an end of the strip."""
    for stage in stages:
        for name, control in stage.edges.items():
            if control.tension is not None and name not in ENDS:
                key = f"stages.{stage.name}.{name}.tension"
                expected = "entry or exit, the ends of the strip"
                yield Mistake("", key, control.tension, expected, "exit.tension = 1.0e4")


CONTACT = "[contact]\nstiffness = 1.0e10\neta = 10.0\ndelta = 1.0e-3"
"""What to type for contact."""


def gravity_has_density(material: MaterialSpec, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield a density that gravity lacks."""
    weighing = [stage.name for stage in stages if stage.gravity is not None]
    if weighing and material.density is None:
        mistake = replace(missing(type(material), "density"), key="material.density")
        expected = f"{mistake.expected}, since stage {weighing[0]} has gravity"
        yield replace(mistake, expected=expected)


def friction_has_contact(
    friction: FrictionSpec | None, contact: ContactSpec | None
) -> Iterator[Mistake]:
    """Yield the contact that friction lacks."""
    if friction is not None and contact is None:
        yield Mistake("", "contact", None, "a table, since there is [friction]", CONTACT)


def rollers_have_friction(
    friction: FrictionSpec | None, rollers: tuple[RollerSpec, ...]
) -> Iterator[Mistake]:
    """Yield rollers with a coefficient of their own in a scene without friction."""
    for roller in rollers:
        if friction is None and roller.friction is not None:
            expected = "a table [friction] as well, for the law and its speed"
            hint = f"[friction]\ncoefficient = {roller.friction:g}\nspeed = 1.0e-4"
            yield Mistake("", f"rollers.{roller.name}.friction", roller.friction, expected, hint)


def stages_have_friction(
    friction: FrictionSpec | None, stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    """Yield stages that ask for friction in a scene without."""
    for stage in stages:
        if friction is None and stage.friction and "friction" in stage.model_fields_set:
            key = f"stages.{stage.name}.friction"
            expected = "false, since the scene has no [friction]"
            hint = "friction = false, or a table [friction] with coefficient and speed"
            yield Mistake("", key, True, expected, hint)


Vector = tuple[float, ...]


PARALLEL = 0.99
"""Least cosine of the angle between axes that count as parallel."""


def apart(rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """Yield parallel rollers that overlap: axes closer than the sum of the radii."""
    for first, second in combinations(rollers, 2):
        least = first.radius + second.radius
        if abs(_product(_unit(first.axis), _unit(second.axis))) < PARALLEL:
            continue
        offset = _offset(first, second)
        distance = hypot(*offset)
        if distance < least * (1.0 - 1e-9):
            expected = (
                f"at least {least:g} m, the sum of both radii, between the axes of {first.name} "
                f"and {second.name}, which overlap; now {distance:.4g} (m)"
            )
            key, hint = f"rollers.{second.name}.centre", _further(second, offset, least)
            yield Mistake("", key, list(second.centre), expected, hint)


def _offset(first: RollerSpec, second: RollerSpec) -> Vector:
    """From the axis of the first to the centre of the second, square to the axis (m)."""
    axis = _unit(first.axis)
    way = tuple(b - a for a, b in zip(first.centre, second.centre, strict=True))
    along = _product(way, axis)
    return tuple(w - along * a for w, a in zip(way, axis, strict=True))


def _further(roller: RollerSpec, offset: Vector, least: float) -> str:
    """What to type to have a roller pushed out of another, and a little more."""
    distance = hypot(*offset)
    direction = (0.0, 0.0, 1.0) if distance == 0.0 else tuple(o / distance for o in offset)
    push = 1.01 * least - distance
    place = [f"{c + push * d:.4g}" for c, d in zip(roller.centre, direction, strict=True)]
    return f"centre = [{', '.join(place)}], or smaller radii"


def _unit(vector: Vector) -> Vector:
    length = hypot(*vector)
    return tuple(component / length for component in vector)


def _product(a: Vector, b: Vector) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


ACROSS = 0.9
"""Least component along y of the unit axis of a roller that the strip is threaded around."""

STRETCHED = 0.05
"""Largest strain of a threaded strip: metals yield long before."""


def one_length(threading: ThreadingSpec | None, strip: StripSpec) -> Iterator[Mistake]:
    """Yield a length that is missing, or given besides both ends from which it follows."""
    both = threading is not None and None not in (threading.entry, threading.exit)
    given = strip.length is not None or strip.mesh is not None
    if both and given:
        key, value = ("length", strip.length) if strip.mesh is None else ("mesh", str(strip.mesh))
        expected = "nothing, since the ends of [threading] say the length"
        yield Mistake("", f"strip.{key}", value, expected, f"either {key} or threading.exit")
    if not both and not given:
        yield replace(missing(type(strip), "length"), key="strip.length")


def threading_partners(
    threading: ThreadingSpec | None, contact: ContactSpec | None, rollers: tuple[RollerSpec, ...]
) -> Iterator[Mistake]:
    """Yield what is missing: the table, a side for some roller, or contact."""
    wrapped = [roller for roller in rollers if roller.wrap is not None]
    if threading is None:
        if wrapped:
            hint, key = "[threading]\ntension = 1.0e4", f"rollers.{wrapped[0].name}.wrap"
            yield Mistake("", key, wrapped[0].wrap, "a table [threading] as well", hint)
        return
    if not wrapped:
        hint = 'wrap = "over" in a table of [[rollers]]'
        yield Mistake("", "threading", None, "a roller that says its side", hint)
    if contact is None:
        yield Mistake("", "contact", None, "a table, since there is [threading]", CONTACT)


def held_entry(threading: ThreadingSpec | None, edges: Mapping[str, EdgeSpec]) -> Iterator[Mistake]:
    """Yield an entry that gives way when the exit is pulled."""
    fixed = edges["entry"].fixed if "entry" in edges else ()
    if threading is not None and not {"x", "z"} <= set(fixed):
        hint = '[edges.entry]\nfixed = ["x", "z"]'
        expected = "x and z held, to thread against"
        yield Mistake("", "edges.entry.fixed", list(fixed) or None, expected, hint)


def own_name(threading: ThreadingSpec | None, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield a stage that has the name of the threading."""
    if threading is not None and any(stage.name == THREADING for stage in stages):
        key = f"stages.{THREADING}.name"
        yield Mistake("", key, THREADING, "another name: [threading] has this one", 'name = "run"')


def threading_ends(threading: ThreadingSpec | None) -> Iterator[Mistake]:
    """Yield ends to one side: the way lies in the plane y = 0."""
    if threading is None:
        return
    for name, place in (("entry", threading.entry), ("exit", threading.exit)):
        if place is not None and place[1] != 0.0:
            expected = "0 along y: the middle of the strip runs in the plane y = 0 (m)"
            hint = f"{name} = [{place[0]:g}, 0.0, {place[2]:g}]"
            yield Mistake("", f"threading.{name}", place, expected, hint)


def bearable(
    threading: ThreadingSpec | None, strip: StripSpec, material: MaterialSpec
) -> Iterator[Mistake]:
    """Yield a tension that no metal strip bears, most often in another unit."""
    stiffness = material.young * strip.thickness
    if threading is not None and threading.tension > STRETCHED * stiffness:
        percent = 100.0 * threading.tension / stiffness
        expected = (
            f"at most {STRETCHED * stiffness:.3g} (N per metre of width); this would stretch the "
            f"strip by {percent:.3g} %, with young × thickness = {stiffness:.3g} N/m"
        )
        hint = f"tension = {1e-4 * stiffness:.3g}, or another young or thickness"
        yield Mistake("", "threading.tension", threading.tension, expected, hint)


def wrapped_axes(rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """Yield axes along the strip: threading cuts rollers by planes y = const."""
    for roller in rollers:
        x, y, z = roller.axis
        if roller.wrap is not None and abs(y) < ACROSS * (x * x + y * y + z * z) ** 0.5:
            key = f"rollers.{roller.name}.axis"
            expected = "an axis nearly along y, since it says its wrap"
            yield Mistake("", key, roller.axis, expected, "axis = [0.0, 1.0, 0.0]")


SEEN = {"shell": "xyz", "section": "xz", "plate": "z"}
"""Displacements that a level has; holding another one is harmless, moving or loading it is not."""

WHY = {"section": 'a "section" has no width', "plate": 'a "plate" only moves up and down'}

OTHER = {"section": 'kinematics = "shell"', "plate": 'kinematics = "section"'}
"""The next level, which sees it."""


def plates(
    strip: StripSpec, friction: FrictionSpec | None, threading: ThreadingSpec | None
) -> Iterator[Mistake]:
    """Yield what needs a strip that moves along, or is bent far."""
    if strip.kinematics != "plate":
        return
    key, hint = "strip.kinematics", OTHER["plate"]
    if threading is not None:
        expected = '"shell" or "section": a plate stays nearly flat, so it is not threaded'
        yield Mistake("", key, "plate", expected, hint)
    if friction is not None:
        expected = '"shell" or "section": a plate does not move along, so nothing rubs'
        yield Mistake("", key, "plate", expected, hint)
    if strip.feed:
        yield Mistake("", "strip.feed", True, "false: a plate does not move along", "feed = false")


def rollers_of_a_section(strip: StripSpec, rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """Yield rollers that are not the same all across."""
    if strip.kinematics != "section":
        return
    for roller in rollers:
        for key, value in roller.profile.items():
            expected = f'no {key}, since "section" has no width'
            yield Mistake("", f"rollers.{roller.name}.{key}", value, expected, OTHER["section"])
        if roller.axis[0] or roller.axis[2]:
            expected = 'an axis along y, since "section" has no width'
            hint = "axis = [0.0, 1.0, 0.0]"
            yield Mistake("", f"rollers.{roller.name}.axis", roller.axis, expected, hint)


def directions(strip: StripSpec, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield motion, force and gravity along what a level does not have."""
    level = strip.kinematics
    for stage in stages:
        for name, control in stage.edges.items():
            for key in ("move", "velocity", "force"):
                seen = SEEN[level]
                if (level, name, key) == ("plate", "exit", "force"):
                    seen = "xz"  # along x it is the tension of the plate
                place, value = f"{name}.{key}", getattr(control, key)
                yield from _unseen(level, seen, f"stages.{stage.name}.{place}", place, value)
        key = f"stages.{stage.name}.gravity"
        yield from _unseen(level, SEEN[level], key, "gravity", stage.gravity)


def _unseen(
    level: str, seen: str, key: str, short: str, value: tuple[float, float, float] | None
) -> Iterator[Mistake]:
    """A vector with a component that is not seen."""
    unseen = [c for c in nonzero(value) if c not in seen]
    if value is None or not unseen:
        return
    kept = [v if c in seen else 0.0 for c, v in zip("xyz", value, strict=True)]
    expected = f"0 along {' and '.join(unseen)}: {WHY[level]}"
    yield Mistake("", key, value, expected, f"{short} = {kept}, or {OTHER[level]}")


def moments(strip: StripSpec, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield moments on a strip that does not resist bending, or does not turn far."""
    if strip.bending and strip.kinematics != "plate":
        return
    expected = 'nothing: a strip without bending has no moments, a "plate" takes none'
    hint = OTHER["plate"] if strip.bending else "bending = true"
    for stage in stages:
        for name, control in stage.edges.items():
            if control.moment is not None:
                key = f"stages.{stage.name}.{name}.moment"
                yield Mistake("", key, control.moment, expected, hint)


def tension_of_a_plate(strip: StripSpec, stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Yield tensions that a plate does not look at: its own is that of exit.force."""
    if strip.kinematics != "plate":
        return
    for stage in stages:
        for name, control in stage.edges.items():
            if control.tension is not None:
                key = f"stages.{stage.name}.{name}.tension"
                expected = 'nothing: the tension of a "plate" is the x of exit.force (N/m)'
                hint = f"exit.force = [{control.tension:g}, 0.0, 0.0]"
                yield Mistake("", key, control.tension, expected, hint)


RULES: tuple[tuple[Callable[..., Iterable[Mistake]], tuple[str, ...]], ...] = (
    (unique_rollers, ("rollers",)),
    (unique_stages, ("stages",)),
    (known_edges, ("strip", "edges", "stages")),
    (known_rollers, ("rollers", "stages")),
    (plates, ("strip", "friction", "threading")),
    (rollers_of_a_section, ("strip", "rollers")),
    (directions, ("strip", "stages")),
    (tension_of_a_plate, ("strip", "stages")),
    (moments, ("strip", "stages")),
    (held_components, ("edges", "stages")),
    (tensions, ("stages",)),
    (gravity_has_density, ("material", "stages")),
    (friction_has_contact, ("friction", "contact")),
    (rollers_have_friction, ("friction", "rollers")),
    (stages_have_friction, ("friction", "stages")),
    (threading_partners, ("threading", "contact", "rollers")),
    (one_length, ("threading", "strip")),
    (held_entry, ("threading", "edges")),
    (own_name, ("threading", "stages")),
    (threading_ends, ("threading",)),
    (bearable, ("threading", "strip", "material")),
    (wrapped_axes, ("rollers",)),
    (apart, ("rollers",)),
)
"""Rules between the tables of a scene, each with the tables that it needs.

Where two find fault with the same key the first one is told, so what a level of kinematics
cannot have at all stands before what else is wrong with it.
"""


def check_scene(tables: Mapping[str, Any]) -> Iterator[Mistake]:
    """Yield what is wrong between those tables of a scene that are right in themselves.

    Parameters
    ----------
    tables : mapping
        Tables by name; a rule whose tables are not all there is left out.
    """
    told: set[str] = set()
    for rule, needed in RULES:
        if all(name in tables for name in needed):
            found = list(rule(*(tables[name] for name in needed)))
            yield from (mistake for mistake in found if mistake.key not in told)
            told.update(mistake.key for mistake in found)
