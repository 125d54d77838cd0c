"""Limit points, bifurcations and the paths that cross there, on functions with known ones."""

import numpy as np
import pytest
from dense import DenseEquations

from anmstrip.continuation.bifurcations import (
    Kind,
    SingularPoint,
    switch_branch,
    watch_singular_points,
)
from anmstrip.continuation.expansion import (
    Parameter,
    expand,
    progression,
    validate,
    without_progression,
)
from anmstrip.continuation.follow import Pace, Settings, follow
from anmstrip.continuation.path import Branch, Cost, Outcome, PathStopped, size
from anmstrip.linalg.solvers import DenseSolver, Remembering

FOLD = 2.0 / 3.0**1.5


def pitchfork(u, control):
    """u + 0.3 u² = λ, and beside it x = 0 or x² = u − 1."""
    y, x = u[0], u[1]
    return np.stack([y + 0.3 * y * y + 0.2 * x * x - control, (1.0 - y) * x + x**3])


def snapping(u, control):
    """The cubic, with a side branch at u = 0.2, between its folds."""
    y, x = u[0], u[1]
    return np.stack([y - y**3 - control + 0.1 * x * x, (0.2 - y) * x + x**3])


def twice(u, control):
    """Two bifurcations, at u = 0.5 and u = 0.8, after which the tangent is as it was."""
    y, x = u[0], u[1]
    return np.stack([y + 0.3 * y * y - control, (0.5 - y) * (0.8 - y) * x + x**3])


def doubly(u, control):
    """Two modes of their own, at u = 0.5 and u = 0.8."""
    y, x, z = u[0], u[1], u[2]
    return np.stack([y + 0.3 * y * y - control, (0.5 - y) * x + x**3, (0.8 - y) * z + z**3])


def found(law, start, control, target, settings=None):
    equations = DenseEquations(law)
    settings = settings or Settings(order=15, tolerance=1e-9, arclength=True)
    solver = Remembering(DenseSolver())
    steps = follow(
        equations, np.array(start), solver=solver, settings=settings, start=control, target=target
    )
    return [
        point
        for _, points in watch_singular_points(equations, steps, solver, settings)
        for point in points
    ]


@pytest.mark.parametrize("order", [8, 15, 20])
def test_limit_points_are_dated(order):
    settings = Settings(order=order, tolerance=1e-6, arclength=True)
    points = found(lambda u, c: u - u**3 - c, [-1.2], -1.2 + 1.2**3, -1.0, settings)
    assert [p.kind for p in points] == [Kind.LIMIT, Kind.LIMIT]
    assert [p.control for p in points] == pytest.approx([-FOLD, FOLD], abs=1e-12)
    assert [float(p.u[0]) for p in points] == pytest.approx([-(3**-0.5), 3**-0.5], abs=1e-7)
    assert [(p.before, p.after) for p in points] == [(1, 0), (0, 1)]


