"""The stiff sliding point: errors, counts, and what the study writes."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from anmstrip.cli import main
from anmstrip.studies import optional, stiff
from anmstrip.studies.stiff_methods import END, METHODS, scipys
from anmstrip.studies.stiff_reference import Reference, pull

COLLOCATION, DIFFERENCES = METHODS[:2]


@pytest.fixture(scope="module")
def references() -> dict[float, Reference]:
    return {epsilon: Reference(epsilon, END) for epsilon in (0.3, 1e-2, 1e-3, 1e-4)}


@pytest.mark.parametrize("epsilon", [0.3, 1e-3])
def test_reference_against_radau(references: dict[float, Reference], epsilon: float) -> None:
    found = scipys("Radau")(epsilon, 1e-11)
    assert found.states == pytest.approx(references[epsilon](found.times), abs=1e-9)


def test_reference_in_the_limit_of_coulomb(references: dict[float, Reference]) -> None:
    """Sticks until U = 1, then hangs back by the force of friction, 1."""
    t = np.linspace(0.0, END, 101)
    expected = np.maximum(pull(t) - 1.0, 0.0)
    assert references[1e-4](t) == pytest.approx(expected, abs=5e-4)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8, 1e-10])
@pytest.mark.parametrize("epsilon", [0.3, 1e-2, 1e-3, 1e-4])
def test_the_collocation_keeps_its_tolerance(
    references: dict[float, Reference], epsilon: float, tolerance: float
) -> None:
    found = stiff.attempt(COLLOCATION, epsilon, tolerance, references[epsilon])
    assert 1e-2 * tolerance < found.error <= tolerance


def test_the_count_hardly_depends_on_the_sharpness(references: dict[float, Reference]) -> None:
    """Error 1e-8 with at most 150 tangents, and at most twice those of ε = 0.3."""
    counts = {}
    for epsilon in (0.3, 1e-3, 1e-4):
        found = stiff.attempt(COLLOCATION, epsilon, 1e-8, references[epsilon])
        assert found.error <= 1e-8
        assert found.tangents is not None
        counts[epsilon] = found.tangents
    assert counts[0.3] < 70
    assert counts[1e-3] < 80
    assert counts[1e-4] < 2 * counts[0.3]


def test_far_fewer_than_backward_differences(references: dict[float, Reference]) -> None:
    ours = stiff.attempt(COLLOCATION, 0.3, 1e-5, references[0.3])
    others = stiff.attempt(DIFFERENCES, 0.3, 1e-4, references[0.3])
    assert ours.error < others.error
    assert ours.tangents is not None and others.tangents is not None
    assert 3 * ours.tangents < others.tangents


def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert optional.left_out(["numpy"]) == ""
    line = optional.left_out(["numpy", "not_a_module"])
    assert line == "Left out, not installed: not_a_module (pip install 'anmstrip[peers]')."


@pytest.mark.slow
def test_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the peers that need to be installed: they are named, the rest is there."""
    monkeypatch.setattr(optional, "find_spec", lambda module: None)
    result = CliRunner().invoke(main, ["study", "stiff", "--quick", "-o", str(tmp_path)])
    assert result.exit_code == 0, result.output
    names = ["stiff.csv", "stiff.md", "stiff_seconds.png", "stiff_tangents.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    report = (tmp_path / "stiff.md").read_text(encoding="utf-8")
    assert "anmstrip study stiff --quick" in report
    assert "Left out, not installed: sksundae, heyoka" in report
    assert report.count("\n## ") == 3
    with (tmp_path / "stiff.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    methods = {row["method"] for row in rows}
    assert methods == {m.name for m in METHODS if not m.module}
    assert {row["epsilon"] for row in rows} == {"0.3", "0.01"}
    assert all(float(row["error"]) < 1e-2 for row in rows)
