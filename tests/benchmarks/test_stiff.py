"""The stiff sliding point: errors, counts, and what the study writes."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import harness
import stiff
from stiff import END, METHODS, scipys
from stiff_reference import Reference, pull


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


def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert harness.left_out(["numpy"]) == ""
    line = harness.left_out(["numpy", "not_a_module"])
    assert line == "Left out, not installed: not_a_module (pip install 'anmstrip[peers]')."


@pytest.mark.slow
def test_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the peers that need to be installed: they are named, the rest is there."""
    monkeypatch.setattr(harness, "find_spec", lambda module: None)
    harness.run(stiff.study, quick=True, directory=tmp_path)
    names = ["stiff.csv", "stiff.md", "stiff_seconds.png", "stiff_tangents.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    report = (tmp_path / "stiff.md").read_text(encoding="utf-8")
    assert "python examples/benchmarks/stiff.py --quick" in report
    assert "Left out, not installed: sksundae, heyoka" in report
    assert report.count("\n## ") == 3
    with (tmp_path / "stiff.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    methods = {row["method"] for row in rows}
    assert methods == {m.name for m in METHODS if not m.module}
    assert {row["epsilon"] for row in rows} == {"0.3", "0.01"}
    assert all(float(row["error"]) < 1e-2 for row in rows)
