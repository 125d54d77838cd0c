"""Which displacements a strip may have, and on which reference they live.

========  ==========  ==============================================================
name      unknowns    what is left out
========  ==========  ==============================================================
shell     x, y, z     nothing: a surface in space, any rotation
section   x, z        the width: cylindrical bending, any rotation, N_yy = 0
plate     z           motion in the plane: small deflections of a strip under tension
========  ==========  ==============================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kinematics:
    """A level of description.

    Attributes
    ----------
    name : str
    components : tuple of int
        Which of x, y, z (0, 1, 2) are unknown.
    directions : int
        Dimensions of the reference: 2 for a surface, 1 for a line along the strip.
    """

    name: str
    components: tuple[int, ...]
    directions: int

    @property
    def count(self) -> int:
        """Number of unknown components."""
        return len(self.components)

    @cached_property
    def chosen(self) -> Array:
        """Rows of the identity that belong to the components, shape (components, 3)."""
        return np.eye(3)[list(self.components)]

    @cached_property
    def flat(self) -> Array:
        """Tangent vectors of the flat reference, shape (components, directions, 1)."""
        return np.ascontiguousarray(self.chosen[:, : self.directions, None])

    def pick(self, vector: ArrayLike) -> Array:
        """Components of vectors in space, components on the last axis."""
        return np.asarray(vector, dtype=float)[..., list(self.components)]

    def embed(self, values: Array) -> Array:
        """Vectors in space of components on the first axis, shape (3, ...)."""
        whole = np.zeros((3, *values.shape[1:]))
        whole[list(self.components)] = values
        return whole

    def place(self, component: int) -> int | None:
        """Number of a component of space among the unknown ones, ``None`` if it is not."""
        return self.components.index(component) if component in self.components else None


SHELL = Kinematics("shell", (0, 1, 2), 2)
SECTION = Kinematics("section", (0, 2), 1)
PLATE = Kinematics("plate", (2,), 2)
KINEMATICS = {level.name: level for level in (PLATE, SECTION, SHELL)}
