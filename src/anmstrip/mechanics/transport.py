"""Rollers that turn freely, and strip that moves through its own shape.

Rollers turn as the strip, a torque and their bearings have it.  Material passes labels that stay
where they are: at c (m of unstressed strip per second) it moves with v = ∂r/∂t + c ∂r/∂X (an
arbitrary Lagrangian-Eulerian description: Donea, Huerta, Ponthot & Rodríguez-Ferran, Encyclopedia
of Computational Mechanics, chapter 14, 2004), in a stationary state r(X, Y) with v = c ∂r/∂X.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from anmstrip.arrays import Array
from anmstrip.fem.operators import CellOperator, LinearOperator, Part, Pattern
from anmstrip.fem.sampling import (
    ContactOperator,
    RollerOperator,
    RollerUnknowns,
    SlopeOperator,
    l2_projection,
)
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.contact import Friction, control_of, transform
from anmstrip.mechanics.effects import LawEffect, Values, scale_speeds
from anmstrip.mechanics.roller import Projection, at_points

DRIVEN = -1
"""Number of a roller that does not turn freely."""


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
    def operator(self) -> RollerOperator:  # type: ignore[override]
        """Operator to the strip and the rollers."""
        return self._to_rollers(self.contact.sampling)

    operator_type = RollerOperator

    def _to_rollers(self, sampling: ContactOperator) -> RollerOperator:
        """Return the operator to the points of the strip, and what they see of their rollers."""
        which = np.array(self.numbers)[self.roller.seen_by(sampling.points)]
        surfaces = RollerUnknowns(which, self.rollers, sampling.whole.unknowns)
        return self.operator_type(sampling, *self.contact.shifts, surfaces)

    @cached_property
    def by_roller(self) -> dict[str, Friction]:
        """Roller → its own friction, at all points of the strip."""
        parts: Any = super().by_roller.items()
        pairs = zip(parts, self.numbers, strict=True)
        return {name: replace(part, numbers=(number,)) for (name, part), number in pairs}

    def slip(self, place: Any, tangents: Any, v: Any, controls: Values) -> Any:
        """Tangential velocity relative to the surface (m/s), (components of slip, points)."""
        own = super().slip(place, tangents, v[:-1], controls)
        return own - self.turned(place) * (v[-1] * self.roller.sense)

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Residual per area of the strip and of the surface, (components + 1, points)."""
        place, tangents, slip = self.sliding(x, v, controls)
        traction = self.traction(place, slip, controls)
        turned = traction[0] if place.ratio is None else place.ratio * traction[0]
        force = self.contact.answered(self.on_strip(tangents, traction))
        return np.stack([*force, turned * self.roller.sense])


