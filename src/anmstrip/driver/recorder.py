"""What a run writes while it goes on, and the checkpoint from which another one goes on."""

from __future__ import annotations

import hashlib
import json
import platform
import shlex
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.errors import InputError, Mistake, toml_text
from anmstrip.results import files
from anmstrip.results.fields import PROFILE_COLUMNS, FieldSampler, Profile
from anmstrip.results.rollers import STEP_READINGS
from anmstrip.results.state import State
from anmstrip.results.vtk import Collection, subdivide, write_rollers, write_surface
from anmstrip.scene.schema import SceneSpec
from anmstrip.scene.tables import ENDS
from anmstrip.simulation.defaults import has_default_slip_speed, is_fed_by_default
from anmstrip.simulation.march import March, Step
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course

CHECKPOINT_SECONDS = 2.0
"""Least time between two checkpoints inside a stage."""

DEFAULT_STATES = 100
"""States of a run that are written by default: the first one in each of so many equal parts of its
time, and the ends of the stages."""

STALE_FILES = (
    "checkpoint.npz", "summary.json", "report.html", "movie.gif",
    "picture.png", "picture_side.png", "picture_side.svg", "picture_side.pdf",
)  # fmt: skip
"""Files of an earlier run in the same directory that no longer belong to anything."""

STEP_COLUMNS = ("stage", "time", "step", "tangents", "order", "range", "residual")

EVENT_COLUMNS = ("time", "stage", "kind", "roller", "point", "x", "y", "gap", "slip", "step")

ERROR_COLUMNS = ("time", "stage", "membrane_force", "position")

FEED_COLUMNS = ("strip_speed", "conveyed")

END_SPEEDS = {f"{name}_speed": name for name in ENDS}
"""Columns of strip that rollers which move, or its weight, take up or give off, and their ends."""


def history_row(step: Step, assembly: Assembly) -> dict[str, Any]:
    """Return the row of a step in ``history.csv``."""
    state, values = step.state, {column: getattr(step, column) for column in STEP_COLUMNS}
    values |= {f"{name}_tension": state.tension(name) for name in ENDS}
    if assembly.conveyed:
        rests = state.strip_speed is None and not state.plan.in_time
        fed = 0.0 if rests else state.strip_speed, state.conveyed  # no speed if labels travel
        values |= dict(zip(FEED_COLUMNS, fed, strict=True))
        if assembly.sways:
            ends = {key: state.end_speed(end) for key, end in END_SPEEDS.items()}
            values |= dict.fromkeys(ends, 0.0) if rests else ends
    for name, reading in state.rollers.items():
        values |= {f"{name}_{column}": getattr(reading, column) for column in STEP_READINGS}
    return values


