"""Strip that moves through its own shape: friction and velocities of a stationary state.

Labels X stay where they are in space, and material passes them at c (m of unstressed strip per
second), so that a state r(X, Y) that does not change moves with v = c ∂r/∂X.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.fem.operators import CellOperator, Pattern
from anmstrip.fem.sampling import SlopeOperator, l2_projection
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.contact import Friction, transform
from anmstrip.mechanics.roller import Projection

SPEED = "strip.speed"
"""Control: c (m/s)."""


@dataclass(frozen=True)
class SteadyFriction(Friction):
    """Friction on strip that moves through its own shape: no velocity is unknown.

    The slip is √(|v|² − (v·a)²) − V ρ/r along the strip, with the roller's axis a, its surface
    speed V and its profile ρ/r; v·m along the meridian m.  A strip that bends onto a roller
    meets it at an angle α ~ √(D/T)/r: with v·t along the roller's tangent t it would seem to slip
    by −c α²/2, which is a thousand times the elastic creep.  Control besides those of friction:
    ``strip.speed`` c (m/s).

    Attributes
    ----------
    slopes : SlopeOperator
        At all points of the strip.
    """

    slopes: SlopeOperator | None = None

    rate_dependent = False

    @property
    def operator(self) -> SlopeOperator:  # type: ignore[override]
        """Values and slopes at the points of the contact."""
        assert self.slopes is not None
        return self.slopes.restricted(self.contact.operator.chosen)

    def sliding(self, x: Any, v: Any, controls: Mapping[str, Any]) -> tuple[Projection, Any, Any]:
        """Return where the points are on the roller, its tangents there, and their slip.

        Parameters
        ----------
        x : array or Series, shape (2, components, points)
            Displacements and their derivatives along X.
        v : None
        controls : mapping
        """
        place = self.contact.seen(x[0], controls)
        tangents = self.tangents(place)
        flat = self.contact.kinematics.pick([1.0, 0.0, 0.0])[:, None]
        along = transform(self.view, x[1] + flat)
        parts = np.einsum("ki...,i...->k...", tangents, along)
        length = np.sqrt(along[0] * along[0] + along[1] * along[1])
        forward = np.where(parts[0] > 0.0, length, -length)
        stretched = np.stack([forward, *(parts[k] for k in range(1, len(self.frame) - 1))])
        return place, tangents, stretched * controls[SPEED] - self.surface(place, controls)


def transport_velocity(strip: Strip, pattern: Pattern, full: Array, speed: float) -> Array:
    """Velocity c ∂r/∂X of a stationary state, on the strip's own functions, (unknowns,).

    Parameters
    ----------
    strip : Strip
    pattern : Pattern
    full : ndarray, shape (unknowns,)
        Displacements.
    speed : float
        c (m of unstressed strip per second).
    """
    tangents = strip.frames().tangents + CellOperator(strip, [1]).apply(full)
    return speed * l2_projection(strip, pattern, strip.kinematics.embed(tangents[:, 0]))


def strip_speed(strip: Strip, full: Array, velocity: Array) -> float:
    """Mean of v · r,X / |r,X|² over the nodes (m/s), that of v = c ∂r/∂X if it is so."""
    along = strip.nodal(full)[strip.dofs("u_x")]
    along = along + strip.kinematics.pick([1.0, 0.0, 0.0])
    v = strip.nodal(velocity)[strip.node_values]
    return float(((v * along).sum(axis=1) / (along * along).sum(axis=1)).mean())
