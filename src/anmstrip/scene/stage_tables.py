"""The tables of a scene about stages, solver and output."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field, StrictBool, model_validator

from anmstrip.errors import Mistake
from anmstrip.scene.tables import EDGE_NAMES, Name, Number, Positive, Table, Vector


class EdgeControl(Table):
    """What a stage does to an edge; each control changes linearly over the stage."""

    force: Vector | None = Field(
        None,
        description="dead force per length of edge, three numbers (N/m)",
        examples=["[1.0e4, 0.0, 0.0]"],
    )
    tension: Number | None = Field(
        None,
        description="force along the strip's own direction per length of edge, a number (N/m)",
        examples=["1.0e4"],
    )
    moment: Number | None = Field(
        None,
        description="moment about the edge per length, towards the upper side, a number (N)",
        examples=["10.0"],
    )
    move: Vector | None = Field(
        None,
        description="displacement from the initial position, three numbers (m)",
        examples=["[0.0, 0.0, -0.45]"],
    )
    velocity: Vector | None = Field(
        None,
        description="velocity that the edge has at the stage's end and keeps, three numbers (m/s)",
        examples=["[1.0, 0.0, 0.0]"],
    )
    release: StrictBool = Field(
        False,
        description="whether a held edge is let go (true or false)",
        examples=["true"],
    )

    @model_validator(mode="after")
    def _consistent(self) -> EdgeControl:
        self._check(check_edge_control(self))
        return self


class RollerControl(Table):
    """What a stage does to a roller."""

    surface_speed: Number | None = Field(
        None,
        description="speed of the surface, right-handed about the axis, a number (m/s)",
        examples=["1.0"],
    )
    move: Vector | None = Field(
        None,
        description="displacement from the initial position, three numbers (m)",
        examples=["[0.0, 0.0, 0.1]"],
    )


class StageSpec(Table):
    """One stage: controls go from what they were to what is said here.

    In a scene file every key that is no field of a stage is the name of an edge.
    """

    name: Name = Field(description="name, of letters, digits, - and _ (text)", examples=['"turn"'])
    duration: Positive = Field(description="duration, a number above 0 (s)", examples=["1.0"])
    friction: StrictBool = Field(
        True,
        description="whether friction acts, without it a stage is rate-free (true or false)",
        examples=["false"],
    )
    gravity: Vector | None = Field(
        None,
        description="acceleration of gravity, three numbers (m/s²)",
        examples=["[0.0, 0.0, -9.81]"],
    )
    pressure: Number | None = Field(
        None,
        description="pressure from below, normal to the deformed strip, a number (Pa)",
        examples=["100.0"],
    )
    rollers: dict[str, RollerControl] = Field(
        {},
        description="controls by roller, tables (m, m/s)",
        examples=["{ r1.surface_speed = 1.0 }"],
    )
    edges: dict[str, EdgeControl] = Field(
        {},
        description="controls by edge, tables (N/m, m, m/s)",
        examples=["{ entry.release = true }"],
        json_schema_extra={
            "keys": [
                "name",
                "duration",
                "friction",
                "gravity",
                "pressure",
                "rollers",
                *EDGE_NAMES,
            ]
        },
    )

    @model_validator(mode="before")
    @classmethod
    def _gather_edges(cls, given: Any) -> Any:
        edges = given.get("edges", {}) if isinstance(given, dict) else None
        if not isinstance(edges, dict):
            return given
        own = {key: value for key, value in given.items() if key in cls.model_fields}
        others = {key: value for key, value in given.items() if key not in own}
        return {**own, "edges": {**edges, **others}}


class SolverSpec(Table):
    """The asymptotic numerical method."""

    order: Annotated[int, Field(strict=True, ge=2, le=60)] | None = Field(
        None,
        description="order of the series, an integer from 2 to 60, else the cheapest (1)",
        examples=["20"],
    )
    tolerance: Annotated[Number, Field(ge=1e-12, le=1e-1)] = Field(
        1e-6,
        description="error, relative to the scene's scales, from 1e-12 to 0.1 (1)",
        examples=["1.0e-6"],
    )
    max_steps: Annotated[int, Field(strict=True, ge=1)] = Field(
        20_000, description="most steps in all, an integer above 0 (1)", examples=["20000"]
    )
    max_tangents: Annotated[int, Field(strict=True, ge=1)] = Field(
        100_000, description="most tangents in all, an integer above 0 (1)", examples=["100000"]
    )
    time_step: Positive | None = Field(
        None,
        description="fixed step in time, without control of its error, a number above 0 (s)",
        examples=["1.0e-3"],
    )
    time_order: Annotated[int, Field(strict=True, ge=1, le=5)] | None = Field(
        None,
        description="highest order of the formula in time, from 1 to 5, else 2, or 5 for "
        "tolerances below 1e-4 (1)",
        examples=["2"],
    )

    @property
    def highest_time_order(self) -> int:
        """Of the formula in time: where kinks are smaller than the tolerance two orders do."""
        if self.time_order is not None:
            return self.time_order
        return 5 if self.tolerance < 1e-4 and self.time_step is None else 2


class OutputSpec(Table):
    """Which states are written, and how."""

    every: Annotated[int, Field(strict=True, ge=1)] = Field(
        1, description="write every n-th accepted step, an integer above 0 (1)", examples=["1"]
    )
    times: tuple[Annotated[Number, Field(ge=0)], ...] | None = Field(
        None,
        description="times to write, increasing numbers of at least 0 (s)",
        examples=["[0.5, 1.0, 2.6]"],
    )
    smooth: StrictBool = Field(
        True,
        description="cubic surfaces rather than plain subdivided ones (true or false)",
        examples=["false"],
    )
    events: StrictBool = Field(
        False,
        description="find when points touch, stick and slip: events.csv (true or false)",
        examples=["true"],
    )

    @model_validator(mode="after")
    def _consistent(self) -> OutputSpec:
        self._check(check_output(self))
        return self


def check_edge_control(table: EdgeControl) -> Iterator[Mistake]:
    """Yield what is wrong with an edge's control: both a displacement and a velocity."""
    if table.move is not None and table.velocity is not None:
        expected = "either move (m) or velocity (m/s), not both"
        yield Mistake("", "velocity", table.velocity, expected, "one of them; take one out")


def check_output(table: OutputSpec) -> Iterator[Mistake]:
    """Yield what is wrong with the output: two choices of states, or times in disorder."""
    if table.times is None:
        return
    if "every" in table.model_fields_set:
        expected = "either every or times, not both"
        yield Mistake("", "every", table.every, expected, "one of them; take one out")
    ordered = sorted(set(table.times))
    if list(table.times) != ordered or not ordered:
        hint = f"times = {ordered or [0.5, 1.0]}"
        yield Mistake("", "times", table.times, "increasing times, at least one (s)", hint)
