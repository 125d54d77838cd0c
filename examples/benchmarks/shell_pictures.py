"""Shapes and modes of shells as VTK files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anmstrip.equilibrium import Equilibrium
from anmstrip.results.fields import FieldSampler
from anmstrip.results.vtk import write_surface

Array = NDArray[np.float64]


def write_shape(
    path: str | Path, equations: Equilibrium, u: Array, modes: Mapping[str, Array] | None = None
) -> None:
    """Write a deformed shell with its displacement, and modes as further vectors.

    Parameters
    ----------
    path : path
        The `.vtu` file.
    equations : Equilibrium
    u : ndarray, shape (free,)
    modes : mapping of str to ndarray, shape (free,), optional
        Directions, such as :attr:`anmstrip.continuation.bifurcations.SingularPoint.mode`.
    """
    surface = FieldSampler(equations.model.strip, None, None)
    supports = equations.supports
    moved = surface.interpolate(supports.full(u, 0.0))
    fields = {"displacement": moved} | {
        name: surface.interpolate(supports.change(mode, 0.0))
        for name, mode in (modes or {}).items()
    }
    write_surface(path, surface.reference.T + moved, surface.cells, fields)
