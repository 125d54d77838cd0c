"""From a TOML file to a scene that can be run, or to all that is wrong with it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from anmstrip.scene import rules
from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.naming import with_default_names
from anmstrip.scene.overrides import Override
from anmstrip.scene.schema import Scene
from anmstrip.scene.wording import mistakes_of

_STARTS = "[strip]\nlength = 4.0\nwidth = 1.0\nthickness = 1.0e-3\ncells = [16, 2]"


def load_scene(path: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """Read a scene.

    Parameters
    ----------
    path : str or Path
        TOML file.
    overrides : iterable of str, optional
        ``KEY=VALUE`` with dotted keys and values in TOML syntax; entries of lists of tables
        are addressed by name: ``rollers.r1.radius=0.3``.

    Returns
    -------
    Scene
        Paths in it are absolute; those in the file are relative to the file.

    Raises
    ------
    InputError
        With all mistakes at once.
    """
    source = Path(path)
    return scene_of(parse_scene(_text_of(source), str(source)), source, overrides)


def scene_of(tables: Mapping[str, Any], source: Path, overrides: Iterable[str] = ()) -> Scene:
    """Return the scene of tables as they stand in a file; see :func:`load_scene`."""
    data, applied, mistakes = _overridden(_named(tables), overrides)
    data = _with_absolute_mesh(data, source)
    try:
        scene = Scene.model_validate(data)
    except ValidationError as error:
        mistakes += [_placed(m, source, applied) for m in _all_mistakes(error, data)]
    if mistakes:
        raise InputError(mistakes)
    scene._source = source
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


def _all_mistakes(error: ValidationError, data: Mapping[str, Any]) -> Iterable[Mistake]:
    """Yield pydantic's findings, then what is wrong between the tables that are right.

    Rules between tables are checked by pydantic only once every table is right; the user
    wants to hear of everything at once.
    """
    yield from mistakes_of(error, Scene, data)
    broken = {location[0] for found in error.errors() if (location := found["loc"])}
    if broken:
        yield from rules.scene(_right_tables(data, broken))


def _right_tables(data: Mapping[str, Any], broken: set[int | str]) -> dict[str, Any]:
    right = {name: field for name, field in Scene.model_fields.items() if name not in broken}
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
