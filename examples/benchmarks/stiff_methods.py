"""Who solves the pulled sliding point, and what each of them counts."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from anmstrip.continuation.expansion import Cost
from anmstrip.continuation.follow import Settings
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.mechanics.laws import NortonHoff
from anmstrip.timestepping import formulas as backward_differences
from anmstrip.timestepping import implicit as implicit_dae
from anmstrip.timestepping.functions import FunctionRateEquations
from stiff_reference import pull

Array = NDArray[np.float64]

END = 10.0
"""s; a little more than three periods of the pull."""

REST = np.zeros(1)


@dataclass(frozen=True)
class Solved:
    """What a solver gave.

    Attributes
    ----------
    times, states : ndarray, shape (m,)
        Where it is looked at.
    steps : int
    evaluations, tangents : int or None
        Looks at the equation; matrices factorised.
    """

    times: Array
    states: Array
    steps: int
    evaluations: int | None
    tangents: int | None


Solver = Callable[[float, float], Solved]
"""Of ε and a tolerance."""


def residual(epsilon: float) -> Callable[[Any, Any, Any], Any]:
    """R(u, v, t): spring less friction; also what a state on a trailing axis is."""
    law = NortonHoff(1.0, 0.0, epsilon, 1.0)
    return lambda u, v, t: law(1.0, v) + (t - np.cos(2.0 * t) * 0.25 + 0.25 - u)


def rate(epsilon: float) -> Callable[[float, Array], Array]:
    """u' = ε s/√(1 − s²), s = U − u, as explicit solvers and scipy's take it."""

    def right(t: float, u: Array) -> Array:
        s = pull(np.asarray(t)) - u
        return np.asarray(epsilon * s / np.sqrt(np.maximum((1.0 - s) * (1.0 + s), 1e-30)))

    return right


def differences(epsilon: float, tolerance: float) -> Solved:
    """Ours, as the strip is stepped: backward differences on the λ path, up to order 5."""
    cost = Cost()
    steps = list(
        implicit_dae.integrate(
            FunctionRateEquations(residual(epsilon), END),
            backward_differences.start_memory(0.0, REST, REST, 1e-3),
            END,
            solver=DenseSolver(),
            settings=Settings(order=15, tolerance=tolerance, max_steps=100_000),
            stepping=implicit_dae.Stepping(END, 5),
            cost=cost,
        )
    )
    times, states = np.array([s.end for s in steps]), np.array([s.u[0] for s in steps])
    evaluations = cost.expansions + cost.residuals
    return Solved(times, states, len(steps), evaluations, cost.factorisations)


def scipys(method: str) -> Solver:
    """One of scipy's."""

    def solved(epsilon: float, tolerance: float) -> Solved:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that LSODA gives up, which shows
            found = solve_ivp(
                rate(epsilon), (0.0, END), REST, method=method, rtol=tolerance, atol=tolerance
            )
        return Solved(found.t[1:], found.y[0, 1:], len(found.t) - 1, found.nfev, found.nlu)

    return solved


def ida(epsilon: float, tolerance: float) -> Solved:
    """SUNDIALS IDA, through scikit-sundae, on the same residual."""

    def right(t: float, u: Array, v: Array, out: Array) -> None:
        out[0] = t + 0.25 * (1.0 - np.cos(2.0 * t)) - u[0] - v[0] / np.sqrt(v[0] ** 2 + epsilon**2)

    def tangent(t: float, u: Array, v: Array, r: Array, per_rate: float, out: Array) -> None:
        out[0, 0] = -1.0 - per_rate * epsilon**2 * (v[0] ** 2 + epsilon**2) ** -1.5

    IDA = import_module("sksundae.ida").IDA
    solver = IDA(right, rtol=tolerance, atol=tolerance, jacfn=tangent)
    found = solver.solve(np.array([0.0, END]), REST, REST)
    return Solved(found.t[1:], found.y[1:, 0], len(found.t) - 1, found.nfev, found.njev)


def heyoka(epsilon: float, tolerance: float) -> Solved:
    """Explicit Taylor steps, compiled."""
    hy = import_module("heyoka")
    u = hy.make_vars("u")
    s = hy.time + 0.25 * (1.0 - hy.cos(2.0 * hy.time)) - u
    system = [(u, epsilon * s / hy.sqrt((1.0 - s) * (1.0 + s)))]
    grid = np.linspace(0.0, END, 2001)
    found = hy.taylor_adaptive(system, [0.0], tol=tolerance).propagate_grid(grid)
    states = found[-1][1:, 0]
    return Solved(grid[1 : len(states) + 1], states, found[3], None, 0)


@dataclass(frozen=True)
class Method:
    """A solver with the tolerances that it is tried at.

    Attributes
    ----------
    name : str
    solver : callable
    tolerances : sequence of float
    module : str
        What it needs; empty for what is always there.
    """

    name: str
    solver: Solver
    tolerances: Sequence[float]
    module: str = ""


METHODS = (
    Method("backward differences (ours)", differences, (1e-3, 1e-4, 1e-5, 1e-6)),
    Method("scipy Radau", scipys("Radau"), (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12)),
    Method("scipy BDF", scipys("BDF"), (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12)),
    Method("scipy LSODA", scipys("LSODA"), (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12)),
    Method("SUNDIALS IDA", ida, (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12), "sksundae"),
    Method("heyoka", heyoka, (1e-6, 1e-9, 1e-12, 1e-15), "heyoka"),
)


def timed(solver: Solver, epsilon: float, tolerance: float) -> tuple[Solved, float]:
    """With the seconds that it took."""
    begin = time.perf_counter()
    found = solver(epsilon, tolerance)
    return found, time.perf_counter() - begin
