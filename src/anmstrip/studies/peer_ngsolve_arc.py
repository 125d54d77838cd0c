"""NGSolve around limit points: our arc on its equations, with its linear solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.series.expansion import Cost
from anmstrip.studies.peer_capstan import timed
from anmstrip.studies.peer_plates import ALONG, Array, Bent, Plate, limits
from anmstrip.studies.riks import arc_steps

if TYPE_CHECKING:
    from anmstrip.studies.peer_ngsolve import Shell


def snapped(built: Callable[[], Shell], plate: Plate) -> Bent:
    """Build, solve around the limit points of the load, read."""
    cost, path = Cost(), [(0.0, 0.0)]
    found: list[Any] = []
    own: Any = _Own()

    def work() -> None:
        equations: Any = _Snapping(built(), plate)
        found.append(equations)
        steps = arc_steps(equations, np.zeros(len(equations.rows)), solver=own,
                          settings=ALONG, target=plate.end, cost=cost)  # fmt: skip
        for step in steps:
            path.append((step.control, -float(step.u[equations.loaded])))
            equations.shell.average()

    seconds, steps = timed(work), len(path) - 1
    return Bent(limits(*zip(*path, strict=True)), steps, cost.factorisations,
                sum(found[0].shell.free), seconds)  # fmt: skip


@dataclass(frozen=True)
class _Snapping:
    """What :func:`~anmstrip.studies.riks.arc_steps` asks of a shell with a force at a corner."""

    shell: Shell
    plate: Plate

    @cached_property
    def rows(self) -> NDArray[np.int64]:
        """Unknowns, those that are eliminated too."""
        return np.flatnonzero(list(self.shell.state.space.FreeDofs()))

    @cached_property
    def loaded(self) -> int:
        """Row of the displacement under the force."""
        return int(np.searchsorted(self.rows, self.shell.state.space.Range(2).start))

    @cached_property
    def metric(self) -> Array:
        """Displacements in units of 10."""
        return np.where(self.rows < self.shell.state.space.Range(3).start, 1e-2, 0.0)

    def recurrence(self, u: Array, control: float, order: int) -> _Linear:
        """Residual, and what its derivatives are made of."""
        shell, residual = self.shell, self.shell.state.vec.CreateVector()
        shell.state.vec.FV().NumPy()[self.rows] = u
        shell.energy.AssembleLinearization(shell.state.vec)
        shell.energy.Apply(shell.state.vec, residual)
        force = np.zeros(len(self.rows))
        force[self.loaded] = self.plate.force
        return _Linear(self, residual.FV().NumPy()[self.rows] - control * force, force)

    def imbalance(self, residual: Array) -> float:
        """Forces over the full one; angles that do not fit, over 0.1."""
        forces = self.metric > 0.0
        sizes = np.linalg.norm(residual[forces]), np.linalg.norm(residual[~forces])
        return float(sizes[0] / abs(self.plate.force) + sizes[1] / 10.0)


@dataclass(frozen=True)
class _Linear:
    """A state's imbalance and its derivatives."""

    equations: _Snapping
    residual: Array
    force: Array

    def tangent(self) -> _Snapping:
        """Its own matrices are those of the state."""
        return self.equations

    def control_derivative(self) -> Array:
        return -self.force


class _Own:
    """Its linear solver."""

    def factorise(self, equations: _Snapping) -> _Factors:
        return _Factors(equations, equations.shell.inverse())


@dataclass(frozen=True)
class _Factors:
    equations: _Snapping
    inverse: Any

    def solve(self, right: Array) -> Array:
        """The whole solution of a system, what is eliminated too."""
        shell, rows = self.equations.shell, self.equations.rows
        residual = shell.state.vec.CreateVector()
        residual[:] = 0.0
        residual.FV().NumPy()[rows] = right
        return np.array(shell.solved(self.inverse, residual).FV().NumPy()[rows])
