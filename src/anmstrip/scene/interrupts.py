"""Ctrl-C between the steps of a bookkeeping, never inside."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def unbroken() -> Iterator[None]:
    """Let Ctrl-C wait until the body has ended, and then do what it does.

    For what has to be changed and written together.  In other threads than the main one,
    where Python never raises ``KeyboardInterrupt``, there is nothing to wait for.

    Examples
    --------
    >>> import os, signal
    >>> done = []
    >>> try:
    ...     with unbroken():
    ...         os.kill(os.getpid(), signal.SIGINT)
    ...         done.append("all of it")
    ... except KeyboardInterrupt:
    ...     done.append("then the interruption")
    >>> done
    ['all of it', 'then the interruption']
    """
    usual = signal.getsignal(signal.SIGINT)
    if usual is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    pressed: list[tuple[Any, ...]] = []
    signal.signal(signal.SIGINT, lambda *given: pressed.append(given))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
        if pressed and callable(usual):
            usual(*pressed[-1])
