"""A sweep as a whole: what is to be done, doing it, and what has come out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from anmstrip.output.files import replaced
from anmstrip.sweep import scenes
from anmstrip.sweep.table import SweepTable
from anmstrip.sweep.variations import Variant, variants

if TYPE_CHECKING:
    from distributed import Client


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
            summary = scenes.ended(variant.scene, variant.directory)
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
        from distributed import as_completed  # noqa: PLC0415 (dask is optional)

        self.directory.mkdir(parents=True, exist_ok=True)
        self.table.write()
        jobs = {
            client.submit(scenes.run, v.scene, v.directory, pure=False): number
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
        from anmstrip.sweep.figure import figure  # noqa: PLC0415 (matplotlib takes long)

        path = self.directory / "sweep.png"
        self.table.write()
        with replaced(path) as temporary:
            temporary.write_bytes(figure(self.rows, self.table.varied))
        return path
