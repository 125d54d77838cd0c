"""The two schemes on a mass-spring case, and the events on its path."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from scipy.optimize import brentq

from anmstrip.arrays import Array
from anmstrip.continuation.equations import Cost, PathStopped, Tolerances
from anmstrip.continuation.follow import Settings
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.mechanics.laws import cone_speed, corner_speed
from anmstrip.paper.mass_spring import MassSpring, Parameters, PressedPlane
from anmstrip.taylor.polynomials import Watch, derivative_coefficients, value_at
from anmstrip.taylor.series import recorded, taylor_series
from anmstrip.timestepping.explicit import integrate_explicitly, join_series
from anmstrip.timestepping.formulas import start_memory
from anmstrip.timestepping.implicit import Stepping, integrate
from anmstrip.timestepping.index_one import (
    FunctionRateEquations,
    TimePath,
    consistent,
    controlled,
    join_steps,
)

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
class CaseSolution:
    """Result of an integration."""

    path: TimePath
    error: float  # estimated error of u (m), in fast motion along the curve
    passes: int  # integrations that it took to keep the tolerance
    cost: Cost  # of all passes
    stopped: PathStopped | None  # why the path ended before its time


def solve_case(case: MassSpring, scheme: str, *, order: int, tolerance: float) -> CaseSolution:
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

    found = controlled(run, case.residual, tolerance, speed=FAST * case.parameters.V_c)
    return CaseSolution(found.path, found.error, found.passes, cost, reasons[-1])


def explicit_scheme(
    case: MassSpring, order: int, tolerance: float, cost: Cost
) -> tuple[TimePath, PathStopped | None]:
    """The paper's scheme, explicit in time."""
    p, rest = case.parameters, np.zeros(case.size)
    steps = integrate_explicitly(
        case.residual,
        rest,
        rest,
        (0.0, p.t_end),
        order=order,
        tolerance=tolerance,
        speed=FAST * p.V_c,
        cost=cost,
    )
    pieces, reason = collect_steps(steps)
    return join_series(pieces), reason


def implicit_scheme(
    case: MassSpring, order: int, tolerance: float, cost: Cost
) -> tuple[TimePath, PathStopped | None]:
    """Backward differences of order 1 and 2, each step a path of its own."""
    p, rest = case.parameters, np.zeros(case.size)
    u, v = consistent(case.residual, rest, rest, 0.0, tolerance, 0.0)
    steps = integrate(
        FunctionRateEquations(case.residual, p.t_end, p.V_c),
        start_memory(0.0, u, v, FIRST_STEP * p.t_end),
        p.t_end,
        solver=DenseSolver(),
        settings=Settings(order, Tolerances(tolerance).time_residual, MOST_STEPS),
        stepping=Stepping(p.t_end, tolerance),
        cost=cost,
    )
    taken, reason = collect_steps(steps)
    return join_steps(u, v, taken, tolerance, p.V_c), reason


SCHEMES = {"taylor": explicit_scheme, "implicit": implicit_scheme}


def collect_steps(steps: Iterable[Step]) -> tuple[list[Step], PathStopped | None]:
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


KINDS = (
    ("contact lost", "contact made"),
    ("slip", "stick"),
    ("cone left", "cone regained"),
    ("law left", "law regained"),
)
"""Names of the events, where a function rises through zero and where it falls."""

SAMPLES = 9
"""Instants of a piece at which the sense of sliding is looked at."""


@dataclass(frozen=True)
class CaseEvent:
    """Change of contact, of stick and slip, of the cone; loss of Coulomb's solution."""

    time: float  # s
    kind: str
    ux: float  # m
    uy: float  # m
    value: float
    """Gap (m) of contact and law, slip (m/s) of stick, slip and cone, and of a loss of existence
    the slip that Coulomb's law asks for."""
    message: str = ""  # of a loss of existence


