"""From pydantic's findings to mistakes that a user can act on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from anmstrip.errors import InputError, Mistake, nearest
from anmstrip.scene.tables import EDGE_NAMES, LARGEST, SMALLEST, STAGE_KEYS, example_of


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
        location, value = found["loc"], found["input"]
        if found["type"] == "too_short" and value:
            continue  # not short: its entries are wrong, and are told themselves
        # Every key that is no field of a stage is an edge's name; but a number is no edge, and
        # `rolers` is not one either.
        misspelt = len(location) > 3 and (location[0], location[2]) == ("stages", "edges")
        misspelt = misspelt and (
            (len(location) == 4 and found["type"] == "model_type")
            or bool(get_close_matches(str(location[3]), ["rollers"], cutoff=0.8))
        )
        place = find_place(location[:4] if misspelt else location, model, data)
        key, field = ".".join(place.keys), place.field
        inner = found.get("ctx", {}).get("error")
        if isinstance(inner, InputError):
            for mistake in inner.mistakes:
                yield replace(mistake, key=".".join(filter(None, (key, mistake.key))))
        elif misspelt or found["type"] == "extra_forbidden":
            known = list(place.table.model_fields) if place.table else []
            known = [*STAGE_KEYS, *EDGE_NAMES] if misspelt else known
            yield Mistake("", key, value, "a known key", nearest(place.keys[-1], known))
        elif field is None:
            yield Mistake("", key, value, "a table of the scene", "[strip]")
        else:
            value = None if found["type"] == "missing" and not place.item else value
            expected = str(field.description)
            if isinstance(value, float) and (abs(value) > LARGEST or 0.0 < value < SMALLEST):
                expected += (
                    f"; numbers are at most {LARGEST:g}, and {SMALLEST:g} at least if positive"
                )
            yield Mistake("", key, value, expected, example_of(place.name, field))


@dataclass(frozen=True)
class Place:
    """A place in the tables of a scene at which pydantic found something."""

    keys: tuple[str, ...]  # as `--set` takes them
    table: type[BaseModel] | None  # the model whose keys may stand here
    field: FieldInfo | None  # the last field on the way
    name: str  # of this field
    item: bool  # whether the place is one component of the field's value


def find_place(
    location: tuple[int | str, ...], model: type[BaseModel], data: Mapping[str, Any]
) -> Place:
    """Follow a location of pydantic through the fields of the models."""
    keys: list[str] = []
    table: type[BaseModel] | None = model
    entries: type[BaseModel] | None = None  # the model of the entries of a collection
    field, name, item = None, "", False
    for part in location:
        if entries is not None:
            key: object = part
            if isinstance(part, int):  # an entry of a list of tables goes by its name
                entry = data[keys[0]][part]
                key = entry.get("name") if isinstance(entry, Mapping) else None
            keys.append(key if isinstance(key, str) else str(int(part) + 1))
            table, entries = entries, None
        elif table is not None and part in table.model_fields:
            name = str(part)
            keys.append(name)
            field, item = table.model_fields[name], False
            kinds = (field.annotation, *get_args(field.annotation))
            models = [k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel)]
            table, entries = (models[0] if models else None), None
            if get_origin(field.annotation) in (tuple, dict):
                table, entries = None, table
        elif isinstance(part, str):
            keys.append(part)
        else:
            item = True
    if len(location) > 3 and (location[0], location[2]) == ("stages", "edges"):
        del keys[2]  # edges stand beside the other keys of a stage
    return Place(tuple(keys), table, field, name, item)
