"""The checkpoint of a run: to which scene it belongs, and whether a run can go on from it."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from anmstrip.arrays import Array
from anmstrip.driver.budget import Budget
from anmstrip.errors import InputError, Mistake, toml_text
from anmstrip.results.files import AFRESH, load_checkpoint, refused_checkpoint
from anmstrip.simulation.march import March
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course

FREE = ("title", "solver.max_steps", "solver.max_tangents")
"""Keys that may differ: nothing that is computed depends on them."""

Count = Annotated[int, Field(ge=0)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


@dataclass
class PaceFacts:
    """Past of a path, see :class:`~anmstrip.continuation.follow.Pace`."""

    control: Number
    last: Positive
    shrinking: list[tuple[Number, Number]]
    arclength: bool


@dataclass
class StageFacts:
    """Work that a stage has cost."""

    steps: Count
    tangents: Count
    seconds: Number


@dataclass
class EffectFacts:
    """Work that an effect has cost."""

    points: Count
    seconds: Number


@dataclass
class SnapFacts:
    """When and how far the strip ran away."""

    stage: str
    time: Number
    distance: Number


@dataclass
class OnsetFacts:
    """Place and tensions at which the strip was about to wrinkle."""

    kind: str
    stage: str
    time: Number
    entry_tension: Number
    exit_tension: Number
    x: Number
    y: Number
    wavelength: Number


class Facts(BaseModel):
    """Numbers and names of a checkpoint; the arrays stand beside them."""

    stage: Count  # number of the stage that is under way
    steps: Count
    expansions: Count
    factorisations: Count
    seconds: Number
    reached: Number | None  # λ of this stage
    time: Number  # s
    course_time: Number  # at which this stage began (s)
    released: list[str]  # edges
    slack: bool
    conveyed: Number  # length of strip that has been fed in (m)
    looked: Number  # time of the latest state whose errors were estimated (s)
    stages: dict[str, StageFacts]
    effects: dict[str, EffectFacts]
    snaps: list[SnapFacts]
    wrinkles: list[OnsetFacts]
    times: Annotated[list[Number], Field(min_length=1)] | None = None  # of past states (s)
    next_step: Positive = 1.0
    time_order: Annotated[int, Field(ge=1)] = 1
    error_rate: Number = 0.0
    pace: PaceFacts | None = None
    forward: Number | None = None
    rows: Count
    event_rows: Count
    profile_rows: Count
    states: Count
    turned: dict[str, Number]  # travel of the rollers' surfaces (m)


def identity(assembly: Assembly) -> dict[str, Any]:
    """Return all that the results of a run depend on: its scene, mesh file and added effects."""
    scene = assembly.scene.to_dict()
    if assembly.scene.strip.mesh is not None:  # wherever the file lies, and whatever its name
        content = Path(assembly.scene.strip.mesh).read_bytes()
        scene["strip"]["mesh"] = hashlib.sha256(content).hexdigest()
    return {**scene, "effects": [effect.name for effect in assembly.added_effects]}


def kept_values(course: Course) -> dict[str, dict[str, Array]]:
    """Return what stages have left, by kind and name, as a checkpoint keeps it."""
    return {"moved": course.moved, "speed": course.speeds, "value": course.values}


def flat_keys(tables: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys with their values; entries of lists of tables go by their names."""
    for name, value in tables.items():
        key, inner = f"{prefix}{name}", value
        if isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
            inner = {str(v.get("name", i)): v for i, v in enumerate(value)}
            yield key, list(inner)
        if isinstance(inner, dict):
            yield from flat_keys(inner, f"{key}.")
        else:
            yield key, value


def differences(before: Mapping[str, Any], now: Mapping[str, Any], file: str) -> Iterator[Mistake]:
    """Yield the keys in which a scene differs from the one with which a run began."""
    old, new = dict(flat_keys(before)), dict(flat_keys(now))
    for key in dict.fromkeys((*old, *new)):
        if key not in FREE and old.get(key) != new.get(key):
            was = toml_text(old.get(key))
            expected = f"{was}, with which this run began; what is there would not fit the rest"
            hint = f"--set {shlex.quote(f'{key}={was}')}, or {AFRESH}" if key in old else AFRESH
            yield Mistake(file, key, new.get(key), expected, hint)


def read_checkpoint(path: Path, march: March) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return arrays and facts of a checkpoint with which a fresh march can go on.

    Raises
    ------
    InputError
        There is none, it is damaged, or the scene differs from that of the run that wrote it.
    """
    arrays, facts = load_checkpoint(path)
    try:
        began = TypeAdapter(dict[str, Any]).validate_python(facts.get("input"))
        if mistakes := list(differences(began, identity(march.assembly), str(path))):
            raise InputError(mistakes)
        found = Facts.model_validate(facts)
        edges, rollers = march.assembly.strip.edges, [r.name for r in march.assembly.rollers]
        known = found.stage < len(march.scene.course) and set(found.released) <= edges.keys()
        if not known or not found.turned.keys() <= set(rollers):
            raise ValueError("a stage, an edge or a roller that the scene does not have")
        check_arrays(arrays, found, march)
    except ValidationError as error:
        wrong = error.errors()[0]
        place = ".".join(map(str, wrong["loc"]))
        raise refused_checkpoint(path, f"damaged ({place}: {wrong['msg']})") from error
    except InputError:
        raise
    except ValueError as error:
        raise refused_checkpoint(path, f"damaged ({error})") from error
    return arrays, facts


def check_arrays(arrays: Mapping[str, Array], facts: Facts, march: March) -> None:
    """Refuse arrays whose names, shapes or numbers are not those of this scene at this stage.

    Raises
    ------
    ValueError
        Which one, and what it should be.
    """
    stages = march.scene.course
    course, unknowns = Course(march.assembly), march.assembly.unknowns
    for stage in stages[: facts.stage]:
        course.released |= {name for name, edge in stage.edges.items() if edge.release}
        course.finish(stage)
    course.released |= set(facts.released)
    free = len(course.supports(stages[facts.stage]).free)
    kept = kept_values(course).items()
    known = {f"{kind}.{name}": np.shape(x) for kind, own in kept for name, x in own.items()}
    known |= {"full": (unknowns,), "velocity": (unknowns,)}
    known |= {f"value.{name}.force": (3,) for name in facts.released}
    known |= {} if facts.forward is None else {"forward": (free,)}
    if facts.times is not None:
        known |= {"states": (len(facts.times), free), "v": (free,)}
        if any(new <= old for new, old in pairwise(facts.times)):
            raise ValueError("times that do not go back")
    optional: dict[str, tuple[int, ...]] = {
        f"load.{name}": (3,) for name in march.assembly.strip.edges
    }
    optional |= {"errors": (2, 3, free)} if facts.times is not None else {}
    if "mesh_error" in arrays and (halved := Budget(march.assembly).halved) is not None:
        optional["mesh_error"] = (halved.unknowns,)
    known |= {name: shape for name, shape in optional.items() if name in arrays}
    if wrong := known.keys() ^ arrays.keys():
        raise ValueError(f"array {min(wrong)} that is missing or unknown")
    for name, values in arrays.items():
        if values.shape != known[name] or values.dtype != float:
            raise ValueError(f"{name}: {values.dtype} {values.shape} instead of {known[name]}")
        if not np.isfinite(values).all():
            raise ValueError(f"{name}: a value that is no number")
