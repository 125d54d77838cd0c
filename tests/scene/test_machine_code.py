"""Residuals, tangents and orders by machine code are those by numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from threaded import ONE, roller, scene_of

from anmstrip.arrays import Array
from anmstrip.equilibrium import Equilibrium
from anmstrip.linalg.solvers import Bordered
from anmstrip.mechanics import effects
from anmstrip.mechanics.effects import CompiledSeries
from anmstrip.results.state import State
from anmstrip.taylor import program
from anmstrip.timestepping.formulas import AffineVelocity

pytest.importorskip("numba")

ORDER, SPEED = 8, 0.2
IDLER = {**roller("a", 0.0, -0.5, 0.5, "over"), "drive": "idle", "bearing": 40.0}
CROWNED = {**roller("a", 0.0, -0.5, 0.5, "over"), "crown": [0.0, -1e-3]}
DRIVEN = {"a": {"surface_speed": SPEED}}

SCENES: dict[str, dict[str, Any]] = {
    "in time, over an idler": {
        "strip": {"refined": 0.1, "cells": (6, 2), "kinematics": "shell"},
        "rollers": [IDLER],
        "stages": [{"duration": 0.1, "entry": {"velocity": [0.0, 0.0, SPEED]}}],
    },
    "stationary, with an idler": {
        "strip": {"refined": 0.1},
        "rollers": [IDLER],
        "stages": [{"steady": True, "strip": {"speed": SPEED}}],
    },
    "stationary shell over a crown": {
        "strip": {"refined": 0.1, "cells": (6, 2), "kinematics": "shell"},
        "rollers": [CROWNED],
        "stages": [{"steady": True, "strip": {"speed": SPEED}, "rollers": DRIVEN}],
    },
}
"""With all operators: of elements, contact, slopes, surfaces, transport and drives."""


def threaded(tables: dict[str, Any]) -> State:
    """A state in the stage after threading."""
    friction = {"law": "tanh", "coefficient": 0.3, "speed": 1e-2}
    run = scene_of({**ONE, "friction": friction, "solver": {"tolerance": 1e-3}, **tables}).run()
    for step in run:
        if step.stage != "threading":
            break
    return step.state


def orders(state: State) -> tuple[set[str], list[Array]]:
    """Effects by machine code; tangent and orders of a residual along random unknowns."""
    plan, rng = state.plan, np.random.default_rng(3)
    free = plan.supports.free
    rate = AffineVelocity(50.0, np.full(len(free), 1e-3), np.zeros(len(free)))
    velocity = rate if plan.in_time else None
    model = plan.model.with_effects(plan.model.effects)
    equations = Equilibrium(model, plan.supports, plan.controls, velocity)
    recurrence = equations.recurrence(state.full[free], 0.5, ORDER)
    machine = {p.effect.name for p in recurrence.parts if isinstance(p, CompiledSeries)}
    tangent = recurrence.tangent()
    matrix = tangent.assembled() if isinstance(tangent, Bordered) else tangent
    found = [matrix.data, recurrence.residual, recurrence.control_derivative()]
    for k in range(1, ORDER + 1):
        if k > 1:
            found.append(recurrence.advance(k))
        change = rng.standard_normal(len(free)) * 1e-4 * plan.model.units[free]
        recurrence.correct(k, change, 0.3 if k == 1 else 0.0)
    return machine, found


@pytest.mark.parametrize("name", sorted(SCENES))
def test_same_orders(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    state = threaded(SCENES[name])
    machine, by_machine = orders(state)
    assert machine >= {"membrane", "contact", "friction"}
    for module in (program, effects):
        monkeypatch.setattr(module, "COMPILED", False)
    none, by_numpy = orders(state)
    assert not none
    for i, (found, expected) in enumerate(zip(by_machine, by_numpy, strict=True)):
        size = 1e-12 * np.abs(expected).max()
        if i == 1:  # in equilibrium nothing is left but the round-off of E t (1 + strain)
            size = 1e-15 * state.plan.model.strip.membrane_stiffness
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=size)
