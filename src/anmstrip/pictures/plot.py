"""Drawing with matplotlib alone: the view in space without OpenGL, and the view from the side."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anmstrip.arrays import Array
from anmstrip.pictures.views import AMBIENT, GREYS, LIGHT, NO_VALUE, Eye, Frame, Job
from anmstrip.results.vtk import Points

DOTS_PER_INCH = 100
IN_FRONT = 0.06
"""Shift of the strip to the eye as in `draw`; more, because facets are sorted by their middles."""
FACET = 0.03
"""Longest side of a facet, over half the height seen."""
MOST_PIECES = 64
"""Most pieces along a side of a facet."""
ROOM = 0.06
"""Room around strip and rollers in the view from the side, over their extent."""
PIECES = 6
"""Pieces of a segment of the middle line, each of one colour."""


def draw_plot(job: Job) -> None:
    """Draw every frame of a job as seen in space, the farthest facets first."""
    eye, height = job.eye, job.eye.half_height
    greys = np.array([to_rgb(grey) for grey in GREYS])
    for frame in job.frames:
        points, cells, values = frame.read_strip(job.field)
        quads, levels = cut_facets(points[cells], values[cells], FACET * height)
        corners, towards, light = project_facets(eye, quads)
        colours = colours_of(job, levels.mean(axis=1)) * light[:, None]
        polygons = [(corners, towards + IN_FRONT * height, colours)]
        if rollers := frame.read_rollers():
            points, cells, tones = rollers
            quads = points[cells]
            seen = normals_of(quads) @ eye.axes[2] > 0.0
            tone = np.repeat(tones[seen, None], 4, axis=1).astype(float)
            quads, tone = cut_facets(quads[seen], tone, FACET * height)
            corners, towards, light = project_facets(eye, quads)
            colours = greys[np.rint(tone[:, 0]).astype(int)] * light[:, None]
            polygons.append((corners, towards, colours))
        corners, towards, colours = map(np.concatenate, zip(*polygons, strict=True))
        order = np.argsort(towards)
        figure = blank_figure(job, frame)
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
        width = height * job.size[0] / job.size[1]
        axes.set(xlim=(-width, width), ylim=(-height, height))
        FigureCanvasAgg(figure).print_png(frame.picture)


def draw_side(job: Job) -> None:
    """Draw every frame of a job seen along y: the middle line of the strip, and the rollers."""
    for frame in job.frames:
        figure = blank_figure(job, frame)
        axes = figure.add_axes((0.07, 0.09, 0.9, 0.72))
        segments, values = middle_line(*frame.read_strip(job.field))
        seen = segments.reshape(-1, 2)
        if rollers := frame.read_rollers():
            points, cells, tones = rollers
            faces, greys = points[:, [0, 2]], np.array(GREYS)[tones]
            seen = np.concatenate([seen, faces])
            axes.add_collection(
                PolyCollection(
                    list(faces[cells]), facecolors=greys, edgecolors=greys, linewidths=0.4
                )
            )
        axes.add_collection(
            LineCollection(
                list(segments), colors=colours_of(job, values), linewidths=3.0, capstyle="round"
            )
        )
        # a box around everything, and some room, with the same scale in both directions
        share = axes.get_position()
        sheet = np.array([share.width * job.size[0], share.height * job.size[1]])
        low, high = seen.min(axis=0), seen.max(axis=0)
        middle, reach = 0.5 * (low + high), 0.5 * (1.0 + ROOM) * (high - low)
        left, right = (middle + side * sheet * max(reach / sheet) for side in (-1, 1))
        axes.set(xlim=(left[0], right[0]), ylim=(left[1], right[1]))
        axes.set(xlabel="x [m]", ylabel="z [m]")
        axes.spines[["top", "right"]].set_visible(False)
        figure.savefig(frame.picture)


def blank_figure(job: Job, frame: Frame) -> Figure:
    """Return a white sheet with the time and the scale."""
    inches = job.size[0] / DOTS_PER_INCH, job.size[1] / DOTS_PER_INCH
    figure = Figure(figsize=inches, dpi=DOTS_PER_INCH, facecolor="white")
    figure.text(0.017, 0.945, f"t = {frame.time:.4g} s", fontsize=14)
    label, _, limits = job.scale
    bar = figure.colorbar(
        ScalarMappable(Normalize(*limits), job.colours),
        cax=figure.add_axes((0.62, 0.845, 0.34, 0.04)),
        orientation="horizontal",
        ticks=np.linspace(*limits, job.labels),
        format="%.3g",
    )
    bar.outline.set_visible(False)
    bar.ax.xaxis.tick_top()
    bar.ax.tick_params(length=0, labelsize=12)
    bar.ax.set_title(label, fontsize=15, pad=24)
    return figure


def colours_of(job: Job, values: Array) -> Array:
    """Return the colours (n, 3) of values (n,) in SI."""
    low, high = job.limits
    colours = job.colours((values - low) / (high - low))[:, :3]
    colours[~np.isfinite(values)] = to_rgb(NO_VALUE)
    return colours


def cut_facets(quads: Points, values: Array, longest: float) -> tuple[Points, Array]:
    """Cut facets (n, 4, 3) and values (n, 4) into pieces small enough to be sorted by distance."""
    corners = np.concatenate([quads, values[..., None]], axis=-1)
    edges = np.linalg.norm(np.roll(quads, -1, axis=1) - quads, axis=2).max(axis=0)
    counts = np.ceil(np.maximum(edges[:2], edges[2:]) / longest).astype(int).clip(1, MOST_PIECES)
    u, v = (np.linspace(0.0, 1.0, count + 1) for count in counts)
    weights = np.stack(
        [np.outer(a, b) for a, b in ((1 - u, 1 - v), (u, 1 - v), (u, v), (1 - u, v))]
    )
    nodes = np.einsum("kuv,nkc->nuvc", weights, corners)
    turns = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
    pieces = np.stack(turns, axis=3).reshape(-1, 4, 4)
    return pieces[..., :3], pieces[..., 3]


def project_facets(eye: Eye, quads: Points) -> tuple[Array, Array, Array]:
    """Return corners (n, 4, 2), distances towards the eye (n,), and light (n,) of facets."""
    seen = eye.projected(quads)
    normals = normals_of(quads) @ eye.axes.T
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    lamp = LIGHT / np.linalg.norm(LIGHT)
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ lamp, 0.0, 1.0)
    return seen[..., :2], seen[..., 2].mean(axis=1), light


def normals_of(quads: Points) -> Points:
    """Return the unit normals (n, 3) of facets (n, 4, 3)."""
    normals = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.maximum(lengths, np.finfo(float).tiny)


def middle_line(points: Points, cells: NDArray[np.int64], values: Array) -> tuple[Array, Array]:
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
    along = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    nodes = line[:, None, 0] + along * (line[:, None, 1] - line[:, None, 0])
    pieces = np.stack([nodes[:, :-1], nodes[:, 1:]], axis=2).reshape(-1, 2, 3)
    return pieces[..., :2], pieces[..., 2].mean(axis=1)
