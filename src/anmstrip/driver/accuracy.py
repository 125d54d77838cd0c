"""What accuracy costs on a scene: errors against seconds and tangents, measured by refinement."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anmstrip.advice.preview import Preview, free_motions
from anmstrip.advice.warnings import levels
from anmstrip.driver.explain import cell, plain_table, text_of
from anmstrip.driver.recorder import flat_keys
from anmstrip.driver.run import Run, require_scene
from anmstrip.driver.scene import Scene
from anmstrip.driver.sweep import CHECKPOINT, SUMMARY, Sweep, Variant, folder_name, run_scene
from anmstrip.errors import InputError, Mistake, as_path, as_texts
from anmstrip.fem.sampling import displacement_at
from anmstrip.results.files import load_checkpoint, read_json, write_table
from anmstrip.scene.tables import ENDS
from anmstrip.simulation.problem import Assembly

if TYPE_CHECKING:
    from distributed import Client
    from matplotlib.figure import Figure

COMPARED_TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
"""Compared beside the scene's own; a tenth of the strictest is the truth."""

MIN_TRUE_TOLERANCE = 1e-9
"""Least tolerance of the truth: from about there on the last digits of positions show."""

FINER_VALUES = {1: (0.25, 0.5, 1.0, 2.0, 4.0), 2: (0.5, 1.0, 2.0)}
"""Values of ``strip.finer`` over the scene's own, by the dimensions of its mesh; the last is the
truth, with four times the unknowns."""

TRIED_ORDERS = (8, 12, 16, 20, 25)

SPEED_RATIOS = (10.0, 1.0, 0.1, 0.01)
"""Values of V_c over the scene's own; the last is the truth."""

SHARPENED_LAWS = ("algebraic", "tanh")
"""Friction laws that V_c only regularises; Norton and Hoff's is another one with another V_c."""

MAX_LEVEL_COST = 32.0
"""Seconds of an expansion, over the scene's own, that a level of kinematics may take."""

OTHER_STATE = 0.1
"""Share of the largest tension by which those of another state differ, as of strip that Newton's
method leaves smooth where series come to wrinkles; errors are less with any tolerance compared."""

VARIED_PARTS = {
    "tolerance": ("path", "time"),
    "newton": ("path", "time"),
    "order": ("path", "time"),
    "mesh": ("mesh", "regularisation"),
    "speed": (),
    "kinematics": (),
}
"""What can be varied, and the parts of the error budget that go with it."""

REQUIREMENTS = {
    "mesh": "strip.length, width and cells instead of strip.mesh",
    "speed": '[friction] with law = "algebraic" or "tanh", and regularisation = "fixed"',
    "kinematics": "a scene that two levels see whole and hold, see anmstrip explain",
}
"""What a scene must have to be varied along some of them."""

ERROR_KINDS = ("tension", "force", "position")

ACCURACY_COLUMNS = (
    *("along", "value", "tolerance", "element", "unknowns", "status", "seconds", "tangents"),
    *(f"{of}_{kind}" for kind in ERROR_KINDS for of in ("true", "estimated")),
    *("directory", "truth"),
)

WRITE_ENDS_ONLY = 1_000_000
"""Steps between states that are written: writing would be part of what is measured."""

Settings = dict[str, Any]
"""Dotted keys of a scene and their values."""


@dataclass(frozen=True)
class Trial:
    """A scene beside the one that it is judged by."""

    along: str
    value: float | str  # of what is varied; of a mesh, how many times finer than the scene's
    settings: Settings
    truth: Settings


def list_trials(assembly: Assembly, scene: Scene) -> Iterator[Trial]:
    """Yield all that can be compared on a scene.

    Meshes, V_c and levels of kinematics are compared at the tolerance of the truth, where nothing
    else is seen.
    """
    own = scene.solver.tolerance
    chosen = sorted({own, *COMPARED_TOLERANCES}, reverse=True)
    strictest = max(float(f"{0.1 * chosen[-1]:.6g}"), MIN_TRUE_TOLERANCE)
    strict: Settings = {"solver.tolerance": strictest}
    for name, method in (("tolerance", "series"), ("newton", "newton")):
        for value in chosen:
            yield Trial(name, value, {"solver.tolerance": value, "solver.method": method}, strict)
    for order in sorted({assembly.order, *TRIED_ORDERS}):
        yield Trial("order", order, {"solver.tolerance": own, "solver.order": order}, strict)
    if scene.strip.mesh is None:
        shares, usual = FINER_VALUES[assembly.strip.mesh.dim()], scene.strip.finer or 1.0
        meshes = [{**strict, "strip.finer": share * usual} for share in shares]
        for share, settings in zip(shares[:-1], meshes, strict=False):
            yield Trial("mesh", share, settings, meshes[-1])
    law = assembly.scene.friction
    if law is not None and law.law in SHARPENED_LAWS and law.regularisation != "auto":
        laws = [{**strict, "friction.speed": share * (law.speed or 0.0)} for share in SPEED_RATIOS]
        for settings in laws[:-1]:
            yield Trial("speed", settings["friction.speed"], settings, laws[-1])
    found = [level for level in levels(Preview.of(assembly)) if not level.against]
    names = [level.kinematics.name for level in found if (level.cost or np.inf) <= MAX_LEVEL_COST]
    names = [name for name in names if is_held(scene, {"strip.kinematics": name})]
    for name in names[:-1]:
        settings, truth = ({**strict, "strip.kinematics": each} for each in (name, names[-1]))
        yield Trial("kinematics", name, settings, truth)


