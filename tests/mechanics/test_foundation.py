"""A strip on an elastic foundation, beside the beam of Winkler and Hetényi."""

from __future__ import annotations

import numpy as np
import pytest

from anmstrip import Scene
from claims import Claim

YOUNG, POISSON, THICKNESS, STIFFNESS, LIFT = 2e11, 0.3, 5e-3, 2e4, 1e-3
BENDING = YOUNG * THICKNESS**3 / 12.0


@pytest.mark.parametrize("kinematics", ["section", "plate", "shell"])
def test_force_that_lifts_the_end(claim: Claim, kinematics: str) -> None:
    """F = k w/(2 λ) per width with λ⁴ = k/(4 D), for a strip longer than 4/λ (Hetényi 1946).

    Poisson's ratio is zero, so that a shell stays as cylindrical as a section.
    """
    scene = Scene(
        strip={
            "length": 4.0,
            "width": 1.0,
            "thickness": THICKNESS,
            "cells": [40, 1],
            "kinematics": kinematics,
            "foundation": STIFFNESS,
        },
        material={"young": YOUNG, "poisson": 0.0},
        edges={"entry": {"fixed": ["z"]}, "exit": {"fixed": ["x", "y"]}}
        if kinematics == "shell"
        else {"entry": {"fixed": ["z"]}}
        if kinematics == "plate"
        else {"entry": {"fixed": ["z"]}, "exit": {"fixed": ["x"]}},
        stages=[{"duration": 1.0, "entry": {"move": [0.0, 0.0, LIFT]}}],
        solver={"tolerance": 1e-8},
    )
    run = scene.run()
    *_, last = run
    assert run.outcome.done
    wave = (STIFFNESS / (4.0 * BENDING)) ** 0.25
    force = last.state.edge_force("entry")[2]
    expected = STIFFNESS * LIFT / (2.0 * wave)
    claim(
        f"force at the lifted edge on a foundation, {kinematics} (N)",
        force,
        expected,
        2e-3,
        "Hetényi (1946)",
    )


def test_foundation_costs_nothing_where_there_is_none() -> None:
    scene = Scene(
        strip={"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [8, 1]},
        material={"young": YOUNG, "poisson": POISSON},
        stages=[{"duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}}],
    )
    run = scene.run()
    assert list(run)
    assert "foundation" not in run.effects
    assert np.isfinite(run.march.full).all()
