"""The leveller of the examples, against fibres that are returned to the yield surface."""

from pathlib import Path

import numpy as np
import pytest

from anmstrip import Scene
from anmstrip.results.plastic import YieldedStrip

SCENE = Path(__file__).parents[2] / "examples" / "leveller.toml"
YOUNG, POISSON, THICKNESS = 2e11, 0.3, 1e-3
PLANE, LIMIT = YOUNG / (1.0 - POISSON**2), 2.0 / np.sqrt(3.0) * 3e8


@pytest.fixture(scope="module")
def levelled():
    """The run at its end, and its layers."""
    run = Scene.load(SCENE).run()
    *_, last = run
    return run, last.state, YieldedStrip.of(last.state)


def returned_moments(curvature, force, fibres=400):
    """M (N) of perfectly plastic fibres under a history of curvature (1/m) and force (N/m)."""
    height = ((np.arange(fibres) + 0.5) / fibres - 0.5) * THICKNESS
    plastic, middle, moments = np.zeros(fibres), 0.0, []
    for bent, pull in zip(curvature, force, strict=True):
        for _ in range(100):
            trial = PLANE * (middle + height * bent - plastic)
            stress = np.clip(trial, -LIMIT, LIMIT)
            slope = PLANE * (np.abs(trial) < LIMIT).mean()
            change = (pull / THICKNESS - stress.mean()) / slope
            middle += change
            if abs(change) < 1e-12:
                break
        plastic += (trial - stress) / PLANE
        moments.append((stress * height).mean() * THICKNESS)
    return np.array(moments)


@pytest.mark.slow
def test_curl_on_and_behind_every_roller(levelled, claim):
    """To 2 % of the largest, on the same history of curvatures and forces: n is 51, rates vary."""
    *_, layers = levelled
    along = np.argsort(layers.x)
    curvature, force, left = (
        values[0, along] for values in (layers.curvature, layers.force, layers.residual_curvature)
    )
    exact = curvature - returned_moments(curvature, force) / (PLANE * THICKNESS**3 / 12.0)
    found = layers.rollers()
    x, free = layers.x[along], layers.free_strip()
    places = [np.abs(left - b.curl_on_roller).argmin() for b in found.values()]
    on_roller = np.array([exact[p] - left[p] for p in places])
    behind = [np.interp(np.linspace(*free[n]), x, exact).mean() - b.curl for n, b in found.items()]
    largest = np.abs([b.curl_on_roller for b in found.values()]).max()
    source = "perfectly plastic fibres, returned"
    for where, errors in (("on", on_roller), ("behind", np.array(behind))):
        for name, error in zip(found, errors / largest, strict=True):
            told = f"curl {where} {name} of `leveller.toml`, its error over the largest"
            claim(told, error, 0.0, 0.02, source)
    assert exact[-1] == pytest.approx(left[-1], abs=0.01 * largest)


@pytest.mark.slow
def test_work_and_power(levelled):
    """Fewer than 60 tangents; flow takes what tension does less what friction takes."""
    run, state, layers = levelled
    assert run.stages["level"]["tangents"] <= 60
    flow = sum(bend.yield_power for bend in layers.rollers().values())
    strip = state.plan.model.strip
    pulled = 0.0
    for name, sign in (("exit", 1.0), ("entry", -1.0)):
        place = strip.count * strip.edges[name].values[0] + np.arange(2)
        pulled += sign * state.tension(name) * np.linalg.norm(state.velocity[place]) * strip.width
    rubbed = 0.0
    for name, contact in state.contacts.items():
        force = state.rollers[name].torque / contact.roller.radius  # on strip that moves at c
        rubbed += force * contact.surface_speed + (
            (contact.traction * contact.slip).sum(0) @ contact.area
        )
    assert flow == pytest.approx(pulled + rubbed, rel=0.08)


@pytest.mark.slow
def test_what_the_head_of_the_scene_promises(levelled):
    _, state, layers = levelled
    bends = layers.rollers()
    curvatures = [abs(bends[f"r{i}"].curvature) for i in range(2, 9)]
    assert curvatures == pytest.approx([6.5, 9.9, 9.8, 8.5, 7.0, 5.4, 2.9], rel=0.03)
    assert all(0.6 < bends[f"r{i}"].plastic_share < 0.78 for i in range(3, 7))
    last = layers.residual_curvature[0, layers.x.argmax()]
    assert last == pytest.approx(0.45, rel=0.05)
    assert bends["r9"].elongation == pytest.approx(9.3e-4, rel=0.05)
    assert sum(b.yield_power for b in bends.values()) == pytest.approx(2960.0, rel=0.03)
    assert state.tension("entry") == pytest.approx(4.87e4, rel=0.01)


