"""Steps in time: the equations that are integrated, how, and what a step gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .backward_differences import AffineVelocity, Memory
from .continuation import PathSolver, follow
from .expansion import Equations

Array = NDArray[np.float64]


class StepEquations(Equations, Protocol):
    """The equations of one time step."""

    def resistance(self, u: Array, control: float) -> Callable[[Array], Array]:
        """∂R/∂v at a state: from a change of the velocity to one of R, shape (n,) both."""

    def turned(self, u: Array) -> float:
        """Resistance that may be wrong, for slip turns round within the step, in units of force."""


class RateEquations(Protocol):
    """A problem whose residual depends on velocities."""

    def during(self, t: float, h: float, velocity: AffineVelocity, about: Array) -> StepEquations:
        """The equations of the step from t to t + h, with λ ∈ [0, 1] as control.

        Their unknown, and that of ``velocity``, is the increment from ``about``: of a short
        step it is far smaller than the state, whose round-off divided by h would be seen
        in the velocity.  For h = 0 nothing given moves, and λ only takes an imbalance away.
        """

    def dragged(self, t: float, u: Array, v: Array, time: float) -> RateEquations | None:
        """The same with a drag that lasts so long: as large as the problem's forces where a
        motion as large as the problem takes this time; None if none can be told."""

    def error(self, u: Array, change: Array) -> float:
        """Size of an error ``change`` of the state u that lasts, in the problem's scales."""

    def fading_error(self, u: Array, change: Array) -> float:
        """Size of those consequences of ``change`` that the motion forgets, likewise."""


@dataclass(frozen=True)
class Stepping:
    """How time is stepped.

    Attributes
    ----------
    whole : float
        Duration over which the errors may add up to the tolerance.
    order : int
        Highest order of the formula, 1 to 5.
    fixed : float or None
        Length of all steps, of the highest order that the past allows; their error in time
        is estimated but not controlled.
    follow : callable
        What leads from λ = 0 to 1.
    """

    whole: float
    order: int = 2
    fixed: float | None = None
    follow: PathSolver = follow


@dataclass(frozen=True)
class TimeStep:
    """One accepted step.

    Attributes
    ----------
    start, end : float
        Times.
    u, v : ndarray, shape (n,)
        State and velocity at ``end``.
    order : int
        Of the formula.
    error : float
        Estimated local error, over what is allowed.
    imbalance : float
    branches : int
        Tangents that the step took.
    memory : Memory
        What a later call needs to go on as if never interrupted.
    snap : bool
        Whether it holds a motion that time does not tell, see :mod:`anmstrip.series.snaps`.
    """

    start: float
    end: float
    u: Array
    v: Array
    order: int
    error: float
    imbalance: float
    branches: int
    memory: Memory
    snap: bool = False
