"""The run of a scene: stage after stage, step after step."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.model import Equilibrium, Motion
from anmstrip.output import checkpoint
from anmstrip.scene.build import Assembly
from anmstrip.scene.checkpoints import packed, unpack
from anmstrip.scene.feeding import Feed, relabelled
from anmstrip.scene.measures import State
from anmstrip.scene.recorder import Recorder
from anmstrip.scene.rules import THREADING
from anmstrip.scene.schema import Scene, StageSpec
from anmstrip.scene.stages import Course, Plan, stretched
from anmstrip.series import implicit_dae
from anmstrip.series.continuation import Outcome, PathStopped, Settings, follow
from anmstrip.series.expansion import Cost
from anmstrip.series.linear_solvers import SparseSolver
from anmstrip.series.path import Branch

Array = NDArray[np.float64]

LOOSEST = 1e-4
"""Largest imbalance on a rate-free path: the first touch of a roller must be seen."""

FIRST_STEP = 0.01
"""First time step of a stage as a fraction of its duration; the error control corrects it."""


HINTS = {
    Outcome.TOO_MANY_STEPS: " Try --set solver.max_steps=…, then --resume.",
    Outcome.STALLED: " Try a finer mesh over the rollers, or a smaller tolerance.",
    Outcome.SINGULAR: " Try to hold the strip in y (centred = true), or to tension it first.",
    Outcome.FOLD: " Try smaller moves or forces in this stage.",
}
"""What to try after a run has stopped early."""


@dataclass(frozen=True)
class Step:
    """One accepted step of a run.

    Attributes
    ----------
    stage : str
    time, end_time : float
        s.
    fraction : float
        Of the whole run.
    step, tangents : int
        Counted over the whole run.
    tension_ratio : float or None
        Tension before the first roller over that after it; at the edges without roller.
    state : State
    """

    stage: str
    time: float
    end_time: float
    fraction: float
    step: int
    tangents: int
    tension_ratio: float | None
    state: State


class Run:
    """Iterator over the accepted steps of a scene; writes results as it goes.

    Parameters
    ----------
    scene : Scene
    directory : path, optional
        Where the results go; nothing is written without.
    resume : bool
        Go on from the checkpoint in the directory.

    Attributes
    ----------
    outcome : Outcome
        How the run ended; ``DONE`` only after the last step.
    message : str
        The same in a sentence.

    Raises
    ------
    InputError
        The scene's mesh or rollers cannot be used, or there is no checkpoint to resume.
    """

    def __init__(
        self, scene: Scene, directory: str | Path | None = None, resume: bool = False
    ) -> None:
        self.scene = scene
        self.directory = None if directory is None else Path(directory)
        self.assembly = Assembly(scene)
        self.course = Course(self.assembly)
        self.full = np.zeros(self.assembly.strip.unknowns)
        self.velocity = np.zeros_like(self.full)
        self.cost, self.steps, self.first_stage = Cost(), 0, 0
        self.effects: dict[str, dict[str, Any]] = {}
        self.stages: dict[str, dict[str, Any]] = {}
        self.memory: implicit_dae.Memory | None = None
        self.reached: float | None = None
        self.state: State | None = None
        self.outcome, self.message = Outcome.TOO_MANY_STEPS, "The run has not ended."
        self.begun, self.spent = time.perf_counter(), 0.0
        self.solver = SparseSolver()
        self.feed = Feed(self.assembly.strip) if scene.strip.feed else None
        self.settings = Settings(
            order=scene.solver.order,
            tolerance=scene.solver.tolerance,
            max_steps=scene.solver.max_steps,
        )
        resumed = self._restored() if resume else None
        self.recorder = (
            None if self.directory is None else Recorder(self.assembly, self.directory, resumed)
        )

    @property
    def seconds(self) -> float:
        """Wall time, that of earlier parts of a resumed run included (s)."""
        return self.spent + time.perf_counter() - self.begun

    @property
    def end_time(self) -> float:
        """Sum of the stages' durations (s)."""
        return sum(stage.duration for stage in self.scene.course)

    def __iter__(self) -> Iterator[Step]:
        try:
            for number, stage in enumerate(self.scene.course):
                if number >= self.first_stage:
                    yield from self._stage(number, stage)
            self.outcome, self.message = Outcome.DONE, self._done()
        except PathStopped as stopped:
            self.outcome = stopped.outcome
            self.message = self._stopped(stopped)
        self._finish()

    def interrupted(self) -> None:
        """Write checkpoint and summary after an interruption."""
        self.outcome = Outcome.INTERRUPTED
        self.message = f"Stopped: {Outcome.INTERRUPTED.value}."
        self._checkpoint(force=True)
        self._finish()

    # stages ------------------------------------------------------------------

    def _stage(self, number: int, stage: StageSpec) -> Iterator[Step]:
        plan = self._planned(number, stage)
        self.counted = (time.perf_counter(), self.steps, self.cost.expansions)
        if self.reached is not None:  # resumed inside this stage, or at its end
            self.state = self._state(plan, self.reached)
        if self.reached is None or self.reached < 1.0:
            advance = self._in_time if plan.in_time else self._rate_free
            try:
                yield from advance(plan)
            finally:
                self._count(plan)
        self._checkpoint(force=True)
        self.course.finish(stage)
        self.first_stage, self.memory, self.reached = number + 1, None, None
        if not plan.in_time:
            self.velocity = np.zeros_like(self.full)

    def _left(self, settings: Settings) -> Settings:
        """The same choices, with the steps that the run may still take."""
        return replace(settings, max_steps=settings.max_steps - self.steps)

    def _state(self, plan: Plan, control: float, branch: Branch | None = None) -> State:
        time, velocity = plan.start + control * plan.duration, self.velocity
        return State(plan, time, control, self.full, velocity if plan.in_time else None, branch)

    def _planned(self, number: int, stage: StageSpec) -> Plan:
        reactions = {}
        if self.state is not None:
            for name, control in stage.edges.items():
                if control.release and name not in self.course.released:
                    edge = self.assembly.strip.edges[name]
                    held = self.state.edge_force(name) / edge.length
                    reactions[name] = held - self.course.values.get(f"{name}.force", np.zeros(3))
        return self.course.plan(stage, reactions)

    def _rate_free(self, plan: Plan) -> Iterator[Step]:
        free = plan.supports.free
        equations = Equilibrium(plan.model, plan.supports, plan.controls)
        u = self.full[free]
        if plan.name == THREADING and self.reached is None:
            assert self.assembly.thread is not None
            u = self.assembly.thread.guess(self.assembly.strip, self.assembly.pattern)[free]
        elif tension := self._slack(plan):
            u = stretched(self.assembly, tension)[free]
            equations = Equilibrium(plan.model, *plan.held_at_end)
        settings = replace(self.settings, tolerance=min(self.settings.tolerance, LOOSEST))
        for step in follow(
            equations,
            u,
            solver=self.solver,
            settings=self._left(settings),
            start=self.reached or 0.0,
            cost=self.cost,
        ):
            u, control = step.branch.end
            self.full = plan.supports.full(u, control)
            facts = (step.branch.order, abs(control - float(step.branch.control[0])))
            branch = step.branch if equations.controls is plan.controls else None
            yield self._accepted(plan, control, (*facts, step.imbalance), branch)

    def _slack(self, plan: Plan) -> float:
        """Tension at the end of a stage that first pulls a flat slack strip, else 0.

        A slack flat strip has no transverse stiffness; its uniformly stretched
        state is known, so that the path starts there.
        """
        force = plan.controls.at(1.0).get("exit.force")
        if force is None or np.any(self.full) or np.any(plan.supports.slope):
            return 0.0
        return max(float(force[0]), 0.0)

    def _in_time(self, plan: Plan) -> Iterator[Step]:
        free = plan.supports.free
        first = self.scene.solver.time_step or FIRST_STEP * plan.duration
        self.memory = self.memory or implicit_dae.start(
            plan.start, self.full[free], self.velocity[free], first
        )
        while self.memory.times[0] < plan.start + plan.duration:
            for step in self._time_steps(plan, self.memory):
                self.memory = step.memory
                control = (step.end - plan.start) / plan.duration
                self.full = plan.supports.full(step.u, control)
                self.velocity = plan.supports.slope / plan.duration
                self.velocity[free] = step.v
                facts = (self.settings.order, step.end - step.start, step.imbalance)
                yield self._accepted(plan, control, facts)
                if self.feed is not None and (elements := self.feed.due(self.full)):
                    plan = self._relabelled(plan, elements)
                    break

    def _time_steps(
        self, plan: Plan, memory: implicit_dae.Memory
    ) -> Iterator[implicit_dae.TimeStep]:
        """Steps of a stage from where its past ends."""
        return implicit_dae.integrate(
            Motion(plan.model, plan.supports, plan.controls, plan.start, plan.duration),
            memory,
            plan.start + plan.duration,
            solver=self.solver,
            settings=self._left(self.settings),
            whole=sum(s.duration for s in self.scene.course if self.assembly.frictional(s)),
            time_order=self.scene.solver.time_order,
            fixed=self.scene.solver.time_step,
            cost=self.cost,
        )

    def _relabelled(self, plan: Plan, elements: int) -> Plan:
        """The same stage after fresh strip was fed in for what has left."""
        assert self.feed is not None and self.memory is not None
        plan, self.memory = relabelled(self.feed, elements, plan, self.course, self.memory)
        self.full = self.feed.moved(self.full, elements)
        self.velocity = self.feed.moved(self.velocity, elements, position=False)
        return plan

    # what is written -----------------------------------------------------------

    def _accepted(
        self,
        plan: Plan,
        control: float,
        facts: tuple[int, float, float],
        branch: Branch | None = None,
    ) -> Step:
        before, state = self.state, self._state(plan, control, branch)
        self.state, self.reached = state, control
        self.steps += 1
        self._count(plan)
        self._record(before, state, facts)
        return Step(
            plan.name,
            state.time,
            self.end_time,
            state.time / self.end_time,
            self.steps,
            self.cost.expansions,
            _ratio(state),
            state,
        )

    def _record(self, before: State | None, state: State, facts: tuple[int, float, float]) -> None:
        if self.recorder is None:
            return
        names = ("order", "range", "residual")
        self.recorder.row(
            state,
            {
                "stage": state.plan.name,
                "time": state.time,
                "step": self.steps,
                "tangents": self.cost.expansions,
                **dict(zip(names, facts, strict=True)),
            },
        )
        self.recorder.observe(self.steps, before, state)
        self._checkpoint()

    def _count(self, plan: Plan) -> None:
        """Add what was spent since the last time to the counters."""
        begin, steps, expansions = self.counted
        seconds = plan.model.seconds
        for effect in plan.model.effects:
            points = getattr(effect, "points", None)
            if points is None:
                points = getattr(getattr(effect, "operator", None), "points", 0)
            entry = self.effects.setdefault(effect.name, {"points": points, "seconds": 0.0})
            entry["seconds"] += seconds[effect.name]
            seconds[effect.name] = 0.0
        self.counted = (time.perf_counter(), self.steps, self.cost.expansions)
        entry = self.stages.setdefault(plan.name, {"steps": 0, "tangents": 0, "seconds": 0.0})
        entry["steps"] += self.steps - steps
        entry["tangents"] += self.cost.expansions - expansions
        entry["seconds"] += self.counted[0] - begin

    def _finish(self) -> None:
        if self.recorder is None:
            return
        if self.state is not None and self.recorder.states == 0:
            self.recorder.write_state(self.state)
        self.recorder.summary(self.facts(), self.state)

    def facts(self) -> dict[str, Any]:
        """Counters of the run, as in ``summary.json``."""
        return {
            "status": "done" if self.outcome.done else self.outcome.name.lower(),
            "message": self.message,
            "unknowns": self.assembly.strip.unknowns,
            "steps": self.steps,
            "tangents": self.cost.expansions,
            "factorisations": self.cost.factorisations,
            "wall_seconds": self.seconds,
            "seconds": self.cost.seconds,
            "linear_solver": self.solver.name,
            "effects": self.effects,
            "stages": self.stages,
            **({} if self.feed is None else {"feed": self.feed.facts(self.full)}),
        }

    def _done(self) -> str:
        return (
            f"Done: {self.end_time:g} s in {self.steps} steps, {self.cost.expansions} tangents, "
            f"{self.seconds:.1f} s."
        )

    def _stopped(self, stopped: PathStopped) -> str:
        reached = 0.0 if self.state is None else self.state.time
        stage = self.scene.course[min(self.first_stage, len(self.scene.course) - 1)].name
        words = ": ".join(part for part in (stopped.outcome.value, stopped.detail) if part)
        hint = HINTS.get(stopped.outcome, "")
        return f"Stopped in stage {stage} at t = {reached:.6g} s: {words}.{hint}"

    # checkpoint ------------------------------------------------------------------

    def _checkpoint(self, force: bool = False) -> None:
        if self.recorder is not None:
            self.recorder.checkpoint(*packed(self), force)

    def _restored(self) -> dict[str, Any]:
        assert self.directory is not None
        arrays, facts = checkpoint.load(self.directory / "checkpoint.npz")
        unpack(self, arrays, facts)
        return facts


def _ratio(state: State) -> float | None:
    for reading in state.rollers.values():
        return reading.tension_ratio
    return None
