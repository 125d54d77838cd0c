"""Levels of description: one code path, tangents and orders of every effect on each."""

import numpy as np
import pytest

from anmstrip.fem.geometry import KINEMATICS, PLATE, SECTION, SHELL
from anmstrip.mechanics.shell import moduli, stiffness
from levels import (
    CASES,
    XS,
    YS,
    effect_of,
    equations_of,
    free_equations,
    interpolated_orders,
    random_unknowns,
    residual_orders,
    strip_of,
)
from shapes import linear, rotation


def test_levels_name_their_components():
    assert [level.count for level in (SHELL, SECTION, PLATE)] == [3, 2, 1]
    assert list(KINEMATICS) == ["plate", "section", "shell"]
    assert [SECTION.place(c) for c in range(3)] == [0, None, 1]
    assert [PLATE.place(c) for c in range(3)] == [None, None, 0]
    np.testing.assert_array_equal(SECTION.pick([1.0, 2.0, 3.0]), [1.0, 3.0])
    np.testing.assert_array_equal(SECTION.embed(np.array([[1.0], [3.0]]))[:, 0], [1.0, 0.0, 3.0])


@pytest.mark.parametrize("level", KINEMATICS.values(), ids=KINEMATICS)
def test_what_is_picked_can_be_embedded_again(level):
    vectors = np.random.default_rng(1).standard_normal((7, 3))
    kept = level.pick(vectors)
    assert kept.shape == (7, level.count)
    np.testing.assert_array_equal(level.pick(level.embed(kept.T).T), kept)
    np.testing.assert_array_equal(level.chosen @ level.chosen.T, np.eye(level.count))
    np.testing.assert_array_equal(level.flat[..., 0], np.eye(3, level.directions)[
        list(level.components)
    ])  # fmt: skip


@pytest.mark.parametrize(("level", "name"), CASES)
def test_tangent_is_the_derivative(level, name):
    equations, full = equations_of(level, name)
    tangent = equations.recurrence(full, 0.3, 1).tangent()
    units = equations.model.units
    if name != "pressure" or level != "plate":
        assert abs(tangent).max() > 0.0
    for seed in (21, 22):
        direction, step = random_unknowns(equations.model.strip, seed), 1e-7
        ahead, back = (equations.residual(full + s * direction, 0.3) for s in (step, -step))
        expected, found = (ahead - back) / (2 * step) * units, (tangent @ direction) * units
        floor = 1e-9 * np.abs(ahead * units).max() / step
        assert np.abs(found - expected).max() <= 2e-6 * np.abs(expected).max() + floor


@pytest.mark.parametrize(("level", "name"), CASES)
def test_residual_orders_are_those_of_an_interpolant(level, name):
    """Along u + a u_1 with the controls moving, six orders of a random combination."""
    equations, full = equations_of(level, name)
    strip = equations.model.strip
    direction, count = 2e-3 * random_unknowns(strip, 31), 6
    radius = 0.05 if name in ("contact", "friction", "aligned") else 0.5
    weights = random_unknowns(strip, 32)
    found = residual_orders(equations, full, direction, 0.3, count) @ weights
    expected = interpolated_orders(equations, full, direction, 0.3, count, weights, radius)
    size = np.abs(expected * radius ** np.arange(count)).max()
    assert size > 0.0
    scaled = np.abs(found - expected) * radius ** np.arange(count)
    assert (scaled < 1e-8 * size * 10.0 ** np.arange(count)).all()
    assert scaled[:3].max() < 1e-7 * size


