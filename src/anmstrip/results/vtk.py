"""States as `.vtu` files and their table of contents, a `.pvd`, without importing VTK."""

from __future__ import annotations

import base64
import errno
import os
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anmstrip.errors import InputError, Mistake
from anmstrip.mechanics.roller import Roller
from anmstrip.results.files import START_AFRESH, AnyPath, atomic_write, named_errors

Points = NDArray[np.float64]
Cells = NDArray[np.int64]

LAGRANGE_ORDER = np.array([0, 3, 15, 12, 1, 2, 7, 11, 13, 14, 4, 8, 5, 6, 9, 10])
"""Tensor-grid index of each node of a cell of type 70: corners, edges, interior."""

TRIANGLE_LATTICE = np.array([(i, j) for j in range(6) for i in range(6 - j)]).T
"""Places (i, j) of the points of a quintic triangle, at (i, j)/5 of the unit triangle, (2, 21)."""

TRIANGLE_ORDER = np.array(
    [0, 5, 20, 1, 2, 3, 4, 10, 14, 17, 19, 18, 15, 11, 6, 7, 9, 16, 8, 13, 12]
)
"""Lattice index of each node of a cell of type 69: corners, edges, interior as a triangle again."""

PROFILE_RINGS = 49
"""Circles by which a roller is drawn that is no cylinder."""

ROLLER_SECTORS = 12
"""Sectors of a roller, of two tones in turn."""

COMPRESSION_PROBE, COMPRESSION_RATIO = 2048, 0.8
"""Bytes of an array that are compressed first, and what is to be left of them: arrays of which more
is left are stored as they are.  States of a shell are 8 % larger and take two thirds of the time;
level 1 makes files 1 % larger than the default, in half the time."""

_KINDS = {
    3: (5, np.arange(3)), 4: (9, np.arange(4)), 16: (70, LAGRANGE_ORDER), 21: (69, TRIANGLE_ORDER),
}  # fmt: skip
"""For each number of nodes, VTK's number of the cell, and its nodes' order."""

CELL_ARRAYS = ("connectivity", "offsets", "types")

BLOCK_HEADER = 44
"""Characters in which the four sizes before a compressed block are written."""

VECTOR_COMPONENTS, TENSOR_COMPONENTS = ("x", "y", "z"), ("xx", "yy", "xy")


@dataclass(frozen=True)
class Field:
    """Label and unit of a field."""

    label: str
    unit: str  # of SI, as printed
    components: tuple[str, ...] = ()  # names of the columns; none for a scalar


