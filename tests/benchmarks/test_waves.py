"""Edge waves and centre buckles of a strip with uneven fibres: onset, wavelength, and beyond."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.linalg import eigh

from anmstrip import Scene
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


def clamped_span(tension: float, length: float, along: int = 24, across: int = 10) -> float:
    """δ (W/t)² of a span with long edges that is clamped at both ends; lengths in W.

    By Ritz's method with products of polynomials, (1 − ξ²)² P_m(ξ) along and P_n(η) across.
    """
    nu, basis = WAVES["POISSON"], np.polynomial.Legendre.basis
    x, wx = np.polynomial.legendre.leggauss(2 * along)
    y, wy = np.polynomial.legendre.leggauss(2 * across)
    x, wx, y, wy = 0.5 * length * x, 0.5 * length * wx, 0.5 * y, 0.5 * wy
    span = [-0.5 * length, 0.5 * length]
    xi = basis(1, domain=span)
    rows = [(1.0 - xi * xi) ** 2 * basis(m, domain=span) for m in range(along)]
    columns = [basis(n, domain=[-0.5, 0.5]) for n in range(across)]
    f, g = (
        [np.array([p.deriv(k)(at) if k else p(at) for p in part]) for k in range(3)]
        for part, at in ((rows, x), (columns, y))
    )

    def product(a: int, b: int, c: int, d: int, uneven: np.ndarray | float = 1.0) -> np.ndarray:
        """∫∫ of the a-th times the b-th derivative along, and of c-th times d-th across."""
        return np.kron((f[a] * wx) @ f[b].T, (g[c] * wy * uneven) @ g[d].T)

    stiffness = product(2, 2, 0, 0) + product(0, 0, 2, 2) + 2.0 * (1.0 - nu) * product(1, 1, 1, 1)
    stiffness += nu * (product(2, 0, 0, 2) + product(0, 2, 2, 0)) + tension * product(1, 1, 0, 0)
    compressed = product(1, 1, 0, 0, 12.0 * (1.0 - nu**2) * WAVES["PROFILES"]["edges"](y))
    return float(1.0 / eigh(compressed, stiffness, eigvals_only=True).max())


@pytest.mark.slow
def test_heated_span_between_rollers_buckles_as_a_clamped_one(claim: Claim) -> None:
    """The temperature is ΔT (4 η² − 1/3), so that α ΔT is δ of long edges.

    About to wrinkle is told where 1.01 times the compression would do it.
    """
    thickness, alpha, force, end = 5e-4, 1.2e-5, 5e3, 9.15  # m, 1/K, N/m, K
    rollers = [
        {"name": n, "radius": 0.2, "centre": [x, 0.0, -0.2], "wrap": "over"}
        for n, x in (("a", 0.0), ("b", 2.8))
    ]
    tables = {
        "strip": {"width": 1.0, "thickness": thickness, "cells": [33, 8], "refined": 0.09},
        "material": {"young": 2e11, "poisson": 0.3, "expansion": alpha},
        "contact": {},
        "rollers": rollers,
        "threading": {"tension": force, "entry": [-0.3, 0.0, -0.15], "exit": [3.1, 0.0, -0.15]},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"centred": True}},
        "stages": [
            {
                "duration": 1.0, "friction": False,
                "strip": {"temperature": {"across": [-end / 3.0, 0.0, 4.0 * end]}},
            }
        ],
        "solver": {"tolerance": 1e-5},
    }  # fmt: skip
    run = Scene.from_tables(tables, "heated.toml").run()
    list(run)
    onset = next(told for told in run.wrinkles if told["kind"] == "wrinkles")
    rigidity = 2e11 * thickness**3 / (12.0 * (1.0 - WAVES["POISSON"] ** 2))
    expected = clamped_span(force / rigidity, 2.8) * thickness**2 / alpha
    heat = end * (onset["time"] - 1.0)
    told = "edges of a heated span between rollers: ΔT (K) at which it is about to wave"
    claim(told, heat, expected, 0.01, "Ritz's method, clamped ends")
    lengths = np.linspace(0.6, 0.8, 9)
    fit = Polynomial.fit(lengths, [ritz("edges", force / rigidity, x) for x in lengths], 4)
    wave = next(x for x in fit.deriv().roots().real if 0.6 < x < 0.8)
    told = "edges of a heated span between rollers: wavelength along (m)"
    claim(told, onset["wavelength_along"], wave, 0.05, "Ritz's method, endless")
