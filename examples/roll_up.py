"""A strip rolled up to a full circle by a moment at its end.

Length 12, width 1, thickness 0.1, E = 1.2e6, ν = 0 (Sze, Liu & Lo 2004, §3.2).  Without stretch
the tip follows U = L (sin θ/θ − 1), W = L (1 − cos θ)/θ with θ = M L/D.  Expected: at most 6
tangents of order 20 to the full circle, 4 with 16 elements, and 0.03 % off the formula.
"""

from __future__ import annotations

import argparse

import numpy as np

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Cost, Path
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.loads import edge_moment
from anmstrip.mechanics.shell import KirchhoffLove, Membrane

LENGTH = 12.0


def strip_with_moment(cells: int) -> Equilibrium:
    """Return equations whose control is the share of the moment that makes a full circle."""
    mesh = grid(np.linspace(0.0, LENGTH, cells + 1), np.array([-0.5, 0.5]))
    strip = Strip(mesh, 0.1, Material(1.2e6, 0.0))
    moment, pattern = edge_moment(strip, "exit"), Pattern(strip)
    size = 4.0 * strip.bending_stiffness / LENGTH**2
    effects = [Membrane(strip), KirchhoffLove(strip), moment]
    model = Model(strip, pattern, effects, Scales(LENGTH, size, size))
    full = np.asarray(2.0 * np.pi * strip.bending_stiffness / LENGTH)
    growing = Controls({moment.control: np.zeros_like(full)}, {moment.control: full})
    return Equilibrium(model, Supports.at_rest(strip.unknowns, strip.clamp("entry")), growing)


def main(cells: int) -> None:
    """Roll it up and compare along the way."""
    equations, cost = strip_with_moment(cells), Cost()
    supports, end = equations.supports, equations.model.strip.edges["exit"].values
    settings = Settings(order=20, tolerance=1e-4, arclength=True, rational=True)
    start = np.zeros(len(supports.free))
    steps = follow(equations, start, solver=SparseSolver(), settings=settings, cost=cost)
    path = Path(tuple(step.branch for step in steps))
    shares = np.linspace(0.05, 1.0, 20)
    tips = [supports.full(path(share), 0.0).reshape(-1, 3)[end].mean(axis=0) for share in shares]
    angle = 2.0 * np.pi * shares
    exact = LENGTH * np.stack([np.sin(angle) / angle - 1.0, (1.0 - np.cos(angle)) / angle])
    error = np.abs(np.array(tips)[:, [0, 2]].T - exact).max() / np.abs(exact).max()
    print(f"{cells} elements, {cost.factorisations} tangents, {100 * error:.3f} % off the formula")
    assert cost.factorisations <= 6
    assert error < 1.5e-3


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="half the elements")
    main(8 if parser.parse_args().quick else 16)
