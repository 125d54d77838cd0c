"""A stretched sheet: where it wrinkles, how, and with an imperfection."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from anmstrip.continuation.bifurcations import Kind
from anmstrip.continuation.follow import follow
from anmstrip.continuation.path import Cost
from anmstrip.linalg.solvers import SparseSolver
from harness import run
from wrinkles import CHOICES, LENGTH, THIN, Stretched, imperfect, onset, sheet_of, study, wrinkled

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def buckled():
    """A sheet, its onset, and the states of its wrinkled path."""
    sheet = sheet_of(THIN, (14, 18))
    point, cost = onset(sheet), Cost()
    return sheet, point, list(wrinkled(sheet, point, cost)), cost


def test_flat_sheet_bifurcates(buckled):
    sheet, point, _, _ = buckled
    assert point.kind is Kind.BIFURCATION
    assert (point.before, point.after) == (0, 1)
    assert point.control * sheet.strain == pytest.approx(0.00235, rel=0.01)
    lifted = sheet.equations.supports.full(point.u, point.control).reshape(-1, 3)[:, 2]
    assert np.abs(lifted).max() < 1e-9
    mode = sheet.equations.supports.change(point.mode, 0.0).reshape(-1, 3)
    assert np.abs(mode[:, :2]).max() < 1e-6 * np.abs(mode[:, 2]).max()


def test_wavelength_is_that_of_the_formula(buckled):
    """With the wrinkles' own length within 4 %; with that between the grips 15 % at the end."""
    sheet, point, states, cost = buckled
    assert cost.factorisations < 40
    u, control = states[-1]
    assert control == pytest.approx(1.0, rel=1e-14)
    for state, height, share in ((point.u, point.mode, point.control), (u, u, control)):
        wave, length = sheet.wavelength(height), sheet.wrinkled_length(height)
        assert 0.69 * LENGTH < length < LENGTH
        assert wave == pytest.approx(sheet.formula(state, share, length), rel=0.04)
    assert wave == pytest.approx(sheet.formula(u, control), rel=0.15)
    assert sheet.amplitude(u) == pytest.approx(13.1 * sheet.thickness, rel=0.05)


@pytest.mark.slow
def test_imperfect_sheet_ends_on_the_wrinkled_path(buckled):
    sheet, point, states, _ = buckled
    heights = []
    for share in (1e-2, 1e-1):
        bent = imperfect(sheet, point, share * sheet.thickness)
        steps = list(follow(bent.equations, bent.start, solver=SparseSolver(),
                            settings=CHOICES))  # fmt: skip
        heights.append(bent.amplitude(steps[-1].branch.end[0]))
        assert np.diff([step.branch.end[1] for step in steps]).min() > 0.0
    perfect = sheet.amplitude(states[-1][0])
    errors = [abs(height / perfect - 1.0) for height in heights]
    assert errors[0] < 0.01
    assert errors[1] < 0.03


def test_imperfection_makes_no_stress_of_its_own(buckled):
    sheet, point, _, _ = buckled
    bent = imperfect(sheet, point, sheet.thickness)
    residual = bent.equations.residual(bent.start, 0.0)
    flattened = bent.equations.residual(0.0 * bent.start, 0.0)
    assert np.abs(residual).max() < 1e-12 * np.abs(flattened).max()
    assert bent.amplitude(bent.start) == pytest.approx(sheet.thickness, rel=1e-12)


def test_thick_sheet_stays_flat():
    with pytest.raises(ValueError, match="stays flat"):
        onset(Stretched(0.02, 0.01, (4, 4)))


@pytest.mark.slow
def test_study_writes_its_report(tmp_path):
    run(study, quick=True, directory=tmp_path)
    report = (tmp_path / "wrinkles.md").read_text(encoding="utf-8")
    assert report.count("\n## ") == 3


def test_example(tmp_path, capsys):
    runpy.run_path(str(EXAMPLES / "stretched_sheet.py"))["main"]((14, 18), tmp_path)
    assert "onset" in capsys.readouterr().out
    assert (tmp_path / "wrinkles.vtu").exists()
