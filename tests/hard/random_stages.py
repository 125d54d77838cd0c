"""Random lines through stages in time, at defaults, and what statics allows at the end of each.

Lines are laid as in ``random_lines.py``; what they do is drawn as an engineer would: a strip held
over rollers that slip under it, lines that start, run, stop, rest and reverse, tensions that
change at a standstill, rollers that are moved, strip that is fed in.  At the end of every stage
the way of the strip is that of tangents to circles (``field_statics.py``), and

* the ends bear what is asked, and every roller takes up the difference of two tensions,
  T₁ e₁ − T₂ e₂ along these tangents, which over all rollers balances the ends;
* no roller holds more than e^(fθ) (Euler and Eytelwein); where all slip, each holds just that;
* the strip has gone as far as the surfaces that grip it, or as a roller that moves makes its way
  longer.

Some lines ask more of friction than it can hold, and must be told so before they run.  How many
of five hundred lines end right within 60 s of one core each::

    PYTHONPATH=tests/field python tests/hard/random_stages.py --count 500
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.results.state import State
from field_statics import Belt, Circle, bent_belt
from random_lines import SECONDS, TooLateError, layout, seconds_of_one_core

WITHIN = 0.02
"""Of the larger tension: bending's next order, the law in full slip, the mesh."""

SHELL_WITHIN = 0.05
"""The same of a shell, whose default mesh is coarser."""

STIFF = 0.3
"""Largest √(D/T) over a radius, and twice that over a span: what is stiffer is no strip."""

FAR = 1e7
"""Distance (m) of a point in whose direction an end is pulled."""

CREEPING = 0.9
"""What Norton and Hoff's law holds of f with an exponent of 0.02, at 1/200 of V_c."""

STRAINED = 5e-3
"""Largest strain of strip bent onto a roller."""


@dataclass
class Expected:
    """What holds at the end of a stage."""

    entry: tuple[float, float]  # least and largest tension (N/m)
    exit: float  # N/m
    gone: float | None = None  # length that has passed since threading (m)
    lost: float = 0.0  # slips, bends and strains that may be missing of it (m)
    moved: dict[str, np.ndarray] = field(default_factory=dict)  # x, z (m)
    ratio: float | None = None  # of tensions over every roller, of which that power of e^(fθ)


@dataclass
class Course:
    """A line, its stages, and what is expected at their ends."""

    seed: int
    kind: str
    tables: dict[str, Any]
    circles: dict[str, Circle]
    ends: tuple[complex, complex]
    bending: float  # D (N m)
    width: float
    friction: float
    excess: float  # friction of the law in full slip at most, over f
    idle: set[str]
    bearing: float  # largest loss of tension by bearings (N/m)
    within: float
    expected: dict[str, Expected]
    overloaded: bool = False
    released: bool = False  # the entry is pulled

    @property
    def most(self) -> float:
        """Largest coefficient that acts."""
        return self.excess * self.friction

    @property
    def least(self) -> float:
        """Coefficient that acts at least where strip slips: it creeps at a rest if that grows."""
        return self.friction if self.excess == 1.0 else CREEPING * self.friction

    def way(self, tension: float, moved: dict[str, np.ndarray]) -> Belt:
        """Tangents to the rollers where they are; ends that are pulled go on in their direction."""
        circles = [
            Circle(c.centre + complex(*moved.get(name, (0.0, 0.0))), c.radius, c.sense)
            for name, c in self.circles.items()
        ]
        entry, exit = self.ends
        if moved:
            exit += FAR * np.exp(1j * self.way(tension, {}).headings[-1])
            entry -= FAR * self.released  # the first span is laid along x
        return bent_belt(entry, circles, exit, tension, self.bending)


def drawn(seed: int) -> Course:
    """Draw the course of a line."""
    rng = np.random.default_rng([16, seed])
    while True:
        found = _tried(rng, seed)
        if found is not None:
            return found


