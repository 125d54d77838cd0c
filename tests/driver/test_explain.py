"""What is said of a scene before it runs: effects, rollers, and the ladder of kinematics."""

from __future__ import annotations

import re
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import Level, justified_level, levels, warnings
from anmstrip.driver.explain import explain, plain_table, stage_table, text_of
from anmstrip.driver.scene import Scene
from anmstrip.simulation.problem import Assembly

EXAMPLES = Path(__file__).parents[2] / "examples"


def pressed(degrees: float, **roller: Any) -> dict[str, Any]:
    """A strip under tension, with a roller pushed up so far that it is wrapped by an angle."""
    lifted = 2.0 * np.tan(np.radians(degrees) / 2.0) + 1e-3
    return {
        "strip": {"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [16, 2],
                  "refined": 0.1},
        "material": {"young": 2e11, "poisson": 0.3, "density": 7850.0},
        "contact": {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3},
        "rollers": [{"name": "r1", "radius": 0.5, "centre": [0.0, 0.0, -0.501], **roller}],
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
        "stages": [
            {"name": "tension", "duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}},
            {"name": "press", "duration": 1.0, "rollers": {"r1": {"move": [0.0, 0.0, lifted]}}},
        ],
    }  # fmt: skip


def bridle(**strip: Any) -> dict[str, Any]:
    """Three rollers, threaded over, under and over."""
    lines = {"a": (-0.6, 0.5, "over"), "b": (0.6, -0.7, "under"), "c": (1.8, 0.5, "over")}
    return {
        "strip": {"width": 1.0, "thickness": 1e-3, "cells": [30, 2], "refined": 0.1, **strip},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3},
        "threading": {"tension": 1e4, "entry": [-3.0, 0.0, 1.0], "exit": [3.0, 0.0, 1.0]},
        "rollers": [
            {"name": name, "radius": 0.5, "centre": [x, 0.0, z], "wrap": side}
            for name, (x, z, side) in lines.items()
        ],
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [{"duration": 1.0, "rollers": {"a": {"surface_speed": 1.0}}}],
    }


@pytest.mark.parametrize(("elements", "told"), [(0.1, False), (0.01, True)])
def test_estimates_of_errors_that_take_long_are_told(elements: float, told: bool) -> None:
    """On a finer mesh, in seconds; on a coarse one nothing is said."""
    said = explain(Scene.from_tables(bridle(kinematics="shell", refined=elements), "line.toml"))
    words = r"To estimate the errors by the\s+mesh, on elements of half the length,\s+takes"
    assert bool(re.search(words, said)) == told


def levels_of(scene: Scene) -> dict[str, Level]:
    found = levels(Preview.of(Assembly(scene)))
    return {level.kinematics.name: level for level in found}


def justified(found: dict[str, Level]) -> str:
    return justified_level(list(found.values())).kinematics.name


def judged(tables: dict[str, Any]) -> tuple[str, dict[str, Level]]:
    found = levels_of(Scene.model_validate(tables))
    return justified(found), found


def test_what_moves_is_told_by_the_keys_that_were_typed() -> None:
    """Also of tensions that act as forces, of strip that passes a held end, and of places."""
    line = bridle(kinematics="section")
    line["friction"] = {"coefficient": 0.2}
    line["stages"] = [
        {"name": "draw", "duration": 0.1, "entry": {"speed": 1.0}, "exit": {"tension": 2e4}},
        {"name": "turn", "duration": 0.1, "rollers": {"b": {"angular_speed": -2.0}}},
        {"name": "pull", "duration": 0.1, "entry": {"release": True, "tension": 2e4},
         "rollers": {"c": {"move": [0.0, 0.0, 0.01]}}},
    ]  # fmt: skip
    flat = pressed(30.0)
    flat["stages"].append({"name": "swing", "duration": 1.0, "exit": {"move": [0.0, 0.0, 0.1]}})
    flat["stages"][0]["exit"] = {"tension": 1e4}
    expected = {
        "draw": ["exit.tension", "entry.speed"],
        "turn": ["entry.speed, as before", "rollers.b.angular_speed"],
        "pull": ["entry.tension", "rollers.c.move", "rollers.b.angular_speed, as before"],
        "tension": ["exit.tension"],
        "press": ["rollers.r1.move"],
        "swing": ["exit.move"],
    }
    for tables in (line, flat):
        table = stage_table(Preview.of(Assembly(Scene.model_validate(tables))))
        rows = zip(*(column.cells for column in table.columns), strict=True)
        found = {name: what.split("\n") for name, *_, what in rows}
        for name in found.keys() & expected.keys():
            assert sorted(found[name]) == sorted(expected[name]), name


