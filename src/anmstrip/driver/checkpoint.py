"""The checkpoint of a run: to which scene it belongs, and whether a run can go on from it."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.errors import InputError, Mistake, toml_text
from anmstrip.results.files import AFRESH, load_checkpoint, plain, refused_checkpoint
from anmstrip.simulation.march import March
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course

FREE = ("title", "solver.max_steps", "solver.max_tangents")
"""Keys that may differ: nothing that is computed depends on them."""


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


def signature(arrays: Mapping[str, Array], facts: Mapping[str, Any]) -> str:
    """Return a hash (SHA-256) of this program's version and of all that a checkpoint holds."""
    known = json.dumps(plain(facts, keep_nonfinite=True), sort_keys=True)
    content = hashlib.sha256(f"{version('anmstrip')} {known}".encode())
    for name in sorted(arrays):
        values = np.asarray(arrays[name])
        content.update(f"{name} {values.dtype} {values.shape}".encode() + values.tobytes())
    return content.hexdigest()


def read_checkpoint(path: Path, march: March) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return arrays and facts of a checkpoint with which a fresh march can go on.

    Raises
    ------
    InputError
        There is none, it is not as a run has written it, or the scene differs from that of the run.
    """
    arrays, facts = load_checkpoint(path)
    if facts.pop("signature", None) != signature(arrays, facts):
        raise refused_checkpoint(path, "damaged, or written by another version of this program")
    if mistakes := list(differences(facts["input"], identity(march.assembly), str(path))):
        raise InputError(mistakes)
    if arrays["full"].shape != (march.assembly.unknowns,):
        raise refused_checkpoint(path, f"{len(arrays['full'])} unknowns")
    return arrays, facts
