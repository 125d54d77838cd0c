"""The scenes of examples/ keep what their headers promise (slow: full meshes)."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from anmstrip import Scene
from anmstrip.scene.run import Run, Step

EXAMPLES = Path(__file__).parent.parent / "examples"

pytestmark = pytest.mark.slow


def ended(name: str, *settings: str) -> tuple[Run, Step]:
    """Run a scene in memory to its end."""
    run = Scene.load(EXAMPLES / name, settings).run()
    *_, last = run
    assert run.outcome.done, run.message
    return run, last


def edge_angle(step: Step) -> float:
    """Angle between the forces on both edges, the wrap of a perfectly flexible strip."""
    entry, end = step.state.edge_force("entry"), step.state.edge_force("exit")
    return float(np.arctan2(-end[2], end[0]) + np.arctan2(-entry[2], -entry[0]))


def test_capstan_ratio_on_its_own_mesh() -> None:
    """Euler–Eytelwein with bending: within 0.05 %."""
    run, last = ended("capstan.toml")
    reading, scene = last.state.rollers["r1"], run.scene
    f = run.assembly.friction.effective(reading.creep_speed)
    assert f == pytest.approx(0.298585, rel=1e-5)
    bending = run.assembly.strip.bending_stiffness / (2.0 * scene.rollers[0].radius ** 2)
    bending *= 1.0 + scene.friction.coefficient**2
    exponent = f * edge_angle(last)
    exponent -= bending * (1.0 / reading.tension_out - 1.0 / reading.tension_in)
    assert reading.tension_ratio == pytest.approx(np.exp(exponent), rel=5e-4)


def test_press_pressure_and_lift_off() -> None:
    """Beam on a smooth cylinder: p = (T − D/2R²)/R, lift-off 2 asin(√(D/T)/2R) early."""
    run, last = ended("press.toml")
    state, radius = last.state, run.scene.rollers[0].radius
    contact = state.contacts["r1"]
    tension = np.linalg.norm(state.edge_force("exit"))
    bending = run.assembly.strip.bending_stiffness
    pressure = (tension - bending / (2.0 * radius**2)) / radius
    angle = np.arctan2(contact.normal[0], contact.normal[2])
    x = contact.contact.operator.reference[0]
    interior = np.abs(angle - 0.04) < 0.2
    lines = np.unique(np.round(x[interior], 9))
    assert len(lines) > 10
    for line in lines:
        on = np.isclose(x, line)
        mean = np.average(contact.pressure[on], weights=contact.area[on])
        assert mean == pytest.approx(pressure, rel=0.02)
    lift_off = 2.0 * np.arcsin(np.sqrt(bending / tension) / (2.0 * radius))
    element = run.scene.strip.refined / radius
    expected = edge_angle(last) - 2.0 * lift_off
    assert state.rollers["r1"].wrap == pytest.approx(expected, abs=2.0 * element)
    assert state.velocity is None
    assert not any("friction" in name for name in run.effects)


def test_convey_moves_at_the_rollers_speed() -> None:
    """Some centimetres of the conveying scene: speed of the strip, tension ratio, cone."""
    run, last = ended("convey.toml", "strip.refined=0.1", "stages.convey.duration=0.05")
    entry = run.assembly.strip.edges["entry"].values
    speed = np.linalg.norm(last.state.velocity.reshape(-1, 3)[entry], axis=1)
    np.testing.assert_allclose(speed, 1.0, rtol=2e-3)
    reading = last.state.rollers["r1"]
    assert reading.tension_ratio == pytest.approx(1.0 / 0.95, rel=2e-3)
    assert 0.0 < reading.creep_speed < 1e-4
    assert reading.cone_violation < 0.05


def test_series_costs_less_than_the_linear_algebra_allows() -> None:
    """80 × 10 elements: one factorisation per expansion; series ≤ 1.5 × the rest."""
    sizes = ("strip.cells=[80, 10]", "strip.refined=0.05")
    run = Scene.load(EXAMPLES / "capstan.toml", sizes).run()
    steps = list(islice(run, 12))
    assert len(steps) == 12
    assert run.assembly.strip.unknowns == 10692
    assert run.cost.factorisations == run.cost.expansions
    seconds = run.cost.seconds
    algebra = sum(seconds[k] for k in ("tangent", "factorisation", "back-substitution"))
    assert seconds["series"] < 1.5 * algebra
