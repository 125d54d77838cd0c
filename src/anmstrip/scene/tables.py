"""The tables of a scene: strip, material, rollers, contact, friction, stages, solver, output.

The line below each key is its meaning and unit, and what a wrong value is answered with.
"""

from __future__ import annotations

import ast
import inspect
import math
import os.path
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PlainValidator, StrictBool, model_validator
from pydantic.fields import FieldInfo

from anmstrip.errors import InputError, Mistake
from anmstrip.scene.hints import is_number

ENDS = ("entry", "exit")
"""The ends of a strip, at −x and +x: all the edges that a section has."""

SIDES = ("left", "right")
"""Edges along the strip that it has without a mesh file."""

EDGE_NAMES = (*ENDS, *SIDES)
"""The edges of a rectangular strip, at −x, +x, +y and −y."""

THREADING = "threading"
"""Name of the stage that lays the strip around the rollers."""

I_UNIT = 1e-5
"""Strain of one I-unit of flatness."""

SMALLEST_NUMBER, LARGEST_NUMBER = 1e-30, 1e30
"""Bounds of numbers in a scene, so that no product of a handful of them over- or underflows."""

Finite = Annotated[float, Field(strict=True, allow_inf_nan=False, le=LARGEST_NUMBER)]
Number = Annotated[Finite, Field(ge=-LARGEST_NUMBER)]
Positive = Annotated[Finite, Field(ge=SMALLEST_NUMBER)]
NotNegative = Annotated[Number, Field(ge=0)]
Integer = Annotated[int, Field(strict=True, ge=1)]
Count = Annotated[Integer, Field(le=100_000)]
Vector = tuple[Number, Number, Number]
Component = Literal["x", "y", "z"]
OWN_LAW_PATTERN = r"[A-Za-z_][\w.]*:[A-Za-z_]\w*"
"""Pattern of the name of a class in a module, ``module:Class``."""

OwnLaw = Annotated[str, Field(strict=True, pattern=f"^{OWN_LAW_PATTERN}$")]

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=64)]


