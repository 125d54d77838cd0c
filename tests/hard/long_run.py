"""A run of very many steps: what it takes of memory, disk and time must not grow with them.

A strip lies on a roller that turns under it, in steps of one length; every hundredth state is
written.  For each tenth of the run: seconds on the processor per step, memory in use, and bytes on
disk per step::

    python tests/hard/long_run.py --steps 100000
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from anmstrip.driver.scene import Scene

STEP = 1e-3
"""Of the time (s)."""


@dataclass(frozen=True)
class Part:
    """A tenth of a run."""

    steps: int  # up to its end
    seconds: float  # on the processor, per step
    memory: float  # most that was in use (MB)
    written: float  # bytes of tables and lists of states per step


def tables_of(steps: int, every: int) -> dict[str, Any]:
    """As few unknowns as a roller with friction allows; fed, so that it may go on for ever."""
    return {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": 1e-3, "refined": 0.1},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {},
        "friction": {"coefficient": 0.3},
        "rollers": [{"name": "r1", "radius": 0.5, "centre": (0.0, 0.0, -0.5), "wrap": "over"}],
        "threading": {"tension": 1e4, "entry": (-1.0, 0.0, -0.4), "exit": (1.0, 0.0, -0.4)},
        "edges": {"entry": {"fixed": ("x", "z")}},
        "stages": [
            {"name": "turn", "duration": STEP * steps, "rollers": {"r1": {"surface_speed": 1.0}}}
        ],
        "solver": {"time_step": STEP, "max_steps": 2 * steps, "max_tangents": 10 * steps},
        "output": {"every": every},
    }


def memory() -> float:
    """Most memory that this process has had in use (MB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024e-6


def parts_of(steps: int, directory: Path, every: int = 100) -> list[Part]:
    """Run so many steps, and say what each tenth of them took."""
    run = Scene.model_validate(tables_of(steps, every)).run(directory)
    found = list[Part]()
    before, size, last = time.process_time(), 0, 0
    for step in run:
        if step.step < (len(found) + 1) * steps // 10:
            continue
        now = time.process_time()
        tables = (path for path in directory.iterdir() if path.suffix in (".csv", ".pvd"))
        grown = sum(path.stat().st_size for path in tables)
        taken = step.step - last
        part = Part(
            step.step, (now - before) / taken, memory(), (grown - size) / taken,
        )  # fmt: skip
        print(part, flush=True)
        found.append(part)
        before, size, last = now, grown, step.step
    assert run.outcome.done, run.message
    return found


def main() -> None:
    """Run once."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--every", type=int, default=100)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        parts_of(given.steps, Path(name), given.every)


if __name__ == "__main__":
    main()
