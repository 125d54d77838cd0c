"""What a path that stops says: one sentence, once, and the unknowns that show why."""

import numpy as np
import pytest
from dense import DenseEquations, followed, one
from scipy.sparse import csc_matrix

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Evidence, Outcome, PathStopped
from anmstrip.linalg.direct import NonFiniteTangentError, SingularTangentError
from anmstrip.linalg.solvers import DenseSolver, SparseSolver
from anmstrip.timestepping import formulas as backward_differences
from anmstrip.timestepping import implicit as implicit_dae
from anmstrip.timestepping.index_one import FunctionRateEquations


def test_message_is_outcome_place_and_detail():
    stopped = PathStopped(Outcome.FOLD, 0.25, "a detail")
    assert str(stopped) == f"{Outcome.FOLD.value} (at 0.25): a detail"
    assert stopped.evidence == Evidence()


def in_time(residual, follow=follow):
    """The exception that ends an integration up to t = 1."""
    steps = implicit_dae.integrate(
        FunctionRateEquations(residual, 1.0),
        backward_differences.start_memory(0.0, np.zeros(2), np.zeros(2), 1e-2),
        1.0,
        solver=DenseSolver(),
        settings=Settings(order=10, tolerance=1e-6),
        stepping=implicit_dae.Stepping(1.0, 1e-4, follow=follow),
    )
    with np.errstate(all="ignore"), pytest.raises(PathStopped) as stopped:
        list(steps)
    return stopped.value


def ends(u, v, t):
    """The second unknown has no solution after t = 1/2."""
    return np.stack([v[0] - 1.0, u[1] * u[1] * u[1] - 3.0 * u[1] + v[1] - np.sqrt(0.5 - t)])


def jumps(u, v, t):
    """The second unknown follows 1/(1/2 − t)."""
    return np.stack([v[0] - 1.0, u[1] * (0.5 - t) - 1.0])


@pytest.mark.parametrize("residual", [ends, jumps])
def test_step_in_time_that_cannot_be_done_is_told_once(residual):
    stopped = in_time(residual)
    assert stopped.control <= 0.5
    assert str(stopped).count(stopped.outcome.value) == 1
    assert not any(other.value in stopped.detail for other in Outcome)


def test_too_many_tangents_in_one_step_do_not_ask_for_more_steps():
    def never(*_, **choices):
        raise PathStopped(Outcome.TOO_MANY_STEPS, 0.3)

    told = in_time(ends, never)
    assert told.outcome is Outcome.STALLED
    assert told.control < 0.1  # Newton's method solves the first step
    assert "too many tangents" in told.detail


def test_stalled_path_shows_where_the_imbalance_comes():
    """The second equation has no solution beyond λ = 1."""
    equations = DenseEquations(lambda u, c: np.stack([u[0] - c, u[1] - np.sqrt(1.0 - c)]))
    with np.errstate(all="ignore"), pytest.raises(PathStopped) as stopped:
        followed(equations, [0.0, 1.0], target=2.0, give_way=False)
    residual = stopped.value.evidence.residual
    assert np.isfinite(residual).all()
    assert np.argmax(np.abs(residual)) == 1


def test_fold_shows_what_moves():
    equations = DenseEquations(lambda u, c: np.stack([u[0] - c, u[1] * u[1] + c - 1.0]))
    with pytest.raises(PathStopped) as stopped:
        followed(equations, [0.0, 1.0], target=2.0, max_steps=80)
    assert stopped.value.outcome is Outcome.FOLD
    assert stopped.value.evidence.motion.any()


def test_singular_start_shows_the_unknown():
    equations = DenseEquations(lambda u, c: np.stack([u[0] - c, u[1] * u[1] - c]))
    with pytest.raises(PathStopped) as stopped:
        followed(equations, [0.0, 0.0])
    assert stopped.value.outcome is Outcome.SINGULAR
    assert stopped.value.evidence.unknown == 1
    with np.errstate(all="ignore"), pytest.raises(PathStopped) as stopped:
        followed(one(lambda u, c: np.log(u - 1.0) - c), [0.5])
    assert stopped.value.outcome is Outcome.NOT_FINITE
    assert not np.isfinite(stopped.value.evidence.residual).any()


SOLVERS = [DenseSolver(), SparseSolver()]


def factorised(solver, matrix):
    return solver.factorise(matrix if isinstance(solver, DenseSolver) else csc_matrix(matrix))


@pytest.mark.parametrize("solver", SOLVERS, ids=type)
def test_unknown_without_stiffness_is_numbered(solver):
    with pytest.raises(SingularTangentError) as error:
        factorised(solver, np.diag([1.0, 2.0, 0.0, 3.0]))
    assert error.value.unknown == 2


@pytest.mark.parametrize("seed", range(5))
def test_pivot_is_that_of_the_unknown_whatever_the_order(seed):
    """A chain numbered at random; two of its links are held by their difference alone."""
    order = np.random.default_rng(seed).permutation(12)
    chain = 3.0 * np.eye(12) - np.eye(12, k=1) - np.eye(12, k=-1)
    chain[6:8] = chain[:, 6:8] = 0.0
    chain[6:8, 6:8] = [[1.0, -1.0], [-1.0, 1.0]]
    matrix = np.empty_like(chain)
    matrix[np.ix_(order, order)] = chain
    for solver in SOLVERS:
        with pytest.raises(SingularTangentError) as error:
            factorised(solver, matrix)
        assert error.value.unknown in order[6:8]


@pytest.mark.parametrize("solver", SOLVERS, ids=type)
@pytest.mark.parametrize("row", [1, 2])
def test_unknown_that_is_not_finite_is_numbered(solver, row):
    matrix = np.eye(4)
    matrix[row, 2] = np.nan
    with pytest.raises(NonFiniteTangentError) as error:
        factorised(solver, matrix)
    assert error.value.unknown == 2
