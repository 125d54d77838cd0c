"""Equations for the path follower and the time integrators from plain residual functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.path import HermitePath
from anmstrip.series.power_series import Series, Tape, taylor
from anmstrip.timestepping.formulas import AffineVelocity, TimeStep
from anmstrip.timestepping.index_one import stretch

Array = NDArray[np.float64]


class TracedRecurrence:
    """Orders of a residual that was traced on series of u and of the control.

    The residual may look at u in another shape than that of a vector, and answers in it.

    Attributes
    ----------
    residual : ndarray, shape (n,)
        Order 0.
    """

    def __init__(
        self,
        residual: Callable[[Any, Any], Any],
        u: Array,
        control: float,
        order: int,
        shape: tuple[int, ...] = (-1,),
    ) -> None:
        self.tape = Tape(order)
        self.u, self.control = self.tape.variable(u.reshape(shape)), self.tape.variable(control)
        self.output: Series = residual(self.u, self.control)
        self.residual = self.output.value.ravel()

    def tangent(self) -> Array:
        """∂R/∂u, shape (n, n)."""
        n = self.u.value.size
        unit = np.eye(n).reshape(n, *self.u.shape)
        return self.tape.derivative(self.output, {self.u: unit}).reshape(n, n).T

    def control_derivative(self) -> Array:
        """∂R/∂λ, shape (n,)."""
        return self.tape.derivative(self.output, {self.control: np.array(1.0)}).ravel()

    def advance(self, k: int) -> Array:
        """Order k of R as if u_k = 0 and λ_k = 0."""
        self.tape.advance(k)
        return self.output.coefficients[k].flatten()

    def correct(self, k: int, u: Array, control: float) -> None:
        """Fix order k of the unknowns."""
        if k == 1:
            self.tape.advance(1)
        self.tape.correct(k, {self.u: u.reshape(self.u.shape), self.control: np.array(control)})


@dataclass(frozen=True)
class FunctionEquations:
    """R(u, λ) = 0 for :func:`anmstrip.continuation.follow.follow`.

    Attributes
    ----------
    function : callable
        ``function(u, control)`` of arrays (n,), () → (n,), written in numpy.
    scale : float
        Change of u that counts as 1.
    force : float
        Residual that counts as 1.

    Examples
    --------
    >>> from anmstrip.continuation.follow import Settings, follow
    >>> from anmstrip.linalg.solvers import DenseSolver
    >>> cubic = FunctionEquations(lambda u, load: u + u * u * u - load)
    >>> *_, last = follow(
    ...     cubic, np.zeros(1), solver=DenseSolver(), settings=Settings(tolerance=1e-10), target=2.0
    ... )
    >>> float(last.branch.end[0][0].round(9))
    1.0
    """

    function: Callable[[Any, Any], Any]
    scale: float = 1.0
    force: float = 1.0

    def recurrence(self, u: Array, control: float, order: int) -> TracedRecurrence:
        """Start the series at a point."""
        return TracedRecurrence(self.function, u, control, order)

    def residual(self, u: Array, control: float) -> Array:
        """R(u, λ)."""
        return np.asarray(self.function(u, np.float64(control)))

    @property
    def metric(self) -> float:
        """Of changes in units of ``scale``."""
        return self.scale**-2

    def imbalance(self, residual: Array) -> float:
        """Largest entry of a residual, in units of ``force``."""
        return float(np.abs(residual).max()) / self.force


class FunctionRateEquations:
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
        self.function, self.whole, self.speed = function, whole, speed
        self.latest: tuple[Array, AffineVelocity] | None = None

    def during(self, t: float, h: float, velocity: AffineVelocity, about: Array) -> StepEquations:
        """The equations of the step from t to t + h, with λ ∈ [0, 1] as control."""
        self.latest = (about, velocity)
        return StepEquations(self, t, h, velocity, about)

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

    def fading_error(self, u: Array, change: Array) -> float:
        """Nothing: every change counts as lasting."""
        return 0.0


class StepEquations:
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
        self.softness = np.zeros((0, 0))
        self.share = h / problem.whole if h > 0.0 else 1.0
        self.unit = self.share

    def _function(self, u: Any, control: Any) -> Any:
        velocity = u * self.velocity.rate + self.velocity.base + control * self.velocity.slope
        return self.problem.function(u + self.about, velocity, control * self.h + self.t)

    def recurrence(self, u: Array, control: float, order: int) -> TracedRecurrence:
        """Start the series at a point; its tangent turns residuals into changes of u."""
        recurrence = TracedRecurrence(self._function, u, control, order)
        self.softness = np.abs(np.linalg.pinv(recurrence.tangent()))
        v = self.velocity(u, control)
        self.unit = self.share * stretch(v, self.problem.speed)
        return recurrence

    def resistance(self, u: Array, control: float) -> Callable[[Array], Array]:
        """∂R/∂v at a state, applied to changes of the velocity."""
        state, t, v = u + self.about, control * self.h + self.t, self.velocity(u, control)
        return lambda change: taylor(lambda s: self.problem.function(state, s, t), [v, change])[1]

    def turned(self, u: Array) -> float:
        """Nothing: every error lasts."""
        return 0.0

    def residual(self, u: Array, control: float) -> Array:
        """R at a point of the step."""
        return np.asarray(self._function(u, np.float64(control)))

    @property
    def metric(self) -> float:
        """Of changes in units of what the step may err."""
        return self.unit**-2

    def imbalance(self, residual: Array) -> float:
        """Change of u that takes a residual away, in units of what the step may err."""
        return float((self.softness @ np.abs(residual)).max()) / self.unit


class ImplicitSolution(HermitePath):
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

    Attributes
    ----------
    knots : ndarray, shape (m + 1,)
    errors, passing : ndarray, shape (m,)
        What each step adds to the error of u at equal times; nothing is passing.
    """

    def __init__(
        self, u: Array, v: Array, steps: Sequence[TimeStep], tolerance: float, speed: float
    ) -> None:
        times = [steps[0].start, *(s.end for s in steps)]
        super().__init__(times, [u, *(s.u for s in steps)], [v, *(s.v for s in steps)])
        self.knots = self.times
        share = np.diff(self.times) / (times[-1] - times[0])
        stretched = np.array([stretch(s.v, speed) for s in steps])
        found = np.array([s.error * tolerance + s.imbalance for s in steps])
        self.errors = share * stretched * found
        self.passing = np.zeros(len(steps))
