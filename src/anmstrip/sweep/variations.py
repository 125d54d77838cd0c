"""Which keys of a scene vary, over which values, and all their combinations."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError, Mistake
from anmstrip.scene.loading import Override

MOST = 100_000
"""Scenes of a sweep; more of them were surely not meant."""

_RANGE = re.compile(r"([^:\[\]\"',]+):([^:]+):([^:]+)")


@dataclass(frozen=True)
class Variation:
    """A dotted key and the values that it takes.

    Attributes
    ----------
    key : str
        As ``--set`` takes it.
    values : tuple
        Numbers, text, or lists of them.

    Examples
    --------
    >>> Variation.parse("friction.coefficient=0.1:0.3:3").values
    (0.1, 0.2, 0.3)
    >>> Variation.parse("strip.cells=[16, 2],[32, 2]").values
    ([16, 2], [32, 2])
    """

    key: str
    values: tuple[Any, ...]

    @classmethod
    def parse(cls, text: str) -> Variation:
        """Read ``KEY=a:b:n``, n values evenly spaced, or ``KEY=v1,v2,v3`` in TOML syntax.

        Raises
        ------
        InputError
            If it is not of this form, or a value comes twice.
        """
        key, _, given = text.partition("=")
        key, spaced = key.strip(), _RANGE.fullmatch(given.strip())
        values = _spaced(*spaced.groups()) if spaced else _listed(given)
        if not key or not values:
            raise _refused(text, given or None, "KEY=first:last:number, or KEY=value,value")
        if len({json.dumps(value) for value in values}) < len(values):
            raise _refused(text, given, "every value once")
        return cls(key, values)


def _spaced(first: str, last: str, number: str) -> tuple[float, ...]:
    """Evenly spaced values without the noise of their last digits, integers where all are."""
    try:
        ends, count = (float(first), float(last)), int(number)
        wrong = count < 1 or count > MOST or not np.isfinite(ends).all()
        if wrong or (count == 1) != (ends[0] == ends[1]):
            return ()
        values = [float(f"{value:.12g}") for value in np.linspace(*ends, count)]
        whole = all(value.is_integer() for value in values) and "." not in first + last
    except ValueError:
        return ()
    return tuple(int(value) if whole else value for value in values)


def _listed(given: str) -> tuple[Any, ...]:
    try:
        (values,) = tomllib.loads(f"values = [{given}]").values() if "\n" not in given else [[]]
        json.dumps(values)
    except (ValueError, TypeError, RecursionError):
        return ()
    return tuple(values) if isinstance(values, list) else ()


def _refused(text: str, value: object, expected: str) -> InputError:
    hint = "--vary friction.coefficient=0.1:0.5:9, or --vary friction.exponent=0.05,0.1"
    return InputError([Mistake(f"--vary {text}", "", value, expected, hint)])


@dataclass(frozen=True)
class Variant:
    """One scene of a sweep.

    Attributes
    ----------
    values : dict
        Varied key → value.
    scene : Scene
    directory : Path
        Of its results, named after its values, so that a wider sweep finds them again.
    """

    values: dict[str, Any]
    scene: Scene
    directory: Path


def variants(
    path: Path, variations: Iterable[str], settings: Iterable[str], directory: Path
) -> tuple[Variant, ...]:
    """All combinations of varied values as scenes that are right.

    Parameters
    ----------
    path : Path
        The scene's file.
    variations : iterable of str
        See :meth:`Variation.parse`; the last varies fastest.
    settings : iterable of str
        ``KEY=VALUE`` for all scenes.
    directory : Path
        Of the sweep.

    Raises
    ------
    InputError
        With the mistakes of all variations, or of all scenes.
    """
    varied = _parsed(variations)
    found: list[Variant] = []
    mistakes: list[Mistake] = []
    for values in product(*(variation.values for variation in varied)):
        chosen = dict(zip((variation.key for variation in varied), values, strict=True))
        try:
            scene = _scene(path, chosen, settings)
        except InputError as error:
            mistakes += error.mistakes
        else:
            found.append(Variant(chosen, scene, directory / folder(chosen)))
    if mistakes:
        raise InputError({str(mistake): mistake for mistake in mistakes}.values())
    return tuple(found)


def _parsed(variations: Iterable[str]) -> list[Variation]:
    varied: list[Variation] = []
    mistakes: list[Mistake] = []
    for text in variations:
        try:
            variation = Variation.parse(text)
            Override.parse(f"{variation.key}=0")
            if variation.key in {known.key for known in varied}:
                raise _refused(text, variation.key, "every key once, with all its values")
            varied.append(variation)
        except InputError as error:
            mistakes += [replace(mistake, file=f"--vary {text}") for mistake in error.mistakes]
    if not variations:
        mistakes += _refused("", None, "at least one key that varies").mistakes
    if (count := np.prod([float(len(v.values)) for v in varied])) > MOST:
        mistakes += _refused("…", f"{count:g} scenes", f"at most {MOST} scenes").mistakes
    if mistakes:
        raise InputError(mistakes)
    return varied


def _scene(path: Path, chosen: Mapping[str, Any], settings: Iterable[str]) -> Scene:
    """A scene, checked as a run checks it before anything is written."""
    from anmstrip.driver.run import Run

    texts = [f"{key}={json.dumps(value)}" for key, value in chosen.items()]
    try:
        scene = Scene.load(path, [*settings, *texts])
        Run(scene)
    except InputError as error:
        raise InputError(_varied(mistake, texts) for mistake in error.mistakes) from None
    return scene


def _varied(mistake: Mistake, texts: Iterable[str]) -> Mistake:
    """A mistake with the option that was typed."""
    text = mistake.file.removeprefix("--set ")
    return replace(mistake, file=f"--vary {text}") if text in texts else mistake


def folder(values: Mapping[str, Any]) -> str:
    """Name of a directory for the results with some values.

    Examples
    --------
    >>> folder({"friction.coefficient": 0.2, "solver.order": 15})
    'friction.coefficient=0.2,solver.order=15'
    """
    name = ",".join(f"{key}={json.dumps(value)}" for key, value in values.items())
    plain = re.sub(r"[^\w.,=+-]", "", name)[:100]
    mark = hashlib.sha256(name.encode()).hexdigest()[:8]
    return name if plain == name else f"{plain},{mark}"
