"""Newton's method along an arc, after Riks: what the series are measured against at folds.

The same equations, tangents, arc and linear solver; a new tangent in every iteration.  A
predictor along the tangent of the path is brought back to it in the plane across; steps that
converge easily make the next one longer, those that do not, or that turn too far, are halved.

Source: Riks, *An incremental approach to the solution of snapping and buckling problems*, Int. J.
Solids Struct. 15 (1979).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Cost, Equations, inner
from anmstrip.continuation.newton import Corrected
from anmstrip.continuation.status import Outcome, PathStopped
from anmstrip.linalg.solvers import Factors, LinearSolver, SingularTangentError

Array = NDArray[np.float64]
Direction = tuple[Array, float]


@dataclass(frozen=True)
class RiksSettings:
    """Choices of the method.

    Attributes
    ----------
    tolerance : float
        Largest imbalance of a converged state, in units of the problem's forces.
    first, shortest, longest : float
        First, smallest and largest step along the arc.
    sharpest : float
        Cosine of the largest angle between a step and the path at its ends; without a bound
        the method leaps to other parts of the path, or goes back.
    wanted, most : int
        Iterations that a step should take, and after which it is given up.
    growth : float
        Largest ratio of a step to the one before it.
    max_steps : int
    """

    tolerance: float = 1e-6
    first: float = 0.1
    shortest: float = 1e-6
    longest: float = np.inf
    sharpest: float = 0.5
    wanted: int = 5
    most: int = 12
    growth: float = 2.0
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
    """Converged states from (u, 0) until the control has reached ``target``.

    Parameters
    ----------
    cost : Cost, optional
        Counters to add to; ``factorisations`` are the tangents of all iterations.

    Raises
    ------
    PathStopped
        If steps have become too short, or too many.
    """
    settings = settings or RiksSettings()
    cost = Cost() if cost is None else cost
    control, length = 0.0, settings.first
    along = _tangent(equations, u, control, (np.zeros_like(u), 1.0), solver, cost)
    for _ in range(settings.max_steps):
        step = _corrected(equations, u, control, along, length, solver, settings, cost)
        if step is not None:
            secant = (step.u - u, step.control - control)
            ahead = _tangent(equations, step.u, step.control, secant, solver, cost)
            turned = min(_cosine(equations, secant, tangent) for tangent in (along, ahead))
        if step is None or turned < settings.sharpest:
            length *= 0.5
            if length < settings.shortest:
                raise PathStopped(Outcome.STALLED, control, "Newton's method does not converge")
            continue
        u, control, along = step.u, step.control, ahead
        ratio = np.sqrt(settings.wanted / max(step.iterations, 1))
        length = min(length * float(min(ratio, settings.growth)), settings.longest)
        yield step
        if control >= target:
            return
    raise PathStopped(Outcome.TOO_MANY_STEPS, control)


def _tangent(
    equations: Equations,
    u: Array,
    control: float,
    forward: Direction,
    solver: LinearSolver,
    cost: Cost,
) -> Direction:
    """Unit tangent of the path, in the sense of the last step."""
    recurrence = equations.recurrence(u, control, 1)
    per_control = -_factorised(recurrence, solver, cost).solve(recurrence.control_derivative())
    norm = np.sqrt(inner(equations, per_control, per_control) + 1.0)
    if inner(equations, forward[0], per_control) + forward[1] < 0.0:
        norm = -norm
    return per_control / norm, 1.0 / norm


def _cosine(equations: Equations, secant: Direction, unit: Direction) -> float:
    """Of the angle between a step and a unit tangent."""
    size = np.sqrt(inner(equations, secant[0], secant[0]) + secant[1] ** 2)
    return float((inner(equations, secant[0], unit[0]) + secant[1] * unit[1]) / size)


def _factorised(recurrence: Any, solver: LinearSolver, cost: Cost) -> Factors:
    cost.factorisations += 1
    return solver.factorise(recurrence.tangent())


def _corrected(
    equations: Equations,
    u: Array,
    control: float,
    along: Direction,
    length: float,
    solver: LinearSolver,
    settings: RiksSettings,
    cost: Cost,
) -> Corrected | None:
    """Newton's iteration in the plane across; None if it does not converge."""
    u, control = u + length * along[0], control + length * along[1]
    for iteration in range(settings.most + 1):
        with np.errstate(over="ignore", invalid="ignore"):
            recurrence = equations.recurrence(u, control, 1)
        cost.residuals += 1
        imbalance = equations.imbalance(recurrence.residual)
        if imbalance <= settings.tolerance:
            return Corrected(u, control, iteration, imbalance)
        if not np.isfinite(imbalance) or iteration == settings.most:
            return None
        try:
            factors = _factorised(recurrence, solver, cost)
        except SingularTangentError:
            return None
        free = -factors.solve(recurrence.residual)
        per_control = -factors.solve(recurrence.control_derivative())
        across = inner(equations, along[0], free)
        change = -across / (inner(equations, along[0], per_control) + along[1])
        u, control = u + free + change * per_control, control + change
    return None
