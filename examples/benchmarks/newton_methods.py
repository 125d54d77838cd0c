"""Newton's method with adaptive steps, as good as we can make it: what the series are measured by.

The same equations, tangents and linear solver as the series have: steps of load, steps along an
arc, and backward Euler in fixed steps of time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.equations import Cost, Equations, Outcome, PathStopped, inner
from anmstrip.continuation.follow import Pace, PathStep, Settings
from anmstrip.continuation.newton import Corrected, Corrections, Newton
from anmstrip.continuation.path import Branch
from anmstrip.linalg.direct import SingularTangentError
from anmstrip.linalg.solvers import LinearSolver
from anmstrip.timestepping.formulas import AffineVelocity, RateEquations, StepEquations, predicted

Array = NDArray[np.float64]

# steps of load ---------------------------------------------------------------------


@dataclass(frozen=True)
class NewtonSettings(Corrections):
    """Choices of Newton's method in steps of load; every part can be switched off."""

    first: float = 0.1  # load step, as a fraction of the whole way
    wanted: int = 8  # iterations for which the next step stays as long
    growth: float = 2.0  # largest ratio of successive steps
    shortest: float = 1e-6  # load step, as a fraction of the whole way
    degree: int = 0  # of the polynomial that guesses the next state; 0 starts from the last one


def load_steps(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: NewtonSettings | None = None,
    start: float = 0.0,
    target: float = 1.0,
    cost: Cost | None = None,
) -> Iterator[Corrected]:
    """Yield converged states on the way from (u, start) to the control ``target``.

    The next state is guessed by the polynomial through the last ones; steps grow and shrink with
    the iterations that they take, and one that does not converge is halved.  ``cost`` counts the
    iterations of steps that are given up as well.

    Raises
    ------
    PathStopped
        If load steps have become too short.
    """
    settings = settings or NewtonSettings()
    iteration = Newton(equations, solver, settings, Cost() if cost is None else cost)
    past, whole = [(start, u)], target - start
    size = settings.first * whole
    while past[0][0] != target:
        control = past[0][0]
        last = abs(size) >= abs(target - control) * (1.0 - 1e-9)
        aim = target if last else control + size
        times, states = zip(*past, strict=True)
        found = iteration.corrected(predicted(times, states, aim), aim)
        if found is None:
            size = 0.5 * (aim - control)
            if abs(size) < settings.shortest * abs(whole):
                raise PathStopped(Outcome.STALLED, control, "Newton's method does not converge")
            continue
        past = [(found.control, found.u), *past[: settings.degree]]
        easy = np.sqrt(settings.wanted / max(found.iterations, 1))
        size *= float(np.clip(easy, 0.5, settings.growth))
        yield found


@dataclass(frozen=True)
class NewtonPath:
    """Newton's method in the place of the function ``follow`` of the series.

    The path of a time step starts where the velocity stays what it was, and is one load step.
    """

    settings: NewtonSettings

    def __call__(
        self,
        equations: Equations,
        u: Array,
        *,
        solver: LinearSolver,
        settings: Settings,
        start: float = 0.0,
        target: float = 1.0,
        pace: Pace | None = None,
        cost: Cost | None = None,
    ) -> Iterator[PathStep]:
        """Yield converged states, as straight branches from one to the next."""
        cost = Cost() if cost is None else cost
        velocity = getattr(equations, "velocity", None)
        if velocity is not None:
            u = u - velocity.slope / velocity.rate
            found = Newton(equations, solver, self.settings, cost).corrected(u, 1.0)
            if found is None:
                raise PathStopped(Outcome.STALLED, 0.0, "Newton's method does not converge")
            yield _straight(u, 0.0, found)
            return
        control = start if pace is None else pace.control
        ends = {"start": control, "target": target}
        for found in load_steps(
            equations, u, solver=solver, settings=self.settings, cost=cost, **ends
        ):
            yield _straight(u, control, found)
            u, control = found.u, found.control


def _straight(u: Array, control: float, found: Corrected) -> PathStep:
    ways = np.array([u, found.u - u]), np.array([control, found.control - control])
    branch = Branch(u=ways[0], control=ways[1], length=1.0, residual=np.zeros_like(u))
    return PathStep(branch, found.imbalance, Pace(found.control, found.control - control))


# steps along an arc ----------------------------------------------------------------


@dataclass(frozen=True)
class RiksSettings:
    """Choices of Newton's method along an arc."""

    tolerance: float = 1e-6  # largest imbalance of a converged state
    first: float = 0.1  # step along the arc
    shortest: float = 1e-6
    sharpest: float = 0.5  # cosine of the largest angle between a step and the path at its ends
    wanted: int = 5  # iterations of a step that the next one is as long as
    most: int = 12  # iterations after which a step is given up
    growth: float = 2.0  # largest ratio of a step to the one before it
    max_steps: int = 1000


