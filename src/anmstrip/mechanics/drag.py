"""Drag: a force against every velocity, as of a strip in a viscous fluid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .effects import Operator


@dataclass(frozen=True)
class Drag:
    """Residual c v per area.

    Attributes
    ----------
    operator : Operator
        Values at points, with areas as weights.
    coefficient : float
        c (Pa s/m).
    """

    operator: Operator
    coefficient: float

    name = "drag"
    rate_dependent = True

    def near(self, full: Any, controls: Mapping[str, Any]) -> Drag:
        """Everywhere."""
        return self

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """c v, (components, points)."""
        return v * self.coefficient
