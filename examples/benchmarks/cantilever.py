"""A cantilever bent by a force at its end: the equations, and the elastica that it tends to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid
from anmstrip.mechanics.effects import Controls, Effect
from anmstrip.mechanics.loads import edge_force
from anmstrip.mechanics.shell import Membrane, isometric_bending

Array = NDArray[np.float64]

LENGTH, FORCE, BENDING_STIFFNESS = 10.0, 4.0, 100.0
"""m, N/m, N m: P L²/D = 4."""


def cantilever(cells: int = 16, thickness: float = 0.1) -> Equilibrium:
    """Return the equations of a strip 1 m wide, clamped at its entry and pulled up at its exit.

    Another thickness changes E so that the bending stiffness stays; ν = 0.
    """
    mesh = grid(np.linspace(0.0, LENGTH, cells + 1), np.array([-0.5, 0.5]))
    young = 12.0 * BENDING_STIFFNESS / thickness**3
    strip = Strip(mesh, thickness, Material(young=young, poisson=0.0))
    pattern = Pattern(strip)
    effects: list[Effect] = [
        Membrane(strip),
        isometric_bending(strip, pattern),
        edge_force(strip, "exit"),
    ]
    model = Model(strip, pattern, effects, Scales(LENGTH, FORCE, FORCE))
    supports = Supports.at_rest(strip.unknowns, strip.clamp("entry"))
    force = Controls({"exit.force": np.zeros(3)}, {"exit.force": np.array([0.0, 0.0, FORCE])})
    return Equilibrium(model, supports, force)


def tip(equations: Equilibrium, u: Array) -> Array:
    """Return the displacement of the loaded end (m), along and across the strip."""
    strip, full = equations.model.strip, equations.supports.full(u, 1.0)
    place: Array = full.reshape(-1, 3)[strip.edges["exit"].values].mean(axis=0)
    return place[[0, 2]]


def elastica(load: float = FORCE * LENGTH**2 / BENDING_STIFFNESS) -> Array:
    """Return the tip displacement over the length of an inextensible cantilever.

    Parameters
    ----------
    load : float
        α = P L²/D.

    Notes
    -----
    With sin φ = 1/(k √2), the modulus k solves √α = K(k) − F(φ, k).  Then the tip's slope is
    sin θ = 2k² − 1, and it is at 1 + u = √(2 sin θ/α) along, and at
    w = 1 − 2 (E(k) − E(φ, k))/√α across (Bisshopp & Drucker 1945).

    Examples
    --------
    >>> elastica(4.0).round(6)
    array([-0.328941,  0.669964])
    """

    def amplitude(k: float) -> float:
        return float(np.arcsin(1.0 / (k * np.sqrt(2.0))))

    def excess(k: float) -> float:
        return float(ellipk(k * k) - ellipkinc(amplitude(k), k * k) - np.sqrt(load))

    k = brentq(excess, np.sqrt(0.5) * (1.0 + 1e-12), 1.0 - 1e-12, xtol=1e-15)
    across = 1.0 - 2.0 / np.sqrt(load) * (ellipe(k * k) - ellipeinc(amplitude(k), k * k))
    return np.array([np.sqrt(2.0 * (2.0 * k * k - 1.0) / load) - 1.0, across])
