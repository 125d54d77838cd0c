"""Pictures of a run, with or without a display, with or without OpenGL.

    python -m anmstrip.pictures.render < job

draws a pickled :class:`Job` with pyvista, in a process of its own that OpenGL may take down.
"""

from __future__ import annotations

import logging
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from PIL import Image

from anmstrip.arrays import Array, Index
from anmstrip.errors import InputError, Mistake
from anmstrip.pictures.report import spread_places
from anmstrip.results import vtk
from anmstrip.results.files import atomic_write

if TYPE_CHECKING:
    import pyvista

RENDERER = "ANMSTRIP_RENDERER"
"""Environment variable; `matplotlib` draws without OpenGL."""

PREFERRED = "normal_pressure", "von_mises", "displacement"
SIZE, MOVIE_SIZE = (1400, 800), (980, 560)
MAX_FRAMES = 120
FRAME_MILLISECONDS = 80
MOVIE_COLOURS = 128
SMALL_SHARE = 0.02
PRESSURE_SCALE = 2.0
"""End of the scale of pressures, over the pressure that bears half of the force: the peaks where a
strip lifts off grow with every refinement of the mesh, the force that they bear does not."""
SECONDS_TO_START, SECONDS_PER_FRAME = 120.0, 20.0
DRAW_COMMAND = sys.executable, "-P", "-m", "anmstrip.pictures.render"
State = tuple[float, Path, Path | None]
"""Time, file of the strip, and file of the rollers if there is one."""

log = logging.getLogger(__name__)


def render(
    directory: str | os.PathLike[str],
    field: str | None = None,
    movie: bool = False,
    vector: str | None = None,
) -> list[Path]:
    """Draw the last state of a run: `picture.png` in space, `picture_side.png` from the side.

    Pyvista draws in a process of its own.  Where it cannot, one line of the log says which
    system package helps, and matplotlib draws the same view.

    Parameters
    ----------
    directory : path
        Where the run left its results.
    field : str, optional
        What colours the strip: a field, or a field and a component (`membrane_force.xy`).  Left
        out: the normal pressure if there is any contact, else the stress.
    movie : bool
        Also draw all states, or 120 of them, into `movie.gif`.
    vector : str, optional
        "svg" or "pdf": the picture from the side in this format as well.

    Returns
    -------
    list of pathlib.Path
        The pictures.

    Raises
    ------
    InputError
        No such directory, no states in it, a damaged state, or no such field.
    OSError
        A picture cannot be written.
    """
    folder = Path(directory)
    states = list_states(folder)
    chosen = choose_field(read_state(states[-1][1]), field)
    with TemporaryDirectory(prefix="anmstrip-") as scratch:
        last = plan_job(states[-1:], chosen, SIZE, Path(scratch))
        draw_in_space(last)
        pictures = [folder / "picture.png"]
        with atomic_write(pictures[0]) as temporary:
            temporary.write_bytes(last.frames[0].picture.read_bytes())
        for ending in ("png", vector) if vector else ("png",):
            pictures.append(folder / f"picture_side.{ending}")
            draw_side(last, pictures[-1])
        if movie:
            kept = spread_places(len(states), MAX_FRAMES)
            every = plan_job([states[k] for k in kept], chosen, MOVIE_SIZE, Path(scratch))
            draw_in_space(every)
            with atomic_write(folder / "movie.gif") as temporary:
                first, *others = [quantize(frame.picture) for frame in every.frames]
                pace = {"duration": FRAME_MILLISECONDS, "loop": 0}
                first.save(temporary, "GIF", save_all=True, append_images=others, **pace)
            pictures.append(folder / "movie.gif")
    return pictures


def list_states(folder: Path) -> list[State]:
    """Return all states of a run, with the rollers at the same times where they were written."""
    contents = folder / "strip.pvd"
    if not contents.is_file():
        found = "nothing of that name" if folder.exists() else "no such directory"
        raise refuse_results(contents, found)
    entries = vtk.read_collection(contents)
    if not entries:
        raise refuse_results(contents, "no states in it")
    rollers = vtk.read_collection(folder / "rollers.pvd")
    files = {entry.time: (folder / entry.file).resolve() for entry in rollers}
    return [(e.time, (folder / e.file).resolve(), files.get(e.time)) for e in entries]


def read_state(path: Path) -> vtk.SurfaceMesh:
    """Read the surface of a state, or refuse a file that is missing or damaged."""
    try:
        return vtk.read_surface(path)
    except (FileNotFoundError, ValueError) as error:
        missing = isinstance(error, FileNotFoundError)
        raise refuse_results(path, "no such file" if missing else str(error)) from error


