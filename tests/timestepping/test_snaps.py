"""Drag that is added where no velocity balances the forces."""

from __future__ import annotations

import numpy as np
import pytest

from anmstrip.mechanics.laws import Tanh
from anmstrip.timestepping.index_one import FunctionRateEquations
from hard_nodes import Slider
from motions import moved


def test_drag_is_as_large_as_friction_at_a_speed_of_one_in_its_time() -> None:
    slider = Slider(Tanh(0.3, 1e-3, 1.0), stiffness=1.0)
    equations = FunctionRateEquations(slider.residual, 10.0)
    dragged = equations.dragged(0.0, np.zeros(1), np.array([0.1]), time=1e-3)
    assert dragged is not None
    for v in (np.array([2e3]), np.array([-5.0])):
        left = dragged.function(np.zeros(1), v, 0.0) - slider.residual(np.zeros(1), v, 0.0)
        assert left == pytest.approx(-0.3e-3 * v)
    assert equations.dragged(0.0, np.zeros(1), np.zeros(1), time=1e-3) is None


def test_what_never_rests_is_no_snap() -> None:
    """Pulled beyond the cone with no spring to hold it: the drag only makes it glide away.

    How it is told is up to the last digit: near the end the tanh is flat to round-off.
    """
    slider = Slider(Tanh(0.3, 1e-3, 1.0), load=(0.0, 0.6))
    motion = moved(slider.residual, np.zeros(1), (0.0, 1.0), speed=1.0)
    assert motion.outcome.startswith(("steps became too short", "the tangent is singular"))
    assert 0.4 < motion.steps[-1].end < 0.5 + 1e-6
    assert not any(step.snap for step in motion.steps)
