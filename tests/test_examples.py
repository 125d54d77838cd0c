"""The scenes of examples/ keep what their headers promise (slow: full meshes)."""

from __future__ import annotations

import runpy
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from anmstrip import Scene
from anmstrip.driver.run import Run, Step
from anmstrip.results.fields import FieldSampler
from claims import Claim

EXAMPLES = Path(__file__).parent.parent / "examples"

pytestmark = pytest.mark.slow


def ended(name: str, *settings: str) -> tuple[Run, Step]:
    """Run a scene in memory to its end."""
    run = Scene.load(EXAMPLES / name, settings).run()
    *_, last = run
    assert run.outcome.done, run.message
    return run, last


def edge_angle(step: Step) -> float:
    """Angle between the forces on both edges, the wrap of a perfectly flexible strip."""
    entry, end = step.state.edge_force("entry"), step.state.edge_force("exit")
    return float(np.arctan2(-end[2], end[0]) + np.arctan2(-entry[2], -entry[0]))


def test_capstan_ratio_on_its_own_mesh(claim: Claim) -> None:
    """Euler–Eytelwein with bending: within 0.05 %."""
    run, last = ended("capstan.toml")
    reading, scene = last.state.rollers["r1"], run.scene
    f = run.assembly.friction.effective(reading.creep_speed)
    assert f == pytest.approx(0.298585, rel=1e-5)
    bending = run.assembly.strip.bending_stiffness / (2.0 * scene.rollers[0].radius ** 2)
    bending *= 1.0 + scene.friction.coefficient**2
    exponent = f * edge_angle(last)
    exponent -= bending * (1.0 / reading.tension_out - 1.0 / reading.tension_in)
    claim(
        "tension ratio of `capstan.toml`",
        reading.tension_ratio,
        np.exp(exponent),
        5e-4,
        "capstan formula with bending",
    )


@pytest.mark.parametrize(("element", "bound"), [(0.1, 1e-3), (0.025, 1.5e-4)])
def test_capstan_ratio_converges(element: float, bound: float, claim: Claim) -> None:
    """The figure of the README, and seven times as much on elements four times as long."""
    script = runpy.run_path(str(EXAMPLES / "capstan_convergence.py"))
    ratio, formula, _ = script["tension_ratio"](element)
    quantity = f"tension ratio in full slip, elements of {element:g} m over the roller"
    claim(quantity, ratio, formula, bound, "capstan formula with bending")


def test_press_pressure_and_lift_off(claim: Claim) -> None:
    """Beam on a smooth cylinder: p = (T − D/2R²)/R, lift-off 2 asin(√(D/T)/2R) early."""
    run, last = ended("press.toml")
    state, radius = last.state, run.scene.rollers[0].radius
    contact = state.contacts["r1"]
    tension = np.linalg.norm(state.edge_force("exit"))
    bending = run.assembly.strip.bending_stiffness
    pressure = (tension - bending / (2.0 * radius**2)) / radius
    angle = np.arctan2(contact.normal[0], contact.normal[2])
    x = contact.contact.operator.reference[0]
    interior = np.abs(angle - 0.04) < 0.2
    lines = np.unique(np.round(x[interior], 9))
    assert len(lines) > 10
    means: list[float] = []
    for line in lines:
        on = np.isclose(x, line)
        mean = np.average(contact.pressure[on], weights=contact.area[on])
        assert mean == pytest.approx(pressure, rel=0.02)
        means.append(mean)
    claim(
        "mean pressure in the arc of `press.toml` (Pa)",
        np.mean(means),
        pressure,
        0.02,
        "beam on a rigid cylinder, (T − D/2r²)/r",
    )
    lift_off = 2.0 * np.arcsin(np.sqrt(bending / tension) / (2.0 * radius))
    element = run.scene.strip.refined / radius
    expected = edge_angle(last) - 2.0 * lift_off
    assert state.rollers["r1"].wrap == pytest.approx(expected, abs=2.0 * element)
    assert state.velocity is None
    assert not any("friction" in name for name in run.effects)


def test_convey_moves_at_the_rollers_speed(claim: Claim) -> None:
    """Some centimetres of the conveying scene: speed of the strip, tension ratio, cone."""
    run, last = ended("convey.toml", "strip.refined=0.1", "stages.convey.duration=0.05")
    entry = run.assembly.strip.edges["entry"].values
    speed = np.linalg.norm(last.state.velocity.reshape(-1, 3)[entry], axis=1)
    np.testing.assert_allclose(speed, 1.0, rtol=2e-3)
    reading = last.state.rollers["r1"]
    claim(
        "tension ratio of `convey.toml`",
        reading.tension_ratio,
        1.0 / 0.95,
        2e-3,
        "forces on the two ends",
    )
    assert 0.0 < reading.creep_speed < 1e-4
    assert reading.cone_violation < 0.05