class Recorder:
    """Writes history, states, checkpoint and summary of a run into a directory.

    Parameters
    ----------
    assembly : Assembly
    directory : Path
    errors : callable
        Errors of a state by the solver, as far as they are known.
    resumed : mapping or None
        Facts of the checkpoint of an earlier run.
    """

    def __init__(
        self,
        assembly: Assembly,
        directory: Path,
        errors: Callable[[State], Mapping[str, float]],
        resumed: Mapping[str, Any] | None = None,
    ) -> None:
        self.assembly, self.directory, self.errors = assembly, directory, errors
        files.make_directory(directory)
        self.lock = files.DirectoryLock(directory)
        kept: Mapping[str, Any] = resumed or {"rows": {}, "time": -1.0, "turned": {}}
        with self.lock:
            self._open_files(kept, resumed is not None)
        times = (min(t, assembly.scene.ends[-1]) for t in assembly.scene.output.times or ())
        self.due = [t for t in times if t > kept["time"]]
        self.surface, self.profile = FieldSampler(assembly.strip), Profile(assembly.strip)
        self.turned = dict.fromkeys((r.name for r in assembly.rollers), 0.0) | kept["turned"]
        self.last_checkpoint = 0.0

    def _open_files(self, kept: Mapping[str, Any], resumed: bool) -> None:
        """Begin the files, or those of an earlier run from where its checkpoint was written."""
        assembly, directory = self.assembly, self.directory
        names = [f"{r.name}_{column}" for r in assembly.rollers for column in STEP_READINGS]
        feed = [*FEED_COLUMNS] if assembly.conveyed else []
        feed += END_SPEEDS if assembly.sways else []
        columns = (*STEP_COLUMNS, "entry_tension", "exit_tension", *feed, *names)
        if not resumed:
            for stale in (*directory.glob("*.pvd"), *map(directory.joinpath, STALE_FILES)):
                stale.unlink(missing_ok=True)
        until = kept["written"] if resumed else None
        self.strip = Collection(directory / "strip.pvd", until)
        self.rollers = Collection(directory / "rollers.pvd", until if assembly.rollers else None)
        tables = {"history.csv": columns, "profile.csv": PROFILE_COLUMNS}
        tables["errors.csv"] = ERROR_COLUMNS
        if assembly.flow is not None:
            from anmstrip.results import plastic

            tables["profile.csv"] += plastic.PLASTIC_COLUMNS
        if assembly.scene.output.events:
            tables["events.csv"] = EVENT_COLUMNS
        else:
            (directory / "events.csv").unlink(missing_ok=True)
        rows, given = kept["rows"], tables.items()
        self.tables = {n: files.History(directory / n, heads, rows.get(n, 0)) for n, heads in given}

    def record(self, step: Step, before: State) -> None:
        """Write what is wanted of an accepted step: history, events, its end or instants inside."""
        state, output = step.state, self.assembly.scene.output
        self.lock.check()
        if output.times is None and not self.strip.count:
            self.write_state(state.at(state.plan.start, before))
        self.tables["history.csv"].append(history_row(step, self.assembly))
        for event in step.events:
            self.tables["events.csv"].append(asdict(event))
        while self.due and self.due[0] <= state.time:
            inside = state.at(self.due.pop(0), before)
            self._turn(inside, before)
            self.write_state(inside)
            before = inside
        self._turn(state, before)
        if output.times is None and self._is_due(step):
            self.write_state(state)

    def _is_due(self, step: Step) -> bool:
        """Whether the end of a step is one of the states to write."""
        if (every := self.assembly.scene.output.every) is not None:
            return step.step % every == 0
        times = self.strip.last or 0.0, step.time
        before, now = (int(DEFAULT_STATES * time / step.end_time) for time in times)
        return now > before or step.state.control > 1.0 - 1e-9

    def write_state(self, state: State) -> None:
        """Write the profile, the surface and the rollers, and list them."""
        self.tables["profile.csv"].extend(self.profile.columns(state))
        wrong = {"time": state.time, "stage": state.plan.name, **self.errors(state)}
        self.tables["errors.csv"].append(wrong)
        strip, rollers = (f"{name}_{self.strip.count:05d}.vtu" for name in ("strip", "rollers"))
        fields = self.surface.sample(state)
        origin, flat_origin = self.assembly.origin, np.append(self.assembly.flat_origin, 0.0)
        points = self.surface.reference.T + fields["displacement"] + origin
        fields["displacement"] += origin - flat_origin
        labels = self.surface.reference[0] - self.surface.reference[0].min()
        fields["displacement"][:, 0] += state.conveyed + labels - fields["arc_length"]
        smooth = self.assembly.scene.output.smooth
        cells = self.surface.cells if smooth else subdivide(self.surface.cells)
        write_surface(self.directory / strip, points, cells, fields)
        self.strip.add(state.time, strip)
        if self.assembly.rollers:
            drawn = self.assembly.rollers
            moved = [replace(r, centre=tuple(state.centre(r.name) + origin)) for r in drawn]
            angles = [roller.sense * self.turned[roller.name] / roller.radius for roller in moved]
            write_rollers(self.directory / rollers, moved, angles, self.assembly.strip.width)
            self.rollers.add(state.time, rollers)

    def _turn(self, state: State, before: State) -> None:
        """Add the surface's travel since a state, for the rollers' pictures."""
        for name in self.turned:
            self.turned[name] += state.surface_travel(name, before)

    def checkpoint(
        self, arrays: Mapping[str, Array], facts: Mapping[str, Any], force: bool = False
    ) -> None:
        """Save what is needed to go on, at most every few seconds unless forced."""
        now = time.monotonic()
        if not force and now - self.last_checkpoint < CHECKPOINT_SECONDS:
            return
        self.last_checkpoint = now
        self.lock.check()
        rows = {name: table.rows for name, table in self.tables.items()}
        last = -1.0 if self.strip.last is None else self.strip.last
        kept = {**facts, "rows": rows, "turned": self.turned, "written": last}
        kept["signature"] = signature(arrays, kept)
        files.save_checkpoint(self.directory / "checkpoint.npz", arrays, kept)

    def summary(self, facts: Mapping[str, Any], state: State | None) -> None:
        """Write ``summary.json``; then the directory is free for others."""
        self.lock.check()
        edges: dict[str, Any] = {}
        rollers: dict[str, Any] = {}
        if state is not None:
            edges = {n: {"tension": state.tension(n), "force": state.edge_force(n)} for n in ENDS}
            for name, moment in state.clamp_moments(self.assembly.scene.clamped).items():
                edges.setdefault(name, {"force": state.edge_force(name)})["moment"] = moment
            for name, reading in state.rollers.items():
                cost = state.regularisation[name]
                effect = {n: getattr(cost, f"by_{n}") for n in ("creep", "cone", "penetration")}
                rollers[name] = {
                    **{key: value for key, value in asdict(reading).items() if key != "resultant"},
                    "tension_ratio": reading.tension_ratio,
                    "sticking_creep": cost.sticking_creep,
                    "penetration": cost.penetration,
                    "regularisation_effect": {**effect, "total": cost.effect},
                }
            if state.plasticity is not None:
                from anmstrip.results import plastic

                layers = plastic.YieldedStrip(state, state.plasticity)
                if len(layers.stress) == 1:
                    path = self.directory / "layers.csv"
                    files.write_table(path, plastic.LAYER_COLUMNS, layers.rows())
                for name, bend in layers.rollers().items():
                    rollers[name]["bend"] = asdict(bend)
        written = {"rollers": rollers, "edges": edges, "input": self.assembly.input()}
        if state is not None and state.strip_speed is not None:
            facts = {**facts, "strip_speed": state.strip_speed}
        summary = {**facts, **written, "versions": versions()}
        files.write_summary(self.directory / "summary.json", summary)
        self.lock.release()


