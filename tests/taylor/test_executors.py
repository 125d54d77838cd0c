"""Both executors on the same recordings, and on arrays with a row for every entry."""

import numpy as np
import pytest

pytest.importorskip("numba")

from anmstrip.taylor import program
from anmstrip.taylor.compiled import CompiledExecutor
from anmstrip.taylor.program import NumpyExecutor
from anmstrip.taylor.series import record

ORDER, POINTS = 12, 150
MATRIX = np.arange(9.0).reshape(3, 3) - 2.0
EACH = np.linspace(0.5, 2.0, POINTS)
MATRICES = MATRIX[:, :, None] * EACH

LAWS = {
    "shifted and scaled": lambda x, s: (2.5 - x) * EACH + x * 0.5 - EACH,
    "a control on all points": lambda x, s: x * s + (np.array([1.0, 2.0, 3.0]) * s)[:, None],
    "a control that belongs to points": lambda x, s: (
        x * np.stack([s, s * 2.0], axis=-1)[..., np.arange(POINTS) % 2]
    ),
    "a control for each point": lambda x, s: x * (s * EACH),
    "matrix": lambda x, s: np.einsum("ij,j...->i...", MATRIX, x),
    "matrix of each point": lambda x, s: np.einsum(
        "ij...,j...->i...", MATRIX[:, :, None] * EACH, x
    ),
    "factors by label": lambda x, s: np.einsum("p,ip->ip", EACH, x),
    "gram": lambda x, s: np.einsum("i...,j...->ij...", x, x)[:, 0],
    "norm": lambda x, s: x / np.sqrt(np.einsum("i...,i...->...", x, x)),
    "two vectors": lambda x, s: np.einsum("i...,i...->...", x, x * x + 1.0) * x,
    "sum": lambda x, s: x * x.sum(0) + np.sum(x),
    "chosen": lambda x, s: np.where(x > 1.0, x * x, 3.0 - x) + np.where(EACH > 1.0, x, 0.0),
    "chosen whole": lambda x, s: np.where(s > 0.0, x * x, x),
    "compared": lambda x, s: x * ((x >= 1.0) & ~(x == s)) + x * ((x < 0.9) | np.isnan(x)),
    "stacked": lambda x, s: np.stack([x[1] * -1.0, x[0], np.zeros(POINTS)]),
    "quotient": lambda x, s: 1.0 / x + x[0] / (x + 0.2),
    "power": lambda x, s: x**-0.95 + x**3 + np.square(x),
    "exponential": lambda x, s: np.exp(x * 0.3) + np.log(x),
    "circular": lambda x, s: np.sin(x) * np.cos(2.0 * x) + np.cos(x),
    "tanh": lambda x, s: np.tanh(x - 1.0),
}
MIXED = {
    "sum": LAWS["sum"],
    "points reversed": lambda x, s: x[:, ::-1] * x,
    "one of the points": lambda x, s: x[:, :1] * x,
    "product over the points": lambda x, s: np.einsum("ip,ip->i", x, x),
    "points as components": lambda x, s: np.einsum("p,ip->i", EACH, x),
    "points against points": lambda x, s: np.einsum("ip,iq->pq", x[:, :5], x[:, 5:9]),
    "stacked behind the points": lambda x, s: np.stack([x, x * x], axis=-1),
}


@pytest.fixture(autouse=True)
def several_blocks(monkeypatch):
    """Three of them, the last with lanes to spare."""
    for executor in (CompiledExecutor, NumpyExecutor):
        monkeypatch.setattr(executor, "block", 64)


def state(points=POINTS):
    """A random state of the laws."""
    return np.random.default_rng(3).uniform(0.8, 1.4, (3, points)), 0.7


def coefficients(law, points, *, compiled, state=None):
    """All orders along random inputs, the way of the ANM, then with given inputs."""
    rng = np.random.default_rng(5)
    x, s = globals()["state"]() if state is None else state
    recorded = record(law, x, s, points=points, compiled=compiled)
    assert isinstance(recorded.executor, CompiledExecutor if compiled else NumpyExecutor)
    orders, again = (recorded.start(x, s, order=ORDER) for _ in range(2))
    found = [orders.value]
    for k in range(1, ORDER + 1):
        found.append(orders.advance(k))
        change, rate = rng.uniform(-1.0, 1.0, x.shape) * 0.5**k, 0.3 if k == 1 else None
        orders.correct(change, rate)
        found.append(again.advance(k, change, rate))
    return recorded, np.array(found)


