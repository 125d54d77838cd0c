"""An elastic foundation that carries the strip, as an air cushion or a felt does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from anmstrip.fem.sampling import ContactOperator
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.effects import LawEffect


class Foundation(LawEffect):
    """The pressure −k w against the displacement w along z (Winkler 1867).

    Parameters
    ----------
    strip : Strip
    stiffness : float
        k (Pa/m).
    """

    name = "foundation"

    def __init__(self, strip: Strip, stiffness: float) -> None:
        self.operator, self.stiffness = ContactOperator(strip), stiffness
        height = [component == 2 for component in strip.kinematics.components]
        self.upwards = np.array(height, dtype=float)[:, None]

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Return the residual per area, k w along z, shape (components, points)."""
        return x * self.upwards * self.stiffness
