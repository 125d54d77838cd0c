"""Kirchhoff–Love bending and moments in scene files: a strip rolled up by its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from anmstrip import Scene
from anmstrip.mechanics.shell import KirchhoffLove

ROLLED = """
[strip]
length = 12.0
width = 1.0
thickness = 0.1
cells = [16, 1]
kinematics = "{level}"
bending = {bending}

[material]
young = 1.2e6
poisson = 0.0

[edges.entry]
fixed = ["x", "y", "z"]

[edges.exit]
fixed = ["y", "z"]

[[stages]]
name = "roll"
duration = 1.0
entry.moment = 26.17993877991494  # N, pi D / L
exit.moment = 26.17993877991494
"""


@pytest.mark.parametrize("level", ["shell", "section"])
@pytest.mark.parametrize("bending", ["true", '"kirchhoff-love"'])
def test_strip_is_rolled_up(tmp_path: Path, level: str, bending: str) -> None:
    """Moments at both ends make it half a circle of radius L/π."""
    path = tmp_path / "rolled.toml"
    path.write_text(ROLLED.format(level=level, bending=bending), encoding="utf-8")
    run = Scene.load(path).run()
    *_, last = run
    assert run.outcome.done, run.message
    strip = run.assembly.strip
    assert isinstance(run.assembly.bending, KirchhoffLove) is ("kirchhoff" in bending)
    u = last.state.full.reshape(-1, strip.count)[strip.node_values]
    x = strip.mesh.p[0] - strip.mesh.p[0].min()
    assert u[x == 12.0][:, 0] == pytest.approx(24.0 / np.pi - 12.0, abs=0.01)
    assert u[x == 6.0][:, -1] == pytest.approx(-12.0 / np.pi, abs=0.01)
