"""Roots of series: known ones, those between branches, and random paths past a circle."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from anmstrip.mechanics.roller import Roller
from anmstrip.taylor import polynomials
from anmstrip.taylor.polynomials import (
    Watch,
    derivative_coefficients,
    first_root,
    minima,
    roots,
    roots_within,
    value_at,
)
from anmstrip.taylor.series import taylor_series

POLYNOMIAL = np.polynomial.polynomial


@given(
    st.lists(st.integers(-20, 40), min_size=1, max_size=9, unique=True),
    st.lists(st.integers(-20, 40), max_size=2, unique=True),
    st.sampled_from([0.51, 1.33, 2.0]),
)
def test_known_roots(single: list[int], double: list[int], length: float) -> None:
    """Roots at multiples of 0.05; double ones change nothing.

    Where the values between two of them are round-off of the coefficients nobody can tell.
    """
    places = [*(p for p in single if p not in double), *double, *double]
    coefficients = POLYNOMIAL.polyfromroots(np.array(places) / 20.0)[:, None]
    inside = np.array([p / 20.0 for p in {0, *places} if 0 <= p < 20 * length])
    beside = np.abs(POLYNOMIAL.polyval(np.sort(inside) + 0.025, coefficients[:, 0]))
    assume(beside.min() > 1e-13 * np.abs(coefficients[:, 0]) @ length ** np.arange(len(places) + 1))
    found = roots(coefficients, length)
    wanted = sorted(p / 20.0 for p in single if p not in double and 0 < p < 20 * length)
    assert found.where == pytest.approx(wanted, abs=2e-3)  # badly conditioned: up to 13 roots
    assert (np.diff(found.sense) != 0).all()


def test_roots_are_found_to_the_last_digits() -> None:
    found = roots(np.array([[-2.0], [0.0], [1.0]]), 2.0)
    assert found.where == pytest.approx([np.sqrt(2.0)], rel=1e-15)
    assert found.sense.tolist() == [1]


@pytest.mark.parametrize("depth", [1e-2, 1e-6, 1e-10, 1e-12])
def test_a_touch_and_its_release_inside_one_step(depth: float) -> None:
    """A point passes a circle on a line at r − depth: in and out again at known instants."""
    roller = Roller("r", 0.5, (0.0, 0.0, 0.0))
    series = np.zeros((21, 2, 1))
    series[0, :, 0], series[1, :, 0] = (0.5 - depth, -0.1), (0.0, 0.2)
    gap = taylor_series(lambda y: roller.project(y).gap, series)
    half = np.sqrt(0.25 - (0.5 - depth) ** 2)
    found = roots(gap, 1.0)
    assert found.sense.tolist() == [-1, 1]
    # order 20 errs by 1e-10 there; round-off of the gap moves the instants by that over the slope
    exact = [0.5 - half / 0.2, 0.5 + half / 0.2]
    assert found.where == pytest.approx(exact, abs=1e-9 * depth / 1e-2 + 1e-15 / half)


def test_grazing_is_a_least_value_and_no_change() -> None:
    gap = np.array([[1.0 + 1e-6], [-2.0], [1.0]])
    assert not len(roots(gap, 2.0))
    least = minima(gap, 2.0, 1e-5)
    assert least.where == pytest.approx([1.0])
    assert not len(minima(gap, 2.0, 1e-7))


def test_what_is_zero_does_not_change() -> None:
    assert not len(roots(np.zeros((5, 3)), 1.0))
    assert not len(roots(np.full((1, 3), 2.0), 1.0))


def test_a_root_at_a_joint_is_found_once() -> None:
    """1 − a over [0, 1] and [1, 2]; then a jump of the function itself."""
    watch = Watch()
    assert not len(watch.changes(np.array([[1.0], [-1.0]]), 1.0))
    found = watch.changes(np.array([[0.0], [-1.0]]), 1.0)
    assert (found.where.tolist(), found.sense.tolist()) == ([0.0], [-1])
    found = watch.changes(np.array([[0.5], [-1.0]]), 1.0)
    assert found.where.tolist() == [0.0, 0.5]
    assert found.sense.tolist() == [1, -1]


def test_a_double_root_at_a_joint_is_none() -> None:
    watch = Watch()
    assert not len(watch.changes(np.array([[1.0], [-2.0], [1.0]]), 1.0))
    assert not len(watch.changes(np.array([[0.0], [0.0], [1.0]]), 1.0))


def test_only_some_of_the_functions() -> None:
    watch = Watch()
    watch.changes(np.array([[1.0, 1.0, -1.0]]), 1.0)
    found = watch.changes(np.array([[-1.0]]), 1.0, np.array([2]))
    assert not len(found)
    found = watch.changes(np.array([[1.0], [-2.0]]), 1.0, np.array([1]))
    assert (found.which.tolist(), found.where.tolist()) == ([1], [0.5])


def test_functions_without_a_root_are_settled_by_one_product(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of five thousand only one is looked at any further."""
    coefficients = np.random.default_rng(0).normal(size=(21, 5000))
    coefficients[0] += 60.0
    coefficients[:, 7] = 0.0
    coefficients[:2, 7] = -0.5, 1.0
    looked: list[int] = []
    real = polynomials._changes

    def counted(bernstein: np.ndarray, noise: np.ndarray) -> np.ndarray:
        looked.append(bernstein.shape[1])
        return real(bernstein, noise)

    monkeypatch.setattr(polynomials, "_changes", counted)
    assert Watch().changes(coefficients, 1.0).which.tolist() == [7]
    assert looked == [1]


