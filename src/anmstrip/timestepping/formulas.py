"""Backward difference formulas with variable steps, and protocols of time integration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Equations
from anmstrip.continuation.follow import PathSolver, follow

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AffineVelocity:
    """v(u, λ) = rate u + base + λ slope."""

    rate: float
    base: Array
    slope: Array

    def __call__(self, u: Array, control: float) -> Array:
        """Velocity, shape (n,)."""
        return self.rate * u + self.base + control * self.slope


@dataclass(frozen=True)
class Memory:
    """Past of an integration: times and states, the latest first; next step and order to try."""

    times: tuple[float, ...]
    states: tuple[Array, ...]
    v: Array
    step: float
    order: int = 1

    @property
    def available(self) -> int:
        """Order of the formula that the past allows."""
        return len(self.times)


def start_memory(t: float, u: Array, v: Array, step: float) -> Memory:
    """Memory of an integration that begins."""
    return Memory((t,), (u,), v, step)


def formula(times: tuple[float, ...], new: float, order: int) -> tuple[Array, float]:
    """Weights of a backward difference formula with variable steps.

    Parameters
    ----------
    times : tuple of float
        Past instants, the latest first; at least ``order`` of them.
    new : float
    order : int

    Returns
    -------
    past : ndarray, shape (order,)
        v = rate u + Σ past_j u(times_j) is the derivative at ``new`` of the
        polynomial through the new and ``order`` past states.
    rate : float
    """
    nodes = np.array(times[:order])
    distance = new - nodes
    rate = float((1.0 / distance).sum())
    past = np.empty(order)
    for j in range(order):
        others = np.delete(np.arange(order), j)
        past[j] = -np.prod(distance[others] / (nodes[j] - nodes[others])) / distance[j]
    return past, rate


def predicted(times: tuple[float, ...], states: tuple[Array, ...], new: float) -> Array:
    """Value at ``new`` of the polynomial through all given past states."""
    nodes = np.array(times)
    total = np.zeros_like(states[0])
    for j, state in enumerate(states):
        others = np.delete(nodes, j)
        total += np.prod((new - others) / (nodes[j] - others)) * state
    return total


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
        Whether it holds a motion that time does not tell, see :mod:`anmstrip.timestepping.implicit`.
    """  # noqa: E501

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
