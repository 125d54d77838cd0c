"""Which keys of a scene vary, over which values, and all their combinations."""

from __future__ import annotations

import hashlib
import json
import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError, Mistake
from anmstrip.scene.loading import Override

MOST = 100_000
"""Scenes of a sweep; more of them were surely not meant."""

RANGE = re.compile(r"([^:\[\]\"',]+):([^:]+):([^:]+)")


@dataclass(frozen=True)
class Variation:
    """A dotted key and the values that it takes: numbers, text, or lists of them.

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
        key, _, given = (part.strip() for part in text.partition("="))
        values: Any = ()
        try:
            if spaced := RANGE.fullmatch(given):
                values = spaced_values(*spaced.groups())
            elif "\n" not in given:
                (values,) = tomllib.loads(f"values = [{given}]").values()
            texts = {json.dumps(value) for value in values}
        except (ValueError, TypeError, RecursionError):
            values = ()
        if not key or not values or not isinstance(values, list):
            raise variation_error(text, given or None, "KEY=first:last:number, or KEY=value,value")
        if len(texts) < len(values):
            raise variation_error(text, given, "every value once")
        return cls(key, tuple(values))


def spaced_values(first: str, last: str, number: str) -> list[float]:
    """Return evenly spaced values without the noise of their last digits.

    They are integers where all of them are, and none if the ends or the number are no good.
    """
    low, high, count = float(first), float(last), int(number)
    wrong = not 1 <= count <= MOST or not np.isfinite([low, high]).all()
    if wrong or (count == 1) != (low == high):
        return []
    values = [float(f"{value:.12g}") for value in np.linspace(low, high, count)]
    whole = all(value.is_integer() for value in values) and "." not in first + last
    return [int(value) if whole else value for value in values]


def variation_error(text: str, value: object, expected: str) -> InputError:
    """Return the error of an option ``--vary`` that is not as expected."""
    hint = "--vary friction.coefficient=0.1:0.5:9, or --vary friction.exponent=0.05,0.1"
    return InputError([Mistake(f"--vary {text}", "", value, expected, hint)])


@dataclass(frozen=True)
class Variant:
    """One scene of a sweep."""

    values: dict[str, Any]  # of the varied keys
    scene: Scene
    directory: Path  # for its results, named after its values: a wider sweep finds them again


def variants(
    path: Path, variations: Iterable[str], settings: Iterable[str], directory: Path
) -> tuple[Variant, ...]:
    """Return all combinations of varied values as scenes that are right.

    Each is checked as a run checks it before anything is written.

    Parameters
    ----------
    path : Path
        The scene's file.
    variations : iterable of str
        See :meth:`Variation.parse`; the last varies fastest.
    settings : iterable of str
        ``KEY=VALUE`` for all scenes.
    directory : Path
        Directory of the sweep.

    Raises
    ------
    InputError
        With the mistakes of all variations, or of all scenes.
    """
    varied = parse_variations(variations)
    given = list(settings)
    refuse_both(varied, given)
    found: list[Variant] = []
    mistakes: dict[str, Mistake] = {}
    for values in product(*varied.values()):
        chosen = dict(zip(varied, values, strict=True))
        texts = [f"{key}={json.dumps(value)}" for key, value in chosen.items()]
        try:
            scene = Scene.load(path, [*given, *texts])
            Run(scene)
        except InputError as error:
            for mistake in error.mistakes:
                text = mistake.file.removeprefix("--set ")
                told = replace(mistake, file=f"--vary {text}") if text in texts else mistake
                mistakes[str(told)] = told
        else:
            found.append(Variant(chosen, scene, directory / folder(chosen)))
    if mistakes:
        raise InputError(mistakes.values())
    return tuple(found)


def parse_variations(texts: Iterable[str]) -> dict[str, tuple[Any, ...]]:
    """Return the values of every varied key, or refuse all texts that are wrong."""
    varied: dict[str, tuple[Any, ...]] = {}
    mistakes: list[Mistake] = []
    for text in texts:
        try:
            variation = Variation.parse(text)
            Override.parse(f"{variation.key}=0")
            if variation.key in varied:
                raise variation_error(text, variation.key, "every key once, with all its values")
            varied[variation.key] = variation.values
        except InputError as error:
            mistakes += [replace(mistake, file=f"--vary {text}") for mistake in error.mistakes]
    if not texts:
        mistakes += variation_error("", None, "at least one key that varies").mistakes
    if (count := math.prod(len(values) for values in varied.values())) > MOST:
        mistakes += variation_error("…", f"{count:g} scenes", f"at most {MOST} scenes").mistakes
    if mistakes:
        raise InputError(mistakes)
    return varied


def refuse_both(varied: Mapping[str, tuple[Any, ...]], settings: Iterable[str]) -> None:
    """Refuse keys that vary and are set as well: one of the two would be lost.

    Raises
    ------
    InputError
        With all such settings; those that are wrong are told by the scenes.
    """
    mistakes = []
    for text in settings:
        with suppress(InputError):
            override = Override.parse(text)
            for key in filter(override.covers, varied):
                expected = f"nothing, since {key} varies"
                mistakes.append(
                    Mistake(f"--set {text}", "", override.value, expected, "--vary alone")
                )
    if mistakes:
        raise InputError(mistakes)


def folder(values: Mapping[str, Any]) -> str:
    """Return the name of a directory for the results with some values.

    Examples
    --------
    >>> folder({"friction.coefficient": 0.2, "solver.order": 15})
    'friction.coefficient=0.2,solver.order=15'
    """
    name = ",".join(f"{key}={json.dumps(value)}" for key, value in values.items())
    plain = re.sub(r"[^\w.,=+-]", "", name)[:100]
    mark = hashlib.sha256(name.encode()).hexdigest()[:8]
    return name if plain == name else f"{plain},{mark}"
