"""Work of loads along a path beside the energy of the strip; plates beside Navier's series."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.sparse.linalg import spsolve
from skfem import MeshTri

from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.geometry import PLATE
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, simple_support
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.loads import pressure
from anmstrip.mechanics.shell import isometric_bending
from anmstrip.results.state import State

YOUNG, THICKNESS, WIDTH, LENGTH, PULL = 2e11, 2e-3, 0.5, 2.0, 2e3
STIFFNESS = YOUNG * THICKNESS**3 / 12.0 / (1.0 - 0.3**2)
WEIGHT = 7850.0 * THICKNESS * 9.81 * 20.0

HUNG: dict[str, Any] = {
    "strip": {
        "kinematics": "section", "length": LENGTH, "width": WIDTH, "thickness": THICKNESS,
        "cells": (24, 1),
    },
    "material": {"young": YOUNG, "poisson": 0.3, "density": 7850.0},
    "edges": {"entry": {"fixed": ("x", "z")}, "exit": {"fixed": ("z",)}},
    "stages": [
        {"name": "pull", "exit": {"force": (PULL, 0.0, 0.0)}},
        {"name": "hang", "gravity": (0.0, 0.0, -20.0 * 9.81)},
    ],
}  # fmt: skip


def way(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Labels, and places of the strip at them."""
    x = np.linspace(-0.5 * LENGTH, 0.5 * LENGTH, 24 * 200 + 1)
    return x, state.way(x)


def energy(state: State) -> float:
    """½ ∫ (E t ε² + D |r,XX|²) of the section, from where it lies alone (J)."""
    x, r = way(state)
    slope = np.gradient(r, x, axis=0, edge_order=2)
    bent = np.gradient(slope, x, axis=0, edge_order=2)
    strain = 0.5 * ((slope**2).sum(axis=1) - 1.0)
    dense = YOUNG * THICKNESS * strain**2 + STIFFNESS * (bent**2).sum(axis=1)
    return 0.5 * WIDTH * float(np.trapezoid(dense, x))


def test_work_of_loads_along_a_path_is_the_energy_of_the_strip() -> None:
    """The pull that stays times the way of the exit, and ∫ λ dG with the work G of all weight.

    States are read inside every step, so that each series is true all along.
    """
    run = Scene.from_tables(HUNG, "hung.toml", ["solver.tolerance=1e-8"]).run()
    steps = [step.state for step in run]
    before, *hanging = [s for s in steps if s.plan.name == "hang" or s.control == 1.0]
    assert before.plan.name == "pull" and len(hanging) > 1
    work = PULL * WIDTH * (way(hanging[-1])[1][-1, 0] - way(before)[1][-1, 0])
    for state in hanging:
        assert state.branch is not None
        inside = [state.inside(a) for a in np.linspace(0.0, state.branch.length, 21)]
        sunk = [-np.trapezoid(way(each)[1][:, 2], way(each)[0]) for each in inside]
        share = [each.control for each in inside]
        work += WEIGHT * WIDTH * (share[-1] * sunk[-1] - share[0] * sunk[0])
        work -= WEIGHT * WIDTH * simpson(sunk, x=share)
    assert energy(hanging[-1]) - energy(before) == pytest.approx(work, rel=1e-4)


def navier(terms: int = 400) -> float:
    """w D / q a⁴ in the middle of a simply supported square plate (Timoshenko, § 30)."""
    m = np.arange(1, terms, 2)
    signs = np.where(m % 4 == 1, 1.0, -1.0)
    squares = m[:, None] ** 2 + m[None, :] ** 2
    products = m[:, None] * m[None, :]
    return float(16.0 / np.pi**6 * (np.outer(signs, signs) / products / squares**2).sum())


def test_plate_converges_to_navier_s_series_with_the_fourth_power() -> None:
    """Simply supported all round, under pressure; elements of Bogner, Fox and Schmit."""
    errors = []
    for count in (2, 4, 8):
        tables = {
            "strip": {
                "kinematics": "plate", "length": 1.0, "width": 1.0, "thickness": 1e-3,
                "cells": (count, count),
            },
            "material": {"young": YOUNG, "poisson": 0.3},
            "edges": {n: {"fixed": ("z",)} for n in ("entry", "exit", "left", "right")},
            "stages": [{"name": "press", "pressure": 1.0}],
        }  # fmt: skip
        *_, last = Scene.from_tables(tables, "plate.toml", ["solver.tolerance=1e-9"]).run()
        strip = last.state.plan.model.strip
        middle = int(np.hypot(*strip.mesh.p).argmin())
        (height,) = last.state.full[strip.unknowns_of(np.atleast_1d(strip.node_values[middle]))]
        errors.append(height * YOUNG * 1e-9 / 12.0 / (1.0 - 0.3**2) / navier() - 1.0)
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    assert errors[-1] < 5e-5 and np.all((rates > 3.9) & (rates < 4.5))


SIDES = {"entry": (0, 0.0), "exit": (0, 1.0), "right": (1, 0.0), "left": (1, 1.0)}


def of_triangles(refined: int) -> float:
    """w D / q a⁴ in the middle of the same plate, of a square cut along both diagonals."""
    mesh = MeshTri.init_symmetric().refined(refined)
    on = {n: lambda x, i=i, at=at: np.isclose(x[i], at) for n, (i, at) in SIDES.items()}
    strip = Strip(mesh.with_boundaries(on), 1e-2, Material(2e9, 0.3, 1000.0), PLATE)
    effects = [isometric_bending(strip, Pattern(strip)), pressure(strip)]
    held = np.unique(np.concatenate([simple_support(strip, name, 2) for name in SIDES]))
    supports = Supports.at_rest(strip.unknowns, held)
    model = Model(strip, Pattern(strip), effects, Scales(1.0, 1.0, 1.0))
    equations = Equilibrium(model, supports, Controls({"pressure": np.array(3.0)}))
    flat = np.zeros(len(supports.free))
    tangent = equations.recurrence(flat, 0.0, 1).tangent().tocsc()
    full = supports.full(-spsolve(tangent, equations.residual(flat, 0.0)), 0.0)
    (middle,) = np.flatnonzero(np.hypot(*(strip.mesh.p - 0.5)) < 1e-9)
    return float(full[strip.node_values[middle]] * strip.bending_stiffness / 3.0)


def test_plate_of_triangles_converges_to_navier_s_series_with_the_sixth_power() -> None:
    """Elements of Argyris with sides of a half, a quarter and an eighth of the plate's."""
    errors = [of_triangles(refined) / navier() - 1.0 for refined in (1, 2, 3)]
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    assert errors[-1] < 3e-8 and np.all((rates > 5.5) & (rates < 6.5))
