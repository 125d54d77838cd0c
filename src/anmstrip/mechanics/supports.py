"""What is held, how it moves, and what errors are measured against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Scales:
    """What errors are measured against.

    Attributes
    ----------
    length : float
        m, for positions.
    force : float
        N, for imbalances.
    tension : float
        N/m, for membrane forces.
    """

    length: float
    force: float
    tension: float


@dataclass(frozen=True)
class Supports:
    """Which unknowns are free, and the motion of the others.

    u = start + λ slope + λ (λ − 1) bow, where the bow is that of a velocity that changes
    linearly.

    Attributes
    ----------
    free : ndarray of int
        Numbers of the free unknowns.
    start, slope : ndarray, shape (unknowns,)
        At the free unknowns the slope is zero, and the start what they are counted from.
    bow : ndarray, shape (unknowns,), or None
        Of a whole stage in time; a path in λ is straight.
    """

    free: Index
    start: Array
    slope: Array
    bow: Array | None = None

    @classmethod
    def at_rest(cls, unknowns: int, held: Index) -> Supports:
        """Some of the unknowns held at zero, the others free."""
        zero = np.zeros(unknowns)
        return cls(np.setdiff1d(np.arange(unknowns), held), zero, zero)

    def full(self, u: Array, control: float) -> Array:
        """All unknowns from the free ones, shape (unknowns,)."""
        whole = self.start + control * self.slope
        if self.bow is not None:
            whole += control * (control - 1.0) * self.bow
        whole[self.free] += u
        return whole

    def rate(self, control: float) -> Array:
        """du/dλ of what is held, zero elsewhere, shape (unknowns,)."""
        bent = 0.0 if self.bow is None else (2.0 * control - 1.0) * self.bow
        return self.slope + bent

    def change(self, u: Array, control: float) -> Array:
        """Change of all unknowns with a change of the free ones and of λ."""
        whole = control * self.slope
        whole[self.free] = u
        return whole
