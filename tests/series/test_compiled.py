"""Compiled programs against the interpreted tape: the same to round-off, order by order."""

import numpy as np
import pytest

pytest.importorskip("numba")

from anmstrip.series import compiled
from anmstrip.series.compiled import Program, orders_of
from anmstrip.series.power_series import Recorded, Tape

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
    "matrix": lambda x, s: np.einsum("ij,j...->i...", MATRIX, x),
    "matrix of each point": lambda x, s: np.einsum(
        "ij...,j...->i...", MATRIX[:, :, None] * EACH, x
    ),
    "gram": lambda x, s: np.einsum("i...,j...->ij...", x, x)[:, 0],
    "norm": lambda x, s: x / np.sqrt(np.einsum("i...,i...->...", x, x)),
    "two vectors": lambda x, s: np.einsum("i...,i...->...", x, x * x + 1.0) * x,
    "sum": lambda x, s: x * x.sum(0) + np.sum(x),
    "chosen": lambda x, s: np.where(x > 1.0, x * x, 3.0 - x) + np.where(EACH > 1.0, x, 0.0),
    "chosen whole": lambda x, s: np.where(s > 0.0, x * x, x),
    "stacked": lambda x, s: np.stack([x[1] * -1.0, x[0], np.zeros(POINTS)]),
    "quotient": lambda x, s: 1.0 / x + x[0] / (x + 0.2),
    "power": lambda x, s: x**-0.95 + x**3 + np.square(x),
    "exponential": lambda x, s: np.exp(x * 0.3) + np.log(x),
    "circular": lambda x, s: np.sin(x) * np.cos(2.0 * x),
    "tanh": lambda x, s: np.tanh(x - 1.0),
}
SUMS_OVER_POINTS = {"sum"}


@pytest.fixture(autouse=True)
def several_blocks(monkeypatch):
    """Three of them, the last with lanes to spare."""
    monkeypatch.setattr(compiled, "BLOCK", 64)


def started(law, order=ORDER, points=POINTS):
    """Inputs, output and tape of a law at a random state."""
    rng = np.random.default_rng(3)
    tape = Tape(order)
    x, s = tape.variable(rng.uniform(0.8, 1.4, (3, points))), tape.variable(0.7)
    return tape, x, s, law(x, s)


def coefficients(orders, x, s, seed=5):
    """Orders 2 … of the output along random inputs."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(1, ORDER + 1):
        if k > 1:
            found.append(np.array(orders.advance(k)))
        change = {x: rng.uniform(-1.0, 1.0, x.shape) * 0.5**k}
        if k == 1:
            change[s] = np.array(0.3)
        orders.correct(k, change)
    return np.array(found)


@pytest.mark.parametrize("name", sorted(set(LAWS) - SUMS_OVER_POINTS))
def test_same_orders(name):
    tape, x, s, out = started(LAWS[name])
    expected = coefficients(Recorded(tape, out), x, s)
    tape, x, s, out = started(LAWS[name])
    found = coefficients(Program(tape, out, POINTS), x, s)
    scale = np.maximum(np.abs(expected).max(axis=tuple(range(1, expected.ndim)), keepdims=True), 1)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= 1e-12 * scale.max()


@pytest.mark.parametrize("name", sorted(set(LAWS) - SUMS_OVER_POINTS))
def test_same_derivatives(name):
    rng = np.random.default_rng(8)
    tape, x, s, out = started(LAWS[name])
    seeds = {x: rng.normal(size=(4, *x.shape)), s: rng.normal(size=4)}
    expected = Recorded(tape, out).derivative(seeds)
    found = Program(tape, out, POINTS).derivative(seeds)
    assert found.shape == expected.shape == (4, *out.shape)
    assert np.allclose(found, expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("points", [1, 3, 63, 64, 65, 200])
def test_any_number_of_points(points):
    def law(x, s):
        return np.einsum("i...,i...->...", x, x) * x / np.sqrt(x + (s * np.ones(3))[:, None])

    tape, x, s, out = started(law, points=points)
    expected = coefficients(Recorded(tape, out), x, s)
    tape, x, s, out = started(law, points=points)
    orders = orders_of(tape, out, points)  # three points: not to be told from three components
    assert isinstance(orders, Recorded if points == 3 else Program)
    assert np.allclose(coefficients(orders, x, s), expected, rtol=1e-12)


@pytest.mark.parametrize(
    "law",
    [LAWS["sum"], lambda x, s: x[:, ::-1] * x, lambda x, s: x[:, :1] * x],
    ids=["sum over the points", "points reversed", "one of the points"],
)
def test_what_mixes_points_stays_interpreted(law):
    tape, _, _, out = started(law)
    assert isinstance(orders_of(tape, out, POINTS), Recorded)


def test_interpreted_without_numba(monkeypatch):
    monkeypatch.setattr(compiled, "AVAILABLE", False)
    tape, _, _, out = started(LAWS["norm"])
    assert isinstance(orders_of(tape, out, POINTS), Recorded)


def test_products_are_computed_once():
    """The nine entries of a Gram matrix have six different rows."""
    tape, _, _, out = started(lambda x, s: np.einsum("i...,j...->ij...", x, x))
    assert len(set(Program(tape, out, POINTS).output_rows.tolist())) == 6


def test_only_what_lower_orders_are_needed_of_is_kept():
    """Of N F and E = F·F: F and N, not E, not the input itself, not the result."""
    tape, _, _, out = started(lambda x, s: (x + 1.0) * (np.sum(np.square(x + 1.0), 0) * 2.0 - 1.0))
    assert Program(tape, out, POINTS).w.shape[1] == 4
