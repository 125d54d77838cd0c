"""Membrane, bending and loads: closed forms, and tangents against differences."""

from types import SimpleNamespace

import numpy as np
import pytest

from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.loads import edge_force, weight
from anmstrip.mechanics.shell import Membrane, isometric_bending, plane_stress
from anmstrip.simulation.stages import uniform_stretch
from anmstrip.taylor.series import taylor_series
from orders import orders
from shapes import linear, rolled, rotation

XS, YS = np.array([-0.5, -0.2, 0.0, 0.1, 0.5]), np.array([-0.2, 0.0, 0.3])


def strip_of(xs=XS, ys=YS, thickness=1e-2, poisson=0.3):
    return Strip(grid(xs, ys), thickness, Material(2e9, poisson, 1000.0))


@pytest.fixture(scope="module")
def strip():
    return strip_of()


@pytest.fixture(scope="module")
def elastic(strip):
    pattern = Pattern(strip)
    return Membrane(strip), isometric_bending(strip, pattern)


def free_equations(strip, effects, controls=None):
    """Equilibrium with nothing held."""
    model = Model(strip, Pattern(strip), effects, Scales(strip.length, 1.0, 1.0))
    supports = Supports.at_rest(strip.unknowns, np.array([], dtype=int))
    return Equilibrium(model, supports, controls or Controls({}))


def membrane_force(membrane, full):
    return membrane.operator.gather(membrane.law(membrane.operator.apply(full), None, {}))


def in_newton(strip, force):
    """Generalised forces with moments over the element size, (scalars, 3)."""
    return force.reshape(-1, 3) * strip.dof_lengths[:, None]


@pytest.mark.parametrize("seed", range(5))
def test_rigid_motion_makes_no_force(strip, elastic, seed):
    rng = np.random.default_rng(seed)
    membrane, bending = elastic
    full = linear(strip, rotation(rng), 3.0 * rng.standard_normal(3))
    assert np.abs(full).max() > 0.5
    force = in_newton(strip, membrane_force(membrane, full))
    assert np.abs(force).max() < 1e-14 * strip.membrane_stiffness * strip.width
    force = in_newton(strip, bending.force(full, None, {}))
    smallest = strip.cell_sizes.min()
    assert np.abs(force).max() < 1e-12 * strip.bending_stiffness / smallest**2


def test_a_stretch_and_a_bend_do_make_a_force(strip, elastic):
    """The bounds above are far below what a small strain or curvature makes."""
    membrane, bending = elastic
    force = in_newton(strip, membrane_force(membrane, linear(strip, np.diag([1.0 + 1e-6, 1, 1]))))
    assert np.abs(force).max() > 1e-8 * strip.membrane_stiffness * strip.width
    force = in_newton(strip, bending.force(rolled(strip, 10.0), None, {}))
    assert np.abs(force).max() > 1e-4 * strip.bending_stiffness


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49])
def test_plane_stress_is_that_of_the_textbook(poisson):
    strip = strip_of(poisson=poisson)
    stiffness, unit = plane_stress(strip), strip.membrane_stiffness
    strain = np.array([[2e-3, 3e-4], [3e-4, -1e-3]])
    (xx, xy), (yx, yy) = np.einsum("abcd,cd->ab", stiffness, strain)
    assert xx == pytest.approx(unit * (2e-3 - poisson * 1e-3))
    assert yy == pytest.approx(unit * (-1e-3 + poisson * 2e-3))
    assert xy == yx == pytest.approx(unit * (1 - poisson) * 3e-4)


