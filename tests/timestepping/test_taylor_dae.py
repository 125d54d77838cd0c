"""The explicit Taylor scheme on problems with known solutions."""

import numpy as np
import pytest

from anmstrip.continuation.path import Cost, PathStopped
from anmstrip.timestepping.index_one import (
    MAX_ERROR_RATE,
    Point,
    find_consistent_state,
    integrate_explicitly,
    join_series,
)


def decay(u, v, t):
    """u' = −u + cos t + … with the solution sin t."""
    return np.stack([v[0] + u[0] - np.cos(t) - np.sin(t)])


def pendulum_like(u, v, t):
    """Driven u₀ with u₀' = u₁, algebraic u₁ with u₁ + u₁³ = u₀ e^(−t) + …: u = (eᵗ, eᵗ)."""
    return np.stack([v[0] - u[1], u[1] * u[1] * u[1] + u[1] - u[0] * u[0] * u[0] - u[0]])


def turning(u, v, t):
    """On the circle |u| = 1 (algebraic, along u) at unit speed (driven, across)."""
    normal = u[0] * u[0] + u[1] * u[1] - 1.0
    along = u[0] * v[1] - u[1] * v[0] - 1.0
    return np.stack([normal * u[0] - along * u[1], normal * u[1] + along * u[0]])


def run(residual, u, end, **options):
    u = np.array(u, dtype=float)
    return join_series(list(integrate_explicitly(residual, u, 0.0 * u, (0.0, end), **options)))


PROBLEMS = [
    (decay, [0.0], lambda t: [np.sin(t)]),
    (pendulum_like, [1.0, 1.0], lambda t: [np.exp(t), np.exp(t)]),
    (turning, [1.0, 0.0], lambda t: [np.cos(t), np.sin(t)]),
]


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-11])
@pytest.mark.parametrize(("residual", "start", "exact"), PROBLEMS)
def test_the_error_is_below_the_tolerance_at_all_times(residual, start, exact, tolerance):
    path = run(residual, start, 3.0, tolerance=tolerance)
    growth = np.exp(3.0) if residual is pendulum_like else 1.0
    for t in np.linspace(0.0, 3.0, 50):
        assert path(t)[0] == pytest.approx(exact(t), abs=growth * tolerance)
    assert len(path.errors) <= 4


@pytest.mark.parametrize("order", [2, 3, 8, 15])
@pytest.mark.parametrize(("residual", "start", "exact"), PROBLEMS)
def test_orders_are_derivatives_over_factorials(residual, start, exact, order):
    piece = next(
        integrate_explicitly(
            residual, np.array(start), np.zeros(len(start)), (0.0, 1.0), order=order
        )
    )
    nodes = 0.3 * np.exp(2j * np.pi * np.arange(64) / 64)  # Cauchy's formula
    wanted = np.fft.fft(np.array([exact(z) for z in nodes]), axis=0)[: order + 1] / 64
    wanted = wanted.real / 0.3 ** np.arange(order + 1)[:, None]
    assert piece.coefficients == pytest.approx(wanted, rel=1e-7, abs=1e-9)


def test_the_estimated_error_is_the_error():
    path = run(decay, [0.0], 3.0, order=6, tolerance=1e-5)
    _, length, coefficients = next(path.polynomials())
    end = np.polynomial.polynomial.polyval(length, coefficients)
    assert path(path.knots[1])[0] == pytest.approx(end)
    error = abs(end[0] - np.sin(path.knots[1]))
    assert 0.2 * error < path.errors[0] < 5.0 * error


def test_a_fraction_of_the_tolerance_goes_to_every_step():
    path = run(decay, [0.0], 20.0, order=8, tolerance=1e-6)
    assert path.errors.sum() <= 1e-6
    even = 1e-6 * np.diff(path.knots) / 20.0
    assert (path.errors <= MAX_ERROR_RATE * even * (1 + 1e-9)).all()
    before = np.concatenate([[0.0], np.cumsum(path.errors)[:-1]])
    assert (path.errors <= (1e-6 - before) * even / 1e-6 * 20.0 / (20.0 - path.knots[:-1])).all()


def gapped(u, v, t):
    """u' = 1/(1 + t⁴), whose series skips three orders of four."""
    return np.stack([v[0] - 1.0 / (1.0 + t * t * t * t)])


def test_a_step_is_as_long_as_its_error_allows_where_the_last_terms_tell_less():
    """Away from t = 0 the orders left out are large and small by turns."""
    path = run(gapped, [0.0], 50.0, order=8, tolerance=1e-6)
    shares = path.errors / (1e-6 * np.diff(path.knots) / 50.0)
    assert (shares[:5] > 0.1).all()


def test_one_tangent_per_step():
    cost = Cost()
    steps = list(integrate_explicitly(decay, np.zeros(1), np.zeros(1), (0.0, 9.0), cost=cost))
    assert cost.factorisations == cost.expansions == len(steps)


def test_constant_solutions_take_one_step():
    path = run(lambda u, v, t: np.stack([v[0] + u[0] - 1.0 + 0.0 * t]), [1.0], 1e6)
    assert len(path.errors) == 1
    assert path(1e6)[0] == 1.0


def test_newton_reaches_the_slip_of_a_law_that_saturates():
    def law(u, v, t):
        s = np.stack([v[0] - 1.0])
        return s * (s * s + 0.01) ** -0.475 + u * 3.0

    u, v = find_consistent_state(law, np.zeros(1), np.zeros(1), 0.0)
    assert v == pytest.approx([1.0], abs=1e-9)
    assert (u == 0.0).all()


def test_directions_are_split():
    point = Point.at(turning, np.array([0.6, 0.8]), np.array([-0.8, 0.6]), 0.0)
    assert len(point.driven[0]) == len(point.algebraic[0]) == 1
    assert abs(point.algebraic[1][:, 0] @ [0.6, 0.8]) == pytest.approx(1.0)


def test_a_singularity_is_reported_with_its_time():
    def blow_up(u, v, t):
        return v - u * u

    with pytest.raises(PathStopped) as caught:
        run(blow_up, [1.0], 2.0)
    assert caught.value.control == pytest.approx(1.0, abs=1e-3)
