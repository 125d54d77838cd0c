"""Direct factorisations of a scaled tangent: LAPACK, SuperLU, and MKL PARDISO where installed."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from copy import copy
from functools import cached_property
from importlib.util import find_spec
from typing import Any, cast

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csc_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import SuperLU, splu

from anmstrip.arrays import Array, Index

Solve = Callable[[Array], Array]

WELL_SCALED = 20.0
"""Largest entry of a column, or its reciprocal, that counts as of order one."""

MAX_SCALINGS = 10

TARGET_BACKWARD_ERROR = 1e-15
"""Backward error after which refinement stops."""

LARGEST_BACKWARD_ERROR = 1e-9
"""Backward error with which factors are of no use."""

MAX_REFINEMENTS = 3


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


def require_finite(matrix: csc_matrix) -> None:
    """Raise an error that names the first column with an entry that is not finite."""
    finite = np.isfinite(matrix.data)
    if not finite.all():
        first = int(np.argmin(finite))
        raise NonFiniteTangentError(int(np.searchsorted(matrix.indptr, first, side="right")) - 1)


def equilibrate(matrix: csc_matrix) -> Array:
    """Factors d such that the largest d_i |K_ij| d_j of every column is of order one.

    The diagonal gives them at once where it is not small beside the rest; where it
    is (multipliers), the iteration of Ruiz (2001) goes on from there.
    """

    filled = np.flatnonzero(matrix.indptr[1:] > matrix.indptr[:-1])

    def column_maxima(entries: Array) -> Array:
        maxima = np.zeros(matrix.shape[1])
        maxima[filled] = np.maximum.reduceat(entries, matrix.indptr[filled])
        return maxima

    magnitude = np.abs(matrix.data)
    largest = column_maxima(magnitude)
    require_stiffness(largest)
    diagonal = np.abs(matrix.diagonal())
    d = 1.0 / np.sqrt(np.where(diagonal > 1e-8 * largest, diagonal, largest))
    with np.errstate(all="ignore"):  # stiffness may be as small as doubles are
        for _ in range(MAX_SCALINGS):
            size = d * column_maxima(magnitude * d[matrix.indices])
            if size.max() < WELL_SCALED and size.min() > 1.0 / WELL_SCALED:
                break
            d /= np.sqrt(size)
        require_stiffness(np.isfinite(d))
    return d


def symmetric_lu(matrix: csc_matrix) -> SuperLU:
    """Sparse LU in a symmetric order that keeps the diagonal as pivots."""
    try:
        return splu(matrix, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise SingularTangentError(str(error)) from error


def negative_pivots(matrix: csc_matrix) -> int:
    """Number of negative pivots, by Sylvester's law that of negative eigenvalues if symmetric."""
    return int((symmetric_lu(matrix).U.diagonal() < 0.0).sum())


def with_refinement(solve: Solve, matrix: Any, norm: float) -> Solve:
    """Solver with as many steps of iterative refinement as a trial asks for.

    Parameters
    ----------
    solve : callable
    matrix : matrix
        Anything with a ``shape`` and a product with a vector, of entries of order one.
    norm : float
        Largest sum of the sizes of a row's entries.

    Raises
    ------
    SingularTangentError
        The factors do not solve the system.
    """
    b = np.cos(np.arange(matrix.shape[0]))

    def backward_error(x: Array) -> float:
        scale = norm * np.abs(x).max() + np.abs(b).max()
        return float(np.abs(b - matrix @ x).max() / scale)

    left, steps = np.inf, 0
    with np.errstate(over="ignore", invalid="ignore"):  # of factors that are no solver
        x = solve(b)
        while (error := backward_error(x)) > TARGET_BACKWARD_ERROR and steps < MAX_REFINEMENTS:
            if not error < left / 2:
                break
            x, left, steps = x + solve(b - matrix @ x), error, steps + 1
    if not error < LARGEST_BACKWARD_ERROR:
        raise SingularTangentError(f"the factors leave a residual of {error:.1g}")

    def solve_and_refine(b: Array) -> Array:
        x = solve(b)
        for _ in range(steps):
            x += solve(b - matrix @ x)
        return x

    return solve_and_refine


class Plan:
    """Preparation of a factorisation, which depends on the pattern of the matrix alone."""

    name = ""

    def __init__(self, matrix: csc_matrix) -> None:
        self.indptr, self.indices = matrix.indptr, matrix.indices
        columns = np.arange(matrix.shape[0], dtype=matrix.indices.dtype)
        self.columns = np.repeat(columns, np.diff(matrix.indptr))

    def scaled(self, matrix: csc_matrix) -> tuple[csc_matrix, Array]:
        """Matrix of the entries d_i K_ij d_j, in the order of the given one, and d.

        See :func:`equilibrate`; of a matrix that is positive definite the diagonal is enough.
        """
        found, diagonal = copy(matrix), matrix.diagonal()

        def multiply(d: Array) -> Array:
            found.data = d[self.indices]
            found.data *= d[self.columns]
            found.data *= matrix.data
            return d

        if diagonal.min() > 0.0:
            with np.errstate(over="ignore"):  # stiffness may be as small as doubles are
                d = multiply(1.0 / np.sqrt(diagonal))
            if max(found.data.max(), -found.data.min()) < WELL_SCALED:
                return found, d
        return found, multiply(equilibrate(matrix))

    def fits(self, matrix: csc_matrix) -> bool:
        """Whether the matrix has the pattern that was planned for."""
        return matrix.indices is self.indices or (
            matrix.nnz == len(self.indices)
            and np.array_equal(matrix.indptr, self.indptr)
            and np.array_equal(matrix.indices, self.indices)
        )


