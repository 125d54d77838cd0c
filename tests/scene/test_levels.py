"""Shell, section and plate on the same scenes, and closed forms of hanging strips."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from threaded import BRIDLE, DENSITY, YOUNG, ended, scene_of, values

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.results.state import State
from claims import Claim

G, T = 9.81, 1e-3


def hung(kinematics: str, pull: float, **strip: Any) -> tuple[Run, State]:
    """A strip of 20 m held in z at both ends, pulled along x at the exit, then let hang."""
    shape = {"length": 20.0, "width": 0.5, "thickness": T, "cells": (40, 2), **strip}
    scene = Scene.model_validate(
        {
            "strip": {**shape, "kinematics": kinematics},
            "material": {"young": YOUNG, "poisson": 0.3, "density": DENSITY},
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
            "stages": [
                {"duration": 1.0, "exit": {"force": [pull, 0.0, 0.0]}},
                {"duration": 1.0, "gravity": [0.0, 0.0, -G]},
            ],
            "solver": {"tolerance": 1e-6},
        }
    )
    return ended(scene)


@pytest.mark.parametrize("kinematics", ["section", "shell"])
@pytest.mark.parametrize("pull", [1500.0, 8000.0])
def test_catenary(claim: Claim, kinematics: str, pull: float) -> None:
    """Elastic catenary: z = w s²/2EA + (H/w)(√(1 + (ws/H)²) − 1), s from the lowest point."""
    run, state = hung(kinematics, pull, bending=False)
    w, stiffness, half = DENSITY * T * G, YOUNG * T, 10.0
    sag = w * half**2 / (2.0 * stiffness) + pull / w * (np.hypot(1.0, w * half / pull) - 1.0)
    span = 2.0 * (pull * half / stiffness + pull / w * np.arcsinh(w * half / pull))
    at = values(run, state)
    claim(
        f"sag of a heavy {kinematics} under {pull:g} N/m (m)",
        -at[2].min(),
        sag,
        1e-6,
        "elastic catenary",
    )
    assert np.ptp(at[0]) == pytest.approx(span, rel=1e-8)
    for name in ("entry", "exit"):
        assert state.tension(name) == pytest.approx(np.hypot(pull, w * half), rel=1e-6)
        assert state.edge_force(name)[2] == pytest.approx(w * half * 0.5, rel=1e-6)
    assert "bending" not in run.effects
    assert run.cost.expansions <= 20


def test_catenary_that_bends_at_its_hinges() -> None:
    """The layer √(D/T) at the hinges takes q λ²/T off the sag of a shallow strip."""
    pull, length = 8000.0, 2.0
    flexible, stiff = (
        hung("section", pull, length=length, cells=(80, 2), bending=b) for b in (False, True)
    )
    w, layer2 = DENSITY * T * G, stiff[0].assembly.strip.bending_stiffness / pull
    sags = [-values(*found)[2].min() for found in (flexible, stiff)]
    assert sags[0] - sags[1] == pytest.approx(w * layer2 / pull, rel=5e-3)


def on_levels(*levels: str, **others: Any) -> list[tuple[Run, State]]:
    tables = {**BRIDLE, "strip": {"length": 8.0, "refined": 0.02}}
    return [ended(scene_of(tables, level, **others)) for level in levels]


def test_section_is_the_shell_of_a_material_that_does_not_contract() -> None:
    """ν = 0, two wrapped rollers: every line across the shell lies where the section does."""
    (section, one), (shell, other) = on_levels(
        "section", "shell", material={"poisson": 0.0}, solver={"tolerance": 1e-7}
    )
    thin, wide = values(section, one), values(shell, other)
    place = np.searchsorted(np.sort(section.assembly.strip.mesh.p[0]),
                            shell.assembly.strip.mesh.p[0] - 1e-9)  # fmt: skip
    thin = thin[:, np.argsort(section.assembly.strip.mesh.p[0])]
    assert np.abs(wide[[0, 2]] - thin[:, place][[0, 2]]).max() < 2e-8
    for name, reading in one.rollers.items():
        assert other.rollers[name].normal_force == pytest.approx(reading.normal_force, rel=1e-7)


def test_steel_shell_and_section_agree_on_wraps_and_forces() -> None:
    """ν = 0.3: edges curl a little, forces stay within 0.2 %."""
    (_, section), (_, shell) = on_levels("section", "shell")
    assert section.rollers
    for name, reading in section.rollers.items():
        other = shell.rollers[name]
        assert other.normal_force == pytest.approx(reading.normal_force, rel=2e-3)
        assert other.wrap == pytest.approx(reading.wrap, abs=0.02)
        assert other.tension_ratio == pytest.approx(reading.tension_ratio, abs=1e-4)


def test_level_of_a_scene_file_is_one_word(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "examples" / "press.toml").read_text(encoding="utf-8")
    path = tmp_path / "press.toml"
    path.write_text(text, encoding="utf-8")
    coarse = ["strip.refined=0.1", "solver.tolerance=1e-4"]
    forces = []
    for level in ("shell", "section"):
        run, state = ended(Scene.load(path, [*coarse, f"strip.kinematics='{level}'"]))
        forces.append(state.rollers["r1"].normal_force)
        assert run.assembly.kinematics.name == level
    assert forces[1] == pytest.approx(forces[0], rel=2e-3)


def slightly_wrapped(kinematics: str) -> tuple[Run, State]:
    """Tension 10 kN/m, then the entry is lowered: 1 degree over a roller."""
    scene = Scene.model_validate(
        {
            "strip": {"length": 2.0, "width": 0.2, "thickness": T, "cells": (16, 2),
                      "refined": 0.01, "kinematics": kinematics},
            "material": {"young": YOUNG, "poisson": 0.3},
            "contact": {"stiffness": 1e10, "eta": 10.0, "delta": 1e-3},
            "rollers": [{"name": "a", "radius": 0.5, "centre": (0.0, 0.0, -0.501)}],
            "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
            "stages": [
                {"duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}},
                {"duration": 1.0, "entry": {"move": [0.0, 0.0, -0.0098]},
                 "exit": {"move": [0.0, 0.0, -0.0098]}},
            ],
            "solver": {"tolerance": 1e-6},
        }
    )  # fmt: skip
    return ended(scene)


def test_plate_agrees_with_the_shell_on_a_wrap_of_one_degree() -> None:
    (plate, flat), (shell, whole) = (slightly_wrapped(level) for level in ("plate", "shell"))
    assert plate.assembly.strip.unknowns * 3 == shell.assembly.strip.unknowns
    one, other = flat.rollers["a"], whole.rollers["a"]
    assert one.normal_force == pytest.approx(other.normal_force, rel=0.01)
    assert one.normal_force / 0.2 / 1e4 == pytest.approx(np.radians(1.05), rel=0.02)
    assert one.wrap == pytest.approx(other.wrap, abs=0.01)
    z = [values(*found)[2] for found in ((plate, flat), (shell, whole))]
    assert np.abs(z[0] - z[1]).max() < 0.01 * np.ptp(z[1])
    for name in ("entry", "exit"):
        assert flat.tension(name) == pytest.approx(1e4, rel=1e-3)
        assert flat.edge_force(name)[2] == pytest.approx(whole.edge_force(name)[2], rel=0.01)


def test_inflated_section_is_an_arc() -> None:
    """p R = T with the tension along the strip, z held at both ends."""
    scene = Scene.model_validate(
        {
            "strip": {"length": 2.0, "width": 0.5, "thickness": T, "cells": (40, 2),
                      "kinematics": "section", "bending": False},
            "material": {"young": YOUNG, "poisson": 0.3},
            "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
            "stages": [
                {"duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}},
                {"duration": 1.0, "exit": {"tension": 1e4}},
                {"duration": 1.0, "pressure": 8e3},
            ],
        }
    )  # fmt: skip
    run, state = ended(scene)
    at, radius = values(run, state), 1e4 / 8e3
    top = at[2].max()
    away = np.hypot(at[0] - 0.5 * (at[0].min() + at[0].max()), at[2] - top + radius)
    np.testing.assert_allclose(away, radius, rtol=1e-4)
    assert top > 0.3
    assert state.tension("entry") == pytest.approx(1e4, rel=1e-4)
    assert state.tension("exit") == pytest.approx(1e4, rel=1e-4)
