"""The strip's way through the stages: what is solved, and where it has arrived."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anmstrip.model import Equilibrium, Motion
from anmstrip.scene.build import Assembly
from anmstrip.scene.feeding import Feed, relabelled
from anmstrip.scene.interrupts import unbroken
from anmstrip.scene.measures import State
from anmstrip.scene.rules import THREADING
from anmstrip.scene.schema import StageSpec
from anmstrip.scene.stages import Course, Plan, stretched
from anmstrip.series import backward_differences, implicit_dae
from anmstrip.series.backward_differences import Memory
from anmstrip.series.continuation import Pace, PathSolver, Settings, follow
from anmstrip.series.expansion import Cost
from anmstrip.series.implicit_dae import UNHURRIED
from anmstrip.series.linear_solvers import SparseSolver
from anmstrip.series.path import Branch

Array = NDArray[np.float64]

LOOSEST = 1e-2
"""Largest imbalance on a rate-free path; at 0.1 some paths stall."""

MOST_CORRECTIONS = 100
"""Of the guess of a threaded strip, after which its path is followed."""

FIRST_STEP = 0.01
"""First time step, of the shortest stage in time; the error control corrects it."""


@dataclass(frozen=True)
class Arrival:
    """The end of a step that was solved, before it counts.

    Attributes
    ----------
    plan : Plan
    control : float
        λ of the stage.
    full, velocity : ndarray, shape (unknowns,)
        Displacements and velocities; at rest on a rate-free path.
    order : int
        Of the series.
    range, imbalance : float
        What the step has covered of λ, or of time (s), and what it leaves.
    branch : Branch or None
        Path of a rate-free step.
    pace : Pace or None
    memory : Memory or None
        Of a rate-free path and of one in time: what the next step needs.
    snap : bool
        Whether the strip ran away and came to rest elsewhere, faster than can be dated.
    """

    plan: Plan
    control: float
    full: Array
    velocity: Array
    order: int
    range: float
    imbalance: float
    branch: Branch | None = None
    pace: Pace | None = None
    memory: Memory | None = None
    snap: bool = False

    @property
    def state(self) -> State:
        """To be looked at."""
        plan, moving = self.plan, self.plan.in_time
        velocity = self.velocity if moving else None
        time = plan.start + self.control * plan.duration
        return State(plan, time, self.control, self.full, velocity, self.branch)


class March:
    """Where the strip is, and what it needs to go on.

    Parameters
    ----------
    assembly : Assembly

    Attributes
    ----------
    full, velocity : ndarray, shape (unknowns,)
    reached : float or None
        λ of a stage that has begun.
    pace, memory
        Of the path in this stage, see :class:`Arrival`.
    slack : bool
        Whether this stage began with a slack strip, see :meth:`_slack`.
    past : Plan or None
        The stage before.
    feed : Feed or None
        Of fresh strip.
    follow : callable
        Follows paths; by series unless somebody compares.
    """

    def __init__(self, assembly: Assembly) -> None:
        self.follow: PathSolver = follow
        self.assembly, self.scene = assembly, assembly.scene
        self.course, self.solver = Course(assembly), SparseSolver()
        self.cost = Cost(most=assembly.scene.solver.max_tangents)
        self.full = np.zeros(assembly.strip.unknowns)
        self.velocity = np.zeros_like(self.full)
        self.reached: float | None = None
        self.pace: Pace | None = None
        self.memory: Memory | None = None
        self.slack = False
        self.past: Plan | None = None
        self.feed = Feed(assembly.strip) if assembly.scene.strip.feed else None

    def planned(self, stage: StageSpec, state: State | None) -> Plan:
        """A stage ready to be solved; what it releases goes on as a load."""
        reactions = {}
        for name, control in stage.edges.items():
            if state is not None and control.release and name not in self.course.released:
                held = state.edge_force(name) / self.assembly.strip.edges[name].length
                reactions[name] = held - self.course.values.get(f"{name}.force", np.zeros(3))
        return self.course.plan(stage, reactions)

    def here(self, plan: Plan) -> State:
        """State in a stage."""
        return Arrival(plan, self.reached or 0.0, self.full, self.velocity, 0, 0.0, 0.0).state

    def accept(self, arrival: Arrival) -> None:
        """Be there."""
        self.full, self.velocity, self.reached = arrival.full, arrival.velocity, arrival.control
        self.pace, self.memory = arrival.pace, arrival.memory

    def finish(self, stage: StageSpec, plan: Plan) -> None:
        """Leave a stage."""
        self.course.finish(stage)
        self.reached, self.pace, self.slack, self.past = None, None, False, plan

    def through(self, plan: Plan, steps: int) -> Iterator[Arrival]:
        """Steps to the end of a stage, at most so many; each must be accepted.

        Raises
        ------
        PathStopped
        """
        settings = Settings(
            order=self.assembly.order,
            tolerance=self.scene.solver.tolerance,
            max_steps=steps,
            rational=not self.scene.output.events,  # events are roots of polynomials
        )
        yield from (self._in_time if plan.in_time else self._rate_free)(plan, settings)

    def _rate_free(self, plan: Plan, settings: Settings) -> Iterator[Arrival]:
        u, equations = self._start(plan)
        tolerance = min(settings.tolerance, LOOSEST)
        settings = replace(settings, tolerance=tolerance, unhurried=UNHURRIED)
        for step in self.follow(
            equations, u, solver=self.solver, settings=settings, pace=self.pace, cost=self.cost
        ):
            u, control = step.branch.end
            full = plan.supports.full(u, control)
            covered = abs(control - float(step.branch.control[0]))
            branch = step.branch if equations.controls is plan.controls else None
            rest = np.zeros_like(full)
            facts = (step.branch.order, covered, step.imbalance)
            yield Arrival(plan, control, full, rest, *facts, branch, step.pace)

    def _start(self, plan: Plan) -> tuple[Array, Equilibrium]:
        """First point of a rate-free path, and its equations."""
        free, u = plan.supports.free, self.full[plan.supports.free]
        if plan.name == THREADING and self.reached is None:
            assert self.assembly.thread is not None
            u = self.assembly.thread.guess(self.assembly.strip, self.assembly.pattern)[free]
            u = self._corrected(Equilibrium(plan.model, plan.supports, plan.controls), u)
        elif tension := self._slack(plan):
            self.slack, u = True, stretched(self.assembly, tension)[free]
        if self.slack:
            return u, Equilibrium(plan.model, *plan.held_at_end)
        return u, Equilibrium(plan.model, plan.supports, plan.controls)

    def _corrected(self, equations: Equilibrium, guess: Array) -> Array:
        """The state near a guess; the guess itself, with a path still to go, if there is none."""
        from anmstrip.series.newton import Corrections, Newton  # noqa: PLC0415 (only for guesses)

        settings = Corrections(self.scene.solver.tolerance, most=MOST_CORRECTIONS, halvings=8)
        found = Newton(equations, self.solver, settings, self.cost).corrected(guess, 0.0)
        return guess if found is None else found.u

    def _slack(self, plan: Plan) -> float:
        """Tension at the end of a stage that first pulls a flat slack strip, else 0.

        A slack flat strip has no transverse stiffness; its uniformly stretched
        state is known, so that the path starts there.
        """
        if np.any(self.full) or np.any(plan.supports.slope):
            return 0.0
        end = plan.controls.at(1.0)
        pulled = float(end.get("exit.force", np.zeros(3))[0])
        return max(pulled + float(end.get("exit.tension", 0.0)), 0.0)

    def _in_time(self, plan: Plan, settings: Settings) -> Iterator[Arrival]:
        memory, taken = self._memory(plan), 0
        if self.reached is not None:  # broken off, perhaps before the labels moved
            plan, memory = self._fed(plan, memory)
        while memory.times[0] < plan.start + plan.duration:
            left = replace(settings, max_steps=settings.max_steps - taken)
            for step in self._time_steps(plan, memory, left):
                yield self._arrival(plan, step, settings.order)
                memory, taken = step.memory, taken + 1
                if self._due():
                    break
            plan, memory = self._fed(plan, memory)

    def _arrival(self, plan: Plan, step: implicit_dae.TimeStep, order: int) -> Arrival:
        """The end of a step in time."""
        control = (step.end - plan.start) / plan.duration
        full, velocity = plan.supports.full(step.u, control), plan.moving(control)
        velocity[plan.supports.free] = step.v
        facts = (order, step.end - step.start, step.imbalance)
        return Arrival(plan, control, full, velocity, *facts, memory=step.memory, snap=step.snap)

    def _memory(self, plan: Plan) -> Memory:
        """The past of a stage in time: that of the stage before, if nothing jumps."""
        fresh = self.past is not None and not plan.continues(self.past)
        if self.memory is not None and not fresh:
            return self.memory
        stages = [s.duration for s in self.scene.course if self.assembly.frictional(s)]
        first = self.scene.solver.time_step or FIRST_STEP * min(stages)
        free = plan.supports.free
        return backward_differences.start(plan.start, self.full[free], self.velocity[free], first)

    def _time_steps(
        self, plan: Plan, memory: Memory, settings: Settings
    ) -> Iterator[implicit_dae.TimeStep]:
        """Steps of a stage from where its past ends."""
        stages = [s.duration for s in self.scene.course if self.assembly.frictional(s)]
        solver = self.scene.solver
        return implicit_dae.integrate(
            Motion(plan.model, plan.supports, plan.controls, plan.start, plan.duration),
            memory,
            plan.start + plan.duration,
            solver=self.solver,
            settings=settings,
            stepping=implicit_dae.Stepping(
                sum(stages), solver.highest_time_order, solver.time_step, self.follow
            ),
            cost=self.cost,
        )

    def _due(self) -> int:
        """Elements of fresh strip that have to be fed in."""
        return 0 if self.feed is None else self.feed.due(self.full)

    def _fed(self, plan: Plan, memory: Memory) -> tuple[Plan, Memory]:
        """The same stage after fresh strip was fed in for what has left, if it has."""
        elements = self._due()
        if self.feed is None or not elements:
            return plan, memory
        with unbroken():
            plan, memory = relabelled(self.feed, elements, plan, self.course, memory)
            self.full = self.feed.moved(self.full, elements)
            self.velocity = self.feed.moved(self.velocity, elements, position=False)
            self.memory = memory
        return plan, memory