def _tried(rng: np.random.Generator, seed: int) -> Course | None:
    """Lay a line and say what it is made of; None if it is no strip."""
    count = int(rng.integers(1, 7))
    sizes = np.exp(rng.uniform(np.log(0.05), 0.0, count))
    thickness = float(np.exp(rng.uniform(np.log(20e-6), np.log(5e-3))))
    young = float(rng.choice([4e9, 7e10, 1.2e11, 2.1e11], p=[0.1, 0.2, 0.2, 0.5]))
    tension = float(np.exp(rng.uniform(np.log(1e6), np.log(1e8)))) * thickness
    bending = young * thickness**3 / 12.0 / (1.0 - 0.3**2)
    layer = float(np.sqrt(bending / tension))
    strain = tension / young / thickness
    if layer > STIFF * sizes.min() or 2.0 * layer > STIFF or strain > STRAINED:
        return None
    if 0.5 * thickness / sizes.min() > STRAINED:
        return None
    laid = layout(rng, sizes)
    if laid is None:
        return None
    path, rollers, _ = laid
    coefficient = float(np.exp(rng.uniform(np.log(0.05), np.log(0.6))))
    shell = rng.uniform() < 0.1 and count <= 2
    width = 0.3 if shell else 1.0
    tables = {
        "strip": {
            "width": width, "thickness": thickness, "kinematics": "shell" if shell else "section",
        },
        "material": {"young": young, "poisson": 0.3},
        "contact": {},
        "friction": {"coefficient": coefficient},
        "rollers": [
            {"name": name, "radius": float(r), "centre": (c[0], 0.0, c[1]), "wrap": wrap}
            for name, c, r, wrap in rollers
        ],
        "threading": {
            "tension": tension, "entry": (path[0][0], 0.0, path[0][1]),
            "exit": (path[-1][0], 0.0, path[-1][1]),
        },
        "edges": {"entry": {"fixed": ["x", "z"]} | ({"centred": True} if shell else {})},
        "stages": [],
    }  # fmt: skip
    circles = {
        name: Circle(complex(*c), float(r), 1 if wrap == "over" else -1)
        for name, c, r, wrap in rollers
    }
    ends = complex(*path[0]), complex(*path[-1])
    excess = _law(rng, tables["friction"])
    course = Course(
        seed, "", tables, circles, ends, bending, width, coefficient, excess, set(), 0.0,
        SHELL_WITHIN if shell else WITHIN, {},
    )  # fmt: skip
    runs = course.way(tension, {}).runs  # bending fades towards the ends, which bear no moment
    course.within += float(np.exp(-min(runs[0], runs[-1]) / layer))
    kinds = {
        "slip": _slip, "driven": _driven, "trimmed": _trimmed, "moved": _moved,
        "fed": _fed, "overloaded": _overloaded,
    }  # fmt: skip
    kind = str(rng.choice(list(kinds), p=[0.2, 0.4, 0.15, 0.12, 0.08, 0.05]))
    course.kind = kind + (" shell" if shell else "")
    drawing: Callable[..., bool] = kinds[kind]
    if not drawing(rng, course, tension, float(strain)):
        return None
    if shell:
        _shaped(rng, course)
    if rng.uniform() < 0.1:
        _away(course, 10.0 ** rng.uniform(1.0, 6.0))
    return course


def _law(rng: np.random.Generator, friction: dict[str, Any]) -> float:
    """Give some lines another law than the default; return how much more than f it has at most."""
    law = str(rng.choice(["algebraic", "tanh", "norton-hoff"], p=[0.7, 0.15, 0.15]))
    if law == "algebraic":
        return 1.0
    friction["law"] = law
    if law == "tanh":
        return 1.0
    friction["exponent"] = 0.02
    return 1.45  # slip is at most a hundred million times V_c