def assert_close(found, expected):
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= 1e-13 * np.maximum(np.abs(expected), 1.0).max()


@pytest.mark.parametrize("name", sorted(LAWS))
def test_same_orders(name):
    _, alone = coefficients(LAWS[name], 1, compiled=False)
    recorded, found = coefficients(LAWS[name], POINTS, compiled=True)
    assert (recorded.points == POINTS) == (name not in MIXED)
    assert_close(found, alone)
    assert_close(coefficients(LAWS[name], POINTS, compiled=False)[1], alone)


@pytest.mark.parametrize("name", sorted(LAWS))
def test_same_derivatives(name):
    rng = np.random.default_rng(8)
    x, s = state()
    seeds = rng.normal(size=(4, *x.shape)), rng.normal(size=4)
    found = [
        record(LAWS[name], x, s, points=points, compiled=compiled).start(x, s).derivative(*seeds)
        for points, compiled in ((1, False), (POINTS, True), (POINTS, False))
    ]
    assert found[0].shape == (4, *LAWS[name](x, s).shape)
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("name", sorted(LAWS))
def test_order_zero_is_the_law_itself(name):
    x, s = state()
    for compiled in (True, False):
        found = record(LAWS[name], x, s, points=POINTS, compiled=compiled).start(x, s).value
        np.testing.assert_allclose(found, LAWS[name](x, s), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("points", [1, 3, 63, 64, 65, 200])
def test_any_number_of_points(points):
    def law(x, s):
        return np.einsum("i...,i...->...", x, x) * x / np.sqrt(x + (s * np.ones(3))[:, None])

    _, expected = coefficients(law, 1, compiled=False, state=state(points))
    recorded, found = coefficients(law, points, compiled=True, state=state(points))
    # three points are not to be told from three components
    assert recorded.points == (1 if points == 3 else points)
    assert_close(found, expected)


def test_no_points_at_all():
    x, s = state(0)
    law = lambda x, s: np.stack([x[1] * s, np.where(x[0] > s, x[0], np.sqrt(x[2]))])  # noqa: E731
    for compiled in (True, False):
        orders = record(law, x, s, points=0, compiled=compiled).start(x, s, order=3)
        orders.correct(x, 1.0)
        assert orders.value.shape == orders.advance(2).shape == (2, 0)
        assert orders.derivative(np.ones((5, 3, 0)), None).shape == (5, 2, 0)


@pytest.mark.parametrize("name", sorted(MIXED))
def test_a_law_that_mixes_points_has_a_row_for_every_entry(name):
    x, s = state(12)
    law = MIXED[name]
    if name == "points as components":
        law = lambda x, s: np.einsum("p,ip->i", EACH[:12], x)  # noqa: E731
    recorded = record(law, x, s, points=12)
    assert recorded.points == 1
    np.testing.assert_allclose(recorded.start(x, s).value, law(x, s), rtol=1e-14)


def test_numpy_without_numba(monkeypatch):
    monkeypatch.setattr(program, "COMPILED", False)
    recorded = record(LAWS["norm"], *state(), points=POINTS, compiled=True)
    assert isinstance(recorded.executor, NumpyExecutor)


def test_products_are_computed_once():
    """The nine entries of a Gram matrix have six different rows."""
    recorded = record(lambda x, s: np.einsum("i...,j...->ij...", x, x), *state(), points=POINTS)
    assert len(set(recorded.tables.outputs.tolist())) == 6


def test_only_what_lower_orders_are_needed_of_is_kept():
    """Of N F and E = F·F: F and N, not E, not the input itself, not the result."""
    law = lambda x, s: (x + 1.0) * (np.sum(np.square(x + 1.0), 0) * 2.0 - 1.0)  # noqa: E731
    recorded = record(law, *state(), points=POINTS)
    assert recorded.kept == 4
    assert recorded.nbytes(9) == 4 * 10 * POINTS * 8
