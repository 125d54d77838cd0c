"""One tangent, N orders: a point of a solution path becomes a branch of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.path import Branch
from anmstrip.continuation.status import Outcome, PathStopped
from anmstrip.linalg.solvers import LinearSolver

Array = NDArray[np.float64]

LARGEST = 1e100
"""Size of a coefficient after which a series ends, so that no later one overflows."""

TINY = float(np.finfo(float).tiny)


class Recurrence(Protocol):
    """The orders of R at one point, found one after the other."""

    residual: Array
    """Order 0, shape (n,)."""

    def tangent(self) -> object:
        """∂R/∂u, in the form that the linear solver takes."""

    def control_derivative(self) -> Array:
        """∂R/∂λ, shape (n,)."""

    def advance(self, k: int) -> Array:
        """Order k of R, k ≥ 2, as if u_k = 0 and λ_k = 0."""

    def correct(self, k: int, u: Array, control: float) -> None:
        """Fix order k of the unknowns."""


class Equations(Protocol):
    """R(u, λ) = 0 and the scales in which its user measures errors.

    They may tell where inside a branch to look at the balance too: ``hidden(branch)`` gives a
    parameter at which something acts that is not seen at either end, or None.
    """

    @property
    def metric(self) -> Array | float:
        """Weights of the unknowns in the dimensionless inner product of changes of state."""

    def recurrence(self, u: Array, control: float, order: int) -> Recurrence:
        """Start the series at a point."""

    def residual(self, u: Array, control: float) -> Array:
        """R(u, λ) in plain numbers."""

    def imbalance(self, residual: Array) -> float:
        """Size of a residual in units of the problem's own forces."""


class Timed:
    """Adds the seconds between entry and exit to those of a phase."""

    __slots__ = ("begin", "phase", "seconds")

    def __init__(self, seconds: dict[str, float], phase: str) -> None:
        self.seconds, self.phase = seconds, phase

    def __enter__(self) -> None:
        self.begin = time.perf_counter()

    def __exit__(self, *error: object) -> None:
        spent = time.perf_counter() - self.begin
        self.seconds[self.phase] = self.seconds.get(self.phase, 0.0) + spent


@dataclass
class Cost:
    """Honest counters: what was done, and the seconds it took; ``most`` bounds the expansions."""

    expansions: int = 0
    factorisations: int = 0
    solves: int = 0
    residuals: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    most: float = float("inf")

    def timed(self, phase: str) -> Timed:
        """Add the seconds spent inside to ``phase``."""
        return Timed(self.seconds, phase)


