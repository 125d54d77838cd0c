"""Paths with known solutions: followed, turned, or ended with a name."""

from itertools import pairwise

import numpy as np
import pytest
from dense import DenseEquations, coupled, followed, one

from anmstrip.continuation.expansion import Parameter, expand, validate
from anmstrip.continuation.follow import Pace, Settings, _nears_limit_point, follow
from anmstrip.continuation.newton import Corrections, Newton
from anmstrip.continuation.path import Branch, Cost, Outcome, PathStopped
from anmstrip.linalg.solvers import DenseSolver


def circle(u, control):
    return u * u + control * control - 1.0


def cubic(u, control):
    return u**3 - u - control


FOLD = 2.0 / 3.0**1.5
"""Control at the folds ∓1/√3 of the cubic."""

MODES = {"arclength": {"arclength": True}, "giving way": {"arclength": False}}


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-11])
@pytest.mark.parametrize("order", [5, 10, 20])
def test_tolerance_holds_at_the_end_of_every_branch(tolerance, order):
    equations = DenseEquations(coupled)
    steps = followed(equations, [0.0, 0.0], target=2.0, tolerance=tolerance, order=order)
    assert steps
    for step in steps:
        found = equations.imbalance(equations.residual(*step.branch.end))
        assert found == pytest.approx(step.imbalance, abs=1e-15)
        assert found <= tolerance
    assert steps[-1].branch.end[1] == 2.0


@pytest.mark.parametrize("target", [1.0, -1.0, 0.1 + 0.2, 1e-7, 3e5, np.pi])
@pytest.mark.parametrize("arclength", [False, True])
def test_target_is_reached_to_the_last_digit(target, arclength):
    equations = one(lambda u, control: u + 0.1 * np.sin(u) - control * (1.0 / target))
    steps = followed(equations, [0.0], target=target, arclength=arclength, tolerance=1e-9)
    assert abs(steps[-1].branch.end[1] - target) <= 2.0 * np.spacing(abs(target))
    assert len(steps) < 20


def test_branches_join():
    steps = followed(one(cubic), [-1.2], start=-0.528, target=1.0, arclength=True, tolerance=1e-9)
    assert len(steps) > 2
    for before, after in pairwise(steps):
        np.testing.assert_array_equal(before.branch.end[0], after.branch.u[0])
        assert before.branch.end[1] == after.branch.control[0]


@pytest.mark.parametrize("mode", MODES)
def test_going_on_from_a_pace_changes_nothing(mode):
    """Neither the lengths of the steps, nor the change to arclength, nor the sense on the arc."""
    choices = {"start": -0.528, "target": 1.0, "tolerance": 1e-9, **MODES[mode]}
    whole = followed(one(cubic), [-1.2], **choices)
    assert len(whole) > 4
    for number, step in enumerate(whole[:-1]):
        rest = followed(one(cubic), step.branch.end[0], pace=step.pace, **choices)
        assert [s.branch.end for s in rest] == [s.branch.end for s in whole[number + 1 :]]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("order", [10, 19, 20])
def test_folds_of_a_cubic_are_passed_and_found(mode, order):
    steps = followed(
        one(cubic), [-1.2], start=-0.528, target=1.0,
        tolerance=1e-11, order=order, max_steps=80, **MODES[mode],
    )  # fmt: skip
    folds = [step.branch(a)[1] for step in steps for a in step.branch.folds]
    assert folds == pytest.approx([FOLD, -FOLD], abs=1e-8)
    state, control = steps[-1].branch.end
    assert control == pytest.approx(1.0, abs=1e-15)
    assert state[0] == pytest.approx(1.324717957244746, abs=1e-9)


def test_circle_is_followed_round_and_round():
    steps = []
    with pytest.raises(PathStopped) as stopped:
        from_top(steps)
    assert stopped.value.outcome is Outcome.TOO_MANY_STEPS
    folds = [s.branch(a)[1] for s in steps for a in s.branch.folds]
    assert len(folds) > 3
    np.testing.assert_allclose(np.abs(folds), 1.0, atol=1e-8)
    assert np.sign(folds[:4]).tolist() == [1.0, -1.0, 1.0, -1.0]
    for step in steps:
        for a in np.linspace(0.0, step.branch.length, 5):
            state, control = step.branch(a)
            assert abs(circle(state[0], control)) < 1e-9