def test_series_costs_less_than_the_linear_algebra_allows() -> None:
    """80 × 10 elements: one factorisation per expansion; series ≤ 1.5 × the rest."""
    sizes = ("strip.cells=[80, 10]", "strip.refined=0.05")
    run = Scene.load(EXAMPLES / "capstan.toml", sizes).run()
    steps = list(islice(run, 12))
    assert len(steps) == 12
    assert run.assembly.strip.unknowns == 10692
    assert run.cost.factorisations == run.cost.expansions
    seconds = run.cost.seconds
    algebra = sum(seconds[k] for k in ("tangent", "factorisation", "back-substitution"))
    assert seconds["series"] < 1.5 * algebra


def test_heavy_strip_hangs_in_a_catenary(claim: Claim) -> None:
    """H = w a with a = 28.671 m; lowest point at z = −0.420 m; the exit rises by 47 mm."""
    run, last = ended("heavy.toml")
    state, strip = last.state, run.assembly.strip
    pull = -(state.edge_force("entry") + state.rollers["left"].resultant)[0]
    weight = strip.material.density * strip.thickness * 9.81
    claim("horizontal tension of `heavy.toml` (N)", pull, 28.671 * weight, 4e-5, "catenary")
    moved = state.full.reshape(-1, strip.count)
    x = strip.mesh.p[0] + moved[strip.node_values, 0] + strip.origin[0]
    z = moved[strip.node_values, 1] + strip.origin[2]
    between = (x > 2.0) & (x < 8.0)
    assert between.sum() > 10
    claim("lowest point of `heavy.toml` (m)", z[between].min(), -0.420, 2e-3, "catenary")
    ends = strip.edges["exit"].values
    assert moved[ends, 1] + strip.origin[2] == pytest.approx(-3.0 + 0.047, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "strict", "looser"), [("heavy.toml", 1e-9, 1e-6), ("bridle.toml", 1e-7, 1e-5)]
)
def test_tolerances_near_round_off_are_reached(name: str, strict: float, looser: float) -> None:
    """Steps balance forces as far as the last digits of positions allow, and no further."""
    tensions = []
    for tolerance in (strict, looser):
        _, last = ended(name, f"solver.tolerance={tolerance:g}")
        tensions.append(last.state.tension("entry"))
    assert tensions[0] == pytest.approx(tensions[1], rel=looser)


def test_small_deflection_is_that_of_linear_theory(claim: Claim) -> None:
    """Sag s = q l²/2T − q λ²/T (1 − 1/cosh(l/λ)), then F = 2 T (30 mm + s)/(l − λ tanh(l/λ))."""
    run = Scene.load(EXAMPLES / "small_deflection.toml").run()
    ends = {step.stage: step.state for step in run}
    assert run.outcome.done, run.message
    strip, pull, span = run.assembly.strip, 1.0e4, 2.0
    load = strip.material.density * strip.thickness * 9.81
    layer = np.sqrt(strip.bending_stiffness / pull)
    sag = load * span**2 / 2.0 - load * layer**2 * (1.0 - 1.0 / np.cosh(span / layer))
    sag /= pull
    middle = strip.node_values[np.abs(strip.mesh.p[0]) < 1e-9]
    # on the middle line: the width is free to bend across, which the formula leaves out
    sunk = ends["weight"].full[middle].mean()
    claim(
        "sag of `small_deflection.toml` (m)", sunk, -sag, 2e-3, "linear theory of a stretched beam"
    )
    force = 2.0 * pull * (0.030 + sag) / (span - layer * np.tanh(span / layer))
    lifting = ends["lift"].rollers["r1"].normal_force
    claim("force that lifts it (N)", lifting, force, 1e-3, "linear theory of a stretched beam")


