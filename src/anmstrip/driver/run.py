"""The run of a scene: stage after stage, step after step."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Cost
from anmstrip.continuation.follow import Pace
from anmstrip.continuation.status import Outcome, PathStopped
from anmstrip.driver.diagnosis import Failure, diagnosis
from anmstrip.driver.recorder import Recorder
from anmstrip.equilibrium import StageProblem
from anmstrip.fem.kinematics import SHELL
from anmstrip.results.files import load_checkpoint
from anmstrip.results.state import State
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.series.condition import condition
from anmstrip.simulation.march import Arrival, March, unbroken
from anmstrip.simulation.problem import Assembly
from anmstrip.timestepping.formulas import Memory

if TYPE_CHECKING:
    from anmstrip.results.events import Event, EventWatch


Array = NDArray[np.float64]


def packed(run: Run) -> tuple[dict[str, Array], dict[str, Any]]:
    """Arrays and plain facts from which :func:`unpack` restores a run."""
    march, course = run.march, run.march.course
    arrays = {"full": march.full, "velocity": march.velocity}
    arrays |= {f"moved.{name}": value for name, value in course.moved.items()}
    arrays |= {f"speed.{name}": value for name, value in course.speeds.items()}
    arrays |= {f"begun.{name}": value for name, value in course.begun.items()}
    arrays |= {f"value.{name}": value for name, value in course.values.items()}
    if march.feed is not None:
        arrays |= {f"home.{name}": value for name, value in march.feed.home.items()}
    facts: dict[str, Any] = {
        "stage": run.first_stage,
        "steps": run.steps,
        "expansions": run.cost.expansions,
        "factorisations": run.cost.factorisations,
        "seconds": run.seconds,
        "reached": march.reached,
        "time": 0.0 if run.state is None else run.state.time,
        "course_time": course.time,
        "released": sorted(course.released),
        "stages": run.stages,
        "effects": run.effects,
        "snaps": run.snaps,
        "slack": march.slack,
        "fed": 0 if march.feed is None else march.feed.elements,
    }
    if march.memory is not None:
        facts["times"], facts["next_step"] = list(march.memory.times), march.memory.step
        facts["time_order"] = march.memory.order
        arrays["states"], arrays["v"] = np.array(march.memory.states), march.memory.v
    if march.pace is not None:
        facts["pace"] = {
            "control": march.pace.control,
            "last": march.pace.last,
            "shrinking": march.pace.shrinking,
            "arclength": march.pace.arclength,
        }
        if march.pace.forward is not None:
            arrays["forward"], facts["forward"] = march.pace.forward
    return arrays, facts


def unpack(run: Run, arrays: Mapping[str, Array], facts: Mapping[str, Any]) -> None:
    """Bring a new run to where a packed one was."""
    march = run.march
    march.full, march.velocity = arrays["full"], arrays["velocity"]
    run.first_stage, run.steps, march.reached = facts["stage"], facts["steps"], facts["reached"]
    run.cost.expansions = facts["expansions"]
    run.cost.factorisations = facts["factorisations"]
    run.spent, run.stages, run.effects = facts["seconds"], facts["stages"], facts["effects"]
    run.snaps = facts["snaps"]
    march.course.time, march.course.released = facts["course_time"], set(facts["released"])
    kept = {
        "moved": march.course.moved,
        "begun": march.course.begun,
        "speed": march.course.speeds,
        "value": march.course.values,
    }
    if march.feed is not None:
        kept["home"], march.feed.elements = march.feed.home, facts["fed"]
    for name, value in arrays.items():
        kind, _, key = name.partition(".")
        if kind in kept:
            kept[kind][key] = value
    march.slack = facts["slack"]
    if "pace" in facts:
        forward = (arrays["forward"], facts["forward"]) if "forward" in facts else None
        march.pace = Pace(
            facts["pace"]["control"],
            facts["pace"]["last"],
            tuple((a, b) for a, b in facts["pace"]["shrinking"]),
            facts["pace"]["arclength"],
            forward,
        )
    if "times" in facts:
        states = tuple(arrays["states"])
        march.memory = Memory(
            tuple(facts["times"]), states, arrays["v"], facts["next_step"], facts["time_order"]
        )


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
    scene : SceneSpec
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
        self, scene: SceneSpec, directory: str | Path | None = None, resume: bool = False
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

    def _labelled(self, plan: StageProblem) -> State:
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

    def _count(self, plan: StageProblem) -> None:
        """Add what was spent since the last time to the counters."""
        begin, steps, expansions = self.counted
        seconds = plan.model.seconds
        for effect in plan.model.effects:
            entry = self.effects.setdefault(effect.name, {"points": effect.points, "seconds": 0.0})
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

    def _judge(self, plan: StageProblem) -> None:
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
        from anmstrip.results.wrinkles import Wrinkling

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
        arrays, facts = load_checkpoint(self.directory / "checkpoint.npz")
        unpack(self, arrays, facts)
        return facts


def _imperfection(scene: SceneSpec) -> Array | None:
    if scene.strip.imperfection is None:
        return None
    from anmstrip.simulation.imperfection import (
        imperfection_of,
    )

    return imperfection_of(scene)


def _watch(assembly: Assembly) -> EventWatch | None:
    if not assembly.scene.output.events:
        return None
    from anmstrip.results.events import EventWatch

    fed = assembly.scene.strip.feed
    tension = assembly.scales.tension
    return EventWatch(assembly.contact, assembly.rollers, assembly.friction, tension, fed)
