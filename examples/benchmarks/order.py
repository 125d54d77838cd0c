"""The order of the series: true error against cost, for orders from 4 to 40."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Cost
from anmstrip.continuation.follow import Settings, follow
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.scene.stage_tables import SolverSpec
from cantilever import LENGTH, cantilever, tip
from figures import (
    Measured,
    by_line,
    crossed,
    curves,
    measured,
    plotted,
    sheet,
    work_precision,
)
from harness import Cell, Report, Sheet, main
from runs import altered
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
    """All orders at all tolerances, on both problems."""
    orders = (4, 12, 20) if quick else ORDERS
    tolerances = TOLERANCES[:1] if quick else TOLERANCES
    runs = []
    for name, problem in _problems(0.2 if quick else 0.1).items():
        runs += list(_runs(name, problem, (*orders, CHOSEN), tolerances))
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


class Bending:
    """A cantilever of 16 elements."""

    strictest = 1e-10

    def __init__(self) -> None:
        self.equations = cantilever()

    def __call__(self, order: int, tolerance: float) -> tuple[Array, int]:
        """Return the tip over the length, and tangents."""
        settings = Settings(tolerance=tolerance, arclength=True, max_steps=100_000)
        settings = settings if order == CHOSEN else replace(settings, order=order)
        cost, u = Cost(), np.zeros(len(self.equations.supports.free))
        *_, last = follow(self.equations, u, solver=SparseSolver(), settings=settings, cost=cost)
        return tip(self.equations, last.branch.end[0]) / LENGTH, cost.factorisations

    @property
    def chooses(self) -> bool:
        """Whether the program can choose an order by itself."""
        return _left_out(Settings().order)


class Scenic:
    """A scene with a roller, to its end."""

    def __init__(self, scene: Scene, strictest: float) -> None:
        self.scene, self.strictest = scene, strictest

    def __call__(self, order: int, tolerance: float) -> tuple[Array, int]:
        """Return the tension ratio and mean pressure over T/R, and tangents."""
        chosen = {} if order == CHOSEN else {"solver.order": order}
        run = Run(altered(self.scene, {**chosen, "solver.tolerance": tolerance}))
        for _ in run:
            pass
        assert run.outcome.done, run.message
        assert run.state is not None
        reading = run.state.rollers["r1"]
        force = reading.normal_force / (reading.tension_in * self.scene.rollers[0].radius)
        return np.array([reading.tension_ratio or np.nan, force]), run.cost.factorisations

    @property
    def chooses(self) -> bool:
        """Whether the program can choose an order by itself."""
        return _left_out(SolverSpec().order)


def _left_out(default: Any) -> bool:
    return not isinstance(default, int)


def _problems(refined: float) -> dict[str, Bending | Scenic]:
    """Return bending by arclength, pressing without friction, and turning in time."""
    turned = capstan("section", 1, refined, 1e-6)
    pressed = turned.model_copy(update={"stages": turned.stages[:-1]})
    return {
        "cantilever": Bending(),
        "press": Scenic(pressed, 1e-10),
        "capstan": Scenic(turned, 1e-7),
    }


def _runs(
    name: str, problem: Bending | Scenic, orders: Sequence[int], tolerances: Sequence[float]
) -> Iterator[Measured]:
    reference, _ = problem(20, problem.strictest)

    def run(order: int, tolerance: float) -> tuple[float, int]:
        found, tangents = problem(order, tolerance)
        return float(np.abs(found - reference).max()), tangents

    for tolerance in tolerances:
        for order in orders:
            if (order != CHOSEN or problem.chooses) and tolerance > problem.strictest:
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
