"""Solvers against numpy on matrices whose rows and columns have very different scales."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags

from anmstrip.linalg import solvers as linear_solvers
from anmstrip.linalg.direct import (
    BandPlan,
    NonFiniteTangentError,
    PardisoPlan,
    SingularTangentError,
    SuperLUPlan,
    equilibrate,
    pardiso_is_there,
)
from anmstrip.linalg.solvers import WIDEST_BORDER, Bordered, DenseSolver, Joining, SparseSolver


def banded(n, width, rng, kind):
    """Full matrix with a given half band width and rows and columns of mixed units."""
    distance = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    a = np.where(distance <= width, rng.standard_normal((n, n)), 0.0)
    if kind == "symmetric definite":
        a = a @ a.T + 0.1 * np.eye(n)
        a[distance > width] = 0.0
        a += np.diag(np.abs(a).sum(axis=1))
    elif kind == "symmetric indefinite":
        a = a + a.T
        a[np.diag_indices(n)] += 3.0 * width * np.sign(rng.standard_normal(n))
    elif kind == "multipliers":
        a = a + a.T + 6.0 * width * np.eye(n)
        a[1::4, 1::4] = 0.0
    else:
        a[np.diag_indices(n)] += 3.0 * width
    units = 10.0 ** rng.uniform(-3.0, 5.0, n)
    return units[:, None] * a * units


KINDS = ["symmetric definite", "symmetric indefinite", "unsymmetric", "multipliers"]


class Band:
    def factorise(self, matrix):
        return BandPlan(matrix).factorise(matrix)


class SuperLU:
    def factorise(self, matrix):
        return SuperLUPlan(matrix).factorise(matrix)


class Pardiso:
    def factorise(self, matrix):
        pytest.importorskip("pypardiso")
        return PardisoPlan(matrix).factorise(matrix)


def backward_error(a, x, b):
    """Componentwise: independent of the units."""
    return np.max(np.abs(a @ x - b) / (np.abs(a) @ np.abs(x) + np.abs(b)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("solver", [DenseSolver(), Band(), SuperLU(), Pardiso()], ids=type)
def test_solution_is_that_of_numpy(kind, seed, solver):
    rng = np.random.default_rng(seed)
    n = 60
    a = banded(n, 5, rng, kind)
    x = rng.standard_normal(n) / np.abs(a).max(axis=0)
    b = a @ x
    before = b.copy()
    factors = solver.factorise(a if isinstance(solver, DenseSolver) else csc_matrix(a))
    found = factors.solve(b)
    np.testing.assert_array_equal(b, before)
    assert backward_error(a, found, b) < 1e-11
    scale = np.sqrt(np.abs(np.diagonal(a))) + np.sqrt(np.abs(a).max(axis=0))
    error = np.abs(scale * (found - x)).max() / np.abs(scale * x).max()
    reference = np.abs(scale * (np.linalg.solve(a, b) - x)).max() / np.abs(scale * x).max()
    assert error < 1e-9 + reference
    np.testing.assert_array_equal(factors.solve(b), found)
    assert backward_error(a, factors.solve(2.0 * b), 2.0 * b) < 1e-11


@pytest.mark.parametrize("solver", [DenseSolver(), SparseSolver(), SuperLU(), Pardiso()], ids=type)
def test_singular_matrix_is_named(solver):
    a = np.diag([1.0, 2.0, 3.0, 4.0])
    a[2] = 0.0
    a[:, 2] = 0.0
    dependent = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1.0]])
    for matrix in (a, dependent):
        with pytest.raises(SingularTangentError):
            solver.factorise(matrix if isinstance(solver, DenseSolver) else csc_matrix(matrix))


@pytest.mark.parametrize("solver", [DenseSolver(), SparseSolver()], ids=type)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_matrix_that_is_not_finite_is_named(solver, value):
    a = np.eye(3)
    a[1, 2] = value
    with pytest.raises(NonFiniteTangentError, match="not finite"):
        solver.factorise(a if isinstance(solver, DenseSolver) else csc_matrix(a))


def test_unknown_that_nothing_holds_is_named():
    a = csc_matrix(np.diag([1.0, 2.0, 3.0]))
    a.data[1] = 0.0
    with pytest.raises(SingularTangentError, match="unknown 1 has no stiffness"):
        SparseSolver().factorise(a)


def chain(n, seed=0):
    """Tridiagonal matrix."""
    rng = np.random.default_rng(seed)
    off = rng.uniform(0.5, 1.0, n - 1)
    made = csc_matrix(diags([off, np.full(n, 3.0), -off], [-1, 0, 1]))
    made.sort_indices()  # as tangents are; not every scipy does
    return made


def test_plan_is_kept_while_the_pattern_stays():
    solver = SparseSolver()
    assert solver.name == "none yet"
    b = np.arange(1.0, 31.0)
    first = solver.factorise(chain(30))
    plan = solver.plan
    assert solver.name == "band LU"
    second = solver.factorise(chain(30, seed=1))
    assert solver.plan is plan
    for seed, factors in enumerate((first, second)):
        expected = np.linalg.solve(chain(30, seed).toarray(), b)
        np.testing.assert_allclose(factors.solve(b), expected, rtol=1e-12)


def test_plan_is_made_anew_when_the_pattern_changes():
    solver = SparseSolver()
    solver.factorise(chain(30))
    plan = solver.plan
    moved = chain(30).tolil()
    moved[0, 5] = moved[5, 0] = 0.3
    for matrix in (csc_matrix(moved), chain(20)):
        b = np.ones(matrix.shape[0])
        expected = np.linalg.solve(matrix.toarray(), b)
        np.testing.assert_allclose(solver.factorise(matrix).solve(b), expected, rtol=1e-12)
        assert solver.plan is not plan


def test_cholesky_where_the_matrix_allows_it():
    """The choice follows the entries from matrix to matrix, on one plan."""
    solver = SparseSolver()
    a = chain(30).toarray()
    definite = a @ a.T
    saddle = definite - 11.0 * np.eye(30)
    skewed = definite + 1e-8 * np.triu(definite, 1)
    assert np.linalg.eigvalsh(saddle)[0] < 0.0
    b, plans = np.arange(1.0, 31.0), set()
    for matrix, name in [
        (definite, "band Cholesky"),
        (saddle, "band LU"),
        (skewed, "band LU"),
        (definite, "band Cholesky"),
    ]:
        factors = solver.factorise(csc_matrix(matrix))
        plans.add(id(solver.plan))
        assert solver.name == name
        np.testing.assert_allclose(factors.solve(b), np.linalg.solve(matrix, b), rtol=1e-11)
    assert len(plans) == 1


@pytest.mark.parametrize("kind", ["symmetric definite", "unsymmetric"])
def test_shuffled_band_is_found_again(kind):
    n, width = 300, 4
    rng = np.random.default_rng(3)
    a = banded(n, width, rng, kind)
    p = rng.permutation(n)
    shuffled = a[np.ix_(p, p)]
    solver = SparseSolver()
    factors = solver.factorise(csc_matrix(shuffled))
    assert solver.plan.width <= 2 * width
    b = shuffled @ np.ones(n)
    assert backward_error(shuffled, factors.solve(b), b) < 1e-12


def test_good_numbering_is_left_alone():
    a = banded(100, 3, np.random.default_rng(4), "unsymmetric")
    plan = BandPlan(csc_matrix(a))
    assert plan.width == 3


@pytest.mark.parametrize("there", [False, True], ids=["SuperLU", "PARDISO"])
def test_wide_band_goes_to_the_sparse_solver(monkeypatch, there):
    """To PARDISO if it is installed, and earlier then; the results are the same."""
    if there:
        pytest.importorskip("pypardiso")
    a = csc_matrix(banded(80, 6, np.random.default_rng(5), "symmetric definite"))
    monkeypatch.setattr(linear_solvers.direct, "pardiso_is_there", lambda: there)
    limit, other = ("WIDEST_BEFORE_PARDISO", "WIDEST_BAND")[:: 1 if there else -1]
    monkeypatch.setattr(linear_solvers, limit, 5)
    monkeypatch.setattr(linear_solvers, other, 1000)
    solver = SparseSolver()
    factors = solver.factorise(a)
    assert solver.name == ("PARDISO" if there else "sparse LU")
    b = a @ np.ones(80)
    assert backward_error(a.toarray(), factors.solve(b), b) < 1e-12
    np.testing.assert_allclose(
        factors.solve(b), Band().factorise(a).solve(b), rtol=1e-7
    )  # mixed units


def test_pardiso_is_never_needed(monkeypatch):
    monkeypatch.setattr("anmstrip.linalg.direct.find_spec", lambda name: None)
    assert not pardiso_is_there()
    a = csc_matrix(banded(80, 6, np.random.default_rng(5), "unsymmetric"))
    monkeypatch.setattr(linear_solvers, "WIDEST_BAND", 5)
    assert isinstance(linear_solvers.fastest_plan(a), SuperLUPlan)


@pytest.mark.parametrize("plan", [SuperLUPlan, PardisoPlan])
def test_factors_outlive_later_ones_of_their_plan(plan):
    if plan is PardisoPlan:
        pytest.importorskip("pypardiso")
    first, second = chain(30), chain(30, seed=1)
    made = plan(first)
    both = [(made.factorise(m), m) for m in (first, second)]
    b = np.arange(1.0, 31.0)
    for factors, matrix in both:
        expected = np.linalg.solve(matrix.toarray(), b)
        np.testing.assert_allclose(factors.solve(b), expected, rtol=1e-12)


@pytest.mark.parametrize("plan", [SuperLUPlan, PardisoPlan])
@pytest.mark.parametrize("pivot", [1e-9, 1e-15], ids=["refined", "pivoted"])
def test_what_the_diagonal_cannot_do_is_refined_or_pivoted(plan, pivot):
    """A first pivot so small that what it leaves has lost all other entries."""
    if plan is PardisoPlan:
        pytest.importorskip("pypardiso")
    a = np.random.default_rng(7).standard_normal((12, 12))
    a += a.T
    a[np.diag_indices(12)] = pivot
    matrix, b = csc_matrix(a), np.arange(1.0, 13.0)
    found = plan(matrix).factorise(matrix).solve(b)
    np.testing.assert_allclose(found, np.linalg.solve(a, b), rtol=1e-11)


@pytest.mark.parametrize(
    "form", [np.asarray, csr_matrix, coo_matrix], ids=lambda form: form.__name__
)
def test_matrix_of_another_form_is_taken_for_what_it_is(form):
    """Rows were taken for columns, which solved the transposed equations."""
    full = np.array([[4.0, 1.0, 0.0], [0.0, 3.0, 2.0], [1.0, 0.0, 5.0]])
    b = np.array([1.0, 2.0, 3.0])
    found = SparseSolver().factorise(form(full)).solve(b)
    np.testing.assert_allclose(full @ found, b, rtol=1e-12)


def test_entries_in_any_order_within_a_column():
    a = chain(20)
    unsorted = csc_matrix((a.data.copy(), a.indices.copy(), a.indptr), shape=a.shape)
    for j in range(20):
        s = slice(a.indptr[j], a.indptr[j + 1])
        unsorted.data[s] = a.data[s][::-1]
        unsorted.indices[s] = a.indices[s][::-1]
    unsorted.has_sorted_indices = False
    b = np.ones(20)
    expected = np.linalg.solve(a.toarray(), b)
    np.testing.assert_allclose(SparseSolver().factorise(unsorted).solve(b), expected, rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_scaled_entries_are_of_order_one(kind):
    a = banded(60, 5, np.random.default_rng(6), kind)
    d = equilibrate(csc_matrix(a))
    scaled = np.abs(d[:, None] * a * d)
    assert scaled.max(axis=0).min() > 0.03
    assert scaled.max() < 30.0


@pytest.mark.parametrize("kind", KINDS[:2])
@pytest.mark.parametrize("solver", [Band(), SuperLU()], ids=["band", "sparse"])
def test_negative_eigenvalues_are_counted(solver, kind):
    """By Sylvester's law scaling does not matter."""
    matrix = banded(60, 4, np.random.default_rng(2), kind)
    expected = int((np.linalg.eigvalsh(matrix) < 0.0).sum())
    assert (expected > 0) is (kind == "symmetric indefinite")
    assert solver.factorise(csc_matrix(matrix)).negatives == expected
    assert DenseSolver().factorise(matrix).negatives == expected


