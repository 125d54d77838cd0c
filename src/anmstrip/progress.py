"""The progress of a run on standard error: a bar on a terminal, else a line now and then."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol, TextIO, TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

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