def _shaped(rng: np.random.Generator, course: Course) -> None:
    """A crown or a yawed axis, as small as on lines."""
    shape = rng.choice(["none", "crown", "yaw"])
    roller = course.tables["rollers"][0]
    if shape == "crown":
        roller["crown"] = [0.0, -1e-4 * roller["radius"]]
    elif shape == "yaw":
        angle = 2e-4
        roller["axis"] = (np.sin(angle), np.cos(angle), 0.0)


def _away(course: Course, distance: float) -> None:
    """Move a line away from the origin."""
    away = np.array([0.6, 0.0, 0.8]) * distance
    for roller in course.tables["rollers"]:
        roller["centre"] = tuple(np.add(roller["centre"], away))
    threading = course.tables["threading"]
    for end in ("entry", "exit"):
        threading[end] = tuple(np.add(threading[end], away))


def _stage(course: Course, name: str, duration: float, **controls: Any) -> None:
    course.tables["stages"].append({"name": name, "duration": duration, **controls})


def _turns(course: Course, tension: float, without: set[str] | None = None) -> float:
    """Sum of the wraps (rad)."""
    turns = course.way(tension, {}).turns
    names = course.circles
    return sum(t for name, t in zip(names, turns, strict=True) if name not in (without or set()))


def _speed(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(0.1), np.log(10.0))))


def _surfaces(course: Course, speed: float) -> dict[str, Any]:
    return {n: {"surface_speed": speed} for n in course.circles if n not in course.idle}


def _slip(rng: np.random.Generator, course: Course, tension: float, strain: float) -> bool:
    """Rollers slip under a strip that is held at its entry, forwards, perhaps back."""
    turn, f, speed = _turns(course, tension), course.most, _speed(rng)
    length = sum(course.way(tension, {}).runs) + 6.0 * max(
        c.radius for c in course.circles.values()
    ) * len(course.circles)
    highest = np.exp(f * turn)
    if strain * highest > STRAINED or highest > 1e3:
        return False
    travel = 10.0 ** rng.uniform(-1.0, 1.0) + 10.0 * strain * highest * length
    pull = tension
    for k in range(int(rng.integers(1, 4))):
        what = "turn" if k == 0 else str(rng.choice(["run", "stop", "reverse", "tension"]))
        name, duration, stage = f"{what}{k}", travel / speed, dict[str, Any]()
        if what in ("turn", "reverse"):
            if what == "reverse":
                speed = -speed
            stage["rollers"] = _surfaces(course, speed)
            duration *= 2.0
        if what == "stop":
            stage["rollers"] = _surfaces(course, 0.0)
        if what == "tension":
            pull *= float(rng.uniform(0.6, 1.5))
            stage["exit"] = {"tension": pull}
        _stage(course, name, abs(duration), **stage)
        bound = pull * np.exp(np.array([-1.0, 1.0]) * f * turn)
        ratio = None if what == "stop" else float(np.sign(speed))
        course.expected[name] = Expected((bound[0], bound[1]), pull, ratio=ratio)
        if what == "stop":
            break
    return True


def _idlers(rng: np.random.Generator, course: Course, tension: float) -> None:
    """Make some rollers idle, at least one stays driven."""
    driven = int(rng.integers(len(course.circles)))
    for k, roller in enumerate(course.tables["rollers"]):
        if k != driven and rng.uniform() < 0.4:
            roller["drive"] = "idle"
            course.idle.add(roller["name"])
            if rng.uniform() < 0.5:
                lost = 0.002 * tension
                roller["bearing"] = lost * course.width * roller["radius"]
                course.bearing += lost


