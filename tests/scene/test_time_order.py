"""The highest order in time follows the tolerance."""

import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.scene.tables import SolverSpec
from strips import capstan


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


@pytest.mark.parametrize("omega", [1e-2, 1e-4])
def test_a_step_in_which_slip_turns_round_is_not_taken_for_one_that_slips_on(omega: float) -> None:
    """The roller slows down, stops, and has turned back by 0.03 mm, a sixth of a step before.

    Taken in one step the strip has slipped back altogether, and the ratio is 15 % too small.
    """
    ratios = []
    for tolerance in (1e-3, 1e-5):
        tables = capstan("section", 1, 0.1, tolerance).to_dict()
        tables["friction"]["omega"] = omega
        tables["stages"][1]["rollers"] = {"r1": {"surface_speed": 1.0}}
        tables["stages"][2]["rollers"] = {"r1": {"surface_speed": -0.01}}
        run = Run(Scene.model_validate(tables))
        for _ in run:
            pass
        assert run.outcome.done
        assert run.state is not None
        ratios.append(run.state.rollers["r1"].tension_ratio)
    assert ratios[0] == pytest.approx(ratios[1], rel=5e-3)