def is_held(scene: Scene, settings: Settings) -> bool:
    """Whether a scene can have other values, and the strip is held in all directions then."""
    try:
        return not any(free_motions(Preview.of(Assembly(adjust(scene, settings)))))
    except InputError:
        return False


def adjust(scene: Scene, settings: Settings) -> Scene:
    """Return a scene with other values, checked as if typed, that writes its end alone."""
    tables, texts = scene.to_dict(), [f"{key}={json.dumps(v)}" for key, v in settings.items()]
    tables["output"] = {"events": scene.output.events, "every": WRITE_ENDS_ONLY}
    if scene.strip.refined == "auto":
        del tables["strip"]["refined"]
    return Scene.from_tables(tables, scene.source or Path("scene"), texts)


def timed_run(tables: str, source: str, scene: Scene, directory: Path) -> dict[str, Any]:
    """Run a scene as in a sweep, in a process that has run something like it before."""
    warm_up(tables, source)
    return run_scene(scene, directory)


@cache
def warm_up(tables: str, source: str) -> None:
    """Run a scene, as JSON, once in each process: what is imported and compiled is not measured."""
    for _ in Scene.from_tables(json.loads(tables), source).run():
        pass


@dataclass(frozen=True)
class Final:
    """Readings of the final state of a scene, for comparison with another."""

    values: dict[str, dict[str, float]]  # kind → reading → N/m or N
    places: np.ndarray[Any, Any]  # of points of the strip, (3, points), m
    summary: dict[str, Any]

    @classmethod
    def of(cls, variant: Variant, flat: np.ndarray[Any, Any]) -> Final | None:
        """Return that of a scene that came to its end, else None.

        Parameters
        ----------
        variant : Variant
        flat : ndarray, shape (1, points) or (2, points)
            Points of the flat strip whose places are compared (m).
        """
        summary = read_json(variant.directory / SUMMARY)
        if summary is None or summary["status"] != "done":
            return None
        tensions = {name: summary["edges"][name]["tension"] for name in ENDS}
        forces: dict[str, float] = {}
        for name, roller in summary["rollers"].items():
            ends = {f"{name}.{end}": roller[f"tension_{end}"] for end in ("in", "out")}
            tensions |= {key: value for key, value in ends.items() if value is not None}
            forces |= {f"{name}.{key}": roller[key] for key in ("normal_force", "drag")}
        full = load_checkpoint(variant.directory / CHECKPOINT)[0]["full"]
        places = displacement_at(Assembly(variant.scene).strip, full, flat)
        return cls({"tension": tensions, "force": forces}, places, summary)

    def error(self, truth: Final) -> dict[str, float]:
        """Return the largest differences from another state, as in the error budget.

        Of what both have: no tension is read off beside a roller that nothing touches.
        """
        found = {}
        for kind, own in self.values.items():
            if both := own.keys() & truth.values[kind].keys():
                found[kind] = max(abs(own[name] - truth.values[kind][name]) for name in both)
        away = np.linalg.norm(self.places - truth.places, axis=0)
        return {**found, "position": float(away.max())}

    def estimate(self, along: str) -> dict[str, float]:
        """Return what the error budget says of the parts that go with an axis, as a sum."""
        parts = [self.summary["errors"][name] for name in VARIED_PARTS[along]]
        known = [part for part in parts if part is not None]
        return {kind: sum(part[kind] for part in known) for kind in ERROR_KINDS if known}

    @property
    def seconds(self) -> float:
        """Wall time without that of the estimates (s)."""
        return float(self.summary["wall_seconds"] - self.summary["seconds"].get("errors", 0.0))


