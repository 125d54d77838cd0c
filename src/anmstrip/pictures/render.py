"""Pictures of a run, with or without a display, with or without OpenGL."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from anmstrip.errors import InputError, Mistake
from anmstrip.pictures.plot import draw_plot, draw_side
from anmstrip.pictures.views import Frame, Job, box, choices
from anmstrip.results.files import replaced
from anmstrip.results.vtk import Surface, read_collection, read_surface

RENDERER = "ANMSTRIP_RENDERER"
"""Environment variable; `matplotlib` draws without OpenGL."""

_PREFERRED = "normal_pressure", "von_mises", "displacement"
_SIZE, _MOVIE_SIZE = (1400, 800), (980, 560)
_MOST_FRAMES = 120
_FRAME_MILLISECONDS = 80
_MOVIE_COLOURS = 128
_TINY = 0.02
_SECONDS_TO_START, _SECONDS_PER_FRAME = 120.0, 20.0
_DRAWING = sys.executable, "-P", "-m", "anmstrip.pictures.draw"
_HELP = (
    "pyvista cannot draw here (%s); matplotlib drew instead. On Debian and Ubuntu this helps: "
    "apt install libegl1 libgl1-mesa-dri"
)

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _State:
    time: float
    strip: Path
    rollers: Path | None


def render(
    directory: str | os.PathLike[str], field: str | None = None, movie: bool = False
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
    states = _states(folder)
    chosen = _chosen(_surface(states[-1].strip), field)
    with TemporaryDirectory(prefix="anmstrip-") as scratch:
        last = _job(states[-1:], chosen, _SIZE, Path(scratch))
        pictures = [
            _drawn(last, _draw_in_space, folder / "picture.png"),
            _drawn(last, draw_side, folder / "picture_side.png"),
        ]
        if movie:
            every = _job(_thinned(states), chosen, _MOVIE_SIZE, Path(scratch))
            pictures.append(_drawn(every, _draw_in_space, folder / "movie.gif"))
    return pictures


def _states(folder: Path) -> list[_State]:
    """All states of a run, with the rollers at the same times where they were written."""
    contents = folder / "strip.pvd"
    if not contents.is_file():
        found = "nothing of that name" if folder.exists() else "no such directory"
        raise _refused(contents, found)
    entries = read_collection(contents)
    if not entries:
        raise _refused(contents, "no states in it")
    beside = folder / "rollers.pvd"
    rollers = read_collection(beside) if beside.is_file() else ()
    files = {entry.time: (folder / entry.file).resolve() for entry in rollers}
    return [
        _State(entry.time, (folder / entry.file).resolve(), files.get(entry.time))
        for entry in entries
    ]


def _surface(path: Path) -> Surface:
    try:
        return read_surface(path)
    except FileNotFoundError as error:
        raise _refused(path, "no such file") from error
    except ValueError as error:
        raise _refused(path, str(error)) from error


def _refused(path: Path, found: str) -> InputError:
    mistake = Mistake(
        file=str(path),
        key="",
        value=found,
        expected="the states that a run wrote",
        hint="anmstrip run SCENE.toml -o DIR, then anmstrip render DIR",
    )
    return InputError((mistake,))


def _chosen(surface: Surface, field: str | None) -> str:
    """Check the field that was asked for, or choose one that shows something."""
    names = list(surface.fields)
    if field is None and names:
        found = [name for name in _PREFERRED if np.any(np.nan_to_num(surface.fields.get(name, 0)))]
        return [*found, *names][0]
    if field not in choices(names):
        near = get_close_matches(field or "", choices(names), n=1) or names or ["NAME"]
        expected = f"a field of this run: {', '.join(names) or 'it has none'}"
        raise InputError((Mistake("--field", "", field, expected, f"--field {near[0]}"),))
    return field


def _thinned(states: Sequence[_State]) -> list[_State]:
    count = min(len(states), _MOST_FRAMES)
    chosen = np.unique(np.linspace(0, len(states) - 1, count).round().astype(int))
    return [states[k] for k in chosen]


def _job(states: Sequence[_State], field: str, size: tuple[int, int], scratch: Path) -> Job:
    """Choose one scale and one box for all states."""
    frames = tuple(
        Frame(
            str(state.strip),
            str(state.rollers or ""),
            state.time,
            str(scratch / f"{size[0]}_{k:04d}.png"),
        )
        for k, state in enumerate(states)
    )
    files = [path for state in states for path in (state.strip, state.rollers) if path]
    low, high = box(_surface(path) for path in files)
    values = np.concatenate([frame.strip_coloured(field)[2] for frame in frames])
    return Job(frames, field, _limits(values), tuple(low.tolist()), tuple(high.tolist()), size)


def _limits(values: NDArray[np.float64]) -> tuple[float, float]:
    """Ends of a scale: from zero, or even about zero, unless the values stay far from it."""
    finite = values[np.isfinite(values)]
    if not np.any(finite):
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    largest = max(-low, high)
    if min(-low, high) > _TINY * largest:
        return -largest, largest
    if abs(low + high) / 2.0 < 1.5 * (high - low):
        return (0.0, high) if high > -low else (low, 0.0)
    room = max(high - low, _TINY * largest) - (high - low)
    return low - 0.5 * room, high + 0.5 * room


def _drawn(job: Job, draw: Callable[[Job], None], target: Path) -> Path:
    """Draw aside, then keep one picture, or all of them in a movie."""
    draw(job)
    with replaced(target) as temporary:
        if target.suffix == ".gif":
            _assemble([frame.picture for frame in job.frames], temporary)
        else:
            temporary.write_bytes(Path(job.frames[0].picture).read_bytes())
    return target


def _assemble(pictures: Sequence[str], target: Path) -> None:
    first, *others = [_indexed(picture) for picture in pictures]
    first.save(
        target,
        format="GIF",
        save_all=True,
        append_images=others,
        duration=_FRAME_MILLISECONDS,
        loop=0,
    )


def _indexed(picture: str) -> Image.Image:
    with Image.open(picture) as image:
        return image.convert("RGB").quantize(_MOVIE_COLOURS)


def _draw_in_space(job: Job) -> None:
    if os.environ.get(RENDERER) == "matplotlib":
        draw_plot(job)
    elif reason := _failure_of_pyvista(job):
        _log.warning(_HELP, reason)
        draw_plot(job)


def _failure_of_pyvista(job: Job) -> str:
    """Draw in another process; why that failed, or nothing if it did not."""
    seconds = _SECONDS_TO_START + _SECONDS_PER_FRAME * len(job.frames)
    try:
        done = subprocess.run(
            _DRAWING,
            input=job.to_json(),
            text=True,
            capture_output=True,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no picture after {seconds:g} s"
    if done.returncode < 0:
        return f"killed by {signal.Signals(-done.returncode).name}"
    if done.returncode:
        return (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
    return "" if all(Path(frame.picture).exists() for frame in job.frames) else "no picture"
