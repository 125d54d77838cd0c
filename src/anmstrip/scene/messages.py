"""From pydantic's findings to mistakes that a user can act on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, cast, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from anmstrip.errors import InputError, Mistake

SMALLEST, LARGEST = 1e-30, 1e30
"""Bounds of numbers in a scene, so that no product of a handful of them over- or underflows."""


def nearest(word: str, known: Iterable[str]) -> str:
    """Return the hint for an unknown word: the nearest known one, else all of them.

    Examples
    --------
    >>> nearest("thicknes", ["width", "thickness"])
    'thickness (the nearest known one)'
    >>> nearest("colour", ["width", "thickness"])
    'one of: width, thickness'
    """
    known = list(known)
    matches = get_close_matches(word.lower(), known, n=1, cutoff=0.6)
    if matches:
        return f"{matches[0]} (the nearest known one)"
    return f"one of: {', '.join(known)}" if known else "nothing; take it out"


def example_of(key: str, field: FieldInfo) -> str:
    """Return what to type for a field: its example in TOML.

    Parameters
    ----------
    key : str
        Name of the field.
    field : FieldInfo
        Its first example is TOML text: a value, or whole tables if it begins with ``[``.
    """
    example = str((field.examples or ["…"])[0])
    return example if example.startswith("[[") or "]\n" in example else f"{key} = {example}"


def missing(model: type[BaseModel], key: str) -> Mistake:
    """Return the mistake of having left out a field of a model."""
    field = model.model_fields[key]
    return Mistake("", key, None, str(field.description), example_of(key, field))


def mistakes_of(
    error: ValidationError, model: type[BaseModel], data: Mapping[str, Any]
) -> Iterator[Mistake]:
    """Translate what pydantic found.

    Parameters
    ----------
    error : ValidationError
        Raised by validating `data`.
    model : type of BaseModel
        The outermost model.
    data : mapping
        What was validated; entries of lists of tables are addressed by their ``name``.

    Yields
    ------
    Mistake
        Without its file.
    """
    for found in error.errors(include_url=False):
        if found["type"] == "too_short" and found["input"]:
            continue  # not short: its entries are wrong, and are told themselves
        misspelt = _misspelt(found)
        place = _place_of(misspelt or found["loc"], model, data)
        inner = found.get("ctx", {}).get("error")
        if isinstance(inner, InputError):
            for mistake in inner.mistakes:
                yield replace(mistake, key=".".join(filter(None, (place.key, mistake.key))))
        elif misspelt or found["type"] == "extra_forbidden":
            yield _unknown(place, found["input"])
        else:
            value = None if found["type"] == "missing" and not place.item else found["input"]
            yield _refused(place, value)


@dataclass(frozen=True)
class _Place:
    """Where in the schema a finding lies."""

    keys: tuple[str, ...]
    field: FieldInfo | None
    name: str
    """Name of the field."""
    model: type[BaseModel] | None
    """The model whose keys may stand here."""
    item: bool
    """Whether the finding is about one component of the field's value."""

    @property
    def key(self) -> str:
        return ".".join(self.keys)


def _place_of(
    location: tuple[int | str, ...], model: type[BaseModel], data: Mapping[str, Any]
) -> _Place:
    place = _Place((), None, "", model, False)
    waiting: type[BaseModel] | None = None  # the model of the entries of a collection
    for depth, part in enumerate(location):
        if waiting is not None:
            name = _entry_name(data, location[: depth + 1])
            place, waiting = replace(place, keys=(*place.keys, name), model=waiting), None
        elif place.model is not None and part in place.model.model_fields:
            place, waiting = _entered(place, str(part))
        elif isinstance(part, str):
            place = replace(place, keys=(*place.keys, part))
        else:
            place = replace(place, item=True)
    if len(location) > 3 and (location[0], location[2]) == ("stages", "edges"):
        place = replace(place, keys=place.keys[:2] + place.keys[3:])
    return place


def _entered(place: _Place, name: str) -> tuple[_Place, type[BaseModel] | None]:
    """Step into a field; a collection has its entries' model wait for the next step."""
    assert place.model is not None
    field = place.model.model_fields[name]
    inner = _model_in(field.annotation)
    collection = get_origin(field.annotation) in (tuple, dict)
    entered = _Place((*place.keys, name), field, name, None if collection else inner, False)
    return entered, inner if collection else None


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if arguments := get_args(annotation):
        return next((found for a in arguments if (found := _model_in(a)) is not None), None)
    is_model = isinstance(annotation, type) and issubclass(annotation, BaseModel)
    return annotation if is_model else None


def _entry_name(data: Mapping[str, Any], location: tuple[int | str, ...]) -> str:
    """Return the name of an entry: its own for a list of tables, else its key."""
    last = location[-1]
    if isinstance(last, str):
        return last
    entry = data[str(location[0])][last]
    name = entry.get("name") if isinstance(entry, Mapping) else getattr(entry, "name", None)
    return name if isinstance(name, str) else str(last + 1)


def _misspelt(found: Any) -> tuple[int | str, ...]:
    """Return where a stage's key was taken for an edge, empty if none was.

    Every key that is no field of a stage is an edge's name; but a number is no edge, and
    ``rolers`` is not one either.
    """
    location = found["loc"]
    if len(location) < 4 or (location[0], location[2]) != ("stages", "edges"):
        return ()
    is_value = len(location) == 4 and found["type"] == "model_type"
    is_rollers = get_close_matches(str(location[3]), ["rollers"], cutoff=0.8)
    return tuple(location[:4]) if is_value or is_rollers else ()


def _unknown(place: _Place, value: object) -> Mistake:
    extra = place.field.json_schema_extra if place.field else None
    known = [] if place.model is None else list(place.model.model_fields)
    if isinstance(extra, dict) and "keys" in extra and len(place.keys) == 3:
        known = [str(key) for key in cast(list[object], extra["keys"])]
    return Mistake("", place.key, value, "a known key", nearest(place.keys[-1], known))


def _refused(place: _Place, value: object) -> Mistake:
    if place.field is None:
        return Mistake("", place.key, value, "a table of the scene", "[strip]")
    expected = str(place.field.description)
    if isinstance(value, float) and (abs(value) > LARGEST or 0.0 < value < SMALLEST):
        expected += f"; numbers are at most {LARGEST:g}, and {SMALLEST:g} at least if positive"
    return Mistake("", place.key, value, expected, example_of(place.name, place.field))
