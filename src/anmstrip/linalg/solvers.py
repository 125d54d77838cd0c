"""Linear solvers that factorise once and solve many times."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csc_matrix

from anmstrip.linalg.bordered import Bordered, Condensed, Joined
from anmstrip.linalg.direct import (
    Array,
    BandPlan,
    Factors,
    NonFiniteTangentError,
    PardisoPlan,
    SingularTangentError,
    SuperLUPlan,
    pardiso_is_there,
    require_finite,
    require_stiffness,
)

WIDEST_BAND = 450
"""Half bandwidth above which SuperLU is faster than the band LU (measured)."""

WIDEST_BEFORE_PARDISO = 200
"""The same for PARDISO (measured)."""


class LinearSolver(Protocol):
    """Anything that makes factors of matrices."""

    def factorise(self, matrix: Any) -> Factors:
        """Factors; raises :class:`~anmstrip.linalg.direct.SingularTangentError`."""


class Remembering:
    """A linear solver that keeps its last factors."""

    def __init__(self, solver: LinearSolver) -> None:
        self.solver = solver

    def factorise(self, matrix: Any) -> Factors:
        """Factors of a matrix, also kept as ``factors``."""
        self.factors = self.solver.factorise(matrix)
        return self.factors


class DenseSolver:
    """Full LU with partial pivoting, for a handful of unknowns."""

    def factorise(self, matrix: Array) -> Factors:
        """LU factors of the matrix with rows and columns scaled to a largest entry of 1."""
        finite = np.isfinite(matrix).all(axis=0)
        if not finite.all():
            raise NonFiniteTangentError(int(np.argmin(finite)))
        columns = np.abs(matrix).max(axis=0)
        require_stiffness(columns)
        rows = np.abs(matrix / columns).max(axis=1)
        require_stiffness(rows)
        lu, pivots, info = lapack.dgetrf(matrix / columns / rows[:, None])
        if info > 0:
            raise SingularTangentError(f"the pivot of unknown {info - 1} is zero", info - 1)
        return Factors(
            lambda right: lapack.dgetrs(lu, pivots, right / rows)[0] / columns,
            lambda: int((np.linalg.eigvals(matrix).real < 0.0).sum()),
        )


class SparseSolver:
    """Chooses band or sparse LU from the first matrix; keeps the plan while the pattern stays."""

    plan: BandPlan | SuperLUPlan | None = None

    def factorise(self, matrix: csc_matrix | Bordered | Condensed | Joined) -> Factors:
        """Factors by the plan for the pattern of the matrix; other unknowns are eliminated."""
        if isinstance(matrix, Bordered | Condensed | Joined):
            return matrix.factorised(self.factorise)
        require_finite(matrix)
        if self.plan is None or not self.plan.fits(matrix):
            self.plan = fastest_plan(matrix)
        return self.plan.factorise(matrix)

    @property
    def name(self) -> str:
        """Name of the factorisation that was chosen, for reports."""
        return "none yet" if self.plan is None else self.plan.name


def fastest_plan(matrix: csc_matrix) -> BandPlan | SuperLUPlan:
    """The fastest plan for the pattern of a matrix, from the width of its band."""
    band, there = BandPlan(matrix), pardiso_is_there()
    if band.width <= (WIDEST_BEFORE_PARDISO if there else WIDEST_BAND):
        return band
    return PardisoPlan(matrix) if there else SuperLUPlan(matrix)
