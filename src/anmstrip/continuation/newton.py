"""Newton's iteration at one control, and paths in steps of load: what series are measured by."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.follow import Pace, PathStep, Settings
from anmstrip.continuation.path import (
    Branch,
    Cost,
    Equations,
    Outcome,
    PathStopped,
    Recurrence,
    extrapolate,
)
from anmstrip.linalg.direct import Factors, SingularTangentError
from anmstrip.linalg.solvers import LinearSolver

WIDEST_FRICTION = 1e5
"""Width of the smoothest corners of friction over the given one, from which a state is sought: with
the default V_c, 1e-6 of the speed of a line or so, they are as wide as the speeds of slip.
With 1e7 a dancer takes a third more tangents in a step; with 1e3 the first path stalls as well."""

ROUND_OFF_MARGIN = 4.0
"""Least imbalance that is asked for, over what the last digits of one state are worth: corrections
of a line of thirteen rollers stay at 1.1 to 2.4 times that."""

TANGENT_REUSE_RATIO = 0.3
"""Part of the imbalance: a tangent is kept while an iteration leaves less of it.  On 40 000
unknowns a tangent costs as much as ten iterations; with 0.03 nine scenes take up to half as many
again."""

SLOW_CONVERGENCE_RATIO = 0.5
"""Part of the imbalance: Newton's method turns to a wider law of friction where a new tangent
leaves more.  Where it converges in one to five tangents each leaves 0.4 at most; where corners of
friction turn it back and forth it takes eight, or thirteen are not enough."""


DIVERGENCE_GROWTH = 1e20
"""Growth of the imbalance, after all halvings, from which an iteration is given up: contact so deep
comes back by a factor of e or so in each, in forty of them."""


@dataclass(frozen=True)
class Corrections:
    """Choices of the iteration."""

    tolerance: float = 1e-8  # largest imbalance of a state that is found
    most: int = 20  # iterations after which a guess is given up
    uncounted: float = 0.0  # part of the imbalance: an iteration that leaves less does not count
    least: int = 0  # iterations at least, after which the factors are those of a state nearby
    kept: float = 0.0  # part of the imbalance: while an iteration leaves less, the tangent is kept
    helpful: float = 1.0  # part of the imbalance that a correction that helps leaves at most
    halvings: int = 8  # of a correction that makes the imbalance grow (line search)
    growth: float = 1.0  # of the imbalance that a correction may make
    near: float = 0.0  # imbalance of a state that is returned if its correction does not help


@dataclass(frozen=True)
class Corrected:
    """A state in equilibrium."""

    u: Array  # (n,)
    control: float
    iterations: int
    imbalance: float


@dataclass(frozen=True)
class Newton:
    """Newton's iteration; the tangents of one state are not kept for the next."""

    equations: Equations
    solver: LinearSolver
    settings: Corrections
    cost: Cost  # counters to add to

    def corrected(self, u: Array, control: float) -> Corrected | None:
        """The state nearby in equilibrium, or near to it; None if that does not converge."""
        cost, factors, before = self.cost, None, np.inf
        residual, imbalance = self._residual(u, control)
        iteration = counted = 0
        while counted <= self.settings.most:
            here = Corrected(u, control, iteration, imbalance)
            if imbalance <= self.settings.tolerance and iteration >= self.settings.least:
                return here
            if not np.isfinite(imbalance):
                return None
            anew = factors is None or imbalance > self.settings.kept * before
            if anew:
                factors = None  # before the new ones take as much memory
                factors = self._factors(u, control)
            if factors is None:
                return here if imbalance <= self.settings.tolerance else None
            cost.solves += 1
            with cost.timed("back-substitution"):
                change = factors.solve(residual)
            after, found = self._residual(u - change, control)
            iteration += 1
            if not anew and found > imbalance:
                factors, counted = None, counted + 1
                continue
            if self.settings.helpful * imbalance < found and imbalance <= self.settings.near:
                return here
            for _ in range(self.settings.halvings):
                if found < max(self.settings.growth * imbalance, self.settings.tolerance):
                    break
                change = 0.5 * change
                after, found = self._residual(u - change, control)
            if found > DIVERGENCE_GROWTH * imbalance:
                return None
            counted += found >= self.settings.uncounted * imbalance
            u, residual, before, imbalance = u - change, after, imbalance, found
        return None

    def _residual(self, u: Array, control: float) -> tuple[Array, float]:
        self.cost.residuals += 1
        with self.cost.timed("residual"), np.errstate(over="ignore", invalid="ignore"):
            residual = self.equations.residual(u, control)
            return residual, self.equations.imbalance(residual)

    def _recurrence(self, u: Array, control: float) -> Recurrence:
        return self.equations.recurrence(u, control, 1)

    def _factors(self, u: Array, control: float) -> Factors | None:
        """Factors of the tangent, or None if it is singular or no more are allowed."""
        if self.cost.expansions >= self.cost.most:
            return None
        with self.cost.timed("tangent"):
            matrix = self._recurrence(u, control).tangent()
        self.cost.expansions += 1
        self.cost.factorisations += 1
        try:
            with self.cost.timed("factorisation"):
                return self.solver.factorise(matrix)
        except SingularTangentError:
            return None


Iteration = Callable[[Equations, LinearSolver, Corrections, Cost], Newton]
"""Newton's iteration, or one that does better in its place."""


