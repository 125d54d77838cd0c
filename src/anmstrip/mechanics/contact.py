"""Contact of the strip with one roller, with or without friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import ContactOperator
from .friction import FrictionLaw
from .roller import Roller
from .signorini import RepulsiveSignorini

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ContactState:
    """What a roller does to the points of the strip.

    Attributes
    ----------
    gap : shape (points,), m
    normal : shape (3, points)
    pressure : shape (points,), Pa
    slip : shape (3, points), m/s, or None without friction
    traction : shape (3, points), Pa, or None without friction
    """

    gap: Any
    normal: Any
    pressure: Any
    slip: Any = None
    traction: Any = None


class Contact:
    """Tractions R n + R_T of a roller at points of the strip.

    Controls: ``rollers.NAME.centre`` (m), and with friction also
    ``rollers.NAME.surface_speed`` (m/s) and ``rollers.NAME.velocity`` (m/s, of the
    centre).

    Parameters
    ----------
    roller : Roller
    signorini : RepulsiveSignorini
        In pressures.
    friction : NortonHoff or Tanh or None
    operator : ContactOperator
    """

    def __init__(
        self,
        roller: Roller,
        signorini: RepulsiveSignorini,
        friction: FrictionLaw | None,
        operator: ContactOperator,
    ) -> None:
        self.roller, self.signorini, self.friction = roller, signorini, friction
        self.operator = operator

    @property
    def name(self) -> str:
        """For reports."""
        kind = "contact" if self.friction is None else "contact with friction"
        return f"{kind} on {self.roller.name}"

    @property
    def rate_dependent(self) -> bool:
        """Friction looks at the velocity."""
        return self.friction is not None

    def state(self, u: Any, v: Any, controls: Mapping[str, Any]) -> ContactState:
        """Gap, pressure and friction of displaced points, on arrays or series."""
        key = f"rollers.{self.roller.name}"
        gap, normal = self.roller.gap(u + self.operator.reference, controls[f"{key}.centre"])
        pressure = self.signorini(gap)
        if self.friction is None:
            return ContactState(gap, normal, pressure)
        surface = self.roller.surface_velocity(
            normal, controls[f"{key}.surface_speed"], controls[f"{key}.velocity"]
        )
        relative = v - surface
        slip = relative - normal * np.einsum("i...,i...->...", relative, normal)
        return ContactState(gap, normal, pressure, slip, self.friction(pressure, slip))

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Residual per area: minus the traction that the roller exerts, (3, points)."""
        state = self.state(x, v, controls)
        pushed = state.normal * state.pressure
        return -pushed if state.traction is None else -(pushed + state.traction)
