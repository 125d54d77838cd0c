"""A sweep: which keys vary over which values; its scenes, workers, table and figure."""

from __future__ import annotations

import hashlib
import json
import logging
import math
import re
import shlex
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anmstrip.continuation.path import Outcome
from anmstrip.driver.recorder import flat_keys
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError, Mistake
from anmstrip.results.files import make_directory, read_json, write_summary, write_table
from anmstrip.scene.schema import Override, SceneSpec

if TYPE_CHECKING:
    from distributed import Client
    from matplotlib.figure import Figure

MAX_SCENES = 100_000
"""Scenes of a sweep; more of them were surely not meant."""

RANGE_PATTERN = re.compile(r"([^:\[\]\"',]+):([^:]+):([^:]+)")

LEADING_POINT = re.compile(r"(?:^|(?<=[,\[\s+-]))(?=\.\d)")
"""Where a number begins with its point, before which TOML wants a zero."""


def parse_variation(text: str) -> tuple[str, tuple[Any, ...]]:
    """Return the dotted key of ``KEY=a:b:n`` or ``KEY=v1,v2,v3`` and the values that it takes.

    These are n values evenly spaced, or numbers, texts and lists in TOML syntax.

    Raises
    ------
    InputError
        It is not of this form, or a value comes twice.

    Examples
    --------
    >>> parse_variation("friction.coefficient=0.1:0.3:3")
    ('friction.coefficient', (0.1, 0.2, 0.3))
    >>> parse_variation("strip.cells=[16, 2],[32, 2]")
    ('strip.cells', ([16, 2], [32, 2]))
    """
    key, _, given = (part.strip() for part in text.partition("="))
    values: Any = ()
    try:
        if spaced := RANGE_PATTERN.fullmatch(given):
            values = spaced_values(*spaced.groups())
        elif "\n" not in given:
            given = LEADING_POINT.sub(r"\g<0>0", given)
            (values,) = tomllib.loads(f"values = [{given}]").values()
        texts = {json.dumps(value) for value in values}
    except (ValueError, TypeError, RecursionError):
        values = ()
    if not key or not values or not isinstance(values, list):
        expected = (
            f"KEY=first:last:number, of two different numbers and 2 to {MAX_SCENES} values, or "
            "KEY=value,value"
        )
        raise variation_error(text, given or None, expected)
    if len(texts) < len(values):
        raise variation_error(text, given, "every value once")
    return key, tuple(values)


def spaced_values(first: str, last: str, number: str) -> list[float]:
    """Return evenly spaced values without the noise of their last digits.

    They are integers where all of them are, and none if the ends or the number are no good.
    """
    low, high, count = float(first), float(last), int(number)
    wrong = not 1 <= count <= MAX_SCENES or not np.isfinite([low, high]).all()
    if wrong or (count == 1) != (low == high):
        return []
    values = [float(f"{value:.12g}") for value in np.linspace(low, high, count)]
    whole = all(value.is_integer() for value in values) and "." not in first + last
    return [int(value) if whole else value for value in values]


def variation_error(text: str, value: object, expected: str) -> InputError:
    """Return the error of an option ``--vary`` that is not as expected."""
    key, _, given = (part.strip() for part in text.partition("="))
    hint = "--vary friction.coefficient=0.1:0.5:9, or --vary friction.exponent=0.05,0.1"
    if re.fullmatch(r"[^:,]+:[^:,]+", given):
        hint = f"--vary {key}={given}:9"
    elif re.fullmatch(r"[A-Za-z][\w-]*(\s*,\s*[A-Za-z][\w-]*)*", given):
        quoted = ",".join(f'"{word.strip()}"' for word in given.split(","))
        hint = f"--vary {shlex.quote(f'{key}={quoted}')}"
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
        See :func:`parse_variation`; the last varies fastest.
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
    mistakes: dict[Mistake, Mistake] = {}  # one of those that differ by the varied value alone
    for values in product(*varied.values()):
        chosen = dict(zip(varied, values, strict=True))
        texts = [f"{key}={json.dumps(value)}" for key, value in chosen.items()]
        try:
            scene = Scene.load(path, [*given, *texts])
            Run(scene)
        except InputError as error:
            for mistake in error.mistakes:
                text, told = mistake.file.removeprefix("--set "), mistake
                if text in texts:
                    key = text.partition("=")[0]
                    hint = listed(key, varied[key], lambda one: Scene.load(path, [*given, one]))
                    told = replace(mistake, file=f"--vary {text}", hint=hint or mistake.hint)
                alike = replace(told, file=told.file.partition("=")[0], value=None)
                mistakes.setdefault(alike, told)
        else:
            found.append(Variant(chosen, scene, directory / folder_name(chosen)))
    if mistakes:
        raise InputError(mistakes.values())
    return tuple(found)


