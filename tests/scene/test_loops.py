"""Strip that nips push into the run between them: it gathers there, and hangs in a loop."""

from __future__ import annotations

import copy
import re
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from anmstrip.advice.physics import nip_force
from anmstrip.advice.preview import Preview
from anmstrip.advice.warnings import warnings
from anmstrip.driver.explain import explain
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.simulation.meshing import label_at
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course

YOUNG, POISSON, DENSITY, THICKNESS = 2.1e11, 0.3, 7850.0, 1e-3
SPAN = 4.0
"""Between the nips (m)."""

PITS = ("p1", "p1top", "p2", "p2top")


def speeds(entry: float, exit: float) -> dict[str, Any]:
    """Tables of a stage for the surface speeds of both nips (m/s)."""
    both = zip(PITS, (entry, entry, exit, exit), strict=True)
    return {name: {"surface_speed": speed} for name, speed in both}


def pit(*stages: dict[str, Any], gap: float = 0.9 * THICKNESS) -> Scene:
    """A looping pit as it is drawn: the rollers of a nip leave a gap for the strip."""
    rollers = []
    for name, x in (("p1", 0.0), ("p2", SPAN)):
        rollers += [
            {"name": name, "radius": 0.2, "centre": [x, 0.0, -0.2], "wrap": "over"},
            {"name": f"{name}top", "radius": 0.2, "centre": [x, 0.0, 0.2 + gap]},
        ]
    run = {
        "name": "run", "steady": True, "gravity": [0.0, 0.0, -9.81],
        "entry": {"tension": 2e3}, "exit": {"tension": 2e3}, "rollers": speeds(1.0, 1.0),
    }  # fmt: skip
    return Scene.model_validate({
        "strip": {"kinematics": "section", "width": 1.2, "thickness": THICKNESS},
        "material": {"young": YOUNG, "poisson": POISSON, "density": DENSITY},
        "friction": {"coefficient": 0.2},
        "threading": {"tension": 2e3, "entry": [-1.5, 0.0, 0.0], "exit": [5.5, 0.0, 0.0]},
        "rollers": rollers,
        "edges": {"entry": {"fixed": ["x", "z"]}},
        "stages": [run, *copy.deepcopy(stages)],
    })  # fmt: skip


FILL = {"name": "fill", "duration": 1.0, "rollers": speeds(1.1, 1.0)}
ON = {"name": "on", "duration": 2.0}
EMPTY = {"name": "empty", "duration": 3.0, "rollers": speeds(0.9, 1.0)}


def test_gathered_strip_is_what_speeds_differ_by() -> None:
    """0.1 m/s more, reached within 1 s; then 2 s of it, and 3 s to as much less, which is none."""
    found = Assembly(pit(FILL, ON, EMPTY)).layout.gathered
    told = {name: (held[1], bent[1]) for name, (held, bent) in found.items()}
    expected = {
        "threading": (0.0, 0.0), "run": (0.0, 0.0), "fill": (0.05, 0.05), "on": (0.25, 0.0),
        "empty": (0.25, -0.3),
    }  # fmt: skip
    for name, numbers in expected.items():
        assert told[name] == pytest.approx(numbers, abs=1e-12), name
    assert all(not held[[0, 2]].any() for held, _ in found.values())


def test_a_run_gives_off_no_more_than_it_was_given() -> None:
    found = Assembly(pit(FILL, EMPTY | {"rollers": speeds(0.8, 1.0)})).layout.gathered
    assert found["empty"][0][1] == 0.0 == found["empty"][1][1]


@pytest.mark.parametrize("one", [{"drive": "idle"}, {"drive": "torque"}])
def test_nothing_gathers_behind_rollers_whose_speeds_are_not_given(one: dict[str, str]) -> None:
    scene = pit(FILL)
    rollers = [r.model_copy(update=one if "p2" in r.name else {}) for r in scene.rollers]
    found = Assembly(scene.model_copy(update={"rollers": rollers})).layout.gathered
    assert not any(held.any() for held, _ in found.values())


def test_labels_hold_it_at_the_rate_at_which_it_comes() -> None:
    """Held strip, ∂S/∂X and ∂S/∂t by differences between times of the stage."""
    scene = pit(FILL)
    assembly = Assembly(scene)
    course = Course(assembly)
    for stage in scene.course[:-1]:
        course.finish(stage)
    controls, duration = course.plan(scene.course[-1], {}).controls, FILL["duration"]
    growth, begun = assembly.growth, controls.at(0.0)["strip.held"][1]
    for share in (0.0, 0.3, 1.0):
        at = controls.at(share)
        assert at["strip.held"][1] - begun == pytest.approx(0.05 * share**2, abs=1e-12)
        h = 1e-3
        sides = (controls.at(share + way * h) for way in (1.0, -1.0))
        more, less = (side["strip.held"] for side in sides)
        rate = (more - less) / (2.0 * h * duration)
        assert at["strip.taking_up"] == pytest.approx(rate, abs=1e-9)
        assert controls.rate("strip.held", share) == pytest.approx(rate * duration, abs=1e-9)
        assert at["strip.growth"].min() >= 1.0
        assert growth.up_to(growth.x[-1:], at["strip.held"])[0] == pytest.approx(
            at["strip.held"].sum()
        )


