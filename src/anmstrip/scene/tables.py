"""The tables of a scene: what a user may write about strip, rollers and their contact.

Every description says what the field is, what is allowed and in which unit; every example
is TOML that can be typed as it stands. Mistakes quote both. What a single field cannot
know about is in :mod:`anmstrip.scene.rules`.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    StrictBool,
    model_validator,
)

from anmstrip.mechanics.roller import Roller, Sides
from anmstrip.scene import rules
from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.wording import LARGEST, SMALLEST

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=SMALLEST, le=LARGEST)]
Count = Annotated[int, Field(strict=True, ge=1, le=100_000)]
Vector = tuple[Number, Number, Number]
Component = Literal["x", "y", "z"]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=64)]


class Table(BaseModel):
    """A table of the scene: immutable, and unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def _check(self, mistakes: Iterable[Mistake]) -> None:
        if found := tuple(mistakes):
            raise InputError(found)


def _bending(value: object) -> bool | str:
    """True, false or the name of an energy; 1 is not true."""
    if isinstance(value, bool) or value == "kirchhoff-love":
        return value
    raise ValueError


class ImperfectionSpec(Table):
    """How the strip is bent, without stress, before anything happens to it.

    By a mode in which it would buckle where the first stage leaves it, or threading.
    """

    mode: Annotated[Count, Field(le=100)] = Field(
        1,
        description="number of the buckling mode, an integer from 1 to 100 (1)",
        examples=["1"],
    )
    amplitude: Positive = Field(
        description="largest height, a number above 0 (m)", examples=["1.0e-4"]
    )


class StripSpec(Table):
    """The strip: a rectangle centred at the origin, or a mesh file."""

    length: Positive | None = Field(
        None, description="length along x, a number above 0 (m)", examples=["4.0"]
    )
    width: Positive | None = Field(
        None, description="width along y, a number above 0 (m)", examples=["1.0"]
    )
    thickness: Positive = Field(description="thickness, a number above 0 (m)", examples=["1.0e-3"])
    cells: tuple[Count, Count] | None = Field(
        None,
        description="elements along and across, two integers from 1 to 100000 (1)",
        examples=["[16, 2]"],
    )
    refined: Positive | None = Field(
        None,
        description="element length over the rollers, a number above 0 (m)",
        examples=["0.025"],
    )
    mesh: Path | None = Field(
        None,
        description="mesh file, relative to the scene's own file (text)",
        examples=['"../meshes/strip_refined.msh"'],
    )
    kinematics: Literal["shell", "section", "plate"] = Field(
        "shell",
        description='level of description, "shell", "section" or "plate" (text)',
        examples=['"shell"'],
    )
    bending: Annotated[bool | str, PlainValidator(_bending)] = Field(
        True,
        description='whether the strip resists bending, true, false or "kirchhoff-love" (text)',
        examples=['"kirchhoff-love"'],
    )
    feed: StrictBool = Field(
        False,
        description="whether fresh strip follows what has left (true or false)",
        examples=["true"],
    )
    imperfection: ImperfectionSpec | None = Field(
        None,
        description="how the strip is bent without stress, a table (m)",
        examples=["{ mode = 1, amplitude = 1.0e-4 }"],
    )

    @model_validator(mode="after")
    def _consistent(self) -> StripSpec:
        self._check(rules.strip(self))
        return self


class MaterialSpec(Table):
    """Isotropic elastic material."""

    young: Positive = Field(
        description="Young's modulus, a number above 0 (Pa)", examples=["2.0e11"]
    )
    poisson: Annotated[Number, Field(gt=-1, lt=0.5)] = Field(
        description="Poisson's ratio, a number above -1 and below 0.5 (1)", examples=["0.3"]
    )
    density: Positive | None = Field(
        None, description="density, a number above 0 (kg/m³)", examples=["7850.0"]
    )
    yield_stress: Positive | None = Field(
        None,
        description="yield stress, only to warn, a number above 0 (Pa)",
        examples=["3.0e8"],
    )


class ContactSpec(Table):
    """Regularised unilateral contact, per unit of the strip's area.

    With stiffness, eta and delta it is a penalty; without them its onset is as wide as the mesh
    can resolve, unless ``onset`` and ``pressure`` say otherwise.
    """

    stiffness: Positive | None = Field(
        None, description="contact stiffness K, a number above 0 (Pa/m)", examples=["1.0e10"]
    )
    eta: Positive | None = Field(
        None,
        description="regularisation η, a number above 0 and below stiffness × delta (Pa)",
        examples=["10.0"],
    )
    delta: Positive | None = Field(
        None,
        description="distance δ at which contact begins, a number above 0 (m)",
        examples=["1.0e-3"],
    )
    onset: Positive | None = Field(
        None,
        description="gap over which contact sets in, a number above 0 (m)",
        examples=["1.0e-4"],
    )
    pressure: Positive | None = Field(
        None,
        description="pressure under which the strip lies on the surface, a number above 0 (Pa)",
        examples=["2.0e4"],
    )

    @property
    def constants(self) -> tuple[float, float, float] | None:
        """K, η and δ of the penalty, if it is one."""
        if self.stiffness is None or self.eta is None or self.delta is None:
            return None
        return self.stiffness, self.eta, self.delta

    @model_validator(mode="after")
    def _consistent(self) -> ContactSpec:
        self._check(rules.contact(self))
        return self


