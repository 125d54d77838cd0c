"""The capstan that other programs are asked to solve, and the answer by formula.

Strip of steel, 4 m long, 1 mm thick, 1 m wide, stretched by 10 kN/m, then pulled down at both
sides over a roller of 0.5 m until it wraps 43°, then in full slip.  Units are SI; x along the
strip, y up.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from anmstrip.driver.scene import Scene
from anmstrip.taylor import program
from comparisons import Finished
from strips import FRICTION, MATERIAL, RADIUS

YOUNG, POISSON, THICKNESS = MATERIAL["young"], MATERIAL["poisson"], 1.0e-3
LENGTH, DOWN, PULL = 4.0, -0.45, -5773.5
BENDING = YOUNG * THICKNESS**3 / (12.0 * (1.0 - POISSON**2))
COEFFICIENT = FRICTION["coefficient"]
TOLERANCE = 1e-3


@dataclass(frozen=True)
class Answer:
    """What a program found.

    Attributes
    ----------
    ratio : float
        Higher over lower tension.
    off : float
        Of the formula, relative.
    seconds : float
        Of one core, by the processor's clock, from the strip at rest to the answer.
    steps, tangents, unknowns : int or None
        Of load or time; factorised.
    """

    ratio: float
    off: float
    seconds: float
    steps: int | None
    tangents: int | None
    unknowns: int


def formula(coefficient: float, angle: float, low: float, high: float) -> float:
    """Ratio of tensions in full slip: e^(f θ) less what bending takes."""
    per_tension = (1.0 + COEFFICIENT**2) * BENDING / (2.0 * RADIUS**2)
    return float(np.exp(coefficient * angle - per_tension * (1.0 / low - 1.0 / high)))


def answer(
    ends: tuple[Any, Any], coefficient: float, seconds: float, counts: tuple[Any, Any, int]
) -> Answer:
    """From the forces (N/m, along and up) on entry and exit."""
    entry, exit = (np.asarray(end, dtype=float) for end in ends)
    angle = float(np.arctan2(-exit[1], exit[0]) + np.arctan2(-entry[1], -entry[0]))
    high, low = (float(f(np.linalg.norm([entry, exit], axis=1))) for f in (np.max, np.min))
    off = high / low / formula(coefficient, angle, low, high) - 1.0
    return Answer(high / low, off, seconds, *counts)


def ours(
    scene_of: Callable[..., Scene], level: str, across: int, refined: float
) -> Callable[[float | None], Answer]:
    """This program at a level of kinematics, from a strip at rest or from a threaded one.

    The compiler of its kernels is imported before the time is taken, as the other programs are.
    """
    if program.AVAILABLE:
        import_module("anmstrip.taylor.kernels")

    def solved(stiffer: float | None) -> Answer:
        scene = scene_of(level, across, refined, TOLERANCE, stiffer=stiffer)
        found: list[Finished] = []
        seconds = timed(lambda: found.append(Finished.of(scene)))
        run, state = found[0].run, found[0].run.state
        assert state is not None
        ends = tuple(state.edge_force(name)[[0, 2]] for name in ("entry", "exit"))
        slip = state.rollers["r1"].creep_speed or 0.0
        effective = run.assembly.friction.effective(slip)  # type: ignore[union-attr]
        counts = (run.steps, run.cost.factorisations, run.assembly.strip.unknowns)
        return answer((ends[0], ends[1]), effective, seconds, counts)

    return solved


def timed(work: Callable[[], Any]) -> float:
    """Processor seconds that it takes: other programs on the machine do not count."""
    begin = time.process_time()
    work()
    return time.process_time() - begin
