"""Pages made from the program itself: keys of a scene, claims of the tests, notation."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

import anmstrip
from anmstrip.scene.schema import SceneSpec, json_schema
from anmstrip.scene.tables import meanings

DOCS = Path(__file__).parent
MADE = DOCS / "generated"


def write_all() -> None:
    """Write all generated pages into ``docs/generated``."""
    MADE.mkdir(exist_ok=True)
    pages = {
        "scene_keys.md": "\n".join(key_tables()),
        "scene.schema.json": json.dumps(json_schema(), indent=1, ensure_ascii=False),
        "claims.md": "\n".join(claim_table(read_claims())),
        "notation.rst": str(anmstrip.__doc__),
    }
    for name, text in pages.items():
        page = MADE / name
        if not page.exists() or page.read_text("utf-8") != text:  # Sphinx rebuilds what is newer
            page.write_text(text, encoding="utf-8")


def inner_models(field: FieldInfo) -> list[type[BaseModel]]:
    """Return the tables that a field of a scene contains, one or several of them."""
    parts = [field.annotation, *get_args(field.annotation)]
    parts += [inner for part in parts for inner in get_args(part)]
    return list(dict.fromkeys(p for p in parts if isinstance(p, type) and issubclass(p, BaseModel)))


def key_tables() -> Iterator[str]:
    """Yield a section for every table of a scene, with a row for each of its keys."""
    yield from table_of(SceneSpec, "")
    for name, field in SceneSpec.model_fields.items():
        for model in inner_models(field):
            several = "[[{}]]" if name in ("rollers", "stages") else "[{}]"
            yield from section(model, several.format(f"{name}.NAME" if name == "edges" else name))


def section(model: type[BaseModel], head: str) -> Iterator[str]:
    """Yield the section of a table, and after it those of the tables in it."""
    yield f"\n## `{head}`\n"
    yield from table_of(model, head)
    place = head.strip("[]")
    for name, field in model.model_fields.items():
        for inner in inner_models(field):
            path = {"edges": "EDGE", "rollers": "rollers.NAME"}.get(name, name)
            yield from section(inner, f"{place}.{path}")


def table_of(model: type[BaseModel], head: str) -> Iterator[str]:
    """Yield the sentence of a table and its keys: meaning, unit, default, example."""
    text = " ".join(str(model.__doc__).partition("Examples")[0].split())
    yield f"{text}\n\n| key | meaning | unit | default | example |\n|---|---|---|---|---|"
    own = model.__annotations__  # first; what tables share comes after
    for name, field in sorted(model.model_fields.items(), key=lambda item: item[0] not in own):
        if name == "edges" and head == "[[stages]]":
            continue  # every other key of a stage is the name of an edge
        meaning, _, unit = meanings(model)[name].rpartition(" (")
        unit, example = unit.removesuffix(")"), str((field.examples or [""])[0])
        if not meaning:
            meaning, unit = meanings(model)[name], ""
        shown = "a table" if "\n" in example else f"`{example}`"
        cells = (f"`{name}`", meaning, unit, default_of(field), shown)
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def default_of(field: FieldInfo) -> str:
    """Return the default of a key as it would be typed; nothing where it has none."""
    if field.is_required():
        return "required"
    value = field.default
    if value is None or value in ((), {}, "") or isinstance(value, BaseModel):
        return ""
    return f"`{json.dumps(value)}`"


def read_claims() -> list[dict[str, Any]]:
    """Read what the tests have recorded: of this run of them, else as committed."""
    chosen = Path(os.environ.get("ANMSTRIP_CLAIMS", DOCS / "claims.jsonl"))
    lines = chosen.read_text("utf-8").splitlines()
    found = {(c["test"], c["quantity"]): c for c in map(json.loads, lines)}
    return sorted(found.values(), key=lambda c: (c["test"], c["quantity"]))


def claim_table(claims: Iterable[dict[str, Any]]) -> Iterator[str]:
    """Yield a row for each claim."""
    heads = ("quantity", "reference", "its value", "computed", "error", "bound", "test")
    yield f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|"
    for claim in claims:
        numbers = (f"{claim[key]:.6g}" for key in ("expected", "value"))
        errors = (f"{claim[key]:.2g}" for key in ("error", "bound"))
        cells = (claim["quantity"], claim["reference"], *numbers, *errors, f"`{claim['test']}`")
        yield "| " + " | ".join(cells) + " |"
