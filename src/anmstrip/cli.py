"""The command ``anmstrip``: arguments in, exit status and a few lines out."""

from __future__ import annotations

import errno
import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TextIO, TypeVar

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from distributed import Client

    from anmstrip.driver.run import Run
    from anmstrip.sweep.study import Ended, Sweep

STOPPED, WRONG = 1, 2
"""Exit statuses: stopped before the end, wrong input."""

directory_option = click.option(
    "-o",
    "--output",
    "directory",
    metavar="DIR",
    type=click.Path(path_type=Path, file_okay=False),
    help="Where the results go (default: a directory of its own in results/).",
)
settings_option = click.option(
    "--set",
    "settings",
    metavar="KEY=VALUE",
    multiple=True,
    help="Use another value than the one written; may be given several times.",
)
scene_argument = click.argument("scene", metavar="SCENE.toml", type=click.Path(path_type=Path))
quiet_option = click.option(
    "--quiet", is_flag=True, help="Show no progress; the last two lines still come."
)


INTERVAL = 5.0
"""Seconds between two lines where there is no terminal."""


class Progressing(Protocol):
    """What is shown of an accepted step."""

    @property
    def stage(self) -> str:
        """Name of the stage."""

    @property
    def time(self) -> float:
        """Time reached (s)."""

    @property
    def end_time(self) -> float:
        """Time at which the run ends (s)."""

    @property
    def fraction(self) -> float:
        """How much of the run is done, from 0 to 1."""

    @property
    def tangents(self) -> int:
        """Tangents factorised so far."""

    @property
    def tension_ratio(self) -> float | None:
        """Tension at the exit over that at the entry, if there are both."""


class Partial(Protocol):
    """What has come a part of its way."""

    @property
    def fraction(self) -> float:
        """How much is done, from 0 to 1."""


S = TypeVar("S", bound=Partial)


def summary_of(step: Progressing) -> str:
    """Return a step in a few words: stage, time, tangents, tension ratio."""
    words = [
        step.stage,
        f"t = {step.time:.4g} of {step.end_time:.4g} s",
        f"{step.tangents} tangents",
    ]
    if step.tension_ratio is not None:
        words.append(f"tension ratio {step.tension_ratio:.4f}")
    return ", ".join(words)


def watched(
    steps: Iterable[S],
    stream: TextIO | None = None,
    interval: float = INTERVAL,
    say: Callable[[Any], str] = summary_of,
) -> Iterator[S]:
    """Return an iterator over steps that shows how far they are.

    Parameters
    ----------
    steps : iterable
        Accepted steps, or whatever knows its `fraction`.
    stream : text stream, optional
        Where to; standard error if left out.
    interval : float, optional
        Seconds between two lines where `stream` is no terminal.
    say : callable, optional
        A step in a few words.
    """
    stream = stream or sys.stderr
    if stream.isatty():
        return _with_bar(steps, stream, say)
    return _with_lines(steps, stream, interval, say)


def _with_bar(steps: Iterable[S], stream: TextIO, say: Callable[[Any], str]) -> Iterator[S]:
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(file=stream)) as bar:
        task = bar.add_task("starting", total=1.0)
        for step in steps:
            bar.update(task, completed=step.fraction, description=say(step))
            yield step


def _with_lines(
    steps: Iterable[S], stream: TextIO, interval: float, say: Callable[[Any], str]
) -> Iterator[S]:
    started = shown = time.monotonic()
    for step in steps:
        now = time.monotonic()
        if now - shown >= interval:
            left = _time_left(now - started, step.fraction)
            print(f"{say(step)}, {left} left", file=stream, flush=True)
            shown = now
        yield step


def _time_left(elapsed: float, fraction: float) -> str:
    """Return the time left if the rest goes like what is done.

    Examples
    --------
    >>> _time_left(30.0, 0.25)
    '90 s'
    """
    return f"{elapsed * (1 - fraction) / fraction:.0f} s" if fraction > 0 else "unknown"


NEEDED = 'anmstrip sweep shares its scenes out by dask. Type: pip install "dask[distributed]"'


