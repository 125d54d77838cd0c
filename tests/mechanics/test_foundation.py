"""A strip on an elastic foundation, beside the beam of Winkler and Hetényi."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from anmstrip import Scene
from anmstrip.advice.preview import Preview
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


LOADS = {"entry": {"move": [0.0, 0.0, LIFT]}}, {"pressure": STIFFNESS * LIFT}


@pytest.mark.parametrize("load", LOADS)
def test_thin_strip_is_meshed_and_previewed_by_its_foundation(load: dict[str, Any]) -> None:
    """It bends over (4 D/k)^(1/4) = 0.14 m; elements were 0.2 m, and a slope of 57° was told.

    The end sinks or is lifted by 1 mm, and turns by that over this length.
    """
    scene = Scene(
        strip={
            **{"length": 4.0, "width": 1.0, "thickness": 5e-4, "kinematics": "section"},
            "foundation": STIFFNESS,
        },
        material={"young": YOUNG, "poisson": 0.0},
        edges={"entry": {"fixed": ["z"]}, "exit": {"fixed": ["x"]}},
        stages=[{"duration": 1.0, **load}],
        solver={"tolerance": 1e-8},
    )
    run = scene.run()
    *_, last = run
    length = (4.0 * 1e-3 * BENDING / STIFFNESS) ** 0.25
    force = STIFFNESS * LIFT * length / 2.0
    assert abs(last.state.edge_force("entry")[2]) == pytest.approx(force, rel=1e-3)
    (estimate,) = Preview.of(run.assembly).strings
    begin, end = run.assembly.strip.span
    slopes = last.state.slope(np.linspace(begin, end, 400))[:, 2]
    assert np.abs(slopes).max() == pytest.approx(LIFT / length, rel=1e-3)
    assert estimate.slope == pytest.approx(LIFT / length, rel=1e-3)


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
