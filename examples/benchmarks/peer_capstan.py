"""The capstan that other programs are asked to solve, and the answer by formula.

Strip of steel, 4 m long, 1 mm thick, 1 m wide, stretched by 10 kN/m, then pulled down at both
sides over a roller of 0.5 m until it wraps 43°, then in full slip.  Units are SI; x along the
strip, y up.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import import_module
from typing import Any

import numpy as np

from anmstrip.taylor import program
from runs import finished
from strips import FRICTION, MATERIAL, RADIUS, capstan, threaded

YOUNG, POISSON, THICKNESS = MATERIAL["young"], MATERIAL["poisson"], 1.0e-3
LENGTH, DOWN, PULL = 4.0, -0.45, -5773.5
BENDING = YOUNG * THICKNESS**3 / (12.0 * (1.0 - POISSON**2))
COEFFICIENT = FRICTION["coefficient"]
TOLERANCE = 1e-3


@dataclass(frozen=True)
class Answer:
    """The answer of a program."""

    ratio: float  # higher over lower tension
    off: float  # of the formula, relative
    seconds: float  # of one core, by the processor's clock, from the strip at rest to the answer
    steps: int | None  # of load or time
    tangents: int | None  # factorised
    unknowns: int


def formula(coefficient: float, angle: float, low: float, high: float) -> float:
    """Return the ratio of tensions in full slip: e^(f θ) less what bending takes."""
    per_tension = (1.0 + COEFFICIENT**2) * BENDING / (2.0 * RADIUS**2)
    return float(np.exp(coefficient * angle - per_tension * (1.0 / low - 1.0 / high)))


def answer(
    ends: tuple[Any, Any], coefficient: float, seconds: float, counts: tuple[Any, Any, int]
) -> Answer:
    """Return the answer by the forces (N/m, along and up) on entry and exit."""
    entry, exit = (np.asarray(end, dtype=float) for end in ends)
    angle = float(np.arctan2(-exit[1], exit[0]) + np.arctan2(-entry[1], -entry[0]))
    high, low = (float(f(np.linalg.norm([entry, exit], axis=1))) for f in (np.max, np.min))
    off = high / low / formula(coefficient, angle, low, high) - 1.0
    return Answer(high / low, off, seconds, *counts)


def timed(work: Callable[[], Any]) -> float:
    """Return the processor seconds of some work: other programs on the machine do not count."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


OURS = {
    "section": (capstan, "section", 2, 0.05),
    "threaded-section": (threaded, "section", 2, 0.05),
    "shell": (capstan, "shell", 10, 0.025),
    "threaded-shell": (threaded, "shell", 18, 0.025),
}
"""Name → scene, level of kinematics, elements across, their length over the roller (m)."""


def solved(name: str, stiffer: float | None) -> Answer:
    """Solve by the program of that name, with contact so much stiffer, or left to the mesh.

    The compiler of our kernels is imported before the time is taken, as the other programs are.
    """
    if name not in OURS:
        return import_module(f"peer_{name}").solved(stiffer)
    if program.COMPILED:
        import_module("anmstrip.taylor.kernels")
    make, level, across, refined = OURS[name]
    scene, runs = make(level, across, refined, TOLERANCE, stiffer=stiffer), []
    seconds = timed(lambda: runs.append(finished(scene)))
    run, state = runs[0], runs[0].state
    ends = tuple(state.edge_force(edge)[[0, 2]] for edge in ("entry", "exit"))
    effective = run.assembly.friction.effective(state.rollers["r1"].creep_speed or 0.0)
    counts = (run.steps, run.cost.factorisations, run.assembly.strip.unknowns)
    return answer(ends, effective, seconds, counts)


if __name__ == "__main__":
    factor = None if sys.argv[2] == "mesh" else float(sys.argv[2])
    print(json.dumps(asdict(solved(sys.argv[1], factor))))