def _driven(
    rng: np.random.Generator, course: Course, tension: float, strain: float, share: float = 0.0
) -> bool:
    """Start, run, stop, rest, reverse: strip between two tensions that rollers can hold."""
    _idlers(rng, course, tension)
    hold = course.friction * _turns(course, tension, course.idle)
    share = share or float(rng.uniform(-0.6, 0.6))
    if hold < 0.05 or strain * np.exp(abs(share) * hold) > STRAINED:
        return False
    course.released = True
    most = np.inf if course.overloaded else 2.0
    entry = tension * float(np.exp(np.clip(share * hold, -most, most)))
    speed, ramp = _speed(rng), float(10.0 ** rng.uniform(-1.0, 0.5))
    stretch = 4.0 * strain * np.exp(abs(np.log(entry / tension))) * 30.0
    now, gone, far, pull = 0.0, 0.0, 0.0, tension
    moved: dict[str, np.ndarray] = {}
    plan = ["start"] + [
        str(w)
        for w in rng.choice(
            ["run", "stop", "rest", "reverse", "tension", "move"], int(rng.integers(1, 5)),
        )
    ]  # fmt: skip
    for k, what in enumerate(plan):
        name, duration, stage, then = f"{what}{k}", ramp, dict[str, Any](), now
        if what == "start":
            stage["entry"], then = {"release": True, "tension": entry}, speed
        elif what == "stop":
            then = 0.0
        elif what == "reverse":
            then = -now if now else -speed
        elif what == "tension":
            factor = float(rng.uniform(0.8, 1.25))
            entry, pull = entry * factor, pull * factor
            stage["entry"], stage["exit"] = {"tension": entry}, {"tension": pull}
        elif what == "move" and not moved and not share > 1.0:
            roller = course.tables["rollers"][int(rng.integers(len(course.circles)))]
            step = rng.uniform(-0.1, 0.1, 2) * roller["radius"]
            moved = {roller["name"]: step}
            if not _apart(course, tension, moved):
                moved = {}
            else:
                stage["rollers"] = {roller["name"]: {"move": (step[0], 0.0, step[1])}}
                far += 2.0 * float(np.linalg.norm(step))
        if then != now:
            stage["rollers"] = _surfaces(course, then)
        _stage(course, name, duration, **stage)
        gone += 0.5 * (now + then) * duration
        far += (0.01 + strain) * 0.5 * (abs(now) + abs(then)) * duration
        now = then
        course.expected[name] = Expected(
            (entry, entry), pull, gone, far + stretch + 0.01 * abs(gone), dict(moved)
        )
    return True


def _apart(course: Course, tension: float, moved: dict[str, np.ndarray]) -> bool:
    """Whether a roller that moves stays under the strip, away from the others and the entry."""
    before, after = course.way(tension, {}), course.way(tension, moved)
    if np.abs(np.subtract(before.turns, after.turns)).max() > 0.3 or min(after.turns) < 0.02:
        return False
    places = [
        (c.centre + complex(*moved.get(name, (0.0, 0.0))), c.radius)
        for name, c in course.circles.items()
    ]
    if not course.released and any(abs(a - course.ends[0]) < r for a, r in places):
        return False  # the entry is held
    return all(
        abs(a - b) > 1.02 * (r + s) for k, (a, r) in enumerate(places) for b, s in places[:k]
    )


def _overloaded(rng: np.random.Generator, course: Course, tension: float, strain: float) -> bool:
    """The same with more than friction holds."""
    course.overloaded = True
    return _driven(rng, course, tension, strain, float(rng.choice([-1.0, 1.0])) * 1.3)


def _trimmed(rng: np.random.Generator, course: Course, tension: float, strain: float) -> bool:
    """A standing line whose exit tension changes, and which rests."""
    holds = np.array([course.least, course.most]) * _turns(course, tension)
    pull, low, high = tension, tension, tension
    for k in range(int(rng.integers(1, 4))):
        what = "trim" if k == 0 else str(rng.choice(["trim", "rest"]))
        stage = {}
        if what == "trim":
            pull *= float(rng.uniform(0.7, 1.4))
            stage["exit"] = {"tension": pull}
        _stage(course, f"{what}{k}", float(10.0 ** rng.uniform(-1.0, 1.0)), **stage)
        ends = [np.clip(t, *(pull * np.exp([-h, h]))) for t in (low, high) for h in holds]
        low, high = min(ends), max(ends)
        spread = 0.15 * abs(pull - tension)
        course.expected[f"{what}{k}"] = Expected((low - spread, high + spread), pull)
    return True


