"""Write a mesh of triangles of a flat strip, graded, with named edges and perhaps a round hole.

The strip lies in the plane z = 0, centred at the origin, x along and y across; its edges
are named entry (−x), exit (+x), left (+y) and right (−y), the hole's rim hole.  One quarter is
meshed and mirrored twice, so the mesh is symmetric and has nodes on both axes.  Places are
rounded after every move, so that every machine finds the same mesh.  See README.md next to
this file.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np
from make_strip import named_mesh
from scipy.spatial import Delaunay

DIGITS = 7
"""Places are rounded to this many decimals (m)."""
ROUNDS = 40
"""How often nodes are moved."""
CLOSEST = 0.76
"""Least distance between nodes thrown at random, in units of the size asked for."""
THROWS = 40
"""Nodes thrown, for each that would find room on a lattice."""


@dataclass(frozen=True)
class Plan:
    """What to mesh.

    Attributes
    ----------
    length, width : float
        Of the strip (m).
    size, coarse : float
        Longest sides wanted in the refined part, and far from it (m).
    until : float
        The refined part is |x| < until (m), or that far from the rim of the hole.
    growth : float
        How much longer sides may be per distance from the refined part.
    hole : float
        Radius of the hole (m); 0 if there is none.
    """

    length: float
    width: float
    size: float
    coarse: float
    until: float
    growth: float
    hole: float = 0.0

    def wanted(self, points: np.ndarray) -> np.ndarray:
        """Return the length of sides wanted at points (n, 2), shape (n,), m."""
        reach = radius(points) - self.hole if self.hole else np.abs(points[:, 0])
        away = np.clip(reach - self.until, 0.0, None)
        return np.minimum(self.size + self.growth * away, self.coarse)

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (n, 2) of the quarter are from its boundary, shape (n,), m."""
        x, y = points.T
        sides = [x, y, self.length / 2 - x, self.width / 2 - y, radius(points) - self.hole]
        return np.min(sides[: 5 if self.hole else 4], axis=0)


def radius(points: np.ndarray) -> np.ndarray:
    """Return distances from the origin, shape (n,)."""
    return np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2)


def quarter(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, 2) and triangles (m, 3) of the part x >= 0, y >= 0."""
    rim = boundary(plan)
    points = np.concatenate([rim, thrown(plan, rim)])
    for _ in range(ROUNDS):
        cells = triangulated(plan, points)
        points[len(rim) :] = moved(plan, points, cells)[len(rim) :]
    return points, triangulated(plan, points)


def boundary(plan: Plan) -> np.ndarray:
    """Return nodes on the boundary of the quarter, in turn, shape (n, 2)."""
    x, y, r = plan.length / 2, plan.width / 2, plan.hole
    corners = [(r, 0.0), (x, 0.0), (x, y), (0.0, y), (0.0, r)]
    sides = [divided(plan, *ends) for ends in pairwise(corners)]
    if r:
        angle = np.linspace(np.pi / 2, 0.0, math.ceil(r * np.pi / 2 / plan.size) + 1)
        sides.append(r * np.column_stack([np.cos(angle), np.sin(angle)]))
    return np.round(np.concatenate([side[:-1] for side in sides]), DIGITS)


def divided(plan: Plan, begin: tuple[float, float], end: tuple[float, float]) -> np.ndarray:
    """Return points from one corner to the next, as far apart as the plan wants."""
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    line = (1.0 - share) * begin + share * np.array(end)
    wanted = plan.wanted(line)
    step = radius(line[1:] - line[:-1]) * 2.0 / (wanted[1:] + wanted[:-1])
    count = np.concatenate([[0.0], np.add.accumulate(step)])
    whole = max(math.ceil(count[-1] - 1e-6), 1)
    places = np.interp(np.linspace(0.0, count[-1], whole + 1), count, share[:, 0])[:, None]
    return (1.0 - places) * begin + places * np.array(end)


def thrown(plan: Plan, rim: np.ndarray) -> np.ndarray:
    """Return nodes inside: those of an even sequence of points that find room, shape (n, 2)."""
    sides = np.array([plan.length / 2, plan.width / 2])
    count = int(THROWS * sides.prod() / plan.size**2)
    # additive recurrence of the plastic number 1.3247..., whose points lie evenly
    sequence = np.outer(np.arange(1, count + 1), [0.7548776662466927, 0.5698402909980532]) % 1.0
    points = sides * sequence
    wanted = plan.wanted(points)
    room = plan.inside(points) > 0.5 * wanted
    kept = np.concatenate([rim, np.empty((0, 2))])
    for point, least in zip(points[room], CLOSEST * wanted[room], strict=True):
        if radius(kept - point).min() > least:
            kept = np.concatenate([kept, point[None]])
    return np.round(kept[len(rim) :], DIGITS)


def triangulated(plan: Plan, points: np.ndarray) -> np.ndarray:
    """Return the triangles between points that lie in the strip, turning left, (m, 3)."""
    cells = Delaunay(points).simplices
    first, second = (points[cells[:, k]] - points[cells[:, 0]] for k in (1, 2))
    twice = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    within = plan.inside(points[cells].mean(axis=1)) > 0.0
    kept = within & (np.abs(twice) > 1e-9 * plan.size**2)
    return np.where((twice > 0.0)[:, None], cells, cells[:, ::-1])[kept]


def moved(plan: Plan, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return every node at the mean of the circumcentres around it, shape (n, 2).

    Weights are areas in units of the size wanted: the smoothing of Chen (Mesh smoothing schemes
    based on optimal Delaunay triangulations, 2004).
    """
    corners = points[cells]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    a, b = (first**2).sum(axis=1), (second**2).sum(axis=1)
    u = (second[:, 1] * a - first[:, 1] * b) / (2.0 * twice)
    v = (first[:, 0] * b - second[:, 0] * a) / (2.0 * twice)
    centres = corners[:, 0] + np.column_stack([u, v])
    weight = np.repeat(twice / plan.wanted(corners.mean(axis=1)) ** 3, 3)
    sums = [np.bincount(cells.ravel(), weight * np.repeat(c, 3)) for c in centres.T]
    return np.round((np.stack(sums) / np.bincount(cells.ravel(), weight)).T, DIGITS)