def refuse_results(path: Path, found: str) -> InputError:
    """Return the error of a file that is not what a run writes."""
    hint = "anmstrip run SCENE.toml -o DIR, then anmstrip render DIR"
    return InputError([Mistake(str(path), "", found, "the states that a run wrote", hint)])


def choose_field(surface: vtk.SurfaceMesh, field: str | None) -> str:
    """Check the field that was asked for, or choose one that shows something."""
    names = list(surface.fields)
    if field is None and names:
        found = [name for name in PREFERRED if np.any(np.nan_to_num(surface.fields.get(name, 0)))]
        return [*found, *names][0]
    if field not in choices(names):
        near = get_close_matches(str(field), choices(names), n=1) or names or ["NAME"]
        expected = f"a field of this run: {', '.join(names) or 'it has none'}"
        raise InputError([Mistake("--field", "", field, expected, f"--field {near[0]}")])
    return field


def plan_job(states: Sequence[State], field: str, size: tuple[int, int], scratch: Path) -> Job:
    """Choose one scale and one view for all states."""
    frames = tuple(
        Frame(strip, rollers, time, scratch / f"{size[0]}_{k:04d}.png")
        for k, (time, strip, rollers) in enumerate(states)
    )
    files = [path for frame in frames for path in (frame.strip, frame.rollers) if path]
    points = np.concatenate([read_state(path).points for path in files])
    strips = [frame.read_strip(field) for frame in frames]
    values = np.concatenate([values for _, _, values in strips])
    if field == "normal_pressure":
        bearing = max(bearing_pressure(*strip) for strip in strips)
        values = np.minimum(values, PRESSURE_SCALE * bearing)
    eye = Eye.seeing(points.min(axis=0), points.max(axis=0), size)
    low, high, labels = widen_scale(*scale_limits(values))
    return Job(frames, field, (low, high), eye, size, labels)


def bearing_pressure(points: Array, cells: Index, pressure: Array) -> float:
    """Pressure below which half of the force acts (Pa); peaks where a strip lifts off bear little.

    Parameters
    ----------
    points : (n, 3) array
    cells : (m, 4) array of int
    pressure : (n,) array
    """
    corners, mean = points[cells], pressure[cells].mean(axis=1)
    twice = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    order = np.argsort(mean)
    force = np.cumsum((np.linalg.norm(twice, axis=1) * mean)[order])
    return float(mean[order][np.searchsorted(force, 0.5 * force[-1])])


def scale_limits(values: Array) -> tuple[float, float]:
    """Return the ends of a scale: from zero, or even about it, unless the values stay far away."""
    finite = values[np.isfinite(values)]
    if not np.any(finite):
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    largest = max(-low, high)
    if min(-low, high) > SMALL_SHARE * largest:
        return -largest, largest
    if abs(low + high) / 2.0 < 1.5 * (high - low):
        return (0.0, high) if high > -low else (low, 0.0)
    room = max(high - low, SMALL_SHARE * largest) - (high - low)
    return low - 0.5 * room, high + 0.5 * room


def quantize(picture: Path) -> Image.Image:
    """Return a picture in the few colours of a movie."""
    with Image.open(picture) as image:
        return image.convert("RGB").quantize(MOVIE_COLOURS)


def draw_in_space(job: Job) -> None:
    """Draw with pyvista in a process of its own, or with matplotlib where that fails."""
    if os.environ.get(RENDERER) == "matplotlib":
        return draw_with_matplotlib(job)
    seconds = SECONDS_TO_START + SECONDS_PER_FRAME * len(job.frames)
    try:
        done = subprocess.run(
            DRAW_COMMAND, input=pickle.dumps(job), capture_output=True, timeout=seconds, check=False
        )
    except subprocess.TimeoutExpired:
        reason = f"no picture after {seconds:g} s"
    else:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        if done.returncode < 0:
            reason = f"killed by {signal.Signals(-done.returncode).name}"
        elif done.returncode:
            reason = lines[-1] if lines else f"exit status {done.returncode}"
        elif all(frame.picture.exists() for frame in job.frames):
            return None
        else:
            reason = "no picture"
    log.warning(
        "pyvista cannot draw here (%s); matplotlib drew instead. On Debian and Ubuntu this helps: "
        "apt install libegl1 libgl1-mesa-dri",
        reason,
    )
    return draw_with_matplotlib(job)


