"""States as `.vtu` files and their table of contents, a `.pvd`, without importing VTK."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import meshio
import numpy as np
from numpy.typing import ArrayLike, NDArray
from anmstrip.results.files import replaced
from pathlib import Path
from typing import Self
from xml.etree import ElementTree
from anmstrip.errors import InputError, Mistake

Points = NDArray[np.float64]
Cells = NDArray[np.int64]
Fields = dict[str, NDArray[np.float64]]

LAGRANGE_ORDER = np.array([0, 3, 15, 12, 1, 2, 7, 11, 13, 14, 4, 8, 5, 6, 9, 10])
"""Tensor-grid index of each node of a cell of type 70: corners, edges, interior."""

TRIANGLE_ORDER = np.array(
    [0, 5, 20, 1, 2, 3, 4, 10, 14, 17, 19, 18, 15, 11, 6, 7, 9, 16, 8, 13, 12]
)
"""Lattice index of each node of a cell of type 69: corners, edges, interior as a triangle again."""

RINGS = 49
"""Circles by which a roller is drawn that is no cylinder."""

_KINDS = {
    3: ("triangle", np.arange(3)),
    4: ("quad", np.arange(4)),
    16: ("VTK_LAGRANGE_QUADRILATERAL", LAGRANGE_ORDER),
    21: ("VTK_LAGRANGE_TRIANGLE", TRIANGLE_ORDER),
}
"""For each number of nodes, meshio's name of the cell and the order of its nodes there."""


@dataclass(frozen=True)
class Surface:
    """A surface read back.

    Attributes
    ----------
    points : (n, 3) array
        In metres.
    cells : (m, 16), (m, 21), (m, 4) or (m, 3) array of int
        Tensor grids, triangular lattices, or corners in turn.
    fields : dict
        Values at the points.
    """

    points: Points
    cells: Cells
    fields: Fields


def write_surface(
    path: str | os.PathLike[str],
    points: ArrayLike,
    cells: ArrayLike,
    fields: Mapping[str, ArrayLike],
) -> None:
    """Write a surface and its fields, all at once.

    Parameters
    ----------
    path : path
        The `.vtu` file.
    points : (n, 3) array
        Positions, in metres.
    cells : (m, 16), (m, 21), (m, 4) or (m, 3) array of int
        Cubic quadrilaterals as tensor grids, quintic triangles as triangular lattices, or plain
        ones of either kind as corners in turn.
    fields : mapping of str to (n,) or (n, k) array
        Values at the points: scalars, vectors (x, y, z), symmetric tensors (xx, yy, xy).

    Raises
    ------
    ValueError
        A shape does not fit.
    OSError
        The file cannot be written.
    """
    positions, indices = np.asarray(points, dtype=float), np.asarray(cells, dtype=np.int64)
    data = {name: np.asarray(values, dtype=float) for name, values in fields.items()}
    _check(positions, indices, data)
    kind, order = _KINDS[indices.shape[1]]
    mesh = meshio.Mesh(positions, [(kind, indices[:, order])], point_data=data)
    with replaced(path) as temporary:
        mesh.write(temporary, file_format="vtu")


def _check(points: Points, cells: Cells, fields: Fields) -> None:
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points have shape {points.shape}, expected (n, 3)")
    if cells.ndim != 2 or cells.shape[1] not in _KINDS:
        raise ValueError(f"cells have shape {cells.shape}, expected (m, {list(_KINDS)})")
    for name, values in fields.items():
        if values.ndim not in (1, 2) or len(values) != len(points):
            raise ValueError(f"{name} has shape {values.shape} for {len(points)} points")


def read_surface(path: str | os.PathLike[str]) -> Surface:
    """Read what `write_surface` wrote.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        It holds no cells of these kinds, or it is damaged.
    """
    try:
        mesh = meshio.vtu.read(path)
        block = mesh.cells[0]
        cells = np.asarray(block.data, dtype=np.int64)
    except OSError:
        raise
    except Exception as error:  # damage shows as exceptions of any kind
        raise ValueError(f"{path} is damaged: {error}") from error
    kind, order = _KINDS.get(cells.shape[1], ("", np.arange(0)))
    if block.type != kind:
        raise ValueError(f"{path} holds cells of another kind: {block.type}")
    return Surface(np.asarray(mesh.points), cells[:, np.argsort(order)], dict(mesh.point_data))


