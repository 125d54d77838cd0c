"""Meshes that are refined until they change tensions by no more than is asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip import InputError, Scene
from anmstrip.driver.explain import explain
from anmstrip.driver.scene import RefinedRun
from anmstrip.simulation.problem import MAX_HALVED_UNKNOWNS, Assembly

PRESS = Path(__file__).parents[2] / "examples" / "press.toml"
COARSE = ['strip.kinematics="section"', "solver.tolerance=1e-5"]
AUTO = [*COARSE, 'strip.refined="auto"', "strip.finer=0.2"]


def ran(*settings: str, directory: Path | None = None) -> Any:
    """Run the scene to its end."""
    run = Scene.load(PRESS, settings).run(directory)
    for _ in run:
        pass
    return run


@pytest.mark.slow
def test_elements_are_halved_until_the_error_is_small(tmp_path: Path) -> None:
    """Every pass is the run of the same scene with its factor typed; the last is below the goal."""
    run = ran(*AUTO, "solver.mesh_tolerance=1e-5")
    goal = 1e-5 * run.assembly.scales.tension
    assert [each["finer"] for each in run.passes] == pytest.approx([0.2, 0.4, 0.8])
    *before, last = (each["error"] for each in run.passes)
    assert min(before) > goal > last
    told = f"(3 run(s)) the mesh makes tensions wrong by about {last:.2g} N/m, below the 1e-05 of"
    assert told in run.message
    quarter = 0.25 * np.sqrt(2e11 * 1e-9 / 12.0 / (1.0 - 0.3**2) / np.hypot(1e4, 5773.5))
    plain = ran(*COARSE, f"strip.refined={quarter}", "strip.finer=0.4", directory=tmp_path)
    assert run.passes[1]["element"] == pytest.approx(plain.assembly.strip.cell_sizes.min())
    assert run.passes[1]["unknowns"] == plain.facts()["unknowns"]
    assert run.passes[1]["tangents"] == plain.facts()["tangents"]
    assert run.passes[1]["error"] == pytest.approx(plain.errors()["mesh"]["tension"], rel=1e-6)


def test_where_it_is_not_reached_the_bound_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("simulation.problem", "driver.scene"):
        monkeypatch.setattr(f"anmstrip.{module}.MAX_HALVED_UNKNOWNS", 400)
    run = ran(*AUTO, "solver.mesh_tolerance=1e-9")
    assert [each["unknowns"] for each in run.passes] == [140, 276]
    assert run.passes[0]["error"] > 0.0
    assert run.passes[1]["error"] is None
    assert run.message.endswith(
        "the mesh makes tensions wrong by an unknown part, by less than "
        f"{run.passes[0]['error']:.2g} N/m, that of longer ones, if it converges; half the length "
        "would take more than 400 unknowns."
    )


def test_the_goal_is_the_tolerance_unless_it_is_typed() -> None:
    run = ran(*AUTO, "solver.tolerance=1e-3")
    assert len(run.passes) == 1
    assert "below the 0.001 of" in run.message


def test_a_path_that_stops_is_followed_on_finer_meshes_until_tangents_are_used_up() -> None:
    run = ran(*AUTO, "solver.max_tangents=3")
    assert isinstance(run, RefinedRun)
    assert len(run.passes) == 1
    assert "\nOn elements of " in run.message  # what may be typed ends its line


def test_it_is_said_before_and_not_resumed(tmp_path: Path) -> None:
    scene = Scene.load(PRESS, [*AUTO, "solver.mesh_tolerance=1e-4"])
    told = " ".join(explain(scene).split())
    assert "until the mesh makes tensions wrong by less than 0.0001 of the largest" in told
    with pytest.raises(InputError, match="each run depends on the one before it"):
        scene.run(tmp_path, resume=True)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["friction.coefficient=0.2", 'friction.regularisation="auto"'], "repeats the run as well"),
        (
            ["material.yield_stress=2e8", "material.plasticity.layers=21"],
            "estimated in steady stages of a section alone",
        ),
    ],
)
def test_what_it_does_not_go_with_is_refused(more: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Scene.load(PRESS, [*AUTO, *more])


def test_steady_strip_that_yields_is_refined() -> None:
    """Its plastic strains are solved for point by point: however many, they do not count."""
    many = ['strip.refined="auto"', "material.plasticity.layers=81", "strip.finer=4"]
    assembly = Assembly(Scene.load(PRESS.parent / "leveller.toml", many))
    assert assembly.can_halve and assembly.unknowns > MAX_HALVED_UNKNOWNS