@dataclass(frozen=True)
class Drives(LawEffect):
    """Torques of the drives and drag of the bearings of rollers that turn freely, over the radius.

    The drag M V/√(V² + V_b²) opposes the surface speed V with the torque M, but for speeds about
    V_b, and has a slope at rest.  The air keeps a roller at rest that nothing touches, with a drag
    per speed that nobody feels.  Controls: ``rollers.NAME.torque`` (N m, in the sense of V).

    Attributes
    ----------
    names : sequence of str
    radii : ndarray, shape (rollers,)
        m.
    bearings : ndarray, shape (rollers,)
        M (N m).
    speed : float
        V_b (m/s).
    air : float
        Drag per speed, at the surface (N s/m).
    unknowns : int
        Those of the strip, before those of the rollers.
    """

    names: Sequence[str]
    radii: Array
    bearings: Array
    speed: float
    air: float
    unknowns: int

    name = "drives"
    rate_dependent = True
    has_corners = True

    @cached_property
    def operator(self) -> LinearOperator:  # type: ignore[override]
        """The rollers are their own points."""
        count = len(self.names)
        parts = [Part(csr_matrix(np.eye(count)), np.ones(count), self.unknowns)]
        return LinearOperator(count, (parts, parts))

    def sharper(self, share: float) -> Drives:
        """Return the same with V_b smaller by a share."""
        return replace(self, speed=(1.0 - share) * self.speed)

    def at_speed(self, speed: float) -> Drives:
        """Return the same with another V_b (m/s)."""
        return replace(self, speed=speed, air=self.air * self.speed / speed)

    def drag(self, speeds: Any) -> Any:
        """Torque (N m) with which bearings brake, positive against positive speeds, (rollers,)."""
        return speeds / np.sqrt(speeds * speeds + self.speed**2) * self.bearings

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Drag less torque, over the radius (N), shape (1, rollers)."""
        given = [controls[f"rollers.{name}.torque"] for name in self.names]
        torque = at_points(given, np.arange(len(given)))
        speeds = scale_speeds(v[0], controls)
        return np.stack([(self.drag(speeds) - torque) / self.radii + self.air * speeds])


@dataclass(frozen=True)
class SteadyDrives(Drives):
    """The same in a stationary state, where the speeds are unknowns themselves."""

    rate_dependent = False

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Drag less torque, over the radius (N), shape (1, rollers)."""
        return super().law(x, x, controls)


