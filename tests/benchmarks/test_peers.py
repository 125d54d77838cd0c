"""The capstan by other programs: the formula, failures as outcomes, what is not installed."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

import harness
import peer_belt
import peers
from peer_capstan import BENDING, answer, formula, solved
from peers import COLUMNS, Program, row


def test_formula() -> None:
    """e^(f θ) less bending: ln(T2/T1) = f θ − (1 + f²) D/(2 R²) (1/T1 − 1/T2)."""
    ratio = formula(0.3, 0.75, 1e4, 1.25e4)
    assert ratio < np.exp(0.225)
    bent = np.log(ratio) - 0.225
    assert bent == pytest.approx(-1.09 * BENDING / 0.5 * (1e-4 - 8e-5), rel=1e-12)
    assert pytest.approx(18.315, rel=1e-3) == BENDING


def test_answer_of_forces_on_both_ends() -> None:
    entry, end = 1.25e4 * np.array([-np.cos(0.3), -np.sin(0.3)]), 1e4 * np.array([1.0, 0.0])
    found = answer((entry, end), 0.3, 1.0, (1, 2, 3))
    assert found.ratio == pytest.approx(1.25)
    assert found.off == pytest.approx(1.25 / formula(0.3, 0.3, 1e4, 1.25e4) - 1.0)


def test_a_failure_is_an_outcome() -> None:
    found = row(Program("nobody", "nobody"), 1.0, 60.0)
    assert found[2].startswith("failed: ModuleNotFoundError")
    assert found[4:] == (None,) * 5


def test_too_long_is_an_outcome() -> None:
    assert row(Program("section", "ours"), 1.0, 0.2)[2] == "not done in 0.2 s"


def test_what_is_not_installed_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(harness, "find_spec", lambda module: None)
    asked: list[str] = []

    def asked_for(program: Program, stiffer: float, limit: float) -> tuple[str, ...]:
        asked.append(program.name)
        return (program.title, *("",) * 8)

    monkeypatch.setattr(peers, "row", asked_for)
    report = peers.study(quick=True)
    assert set(asked) == {"section", "threaded-section"}
    assert "Left out, not installed: exudyn, felupe" in report.sheets[0].note
    assert "CalculiX 2.20" in report.sheets[0].note
    assert len(report.data.rows) == 8


@pytest.mark.slow
@pytest.mark.parametrize("stiffer", peers.FACTORS)
def test_ours_does_not_mind_the_stiffness_of_contact(stiffer: float) -> None:
    found = solved("section", stiffer)
    assert abs(found.off) < 2e-4
    assert found.tangents is not None and found.tangents < 250


def test_contact_left_to_the_mesh_takes_half_the_tangents() -> None:
    found, stiff = solved("section", None), solved("section", 1.0)
    assert abs(found.off) < 2e-4
    assert found.tangents is not None and stiff.tangents is not None
    assert found.tangents < 0.6 * stiff.tangents


@pytest.mark.slow
@pytest.mark.parametrize("name", ["exudyn", "felupe"])
def test_a_peer(name: str) -> None:
    """Each finds the formula's ratio within 0.03 % at the softest contact."""
    if find_spec(name) is None:
        pytest.skip(f"{name} is not installed")
    found = dict(zip(COLUMNS, row(Program(name, name, module=name), 1.0, 300.0), strict=True))
    assert found["outcome"] == "done"
    assert abs(found["off (%)"]) < 3e-2
    assert float(found["ratio"]) == pytest.approx(1.2519, rel=3e-4)


def test_oval_of_the_belt() -> None:
    """Unit directions, along the chords, and an even spacing that closes on itself."""
    rows, length = peer_belt.oval(240)
    places, directions = rows[:, :2], rows[:, 2:]
    assert length == pytest.approx(0.4 * np.pi)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    chords = (np.roll(places, -1, axis=0) - places) / (length / 240)
    np.testing.assert_allclose(np.linalg.norm(chords, axis=1), 1.0, atol=2e-4)
    np.testing.assert_allclose(
        chords, 0.5 * (directions + np.roll(directions, -1, axis=0)), atol=0.02
    )


@pytest.mark.slow
def test_belt_by_a_peer() -> None:
    """With steps ten times as long as published, within 1 %: what sticks gives way elastically."""
    if find_spec("exudyn") is None:
        pytest.skip("exudyn is not installed")
    found = peer_belt.Belt().run(10.0 * peer_belt.STEP)
    assert found["tight"] == pytest.approx(664.52, rel=5e-3)
    assert found["slack"] == pytest.approx(186.27, rel=1e-2)
    assert found["arc"] == pytest.approx(2.544, rel=5e-3)
    assert found["ratio"] == pytest.approx(1.06155, rel=5e-3)
