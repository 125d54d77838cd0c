"""Paths of shells as pictures, drawn without a display."""

# ruff: noqa: PLC0415 - matplotlib takes long to import
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Line:
    """A line, or points where ``mark`` says which.

    Attributes
    ----------
    label : str
        Of points it is shown once in a panel.
    x, y : ndarray
    mark : str
        As matplotlib names it; empty for a line.
    """

    label: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    mark: str = ""


@dataclass(frozen=True)
class Map:
    """Heights over a flat strip.

    Attributes
    ----------
    x, y, height : ndarray, shape (points,)
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    height: NDArray[np.float64]


def mapped(panels: Mapping[str, Map], x: str, y: str) -> bytes:
    """Heights in colours, red up and blue down, one panel above the other; a PNG.

    Parameters
    ----------
    panels : mapping
        Title → heights.
    x, y : str
        Labels of the axes.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 2.6 * len(panels)), dpi=130, layout="constrained")
    grid = figure.subplots(len(panels), 1, squeeze=False)
    for axes, (title, found) in zip(grid[:, 0], panels.items(), strict=True):
        top = np.abs(found.height).max()
        levels = np.linspace(-top, top, 20)
        axes.tricontourf(found.x, found.y, found.height, levels=levels, cmap="RdBu_r")
        axes.set_title(title, fontsize=9)
        axes.set(xlabel=x, ylabel=y, aspect="equal")
    stream = BytesIO()
    FigureCanvasAgg(figure).print_png(stream)
    return stream.getvalue()


def drawn(panels: Mapping[str, Sequence[Line]], x: str, y: str) -> bytes:
    """Lines, one panel beside the other, each with axes of its own; a PNG.

    Parameters
    ----------
    panels : mapping
        Title → lines; points take the colour of the line before them.
    x, y : str
        Labels of the axes.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
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
    stream = BytesIO()
    FigureCanvasAgg(figure).print_png(stream)
    return stream.getvalue()