PREFIXES = {-6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


def choices(names: Iterable[str]) -> list[str]:
    """List what can be asked for: every field, and its components after a dot.

    Examples
    --------
    >>> choices(["gap", "velocity"])
    ['gap', 'velocity', 'velocity.x', 'velocity.y', 'velocity.z']
    """
    found = []
    for name in names:
        components = vtk.FIELDS[name].components if name in vtk.FIELDS else ()
        found += [name, *(f"{name}.{component}" for component in components)]
    return found


def title(name: str, largest: float) -> tuple[str, float]:
    """Write the title of a scale whose numbers stay between 1 and 1000.

    Parameters
    ----------
    name : str
        A field, or a field and a component.
    largest : float
        Largest absolute value to show, in SI.

    Returns
    -------
    title : str
        Label and prefixed unit.
    factor : float
        Factor of values in SI.

    Examples
    --------
    >>> title("normal_pressure", 2.0e4)
    ('normal pressure [kPa]', 0.001)
    >>> title("bending_moment", 0.02)[0]
    'bending moment, xx [0.001 N]'
    """
    base, _, component = name.partition(".")
    field = vtk.FIELDS.get(base, vtk.Field(base.replace("_", " "), ""))
    component = component or ("xx" if field.components == vtk.TENSOR_COMPONENTS else "")
    label = f"{field.label}, {component}" if component else field.label
    power = 0
    if field.unit and not field.unit.startswith("1") and 0.0 < largest < np.inf:
        power = 3 * int(np.floor(np.log10(largest) / 3.0))
        power = min(max(power, min(PREFIXES)), max(PREFIXES))
    prefixed = f"{PREFIXES[power]}{field.unit}"
    if power == -3 and field.unit.startswith("N"):
        prefixed = f"0.001 {field.unit}"  # mN might be m N; VTK has no raised minus
    unit = f" [{prefixed}]" if field.unit not in ("", "1") else ""
    return label + unit, 10.0**-power


VIEW_DIRECTION = np.array([-0.32, -0.80, 0.50])
"""Vector from the scene towards the eye: the side, the top and the entry are all seen."""
ROLLER_COLOURS = "#8d9197", "#a9adb2"
"""The two tones of a roller, whose sectors show its turning."""
LAMP_DIRECTION = np.array([-0.15, 0.5, 0.85])
"""Vector towards the lamp, in the axes of the eye."""
AMBIENT = 0.45
"""Share of light that comes from everywhere."""
OUTLINE = "#3b4046"
NO_VALUE = "#d9d9d9"
STEEL = "#c4ced8", "#9fc3d4", "#f2c14e", "#e4652c", "#8c1c2b"
SIGNED = "#2a5d9f", "#e8e8e6", "#b0303a"
MARGIN = 1.06
HEAD_SHARE = 0.2
"""Share of a picture, at its top, that the time and the scale have for themselves."""
LABEL_STEPS = 1.0, 2.0, 2.5, 5.0
"""Distances of the labels of a scale, times powers of ten."""


@dataclass(frozen=True)
class Frame:
    """One picture to draw."""

    strip: Path  # .vtu file
    rollers: Path | None  # .vtu file, if there are any
    time: float
    picture: Path  # .png file to write

    def read_strip(self, field: str) -> tuple[Array, Index, Array]:
        """Read the points, the plain quadrilaterals and the values that colour them.

        A triangle is a quadrilateral whose last two corners coincide.  The values are NaN in a
        state without that field (no slip without friction).
        """
        surface = vtk.read_surface(self.strip)
        cells = vtk.subdivide(surface.cells)
        if cells.shape[1] == 3:
            cells = cells[:, [0, 1, 2, 2]]
        values = surface.fields.get(field.partition(".")[0])
        if values is None:
            values = np.full(len(surface.points), np.nan)
        return surface.points, cells, vtk.scalars(field, values)

    def read_rollers(self) -> tuple[Array, Index, Index] | None:
        """Read the points, the quadrilaterals and the tone, 0 or 1, of each of them."""
        if self.rollers is None:
            return None
        surface = vtk.read_surface(self.rollers)
        return surface.points, surface.cells, vtk.sector_tones(surface)


@dataclass(frozen=True)
class Eye:
    """A parallel projection."""

    axes: Array  # rows: to the right, upwards, towards the eye
    focus: Array  # the point in the middle of the picture (m)
    half_height: float  # half of what is seen from bottom to top (m)

    @classmethod
    def seeing(cls, low: Array, high: Array, size: tuple[int, int]) -> Self:
        """Look at a box so that it fits into a picture of a size in pixels, below its head."""
        towards = VIEW_DIRECTION / np.linalg.norm(VIEW_DIRECTION)
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(towards, right), towards])
        corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
        seen = corners @ axes.T
        middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
        width, height, _ = np.ptp(seen, axis=0)
        tallest = max(height / (1.0 - HEAD_SHARE), width * size[1] / size[0])
        half_height = max(0.5 * MARGIN * tallest, np.finfo(float).tiny)
        middle[1] += HEAD_SHARE * half_height
        return cls(axes, middle @ axes, half_height)

    def projected(self, points: Array) -> Array:
        """Return coordinates to the right, upwards and towards the eye; (..., 3) in metres."""
        return (points - self.focus) @ self.axes.T