def from_top(steps):
    settings = Settings(order=15, tolerance=1e-10, max_steps=60, arclength=True)
    for step in follow(
        one(circle), np.array([1.0]), solver=DenseSolver(), settings=settings, target=2.0
    ):
        steps.append(step)


def test_path_that_turns_back_for_good_is_a_fold():
    with pytest.raises(PathStopped) as stopped:
        followed(one(lambda u, control: u * u + control - 1.0), [1.0], target=2.0, max_steps=80)
    assert stopped.value.outcome is Outcome.FOLD
    assert stopped.value.control < -2.0
    assert stopped.value.farthest == pytest.approx(1.0, abs=0.02)  # seen at nine places of a branch


def test_a_path_turns_back_no_farther_than_it_may():
    with pytest.raises(PathStopped) as stopped:
        followed(
            one(lambda u, control: u * u + control - 1.0), [1.0], target=2.0, max_steps=80,
            backwards=0.0,
        )  # fmt: skip
    assert stopped.value.outcome is Outcome.FOLD
    assert -2.0 < stopped.value.control < 0.0


def test_fold_without_giving_way_is_stalled_in_few_steps():
    cost = Cost()
    with pytest.raises(PathStopped) as stopped:
        followed(one(lambda u, control: u * u + control - 1.0), [1.0],
                 target=2.0, give_way=False, cost=cost)  # fmt: skip
    assert stopped.value.outcome in (Outcome.STALLED, Outcome.SINGULAR)
    assert stopped.value.control == pytest.approx(1.0, abs=1e-5)
    assert cost.factorisations < 60


SINGULAR = {
    "end of existence": (lambda u, control: u - np.sqrt(1.0 - control), 1.0, 0.0, 2.0),
    "pole": (lambda u, control: u * (1.0 - control) - 1.0, 1.0, 0.0, 2.0),
    "singular start": (lambda u, control: u * u - control, 0.0, 0.0, 1.0),
}


@pytest.mark.parametrize("name", SINGULAR)
@pytest.mark.parametrize("mode", MODES)
def test_singular_point_has_a_name(name, mode):
    law, u, start, target = SINGULAR[name]
    cost = Cost()
    with np.errstate(all="ignore"), pytest.raises(PathStopped) as stopped:
        followed(one(law), [u], start=start, target=target, cost=cost, max_steps=300, **MODES[mode])
    assert stopped.value.outcome in Outcome
    assert not stopped.value.outcome.done
    assert stopped.value.outcome.value in str(stopped.value)
    assert cost.factorisations <= 301


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
def test_cusp_is_passed_within_the_tolerance_or_named(mode, tolerance):
    equations = one(lambda u, control: u**3 - control * control)
    choices = {"start": -1.0, "tolerance": tolerance, "max_steps": 150, **MODES[mode]}
    try:
        steps = followed(equations, [1.0], **choices)
    except PathStopped as stopped:
        assert stopped.outcome in (Outcome.STALLED, Outcome.SINGULAR, Outcome.FOLD)
    else:
        assert steps[-1].branch.end[0][0] == pytest.approx(1.0, abs=tolerance)


@pytest.mark.parametrize("mode", MODES)
def test_pitchfork_either_passed_or_named(mode):
    """Along the arm u = √λ towards negative λ: the arm turns, and never gets there."""
    with pytest.raises(PathStopped) as stopped:
        followed(
            one(lambda u, control: u * control - u**3), [1.0],
            start=1.0, target=-1.0, max_steps=200, **MODES[mode],
        )  # fmt: skip
    assert stopped.value.outcome in (Outcome.FOLD, Outcome.STALLED, Outcome.SINGULAR)


