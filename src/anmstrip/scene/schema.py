"""The scene as a whole: its tables, made in Python or read from a file, or all their mistakes."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Set, ValuesView
from contextlib import suppress
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self, get_args, get_origin

import numpy as np
from pydantic import (
    BaseModel,
    Field,
    PrivateAttr,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo

from anmstrip.errors import InputError, Mistake, as_path, as_texts, nearest
from anmstrip.scene import hints
from anmstrip.scene import tables as scene_tables
from anmstrip.scene.checks import DRIVES, KEY_RULES, check_scene
from anmstrip.scene.tables import (
    EDGE_NAMES,
    ENDS,
    LARGEST_NUMBER,
    SMALLEST_NUMBER,
    STAGE_KEYS,
    THREADING,
    ContactSpec,
    EdgeSpec,
    FrictionSpec,
    MaterialSpec,
    NaturalShape,
    OutputSpec,
    RollerSpec,
    SolverSpec,
    StageSpec,
    StripSpec,
    Table,
    ThreadingSpec,
    example_of,
    has_velocity,
    meanings,
)


class SceneSpec(Table):
    """A strip, what it touches, what happens to it, and how that is solved.

    Examples
    --------
    >>> scene = SceneSpec(
    ...     strip={"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [16, 2]},
    ...     material={"young": 2e11, "poisson": 0.3},
    ...     stages=[{"duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}}],
    ... )
    >>> scene.stages[0].name, scene.stages[0].edges["exit"].force
    ('stage1', (10000.0, 0.0, 0.0))
    """

    title: str = Field("", examples=['"Strip over a roller"'])
    """title (text)"""
    strip: StripSpec = Field(
        examples=["[strip]\nlength = 4.0\nwidth = 1.0\nthickness = 1.0e-3\ncells = [16, 2]"]
    )
    """the strip, a table (m)"""
    material: MaterialSpec = Field(examples=["[material]\nyoung = 2.0e11\npoisson = 0.3"])
    """the material, a table (Pa)"""
    contact: ContactSpec | None = Field(None, examples=["[contact]"])
    """contact with the rollers, a table (Pa, m)"""
    friction: FrictionSpec | None = Field(None, examples=["[friction]\ncoefficient = 0.3"])
    """friction on the rollers, a table (1, m/s)"""
    threading: ThreadingSpec | None = Field(None, examples=["[threading]\ntension = 1.0e4"])
    """how the strip is laid around the rollers, a table (N/m, m)"""
    rollers: tuple[RollerSpec, ...] = Field(
        (),
        examples=["[[rollers]]\nradius = 0.5\ncentre = [0.0, 0.0, -0.501]\naxis = [0.0, 1.0, 0.0]"],
    )
    """rollers, a list of tables (m)"""
    edges: dict[str, EdgeSpec] = Field({}, examples=['[edges.entry]\nfixed = ["x", "z"]'])
    """how edges are held, a table for each"""
    stages: Annotated[tuple[StageSpec, ...], Field(min_length=1)] = Field(
        examples=["[[stages]]\nduration = 1.0"]
    )
    """what happens, a list of at least one table (s)"""
    solver: SolverSpec = Field(SolverSpec(), examples=["[solver]\norder = 20"])
    """the solver, a table (1)"""
    output: OutputSpec = Field(OutputSpec(), examples=["[output]\nevery = 1"])
    """the output, a table (1)"""

    _source: Path | None = PrivateAttr(None)

    def __init__(self, /, **tables: Any) -> None:
        right: dict[str, Any] = {}  # tables without mistakes of their own
        found: list[Mistake] = []
        tables = with_implied_tables(of_python(tables))
        try:
            self.__pydantic_validator__.validate_python(tables, self_instance=self, context=right)
        except ValidationError as error:
            found += told_once(mistakes_of(error, type(self), tables))
        misspelt = meant_keys(found)  # tables that are there under another name
        for name, field in type(self).model_fields.items():
            if not (name in tables or (name,) in misspelt or field.is_required()):
                right[name] = field.get_default()
        threading, strip = right.get("threading"), right.get("strip")
        labels_stay = (strip and strip.feed) or (threading and threading.closed)
        if right.get("friction") and "stages" in right and not labels_stay:
            right["stages"] = tuple(with_entries_released(right["stages"]))
            self.__dict__["stages"] = right["stages"]
        found += check_scene(right)
        if not {"stages", "rollers"} <= right.keys():
            told = {mistake.key for mistake in found}
            typed: dict[str, Any] = {"stages": stages_as_typed(tables.get("stages"))}
            if rollers := rollers_as_typed(tables.get("rollers")):
                typed["rollers"] = rollers
            between = check_scene({**typed, **right}, KEY_RULES)
            found += (mistake for mistake in between if mistake.key not in told)
        if found:
            raise InputError(replace(mistake, file=mistake.file or "Scene") for mistake in found)

    def __repr__(self) -> str:
        kind = f"{type(self).__name__} {self.title or self.name!r}"
        return f"<{kind}: {len(self.rollers)} rollers, {len(self.course)} stages>"

    @field_validator("*", mode="wrap")
    @classmethod
    def _keep_what_is_right(cls, given: Any, validate: Callable[[Any], Any], info: Any) -> Any:
        """Keep tables that are right for the checks between them, whatever the others are like."""
        info.context[info.field_name] = right = validate(given)
        return right

    @model_validator(mode="after")
    def _strict_for_small_shapes(self) -> Self:
        """Ask for more of a strip that is bent a little, unless its tolerance was typed."""
        if self.strip.imperfection is not None and "tolerance" not in self.solver.model_fields_set:
            self.__dict__["solver"] = self.solver.model_copy(update={"tolerance": 1e-6})
        return self

    @classmethod
    def load(cls, path: str | Path, overrides: Iterable[str] = ()) -> Self:
        """Read a scene file.

        Parameters
        ----------
        path : str or Path
            TOML file.
        overrides : iterable of str, or str, optional
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
        source = as_path("path", path)
        return cls.from_tables(parse_scene(read_text(source), str(source)), source, overrides)

    @classmethod
    def from_tables(
        cls, tables: Mapping[str, Any], source: str | Path, overrides: Iterable[str] = ()
    ) -> Self:
        """Return the scene of tables as they would stand in a file; see :meth:`load`."""
        if not isinstance(tables, Mapping):
            raise TypeError(f"expected the tables of a scene, as a dict; given tables={tables!r}")
        source, data = as_path("source", source), with_implied_tables(tables)
        applied, mistakes = list[Override](), list[Mistake]()
        for text in as_texts("overrides", overrides):
            try:
                override = Override.parse(text)
                data = override.applied_to(data)
            except InputError as error:
                mistakes += error.mistakes
            else:
                applied.append(override)
        strip = data.get("strip")
        if isinstance(strip, Mapping) and isinstance(mesh := strip.get("mesh"), str):
            data["strip"] = {**strip, "mesh": str((source.parent / mesh).absolute())}
        try:
            scene = cls(**data)
        except InputError as error:
            for m in error.mistakes:
                set_by = [override.text for override in applied if override.covers(m.key)]
                mistakes.append(replace(m, file=f"--set {set_by[-1]}" if set_by else str(source)))
        for override in applied:
            if not any(override.covers(mistake.key) for mistake in mistakes):
                mistakes += override.unquoted()
        if mistakes:
            raise InputError(mistakes)
        scene._source = source
        return scene

    @property
    def course(self) -> tuple[StageSpec, ...]:
        """All stages in their order, that of threading first if there is one."""
        if self.threading is None:
            return self.stages
        threading = StageSpec(name=THREADING, duration=self.threading.duration, friction=False)
        return (threading, *self.stages)

    def up_to(self, stage: StageSpec) -> tuple[StageSpec, ...]:
        """Return the stages up to one, or all of them and one that is not among them."""
        course = self.course
        names = [each.name for each in course]
        before = course[: names.index(stage.name)] if stage.name in names else course
        return *before, stage

    def with_values(self, **tables: dict[str, object]) -> Self:
        """Return the scene with other values of keys in some of its tables, unchecked."""
        copies = {name: getattr(self, name).model_copy(update=new) for name, new in tables.items()}
        return self.model_copy(update=copies)

    @property
    def ends(self) -> list[float]:
        """Instants at which all stages end (s), added up one after the other as steps do."""
        return list(accumulate(stage.duration for stage in self.course))

    @property
    def shapes(self) -> tuple[NaturalShape, ...]:
        """Shapes of the strip unstressed: from the beginning, and by stages."""
        return (self.strip, *(stage.strip for stage in self.stages))

    @property
    def released(self) -> set[str]:
        """Edges that stages let go."""
        return {name for stage in self.stages for name, edge in stage.edges.items() if edge.release}

    def held_in(self, component: str) -> list[str]:
        """Return the edges that are held in a component, as long as no stage lets them go."""
        return [name for name, edge in self.edges.items() if component in edge.fixed]

    @property
    def clamped(self) -> list[str]:
        """Edges that keep their slope, as long as no stage lets them go."""
        return [name for name, edge in self.edges.items() if edge.clamped]

    def as_typed(self, control: str) -> str:
        """Return the key of a control in a scene, that of a tension for the force that it makes."""
        name, _, key = control.partition(".")
        given = [stage.edges[name] for stage in self.stages if name in stage.edges]
        tension = self.threading is not None or any(edge.tension is not None for edge in given)
        typed = key == "force" and tension and all(edge.force is None for edge in given)
        return f"{name}.tension" if typed else control

    @property
    def source(self) -> Path | None:
        """The file from which the scene was read, if it was."""
        return self._source

    @property
    def name(self) -> str:
        """Short name for directories: the stem of the scene's file."""
        return "scene" if self._source is None else self._source.stem

    def mistake(self, key: str, value: object, expected: str, hint: str) -> Mistake:
        """Return a mistake of this scene, with its file, see :class:`Mistake`."""
        return Mistake(str(self.source or "scene"), key, value, expected, hint)

    def refused(self, key: str, value: object, expected: str, hint: str) -> InputError:
        """Return the error of a single mistake of this scene."""
        return InputError([self.mistake(key, value, expected, hint)])

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as used, defaults included, as it would be typed; JSON-ready."""
        scene = self.model_dump(mode="json", exclude_none=True)
        for stage, given in zip(scene["stages"], self.stages, strict=True):
            stage["friction"] = stage["friction"] and self.friction is not None
            for name, edge in given.edges.items():
                if "release" not in edge.model_fields_set:  # an edge stays free once it is let go
                    del stage["edges"][name]["release"]
            stage.update(stage.pop("edges"))
        if self.friction is not None:
            for key in {"exponent", "omega"}.difference(self.friction.constants):
                del scene["friction"][key]
        return scene


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of a scene file, by which editors complete and check it.

    What pydantic makes of the models, with what files may leave out besides: names, and the
    duration of stages of which nothing depends on time; and with the names of edges as keys of a
    stage.
    """
    schema = SceneSpec.model_json_schema()
    tables = schema["$defs"]
    tables["RollerSpec"]["required"].remove("name")
    stage = tables["StageSpec"]
    stage["required"] = []
    stage["additionalProperties"] = stage["properties"].pop("edges")["additionalProperties"]
    for name, table in {"SceneSpec": schema, **tables}.items():
        table["description"] = table["description"].partition("\n\n")[0]
        model = vars(scene_tables).get(name, SceneSpec)
        for key, value in table["properties"].items():
            value["description"] = meanings(model)[key]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


@dataclass(frozen=True)
class Override:
    """One value to put into a scene."""

    text: str  # as it was typed
    path: tuple[str, ...]  # keys from the outside in; entries of lists of tables by their name
    value: object
    bare: bool = False  # whether the value is no TOML: a text without its quotes, or a mistake

    @classmethod
    def parse(cls, text: str) -> Override:
        """Read ``KEY=VALUE``, the key dotted and the value in TOML syntax.

        What is no TOML is taken for text, of which the key says what it would have been.

        Raises
        ------
        InputError
            If it is not of this form.

        Examples
        --------
        >>> Override.parse("rollers.r1.radius=0.3").path
        ('rollers', 'r1', 'radius')
        """
        name, equals, typed = (part.strip() for part in text.partition("="))
        inside: Any = None
        with suppress(ValueError, RecursionError):
            inside = None if "\n" in name else tomllib.loads(f"{name} = 0")
        path: list[str] = []
        while isinstance(inside, Mapping) and len(inside) == 1:
            path.extend(inside)
            inside = inside[path[-1]]
        if not equals or not path:
            wrong = (name, "a dotted key") if equals else (text, "KEY=VALUE")
            raise wrong_override(text, wrong[0], None, wrong[1], "--set friction.coefficient=0.2")
        key = ".".join(path)
        try:
            (value,) = tomllib.loads(f"value = {typed}").values()
        except (ValueError, RecursionError):
            pointed = hints.as_toml(f"{key}={typed}")
            if pointed is not None and '"' not in pointed and not cls.parse(pointed).bare:
                hint = f"--set {pointed}"
                raise wrong_override(text, key, typed, "a value in TOML syntax", hint) from None
            return cls(text, tuple(path), typed, bare=True)
        return cls(text, tuple(path), value)

    def unquoted(self) -> list[Mistake]:
        """Return the mistake of a text that is right but for its quotes, if it is one."""
        key, hint = ".".join(self.path), shlex.quote(f'{".".join(self.path)}="{self.value}"')
        wrong = wrong_override(self.text, key, self.value, "text in quotes", f"--set {hint}")
        return list(wrong.mistakes) if self.bare else []

    def covers(self, key: str) -> bool:
        """Return whether a dotted key is the one set, below it, or a table around it."""
        own = ".".join(self.path)
        return key == own or key.startswith(f"{own}.") or own.startswith(f"{key}.")

    def applied_to(self, tables: Any, depth: int = 0) -> Any:
        """Return tables with the value put in; those that are not there are made.

        Parameters
        ----------
        tables : mapping, or list of mappings with a name
        depth : int, optional
            Number of keys of the path that lead to `tables`.

        Raises
        ------
        InputError
            If the path leads through something that is no table, or to an unknown name.
        """
        if depth == len(self.path):
            return self.value
        head = self.path[depth]
        if isinstance(tables, Mapping):
            return {**tables, head: self.applied_to(tables.get(head, {}), depth + 1)}
        key = ".".join(self.path[:depth])
        if not isinstance(tables, list | tuple):
            raise wrong_override(self.text, key, tables, "a table", f"--set {key}=… with a value")
        if tables and not any(isinstance(table, Mapping) for table in tables):
            hint = f"--set {shlex.quote(f'{key}={list(tables)}')} with other numbers"
            raise wrong_override(self.text, key, tables, "all of its numbers together", hint)
        names = [table.get("name") if isinstance(table, Mapping) else None for table in tables]
        if head not in names:
            key, known = ".".join(self.path), [name for name in names if isinstance(name, str)]
            raise wrong_override(self.text, key, head, "a known name", nearest(head, known))
        pairs = zip(tables, names, strict=True)
        return [self.applied_to(each, depth + 1) if name == head else each for each, name in pairs]


def wrong_override(text: str, key: str, value: object, expected: str, hint: str) -> InputError:
    """Return the error of an option ``--set``."""
    return InputError([Mistake(f"--set {text}", key, value, expected, hint)])


def of_python(value: Any) -> Any:
    """Return what is typed with numpy's numbers and arrays as Python's, deep in tables and lists.

    Iterators and sets become lists, and keys of tables texts.

    Examples
    --------
    >>> of_python({"cells": np.array([8, 1]), "stages": [{"duration": np.float64(1.0)}]})
    {'cells': [8, 1], 'stages': [{'duration': 1.0}]}
    """
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {str(key): of_python(each) for key, each in value.items()}
    if isinstance(value, Iterator | Set | ValuesView):
        value = list(value)
    return type(value)(map(of_python, value)) if type(value) in (list, tuple) else value


def with_implied_tables(scene: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a scene with all that they imply.

    Names for all rollers and stages; contact, where there are rollers or friction; the entry held,
    against which strip is threaded; and a duration of stages of which nothing depends on time.

    Examples
    --------
    >>> with_implied_tables({"rollers": [{"radius": 1.0}, {"name": "big"}]})
    {'rollers': [{'name': 'r1', 'radius': 1.0}, {'name': 'big'}], 'contact': {}}
    """
    named = dict(scene)
    if scene.get("contact") is None and (scene.get("rollers") or "friction" in scene):
        named["contact"] = {}
    threading, edges = scene.get("threading"), scene.get("edges", {})
    if isinstance(threading, Mapping) and not threading.get("closed"):
        entry = edges.get("entry", {}) if isinstance(edges, Mapping) else None
        if isinstance(entry, Mapping):
            named["edges"] = {**edges, "entry": {"fixed": ["x", "z"], **entry}}
    for key, prefix in (("rollers", "r"), ("stages", "stage")):
        if isinstance(tables := scene.get(key), list | tuple):
            named[key] = [
                {"name": f"{prefix}{position}", **table} if isinstance(table, Mapping) else table
                for position, table in enumerate(tables, start=1)
            ]
    material, stages = scene.get("material"), named.get("stages")
    in_time = "friction" in scene or (isinstance(material, Mapping) and "plasticity" in material)
    for table in stages if isinstance(stages, list) and not in_time else ():
        if isinstance(table, dict) and not any(map(has_velocity, table.values())):
            table.setdefault("duration", 1.0)
    return named


LEADING_KEYS = {"move", "velocity", "speed", "force", "release"}
"""Keys of an edge in a stage that say how it is led, or that it is not."""


def with_entries_released(stages: Iterable[StageSpec]) -> Iterator[StageSpec]:
    """Yield stages whose entry is released where it can keep its tension only so.

    These are stages in time that follow a steady one with the tension of the entry given, unless
    they say themselves how the entry is led.
    """
    pulled = False
    for stage in stages:
        entry = stage.edge("entry")
        if stage.steady:
            pulled = stage.strip.speed is None and (pulled or entry.tension is not None)
        elif pulled and stage.friction:
            pulled = False
            if not LEADING_KEYS & entry.model_fields_set:
                free = {"entry": entry.model_copy(update={"release": True})}
                yield stage.model_copy(update={"edges": {**stage.edges, **free}})
                continue
        yield stage


def stages_as_typed(stages: object) -> tuple[StageSpec, ...]:
    """Return stages that are wrong in themselves with the gravity and rollers that were typed."""
    found = []
    for table in stages if isinstance(stages, list | tuple) else ():
        if isinstance(table, Mapping):
            given: dict[str, Any] = {key: table.get(key) for key in ("name", "gravity", "rollers")}
            if not isinstance(given["rollers"], Mapping):
                given["rollers"] = {}
            found.append(StageSpec.model_construct(**given))
    return tuple(found)


def rollers_as_typed(rollers: object) -> tuple[RollerSpec, ...]:
    """Return rollers that are wrong in themselves with their names, none where one is no name."""
    tables = rollers if isinstance(rollers, list | tuple) else ()
    names = [table.get("name") for table in tables if isinstance(table, Mapping)]
    if not all(isinstance(name, str) and hints.name_like(name) == name for name in names):
        return ()
    named: Any = RollerSpec.model_construct
    return tuple(named(name=name) for name in names)


def read_text(source: Path) -> str:
    """Return the text of a scene file, or refuse a file that cannot be read."""
    try:
        return source.read_text(encoding="utf-8-sig")
    except IsADirectoryError:
        expected, hint = "a file, not a directory", "its scene.toml"
    except UnicodeDecodeError as error:
        expected, hint = f"text in UTF-8; byte {error.start} is not", "the same, saved as UTF-8"
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        expected, hint = f"a file that can be read ({reason})", "the path of a scene in TOML"
    raise InputError([Mistake(str(source), "", None, expected, hint)])


def parse_scene(text: str, source: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Parameters
    ----------
    text : str
    source : str
        Name of its file, for messages.

    Raises
    ------
    InputError
        If it is not TOML, or empty.
    """
    key, value = "", None
    try:
        if data := tomllib.loads(text):
            return data
        expected = "a scene; the file is empty"
        hint = "[strip]\nlength = 4.0\nwidth = 1.0\nthickness = 1.0e-3\ncells = [16, 2]"
    except RecursionError:
        expected, hint = "TOML of reasonable depth", "fewer brackets"
    except ValueError as error:
        expected, hint = f"TOML: {error}", "valid TOML, see https://toml.io"
        number = str(error).partition("(at line ")[2].partition(",")[0]
        if number.isdigit():
            key, lines = f"line {number}", text.splitlines()
            value = lines[int(number) - 1] if int(number) <= len(lines) else None
            hint = "valid TOML: key = value, text in quotes, each key once"
            if value and (pointed := hints.as_toml(value)):
                comma = "," in value and "," not in pointed
                expected += "; numbers have a decimal point, not a comma" * comma
                hint = pointed
    raise InputError([Mistake(source, key, value, expected, hint)])


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
            hint = nearest(place.keys[-1], known)
            wanted = place.keys[-1]
            if typed := hints.key_like(wanted, value, known) or hints.key_elsewhere(wanted, known):
                hint = typed
            elif others := " or ".join(keys_of(model, place.keys[-1])):
                stages = [stage.name for stage in stages_as_typed(data.get("stages")) if stage.name]
                of_stage = stages and key.startswith("rollers.") and "[[stages]] rollers." in others
                more = f", as stages.{stages[-1]}.{key}" if of_stage else ""
                hint += f"; or in another table, {others}{more}"
            yield Mistake("", key, value, "a known key", hint)
        elif field is None:
            yield Mistake("", key, value, "a table of the scene", "[strip]")
        else:
            value = None if found["type"] == "missing" and not place.item else value
            expected = f"{hints.expected_number(found['type'], value)}{place.meaning}"
            least, largest = SMALLEST_NUMBER, LARGEST_NUMBER
            if isinstance(value, float) and (abs(value) > largest or 0.0 < value < least):
                expected += f"; numbers are at most {largest:g}, and {least:g} at least if positive"
            better = better_value(found["type"], value, place, data)
            hint = example_of(place.name, field) if better is None else f"{place.name} = {better}"
            yield Mistake("", key, value, expected, hint)


def better_value(kind: str, value: Any, place: Place, data: Mapping[str, Any]) -> str | None:
    """Return what was presumably meant by a wrong value, in TOML; None if nothing is likely.

    A drive is the one that has what the stages give the roller.
    """
    if place.field is None or (place.item and kind != "missing"):
        return None
    if place.name == "name" and isinstance(value, str) and hints.name_like(value):
        return f'"{hints.name_like(value)}"'
    better = hints.likely_value(kind, value, place.meaning, place.field)
    if hints.is_number(value) and (more := more_than_number(kind, value, place, data)):
        return more
    if place.name == "drive" and better is None:
        given = set[str]()
        for stage in stages_as_typed(data.get("stages")):
            control: Any = stage.rollers.get(place.keys[1])
            given.update(control if isinstance(control, Mapping) else ())
        return next((f'"{drive}"' for key, drive in DRIVES.items() if key in given), None)
    return better


def more_than_number(kind: str, value: float, place: Place, data: Mapping[str, Any]) -> str | None:
    """Return what was presumably meant by a number where none is expected; None if not likely.

    That of a crown is what the roller is thinner by at the edges of the strip, that of a force
    pulls at an end.
    """
    strip = data.get("strip")
    width = strip.get("width") if isinstance(strip, Mapping) else None
    if place.name == "crown" and hints.is_number(width) and width > 0.0:
        told = f"of a roller thinner by {value:g} m in radius at the edges of the strip"
        return f"[0.0, {-4.0 * value / width**2:.3g}], {told}"
    if place.name == "force" and place.keys[-2] in ENDS:
        outwards = value if place.keys[-2] == "exit" else -value
        return f"[{outwards:g}, 0.0, 0.0], or tension = {value:g} along the strip"
    if place.name == "friction" and kind.startswith("bool"):
        return f"true, with coefficient = {value:g} in [friction], for the whole run"
    if place.name == "rollers" and place.keys[-1] != "rollers":
        return f"{{ {place.keys[-1]}.surface_speed = {value:g} }}"
    return None


def told_once(found: Iterable[Mistake]) -> list[Mistake]:
    """Return mistakes without keys that are missing because they are misspelt, as is told."""
    told = list(found)
    meant = meant_keys(told)
    return [
        mistake
        for mistake in told
        if mistake.expected == "a known key"
        or mistake.value is not None
        or tuple(mistake.key.split(".")) not in meant
    ]


def meant_keys(found: Iterable[Mistake]) -> set[tuple[str, ...]]:
    """Return the keys that were presumably meant by the unknown ones among mistakes."""
    wrong = [m for m in found if m.expected == "a known key"]
    return {(*m.key.split(".")[:-1], re.split(" \\(the nearest| = ", m.hint)[0]) for m in wrong}


def inner_tables(field: FieldInfo) -> list[type[BaseModel]]:
    """Return the models that stand in a field, or in the entries of its collection."""
    kinds = (field.annotation, *get_args(field.annotation))
    return [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)]


def keys_of(table: type[BaseModel], key: str, outermost: bool = True) -> Iterator[str]:
    """Yield where a key may stand in the tables below a model: ``[[stages]] rollers.NAME.torque``.

    Names of edges stand beside the other keys of a stage.
    """
    for name, field in table.model_fields.items():
        kind = get_origin(field.annotation)
        if outermost:
            title = f"[[{name}]] " if kind is tuple else f"[{name}{'.NAME' * (kind is dict)}] "
        else:
            title = "EDGE." if name == "edges" else f"{name}.{'NAME.' * (kind is dict)}"
        for inner in inner_tables(field):
            found = [key] * (key in inner.model_fields) + list(keys_of(inner, key, False))
            yield from (title + each for each in found)


class Place(NamedTuple):
    """A place in the tables of a scene at which pydantic found something."""

    keys: tuple[str, ...]  # as `--set` takes them
    table: type[BaseModel] | None  # the model whose keys may stand here
    field: FieldInfo | None  # the last field on the way
    name: str  # of this field
    meaning: str  # and its unit
    item: bool  # whether the place is one component of the field's value


def find_place(
    location: tuple[int | str, ...], model: type[BaseModel], data: Mapping[str, Any]
) -> Place:
    """Follow a location of pydantic through the fields of the models."""
    keys: list[str] = []
    table: type[BaseModel] | None = model
    entries: type[BaseModel] | None = None  # the model of the entries of a collection
    field, name, meaning, item = None, "", "", False
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
            field, meaning, item = table.model_fields[name], meanings(table)[name], False
            table, entries = next(iter(inner_tables(field)), None), None
            if get_origin(field.annotation) in (tuple, dict):
                table, entries = None, table
        elif isinstance(part, str):
            keys.append(part)
        else:
            item = True
    if len(location) > 3 and (location[0], location[2]) == ("stages", "edges"):
        del keys[2]  # edges stand beside the other keys of a stage
    return Place(tuple(keys), table, field, name, meaning, item)
