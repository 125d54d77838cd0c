"""A strip wrapped over a roller, made without any mechanics."""

from pathlib import Path

import numpy as np

from anmstrip.mechanics.roller import Roller
from anmstrip.results.vtk import TRIANGLE_LATTICE, Collection, write_rollers, write_surface

RADIUS, WRAP = 0.5, np.pi / 6


def tensor_grids(along, across):
    """Cells (along * across, 16) on a lattice of (3 along + 1) x (3 across + 1) points."""
    columns = 3 * along + 1
    first = 3 * np.arange(along) + 3 * columns * np.arange(across)[:, None]
    node = np.arange(4) + columns * np.arange(4)[:, None]
    return first.reshape(-1, 1) + node.reshape(1, -1)


def lattice(along, across, x, y):
    """Coordinates, (n,) each, of the points that `tensor_grids` refers to."""
    u, v = np.linspace(*x, 3 * along + 1), np.linspace(*y, 3 * across + 1)
    return tuple(grid.ravel() for grid in np.meshgrid(u, v))


def triangular_lattices(along, across, x, y):
    """Coordinates, (n,) each, and cells (2 along * across, 21) of rectangles cut in two.

    The two triangles of a rectangle turn the same way; nothing is shared.
    """
    u, v = TRIANGLE_LATTICE / 5
    columns, rows = (grid.reshape(-1, 1) for grid in np.mgrid[:along, :across])
    low, high = ((columns + p, rows + q) for p, q in ((u, v), (1.0 - u, 1.0 - v)))
    places = np.stack([np.concatenate(pair).ravel() for pair in zip(low, high, strict=True)])
    steps = np.array([np.ptp(x) / along, np.ptp(y) / across])
    coordinates = np.array([[x[0]], [y[0]]]) + steps[:, None] * places
    return *coordinates, np.arange(coordinates.shape[1]).reshape(-1, 21)


def wrapped(s, wrap=WRAP):
    """Height and position (x, z) along a strip lying on the top of a roller, straight elsewhere."""
    angle = np.clip(s / RADIUS, -wrap, wrap)
    rest = s - RADIUS * angle
    x = RADIUS * np.sin(angle) + rest * np.cos(angle)
    return x, RADIUS * (np.cos(angle) - 1.0) - np.abs(rest) * np.sin(np.abs(angle))


def write_state(directory: Path, k: int, share: float, triangles: bool = False) -> None:
    """Write `strip_k.vtu` and `rollers_k.vtu`, wrapped by a share of the full angle."""
    sides, cells = ((-2.0, 2.0), (-0.5, 0.5)), tensor_grids(20, 2)
    s, y = lattice(20, 2, *sides)
    if triangles:
        s, y, cells = triangular_lattices(20, 2, *sides)
    x, z = wrapped(s, share * WRAP)
    points = np.column_stack([x, y, z])
    pressed = np.abs(s) < share * WRAP * RADIUS
    fields = {
        "displacement": points - np.column_stack([s, y, 0.0 * s]),
        "normal_pressure": 2.0e4 * pressed * (1.0 - y**2),
        "von_mises": 1.0e8 * (1.0 + pressed),
        "membrane_force": np.column_stack([1.0e4 + 0.0 * s, 0.0 * s, 100.0 * y]),
    }
    write_surface(directory / f"strip_{k}.vtu", points, cells, fields)
    roller = Roller("r1", RADIUS, (0.0, 0.0, -RADIUS - 1e-3))
    write_rollers(directory / f"rollers_{k}.vtu", [roller], [k], 1.0)


def write_run(directory: Path) -> None:
    """Write the results of a run with three states."""
    contents = {name: Collection(directory / f"{name}.pvd") for name in ("strip", "rollers")}
    for k, share in enumerate((0.0, 0.5, 1.0)):
        write_state(directory, k, share)
        for name, collection in contents.items():
            collection.add(0.5 * k, f"{name}_{k}.vtu")
