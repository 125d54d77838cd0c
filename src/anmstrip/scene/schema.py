"""The scene as a whole: its tables, and what can be done with them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, PrivateAttr, field_validator, model_validator

from anmstrip.scene.checks import check_scene
from anmstrip.scene.loading import read_scene, validate_scene, with_default_names
from anmstrip.scene.stage_tables import (
    OutputSpec,
    SolverSpec,
    StageSpec,
)
from anmstrip.scene.tables import (
    THREADING,
    ContactSpec,
    EdgeSpec,
    FrictionSpec,
    MaterialSpec,
    RollerSpec,
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

    title: str = Field("", description="title (text)", examples=['"Strip over a roller"'])
    strip: StripSpec = Field(
        description="the strip, a table (m)",
        examples=["[strip]\nlength = 4.0\nwidth = 1.0\nthickness = 1.0e-3\ncells = [16, 2]"],
    )
    material: MaterialSpec = Field(
        description="the material, a table (Pa)",
        examples=["[material]\nyoung = 2.0e11\npoisson = 0.3"],
    )
    contact: ContactSpec | None = Field(
        None,
        description="contact with the rollers, a table (Pa, m)",
        examples=["[contact]\nstiffness = 1.0e10\neta = 10.0\ndelta = 1.0e-3"],
    )
    friction: FrictionSpec | None = Field(
        None,
        description="friction on the rollers, a table (1, m/s)",
        examples=["[friction]\ncoefficient = 0.3\nspeed = 1.0"],
    )
    threading: ThreadingSpec | None = Field(
        None,
        description="how the strip is laid around the rollers, a table (N/m, m)",
        examples=["[threading]\ntension = 1.0e4"],
    )
    rollers: tuple[RollerSpec, ...] = Field(
        (),
        description="rollers, a list of tables (m)",
        examples=["[[rollers]]\nradius = 0.5\ncentre = [0.0, 0.0, -0.501]\naxis = [0.0, 1.0, 0.0]"],
    )
    edges: dict[str, EdgeSpec] = Field(
        {},
        description="how edges are held, a table for each",
        examples=['[edges.entry]\nfixed = ["x", "z"]'],
    )
    stages: Annotated[tuple[StageSpec, ...], Field(min_length=1)] = Field(
        description="what happens, a list of at least one table (s)",
        examples=["[[stages]]\nduration = 1.0"],
    )
    solver: SolverSpec = Field(
        SolverSpec(), description="the solver, a table (1)", examples=["[solver]\norder = 20"]
    )
    output: OutputSpec = Field(
        OutputSpec(), description="the output, a table (1)", examples=["[output]\nevery = 1"]
    )

    _source: Path | None = PrivateAttr(None)

    @field_validator("rollers", mode="before")
    @classmethod
    def _name_rollers(cls, given: Any) -> Any:
        return with_default_names(given, "r")

    @field_validator("stages", mode="before")
    @classmethod
    def _name_stages(cls, given: Any) -> Any:
        return with_default_names(given, "stage")

    @model_validator(mode="after")
    def _consistent(self) -> SceneSpec:
        self._check(check_scene({name: getattr(self, name) for name in type(self).model_fields}))
        return self

    @classmethod
    def load(cls, path: str | Path, overrides: Iterable[str] = ()) -> Self:
        """Read a scene file; see :func:`anmstrip.scene.loading.read_scene`."""
        return cls._from(Path(path), read_scene(cls, path, overrides))

    @classmethod
    def from_tables(
        cls, tables: Mapping[str, Any], source: str | Path, overrides: Iterable[str] = ()
    ) -> Self:
        """Return the scene of tables as they would stand in a file."""
        return cls._from(Path(source), validate_scene(cls, tables, Path(source), overrides))

    @classmethod
    def _from(cls, source: Path, scene: Self) -> Self:
        scene._source = source
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

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as used, defaults included, as it would be typed; JSON-ready."""
        scene = self.model_dump(mode="json", exclude_none=True)
        scene["stages"] = [self._as_typed(stage) for stage in scene["stages"]]
        if self.output.times is not None:
            del scene["output"]["every"]
        return scene

    def _as_typed(self, stage: dict[str, Any]) -> dict[str, Any]:
        edges = stage.pop("edges")
        friction = stage["friction"] and self.friction is not None
        return {**stage, "friction": friction, **edges}