def bordered(kind, rng, n=60, m=3):
    """A banded matrix with three full rows and columns of mixed units, and all of it."""
    units = 10.0 ** rng.uniform(-3.0, 3.0, m)
    a, b, c = banded(n, 4, rng, kind), rng.standard_normal((n, m)), rng.standard_normal((m, n))
    scale = np.sqrt(np.abs(np.diag(a)) + np.abs(a).max(axis=0))
    b, c = scale[:, None] * b * units, scale * c * units[:, None]
    c = b.T if kind.startswith("symmetric") else c
    d = units[:, None] * np.diag(rng.standard_normal(m)) * units
    matrix = Bordered(csc_matrix(a), csc_matrix(b), csr_matrix(c), d)
    return matrix, np.block([[a, b], [c, d]])


@pytest.mark.parametrize("width", [3, WIDEST_BORDER + 1])
@pytest.mark.parametrize("kind", KINDS)
def test_a_border_is_eliminated(kind, width):
    matrix, full = bordered(kind, np.random.default_rng(5), m=width)
    np.testing.assert_array_equal(matrix.assembled().toarray(), full)
    assert matrix.shape == full.shape
    factors = SparseSolver().factorise(matrix)
    for seed in range(3):
        right = full @ np.random.default_rng(seed).standard_normal(len(full))
        assert backward_error(full, factors.solve(right), right) < 1e-12
    if kind.startswith("symmetric"):
        assert factors.negatives == (np.linalg.eigvalsh(full) < 0.0).sum()