class BandPlan(Plan):
    """LAPACK band factorisations in the given or in the reverse Cuthill–McKee order."""

    name = "band LU"

    def __init__(self, matrix: csc_matrix) -> None:
        super().__init__(matrix)
        n = matrix.shape[0]
        places = []
        for order in (np.arange(n), reverse_cuthill_mckee(matrix.tocsr(), symmetric_mode=True)):
            place = np.empty(n, dtype=np.int64)
            place[order] = np.arange(n)
            places.append((int(np.abs(place[self.indices] - place[self.columns]).max()), place))
        self.width, self.place = min(places, key=lambda p: p[0])
        self.natural = np.array_equal(self.place, np.arange(n))
        row, column = self.place[self.indices], self.place[self.columns]
        self.shape = (3 * self.width + 1, n)
        self.flat = (2 * self.width + row - column) + column * self.shape[0]
        self.lower = np.flatnonzero(row >= column)
        self.lower_flat = (row + column * self.width)[self.lower]
        numbered = csc_matrix((np.arange(matrix.nnz), matrix.indices, matrix.indptr), matrix.shape)
        turned = numbered.T.tocsc()  # its data tell where the entry (j, i) is stored
        same = np.array_equal(turned.indptr, matrix.indptr)
        same = same and np.array_equal(turned.indices, matrix.indices)
        self.mirror = turned.data if same else None

    def factorise(self, matrix: csc_matrix) -> Factors:
        """Cholesky factors of a symmetric positive definite matrix, LU factors of others."""
        (scaled, d), place = self.scaled(matrix), self.place
        solve_band, self.name = self._cholesky(scaled.data), "band Cholesky"
        definite = solve_band is not None
        if solve_band is None:
            solve_band, self.name = self._lu(scaled.data), "band LU"

        def solve(right: Array) -> Array:
            if self.natural:
                return solve_band(right * d) * d
            ordered = np.empty_like(right)
            ordered[place] = right * d
            return solve_band(ordered)[place] * d

        return Factors(solve, lambda: 0 if definite else negative_pivots(scaled))

    def _cholesky(self, data: Array) -> Solve | None:
        """Solver, or ``None`` if the matrix is not symmetric or not positive definite."""
        if self.mirror is None or np.abs(data - data[self.mirror]).max() > 1e-14:
            return None
        band = np.zeros((self.width + 1, self.shape[1]), order="F")
        band.ravel(order="K")[self.lower_flat] = data[self.lower]
        factor, info = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
        return None if info > 0 else lambda b: lapack.dpbtrs(factor, b, lower=1, overwrite_b=1)[0]

    def _lu(self, data: Array) -> Solve:
        band, width = np.zeros(self.shape, order="F"), self.width
        band.ravel(order="K")[self.flat] = data
        lu, pivots, info = lapack.dgbtrf(band, width, width, overwrite_ab=1)
        if info > 0:
            unknown = int(np.flatnonzero(self.place == info - 1)[0])
            raise SingularTangentError(f"the pivot of unknown {unknown} is zero", unknown)
        return lambda b: lapack.dgbtrs(lu, width, width, b, pivots, overwrite_b=1)[0]


class SuperLUPlan(Plan):
    """SuperLU in the symmetric mode, with pivoting where that does not solve the system."""

    name = "sparse LU"

    def factorise(self, matrix: csc_matrix) -> Factors:
        """LU factors of the equilibrated matrix, refined."""
        scaled, d = self.scaled(matrix)
        norm = float(abs(scaled).sum(axis=1).max())
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # no solver then
                unpivoted = self.unpivoted(scaled)
            solve = with_refinement(unpivoted, scaled, norm)
        except SingularTangentError:
            try:
                solve = with_refinement(splu(scaled, diag_pivot_thresh=1.0).solve, scaled, norm)
            except RuntimeError as error:
                raise SingularTangentError(str(error)) from error
        return Factors(lambda right: solve(right * d) * d, lambda: negative_pivots(scaled))

    def unpivoted(self, scaled: csc_matrix) -> Solve:
        """Solver with factors of a scaled matrix whose pivots are its diagonal."""
        solve: Solve = symmetric_lu(scaled).solve
        return solve