def test_linear_problem_takes_one_step():
    cost = Cost()
    steps = followed(DenseEquations(lambda u, control: 2.0 * u - control), [0.0], cost=cost)
    assert len(steps) == cost.factorisations == 1
    assert steps[0].branch.end == (pytest.approx([0.5]), 1.0)
    steps = followed(DenseEquations(lambda u, control: 2.0 * u - control), [0.0], arclength=True)
    assert len(steps) <= 3
    assert steps[-1].branch.end == (pytest.approx([0.5]), 1.0)


def test_problem_at_rest_takes_one_step():
    steps = followed(DenseEquations(lambda u, control: 2.0 * u + 0.0 * control), [0.0])
    assert len(steps) == 1
    assert steps[0].branch.end[1] == 1.0
    assert not steps[0].branch.end[0].any()


@pytest.mark.parametrize("order", [9, 10, 19, 20])
def test_odd_function_meets_the_tolerance(order):
    equations = one(lambda u, control: u + 2.0 * u**3 - control)
    steps = followed(equations, [0.0], target=3.0, order=order, tolerance=1e-8)
    assert 1 < len(steps) < 40
    assert all(s.imbalance <= 1e-8 for s in steps)
    assert steps[-1].branch.end[0][0] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("start", [1e-3, 0.1])
def test_initial_imbalance_is_gone_at_the_target(start):
    steps = followed(DenseEquations(coupled), [start, -start], tolerance=1e-8)
    assert steps[-1].imbalance <= 1e-8
    direct = followed(DenseEquations(coupled), [0.0, 0.0], tolerance=1e-10)
    np.testing.assert_allclose(steps[-1].branch.end[0], direct[-1].branch.end[0], atol=1e-7)


def test_imbalance_is_gone_at_a_target_that_a_step_along_the_arc_reaches_too_soon():
    given = {"target": 0.2, "tolerance": 1e-8}
    steps = followed(DenseEquations(coupled), [0.1, -0.1], pace=Pace(0.0, 3.0, (), True), **given)
    assert steps[-1].branch.end[1] == 0.2
    assert steps[-1].imbalance <= 1e-8
    direct = followed(DenseEquations(coupled), [0.0, 0.0], **given)
    np.testing.assert_allclose(steps[-1].branch.end[0], direct[-1].branch.end[0], atol=1e-7)


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("force", [1e-6, 1e6])
@pytest.mark.parametrize("mode", MODES)
def test_units_do_not_matter(length, force, mode):
    def lengths(equations):
        u = np.array([-1.2 * equations.length])
        steps = followed(equations, u, start=-0.528, target=1.0, max_steps=60, **MODES[mode])
        return [s.branch.length for s in steps]

    law = one(cubic).law
    reference = lengths(DenseEquations(law))
    assert len(reference) > 2
    assert lengths(DenseEquations(law, length, force)) == pytest.approx(reference, rel=1e-3)


@pytest.mark.parametrize("order", [20, 40])
@pytest.mark.parametrize("radius", [1e-3, 1e-6, 1e-8])
def test_small_radius_of_convergence_does_not_overflow(order, radius):
    equations = one(lambda u, control: u - 1.0 / (control * (1.0 / radius) + 1.0))
    steps = followed(equations, [1.0], order=order, tolerance=1e-6)
    assert steps[-1].branch.end[1] == 1.0
    assert steps[-1].branch.end[0][0] == pytest.approx(radius / (1.0 + radius), abs=2e-6)
    assert len(steps) < 100


def test_counters_are_honest():
    cost = Cost()
    seen = []

    def law(u, control):
        seen.append(isinstance(u[0], np.floating))
        return coupled(u, control)

    steps = followed(DenseEquations(law), [0.0, 0.0], target=2.0, cost=cost)
    assert len(steps) == cost.expansions == cost.factorisations == seen.count(False)
    assert cost.residuals == seen.count(True)
    assert cost.residuals <= 3 * len(steps)
    assert cost.solves <= 21 * len(steps)
    assert set(cost.seconds) == {
        "series", "tangent", "factorisation", "back-substitution", "residual",
    }  # fmt: skip


@pytest.mark.parametrize("arclength", [False, True])
def test_residual_that_is_not_finite(arclength):
    class Broken(DenseEquations):
        def residual(self, u, control):
            whole = super().residual(u, control)
            return whole * np.nan if isinstance(whole, np.ndarray) else whole

    with pytest.raises(PathStopped) as stopped:
        followed(Broken(coupled), [0.0, 0.0], arclength=arclength)
    assert stopped.value.outcome is Outcome.NOT_FINITE