def versions() -> dict[str, str]:
    """Versions of this program and of what it stands on."""
    packages = ("anmstrip", "numpy", "scipy", "scikit-fem", "meshio", "pyvista")
    return {"python": platform.python_version(), **{name: version(name) for name in packages}}


CHANGEABLE_KEYS = ("title", "solver.max_steps", "solver.max_tangents")
"""Keys that may differ: nothing that is computed depends on them."""


def identity(assembly: Assembly) -> dict[str, Any]:
    """Return all that the results of a run depend on: its scene, mesh file and added effects."""
    scene = assembly.scene.to_dict()
    if assembly.scene.strip.mesh is not None:  # wherever the file lies, and whatever its name
        content = Path(assembly.scene.strip.mesh).read_bytes()
        scene["strip"]["mesh"] = hashlib.sha256(content).hexdigest()
    return {**scene, "effects": [effect.name for effect in assembly.added_effects]}


def kept_values(course: Course) -> dict[str, dict[str, Array]]:
    """Return what stages have left, by kind and name, as a checkpoint keeps it."""
    ends = {"moved": course.moved, "begun": course.begun, "speed": course.speeds}
    return {**ends, "value": course.values}


def flat_keys(
    tables: Mapping[str, Any], prefix: str = "", between: str = "."
) -> Iterator[tuple[str, Any]]:
    """Yield dotted keys with their values; entries of lists of tables go by their names."""
    for name, value in tables.items():
        key, inner = f"{prefix}{name}", value
        if isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
            inner = {str(v.get("name", i)): v for i, v in enumerate(value)}
            yield key, list(inner)
        if isinstance(inner, dict):
            yield from flat_keys(inner, f"{key}{between}", between)
        else:
            yield key, value


