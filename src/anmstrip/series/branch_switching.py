"""From a bifurcation to the path that crosses there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .continuation import Pace
from .expansion import Cost, Equations, inner
from .linear_solvers import LinearSolver
from .outcome import Outcome, PathStopped
from .singular_points import SingularPoint

Array = NDArray[np.float64]

MOST_ITERATIONS = 20


def switched(
    equations: Equations,
    point: SingularPoint,
    distance: float,
    solver: LinearSolver,
    tolerance: float,
    cost: Cost | None = None,
) -> tuple[Array, Pace]:
    """A state on the path that crosses another at a bifurcation, and the pace to go on with.

    By Newton's method among the states that are ``distance`` from the bifurcation along its
    mode; the sign chooses the side.

    Parameters
    ----------
    distance : float
        In the equations' own scales.
    tolerance : float
        Imbalance of the state.

    Raises
    ------
    PathStopped
        If the method does not converge.
    """
    cost = Cost() if cost is None else cost
    u, control = point.u + distance * point.mode, point.control
    for _ in range(MOST_ITERATIONS):
        recurrence = equations.recurrence(u, control, 1)
        if equations.imbalance(recurrence.residual) <= tolerance:
            forward = (np.sign(distance) * point.mode, 0.0)
            return u, Pace(control, abs(distance), arclength=True, forward=forward)
        factors = solver.factorise(recurrence.tangent())
        cost.factorisations += 1
        free = -factors.solve(recurrence.residual)
        per_control = -factors.solve(recurrence.control_derivative())
        missing = distance - inner(equations, point.mode, u + free - point.u)
        change = missing / inner(equations, point.mode, per_control)
        u, control = u + free + change * per_control, control + change
    raise PathStopped(Outcome.STALLED, control, "no state found on the other path")
