"""The figure of a sweep: what the rollers do to the tension, against what varies."""

# ruff: noqa: PLC0415 - matplotlib takes long to import
from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