class Table(BaseModel):
    """A table of the scene: immutable; unknown keys and contradictions are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    @model_validator(mode="after")
    def _refuse_mistakes(self) -> Self:
        if found := tuple(self.find_mistakes()):
            raise InputError(found)
        return self

    def find_mistakes(self) -> Iterable[Mistake]:
        """Yield what is wrong between keys that are right in themselves."""
        return ()


@cache
def meanings(model: type[BaseModel]) -> dict[str, str]:
    """Return what the keys of a table mean, by key: the texts below them.

    They are read when they are asked for: pydantic itself would take a tenth of a second for that
    whenever this module is imported.
    """
    found: dict[str, str] = {}
    for table in reversed(model.__mro__):
        lines = ast.parse(inspect.getsource(table)).body if issubclass(table, Table) else []
        for above, below in pairwise(line for part in lines for line in vars(part)["body"]):
            match above, below:
                case ast.AnnAssign(target=ast.Name(key)), ast.Expr(ast.Constant(str(text))):
                    found[key] = inspect.cleandoc(text)
    return found


def example_of(key: str, field: FieldInfo) -> str:
    """Return what to type for a field: its first example, a value or whole tables in TOML."""
    example = str((field.examples or ["…"])[0])
    return example if re.match(r"\[+[a-z]", example) else f"{key} = {example}"


def missing(model: type[BaseModel], key: str) -> Mistake:
    """Return the mistake of having left out a field of a model."""
    return Mistake("", key, None, meanings(model)[key], example_of(key, model.model_fields[key]))


def not_both(table: Table, **units: str) -> Iterator[Mistake]:
    """Yield the second of two keys, given with their units, of which a table may have one."""
    if all(getattr(table, key) is not None for key in units):
        words = " or ".join(f"{key} ({unit})" for key, unit in units.items())
        *_, key = units
        hint = "one of them; take one out"
        yield Mistake("", key, getattr(table, key), f"either {words}, not both", hint)


def check_bending(value: object) -> bool | str:
    """Return true, false or the name of an energy; 1 is not true."""
    if isinstance(value, bool) or value == "kirchhoff-love":
        return value
    raise ValueError


def check_refined(value: object) -> float | str:
    """Return an element length (m), or "auto"."""
    if is_number(value) and SMALLEST_NUMBER <= value <= LARGEST_NUMBER:
        return float(value)
    if value == "auto":
        return "auto"
    raise ValueError


Refined = Annotated[
    float | str, PlainValidator(check_refined, json_schema_input_type=Positive | Literal["auto"])
]


class ImperfectionSpec(Table):
    """A shape of the strip, without stress, that is not flat.

    It is a mode in which the strip would buckle at the end of the first stage, threading
    included.
    """

    mode: Annotated[Count, Field(le=100)] = Field(1, examples=["1"])
    """number of the buckling mode, an integer from 1 to 100 (1)"""
    amplitude: Positive = Field(examples=["1.0e-4"])
    """largest height, a number above 0 (m)"""


class FieldSpec(Table):
    """A quantity all over the strip: a profile across, times factors along.

    Examples
    --------
    >>> FieldSpec(across=(10.0, 0.0, 8.0), along=((0.0, 0.0), (2.0, 1.0))).at(0.5, 1.0).item()
    6.0
    """

    across: tuple[Number, ...] = Field((), examples=["[20.0, 0.0, 80.0]"], max_length=12)
    """c0, c1, …: c0 + c1 η + c2 η² + … at η = y / width from -1/2 to 1/2, numbers; pairs of η and
    value are a table (1)"""
    table: tuple[tuple[Number, Number], ...] = Field(
        (), examples=["[[-0.5, 40.0], [0.0, 20.0], [0.5, 40.0]]"]
    )
    """instead of across, pairs of η = y / width and value, η increasing (1)"""
    along: tuple[tuple[NotNegative, Number], ...] = Field((), examples=["[[0.0, 0.0], [2.0, 1.0]]"])
    """pairs of distance from the entry, as cut, increasing (m), and factor of the profile (1)"""

    @model_validator(mode="before")
    @classmethod
    def _from_number(cls, given: Any) -> Any:
        return {"across": [given]} if is_number(given) else given

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield neither or both kinds of profile, and tables in disorder."""
        if bool(self.across) == bool(self.table):
            expected = "either across, a polynomial, or table, of values across the strip"
            given = self.across if self.table else None
            yield Mistake("", "across", given, expected, "across = [20.0, 0.0, 80.0]")
        for key, pairs in (("table", self.table), ("along", self.along)):
            places = [place for place, _ in pairs]
            ordered = all(a < b for a, b in pairwise(places))
            if pairs and (len(pairs) < 2 or not ordered):
                expected = "at least two pairs, their first numbers increasing"
                hint = example_of(key, type(self).model_fields[key])
                yield Mistake("", key, places, expected, hint)
        if places := [eta for eta, _ in self.table if abs(eta) > 0.5]:
            expected = "η = y / width from -0.5 at the right edge to 0.5 at the left one"
            yield Mistake("", "table", places[0], expected, "table = [[-0.5, 40.0], [0.5, 20.0]]")

    def at(self, eta: Any, distance: Any) -> Any:
        """Return values at η = y / width and a distance from the entry (m), linear in tables."""
        if self.table:
            profile = np.interp(eta, *np.transpose(self.table))
        else:
            profile = np.polynomial.polynomial.polyval(eta, self.across)
        return profile * np.interp(distance, *np.transpose(self.along)) if self.along else profile

    def means(self, distance: Any) -> Any:
        """Return means across at distances from the entry (m), or one for all, (any,)."""
        middles = (np.arange(100)[:, None] + 0.5) / 100.0 - 0.5
        return self.at(middles, distance).mean(axis=0)

    @property
    def places(self) -> Any:
        """Places η all over the width, with the corners of the table, (any,)."""
        return np.union1d(np.linspace(-0.5, 0.5, 101), [eta for eta, _ in self.table])

    @property
    def samples(self) -> Any:
        """Values at places all over the width by those of the table along, (any, any).

        At all corners of the tables, between which values are linear.
        """
        return self.at(self.places[:, None], np.array([place for place, _ in self.along] or [0.0]))


class NaturalShape(Table):
    """Shape of the strip if nothing held it, for a strip or at the end of a stage."""

    temperature: FieldSpec | None = Field(None, examples=["80.0"])
    """temperature above that of the stress-free strip, a number or a table (K)"""
    flatness: FieldSpec | None = Field(None, examples=["{ across = [0.0, 0.0, 80.0] }"])
    """rolled-in elongation in I-units of 1e-5, a number or a table (1e-5)"""
    camber: Number | None = Field(None, examples=["1.0e-3"])
    """curvature in the strip's own plane, positive if the left side is shorter, a number (1/m)"""
    coil_set: Number | None = Field(None, examples=["0.2"])
    """curvature along that makes no moment, positive if the top is longer, a number (1/m)"""
    crossbow: Number | None = Field(None, examples=["0.1"])
    """curvature across that makes no moment, positive if the top is longer, a number (1/m)"""

    @property
    def natural(self) -> dict[str, FieldSpec | float]:
        """The keys of these that are given."""
        given = {key: getattr(self, key) for key in NaturalShape.model_fields}
        return {key: value for key, value in given.items() if value is not None}

    @property
    def varying_across(self) -> list[str]:
        """The keys of these that a strip without width could not have."""
        return [
            key
            for key, given in self.natural.items()
            if key in ("camber", "crossbow")
            or (isinstance(given, FieldSpec) and np.ptp(given.samples, axis=0).any())
        ]


