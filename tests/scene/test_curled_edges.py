"""Free edges of strip that is bent on a roller: they curl up off it, which takes friction."""

from __future__ import annotations

import copy
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from scipy.optimize import lsq_linear

from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import against_section, curled_edges, needless_shell, unseen_facts
from anmstrip.driver.explain import explain
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.driver.sweep import run_scene
from anmstrip.simulation.defaults import edge_curl
from anmstrip.simulation.problem import Assembly

WIDTH, THICKNESS, RADIUS = 1.25, 2.2e-3, 0.625
YOUNG, POISSON = 2.1e11, 0.3

BRIDLE: dict[str, Any] = {
    "strip": {"width": WIDTH, "thickness": THICKNESS},
    "material": {"young": YOUNG, "poisson": POISSON},
    "contact": {},
    "friction": {"coefficient": 0.18},
    "threading": {"tension": 25e3, "entry": [0.0, 0.0, 0.0], "exit": [9.0, 0.0, 0.0]},
    "rollers": [
        {"name": "b1", "radius": RADIUS, "centre": [4.0, 0.0, -2.0], "wrap": "under"},
        {"name": "b2", "radius": RADIUS, "centre": [5.6, 0.0, -0.625], "wrap": "over"},
    ],
    "stages": [{
        "steady": True, "entry": {"tension": 25e3}, "exit": {"tension": 29e3},
        "rollers": {"b1": {"surface_speed": 2.5}, "b2": {"surface_speed": 2.5}},
    }],
}  # fmt: skip
"""Two rolls of a pickling line at one speed, whose exit is pulled by 4 kN/m more."""


def bridle(**strip: Any) -> Scene:
    """Scene of that line with other strip."""
    tables = copy.deepcopy(BRIDLE)
    tables["strip"] |= strip
    return Scene.model_validate(tables)


def lifted(bent: float) -> tuple[np.ndarray, np.ndarray]:
    """Distances from a free edge and lifts (m) of strip bent to 1/r, κ of which has a moment.

    The least energy of a strip across, ½∫ D (w″ − ν κ)² + (E t/r²) w², which cannot sink in.
    """
    count = 241
    y, h = np.linspace(0.0, 0.06, count, retstep=True)
    second = np.diff(np.eye(count), 2, axis=0) / h**2
    flat = 2.0 * (np.eye(count)[-2] - np.eye(count)[-1]) / h**2  # no slope beyond
    stiffness = YOUNG * THICKNESS**3 / (12.0 * (1.0 - POISSON**2))
    length = np.sqrt(stiffness / (YOUNG * THICKNESS)) * RADIUS
    here = np.eye(count)
    here[0] *= np.sqrt(0.5)  # half a cell
    rows = np.vstack([length * second, length * flat, here])
    asked = np.r_[np.full(count - 1, length * POISSON * bent), np.zeros(count)]
    return y, lsq_linear(rows, asked, (0.0, np.inf), method="bvls").x


@pytest.mark.parametrize(("yields", "bent"), [(None, 1.0), (1e8, 0.4265)])
def test_edges_curl_as_a_beam_on_hoops_that_cannot_sink_in(
    yields: float | None, bent: float
) -> None:
    tables = copy.deepcopy(BRIDLE)
    if yields is not None:
        tables["material"] |= {"yield_stress": yields, "plasticity": {}}
    curl = edge_curl(Scene.model_validate(tables), RADIUS)
    y, w = lifted(bent / RADIUS)
    assert curl.lift == pytest.approx(w[0], rel=0.01)
    assert curl.width == pytest.approx(y[w == 0.0].min(), rel=0.05)
    force = YOUNG * THICKNESS / RADIUS * np.trapezoid(w, y)
    assert curl.force == pytest.approx(force, rel=0.01)


def test_a_section_and_a_coarse_shell_do_not_pass_unseen() -> None:
    """Nor is a section proposed, where edges need a large share of what friction can do."""
    told = "free edges curl up off b2, which takes 3395 N of the 8770 N of friction there"
    preview = Preview.of(Assembly(bridle()))
    assert list(against_section(preview)) == [told]
    assert not [*needless_shell(preview), *unseen_facts(preview)]
    curl, friction = preview.assembly.layout.curled["b2"]
    turn = preview.turn(preview.assembly.rollers[1])
    assert friction == pytest.approx(0.18 * 29e3 * turn * WIDTH, rel=0.02)
    text = " ".join(explain(bridle(kinematics="section")).split())
    assert f"Warning: kinematics section does not see that {told}. Try --set" in text
    assert "These numbers justify: shell." in text
    across = np.unique(preview.assembly.strip.nodes[1].round(9))
    assert across[1:3] + WIDTH / 2.0 == pytest.approx(
        [0.8 * curl.width, 2.0 * curl.width], rel=1e-6
    )
    finer = np.unique(Assembly(bridle(finer=2.0)).strip.nodes[1].round(9))
    assert len(finer) == 2 * len(across) - 1


