"""Kirchhoff–Love bending, curved references and moments on edges: closed forms and invariance."""

import numpy as np
import pytest

from anmstrip.fem.geometry import reference_surface
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Strip, grid, simple_support, symmetry
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.loads import edge_force, edge_moment, pressure, weight
from anmstrip.mechanics.shell import KirchhoffLove, Membrane, isometric_bending
from levels import free_equations, random_unknowns, strip_of
from shapes import linear, rolled, rotation

RADIUS = 2.0


def arc(x, y):
    """A cylinder of radius 2 m whose arc length is x."""
    return np.stack([RADIUS * np.sin(x / RADIUS), y, RADIUS * np.cos(x / RADIUS)])


def skewed(x, y):
    """A flat sheet in coordinates that are neither straight nor at right angles."""
    return np.stack([x + 0.2 * y * y, y + 0.3 * np.sin(x), x * 0.0])


def sheet(cells, surface=None, thickness=0.05):
    mesh = grid(np.linspace(-0.5, 0.5, cells + 1), np.linspace(-0.3, 0.3, cells + 1))
    return Strip(mesh, thickness, Material(2e9, 0.3, 1000.0), surface=surface)


def interpolated(strip, function):
    """Nodal values of a displacement as a function of reference positions; by differences."""
    found, d = np.zeros((strip.scalars, 3)), 1e-3
    x, y = strip.mesh.p

    def at(i, j):
        return function(strip.in_space(np.stack([x + i * d, y + j * d]))).T

    found[strip.dofs("u")] = at(0, 0)
    found[strip.dofs("u_x")] = (8 * (at(1, 0) - at(-1, 0)) - at(2, 0) + at(-2, 0)) / (12 * d)
    found[strip.dofs("u_y")] = (8 * (at(0, 1) - at(0, -1)) - at(0, 2) + at(0, -2)) / (12 * d)
    mixed = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * d * d)
    wider = (at(2, 2) - at(2, -2) - at(-2, 2) + at(-2, -2)) / (16 * d * d)
    found[strip.dofs("u_xy")] = (4 * mixed - wider) / 3
    return found.ravel()


def force_of(effect, full, controls=None):
    return effect.operator.gather(effect.law(effect.operator.apply(full), None, controls or {}))


@pytest.mark.parametrize("seed", range(3))
def test_rigid_motion_of_a_flat_strip_makes_no_moment(seed):
    strip, rng = strip_of("shell"), np.random.default_rng(seed)
    full = linear(strip, rotation(rng), rng.standard_normal(3))
    force = force_of(KirchhoffLove(strip), full).reshape(-1, 3) * strip.dof_lengths[:, None]
    assert np.abs(force).max() < 1e-12 * strip.bending_stiffness


@pytest.mark.parametrize("surface", [arc, skewed])
@pytest.mark.parametrize("effect", [Membrane, KirchhoffLove])
def test_a_mapped_reference_has_no_stress(surface, effect):
    strip = sheet(3, reference_surface(surface))
    law = effect(strip)
    stress = law.law(law.operator.apply(np.zeros(strip.unknowns)), None, {})
    assert np.abs(stress).max() < 1e-12 * strip.membrane_stiffness


@pytest.mark.parametrize("surface", [arc, skewed])
@pytest.mark.parametrize("effect", [Membrane, KirchhoffLove])
def test_rigid_motion_of_a_mapped_reference_converges_with_the_element(surface, effect):
    """The map is exact, the displacement is a bicubic: strains h³, second derivatives h²."""
    turn, worst = rotation(np.random.default_rng(5)), []
    for cells in (4, 8):
        strip = sheet(cells, reference_surface(surface))
        law = effect(strip)
        full = interpolated(strip, lambda r: turn @ r - r)
        assert np.abs(full).max() > 0.3
        worst.append(np.abs(law.law(law.operator.apply(full), None, {})).max())
    order = 2 if effect is KirchhoffLove else 3
    assert worst[0] / worst[1] > 0.85 * 2**order


def rolled_up(r, radius=0.4):
    """Displacement of a flat sheet onto a cylinder along y."""
    angle = r[0] / radius
    return np.stack([radius * np.sin(angle), r[1], radius * (1.0 - np.cos(angle))]) - r


