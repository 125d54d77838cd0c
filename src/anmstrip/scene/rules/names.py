"""Names are unique, and what is named is there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from anmstrip.scene.errors import Mistake
from anmstrip.scene.wording import nearest

if TYPE_CHECKING:
    from anmstrip.scene.stage_tables import StageSpec
    from anmstrip.scene.tables import EdgeSpec, RollerSpec, StripSpec

ENDS = ("entry", "exit")
"""The ends of a strip, at −x and +x: all the edges that a section has."""

EDGE_NAMES = (*ENDS, "left", "right")
"""The edges of a rectangular strip, at −x, +x, +y and −y."""


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
