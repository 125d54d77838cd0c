"""Orders by machine code, from unknowns to residuals, are those by numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from threaded import ONE, roller, scene_of

from anmstrip.arrays import Array
from anmstrip.equilibrium import Equilibrium
from anmstrip.mechanics.effects import LawSeries
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


def orders(tables: dict[str, Any], *, machine: bool) -> list[Array]:
    """Orders of the residual of a stage about a threaded strip, along random unknowns."""
    friction = {"law": "tanh", "coefficient": 0.3, "speed": 1e-2}
    run = scene_of({**ONE, "friction": friction, "solver": {"tolerance": 1e-3}, **tables}).run()
    steps = iter(run)
    while run.state is None or run.state.plan.name == "threading":
        next(steps)
    plan, rng = run.state.plan, np.random.default_rng(3)
    free = plan.supports.free
    rate = AffineVelocity(50.0, np.full(len(free), 1e-3), np.zeros(len(free)))
    velocity = rate if plan.in_time else None
    equations = Equilibrium(plan.model, plan.supports, plan.controls, velocity)
    recurrence = equations.recurrence(run.state.full[free], 0.5, ORDER)
    laws = [part for part in recurrence.parts if isinstance(part, LawSeries)]
    assert {part.effect.name for part in laws if part.compiled} >= {
        "membrane",
        "contact",
        "friction",
    }
    for part in laws:
        part.compiled = part.compiled if machine else None
    found = []
    for k in range(1, ORDER + 1):
        if k > 1:
            found.append(recurrence.advance(k))
        change = rng.standard_normal(len(free)) * 1e-4 * plan.model.units[free]
        recurrence.correct(k, change, 0.3 if k == 1 else 0.0)
    return found


@pytest.mark.parametrize("name", sorted(SCENES))
def test_same_orders(name: str) -> None:
    by_numpy, by_machine = (orders(SCENES[name], machine=machine) for machine in (False, True))
    for expected, found in zip(by_numpy, by_machine, strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
