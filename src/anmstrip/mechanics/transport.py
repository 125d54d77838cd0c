"""Strip that moves through its own shape: friction and velocities of a stationary state.

Labels X stay where they are in space, and material passes them at c (m of unstressed strip per
second), so that a state r(X, Y) that does not change moves with v = c ∂r/∂X.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from anmstrip.arrays import Array
from anmstrip.fem.operators import Blocks, CellOperator, Part, Pattern
from anmstrip.fem.sampling import SlopeOperator, l2_projection
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.contact import transform
from anmstrip.mechanics.roller import Projection
from anmstrip.mechanics.turning import SurfaceOperator, TurningFriction


class TransportOperator(SurfaceOperator):
    """Displacements, their derivatives along X, speeds of free surfaces, and the strip's own.

    The last of these counts from the control; forces come out as of a
    :class:`~anmstrip.mechanics.turning.SurfaceOperator`.
    """

    contact: SlopeOperator

    @property
    def matrices(self) -> tuple[list[Part], list[Part]]:
        """L as sparse matrices, and that of which forces are the transposed."""
        inputs, outputs = super().matrices
        *_, surface = inputs
        ones = csr_matrix(np.ones((self.points, 1)))
        return [*inputs, Part(ones, self.weights, self.end, row=surface.row + 1)], outputs

    @property
    def end(self) -> int:
        """Number of the unknown after the free surfaces: the strip's own speed."""
        return self.contact.matrix.shape[1] * self.contact.count + self.surface.shape[1]

    def apply(self, full: Array) -> Array:
        """Values at the points, shape (2 count + 2, points)."""
        strip = self.contact.apply(full).reshape(-1, self.points)
        speed = np.full(self.points, full[self.end])
        return np.vstack([strip, self.surface @ self._turned(full), speed])

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L, J[j, i] of shape (2 count + 2, count + 1, points)."""
        *_, by_surface, by_speed = derivative
        by_strip = derivative[:-2].reshape(2, self.contact.count, *derivative.shape[1:])
        self.contact.add_tangent(by_strip[:, :, :-1], pattern, blocks)
        blocks.columns[:, -1] += self.contact.gather(by_speed[:-1])
        rollers, (on_value, on_slope) = np.arange(self.surface.shape[1]), by_strip[:, :, -1]
        values, slopes = self.contact.transposed, self.contact.slopes.T
        blocks.columns[:, rollers] += self._by_surface(values, by_surface[:-1])
        blocks.rows[rollers] += self._by_surface(values, on_value).T
        blocks.rows[rollers] += self._by_surface(slopes, on_slope).T
        blocks.corner[rollers, rollers] += self.surface.T @ (by_surface[-1] * self.weights)
        blocks.corner[rollers, -1] += self.surface.T @ (by_speed[-1] * self.weights)


@dataclass(frozen=True)
class SteadyFriction(TurningFriction):
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

    @cached_property
    def operator(self) -> TransportOperator:  # type: ignore[override]
        """Operator to the points of the contact, and to the surfaces that they see."""
        assert self.slopes is not None
        slopes, which = self.slopes.restricted(self.contact.operator.chosen), self.roller.which
        which = np.zeros(slopes.points, dtype=np.int64) if which is None else which
        return TransportOperator(slopes, np.array(self.numbers)[which], self.rollers)

    def sliding(self, x: Any, v: Any, controls: Mapping[str, Any]) -> tuple[Projection, Any, Any]:
        """Return where the points are on the roller, its tangents there, and their slip.

        Parameters
        ----------
        x : array or Series, shape (2 components + 2, points)
        v : None
        controls : mapping
        """
        count = self.contact.kinematics.count
        place = self.contact.seen(x[:count], controls)
        tangents = self.tangents(place)
        flat = self.contact.kinematics.pick([1.0, 0.0, 0.0])[:, None]
        along = transform(self.view, x[count : 2 * count] + flat)
        parts = np.einsum("ki...,i...->k...", tangents, along)
        length = np.sqrt(along[0] * along[0] + along[1] * along[1])
        forward = np.where(parts[0] > 0.0, length, -length)
        stretched = np.stack([forward, *(parts[k] for k in range(1, len(self.frame) - 1))])
        turned = self.turned(place) * (x[-2] * self.roller.sense)
        surface = self.surface(place, controls) + turned
        return place, tangents, stretched * (x[-1] + controls["strip.speed"]) - surface


def transport_velocity(strip: Strip, pattern: Pattern, full: Array, speed: float) -> Array:
    """Velocity c ∂r/∂X of a stationary state, on the strip's functions, (unknowns of the strip,).

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
