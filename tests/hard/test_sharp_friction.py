"""Friction that turns round within a tenth of a micrometre per second."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from hard_strips import arc_ratio

README = Path(__file__).parents[2] / "README.md"

LAWS: dict[str, dict[str, Any]] = {
    "algebraic": {},
    "tanh": {"omega": 0.1},
    "norton-hoff": {"omega": 0.1, "exponent": 0.05},
}


def capstan(tmp_path: Path, law: str, speed: float) -> Run:
    """Run the scene of the README, whose roller turns at 1 m/s under a held strip."""
    text = README.read_text(encoding="utf-8").split("```toml\n")[1].split("```")[0]
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    tables = Scene.load(path).to_dict()
    tables["friction"] = {"law": law, "coefficient": 0.3, "speed": speed, **LAWS[law]}
    tables["solver"]["tolerance"] = 1e-3
    run = Run(Scene.model_validate(tables))
    for _ in run:
        pass
    return run


def misses(run: Run) -> float:
    """Relative error of the tension ratio beside that of elasticas around an arc."""
    assembly, strip = run.assembly, run.assembly.strip
    assert run.state is not None and assembly.thread is not None and assembly.friction is not None
    stiff = strip.bending_stiffness / (1e4 * 0.5**2)
    expected = arc_ratio(assembly.friction.effective(1.0), assembly.thread.turns["r1"], stiff)
    found = run.state.rollers["r1"].tension_ratio
    assert found is not None
    return float(np.abs(found / expected - 1.0))


@pytest.mark.parametrize("law", LAWS)
def test_sharp_friction_ends_where_statics_says(tmp_path: Path, law: str) -> None:
    """Measured at 1, 1e-2 and 1e-4 m/s: 24 to 74 tangents."""
    run = capstan(tmp_path, law, 1e-4)
    assert run.outcome.done, run.message
    assert misses(run) < 2e-3
    assert run.cost.expansions < 150


@pytest.mark.slow
def test_very_sharp_friction_does_not_stall(tmp_path: Path) -> None:
    """Where paths of steps stall, Newton's method ends one; without it this run stops.

    It takes 527 tangents; at 1e-4 m/s 43 do.
    """
    run = capstan(tmp_path, "algebraic", 1e-7)
    assert run.outcome.done, run.message
    assert misses(run) < 2e-3
