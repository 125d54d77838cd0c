"""Constants on the way of a step in time: what each one's removal does to tangents and outcome.

A constant is replaced by a value that has no effect, or by a natural one; then some scenes and the
paper's cases are solved again.  A constant stays in the program if that moves a count of tangents
by more than 5 %, or makes something fail.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from anmstrip.continuation.path import PathStopped
from anmstrip.driver.scene import Scene
from anmstrip.paper.cases import solve_case
from anmstrip.paper.mass_spring import CASES
from harness import Cell, Report, Sheet, main

EXAMPLES = Path(__file__).resolve().parents[1]

CONTINUATION, TIME = "anmstrip.continuation", "anmstrip.timestepping.implicit"
MARCH = "anmstrip.simulation.march"

REMOVED: tuple[tuple[str, str, Any], ...] = (
    (MARCH, "FIRST_STEP", 1.0),
    (f"{CONTINUATION}.path", "NEGLIGIBLE_SHARE", 0.1),
    (f"{CONTINUATION}.newton", "WIDEST_FRICTION", 1.0),
    (f"{CONTINUATION}.expansion", "SIGNIFICANT_SHARE", 0.5),
    (f"{CONTINUATION}.expansion", "LENGTH_RATIO", 1.0001),
    (f"{CONTINUATION}.expansion", "MATCHED_ORDERS", 1),
    (f"{CONTINUATION}.expansion", "LONGEST_QUOTIENT", 2.0),
    (TIME, "STEP_GROWTH", (np.inf,) * 5),
    (TIME, "SHORTEST_BRANCH", 1e-6),
    (TIME, "MIN_ERROR_SHARE", 0.0),
    (TIME, "MAX_STEP_BRANCHES", 10**6),
    (TIME, "MAX_RETRY_RATIO", 1e3),
)
"""Module, name, and the value that takes the constant's place, wherever it is imported."""

ELSEWHERE = {
    "round-off, or the largest and smallest numbers": (
        "TINY",
        "LARGEST_COEFFICIENT",
        "DENOMINATOR_DAMPING",
    ),
    "speed alone": ("BLOCK_ROWS",),
    "paths without time": (
        *(
            "LARGEST_PATH_IMBALANCE",
            "STEP_REDUCTION",
            "MIN_REDUCTIONS",
            "LIMIT_POINT_GROWTH",
            "START_OF_PATH",
        ),
        *("COMPARED_ORDERS", "PROGRESSION_TOLERANCE", "ROUND_OFF_SHARE"),
    ),
    "threading": (
        "MAX_GUESS_CORRECTIONS",
        "GUESS_GROWTH",
        "WIDER_CONTACT",
        "LEAST_NARROWING",
        "SLIDING_IMBALANCE",
        "MAX_SLIDING_BRANCHES",
        "DIVERGENCE_GROWTH",
    ),
    "steady stages": (
        "LONG_PATH_STATES",
        "MAX_STATES",
        "WEIGHING_STATES",
        "MAX_WEIGHING_STATES",
        "BALANCING_FRICTION",
        "MAX_LAST_STATES",
        "NEGLIGIBLE_IMBALANCE",
        "MAX_LAST_CORRECTIONS",
        "LAST_REDUCTION",
        "MAX_MOVING_IMBALANCE",
    ),
    "balancing at the end": ("ROUND_OFF_MARGIN", "TANGENT_REUSE_RATIO", "SLOW_CONVERGENCE_RATIO"),
    "snaps": (
        "SNAP_TIMES",
        "REST_CHANGE",
        "SNAP_WAY",
        "SNAP_TIME_LIMIT",
        "FIRST_SNAP_STEP",
        "MAX_SNAP_STEPS",
        "SNAP_TOLERANCE",
    ),
    "imperfections": ("COMPRESSION_ROUND_OFF", "MAX_COMPRESSION_GROWTH"),
}
"""What the other constants of the modules of a step in time are for."""

MODULES = (
    *(f"{CONTINUATION}.{name}" for name in ("expansion", "follow", "newton", "path")),
    *(TIME, "anmstrip.timestepping.formulas", MARCH),
)
"""Modules that a step in time passes through."""

LINES = EXAMPLES.parent / "tests" / "field"

COARSE = {
    "capstan": (),
    "levelling": ("stages.drag.duration=0.02", "strip.refined=0.01"),
    "misaligned": ("strip.cells=[20, 2]", "stages.run.duration=0.05", "strip.refined=0.05"),
    "bridle": ("strip.refined=0.05",),
    "convey": ("strip.refined=0.1", "stages.convey.duration=0.03"),
    "22_break_out": (),
}
"""Example, or scene of the tests → changes that make it quick."""

NOTE = (
    "Tangents with the constant removed, in brackets those with it, where they differ by more "
    "than 5 %; or how the run stopped."
)


def scene(name: str) -> int:
    """Tangents of an example."""
    place = LINES if name[0].isdigit() else EXAMPLES
    run = Scene.load(place / f"{name}.toml", COARSE[name]).run()
    for _ in run:
        pass
    if not run.outcome.done:
        raise PathStopped(run.outcome, 0.0)
    return run.cost.expansions


def case(name: str, tolerance: float) -> int:
    """Tangents of a case of the paper by the implicit scheme."""
    found = solve_case(CASES[name](), "implicit", order=12, tolerance=tolerance)
    if found.stopped is not None:
        raise found.stopped
    return found.cost.expansions


def problems(quick: bool) -> Iterator[tuple[str, Callable[[], int]]]:
    """Problems that are solved, with their names."""
    for name in ("levelling",) if quick else COARSE:
        yield name, partial(scene, name)
    for name in ("pressed-plane",) if quick else ("pressed-plane", "moving-plane"):
        yield name, partial(case, name, 1e-2 if quick else 1e-4)


def solved(problem: Callable[[], int]) -> int | str:
    """Tangents, or the outcome of what stops."""
    try:
        return problem()
    except PathStopped as stopped:
        return stopped.outcome.name.lower()


def study(quick: bool = False) -> Report:
    """Remove one constant at a time."""
    chosen = dict(problems(quick))
    usual = {name: solved(problem) for name, problem in chosen.items()}
    rows: list[tuple[Cell, ...]] = []
    for place, constant, value in REMOVED[:2] if quick else REMOVED:
        with ExitStack() as stack:
            for module in map(import_module, {place, *MODULES}):
                if constant in vars(module):
                    stack.enter_context(patch.object(module, constant, value))
            found = {name: solved(problem) for name, problem in chosen.items()}
        rows.append((constant, *(_told(found[name], usual[name]) for name in chosen)))
    data = Sheet("Constants", ("constant", *chosen), tuple(rows), NOTE)
    return Report("constants", "Constants on the way of a step in time", data, (data,))


def _told(found: int | str, usual: int | str) -> str:
    if isinstance(found, str) or isinstance(usual, str):
        return "" if found == usual else f"{found} ({usual})"
    return "" if abs(found / usual - 1.0) <= 0.05 else f"{found} ({usual})"


if __name__ == "__main__":
    main(study)
