"""Figures of the benchmarks, and runs measured by their error and their cost."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harness import Sheet

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Bars = Sequence[tuple[str, Mapping[str, float]]]

Curve = tuple[Sequence[float], Sequence[float]]

Curves = Mapping[str, Mapping[str, Sequence[tuple[float, float]]]]
"""Title of a panel → name of a curve → its points."""


@dataclass(frozen=True)
class Plot:
    """Curves in one pair of axes."""

    x: str  # label
    y: str  # label
    curves: Mapping[str, Curve]  # Label → abscissae and ordinates
    scales: tuple[str, str] = ("log", "log")  # of matplotlib, for x and y
    title: str = ""


LEGEND = 9
"""Most curves of a plot that a legend tells apart; more are drawn in a plot for each problem."""


def by_problem(plot: Plot) -> list[Plot]:
    """Return a plot for each problem, whose name stands before the last comma of a curve's."""
    if plot.title or len(plot.curves) <= LEGEND:
        return [plot]
    found: dict[str, dict[str, Curve]] = {}
    for name, curve in plot.curves.items():
        problem, _, way = name.rpartition(", ")
        found.setdefault(problem, {})[f"order {way}" if way.isdigit() else way] = curve
    return [replace(plot, title=problem, curves=own) for problem, own in found.items()]


def few_ticks(axis: Axis) -> None:
    """Label a logarithmic axis by powers of ten, or by 1, 2 and 5 where it has fewer than two."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    low, high = axis.get_view_interval()
    if axis.get_scale() == "log" and low > 0.0:
        if high < 100.0 * low:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_formatter(NullFormatter())


def curves(*plots: Plot) -> bytes:
    """Draw plots side by side, with one legend; a PNG.

    Those of many curves have a row each, with a panel for every problem.  A curve has the same
    colour in all plots, dashed from the second round of colours on.
    """
    from matplotlib.figure import Figure

    parts = [by_problem(plot) for plot in plots]
    rows = parts if max(map(len, parts)) > 1 else [[plot for own in parts for plot in own]]
    size = max(map(len, rows)), len(rows)
    figure = Figure(figsize=(4.2 * size[0] + 1.6, 3.6 * size[1]), dpi=100, layout="constrained")
    panels = figure.subplots(*size[::-1], squeeze=False).ravel()
    plots = tuple(plot for own in rows for plot in own)
    names = list(dict.fromkeys(name for plot in plots for name in plot.curves))
    shown = {}
    for axes, plot in zip(panels, plots, strict=True):
        for name, (x, y) in plot.curves.items():
            rounds, colour = divmod(names.index(name), 10)
            style = {"color": f"C{colour}", "linestyle": ("-", "--", ":")[rounds % 3]}
            shown[name] = axes.plot(x, y, marker="o", markersize=3, linewidth=1.2, **style)[0]
        axes.set(title=plot.title, xlabel=plot.x, ylabel=plot.y)
        axes.set(xscale=plot.scales[0], yscale=plot.scales[1])
        axes.grid(True, which="major", linewidth=0.3)
        axes.spines[["top", "right"]].set_visible(False)
        few_ticks(axes.xaxis)
        few_ticks(axes.yaxis)
    lines = [shown[name] for name in names]
    figure.legend(lines, names, frameon=False, loc="outside right upper", fontsize=8)
    return _png(figure)


def stacked(panels: Mapping[str, Bars], unit: str) -> bytes:
    """Draw stacked bars, one panel beside the other; a PNG.

    Parameters
    ----------
    panels : mapping
        Title → bars, each a label and its parts (name → seconds).
    unit : str
        Of the axis; the parts are drawn in thousandths.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.0 * len(panels), 3.6), dpi=130, layout="constrained")
    names = list(dict.fromkeys(n for bars in panels.values() for _, part in bars for n in part))
    for axes, (title, bars) in zip(figure.subplots(1, len(panels)), panels.items(), strict=True):
        labels = [f"+ {label}" if i else label for i, (label, _) in enumerate(bars)]
        base = [0.0] * len(bars)
        for colour, name in enumerate(names):
            heights = [1e3 * parts.get(name, 0.0) for _, parts in bars]
            axes.bar(labels, heights, bottom=base, color=f"C{colour}", label=name)
            base = [b + h for b, h in zip(base, heights, strict=True)]
        axes.set(title=title, ylabel=unit)
        axes.tick_params(axis="x", labelrotation=60)
        axes.spines[["top", "right"]].set_visible(False)
    handles, shown = axes.get_legend_handles_labels()
    figure.legend(handles, shown, frameon=False, loc="outside right upper", fontsize=8)
    return _png(figure)


