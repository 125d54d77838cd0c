"""Newton's iteration at one control, from a guess that is not on the path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.equations import Cost, Equations
from anmstrip.linalg.direct import Factors, SingularTangentError
from anmstrip.linalg.solvers import LinearSolver


@dataclass(frozen=True)
class Corrections:
    """Choices of the iteration."""

    tolerance: float = 1e-8  # largest imbalance of a state that is found
    most: int = 20  # iterations after which a guess is given up
    kept: float = 0.0  # part of the imbalance: while an iteration leaves less, the tangent is kept
    halvings: int = 0  # of a correction that makes the imbalance grow (line search)


@dataclass(frozen=True)
class Corrected:
    """A state in equilibrium."""

    u: Array  # (n,)
    control: float
    iterations: int
    imbalance: float


@dataclass(frozen=True)
class Newton:
    """Newton's iteration; the tangents of one state are not kept for the next."""

    equations: Equations
    solver: LinearSolver
    settings: Corrections
    cost: Cost  # counters to add to

    def corrected(self, u: Array, control: float) -> Corrected | None:
        """The state nearby that is in equilibrium, or None if that does not converge."""
        cost, factors, before = self.cost, None, np.inf
        residual, imbalance = self._residual(u, control)
        for iteration in range(self.settings.most + 1):
            if imbalance <= self.settings.tolerance:
                return Corrected(u, control, iteration, imbalance)
            if not np.isfinite(imbalance):
                return None
            if factors is None or imbalance > self.settings.kept * before:
                factors = self._factors(u, control)
                if factors is None:
                    return None
            cost.solves += 1
            with cost.timed("back-substitution"):
                change = factors.solve(residual)
            residual, found = self._residual(u - change, control)
            for _ in range(self.settings.halvings):
                if found < imbalance:
                    break
                change = 0.5 * change
                residual, found = self._residual(u - change, control)
            u, before, imbalance = u - change, imbalance, found
        return None

    def _residual(self, u: Array, control: float) -> tuple[Array, float]:
        self.cost.residuals += 1
        with self.cost.timed("residual"), np.errstate(over="ignore", invalid="ignore"):
            residual = self.equations.residual(u, control)
            return residual, self.equations.imbalance(residual)

    def _factors(self, u: Array, control: float) -> Factors | None:
        """Factors of the tangent, or None if it is singular or no more are allowed."""
        if self.cost.expansions >= self.cost.most:
            return None
        with self.cost.timed("tangent"):
            matrix = self.equations.recurrence(u, control, 1).tangent()
        self.cost.expansions += 1
        self.cost.factorisations += 1
        try:
            with self.cost.timed("factorisation"):
                return self.solver.factorise(matrix)
        except SingularTangentError:
            return None
