"""Rollers that turn as the strip, a torque and their bearings have it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from anmstrip.arrays import Array, Index
from anmstrip.fem.operators import Blocks, Part, Pattern
from anmstrip.fem.sampling import ContactOperator
from anmstrip.mechanics.contact import Friction
from anmstrip.mechanics.effects import LawEffect
from anmstrip.mechanics.roller import Projection, at_points

DRIVEN = -1
"""Number of a roller that does not turn freely."""


class SurfaceOperator:
    """Values at contact points of the strip and of the surfaces of rollers that turn freely.

    The last component is that of the surface which a point sees: a travel (m) or a speed (m/s),
    zero on driven rollers.

    Parameters
    ----------
    contact : ContactOperator
    which : ndarray of int, shape (points,)
        Number of the free roller that each point sees, or ``DRIVEN``.
    rollers : int
        Number of free rollers, which are the last unknowns.
    """

    def __init__(self, contact: ContactOperator, which: Index, rollers: int) -> None:
        self.contact = contact
        self.which, points = which, np.flatnonzero(which != DRIVEN)
        index, shape = (points, which[points]), (contact.points, rollers)
        self.surface = csr_matrix((np.ones(len(points)), index), shape=shape)

    @property
    def points(self) -> int:
        """Number of points."""
        return self.contact.points

    @property
    def weights(self) -> Array:
        """Area that belongs to each point (m²)."""
        return self.contact.weights

    @property
    def chosen(self) -> Index:
        """Numbers of the points in the whole strip."""
        return self.contact.chosen

    @property
    def matrices(self) -> tuple[list[Part], list[Part]]:
        """L as sparse matrices, and that of which forces are the transposed."""
        found = self.contact.matrices
        begin = self.contact.matrix.shape[1] * self.contact.count
        inputs, outputs = (
            [*own, Part(self.surface, self.weights, begin, row=sum(part.count for part in own))]
            for own in found
        )
        return inputs, outputs

    def apply(self, full: Array) -> Array:
        """Values of the strip and of the surface, shape (count + 1, points)."""
        return np.vstack([self.contact.apply(full), self.surface @ self._turned(full)])

    def _turned(self, full: Array) -> Array:
        """Unknowns of the free rollers, which follow those of the strip."""
        begin = self.contact.matrix.shape[1] * self.contact.count
        return full[begin : begin + self.surface.shape[1]]

    def gather(self, forces: Array) -> Array:
        """Generalised forces of forces per area, (count + 1, points) → (unknowns,)."""
        on_rollers = self.surface.T @ (forces[-1] * self.weights)
        return np.concatenate([self.contact.gather(forces[:-1]), on_rollers])

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L, J[j, i] of shape (count + 1, count + 1, points)."""
        self.contact.add_tangent(derivative[:-1, :-1], pattern, blocks)
        values, rollers = self.contact.matrix, blocks.strip + np.arange(self.surface.shape[1])
        self._couple(blocks, values, derivative[-1, :-1])
        self._couple(blocks, values, derivative[:-1, -1], on_rollers=True)
        blocks.add(rollers, rollers, self.surface.T @ (derivative[-1, -1] * self.weights))

    def _couple(
        self, blocks: Blocks, matrix: csr_matrix, forces: Array, on_rollers: bool = False
    ) -> None:
        """Add forces on the strip by the travels of rollers, or on rollers by the strip's unknowns.

        Parameters
        ----------
        blocks : Blocks
        matrix : csr_matrix, shape (points, scalars)
            By which forces are gathered.
        forces : ndarray, shape (count, points)
            Per area.
        on_rollers : bool
        """
        point = np.repeat(np.arange(self.points), np.diff(matrix.indptr))
        on = self.which[point] != DRIVEN
        point, scalar, share = point[on], matrix.indices[on], matrix.data[on]
        count = len(forces)
        unknowns = count * scalar.astype(np.int64) + np.arange(count)[:, None]
        rollers = np.broadcast_to(blocks.strip + self.which[point], unknowns.shape)
        rows, columns = (rollers, unknowns) if on_rollers else (unknowns, rollers)
        blocks.add(rows, columns, share * (forces * self.weights)[:, point])


