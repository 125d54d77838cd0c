"""LAPACK's band factorisations: Cholesky's where the matrix allows it, LU elsewhere.

Cholesky's needs symmetry and positive definiteness (no friction, a stable state); LU is
three times as dear in all.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.sparse import csc_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

from .factors import (
    Array,
    Factors,
    Plan,
    equilibrated,
    negative_pivots,
    no_pivot,
    on_diagonal,
)


class BandPlan(Plan):
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
            raise no_pivot(int(np.flatnonzero(self.place == info - 1)[0]))
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
        return negative_pivots(on_diagonal(self.matrix))

    def solve(self, right: Array) -> Array:
        ordered = np.empty_like(right)
        ordered[self.place] = right * self.scale
        x, _ = lapack.dgbtrs(self.lu, self.width, self.width, ordered, self.pivots, overwrite_b=1)
        return x[self.place] * self.scale
