"""Edges: motion belongs to what is held, force to what is free."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from anmstrip.scene.errors import Mistake
from anmstrip.scene.rules.names import ENDS

if TYPE_CHECKING:
    from anmstrip.scene.stage_tables import EdgeControl, StageSpec
    from anmstrip.scene.tables import EdgeSpec


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
