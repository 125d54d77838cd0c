"""Backward Euler in steps of one length, each solved by Newton's method: what is usual.

The same equations, tangents and linear solver as the series have.  Newton's method starts
from the last state and velocity, and gives up after twenty iterations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.linalg.solvers import LinearSolver, SingularTangentError
from anmstrip.timestepping.formulas import AffineVelocity, RateEquations, StepEquations

Array = NDArray[np.float64]

MOST_ITERATIONS = 20


@dataclass(frozen=True)
class FixedSteps:
    """States at equal distances in time.

    Attributes
    ----------
    times : ndarray, shape (m + 1,)
    states : ndarray, shape (m + 1, n)
    tangents : int
    """

    times: Array
    states: Array
    tangents: int


def integrated(
    equations: RateEquations,
    u: Array,
    v: Array,
    times: Array,
    *,
    solver: LinearSolver,
    tolerance: float,
) -> FixedSteps | None:
    """States at all times, from u and v at the first; ``None`` if an iteration fails.

    Parameters
    ----------
    tolerance : float
        Imbalance of a converged step, in the equations' own units.
    """
    states, tangents, zero = [u], 0, np.zeros_like(u)
    for t, h in zip(times, np.diff(times), strict=False):
        path = equations.during(float(t), float(h), AffineVelocity(1.0 / h, zero, zero), u)
        increment, spent = _newton(path, h * v, solver, tolerance)
        tangents += spent
        if increment is None:
            return None
        u, v = u + increment, increment / h
        states.append(u)
    return FixedSteps(times, np.array(states), tangents)


def _newton(
    path: StepEquations, x: Array, solver: LinearSolver, tolerance: float
) -> tuple[Array | None, int]:
    """Increment of a step, and tangents."""
    for iteration in range(MOST_ITERATIONS + 1):
        with np.errstate(all="ignore"):
            recurrence = path.recurrence(x, 1.0, 1)
        imbalance = path.imbalance(recurrence.residual)
        if imbalance <= tolerance:
            return x, iteration
        if not np.isfinite(imbalance) or iteration == MOST_ITERATIONS:
            return None, iteration
        try:
            x = x - solver.factorise(recurrence.tangent()).solve(recurrence.residual)
        except SingularTangentError:
            return None, iteration
    raise AssertionError("unreachable")
