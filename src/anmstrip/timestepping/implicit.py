"""Implicit time integration by branches: R(u, v, t) = 0 with u' = v."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.follow import Pace, PathStep, Settings
from anmstrip.continuation.newton import Corrected, solve_by_narrowing
from anmstrip.continuation.path import (
    NEGLIGIBLE_SHARE,
    Cost,
    Equations,
    Evidence,
    Outcome,
    PathStopped,
    extrapolate,
)
from anmstrip.linalg.solvers import LinearSolver, Remembering
from anmstrip.timestepping.formulas import (
    AffineVelocity,
    Errors,
    Memory,
    RateEquations,
    StepEquations,
    Stepping,
    TimeStep,
    formula,
    start_memory,
)

SNAP_TIMES = (1e-6, 1e-4)
"""Times in which forces overcome the drag of motions as large as the problem, over the whole: the
second for snaps of single points of a stiff strip, which the first does not slow down."""

REST_CHANGE, SNAP_WAY = 1e-2, 3.0
"""A state rests again where its velocity changes by less than the first of these parts of its way
in this time, and has run away if its way is so many times what it is at the speed of the end."""

SNAP_TIME_LIMIT = 1e4
"""When the state must have run away, in units of this time: otherwise no drag was missing."""

FIRST_SNAP_STEP = 1e-4
"""First step, in units of this time."""

MAX_SNAP_STEPS = 400
"""Steps of a snap."""

STEP_GROWTH = (2.0, 2.0, 1.5, 1.25, 1.12)
"""Largest ratio of successive steps by order, below the bounds of stability.

Those are 1 + √2, 1.53, 1.28 and 1.13 for the orders 2 to 5 with variable steps (Calvo,
Grande & Grigorieff, *On the zero stability of the variable order variable stepsize
BDF-formulas*, Numer. Math. 57, 1990).
"""

MIN_ERROR_SHARE = 1e-6
"""Of the tolerance, that any step may add: a layer at the start of a long stage, in which the
velocity changes at once and hardly anything moves, need not be resolved.  Without it strip on the
examples' tower that is let go for 100 s stalls at a tolerance of 1e-6."""

SNAP_TOLERANCE = 1e-4
"""Least error in time of a snap: its way depends on the drag, only where it rests does not."""

MAX_STEP_BRANCHES = 60
"""Of the path of a step: a shorter step is cheaper.  Where it would take more than a quarter of
them at its pace so far, smoother laws lead to its end, which takes 8 to 10 tangents: the capstan
at V_c = 1e-8 m/s takes 178 tangents so, and 434 where half of them are waited for."""

SHORTEST_BRANCH = 1e-3
"""Shortest branch of a step in time, as a fraction of it.  Slip that comes to rest under sharp
friction turns a corner there; branches would shrink towards it and grow again, and the error in
time then ask for a shorter step.  Without it sharp friction takes a strip twice the tangents.
The path to rest has no shorter step, and no such bound: with it ten cycles of strip that yields
take a quarter more."""

MAX_RETRY_RATIO = 10.0
"""Largest change of a step that is tried again: the shortest trial over the one before, and the
other way round the second trial of a first step in which slip turns round.  A roller that is moved
at a standstill takes 144 tangents, with 3 and 30 it takes 159 and 1921."""


def integrate(
    equations: RateEquations,
    memory: Memory,
    end: float,
    *,
    solver: LinearSolver,
    settings: Settings,
    stepping: Stepping,
    cost: Cost | None = None,
) -> Iterator[TimeStep]:
    """Accepted time steps up to ``end``.

    Parameters
    ----------
    equations : RateEquations
    memory : Memory
        From :func:`start_memory`, or of the last step of an interrupted run.
    end : float
    settings : Settings
        Order and tolerance of the branches, rational or not; ``max_steps`` bounds the time steps.
    stepping : Stepping

    Raises
    ------
    PathStopped
    """
    cost = Cost() if cost is None else cost
    integrator = _Integrator(equations, Remembering(solver), settings, stepping, cost)
    begin = memory.times[0]
    if not memory.settled:
        memory = integrator.settled(memory)
    for _ in range(settings.max_steps):
        step = replace(integrator.step(memory, end), start=begin)
        yield step
        memory, begin = step.memory, step.end
        if begin >= end:
            return
    raise PathStopped(Outcome.TOO_MANY_STEPS, begin)


