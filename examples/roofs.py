"""Hinged cylindrical roofs pressed at the centre: snap-through, snap-back, and to one side.

Radius 2540 mm, length 508 mm, half angle 0.1, thickness 12.7 and 6.35 mm, E = 3102.75 N/mm²,
ν = 0.3 (Sze, Liu & Lo 2004, §3.8).  Expected, in shares of 3000 N: a quarter of the thick roof has
limit points at 0.7418 and 0.1702, of the thin one at 0.1950 and −0.1288 with a loop in
displacement between; 6 and 10 tangents of order 20.  The whole thin roof loses its symmetry at
0.1744 already, before that limit point; the mode leans to one side, and the path that crosses
there goes down from it.  Shapes and modes are written for ParaView.
"""

from __future__ import annotations

import argparse
from itertools import islice
from pathlib import Path

from anmstrip.continuation.bifurcations import Kind, SingularPoint, switched
from anmstrip.continuation.follow import follow
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.studies.benchmarks import Benchmark, hinged_roof
from anmstrip.studies.shell_pictures import write_shape
from anmstrip.studies.shell_runs import followed, settings

LIMITS = {12.7: (0.7418, 0.1702), 6.35: (0.1950, -0.1288)}


def quarter(thickness: float, cells: int) -> None:
    """Through both limit points to the end of the table."""
    found = followed(hinged_roof(thickness, cells), settings(), watch=True)
    print(f"t = {thickness} mm, {found.tangents} tangents")
    for point, expected in zip(found.points, LIMITS[thickness], strict=True):
        print(f"  {point.kind.value} at {point.control:.4f}")
        assert abs(point.control - expected) < 6e-4
    assert found.tangents <= 15


def whole(cells: int, directory: Path) -> SingularPoint:
    """The first bifurcation of the thin roof, and the path that crosses there."""
    roof = hinged_roof(6.35, cells, whole=True)
    found = followed(roof, settings(tolerance=1e-6), watch=True)
    for point in found.points:
        read = roof.reading(point.u)[0]
        print(f"  {point.kind.value} at {point.control:.4f}, −W = {read:.2f} mm")
    first = found.points[0]
    assert first.kind is Kind.BIFURCATION
    directory.mkdir(parents=True, exist_ok=True)
    write_shape(directory / "mode.vtu", roof.equations, first.u, {"mode": first.mode})
    loads = aside(roof, first, directory)
    assert max(loads) < first.control
    return first


def aside(roof: Benchmark, point: SingularPoint, directory: Path, steps: int = 4) -> list[float]:
    """Some steps on the other path; loads at their ends."""
    equations, solver = roof.equations, SparseSolver()
    u, pace = switched(equations, point, 0.02, solver, 1e-8)
    path = follow(equations, u, solver=solver, settings=settings(tolerance=1e-6), pace=pace)
    loads = [pace.control]
    for number, step in enumerate(islice(path, steps)):
        u, load = step.branch.end
        loads.append(load)
        write_shape(directory / f"aside_{number}.vtu", roof.equations, u)
    print(f"  aside: {', '.join(f'{load:.4f}' for load in loads)}")
    return loads


def main(cells: int, across: int, directory: Path) -> None:
    """Quarters, then the whole."""
    for thickness in LIMITS:
        quarter(thickness, cells)
    print("the whole thin roof")
    whole(across, directory)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarser meshes")
    parser.add_argument("-o", type=Path, default=Path("results/roofs"), help="where to write")
    given = parser.parse_args()
    main(*((5, 6) if given.quick else (8, 10)), given.o)
