"""Tangents with unknowns of points' own besides those of the strip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import bmat, csc_matrix, csr_matrix, hstack, vstack

from anmstrip.arrays import Array, Index
from anmstrip.linalg.bordered import Bordered
from anmstrip.linalg.direct import Factors, SuperLUPlan


@dataclass(frozen=True)
class Condensed:
    """K = [[A, B], [C, D]] in the form A − B D⁻¹ C, of which D couples the unknowns of a point.

    Static condensation (Wilson, Int. J. Numer. Meth. Engng. 8, 1974): with K (u, z) = (f, g), u
    solves (A − B D⁻¹ C) u = f − B D⁻¹ g, and then z = D⁻¹ (g − C u).
    """

    inner: Any  # A − B D⁻¹ C, sparse or bordered
    reduced: Callable[[Array], Array]  # g to B D⁻¹ g
    recovered: Callable[[Array, Array], Array]  # u and g to z

    def factorised(self, factorise: Callable[[Any], Factors]) -> Factors:
        """Return factors of K from those of the condensed matrix."""
        inner, n = factorise(self.inner), self.inner.shape[0]

        def solve(right: Array) -> Array:
            u = inner.solve(right[:n] - self.reduced(right[n:]))
            return np.concatenate([u, self.recovered(u, right[n:])])

        return Factors(solve, lambda: inner.negatives)


@dataclass(frozen=True)
class Joined:
    """K whose own unknowns of points depend on those of others: all of it is factorised at once.

    In the form of a matrix over other orders of the unknowns; the border comes last there.
    """

    inner: csc_matrix | Bordered
    order: Index  # numbers in K of the unknowns of ``inner``

    @classmethod
    def of(
        cls, matrix: csc_matrix | Bordered, on_forces: Any, by_others: Any, own: Any, pull: Array
    ) -> Joined:
        """Return [[A, B], [C, D]] from A, B, C and D, where A may have a border.

        ``pull`` is the row of the own unknowns in the last row of the border, shape (own,).
        """
        bordered = isinstance(matrix, Bordered)
        inner = matrix.inner if isinstance(matrix, Bordered) else matrix
        whole = csc_matrix(bmat([[inner, on_forces], [by_others, own]]))
        n, m, others = inner.shape[0], own.shape[0], matrix.shape[0] - inner.shape[0]
        order = np.concatenate([np.arange(n), n + others + np.arange(m), n + np.arange(others)])
        if not bordered:
            return cls(whole, order)
        columns = csc_matrix(vstack([csc_matrix(matrix.columns), csc_matrix((m, others))]))
        last = csr_matrix((others - 1, m)), csr_matrix(pull[None])
        rows = csr_matrix(hstack([csr_matrix(matrix.rows), vstack(last)]))
        return cls(Bordered(whole, columns, rows, matrix.corner), order)

    def factorised(self, factorise: Callable[[Any], Factors]) -> Factors:
        """Return factors of K from those of the ordered matrix, by the sparse LU.

        Chains along the strip fill little; a band would be as wide as all of an element's own
        unknowns: 0.15 s instead of 0.9 s for 13 000 unknowns.
        """
        del factorise

        def sparse(matrix: csc_matrix) -> Factors:
            return SuperLUPlan(matrix).factorise(matrix)

        bordered = isinstance(self.inner, Bordered)
        inner = self.inner.factorised(sparse) if bordered else sparse(self.inner)

        def solve(right: Array) -> Array:
            x = np.empty_like(right)
            x[self.order] = inner.solve(right[self.order])
            return x

        return Factors(solve, lambda: inner.negatives)
