"""C1 elements: polynomials are exact wherever the strip lies, and joins are smooth."""

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder, polyval, polyval2d
from skfem import Basis, MeshLine, MeshQuad, MeshTri
from skfem.assembly import BilinearForm, FacetBasis, LinearForm
from skfem.element import ElementLineHermite, ElementQuadBFS, ElementTriArgyris
from skfem.helpers import dd, ddot
from skfem.utils import condense, solve

from anmstrip.fem.elements import Argyris, BognerFoxSchmit, Hermite

COEFFICIENTS = np.array(
    [[0.3, -1.1, 0.7, 0.4], [1.2, 0.5, -0.8, 0.9], [-0.6, 1.3, 0.2, -0.4], [0.8, -0.3, 1.1, 0.6]]
)
"""c_ij of Σ c_ij X^i Y^j, in X = (x − centre)/h and Y = y/h: all terms of order one."""

DERIVATIVES = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]


class Bicubic:
    """A polynomial about ``centre`` in units of ``h``, and its derivatives."""

    def __init__(self, centre, h):
        self.centre, self.h = centre, h

    def __call__(self, x, i=0, j=0):
        c = polyder(polyder(COEFFICIENTS, i, axis=0), j, axis=1)
        return polyval2d((x[0] - self.centre) / self.h, x[1] / self.h, c) / self.h ** (i + j)


def mesh_at(centre, h):
    """Three by two elements, of different lengths."""
    xs = centre + h * np.array([-1.0, -0.4, 0.3, 1.0])
    return MeshQuad.init_tensor(xs, h * np.array([-0.8, 0.0, 1.0]))


def interpolated(basis, field):
    """Dofs of a field: values and derivatives at the nodes."""
    u = np.zeros(basis.N)
    for dofs, (i, j) in zip(basis.nodal_dofs, [(0, 0), (1, 0), (0, 1), (1, 1)], strict=True):
        u[dofs] = field(basis.mesh.p, i, j)
    return u


def derivative(field, part):
    """Value, gradient or Hessian of a discrete field."""
    return np.asarray(field) if part == "value" else getattr(field, part)


def errors(element, centre, h):
    """Relative errors of value, first and second derivatives at quadrature points."""
    basis = Basis(mesh_at(centre, h), element, intorder=6)
    field = Bicubic(centre, h)
    found = basis.interpolate(interpolated(basis, field))
    x = np.asarray(basis.global_coordinates())
    parts = {
        (0, 0): np.asarray(found), (1, 0): found.grad[0], (0, 1): found.grad[1],
        (2, 0): found.hess[0, 0], (1, 1): found.hess[0, 1], (0, 2): found.hess[1, 1],
    }  # fmt: skip
    exact = {d: field(x, *d) for d in DERIVATIVES}
    assert all(np.abs(exact[d]).max() > 0.0 for d in DERIVATIVES)
    return [np.abs(parts[d] - exact[d]).max() / np.abs(exact[d]).max() for d in DERIVATIVES]


@pytest.mark.parametrize("h", [0.1, 0.02, 0.005])
@pytest.mark.parametrize("centre", [0.0, 4.0, 10.0, 100.0])
def test_bicubics_are_exact_far_from_the_origin(centre, h):
    """To the round-off of the coordinates themselves, eps · centre / h."""
    allowed = max(2e-12, 30.0 * np.finfo(float).eps * centre / h)
    assert max(errors(BognerFoxSchmit(), centre, h)) < allowed


def test_global_monomials_lose_digits_far_from_the_origin():
    """What the centred monomials are for: 1e3 times better 10 m away, and equal at 0."""
    ours, theirs = (errors(e, 10.0, 0.005) for e in (BognerFoxSchmit(), ElementQuadBFS()))
    assert max(theirs) > 1e3 * max(ours)
    ours, theirs = (errors(e, 0.0, 0.1) for e in (BognerFoxSchmit(), ElementQuadBFS()))
    assert max(theirs) < 1e-10
    assert max(ours) < 1e-12