def test_a_plate_without_tension_lies_flat_on_its_rollers() -> None:
    """Where nothing pulls, an end goes on as it is laid; a roller beyond it is not touched."""
    places = (-3.5, -2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5, 4.5)
    tables = {
        "strip": {"kinematics": "section", "length": 8.0, "width": 2.5, "thickness": 0.02},
        "material": {"young": 2.1e11, "poisson": 0.3, "density": 7850.0},
        "contact": {},
        "rollers": [
            {"name": f"t{k}", "radius": 0.15, "centre": [x, 0.0, -0.15]}
            for k, x in enumerate(places)
        ],
        "edges": {"entry": {"fixed": ["x"]}},
        "stages": [{"name": "settle", "duration": 1.0, "gravity": [0.0, 0.0, -9.81]}],
    }
    scene = Scene.model_validate(tables)
    text, preview = explain(scene), Preview.of(Assembly(scene))
    rows = [line for line in text.splitlines() if re.match(r"t\d ", line)]
    assert [row.rsplit("m, ", 1)[1] for row in rows] == ["0°, over"] * 8 + ["not touched"]
    assert "to the left" not in text
    # q L³/6D of the 2 m beyond the last roller, which is the longest span
    stiffness = 2.1e11 * 0.02**3 / 12.0 / 0.91
    sag = 7850.0 * 9.81 * 0.02 * 2.0**3 / 6.0 / stiffness
    assert preview.steepest.slope == pytest.approx(np.arctan(sag), rel=1e-6)


def test_a_line_whose_tension_is_gone_keeps_the_direction_of_its_end() -> None:
    tables = bridle()
    tables["threading"]["exit"] = [3.0, 0.0, -1.0]
    tables["stages"].append({"duration": 1.0, "exit": {"force": [0.0, 0.0, 0.0]}})
    wraps = [string.turns for string in Preview.of(Assembly(Scene.model_validate(tables))).strings]
    assert wraps[-1] == pytest.approx(wraps[0], abs=1e-9)


def test_numbers_of_wide_tables_are_not_folded() -> None:
    """The slip of a shell of a wide line was 5.84e-0 in one row and 8 in the next."""
    heads = [f"head {i}\n(m)" for i in range(11)]
    for number, space in (("123.456", 2), ("1234.567", 1)):
        table = plain_table("Rollers", "\nroller", *heads[: 11 - space])
        table.add_row("r1", *[number] * (11 - space))
        row = text_of([table]).splitlines()[-1]
        assert row.split() == ["r1", *[number] * (11 - space)]
        assert number + " " * space + number in row


def test_capstan_justifies_a_section() -> None:
    scene = Scene.load(EXAMPLES / "capstan.toml")
    found = levels_of(scene)
    assert justified(found) == "section"
    assert not found["section"].against
    assert not found["shell"].against
    friction, steep = found["plate"].against
    assert "friction" in friction
    assert "wrapping r1 by 43°" in steep
    text = explain(scene)
    assert "These numbers justify: section." in text
    assert "43.01°, over" in text


