"""The order of the series: what is typed, or what costs least."""

from typing import Any

import numpy as np
import pytest
from threaded import ONE, ended, scene_of

from anmstrip import Scene
from anmstrip.mechanics.contact import Contact
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


def tower(rollers: int) -> dict[str, Any]:
    """Rollers of 0.4 m in two rows, 15 m apart, that a section passes up and down."""
    rows = [
        {"radius": 0.4, "centre": (0.8 * i, 0.0, 15.0 * (i % 2)), "wrap": ("under", "over")[i % 2]}
        for i in range(rollers)
    ]
    ends = {"entry": (-0.4, 0.0, 7.5), "exit": (0.8 * rollers - 0.4, 0.0, 7.5)}
    return {
        "strip": {"width": 1.2, "thickness": 8e-4, "kinematics": "section"},
        "material": {"young": 1.6e11, "poisson": 0.3},
        "threading": {"tension": 1e4, **ends},
        "edges": {"entry": {"fixed": ("x", "z")}},
        "contact": {},
        "rollers": rows,
        "stages": [{"duration": 1.0}],
    }


def test_reading_a_state_takes_work_in_proportion_to_its_rollers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Contact points that are looked at, of ten and of forty rollers: no faster than n^1.1."""
    seen, counts = Contact.seen, list[int]()

    def counted(self: Contact, x: Any, controls: Any) -> Any:
        counts[-1] += x.shape[-1]
        return seen(self, x, controls)

    for rollers in (10, 40):
        step = next(iter(Scene(**tower(rollers)).run()))
        counts.append(0)
        monkeypatch.setattr(Contact, "seen", counted)
        assert len(step.state.rollers) == rollers
        assert step.state.gaps.min() < 0.0
        monkeypatch.setattr(Contact, "seen", seen)
    assert 0 < counts[1] < 4.0**1.1 * counts[0], counts


@pytest.mark.slow
@pytest.mark.parametrize("rollers", [20, 120])
def test_a_line_is_threaded_in_six_tangents_whatever_its_length(rollers: int) -> None:
    """The corrections of the guess, and what they leave as a path along the rollers."""
    run = Scene(**tower(rollers)).run()
    state = next(iter(run)).state
    assert run.cost.expansions <= 6
    tensions = [(reading.tension_in, reading.tension_out) for reading in state.rollers.values()]
    assert np.array(tensions) == pytest.approx(np.full((rollers, 2), 1e4), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("idle", [False, True])
def test_forty_equal_rollers_keep_one_tension_in_fifteen_tangents(idle: bool) -> None:
    """But for what lifts on; what sticks is strained by V/c − 1 = (T − 3 D/2R²)/E t.

    Idlers turn with it.
    """
    tables = tower(40)
    for i, each in enumerate(tables["rollers"]):
        each |= {"name": f"r{i}", "drive": "idle" if idle and i % 20 else "speed"}
    driven = [each["name"] for each in tables["rollers"] if each["drive"] == "speed"]
    turning = {name: {"surface_speed": 2.0} for name in driven}
    ends = {"entry": {"tension": 1e4}, "exit": {"tension": 1e4}}
    stage = {"name": "run", "steady": True, "rollers": turning, **ends}
    given = {"friction": {"coefficient": 0.3}, "solver": {"tolerance": 1e-4}, "stages": [stage]}
    run, state = ended(Scene(**(tables | given)))
    assert run.cost.expansions <= 15
    readings = state.rollers.values()
    tensions = [(reading.tension_in, reading.tension_out) for reading in readings]
    assert np.array(tensions) == pytest.approx(np.full((40, 2), 1e4), rel=1e-3)
    strip, speeds = run.assembly.strip, np.array([each.surface_speed for each in readings])
    strain = (1e4 - 1.5 * strip.bending_stiffness / 0.4**2) / strip.tensile_stiffness
    assert speeds / state.strip_speed - 1.0 == pytest.approx(np.full(40, strain), rel=2e-3)