def test_basis_agrees_with_scikit_fem_at_the_origin():
    mesh = mesh_at(0.0, 1.0)
    ours, theirs = (Basis(mesh, e(), intorder=4) for e in (BognerFoxSchmit, ElementQuadBFS))
    assert len(ours.basis) == 16
    for (mine,), (reference,) in zip(ours.basis, theirs.basis, strict=True):
        for part in ("value", "grad", "hess"):
            np.testing.assert_allclose(
                derivative(mine, part), derivative(reference, part), rtol=0, atol=1e-9
            )


@pytest.mark.parametrize("direction", [0, 1])
def test_any_dofs_make_a_c1_surface(direction):
    """Values and gradients from both sides of a line of nodes agree; curvatures do not."""
    steps, line = np.array([0.0, 0.1, 0.4, 0.45]), 0.1
    across = np.array([0.0, 0.3, 0.5])
    mesh = MeshQuad.init_tensor(*((steps, across) if direction == 0 else (across, steps)))
    basis = Basis(mesh, BognerFoxSchmit(), intorder=4)
    u = np.random.default_rng(3).standard_normal(basis.N)
    along = np.linspace(0.02, 0.48, 7)
    sides = []
    for step in (-1e-9, 1e-9):
        points = np.stack([np.full(7, line + step), along][:: 1 if direction == 0 else -1])
        cells = mesh.element_finder()(*points)
        local = basis.mapping.invF(points[:, :, None], tind=cells)
        field = [basis.elem.gbasis(basis.mapping, local, i, tind=cells)[0] for i in range(16)]
        dofs = u[basis.element_dofs[:, cells]]
        sides.append(
            [
                sum(w * derivative(f, part)[..., 0] for w, f in zip(dofs, field, strict=True))
                for part in ("value", "grad", "hess")
            ]
        )
    before, after = sides
    for part in (0, 1):
        assert np.abs(before[part]).max() > 0.1
        np.testing.assert_allclose(before[part], after[part], atol=1e-5)
    assert np.abs(before[2] - after[2]).max() > 1.0


QUINTIC = np.random.default_rng(5).uniform(0.3, 1.2, (6, 6)) * (np.add(*np.ogrid[:6, :6]) <= 5)
"""c_ij of Σ c_ij X^i Y^j, i + j <= 5."""

NODAL = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
"""Derivatives along x and y that are the nodal degrees of freedom of the Argyris element."""


class Quintic(Bicubic):
    """The same about ``centre`` for all terms of degree five."""

    def __call__(self, x, i=0, j=0):
        c = polyder(polyder(QUINTIC, i, axis=0), j, axis=1)
        return polyval2d((x[0] - self.centre) / self.h, x[1] / self.h, c) / self.h ** (i + j)


def triangulation(centre=0.0, h=1.0, cells=4, seed=1):
    """A square of side 2 h, cut into triangles of any shape, with nodes in any order."""
    random = np.random.default_rng(seed)
    steps = np.linspace(-1.0, 1.0, cells + 1)
    mesh = MeshTri.init_tensor(steps, steps)
    p = mesh.p.copy()
    inside = mesh.interior_nodes()
    p[:, inside] += random.uniform(-0.5, 0.5, (2, len(inside))) / cells
    order = random.permutation(p.shape[1])
    places = h * p[:, np.argsort(order)]
    return MeshTri(np.array([[centre], [0.0]]) + places, order[mesh.t])


def normals(mesh):
    """Normals of all facets, scikit-fem's own on the boundary."""
    along = -np.diff(mesh.p[:, mesh.facets], axis=1)[:, 0]
    found = np.stack([along[1], -along[0]]) / np.linalg.norm(along, axis=0)
    basis = FacetBasis(mesh, mesh.elem(), intorder=0)
    found[:, basis.find] = basis.normals[:, :, 0]
    return found