def widen_scale(low: float, high: float) -> tuple[float, float, int]:
    """Widen a scale to round ends with round labels between them.

    Returns
    -------
    low, high : float
    labels : int
        Number of evenly spaced labels, both ends included: four to eight.

    Examples
    --------
    >>> widen_scale(0.0, 47.5)
    (0.0, 50.0, 6)
    >>> widen_scale(-3.0, 3.0)
    (-3.0, 3.0, 7)
    """
    power = np.floor(np.log10(high - low))
    for step in [s * 10.0**p for p in (power - 1.0, power) for s in LABEL_STEPS]:
        first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
        if last - first <= 7.0:
            break
    return float(first * step), float(last * step) + 0.0, int(last - first) + 1


@dataclass(frozen=True)
class Job:
    """Pictures with the same field, scale, eye and size."""

    frames: tuple[Frame, ...]  # in the order of time
    field: str  # a field of the strip, or a field and a component
    limits: tuple[float, float]  # ends of the colour scale, in SI
    eye: Eye
    size: tuple[int, int]  # width and height of a picture, in pixels
    labels: int  # of the colour scale, evenly spaced

    @property
    def colours(self) -> Colormap:
        """Colours of the scale: two-sided if the values are of both signs."""
        signed = self.limits[0] < 0.0 < self.limits[1]
        return LinearSegmentedColormap.from_list("strip", SIGNED if signed else STEEL)

    @property
    def scale(self) -> tuple[str, float, tuple[float, float]]:
        """Title of the scale, factor of values in SI, and its ends in the unit of the title."""
        low, high = self.limits
        label, factor = title(self.field, max(abs(low), abs(high)))
        return label, factor, (low * factor, high * factor)


STRIP_SHIFT = 0.02
"""Shift of the strip to the eye, over half the height seen: a parallel projection stays the same,
and the roller does not shine through where both coincide."""
MERGE_DISTANCE = 1e-6
"""Largest distance, over the size of the surface, of points of neighbours that are one: VTK finds
them in single precision, a triangle's from either end of the side."""
SCALAR_BAR = {
    **{"color": "black", "vertical": False, "title_font_size": 22, "label_font_size": 18},
    **{"width": 0.34, "height": 0.11, "position_x": 0.62, "position_y": 0.84, "fmt": "%.3g"},
}
SHADING = {"smooth_shading": True, "ambient": AMBIENT, "diffuse": 1.0 - AMBIENT}


def draw_with_pyvista(job: Job) -> None:
    """Draw every frame of a job."""
    import pyvista

    eye = job.eye
    for frame in job.frames:
        plotter = pyvista.Plotter(off_screen=True, window_size=list(job.size), lighting="none")
        plotter.set_background("white")
        plotter.enable_anti_aliasing("msaa", multi_samples=8)
        add_strip(plotter, job, frame)
        if rollers := frame.read_rollers():
            points, cells, tones = rollers
            surface = pyvista.PolyData(points, np.insert(cells, 0, 4, axis=1))
            for tone, grey in enumerate(ROLLER_COLOURS):
                sectors = surface.extract_cells(tones == tone)
                sectors = sectors.extract_surface(algorithm="dataset_surface")
                plotter.add_mesh(sectors, color=grey, **SHADING)
        place = 24, job.size[1] - 46
        plotter.add_text(f"t = {frame.time:.4g} s", position=place, color="black", font_size=11)
        camera = plotter.camera
        camera.parallel_projection = True
        camera.focal_point = eye.focus
        camera.position = eye.focus + 10.0 * eye.half_height * eye.axes[2]
        camera.up = eye.axes[1]
        camera.parallel_scale = eye.half_height
        plotter.renderer.reset_camera_clipping_range()
        lamp = pyvista.Light(position=eye.focus + LAMP_DIRECTION @ eye.axes, focal_point=eye.focus)
        lamp.positional = False
        plotter.add_light(lamp)
        plotter.screenshot(frame.picture)
        plotter.close()


