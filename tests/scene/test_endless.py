"""Endless strip round its rollers, beside the theory of strings."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from anmstrip import Scene
from anmstrip.driver.sensitivities import sensitivities
from anmstrip.errors import InputError
from claims import Claim

BELT = Path(__file__).parents[2] / "examples" / "belt.toml"


def test_belt_has_the_tensions_and_speeds_of_a_string(claim: Claim) -> None:
    """Membrane law T = E t λ (λ² − 1)/2; torques in balance, one flow of mass in both strands."""
    run = Scene.load(BELT).run()
    *_, last = run
    assert run.outcome.done, run.message
    assert run.stages["run"]["tangents"] <= 35
    strip, state = run.assembly.strip, last.state
    driving, driven = state.rollers["driving"], state.rollers["driven"]
    ea = strip.tensile_stiffness * strip.width

    def stretch(force: float) -> float:
        return float(brentq(lambda s: 0.5 * ea * s * (s * s - 1.0) - force, 1.0, 2.0, xtol=1e-14))

    script = runpy.run_path(str(BELT.with_suffix(".py")))
    theory = script["string_theory"](run.scene, strip.length, 47.617, stretch)
    values = script["found"](run, last)
    claim("tight strand of a belt (N)", values["tight"], theory["tight"], 1e-3, "string")
    claim("slack strand of a belt (N)", values["slack"], theory["slack"], 1e-3, "string")
    assert values["ratio"] == pytest.approx(theory["ratio"], rel=2e-5)
    assert values["arc"] == pytest.approx(theory["arc"], rel=2e-3)
    assert driving.slip_arc == pytest.approx(theory["arc"], rel=0.05)  # of 0.95 of the limit
    assert driven.torque == pytest.approx(-47.617, rel=1e-6)
    assert driving.torque == pytest.approx(47.617, rel=1e-4)
    flow = [r.surface_speed / stretch(r.tension_in * strip.width) for r in (driving, driven)]
    assert flow == pytest.approx(2 * [state.strip_speed], rel=1e-4)


@pytest.mark.slow
def test_the_exit_of_an_endless_strip_goes_on_as_its_entry() -> None:
    """One position, direction, tension and moment, in the middle of a strand that sags.

    T z,XX = q |r,X| of derivatives along the unstretched strip, as curvatures are.
    """
    heavy = ["material.density=7000.0", "stages.run.gravity=[0.0, 0.0, -500.0]"]
    run = Scene.load(BELT, [*heavy, "friction.speed=0.03", "solver.tolerance=1e-7"]).run()
    *_, last = run
    state, strip = last.state, run.assembly.strip
    entry, exit = (strip.edges[name].values for name in ("entry", "exit"))
    nodal, flat = strip.nodal(state.full), np.array([strip.length, 0.0])
    assert nodal[exit] + flat == pytest.approx(nodal[entry], abs=1e-12)
    slopes = [strip.edge_tangent(name, state.full) for name in ("entry", "exit")]
    assert slopes[0] == pytest.approx(slopes[1], abs=1e-12)
    assert state.edge_force("entry") == pytest.approx(-state.edge_force("exit"), abs=1e-4)
    tension, curvature = state.tension("exit"), np.abs(state.along("curvature"))
    stretch = np.linalg.norm(slopes[0])
    sagging = 7000.0 * 500.0 * strip.thickness * stretch / tension
    assert curvature[0] == pytest.approx(curvature[-1], rel=1e-3)
    assert curvature[0] == pytest.approx(sagging, rel=0.02)


@pytest.mark.slow
def test_sensitivities_of_an_endless_strip_are_differences_of_runs() -> None:
    """To 1e-5, of both tensions by the torque, and with T₁ − T₂ = M/(r W) exactly."""
    key, h, tight = "rollers.driven.torque", 0.05, []
    settings = ["friction.speed=0.03", "solver.tolerance=1e-9"]
    run = Scene.load(BELT, settings).run()
    *_, last = run
    rates = sensitivities(last.state, (False, False))[key]
    for torque in (-47.617 - h, -47.617 + h):
        *_, end = Scene.load(BELT, [*settings, f"stages.run.{key}={torque}"]).run()
        readings = end.state.rollers["driving"]
        tight.append((readings.tension_in, readings.tension_out))
    differences = np.diff(tight, axis=0)[0] / (2.0 * h)
    found = [rates[f"driving_tension_{word}"] for word in ("in", "out")]
    assert found == pytest.approx(differences, rel=1e-5)
    assert found[0] - found[1] == pytest.approx(-1.0 / (0.1 * 0.08), rel=1e-3)


MISTAKES: list[tuple[str, Any, str, str]] = [
    ("threading.entry", [0.0, 0.0, -0.1], "threading.entry", "an endless strip has no ends"),
    ("edges.entry.fixed", ["x", "z"], "edges.entry", "an endless strip has no ends"),
    ("stages.run.exit.tension", 1e3, "stages.run.exit", "an endless strip has no ends"),
    ("strip.kinematics", "shell", "strip.kinematics", '"section" beside threading.closed'),
    ("stages.run.steady", False, "stages.run.steady", "an endless strip has no stages in time"),
    ("stages.run.strip.speed", 1.0, "stages.run.strip.speed", "the strip's speed follows"),
    ("strip.length", 2.0, "strip.length", "say the length"),
    ("rollers.driven.axis", [1e-3, 1.0, 0.0], "rollers.driven.axis", "no width"),
    ("rollers.driven.crown", [0.0, -1e-3], "rollers.driven.crown", "no width"),
    ("stages.run.strip.camber", 1e-3, "stages.run.strip.camber", "no width"),
]


@pytest.mark.parametrize(("key", "value", "named", "expected"), MISTAKES)
def test_what_an_endless_strip_cannot_have_is_refused(
    key: str, value: Any, named: str, expected: str
) -> None:
    settings = [f"{key}={json.dumps(value)}", "stages.run.duration=1.0"]
    with pytest.raises(InputError) as refused:
        Scene.load(BELT, settings)
    assert any(m.key == named and expected in m.expected for m in refused.value.mistakes), str(
        refused.value
    )
    assert not any("shell" in m.hint for m in refused.value.mistakes)  # which is refused as well


def test_small_pulleys_far_apart_are_first_told_to_be_in_another_order() -> None:
    """A centre of 10 m beside radii of 0.25 m was first told to be in mm."""
    tables: dict[str, Any] = {
        "strip": {"kinematics": "section", "width": 0.8, "thickness": 8e-3},
        "material": {"young": 4e8, "poisson": 0.45},
        "friction": {"coefficient": 0.35},
        "threading": {"tension": 8e3, "closed": True},
        "rollers": [
            {"name": "head", "radius": 0.25, "centre": [10.0, 0.0, 0.0], "wrap": "left"},
            {"name": "tail", "radius": 0.2, "centre": [0.0, 0.0, 0.0], "wrap": "left"},
            {"name": "snub", "radius": 0.1, "centre": [9.2, 0.0, -0.3], "wrap": "right"},
        ],
        "stages": [{"steady": True, "rollers": {"head": {"surface_speed": 2.0}}}],
    }
    with pytest.raises(InputError) as refused:
        Scene.from_tables(tables, "belt.toml").run()
    assert refused.value.mistakes[0].hint.startswith(
        "the tables of rollers in the order head, snub"
    )


def test_torques_alone_do_not_fix_the_speed_of_an_endless_strip() -> None:
    tables = Scene.load(BELT).to_dict()
    tables["rollers"][0]["drive"] = "idle"
    del tables["stages"][0]["rollers"]["driving"]
    with pytest.raises(InputError, match="torques alone do not fix the speed"):
        Scene.from_tables(tables, "belt.toml", [])


@pytest.mark.parametrize(("thickness", "tension"), [(1e-3, 5e3), (4e-4, 5e3), (1e-3, 2e4)])
def test_a_stiff_belt_has_its_tension_at_rest(thickness: float, tension: float) -> None:
    """Of 1 mm of steel the way is longer than a string by 14 times what 5 kN/m stretches."""
    roller = {"radius": 0.2, "wrap": "left", "drive": "idle"}
    scene = Scene.model_validate({
        "strip": {"kinematics": "section", "width": 0.5, "thickness": thickness},
        "material": {"young": 2e11, "poisson": 0.3},
        "friction": {"coefficient": 0.3},
        "threading": {"tension": tension, "closed": True},
        "rollers": [
            {"name": "drive", "radius": 0.3, "centre": [0.0, 0.0, 0.0], "wrap": "left"},
            {"name": "nose", "centre": [1.0, 0.0, 1.2], **roller},
            {"name": "braked", "centre": [2.0, 0.0, 0.0], **roller, "bearing": 300.0},
        ],
        "stages": [{"name": "run", "steady": True, "rollers": {"drive": {"surface_speed": 3.0}}}],
    })  # fmt: skip
    run = scene.run()
    first, *_, last = run
    assert run.outcome.done
    assert first.state.tension("entry") == pytest.approx(tension, rel=3e-3)
    taken = last.state.rollers["braked"].tension_out - last.state.rollers["braked"].tension_in
    assert taken == pytest.approx(300.0 / 0.2 / 0.5, rel=1e-3)
