"""The same points on every element, shared between neighbours: for contact and pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem.element import DiscreteField

from .strip import Strip

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Patches:
    """The same points on every element, shared between neighbours.

    Attributes
    ----------
    cells : ndarray of int, shape (elements, points of one)
        Numbers of each element's points.
    reference : ndarray, shape (3, points)
        Reference positions.
    functions : list of DiscreteField
        Every basis function there, each (elements, points of one).
    """

    cells: Index
    reference: Array
    functions: list[DiscreteField]


def shape_of(strip: Strip) -> str:
    """Kind of the elements: line, quad or triangle."""
    return {2: "line", 3: "triangle", 4: "quad"}[len(strip.mesh.t)]


def patches(strip: Strip, local: Array) -> Patches:
    """Points of all elements from those of the reference element, (dimensions, points)."""
    basis = strip.basis
    cells, points = joined(basis.mapping.F(local), strip)
    functions = [basis.elem.gbasis(basis.mapping, local, i)[0] for i in range(basis.Nbfun)]
    return Patches(cells, strip.in_space(points), functions)


def unit_grid(n: int, dimensions: int = 2) -> Array:
    """Grid of the unit interval or square, number i + n j, shape (dimensions, n^dimensions)."""
    steps = np.linspace(0.0, 1.0, n)
    return np.stack([x.ravel() for x in np.meshgrid(*dimensions * [steps])])


def joined(grid: Array, strip: Strip) -> tuple[Index, Array]:
    """Number the points of element grids so that neighbours share them.

    Parameters
    ----------
    grid : ndarray, shape (dimensions, elements, points of one)
    strip : Strip

    Returns
    -------
    cells : ndarray of int, shape (elements, points of one)
    points : ndarray, shape (dimensions, points)
    """
    unit = 1e-6 * strip.cell_sizes.min()
    flat = grid.reshape(len(grid), -1)
    keys = np.round((flat - flat.min(axis=1)[:, None]) / unit).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=1, return_index=True, return_inverse=True)
    return inverse.reshape(grid.shape[1:]), flat[:, first]