@dataclass(frozen=True)
class TurningFriction(Friction):
    """Friction on rollers of which some turn freely.

    The residual has one more component, which does work with the travel of a free roller's
    surface: the traction along it times the share of its radius, so that its integral is the
    moment of friction over the nominal radius.

    Attributes
    ----------
    numbers : sequence of int
        Number of each roller's unknown, or ``DRIVEN``.
    rollers : int
        How many rollers turn freely.
    """

    numbers: Sequence[int] = ()
    rollers: int = 0

    @cached_property
    def operator(self) -> SurfaceOperator:  # type: ignore[override]
        """Operator to the strip and the surfaces."""
        contact = self.contact.operator
        which = np.array(self.numbers)[self.roller.seen_by(contact.points)]
        return SurfaceOperator(contact, which, self.rollers)

    @cached_property
    def by_roller(self) -> dict[str, Friction]:
        """Roller → its own friction, at all points of the strip."""
        parts: Any = super().by_roller.items()
        pairs = zip(parts, self.numbers, strict=True)
        return {name: replace(part, numbers=(number,)) for (name, part), number in pairs}

    def slip(self, place: Any, tangents: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Tangential velocity relative to the surface (m/s), (components of slip, points)."""
        own = super().slip(place, tangents, v[:-1], controls)
        return own - self.turned(place) * (v[-1] * self.roller.sense)

    def sliding(self, x: Any, v: Any, controls: Mapping[str, Any]) -> tuple[Projection, Any, Any]:
        """Return where the points are on the roller, its tangents there, and their slip."""
        place = self.contact.seen(x[:-1], controls)
        tangents = self.tangents(place)
        return place, tangents, self.slip(place, tangents, v, controls)

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Residual per area of the strip and of the surface, (components + 1, points)."""
        place, tangents, slip = self.sliding(x, v, controls)
        traction = self.acting(self.contact.pressure(place), slip)
        turned = traction[0] if place.ratio is None else place.ratio * traction[0]
        return np.stack([*self.on_strip(tangents, traction), turned * self.roller.sense])


@dataclass(frozen=True)
class Drives(LawEffect):
    """Torques of the drives and drag of the bearings of rollers that turn freely, over the radius.

    The drag M V/√(V² + V_b²) opposes the surface speed V with the torque M, but for speeds about
    V_b, and has a slope at rest.  Controls: ``rollers.NAME.torque`` (N m, in the sense of V).

    Attributes
    ----------
    names : sequence of str
    radii : ndarray, shape (rollers,)
        m.
    bearings : ndarray, shape (rollers,)
        M (N m).
    speed : float
        V_b (m/s).
    unknowns : int
        Those of the strip, before those of the rollers.
    """

    names: Sequence[str]
    radii: Array
    bearings: Array
    speed: float
    unknowns: int

    name = "drives"
    rate_dependent = True

    @property
    def operator(self) -> Drives:  # type: ignore[override]
        """The rollers are their own points."""
        return self

    @property
    def points(self) -> int:  # type: ignore[override]
        """Number of rollers."""
        return len(self.names)

    @cached_property
    def matrices(self) -> tuple[list[Part], list[Part]]:
        """L as sparse matrices, and that of which forces are the transposed."""
        parts = [Part(csr_matrix(np.eye(self.points)), np.ones(self.points), self.unknowns)]
        return parts, parts

    def apply(self, full: Array) -> Array:
        """Values of the rollers, shape (1, rollers)."""
        return full[None, self.unknowns : self.unknowns + len(self.names)]

    def gather(self, forces: Array) -> Array:
        """Generalised forces, (1, rollers) → (unknowns,)."""
        return np.concatenate([np.zeros(self.unknowns), forces[0]])

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add J of shape (1, 1, rollers) to the corner."""
        places = np.arange(len(self.names))
        blocks.add(blocks.strip + places, blocks.strip + places, derivative[0, 0])

    def smoothed(self, width: float) -> Drives:
        """Return the same with V_b so many times as large."""
        return replace(self, speed=width * self.speed)

    def sharper(self, share: float) -> Drives:
        """Return the same with V_b smaller by a share."""
        return self.smoothed(1.0 - share)

    def drag(self, speeds: Any) -> Any:
        """Torque (N m) with which bearings brake, positive against positive speeds, (rollers,)."""
        return speeds / np.sqrt(speeds * speeds + self.speed**2) * self.bearings

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Drag less torque, over the radius (N), shape (1, rollers)."""
        given = [controls[f"rollers.{name}.torque"] for name in self.names]
        torque = at_points(given, np.arange(len(given)))
        return np.stack([(self.drag(v[0]) - torque) / self.radii])


@dataclass(frozen=True)
class SteadyDrives(Drives):
    """The same in a stationary state, where the speeds are unknowns themselves."""

    rate_dependent = False

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Drag less torque, over the radius (N), shape (1, rollers)."""
        return super().law(x, x, controls)