@pytest.mark.parametrize("arclength", [False, True])
@pytest.mark.parametrize("function", [np.log, np.sqrt])
def test_law_that_is_not_finite_at_the_start(arclength, function):
    equations = one(lambda u, control: function(u - 1.0) - control)
    with np.errstate(all="ignore"), pytest.raises(PathStopped) as stopped:
        followed(equations, [0.5], arclength=arclength)
    assert stopped.value.outcome is Outcome.NOT_FINITE


def test_validated_range_is_neither_wasted_nor_exceeded():
    equations = one(lambda u, control: u - 1.0 / (1.0 - control))
    branch = expand(
        equations, np.array([1.0]), 0.0, order=10, solver=DenseSolver(), parameter=Parameter(1.0)
    )
    cut, imbalance = validate(equations, branch, 1e-6, 1.0, Cost())
    assert imbalance <= 1e-6
    further = equations.imbalance(equations.residual(*branch(1.3 * cut.length)))
    assert further > 1e-6


def made_branch(initial):
    """The path u = 0, λ = a, on which the imbalance is known in closed form."""
    return Branch(
        u=np.zeros((5, 1)), control=np.array([0.0, 1.0, 0.0, 0.0, 0.0]), length=np.inf,
        residual=np.array([initial]),
    )  # fmt: skip


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_old_and_new_imbalance_together_meet_the_tolerance(share):
    tolerance = 1e-4
    equations = one(
        lambda u, control: tolerance * (share * (1.0 - control) + 0.9 * (2.0 * control) ** 5) + u
    )
    branch = made_branch(share * tolerance)
    cut, imbalance = validate(equations, branch, tolerance, 0.5, Cost())
    assert 0.2 < cut.length < 0.5
    assert imbalance == equations.imbalance(equations.residual(*cut.end))
    assert imbalance <= tolerance


@pytest.mark.parametrize("share", [0.5, 1.0, 30.0])
def test_imbalance_is_not_taken_away_twice(share):
    tolerance = 1e-4
    equations = one(lambda u, control: tolerance * share * (1.0 - control) + u)
    cut, imbalance = validate(equations, made_branch(share * tolerance), tolerance, 50.0, Cost())
    assert 1.0 <= cut.length <= 2.0
    assert imbalance <= tolerance


def test_more_steps_than_allowed():
    with pytest.raises(PathStopped) as stopped:
        followed(one(cubic), [-1.2], start=-0.528, target=1.0, arclength=True, max_steps=2)
    assert stopped.value.outcome is Outcome.TOO_MANY_STEPS


@pytest.mark.parametrize(
    ("slopes", "told"),
    [
        ((1.0, 1.3, 1.7, 2.2, 2.8), True),  # a limit point
        ((1.0, 1.0, 16.0, 1.0, 30.0), False),  # ends of series where points come into contact
        ((1.0, 1.01, 1.02, 1.03, 1.04), False),
    ],
)
def test_a_limit_point_is_told_by_a_path_that_steepens_in_every_step(slopes, told):
    lengths = (1.0, 0.7, 0.5, 0.4, 0.3)
    assert _nears_limit_point(tuple(zip(lengths, slopes, strict=True))) is told
    assert not _nears_limit_point(tuple(zip((1.0, 0.9, 0.8, 0.7, 0.6), slopes, strict=True)))


def test_a_correction_that_throws_strip_deep_into_a_roller_is_given_up():
    """From a gap of ten widths, where contact is hardly felt, by e⁸⁶ after eight halvings."""
    equations, cost = one(lambda u, control: np.exp(-u) - 1.0), Cost()
    newton = Newton(equations, DenseSolver(), Corrections(1e-10, 200, growth=2.0), cost)
    assert newton.corrected(np.array([10.0]), 0.0) is None
    assert cost.factorisations == 1
    assert newton.corrected(np.array([2.0]), 0.0).imbalance <= 1e-10