def test_estimated_wrap_is_that_of_the_formula() -> None:
    """The exit leaves in the direction of its force, the entry is 0.45 m below."""
    last = Preview.of(Assembly(Scene.load(EXAMPLES / "capstan.toml"))).strings[-1]
    assert last.turns["r1"] == pytest.approx(0.7513, abs=2e-3)
    assert last.slope == pytest.approx(np.arctan2(5773.5, 1e4), rel=1e-6)


@pytest.mark.parametrize(("degrees", "plate"), [(1.0, True), (4.0, True), (12.0, False)])
def test_a_plate_needs_small_slopes(degrees: float, plate: bool) -> None:
    name, found = judged(pressed(degrees))
    assert name == "section"
    assert (not found["plate"].against) is plate
    if plate:
        assert f"{0.5 * degrees:.2g}° make" in found["plate"].lost


@pytest.mark.parametrize(
    ("roller", "words"),
    [
        ({"crown": [0.0, -2e-3]}, "crowned"),
        ({"taper": 2e-3}, "tapered"),
        ({"axis": [0.02, 1.0, 0.0]}, "not along y"),
    ],
)
def test_crown_and_misalignment_need_a_width(roller: dict[str, Any], words: str) -> None:
    name, found = judged(pressed(1.0, **roller))
    assert name == "plate"
    assert words in found["section"].against[0]
    name, _ = judged(pressed(20.0, **roller))
    assert name == "shell"


@pytest.mark.parametrize(
    ("change", "against"),
    [
        ({"gravity": [0.0, -9.81, 0.0]}, "gravity across"),
        ({"left": {"force": [0.0, 100.0, 0.0]}}, "left, a side"),
        ({"exit": {"force": [1e4, 50.0, 0.0]}}, "pulls or moves exit across"),
    ],
)
def test_what_varies_across_needs_a_width(change: dict[str, Any], against: str) -> None:
    tables = pressed(1.0)
    tables["stages"][1] |= change
    name, found = judged(tables)
    assert name != "section"
    assert any(against in reason for reason in found["section"].against)


@pytest.mark.parametrize(
    ("change", "against"),
    [
        ({"entry": {"move": [0.1, 0.0, 0.0]}}, "moves entry in the plane"),
        ({"exit": {"tension": 1e4}}, "exit.tension"),
        ({"pressure": 1e3}, "slopes reach"),
        ({"exit": {"moment": 1.0}}, "stage press bends exit"),
    ],
)
def test_what_a_plate_does_not_see(change: dict[str, Any], against: str) -> None:
    """A pressure of 1 kPa on 4 m of strip under 10 kN/m: slope p L / 2 T = 0.2."""
    tables = pressed(1.0)
    tables["stages"][1] |= change
    _, found = judged(tables)
    assert any(against in reason for reason in found["plate"].against)


@pytest.mark.parametrize(("mesh", "uneven"), [("strip_hole", True), ("strip_triangles", False)])
def test_a_plate_does_not_see_where_tension_varies(mesh: str, uneven: bool) -> None:
    tables = pressed(1.0)
    tables["strip"] = {"thickness": 1e-3, "mesh": str(EXAMPLES.parent / f"meshes/{mesh}.msh")}
    _, found = judged(tables)
    assert any("no rectangle" in reason for reason in found["plate"].against) is uneven


def test_a_plate_does_not_see_what_stretches_between_held_ends() -> None:
    """E t s³/3 carries p L: 0.038 for the slope, by its own stiffness it were 89°."""
    held = {"fixed": ["x", "z"], "centred": True}
    tables = {
        "strip": {"length": 1.0, "width": 0.5, "thickness": 0.5e-3},
        "material": {"young": 2e11, "poisson": 0.3},
        "edges": {"entry": held, "exit": held},
        "stages": [{"name": "press", "pressure": -2e3}],
    }
    preview = Preview.of(Assembly(Scene.model_validate(tables)))
    run = Scene.model_validate(tables).run()
    *_, last = run
    assert preview.steepest.slope == pytest.approx(np.arctan((3 * 2e3 / 1e8) ** (1 / 3)), rel=1e-6)
    assert last.state.tension("exit") == pytest.approx(1e8 * preview.steepest.slope**2 / 6, rel=0.1)
    _, found = judged(tables)
    (against,) = found["plate"].against
    assert against.startswith("as it sags between held ends, 2.55e+04 N/m")


