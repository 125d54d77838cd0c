"""Strips that wrinkle before a roller: onset, imperfection, friction."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anmstrip.driver.explain import explain
from anmstrip.results.wrinkles import buckling, free_spans
from harness import run
from roller_wrinkles import (
    COARSE,
    CONES,
    EASED,
    LEVELS,
    SMOOTH,
    THICK,
    askew,
    likened,
    pulled,
    risen,
    study,
)
from wrinkling import Crowned, Mesh, Skewed, ended, onset, onsets

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_slight_crown_leaves_the_strip_smooth():
    with pytest.raises(ValueError, match="stays smooth"):
        onset(Crowned(1e-5, 2e4, Mesh((6, 4), 0.03)).eased(1.9e4))


@pytest.mark.slow
def test_strip_that_is_wrinkled_when_threaded_is_refused():
    with pytest.raises(ValueError, match="before the last stage"):
        onset(Crowned(8e-4, 1.2e4, SMOOTH.mesh).eased(1e4))


def test_scenes_are_explained():
    """Before anything is solved."""
    for scene in (Crowned(8e-4, 2e4, COARSE).conveyed(0.05, 0.3), Skewed(5e-3, 1e4, COARSE)
                  .conveyed(0.04, 0.3)):  # fmt: skip
        assert "implicit in time" in explain(scene)


@pytest.mark.slow
def test_onset_grows_with_the_square_of_the_crown():
    """The compression grows with the crown, and √T with what the strip bears."""
    found = [(crown, onset(Crowned(crown, tension, COARSE).eased(end)))
             for crown, tension, end in EASED[:2]]  # fmt: skip
    low, high = (point.tension / crown**2 for crown, point in found)
    assert high == pytest.approx(low, rel=0.03)
    for _, point in found:
        assert point.wavelengths[1] == pytest.approx(point.formula, rel=0.08)
        for span in free_spans(point.state):
            assert 0.8 < span.mean / span.bearable < 0.95


@pytest.mark.slow
def test_meshes_agree_on_the_onset():
    crown, tension, end = EASED[1]
    coarse, fine = (onset(Crowned(crown, tension, mesh).eased(end))
                    for mesh in (COARSE, Mesh((16, 16), 7.5e-3)))  # fmt: skip
    assert coarse.tension == pytest.approx(fine.tension, rel=0.05)
    assert fine.wavelengths[1] == pytest.approx(fine.formula, rel=0.03)


@pytest.mark.slow
def test_onset_from_below_hardly_depends_on_the_profile():
    """Where the strip lies on the middle alone; over a lesser crown it never wrinkles."""
    cases = [(1.4e-3, None), (2e-3, None), (1.6e-3, CONES)]
    found = [risen(Crowned(crown, 2.5e3, COARSE, THICK, flat), 1e4) for crown, flat in cases]
    tensions = [point.tension for point in found if point is not None]
    assert tensions == pytest.approx([5500.0] * 3, rel=0.04)
    assert risen(Crowned(1e-3, 2.5e3, COARSE, THICK), 1e4) is None


@pytest.mark.slow
def test_imperfect_strip_grows_by_what_its_compression_lacks():
    """Height a s / (1 − 1/μ), with the share s of bending in what resists the mode.

    Tension resists the height itself, bending what is added to the imperfection.
    """
    crown, tension, _ = EASED[1]
    case, amplitude = Crowned(crown, tension, COARSE), 1e-3 * Crowned.thickness
    perfect = ended(case.eased(tension))
    (factor,), modes = buckling(perfect.state, 1)
    assert 1.05 < factor < 1.3
    plan = perfect.state.plan
    mode = plan.supports.change(modes[:, 0], 0.0)  # of unit energy
    bending = next(effect for effect in plan.model.effects if effect.name == "bending")
    share = mode @ bending.force(mode, None, {})
    assert 0.4 < share < 0.5
    bent = ended(case.eased(tension, imperfection={"mode": 1, "amplitude": amplitude}))
    change = (bent.state.full - perfect.state.full).reshape(-1, 3)[plan.model.strip.node_values]
    height = np.linalg.norm(change, axis=1).max()
    assert height == pytest.approx(amplitude * share / (1.0 - 1.0 / factor), rel=0.05)


@pytest.mark.slow
def test_friction_on_a_crown_compresses_more_and_keeps_symmetry():
    case = SMOOTH
    smooth, rubbed = ended(case.eased(case.tension)), ended(case.conveyed(0.06, 0.3))
    before, rubbing = (found.wrinkling.spans[-1].compression for found in (smooth, rubbed))
    assert rubbing > 1.3 * before
    assert smooth.lean < 1e-6
    assert rubbed.lean < 1e-6


@pytest.mark.slow
def test_roller_out_of_line_compresses_only_what_sticks():
    case = Skewed(5e-3, 1e4, Mesh((10, 8), 2e-2))
    smooth, rubbed = ended(case.conveyed(0.02, 0.0)), ended(case.conveyed(0.02, 0.3))
    assert smooth.wrinkling.warnings == []
    assert smooth.wrinkling.compression < 0.2 * smooth.wrinkling.spans[0].bearable
    assert "between the entry and r1" in rubbed.wrinkling.warnings[0]
    assert rubbed.wrinkling.compression > rubbed.wrinkling.spans[0].bearable


@pytest.mark.slow
def test_friction_lowers_the_onset_which_falls_with_the_crown():
    """Of a strip that is pulled harder and harder while it runs."""
    tensions = []
    for crown, friction in ((1.2e-3, 0.0), (1.2e-3, 0.3), (1.6e-3, 0.3)):
        (found,) = onsets(pulled(replace(SMOOTH, crown=crown), friction), LEVELS[:1])
        tensions.append(found.tension)
    smooth, rubbed, higher = tensions
    assert rubbed < 0.95 * smooth
    assert higher < 0.9 * rubbed


@pytest.mark.slow
def test_friction_raises_the_wrinkles_before_a_crown():
    case = replace(SMOOTH, crown=1.2e-3)
    smooth, rubbed = (ended(pulled(case, friction)) for friction in (0.0, 0.3))
    assert rubbed.outcome.done
    assert rubbed.lean < 1e-6
    assert rubbed.heights[-1] > 1.3 * smooth.heights[-1]


@pytest.mark.slow
def test_roller_out_of_line_wrinkles_what_sticks_below_a_tension():
    """That grows with the yaw; askew towards where the strip is carried; 0.1 m apart."""
    tensions = []
    for yaw in (5e-3, 1e-2):
        case = Skewed(yaw, 2e4, Mesh((10, 8), 2e-2))
        found, way = askew(case, 0.3)
        tensions.append(likened(2e4, way))
        wave, angle = found.crests
        assert found.place == "the entry to r1"
        assert found.count >= 4
        assert wave == pytest.approx(0.1, rel=0.1)
        assert -0.2 < angle < -0.05
    assert 2.0 < tensions[1] / tensions[0] < 3.0
    assert buckling(ended(case.conveyed(0.0, 0.0)).state, 1)[0][0] > 10.0


@pytest.mark.slow
def test_study_writes_its_report(tmp_path):
    report = run(study, quick=True, directory=tmp_path)
    assert [sheet.title for sheet in report.sheets] == [
        "Onset by crown", "Onset as the tension rises", "Friction on a crown",
        "A roller out of line", "Onset out of line with friction",
    ]  # fmt: skip
    for name in ("roller_wrinkles.png", "roller_wrinkles_askew.png"):
        assert (tmp_path / name).stat().st_size > 10_000


@pytest.mark.slow
def test_example(tmp_path, capsys):
    functions = runpy.run_path(str(EXAMPLES / "roller_wrinkles.py"))
    functions["crowned"]((12, 12), 1e-2)
    functions["skewed"]((8, 6), 2e-2, 0.01, tmp_path)
    assert "by the formula" in capsys.readouterr().out
    assert (tmp_path / "picture.png").exists()
