"""A cantilever bent by a force at its end, by series and by Newton's method.

Length 10 m, width 1 m, thickness 0.1 m, E = 1.2 MPa, ν = 0, force 4 N.  Expected: the tip
moves by U = −3.2894 m along the strip and W = 6.6997 m across it (an inextensible elastica
moves by −3.2894 and 6.6996 m), with 3 tangents of order 20.  Newton's method needs 56 on the
same mesh in load steps of adapted length, and 16 at best, when
the whole force is put on the straight strip at once.
"""

from dataclasses import dataclass

import numpy as np

from anmstrip.continuation.expansion import Cost
from anmstrip.continuation.follow import Settings, follow
from anmstrip.equilibrium import Equilibrium
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.studies.cantilever import cantilever
from anmstrip.studies.newton import load_steps


@dataclass(frozen=True)
class Bent:
    """Tip displacement (m), tangents that it took, and what it was made with."""

    tip: tuple[float, float]
    tangents: int

    def __str__(self) -> str:
        return f"U = {self.tip[0]:.6f} m, W = {self.tip[1]:.6f} m, {self.tangents} tangents"


def bent(equations: Equilibrium, *, newton: bool = False, tolerance: float = 1e-4) -> Bent:
    """Follow the force from nothing to its full size."""
    strip, supports, cost = equations.model.strip, equations.supports, Cost()
    u, choices = np.zeros(len(supports.free)), {"solver": SparseSolver(), "cost": cost}
    if newton:
        *_, last = load_steps(equations, u, **choices)
        u = last.u
    else:
        settings = Settings(order=20, tolerance=tolerance, arclength=True)
        *_, last = follow(equations, u, settings=settings, **choices)
        u = last.branch.end[0]
    tip = supports.full(u, 1.0).reshape(-1, 3)[strip.edges["exit"].values].mean(axis=0)
    return Bent((float(tip[0]), float(tip[2])), cost.factorisations)


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
