"""Sparse matrices with a border of a few full rows and columns, solved by block elimination."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import bmat, csc_matrix

from anmstrip.arrays import Array
from anmstrip.linalg.direct import (
    Factors,
    SingularTangentError,
    Solve,
    SuperLUPlan,
    equilibrated,
    refined,
    require_finite,
)


@dataclass(frozen=True)
class Bordered:
    """K = [[A, B], [C, D]], of which only A is sparse; it need not be symmetric."""

    inner: csc_matrix  # A, (n, n)
    columns: Array  # B, (n, m)
    rows: Array  # C, (m, n)
    corner: Array  # D, (m, m)

    def assembled(self) -> csc_matrix:
        """K as one sparse matrix, (n + m, n + m)."""
        return csc_matrix(bmat([[self.inner, self.columns], [self.rows, self.corner]]))

    def factorised(self, factorise: Callable[[csc_matrix], Factors]) -> Factors:
        """Factors of K from those of A, or of K as a whole where A is nearly singular.

        Block elimination (Golub and Van Loan, Matrix Computations, section 3.2) is only as stable
        as A is regular; iterative refinement mends what it can, and tells where it cannot.

        Parameters
        ----------
        factorise : callable
            From A to its factors.

        Raises
        ------
        SingularTangentError
            K is singular.
        """
        whole = self.assembled()
        require_finite(whole)
        d = equilibrated(whole)
        scaled = csc_matrix(whole.multiply(d[:, None]).multiply(d))
        try:
            inner = factorise(self.inner)
            solve, negatives = self._eliminated(inner)
            solve_scaled = refined(lambda right: solve(right / d) / d, scaled)
        except SingularTangentError:
            return SuperLUPlan(whole).factorise(whole)
        return Factors(
            lambda right: solve_scaled(right * d) * d, lambda: inner.negatives + negatives
        )

    def _eliminated(self, inner: Factors) -> tuple[Solve, int]:
        """Solver by the Schur complement S = D − C A⁻¹ B, and its negative eigenvalues.

        By Haynsworth's formula those of A and S together are as many as those of K.
        """
        n = len(self.columns)
        influence = np.column_stack([inner.solve(column) for column in self.columns.T])
        schur = self.corner - self.rows @ influence
        if not np.isfinite(schur).all() or not np.linalg.cond(schur) < 1.0 / np.finfo(float).eps:
            raise SingularTangentError("the Schur complement of the border is singular", n)

        def solve(right: Array) -> Array:
            x = inner.solve(right[:n])
            z = np.linalg.solve(schur, right[n:] - self.rows @ x)
            return np.concatenate([x - influence @ z, z])

        return solve, int((np.linalg.eigvals(schur).real < 0.0).sum())
