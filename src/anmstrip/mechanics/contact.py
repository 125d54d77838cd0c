"""Contact of the strip with one roller: normal pressure, and friction.

Both are looked at near the roller only.  Beyond a gap where the regularised
pressure is negligible a point is left out, and with it the singularities of its
series, which would shorten every step for a force that nobody sees.

Everything is computed in the roller's frame, see :mod:`anmstrip.mechanics.roller`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .friction import FrictionLaw
from .kinematics import SHELL, Kinematics
from .points import ContactOperator
from .roller import Place, Roller
from .signorini import RepulsiveSignorini

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Contact:
    """Normal tractions R n of a roller at points of the strip.

    Control: ``rollers.NAME.centre`` (m).

    Attributes
    ----------
    roller : Roller
    signorini : RepulsiveSignorini
        In pressures.
    operator : ContactOperator
    reach : float
        Gap (m) beyond which a point is left out.
    kinematics : Kinematics
        Which displacements the points have.
    """

    roller: Roller
    signorini: RepulsiveSignorini
    operator: ContactOperator
    reach: float = np.inf
    kinematics: Kinematics = SHELL

    rate_dependent = False

    @property
    def name(self) -> str:
        """For reports."""
        return f"contact on {self.roller.name}"

    @cached_property
    def least(self) -> Array:
        """Pressure at the reach, taken off everywhere so that contact begins without a jump."""
        return self.signorini(np.array(self.reach)) if np.isfinite(self.reach) else np.array(0.0)

    @cached_property
    def view(self) -> Array:
        """The strip's components in the roller's frame, shape (rows, components)."""
        return self.roller.frame[: self.roller.rows] @ self.kinematics.chosen.T

    @cached_property
    def origin(self) -> Array:
        """Reference positions in the roller's frame, shape (rows, points)."""
        return self.roller.frame[: self.roller.rows] @ self.operator.reference

    def seen(self, x: Any, controls: Mapping[str, Any]) -> Place:
        """Where displaced points are, on arrays or series."""
        centre = controls[f"rollers.{self.roller.name}.centre"]
        moved = (self.roller.frame[: self.roller.rows] @ centre)[:, None]
        offset = self.origin - moved
        return self.roller.seen(np.einsum("ic,c...->i...", self.view, x) + offset)

    def near(self, full: Array, controls: Mapping[str, Any]) -> Contact:
        """The same effect on the points within reach."""
        gap = self.seen(self.operator.apply(full), controls).gap
        return replace(self, operator=self.operator.restricted(np.flatnonzero(gap < self.reach)))

    def pressure(self, place: Place) -> Any:
        """R (Pa), shape (points,)."""
        return self.signorini(place.gap) - self.least

    def normal(self, place: Place) -> Array:
        """Unit normal in space, shape (3, points)."""
        return self.roller.frame[: self.roller.rows].T @ self.roller.normal(place)

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Residual per area: minus the traction of the roller, (components, points)."""
        place = self.seen(x, controls)
        traction = self.roller.normal(place) * self.pressure(place)
        return np.einsum("ic,i...->c...", -self.view, traction)


@dataclass(frozen=True)
class Friction:
    """Tangential tractions R_T of a roller at points of the strip.

    The slip has one component along the direction of turning and, in space, one along
    the meridian.  Controls: ``rollers.NAME.centre`` (m), ``rollers.NAME.surface_speed``
    (m/s, of the profile where it has the nominal radius) and ``rollers.NAME.velocity``
    (m/s, of the centre).

    Attributes
    ----------
    contact : Contact
        Gives gap and pressure; its reach is that of friction.
    law_of_slip : NortonHoff or Tanh
    """

    contact: Contact
    law_of_slip: FrictionLaw

    rate_dependent = True

    @property
    def roller(self) -> Roller:
        """Of the contact."""
        return self.contact.roller

    @property
    def name(self) -> str:
        """For reports."""
        return f"friction on {self.roller.name}"

    @property
    def operator(self) -> ContactOperator:
        """Of the contact."""
        return self.contact.operator

    @cached_property
    def frame(self) -> Array:
        """Directions in which points move, of the roller's frame, shape (2 or 3, 3)."""
        return self.roller.frame[: self.contact.kinematics.count]

    @cached_property
    def view(self) -> Array:
        """The strip's components in this frame."""
        return self.frame @ self.contact.kinematics.chosen.T

    def near(self, full: Array, controls: Mapping[str, Any]) -> Friction:
        """The same effect on the points within reach."""
        return replace(self, contact=self.contact.near(full, controls))

    def tangents(self, place: Place) -> Any:
        """Directions of slip in the frame, (components of slip, directions, points)."""
        return self.roller.tangents(place, len(self.frame))

    def slip(self, place: Place, tangents: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Tangential velocity relative to the surface (m/s), (components of slip, points)."""
        key = f"rollers.{self.roller.name}"
        own = (self.frame @ controls[f"{key}.velocity"])[:, None]
        relative = np.einsum("ic,c...->i...", self.view, v) - own
        speed = controls[f"{key}.surface_speed"]
        turning = np.eye(len(self.frame) - 1)[0][:, None]
        surface = (turning if place.ratio is None else place.ratio * turning) * speed
        return np.einsum("ki...,i...->k...", tangents, relative) - surface

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Residual per area: minus the traction of the roller, (components, points)."""
        place = self.contact.seen(x, controls)
        tangents = self.tangents(place)
        pressure = self.contact.pressure(place)
        traction = self.law_of_slip(pressure, self.slip(place, tangents, v, controls))
        local = np.einsum("ki...,k...->i...", tangents, traction)
        return np.einsum("ic,i...->c...", -self.view, local)

    def in_space(self, x: Array, v: Array, controls: Mapping[str, Any]) -> tuple[Array, Array]:
        """Slip (m/s) and traction (Pa) in space, shape (3, points) each."""
        place = self.contact.seen(x, controls)
        tangents = self.tangents(place)
        slip = self.slip(place, tangents, v, controls)
        traction = self.law_of_slip(self.contact.pressure(place), slip)
        directions = np.einsum("kip,ix->kxp", tangents, self.frame)
        along, across = (np.einsum("kxp,kp->xp", directions, s) for s in (slip, traction))
        return along, across
