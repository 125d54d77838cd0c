"""The strip: named edges and their loads, numbering, units of unknowns."""

import numpy as np
import pytest
from skfem import MeshQuad

from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Strip, grid, renumbered

XS = np.array([-1.0, -0.6, -0.5, 0.2, 1.0])
YS = np.array([-0.4, -0.3, 0.1, 0.4])


@pytest.fixture(scope="module")
def strip():
    return Strip(grid(XS, YS), 1e-3, Material(2e11, 0.3, 7850.0))


WHERE = {"entry": (0, -1.0, YS), "exit": (0, 1.0, YS), "right": (1, -0.4, XS), "left": (1, 0.4, XS)}


def test_sizes_and_stiffnesses(strip):
    assert set(strip.edges) == set(WHERE)
    assert (strip.length, strip.width) == (2.0, pytest.approx(0.8))
    assert strip.unknowns == 3 * strip.scalars == 12 * len(XS) * len(YS)
    assert strip.membrane_stiffness == pytest.approx(2e11 * 1e-3 / 0.91)
    assert strip.bending_stiffness == pytest.approx(2e11 * 1e-9 / 12 / 0.91)


@pytest.mark.parametrize("name", WHERE)
def test_edge_has_its_nodes_in_order(strip, name):
    axis, position, along = WHERE[name]
    edge = strip.edges[name]
    np.testing.assert_allclose(strip.mesh.p[axis, edge.nodes], position)
    np.testing.assert_allclose(strip.mesh.p[1 - axis, edge.nodes], along)
    assert edge.length == pytest.approx(np.ptp(along))


@pytest.mark.parametrize("name", WHERE)
def test_edge_dofs_are_values_and_slopes_along_it(strip, name):
    """The field 3 + 5 s, s along the edge, has just these dofs."""
    axis, _, along = WHERE[name]
    edge = strip.edges[name]
    u = np.zeros(strip.scalars)
    u[strip.node_values] = 3.0 + 5.0 * strip.mesh.p[1 - axis]
    u[strip.basis.nodal_dofs[2 - axis]] = 5.0
    np.testing.assert_allclose(u[edge.values], 3.0 + 5.0 * along)
    np.testing.assert_allclose(u[edge.trace[len(edge.nodes) :]], 5.0)


@pytest.mark.parametrize("name", WHERE)
@pytest.mark.parametrize("power", [0, 1, 2, 3])
def test_edge_load_is_the_integral_of_its_cubic_trace(strip, name, power):
    """∫ s^p ds is exact up to cubics: total force (p = 0) and no moment about the middle."""
    axis, _, along = WHERE[name]
    edge = strip.edges[name]
    s = strip.mesh.p[1 - axis]
    u = np.zeros(strip.scalars)
    u[strip.node_values] = s**power
    u[strip.basis.nodal_dofs[2 - axis]] = power * s ** max(power - 1, 0)
    exact = (along[-1] ** (power + 1) - along[0] ** (power + 1)) / (power + 1)
    assert edge.load @ u == pytest.approx(exact, abs=1e-14)
    square = (along[-1] ** (2 * power + 1) - along[0] ** (2 * power + 1)) / (2 * power + 1)
    assert u[edge.trace] @ edge.mass @ u[edge.trace] == pytest.approx(square, abs=1e-14)
    touched = np.flatnonzero(edge.load)
    assert set(touched) <= {*edge.values, *edge.trace[len(edge.nodes) :]}
    assert edge.load[edge.values].sum() == pytest.approx(edge.length)


def test_cell_sizes(strip):
    dx, dy = strip.cell_sizes
    assert dx.shape == (12,)
    np.testing.assert_allclose(np.unique(np.round(dx, 12)), np.unique(np.round(np.diff(XS), 12)))
    assert (dx * dy).sum() == pytest.approx(2.0 * 0.8)


