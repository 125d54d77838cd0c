"""What is read off a state: tensions, roller forces, wrap, slip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.loads import Following
from anmstrip.mechanics.roller import Roller
from anmstrip.scene.stages import Plan
from anmstrip.series.path import Branch

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Contact, Friction

Array = NDArray[np.float64]

TOUCHING = 0.1
"""Share of a roller's mean pressure above which a point counts as in contact."""


@dataclass(frozen=True)
class State:
    """A state of the strip in a stage.

    Attributes
    ----------
    plan : Plan
    time : float
        s.
    control : float
        λ of the stage.
    full : ndarray, shape (unknowns,)
        Displacements.
    velocity : ndarray, shape (unknowns,), or None
        Where the stage runs in time.
    branch : Branch or None
        Path of a rate-free step to this state, in the free unknowns.
    """

    plan: Plan
    time: float
    control: float
    full: Array
    velocity: Array | None
    branch: Branch | None = None

    def at(self, time: float, before: State | None) -> State:
        """State at an instant of the step that ends here.

        On the series of a rate-free step, on a parabola with the velocity of this end in
        time; linear where there is neither.

        Parameters
        ----------
        time : float
            s.
        before : State or None
            Where the step began; the undeformed strip if ``None``.
        """
        if time == self.time:
            return self
        control = (time - self.plan.start) / self.plan.duration
        a = None if self.branch is None else self.branch.reaches(control)
        if self.branch is not None and a is not None:
            full = self.plan.supports.full(self.branch(a)[0], control)
            return State(self.plan, time, control, full, None)
        start, u = self.plan.start, np.zeros_like(self.full)
        if before is not None:
            start, u = before.time, before.full
        h, change = self.time - start, self.full - u
        curved = 0.0 if self.velocity is None else h * self.velocity - change
        s = (time - start) / h
        full = u + s * (change - (1.0 - s) * curved)
        velocity = None if self.velocity is None else (change + (2.0 * s - 1.0) * curved) / h
        return State(self.plan, time, control, full, velocity)

    @cached_property
    def controls(self) -> dict[str, Array]:
        """Values of the controls."""
        return self.plan.controls.at(self.control)

    @cached_property
    def imbalance(self) -> Array:
        """Internal minus external force of every unknown; reactions where it is held."""
        return self.plan.model.force(self.full, self.velocity, self.controls)

    def edge_force(self, name: str) -> Array:
        """Total force on an edge, reaction and dead load (N), shape (3,)."""
        edge = self.plan.model.strip.edges[name]
        strip = self.plan.model.strip
        given = self.controls.get(f"{name}.force", np.zeros(3)) * edge.length
        given += self._following(name)
        values = self.imbalance.reshape(-1, strip.count)[edge.values].sum(axis=0)
        return strip.kinematics.embed(values) + given + self._outside(name, edge.length)

    def _following(self, name: str) -> Array:
        """Total of the load that follows the strip at an edge (N), shape (3,)."""
        for effect in self.plan.model.effects:
            if isinstance(effect, Following) and effect.control == f"{name}.tension":
                operator = effect.operator
                stress = effect.law(operator.apply(self.full), None, self.controls)
                return effect.kinematics.embed(-stress[:, 0] @ operator.weights)
        return np.zeros(3)

    def _outside(self, name: str, length: float) -> Array:
        """What holds a plate in its own plane, where it has no unknowns (N), shape (3,)."""
        if name != "entry" or 0 in self.plan.model.strip.kinematics.components:
            return np.zeros(3)
        pull = self.controls.get("exit.force", np.zeros(3))[0] * length
        return np.array([-pull, 0.0, 0.0])

    def tension(self, name: str) -> float:
        """Mean force per length of an edge along the strip's own direction there (N/m)."""
        edge = self.plan.model.strip.edges[name]
        strip = self.plan.model.strip
        slopes = self.full.reshape(-1, strip.count)[strip.dofs("u_x")[edge.nodes]].mean(axis=0)
        along = np.array([1.0, 0.0, 0.0]) + strip.kinematics.embed(slopes)
        along /= np.linalg.norm(along)
        outward = -along if name == "entry" else along
        return float(self.edge_force(name) @ outward) / edge.length

    @cached_property
    def contacts(self) -> dict[str, ContactState]:
        """Roller → what it does to the strip."""
        found: list[Any] = [e for e in self.plan.model.effects if hasattr(e, "singles")]
        contacts: dict[str, Contact] = {}
        frictions: dict[str, Friction] = {}
        for effect in found:
            (frictions if effect.rate_dependent else contacts).update(effect.singles)
        return {name: self._contact(c, frictions.get(name)) for name, c in contacts.items()}

    def _contact(self, contact: Contact, friction: Friction | None) -> ContactState:
        place = contact.seen(contact.operator.apply(self.full), self.controls)
        normal, pressure = contact.normal(place), np.maximum(contact.pressure(place), 0.0)
        slip, traction = np.zeros_like(normal), np.zeros_like(normal)
        if friction is not None and self.velocity is not None:
            near = friction.near(self.full, self.controls)
            x, v = near.operator.apply(self.full), near.operator.apply(self.velocity)
            chosen = near.operator.chosen
            slip[:, chosen], traction[:, chosen] = near.in_space(x, v, self.controls)
        coefficient = None if friction is None else friction.law_of_slip.coefficient
        return ContactState(contact, place.gap, normal, pressure, slip, traction, coefficient)

    @cached_property
    def rollers(self) -> dict[str, RollerReading]:
        """Roller → what is read off, in the order of the scene."""
        edges = self.plan.model.strip.edges
        incoming = self.edge_force("entry") if "entry" in edges else np.zeros(3)
        readings = {}
        for name in sorted(self.contacts, key=lambda n: self.contacts[n].middle):
            state = self.contacts[name]
            readings[name] = _reading(state, incoming, self._weight_before)
            incoming = incoming + readings[name].resultant
        return {name: readings[name] for name in self.contacts}

    def _weight_before(self, x: float) -> Array:
        """Weight of the strip up to a reference position (N), shape (3,)."""
        gravity = self.controls.get("gravity")
        if gravity is None:
            return np.zeros(3)
        strip = self.plan.model.strip
        begin, end = strip.nodes[0].min(), strip.nodes[0].max()
        area = (x - begin) / (end - begin) * strip.areas.sum()
        return strip.material.density * strip.thickness * area * np.asarray(gravity)


