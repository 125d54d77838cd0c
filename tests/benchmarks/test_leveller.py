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
def test_curl_behind_every_roller(levelled, claim):
    """To 2 % of the largest, on the same history of curvatures and forces: n is 51, rates vary."""
    *_, layers = levelled
    along = np.argsort(layers.x)
    curvature, force, left = (
        values[0, along] for values in (layers.curvature, layers.force, layers.residual_curvature)
    )
    exact = curvature - returned_moments(curvature, force) / (PLANE * THICKNESS**3 / 12.0)
    found = layers.rollers()
    places = [np.abs(left - b.residual_curvature).argmin() for b in found.values()]
    errors = np.array([exact[p] - left[p] for p in places])
    largest = np.abs([b.residual_curvature for b in found.values()]).max()
    source = "perfectly plastic fibres, returned"
    for name, error in zip(found, errors / largest, strict=True):
        claim(
            f"curl behind {name} of `leveller.toml`, its error over the largest",
            error,
            0.0,
            0.02,
            source,
        )
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
