"""The tables of a scene about strip, material, rollers, contact and friction."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
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

from anmstrip.errors import InputError, Mistake
from anmstrip.scene.messages import LARGEST, SMALLEST, missing

ENDS = ("entry", "exit")
"""The ends of a strip, at −x and +x: all the edges that a section has."""

EDGE_NAMES = (*ENDS, "left", "right")
"""The edges of a rectangular strip, at −x, +x, +y and −y."""

THREADING = "threading"
"""Name of the stage that lays the strip around the rollers."""

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
        self._check(check_strip(self))
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
        self._check(check_contact(self))
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
        self._check(check_roller(self))
        return self

    @property
    def profile(self) -> dict[str, object]:
        """What makes it another body than a cylinder, key by key."""
        sides = self.sides and self.sides.model_dump()
        given = {"crown": any(self.crown) and self.crown, "taper": self.taper, "sides": sides}
        return {key: value for key, value in given.items() if value}


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
        self._check(check_edge(self))
        return self


def check_strip(table: StripSpec) -> Iterator[Mistake]:
    """Yield what is wrong with a strip."""
    yield from _outline(table)
    yield from _imperfection(table)


def _imperfection(table: StripSpec) -> Iterator[Mistake]:
    """Yield what cannot be with a strip that is bent before it is loaded."""
    if table.imperfection is None:
        return
    bent = "with an imperfection"
    if table.kinematics != "shell":
        expected, hint = f'"shell" {bent}: others do not wrinkle', 'kinematics = "shell"'
        yield Mistake("", "kinematics", table.kinematics, expected, hint)
    if not table.bending:
        expected = f"true {bent}, which without bending does nothing"
        yield Mistake("", "bending", table.bending, expected, "bending = true")
    if table.feed:
        expected = f"false {bent}: fresh strip is flat"
        yield Mistake("", "feed", table.feed, expected, "feed = false")


def _outline(table: StripSpec) -> Iterator[Mistake]:
    """Yield neither or both of rectangle and mesh file."""
    if table.mesh is None:
        needed = ("width", "cells")
        yield from (missing(type(table), key) for key in needed if getattr(table, key) is None)
        return
    if table.kinematics == "section" or table.feed:
        key = "feed" if table.feed else "kinematics"
        expected = "a strip by length, width and cells, not by a mesh file"
        yield Mistake("", key, getattr(table, key), expected, "cells = [16, 2]")
    for key in ("length", "width", "cells", "refined"):
        if (value := getattr(table, key)) is not None:
            expected = "nothing, since the mesh file says it"
            yield Mistake("", key, value, expected, f"either {key} or mesh; take one out")
    if not _is_file(table.mesh):
        hint = "the path of a file, relative to the scene's own file"
        yield Mistake("", "mesh", str(table.mesh), "a file that exists", hint)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, a directory that may not be read
        return False


def check_contact(table: ContactSpec) -> Iterator[Mistake]:
    """Yield what is wrong with the contact: half a law, two, or one without η < K δ."""
    penalty = {"stiffness": "1.0e10", "eta": "10.0", "delta": "1.0e-3"}
    given = [key for key in penalty if getattr(table, key) is not None]
    if given:
        for key in penalty.keys() - set(given):
            expected = "stiffness, eta and delta together, or none of them"
            yield Mistake("", key, None, expected, f"{key} = {penalty[key]}")
        for key in ("onset", "pressure"):
            if (value := getattr(table, key)) is not None:
                expected = f"no {key} beside stiffness, eta and delta, which are another law"
                yield Mistake("", key, value, expected, f"either {key} or {', '.join(given)}")
    if table.constants is None:
        return
    stiffness, eta, delta = table.constants
    bound = stiffness * delta
    if not eta < bound:
        expected = f"eta below stiffness × delta = {bound:g} (Pa)"
        yield Mistake("", "eta", eta, expected, f"eta = {bound / 1e6:g}")


def check_roller(table: RollerSpec) -> Iterator[Mistake]:
    """Yield what is wrong with a roller: an axis without direction."""
    if not any(table.axis):
        expected = "a direction: three numbers, not all 0 (1)"
        yield Mistake("", "axis", table.axis, expected, "axis = [0.0, 1.0, 0.0]")


def check_edge(table: EdgeSpec) -> Iterator[Mistake]:
    """Yield what is wrong with an edge: a component held twice."""
    if len(set(table.fixed)) < len(table.fixed):
        once = ", ".join(f'"{component}"' for component in dict.fromkeys(table.fixed))
        yield Mistake("", "fixed", table.fixed, "each component once", f"fixed = [{once}]")
