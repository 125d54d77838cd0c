"""Factors of a matrix, the errors of factorising it, and the scaling before."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU, splu

Array = NDArray[np.float64]
Solve = Callable[[Array], Array]

SCALED = 20.0
"""Largest entry of a column, or its reciprocal, that counts as of order one."""

MOST_SCALINGS = 10

ENOUGH = 1e-15
"""Backward error after which refinement stops."""

TOO_MUCH = 1e-9
"""Backward error with which factors are of no use."""

MOST_REFINEMENTS = 3


class SingularTangentError(ArithmeticError):
    """The tangent has no usable factorisation; ``unknown`` is the number of the one it shows at."""

    def __init__(self, message: str, unknown: int | None = None) -> None:
        super().__init__(message)
        self.unknown = unknown


class NonFiniteTangentError(SingularTangentError):
    """The tangent has entries that are not finite, first in the column ``unknown``."""

    def __init__(self, unknown: int) -> None:
        super().__init__("the tangent has entries that are not finite", unknown)


class Factors:
    """Factorised matrix K.

    Parameters
    ----------
    solve : callable
        From b, shape (n,), to the solution of K x = b.
    count_negatives : callable
        Number of negative eigenvalues; of a matrix that is not symmetric, of negative pivots.
    """

    def __init__(self, solve: Solve, count_negatives: Callable[[], int]) -> None:
        self.solve, self.count_negatives = solve, count_negatives

    @cached_property
    def negatives(self) -> int:
        """Number of negative eigenvalues, counted when it is first asked for."""
        return self.count_negatives()


def require_stiffness(largest: Array) -> None:
    """Raise an error that names the first row or column whose largest entry is zero."""
    if (largest == 0.0).any():
        unknown = int(np.argmin(largest))
        raise SingularTangentError(f"unknown {unknown} has no stiffness", unknown)


def equilibrated(matrix: csc_matrix) -> Array:
    """Factors d such that the largest d_i |K_ij| d_j of every column is of order one.

    The diagonal gives them at once where it is not small beside the rest; where it
    is (multipliers), the iteration of Ruiz (2001) goes on from there.
    """

    def column_maxima(entries: Array) -> Array:
        filled = np.flatnonzero(np.diff(matrix.indptr))
        maxima = np.zeros(matrix.shape[1])
        maxima[filled] = np.maximum.reduceat(entries, matrix.indptr[filled])
        return maxima

    magnitude = np.abs(matrix.data)
    largest = column_maxima(magnitude)
    require_stiffness(largest)
    diagonal = np.abs(matrix.diagonal())
    d = 1.0 / np.sqrt(np.where(diagonal > 1e-8 * largest, diagonal, largest))
    for _ in range(MOST_SCALINGS):
        size = d * column_maxima(magnitude * d[matrix.indices])
        if size.max() < SCALED and size.min() > 1.0 / SCALED:
            break
        d /= np.sqrt(size)
    return d


def symmetric_lu(matrix: csc_matrix) -> SuperLU:
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


def negative_pivots(matrix: csc_matrix) -> int:
    """Number of negative pivots, by Sylvester's law that of negative eigenvalues if symmetric."""
    return int((symmetric_lu(matrix).U.diagonal() < 0.0).sum())


def refined(solve: Solve, matrix: csc_matrix) -> Solve:
    """Solver with as many steps of iterative refinement as a trial asks for.

    Raises
    ------
    SingularTangentError
        The factors do not solve the system.
    """
    norm, b = float(abs(matrix).sum(axis=1).max()), np.cos(np.arange(matrix.shape[0]))

    def backward_error(x: Array) -> float:
        scale = norm * np.abs(x).max() + np.abs(b).max()
        return float(np.abs(b - matrix @ x).max() / scale)

    x, left, steps = solve(b), np.inf, 0
    while (error := backward_error(x)) > ENOUGH and steps < MOST_REFINEMENTS and error < left / 2:
        x, left, steps = x + solve(b - matrix @ x), error, steps + 1
    if not error < TOO_MUCH:
        raise SingularTangentError(f"the factors leave a residual of {error:.1g}")

    def solve_and_refine(b: Array) -> Array:
        x = solve(b)
        for _ in range(steps):
            x += solve(b - matrix @ x)
        return x

    return solve_and_refine