def small_leveller(stages):
    """Strip over five rollers, of which three bend it beyond yield and all turn 3 % too slowly."""
    heights = {"r1": -0.02, "r2": 0.018, "r3": -0.0183, "r4": 0.0186, "r5": -0.02}
    rollers = [
        {
            "name": name, "radius": 0.02, "centre": [0.05 * i, 0.0, z],
            "wrap": "under" if z > 0.0 else "over",
        }
        for i, (name, z) in enumerate(heights.items())
    ]  # fmt: skip
    turning = {name: {"surface_speed": 0.97} for name in heights}
    flow = {"exponent": 21, "reference_rate": 0.3, "layers": 11}
    tables = {
        "strip": {
            "kinematics": "section", "width": 1.0, "thickness": THICKNESS,
            "bending": "kirchhoff-love", "refined": 2e-3, "cells": [275, 1],
        },
        "material": {"young": YOUNG, "poisson": POISSON, "yield_stress": 3e8, "plasticity": flow},
        "contact": {},
        "friction": {"coefficient": 0.1},
        "rollers": rollers,
        "threading": {"tension": 6e4, "entry": [-0.25, 0.0, 0.0], "exit": [0.3, 0.0, 0.0]},
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [stages[0] | {"rollers": turning}, *stages[1:]],
        "solver": {"tolerance": 1e-3, "max_tangents": 1500},
    }  # fmt: skip
    return Scene.from_tables(tables, "leveller.toml").run()


def curls(state):
    """Mean curl (1/m) of the strip behind each of the last four rollers, and T (N/m) before all."""
    layers, contacts = YieldedStrip.of(state), state.contacts
    begin, weights = layers.strip.mesh.p[0].min(), layers.strip.weights().ravel()
    middles = [contacts[f"r{i}"].middle - begin for i in range(2, 6)]
    spans = zip(middles, [*middles[1:], middles[-1] + 0.05], strict=True)
    free = [(layers.x > a + 0.012) & (layers.x < b - 0.012) for a, b in spans]
    left = [np.average(layers.residual_curvature[0, on], weights=weights[on]) for on in free]
    return [*left, state.tension("entry")]


@pytest.mark.slow
def test_a_march_in_time_leaves_the_curls_of_the_stationary_state(claim):
    """Once strip that yielded before the march began has left; nodes that pass make it ripple."""
    *_, steady = small_leveller([{"steady": True, "strip": {"speed": 1.0}}])
    pulled = {"entry": {"velocity": [1.0, 0.0, 0.0]}, "exit": {"tension": 6e4}}
    run = small_leveller([{"duration": 0.005, **pulled}, {"name": "on", "duration": 0.155}])
    times, found = zip(*((step.time, curls(step.state)) for step in run), strict=True)
    last = np.array(times) > times[-1] - 0.08  # in 10 mm that behind r5 is -1.34 to -1.00
    times, found = np.array(times)[last], np.array(found)[last]
    *marched, tension = np.trapezoid(found, times, axis=0) / (times[-1] - times[0])
    *conveyed, pull = curls(steady.state)
    for i, (left, expected) in enumerate(zip(marched, conveyed, strict=True), 2):
        told = f"curl behind r{i} of a leveller of five rollers that is marched in time (1/m)"
        claim(told, left, expected, 0.02 * max(conveyed) / abs(expected), "its stationary state")
    assert tension == pytest.approx(pull, rel=0.01)


@pytest.mark.slow
def test_drives_of_a_roller_leveller_give_what_its_bends_take():
    """Seven driven rollers 60 mm apart on 2 mm of strip: to 5 %, and 26 % short on one part.

    Strip touches them along lines shorter than an element, where the moment of the contact's
    normal forces about the roller's axis has to vanish.
    """
    heights = {"b1": -0.026, "t1": 0.024, "b2": -0.026, "t2": 0.025, "b3": -0.026, "t3": 0.0257,
               "b4": -0.026}  # fmt: skip
    tables = {
        "strip": {"kinematics": "section", "width": 1.0, "thickness": 2e-3, "coil_set": 0.8},
        "material": {"young": 2.06e11, "poisson": 0.3, "yield_stress": 3e8, "plasticity": {}},
        "contact": {"faces": True},
        "friction": {"coefficient": 0.15},
        "threading": {"tension": 1e4, "entry": [-0.6, 0.0, 0.0], "exit": [1.0, 0.0, 0.0]},
        "rollers": [
            {"name": name, "radius": 0.025, "centre": [0.06 * k, 0.0, z],
             "wrap": "over" if z < 0.0 else "under"}
            for k, (name, z) in enumerate(heights.items())
        ],
        "stages": [{"name": "level", "steady": True, "entry": {"tension": 1e4},
                    "exit": {"tension": 1e4},
                    "rollers": {name: {"surface_speed": 0.5} for name in heights}}],
    }  # fmt: skip
    run = Scene.model_validate(tables).run()
    *_, last = run
    assert run.outcome.done and run.cost.expansions < 60
    state = last.state
    given = sum(r.torque * 0.5 / 0.025 for r in state.rollers.values())
    taken = sum(bend.yield_power for bend in YieldedStrip.of(state).rollers().values())
    assert taken == pytest.approx(494.0, rel=0.02)
    assert given == pytest.approx(taken, rel=0.05)  # the pulls give 1 % by its elongation
