"""Effects joined to equations: expansions, derivatives, units."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from anmstrip.continuation.expansion import Parameter, expand
from anmstrip.continuation.follow import Settings, follow
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium, Model, Motion
from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import ContactOperator
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.effects import Controls, add_force
from anmstrip.mechanics.laws import NortonHoff, RepulsiveSignorini
from anmstrip.mechanics.loads import edge_force
from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.shell import Membrane, isometric_bending
from anmstrip.timestepping.formulas import AffineVelocity

TENSION, RADIUS = 1e4, 0.5
CONTROLS = {
    "exit.force": np.array([TENSION, 0.0, 0.0]),
    "rollers.r.centre": np.array([0.0, 0.0, -RADIUS - 2e-3]),
    "rollers.r.velocity": np.zeros(3),
    "rollers.r.surface_speed": np.array(0.5),
}
SLOPES = {
    "support": {},
    "force": {"exit.force": np.array([2e3, 0.0, 500.0])},
    "roller": {"rollers.r.centre": np.array([1e-3, 0.0, 3e-3])},
    "speed": {"rollers.r.surface_speed": np.array(0.4)},
}


@cache
def model_of(friction):
    """A tensioned strip above a soft roller that it nearly touches."""
    strip = Strip(
        grid(np.linspace(-1.0, 1.0, 9), np.linspace(-0.3, 0.3, 3)), 1e-3, Material(2e11, 0.3)
    )
    pattern = Pattern(strip)
    contact = Contact(
        Roller("r", RADIUS, (0.0, 0.0, -RADIUS - 2e-3)),
        RepulsiveSignorini(1e6, 1000.0, 1e-2),
        ContactOperator(strip),
    )
    effects = [Membrane(strip), isometric_bending(strip, pattern), contact]
    effects += [Friction(contact, NortonHoff(0.3, 0.3, 0.2, 0.5))] if friction else []
    effects += [edge_force(strip, "exit")]
    return Model(strip, pattern, effects, Scales(2.0, TENSION * 0.6, TENSION))


def equations_of(moving, friction=False):
    """The entry held in x and z, its middle in y, the exit pulled; one thing moves."""
    model = model_of(friction)
    strip = model.strip
    edge = strip.edges["entry"]
    held = [3 * d + c for d in edge.trace for c in (0, 2)]
    held = np.array([*held, 3 * edge.values[1] + 1])
    slope = np.zeros(strip.unknowns)
    if moving == "support":
        slope[3 * edge.values + 2] = -5e-3
    supports = replace(Supports.at_rest(strip.unknowns, held), slope=slope)
    n = len(supports.free)
    velocity = None
    if friction:
        rng = np.random.default_rng(5)
        lengths = model.units[supports.free]
        base, ramp = 0.1 * rng.standard_normal((2, n)) * lengths
        velocity = AffineVelocity(20.0, base, ramp)
    return Equilibrium(model, supports, Controls(CONTROLS, SLOPES[moving]), velocity)


@cache
def start_of(moving, friction=False):
    """A state in equilibrium at λ = 0."""
    equations = equations_of(moving, friction)
    u = np.zeros(len(equations.supports.free))
    u += 1e-6 * np.random.default_rng(1).standard_normal(len(u)) / equations.free_units
    solver = SparseSolver()
    for _ in range(30):
        series = equations.recurrence(u, 0.0, 1)
        if equations.imbalance(series.residual) < 1e-10:
            return equations, u
        u = u - solver.factorise(series.tangent()).solve(series.residual)
    raise AssertionError("no equilibrium")


CASES = [(m, f) for f in (False, True) for m in SLOPES if f or m != "speed"]


@pytest.mark.parametrize(("moving", "friction"), CASES)
@pytest.mark.parametrize("order", [3, 6])
def test_residual_along_a_branch_is_of_the_next_order(moving, friction, order):
    equations, u = start_of(moving, friction)
    branch = expand(equations, u, 0.0, order=order, solver=SparseSolver(), parameter=Parameter(1.0))
    assert branch.order == order
    lengths = reach(equations, branch) * 0.5 ** np.arange(3)
    found = [equations.imbalance(equations.residual(*branch(a))) for a in lengths]
    assert found[-1] > 1e-9
    rates = np.log2(np.divide(found[:-1], found[1:]))
    assert rates[-1] == pytest.approx(order + 1, abs=0.5), (found, lengths)


def reach(equations, branch):
    """Length at which the residual is a thousandth: above round-off, in the range of the series."""
    a = 64.0
    while equations.imbalance(equations.residual(*branch(a))) > 1e-3:
        a *= 0.9
    return a


@pytest.mark.parametrize(("moving", "friction"), CASES)
def test_control_derivative_is_that_of_the_residual(moving, friction):
    equations, u = start_of(moving, friction)
    u = u + 1e-5 * np.random.default_rng(3).standard_normal(len(u)) / equations.free_units
    found = equations.recurrence(u, 0.2, 1).control_derivative()
    step = 1e-3
    expected = (equations.residual(u, 0.2 + step) - equations.residual(u, 0.2 - step)) / (2 * step)
    assert equations.imbalance(expected) > 1e-5
    assert equations.imbalance(found - expected) < 1e-5 * equations.imbalance(expected)


@pytest.mark.parametrize("rate", [0.0, 1.0, 1e3])
def test_friction_tangent_has_its_velocity_part(rate):
    """∂R/∂u + rate ∂R/∂v, of friction alone: elasticity would hide it."""
    equations, u = start_of("speed", True)
    full = equations.model
    friction = [effect for effect in full.effects if isinstance(effect, Friction)]
    model = Model(full.strip, full.pattern, friction, full.scales)
    velocity = replace(equations.velocity, rate=rate)
    alone = Equilibrium(model, equations.supports, equations.controls, velocity)
    tangent = alone.recurrence(u, 0.4, 1).tangent()
    held = AffineVelocity(0.0, velocity(u, 0.4), np.zeros_like(u))
    frozen = Equilibrium(model, equations.supports, equations.controls, held)
    still = frozen.recurrence(u, 0.4, 1).tangent()
    assert (abs(tangent - still).max() > 1e-6 * abs(tangent).max()) == (rate > 0.0)
    for seed in (6, 7):
        direction = np.random.default_rng(seed).standard_normal(len(u)) / equations.free_units
        step = 1e-6 / max(rate, 1.0)
        ahead, back = (alone.residual(u + s * direction, 0.4) for s in (step, -step))
        expected, found = (ahead - back) / (2 * step), tangent @ direction
        assert alone.imbalance(found - expected) < 1e-6 * alone.imbalance(expected)


def test_what_moves_with_the_supports_is_seen_by_friction():
    """Velocity of held unknowns: a strip pushed at the roller's speed does not slip there."""
    model, still = model_of(True), equations_of("speed", True)
    moving = np.zeros(model.strip.unknowns)
    moving[3 * model.strip.edges["entry"].values] = 7.0
    velocity = AffineVelocity(0.0, np.zeros(len(still.supports.free)), still.velocity.slope * 0.0)
    equations = Equilibrium(model, still.supports, still.controls, velocity, moving)
    full = equations.full_velocity(np.zeros_like(velocity.base), 0.0)
    np.testing.assert_array_equal(full, moving)