def test_bifurcation_is_found_where_the_path_goes_straight_on():
    (point,) = found(pitchfork, [0.0, 0.0], 0.0, 3.0)
    assert point.kind is Kind.BIFURCATION
    assert point.control == pytest.approx(1.3, abs=1e-10)
    np.testing.assert_allclose(point.u, [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(np.abs(point.mode), [0.0, 1.0], atol=1e-9)
    assert (point.before, point.after) == (0, 1)


def test_bifurcation_and_limit_point_in_one_path():
    points = found(snapping, [-1.2, 0.0], -1.2 + 1.2**3, -1.0)
    kinds = {(p.kind.value, round(p.control, 9)) for p in points}
    limits = {("limit point", round(sign * FOLD, 9)) for sign in (1.0, -1.0)}
    assert kinds == {("bifurcation", round(0.2 - 0.2**3, 9)), *limits}
    assert len(points) == 3


def test_the_last_step_is_looked_at_before_a_stop():
    equations, settings = DenseEquations(snapping), Settings(order=15, arclength=True)
    solver, seen = Remembering(DenseSolver()), []
    steps = follow(equations, np.zeros(2), solver=solver, settings=settings, target=2.0)
    with pytest.raises(PathStopped) as stopped:
        for _, points in watch_singular_points(equations, steps, solver, settings):
            seen += points
    assert stopped.value.outcome is Outcome.FOLD
    assert sorted(p.kind.value for p in seen) == ["bifurcation", "limit point"]


@pytest.mark.parametrize("start", [0.0, 0.2, 0.45])
def test_several_in_one_step_are_told_apart(start):
    """In their order, whichever is the nearer one to the middle of the step."""
    settings = Settings(order=20, tolerance=1e-3, arclength=True)
    points = found(doubly, [start, 0.0, 0.0], start + 0.3 * start**2, 3.0, settings)
    exact = [u + 0.3 * u * u for u in (0.5, 0.8)]
    assert [p.control for p in points] == pytest.approx(exact, abs=1e-9)
    assert [(p.before, p.after) for p in points] == [(0, 1), (1, 2)]
    np.testing.assert_allclose(np.abs([p.mode for p in points]), np.eye(3)[1:], atol=1e-8)


def test_what_limit_points_cost():
    """Two tangents for each, and one at the end of the path."""
    equations, solver, cost = DenseEquations(lambda u, c: u - u**3 - c), DenseSolver(), Cost()
    remembering, settings = Remembering(solver), Settings(order=15, arclength=True)
    start = -1.2 + 1.2**3
    steps = follow(equations, np.array([-1.2]), solver=remembering, settings=settings,
                   start=start, target=-1.0)  # fmt: skip
    assert [
        p
        for _, ps in watch_singular_points(equations, steps, remembering, settings, cost)
        for p in ps
    ]
    assert cost.factorisations == 5


def test_only_the_first_is_looked_for():
    """Of two in one step, and of a bifurcation before a limit point."""
    settings, equations = Settings(order=15, arclength=True), DenseEquations(snapping)
    solver = Remembering(DenseSolver())
    start = {"start": -1.2 + 1.2**3, "target": -1.0, "solver": solver, "settings": settings}
    steps = follow(equations, np.array([-1.2, 0.0]), **start)
    *_, (_, points) = watch_singular_points(equations, steps, solver, settings, stop=True)
    assert [p.kind for p in points] == [Kind.LIMIT]
    assert points[0].control == pytest.approx(-FOLD, abs=1e-9)


@pytest.mark.parametrize("longest", [0.3, 0.1])
def test_two_bifurcations_that_lie_close(longest):
    """Seen when a step ends between them; together they leave the inertia as it was."""
    settings = Settings(order=6, tolerance=1e-13 / longest, arclength=True)
    controls = sorted(p.control for p in found(twice, [0.0, 0.0], 0.0, 3.0, settings))
    assert controls == pytest.approx([u + 0.3 * u * u for u in (0.5, 0.8)], abs=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_other_path_is_switched_to_and_followed(side):
    equations = DenseEquations(pitchfork)
    (point,) = found(pitchfork, [0.0, 0.0], 0.0, 3.0)
    u, pace = switch_branch(equations, point, 0.1 * side, DenseSolver(), 1e-12)
    settings = Settings(order=15, tolerance=1e-9)
    *_, last = follow(equations, u, solver=DenseSolver(), settings=settings, target=3.0, pace=pace)
    (y, x), control = last.branch.end
    assert control == 3.0
    assert x * point.mode[1] * side > 0.5
    assert x * x == pytest.approx(y - 1.0, abs=1e-8)


def test_switching_that_finds_nothing_says_so():
    equations = DenseEquations(lambda u, c: np.stack([u[0] - c, np.exp(u[1])]))
    nowhere = SingularPoint(Kind.BIFURCATION, np.zeros(2), 0.0, np.array([0.6, 0.8]), 0, 1)
    with pytest.raises(PathStopped) as stopped:
        switch_branch(equations, nowhere, 0.1, DenseSolver(), 1e-12)
    assert stopped.value.outcome is Outcome.STALLED


def beside_the_bifurcation(distance, noise, order=15):
    """A branch that starts close to the bifurcation, off the path by round-off."""
    y = 1.0 - distance
    parameter = Parameter(1.0, arclength=True, forward=(np.array([1.0, 0.0]), 1.0))
    return DenseEquations(pitchfork), expand(
        DenseEquations(pitchfork), np.array([y, noise]), y + 0.3 * y * y,
        order=order, solver=DenseSolver(), parameter=parameter, tolerance=1e-9,
    )  # fmt: skip


def test_progression_tells_the_distance_to_the_bifurcation():
    equations, branch = beside_the_bifurcation(1e-3, 1e-14)
    ratio = progression(equations, branch)
    step = branch.u[1][0]
    assert ratio * step == pytest.approx(1e-3, rel=1e-3)


def test_cleared_branch_goes_straight_through():
    equations, branch = beside_the_bifurcation(1e-3, 1e-14)
    lengths = []
    for candidate in (branch, without_progression(equations, branch, 1e-9, Cost())):
        held, _ = validate(equations, candidate, 1e-9, np.inf, Cost())
        lengths.append(held.length)
    assert lengths[1] > 6.0 * lengths[0]
    assert abs(held.end[0][1]) < 1e-9


def test_a_progression_without_which_the_equation_is_not_met_is_kept():
    """A wide plate crept by a millionth of the load in each step beside a bifurcation."""
    equations, branch = beside_the_bifurcation(1e-3, 5e-9)
    assert progression(equations, branch) is not None
    assert without_progression(equations, branch, 1e-9, Cost()) is not branch
    assert without_progression(equations, branch, 1e-12, Cost()) is branch


def test_poles_of_the_path_are_no_progressions():
    """A path that really has a pole begins with its progression at full size."""
    equations = DenseEquations(lambda u, c: u * (1.0 - c) - 1.0)
    branch = expand(equations, np.array([1.0]), 0.0, order=20, solver=DenseSolver(),
                    parameter=Parameter(0.5))  # fmt: skip
    assert progression(equations, branch) is None
    assert without_progression(equations, branch, 1e-9, Cost()) is branch


def test_short_and_constant_branches_are_left_alone():
    for order in (1, 3, 12):
        u = np.zeros((order + 1, 2))
        u[1] = 1.0
        branch = Branch(u, np.arange(order + 1.0), 1.0, np.zeros(2))
        equations = DenseEquations(pitchfork)
        assert without_progression(equations, branch, 1e-9, Cost()) is branch


def test_pace_of_the_switched_path_follows_the_mode():
    (point,) = found(pitchfork, [0.0, 0.0], 0.0, 3.0)
    _, pace = switch_branch(DenseEquations(pitchfork), point, -0.05, DenseSolver(), 1e-12)
    assert isinstance(pace, Pace)
    assert pace.arclength
    assert pace.last == 0.05
    assert size(DenseEquations(pitchfork), pace.forward[0]) == pytest.approx(1.0)
