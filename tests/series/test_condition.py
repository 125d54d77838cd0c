"""The estimate of a condition number."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csc_matrix, diags_array

from anmstrip.linalg.solvers import SparseSolver, equilibrated
from anmstrip.series.condition import condition


@pytest.mark.parametrize("skew", [0.0, 0.3])
@pytest.mark.parametrize("shift", [1.0, 1e-3, 1e-9])
def test_estimate_is_close_and_never_above(shift: float, skew: float) -> None:
    """A chain of springs, nearly loose at small shifts, in mixed units; with friction, skew."""
    n = 60
    bands = [np.full(n - 1, -1.0 - skew), np.full(n, 2.0 + shift), np.full(n - 1, -1.0 + skew)]
    matrix = diags_array(bands, offsets=[-1, 0, 1]).toarray()
    matrix[0, 0] = matrix[-1, -1] = 1.0 + shift
    units = 10.0 ** np.random.default_rng(0).uniform(-4, 4, n)
    scaled = csc_matrix(units * matrix * units[:, None])
    found = condition(scaled, SparseSolver().factorise(scaled))
    d = equilibrated(scaled)
    exact = np.linalg.cond(d * scaled.toarray() * d[:, None], 1)
    assert 0.1 * exact <= found <= exact * (1.0 + 1e-6)
