"""Meshes that are finer than usual by a factor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from anmstrip import InputError, Scene
from anmstrip.simulation.problem import Assembly

EXAMPLES = Path(__file__).parents[2] / "examples"


def lines(name: str, *settings: str) -> np.ndarray:
    """Coordinates of the lines of nodes along a scene's strip."""
    strip = Assembly(Scene.load(EXAMPLES / f"{name}.toml", settings)).strip
    return np.unique(np.round(strip.mesh.p[0], 12))


@pytest.mark.parametrize("name", ["press", "bridle", "tower", "heavy"])
def test_twice_as_fine_divides_all_elements(name: str) -> None:
    """Of cells, cells about places of lifting, and the default; by two everywhere."""
    usual, halved = lines(name), lines(name, "strip.finer=2.0")
    assert len(halved) - 1 == pytest.approx(2 * (len(usual) - 1), rel=0.1)
    sizes = np.interp(
        0.5 * (halved[1:] + halved[:-1]), 0.5 * (usual[1:] + usual[:-1]), np.diff(usual)
    )
    assert np.median(np.diff(halved) / sizes) == pytest.approx(0.5, rel=0.1)
    assert 2 * len(lines(name, "strip.finer=0.5")) == pytest.approx(len(usual), rel=0.2)


def test_elements_across_too() -> None:
    def across(finer: float) -> int:
        scene = Scene.load(EXAMPLES / "press.toml", ["strip.cells=[16, 4]", f"strip.finer={finer}"])
        return len(np.unique(np.round(Assembly(scene).strip.mesh.p[1], 9))) - 1

    assert [across(f) for f in (0.25, 0.5, 1.0, 1.5, 2.0)] == [2, 2, 4, 6, 8]


def test_too_many_elements_are_refused() -> None:
    settings = ["strip.cells=[400, 40]", "strip.finer=8.0"]
    with pytest.raises(InputError, match="at most 250000 elements"):
        Assembly(Scene.load(EXAMPLES / "press.toml", settings)).strip  # noqa: B018
    with pytest.raises(InputError, match="either finer or mesh"):
        Scene.load(EXAMPLES / "capstan_mesh.toml", ["strip.finer=2.0"])