def _moved(rng: np.random.Generator, course: Course, tension: float, strain: float) -> bool:
    """A roller that is moved under a standing line: strip comes from the exit, or goes there."""
    roller = course.tables["rollers"][int(rng.integers(len(course.circles)))]
    step = rng.uniform(-0.4, 0.4, 2) * roller["radius"]
    moved = {roller["name"]: step}
    hold = course.most * max(sum(course.way(tension, at).turns) for at in ({}, moved))
    if not _apart(course, tension, moved) or strain * np.exp(hold) > STRAINED:
        return False
    duration = float(10.0 ** rng.uniform(-1.0, 1.0))
    _stage(course, "move", duration, rollers={roller["name"]: {"move": (step[0], 0.0, step[1])}})
    bound = tension * np.exp(np.array([-1.1, 1.1]) * hold)
    course.expected["move"] = Expected((bound[0], bound[1]), tension, moved=moved)
    if rng.uniform() < 0.5:
        _stage(course, "rest", duration)
        course.expected["rest"] = course.expected["move"]
    return True


def _fed(rng: np.random.Generator, course: Course, tension: float, strain: float) -> bool:
    """Strip comes in at a given speed; rollers run with it."""
    _idlers(rng, course, tension)
    if rng.uniform() < 0.5:
        for roller in course.tables["rollers"]:
            roller["drive"] = "idle"
        course.idle |= set(course.circles)
    hold = course.most * _turns(course, tension, course.idle)
    speed, ramp = _speed(rng), float(10.0 ** rng.uniform(-1.0, 0.5))
    if strain * np.exp(hold) > STRAINED:
        return False
    stages = (("start", 0.0, speed), ("run", speed, speed), ("stop", speed, 0.0))
    bound = tension * np.exp(np.array([-hold, hold])) + np.array([-1.0, 1.0]) * course.bearing
    gone = 0.0
    for name, before, then in stages:
        surfaces = {"rollers": _surfaces(course, then)} if before != then else {}
        _stage(course, name, ramp, entry={"velocity": (then, 0.0, 0.0)}, **surfaces)
        gone += 0.5 * (before + then) * ramp
        course.expected[name] = Expected(
            (bound[0], bound[1]), tension, gone, 0.01 * gone + 100.0 * strain
        )
    return True


@dataclass(frozen=True)
class Ending:
    """What became of a line."""

    kind: str  # "right", "warned", "wrong", "refused", "stopped", "late" or "raised"
    tangents: int = 0
    seconds: float = 0.0
    words: str = ""


def ending_of(course: Course, most: int | None = None, directory: Path | None = None) -> Ending:
    """Run a line, written if there is a directory, and look at the end of each of its stages."""
    begin, run, wrong = time.process_time(), None, list[str]()
    last: State | None = None

    def ending(kind: str, words: str = "") -> Ending:
        tangents = 0 if run is None else run.cost.expansions
        at = (
            ""
            if run is None or run.state is None
            else f"{run.state.plan.name}, t = {run.state.time:g}: "
        )
        return Ending(kind, tangents, time.process_time() - begin, at + words)

    try:
        with seconds_of_one_core(most):
            run = Run(Scene.model_validate(course.tables), directory)
            if course.overloaded:
                told = any("the strip runs away" in words for words in run.forewarnings())
                return ending("warned" if told else "wrong", "not warned of")
            for step in run:
                if last is not None and step.state.plan.name != last.plan.name:
                    wrong += _faults(course, last)
                last = step.state
            if run.outcome.done and last is not None:
                wrong += _faults(course, last)
    except TooLateError:
        return ending("late", "; ".join(wrong[:2]))
    except (InputError, ValueError) as error:
        return ending("refused", str(error))
    except Exception as error:
        return ending("raised", f"{type(error).__name__}: {error}")
    if not run.outcome.done:
        return ending("stopped", run.message)
    return ending("wrong" if wrong else "right", "; ".join(wrong[:6]))


