"""Normals of a deformed strip, as functions that run on arrays and on series."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from .kinematics import SECTION, SHELL, Kinematics

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
