"""Edges of flat strip that keep their slope, against beams and plates."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from anmstrip.advice.warnings import buckled_section
from anmstrip.driver.accuracy import Accuracy
from anmstrip.driver.explain import report
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.driver.sweep import row_of, run_scene
from anmstrip.errors import InputError
from anmstrip.pictures.report import write_report
from anmstrip.results.state import State
from anmstrip.results.wrinkles import free_spans
from anmstrip.simulation.defaults import tension_of_loads
from anmstrip.simulation.problem import Assembly

MESHES = Path(__file__).parents[2] / "meshes"
YOUNG, THICKNESS = 2.0e11, 1.0e-3
STIFFNESS = YOUNG * THICKNESS**3 / 12.0
"""D of a strip that contracts freely (N m)."""

KINDS = "wrinkles", "bifurcation"

JAWS = {"fixed": ["x", "y", "z"], "clamped": True}


def solved(stages: list[dict[str, Any]], edges: dict[str, Any], **tables: Any) -> State:
    """Last state of a run."""
    strip = {"thickness": THICKNESS, **tables.pop("strip")}
    material = {"young": YOUNG, "poisson": tables.pop("poisson", 0.0)}
    given = {"strip": strip, "material": material, "edges": edges, "stages": stages, **tables}
    run = Run(Scene.model_validate(given))
    *_, last = run
    assert run.outcome.done
    return last.state


def displacements(state: State) -> np.ndarray:
    """Of the nodes (m), (nodes, components)."""
    strip = state.plan.model.strip
    return np.asarray(strip.nodal(state.full)[strip.node_values])


def lowest(state: State) -> np.ndarray:
    """Displacement (m) of the node that has moved farthest down, (components,)."""
    values = displacements(state)
    return np.asarray(values[values[:, -1].argmin()])


def elastica(force: float) -> tuple[float, float]:
    """Motion of the tip of 1 m, along and with the force (over D/L²): θ'' = −F cos θ."""
    places = np.linspace(0.0, 1.0, 101)
    found = solve_bvp(
        lambda s, y: np.array([y[1], -force * np.cos(y[0]), np.cos(y[0]) - 1.0, np.sin(y[0])]),
        lambda a, b: np.array([a[0], b[1], a[2], a[3]]),
        places, np.zeros((4, len(places))), tol=1e-8,
    )  # fmt: skip
    assert found.success
    return float(found.y[2, -1]), float(found.y[3, -1])


def test_cantilever_is_the_elastica() -> None:
    load = {"name": "load", "exit": {"force": [0.0, 0.0, -4.0 * STIFFNESS]}}
    strip = {"kinematics": "section", "length": 1.0, "width": 0.1}
    state = solved([load], {"entry": {"fixed": ["x", "z"], "clamped": True}}, strip=strip)
    along, down = elastica(4.0)
    assert lowest(state) == pytest.approx([along, -down], rel=5e-4)
    arm = 1.0 + lowest(state)[0]  # of the force about the jaws; the upper side is stretched
    assert state.clamp_moment("entry") == pytest.approx(4.0 * STIFFNESS * arm, rel=1e-4)


def test_half_of_a_beam_ends_in_its_plane_of_symmetry() -> None:
    """P L³/192 D of a whole beam between jaws; half of it, half of the force."""
    edges = {"entry": JAWS | {"fixed": ["x", "z"]}, "exit": {"fixed": ["x"], "clamped": True}}
    load = {"name": "load", "exit": {"force": [0.0, 0.0, -0.01]}}
    strip = {"kinematics": "section", "length": 0.5, "width": 0.1}
    state = solved([load], edges, strip=strip, solver={"tolerance": 1e-8})
    assert lowest(state)[1] == pytest.approx(-0.02 / (192.0 * STIFFNESS), rel=1e-3)
    assert state.clamp_moment("entry") == pytest.approx(0.02 / 8.0, rel=1e-4)
    assert state.clamp_moment("exit") == pytest.approx(-0.02 / 8.0, rel=1e-4)


@pytest.mark.parametrize("kinematics", ["plate", "shell"])
def test_square_plate_between_jaws_all_round(kinematics: str) -> None:
    """0.001265 q a⁴/D in the middle (Timoshenko & Woinowsky-Krieger, table 35)."""
    fixed = ["z"] if kinematics == "plate" else ["x", "y", "z"]
    edges = {name: JAWS | {"fixed": fixed} for name in ("entry", "exit", "left", "right")}
    strip = {"kinematics": kinematics, "length": 1.0, "width": 1.0, "cells": [8, 8]}
    press = {"name": "press", "pressure": -0.01}
    state = solved([press], edges, strip=strip, poisson=0.3, solver={"tolerance": 1e-6})
    plate = STIFFNESS / (1.0 - 0.3**2)
    assert lowest(state)[-1] == pytest.approx(-1.265e-3 * 0.01 / plate, rel=2e-3)
    moments = [state.clamp_moment(name) for name in edges]
    assert moments == pytest.approx([moments[0]] * 4, rel=1e-9)
    assert 0.5 * 0.0513 < moments[0] / 0.01 < 0.8 * 0.0513  # the largest, amid the edge


def test_clamped_triangles() -> None:
    """A cantilever of 4 m, as narrow rectangles have it: F L³/3 D."""
    load = {"name": "load", "exit": {"force": [0.0, 0.0, -1e-3]}}
    strip = {"kinematics": "plate", "mesh": str(MESHES / "strip_triangles.msh")}
    state = solved([load], {"entry": {"fixed": ["z"], "clamped": True}}, strip=strip)
    nodes = state.plan.model.strip.nodes[0]
    expected = -1e-3 * np.ptp(nodes) ** 3 / (3.0 * STIFFNESS)
    assert lowest(state)[-1] == pytest.approx(expected, rel=1e-6)
    assert state.clamp_moment("entry") == pytest.approx(1e-3 * np.ptp(nodes), rel=1e-6)


def test_slope_stays_where_the_jaws_are_moved_until_they_let_go() -> None:
    """Raised with its jaws the strip stays straight; let go it hangs from its other end."""
    edges = {"entry": JAWS, "exit": {"fixed": ["z"], "clamped": True}}
    up = {"move": [0.0, 0.0, 0.1]}
    moved = {"name": "raise", "entry": up, "exit": up}
    hangs = {"name": "let_go", "exit": {"release": True, "force": [0.0, 0.0, -1e-3]}}
    strip = {"length": 1.0, "width": 0.2, "cells": [8, 2]}
    state = solved([moved, hangs], edges, strip=strip, solver={"tolerance": 1e-6})
    sunk = 1e-3 / (3.0 * STIFFNESS)
    assert lowest(state)[2] == pytest.approx(0.1 - sunk, rel=1e-4)


def test_the_moment_of_a_clamp_is_told(tmp_path: Path) -> None:
    """In the summary and on the console: of 1 N/m on an arm of 10 mm."""
    tables = {
        "strip": {"kinematics": "section", "length": 0.01, "width": 0.1, "thickness": THICKNESS},
        "material": {"young": YOUNG, "poisson": 0.3},
        "edges": {"entry": {"fixed": ["x", "z"], "clamped": True}},
        "stages": [{"name": "load", "exit": {"force": [0.0, 0.0, -1.0]}}],
    }
    run = Run(Scene.model_validate(tables), tmp_path)
    list(run)
    told = json.loads((tmp_path / "summary.json").read_text("utf-8"))["edges"]
    assert told["entry"]["moment"] == pytest.approx(0.01, rel=2e-4)
    assert "moment" not in told["exit"]
    assert f" Moment {told['entry']['moment']:.6g} N at the entry." in report(run)


@pytest.mark.parametrize("thickness", [1e-4, 1e-3])
def test_strip_that_pressure_bends_between_jaws(thickness: float) -> None:
    """On the usual mesh the moment was twice that of a beam under its tension, which stretches it.

    p L λ/2 (coth u − 1/u), λ = √(D/T), u = L/2λ.
    """
    length, pressure = 0.5, 1e3
    edges = dict.fromkeys(("entry", "exit"), JAWS | {"fixed": ["x", "z"]})
    strip = {"kinematics": "section", "length": length, "width": 0.1, "thickness": thickness}
    stages = [{"name": "blow", "pressure": pressure}]
    state = solved(stages, edges, strip=strip, poisson=0.3)
    layer = np.sqrt(YOUNG * thickness**3 / 12.0 / 0.91 / state.tension("entry"))
    u = 0.5 * length / layer
    moment = 0.5 * pressure * length * layer * (1.0 / np.tanh(u) - 1.0 / u)
    assert abs(state.clamp_moment("entry")) == pytest.approx(moment, rel=2e-3)
    material = {"young": YOUNG, "poisson": 0.3}
    given = {"strip": strip, "material": material, "edges": edges, "stages": stages}
    expected = tension_of_loads(Scene.model_validate(given))
    assert expected == pytest.approx(state.tension("entry"), rel=4.0 / u)  # as bending bears a part


def test_clamped_sides_are_told_everywhere(tmp_path: Path) -> None:
    """Their moment and force, which balances the pressure; the report of such a run failed."""
    edges = dict.fromkeys(("entry", "exit", "left", "right"), JAWS)
    given = {
        "strip": {"thickness": THICKNESS, "length": 0.4, "width": 0.2, "cells": [8, 4]},
        "material": {"young": YOUNG, "poisson": 0.3},
        "edges": edges,
        "stages": [{"name": "blow", "pressure": 10.0}],
    }
    scene = Scene.model_validate(given)
    summary = run_scene(scene, tmp_path / "sheet")
    told, row = summary["edges"], row_of(summary)
    whole = sum(told[name]["force"][2] for name in edges)
    assert whole == pytest.approx(-10.0 * 0.08, rel=0.01)  # corners belong to two edges
    assert told["left"]["moment"] == pytest.approx(told["right"]["moment"], rel=1e-9)
    assert row["left_moment"] == told["left"]["moment"]
    assert "left_tension" not in row
    page = write_report(tmp_path / "sheet").read_text("utf-8")
    assert "<td>left</td><td>–</td>" in page
    study = Accuracy(scene, ["tolerance"], directory=tmp_path / "study")
    list(study.run())
    assert "A tolerance of 0.001" in study.advice()


def test_heated_strip_between_jaws_bifurcates_as_a_column() -> None:
    """Strain of Euler's column with clamped ends: π² t²/3 L²."""
    strip = {"length": 0.5, "width": 0.1, "cells": [8, 2]}
    heat = {"name": "heat", "strip": {"temperature": 2.0}}
    given = {
        "strip": {"thickness": THICKNESS, **strip}, "edges": {"entry": JAWS, "exit": JAWS},
        "material": {"young": YOUNG, "poisson": 0.0, "expansion": 1.2e-5}, "stages": [heat],
    }  # fmt: skip
    run = Run(Scene.model_validate(given))
    list(run)
    (found,) = [told["time"] for told in run.wrinkles if told["kind"] == "bifurcation"]
    strain = np.pi**2 * THICKNESS**2 / 3.0 / 0.5**2
    assert 1.2e-5 * 2.0 * found == pytest.approx(strain, rel=2e-3)


