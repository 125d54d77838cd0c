"""Direct factorisations: LAPACK's band solvers, SuperLU, and MKL PARDISO where installed."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import cached_property
from importlib.util import find_spec
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.sparse import csc_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from anmstrip.linalg.factors import (
    Array,
    Factors,
    Plan,
    SingularTangentError,
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
        from pypardiso import pardiso_wrapper

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
