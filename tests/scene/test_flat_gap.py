"""The least gap between a roller and the flat strip, beside a dense sampling."""

from types import SimpleNamespace

import numpy as np
import pytest

from anmstrip.mechanics.roller import Roller
from anmstrip.simulation.problem import flat_gap

X, Y = np.linspace(-2.0, 2.0, 401), np.linspace(-0.5, 0.5, 101)
STRIP = SimpleNamespace(nodes=np.stack([*np.meshgrid(X, Y), np.zeros((101, 401))]).reshape(3, -1))


@pytest.mark.parametrize(
    ("centre", "axis"),
    [
        ((0.3, 0.0, -0.7), (0.0, 1.0, 0.0)),
        ((2.5, 0.0, -0.7), (0.0, 1.0, 0.0)),
        ((0.3, 0.0, -0.7), (0.0, 1.0, 0.2)),
        ((2.5, 0.4, 0.7), (0.3, 1.0, 0.2)),
        ((-1.0, 0.1, -0.7), (0.01, 0.02, 1.0)),
    ],
)
def test_least_gap(centre, axis):
    roller = Roller("r1", 0.5, centre, axis, ())
    away = STRIP.nodes.T - roller.centre
    across = away - np.outer(away @ roller.unit_axis, roller.unit_axis)
    sampled = np.linalg.norm(across, axis=1).min() - 0.5
    assert flat_gap(STRIP, roller) <= sampled + 1e-12
    assert flat_gap(STRIP, roller) == pytest.approx(sampled, abs=0.02)
