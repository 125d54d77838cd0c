"""Newton's method with adaptive load steps: what the series are measured against.

The same equations, tangents and linear solver; a new tangent in every iteration.
A load step that does not converge is halved, one that converges easily makes the
next one longer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.series.expansion import Cost, Equations
from anmstrip.series.linear_solvers import LinearSolver, SingularTangentError
from anmstrip.series.outcome import Outcome, PathStopped

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NewtonSettings:
    """Choices of Newton's method.

    Attributes
    ----------
    tolerance : float
        Largest imbalance of a converged state, in units of the problem's forces.
    first : float
        First load step, as a fraction of the whole way.
    few, most : int
        Iterations up to which the next step grows, and after which a step is given up.
    growth : float
        Ratio of a step to an easy one before it.
    shortest : float
        Smallest step, as a fraction of the whole way.
    """

    tolerance: float = 1e-8
    first: float = 0.1
    few: int = 10
    most: int = 20
    growth: float = 2.0
    shortest: float = 1e-6


@dataclass(frozen=True)
class LoadStep:
    """One converged state.

    Attributes
    ----------
    u : ndarray, shape (n,)
    control : float
    iterations : int
        Tangents that it took, those of given-up attempts not counted.
    imbalance : float
    """

    u: Array
    control: float
    iterations: int
    imbalance: float


def load_steps(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: NewtonSettings | None = None,
    start: float = 0.0,
    target: float = 1.0,
    cost: Cost | None = None,
) -> Iterator[LoadStep]:
    """Converged states on the way from (u, start) to the control ``target``.

    Parameters
    ----------
    cost : Cost, optional
        Counters to add to; ``factorisations`` are the tangents of all iterations, those
        of given-up load steps included.

    Raises
    ------
    PathStopped
        If load steps have become too short.
    """
    settings = settings or NewtonSettings()
    cost = Cost() if cost is None else cost
    control, whole = start, target - start
    size = settings.first * whole
    while control != target:
        last = abs(size) >= abs(target - control)
        aim = target if last else control + size
        found = _corrected(equations, u, aim, solver, settings, cost)
        if found is None:
            size = 0.5 * (aim - control)
            if abs(size) < settings.shortest * abs(whole):
                raise PathStopped(Outcome.STALLED, control, "Newton's method does not converge")
            continue
        u, control = found.u, found.control
        size *= settings.growth if found.iterations <= settings.few else 1.0
        yield found


def _corrected(
    equations: Equations,
    u: Array,
    control: float,
    solver: LinearSolver,
    settings: NewtonSettings,
    cost: Cost,
) -> LoadStep | None:
    """Newton's iteration at one control; None if it does not converge."""
    for iteration in range(settings.most + 1):
        with np.errstate(over="ignore", invalid="ignore"):
            recurrence = equations.recurrence(u, control, 1)
        cost.residuals += 1
        imbalance = equations.imbalance(recurrence.residual)
        if imbalance <= settings.tolerance:
            return LoadStep(u, control, iteration, imbalance)
        if not np.isfinite(imbalance) or iteration == settings.most:
            return None
        try:
            factors = solver.factorise(recurrence.tangent())
        except SingularTangentError:
            return None
        cost.factorisations += 1
        cost.solves += 1
        u = u - factors.solve(recurrence.residual)
    return None