def quintic_interpolated(basis, field):
    """Degrees of freedom of a field ``field(x, i, j)`` for the Argyris element."""
    mesh, u = basis.mesh, np.zeros(basis.N)
    for dofs, (i, j) in zip(basis.nodal_dofs, NODAL, strict=True):
        u[dofs] = field(mesh.p, i, j)
    middles = mesh.p[:, mesh.facets].mean(axis=1)
    n = normals(mesh)
    u[basis.facet_dofs[0]] = n[0] * field(middles, 1, 0) + n[1] * field(middles, 0, 1)
    return u


def quintic_errors(element, centre, h):
    """Largest relative error of value, gradient and Hessian."""
    basis = Basis(triangulation(centre, h), element, intorder=6)
    field = Quintic(centre, h)
    found = basis.interpolate(quintic_interpolated(basis, field))
    x = np.asarray(basis.global_coordinates())
    parts = {
        (0, 0): np.asarray(found), (1, 0): found.grad[0], (0, 1): found.grad[1],
        (2, 0): found.hess[0, 0], (1, 1): found.hess[1, 0], (0, 2): found.hess[1, 1],
    }  # fmt: skip
    return max(
        np.abs(parts[d] - field(x, *d)).max() / np.abs(field(x, *d)).max() for d in DERIVATIVES
    )


@pytest.mark.parametrize(("centre", "h"), [(0.0, 1.0), (10.0, 0.1), (100.0, 0.02)])
def test_quintics_are_exact_far_from_the_origin(centre, h):
    """Elements of h/2."""
    allowed = max(1e-11, 300.0 * np.finfo(float).eps * centre / h)
    assert quintic_errors(Argyris(), centre, h) < allowed


def test_global_quintics_lose_all_digits_far_from_the_origin():
    assert quintic_errors(ElementTriArgyris(), 10.0, 0.1) > 1e-3
    assert quintic_errors(ElementTriArgyris(), 0.0, 1.0) < 1e-10


