"""The two schemes on a mass-spring case, and the events on its path."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from anmstrip.continuation.expansion import Cost
from anmstrip.continuation.follow import Settings
from anmstrip.continuation.status import PathStopped
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.mechanics.laws import cone_speed, corner_speed
from anmstrip.paper.mass_spring import MassSpring, Parameters, PressedPlane
from anmstrip.taylor.polynomials import Watch, derivative_coefficients, value_at
from anmstrip.taylor.series import taylor
from anmstrip.timestepping.explicit import PiecewiseSeries, integrate_explicitly
from anmstrip.timestepping.formulas import start_memory
from anmstrip.timestepping.functions import FunctionRateEquations, ImplicitSolution
from anmstrip.timestepping.implicit import Stepping, integrate
from anmstrip.timestepping.index_one import Controlled, TimePath, consistent, controlled

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

    found: Controlled[TimePath] = controlled(
        run, case.residual, tolerance, speed=FAST * case.parameters.V_c
    )
    return CaseSolution(found.path, found.error, found.passes, cost, reasons[-1])


def explicit_scheme(
    case: MassSpring, order: int, tolerance: float, cost: Cost
) -> tuple[TimePath, PathStopped | None]:
    """The paper's scheme, explicit in time."""
    p, rest = case.parameters, np.zeros(case.size)
    pieces, reason = _until_stopped(
        integrate_explicitly(
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


def implicit_scheme(
    case: MassSpring, order: int, tolerance: float, cost: Cost
) -> tuple[TimePath, PathStopped | None]:
    """Backward differences of order 1 and 2, each step a path of its own."""
    p, rest = case.parameters, np.zeros(case.size)
    u, v = consistent(case.residual, rest, rest, 0.0, tolerance, 0.0)
    steps, reason = _until_stopped(
        integrate(
            FunctionRateEquations(case.residual, p.t_end, p.V_c),
            start_memory(0.0, u, v, FIRST_STEP * p.t_end),
            p.t_end,
            solver=DenseSolver(),
            settings=Settings(order=order, tolerance=tolerance, max_steps=MOST_STEPS),
            stepping=Stepping(p.t_end),
            cost=cost,
        )
    )
    return ImplicitSolution(u, v, steps, tolerance, p.V_c), reason


SCHEMES = {"taylor": explicit_scheme, "implicit": implicit_scheme}


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


Array = NDArray[np.float64]

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
    """Something that happened.

    Attributes
    ----------
    time : float
        s.
    kind : str
    ux, uy : float
        Where (m).
    value : float
        Gap (m) of contact and law, slip (m/s) of stick, slip and cone, and of a loss of
        existence the slip that Coulomb's law asks for.
    message : str
        Of a loss of existence.
    """

    time: float
    kind: str
    ux: float
    uy: float
    value: float
    message: str = ""


def events_of(case: MassSpring, pieces: Iterator[tuple[float, float, Array]]) -> list[CaseEvent]:
    """All events along a path.

    Parameters
    ----------
    case : MassSpring
    pieces : iterable of (start, length, coefficients)
        Polynomials of u in the time since their start, shape (order + 1, n).
    """
    whole, watch, found = list(pieces), Watch(), list[CaseEvent]()
    for start, length, u in whole:
        t = np.zeros(len(u))
        t[:2] = start, 1.0
        v = np.concatenate([derivative_coefficients(u), np.zeros((1, u.shape[1]))])
        functions = taylor(lambda u, v: _functions(case, u, v), u, v)
        changes = watch.changes(functions, length)
        for which, a, sense in zip(changes.which, changes.where, changes.sense, strict=True):
            x, speed = value_at(u, a), value_at(v, a)
            if which in (1, 2) and not _touches(case, x):
                continue
            value = float(case.slip(x, speed) if which in (1, 2) else case.gap(x))
            kind = KINDS[which][0 if sense > 0 else 1]
            ux, uy = (*map(float, x), 0.0)[:2]
            event = CaseEvent(float(start + a), kind, ux, uy, value)
            since = found[-1].time if found else whole[0][0]
            found.append(_dated_back(case, event, whole, since) if kind == "stick" else event)
            if kind == "cone left":
                found += _existence(case, found[-1], x)
    return found


def _dated_back(
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


def _functions(case: MassSpring, u: Any, v: Any) -> Any:
    """Roots of these are events; shape (4,)."""
    p, h, slip = case.parameters, case.gap(u), case.slip(u, v)
    speeds = corner_speed(p.friction), cone_speed(p.friction)
    level = -1.0 if isinstance(case, PressedPlane) else touch_gap(p)
    return np.stack([h - level, *(slip * slip - s**2 for s in speeds), h - p.delta])


def touch_gap(p: Parameters) -> float:
    """h with R_N(h) = k h, the positive root of (5c): h² (k + k²/K) + η h = η δ."""
    a = p.k * (1.0 + p.k / p.K)
    return float(2.0 * p.eta * p.delta / (p.eta + np.sqrt(p.eta**2 + 4.0 * a * p.eta * p.delta)))


def _touches(case: MassSpring, u: Array) -> bool:
    return isinstance(case, PressedPlane) or bool(case.gap(u) <= touch_gap(case.parameters))


def coulomb_slip(case: MassSpring, u: Array, t: float, sense: float) -> float:
    """Slip speed (m/s) with which equilibrium is kept while friction stays at its cone.

    R(u, t) = 0 with R_T = −sense f R_N gives u' = −(∂R/∂u)⁻¹ ∂R/∂t, without any rate in the
    law.  The result must have the sign ``sense``, for friction opposes slip.  If it has the
    other, and friction has reached the cone, neither stick nor slip go on: Coulomb's problem
    has no quasi-static solution.
    """
    unit = np.eye(len(u))
    slopes = [taylor(lambda x: case.sliding(x, t, -sense), [u, e])[1] for e in unit]
    rate = taylor(lambda s: case.sliding(u, s, -sense), [t, 1.0])[1]
    return float(case.slip(u, -np.linalg.solve(np.stack(slopes, axis=1), rate)))


def _existence(case: MassSpring, event: CaseEvent, u: Array) -> Iterator[CaseEvent]:
    """Whether leaving the cone is the end of Coulomb's solution."""
    sense = float(np.sign(event.value))
    slip = coulomb_slip(case, u, event.time, sense)
    if slip * sense <= 0.0:
        message = (
            "Coulomb's problem has no quasi-static solution from here on: friction has reached "
            f"its cone, and sliding in equilibrium would go {abs(slip):.3g} m/s the other way"
        )
        yield CaseEvent(event.time, "existence lost", event.ux, event.uy, slip, message)
