"""Broken inputs by the million: what reads them gives a result or a list of mistakes.

Every input is an example of this project that was damaged as files get damaged (cut short,
lines lost or doubled, bytes flipped) or as people mistype (numbers that are none, wrong units,
values of another type, keys of another table or law)::

    python tests/hard/fuzz_reader.py --count 1000000 --seed 0
    python tests/hard/fuzz_reader.py --of checkpoint --count 100000

``--of`` is ``scene``, ``override``, ``checkpoint`` or ``mesh``.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import tempfile
import time
import tomllib
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.driver.recorder import read_checkpoint
from anmstrip.driver.run import Run, unpack
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.results.files import load_checkpoint, save_checkpoint
from anmstrip.scene.schema import parse_scene
from anmstrip.simulation.march import March
from anmstrip.simulation.problem import Assembly

TOP = Path(__file__).parents[2]
TEXTS = tuple(path.read_text(encoding="utf-8") for path in sorted(TOP.glob("examples/*.toml")))
SOURCE = TOP / "examples" / "fuzzed.toml"

SLOW = 2.0
"""Seconds that no input may take."""

NUMBERS = (
    "0", "-0.0", "1e308", "-1e308", "1e-308", "5e-324", "nan", "inf", "-inf", "1e400", "-1",
    "9" * 30, "0x7fffffffffffffff", "1_000", "0.1.2", "1e", "--1", "true", '"1.0"', "1 mm",
    "[1.0]", "[1.0, 2.0]", "[0.0, 0.0, 0.0]", "[]", "{}", "{ r1 = 1.0 }", "2024-01-01", "07:00:00",
)  # fmt: skip

VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 10**40, 0.0, -1.0, 1e308, 5e-324, float("nan"), float("inf"), "", "r1",
    "x" * 300, [], [0.0], [0.0, 0.0, 0.0], [float("nan")] * 3, ["x", "x"], {}, {"a": {}},
    {"name": "r1"}, b"x", object(),
)  # fmt: skip

JUNK = (
    "\0", "\ufeff", "é", "[", "]", '"', "'''", "=", "\r", "\n[strip]\n", "\n[[rollers]]\n", "#",
)  # fmt: skip

KEYS = (
    "strip.width", "rollers.r1.radius", "stages.turn.exit.force", "friction", "a.b", "", ".",
    "contact", "contact.onset", "contact.pressure", "contact.eta", "rollers.r1.crown",
    "rollers.r1.taper", "rollers.r1.sides", "rollers.r1.sides.flat",
)  # fmt: skip
"""Of settings."""

LINES = (
    "onset = ", "pressure = ", "stiffness = ", "eta = ", "delta = ", "crown = ", "taper = ",
    "sides = ", "sides.taper = ", "sides.flat = ", "sides.rounding = ",
)  # fmt: skip
"""Keys of contact laws and profiles, which exclude or need each other."""


@dataclass(frozen=True)
class Tally:
    """Scenes read, inputs refused, and those that did neither."""

    scenes: int
    refused: int
    crashes: tuple[tuple[int, str], ...]


def text_of(dice: random.Random) -> str:
    """A damaged example."""
    text = dice.choice(TEXTS)
    for _ in range(dice.choice((1, 1, 1, 2, 3, 8))):
        text = dice.choice(DAMAGES)(text, dice)
    return text


def _cut(text: str, dice: random.Random) -> str:
    return text[: dice.randrange(len(text) + 1)]


def _flipped(text: str, dice: random.Random) -> str:
    at = dice.randrange(len(text) + 1)
    return text[:at] + chr(dice.randrange(1, 0x250)) + text[at + dice.randrange(2) :]


def _littered(text: str, dice: random.Random) -> str:
    at = dice.randrange(len(text) + 1)
    return text[:at] + dice.choice(JUNK) + text[at:]


def _lines_moved(text: str, dice: random.Random) -> str:
    """A line lost, doubled, or put elsewhere: keys in a table that does not know them."""
    lines = text.splitlines()
    if not lines:
        return text
    line = lines.pop(dice.randrange(len(lines)))
    for _ in range(dice.randrange(3)):
        lines.insert(dice.randrange(len(lines) + 1), line)
    return "\n".join(lines)


def _mistyped(text: str, dice: random.Random) -> str:
    """Another value for a key."""
    lines = text.splitlines()
    keyed = [i for i, line in enumerate(lines) if "=" in line]
    if not keyed:
        return text
    i = dice.choice(keyed)
    lines[i] = f"{lines[i].partition('=')[0]}= {dice.choice(NUMBERS)}"
    return "\n".join(lines)


def _other_units(text: str, dice: random.Random) -> str:
    """A number times a power of a thousand."""
    lines = text.splitlines()
    numeric = [i for i, line in enumerate(lines) if _is_number(line.partition("=")[2])]
    if not numeric:
        return text
    i = dice.choice(numeric)
    key, _, value = lines[i].partition("=")
    factor = dice.choice((1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9, -1.0))
    number = float(value.partition("#")[0])
    lines[i] = f"{key}= {number * factor!r}"
    return "\n".join(lines)


def _keyed(text: str, dice: random.Random) -> str:
    """A key more at the begin of a table, its own or any other, with some value."""
    lines = text.splitlines()
    tables = [i for i, line in enumerate(lines) if line.startswith("[")]
    if not tables:
        return text
    key = dice.choice(LINES)
    head = "[contact]" if key in LINES[:5] else "[[rollers]]"
    own = [i for i in tables if lines[i] == head]
    at = dice.choice(own if own and dice.random() < 0.8 else tables)
    value = dice.choice(NUMBERS) if dice.random() < 0.5 else f"{10.0 ** dice.randrange(-6, 11)!r}"
    lines.insert(at + 1, key + value)
    return "\n".join(lines)


def _is_number(text: str) -> bool:
    try:
        float(text.partition("#")[0])
    except ValueError:
        return False
    return True


DAMAGES: tuple[Callable[[str, random.Random], str], ...] = (
    _cut, _flipped, _littered, _lines_moved, _mistyped, _mistyped, _other_units, _other_units,
    _keyed,
)  # fmt: skip


def tables_of(dice: random.Random) -> dict[str, Any]:
    """Tables of an example with values of any type in some places."""
    tables = tomllib.loads(dice.choice(TEXTS))
    for _ in range(dice.choice((1, 1, 2, 4))):
        _spoil(tables, dice)
    return tables


def _spoil(tables: dict[str, Any], dice: random.Random) -> None:
    inside: Any = tables
    while True:
        keys = list(inside) if isinstance(inside, dict) else list(range(len(inside)))
        key = dice.choice(keys)
        deeper = isinstance(inside[key], dict | list) and len(inside[key]) > 0
        if not deeper or dice.random() < 0.2:
            break
        inside = inside[key]
    inside[key] = deepcopy(dice.choice(VALUES))  # which later damage must not reach


def setting_of(dice: random.Random) -> str:
    """A ``--set`` that may be wrong in key and value."""
    key = _flipped(dice.choice(KEYS), dice) if dice.random() < 0.3 else dice.choice(KEYS)
    return f"{key}{dice.choice(('=', '=', '==', ''))}{dice.choice(NUMBERS)}"


RUN = """
[strip]
length = 4.0
width = 1.0
thickness = 1.0e-3
cells = [4, 1]
kinematics = "section"
[material]
young = 2.0e11
poisson = 0.3
[contact]
[[rollers]]
radius = 0.5
centre = [0.0, 0.0, -0.51]
[edges.entry]
fixed = ["x", "z"]
[edges.exit]
fixed = ["z"]
[[stages]]
name = "pull"
duration = 1.0
exit.force = [1.0e4, 0.0, 0.0]
[[stages]]
name = "lift"
duration = 1.0
exit.move = [0.0, 0.0, 0.1]
"""
"""A scene whose checkpoints are damaged."""


@cache
def checkpoints() -> tuple[Scene, tuple[bytes, ...]]:
    """A scene, and the checkpoints after each of its steps."""
    scene, found = Scene.from_tables(parse_scene(RUN, "run.toml"), SOURCE), []
    with tempfile.TemporaryDirectory() as directory:
        run = scene.run(directory)
        for _ in run:
            run._checkpoint(force=True)
            found.append((Path(directory) / "checkpoint.npz").read_bytes())
    return scene, tuple(found)


def read_checkpoint_of(seed: int) -> object:
    """Damage a checkpoint, by bytes or by values, and read it."""
    dice, (scene, contents) = random.Random(seed), checkpoints()
    path = scratch() / "checkpoint.npz"
    content = bytearray(dice.choice(contents))
    path.write_bytes(content)
    if dice.random() < 0.2:
        at = dice.randrange(len(content))
        content[at] = dice.randrange(256)
        path.write_bytes(content[: dice.choice((at, len(content)))])
    else:
        arrays, facts = load_checkpoint(path)
        for _ in range(dice.choice((1, 1, 2, 4))):
            if dice.random() < 0.6:
                del facts["input"]["title"]  # so that what is spoilt may be the scene as well
                _spoil(facts, dice)
                facts.setdefault("input", {})
            else:
                name = dice.choice([n for n, x in arrays.items() if x.dtype == float])
                arrays[name] = dice.choice(ARRAYS)(arrays[name])
            if not isinstance(facts["input"], dict):
                break
            facts["input"].setdefault("title", "")
        plain = {key: value for key, value in facts.items() if not isinstance(value, bytes)}
        with suppress(TypeError):  # what no file can hold
            save_checkpoint(path, arrays, plain)
    return refused_or(lambda: taken_up(scene, path))


@cache
def assembly() -> Assembly:
    """The mechanics of the scene of the checkpoints, made once."""
    return Assembly(checkpoints()[0])


def taken_up(scene: Scene, path: Path) -> Run:
    """Return a run that has taken up a checkpoint, with the stage that comes next prepared."""
    run = Run(scene)
    run.assembly = assembly()
    run.march = March(run.assembly)
    unpack(run, *read_checkpoint(path, run.march))
    run.march.planned(scene.course[run.first_stage], None)
    return run


ARRAYS: tuple[Callable[[Any], Any], ...] = (
    lambda x: x.ravel()[:-1], lambda x: x[None], lambda x: x * np.nan, lambda x: -x,
    lambda x: np.full_like(x, np.inf), lambda x: np.ones_like(x, int), lambda x: np.float64(1.0),
    lambda x: np.zeros((0, 3)), lambda x: x.astype("U4"), lambda x: x.astype(complex),
    lambda x: x.astype(np.float32),
)  # fmt: skip
"""What happens to an array."""


@cache
def scratch() -> Path:
    """A directory for files that are read once."""
    return Path(tempfile.mkdtemp())


MESHES = tuple(path.read_text(encoding="utf-8") for path in sorted(TOP.glob("meshes/*.msh")))


def read_mesh_of(seed: int) -> object:
    """Damage a mesh file and make a strip of it."""
    dice = random.Random(seed)
    text = dice.choice(MESHES)
    for _ in range(dice.choice((1, 1, 2, 4))):
        text = dice.choice((_cut, _flipped, _littered, _lines_moved, _number_changed))(text, dice)
    path = scratch() / f"strip.{dice.choice(('msh', 'msh', 'msh', 'vtk', 'inp'))}"
    path.write_text(text, encoding="utf-8")
    tables = tomllib.loads(RUN.replace("length = 4.0\nwidth = 1.0", f'mesh = "{path}"'))
    del tables["strip"]["cells"]
    tables["strip"]["kinematics"] = "shell"
    return refused_or(lambda: Assembly(Scene.from_tables(tables, SOURCE)).strip)


def _number_changed(text: str, dice: random.Random) -> str:
    """Another number in some line: a node elsewhere, or a cell of other nodes."""
    lines = text.splitlines() or [""]
    i = dice.randrange(len(lines))
    words = lines[i].split()
    if words:
        words[dice.randrange(len(words))] = dice.choice((*NUMBERS[:14], "1", "7", "1e9"))
        lines[i] = " ".join(words)
    return "\n".join(lines)


def read_override_of(seed: int) -> object:
    """Type a wrong setting, and set it in an example."""
    dice = random.Random(seed)
    setting = setting_of(dice)
    for _ in range(dice.randrange(3)):
        setting = dice.choice((_cut, _flipped, _littered))(setting, dice)
    tables = tomllib.loads(TEXTS[seed % len(TEXTS)])
    return refused_or(lambda: Scene.from_tables(tables, SOURCE, [setting]))


def refused_or(read: Callable[[], object]) -> object:
    """Return what was read, or the refusal, which must have words that steer no terminal."""
    try:
        return read()
    except InputError as error:
        assert all(c.isprintable() or c == "\n" for c in str(error))
        assert error.mistakes
        return error


def read_one(seed: int) -> Scene | InputError:
    """Make an input and read it; whatever else is raised is a fault of the reader."""
    dice = random.Random(seed)
    settings = [setting_of(dice)] if dice.random() < 0.1 else []
    try:
        if dice.random() < 0.25:
            return Scene.from_tables(tables_of(dice), SOURCE, settings)
        return Scene.from_tables(parse_scene(text_of(dice), str(SOURCE)), SOURCE, settings)
    except InputError as error:
        assert str(error)
        assert error.mistakes
        return error


READERS: dict[str, Callable[[int], object]] = {
    "scene": read_one,
    "override": read_override_of,
    "checkpoint": read_checkpoint_of,
    "mesh": read_mesh_of,
}


def fuzzed(seeds: range, of: str = "scene", slow: float = math.inf) -> Tally:
    """Read one input for every seed, each in less than so many seconds."""
    read = READERS[of]
    scenes, crashes = 0, []
    for seed in seeds:
        begin = time.process_time()
        try:
            scenes += not isinstance(read(seed), InputError)
        except Exception as error:
            crashes.append((seed, f"{type(error).__name__}: {error}"))
        if (seconds := time.process_time() - begin) > slow:
            crashes.append((seed, f"took {seconds:.1f} s"))
    return Tally(scenes, len(seeds) - scenes - len(crashes), tuple(crashes))


def parts(seeds: range, size: int = 1_000) -> Iterator[range]:
    """A long range in parts, to be told of on the way."""
    for first in range(seeds.start, seeds.stop, size):
        yield range(first, min(first + size, seeds.stop))


def main() -> int:
    """Read ``--count`` inputs and tell what became of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--of", choices=READERS, default="scene")
    given = parser.parse_args()
    warnings.simplefilter("error")
    scenes = refused = crashed = 0
    for part in parts(range(given.seed, given.seed + given.count)):
        tally = fuzzed(part, given.of, SLOW)
        scenes, refused = scenes + tally.scenes, refused + tally.refused
        crashed += len(tally.crashes)
        for seed, words in tally.crashes:
            print(f"seed {seed}: {words}", flush=True)
        print(f"{part.stop}: {scenes} read, {refused} refused, {crashed} crashes", flush=True)
    return 1 if crashed else 0


if __name__ == "__main__":
    sys.exit(main())
