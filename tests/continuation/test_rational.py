"""Branches as quotients: the same path, further on, and never across a pole."""

from types import SimpleNamespace

import numpy as np
import pytest
from dense import DenseEquations, followed

from anmstrip.continuation.expansion import (
    Parameter,
    as_quotient,
    coordinates,
    expand,
    longest_quotient,
)
from anmstrip.continuation.path import Branch, Cost
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.taylor.polynomials import roots_within

N = 20
STIFFNESS = 1.0 + np.arange(N) / N
LOAD = np.cos(np.arange(N))


def resonant(u, control):
    """u_i (c_i + λ²) = b_i λ: the series is limited by poles off the path."""
    return u * (STIFFNESS + control * control) - control * LOAD


def snapping(u, control):
    """A cubic that drags others along."""
    first = u[0] ** 3 - u[0] - control
    chain = [u[i] * STIFFNESS[i] + 0.2 * u[i] ** 3 - LOAD[i] * u[i - 1] for i in range(1, N)]
    return np.stack([first, *chain])


def expanded(equations, u, control=0.0, order=20, **choices):
    return expand(equations, np.asarray(u, dtype=float), control, order=order, solver=DenseSolver(),
                  parameter=Parameter(1.0, **choices))  # fmt: skip


def test_orders_are_those_of_the_series():
    """Coefficients of the quotient, by long division."""
    equations = DenseEquations(resonant)
    branch = expanded(equations, np.zeros(N), arclength=True).cut(1.0)
    quotient = as_quotient(equations, branch)
    d = quotient.denominator
    assert d[0] == 1.0
    for k in range(branch.order + 1):
        parts = [d[j] * branch.u[k - j] for j in range(min(k + 1, len(d)))]
        round_off = 1e-12 * np.abs(parts).max()
        np.testing.assert_allclose(quotient.u[k], sum(parts), rtol=0.0, atol=round_off)


def test_values_derivatives_and_turns_of_a_quotient():
    """u = a / (1 + a²), λ = (a − a²) / (1 + a²): λ turns at a = √2 − 1."""
    branch = Branch(np.array([[0.0], [1.0], [0.0]]), np.array([0.0, 1.0, -1.0]), 2.0, np.zeros(1),
                    denominator=np.array([1.0, 0.0, 1.0]))  # fmt: skip
    u, control = branch(0.5)
    assert (u[0], control) == (0.4, 0.2)
    direction, slope = branch.direction(0.5)
    assert direction[0] == pytest.approx((1 - 0.25) / 1.25**2)
    assert slope == pytest.approx((1 - 1.0 - 0.25) / 1.25**2)
    assert branch.folds == pytest.approx([np.sqrt(2.0) - 1.0], abs=1e-14)
    assert branch.reaches(0.2) == pytest.approx(1 / 3)
    assert branch.landed(-0.4001).end[1] == -0.4001


def start():
    """On the path of :func:`snapping` at λ = −0.528."""
    u = np.zeros(N)
    u[0] = -1.2
    for i in range(1, N):
        roots = np.roots([0.2, 0.0, STIFFNESS[i], -LOAD[i] * u[i - 1]])
        u[i] = roots.real[np.abs(roots.imag) < 1e-9][0]
    return u


def test_it_stops_before_a_pole():
    equations = DenseEquations(lambda u, control: u * (1.0 - control / STIFFNESS) - LOAD)
    branch = expanded(equations, LOAD)
    further, _ = longest_quotient(equations, branch, 1e-6, 50.0, Cost())
    assert further.length < 1.0
    assert not roots_within(further.denominator, further.length)


def test_it_does_not_leap_over_a_pole(monkeypatch):
    """Not even where both sides meet the tolerance: (1 − a/2) u / (1 − a/2)."""
    equations = DenseEquations(lambda u, control: u - control)
    u = np.zeros((5, 5))
    u[1] = 1.0
    branch = Branch(u, u[:, 0].copy(), np.inf, np.zeros(5), forces=(0.0, 16e-6))
    factor = np.array([1.0, -0.5, 0.0, 0.0, 0.0])
    product = np.convolve(factor, branch.control)[:5]
    candidate = Branch(np.tile(product[:, None], 5), product, 0.5, np.zeros(5), denominator=factor)
    monkeypatch.setattr("anmstrip.continuation.expansion.as_quotient", lambda *_: candidate)
    found, _ = longest_quotient(equations, branch, 1e-6, 10.0, Cost())
    assert 1.5 < found.length < 2.0


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e200])
def test_a_series_of_what_is_no_number_has_no_quotient(number):
    equations = DenseEquations(resonant)
    branch = expanded(equations, np.zeros(N))
    branch.u[7, 3] = number
    assert longest_quotient(equations, branch, 1e-6, np.inf, Cost()) is None


def test_a_series_that_arrives_needs_no_quotient():
    equations = DenseEquations(lambda u, control: u + u * u - control)
    branch, cost = expanded(equations, np.zeros(N)), Cost()
    assert longest_quotient(equations, branch, 1e-6, 0.1, cost) is None
    assert cost.residuals == 0


def path(order, choice, cost):
    choices = {"start": -0.528, "target": 20.0, "tolerance": 1e-9, "arclength": True}
    equations = DenseEquations(snapping)
    return followed(equations, start(), order=order, rational=choice, cost=cost, **choices)


@pytest.mark.parametrize("order", [10, 20])
def test_paths_need_fewer_tangents_and_meet_the_tolerance(order):
    """Everywhere inside as well as at the ends."""
    counts = []
    for choice in (False, True):
        steps = path(order, choice, cost := Cost())
        folds = [step.branch(a)[1] for step in steps for a in step.branch.folds]
        assert folds == pytest.approx([2 / 3**1.5, -2 / 3**1.5], abs=1e-7)
        u, control = steps[-1].branch.end
        assert control == pytest.approx(20.0, rel=1e-15)
        np.testing.assert_allclose(snapping(u, control), 0.0, atol=1e-9)
        counts.append(cost.factorisations)
    assert counts[1] < counts[0]
    assert any(step.branch.denominator[1:].any() for step in steps)
    for step in steps:
        for a in np.linspace(0.0, step.branch.length, 20):
            assert np.abs(snapping(*step.branch(a))).max() <= 1.01e-9


@pytest.mark.parametrize("unknowns", [5, 255, 256, 1000])
def test_coordinates_keep_inner_products(unknowns):
    """Of any number of unknowns, also of more than are orthogonalised at once."""
    rng = np.random.default_rng(2)
    u, control = rng.standard_normal((9, unknowns)), rng.standard_normal(9)
    branch = Branch(u, control, 1.0, np.zeros(unknowns))
    found = coordinates(SimpleNamespace(metric=2.0), branch)
    expected = 2.0 * u[1:] @ u[1:].T + np.outer(control[1:], control[1:])
    np.testing.assert_allclose(found @ found.T, expected, rtol=1e-12, atol=1e-12 * unknowns)
