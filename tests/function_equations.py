"""Equations for the path follower from plain residual functions."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from anmstrip.continuation.path import Equations
from anmstrip.taylor.series import RecordedFunction
from anmstrip.timestepping.index_one import TracedRecurrence


@dataclass(frozen=True)
class FunctionEquations(Equations):
    """R(u, λ) = 0 for :func:`anmstrip.continuation.follow.follow`."""

    function: Callable[[Any, Any], Any]  # of arrays (n,), () → (n,), written in numpy
    scale: float = 1.0  # change of u that counts as 1
    force: float = 1.0  # residual that counts as 1

    def recurrence(self, u, control, order):
        """Start the series at a point."""
        return TracedRecurrence(self._recorded, self, u, control, order)

    @cached_property
    def _recorded(self):
        return RecordedFunction(self.function)

    def arguments(self, u, control):
        """Return the unknowns and the control."""
        return u, control

    def changes(self, u, control):
        """Changes of the arguments."""
        return u, control if control else None

    def residual(self, u, control):
        """R(u, λ)."""
        return np.asarray(self.function(u, np.float64(control)))

    @property
    def metric(self):
        """Metric of changes in units of ``scale``."""
        return self.scale**-2

    def imbalance(self, residual):
        """Largest entry of a residual, in units of ``force``."""
        return float(np.abs(residual).max()) / self.force
