"""Shells that other programs are asked to bend far, and how their load grows.

A shell is an image of the unit square: ``across`` runs along the edge that is loaded, ``along``
from there to the opposite one.  Full loads and units are those of
:mod:`anmstrip.studies.benchmarks`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from anmstrip.studies.benchmarks import (
    GRADING,
    ROOF_ANGLE,
    ROOF_HALF_LENGTH,
    ROOF_LOAD,
    ROOF_RADIUS,
)
from anmstrip.studies.riks import RiksSettings

Array = NDArray[np.float64]

FIRST, GROWTH, SMALLEST = 0.0125, 1.5, 1e-4
"""Shares of the full load: first step, ratio of a step to an easy one before it, smallest step."""

WANTED, MOST = 8, 20
"""Newton iterations of an easy step, and after which a step is given up and halved."""

TOLERANCE = 1e-4
"""Of the imbalance over the load, as in the rest of the study."""


ALONG = RiksSettings(tolerance=TOLERANCE, longest=0.25)
"""Of paths that snap; with steps short enough to read limit points off them."""


@dataclass(frozen=True)
class Plate:
    """A shell that is flat, or a part of a cylinder along x, rolled out.

    Attributes
    ----------
    place : callable
        (across, along) in the unit square → x, y of the flat shell.
    width : float
        Of the loaded edge, along = 0.
    pull : float
        Dead force along z per length of that edge.
    young, thickness : float
    readings : callable
        Displacements of the loaded edge's corners, shape (2, 3) → those that the table lists.
    moment : float
        Per length of that edge; lifts it.
    held : dict
        Side → what is held there, of displacements ``xyz`` and rotations ``XYZ``.
    radius : float
        Of the cylinder.
    force : float
        Along z, at the corner across = along = 0.
    poisson : float
    end, depth : float
        Share of the full load to go to under that force, and how deep it then is.
    """

    place: Callable[[Array, Array], tuple[Array, Array]]
    width: float
    pull: float
    young: float
    thickness: float
    readings: Callable[[Array], Array]
    moment: float = 0.0
    held: Mapping[str, str] = field(default_factory=lambda: {"top": "xyzXYZ"})
    radius: float = np.inf
    force: float = 0.0
    poisson: float = 0.0
    end: float = 1.0
    depth: float = 0.0

    def sides(self, held: str) -> list[str]:
        """Sides where one of these is held."""
        return [side for side, what in self.held.items() if set(held) & set(what)]

    def in_space(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Points of the shell, of those of the flat one."""
        if np.isinf(self.radius):
            return x, y, 0.0 * y
        angle = y / self.radius
        return x, self.radius * np.sin(angle), self.radius * np.cos(angle)


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


def _roof(thickness: float, end: float, depth: float) -> Plate:
    """A quarter: middle at across = along = 0, hinged along the top, free at the right."""
    held = {"top": "xyz", "left": "xYZ", "bottom": "yXZ"}
    return Plate(
        lambda across, along: (
            ROOF_HALF_LENGTH * across**GRADING, ROOF_RADIUS * ROOF_ANGLE * along**GRADING
        ),
        ROOF_HALF_LENGTH, 0.0, 3102.75, thickness, lambda tip: -tip[:1, 2], held=held,
        radius=ROOF_RADIUS, force=-0.25 * ROOF_LOAD, poisson=0.3, end=end,
        depth=depth,
    )  # fmt: skip


PLATES = {
    "end moment": Plate(
        lambda across, along: (12.0 * (1.0 - along), across - 0.5),
        1.0, 0.0, 1.2e6, 0.1, lambda tip: tip[:, [0, 2]].mean(axis=0) * [-1.0, 1.0],
        moment=2.0 * np.pi * 100.0 / 12.0,
    ),
    "hinged roof, t = 12.7": _roof(12.7, 1.0835, 29.0),
    "hinged roof, t = 6.35": _roof(6.35, 1.0313, 38.0),
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


def limits(loads: Sequence[float], readings: Sequence[float]) -> list[float]:
    """Loads at both limit points of a path that snaps, by a spline along it."""
    path = np.array([loads, readings])
    arcs = np.linalg.norm(np.diff(path / np.ptp(path, axis=1)[:, None], axis=1), axis=0)
    spline = CubicSpline(np.concatenate([[0.0], np.cumsum(arcs)]), path[0])
    turns = spline.derivative().roots(extrapolate=False)
    return [float(load) for load in spline(turns[:2])]


def ramped(advance: Callable[[float], tuple[bool, int]], longest: float = 1.0) -> tuple[int, int]:
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
            step = min(step * (GROWTH if spent <= WANTED else 1.0), longest)
        else:
            step *= 0.5
        if step < SMALLEST:
            raise RuntimeError(f"Newton's method does not converge beyond {load:.3f} of the load")
    return steps, solves