def solve_by_narrowing(
    equations: Equations,
    u: Array,
    control: float,
    path: Callable[[Equations, Array, float], PathStep],
    *,
    solver: LinearSolver,
    tolerance: float,
    cost: Cost,
    stopped: PathStopped | None = None,
) -> Corrected | None:
    """The state at λ = 1 by way of smoother laws, None if they do not lead there.

    Where slip begins at many points at once, each turns the corner of sharp friction at a λ of its
    own, near to which the series of the path converge.  With the smoothest laws there are no
    corners; from their state a path leads to the given ones along the logarithm of the width, in
    which no corner is sharper than another.

    Parameters
    ----------
    equations : Equations
    u : ndarray, shape (n,)
        State at ``control``.
    control : float
    path : callable
        Leads from a state at a λ to the last step of a path to λ = 1.
    tolerance : float
        Imbalance of the state.
    stopped : PathStopped, optional
        Stop of the path with the given laws, whose ``width`` is set to the least with which the
        state was found.
    """
    laws = equations.smoother(WIDEST_FRICTION)
    if laws is None:
        return None
    try:
        for each, start in zip(laws, (control, 0.0), strict=True):
            u = path(each, u, start).branch.end[0]
    except PathStopped as there:
        if there.outcome is Outcome.TOO_MANY_TANGENTS:
            raise
        if stopped is not None and each is laws[1]:
            stopped.width = WIDEST_FRICTION ** (1.0 - there.control)
        return None
    return Newton(equations, solver, Corrections(tolerance, least=1), cost).corrected(u, 1.0)


@dataclass(frozen=True)
class LoadSteps(Corrections):
    """Choices of Newton's method in steps of load; every part can be switched off."""

    first: float = 0.1  # load step, as a fraction of the whole way
    halvings: int = 0
    wanted: int = 8  # iterations for which the next step stays as long
    growth: float = 2.0  # largest ratio of successive steps
    shortest: float = 1e-6  # load step, as a fraction of the whole way
    degree: int = 0  # of the polynomial that guesses the next state; 0 starts from the last one


QUICK_STEPS = LoadSteps(degree=2, halvings=8, wanted=12, most=40, kept=0.05)
"""The choices that take the fewest factorisations on graded contact, section and shell, of those
with displacements as the only unknowns (``examples/benchmarks/newton.py``)."""


def load_steps(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: LoadSteps | None = None,
    start: float = 0.0,
    target: float = 1.0,
    cost: Cost | None = None,
    iteration: Iteration = Newton,
) -> Iterator[Corrected]:
    """Yield converged states on the way from (u, start) to the control ``target``.

    The next state is guessed by the polynomial through the last ones; steps grow and shrink with
    the iterations that they take, and one that does not converge is halved.  ``cost`` counts the
    iterations of steps that are given up as well.

    Raises
    ------
    PathStopped
        If load steps have become too short, or no more tangents are allowed.
    """
    settings, cost = settings or LoadSteps(), Cost() if cost is None else cost
    newton = iteration(equations, solver, settings, cost)
    past, whole = [(start, u)], target - start
    size = settings.first * whole
    while past[0][0] != target:
        control = past[0][0]
        last = abs(size) >= abs(target - control) * (1.0 - 1e-9)
        aim = target if last else control + size
        times, states = zip(*past, strict=True)
        found = newton.corrected(extrapolate(times, states, aim), aim)
        if found is None:
            size = 0.5 * (aim - control)
            if cost.expansions >= cost.most:
                raise PathStopped(Outcome.TOO_MANY_TANGENTS, control)
            if abs(size) < settings.shortest * abs(whole):
                raise PathStopped(Outcome.STALLED, control, "Newton's method does not converge")
            continue
        past = [(found.control, found.u), *past[: settings.degree]]
        easy = np.sqrt(settings.wanted / max(found.iterations, 1))
        size *= float(np.clip(easy, 0.5, settings.growth))
        yield found


@dataclass(frozen=True)
class NewtonPath:
    """Newton's method in the place of :func:`~anmstrip.continuation.follow.follow`.

    The path of a step in time starts where the velocity stays what it was, and is one load step.
    """

    steps: LoadSteps = QUICK_STEPS
    own: bool = True  # whether ``steps`` says what is accepted, instead of the path's settings
    iteration: Iteration = Newton  # that corrects a state

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
    ) -> Iterator[PathStep]:
        """Yield converged states, as straight branches from one to the next."""
        cost = Cost() if cost is None else cost
        steps = replace(self.steps, least=1)  # errors in time are told by the factors
        if not self.own:
            steps = replace(steps, tolerance=settings.tolerance)
        control = start if pace is None else pace.control
        if (guess := equations.unaccelerated()) is not None:
            found = self.iteration(equations, solver, steps, cost).corrected(guess, target)
            if found is None:
                raise PathStopped(Outcome.STALLED, control, "Newton's method does not converge")
            yield straight_step(u, control, found)
            return
        given: dict[str, Any] = {"start": control, "target": target, "iteration": self.iteration}
        taken = load_steps(equations, u, solver=solver, settings=steps, cost=cost, **given)
        for number, found in enumerate(taken, start=1):
            yield straight_step(u, control, found)
            u, control = found.u, found.control
            if number == settings.max_steps and control != target:
                raise PathStopped(Outcome.TOO_MANY_STEPS, control)


def straight_step(u: Array, control: float, found: Corrected) -> PathStep:
    """Return the straight branch from a state to one that was found."""
    ways = np.array([u, found.u - u]), np.array([control, found.control - control])
    branch = Branch(u=ways[0], control=ways[1], length=1.0, residual=np.zeros_like(u))
    return PathStep(branch, found.imbalance, Pace(found.control, found.control - control), 1.0)