def test_elements_beside_a_jaw_follow_the_moment_of_pulled_strip() -> None:
    """M = F √(D/T) tanh(L √(T/D)) where T pulls and F bends: elements of L/20 gave a third less."""
    pull, push = 1e4, 1e2
    load = {"name": "load", "exit": {"force": [pull, 0.0, push]}}
    strip = {"kinematics": "section", "length": 1.0, "width": 0.1}
    state = solved([load], {"entry": {"fixed": ["x", "z"], "clamped": True}}, strip=strip)
    moment = push * np.sqrt(STIFFNESS / pull)
    assert abs(state.along("moment")[0]) == pytest.approx(moment, rel=5e-3)


def test_elements_beside_a_jaw_are_no_shorter_than_over_rollers() -> None:
    """Film of which √(D/T)/8 is 1/600 of its roller had all others coarser for its jaws."""
    given = {
        "strip": {"thickness": 5e-5, "length": 0.5, "width": 0.2, "kinematics": "section"},
        "material": {"young": 4e9, "poisson": 0.38},
        "edges": dict.fromkeys(("entry", "exit"), JAWS | {"fixed": ["x", "z"]}),
        "rollers": [{"name": "r", "radius": 0.03, "centre": [0.0, 0.0, 0.03]}],
        "stages": [{"name": "press", "friction": False, "exit": {"move": [1e-3, 0.0, 0.0]},
                    "rollers": {"r": {"move": [0.0, 0.0, -5e-3]}}}],
    }  # fmt: skip
    sizes = Assembly(Scene.from_tables(given, "film.toml")).strip.cell_sizes[0]
    assert sizes.min() == pytest.approx(0.03 / 64.0, rel=0.1)


