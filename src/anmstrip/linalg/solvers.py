"""Linear solvers that factorise once and solve many times."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csc_matrix

from anmstrip.linalg.direct import BandPlan, PardisoPlan, SuperLUPlan, pardiso_is_there
from anmstrip.linalg.factors import (
    Array,
    Factors,
    NonFiniteTangentError,
    SingularTangentError,
    equilibrated,
    no_pivot,
    no_stiffness,
    not_finite,
)

__all__ = [
    "DenseSolver",
    "Factors",
    "LinearSolver",
    "NonFiniteTangentError",
    "SingularTangentError",
    "SparseSolver",
    "equilibrated",
]

WIDEST_BAND = 450
"""Half bandwidth above which SuperLU is faster than the band LU (measured)."""

WIDEST_BEFORE_PARDISO = 200
"""The same for PARDISO (measured)."""


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
            raise no_pivot(info - 1)
        return _DenseFactors(lu, pivots, rows, columns, matrix)


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
    """Chooses band or sparse LU from the first matrix; keeps the plan while the pattern stays.

    Attributes
    ----------
    latest : tuple or None
        Matrix and factors of the last factorisation.
    """

    def __init__(self) -> None:
        self.plan: BandPlan | SuperLUPlan | None = None
        self.latest: tuple[csc_matrix, Factors] | None = None

    def factorise(self, matrix: csc_matrix) -> Factors:
        finite = np.isfinite(matrix.data)
        if not finite.all():
            first = int(np.argmin(finite))
            raise not_finite(int(np.searchsorted(matrix.indptr, first, side="right")) - 1)
        if self.plan is None or not self.plan.fits(matrix):
            self.plan = planned(matrix)
        self.latest = matrix, self.plan.factorise(matrix)
        return self.latest[1]

    @property
    def name(self) -> str:
        """What was chosen, for reports."""
        return "none yet" if self.plan is None else self.plan.name


def planned(matrix: csc_matrix) -> BandPlan | SuperLUPlan:
    """The fastest plan for the pattern of a matrix, from the width of its band."""
    band, there = BandPlan(matrix), pardiso_is_there()
    if band.width <= (WIDEST_BEFORE_PARDISO if there else WIDEST_BAND):
        return band
    return PardisoPlan(matrix) if there else SuperLUPlan(matrix)
