"""The run of a scene: stage after stage, step after step."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.kinematics import SHELL
from anmstrip.output import checkpoint
from anmstrip.scene.build import Assembly
from anmstrip.scene.checkpoints import packed, unpack
from anmstrip.scene.diagnosis import Failure, diagnosis
from anmstrip.scene.interrupts import unbroken
from anmstrip.scene.march import Arrival, March
from anmstrip.scene.measures import State
from anmstrip.scene.recorder import Recorder
from anmstrip.scene.schema import Scene, StageSpec
from anmstrip.scene.stages import Plan
from anmstrip.series.condition import condition
from anmstrip.series.expansion import Cost
from anmstrip.series.outcome import Outcome, PathStopped

if TYPE_CHECKING:
    from anmstrip.scene.events import Event, EventWatch

Array = NDArray[np.float64]


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
    state : State
    events : tuple of Event
        What happened in it, if the scene asks for events.
    """

    stage: str
    time: float
    end_time: float
    fraction: float
    step: int
    tangents: int
    state: State
    events: tuple[Event, ...] = ()

    @property
    def tension_ratio(self) -> float | None:
        """Tension before the first roller over that after it, or None without a roller."""
        readings = self.state.rollers.values()
        return next((reading.tension_ratio for reading in readings), None)


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
    warnings : list of str
        What the last state of a written run gives cause for.

    Raises
    ------
    InputError
        The scene's mesh or rollers cannot be used, nothing buckles that should be imperfect,
        or there is no checkpoint to resume.
    """

    def __init__(
        self, scene: Scene, directory: str | Path | None = None, resume: bool = False
    ) -> None:
        self.scene = scene
        self.directory = None if directory is None else Path(directory)
        self.assembly = Assembly(scene, _imperfection(scene))
        self.march = March(self.assembly)
        self.steps, self.first_stage = 0, 0
        self.effects: dict[str, dict[str, Any]] = {}
        self.stages: dict[str, dict[str, Any]] = {}
        self.snaps: list[dict[str, Any]] = []
        self.state: State | None = None
        self.outcome, self.message = Outcome.TOO_MANY_STEPS, "The run has not ended."
        self.warnings: list[str] = []
        self.begun, self.spent = time.perf_counter(), 0.0
        resumed = self._restored() if resume else None
        self.watch = _watch(self.assembly)
        self.recorder = (
            None if self.directory is None else Recorder(self.assembly, self.directory, resumed)
        )

    @property
    def cost(self) -> Cost:
        """What was factorised and solved so far."""
        return self.march.cost

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
            for stage in self.scene.course[self.first_stage :]:
                yield from self._stage(stage)
            self.outcome, self.message = Outcome.DONE, self._done()
        except PathStopped as stopped:
            self.outcome = stopped.outcome
            self.message = self._stopped(stopped)
            with unbroken():
                self._checkpoint(force=True)
        self._finish()

    def interrupted(self) -> None:
        """Write checkpoint and summary after an interruption."""
        self.outcome = Outcome.INTERRUPTED
        self.message = f"Stopped: {Outcome.INTERRUPTED.value}."
        with unbroken():
            self._checkpoint(force=True)
            self._finish()

    # stages ------------------------------------------------------------------

    def _stage(self, stage: StageSpec) -> Iterator[Step]:
        march = self.march
        with unbroken():
            plan = march.planned(stage, self.state)
        self.counted = (time.perf_counter(), self.steps, self.cost.expansions)
        if march.reached is not None or self.state is None:  # resumed, or at the very beginning
            self.state = march.here(plan)
        if march.reached is None or march.reached < 1.0:
            try:
                for arrival in march.through(plan, self.scene.solver.max_steps - self.steps):
                    with unbroken():
                        step = self._accepted(arrival)
                    yield step
            finally:
                self._count(plan)
                self._judge(plan)
        with unbroken():
            self._checkpoint(force=True)
            march.finish(stage, plan)
            self.first_stage += 1

    # what is written -----------------------------------------------------------

    def _accepted(self, arrival: Arrival) -> Step:
        before, self.state = self._labelled(arrival.plan), arrival.state
        if arrival.snap and (snap := self._snap(arrival))["distance"] > self._resolved:
            self.snaps.append(snap)
        self.march.accept(arrival)
        self.steps += 1
        self._count(arrival.plan)
        events = () if self.watch is None else self.watch.during(before, self.state)
        self._record(before, self.state, arrival, events)
        return Step(
            arrival.plan.name,
            self.state.time,
            self.end_time,
            self.state.time / self.end_time,
            self.steps,
            self.cost.expansions,
            self.state,
            events,
        )

    def _labelled(self, plan: Plan) -> State:
        """The state before a step, in the labels of that step."""
        state = self.march.here(plan) if self.state is None else self.state
        velocity = None if state.velocity is None else self.march.velocity
        return replace(state, full=self.march.full, velocity=velocity)

    def _record(
        self, before: State, state: State, arrival: Arrival, events: tuple[Event, ...]
    ) -> None:
        if self.recorder is None:
            return
        facts = {
            "stage": state.plan.name,
            "time": state.time,
            "step": self.steps,
            "tangents": self.cost.expansions,
            "order": arrival.order,
            "range": arrival.range,
            "residual": arrival.imbalance,
        }
        self.recorder.row(state, facts)
        self.recorder.happened(events)
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

    def _snap(self, arrival: Arrival) -> dict[str, Any]:
        """When and how far the strip went, where friction had no equilibrium to hold it in."""
        moved = np.abs(arrival.full - self.march.full)[
            self.assembly.strip.unknowns_of(self.assembly.strip.node_values)
        ]
        return {
            "stage": arrival.plan.name,
            "time": arrival.state.time,
            "distance": float(moved.max()),
        }

    @property
    def _resolved(self) -> float:
        """Distance (m) below which a place is not known: error that the run may make."""
        return self.scene.solver.tolerance * self.assembly.scales.length

    def _judge(self, plan: Plan) -> None:
        """How well conditioned the last tangent of a stage was: four back-substitutions."""
        if self.march.solver.latest is not None:
            with self.cost.timed("condition"), np.errstate(all="ignore"):
                self.stages[plan.name]["condition"] = condition(*self.march.solver.latest)

    def _finish(self) -> None:
        if self.recorder is None:
            return
        if self.state is not None and self._end_is_missing(self.state.time):
            self.recorder.write_state(self.state)
        told = {} if self.state is None else self._wrinkling(self.state)
        self.recorder.summary({**self.facts(), **told}, self.state)

    def _wrinkling(self, state: State) -> dict[str, Any]:
        """What a shell's wrinkles are like at the end; other levels have none."""
        if self.assembly.kinematics is not SHELL:
            return {}
        from anmstrip.scene.wrinkling import Wrinkling  # noqa: PLC0415 (only for shells)

        found = Wrinkling(state)
        self.warnings = found.warnings
        assert self.recorder is not None
        return {
            "wrinkle_amplitude": found.amplitude(self.recorder.surface),
            "compressive_membrane_force": found.compression,
            "warnings": found.warnings,
        }

    def _end_is_missing(self, time: float) -> bool:
        """Whether the last state is not on disk: of a run that will not be gone on with."""
        assert self.recorder is not None
        written = self.recorder.strip.entries
        if not written:
            return True
        chosen = self.scene.output.times is not None or self.outcome is Outcome.INTERRUPTED
        return not chosen and written[-1].time < time

    def facts(self) -> dict[str, Any]:
        """Counters of the run, as in ``summary.json``."""
        march = self.march
        return {
            "status": "done" if self.outcome.done else self.outcome.name.lower(),
            "message": self.message,
            "unknowns": self.assembly.strip.unknowns,
            "steps": self.steps,
            "tangents": self.cost.expansions,
            "factorisations": self.cost.factorisations,
            "wall_seconds": self.seconds,
            "seconds": self.cost.seconds,
            "linear_solver": self.march.solver.name,
            "effects": self.effects,
            "stages": self.stages,
            "snaps": self.snaps,
            **({} if march.feed is None else {"feed": march.feed.facts(march.full)}),
        }

    def _done(self) -> str:
        snaps = "".join(
            f" At t = {snap['time']:.6g} s the strip ran away by {snap['distance']:.2g} m: "
            "friction had no equilibrium to hold it in."
            for snap in self.snaps
        )
        return (
            f"Done: {self.end_time:g} s in {self.steps} steps, {self.cost.expansions} tangents, "
            f"{self.seconds:.1f} s.{snaps}"
        )

    def _stopped(self, stopped: PathStopped) -> str:
        stage = self.scene.course[min(self.first_stage, len(self.scene.course) - 1)]
        state = self.march.here(self.march.course.plan(stage, {}))
        return diagnosis(Failure(self.assembly, stage, state, stopped))

    # checkpoint ------------------------------------------------------------------

    def _checkpoint(self, force: bool = False) -> None:
        if self.recorder is not None:
            self.recorder.checkpoint(*packed(self), force)

    def _restored(self) -> dict[str, Any]:
        assert self.directory is not None
        arrays, facts = checkpoint.load(self.directory / "checkpoint.npz")
        unpack(self, arrays, facts)
        return facts


def _imperfection(scene: Scene) -> Array | None:
    if scene.strip.imperfection is None:
        return None
    from anmstrip.scene.imperfection import imperfection_of  # noqa: PLC0415 (only if asked for)

    return imperfection_of(scene)


def _watch(assembly: Assembly) -> EventWatch | None:
    if not assembly.scene.output.events:
        return None
    from anmstrip.scene.events import EventWatch  # noqa: PLC0415 (only if asked for)

    return EventWatch(assembly)
