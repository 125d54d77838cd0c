"""Pictures of a run, with or without a display, with or without OpenGL."""

from __future__ import annotations

import logging
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from anmstrip.arrays import Array, Index
from anmstrip.errors import InputError, Mistake
from anmstrip.pictures.drawing import (
    Eye,
    Frame,
    Job,
    choices,
    draw_side,
    draw_with_matplotlib,
    labelled,
)
from anmstrip.results.files import atomic_write
from anmstrip.results.vtk import SurfaceMesh, read_collection, read_surface

RENDERER = "ANMSTRIP_RENDERER"
"""Environment variable; `matplotlib` draws without OpenGL."""

PREFERRED = "normal_pressure", "von_mises", "displacement"
SIZE, MOVIE_SIZE = (1400, 800), (980, 560)
MOST_FRAMES = 120
FRAME_MILLISECONDS = 80
MOVIE_COLOURS = 128
TINY = 0.02
CAPPED = 2.0
"""End of the scale of pressures, over the pressure that bears half of the force: the peaks where a
strip lifts off grow with every refinement of the mesh, the force that they bear does not."""
SECONDS_TO_START, SECONDS_PER_FRAME = 120.0, 20.0
DRAWING = sys.executable, "-P", "-m", "anmstrip.pictures.drawing"
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
        pictures = [save_picture(last, folder / "picture.png")]
        draw_side(last)
        pictures.append(save_picture(last, folder / "picture_side.png"))
        if vector is not None:
            aside = last.frames[0].picture.with_suffix(f".{vector}")
            drawn = replace(last, frames=(replace(last.frames[0], picture=aside),))
            draw_side(drawn)
            pictures.append(save_picture(drawn, folder / f"picture_side.{vector}"))
        if movie:
            count = min(len(states), MOST_FRAMES)
            kept = np.unique(np.linspace(0, len(states) - 1, count).round().astype(int))
            every = plan_job([states[k] for k in kept], chosen, MOVIE_SIZE, Path(scratch))
            draw_in_space(every)
            with atomic_write(folder / "movie.gif") as temporary:
                first, *others = [quantize(frame.picture) for frame in every.frames]
                first.save(
                    temporary,
                    format="GIF",
                    save_all=True,
                    append_images=others,
                    duration=FRAME_MILLISECONDS,
                    loop=0,
                )
            pictures.append(folder / "movie.gif")
    return pictures


def list_states(folder: Path) -> list[State]:
    """Return all states of a run, with the rollers at the same times where they were written."""
    contents = folder / "strip.pvd"
    if not contents.is_file():
        found = "nothing of that name" if folder.exists() else "no such directory"
        raise refuse_results(contents, found)
    entries = read_collection(contents)
    if not entries:
        raise refuse_results(contents, "no states in it")
    rollers = read_collection(folder / "rollers.pvd")
    files = {entry.time: (folder / entry.file).resolve() for entry in rollers}
    return [(e.time, (folder / e.file).resolve(), files.get(e.time)) for e in entries]


def read_state(path: Path) -> SurfaceMesh:
    """Read the surface of a state, or refuse a file that is missing or damaged."""
    try:
        return read_surface(path)
    except FileNotFoundError as error:
        raise refuse_results(path, "no such file") from error
    except ValueError as error:
        raise refuse_results(path, str(error)) from error


def refuse_results(path: Path, found: str) -> InputError:
    """Return the error of a file that is not what a run writes."""
    hint = "anmstrip run SCENE.toml -o DIR, then anmstrip render DIR"
    return InputError([Mistake(str(path), "", found, "the states that a run wrote", hint)])


def choose_field(surface: SurfaceMesh, field: str | None) -> str:
    """Check the field that was asked for, or choose one that shows something."""
    names = list(surface.fields)
    if field is None and names:
        found = [name for name in PREFERRED if np.any(np.nan_to_num(surface.fields.get(name, 0)))]
        return [*found, *names][0]
    if field not in choices(names):
        near = get_close_matches(field or "", choices(names), n=1) or names or ["NAME"]
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
        values = np.minimum(values, max(CAPPED * bearing_pressure(*strip) for strip in strips))
    eye = Eye.seeing(points.min(axis=0), points.max(axis=0), size)
    low, high, labels = labelled(*scale_limits(values))
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
    if min(-low, high) > TINY * largest:
        return -largest, largest
    if abs(low + high) / 2.0 < 1.5 * (high - low):
        return (0.0, high) if high > -low else (low, 0.0)
    room = max(high - low, TINY * largest) - (high - low)
    return low - 0.5 * room, high + 0.5 * room


def save_picture(job: Job, target: Path) -> Path:
    """Keep the picture of the only frame of a job."""
    with atomic_write(target) as temporary:
        temporary.write_bytes(job.frames[0].picture.read_bytes())
    return target


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
            DRAWING, input=pickle.dumps(job), capture_output=True, timeout=seconds, check=False
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
