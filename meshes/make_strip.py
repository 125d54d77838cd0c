"""Write a mesh of a flat strip, finer between two positions, with named edges.

The strip lies in the plane z = 0, centred at the origin, x along and y across; its edges
are named entry (−x), exit (+x), left (+y) and right (−y). See README.md next to this file.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import meshio
import numpy as np

GROUPS = {"entry": 1, "exit": 2, "left": 3, "right": 4, "hole": 5, "strip": 1}
"""Number of each named group; lines and surfaces count on their own."""

OWNERS = "left", "right", "hole", "entry", "exit"
"""Lines in the order in which they take the nodes that several have."""


def positions(
    length: float, cells: int, refined: float, between: tuple[float, float]
) -> np.ndarray:
    """Return the positions of nodes along the strip (m), increasing.

    Parameters
    ----------
    length : float
        Length of the strip (m).
    cells : int
        Elements along the strip were it not refined; their length is used outside.
    refined : float
        Longest element between the two positions (m).
    between : tuple of two floats
        Where the refinement begins and ends (m).
    """
    begin, end = between
    parts = [
        (-length / 2, begin, length / cells),
        (begin, end, refined),
        (end, length / 2, length / cells),
    ]
    pieces = [_divided(*part) for part in parts if part[1] > part[0]]
    return np.concatenate([*(piece[:-1] for piece in pieces), [length / 2]])


def _divided(begin: float, end: float, longest: float) -> np.ndarray:
    count = math.ceil((end - begin) / longest * (1 - 1e-12))
    return np.linspace(begin, end, count + 1)


def strip_mesh(x: np.ndarray, y: np.ndarray) -> meshio.Mesh:
    """Return quadrilaterals between positions along and across, with named groups.

    Parameters
    ----------
    x, y : ndarray, shape (n,) and (m,)
        Positions of nodes, increasing (m); at least two elements each way, for the format
        lists a group by the nodes that are only its own.
    """
    number = np.arange(x.size * y.size).reshape(x.size, y.size)
    points = np.zeros((number.size, 3))
    points[:, 0], points[:, 1] = (grid.ravel() for grid in np.meshgrid(x, y, indexing="ij"))
    edges = {
        "entry": number[0, ::-1],
        "exit": number[-1],
        "left": number[::-1, -1],
        "right": number[:, 0],
    }
    corners = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    return named_mesh(points, "quad", np.stack([c.ravel() for c in corners], axis=1), edges)


def named_mesh(
    points: np.ndarray, kind: str, cells: np.ndarray, edges: dict[str, np.ndarray]
) -> meshio.Mesh:
    """Return a mesh whose lines and surface are named groups.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Nodes (m).
    kind : str
        Of the cells: quad or triangle.
    cells : ndarray of int, shape (m, k)
        Nodes of the cells.
    edges : dict of ndarray of int
        Nodes along each named line, in turn; a closed one ends where it begins.
    """
    groups = {name: GROUPS[name] for name in edges}
    blocks = [("line", np.column_stack([line[:-1], line[1:]])) for line in edges.values()]
    blocks.append((kind, cells))
    numbers = [*groups.values(), GROUPS["strip"]]
    tags = [np.full(len(data), tag) for tag, (_, data) in zip(numbers, blocks, strict=True)]
    names = {name: np.array([tag, 1]) for name, tag in groups.items()}
    return meshio.Mesh(
        points,
        blocks,
        point_data={"gmsh:dim_tags": _owners(len(points), edges)},
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={**names, "strip": np.array([GROUPS["strip"], 2])},
    )


def _owners(count: int, edges: dict[str, np.ndarray]) -> np.ndarray:
    """Return dimension and number of the group that owns each node, shape (count, 2)."""
    owners = np.tile([2, GROUPS["strip"]], (count, 1))
    for name in sorted(edges, key=OWNERS.index):
        owners[edges[name]] = [1, GROUPS[name]]
    return owners


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return what was asked for on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--length", type=float, default=4.0, help="m")
    parser.add_argument("--width", type=float, default=1.0, help="m")
    parser.add_argument("--cells", type=int, nargs=2, default=(16, 2), help="along, across")
    parser.add_argument("--refined", type=float, default=0.05, help="element length (m)")
    parser.add_argument("--from", dest="begin", type=float, default=-0.6, help="m")
    parser.add_argument("--to", dest="end", type=float, default=0.6, help="m")
    parser.add_argument("-o", "--output", type=Path, required=True, help="a .msh file")
    asked = parser.parse_args(arguments)
    for complaint in complaints(asked):
        parser.error(complaint)
    return asked


def complaints(asked: argparse.Namespace) -> Iterator[str]:
    """Yield what cannot be done."""
    if not (min(asked.length, asked.width, asked.refined) > 0 and min(asked.cells) >= 2):
        yield "length, width and refined are above 0, cells at least 2 each way"
    if not -asked.length / 2 <= asked.begin < asked.end <= asked.length / 2:
        yield f"from and to lie between {-asked.length / 2:g} and {asked.length / 2:g}, in order"


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the mesh."""
    asked = options(arguments)
    x = positions(asked.length, asked.cells[0], asked.refined, (asked.begin, asked.end))
    y = np.linspace(-asked.width / 2, asked.width / 2, asked.cells[1] + 1)
    mesh = strip_mesh(x, y)
    meshio.gmsh.write(asked.output, mesh, "4.1", binary=False, float_fmt=".15g")


if __name__ == "__main__":
    main()
