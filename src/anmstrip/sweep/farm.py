"""Workers: dask's, on this machine or behind the address of a scheduler."""

# ruff: noqa: PLC0415 (dask is optional)
from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from anmstrip.scene.errors import InputError, Mistake

if TYPE_CHECKING:
    from distributed import Client

PATIENCE = 10.0
"""Seconds to wait for a scheduler's answer."""

DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""For workers, since a terminal tells every process of Ctrl-C: they are ended by their farm."""


@contextmanager
def local(workers: int) -> Iterator[Client]:
    """So many processes of one thread each; dask replaces those that die."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=0,
            silence_logs=logging.ERROR,
            preload=DEAF,
            dashboard_address=None,
            worker_dashboard_address=None,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


@contextmanager
def remote(address: str) -> Iterator[Client]:
    """Workers of a scheduler that runs somewhere.

    They must have this package and see the same files under the same paths.

    Raises
    ------
    InputError
        Nobody answers there.
    """
    from distributed import Client

    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        expected = f"the address of a scheduler that runs ({error})"
        hint = "dask scheduler, then dask worker ADDRESS with the address that it prints"
        raise InputError([Mistake("--scheduler", "", address, expected, hint)]) from error
    with client:
        yield client
