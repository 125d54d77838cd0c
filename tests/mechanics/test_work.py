"""Work of what presses and pulls, along the series of a path, beside the energy of the strip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy.integrate import quad_vec

from anmstrip.driver.scene import Scene
from anmstrip.results.state import State

PULL, MORE, LIFT, TOLERANCE = 2e4, 6e4, 0.1, 1e-8

PRESSED: dict[str, Any] = {
    "strip": {"length": 2.0, "width": 0.2, "thickness": 1e-3, "refined": 0.05},
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {},
    "rollers": [{"name": "r", "radius": 0.3, "centre": (0.0, 0.0, -0.301)}],
    "edges": {"entry": {"fixed": ("x", "z"), "centred": True}, "exit": {"fixed": ("z",)}},
    "stages": [
        {"name": "pull", "exit": {"force": (PULL, 0.0, 0.0)}},
        {
            "name": "press",
            "exit": {"force": (MORE, 0.0, 0.0)},
            "rollers": {"r": {"move": (0.0, 0.0, LIFT)}},
        },
    ],
}


def energies(state: State) -> dict[str, float]:
    """Energy (J) that is stored by each of them, from the strip's own functions.

    Membrane ½ N : E of plane stress, and of a section E t ε²; bending ½ D |r,XX|², and with
    Poisson's ratio of a shell; contact the reaction of the law, beyond that at its reach.
    """
    strip = state.plan.model.strip
    nu, d = strip.material.poisson, strip.mesh.dim()
    fields = [strip.basis.interpolate(u) for u in strip.nodal(state.full).T]
    area = np.asarray(strip.basis.dx) * strip.depth
    flat = np.eye(3)[list(strip.kinematics.components), :d]
    tangents = np.array([f.grad for f in fields]) + flat[:, :, None, None]
    strain = 0.5 * (np.einsum("ia...,ib...->ab...", tangents, tangents).T - np.eye(d)).T
    bends = np.array([f.hess for f in fields])
    unit = 2e11 * strip.thickness * (1.0 if d == 1 else 1.0 / (1.0 - nu**2))
    stiffness = 2e11 * strip.thickness**3 / 12.0 / (1.0 - nu**2)

    def density(parts: np.ndarray) -> np.ndarray:
        trace = np.einsum("...aaqp->...qp", parts)
        square = np.einsum("...abqp,...abqp->...qp", parts, parts)
        return 0.5 * (square if d == 1 else (1.0 - nu) * square + nu * trace**2)

    contact, touched = state.contact, state.contacts["r"]
    assert contact is not None
    reach, law = float(np.max(contact.reach)), contact.signorini
    near = touched.gap < reach
    gaps = touched.gap[near]

    def reaction(s: float) -> np.ndarray:
        return (law(gaps + s * (reach - gaps)) - law(np.array(reach))) * (reach - gaps)

    pressed = quad_vec(reaction, 0.0, 1.0, epsrel=1e-10)[0] @ touched.area[near]
    return {
        "membrane": float((unit * density(strain) * area).sum()),
        "bending": float((stiffness * density(bends).sum(axis=0) * area).sum()),
        "contact": float(pressed),
    }


def way(state: State) -> float:
    """Mean way of the exit along x (m)."""
    strip = state.plan.model.strip
    edge = strip.edges["exit"]
    return float(edge.load @ strip.nodal(state.full)[:, 0]) / edge.length


def works(state: State) -> np.ndarray:
    """Work (J) of the roller and of the pull along the step that ends in a state.

    ∫ F ds on its series, by polynomials through 25 states.
    """
    branch, width = state.branch, state.plan.model.strip.width
    assert branch is not None

    def fit(read: Callable[[State], float]) -> Chebyshev:
        return Chebyshev.interpolate(
            lambda many: [read(state.inside(a)) for a in many], 24, domain=[0.0, branch.length]
        )

    pairs = (
        (lambda s: s.contacts["r"].resultant[2], lambda s: s.controls["rollers.r.centre"][2]),
        (lambda s: s.controls["exit.force"][0] * width, way),
    )
    done = [(fit(force) * fit(place).deriv()).integ() for force, place in pairs]
    return np.array([work(branch.length) - work(0.0) for work in done])


@pytest.mark.parametrize(("kinematics", "cells"), [("section", (20, 1)), ("shell", (20, 2))])
def test_work_on_a_pressed_strip_is_stored_in_it(kinematics: str, cells: tuple[int, int]) -> None:
    """Nothing rubs: what roller and pull have done is in the membrane, bending and contact.

    The imbalance R of a series is at most the tolerance times the largest pull, so that its work
    ∫ R · du is at most that times the way of all nodes together.
    """
    changes = {"strip.kinematics": f'"{kinematics}"', "strip.cells": list(cells)}
    changes |= {"solver.tolerance": TOLERANCE}
    run = Scene.from_tables(PRESSED, "pressed.toml", [f"{k}={v}" for k, v in changes.items()]).run()
    states = [step.state for step in run]
    assert run.outcome.done
    *_, before = [s for s in states if s.plan.name == "pull"]
    pressed = [s for s in states if s.plan.name == "press"]
    begun, ended = energies(before), energies(pressed[-1])
    gained = np.array([ended[name] - begun[name] for name in begun])
    model = before.plan.model
    ways = np.diff([s.full / model.units for s in (before, *pressed)], axis=0)
    allowed = TOLERANCE * MORE * model.strip.width * np.linalg.norm(ways, axis=1).sum()
    assert gained.min() > 1e3 * allowed
    assert np.sum([works(s) for s in pressed]) == pytest.approx(gained.sum(), abs=allowed)
