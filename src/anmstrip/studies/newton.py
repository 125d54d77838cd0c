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

from anmstrip.series.backward_differences import predicted
from anmstrip.series.continuation import Pace, Settings, Step
from anmstrip.series.expansion import Cost, Equations
from anmstrip.series.linear_solvers import Factors, LinearSolver, SingularTangentError
from anmstrip.series.outcome import Outcome, PathStopped
from anmstrip.series.path import Branch

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NewtonSettings:
    """Choices of Newton's method.

    Attributes
    ----------
    tolerance : float
        Largest imbalance of a converged state, in units of the problem's forces.
    first : float
        First load step, as a fraction of the whole way.
    wanted, most : int
        Iterations for which the next step stays as long, and after which a step is given up.
    growth : float
        Largest ratio of successive steps.
    shortest : float
        Smallest step, as a fraction of the whole way.
    degree : int
        Of the polynomial that guesses the next state; 0 starts from the last one.
    kept : float
        A tangent is kept while an iteration leaves less than this part of the imbalance; 0
        makes a new one for each.
    halvings : int
        Of a correction that makes the imbalance grow (line search); 0 takes it as it is.
    """

    tolerance: float = 1e-8
    first: float = 0.1
    wanted: int = 8
    most: int = 20
    growth: float = 2.0
    shortest: float = 1e-6
    degree: int = 0
    kept: float = 0.0
    halvings: int = 0


@dataclass(frozen=True)
class LoadStep:
    """One converged state.

    Attributes
    ----------
    u : ndarray, shape (n,)
    control : float
    iterations : int
        That it took, those of given-up attempts not counted.
    imbalance : float
    """

    u: Array
    control: float
    iterations: int
    imbalance: float


def load_steps(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: NewtonSettings | None = None,
    start: float = 0.0,
    target: float = 1.0,
    cost: Cost | None = None,
) -> Iterator[LoadStep]:
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
    iteration = _Iteration(equations, solver, settings, Cost() if cost is None else cost)
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


class _Iteration:
    """Newton's iteration at one control; tangents of earlier ones are not kept."""

    def __init__(
        self, equations: Equations, solver: LinearSolver, settings: NewtonSettings, cost: Cost
    ) -> None:
        self.equations, self.solver, self.settings, self.cost = equations, solver, settings, cost

    def corrected(self, u: Array, control: float) -> LoadStep | None:
        """The state nearby that is in equilibrium, or None if that does not converge."""
        factors: Factors | None = None
        residual, imbalance = self._residual(u, control)
        before = np.inf
        for iteration in range(self.settings.most + 1):
            if imbalance <= self.settings.tolerance:
                return LoadStep(u, control, iteration, imbalance)
            if not np.isfinite(imbalance):
                return None
            if factors is None or imbalance > self.settings.kept * before:
                factors = self._factorised(u, control)
                if factors is None:
                    return None
            self.cost.solves += 1
            with self.cost.timed("back-substitution"):
                change = factors.solve(residual)
            before = imbalance
            u, residual, imbalance = self._searched(u, change, control, imbalance)
        return None

    def _searched(
        self, u: Array, change: Array, control: float, imbalance: float
    ) -> tuple[Array, Array, float]:
        """The corrected state, with as much of the correction as does not make it worse."""
        residual, found = self._residual(u - change, control)
        for _ in range(self.settings.halvings):
            if found < imbalance:
                break
            change = 0.5 * change
            residual, found = self._residual(u - change, control)
        return u - change, residual, found

    def _residual(self, u: Array, control: float) -> tuple[Array, float]:
        self.cost.residuals += 1
        with self.cost.timed("residual"), np.errstate(over="ignore", invalid="ignore"):
            residual = self.equations.residual(u, control)
        return residual, self.equations.imbalance(residual)

    def _factorised(self, u: Array, control: float) -> Factors | None:
        with self.cost.timed("tangent"):
            matrix = self.equations.recurrence(u, control, 1).tangent()
        self.cost.expansions += 1
        self.cost.factorisations += 1
        try:
            with self.cost.timed("factorisation"):
                return self.solver.factorise(matrix)
        except SingularTangentError:
            return None


@dataclass(frozen=True)
class NewtonPath:
    """Newton's method in the place of :func:`anmstrip.series.continuation.follow`.

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
        found = _Iteration(equations, solver, self.settings, cost).corrected(u, 1.0)
        if found is None:
            raise PathStopped(Outcome.STALLED, 0.0, "Newton's method does not converge")
        return _straight(u, 0.0, found)


def _straight(u: Array, control: float, found: LoadStep) -> Step:
    branch = Branch(
        u=np.array([u, found.u - u]),
        control=np.array([control, found.control - control]),
        length=1.0,
        residual=np.zeros_like(u),
    )
    return Step(branch, found.imbalance, Pace(found.control, found.control - control))
