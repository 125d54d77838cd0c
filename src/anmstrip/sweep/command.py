"""The command ``anmstrip sweep``."""

# ruff: noqa: PLC0415 (imported when it is asked for)
from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from anmstrip import options
from anmstrip.options import STOPPED, WRONG

if TYPE_CHECKING:
    from distributed import Client

    from anmstrip.sweep.study import Ended, Sweep

NEEDED = 'anmstrip sweep shares its scenes out by dask. Type: pip install "dask[distributed]"'


@click.command(short_help="Run a scene with many values of a few keys.")
@options.scene
@click.option(
    "--vary",
    "variations",
    metavar="KEY=a:b:n",
    multiple=True,
    help="Key and values: n from a to b, or a list v1,v2,v3; several make all combinations.",
)
@options.settings
@options.directory
@click.option("--workers", type=click.IntRange(1), metavar="N", help="Processes (default: cores).")
@click.option("--scheduler", metavar="ADDRESS", help="Use a dask cluster that runs already.")
@options.quiet
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
    finished = _ran(study, workers, scheduler, quiet)
    click.echo(_said(study, there))
    click.echo(f"Table {study.table.path}, figure {study.draw()}.")
    if not finished:
        click.echo("Interrupted. Next: the same command, which goes on from here.")
    if study.stopped:
        sys.exit(STOPPED)


def _ran(study: Sweep, workers: int | None, scheduler: str | None, quiet: bool) -> bool:
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
    from anmstrip.sweep import farm

    if scheduler is not None:
        return farm.remote(scheduler)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return farm.local(min(workers or cores or 1, len(study.waiting)))


def _watched(study: Sweep, client: Client, quiet: bool) -> Iterator[Ended]:
    from anmstrip.progress import watched

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