def test_dof_lengths_are_units_of_dofs(strip):
    """Values 1, derivatives the reciprocal of the mean size around the node."""
    (node,) = np.flatnonzero(np.isclose(strip.mesh.p[0], -0.5) & np.isclose(strip.mesh.p[1], 0.1))
    hx, hy = 0.5 * (0.1 + 0.7), 0.5 * (0.4 + 0.3)
    expected = [1.0, 1.0 / hx, 1.0 / hy, 1.0 / (hx * hy)]
    np.testing.assert_allclose(strip.dof_lengths[strip.basis.nodal_dofs[:, node]], expected)
    scaled = Strip(grid(1e3 * XS, 1e3 * YS), 1.0, strip.material).dof_lengths
    ratio = np.array([1.0, 1e-3, 1e-3, 1e-6])
    np.testing.assert_allclose(
        scaled[strip.basis.nodal_dofs], ratio[:, None] * strip.dof_lengths[strip.basis.nodal_dofs]
    )


def test_renumbering_keeps_boundaries_and_narrows():
    rng = np.random.default_rng(1)
    mesh = MeshQuad.init_tensor(XS, YS)
    shuffled = rng.permutation(mesh.p.shape[1])
    place = np.argsort(shuffled)
    named = {
        "entry": lambda x: np.isclose(x[0], -1.0),
        "half": lambda x: np.isclose(x[1], 0.4) & (x[0] < -0.45),
    }
    mixed = MeshQuad(mesh.p[:, shuffled], place[mesh.t]).with_boundaries(named)
    ordered = renumbered(mixed)
    assert (np.diff(ordered.p[0]) >= 0.0).all()
    assert set(ordered.boundaries) == set(named)
    for name in named:
        old, new = (m.p[:, m.facets[:, m.boundaries[name]]] for m in (mixed, ordered))
        assert new.size
        assert sorted(map(tuple, old.mean(axis=1).T)) == sorted(map(tuple, new.mean(axis=1).T))
    assert np.ptp(ordered.t, axis=0).max() == len(YS) + 1 < np.ptp(mixed.t, axis=0).max()
    assert (ordered.mapping().detDF(np.array([[0.5], [0.5]])) > 0).all() == (
        mixed.mapping().detDF(np.array([[0.5], [0.5]])) > 0
    ).all()


def test_clamp_holds_position_and_tangent_plane(strip):
    """Any state with these unknowns at zero has zero trace and zero gradient on the edge."""
    u = np.random.default_rng(2).standard_normal(strip.unknowns)
    held, basis = strip.clamp("entry"), strip.basis
    assert len(held) == len(set(held)) == 12 * len(YS)
    u[held] = 0.0
    square = np.stack([x.ravel() for x in np.meshgrid(*2 * [np.linspace(0.0, 1.0, 5)])])
    on_edge = np.isclose(basis.mapping.F(square)[0], -1.0)
    assert on_edge.sum() == 5 * (len(YS) - 1)
    fields = [basis.elem.gbasis(basis.mapping, square, i)[0] for i in range(16)]
    dofs = u.reshape(-1, 3)[basis.element_dofs]
    value = np.einsum("nep,nec->cep", np.stack([np.asarray(f) for f in fields]), dofs)
    gradient = np.einsum("naep,nec->caep", np.stack([f.grad for f in fields]), dofs)
    for field in (value, gradient):
        assert np.abs(field[..., on_edge]).max() < 1e-12 < np.abs(field).max()


def test_as_many_unknowns_as_fit_into_memory():
    """Pairs of 50 008 scalars are more than 32 bits can number."""
    strip = Strip(
        grid(np.linspace(0.0, 600.0, 6251), np.array([0.0, 0.1])), 1e-3, Material(2e11, 0.3)
    )
    assert strip.scalars > 2**15.5
    pattern = Pattern(strip)
    row, column = pattern.row, pattern.column
    assert row.min() == column.min() == 0
    assert row.max() == column.max() == strip.scalars - 1
