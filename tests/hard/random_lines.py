"""Random steady lines, and where they must settle by statics and the theory of creep.

Varied ones have idlers and bearings, a given tension instead of a given speed, any law of friction
and contact, far origins, strip that is bent, sections, shells on profiled and yawed rollers,
triangles, and strip that is fed over idlers in time, all at the default settings of the solver.

A line is drawn as spans and turns: its rollers follow from them, so that the solver's own search
for a path has no part in what is expected.  All rollers run at one speed; the strip's own is chosen
so that the last roller would take a drawn share of its grip if it were alone::

    python tests/hard/random_lines.py --count 500 --seed 0 --varied
"""

from __future__ import annotations

import argparse
import copy
import signal
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from skfem import MeshTri

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError

MOST_TANGENTS = 300
"""Of one line that is not varied."""

SECONDS = 60
"""Of one line at most, on one core, where many are drawn: tests are held to tangents."""

THIN = 0.05
"""Boundary layer of strip that is bent, over its shortest arc: bending then hardly counts."""

CURLED = 0.005
"""Share of the tension by which the edges of bent strip may change it: bent around R they curl, by
about 0.1 ν t over √(R t) on either side, and what is off the roller by w is longer by w/R."""

TURNS = 5.0, 300.0
"""Least and largest wrap (degrees)."""


@dataclass(frozen=True)
class Line:
    """A line of rollers of one speed, and what is drawn of it."""

    tables: dict[str, Any]
    turns: list[float]  # of the string, with the sense (rad)
    exit: float  # N/m
    stiffness: float  # E t (N/m)
    speed: float  # of the rollers (m/s)
    strip_speed: float  # m/s
    coefficient: float
    slip_speed: float  # V_c (m/s)
    law: dict[str, Any] = field(default_factory=lambda: {"law": "tanh", "omega": 0.1})
    drags: tuple[float | None, ...] = ()  # of idlers (N/m), None of driven rollers
    allowed: float = 0.005  # error of a tension, over the largest one

    def tensions(self) -> list[float]:
        """Tensions from the entry on: dT/dφ = T f g(V − c λ(T)) backwards on every driven roller.

        Idlers raise the tension by their drag.
        """
        found = [self.exit]
        drags = self.drags or (None,) * len(self.turns)
        for turn, drag in zip(reversed(self.turns), reversed(drags), strict=True):
            found.append(self._before(found[-1], abs(turn)) if drag is None else found[-1] - drag)
        return found[::-1]

    def _before(self, tension: float, turn: float) -> float:
        """Tension before a roller from that behind it; stiff where the strip sticks."""

        def rate(_: float, log: Any) -> Any:
            return [self.coefficient * self._share(float(np.exp(log[0])))]

        start = [np.log(tension)]
        found = solve_ivp(rate, (0.0, turn), start, method="Radau", rtol=1e-8, atol=1e-10)
        return float(np.exp(found.y[0, -1]))

    def _share(self, tension: float) -> float:
        """Share of f R_N at s = slip/V_c, of the law."""
        strain = tension / self.stiffness
        slip = self.speed - self.strip_speed * (1.0 + strain * (1.0 - 1.5 * strain))
        slip /= self.slip_speed
        if self.law["law"] == "algebraic":
            return float(slip / np.hypot(slip, 1.0))
        size = np.hypot(slip, self.law["omega"])
        if self.law["law"] == "tanh":
            return float(np.tanh(size) / size * slip)
        return float(size ** (self.law["exponent"] - 1.0) * slip)


def drawn(seed: int) -> Line:
    """Draw a line of one to five rollers whose spans do not run into its rollers."""
    rng = np.random.default_rng(seed)
    while (line := _tried(rng)) is None:
        pass
    return line


def _tried(rng: np.random.Generator) -> Line | None:
    """Lay a line and say what it carries; None where it runs into itself."""
    count = int(rng.integers(1, 6))
    laid = layout(rng, rng.uniform(0.1, 0.6, count))
    return None if laid is None else _scene(rng, *laid)


