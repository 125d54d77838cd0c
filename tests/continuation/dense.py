"""Small equations R(u, λ) = 0 written as plain functions, with full matrices."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Cost, Equations
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.taylor.series import record


@dataclass
class DenseEquations(Equations):
    """The law in units: u in ``length``, R in ``force``."""

    law: Callable
    length: float = 1.0
    force: float = 1.0

    def recurrence(self, u, control, order):
        return DenseRecurrence(self, u, control, order)

    def residual(self, u, control):
        return self.force * self.law(u / self.length, control)

    @property
    def metric(self):
        return self.length**-2

    def imbalance(self, residual):
        return float(np.abs(residual).max()) / self.force


class DenseRecurrence:
    def __init__(self, equations, u, control, order):
        self.size = len(u)
        self.orders = record(equations.residual, u, control).start(u, control, order=order)
        self.residual = self.orders.value

    def tangent(self):
        return self.orders.derivative(np.eye(self.size)).T

    def control_derivative(self):
        return self.orders.derivative(None, 1.0)

    def advance(self, k):
        return self.orders.advance(k)

    def correct(self, k, u, control):
        self.orders.correct(u, control)


def followed(equations, u, *, start=0.0, target=1.0, pace=None, cost=None, **choices):
    """All steps of a path."""
    return list(
        follow(
            equations,
            np.asarray(u, dtype=float),
            solver=DenseSolver(),
            settings=Settings(**choices),
            start=start,
            target=target,
            pace=pace,
            cost=Cost() if cost is None else cost,
        )
    )


def one(law):
    """A scalar law as a law of one unknown."""
    return DenseEquations(lambda u, control: np.stack([law(u[0], control)]))


def coupled(u, control):
    """Two unknowns, both entering nonlinearly; solved by (0, 0) at λ = 0."""
    x, y = u[0], u[1]
    return np.stack([x + 0.3 * np.sin(y) - control, y * np.exp(0.2 * x) - x * x - 0.5 * control])
