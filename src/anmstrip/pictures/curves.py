"""Drawings with matplotlib: a line from the side before it runs; curves of studies."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from anmstrip.arrays import Array
from anmstrip.pictures.render import OUTLINE, ROLLER_COLOURS, STEEL
from anmstrip.results.files import atomic_write

Rows = Sequence[Mapping[str, Any]]
"""Rows of a table, by columns."""

PANELS = {
    "tension_out": ("tension behind the roller [kN/m]", 1e-3),
    "torque": ("torque on the strip [N m]", 1.0),
    "slip_arc": ("slip arc [°]", 180.0 / np.pi),
    "capacity_used": ("share of friction that is used [%]", 100.0),
    "offset": ("offset to +y where the strip runs on [mm]", 1e3),
}
"""Columns of a map that are drawn for every roller, with their titles and units."""

MAX_LEGEND = 12
"""Most curves that a legend tells apart."""


def paneled_figure(
    rows: int, columns: int, inches: tuple[float, float], **shared: Any
) -> tuple[Figure, Sequence[Axes]]:
    """Return a figure and its panels row by row, open above and at the right."""
    figure = Figure(figsize=inches, dpi=130, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, **shared).ravel()
    for axes in panels:
        axes.spines[["top", "right"]].set_visible(False)
    return figure, panels


def map_figure(rows: Rows, keys: Sequence[str], rollers: Sequence[str], events: Rows) -> Figure:
    """Draw what every roller does over the first control.

    Parameters
    ----------
    rows : sequence of mapping
        Of ``map.csv``.
    keys : sequence of str
        One or two controls; values of the second are curves that grow darker.
    rollers : sequence of str
    events : sequence of mapping
        Dashed lines where rollers lose or regain their grip, dotted ones at folds.
    """
    flat = not any(row[f"{name}_offset"] for row in rows for name in rollers)
    panels = [column for column in PANELS if not (flat and column == "offset")]
    lines = (len(panels) + 1) // 2
    figure, grid = paneled_figure(lines, 2, (10.0, 3.2 * lines), sharex=True)
    curves = list(dict.fromkeys(row[keys[1]] if len(keys) == 2 else 0.0 for row in rows))
    strengths = np.linspace(1.0, 0.3, max(len(curves), 1))[::-1]
    colours = colormaps["turbo"](np.linspace(0.08, 0.92, max(len(rollers), 2)))
    for axes, column in zip(grid, panels, strict=False):
        title, unit = PANELS[column]
        for strength, second in zip(strengths, curves, strict=False):
            chosen = [row for row in rows if len(keys) == 1 or row[keys[1]] == second]
            x = [row[keys[0]] for row in chosen]
            if column == "tension_out":
                y = unit * np.array([row["entry_tension"] for row in chosen])
                axes.plot(x, y, color="black", alpha=strength, label="entry")
            for name, colour in zip(rollers, colours, strict=False):
                y = unit * np.array([row[f"{name}_{column}"] for row in chosen], dtype=float)
                axes.plot(x, y, color=colour, alpha=strength, label=name)
        for event in events:
            style = ":" if event["kind"] == "fold" else "--"
            axes.axvline(event[keys[0]], color="grey", linewidth=0.8, linestyle=style)
        axes.set_title(title, fontsize=10)
        axes.xaxis.set_major_locator(MaxNLocator(4))  # long labels would overlap
    labels = dict(zip(*grid[0].get_legend_handles_labels()[::-1], strict=True))
    if len(labels) <= MAX_LEGEND:
        beside: dict[str, Any] = {"loc": "outside right upper", "frameon": False, "fontsize": 8}
        figure.legend(list(labels.values()), list(labels), **beside)
    figure.supxlabel(keys[0], fontsize=10)  # below the offset of the ticks
    for axes in grid[len(panels) :]:
        axes.remove()
        grid[len(panels) - 2].xaxis.set_tick_params(labelbottom=True)
        grid[len(panels) - 2].xaxis.offsetText.set_visible(True)
    if len(keys) == 2 and curves:
        told = f"{keys[1]} from {min(curves):.6g} (pale) to {max(curves):.6g}"
        figure.suptitle(told, fontsize=10)
    return figure


def response_figure(omega: Array, gain: Array, phase: Array, title: str) -> Figure:
    """Draw gain and phase (°) over the angular frequency (rad/s)."""
    figure, (upper, lower) = paneled_figure(2, 1, (7.0, 5.6), sharex=True)
    upper.loglog(omega, gain)
    lower.semilogx(omega, phase)
    upper.set(title=title, ylabel="gain")
    lower.set(xlabel="angular frequency [rad/s]", ylabel="phase [°]")
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    return figure


def accuracy_figure(rows: Rows, tension: float) -> Figure:
    """Draw true errors of tensions against seconds and tangents, and the estimates as crosses.

    Parameters
    ----------
    rows : sequence of mapping
        Of ``accuracy.csv``; those without a true error are left out.
    tension : float
        That errors are shares of (N/m).
    """
    figure, panels = paneled_figure(1, 2, (11.0, 4.6), sharey=True)
    axes_of = dict(zip(("seconds", "tangents"), panels, strict=True))
    for number, along in enumerate(dict.fromkeys(row["along"] for row in rows)):
        colour, dashed = f"C{number}", "--" if along == "newton" else "-"
        chosen = [row for row in rows if row["along"] == along and row.get("true_tension")]
        errors = [100.0 * row["true_tension"] / tension for row in chosen]
        for cost, axes in axes_of.items():
            spent = [row[cost] for row in chosen]
            axes.plot(spent, errors, dashed, color=colour, marker="o", markersize=4, label=along)
            for row, x, y in zip(chosen, spent, errors, strict=True):
                told = row["value"] if along != "mesh" else f"{row['element']:.2g} m"
                told = told if isinstance(told, str) else f"{told:.3g}"
                place: dict[str, Any] = {"xytext": (4, 3), "textcoords": "offset points"}
                axes.annotate(told, (x, y), color=colour, fontsize=7, **place)
                if estimate := row.get("estimated_tension"):
                    share = 100.0 * estimate / tension
                    axes.plot(x, share, "x", color=colour, markersize=4, alpha=0.6)
    known = any(row.get("true_tension") for row in rows)
    for cost, axes in axes_of.items() if known else ():
        axes.set(xscale="log", yscale="log", xlabel=cost)
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("error of tensions [%]; crosses: estimates")
    panels[1].legend(frameon=False, fontsize=8)
    return figure


MAX_CURVES = 7
"""Most values of a second key that are drawn as curves; more of them make a map."""


def sweep_figure(rows: Rows, varied: Sequence[str]) -> Figure:
    """Draw a panel for every roller: tension ratio against the first key.

    A second key makes curves, or a map if it has many values; further keys more curves.
    Without rollers the tensions of the edges are drawn. What has not ended is left out.
    """
    drawn = {name for row in rows for name in row if row[name] is not None}
    found = [name for name in dict.fromkeys(name for row in rows for name in row) if name in drawn]
    ratios = [name for name in found if name.endswith("_tension_ratio")]
    columns = ratios or ["entry_tension", "exit_tension"]
    figure, panels = paneled_figure(1, len(columns), (4.8 * len(columns), 3.8))
    second = {json.dumps(row[varied[1]]) for row in rows} if len(varied) == 2 else set()
    draw = draw_map if len(second) > MAX_CURVES else draw_curves
    for axes, name in zip(panels, columns, strict=True):
        draw(axes, rows, varied, np.array([row.get(name) for row in rows], dtype=float))
        axes.set_title(name.replace("_", " "))
    return figure


def draw_curves(axes: Axes, rows: Rows, varied: Sequence[str], values: Array) -> None:
    """Draw values against the first key, a curve for each choice of the others."""
    first, *others = varied
    curves: dict[str, list[tuple[float, float]]] = {}
    for row, place, value in zip(rows, axis_places(axes.xaxis, rows, first), values, strict=True):
        label = ", ".join(f"{key} = {json.dumps(row[key])}" for key in others)
        curves.setdefault(label, []).append((place, value))
    for label, points in curves.items():
        axes.plot(*np.array(sorted(points)).T, marker="o", markersize=3, label=label)
    if others and len(curves) <= MAX_CURVES:
        axes.legend(frameon=False, fontsize=7)


def draw_map(axes: Axes, rows: Rows, varied: Sequence[str], values: Array) -> None:
    """Draw values by colour over two keys."""
    x, i = np.unique(axis_places(axes.xaxis, rows, varied[0]), return_inverse=True)
    y, j = np.unique(axis_places(axes.yaxis, rows, varied[1]), return_inverse=True)
    grid = np.full((len(y), len(x)), np.nan)
    grid[j, i] = values
    mesh = axes.pcolormesh(x, y, np.ma.masked_invalid(grid), shading="nearest")
    axes.spines[:].set_visible(True)
    axes.get_figure(root=True).colorbar(mesh, ax=axes)  # type: ignore[union-attr]


def axis_places(axis: Axis, rows: Rows, key: str) -> list[float]:
    """Prepare an axis for a key and return the place of every row on it.

    Values that are no numbers stand side by side; decades get a logarithmic axis.
    """
    axes, horizontal = axis.axes, axis is axis.axes.xaxis
    axis.set_label_text(key)
    texts = [json.dumps(row[key]) for row in rows]
    values = list(dict.fromkeys(texts))
    try:
        places = {value: float(value) for value in values}
    except ValueError:
        places = {value: float(place) for place, value in enumerate(values)}
        ticks = list(places.values())
        axis.set_ticks(ticks, labels=values)
        axes.update_datalim(np.column_stack([ticks, ticks]), horizontal, not horizontal)
    else:
        if 0.0 < 100.0 * min(places.values()) <= max(places.values()):
            (axes.set_xscale if horizontal else axes.set_yscale)("log")
    return [places[text] for text in texts]


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure all at once, as its name says, see ``SUFFIXES``."""
    with atomic_write(path) as temporary:
        figure.savefig(temporary, format=path.suffix.removeprefix(".").lower())