def layout(
    rng: np.random.Generator, sizes: np.ndarray
) -> tuple[list[np.ndarray], list[tuple[str, np.ndarray, float, str]], list[float]] | None:
    """Go along the strip: spans straight on, rollers beside it around which it turns.

    Return points on the way, name, centre, radius and wrap of every roller, and its turn (rad, to
    the left); None where the strip runs into a roller or itself.
    """
    place, heading, low, high = np.zeros(2), 0.0, *np.radians(TURNS)
    path, rollers, turns = [place], [], []
    for number, radius in enumerate(sizes):
        sense = rng.choice([-1.0, 1.0])  # +1 turns to the left
        turn = sense * (low + (high - low) * rng.uniform() ** 2)
        forward = np.array([np.cos(heading), np.sin(heading)])
        path += list(place + np.linspace(0.0, rng.uniform(0.3, 2.0), 60)[1:, None] * forward)
        place = path[-1]
        centre = place + sense * radius * np.array([-forward[1], forward[0]])
        angles = heading + np.linspace(0.0, turn, 40)
        arc = centre + sense * radius * np.stack([np.sin(angles), -np.cos(angles)], axis=1)
        path += list(arc[1:])
        rollers.append((f"r{number}", centre, radius, "under" if sense > 0.0 else "over"))
        place, heading = arc[-1], heading + turn
        turns.append(float(turn))
    forward = np.array([np.cos(heading), np.sin(heading)])
    path += list(place + np.linspace(0.0, rng.uniform(0.3, 2.0), 60)[1:, None] * forward)
    return None if _touches(np.array(path), rollers) else (path, rollers, turns)


def varied(seed: int, directory: Path) -> Line:
    """Draw a line of any kind whose tensions statics and the theory of creep tell all the same.

    Parameters
    ----------
    seed : int
    directory : Path
        Where a mesh of triangles is written.
    """
    rng, more = np.random.default_rng([11, seed]), np.random.default_rng([12, seed])
    line = _with_law(more, drawn(int(rng.integers(100_000))))
    tables = copy.deepcopy(line.tables)
    del tables["solver"]
    driven = int(rng.integers(len(line.turns)))
    drags = _idlers(rng, tables, line, driven)
    stage, strip = tables["stages"][0], tables["strip"]
    level = rng.choice(["string", "section", "shell", "triangles"], p=[0.3, 0.4, 0.2, 0.1])
    young, thickness = tables["material"]["young"], strip["thickness"]
    layer = np.sqrt(young * thickness**3 / 12.0 / line.exit)
    arcs = [r["radius"] * abs(t) for r, t in zip(tables["rollers"], line.turns, strict=True)]
    strip["bending"] = level != "string" and bool(layer < THIN * min(arcs))
    strip["kinematics"] = "section" if level in ("string", "section") else "shell"
    if strip["kinematics"] == "shell":
        _across(more, tables, line, drags, driven)
    pressure = line.exit / min(roller["radius"] for roller in tables["rollers"])
    tables["contact"] = [
        {}, {"pressure": pressure * 10.0 ** rng.uniform(-1.0, 2.0)},
        {"stiffness": pressure * 1e5, "eta": 1e-3 * pressure, "delta": 1e-3},
    ][rng.integers(3)]  # fmt: skip
    if more.random() < 0.15 and level != "triangles":
        drags = _fed(more, tables, line)
    if level == "triangles":
        _turned(tables, -sum(line.turns))
        strip["mesh"] = _triangles(tables, directory / f"{seed}.msh")
        del tables["threading"]["exit"]
    away = rng.choice([0.0, 1e3, 1e6]) * rng.choice([-1.0, 1.0], 2)
    shift = np.array([away[0], 0.0, away[1]])
    for table, key in _places(tables):
        table[key] = tuple(float(x) for x in table[key] + shift)
    slip_speed = line.slip_speed
    if "speed" not in tables["friction"]:  # a tenth of the elastic creep, V f T/(E t)
        least = min(line.exit, stage.get("entry", {}).get("tension", np.inf))
        fastest = max(line.speed, stage.get("strip", {}).get("speed", 0.0))
        slip_speed = 0.1 * fastest * line.coefficient * least / line.stiffness
    return replace(line, tables=tables, drags=tuple(drags), slip_speed=slip_speed, allowed=0.02)