@pytest.mark.parametrize(("surface", "rtol"), [(None, 4e-3), (reference_surface(skewed), 2e-2)])
def test_coordinates_do_not_matter_on_a_flat_sheet(surface, rtol):
    """The same bend in straight and in skewed coordinates, with both energies."""
    strip = sheet(10, surface)
    full, curved = interpolated(strip, rolled_up), KirchhoffLove(strip)
    curvature = curved.bent(curved.operator.apply(full) + curved.reference)
    np.testing.assert_allclose(np.abs(curvature[0] + curvature[1]), 2.5, rtol=rtol)
    work = (
        full
        @ isometric_bending(strip, Pattern(strip)).force(full, None, {})
        / strip.weights().sum()
    )
    assert work == pytest.approx(strip.bending_stiffness * 2.5**2, rel=1e-3)


def test_isometric_bending_refuses_a_curved_reference():
    strip = sheet(2, reference_surface(arc))
    with pytest.raises(ValueError, match="KirchhoffLove"):
        isometric_bending(strip, Pattern(strip))


def test_area_edges_and_loads_of_a_curved_reference():
    strip = sheet(4, reference_surface(lambda x, y: arc(x * RADIUS, y * RADIUS)))
    assert strip.weights().sum() == pytest.approx(0.6 * RADIUS**2, rel=1e-10)
    assert [strip.edges[e].length for e in ("entry", "left")] == pytest.approx([1.2, 2.0])
    total = edge_force(strip, "left").load[strip.node_values].sum()
    assert total == pytest.approx(2.0, rel=1e-6)
    mass = weight(strip).load[strip.node_values].sum()
    assert mass == pytest.approx(0.6 * RADIUS**2 * 1000.0 * strip.thickness, rel=1e-6)
    load = force_of(pressure(strip), np.zeros(strip.unknowns), {"pressure": 1.0})
    up = -load.reshape(-1, 3)[strip.node_values].sum(axis=0)
    np.testing.assert_allclose(up, [0.0, 0.0, 2 * RADIUS * np.sin(0.5) * 1.2], atol=1e-4)


def test_a_cylinder_unrolled_to_another_radius():
    """κ = 1/R − 1/R' without stretch, so that the moment is D κ at every point."""
    strip = sheet(16, reference_surface(arc))

    def unrolled(r):
        x = RADIUS * np.arctan2(r[0], r[2])
        return np.stack([3.0 * np.sin(x / 3.0), r[1], 3.0 * np.cos(x / 3.0)]) - r

    full = interpolated(strip, unrolled)
    curved, membrane = KirchhoffLove(strip), Membrane(strip)
    change = curved.bent(curved.operator.apply(full) + curved.reference) - curved.curvature
    np.testing.assert_allclose(change[0], 1 / RADIUS - 1 / 3.0, rtol=2e-4)
    assert np.abs(change[1:]).max() < 1e-5
    forces = membrane.forces(membrane.operator.apply(full) + membrane.flat)
    assert np.abs(forces).max() < 1e-5 * strip.membrane_stiffness


def test_both_bendings_agree_on_a_rolled_strip():
    """No stretch: equal; with a stretch their forces differ by its order."""
    strip = strip_of("shell", np.linspace(-0.5, 0.5, 17))
    full = rolled(strip, 0.4)
    for stretch, bound in ((0.0, 2e-3), (1e-2, 5e-2)):
        state = (1.0 + stretch) * (full + strip_positions(strip)) - strip_positions(strip)
        isometric = isometric_bending(strip, Pattern(strip)).force(state, None, {})
        change = np.abs(force_of(KirchhoffLove(strip), state) - isometric)
        worst = (change.reshape(-1, 3) * strip.dof_lengths[:, None]).max()
        size = (np.abs(isometric).reshape(-1, 3) * strip.dof_lengths[:, None]).max()
        assert worst < bound * size


def strip_positions(strip):
    """r = X as unknowns."""
    zero = linear(strip, np.zeros((3, 3)))
    return -zero