def test_what_a_section_leaves_out_at_edges_is_told() -> None:
    """Edges curl up by 0.0908 t and are stretched by that over r; 2 F over the width bounds T."""
    thickness = 1e-3
    lift = POISSON * thickness / (2.0 * np.sqrt(3.0 * (1.0 - POISSON**2)))
    pulled = YOUNG * thickness * lift / RADIUS
    beta = (3.0 * (1.0 - POISSON**2)) ** 0.25 / np.sqrt(RADIUS * thickness)
    most = 2.0 * pulled / (np.cosh(np.pi / 2.0) * beta) / WIDTH
    text = " ".join(explain(bridle(thickness=thickness, kinematics="section")).split())
    edges = f"curled up by {lift:.2g} m over {np.pi / 2.0 / beta:.2g} m, pulled by {pulled:.2g} N/m"
    between = f"changes tensions between driven rollers by up to {most:.2g} N/m"
    assert f"anticlastic edges ({edges}; that {between}), contraction" in text
    flat = explain(bridle(thickness=thickness, kinematics="section", bending=False))
    assert "anticlastic edges, contraction" in " ".join(flat.split())


@pytest.mark.parametrize("change", [
    {"strip": {"thickness": 1e-3}},  # which takes 160 N
    {"strip": {"width": 0.2}},  # all of which curls
    {"strip": {"bending": False}},
    {"friction": {"coefficient": 0.3}},
    {"material": {"poisson": 0.0}},
    {"edges": {"left": {"fixed": ["z"]}}},
])  # fmt: skip
def test_what_does_not_curl_or_does_not_matter_is_meshed_as_before(change: dict[str, Any]) -> None:
    tables = copy.deepcopy(BRIDLE)
    for name, table in change.items():
        tables[name] = {**tables.get(name, {}), **table}
    assembly = Assembly(Scene.model_validate(tables))
    assert not assembly.layout.curled
    assert len(np.unique(assembly.strip.nodes[1].round(9))) == 5


@pytest.mark.parametrize(("pull", "scarce"), [(26e3, False), (29e3, True), (30e3, True)])
def test_a_section_tells_where_friction_is_scarce(pull: float, scarce: bool) -> None:
    """The second roll needs ln(T₂/T₁)/(f θ) of f N for the tension, and 3.4 kN for its edges."""
    tables = copy.deepcopy(BRIDLE)
    tables["strip"]["kinematics"] = "section"
    tables["stages"][0]["exit"]["tension"] = pull
    run = Run(Scene.model_validate(tables))
    *_, last = run
    found = list(curled_edges(last.state, run.scene))
    if not scarce:
        assert not found
        return
    roller = last.state.rollers["b2"]
    most = 0.18 * roller.normal_force
    turn = Preview.of(run.assembly).turn(run.assembly.rollers[1])
    used = np.log(roller.tension_out / roller.tension_in) / (0.18 * turn)
    (told,) = found
    assert told.startswith("free edges curl up off b2, which takes 3395 N of friction")
    left = float(re.findall(r"leaves (\d+) N", told)[0])
    assert left == pytest.approx((1.0 - used) * most, rel=0.05)
    assert f"up to {3395 / WIDTH:.2g} N/m off" in told


@pytest.mark.slow
def test_curled_edges_take_friction_from_the_tension_between_two_rolls(tmp_path: Path) -> None:
    """By equal flow it is that before them, 25 kN/m; on elements half as long 25.7 kN/m.

    Edges have their lift and their stretch by hand, to what tension presses them down.
    """
    run_scene(bridle(), tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    between = summary["rollers"]["b2"]["tension_in"]
    assert between == pytest.approx(25.7e3, rel=0.003)
    field = pv.read(sorted(tmp_path.glob("strip_*.vtu"))[-1])
    y, lift = field.points[:, 1], edge_curl(bridle(), RADIUS).lift
    lowest = np.flatnonzero(np.abs(y) < 1e-9)
    lowest = lowest[np.argmin(field.points[lowest, 2])]  # in the middle of the arc on b1
    row = np.flatnonzero(np.abs(field["arc_length"] - field["arc_length"][lowest]) < 1e-4)
    edge = row[np.argmax(y[row])]
    gap = field["gap"][edge] - field["gap"][lowest]
    assert 0.85 * lift < gap < lift
    stretched = YOUNG * THICKNESS * gap / RADIUS
    assert field["tension"][edge] - field["tension"][lowest] == pytest.approx(stretched, rel=0.06)
