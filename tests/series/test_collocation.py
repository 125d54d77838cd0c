"""Collocation by branches: the rule, its order, stiffness, algebraic unknowns."""

import numpy as np
import pytest

from anmstrip.continuation.expansion import Cost
from anmstrip.continuation.status import PathStopped
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.series import collocation
from anmstrip.series.collocation import Piece, Rule
from anmstrip.timestepping.explicit import PiecewiseSeries


def smooth(u, v, t):
    """Solution sin t."""
    return np.stack([v[0] + u[0] * u[0] * u[0] - np.cos(t) - np.sin(t) ** 3])


def coupled(u, v, t):
    """u_0 = sin t driven, u_1 = u_0² algebraic."""
    return np.stack([v[0] - np.cos(t) + u[1] - u[0] * u[0], u[1] - u[0] * u[0]])


def run(residual, size, end, **options):
    zero = np.zeros(size)
    options = {"tolerance": 1e-8, **options}
    return list(
        collocation.integrate(residual, zero, zero, (0.0, end), solver=DenseSolver(), **options)
    )


@pytest.mark.parametrize("stages", [2, 3, 8])
def test_the_rule_is_exact_on_polynomials(stages):
    rule, x = Rule(stages), np.array([0.0, 0.3, 1.0, 1.7])
    for degree in range(1, stages + 1):
        values = rule.points**degree
        assert rule.derivative @ values == pytest.approx(degree * rule.points ** (degree - 1))
        assert rule.interpolating(x) @ values == pytest.approx(x**degree, abs=1e-9)
    assert rule.last[-1] @ rule.points ** (stages - 1) == pytest.approx(0.0, abs=1e-12)


def test_radau_s_points_of_two_and_three_stages():
    assert Rule(2).points == pytest.approx([1 / 3, 1.0])
    root = np.sqrt(6.0)
    assert Rule(3).points == pytest.approx([(4 - root) / 10, (4 + root) / 10, 1.0])


@pytest.mark.parametrize("stages", [2, 3, 4])
def test_order_at_the_ends_of_steps(stages):
    """2 s − 1: steps of one length from the exact state."""
    errors = []
    for count in (4, 8):
        h, rule = 1.0 / count, Rule(stages)
        stepper = collocation._Stepper(smooth, rule, DenseSolver(), 1e-9, Cost())
        piece = Piece(
            rule, -h, 0.0, np.sin([-h]), np.sin(h * (rule.points - 1.0))[None] + np.sin(h)
        )
        for i in range(count):
            piece = stepper._tried(piece, (i + 1) * h)
        u = piece.u + piece.changes[:, -1]
        errors.append(abs(u[0] - np.sin(1.0)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * stages - 1, abs=0.4)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_the_error_is_below_the_tolerance_everywhere(tolerance):
    path = PiecewiseSeries(run(smooth, 1, 3.0, tolerance=tolerance))
    for t in np.linspace(0.0, 3.0, 61):
        u, v = path(t)
        assert u[0] == pytest.approx(np.sin(t), abs=tolerance)
        assert v[0] == pytest.approx(np.cos(t), abs=1e4 * tolerance)
    assert len(path.pieces) < 25


def test_algebraic_unknowns():
    path = PiecewiseSeries(run(coupled, 2, 3.0))
    for t in np.linspace(0.1, 3.0, 31):
        assert path(t)[0] == pytest.approx([np.sin(t), np.sin(t) ** 2], abs=1e-8)


def test_one_tangent_per_step_where_it_is_smooth():
    cost = Cost()
    pieces = run(smooth, 1, 3.0, cost=cost)
    assert cost.factorisations <= len(pieces) + 2
    assert sum(p.branches for p in pieces) <= cost.factorisations


def test_long_steps_on_a_stiff_equation():
    """v = −10⁶ (u − cos t) + …: the transient is over at once, the steps follow the cosine."""

    def relaxing(u, v, t):
        return np.stack([v[0] + (u[0] - np.cos(t) + 1.0) * 1e6])

    pieces = run(relaxing, 1, 10.0)
    assert len(pieces) < 40
    found = [p.u[0] + p.changes[0, -1] for p in pieces]
    assert found == pytest.approx([np.cos(p.end) - 1.0 for p in pieces], abs=1e-6)


def test_what_cannot_be_solved_is_named():
    """No solution beyond t = 1."""
    with pytest.raises(PathStopped) as stopped:
        run(lambda u, v, t: np.stack([u[0] * u[0] + 2.0 * u[0] + t + v[0] * 0.0]), 1, 3.0)
    assert stopped.value.control == pytest.approx(1.0, abs=1e-3)