@pytest.mark.parametrize(
    ("exit_held", "force", "told"),
    [
        (["x", "z"], 3.5, ""), (["x", "z"], 4.5, "imperfection"),
        (["x"], 0.9, ""), (["x"], 1.1, "imperfection"),
    ],
)  # fmt: skip
def test_straight_strip_between_jaws_is_told_that_it_has_buckled(
    exit_held: list[str], force: float, told: str
) -> None:
    """Beyond 4 π² D/L², or π² D/L² where one jaw gives way across."""
    way = -force * np.pi**2 * STIFFNESS / (YOUNG * THICKNESS)
    close = {"name": "close", "exit": {"move": [way, 0.0, 0.0]}}
    edges = {"entry": JAWS | {"fixed": ["x", "z"]}, "exit": JAWS | {"fixed": exit_held}}
    strip = {"thickness": THICKNESS, "kinematics": "section", "length": 1.0, "width": 0.1}
    material = {"young": YOUNG, "poisson": 0.0}
    given = {"strip": strip, "material": material, "edges": edges, "stages": [close]}
    run = Run(Scene.model_validate(given))
    *_, last = run
    found = buckled_section(last.state, run.scene)
    assert [told in words for words in found] == [True] * bool(told)


@pytest.mark.parametrize("clamped", [True, False])
def test_shell_between_jaws_bears_four_times_as_much(clamped: bool) -> None:
    """It was told to be likely to wrinkle above π² D/L², as if it turned at its ends."""
    jaws = {"fixed": ["x", "z"], "clamped": clamped}
    entry = jaws | {"fixed": ["x", "y", "z"]}
    way = -2.0 * np.pi**2 * STIFFNESS / (YOUNG * THICKNESS) / 0.5
    close = {"name": "close", "exit": {"move": [way, 0.0, 0.0]}}
    strip = {"length": 0.5, "width": 0.1, "cells": [8, 2]}
    state = solved([close], {"entry": entry, "exit": jaws}, strip=strip)
    (span,) = free_spans(state)
    borne = (4.0 if clamped else 1.0) * np.pi**2 * STIFFNESS / 0.5**2
    assert span.bearable == pytest.approx(borne, rel=1e-3)


