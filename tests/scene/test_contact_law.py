"""Contact whose onset follows from the mesh, beside a penalty that is given."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.mechanics.laws import GradedSignorini
from anmstrip.simulation.defaults import tension_of_moves
from anmstrip.simulation.problem import Assembly
from contact import pressed as under
from strips import capstan, pressed

EXAMPLES = Path(__file__).parents[2] / "examples"
PENALTY = {"stiffness": 1e10, "eta": 10.0, "delta": 1e-3}


def built(contact: dict[str, Any], **more: Any) -> tuple[GradedSignorini, float]:
    """The law, and the length of the elements over rollers."""
    tables = {**pressed("section", 2, 0.1, 1e-4).to_dict(), "contact": contact, **more}
    assembly = Assembly(Scene.model_validate(tables))
    law = assembly.signorini
    assert isinstance(law, GradedSignorini)
    return law, float(assembly.strip.cell_sizes[0].min())


def test_it_fits_the_tension_the_roller_and_the_mesh() -> None:
    """Under T/r on the surface; w: the gap of a straight strip half a spacing, h/4, further on."""
    law, h = built({})
    assert law.pressure == pytest.approx((1e4**2 + 5773.5**2) ** 0.5 / 0.5, rel=1e-12)
    assert law.width == pytest.approx((h / 4.0) ** 2 / (2.0 * 0.5), rel=1e-12)


def test_what_is_given_is_taken() -> None:
    assert built({"onset": 1e-5, "pressure": 3e4})[0] == GradedSignorini(3e4, 1e-5)


def test_weight_counts_on_a_line_where_it_is_more_than_tension() -> None:
    """Of the width √(2π r w), over which the pressure falls from its middle by e^(−x²/2rw)."""
    heavy = {"gravity": [0.0, 0.0, -9.81e4], "duration": 1.0}
    material = {"young": 2e11, "poisson": 0.3, "density": 7850.0}
    scene = pressed("section", 2, 0.1, 1e-4).to_dict()
    stages = [*scene["stages"], heavy]
    law, h = built({}, stages=stages, material=material)
    line = 7850.0 * 1e-3 * 9.81e4 * scene["strip"]["length"]
    assert law.pressure == pytest.approx(line / (math.sqrt(math.pi) * h / 4.0), rel=1e-12)


def test_a_roller_that_is_pressed_into_a_foundation_counts_on_a_line() -> None:
    """Of Hetényi's √8 (D k³)^(1/4) δ; T/r of nothing else let it sink by a third of δ."""
    r, depth, k = 0.1, 1e-4, 1e8
    tables = {
        "strip": {"kinematics": "section", "length": 1.0, "width": 1.0, "thickness": 2e-3,
                  "foundation": k, "finer": 4.0},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {},
        "edges": {"entry": {"fixed": ["x"]}},
        "rollers": [{"name": "r1", "radius": r, "centre": [0.0, 0.0, r + depth]}],
        "stages": [{"name": "press", "rollers": {"r1": {"move": [0.0, 0.0, -2.0 * depth]}}}],
    }  # fmt: skip
    scene = Scene.from_tables(tables, "felt.toml")
    law, D = Assembly(scene).signorini, 2e11 * 8e-9 / 12.0 / (1.0 - 0.3**2)
    assert isinstance(law, GradedSignorini)
    load = math.sqrt(8.0) * (D * k**3) ** 0.25 * depth
    assert law.pressure == pytest.approx(load / math.sqrt(2.0 * math.pi * r * law.width), rel=1e-9)
    *_, last = scene.run()
    assert last.state.rollers["r1"].normal_force == pytest.approx(load, rel=0.01)


def test_several_rollers_share_a_law_for_their_mean_radius() -> None:
    rollers = [
        {"name": name, "radius": r, "centre": [x, 0.0, -r - 1e-3]}
        for name, r, x in (("r1", 0.2, -1.0), ("r2", 0.8, 1.0))
    ]
    law, h = built({}, rollers=rollers)
    assert law.width == pytest.approx((h / 4.0) ** 2 / (2.0 * 0.4), rel=1e-12)


