"""Response of stationary states: tension of a span, and a roller that is yawed to and fro."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from anmstrip import InputError, Scene
from anmstrip.cli import main
from anmstrip.driver.sensitivities import response
from anmstrip.driver.stationary import respond
from anmstrip.results.files import read_history
from anmstrip.results.state import State
from lines import SNUBBED

EXAMPLES = Path(__file__).parents[2] / "examples"

SPAN: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 0.5, "thickness": 1e-3, "bending": False},
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {},
    "friction": {"law": "tanh", "coefficient": 0.5, "speed": 1e-7},
    "threading": {"tension": 1e4, "entry": (-0.5, 0.0, -0.5), "exit": (4.5, 0.0, -0.5)},
    "rollers": [
        {"name": "a", "radius": 0.2, "centre": (0, 0, 0), "wrap": "over"},
        {"name": "b", "radius": 0.2, "centre": (4.0, 0, 0), "wrap": "over"},
    ],
    "edges": {"entry": {"fixed": ["x", "z"]}},
    "stages": [
        {
            "name": "run", "steady": True, "strip": {"speed": 2.0 / (1.0 + 5e-5)},
            "rollers": {"a": {"surface_speed": 2.0}, "b": {"surface_speed": 2.0}},
        }
    ],
    "solver": {"tolerance": 1e-4},
}  # fmt: skip


def last(scene: Scene) -> State:
    """The stationary state at the end of a scene."""
    run = scene.run()
    *_, step = run
    assert run.outcome.done, run.message
    return step.state


def test_tension_of_a_span_lags_by_the_time_that_strip_takes_through_it() -> None:
    """E t/V / (1 + i ω L/V) between two rollers on which the strip sticks: 1 % and 0.5°."""
    state = last(Scene.model_validate(SPAN))
    arcs = [state.contacts[name].arc for name in "ab"]
    length = arcs[1][0] - arcs[0][1]
    omega = np.array([1e-3, 0.3, 1.0, 3.0]) * 2.0 / length
    found = response(state, [False] * 2, "rollers.b.surface_speed", omega)["b_tension_in"]
    expected = 2e8 / 2.0 / (1.0 + 1j * omega * length / 2.0)
    assert np.abs(found) == pytest.approx(np.abs(expected), rel=0.01)
    assert np.degrees(np.angle(found / expected)) == pytest.approx(np.zeros(4), abs=0.5)


def test_offset_follows_a_roller_that_is_yawed_to_and_fro() -> None:
    """Shelton and Reid's acceleration, d²y/dt² = V² y'', and dy/dt = V (θ − y'), on their beam.

    To 1 % and 0.5° up to 0.3 V/L; to 2 % and 1° at V/L, which finer meshes and a smaller V_c lower.
    """
    settings = ["rollers.r1.axis=[0.0, 1.0, 0.0]", "strip.refined=0.008", "friction.speed=2e-7"]
    state = last(Scene.load(EXAMPLES / "steering.toml", settings))
    strip = state.plan.model.strip
    length = state.contacts["r1"].arc[0] - strip.nodes[0].min()
    kl = np.sqrt(4.4e4 * 0.1 / (2e11 * 1e-3 * 0.1**3 / 12.0)) * length
    c, s = np.cosh(kl), np.sinh(kl)
    f1, f2 = np.array([kl * (c - 1.0), kl * c - s]) * kl / (kl * s + 2.0 * (1.0 - c))
    omega = np.array([1e-3, 0.1, 0.3, 1.0]) / length
    found = response(state, [False], "rollers.r1.yaw", omega)["r1_offset"]
    p = 1j * omega * length
    expected = f2 * length / (p**2 + f2 * p + f1)
    ratio, phase = np.abs(found / expected), np.degrees(np.angle(found / expected))
    assert ratio[:3] == pytest.approx(np.ones(3), abs=0.01)
    assert phase[:3] == pytest.approx(np.zeros(3), abs=0.5)
    assert (ratio[3], phase[3]) == (pytest.approx(1.0, abs=0.02), pytest.approx(0.0, abs=1.0))


@pytest.mark.slow
def test_command_writes_gain_and_phase(tmp_path: Path) -> None:
    """They are those of the amplitudes; names that are none are refused."""
    scene = str(EXAMPLES / "steering.toml")
    coarse = ["strip.cells=[8, 2]", "strip.refined=0.2"]
    settings = ["--set", coarse[0], "--set", coarse[1], "-o", str(tmp_path), "--of", "offset"]
    result = CliRunner().invoke(main, ["response", scene, "--to", "rollers.r1.yaw", *settings])
    assert result.exit_code == 0, result.output
    table = read_history(tmp_path / "response.csv")
    state = last(Scene.load(scene, coarse))
    expected = response(state, [False], "rollers.r1.yaw", table["omega"])["r1_offset"]
    assert table["gain"] == pytest.approx(np.abs(expected), rel=1e-9)
    turned = np.exp(1j * np.radians(table["phase"]))
    assert turned == pytest.approx(expected / np.abs(expected), rel=1e-9)
    assert (tmp_path / "response.png").read_bytes().startswith(b"\x89PNG")
    line = str(EXAMPLES / "bridle_map.toml")
    result = CliRunner().invoke(main, ["response", line, "--to", "yaw", *settings[4:]])
    assert result.exit_code == 2
    assert "--to yaw" in result.output
    of = ["--of", "entry_tension", "-o", str(tmp_path)]
    given = (["response", line, "--to", f"exit.{key}", *of] for key in ("tension", "force"))
    pulled, forced = (CliRunner().invoke(main, each).output for each in given)
    assert pulled.replace("exit.tension", "exit.force") == forced


def test_responses_of_a_line_that_runs_backwards_and_of_one_at_rest(tmp_path: Path) -> None:
    """Frequencies are positive, the gain is that of the sensitivities; at rest there is none."""
    pulls = {"entry": {"tension": 8e3}, "exit": {"tension": 8.5e3}}
    run = {"name": "run", "steady": True, **pulls, "rollers": {"a": {"surface_speed": -2.0}}}
    scene = Scene.from_tables(SNUBBED | {"stages": [run]}, "back.toml")
    respond(scene, "a_torque", "exit.tension", tmp_path)
    table = read_history(tmp_path / "response.csv")
    assert min(table["omega"]) > 0.0
    assert table["gain"][0] == pytest.approx(0.25, rel=1e-3)
    rest = {**run, "rollers": {"a": {"surface_speed": 0.0}}}
    scene = Scene.from_tables(SNUBBED | {"stages": [rest]}, "rest.toml")
    with pytest.raises(InputError, match="a strip that runs at its end"):
        respond(scene, "a_torque", "exit.tension", tmp_path)


def test_unknown_names_are_told_together_and_those_of_shells_as_such(tmp_path: Path) -> None:
    """Of a section a roller's yaw was taken for a misspelled speed, and the reading not looked at.

    The advice makes it a shell, which has both.
    """
    scene = Scene.model_validate(SPAN)
    for of, to, words in [("a_tensoin_in", "rollers.a.speed", "nearest known"),
                          ("offset", "rollers.a.yaw", "strip.kinematics=\"shell\"")]:  # fmt: skip
        with pytest.raises(InputError) as refused:
            respond(scene, of, to, tmp_path)
        mistakes = refused.value.mistakes
        assert [mistake.file for mistake in mistakes] == [f"--to {to}", f"--of {of}"]
        assert all(words in mistake.hint for mistake in mistakes)
