"""The run of a scene: stage after stage, step after step."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import asdict, replace
from functools import partial, reduce
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anmstrip.advice.physics import beyond_capacity
from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import (
    RULES_AT_END,
    RULES_OF_STAGES,
    beside_rollers,
    coarse_mesh,
    guessed_rate,
    propose_one_mesh,
    proposed_keys,
    warnings,
    wrinkled_instead,
)
from anmstrip.arrays import Array
from anmstrip.continuation.follow import Pace
from anmstrip.continuation.path import Outcome, PathStopped
from anmstrip.driver.budget import LARGE_MESH_ERROR, Budget, Part
from anmstrip.driver.recorder import Recorder, history_row, identity, kept_values, read_checkpoint
from anmstrip.equilibrium import StageProblem
from anmstrip.errors import Named, as_path
from anmstrip.fem.geometry import SHELL
from anmstrip.linalg.direct import SingularTangentError
from anmstrip.results.files import ERROR_WORDS, read_history, refused_checkpoint
from anmstrip.results.plastic import MeanFlow
from anmstrip.results.state import State
from anmstrip.results.wrinkles import BIFURCATION, Onset, WrinkleWatch, Wrinkling
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.scene.tables import ENDS
from anmstrip.simulation.defaults import line_speed
from anmstrip.simulation.march import March, Step, delay_interrupts, imperfection_of
from anmstrip.simulation.problem import Assembly, EffectMaker
from anmstrip.timestepping.formulas import Errors, Memory

if TYPE_CHECKING:
    from anmstrip.results.events import Event, EventWatch


WRINKLE_WORDS = {
    "wrinkles": "the strip is about to wrinkle",
    "waves": "the strip, never quite flat, has waves as high as half its thickness",
    "bifurcation": "the path bifurcates: beyond, the smooth strip is unstable, or again stable",
}
"""What is said of the kinds of :class:`~anmstrip.results.wrinkles.Onset`."""


def onset_words(found: Sequence[Mapping[str, Any]]) -> str:
    """Say where the first of the onsets of one kind is, and how many follow."""
    if not found:
        return ""
    first, last, following = found[0], found[-1], len(found) - 1
    uneven = first.get("latent_flatness")
    load = "" if uneven is None else f", latent flatness {uneven:.3g} I-units"
    span = " between {} and {}".format(*first["span"]) if first.get("span") else ""
    more = f"; {following} more up to t = {last['time']:.6g} s, in summary.json" * bool(following)
    there = first.get("on_halves")
    mesh = there and (
        f"; on elements of half the length at t = {there['time']:.6g} s, exit tension "
        f"{there['exit_tension']:.5g} N/m"
    )
    return (
        f" At t = {first['time']:.6g} s (stage {first['stage']}, exit tension "
        f"{first['exit_tension']:.5g} N/m{load}) {WRINKLE_WORDS[first['kind']]}, "
        f"with wavelengths of {first['wavelength_along']:.3g} m along and "
        f"{first['wavelength']:.3g} m across, most{span} at x = {first['x']:.3g} m, "
        f"y = {first['y']:.3g} m of the flat strip{mesh or ''}{more}."
    )


MAX_WAITING_UNKNOWNS = 1_000_000
"""Unknowns of the states, 16 bytes each, that wait until the history is asked for."""

CHECKPOINT_ATTRIBUTES = {
    **{name: name for name in ("steps", "stages", "effects", "snaps", "wrinkles", "passed")},
    **{name: f"march.{name}" for name in ("reached", "slack", "conveyed")},
    "timed": "cost.seconds",
    "linear_solver": "march.solver.name",
    **{name: f"cost.{name}" for name in ("expansions", "factorisations")},
    **{"stage": "first_stage", "seconds": "spent", "looked": "budget.time"},
    "course_time": "march.course.time",
    **{name: f"flow.{name}" for name in ("work", "weighted", "steady")},
}
"""Facts of a checkpoint, and the attributes of a run that they are."""


def pack(run: Run) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return arrays and plain facts from which :func:`unpack` restores a run."""
    march, memory, pace = run.march, run.march.memory, run.march.pace
    kept = (kept_values(march.course) | {"load": run.budget.loads}).items()
    arrays = {f"{kind}.{name}": x for kind, values in kept for name, x in values.items()}
    arrays |= {"full": march.full, "velocity": march.velocity}
    facts = {key: attrgetter(attribute)(run) for key, attribute in CHECKPOINT_ATTRIBUTES.items()}
    facts |= {"input": run.identity, "seconds": run.seconds}
    facts |= {"time": run.state.time if run.state is not None and run.steps else -1.0}
    facts |= {"released": sorted(march.course.released)}
    if run.budget.error is not None:
        arrays["mesh_error"] = run.budget.error
    if memory is not None:
        arrays |= {"states": np.array(memory.states), "v": memory.v}
        facts |= {"times": memory.times, "next_step": memory.step, "time_order": memory.order}
        if memory.errors is not None:
            arrays["errors"] = np.array([memory.errors.before, memory.errors.after])
            facts["error_rate"] = memory.errors.rate
    if pace is not None:
        facts["pace"] = asdict(replace(pace, forward=None))
        if pace.forward is not None:
            arrays["forward"], facts["forward"] = pace.forward
    return arrays, facts


