"""C1 elements: bicubics are exact wherever the strip lies, and joins are smooth."""

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder, polyval2d
from skfem import Basis, MeshQuad
from skfem.element import ElementQuadBFS

from anmstrip.mechanics.elements import BognerFoxSchmit

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
