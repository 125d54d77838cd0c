"""What is read off a roller: forces, wrap, slip, tensions before and behind it."""

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