def against(panels: Curves, across: str, up: str) -> bytes:
    """Draw points joined by lines on logarithmic axes, one panel beside the other; a PNG.

    Parameters
    ----------
    panels : mapping
    across, up : str
        What the axes show.
    """
    plots = []
    for title, named in panels.items():
        pairs = {name: list(zip(*points, strict=True)) for name, points in named.items()}
        columns = {name: (x, y) for name, (x, y) in pairs.items()}
        plots.append(Plot(across, up, columns, title=title))
    return curves(*plots)


@dataclass(frozen=True)
class Line:
    """A line, or points where ``mark`` says which."""

    label: str  # of points it is shown once in a panel
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    mark: str = ""  # As matplotlib names it; empty for a line


@dataclass(frozen=True)
class Map:
    """Heights over a flat strip."""

    x: NDArray[np.float64]  # shape (points,)
    y: NDArray[np.float64]
    height: NDArray[np.float64]


def mapped(panels: Mapping[str, Map], x: str, y: str) -> bytes:
    """Draw heights in colours, red up and blue down, one panel above the other; a PNG.

    Parameters
    ----------
    panels : mapping
        Title → heights.
    x, y : str
        Labels of the axes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 2.6 * len(panels)), dpi=130, layout="constrained")
    grid = figure.subplots(len(panels), 1, squeeze=False)
    for axes, (title, found) in zip(grid[:, 0], panels.items(), strict=True):
        top = np.abs(found.height).max()
        levels = np.linspace(-top, top, 20)
        axes.tricontourf(found.x, found.y, found.height, levels=levels, cmap="RdBu_r")
        axes.set_title(title, fontsize=9)
        axes.set(xlabel=x, ylabel=y, aspect="equal")
    return _png(figure)


def drawn(panels: Mapping[str, Sequence[Line]], x: str, y: str) -> bytes:
    """Draw lines, one panel beside the other, each with axes of its own; a PNG.

    Parameters
    ----------
    panels : mapping
        Title → lines; points take the colour of the line before them.
    x, y : str
        Labels of the axes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(panels), 3.4), dpi=130, layout="constrained")
    for axes, (title, lines) in zip(figure.subplots(1, len(panels)), panels.items(), strict=True):
        colour = -1
        for line in lines:
            colour += not line.mark
            style = {"marker": line.mark, "linestyle": "none", "markersize": 4}
            axes.plot(line.x, line.y, color=f"C{colour}", **(style if line.mark else {}),
                      label=None if line.mark and colour else line.label)  # fmt: skip
        axes.set_title(title, fontsize=9)
        axes.set(xlabel=x, ylabel=y)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, fontsize=7)
    return _png(figure)


def _png(figure: Figure) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    stream = BytesIO()
    FigureCanvasAgg(figure).print_png(stream)
    return stream.getvalue()


# work and precision -----------------------------------------------------------

Value = Callable[["Measured"], float]


@dataclass(frozen=True)
class Measured:
    """A run with its error and its cost."""

    line: str  # name of the runs that it belongs to
    at: float  # value that varies along the line
    error: float  # against a reference
    tangents: int  # factorised
    seconds: float  # of the processor


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
    """Return a plot of one quantity of the runs against another, both with their labels."""
    lines = by_line(runs).items()
    pairs = {line: ([x[1](r) for r in own], [y[1](r) for r in own]) for line, own in lines}
    return Plot(x[0], y[0], pairs)


def work_precision(runs: Sequence[Measured], label: str) -> bytes:
    """Draw the error against seconds, and against tangents; a PNG."""
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
    """Return the slope between logarithms: y ~ x^p."""
    return fitted(np.log(x).tolist(), np.log(y).tolist()).slope