def test_motion_puts_supports_and_controls_in_time():
    """A step from t to t + h of a stage: λ = 0 and 1 are the stage's values there."""
    base = equations_of("support", True)
    controls = Controls(CONTROLS, SLOPES["roller"] | SLOPES["force"])
    motion = Motion(base.model, base.supports, controls, start=2.0, duration=4.0)
    zero = np.zeros(len(base.supports.free))
    step = motion.during(3.0, 0.5, AffineVelocity(1.0, zero, zero), zero)
    for control, share in ((0.0, 0.25), (1.0, 0.375), (0.5, 0.3125)):
        for name, value in controls.at(share).items():
            np.testing.assert_allclose(step.controls.at(control)[name], value)
        np.testing.assert_allclose(
            step.supports.full(zero, control), base.supports.full(zero, share), atol=1e-18
        )
    np.testing.assert_allclose(step.moving, base.supports.slope / 4.0)


def test_drag_takes_its_power_from_a_rigid_motion():
    """c v² A, with c = T τ/L²."""
    base = equations_of("support", True)
    controls = Controls(CONTROLS)
    motion = Motion(base.model, base.supports, controls, start=2.0, duration=4.0)
    free = np.ones(len(base.supports.free))
    dragged = motion.dragged(2.0, free, free, time=1e-3)
    rigid = np.zeros(base.model.strip.unknowns)
    rigid[3 * base.model.strip.node_values] = 0.7
    state = np.zeros_like(rigid), rigid, controls, 0.0
    left = dragged.model.force(*state) - base.model.force(*state)
    assert rigid @ left == pytest.approx(TENSION * 1e-3 / 2.0**2 * 0.7**2 * 1.2, rel=1e-6)
    assert motion.dragged(2.0, free, 0.0 * free, time=1e-3) is None


