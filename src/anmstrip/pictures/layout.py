"""A line of rollers before it runs, drawn from the side: strip, wraps, and directions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from anmstrip.arrays import Array
from anmstrip.pictures.views import GREYS, OUTLINE, STEEL

SUFFIXES = (".png", ".svg", ".pdf")
"""Kinds of files that can be drawn, by their names."""

ARROWS = 6
"""Arrows along the strip that show which way it travels."""

SMALL = 0.04
"""Radius of a roller, over the larger side of the picture, that has no room for a caption."""

ROOM = 0.08
"""Room around the line, over its larger side."""


class Wheel(NamedTuple):
    """A roller seen from the side."""

    centre: Array  # x, z (m)
    radius: float  # m
    clockwise: bool  # which way a positive speed turns it
    caption: str
    arc: Array  # points of the strip on it, x, z (m), (2, n); none where it is not touched


def draw_layout(picture: Path, title: str, line: Array, wheels: Sequence[Wheel]) -> None:
    """Draw a line as its strip would lie if it were a string.

    Parameters
    ----------
    picture : Path
        File to write, see ``SUFFIXES``.
    title : str
    line : ndarray, shape (2, n)
        Points x, z of the strip from entry to exit (m).
    wheels : sequence of Wheel
    """
    circles = [
        wheel.centre[:, None] + wheel.radius * np.array([[-1, 1], [-1, 1]]) for wheel in wheels
    ]
    everything = np.hstack([line, *circles])
    low, high = everything.min(axis=1), everything.max(axis=1)
    room = ROOM * float((high - low).max())
    width, height = high - low + 2.0 * room
    inches = 12.0, float(np.clip(12.0 * height / width, 3.0, 12.0)) + 0.8
    figure = Figure(figsize=inches, dpi=100, facecolor="white", layout="constrained")
    axes = figure.add_subplot(title=title, xlabel="x [m]", ylabel="z [m]", aspect="equal")
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
    axes.spines[["top", "right"]].set_visible(False)
    for wheel in wheels:
        draw_wheel(axes, wheel, line, wheel.radius < SMALL * max(width, height))
    axes.plot(*line, color=OUTLINE, linewidth=2.0, zorder=3)
    draw_travel(axes, line)
    for name, place, along in (("entry", line[:, 0], -1), ("exit", line[:, -1], 1)):
        side = "right" if along * (line[0, -1] - line[0, 0]) < 0.0 else "left"
        axes.annotate(name, tuple(place), (0, 8), textcoords="offset points", ha=side, fontsize=11)
    figure.savefig(picture)


def draw_wheel(axes: Axes, wheel: Wheel, line: Array, small: bool) -> None:
    """Draw a roller with its wrap, and an arrow in the sense of a positive speed.

    Its caption stands on it, or beside it away from the strip if it is small.
    """
    axes.add_patch(Circle(tuple(wheel.centre), wheel.radius, color=GREYS[1], zorder=1))
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
        away = -to_strip.mean(axis=1) if wheel.arc.size else -nearest
        away /= np.hypot(*away) or 1.0
        place, shift = wheel.centre + wheel.radius * away, 6.0 * away
        if abs(away[0]) > abs(away[1]):
            across = "left" if away[0] > 0.0 else "right"
        else:
            upright = "bottom" if away[1] > 0.0 else "top"
    axes.annotate(
        wheel.caption,
        tuple(place),
        (float(shift[0]), float(shift[1])),
        textcoords="offset points",
        ha=across,
        va=upright,
        fontsize=9,
    )


def draw_travel(axes: Axes, line: Array) -> None:
    """Draw arrows along a strip, from entry to exit, equally far apart."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=1), axis=0)))
    for share in (np.arange(ARROWS) + 0.5) / ARROWS:
        begin, end = (
            (np.interp(at * s[-1], s, line[0]), np.interp(at * s[-1], s, line[1]))
            for at in (share, share + 1e-3)
        )
        style = {"arrowstyle": "-|>", "color": OUTLINE, "mutation_scale": 18}
        axes.annotate("", end, begin, arrowprops=style, zorder=6)