# random paths ----------------------------------------------------------------

LENGTH, BRANCHES, ORDER = 0.1, 30, 20


@dataclass(frozen=True)
class Paths:
    """x(t) = a + Σ b_j cos(w_j t + p_j) in the plane past the unit circle, (3, 2, paths)."""

    centre: np.ndarray
    size: np.ndarray
    rate: np.ndarray
    phase: np.ndarray

    @classmethod
    def random(cls, count: int, seed: int) -> Paths:
        random = np.random.default_rng(seed)
        shape = (3, 2, count)
        return cls(
            random.normal(0.0, 0.8, shape[1:]),
            random.normal(0.0, 0.6, shape),
            random.uniform(0.3, 6.0, shape),
            random.uniform(0.0, 2.0 * np.pi, shape),
        )

    def series(self, t: float) -> np.ndarray:
        """Taylor coefficients at t, shape (ORDER + 1, 2, paths)."""
        angle = self.rate * t + self.phase
        found = np.array(
            [
                (self.size * self.rate**k * np.cos(angle + 0.5 * np.pi * k)).sum(axis=0)
                / float(np.prod(np.arange(1.0, k + 1)))
                for k in range(ORDER + 1)
            ]
        )
        found[0] += self.centre
        return found

    def gap(self, path: int, t: np.ndarray) -> np.ndarray:
        """(|x|² − 1)/2 of one path at instants."""
        angle = self.rate[..., path, None] * t + self.phase[..., path, None]
        waves = (self.size[..., path, None] * np.cos(angle)).sum(axis=0)
        x = self.centre[..., path, None] + waves
        return 0.5 * ((x * x).sum(axis=0) - 1.0)


def found_events(paths: Paths) -> list[list[tuple[float, int]]]:
    """(time, sense) of every path, by the series."""
    watch, times = Watch(), [[] for _ in range(paths.centre.shape[1])]
    for n in range(BRANCHES):
        x = paths.series(n * LENGTH)
        gap = taylor_series(lambda x: (x[0] * x[0] + x[1] * x[1] - 1.0) * 0.5, x)
        found = watch.changes(gap, LENGTH)
        for which, a, sense in zip(found.which, found.where, found.sense, strict=True):
            times[which].append((n * LENGTH + a, int(sense)))
    return times


