"""Wrinkles of conveyed strip that yields run on behind the roller as a crease (slow)."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from anmstrip.results.fields import FieldSampler

EXAMPLE = Path(__file__).parents[2] / "examples" / "conveyed_crease.py"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found():
    """What is read off strip that yields early, late and never, on the coarsest mesh."""
    script = runpy.run_path(str(EXAMPLE))
    cases = {"early": 6e7, "late": 1e8, "never": None}
    mesh, creased = script["MESHES"][8], script["creased"]
    return {
        name: creased(script["conveyed"](mesh, yield_stress=stress))
        for name, stress in cases.items()
    }


def test_strip_that_yields_carries_a_crease_away(found):
    """It is ten times as high as what elastic strip has there, which wrinkles as well."""
    early, never = found["early"][0], found["never"][0]
    assert early["wrinkle_height"] > 1e-4
    assert never["wrinkle_height"] > 1e-4
    assert early["crease_height"] > 10.0 * never["crease_height"]
    assert early["free_height"] > 1e-5


def test_crease_vanishes_as_the_yield_stress_grows(found):
    """At 100 MPa less than a tenth of what 60 MPa leaves is left, free or under tension."""
    for key in ("crease_height", "free_height"):
        assert found["late"][0][key] < 0.1 * found["early"][0][key]


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