@click.command(short_help="Run a scene with many values of a few keys.")
@scene_argument
@click.option(
    "--vary",
    "variations",
    metavar="KEY=a:b:n",
    multiple=True,
    help="Key and values: n from a to b, or a list v1,v2,v3; several make all combinations.",
)
@settings_option
@directory_option
@click.option("--workers", type=click.IntRange(1), metavar="N", help="Processes (default: cores).")
@click.option("--scheduler", metavar="ADDRESS", help="Use a dask cluster that runs already.")
@quiet_option
def sweep(
    scene: Path,
    variations: tuple[str, ...],
    settings: tuple[str, ...],
    directory: Path | None,
    workers: int | None,
    scheduler: str | None,
    quiet: bool,
) -> None:
    """Run a scene with many values of a few keys, several at once.

    \b
      anmstrip sweep examples/capstan.toml --vary friction.coefficient=0.1:0.5:9
      anmstrip sweep examples/capstan.toml --vary rollers.r1.radius=0.4,0.5 \\
          --vary strip.thickness=0.5e-3:2e-3:4

    DIR gets sweep.csv with a row for every scene, whole at any moment, sweep.png, and for
    every scene a directory of results as of run. The same command again skips the scenes that
    have ended, and goes on with the others from their checkpoints; delete a directory to have
    its scene run afresh. Workers of --scheduler must see DIR under the same path.

    Exit status: 0 all done, 1 interrupted or a scene stopped early, 2 wrong input.
    """
    if find_spec("distributed") is None:
        click.echo(NEEDED, err=True)
        sys.exit(WRONG)
    from anmstrip.sweep.study import Sweep

    study = Sweep(
        scene, variations, settings, directory=directory or Path("results", f"{scene.stem}-sweep")
    )
    there = len(study.variants) - len(study.waiting)
    finished = _swept(study, workers, scheduler, quiet)
    click.echo(_said(study, there))
    click.echo(f"Table {study.table.path}, figure {study.draw()}.")
    if not finished:
        click.echo("Interrupted. Next: the same command, which goes on from here.")
    if study.stopped:
        sys.exit(STOPPED)


def _swept(study: Sweep, workers: int | None, scheduler: str | None, quiet: bool) -> bool:
    """Run what is left; return False if the user interrupted it."""
    if not study.waiting:
        return True
    try:
        with _farm(study, workers, scheduler) as client:
            for _ in _watched(study, client, quiet):
                pass
    except KeyboardInterrupt:
        return False
    return True


def _farm(
    study: Sweep, workers: int | None, scheduler: str | None
) -> AbstractContextManager[Client]:
    from anmstrip.sweep.study import local_workers, remote_workers

    if scheduler is not None:
        return remote_workers(scheduler)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return local_workers(min(workers or cores or 1, len(study.waiting)))


def _watched(study: Sweep, client: Client, quiet: bool) -> Iterator[Ended]:
    ended = study.run(client)
    return ended if quiet else watched(ended, interval=0.0, say=str)


def _said(study: Sweep, there: int) -> str:
    """What has come out, in a line; then a line for each scene that stopped."""
    done = len(study.rows) - len(study.stopped)
    before = f", {there} of them ended before" if there else ""
    lines = [f"{done} of {len(study.rows)} scenes done{before}."]
    told = [row for row in study.stopped if row["status"] != "waiting"]
    lines += [f"  {row['directory']}: {row['status']}: {row['message']}" for row in told]
    return "\n".join(lines)


class Commands(click.Group):
    """A group whose commands end in a sentence and an exit status, never in a traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; a user's mistake or a full disk is told, not raised."""
        from anmstrip.errors import InputError

        try:
            return super().invoke(ctx)
        except InputError as error:
            click.echo(str(error), err=True)
            ctx.exit(WRONG)
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise  # click's own: the reader of our output has gone
            click.echo(f"Stopped: {error.filename or 'writing'}: {error.strerror}.", err=True)
            ctx.exit(STOPPED)


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(package_name="anmstrip")
def main() -> None:
    """Thin metal strip over rollers, with contact and friction, by high-order Taylor series.

    A scene is a TOML file. To see one:

    \b
      anmstrip explain examples/capstan.toml
      anmstrip run examples/capstan.toml
      anmstrip render results/capstan
    """


