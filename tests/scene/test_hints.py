"""What the reader tells to type, typed: the mistake is gone."""

from __future__ import annotations

import re
import tomllib
from typing import Any

import pytest
from test_rules import GOOD, PLATE, THREADED, WRONG, WRONG_PLATE, WRONG_SECTION, WRONG_THREADED

from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError, Mistake
from anmstrip.simulation.problem import Assembly

SECTION = THREADED.replace("refined = 0.025", 'refined = 0.025\nkinematics = "section"')
TEXTS = [
    text.replace(old, new, 1)
    for text, wrong in (
        (GOOD, WRONG),
        (THREADED, WRONG_THREADED),
        (SECTION, WRONG_SECTION),
        (PLATE, WRONG_PLATE),
    )
    for old, new, _, _ in wrong
]
IN_STRIP = ("kinematics", "bending", "feed")
CHOSEN = {"strip.mesh": "either mesh or cells; take one out"}
"""What is typed where the file of a mesh is missing."""


def mistakes_in(tables: dict[str, Any]) -> list[Mistake]:
    try:
        Assembly(Scene.from_tables(tables, "line.toml")).strip  # noqa: B018
    except InputError as error:
        return list(error.mistakes)
    return []


def inner(tables: Any, path: list[str]) -> Any:
    """A table inside of others, made if it is not there; entries of a list go by their names."""
    for part in path:
        if isinstance(tables, list):
            tables = next(table for table in tables if table["name"] == part)
        else:
            tables = tables.setdefault(part, {})
    return tables


def typed(tables: dict[str, Any], mistake: Mistake) -> None:
    """Type the hint of a mistake into a scene, the first of several that are to be had."""
    *path, last = mistake.key.split(".")
    hint = CHOSEN.get(mistake.key, mistake.hint).replace("[…]", "[0.0, 0.0, 1.0]")
    if near := re.match(r"(?:one of: )?(\w+)(?: \(the nearest|,|$)", hint):
        table = inner(tables, path)
        table[near[1]] = table.pop(last)
    elif hint.startswith(("take it out", "no ", "one of them", "one; ")):
        del inner(tables, path)[last]
    elif given := re.match(r"either (\w+) or", hint):
        del inner(tables, path)[given[1]]
    elif hint.startswith("wrap"):
        inner(tables, ["rollers"])[0]["wrap"] = "over"
    else:
        release = re.search(r"\w+\.release = true", hint)
        words = release[0] if release else re.split(r", or (?=[a-z])|, for |; ", hint)[0]
        if mistake.expected == "a known key":
            del inner(tables, path)[last]
        for key, value in tomllib.loads(words).items():
            place = [] if words.startswith("[") else path
            if key in path:  # in place of what is there
                inner(tables, path).pop(last) if "force" in value else None
                place = path[: path.index(key)]
            elif key in IN_STRIP:
                place = ["strip"]
            table = inner(tables, [*place, key] if isinstance(value, dict) else place)
            table.update(value if isinstance(value, dict) else {key: value})


@pytest.mark.parametrize("text", TEXTS)
def test_what_the_reader_tells_to_type_takes_the_mistake_away(text: str) -> None:
    try:
        tables = tomllib.loads(text)
    except ValueError:
        pytest.skip("a number of five thousand digits")
    for mistake in mistakes_in(tables):
        changed = tomllib.loads(text)
        typed(changed, mistake)
        assert mistake.key not in {m.key for m in mistakes_in(changed)}, mistake.hint


@pytest.mark.parametrize(("key", "text", "hint"), [
    ("threading.tension", "100 N", "tension = 100.0, if that is in N/m"),
    ("threading.tension", "0,1 kN/m", "tension = 100.0"),
    ("threading.tension", "1,000 N/m", "tension = 1.0e4"),
    ("friction.coefficient", "15 %", "coefficient = 0.15"),
    ("strip.thickness", "12e-6", "thickness = 1.2e-05"),
    ("stages.turn.rollers.r1.angular_speed", "60 rpm", "angular_speed = 6.28318530718"),
    ("material.density", "7,85 g/cm3", "density = 7850.0"),
    ("rollers.r1.radius", "12 in", "radius = 0.3048"),
    ("strip.thickness", "700 micron", "thickness = 0.0007"),
    ("stages.turn.rollers.r1.surface_speed", "300 mpm", "surface_speed = 5.0"),
    ("stages.turn.rollers.r1.surface_speed", "300 ft/min", "surface_speed = 1.524"),
    ("threading.tension", "30 MPa", "tension = 3e+07 t, with the thickness t (m) of the strip"),
    ("rollers.r1.wrap", "clockwise", 'wrap = "over"'),
    ("rollers.r1.wrap", "down", 'wrap = "under"'),
    ("rollers.r1.drive", "driven", 'drive = "speed"'),
    ("strip.thickness_mm", 0.7, "thickness = 0.0007"),
    ("rollers.r1.diameter", "610 mm", "radius = 0.305"),
    ("rollers.r1.brake", 60.0, "bearing = 60"),
    ("rollers.r1.position", [0.0, 0.0, -0.5], "centre = [0.0, 0.0, -0.5]"),
    ("material.E", "206 GPa", "young = 2.06e+11"),
    ("stages.turn.end_time", 10.0, "duration = 10"),
    ("stages.turn.duration", "1 h", "duration = 3600.0"),
    ("stages.turn.friction", 0.2,
     "friction = true, with coefficient = 0.2 in [friction], for the whole run"),
    ("stages.turn.rollers.r1", 5.0, "rollers = { r1.surface_speed = 5 }"),
    ("stages.turn.rollers.r1.centre", [0.0, 0.0, -0.6],
     "move = [0.0, 0.0, 0.1], from where the roller is drawn"),
    ("stages.turn.steps", 100, "nothing: errors choose the steps; solver.time_step fixes those"),
])  # fmt: skip
def test_a_value_as_others_type_it_is_answered_by_that_value(key, text, hint) -> None:
    """An example, of 10 kN/m, was told to be typed for 100 N, and idle for driven."""
    tables = tomllib.loads(THREADED)
    *path, last = key.split(".")
    inner(tables, path)[last] = text
    assert hint in [mistake.hint for mistake in mistakes_in(tables)]


@pytest.mark.parametrize(("line", "better"), [
    ("thickness = 0,7e-3", "thickness = 0.7e-3"),
    ("thickness = .7e-3", "thickness = 0.7e-3"),
    ("thickness = 1.", "thickness = 1.0"),
    ("thickness: 1.0e-3", "thickness = 1.0e-3"),
    ("thickness = 1.0e-3;", "thickness = 1.0e-3"),
    ("thickness = 0.7 mm", 'thickness = "0.7 mm"'),
    ("kinematics = section", 'kinematics = "section"'),
])  # fmt: skip
def test_a_line_that_is_no_toml_is_told_as_one_that_is(line: str, better: str, tmp_path) -> None:
    """It was told to be "valid TOML", whatever was wrong with it, but for a decimal comma."""
    path = tmp_path / "line.toml"
    path.write_text(THREADED.replace("thickness = 1.0e-3", line))
    with pytest.raises(InputError) as found:
        Scene.load(path)
    assert [mistake.hint for mistake in found.value.mistakes] == [better]
