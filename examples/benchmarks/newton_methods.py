"""Newton's method with adaptive steps, as good as we can make it: what the series are measured by.

The same equations, tangents and linear solver as the series have: steps along an arc, and backward
Euler in fixed steps of time.  Steps of load are part of the package.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.equations import Cost, Equations, Outcome, PathStopped, inner
from anmstrip.continuation.newton import Corrected
from anmstrip.linalg.direct import SingularTangentError
from anmstrip.linalg.solvers import LinearSolver
from anmstrip.timestepping.formulas import AffineVelocity, RateEquations, StepEquations

Array = NDArray[np.float64]

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