@pytest.mark.parametrize(
    ("held", "clamped", "span", "share"),
    [
        (("entry", "exit"), (), 1.2, 24.0),
        (("entry", "exit"), ("exit",), 1.2, 48.0),
        (("entry", "exit", "left", "right"), (), 0.8, 24.0),
        (("left", "right"), ("left", "right"), 0.8, 72.0 * 3.0**0.5),
    ],
)
def test_a_plate_held_on_its_edges_is_no_cantilever(
    held: tuple[str, ...], clamped: tuple[str, ...], span: float, share: float
) -> None:
    """Slopes q L³/n D of a beam: of a pane 41° were told, where they reach 0.6°."""
    tables = {
        "strip": {"kinematics": "plate", "length": 1.2, "width": 0.8, "thickness": 8e-3},
        "material": {"young": 7e10, "poisson": 0.3},
        "edges": {name: {"fixed": ["z"], "clamped": name in clamped} for name in held},
        "stages": [{"name": "wind", "pressure": 500.0}],
    }
    preview = Preview.of(Assembly(Scene.model_validate(tables)))
    slope = 500.0 * span**3 / (share * 7e10 * 8e-3**3 / 12.0 / 0.91)
    assert preview.steepest.slope == pytest.approx(np.arctan(slope), rel=1e-6)
    assert not judged(tables)[1]["plate"].against


def test_a_plate_does_not_see_that_a_dish_stretches() -> None:
    """Held in z alone a shell sinks by 1.8 t in the mean across, a plate by 4.1 t."""
    held, free = {"fixed": ["x", "y", "z"]}, ("exit", "left", "right")
    tables = {
        "strip": {"length": 1.0, "width": 1.0, "thickness": 1e-3},
        "material": {"young": 7e10, "poisson": 0.3},
        "edges": {"entry": held, **{name: {"fixed": ["z"]} for name in free}},
        "stages": [{"name": "wind", "pressure": 10.0}],
    }
    _, found = judged(tables)
    assert [words[:29] for words in found["plate"].against] == ["as it sags between held edges"]


def test_threaded_bridle_shows_its_wraps() -> None:
    scene = Scene.model_validate(bridle())
    thread = Assembly(scene).thread
    assert thread is not None
    lines = {line.split()[0]: line for line in explain(scene).splitlines() if line}
    for name, side in (("a", "over"), ("b", "under"), ("c", "over")):
        assert lines[name].endswith(f"{np.degrees(thread.turns[name]):.4g}°, {side}")
    name, found = judged(bridle())
    assert name == "section"
    assert any("[threading]" in reason for reason in found["plate"].against)
    ends = {end: {"fixed": ["x", "z"]} for end in ("entry", "exit")}
    held = bridle() | {"edges": ends}
    _, found = judged(held)  # its slopes are those of the path, and no sag pulls it
    assert not any("sags" in reason for reason in found["plate"].against)


def test_distances_to_rollers_take_no_more_places_where_one_is_small() -> None:
    """They stood a twentieth of its radius apart along 22 m of strip, for 0.3 µm in 11 GB."""
    tables = bridle(kinematics="section")
    tables["rollers"].append({"name": "d", "radius": 1e-4, "centre": [0.0, 0.0, -3.0]})
    assembly = Assembly(Scene.model_validate(tables))
    tracemalloc.start()
    gaps = Preview.of(assembly).strings[-1].gaps
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2e7
    assert all(abs(gaps[name]) < 0.5 / 3200.0 for name in "abc")
    assert gaps["d"] == pytest.approx(np.hypot(0.6, 2.3) - 0.5 - 1e-4, abs=0.2)