@pytest.mark.parametrize("strain", [1e-6, 1e-3, 0.2])
def test_uniform_stretch(strip, elastic, strain):
    """Force √(1 + 2E) E_young t E per width at the ends, and none anywhere else."""
    membrane, _ = elastic
    nu, stiffness = 0.3, strip.material.young * strip.thickness
    along, across = np.sqrt(1.0 + 2.0 * strain), np.sqrt(1.0 - 2.0 * nu * strain)
    full = linear(strip, np.diag([along, across, 1.0]))
    force = membrane_force(membrane, full).reshape(-1, 3)
    tension = along * stiffness * strain
    entry, exit_ = strip.edges["entry"], strip.edges["exit"]
    assert force[exit_.values, 0].sum() == pytest.approx(tension * strip.width)
    force[:, 0] -= tension * (exit_.load - entry.load)
    assert np.abs(in_newton(strip, force.ravel())).max() < 1e-11 * tension + 1e-14 * stiffness


@pytest.mark.parametrize("tension", [1.0, 1e5, 5e6])
def test_stretched_strip_is_in_equilibrium(strip, elastic, tension):
    """The start of a scene: it leaves nothing to be taken away."""
    assembly = SimpleNamespace(strip=strip, pattern=Pattern(strip), unknowns=strip.unknowns)
    full = uniform_stretch(assembly, tension, {})
    equations = free_equations(
        strip,
        [*elastic, edge_force(strip, "exit"), edge_force(strip, "entry")],
        Controls(
            {"exit.force": np.array([tension, 0, 0]), "entry.force": np.array([-tension, 0, 0])}
        ),
    )
    floor = 1e-15 * strip.membrane_stiffness
    assert equations.imbalance(equations.residual(full, 0.0)) < 1e-11 * tension + floor
    off = equations.imbalance(equations.residual(1.01 * full, 0.0))
    assert off > 1e-3 * tension


def rolled_energy_error(cells, radius=0.3):
    """Relative error of D/2R² per area."""
    strip = strip_of(np.linspace(-0.5, 0.5, cells + 1), np.array([-0.2, 0.3]))
    bending = isometric_bending(strip, Pattern(strip))
    full = rolled(strip, radius)
    exact = 0.5 * strip.bending_stiffness / radius**2 * strip.length * strip.width
    return 0.5 * full @ bending.force(full, None, {}) / exact - 1.0


def test_bending_energy_of_a_cylinder():
    """Of the interpolant, whose energy converges like h⁴; D is that of plane strain."""
    errors = [rolled_energy_error(n) for n in (8, 16, 32)]
    assert abs(errors[0]) < 2e-3
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(rates, 4.0, atol=0.1)


def test_twist_and_saddle_energies(strip, elastic):
    """Small curvatures w = κ_xy x y and ½ κ (x² ± y²): D (1−ν) κ², D (1 ± ν) κ² per area."""
    _, bending = elastic
    x, y, _ = strip.nodes
    area, nu, kappa = strip.length * strip.width, 0.3, 0.7
    parts = {
        "twist": ((kappa * x * y, kappa * y, kappa * x, kappa), 1.0 - nu),
        "bowl": ((0.5 * kappa * (x**2 + y**2), kappa * x, kappa * y, 0.0), 1.0 + nu),
        "saddle": ((0.5 * kappa * (x**2 - y**2), kappa * x, -kappa * y, 0.0), 1.0 - nu),
    }
    for values, factor in parts.values():
        u = np.zeros((strip.scalars, 3))
        for dofs, value in zip(strip.basis.nodal_dofs, values, strict=True):
            u[dofs, 2] = value
        energy = 0.5 * u.ravel() @ bending.force(u.ravel(), None, {})
        assert energy == pytest.approx(strip.bending_stiffness * factor * kappa**2 * area)


def test_elastic_tangent_is_symmetric_and_the_derivative(strip, elastic):
    equations = free_equations(strip, elastic)
    rng = np.random.default_rng(7)
    units = np.repeat(strip.dof_lengths, 3)
    full = rolled(strip, 0.4) + 1e-3 * rng.standard_normal(strip.unknowns) * units
    tangent = equations.recurrence(full, 0.0, 1).tangent()
    scaled = tangent.multiply(units[:, None]).multiply(units[None, :]).tocsr()
    assert abs(scaled - scaled.T).max() < 1e-13 * abs(scaled).max()
    for _ in range(3):
        direction = rng.standard_normal(strip.unknowns) * units
        step = 1e-6
        difference = equations.residual(full + step * direction, 0.0)
        difference -= equations.residual(full - step * direction, 0.0)
        expected = in_newton(strip, difference / (2.0 * step))
        found = in_newton(strip, tangent @ direction)
        assert np.abs(found - expected).max() < 1e-6 * np.abs(found).max()