def in_plane(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def moved(strip, matrix, offset):
    """A straight motion of a section as unknowns (x, z)."""
    u = np.zeros((strip.scalars, 2))
    change = matrix - np.eye(3)
    u[strip.dofs("u")] = SECTION.pick((change @ strip.nodes).T + offset)
    u[strip.dofs("u_x")] = SECTION.pick(change[:, 0])
    return u.ravel()


@pytest.mark.parametrize("name", ["membrane", "bending"])
@pytest.mark.parametrize("seed", range(3))
def test_rigid_motion_makes_no_force(name, seed):
    rng = np.random.default_rng(seed)
    shell, section = strip_of("shell"), strip_of("section")
    offset = 3.0 * rng.standard_normal(3)
    states = [
        (shell, linear(shell, rotation(rng), offset)),
        (section, moved(section, in_plane(rng.uniform(-3.0, 3.0)), offset)),
    ]
    for strip, full in states:
        assert np.abs(full).max() > 0.5
        equations = free_equations(strip, [effect_of(name, strip)])
        force = equations.residual(full, 0.0) * equations.model.units
        size = strip.membrane_stiffness if name == "membrane" else strip.bending_stiffness / 0.01
        assert np.abs(force).max() < 1e-12 * size * strip.width
        strained = full + 1e-3 * random_unknowns(strip, seed)
        force = equations.residual(strained, 0.0) * equations.model.units
        assert np.abs(force).max() > 1e-6 * size * strip.width


def spread(section, shell, full):
    """A section's state as the shell's state that does not vary across."""
    u, own = np.zeros((shell.scalars, 3)), full.reshape(-1, 2)
    place = np.searchsorted(section.mesh.p[0], shell.mesh.p[0] - 1e-9)
    order = np.argsort(section.mesh.p[0])
    for name in ("u", "u_x"):
        values = own[section.dofs(name)][order][place]
        u[shell.dofs(name)[:, None], [[0, 2]]] = values
    return u.ravel()


@pytest.mark.parametrize("name", ["membrane", "bending", "pressure", "entry", "exit"])
def test_section_is_a_shell_that_does_not_vary_across(name):
    """With ν = 0 the force on a section's fibre is that of the shell summed across."""
    section, shell = strip_of("section", poisson=0.0), strip_of("shell", poisson=0.0)
    full = 0.05 * random_unknowns(section, 5)
    wide = spread(section, shell, full)
    own = free_equations(section, [effect_of(name, section)]).residual(full, 0.3)
    found = free_equations(shell, [effect_of(name, shell)]).residual(wide, 0.3)
    order = np.argsort(section.mesh.p[0])
    size = np.abs(own).max()
    assert size > 1.0
    for kind in ("u", "u_x"):
        for x, dof in zip(np.sort(section.mesh.p[0]), section.dofs(kind)[order], strict=True):
            across = shell.dofs(kind)[np.isclose(shell.mesh.p[0], x)]
            total = found.reshape(-1, 3)[across].sum(axis=0)
            np.testing.assert_allclose(
                SECTION.pick(total), own.reshape(-1, 2)[dof], atol=1e-12 * size
            )
            assert abs(total[1]) < 1e-12 * size


def test_section_is_as_wide_as_it_stands_for():
    section, shell = strip_of("section"), strip_of("shell")
    assert section.width == shell.width == np.ptp(YS)
    assert section.length == shell.length == np.ptp(XS)
    assert section.areas.sum() == pytest.approx(shell.areas.sum())
    for name in ("entry", "exit"):
        assert section.edges[name].length == pytest.approx(shell.edges[name].length)
        assert section.edges[name].load.sum() == pytest.approx(np.ptp(YS))


def test_section_resists_bending_as_a_wide_plate_and_stretch_as_a_narrow_one():
    """D along and ν D across for it cannot bend across; E t for it is free to contract."""
    section, shell = strip_of("section"), strip_of("shell")
    d, nu = section.bending_stiffness, 0.3
    np.testing.assert_allclose(stiffness(section), [[d]])
    unit = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(moduli(section) @ unit, [d, nu * d, 0.0])
    np.testing.assert_allclose(stiffness(shell)[:2, :2], [[d, nu * d], [nu * d, d]])
    stretched = moved(section, np.diag([1.0 + 1e-6, 1.0, 1.0]), np.zeros(3))
    membrane = effect_of("membrane", section)
    force = membrane.forces(membrane.operator.apply(stretched) + section.kinematics.flat)
    np.testing.assert_allclose(force, 1e-6 * section.tensile_stiffness, rtol=2e-6)
