"""Every operation on series against the same operation in many digits.

The reference is independent of the recurrences: polynomials in a are multiplied
out, functions are composed from the Taylor coefficients that mpmath finds.
"""

import gc
import weakref

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anmstrip.series import dispatch, recurrences
from anmstrip.series.power_series import Tape, derivative_coefficients, linear_map, taylor, value_at

ORDER = 30


def multiplied(p, q):
    """Product of two polynomials, truncated."""
    return [mpmath.fsum(p[j] * q[k - j] for j in range(k + 1)) for k in range(len(p))]


def composed(function, p):
    """Coefficients of function(p(a)) by Horner's rule on its Taylor polynomial at p(0)."""
    outer = mpmath.taylor(function, p[0], len(p) - 1)
    inner = [mpmath.mpf(0), *p[1:]]
    total = [mpmath.mpf(0)] * len(p)
    for c in reversed(outer):
        total = multiplied(total, inner)
        total[0] += c
    return total


def exact(c):
    """Column of floats as numbers of many digits."""
    return [mpmath.mpf(float(x)) for x in c]


def assert_close(found, expected, relative=1e-12):
    """Compare order by order with the size of the whole as the coefficients decay or grow."""
    expected = np.array([float(x) for x in expected])
    sizes = np.maximum.accumulate(np.abs(expected))
    assert np.all(np.abs(found - expected) <= relative * np.maximum(sizes, np.abs(expected)))


def sample(rng, shape=(), base=1.3, order=ORDER):
    """Coefficients like those of a function with a radius of convergence of two."""
    decay = 0.5 ** np.arange(order + 1).reshape((-1,) + (1,) * len(shape))
    c = 0.5 * rng.uniform(-1.0, 1.0, (order + 1, *shape)) * decay
    c[0] = base + 0.3 * rng.uniform(-1.0, 1.0, shape)
    return c


FUNCTIONS = {
    "sqrt": (np.sqrt, mpmath.sqrt),
    "exp": (np.exp, mpmath.exp),
    "log": (np.log, mpmath.log),
    "tanh": (np.tanh, mpmath.tanh),
    "sin": (np.sin, mpmath.sin),
    "cos": (np.cos, mpmath.cos),
    "square": (np.square, lambda x: x * x),
    "negative": (np.negative, lambda x: -x),
    "reciprocal": (lambda x: 1.0 / x, lambda x: 1 / x),
    "two to the power": (lambda x: 2.0**x, lambda x: mpmath.mpf(2) ** x),
    "shift": (lambda x: 2.5 - x, lambda x: mpmath.mpf("2.5") - x),
    "scaled": (lambda x: x / 8.0 + 3.0 * x, lambda x: x / 8 + 3 * x),
} | {
    f"power {s:g}": (lambda x, s=s: x**s, lambda x, s=s: x ** mpmath.mpf(s))
    for s in (-2.0, -1.0, -0.95, -0.5, 0.5, 1.0, 1.7, 2.0, 3.0, 4.0, 5.0, 7.0)
}  # fmt: skip


@pytest.mark.parametrize("name", FUNCTIONS)
def test_function_of_one_series(name):
    ours, theirs = FUNCTIONS[name]
    with mpmath.workdps(60):
        c = sample(np.random.default_rng(1))
        assert_close(taylor(ours, c), composed(theirs, exact(c)), 1e-13)


@settings(max_examples=40, deadline=None)
@given(
    name=st.sampled_from(sorted(FUNCTIONS)),
    base=st.floats(0.4, 3.0),
    order=st.integers(1, 12),
    seed=st.integers(0, 10**6),
)
def test_function_at_any_point(name, base, order, seed):
    ours, theirs = FUNCTIONS[name]
    with mpmath.workdps(40):
        c = sample(np.random.default_rng(seed), base=base, order=order)
        c[1:] *= 0.3
        assert_close(taylor(ours, c), composed(theirs, exact(c)), 1e-11)


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("shape", [(2,), (2, 3), (1, recurrences.LARGE + 1)])
def test_arrays_are_treated_entry_by_entry(name, shape):
    ours, _ = FUNCTIONS[name]
    order = 9
    c = sample(np.random.default_rng(2), shape, order=order)
    whole = taylor(ours, c)
    assert whole.shape == c.shape
    for i in ((0,) * len(shape), tuple(n - 1 for n in shape)):
        assert_close(whole[:, *i], taylor(ours, c[:, *i]), 1e-14)


