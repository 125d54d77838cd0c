"""A stiff point: what an error costs, ours and the solvers that everybody has.

A point without mass is pulled by a spring of unit stiffness at 1 + ½ sin 2t, against friction
v/√(v² + ε²).  It sticks until the spring has reached the force of friction; then, within a
time of ε², it slides as it is pulled.  The smaller ε, the sharper the corner and the stiffer
what follows: an explicit step is bounded by ε².
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from anmstrip.continuation.follow import Settings
from anmstrip.continuation.path import Cost, Tolerances
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.mechanics.laws import NortonHoff
from anmstrip.timestepping.formulas import start_memory
from anmstrip.timestepping.implicit import Stepping, integrate
from anmstrip.timestepping.index_one import FunctionRateEquations
from figures import Curves, against
from harness import Report, Sheet, installed, left_out, main
from stiff_reference import Reference, pull

Array = NDArray[np.float64]

END = 10.0
"""s; a little more than three periods of the pull."""

REST = np.zeros(1)


@dataclass(frozen=True)
class Solved:
    """The states that a solver gave, with their count."""

    times: Array  # (s), shape (m,)
    states: Array  # shape (m,)
    steps: int
    evaluations: int | None  # of the equation
    tangents: int | None  # matrices factorised


Solver = Callable[[float, float], Solved]
"""Of ε and a tolerance."""


def residual(epsilon: float) -> Callable[[Any, Any, Any], Any]:
    """Return R(u, v, t): spring less friction; also for states on a trailing axis."""
    law = NortonHoff(1.0, 0.0, epsilon, 1.0)
    return lambda u, v, t: law(1.0, v) + (t - np.cos(2.0 * t) * 0.25 + 0.25 - u)


def rate(epsilon: float) -> Callable[[float, Array], Array]:
    """Return u' = ε s/√(1 − s²), s = U − u, as explicit solvers and scipy's take it."""

    def right(t: float, u: Array) -> Array:
        s = pull(np.asarray(t)) - u
        return np.asarray(epsilon * s / np.sqrt(np.maximum((1.0 - s) * (1.0 + s), 1e-30)))

    return right


def differences(epsilon: float, tolerance: float) -> Solved:
    """Solve by our backward differences on the λ path, up to order 5, as the strip is stepped."""
    cost = Cost()
    steps = list(
        integrate(
            FunctionRateEquations(residual(epsilon), END),
            start_memory(0.0, REST, REST, 1e-3),
            END,
            solver=DenseSolver(),
            settings=Settings(15, Tolerances(tolerance).time_residual, 100_000),
            stepping=Stepping(END, tolerance, 5),
            cost=cost,
        )
    )
    times, states = np.array([s.end for s in steps]), np.array([s.u[0] for s in steps])
    evaluations = cost.expansions + cost.residuals
    return Solved(times, states, len(steps), evaluations, cost.factorisations)


def scipys(method: str) -> Solver:
    """Return one of scipy's solvers."""

    def solved(epsilon: float, tolerance: float) -> Solved:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that LSODA gives up, which shows
            found = solve_ivp(
                rate(epsilon), (0.0, END), REST, method=method, rtol=tolerance, atol=tolerance
            )
        return Solved(found.t[1:], found.y[0, 1:], len(found.t) - 1, found.nfev, found.nlu)

    return solved


def ida(epsilon: float, tolerance: float) -> Solved:
    """Solve by SUNDIALS IDA, through scikit-sundae, on the same residual."""

    def right(t: float, u: Array, v: Array, out: Array) -> None:
        out[0] = t + 0.25 * (1.0 - np.cos(2.0 * t)) - u[0] - v[0] / np.sqrt(v[0] ** 2 + epsilon**2)

    def tangent(t: float, u: Array, v: Array, r: Array, per_rate: float, out: Array) -> None:
        out[0, 0] = -1.0 - per_rate * epsilon**2 * (v[0] ** 2 + epsilon**2) ** -1.5

    IDA = import_module("sksundae.ida").IDA
    solver = IDA(right, rtol=tolerance, atol=tolerance, jacfn=tangent)
    found = solver.solve(np.array([0.0, END]), REST, REST)
    return Solved(found.t[1:], found.y[1:, 0], len(found.t) - 1, found.nfev, found.njev)


def heyoka(epsilon: float, tolerance: float) -> Solved:
    """Solve by explicit Taylor steps, compiled."""
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
    """A solver with the tolerances that it is tried at."""

    name: str
    solver: Solver
    tolerances: Sequence[float]
    module: str = ""  # that it needs; empty for what is always there


METHODS = (
    Method("backward differences (ours)", differences, (1e-3, 1e-4, 1e-5, 1e-6)),
    Method("scipy Radau", scipys("Radau"), (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12)),
    Method("scipy BDF", scipys("BDF"), (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12)),
    Method("scipy LSODA", scipys("LSODA"), (1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12)),
    Method("SUNDIALS IDA", ida, (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12), "sksundae"),
    Method("heyoka", heyoka, (1e-6, 1e-9, 1e-12, 1e-15), "heyoka"),
)


