"""Sparse LU for wide bands: SuperLU, and MKL PARDISO where it is installed.

Both keep the diagonal as pivot, which is fast and not always stable.  So every factorisation
is tried on one right-hand side: steps of iterative refinement make up for what it lacks, and
where they cannot, SuperLU with partial pivoting takes over.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import cached_property
from importlib.util import find_spec
from typing import cast

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from .factors import (
    Array,
    Factors,
    Plan,
    SingularTangentError,
    equilibrated,
    negative_pivots,
    on_diagonal,
)

Solve = Callable[[Array], Array]

ENOUGH = 1e-15
"""Residual after which refinement stops, over the largest entries of K x and of b."""

TOO_MUCH = 1e-9
"""Residual, likewise, with which factors are of no use."""

MOST_REFINEMENTS = 3


class RefinedFactors:
    """Factors of the scaled matrix, with as many steps of refinement as a trial asks for.

    Raises
    ------
    SingularTangentError
        The factors do not solve the system.
    """

    def __init__(self, inner: Solve, matrix: csc_matrix, scale: Array) -> None:
        self.inner, self.matrix, self.scale, self.steps = inner, matrix, scale, 0
        self.norm = float(abs(matrix).sum(axis=1).max())
        b = np.cos(np.arange(len(scale)))
        x, left = inner(b), np.inf
        while (residual := self._residual(x, b)) > ENOUGH and self.steps < MOST_REFINEMENTS:
            if not residual < 0.5 * left:
                break
            x, left, self.steps = x + inner(b - matrix @ x), residual, self.steps + 1
        if not residual < TOO_MUCH:
            raise SingularTangentError(f"the factors leave a residual of {residual:.1g}")

    def _residual(self, x: Array, b: Array) -> float:
        size = self.norm * np.abs(x).max() + np.abs(b).max()
        return float(np.abs(b - self.matrix @ x).max() / size)

    @cached_property
    def negatives(self) -> int:
        return negative_pivots(on_diagonal(self.matrix))

    def solve(self, right: Array) -> Array:
        b = right * self.scale
        x = self.inner(b)
        for _ in range(self.steps):
            x += self.inner(b - self.matrix @ x)
        return x * self.scale


class SuperLUPlan(Plan):
    """SuperLU in the symmetric mode."""

    name = "sparse LU"

    def factorise(self, matrix: csc_matrix) -> Factors:
        d = equilibrated(matrix)
        scaled = csc_matrix((self.scaled(matrix, d), self.indices, self.indptr), matrix.shape)
        try:
            return RefinedFactors(self.unpivoted(scaled), scaled, d)
        except SingularTangentError:
            return RefinedFactors(_pivoted(scaled), scaled, d)

    def unpivoted(self, scaled: csc_matrix) -> Solve:
        """Solver with the factors of a scaled matrix."""
        solve: Solve = on_diagonal(scaled).solve
        return solve


def _pivoted(matrix: csc_matrix) -> Solve:
    try:
        solve: Solve = splu(matrix, diag_pivot_thresh=1.0).solve
    except RuntimeError as error:
        raise SingularTangentError(str(error)) from error
    return solve


PARDISO_CHOICES = {1: 1, 2: 2, 8: 0, 10: 13, 11: 0, 12: 2, 13: 0}
"""Of its iparm: nested dissection, no refinement of its own, pivots below 1e-13 replaced, no
scaling or matching, and the transpose (it takes rows where there are columns)."""


def pardiso_is_there() -> bool:
    """Whether the extra ``pardiso`` is installed."""
    return find_spec("pypardiso") is not None


class PardisoPlan(SuperLUPlan):
    """MKL PARDISO; the order of elimination is found once for a pattern."""

    name = "PARDISO"

    def __init__(self, matrix: csc_matrix) -> None:
        from pypardiso import pardiso_wrapper  # noqa: PLC0415 (optional, and large)

        super().__init__(matrix)
        self.failure = pardiso_wrapper.PyPardisoError
        self.handle = pardiso_wrapper.PyPardisoSolver(mtype=11)
        for place, choice in PARDISO_CHOICES.items():
            self.handle.set_iparm(place, choice)
        self.analysed, self.held = False, cast(csc_matrix | None, None)
        weakref.finalize(self, self.handle.free_memory, everything=True)

    def unpivoted(self, scaled: csc_matrix) -> Solve:
        """Solver with the factors of a scaled matrix; made again if others came between."""
        scaled = scaled.sorted_indices()

        def solve(b: Array) -> Array:
            self._hold(scaled)
            return self._call(33, scaled, b)

        return solve

    def _hold(self, matrix: csc_matrix) -> None:
        if self.held is matrix:
            return
        if not self.analysed:
            self._call(11, matrix, np.zeros(matrix.shape[0]))
        self.analysed, self.held = True, None
        self._call(22, matrix, np.zeros(matrix.shape[0]))
        if self.handle.get_iparm(14):
            raise SingularTangentError("a pivot is zero to round-off")
        self.held = matrix

    def _call(self, phase: int, matrix: csc_matrix, b: Array) -> Array:
        self.handle.set_phase(phase)
        try:
            x: Array = self.handle._call_pardiso(matrix, b)
        except self.failure as error:
            raise SingularTangentError(str(error)) from error
        return x