class Accuracy(Sweep):
    """Study of a scene's errors and of what they cost, along what can be varied.

    Runs are those of a sweep: they go on where they were interrupted, and those that have ended
    are not run again.  The truth along tolerances, orders and Newton's method is a run to a tenth
    of the strictest tolerance; along meshes, V_c and levels of kinematics it is, at that tolerance,
    the finest mesh, the sharpest law and the level that sees most.

    Parameters
    ----------
    scene : Scene
    along : iterable of str, optional
        Some of `VARIED_PARTS`; all that apply to the scene if left out.
    directory : path
        For ``accuracy.csv``, ``accuracy.png`` and a directory of results for every scene.

    Attributes
    ----------
    trials : tuple of Trial

    Raises
    ------
    InputError
        An axis is not known, or does not apply to the scene; nothing was written.

    Examples
    --------
    Without a client of dask the scenes run in this process, one after the other::

        study = Accuracy(Scene.load("capstan.toml"), ["tolerance"], directory="results")
        for ended in study.run():
            print(ended)
        print(study.report())
    """

    def __init__(self, scene: Scene, along: Iterable[str] = (), *, directory: str | Path) -> None:
        require_scene(scene)
        self.scene, self.assembly = scene, Assembly(scene)
        every, chosen = tuple(list_trials(self.assembly, scene)), as_texts("along", along)
        known = list(dict.fromkeys(trial.along for trial in every))
        wrong = [name for name in chosen if name not in known]
        if wrong:
            expected = f"what this scene can be varied along: {', '.join(known)}"
            hints = [REQUIREMENTS.get(name, f"--along {known[0]}") for name in wrong]
            given = zip(wrong, hints, strict=True)
            raise InputError(Mistake("--along", "", name, expected, hint) for name, hint in given)
        self.trials = tuple(trial for trial in every if not chosen or trial.along in chosen)
        directory, made = as_path("directory", directory).absolute(), dict[str, Variant]()
        for settings in (each for t in self.trials for each in (t.truth, t.settings)):
            if (name := self.name(settings)) not in made:
                here = adjust(scene, settings)
                strip = Run(here).assembly.strip
                sizes = {"element": float(strip.cell_sizes[0].min()), "unknowns": strip.unknowns}
                tolerance = {"tolerance": here.solver.tolerance}
                made[name] = Variant({**tolerance, **sizes}, here, directory / name)
        self.finals: dict[str, Final] = {}
        self._prepare(tuple(made.values()), directory / "accuracy.csv")
        easiest = adjust(scene, {"solver.tolerance": COMPARED_TOLERANCES[0]})
        self.job = partial(timed_run, json.dumps(easiest.to_dict()), str(scene.source or "scene"))

    def name(self, settings: Settings) -> str:
        """Return the name of the directory of a scene, after what is not the given scene's own."""
        own = {"strip.finer": 1.0, "solver.order": self.assembly.order}
        own |= flat_keys(self.assembly.scene.to_dict())
        others = {key: value for key, value in settings.items() if own.get(key) != value}
        return folder_name(others) or "as_given"

    @property
    def plan(self) -> str:
        """Sentence that says how many runs there are, along what, and how large they are."""
        left, along = len(self.waiting), ", ".join(dict.fromkeys(t.along for t in self.trials))
        most = max(int(variant.values["unknowns"]) for variant in self.variants)
        return (
            f"{len(self.variants)} runs along {along}, {left} of them still to do; the largest has "
            f"{most / self.assembly.strip.unknowns:.2g} times the unknowns of the scene."
        )

    def final(self, settings: Settings) -> Final | None:
        """Return the final state of a scene, None as long as there is none."""
        name = self.name(settings)
        if name not in self.finals:
            variant = next(each for each in self.variants if each.directory.name == name)
            if (found := Final.of(variant, self.assembly.strip.mesh.p)) is not None:
                self.finals[name] = found
        return self.finals.get(name)

    def results(self) -> Iterator[dict[str, Any]]:
        """Yield a row of `ACCURACY_COLUMNS` for every trial; what is not known yet is not in it."""
        rows = {row["directory"]: row for row in self.rows}
        for trial in self.trials:
            row = {"along": trial.along, "value": trial.value, "truth": self.name(trial.truth)}
            row |= rows[self.name(trial.settings)]
            truth = self.final(trial.truth)
            if (final := self.final(trial.settings)) is not None:
                row["seconds"] = final.seconds
                parts = {"estimated": final.estimate(trial.along)}
                if truth is not None:
                    parts["true"] = final.error(truth)
                row |= {f"{of}_{kind}": v for of, part in parts.items() for kind, v in part.items()}
            yield row

    def write_table(self) -> None:
        """Write all rows of ``accuracy.csv``."""
        write_table(self.table, ACCURACY_COLUMNS, self.results())

    def figure(self) -> Figure:
        """Return the errors of tensions against seconds and tangents."""
        from anmstrip.pictures.curves import accuracy_figure

        return accuracy_figure(list(self.results()), self.tension)

    @property
    def tension(self) -> float:
        """Largest tension (N/m) of the scene, or of the states that others are compared with."""
        truths = filter(None, map(self.final, (trial.truth for trial in self.trials)))
        found = (abs(value) for truth in truths for value in truth.values["tension"].values())
        return max([self.assembly.scales.tension, *found])

    def report(self) -> str:
        """Return the table in words, what stopped, and the advice."""
        heads = ("T, true\n(N/m)", "estimated\n(N/m)", "force, true\n(N)", "estimated\n(N)")
        more = ("position, true\n(m)", "estimated\n(m)", "\nseconds", "\ntangents")
        table = plain_table("Errors and what they cost", "\nalong", "\nvalue", *heads, *more)
        errors = [f"{of}_{kind}" for kind in ERROR_KINDS for of in ("true", "estimated")]
        for row in self.results():
            value = self.mesh_words(row) if row["along"] == "mesh" else row["value"]
            told = value if isinstance(value, str) else f"{value:.3g}"
            cells = [cell(row.get(error), ".2g") for error in errors]
            spent = f"{row['seconds']:.2f}" if "seconds" in row else row["status"]
            table.add_row(row["along"], told, *cells, spent, str(row.get("tangents") or "–"))
        return f"{text_of([table], width=110)}\n{self.advice()}"

    def mesh_words(self, row: Mapping[str, Any]) -> str:
        """Return what tells a mesh from others: its shortest elements, if they are not the same.

        Where rollers ask for elements so short that all meshes have these, it is ``strip.finer``.
        """
        lengths = [row["element"] for row in self.results() if row["along"] == "mesh"]
        if len(set(lengths)) == len(lengths) or row["along"] != "mesh":
            return f"{row['element']:.3g} m"
        return f"strip.finer × {row['value']:g}"

    def advice(self) -> str:
        """Return what the scene's own tolerance and mesh give at what cost, and a tenth of it."""
        done = [row for row in self.results() if "true_tension" in row]
        by = {name: [row for row in done if row["along"] == name] for name in VARIED_PARTS}
        own = self.scene.solver.tolerance
        here = next((row for row in by["tolerance"] if row["value"] == own), None)
        if here is None:
            missing = "" if by["tolerance"] else "; it needs --along tolerance as well"
            return f"No advice without a run to the scene's own tolerance, and its truth{missing}."
        usual = next((row for row in by["mesh"] if row["value"] == 1.0), None)
        meshes = [{**here, "true_tension": 0.0}] if usual is None else by["mesh"]
        usual = usual or meshes[0]
        wrong = here["true_tension"] + usual["true_tension"]
        share = 100.0 * wrong / self.tension
        told = (
            f"A tolerance of {own:g} on {here['element']:.2g} m gives tensions to {share:.2g} % in "
            f"{here['seconds']:.2g} s{'' if by['mesh'] else ', errors of the mesh left out'}; "
        )
        pairs = [
            (
                t["true_tension"] + m["true_tension"],
                t["seconds"] / here["seconds"] * m["seconds"] / usual["seconds"],
                f"by a tolerance of {t['value']:g} on {self.mesh_words(m)}, costs about",
            )
            for t, m in product(by["tolerance"], meshes)
            if t["value"] <= own  # with a looser one an error is smaller by chance alone
        ]
        better = [pair for pair in pairs if pair[0] <= 0.1 * wrong]
        error, cost, words = min(better, key=lambda pair: pair[1]) if better else min(pairs)
        share = "a tenth of that" if better else f"{100.0 * error / wrong:.2g} % of that, the least"
        if better or error < 0.9 * wrong:
            told += f"{share}, {words} {cost:.2g} times as much."
        else:
            told += "no other tolerance and mesh of this table does better."
        newton = next((row for row in by["newton"] if row["value"] == own), None)
        if newton is not None and newton["true_tension"] > OTHER_STATE * max(self.tension, wrong):
            told += (
                " Newton's method comes to another state, whose tensions differ by "
                f"{newton['true_tension']:.2g} N/m."
            )
        elif newton is not None:
            spent, tangents = (newton[key] / here[key] for key in ("seconds", "tangents"))
            told += (
                f" Newton's method takes {spent:.2g} times as long and {tangents:.2g} times as "
                "many tangents."
            )
        return told


def accuracy(
    scene: Scene, along: Iterable[str] = (), *, directory: str | Path, client: Client | None = None
) -> Accuracy:
    """Measure what accuracy costs on a scene; see :class:`Accuracy`.

    Parameters
    ----------
    scene : Scene
    along : iterable of str, optional
    directory : path
        As of the class.
    client : distributed.Client, optional
        Shares the runs out; without one they run here, one after the other.

    Returns
    -------
    Accuracy
        Its table and figure are written.
    """
    study = Accuracy(scene, along, directory=directory)
    for _ in study.run(client):
        pass
    study.draw()
    return study