def test_it_takes_fewer_tangents_and_presses_more_evenly() -> None:
    """Beside the penalty of steel on steel, which the points of this mesh do not resolve."""
    base = capstan("section", 1, 0.05, 1e-4)
    stiff, graded = under(base, {"stiffness": 1e10, "eta": 10.0, "delta": 1e-3}), under(base, {})
    assert graded.pressing < 0.6 * stiff.pressing
    assert graded.alternation < 0.2 * stiff.alternation
    assert abs(graded.pressure_error) < 0.5 * abs(stiff.pressure_error)
    assert abs(graded.ratio_error) < 2e-4


@pytest.mark.slow
def test_it_tends_to_rigid_contact_with_the_mesh() -> None:
    """The roller bears what a stiff penalty makes it bear."""
    found = []
    for contact in ({}, {"stiffness": 1e11, "eta": 1.0, "delta": 1e-3}):
        scene = Scene.model_validate(
            {**pressed("section", 2, 0.0125, 1e-5).to_dict(), "contact": contact}
        )
        run = Run(scene)
        for _ in run:
            pass
        assert run.outcome.done, run.message
        assert run.state is not None
        found.append(run.state.rollers["r1"].normal_force)
    assert found[0] == pytest.approx(found[1], rel=1e-4)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
def test_a_strip_does_not_pass_through_a_roller_that_no_end_of_a_step_feels(
    tolerance: float,
) -> None:
    """Pulled down over a roller by a metre, with an onset of two micrometres."""
    tables = {**pressed("section", 1, 0.1, tolerance).to_dict(), "contact": {"onset": 2e-6}}
    run = Run(Scene.model_validate(tables))
    for _ in run:
        pass
    assert run.outcome.done, run.message
    assert run.state is not None
    error = max(2e-3, tolerance)
    assert run.state.rollers["r1"].normal_force == pytest.approx(11676.0, rel=error)


@pytest.mark.parametrize(
    ("profile", "shape"),
    [
        ({"crown": [0.0, -2e-4]}, {}),
        ({"axis": [3e-3, 1.0, 0.0]}, {}),
        ({}, {"flatness": {"across": [0.0, 0.0, 40.0]}}),
        ({}, {"camber": 1e-4}),
    ],
)
def test_it_is_sharper_where_gaps_would_stretch_fibres_unevenly(
    profile: dict[str, Any], shape: dict[str, Any]
) -> None:
    """On such a roller or of such fibres: 0.01 of the elastic stretch, on the radius."""
    tables = capstan("shell", 4, 0.1, 1e-3, stiffer=None).to_dict()
    plain = Assembly(Scene.model_validate(tables)).signorini
    tables["rollers"][0].update(profile)
    tables["strip"].update(shape)
    law = Assembly(Scene.model_validate(tables)).signorini
    strain = 11547.0 / (2e11 * 1e-3)
    assert law.width == pytest.approx(0.01 * strain * 0.5, rel=1e-3)
    assert law.width < 0.01 * plain.width


@pytest.mark.parametrize(("fall", "crown"), [(0.1, 0.0), (1.0, 0.0), (0.1, 1e-4)])
def test_on_short_arcs_of_cylinders_uneven_strip_has_more_of_it(fall: float, crown: float) -> None:
    """Times the width over the arc between the tangents from both ends."""
    tables: dict[str, Any] = {
        "strip": {"width": 1.0, "thickness": 5e-4, "flatness": {"across": [0.0, 0.0, 40.0]}},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {},
        "rollers": [{"name": "a", "radius": 0.5, "centre": [0.0, 0.0, -0.5], "wrap": "over"}],
        "threading": {"tension": 5e3, "entry": [-1.0, 0.0, -fall], "exit": [1.0, 0.0, -fall]},
        "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {}},
        "stages": [{"duration": 1.0, "friction": False}],
    }
    if crown:
        tables["rollers"][0]["crown"] = [0.0, -crown]
    law = Assembly(Scene.from_tables(tables, "arc.toml")).signorini
    least, above = 0.01 * 5e3 / (2e11 * 5e-4) * 0.5, 0.5 - fall  # of the ends, over the axis
    half = math.acos(above / math.hypot(1.0, above)) - math.acos(0.5 / math.hypot(1.0, above))
    spread = 1.0 if crown else max(1.0, 1.0 / half)  # arc of 2 half on half a metre
    assert law.width == pytest.approx(spread * least, rel=0.01)


