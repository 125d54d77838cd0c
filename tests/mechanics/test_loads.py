"""Loads that follow the strip, and plates under tension: closed forms."""

import numpy as np
import pytest

from anmstrip.continuation.follow import Settings, follow
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.geometry import SECTION
from anmstrip.fem.operators import CellOperator, Pattern
from anmstrip.fem.strip import Scales, Supports
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.loads import Pretension, edge_force, edge_tension, pressure, weight
from anmstrip.mechanics.shell import Membrane, isometric_bending
from levels import XS, YS, effect_of, free_equations, random_unknowns, strip_of
from shapes import linear, rolled

FINE = np.linspace(-0.5, 0.5, 41)


def total(strip, force):
    """Resultant in space of generalised forces, shape (3,)."""
    values = force.reshape(-1, strip.count)[strip.dofs("u")].sum(axis=0)
    return strip.kinematics.embed(values)


def bent(level, radius, xs=FINE):
    """A strip and its unknowns, bent over a cylinder whose top is the origin."""
    strip = strip_of(level, xs=xs)
    shell = strip_of("shell", xs=xs)
    if level == "shell":
        return strip, rolled(strip, radius)
    whole = rolled(shell, radius).reshape(-1, 3)
    u = np.zeros((strip.scalars, 2))
    row = np.isclose(shell.mesh.p[1], YS[0])
    for kind in ("u", "u_x"):
        chosen = shell.dofs(kind)[row][np.argsort(shell.mesh.p[0][row])]
        u[strip.dofs(kind)[np.argsort(strip.mesh.p[0])]] = SECTION.pick(whole[chosen])
    return strip, u.ravel()


@pytest.mark.parametrize("level", ["shell", "section"])
@pytest.mark.parametrize("radius", [0.2, 1.0])
def test_pressure_on_an_arc(level, radius):
    """∫ p n dA over a cylinder of half angle α = L/2R: 2 p R sin α per width, outwards."""
    strip, full = bent(level, radius)
    equations = free_equations(strip, [pressure(strip)], Controls({"pressure": np.array(3e3)}))
    found = -total(strip, equations.residual(full, 0.0))
    exact = 2.0 * 3e3 * radius * np.sin(0.5 / radius) * strip.width
    np.testing.assert_allclose(found, [0.0, 0.0, exact], rtol=1e-6, atol=1e-9 * abs(exact))


@pytest.mark.parametrize("level", ["shell", "section", "plate"])
def test_pressure_lifts_a_flat_strip(level):
    strip = strip_of(level)
    equations = free_equations(strip, [pressure(strip)], Controls({"pressure": np.array(2.0)}))
    found = -total(strip, equations.residual(np.zeros(strip.unknowns), 0.0))
    np.testing.assert_allclose(found, [0.0, 0.0, 2.0 * np.ptp(XS) * np.ptp(YS)], atol=1e-12)


