"""Fields with their units, and what a picture shows, whichever program draws it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Self

import numpy as np
from matplotlib.colors import Colormap, LinearSegmentedColormap
from numpy.typing import NDArray

from anmstrip.results.vtk import Points, Surface, read_surface, subdivided

VECTOR = ("x", "y", "z")
TENSOR = ("xx", "yy", "xy")
_PREFIXES = {-6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


@dataclass(frozen=True)
class Field:
    """How one field is shown.

    Attributes
    ----------
    label : str
        In words.
    unit : str
        SI unit, as printed.
    components : tuple of str
        Names of the columns; empty for a scalar.
    """

    label: str
    unit: str
    components: tuple[str, ...] = ()


FIELDS = {
    "displacement": Field("displacement", "m", VECTOR),
    "velocity": Field("velocity", "m/s", VECTOR),
    "normal_pressure": Field("normal pressure", "Pa"),
    "friction_traction": Field("friction traction", "Pa", VECTOR),
    "slip_velocity": Field("slip velocity", "m/s", VECTOR),
    "gap": Field("gap", "m"),
    "membrane_force": Field("membrane force", "N/m", TENSOR),
    "bending_moment": Field("bending moment", "N", TENSOR),
    "von_mises": Field("von Mises stress, top", "Pa"),
    "mean_curvature": Field("mean curvature", "1/m"),
    "surface_angle": Field("angle of the surface", "rad"),
}


def choices(names: Iterable[str]) -> list[str]:
    """List what can be asked for: every field, and its components after a dot.

    Examples
    --------
    >>> choices(["gap", "velocity"])
    ['gap', 'velocity', 'velocity.x', 'velocity.y', 'velocity.z']
    """
    found = []
    for name in names:
        components = FIELDS[name].components if name in FIELDS else ()
        found += [name, *(f"{name}.{component}" for component in components)]
    return found


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
    return values[:, 0] if components == TENSOR else np.linalg.norm(values, axis=1)


def title(name: str, largest: float) -> tuple[str, float]:
    """Write the title of a scale whose numbers stay between 1 and 1000.

    Parameters
    ----------
    name : str
        A field, or a field and a component.
    largest : float
        Largest absolute value to show, in SI.

    Returns
    -------
    title : str
        Label and prefixed unit.
    factor : float
        What to multiply SI values by.

    Examples
    --------
    >>> title("normal_pressure", 2.0e4)
    ('normal pressure [kPa]', 0.001)
    """
    base, _, component = name.partition(".")
    field = FIELDS.get(base, Field(base.replace("_", " "), ""))
    component = component or ("xx" if field.components == TENSOR else "")
    label = f"{field.label}, {component}" if component else field.label
    power = _power_of_ten(largest) if field.unit and not field.unit.startswith("1/") else 0
    unit = f" [{_PREFIXES[power]}{field.unit}]" if field.unit else ""
    return label + unit, 10.0**-power


def _power_of_ten(largest: float) -> int:
    if not np.isfinite(largest) or largest <= 0.0:
        return 0
    thousands = 3 * int(np.floor(np.log10(largest) / 3.0))
    return min(max(thousands, min(_PREFIXES)), max(_PREFIXES))


DIRECTION = np.array([-0.32, -0.80, 0.50])
"""From the scene towards the eye: the side, the top and the entry are all seen."""
GREYS = "#8d9197", "#a9adb2"
"""The two tones of a roller, whose sectors show its turning."""
LIGHT = np.array([-0.15, 0.5, 0.85])
"""Towards the lamp, in the axes of the eye."""
AMBIENT = 0.45
OUTLINE = "#3b4046"
_SECTORS = 12
_STEEL = ["#c4ced8", "#9fc3d4", "#f2c14e", "#e4652c", "#8c1c2b"]
_MARGIN = 1.06


@dataclass(frozen=True)
class Frame:
    """One picture to draw.

    Attributes
    ----------
    strip : str
        The `.vtu` of the strip.
    rollers : str
        The `.vtu` of the rollers; empty if there are none.
    time : float
        When.
    picture : str
        The `.png` to write.
    """

    strip: str
    rollers: str
    time: float
    picture: str

    def strip_coloured(self, field: str) -> tuple[Points, NDArray[np.int64], NDArray[np.float64]]:
        """Read the points, the plain quadrilaterals and the values that colour them.

        A triangle is a quadrilateral whose last two corners coincide.  The values are NaN in a
        state without that field (no slip without friction).
        """
        surface = read_surface(self.strip)
        cells = subdivided(surface.cells)
        if cells.shape[1] == 3:
            cells = cells[:, [0, 1, 2, 2]]
        values = surface.fields.get(field.partition(".")[0])
        if values is None:
            values = np.full(len(surface.points), np.nan)
        return surface.points, cells, scalars(field, values)

    def rollers_toned(self) -> tuple[Surface, NDArray[np.int64]] | None:
        """Read the rollers and the tone, 0 or 1, of each of their quadrilaterals."""
        if not self.rollers:
            return None
        surface = read_surface(self.rollers)
        angle = surface.fields["surface_angle"][surface.cells].mean(axis=1)
        return surface, np.floor(angle * _SECTORS / (2.0 * np.pi)).astype(int) % 2


@dataclass(frozen=True)
class Job:
    """Pictures with the same field, scale, eye and size.

    Attributes
    ----------
    frames : tuple of Frame
        What to draw, in the order of time.
    field : str
        A field of the strip, or a field and a component.
    limits : (float, float)
        Ends of the colour scale, in SI.
    low, high : (float, float, float)
        Corners of the box that must be seen, in metres.
    size : (int, int)
        Width and height of a picture, in pixels.
    """

    frames: tuple[Frame, ...]
    field: str
    limits: tuple[float, float]
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    size: tuple[int, int]

    def to_json(self) -> str:
        """Write the job so that another process can take it over."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Take over a job."""
        job = cls(**json.loads(text))
        frames = tuple(Frame(**frame) for frame in job.frames)  # type: ignore[arg-type]
        return cls(frames, job.field, job.limits, job.low, job.high, job.size)

    @property
    def colours(self) -> Colormap:
        """Colours of the scale: two-sided if the values are of both signs."""
        if self.limits[0] < 0.0 < self.limits[1]:
            return LinearSegmentedColormap.from_list("sign", ["#2a5d9f", "#e8e8e6", "#b0303a"])
        return LinearSegmentedColormap.from_list("steel", _STEEL)

    @property
    def eye(self) -> "Eye":  # noqa: UP037
        """Where the box of the job fills the picture, without perspective."""
        return Eye.seeing(np.array(self.low), np.array(self.high), self.size)