def add_strip(plotter: pyvista.Plotter, job: Job, frame: Frame) -> None:
    """Add the strip with its field, its outline and the scale."""
    import pyvista
    from vtkmodules.vtkFiltersCore import vtkStaticCleanPolyData

    label, factor, limits = job.scale
    grid = pyvista.read(frame.strip)
    grid.clear_data()
    grid[label] = frame.read_strip(job.field)[2] * factor
    surface = grid.extract_surface(nonlinear_subdivision=3, algorithm="dataset_surface")
    merged = vtkStaticCleanPolyData()  # the other filter takes a minute where all is flat
    merged.SetInputData(surface)
    merged.SetTolerance(MERGE_DISTANCE)
    merged.Update()
    surface = pyvista.wrap(merged.GetOutput())
    nearer = STRIP_SHIFT * job.eye.half_height * job.eye.axes[2]
    surface.translate(nearer, inplace=True)
    bar = {"title": label + "\n", "n_labels": job.labels, **SCALAR_BAR}
    looks = {"clim": list(limits), "nan_color": NO_VALUE, "specular": 0.1, **SHADING}
    plotter.add_mesh(surface, scalars=label, cmap=job.colours, scalar_bar_args=bar, **looks)
    outline = surface.extract_feature_edges(feature_edges=False, manifold_edges=False)
    outline.translate(0.2 * nearer, inplace=True)
    plotter.add_mesh(outline, color=OUTLINE, line_width=2.0, lighting=False)


DOTS_PER_INCH = 100
SORTED_STRIP_SHIFT = 0.06
"""The same where facets are sorted by the distances of their middles, which takes more."""
FACET_SIZE = 0.03
"""Longest side of a facet, over half the height seen."""
MAX_FACET_PIECES = 64
"""Most pieces along a side of a facet."""
SIDE_MARGIN = 0.06
"""Room around strip and rollers in the view from the side, over their extent."""
SEGMENT_PIECES = 6
"""Pieces of a segment of the middle line, each of one colour."""


def draw_with_matplotlib(job: Job) -> None:
    """Draw every frame of a job as seen in space, the farthest facets first."""
    eye, height = job.eye, job.eye.half_height
    greys = np.array([to_rgb(grey) for grey in ROLLER_COLOURS])
    for frame in job.frames:
        points, cells, values = frame.read_strip(job.field)
        quads, levels = cut_facets(points[cells], values[cells], FACET_SIZE * height)
        corners, towards, light = project_facets(eye, quads)
        colours = colours_of(job, levels.mean(axis=1)) * light[:, None]
        polygons = [(corners, towards + SORTED_STRIP_SHIFT * height, colours)]
        if rollers := frame.read_rollers():
            points, cells, tones = rollers
            quads = points[cells]
            seen = normals_of(quads) @ eye.axes[2] > 0.0
            tone = np.repeat(tones[seen, None], 4, axis=1).astype(float)
            quads, tone = cut_facets(quads[seen], tone, FACET_SIZE * height)
            corners, towards, light = project_facets(eye, quads)
            colours = greys[np.rint(tone[:, 0]).astype(int)] * light[:, None]
            polygons.append((corners, towards, colours))
        corners, towards, colours = map(np.concatenate, zip(*polygons, strict=True))
        order = np.argsort(towards)
        figure = blank_figure(job, frame)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), zorder=-1)
        axes.set_axis_off()
        add_polygons(axes, corners[order], colours[order], 0.8)
        width = height * job.size[0] / job.size[1]
        axes.set(xlim=(-width, width), ylim=(-height, height))
        FigureCanvasAgg(figure).print_png(frame.picture)


