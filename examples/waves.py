"""Edge waves and centre buckles: how uneven a strip under tension may be, and how it waves.

Fibres of a long strip are too long by δ g(y/W): near both edges, in the middle, or towards one
edge.  Under a tension T it stays flat up to a critical δ, told as δ (W/t)²; there it waves with the
wavelength λ for which that is least.  Expected, for T W²/D from 100 to 10 000 and ν = 0.3: the
table REFERENCE, δ within 0.1 %.  The piece that is computed is half a wave, between two lines on
which the strip stays straight and at its height.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from anmstrip.continuation.follow import Settings, follow
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import quadrature_points
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.shell import Membrane, isometric_bending, uniaxial_stretches
from anmstrip.results.wrinkles import buckling_modes

WIDTH, THICKNESS, POISSON = 1.0, 5e-4, 0.3  # E = 1 does not matter

PROFILES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "edges": lambda eta: 4.0 * eta**2 - 1.0 / 3.0,
    "centre": lambda eta: 1.0 / 3.0 - 4.0 * eta**2,
    "one edge": lambda eta: 2.0 * eta,
}

REFERENCE = {
    100: {"edges": (38.09, 2.066), "centre": (58.40, 1.663), "one edge": (15.50, 2.660)},
    300: {"edges": (84.48, 1.277), "centre": (129.91, 1.273), "one edge": (39.29, 1.891)},
    1000: {"edges": (221.79, 0.894), "centre": (354.06, 0.936), "one edge": (115.88, 1.318)},
    3000: {"edges": (573.77, 0.639), "centre": (954.45, 0.730), "one edge": (322.86, 0.937)},
    10000: {"edges": (1713.1, 0.438), "centre": (2977.3, 0.549), "one edge": (1019.3, 0.638)},
}
"""T W²/D and profile → δ (W/t)² and λ/W, by Ritz's method for w = f(y) sin(2 π x/λ)."""

SETTINGS = Settings(order=15, tolerance=1e-6, arclength=True, rational=True)

SHARE = 0.5
"""δ at which the flat piece is looked at, over the guess of the critical one."""

ALONG, ACROSS = 8, 20
"""Elements of half a wave, and of the width."""


def half_wave(name: str, tension: float, wavelength: float, most: float) -> Equilibrium:
    """Return equations of half a wave under T W²/D, of which the control brings in δ (W/t)²."""
    lines = (
        0.5 * WIDTH * np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, ACROSS + 1))
    )  # fine at edges
    mesh = grid(np.linspace(0.0, 0.5 * wavelength * WIDTH, ALONG + 1), lines)
    strip = Strip(mesh, THICKNESS, Material(1.0, POISSON))
    force = tension * strip.bending_stiffness / WIDTH**2
    pattern = Pattern(strip)
    effects = [Membrane(strip), isometric_bending(strip, pattern)]
    model = Model(strip, pattern, effects, Scales(WIDTH, force * WIDTH, force))
    held = [strip.edge_unknowns(end, [0, 2], (), ()) for end in ("entry", "exit")]
    held.append(3 * strip.node_values[[np.abs(mesh.p[1]).argmin()]] + 1)
    rest = Supports.at_rest(strip.unknowns, np.unique(np.concatenate(held)))
    pulled = np.zeros((strip.scalars, 3))  # uniformly, which holds at the ends
    for c, stretch in enumerate(uniaxial_stretches(force, strip.tensile_stiffness, POISSON)):
        pulled[strip.node_values, c] = (stretch - 1.0) * mesh.p[c]
        pulled[strip.dofs(("u_x", "u_y")[c]), c] = stretch - 1.0
    uneven = PROFILES[name](quadrature_points(strip)[1] / WIDTH) * most * (THICKNESS / WIDTH) ** 2
    controls = Controls({"strip.flatness": 0.0 * uneven}, {"strip.flatness": uneven})
    return Equilibrium(model, Supports(rest.free, pulled.ravel(), rest.slope), controls)


def first_wave(piece: Equilibrium) -> tuple[np.ndarray, float, np.ndarray]:
    """Return state, control and mode at which the flat piece, whose forces go with δ, waves."""
    solver, start = SparseSolver(), np.zeros(len(piece.supports.free))
    branches = [step.branch for step in follow(piece, start, solver=solver, settings=SETTINGS)]
    ends = [branches[0](0.0), branches[-1].end]
    even, uneven = (piece.recurrence(*end, 1).tangent() for end in ends)
    factors, modes = buckling_modes(uneven, even - uneven, solver, 1)
    (before, _), (after, _) = ends
    return before + factors[0] * (after - before), float(factors[0]), modes[:, 0]


def critical(name: str, tension: float, wavelength: float, guess: float) -> float:
    """Return δ (W/t)² at which waves of a length λ/W set in."""
    most = SHARE * guess
    return most * first_wave(half_wave(name, tension, wavelength, most))[1]


def onset(name: str, tension: float, guess: tuple[float, float]) -> tuple[float, float]:
    """Return the least critical δ (W/t)², and its λ/W, by a parabola about a guess of both."""
    delta, wave = guess
    lengths = wave * np.array([0.95, 1.0, 1.05])
    parabola = np.polyfit(lengths, [critical(name, tension, x, delta) for x in lengths], 2)
    least = -0.5 * parabola[1] / parabola[0]
    return float(np.polyval(parabola, least)), float(least)


def main(tensions: list[int]) -> None:
    """Compare the onsets with the table."""
    for tension in tensions:
        for name, expected in REFERENCE[tension].items():
            delta, wave = onset(name, tension, expected)
            print(f"T W²/D = {tension}, long {name}: δ (W/t)² = {delta:.2f}, λ/W = {wave:.3f}")
            assert abs(delta / expected[0] - 1.0) < 1e-3
            assert abs(wave / expected[1] - 1.0) < 5e-3


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="T W²/D = 1000 alone")
    main([1000] if parser.parse_args().quick else list(REFERENCE))
