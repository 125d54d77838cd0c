"""Branches as quotients of polynomials, which reach beyond the circle of convergence.

A series that is limited by poles and branch points off the path is turned into fractions with one
common denominator q = 1 + d_1 a + … + d_m a^m for all unknowns.  The products q u have no higher
orders than the series if Σ_j d_j u_{k−j} = 0; d is what comes nearest to that in the last orders k,
in the mean square, weighted as at a = 4 times the length of the series.  A damping above round-off
keeps d, and with it the steps, the same where the last digits of the series are not.

Source: Najah, Cochelin, Damil & Potier-Ferry, *A critical review of asymptotic numerical
methods*, Arch. Comput. Methods Eng. 5 (1998), for common denominators; Gonnet, Güttel &
Trefethen, *Robust Padé approximation via SVD*, SIAM Review 55 (2013), for least squares.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, toeplitz

from .expansion import Cost, Equations
from .path import Branch, first_root
from .range_of_validity import errors, without_overshoot

Array = NDArray[np.float64]

GROWTH = 1.2
"""Ratio of a length to the one before it at which the residual was looked at."""

POLES = 12
"""Largest degree of the denominator."""

LAST = 6
"""Orders of the product that are to vanish."""

FURTHER = 4.0
"""Where they are weighted, over the length of the series."""

DAMPING = 1e-9
"""Of the denominator's coefficients, over the largest term there.  With 1e-12 steps in mm and in m
are of other lengths, by 1e-2 after 70 of them; tangents are hardly fewer."""

TRIALS = 12
"""Lengths that are looked at beyond the series' own."""


def stretched(
    equations: Equations,
    branch: Branch,
    imbalance: float,
    tolerance: float,
    reach: float,
    cost: Cost,
) -> tuple[Branch, float]:
    """The rational form of a validated branch, if it meets the tolerance further on.

    Returns
    -------
    branch : Branch
        At least as long as before, at most ``reach``, with no pole inside.
    imbalance : float
        Residual at its end.
    """
    if branch.order < 3 or branch.length >= reach:
        return branch, imbalance
    limit = min(reach, without_overshoot(equations, branch, tolerance))
    quotient, length = rational(equations, branch), branch.length
    found = branch, imbalance
    for _ in range(TRIALS):
        longer = min(GROWTH * length, limit)
        if longer <= length or first_root(quotient.denominator, longer) is not None:
            break
        error, imbalance = errors(equations, quotient, longer, cost, tolerance)
        if error > tolerance:
            break
        found, length = (quotient.cut(longer), imbalance), longer
    return found


def rational(equations: Equations, branch: Branch) -> Branch:
    """The same orders as a quotient."""
    size = branch.order + 1
    denominator = np.zeros(size)
    found = _denominator(coordinates(equations, branch), FURTHER * branch.length)
    denominator[: len(found)] = found
    product = toeplitz(denominator, np.zeros(size))
    with np.errstate(all="ignore"):
        u, control = product @ branch.u, product @ branch.control
    return replace(branch, u=u, control=control, denominator=found)


def _denominator(alpha: Array, scale: float) -> Array:
    """Coefficients 1, d_1 … d_m, from orders 1 … N in coordinates (rows)."""
    n, width = alpha.shape
    degree, last = min(POLES, n - 1), min(LAST, n - 1)
    powers = scale ** np.arange(n + 1.0)
    terms = np.vstack([np.zeros((degree, width)), alpha * powers[1:, None]])
    columns = [terms[degree + n - last - j : degree + n - j].ravel() for j in range(degree + 1)]
    damping = DAMPING * np.linalg.norm(terms, axis=1).max()
    matrix = np.vstack([np.stack(columns[1:], axis=1), damping * np.eye(degree)])
    wanted = -np.concatenate([columns[0], np.zeros(degree)])
    d = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    return np.concatenate([[1.0], d / powers[1 : degree + 1]])


def coordinates(equations: Equations, branch: Branch) -> Array:
    """Orders 1 … N (rows) in an orthonormal basis of what they span, with the control."""
    motion = branch.u[1:] * np.sqrt(equations.metric)
    both = np.column_stack([motion, branch.control[1:]]).T
    return np.asarray(qr(both, mode="r", check_finite=False)[0][: branch.order].T)
