"""Branches against the equations that define them."""

import numpy as np
import pytest
from dense import DenseEquations, coupled, one

from anmstrip.continuation.expansion import Parameter, expand, guessed_range
from anmstrip.continuation.path import Cost, inner, size
from anmstrip.linalg.direct import SingularTangentError
from anmstrip.linalg.solvers import DenseSolver


def branch_of(equations, u, control=0.0, order=10, parameter=None, **options):
    return expand(
        equations,
        np.asarray(u, dtype=float),
        control,
        order=order,
        solver=DenseSolver(),
        parameter=parameter or Parameter(1.0),
        **options,
    )


PARAMETERS = {"control": Parameter(0.7), "arclength": Parameter(0.7, arclength=True)}


@pytest.mark.parametrize("order", [4, 9, 14])
@pytest.mark.parametrize("name", PARAMETERS)
def test_residual_grows_with_the_power_after_the_last_order(order, name):
    equations = DenseEquations(coupled)
    branch = branch_of(equations, [0.0, 0.0], order=order, parameter=PARAMETERS[name])
    far = 0.5 if order > 4 else 0.2
    errors = [equations.imbalance(equations.residual(*branch(a))) for a in (far, 0.8 * far)]
    assert errors[1] > 1e-14
    slope = np.log(errors[0] / errors[1]) / np.log(1.0 / 0.8)
    assert slope == pytest.approx(order + 1, abs=0.8)


def test_coefficients_of_a_known_solution():
    branch = branch_of(one(lambda u, control: np.exp(u) - 1.0 - control), [0.0], order=12)
    k = np.arange(1, 13)
    np.testing.assert_allclose(branch.u[1:, 0], (-1.0) ** (k + 1) / k, rtol=1e-12)
    np.testing.assert_array_equal(branch.control[:2], [0.0, 1.0])
    assert not branch.control[2:].any()


@pytest.mark.parametrize("scale", [0.3, 2.0])
@pytest.mark.parametrize("forward", [None, (np.zeros(2), 1.0), (np.zeros(2), -1.0)])
def test_arclength_identity(scale, forward):
    equations = DenseEquations(coupled, length=10.0)
    parameter = Parameter(scale, arclength=True, forward=forward)
    branch = branch_of(equations, [0.0, 0.0], order=12, parameter=parameter)
    u, control = branch.direction(0.0)
    assert inner(equations, u, u) + control**2 == pytest.approx(scale**2, rel=1e-13)
    sense = -1.0 if forward is not None and forward[1] < 0.0 else 1.0
    assert np.sign(control) == sense
    for a in (0.1, 0.4, 1.0):
        state, value = branch(a)
        along = inner(equations, u, state - branch.u[0]) + control * (value - branch.control[0])
        assert along / scale == pytest.approx(scale * a, rel=1e-12)


def test_sense_follows_the_unknowns_at_a_fold():
    """At λ = 0 of λ = 1 − u² with u' given, the control turns back but u goes on."""
    equations = one(lambda u, control: u * u + control - 1.0)
    forward = (np.array([-1.0]), 0.0)
    branch = branch_of(
        equations, [1e-3], 1.0 - 1e-6, parameter=Parameter(0.1, arclength=True, forward=forward)
    )
    assert branch.direction(0.0)[0][0] < 0.0
    assert branch.cut(0.1).folds == pytest.approx([1e-2], rel=1e-3)


@pytest.mark.parametrize("order", [9, 10, 19, 20])
def test_range_of_an_odd_function_looks_at_two_orders(order):
    equations = one(lambda u, control: u + u**3 - control)
    branch = branch_of(equations, [0.0], order=order)
    last = branch.u[order - 1 + order % 2]
    assert last[0] != 0.0
    np.testing.assert_array_equal(branch.u[2::2], 0.0)
    reach, _ = guessed_range(equations, branch, 1e-8, np.inf)
    assert 0.0 < reach < 0.4
    assert equations.imbalance(equations.residual(*branch(reach))) < 1e-7


def test_series_that_ends_has_no_finite_range():
    equations = DenseEquations(lambda u, control: 2.0 * u - control)
    branch = branch_of(equations, [0.0], order=20, parameter=Parameter(1.0, 1.0), tolerance=1e-6)
    assert branch.order < 6
    assert guessed_range(equations, branch, 1e-6, 7.0) == (7.0, 7.0)
    assert branch(1.0)[0][0] == 0.5


@pytest.mark.parametrize("law", [lambda u, control: 2.0 * u - control, coupled])
@pytest.mark.parametrize("arclength", [False, True])
def test_unlimited_reach_gives_no_warning(law, arclength):
    unknowns = 2 if law is coupled else 1
    parameter = Parameter(1.0, arclength=arclength)
    branch = branch_of(
        DenseEquations(law), np.zeros(unknowns), order=8, parameter=parameter, tolerance=1e-6
    )
    assert np.isfinite(branch.u).all()


@pytest.mark.parametrize("reach", [1.0, 3.0])
def test_initial_imbalance_is_carried_and_gone_at_the_end(reach):
    equations = DenseEquations(coupled)
    start = [0.02, -0.03]
    parameter = Parameter(0.2, reach)
    branch = branch_of(equations, start, order=16, parameter=parameter, tolerance=1e-8)
    assert branch.carried_over == reach
    initial = equations.residual(np.array(start), 0.0)
    assert np.abs(initial).max() > 1e-2
    for a in (0.0, 0.3, 0.9):
        expected = initial * (1.0 - a / reach)
        np.testing.assert_allclose(equations.residual(*branch(a)), expected, atol=1e-11)
    if reach == 1.0:
        assert equations.imbalance(equations.residual(*branch(reach))) < 1e-9


@pytest.mark.parametrize(("relaxation", "carried_over"), [(0.0, 1.0), (0.01, 1.0), (0.5, 10.0)])
def test_small_imbalance_goes_as_slowly_as_is_asked_for(relaxation, carried_over):
    equations = DenseEquations(coupled)
    parameter = Parameter(0.05, 5.0, relaxation=relaxation)
    branch = branch_of(equations, [1e-9, 0.0], order=12, parameter=parameter, tolerance=1e-6)
    assert branch.carried_over == pytest.approx(carried_over)
    left = equations.imbalance(equations.residual(*branch(1.0)))
    assert left == pytest.approx(1e-9 * (1.0 - 1.0 / carried_over), abs=1e-12)


@pytest.mark.parametrize("order", [20, 40])
@pytest.mark.parametrize("radius", [1e-8, 1e-3, 1.0, 1e8])
def test_no_coefficient_overflows(order, radius):
    """λ/radius is the natural variable, whatever the scale that a = 1 stands for."""
    equations = one(lambda u, control: u - 1.0 / (1.0 - control * (1.0 / radius)))
    for reach in (1.0, 1e9):
        branch = branch_of(
            equations, [1.0], order=order, parameter=Parameter(1.0, reach), tolerance=1e-6
        )
        assert np.isfinite(branch.u).all()
        assert branch.order >= 2
        assert np.isfinite(size(equations, branch.u[-1]))


def test_one_factorisation_and_one_solve_per_order():
    cost = Cost()
    branch_of(DenseEquations(coupled), [0.0, 0.0], order=15, cost=cost)
    assert (cost.expansions, cost.factorisations) == (1, 1)
    assert cost.solves == 1 + 14
    assert set(cost.seconds) == {"series", "tangent", "factorisation", "back-substitution"}


def test_singular_start_is_named():
    with pytest.raises(SingularTangentError):
        branch_of(one(lambda u, control: u * u - control), [0.0])