def sampled_changes(paths: Paths, samples: int = 3001) -> list[list[tuple[float, float, float]]]:
    """Instants between which the sampled gap changes its sign, near turning points finer."""
    times, found = np.linspace(0.0, LENGTH * BRANCHES, samples), []
    step = times[1]
    for path in range(paths.centre.shape[1]):
        h = paths.gap(path, times)
        same = h[1:-1] * h[2:] > 0.0
        turning = same & (h[:-2] * h[1:-1] > 0.0) & (np.abs(h[1:-1]) <= np.abs(h[2:]))
        turning &= (np.abs(h[1:-1]) <= np.abs(h[:-2])) & (np.abs(h[1:-1]) < 100.0 * step**2)
        finer = [np.linspace(times[i], times[i + 2], 401) for i in np.flatnonzero(turning)]
        every = np.unique(np.concatenate([times, *finer]))
        g = paths.gap(path, every)
        at = np.flatnonzero(g[1:] * g[:-1] < 0.0)
        found.append(list(zip(every[at], every[at + 1], np.sign(g[at + 1]), strict=True)))
    return found


@pytest.mark.parametrize("count", [300, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_event_of_random_paths_is_missed(count: int) -> None:
    """Every change that sampling sees is found between its samples, and all found ones are true."""
    paths = Paths.random(count, seed=count)
    found, sampled = found_events(paths), sampled_changes(paths)
    assert sum(map(len, sampled)) > 2 * count
    for path, (mine, theirs) in enumerate(zip(found, sampled, strict=True)):
        left = list(mine)
        for before, after, sense in theirs:
            hits = [e for e in left if before - 1e-9 <= e[0] <= after + 1e-9 and e[1] == sense]
            assert hits, f"path {path}: nothing found between {before} and {after}"
            left.remove(hits[0])
        senses = [sense for _, sense in mine]
        assert all(a != b for a, b in pairwise(senses))
        times = np.array([t for t, _ in mine])
        assert np.abs(paths.gap(path, times)).max(initial=0.0) < 1e-12
        if left:  # two changes that even the finer samples have stepped over
            assert len(left) % 2 == 0
            middle = 0.5 * (times[1:] + times[:-1])
            assert (np.sign(paths.gap(path, middle)) == senses[:-1]).all()


@pytest.mark.parametrize("end", [1.0, 1.0 + 1e-13, 1.0 - 1e-13])
def test_a_root_at_the_end_of_the_range_is_found(end: float) -> None:
    """Where Bernstein coefficients are of one sign but for round-off."""
    assert first_root(3.0 * np.array([-end, 1.0, 0.0]), 1.0) == pytest.approx(1.0, abs=1e-12)
    assert first_root(np.array([1.0, 0.5, -0.4]), 1.0) is None


@pytest.mark.parametrize("length", [0.3, 1.3, 1e-4])
def test_roots_are_those_of_the_companion_matrix(length: float) -> None:
    rng = np.random.default_rng(3)
    cases = rng.normal(size=(300, 7)) + 2.0 * np.eye(7)[0]
    cases /= length ** np.arange(7.0)
    count = 0
    for c in cases:
        found = POLYNOMIAL.polyroots(c)
        real = np.sort(found.real[(found.imag == 0.0) & (found.real > 0.0)])
        assert roots_within(c, length) == pytest.approx(real[real <= length], rel=1e-9)
        count += len(roots_within(c, length)) > 0
    assert 20 < count < 280


def test_a_double_root_is_a_root_though_no_change_of_sign() -> None:
    squared = POLYNOMIAL.polyfromroots([0.25, 0.25, 3.0])
    assert roots_within(squared, 1.0) == pytest.approx([0.25], abs=1e-7)
    assert roots_within(-squared, 1.0) == pytest.approx([0.25], abs=1e-7)
    assert roots_within(np.zeros(4), 1.0) == []


def test_horner_and_derivative_coefficients() -> None:
    c = np.array([[1.0, 2.0], [0.5, -1.0], [3.0, 4.0]])
    np.testing.assert_allclose(value_at(c, 0.1), c[0] + 0.1 * c[1] + 0.01 * c[2], rtol=1e-15)
    np.testing.assert_array_equal(derivative_coefficients(c), [[0.5, -1.0], [6.0, 8.0]])
    assert value_at(np.array([2.0, 3.0]), 2.0) == 8.0
    before = c.copy()
    value_at(c, 0.3)
    np.testing.assert_array_equal(c, before)
