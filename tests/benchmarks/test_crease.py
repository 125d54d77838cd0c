"""A wrinkle before a roller leaves a crease in strip that yields, and in no other (slow)."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "crease.py"
THICKNESS = 1e-4

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found():
    """What is read off strip that yields, and off strip that does not."""
    script = runpy.run_path(str(EXAMPLE))
    cases = {"yields": {}, "elastic": {"yield_stress": script["ELASTIC"]}}
    return {name: script["creased"](script["hot_strip"](**case)) for name, case in cases.items()}


def test_what_yields_keeps_a_crease(found):
    """A third of its thickness high, as far apart as the wrinkle within a third."""
    yields = found["yields"]
    assert yields["wrinkle_height"] > 3.0 * THICKNESS
    assert yields["crease_height"] > 0.3 * THICKNESS
    assert yields["crease_spacing"] == pytest.approx(yields["wrinkle_spacing"], rel=0.35)


def test_elastic_strip_is_flat_again(found):
    """It wrinkles as high, and keeps less than a tenth of the crease."""
    elastic, yields = found["elastic"], found["yields"]
    assert elastic["wrinkle_height"] == pytest.approx(yields["wrinkle_height"], rel=0.1)
    assert elastic["crease_height"] < 0.1 * yields["crease_height"]
