"""Rollers that are moved under a standing line, by statics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from field_statics import Circle, bent_belt

TENSION, YOUNG, THICKNESS, FRICTION = 174.0, 2.1e11, 1.68e-4, 0.24
FAR = 1e6
MOVE = [-0.01, 0.0, 0.018]


def line(move: Any = MOVE, **solver: Any) -> Scene:
    """Foil over two rollers, the first of which is moved so that the way becomes shorter."""
    return Scene.model_validate(
        {
            "strip": {"width": 1.0, "thickness": THICKNESS, "kinematics": "section"},
            "material": {"young": YOUNG, "poisson": 0.3},
            "contact": {},
            "friction": {"coefficient": FRICTION},
            "rollers": [
                {"name": "r1", "radius": 0.096, "centre": [1.362, 0.0, -0.096], "wrap": "over"},
                {"name": "r2", "radius": 0.212, "centre": [0.66, 0.0, -0.875], "wrap": "over"},
            ],
            "threading": {
                "tension": TENSION, "entry": [0.0, 0.0, 0.0], "exit": [-1.228, 0.0, -1.296],
            },
            "edges": {"entry": {"fixed": ["x", "z"]}},
            "stages": [
                {"name": "move", "duration": 0.26, "rollers": {"r1": {"move": move}}},
                {"name": "rest", "duration": 0.26},
            ],
            "solver": solver,
        }
    )  # fmt: skip


def held() -> float:
    """Tension at the entry while the strip slips over both rollers towards the exit."""
    bending = YOUNG * THICKNESS**3 / 12.0 / (1.0 - 0.3**2)
    circles = [Circle(1.362 - 0.096j, 0.096, 1), Circle(0.66 - 0.875j, 0.212, 1)]
    onward = np.exp(1j * bent_belt(0j, circles, -1.228 - 1.296j, TENSION, bending).headings[-1])
    circles[0] = Circle(1.352 - 0.078j, 0.096, 1)
    turns = bent_belt(0j, circles, -1.228 - 1.296j + FAR * onward, 0.7 * TENSION, bending).turns
    return TENSION * float(np.exp(-FRICTION * sum(turns)))


def test_roller_that_stops_leaves_the_strip_as_it_is() -> None:
    """As it stops, slip on it ends: taken for slip at the speed with which the roller had moved
    the strip, friction turns round, and the entry bears 237 N/m instead of 85."""
    ends = {step.stage: step.state for step in Run(line(time_step=0.013))}
    assert ends["move"].tension("entry") == pytest.approx(held(), abs=0.02 * TENSION)
    assert ends["rest"].tension("entry") == pytest.approx(held(), abs=0.02 * TENSION)


def test_roller_that_begins_to_move_takes_along_strip_that_sticks_no_faster_than_it_moves() -> None:
    """The tension at the entry changes with the move, evenly; it changed at once by that of all."""
    steps = [step for step in Run(line([-1e-6, 0.0, 0.0], tolerance=1e-4)) if step.stage == "move"]
    times = np.array([step.state.time for step in steps])
    changes = np.array([step.state.tension("entry") for step in steps]) - TENSION
    assert times[0] < 1.0 + 0.05 * 0.26
    np.testing.assert_allclose(changes / changes[-1], (times - 1.0) / 0.26, atol=0.03)
    assert abs(changes[-1]) > 1.0
