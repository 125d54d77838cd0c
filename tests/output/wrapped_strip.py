"""A strip wrapped over a roller, made without any mechanics."""

from pathlib import Path

import numpy as np

from anmstrip.output.vtk import Cylinder, roller_length, write_rollers, write_surface

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


def wrapped(s, wrap=WRAP):
    """Height and position (x, z) along a strip lying on the top of a roller, straight elsewhere."""
    angle = np.clip(s / RADIUS, -wrap, wrap)
    rest = s - RADIUS * angle
    x = RADIUS * np.sin(angle) + rest * np.cos(angle)
    return x, RADIUS * (np.cos(angle) - 1.0) - np.abs(rest) * np.sin(np.abs(angle))


def write_state(directory: Path, k: int, share: float) -> None:
    """Write `strip_k.vtu` and `rollers_k.vtu`, wrapped by a share of the full angle."""
    s, y = lattice(20, 2, (-2.0, 2.0), (-0.5, 0.5))
    x, z = wrapped(s, share * WRAP)
    points = np.column_stack([x, y, z])
    pressed = np.abs(s) < share * WRAP * RADIUS
    fields = {
        "displacement": points - np.column_stack([s, y, 0.0 * s]),
        "normal_pressure": 2.0e4 * pressed * (1.0 - y**2),
        "von_mises": 1.0e8 * (1.0 + pressed),
        "membrane_force": np.column_stack([1.0e4 + 0.0 * s, 0.0 * s, 100.0 * y]),
    }
    write_surface(directory / f"strip_{k}.vtu", points, tensor_grids(20, 2), fields)
    roller = Cylinder((0.0, 0.0, -RADIUS - 1e-3), (0.0, 1.0, 0.0), RADIUS, roller_length(1.0), k)
    write_rollers(directory / f"rollers_{k}.vtu", [roller])
