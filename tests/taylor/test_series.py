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

from anmstrip.taylor import program, series
from anmstrip.taylor.series import RecordedFunction, Series, record, taylor_series

LARGE = 2000
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
        assert_close(taylor_series(ours, c), composed(theirs, exact(c)), 1e-13)


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
        assert_close(taylor_series(ours, c), composed(theirs, exact(c)), 1e-11)


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("shape", [(2,), (2, 3), (1, LARGE + 1)])
def test_arrays_are_treated_entry_by_entry(name, shape):
    ours, _ = FUNCTIONS[name]
    order = 9
    c = sample(np.random.default_rng(2), shape, order=order)
    whole = taylor_series(ours, c)
    assert whole.shape == c.shape
    for i in ((0,) * len(shape), tuple(n - 1 for n in shape)):
        assert_close(whole[:, *i], taylor_series(ours, c[:, *i]), 1e-14)


def test_negative_base_has_integer_powers():
    with mpmath.workdps(40):
        c = sample(np.random.default_rng(3), base=-1.3, order=12)
        for n in (-3.0, -1.0, 2.0, 5.0):
            reference = composed(lambda x, n=n: x ** int(n), exact(c))
            assert_close(taylor_series(lambda x, n=n: x**n, c), reference, 1e-12)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 4, 5, 6, 9])
def test_positive_integer_powers_hold_at_zero(n):
    c = np.zeros(11)
    c[1] = 2.0
    expected = np.zeros(11)
    expected[n] = 2.0**n
    np.testing.assert_array_equal(taylor_series(lambda x: x**n, c), expected)


def test_tanh_does_not_overflow():
    c = np.array([800.0, 1.0, 0.5, 0.1])
    np.testing.assert_allclose(taylor_series(np.tanh, c), [1.0, 0.0, 0.0, 0.0], rtol=0, atol=1e-300)


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
        found = taylor_series(lambda y: operation(a[0], y), b)
    elif second == "constant":
        b[1:] = 0.0
        found = taylor_series(lambda x: operation(x, b[0]), a)
    else:
        found = taylor_series(operation, a, b)
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
        assert_close(taylor_series(BINARY[name], a, b), expected, 1e-13)


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
    found = taylor_series(lambda x, y: np.einsum(subscripts, x, y), a, b)
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
    np.testing.assert_allclose(taylor_series(law, c), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("columns", [4, LARGE])
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
    found = taylor_series(lambda x: np.einsum(subscripts, x, x), c)
    np.testing.assert_allclose(found, convolved(subscripts, c, c), rtol=1e-12, atol=1e-14)


def test_einsum_of_itself_with_the_ellipsis_in_two_places():
    n = 12
    c = sample(np.random.default_rng(9), (n, n), order=6)
    found = taylor_series(lambda x: np.einsum("i...,...i->...", x, x), c)
    np.testing.assert_allclose(found, convolved("i...,...i->...", c, c), rtol=1e-12, atol=1e-14)


def test_einsum_says_what_it_takes():
    with pytest.raises(ValueError, match="left,right->out"):
        taylor_series(lambda x: np.einsum("i,i", x, x), np.ones((2, 3)))


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
}


@pytest.mark.parametrize("name", LINEAR)
def test_linear_operation_acts_on_every_order(name):
    law, shape = LINEAR[name]
    c = sample(np.random.default_rng(10), shape, order=4)
    expected = np.array([law(order) for order in c])
    np.testing.assert_allclose(taylor_series(law, c), expected, rtol=1e-13, atol=1e-14)


