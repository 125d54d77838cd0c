"""Scenes that ``anmstrip new`` writes: commented, complete, and they run as they are."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from anmstrip import Scene
from anmstrip.cli import TEMPLATES, main
from anmstrip.results.plastic import YieldedStrip
from anmstrip.results.state import State


def written(kind: str, target: Path) -> str:
    done = CliRunner().invoke(main, ["new", kind, "-o", str(target)])
    assert done.exit_code == 0, done.output
    assert f"anmstrip run {target}" in done.output
    return target.read_text("utf-8")


def test_every_template_has_its_kind() -> None:
    found = (Path(__file__).parents[2] / "src/anmstrip/scene/templates").glob("*.toml")
    assert sorted(path.stem for path in found) == sorted(TEMPLATES)


@pytest.mark.parametrize("kind", TEMPLATES)
def test_every_table_is_commented_and_accepted(kind: str, tmp_path: Path) -> None:
    text = written(kind, tmp_path / "mine.toml")
    assert tomllib.loads(text)["title"]
    assert text.count("#") > 15
    assert Scene.load(tmp_path / "mine.toml").stages
    done = CliRunner().invoke(main, ["explain", str(tmp_path / "mine.toml")])
    assert done.exit_code == 0, done.output


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("precious")
    done = CliRunner().invoke(main, ["new", "roller", "-o", str(tmp_path / "mine.toml")])
    assert done.exit_code == 2
    assert "not there yet" in done.output
    assert (tmp_path / "mine.toml").read_text() == "precious"


def test_nothing_is_written_where_no_directory_is(tmp_path: Path) -> None:
    """That ended as a run that stops early, without what to type."""
    target = tmp_path / "no place" / "a b.toml"
    done = CliRunner().invoke(main, ["new", "roller", "-o", str(target)])
    assert done.exit_code == 2
    assert f"-o 'a b.toml', or mkdir -p '{target.parent}' before" in done.output


def ended(kind: str, directory: Path, *settings: str) -> State:
    written(kind, directory / "mine.toml")
    run = Scene.load(directory / "mine.toml", settings).run()
    *_, last = run
    assert run.outcome.done, run.message
    return last.state


def test_roller_slips_as_a_capstan(tmp_path: Path) -> None:
    state = ended("roller", tmp_path)
    entry, end = state.edge_force("entry"), state.edge_force("exit")
    turned = np.arctan2(-entry[2], -entry[0]) + np.arctan2(-end[2], end[0])  # of the two pulls
    bent = 1.09 * 18.3 / (2.0 * 0.5**2) * (1.0 / np.linalg.norm(end) - 1.0 / np.linalg.norm(entry))
    ratio = np.linalg.norm(entry) / np.linalg.norm(end)
    assert np.log(ratio) == pytest.approx(0.3 * turned - bent, rel=2e-3)
    assert state.rollers["r1"].tension_ratio == pytest.approx(ratio, rel=1e-3)


def test_bridle_keeps_its_ends(tmp_path: Path) -> None:
    state = ended("bridle", tmp_path)
    assert state.tension("entry") == pytest.approx(1.3e4, rel=1e-4)
    assert state.tension("exit") == pytest.approx(1e4, rel=1e-4)
    torque = sum(r.torque for r in state.rollers.values())
    assert torque == pytest.approx(0.5 * 3e3, rel=1e-3)  # radius times what the tension falls by


def test_idlers_of_the_furnace_take_what_their_bearings_need(tmp_path: Path) -> None:
    state = ended("furnace", tmp_path)
    for name in ("idler1", "idler2", "idler3"):
        assert state.rollers[name].torque == pytest.approx(-8.0, abs=0.4)  # half the tolerance
    lifted = state.rollers["idler1"].tension_in - state.rollers["drive1"].tension_out
    assert lifted == pytest.approx(7800.0 * 8e-4 * 9.81 * 10.0, rel=0.02)  # w h


@pytest.mark.slow
def test_leveller_bends_beyond_yield_and_takes_friction_times_force(tmp_path: Path) -> None:
    """κ_e = 3.15 1/m; what is left of strip that is unloaded in a bend is κ − M/D."""
    state = ended("leveller", tmp_path)
    for name in ("l1", "u1", "l2", "u2"):
        roller = state.rollers[name]
        assert abs(roller.drag) == pytest.approx(0.1 * roller.normal_force, rel=0.03)
    layers = YieldedStrip.of(state)
    assert layers is not None
    bends, rigidity = layers.rollers(), 2e11 * 1e-3**3 / (12.0 * 0.91)
    for bend in bends.values():
        left = bend.curvature - bend.moment / rigidity
        assert bend.curl_on_roller == pytest.approx(left, abs=0.01)
    shares = [bends[name].plastic_share for name in ("u1", "l2", "u2")]
    assert all(share > 0.5 for share in shares)
    assert bends["l1"].plastic_share == 0.0


@pytest.mark.slow
def test_the_bend_at_a_roller_is_around_it(tmp_path: Path) -> None:
    """The last roller bends the strip less than the curl before it does, the other way round."""
    layers = YieldedStrip.of(ended("leveller", tmp_path, "threading.exit=[0.35, 0.0, 1.5e-3]"))
    assert layers is not None
    bends = list(layers.rollers().values())
    assert [np.sign(bend.curvature) for bend in bends] == [1.0, -1.0, 1.0, -1.0, 1.0]
    assert [np.sign(bend.moment) for bend in bends] == [1.0, -1.0, 1.0, -1.0, 1.0]


@pytest.mark.slow
def test_steering_is_that_of_shelton(tmp_path: Path) -> None:
    state = ended("steering", tmp_path)
    x, y = state.along("x"), state.along("y")
    length = 2.0 + np.sqrt(18.3 / 4.4e4)
    assert np.interp(x[0] + length, x, y) == pytest.approx(-0.6782e-3 * length, rel=5e-3)
