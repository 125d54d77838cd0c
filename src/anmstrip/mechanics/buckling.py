"""Linear buckling of a strip under tension: how far its compression is from making wrinkles.

The compressive principal membrane forces N⁻ of a state take the stiffness

    G = −∫ N⁻_ab φ,a · φ,b ≥ 0

off its tangent K.  With K + G, the tangent of the same state were it not compressed, the strip
buckles when the compression, with everything else as it is, has grown by the least factor μ of

    (K + G) φ = μ G φ.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, eigsh

from .cells import Pattern
from .membrane import Membrane, principal

Array = NDArray[np.float64]


class Solver(Protocol):
    """Factorises once, solves many times."""

    def factorise(self, matrix: csc_matrix) -> Factorised:
        """Factors of a matrix."""


class Factorised(Protocol):
    """A factorised matrix."""

    def solve(self, right: Array) -> Array:
        """Solution of K x = right."""


def compressive_stiffness(membrane: Membrane, full: Array, pattern: Pattern) -> Array:
    """Blocks of G, see :class:`~anmstrip.mechanics.cells.Pattern`."""
    values, vectors = principal(membrane.at(full))
    part = np.einsum("pak,pk,pbk->abp", vectors, -np.minimum(values, 0.0), vectors)
    m, blocks = pattern.count, pattern.zeros()
    derivative = np.einsum("ij,bap->jbiap", np.eye(m), part)
    membrane.operator.add_tangent(derivative, pattern, blocks)
    return blocks


def buckling_modes(
    tangent: csc_matrix, compressive: csc_matrix, solver: Solver, count: int
) -> tuple[Array, Array]:
    """The lowest factors μ, ascending, and modes φ in columns.

    Parameters
    ----------
    tangent, compressive : csc_matrix, shape (n, n)
        K and G.
    solver : Solver
    count : int
        Number of modes.
    """
    spared = (tangent + compressive).tocsc()
    spared.sort_indices()
    inverse = LinearOperator(spared.shape, matvec=solver.factorise(spared).solve)
    start = np.cos(np.arange(1.0, spared.shape[0] + 1.0) ** 2)
    found = eigsh(compressive, count, spared, which="LA", Minv=inverse, v0=inverse @ start)
    order = np.argsort(found[0])[::-1]
    with np.errstate(divide="ignore"):
        return 1.0 / found[0][order], found[1][:, order]