def events_of(case: MassSpring, pieces: Iterator[tuple[float, float, Array]]) -> list[CaseEvent]:
    """All events along a path.

    Parameters
    ----------
    case : MassSpring
    pieces : iterable of (start, length, coefficients)
        Polynomials of u in the time since their start, shape (order + 1, n).
    """
    p = case.parameters
    pressed = isinstance(case, PressedPlane)
    level = -1.0 if pressed else touch_gap(p)
    corners = np.array([corner_speed(p.friction), cone_speed(p.friction)]) ** 2

    def indicators(u: Any, v: Any) -> Any:
        """Functions whose roots are events, in the order of ``KINDS``."""
        h, slip = case.gap(u), case.slip(u, v)
        return np.stack([h - level, *(slip * slip - s for s in corners), h - p.delta])

    whole, watch, found = list(pieces), Watch(), list[CaseEvent]()
    watched = recorded(indicators)
    for start, length, u in whole:
        t = np.zeros(len(u))
        t[:2] = start, 1.0
        v = np.concatenate([derivative_coefficients(u), np.zeros((1, u.shape[1]))])
        changes = watch.changes(taylor_series(watched, u, v), length)
        for which, a, sense in zip(changes.which, changes.where, changes.sense, strict=True):
            x, speed = value_at(u, a), value_at(v, a)
            if which in (1, 2) and not (pressed or case.gap(x) <= level):
                continue
            value = float(case.slip(x, speed) if which in (1, 2) else case.gap(x))
            kind = KINDS[which][0 if sense > 0 else 1]
            ux, uy = (*map(float, x), 0.0)[:2]
            event = CaseEvent(float(start + a), kind, ux, uy, value)
            if kind == "stick":
                event = turn_of_sliding(case, event, whole, found[-1].time if found else 0.0)
            found.append(event)
            sliding = float(np.sign(value))
            if kind == "cone left" and (
                (slip := coulomb_slip(case, x, event.time, sliding)) * sliding <= 0.0
            ):
                message = (
                    "Coulomb's problem has no quasi-static solution from here on: friction has "
                    f"reached its cone, and sliding in equilibrium would go {abs(slip):.3g} m/s "
                    "the other way"
                )
                found.append(replace(event, kind="existence lost", value=slip, message=message))
    return found


def turn_of_sliding(
    case: MassSpring, stick: CaseEvent, pieces: list[tuple[float, float, Array]], since: float
) -> CaseEvent:
    """The latest instant, since the last event, at which sliding at the cone turned round."""
    sense = float(np.sign(stick.value))

    def sliding(t: float, u: Array, start: float) -> float:
        return sense * coulomb_slip(case, value_at(u, t - start), t, sense)

    for start, length, u in reversed(pieces):
        first, last = max(start, since), min(start + length, stick.time)
        if not last > first:
            continue
        times = np.linspace(first, last, SAMPLES)
        ahead = [sliding(t, u, start) > 0.0 for t in times]
        if ahead[-1]:
            return stick
        if any(ahead):
            k = SAMPLES - 1 - ahead[::-1].index(True)
            t = float(brentq(sliding, times[k], times[k + 1], args=(u, start), xtol=1e-12))
            x, v = value_at(u, t - start), value_at(derivative_coefficients(u), t - start)
            ux, uy = (*map(float, x), 0.0)[:2]
            return CaseEvent(t, "stick", ux, uy, float(case.slip(x, v)))
    return stick


def touch_gap(p: Parameters) -> float:
    """h with R_N(h) = k h, the positive root of (5c): h² (k + k²/K) + η h = η δ."""
    a = p.k * (1.0 + p.k / p.K)
    return float(2.0 * p.eta * p.delta / (p.eta + np.sqrt(p.eta**2 + 4.0 * a * p.eta * p.delta)))


def coulomb_slip(case: MassSpring, u: Array, t: float, sense: float) -> float:
    """Slip speed (m/s) with which equilibrium is kept while friction stays at its cone.

    R(u, t) = 0 with R_T = −sense f R_N gives u' = −(∂R/∂u)⁻¹ ∂R/∂t, without any rate in the
    law.  The result must have the sign ``sense``, for friction opposes slip.  If it has the
    other, and friction has reached the cone, neither stick nor slip go on: Coulomb's problem
    has no quasi-static solution.
    """
    unit = np.eye(len(u))
    slopes = [taylor_series(lambda x: case.sliding(x, t, -sense), [u, e])[1] for e in unit]
    rate = taylor_series(lambda s: case.sliding(u, s, -sense), [t, 1.0])[1]
    return float(case.slip(u, -np.linalg.solve(np.stack(slopes, axis=1), rate)))
