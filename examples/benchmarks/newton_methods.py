"""Newton's method with adaptive steps, as good as we can make it: what the series are measured by.

The same equations, tangents and linear solver.  The next state is guessed by the polynomial
through the last ones, a tangent is kept while it makes the imbalance fall fast, and steps grow
and shrink with the iterations that they take; one that does not converge is halved.  Every part
can be switched off, for what helps differs from problem to problem.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Cost, Equations
from anmstrip.continuation.follow import Pace, Settings, Step
from anmstrip.continuation.newton import Corrected, Corrections, Newton
from anmstrip.continuation.path import Branch
from anmstrip.continuation.status import Outcome, PathStopped
from anmstrip.linalg.solvers import LinearSolver
from anmstrip.timestepping.formulas import predicted

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NewtonSettings(Corrections):
    """Choices of Newton's method.

    Attributes
    ----------
    first : float
        First load step, as a fraction of the whole way.
    wanted : int
        Iterations for which the next step stays as long.
    growth : float
        Largest ratio of successive steps.
    shortest : float
        Smallest step, as a fraction of the whole way.
    degree : int
        Of the polynomial that guesses the next state; 0 starts from the last one.
    """

    first: float = 0.1
    wanted: int = 8
    growth: float = 2.0
    shortest: float = 1e-6
    degree: int = 0


def load_steps(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: NewtonSettings | None = None,
    start: float = 0.0,
    target: float = 1.0,
    cost: Cost | None = None,
) -> Iterator[Corrected]:
    """Converged states on the way from (u, start) to the control ``target``.

    Parameters
    ----------
    cost : Cost, optional
        Counters to add to; ``factorisations`` are those of all iterations, those of given-up
        load steps included.

    Raises
    ------
    PathStopped
        If load steps have become too short.
    """
    settings = settings or NewtonSettings()
    iteration = Newton(equations, solver, settings, Cost() if cost is None else cost)
    past, whole = [(start, u)], target - start
    size = settings.first * whole
    while past[0][0] != target:
        control = past[0][0]
        last = abs(size) >= abs(target - control) * (1.0 - 1e-9)
        aim = target if last else control + size
        times, states = zip(*past, strict=True)
        found = iteration.corrected(predicted(times, states, aim), aim)
        if found is None:
            size = 0.5 * (aim - control)
            if abs(size) < settings.shortest * abs(whole):
                raise PathStopped(Outcome.STALLED, control, "Newton's method does not converge")
            continue
        past = [(found.control, found.u), *past[: settings.degree]]
        easy = np.sqrt(settings.wanted / max(found.iterations, 1))
        size *= float(np.clip(easy, 0.5, settings.growth))
        yield found


@dataclass(frozen=True)
class NewtonPath:
    """Newton's method in the place of :func:`anmstrip.continuation.follow.follow`.

    The path of a time step starts where the velocity stays what it was, and is one load step.
    """

    settings: NewtonSettings

    def __call__(
        self,
        equations: Equations,
        u: Array,
        *,
        solver: LinearSolver,
        settings: Settings,
        start: float = 0.0,
        target: float = 1.0,
        pace: Pace | None = None,
        cost: Cost | None = None,
    ) -> Iterator[Step]:
        """Converged states, as straight branches from one to the next."""
        cost = Cost() if cost is None else cost
        velocity = getattr(equations, "velocity", None)
        if velocity is not None:
            yield self._at_once(equations, u - velocity.slope / velocity.rate, solver, cost)
            return
        control = start if pace is None else pace.control
        steps = load_steps(
            equations, u, solver=solver, settings=self.settings, start=control, target=target,
            cost=cost,
        )  # fmt: skip
        for found in steps:
            yield _straight(u, control, found)
            u, control = found.u, found.control

    def _at_once(self, equations: Equations, u: Array, solver: LinearSolver, cost: Cost) -> Step:
        found = Newton(equations, solver, self.settings, cost).corrected(u, 1.0)
        if found is None:
            raise PathStopped(Outcome.STALLED, 0.0, "Newton's method does not converge")
        return _straight(u, 0.0, found)


def _straight(u: Array, control: float, found: Corrected) -> Step:
    branch = Branch(
        u=np.array([u, found.u - u]),
        control=np.array([control, found.control - control]),
        length=1.0,
        residual=np.zeros_like(u),
    )
    return Step(branch, found.imbalance, Pace(found.control, found.control - control))
