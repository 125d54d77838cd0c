"""Contact of the strip's nodes with one roller, with or without friction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import NodeOperator
from .friction import FrictionLaw
from .roller import Roller
from .signorini import RepulsiveSignorini

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ContactState:
    """What a roller does to the nodes.

    Attributes
    ----------
    gap : shape (nodes,), m
    normal : shape (3, nodes)
    pressure : shape (nodes,), Pa
    slip : shape (3, nodes), m/s, or None without friction
    traction : shape (3, nodes), Pa, or None without friction
    """

    gap: Any
    normal: Any
    pressure: Any
    slip: Any = None
    traction: Any = None


class Contact:
    """Node-to-roller contact: tractions R n + R_T per tributary area.

    Controls: ``rollers.NAME.centre`` (m), and with friction also
    ``rollers.NAME.surface_speed`` (m/s) and ``rollers.NAME.velocity`` (m/s, of the
    centre).

    Parameters
    ----------
    roller : Roller
    signorini : RepulsiveSignorini
        In pressures.
    friction : NortonHoff or Tanh or None
    operator : NodeOperator
    nodes : ndarray, shape (3, nodes)
        Reference positions.
    """

    def __init__(
        self,
        roller: Roller,
        signorini: RepulsiveSignorini,
        friction: FrictionLaw | None,
        operator: NodeOperator,
        nodes: Array,
    ) -> None:
        self.roller, self.signorini, self.friction = roller, signorini, friction
        self.operator, self.nodes = operator, nodes

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
        """Gap, pressure and friction of displaced nodes, on arrays or series."""
        key = f"rollers.{self.roller.name}"
        gap, normal = self.roller.gap(u + self.nodes, controls[f"{key}.centre"])
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
        """Residual per area: minus the traction that the roller exerts, (3, nodes)."""
        state = self.state(x, v, controls)
        pushed = state.normal * state.pressure
        return -pushed if state.traction is None else -(pushed + state.traction)
