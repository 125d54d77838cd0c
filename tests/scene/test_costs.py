"""The order of the series: what is typed, or what costs least."""

import pytest
from threaded import ONE, scene_of

from anmstrip.simulation.problem import Assembly, Size, cheapest_order

SMALL, LARGE = Size(200, 200, 500, 20), Size(40_000, 80_000, 400_000, 500)


@pytest.mark.parametrize("size", [SMALL, LARGE])
def test_tighter_tolerances_want_higher_orders(size: Size) -> None:
    """About 13, 20 and 27 for 1e-3, 1e-6 and 1e-10."""
    orders = [cheapest_order(size, tolerance) for tolerance in (1e-3, 1e-6, 1e-10)]
    assert orders == pytest.approx([13, 20, 28], abs=3)


def test_cost_grows_with_everything() -> None:
    costs = [SMALL.seconds(20), SMALL.seconds(30), LARGE.seconds(20), LARGE.seconds(30)]
    assert costs == sorted(costs)


def test_a_scene_may_fix_the_order() -> None:
    assert Assembly(scene_of({**ONE, "solver": {"tolerance": 1e-3}})).order < 20
    assert Assembly(scene_of({**ONE, "solver": {"order": 33}})).order == 33
