"""What must hold between the fields of a scene.

A rule is a function of tables that are right in themselves and yields what is wrong
between them; its mistakes carry no file yet, and keys relative to what it was given.
Those of one table are in :mod:`~anmstrip.scene.rules.alone`, the others in modules named
for what they are about; :data:`RULES` lists them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from anmstrip.scene.errors import Mistake
from anmstrip.scene.rules import edges, levels, names, partners, rollers, threading
from anmstrip.scene.rules.alone import contact, edge, edge_control, output, roller, strip
from anmstrip.scene.rules.names import EDGE_NAMES
from anmstrip.scene.rules.threading import THREADING

__all__ = [
    "EDGE_NAMES",
    "RULES",
    "THREADING",
    "contact",
    "edge",
    "edge_control",
    "output",
    "roller",
    "scene",
    "strip",
]

RULES: tuple[tuple[Callable[..., Iterable[Mistake]], tuple[str, ...]], ...] = (
    (names.unique_rollers, ("rollers",)),
    (names.unique_stages, ("stages",)),
    (names.known_edges, ("strip", "edges", "stages")),
    (names.known_rollers, ("rollers", "stages")),
    (levels.plates, ("strip", "friction", "threading")),
    (levels.rollers_of_a_section, ("strip", "rollers")),
    (levels.directions, ("strip", "stages")),
    (levels.tension_of_a_plate, ("strip", "stages")),
    (levels.moments, ("strip", "stages")),
    (edges.held_components, ("edges", "stages")),
    (edges.tensions, ("stages",)),
    (partners.gravity_has_density, ("material", "stages")),
    (partners.friction_has_contact, ("friction", "contact")),
    (partners.rollers_have_friction, ("friction", "rollers")),
    (partners.stages_have_friction, ("friction", "stages")),
    (threading.partners, ("threading", "contact", "rollers")),
    (threading.one_length, ("threading", "strip")),
    (threading.held_entry, ("threading", "edges")),
    (threading.own_name, ("threading", "stages")),
    (threading.ends, ("threading",)),
    (threading.bearable, ("threading", "strip", "material")),
    (threading.wrapped_axes, ("rollers",)),
    (rollers.profiles, ("strip", "rollers")),
    (rollers.apart, ("rollers",)),
)
"""Rules between the tables of a scene, each with the tables that it needs.

Where two find fault with the same key the first one is told, so what a level of kinematics
cannot have at all stands before what else is wrong with it.
"""


def scene(tables: Mapping[str, Any]) -> Iterator[Mistake]:
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