def unpack(run: Run, arrays: Mapping[str, Array], facts: Mapping[str, Any]) -> None:
    """Bring a new run to where a packed one was."""
    march = run.march
    for key, attribute in CHECKPOINT_ATTRIBUTES.items():
        *owners, name = attribute.split(".")
        setattr(reduce(getattr, owners, run), name, facts[key])
    march.full, march.velocity = arrays["full"], arrays["velocity"]
    march.course.released = set(facts["released"])
    run.budget.error = arrays.get("mesh_error")
    kept = kept_values(march.course) | {"load": run.budget.loads}
    for name, value in arrays.items():
        kind, _, key = name.partition(".")
        if kind in kept:
            kept[kind][key] = value
    if "pace" in facts:
        forward = (arrays["forward"], facts["forward"]) if "forward" in facts else None
        shrinking = tuple((a, b) for a, b in facts["pace"]["shrinking"])
        march.pace = Pace(**{**facts["pace"], "shrinking": shrinking, "forward": forward})
    if "times" in facts:
        past = tuple(facts["times"]), tuple(arrays["states"]), arrays["v"]
        errors = None
        if "errors" in arrays:
            before, after = arrays["errors"]
            errors = Errors(before, after, facts["error_rate"])
        march.memory = Memory(*past, facts["next_step"], facts["time_order"], errors)


def doubled_in_length(state: State) -> bool:
    """Return whether tension has stretched strip by its own length, for which no law is meant."""
    if state.membrane is None:
        return False
    elastic = state.membrane.at(state.full, state.controls)[0, 0]
    return bool(elastic.max() > state.plan.model.strip.tensile_stiffness)


RUNAWAY_SPEED = 1e3
"""Speed of strip that runs away, over the largest that a stage gives to rollers and ends, or where
all stand over that of the line."""


RUNAWAY_WAY = 0.01
"""Part of its length that fed strip has run by then: elastic snaps give off no more than the
strain at yield, up to 0.4 per cent."""


def has_run_away(state: State, usual: float) -> bool:
    """Return whether strip passes at a speed that no friction ends.

    In a steady stage nothing is conveyed, and no stationary state has such a speed.
    """
    way = RUNAWAY_WAY * state.plan.model.strip.length
    conveyed = state.plan.fed and abs(state.conveyed) >= way
    if not (conveyed or state.plan.steady):
        return False
    return abs(state.strip_speed or 0.0) > RUNAWAY_SPEED * (state.plan.fastest or usual) > 0.0


def spins_away(state: State) -> bool:
    """Return whether a roller turns at a speed that says that friction refuses its torque."""
    speeds = (abs(contact.surface_speed) for contact in state.contacts.values())
    return max(speeds, default=0.0) > RUNAWAY_SPEED * state.plan.fastest > 0.0


def endless(state: State, usual: float, goes_on: bool) -> Outcome | None:
    """Return why a run stops at a state from which it would go on for nothing, None if it does not.

    Beside the usual speed of the scene (m/s); ``goes_on`` says whether another stage follows.
    """
    if doubled_in_length(state):
        return Outcome.OVERSTRETCHED
    if goes_on and state.control > 1.0 - 1e-9 and state.plan.in_time and spins_away(state):
        return Outcome.SPUN
    return Outcome.RAN_AWAY if has_run_away(state, usual) else None


