"""Factorise once, solve many.

Solvers behind one small protocol.  A strip numbered along its length has a narrow band, for
which LAPACK's band factorisations are the fastest (:mod:`anmstrip.series.band`); a sparse LU
takes over where the band would be wide (:mod:`anmstrip.series.sparse_lu`): MKL PARDISO if it
is installed, SuperLU else.  Small full systems use a full LU.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csc_matrix

from .band import BandPlan
from .factors import (
    Array,
    Factors,
    NonFiniteTangentError,
    SingularTangentError,
    equilibrated,
    no_pivot,
    no_stiffness,
    not_finite,
)
from .sparse_lu import PardisoPlan, SuperLUPlan, pardiso_is_there

__all__ = [
    "DenseSolver",
    "Factors",
    "LinearSolver",
    "NonFiniteTangentError",
    "SingularTangentError",
    "SparseSolver",
    "equilibrated",
]

WIDEST_BAND = 600
"""Half bandwidth above which SuperLU is faster than the band LU (measured)."""

<<<<<<< HEAD

SCALED = 20.0
"""Largest entry of a column, or its reciprocal, that counts as of order one."""

MOST_SCALINGS = 10


class SingularTangentError(ArithmeticError):
    """The tangent has no usable factorisation: a singular point of the path.

    Attributes
    ----------
    unknown : int or None
        Number of the unknown at which it shows.
    """

    def __init__(self, message: str, unknown: int | None = None) -> None:
        super().__init__(message)
        self.unknown = unknown


class NonFiniteTangentError(SingularTangentError):
    """The tangent has entries that are not finite."""


class Factors(Protocol):
    """A factorised matrix."""

    @property
    def negatives(self) -> int:
        """Number of negative eigenvalues; of a matrix that is not symmetric, of negative pivots."""

    def solve(self, right: Array) -> Array:
        """Solution of K x = right."""
=======
WIDEST_BEFORE_PARDISO = 250
"""The same for PARDISO (measured)."""
>>>>>>> 03a7c22cdf88b952b9f6151f2517562dde2f0a95


class LinearSolver(Protocol):
    """Makes factors of matrices."""

    def factorise(self, matrix: Any) -> Factors:
        """LU factors; raises :class:`SingularTangentError`."""


class DenseSolver:
    """Full LU with partial pivoting, for a handful of unknowns."""

    def factorise(self, matrix: Array) -> Factors:
        finite = np.isfinite(matrix).all(axis=0)
        if not finite.all():
            raise not_finite(int(np.argmin(finite)))
        columns = np.abs(matrix).max(axis=0)
        if (columns == 0.0).any():
            raise no_stiffness(int(np.argmin(columns)))
        rows = np.abs(matrix / columns).max(axis=1)
        if (rows == 0.0).any():
            raise no_stiffness(int(np.argmin(rows)))
        lu, pivots, info = lapack.dgetrf(matrix / columns / rows[:, None])
        if info > 0:
<<<<<<< HEAD
            raise _no_pivot(info - 1)
        return _DenseFactors(lu, pivots, rows, columns, matrix)
=======
            raise no_pivot(info - 1)
        return _DenseFactors(lu, pivots, rows, columns)
>>>>>>> 03a7c22cdf88b952b9f6151f2517562dde2f0a95


class _DenseFactors:
    def __init__(
        self, lu: Array, pivots: Array, rows: Array, columns: Array, matrix: Array
    ) -> None:
        self.lu, self.pivots, self.rows, self.columns = lu, pivots, rows, columns
        self.matrix = matrix

    @cached_property
    def negatives(self) -> int:
        return int((np.linalg.eigvals(self.matrix).real < 0.0).sum())

    def solve(self, right: Array) -> Array:
        return lapack.dgetrs(self.lu, self.pivots, right / self.rows)[0] / self.columns


class SparseSolver:
    """Chooses band or sparse LU from the first matrix; keeps the plan while the pattern stays."""

    def __init__(self) -> None:
        self.plan: BandPlan | SuperLUPlan | None = None

    def factorise(self, matrix: csc_matrix) -> Factors:
        finite = np.isfinite(matrix.data)
        if not finite.all():
            first = int(np.argmin(finite))
            raise not_finite(int(np.searchsorted(matrix.indptr, first, side="right")) - 1)
        if self.plan is None or not self.plan.fits(matrix):
            self.plan = planned(matrix)
        return self.plan.factorise(matrix)

    @property
    def name(self) -> str:
        """What was chosen, for reports."""
        return "none yet" if self.plan is None else self.plan.name


<<<<<<< HEAD
def equilibrated(matrix: csc_matrix) -> Array:
    """Factors d such that the largest d_i |K_ij| d_j of every column is of order one.

    The diagonal gives them at once where it is not small beside the rest; where it
    is (multipliers), the iteration of Ruiz (2001) goes on from there.
    """
    magnitude = np.abs(matrix.data)
    largest = _column_maxima(magnitude, matrix.indptr)
    if (largest == 0.0).any():
        raise _no_stiffness(int(np.argmin(largest)))
    diagonal = np.abs(matrix.diagonal())
    d = 1.0 / np.sqrt(np.where(diagonal > 1e-8 * largest, diagonal, largest))
    for _ in range(MOST_SCALINGS):
        size = d * _column_maxima(magnitude * d[matrix.indices], matrix.indptr)
        if size.max() < SCALED and size.min() > 1.0 / SCALED:
            break
        d /= np.sqrt(size)
    return d


def _column_maxima(magnitude: Array, indptr: NDArray[np.int_]) -> Array:
    """Largest entry of every column, 0 where it has none."""
    filled = np.flatnonzero(np.diff(indptr))
    maxima = np.zeros(len(indptr) - 1)
    maxima[filled] = np.maximum.reduceat(magnitude, indptr[filled])
    return maxima


class _Plan:
    """What depends on the pattern alone."""

    name = ""

    def __init__(self, matrix: csc_matrix) -> None:
        self.indptr, self.indices = matrix.indptr, matrix.indices
        self.counts = np.diff(matrix.indptr)

    def scaled(self, matrix: csc_matrix, d: Array) -> Array:
        """Entries d_i K_ij d_j, in the order of the matrix."""
        data = d[self.indices]
        data *= np.repeat(d, self.counts)
        data *= matrix.data
        return data

    def fits(self, matrix: csc_matrix) -> bool:
        """Whether the matrix has the pattern that was planned for."""
        return matrix.indices is self.indices or (
            matrix.nnz == len(self.indices)
            and np.array_equal(matrix.indptr, self.indptr)
            and np.array_equal(matrix.indices, self.indices)
        )


class _BandPlan(_Plan):
    """LAPACK band factorisations in the given or in the reverse Cuthill–McKee order."""

    name = "band LU"

    def __init__(self, matrix: csc_matrix) -> None:
        super().__init__(matrix)
        n = matrix.shape[0]
        columns = np.repeat(np.arange(n), self.counts)
        orders = [np.arange(n), reverse_cuthill_mckee(matrix.tocsr(), symmetric_mode=True)]
        places = []
        for order in orders:
            place = np.empty(n, dtype=np.int64)
            place[order] = np.arange(n)
            places.append((int(np.abs(place[self.indices] - place[columns]).max()), place))
        self.width, self.place = min(places, key=lambda p: p[0])
        row, column = self.place[self.indices], self.place[columns]
        self.shape = (3 * self.width + 1, n)
        self.flat = (2 * self.width + row - column) + column * self.shape[0]
        self.mirror = _mirror(matrix)
        self.lower = np.flatnonzero(row >= column)
        self.lower_flat = (row + column * self.width)[self.lower]

    def factorise(self, matrix: csc_matrix) -> Factors:
        d = equilibrated(matrix)
        data = self.scaled(matrix, d)
        factors = self._cholesky(data, d) if self._symmetric(data) else None
        self.name = "band LU" if factors is None else "band Cholesky"
        return self._lu(data, d) if factors is None else factors

    def _symmetric(self, data: Array) -> bool:
        """Whether entries of order one equal their mirror images to round-off."""
        return self.mirror is not None and bool(np.abs(data - data[self.mirror]).max() <= 1e-14)

    def _cholesky(self, data: Array, d: Array) -> Factors | None:
        """Factors, ``None`` if the matrix is not positive definite (LAPACK pbtrf)."""
        band = np.zeros((self.width + 1, self.shape[1]), order="F")
        band.ravel(order="K")[self.lower_flat] = data[self.lower]
        factor, info = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
        return None if info > 0 else _CholeskyFactors(factor, self.place, d)

    def _lu(self, data: Array, d: Array) -> Factors:
        band = np.zeros(self.shape, order="F")
        band.ravel(order="K")[self.flat] = data
        lu, pivots, info = lapack.dgbtrf(band, self.width, self.width, overwrite_ab=1)
        if info > 0:
            raise _no_pivot(int(np.flatnonzero(self.place == info - 1)[0]))
        scaled = csc_matrix((data, self.indices, self.indptr), shape=(len(d), len(d)))
        return _BandFactors(lu, pivots, self.width, self.place, d, scaled)


def _mirror(matrix: csc_matrix) -> NDArray[np.int_] | None:
    """Where the entry (j, i) is stored, for every stored (i, j); ``None`` if some is not."""
    numbered = csc_matrix((np.arange(matrix.nnz), matrix.indices, matrix.indptr), matrix.shape)
    turned = numbered.T.tocsc()
    same = np.array_equal(turned.indptr, matrix.indptr)
    return turned.data if same and np.array_equal(turned.indices, matrix.indices) else None


class _CholeskyFactors:
    negatives = 0

    def __init__(self, factor: Array, place: NDArray[np.int_], scale: Array) -> None:
        self.factor, self.place, self.scale = factor, place, scale

    def solve(self, right: Array) -> Array:
        ordered = np.empty_like(right)
        ordered[self.place] = right * self.scale
        x, _ = lapack.dpbtrs(self.factor, ordered, lower=1, overwrite_b=1)
        return x[self.place] * self.scale


class _BandFactors:
    def __init__(
        self, lu: Array, pivots: Array, width: int, place: Array, scale: Array, matrix: csc_matrix
    ) -> None:
        self.lu, self.pivots, self.width, self.place, self.scale = lu, pivots, width, place, scale
        self.matrix = matrix

    @cached_property
    def negatives(self) -> int:
        return _negative_pivots(_on_diagonal(self.matrix))

    def solve(self, right: Array) -> Array:
        ordered = np.empty_like(right)
        ordered[self.place] = right * self.scale
        x, _ = lapack.dgbtrs(self.lu, self.width, self.width, ordered, self.pivots, overwrite_b=1)
        return x[self.place] * self.scale


class _SuperLUPlan(_Plan):
    """Sparse LU that keeps the diagonal as pivot, with one step of refinement per solve."""

    name = "sparse LU"

    def factorise(self, matrix: csc_matrix) -> Factors:
        d = equilibrated(matrix)
        data = self.scaled(matrix, d)
        scaled = csc_matrix((data, self.indices, self.indptr), shape=matrix.shape)
        try:
            return _SuperLUFactors(_on_diagonal(scaled), scaled, d)
        except RuntimeError as error:
            raise SingularTangentError(str(error)) from error


def _on_diagonal(matrix: csc_matrix) -> Any:
    """Sparse LU in a symmetric order that keeps the diagonal as pivots."""
    options = {"SymmetricMode": True}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def _negative_pivots(lu: Any) -> int:
    """By Sylvester's law the number of negative eigenvalues of a symmetric matrix."""
    return int((lu.U.diagonal() < 0.0).sum())


class _SuperLUFactors:
    def __init__(self, lu: Any, matrix: csc_matrix, scale: Array) -> None:
        self.lu, self.matrix, self.scale = lu, matrix, scale

    @cached_property
    def negatives(self) -> int:
        return _negative_pivots(self.lu)

    def solve(self, right: Array) -> Array:
        b = right * self.scale
        x = self.lu.solve(b)
        x += self.lu.solve(b - self.matrix @ x)
        return x * self.scale
=======
def planned(matrix: csc_matrix) -> BandPlan | SuperLUPlan:
    """The fastest plan for the pattern of a matrix, from the width of its band."""
    band, there = BandPlan(matrix), pardiso_is_there()
    if band.width <= (WIDEST_BEFORE_PARDISO if there else WIDEST_BAND):
        return band
    return PardisoPlan(matrix) if there else SuperLUPlan(matrix)
>>>>>>> 03a7c22cdf88b952b9f6151f2517562dde2f0a95