def test_pressure_sees_the_deformed_area():
    """Twice as long, three times as wide: six times the force, along the turned normal."""
    strip = strip_of("shell")
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    full = linear(strip, turn @ np.diag([2.0, 3.0, 1.0]))
    equations = free_equations(strip, [pressure(strip)], Controls({"pressure": np.array(1.0)}))
    found = -total(strip, equations.residual(full, 0.0))
    np.testing.assert_allclose(found, [6.0 * np.ptp(XS) * np.ptp(YS), 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("level", ["shell", "section"])
@pytest.mark.parametrize(("name", "sign"), [("entry", -1.0), ("exit", 1.0)])
def test_tension_points_along_the_strip(level, name, sign):
    """A unit per width, away from the strip, however much that is stretched or turned."""
    strip, full = bent(level, 0.3)
    effect = edge_tension(strip, name)
    equations = free_equations(strip, [effect], Controls({f"{name}.tension": np.array(1.0)}))
    found = -total(strip, equations.residual(full, 0.0))
    angle = sign * 0.5 / 0.3
    expected = sign * np.array([np.cos(angle), 0.0, -np.sin(angle)]) * strip.width
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert not np.any(free_equations(strip, [effect_of("exit", strip)], Controls(
        {"exit.tension": np.array(0.0)})).residual(full, 0.0))  # fmt: skip


def test_tension_of_a_straight_edge_is_the_dead_force():
    strip = strip_of("shell")
    follower = free_equations(
        strip, [edge_tension(strip, "exit")], Controls({"exit.tension": np.array(5.0)})
    )
    dead = free_equations(
        strip, [edge_force(strip, "exit")], Controls({"exit.force": np.array([5.0, 0.0, 0.0])})
    )
    flat = linear(strip, np.diag([1.5, 0.9, 1.0]))
    np.testing.assert_allclose(follower.residual(flat, 0.0), dead.residual(flat, 0.0), atol=1e-12)


def solved(strip, effects, controls, held, full=None):
    """Equilibrium at the end of the controls' way."""
    model = Model(strip, Pattern(strip), effects, Scales(1.0, 1e3, 1e3))
    supports = Supports.at_rest(strip.unknowns, held)
    equations = Equilibrium(model, supports, controls)
    u = np.zeros(strip.unknowns) if full is None else full
    steps = follow(equations, u[supports.free], solver=SparseSolver(),
                   settings=Settings(tolerance=1e-10))  # fmt: skip
    *_, last = steps
    end, control = last.branch.end
    return supports.full(end, control), model


@pytest.mark.parametrize("level", ["section", "shell"])
def test_inflated_strip_is_an_arc(level):
    """Without bending, the tension T along the end and the pressure p: p R = T, z held.

    Nothing but the pressure acts across the way, so the supports in z carry its whole
    resultant less that of the tension, nothing: the arc has the angle that T gives it.
    """
    strip = strip_of(level, xs=FINE, poisson=0.0)
    tension, p = 5e3, 8e3
    held = [strip.unknowns_of(strip.edges["entry"].trace)]
    place = strip.kinematics.place(2)
    held.append(strip.count * strip.edges["exit"].trace + place)
    if level == "shell":
        held.append(strip.count * strip.edges["exit"].trace + 1)
    held = np.unique(np.concatenate(held))
    stretch = linear_stretch(strip, tension)
    controls = Controls(
        {"exit.tension": np.array(tension), "pressure": np.array(0.0)}, {"pressure": np.array(p)}
    )
    effects = [Membrane(strip), edge_tension(strip, "exit"), pressure(strip)]
    full, model = solved(strip, effects, controls, held, stretch)
    at = strip.in_space(strip.mesh.p) + strip.kinematics.embed(
        full.reshape(-1, strip.count)[strip.dofs("u")].T
    )
    radius, chord = tension / p, np.ptp(at[0])
    assert at[2].max() == pytest.approx(radius - np.sqrt(radius**2 - (0.5 * chord) ** 2), rel=1e-4)
    middle = np.array([at[0].mean(), at[2].max() - radius])
    np.testing.assert_allclose(np.hypot(*(at[[0, 2]] - middle[:, None])), radius, rtol=1e-4)
    reaction = model.force(full, None, controls, 1.0).reshape(-1, strip.count)
    up = reaction[strip.edges["exit"].values][:, place].sum()
    assert abs(up) < 1e-4 * tension * strip.width


def linear_stretch(strip, tension):
    """Uniformly stretched from the entry on by T = E t E √(1 + 2E)."""
    strain = tension / strip.tensile_stiffness
    strain -= 1.5 * strain**2 - 0.5 * strain**2
    u = np.zeros((strip.scalars, strip.count))
    u[strip.dofs("u"), 0] = strain * (strip.mesh.p[0] + 0.5)
    u[strip.dofs("u_x"), 0] = strain
    return u.ravel()


@pytest.mark.parametrize("bends", [True, False])
def test_plate_that_sags_under_tension(bends):
    """T w'' − D w'''' = q between hinges, with a layer √(D/T) at them; T w'' = q without D."""
    strip = strip_of("plate", xs=np.linspace(-0.5, 0.5, 81), poisson=0.0)
    tension, d = 5e4, strip.bending_stiffness
    pattern = Pattern(strip)
    effects = [Pretension(strip), weight(strip)]
    effects += [isometric_bending(strip, pattern)] if bends else []
    controls = Controls(
        {"exit.force": np.array([tension, 0, 0]), "gravity": np.zeros(3)},
        {"gravity": np.array([0.0, 0.0, -9.81])},
    )
    held = np.concatenate([strip.edges[name].trace for name in ("entry", "exit")])
    full, _ = solved(strip, effects, controls, np.sort(held))
    q, layer = 9.81 * 1000.0 * strip.thickness, np.sqrt(d / tension) if bends else 0.0
    x = strip.mesh.p[0]
    exact = -0.5 * q / tension * (0.25 - x**2)
    if bends:
        exact += q * layer**2 / tension * (1.0 - np.cosh(x / layer) / np.cosh(0.5 / layer))
    np.testing.assert_allclose(
        full[strip.dofs("u")], exact, rtol=1e-5, atol=1e-6 * abs(exact).max()
    )
    if bends:
        assert layer == pytest.approx(0.0577, rel=1e-2)
        assert abs(exact).max() < 0.98 * 0.125 * q / tension


def test_pretension_is_the_slope_of_the_membrane_about_a_tensioned_strip():
    """z rows of the membrane's tangent under a uniform tension: T w,x against φ,x."""
    shell, plate = strip_of("shell", poisson=0.0), strip_of("plate", poisson=0.0)
    strain, (x, _) = 1e-6, shell.mesh.p
    tension = shell.tensile_stiffness * strain
    u = np.zeros((shell.scalars, 3))
    u[shell.dofs("u"), 0], u[shell.dofs("u_x"), 0] = strain * x, strain
    whole = free_equations(shell, [Membrane(shell)]).recurrence(u.ravel(), 0.0, 1).tangent()
    controls = Controls({"exit.force": np.array([tension, 0.0, 0.0])})
    flat = free_equations(plate, [Pretension(plate)], controls)
    own = flat.recurrence(np.zeros(plate.unknowns), 0.0, 1).tangent()
    difference = abs(whole.tocsr()[2::3][:, 2::3] - own)
    assert abs(own).max() > 0.0
    assert difference.max() < 3e-6 * abs(own).max()


def test_jets_are_value_and_gradient():
    strip = strip_of("shell")
    full = linear(strip, [[1.1, 0.2, 0], [0.3, 0.9, 0], [0.5, -0.4, 1]], (1.0, 2.0, 3.0))
    found = CellOperator(strip, (0, 1)).apply(full)
    np.testing.assert_allclose(found[:, 1:].mean(axis=2), [[0.1, 0.2], [0.3, -0.1], [0.5, -0.4]])
    edge = CellOperator(strip, (0, 1), strip.edge_basis("exit"))
    assert edge.weights.sum() == pytest.approx(np.ptp(YS))
    at = edge.apply(full)[:, 0]
    assert at[0] @ edge.weights == pytest.approx((0.1 * 0.5 + 0.2 * 0.05 + 1.0) * 0.5)
    u = random_unknowns(strip, 3)
    force = np.random.default_rng(4).standard_normal((3, 3, edge.points))
    power = (edge.apply(u) * force * edge.weights).sum()
    assert edge.gather(force) @ u == pytest.approx(power, rel=1e-12)
