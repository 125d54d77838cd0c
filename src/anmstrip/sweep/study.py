"""A sweep as a whole: its scenes, its workers, its table and figure."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anmstrip.continuation.status import Outcome
from anmstrip.errors import InputError, Mistake
from anmstrip.results.files import replaced, write_table
from anmstrip.scene.schema import SceneSpec
from anmstrip.sweep.variations import Variant, variants

if TYPE_CHECKING:
    from distributed import Client
    from matplotlib.axes import Axes


PATIENCE = 10.0
"""Seconds to wait for a scheduler's answer."""

DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""For workers, since a terminal tells every process of Ctrl-C: they are ended by their farm."""


@contextmanager
def local_workers(workers: int) -> Iterator[Client]:
    """So many processes of one thread each; dask replaces those that die."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=0,
            silence_logs=logging.ERROR,
            preload=DEAF,
            dashboard_address=None,
            worker_dashboard_address=None,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


@contextmanager
def remote_workers(address: str) -> Iterator[Client]:
    """Workers of a scheduler that runs somewhere.

    They must have this package and see the same files under the same paths.

    Raises
    ------
    InputError
        Nobody answers there.
    """
    from distributed import Client

    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        expected = f"the address of a scheduler that runs ({error})"
        hint = "dask scheduler, then dask worker ADDRESS with the address that it prints"
        raise InputError([Mistake("--scheduler", "", address, expected, hint)]) from error
    with client:
        yield client


INPUT, SUMMARY, CHECKPOINT = "input.json", "summary.json", "checkpoint.npz"


def ended_summary(scene: SceneSpec, directory: Path) -> dict[str, Any] | None:
    """Summary of an earlier run of this very scene that came to an end, else None.

    A run that stopped by itself has ended too: the same input stops at the same place.
    """
    summary = _read(directory / SUMMARY) or {}
    interrupted = summary.get("status") in (None, Outcome.INTERRUPTED.name.lower())
    return None if interrupted or not _began(scene, directory) else summary


def run_scene(scene: SceneSpec, directory: Path) -> dict[str, Any]:
    """Run a scene to its end, from its checkpoint if there is one; return its summary.

    Any number of processes may die in here, and the next one goes on: results that belong
    to another input are dropped before this one's is written down.
    """
    from anmstrip.driver.run import Run

    if (summary := ended_summary(scene, directory)) is not None:
        return summary
    if not _began(scene, directory):
        directory.mkdir(parents=True, exist_ok=True)
        for name in (INPUT, SUMMARY, CHECKPOINT):
            (directory / name).unlink(missing_ok=True)
        with replaced(directory / INPUT) as temporary:
            temporary.write_text(json.dumps(scene.to_dict(), indent=2), encoding="utf-8")
    for _ in Run(scene, directory, resume=(directory / CHECKPOINT).exists()):
        pass
    summary = _read(directory / SUMMARY)
    assert summary is not None
    return summary


def _began(scene: SceneSpec, directory: Path) -> bool:
    """Whether what lies in a directory belongs to this scene."""
    return _read(directory / INPUT) == json.loads(json.dumps(scene.to_dict()))


def _read(path: Path) -> dict[str, Any] | None:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


WAITING = "waiting"

FACTS = ("status", "message", "steps", "tangents", "wall_seconds")


class SweepTable:
    """``sweep.csv``, replaced whenever a row changes, so that it can be read at any time.

    Columns: the varied keys, `FACTS`, ``EDGE_tension`` (N/m), ``ROLLER_normal_force`` and
    all else that ``summary.json`` says of a roller, ``directory``.

    Parameters
    ----------
    path : Path
    variants : sequence of Variant
    """

    def __init__(self, path: Path, variants: Sequence[Variant]) -> None:
        self.path, self.varied = path, tuple(variants[0].values)
        self.rows = [
            {**v.values, "status": WAITING, "directory": v.directory.name} for v in variants
        ]

    def update(self, number: int, summary: Mapping[str, Any]) -> None:
        """Fill in what a scene's summary says."""
        self.rows[number].update(row_of(summary))

    def fail(self, number: int, error: BaseException) -> None:
        """Say that a scene could not be run, and why; it is tried again next time."""
        message = f"{type(error).__name__}: {error}"
        self.rows[number].update(status="failed", message=" ".join(message.split()))

    def write(self) -> None:
        """Write all rows."""
        first = (*self.varied, *FACTS)
        found = dict.fromkeys(column for row in self.rows for column in row)
        more = [column for column in found if column not in (*first, "directory")]
        write_table(self.path, (*first, *more, "directory"), self.rows)