@pytest.mark.parametrize("level", ["shell", "section"])
def test_moment_turns_about_the_edge(level):
    """Work in rigid rotations about y: M W; in translations: none."""
    strip = strip_of(level)
    moment, full = edge_moment(strip, "exit"), 1e-2 * random_unknowns(strip_of(level), 3)
    load = -force_of(moment, full, {"exit.moment": 7.0}).reshape(-1, strip.count)
    now = full.reshape(-1, strip.count) + _reference(strip)
    turned = np.zeros_like(now)
    turned[:, 0], turned[:, -1] = -now[:, -1], now[:, 0]
    np.testing.assert_allclose(load[strip.node_values].sum(axis=0), 0.0, atol=1e-9)
    width = strip.width
    if level == "section":
        assert np.sum(load * turned) == pytest.approx(7.0 * width, rel=1e-12)
        return
    flat = -force_of(moment, np.zeros_like(full), {"exit.moment": 7.0}).reshape(-1, 3)
    spin = np.zeros_like(now)
    spin[:, 0], spin[:, 2] = -_reference(strip)[:, 2], _reference(strip)[:, 0]
    assert np.sum(flat * spin) == pytest.approx(7.0 * width, rel=1e-12)


def _reference(strip):
    """Reference positions as coefficients, (scalars, components)."""
    found = np.zeros((strip.scalars, 3))
    found[strip.dofs("u")] = strip.nodes.T
    found[strip.dofs("u_x")] = [1.0, 0.0, 0.0]
    if strip.mesh.dim() == 2:
        found[strip.dofs("u_y")] = [0.0, 1.0, 0.0]
    return found[:, list(strip.kinematics.components)]


def test_moments_on_both_ends_balance_in_space():
    """The resultant moment of an edge moment is M ∮ τ ds, whatever the state."""
    strip = strip_of("shell")
    full = 5e-3 * random_unknowns(strip, 8)
    moment = edge_moment(strip, "exit")
    load = -force_of(moment, full, {"exit.moment": 3.0}).reshape(-1, 3)
    r = full.reshape(-1, 3) + _reference(strip)
    found = np.array([np.sum(load * np.cross(axis, r)) for axis in np.eye(3)])
    operator = moment.operator
    along = operator.apply(full)[:, 2] + moment.reference[:, 1]
    expected = 3.0 * (along / np.linalg.norm(along, axis=0)) @ operator.weights
    np.testing.assert_allclose(found, -expected, rtol=1e-10)


def test_a_section_bends_like_a_shell_without_poisson():
    section, shell = (strip_of(level, poisson=0.0) for level in ("section", "shell"))
    full = np.zeros((shell.scalars, 3))
    line = 1e-2 * random_unknowns(section, 4).reshape(-1, 2)
    for name in ("u", "u_x"):
        at = np.searchsorted(section.mesh.p[0], shell.mesh.p[0] - 1e-9)
        order = np.argsort(section.mesh.p[0])
        full[shell.dofs(name)[:, None], [0, 2]] = line[section.dofs(name)[order[at]]]
    works = [
        force_of(KirchhoffLove(strip), state.ravel()) @ state.ravel()
        for strip, state in ((section, line), (shell, full))
    ]
    assert works[0] == pytest.approx(works[1], rel=1e-12)


def test_symmetry_and_traces_hold_the_right_unknowns():
    strip = sheet(2)
    half = strip.edges["entry"]
    held = symmetry(strip, "entry", 0)
    expected = [3 * strip.dofs(n)[half.nodes] + c for n, cs in (
        ("u", [0]), ("u_y", [0]), ("u_x", [1, 2]), ("u_xy", [1, 2])) for c in cs]  # fmt: skip
    np.testing.assert_array_equal(held, np.sort(np.concatenate(expected)))
    line = [3 * strip.dofs(n)[strip.edges["left"].nodes] + 2 for n in ("u", "u_x")]
    np.testing.assert_array_equal(simple_support(strip, "left", 2), np.sort(np.concatenate(line)))


def test_tangent_of_a_curved_shell_is_symmetric():
    strip = sheet(2, reference_surface(arc))
    equations = free_equations(strip, [Membrane(strip), KirchhoffLove(strip)], Controls({}))
    tangent = equations.recurrence(1e-2 * random_unknowns(strip, 1), 0.0, 1).tangent()
    scaled = tangent.multiply(equations.model.units[:, None]).multiply(equations.model.units)
    assert abs(scaled - scaled.T).max() < 1e-12 * abs(scaled).max()
