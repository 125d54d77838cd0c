"""Strip that moves through its own shape: material passes labels that stay where they are.

At c (m of unstressed strip per second) it moves with v = ∂r/∂t + c ∂r/∂X (an arbitrary
Lagrangian-Eulerian description: Donea, Huerta, Ponthot & Rodríguez-Ferran, Encyclopedia of
Computational Mechanics, chapter 14, 2004), in a stationary state r(X, Y) with v = c ∂r/∂X.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from anmstrip.arrays import Array
from anmstrip.fem.operators import Blocks, CellOperator, Part, Pattern
from anmstrip.fem.sampling import SlopeOperator, l2_projection
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.contact import control_of, transform
from anmstrip.mechanics.effects import LawEffect
from anmstrip.mechanics.roller import Projection
from anmstrip.mechanics.turning import SurfaceOperator, TurningFriction


class TransportOperator(SurfaceOperator):
    """Displacements, their derivatives along X, speeds of free surfaces, and the strip's own.

    The last of these is the unknown after those of the rollers; forces come out as of a
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
        strip = self.contact.apply(full).reshape(2 * self.contact.count, self.points)
        speed = np.full(self.points, full[self.end])
        return np.vstack([strip, self.surface @ self._turned(full), speed])

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L, J[j, i] of shape (2 count + 2, count + 1, points)."""
        *_, by_surface, by_speed = derivative
        by_strip = derivative[:-2].reshape(2, self.contact.count, *derivative.shape[1:])
        self.contact.add_tangent(by_strip[:, :, :-1], pattern, blocks)
        last = blocks.strip + blocks.others - 1
        blocks.add(np.arange(blocks.strip), last, self.contact.gather(by_speed[:-1]))
        if not self.surface.shape[1]:
            return
        values, rollers = self.contact.matrix, blocks.strip + np.arange(self.surface.shape[1])
        self._couple(blocks, values, by_surface[:-1])
        for matrix, forces in zip((values, self.contact.slopes), by_strip[:, :, -1], strict=True):
            self._couple(blocks, matrix, forces, on_rollers=True)
        blocks.add(rollers, rollers, self.surface.T @ (by_surface[-1] * self.weights))
        blocks.add(rollers, last, self.surface.T @ (by_speed[-1] * self.weights))


@dataclass(frozen=True)
class CarriedFriction(TurningFriction):
    """Friction on strip of which material passes labels that hardly move.

    The slip is v·s − V ρ/r along the strip, with its own direction s across the roller's axis, the
    roller's surface speed V and its profile ρ/r; v·m along the meridian m.  A strip that bends onto
    a roller meets it at an angle α ~ √(D/T)/r: with v·t along the roller's tangent t it would seem
    to slip by −c α²/2, which is a thousand times the elastic creep.  The last unknown is the length
    (m) that has passed, of which c is the rate.

    Attributes
    ----------
    slopes : SlopeOperator
        At all points of the strip.
    """

    slopes: SlopeOperator | None = None

    @property
    def points(self) -> int:  # type: ignore[override]
        """Number of points of the contact, as the operator to all of them need not be there."""
        return self.contact.points

    @cached_property
    def operator(self) -> TransportOperator:  # type: ignore[override]
        """Operator to the points of the contact, and to the surfaces that they see."""
        assert self.slopes is not None
        slopes = self.slopes.restricted(self.contact.operator.chosen)
        which = np.array(self.numbers)[self.roller.seen_by(slopes.points)]
        return TransportOperator(slopes, which, self.rollers)

    def sliding(self, x: Any, v: Any, controls: Mapping[str, Any]) -> tuple[Projection, Any, Any]:
        """Return where the points are on the roller, its tangents there, and their slip.

        Parameters
        ----------
        x, v : array or Series, shape (2 components + 2, points)
            Of the unknowns and of their rates.
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
        others = range(1, len(self.frame) - 1)
        change, turning, speed = self.rates(x, v, controls)
        moving = np.stack([forward, *(parts[k] for k in others)]) * speed
        if change is not None:
            changing = np.einsum("ki...,i...->k...", tangents, change)
            shifted = (along[0] * change[0] + along[1] * change[1]) / forward
            moving = moving + np.stack([shifted, *(changing[k] for k in others)])
        turned = self.turned(place) * (turning * self.roller.sense)
        return place, tangents, moving - (self.surface(place, controls) + turned)

    def rates(self, x: Any, v: Any, controls: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        """Return ∂r/∂t against the roller in its frame, speeds of free surfaces, and c (m/s)."""
        own = transform(self.frame, control_of(self.roller, controls, "velocity"))
        return transform(self.view, v[: self.contact.kinematics.count]) - own, v[-2], v[-1]


@dataclass(frozen=True)
class SteadyFriction(CarriedFriction):
    """The same in a stationary state, in which no velocity is unknown.

    Control besides those of friction: ``strip.speed`` (m/s), from which the last unknown counts.
    """

    rate_dependent = False

    def rates(self, x: Any, v: Any, controls: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        """Return no change, speeds of free surfaces, and c (m/s)."""
        return None, x[-2], x[-1] + controls["strip.speed"]


class Passage(LawEffect):
    """Condition at the end of a fed strip for the length that has passed: (v − V)·d = 0.

    V is what that end would move with, or 0 if nothing holds it: its label then stays.  As a force
    it is multiplied by a stiffness.  Control: ``strip.passing`` V·d (m/s).

    Parameters
    ----------
    strip : Strip
    edge : str
        The end.
    direction : ndarray, shape (3,)
        d, along the strip from entry to exit.
    held : bool
        Whether the end is held: then its label stays, and c ∂r/∂X·d = V·d.
    stiffness : float
        N s/m.
    unknowns : int
        Those of strip and rollers, and the length that has passed, which is the last.
    """

    name, points, rate_dependent = "passage", 1, True

    def __init__(
        self, strip: Strip, edge: str, direction: Array, held: bool, stiffness: float, unknowns: int
    ) -> None:
        self.held, self.stiffness, self.unknowns = held, stiffness, unknowns
        own = strip.kinematics.pick(direction)
        self.flat = float(own @ strip.kinematics.pick([1.0, 0.0, 0.0]))
        values, slopes = strip.edges[edge].values, strip.dofs("u_x")[strip.edges[edge].nodes]
        sums = np.zeros((2, strip.scalars, strip.count))
        for row, scalars in enumerate((values, slopes)):
            sums[row, scalars] = own / len(scalars)
        self.sums = sums.reshape(2, -1)

    @property
    def operator(self) -> Passage:  # type: ignore[override]
        """The end is its own point."""
        return self

    @cached_property
    def matrices(self) -> tuple[list[Part], list[Part]]:
        """L as sparse matrices, and that of which forces are the transposed."""
        one = np.ones(1)
        sums = [Part(csr_matrix(sum_[None]), one, row=k) for k, sum_ in enumerate(self.sums)]
        last = Part(csr_matrix(one[None]), one, self.unknowns - 1)
        return [*sums, replace(last, row=2)], [last]

    def apply(self, full: Array) -> Array:
        """Mean displacement and slope of the end along d, and the length passed, shape (3, 1)."""
        passed = full[self.unknowns - 1]
        return np.append(self.sums @ full[: self.sums.shape[1]], passed)[:, None]

    def gather(self, forces: Array) -> Array:
        """Generalised forces, (1, 1) → (unknowns,)."""
        return np.append(np.zeros(self.unknowns - 1), forces[0])

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add J of shape (3, 1, 1) to the last row."""
        last = blocks.strip + blocks.others - 1
        blocks.add(last, np.arange(blocks.strip), derivative[:2, 0, 0] @ self.sums)
        blocks.add(last, last, derivative[2, 0])

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Residual (N), shape (1, 1)."""
        moving = v[2] * (x[1] + self.flat) if self.held else v[0]
        return np.stack([(moving - controls["strip.passing"]) * self.stiffness])


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
