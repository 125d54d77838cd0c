"""Values from the command line put into a scene, ``KEY=VALUE`` with dotted keys."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.wording import nearest


@dataclass(frozen=True)
class Override:
    """One value to put into a scene.

    Attributes
    ----------
    text : str
        As it was typed.
    path : tuple of str
        Keys from the outside in; entries of lists of tables by their name.
    value : object
        The value.
    """

    text: str
    path: tuple[str, ...]
    value: object

    @classmethod
    def parse(cls, text: str) -> Override:
        """Read ``KEY=VALUE``, the key dotted and the value in TOML syntax.

        Raises
        ------
        InputError
            If it is not of this form.

        Examples
        --------
        >>> Override.parse("rollers.r1.radius=0.3").path
        ('rollers', 'r1', 'radius')
        """
        key, equals, value = text.partition("=")
        if not equals:
            raise _error(text, text, None, "KEY=VALUE", "--set friction.coefficient=0.2")
        path = _path(text, key.strip())
        return cls(text, path, _value(text, ".".join(path), value.strip()))

    def covers(self, key: str) -> bool:
        """Whether a dotted key is the one that was set, below it, or a table around it."""
        own = ".".join(self.path)
        return key == own or key.startswith(f"{own}.") or own.startswith(f"{key}.")

    def applied_to(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return data with the value put in; tables that are not there are made.

        Raises
        ------
        InputError
            If the path leads through something that is no table, or to an unknown name.
        """
        return self._put(data, 0)

    def _put(self, inside: Any, depth: int) -> Any:
        if depth == len(self.path):
            return self.value
        head = self.path[depth]
        if isinstance(inside, Mapping):
            return {**inside, head: self._put(inside.get(head, {}), depth + 1)}
        if isinstance(inside, Sequence) and not isinstance(inside, str):
            return self._put_by_name(inside, head, depth)
        key = ".".join(self.path[:depth])
        raise _error(self.text, key, inside, "a table", f"--set {key}=… with a value")

    def _put_by_name(self, tables: Sequence[Any], name: str, depth: int) -> list[Any]:
        names = [table.get("name") if isinstance(table, Mapping) else None for table in tables]
        if name not in names:
            key, known = ".".join(self.path), [known for known in names if isinstance(known, str)]
            raise _error(self.text, key, name, "a known name", nearest(name, known))
        return [
            self._put(table, depth + 1) if known == name else table
            for table, known in zip(tables, names, strict=True)
        ]


def _path(text: str, key: str) -> tuple[str, ...]:
    try:
        inside: Any = tomllib.loads(f"{key} = 0") if "\n" not in key else {}
    except (ValueError, RecursionError):
        inside = {}
    path: list[str] = []
    while isinstance(inside, Mapping) and len(inside) == 1:
        path.extend(inside)
        inside = inside[path[-1]]
    if not path:
        raise _error(text, key, None, "a dotted key", "--set friction.coefficient=0.2")
    return tuple(path)


def _value(text: str, key: str, value: str) -> object:
    try:
        (parsed,) = tomllib.loads(f"value = {value}").values()
    except (ValueError, RecursionError):
        hint = f"""a number, true, [1.0, 0.0, 0.0], or text in quotes: '{key}="{value}"'"""
        raise _error(text, key, value, "a value in TOML syntax", hint) from None
    return parsed


def _error(text: str, key: str, value: object, expected: str, hint: str) -> InputError:
    return InputError((Mistake(f"--set {text}", key, value, expected, hint),))