class StripSpec(NaturalShape):
    """The strip: a rectangle centred at the origin, or a mesh file."""

    length: Positive | None = Field(None, examples=["4.0"])
    """length along x, a number above 0 (m)"""
    width: Positive | None = Field(None, examples=["1.0"])
    """width along y, a number above 0 (m)"""
    thickness: Positive = Field(examples=["1.0e-3"])
    """thickness, a number above 0 (m)"""
    cells: tuple[Count, Count] | None = Field(None, examples=["[16, 2]"])
    """elements along and across, two integers from 1 to 100000; left out: by the rollers (1)"""
    refined: Refined | None = Field(None, examples=["0.025"])
    """element length over the rollers, "auto", to mesh_tolerance, or a number above 0 (m)"""
    finer: Annotated[Number, Field(ge=0.05, le=64.0)] | None = Field(None, examples=["2.0"])
    """all elements so many times shorter, along and across, from 0.05 to 64 (1)"""
    mesh: Path | None = Field(None, examples=['"../meshes/strip_refined.msh"'])
    """mesh file, relative to the scene's own file (text)"""
    kinematics: Literal["shell", "section", "plate"] = Field("shell", examples=['"shell"'])
    """level of description, "shell", "section" or "plate" (text)"""
    bending: Annotated[bool | str, PlainValidator(check_bending)] = Field(
        True, examples=['"kirchhoff-love"']
    )
    """whether the strip resists bending, true, false or "kirchhoff-love" (text)"""
    feed: StrictBool | None = Field(None, examples=["true"])
    """whether fresh strip follows, true or false; left out: if threaded or let go (1)"""
    foundation: Positive | None = Field(None, examples=["1.0e5"])
    """stiffness of an elastic foundation under the strip, a number above 0 (Pa/m)"""
    imperfection: ImperfectionSpec | None = Field(
        None, examples=["{ mode = 1, amplitude = 1.0e-4 }"]
    )
    """how the strip is bent without stress, a table (m)"""

    @property
    def element_length(self) -> float | None:
        """The element length over rollers (m) that was typed; None if it is to be found."""
        return self.refined if isinstance(self.refined, float) else None

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield neither or both of rectangle and mesh file, and an imperfection that cannot be."""
        if self.mesh is None and self.width is None:
            yield missing(type(self), "width")
        if self.mesh is not None and (self.kinematics == "section" or self.feed):
            key = "feed" if self.feed else "kinematics"
            expected = "a strip by length, width and cells, not by a mesh file"
            yield Mistake("", key, getattr(self, key), expected, "cells = [16, 2]")
        for key in ("length", "width", "cells", "refined", "finer") if self.mesh else ():
            if (value := getattr(self, key)) is not None:
                expected = "nothing, since the mesh file says it"
                yield Mistake("", key, value, expected, f"either {key} or mesh; take one out")
        # not Path.is_file, which raises if a name is too long or a directory may not be read
        if self.mesh is not None and not os.path.isfile(self.mesh):  # noqa: PTH113
            hint = "the path of a file, relative to the scene's own file"
            yield Mistake("", "mesh", str(self.mesh), "a file that exists", hint)
        if self.imperfection is None:
            return
        bent = "with an imperfection"
        if self.kinematics == "plate":
            expected, hint = f'"shell" or "section" {bent}', 'kinematics = "shell"'
            yield Mistake("", "kinematics", self.kinematics, expected, hint)
        if not self.bending:
            expected = f"true {bent}, which without bending does nothing"
            yield Mistake("", "bending", self.bending, expected, "bending = true")
        if self.feed:
            expected = f"false {bent}: fresh strip is flat"
            yield Mistake("", "feed", self.feed, expected, "feed = false")


def without_law(parameters: Mapping[str, float], law: str | None) -> Iterator[Mistake]:
    """Yield parameters beside a built-in law, which has none."""
    if parameters and ":" not in (law or ""):
        expected, hint = "none without a law of one's own", 'law = "my_laws:MyLaw" as well'
        yield Mistake("", "parameters", dict(parameters), expected, hint)


class PlasticitySpec(Table):
    """Plastic flow: the rate from the stress, ε_p' = ε₀ (σ/σ_y)ⁿ, in layers."""

    exponent: Annotated[Integer, Field(ge=3, le=301)] = Field(51, examples=["51"])
    """exponent n of the stress, an odd integer from 3 to 301 (1)"""
    reference_rate: Positive | None = Field(None, examples=["0.1"])
    """strain rate ε₀ at which the stress is the yield stress, a number above 0; left out: about
    that of the strip's bends (1/s)"""
    isotropic_hardening: NotNegative = Field(0.0, examples=["1.0e9"])
    """growth of the yield stress with plastic strain, a number of at least 0 (Pa)"""
    kinematic_hardening: NotNegative = Field(0.0, examples=["1.0e9"])
    """growth of the back stress with plastic strain, a number of at least 0 (Pa)"""
    layers: Annotated[Integer, Field(ge=5, le=81)] | None = Field(None, examples=["21"])
    """layers through the thickness, an integer from 5 to 81; left out: 21 of a section, 11 of a
    shell (1)"""
    law: OwnLaw | None = Field(None, examples=['"my_laws:Voce"'])
    """a law of one's own, "module:Class"; left out: von Mises's with linear hardening (text)"""
    parameters: dict[str, Number] = Field({}, examples=["{ gain = 0.5, path = 1.0e-3 }"])
    """further arguments of a law of one's own, a table of numbers (1)"""
    uniaxial: StrictBool = Field(False, examples=["true"])
    """whether fibres flow without stress across, as in a narrow strip (true or false)"""

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield an even exponent, with which tension and compression would flow the same way."""
        yield from without_law(self.parameters, self.law)
        if self.exponent % 2 == 0:
            expected = "an odd integer, so that the flow has the sign of the stress (1)"
            hint = f"exponent = {self.exponent + 1}"
            yield Mistake("", "exponent", self.exponent, expected, hint)


Shares = tuple[tuple[Number, Positive], ...]
"""Pairs of a temperature (K) and a share of what holds at 0."""


class MaterialSpec(Table):
    """Isotropic material, elastic or elastic and plastic."""

    young: Positive = Field(examples=["2.0e11"])
    """Young's modulus, a number above 0 (Pa)"""
    poisson: Annotated[Number, Field(gt=-1, lt=0.5)] = Field(examples=["0.3"])
    """Poisson's ratio, a number above -1 and below 0.5 (1)"""
    expansion: Annotated[NotNegative, Field(le=1e-3)] | None = Field(None, examples=["1.2e-5"])
    """coefficient of thermal expansion, a number from 0 to 1e-3 (1/K)"""
    density: Positive | None = Field(None, examples=["7850.0"])
    """density, a number above 0 (kg/m³)"""
    young_at: Shares = Field((), examples=["[[0.0, 1.0], [600.0, 0.7]]"])
    """pairs of temperature above that of the stress-free strip (K), increasing, and share of young
    there, 1 at 0 (1)"""
    yield_stress_at: Shares = Field((), examples=["[[0.0, 1.0], [600.0, 0.2]]"])
    """the same of yield_stress, of strip that yields (1)"""
    yield_stress: Positive | None = Field(None, examples=["3.0e8"])
    """yield stress, a number above 0; without plasticity only to warn (Pa)"""
    plasticity: PlasticitySpec | None = Field(None, examples=["{ exponent = 51 }"])
    """plastic flow beyond the yield stress; left out: none, a table (1, 1/s, Pa)"""

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield tables in disorder, and plastic flow without a yield stress or held across."""
        for key, pairs in (("young_at", self.young_at), ("yield_stress_at", self.yield_stress_at)):
            given, ordered = dict(pairs), [t for t, _ in pairs] == sorted({t for t, _ in pairs})
            if pairs and (len(pairs) < 2 or not ordered or given.get(0.0) != 1.0):
                expected = (
                    "at least two pairs, their temperatures increasing, one of them [0.0, 1.0]"
                )
                yield Mistake("", key, pairs, expected, f"{key} = [[0.0, 1.0], [600.0, 0.7]]")
        if self.plasticity is None:
            if self.yield_stress_at:
                expected = "no table beside a strip that does not yield"
                hint = "plasticity = {}, or no yield_stress_at"
                yield Mistake("", "yield_stress_at", self.yield_stress_at, expected, hint)
            return
        if self.yield_stress is None:
            expected = "the stress at which the strip flows, since there is [material.plasticity]"
            yield Mistake("", "yield_stress", None, expected, "yield_stress = 3.0e8")
        if self.plasticity.uniaxial and self.poisson != 0.0:
            expected = "0 beside plasticity.uniaxial: a strip that bends without stress across"
            yield Mistake("", "poisson", self.poisson, expected, "poisson = 0.0, or no uniaxial")


class ContactSpec(Table):
    """Regularised unilateral contact, per unit of the strip's area.

    With stiffness, eta and delta it is a penalty; without them its onset is as wide as the mesh
    can resolve, unless ``onset`` and ``pressure`` say otherwise.
    """

    law: OwnLaw | None = Field(None, examples=['"my_laws:HardContact"'])
    """a law of one's own, "module:Class"; left out: a built-in law (text)"""
    parameters: dict[str, Number] = Field({}, examples=["{ stiffness = 1.0e10 }"])
    """arguments of a law of one's own, a table of numbers (1)"""
    stiffness: Positive | None = Field(None, examples=["1.0e10"])
    """contact stiffness K, a number above 0 (Pa/m)"""
    eta: Positive | None = Field(None, examples=["10.0"])
    """regularisation η, a number above 0 and below stiffness × delta (Pa)"""
    delta: Positive | None = Field(None, examples=["1.0e-3"])
    """distance δ at which contact begins, a number above 0 (m)"""
    onset: Positive | None = Field(None, examples=["1.0e-4"])
    """gap over which contact sets in, a number above 0 (m)"""
    pressure: Positive | None = Field(None, examples=["2.0e4"])
    """pressure under which the strip lies on the surface, a number above 0 (Pa)"""
    faces: StrictBool | None = Field(None, examples=["true"])
    """whether rollers touch the faces of the strip or its mid-surface; left out: its faces where
    rollers are drawn with its thickness between them, or down to half of it (true or false)"""

    @property
    def constants(self) -> tuple[float, float, float] | None:
        """K, η and δ of the penalty, if it is one."""
        if self.stiffness is None or self.eta is None or self.delta is None:
            return None
        return self.stiffness, self.eta, self.delta

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield half a law, two, or a penalty without η < K δ."""
        yield from without_law(self.parameters, self.law)
        penalty = {"stiffness": "1.0e10", "eta": "10.0", "delta": "1.0e-3"}
        given = [key for key in penalty if getattr(self, key) is not None]
        if self.law is not None:
            for key in (*given, "onset", "pressure"):
                if (value := getattr(self, key)) is not None:
                    expected = f"no {key} beside a law of one's own, which has its parameters"
                    yield Mistake("", key, value, expected, "parameters = { … }, or no law")
            return
        for key in [key for key in penalty if given and key not in given]:
            expected = "stiffness, eta and delta together, or none of them"
            yield Mistake("", key, None, expected, f"{key} = {penalty[key]}")
        for key in ("onset", "pressure"):
            if given and (value := getattr(self, key)) is not None:
                expected = f"no {key} beside stiffness, eta and delta, which are another law"
                yield Mistake("", key, value, expected, f"either {key} or {', '.join(given)}")
        stiffness, eta, delta = self.constants or (np.inf, 0.0, np.inf)
        if not eta < (bound := stiffness * delta):
            expected = f"eta below stiffness × delta = {bound:g} (Pa)"
            yield Mistake("", "eta", eta, expected, f"eta = {bound / 1e6:g}")


class FrictionSpec(Table):
    """Regularised friction."""

    law: Annotated[
        str, Field(strict=True, pattern=f"^(algebraic|norton-hoff|tanh|{OWN_LAW_PATTERN})$")
    ] = Field("algebraic", examples=['"algebraic"'])
    """friction law, "algebraic", "norton-hoff", "tanh", or "module:Class" of one's own (text)"""
    parameters: dict[str, Number] = Field({}, examples=["{ dip = 0.2 }"])
    """further arguments of a law of one's own, a table of numbers (1)"""
    coefficient: NotNegative = Field(examples=["0.3"])
    """friction coefficient f, a number of at least 0 (1)"""
    exponent: Annotated[Number, Field(gt=0, le=1)] = Field(0.05, examples=["0.05"])
    """exponent q, a number above 0 and at most 1 (1)"""
    omega: Positive = Field(0.1, examples=["0.1"])
    """regularisation ω, a number above 0 (1)"""
    speed: Positive | None = Field(None, examples=["1.0e-6"])
    """characteristic slip speed V_c, a number above 0; left out: from the elastic creep (m/s)"""
    speed_at_rest: Positive | None = Field(None, examples=["1.0e-8"])
    """V_c while a line stands after a run, a number above 0; left out: so that it hardly creeps
    (m/s)"""
    regularisation: Literal["fixed", "auto"] = Field("fixed", examples=['"auto"'])
    """laws as given, or sharpened to the tolerance, "fixed" or "auto" (text)"""

    @property
    def constants(self) -> tuple[str, ...]:
        """Keys that the law has besides f and V_c."""
        return {"algebraic": (), "tanh": ("omega",)}.get(self.law, ("exponent", "omega"))

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield a constant without the law that has it."""
        yield from without_law(self.parameters, self.law)
        given = [key for key in ("exponent", "omega") if key in self.model_fields_set]
        if given and "law" not in self.model_fields_set:
            key = given[0]
            expected = f'a law beside {key}, which the default, "{self.law}", does not have'
            yield Mistake("", "law", None, expected, 'law = "norton-hoff"')


class SidesSpec(Table):
    """Conical sides of a roller, the same on both, beside a cylinder in its middle."""

    taper: Number = Field(examples=["2.0e-3"])
    """by which the radius falls for each metre along a side, a number (m/m)"""
    flat: NotNegative = Field(examples=["0.6"])
    """length of the cylinder between the sides, about the centre, at least 0 (m)"""
    rounding: Positive = Field(examples=["0.05"])
    """length over which the corners are rounded, a number above 0 (m)"""


class RollerSpec(Table):
    """A rigid roller: a cylinder, or another profile along its axis."""

    name: Name = Field(examples=['"r1"'])
    """name, of at most 64 letters, digits, - and _ (text)"""
    radius: Positive = Field(examples=["0.5"])
    """radius, a number above 0 (m)"""
    centre: Vector = Field(examples=["[0.0, 0.0, -0.501]"])
    """a point of the axis, three numbers (m)"""
    axis: Vector = Field((0.0, 1.0, 0.0), examples=["[0.0, 1.0, 0.0]"])
    """direction of the axis, three numbers, not all 0 (1)"""
    crown: tuple[Number, ...] = Field((), examples=["[0.0, -2.0e-3]"], max_length=8)
    """c1, c2, …: radius + c1 s + c2 s² + … at s along the axis, as [0, -d/b²] of a roller thinner
    by d at s = b, numbers (m/m^k)"""
    taper: Number = Field(0.0, examples=["1.0e-3"])
    """a cone: radius + taper s at s along the axis, besides a crown, a number (m/m)"""
    sides: SidesSpec | None = Field(
        None, examples=["{ taper = 2.0e-3, flat = 0.6, rounding = 0.05 }"]
    )
    """conical sides, a table of taper (m/m), flat and rounding (m)"""
    friction: NotNegative | None = Field(None, examples=["0.2"])
    """coefficient f on this roller; left out: that of [friction], at least 0 (1)"""
    wrap: Literal["over", "under", "left", "right"] | None = Field(None, examples=['"over"'])
    """side on which a threaded strip passes, "over" or "under", "left" or "right" (text)"""
    crossing: StrictBool = Field(False, examples=["true"])
    """whether a threaded strip may cross itself to wrap the roller farther (true or false)"""
    drive: Literal["speed", "torque", "idle"] = Field("speed", examples=['"idle"'])
    """what a stage gives, "speed" or "torque"; "idle" if the strip turns it (text)"""
    bearing: NotNegative = Field(0.0, examples=["2.0"])
    """torque with which the bearings brake a roller that turns, at least 0 (N m)"""
    press: Positive | None = Field(None, examples=["2.0e3"])
    """force with which it is pressed against the roller across the strip; left out: it stays where
    it is drawn, above 0 (N)"""

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield an axis without direction, and bearings that nobody feels."""
        if self.crossing and self.wrap is None:
            expected = "false without a wrap, which it tells how to read"
            yield Mistake("", "crossing", True, expected, 'wrap = "over"')
        if self.bearing and self.drive == "speed":
            expected = "0, since a roller driven by speed turns whatever its bearings do"
            yield Mistake("", "bearing", self.bearing, expected, 'drive = "idle", or no bearing')
        if not any(self.axis):
            expected = "a direction: three numbers, not all 0 (1)"
            yield Mistake("", "axis", self.axis, expected, "axis = [0.0, 1.0, 0.0]")

    @property
    def driven(self) -> bool:
        """Whether a drive turns it, to a speed or by a torque."""
        return self.drive != "idle"

    @property
    def profile(self) -> dict[str, object]:
        """Keys, with values, that make it another body than a cylinder."""
        sides = self.sides and self.sides.model_dump()
        given = {"crown": any(self.crown) and self.crown, "taper": self.taper, "sides": sides}
        return {key: value for key, value in given.items() if value}