def subdivided(cells: ArrayLike) -> Cells:
    """Cut smooth cells into plain ones through their nodes; plain ones stay as they are.

    Parameters
    ----------
    cells : (m, 16), (m, 21), (m, 4) or (m, 3) array of int
        As in `write_surface`.

    Returns
    -------
    (9 m, 4) or (25 m, 3) array of int
        Corners in turn, cell by cell, on the same points.
    """
    nodes = np.asarray(cells, dtype=np.int64)
    if nodes.shape[1] not in (16, 21):
        return nodes
    pieces = _squares(4) if nodes.shape[1] == 16 else _triangles(6)
    return nodes[:, pieces].reshape(-1, pieces.shape[1])


def _squares(n: int) -> Cells:
    """Corners of the squares between n x n nodes."""
    grid = np.arange(n * n).reshape(n, n)
    corners = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def _triangles(n: int) -> Cells:
    """Corners of the (n - 1)^2 triangles of a lattice, turning as the whole one does."""
    rows = [n - j for j in range(n)]
    starts = np.cumsum([0, *rows])
    pieces = []
    for low, high, row in zip(starts[:-1], starts[1:], rows, strict=True):
        pieces += [(low + i, low + i + 1, high + i) for i in range(row - 1)]
        pieces += [(low + i + 1, high + i + 1, high + i) for i in range(row - 2)]
    return np.array(pieces, dtype=np.int64)


def triangle_lattice(n: int) -> Points:
    """Points of the unit triangle, n on each side, row by row from the side y = 0.

    Point (i, j) with i + j < n stands at (i, j) / (n - 1); j is the outer index.

    Returns
    -------
    (2, n (n + 1) / 2) array

    Examples
    --------
    >>> triangle_lattice(3).T.tolist()
    [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 0.5], [0.5, 0.5], [0.0, 1.0]]
    """
    return np.array([(i, j) for j in range(n) for i in range(n - j)]).T / (n - 1)


@dataclass(frozen=True)
class Cylinder:
    """A roller as it is drawn.

    Attributes
    ----------
    centre : sequence of 3 floats
        Middle of the axis, in metres.
    axis : sequence of 3 floats
        Direction of the axis, of any length.
    radius, length : float
        In metres.
    angle : float
        How far the roller has turned about its axis, right-handed, in radians.
    profile : callable, optional
        Radius at places along the axis, from the centre, if it is not the same everywhere.
    """

    centre: Sequence[float]
    axis: Sequence[float]
    radius: float
    length: float
    angle: float = 0.0
    profile: Callable[[Points], Points] | None = None


def roller_length(width: float) -> float:
    """Choose how long to draw a roller, in metres: a little more than the strip's width."""
    return 1.2 * width


def cylinder_surface(cylinder: Cylinder, *, sectors: int = 96) -> Surface:
    """Make a closed cylinder out of plain quadrilaterals.

    Its field `surface_angle` (rad, 0 to 2 pi) is painted on the material and turns with it.

    Parameters
    ----------
    cylinder : Cylinder
        What to draw.
    sectors : int
        Number of facets around.

    Returns
    -------
    Surface
        4 (sectors + 1) points, 3 sectors quadrilaterals: one end, the mantle, the other end.
        With a profile the mantle has more rings.
    """
    along, first, second = _frame(np.asarray(cylinder.axis, dtype=float))
    painted = np.linspace(0.0, 2.0 * np.pi, sectors + 1)
    turned = painted[:, None, None] + cylinder.angle
    rings = np.linspace(-0.5, 0.5, 2 if cylinder.profile is None else RINGS) * cylinder.length
    mantle = cylinder.profile or (lambda s: np.full(len(s), cylinder.radius))
    height = np.pad(rings, 1, mode="edge")[:, None]
    radius = np.pad(mantle(rings), 1)[:, None]
    radial = np.cos(turned) * first + np.sin(turned) * second
    points = np.asarray(cylinder.centre, dtype=float) + height * along + radius * radial
    count = len(height)
    start = count * np.arange(sectors)[:, None] + np.arange(count - 1)
    cells = np.stack([start, start + count, start + count + 1, start + 1], axis=-1).reshape(-1, 4)
    return Surface(points.reshape(-1, 3), cells, {"surface_angle": np.repeat(painted, count)})


