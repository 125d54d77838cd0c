"""Strain and curvature that make no stress: heat, rolled-in flatness, camber and coil set."""

from dataclasses import replace

import numpy as np
import pytest

from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import l2_projection, quadrature_points
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.effects import Controls, RecordedLaws, series_of
from anmstrip.mechanics.shell import KirchhoffLove, Membrane, eigenstrain
from levels import random_unknowns, strip_of

ALPHA = 1.2e-5


def heated(level):
    plain = strip_of(level)
    material = replace(plain.material, expansion=ALPHA)
    return Strip(plain.mesh, plain.thickness, material, plain.kinematics, plain.width)


def field(strip, function):
    """A control: values at the quadrature points from those of x and y."""
    return function(*quadrature_points(strip)[:2])


@pytest.mark.parametrize("level", ["section", "shell"])
def test_free_expansion_makes_no_force(level):
    strip = heated(level)
    membrane, warm = Membrane(strip), {"strip.temperature": field(strip, lambda x, y: 80.0 + 0 * x)}
    grown = ALPHA * 80.0 * quadrature_points(strip) * np.array([[1.0], [1.0], [0.0]])
    full = l2_projection(strip, Pattern(strip), grown)
    assert np.abs(membrane.at(full)).max() > 0.5 * strip.tensile_stiffness * ALPHA * 80.0
    assert np.abs(membrane.at(full, warm)).max() < 1e-12 * strip.tensile_stiffness


def test_held_strip_is_compressed_by_its_heat():
    strip = heated("section")
    warm = {"strip.temperature": field(strip, lambda x, y: 50.0 + 0 * x)}
    force = Membrane(strip).at(np.zeros(strip.unknowns), warm)
    longer = ALPHA * 50.0
    expected = -strip.tensile_stiffness * (longer + 0.5 * longer**2)
    assert force == pytest.approx(expected, rel=1e-12)


def test_parts_add_up():
    """E⁰ = e + ½ e² of e = α ΔT δ + (ε⁰ − κ⁰ y) e_x ⊗ e_x."""
    strip = heated("shell")
    y = field(strip, lambda x, y: y)
    controls = {"strip.temperature": 10.0 * y, "strip.flatness": 1e-4 * y**2}
    controls["strip.camber"] = -2e-3 * y
    found = eigenstrain(strip, controls)
    heat = ALPHA * 10.0 * y
    stretch = 1.0 + heat + 1e-4 * y**2 - 2e-3 * y
    np.testing.assert_allclose(found[0, 0], 0.5 * (stretch**2 - 1.0), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found[1, 1], heat * (1.0 + 0.5 * heat), rtol=1e-12)
    assert not found[0, 1].any()
    assert eigenstrain(strip, {"exit.force": np.zeros(3)}) is None


def test_orders_of_a_field_that_moves_are_those_of_the_force():
    """Of degree 2 in the field beside a state that stands still."""
    strip = heated("shell")
    membrane, full = Membrane(strip), random_unknowns(strip, np.random.default_rng(0))
    y = field(strip, lambda x, y: y)
    controls = Controls({"strip.temperature": 5.0 * y}, {"strip.temperature": 40.0 * y**2})
    series = series_of(membrane, 3, (full, None, 0.25), controls, RecordedLaws(len(full)))
    start, end = (membrane.force(full, None, controls.at(at)) for at in (0.25, 1.25))
    scale = np.abs(end).max()
    assert series.residual() == pytest.approx(start, abs=1e-12 * scale)
    found = series.derivative(np.zeros_like(full), None, 1.0)
    assert found == pytest.approx(end - start, abs=1e-12 * scale)


def test_stages_share_programs_of_the_same_controls_alone():
    """One that brings heat, or is without it again, has its own."""
    strip = heated("section")
    membrane, full = Membrane(strip), random_unknowns(strip, np.random.default_rng(0))
    heat, cold = field(strip, lambda x, y: 50.0 + 0.0 * x), {"gravity": np.zeros(3)}
    laws, warm = RecordedLaws(len(full)), {"strip.temperature": heat}
    for slope in ({}, warm):
        for controls in (Controls(cold), Controls(cold | warm, slope), Controls(cold)):
            series = series_of(membrane, 3, (full, None, 0.0), controls, laws)
            expected = membrane.force(full, None, controls.at(0.0))
            scale = np.abs(expected).max()
            assert series.residual() == pytest.approx(expected, abs=1e-12 * scale)


@pytest.mark.parametrize("level", ["section", "shell"])
def test_coil_set_is_the_curvature_without_moment(level):
    """Its sign is that of results: positive where the top is the longer side."""
    strip, curvature = strip_of(level), 0.4
    bending, angle = KirchhoffLove(strip), 0.3
    derivatives = np.zeros((3, 5, 1))
    derivatives[:, 0, 0] = np.cos(angle), 0.0, -np.sin(angle)
    derivatives[1, 1] = 1.0
    derivatives[:, 2, 0] = -curvature * np.array([np.sin(angle), 0.0, np.cos(angle)])
    if level == "section":
        derivatives = derivatives[[0, 2]][:, [0, 2]]

    def moment(controls):
        law = bending.law(derivatives - bending.reference, None, controls)
        return np.abs(law[:, bending.directions]).max()

    set_to = {"strip.coil_set": np.array(curvature)}
    assert moment(set_to) < 1e-12 * moment({})
    assert moment({"strip.coil_set": np.array(-curvature)}) == pytest.approx(2.0 * moment({}))
    bowed = moment(set_to | {"strip.crossbow": np.array(curvature)})
    assert bowed == pytest.approx(moment({}) * (0.3 if level == "shell" else 0.0), abs=1e-9)