FIELDS = {
    "displacement": Field("displacement", "m", VECTOR_COMPONENTS),
    "velocity": Field("velocity", "m/s", VECTOR_COMPONENTS),
    "normal": Field("normal", "1", VECTOR_COMPONENTS),
    "arc_length": Field("arc length", "m"),
    "tension": Field("tension", "N/m"),
    "normal_pressure": Field("normal pressure", "Pa"),
    "friction_traction": Field("friction traction", "Pa", VECTOR_COMPONENTS),
    "slip_velocity": Field("slip velocity", "m/s", VECTOR_COMPONENTS),
    "gap": Field("gap", "m"),
    "contact_status": Field("contact (0 free, 1 touches, 2 slips)", "1"),
    "membrane_force": Field("membrane force", "N/m", TENSOR_COMPONENTS),
    "bending_moment": Field("bending moment", "N", TENSOR_COMPONENTS),
    "von_mises": Field("von Mises stress, top", "Pa"),
    "mean_curvature": Field("mean curvature", "1/m"),
    "plastic_share": Field("share of the thickness that flows", "1"),
    "plastic_strain": Field("plastic strain of the faces", "1"),
    "residual_curvature": Field("curvature without moments", "1/m", TENSOR_COMPONENTS),
    "surface_angle": Field("angle of the surface", "rad"),
    "roller": Field("number of the roller", "1"),
}
"""All fields that are written."""


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

    What :data:`FIELDS` knows is written with its unit (VTK's ``UNITS_LABEL``) and the names of its
    components; a field ``normal`` is what shades the surface.

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
    number, order = _KINDS[indices.shape[1]]
    count, size = indices.shape
    corners = indices[:, order].ravel(), size * np.arange(1, count + 1), np.full(count, number)
    text = FILE_TEMPLATE.format(
        points=len(positions),
        cells=count,
        shading=' Normals="normal"' if "normal" in data else "",
        positions=_array("Points", positions),
        corners="".join(map(_array, CELL_ARRAYS, corners)),
        data="".join(map(_array, data, data.values())),
    )
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


FILE_TEMPLATE = """<?xml version='1.0' encoding='utf-8'?>
<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64" \
compressor="vtkZLibDataCompressor">
<UnstructuredGrid><Piece NumberOfPoints="{points}" NumberOfCells="{cells}">
<Points>{positions}</Points>
<Cells>{corners}</Cells>
<PointData{shading}>{data}</PointData>
</Piece></UnstructuredGrid></VTKFile>
"""
"""Contents of a file of VTK's."""


def _array(name: str, values: NDArray[np.generic]) -> str:
    """Return an array as a file of VTK's has it."""
    kind = "Float64" if values.dtype.kind == "f" else "Int64"
    content = values.astype("<f8" if kind == "Float64" else "<i8").tobytes()
    encoded = _encoded if kind == "Float64" else _encoded_once
    given, unit, field = "", "", FIELDS.get(name)
    if values.ndim > 1:
        given = f' NumberOfComponents="{values.shape[1]}"'
    if field:
        named = enumerate(field.components)
        given += "".join(f' ComponentName{number}="{component}"' for number, component in named)
        unit = (
            '<InformationKey name="UNITS_LABEL" location="vtkDataArray">'
            f"{escape(field.unit)}</InformationKey>"
        )
    return (
        f'<DataArray type="{kind}" Name="{escape(name)}" format="binary"{given}>'
        f"{encoded(content)}{unit}</DataArray>\n"
    )


def _encoded(content: bytes) -> str:
    """Return content as one compressed block, its three sizes before it."""
    probe = content[:COMPRESSION_PROBE]
    worth = len(zlib.compress(probe, 1)) < COMPRESSION_RATIO * len(probe)
    squeezed = zlib.compress(content, 1 if worth else 0)
    sizes = np.array([1, len(content), len(content), len(squeezed)], dtype="<u8").tobytes()
    return (base64.b64encode(sizes) + base64.b64encode(squeezed)).decode()


_encoded_once = lru_cache(maxsize=6)(_encoded)
"""The same, for the cells of strip and rollers are those of the state before."""


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
        found = {str(a.get("Name")): _decoded(a) for a in ElementTree.parse(path).iter("DataArray")}
        points, corners, ends, kinds = map(found.pop, ("Points", *CELL_ARRAYS))
        cells = corners.reshape(len(ends), -1)
    except OSError:
        raise
    except Exception as error:  # damage shows as exceptions of any kind
        raise ValueError(f"{path} is damaged: {error}") from error
    number, order = _KINDS.get(cells.shape[1], (0, np.arange(0)))
    if (kinds != number).any():
        raise ValueError(f"{path} holds cells of another kind: {kinds[0]}")
    return SurfaceMesh(points, cells[:, np.argsort(order)], found)


def _decoded(array: ElementTree.Element) -> NDArray[Any]:
    """Return the values of an array that :func:`_array` wrote."""
    text, columns = array.text or "", array.get("NumberOfComponents")
    # an array of bytes, since these can be changed
    content = bytearray(zlib.decompress(base64.b64decode(text[BLOCK_HEADER:])))
    values = np.frombuffer(content, dtype="<f8" if array.get("type") == "Float64" else "<i8")
    return values.reshape(-1, int(columns)) if columns else values


def scalars(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reduce a field to one number per point, the one that colours a picture.

    Parameters
    ----------
    name : str
        A field, or a field and a component (`membrane_force.xy`).
    values : (n,) or (n, k) array
        The whole field.

    Returns
    -------
    (n,) array
        A scalar as it is; the component asked for; the length of a vector; the component
        along the strip of a tensor.

    Examples
    --------
    >>> scalars("velocity", np.array([[3.0, 0.0, 4.0]]))
    array([5.])
    >>> scalars("velocity.z", np.array([[3.0, 0.0, 4.0]]))
    array([4.])
    """
    values = np.asarray(values, dtype=float)
    if values.ndim == 1:
        return values
    base, _, component = name.partition(".")
    components = FIELDS[base].components if base in FIELDS else ()
    if component:
        return values[:, components.index(component)]
    return values[:, 0] if components == TENSOR_COMPONENTS else np.linalg.norm(values, axis=1)


def sector_tones(rollers: SurfaceMesh) -> Cells:
    """Return 0 or 1 for each cell of rollers, whose sectors of two tones show their turning."""
    angle = rollers.fields["surface_angle"][rollers.cells].mean(axis=1)
    return np.floor(angle * ROLLER_SECTORS / (2.0 * np.pi)).astype(int) % 2


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
        number = {(i, j): k for k, (i, j) in enumerate(TRIANGLE_LATTICE.T.tolist())}
        upright = [((i, j), (i + 1, j), (i, j + 1)) for i, j in number]
        hanging = [((i + 1, j), (i + 1, j + 1), (i, j + 1)) for i, j in number]
        inside = [t for t in (*upright, *hanging) if number.keys() >= set(t)]
        pieces = np.array([[number[corner] for corner in triangle] for triangle in inside])
    else:
        return nodes
    return nodes[:, pieces].reshape(-1, pieces.shape[1])


def facing(points: Points, cells: Cells) -> Cells:
    """Turn cells so that all of them are seen from above where their points lie flat.

    Parameters
    ----------
    points : (3, n) array
        Of the flat strip.
    cells : (m, 16) or (m, 21) array of int
        As in :class:`SurfaceMesh`.
    """
    if cells.shape[1] == 16:
        along, across, swapped = 3, 12, np.arange(16).reshape(4, 4).T.ravel()
    else:
        along, across, swapped = 5, 20, np.lexsort(TRIANGLE_LATTICE[::-1])
    first, second = (points[:2, cells[:, k]] - points[:2, cells[:, 0]] for k in (along, across))
    below = first[0] * second[1] < first[1] * second[0]
    return np.where(below[:, None], cells[:, swapped], cells)


def roller_surface(
    roller: Roller, length: float, angle: float = 0.0, *, sectors: int = 96
) -> SurfaceMesh:
    """Make a closed surface of revolution out of plain quadrilaterals, shaded as smooth.

    Its field `surface_angle` (rad, 0 to 2 pi) is painted on the material and turns with it; its
    `normal` is that of the true surface.

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
        6 (sectors + 1) points, 3 sectors quadrilaterals: one end, the mantle, the other end.
        With a profile the mantle has more rings.  The edges' points are there twice.
    """
    first, second, along = roller.frame
    painted = np.linspace(0.0, 2.0 * np.pi, sectors + 1)
    turned = painted[:, None, None] + angle
    rings = np.linspace(-0.5, 0.5, 2 if roller.is_cylinder else PROFILE_RINGS) * length
    radius, slope = roller.radius_at(rings), roller.slope_at(rings)
    radial = np.cos(turned) * first + np.sin(turned) * second
    height = np.pad(rings, 2, mode="edge")[:, None]
    distance = np.concatenate([[0.0, radius[0]], radius, [radius[-1], 0.0]])[:, None]
    points = np.asarray(roller.centre, dtype=float) + height * along + distance * radial
    mantle = (radial - slope[:, None] * along) / np.sqrt(1.0 + slope[:, None] ** 2)
    end = np.broadcast_to(along, (sectors + 1, 2, 3))
    normal = np.concatenate([-end, mantle, end], axis=1)
    count, edges = len(height), (1, len(height) - 3)
    along_axis = np.setdiff1d(np.arange(count - 1), edges)
    start = count * np.arange(sectors)[:, None] + along_axis
    cells = np.stack([start, start + count, start + count + 1, start + 1], axis=-1).reshape(-1, 4)
    fields = {"surface_angle": np.repeat(painted, count), "normal": normal.reshape(-1, 3)}
    return SurfaceMesh(points.reshape(-1, 3), cells, fields)


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
    fields = {n: np.concatenate([s.fields[n] for s in surfaces]) for n in surfaces[0].fields}
    fields["roller"] = np.repeat(np.arange(len(surfaces)), np.diff(count))
    points = np.concatenate([surface.points for surface in surfaces])
    write_surface(path, points, np.concatenate(cells), fields)


@dataclass(frozen=True)
class Entry:
    """One state of a :class:`Collection`."""

    time: float  # s, or a control parameter
    file: str  # relative to the `.pvd`


class Collection:
    """States in the order of time, listed in a `.pvd` that can be opened at any moment.

    A state is added, after its own file has been written, by one write of a line and of what
    closes the list, over what closed it before: whatever its length, that costs the same, and a
    kill leaves the list without the line or with it.

    Parameters
    ----------
    path : path
        The `.pvd`.  Without a time nothing is written until the first addition, which replaces
        what was there.
    until_time : float, optional
        Go on with an existing file from this time on; what came later is dropped from it.
        Negative for a run that has not written anything yet.

    Attributes
    ----------
    count : int
        How many it lists.
    last : float or None
        Time of the last one.

    Raises
    ------
    InputError
        The file is damaged or not there, or a state that it lists is not.
    """

    def __init__(self, path: AnyPath, until_time: float | None = None) -> None:
        self.path, kept = Path(path), list[Entry]()
        self._end: int | None = None
        if until_time is not None:
            kept = [entry for entry in read_collection(path) if entry.time <= until_time]
            files = [self.path.with_name(entry.file) for entry in kept]
            if until_time >= 0.0:
                files.insert(0, self.path)
            if missing := [file for file in files if not file.exists()]:
                expected = "the files of the run that is to go on"
                mistake = Mistake(str(missing[0]), "", "no such file", expected, START_AFRESH)
                raise InputError([mistake])
            self._write(kept)
        self.count, self.last = len(kept), kept[-1].time if kept else None

    def add(self, time: float, file: AnyPath) -> None:
        """Add a state, not before the last one, that is on disk in the directory of the `.pvd`."""
        entry = Entry(float(time), Path(file).name)
        if self._end is None:
            self._write([entry])
        else:
            line = _line(entry)
            with named_errors(self.path), self.path.open("rb+", buffering=0) as stream:
                stream.seek(self._end)
                try:
                    if stream.write(line + COLLECTION_TAIL) < len(line + COLLECTION_TAIL):
                        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                    os.fsync(stream.fileno())
                except OSError:  # a full disk leaves the list as it was
                    stream.seek(self._end)
                    stream.write(COLLECTION_TAIL)
                    stream.truncate()
                    raise
            self._end += len(line)
        self.count, self.last = self.count + 1, entry.time

    def _write(self, entries: Iterable[Entry]) -> None:
        """Write the whole list, all at once."""
        content = COLLECTION_HEAD + b"".join(map(_line, entries))
        with atomic_write(self.path) as temporary:
            temporary.write_bytes(content + COLLECTION_TAIL)
        self._end = len(content)


COLLECTION_HEAD = b"""<?xml version='1.0' encoding='utf-8'?>
<VTKFile type="Collection" version="0.1">
  <Collection>
"""
COLLECTION_TAIL = b"  </Collection>\n</VTKFile>\n"


def _line(entry: Entry) -> bytes:
    """One state in a list of states."""
    file = escape(entry.file)
    return f'    <DataSet timestep="{entry.time!r}" group="" part="0" file="{file}"/>\n'.encode()


def read_collection(path: AnyPath) -> tuple[Entry, ...]:
    """List the states of a `.pvd`; one that is not there has none.

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
    except FileNotFoundError:
        return ()
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        expected = "the list of states that a run wrote"
        raise InputError([Mistake(str(path), "", str(error), expected, START_AFRESH)]) from error
