"""Wrinkles of conveyed strip that yields run on behind the roller as a crease (slow)."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from anmstrip.results.fields import FieldSampler

EXAMPLE = Path(__file__).parents[2] / "examples" / "conveyed_crease.py"
HEIGHTS = "crease_height", "free_height"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found():
    """What is read off strip that yields early, late and never, without friction, and by mesh."""
    script = runpy.run_path(str(EXAMPLE))
    cases = {"early": {}, "late": {"yield_stress": 1e8}, "never": {"yield_stress": None}}
    cases["smooth"] = {"friction": 0.0}
    cases |= {across: {"mesh": script["MESHES"][across]} for across in (10, 12)}
    return {name: script["creased"](script["conveyed"](**case)) for name, case in cases.items()}


def test_strip_that_yields_carries_a_crease_away(found):
    """Cut free it is as high as the strip is thick; elastic strip, which wrinkles too, has none."""
    early, never = found["early"][0], found["never"][0]
    assert early["wrinkle_height"] > 1e-4
    assert never["wrinkle_height"] > 1e-4
    assert early["crease_height"] > 30.0 * never["crease_height"]
    assert early["free_height"] > 1e-4
    assert never["free_height"] == 0.0


@pytest.mark.parametrize("key", HEIGHTS)
def test_crease_vanishes_as_the_yield_stress_grows(found, key):
    """At 100 MPa less than a tenth of what 60 MPa leaves is left."""
    assert found["late"][0][key] < 0.1 * found["early"][0][key]


@pytest.mark.parametrize("key", HEIGHTS)
def test_crease_converges_with_the_mesh(found, key):
    """It changes by less than a tenth from 8 elements across to 10, and from there to 12."""
    heights = np.array([found[mesh][0][key] for mesh in ("early", 10, 12)])
    assert np.all(np.abs(np.diff(heights)) < 0.1 * heights[1:])


@pytest.mark.parametrize("key", HEIGHTS)
def test_friction_makes_the_crease_higher(found, key):
    """A roller out of line that rubs shears the strip: at least twice as high as without."""
    assert found["early"][0][key] > 2.0 * found["smooth"][0][key]


def test_crease_runs_on_unchanged(found):
    """Behind the roller the accumulated plastic strain no longer changes along the strip."""
    state = found["early"][1]
    layers = state.plasticity
    assert layers is not None
    sampler = FieldSampler(state.plan.model.strip)
    strain = sampler.sample(state)["plastic_strain"]
    x, y, _ = sampler.reference
    middle = np.abs(y) < 1e-9
    behind = middle & (x > x.max() - 0.05)
    assert np.ptp(strain[behind]) < 0.02 * strain[behind].max()
    before = middle & (x < x.min() + 0.02)
    assert strain[before].max() < 0.1 * strain[behind].max()
