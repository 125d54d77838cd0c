"""Growth of errors along a solution, and the control that uses it."""

import numpy as np
import pytest

from anmstrip.timestepping.index_one import (
    Point,
    estimate_error,
    integrate_controlled,
    integrate_explicitly,
    join_series,
)


def drift(rate):
    """u' = rate u: neighbours drift apart like exp(rate t)."""
    return lambda u, v, t: v - u * rate


def run(residual, tolerance, end=4.0, order=10):
    start = np.ones(1)
    return join_series(
        list(
            integrate_explicitly(
                residual, start, start, (0.0, end), order=order, tolerance=tolerance
            )
        )
    )


@pytest.mark.parametrize("rate", [-3.0, 2.0])
def test_the_growth_rate_of_a_linear_problem(rate):
    assert Point.at(drift(rate), np.ones(1), np.ones(1), 0.0).growth_rate == pytest.approx(rate)


def test_algebraic_unknowns_are_eliminated():
    def residual(u, v, t):
        return np.stack([v[0] - u[1], u[1] - u[0] * 5.0])

    assert Point.at(residual, np.ones(2), np.ones(2), 0.0).growth_rate == pytest.approx(5.0)


@pytest.mark.parametrize("rate", [-2.0, 2.0])
def test_the_estimate_is_the_error(rate):
    path = run(drift(rate), 1e-5)
    error = max(abs(path(t)[0][0] - np.exp(rate * t)) for t in path.knots)
    assert 0.3 * error < estimate_error(drift(rate), path).max() < 3.0 * error


def test_passes_are_repeated_until_the_error_is_below_the_tolerance():
    found = integrate_controlled(lambda allowed: run(drift(2.0), allowed), drift(2.0), 1e-5)
    error = max(abs(found.path(t)[0][0] - np.exp(2.0 * t)) for t in np.linspace(0.0, 4.0, 99))
    assert 2 <= found.passes <= 3
    assert error < found.error * 1.5
    assert found.error <= 1e-5


def test_one_pass_where_errors_fade():
    assert (
        integrate_controlled(lambda allowed: run(drift(-2.0), allowed), drift(-2.0), 1e-5).passes
        == 1
    )


def test_too_few_passes_are_told():
    found = integrate_controlled(
        lambda allowed: run(drift(2.0), 1e-3), drift(2.0), 1e-9, max_passes=2
    )
    assert found.error > 1e-9
