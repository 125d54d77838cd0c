"""Types of arrays, as annotations name them, and numbers of which some are refused."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

NUMBERS = {
    "poisson": (-1.0, 0.5, "above -1 and below 0.5"),
    **dict.fromkeys(
        ("coefficient", "exponent", "omega", "density", "expansion"),
        (np.nextafter(0.0, -1.0), np.inf, "of at least 0"),
    ),
}
"""Bounds between which some numbers of laws and materials are, in words too; others are above 0."""


def require_number(owner: object, name: str, value: Any) -> None:
    """Raise a ValueError for a number, or one of several, that a thing cannot have."""
    least, most, words = NUMBERS.get(name, (0.0, np.inf, "above 0"))
    number = np.asarray(value, dtype=float)
    if not np.all((number > least) & (number < most)):
        kind = type(owner).__name__
        raise ValueError(f"{kind}: {name} = {value!r}, expected a finite number {words}")


class NumbersInRange:
    """A dataclass that raises a ValueError for a number that it cannot have."""

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]
            require_number(self, field.name, getattr(self, field.name))
