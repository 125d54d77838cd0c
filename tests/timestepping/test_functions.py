"""Plain residual functions as equations."""

import numpy as np
import pytest

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import inner
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.timestepping.formulas import AffineVelocity
from anmstrip.timestepping.index_one import FunctionRateEquations
from function_equations import FunctionEquations


def cubic(u, load):
    """With the solution u₀ = u₁ = load."""
    return np.stack([u[0] + u[1] * u[1] * u[1] - load - load * load * load, u[0] - u[1]])


@pytest.mark.parametrize("tolerance", [1e-6, 1e-12])
def test_a_path_meets_its_equations_everywhere(tolerance):
    equations = FunctionEquations(cubic)
    settings = Settings(order=15, tolerance=tolerance)
    steps = list(
        follow(equations, np.zeros(2), solver=DenseSolver(), settings=settings, target=3.0)
    )
    assert steps
    for step in steps:
        for part in (0.5, 1.0):
            u, load = step.branch(part * step.branch.length)
            assert u == pytest.approx([load, load], abs=tolerance)


def test_scales_are_units():
    equations = FunctionEquations(cubic, scale=2.0, force=10.0)
    assert inner(equations, np.array([2.0, 4.0]), np.array([2.0, 0.0])) == 1.0
    assert equations.imbalance(np.array([1.0, -5.0])) == 0.5


def test_a_residual_is_measured_by_the_change_of_u_that_takes_it_away():
    problem = FunctionRateEquations(lambda u, v, t: v * 2.0 + u * 30.0 - t, whole=4.0)
    step = problem.during(1.0, 0.2, AffineVelocity(5.0, np.zeros(1), np.zeros(1)), np.zeros(1))
    step.recurrence(np.zeros(1), 0.0, 3)
    assert step.imbalance(np.array([8.0])) == pytest.approx(8.0 / 40.0 * 4.0 / 0.2)
    assert step.residual(np.array([1.0]), 0.5) == pytest.approx([10.0 + 30.0 - 1.1])


def test_in_fast_motion_an_error_is_a_shift_in_time():
    problem = FunctionRateEquations(lambda u, v, t: v, whole=4.0, speed=2.0)
    problem.during(0.0, 0.1, AffineVelocity(0.0, np.array([2e6]), np.zeros(1)), np.zeros(1))
    assert problem.error(np.zeros(1), np.array([3.0])) == pytest.approx(3e-6)