def settle(equations: RateEquations, memory: Memory, *, solver: LinearSolver, **how: Any) -> Memory:
    """Return the memory after the first instant, in equilibrium and with the velocity there.

    Parameters are those of :func:`integrate`; where no such state is found, the memory is as given.
    """
    integrator = _Integrator(equations, Remembering(solver), **how)
    return replace(integrator.settled(memory), settled=True)


@dataclass(frozen=True)
class _Trial:
    """End of a step that was solved, before its error in time is known."""

    u: Array
    v: Array
    imbalance: float
    branches: int
    path: StepEquations
    increment: Array
    rate: float
    tangent: tuple[Array, float]  # increment and λ to which the last factors belong

    @cached_property
    def resistance(self) -> Callable[[Array], Array]:
        """∂R/∂v at its end: large beside the last tangent where slip has come to rest within it."""
        return self.path.resistance(self.increment, 1.0)

    @cached_property
    def resistance_in_tangent(self) -> Callable[[Array], Array]:
        """∂R/∂v where the last factors belong, of which it is a part."""
        return self.path.resistance(*self.tangent)

    @cached_property
    def turned(self) -> float:
        """Resistance of what slips the other way than before."""
        return self.path.turned(self.increment)


@dataclass(frozen=True)
class _Integrator:
    equations: RateEquations
    solver: Remembering
    settings: Settings
    stepping: Stepping
    cost: Cost

    def step(self, memory: Memory, end: float) -> TimeStep:
        """The next step, in which the state may also snap to another place.

        A snap is looked for early where the series fail in brief steps, and last of all where only
        the error in time asks for steps as short as can be.
        """
        brief = self.settings.shortest * self.stepping.whole
        try:
            return self.tried(memory, end, brief if memory.step > brief else 0.0)
        except PathStopped as stopped:
            if stopped.outcome is not Outcome.STALLED or self.stepping.fixed is not None:
                raise
            timed = memory.step > brief and stopped.evidence.motion is not None
            snap = None if timed else self.snap(memory, end)
            if snap is None and memory.step > brief:
                return self.step(replace(memory, step=brief), end)
            if snap is None:
                raise
            return snap

    def tried(self, memory: Memory, end: float, shortest: float) -> TimeStep:
        """Try, estimate, and shorten until the error is allowed.

        A first step in which slip turns round is also tried MAX_RETRY_RATIO times as long: within
        that all of it may have turned round, and forgotten how.  The velocity of the first instant
        says nothing of it, so that the error is that from the mean velocity of the shorter step.
        Where it is refused, the velocity at its end is looked at as well, but not for higher
        orders, that go on from the mean: at 1e-7 strip on a roller then takes 254 tangents instead
        of 203.
        A second step that is refused twice begins anew: the mean velocity of a first step that
        has passed such a change is not that at its end, and would be mended by no step.
        """
        t, fixed = memory.times[0], self.stepping.fixed
        least = max(shortest, smallest_step(max(t, self.stepping.whole)))
        h, barred = min(fixed or max(memory.step, 2.0 * least), end - t), False
        rising = memory.order if fixed is None else self.stepping.order
        order = min(rising, self.stepping.order, memory.available)
        failed, shorter, since = PathStopped(Outcome.STALLED, t), 0.0, memory
        onward = memory.available == 1 and fixed is None and self.stepping.order == 2
        while h > least:
            new = end if h >= (end - t) * (1.0 - 1e-10) else t + h
            try:
                trial = self.trial(memory, new, order)
            except PathStopped as stopped:
                failed, h, shorter, barred = stopped, shorter or 0.25 * (new - t), 0.0, True
                since = memory
                continue
            local = self.local_error(since, trial.u, new, order)
            error = self.error(memory, trial, new, local)
            turns = memory.available == 1 and trial.turned > self.stepping.tolerance
            if onward and error > 1.0:
                other = self.onward(memory, trial, new)
                onward = other[2] < 0.5 * error  # it tells more than the first instant does
                trial, local, error = min((trial, local, error), other, key=lambda each: each[2])
            ratio = _ratio(error, order)
            if error <= 1.0 or fixed is not None:
                following, ratio = self.next_order(memory, trial, new, order, ratio)
                growth = min(ratio, 1.0 if barred else STEP_GROWTH[following - 1])
                times = (new, *memory.times[: self.stepping.order])
                states = (trial.u, *memory.states[: self.stepping.order])
                errors = self.errors(memory, trial, local)
                past = Memory(times, states, trial.v, (new - t) * growth, following, errors)
                return TimeStep(
                    *(t, new, trial.u, trial.v, order, error, trial.imbalance, trial.branches),
                    past,
                    solved=partial(self.inside, memory, order),
                )
            if barred and memory.available == 2 and fixed is None:
                begin = start_memory(t, memory.states[0], memory.v, new - t, memory.errors)
                try:
                    begin = self.begun(begin)
                except PathStopped as stopped:  # it is shortened like any other
                    if stopped.outcome is not Outcome.TOO_MANY_STEPS:
                        raise
                else:
                    return self.tried(begin, end, shortest)
            h = shorter or max(1.0 / MAX_RETRY_RATIO, min(ratio, 0.9)) * (new - t)
            shorter, since = 0.0, memory
            if turns and not barred and new < end:
                h, shorter = min(MAX_RETRY_RATIO * (new - t), end - t), h
                since = replace(memory, v=trial.v)
            detail = f"the error in time is {error:.2g} times what is allowed"
            barred, failed = True, PathStopped(Outcome.STALLED, t, detail, Evidence(motion=local))
        if failed.outcome is Outcome.TOO_MANY_STEPS:
            detail = "even the shortest step in time needs too many tangents"
            raise PathStopped(Outcome.STALLED, t, detail, failed.evidence)
        raise PathStopped(failed.outcome, t, failed.detail, failed.evidence)

    def settled(self, memory: Memory) -> Memory:
        """The start in equilibrium, after the first instant, with the velocity there.

        What imbalance a start from rest has is taken away while nothing moves, so that it is not
        mistaken for motion; beside a velocity it tells that the velocity jumps.  Then stick and
        elasticity settle, within (friction slope)/(stiffness), about a microsecond for steel: the
        velocity jumps there, the state does not.
        The path to rest is one of polynomials: a quotient may end in the core of sharp
        friction, which is too stiff to leave at rest.  Where a roller begins to move, all of its
        points begin to slip, and this path stalls like one of a step.
        """
        t, u = memory.times[0], memory.states[0]
        velocity = AffineVelocity(1.0 / self.stepping.whole, memory.v, np.zeros_like(u))
        try:
            ways: dict[str, Any] = {"rational": False, "shortest": self.settings.shortest}
            if not memory.v.any():
                _, rest, *_ = self.ended(t, 0.0, velocity, u, **ways)
                memory = replace(memory, states=(u + rest,))
            return self.begun(memory)
        except PathStopped:
            return memory

    def begun(self, memory: Memory) -> Memory:
        """Return the memory after the first instant, with the velocity there.

        In equilibrium to a share of what is asked for elsewhere, as what acts by then is one of
        what acts later: a plate was left above its rollers by an imbalance as large as its weight.
        """
        t = memory.times[0]
        after = t + max(NEGLIGIBLE_SHARE * memory.step, smallest_step(t))
        finer = replace(self.settings, tolerance=NEGLIGIBLE_SHARE * self.settings.tolerance)
        first = replace(self, settings=finer).trial(memory, after, 1)
        return start_memory(after, first.u, first.v, memory.step, memory.errors)

    def path(
        self, equations: Equations, u: Array, *, rational: bool, shortest: float = SHORTEST_BRANCH
    ) -> Iterator[PathStep]:
        """Steps of the path of the increment from λ = 0 to 1."""
        settings = replace(
            self.settings,
            tolerance=self.balance(equations, u),
            max_steps=MAX_STEP_BRANCHES,
            shortest=shortest,
            give_way=False,
            rational=rational,
            relaxation="ahead",
        )
        ways: dict[str, Any] = {"solver": self.solver, "settings": settings, "cost": self.cost}
        return self.stepping.follow(equations, u, **ways)

    def trial(self, memory: Memory, new: float, order: int) -> _Trial:
        """Solve a step."""
        t, u, before = memory.times[0], memory.states[0], self.cost.expansions
        past, rate = formula(memory.times, new, order)
        w = np.zeros_like(u)
        for weight, state in zip(past[1:], memory.states[1:], strict=False):
            w += weight * (state - u)
        velocity = AffineVelocity(rate, memory.v, w - memory.v)
        given = self.ended(t, new - t, velocity, u, rational=self.settings.rational)
        path, increment, imbalance, tangent = given
        v, spent = velocity(increment, 1.0), self.cost.expansions - before
        trial = _Trial(u + increment, v, imbalance, spent, path, increment, rate, tangent)
        turned = path.let_turn(increment, trial.resistance, self.settings.tolerance)
        if turned is not increment:
            v = velocity(turned, 1.0)
            trial = replace(trial, u=u + turned, v=v, increment=turned)
        return trial

    def inside(self, memory: Memory, order: int, time: float) -> tuple[Array, Array] | None:
        """State and velocity inside an accepted step, as those of a shorter one that ends there."""
        if time <= memory.times[0]:
            return memory.states[0], memory.v
        try:
            trial = self.trial(memory, time, order)
        except PathStopped:
            return None
        return trial.u, trial.v

    def ended(
        self, t: float, h: float, velocity: AffineVelocity, u: Array, **path: Any
    ) -> tuple[StepEquations, Array, float, tuple[Array, float]]:
        """Equations of a step, increment and imbalance at its end, and where its last factors are.

        Where its path is slow or stalls the way to the end is one of smoother laws; it goes on
        where these are as slow.  The further arguments are those of :meth:`path`.
        """
        equations = self.equations.during(t, h, velocity, u)
        steps, found, tried = self.path(equations, np.zeros_like(u), **path), None, False
        try:
            for last in steps:
                if not tried and _slow(last.pace):
                    found, tried = self.narrowed(equations, len(u), quick=True), True
                    if found is not None:
                        break
            else:
                return equations, last.branch.end[0], last.imbalance, last.branch(last.tangent)
        except PathStopped as stopped:
            if stopped.outcome is Outcome.TOO_MANY_TANGENTS:
                raise
            found = self.narrowed(equations, len(u), quick=False)
            if found is None:
                raise
        return equations, found.u, found.imbalance, (found.u, 1.0)

    def narrowed(self, equations: StepEquations, size: int, *, quick: bool) -> Corrected | None:
        """End of a step by way of smoother laws, None if they do not lead there, or not quickly."""

        def path(laws: Equations, u: Array, start: float) -> PathStep:
            for last in self.path(laws, u, rational=True):
                if quick and _slow(last.pace):
                    raise PathStopped(Outcome.TOO_MANY_STEPS, last.pace.control)
            return last

        given: dict[str, Any] = {"solver": self.solver, "cost": self.cost}
        start = np.zeros(size)
        tolerance = self.balance(equations, start)
        return solve_by_narrowing(equations, start, 0.0, path, tolerance=tolerance, **given)

    def balance(self, path: Equations, u: Array) -> float:
        """Largest imbalance at the end of a path: what is asked for, or what round-off allows."""
        return max(self.settings.tolerance, path.round_off(u, 0.0))

    def local_error(self, memory: Memory, u: Array, new: float, order: int) -> Array:
        """Local error, from the predictor through order + 1 past states.

        The predictor's error is Π(new − t_j) u^(k+1)/(k+1)!, the formula's is that times
        1/(rate (new − t_k)), so their ratio is known.  Where that leaves more of the membrane
        force than the tolerance no such derivative describes the motion, slip that reaches the end
        of a wrap for one: all that the predictor misses counts.
        """
        used = min(memory.available, order + 1)
        times, states = memory.times[:used], memory.states[:used]
        if used > order:
            rate = formula(memory.times, new, order)[1]
            missed = u - extrapolate(times, states, new)
            local = missed / (rate * (new - times[-1]) + 1.0)
            smooth = self.equations.abrupt_error(u, local) <= self.stepping.tolerance
            return local if smooth else missed
        return 0.5 * (u - memory.states[0] - (new - times[0]) * memory.v)

    def onward(self, memory: Memory, trial: _Trial, new: float) -> tuple[_Trial, Array, float]:
        """A first step, its local error, and this over what is allowed, by how it goes on then.

        The formula takes the mean velocity v = Δu/h for that at the end.  The derivative of the end
        by h tells it,

            (∂R/∂u + rate ∂R/∂v) h du/dh = ∂R/∂v v − h ∂R/∂t,

        where the velocity of the first instant says nothing of a step that holds all of a motion
        that fades.  The last factors are those of the end of the step then.
        """
        point = trial.path.recurrence(trial.increment, 1.0, 1)
        with self.cost.timed("error in time"):
            factors = self.solver.factorise(point.tangent())
            way = factors.solve(trial.resistance(trial.v - memory.v) - point.control_derivative())
        self.cost.expansions += 1
        self.cost.factorisations += 1
        self.cost.solves += 1
        trial = replace(trial, tangent=(trial.increment, 1.0))
        local = 0.5 * (way - trial.increment)
        return trial, local, self.error(memory, trial, new, local)

    def error(self, memory: Memory, trial: _Trial, new: float, local: Array) -> float:
        """Local error over what is allowed.

        What lasts may add up to the tolerance over the whole time; what fades, and what the path
        between the ends of a step is wrong by, may be as large as the tolerance in every step.
        The formula errs in the velocity; the equations answer with a change of state, which is
        small where stiffness, not resistance to motion, decides: positions that the velocity has no
        part in are in equilibrium at any time, and what the residual leaves of them does not last.
        Where slip turns round in a step, its end does not tell what resisted in between: the error
        of the formula itself counts then, but in the first step of a start, where the trapezoidal
        rule tells it. Where slip spreads over a roller, points that it has just reached hardly
        resist at the end of the step: the answer by the resistance of the last tangent, which is
        part of it, is looked at as well.
        """
        tolerance, answer = self.stepping.tolerance, local
        share = (new - memory.times[0]) / self.stepping.whole
        share = max(share, MIN_ERROR_SHARE, np.finfo(float).eps / tolerance)  # less is round-off
        if memory.available == 1 or trial.turned <= tolerance:
            answer = self.answer(trial.resistance(trial.rate * local))
        spreading = self.answer(trial.resistance_in_tangent(trial.rate * local))
        fading = [self.equations.fading_error(trial.u, each) for each in (answer, spreading)]
        fading.append(self.equations.error(trial.u, local))
        found = max(self.equations.error(trial.u, answer) / share, *fading) / tolerance
        if memory.available > 1 or self.stepping.fixed is not None or found > 1.0:
            return found
        if self.equations.fading_error(trial.u, local) > tolerance:  # else no answer is larger
            other = self.trapezoidal(memory, trial, new)
            found = max(found, self.equations.fading_error(trial.u, other) / tolerance)
        return found

    def trapezoidal(self, memory: Memory, trial: _Trial, new: float) -> Array:
        """Change of state that the trapezoidal rule makes of a first step, by a path from its end.

        Its velocity is 2 Δu/h − v.  Strip that seems to slip all along a roller may only do so by
        the error.
        """
        rate = 2.0 * trial.rate
        velocity = AffineVelocity(rate, trial.v, trial.rate * trial.increment - memory.v)
        other = replace(self, solver=Remembering(self.solver.solver))  # the last factors stay
        try:
            return other.ended(new, 0.0, velocity, trial.u, rational=self.settings.rational)[1]
        except PathStopped as stopped:
            if stopped.outcome is Outcome.TOO_MANY_TANGENTS:
                raise
            return trial.increment

    def answer(self, force: Array) -> Array:
        """Change of state that a force makes, by the last factors."""
        self.cost.solves += 1
        with self.cost.timed("error in time"):
            return self.solver.factors.solve(force)

    def errors(self, memory: Memory, trial: _Trial, local: Array) -> Errors:
        """Errors of the state, carried on from those at the start of a step.

        With the local error l of the formula, the residual r that the step leaves and the changes
        s of the residual by sharper laws, all to first order, the error e₀ of the state before
        becomes

            (∂R/∂u + rate ∂R/∂v) e = rate ∂R/∂v (e₀ + l) + r + s.

        What sticks keeps it and what slips forgets it.  Both derivatives are those of one state: at
        corners of friction another one has others, by orders of magnitude.
        """
        with self.cost.timed("error in time"):
            end = trial.increment, 1.0
            added = trial.path.residual(*end), *trial.path.sharpenings(*end)
            before = np.zeros((1 + len(added), len(local)))
            before += 0.0 if memory.errors is None else memory.errors.after
            before[0] += local
            carried = trial.resistance_in_tangent
            right = np.array([carried(trial.rate * error) for error in before])
            right[1:] += added
            after = np.array([self.solver.factors.solve(each) for each in right])
        self.cost.residuals += 2
        self.cost.solves += len(right)
        return Errors(before, after, trial.rate)

    def next_order(
        self, memory: Memory, trial: _Trial, new: float, order: int, ratio: float
    ) -> tuple[int, float]:
        """Order that allows the longest next step, and how much longer it is.

        Up to the second order the order rises as soon as the past allows; beyond, it goes to
        a neighbour that allows a step a tenth longer.
        """
        highest = self.stepping.order
        if order < min(2, highest):
            return order + 1, ratio
        best = (order, ratio)
        for other in (order - 1, order + 1):
            if 2 <= other <= highest and memory.available > other:
                local = self.local_error(memory, trial.u, new, other)
                found = _ratio(self.error(memory, trial, new, local), other)
                best = max(best, (other, found / 1.1), key=lambda pair: pair[1])
        return best

    def snap(self, memory: Memory, end: float) -> TimeStep | None:
        """Steps with drag until the state rests, as a single one, if a drag is what is missing.

        None if no drag can be told, or the state does not run away with it, or does not rest.
        """
        t, u, v = memory.times[0], memory.states[0], memory.v
        tolerance = max(self.stepping.tolerance, SNAP_TOLERANCE)
        for lasting in (share * self.stepping.whole for share in SNAP_TIMES):
            dragged = self.equations.dragged(t, u, v, lasting)
            if dragged is None or smallest_step(t) > FIRST_SNAP_STEP * lasting:
                continue
            stepping = replace(self.stepping, tolerance=tolerance)
            other = replace(self, equations=dragged, stepping=stepping)
            slowed = min(1.0, float(np.abs(u).max() / np.abs(v).max()) / lasting)
            begin = start_memory(t, u, slowed * v, FIRST_SNAP_STEP * lasting)
            try:
                begin = replace(begin, v=other.trial(begin, t + begin.step, 1).v)
                step = other.run_away(begin, end, lasting)
            except PathStopped as stopped:
                if stopped.outcome is Outcome.TOO_MANY_TANGENTS:
                    raise
                continue
            if step is not None:
                return step
        return None

    def run_away(self, memory: Memory, end: float, lasting: float) -> TimeStep | None:
        """Steps until the state rests, as one; None if it does not run away or not rest.

        ``lasting`` is the duration (s) that the drag was chosen for.
        """
        t, u, v, branches = memory.times[0], memory.states[0], memory.v, 0
        for _ in range(MAX_SNAP_STEPS):
            step = self.tried(memory, end, 0.0)
            memory, branches = step.memory, branches + step.branches
            way, spent = np.abs(step.u - u).max(), step.end - t
            ran = way > SNAP_WAY * np.abs(step.v).max() * spent
            rests, v = np.abs(step.v - v).max() * lasting < REST_CHANGE * way, step.v
            if ran and rests and step.end - step.start > lasting:
                break
            if not ran and spent > SNAP_TIME_LIMIT * lasting:
                return None
        else:
            return None
        differ = [a > b for a, b in pairwise(memory.times)]
        known = [*differ, False].index(False) + 1  # instants
        times, states = memory.times[:known], memory.states[:known]
        past = replace(memory, times=times, states=states, order=1, errors=None)
        return replace(step, start=t, branches=branches, memory=past, snap=True)


def _slow(pace: Pace) -> bool:
    """Whether a path would take more than a quarter of MAX_STEP_BRANCHES at its pace so far.

    The first branch has none: friction may turn its corner there.
    """
    return pace.taken > 1 and pace.control < 4.0 * pace.taken / MAX_STEP_BRANCHES


def _ratio(error: float, order: int) -> float:
    """Ratio of the next step to this one with which three tenths of what is allowed are used."""
    return STEP_GROWTH[0] if error == 0.0 else float((0.3 / error) ** (1.0 / order))


def smallest_step(t: float) -> float:
    """Length of a step from t in which round-off of the time is negligible."""
    return float(np.spacing(t)) / NEGLIGIBLE_SHARE
