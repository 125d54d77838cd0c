"""Figures of the studies, drawn without a display."""

# ruff: noqa: PLC0415 - matplotlib takes long to import
from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any

Bars = Sequence[tuple[str, Mapping[str, float]]]

Curves = Mapping[str, Mapping[str, Sequence[tuple[float, float]]]]
"""Title of a panel → name of a curve → its points."""


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
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(panels) + 2.0, 3.6), dpi=130, layout="constrained")
    names = list(dict.fromkeys(name for curves in panels.values() for name in curves))
    shown = {}
    drawn = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    for axes, (title, curves) in zip(drawn, panels.items(), strict=True):
        for name, points in curves.items():
            x, y = zip(*points, strict=True)
            colour = f"C{names.index(name)}"
            (shown[name],) = axes.loglog(x, y, "o-", color=colour, markersize=3.0, linewidth=1.0)
        axes.set(title=title, xlabel=across)
        axes.spines[["top", "right"]].set_visible(False)
    drawn[0].set_ylabel(up)
    figure.legend([*shown.values()], [*shown], frameon=False, loc="outside right upper", fontsize=8)
    return _png(figure)


def _png(figure: Any) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    stream = BytesIO()
    FigureCanvasAgg(figure).print_png(stream)
    return stream.getvalue()