def test_levelling_rollers_take_their_share(claim: Claim) -> None:
    """ln(T_exit/T_entry) = f_eff Σθ, a belt's around R + D/2TR; each takes f_eff of its force."""
    run, last = ended("levelling.toml")
    f, thread = run.assembly.friction.effective(0.5), run.assembly.thread
    bent = run.assembly.strip.bending_stiffness / (2.0 * thread.tension * 0.1)
    turns = sum(replace(thread, depths=thread.depths + bent).turns.values())
    assert turns == pytest.approx(1.3, rel=0.02)
    ratio = last.state.tension("exit") / last.state.tension("entry")
    claim(
        "logarithm of the tension ratio of `levelling.toml`",
        np.log(ratio),
        f * turns,
        0.02,
        "belt friction over seven arcs",
    )
    assert len(last.state.rollers) == 7
    for reading in last.state.rollers.values():
        assert abs(reading.drag) == pytest.approx(f * reading.normal_force, rel=2e-3)


@pytest.mark.parametrize(("across", "bound"), [(8, 0.07), (16, 0.03)])
@pytest.mark.parametrize(
    ("scene", "tensions"),
    [
        ("crowned", {0.0: 23.6e3, 0.25: 20.9e3, 0.375: 16.9e3}),
        ("tapered", {0.0: 22.4e3, 0.125: 22.7e3, 0.375: 16.7e3}),
    ],
)
def test_profile_makes_the_middle_carry_more(
    scene: str, tensions: dict[float, float], across: int, bound: float
) -> None:
    """On the roller as on 32 elements across, closer on more of them; symmetric; nothing rubs."""
    run, last = ended(f"{scene}.toml", f"strip.cells=[24, {across}]")
    strip, state = run.assembly.strip, last.state
    surface = FieldSampler(strip)
    force = surface.sample(state)["membrane_force"][:, 0]
    x, y, _ = surface.reference
    on = np.abs(x) < 0.1
    for place, expected in tensions.items():
        for side in (place, -place):
            line = on & np.isclose(y, side)
            assert line.sum() > 10
            assert force[line].mean() == pytest.approx(expected, rel=bound)
    assert state.tension("entry") == pytest.approx(state.tension("exit"), rel=1e-5)


def test_looper_gives_off_strip(claim: Claim) -> None:
    """Every run gets shorter by the stroke; idlers follow, and take M/(r W) each."""
    run, last = ended("looper.toml")
    readings, rate = last.state.rollers, 1.5 / 5.0
    for k, reading in enumerate(readings.values()):
        assert reading.surface_speed == pytest.approx(k * rate, abs=1e-4)
        expected = 8e3 - 40.0 * (4 - max(k - 1, 0)) if k else 8e3 - 160.0
        assert reading.tension_in == pytest.approx(expected, abs=2.0)
    strip = last.state.plan.model.strip
    edge = strip.nodal(last.state.material_velocity)[strip.edges["exit"].values]
    claim("strip that leaves `looper.toml` (m/s)", edge[0, 0], 4.0 * rate, 2e-3, "kinematics")
    given_off = -run.facts()["feed"]["taken_up"]
    claim("strip that `looper.toml` gives off (m)", given_off, 6.0, 2e-3, "kinematics")
    assert run.cost.expansions < 110


def test_line_settles_with_the_torques_of_its_bearings(claim: Claim) -> None:
    """Stick on the drives, M/(r W) on every idler, and together the drag of all bearings."""
    run, last = ended("line.toml")
    state, readings = last.state, last.state.rollers
    assert run.cost.expansions <= 15  # threading included
    assert state.tension("entry") == pytest.approx(1e4, rel=1e-5)
    assert state.tension("exit") == pytest.approx(1e4, rel=1e-5)
    assert state.strip_speed == pytest.approx(1.99985, abs=2e-5)
    stretched = run.assembly.strip.tensile_stiffness * (2.0 / state.strip_speed - 1.0)
    drives = [readings[name] for name in ("r1", "r20", "r40")]
    for drive, torque in zip(drives, (607.0, 160.0, -469.0), strict=True):
        assert drive.tension_in == pytest.approx(stretched, rel=0.01)
        assert drive.torque == pytest.approx(torque, abs=5.0)
    idlers = [reading for reading in readings.values() if reading not in drives]
    assert len(idlers) == 37
    for idler in idlers:
        assert idler.torque == pytest.approx(-8.0, abs=0.05)  # a tenth of the tolerance
        step = idler.tension_out - idler.tension_in
        assert step == pytest.approx(8.0 / 0.4 / 1.2, abs=1.0)  # the tolerance, of 10 kN/m
    together = sum(drive.torque for drive in drives)
    claim(
        "torque of the drives of `line.toml` (N m)",
        together,
        37 * 8.0,
        0.01,
        "drag of all bearings",
    )


