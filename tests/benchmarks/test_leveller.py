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
def test_curl_behind_every_roller(levelled):
    """To 1 % of the largest, on the same history of curvatures and forces."""
    *_, layers = levelled
    moments = returned_moments(layers.curvature, layers.force)
    rigidity = PLANE * THICKNESS**3 / 12.0
    exact = layers.curvature - moments / rigidity
    found = layers.rollers()
    places = [
        np.abs(layers.residual_curvature - b.residual_curvature).argmin() for b in found.values()
    ]
    errors = np.array([exact[p] - layers.residual_curvature[p] for p in places])
    print(errors)
    largest = np.abs([b.residual_curvature for b in found.values()]).max()
    assert np.abs(errors).max() < 0.01 * largest
    assert exact[-1] == pytest.approx(layers.residual_curvature[-1], abs=0.01 * largest)


@pytest.mark.slow
def test_work_and_power(levelled):
    """Fewer than 60 tangents; what tension and rollers do is what friction and flow take."""
    run, state, layers = levelled
    print(run.stages, layers.rollers(), run.report if False else "")
    assert run.stages["level"]["tangents"] <= 60
    flow = np.trapezoid(layers.power, layers.x)
    assert flow == pytest.approx(sum(b.yield_power for b in layers.rollers().values()), rel=1e-2)
    strip = state.plan.model.strip
    speeds = {
        name: np.linalg.norm(
            state.velocity[strip.count * strip.edges[name].values[0] + np.arange(2)]
        )
        for name in ("entry", "exit")
    }
    pulled = sum(
        sign * state.tension(name) * speeds[name] * strip.width
        for name, sign in (("exit", 1.0), ("entry", -1.0))
    )
    rubbed = sum(
        float((contact.traction * (contact.slip + 0.0)).sum(axis=0) @ contact.area)
        for contact in state.contacts.values()
    )
    carried = sum(reading.torque / 0.02 * 1.0 for reading in state.rollers.values())
    assert flow == pytest.approx(pulled + carried + rubbed, rel=0.05)