@pytest.mark.parametrize("friction", [False, True])
def test_effects_report_their_time_and_their_need_of_velocity(friction):
    model = model_of(friction)
    assert (model.without_rates is model) is not friction
    names = ["membrane", "bending", "contact", "friction", "force on exit"]
    assert list(model.seconds) == [n for n in names if friction or "friction" not in n]
    before = dict(model.seconds)
    equations = equations_of("force", friction)
    equations.recurrence(np.zeros(len(equations.supports.free)), 0.0, 3).tangent()
    assert all(model.seconds[name] > before[name] for name in before if "force" not in name)


def test_tension_error_is_the_change_of_the_membrane_force():
    """A uniform stretch by ε makes (E t ε, 0, 0) in a strip free to contract."""
    model = model_of(False)
    strip, strain = model.strip, 1e-5
    change = np.zeros((strip.scalars, 3))
    change[strip.node_values, 0] = strain * strip.mesh.p[0]
    change[strip.node_values, 1] = -0.3 * strain * strip.mesh.p[1]
    change[strip.basis.nodal_dofs[1], 0], change[strip.basis.nodal_dofs[2], 1] = (
        strain,
        -0.3 * strain,
    )
    found = model.tension_error(np.zeros(strip.unknowns), change.ravel())
    assert found == pytest.approx(2e11 * 1e-3 * strain / TENSION)


POWERS = {
    **dict.fromkeys(("length", "width", "thickness", "radius", "centre", "move"), (1, 0)),
    **dict.fromkeys(("delta", "speed", "surface_speed"), (1, 0)),
    **dict.fromkeys(("young", "eta"), (-2, 1)),
    "stiffness": (-3, 1),
    "force": (-1, 1),
}
"""Powers of length and force in the quantities of a scene."""


def converted(inside, length, force, key=""):
    """The same scene with numbers in other units, so many to the metre and newton."""
    if isinstance(inside, dict):
        return {k: converted(v, length, force, k) for k, v in inside.items()}
    if isinstance(inside, list):
        return [converted(v, length, force, key) for v in inside]
    if key not in POWERS:
        return inside
    lengths, forces = POWERS[key]
    return inside * length**lengths * force**forces


def wrapping(friction):
    scene = {
        "strip": {"length": 3.0, "width": 1.0, "thickness": 1e-3, "cells": [16, 2]},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {"stiffness": 1e8, "eta": 100.0, "delta": 1e-3},
        "rollers": [{"radius": 0.5, "centre": [0.0, 0.0, -0.501], "axis": [0.0, 1.0, 0.0]}],
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
        "stages": [
            {"duration": 1.0, "friction": False, "exit": {"force": [1e4, 0.0, 0.0]}},
            {"duration": 1.0, "friction": False, "entry": {"move": [0.0, 0.0, -0.02]}},
        ],
        "solver": {"tolerance": 1e-4},
    }
    if friction:
        scene["friction"] = {
            "law": "norton-hoff",
            "coefficient": 0.3,
            "exponent": 0.1,
            "omega": 0.1,
            "speed": 1.0,
        }
        scene["stages"].append({"duration": 0.02, "rollers": {"r1": {"surface_speed": 1.0}}})
    else:
        for stage in scene["stages"]:
            del stage["friction"]
    return scene


