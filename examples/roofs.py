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

import numpy as np

from anmstrip.continuation.bifurcations import (
    Kind,
    SingularPoint,
    switch_branch,
    watch_singular_points,
)
from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Cost
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.fem.geometry import reference_surface
from anmstrip.fem.operators import Pattern
from anmstrip.fem.strip import Material, Scales, Strip, Supports, grid, simple_support, symmetry
from anmstrip.linalg.solvers import Remembering, SparseSolver
from anmstrip.mechanics.effects import Controls, LoadEffect
from anmstrip.mechanics.shell import KirchhoffLove, Membrane
from anmstrip.results.fields import FieldSampler
from anmstrip.results.vtk import write_surface

RADIUS, HALF_LENGTH, ANGLE, FORCE = 2540.0, 254.0, 0.1, 3000.0  # mm, mm, rad, N

LIMITS = {12.7: (0.7418, 0.1702), 6.35: (0.1950, -0.1288)}
"""Limit points by thickness."""

ENDS = {12.7: 1.0835, 6.35: 1.0313}
"""Where the published tables end."""


def hinged_roof(thickness: float, cells: int, *, whole: bool = False) -> Equilibrium:
    """Return equations of a quarter with its symmetry, or of the whole roof, which may lose it.

    Elements become small under the force, where moments grow like a logarithm.
    """
    shares = np.linspace(-1.0 if whole else 0.0, 1.0, cells + 1)
    shares = np.sign(shares) * np.abs(shares) ** 1.5
    roof = reference_surface(lambda x, a: RADIUS * np.stack([x / RADIUS, np.sin(a), np.cos(a)]))
    mesh = grid(HALF_LENGTH * shares, ANGLE * shares)
    strip = Strip(mesh, thickness, Material(3102.75, 0.3), surface=roof)
    held = [simple_support(strip, "left", component) for component in range(3)]
    if whole:
        held += [simple_support(strip, "right", component) for component in range(3)]
    else:
        held += [symmetry(strip, "entry", 0), symmetry(strip, "right", 1)]
    point = LoadEffect("point force", "point.force", np.zeros(strip.scalars), strip.kinematics)
    point.load[middle(strip)] = 1.0
    force = FORCE * (1.0 if whole else 0.25)
    effects = [Membrane(strip), KirchhoffLove(strip), point]
    model = Model(strip, Pattern(strip), effects, Scales(10.0, force, 1.0))
    supports = Supports.at_rest(strip.unknowns, np.unique(np.concatenate(held)))
    down = Controls({point.control: np.zeros(3)}, {point.control: np.array([0.0, 0.0, -force])})
    return Equilibrium(model, supports, down)


def middle(strip: Strip) -> int:
    """Return the unknown of the position of the loaded node."""
    return int(strip.node_values[np.abs(strip.mesh.p).sum(axis=0).argmin()])


def singular_points(
    roof: Equilibrium, thickness: float, tolerance: float
) -> tuple[list[SingularPoint], int]:
    """Return limit points and bifurcations up to the end of the table, and the path's tangents."""
    solver, cost = Remembering(SparseSolver()), Cost()
    settings = Settings(order=20, tolerance=tolerance, arclength=True, rational=True)
    start, end = np.zeros(len(roof.supports.free)), ENDS[thickness]
    steps = follow(roof, start, solver=solver, settings=settings, target=end, cost=cost)
    points = [
        point
        for _, found in watch_singular_points(roof, steps, solver, settings)
        for point in found
    ]
    return points, cost.factorisations


def write_shape(
    path: Path, roof: Equilibrium, u: np.ndarray, mode: np.ndarray | None = None
) -> None:
    """Write a deformed roof with its displacement, and a mode."""
    surface = FieldSampler(roof.model.strip)
    fields = {"displacement": surface.interpolate(roof.supports.full(u, 0.0))}
    if mode is not None:
        fields["mode"] = surface.interpolate(roof.supports.change(mode, 0.0))
    write_surface(path, surface.reference.T + fields["displacement"], surface.cells, fields)


def aside(roof: Equilibrium, point: SingularPoint, directory: Path, steps: int = 4) -> list[float]:
    """Take some steps on the path that crosses at a bifurcation; return the loads."""
    solver = SparseSolver()
    settings = Settings(order=20, tolerance=1e-6, arclength=True, rational=True)
    u, pace = switch_branch(roof, point, 0.02, solver, 1e-8)
    path, loads = follow(roof, u, solver=solver, settings=settings, pace=pace), [pace.control]
    for number, step in enumerate(islice(path, steps)):
        u, load = step.branch.end
        loads.append(load)
        write_shape(directory / f"aside_{number}.vtu", roof, u)
    print(f"  aside: {', '.join(f'{load:.4f}' for load in loads)}")
    return loads


def main(cells: int, across: int, directory: Path) -> None:
    """Press quarters through both limit points, then the whole thin roof to one side."""
    for thickness, expected in LIMITS.items():
        points, tangents = singular_points(hinged_roof(thickness, cells), thickness, 1e-4)
        print(f"t = {thickness} mm, {tangents} tangents")
        for point, load in zip(points, expected, strict=True):
            print(f"  {point.kind.value} at {point.control:.4f}")
            assert abs(point.control - load) < 6e-4
        assert tangents <= 15
    print("the whole thin roof")
    roof = hinged_roof(6.35, across, whole=True)
    points, _ = singular_points(roof, 6.35, 1e-8)  # round-off leads a looser path aside
    centre = middle(roof.model.strip)
    for point in points:
        depth = -roof.supports.full(point.u, 0.0).reshape(-1, 3)[centre, 2]
        print(f"  {point.kind.value} at {point.control:.4f}, −W = {depth:.2f} mm")
    first = points[0]
    assert first.kind is Kind.BIFURCATION
    directory.mkdir(parents=True, exist_ok=True)
    write_shape(directory / "mode.vtu", roof, first.u, first.mode)
    assert max(aside(roof, first, directory)) < first.control


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarser meshes")
    parser.add_argument("-o", type=Path, default=Path("results/roofs"), help="where to write")
    given = parser.parse_args()
    main(*((5, 6) if given.quick else (8, 10)), given.o)
