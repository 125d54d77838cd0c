"""One tangent, N orders: a point of a solution path becomes a branch of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.equations import TINY, Cost, Equations, Outcome, PathStopped, inner, size
from anmstrip.continuation.path import Branch
from anmstrip.linalg.solvers import LinearSolver

LARGEST_COEFFICIENT = float(np.finfo(float).max) ** (1.0 / 3.0)
"""Size of a coefficient after which a series ends, so that products of three do not overflow."""

SIGNIFICANT_SHARE = 0.1
"""Share of the tolerance above which an order is seen.  With a half of it sharp friction
(ω = 1e-10, q = 0.01) stalls and conveying takes 327 tangents instead of 296; with a tenth of it
a press roll takes up to 186 tangents instead of 58, at tolerances within 6 %."""


@dataclass(frozen=True)
class Parameter:
    """Meaning of the path parameter a, and how far a = 1 is to reach."""

    scale: float  # change of the control, or arclength, at a = 1
    reach: float = np.inf  # largest a of interest; orders that are not seen there are left out
    arclength: bool = False  # follow pseudo-arclength instead of the control
    forward: tuple[Array, float] | None = None  # direction (u, λ) of travel so far, on an arc
    relaxation: float = 0.0  # change of the control over which a small imbalance is taken away


def expand(
    equations: Equations,
    u: Array,
    control: float,
    *,
    order: int,
    solver: LinearSolver,
    parameter: Parameter,
    tolerance: float = 0.0,
    cost: Cost | None = None,
) -> Branch:
    """Series of the path through (u, control), with one factorisation.

    Order k of R is K u_k + λ_k ∂R/∂λ + advance(k), so that u_k = ū_k + λ_k û with
    K ū_k = −advance(k) and K û = −∂R/∂λ.  The border equation closes it: λ = λ_0 + scale a, or
    ⟨t, (u, λ)⟩ = scale a along the arc, where t is the unit vector along (û, 1).

    Parameters
    ----------
    equations : Equations
    u : ndarray, shape (n,)
    control : float
        λ at the start.
    order : int
        N, the highest order.
    solver : LinearSolver
        Factorises the tangent K once and solves for every order.
    parameter : Parameter
        Meaning and scale of the path parameter.
    tolerance : float
        Largest imbalance that is wanted.  Where two successive orders would leave
        less than a tenth of it at ``parameter.reach``, the series ends.  An initial
        imbalance above it is taken away over the whole reach, on an arc up to a = 1; a
        smaller one over a change of the control by ``parameter.relaxation``, but not
        before a = 1.
    cost : Cost, optional
        Counters to add to.

    Returns
    -------
    Branch
        Of unlimited length: its range is not known yet.

    Raises
    ------
    SingularTangentError
        From the solver, if the tangent cannot be factorised.
    PathStopped
        As many expansions as ``cost`` allows were made.
    """
    cost = Cost() if cost is None else cost
    if cost.expansions >= cost.most:
        raise PathStopped(Outcome.TOO_MANY_TANGENTS, control)
    with cost.timed("series"):
        recurrence = equations.recurrence(u, control, order)
    with cost.timed("tangent"):
        matrix = recurrence.tangent()
    with cost.timed("factorisation"):
        factors = solver.factorise(matrix)
    cost.expansions += 1
    cost.factorisations += 1

    def solve(right: Array) -> Array:
        cost.solves += 1
        with cost.timed("back-substitution"):
            return factors.solve(right)

    per_control = -solve(recurrence.control_derivative())
    away = equations.imbalance(recurrence.residual) > tolerance
    if parameter.arclength:
        norm = np.sqrt(inner(equations, per_control, per_control) + 1.0)
        forward_u, forward_control = parameter.forward or (np.zeros_like(u), 1.0)
        if inner(equations, forward_u, per_control) + forward_control < 0.0:
            norm = -norm
        t_u, t_control = per_control / norm, 1.0 / norm
        along = inner(equations, t_u, per_control) + t_control
        share = 0.0 if away else parameter.relaxation
        carried_over = max(1.0, share / max(abs(t_control) * parameter.scale, TINY))
    else:
        reach = parameter.reach if np.isfinite(parameter.reach) else 1.0
        share = parameter.relaxation / max(abs(parameter.scale), TINY)
        carried_over = max(1.0, reach if away else share)
    u_orders, control_orders, forces, unseen = [u], [control], [0.0], 0
    right = recurrence.residual / carried_over
    for k in range(1, order + 1):
        force = equations.imbalance(right)
        free = -solve(right) if force else np.zeros_like(u)
        control_k = parameter.scale if k == 1 else 0.0
        if parameter.arclength:
            control_k = (control_k - inner(equations, t_u, free)) / along
        u_k = free + control_k * per_control if control_k else free
        u_orders.append(u_k)
        control_orders.append(control_k)
        forces.append(force if k > 1 else 0.0)
        seen = k == 1 or _is_seen(force, k, parameter.reach, tolerance)
        unseen = 0 if seen else unseen + 1
        if unseen == 2 or k == order or size(equations, u_k) > LARGEST_COEFFICIENT:
            break
        with cost.timed("series"):
            recurrence.correct(k, u_k, control_k)
            right = recurrence.advance(k + 1)
    return Branch(
        u=np.array(u_orders),
        control=np.array(control_orders),
        length=np.inf,
        residual=recurrence.residual,
        carried_over=carried_over,
        forces=(forces[-2], forces[-1]),
    )


def _is_seen(force: float, k: int, reach: float, tolerance: float) -> bool:
    """Whether force · reach^k, left without order k, is more than a share of the tolerance."""
    if not force > 0.0:
        return force != 0.0
    least = max(SIGNIFICANT_SHARE * tolerance, TINY)
    return math.log(force) + k * math.log(reach) > math.log(least)
