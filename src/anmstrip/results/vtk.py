"""States as `.vtu` files and their table of contents, a `.pvd`, without importing VTK."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from xml.etree import ElementTree

import meshio
import numpy as np
from numpy.typing import ArrayLike, NDArray

from anmstrip.errors import InputError, Mistake
from anmstrip.mechanics.roller import Roller
from anmstrip.results.files import AnyPath, atomic_write

Points = NDArray[np.float64]
Cells = NDArray[np.int64]

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
class SurfaceMesh:
    """A surface with values at its points.

    Attributes
    ----------
    points : (n, 3) array
        Positions (m).
    cells : (m, 16), (m, 21), (m, 4) or (m, 3) array of int
        Cubic quadrilaterals as tensor grids, quintic triangles as triangular lattices, or plain
        ones of either kind as corners in turn.
    fields : dict of str to (n,) or (n, k) array
        Scalars, vectors (x, y, z), symmetric tensors (xx, yy, xy).
    """

    points: Points
    cells: Cells
    fields: dict[str, NDArray[np.float64]]


def write_surface(
    path: AnyPath, points: ArrayLike, cells: ArrayLike, fields: Mapping[str, ArrayLike]
) -> None:
    """Write a surface and its fields as a `.vtu`, all at once; see :class:`SurfaceMesh`.

    Raises
    ------
    ValueError
        A shape does not fit.
    OSError
        The file cannot be written.
    """
    positions, indices = np.asarray(points, dtype=float), np.asarray(cells, dtype=np.int64)
    data = {name: np.asarray(values, dtype=float) for name, values in fields.items()}
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise ValueError(f"points have shape {positions.shape}, expected (n, 3)")
    if indices.ndim != 2 or indices.shape[1] not in _KINDS:
        raise ValueError(f"cells have shape {indices.shape}, expected (m, {list(_KINDS)})")
    for name, values in data.items():
        if values.ndim not in (1, 2) or len(values) != len(positions):
            raise ValueError(f"{name} has shape {values.shape} for {len(positions)} points")
    kind, order = _KINDS[indices.shape[1]]
    mesh = meshio.Mesh(positions, [(kind, indices[:, order])], point_data=data)
    with atomic_write(path) as temporary:
        mesh.write(temporary, file_format="vtu")


def read_surface(path: AnyPath) -> SurfaceMesh:
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
    return SurfaceMesh(np.asarray(mesh.points), cells[:, np.argsort(order)], dict(mesh.point_data))


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


def subdivide(cells: ArrayLike) -> Cells:
    """Cut smooth cells into plain ones through their nodes; plain ones stay as they are.

    Parameters
    ----------
    cells : (m, 16), (m, 21), (m, 4) or (m, 3) array of int
        As in :class:`SurfaceMesh`.

    Returns
    -------
    (9 m, 4) or (25 m, 3) array of int
        Corners in turn, cell by cell, on the same points, turning as the whole cell does.
    """
    nodes = np.asarray(cells, dtype=np.int64)
    if nodes.shape[1] == 16:
        grid = np.arange(16).reshape(4, 4)
        corners = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
        pieces = np.stack(corners, axis=-1).reshape(-1, 4)
    elif nodes.shape[1] == 21:
        lattice = np.rint(5.0 * triangle_lattice(6)).astype(int).T.tolist()
        number = {(i, j): k for k, (i, j) in enumerate(lattice)}
        upright = [((i, j), (i + 1, j), (i, j + 1)) for i, j in number]
        hanging = [((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i, j in number]
        inside = [t for t in (*upright, *hanging) if number.keys() >= set(t)]
        pieces = np.array([[number[corner] for corner in triangle] for triangle in inside])
    else:
        return nodes
    return nodes[:, pieces].reshape(-1, pieces.shape[1])


def roller_surface(
    roller: Roller, length: float, angle: float = 0.0, *, sectors: int = 96
) -> SurfaceMesh:
    """Make a closed surface of revolution out of plain quadrilaterals.

    Its field `surface_angle` (rad, 0 to 2 pi) is painted on the material and turns with it.

    Parameters
    ----------
    roller : Roller
    length : float
        Along the axis (m).
    angle : float
        How far it has turned about its axis, right-handed (rad).
    sectors : int
        Number of facets around.

    Returns
    -------
    SurfaceMesh
        4 (sectors + 1) points, 3 sectors quadrilaterals: one end, the mantle, the other end.
        With a profile the mantle has more rings.
    """
    first, second, along = roller.frame
    painted = np.linspace(0.0, 2.0 * np.pi, sectors + 1)
    turned = painted[:, None, None] + angle
    rings = np.linspace(-0.5, 0.5, 2 if roller.is_cylinder else RINGS) * length
    height = np.pad(rings, 1, mode="edge")[:, None]
    radius = np.pad(roller.radius_at(rings), 1)[:, None]
    radial = np.cos(turned) * first + np.sin(turned) * second
    points = np.asarray(roller.centre, dtype=float) + height * along + radius * radial
    count = len(height)
    start = count * np.arange(sectors)[:, None] + np.arange(count - 1)
    cells = np.stack([start, start + count, start + count + 1, start + 1], axis=-1).reshape(-1, 4)
    return SurfaceMesh(points.reshape(-1, 3), cells, {"surface_angle": np.repeat(painted, count)})


def write_rollers(
    path: AnyPath, rollers: Sequence[Roller], angles: Sequence[float], width: float
) -> None:
    """Write all rollers of a state in one `.vtu`, with `surface_angle` and `roller` (0, 1, …).

    They are drawn a fifth longer than the strip is wide (m).
    """
    pairs = zip(rollers, angles, strict=True)
    surfaces = [roller_surface(roller, 1.2 * width, angle) for roller, angle in pairs]
    count = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    cells = [surface.cells + count[k] for k, surface in enumerate(surfaces)]
    painted = np.concatenate([surface.fields["surface_angle"] for surface in surfaces])
    fields = {
        "surface_angle": painted,
        "roller": np.repeat(np.arange(len(surfaces)), np.diff(count)),
    }
    points = np.concatenate([surface.points for surface in surfaces])
    write_surface(path, points, np.concatenate(cells), fields)


@dataclass(frozen=True)
class Entry:
    """One state of a :class:`Collection`."""

    time: float  # s, or a control parameter
    file: str  # relative to the `.pvd`


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

    def __init__(self, path: AnyPath, entries: tuple[Entry, ...] = ()) -> None:
        self.path = Path(path)
        self.entries = entries

    @classmethod
    def reopen(cls, path: AnyPath, until_time: float) -> Self:
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

    def add(self, time: float, file: AnyPath) -> None:
        """Add a state, not before the last one, that is on disk in the directory of the `.pvd`."""
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
        with atomic_write(self.path) as temporary:
            ElementTree.ElementTree(root).write(temporary, "utf-8", xml_declaration=True)


def read_collection(path: AnyPath) -> tuple[Entry, ...]:
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
        expected, hint = "the list of states that a run wrote", "the same command without --resume"
        raise InputError([Mistake(str(path), "", str(error), expected, hint)]) from error
