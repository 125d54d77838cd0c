"""The command ``anmstrip``: arguments in, exit status and a few lines out."""

from __future__ import annotations

import atexit
import ctypes
import errno
import gc
import json
import logging
import math
import os
import shlex
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import wraps
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeVar, cast

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from distributed import Client

    from anmstrip.driver.scene import Scene
    from anmstrip.driver.stationary import MapStep
    from anmstrip.driver.sweep import Ended, Sweep
    from anmstrip.simulation.march import Step

S = TypeVar("S", "Step", "Ended", "MapStep")

EXIT_STOPPED, EXIT_INVALID = 1, 2
"""Exit statuses: stopped before the end, wrong input."""

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Settings of BLAS.  Without any of them it gets one thread: the vectors of a strip are too short
for more, and on two busy cores threads that wait for each other triple the processor time."""

MALLOC_OPTIONS = {-3: 2**25, -1: 2**28}
"""Options of the GNU C library: from how many bytes on a piece of memory is one of its own
(M_MMAP_THRESHOLD, here the most that it takes), and how many free ones are kept (M_TRIM_THRESHOLD).
Memory of arrays that goes back to the system after each use takes 0.25 s of a run of capstan.toml;
kept, the run needs 5 % more."""

TEMPLATES = ("bridle", "furnace", "leveller", "roller", "steering")
"""Lines of which ``anmstrip new`` writes a scene."""

LONGEST_FORECAST = 86400.0
"""Time (s) from which on what is left of a run is not foretold."""

PROGRESS_INTERVAL = 5.0
"""Seconds between two lines where there is no terminal."""


class NamedPath(click.Path):
    """A path of which something was typed: an empty one, as of an unset variable, is a mistake."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path."""
        if value == "":
            self.fail("nothing was typed; expected a path.", param, ctx)
        return super().convert(value, param, ctx)


directory_option = click.option(
    *("-o", "--output", "directory"),
    metavar="DIR",
    type=NamedPath(path_type=Path, file_okay=False),
    help="Where the results go (default: a directory of its own in results/).",
)
settings_option = click.option(
    "--set",
    "settings",
    metavar="KEY=VALUE",
    multiple=True,
    help="Use another value than the one written; may be given several times.",
)
scene_argument = click.argument("scene", metavar="SCENE.toml", type=NamedPath(path_type=Path))
quiet_option = click.option(
    "--quiet", is_flag=True, help="Show no progress; what is said at the end still comes."
)
result_argument = click.argument("directory", metavar="DIR", type=NamedPath(path_type=Path))


def takes_scene(ending: str | None = None) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the scene that was typed, and a directory that by default ends in a word."""

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def loaded(
            scene: Path, settings: tuple[str, ...], directory: Path | None = None, **options: Any
        ) -> None:
            from anmstrip.driver.scene import Scene

            made = Scene.load(scene, settings)
            if ending is not None:
                options["directory"] = directory or Path("results", f"{made.name}-{ending}")
            command(made, **options)

        options = loaded if ending is None else directory_option(loaded)
        return scene_argument(settings_option(options))

    return decorate


def on_workers(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of :func:`run_study`."""
    number = click.IntRange(1)
    workers = click.option(
        "--workers", type=number, metavar="N", help="Processes (default: cores)."
    )
    told = "Use a dask cluster that runs already."
    return workers(click.option("--scheduler", metavar="ADDRESS", help=told)(quiet_option(command)))


def describe_step(step: Step) -> str:
    """Return a step in a few words: stage, time, tangents, tension ratio."""
    words = f"{step.stage}, t = {step.time:.4g} of {step.end_time:.4g} s, {step.tangents} tangents"
    ratio = step.tension_ratio
    return words if (ratio or 0.0) <= 0.0 else f"{words}, tension ratio {ratio:.4f}"


def show_progress(
    steps: Iterable[S],
    describe: Callable[[S], str],
    stream: TextIO | None = None,
    interval: float = PROGRESS_INTERVAL,
) -> Iterator[S]:
    """Yield steps, and show how far they are and how much time is left.

    Parameters
    ----------
    steps : iterable
        Accepted steps of a run, or scenes of a sweep that have ended.
    describe : callable
        Puts a step in a few words.
    stream : text stream, optional
        A terminal gets a bar, anything else lines; standard error if left out.
    interval : float, optional
        Seconds between two lines where `stream` is no terminal.
    """
    stream = stream or sys.stderr
    if stream.isatty():
        columns = TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn()
        with Progress(*columns, console=Console(file=stream)) as bar:
            task = bar.add_task("starting", total=1.0)
            with Telling(lambda words: bar.update(task, description=words, refresh=True)):
                for step in steps:
                    bar.update(task, completed=step.fraction, description=describe(step))
                    yield step
        return
    started = shown = time.monotonic()

    def tell(words: str, since: float) -> None:
        nonlocal shown
        if (now := time.monotonic()) - since >= interval:
            print(words, file=stream, flush=True)
            shown = now

    with Telling(lambda words: tell(words, started)):
        for step in steps:
            spent, done = time.monotonic() - started, step.fraction
            ahead = spent * (1 - done) / done if done > 0 else math.inf
            left = f", {ahead:.0f} s left" if ahead < LONGEST_FORECAST else ""
            tell(f"{describe(step)}{left}", shown)
            yield step