def test_negative_base_has_integer_powers():
    with mpmath.workdps(40):
        c = sample(np.random.default_rng(3), base=-1.3, order=12)
        for n in (-3.0, -1.0, 2.0, 5.0):
            reference = composed(lambda x, n=n: x ** int(n), exact(c))
            assert_close(taylor(lambda x, n=n: x**n, c), reference, 1e-12)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 4, 5, 6, 9])
def test_positive_integer_powers_hold_at_zero(n):
    c = np.zeros(11)
    c[1] = 2.0
    expected = np.zeros(11)
    expected[n] = 2.0**n
    np.testing.assert_array_equal(taylor(lambda x: x**n, c), expected)


def test_tanh_does_not_overflow():
    c = np.array([800.0, 1.0, 0.5, 0.1])
    np.testing.assert_allclose(taylor(np.tanh, c), [1.0, 0.0, 0.0, 0.0], rtol=0, atol=1e-300)


BINARY = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
}
SHAPES = [((), ()), ((3,), ()), ((), (3,)), ((2, 1), (3,)), ((1,), (2, 3)), ((2, 3), (2, 3))]


def reference_binary(name, p, q):
    """The operation on polynomials in many digits."""
    if name in ("add", "subtract"):
        sign = 1 if name == "add" else -1
        return [x + sign * y for x, y in zip(p, q, strict=True)]
    return multiplied(p, q if name == "multiply" else composed(lambda x: 1 / x, q))


@pytest.mark.parametrize("name", BINARY)
@pytest.mark.parametrize("shapes", SHAPES, ids=str)
@pytest.mark.parametrize("kinds", ["series, series", "series, constant", "constant, series"])
def test_operation_of_two(name, shapes, kinds):
    rng, order = np.random.default_rng(4), 10
    a, b = (sample(rng, shape, order=order) for shape in shapes)
    operation = BINARY[name]
    first, second = kinds.split(", ")
    if first == "constant":
        a[1:] = 0.0
        found = taylor(lambda y: operation(a[0], y), b)
    elif second == "constant":
        b[1:] = 0.0
        found = taylor(lambda x: operation(x, b[0]), a)
    else:
        found = taylor(operation, a, b)
    shape = np.broadcast_shapes(*shapes)
    assert found.shape == (order + 1, *shape)
    wide = [
        np.broadcast_to(
            c.reshape(order + 1, *(1,) * (len(shape) - c.ndim + 1), *c.shape[1:]), found.shape
        )
        for c in (a, b)
    ]
    with mpmath.workdps(40):
        for i in np.ndindex(shape):
            expected = reference_binary(name, *(exact(c[:, *i]) for c in wide))
            assert_close(found[:, *i], expected, 1e-13)


@pytest.mark.parametrize("name", BINARY)
def test_operation_of_two_to_high_order(name):
    rng = np.random.default_rng(5)
    a, b = sample(rng), sample(rng)
    with mpmath.workdps(60):
        expected = reference_binary(name, exact(a), exact(b))
        assert_close(taylor(BINARY[name], a, b), expected, 1e-13)


def convolved(subscripts, a, b):
    """Einsum of two polynomials, order by order."""
    return np.array(
        [
            sum(np.einsum(subscripts, a[j], b[k - j]) for j in range(k + 1))
            for k in range(len(a))
        ]
    )  # fmt: skip


PAIRS = [
    ("i...,i...->...", (3, 4), (3, 4)),
    ("ab...,ib...->ia...", (2, 2, 5), (3, 2, 5)),
    ("i...,i...->i...", (3, 4), (3, 1)),
    ("i,j...->ij...", (3,), (2, 4)),
    ("ij,jk->ik", (2, 3), (3, 2)),
    ("i,i->", (3,), (3,)),
]


