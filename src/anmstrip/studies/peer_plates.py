"""Two flat shells that other programs are asked to bend far, and how their load grows.

A plate is an image of the unit square: ``across`` runs along the edge that is pulled, ``along``
from there to the clamped edge.  Full loads and units are those of
:mod:`anmstrip.studies.benchmarks`; Poisson's ratio is zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIRST, GROWTH, SMALLEST = 0.0125, 1.5, 1e-4
"""Shares of the full load: first step, ratio of a step to an easy one before it, smallest step."""

WANTED, MOST = 8, 20
"""Newton iterations of an easy step, and after which a step is given up and halved."""

TOLERANCE = 1e-4
"""Of the imbalance over the load, as in the rest of the study."""


@dataclass(frozen=True)
class Plate:
    """A flat shell, clamped along one edge and pulled at the opposite one.

    Attributes
    ----------
    place : callable
        (across, along) in the unit square → x, y.
    width : float
        Of the pulled edge.
    pull : float
        Dead force along z per length of that edge.
    young, thickness : float
    readings : callable
        Displacements of the pulled edge's corners, shape (2, 3) → those that the table lists.
    """

    place: Callable[[Array, Array], tuple[Array, Array]]
    width: float
    pull: float
    young: float
    thickness: float
    readings: Callable[[Array], Array]


@dataclass(frozen=True)
class Bent:
    """What a program found at full load.

    Attributes
    ----------
    readings : list of float
        Displacements, in the order of the published table.
    steps : int
        Of load.
    solves : int
        Tangents factorised, those of steps given up too.
    unknowns : int
        Of the linear systems.
    seconds : float
        Of the processor, from the flat shell to full load.
    """

    readings: list[float]
    steps: int
    solves: int
    unknowns: int
    seconds: float


PLATES = {
    "end shear": Plate(
        lambda across, along: (10.0 * (1.0 - along), across - 0.5),
        1.0, 4.0, 1.2e6, 0.1, lambda tip: tip[:, [0, 2]].mean(axis=0) * [-1.0, 1.0],
    ),
    "slit annular plate": Plate(
        lambda across, along: (
            (6.0 + 4.0 * across) * np.cos(2.0 * np.pi * along),
            (6.0 + 4.0 * across) * np.sin(2.0 * np.pi * along),
        ),
        4.0, 0.8, 21e6, 0.03, lambda tip: tip[:, 2],
    ),
}  # fmt: skip
"""By the benchmark's name."""


def ramped(advance: Callable[[float], tuple[bool, int]]) -> tuple[int, int]:
    """Take the load to its full value; steps, and tangents that they took.

    ``advance`` goes to a share of the load and says whether it came there, and with how many
    tangents; if it did not, it is back where it was.
    """
    load, step, steps, solves = 0.0, FIRST, 0, 0
    while load < 1.0:
        there, spent = advance(min(1.0, load + step))
        solves += spent
        if there:
            load, steps = min(1.0, load + step), steps + 1
            step *= GROWTH if spent <= WANTED else 1.0
        else:
            step *= 0.5
        if step < SMALLEST:
            raise RuntimeError(f"Newton's method does not converge beyond {load:.3f} of the load")
    return steps, solves
