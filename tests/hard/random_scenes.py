"""Random scenes: valid ones of any size, stiffness and speed, each run to an outcome.

A scene is drawn from a list of numbers between 0 and 1, so that hypothesis and a generator of
random numbers make the same kinds.  Every run must end done or with a structured outcome,
within a bounded number of tangents, and leave nothing on disk that is no number::

    python tests/hard/random_scenes.py --count 2000 --seed 0
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import serious
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium
from anmstrip.errors import InputError
from anmstrip.results.vtk import read_surface

Option = TypeVar("Option")

MOST_TANGENTS = 1500
"""Of one run, unless it is told otherwise."""


@dataclass
class Dice:
    """Quantities from numbers between 0 and 1.

    Attributes
    ----------
    draw : callable
        Gives the next number.
    """

    draw: Callable[[], float]

    def between(self, low: float, high: float) -> float:
        """A number, evenly."""
        return low + (high - low) * self.draw()

    def decades(self, low: float, high: float) -> float:
        """A positive number, evenly in its logarithm."""
        return float(low * (high / low) ** self.draw())

    def one_of(self, options: Sequence[Option]) -> Option:
        """One of several."""
        return options[min(int(self.draw() * len(options)), len(options) - 1)]

    def chance(self, share: float) -> bool:
        """Whether something is so."""
        return self.draw() < share


@dataclass(frozen=True)
class Ending:
    """What became of a scene.

    Attributes
    ----------
    status : str
        ``done``, ``refused``, or the name of an outcome.
    message : str
    tangents : int
    seconds : float
    faults : tuple of str
        What must not be.
    forewarned : bool
        Whether doubts were told before it ran.
    """

    status: str
    message: str
    tangents: int
    seconds: float
    faults: tuple[str, ...] = ()
    forewarned: bool = False


def tables_of(dice: Dice, graded: float = 0.5) -> dict[str, Any]:
    """A small section over rollers or without any: always a scene that the reader takes.

    Parameters
    ----------
    dice : Dice
    graded : float
        Share of the scenes with rollers whose contact is no penalty.
    """
    thickness, young = dice.decades(1e-5, 1e-2), dice.decades(1e9, 4e11)
    tension = young * thickness * dice.decades(1e-6, 2e-3)
    span = dice.decades(0.5, 20.0)
    rolled = dice.chance(0.85)
    threaded = rolled and dice.chance(0.5)
    cells = dice.one_of((1, 2, 6, 10, 16))
    strip = {"width": dice.decades(0.05, 2.0), "thickness": thickness, "kinematics": "section"}
    strip |= {"cells": [cells, 1], "bending": not dice.chance(0.1)}
    layer = np.sqrt(young * thickness**3 / 12.0 / tension)
    strip["refined"] = max(0.25 * float(layer), span / dice.one_of((10, 40, 80)))
    tables: dict[str, Any] = {
        "strip": strip if threaded else {**strip, "length": span},
        "material": {"young": young, "poisson": dice.between(0.0, 0.45), "density": 7850.0},
        "solver": {
            "tolerance": dice.decades(1e-6, 1e-2),
            "order": dice.one_of((4, 10, 20, 30)),
            "max_tangents": MOST_TANGENTS,
        },
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "output": {"every": 20},
    }
    held = not rolled and dice.chance(0.5)
    if held:
        tables["edges"]["exit"] = {"fixed": ["z"]}
    if rolled:
        tables |= _rolled(dice, span, tension / span, threaded)
    if threaded:
        tables["threading"] = {
            "tension": tension,
            "entry": [-0.5 * span, 0.0, dice.between(-0.02, 0.02) * span],
            "exit": [0.5 * span, 0.0, dice.between(-0.02, 0.02) * span],
        }
    names = [roller["name"] for roller in tables.get("rollers", ())]
    rubs = "friction" in tables
    tables["stages"] = list(_stages(dice, tension, span, names, threaded, rubs))
    if rolled and dice.chance(graded):
        tables["contact"] = _graded(dice, tension, span)
    return tables


def _rolled(dice: Dice, span: float, pressure: float, threaded: bool) -> dict[str, Any]:
    """Rollers in a row, contact and perhaps friction."""
    stiffness = pressure * dice.decades(1e3, 1e9) / span
    delta = span * dice.decades(1e-5, 1e-2)
    count = dice.one_of((1, 1, 2, 3))
    rollers: list[dict[str, Any]] = []
    for k in range(count):
        radius = span / (2.5 * count) * dice.decades(0.05, 1.0)
        x = span * ((k + 0.5) / count - 0.5)
        side = dice.one_of((1.0, -1.0)) if threaded else 1.0
        lifted = radius * (dice.between(0.05, 0.9) if threaded else -dice.decades(1e-4, 1e-1))
        rollers.append({"name": f"r{k + 1}", "radius": radius})
        rollers[-1]["centre"] = [x, 0.0, side * (lifted - radius)]
        if threaded:
            rollers[-1]["wrap"] = "over" if side > 0.0 else "under"
    tables: dict[str, Any] = {
        "contact": {
            "stiffness": stiffness,
            "eta": min(pressure, stiffness * delta) * dice.decades(1e-6, 1e-1),
            "delta": delta,
        },
        "rollers": rollers,
    }
    if dice.chance(0.75):
        tables["friction"] = {
            "law": dice.one_of(("norton-hoff", "norton-hoff", "tanh")),
            "coefficient": dice.between(0.0, 1.0),
            "exponent": dice.decades(0.01, 1.0),
            "omega": dice.decades(1e-4, 1.0),
            "speed": dice.decades(1e-6, 1.0),
        }
    return tables


def _graded(dice: Dice, tension: float, span: float) -> dict[str, float]:
    """Contact without a penalty: as sharp as the mesh resolves, or of a given onset or pressure."""
    given = {
        "onset": span * dice.decades(1e-6, 1e-2),
        "pressure": tension / span * dice.decades(1e-1, 1e3),
    }
    return {key: value for key, value in given.items() if dice.chance(0.3)}


def _stages(
    dice: Dice, tension: float, span: float, names: list[str], threaded: bool, rubs: bool
) -> Iterator[dict[str, Any]]:
    """Pulled, laid on the rollers if it is not threaded, then whatever comes."""
    duration = dice.decades(1e-3, 10.0)
    if not threaded:
        slowly = {} if dice.chance(0.1) or not rubs else {"friction": False}
        pull = {"force": [tension, 0.0, 0.0]}
        yield {"name": "pull", "duration": 1.0, "exit": pull, **slowly}
        if names and dice.chance(0.8):
            down = dice.between(0.0, 0.4)
            move = [0.0, 0.0, -down * span]
            force = [tension, 0.0, -2.0 * down * tension]
            held, led = {"entry": {"move": move}}, {"exit": {"force": force}}
            yield {"name": "lay", "duration": 1.0, **slowly, **held, **led}
    for k in range(dice.one_of((1, 1, 2))):
        stage: dict[str, Any] = {"name": f"then{k}", "duration": duration}
        for name in names:
            control: dict[str, Any] = {}
            if dice.chance(0.6):
                control["surface_speed"] = dice.one_of((-1, 1)) * dice.decades(1e-4, 10.0)
            if dice.chance(0.2):
                control["move"] = [0.0, 0.0, dice.between(-0.05, 0.05) * span]
            if control:
                stage.setdefault("rollers", {})[name] = control
        if dice.chance(0.2):
            stage["gravity"] = [0.0, 0.0, -9.81]
        if dice.chance(0.2):
            stage["pressure"] = dice.between(-1.0, 1.0) * tension / span
        if dice.chance(0.2):
            stage["exit"] = {"force": [tension * dice.one_of((0.0, 0.5, 2.0)), 0.0, 0.0]}
        if k == 0 and dice.chance(0.15):
            stage["entry"] = {"release": True}
        yield stage


def from_seed(seed: int, tangents: int = MOST_TANGENTS, *, graded: float = 0.5) -> dict[str, Any]:
    """The scene of a seed, which may take so many tangents."""
    tables = tables_of(Dice(np.random.default_rng(seed).random), graded)
    tables["solver"]["max_tangents"] = tangents
    return tables


def ending_of(tables: dict[str, Any]) -> Ending:
    """Run a scene, and look at what it leaves."""
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        try:
            run = Run(Scene.from_tables(tables, directory / "scene.toml"), directory)
            for _ in run:
                pass
        except InputError as error:
            return Ending("refused", str(error), 0, time.process_time() - begin)
        seconds = time.process_time() - begin
        message, tangents = run.message, run.cost.expansions
        faults = tuple(faults_of(directory, run))
    status = "done" if run.outcome.done else run.outcome.name.lower()
    warned = bool(serious(Preview.of(run.assembly)))
    return Ending(status, message, tangents, seconds, faults, warned)


def faults_of(directory: Path, run: Run) -> Iterator[str]:
    """What must not be: no outcome, more tangents than allowed, no numbers on disk."""
    facts = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
    if not facts["status"] or not re.search(r"(\.|--set ('[^']+'|\S+))$", facts["message"]):
        yield f"no outcome: {facts['status']}, {facts['message']}"
    if run.cost.expansions > run.scene.solver.max_tangents:
        yield f"{run.cost.expansions} tangents"
    yield from _no_numbers(facts, "summary.json")
    yield from _not_at_rest(run)
    with (directory / "history.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            for key, value in row.items():
                if key != "stage" and value and not np.isfinite(float(value)):
                    yield f"history.csv: {key} = {value}"
    for path in directory.glob("strip_*.vtu"):
        surface = read_surface(path)
        for key, values in (("points", surface.points), *surface.fields.items()):
            if not np.isfinite(values).all():
                yield f"{path.name}: {key}"


def _not_at_rest(run: Run) -> Iterator[str]:
    """A run that is done ends in equilibrium, seen by the plain residual."""
    state = run.state
    if not run.outcome.done or state is None:
        return
    plan = state.plan
    equations = Equilibrium(plan.model, plan.supports, plan.controls)
    left = equations.imbalance(state.imbalance[plan.supports.free])
    if not left <= run.scene.solver.tolerance:
        yield f"imbalance {left:.2g} at the end"


MAY_BE_MISSING = {
    "offset",
    "slip_arc",
    "line_load_in",
    "line_load_out",
    "tension_in",
    "tension_out",
    "tension_ratio",
    "capacity_used",
    "errors",
}


def _no_numbers(inside: Any, place: str) -> Iterator[str]:
    """Entries of a summary that are null where a number belongs."""
    if isinstance(inside, dict):
        for key, value in inside.items():
            if key not in MAY_BE_MISSING:
                yield from _no_numbers(value, f"{place}: {key}")
    elif isinstance(inside, list):
        for value in inside:
            yield from _no_numbers(value, place)
    elif inside is None:
        yield f"{place} is no number"


def main() -> int:
    """Run ``--count`` scenes and tell what became of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tangents", type=int, default=MOST_TANGENTS, help="of one run at most")
    given = parser.parse_args()
    warnings.simplefilter("error")
    tally: Counter[str] = Counter()
    for seed in range(given.seed, given.seed + given.count):
        try:
            end = ending_of(from_seed(seed, given.tangents))
        except Exception as error:
            end = Ending("raised", "", 0, 0.0, (f"{type(error).__name__}: {error}",))
        tally[f"{end.status}{', forewarned' if end.forewarned else ''}"] += 1
        tally["faults"] += bool(end.faults)
        said = end.faults or ((end.message,) if end.status != "done" else ())
        print(
            f"{seed}: {end.status}{', forewarned' if end.forewarned else ''}, "
            f"{end.tangents} tangents, {end.seconds:.1f} s",
            *said,
            flush=True,
        )
    print(dict(tally))
    return 1 if tally["faults"] else 0


if __name__ == "__main__":
    sys.exit(main())
