"""What all effects share: a residual is a sum of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from anmstrip.fem.geometry import Kinematics
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


Moment = tuple[Array, Array | None, Mapping[str, Any]]
"""Displacements and velocities of all unknowns, and the values of the controls."""


class Effect:
    """One term of the residual R(u, v, controls) of a strip.

    1. ``name`` stands in reports, and ``points`` counts the points of evaluation.
    2. ``force`` is the residual in plain numbers, shape (unknowns,).
    3. ``rate_dependent`` says that the residual depends on v; stages with such an effect run
       in time.
    4. The remaining methods matter to contact and friction; others keep the defaults.
    """

    name: str
    points: int
    rate_dependent: bool = False

    def force(self, full: Array, velocity: Array | None, controls: Mapping[str, Any]) -> Array:
        """Return the residual of all unknowns, shape (unknowns,)."""
        raise NotImplementedError

    @property
    def by_roller(self) -> Mapping[str, Effect]:
        """The parts of an effect of rollers, by the names of the rollers."""
        return {}

    def crossing(self, states: Callable[[Array], Iterable[Moment]]) -> float | None:
        """Return where a step crosses a roller, as a share of it, though neither end shows it.

        Parameters
        ----------
        states : callable
            Shares of the step, shape (m,), to the states there.
        """
        return None

    def reversed_friction(self, before: Moment, after: Moment) -> float:
        """Return the friction (N) of points whose slip has turned round between two states."""
        return 0.0


class LawEffect(Effect):
    """Residual Lᵀ w law(L u, L v, controls): an operator, a pointwise law, and weights.

    A law is a plain function of arrays that also runs on truncated power series; from it follow
    the orders of the residual and the tangent.  A subclass has a ``name``, an ``operator``
    (L and w) and a ``law``.
    """

    operator: Operator

    @property
    def points(self) -> int:  # type: ignore[override]
        """Number of points of the operator."""
        return self.operator.points

    def near(self, full: Array, controls: Mapping[str, Any]) -> LawEffect:
        """Return the effect on those points where it is not negligible in a state."""
        return self

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Return the generalised stress at the points, of the shape of ``x`` = L u."""
        raise NotImplementedError

    def force(self, full: Array, velocity: Array | None, controls: Mapping[str, Any]) -> Array:
        """Return Lᵀ w law(L u, L v, controls), shape (unknowns,)."""
        effect = self.near(full, controls)
        operator = effect.operator
        v = operator.apply(velocity) if self.rate_dependent and velocity is not None else None
        return operator.gather(effect.law(operator.apply(full), v, controls))


@dataclass(frozen=True)
class LinearEffect(Effect):
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

    def product(self, full: Array) -> Array:
        """Return K u, shape (unknowns,)."""
        return (self.matrix @ full.reshape(-1, self.pattern.count)).ravel()

    def force(self, full: Array, velocity: Array | None, controls: Mapping[str, Any]) -> Array:
        """Return K u, shape (unknowns,)."""
        return self.product(full)

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
class LoadEffect(Effect):
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

    points = 0

    def force(self, full: Array, velocity: Array | None, controls: Mapping[str, Any]) -> Array:
        """Return minus the load, shape (unknowns,)."""
        return self.load_vector(controls[self.control])

    def load_vector(self, control: Array) -> Array:
        """Return the residual of a value of the control, shape (unknowns,)."""
        return -np.outer(self.load, self.kinematics.pick(control)).ravel()
