"""What all effects share: a residual is a sum of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from anmstrip.fem.kinematics import Kinematics
from anmstrip.fem.operators import Pattern

Array = NDArray[np.float64]


class Operator(Protocol):
    """L: from unknowns to points."""

    @property
    def points(self) -> int:
        """Number of points."""

    def apply(self, full: Array) -> Array:
        """L u."""

    def gather(self, forces: Array) -> Array:
        """Lᵀ w f."""

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Array) -> None:
        """Add Lᵀ w J L."""


class LawEffect(Protocol):
    """Residual Lᵀ w law(L u, L v, controls)."""

    @property
    def name(self) -> str:
        """For reports."""

    @property
    def operator(self) -> Operator:
        """Where the law is looked at."""

    @property
    def rate_dependent(self) -> bool:
        """Whether the law looks at the velocity."""

    def near(self, full: Array, controls: Mapping[str, Any]) -> LawEffect:
        """The same effect on those points where it is not negligible at this state."""

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Generalised stress at the points, same shape as ``x``."""


@dataclass(frozen=True)
class LinearEffect:
    """Residual K u, the same scalar matrix K for every component.

    Attributes
    ----------
    name : str
    points : int
        Quadrature points that K was made with.
    block : ndarray, shape (couplings,)
        Entries of K on the pattern.
    pattern : Pattern
    """

    name: str
    points: int
    block: Array
    pattern: Pattern

    def force(self, full: Array) -> Array:
        """K u, shape (unknowns,)."""
        return (self.matrix @ full.reshape(-1, self.pattern.count)).ravel()

    @cached_property
    def matrix(self) -> csr_matrix:
        """K, shape (scalars, scalars)."""
        p = self.pattern
        return csr_matrix((self.block, (p.row, p.column)), shape=(p.scalars, p.scalars))

    def add_tangent(self, blocks: Array) -> None:
        """Add K to the diagonal blocks."""
        for c in range(self.pattern.count):
            blocks[c, c] += self.block


@dataclass(frozen=True)
class LoadEffect:
    """Residual −load ⊗ control: a dead force that a vector in space scales.

    Attributes
    ----------
    name : str
    control : str
        Name of the control, a vector (N/m for an edge, m/s² for gravity).
    load : ndarray, shape (scalars,)
        Generalised force of a unit control.
    kinematics : Kinematics
        Which of its components do work.
    """

    name: str
    control: str
    load: Array
    kinematics: Kinematics

    def force(self, control: Array) -> Array:
        """Residual of a value of the control, shape (unknowns,)."""
        return -np.outer(self.load, self.kinematics.pick(control)).ravel()


Effect = LawEffect | LinearEffect | LoadEffect
