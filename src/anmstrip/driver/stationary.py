"""Studies of stationary states: maps along a control, from series, and frequency responses."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from anmstrip.advice.diagnosis import Failure, diagnosis
from anmstrip.advice.warnings import slides_as_a_whole
from anmstrip.arrays import Array
from anmstrip.continuation.path import Branch, Outcome, PathStopped
from anmstrip.driver.run import Run, spins_away
from anmstrip.driver.sensitivities import response, sensitivities
from anmstrip.equilibrium import StageProblem
from anmstrip.errors import InputError, Mistake, as_path, as_texts, nearest
from anmstrip.results.files import make_directory, write_summary, write_table
from anmstrip.results.state import State
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.simulation.defaults import has_default_slip_speed
from anmstrip.simulation.march import Step
from anmstrip.simulation.problem import EffectMaker, naturals
from anmstrip.taylor.polynomials import value_at

DEFAULT_POINTS, DEFAULT_CURVES = 101, 5
"""Rows of a curve, and curves of a second control, if they are not typed."""

ROLLER_COLUMNS = (
    "tension_in", "tension_out", "torque", "surface_speed", "slip_arc", "capacity_used", "wrap",
)  # fmt: skip
"""Columns of every roller, besides its ``offset``."""


def require_steady_end(scene: SceneSpec, why: str) -> None:
    """Refuse a scene that does not end in a stationary state."""
    last = scene.stages[-1]
    if not last.steady:
        key, expected = f"stages.{last.name}.steady", f"true in the last stage: {why}"
        raise scene.refused(key, False, expected, "steady = true")


SWEPT = 5
"""Scenes of the sweep that is proposed instead of a map."""

NO_NUMBERS = ("a known key", "three numbers", "true or false")
"""What is expected of keys that a map cannot follow."""


@dataclass(frozen=True)
class Along:
    """A control of a steady stage, and the even values that it takes."""

    text: str  # as it was typed
    key: str  # as in a stage
    values: Array

    @classmethod
    def parse(cls, text: str, number: int) -> Along:
        """Read ``KEY=first:last``, or ``KEY=first:last:number``.

        Raises
        ------
        InputError
            If it is not of this form.

        Examples
        --------
        >>> Along.parse("strip.speed=0.9:1.0", 3).values
        array([0.9 , 0.95, 1.  ])
        """
        key, _, given = (part.strip() for part in text.partition("="))
        try:
            low = high = math.nan
            first, *others = given.split(":")
            low = float(first)
            last, *count = others
            high = float(last)
            (number,) = map(int, count or [str(number)])
        except ValueError:
            high = math.nan
        if not (key and math.isfinite(high - low) and low != high and 2 <= number <= 100_000):
            expected = "KEY=first:last, or KEY=first:last:number, with two different numbers"
            hint = f"--along {key}={low:g}:{1.1 * low or 1.0:g}" if math.isfinite(low) else ""
            raise wrong_control(text, key, expected, given or None, hint)
        return cls(text, key, np.linspace(low, high, number))

    def stage(self, scene: SceneSpec, value: float) -> StageSpec:
        """Return a steady stage after those of a scene, which moves the control to a value.

        Raises
        ------
        InputError
            The scene has no such control.
        """
        tables, name = scene.to_dict(), "map"
        while name in {stage.name for stage in scene.course}:
            name += "_"
        tables["stages"].append({"name": name, "steady": True})
        begin = f"stages.{name}."
        try:
            given = [f"{begin}{self.key}={float(value)!r}"]
            made = SceneSpec.from_tables(tables, scene.source or "scene", given)
        except InputError as error:
            place = f"--along {self.text}"
            found = [replace(m, file=place, key=m.key.removeprefix(begin)) for m in error.mistakes]
            if any(no_number in m.expected for m in found for no_number in NO_NUMBERS):
                found = [self._no_control(scene)]
            raise InputError(found) from None
        curls = {"coil_set", "crossbow"} & made.stages[-1].strip.natural.keys()
        if curls - naturals(scene):  # strip that is not curled bends by another energy
            raise InputError([self._no_control(scene)])
        return made.stages[-1]

    def _no_control(self, scene: SceneSpec) -> Mistake:
        """Return the mistake of a key that is none of a stage, or whose value is no number."""
        names, file = "|".join(roller.name for roller in scene.rollers), scene.source or "scene"
        expected = (
            "a control of a stage that is a number: strip.speed, entry.tension, exit.tension, "
            f"pressure, rollers.({names}).surface_speed, .angular_speed, .torque or .press"
        )
        _, _, given = self.text.partition("=")
        first, *others = self.key.split(".")
        hint = "--along strip.speed=0.99:1.01"
        if first == "stages" and len(others) > 1:
            hint = f"--along {'.'.join(others[1:])}={given}"
        else:
            with suppress(InputError):
                one = f"{self.key}={float(self.values[0])!r}"
                SceneSpec.from_tables(scene.to_dict(), file, [one])
                number = "" if given.count(":") > 1 else f":{SWEPT}"
                vary = f"{self.key}={given}{number}"
                hint = shlex.join(["anmstrip", "sweep", str(file), "--vary", vary])
        return Mistake(f"--along {self.text}", self.key, given, expected, hint)


def wrong_control(
    text: str, key: str, expected: str, value: object = None, hint: str = ""
) -> InputError:
    """Return the error of an option ``--along`` that is not as expected."""
    hint = hint or "--along strip.speed=0.99:1.01"
    return InputError([Mistake(f"--along {text}", key, value, expected, hint)])


@dataclass(frozen=True)
class Piece:
    """A branch of a curve."""

    plan: StageProblem
    branch: Branch
    ends: tuple[float, float]  # values of the typed control at λ = 0 and λ = 1
    backwards: bool  # whether the curve runs from the branch's end to its beginning

    def parameter(self, s: float) -> float:
        """Parameter of the branch at a way along the piece."""
        return self.branch.length - s if self.backwards else s

    def value(self, s: float) -> float:
        """Value of the typed control."""
        (before, after), a, branch = self.ends, self.parameter(s), self.branch
        control = value_at(branch.control, a) / value_at(branch.denominator, a)
        return before + (after - before) * float(control)

    def state(self, s: float) -> State:
        """Stationary state."""
        return State.on(self.plan, self.branch, self.parameter(s))

    @property
    def folds(self) -> list[float]:
        """Ways at which the control turns back, in their order."""
        return sorted(self.parameter(a) for a in self.branch.folds)

    def places(self, values: Array) -> list[float]:
        """Ways at which the control has one of some values; the beginning is left out."""
        found, slack = [], 1e-9 * float(np.ptp(values))

        def missed(s: float, value: float) -> float:
            return self.value(s) - value

        for begin, end in pairwise([0.0, *self.folds, self.branch.length]):
            before, after = self.value(begin), self.value(end)
            sense = 1.0 if after > before else -1.0
            ahead = sense * (values - before)
            inside = (ahead > slack) & (ahead <= sense * (after - before) + slack)
            for v in sense * np.sort(sense * values[inside]):
                at_end = sense * (after - v) <= slack
                found.append(end if at_end else brentq(missed, begin, end, (v,)))
        return found


@dataclass(frozen=True, repr=False)
class Curve:
    """Stationary states along the first control, from its first to its last value."""

    pieces: tuple[Piece, ...]
    second: float | None  # value of the second control, if there is one

    @property
    def knots(self) -> Array:
        """Ways to the ends of the pieces, beginning with 0."""
        return np.cumsum([0.0, *(piece.branch.length for piece in self.pieces)])

    def __repr__(self) -> str:
        return f"<Curve of length {self.knots[-1]:.4g}>"

    def piece(self, s: float) -> tuple[Piece, float]:
        """The piece at a way along the curve, and the way within it."""
        number = int(np.clip(np.searchsorted(self.knots, s) - 1, 0, len(self.pieces) - 1))
        return self.pieces[number], s - self.knots[number]

    def state(self, s: float) -> State:
        """Stationary state at a way along the curve."""
        piece, way = self.piece(s)
        return piece.state(way)

    def value(self, s: float) -> float:
        """Value of the first control at a way along the curve."""
        piece, way = self.piece(s)
        return piece.value(way)

    def places(self, values: Array) -> list[float]:
        """Ways at which the first control has one of some values, as often as it has."""
        pieces = zip(self.knots, self.pieces, strict=False)
        found = [begin + way for begin, piece in pieces for way in piece.places(values)]
        begins = self.pieces and np.abs(values - self.value(0.0)).min() <= 1e-9 * np.ptp(values)
        return [0.0, *found] if begins else found

    def events(
        self, states: Mapping[float, State], tolerance: float
    ) -> Iterator[tuple[float, str, str | None]]:
        """Yield where the control turns back, and where the wrap of a roller slips as a whole.

        Parameters
        ----------
        states : mapping
            Ways to states, between which a roller loses or regains its grip at most once.
        tolerance : float
            To which that is dated, as a share of the curve.

        Yields
        ------
        tuple
            Way along the curve, kind of the event, and name of the roller.
        """

        def grip(s: float, name: str) -> float:
            return self.state(s).contacts[name].grip

        for begin, piece in zip(self.knots, self.pieces, strict=False):
            yield from ((begin + way, "fold", None) for way in piece.folds)
        grips = ({n: c.grip for n, c in state.contacts.items()} for state in states.values())
        for (a, b), (before, after) in zip(pairwise(states), pairwise(grips), strict=True):
            for name in before:
                if (before[name] > 0.0) != (after[name] > 0.0):
                    at = float(brentq(grip, a, b, (name,), xtol=tolerance * self.knots[-1]))
                    yield at, "grip lost" if after[name] > 0.0 else "grip regained", name


class MapStep(NamedTuple):
    """Progress of a map, in words and as a share."""

    words: str
    fraction: float


class OperatingMap:
    """Stationary states of a scene along one control, for one or several values of another.

    The scene is run to its end, which is a stationary state, and from there the first control is
    followed both ways, to both ends of its range; the series of that path are sampled evenly.
    A second control goes from value to value, and the first is followed from each.

    Parameters
    ----------
    scene : SceneSpec
        Its last stage is steady.
    along : iterable of str
        One or two texts ``KEY=first:last`` or ``KEY=first:last:number``, with the keys of a stage:
        ``strip.speed``, ``entry.tension``, ``exit.tension``, ``rollers.NAME.surface_speed``, ….
    directory : path, optional
        Where ``map.csv``, ``map.json`` and ``map.png`` go; nothing is written without it.
    effects : iterable of callables, optional
        Effects of one's own, see :class:`~anmstrip.driver.run.Run`.

    Attributes
    ----------
    curves : list of Curve
    rows : list of dict
        Those of ``map.csv``.
    events : list of dict
        ``kind`` ("fold", "grip lost", "grip regained"), ``roller``, and the controls by their keys.
    message : str
    done : bool
        Whether both ends of all curves were reached.

    Raises
    ------
    InputError
        The scene does not end in a steady stage, or has no such control.
    """

    def __init__(
        self,
        scene: SceneSpec,
        along: Iterable[str],
        directory: str | Path | None = None,
        effects: Iterable[EffectMaker] = (),
    ) -> None:
        along = as_texts("along", along)
        require_steady_end(scene, "a map is made of stationary states")
        if not 1 <= len(along) <= 2:
            raise wrong_control(" ".join(along), "", "one control or two", len(along))
        counts = zip(along, (DEFAULT_POINTS, DEFAULT_CURVES), strict=False)
        self.along = [Along.parse(text, count) for text, count in counts]
        self.stages = [[a.stage(scene, v) for v in a.values[[0, -1]]] for a in self.along]
        if len({a.key for a in self.along}) < len(along):
            raise wrong_control(along[1], self.along[1].key, "another control")
        self.directory = None if directory is None else as_path("directory", directory)
        self.run = Run(scene, effects=effects)
        self.curves: list[Curve] = []
        self.rows: list[dict[str, Any]] = []
        self.events: list[dict[str, Any]] = []
        self.message, self.done = "The map has not ended.", False
        self.failure: Failure | None = None

    def __iter__(self) -> Iterator[MapStep]:
        """Yield how far the map is, after every step."""
        run, seconds = self.run, [None] if len(self.along) == 1 else self.along[1].values
        if self.directory is not None:
            make_directory(self.directory)
        share = 1.0 / (1 + len(seconds))
        for step in run:
            yield MapStep(f"{step.stage}, {step.tangents} tangents", share * step.fraction)
        self.message, self.done = run.message, run.outcome.done
        for number, second in enumerate(seconds if self.done else []):
            words = "" if second is None else f"{self.along[1].key} = {second:.6g}, "
            for way, value in self.follow_curve(second):
                told = f"{words}{self.along[0].key} = {value:.6g}, {run.cost.expansions} tangents"
                yield MapStep(told, share * (1 + number + way))
        self._end()

    def interrupted(self) -> None:
        """Write what there is after an interruption."""
        self.message, self.done = f"Stopped: {Outcome.INTERRUPTED.value}.", False
        self._end()

    def _end(self) -> None:
        """Read off what there is, and write it if that is wanted."""
        self._read()
        if self.directory is not None:
            self._write(self.directory)

    def follow_curve(self, second: float | None) -> Iterator[tuple[float, float]]:
        """Add a curve; yield the share of it that is done, and the value of the control."""
        run, march, values = self.run, self.run.march, self.along[0].values[[0, -1]]
        if second is not None and not self._moved(self.along[1], second):
            return
        here = self.share_of_range()
        inside = 0.0 < here < 1.0
        if not 0.0 <= here <= 1.0:
            here = float(here > 1.0)
            if not self._moved(self.along[0], values[int(here)]):
                return
        kept = march.full, march.velocity, run.state
        start = values[0] + here * (values[1] - values[0])
        legs: list[list[Piece]] = [[], []]
        try:
            for leg in (0, 1) if inside else (1 - int(here),):
                ends = float(start), float(values[leg])

                def place(control: float, ends: tuple[float, float] = ends) -> str:
                    return f"at {self.along[0].key} = {ends[0] + control * (ends[1] - ends[0]):.6g}"

                for step in self._followed(self.stages[0][leg], place):
                    branch = step.state.branch
                    assert branch is not None
                    legs[leg].append(Piece(step.state.plan, branch, ends, backwards=leg == 0))
                    done = 0.5 * (leg + step.state.control) if inside else step.state.control
                    yield done, ends[0] + step.state.control * (ends[1] - ends[0])
                march.full, march.velocity, run.state = kept
                march.reached = march.pace = None
        finally:  # also of what is interrupted
            self.curves.append(Curve((*legs[0][::-1], *legs[1]), second))

    def share_of_range(self) -> float:
        """Return the place of the first control between its first and last value, 0 to 1."""
        plans = [self.run.march.planned(stage, self.run.state) for stage in self.stages[0]]
        first, last = (plan.controls.at(1.0) for plan in plans)
        names = [name for name in first if np.any(first[name] != last[name])]
        if not names:
            text, key = self.along[0].text, self.along[0].key
            raise wrong_control(text, key, "a control of a steady stage")
        given = plans[0].controls.start, first, last
        now, begin, end = (np.concatenate([np.ravel(at[n]) for n in names]) for at in given)
        way = end - begin
        share = float((now - begin) @ way / (way @ way))
        aside = np.abs(now - begin - share * way).max() > 1e-9 * np.abs(way).max()
        return -1.0 if aside else share

    def _moved(self, along: Along, value: float) -> bool:
        """Go for good to where a control has a value; whether that was reached."""
        stage, march = along.stage(self.run.scene, value), self.run.march
        kept = march.full, march.velocity, self.run.state
        for _ in self._followed(stage, lambda _: f"on the way to {along.key} = {value:.6g}"):
            pass
        assert self.run.state is not None
        if arrived := march.reached == 1.0:
            march.finish(stage, self.run.state.plan)
        else:
            march.full, march.velocity, self.run.state = kept
            march.reached = march.pace = None
        return arrived

    def _followed(self, stage: StageSpec, place: Callable[[float], str]) -> Iterator[Step]:
        """Accept the steps of a stage as far as it goes; a stop, and its place, is told at the end.

        The place is one for each share of the way.  Where strip slides as a whole its speed hardly
        changes friction: the control turns back there within the tolerance alone, along the same
        states.
        """
        run, march = self.run, self.run.march
        plan = march.planned(stage, run.state)
        try:
            for step in march.through(plan, run.scene.solver.max_steps, between=True):
                if spins_away(step.state):
                    raise PathStopped(Outcome.RAN_AWAY, step.state.control)
                back = step.state.branch is not None and step.state.branch.folds
                if back and slides_as_a_whole(step.state, run.scene):
                    raise PathStopped(Outcome.FOLD, step.state.control)
                march.accept(step)
                run.state = step.state
                yield step
        except PathStopped as stopped:
            where = place(march.reached or 0.0)
            self.failure = Failure(run.assembly, stage, march.here(plan), stopped, where)
            self.done = False

    def _read(self) -> None:
        """Sample the curves, and find what happens on them."""
        first, *others = (along.key for along in self.along)
        tolerance = self.run.scene.solver.tolerance
        for curve in self.curves:
            if not curve.pieces:
                continue
            second = dict.fromkeys(others, curve.second)
            ways = curve.places(self.along[0].values)
            states = {s: curve.state(s) for s in np.union1d(ways, curve.knots).tolist()}
            self.rows += [{first: curve.value(s), **second, **map_row(states[s])} for s in ways]
            for at, kind, roller in curve.events(states, tolerance):
                found = {"kind": kind, "roller": roller, first: curve.value(at), **second}
                self.events.append(found)
        told = []
        for event in self.events:
            where = ", ".join(f"{key} = {event[key]:.8g}" for key in (first, *others))
            roller = f" on {event['roller']}" if event["roller"] else ""
            told.append(f"{event['kind'].capitalize()}{roller} at {where}.")
        lost = any(event["kind"] == "grip lost" for event in self.events)
        if self.done:
            curves = "one curve" if len(self.curves) == 1 else f"{len(self.curves)} curves"
            self.message = (
                f"Done: {len(self.rows)} stationary states on {curves}, "
                f"{self.run.cost.expansions} tangents, {self.run.seconds:.1f} s."
            )
            if not told and self.run.state is not None:
                whole = slides_as_a_whole(self.run.state, self.run.scene)
                told = ["No fold, and no roller loses or regains its grip."]
                told += ["The strip slides over all rollers that drive it."] * whole
        elif self.failure is not None:
            whole = lost or slides_as_a_whole(self.failure.state, self.run.scene)
            cause = "The strip slides as a whole there." if whole else None
            self.message = diagnosis(self.failure, cause)
        friction = self.run.assembly.friction
        if lost and friction is not None and has_default_slip_speed(self.run.scene):
            told.append(
                "Creep of the strip at up to V_c makes that late. To see by how much, "
                f"try --set friction.speed={0.1 * friction.speed:.2g}"
            )
        self.message = " ".join([self.message, *told])

    def _write(self, directory: Path) -> None:
        """Write table, figure and summary."""
        from anmstrip.pictures.curves import map_figure, save_figure

        keys = [along.key for along in self.along]
        write_table(directory / "map.csv", list(self.rows[0]) if self.rows else keys, self.rows)
        names = [roller.name for roller in self.run.assembly.rollers]
        save_figure(map_figure(self.rows, keys, names, self.events), directory / "map.png")
        facts = self.run.facts() | {"status": "done" if self.done else "stopped"}
        summary = {**facts, "message": self.message, "along": [a.text for a in self.along]}
        summary |= {"events": self.events, "input": self.run.assembly.input()}
        write_summary(directory / "map.json", summary)


def map_row(state: State) -> dict[str, Any]:
    """Return the columns of ``map.csv`` for a state, those of the controls left out."""
    row: dict[str, Any] = {f"{edge}_tension": state.tension(edge) for edge in ("entry", "exit")}
    row["strip_speed"] = state.strip_speed
    for name, reading in state.rollers.items():
        row |= {f"{name}_{column}": getattr(reading, column) for column in ROLLER_COLUMNS}
        row[f"{name}_offset"] = reading.offset
    return row


DEFAULT_DECADES, DEFAULT_FREQUENCIES = (-2.0, 2.0), 41
"""Frequencies by default: powers of ten of V/L with the length L of the strip, and how many."""


def respond(scene: SceneSpec, of: str, to: str, directory: Path) -> str:
    """Run a scene, and write the response of its last state: ``response.csv`` and ``.png``.

    Parameters
    ----------
    scene : SceneSpec
        Its last stage is steady.
    of : str
        A reading of the sensitivities; one of the roller that `to` names goes without its name.
    to : str
        A parameter of the sensitivities.
    directory : Path

    Returns
    -------
    str
        What was found, in a sentence; it begins with "Done" if the state was reached.

    Raises
    ------
    InputError
        The scene does not end in a steady stage, or has no such reading or parameter.
    """
    from anmstrip.pictures.curves import response_figure, save_figure

    require_steady_end(scene, "a response is that of a stationary state")
    run = Run(scene)
    if run.assembly.coupled < run.assembly.unknowns:
        expected = "a strip that stays elastic: what oscillates is not followed into yielding"
        raise scene.refused("material", None, expected, "the same scene without plasticity")
    for _ in run:
        pass
    state = run.state
    if state is None or state.strip_speed is None or not run.outcome.done:
        return run.message
    friction = state.friction
    if friction is not None and abs(state.strip_speed) <= friction.law_of_slip.speed:  # it creeps
        expected, hint = "a strip that runs at its end", "a last stage in which it runs"
        raise scene.refused(f"stages.{scene.stages[-1].name}", None, expected, hint)
    unit = abs(state.strip_speed) / run.assembly.strip.length
    omega = unit * np.logspace(*DEFAULT_DECADES, DEFAULT_FREQUENCIES)
    key = next((k for k in state.controls if scene.as_typed(k) == to), to)
    own = [r.friction is not None for r in scene.rollers]
    known = sensitivities(state, own)
    readings = next(iter(known.values()))
    name = of if of in readings else f"{to.removeprefix('rollers.').partition('.')[0]}_{of}"
    mistakes = []
    if key not in known:
        mistakes.append(unknown_name(scene, "--to", to, known, DEPENDS_ON))
    if name not in readings:
        mistakes.append(unknown_name(scene, "--of", of, readings, READ_OFF))
    if mistakes:
        raise InputError(mistakes)
    found = response(state, own, key, omega)
    gain, phase = np.abs(found[name]), np.degrees(np.unwrap(np.angle(found[name])))
    columns = "omega", "gain", "phase"
    rows = (dict(zip(columns, row, strict=True)) for row in zip(omega, gain, phase, strict=True))
    make_directory(directory)
    write_table(directory / "response.csv", columns, rows)
    save_figure(response_figure(omega, gain, phase, f"{name} to {to}"), directory / "response.png")
    return (
        f"Done: {name} answers to {to} with {gain[0]:.6g} at {omega[0]:.3g} rad/s and with "
        f"{gain[-1]:.6g} at {omega[-1]:.3g} rad/s."
    )


DEPENDS_ON, READ_OFF = "what the stationary state depends on", "what is read off a stationary state"
"""What ``--to`` and ``--of`` name."""

OF_SHELLS = ("yaw", "crown", "offset", "least_membrane_force")
"""Last words of what only a shell depends on, or has."""


def unknown_name(
    scene: SceneSpec, option: str, typed: str, known: Iterable[str], expected: str
) -> Mistake:
    """Return the mistake of a name that is not known, best with a known one of the same table.

    The pull of an exit is ``exit.force`` or ``exit.tension``, as its stage gives it.
    """
    same = [name for name in known if name.partition(".")[0] == typed.partition(".")[0]]
    hint = nearest(typed, same or known)
    if scene.strip.kinematics != "shell" and typed.endswith(OF_SHELLS):
        expected, hint = f"{expected}, of a shell", "--set 'strip.kinematics=\"shell\"'"
    return Mistake(f"{option} {typed}", "", typed, expected, hint)