@main.command()
@scene_argument
@directory_option
@settings_option
@click.option("--resume", is_flag=True, help="Go on where an earlier run in DIR was interrupted.")
@quiet_option
def run(
    scene: Path, directory: Path | None, settings: tuple[str, ...], resume: bool, quiet: bool
) -> None:
    """Run a scene; its results can be looked at while it goes on.

    DIR gets strip.pvd and rollers.pvd for ParaView, history.csv with a row for every step,
    summary.json and a checkpoint. Keys of --set are dotted, rollers and stages go by their
    names, and values are in TOML syntax:

    \b
      --set friction.coefficient=0.2 --set rollers.r1.radius=0.3
      --set 'strip.cells=[40, 4]'    --set stages.turn.duration=2

    Exit status: 0 done, 1 stopped before its end (what was computed is there, and the message
    says what to try), 2 wrong input (every mistake is told, nothing was written).
    """
    from anmstrip.driver.scene import Scene

    loaded = Scene.load(scene, settings)
    running = loaded.run(directory or Path("results", loaded.name), resume=resume)
    if not _ran(running, quiet):
        click.echo(f"Interrupted. Everything up to here is in {running.directory}.")
        click.echo(f"Next: anmstrip run {scene} -o {running.directory} --resume")
        sys.exit(STOPPED)
    click.echo(running.message)
    for warning in running.warnings:
        click.echo(f"Warning: {warning}")
    click.echo(f"Results in {running.directory}. Next: anmstrip render {running.directory}")
    if not running.outcome.done:
        sys.exit(STOPPED)


def _ran(running: Run, quiet: bool) -> bool:
    """Take all steps; return False if the user interrupted them."""

    try:
        for _ in running if quiet else watched(running):
            pass
    except KeyboardInterrupt:
        running.interrupted()
        return False
    return True


@main.command(short_help="Say what a run would do, and warn.")
@scene_argument
@settings_option
def explain(scene: Path, settings: tuple[str, ...]) -> None:
    """Say what a run of a scene would do, and warn; nothing is solved or written.

    Effects with their points and memory, what is left out, rollers with their wraps, stages,
    and which level of kinematics the numbers justify. Keys of --set as for run.
    """
    from anmstrip.driver.explain import explain
    from anmstrip.driver.scene import Scene

    click.echo(explain(Scene.load(scene, settings)))


@main.command(short_help="Run a mass-spring case of the paper.")
@click.argument("name")
@click.option(
    "--order",
    type=click.IntRange(2, 60),
    default=19,
    show_default=True,
    metavar="N",
    help="Order of the series.",
)
@click.option(
    "--tolerance",
    type=click.FloatRange(1e-14, 0.1),
    default=1e-4,
    show_default=True,
    metavar="EPS",
    help="Error that is aimed at, relative to the case's own scales.",
)
@settings_option
@click.option(
    "--scheme",
    type=click.Choice(["taylor", "implicit"]),
    default="taylor",
    show_default=True,
    help="The paper's scheme, explicit in time, or the implicit one.",
)
@directory_option
def case(
    name: str,
    order: int,
    tolerance: float,
    settings: tuple[str, ...],
    scheme: str,
    directory: Path | None,
) -> None:
    """Run a mass-spring case of the paper.

    NAME is pressed-plane, moving-plane or rotating-circle. The table shows the steps beside
    the paper's; DIR gets case.csv, case.json and the figures.

    Keys of --set are the paper's symbols: k, F, delta, r, Omega, V, f, q, omega, V_c, R_N,
    zeta, R_C, K, eta, t_end.
    """
    from anmstrip.continuation.status import PathStopped
    from anmstrip.paper.cases import run_case

    try:
        report = run_case(
            name,
            order=order,
            tolerance=tolerance,
            settings=_numbers(settings),
            scheme=scheme,
            directory=directory or Path("results", name),
        )
    except PathStopped as stopped:
        click.echo(f"Stopped: {stopped}.", err=True)
        sys.exit(STOPPED)
    click.echo(str(report))
    if not report.done:
        sys.exit(STOPPED)


def _numbers(settings: Iterable[str]) -> dict[str, float]:
    """Return ``KEY=NUMBER`` texts as a mapping, or all that are none."""
    from anmstrip.errors import InputError, Mistake

    numbers, mistakes = {}, []
    for text in settings:
        key, _, value = text.partition("=")
        try:
            numbers[key.strip()] = _finite(value)
        except ValueError:
            hint = f"--set {key}=1.0"
            mistakes.append(Mistake(f"--set {text}", key, value or None, "a finite number", hint))
    if mistakes:
        raise InputError(mistakes)
    return numbers


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(text)
    return number


@main.command()
@click.argument("directory", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--field",
    metavar="NAME",
    help="What colours the strip, e.g. gap or membrane_force.xx (default: pressure).",
)
@click.option("--movie", is_flag=True, help="All states as movie.gif as well.")
def render(directory: Path, field: str | None, movie: bool) -> None:
    """Draw pictures of a run, without a display.

    picture.png from above and picture_side.png from the side, of the last state, into DIR.
    """
    from anmstrip.pictures.render import render

    for picture in render(directory, field=field, movie=movie):
        click.echo(str(picture))


main.add_command(sweep)


if __name__ == "__main__":
    main()
