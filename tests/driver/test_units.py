"""Values in other units than those of their keys, and what is told of the values beside them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_advice import typed

from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import warnings
from anmstrip.driver.scene import Scene
from anmstrip.errors import InputError
from anmstrip.fem.strip import grid
from anmstrip.simulation.problem import Assembly

BRIDLE = """
strip = { kinematics = "section", width = 1.2, thickness = 0.8e-3 }
material = { young = 2.1e11, poisson = 0.3 }
friction = { coefficient = 0.2 }
threading = { tension = 1.0e4, entry = [-2.0, 0.0, 0.0], exit = [3.0, 0.0, 0.0] }
edges.entry.fixed = ["x", "z"]
[[rollers]]
radius = 0.3
centre = [0.0, 0.0, -0.3]
wrap = "over"
[[rollers]]
radius = 0.3
centre = [1.0, 0.0, -1.0]
wrap = "under"
[[stages]]
name = "run"
steady = true
entry.tension = 9.0e3
rollers.r1.surface_speed = 2.0
rollers.r2.surface_speed = 2.0
"""

IN_MILLIMETRES = [
    "strip.width=1200.0", "strip.thickness=0.8", "material.young=2.1e5",
    "threading={ tension = 10.0, entry = [-2000.0, 0.0, 0.0], exit = [3000.0, 0.0, 0.0] }",
    "rollers.r1.radius=300.0", "rollers.r1.centre=[0.0, 0.0, -300.0]",
    "rollers.r2.radius=300.0", "rollers.r2.centre=[1000.0, 0.0, -1000.0]",
    "stages.run.entry.tension=9.0", "stages.run.rollers.r1.surface_speed=2000.0",
    "stages.run.rollers.r2.surface_speed=2000.0",
]  # fmt: skip


def scene_of(*settings: str) -> Scene:
    return Scene.from_tables(tomllib.loads(BRIDLE), "line.toml", settings)


def told(*settings: str) -> list[str]:
    """All warnings before the bridle runs with some settings."""
    return warnings(Preview.of(Assembly(scene_of(*settings))))


def begins(found: list[str], *words: str) -> bool:
    """Whether these are the warnings, by their beginnings, and there are no others."""
    return len(found) == len(words) and all(map(str.startswith, found, words))


CURLED = "if so, kinematics section does not see that free edges curl up off r"

MISTYPED: list[tuple[list[str], list[str]]] = [
    (
        ["strip.thickness=0.8", "strip.width=1200"],
        ["strip.thickness = 0.8 is in m, in", "strip.width = 1200 is in m, in"],
    ),
    (["material.yield_stress=400"], ["material.yield_stress = 400 is in Pa, in"]),
    (  # as it would be in megapascals
        ["material.yield_stress=300"],
        ["material.yield_stress = 300 is in Pa", "if so, bending over r1, r2 gives 308 MPa at "
         "the surface, above the yield stress 300 MPa"],
    ),
    (  # a tension that fits the modulus that was meant
        ["material.young=2.1e5", "threading.tension=5.0", "stages.run.entry.tension=5.0"],
        ["material.young = 210000 is in Pa", "threading.tension = 5 is in N/m, and 2 m",
         "stages.run.entry.tension = 5 is", CURLED],
    ),
    (
        ["threading.tension=0.5", "stages.run.entry.tension=0.5"],  # alone it would be slack strip
        ["threading.tension = 0.5 is in N/m", "stages.run.entry.tension = 0.5 is in N/m", CURLED],
    ),
    (
        ["stages.run.exit.tension=90.0", "stages.run.entry.tension=90.0"],
        ["stages.run.entry.tension = 90 is in N/m, and 2 m of the strip weigh 127 N/m; was it "
         "meant in MPa?", "stages.run.exit.tension = 90"],
    ),
    (["stages.run.rollers.r1.surface_speed=120", "stages.run.rollers.r2.surface_speed=120"],
     ["stages.run.rollers.r1.surface_speed = 120 is in m/s", "stages.run.rollers.r2.surface"]),
    (["material.density=7850.0", "stages.run.gravity=[0, 0, -9810]"],
     ["stages.run.gravity = 9810 is in m/s²"]),
    (["stages.run.rollers.r2.move=[0, 0, 120]"], ["stages.run.rollers.r2.move = 120 is in m, w"]),
    (["rollers.r2.centre=[1000, 0, -1000]"], ["rollers.r2.centre = 1414.21 is in m, and 1.41e"]),
    (["friction.coefficient=20"], ["friction.coefficient = 20 is a ratio of forces"]),
    (["rollers.r2.friction=30"], ["rollers.r2.friction = 30 is a ratio of forces"]),
    (
        [*IN_MILLIMETRES, "material.density=7850.0", "stages.run.gravity=[0, 0, -9.81]"],
        ["material.density = 7850 is in t/mm³", "stages.run.gravity = 9.81 is in mm/s² here",
         "the values of this scene fit together in N, mm, MPa and s"],
    ),
    ([*IN_MILLIMETRES, "material.density=7.85"], ["material.density = 7.85 is in t/mm³", "the v"]),
]  # fmt: skip
"""Settings with mistakes, and beginnings of all that is told of them."""


@pytest.mark.parametrize(("settings", "words"), MISTYPED)
def test_values_are_judged_by_others_as_they_were_meant(
    settings: list[str], words: list[str]
) -> None:
    found = told(*settings)
    assert begins(found, *words), found
    doubts = [line for line in found if "was it meant" in line]
    better = [setting for line in doubts for setting in typed(line)]
    left = (line.removeprefix("if so, ") for line in words[len(doubts) :])
    assert begins(told(*settings, *better), *left)


@pytest.mark.parametrize(
    "settings",
    [
        ["friction.coefficient=1.2"],
        ["strip.thickness=0.5e-3", "stages.run.exit.tension=130.0", "stages.run.entry.tension=200"],
        ["material.density=2700.0", "stages.run.exit.tension=60.0", "stages.run.entry.tension=80"],
    ],
)
def test_loops_and_rough_rollers_are_not_in_doubt(settings: list[str]) -> None:
    assert not [line for line in told(*settings) if "was it meant" in line]


def end_tensions(*settings: str) -> list[float]:
    """Tensions on both sides of both rollers at the end of a run."""
    run = scene_of(*settings).run()
    for _ in run:
        pass
    assert run.outcome.done and run.state is not None, run.message
    sides: list[Any] = [(r.tension_in, r.tension_out) for r in run.state.rollers.values()]
    return [float(tension) for side in sides for tension in side]


def test_a_narrow_strip_in_millimetres_is_one_too() -> None:
    assert not [line for line in told(*IN_MILLIMETRES, "strip.width=5.0") if "meant in" in line]


def test_thick_plate_in_millimetres_that_nothing_pulls_is_one_too() -> None:
    """40 mm on a roller table: more than 20 were taken for metres, and every value was doubted."""
    tables = {
        "strip": {"kinematics": "section", "length": 1e3, "width": 2.5e3, "thickness": 40.0},
        "material": {"young": 1.5e5, "poisson": 0.3, "density": 7.8e-9},
        "rollers": [{"radius": 150.0, "centre": [x, 0.0, -150.0]} for x in (-400.0, 400.0)],
        "edges": {"entry": {"fixed": ["x"]}},
        "stages": [{"name": "settle", "gravity": [0.0, 0.0, -9810.0]}],
    }
    found = warnings(Preview.of(Assembly(Scene.from_tables(tables, "table.toml"))))
    assert begins(found, "the values of this scene fit together in N, mm, MPa and s"), found


RUBBER = ("material.poisson=0.45", "strip.thickness={}", "material.young={:g}",
          "threading.tension={:g}", "stages.run.entry.tension={:g}")  # fmt: skip


def of_rubber(thickness: float, young: float, strain: float) -> list[str]:
    """Settings of a belt under tensions of a strain."""
    pull = young * thickness * strain
    return [
        key.format(value)
        for key, value in zip(RUBBER, (0.45, thickness, young, pull, 0.9 * pull), strict=True)
    ]


@pytest.mark.parametrize("young", [2.0, 20.0, 500.0, 1e3, 4e3])
@pytest.mark.parametrize("strain", [1e-3, 0.045])
def test_rubber_and_plastics_in_other_units_are_not_asked_for_metals(
    young: float, strain: float
) -> None:
    """In N, mm and MPa, and softer than 1 GPa in kN and m."""
    lines = [s for s in IN_MILLIMETRES if not s.startswith(("stages.run.entry", "strip.thick"))]
    found = told(*lines, *of_rubber(3.0, young, strain))
    assert begins(found, "the values of this scene fit together in N, mm, MPa and s"), found
    if young < 1e3:
        found = told(*of_rubber(3e-3, 1e3 * young, strain), "material.density=1.2")
        assert begins(found, "the values of this scene fit together in kN, m, kN/m² and s"), found
        found = told(*of_rubber(3e-3, 1e3 * young, strain), "material.density=1200.0")
        assert begins(found, "material.density = 1200 is in t/m³ here", "the values"), found
        assert typed(found[0]) == ["material.density=1.2"]


WATCH_SPRING = """
strip = { kinematics = "section", width = 1.2, thickness = 0.02 }
material = { young = 2.0e5, poisson = 0.3, yield_stress = 2000.0 }
contact = {}
friction = { coefficient = 0.12 }
threading = { tension = 2.0, entry = [-10.0, 0.0, 0.0], exit = [10.0, 0.0, -6.0] }
edges.entry.fixed = ["x", "z"]
stages = [{ name = "draw", duration = 1.0, entry = { speed = 5.0 } }]
[[rollers]]
name = "pin"
radius = 2.5
centre = [0.0, 0.0, -2.5]
wrap = "over"
"""


def test_strip_as_narrow_as_a_watch_spring_is_one_as_its_tension_tells() -> None:
    """1.2 wide and 0.02 thick may be a plate in metres, but not under 2 N/m."""
    tables = tomllib.loads(WATCH_SPRING)
    for width, tension, one in ((1.2, 2.0, True), (1.2, 2e-6, False), (12.0, 2e-6, True)):
        tables["strip"]["width"], tables["threading"]["tension"] = width, tension
        scene = Scene.from_tables(tables, "spring.toml")
        found = warnings(Preview.of(Assembly(scene)))
        assert any("fit together in N, mm" in line for line in found) == one, found


def test_a_line_in_millimetres_is_the_same_and_told_once() -> None:
    found = told(*IN_MILLIMETRES)
    assert begins(found, "the values of this scene fit together in N, mm, MPa and s"), found
    assert not [line for line in told() if "fit together" in line]
    millimetres, metres = end_tensions(*IN_MILLIMETRES), end_tensions()
    assert [1e3 * tension for tension in millimetres] == pytest.approx(metres, rel=1e-6)


def test_stresses_of_a_line_in_millimetres_are_in_megapascals() -> None:
    """Bending over 2 r = 600 mm: E t/2r(1 − ν²) = 308 MPa; t/2r = 0.57 % over 70 mm."""
    (found,) = [
        line for line in told(*IN_MILLIMETRES, "material.yield_stress=150.0") if "r1" in line
    ]
    assert "over r1, r2 gives 308 MPa at the surface, above the yield stress 150 MPa" in found
    assert typed(found) == ["material.plasticity={}"]  # 620 mm of both overlap
    small = told(*IN_MILLIMETRES, "rollers.r1.radius=70", "rollers.r1.centre=[0, 0, -70]")
    assert any("at the surface, a strain of 0.57 %" in line for line in small), small


def test_a_radius_for_which_there_is_no_room_is_not_told() -> None:
    """0.62 m for r1, whose axis is 0.85 m from that of r2: typed, it was refused."""
    near = ["material.yield_stress=1.5e8", "rollers.r2.centre=[0.6, 0.0, -0.9]"]
    (found,) = [line for line in told(*near) if "bending over r1" in line]
    assert typed(found) == ["material.plasticity={}"]
    with pytest.raises(InputError, match="overlap"):
        scene_of(*near, "rollers.r1.radius=0.62")


def test_stresses_below_one_megapascal_are_told() -> None:
    """A line in kN and m, whose strip yields at 0.15 of them, was told to exceed 0 MPa."""
    soft = ["material.young=2.1e8", "material.yield_stress=1.5e5", "threading.tension=10"]
    soft += ["stages.run.entry.tension=9"]
    (found,) = [line for line in told(*soft) if "bending over r1" in line]
    assert "r1, r2 gives 0.31 MPa at the surface, above the yield stress 0.15 MPa" in found


def test_the_speed_of_a_strip_is_doubted_like_that_of_a_roller() -> None:
    running = BRIDLE.replace("entry.tension = 9.0e3", "strip.speed = 120.0")
    running = running.replace("rollers.r1.surface_speed = 2.0\n", "").replace(
        "rollers.r2.surface_speed = 2.0\n", ""
    )
    tables = tomllib.loads(running)
    tables["rollers"] = [{**roller, "drive": "idle"} for roller in tables["rollers"]]
    scene = Scene.from_tables(tables, "line.toml")
    (found,) = [line for line in warnings(Preview.of(Assembly(scene))) if "was it meant" in line]
    assert typed(found) == ["stages.run.strip.speed=2"]


@pytest.mark.parametrize("end", ["entry", "exit"])
def test_the_speed_of_an_end_is_doubted_like_that_of_a_roller(end: str) -> None:
    tables = {
        "strip": {"kinematics": "section", "length": 2.0, "width": 1.0, "thickness": 1e-3},
        "material": {"young": 2e11, "poisson": 0.3},
        "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}},
        "stages": [{"name": "draw", "duration": 1.0, end: {"speed": 120.0}}],
    }
    scene = Scene.from_tables(tables, "line.toml")
    (found,) = [line for line in warnings(Preview.of(Assembly(scene))) if "was it meant" in line]
    assert typed(found) == [f"stages.draw.{end}.speed=2"]


PLATE = """
strip = { kinematics = "section", width = 2.5, thickness = 0.03 }
material = { young = 2.0e11, poisson = 0.3, density = 7850.0 }
friction = { coefficient = 0.3 }
threading = { tension = 1.0e3, entry = [-3.0, 0.0, 0.0], exit = [3.0, 0.0, 0.0] }
edges.entry.fixed = ["x", "z"]
[[rollers]]
radius = 0.2
centre = [-1.5, 0.0, -0.2]
wrap = "over"
[[rollers]]
radius = 0.2
centre = [0.0, 0.0, -0.2]
wrap = "over"
[[stages]]
name = "weight"
friction = false
gravity = [0.0, 0.0, -9.81]
"""


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        (PLATE, []),  # a sixth of the radius thick, but it turns round no roller
        (BRIDLE, ["rollers.r1.radius=7e-3", "rollers.r1.centre=[0.0, 0.0, -7e-3]"]),  # not 0.8 µm
        (
            BRIDLE,  # soft rubber
            [
                *("material.young=6e6", "material.poisson=0.49", "strip.thickness=5e-3"),
                *("threading.tension=1e3", "stages.run.entry.tension=900.0"),
            ],
        ),
    ],
    ids=["plate on rollers", "thin roller", "soft rubber"],
)
def test_thick_thin_and_soft_strip_is_not_in_other_units(text: str, settings: list[str]) -> None:
    scene = Scene.from_tables(tomllib.loads(text), "line.toml", settings)
    told = warnings(Preview.of(Assembly(scene)))
    assert not [line for line in told if "was it meant" in line or "sags deeply" in line]


@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_a_mesh_in_millimetres_is_told_alone(tmp_path: Path, scale: float) -> None:
    """Beside it nothing else can be judged, and no setting makes elements of a file shorter."""
    mesh = grid(scale * np.linspace(-1.5, 1.5, 5), scale * np.linspace(-0.4, 0.4, 3))
    mesh.save(str(tmp_path / "strip.vtu"))
    scene = Scene.model_validate(
        {
            "strip": {"mesh": str(tmp_path / "strip.vtu"), "thickness": 0.5e-3},
            "material": {"young": 2e11, "poisson": 0.3},
            "contact": {},
            "rollers": [{"radius": 0.3, "centre": [0.0, 0.0, -0.3]}],
            "edges": {"entry": {"fixed": ["x", "y", "z"]}},
            "stages": [{"name": "pull", "duration": 1.0, "exit": {"force": [5e3, 0.0, -500.0]}}],
        }
    )
    told = warnings(Preview.of(Assembly(scene)))
    if scale == 1.0:
        assert not any("drawn in mm" in words for words in told)
        assert any("Try elements of 0.07 m in strip.mesh" in words for words in told)
        return
    (words,) = told
    assert "is 3000 m long and 800 m wide; was it drawn in mm?" in words
