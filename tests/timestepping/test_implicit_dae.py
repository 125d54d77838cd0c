"""Backward differences by branches."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from anmstrip.continuation.follow import Settings
from anmstrip.continuation.path import Cost, extrapolate
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.timestepping import formulas as backward_differences
from anmstrip.timestepping import implicit as implicit_dae
from anmstrip.timestepping.formulas import Memory, TimeStep, formula
from anmstrip.timestepping.index_one import FunctionRateEquations, join_steps

DENSE = DenseSolver()


def smooth(u, v, t):
    """Solution sin t."""
    return np.stack([v[0] + u[0] * u[0] * u[0] - np.cos(t) - np.sin(t) * np.sin(t) * np.sin(t)])


def stiff_friction(u, v, t):
    """A spring-held point with the slope of friction 1e4 times the spring's (V_c = 1e-4)."""
    s = v[0] - 1.0
    return np.stack([-u[0] - 0.3 * s * (s * s + 1e-10) ** -0.45])


def run(residual, u, v, end, *, tolerance=1e-4, first=1e-3, speed=np.inf, time_order=2, **options):
    equations = FunctionRateEquations(residual, end, speed)
    start = backward_differences.start_memory(0.0, np.array(u), np.array(v), first)
    settings = Settings(order=15, tolerance=0.01 * tolerance, max_steps=20_000)
    return list(
        implicit_dae.integrate(
            equations,
            start,
            end,
            solver=DENSE,
            settings=settings,
            stepping=implicit_dae.Stepping(end, tolerance, time_order),
            **options,
        )
    )


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_formula_weights_are_exact_on_polynomials(order):
    times, new = (1.0, 0.7, 0.65, 0.1)[:order], 1.3
    past, rate = formula(times, new, order)
    for degree in range(order + 1):
        slope = rate * new**degree + past @ np.array(times) ** degree
        assert slope == pytest.approx(degree * new ** max(degree - 1, 0), abs=1e-12)


def test_the_predictor_is_exact_on_polynomials():
    times = (1.0, 0.7, 0.1)
    states = tuple(np.array([t**2, 3.0 - t]) for t in times)
    assert extrapolate(times, states, 1.9) == pytest.approx([1.9**2, 1.1])


def fixed_steps(order, ratio, count):
    """Error at t = 1 with steps that alternate between two lengths."""
    lengths = np.resize([1.0, ratio], count)
    knots = np.concatenate([[0.0], np.cumsum(lengths) / lengths.sum()])
    equations = FunctionRateEquations(smooth, 1.0)
    settings = Settings(order=15, tolerance=1e-10)
    times = (0.0, *(-x for x in knots[1 : order + 1]))  # exact history
    memory = Memory(times, tuple(np.sin([t]) for t in times), np.ones(1), 1.0, order)
    for start, end in pairwise(knots):
        stepping = implicit_dae.Stepping(1.0, 1.0, order, fixed=end - start)
        (step,) = implicit_dae.integrate(
            equations, memory, end, solver=DENSE, settings=settings, stepping=stepping
        )
        memory = replace(step.memory, order=order)
    return abs(memory.states[0][0] - np.sin(1.0))


@pytest.mark.parametrize(
    ("order", "ratio"),
    [(1, 1.0), (1, 1.7), (2, 1.0), (2, 1.7), (3, 1.0), (3, 1.3), (4, 1.0), (4, 1.15), (5, 1.0)],
)
def test_observed_order(order, ratio):
    counts = (40, 160) if order < 4 else (20, 40)
    coarse, fine = (fixed_steps(order, ratio, n) for n in counts)
    observed = np.log(coarse / fine) / np.log(counts[1] / counts[0])
    assert observed == pytest.approx(order, abs=0.1 if order < 4 else 0.3)


@pytest.mark.parametrize(("time_order", "tolerance"), [(1, 1e-2), (2, 1e-2), (2, 1e-3), (2, 1e-4)])
def test_the_error_is_below_the_tolerance(time_order, tolerance):
    steps = run(smooth, [0.0], [1.0], 3.0, tolerance=tolerance, time_order=time_order)
    for step in steps:
        assert step.u == pytest.approx(np.sin([step.end]), abs=tolerance)
    assert len(steps) < 800


