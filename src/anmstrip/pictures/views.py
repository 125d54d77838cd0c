"""Fields with their units, and what a picture shows, whichever program draws it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from matplotlib.colors import Colormap, LinearSegmentedColormap
from numpy.typing import NDArray

from anmstrip.results.vtk import (
    FIELDS,
    TENSOR,
    Field,
    Points,
    read_surface,
    scalars,
    sector_tones,
    subdivide,
)

PREFIXES = {-6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


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
        Factor of values in SI.

    Examples
    --------
    >>> title("normal_pressure", 2.0e4)
    ('normal pressure [kPa]', 0.001)
    >>> title("bending_moment", 0.02)[0]
    'bending moment, xx [0.001 N]'
    """
    base, _, component = name.partition(".")
    field = FIELDS.get(base, Field(base.replace("_", " "), ""))
    component = component or ("xx" if field.components == TENSOR else "")
    label = f"{field.label}, {component}" if component else field.label
    power = 0
    if field.unit and not field.unit.startswith("1") and 0.0 < largest < np.inf:
        power = 3 * int(np.floor(np.log10(largest) / 3.0))
        power = min(max(power, min(PREFIXES)), max(PREFIXES))
    prefixed = f"{PREFIXES[power]}{field.unit}"
    if power == -3 and field.unit.startswith("N"):
        prefixed = f"0.001 {field.unit}"  # mN might be m N; VTK has no raised minus
    unit = f" [{prefixed}]" if field.unit not in ("", "1") else ""
    return label + unit, 10.0**-power


DIRECTION = np.array([-0.32, -0.80, 0.50])
"""Vector from the scene towards the eye: the side, the top and the entry are all seen."""
GREYS = "#8d9197", "#a9adb2"
"""The two tones of a roller, whose sectors show its turning."""
LIGHT = np.array([-0.15, 0.5, 0.85])
"""Vector towards the lamp, in the axes of the eye."""
AMBIENT = 0.45
"""Share of light that comes from everywhere."""
OUTLINE = "#3b4046"
NO_VALUE = "#d9d9d9"
STEEL = "#c4ced8", "#9fc3d4", "#f2c14e", "#e4652c", "#8c1c2b"
SIGNED = "#2a5d9f", "#e8e8e6", "#b0303a"
MARGIN = 1.06
HEAD = 0.2
"""Share of a picture, at its top, that the time and the scale have for themselves."""
STEPS = 1.0, 2.0, 2.5, 5.0
"""Distances of the labels of a scale, times powers of ten."""


@dataclass(frozen=True)
class Frame:
    """One picture to draw."""

    strip: Path  # .vtu file
    rollers: Path | None  # .vtu file, if there are any
    time: float
    picture: Path  # .png file to write

    def read_strip(self, field: str) -> tuple[Points, NDArray[np.int64], NDArray[np.float64]]:
        """Read the points, the plain quadrilaterals and the values that colour them.

        A triangle is a quadrilateral whose last two corners coincide.  The values are NaN in a
        state without that field (no slip without friction).
        """
        surface = read_surface(self.strip)
        cells = subdivide(surface.cells)
        if cells.shape[1] == 3:
            cells = cells[:, [0, 1, 2, 2]]
        values = surface.fields.get(field.partition(".")[0])
        if values is None:
            values = np.full(len(surface.points), np.nan)
        return surface.points, cells, scalars(field, values)

    def read_rollers(self) -> tuple[Points, NDArray[np.int64], NDArray[np.int64]] | None:
        """Read the points, the quadrilaterals and the tone, 0 or 1, of each of them."""
        if self.rollers is None:
            return None
        surface = read_surface(self.rollers)
        return surface.points, surface.cells, sector_tones(surface)


@dataclass(frozen=True)
class Eye:
    """A parallel projection."""

    axes: Points  # rows: to the right, upwards, towards the eye
    focus: Points  # the point in the middle of the picture (m)
    half_height: float  # half of what is seen from bottom to top (m)

    @classmethod
    def seeing(cls, low: Points, high: Points, size: tuple[int, int]) -> Self:
        """Look at a box so that it fits into a picture of a size in pixels, below its head."""
        towards = DIRECTION / np.linalg.norm(DIRECTION)
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(towards, right), towards])
        corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
        seen = corners @ axes.T
        middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
        width, height, _ = np.ptp(seen, axis=0)
        tallest = max(height / (1.0 - HEAD), width * size[1] / size[0])
        half_height = max(0.5 * MARGIN * tallest, np.finfo(float).tiny)
        middle[1] += HEAD * half_height
        return cls(axes, middle @ axes, half_height)

    def projected(self, points: Points) -> Points:
        """Return coordinates to the right, upwards and towards the eye; (..., 3) in metres."""
        return (points - self.focus) @ self.axes.T


def labelled(low: float, high: float) -> tuple[float, float, int]:
    """Widen a scale to round ends with round labels between them.

    Returns
    -------
    low, high : float
    labels : int
        Number of evenly spaced labels, both ends included: four to eight.

    Examples
    --------
    >>> labelled(0.0, 47.5)
    (0.0, 50.0, 6)
    >>> labelled(-3.0, 3.0)
    (-3.0, 3.0, 7)
    """
    power = np.floor(np.log10(high - low))
    for step in [s * 10.0**p for p in (power - 1.0, power) for s in STEPS]:
        first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
        if last - first <= 7.0:
            break
    return float(first * step), float(last * step) + 0.0, int(last - first) + 1


@dataclass(frozen=True)
class Job:
    """Pictures with the same field, scale, eye and size."""

    frames: tuple[Frame, ...]  # in the order of time
    field: str  # a field of the strip, or a field and a component
    limits: tuple[float, float]  # ends of the colour scale, in SI
    eye: Eye
    size: tuple[int, int]  # width and height of a picture, in pixels
    labels: int = 5  # of the colour scale, evenly spaced

    @property
    def colours(self) -> Colormap:
        """Colours of the scale: two-sided if the values are of both signs."""
        signed = self.limits[0] < 0.0 < self.limits[1]
        return LinearSegmentedColormap.from_list("strip", SIGNED if signed else STEEL)

    @property
    def scale(self) -> tuple[str, float, tuple[float, float]]:
        """Title of the scale, factor of values in SI, and its ends in the unit of the title."""
        low, high = self.limits
        label, factor = title(self.field, max(abs(low), abs(high)))
        return label, factor, (low * factor, high * factor)
