"""What must hold inside one table of a scene, between its fields."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from anmstrip.scene.errors import Mistake
from anmstrip.scene.wording import missing

if TYPE_CHECKING:
    from pathlib import Path

    from anmstrip.scene.stage_tables import EdgeControl, OutputSpec
    from anmstrip.scene.tables import ContactSpec, EdgeSpec, RollerSpec, StripSpec


def strip(table: StripSpec) -> Iterator[Mistake]:
    """Yield what is wrong with a strip."""
    yield from _outline(table)
    yield from _imperfection(table)


def _imperfection(table: StripSpec) -> Iterator[Mistake]:
    """Yield what cannot be with a strip that is bent before it is loaded."""
    if table.imperfection is None:
        return
    bent = "with an imperfection"
    if table.kinematics != "shell":
        expected, hint = f'"shell" {bent}: others do not wrinkle', 'kinematics = "shell"'
        yield Mistake("", "kinematics", table.kinematics, expected, hint)
    if not table.bending:
        expected = f"true {bent}, which without bending does nothing"
        yield Mistake("", "bending", table.bending, expected, "bending = true")
    if table.feed:
        expected = f"false {bent}: fresh strip is flat"
        yield Mistake("", "feed", table.feed, expected, "feed = false")


def _outline(table: StripSpec) -> Iterator[Mistake]:
    """Yield neither or both of rectangle and mesh file."""
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
    """Yield what is wrong with the contact: half a law, two, or one without η < K δ."""
    penalty = {"stiffness": "1.0e10", "eta": "10.0", "delta": "1.0e-3"}
    given = [key for key in penalty if getattr(table, key) is not None]
    if given:
        for key in penalty.keys() - set(given):
            expected = "stiffness, eta and delta together, or none of them"
            yield Mistake("", key, None, expected, f"{key} = {penalty[key]}")
        for key in ("onset", "pressure"):
            if (value := getattr(table, key)) is not None:
                expected = f"no {key} beside stiffness, eta and delta, which are another law"
                yield Mistake("", key, value, expected, f"either {key} or {', '.join(given)}")
    if table.constants is None:
        return
    stiffness, eta, delta = table.constants
    bound = stiffness * delta
    if not eta < bound:
        expected = f"eta below stiffness × delta = {bound:g} (Pa)"
        yield Mistake("", "eta", eta, expected, f"eta = {bound / 1e6:g}")


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
