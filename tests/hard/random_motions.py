"""Random lines in time: rollers turn under a strip that is held at its entry.

The lines are those of ``random_lines.py``, with any law of friction and of contact, kinematics and
origin; shells on crowned, tapered, conical and yawed rollers.  Every roller slips in the end, so
that statics gives the tensions, from the exit on: T rises by e^(f g φ) over a roller that carries
forwards and falls by it over one that turns back, with the share g of the law at the speed of the
surface::

    python tests/hard/random_motions.py --count 150 --seed 0
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.mechanics.laws import Algebraic, FrictionLaw, NortonHoff, Tanh
from random_lines import SECONDS, Line, TooLateError, drawn, seconds_of_one_core, shaped

LARGEST_STRAIN = 0.01
"""Of a line that is taken."""


@dataclass(frozen=True)
class Motion:
    """A line whose rollers turn under a held strip."""

    tables: dict[str, Any]
    expected: np.ndarray  # tensions from the entry on (N/m)
    allowed: float  # error of a tension, over the largest one


@dataclass(frozen=True)
class Ending:
    """What became of a line."""

    kind: str  # "right", "wrong", "refused", "stopped", "late" or "raised"
    error: float = np.nan
    tangents: int = 0
    seconds: float = 0.0
    words: str = ""


def motion(seed: int) -> Motion:
    """Draw the motion of a line: defaults of contact and solver, everything else at random."""
    rng, lines = np.random.default_rng([7, seed]), count(seed, 100_000)
    return next(found for n in lines if (found := _tried(rng, drawn(n))) is not None)


def _length(tables: dict[str, Any]) -> float:
    """More than the length (m) of the way from roller to roller."""
    radii = [0.0, *(roller["radius"] for roller in tables["rollers"]), 0.0]
    centres = [roller["centre"] for roller in tables["rollers"]]
    points = np.array([tables["threading"]["entry"], *centres, tables["threading"]["exit"]])
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum() + 2.0 * np.pi * sum(radii))


def _tried(rng: np.random.Generator, line: Line) -> Motion | None:
    """Return what a line does as its rollers turn; None if it were stretched too much."""
    tables = {key: line.tables[key] for key in ("strip", "material", "rollers", "threading")}
    strip = {key: tables["strip"][key] for key in ("width", "thickness")}
    level = rng.choice(["string", "section", "shell"], p=[0.35, 0.45, 0.2])
    strip["kinematics"] = "shell" if level == "shell" else "section"
    strip["bending"] = level != "string"
    coefficient, speed = line.coefficient, line.speed
    law, friction = _friction(rng, coefficient, speed)
    signs = rng.choice([1.0, -1.0], len(line.turns), p=[0.7, 0.3])
    turning = {
        roller["name"]: {"surface_speed": sign * speed}
        for roller, sign in zip(tables["rollers"], signs, strict=True)
    }
    shares = coefficient * float(law.share(speed)) * signs
    ratios = np.exp(shares * np.abs(line.turns))
    expected = line.exit * np.append(np.cumprod(ratios[::-1])[::-1], 1.0)
    strain = float(expected.max()) / line.stiffness
    if strain > LARGEST_STRAIN:
        return None
    travel = 10.0 ** rng.uniform(-2.0, 1.0) + 4.0 * strain * _length(tables)
    duration = float(travel) / speed
    end = {"entry": {"fixed": ["x", "z"]} | ({"centred": True} if level == "shell" else {})}
    contact = _contact(rng, line, min(roller["radius"] for roller in tables["rollers"]))
    tables |= {"strip": strip, "contact": contact, "friction": friction, "edges": end}
    tables["stages"] = [{"name": "turn", "duration": duration, "rollers": turning}]
    if law.share(2.0 * speed) > 1.001 * law.share(speed):  # grows as the rollers do
        tables["stages"].append({"name": "hold", "duration": 4.0 * duration})
    if level == "shell":
        tables["rollers"] = [shaped(rng, each, strip["width"]) for each in tables["rollers"]]
    if rng.uniform() < 0.2:
        _moved(tables, 10.0 ** rng.uniform(1.0, 6.0))
    return Motion(tables, expected, 0.005 if level == "string" else 0.05)


def _friction(
    rng: np.random.Generator, coefficient: float, speed: float
) -> tuple[FrictionLaw, dict[str, Any]]:
    """Any law, its V_c the default one or given: a millionth to a tenth of the speed."""
    slip = float(speed * 10.0 ** rng.uniform(-6.0, -1.0))
    name = str(rng.choice(["algebraic", "tanh", "norton-hoff"]))
    given: dict[str, Any] = {"law": name, "coefficient": coefficient, "speed": slip}
    if name == "algebraic":
        if rng.uniform() < 0.5:  # at the default every roller slips by 99.5 % and more
            del given["speed"]
            slip = 1e-6 * speed
        return Algebraic(coefficient, slip), given
    given["omega"] = 0.1
    if name == "tanh":
        return Tanh(coefficient, 0.1, slip), given
    given["exponent"] = float(rng.uniform(0.02, 0.2))
    return NortonHoff(coefficient, given["exponent"], 0.1, slip), given


def _contact(rng: np.random.Generator, line: Line, radius: float) -> dict[str, float]:
    """As sharp as the mesh resolves, or a penalty under which strip lies some micrometres deep."""
    if rng.uniform() < 0.7:
        return {}
    pressure, deep = line.exit / radius, 10.0 ** rng.uniform(-6.0, -4.5)
    return {"stiffness": pressure / deep, "eta": 1e-3 * pressure, "delta": 10.0 * deep}


def _moved(tables: dict[str, Any], distance: float) -> None:
    """Move a line away from the origin."""
    away = np.array([0.6, 0.0, 0.8]) * distance
    for roller in tables["rollers"]:
        roller["centre"] = tuple(np.add(roller["centre"], away))
    for end in ("entry", "exit"):
        tables["threading"] = {
            **tables["threading"], end: tuple(np.add(tables["threading"][end], away)),
        }  # fmt: skip


def ending_of(motion: Motion, most: int | None = None) -> Ending:
    """Run a line, and compare its tensions with statics."""
    begin, run = time.process_time(), None

    def ending(kind: str, error: float = np.nan, words: str = "") -> Ending:
        tangents = 0 if run is None else run.cost.expansions
        return Ending(kind, error, tangents, time.process_time() - begin, words)

    try:
        with seconds_of_one_core(most):
            run = Run(Scene.model_validate(motion.tables))
            for _ in run:
                pass
    except TooLateError:
        at = (
            ""
            if run is None or run.state is None
            else f"at t = {run.march.here(run.state.plan).time:g}"
        )
        return ending("late", words=at)
    except (InputError, ValueError) as error:
        return ending("refused", words=str(error))
    except Exception as error:
        return ending("raised", words=f"{type(error).__name__}: {error}")
    if not run.outcome.done:
        return ending("stopped", words=run.message)
    assert run.state is not None
    readings = list(run.state.rollers.values())
    found = np.array([readings[0].tension_in, *(r.tension_out for r in readings)])
    error = float(np.abs(found - motion.expected).max() / motion.expected.max())
    told = f"found {found}, expected {motion.expected}; {run.forewarnings()}"
    return ending("right" if error <= motion.allowed else "wrong", error, told)


def main() -> None:
    """Run many lines and count how they end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    kinds: Counter[str] = Counter()
    for seed in range(given.seed, given.seed + given.count):
        drawing = motion(seed)
        ending = ending_of(drawing, SECONDS)
        kinds[ending.kind] += 1
        strip, friction = drawing.tables["strip"], drawing.tables["friction"]
        level = strip["kinematics"] if strip["bending"] else "string"
        words = "" if ending.kind == "right" else ending.words[:500]
        print(
            seed, ending.kind, level, friction["law"], f"V_c {friction.get('speed', 0.0):.1e}",
            f"{ending.error:.2g}", ending.tangents, f"{ending.seconds:.1f} s", words, flush=True,
        )  # fmt: skip
    print(dict(kinds))


if __name__ == "__main__":
    main()
