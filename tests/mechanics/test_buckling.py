"""Plates under compression against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csc_matrix, csr_matrix, diags

from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import l2_projection, quadrature_points
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid
from anmstrip.linalg.solvers import Bordered, SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.shell import Membrane, isometric_bending
from anmstrip.results.wrinkles import buckling_modes, compressive_stiffness

LENGTH, WIDTH, THICKNESS = 1.0, 0.6, 1e-3


def plate_modes(along: float, across: float, count: int):
    """Factors and modes of a plate, all sides held in z, under membrane forces (N/m)."""
    strip, supports, tangent, compressive = matrices(along, across)
    return strip, supports, *buckling_modes(tangent, compressive, SparseSolver(), count)


def matrices(along: float, across: float):
    """Strip, supports, tangent and what compression takes off it."""
    mesh = grid(np.linspace(0.0, LENGTH, 13), np.linspace(0.0, WIDTH, 13))
    strip = Strip(mesh, THICKNESS, Material(2e11, 0.3))
    pattern, membrane = Pattern(strip), Membrane(strip)
    effects = [membrane, isometric_bending(strip, pattern)]
    model = Model(strip, pattern, effects, Scales(1.0, 1.0, 1.0))
    sides = np.concatenate([3 * edge.trace + 2 for edge in strip.edges.values()])
    plane = np.flatnonzero(np.arange(strip.unknowns) % 3 < 2)
    supports = Supports.at_rest(strip.unknowns, np.unique(np.concatenate([sides, plane])))
    points = quadrature_points(strip)
    strains = np.array([along - 0.3 * across, across - 0.3 * along]) / strip.tensile_stiffness
    stretches = np.sqrt(1.0 + 2.0 * strains) - 1.0
    moved = np.stack([*(stretches[:, None] * points[:2]), 0.0 * points[0]])
    full = l2_projection(strip, pattern, moved)
    supports = Supports(supports.free, full, supports.slope)
    equations = Equilibrium(model, supports, Controls({}))
    tangent = equations.recurrence(full[supports.free], 0.0, 1).tangent()
    blocks = compressive_stiffness(membrane, membrane.at(full), pattern)
    return strip, supports, tangent, model.pattern.restricted(supports.free).matrix(blocks)


def bearable(strip: Strip, tension: float, waves: tuple[int, int]) -> float:
    """[D (k² + q²)² + T q²] / k² for half waves along and across (N/m)."""
    q, k = waves[0] * np.pi / LENGTH, waves[1] * np.pi / WIDTH
    return (strip.bending_stiffness * (k**2 + q**2) ** 2 + tension * q**2) / k**2


@pytest.mark.parametrize("tension", [0.0, 1e3, 1e4])
def test_compression_across_a_strip_under_tension(tension):
    strip, _, factors, _ = plate_modes(tension, -100.0, 3)
    waves = [(m, n) for m in (1, 2) for n in range(1, 12)]
    expected = sorted(bearable(strip, tension, pair) for pair in waves)[:3]
    np.testing.assert_allclose(100.0 * factors, expected, rtol=2e-3)


def test_mode_has_its_half_waves():
    strip, supports, _, modes = plate_modes(1e6, -100.0, 1)
    waves = min(range(1, 12), key=lambda n: bearable(strip, 1e6, (1, n)))
    assert waves > 3
    z = supports.change(modes[:, 0], 0.0).reshape(-1, 3)[strip.node_values, 2]
    x, y = strip.mesh.p
    shape = np.sin(np.pi * x / LENGTH) * np.sin(waves * np.pi * y / WIDTH)
    np.testing.assert_allclose(z / np.abs(z).max(), shape * np.sign(z @ shape), atol=0.02)


def test_tension_is_no_compression():
    strip, *_ = plate_modes(1e4, -100.0, 1)
    membrane, pattern = Membrane(strip), Pattern(strip)
    points = quadrature_points(strip)
    full = l2_projection(strip, pattern, 1e-3 * np.stack([points[0], points[1], 0.0 * points[0]]))
    assert np.abs(compressive_stiffness(membrane, membrane.at(full), pattern).pairs).max() == 0.0


def test_factors_below_one_are_the_negative_eigenvalues():
    """Of a plate that is pressed beyond five of its limits."""
    strip, *_ = plate_modes(0.0, -100.0, 1)
    limits = sorted(bearable(strip, 0.0, (m, n)) for m in range(1, 9) for n in range(1, 9))
    tangent, compressive = matrices(0.0, -0.5 * (limits[4] + limits[5]))[2:]
    factors, _ = buckling_modes(tangent, compressive, SparseSolver(), 8)
    assert (factors < 1.0).sum() == SparseSolver().factorise(tangent).negatives == 5


def test_real_factors_below_one_tell_the_sign_of_the_determinant():
    """det K / det (K + G) = Π (1 − 1/μ), of matrices with a border that are not symmetric."""
    random = np.random.default_rng(3)
    n, others, signs = 40, 2, []
    border = csc_matrix((n, others)), csr_matrix((others, n)), np.zeros((others, others))
    for _ in range(12):
        stiff = csc_matrix(np.diag(random.uniform(1.0, 2.0, n)) + 0.05 * random.normal(size=(n, n)))
        narrow = random.normal(size=(n, 5))
        pressing = Bordered(csc_matrix(narrow @ narrow.T / n), *border)
        edge = [kind(random.normal(size=part.shape)) for kind, part in
                zip((csc_matrix, csr_matrix, np.asarray), border, strict=True)]  # fmt: skip
        tangent = Bordered(csc_matrix(stiff - pressing.inner), *edge)
        factors, modes = buckling_modes(tangent, pressing, SparseSolver(), 8)
        whole, rest = tangent.assembled().toarray(), (tangent + pressing).assembled().toarray()
        signs.append(np.linalg.slogdet(whole)[0] * np.linalg.slogdet(rest)[0])
        assert signs[-1] == (-1.0) ** (factors < 1.0).sum()
        for factor, mode in zip(factors, modes.T, strict=True):
            left = whole @ mode + (1.0 - factor) * (pressing @ mode)
            assert np.abs(left).max() < 1e-8 * abs(factor) * np.abs(mode).max()
    assert set(signs) == {-1.0, 1.0}


def test_factors_where_strip_is_unstable_without_compression():
    """K + G has a negative eigenvalue, as of strip that slides off a concave roller."""
    n, pressed = 300, 20
    lowest = 2.0 - 2.0 * np.cos(np.pi / (n + 1))
    sides = np.full(n - 1, -1.0)
    spared = diags([sides, np.full(n, 2.0 - lowest - 1e-6), sides], [-1, 0, 1], format="csc")
    pressing = diags([np.where(np.arange(n) < pressed, 0.1, 0.0)], [0], format="csc")
    assert SparseSolver().factorise(spared).negatives == 1
    exact = np.linalg.eigvals(np.linalg.solve(spared.toarray(), pressing.toarray()))
    exact = np.sort(1.0 / exact[exact.real > 1e-3].real)[:6]
    factors, _ = buckling_modes(csc_matrix(spared - pressing), pressing, SparseSolver(), 6)
    np.testing.assert_allclose(factors, exact, rtol=1e-6)