def _faults(course: Course, state: State) -> list[str]:
    """What statics does not allow at the end of a stage."""
    expected = course.expected.get(state.plan.name)
    if expected is None:
        return []
    ends, width = np.array([state.tension("entry"), state.tension("exit")]), course.width
    largest = float(max(ends.max(), expected.exit, *(r.tension_in for r in state.rollers.values())))
    within, found = course.within * largest, list[str]()

    def check(right: Any, words: str) -> None:
        if not right:
            found.append(f"{state.plan.name}: {words}")

    check(np.isfinite(state.full).all(), "no numbers")
    check(abs(ends[1] - expected.exit) < within, f"exit bears {ends[1]}, not {expected.exit}")
    low, high = expected.entry
    check(low - within < ends[0] < high + within, f"entry bears {ends[0]}, not {low} to {high}")
    if expected.gone is not None:
        off = state.conveyed - expected.gone
        check(abs(off) < expected.lost + 1e-3, f"gone {state.conveyed} m, not {expected.gone}")
    way = course.way(float(np.sqrt(ends.prod())), expected.moved)
    along = np.exp(1j * np.array(way.headings))
    total = -ends[0] * along[0] + ends[1] * along[-1]
    tensions = [ends[0]]
    for k, (name, turn) in enumerate(zip(course.circles, way.turns, strict=True)):
        reading = state.rollers[name]
        force = complex(reading.resultant[0], reading.resultant[2]) / width
        total += force
        # the strip behind the roller bears what is before it and the roller's own force
        behind = -(tensions[-1] * -along[k] + force)
        left = abs(behind - abs(behind) * along[k + 1])
        check(left < within + 0.5 * within * k, f"{name} turns the strip by {left} N/m wrongly")
        tensions.append(abs(behind))
        ratio, hold = np.log(tensions[-2] / tensions[-1]), course.most * turn
        slack = 1.5 * course.within
        if name in course.idle:
            most = course.bearing / min(tensions[-2:]) + slack
            check(abs(ratio) < most, f"{name}, idle, takes {ratio}")
        elif expected.ratio is not None and course.tables["friction"].get("law") != "norton-hoff":
            check(
                abs(ratio - expected.ratio * hold) < slack + 0.02 * hold,
                f"{name}: {ratio}, not {hold}",
            )
        check(abs(ratio) < hold + slack + 0.02 * hold, f"{name} holds {ratio} of {hold}")
        pulled = abs(reading.drag) / width - abs(tensions[-2] - tensions[-1])
        check(
            abs(pulled) < within + 0.05 * abs(reading.drag) / width,
            f"{name}: drag {reading.drag / width}, {tensions[-2:]}",
        )
    check(abs(total) < within * (1.0 + 0.5 * len(course.circles)), f"{abs(total)} N/m are missing")
    return found


def main() -> None:
    """Run many lines and count how they end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    kinds: Counter[str] = Counter()
    for seed in range(given.seed, given.seed + given.count):
        course = drawn(seed)
        ending = ending_of(course, SECONDS)
        kinds[ending.kind] += 1
        words = "" if ending.kind in ("right", "warned") else ending.words[:700]
        print(
            seed, ending.kind, course.kind, len(course.circles), ending.tangents,
            f"{ending.seconds:.1f} s", words, flush=True,
        )  # fmt: skip
    right = kinds["right"] + kinds["warned"]
    print(dict(kinds), f"{100.0 * right / given.count:.1f} % right")


if __name__ == "__main__":
    main()