@dataclass(frozen=True)
class Eye:
    """A parallel projection.

    Attributes
    ----------
    axes : (3, 3) array
        Rows: to the right, upwards, towards the eye.
    focus : (3,) array
        The point in the middle of the picture, in metres.
    half_height : float
        Half of what is seen from bottom to top, in metres.
    """

    axes: Points
    focus: Points
    half_height: float

    @classmethod
    def seeing(cls, low: Points, high: Points, size: tuple[int, int]) -> Self:
        """Look at a box so that it fits into a picture of a size in pixels."""
        towards = DIRECTION / np.linalg.norm(DIRECTION)
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(towards, right), towards])
        corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
        seen = corners @ axes.T
        middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
        width, height, _ = np.ptp(seen, axis=0)
        half_height = 0.5 * _MARGIN * max(height, width * size[1] / size[0])
        return cls(axes, middle @ axes, max(half_height, np.finfo(float).tiny))

    def projected(self, points: Points) -> Points:
        """Coordinates to the right, upwards and towards the eye; (..., 3) in metres."""
        return (points - self.focus) @ self.axes.T


def box(surfaces: Iterable[Surface]) -> tuple[Points, Points]:
    """Lowest and highest corner of a box around all points."""
    points = np.concatenate([surface.points for surface in surfaces])
    return points.min(axis=0), points.max(axis=0)
