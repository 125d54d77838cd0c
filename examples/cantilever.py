"""A cantilever bent by a force at its end, by series and by Newton's method.

Length 10 m, width 1 m, thickness 0.1 m, E = 1.2 MPa, ν = 0, force 4 N.  Expected: the tip
moves by U = −3.2894 m along the strip and W = 6.6997 m across it (an inextensible elastica
moves by −3.2894 and 6.6996 m), with 3 tangents of order 20.  Newton's method needs 56 on the
same mesh in load steps of adapted length, and 16 at best, when
the whole force is put on the straight strip at once.
"""

from dataclasses import dataclass

import numpy as np

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.newton import Corrections, Newton
from anmstrip.continuation.path import Cost
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.loads import edge_force
from anmstrip.mechanics.shell import Membrane, isometric_bending

LENGTH, FORCE, STIFFNESS = 10.0, 4.0, 100.0  # m, N/m, N m


@dataclass(frozen=True)
class Bent:
    """Tip displacement (m) and the tangents that it took."""

    tip: tuple[float, float]
    tangents: int

    def __str__(self) -> str:
        return f"U = {self.tip[0]:.6f} m, W = {self.tip[1]:.6f} m, {self.tangents} tangents"


def cantilever(cells: int = 16, thickness: float = 0.1) -> Equilibrium:
    """Return the equations; another thickness changes E so that the stiffness stays."""
    mesh = grid(np.linspace(0.0, LENGTH, cells + 1), np.array([-0.5, 0.5]))
    strip = Strip(mesh, thickness, Material(young=12.0 * STIFFNESS / thickness**3, poisson=0.0))
    pattern = Pattern(strip)
    effects = [Membrane(strip), isometric_bending(strip, pattern), edge_force(strip, "exit")]
    model = Model(strip, pattern, effects, Scales(LENGTH, FORCE, FORCE))
    supports = Supports.at_rest(strip.unknowns, strip.clamp("entry"))
    force = Controls({"exit.force": np.zeros(3)}, {"exit.force": np.array([0.0, 0.0, FORCE])})
    return Equilibrium(model, supports, force)


def bent(equations: Equilibrium, *, newton: bool = False, tolerance: float = 1e-4) -> Bent:
    """Follow the force from nothing to its full size."""
    strip, supports, cost = equations.model.strip, equations.supports, Cost()
    u = np.zeros(len(supports.free))
    if newton:
        u = load_steps(equations, u, cost)
    else:
        settings = Settings(order=20, tolerance=tolerance, arclength=True)
        *_, last = follow(equations, u, solver=SparseSolver(), settings=settings, cost=cost)
        u = last.branch.end[0]
    tip = supports.full(u, 1.0).reshape(-1, 3)[strip.edges["exit"].values].mean(axis=0)
    return Bent((float(tip[0]), float(tip[2])), cost.factorisations)


def load_steps(equations: Equilibrium, u: np.ndarray, cost: Cost) -> np.ndarray:
    """Return the state under the full force, by Newton's method in steps of the load.

    They grow and shrink with the iterations that they take; one that fails is halved.
    """
    newton = Newton(equations, SparseSolver(), Corrections(halvings=0), cost)
    load, size = 0.0, 0.1
    while load < 1.0:
        aim = min(1.0, load + size)
        found = newton.corrected(u, aim)
        if found is None:
            size = 0.5 * (aim - load)
        else:
            u, load = found.u, aim
            size *= float(np.clip(np.sqrt(8.0 / max(found.iterations, 1)), 0.5, 2.0))
    return u


def main() -> tuple[Bent, Bent]:
    """Bend it twice and compare."""
    equations = cantilever()
    series, newton = bent(equations), bent(equations, newton=True)
    print(f"series: {series}\nNewton: {newton}")
    for found in (series, newton):
        assert np.allclose(found.tip, (-3.28944, 6.69973), atol=1e-5)
    assert series.tangents <= 3
    assert newton.tangents > 10 * series.tangents
    return series, newton


if __name__ == "__main__":
    main()