@pytest.mark.slow
def test_it_gives_the_tensions_of_a_crowned_roller_that_a_stiff_penalty_gives() -> None:
    tensions = []
    for contact in ({}, {"stiffness": 1e11, "eta": 1.0, "delta": 1e-3}):
        scene = Scene.load(EXAMPLES / "crowned.toml", ["strip.cells=[24, 4]"])
        run = Scene.model_validate({**scene.to_dict(), "contact": contact}).run()
        for _ in run:
            pass
        assert run.outcome.done, run.message
        assert run.state is not None
        forces = run.state.principal_forces
        tensions.append((forces.max(), forces.min()))
    assert tensions[0] == pytest.approx(tensions[1], rel=0.01)


@pytest.mark.parametrize("contact", [{}, PENALTY])
def test_a_way_without_friction_is_followed_to_the_tolerance(contact: dict[str, Any]) -> None:
    """Down to a hundredth; where it comes to is right to less."""
    tangents, forces = [], []
    for tolerance in (1e-2, 1e-4):
        tables = {**pressed("section", 2, 0.1, tolerance).to_dict(), "contact": contact}
        tables["solver"] = {"tolerance": tolerance, "order": 13}
        run = Run(Scene.model_validate(tables))
        for _ in run:
            pass
        assert run.outcome.done
        assert run.state is not None
        tangents.append(run.cost.expansions)
        forces.append(run.state.rollers["r1"].normal_force)
    assert tangents[0] < 0.95 * tangents[1]
    assert forces[0] == pytest.approx(forces[1], rel=5e-3)


def test_a_roller_that_stretches_held_strip_is_hard() -> None:
    """The pressure is that of the tension it makes; √(D/T) of it, 17 mm, is resolved as well.

    E t (l/L − 1) with the way l of a string, its straight runs and the arc between them; strip that
    is bent onto the roller has a little more.
    """
    radius, half, raised, stiffness = 1.0, 2.0, 0.05, 2e11 * 1e-3
    scene = Scene.model_validate(
        {
            "strip": {"kinematics": "section", "length": 4.0, "width": 1.0, "thickness": 1e-3},
            "material": {"young": 2e11, "poisson": 0.3},
            "contact": {},
            "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["x", "z"]}},
            "rollers": [{"radius": radius, "centre": [0.0, 0.0, -radius]}],
            "stages": [{"duration": 1.0, "rollers": {"r1": {"move": [0.0, 0.0, raised]}}}],
        }
    )
    *_, last = scene.run()
    away = math.hypot(half, radius - raised)
    turn = math.asin(radius / away) - math.atan((radius - raised) / half)
    way = math.sqrt(away**2 - radius**2) + radius * turn
    tension = stiffness * (way / half - 1.0)
    assert tension_of_moves(scene) == pytest.approx(tension, rel=2e-2)
    assert last.state.tension("exit") == pytest.approx(tension, rel=2e-3)
    assert last.tangents <= 8


def test_strip_whose_end_travels_bears_what_that_stretches() -> None:
    """In time as by a move: at a scale of D/L² the steps of a tensile test were 900, of 1 µs."""
    held = {"fixed": ["x", "z"]}
    tables = {
        "strip": {"kinematics": "section", "length": 2.0, "width": 1.0, "thickness": 1e-3},
        "material": {"young": 2e11, "poisson": 0.3},
        "edges": {"entry": held, "exit": held},
        "stages": [
            {"name": "start", "duration": 0.5, "exit": {"velocity": [2e-3, 0.0, 0.0]}},
            {"name": "pull", "duration": 1.5},
            {"name": "follow", "duration": 1.0, "entry": {"velocity": [4e-3, 0.0, 0.0]}},
        ],
    }
    way, stiffness = 3.5e-3, 2e11 * 1e-3  # 0.5 mm in the first stage, 3 mm in the second; then 0
    assert tension_of_moves(Scene.model_validate(tables)) == pytest.approx(stiffness * way / 2.0)
    tables["material"] |= {"yield_stress": 3e8, "plasticity": {}}
    scene = Scene.model_validate(tables)
    assert tension_of_moves(scene) == pytest.approx(2.0 / math.sqrt(3.0) * 3e8 * 1e-3)
    *_, last = scene.run()
    assert last.tangents < 100
