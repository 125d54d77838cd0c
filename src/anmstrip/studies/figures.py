"""Figures of the studies, drawn without a display."""

# ruff: noqa: PLC0415 - matplotlib takes long to import
from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO

Bars = Sequence[tuple[str, Mapping[str, float]]]


def stacked(panels: Mapping[str, Bars], unit: str) -> bytes:
    """Stacked bars, one panel beside the other; a PNG.

    Parameters
    ----------
    panels : mapping
        Title → bars, each a label and its parts (name → seconds).
    unit : str
        Of the axis; the parts are drawn in thousandths.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
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
    stream = BytesIO()
    FigureCanvasAgg(figure).print_png(stream)
    return stream.getvalue()
