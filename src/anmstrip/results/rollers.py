"""Readings of a roller: forces, wrap, slip, tensions, and the cost of regularisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from anmstrip.arrays import Array
from anmstrip.mechanics.roller import Roller

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Contact


TOUCHING = 0.1
"""Share of a roller's mean pressure above which a point counts as in contact."""

STICKS = 0.95
"""Share of the cone f R_N up to which a point counts as sticking."""

FIBRES = 16
"""Stripes of the width, along each of which gaps are averaged."""


@dataclass(frozen=True)
class ContactState:
    """State of the points of the strip under one roller."""

    contact: Contact
    gap: Array  # m, shape (points,)
    normal: Array  # shape (3, points)
    pressure: Array  # Pa, shape (points,)
    slip: Array  # m/s, shape (3, points); zero where there is no friction
    traction: Array  # Pa, shape (3, points); zero where there is no friction
    coefficient: float | None  # f, with friction
    arm: Array  # distance of the surface from the axis (m), shape (points,)
    speed: float  # of the surface (m/s)
    bearing_torque: float  # against it (N m)

    @cached_property
    def touching(self) -> NDArray[np.bool_]:
        """Points in contact: by more than what is faint, and a tenth of the mean pressure.

        The mean is weighted by force.
        """
        force = self.pressure * self.area
        mean = float((force * self.pressure).sum()) / max(float(force.sum()), 1e-300)
        return self.pressure > max(TOUCHING * mean, self.contact.signorini.faint)

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
        """Geometry of the roller."""
        return self.contact.roller.members[0]

    @property
    def turning(self) -> Array:
        """Unit direction of a positive surface speed, ± a × n, shape (3, points)."""
        across = np.cross(self.roller.sense * self.roller.unit_axis, self.normal, axis=0)
        return across / np.linalg.norm(across, axis=0)

    @property
    def width(self) -> float:
        """Width of the strip (m)."""
        return self.contact.operator.width


@dataclass(frozen=True)
class RollerReading:
    """Forces of a roller on the strip, and how they come about."""

    normal_force: float  # sum of the normal forces (N)
    drag: float  # sum of the friction forces in the sense of a positive speed (N)
    wrap: float  # angle from the first to the last point in contact (rad)
    tension_in: float  # before the roller (N/m), by equilibrium from the entry; 0 without one
    tension_out: float  # behind it, likewise
    max_slip: float  # largest slip speed in contact (m/s)
    creep_speed: float  # roller's surface speed less the strip's, mean over the contact (m/s)
    cone_violation: float  # largest |R_T| / (f R_N) − 1 in contact, at least 0
    surface_speed: float  # where the profile has the nominal radius (m/s)
    torque: float  # moment of friction about the axis on the strip, in the sense of drag (N m)
    bearing_torque: float  # with which bearings brake a roller that turns freely (N m)
    resultant: Array  # force of the roller on the strip (N), shape (3,)

    @property
    def tension_ratio(self) -> float | None:
        """Tension before the roller over tension after it."""
        return self.tension_in / self.tension_out if self.tension_out > 0.0 else None


def reading_of(
    state: ContactState, incoming: Array, weight_before: Callable[[float], Array]
) -> RollerReading:
    """Read off a roller.

    Parameters
    ----------
    state : ContactState
    incoming : ndarray, shape (3,)
        Sum of the forces on the strip before the roller, its weight left out (N).
    weight_before : callable
        Weight of the strip up to a reference x (N), shape (3,).
    """
    area, touching, normal = state.area, state.touching, state.normal[:, state.touching]
    resultant = ((state.pressure * state.normal + state.traction) * area).sum(axis=1)
    force = state.pressure * area * touching
    along = np.einsum("ip,ip->p", state.slip, state.turning)
    before, after = (
        total + weight_before(x)
        for total, x in zip((incoming, incoming + resultant), state.arc, strict=True)
    )
    wrap = violation = 0.0
    if touching.any():
        middle = normal.sum(axis=1) / np.linalg.norm(normal.sum(axis=1))
        across = np.cross(state.roller.unit_axis, middle)
        wrap = float(np.ptp(np.arctan2(across @ normal, middle @ normal)))
    if state.coefficient and touching.any():
        ratio = np.linalg.norm(state.traction, axis=0)[touching] / (
            state.coefficient * state.pressure[touching]
        )
        violation = max(0.0, float(ratio.max()) - 1.0)
    return RollerReading(
        normal_force=float((state.pressure * area).sum()),
        drag=float((state.traction * state.turning * area).sum()),
        surface_speed=state.speed,
        torque=float((state.traction * state.turning * area * state.arm).sum()),
        bearing_torque=state.bearing_torque,
        wrap=wrap,
        tension_in=float(np.linalg.norm(before) / state.width),
        tension_out=float(np.linalg.norm(after) / state.width),
        max_slip=float(np.linalg.norm(state.slip, axis=0)[touching].max(initial=0.0)),
        creep_speed=-float((along * force).sum() / force.sum()) if force.any() else 0.0,
        cone_violation=violation,
        resultant=resultant,
    )


@dataclass(frozen=True)
class Regularisation:
    """Effects of a roller's regularised laws, on the tensions as shares."""

    sticking_creep: float = 0.0  # largest slip speed where friction is below the cone (m/s)
    penetration: float = 0.0  # largest distance in contact from the surface, either side (m)
    by_creep: float = 0.0  # strain that what sticks creeps while on the roller, over the tension's
    by_cone: float = 0.0  # friction beyond f R_N, over the tension
    by_penetration: float = 0.0
    """Penetration over the radius: the moment and the way of the strip go with the radius; and
    the strain of the fibre whose gap is farthest from the others', in units of the tension's."""

    @property
    def effect(self) -> float:
        """Estimated change of the tensions by all, as a share."""
        return self.by_creep + self.by_cone + self.by_penetration


def regularisation_of(
    state: ContactState, reading: RollerReading, *, speed: float, elapsed: float, stiffness: float
) -> Regularisation:
    """Estimate what regularisation does on one roller.

    Parameters
    ----------
    state : ContactState
    reading : RollerReading
    speed : float
        Speed of the roller's surface (m/s).
    elapsed : float
        Time for which the strip may have crept (s).
    stiffness : float
        E t of the strip (N/m).
    """
    touching, radius = state.touching, state.roller.radius
    if not touching.any():
        return Regularisation()
    tension = max(reading.tension_in, reading.tension_out)
    creep = by_creep = by_cone = uneven = 0.0
    if state.coefficient and tension > 0.0:
        slip, traction = (np.linalg.norm(v, axis=0) for v in (state.slip, state.traction))
        cone = state.coefficient * state.pressure
        creep = float(slip[touching & (traction < STICKS * cone)].max(initial=0.0))
        excess = np.maximum(traction - cone, 0.0) * state.area
        by_cone = float(excess[touching].sum()) / (tension * state.width)
        arc = max(reading.wrap, 1e-3) * radius
        stay = min(arc / max(abs(speed - reading.creep_speed), 1e-300), elapsed)
        by_creep = creep * stay / arc * stiffness / tension
    y = state.contact.operator.reference[1, touching]
    _, fibre = np.unique(np.round(FIBRES * y / state.width), return_inverse=True)
    if tension > 0.0 and fibre.any():
        gaps = np.bincount(fibre, state.gap[touching]) / np.bincount(fibre)
        uneven = float(np.abs(gaps - gaps.mean()).max()) / radius / (tension / stiffness)
    penetration = float(np.abs(state.gap[touching]).max())
    return Regularisation(creep, penetration, by_creep, by_cone, penetration / radius + uneven)
