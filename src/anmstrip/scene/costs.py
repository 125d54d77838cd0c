"""What an expansion costs, from counts, and the order of the series that this makes the cheapest.

A branch reaches as far as its last term stays below the tolerance, a ~ ε^(1/(N+1)); so an order
more reaches further, and costs a back-substitution and a longer recurrence more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from anmstrip.mechanics.kinematics import PLATE, SECTION, Kinematics

if TYPE_CHECKING:
    from anmstrip.scene.build import Assembly

ORDERS = range(6, 41)
"""Orders to choose from."""


@dataclass(frozen=True)
class Size:
    """Counts of a level, and the seconds that they stand for.

    The shares per count were measured on one core, from 200 to 40 000 unknowns and orders from 5
    to 40 (``anmstrip study solvers``, ``study order``); they matter for ratios only.

    Attributes
    ----------
    unknowns : int
    points : int
        Of quadrature and of contact.
    values : int
        Series that are followed at these points.
    band : int
        Half bandwidth of the tangent.
    """

    unknowns: int
    points: int
    values: int
    band: int

    def seconds(self, order: int) -> float:
        """Calls; series of all values, and the tangent; factorisation; back-substitutions."""
        calls = 3e-3 + 2e-4 * order
        series = (8e-7 + 3.5e-8 * order + 1e-9 * order**2) * self.values
        factorisation = (2e-6 + 3e-8 * self.band) * self.unknowns
        solves = (1e-7 + 1e-9 * self.band) * self.unknowns * order
        return calls + series + factorisation + solves


def cheapest_order(size: Size, tolerance: float) -> int:
    """Order with the least seconds per length of path."""
    return min(ORDERS, key=lambda n: size.seconds(n) * tolerance ** (-1.0 / (n + 1)))


def size_of(assembly: Assembly, level: Kinematics) -> Size | None:
    """Counts of a level on the scene's own lines of nodes; None where it cannot have its mesh."""
    strip, spec = assembly.strip, assembly.scene.strip
    lines = len(np.unique(np.round(strip.mesh.p[0] / strip.length, 9)))
    if level is SECTION:
        if spec.mesh is not None:
            return None
        scalars, quadrature, touched = 2 * lines, 4 * (lines - 1), 2 * lines - 1
    elif assembly.kinematics is not SECTION:
        scalars, quadrature = strip.scalars, strip.basis.dx.size
        touched = 4 * strip.mesh.nelements
    else:
        assert spec.cells is not None
        across = spec.cells[1]
        scalars, quadrature = 4 * lines * (across + 1), 16 * (lines - 1) * across
        touched = (2 * lines - 1) * (2 * across + 1)
    rubbed = 2 if assembly.scene.friction is not None and level is not PLATE else 1
    touched *= 0 if assembly.scene.contact is None or not assembly.rollers else rubbed
    m, per_line = level.count, scalars / lines
    values = m * (level.directions * quadrature + touched)
    band = int(m * (per_line + 8))
    return Size(m * scalars, quadrature + touched, values, band)
