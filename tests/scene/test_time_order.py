"""The highest order in time follows the tolerance."""

import pytest

from anmstrip.scene.stage_tables import SolverSpec


@pytest.mark.parametrize(
    ("given", "order"),
    [
        ({"tolerance": 1e-3}, 2),
        ({"tolerance": 1e-6}, 5),
        ({"tolerance": 1e-6, "time_step": 0.1}, 2),
        ({"tolerance": 1e-3, "time_order": 4}, 4),
    ],
)
def test_highest_time_order(given: dict[str, float], order: int) -> None:
    assert SolverSpec(**given).highest_time_order == order
