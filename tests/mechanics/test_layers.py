"""How many layers through the thickness bends ask for: rate-independent fibres, by chance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import Legendre

from anmstrip.arrays import Array
from anmstrip.fem.operators import Layers

RANDOM = np.random.default_rng(1)
CASES = 100
K = RANDOM.uniform(2.0, 16.0, CASES)
TENSION = RANDOM.uniform(0.03, 0.45, CASES)
BENDS = np.array([[1.0, 0.0, 0.0, 0.0, 0.0], [1.0, -0.7, 0.45, -0.25, 0.13]])
"""Over the first: there and back, or five bends one after the other."""
PATHS = K[:, None] * BENDS[np.arange(CASES) % 2]


def stresses(strain: Array, layers: Layers) -> tuple[Array, Array]:
    """Return stress over σ_y, and the mean strain over ε_y that bears the tension with the rest."""
    low, high = np.full((2, CASES, 1), [[[-40.0]], [[40.0]]])
    for _ in range(50):
        middle = 0.5 * (low + high)
        force = np.clip(strain + middle, -1.0, 1.0) @ layers.weights
        more = (force < TENSION)[:, None]
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    return np.clip(strain + low, -1.0, 1.0), low[:, 0]


def bent(layers: Layers, increments: int = 200) -> tuple[Array, Array]:
    """Return M/M_e after every bend, (bends, cases), and the plastic elongation over ε_y."""
    plastic, before, moments = np.zeros((CASES, len(layers.heights))), np.zeros(CASES), []
    for after in PATHS.T:
        for share in np.arange(1, increments + 1) / increments:
            k = before + share * (after - before)
            strain = 2.0 * k[:, None] * layers.heights - plastic
            stress, mean = stresses(strain, layers)
            plastic = plastic + strain + mean[:, None] - stress
        moments.append(6.0 * stress @ (layers.weights * layers.heights))
        before = after
    return np.array(moments), mean - TENSION


@pytest.fixture(scope="module")
def exact() -> tuple[Array, Array]:
    return bent(Layers.of(1.0, 1001))


def errors(layers: Layers, exact: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the largest error of the moments of each case, and that of its elongation, over it."""
    moments, longer = bent(layers)
    missed = np.abs(longer - exact[1]) / np.maximum(exact[1], 0.3)
    return np.abs(moments - exact[0]).max(axis=0), missed


def mean(x: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(x**2)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "moment", "elongation", "median"),
    [(11, 0.011, 0.12, 0.036), (15, 0.0045, 0.052, 0.015), (21, 0.0024, 0.024, 0.007)],
)
def test_errors_of_layers_are_those_of_the_documentation(count, moment, elongation, median, exact):
    off, missed = errors(Layers.of(1.0, count), exact)
    assert mean(off) == pytest.approx(moment, rel=0.05)
    assert mean(missed) == pytest.approx(elongation, rel=0.05)
    assert np.median(missed) == pytest.approx(median, rel=0.05)
    assert missed[(TENSION > 0.15) | (K < 5.0)].max() < (0.2 if count == 11 else 0.1)


@pytest.mark.slow
def test_layers_that_are_closer_at_the_faces_miss_more(exact):
    """By Lobatto's rule, 2/(n (n − 1) P_{n−1}(x)²): twice as many are as good."""
    last = Legendre.basis(20)
    points = np.concatenate([[-1.0], last.deriv().roots(), [1.0]])
    lobatto = Layers(0.5 * points, 1.0 / (420.0 * last(points) ** 2))
    theirs, ours = errors(lobatto, exact), errors(Layers.of(1.0, 21), exact)
    assert mean(ours[0]) < 0.7 * mean(theirs[0])
    assert mean(ours[1]) < 0.5 * mean(theirs[1])
    fewer = errors(Layers.of(1.0, 15), exact)
    assert mean(fewer[0]) < 1.2 * mean(theirs[0])
    assert mean(fewer[1]) < 1.2 * mean(theirs[1])
