"""Figures of the studies, drawn without a display."""

# ruff: noqa: PLC0415 - matplotlib takes long to import
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Bars = Sequence[tuple[str, Mapping[str, float]]]

Curve = tuple[Sequence[float], Sequence[float]]

Curves = Mapping[str, Mapping[str, Sequence[tuple[float, float]]]]
"""Title of a panel → name of a curve → its points."""


@dataclass(frozen=True)
class Plot:
    """Curves in one pair of axes.

    Attributes
    ----------
    x, y : str
        Labels.
    curves : mapping
        Label → abscissae and ordinates.
    scales : tuple of str
        Of matplotlib, for x and y.
    title : str
    """

    x: str
    y: str
    curves: Mapping[str, Curve]
    scales: tuple[str, str] = ("log", "log")
    title: str = ""


def curves(*plots: Plot) -> bytes:
    """Plots side by side, with one legend; a PNG.

    A curve has the same colour in all plots, dashed from the second round of colours on.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(plots) + 1.6, 3.6), dpi=100, layout="constrained")
    names = list(dict.fromkeys(name for plot in plots for name in plot.curves))
    shown = {}
    for axes, plot in zip(figure.subplots(1, len(plots), squeeze=False)[0], plots, strict=True):
        for name, (x, y) in plot.curves.items():
            rounds, colour = divmod(names.index(name), 10)
            style = {"color": f"C{colour}", "linestyle": ("-", "--", ":")[rounds % 3]}
            shown[name] = axes.plot(x, y, marker="o", markersize=3, linewidth=1.2, **style)[0]
        axes.set(title=plot.title, xlabel=plot.x, ylabel=plot.y)
        axes.set(xscale=plot.scales[0], yscale=plot.scales[1])
        axes.grid(True, which="major", linewidth=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    lines = [shown[name] for name in names]
    figure.legend(lines, names, frameon=False, loc="outside right upper", fontsize=8)
    return _png(figure)


def stacked(panels: Mapping[str, Bars], unit: str) -> bytes:
    """Stacked bars, one panel beside the other; a PNG.

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
    """Points joined by lines on logarithmic axes, one panel beside the other; a PNG.

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


def _png(figure: Figure) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    stream = BytesIO()
    FigureCanvasAgg(figure).print_png(stream)
    return stream.getvalue()
