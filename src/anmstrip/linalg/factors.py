"""What all factorisations share: a protocol, their errors, and scaling."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU, splu

Array = NDArray[np.float64]

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


def not_finite(unknown: int) -> NonFiniteTangentError:
    return NonFiniteTangentError("the tangent has entries that are not finite", unknown)


def no_stiffness(unknown: int) -> SingularTangentError:
    return SingularTangentError(f"unknown {unknown} has no stiffness", unknown)


def no_pivot(unknown: int) -> SingularTangentError:
    return SingularTangentError(f"the pivot of unknown {unknown} is zero", unknown)


def equilibrated(matrix: csc_matrix) -> Array:
    """Factors d such that the largest d_i |K_ij| d_j of every column is of order one.

    The diagonal gives them at once where it is not small beside the rest; where it
    is (multipliers), the iteration of Ruiz (2001) goes on from there.
    """
    magnitude = np.abs(matrix.data)
    largest = _column_maxima(magnitude, matrix.indptr)
    if (largest == 0.0).any():
        raise no_stiffness(int(np.argmin(largest)))
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


def on_diagonal(matrix: csc_matrix) -> SuperLU:
    """Sparse LU in a symmetric order that keeps the diagonal as pivots."""
    try:
        return splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SingularTangentError(str(error)) from error


def negative_pivots(lu: SuperLU) -> int:
    """By Sylvester's law the number of negative eigenvalues of a symmetric matrix."""
    return int((lu.U.diagonal() < 0.0).sum())


class Plan:
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