@pytest.mark.parametrize(("subscripts", "left", "right"), PAIRS)
def test_einsum_of_two_series(subscripts, left, right):
    rng = np.random.default_rng(6)
    a, b = sample(rng, left, order=8), sample(rng, right, order=8)
    found = taylor(lambda x, y: np.einsum(subscripts, x, y), a, b)
    np.testing.assert_allclose(found, convolved(subscripts, a, b), rtol=1e-13, atol=1e-14)


CONSTANT = [
    *PAIRS,
    ("abcd,cd...->ab...", (2, 2, 2, 2), (2, 2, 5)),
    ("abcd,dc...->ba...", (2, 3, 2, 2), (2, 2, 5)),
    ("i,i...->...", (3,), (3, 4)),
    ("ji,jk...->ik...", (3, 2), (3, 2, 4)),
    ("i,jk->kij", (3,), (2, 2)),
    ("i,ii->", (2,), (2, 2)),
    ("ii,ij->j", (2, 2), (2, 3)),
    ("n,in->in", (4,), (3, 4)),
]


@pytest.mark.parametrize(("subscripts", "constant", "series"), CONSTANT)
@pytest.mark.parametrize("swapped", [False, True])
def test_einsum_with_a_constant(subscripts, constant, series, swapped):
    rng = np.random.default_rng(7)
    value, c = rng.standard_normal(constant), sample(rng, series, order=4)
    if swapped:
        inputs, out = subscripts.split("->")
        subscripts = f"{','.join(reversed(inputs.split(',')))}->{out}"

    def law(x):
        return np.einsum(subscripts, *((x, value) if swapped else (value, x)))

    expected = np.array([law(order) for order in c])
    np.testing.assert_allclose(taylor(law, c), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("columns", [4, recurrences.LARGE])
@pytest.mark.parametrize(
    ("subscripts", "shape"),
    [
        ("ia...,ib...->ab...", (3, 2)),
        ("i...,i...->...", (3,)),
        ("i...,j...->ij...", (3,)),
        ("ij...,ji...->...", (2, 2)),
        ("ij...,jk...->ik...", (2, 2)),
        ("ij...,ii...->j...", (2, 2)),
        ("ii...,ij...->j...", (2, 2)),
        ("i...,i...->i...", (3,)),
    ],
)
def test_einsum_of_a_series_with_itself(subscripts, shape, columns):
    c = sample(np.random.default_rng(8), (*shape, columns), order=9)
    found = taylor(lambda x: np.einsum(subscripts, x, x), c)
    np.testing.assert_allclose(found, convolved(subscripts, c, c), rtol=1e-12, atol=1e-14)


def test_einsum_of_itself_with_the_ellipsis_in_two_places():
    n = 60
    c = sample(np.random.default_rng(9), (n, n), order=6)
    assert n * n >= recurrences.LARGE
    found = taylor(lambda x: np.einsum("i...,...i->...", x, x), c)
    np.testing.assert_allclose(found, convolved("i...,...i->...", c, c), rtol=1e-12, atol=1e-14)


def test_einsum_says_what_it_takes():
    with pytest.raises(ValueError, match="left,right->out"):
        taylor(lambda x: np.einsum("i,i", x, x), np.ones((2, 3)))


LINEAR = {
    "matmul of a vector": (lambda x: np.arange(6.0).reshape(2, 3) @ x[:, 0], (3, 4)),
    "matmul of a matrix": (lambda x: np.arange(6.0).reshape(2, 3) @ x, (3, 4)),
    "matmul of a pile": (lambda x: np.arange(6.0).reshape(2, 3) @ x, (5, 3, 4)),
    "index": (lambda x: x[1], (3, 4)),
    "index to a number": (lambda x: x[1, 2], (3, 4)),
    "slice": (lambda x: x[1:, ::2], (3, 4)),
    "new axis": (lambda x: x[:, None, 1], (3, 4)),
    "ellipsis": (lambda x: x[..., 2], (3, 4)),
    "sum of the first axis": (lambda x: np.sum(x, axis=0), (3, 4)),
    "sum of the last axis": (lambda x: x.sum(-1), (3, 4)),
    "sum of all": (np.sum, (3, 4)),
    "stack": (lambda x: np.stack([x[0], 2.0 * x[1], x[0] - x[2]]), (3, 4)),
    "stack in the middle": (lambda x: np.stack([x, -x], axis=1), (3, 4)),
    "stack at the end": (lambda x: np.stack([x, -x], axis=-1), (3, 4)),
    "where": (lambda x: np.where(np.array([True, False, True, True]), x, 3.0 * x), (3, 4)),
    "linear map": (lambda x: running_sums(x), (3, 4)),  # noqa: PLW0108
}


def running_sums(x):
    """Running sums along the last axis, as an operator that numpy on series does not know."""
    return (
        np.cumsum(x, axis=-1)
        if isinstance(x, np.ndarray)
        else linear_map(lambda c: np.cumsum(c, axis=-1), x)
    )


@pytest.mark.parametrize("name", LINEAR)
def test_linear_operation_acts_on_every_order(name):
    law, shape = LINEAR[name]
    c = sample(np.random.default_rng(10), shape, order=4)
    expected = np.array([law(order) for order in c])
    np.testing.assert_allclose(taylor(law, c), expected, rtol=1e-13, atol=1e-14)


def test_stack_and_where_take_constants():
    c = sample(np.random.default_rng(11), (3,), order=3)
    ones = np.ones(3)
    stacked = taylor(lambda x: np.stack([ones, x, 2.0 * ones]), c)
    np.testing.assert_array_equal(stacked[0], [ones, c[0], 2.0 * ones])
    np.testing.assert_array_equal(stacked[1:, 1], c[1:])
    assert not stacked[1:, [0, 2]].any()
    chosen = taylor(lambda x: np.where([True, False, True], x, 7.0), c)
    np.testing.assert_array_equal(chosen[:, 1], [7.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(chosen[:, ::2], c[:, ::2])


def test_branch_not_taken_leaves_no_trace():
    c = np.zeros((4, 2))
    c[0], c[1] = [4.0, 0.0], 1.0
    with np.errstate(all="ignore"):
        found = taylor(lambda x: np.where(x > 1.0, np.sqrt(x), x), c)
    np.testing.assert_array_equal(found[:, 1], [0.0, 1.0, 0.0, 0.0])
    assert_close(found[:, 0], taylor(np.sqrt, c[:, 0]))


def test_comparisons_are_plain_booleans():
    x = (tape := Tape(2)).variable([1.0, 3.0])
    for found, expected in [
        (x > 2.0, [False, True]),
        (x >= 1.0, [True, True]),
        (x < 2.0, [True, False]),
        (x <= 1.0, [True, False]),
        (x == 3.0, [False, True]),
        (x != 3.0, [True, False]),
        (np.isfinite(x), [True, True]),
        (np.isnan(x), [False, False]),
    ]:
        assert type(found) is np.ndarray and found.dtype == bool
        np.testing.assert_array_equal(found, expected)
    assert not tape.computed


def test_unknown_function_is_refused():
    tape = Tape(2)
    x = tape.variable([1.0, 3.0])
    with pytest.raises(TypeError):
        np.arctan(x)
    with pytest.raises(TypeError):
        np.add(np.ones(2), x, out=np.ones(2))


def law_of_everything(x, y):
    """Every operation once, from (3, n) and (n,) to (2, n)."""
    square = np.einsum("i...,i...->...", x, x) + 0.5
    length = np.sqrt(square)
    pull = np.einsum("ab,b...->a...", np.array([[1.0, 2.0, 0.5], [0.3, 1.0, 1.0]]), x)
    twist = np.stack([np.sin(y) * x[0], np.cos(x[1]) / (1.0 + y * y)])
    slope = np.tanh(length - 0.5) / length + np.exp(-y) * np.log(square)
    power = square ** (-0.45) - np.where(y.value > 0.0 if hasattr(y, "value") else y > 0.0, y, -y)
    total = np.sum(x, axis=0) - np.square(y)
    return pull * slope + twist * power - np.stack([total, 2.0 * total]) / 3.0


def sampled_inputs(n=4, order=6):
    rng = np.random.default_rng(12)
    x, y = sample(rng, (3, n), 0.7, order), sample(rng, (n,), 0.2, order)
    y[0, ::2] *= -1.0
    return x, y


def test_order_by_order_correction_equals_known_input():
    """The way of the ANM: each order first as if zero, then completed."""
    c_x, c_y = sampled_inputs()
    whole = taylor(law_of_everything, c_x, c_y)
    tape = Tape(len(c_x) - 1)
    x, y = tape.variable(c_x[0]), tape.variable(c_y[0])
    out = law_of_everything(x, y)
    for k in range(1, tape.order + 1):
        tape.advance(k)
        tape.correct(k, {x: c_x[k]})
        tape.correct(k, {y: c_y[k]})
        np.testing.assert_array_equal(x.coefficients[k], c_x[k])
    np.testing.assert_allclose(out.coefficients, whole, rtol=1e-12, atol=1e-13)


def test_advance_may_be_repeated():
    c_x, c_y = sampled_inputs()
    tape = Tape(len(c_x) - 1)
    x, y = tape.variable(c_x[0]), tape.variable(c_y[0])
    out = law_of_everything(x, y)
    for k in range(1, tape.order + 1):
        tape.advance(k)
        x.coefficients[k], y.coefficients[k] = c_x[k], c_y[k]
        tape.advance(k)
    np.testing.assert_allclose(
        out.coefficients, taylor(law_of_everything, c_x, c_y), rtol=1e-12, atol=1e-13
    )


def test_derivative_is_order_one_and_finite_difference():
    c_x, c_y = sampled_inputs(order=1)
    tape = Tape(1)
    x, y = tape.variable(c_x[0]), tape.variable(c_y[0])
    out = law_of_everything(x, y)
    found = tape.derivative(out, {x: c_x[1], y: c_y[1]})
    np.testing.assert_allclose(found, taylor(law_of_everything, c_x, c_y)[1], rtol=1e-12)
    h = 1e-5
    ahead, behind = (law_of_everything(c_x[0] + s * c_x[1], c_y[0] + s * c_y[1]) for s in (h, -h))
    np.testing.assert_allclose(found, (ahead - behind) / (2.0 * h), rtol=1e-7, atol=1e-8)


def batches():
    for name, (law, shape) in LINEAR.items():
        yield pytest.param(law, (shape,), id=name)
    for name, (law, _) in FUNCTIONS.items():
        yield pytest.param(law, ((3, 4),), id=name)
    for name, law in BINARY.items():
        for shapes in SHAPES:
            yield pytest.param(law, shapes, id=f"{name} {shapes}")
    for subscripts, left, right in PAIRS:
        law = lambda x, y, s=subscripts: np.einsum(s, x, y)  # noqa: E731
        yield pytest.param(law, (left, right), id=subscripts)
    itself = lambda x: np.einsum("ia...,ib...->ab...", x, x)  # noqa: E731
    yield pytest.param(itself, ((3, 2, 4),), id="itself")
    yield pytest.param(itself, ((3, 2, recurrences.LARGE),), id="itself, large")
    mixed = lambda x, y: np.stack([np.ones(4), x[0] * y, y])  # noqa: E731
    yield pytest.param(mixed, ((3, 4), (4,)), id="stack with a constant")
    yield pytest.param(law_of_everything, ((3, 4), (4,)), id="law of everything")


@pytest.mark.parametrize(("law", "shapes"), list(batches()))
def test_derivative_of_many_directions_at_once(law, shapes):
    rng = np.random.default_rng(13)
    tape = Tape(1)
    inputs = [tape.variable(1.3 + 0.3 * rng.uniform(-1.0, 1.0, shape)) for shape in shapes]
    out = law(*inputs)
    seeds = [rng.standard_normal((5, *shape)) for shape in shapes]
    together = tape.derivative(out, dict(zip(inputs, seeds, strict=True)))
    assert together.shape == (5, *out.shape)
    for i in range(5):
        one = tape.derivative(out, {x: s[i] for x, s in zip(inputs, seeds, strict=True)})
        np.testing.assert_allclose(together[i], one, rtol=1e-12, atol=1e-13)
    for x, s in zip(inputs, seeds, strict=True):
        alone = tape.derivative(out, {x: s})
        assert alone.shape == together.shape
        one = tape.derivative(out, {x: s[0]})
        np.testing.assert_allclose(alone[0], one, rtol=1e-12, atol=1e-13)


def test_derivative_of_what_does_not_depend():
    tape = Tape(1)
    x, y = tape.variable([1.0, 2.0]), tape.variable(3.0)
    out = np.sin(x)
    assert y.shape == ()
    np.testing.assert_array_equal(tape.derivative(out, {y: np.ones(4)}), np.zeros((4, 2)))


def test_changes_of_single_numbers():
    tape = Tape(2)
    t = tape.variable(2.0)
    out = t * t * np.array([1.0, 2.0])
    tape.advance(1)
    tape.correct(1, {t: 1.0})
    np.testing.assert_array_equal(out.coefficients[1], [4.0, 8.0])
    np.testing.assert_array_equal(tape.derivative(out, {t: 1}), [4.0, 8.0])


def test_all_orders_cost_quadratically(monkeypatch):
    """Terms of all Cauchy sums for twice the order: four times as many."""
    terms = []
    cauchy, weighted = recurrences.cauchy, recurrences._weighted

    def counted(a, b, k, first, stop):
        terms.append(stop - first)
        return cauchy(a, b, k, first, stop)

    def weighted_counted(weights, a, b, k):
        terms.append(k - 1)
        return weighted(weights, a, b, k)

    monkeypatch.setattr(recurrences, "cauchy", counted)
    monkeypatch.setattr(recurrences, "_weighted", weighted_counted)
    work = []
    for order in (20, 40):
        terms.clear()
        c = sample(np.random.default_rng(14), order=order)
        taylor(lambda x: np.exp(np.sqrt(x)) / np.tanh(x), c)
        work.append(sum(terms))
    assert 3.5 < work[1] / work[0] <= 4.3
    assert work[0] < 5 * 20**2 / 2


def test_nothing_is_traced_again():
    calls = []

    def law(x):
        calls.append(type(x))
        return x * x

    taylor(law, np.ones(21))
    assert len(calls) == 1


def test_memory_is_free_without_the_garbage_collector():
    gc.disable()
    try:
        tape = Tape(3)
        x = tape.variable(np.ones(5))
        out = law_of_everything(np.stack([x, x, x]), x)
        kept = weakref.ref(tape)
        coefficients = weakref.ref(out.coefficients)
        del tape, x, out
        assert kept() is None
        assert coefficients() is None
    finally:
        gc.enable()


def test_series_without_its_tape_says_so():
    x = Tape(3).variable(1.0)
    with pytest.raises(ReferenceError, match="keep it"):
        np.sqrt(x)


def test_every_function_has_a_test():
    """A function added to the table comes with a name in the lists above."""
    covered = {np.add, np.subtract, np.multiply, np.divide, np.power, np.matmul} | {
        np.negative, np.square, np.sqrt, np.exp, np.log, np.tanh, np.sin, np.cos,
    }  # fmt: skip
    assert set(dispatch.UFUNCS) == covered
    assert set(dispatch.FUNCTIONS) == {np.einsum, np.where, np.sum, np.stack}


def test_horner_and_derivative_coefficients():
    c = np.array([[1.0, 2.0], [0.5, -1.0], [3.0, 4.0]])
    np.testing.assert_allclose(value_at(c, 0.1), c[0] + 0.1 * c[1] + 0.01 * c[2], rtol=1e-15)
    np.testing.assert_array_equal(derivative_coefficients(c), [[0.5, -1.0], [6.0, 8.0]])
    assert value_at(np.array([2.0, 3.0]), 2.0) == 8.0
    before = c.copy()
    value_at(c, 0.3)
    np.testing.assert_array_equal(c, before)
