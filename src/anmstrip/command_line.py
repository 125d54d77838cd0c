"""The command ``anmstrip``: arguments in, exit status and a few lines out.

Exit status: 0 done; 1 the run stopped before its end, and what was computed is on disk;
2 the input is wrong, and nothing was written. What takes time to import is imported by
the command that needs it, so that help comes at once.
"""

# ruff: noqa: PLC0415
from __future__ import annotations

import errno
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from anmstrip import options
from anmstrip.options import STOPPED, WRONG
from anmstrip.sweep.command import sweep

if TYPE_CHECKING:
    from anmstrip.scene.run import Run


class Commands(click.Group):
    """A group whose commands end in a sentence and an exit status, never in a traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; a user's mistake or a full disk is told, not raised."""
        from anmstrip.scene.errors import InputError

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
@options.scene
@options.directory
@options.settings
@click.option("--resume", is_flag=True, help="Go on where an earlier run in DIR was interrupted.")
@options.quiet
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
    from anmstrip.scene import Scene

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
    from anmstrip.progress import watched

    try:
        for _ in running if quiet else watched(running):
            pass
    except KeyboardInterrupt:
        running.interrupted()
        return False
    return True


@main.command(short_help="Say what a run would do, and warn.")
@options.scene
@options.settings
def explain(scene: Path, settings: tuple[str, ...]) -> None:
    """Say what a run of a scene would do, and warn; nothing is solved or written.

    Effects with their points and memory, what is left out, rollers with their wraps, stages,
    and which level of kinematics the numbers justify. Keys of --set as for run.
    """
    from anmstrip.scene import Scene
    from anmstrip.scene.explain import explain

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
@options.settings
@click.option(
    "--scheme",
    type=click.Choice(["taylor", "implicit"]),
    default="taylor",
    show_default=True,
    help="The paper's scheme, explicit in time, or the implicit one.",
)
@options.directory
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
    from anmstrip.series.outcome import PathStopped
    from anmstrip.studies.cases import run_case

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
    from anmstrip.scene.errors import InputError, Mistake

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
    from anmstrip.output.pictures import render

    for picture in render(directory, field=field, movie=movie):
        click.echo(str(picture))


main.add_command(sweep)


if __name__ == "__main__":
    main()