class ThreadingSpec(Table):
    """The strip is laid around the rollers that say on which side it passes them.

    This is a rate-free stage of its own, before all others.
    """

    tension: Positive = Field(examples=["1.0e4"])
    """tension of the threaded strip, a number above 0 (N/m)"""
    entry: Vector | None = Field(None, examples=["[-2.0, 0.0, 0.5]"])
    """where the entry is, three numbers; left out: level with the first roller (m)"""
    exit: Vector | None = Field(None, examples=["[2.0, 0.0, 0.5]"])
    """where the exit is, three numbers; left out: level with the last roller (m)"""
    closed: StrictBool = Field(False, examples=["true"])
    """whether the exit goes on as the entry: an endless strip round its rollers (true or false)"""
    duration: Positive = Field(1.0, examples=["1.0"])
    """time that threading takes, a number above 0 (s)"""


class EdgeSpec(Table):
    """Supports of an edge of the strip."""

    fixed: tuple[Component, ...] = Field((), examples=['["x", "z"]'])
    """components held, each of "x", "y", "z" at most once (list of text)"""
    centred: StrictBool | None = Field(None, examples=["true"])
    """whether its middle keeps its y, true or false; left out: a loose threaded entry (1)"""
    clamped: StrictBool = Field(False, examples=["true"])
    """whether it keeps its slope out of the plane of flat strip, true or false (1)"""

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield a component that is held twice."""
        if len(set(self.fixed)) < len(self.fixed):
            once = ", ".join(f'"{component}"' for component in dict.fromkeys(self.fixed))
            yield Mistake("", "fixed", self.fixed, "each component once", f"fixed = [{once}]")


class EdgeControl(Table):
    """Controls of an edge in a stage; each changes linearly over the stage."""

    force: Vector | None = Field(None, examples=["[1.0e4, 0.0, 0.0]"])
    """dead force per length of edge, three numbers (N/m)"""
    tension: NotNegative | None = Field(None, examples=["1.0e4"])
    """force along the strip's own direction per length of edge, a number of at least 0 (N/m)"""
    moment: Number | None = Field(None, examples=["10.0"])
    """moment about the edge per length, towards the upper side, a number (N)"""
    move: Vector | None = Field(None, examples=["[0.0, 0.0, -0.45]"])
    """displacement from the initial position, three numbers (m)"""
    velocity: Vector | None = Field(None, examples=["[1.0, 0.0, 0.0]"])
    """velocity that the edge has at the stage's end and keeps, three numbers (m/s)"""
    speed: Number | None = Field(None, examples=["1.0"])
    """speed of the strip at a held end instead, from entry to exit, a number (m/s)"""
    release: StrictBool = Field(False, examples=["true"])
    """whether a held edge is let go (true or false)"""

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield a motion that is given twice."""
        for one, other in combinations({"move": "m", "velocity": "m/s", "speed": "m/s"}.items(), 2):
            yield from not_both(self, **dict((one, other)))

    @property
    def signed_speed(self) -> float | None:
        """Speed that the edge keeps (m/s), positive from entry to exit; None if none is given."""
        if self.velocity is None:
            return self.speed
        return math.copysign(math.hypot(*self.velocity), self.velocity[0])


class RollerControl(Table):
    """Controls of a roller in a stage; each changes linearly over the stage."""

    surface_speed: Number | None = Field(None, examples=["1.0"])
    """speed of the surface, positive if it carries a threaded strip on, a number (m/s)"""
    angular_speed: Number | None = Field(None, examples=["2.0"])
    """speed of turning instead, right-handed about the axis, a number (rad/s)"""
    torque: Number | None = Field(None, examples=["100.0"])
    """torque of the drive, in the sense of surface_speed, a number (N m)"""
    move: Vector | None = Field(None, examples=["[0.0, 0.0, 0.1]"])
    """displacement from the initial position, three numbers (m)"""
    press: Positive | None = Field(None, examples=["2.0e3"])
    """force with which it is pressed against the roller across the strip, above 0 (N)"""

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield a speed that is given twice."""
        return not_both(self, surface_speed="m/s", angular_speed="rad/s")