SUFFIXES = (".png", ".svg", ".pdf")
"""Kinds of files that can be drawn, by their names."""

TRAVEL_ARROWS = 6
"""Arrows along the strip that show which way it travels."""

SMALL_ROLLER = 0.04
"""Radius of a roller, over the larger side of the picture, that has no room for a caption."""

LINE_MARGIN = 0.08
"""Room around the line, over its larger side."""


class Wheel(NamedTuple):
    """A roller seen from the side."""

    centre: Array  # x, z (m)
    radius: float  # m
    clockwise: bool  # which way it turns
    caption: str
    arc: Array  # points of the strip on it, x, z (m), (2, n); none where it is not touched


def draw_layout(
    picture: Path, title: str, line: Array, wheels: Sequence[Wheel], backwards: bool = False
) -> None:
    """Draw a line as its strip would lie if it were a string.

    Parameters
    ----------
    picture : Path
        File to write, see ``SUFFIXES``.
    title : str
    line : ndarray, shape (2, n)
        Points x, z of the strip from entry to exit (m).
    wheels : sequence of Wheel
    backwards : bool
        Whether the strip travels from exit to entry.
    """
    square = np.array([[-1, 1], [-1, 1]])
    circles = [wheel.centre[:, None] + wheel.radius * square for wheel in wheels]
    everything = np.hstack([line, *circles])
    low, high = everything.min(axis=1), everything.max(axis=1)
    room = LINE_MARGIN * float((high - low).max())
    width, height = high - low + 2.0 * room
    inches = 12.0, float(np.clip(12.0 * height / width, 3.0, 12.0)) + 0.8
    figure = Figure(figsize=inches, dpi=100, facecolor="white", layout="constrained")
    axes = figure.add_subplot(title=title, xlabel="x [m]", ylabel="z [m]", aspect="equal")
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
    axes.spines[["top", "right"]].set_visible(False)
    for wheel in wheels:
        draw_wheel(axes, wheel, line, wheel.radius < SMALL_ROLLER * max(width, height))
    axes.plot(*line, color=OUTLINE, linewidth=2.0, zorder=3)
    draw_travel(axes, line[:, ::-1] if backwards else line)
    for name, place, along in (("entry", line[:, 0], -1), ("exit", line[:, -1], 1)):
        side = "right" if along * (line[0, -1] - line[0, 0]) < 0.0 else "left"
        axes.annotate(name, tuple(place), (0, 8), textcoords="offset points", ha=side, fontsize=11)
    save_figure(figure, picture)