@dataclass(frozen=True)
class Parameter:
    """What the path parameter measures, and how far a = 1 is meant to reach.

    Attributes
    ----------
    scale : float
        Change of the control (or arclength) at a = 1.
    reach : float
        Largest a that is of interest; the orders stop where the next would not
        be seen at this distance.
    arclength : bool
        Follow pseudo-arclength instead of the control.
    forward : tuple or None
        Direction (u, λ) of travel so far, to keep the sense along an arc.
    unhurried : float
        Share of the reach, or of what is ahead, over which even a small imbalance is taken
        away at least.
    ahead : float
        What is left of the control, where an arc is followed.
    """

    scale: float
    reach: float = np.inf
    arclength: bool = False
    forward: tuple[Array, float] | None = None
    unhurried: float = 0.0
    ahead: float = 0.0


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

    Parameters
    ----------
    equations : Equations
    u : ndarray, shape (n,)
    control : float
        λ at the start.
    order : int
        N, the highest order.
    solver : LinearSolver
        Factorises the tangent once and solves for every order.
    parameter : Parameter
        Meaning and scale of the path parameter.
    tolerance : float
        Largest imbalance that is wanted.  Where two successive orders would leave
        less than a tenth of it at ``parameter.reach``, the series ends.  An initial
        imbalance above it is taken away over the whole reach, a smaller one up to
        a = 1, or as far as ``parameter.unhurried`` says.
    cost : Cost, optional
        Counters to add to.

    Returns
    -------
    Branch
        Its length is the guess of :func:`term_range`, not yet verified.

    Raises
    ------
    SingularTangentError
        From the solver, if the tangent cannot be factorised.
    PathStopped
        As many expansions as ``cost`` allows were made.
    """
    cost = Cost() if cost is None else cost
    recurrence, solve = _prepared(equations, u, control, order, solver, cost)
    per_control = -solve(recurrence.control_derivative())
    away = equations.imbalance(recurrence.residual) > tolerance
    border = _Border(equations, per_control, parameter)
    carried_over = border.carried_over(parameter, away)
    u_orders, control_orders, forces, unseen = [u], [control], [0.0], 0
    for k in range(1, order + 1):
        if k == 1:
            right = recurrence.residual / carried_over
        else:
            with cost.timed("series"):
                right = recurrence.advance(k)
        free = -solve(right) if right.any() else np.zeros_like(u)
        control_k = border.control(k, free)
        u_k = free + control_k * per_control
        with cost.timed("series"):
            recurrence.correct(k, u_k, control_k)
        u_orders.append(u_k)
        control_orders.append(control_k)
        forces.append(equations.imbalance(right) if k > 1 else 0.0)
        visible = k == 1 or _visible(forces[k], k, parameter.reach, tolerance)
        unseen = 0 if visible else unseen + 1
        if unseen == 2 or size(equations, u_k) > LARGEST:
            break
    return Branch(
        u=np.array(u_orders),
        control=np.array(control_orders),
        length=np.inf,
        residual=recurrence.residual,
        carried_over=carried_over,
        forces=(forces[-2], forces[-1]),
    )


def _prepared(
    equations: Equations, u: Array, control: float, order: int, solver: LinearSolver, cost: Cost
) -> tuple[Recurrence, Callable[[Array], Array]]:
    """Start the series, and factorise its tangent once for all orders."""
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

    return recurrence, solve


class _Border:
    """The scalar equation that fixes the path parameter."""

    def __init__(self, equations: Equations, per_control: Array, parameter: Parameter) -> None:
        self.equations = equations
        self.per_control = per_control
        self.scale = parameter.scale
        self.arclength = parameter.arclength
        if not self.arclength:
            return
        norm = np.sqrt(inner(equations, per_control, per_control) + 1.0)
        if parameter.forward is not None:
            forward_u, forward_control = parameter.forward
            if inner(equations, forward_u, per_control) + forward_control < 0.0:
                norm = -norm
        self.t_u, self.t_control = per_control / norm, 1.0 / norm
        self.along = inner(equations, self.t_u, per_control) + self.t_control

    def carried_over(self, parameter: Parameter, away: bool) -> float:
        """Range over which an initial imbalance is taken away."""
        if not self.arclength:
            whole = parameter.reach if np.isfinite(parameter.reach) else 1.0
            return max(1.0, whole * (1.0 if away else parameter.unhurried))
        share = 0.0 if away else parameter.unhurried * parameter.ahead
        return max(1.0, share / max(abs(self.t_control) * self.scale, TINY))

    def control(self, k: int, free: Array) -> float:
        """λ_k, when u_k = free + λ_k û."""
        imposed = self.scale if k == 1 else 0.0
        if not self.arclength:
            return imposed
        return (imposed - inner(self.equations, self.t_u, free)) / self.along


def _visible(left_out: float, k: int, reach: float, tolerance: float) -> bool:
    """Whether leaving out order k would leave more than a tenth of the tolerance at reach."""
    if not left_out > 0.0:
        return left_out != 0.0
    return math.log(left_out) + k * math.log(reach) > math.log(max(0.1 * tolerance, TINY))


def inner(equations: Equations, u: Array, w: Array) -> float:
    """Dimensionless inner product of two changes of state."""
    return float((u * equations.metric) @ w)


def size(equations: Equations, u: Array) -> float:
    """Length of a change of state in the equations' own scales."""
    return math.sqrt(max(inner(equations, u, u), 0.0))


def term_range(branch: Branch, tolerance: float) -> float:
    """Distance at which the last two terms reach the tolerance: a guess of the range.

    A term is measured by the imbalance that would be left without it.  Both are
    looked at because every other coefficient may vanish; a series that ends has
    an infinite range, for the caller to cap.
    """
    orders = (branch.order - 1, branch.order)
    guesses = [
        (tolerance / force) ** (1.0 / k)
        for k, force in zip(orders, branch.forces, strict=True)
        if k > 0 and force > 0.0
    ]
    return min(guesses, default=np.inf)