@dataclass(frozen=True)
class ContactState:
    """What a roller does to the points of the strip.

    Attributes
    ----------
    contact : Contact
    gap, pressure : ndarray, shape (points,)
        m, Pa.
    normal, slip, traction : ndarray, shape (3, points)
        1, m/s, Pa; slip and traction are zero where there is no friction.
    coefficient : float or None
        f, with friction.
    """

    contact: Contact
    gap: Array
    normal: Array
    pressure: Array
    slip: Array
    traction: Array
    coefficient: float | None

    @cached_property
    def touching(self) -> NDArray[np.bool_]:
        """Points in contact: pressed by more than η, and a tenth of the mean pressure.

        The mean is weighted by force.
        """
        force = self.pressure * self.area
        mean = float((force * self.pressure).sum()) / max(float(force.sum()), 1e-300)
        return self.pressure > max(TOUCHING * mean, self.contact.signorini.eta)

    @property
    def area(self) -> Array:
        """Area that belongs to each point (m²)."""
        return self.contact.operator.weights

    @cached_property
    def arc(self) -> tuple[float, float]:
        """Reference x where contact begins and ends; of the nearest point if there is none."""
        x = self.contact.operator.reference[0]
        x = x[self.touching] if self.touching.any() else x[[int(self.gap.argmin())]]
        return float(x.min()), float(x.max())

    @property
    def middle(self) -> float:
        """Reference x of the middle of the contact."""
        return 0.5 * sum(self.arc)

    @property
    def roller(self) -> Roller:
        """Of the contact."""
        return self.contact.roller.members[0]

    @property
    def turning(self) -> Array:
        """Unit direction in which the surface turns, a × n, shape (3, points)."""
        across = np.cross(self.roller.unit_axis, self.normal, axis=0)
        return across / np.linalg.norm(across, axis=0)

    @property
    def width(self) -> float:
        """Of the strip (m)."""
        return self.contact.operator.width


@dataclass(frozen=True)
class RollerReading:
    """What a roller does to the strip.

    Attributes
    ----------
    normal_force : float
        Sum of the normal forces (N).
    drag : float
        Sum of the friction forces in the sense of turning (N).
    wrap : float
        Angle from the first to the last point in contact (rad).
    tension_in, tension_out : float
        Force in the strip before and after the roller, over its width (N/m), by
        equilibrium from the entry; zero if no edge is named entry.
    max_slip : float
        Largest slip speed in contact (m/s).
    creep_speed : float
        Roller's surface speed less the strip's, mean over the contact (m/s).
    cone_violation : float
        Largest |R_T| / (f R_N) − 1 in contact, at least 0.
    resultant : ndarray, shape (3,)
        Force of the roller on the strip (N).
    """

    normal_force: float
    drag: float
    wrap: float
    tension_in: float
    tension_out: float
    max_slip: float
    creep_speed: float
    cone_violation: float
    resultant: Array

    @property
    def tension_ratio(self) -> float | None:
        """Tension before the roller over tension after it."""
        return self.tension_in / self.tension_out if self.tension_out > 0.0 else None


def _reading(
    state: ContactState, incoming: Array, weight_before: Callable[[float], Array]
) -> RollerReading:
    area, touching = state.area, state.touching
    width = state.width
    sense = state.turning
    resultant = ((state.pressure * state.normal + state.traction) * area).sum(axis=1)
    force = state.pressure * area * touching
    along = np.einsum("ip,ip->p", state.slip, sense)
    before, after = (
        force + weight_before(x)
        for force, x in zip((incoming, incoming + resultant), state.arc, strict=True)
    )
    return RollerReading(
        normal_force=float((state.pressure * area).sum()),
        drag=float((state.traction * sense * area).sum()),
        wrap=_wrap(state),
        tension_in=float(np.linalg.norm(before) / width),
        tension_out=float(np.linalg.norm(after) / width),
        max_slip=float(np.linalg.norm(state.slip, axis=0)[touching].max(initial=0.0)),
        creep_speed=-float((along * force).sum() / force.sum()) if force.any() else 0.0,
        cone_violation=_cone_violation(state),
        resultant=resultant,
    )


def _cone_violation(state: ContactState) -> float:
    if not state.coefficient or not state.touching.any():
        return 0.0
    limit = state.coefficient * state.pressure[state.touching]
    ratio = np.linalg.norm(state.traction[:, state.touching], axis=0) / limit
    return max(0.0, float(ratio.max()) - 1.0)


def _wrap(state: ContactState) -> float:
    """Angle between the extreme normals in contact, in the plane across the axis."""
    if not state.touching.any():
        return 0.0
    n = state.normal[:, state.touching]
    middle = n.sum(axis=1)
    middle /= np.linalg.norm(middle)
    angle = np.arctan2(np.cross(state.roller.unit_axis, middle) @ n, middle @ n)
    return float(np.ptp(angle))