def _frame(axis: Points) -> tuple[Points, Points, Points]:
    """Right-handed (axis, top, axis x top), the top being as near to z as it can."""
    along = axis / np.linalg.norm(axis)
    upwards = np.eye(3)[2] if abs(along[2]) < 0.9 else np.eye(3)[0]
    top = upwards - (upwards @ along) * along
    top /= np.linalg.norm(top)
    return along, top, np.cross(along, top)


def write_rollers(path: str | os.PathLike[str], cylinders: Sequence[Cylinder]) -> None:
    """Write all rollers of a state in one `.vtu`, with `surface_angle` and `roller` (0, 1, …)."""
    surfaces = [cylinder_surface(cylinder) for cylinder in cylinders]
    sizes = [len(surface.points) for surface in surfaces]
    starts = np.cumsum([0, *sizes[:-1]])
    write_surface(
        path,
        np.concatenate([surface.points for surface in surfaces]),
        np.concatenate([s.cells + start for s, start in zip(surfaces, starts, strict=True)]),
        {
            "surface_angle": np.concatenate([s.fields["surface_angle"] for s in surfaces]),
            "roller": np.repeat(np.arange(len(sizes), dtype=float), sizes),
        },
    )


@dataclass(frozen=True)
class Entry:
    """One state.

    Attributes
    ----------
    time : float
        In the unit of the run (seconds, or a control parameter).
    file : str
        Relative to the `.pvd`.
    """

    time: float
    file: str


class Collection:
    """States in the order of time, rewritten at each addition.

    The file lists only what was added, so that it can be opened at any moment, provided that a
    state is added after it has been written.

    Parameters
    ----------
    path : path
        The `.pvd`.  Nothing is written until the first addition, which replaces what was there.
    entries : sequence of Entry
        What it already lists.
    """

    def __init__(self, path: str | os.PathLike[str], entries: tuple[Entry, ...] = ()) -> None:
        self.path = Path(path)
        self.entries = entries

    @classmethod
    def reopened(cls, path: str | os.PathLike[str], until_time: float) -> Self:
        """Go on with an existing file from a time on; what came later is dropped from it.

        Raises
        ------
        InputError
            The file is there but damaged.
        """
        entries = read_collection(path) if Path(path).exists() else ()
        collection = cls(path, tuple(entry for entry in entries if entry.time <= until_time))
        collection._write()
        return collection

    def add(self, time: float, file: str | os.PathLike[str]) -> None:
        """Add a state that is already on disk.

        Parameters
        ----------
        time : float
            Not before that of the last one.
        file : path
            Its name in the directory of the `.pvd`, or any path to it there.
        """
        self.entries = (*self.entries, Entry(float(time), Path(file).name))
        self._write()

    def _write(self) -> None:
        root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
        parent = ElementTree.SubElement(root, "Collection")
        for entry in self.entries:
            ElementTree.SubElement(
                parent, "DataSet", timestep=repr(entry.time), group="", part="0", file=entry.file
            )
        ElementTree.indent(root)
        with replaced(self.path) as temporary:
            ElementTree.ElementTree(root).write(temporary, "utf-8", xml_declaration=True)


def read_collection(path: str | os.PathLike[str]) -> tuple[Entry, ...]:
    """List the states of a `.pvd`.

    Raises
    ------
    InputError
        It is damaged.
    OSError
        It cannot be read.
    """
    try:
        sets = ElementTree.parse(path).iter("DataSet")
        return tuple(Entry(float(item.attrib["timestep"]), item.attrib["file"]) for item in sets)
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        mistake = Mistake(
            file=str(path),
            key="",
            value=str(error),
            expected="the list of states that a run wrote",
            hint="the same command without --resume",
        )
        raise InputError((mistake,)) from error
