"""The scene as a whole: its tables, read from a file or made in Python."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from anmstrip.errors import InputError, Mistake
from anmstrip.scene.checks import check_scene
from anmstrip.scene.loading import (
    all_mistakes,
    parse_scene,
    read_text,
    validate_scene,
    with_default_names,
)
from anmstrip.scene.tables import (
    THREADING,
    ContactSpec,
    EdgeSpec,
    FrictionSpec,
    MaterialSpec,
    OutputSpec,
    RollerSpec,
    SolverSpec,
    StageSpec,
    StripSpec,
    Table,
    ThreadingSpec,
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
    contact: ContactSpec | None = Field(
        None, examples=["[contact]\nstiffness = 1.0e10\neta = 10.0\ndelta = 1.0e-3"]
    )
    """contact with the rollers, a table (Pa, m)"""
    friction: FrictionSpec | None = Field(
        None, examples=["[friction]\ncoefficient = 0.3\nspeed = 1.0"]
    )
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
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise all_mistakes(error, type(self), tables) from None

    def __repr__(self) -> str:
        kind = f"{type(self).__name__} {self.title or self.name!r}"
        return f"<{kind}: {len(self.rollers)} rollers, {len(self.course)} stages>"

    @model_validator(mode="before")
    @classmethod
    def _name_rollers_and_stages(cls, given: Any) -> Any:
        return with_default_names(given) if isinstance(given, Mapping) else given

    @model_validator(mode="after")
    def _strict_for_small_shapes(self) -> Self:
        """Ask for more of a strip that is bent a little, unless its tolerance was typed."""
        if self.strip.imperfection is not None and "tolerance" not in self.solver.model_fields_set:
            self.__dict__["solver"] = self.solver.model_copy(update={"tolerance": 1e-6})
        return self

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield what is wrong between the tables."""
        return check_scene({name: getattr(self, name) for name in type(self).model_fields})

    @classmethod
    def load(cls, path: str | Path, overrides: Iterable[str] = ()) -> Self:
        """Read a scene file.

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
        return cls.from_tables(parse_scene(read_text(source), str(source)), source, overrides)

    @classmethod
    def from_tables(
        cls, tables: Mapping[str, Any], source: str | Path, overrides: Iterable[str] = ()
    ) -> Self:
        """Return the scene of tables as they would stand in a file; see :meth:`load`."""
        scene = validate_scene(cls, tables, Path(source), overrides)
        scene._source = Path(source)
        return scene

    @property
    def course(self) -> tuple[StageSpec, ...]:
        """All stages in their order, that of threading first if there is one."""
        if self.threading is None:
            return self.stages
        threading = StageSpec(name=THREADING, duration=self.threading.duration, friction=False)
        return (threading, *self.stages)

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
        for stage in scene["stages"]:
            stage["friction"] = stage["friction"] and self.friction is not None
            stage.update(stage.pop("edges"))
        if self.friction is not None:
            for key in {"exponent", "omega"}.difference(self.friction.constants):
                del scene["friction"][key]
        return scene


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of a scene file, by which editors complete and check it.

    What pydantic makes of the models, with what files may leave out besides: names, the duration
    of stages that are steady or without friction; and with the names of edges as keys of a stage.
    """
    schema = SceneSpec.model_json_schema()
    tables = schema["$defs"]
    tables["RollerSpec"]["required"].remove("name")
    stage = tables["StageSpec"]
    stage["required"] = []
    without = [
        {"properties": {key: {"const": value}}, "required": [key]}
        for key, value in (("steady", True), ("friction", False))
    ]
    stage["anyOf"] = [{"required": ["duration"]}, *without]
    stage["additionalProperties"] = stage["properties"].pop("edges")["additionalProperties"]
    for table in (schema, *tables.values()):
        table["description"] = table["description"].partition("\n\n")[0]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
