"""Kinematics: which displacements a strip may have, and its normals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

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


CROSS = np.zeros((3, 3, 3))
CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
CROSS[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0
"""ε_ijk in (a × b)_i = ε_ijk a_j b_k."""

QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
"""From the tangent of a section to its normal, in the plane (x, z)."""


def dot(a: Any, b: Any) -> Any:
    """a · b, components first."""
    return np.einsum("i...,i...->...", a, b)


def cross(a: Any, b: Any) -> Any:
    """a × b, components first."""
    return np.einsum("ik...,k...->i...", np.einsum("ijk,j...->ik...", CROSS, a), b)


class Normals(ABC):
    """The vector normal to a strip, as long as the area that it stands for."""

    @abstractmethod
    def vector(self, tangents: Any) -> Any:
        """m, (components, points), from tangent vectors (components, directions, points)."""

    @abstractmethod
    def works(self, tangents: Any, p: Any) -> list[Any]:
        """Vectors q_a in p · δm = Σ q_a · δr,a."""


class SurfaceNormals(Normals):
    """m = r,1 × r,2."""

    def vector(self, tangents: Any) -> Any:
        return cross(tangents[:, 0], tangents[:, 1])

    def works(self, tangents: Any, p: Any) -> list[Any]:
        return [cross(tangents[:, 1], p), cross(p, tangents[:, 0])]


class SectionNormals(Normals):
    """m is r,x turned by a right angle, in the plane (x, z)."""

    def vector(self, tangents: Any) -> Any:
        return np.einsum("ij,j...->i...", QUARTER_TURN, tangents[:, 0])

    def works(self, tangents: Any, p: Any) -> list[Any]:
        return [np.einsum("ij,j...->i...", QUARTER_TURN.T, p)]


def normals(kinematics: Kinematics) -> Normals:
    """Those of a shell or of a section; a plate has none that turns."""
    return {SHELL: SurfaceNormals, SECTION: SectionNormals}[kinematics]()
