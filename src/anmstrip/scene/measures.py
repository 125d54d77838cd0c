"""What is read off a state: tensions, roller forces, wrap, slip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.roller import Roller
from anmstrip.scene.stages import Plan
from anmstrip.series.path import Branch

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
        reaction = self.imbalance.reshape(-1, 3)[edge.values].sum(axis=0)
        return reaction + self.controls.get(f"{name}.force", np.zeros(3)) * edge.length

    def tension(self, name: str) -> float:
        """Mean force per length of an edge along the strip's own direction there (N/m)."""
        edge = self.plan.model.strip.edges[name]
        slopes = self.plan.model.strip.basis.nodal_dofs[1, edge.nodes]
        along = np.array([1.0, 0.0, 0.0]) + self.full.reshape(-1, 3)[slopes].mean(axis=0)
        along /= np.linalg.norm(along)
        outward = -along if name == "entry" else along
        return float(self.edge_force(name) @ outward) / edge.length

    @cached_property
    def contacts(self) -> dict[str, ContactState]:
        """Roller → what it does to the strip."""
        frictions = {e.roller.name: e for e in self.plan.model.effects if isinstance(e, Friction)}
        return {
            effect.roller.name: self._contact(effect, frictions.get(effect.roller.name))
            for effect in self.plan.model.effects
            if isinstance(effect, Contact)
        }

    def _contact(self, contact: Contact, friction: Friction | None) -> ContactState:
        operator = contact.operator
        gap, normal, pressure = contact.pressure(operator.apply(self.full), self.controls)
        pressure = np.maximum(pressure, 0.0)
        slip, traction = np.zeros_like(normal), np.zeros_like(normal)
        if friction is not None and self.velocity is not None:
            near = friction.near(self.full, self.controls)
            chosen, v = near.operator.chosen, near.operator.apply(self.velocity)
            slip[:, chosen] = near.slip(normal[:, chosen], v, self.controls)
            traction[:, chosen] = near.traction(near.operator.apply(self.full), v, self.controls)
        coefficient = None if friction is None else friction.law_of_slip.coefficient
        return ContactState(contact, gap, normal, pressure, slip, traction, coefficient)

    @cached_property
    def rollers(self) -> dict[str, RollerReading]:
        """Roller → what is read off, in the order of the scene."""
        readings = {}
        incoming = self.edge_force("entry") if "entry" in self.plan.model.strip.edges else None
        for name, state in self.contacts.items():
            reading = _reading(state, incoming)
            incoming = None if incoming is None else incoming + reading.resultant
            readings[name] = reading
        return readings


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

    @property
    def roller(self) -> Roller:
        """Of the contact."""
        return self.contact.roller


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


def _reading(state: ContactState, incoming: Array | None) -> RollerReading:
    area, touching = state.area, state.touching
    width = np.ptp(state.contact.operator.reference[1])
    sense = state.roller.turning @ state.normal
    resultant = ((state.pressure * state.normal + state.traction) * area).sum(axis=1)
    force = state.pressure * area * touching
    along = np.einsum("ip,ip->p", state.slip, sense)
    before = np.zeros(3) if incoming is None else incoming
    after = np.zeros(3) if incoming is None else incoming + resultant
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
    angle = np.arctan2((state.roller.turning @ middle) @ n, middle @ n)
    return float(np.ptp(angle))
