"""The two schemes on a mass-spring case, each controlled to a tolerance."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from anmstrip.mechanics.mass_spring import MassSpring
from anmstrip.series import backward_differences, implicit_dae, taylor_dae
from anmstrip.series.continuation import Settings
from anmstrip.series.expansion import Cost
from anmstrip.series.functions import FunctionRateEquations, ImplicitSolution
from anmstrip.series.global_error import Controlled, TimePath, controlled
from anmstrip.series.index_one import consistent
from anmstrip.series.linear_solvers import DenseSolver
from anmstrip.series.outcome import PathStopped
from anmstrip.series.taylor_dae import PiecewiseSeries

Step = TypeVar("Step")

FIRST_STEP = 1e-3
"""First step of the implicit scheme, as a fraction of the time span."""

FAST = 4.0
"""Speed over V_c above which an error counts along the curve, in the explicit scheme.

In a snap an error along the curve is a larger one at equal times.  At V_c itself the third case
keeps 1e-4 m along the curve, and is off by 2.7e-4 m in a row of ``case.csv``.
"""

MOST_STEPS = 200_000


@dataclass(frozen=True)
class Solved:
    """What an integration gave.

    Attributes
    ----------
    path : TimePath
    error : float
        Estimated error of u (m), in fast motion along the curve.
    passes : int
        Integrations that it took to keep the tolerance.
    cost : Cost
        Of all passes.
    stopped : PathStopped or None
        Why the path ended before its time.
    """

    path: TimePath
    error: float
    passes: int
    cost: Cost
    stopped: PathStopped | None


def solved(case: MassSpring, scheme: str, *, order: int, tolerance: float) -> Solved:
    """Integrate a case from rest until the error of u is below the tolerance.

    Parameters
    ----------
    case : MassSpring
    scheme : str
        A key of :data:`SCHEMES`.
    order : int
    tolerance : float
        m, at all times; motion much faster than V_c counts along the curve in (V_c t, u).

    Raises
    ------
    PathStopped
        If not even one step was possible.
    """
    cost = Cost()
    reasons: list[PathStopped | None] = []

    def run(allowed: float) -> TimePath:
        path, reason = SCHEMES[scheme](case, order, allowed, cost)
        reasons.append(reason)
        return path

    found: Controlled[TimePath] = controlled(
        run, case.residual, tolerance, speed=FAST * case.parameters.V_c
    )
    return Solved(found.path, found.error, found.passes, cost, reasons[-1])


def taylor(
    case: MassSpring, order: int, tolerance: float, cost: Cost
) -> tuple[TimePath, PathStopped | None]:
    """The paper's scheme, explicit in time."""
    p, rest = case.parameters, np.zeros(case.size)
    pieces, reason = _until_stopped(
        taylor_dae.integrate(
            case.residual,
            rest,
            rest,
            (0.0, p.t_end),
            order=order,
            tolerance=tolerance,
            speed=FAST * p.V_c,
            cost=cost,
        )
    )
    return PiecewiseSeries(pieces), reason


def implicit(
    case: MassSpring, order: int, tolerance: float, cost: Cost
) -> tuple[TimePath, PathStopped | None]:
    """Backward differences of order 1 and 2, each step a path of its own."""
    p, rest = case.parameters, np.zeros(case.size)
    u, v = consistent(case.residual, rest, rest, 0.0, tolerance, 0.0)
    steps, reason = _until_stopped(
        implicit_dae.integrate(
            FunctionRateEquations(case.residual, p.t_end, p.V_c),
            backward_differences.start(0.0, u, v, FIRST_STEP * p.t_end),
            p.t_end,
            solver=DenseSolver(),
            settings=Settings(order=order, tolerance=tolerance, max_steps=MOST_STEPS),
            stepping=implicit_dae.Stepping(p.t_end),
            cost=cost,
        )
    )
    return ImplicitSolution(u, v, steps, tolerance, p.V_c), reason


SCHEMES = {"taylor": taylor, "implicit": implicit}


def _until_stopped(steps: Iterable[Step]) -> tuple[list[Step], PathStopped | None]:
    """All steps, and why there are no more if the path stopped early."""
    found: list[Step] = []
    try:
        for step in steps:
            found.append(step)
    except PathStopped as stopped:
        if not found:
            raise
        return found, stopped
    return found, None