def test_mesh_warning_of_a_threaded_strip_is_about_its_arcs() -> None:
    """Only the elements that lie on a roller count, wherever the roller is in space."""

    def told_of(**strip: Any) -> list[str]:
        assembly = Assembly(Scene.model_validate(bridle(kinematics="section", **strip)))
        return [line for line in warnings(Preview.of(assembly)) if "elements over" in line]

    assert not told_of(refined=0.005)
    told = told_of()
    assert [line.partition(" are ")[0] for line in told] == [
        "elements over a, c",
        "elements over b",
    ]


@pytest.mark.parametrize("own", ["shell", "section", "plate"])
def test_unknowns_of_the_levels_are_those_of_their_strips(own: str) -> None:
    def at(level: str) -> Scene:
        tables = pressed(1.0)
        tables["edges"]["entry"]["centred"] = False
        tables["strip"]["kinematics"] = level
        return Scene.model_validate(tables)

    found = levels_of(at(own))
    assert found[own].cost == 1.0
    for name, level in found.items():
        assert level.size is not None
        assert level.size.unknowns == Assembly(at(name)).strip.unknowns
    costs = {name: level.cost or np.inf for name, level in found.items()}
    assert costs["section"] < costs["plate"] < costs["shell"]


def test_a_level_that_misses_something_is_warned_of() -> None:
    """What no rule can refuse: a plate whose slopes are large."""
    tables = pressed(1.0)
    tables["strip"]["kinematics"] = "plate"
    assert "does not see" not in explain(Scene.model_validate(tables))
    tables = {**pressed(20.0), "strip": tables["strip"]}
    text = explain(Scene.model_validate(tables))
    assert "Warning: kinematics plate does not see that slopes reach" in text
    assert "These numbers justify: section." in text


def test_effects_that_are_off_are_named() -> None:
    tables = pressed(1.0)
    text = explain(Scene.model_validate(tables))
    for words in ("friction (no table", "weight (no", "pressure (no", "tension that turns"):
        assert f"Left out: {words}" in text
    assert "Left out: bending" not in text
    tables["strip"]["bending"] = False
    tables["stages"][1] |= {"pressure": 10.0, "gravity": [0.0, 0.0, -9.81]}
    text = explain(Scene.model_validate(tables))
    assert "Left out: bending" in text
    assert "Left out: pressure" not in text
    assert "Left out: weight" not in text


def test_fed_strip_says_so() -> None:
    tables = bridle(kinematics="section")
    assert "fed" not in explain(Scene.model_validate(tables))
    tables["strip"]["feed"] = True
    assert "fed: fresh strip follows" in explain(Scene.model_validate(tables))
    del tables["strip"]["feed"]
    led = ["edges.exit.fixed=['x', 'z']", "friction.coefficient=0.3"]
    led += [f"stages.stage1.{name}.speed=0.5" for name in ("entry", "exit")]
    text = explain(Scene.from_tables(tables, "led", led))
    assert "its ends move, and no fresh strip follows" in " ".join(text.split())


def test_mesh_file_has_no_section() -> None:
    found = levels_of(Scene.load(EXAMPLES / "capstan_mesh.toml"))
    assert found["section"].size is None
    assert justified(found) == "shell"


def test_what_keeps_a_shell_on_its_rollers_is_said() -> None:
    tables = bridle(kinematics="shell")
    tables["edges"] = {"entry": {"fixed": ["x", "z"]}}
    assert "Nothing else holds the strip in y" in explain(Scene.model_validate(tables))
    tables["rollers"][1]["crown"] = [0.0, -1e-3]
    told = " ".join(explain(Scene.model_validate(tables)).split())
    assert "No edge is held in y: friction and the shape of b alone keep the strip" in told