def test_stack_and_where_take_constants():
    c = sample(np.random.default_rng(11), (3,), order=3)
    ones = np.ones(3)
    stacked = taylor_series(lambda x: np.stack([ones, x, 2.0 * ones]), c)
    np.testing.assert_array_equal(stacked[0], [ones, c[0], 2.0 * ones])
    np.testing.assert_array_equal(stacked[1:, 1], c[1:])
    assert not stacked[1:, [0, 2]].any()
    chosen = taylor_series(lambda x: np.where([True, False, True], x, 7.0), c)
    np.testing.assert_array_equal(chosen[:, 1], [7.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(chosen[:, ::2], c[:, ::2])


def test_branch_not_taken_leaves_no_trace():
    c = np.zeros((4, 2))
    c[0], c[1] = [4.0, 0.0], 1.0
    with np.errstate(all="ignore"):
        found = taylor_series(lambda x: np.where(x > 1.0, np.sqrt(x), x), c)
    np.testing.assert_array_equal(found[:, 1], [0.0, 1.0, 0.0, 0.0])
    assert_close(found[:, 0], taylor_series(np.sqrt, c[:, 0]))


CONDITIONS = {
    "greater": (lambda x: x > 2.0, [0, 1, 0, 0]),
    "greater or equal": (lambda x: x >= 1.0, [1, 1, 0, 0]),
    "less": (lambda x: x < 2.0, [1, 0, 0, 1]),
    "less or equal": (lambda x: x <= 1.0, [1, 0, 0, 1]),
    "equal": (lambda x: x == 3.0, [0, 1, 0, 0]),
    "not equal": (lambda x: x != 3.0, [1, 0, 1, 1]),
    "finite": (np.isfinite, [1, 1, 0, 0]),
    "no number": (np.isnan, [0, 0, 1, 0]),
    "not": (lambda x: ~(x > 2.0), [1, 0, 1, 1]),
    "both": (lambda x: (x > 0.0) & np.logical_not(x > 2.0), [1, 0, 0, 0]),
    "either": (lambda x: (x > 2.0) | np.isnan(x), [0, 1, 1, 0]),
    "both, one known": (lambda x: (x > 0.0) & np.array([True, False, True, True]), [1, 0, 0, 0]),
}


@pytest.mark.parametrize("name", CONDITIONS)
def test_conditions_are_zeros_and_ones_of_order_zero(name):
    law, expected = CONDITIONS[name]
    x = np.array([1.0, 3.0, np.nan, -np.inf])
    np.testing.assert_array_equal(law(x), np.array(expected, dtype=bool))
    found = taylor_series(law, np.array([x, np.ones(4), np.ones(4)]))
    np.testing.assert_array_equal(found, [expected, np.zeros(4), np.zeros(4)])


def test_conditions_are_looked_at_again_at_every_state():
    """One recording, started on both sides of a branch."""
    program = record(lambda x: np.where(x > 1.0, x * x, 3.0 * x), np.zeros(2), points=2)
    assert program.reusable
    for x in ([0.5, 2.0], [2.0, 0.5]):
        orders = program.start(x)
        np.testing.assert_array_equal(
            orders.value, np.where(np.array(x) > 1.0, [4.0] * 2, [1.5] * 2)
        )
        found = orders.derivative(np.ones(2))
        np.testing.assert_array_equal(found, np.where(np.array(x) > 1.0, [4.0] * 2, [3.0] * 2))


@pytest.mark.parametrize(
    "law",
    [
        lambda x: x * x if np.any(x > 1.0) else 3.0 * x,
        lambda x: x * x if not np.all(x <= 1.0) else 3.0 * x,
        lambda x: x * x if x[0] > 1.0 else 3.0 * x,
        lambda x: x * x if isinstance(x, Series) and x.value[0] > 1.0 else 3.0 * x,
    ],
)
def test_a_law_that_decides_by_values_is_recorded_at_each_state(law):
    function = RecordedFunction(law)
    below, above = (function.start([x]) for x in (0.5, 2.0))
    assert not below.program.reusable
    assert (below.value, above.value) == ([1.5], [4.0])


def test_a_law_is_recorded_once_for_the_same_shapes():
    calls = []
    function = RecordedFunction(lambda x: calls.append(1) or x * x)
    assert [float(function.start(x).value) for x in (1.0, 2.0, 3.0)] == [1.0, 4.0, 9.0]
    assert len(calls) == 1
    assert function.start([1.0, 2.0]).value.tolist() == [1.0, 4.0]
    assert len(calls) == 2


def test_unknown_function_is_refused():
    with pytest.raises(TypeError):
        record(np.arctan, [1.0, 3.0])
    with pytest.raises(TypeError):
        record(lambda x: np.add(np.ones(2), x, out=np.ones(2)), [1.0, 3.0])


def test_what_does_not_depend_on_the_input_is_constant():
    found = taylor_series(lambda x: np.ones((2, 3)), np.ones((4, 3)))
    np.testing.assert_array_equal(found, np.concatenate([np.ones((1, 2, 3)), np.zeros((3, 2, 3))]))


def law_of_everything(x, y):
    """Every operation once, from (3, n) and (n,) to (2, n)."""
    square = np.einsum("i...,i...->...", x, x) + 0.5
    length = np.sqrt(square)
    pull = np.einsum("ab,b...->a...", np.array([[1.0, 2.0, 0.5], [0.3, 1.0, 1.0]]), x)
    twist = np.stack([np.sin(y) * x[0], np.cos(x[1]) / (1.0 + y * y)])
    slope = np.tanh(length - 0.5) / length + np.exp(-y) * np.log(square)
    power = square ** (-0.45) - np.where(y > 0.0, y, -y)
    total = np.sum(x, axis=0) - np.square(y)
    return pull * slope + twist * power - np.stack([total, 2.0 * total]) / 3.0


def sampled_inputs(n=4, order=6):
    rng = np.random.default_rng(12)
    x, y = sample(rng, (3, n), 0.7, order), sample(rng, (n,), 0.2, order)
    y[0, ::2] *= -1.0
    return x, y


def started(law, *coefficients, points=1):
    values = [c[0] for c in coefficients]
    return record(law, *values, points=points).start(*values, order=len(coefficients[0]) - 1)


@pytest.mark.parametrize("points", [1, 4])
def test_order_by_order_correction_equals_known_input(points):
    """The way of the ANM: each order first as if zero, then completed."""
    c_x, c_y = sampled_inputs()
    whole = taylor_series(law_of_everything, c_x, c_y)
    orders = started(law_of_everything, c_x, c_y, points=points)
    np.testing.assert_allclose(orders.value, whole[0], rtol=1e-13)
    for k in range(1, len(c_x)):
        found = orders.advance(k) + orders.derivative(c_x[k], c_y[k])
        np.testing.assert_allclose(found, whole[k], rtol=1e-12, atol=1e-13)
        orders.correct(c_x[k], None)
        orders.correct(None, c_y[k])


def test_advance_may_be_repeated():
    c_x, c_y = sampled_inputs()
    whole = taylor_series(law_of_everything, c_x, c_y)
    orders = started(law_of_everything, c_x, c_y)
    for k in range(1, len(c_x)):
        orders.advance(k)
        found = orders.advance(k, c_x[k], c_y[k])
        np.testing.assert_allclose(found, whole[k], rtol=1e-12, atol=1e-13)


def test_an_order_may_be_corrected_after_the_next():
    c_x, c_y = sampled_inputs()
    whole = taylor_series(law_of_everything, c_x, c_y)
    orders = started(law_of_everything, c_x, c_y)
    orders.advance(1, c_x[1], None)
    orders.advance(2)
    orders.correct(None, c_y[1])
    found = orders.advance(2, c_x[2], c_y[2])
    np.testing.assert_allclose(found, whole[2], rtol=1e-12, atol=1e-13)


def test_derivative_is_order_one_and_finite_difference():
    c_x, c_y = sampled_inputs(order=1)
    found = started(law_of_everything, c_x, c_y).derivative(c_x[1], c_y[1])
    np.testing.assert_allclose(found, taylor_series(law_of_everything, c_x, c_y)[1], rtol=1e-12)
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
    yield pytest.param(itself, ((3, 2, LARGE),), id="itself, large")
    mixed = lambda x, y: np.stack([np.ones(4), x[0] * y, y])  # noqa: E731
    yield pytest.param(mixed, ((3, 4), (4,)), id="stack with a constant")
    yield pytest.param(law_of_everything, ((3, 4), (4,)), id="law of everything")


@pytest.mark.parametrize(("law", "shapes"), list(batches()))
def test_derivative_of_many_directions_at_once(law, shapes):
    rng = np.random.default_rng(13)
    values = [1.3 + 0.3 * rng.uniform(-1.0, 1.0, shape) for shape in shapes]
    orders = record(law, *values, points=values[0].shape[-1] if shapes[0] else 1).start(*values)
    seeds = [rng.standard_normal((5, *shape)) for shape in shapes]
    together = orders.derivative(*seeds)
    assert together.shape == (5, *orders.value.shape)
    for i in range(5):
        one = orders.derivative(*(seed[i] for seed in seeds))
        np.testing.assert_allclose(together[i], one, rtol=1e-12, atol=1e-13)
    parts = []
    for i, seed in enumerate(seeds):
        alone = orders.derivative(*(seed if j == i else None for j in range(len(seeds))))
        assert alone.shape == together.shape
        parts.append(alone)
    np.testing.assert_allclose(sum(parts), together, rtol=1e-12, atol=1e-12)


def test_derivative_of_what_does_not_depend():
    orders = record(lambda x, y: np.sin(x), [1.0, 2.0], 3.0).start([1.0, 2.0], 3.0)
    np.testing.assert_array_equal(orders.derivative(None, np.ones(4)), np.zeros((4, 2)))


def test_changes_of_single_numbers():
    orders = record(lambda t: t * t * np.array([1.0, 2.0]), 2.0).start(2.0, order=2)
    np.testing.assert_array_equal(orders.advance(1, 1.0), [4.0, 8.0])
    np.testing.assert_array_equal(orders.derivative(1), [4.0, 8.0])
    np.testing.assert_array_equal(orders.advance(2), [1.0, 2.0])


def test_all_orders_cost_quadratically(monkeypatch):
    """Terms of all Cauchy sums for twice the order: four times as many."""
    terms = []

    def counted(a, b, k, weights=None):
        terms.append(k + 1 if weights is None else len(weights))
        return cauchy(a, b, k, weights)

    cauchy = program._cauchy
    monkeypatch.setattr(program, "_cauchy", counted)
    work = []
    for order in (20, 40):
        terms.clear()
        c = sample(np.random.default_rng(14), order=order)
        taylor_series(lambda x: np.exp(np.sqrt(x)) / np.tanh(x), c)
        work.append(sum(terms))
    assert 3.5 < work[1] / work[0] <= 4.3
    assert work[0] < 6 * 20**2 / 2


def test_nothing_is_traced_again():
    calls = []

    def law(x):
        calls.append(type(x))
        return x * x

    taylor_series(law, np.ones(21))
    assert len(calls) == 1


def test_memory_is_free_without_the_garbage_collector():
    gc.disable()
    try:
        x = np.ones(5)
        program = record(lambda x: law_of_everything(np.stack([x, x, x]), x), x, points=5)
        orders = program.start(x, order=3)
        kept = weakref.ref(program), weakref.ref(orders.w)
        del program, orders
        assert [reference() for reference in kept] == [None, None]
    finally:
        gc.enable()


def test_every_function_has_a_test():
    """A function added to the table comes with a name in the lists above."""
    covered = {np.add, np.subtract, np.multiply, np.divide, np.power, np.matmul} | {
        np.negative, np.square, np.sqrt, np.exp, np.log, np.tanh, np.sin, np.cos,
        np.greater, np.greater_equal, np.less, np.less_equal, np.equal, np.not_equal,
        np.isfinite, np.isnan, np.invert, np.logical_not,
        np.bitwise_and, np.logical_and, np.bitwise_or, np.logical_or,
    }  # fmt: skip
    assert set(series.UFUNCS) == covered
    assert set(series.FUNCTIONS) == {np.einsum, np.where, np.sum, np.stack, np.any, np.all}


@pytest.mark.parametrize("inputs", [(), ([],), (3.0,), ([1.0, 2.0], [1.0])])
def test_inputs_without_one_order_are_refused(inputs):
    with pytest.raises(ValueError, match="all of one order"):
        taylor_series(lambda *x: x[0], *inputs)
