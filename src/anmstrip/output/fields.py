"""Names, labels and units of the fields of a state: the one table that pictures read."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
