"""What a study hands back: sheets of figures that are printed, and written with their command."""

from __future__ import annotations

import csv
import io
import os
import platform
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import scipy
from rich.console import Console
from rich.table import Table

from anmstrip.output.files import replaced

QUIET = 0.85
"""Share of a core below which other programs have disturbed the times."""

Cell = str | int | float | None


@dataclass(frozen=True)
class Sheet:
    """A table with a title.

    Attributes
    ----------
    title : str
    columns : tuple of str
    rows : tuple of tuple
        Numbers or text, ``None`` for what there is not.
    note : str
        What to know when reading it.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def markdown(self) -> str:
        """As a Markdown table."""
        lines = [self.columns, tuple("---" for _ in self.columns), *self._shown()]
        body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        return "\n\n".join(part for part in (f"## {self.title}", self.note, body) if part)

    def table(self) -> Table:
        """For a terminal."""
        table = Table(title=self.title, title_justify="left", box=None, pad_edge=False)
        for i, column in enumerate(self.columns):
            table.add_column(column, justify="left" if i == 0 else "right")
        for row in self._shown():
            table.add_row(*row)
        return table

    def _shown(self) -> Iterator[tuple[str, ...]]:
        for row in self.rows:
            yield tuple(_shown(cell) for cell in row)


def _shown(cell: Cell) -> str:
    if cell is None:
        return "–"
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def machine() -> str:
    """What it was taken on."""
    numbers = f"numpy {np.__version__}, scipy {scipy.__version__}"
    cores = os.cpu_count()
    return f"{platform.machine()}, {cores} cores, Python {platform.python_version()}, {numbers}."


@dataclass(frozen=True)
class StudyReport:
    """Sheets of a study; ``str`` is what is printed.

    Attributes
    ----------
    name : str
    title : str
    data : Sheet
        What the CSV file holds.
    sheets : tuple of Sheet
        What is printed, and stands in the report.
    figures : dict
        Name of a picture → its PNG.
    command : str
        What to type to get it again.
    seconds, processor : float
        Taken, and by the processor for this process alone; were other programs at work,
        the second is much smaller, and the figures are worth less.
    files : tuple of Path
        What was written.
    """

    name: str
    title: str
    data: Sheet
    sheets: tuple[Sheet, ...]
    figures: dict[str, bytes] = field(default_factory=dict)
    command: str = ""
    seconds: float = 0.0
    processor: float = 0.0
    files: tuple[Path, ...] = ()

    def write(self, directory: Path) -> tuple[Path, ...]:
        """Write ``NAME.csv``, ``NAME.md`` and the pictures; return their paths."""
        directory.mkdir(parents=True, exist_ok=True)
        texts = {f"{self.name}.csv": self._csv(), f"{self.name}.md": self._markdown()}
        contents = {name: text.encode() for name, text in texts.items()} | self.figures
        for name, content in contents.items():
            with replaced(directory / name) as temporary:
                temporary.write_bytes(content)
        return tuple(directory / name for name in contents)

    @property
    def taken(self) -> str:
        """How long it took, and whether the machine was quiet."""
        share = min(1.0, self.processor / self.seconds) if self.seconds else 1.0
        quiet = "" if share > QUIET else " The machine was busy: take the times with care."
        return f"Taken in {self.seconds:.0f} s, {100.0 * share:.0f} % of one core.{quiet}"

    def _csv(self) -> str:
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerows([self.data.columns, *self.data.rows])
        return stream.getvalue()

    def _markdown(self) -> str:
        parts = [f"# {self.title}", f"    {self.command}"]
        parts += [f"{self.taken} {machine()}"]
        parts += [f"![{name}]({name})" for name in self.figures]
        parts += [sheet.markdown() for sheet in self.sheets]
        return "\n\n".join(parts) + "\n"

    def __str__(self) -> str:
        stream = io.StringIO()
        console = Console(file=stream, width=130, no_color=True, highlight=False)
        for sheet in self.sheets:
            console.print(sheet.table())
            if sheet.note:
                console.print(sheet.note, markup=False)
            console.print()
        lines = [self.taken, *(f"written  {file}" for file in self.files)]
        return "\n".join([stream.getvalue().rstrip(), *lines])
