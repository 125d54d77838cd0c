"""What is read off a roller: forces, wrap, slip, tensions, and the cost of regularisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING
import numpy as np
from numpy.typing import NDArray
from anmstrip.mechanics.roller import Roller

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Contact

Array = NDArray[np.float64]

TOUCHING = 0.1
"""Share of a roller's mean pressure above which a point counts as in contact."""


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


def reading_of(
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


STICKS = 0.95
"""Share of the cone f R_N up to which a point counts as sticking."""

FIBRES = 16
"""Stripes of the width, along each of which gaps are averaged."""


@dataclass(frozen=True)
class Regularisation:
    """Effects of a roller's regularised laws.

    Attributes
    ----------
    sticking_creep : float
        Largest slip speed where friction is below the cone (m/s).
    penetration : float
        Largest distance of a point in contact from the surface, on either side (m).
    by_creep : float
        Strain that what sticks creeps while it is on the roller, in units of the tension.
    by_cone : float
        Friction beyond f R_N, likewise.
    by_penetration : float
        Penetration over the radius: the moment and the way of the strip go with the radius; and
        the strain of the fibre whose gap is farthest from the others', in units of the tension's.
    """

    sticking_creep: float
    penetration: float
    by_creep: float
    by_cone: float
    by_penetration: float

    @property
    def effect(self) -> float:
        """Estimated change of the tensions by all, as a share."""
        return self.by_creep + self.by_cone + self.by_penetration


def regularisation_of(
    state: ContactState, reading: RollerReading, *, speed: float, elapsed: float, stiffness: float
) -> Regularisation:
    """Read off what regularisation does on one roller.

    Parameters
    ----------
    state : ContactState
    reading : RollerReading
    speed : float
        Of the roller's surface (m/s).
    elapsed : float
        Time for which the strip may have crept (s).
    stiffness : float
        E t of the strip (N/m).
    """
    touching = state.touching
    if not touching.any():
        return Regularisation(0.0, 0.0, 0.0, 0.0, 0.0)
    penetration = float(np.abs(state.gap[touching]).max())
    tension = max(reading.tension_in, reading.tension_out)
    creep = excess = 0.0
    if state.coefficient and tension > 0.0:
        creep, excess = _beyond(state)
    arc = max(reading.wrap, 1e-3) * state.roller.radius
    stay = min(arc / max(abs(speed - reading.creep_speed), 1e-300), elapsed)
    return Regularisation(
        sticking_creep=creep,
        penetration=penetration,
        by_creep=creep * stay / arc * stiffness / tension if creep else 0.0,
        by_cone=excess / (tension * state.width) if excess else 0.0,
        by_penetration=penetration / state.roller.radius + _uneven(state, tension / stiffness),
    )


def _uneven(state: ContactState, strain: float) -> float:
    """Strain of a fibre by its mean gap beside that of all fibres, over the tension's strain."""
    touching = state.touching
    y = state.contact.operator.reference[1, touching]
    _, fibre = np.unique(np.round(FIBRES * y / state.width), return_inverse=True)
    if strain <= 0.0 or not fibre.any():
        return 0.0
    gaps = np.bincount(fibre, state.gap[touching]) / np.bincount(fibre)
    return float(np.abs(gaps - gaps.mean()).max()) / state.roller.radius / strain


def _beyond(state: ContactState) -> tuple[float, float]:
    """Largest creep of what sticks (m/s), and friction beyond the cone (N)."""
    assert state.coefficient is not None
    touching = state.touching
    traction = np.linalg.norm(state.traction, axis=0)
    cone = state.coefficient * state.pressure
    slip = np.linalg.norm(state.slip, axis=0)
    sticks = touching & (traction < STICKS * cone)
    excess = np.maximum(traction - cone, 0.0) * state.area
    return float(slip[sticks].max(initial=0.0)), float(excess[touching].sum())