@dataclass(frozen=True)
class AlignedFriction(TurningFriction):
    """Friction whose slip is that along the strip's own direction, not along the roller's tangent.

    The slip is v·s − V ρ/r along the strip, with its direction s across the roller's axis, the
    roller's surface speed V and its profile ρ/r; v·m along the meridian m.  A strip that bends onto
    a roller meets it at an angle α ~ √(D/T)/r, and one that lies flat on it at x/r where contact
    begins at a distance x: with v·t along the roller's tangent t it would seem to slip by
    −v α²/2, which is a thousand times the elastic creep.

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
    def operator(self) -> RollerOperator:  # type: ignore[override]
        """Operator to the points of the contact, and to the rollers that they see."""
        assert self.slopes is not None
        return self._to_rollers(self.slopes.restricted(self.contact.sampling.chosen))

    def sliding(self, x: Any, v: Any, controls: Values) -> tuple[Projection, Any, Any]:
        """Return where the points are on the roller, its tangents there, and their slip.

        Parameters
        ----------
        x, v : array or Series, shape (inputs of the operator, points)
            Of the unknowns and of their rates.
        controls : mapping
        """
        count = self.contact.kinematics.count
        place = self.contact.seen(x, controls, 2 * count)
        tangents = self.roller.tangents(place, len(self.frame))
        flat = self.contact.kinematics.pick([1.0, 0.0, 0.0])[:, None]
        along = transform(self.view, x[count : 2 * count] + flat)
        parts = np.einsum("ki...,i...->k...", tangents, along)
        length = np.sqrt(along[0] * along[0] + along[1] * along[1])
        forward = np.where(parts[0] > 0.0, length, -length)
        others = range(1, len(self.frame) - 1)
        change, turning, speed = self.rates(x, v, controls)
        moving = self.turned(place) * (turning * self.roller.sense) * -1.0
        moving = moving - self.surface(place, controls)
        if speed is not None:
            moving = moving + np.stack([forward, *(parts[k] for k in others)]) * speed
        if change is not None:
            changing = np.einsum("ki...,i...->k...", tangents, change)
            shifted = (along[0] * change[0] + along[1] * change[1]) / forward
            moving = moving + np.stack([shifted, *(changing[k] for k in others)])
        return place, tangents, moving

    def rates(self, x: Any, v: Any, controls: Values) -> tuple[Any, Any, Any]:
        """Return ∂r/∂t against the roller in its frame, speeds of free surfaces, and c (m/s).

        None for what is not there.
        """
        own = transform(self.frame, control_of(self.roller, controls, "velocity"))
        return transform(self.view, v[: self.contact.kinematics.count]) - own, v[-1], None


class TransportOperator(RollerOperator):
    """Displacements, their derivatives along X, unknowns of rollers, and the strip's own speed.

    The last of these is the unknown after those of the rollers; forces come out as of a
    :class:`~anmstrip.fem.sampling.RollerOperator`.
    """

    @property
    def matrices(self) -> tuple[list[Part], list[Part]]:  # type: ignore[override]
        """L as sparse matrices, and that of which forces are the transposed."""
        inputs, outputs = super().matrices
        own_speed = max(first + m.shape[1] for m, first in self.seen)
        ones, row = csr_matrix(np.ones((self.points, 1))), inputs[-1].row + 1
        return [*inputs, Part(ones, self.weights, own_speed, row=row)], outputs


@dataclass(frozen=True)
class CarriedFriction(AlignedFriction):
    """The same on strip of which material passes labels that hardly move.

    The last unknown is the length (m) that has passed, of which c is the rate.  Where runs before a
    roller take strip up, less passes it: control ``rollers.NAME.drift`` (m/s), added to c.  Where
    labels hold g as much strip, as between the rollers that a run hangs on, it passes them with
    1/g of that: control ``strip.held``, and ``strip.taking_up`` (m/s), of the runs.

    Attributes
    ----------
    grown, passed : ndarray, shape (runs, points of the strip), optional
        By how much ∂S/∂X (1/m) and S (1) grow at all points with the strip that each run holds.
    drifts : ndarray, shape (runs, rollers), optional
        The same of S at the labels to which the rollers' drifts belong.
    """

    grown: Array | None = None
    passed: Array | None = None
    drifts: Array | None = None

    operator_type = TransportOperator

    @cached_property
    def by_roller(self) -> dict[str, Friction]:
        """Roller → its own friction, at all points of the strip."""
        parts: Any = super().by_roller
        if self.drifts is None:
            return dict(parts)
        own = zip(parts.items(), self.drifts.T[:, :, None], strict=True)
        return {name: replace(part, drifts=drifts) for (name, part), drifts in own}

    def rates(self, x: Any, v: Any, controls: Values) -> tuple[Any, Any, Any]:
        """Return ∂r/∂t against the roller in its frame, speeds of free surfaces, and c/g (m/s)."""
        change, _, _ = super().rates(x, v, controls)
        passing = v[-1]
        if f"rollers.{self.roller.members[0].name}.drift" in controls:
            passing = passing + control_of(self.roller, controls, "drift")
            passing = passing - self.further(controls)
        return change, v[-2], passing / (self.growth(controls) + 1.0)

    def growth(self, controls: Values) -> Any:
        """Return g − 1 at the points of the contact; 0 where labels stay."""
        if self.grown is None:
            return 0.0
        return _over_runs(controls["strip.held"], self._at_contact(self.grown))

    def further(self, controls: Values) -> Any:
        """Return ∂S/∂t (m/s) at the points of the contact, beyond that at their rollers' labels."""
        assert self.passed is not None and self.drifts is not None
        here = self._at_contact(self.passed)
        beyond = here - self.drifts[:, self.roller.seen_by(here.shape[1])]
        return _over_runs(controls["strip.taking_up"], beyond)

    def _at_contact(self, shapes: Array) -> Array:
        """Shapes of runs at the points of the contact; a nip sees those of the strip twice."""
        return shapes[:, self.contact.sampling.chosen % shapes.shape[1]]


def _over_runs(held: Any, shapes: Array) -> Any:
    """Sum of what runs hold, times their shapes, of which most are 0 everywhere."""
    return sum((held[k] * shapes[k] for k in np.flatnonzero(shapes.any(axis=1))), 0.0)


