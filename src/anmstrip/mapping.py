"""Curved references from plain functions: the series give their derivatives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .mechanics.surfaces import Jet, Surface
from .series.power_series import taylor

Array = NDArray[np.float64]


def mapped(function: Callable[[Any, Any], Any]) -> Surface:
    """A reference surface R(x, y).

    Parameters
    ----------
    function : callable
        ``function(x, y)`` of arrays (points,) → R, (3, points), written in numpy.

    Examples
    --------
    >>> cylinder = mapped(lambda x, y: np.stack([x, 2.0 * np.sin(y), 2.0 * np.cos(y)]))
    >>> float(cylinder(np.zeros((2, 1))).seconds[2, 1, 1, 0])
    -2.0
    """

    def jet(points: Array) -> Jet:
        along, across, both = (_taylor(function, points, d) for d in ((1, 0), (0, 1), (1, 1)))
        mixed = both[2] - along[2] - across[2]
        seconds = np.stack([[2.0 * along[2], mixed], [mixed, 2.0 * across[2]]])
        tangents = np.stack([along[1], across[1]], axis=1)
        return Jet(along[0], tangents, seconds.transpose(2, 0, 1, 3))

    return jet


def _taylor(function: Any, points: Array, direction: tuple[int, int]) -> Array:
    """Orders 0, 1, 2 along a direction of the plane, shape (3, 3, points)."""
    lines = [[p, d + 0.0 * p, 0.0 * p] for p, d in zip(points, direction, strict=True)]
    return taylor(function, *lines)
