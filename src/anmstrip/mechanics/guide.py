"""A surface that a strip may slide along but not leave: it straightens out a first guess."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import jets
from .strip import Strip

Array = NDArray[np.float64]


class Guide:
    """Springs along the normals of a state of a shell: residual k n (n · (u − u_0)).

    Along the surface nothing holds the strip, so that the membrane can relax there without
    buckling.

    Parameters
    ----------
    strip : Strip
        A shell.
    full : ndarray, shape (unknowns,)
        The state u_0 whose surface guides.
    """

    name = "guide"
    rate_dependent = False

    def __init__(self, strip: Strip, full: Array) -> None:
        self.operator = jets(strip)
        at = self.operator.apply(full)
        tangents = at[:, 1:] + strip.kinematics.flat
        normal = np.cross(tangents[:, 0], tangents[:, 1], axis=0)
        self.start: Array = at[:, 0]
        self.normal: Array = normal / np.linalg.norm(normal, axis=0)
        self.stiffness = strip.membrane_stiffness / float(strip.cell_sizes.min()) ** 2

    def near(self, full: Array, controls: Mapping[str, Any]) -> Guide:
        """Everywhere."""
        return self

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Generalised stress, (3, 3, points): the value's part alone."""
        away = np.einsum("i...,i...->...", self.normal, x[:, 0] - self.start)
        return np.einsum("i...,a->ia...", self.normal * away * self.stiffness, np.eye(3)[0])
