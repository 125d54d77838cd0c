"""Drawing with matplotlib alone: the view in space without OpenGL, and the view from the side."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anmstrip.pictures.views import AMBIENT, GREYS, LIGHT, Eye, Frame, Job, title
from anmstrip.results.vtk import Points

Array = NDArray[np.float64]
Polygons = tuple[Array, Array, Array]
"""Corners (n, 4, 2), distances towards the eye (n,), colours (n, 3)."""

_DOTS_PER_INCH = 100
_IN_FRONT = 0.06  # as in `draw`, and more because facets are sorted by their middles
_ROOM = 0.25
_FACET = 0.03
_PIECES = 6
_MOST_PIECES = 64
_NO_VALUE = "#d9d9d9"


def draw_plot(job: Job) -> None:
    """Draw every frame of a job as seen in space, the farthest facets first."""
    for frame in job.frames:
        polygons = [_strip(job, frame), *_rollers(job, frame)]
        corners, towards, colours = map(np.concatenate, zip(*polygons, strict=True))
        order = np.argsort(towards)
        figure = _figure(job, frame)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), zorder=-1)
        axes.set_axis_off()
        axes.add_collection(
            PolyCollection(
                list(corners[order]),
                facecolors=colours[order],
                edgecolors=colours[order],
                linewidths=0.8,
            )
        )
        height = job.eye.half_height
        width = height * job.size[0] / job.size[1]
        axes.set(xlim=(-width, width), ylim=(-height, height))
        FigureCanvasAgg(figure).print_png(frame.picture)


def draw_side(job: Job) -> None:
    """Draw every frame of a job seen along y: the middle line of the strip, near the rollers."""
    for frame in job.frames:
        figure = _figure(job, frame)
        axes = figure.add_axes((0.07, 0.09, 0.9, 0.72))
        near = _add_rollers(axes, frame)
        segments, values = _middle_line(*frame.strip_coloured(job.field))
        lines = LineCollection(
            list(segments), colors=_colours(job, values), linewidths=5.0, capstyle="round"
        )
        axes.add_collection(lines)
        if near is None:
            near = np.array([segments.min(axis=(0, 1)), segments.max(axis=(0, 1))])
        _zoom(axes, near, job.size)
        axes.set(xlabel="x [m]", ylabel="z [m]")
        axes.spines[["top", "right"]].set_visible(False)
        FigureCanvasAgg(figure).print_png(frame.picture)


def _figure(job: Job, frame: Frame) -> Figure:
    """White sheet with the time and the scale."""
    inches = job.size[0] / _DOTS_PER_INCH, job.size[1] / _DOTS_PER_INCH
    figure = Figure(figsize=inches, dpi=_DOTS_PER_INCH, facecolor="white")
    figure.text(0.017, 0.945, f"t = {frame.time:.4g}", fontsize=14)
    label, factor = title(job.field, max(map(abs, job.limits)))
    low, high = (limit * factor for limit in job.limits)
    bar = figure.colorbar(
        ScalarMappable(Normalize(low, high), job.colours),
        cax=figure.add_axes((0.62, 0.845, 0.34, 0.04)),
        orientation="horizontal",
        ticks=np.linspace(low, high, 5),
        format="%.3g",
    )
    bar.outline.set_visible(False)
    bar.ax.xaxis.tick_top()
    bar.ax.tick_params(length=0, labelsize=12)
    bar.ax.set_title(label, fontsize=15, pad=24)
    return figure


def _colours(job: Job, values: Array) -> Array:
    low, high = job.limits
    colours = job.colours((values - low) / (high - low))[:, :3]
    colours[~np.isfinite(values)] = to_rgb(_NO_VALUE)
    return colours


def _strip(job: Job, frame: Frame) -> Polygons:
    points, cells, values = frame.strip_coloured(job.field)
    quads, levels = _refined(points[cells], values[cells], job.eye.half_height * _FACET)
    corners, towards, light = _lit(job.eye, quads)
    colours = _colours(job, levels.mean(axis=1)) * light[:, None]
    return corners, towards + _IN_FRONT * job.eye.half_height, colours


def _rollers(job: Job, frame: Frame) -> list[Polygons]:
    toned = frame.rollers_toned()
    if toned is None:
        return []
    surface, tones = toned
    quads = surface.points[surface.cells]
    seen = _normals(quads) @ job.eye.axes[2] > 0.0
    tone = np.repeat(tones[seen, None], 4, axis=1).astype(float)
    quads, tone = _refined(quads[seen], tone, job.eye.half_height * _FACET)
    corners, towards, light = _lit(job.eye, quads)
    greys = np.array([to_rgb(grey) for grey in GREYS])[np.rint(tone[:, 0]).astype(int)]
    return [(corners, towards, greys * light[:, None])]


def _refined(quads: Points, values: Array, longest: float) -> tuple[Points, Array]:
    """Cut facets (n, 4, 3) and values (n, 4) into pieces small enough to be sorted by distance."""
    corners = np.concatenate([quads, values[..., None]], axis=-1)
    edges = np.linalg.norm(np.roll(quads, -1, axis=1) - quads, axis=2).max(axis=0)
    counts = np.ceil(np.maximum(edges[:2], edges[2:]) / longest).astype(int).clip(1, _MOST_PIECES)
    u, v = (np.linspace(0.0, 1.0, count + 1) for count in counts)
    weights = np.stack(
        [np.outer(a, b) for a, b in ((1 - u, 1 - v), (u, 1 - v), (u, v), (1 - u, v))]
    )
    nodes = np.einsum("kuv,nkc->nuvc", weights, corners)
    turns = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
    pieces = np.stack(turns, axis=3).reshape(-1, 4, 4)
    return pieces[..., :3], pieces[..., 3]


def _lit(eye: Eye, quads: Points) -> tuple[Array, Array, Array]:
    seen = eye.projected(quads)
    normals = _normals(quads) @ eye.axes.T
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    lamp = LIGHT / np.linalg.norm(LIGHT)
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ lamp, 0.0, 1.0)
    return seen[..., :2], seen[..., 2].mean(axis=1), light


def _normals(quads: Points) -> Points:
    normals = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.maximum(lengths, np.finfo(float).tiny)


def _middle_line(points: Points, cells: NDArray[np.int64], values: Array) -> tuple[Array, Array]:
    """Cut the surface along the middle of its width: segments (n, 2, 2) in x, z and values (n,)."""
    across = points[:, 1]
    middle = 0.5 * (across.min() + across.max())
    near, far = cells, np.roll(cells, -1, axis=1)
    cut = (across[near] >= middle) != (across[far] >= middle)
    whole = cut.sum(axis=1) == 2
    near, far = near[whole][cut[whole]], far[whole][cut[whole]]
    share = (middle - across[near]) / (across[far] - across[near])
    ends = points[near] + share[:, None] * (points[far] - points[near])
    levels = values[near] + share * (values[far] - values[near])
    line = np.column_stack([ends[:, [0, 2]], levels]).reshape(-1, 2, 3)
    along = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
    nodes = line[:, None, 0] + along * (line[:, None, 1] - line[:, None, 0])
    pieces = np.stack([nodes[:, :-1], nodes[:, 1:]], axis=2).reshape(-1, 2, 3)
    return pieces[..., :2], pieces[..., 2].mean(axis=1)


def _add_rollers(axes: Axes, frame: Frame) -> Array | None:
    """Draw the rollers; the corners (2, 2) of the box around them, in x and z."""
    toned = frame.rollers_toned()
    if toned is None:
        return None
    surface, tones = toned
    flat = surface.points[:, [0, 2]]
    greys = np.array(GREYS)[tones]
    axes.add_collection(
        PolyCollection(
            list(flat[surface.cells]), facecolors=greys, edgecolors=greys, linewidths=0.4
        )
    )
    return np.array([flat.min(axis=0), flat.max(axis=0)])


def _zoom(axes: Axes, near: Array, size: tuple[int, int]) -> None:
    """Show a box and some room around it, with the same scale in both directions."""
    share = axes.get_position()
    sheet = np.array([share.width * size[0], share.height * size[1]])
    middle, reach = near.mean(axis=0), 0.5 * (1.0 + _ROOM) * np.ptp(near, axis=0)
    left, right = (middle + side * sheet * max(reach / sheet) for side in (-1, 1))
    axes.set(xlim=(left[0], right[0]), ylim=(left[1], right[1]))