def _idlers(
    rng: np.random.Generator, tables: dict[str, Any], line: Line, driven: int
) -> list[float | None]:
    """Make some rollers idle, and give some lines a tension instead of a speed.

    Return the drags of the rollers.
    """
    drags: list[float | None] = [None] * len(line.turns)
    stage, strip = tables["stages"][0], tables["strip"]
    for k, roller in enumerate(tables["rollers"]):
        if k != driven and rng.random() < 0.5:
            roller["drive"], drags[k] = "idle", _drag(rng, line, k)
            roller["bearing"] = drags[k] * roller["radius"] * strip["width"] / _braking(line)
            del stage["rollers"][roller["name"]]
    if any(drag is not None for drag in drags) or rng.random() < 0.5:
        grip = line.coefficient * sum(
            abs(turn) for turn, drag in zip(line.turns, drags, strict=True) if drag is None
        )
        del stage["strip"]
        lost = sum(drag or 0.0 for drag in drags)
        entry = line.exit * np.exp(rng.uniform(-0.7, 0.7) * min(grip, 2.0)) - lost
        stage["entry"] = {"tension": max(entry, 0.2 * line.exit)}
    return drags


def _drag(rng: np.random.Generator, line: Line, k: int) -> float:
    """Drag of a bearing (N/m), none or less than its roller holds."""
    grip = 0.3 * line.exit * np.expm1(line.coefficient * abs(line.turns[k]))
    return float(rng.choice([0.0, rng.uniform(0.0, min(grip, 0.1 * line.exit))]))


def _braking(line: Line) -> float:
    """Share of its torque with which a bearing brakes, V/√(V² + V_c²)."""
    return float(line.speed / np.hypot(line.speed, line.tables["friction"].get("speed", 0.0)))


def _across(
    rng: np.random.Generator,
    tables: dict[str, Any],
    line: Line,
    drags: list[float | None],
    driven: int,
) -> None:
    """Draw what a shell has across: profiles and yawed axes, but no curl that counts.

    Both change the theory of creep, so that only rollers have them whose drag statics tells.
    """
    strip, stage = tables["strip"], tables["stages"][0]
    thickness = strip["thickness"]
    smallest = min(roller["radius"] for roller in tables["rollers"])
    curl = 0.1 * 0.3 * thickness / smallest * line.stiffness / line.exit
    curl *= 2.0 * np.sqrt(smallest * thickness) / strip["width"]
    if strip["bending"] and curl > CURLED:
        tables["material"] = tables["material"] | {"poisson": 0.0}
    tables["edges"]["entry"]["centred"] = True
    if "entry" in stage and drags.count(None) == 1:
        others = sum(drag or 0.0 for drag in drags)
        drags[driven] = line.exit - stage["entry"]["tension"] - others
    tables["rollers"] = [
        roller if drag is None else shaped(rng, roller, strip["width"])
        for roller, drag in zip(tables["rollers"], drags, strict=True)
    ]


def _with_law(rng: np.random.Generator, line: Line) -> Line:
    """Give a line any law of friction; half of the algebraic ones get the default V_c."""
    friction = dict(line.tables["friction"])
    law: dict[str, Any] = {"law": str(rng.choice(["algebraic", "tanh", "norton-hoff"]))}
    if law["law"] == "algebraic":
        del friction["omega"]
        if rng.random() < 0.5:
            del friction["speed"]
    else:
        law["omega"] = 0.1
    if law["law"] == "norton-hoff":
        law["exponent"] = float(rng.uniform(0.02, 0.1))
    tables = line.tables | {"friction": friction | law}
    return replace(line, tables=tables, law=law)


def _fed(rng: np.random.Generator, tables: dict[str, Any], line: Line) -> list[float | None]:
    """Let strip come in at a speed, in time, over idlers: their bearings are all that it carries.

    Return the drags of the rollers.
    """
    drags: list[float | None] = []
    for k, roller in enumerate(tables["rollers"]):
        drags.append(drag := _drag(rng, line, k))
        bearing = drag * roller["radius"] * tables["strip"]["width"] / _braking(line)
        roller |= {"drive": "idle", "bearing": bearing}
    duration = float(10.0 ** rng.uniform(-2.0, 0.0)) / line.speed
    speed = {"velocity": (line.speed, 0.0, 0.0)}
    tables["stages"] = [
        {"name": "start", "duration": duration, "entry": speed},
        {"name": "run", "duration": duration},
    ]
    return drags