MOST_DIFFERENCES = 40
"""Keys up to which scenes are the same one with other values, told one by one: a stage has 25."""


UNTYPED_KEYS = ("rollers", "stages", "effects", "strip.mesh")
"""Keys that stand for more than a value that can be typed: names of tables, what a file has."""


def differences(before: Mapping[str, Any], now: Mapping[str, Any], file: str) -> Iterator[Mistake]:
    """Yield the keys in which a scene differs from the one with which a run began."""
    old, new = dict(flat_keys(before)), dict(flat_keys(now))
    for key in dict.fromkeys((*old, *new)):
        if key not in CHANGEABLE_KEYS and old.get(key) != new.get(key):
            was = toml_text(old.get(key))
            expected = f"{was}, with which this run began; what is there would not fit the rest"
            whole = not any(cut in was for cut in ("…", "..."))
            table = ".".join(key.split(".")[:2])  # as stages.turn, which may not be there
            named = key.split(".")[0] not in UNTYPED_KEYS
            named = named or any(f"{k}.".startswith(f"{table}.") for k in new)
            typed = key in old and key not in UNTYPED_KEYS and whole and named
            back = f"--set {shlex.quote(f'{key}={was}')}, or " * typed
            yield Mistake(file, key, new.get(key), expected, back + files.START_AFRESH)


def derived_keys(scene: SceneSpec) -> set[str]:
    """Return keys of a scene with its defaults whose values follow from others."""
    found = {"strip.feed"} if scene.strip.feed == is_fed_by_default(scene) else set()
    if has_default_slip_speed(scene):
        found.add("friction.speed")
    return found


def signature(arrays: Mapping[str, Array], facts: Mapping[str, Any]) -> str:
    """Return a hash (SHA-256) of this program's version and of all that a checkpoint holds."""
    known = json.dumps(files.plain(facts, keep_nonfinite=True), sort_keys=True)
    content = hashlib.sha256(f"{version('anmstrip')} {known}".encode())
    for name in sorted(arrays):
        values = np.asarray(arrays[name])
        content.update(f"{name} {values.dtype} {values.shape}".encode() + values.tobytes())
    return content.hexdigest()


def read_checkpoint(path: Path, march: March) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return arrays and facts of a checkpoint with which a fresh march can go on.

    Raises
    ------
    InputError
        There is none, it is not as a run has written it, or the scene differs from that of the run.
    """
    arrays, facts = files.load_checkpoint(path)
    if facts.pop("signature", None) != signature(arrays, facts):
        reason = "damaged, or written by another version of this program"
        raise files.refused_checkpoint(path, reason)
    if mistakes := list(differences(facts["input"], identity(march.assembly), str(path))):
        if len(mistakes) > MOST_DIFFERENCES:
            raise files.refused_checkpoint(path, f"another scene: {len(mistakes)} keys differ")
        derived = derived_keys(march.assembly.scene)  # nobody typed what follows
        raise InputError([m for m in mistakes if m.key not in derived] or mistakes)
    if arrays["full"].shape != (march.assembly.unknowns,):
        raise files.refused_checkpoint(path, f"{len(arrays['full'])} unknowns")
    return arrays, facts
