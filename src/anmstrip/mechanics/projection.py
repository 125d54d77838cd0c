"""Fields on the strip's own functions: best fit in the mean square."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from .cells import Pattern, jets
from .strip import Strip

Array = NDArray[np.float64]


def quadrature_points(strip: Strip) -> Array:
    """Reference positions of the quadrature points, shape (3, points)."""
    points = np.asarray(strip.basis.mapping.F(strip.basis.X))
    return strip.in_space(points.reshape(len(points), -1))


def projected(strip: Strip, pattern: Pattern, displacement: Array) -> Array:
    """Unknowns whose displacement is nearest to a given one.

    Parameters
    ----------
    displacement : ndarray, shape (3, points)
        At the quadrature points (m); components that are not unknown are left out.

    Returns
    -------
    ndarray, shape (unknowns,)
    """
    operator = jets(strip)
    stress = np.zeros((strip.count, operator.components, operator.points))
    stress[:, 0] = strip.kinematics.pick(displacement.T).T
    values = np.zeros((operator.components, operator.components))
    values[0, 0] = 1.0
    block = np.zeros(pattern.couplings)
    operator.add_bilinear(values, pattern, block)
    units = strip.dof_lengths
    scaled = block * units[pattern.row] * units[pattern.column]
    right = operator.gather(stress).reshape(-1, strip.count) * units[:, None]
    return np.ravel(splu(pattern.scalar_matrix(scaled)).solve(right) * units[:, None])
