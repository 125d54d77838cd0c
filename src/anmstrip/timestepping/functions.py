"""Equations for the time integrators from plain residual functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline

from anmstrip.arrays import Array
from anmstrip.taylor.series import RecordedFunction, recorded
from anmstrip.timestepping.formulas import AffineVelocity, RateEquations, StepEquations, TimeStep
from anmstrip.timestepping.index_one import TimePath, stretch


class Substitution(Protocol):
    """Arguments of a function as affine functions of the unknowns u and the control."""

    def arguments(self, u: Array, control: float) -> tuple[ArrayLike, ...]:
        """Values of the arguments."""

    def changes(self, u: Array | None, control: float) -> tuple[ArrayLike | None, ...]:
        """Changes of the arguments with changes of u, (*batch, n), and of the control."""


class TracedRecurrence:
    """Orders of a recorded residual in u and the control.

    Parameters
    ----------
    residual : RecordedFunction
    inputs : Substitution
        What the arguments of the residual are.
    u : ndarray, shape (n,)
    control : float
    order : int

    Attributes
    ----------
    residual : ndarray, shape (n,)
        Order 0.
    """

    def __init__(
        self, residual: RecordedFunction, inputs: Substitution, u: Array, control: float, order: int
    ) -> None:
        self.inputs, self.size = inputs, len(u)
        self.orders = residual.start(*inputs.arguments(u, control), order=order)
        self.residual = self.orders.value.ravel()

    def tangent(self) -> Array:
        """∂R/∂u, shape (n, n)."""
        unit = np.eye(self.size)
        found = self.orders.derivative(*self.inputs.changes(unit, 0.0))
        return found.reshape(self.size, self.size).T

    def control_derivative(self) -> Array:
        """∂R/∂λ, shape (n,)."""
        return self.orders.derivative(*self.inputs.changes(None, 1.0)).ravel()

    def advance(self, k: int) -> Array:
        """Order k of R as if u_k = 0 and λ_k = 0."""
        return self.orders.advance(k).ravel()

    def correct(self, k: int, u: Array, control: float) -> None:
        """Fix order k of the unknowns."""
        self.orders.correct(*self.inputs.changes(u, control))


class FunctionRateEquations(RateEquations):
    """R(u, v, t) = 0 with u' = v for :func:`anmstrip.timestepping.implicit.integrate`.

    Errors are changes of u in its own unit; a residual is measured by the change
    of u that takes it away, and counts against the share h/T of a step, as the
    error in time does.  In fast motion an error along the way is a shift in
    time: e at the velocity v counts as e/√(1 + |v|²/V²), the distance of the
    solutions as curves in (V t, u).

    Parameters
    ----------
    function : callable
        ``function(u, v, t)`` of arrays (n,), (n,), () → (n,), written in numpy.
    whole : float
        T, duration over which all errors may add up to the tolerance.
    speed : float
        V, from which on motion counts as fast; infinite for errors at equal times.
    """

    def __init__(
        self, function: Callable[[Any, Any, Any], Any], whole: float, speed: float = np.inf
    ) -> None:
        self.function = recorded(function)
        self.whole, self.speed = whole, speed
        self.latest: tuple[Array, AffineVelocity] | None = None

    def during(
        self, t: float, h: float, velocity: AffineVelocity, about: Array
    ) -> FunctionStepEquations:
        """The equations of the step from t to t + h, with λ ∈ [0, 1] as control."""
        self.latest = (about, velocity)
        return FunctionStepEquations(self, t, h, velocity, about)

    def dragged(self, t: float, u: Array, v: Array, time: float) -> FunctionRateEquations | None:
        """The same with a drag as large as friction at a speed of 1 in this time, if it moves."""
        if not v.any():
            return None
        fast = v / (np.abs(v).max() * time)
        friction = self.function(u, fast, t) - self.function(u, -fast, t)
        drag = 0.5 * float(friction @ fast) / float(fast @ fast)
        return FunctionRateEquations(
            lambda u, v, t: self.function(u, v, t) + v * drag, self.whole, self.speed
        )

    def error(self, u: Array, change: Array) -> float:
        """Largest change of the state, as a distance of curves."""
        assert self.latest is not None
        about, velocity = self.latest
        v = velocity(u - about, 1.0)
        return float(np.abs(change).max()) / stretch(v, self.speed)


class FunctionStepEquations(StepEquations):
    """One step of a formula, as equations for the increment u with λ as control."""

    def __init__(
        self,
        problem: FunctionRateEquations,
        t: float,
        h: float,
        velocity: AffineVelocity,
        about: Array,
    ) -> None:
        self.problem, self.t, self.h = problem, t, h
        self.velocity, self.about = velocity, about
        self.softness = np.eye(len(about))
        self.share = h / problem.whole if h > 0.0 else 1.0
        self.unit = self.share

    def arguments(self, u: Array, control: float) -> tuple[ArrayLike, ...]:
        """State, velocity and time."""
        return u + self.about, self.velocity(u, control), control * self.h + self.t

    def changes(self, u: Array | None, control: float) -> tuple[ArrayLike | None, ...]:
        """Changes of state, velocity and time."""
        moved = control * self.velocity.slope if control else None
        if u is None:
            return None, moved, control * self.h
        rate = u * self.velocity.rate
        return u, rate if moved is None else rate + moved, control * self.h if control else None

    def recurrence(self, u: Array, control: float, order: int) -> TracedRecurrence:
        """Start the series at a point; its tangent turns residuals into changes of u."""
        recurrence = TracedRecurrence(self.problem.function, self, u, control, order)
        tangent = recurrence.tangent()
        if np.isfinite(tangent).all():  # the linear solver tells of one that is not
            self.softness = np.abs(np.linalg.pinv(tangent))
        v = self.velocity(u, control)
        self.unit = self.share * stretch(v, self.problem.speed)
        return recurrence

    def unaccelerated(self) -> Array:
        """Increment with which the velocity stays."""
        return -self.velocity.slope / self.velocity.rate

    def resistance(self, u: Array, control: float) -> Callable[[Array], Array]:
        """∂R/∂v at a state, applied to changes of the velocity."""
        state, t, v = u + self.about, control * self.h + self.t, self.velocity(u, control)
        orders = self.problem.function.start(state, v, t)
        return lambda change: orders.derivative(None, change)

    def residual(self, u: Array, control: float) -> Array:
        """R at a point of the step."""
        return np.asarray(self.problem.function(*self.arguments(u, np.float64(control))))

    @property
    def metric(self) -> float:
        """Metric of changes in units of what the step may err."""
        return self.unit**-2

    def imbalance(self, residual: Array) -> float:
        """Change of u that takes a residual away, in units of what the step may err."""
        return float((self.softness @ np.abs(residual)).max()) / self.unit


def join_steps(
    u: Array, v: Array, steps: Sequence[TimeStep], tolerance: float, speed: float
) -> TimePath:
    """Steps of the implicit scheme joined by cubics.

    Parameters
    ----------
    u, v : ndarray, shape (n,)
        Start.
    steps : sequence of TimeStep
    tolerance : float
        In units of which their errors are given.
    speed : float
        V of the equations.
    """
    knots = np.array([steps[0].start, *(s.end for s in steps)])
    curve = CubicHermiteSpline(knots, [u, *(s.u for s in steps)], [v, *(s.v for s in steps)])
    share = np.diff(knots) / (knots[-1] - knots[0])
    stretches = np.array([stretch(s.v, speed) for s in steps])
    found = np.array([s.error * tolerance + s.imbalance for s in steps])
    return TimePath(curve, share * stretches * found, np.zeros(len(steps)))
