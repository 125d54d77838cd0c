"""Contact of the strip with one roller: normal pressure, and friction.

Both are looked at near the roller only.  Beyond a gap where the regularised
pressure is negligible a point is left out, and with it the singularities of its
series, which would shorten every step for a force that nobody sees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import ContactOperator
from .friction import FrictionLaw
from .roller import Roller
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
    """

    roller: Roller
    signorini: RepulsiveSignorini
    operator: ContactOperator
    reach: float = np.inf

    rate_dependent = False

    @property
    def name(self) -> str:
        """For reports."""
        return f"contact on {self.roller.name}"

    @cached_property
    def least(self) -> Array:
        """Pressure at the reach, taken off everywhere so that contact begins without a jump."""
        return self.signorini(np.array(self.reach)) if np.isfinite(self.reach) else np.array(0.0)

    def near(self, full: Array, controls: Mapping[str, Any]) -> Contact:
        """The same effect on the points within reach."""
        x = self.operator.apply(full) + self.operator.reference
        gap, _ = self.roller.gap(x, controls[f"rollers.{self.roller.name}.centre"])
        return replace(self, operator=self.operator.restricted(np.flatnonzero(gap < self.reach)))

    def pressure(self, x: Any, controls: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        """Gap (m), normal and pressure (Pa) of displaced points, on arrays or series."""
        position = x + self.operator.reference
        gap, normal = self.roller.gap(position, controls[f"rollers.{self.roller.name}.centre"])
        return gap, normal, self.signorini(gap) - self.least

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Residual per area: minus the traction of the roller, (3, points)."""
        _, normal, pressure = self.pressure(x, controls)
        return -(normal * pressure)


@dataclass(frozen=True)
class Friction:
    """Tangential tractions R_T of a roller at points of the strip.

    Controls: ``rollers.NAME.centre`` (m), ``rollers.NAME.surface_speed`` (m/s) and
    ``rollers.NAME.velocity`` (m/s, of the centre).

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

    def near(self, full: Array, controls: Mapping[str, Any]) -> Friction:
        """The same effect on the points within reach."""
        return replace(self, contact=self.contact.near(full, controls))

    def slip(self, normal: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Tangential velocity relative to the surface (m/s), (3, points)."""
        key = f"rollers.{self.roller.name}"
        relative = v - self.roller.surface_velocity(
            normal, controls[f"{key}.surface_speed"], controls[f"{key}.velocity"]
        )
        return relative - normal * np.einsum("i...,i...->...", relative, normal)

    def traction(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """R_T (Pa), shape (3, points)."""
        _, normal, pressure = self.contact.pressure(x, controls)
        return self.law_of_slip(pressure, self.slip(normal, v, controls))

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Residual per area: minus the traction of the roller, (3, points)."""
        return -self.traction(x, v, controls)
