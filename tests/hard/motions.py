"""Motions of single points, and runs beside their answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.follow import Settings
from anmstrip.continuation.path import Cost, PathStopped, Tolerances
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.timestepping import formulas as backward_differences
from anmstrip.timestepping import implicit as implicit_dae
from anmstrip.timestepping.formulas import TimeStep
from anmstrip.timestepping.index_one import (
    FunctionRateEquations,
    TimePath,
    find_consistent_state,
    join_steps,
)

Array = NDArray[np.float64]
Residual = Callable[[Any, Any, Any], Any]

MOST_STEPS = 20_000


@dataclass(frozen=True)
class Motion:
    """Steps in time of a point, and why there are no more of them if it stopped."""

    path: TimePath
    steps: tuple[TimeStep, ...]
    cost: Cost
    outcome: str  # ``done``, or the sentence of what stopped it

    @property
    def end(self) -> Array:
        """State at the end."""
        return self.steps[-1].u


def moved(
    residual: Residual,
    u: Array,
    span: tuple[float, float],
    *,
    tolerance: float = 1e-4,
    v: Array | None = None,
    speed: float = np.inf,
    first: float = 1e-3,
    order: int = 19,
) -> Motion:
    """Integrate R(u, v, t) = 0, implicitly in time.

    Parameters
    ----------
    residual : callable
    u : ndarray, shape (n,)
    span : tuple of float
    tolerance : float
        Error of u that all steps together may make.
    v : ndarray, optional
        Guess of the first velocity.
    speed : float
        From which motion is fast, see :class:`FunctionRateEquations`.
    first : float
        First step over the span.
    """
    whole, cost = span[1] - span[0], Cost()
    u, v = find_consistent_state(
        residual, u, np.zeros_like(u) if v is None else v, span[0], tolerance, 0.0
    )
    found = implicit_dae.integrate(
        FunctionRateEquations(residual, whole, speed),
        backward_differences.start_memory(span[0], u, v, first * whole),
        span[1],
        solver=DenseSolver(),
        settings=Settings(order, Tolerances(tolerance).time_residual, MOST_STEPS),
        stepping=implicit_dae.Stepping(whole, tolerance),
        cost=cost,
    )
    steps, outcome = _all_of(found)
    path = join_steps(u, v, steps, tolerance, speed)
    return Motion(path, steps, cost, outcome)


def _all_of(found: Iterator[TimeStep]) -> tuple[tuple[TimeStep, ...], str]:
    steps: list[TimeStep] = []
    try:
        for step in found:
            steps.append(step)
    except PathStopped as stopped:
        if not steps:
            raise
        return tuple(steps), str(stopped)
    return tuple(steps), "done"


@dataclass(frozen=True)
class Trial:
    """One run of a hard case beside its answer."""

    found: float
    exact: float
    error: float  # relative to the answer, or to the size that is named with the case
    steps: int
    tangents: int
    outcome: str  # ``done``, or the sentence of what stopped it

    @classmethod
    def of(cls, motion: Motion, found: float, exact: float, unit: float | None = None) -> Trial:
        """A motion's, with the error in a unit, that of the answer if none is given."""
        error = abs(found - exact) / abs(exact if unit is None else unit)
        steps, tangents = len(motion.steps), motion.cost.factorisations
        return cls(float(found), float(exact), float(error), steps, tangents, motion.outcome)
