"""Input errors: every mistake at once, each with what to type instead."""

from __future__ import annotations

import reprlib
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import NoReturn, TypeVar

Value = TypeVar("Value")

MAX_LISTED = 100
"""Mistakes that a message lists: more of them are one and the same, made by a program."""


@dataclass(frozen=True)
class Mistake:
    """One thing in an input that has to be changed before anything can run.

    Examples
    --------
    >>> print(Mistake("s.toml", "strip.width", -1.0, "a number above 0 (m)", "width = 1.0"))
    s.toml: strip.width
      given:    -1.0
      expected: a number above 0 (m)
      type:     width = 1.0
    """

    file: str  # the file, or the option of the command line, where it was typed
    key: str  # dotted, as ``--set`` takes it: rollers.r1.radius; empty for a whole file
    value: object  # as given; None if nothing was
    expected: str  # with its unit
    hint: str  # text that the user can type instead

    def __str__(self) -> str:
        lines = [": ".join(part for part in (self.file, self.key) if part)]
        lines.append(f"  given:    {toml_text(self.value)}")
        lines.append(f"  expected: {self.expected}")
        lines.append(f"  type:     {self.hint.replace(chr(10), chr(10) + ' ' * 12)}")
        return printable("\n".join(lines))


class InputError(ValueError):
    """The input cannot be run; nothing was written.

    A ValueError, so that the checks of a model may raise it.

    Parameters
    ----------
    mistakes : iterable of Mistake
        All that is wrong, in the order in which it should be read.
    """

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__(self.mistakes)

    def __str__(self) -> str:
        lines = [str(mistake) for mistake in self.mistakes[:MAX_LISTED]]
        if (more := len(self.mistakes) - MAX_LISTED) > 0:
            lines.append(f"and {more} more mistakes")
        return "\n".join(lines)


def printable(text: str) -> str:
    r"""Return a text without what would steer a terminal; lines stay.

    Examples
    --------
    >>> printable("r1\x1b[2J")
    'r1\\x1b[2J'
    """
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text
    )


def nearest(word: str, known: Iterable[str]) -> str:
    """Return the hint for an unknown word: the nearest known one, else all of them.

    Examples
    --------
    >>> nearest("thicknes", ["width", "thickness"])
    'thickness (the nearest known one)'
    >>> nearest("colour", ["width", "thickness"])
    'one of: width, thickness'
    """
    known = list(dict.fromkeys(known))
    small = {name.lower(): name for name in known}
    if matches := get_close_matches(word.lower(), small, n=1, cutoff=0.6):
        return f"{small[matches[0]]} (the nearest known one)"
    known = [*known[:MAX_LISTED], "…"] if len(known) > MAX_LISTED else known
    return f"one of: {', '.join(known)}" if known else "nothing; take it out"


def as_path(name: str, given: object) -> Path:
    """Return the path that a function is given as an argument, or refuse what is none."""
    if not isinstance(given, str | PathLike):
        raise TypeError(f"expected a path, as a text or a Path; given {name}={given!r}")
    return Path(given)


def require_parent(option: str, path: Path) -> None:
    """Refuse a file to be written into a directory that is not there."""
    if not path.parent.is_dir():
        expected = f"a file in a directory that exists; {path.parent} does not"
        here, parent = shlex.quote(path.name), shlex.quote(str(path.parent))
        hint = f"{option} {here}, or mkdir -p {parent} before"
        raise InputError([Mistake(option, "", str(path), expected, hint)])


def as_texts(name: str, given: object) -> list[str]:
    """Return the texts that a function is given, also a single one, or refuse what are none.

    Examples
    --------
    >>> as_texts("overrides", "friction.coefficient=0.2")
    ['friction.coefficient=0.2']
    """
    if isinstance(given, str):
        return [given]
    if not isinstance(given, Iterable):
        raise TypeError(f"expected a list of texts; given {name}={given!r}")
    return [str(text) for text in given]


class Named(dict[str, Value]):
    """Things by name; for an unknown name it tells the nearest one.

    Examples
    --------
    >>> Named(entry=1.0, exit=2.0)["exi"]
    Traceback (most recent call last):
    KeyError: "no 'exi' here: exit (the nearest known one)"
    """

    def __missing__(self, name: object) -> NoReturn:
        raise KeyError(f"no {name!r} here: {nearest(str(name), self)}")


def toml_text(value: object) -> str:
    """Return a value as it looks in TOML, shortened.

    Examples
    --------
    >>> toml_text(None), toml_text(True), toml_text("tanh"), toml_text((1, 2))
    ('nothing', 'true', '"tanh"', '[1, 2]')
    >>> toml_text({"surface_speed": 1.0, "release": True})
    '{ surface_speed = 1.0, release = true }'
    """
    if value is None:
        return "nothing"
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= 120 else f'"{value[:117]}…"'
    return ShortRepr().repr(value)


class ShortRepr(reprlib.Repr):
    """Nested values in TOML, cut short; integers of thousands of digits Python refuses to print."""

    def repr_bool(self, x: bool, level: int) -> str:
        return str(x).lower()

    def repr_tuple(self, x: tuple[object, ...], level: int) -> str:
        return self.repr_list(list(x), level)

    def repr_dict(self, x: dict[str, object], level: int) -> str:
        if level <= 0 or not x:
            return "{ … }" if x else "{}"
        entries = [f"{key} = {self.repr1(value, level - 1)}" for key, value in x.items()]
        more = [*entries[: self.maxdict], *(["…"] if len(entries) > self.maxdict else [])]
        return f"{{ {', '.join(more)} }}"

    def repr_int(self, x: int, level: int) -> str:
        huge = x.bit_length() > 200
        return "an integer of more than 60 digits" if huge else super().repr_int(x, level)
