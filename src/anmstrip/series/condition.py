"""How well conditioned a factorised tangent is: a cheap estimate, once in a while."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from anmstrip.linalg.factors import Array, Factors, equilibrated


def condition(matrix: csc_matrix, factors: Factors) -> float:
    """Estimate of the condition number in the 1-norm of the scaled matrix A = d K d.

    Four back-substitutions, beside some twenty of an expansion.  It is never above the true one,
    and seldom far below: ‖A⁻¹‖ is looked for as by Hager (1984), who solves with Aᵀ in between;
    here A serves instead, which symmetry excuses, or nearly so, and to which column one looks in
    the end does not matter for the bound.

    Parameters
    ----------
    matrix : csc_matrix, shape (n, n)
        K, with entries of any units.
    factors : Factors
        Of K.

    Examples
    --------
    >>> from anmstrip.linalg.solvers import SparseSolver
    >>> matrix = csc_matrix(np.diag([1.0, 1e-6, 2.0]))
    >>> round(condition(matrix, SparseSolver().factorise(matrix)), 6)  # of the scaled one
    1.0
    """
    d = equilibrated(matrix)
    n = len(d)

    def solved(right: Array) -> Array:
        return factors.solve(right / d) / d

    first = solved(np.full(n, 1.0 / n))
    column = np.zeros(n)
    column[np.abs(solved(np.where(first < 0.0, -1.0, 1.0))).argmax()] = 1.0
    zigzag = (-1.0) ** np.arange(n) * (1.0 + np.arange(n) / max(n - 1, 1))
    found = [first, solved(column), solved(zigzag) / np.abs(zigzag).sum()]
    columns = d * (np.abs(matrix).T @ d)
    return float(columns.max() * max(np.abs(x).sum() for x in found))