class Telling(logging.Handler):
    """Context in which what the package logs for information, as its work goes on, is told."""

    def __init__(self, tell: Callable[[str], object]) -> None:
        super().__init__(logging.INFO)
        self.tell, self.log = tell, logging.getLogger("anmstrip")

    def __enter__(self) -> None:
        self.log.addHandler(self)
        self.log.setLevel(logging.INFO)

    def __exit__(self, *error: object) -> None:
        self.log.removeHandler(self)
        self.log.setLevel(logging.NOTSET)

    def emit(self, record: logging.LogRecord) -> None:
        """Tell a message."""
        self.tell(record.getMessage())


class Commands(click.Group):
    """A group whose commands end in a sentence and an exit status, never in a traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; a user's mistake or a full disk is told, not raised."""
        from anmstrip.errors import InputError

        try:
            return super().invoke(ctx)
        except InputError as error:
            click.echo(str(error), err=True)
            ctx.exit(EXIT_INVALID)
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise  # click's own: the reader of our output has gone
            click.echo(f"Stopped: {error.filename or 'writing'}: {error.strerror}.", err=True)
            ctx.exit(EXIT_STOPPED)
        except MemoryError:
            told = "there is not enough memory for the strip's tangent: type longer elements"
            click.echo(f"Stopped: {told} (strip.refined), or a section.", err=True)
            ctx.exit(EXIT_STOPPED)


