"""Backward difference formulas with variable steps, and protocols of time integration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.follow import PathSolver, follow
from anmstrip.continuation.path import Equations, lagrange
from anmstrip.taylor.polynomials import derivative_coefficients, value_at


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
class Errors:
    """Estimated errors of a state: by the formulas, by what their branches have left, by laws.

    An error e of u is one rate (e − e₀) of its velocity.
    """

    before: Array  # e₀ (2 + kinds of laws, n): at the start of the last step, with what it adds
    after: Array  # e, of the same shape
    rate: float  # of the formula


@dataclass(frozen=True)
class Memory:
    """Past of an integration, the latest first."""

    times: tuple[float, ...]
    states: tuple[Array, ...]  # each (n,)
    v: Array  # velocity at the latest instant
    step: float  # length to try next
    order: int = 1  # of the formula to try next
    errors: Errors | None = None  # of the latest state; None for zero
    settled: bool = True  # whether the velocity belongs to a latest state in equilibrium

    @property
    def available(self) -> int:
        """Order of the formula that the past allows."""
        return len(self.times)


def start_memory(t: float, u: Array, v: Array, step: float, errors: Errors | None = None) -> Memory:
    """Memory of an integration that begins."""
    return Memory((t,), (u,), v, step, errors=errors, settled=False)


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
    distance = new - np.array(times[:order])
    return -lagrange(times[:order], new) / distance, float((1.0 / distance).sum())


class StepEquations(Equations, Protocol):
    """The equations of one time step, R(u, v(u, λ), t + λ h) = 0, for the increment u.

    1. At λ = 0 the increment 0 solves them up to the imbalance of the state before.
    2. ``resistance`` is the derivative of the same R that ``residual`` gives.
    """

    def resistance(self, u: Array, control: float) -> Callable[[Array], Array]:
        """∂R/∂v at a state: from a change of the velocity to one of R, shape (n,) both."""

    def turned(self, u: Array) -> float:
        """Resistance that may be wrong, for slip turns round within the step, in units of force.

        None by default: every error in time then counts as one that lasts or fades.
        """
        return 0.0

    def let_turn(self, u: Array, resistance: Callable[[Array], Array], tolerance: float) -> Array:
        """The increment at λ = 1 with bodies that turn freely at the speeds that they ask for.

        ``resistance`` is that there; the tolerance is one of imbalances.  As it is by default.
        """
        return u

    def sharpenings(self, u: Array, control: float) -> list[Array]:
        """Derivatives of R by a share by which regularised laws come nearer to the sharp ones.

        One for each kind of law whose errors are told apart, at any time as many.
        """
        return []


class RateEquations(Protocol):
    """A problem R(u, v, t) = 0, u' = v, whose residual depends on velocities.

    1. ``during`` gives a step's equations, with λ ∈ [0, 1] as control; their unknown, and that of
       ``velocity``, is the increment from ``about``: of a short step it is far smaller than the
       state, whose round-off divided by h would be seen in the velocity.  For h = 0 nothing given
       moves, and λ only takes an imbalance away.
    2. ``error`` and ``fading_error`` measure the same change: what of it lasts, and those of its
       consequences that the motion forgets.  Both are in the scales of the tolerance, and are
       asked for after ``during``.
    3. ``dragged`` is asked for where no velocity balances the forces.
    """

    def during(self, t: float, h: float, velocity: AffineVelocity, about: Array) -> StepEquations:
        """The equations of the step from t to t + h."""

    def error(self, u: Array, change: Array) -> float:
        """Size of an error ``change`` of the state u that lasts."""

    def fading_error(self, u: Array, change: Array) -> float:
        """Size of the consequences of ``change`` that the motion forgets; none by default."""
        return 0.0

    def abrupt_error(self, u: Array, change: Array) -> float:
        """Size of those consequences that may begin at a moment, without a derivative; none."""
        return 0.0

    def dragged(self, t: float, u: Array, v: Array, time: float) -> RateEquations | None:
        """The same with a drag that lasts so long: as large as the problem's forces where a
        motion as large as the problem takes this time; None, the default, if none can be told."""
        return None


@dataclass(frozen=True)
class Stepping:
    """Choices of the integration in time."""

    whole: float  # duration over which the errors may add up to the tolerance
    tolerance: float  # error in time: of all steps together what lasts, of each what fades
    order: int = 2  # highest order of the formula, 1 to 5
    fixed: float | None = None  # length of all steps, whose error is then not controlled
    follow: PathSolver = follow  # leads from λ = 0 to 1


@dataclass(frozen=True)
class TimeStep:
    """One accepted step in time."""

    start: float
    end: float
    u: Array  # state at the end, (n,)
    v: Array  # velocity there, (n,)
    order: int  # of the formula
    error: float  # estimated local error, over what is allowed
    imbalance: float  # residual at the end, in units of the problem's forces
    branches: int  # tangents that the step took
    memory: Memory  # what a later call needs to go on as if never interrupted
    snap: bool = False  # whether it holds a motion with drag, whose duration means nothing
    solved: Callable[[float], tuple[Array, Array] | None] | None = None  # see :meth:`at`

    @cached_property
    def series(self) -> Array:
        """Polynomial of the formula in the part of the step that has passed, (order + 1, n)."""
        past, number = self.memory, self.order + 1
        places = (np.array(past.times[:number]) - self.start) / (self.end - self.start)
        changes = np.array(past.states[:number]) - self.u
        orders = np.linalg.solve(np.vander(places, increasing=True), changes)
        orders[0] += self.u
        return np.asarray(orders)

    def at(self, time: float) -> tuple[Array, Array]:
        """State and velocity at an instant inside: solved for, or else on the polynomial.

        What stiffness decides is in equilibrium at any time, and may be far from the polynomial.
        """
        if self.solved is not None and (found := self.solved(time)) is not None:
            return found
        h = self.end - self.start
        s = (time - self.start) / h
        return value_at(self.series, s), value_at(derivative_coefficients(self.series), s) / h