def closed(beyond: float) -> tuple[float, Scene]:
    """What a sheet between jaws bears (N/m) at ν = 0, and one whose jaws close beyond it."""
    length = 0.5
    borne = 4.0 * np.pi**2 * STIFFNESS / length**2
    way = -beyond * borne * length / (YOUNG * THICKNESS)
    jaws = JAWS | {"fixed": ["x", "y", "z"]}
    given = {
        "strip": {"thickness": THICKNESS, "length": length, "width": 0.1, "cells": [8, 2]},
        "material": {"young": YOUNG, "poisson": 0.0},
        "edges": {"entry": jaws, "exit": jaws},
        "stages": [{"name": "close", "exit": {"move": [way, 0.0, 0.0]}}],
    }
    return borne, Scene.model_validate(given)


@pytest.mark.parametrize("beyond", [2.0, 40.0, 8000.0])
def test_onset_is_found_however_far_beyond_it_a_step_leads(beyond: float) -> None:
    """Wrinkles are told at 1/1.01 of the load; those of the lowest modes were left out."""
    borne, scene = closed(beyond)
    run = Run(scene)
    list(run)
    first = {kind: next(told for told in run.wrinkles if told["kind"] == kind) for kind in KINDS}
    assert first["wrinkles"]["exit_tension"] == pytest.approx(-borne / 1.01, rel=1e-3)
    assert first["bifurcation"]["exit_tension"] == pytest.approx(-borne, rel=1e-3)