def row_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """What the table says of a scene, from its ``summary.json``."""
    row = {fact: summary.get(fact) for fact in FACTS}
    for edge, values in summary.get("edges", {}).items():
        row[f"{edge}_tension"] = values["tension"]
    for roller, values in summary.get("rollers", {}).items():
        row |= _flat(roller, values)
    return row


def _flat(name: str, value: Any) -> dict[str, Any]:
    """Columns of a value, one for each number that it holds."""
    if not isinstance(value, Mapping):
        return {name: value}
    parts = [_flat(f"{name}_{key}", inner) for key, inner in value.items()]
    return {key: inner for part in parts for key, inner in part.items()}


CURVES = 7
"""Most values of a second key that are drawn as curves; more of them make a map."""

Row = Mapping[str, Any]


def figure(rows: Sequence[Row], varied: Sequence[str]) -> bytes:
    """A panel for every roller: tension ratio against the first key; a PNG.

    A second key makes curves, or a map if it has many values; further keys more curves.
    Without rollers the tensions of the edges are drawn. What has not ended is left out.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = shown(rows)
    figure = Figure(figsize=(4.8 * len(names), 3.8), dpi=130, layout="constrained")
    panels = figure.subplots(1, len(names), squeeze=False)[0]
    several = len(varied) == 2 and len(values_of(rows, varied[1])) > CURVES
    for axes, name in zip(panels, names, strict=True):
        (_map if several else _curves)(axes, rows, varied, name)
        axes.set_xlabel(varied[0])
        axes.set_title(name.replace("_", " "))
    stream = BytesIO()
    FigureCanvasAgg(figure).print_png(stream)
    return stream.getvalue()


def shown(rows: Sequence[Row]) -> list[str]:
    """Columns that are drawn."""
    ratios = dict.fromkeys(
        name
        for row in rows
        for name, value in row.items()
        if name.endswith("_tension_ratio") and value is not None
    )
    return list(ratios) or ["entry_tension", "exit_tension"]


def values_of(rows: Sequence[Row], key: str) -> list[str]:
    """Values that a key takes, as text, in their order."""
    return list(dict.fromkeys(json.dumps(row[key]) for row in rows))


def places(rows: Sequence[Row], key: str) -> tuple[dict[str, float], bool]:
    """Where the values of a key lie on an axis, and whether they are numbers."""
    values = values_of(rows, key)
    numbers = [json.loads(value) for value in values]
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in numbers):
        return dict(zip(values, map(float, numbers), strict=True)), True
    return {value: float(place) for place, value in enumerate(values)}, False


def _ticks(axes: Axes, which: str, where: Mapping[str, float], numeric: bool) -> None:
    """Names of values that are no numbers; a logarithmic axis for decades."""
    places = np.array(list(where.values()))
    if not numeric:
        axes.set(**{f"{which}ticks": places, f"{which}ticklabels": list(where)})
    elif places.min() > 0.0 and places.max() >= 100.0 * places.min():
        axes.set(**{f"{which}scale": "log"})


def _curves(axes: Axes, rows: Sequence[Row], varied: Sequence[str], name: str) -> None:
    first, *others = varied
    where, numeric = places(rows, first)
    curves: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        label = ", ".join(f"{key} = {json.dumps(row[key])}" for key in others)
        value = row.get(name)
        point = (where[json.dumps(row[first])], np.nan if value is None else value)
        curves.setdefault(label, []).append(point)
    for label, points in curves.items():
        axes.plot(*np.array(sorted(points)).T, marker="o", markersize=3, label=label)
    _ticks(axes, "x", where, numeric)
    axes.spines[["top", "right"]].set_visible(False)
    if others and len(curves) <= 2 * CURVES:
        axes.legend(frameon=False, fontsize=7)


def _map(axes: Axes, rows: Sequence[Row], varied: Sequence[str], name: str) -> None:
    (x, *x_kind), (y, *y_kind) = (places(rows, key) for key in varied)
    grid = np.full((len(y), len(x)), np.nan)
    for row in rows:
        i, j = (list(w).index(json.dumps(row[k])) for w, k in ((y, varied[1]), (x, varied[0])))
        value = row.get(name)
        grid[i, j] = np.nan if value is None else value
    columns, lines = (np.argsort(list(w.values())) for w in (x, y))
    mesh = axes.pcolormesh(
        np.sort(list(x.values())),
        np.sort(list(y.values())),
        np.ma.masked_invalid(grid[np.ix_(lines, columns)]),
        shading="nearest",
    )
    assert axes.figure is not None
    axes.figure.colorbar(mesh, ax=axes)
    axes.set_ylabel(varied[1])
    _ticks(axes, "x", x, *x_kind)
    _ticks(axes, "y", y, *y_kind)


@dataclass(frozen=True)
class Ended:
    """A scene of a sweep that has come to its end.

    Attributes
    ----------
    row : dict
        Of the table.
    done, total : int
        Scenes that have ended, those of earlier calls included; all scenes.
    """

    row: dict[str, Any]
    done: int
    total: int

    @property
    def fraction(self) -> float:
        """Of the sweep."""
        return self.done / self.total

    def __str__(self) -> str:
        seconds = self.row.get("wall_seconds")
        took = "" if seconds is None else f" in {seconds:.1f} s"
        last = f"{self.row['directory']} {self.row['status']}{took}"
        return f"{self.done} of {self.total} scenes, {last}"


class Sweep:
    """All scenes of a parameter study, and their table.

    Parameters
    ----------
    path : path
        The scene's file.
    variations, settings : iterable of str
        Options ``--vary`` and ``--set``.
    directory : path
        Of the table and the figure; scenes get directories inside.

    Raises
    ------
    InputError
        With the mistakes of all scenes; nothing was written.

    Examples
    --------
    A client of any dask cluster will do, as long as its workers see the same files::

        sweep = Sweep("capstan.toml", ["friction.coefficient=0.1:0.5:9"], directory="results")
        with local(workers=2) as client:
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
        self.directory = Path(directory).absolute()
        given = tuple(variations), tuple(settings), self.directory
        self.variants: tuple[Variant, ...] = variants(Path(path), *given)
        self.table = SweepTable(self.directory / "sweep.csv", self.variants)
        self.waiting: list[int] = []
        for number, variant in enumerate(self.variants):
            summary = ended_summary(variant.scene, variant.directory)
            if summary is None:
                self.waiting.append(number)
            else:
                self.table.update(number, summary)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Of the table, one for every scene."""
        return self.table.rows

    @property
    def stopped(self) -> list[dict[str, Any]]:
        """Rows of scenes that did not reach their end."""
        return [row for row in self.rows if row["status"] != "done"]

    def run(self, client: Client) -> Iterator[Ended]:
        """Run what is left, as many scenes at once as there are workers.

        Whatever order they end in, the table has them in their own.
        """
        from distributed import as_completed

        self.directory.mkdir(parents=True, exist_ok=True)
        self.table.write()
        jobs = {
            client.submit(run_scene, v.scene, v.directory, pure=False): number
            for number in self.waiting
            for v in [self.variants[number]]
        }
        try:
            for job in as_completed(list(jobs)):
                yield self._ended(jobs[job], job)
        finally:
            client.cancel(list(jobs))

    def _ended(self, number: int, job: Any) -> Ended:
        error = job.exception()
        if error is None:
            self.table.update(number, job.result())
        else:
            self.table.fail(number, error)
        self.waiting.remove(number)
        self.table.write()
        total = len(self.variants)
        return Ended(self.rows[number], total - len(self.waiting), total)

    def draw(self) -> Path:
        """Draw ``sweep.png`` of what there is so far."""

        path = self.directory / "sweep.png"
        self.table.write()
        with replaced(path) as temporary:
            temporary.write_bytes(figure(self.rows, self.table.varied))
        return path
