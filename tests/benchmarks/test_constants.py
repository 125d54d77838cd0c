"""The study of constants knows all of them."""

from __future__ import annotations

import ast
from importlib import import_module
from inspect import getsource
from itertools import chain

import constants


def numbers(module: str) -> set[str]:
    """Return the names in capitals that a module sets to numbers, given or computed."""
    found = set()
    for node in ast.parse(getsource(import_module(module))).body:
        for target in node.targets if isinstance(node, ast.Assign) else ():
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            found |= {n.id for n in names if isinstance(n, ast.Name) and n.id.isupper()}
    held = vars(import_module(module))
    return {name for name in found if isinstance(held[name], int | float | tuple)}


def test_every_constant_of_a_step_is_removed_or_said_to_be_for_something_else() -> None:
    removed = {name for _, name, _ in constants.REMOVED}
    others = set(chain.from_iterable(constants.ELSEWHERE.values()))
    assert not removed & others
    assert removed | others == set().union(*map(numbers, constants.MODULES))
    assert len(removed) == len(constants.REMOVED) <= 12