def draw_side(job: Job, target: Path) -> None:
    """Draw the only frame of a job seen along y: the middle line of the strip, and the rollers."""
    (frame,) = job.frames
    figure = blank_figure(job, frame)
    axes = figure.add_axes((0.07, 0.09, 0.9, 0.72))
    segments, values = middle_line(*frame.read_strip(job.field))
    seen = segments.reshape(-1, 2)
    if rollers := frame.read_rollers():
        points, cells, tones = rollers
        faces, greys = points[:, [0, 2]], np.array([to_rgb(grey) for grey in ROLLER_COLOURS])
        seen = np.concatenate([seen, faces])
        add_polygons(axes, faces[cells], greys[tones], 0.4)
    colours = colours_of(job, values)
    axes.add_collection(LineCollection(list(segments), colors=colours, lw=3, capstyle="round"))
    # a box around everything, and some room, with the same scale in both directions
    share = axes.get_position()
    sheet = np.array([share.width * job.size[0], share.height * job.size[1]])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle, reach = 0.5 * (low + high), 0.5 * (1.0 + SIDE_MARGIN) * (high - low)
    left, right = (middle + side * sheet * max(reach / sheet) for side in (-1, 1))
    axes.set(xlim=(left[0], right[0]), ylim=(left[1], right[1]))
    axes.set(xlabel="x [m]", ylabel="z [m]")
    axes.spines[["top", "right"]].set_visible(False)
    with atomic_write(target) as temporary:
        figure.savefig(temporary, format=target.suffix.removeprefix("."))


def add_polygons(axes: Axes, corners: Array, colours: Array, edge: float) -> None:
    """Add polygons (n, 4, 2) in colours (n, 3), edges of a width (points) included."""
    shapes = PolyCollection(list(corners), facecolors=colours, edgecolors=colours, linewidths=edge)
    axes.add_collection(shapes)


def blank_figure(job: Job, frame: Frame) -> Figure:
    """Return a white sheet with the time and the scale."""
    inches = job.size[0] / DOTS_PER_INCH, job.size[1] / DOTS_PER_INCH
    figure = Figure(figsize=inches, dpi=DOTS_PER_INCH, facecolor="white")
    figure.text(0.017, 0.945, f"t = {frame.time:.4g} s", fontsize=14)
    label, _, limits = job.scale
    colours = ScalarMappable(Normalize(*limits), job.colours)
    place, ticks = figure.add_axes((0.62, 0.845, 0.34, 0.04)), np.linspace(*limits, job.labels)
    bar = figure.colorbar(colours, cax=place, orientation="horizontal", ticks=ticks, format="%.3g")
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


def cut_facets(quads: Array, values: Array, longest: float) -> tuple[Array, Array]:
    """Cut facets (n, 4, 3) and values (n, 4) into pieces small enough to be sorted by distance."""
    corners = np.concatenate([quads, values[..., None]], axis=-1)
    edges = np.linalg.norm(np.roll(quads, -1, axis=1) - quads, axis=2).max(axis=0)
    pieces = np.ceil(np.maximum(edges[:2], edges[2:]) / longest).astype(int)
    u, v = (np.linspace(0.0, 1.0, n + 1) for n in pieces.clip(1, MAX_FACET_PIECES))
    at_corners = (1 - u, 1 - v), (u, 1 - v), (u, v), (1 - u, v)
    weights = np.stack([np.outer(a, b) for a, b in at_corners])
    nodes = np.einsum("kuv,nkc->nuvc", weights, corners)
    turns = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
    found = np.stack(turns, axis=3).reshape(-1, 4, 4)
    return found[..., :3], found[..., 3]


def project_facets(eye: Eye, quads: Array) -> tuple[Array, Array, Array]:
    """Return corners (n, 4, 2), distances towards the eye (n,), and light (n,) of facets."""
    seen = eye.projected(quads)
    normals = normals_of(quads) @ eye.axes.T
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    lamp = LAMP_DIRECTION / np.linalg.norm(LAMP_DIRECTION)
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ lamp, 0.0, 1.0)
    return seen[..., :2], seen[..., 2].mean(axis=1), light


def normals_of(quads: Array) -> Array:
    """Return the unit normals (n, 3) of facets (n, 4, 3)."""
    normals = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.maximum(lengths, np.finfo(float).tiny)


def middle_line(points: Array, cells: Index, values: Array) -> tuple[Array, Array]:
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
    along = np.linspace(0.0, 1.0, SEGMENT_PIECES + 1)[:, None]
    nodes = line[:, None, 0] + along * (line[:, None, 1] - line[:, None, 0])
    pieces = np.stack([nodes[:, :-1], nodes[:, 1:]], axis=2).reshape(-1, 2, 3)
    return pieces[..., :2], pieces[..., 2].mean(axis=1)


if __name__ == "__main__":
    draw_with_pyvista(pickle.load(sys.stdin.buffer))