def shaped(rng: np.random.Generator, roller: dict[str, Any], width: float) -> dict[str, Any]:
    """A cylinder, or a roller whose radius or axis differs by as little as on lines."""
    small, radius = float(rng.uniform(-1e-4, 1e-4)), roller["radius"]
    shapes: list[dict[str, Any]] = [
        {},
        {"crown": [0.0, -abs(small) * radius / width**2]},
        {"taper": 0.3 * small * radius / width},
        {"sides": {"taper": abs(small) * radius / width, "flat": 0.5 * width,
                   "rounding": 0.1 * width}},
        {"axis": (2.0 * small, 1.0, 0.0)},
    ]  # fmt: skip
    return roller | shapes[int(rng.integers(len(shapes)))]


def _places(tables: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield tables with a place in space, and its key."""
    for table in (*tables["rollers"], tables["threading"]):
        yield from ((table, key) for key in ("centre", "entry", "exit") if key in table)


def _turned(tables: dict[str, Any], angle: float) -> None:
    """Turn a line about the origin, to the left."""
    c, s = np.cos(angle), np.sin(angle)
    for table, key in _places(tables):
        x, _, z = table[key]
        table[key] = (float(c * x - s * z), 0.0, float(s * x + c * z))


def _triangles(tables: dict[str, Any], path: Path) -> str:
    """Write a mesh of triangles, as long as the strip and finer on the rollers, beside a scene."""
    from anmstrip.simulation.problem import Assembly

    strip = Assembly(Scene.model_validate(tables)).strip
    x = np.unique(np.round(strip.mesh.p[0] - strip.mesh.p[0].min(), 12))
    y = np.linspace(-0.5, 0.5, 3) * tables["strip"].pop("width")
    mesh = MeshTri.init_tensor(x, y)
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    sides = {"entry": (0, 0.0), "exit": (0, x[-1]), "right": (1, y[0]), "left": (1, y[-1])}
    edges = {
        name: np.flatnonzero(np.abs(middle[axis] - at) < 1e-9) for name, (axis, at) in sides.items()
    }
    lines = np.hstack([mesh.facets[:, chosen] for chosen in edges.values()]).T
    numbers = np.repeat(np.arange(1, 5), [len(chosen) for chosen in edges.values()])
    tags = [numbers, np.full(mesh.nelements, 5)]
    points = np.column_stack([mesh.p.T, np.zeros(mesh.p.shape[1])])
    meshio.Mesh(
        points,
        [("line", lines), ("triangle", mesh.t.T)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={name: np.array([k, 1]) for k, name in enumerate(edges, start=1)}
        | {"strip": np.array([5, 2])},
    ).write(path, file_format="gmsh22", binary=False)
    return str(path)


def _touches(path: np.ndarray, rollers: list[Any]) -> bool:
    """Whether the strip comes near a roller elsewhere than on its arc, itself, or rollers meet."""
    for _, centre, radius, _ in rollers:
        if np.linalg.norm(path - centre, axis=1).min() < 0.999 * radius:
            return True
    for k, (_, a, r, _) in enumerate(rollers):
        for _, b, s, _ in rollers[:k]:
            if np.linalg.norm(a - b) < 1.1 * (r + s):
                return True
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    apart = np.abs(length[:, None] - length) > 0.25
    distance = np.linalg.norm(path[:, None] - path, axis=2)
    return bool((distance[apart] < 0.05).any())


def _scene(
    rng: np.random.Generator, path: list[Any], rollers: list[Any], turns: list[float]
) -> Line:
    """Material, tensions, friction, and the speed of strip that takes a share of the grip."""
    thickness, young = 10.0 ** rng.uniform(-4.3, -3.0), 10.0 ** rng.uniform(9.5, 11.3)
    stiffness = young * thickness
    tension = stiffness * 10.0 ** rng.uniform(-4.5, -3.0)
    coefficient = float(np.exp(rng.uniform(np.log(0.05), 0.0)))
    speed, slip = 10.0 ** rng.uniform(-1.0, 1.0), 10.0 ** rng.uniform(-7.0, 0.0)
    share = rng.uniform(-1.2, 1.2)
    before = tension * np.exp(share * coefficient * abs(turns[-1]))
    strip_speed = speed / (1.0 + before / stiffness)
    tables = {
        "strip": {"width": 0.5, "thickness": thickness, "kinematics": "section", "bending": False},
        "material": {"young": young, "poisson": 0.3},
        "contact": {},
        "friction": {
            "law": "tanh", "coefficient": coefficient, "speed": slip * speed, "omega": 0.1,
        },
        "rollers": [
            {"name": name, "radius": r, "centre": (c[0], 0.0, c[1]), "wrap": wrap}
            for name, c, r, wrap in rollers
        ],
        "threading": {
            "tension": tension, "entry": (*path[0][:1], 0.0, path[0][1]),
            "exit": (*path[-1][:1], 0.0, path[-1][1]),
        },
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [
            {
                "name": "run", "steady": True, "strip": {"speed": strip_speed},
                "rollers": {name: {"surface_speed": speed} for name, *_ in rollers},
            }
        ],
        "solver": {"tolerance": 1e-4, "max_tangents": MOST_TANGENTS},
    }  # fmt: skip
    return Line(tables, turns, tension, stiffness, speed, strip_speed, coefficient, slip * speed)


@dataclass(frozen=True)
class Ending:
    """How a line ended."""

    kind: str  # "right", "doubted" (wrong, but told so), "wrong", "refused", "stopped", "late"
    error: float = np.nan  # largest of a tension, over the largest tension
    tangents: int = 0
    words: str = ""
    seconds: float = 0.0


class TooLateError(Exception):
    """A line has taken its time."""


@contextmanager
def seconds_of_one_core(most: int | None) -> Iterator[None]:
    """Raise where the body takes longer on the processor; never where there is no limit."""

    def late(*_: Any) -> None:
        raise TooLateError

    usual = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, most or 0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, usual)


def ending_of(line: Line, most: int | None = None) -> Ending:
    """Run a line, and compare its tensions with statics and the theory of creep."""
    begin, run = time.process_time(), None

    def ending(kind: str, error: float = np.nan, words: str = "") -> Ending:
        tangents = 0 if run is None else run.cost.expansions
        return Ending(kind, error, tangents, words, time.process_time() - begin)

    try:
        with seconds_of_one_core(most):
            run = Run(Scene.model_validate(line.tables))
            for _ in run:
                pass
    except (InputError, ValidationError) as error:
        return ending("refused", words=str(error))
    except TooLateError:
        return ending("late")
    if not run.outcome.done:
        return ending("stopped", words=run.message)
    state = run.state
    assert state is not None
    assert np.isfinite(state.full).all()
    readings = list(state.rollers.values())
    found = np.array([readings[0].tension_in, *(r.tension_out for r in readings)])
    settled = replace(line, strip_speed=state.strip_speed)
    expected = np.array(settled.tensions())
    error = float(np.abs(found - expected).max() / expected.max())
    if error < line.allowed:
        return ending("right", error)
    told = " ".join([*run.forewarnings(), *_estimates(line, error * expected.max())])
    return ending("doubted" if told else "wrong", error, f"{found} not {expected}; {told}")


def _estimates(line: Line, missed: float) -> Iterator[str]:
    """Run a line again with estimates of its errors; yield those that tell half of what it missed.

    A run that is written tells them.
    """
    run = Run(Scene.model_validate(line.tables))
    run.estimates = True
    for _ in run:
        pass
    for name, part in run.errors().items():
        if part is not None and part["tension"] > 0.5 * missed:
            yield f"{name}: {part['tension']:.3g} N/m"


def main() -> None:
    """Run many lines and count how they end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--varied", action="store_true")
    given = parser.parse_args()
    kinds: Counter[str] = Counter()
    endings: list[Ending] = []
    for seed in range(given.seed, given.seed + given.count):
        with tempfile.TemporaryDirectory() as name:
            try:
                line = varied(seed, Path(name)) if given.varied else drawn(seed)
                ending = ending_of(line, SECONDS)
            except Exception:
                ending = Ending("raised", words=traceback.format_exc(limit=-3))
        kinds[ending.kind] += 1
        endings.append(ending)
        if ending.kind != "right":
            print(
                seed, ending.kind, f"{ending.error:.2g}", ending.tangents,
                f"{ending.seconds:.1f} s", ending.words[:500], flush=True,
            )  # fmt: skip
        if len(endings) % 50 == 0:
            print(seed, dict(kinds), flush=True)
    print(dict(kinds), "median, 99 % and largest of error, tangents, seconds:")
    for values in zip(*((e.error, e.tangents, e.seconds) for e in endings), strict=True):
        print(np.nanquantile(values, [0.5, 0.99, 1.0]))


if __name__ == "__main__":
    main()
