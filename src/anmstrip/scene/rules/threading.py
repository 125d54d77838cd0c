"""Threading: what it needs, and ways that no strip can take."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from anmstrip.scene.errors import Mistake
from anmstrip.scene.rules.partners import CONTACT
from anmstrip.scene.wording import missing

if TYPE_CHECKING:
    from anmstrip.scene.stage_tables import StageSpec
    from anmstrip.scene.tables import (
        ContactSpec,
        EdgeSpec,
        MaterialSpec,
        RollerSpec,
        StripSpec,
        ThreadingSpec,
    )

THREADING = "threading"
"""Name of the stage that lays the strip around the rollers."""

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


def partners(
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


def ends(threading: ThreadingSpec | None) -> Iterator[Mistake]:
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