@pytest.mark.parametrize("left", [0.0, 1e-18, 1e-12, 1e-6])
def test_a_border_that_holds_what_the_inner_block_does_not(left):
    """A chain of springs that nothing holds but the border, whose inner block is singular."""
    n = 50
    chain = diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n)).toarray()
    chain[0, 0] = chain[-1, -1] = 1.0
    chain += left * np.eye(n)
    column, row = np.zeros((n, 1)), np.zeros((1, n))
    column[n // 2], row[0, n // 3] = -1.0, 1.0
    border = csc_matrix(column), csr_matrix(row), np.array([[0.5]])
    matrix = Bordered(csc_matrix(chain), *border)
    full = matrix.assembled().toarray()
    expected = np.random.default_rng(1).standard_normal(n + 1)
    found = SparseSolver().factorise(matrix).solve(full @ expected)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_a_border_that_is_singular_or_not_finite_is_refused():
    matrix, _ = bordered("unsymmetric", np.random.default_rng(5))
    loose = Bordered(matrix.inner, 0.0 * matrix.columns, matrix.rows, 0.0 * matrix.corner)
    with pytest.raises(SingularTangentError) as singular:
        SparseSolver().factorise(loose)
    assert singular.value.unknown == 60
    corner = matrix.corner.copy()
    corner[1, 1] = np.nan
    with pytest.raises(NonFiniteTangentError) as caught:
        SparseSolver().factorise(Bordered(matrix.inner, matrix.columns, matrix.rows, corner))
    assert caught.value.unknown == 61


@pytest.mark.parametrize("others", [0, 2])
@pytest.mark.parametrize("seed", range(3))
def test_unknowns_that_are_carried_along_are_eliminated_in_their_order(others, seed):
    """Of steps that have some unknowns of the strip or none, each with own ones; with a border."""
    rng, sizes, owns = np.random.default_rng(seed), [0, 4, 3, 0, 5, 2], 7
    steps = np.repeat(np.arange(len(sizes)), sizes)
    step = np.concatenate([steps, np.repeat(np.arange(len(sizes)), owns)])
    own = np.arange(len(step)) >= len(steps)
    behind = step[:, None] - step  # of the equation behind the unknown
    near = np.where(own, (behind == 1) | (behind == 2), np.abs(behind) < 2)
    near[own] = np.where(own, behind == 1, (behind == 0) | (behind == -1))[own]
    whole = np.where(near, rng.standard_normal(near.shape), 0.0) + 9.0 * np.eye(len(step))
    n, m = len(steps), int(own.sum())
    border = rng.standard_normal((others, n)), rng.standard_normal((n + m, others))
    border[1][n:] = 0.0
    last = np.zeros((others, m))
    last[-1:] = rng.standard_normal(m) if others else 0.0
    corner = 9.0 * np.eye(others)
    inner, part = csc_matrix(whole[:n, :n]), whole.copy()
    part[:n, :n] = 0.0
    rows, columns = np.nonzero(part)
    left_out = np.append(rows, -1), np.append(columns, 3)  # one of an unknown that is not free
    order = np.lexsort((own, step))
    ends = np.cumsum(np.column_stack([sizes, [owns] * len(sizes)]).ravel()).reshape(-1, 2)
    joining = Joining(inner, *left_out, order, ends)
    assert np.array_equal(joining.place[order], np.arange(n + m))
    matrix = Bordered(inner, border[1][:n], border[0], corner) if others else inner
    values, pull = np.append(part[rows, columns], np.nan), last[-1] if others else np.zeros(m)
    joined = joining.joined(matrix, values, pull)
    full = np.block([[whole[:n, :n], border[1][:n], whole[:n, n:]], [border[0], corner, last],
                     [whole[n:, :n], border[1][n:], whole[n:, n:]]])  # fmt: skip
    right = full @ rng.standard_normal(n + m + others)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("anmstrip.linalg.direct.splu", None)  # no other factors
        x = SparseSolver().factorise(joined).solve(right)
    assert backward_error(full, x, right) < 1e-12