@pytest.mark.parametrize(
    ("ours", "theirs", "mesh"),
    [
        (Argyris, ElementTriArgyris, triangulation()),
        (Hermite, ElementLineHermite, MeshLine(np.array([-1.0, -0.3, 0.4, 1.0]))),
    ],
)
def test_basis_is_scikit_fem_s_at_the_origin(ours, theirs, mesh):
    mine, reference = (Basis(mesh, element(), intorder=6) for element in (ours, theirs))
    assert len(mine.basis) in (4, 21)
    for (own,), (other,) in zip(mine.basis, reference.basis, strict=True):
        for part in ("value", "grad", "hess"):
            expected = derivative(other, part)
            scale = np.abs(expected).max()
            np.testing.assert_allclose(derivative(own, part), expected, rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("centre", [0.0, 10.0])
def test_cubics_are_exact_on_lines(centre):
    mesh, h = MeshLine(centre + 0.1 * np.array([-1.0, -0.4, 0.1, 0.4, 1.0])), 0.1
    basis, c = Basis(mesh, Hermite(), intorder=4), COEFFICIENTS[1]
    u = np.zeros(basis.N)
    for k, dofs in enumerate(basis.nodal_dofs):
        u[dofs] = polyval((mesh.p[0] - centre) / h, polyder(c, k)) / h**k
    found, x = basis.interpolate(u), np.asarray(basis.global_coordinates())[0]
    for k, part in enumerate((np.asarray(found), found.grad[0], found.hess[0, 0])):
        expected = polyval((x - centre) / h, polyder(c, k)) / h**k
        np.testing.assert_allclose(part, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def on_both_sides(basis, u):
    """Value, gradient and Hessian from the two elements of every inner facet."""
    facets = np.flatnonzero(basis.mesh.f2t[1] >= 0)
    assert len(facets) > 20
    for side in (0, 1):
        other = FacetBasis(basis.mesh, basis.elem, facets=facets, side=side, intorder=6)
        found = other.interpolate(u)
        order = np.argsort(np.asarray(other.global_coordinates())[0], axis=1)
        parts = (np.asarray(found), *found.grad, *found.hess.reshape(4, *order.shape))
        yield [np.take_along_axis(part, order, axis=1) for part in parts]


def test_any_dofs_of_triangles_make_a_c1_surface():
    """Values and gradients agree along all inner facets; curvatures do not."""
    basis = Basis(triangulation(), Argyris(), intorder=2)
    u = np.random.default_rng(3).standard_normal(basis.N)
    before, after = on_both_sides(basis, u)
    for k in range(3):
        assert np.abs(before[k]).max() > 0.5
        np.testing.assert_allclose(before[k], after[k], atol=1e-10)
    assert np.abs(before[3] - after[3]).max() > 1.0


def test_sides_integrate_basis_functions_exactly():
    """∫ f ds and ∫ ∂f/∂n ds over one side of the square, f a quintic; x = 10 m."""
    mesh, h = triangulation(10.0, 0.1), 0.1
    facets = mesh.facets_satisfying(lambda x: np.isclose(x[0], 10.1))
    basis = FacetBasis(mesh, Argyris(), facets=facets, intorder=6)
    u = quintic_interpolated(Basis(mesh, Argyris(), intorder=2), Quintic(10.0, h))
    found = LinearForm(lambda v, w: v).assemble(basis) @ u
    powers = (1.0 - (-1.0) ** np.arange(1, 7)) / np.arange(1, 7)
    assert found == pytest.approx(h * (QUINTIC @ powers).sum(), rel=1e-11)
    slope = LinearForm(lambda v, w: v.grad[0] * w.n[0] + v.grad[1] * w.n[1]).assemble(basis) @ u
    assert slope == pytest.approx(np.arange(6) @ (QUINTIC @ powers), rel=1e-11)


def clamped_plate_error(cells):
    """Relative error of curvatures for Δ²u = f with u = (1 − x²)² (1 − y²)² e^(x + y/2)."""
    mesh = triangulation(cells=cells)
    basis = Basis(mesh, Argyris(), intorder=10)
    bump = np.polynomial.Polynomial([1.0, 0.0, -2.0, 0.0, 1.0])

    def along(x, rate, k):
        binomials = [[1], [1, 1], [1, 2, 1], [1, 3, 3, 1], [1, 4, 6, 4, 1]][k]
        terms = (b * bump.deriv(i)(x) * rate ** (k - i) for i, b in enumerate(binomials))
        return sum(terms) * np.exp(rate * x)

    def exact(x, i, j):
        return along(x[0], 1.0, i) * along(x[1], 0.5, j)

    def load(v, w):
        return (exact(w.x, 4, 0) + 2.0 * exact(w.x, 2, 2) + exact(w.x, 0, 4)) * v

    stiffness = BilinearForm(lambda u, v, w: ddot(dd(u), dd(v))).assemble(basis)
    known, held = quintic_interpolated(basis, exact), basis.get_dofs()
    u = solve(*condense(stiffness, LinearForm(load).assemble(basis), x=known, D=held))
    x, found = np.asarray(basis.global_coordinates()), basis.interpolate(u).hess
    expected = np.array([[exact(x, 2, 0), exact(x, 1, 1)], [exact(x, 1, 1), exact(x, 0, 2)]])
    norms = [np.sqrt((f**2 * basis.dx).sum()) for f in (found - expected, expected)]
    return norms[0] / norms[1]


def test_clamped_plate_converges_with_the_fourth_power():
    """Curvatures of quintics: order h⁴."""
    errors = [clamped_plate_error(cells) for cells in (4, 8, 16)]
    assert errors[-1] < 1e-3
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(rates > 3.3), rates
    assert rates[-1] < 5.0