def listed(key: str, values: Sequence[Any], right: Callable[[str], object]) -> str:
    """Return what to type for values that were typed as one list; nothing if that is not right."""
    (first, *others) = values
    if others or not isinstance(first, list) or not first:
        return ""
    try:
        right(f"{key}={json.dumps(first[0])}")
    except InputError:
        return ""
    typed = f"{key}={','.join(map(json.dumps, first))}"
    return f"--vary {shlex.quote(typed)}"


def parse_variations(texts: Iterable[str]) -> dict[str, tuple[Any, ...]]:
    """Return the values of every varied key, or refuse all texts that are wrong."""
    varied: dict[str, tuple[Any, ...]] = {}
    mistakes: list[Mistake] = []
    for text in texts:
        try:
            key, values = parse_variation(text)
            Override.parse(f"{key}=0")
            if key in varied:
                raise variation_error(text, key, "every key once, with all its values")
            varied[key] = values
        except InputError as error:
            mistakes += [replace(mistake, file=f"--vary {text}") for mistake in error.mistakes]
    if not texts:
        mistakes += variation_error("", None, "at least one key that varies").mistakes
    if (count := math.prod(len(values) for values in varied.values())) > MAX_SCENES:
        told = f"{count:g} scenes", f"at most {MAX_SCENES} scenes"
        mistakes += variation_error("…", *told).mistakes
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
                place, given = f"--set {text}", override.value
                mistakes.append(Mistake(place, "", given, expected, "--vary alone"))
    if mistakes:
        raise InputError(mistakes)


def folder_name(values: Mapping[str, Any]) -> str:
    """Return the name of a directory for the results with some values.

    Examples
    --------
    >>> folder_name({"friction.coefficient": 0.2, "solver.order": 15})
    'friction.coefficient=0.2,solver.order=15'
    """
    name = ",".join(f"{key}={json.dumps(value)}" for key, value in values.items())
    plain = re.sub(r"[^\w.,=+-]", "", name)[:100]
    mark = hashlib.sha256(name.encode()).hexdigest()[:8]
    return name if plain == name else f"{plain},{mark}"


SCHEDULER_TIMEOUT = 10.0
"""Seconds to wait for a scheduler's answer."""

