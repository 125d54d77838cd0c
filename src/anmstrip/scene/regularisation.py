"""What regularised contact and friction cost in truth, read off a state.

Regularised friction lets creep what sticks, and Norton and Hoff's is not bounded by f; a
regularised roller is softer than steel.  Each has an effect on the tension of the strip, which
is estimated here as a share of it; the estimates are of the order of the errors, not bounds.

A gap that is the same all across is another radius.  One that differs between two fibres of a
shell, over a crown for instance, lets them go ways of different length, and stretches one by the
difference over the radius, beside T/(E t).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anmstrip.scene.readings import ContactState, RollerReading

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