class FrictionSpec(Table):
    """Regularised friction."""

    law: Literal["norton-hoff", "tanh"] = Field(
        "norton-hoff",
        description='friction law, "norton-hoff" or "tanh" (text)',
        examples=['"norton-hoff"'],
    )
    coefficient: Annotated[Number, Field(ge=0)] = Field(
        description="friction coefficient f, a number of at least 0 (1)", examples=["0.3"]
    )
    exponent: Annotated[Number, Field(gt=0, le=1)] = Field(
        0.05, description="exponent q, a number above 0 and at most 1 (1)", examples=["0.05"]
    )
    omega: Positive = Field(
        0.1, description="regularisation ω, a number above 0 (1)", examples=["0.1"]
    )
    speed: Positive = Field(
        description="characteristic slip speed V_c, a number above 0 (m/s)", examples=["1.0"]
    )
    regularisation: Literal["fixed", "auto"] = Field(
        "fixed",
        description='laws as given, or sharpened to the tolerance, "fixed" or "auto" (text)',
        examples=['"auto"'],
    )


class SidesSpec(Table):
    """Conical sides of a roller, the same on both, beside a cylinder in its middle."""

    taper: Number = Field(
        description="by which the radius falls for each metre along a side, a number (m/m)",
        examples=["2.0e-3"],
    )
    flat: Annotated[Number, Field(ge=0)] = Field(
        description="length of the cylinder between the sides, about the centre, at least 0 (m)",
        examples=["0.6"],
    )
    rounding: Positive = Field(
        description="length over which the corners are rounded, a number above 0 (m)",
        examples=["0.05"],
    )


class RollerSpec(Table):
    """A rigid roller: a cylinder, or another profile along its axis."""

    name: Name = Field(description="name, of letters, digits, - and _ (text)", examples=['"r1"'])
    radius: Positive = Field(description="radius, a number above 0 (m)", examples=["0.5"])
    centre: Vector = Field(
        description="a point of the axis, three numbers (m)", examples=["[0.0, 0.0, -0.501]"]
    )
    axis: Vector = Field(
        (0.0, 1.0, 0.0),
        description="direction of the axis, three numbers, not all 0 (1)",
        examples=["[0.0, 1.0, 0.0]"],
    )
    crown: tuple[Number, ...] = Field(
        (),
        description="c1, c2, …: radius + c1 s + c2 s² + … at s along the axis, numbers (m/m^k)",
        examples=["[0.0, -2.0e-3]"],
        max_length=8,
    )
    taper: Number = Field(
        0.0,
        description="a cone: radius + taper s at s along the axis, besides a crown, a number (m/m)",
        examples=["1.0e-3"],
    )
    sides: SidesSpec | None = Field(
        None,
        description="conical sides, a table of taper (m/m), flat and rounding (m)",
        examples=["{ taper = 2.0e-3, flat = 0.6, rounding = 0.05 }"],
    )
    friction: Annotated[Number, Field(ge=0)] | None = Field(
        None,
        description="coefficient f on this roller; left out: that of [friction], at least 0 (1)",
        examples=["0.2"],
    )
    wrap: Literal["over", "under"] | None = Field(
        None,
        description='side on which a threaded strip passes, "over" or "under" (text)',
        examples=['"over"'],
    )

    @model_validator(mode="after")
    def _consistent(self) -> RollerSpec:
        self._check(rules.roller(self))
        return self

    @property
    def profile(self) -> dict[str, object]:
        """What makes it another body than a cylinder, key by key."""
        sides = self.sides and self.sides.model_dump()
        given = {"crown": any(self.crown) and self.crown, "taper": self.taper, "sides": sides}
        return {key: value for key, value in given.items() if value}

    @cached_property
    def shape(self) -> Roller:
        """Its geometry."""
        crown = self.crown
        if self.taper:
            crown = (self.taper + sum(crown[:1]), *crown[1:])
        given = self.sides
        sides = None if given is None else Sides(given.taper, 0.5 * given.flat, given.rounding)
        return Roller(self.name, self.radius, self.centre, self.axis, crown, sides)


class ThreadingSpec(Table):
    """How the strip is laid around the rollers that say on which side it passes them.

    It is a rate-free stage of its own, before all others.
    """

    tension: Positive = Field(
        description="tension of the threaded strip, a number above 0 (N/m)", examples=["1.0e4"]
    )
    entry: Vector | None = Field(
        None,
        description="where the entry is, three numbers; left out: level with the first roller (m)",
        examples=["[-2.0, 0.0, 0.5]"],
    )
    exit: Vector | None = Field(
        None,
        description="where the exit is, three numbers; left out: level with the last roller (m)",
        examples=["[2.0, 0.0, 0.5]"],
    )
    duration: Positive = Field(
        1.0, description="time that threading takes, a number above 0 (s)", examples=["1.0"]
    )


class EdgeSpec(Table):
    """How an edge of the strip is held."""

    fixed: tuple[Component, ...] = Field(
        (),
        description='components held, each of "x", "y", "z" at most once (list of text)',
        examples=['["x", "z"]'],
    )
    centred: StrictBool = Field(
        False,
        description="whether the middle of the edge stays at its y (true or false)",
        examples=["true"],
    )

    @model_validator(mode="after")
    def _consistent(self) -> EdgeSpec:
        self._check(rules.edge(self))
        return self
