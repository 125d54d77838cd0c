"""Linear solvers that factorise once and solve many times, and matrices that are made of parts."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import bmat, coo_matrix, csc_matrix, csr_matrix, hstack, issparse, vstack

from anmstrip.arrays import Array, Index
from anmstrip.linalg import direct

WIDEST_BORDER = 24
"""Columns of a border above which all but the last join the sparse matrix: each reaches only the
strip near a roller, the last all of it.  Block elimination takes time and memory in proportion to
unknowns times columns.  Of a line of 161 rollers and 49 000 unknowns the factors so take 0.06 s,
those of all of it 0.42 s."""


@dataclass(frozen=True)
class Bordered:
    """K = [[A, B], [C, D]], of which D is full; it need not be symmetric."""

    inner: csc_matrix  # A, (n, n)
    columns: Any  # B, (n, m), full or sparse
    rows: Any  # C, (m, n), full or sparse
    corner: Array  # D, (m, m)

    def assembled(self) -> csc_matrix:
        """K as one sparse matrix, (n + m, n + m)."""
        return csc_matrix(bmat([[self.inner, self.columns], [self.rows, self.corner]]))

    def factorised(self, factorise: Callable[[csc_matrix], direct.Factors]) -> direct.Factors:
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
        if len(self.corner) > WIDEST_BORDER:
            return self._narrowed().factorised(lambda a: direct.SuperLUPlan(a).factorise(a))
        if issparse(self.columns):
            full = self.columns.toarray(), self.rows.toarray(), self.corner
            return Bordered(self.inner, *full).factorised(factorise)
        self._require_finite()
        try:
            d = self._scales()
            scaled = self._scaled(d)
            inner = factorise(scaled.inner)
            eliminated, schur = scaled._eliminated(inner)
            solve = direct.with_refinement(eliminated, scaled, scaled._norm())
        except direct.SingularTangentError:
            whole = self.assembled()
            return direct.SuperLUPlan(whole).factorise(whole)
        return direct.Factors(
            lambda right: solve(right * d) * d,
            lambda: inner.negatives + int((np.linalg.eigvals(schur).real < 0.0).sum()),
        )

    def _narrowed(self) -> Bordered:
        """The same with a border of the last row and column alone."""
        d = self.corner
        inner = bmat([[self.inner, self.columns[:, :-1]], [self.rows[:-1], d[:-1, :-1]]])
        column = vstack([self.columns[:, -1:], d[:-1, -1:]]).toarray()
        row = hstack([self.rows[-1:], d[-1:, :-1]]).toarray()
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
        inner = abs(self.inner) @ np.ones(self.inner.shape[0])
        first = inner + np.abs(self.columns).sum(axis=1)
        last = np.abs(self.rows).sum(axis=1) + np.abs(self.corner).sum(axis=1)
        return float(max(first.max(initial=0.0), last.max(initial=0.0)))

    def _require_finite(self) -> None:
        """Raise an error that names the first column with an entry that is not finite."""
        direct.require_finite(self.inner)
        finite = np.isfinite(self.columns).all(axis=0) & np.isfinite(self.rows).all(axis=1)
        finite &= np.isfinite(self.corner).all(axis=0) & np.isfinite(self.corner).all(axis=1)
        if not finite.all():
            raise direct.NonFiniteTangentError(self.inner.shape[0] + int(np.argmin(finite)))

    def _scales(self) -> Array:
        """Factors d that make the largest entries d_i |K_ij| d_j of rows and columns about one."""
        d = direct.equilibrate(self.inner)
        across = np.abs(self.columns * d[:, None]).max(axis=0)
        along = np.abs(self.rows * d).max(axis=1)
        largest = np.maximum(np.maximum(across, along), np.sqrt(np.abs(self.corner.diagonal())))
        return np.append(d, 1.0 / np.where(largest > 0.0, largest, 1.0))

    def _scaled(self, d: Array) -> Bordered:
        """The matrix of the entries d_i K_ij d_j."""
        n, inner = self.inner.shape[0], copy(self.inner)
        inner.data = inner.data * d[inner.indices] * np.repeat(d[:n], np.diff(inner.indptr))
        columns, rows = d[:n, None] * self.columns * d[n:], d[n:, None] * self.rows * d[:n]
        return Bordered(inner, columns, rows, d[n:, None] * self.corner * d[n:])

    def _eliminated(self, inner: direct.Factors) -> tuple[direct.Solve, Array]:
        """Solver by the Schur complement S = D − C A⁻¹ B, and this.

        By Haynsworth's formula A and S together have as many negative eigenvalues as K.
        """
        n = self.inner.shape[0]
        influence = np.column_stack([inner.solve(column) for column in self.columns.T])
        schur = self.corner - self.rows @ influence
        if not np.isfinite(schur).all() or not np.linalg.cond(schur) < 1.0 / np.finfo(float).eps:
            raise direct.SingularTangentError("the Schur complement of the border is singular", n)
        lu, pivots, _ = lapack.dgetrf(schur)

        def solve(right: Array) -> Array:
            x = inner.solve(right[:n])
            z = lapack.dgetrs(lu, pivots, right[n:] - self.rows @ x)[0]
            return np.concatenate([x - influence @ z, z])

        return solve, schur


@dataclass(frozen=True)
class Condensed:
    """K = [[A, B], [C, D]] in the form A − B D⁻¹ C, of which D couples the unknowns of a point.

    Static condensation (Wilson, Int. J. Numer. Meth. Engng. 8, 1974): with K (u, z) = (f, g), u
    solves (A − B D⁻¹ C) u = f − B D⁻¹ g, and then z = D⁻¹ (g − C u).
    """

    inner: Any  # A − B D⁻¹ C, sparse or bordered; of unknowns z that are kept, joined with theirs
    count: int  # of u
    solved: Callable[[Array], Array]  # g to D⁻¹ g
    condensed: Callable[[Array, Array], Array]  # f and D⁻¹ g to the right-hand side of ``inner``
    recovered: Callable[[Array, Array], Array]  # solution of ``inner`` and D⁻¹ g to z

    def factorised(self, factorise: Callable[[Any], direct.Factors]) -> direct.Factors:
        """Return factors of K from those of the condensed matrix."""
        inner, n = factorise(self.inner), self.count

        def solve(right: Array) -> Array:
            solved = self.solved(right[n:])
            x = inner.solve(self.condensed(right[:n], solved))
            return np.concatenate([x[:n], self.recovered(x, solved)])

        return direct.Factors(solve, lambda: inner.negatives)


class Joining:
    """Entries of a sparse matrix and further ones, in another order of the unknowns; found once.

    Parameters
    ----------
    matrix : csc_matrix, shape (n, n)
    rows, columns : ndarray of int
        Of the further entries, -1 where there is no such unknown; none stands twice.
    order : ndarray of int
        Numbers of the unknowns, those of the matrix first, in the order of their elimination.
    ends : ndarray of int, shape (steps, 2)
        See :class:`~anmstrip.linalg.direct.ChainPlan`.
    """

    plan: direct.BandPlan | direct.ChainPlan

    def __init__(
        self, matrix: csc_matrix, rows: Index, columns: Index, order: Index, ends: Index
    ) -> None:
        self.place = np.argsort(order)
        n = matrix.shape[1]
        rows = np.concatenate([matrix.indices, rows])
        columns = np.concatenate([np.repeat(np.arange(n), np.diff(matrix.indptr)), columns])
        kept = np.flatnonzero((rows >= 0) & (columns >= 0))
        index = self.place[rows[kept]], self.place[columns[kept]]
        numbered = coo_matrix((kept + 1.0, index), shape=(len(order),) * 2).tocsc()
        numbered.sort_indices()
        self.part, self.source = numbered, numbered.data.astype(np.int64) - 1
        narrow = np.abs(index[0] - index[1]).max() < WIDEST_CHAIN_BAND
        self.plan = direct.BandPlan(numbered) if narrow else direct.ChainPlan(numbered, ends)

    def joined(self, matrix: csc_matrix | Bordered, values: Array, pull: Array) -> Joined:
        """Return the matrix with the further entries, and its border if it has one.

        ``pull`` is the row of the further unknowns in the last row of the border.
        """
        inner = matrix.inner if isinstance(matrix, Bordered) else matrix
        whole, n, m = copy(self.part), inner.shape[0], len(pull)
        whole.data = np.concatenate([inner.data, values])[self.source]
        if not isinstance(matrix, Bordered):
            return Joined(whole, self.place, self.plan)
        others = len(matrix.corner)
        numbers = np.concatenate([self.place[:n], n + m + np.arange(others), self.place[n:]])
        order = np.argsort(self.place)
        columns = csr_matrix(vstack([csr_matrix(matrix.columns), csr_matrix((m, others))]))[order]
        last = csr_matrix((others - 1, m)), csr_matrix(pull[None])
        rows = csc_matrix(hstack([csc_matrix(matrix.rows), vstack(last)]))[:, order]
        return Joined(Bordered(whole, columns, rows, matrix.corner), numbers, self.plan)


@dataclass(frozen=True)
class Joined:
    """K whose own unknowns of points depend on those of others: all of it is factorised at once.

    In the form of a matrix over other orders of the unknowns; the border comes last there.
    """

    inner: csc_matrix | Bordered
    place: Index  # of the unknowns of K in ``inner``
    plan: direct.BandPlan | direct.ChainPlan

    def factorised(self, factorise: Callable[[Any], direct.Factors]) -> direct.Factors:
        """Return factors of K from those of the ordered matrix, along the chain."""
        del factorise
        of = self.plan.factorise
        inner = self.inner.factorised(of) if isinstance(self.inner, Bordered) else of(self.inner)

        def solve(right: Array) -> Array:
            ordered = np.empty_like(right)
            ordered[self.place] = right
            return inner.solve(ordered)[self.place]

        return direct.Factors(solve, lambda: inner.negatives)


WIDEST_BAND = 550
"""Half bandwidth above which SuperLU is faster than the band LU: at 515, forty elements across, an
expansion on 25 000, 49 000 and 99 000 unknowns takes 0.94, 1.86 and 4.02 s by band, 1.07, 2.68 and
6.01 s by SuperLU; at 755 factors that are made once take as long."""

WIDEST_BEFORE_PARDISO = 200
"""The same for PARDISO (measured)."""

WIDEST_CHAIN_BAND = 200
"""The same for elimination along a chain, block by block: a section of 21 layers has 49, and takes
22 ms for an expansion by band, 70 by blocks."""


class LinearSolver(Protocol):
    """Anything that makes factors of matrices."""

    def factorise(self, matrix: Any) -> direct.Factors:
        """Factors; raises :class:`~anmstrip.linalg.direct.SingularTangentError`."""


class Remembering:
    """A linear solver that keeps its last factors."""

    def __init__(self, solver: LinearSolver) -> None:
        self.solver = solver

    def factorise(self, matrix: Any) -> direct.Factors:
        """Factors of a matrix, also kept as ``factors``."""
        self.factors = self.solver.factorise(matrix)
        return self.factors


class DenseSolver:
    """Full LU with partial pivoting, for a handful of unknowns."""

    def factorise(self, matrix: Array) -> direct.Factors:
        """LU factors of the matrix with rows and columns scaled to a largest entry of 1."""
        finite = np.isfinite(matrix).all(axis=0)
        if not finite.all():
            raise direct.NonFiniteTangentError(int(np.argmin(finite)))
        columns = np.abs(matrix).max(axis=0)
        direct.require_stiffness(columns)
        rows = np.abs(matrix / columns).max(axis=1)
        direct.require_stiffness(rows)
        lu, pivots, info = lapack.dgetrf(matrix / columns / rows[:, None])
        if info > 0:
            raise direct.SingularTangentError(f"the pivot of unknown {info - 1} is zero", info - 1)
        return direct.Factors(
            lambda right: lapack.dgetrs(lu, pivots, right / rows)[0] / columns,
            lambda: int((np.linalg.eigvals(matrix).real < 0.0).sum()),
        )


class SparseSolver:
    """Chooses band or sparse LU from the first matrix; keeps the plan while the pattern stays."""

    plan: direct.BandPlan | direct.SuperLUPlan | None = None
    name = "none yet"  # of the factorisation that was chosen, for reports

    def factorise(self, matrix: csc_matrix | Bordered | Condensed | Joined) -> direct.Factors:
        """Factors by the plan for the pattern of the matrix; other unknowns are eliminated."""
        if isinstance(matrix, Bordered | Condensed | Joined):
            return matrix.factorised(self.factorise)
        if getattr(matrix, "format", "full") != "csc":
            matrix = csc_matrix(matrix)
        direct.require_finite(matrix)
        if self.plan is None or not self.plan.fits(matrix):
            self.plan = fastest_plan(matrix)
        factors = self.plan.factorise(matrix)
        self.name = self.plan.name
        return factors


def fastest_plan(matrix: csc_matrix) -> direct.BandPlan | direct.SuperLUPlan:
    """The fastest plan for the pattern of a matrix, from the width of its band."""
    band, there = direct.BandPlan(matrix), direct.pardiso_is_there()
    if band.width <= (WIDEST_BEFORE_PARDISO if there else WIDEST_BAND):
        return band
    return direct.PardisoPlan(matrix) if there else direct.SuperLUPlan(matrix)