def dense_lu(block: Array) -> Callable[..., Array]:
    """Return a solver with a square block, which may be empty, or with its transposed."""
    if not block.size:
        return lambda right, trans=0: right
    lu, pivots, info = lapack.dgetrf(block)
    if info > 0:
        raise SingularTangentError("a pivot along the chain is zero")
    return lambda right, trans=0: lapack.dgetrs(lu, pivots, right, trans=trans)[0]


class ChainPlan(SuperLUPlan):
    """Block elimination of unknowns u and s that stand step by step along a chain.

    The equations of s_g have s_g alone of their step, s_{g−1}, u_g and u_{g+1}; those of u_g have
    u_{g±1}, s_{g−1} and s_{g−2}.  With s_{g−1} = P u_g + p all s are eliminated on the way, and
    only dense blocks of u are factorised: of 16 000 unknowns of a shell with eleven layers, 2 000
    of them u, in 0.05 s, where SuperLU takes 0.2 s.

    Parameters
    ----------
    matrix : csc_matrix
        u_0, s_0, u_1, s_1 and so on.
    ends : ndarray of int, shape (steps, 2)
        Numbers after the last u and after the last s of each step.
    """

    name = "LU along a chain"

    def __init__(self, matrix: csc_matrix, ends: Index) -> None:
        super().__init__(matrix)
        bounds = np.column_stack([np.append(0, ends[:-1, 1]), ends]).tolist()
        self.steps: list[tuple[int, int, int]] = [tuple(each) for each in bounds]
        self.own = np.concatenate([np.arange(b, c) for _, b, c in self.steps])
        self.blocks, self.couplings = [], []
        for g, (a, b, c) in enumerate(self.steps):
            first, middle, _ = self.steps[g - 1] if g else (0, 0, 0)
            stop = self.steps[g + 1][1] if g + 1 < len(self.steps) else c
            on = np.arange(self.indptr[a], self.indptr[b])
            place = (self.indices[on] - first) * (b - a) + self.columns[on] - a
            self.blocks.append((on, place, (stop - first, b - a)))
            on = np.arange(self.indptr[middle], self.indptr[a])
            on = on[self.indices[on] != self.columns[on]]
            index = self.indices[on] - a, self.columns[on] - middle
            found = csc_matrix((on + 1.0, index), shape=(stop - a, a - middle))
            self.couplings.append((found, found.data.astype(np.int64) - 1))

    def unpivoted(self, scaled: csc_matrix) -> Solve:
        """Solver with the blocks of a scaled matrix, each of u with pivots of its own."""
        unit = np.ones(scaled.shape[0])
        unit[self.own] = scaled.diagonal()[self.own]
        data = scaled.data / unit[self.indices]
        couplings: list[Any] = []  # of all below by s of the step before
        solved: list[Callable[..., Array]] = []  # by the block of u
        below: list[Array] = []  # what u of the equations of a step is in those of the rest
        later: list[tuple[Array, Array]] = []  # u and s by u of the next step
        for g, (a, b, _) in enumerate(self.steps):
            on, place, shape = self.blocks[g]
            column = np.zeros(shape)
            column.ravel()[place] = data[on]
            pattern, source = self.couplings[g]
            coupling = copy(pattern)
            coupling.data = data[source]
            couplings.append(coupling)
            above, own = np.split(column, [shape[0] - coupling.shape[0]])
            if g:
                count = below[-1].shape[1]
                change = below[-1] @ above[:count]
                s = change[: len(above) - count] - above[count:]
                own[: b - a] -= change[len(s) :]
                own += coupling @ s
                later.append((solved[-1](above[:count]), s))
            solved.append(dense_lu(own[: b - a]))
            below.append(solved[-1](own[b - a :].T, trans=1).T)

        def solve(right: Array) -> Array:
            x = right / unit
            for g, (a, b, _) in enumerate(self.steps):
                if g:
                    x[a : a + couplings[g].shape[0]] -= couplings[g] @ x[self.steps[g - 1][1] : a]
                x[b : b + len(below[g])] -= below[g] @ x[a:b]
            following: Array = np.zeros(0)
            for g, (a, b, c) in reversed(list(enumerate(self.steps))):
                x[a:b] = solved[g](x[a:b])
                if len(following):
                    x[a:b] -= later[g][0] @ following
                    x[b:c] += later[g][1] @ following
                following = x[a:b]
            return x

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

        def call(phase: int, b: Array) -> Array:
            self.handle.set_phase(phase)
            try:
                x: Array = self.handle._call_pardiso(scaled, b)
            except self.failure as error:
                raise SingularTangentError(str(error)) from error
            return x

        def solve(b: Array) -> Array:
            if self.held is not scaled:
                if not self.analysed:
                    call(11, np.zeros_like(b))
                self.analysed, self.held = True, None
                call(22, np.zeros_like(b))
                if self.handle.get_iparm(14):
                    raise SingularTangentError("a pivot is zero to round-off")
                self.held = scaled
            return call(33, b)

        return solve
