"""What must hold between the fields of a scene.

A rule is a function of tables that are right in themselves and yields what is wrong
between them; its mistakes carry no file yet, and keys relative to what it was given.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from anmstrip.scene.errors import Mistake
from anmstrip.scene.wording import missing, nearest

if TYPE_CHECKING:
    from pathlib import Path

    from anmstrip.scene.stage_tables import EdgeControl, OutputSpec, StageSpec
    from anmstrip.scene.tables import (
        ContactSpec,
        EdgeSpec,
        FrictionSpec,
        MaterialSpec,
        RollerSpec,
        StripSpec,
        ThreadingSpec,
    )

THREADING = "threading"
"""Name of the stage that lays the strip around the rollers."""

ACROSS = 0.9
"""Least component along y of the unit axis of a roller that the strip is threaded around."""

EDGE_NAMES = ("entry", "exit", "left", "right")
"""The edges of a rectangular strip, at −x, +x, +y and −y."""


def strip(table: StripSpec) -> Iterator[Mistake]:
    """Yield what is wrong with a strip: neither or both of rectangle and mesh file."""
    if table.mesh is None:
        needed = ("width", "cells")
        yield from (missing(type(table), key) for key in needed if getattr(table, key) is None)
        return
    if table.kinematics == "section" or table.feed:
        key = "feed" if table.feed else "kinematics"
        expected = "a strip by length, width and cells, not by a mesh file"
        yield Mistake("", key, getattr(table, key), expected, "cells = [16, 2]")
    for key in ("length", "width", "cells", "refined"):
        if (value := getattr(table, key)) is not None:
            expected = "nothing, since the mesh file says it"
            yield Mistake("", key, value, expected, f"either {key} or mesh; take one out")
    if not _is_file(table.mesh):
        hint = "the path of a file, relative to the scene's own file"
        yield Mistake("", "mesh", str(table.mesh), "a file that exists", hint)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, a directory that may not be read
        return False


def contact(table: ContactSpec) -> Iterator[Mistake]:
    """Yield what is wrong with the contact: the law (5c) needs η < K δ."""
    bound = table.stiffness * table.delta
    if not table.eta < bound:
        expected = f"eta below stiffness × delta = {bound:g} (Pa)"
        yield Mistake("", "eta", table.eta, expected, f"eta = {bound / 1e6:g}")


def roller(table: RollerSpec) -> Iterator[Mistake]:
    """Yield what is wrong with a roller: an axis without direction."""
    if not any(table.axis):
        expected = "a direction: three numbers, not all 0 (1)"
        yield Mistake("", "axis", table.axis, expected, "axis = [0.0, 1.0, 0.0]")


def edge(table: EdgeSpec) -> Iterator[Mistake]:
    """Yield what is wrong with an edge: a component held twice."""
    if len(set(table.fixed)) < len(table.fixed):
        once = ", ".join(f'"{component}"' for component in dict.fromkeys(table.fixed))
        yield Mistake("", "fixed", table.fixed, "each component once", f"fixed = [{once}]")


def edge_control(table: EdgeControl) -> Iterator[Mistake]:
    """Yield what is wrong with an edge's control: both a displacement and a velocity."""
    if table.move is not None and table.velocity is not None:
        expected = "either move (m) or velocity (m/s), not both"
        yield Mistake("", "velocity", table.velocity, expected, "one of them; take one out")


def output(table: OutputSpec) -> Iterator[Mistake]:
    """Yield what is wrong with the output: two choices of states, or times in disorder."""
    if table.times is None:
        return
    if "every" in table.model_fields_set:
        expected = "either every or times, not both"
        yield Mistake("", "every", table.every, expected, "one of them; take one out")
    ordered = sorted(set(table.times))
    if list(table.times) != ordered or not ordered:
        hint = f"times = {ordered or [0.5, 1.0]}"
        yield Mistake("", "times", table.times, "increasing times, at least one (s)", hint)