def test_membrane_law_orders_are_its_derivatives(strip):
    """A cubic in the gradient: orders 0 to 3 of a straight line, and no higher one."""
    membrane = Membrane(strip)
    rng = np.random.default_rng(4)
    start, slope = rng.standard_normal((2, 3, 2, 1))
    zero = np.zeros((4, 3, 2, 1))
    found = taylor_series(lambda x: membrane.law(x, None, {}), np.stack([start, slope, *zero]))
    at = [membrane.law(start + a * slope, None, {}) for a in (-1.0, 0.0, 1.0, 2.0)]
    expected = np.linalg.solve(
        np.vander([-1.0, 0.0, 1.0, 2.0], increasing=True), np.reshape(at, (4, -1))
    )
    np.testing.assert_allclose(found[:4].reshape(4, -1), expected, rtol=1e-9, atol=1e-3)
    assert not found[4:].any()


def test_membrane_force_along_a_rotation(strip):
    """Orders of an analytic path (sin, cos) against an interpolant of the law."""
    membrane = Membrane(strip)

    def gradient(a):
        turn = np.array([[np.cos(a), 0.0], [0.0, 1.0 + 0.1 * a], [np.sin(a), 0.0]])
        return (turn - np.eye(3, 2))[:, :, None]

    path = np.zeros((9, 3, 2, 1))
    for k in range(9):
        factorial = float(np.prod(np.arange(1, k + 1)))
        path[k, 0, 0] = [1, 0, -1, 0][k % 4] / factorial
        path[k, 2, 0] = [0, 1, 0, -1][k % 4] / factorial
    path[0, 0, 0], path[1, 1, 1] = 0.0, 0.1
    found = taylor_series(lambda x: membrane.law(x, None, {}), path)
    for i, b in np.ndindex(3, 2):
        expected = orders(lambda a, i=i, b=b: membrane.law(gradient(a), None, {})[i, b, 0], 1.0, 6)
        size = strip.membrane_stiffness
        np.testing.assert_allclose(found[:6, i, b, 0], expected, rtol=1e-7, atol=1e-8 * size)


def test_weight_is_that_of_the_strip(strip):
    effect = weight(strip)
    load = effect.force(np.zeros(0), None, {"gravity": np.array([0.0, 0.0, -9.81])})
    force = load.reshape(-1, 3)[strip.node_values].sum(axis=0)
    mass = 1000.0 * 1e-2 * strip.length * strip.width
    np.testing.assert_allclose(force, [0.0, 0.0, mass * 9.81], rtol=1e-12)
    x = np.zeros(strip.scalars)
    x[strip.node_values], x[strip.basis.nodal_dofs[1]] = strip.mesh.p[0] ** 2, 2 * strip.mesh.p[0]
    assert effect.load @ x == pytest.approx(mass * (0.5**3 - (-0.5) ** 3) / 3.0)


def test_dead_load_has_orders_zero_and_one(strip):
    load = edge_force(strip, "exit")
    controls = Controls(
        {"exit.force": np.array([1.0, 2, 3])}, {"exit.force": np.array([0, 0, 5.0])}
    )
    equations = free_equations(strip, [load], controls)
    series = equations.recurrence(np.zeros(strip.unknowns), 0.5, 4)
    np.testing.assert_allclose(
        series.residual.reshape(-1, 3)[strip.node_values].sum(axis=0), -0.5 * np.array([1, 2, 5.5])
    )
    slope = series.control_derivative().reshape(-1, 3)[strip.node_values].sum(axis=0)
    np.testing.assert_allclose(slope, [0.0, 0.0, -2.5])
    assert not series.advance(2).any()
    assert series.tangent().count_nonzero() == 0