def test_the_loop_is_told_and_no_roller_to_slip() -> None:
    scene = pit(FILL, ON)
    words = " ".join(explain(scene).split())
    assert "Between the nips p1 and p2 strip gathers: 0 m by the end of run, 0.05 m by the" in words
    told = list(warnings(Preview.of(Assembly(scene))))
    assert not any("slips on one of them" in line for line in told)


@pytest.mark.parametrize(
    ("gap", "typed", "faces"),
    [
        (1.0, None, True), (0.5, None, True), (0.4, None, False), (0.0, None, False),
        (1.1, None, False), (1.0, False, False), (1.1, True, True),
    ],
)  # fmt: skip
def test_nips_that_are_drawn_for_its_thickness_touch_its_faces(
    gap: float, typed: bool | None, faces: bool
) -> None:
    scene = pit(gap=gap * THICKNESS)
    contact = scene.contact.model_copy(update={"faces": typed})
    assembly = Assembly(scene.model_copy(update={"contact": contact}))
    assert assembly.faces == faces
    halves = {roller.half for roller in assembly.rollers}
    assert halves == {0.5 * THICKNESS if faces else 0.0}


@pytest.mark.parametrize("gap", [THICKNESS, 0.92 * THICKNESS])
def test_a_nip_that_does_not_hold_strip_is_told_and_nothing_gathers(gap: float) -> None:
    """Drawn just closed it presses by the working pressure alone; what is typed closes it.

    With labels that gather all the same foil at 400 N/m took 6 600 tangents for 67.
    """
    scene = pit(FILL, gap=gap)
    assembly = Assembly(scene)
    for nip in assembly.layout.nips[-1]:
        assert nip.line_load(assembly.signorini) * scene.strip.width == pytest.approx(
            nip_force(assembly, nip, nip.squeeze), rel=0.1
        )
    held, bent = assembly.gathered_in(scene.stages[-1])
    assert not held.any() and not bent.any()
    told = [line for line in warnings(Preview.of(assembly)) if "it slips" in line]
    assert len(told) == 2
    settings = [setting for line in told for setting in re.findall(r"--set '([^']*)'", line)]
    closed = Assembly(Scene.from_tables(scene.to_dict(), "pit.toml", settings))
    assert closed.gathered_in(scene.stages[-1])[0][1] == pytest.approx(0.05)
    assert not any("it slips" in line for line in warnings(Preview.of(closed)))


def heavy_elastica(span: float, length: float, slope: float) -> tuple[float, float]:
    """Force along at the bottom (N/m) and depth (m) of strip that hangs between equal slopes.

    θ'' D = H sin θ + V cos θ with V' = −w, of inextensible strip, by collocation.
    """
    weight, bending = DENSITY * 9.81 * THICKNESS, YOUNG * THICKNESS**3 / 12.0 / (1.0 - POISSON**2)

    def rates(s: Any, y: Any, p: Any) -> Any:
        theta, curvature = y[:2]
        moment = p[0] * np.sin(theta) + (p[1] - weight * s) * np.cos(theta)
        return np.array([curvature, moment / bending, np.cos(theta), np.sin(theta)])

    def ends(a: Any, b: Any, _: Any) -> Any:
        return np.array([a[0] + slope, b[0] - slope, a[2], a[3], b[2] - span, b[3]])

    s, sag = np.linspace(0.0, length, 400), np.sqrt(0.375 * span * (length - span))
    z = -4.0 * sag * s * (length - s) / length**2
    theta = np.gradient(z, s)
    guess = np.array([theta, np.gradient(theta, s), s * span / length, z])
    first = [weight * span**2 / 8.0 / sag, 0.5 * weight * length]
    found = solve_bvp(rates, ends, s, guess, p=first, tol=1e-8, max_nodes=50_000)
    assert found.success
    return float(found.p[0]), -float(found.y[3].min())


@pytest.mark.slow
def test_a_loop_hangs_as_heavy_elastica_do() -> None:
    """Its length is what gathered; labels stay, so that it takes some 100 tangents.

    With labels that are carried over the second nip it took 600.  On elements as long as those of
    straight runs the depth is off by 1.1e-3 of itself.
    """
    run = Run(pit(FILL, ON | {"duration": 5.0}))
    steps = list(run)
    states = [step.state for step in steps]
    assert run.outcome.done
    assert steps[-1].tangents < 150
    before = next(state for state in reversed(states) if state.plan.name == "run")
    nips = [label_at(roller, run.assembly.thread) for roller in run.assembly.thread.rollers]
    held, first = (
        np.diff(each.unstressed_length(np.array(nips)))[0] for each in (states[-1], before)
    )
    assert held - first == pytest.approx(0.55, abs=2e-5)
    labels = np.linspace(*nips, 20_001)
    x, _, z = states[-1].way(labels).T
    chords = np.hypot(np.diff(x), np.diff(z))
    assert chords.sum() == pytest.approx(held, abs=1e-4)
    slope = (z[0] - z[40]) / (x[40] - x[0])
    along, depth = heavy_elastica(x[-1] - x[0], chords.sum(), slope)
    assert z[0] - z.min() == pytest.approx(depth, rel=1e-3)
    places, tensions = states[-1].tension_profile
    assert np.interp(labels[z.argmin()], places, tensions) == pytest.approx(along, rel=0.01)