@click.group(
    cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
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
    if not any(name in os.environ for name in THREAD_VARIABLES):
        os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    keep_memory()
    atexit.register(gc.freeze)  # or Python searches all it has for what nothing needs, for 0.1 s


def keep_memory() -> None:
    """Keep the memory of arrays for those that come after, where the C library can be told to."""
    keep = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if keep is not None:
        for option, size in MALLOC_OPTIONS.items():
            keep(option, size)


@main.command("run")
@scene_argument
@directory_option
@settings_option
@click.option("--resume", is_flag=True, help="Go on where an earlier run in DIR was interrupted.")
@click.option("--no-report", is_flag=True, help="Leave report.html out.")
@quiet_option
def run_command(
    scene: Path,
    directory: Path | None,
    settings: tuple[str, ...],
    resume: bool,
    no_report: bool,
    quiet: bool,
) -> None:
    """Run a scene; its results can be looked at while it goes on.

    DIR gets strip.pvd and rollers.pvd for ParaView, history.csv with a row for every step,
    profile.csv along the strip, summary.json, a checkpoint and report.html. Keys of --set are
    dotted, rollers and stages go by their names, and values are in TOML syntax:

    \b
      --set friction.coefficient=0.2 --set rollers.r1.radius=0.3
      --set 'strip.cells=[40, 4]'    --set stages.turn.duration=2

    Ctrl-C and SIGTERM keep what was computed, and say how to go on.

    Exit status: 0 done, 1 stopped before its end (what was computed is there, and the message
    says what to try), 2 wrong input (every mistake is told, nothing was written).
    """
    from anmstrip.driver.explain import report
    from anmstrip.driver.scene import Scene

    loaded = Scene.load(scene, settings)
    directory = directory or Path("results", loaded.name)
    running = loaded.run(directory, resume=resume)
    told: tuple[str, ...] = ()
    with interruptions() as signals:
        try:
            told = () if quiet else tuple(running.forewarnings())
            for line in told:
                click.echo(f"Warning: {line}", err=True)
            for _ in running if quiet else show_progress(running, describe_step):
                if signals:
                    raise KeyboardInterrupt
        except BaseException as error:
            if not (signals or isinstance(error, KeyboardInterrupt)):
                raise
            running.interrupted()
            click.echo(f"Interrupted. Everything up to here is in {directory}.")
            if words := report(running, told):
                click.echo(words)
            next_one = next_command(scene, directory, settings, resume=not loaded.repeated)
            click.echo(f"Next: {next_one}")
            sys.exit(EXIT_STOPPED)
    click.echo(running.message)
    if words := report(running, told):
        click.echo(words)
    if not no_report:
        from anmstrip.pictures.report import write_report

        click.echo(f"Report in {write_report(directory)}.")
    click.echo(f"Results in {directory}. Next: anmstrip render {shlex.quote(str(directory))}")
    if not running.outcome.done:
        sys.exit(EXIT_STOPPED)


@contextmanager
def interruptions() -> Iterator[list[int]]:
    """Let SIGTERM interrupt as Ctrl-C does, and yield the signals that have come so far.

    The exception that a signal raises may be swallowed, or become another one, where compiled code
    calls Python.
    """
    came: list[int] = []

    def interrupt(number: int, frame: object) -> None:
        came.append(number)
        raise KeyboardInterrupt

    heard = [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as by nohup
        heard.append(signal.SIGINT)
    usual = {number: signal.signal(number, interrupt) for number in heard}
    try:
        yield came
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)


def next_command(scene: Path, directory: Path, settings: Iterable[str], *, resume: bool) -> str:
    """Return what to type, as a shell takes it, to go on with an interrupted run, or begin anew."""
    given = [part for text in settings for part in ("--set", text)]
    ways = ["--resume"] if resume else []
    return shlex.join(["anmstrip", "run", str(scene), "-o", str(directory), *given, *ways])


@main.command("new", short_help="Write a commented scene to start from.")
@click.argument("kind", metavar="KIND", type=click.Choice(TEMPLATES))
@click.option(
    *("-o", "--output", "target"),
    metavar="FILE",
    type=NamedPath(path_type=Path, dir_okay=False),
    help="Where the scene goes (default: KIND.toml here).",
)
def new_command(kind: str, target: Path | None) -> None:
    """Write a commented scene of a line to start from, which runs as it is.

    KIND is bridle, furnace, leveller, roller (a single one) or steering (one out of line).
    """
    from importlib.resources import files

    from anmstrip.errors import InputError, Mistake, require_parent

    target = target or Path(f"{kind}.toml")
    require_parent("-o", target)
    if target.exists():
        expected, hint = "a file that is not there yet", "-o with another name"
        raise InputError([Mistake("-o", "", str(target), expected, hint)])
    scene = (files("anmstrip.scene") / "templates" / f"{kind}.toml").read_text("utf-8")
    target.write_text(scene, encoding="utf-8")
    typed = shlex.quote(str(target))
    click.echo(f"Scene in {target}. Next: anmstrip explain {typed}, anmstrip run {typed}")


@main.command("explain", short_help="Say what a run would do, and warn.")
@takes_scene()
@click.option(
    "--picture",
    metavar="FILE",
    type=NamedPath(path_type=Path, dir_okay=False),
    help="Also draw the line from the side: a .png, .svg or .pdf.",
)
def explain_command(scene: Scene, picture: Path | None) -> None:
    """Say what a run of a scene would do, and warn; nothing is solved or written.

    Effects with their points and memory, what is left out, rollers with their wraps, stages,
    and which level of kinematics the numbers justify. Keys of --set as for run.
    """
    from anmstrip.driver.explain import draw_line, explain

    if picture is not None:
        draw_line(scene, picture)
    click.echo(explain(scene))
    if picture is not None:
        click.echo(f"Picture in {picture}.")


@main.command("schema")
def schema_command() -> None:
    """Print the JSON schema of scene files, by which editors complete and check them.

    \b
      anmstrip schema > scene.schema.json

    Editors with a TOML server (taplo, Even Better TOML) use it in a file that begins with
    the line "#:schema ./scene.schema.json".
    """
    from anmstrip.scene.schema import json_schema

    click.echo(json.dumps(json_schema(), indent=1, ensure_ascii=False))


@main.command("map", short_help="Follow the stationary state of a line along a control.")
@click.option(
    "--along",
    metavar="KEY=a:b[:n]",
    multiple=True,
    help="Control and range; a second one goes from value to value, the first is followed.",
)
@takes_scene("map")
@quiet_option
def map_command(scene: Scene, along: tuple[str, ...], directory: Path, quiet: bool) -> None:
    """Follow the stationary state of a line along a control.

    The scene's last stage is steady. From its stationary state the control is followed to both
    ends of the range, folds included, and every point on the way is a stationary state. The key is
    one of a stage:

    \b
      anmstrip map examples/bridle_map.toml --along rollers.lower.surface_speed=0.99996:1.00004
      anmstrip map examples/bridle_map.toml --along strip.speed=0.9999:0.99998:201 \\
          --along exit.tension=8e3:12e3:5

    DIR gets map.csv with n rows evenly spaced in the control (101, and 5 curves of a second one):
    tensions, torques, slip arcs, shares of the friction, wraps and offsets; map.png; and map.json
    with the folds, and where the whole wrap of a roller begins or ceases to slip.

    Exit status: 0 done, 1 stopped before both ends (what was computed is there), 2 wrong input.
    """
    from anmstrip.driver.stationary import OperatingMap

    made = OperatingMap(scene, along, directory)
    try:
        with interruptions():
            for _ in made if quiet else show_progress(made, lambda step: step.words):
                pass
    except KeyboardInterrupt:
        made.interrupted()
    click.echo(made.message)
    click.echo(f"Table, figure and summary in {made.directory}.")
    if not made.done:
        sys.exit(EXIT_STOPPED)


@main.command("response", short_help="Frequency response of a stationary state.")
@click.option("--of", metavar="READING", required=True, help="What answers, e.g. offset.")
@click.option("--to", metavar="KEY", required=True, help="What oscillates, e.g. rollers.r1.yaw.")
@takes_scene("response")
def response_command(scene: Scene, of: str, to: str, directory: Path) -> None:
    """Frequency response of a stationary state to small oscillating changes.

    \b
      anmstrip response examples/steering.toml --of offset --to rollers.r1.yaw

    The scene's last stage is steady. READING and KEY are those of the sensitivities in
    summary.json. DIR gets response.csv (omega in rad/s, gain, phase in degrees) and response.png.

    Exit status: 0 done, 1 stopped before the stationary state, 2 wrong input.
    """
    from anmstrip.driver.stationary import respond

    message = respond(scene, of, to, directory)
    click.echo(message)
    if not message.startswith("Done"):
        sys.exit(EXIT_STOPPED)
    click.echo(f"Table and figure in {directory}.")


@main.command("case", context_settings={"show_default": True})
@click.argument("name")
@click.option(
    "--order", type=click.IntRange(2, 60), default=19, metavar="N", help="Order of the series."
)
@click.option(
    "--tolerance",
    type=click.FloatRange(1e-14, 0.1),
    default=1e-4,
    metavar="EPS",
    help="Error that is aimed at, relative to the case's own scales.",
)
@settings_option
@click.option(
    "--scheme",
    type=click.Choice(["taylor", "implicit"]),
    default="taylor",
    help="The paper's scheme, explicit in time, or the implicit one.",
)
@directory_option
def case_command(name: str, settings: tuple[str, ...], directory: Path | None, **how: Any) -> None:
    """Run a mass-spring case of the paper.

    NAME is pressed-plane, moving-plane or rotating-circle. The table shows the steps beside
    the paper's; DIR gets case.csv, case.json and the figures.

    Keys of --set are the paper's symbols: k, F, delta, r, Omega, V, f, q, omega, V_c, R_N,
    zeta, R_C, K, eta, t_end.
    """
    from anmstrip.continuation.path import PathStopped
    from anmstrip.paper.cases import run_case

    try:
        symbols, directory = parse_numbers(settings), directory or Path("results", name)
        report = run_case(name, settings=symbols, directory=directory, **how)
    except PathStopped as stopped:
        click.echo(f"Stopped: {stopped}.", err=True)
        sys.exit(EXIT_STOPPED)
    click.echo(str(report))
    if not report.done:
        sys.exit(EXIT_STOPPED)


def parse_numbers(settings: Iterable[str]) -> dict[str, float]:
    """Return ``KEY=NUMBER`` texts as a mapping, or refuse all that are none."""
    from anmstrip.errors import InputError, Mistake

    numbers, mistakes = {}, []
    for text in settings:
        key, _, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if math.isfinite(number):
            numbers[key.strip()] = number
        else:
            hint = f"--set {key}=1.0"
            mistakes.append(Mistake(f"--set {text}", key, value or None, "a finite number", hint))
    if mistakes:
        raise InputError(mistakes)
    return numbers


@main.command("render")
@result_argument
@click.option(
    "--field",
    metavar="NAME",
    help="What colours the strip, e.g. gap or membrane_force.xx (default: pressure).",
)
@click.option("--movie", is_flag=True, help="All states as movie.gif as well.")
@click.option(
    "--vector", type=click.Choice(["svg", "pdf"]), help="The side view in this format too."
)
def render_command(directory: Path, field: str | None, movie: bool, vector: str | None) -> None:
    """Draw pictures of a run, without a display.

    picture.png from above and picture_side.png from the side, of the last state, into DIR.
    """
    from anmstrip.pictures.render import render

    for picture in render(directory, field=field, movie=movie, vector=vector):
        click.echo(str(picture))


@main.command("report")
@result_argument
def report_command(directory: Path) -> None:
    """Write report.html of a run or a study, also of one that goes on or was interrupted.

    One page that opens in a browser without a network. Of a run: tables, warnings, errors, plots
    along the strip and over time, the last state in space, and the scene. Of a sweep, an accuracy
    study, a map or a response: its table, its figure and plots of any column over any other.
    """
    from anmstrip.pictures.report import write_report

    click.echo(str(write_report(directory)))


@main.command("sweep", short_help="Run a scene with many values of a few keys.")
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
@on_workers
def sweep_command(
    scene: Path,
    variations: tuple[str, ...],
    settings: tuple[str, ...],
    directory: Path | None,
    **how: Any,
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
        needed = 'pip install "dask[distributed]"'
        click.echo(f"anmstrip sweep shares its scenes out by dask. Type: {needed}", err=True)
        sys.exit(EXIT_INVALID)
    from anmstrip.driver.sweep import Sweep

    directory = directory or Path("results", f"{scene.stem}-sweep")
    study = Sweep(scene, variations, settings, directory=directory)
    before = len(study.variants) - len(study.waiting)
    interrupted = run_study(study, **how)
    done, total = len(study.rows) - len(study.stopped), len(study.rows)
    earlier = f", {before} of them ended before" if before else ""
    click.echo(f"{done} of {total} scenes done{earlier}.")
    end_study(study, interrupted)


def run_study(study: Sweep, workers: int | None, scheduler: str | None, quiet: bool) -> str:
    """Run what is left of a study on workers, or here without dask; say what interrupted it."""
    from anmstrip.driver.sweep import local_workers, remote_workers

    left, farm = len(study.waiting), cast("AbstractContextManager[Client | None]", nullcontext())
    if left and find_spec("distributed") is not None:
        from dask.system import CPU_COUNT

        count = min(workers or CPU_COUNT, left)
        farm = local_workers(count) if scheduler is None else remote_workers(scheduler)
    try:
        with interruptions(), farm as client:
            ended = study.run(client) if left else ()
            for _ in ended if quiet else show_progress(ended, str, interval=0.0):
                pass
    except KeyboardInterrupt:
        return "Interrupted."
    except ConnectionError as error:
        return f"Interrupted: {error}."
    return ""


def end_study(study: Sweep, interrupted: str) -> None:
    """Say what stopped and where the table is, with an exit status if not all is done."""
    for row in study.stopped:
        if row["status"] != "waiting":
            click.echo(f"  {row['directory']}: {row['status']}: {row['message']}")
    click.echo(f"Table {study.table}, figure {study.draw()}.")
    if interrupted:
        click.echo(f"{interrupted} Next: the same command, which goes on from here.")
    if study.stopped:
        sys.exit(EXIT_STOPPED)


@main.command("accuracy", short_help="Measure what accuracy costs on a scene.")
@click.option(
    "--along",
    metavar="AXIS",
    multiple=True,
    help="tolerance, newton, order, mesh, speed or kinematics; several give several options "
    "(default: all that apply).",
)
@takes_scene("accuracy")
@on_workers
def accuracy_command(scene: Scene, along: tuple[str, ...], directory: Path, **how: Any) -> None:
    """Measure what accuracy costs on a scene: true errors against seconds and tangents.

    \b
      anmstrip accuracy examples/press.toml
      anmstrip accuracy examples/press.toml --along tolerance --along mesh

    The scene is run to several tolerances (tolerance, and newton: by Newton's method on the same
    equations), orders of the series (order), element lengths (mesh), slip speeds V_c of friction
    (speed) and levels of kinematics, and each is compared with a refined run. DIR gets
    accuracy.csv, accuracy.png, and for every scene a directory of results as of run. Errors stand
    beside what the runs themselves estimate. The same command again goes on where it was
    interrupted.

    Runs share cores, so that seconds are good for ratios; --workers 1 runs one at a time.

    Exit status: 0 all done, 1 interrupted or a scene stopped early, 2 wrong input.
    """
    from anmstrip.driver.accuracy import Accuracy

    study = Accuracy(scene, along, directory=directory)
    click.echo(study.plan)
    interrupted = run_study(study, **how)
    click.echo(study.report())
    end_study(study, interrupted)


if __name__ == "__main__":
    main()
