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


@pytest.mark.parametrize("speed", [1.0, 6.0])
def test_free_roller_that_is_lifted_against_running_strip_is_set_in_motion(speed: float) -> None:
    """Until friction on it exceeds the tolerance, only its own torque tells how fast it turns: by
    what the tolerance leaves it turned at hundreds of m/s, and the run took 3931 tangents."""
    pull, lift, gap, width, thickness = 8.0e3, 0.09, 0.03, 1.3, 0.8e-3
    scene = Scene.model_validate(
        {
            "strip": {"width": width, "thickness": thickness, "kinematics": "section"},
            "material": {"young": YOUNG, "poisson": 0.3},
            "contact": {},
            "friction": {"coefficient": 0.1},
            "rollers": [
                {
                    "name": "free", "radius": 0.12, "centre": [0.9, 0.0, -gap - 0.12],
                    "drive": "idle",
                },
                {
                    "name": "turn", "radius": 0.25, "centre": [2.2, 0.0, -0.25], "wrap": "over",
                    "drive": "idle",
                },
            ],
            "threading": {"tension": pull, "entry": [0.0, 0.0, 0.0], "exit": [3.4, 0.0, -1.1]},
            "edges": {"entry": {"fixed": ["x", "z"]}},
            "stages": [
                {"name": "run", "duration": 1.0, "entry": {"speed": speed}},
                {"name": "lift", "duration": 10.0, "rollers": {"free": {"move": [0.0, 0.0, lift]}}},
            ],
        }
    )  # fmt: skip
    run = Run(scene)
    found = [step.state.rollers["free"] for step in run]
    assert all(-0.01 * speed < each.surface_speed < 1.01 * speed for each in found)
    assert found[-1].surface_speed == pytest.approx(speed, rel=1e-3)
    turn = sum(np.arctan((lift - gap + 0.5 * thickness) / length) for length in (0.9, 1.3))
    force = 2.0 * pull * width * np.sin(0.5 * turn)
    assert found[-1].normal_force == pytest.approx(force, rel=0.01)
    assert run.cost.factorisations < 400
