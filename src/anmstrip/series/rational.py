"""Branches as quotients of polynomials, which reach beyond the circle of convergence.

A series that is limited by poles off the path is turned into fractions with one common
denominator for all unknowns.  With u_k = Σ_i α_ki q_i in an orthonormal basis, the denominator
1 + d_1 a + … + d_{N−1} a^{N−1} is the one for which orders N − j of the components q_{N−1−j}
vanish; numerators are the products with the series, cut off at order N − 1.

Source: Najah, Cochelin, Damil & Potier-Ferry, *A critical review of asymptotic numerical
methods*, Arch. Comput. Methods Eng. 5 (1998); Elhage-Hussein, Potier-Ferry & Damil, *A numerical
continuation method based on Padé approximants*, Int. J. Solids Struct. 37 (2000).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from .expansion import Cost, Equations
from .path import Branch, first_root
from .range_of_validity import errors, without_overshoot

Array = NDArray[np.float64]

GROWTH = 1.2
"""Ratio of a length to the one before it at which the residual was looked at."""

TRIED = 3
"""Last orders N with which it is tried: a pole that has no meaning comes with one of them."""

NOTHING = 1e-14
"""Share of a vector outside the span of others that is round-off."""

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
        At least as long as before, at most ``reach``, with no pole inside; the given one
        where the orders are more than the unknowns, and have no basis.
    imbalance : float
        Residual at its end.
    """
    if not 2 < branch.order <= len(branch.residual) or branch.length >= reach:
        return branch, imbalance
    limit = min(reach, without_overshoot(equations, branch, tolerance))
    found, alpha = (branch, imbalance), triangle(equations, branch)
    for order in range(branch.order, max(branch.order - TRIED, 2), -1):
        candidate = rational(branch, alpha[:order, :order])
        length = found[0].length
        for _ in range(TRIALS):
            length = min(GROWTH * length, limit)
            if length <= found[0].length or first_root(candidate.denominator, length) is not None:
                break
            error, imbalance = errors(equations, candidate, length, cost, tolerance)
            if error > tolerance:
                break
            found = (candidate.cut(length), imbalance)
    return found


def rational(branch: Branch, alpha: Array) -> Branch:
    """Fractions with the orders 0 … N − 1 of a series, from its :func:`triangle` of N orders."""
    n = len(alpha)
    d = np.zeros(n)
    d[0] = 1.0
    for j in range(1, n):
        i = n - 1 - j
        if alpha[i, i] > 0.0:
            d[j] = -(d[:j] @ alpha[n - 1 : i : -1, i]) / alpha[i, i]
    product = toeplitz(d, np.zeros(n))
    with np.errstate(all="ignore"):
        u, control = product @ branch.u[:n], product @ branch.control[:n]
    return replace(branch, u=u, control=control, denominator=d)


def triangle(equations: Equations, branch: Branch) -> Array:
    """α_ki of orders k + 1 = 1 … N by Gram and Schmidt, twice."""
    n = branch.order
    alpha = np.zeros((n, n))
    basis: list[tuple[Array, float]] = []
    for k in range(n):
        u, control = branch.u[k + 1].copy(), float(branch.control[k + 1])
        for _ in range(2):
            for i, (q, c) in enumerate(basis):
                share = equations.inner(q, u) + c * control
                alpha[k, i] += share
                u, control = u - share * q, control - share * c
        norm = np.sqrt(max(equations.inner(u, u) + control**2, 0.0))
        if norm > NOTHING * np.abs(alpha[k]).max():
            alpha[k, k] = norm
        unit = 1.0 / norm if alpha[k, k] > 0.0 else 0.0
        basis.append((u * unit, control * unit))
    return alpha
