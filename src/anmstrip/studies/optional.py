"""Other people's programs, which a study uses where they are installed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

ONE_CORE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def installed(module: str) -> bool:
    """Whether a module can be imported."""
    return find_spec(module) is not None


def left_out(modules: Iterable[str]) -> str:
    """One line about those that are not installed, empty if all are."""
    missing = ", ".join(module for module in modules if not installed(module))
    return f"Left out, not installed: {missing} (pip install 'anmstrip[peers]')." if missing else ""


@dataclass(frozen=True)
class Reply:
    """Of a process: what it said (None if it failed), how it ended, seconds of the clock."""

    said: dict[str, Any] | None
    outcome: str
    seconds: float


def asked(module: str, *words: str, limit: float) -> Reply:
    """Run a module in a process of its own, on one core; its last line is JSON."""
    begin = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-m", module, *words],
            check=False, capture_output=True, text=True, timeout=limit,
            env={**os.environ, **ONE_CORE},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Reply(None, f"not done in {limit:g} s", limit)
    spent = time.perf_counter() - begin
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        return Reply(None, f"failed: {said[-1][:80]}", spent)
    return Reply(json.loads(done.stdout.strip().splitlines()[-1]), "done", spent)
