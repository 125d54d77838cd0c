"""Edge waves and centre buckles of a strip with uneven fibres: onset, wavelength, and beyond."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.linalg import eigh
from skfem import (
    Basis,
    BilinearForm,
    DiscreteField,
    ElementQuad2,
    ElementVector,
    LinearForm,
    MeshQuad,
    condense,
    solve,
)
from skfem.helpers import ddot, sym_grad

from anmstrip import Scene
from anmstrip.continuation.bifurcations import Kind, SingularPoint, switch_branch
from anmstrip.continuation.follow import follow
from anmstrip.continuation.path import Cost, size
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
    start, pace = switch_branch(piece, point, 0.1 * WAVES["THICKNESS"], solver, 1e-6, cost)
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


def crowned_span(crown: float, n: int = 12) -> float:
    """ΔT (K) at which a flat span with a hot middle waves, of the strip of :func:`between_crowns`.

    Plane stress by quadratic elements: heat that fades beyond the rollers, and a crown there, which
    leaves fibres at the edges too long.  Then Ritz's method as in :func:`clamped_span`.
    """
    nu, t, alpha, basis = WAVES["POISSON"], 5e-4, 1.2e-5, np.polynomial.Legendre.basis
    parts, x = (CROWNED["lead"], CROWNED["arc"], 1.0, CROWNED["arc"], CROWNED["lead"]), [0.0]
    for part in parts:
        count = max(4, int(np.ceil(part * n)))
        x += list(x[-1] + part * (0.5 - 0.5 * np.cos(np.pi * np.arange(1, count + 1) / count)))
    across = 0.5 * np.sin(0.5 * np.pi * np.linspace(-1.0, 1.0, n + 1))
    mesh = MeshQuad.init_tensor(np.array(x) - 0.5 * x[-1], across)
    plane = Basis(mesh, ElementVector(ElementQuad2()), intorder=5)
    at = np.asarray(plane.global_coordinates())
    flexible = np.array([[1.0, -nu, 0.0], [-nu, 1.0, 0.0], [0.0, 0.0, 2.0 * (1.0 + nu)]])
    stiff = 2e11 * t * np.linalg.inv(flexible)

    def forces(strain: np.ndarray) -> np.ndarray:
        """N from (2, 2, …) strains, in their order."""
        xx, yy, xy = np.einsum(
            "ab,b...->a...", stiff, [strain[0, 0], strain[1, 1], 2.0 * strain[0, 1]]
        )
        return np.array([[xx, xy], [xy, yy]])

    uneven = np.zeros((2, 2, 2, *at.shape[1:]))
    fading = np.clip((0.5 * x[-1] - np.abs(at[0])) / CROWNED["lead"], 0.0, 1.0)
    uneven[0, 0, 0] = uneven[0, 1, 1] = alpha * (1.0 / 3.0 - 4.0 * at[1] ** 2) * fading
    on_rollers = np.abs(np.abs(at[0]) - 0.5 * (1.0 + CROWNED["arc"])) < 0.5 * CROWNED["arc"]
    uneven[1, 0, 0] = on_rollers * 4.0 * at[1] ** 2 * crown / CROWNED["radius"]
    stiffness = BilinearForm(lambda u, v, _: ddot(forces(sym_grad(u)), sym_grad(v))).assemble(plane)
    entry = plane.get_dofs(lambda p: np.isclose(p[0], mesh.p[0].min()))
    middle = np.argmin(np.hypot(mesh.p[0] - mesh.p[0].min(), mesh.p[1]))
    held = np.append(entry.all("u^1"), plane.nodal_dofs[1, middle])
    span = (np.abs(at[0]) < 0.5).all(axis=1)
    made = []
    for strain in uneven:
        load = LinearForm(lambda v, w: ddot(forces(w.e), sym_grad(v)))
        e = DiscreteField(strain)
        u = solve(*condense(stiffness, load.assemble(plane, e=e), D=held))
        made.append(forces(np.asarray(sym_grad(plane.interpolate(u))) - strain)[:, :, span])
    x, y, w = at[0, span].ravel(), at[1, span].ravel(), plane.dx[span].ravel()
    xi = basis(1, domain=[-0.5, 0.5])
    rows = [(1.0 - xi * xi) ** 2 * basis(m, domain=[-0.5, 0.5]) for m in range(16)]
    columns = [basis(m, domain=[-0.5, 0.5]) for m in range(16)]
    f, g = (
        [np.array([p.deriv(k)(s) if k else p(s) for p in part]) for k in range(3)]
        for part, s in ((rows, x), (columns, y))
    )
    d = {
        (a, b): np.einsum("mp,np->mnp", f[a], g[b]).reshape(-1, len(w))
        for a in range(3) for b in range(3 - a)
    }  # fmt: skip
    rigid = t**2 / 12.0 * stiff
    bent = np.array([d[2, 0], d[0, 2], 2.0 * d[1, 1]])
    bending = np.einsum("aip,ab,bjp,p->ij", bent, rigid, bent, w, optimize=True)
    slopes = np.array([d[1, 0], d[0, 1]])
    heat, crowned, pulled = (
        np.einsum("aip,abp,bjp,p->ij", slopes, n, slopes, w, optimize=True)
        for n in (*(n.reshape(2, 2, -1) for n in made), np.diag([5e3, 0.0])[..., None] + 0.0 * w)
    )
    return float(1.0 / eigh(-heat, bending + pulled + crowned, eigvals_only=True).max())


CROWNED = {"radius": 10.0, "arc": 0.5, "lead": 0.3}
"""Rollers of :func:`between_crowns`, and the strip on them and beyond them (m)."""


def between_crowns(crown: float, heat: float) -> Scene:
    """A span of 1 m between a roller below and one above, with a middle that becomes hotter.

    Heat fades from the rollers to the ends: a hot middle that goes on there lifts off its roller.
    """
    radius, arc, lead = CROWNED.values()
    angle = arc / radius
    along = radius * np.sin(angle) + lead * np.cos(angle)
    off = radius * (1.0 - np.cos(angle)) + lead * np.sin(angle)
    tables = {
        "strip": {"width": 1.0, "thickness": 5e-4, "cells": [16, 8], "refined": 0.05},
        "material": {"young": 2e11, "poisson": 0.3, "expansion": 1.2e-5},
        "contact": {},
        "rollers": [
            {"name": name, "radius": radius, "centre": [x, 0.0, z], "wrap": wrap,
             "crown": [0.0, -4.0 * crown]}
            for name, x, z, wrap in (("a", 0.0, -radius, "over"), ("b", 1.0, radius, "under"))
        ],
        "threading": {"tension": 5e3, "entry": [-along, 0.0, -off],
                      "exit": [1.0 + along, 0.0, off]},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"centred": True}},
        "stages": [
            {
                "duration": 1.0, "friction": False,
                "strip": {"temperature": {
                    "across": [heat / 3.0, 0.0, -4.0 * heat],
                    "along": [[0.0, 0.0], [lead, 1.0], [1.0 + lead + 2.0 * arc, 1.0],
                              [1.0 + 2.0 * (lead + arc), 0.0]],
                }},
            }
        ],
    }  # fmt: skip
    return Scene.from_tables(tables, "crowned.toml")


@pytest.mark.parametrize(
    ("crown", "share"),
    [
        (0.0, 0.03),
        pytest.param(4e-4, 0.04, marks=pytest.mark.slow),
        pytest.param(8e-4, 0.04, marks=pytest.mark.slow),
    ],
)
def test_heated_span_between_crowned_rollers_waves_where_a_flat_one_buckles(
    claim: Claim, crown: float, share: float
) -> None:
    """Rollers bend the strip a little as it buckles: told where waves are half a thickness high.

    The reference place counts from the middle of the span.
    """
    run = between_crowns(crown, 16.0).run()
    list(run)
    (told,) = run.wrinkles
    assert told["kind"] == "waves" and "half its thickness" in run.message
    assert abs(told["x"]) < 0.25 and abs(told["y"]) < 0.15
    label = f"heated span between rollers with a crown of {1e3 * crown:g} mm: ΔT (K) of waves"
    heat, expected = 16.0 * (told["time"] - 1.0), crowned_span(crown)
    claim(label, heat, expected, share, "plane stress and Ritz's method, flat span")