def test_sheet_that_has_bifurcated_is_told_how_it_wrinkles(tmp_path: Path) -> None:
    """As it is told to be typed it bears what it bore, and is bent by the way that its jaws went.

    Of w = h (1 + cos 2πx/L)/2 by π² h²/4L.
    """
    borne, scene = closed(40.0)
    run = Run(scene, tmp_path)
    list(run)
    (words,) = (each for each in run.warnings if "not stable" in each)
    (bow,) = re.findall(r"--set '(.*?)'", words)
    scene = Scene.from_tables(scene.to_dict(), "jaws.toml", [bow])
    run = Run(scene, tmp_path / "bent")
    *_, last = run
    assert not any("not stable" in each for each in run.warnings)
    assert last.state.tension("exit") == pytest.approx(-borne, rel=0.02)
    height = 2.0 / np.pi * np.sqrt(0.5 * 39.0 * borne * 0.5 / (YOUNG * THICKNESS))
    assert np.abs(displacements(last.state)[:, 2]).max() == pytest.approx(height, rel=0.02)


@pytest.mark.parametrize(
    ("held", "number"), [([], 0.25), (["left"], 0.675), (["left", "right"], 4.0)]
)
def test_shell_held_at_its_sides_bears_what_a_plate_does(held: list[str], number: float) -> None:
    """Over π² D/W²; it was told to wrinkle above π² D/L², a sixteenth of what it bears."""
    push = {"name": "push", "exit": {"force": [-1.0, 0.0, 0.0]}}
    edges = {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}}
    edges |= {name: {"fixed": ["z"]} for name in held}
    strip = {"length": 1.0, "width": 0.5, "cells": [8, 4]}
    (span,) = free_spans(solved([push], edges, strip=strip))
    assert span.bearable == pytest.approx(number * np.pi**2 * STIFFNESS / 0.5**2, rel=1e-3)


def test_strip_that_a_moment_rolls_up_is_not_pressed() -> None:
    """The energy of u,ab has N = −M κ where no force acts, which was told to buckle the strip."""
    given = {
        "strip": {"thickness": THICKNESS, "kinematics": "section", "length": 1.0, "width": 0.1},
        "material": {"young": YOUNG, "poisson": 0.0},
        "edges": {"entry": {"fixed": ["x", "z"], "clamped": True}},
        "stages": [{"name": "roll", "exit": {"moment": 2.0 * np.pi * STIFFNESS}}],
    }
    run = Run(Scene.model_validate(given))
    *_, last = run
    assert last.state.membrane_forces.mean() < -0.9 * STIFFNESS * (2.0 * np.pi) ** 2
    assert list(buckled_section(last.state, run.scene)) == []


def test_strip_pushed_against_a_jaw_is_a_column_with_a_free_end() -> None:
    """π² D/4L²; it was told to turn freely about its jaw."""
    found = []
    for share in (0.9, 1.1):
        push = [-share * np.pi**2 * STIFFNESS / 4.0, 0.0, 0.0]
        given = {
            "strip": {"thickness": THICKNESS, "kinematics": "section", "length": 1.0, "width": 0.1},
            "material": {"young": YOUNG, "poisson": 0.0},
            "edges": {"entry": {"fixed": ["x", "z"], "clamped": True}},
            "stages": [{"name": "push", "exit": {"force": push}}],
        }
        run = Run(Scene.model_validate(given))
        *_, last = run
        told = buckled_section(last.state, run.scene)
        found.append(["bears unbuckled" in words for words in told])
    assert found == [[], [True]]