@pytest.mark.parametrize(
    ("friction", "force"), [(False, 1e-3), (True, 1.0)], ids=["mm and kN", "mm and N"]
)
def test_units_do_not_matter(friction, force):
    """Round-off alone differs: the same steps, and the same answer to 1e-9."""
    runs = []
    for scene in (wrapping(friction), converted(wrapping(friction), 1e3, force)):
        run = Scene.model_validate(scene).run()
        runs.append((run, list(run)))
        assert run.outcome.done, run.message
    (metres, first), (millimetres, second) = runs
    assert len(first) == len(second)
    assert first[-1].tangents == second[-1].tangents > 3
    np.testing.assert_allclose([s.time for s in second], [s.time for s in first], rtol=1e-6)
    units = np.repeat(metres.assembly.strip.dof_lengths, 3)
    ours = metres.march.full / units
    theirs = millimetres.march.full / np.repeat(millimetres.assembly.strip.dof_lengths, 3) * 1e-3
    assert np.abs(ours - theirs).max() < 1e-9 * np.abs(ours).max()
    assert second[-1].tension_ratio == pytest.approx(first[-1].tension_ratio, rel=1e-8)


def test_arclength_does_not_depend_on_units():
    """The metric of positions is in lengths, so the same branches are as long."""
    lengths = []
    for unit in (1.0, 1e3):
        strip = Strip(
            grid(unit * np.linspace(0, 1, 5), unit * np.array([0, 0.2])),
            1e-3 * unit, Material(2e11 / unit**2, 0.3),
        )  # fmt: skip
        pattern = Pattern(strip)
        effects = [Membrane(strip), isometric_bending(strip, pattern), edge_force(strip, "exit")]
        model = Model(strip, pattern, effects, Scales(unit, 12.0, 60.0 / unit))
        load = {"exit.force": np.array([0.0, 0.0, 60.0 / unit])}
        equations = Equilibrium(
            model,
            Supports.at_rest(strip.unknowns, strip.clamp("entry")),
            Controls({"exit.force": np.zeros(3)}, load),
        )
        u = np.zeros(len(equations.supports.free))
        settings = Settings(tolerance=1e-4, arclength=True)
        steps = list(follow(equations, u, solver=SparseSolver(), settings=settings))
        lengths.append([step.branch.length for step in steps])
    assert len(lengths[0]) > 1
    np.testing.assert_allclose(lengths[1], lengths[0], rtol=2e-3)


def test_forces_are_remembered_for_the_latest_states_and_no_others(monkeypatch) -> None:
    model, asked = model_of(True), []
    monkeypatch.setattr(
        "anmstrip.equilibrium.add_force", lambda *given: asked.append(given[0]) or add_force(*given)
    )
    full, velocity = np.random.default_rng(0).normal(0.0, 1e-4, (2, model.unknowns))
    controls, stiller = Controls(CONTROLS, SLOPES["roller"]), Controls(CONTROLS)
    first = model.force(full, velocity, controls, 0.5)
    assert len(asked) == len(model.effects)
    np.testing.assert_array_equal(
        model.force(full.copy(), velocity.copy(), controls, 0.5), first, strict=True
    )
    assert len(asked) == len(model.effects)
    others = [
        (full + 1e-6, velocity, controls, 0.5),
        (full, velocity + 1e-3, controls, 0.5),
        (full, velocity, controls, 0.25),
        (full, velocity, stiller, 0.5),
    ]
    assert not any(np.array_equal(model.force(*other), first) for other in others)
    assert len(asked) == 5 * len(model.effects)
    np.testing.assert_array_equal(model.force(full, velocity, controls, 0.5), first)
