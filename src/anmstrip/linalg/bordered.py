"""Sparse matrices with a border of rows and columns that reach far, and their factors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import bmat, csc_matrix, csr_matrix, diags, hstack, vstack

from anmstrip.arrays import Array
from anmstrip.linalg.direct import (
    Factors,
    NonFiniteTangentError,
    SingularTangentError,
    Solve,
    SuperLUPlan,
    equilibrated,
    refined,
    require_finite,
)

WIDEST_BORDER = 24
"""Columns of a border above which all but the last join the sparse matrix: each reaches only the
strip near a roller, the last all of it.  Block elimination takes time and memory in proportion to
unknowns times columns.  Of a line of 161 rollers and 49 000 unknowns the factors so take 0.06 s,
those of all of it 0.42 s."""


@dataclass(frozen=True)
class Bordered:
    """K = [[A, B], [C, D]], of which D is full; it need not be symmetric."""

    inner: csc_matrix  # A, (n, n)
    columns: csc_matrix  # B, (n, m)
    rows: csr_matrix  # C, (m, n)
    corner: Array  # D, (m, m)

    def assembled(self) -> csc_matrix:
        """K as one sparse matrix, (n + m, n + m)."""
        return csc_matrix(bmat([[self.inner, self.columns], [self.rows, self.corner]]))

    def factorised(self, factorise: Callable[[csc_matrix], Factors]) -> Factors:
        """Factors of K from those of A, or of K as a whole where A is nearly singular.

        Block elimination (Golub and Van Loan, Matrix Computations, section 3.2) is only as stable
        as A is regular; iterative refinement mends what it can, and tells where it cannot.  With a
        band of 7 and 4000 unknowns, 2 and 12 columns take 11 and 20 ms, all of K in the sparse LU
        43 and 61.

        Parameters
        ----------
        factorise : callable
            From A to its factors.

        Raises
        ------
        SingularTangentError
            K is singular.
        """
        self._require_finite()
        if len(self.corner) > WIDEST_BORDER:
            return self._narrowed().factorised(lambda a: SuperLUPlan(a).factorise(a))
        try:
            d = self._scales()
            scaled = self._scaled(d)
            inner = factorise(scaled.inner)
            eliminated, negatives = scaled._eliminated(inner)
            solve = refined(eliminated, scaled, scaled._norm(), least=1)
        except SingularTangentError:
            whole = self.assembled()
            return SuperLUPlan(whole).factorise(whole)
        return Factors(lambda right: solve(right * d) * d, lambda: inner.negatives + negatives)

    def _narrowed(self) -> Bordered:
        """The same with a border of the last row and column alone."""
        d = self.corner
        inner = bmat([[self.inner, self.columns[:, :-1]], [self.rows[:-1], d[:-1, :-1]]])
        column = csc_matrix(vstack([self.columns[:, -1:], d[:-1, -1:]]))
        row = csr_matrix(hstack([self.rows[-1:], d[-1:, :-1]]))
        return Bordered(csc_matrix(inner), column, row, d[-1:, -1:])

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of K."""
        return (sum(self.columns.shape),) * 2

    def __add__(self, other: Bordered) -> Bordered:
        """Return the sum with a matrix that has a border of the same width."""
        parts = self.inner + other.inner, self.columns + other.columns
        return Bordered(*parts, self.rows + other.rows, self.corner + other.corner)

    def __matmul__(self, x: Array) -> Array:
        """K x."""
        n = self.inner.shape[0]
        first = self.inner @ x[:n] + self.columns @ x[n:]
        return np.concatenate([first, self.rows @ x[:n] + self.corner @ x[n:]])

    def _norm(self) -> float:
        """Largest sum of the sizes of a row's entries."""
        n = self.inner.shape[0]
        inner = np.bincount(self.inner.indices, np.abs(self.inner.data), n)
        first = inner + np.bincount(self.columns.indices, np.abs(self.columns.data), n)
        last = abs(self.rows) @ np.ones(n) + np.abs(self.corner).sum(axis=1)
        return float(max(first.max(initial=0.0), last.max(initial=0.0)))

    def _require_finite(self) -> None:
        """Raise an error that names the first column with an entry that is not finite."""
        require_finite(self.inner)
        one = np.ones(self.inner.shape[0])  # sums are finite where all entries are
        sums = one @ abs(self.columns) + abs(self.rows) @ one
        finite = np.isfinite(sums + np.abs(self.corner).sum(axis=0) + self.corner.sum(axis=1))
        if not finite.all():
            raise NonFiniteTangentError(len(one) + int(np.argmin(finite)))

    def _scales(self) -> Array:
        """Factors d that make the largest entries d_i |K_ij| d_j of rows and columns about one."""
        d = equilibrated(self.inner)
        across = abs(diags(d) @ self.columns).max(axis=0).toarray().ravel()
        along = abs(self.rows @ diags(d)).max(axis=1).toarray().ravel()
        largest = np.maximum(np.maximum(across, along), np.sqrt(np.abs(self.corner.diagonal())))
        return np.append(d, 1.0 / np.where(largest > 0.0, largest, 1.0))

    def _scaled(self, d: Array) -> Bordered:
        """The matrix of the entries d_i K_ij d_j."""
        n, a = self.inner.shape[0], self.inner
        data = a.data * d[a.indices] * np.repeat(d[:n], np.diff(a.indptr))
        return Bordered(
            csc_matrix((data, a.indices, a.indptr), a.shape),
            csc_matrix(diags(d[:n]) @ self.columns @ diags(d[n:])),
            csr_matrix(diags(d[n:]) @ self.rows @ diags(d[:n])),
            d[n:, None] * self.corner * d[n:],
        )

    def _eliminated(self, inner: Factors) -> tuple[Solve, int]:
        """Solver by the Schur complement S = D − C A⁻¹ B, and its negative eigenvalues.

        By Haynsworth's formula those of A and S together are as many as those of K.
        """
        n = self.inner.shape[0]
        influence = np.column_stack([inner.solve(column) for column in self.columns.toarray().T])
        schur = self.corner - self.rows @ influence
        if not np.isfinite(schur).all() or not np.linalg.cond(schur) < 1.0 / np.finfo(float).eps:
            raise SingularTangentError("the Schur complement of the border is singular", n)

        def solve(right: Array) -> Array:
            x = inner.solve(right[:n])
            z = np.linalg.solve(schur, right[n:] - self.rows @ x)
            return np.concatenate([x - influence @ z, z])

        return solve, int((np.linalg.eigvals(schur).real < 0.0).sum())