class StripControl(NaturalShape):
    """Controls of the strip in a stage."""

    speed: Number | None = Field(None, examples=["1.0"])
    """speed in a steady stage, of unstressed strip, from entry to exit, a number (m/s)"""


def has_velocity(controls: Any) -> bool:
    """Return whether the table of an edge in a stage says how fast it moves."""
    return isinstance(controls, Mapping) and bool({"velocity", "speed"} & controls.keys())


class StageSpec(Table):
    """One stage: controls go from what they were to what is said here.

    In a scene file every key that is no field of a stage is the name of an edge.
    """

    name: Name = Field(examples=['"turn"'])
    """name, of at most 64 letters, digits, - and _ (text)"""
    duration: Positive = Field(examples=["1.0"])
    """duration, not needed with steady = true, or without friction, yield and ends that move,
    above 0 (s)"""
    steady: StrictBool = Field(False, examples=["true"])
    """whether every state of the stage is a stationary one (true or false)"""
    strip: StripControl = Field(StripControl(), examples=["{ speed = 1.0 }"])
    """controls of the strip, a table (m/s)"""
    friction: StrictBool = Field(True, examples=["false"])
    """whether friction acts, without it a stage is rate-free (true or false)"""
    gravity: Vector | None = Field(None, examples=["[0.0, 0.0, -9.81]"])
    """acceleration of gravity, three numbers (m/s²)"""
    pressure: Number | None = Field(None, examples=["100.0"])
    """pressure from below, normal to the deformed strip, a number (Pa)"""
    rollers: dict[str, RollerControl] = Field({}, examples=["{ r1.surface_speed = 1.0 }"])
    """controls by roller, tables (m, m/s)"""
    edges: dict[str, EdgeControl] = Field({}, examples=["{ entry.release = true }"])
    """controls by edge, tables (N/m, m, m/s)"""

    @property
    def moves(self) -> dict[str, tuple[float, float, float]]:
        """Rollers that the stage moves, and to where from where they began (m)."""
        return {name: c.move for name, c in self.rollers.items() if c.move is not None}

    def edge(self, name: str) -> EdgeControl:
        """Return the controls of an edge, of which the stage may give none."""
        return self.edges.get(name, EdgeControl())

    def roller(self, name: str) -> RollerControl:
        """Return the controls of a roller, of which the stage may give none."""
        return self.rollers.get(name, RollerControl())

    @model_validator(mode="before")
    @classmethod
    def _gather_edges(cls, given: Any) -> Any:
        edges = given.get("edges", {}) if isinstance(given, dict) else None
        if not isinstance(edges, dict):
            return given
        own = {key: value for key, value in given.items() if key in cls.model_fields}
        others = {key: value for key, value in given.items() if key not in own}
        moved = any(map(has_velocity, others.values()))
        steady = own.get("steady", False) is not False  # of another type it is told itself
        if steady or (own.get("friction") is False and not moved):
            own.setdefault("duration", 1.0)
        return {**own, "edges": {**edges, **others}}


