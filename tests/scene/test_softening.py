"""Threading with contact as stiff as one likes: the guess comes to rest on softer contact first."""

import numpy as np
import pytest

from anmstrip.mechanics.contact import Contact
from anmstrip.scene.build import Assembly
from anmstrip.scene.softening import FACTOR, FELT, softened
from anmstrip.scene.stages import Course
from anmstrip.studies.comparisons import Finished
from anmstrip.studies.strips import RADIUS, threaded


def stiffnesses(stiffer):
    """Of the softened models of a capstan, and of its own contact."""
    scene = threaded("section", 1, 0.1, 1e-3, stiffer=stiffer)
    assembly = Assembly(scene)
    model = Course(assembly).plan(scene.course[0], {}).model
    own = [
        [e.signorini.stiffness for e in m.effects if isinstance(e, Contact)]
        for m in (*softened(model, RADIUS), model)
    ]
    assert all(len(found) == 1 for found in own)
    return [found[0] for found in own]


def test_soft_contact_is_left_alone():
    assert stiffnesses(1.0) == [1e10]


def test_stiff_contact_is_approached_by_steps():
    """From 25 E t/R² on, by a factor of a hundred."""
    felt = FELT * 2.0e8 / RADIUS**2
    assert stiffnesses(1e4) == pytest.approx([felt, FACTOR * felt, 1e14])


@pytest.mark.parametrize("stiffer", [1.0, 1e2, 1e4])
def test_capstan_of_any_stiffness(stiffer):
    """Full slip: the capstan formula, here 1.2510 within 2e-4, in a few dozen tangents."""
    finished = Finished.of(threaded("section", 2, 0.05, 1e-3, stiffer=stiffer))
    ratio = finished.run.state.rollers["r1"].tension_ratio
    assert ratio == pytest.approx(1.25094, rel=2e-4)
    assert finished.run.cost.factorisations <= 60
    assert np.isfinite(finished.run.march.full).all()