def require_scene(scene: object) -> None:
    """Refuse anything but a scene, as its path."""
    if not isinstance(scene, SceneSpec):
        raise TypeError(f"expected a scene, as Scene.load({scene!r}) returns; given {scene!r}")


class Run:
    """Iterator over the accepted steps of a scene; writes results as it goes.

    Parameters
    ----------
    scene : SceneSpec
    directory : path, optional
        Where the results go; nothing is written without.
    resume : bool
        Go on from the checkpoint in the directory.
    effects : iterable of callables, optional
        Effects of one's own, each a function of the strip that returns a
        :class:`~anmstrip.mechanics.effects.LawEffect`; they act in every stage, in full at once.

    Attributes
    ----------
    outcome : Outcome
        How the run ended; ``DONE`` only after the last step.
    message : str
        The same in a sentence.
    warnings : list of str
        What the scene and the last state of a written run give cause for.
    cost : Cost
        Factorisations and back-substitutions so far.
    end_time : float
        Sum of the stages' durations (s).

    Raises
    ------
    InputError
        The scene's mesh or rollers cannot be used, nothing buckles that should be imperfect,
        or there is no checkpoint of this scene to resume.
    TypeError
        Anything but a scene is given, as its path.
    """

    estimates = False  # also errors of a run that is not written

    def __init__(
        self,
        scene: SceneSpec,
        directory: str | Path | None = None,
        resume: bool = False,
        effects: Iterable[EffectMaker] = (),
    ) -> None:
        require_scene(scene)
        if not isinstance(effects, Iterable):
            raise TypeError(f"expected a list of functions of the strip; given effects={effects!r}")
        self.directory = None if directory is None else as_path("directory", directory)
        bent = None if scene.strip.imperfection is None else imperfection_of(scene)
        a = self.assembly = Assembly(scene, bent, tuple(effects))
        self.scene, self.march, self.identity = a.scene, March(a), identity(a)
        self.cost, self.end_time, self.budget = self.march.cost, a.scene.ends[-1], Budget(a)
        self.steps, self.first_stage = 0, 0
        self.effects: dict[str, dict[str, Any]] = {}
        self.stages: dict[str, dict[str, Any]] = {}
        self.snaps: list[dict[str, Any]] = []
        self.passed: list[str] = []  # warnings of states at the ends of earlier stages
        self.wrinkles: list[dict[str, Any]] = []
        self.flow = MeanFlow()
        self.state: State | None = None
        self._farthest: State | None = None  # of a steady stage, with the largest share of it
        self.outcome, self.message = Outcome.NOT_ENDED, "The run has not ended."
        self.stopped: PathStopped | None = None
        self.warnings: list[str] = []
        self.flatness: dict[str, float] = {}
        self._forewarnings: list[str] | None = None
        self.rows: list[dict[str, Any]] = []
        self.unread: list[Step] = []
        self.begun, self.spent = time.perf_counter(), 0.0
        resumed = None
        if resume:
            assert self.directory is not None
            path = self.directory / "checkpoint.npz"
            arrays, resumed = read_checkpoint(path, self.march)
            try:
                unpack(self, arrays, resumed)
            except KeyError as lost:
                found = f"written by another version of this program, without {lost}"
                raise refused_checkpoint(path, found) from lost
        self.watch: EventWatch | None = None
        if scene.output.events and a.contact is not None:
            from anmstrip.results.events import EventWatch

            tolerance = scene.solver.tolerance
            self.watch = EventWatch(a.contact, a.rollers, a.friction, a.scales.tension, tolerance)
        self.onsets: WrinkleWatch | None = None
        if a.kinematics is SHELL and a.scene.strip.bending:  # else compression alone wrinkles it
            self.onsets = WrinkleWatch(self.cost)
        self.recorder: Recorder | None = None
        if self.directory is not None:
            errors = partial(self.budget.of_solver, march=self.march)
            self.recorder = Recorder(a, self.directory, errors, resumed)

    def forewarnings(self) -> list[str]:
        """Return what the scene alone gives cause for, before anything is solved."""
        if self._forewarnings is None:
            self._forewarnings = warnings(Preview.of(self.assembly))
        return self._forewarnings

    @property
    def seconds(self) -> float:
        """Wall time, that of earlier parts of a resumed run included (s)."""
        return self.spent + time.perf_counter() - self.begun

    @property
    def history(self) -> dict[str, Array | list[str]]:
        """Columns of ``history.csv`` by name, an entry for each accepted step, written or not.

        ``pandas.DataFrame(run.history)`` is the same as a table of pandas.
        """
        if self.directory is not None:
            return read_history(self.directory / "history.csv")
        self._read()
        columns = Named[Array | list[str]]()
        for name in self.rows[0] if self.rows else ():
            cells = [row[name] for row in self.rows]
            columns[name] = cells if name == "stage" else np.array(cells, dtype=float)
        return columns

    def __repr__(self) -> str:
        name = self.scene.title or self.scene.name
        return f"<Run of {name!r}: {self.steps} steps. {self.message}>"

    def __iter__(self) -> Iterator[Step]:
        with nullcontext() if self.recorder is None else self.recorder.lock:
            yield from self._run_stages()

    def _run_stages(self) -> Iterator[Step]:
        """Take all steps that are left; then write what is read off the last state."""
        course = self.scene.course
        try:
            for stage in course[self.first_stage :]:
                yield from self._run_stage(stage)
            self.outcome, self.message = Outcome.DONE, self.words_of_success()
        except (PathStopped, MemoryError) as error:
            from anmstrip.advice.diagnosis import Failure, diagnosis, ran_away

            reached, size = self.march.reached or 0.0, f"{self.assembly.unknowns} unknowns"
            too_large = PathStopped(Outcome.TOO_LARGE, reached, size)
            stopped = error if isinstance(error, PathStopped) else too_large
            self.outcome, self.stopped = stopped.outcome, stopped
            stage = course[min(self.first_stage, len(course) - 1)]
            state = self.march.here(self.march.course.plan(stage, {}))
            goes_on = self.recorder is not None and not self.estimates
            with delay_interrupts():
                self._checkpoint(force=True)
            if stopped.outcome is Outcome.FOLD and self._farthest is not None:
                self.state = state = self._farthest  # and not where the path came back to
            failure = Failure(self.assembly, stage, state, stopped, resumable=goes_on)
            self.message = diagnosis(failure)
            if not (self.outcome is Outcome.TOO_LARGE or ran_away(failure)):
                self._look_at_errors(stage)
        self._finish()

    def interrupted(self) -> None:
        """Write checkpoint and summary after an interruption."""
        self.outcome = Outcome.INTERRUPTED
        self.message = f"Stopped: {Outcome.INTERRUPTED.value}."
        with delay_interrupts():
            self._checkpoint(force=True)
            self._finish()

    def _run_stage(self, stage: StageSpec) -> Iterator[Step]:
        """Take the steps of a stage, from its beginning or from where it was interrupted."""
        march, course, self._farthest = self.march, self.scene.course, None
        with delay_interrupts():
            plan = march.planned(stage, self.state)
        self.counted = (time.perf_counter(), self.steps, self.cost.expansions)
        most, output = self.scene.solver.max_steps - self.steps, self.scene.output
        between = output.events or output.times is not None
        if march.reached is not None or self.state is None:  # resumed, or at the very beginning
            self.state = march.here(plan)
        if march.reached is None or march.reached < 1.0:
            usual = line_speed(self.scene)
            try:
                for step in march.through(plan, most, between=between):
                    with delay_interrupts():
                        accepted = self._accept(step)
                    yield accepted
                    goes_on = stage is not course[-1]
                    if outcome := endless(step.state, usual, goes_on):
                        raise PathStopped(outcome, step.state.control)
            finally:
                self._count(plan)
        with delay_interrupts():
            self._checkpoint(force=True)
        both = course[self.first_stage : self.first_stage + 2]
        # What sticks keeps errors from stage to stage.  Those of a shell are estimated over all
        # stages at once, as an estimate takes as long as ten to thirty of its tangents: a line of a
        # billy roller takes 57 s instead of 143, and its mesh's part is 28 N instead of 29.
        kept = self.assembly.kinematics is not SHELL and any(map(self.assembly.frictional, both))
        let_go = any(end.release for end in both[-1].edges.values())
        if len(both) < 2 or kept or let_go:
            self._look_at_errors(stage)
        with delay_interrupts():
            if self.recorder is not None and stage is not course[-1]:
                told = [words for rule in RULES_OF_STAGES for words in rule(self.state, self.scene)]
                self.passed += [f"at the end of stage {stage.name} {words}" for words in told]
            march.finish(stage, plan)
            self.first_stage += 1

    @property
    def is_estimated(self) -> bool:
        """Whether errors are estimated, as of a run that is written."""
        return self.recorder is not None or self.estimates

    def _look_at_errors(self, stage: StageSpec) -> None:
        """Estimate the errors of the present state."""
        if self.is_estimated and self.state is not None:
            march, before = self.march, self.budget.time
            if self.state.time > before and self.state.plan.name == stage.name:
                with self.cost.timed("errors"):
                    self.budget.look(self.state, march.memory, march.course.released)

    def _accept(self, step: Step) -> Step:
        """Count a step, look for events and snaps in it, and write it down."""
        plan, state = step.state.plan, step.state
        before = self.march.here(plan) if self.state is None else self.state
        velocity = None if before.velocity is None else self.march.velocity
        before = replace(before, full=self.march.full, velocity=velocity)  # as this stage has them
        if step.snapped:
            moved = (state.full - self.march.full)[plan.model.value_unknowns]
            distance = float(np.abs(moved).max())
            if distance > self.march.tolerances.tolerance * self.assembly.scales.length:
                self.snaps.append({"stage": plan.name, "time": state.time, "distance": distance})
        self.flow.add(state, state.time - before.time)
        self.state = state
        if plan.steady and (self._farthest is None or state.control > self._farthest.control):
            self._farthest = state
        self.march.accept(step)
        self.steps += 1
        self._count(plan)
        counts: dict[str, Any] = {"step": self.steps, "tangents": self.cost.expansions}
        counts |= {"end_time": self.end_time, "events": self._events(before, state)}
        step = replace(step, **counts)
        if self.recorder is not None:
            self.recorder.record(step, before)
            self._checkpoint()
        else:
            self.unread.append(replace(step, state=replace(state, branch=None, step=None)))
            if len(self.unread) * len(state.full) > MAX_WAITING_UNKNOWNS:
                self._read()
        return step

    def _read(self) -> None:
        """Read the rows of the history off the states of a run that is not written."""
        self.rows += [history_row(step, self.assembly) for step in self.unread]
        self.unread.clear()

    def _events(self, before: State, state: State) -> tuple[Event, ...]:
        """Look for wrinkles, and for the events of a step if the scene asks for them."""
        found = [] if self.onsets is None else self.onsets.during(state)
        onsets = [self._facts_of(onset) for onset in found]
        if not self.scene.output.events:
            return ()
        from anmstrip.results.events import Event

        touched = () if self.watch is None else self.watch.during(before, state)
        born = (Event(o["time"], o["stage"], o["kind"], "", x=o["x"], y=o["y"]) for o in onsets)
        return tuple(sorted((*touched, *born), key=lambda event: event.time))

    def _facts_of(self, onset: Onset) -> dict[str, Any]:
        """Return the facts of an onset, with its loads on the finer mesh if it is the first."""
        facts = onset.facts
        if all(told["kind"] != onset.kind for told in self.wrinkles) and self.is_estimated:
            with self.cost.timed("errors"):
                facts["on_halves"] = self.budget.loads_on_halves(onset, self.march.course.released)
        self.wrinkles.append(facts)
        return facts

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

    def _checkpoint(self, force: bool = False) -> None:
        """Save what is needed to go on, if the run is written at all.

        Before the first step of a stage that is what the end of the stage before has left: only
        there is the past known that tells whether this stage continues it.
        """
        if self.recorder is not None and (self.march.reached is not None or not self.first_stage):
            self.recorder.checkpoint(*pack(self), force)

    def _finish(self) -> None:
        """Write the last state, unless other ones were asked for, and the summary."""
        if self.recorder is None:
            return
        facts, state, written = self.facts(), self.state, self.recorder.strip.last
        if state is not None:
            chosen = self.scene.output.times is not None or self.outcome is Outcome.INTERRUPTED
            if written is None or (not chosen and written < state.time):
                self.recorder.write_state(state)
            wrinkling = Wrinkling(state) if self.assembly.kinematics is SHELL else None
            self.warnings = self._warnings(state, wrinkling)
            facts |= self._readings(state, wrinkling)
        facts |= {"errors": self.errors(), "warnings": self.warnings}
        self.recorder.summary(facts, self.reported)

    def _warnings(self, state: State, wrinkling: Wrinkling | None) -> list[str]:
        """Return what the scene, its last state and the errors of that give cause for.

        What the scene alone gives cause for is left out where more is known by now.
        """
        settled = [*coarse_mesh(Preview(self.assembly, (), ()))] if self.fine_enough else []
        if self.outcome.done and state.plan.steady:  # nips hold more of bent strip than expected
            settled += beyond_capacity(Preview.of(self.assembly))
        seen = [words for rule in RULES_AT_END for words in rule(state, self.scene)]
        if (law := self.assembly.flow) is not None and self.outcome.done:
            seen += guessed_rate(self.scene, law.rate, self.flow)
        known = {key for words in seen for key in proposed_keys(words)}
        told = [words for words in self.forewarnings() if words not in settled] + self.passed
        told = [words for words in told if known.isdisjoint(proposed_keys(words))]
        found = self.budget.of_path if self.outcome.done else []
        found = [*found, *self.budget.of_mesh, *self._moved_onsets]
        if wrinkling is not None:
            found += self._of_wrinkles(state, wrinkling)
        beside = beside_rollers(state, self.scene)
        return propose_one_mesh([*beside, *self.budget.useless, *told, *seen, *found])

    def _of_wrinkles(self, state: State, wrinkling: Wrinkling) -> list[str]:
        """Return warnings of wrinkles that no onset has told, and of strip that is near them."""
        if (watch := self.onsets) is None:
            return wrinkling.warnings
        told, borne = self._missed_wrinkles, watch.borne(state)
        if (lowest := min(borne.values(), default=np.inf)) < 1.0 and self.wrinkles:
            passed = {each["stage"] for each in self.wrinkles if each["kind"] == BIFURCATION}
            told = [*wrinkled_instead(self.scene, passed)]
        elif lowest < 1.0:
            there = self.budget.bears
            half = f", and {there:.2g} times on elements of half the length"
            told = [
                "the smooth strip is unstable here, and no onset was found on the way: by its "
                f"modes it bears {lowest:.2g} times its compression"
                f"{half if there < np.inf else ''}. To see where wrinkles come, begin where it is "
                "smooth, as under more tension"
            ]
        for span, words in zip(wrinkling.near, wrinkling.warnings, strict=True):
            times = borne.get((span.before, span.after), 0.0)
            more = f" Its modes on this mesh bear {times:.2g} times this compression."
            told.append(words + more * (times > 0.0))
        return [*told, *watch.warnings]

    def _readings(self, state: State, wrinkling: Wrinkling | None) -> dict[str, Any]:
        """Return entries of ``summary.json`` that are read off the last state alone."""
        facts: dict[str, Any] = {}
        elastic = state.plan.model.coupled == state.plan.model.unknowns
        if state.plan.steady and self.outcome.done and elastic:
            from anmstrip.driver.sensitivities import sensitivities

            own = (roller.friction is not None for roller in self.scene.rollers)
            hanging = self.assembly.hanging(state.plan)
            with suppress(SingularTangentError):
                found = sensitivities(state, own, hanging)
                facts["sensitivities"] = {self.scene.as_typed(k): v for k, v in found.items()}
        if wrinkling is not None:
            assert self.recorder is not None
            height, spacing = wrinkling.wave(self.recorder.surface) or (None, None)
            self.flatness = wrinkling.flatness
            facts |= {"wrinkle_amplitude": height, "wrinkle_spacing": spacing}
            facts |= {"compressive_membrane_force": wrinkling.compression, **self.flatness}
        return facts

    @property
    def reported(self) -> State | None:
        """The last state; none of a strip that has been laid, but has not come to rest."""
        laid = self.steps == 0 and self.scene.threading is not None
        return None if laid else self.state

    def errors(self) -> dict[str, Part | None]:
        """Return the estimated errors of the last state of a run that is written.

        Returns
        -------
        dict
            ``path``, ``time``, ``mesh`` and ``regularisation``, of strip that can yield also
            ``flow``, each with the largest error of a ``tension`` (N/m), of a roller's ``force``
            (N) and of a ``position`` (m), where an edge is clamped of a ``moment`` (N), of strip
            that can yield of a ``curl`` (1/m), or None: of ``time`` where nothing rubs, of
            ``path`` and ``mesh`` if it is not known.
        """
        known = self.state is not None and self.budget.time == self.state.time
        found = dict.fromkeys(ERROR_WORDS) | (self.budget.parts if known else {})
        if self.assembly.flow is None:
            del found["flow"]
        return found

    @property
    def _missed_wrinkles(self) -> list[str]:
        """Sentence about wrinkles that are there on the finer mesh alone."""
        if self.onsets is None or self.state is None or self.wrinkles:
            return []
        borne = self.onsets.borne(self.state).values()
        return [] if min(borne, default=np.inf) < 1.0 else self.budget.of_wrinkles

    @property
    def _moved_onsets(self) -> list[str]:
        """Sentence about the first onset that is elsewhere on elements of half the length."""
        names = [stage.name for stage in self.scene.course]
        for told in self.wrinkles:
            if (there := told.get("on_halves")) is None:
                continue
            begin = [0.0, *self.scene.ends][names.index(told["stage"])]
            pairs = [(told[key], there[key]) for key in there if key != "time"]
            pairs.append((told["time"] - begin, there["time"] - begin))
            if any(abs(b - a) > LARGE_MESH_ERROR * abs(a) for a, b in pairs):
                return self.budget.of_onset(told["time"], there["time"])
        return []

    @property
    def fine_enough(self) -> bool:
        """Whether the mesh is known to change tensions by no more than is asked for.

        Nor may it make up compression of which wrinkles are told, or keep the strip from wrinkles.
        """
        found, share = self.errors()["mesh"], self.scene.solver.mesh_share
        if found is None or self.budget.doubtful or self._missed_wrinkles:
            return False
        return found["tension"] <= share * self.budget.tension

    def facts(self) -> dict[str, Any]:
        """Return the counters of the run, as in ``summary.json``."""
        march, strip = self.march, self.assembly.strip
        density, section = self.scene.material.density, strip.thickness * strip.width
        mass = density * section * march.conveyed if density else None
        fed = {"length": march.conveyed, "mass": mass}
        begin, end = strip.span
        passed = end if self.state is None else begin + self.state.unstressed_length(end)
        taken = float(passed - end)
        for sign, name in zip((1.0, -1.0), ENDS, strict=True):
            laid = march.course.begun.get(name)
            if self.state is not None and laid is not None:  # what an end that sways leaves behind
                taken += sign * self.state.along_end(name, self.state.full, laid)
        fed["taken_up"] = taken
        return {
            "status": "done" if self.outcome.done else self.outcome.name.lower(),
            "message": self.message,
            "unknowns": strip.unknowns,
            "steps": self.steps,
            "tangents": self.cost.expansions,
            "factorisations": self.cost.factorisations,
            "wall_seconds": self.seconds,
            "seconds": self.cost.seconds,
            "linear_solver": march.solver.name,
            "effects": self.effects,
            "stages": self.stages,
            "snaps": self.snaps,
            "wrinkles": self.wrinkles,
            **({"feed": fed} if self.scene.strip.feed else {}),
            **({} if self.assembly.flow is None else {"flow_level": self.flow.level}),
        }

    def words_of_success(self) -> str:
        """Return what is said of a run that has come to its end."""
        snaps = "".join(
            f" At t = {snap['time']:.6g} s the strip ran away by {snap['distance']:.2g} m: "
            "friction had no equilibrium to hold it in."
            for snap in self.snaps
        )
        kinds = ([told for told in self.wrinkles if told["kind"] == kind] for kind in WRINKLE_WORDS)
        wrinkles = "".join(map(onset_words, kinds))
        return (
            f"Done: {self.end_time:g} s in {self.steps} steps, {self.cost.expansions} tangents, "
            f"{self.seconds:.1f} s.{snaps}{wrinkles}"
        )