def test_jaws_that_close_bow_the_strip_as_is_told_to_type() -> None:
    """Thousands of bucklings: an imperfection grew with the stage, and came too late for the first.

    An inextensible column is then as high as 2 √(ΔL L)/π, but for ΔL/L, and bears ΔL/2L more.
    """
    given = {
        "strip": {"thickness": THICKNESS, "kinematics": "section", "length": 1.0, "width": 0.1},
        "material": {"young": YOUNG, "poisson": 0.0},
        "edges": dict.fromkeys(("entry", "exit"), JAWS | {"fixed": ["x", "z"]}),
        "stages": [{"name": "close", "exit": {"move": [-0.01, 0.0, 0.0]}}],
    }
    straight = Run(Scene.from_tables(given, "jaws.toml"))
    *_, last = straight
    (words,) = buckled_section(last.state, straight.scene)
    typed = [each.strip("'") for each in re.findall(r"--set (\S+)", words)]
    run = Run(Scene.from_tables(given, "jaws.toml", typed))
    *_, last = run
    assert run.outcome.done and run.cost.expansions <= 30
    assert not list(buckled_section(last.state, run.scene))
    assert np.abs(last.state.along("z")).max() == pytest.approx(0.2 / np.pi, rel=0.01)
    force = 4.0 * np.pi**2 * STIFFNESS * (1.0 + 0.5 * 0.01)
    assert -last.state.tension("entry") == pytest.approx(force, rel=2e-3)


def test_an_edge_that_the_jaws_have_let_go_takes_a_moment() -> None:
    """It was refused in stages after the one that lets go; D κ = M all along."""
    edges = {"entry": JAWS | {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"], "clamped": True}}
    stages = [
        {"name": "let_go", "exit": {"release": True, "force": [0.0, 0.0, 0.0]}},
        {"name": "bend", "exit": {"moment": 0.5}},
    ]
    strip = {"kinematics": "section", "length": 1.0, "width": 0.1}
    state = solved(stages, edges, strip=strip, solver={"tolerance": 1e-6})
    assert state.clamp_moment("entry") == pytest.approx(-0.5, rel=1e-4)
    assert state.clamp_moment("exit") == pytest.approx(0.0, abs=1e-6)


def test_a_side_that_the_jaws_have_let_go_is_told_no_moment() -> None:
    """Of a plate it was told 8 % of that of the jaws, by which elements miss a free side."""
    edges = {name: JAWS | {"fixed": ["z"]} for name in ("entry", "exit", "left", "right")}
    stages = [{"name": "press", "pressure": -0.01}, {"name": "open", "left": {"release": True}}]
    strip = {"kinematics": "plate", "length": 2.0, "width": 1.0}
    state = solved(stages, edges, strip=strip, poisson=0.3)
    told = state.clamp_moments(edges)
    assert list(told) == ["entry", "exit", "right"]
    assert told["right"] == state.clamp_moment("right")


@pytest.mark.parametrize(
    ("tables", "key"),
    [
        ({"stages": [{"name": "bend", "exit": {"moment": 1.0}}]}, "stages.bend.exit.moment"),
        ({"strip": {"bending": False}}, "edges.exit.clamped"),
        ({"threading": {"tension": 1e3}}, "edges.exit.clamped"),
        ({"strip": {"mesh": str(MESHES / "strip_hole.msh")}}, "edges.hole.clamped"),
    ],
)
def test_clamps_that_cannot_be(tables: dict[str, Any], key: str) -> None:
    strip = {"thickness": THICKNESS, **tables.get("strip", {})}
    if "mesh" not in strip:
        strip |= {"length": 1.0, "width": 0.2}
    edges = {"hole" if "mesh" in strip else "exit": {"clamped": True}}
    rollers = [{"name": "r", "radius": 0.1, "centre": [0.0, 0.0, -0.1], "wrap": "over"}]
    pulled = {"name": "pull", "exit": {"force": [1e3, 0.0, 0.0]}}
    given = {
        "material": {"young": YOUNG, "poisson": 0.3}, "stages": [pulled],
        **({"rollers": rollers} if "threading" in tables else {}), **tables,
        "strip": strip, "edges": edges | {"entry": {"fixed": ["x", "z"]}},
    }  # fmt: skip
    with pytest.raises(InputError) as refused:
        Run(Scene.from_tables(given, "scene.toml"))
    assert [mistake.key for mistake in refused.value.mistakes] == [key]
