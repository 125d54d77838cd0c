"""The layout of the package: imports point downwards only, and no two modules need each other.

Every import counts alike: at the top of a module, inside a function, or for types alone.
"""

from __future__ import annotations

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import anmstrip

ROOT = Path(anmstrip.__file__).parent

FLOORS = (
    ("arrays", "errors"),
    ("linalg", "taylor"),
    ("continuation",),
    ("timestepping",),
    ("fem",),
    ("mechanics",),
    ("equilibrium",),
    ("scene",),
    ("results",),
    ("pictures",),
    ("simulation",),
    ("advice",),
    ("driver",),
    ("paper",),
    ("cli",),
    ("__main__",),
)
"""Rooms from the ground up; a module imports from its own room and from lower floors."""

FORBIDDEN = {
    "scene": {
        "linalg",
        "taylor",
        "continuation",
        "timestepping",
        "fem",
        "mechanics",
        "equilibrium",
    },
    "results": {"scene"},
    "pictures": {"scene"},
    "fem": {"continuation", "timestepping"},
    "mechanics": {"continuation", "timestepping"},
}
"""Rooms on lower floors that a room does not know all the same."""


@cache
def modules() -> dict[str, ast.Module]:
    """Return the modules of the package by their dotted names, ``anmstrip`` left out."""
    found = {}
    for path in ROOT.rglob("*.py"):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        found[name.removesuffix(".__init__")] = ast.parse(path.read_text(encoding="utf8"))
    return found


def imported(name: str) -> set[str]:
    """Return the modules of the package that a module imports, wherever in its text."""
    known, found = modules(), set()
    for node in ast.walk(known[name]):
        if isinstance(node, ast.Import):
            targets = [(alias.name, None) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                continue
            targets = [(node.module or "", alias.name) for alias in node.names]
        else:
            continue
        for module, symbol in targets:
            if module.partition(".")[0] == "anmstrip":
                short = module.removeprefix("anmstrip").lstrip(".")
                inner = f"{short}.{symbol}".lstrip(".")
                found.add(inner if inner in known else short)
    return found - {name}


def floor_of(room: str) -> int:
    """Return the number of the floor on which a room lies."""
    return next(k for k, rooms in enumerate(FLOORS) if room in rooms)


def test_no_import_points_upwards() -> None:
    upwards = [
        f"{name} -> {target}"
        for name in modules()
        if name != "__init__"
        for target in imported(name)
        if target.partition(".")[0] != name.partition(".")[0]
        and (
            not target
            or floor_of(target.partition(".")[0]) >= floor_of(name.partition(".")[0])
            or target.partition(".")[0] in FORBIDDEN.get(name.partition(".")[0], ())
        )
    ]
    assert not upwards, "\n".join(sorted(upwards))


def test_no_two_modules_need_each_other() -> None:
    try:
        TopologicalSorter({name: imported(name) for name in modules()}).prepare()
    except CycleError as error:
        raise AssertionError(" -> ".join(error.args[1])) from None


def test_no_constant_has_two_values() -> None:
    found: dict[str, set[str]] = {}
    for tree in modules().values():
        for node in tree.body:
            for target in node.targets if isinstance(node, ast.Assign) else ():
                for each in target.elts if isinstance(target, ast.Tuple) else [target]:
                    if isinstance(each, ast.Name) and each.id.isupper() and len(each.id) > 1:
                        found.setdefault(each.id, set()).add(ast.unparse(node.value))
    assert not {name: values for name, values in found.items() if len(values) > 1}


def test_every_room_has_its_floor_and_a_sentence() -> None:
    rooms = {name for name in modules() if "." not in name and name != "__init__"}
    assert rooms == {room for floor in FLOORS for room in floor}
    for name, tree in modules().items():
        assert ast.get_docstring(tree), f"{name} has no docstring"
