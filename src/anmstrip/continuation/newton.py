"""Newton's iteration at one control, from a guess that is not on the path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Cost, Equations
from anmstrip.linalg.solvers import Factors, LinearSolver, SingularTangentError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Corrections:
    """Choices of the iteration.

    Attributes
    ----------
    tolerance : float
        Largest imbalance of a state that is found, in units of the problem's forces.
    most : int
        Iterations after which a guess is given up.
    kept : float
        A tangent is kept while an iteration leaves less than this part of the imbalance; 0
        makes a new one for each.
    halvings : int
        Of a correction that makes the imbalance grow (line search); 0 takes it as it is.
    """

    tolerance: float = 1e-8
    most: int = 20
    kept: float = 0.0
    halvings: int = 0


@dataclass(frozen=True)
class Corrected:
    """A state that was found.

    Attributes
    ----------
    u : ndarray, shape (n,)
    control : float
    iterations : int
        That it took.
    imbalance : float
    """

    u: Array
    control: float
    iterations: int
    imbalance: float


class Newton:
    """Newton's iteration; the tangents of one state are not kept for the next.

    Parameters
    ----------
    equations : Equations
    solver : LinearSolver
    settings : Corrections
    cost : Cost
        Counters to add to.
    """

    def __init__(
        self, equations: Equations, solver: LinearSolver, settings: Corrections, cost: Cost
    ) -> None:
        self.equations, self.solver, self.settings, self.cost = equations, solver, settings, cost

    def corrected(self, u: Array, control: float) -> Corrected | None:
        """The state nearby that is in equilibrium, or None if that does not converge."""
        factors: Factors | None = None
        residual, imbalance = self._residual(u, control)
        before = np.inf
        for iteration in range(self.settings.most + 1):
            if imbalance <= self.settings.tolerance:
                return Corrected(u, control, iteration, imbalance)
            if not np.isfinite(imbalance):
                return None
            if factors is None or imbalance > self.settings.kept * before:
                factors = self._factorised(u, control)
                if factors is None:
                    return None
            self.cost.solves += 1
            with self.cost.timed("back-substitution"):
                change = factors.solve(residual)
            before = imbalance
            u, residual, imbalance = self._searched(u, change, control, imbalance)
        return None

    def _searched(
        self, u: Array, change: Array, control: float, imbalance: float
    ) -> tuple[Array, Array, float]:
        """The corrected state, with as much of the correction as does not make it worse."""
        residual, found = self._residual(u - change, control)
        for _ in range(self.settings.halvings):
            if found < imbalance:
                break
            change = 0.5 * change
            residual, found = self._residual(u - change, control)
        return u - change, residual, found

    def _residual(self, u: Array, control: float) -> tuple[Array, float]:
        self.cost.residuals += 1
        with self.cost.timed("residual"), np.errstate(over="ignore", invalid="ignore"):
            residual = self.equations.residual(u, control)
            return residual, self.equations.imbalance(residual)

    def _factorised(self, u: Array, control: float) -> Factors | None:
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
