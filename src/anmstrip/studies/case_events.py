"""What happens to the mass of a case, and when: roots of the series of its path.

A regularised law has no contact and no stick, only more or less of them.  So every kind of
event says what it is a root of:

* contact: the reaction R_N is k h, what the spring would need to close the gap h that is left.
  It holds where Coulomb's unregularised problem is in contact, whatever K, η and δ are, so
  long as only the spring resists (the criterion of active sets, with k as their constant);
* stick and slip, while in contact: the slip speed in the middle of the law's corner, see
  :func:`anmstrip.mechanics.friction.corner_speed`.  Before a regularised law creeps so slowly,
  q ln(V_c/v) of its force must go, however sharp it is, and that may take long.  So stick, once it
  has come, is dated back to where sliding at the cone would have had to turn round to keep
  equilibrium (see :func:`coulomb_slip`), if it would: this depends on the state, not on the law;
* cone left: the speed at which friction is f R_N; Norton and Hoff's grows beyond it;
* existence lost: the cone is left, and sliding in Coulomb's sense would have to go the other
  way to keep equilibrium (see :func:`coulomb_slip`);
* law left: h = δ, beyond which (5c) attracts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from anmstrip.mechanics.friction import cone_speed, corner_speed
from anmstrip.mechanics.mass_spring import MassSpring, Parameters, PressedPlane
from anmstrip.series.events import Watch
from anmstrip.series.power_series import derivative_coefficients, taylor, value_at

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