STAGE_KEYS = tuple(key for key in StageSpec.model_fields if key != "edges")
"""Keys of a stage that are no names of edges."""


class SolverSpec(Table):
    """The asymptotic numerical method."""

    order: Annotated[Integer, Field(ge=2, le=60)] | None = Field(None, examples=["20"])
    """order of the series, an integer from 2 to 60, else the cheapest (1)"""
    tolerance: Annotated[Number, Field(ge=1e-12, le=1e-1)] = Field(1e-3, examples=["1.0e-3"])
    """error, relative to the scene's scales, from 1e-12 to 0.1 (1)"""
    max_steps: Integer = Field(20_000, examples=["20000"])
    """most steps in all, an integer above 0 (1)"""
    max_tangents: Integer = Field(100_000, examples=["100000"])
    """most tangents in all, an integer above 0 (1)"""
    time_step: Positive | None = Field(None, examples=["1.0e-3"])
    """fixed step in time, without control of its error, a number above 0 (s)"""
    time_order: Annotated[Integer, Field(le=5)] | None = Field(None, examples=["2"])
    """highest order in time, from 1 to 5, else 2, or 5 for tolerances below 1e-4 (1)"""
    mesh_tolerance: Annotated[Number, Field(ge=1e-9, le=1e-1)] | None = Field(
        None, examples=["1.0e-3"]
    )
    """error of tensions by the mesh, else tolerance, relative, from 1e-9 to 0.1 (1)"""
    method: Literal["series", "newton"] = Field("series", examples=['"series"'])
    """how paths are followed, by "series" or in load steps by "newton", to compare (text)"""

    @property
    def mesh_share(self) -> float:
        """Error of tensions that the mesh may make, relative to the largest."""
        return self.mesh_tolerance or self.tolerance

    @property
    def highest_time_order(self) -> int:
        """Highest order of the formula in time, as chosen or by the tolerance.

        Where kinks are smaller than the tolerance two orders do.
        """
        if self.time_order is not None:
            return self.time_order
        return 5 if self.tolerance < 1e-4 and self.time_step is None else 2


class OutputSpec(Table):
    """Choice of the states that are written."""

    every: Integer | None = Field(None, examples=["1"])
    """write every n-th accepted step, an integer above 0; left out: about 100 states (1)"""
    times: tuple[NotNegative, ...] | None = Field(None, examples=["[0.5, 1.0, 2.6]"])
    """times to write, increasing numbers of at least 0 (s)"""
    smooth: StrictBool = Field(True, examples=["false"])
    """cubic surfaces rather than plain subdivided ones (true or false)"""
    events: StrictBool = Field(False, examples=["true"])
    """find when points touch, stick and slip: events.csv (true or false)"""

    def find_mistakes(self) -> Iterator[Mistake]:
        """Yield two choices of states, or times in disorder."""
        if self.times is None:
            return
        yield from not_both(self, times="s", every="1")
        ordered = sorted(set(self.times))
        if list(self.times) != ordered or not ordered:
            hint = f"times = {ordered or [0.5, 1.0]}"
            yield Mistake("", "times", self.times, "increasing times, at least one (s)", hint)