def test_a_first_step_that_is_too_long_is_cut():
    steps = run(smooth, [0.0], [1.0], 3.0, first=1.5, tolerance=1e-3)
    assert steps[0].end < 0.15
    assert all(step.error <= 1.0 for step in steps)
    assert max(abs(step.u[0] - np.sin(step.end)) for step in steps) <= 1e-3


def test_second_order_needs_far_fewer_steps():
    first, second = (
        len(run(smooth, [0.0], [1.0], 1.0, tolerance=1e-3, time_order=k)) for k in (1, 2)
    )
    assert second < 0.4 * first


def test_a_stiff_friction_point_comes_to_rest():
    steps = run(stiff_friction, [0.0], [1.0], 2.0, tolerance=1e-4)
    end = 0.3 * (1.0 + 1e-10) ** -0.45
    assert steps[-1].u == pytest.approx([end], abs=1e-4)
    assert steps[-1].v == pytest.approx([0.0], abs=1e-6)
    assert len(steps) < 600
    assert max(step.end - step.start for step in steps) > 0.05


@pytest.mark.parametrize("time_order", [3, 4, 5])
@pytest.mark.parametrize("tolerance", [1e-4, pytest.param(1e-6, marks=pytest.mark.slow)])
def test_higher_orders_keep_the_tolerance_in_fewer_steps(time_order, tolerance):
    steps = run(smooth, [0.0], [1.0], 3.0, tolerance=tolerance, time_order=time_order)
    for step in steps:
        assert step.u == pytest.approx(np.sin([step.end]), abs=tolerance)
    second = run(smooth, [0.0], [1.0], 3.0, tolerance=tolerance)
    assert len(steps) < 0.8 * len(second)
    assert max(step.order for step in steps) == time_order


def test_one_tangent_per_step_where_it_is_smooth():
    cost = Cost()
    steps = run(smooth, [0.0], [1.0], 1.0, cost=cost)
    assert cost.factorisations <= len(steps) + 3
    assert {step.branches for step in steps} == {1}


def test_going_on_from_memory_gives_the_same_answer():
    equations = FunctionRateEquations(smooth, 2.0)
    settings, stepping = Settings(order=15, tolerance=1e-6), implicit_dae.Stepping(2.0, 1e-4)
    options = {"solver": DENSE, "settings": settings, "stepping": stepping}
    memory = backward_differences.start_memory(0.0, np.zeros(1), np.ones(1), 1e-2)
    whole = list(implicit_dae.integrate(equations, memory, 2.0, **options))
    half = whole[len(whole) // 2]
    rest = list(implicit_dae.integrate(equations, half.memory, 2.0, **options))
    assert [s.end for s in rest] == [s.end for s in whole[len(whole) // 2 + 1 :]]
    assert rest[-1].u == pytest.approx(whole[-1].u, abs=1e-14)


def test_the_solution_can_be_called_between_the_steps():
    steps = run(smooth, [0.0], [1.0], 1.0)
    path = join_steps(np.zeros(1), np.ones(1), steps, 1e-4, np.inf)
    for t in np.linspace(0.0, 1.0, 23):
        u, v = path(t)
        assert u == pytest.approx(np.sin([t]), abs=1e-4)
        assert v == pytest.approx(np.cos([t]), abs=1e-3)
    assert path.errors.sum() < 2e-4


def test_the_solution_between_the_steps_is_the_cubic_through_states_and_velocities():
    p = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3])
    memory = Memory((0.0,), (np.zeros(1),), np.zeros(1), 1.0)
    steps = [
        TimeStep(a, b, p([b]), p.deriv()([b]), 1, 0.0, 0.0, 1, memory)
        for a, b in pairwise([0.0, 0.4, 1.7, 3.0])
    ]
    path = join_steps(p([0.0]), p.deriv()([0.0]), steps, 1.0, np.inf)
    for t in (0.0, 0.2, 0.4, 1.0, 2.9, 3.0):
        assert path(t) == (pytest.approx(p([t])), pytest.approx(p.deriv()([t])))
    for start, length, cubic in path.polynomials():
        assert np.polynomial.polynomial.polyval(length, cubic[:, 0]) == pytest.approx(
            p(start + length)
        )
