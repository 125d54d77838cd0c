"""From a TOML file and values of the command line to a checked scene."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError

from anmstrip.errors import InputError, Mistake
from anmstrip.scene.checks import check_scene
from anmstrip.scene.messages import mistakes_of, nearest

S = TypeVar("S", bound=BaseModel)


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


def with_default_names(tables: Any, prefix: str) -> Any:
    """Return a list of tables where those without a name are called prefix + position.

    Anything that is no list of tables is returned as it is.

    Examples
    --------
    >>> with_default_names([{"radius": 1.0}, {"name": "big"}, {}], "r")
    [{'name': 'r1', 'radius': 1.0}, {'name': 'big'}, {'name': 'r3'}]
    """
    if not isinstance(tables, list | tuple):
        return tables
    return [
        {"name": f"{prefix}{position}", **table} if isinstance(table, Mapping) else table
        for position, table in enumerate(tables, start=1)
    ]


_STARTS = "[strip]\nlength = 4.0\nwidth = 1.0\nthickness = 1.0e-3\ncells = [16, 2]"


def read_scene(model: type[S], path: str | Path, overrides: Iterable[str] = ()) -> S:
    """Read a scene.

    Parameters
    ----------
    model : type
        The model of a scene.
    path : str or Path
        TOML file.
    overrides : iterable of str, optional
        ``KEY=VALUE`` with dotted keys and values in TOML syntax; entries of lists of tables
        are addressed by name: ``rollers.r1.radius=0.3``.

    Returns
    -------
    model
        Paths in it are absolute; those in the file are relative to the file.

    Raises
    ------
    InputError
        With all mistakes at once.
    """
    source = Path(path)
    return validate_scene(model, parse_scene(_text_of(source), str(source)), source, overrides)


def validate_scene(
    model: type[S], tables: Mapping[str, Any], source: Path, overrides: Iterable[str] = ()
) -> S:
    """Return the scene of tables as they stand in a file; see :func:`read_scene`."""
    data, applied, mistakes = _overridden(_named(tables), overrides)
    data = _with_absolute_mesh(data, source)
    try:
        scene = model.model_validate(data)
    except ValidationError as error:
        mistakes += [_placed(m, source, applied) for m in _all_mistakes(model, error, data)]
    if mistakes:
        raise InputError(mistakes)
    return scene


def parse_scene(text: str, source: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Parameters
    ----------
    text : str
        The text.
    source : str
        Where it is from, for messages.

    Raises
    ------
    InputError
        If it is not TOML, or empty.
    """
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise _broken(source, None, "TOML of reasonable depth", "fewer brackets") from None
    except ValueError as error:
        raise _syntax_error(source, text, str(error)) from None
    if not data:
        raise _broken(source, None, "a scene; the file is empty", _STARTS)
    return data


def _syntax_error(source: str, text: str, message: str) -> InputError:
    """Return the error of text that is no TOML, with the line if it is known."""
    _, _, after = message.partition("(at line ")
    number = after.partition(",")[0]
    lines = text.splitlines()
    if not number.isdigit():
        return _broken(source, None, f"TOML: {message}", "valid TOML, see https://toml.io")
    line = lines[int(number) - 1] if int(number) <= len(lines) else None
    hint = "valid TOML: key = value, text in quotes, each key once"
    return InputError((Mistake(source, f"line {number}", line, f"TOML: {message}", hint),))


def _text_of(source: Path) -> str:
    try:
        return source.read_text(encoding="utf-8-sig")
    except IsADirectoryError:
        raise _broken(str(source), None, "a file, not a directory", "its scene.toml") from None
    except UnicodeDecodeError as error:
        expected = f"text in UTF-8; byte {error.start} is not"
        raise _broken(str(source), None, expected, "the same, saved as UTF-8") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        expected = f"a file that can be read ({reason})"
        raise _broken(str(source), None, expected, "the path of a scene in TOML") from None


def _broken(source: str, value: object, expected: str, hint: str) -> InputError:
    return InputError((Mistake(source, "", value, expected, hint),))


def _named(data: Mapping[str, Any]) -> dict[str, Any]:
    prefixes = {"rollers": "r", "stages": "stage"}
    return {
        key: with_default_names(value, prefixes[key]) if key in prefixes else value
        for key, value in data.items()
    }


def _overridden(
    data: dict[str, Any], texts: Iterable[str]
) -> tuple[dict[str, Any], list[Override], list[Mistake]]:
    applied: list[Override] = []
    mistakes: list[Mistake] = []
    for text in texts:
        try:
            override = Override.parse(text)
            data = override.applied_to(data)
        except InputError as error:
            mistakes += error.mistakes
        else:
            applied.append(override)
    return data, applied, mistakes


def _with_absolute_mesh(data: dict[str, Any], source: Path) -> dict[str, Any]:
    strip = data.get("strip")
    if not isinstance(strip, Mapping) or not isinstance(strip.get("mesh"), str):
        return data
    mesh = source.parent / strip["mesh"]
    return {**data, "strip": {**strip, "mesh": str(mesh.absolute())}}


def _all_mistakes(
    model: type[BaseModel], error: ValidationError, data: Mapping[str, Any]
) -> Iterable[Mistake]:
    """Yield pydantic's findings, then what is wrong between the tables that are right.

    Rules between tables are checked by pydantic only once every table is right; the user
    wants to hear of everything at once.
    """
    yield from mistakes_of(error, model, data)
    broken = {location[0] for found in error.errors() if (location := found["loc"])}
    if broken:
        yield from check_scene(_right_tables(model, data, broken))


def _right_tables(
    model: type[BaseModel], data: Mapping[str, Any], broken: set[int | str]
) -> dict[str, Any]:
    right = {name: field for name, field in model.model_fields.items() if name not in broken}
    given: dict[str, Any] = {name: field.annotation for name, field in right.items()}
    return {
        name: TypeAdapter(given[name]).validate_python(data[name])
        if name in data
        else field.get_default()
        for name, field in right.items()
    }


def _placed(mistake: Mistake, source: Path, applied: Sequence[Override]) -> Mistake:
    """Return a mistake with the place where it was typed."""
    set_by = [override.text for override in applied if override.covers(mistake.key)]
    return replace(mistake, file=f"--set {set_by[-1]}" if set_by else str(source))
