"""Backward difference formulas with variable steps, and the past that they need.

Source: Hairer, Nørsett & Wanner, *Solving ODEs I* (1993), §III.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AffineVelocity:
    """v(u, λ) = rate u + base + λ slope."""

    rate: float
    base: Array
    slope: Array

    def __call__(self, u: Array, control: float) -> Array:
        """Velocity, shape (n,)."""
        return self.rate * u + self.base + control * self.slope


@dataclass(frozen=True)
class Memory:
    """Past of an integration: times and states, the latest first; next step and order to try."""

    times: tuple[float, ...]
    states: tuple[Array, ...]
    v: Array
    step: float
    order: int = 1

    @property
    def available(self) -> int:
        """Order of the formula that the past allows."""
        return len(self.times)


def start(t: float, u: Array, v: Array, step: float) -> Memory:
    """Memory of an integration that begins."""
    return Memory((t,), (u,), v, step)


def formula(times: tuple[float, ...], new: float, order: int) -> tuple[Array, float]:
    """Weights of a backward difference formula with variable steps.

    Parameters
    ----------
    times : tuple of float
        Past instants, the latest first; at least ``order`` of them.
    new : float
    order : int

    Returns
    -------
    past : ndarray, shape (order,)
        v = rate u + Σ past_j u(times_j) is the derivative at ``new`` of the
        polynomial through the new and ``order`` past states.
    rate : float
    """
    nodes = np.array(times[:order])
    distance = new - nodes
    rate = float((1.0 / distance).sum())
    past = np.empty(order)
    for j in range(order):
        others = np.delete(np.arange(order), j)
        past[j] = -np.prod(distance[others] / (nodes[j] - nodes[others])) / distance[j]
    return past, rate


def predicted(times: tuple[float, ...], states: tuple[Array, ...], new: float) -> Array:
    """Value at ``new`` of the polynomial through all given past states."""
    nodes = np.array(times)
    total = np.zeros_like(states[0])
    for j, state in enumerate(states):
        others = np.delete(nodes, j)
        total += np.prod((new - others) / (nodes[j] - others)) * state
    return total