def test_belt_drive_has_the_published_tensions_and_speeds(claim: Claim) -> None:
    """To half a per cent of 245 000 time steps with inertia, and to 0.05 % of a string."""
    script = runpy.run_path(str(EXAMPLES / "belt.py"))
    run, last = script["settled"]([])
    strip, values = run.assembly.strip, script["found"](run, last)
    stiffness = strip.tensile_stiffness * strip.width
    torque = -last.state.rollers["driven"].torque
    assert torque == pytest.approx(25.0 + 2.0 * 12.0 / values["ratio"], rel=1e-5)
    theory = script["string_theory"](
        run.scene, strip.length, torque, lambda force: 1.0 + force / stiffness
    )
    assert run.cost.expansions <= 45
    published = script["PUBLISHED"]
    names = {"tight": "tight strand", "slack": "slack strand", "arc": "slip arc (rad)"}
    names["ratio"] = "ratio of speeds"
    for key, name in names.items():
        assert values[key] == pytest.approx(theory[key], rel=6e-4)
        claim(f"{name} of `belt.py`", values[key], published[key], 5e-3, "Exudyn, 245 000 steps")
    arc = np.log(published["tight"] / published["slack"]) / run.scene.friction.coefficient
    assert arc == pytest.approx(published["arc"], abs=5e-4)  # theirs too is of the tensions
    # friction is above 0.95 of its limit on less of it
    assert last.state.rollers["driving"].slip_arc == pytest.approx(values["arc"], rel=0.04)


def steered_over_shelton(run: Run, last: Step) -> tuple[float, float, float]:
    """Offset of the middle line where the strip comes to bear (m), over angle and span, by Shelton.

    y_L/(θ L) = (KL cosh KL − sinh KL)/(KL (cosh KL − 1)), KL = L √(T/E I_z).
    """
    state, strip = last.state, run.assembly.strip
    values, middle = strip.nodal(state.full)[strip.node_values], np.abs(strip.mesh.p[1]) < 1e-9
    x = strip.mesh.p[0, middle] + values[middle, 0]
    tension, width = 4.4e4, run.scene.strip.width
    length = 2.0 + np.sqrt(strip.bending_stiffness / tension)
    kl = length * np.sqrt(tension * width / (strip.tensile_stiffness * width**3 / 12.0))
    expected = (kl * np.cosh(kl) - np.sinh(kl)) / (kl * (np.cosh(kl) - 1.0))
    assert expected == pytest.approx(0.6782, abs=1e-4)
    y = float(np.interp(x.min() + length, np.sort(x), values[middle, 1][np.argsort(x)]))
    return y, -y / (1e-3 * length), float(expected)


def test_steering_is_that_of_shelton(claim: Claim) -> None:
    """To 0.2 %."""
    run, last = ended("steering.toml")
    y, found, expected = steered_over_shelton(run, last)
    claim("offset over angle and span of `steering.toml`", found, expected, 2e-3, "Shelton (1968)")
    reading = last.state.rollers["r1"]
    sideways = abs(reading.resultant @ [1e-3, 1.0, 0.0]) / reading.normal_force  # no normal has it
    around = abs(reading.drag) / reading.normal_force
    assert reading.capacity_used == pytest.approx(np.hypot(sideways, around) / 0.3, rel=0.01)
    assert sideways > 5.0 * around
    assert y == pytest.approx(-1.370e-3, rel=2e-3)
    assert last.state.strip_speed == pytest.approx(0.99978, abs=1e-5)
    assert run.cost.expansions <= 26


@pytest.mark.parametrize(
    ("cells", "refined", "poisson"), [("[24, 2]", 0.001, 0.3), ("[24, 10]", 0.02, 0.0)]
)
def test_a_shell_of_ten_thousand_unknowns_is_steered_in_twenty_tangents(
    claim: Claim, cells: str, refined: float, poisson: float
) -> None:
    """Threading included; fine along or across.

    Without Poisson's effect, for ten elements across see the edges curl up over the roller, which
    moves the line where the strip comes to bear, and beams do not have.
    """
    mesh = f"strip.cells={cells}", f"strip.refined={refined}", f"material.poisson={poisson}"
    run, last = ended("steering.toml", *mesh)
    assert run.assembly.strip.unknowns >= 10_000
    assert run.cost.expansions <= 20
    _, found, expected = steered_over_shelton(run, last)
    quantity = f"the same with 10 000 unknowns, cells = {cells}"
    claim(quantity, found, expected, 2e-3, "Shelton (1968)")
