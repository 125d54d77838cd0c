"""Fresh strip for what has left: exact labels, and the same answers as a long mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.fem.geometry import SECTION, SHELL
from anmstrip.fem.strip import Material, Strip, grid, line
from anmstrip.simulation.feed import Feed

H = 0.05
STEEL = Material(2e11, 0.3, 7850.0)
XS = np.linspace(-0.4, 0.4, 17)


def strip_of(kinematics: Any) -> Strip:
    mesh = line(XS) if kinematics is SECTION else grid(XS, np.linspace(-0.2, 0.2, 4))
    return Strip(mesh, 1e-3, STEEL, kinematics, width=0.4)


def field(strip: Strip, rng: np.random.Generator) -> np.ndarray:
    return rng.standard_normal(strip.unknowns)


@pytest.mark.parametrize("kinematics", [SECTION, SHELL], ids=["section", "shell"])
@pytest.mark.parametrize("elements", [1, 3, -2])
def test_what_stays_is_the_same_to_the_last_digits(kinematics: Any, elements: int) -> None:
    strip = strip_of(kinematics)
    feed = Feed(strip)
    full = field(strip, np.random.default_rng(3))
    place = full.reshape(-1, strip.count) + feed.flat
    moved = feed.moved(full, elements).reshape(-1, strip.count) + feed.flat
    count = len(XS)
    for column in range(max(0, elements), min(count, count + elements)):
        found, expected = moved[feed.columns[column]], place[feed.columns[column - elements]]
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-15 * 8)


@pytest.mark.parametrize("kinematics", [SECTION, SHELL], ids=["section", "shell"])
@pytest.mark.parametrize("elements", [2, -2])
def test_a_straight_strip_goes_on_as_it_is(kinematics: Any, elements: int) -> None:
    """Turned and stretched, the fresh columns continue it: r = c + F (X, Y)."""
    strip = strip_of(kinematics)
    feed = Feed(strip)
    tangents = np.array([[0.8, 0.1, -0.6], [0.0, 1.0, 0.2]])
    position = np.zeros((strip.scalars, 3))
    position[strip.node_values] = [1.0, 2.0, 3.0] + strip.mesh.p.T @ tangents[: strip.mesh.dim()]
    for name, tangent in zip(("u_x", "u_y")[: strip.mesh.dim()], tangents, strict=False):
        position[strip.dofs(name)] = tangent
    full = (strip.kinematics.pick(position) - feed.flat).ravel()
    moved = feed.moved(full, elements).reshape(-1, strip.count) + feed.flat
    expected = position.copy()
    expected[strip.node_values] -= elements * H * tangents[0]
    np.testing.assert_allclose(moved, strip.kinematics.pick(expected), atol=1e-14)


def tables(cells: int, feed: bool, **strip: Any) -> dict[str, Any]:
    """A strip over one roller, which then carries it.

    A surface does not contract across: the bow of its edges would die out along the strip
    only by 1e-8 up to the ends, which are elsewhere on a long mesh.
    """
    poisson = 0.0 if strip else 0.3
    return {
        "strip": {
            "kinematics": "section", "length": cells * H, "width": 0.4, "thickness": 1e-3,
            "cells": [cells, 2], "refined": H, "feed": feed, **strip,
        },
        "material": {"young": 2e11, "poisson": poisson, "density": 7850.0},
        "contact": {"stiffness": 1e9, "eta": 100.0, "delta": 1e-2},
        "friction": {"coefficient": 0.3, "speed": 1e-3},
        "threading": {"tension": 1e4, "entry": [-2.0, 0.0, -0.9]},
        "rollers": [{"name": "r1", "radius": 0.3, "centre": [0.0, 0.0, -0.3], "wrap": "over"}],
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
        "stages": [
            {"name": "hold", "duration": 0.1, "entry": {"release": True}},
            {"name": "start", "duration": 0.1, "rollers": {"r1": {"surface_speed": 1.0}}},
            {"name": "convey", "duration": 0.12},
        ],
        "solver": {"tolerance": 1e-6, "time_step": 2e-3},
    }  # fmt: skip


def done(run: Run) -> Run:
    for _ in run:
        pass
    assert run.outcome.done, run.message
    return run


def begun(cells: int, feed: bool, held: Run, more: int, **strip: Any) -> Run:
    """A run that starts from a held strip, with more elements behind its entry."""
    run = Run(Scene.model_validate(tables(cells + more, feed, **strip)))
    for stage in run.scene.course[:2]:
        run.march.course.plan(stage, {})
        run.march.course.finish(stage)
    run.march.course.released, run.march.course.values = {"entry"}, dict(held.march.course.values)
    run.first_stage = 2
    longer, shorter = Feed(run.assembly.strip), Feed(held.assembly.strip)
    old = held.march.full.reshape(-1, held.assembly.strip.count) + shorter.flat
    new = np.zeros_like(longer.flat)
    for column in range(cells + more + 1):
        source = max(column - more, 0)
        back = (column - more - source) * H
        new[longer.columns[column]] = shorter._continued(old[shorter.columns[source]], back)
    run.march.full = (new - longer.flat).ravel()
    return run


def places(run: Run) -> np.ndarray:
    """Positions and slopes by column."""
    feed = Feed(run.assembly.strip)
    return (run.march.full.reshape(-1, run.assembly.strip.count) + feed.flat)[feed.columns]


@pytest.mark.parametrize(
    "strip",
    [
        {},
        pytest.param({"kinematics": "shell"}, marks=pytest.mark.slow),
    ],
    ids=["section", "shell"],
)
def test_a_fed_strip_moves_like_a_long_one(strip: dict[str, Any]) -> None:
    """Three elements are fed in; the strip that was longer from the start does the same."""
    cells, more = 80, 4
    first = tables(cells, feed=False, **strip)
    first["stages"] = first["stages"][:1]
    held = done(Run(Scene.model_validate(first)))
    fed = done(begun(cells, True, held, 0, **strip))
    long = done(begun(cells, False, held, more, **strip))
    assert fed.march.feed is not None and fed.march.feed.elements == 3
    behind = more - fed.march.feed.elements
    difference = places(fed) - places(long)[behind : behind + cells + 1]
    assert np.abs(difference[:, 0]).max() < 1e-8  # positions (m)
    assert np.abs(difference[:, 1]).max() * H < 1e-8  # slopes along, over an element (m)
    for name in ("entry", "exit"):
        fed_tension, long_tension = (r.state.tension(name) for r in (fed, long))
        assert fed_tension == pytest.approx(long_tension, rel=1e-8)


def test_strip_in_is_strip_out() -> None:
    """By mass, to the strain that is stored in between."""
    scene = tables(60, feed=True)
    scene["solver"] = {"tolerance": 1e-3}
    run = done(Run(Scene.model_validate(scene)))
    facts = run.facts()["feed"]
    assert facts["elements"] >= 2
    assert facts["exit_travel"] == pytest.approx(0.17, rel=1e-2)
    stored = 7850.0 * 1e-3 * 0.4 * 3.0 * (1e4 / 2e8)  # of a strip of 3 m at this strain
    assert abs(facts["mass_in"] - facts["mass_out"]) < stored
    assert facts["mass_in"] == pytest.approx(7850.0 * 1e-3 * 0.4 * facts["entry_travel"])


def test_steps_begin_in_their_own_labels() -> None:
    """After fresh strip has come in no point seems to have moved by an element."""
    run = Run(Scene.model_validate({**tables(60, True), "output": {"events": True}}))
    moved: list[float] = []
    assert run.watch is not None
    strip, found = run.assembly.strip, run.watch.during

    def recorded(before: Any, state: Any) -> Any:
        change = (state.full - before.full).reshape(-1, strip.count)[strip.node_values]
        moved.append(float(np.abs(change).max()))
        return found(before, state)

    run.watch.during = recorded  # type: ignore[method-assign]
    for _ in run:
        pass
    assert run.outcome.done, run.message
    assert run.march.feed is not None
    assert run.march.feed.elements > 1
    in_time = moved[-run.stages[run.scene.course[-1].name]["steps"] :]
    assert max(in_time) < 0.5 * H
