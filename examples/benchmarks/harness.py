"""Reports of the benchmarks: tables and figures, written with the command that makes them anew.

A benchmark is a script with a function ``study(quick)`` that returns a :class:`Report`; its last
line hands that function to :func:`main`, which adds the command and the times.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parents[2]

QUIET = 0.85
"""Share of a core below which other programs have disturbed the times."""

ONE_CORE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

Cell = str | int | float | None


@dataclass(frozen=True)
class Sheet:
    """A table with a title; its note says how to read it, and ``None`` is an empty cell."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def markdown(self) -> str:
        """Return the table in Markdown."""
        lines = [self.columns, tuple("---" for _ in self.columns), *self._texts()]
        body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        return "\n\n".join(part for part in (f"## {self.title}", self.note, body) if part)

    def table(self) -> Table:
        """Return the table for a terminal."""
        table = Table(title=self.title, title_justify="left", box=None, pad_edge=False)
        for i, column in enumerate(self.columns):
            table.add_column(column, justify="left" if i == 0 else "right")
        for row in self._texts():
            table.add_row(*row)
        return table

    def _texts(self) -> Iterator[tuple[str, ...]]:
        for row in self.rows:
            yield tuple(
                "–" if c is None else f"{c:.4g}" if isinstance(c, float) else str(c) for c in row
            )


@dataclass(frozen=True)
class Report:
    """Tables and figures of a benchmark; ``str`` gives what is printed."""

    name: str
    title: str
    data: Sheet  # rows of the CSV file
    sheets: tuple[Sheet, ...]  # printed, and in the report
    figures: dict[str, bytes] = field(default_factory=dict)  # file name → its PNG
    command: str = ""  # that makes the report anew
    seconds: float = 0.0  # by the clock
    processor: float = 0.0  # s, children included; less than seconds if other programs worked
    files: tuple[Path, ...] = ()  # that were written

    def write(self, directory: Path) -> tuple[Path, ...]:
        """Write ``NAME.csv``, ``NAME.md`` and the figures; return their paths."""
        stream = io.StringIO()
        csv.writer(stream, lineterminator="\n").writerows([self.data.columns, *self.data.rows])
        machine = (
            f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, "
            f"numpy {np.__version__}, scipy {scipy.__version__}."
        )
        parts = [f"# {self.title}", f"    {self.command}", f"{self.taken} {machine}"]
        parts += [f"![{name}]({name})" for name in self.figures]
        parts += [sheet.markdown() for sheet in self.sheets]
        contents = {
            f"{self.name}.csv": stream.getvalue().encode(),
            f"{self.name}.md": ("\n\n".join(parts) + "\n").encode(),
            **self.figures,
        }
        directory.mkdir(parents=True, exist_ok=True)
        for name, content in contents.items():
            (directory / name).write_bytes(content)
        return tuple(directory / name for name in contents)

    @property
    def taken(self) -> str:
        """A sentence on how long it took, and whether the machine was quiet."""
        share = min(1.0, self.processor / self.seconds) if self.seconds else 1.0
        quiet = "" if share > QUIET else " The machine was busy: take the times with care."
        return f"Taken in {self.seconds:.0f} s, {100.0 * share:.0f} % of one core.{quiet}"

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


Study = Callable[[bool], Report]


def run(study: Study, *, quick: bool = False, directory: str | Path | None = None) -> Report:
    """Do a study and write its report into a directory, ``results/study-NAME`` if none is given."""
    begin, busy = time.perf_counter(), sum(os.times()[:4])
    report = study(quick)
    seconds, processor = time.perf_counter() - begin, sum(os.times()[:4]) - busy
    script = Path(study.__code__.co_filename).resolve()
    script = script.relative_to(ROOT) if script.is_relative_to(ROOT) else script
    command = f"python {script.as_posix()}{' --quick' if quick else ''}"
    report = replace(report, command=command, seconds=seconds, processor=processor)
    return replace(report, files=report.write(Path(directory or f"results/study-{report.name}")))


def main(study: Study) -> None:
    """Do a study by the arguments of the command line, and print its tables."""
    parser = argparse.ArgumentParser(description=sys.modules[study.__module__].__doc__)
    parser.add_argument("--quick", action="store_true", help="coarse: seconds, with less to learn")
    parser.add_argument("-o", type=Path, metavar="DIR", help="default: results/study-NAME")
    given = parser.parse_args()
    print(run(study, quick=given.quick, directory=given.o))


def installed(module: str) -> bool:
    """Return whether a module can be imported."""
    return find_spec(module) is not None


def left_out(modules: Iterable[str]) -> str:
    """Return one line about modules that are not installed, empty if all are."""
    missing = ", ".join(module for module in modules if not installed(module))
    return f"Left out, not installed: {missing} (pip install 'anmstrip[peers]')." if missing else ""


@dataclass(frozen=True)
class Reply:
    """Answer of a process (None if it failed), how it ended, and its seconds by the clock."""

    said: Any
    outcome: str
    seconds: float


def ask(script: str, *words: str, limit: float | None = None) -> Reply:
    """Run a script in a process of its own, on one core; its last line is JSON."""
    begin = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, script, *words],
            check=False, capture_output=True, text=True, timeout=limit,
            env={**os.environ, **ONE_CORE},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Reply(None, f"not done in {limit:g} s", float(limit or 0.0))
    spent = time.perf_counter() - begin
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        return Reply(None, f"failed: {said[-1][:80]}", spent)
    return Reply(json.loads(done.stdout.strip().splitlines()[-1]), "done", spent)