def arc_steps(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: RiksSettings | None = None,
    target: float = 1.0,
    cost: Cost | None = None,
) -> Iterator[Corrected]:
    """Yield converged states from (u, 0) until the control has reached ``target``.

    A predictor along the tangent of the path is brought back to it in the plane across, with a
    new tangent in every iteration.  Steps that converge easily make the next one longer; those
    that do not, or that turn too far, are halved: without a bound on the angle the method leaps
    to other parts of the path, or goes back.  ``cost`` counts the tangents of all iterations.

    Source: Riks, *An incremental approach to the solution of snapping and buckling problems*,
    Int. J. Solids Struct. 15 (1979).

    Raises
    ------
    PathStopped
        If steps have become too short, or too many.
    """
    settings, cost = settings or RiksSettings(), Cost() if cost is None else cost
    arc = _Arc(equations, solver, settings, cost)
    control, length = 0.0, settings.first
    along = arc.tangent(u, control, (np.zeros_like(u), 1.0))
    for _ in range(settings.max_steps):
        step = arc.corrected(u, control, along, length)
        if step is not None:
            secant = (step.u - u, step.control - control)
            ahead = arc.tangent(step.u, step.control, secant)
            size = np.sqrt(inner(equations, secant[0], secant[0]) + secant[1] ** 2)
            turned = min(inner(equations, secant[0], t) + secant[1] * s for t, s in (along, ahead))
        if step is None or turned < settings.sharpest * size:
            length *= 0.5
            if length < settings.shortest:
                raise PathStopped(Outcome.STALLED, control, "Newton's method does not converge")
            continue
        u, control, along = step.u, step.control, ahead
        ratio = np.sqrt(settings.wanted / max(step.iterations, 1))
        length *= float(min(ratio, settings.growth))
        yield step
        if control >= target:
            return
    raise PathStopped(Outcome.TOO_MANY_STEPS, control)


@dataclass(frozen=True)
class _Arc:
    """Tangents of a path, and corrections in the plane across them."""

    equations: Equations
    solver: LinearSolver
    settings: RiksSettings
    cost: Cost

    def tangent(
        self, u: Array, control: float, forward: tuple[Array, float]
    ) -> tuple[Array, float]:
        """Return the unit tangent of the path, in the sense of the last step."""
        recurrence = self.equations.recurrence(u, control, 1)
        self.cost.factorisations += 1
        factors = self.solver.factorise(recurrence.tangent())
        per_control = -factors.solve(recurrence.control_derivative())
        norm = np.sqrt(inner(self.equations, per_control, per_control) + 1.0)
        if inner(self.equations, forward[0], per_control) + forward[1] < 0.0:
            norm = -norm
        return per_control / norm, 1.0 / norm

    def corrected(
        self, u: Array, control: float, along: tuple[Array, float], length: float
    ) -> Corrected | None:
        """Return the state in the plane across by Newton's iteration; None without convergence."""
        u, control = u + length * along[0], control + length * along[1]
        for iteration in range(self.settings.most + 1):
            with np.errstate(over="ignore", invalid="ignore"):
                recurrence = self.equations.recurrence(u, control, 1)
            self.cost.residuals += 1
            imbalance = self.equations.imbalance(recurrence.residual)
            if imbalance <= self.settings.tolerance:
                return Corrected(u, control, iteration, imbalance)
            if not np.isfinite(imbalance) or iteration == self.settings.most:
                return None
            self.cost.factorisations += 1
            try:
                factors = self.solver.factorise(recurrence.tangent())
            except SingularTangentError:
                return None
            free = -factors.solve(recurrence.residual)
            per_control = -factors.solve(recurrence.control_derivative())
            across = inner(self.equations, along[0], free)
            change = -across / (inner(self.equations, along[0], per_control) + along[1])
            u, control = u + free + change * per_control, control + change
        return None


# steps of time ---------------------------------------------------------------------

MOST_ITERATIONS = 20
"""Iterations after which backward Euler gives up."""


def backward_euler(
    equations: RateEquations,
    u: Array,
    v: Array,
    times: Array,
    *,
    solver: LinearSolver,
    tolerance: float,
) -> tuple[Array, int] | None:
    """Return the states at all times, shape (m, n), and the tangents; None if an iteration fails.

    The steps are of one length, which is what is usual; u and v are those at the first time, from
    which Newton's method starts.  A converged step has at most the imbalance ``tolerance``.
    """
    states, tangents, zero = [u], 0, np.zeros_like(u)
    for t, h in zip(times, np.diff(times), strict=False):
        path = equations.during(float(t), float(h), AffineVelocity(1.0 / h, zero, zero), u)
        increment, spent = _increment(path, h * v, solver, tolerance)
        tangents += spent
        if increment is None:
            return None
        u, v = u + increment, increment / h
        states.append(u)
    return np.array(states), tangents


def _increment(
    path: StepEquations, x: Array, solver: LinearSolver, tolerance: float
) -> tuple[Array | None, int]:
    """Return the increment of a step, and tangents."""
    for iteration in range(MOST_ITERATIONS + 1):
        with np.errstate(all="ignore"):
            recurrence = path.recurrence(x, 1.0, 1)
        imbalance = path.imbalance(recurrence.residual)
        if imbalance <= tolerance:
            return x, iteration
        if not np.isfinite(imbalance) or iteration == MOST_ITERATIONS:
            break
        try:
            x = x - solver.factorise(recurrence.tangent()).solve(recurrence.residual)
        except SingularTangentError:
            break
    return None, iteration