IGNORE_INTERRUPT = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""Preload of workers: a terminal tells every process of Ctrl-C, and their cluster ends them."""

INPUT, SUMMARY, CHECKPOINT = "input.json", "summary.json", "checkpoint.npz"

FACT_COLUMNS = ("status", "message", "steps", "tangents", "wall_seconds")
"""Columns of the table for every scene."""


@contextmanager
def local_workers(workers: int) -> Iterator[Client]:
    """Yield a client of so many processes of one thread each; dask replaces those that die."""
    from distributed import Client, LocalCluster

    cluster = LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        memory_limit=0,
        silence_logs=logging.ERROR,
        preload=IGNORE_INTERRUPT,
        dashboard_address=":0",  # a free port: 8787 may be another cluster's
        worker_dashboard_address=None,
    )
    with cluster, Client(cluster) as client:
        yield client


@contextmanager
def remote_workers(address: str) -> Iterator[Client]:
    """Yield a client of a scheduler that runs somewhere.

    Its workers must have this package and see the same files under the same paths.

    Raises
    ------
    InputError
        Nobody answers there.
    """
    from distributed import Client
    from distributed.utils import silence_logging_cmgr

    try:
        client = Client(address, timeout=SCHEDULER_TIMEOUT)
    except (OSError, ValueError) as error:
        expected = f"the address of a scheduler that runs ({error})"
        hint = "dask scheduler, then dask worker ADDRESS with the address that it prints"
        raise InputError([Mistake("--scheduler", "", address, expected, hint)]) from error
    with silence_logging_cmgr(logging.CRITICAL), client:  # what it says is told once, in a sentence
        yield client


def ended_summary(scene: SceneSpec, directory: Path) -> dict[str, Any] | None:
    """Return the summary of an earlier run of this very scene that came to an end, else None.

    A run that stopped by itself has ended too: the same input stops at the same place.
    """
    summary = read_json(directory / SUMMARY) or {}
    interrupted = summary.get("status") in (None, Outcome.INTERRUPTED.name.lower())
    return None if interrupted or not has_begun(scene, directory) else summary


def run_scene(scene: Scene, directory: Path) -> dict[str, Any]:
    """Run a scene to its end, from its checkpoint if there is one; return its summary.

    Any number of processes may die in here, and the next one goes on: results that belong
    to another input are dropped before this one's is written down.
    """
    if (summary := ended_summary(scene, directory)) is not None:
        return summary
    if not has_begun(scene, directory):
        make_directory(directory)
        for name in (INPUT, SUMMARY, CHECKPOINT):
            (directory / name).unlink(missing_ok=True)
        write_summary(directory / INPUT, scene.to_dict())
    begun = (directory / CHECKPOINT).exists() and not scene.repeated
    for _ in scene.run(directory, resume=begun):
        pass
    summary = read_json(directory / SUMMARY)
    assert summary is not None
    return summary


def has_begun(scene: SceneSpec, directory: Path) -> bool:
    """Return whether what lies in a directory belongs to this scene."""
    return read_json(directory / INPUT) == json.loads(json.dumps(scene.to_dict()))


def row_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of the table for a scene, from its ``summary.json``."""
    row = {fact: summary.get(fact) for fact in FACT_COLUMNS}
    for edge, values in summary.get("edges", {}).items():
        row |= {f"{edge}_{key}": values[key] for key in ("tension", "moment") if key in values}
    return row | dict(flat_keys(summary.get("rollers", {}), between="_"))


@dataclass(frozen=True)
class Ended:
    """A scene of a sweep that has come to its end."""

    row: dict[str, Any]  # of the table
    done: int  # scenes that have ended, those of earlier calls included
    total: int

    @property
    def fraction(self) -> float:
        """Share of the sweep that is done."""
        return self.done / self.total

    def __str__(self) -> str:
        seconds = self.row.get("wall_seconds")
        took = "" if seconds is None else f" in {seconds:.1f} s"
        last = f"{self.row['directory']} {self.row['status']}{took}"
        return f"{self.done} of {self.total} scenes, {last}"