@dataclass(frozen=True)
class SteadyFriction(CarriedFriction):
    """The same in a stationary state, in which no velocity is unknown.

    Control besides those of friction: ``strip.speed`` (m/s), from which the last unknown counts.
    """

    rate_dependent = False

    def rates(self, x: Any, v: Any, controls: Values) -> tuple[Any, Any, Any]:
        """Return no change, speeds of free surfaces, and c/g (m/s)."""
        speed = x[-1] + controls["strip.speed"]
        return None, x[-2], speed / (self.growth(controls) + 1.0)


class Passage(LawEffect):
    """Condition at the end of a fed strip for the length that has passed, c/g |∂r/∂X| = V.

    V is what an end that is held would move with; its label stays.  Where nothing holds the end,
    its label stays along the strip, v·d = V = 0.  As a force it is multiplied by a stiffness.
    Controls: ``strip.passing`` V (m/s), and ``strip.held``, by which heat changes g there.

    Parameters
    ----------
    strip : Strip
    edge : str
        The end.
    direction : ndarray, shape (3,)
        d, along the strip from entry to exit.
    held : bool
        Whether the end is held.
    stiffness : float
        N s/m.
    unknowns : int
        Those of strip and rollers, and the length that has passed, which is the last.
    grown : ndarray, shape (runs, 1), optional
        By how much g grows there with ``strip.held``.
    """

    name, rate_dependent = "passage", True

    def __init__(
        self,
        strip: Strip,
        edge: str,
        direction: Array,
        held: bool,
        stiffness: float,
        unknowns: int,
        grown: Array | None = None,
    ) -> None:
        self.held, self.stiffness, self.grown = held, stiffness, grown
        own, one = strip.kinematics.pick(direction), np.ones(1)
        self.flat = strip.kinematics.pick([1.0, 0.0, 0.0])
        values, slopes = strip.edges[edge].values, strip.dofs("u_x")[strip.edges[edge].nodes]
        chosen = [(values, own), *((slopes, each) for each in np.eye(strip.count))]
        inputs = []
        for row, (scalars, along) in enumerate(chosen):
            mean = np.zeros((strip.scalars, strip.count))
            mean[scalars] = along / len(scalars)
            inputs.append(Part(csr_matrix(mean.reshape(1, -1)), one, row=row))
        last = Part(csr_matrix(one[None]), one, unknowns - 1)
        self.operator = LinearOperator(1, ([*inputs, replace(last, row=len(inputs))], [last]))

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Residual (N), shape (1, 1)."""
        moving, given = v[0], controls["strip.passing"]
        if self.grown is not None:
            given = given * (_over_runs(controls["strip.held"], self.grown) + 1.0)
        if self.held:
            squares = ((x[1 + k] + flat) ** 2 for k, flat in enumerate(self.flat))
            moving = v[-1] * np.sqrt(sum(squares))
        return np.stack([(moving - given) * self.stiffness])


def transport_velocity(strip: Strip, pattern: Pattern, full: Array, speed: Any) -> Array:
    """Velocity c ∂r/∂X of strip that passes labels, on the strip's functions.

    Shape (unknowns of the strip,).

    Parameters
    ----------
    strip : Strip
    pattern : Pattern
    full : ndarray, shape (unknowns,)
        Displacements.
    speed : float or ndarray, shape (points,)
        c (m of unstressed strip per second), at the quadrature points where labels hold more of it
        or less: over g then.
    """
    tangents = strip.frames().tangents + CellOperator(strip, [1]).apply(full)
    return l2_projection(strip, pattern, speed * strip.kinematics.embed(tangents[:, 0]))


def strip_speed(strip: Strip, full: Array, velocity: Array) -> float:
    """Mean of v · r,X / |r,X|² over the nodes (m/s), that of v = c ∂r/∂X if it is so."""
    along = strip.nodal(full)[strip.dofs("u_x")]
    along = along + strip.kinematics.pick([1.0, 0.0, 0.0])
    v = strip.nodal(velocity)[strip.node_values]
    return float(((v * along).sum(axis=1) / (along * along).sum(axis=1)).mean())
