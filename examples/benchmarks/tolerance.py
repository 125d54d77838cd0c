"""The tolerance that is asked for beside the error that comes: a cantilever and a capstan.

The paper's cases have the same table in ``cases.py``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Branch, Cost, Path, PathStopped
from anmstrip.driver.scene import Scene
from anmstrip.linalg.solvers import SparseSolver
from cantilever import LENGTH, cantilever
from figures import Measured, crossed, curves, measured, plotted, sheet
from harness import Report, main
from runs import Turning, altered, wrapped
from strips import TENSION, capstan

Array = NDArray[np.float64]

TOLERANCES = tuple(10.0**-k for k in range(3, 11))
ORDERS = (8, 11, 13, 16, 20, 24)

STRICTEST = 3e-11
"""Tolerance of the cantilever's reference, near what round-off allows."""

STRICT_IN_TIME = 5e-9
"""Tolerance of the capstan's reference, near what round-off allows; formulas of order up to 5, and
splines of degree 5 between the steps (cubic ones are off by 1e-7)."""

NOTE = (
    "Columns are tolerances, lines say problem and order. Cantilever: largest error along the path "
    "of a position, over the length, or of a membrane force, over the load; by steps of the load "
    "and along the arc. "
    "Capstan, a section of elements of 0.05 m: largest error of the tension at the entry at any "
    "step while the roller begins to turn, over the tension at the exit. From 3e-9 on it stops: "
    "the last digit of the positions is worth 2e-10 of the tension."
)


def study(quick: bool = False) -> Report:
    """All orders and tolerances on both problems."""
    orders = (8, 20) if quick else ORDERS
    runs = [*_bent(orders, TOLERANCES[:4:3] if quick else TOLERANCES)]
    runs += _turned(orders[-1:] if quick else (8, 13, 20, 24), TOLERANCES[: 2 if quick else 6])
    found = [r for r in runs if np.isfinite(r.error)]
    ratio = plotted(found, ("tolerance", lambda r: r.at), ("error / tolerance", _ratio))
    return Report(
        name="tolerance",
        title="The tolerance that is asked for, and the error that comes",
        data=sheet("", "tolerance", runs),
        sheets=(
            crossed("True error / tolerance", runs, _ratio, NOTE),
            crossed("Tangents", runs, lambda r: r.tangents),
        ),
        figures={"tolerance.png": curves(ratio)},
    )


def _ratio(run: Measured) -> float:
    return run.error / run.at


# a cantilever, rate-free ------------------------------------------------------------


def _bent(orders: Sequence[int], tolerances: Sequence[float]) -> Iterator[Measured]:
    reference = Path(tuple(bent(20, STRICTEST, arclength=True)[0]))
    for arclength, way in ((False, "load"), (True, "arc")):
        for order in orders:
            line = f"cantilever along the {way}, {order}"
            for tolerance in tolerances:
                run = partial(bending_error, reference, order, tolerance, arclength)
                yield measured(line, tolerance, run)


def bent(order: int, tolerance: float, arclength: bool) -> tuple[list[Branch], int]:
    """Return branches to the full load, and tangents."""
    equations, cost = cantilever(8), Cost()
    settings = Settings(order=order, tolerance=tolerance, arclength=arclength)
    start = np.zeros(len(equations.supports.free))
    steps = follow(equations, start, solver=SparseSolver(), settings=settings, cost=cost)
    return [step.branch for step in steps], cost.factorisations


def bending_error(
    reference: Path, order: int, tolerance: float, arclength: bool
) -> tuple[float, int]:
    """Return the largest error of positions and membrane forces, in their scales, and tangents."""
    try:
        branches, tangents = bent(order, tolerance, arclength)
    except PathStopped:
        return np.nan, 0
    equations = cantilever(8)
    model, supports, largest = equations.model, equations.supports, 0.0
    for state, control in _samples(branches):
        exact, moved = supports.full(reference(control), control), np.zeros(model.strip.unknowns)
        moved[supports.free] = state - exact[supports.free]
        position = np.abs(moved[model.value_unknowns]).max() / LENGTH
        largest = max(largest, float(position), model.tension_error(exact, moved))
    return largest, tangents


def _samples(branches: Sequence[Branch]) -> Iterator[tuple[Array, float]]:
    """Return states and controls at four places of every branch, its end among them."""
    for branch in branches:
        for share in (0.25, 0.5, 0.75, 1.0):
            yield branch(share * branch.length)


# a capstan, in time -----------------------------------------------------------------


def _turned(orders: Sequence[int], tolerances: Sequence[float]) -> Iterator[Measured]:
    scene = capstan("section", 1, 0.05, 1e-6)
    full = wrapped(scene)
    strict = {"solver.tolerance": STRICT_IN_TIME, "solver.time_order": 5}
    times, tensions, _ = history(altered(scene, strict), full)
    reference = make_interp_spline(times, tensions, k=5)
    for order in orders:
        for tolerance in tolerances:
            chosen = altered(scene, {"solver.tolerance": tolerance, "solver.order": order})
            run = partial(turning_error, reference, chosen, full)
            yield measured(f"capstan, {order}", tolerance, run)


def history(scene: Scene, full: Array) -> tuple[Array, Array, int]:
    """Return times and tensions at the entry (N/m) of the last stage's steps, and tangents."""
    turning = Turning(scene, full)
    found = [(state.time, state.tension("entry")) for state in turning.states()]
    times, tensions = np.array(found).T
    return times, tensions, turning.march.cost.factorisations


def turning_error(reference: BSpline, scene: Scene, full: Array) -> tuple[float, int]:
    """Return the largest error of the tension at the entry, over that at the exit, and tangents."""
    try:
        times, tensions, tangents = history(scene, full)
    except PathStopped:
        return np.nan, 0
    return float(np.abs(tensions - reference(times)).max()) / TENSION, tangents


if __name__ == "__main__":
    main(study)
