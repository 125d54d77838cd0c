"""Factorise once, solve many.

Three solvers behind one small protocol.  A strip numbered along its length has
a narrow band, for which LAPACK's band LU is the fastest; a sparse LU takes over
where the band would be wide; small full systems use a full LU.  The rows and
columns are scaled before, since values and derivatives have different units.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.sparse import csc_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]

WIDEST_BAND = 600
"""Half bandwidth above which the sparse LU is faster than the band LU (measured)."""


class SingularTangentError(ArithmeticError):
    """The tangent has no usable factorisation: a singular point of the path."""


class Factors(Protocol):
    """A factorised matrix."""

    def solve(self, right: Array) -> Array:
        """Solution of K x = right."""


class LinearSolver(Protocol):
    """Makes factors of matrices."""

    def factorise(self, matrix: Any) -> Factors:
        """LU factors; raises :class:`SingularTangentError`."""


class DenseSolver:
    """Full LU with partial pivoting, for a handful of unknowns."""

    def factorise(self, matrix: Array) -> Factors:
        scale = np.abs(matrix).max(axis=1)
        if not np.isfinite(matrix).all() or (scale == 0.0).any():
            raise SingularTangentError("the tangent has an empty or non-finite row")
        lu, pivots, info = lapack.dgetrf(matrix / scale[:, None])
        if info > 0:
            raise SingularTangentError(f"pivot {info} of the tangent is zero")
        return _DenseFactors(lu, pivots, scale)


class _DenseFactors:
    def __init__(self, lu: Array, pivots: Array, scale: Array) -> None:
        self.lu, self.pivots, self.scale = lu, pivots, scale

    def solve(self, right: Array) -> Array:
        return lapack.dgetrs(self.lu, self.pivots, right / self.scale)[0]


class SparseSolver:
    """Chooses band or sparse LU from the first matrix; keeps the plan while the pattern stays."""

    def __init__(self) -> None:
        self.plan: _BandPlan | _SuperLUPlan | None = None

    def factorise(self, matrix: csc_matrix) -> Factors:
        if not np.isfinite(matrix.data).all():
            raise SingularTangentError("the tangent has entries that are not finite")
        if self.plan is None or not self.plan.fits(matrix):
            band = _BandPlan(matrix)
            self.plan = band if band.width <= WIDEST_BAND else _SuperLUPlan(matrix)
        return self.plan.factorise(matrix)

    @property
    def name(self) -> str:
        """What was chosen, for reports."""
        return "none yet" if self.plan is None else self.plan.name


def equilibrated(matrix: csc_matrix) -> Array:
    """Factors d such that d_i |K_ij| d_j is of order one: 1/√(largest entry of the column)."""
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    largest = np.zeros(matrix.shape[1])
    magnitude = np.abs(matrix.data)
    np.maximum.at(largest, columns, magnitude)
    np.maximum.at(largest, matrix.indices, magnitude)
    if (largest == 0.0).any():
        raise SingularTangentError(
            f"unknown {int(np.argmin(largest))} has no stiffness: something is not held"
        )
    diagonal = np.abs(matrix.diagonal())
    return 1.0 / np.sqrt(np.maximum(diagonal, 1e-8 * largest))


class _Plan:
    """What depends on the pattern alone."""

    name = ""

    def __init__(self, matrix: csc_matrix) -> None:
        self.indptr, self.indices = matrix.indptr, matrix.indices
        self.columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))

    def fits(self, matrix: csc_matrix) -> bool:
        """Whether the matrix has the pattern that was planned for."""
        return matrix.indices is self.indices or (
            matrix.nnz == len(self.indices)
            and np.array_equal(matrix.indptr, self.indptr)
            and np.array_equal(matrix.indices, self.indices)
        )


class _BandPlan(_Plan):
    """Band LU (LAPACK gbtrf) in the given or in the reverse Cuthill–McKee order."""

    name = "band LU"

    def __init__(self, matrix: csc_matrix) -> None:
        super().__init__(matrix)
        n = matrix.shape[0]
        orders = [np.arange(n), reverse_cuthill_mckee(matrix.tocsr(), symmetric_mode=True)]
        places = []
        for order in orders:
            place = np.empty(n, dtype=np.int64)
            place[order] = np.arange(n)
            places.append((int(np.abs(place[self.indices] - place[self.columns]).max()), place))
        self.width, self.place = min(places, key=lambda p: p[0])
        row, column = self.place[self.indices], self.place[self.columns]
        self.shape = (3 * self.width + 1, n)
        self.flat = (2 * self.width + row - column) + column * self.shape[0]

    def factorise(self, matrix: csc_matrix) -> Factors:
        d = equilibrated(matrix)
        band = np.zeros(self.shape, order="F")
        band.ravel(order="K")[self.flat] = matrix.data * d[self.indices] * d[self.columns]
        lu, pivots, info = lapack.dgbtrf(band, self.width, self.width, overwrite_ab=1)
        if info > 0:
            raise SingularTangentError(f"pivot {info} of the tangent is zero")
        return _BandFactors(lu, pivots, self.width, self.place, d)


class _BandFactors:
    def __init__(self, lu: Array, pivots: Array, width: int, place: Array, scale: Array) -> None:
        self.lu, self.pivots, self.width, self.place, self.scale = lu, pivots, width, place, scale

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
        data = matrix.data * d[self.indices] * d[self.columns]
        scaled = csc_matrix((data, self.indices, self.indptr), shape=matrix.shape)
        try:
            lu = splu(
                scaled,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SingularTangentError(str(error)) from error
        return _SuperLUFactors(lu, scaled, d)


class _SuperLUFactors:
    def __init__(self, lu: Any, matrix: csc_matrix, scale: Array) -> None:
        self.lu, self.matrix, self.scale = lu, matrix, scale

    def solve(self, right: Array) -> Array:
        b = right * self.scale
        x = self.lu.solve(b)
        x += self.lu.solve(b - self.matrix @ x)
        return x * self.scale
