"""True errors beside what they cost: runs, fits, and the figure of both."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from anmstrip.studies.figures import Plot, curves
from anmstrip.studies.reports import Sheet

Value = Callable[["Measured"], float]


@dataclass(frozen=True)
class Measured:
    """One run.

    Attributes
    ----------
    line : str
        Which runs it belongs to.
    at : float
        What is varied along the line.
    error : float
        Against a reference.
    tangents : int
        Factorised.
    seconds : float
        Of the processor.
    """

    line: str
    at: float
    error: float
    tangents: int
    seconds: float


def measured(line: str, at: float, run: Callable[[], tuple[float, int]]) -> Measured:
    """Time a run that returns error and tangents."""
    begin = time.process_time()
    error, tangents = run()
    return Measured(line, at, error, tangents, time.process_time() - begin)


def patiently(
    grid: Iterable[float], run: Callable[[float], Measured], patience: float
) -> Iterator[Measured]:
    """Runs of one line, from cheap to dear, up to the first that takes longer than patience."""
    for at in grid:
        found = run(at)
        yield found
        if found.seconds > patience:
            return


def sheet(title: str, at: str, runs: Iterable[Measured], note: str = "") -> Sheet:
    """A row for every run."""
    columns = ("line", at, "error", "tangents", "seconds")
    rows = tuple((r.line, r.at, r.error, r.tangents, r.seconds) for r in runs)
    return Sheet(title, columns, rows, note)


def crossed(title: str, runs: Sequence[Measured], value: Value, note: str = "") -> Sheet:
    """A row for every line, a column for what is varied along it."""
    places = list(dict.fromkeys(r.at for r in runs))
    rows = []
    for line, own in by_line(runs).items():
        found = {r.at: value(r) for r in own}
        rows.append((line, *(found.get(at) for at in places)))
    return Sheet(title, ("line", *(f"{at:.3g}" for at in places)), tuple(rows), note)


def by_line(runs: Sequence[Measured]) -> dict[str, list[Measured]]:
    """The runs of every line."""
    return {
        line: [r for r in runs if r.line == line] for line in dict.fromkeys(r.line for r in runs)
    }


def plotted(runs: Sequence[Measured], x: tuple[str, Value], y: tuple[str, Value]) -> Plot:
    """One quantity of the runs against another, both with their labels."""
    lines = by_line(runs).items()
    pairs = {line: ([x[1](r) for r in own], [y[1](r) for r in own]) for line, own in lines}
    return Plot(x[0], y[0], pairs)


def work_precision(runs: Sequence[Measured], label: str) -> bytes:
    """Error against seconds, and against tangents; a PNG."""
    error: tuple[str, Value] = (label, lambda r: r.error)
    return curves(
        plotted(runs, ("seconds of one core", lambda r: r.seconds), error),
        plotted(runs, ("tangents", lambda r: r.tangents), error),
    )


@dataclass(frozen=True)
class Fit:
    """A straight line y = slope x + base, and the share of y's variance that it explains."""

    slope: float
    base: float
    r2: float

    def __str__(self) -> str:
        return f"{self.base:.3g} {self.slope:+.3g} x, R² = {self.r2:.3f}"


def fitted(x: Sequence[float], y: Sequence[float]) -> Fit:
    """The straight line of least squares."""
    slope, base = np.polyfit(x, y, 1)
    rest = np.asarray(y) - (slope * np.asarray(x) + base)
    return Fit(float(slope), float(base), float(1.0 - rest.var() / max(np.var(y), 1e-300)))


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """Slope between logarithms: y ~ x^p."""
    return fitted(np.log(x).tolist(), np.log(y).tolist()).slope
