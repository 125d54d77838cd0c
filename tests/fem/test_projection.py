"""Best fit on the strip's own functions."""

import numpy as np
import pytest

from anmstrip.fem.operators import CellOperator, Pattern
from anmstrip.fem.sampling import l2_projection, quadrature_points
from levels import XS, random_unknowns, strip_of


@pytest.mark.parametrize("level", ["shell", "section", "plate"])
@pytest.mark.parametrize("far", [0.0, 1e3])
def test_own_functions_are_found_again(level, far):
    strip = strip_of(level, xs=XS + far)
    full = random_unknowns(strip, 1)
    displacement = strip.kinematics.embed(CellOperator(strip, (0, 1)).apply(full)[:, 0])
    found = l2_projection(strip, Pattern(strip), displacement)
    units = np.repeat(strip.dof_lengths, strip.count)
    np.testing.assert_allclose(found / units, full / units, atol=1e-7 if far else 1e-11)


def test_components_that_are_not_unknown_are_left_out():
    strip = strip_of("section")
    at = quadrature_points(strip)
    found = l2_projection(strip, Pattern(strip), np.stack([0.0 * at[0], 1.0 + at[0], 0.0 * at[0]]))
    assert np.abs(found).max() < 1e-15
    found = l2_projection(strip, Pattern(strip), np.stack([2.0 * at[0], at[0], 3.0 + at[0]]))
    values = found.reshape(-1, 2)[strip.dofs("u")]
    x = strip.mesh.p[0]
    np.testing.assert_allclose(values, np.stack([2.0 * x, 3.0 + x], axis=1), atol=1e-12)


def test_fit_converges_with_the_fourth_power_of_the_element():
    errors = []
    for cells in (8, 16, 32):
        strip = strip_of("section", xs=np.linspace(-0.5, 0.5, cells + 1))
        at = quadrature_points(strip)
        wave = np.stack([0.0 * at[0], 0.0 * at[0], np.sin(5.0 * at[0])])
        fit = CellOperator(strip, (0, 1)).apply(l2_projection(strip, Pattern(strip), wave))[1, 0]
        errors.append(np.abs(fit - wave[2]).max())
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(rates, 4.0, atol=0.5)


@pytest.mark.parametrize("level", ["shell", "section"])
def test_quadrature_points_lie_on_the_strip(level):
    strip = strip_of(level)
    at = quadrature_points(strip)
    assert at.shape == (3, CellOperator(strip, (0, 1)).points)
    assert not at[2].any()
    weights = CellOperator(strip, (0, 1)).weights
    assert weights @ at[0] == pytest.approx(0.0, abs=1e-12)
    assert weights.sum() == pytest.approx(strip.length * strip.width)
