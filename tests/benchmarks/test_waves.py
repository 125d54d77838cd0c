"""Edge waves and centre buckles of a strip with uneven fibres: onset, wavelength, and beyond."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.linalg import eigh

from anmstrip.continuation.bifurcations import Kind, SingularPoint, switched
from anmstrip.continuation.equations import Cost, size
from anmstrip.continuation.follow import follow
from anmstrip.linalg.solvers import SparseSolver
from claims import Claim

WAVES = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "waves.py"))
ROWS = [(t, name) for t, row in WAVES["REFERENCE"].items() for name in row]
DEGREE = 25


def ritz(name: str, tension: float, wavelength: float) -> float:
    """δ (W/t)² of w = f(y) sin(k x), with Legendre polynomials f; lengths in W, forces in D/W²."""
    k, nu = 2.0 * np.pi / wavelength, WAVES["POISSON"]
    eta, weights = np.polynomial.legendre.leggauss(2 * DEGREE)
    y, weights = 0.5 * eta, 0.5 * weights
    f = [np.polynomial.Legendre.basis(n, domain=[-0.5, 0.5]) for n in range(DEGREE)]
    f0, f1, f2 = (np.array([p.deriv(m)(y) if m else p(y) for p in f]) for m in range(3))
    bent = f2 - k * k * f0
    twice = np.einsum("ip,jp,p->ij", f0, f2, weights)
    stiffness = np.einsum("ip,jp,p->ij", bent, bent, weights)
    stiffness += (1.0 - nu) * k * k * (twice + twice.T)
    stiffness += 2.0 * (1.0 - nu) * k * k * np.einsum("ip,jp,p->ij", f1, f1, weights)
    stiffness += tension * k * k * np.einsum("ip,jp,p->ij", f0, f0, weights)
    uneven = np.einsum("ip,jp,p->ij", f0, f0, weights * WAVES["PROFILES"][name](y))
    uneven *= 12.0 * (1.0 - nu * nu) * k * k  # E t δ over D/W², for δ in (t/W)²
    share = eigh(uneven, stiffness, eigvals_only=True)
    return float(1.0 / share.max())


@pytest.mark.parametrize(("tension", "name"), ROWS)
def test_the_table_is_that_of_ritz(tension: float, name: str) -> None:
    delta, wave = WAVES["REFERENCE"][tension][name]
    lengths = wave * np.linspace(0.97, 1.03, 5)
    fit = Polynomial.fit(lengths, [ritz(name, tension, x) for x in lengths], 4)
    least = min(fit.deriv().roots().real, key=lambda x: abs(x - wave))
    assert fit(least) == pytest.approx(delta, rel=2e-4)
    assert least == pytest.approx(wave, rel=1.5e-3)


@pytest.mark.parametrize(
    ("tension", "name"),
    [pytest.param(*row, marks=() if row[0] == 1000 else pytest.mark.slow) for row in ROWS],
)
def test_onset_of_half_a_wave(claim: Claim, tension: float, name: str) -> None:
    """From the tangents of the flat strip, to 0.1 % of the table."""
    delta, wave = WAVES["onset"](name, tension, WAVES["REFERENCE"][tension][name])
    expected = WAVES["REFERENCE"][tension][name]
    quantity = f"onset of waves, long {name}, T W²/D = {tension}: δ (W/t)²"
    claim(quantity, delta, expected[0], 1e-3, "Ritz's method")
    assert wave == pytest.approx(expected[1], rel=5e-3)


def test_the_piece_waves_beyond_its_onset() -> None:
    """The waves set in gently: δ grows along them, as their height squared."""
    delta, wave = WAVES["REFERENCE"][1000]["centre"]
    piece = WAVES["half_wave"]("centre", 1000, wave, 1.2 * delta)
    state, control, mode = WAVES["first_wave"](piece)
    point = SingularPoint(Kind.BIFURCATION, state, control, mode / size(piece, mode), 0, 1)
    solver, cost = SparseSolver(), Cost()
    start, pace = switched(piece, point, 0.1 * WAVES["THICKNESS"], solver, 1e-6, cost)
    settings = WAVES["SETTINGS"]
    coefficients = []
    for step in follow(piece, start, solver=solver, settings=settings, pace=pace, cost=cost):
        u, reached = step.branch.end
        z = piece.supports.full(u, reached).reshape(-1, 3)[piece.model.strip.node_values, 2]
        height = np.abs(z).max() / WAVES["THICKNESS"]
        coefficients.append((reached - control) / height**2)
    assert reached == pytest.approx(1.0)
    assert height > 1.2
    assert coefficients == pytest.approx(np.full(len(coefficients), 0.0733), rel=0.025)
