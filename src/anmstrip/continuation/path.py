"""Branches and paths: solutions that can be called anywhere inside, and guesses of what follows."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.polynomial.polynomial import polymul, polysub

from anmstrip.arrays import Array
from anmstrip.taylor.polynomials import derivative_coefficients, first_root, roots_within, value_at


@dataclass(frozen=True)
class Branch:
    """One truncated series of a path parameter a, valid on [0, length].

    It may be a quotient: then u and control hold the numerators.
    """

    u: Array  # coefficients of the unknowns, (order + 1, n)
    control: Array  # coefficients of the control λ (load factor, or time), (order + 1,)
    length: float  # range of validity in a
    residual: Array  # initial imbalance R_0, (n,): R(a) = R_0 (1 − a / carried_over)
    carried_over: float = 1.0
    forces: tuple[float, float] = (0.0, 0.0)  # imbalance at a = 1 without the last two terms each
    denominator: Array = field(default_factory=lambda: np.array([1.0, 0.0]))  # begins with 1
    aim: float | None = None  # control at the end, where known: a quotient has it to round-off

    @property
    def order(self) -> int:
        """Highest order present."""
        return len(self.u) - 1

    def __call__(self, a: float) -> tuple[Array, float]:
        """State and control at parameter ``a``."""
        q = value_at(self.denominator, a)
        return value_at(self.u, a) / q, float(value_at(self.control, a) / q)

    def many(self, a: Array) -> tuple[Array, Array]:
        """States (m, n) and controls (m,) at parameters ``a``."""
        powers = np.vander(a, max(len(self.u), len(self.denominator)), increasing=True)
        q = powers[:, : len(self.denominator)] @ self.denominator
        powers = powers[:, : len(self.u)] / q[:, None]
        return powers @ self.u, powers @ self.control

    @cached_property
    def end(self) -> tuple[Array, float]:
        """State and control at the end of the range."""
        u, control = self(self.length)
        return u, control if self.aim is None else self.aim

    def direction(self, a: float) -> tuple[Array, float]:
        """Derivatives of state and control with respect to a."""
        u, control = self(a)
        q, rates = value_at(self.denominator, a), (self.denominator, self.u, self.control)
        slope, direction, along = (value_at(derivative_coefficients(c), a) for c in rates)
        return (direction - slope * u) / q, float((along - slope * control) / q)

    def cut(self, length: float) -> Branch:
        """The same series on another range."""
        return replace(self, length=length, aim=None)

    def reaches(self, control: float) -> float | None:
        """Smallest a in (0, length] at which the control has the given value."""
        shifted = np.asarray(polysub(self.control, control * self.denominator), dtype=np.float64)
        return first_root(shifted, self.length)

    @property
    def folds(self) -> list[float]:
        """All a in (0, length] at which the control turns back, in their order."""
        return roots_within(self._turning, self.length)

    @property
    def turns(self) -> list[float]:
        """All a in [−length, length] except 0 at which the control turns back."""
        mirrored = self._turning * (-1.0) ** np.arange(len(self._turning))
        return [*self.folds, *(-a for a in roots_within(mirrored, self.length))]

    @property
    def _turning(self) -> Array:
        """Coefficients of a polynomial that vanishes where dλ/da does."""
        q = self.denominator
        left = polymul(derivative_coefficients(self.control), q)
        slope = polysub(left, polymul(self.control, derivative_coefficients(q)))
        return np.asarray(slope, dtype=np.float64)

    def landed(self, control: float) -> Branch:
        """The same branch with an end control that has the given value."""
        moved = replace(self, control=self.control.copy(), aim=control)
        q = value_at(self.denominator, self.length)
        for _ in range(2):
            miss = control - value_at(moved.control, self.length) / q
            moved.control[1] += miss * q / self.length
        return moved


@dataclass(frozen=True)
class Path:
    """Branches end to end.

    Calling a path with a control value gives the state at the first point where
    the control has it; :meth:`at` takes the running parameter instead.
    """

    branches: tuple[Branch, ...]

    @property
    def knots(self) -> Array:
        """Running parameter at the ends of the branches, starting with 0."""
        return np.concatenate([[0.0], np.cumsum([b.length for b in self.branches])])

    def at(self, s: float) -> tuple[Array, float]:
        """State and control at running parameter ``s``."""
        knots = self.knots
        i = min(max(bisect_right(knots, s) - 1, 0), len(self.branches) - 1)
        return self.branches[i](s - knots[i])

    def __call__(self, control: float) -> Array:
        """State where the control first takes the given value.

        Raises
        ------
        ValueError
            If the path does not reach it.
        """
        if self.branches and control == self.branches[0].control[0]:
            return self.branches[0].u[0]
        for branch in self.branches:
            if (a := branch.reaches(control)) is not None:
                return branch(a)[0]
        raise ValueError(f"the path does not reach the control {control!r}")


def lagrange(times: tuple[float, ...], new: float) -> Array:
    """Values at ``new`` of the Lagrange polynomials of some instants, shape (instants,)."""
    nodes, values = np.array(times), np.empty(len(times))
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        values[j] = np.prod((new - others) / (node - others))
    return values


def extrapolate(times: tuple[float, ...], states: tuple[Array, ...], new: float) -> Array:
    """Value at ``new`` of the polynomial through all given past states."""
    return lagrange(times, new) @ np.array(states)
