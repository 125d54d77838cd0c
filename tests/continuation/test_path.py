"""Branches, paths and Hermite paths against the functions that they stand for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anmstrip.continuation.path import Branch, Path


def branch(u, control, length):
    u = np.array(u, dtype=float)
    return Branch(u.reshape(len(u), -1), np.array(control, dtype=float), length, np.zeros(1))


def test_values_and_directions():
    b = branch([1.0, 2.0, 3.0], [0.0, 1.0, -1.0], 0.5)
    assert b.order == 2
    state, control = b(0.2)
    assert (state[0], control) == pytest.approx((1.0 + 0.4 + 0.12, 0.2 - 0.04), rel=1e-15)
    slope, rate = b.direction(0.2)
    assert (slope[0], rate) == pytest.approx((2.0 + 1.2, 1.0 - 0.4), rel=1e-15)
    assert b.end[1] == 0.25
    assert b.cut(0.1).end[0][0] == b(0.1)[0][0]
    assert b.length == 0.5


@settings(max_examples=60, deadline=None)
@given(
    first=st.floats(0.01, 0.99),
    gap=st.floats(0.05, 2.0),
    length=st.sampled_from([1e-7, 0.3, 1.0, 1e6]),
    order=st.integers(2, 20),
)
def test_first_crossing_to_the_last_digits(first, gap, length, order):
    """control − 5 = (x − first)(x − first − gap) (1 + x/4)^…, x = a / length."""
    polynomial = np.polynomial.polynomial.polyfromroots([first, first + gap])
    for _ in range(order - 2):
        polynomial = np.polynomial.polynomial.polymul(polynomial, [1.0, 0.25])
    c = polynomial / length ** np.arange(order + 1)
    c[0] += 5.0
    b = branch(np.ones(order + 1), c, length)
    found = b.reaches(5.0)
    assert found is not None
    assert found == pytest.approx(first * length, rel=1e-11)


def test_what_is_behind_or_beyond_is_not_reached():
    b = branch([0.0, 1.0], [2.0, 1.0], 0.5)
    assert b.reaches(1.9) is None
    assert b.reaches(2.0) is None
    assert b.reaches(2.6) is None
    assert b.reaches(2.5) == 0.5
    assert branch([0.0, 1.0], [2.0, 0.0], 0.5).reaches(2.0) is None


@pytest.mark.parametrize("at", [1e-3, 0.3, 0.499])
def test_fold_is_where_the_control_turns(at):
    b = branch([0.0, 1.0, 0.0], [0.0, 2.0 * at, -1.0], 0.5)
    assert b.folds == pytest.approx([at], rel=1e-12)
    assert b.cut(0.9 * at).folds == []
    assert branch([0.0, 1.0], [0.0, 1.0], 0.5).folds == []


def test_high_orders_that_underflow_are_harmless():
    c = np.zeros(41)
    c[1], c[2:] = 1.0, 1e-300
    assert branch(c, c, 1e-8).reaches(0.5e-8) == pytest.approx(0.5e-8, rel=1e-14)


def sine_path(pieces=5, order=15):
    """u = (sin s, cos s), control = s over [0, 2], Taylor pieces."""
    k = np.arange(order + 1)
    factorial = np.cumprod([1.0, *k[1:]])
    starts = np.linspace(0.0, 2.0, pieces + 1)[:-1]
    branches = []
    for s in starts:
        u = np.stack([np.sin(s + k * np.pi / 2), np.cos(s + k * np.pi / 2)], axis=1)
        control = np.zeros(order + 1)
        control[:2] = s, 1.0
        branches.append(Branch(u / factorial[:, None], control, 2.0 / pieces, np.zeros(2)))
    return Path(tuple(branches))


def test_path_is_the_function_it_was_made_from():
    path = sine_path()
    np.testing.assert_allclose(path.knots, np.linspace(0.0, 2.0, 6), rtol=1e-15)
    for s in (0.0, 0.1, 0.4, 1.1, 1.999, 2.0):
        expected = [np.sin(s), np.cos(s)]
        np.testing.assert_allclose(path.at(s)[0], expected, atol=1e-14)
        np.testing.assert_allclose(path(s), expected, atol=1e-13)
        assert path.at(s)[1] == pytest.approx(s, abs=1e-15)


def test_control_that_is_not_reached():
    with pytest.raises(ValueError, match="does not reach"):
        sine_path()(2.5)
    with pytest.raises(ValueError, match="does not reach"):
        Path(())(0.0)
