"""What is read off a state: tensions, roller forces, wrap, slip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.contact import Contact, ContactState
from anmstrip.scene.stages import Plan

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
    """

    plan: Plan
    time: float
    control: float
    full: Array
    velocity: Array | None

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
    def contacts(self) -> dict[str, tuple[Contact, ContactState]]:
        """Roller → contact and what it does to the points."""
        found = {}
        for effect in self.plan.model.effects:
            if isinstance(effect, Contact):
                u = effect.operator.apply(self.full)
                v = None if self.velocity is None else effect.operator.apply(self.velocity)
                found[effect.roller.name] = (effect, effect.state(u, v, self.controls))
        return found

    @cached_property
    def rollers(self) -> dict[str, RollerReading]:
        """Roller → what is read off, in the order of the scene."""
        readings = {}
        incoming = self.edge_force("entry") if "entry" in self.plan.model.strip.edges else None
        for name, (contact, state) in self.contacts.items():
            reading = _reading(contact, state, self.controls, incoming)
            incoming = None if incoming is None else incoming + reading.resultant
            readings[name] = reading
        return readings


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


def in_contact(pressure: Array, area: Array) -> NDArray[np.bool_]:
    """Points whose pressure is a tenth of the mean pressure, itself weighted by force."""
    force = pressure * area
    total = float(force.sum())
    return pressure > TOUCHING * float((force * pressure).sum()) / total if total else force > 0.0


def _reading(
    contact: Contact, state: ContactState, controls: dict[str, Array], incoming: Array | None
) -> RollerReading:
    area = contact.operator.weights
    touching = in_contact(state.pressure, area)
    width = np.ptp(contact.operator.reference[1])
    sense = contact.roller.turning @ state.normal
    traction = np.zeros_like(state.normal) if state.traction is None else state.traction
    slip = np.zeros_like(state.normal) if state.slip is None else state.slip
    resultant = ((state.pressure * state.normal + traction) * area).sum(axis=1)
    force = state.pressure * area * touching
    along = np.einsum("ip,ip->p", slip, sense)
    before = np.zeros(3) if incoming is None else incoming
    after = np.zeros(3) if incoming is None else incoming + resultant
    return RollerReading(
        normal_force=float((state.pressure * area).sum()),
        drag=float((traction * sense * area).sum()),
        wrap=_wrap(contact, state.normal, touching),
        tension_in=float(np.linalg.norm(before) / width),
        tension_out=float(np.linalg.norm(after) / width),
        max_slip=float(np.linalg.norm(slip, axis=0)[touching].max(initial=0.0)),
        creep_speed=-float((along * force).sum() / force.sum()) if force.any() else 0.0,
        cone_violation=_cone_violation(contact, state, traction, touching),
        resultant=resultant,
    )


def _cone_violation(
    contact: Contact, state: ContactState, traction: Array, touching: NDArray[np.bool_]
) -> float:
    if contact.friction is None or not contact.friction.coefficient or not touching.any():
        return 0.0
    limit = contact.friction.coefficient * state.pressure[touching]
    return max(0.0, float((np.linalg.norm(traction[:, touching], axis=0) / limit).max()) - 1.0)


def _wrap(contact: Contact, normal: Array, touching: NDArray[np.bool_]) -> float:
    """Angle between the extreme normals in contact, in the plane across the axis."""
    if not touching.any():
        return 0.0
    n = normal[:, touching]
    middle = n.sum(axis=1)
    middle /= np.linalg.norm(middle)
    angle = np.arctan2((contact.roller.turning @ middle) @ n, middle @ n)
    return float(np.ptp(angle))
