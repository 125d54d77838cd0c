"""Polynomials in a path parameter: values, derivatives, and roots, none missed.

A polynomial of degree N on [0, length] is a convex combination of its Bernstein coefficients,
and has at most as many roots there as they change their sign, less by an even number
(Descartes' rule).  So where they have one sign there is nothing to look for, which settles
almost all functions in one product of matrices; one change is one root; and where there are
more the interval is divided.  Its ends are put where the function is not zero within round-off,
so that every sign is certain: a double root is no change of sign, and no more is a dip that
round-off hides.

Source: Mourrain, Rouillier & Roy, *Bernstein's basis and real root isolation* (2005).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import comb
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval

from anmstrip.arrays import Array, Index

EPSILON = float(np.finfo(float).eps)

END_SHARE = 1e-12
"""Share of an interval by which a root may lie behind its end, or just after its start."""

MAX_DIVISIONS = 60
"""Divisions of an interval, and steps to a root, at most; round-off ends them long before."""

NEAR_SHARES = 2.0 ** -np.arange(50.0, 0.0, -1.0)
"""Shares at which to look for a sign, if there is none at an end."""

DIVISION_SHARES = np.array([0.5, 0.45, 0.55, 0.4, 0.6, 0.35, 0.65, 0.3, 0.7])
"""Shares at which to divide an interval: the first at which there is a sign."""


def value_at(coefficients: Array, a: float) -> Any:
    """Value of a series at parameter ``a``; ``coefficients`` has the orders first.

    What order 0 is changed by is summed first, so that it is rounded once.
    """
    if coefficients.ndim == 1:
        value = 0.0
        for c in reversed(coefficients.tolist()):
            value = value * a + c
        return value
    powers = a ** np.arange(1.0, len(coefficients))
    changes = coefficients[1:].reshape(len(powers), coefficients[0].size)
    return coefficients[0] + (powers @ changes).reshape(coefficients.shape[1:])


def derivative_coefficients(coefficients: Array) -> Array:
    """Coefficients of the derivative of a series, one order less."""
    orders = np.arange(1, len(coefficients))
    return coefficients[1:] * orders.reshape((-1,) + (1,) * (coefficients.ndim - 1))


@dataclass(frozen=True)
class Roots:
    """Changes of sign of functions, in the order in which they happen.

    Attributes
    ----------
    which : ndarray of int, shape (roots,)
        Number of the function.
    where : ndarray, shape (roots,)
        Path parameter a.
    sense : ndarray of int, shape (roots,)
        +1 where it rises through zero, −1 where it falls.
    """

    which: Index
    where: Array
    sense: Index

    def __len__(self) -> int:
        return len(self.which)


@cache
def _to_bernstein(order: int) -> Array:
    """b_j = Σ_i C(j, i)/C(N, i) c_i; nothing in it exceeds 1, so that round-off does not grow."""
    rows = [[comb(j, i) / comb(order, i) for i in range(order + 1)] for j in range(order + 1)]
    return np.array(rows)


def _bernstein(coefficients: Array, length: float) -> tuple[Array, Array]:
    """Bernstein coefficients on [0, length], and what round-off may have made of a zero."""
    order = len(coefficients) - 1
    scaled = coefficients * length ** np.arange(order + 1.0)[:, None]
    noise = (order + 1) * EPSILON * np.abs(scaled).max(axis=0, initial=0.0)
    return _to_bernstein(order) @ scaled, noise


@cache
def _before(order: int, share: float) -> Array:
    """Matrix to coefficients on the part of an interval before a share of it (de Casteljau)."""
    rest, orders = 1.0 - share, range(order + 1)
    return np.array([[comb(j, i) * share**i * rest ** (j - i) for i in orders] for j in orders])


def _split(bernstein: Array, share: float) -> tuple[Array, Array]:
    """Coefficients before and after a share of the interval."""
    order = len(bernstein) - 1
    return _before(order, share) @ bernstein, (_before(order, 1.0 - share) @ bernstein[::-1])[::-1]


def _divided(bernstein: Array, noise: Array, shares: Array) -> tuple[Array, Array, Array]:
    """Split at the first of some shares at which the function is not zero within round-off."""
    share, *others = shares.tolist()
    t = np.full(bernstein.shape[1], share)
    left, right = _split(bernstein, share)
    for share in others:
        vague = np.abs(left[-1]) <= noise
        if not vague.any():
            break
        t[vague] = share
        left[:, vague], right[:, vague] = _split(bernstein[:, vague], share)
    return left, right, t


class Watch:
    """Signs of many functions from branch to branch, so that no change falls between two.

    Attributes
    ----------
    signs : ndarray, shape (functions,), or None
        Just before the end of the last branch; 0 where nothing is known yet.
    """

    def __init__(self) -> None:
        self.signs: Array | None = None

    def changes(self, coefficients: Array, length: float, which: Index | None = None) -> Roots:
        """Changes of sign on the next branch.

        A function that begins with another sign than it had before has changed it at a = 0.

        Parameters
        ----------
        coefficients : ndarray, shape (order + 1, functions)
            Series of the functions in a.
        length : float
            Range of a.
        which : ndarray of int, optional
            Numbers of these functions, if the others are known to keep their signs.
        """
        bernstein, noise = _bernstein(coefficients, length)
        up, down = (bernstein > noise).any(axis=0), (bernstein < -noise).any(axis=0)
        first = last = up.astype(float) - down
        both = np.flatnonzero(up & down)
        inside = _Isolation(bernstein[:, both], noise[both])
        first[both], last = inside.first, first.copy()
        last[both] = inside.last
        if self.signs is None:
            self.signs = first.copy()
        numbers = np.arange(bernstein.shape[1]) if which is None else which
        before = self.signs[numbers]
        jumped = np.flatnonzero(before * first < 0.0)
        self.signs[numbers] = np.where(last == 0.0, before, last)
        found = inside.roots(coefficients[:, both], length)
        own = np.concatenate([jumped, both[found.which]])
        where = np.concatenate([np.zeros(len(jumped)), found.where])
        sense = np.concatenate([first[jumped].astype(np.int64), found.sense])
        order = np.lexsort((own, where))
        return Roots(numbers[own][order], where[order], sense[order])


def roots(coefficients: Array, length: float) -> Roots:
    """All changes of sign inside one branch.

    Parameters
    ----------
    coefficients : ndarray, shape (order + 1, functions)
    length : float

    Examples
    --------
    (a − 1)(a − 2) a on [0, 3]: the root at the start belongs to what was before.

    >>> found = roots(np.array([[0.0], [2.0], [-3.0], [1.0]]), 3.0)
    >>> found.where.round(12).tolist(), found.sense.tolist()
    ([1.0, 2.0], [-1, 1])
    """
    return Watch().changes(coefficients, length)


class _Isolation:
    """Intervals with one change of sign each; at their ends the functions are never vague.

    Attributes
    ----------
    first, last : ndarray, shape (functions,)
        Signs just after the begin and just before the end, 0 for a function that is zero.
    """

    def __init__(self, b: Array, noise: Array) -> None:
        self.found: list[tuple[Index, Array, Array, Array]] = []
        low, high = np.zeros(b.shape[1]), np.ones(b.shape[1])
        vague = np.flatnonzero(np.abs(b[0]) <= noise)
        if len(vague):
            _, b[:, vague], low[vague] = _divided(b[:, vague], noise[vague], NEAR_SHARES)
        vague = np.flatnonzero(np.abs(b[-1]) <= noise)
        if len(vague):
            kept, _, t = _divided(b[:, vague], noise[vague], 1.0 - NEAR_SHARES)
            b[:, vague], high[vague] = kept, low[vague] + t * (1.0 - low[vague])
        ends = np.where(np.abs(b) > noise, np.sign(b), 0.0)[[0, -1]]
        self.first, self.last = np.where((ends == 0.0).any(axis=0), 0.0, ends)
        which = np.flatnonzero(self.first != 0.0)
        self._isolate(b[:, which], noise, which, low[which], high[which])

    def _isolate(self, b: Array, noise: Array, which: Index, low: Array, high: Array) -> None:
        for _ in range(MAX_DIVISIONS):
            if not len(which):
                return
            changes = _changes(b, noise[which])
            self._keep(changes == 1, b, which, low, high)
            more = changes > 1
            b, which, low, high = b[:, more], which[more], low[more], high[more]
            left, right, t = _divided(b, noise[which], DIVISION_SHARES)
            vague = np.abs(left[-1]) <= noise[which]
            self._keep(vague, b, which, low, high)
            middle, clear = low + t * (high - low), ~vague
            b = np.hstack([left[:, clear], right[:, clear]])
            which = np.tile(which[clear], 2)
            low = np.concatenate([low[clear], middle[clear]])
            high = np.concatenate([middle[clear], high[clear]])

    def _keep(self, chosen: Array, b: Array, which: Index, low: Array, high: Array) -> None:
        """Keep those intervals at whose ends the signs differ."""
        chosen = chosen & (b[0] * b[-1] < 0.0)
        self.found.append((which[chosen], low[chosen], high[chosen], np.sign(b[0, chosen])))

    def roots(self, coefficients: Array, length: float) -> Roots:
        """Bisect to the last digit."""
        if not self.found:
            return Roots(np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64))
        which, low, high, first = (np.concatenate(part) for part in zip(*self.found, strict=True))
        scaled = coefficients[:, which] * length ** np.arange(float(len(coefficients)))[:, None]
        where = _refined(scaled, low, high, first)
        return Roots(which, where * length, -first.astype(np.int64))


def _refined(coefficients: Array, low: Array, high: Array, first: Array) -> Array:
    """Roots to the last digit by Newton's method, in brackets with one change of sign each.

    ``first`` are the signs at ``low``.  A step that leaves its bracket, or is not half as long as
    the one before, is a bisection.
    """
    slopes, orders = derivative_coefficients(coefficients), np.arange(float(len(coefficients)))
    x, last = 0.5 * (low + high), high - low
    for _ in range(MAX_DIVISIONS):
        powers = x ** orders[:, None]
        value = (powers * coefficients).sum(axis=0)
        slope = (powers[:-1] * slopes).sum(axis=0)
        before = value * first > 0.0
        low, high = np.where(before, x, low), np.where(before, high, x)
        with np.errstate(all="ignore"):
            step = value / slope
        good = (np.abs(step) <= 0.5 * last) & (x - step >= low) & (x - step <= high)
        nearer = np.where(good, x - step, 0.5 * (low + high))
        last = np.abs(nearer - x)
        x = nearer
        if (last <= EPSILON * high).all():
            break
    return x


def _changes(bernstein: Array, noise: Array) -> Index:
    """Changes of sign of the coefficients, those within round-off left out."""
    clear = np.abs(bernstein) > noise
    clear[0] = True
    latest = np.maximum.accumulate(np.where(clear, np.arange(len(bernstein))[:, None], 0))
    signs = np.take_along_axis(np.sign(bernstein), latest, axis=0)
    return np.count_nonzero(np.diff(signs, axis=0), axis=0)


def minima(coefficients: Array, length: float, below: Array | float) -> Roots:
    """Least values inside a branch that are within a distance of zero.

    Parameters
    ----------
    coefficients : ndarray, shape (order + 1, functions)
    length : float
    below : float or ndarray, shape (functions,)
        Largest absolute value that counts.
    """
    limits = np.broadcast_to(below, coefficients.shape[1:])
    near = np.flatnonzero(_bernstein(coefficients, length)[0].min(axis=0) <= limits)
    turning = roots(derivative_coefficients(coefficients[:, near]), length)
    which = near[turning.which]
    value = polyval(turning.where, coefficients[:, which], tensor=False)
    wanted = (turning.sense > 0) & (np.abs(value) <= limits[which])
    return Roots(which[wanted], turning.where[wanted], turning.sense[wanted])


def roots_within(coefficients: Array, length: float) -> list[float]:
    """Roots of one polynomial in (0, length], in their order, those without change of sign too.

    A root counts as being at the end if it is so within round-off.

    Parameters
    ----------
    coefficients : ndarray, shape (order + 1,)
    length : float
    """
    column, further = coefficients[:, None], length * (1.0 + END_SHARE)
    bernstein, noise = _bernstein(column, further)
    if bernstein.min() > noise[0] or bernstein.max() < -noise[0] or not noise[0]:
        return []
    found = [roots(column, further).where]
    if _changes(bernstein, noise)[0] > 1:
        found += [minima(sign * column, further, noise).where for sign in (1.0, -1.0)]
    if abs(value_at(coefficients, length)) <= noise[0]:
        found.append(np.array([length]))
    whole = np.concatenate(found)
    whole = np.minimum(whole[whole > END_SHARE * length], length)
    return [float(x) for x in np.unique(whole)]


def first_root(coefficients: Array, length: float) -> float | None:
    """Smallest root of a polynomial in (0, length]."""
    return next(iter(roots_within(coefficients, length)), None)
