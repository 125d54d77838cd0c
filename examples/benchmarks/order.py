"""The order of the series: true error against cost, for orders from 4 to 40."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Cost
from anmstrip.driver.scene import Scene
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.scene.tables import SolverSpec
from cantilever import LENGTH, cantilever, tip
from figures import Measured, by_line, crossed, curves, measured, plotted, sheet, work_precision
from harness import Cell, Report, Sheet, main
from runs import altered, finished
from strips import capstan

Array = NDArray[np.float64]

ORDERS = (4, 6, 8, 10, 12, 15, 20, 25, 30, 40)

CHOSEN = 0
"""Stands for the order that the program chooses."""

TOLERANCES = (1e-3, 1e-5, 1e-7)

NOTE = (
    "Errors are changes from a run at a tolerance of 1e-10 on the same mesh: of the tip over the "
    "length, of the tension ratio, of the mean pressure."
)


def study(quick: bool = False) -> Report:
    """Run all orders at all tolerances, on all problems."""
    runs = list(_runs(quick))
    fixed = [r for r in runs if r.at != CHOSEN]
    at: tuple[str, Callable[[Measured], float]] = ("order", lambda r: r.at)
    seconds = plotted(fixed, at, ("seconds of one core", lambda r: r.seconds))
    tangents = plotted(fixed, at, ("tangents", lambda r: r.tangents))
    return Report(
        name="order",
        title="The order of the series: error against cost",
        data=sheet("", "order", runs),
        sheets=(
            _best(runs),
            crossed("Seconds", fixed, lambda r: r.seconds, "Columns are orders."),
            crossed("Tangents", fixed, lambda r: r.tangents),
            crossed("True error", fixed, lambda r: r.error, NOTE),
        ),
        figures={
            "order.png": curves(seconds, tangents),
            "order-precision.png": work_precision(_by_order(fixed), "error"),
        },
    )


Problem = Callable[[int, float], tuple[Array, int]]
"""Order and tolerance → results and tangents."""


def bending() -> Problem:
    """Return a cantilever of 16 elements: its tip over the length."""
    equations = cantilever()

    def solved(order: int, tolerance: float) -> tuple[Array, int]:
        settings = Settings(tolerance=tolerance, arclength=True, max_steps=100_000)
        settings = settings if order == CHOSEN else replace(settings, order=order)
        cost, u = Cost(), np.zeros(len(equations.supports.free))
        *_, last = follow(equations, u, solver=SparseSolver(), settings=settings, cost=cost)
        return tip(equations, last.branch.end[0]) / LENGTH, cost.factorisations

    return solved


def of_scene(scene: Scene) -> Problem:
    """Return a scene with a roller: its tension ratio, and mean pressure over T/R, at the end."""

    def solved(order: int, tolerance: float) -> tuple[Array, int]:
        chosen = {} if order == CHOSEN else {"solver.order": order}
        run = finished(altered(scene, {**chosen, "solver.tolerance": tolerance}))
        reading = run.state.rollers["r1"]
        force = reading.normal_force / (reading.tension_in * scene.rollers[0].radius)
        return np.array([reading.tension_ratio or np.nan, force]), run.cost.factorisations

    return solved


def _runs(quick: bool) -> Iterator[Measured]:
    """Yield bending by arclength, pressing without friction, and turning in time."""
    orders, tolerances = ((4, 12, 20), TOLERANCES[:1]) if quick else (ORDERS, TOLERANCES)
    turned = capstan("section", 1, 0.2 if quick else 0.1, 1e-6)
    pressed = turned.model_copy(update={"stages": turned.stages[:-1]})
    problems = {
        "cantilever": (bending(), 1e-10, Settings().order),
        "press": (of_scene(pressed), 1e-10, SolverSpec().order),
        "capstan": (of_scene(turned), 1e-7, SolverSpec().order),
    }
    for name, (problem, strictest, default) in problems.items():
        reference, _ = problem(20, strictest)

        def run(order: int, tolerance: float, problem=problem, reference=reference):
            found, tangents = problem(order, tolerance)
            return float(np.abs(found - reference).max()), tangents

        chosen = () if isinstance(default, int) else (CHOSEN,)
        for tolerance in (t for t in tolerances if t > strictest):
            for order in (*orders, *chosen):
                yield measured(f"{name}, {tolerance:.0e}", order, partial(run, order, tolerance))


def _by_order(runs: Sequence[Measured]) -> list[Measured]:
    """Return lines of one order, from tolerance to tolerance, of some orders."""
    shown = sorted({r.at for r in runs})[::3]
    lines = [(r, r.line.partition(",")[0]) for r in runs if r.at in shown]
    return [
        Measured(f"{name}, order {r.at:.0f}", r.at, r.error, r.tangents, r.seconds)
        for r, name in lines
    ]


def _best(runs: Sequence[Measured]) -> Sheet:
    """The cheapest order of every line, and what the program takes by itself."""
    rows: list[tuple[Cell, ...]] = []
    for line, own in by_line(runs).items():
        best = min((r for r in own if r.at != CHOSEN), key=lambda r: r.seconds)
        chosen = next((r for r in own if r.at == CHOSEN), None)
        own_choice = (None, None) if chosen is None else (chosen.seconds, chosen.tangents)
        near = [r.at for r in own if r.at != CHOSEN and r.seconds < 1.1 * best.seconds]
        rows.append((line, int(best.at), f"{min(near):.0f}–{max(near):.0f}", best.seconds,
                     best.tangents, best.error, *own_choice))  # fmt: skip
    columns = ("problem, tolerance", "best order", "within 10 %", "seconds", "tangents", "error",
               "chosen by the program: seconds", "tangents")  # fmt: skip
    return Sheet("The best order", columns, tuple(rows))


if __name__ == "__main__":
    main(study)