EPSILONS = (0.3, 0.1, 0.03, 0.01, 1e-3)

WANTED = 1e-8
"""Error that the methods are compared at."""


class Attempt(NamedTuple):
    """One method at one tolerance, in the order of the columns."""

    epsilon: float
    method: str
    tolerance: float
    steps: int
    evaluations: int | None
    tangents: int | None
    seconds: float
    error: float


COLUMNS = Attempt._fields


def study(quick: bool = False) -> Report:
    """Try all methods at all tolerances and sharpnesses."""
    epsilons = (0.3, 1e-2) if quick else EPSILONS
    references = {epsilon: Reference(epsilon, END) for epsilon in epsilons}
    attempts = [a for e, r in references.items() for a in attempted(e, r, quick)]
    return Report(
        name="stiff",
        title="A stiff sliding point: error against cost",
        data=Sheet("All attempts", COLUMNS, tuple(attempts)),
        sheets=(_compared(attempts), _own(attempts), _checked(references)),
        figures={
            "stiff_tangents.png": against(_curves(attempts, "tangents"), "tangents", "error (m)"),
            "stiff_seconds.png": against(_curves(attempts, "seconds"), "seconds", "error (m)"),
        },
    )


def attempted(epsilon: float, reference: Reference, quick: bool) -> Iterable[Attempt]:
    """Try every installed method at its tolerances."""
    for method in METHODS:
        if method.module and not installed(method.module):
            continue
        tolerances = method.tolerances[1:-1:2] if quick else method.tolerances
        for tolerance in tolerances:
            yield attempt(method, epsilon, tolerance, reference)


def attempt(method: Method, epsilon: float, tolerance: float, reference: Reference) -> Attempt:
    """Try one method at one tolerance, beside the reference."""
    begin = time.perf_counter()
    found = method.solver(epsilon, tolerance)
    seconds = time.perf_counter() - begin
    through = found.times[-1] > END * (1.0 - 1e-9)
    error = np.abs(found.states - reference(found.times)).max() if through else np.inf
    counts = (found.steps, found.evaluations, found.tangents)
    return Attempt(epsilon, method.name, tolerance, *counts, seconds, float(error))


# sheets --------------------------------------------------------------------------


def _compared(attempts: list[Attempt]) -> Sheet:
    """Return the cheapest attempt of each method that is good enough, else its best."""
    rows = []
    for epsilon in dict.fromkeys(a.epsilon for a in attempts):
        for name in dict.fromkeys(a.method for a in attempts):
            own = [a for a in attempts if (a.epsilon, a.method) == (epsilon, name)]
            good = [a for a in own if a.error <= WANTED]
            best = min(own, key=lambda a: a.error)
            rows.append(min(good, key=lambda a: a.steps) if good else best)
    note = (
        f"For every method the loosest tolerance tried that gives an error of {WANTED:g}, or the "
        f"one with the least error; inf: given up. t from 0 to {END:g} s; errors at the ends of "
        "steps (heyoka: at 2000 times). Tangents are matrices factorised: of 3 unknowns as one "
        "real and one complex for Radau, of 1 else."
    )
    missing = left_out(m.module for m in METHODS if m.module)
    return Sheet("Cost of an error", COLUMNS, tuple(rows), " ".join(filter(None, (note, missing))))


def _own(attempts: list[Attempt]) -> Sheet:
    """Return what our method makes of the tolerance, and of ε."""
    own = [a for a in attempts if a.method == METHODS[0].name]
    rows = [
        (a.epsilon, a.tolerance, a.steps, a.tangents, a.error, a.error / a.tolerance) for a in own
    ]
    columns = ("epsilon", "tolerance", "steps", "tangents", "error", "error / tolerance")
    return Sheet("The tolerance and the error of our backward differences", columns, tuple(rows))


def _checked(references: dict[float, Reference]) -> Sheet:
    """Return the reference beside scipy's Radau, which knows nothing of it."""
    rows = []
    for epsilon, reference in references.items():
        found = solve_ivp(rate(epsilon), (0, END), REST, method="Radau", rtol=1e-12, atol=1e-14)
        difference = float(np.abs(found.y[0] - reference(found.t)).max())
        rows.append((epsilon, len(reference.pieces), len(found.t) - 1, difference))
    columns = ("epsilon", "pieces of degree 24", "steps of Radau", "largest difference")
    return Sheet("The reference beside Radau at a tolerance of 1e-12", columns, tuple(rows))


def _curves(attempts: list[Attempt], cost: str) -> Curves:
    """Return sharpness → method → cost and error of its attempts."""
    curves: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for a in attempts:
        spent = getattr(a, cost)
        if spent:
            panel = curves.setdefault(f"ε = {a.epsilon:g}", {})
            panel.setdefault(a.method, []).append((spent, a.error))
    return curves


if __name__ == "__main__":
    main(study)