class Sweep:
    """All scenes of a parameter study, and their table ``sweep.csv``.

    The table has a row for every scene, and is replaced whenever one changes, so that it can be
    read at any time.  Columns: the varied keys, `FACT_COLUMNS`, ``EDGE_tension`` (N/m),
    ``ROLLER_normal_force`` and all else that ``summary.json`` says of a roller, ``directory``.

    Parameters
    ----------
    path : path
        The scene's file.
    variations, settings : iterable of str
        Options ``--vary`` and ``--set``.
    directory : path
        For the table and the figure; scenes get directories inside.

    Raises
    ------
    InputError
        With the mistakes of all scenes; nothing was written.

    Attributes
    ----------
    variants : tuple of Variant
    rows : list of dict
        What is known of each.
    waiting : list of int
        Numbers of those that have not ended.

    Examples
    --------
    A client of any dask cluster will do, as long as its workers see the same files::

        sweep = Sweep("capstan.toml", ["friction.coefficient=0.1:0.5:9"], directory="results")
        with local_workers(2) as client:
            for ended in sweep.run(client):
                print(ended)
        sweep.draw()
    """

    def __init__(
        self,
        path: str | Path,
        variations: Iterable[str],
        settings: Iterable[str] = (),
        *,
        directory: str | Path,
    ) -> None:
        directory = Path(directory).absolute()
        found = variants(Path(path), tuple(variations), tuple(settings), directory)
        self._prepare(found, directory / "sweep.csv")

    def _prepare(self, found: tuple[Variant, ...], table: Path) -> None:
        """Look which scenes of a study have ended."""
        self.job: Callable[[Scene, Path], dict[str, Any]] = run_scene
        self.variants, self.table, self.directory = found, table, table.parent
        self.rows: list[dict[str, Any]] = []
        self.waiting: list[int] = []
        for number, variant in enumerate(self.variants):
            row = {**variant.values, "status": "waiting", "directory": variant.directory.name}
            if (summary := ended_summary(variant.scene, variant.directory)) is None:
                self.waiting.append(number)
            self.rows.append(row | ({} if summary is None else row_of(summary)))

    @property
    def stopped(self) -> list[dict[str, Any]]:
        """Rows of scenes that did not reach their end."""
        return [row for row in self.rows if row["status"] != "done"]

    def run(self, client: Client | None = None) -> Iterator[Ended]:
        """Run what is left, as many scenes at once as there are workers, or here one by one.

        Whatever order they end in, the table has them in their own.  A scene that could not be
        run has the reason in its row, and is tried again next time.

        Raises
        ------
        ConnectionError
            The cluster has gone; the table is as it was at the last scene that ended.
        """
        make_directory(self.directory)
        self.write_table()
        total = len(self.variants)
        for number, found in self.run_here() if client is None else self.run_on(client):
            row = self.rows[number]
            if isinstance(found, dict):
                row.update(row_of(found))
            else:
                words = f"{type(found).__name__}: {found}".split()
                row.update(status="failed", message=" ".join(words))
            self.waiting.remove(number)
            self.write_table()
            yield Ended(row, total - len(self.waiting), total)

    def run_here(self) -> Iterator[tuple[int, dict[str, Any] | BaseException]]:
        """Yield summaries of scenes, or why there is none, run by this process."""
        for number in tuple(self.waiting):
            variant = self.variants[number]
            try:
                yield number, self.job(variant.scene, variant.directory)
            except (ArithmeticError, ValueError, RuntimeError) as error:
                yield number, error

    def run_on(self, client: Client) -> Iterator[tuple[int, dict[str, Any] | BaseException]]:
        """Yield the same from the workers of a cluster, as they end."""
        from distributed import as_completed

        each = [(number, self.variants[number]) for number in self.waiting]
        jobs = {client.submit(self.job, v.scene, v.directory, pure=False): n for n, v in each}
        try:
            for job in as_completed(list(jobs)):
                if job.cancelled():
                    raise ConnectionError("the scheduler has gone")
                yield jobs[job], job.exception() or job.result()
        finally:
            with suppress(OSError, RuntimeError):  # nobody there any more, or its loop is closed
                client.cancel(list(jobs))

    def write_table(self) -> None:
        """Write all rows of ``sweep.csv``."""
        first = (*self.variants[0].values, *FACT_COLUMNS)
        found = dict.fromkeys(column for row in self.rows for column in row)
        more = [column for column in found if column not in (*first, "directory")]
        write_table(self.table, (*first, *more, "directory"), self.rows)

    def draw(self) -> Path:
        """Draw what there is so far beside the table, as a PNG."""
        from anmstrip.pictures.curves import save_figure

        path = self.table.with_suffix(".png")
        self.write_table()
        save_figure(self.figure(), path)
        return path

    def figure(self) -> Figure:
        """Return the figure of what there is so far."""
        from anmstrip.pictures.curves import sweep_figure

        return sweep_figure(self.rows, tuple(self.variants[0].values))