def _unique_rollers(rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    yield from _duplicates("rollers", [roller.name for roller in rollers])


def _unique_stages(stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    yield from _duplicates("stages", [stage.name for stage in stages])


def _duplicates(key: str, names: list[str]) -> Iterator[Mistake]:
    for name, count in Counter(names).items():
        if count > 1:
            free = next(f"{name}_{i}" for i in range(2, 999) if f"{name}_{i}" not in names)
            expected = f"a name of its own; {count} {key} have this one"
            yield Mistake("", f"{key}.{name}.name", name, expected, f'name = "{free}"')


def _known_edges(
    strip: StripSpec, edges: Mapping[str, EdgeSpec], stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    if strip.mesh is not None:  # its own names; checked when it is read
        return
    for name in edges:
        if name not in EDGE_NAMES:
            hint = nearest(name, EDGE_NAMES)
            yield Mistake("", f"edges.{name}", name, "the name of an edge", hint)
    for stage in stages:
        for name in stage.edges:
            if name not in EDGE_NAMES:
                key, own = f"stages.{stage.name}.{name}", type(stage).model_fields
                hint = nearest(name, [*EDGE_NAMES, *(field for field in own if field != "edges")])
                yield Mistake("", key, name, "a known key or the name of an edge", hint)


def _known_rollers(
    rollers: tuple[RollerSpec, ...], stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    known = [roller.name for roller in rollers]
    for stage in stages:
        for name in stage.rollers:
            if name not in known:
                key = f"stages.{stage.name}.rollers.{name}"
                yield Mistake("", key, name, "the name of a roller", nearest(name, known))


def _held_components(
    edges: Mapping[str, EdgeSpec], stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    """Motion belongs to held components and force to free ones; a release frees them all."""
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
        if free := [c for c in _nonzero(value) if c not in fixed]:
            expected = f"0 in {', '.join(free)}: not held on this edge, so it cannot be moved"
            wanted = ", ".join(f'"{c}"' for c in "xyz" if c in (*fixed, *free))
            hint = f"[edges.{name}]\nfixed = [{wanted}]"
            hint = f"{name}.force = […], for it was released" if released else hint
            yield Mistake("", key, value, expected, hint)
    if both := [c for c in _nonzero(control.force) if c in fixed]:
        expected = f"0 in {', '.join(both)}: the component is held; its reaction follows"
        hint = f"0.0 there, or {name}.release = true in this stage or an earlier one"
        yield Mistake("", "force", control.force, expected, hint)


def _nonzero(vector: tuple[float, float, float] | None) -> list[str]:
    return [name for name, value in zip("xyz", vector or (), strict=False) if value != 0]


def _gravity_has_density(
    material: MaterialSpec, stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    weighing = [stage.name for stage in stages if stage.gravity is not None]
    if weighing and material.density is None:
        mistake = replace(missing(type(material), "density"), key="material.density")
        expected = f"{mistake.expected}, since stage {weighing[0]} has gravity"
        yield replace(mistake, expected=expected)


def _friction_has_contact(
    friction: FrictionSpec | None, contact: ContactSpec | None
) -> Iterator[Mistake]:
    if friction is not None and contact is None:
        hint = "[contact]\nstiffness = 1.0e10\neta = 10.0\ndelta = 1.0e-3"
        yield Mistake("", "contact", None, "a table, since there is [friction]", hint)


def _stages_have_friction(
    friction: FrictionSpec | None, stages: tuple[StageSpec, ...]
) -> Iterator[Mistake]:
    for stage in stages:
        if friction is None and stage.friction and "friction" in stage.model_fields_set:
            key = f"stages.{stage.name}.friction"
            expected = "false, since the scene has no [friction]"
            hint = "friction = false, or a table [friction] with coefficient and speed"
            yield Mistake("", key, True, expected, hint)


def _threading(
    threading: ThreadingSpec | None,
    strip: StripSpec,
    contact: ContactSpec | None,
    rollers: tuple[RollerSpec, ...],
    edges: Mapping[str, EdgeSpec],
    stages: tuple[StageSpec, ...],
) -> Iterator[Mistake]:
    """Threading needs a side for some roller, a held entry, contact, and one length."""
    wrapped = [roller for roller in rollers if roller.wrap is not None]
    if threading is None:
        if wrapped:
            hint, key = "[threading]\ntension = 1.0e4", f"rollers.{wrapped[0].name}.wrap"
            yield Mistake("", key, wrapped[0].wrap, "a table [threading] as well", hint)
        if strip.mesh is None and strip.length is None:
            yield replace(missing(type(strip), "length"), key="strip.length")
        return
    if not wrapped:
        hint = 'wrap = "over" in a table of [[rollers]]'
        yield Mistake("", "threading", None, "a roller that says its side", hint)
    if contact is None:
        hint = "[contact]\nstiffness = 1.0e10\neta = 10.0\ndelta = 1.0e-3"
        yield Mistake("", "contact", None, "a table, since there is [threading]", hint)
    if strip.kinematics == "plate":
        expected = '"shell" or "section": a plate stays nearly flat'
        yield Mistake("", "strip.kinematics", "plate", expected, 'kinematics = "section"')
    if not {"x", "z"} <= set(edges["entry"].fixed if "entry" in edges else ()):
        hint = '[edges.entry]\nfixed = ["x", "z"]'
        yield Mistake("", "edges.entry.fixed", None, "x and z held, to thread against", hint)
    yield from _one_length(threading, strip)
    if any(stage.name == THREADING for stage in stages):
        key = f"stages.{THREADING}.name"
        yield Mistake("", key, THREADING, "another name: [threading] has this one", 'name = "run"')


def _one_length(threading: ThreadingSpec, strip: StripSpec) -> Iterator[Mistake]:
    """The length is given, or follows from both ends."""
    both = threading.entry is not None and threading.exit is not None
    given = strip.length is not None or strip.mesh is not None
    if both and given:
        expected = "nothing, since the ends of [threading] say it"
        yield Mistake("", "strip.length", strip.length, expected, "either length or threading.exit")
    if not both and not given:
        yield replace(missing(type(strip), "length"), key="strip.length")


def _wrapped_axes(rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """Threading cuts rollers by planes y = const, in what are nearly circles."""
    for roller in rollers:
        x, y, z = roller.axis
        if roller.wrap is not None and abs(y) < ACROSS * (x * x + y * y + z * z) ** 0.5:
            key = f"rollers.{roller.name}.axis"
            expected = "an axis nearly along y, since it says its wrap"
            yield Mistake("", key, roller.axis, expected, "axis = [0.0, 1.0, 0.0]")


def _crowns(strip: StripSpec, rollers: tuple[RollerSpec, ...]) -> Iterator[Mistake]:
    """A profile has a radius all across the strip."""
    half = 0.5 * (strip.width or 0.0)
    for roller in rollers:
        places = [(2.0 * i / 32 - 1.0) * half - roller.centre[1] for i in range(33)]
        least = min(
            roller.radius + sum(c * s**k for k, c in enumerate(roller.crown, start=1))
            for s in places
        )
        if not least > 0.0:
            expected = f"a radius above 0 all across the strip; it falls to {least:.3g} (m)"
            hint = f"crown = [0.0, {-1e-3 * roller.radius:g}]"
            yield Mistake("", f"rollers.{roller.name}.crown", roller.crown, expected, hint)


def _levels(
    strip: StripSpec, friction: FrictionSpec | None, rollers: tuple[RollerSpec, ...]
) -> Iterator[Mistake]:
    """What a section or a plate cannot see."""
    if strip.kinematics == "plate":
        hint = 'kinematics = "section"'
        if friction is not None:
            expected = '"shell" or "section": a plate does not move along, so nothing rubs'
            yield Mistake("", "strip.kinematics", "plate", expected, hint)
        if strip.feed:
            expected = "false: a plate does not move along"
            yield Mistake("", "strip.feed", True, expected, "feed = false")
    if strip.kinematics != "section":
        return
    for roller in rollers:
        if roller.crown:
            expected = 'no crown, since "section" has no width'
            hint = 'kinematics = "shell"'
            yield Mistake("", f"rollers.{roller.name}.crown", roller.crown, expected, hint)
        if roller.axis[0] or roller.axis[2]:
            expected = 'an axis along y, since "section" has no width'
            hint = "axis = [0.0, 1.0, 0.0]"
            yield Mistake("", f"rollers.{roller.name}.axis", roller.axis, expected, hint)


def _tensions(stages: tuple[StageSpec, ...]) -> Iterator[Mistake]:
    """Tension belongs to the two ends of the strip."""
    for stage in stages:
        for name, control in stage.edges.items():
            if control.tension is not None and name not in ("entry", "exit"):
                key = f"stages.{stage.name}.{name}.tension"
                expected = "entry or exit, the ends of the strip"
                yield Mistake("", key, control.tension, expected, "exit.tension = 1.0e4")


RULES: tuple[tuple[Callable[..., Iterable[Mistake]], tuple[str, ...]], ...] = (
    (_unique_rollers, ("rollers",)),
    (_unique_stages, ("stages",)),
    (_known_edges, ("strip", "edges", "stages")),
    (_known_rollers, ("rollers", "stages")),
    (_held_components, ("edges", "stages")),
    (_gravity_has_density, ("material", "stages")),
    (_friction_has_contact, ("friction", "contact")),
    (_stages_have_friction, ("friction", "stages")),
    (_threading, ("threading", "strip", "contact", "rollers", "edges", "stages")),
    (_wrapped_axes, ("rollers",)),
    (_crowns, ("strip", "rollers")),
    (_levels, ("strip", "friction", "rollers")),
    (_tensions, ("stages",)),
)
"""Rules between the tables of a scene, each with the tables that it needs."""


def scene(tables: Mapping[str, Any]) -> Iterator[Mistake]:
    """Yield what is wrong between those tables of a scene that are right in themselves.

    Parameters
    ----------
    tables : mapping
        Tables by name; a rule whose tables are not all there is left out.
    """
    for rule, names in RULES:
        if all(name in tables for name in names):
            yield from rule(*(tables[name] for name in names))
