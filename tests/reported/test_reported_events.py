"""Dates, places and kinds of what happens, against states written at these dates."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import reported_scenes as scenes
from reported_files import Results, Surface, ran
from reported_rollers import Law, Look
from reported_states import looks_at

from anmstrip.driver.explain import report
from anmstrip.driver.scene import Scene

LEVELS = {"turning": 1.0e-4 * np.log(2.0e4 / (0.1 * float(np.hypot(1e4, 5773.5)) / 0.5))}
"""Gap at which the pressure p0 exp(-h/w) is a tenth of T/r (m)."""

P = 0.1 * 1.0e4 / 0.5
LEVELS["lifted"] = 10.0 * 1.0e-3 / P - P / 1.0e10
"""The same of the penalty, h = η δ/R − R/K."""


def points_of(surface: Surface) -> dict[float, tuple[int, int, int]]:
    """Places of the contact points on the flat strip → patch and point, of a section."""
    x = surface.at_contact(surface.reference)[..., 0]
    return {round(float(x[n, 1, i]), 6): (n, 1, i) for n in range(len(x)) for i in range(3)}


@pytest.fixture(scope="module", params=["turning", "lifted"])
def dated(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Results, dict[float, dict[str, Look]]]:
    """A run with events, and the rollers beside the states at their dates."""
    results: Results = request.getfixturevalue(request.param)
    times = sorted({float(event["time"]) for event in results.events})
    directory: Path = tmp_path_factory.mktemp("dated") / results.name
    directory.mkdir()
    text = getattr(scenes, results.name.upper())
    again = ran(text, directory, f"output.times={times}", options=("--quiet",))
    assert [time for time, _ in again.states] == times
    return results, {s.time: looks_at(again, s) for s in again.surfaces}


def at_points(results: Results) -> list[dict[str, str]]:
    return [event for event in results.events if event["point"]]


def slips(look: Look) -> np.ndarray:
    """Slip speeds by the velocities that were written, also where nothing rubs yet."""
    return np.asarray(np.linalg.norm(look.slip, axis=-1))


def test_gaps_and_slips_are_those_of_the_states(
    dated: tuple[Results, dict[float, dict[str, Look]]],
) -> None:
    """The state on the way at its date is the one that was searched, along a path to all digits.

    In time it is solved for, while a search takes positions to be on the polynomial of the formula
    and the velocity to change linearly from the one before; at the end of a step both are the
    same, inside they differ by the error of the step.
    """
    results, states = dated
    looks = states[float(results.events[0]["time"])]
    assert len(at_points(results)) >= 4
    for event in at_points(results):
        look = states[float(event["time"])][event["roller"]]
        point = points_of(look.surface)[round(float(event["x"]), 6)]
        exact = 5e-3 * LEVELS["turning"] if results.name == "turning" else 1e-11
        assert look.gap[point] == pytest.approx(float(event["gap"]), abs=exact)
        assert float(event["y"]) == 0.0
        if event["slip"]:
            rubbed = slips(look)[point]
            assert rubbed == pytest.approx(float(event["slip"]), rel=0.2, abs=0.01)
    assert set(looks) == {event["roller"] for event in results.events}


def test_contact_is_a_tenth_of_the_pressure(
    dated: tuple[Results, dict[float, dict[str, Look]]],
) -> None:
    results, _ = dated
    for event in at_points(results):
        if event["kind"] in ("contact made", "contact lost"):
            assert float(event["gap"]) == pytest.approx(LEVELS[results.name], rel=1e-9)


def test_slip_and_cone_are_speeds_of_the_law(turning: Results) -> None:
    """Slip: 1 − |R_T|/(f R_N) = |v|/V_c; cone: |R_T| = f R_N; by bisection of the law."""
    law = Law(1.0, exponent=0.05, omega=0.1, speed=0.1)
    corner = bisected(lambda v: float(law.share(np.array(v))) + v / 0.1 - 1.0)
    cone = bisected(lambda v: float(law.share(np.array(v))) - 1.0)
    found = {kind: [] for kind in ("stick", "slip", "cone left", "cone regained")}
    for event in at_points(turning):
        if event["kind"] in found:
            found[event["kind"]].append(float(event["slip"]))
    assert len(found["slip"]) >= 5
    assert len(found["cone left"]) >= 5
    assert [*found["slip"], *found["stick"]] == pytest.approx(
        [corner] * (len(found["slip"]) + len(found["stick"])), rel=1e-6
    )
    assert found["cone left"] == pytest.approx([cone] * len(found["cone left"]), rel=1e-6)


def bisected(excess: object) -> float:
    low, high = 1e-6, 1.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)  # type: ignore[operator]
    return low


@pytest.mark.parametrize("name", ["turning", "lifted"])
def test_every_point_changes_in_turn(name: str, request: pytest.FixtureRequest) -> None:
    """Made and lost, stick and slip, one after the other, point by point; dates in order."""
    results: Results = request.getfixturevalue(name)
    times = [float(event["time"]) for event in results.events]
    assert times == sorted(times)
    for pair in (("contact made", "contact lost"), ("stick", "slip")):
        for point in {event["point"] for event in at_points(results)}:
            kinds = [
                e["kind"] for e in at_points(results) if e["point"] == point and e["kind"] in pair
            ]
            assert all(a != b for a, b in pairwise(kinds))


def test_points_on_both_sides_of_a_date(turning: Results) -> None:
    """In the state before a date a point does not touch or slip yet, in the one after it does."""
    names = {round(t, 12): s for t, s in ((s.time, s) for s in turning.surfaces)}
    times = np.array(sorted(names))
    checked = 0
    for event in at_points(turning):
        if event["kind"] not in ("contact made", "contact lost", "cone left"):
            continue
        after = int(np.searchsorted(times, float(event["time"])))
        before, behind = (names[times[k]] for k in (after - 1, after))
        sides = [looks_at(turning, s)["r1"] for s in (before, behind)]
        point = points_of(before)[round(float(event["x"]), 6)]
        if event["kind"] == "cone left":
            values = [slips(look)[point] - float(event["slip"]) for look in sides]
        else:
            values = [look.gap[point] - LEVELS["turning"] for look in sides]
        rising = event["kind"] != "contact made"
        assert bool(values[0] < values[1]) is rising, event
        assert values[0] * values[1] <= 0.0, event
        checked += 1
    assert checked >= 15


def test_a_roller_as_a_whole(turning: Results, lifted: Results) -> None:
    """First contact and last; slip when the last of its points slips."""
    for results in (turning, lifted):
        whole = [event for event in results.events if not event["point"]]
        points = at_points(results)
        first = next(e for e in points if e["kind"] == "contact made")
        assert (whole[0]["kind"], whole[0]["time"]) == ("contact made", first["time"])
        for event in whole:
            assert all(event[key] == "" for key in ("point", "x", "y", "gap", "slip"))
    assert whole[-1]["kind"] == "contact lost"
    assert whole[-1]["time"] == points[-1]["time"]
    slip = [e for e in turning.events if not e["point"] and e["kind"] == "slip"][-1]
    slipped = [e for e in at_points(turning) if e["kind"] == "slip"]
    assert slip["time"] == slipped[-1]["time"]


def test_stages_and_numbers_of_points(turning: Results, lifted: Results) -> None:
    """Points are numbered along the strip, two to an element; stages are those of the dates."""
    for results, ends in (
        (turning, {"pull": 2.0, "wrap": 2.5, "turn": 2.9}),
        (lifted, {"pull": 1.0, "up": 2.0, "down": 3.0}),
    ):
        starts = dict(zip(ends, [0.0, *ends.values()], strict=False))
        places = sorted(points_of(results.last))
        for event in results.events:
            time = float(event["time"])
            assert starts[event["stage"]] <= time <= ends[event["stage"]]
        for event in at_points(results):
            near = int(np.abs(np.array(places) - float(event["x"])).argmin())
            assert int(event["point"]) == near


def test_a_roller_touches_when_it_reaches_the_strip(lifted: Results) -> None:
    """It rises at 0.1 m/s through the plane at 20 mm, and the way down is that up.

    A tenth of T/r on the middle node, which has a sixth of both its elements, lifts the strip
    by F L/(4 T) first: 1.6 mm, bent over √(D/T) instead of kinked 0.07 mm less.
    """
    up, *_, down = [float(e["time"]) for e in lifted.events if not e["point"]]
    force = P * 2.0 / 6.0 * lifted.last.sizes[0].min()
    assert up == pytest.approx(1.2 + force * 2.0 / (4.0 * 1.0e4) / 0.1, abs=1e-3)
    assert up + down == pytest.approx(4.0, abs=2e-5)


def test_slip_of_a_bridle_is_dated_by_statics() -> None:
    """The exit pulls ever more than 4 kN/m; the rollers let go in turn, the last one first.

    Then friction has used up what it holds on all wraps behind, T = 4 kN/m exp(f θ).  Steps of
    half a second lie between; a date is known to the tolerance of the stage.
    """
    roller = {"radius": 0.3, "drive": "speed"}
    places = {"b1": (0.0, 0.0, "left"), "b2": (0.8, -0.9, "right"), "b3": (1.6, 0.0, "left")}
    begin, lasting, force, most = 3.0, 3.0, 4e3, 20e3
    line = Scene(
        strip={"kinematics": "section", "width": 1.0, "thickness": 8e-4},
        material={"young": 2e11, "poisson": 0.3},
        contact={},
        friction={"coefficient": 0.2},
        threading={"tension": force, "entry": (-1.5, 0.0, 0.3), "exit": (3.5, 0.0, 0.3)},
        rollers=[
            {**roller, "name": name, "centre": (x, 0.0, z), "wrap": side}
            for name, (x, z, side) in places.items()
        ],
        edges={"entry": {"fixed": ["x", "z"]}},
        stages=[
            {"name": "start", "duration": 2.0, "entry": {"release": True},
             "rollers": {name: {"surface_speed": 1.0} for name in places}},
            {"name": "pull", "duration": lasting, "exit": {"tension": most}},
        ],
        solver={"tolerance": 1e-2},
        output={"events": True},
    )  # fmt: skip
    run = line.run()
    steps = list(run)  # it runs away as the first one slips as well
    found = [e for step in steps for e in step.events if e.point is None and e.kind == "slip"]
    assert [event.roller for event in found] == ["b3", "b2", "b1"]
    span = np.array([0.8, 0.9])
    turn = np.arctan2(*span[::-1]) + np.arcsin(2.0 * 0.3 / np.hypot(*span))
    wraps = turn * np.array([1.0, 3.0, 4.0])  # behind each; the middle one turns it back as well
    expected = begin + lasting * force * (np.exp(0.2 * wraps) - 1.0) / (most - force)
    assert [event.time for event in found] == pytest.approx(list(expected), abs=0.06)
    assert all(event.step <= 1e-2 * lasting * (1.0 + 1e-9) for event in found)
    assert "The strip slides over all driven rollers that it touches." in report(run)