def draw_wheel(axes: Axes, wheel: Wheel, line: Array, small: bool) -> None:
    """Draw a roller with its wrap, and an arrow in the sense in which it turns.

    Its caption stands on it, or beside it if it is small: beyond its wrap, where no strip is, or
    away from the strip that passes it.
    """
    axes.add_patch(Circle(tuple(wheel.centre), wheel.radius, color=ROLLER_COLOURS[1], zorder=1))
    axes.plot(*wheel.arc, color=STEEL[3], linewidth=6.0, solid_capstyle="butt", zorder=2)
    turn = -1.0 if wheel.clockwise else 1.0
    angle = turn * np.radians(np.linspace(-60.0, 60.0, 25)) + 0.5 * np.pi
    ring = wheel.centre[:, None] + 0.8 * wheel.radius * np.stack([np.cos(angle), np.sin(angle)])
    axes.plot(*ring, color="black", linewidth=1.2, zorder=4)
    style = {"arrowstyle": "-|>", "color": "black"}
    axes.annotate("", tuple(ring[:, -1]), tuple(ring[:, -3]), arrowprops=style)
    place, shift, across, upright = wheel.centre, np.zeros(2), "center", "center"
    if small:
        to_strip = (wheel.arc if wheel.arc.size else line) - wheel.centre[:, None]
        nearest = to_strip[:, np.hypot(*to_strip).argmin()]
        away = to_strip.mean(axis=1) if wheel.arc.size else -nearest
        away /= np.hypot(*away) or 1.0
        place, shift = wheel.centre + wheel.radius * away, 6.0 * away
        if abs(away[0]) > abs(away[1]):
            across = "left" if away[0] > 0.0 else "right"
        else:
            upright = "bottom" if away[1] > 0.0 else "top"
    how: dict[str, Any] = {"ha": across, "va": upright, "textcoords": "offset points"}
    by = float(shift[0]), float(shift[1])
    axes.annotate(wheel.caption, tuple(place), by, fontsize=9, **how)


def draw_travel(axes: Axes, line: Array) -> None:
    """Draw arrows along a line of points, x and z (m), equally far apart."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=1), axis=0)))
    for share in (np.arange(TRAVEL_ARROWS) + 0.5) / TRAVEL_ARROWS:
        at = np.array([share, share + 1e-3]) * s[-1]
        begin, end = zip(*(np.interp(at, s, along) for along in line), strict=True)
        style = {"arrowstyle": "-|>", "color": OUTLINE, "mutation_scale": 18}
        axes.annotate("", end, begin, arrowprops=style, zorder=6)
