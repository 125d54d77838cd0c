"""Backward differences: the order in time that is seen, and conveying over nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.follow import Settings
from anmstrip.continuation.path import Cost
from anmstrip.driver.scene import Scene
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.paper.mass_spring import Parameters, PressedPlane, Reference, reference_solution
from anmstrip.results.state import State
from anmstrip.timestepping.formulas import Memory
from anmstrip.timestepping.implicit import Stepping, integrate
from anmstrip.timestepping.index_one import FunctionRateEquations
from figures import Measured, by_line, curves, exponent, measured, plotted, sheet, work_precision
from harness import Cell, Report, Sheet, main
from runs import altered, finished
from strips import CONTACT, DOWN, FRICTION, MATERIAL, PULL, ROLLER, SHEET

Array = NDArray[np.float64]

ORDERS = (1, 2, 3, 4, 5)

SMOOTH = PressedPlane(Parameters(q=0.5, omega=1.0, t_end=2.0))
"""Friction so blunt that nothing is faster than the whole motion."""

BEGIN = 0.5
"""Time (s) before which the formulas find their past."""

COUNTS = (24, 32, 48, 64, 96, 128)
"""Steps from there to the end."""

CONVEYED = 0.2
"""s, in which two elements of 0.1 m pass."""


def study(quick: bool = False) -> Report:
    """Measure orders in a smooth motion, and on a strip that is conveyed."""
    smooth = list(_smooth(COUNTS[:4] if quick else COUNTS))
    conveyed = list(_conveyed(quick))
    fixed = [r for r in conveyed if "fixed" in r.line]
    h = ("step (s)", lambda r: r.at)
    errors = ("error", lambda r: r.error)
    return Report(
        name="time",
        title="Time: the order that is seen, and conveying over nodes",
        data=sheet("", "step or tolerance", [*smooth, *conveyed]),
        sheets=(
            _orders("Smooth motion of a mass, steps of one length", smooth, SMOOTHLY),
            _orders("A strip conveyed over nodes, steps of one length", fixed, CONVEYING),
            sheet("All runs of the strip", "step or tolerance", conveyed),
        ),
        figures={
            "time.png": curves(plotted(smooth, h, errors), plotted(fixed, h, errors)),
            "time-conveying.png": work_precision(conveyed, "error"),
        },
    )


SMOOTHLY = (
    "§3.1 with q = 0.5, ω = 1; the past of the first step is exact. Errors at the end (m) against "
    "Radau's method; order: slope of the last three."
)

CONVEYING = (
    "A section strip of elements of 0.1 m, driven by the roller alone over 0.2 m. Errors are the "
    "largest at the end, of positions over the length or of membrane forces over the largest "
    "tension, against a run in steps of a fourth of the shortest (a half with --quick)."
)


def _orders(title: str, runs: Sequence[Measured], note: str) -> Sheet:
    """Return a row for every line, with the errors and the slope."""
    places = list(dict.fromkeys(r.at for r in runs))
    rows: list[tuple[Cell, ...]] = []
    for line, own in by_line(runs).items():
        slope = exponent([r.at for r in own[-3:]], [r.error for r in own[-3:]])
        rows.append((line, *(r.error for r in own), slope))
    columns = ("line", *(f"h = {at:.3g} s" for at in places), "order")
    return Sheet(title, columns, tuple(rows), note)


# a mass ---------------------------------------------------------------------------


def _smooth(counts: Sequence[int]) -> Iterator[Measured]:
    reference = reference_solution(SMOOTH, 1e-13)
    for order in ORDERS:
        for count in counts:
            h = (SMOOTH.parameters.t_end - BEGIN) / count
            yield measured(f"order {order}", h, partial(smooth_error, reference, order, h))


def smooth_error(reference: Reference, order: int, h: float) -> tuple[float, int]:
    """Return the error of u at the end (m) in steps of one length, and tangents."""
    end = SMOOTH.parameters.t_end
    times = BEGIN - h * np.arange(order + 1)
    past = reference(times)
    v = reference.equation.rate(np.array(BEGIN), past[0])
    memory = Memory(tuple(times), tuple(past), v, h, order)
    cost = Cost()
    *_, last = integrate(
        FunctionRateEquations(SMOOTH.residual, end),
        memory,
        end,
        solver=DenseSolver(),
        settings=Settings(tolerance=1e-12),
        stepping=Stepping(end, 1e-10, order, h),
        cost=cost,
    )
    return float(np.abs(last.u - reference([end])[0]).max()), cost.factorisations


# a strip ----------------------------------------------------------------------------


def conveying() -> Scene:
    """Return a section strip that is let go and taken along by a roller."""
    rolling = {"rollers": {"r1": {"surface_speed": 1.0}}}
    down, less = {"move": [0.0, 0.0, -0.45]}, [0.95 * force for force in DOWN]
    still = {"duration": 1.0, "friction": False}
    tables = {
        "strip": {**SHEET, "length": 4.0, "cells": [40, 1], "kinematics": "section"},
        "material": MATERIAL,
        "contact": CONTACT,
        "friction": {**FRICTION, "speed": 1e-2},
        "rollers": [ROLLER],
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [
            {**PULL, **still, "name": "tension"},
            {"name": "wrap", **still, "entry": down, "exit": {"force": DOWN}},
            {"name": "slacken", "duration": 0.1, "exit": {"force": less}},
            {"name": "start", "duration": 0.2, "entry": {"release": True}, **rolling},
            {"name": "convey", "duration": CONVEYED, **rolling},
        ],
    }
    return Scene.model_validate(tables)


class Conveyor:
    """The scene where conveying begins, to be gone on with in many ways."""

    def __init__(self) -> None:
        self.scene = altered(conveying(), {"solver.tolerance": 1e-3})
        before = self.scene.model_copy(update={"stages": self.scene.stages[:-1]})
        self.run = finished(before)

    def __call__(self, changes: dict[str, Any]) -> tuple[State, int]:
        """Return the state at the end, and tangents."""
        march = copy(self.run.march)
        march.scene, march.cost = altered(self.scene, changes), Cost()
        plan = march.course.plan(self.scene.course[-1], {})
        for arrival in march.through(plan, 100_000):
            march.accept(arrival)
        return arrival.state, march.cost.factorisations


def difference(state: State, exact: State) -> float:
    """Return the error of positions over the length, or of membrane forces over the tension."""
    model, change = state.plan.model, state.full - exact.full
    moved = float(np.abs(change[model.value_unknowns]).max()) / model.scales.length
    return max(moved, model.tension_error(exact.full, change))


def _conveyed(quick: bool) -> Iterator[Measured]:
    steps = (1e-2, 5e-3) if quick else (1e-2, 5e-3, 2.5e-3, 1.25e-3)
    orders = (2,) if quick else (1, 2, 3)
    shortest = steps[-1] / (2.0 if quick else 4.0)
    conveyed = Conveyor()
    finest, _ = conveyed({"solver.time_step": shortest, "solver.time_order": 2})

    def run(changes: dict[str, Any]) -> tuple[float, int]:
        found, tangents = conveyed(changes)
        return difference(found, finest), tangents

    for order in orders:
        for h in steps:
            choice = {"solver.time_step": h, "solver.time_order": order}
            yield measured(f"strip, fixed, order {order}", h, partial(run, choice))
    for order in () if quick else (2, 5):
        for tolerance in (1e-2, 1e-3, 1e-4):
            choice = {"solver.tolerance": tolerance, "solver.time_order": order}
            line = f"strip, chosen, order up to {order}"
            yield measured(line, tolerance, partial(run, choice))


if __name__ == "__main__":
    main(study)