def mirrored(points: np.ndarray, cells: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh and its image in x = 0 or y = 0, joined there."""
    image = points.copy()
    image[:, axis] *= -1.0
    new = points[:, axis] > 0.0
    number = np.arange(len(points))
    number[new] = len(points) + np.arange(new.sum())
    return np.concatenate([points, image[new]]), np.concatenate([cells, number[cells[:, ::-1]]])


def strip_mesh(plan: Plan) -> meshio.Mesh:
    """Return triangles of the whole strip with named groups, nodes numbered along it."""
    points, cells = quarter(plan)
    for axis in (0, 1):
        points, cells = mirrored(points, cells, axis)
    order = np.lexsort(points.T[::-1])
    points, cells = points[order], np.argsort(order)[cells]
    x, y, half = *points.T, np.array([plan.length, plan.width]) / 2
    edges = {
        "entry": in_turn(points, x == -half[0], -y),
        "exit": in_turn(points, x == half[0], y),
        "left": in_turn(points, y == half[1], -x),
        "right": in_turn(points, y == -half[1], x),
    }
    if plan.hole:
        near = np.abs(radius(points) - plan.hole) < 1e-6
        rim = in_turn(points, near, np.arctan2(y, x))
        edges["hole"] = np.append(rim, rim[0])
    return named_mesh(np.column_stack([points, np.zeros(len(points))]), "triangle", cells, edges)


def in_turn(points: np.ndarray, chosen: np.ndarray, key: np.ndarray) -> np.ndarray:
    """Return the numbers of chosen nodes by an increasing key."""
    numbers = np.flatnonzero(chosen)
    return numbers[np.argsort(key[numbers])]


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return what was asked for on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--length", type=float, default=4.0, help="m")
    parser.add_argument("--width", type=float, default=1.0, help="m")
    parser.add_argument("--size", type=float, default=0.1, help="sides in the refined part (m)")
    parser.add_argument("--coarse", type=float, default=0.25, help="longest sides (m)")
    parser.add_argument("--until", type=float, default=0.8, help="end of the refined part (m)")
    parser.add_argument("--growth", type=float, default=0.2, help="of sides, per distance")
    parser.add_argument("--hole", type=float, default=0.0, help="radius (m)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="a .msh file")
    asked = parser.parse_args(arguments)
    for complaint in complaints(asked):
        parser.error(complaint)
    return asked


def complaints(asked: argparse.Namespace) -> Iterator[str]:
    """Yield what cannot be done."""
    if not 0 < asked.size <= asked.coarse <= min(asked.length, asked.width) / 2:
        yield "size is above 0, coarse at least as large and at most half of length and width"
    if not (asked.until >= 0 and 0 <= asked.growth < 1):
        yield "until is not below 0, growth between 0 and 1"
    if not (asked.hole == 0 or asked.size < asked.hole < min(asked.length, asked.width) / 2.5):
        yield "hole is 0, or larger than size and smaller than 0.4 of length and width"


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the mesh."""
    asked = vars(options(arguments))
    output = asked.pop("output")
    meshio.gmsh.write(output, strip_mesh(Plan(**asked)), "4.1", binary=False, float_fmt=".15g")


if __name__ == "__main__":
    main()
