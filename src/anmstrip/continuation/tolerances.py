"""The five meanings of a scene's tolerance, told apart once."""

from __future__ import annotations

from dataclasses import dataclass

LOOSEST_BALANCE = 1e-2
"""Largest imbalance on a rate-free path; at 0.1 some paths stall."""

RESIDUAL_SHARE = 0.01
"""Residual of a branch in time over the error in time, in which it must not be seen."""


@dataclass(frozen=True)
class Tolerances:
    """Bounds that follow from the tolerance of a scene; forces and lengths in the problem's scales.

    The tolerance itself bounds the error of position and tension.
    """

    tolerance: float  # of a scene, relative

    @property
    def path(self) -> float:
        """Largest imbalance at the end of a branch of a rate-free path."""
        return min(self.tolerance, LOOSEST_BALANCE)

    @property
    def time(self) -> float:
        """Largest error in time: of position in the whole duration, of tension at any time."""
        return self.tolerance

    @property
    def time_residual(self) -> float:
        """Largest imbalance at the end of a branch within a time step."""
        return RESIDUAL_SHARE * self.tolerance

    @property
    def correction(self) -> float:
        """Largest imbalance of a state that Newton's method has corrected."""
        return self.tolerance

    @property
    def position(self) -> float:
        """Distance, over the length scale, below which a place is not known."""
        return self.tolerance
