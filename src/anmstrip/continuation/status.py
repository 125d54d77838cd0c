"""How a path ends, and the exception that says so."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Outcome(Enum):
    """How a path ended; the value is the sentence for the user."""

    DONE = "reached the end"
    FOLD = "the control cannot be increased further: the path turned back at a limit point"
    STALLED = "steps became too short: the path has a singular point here"
    SINGULAR = "the tangent is singular: something is not held, or a bifurcation"
    TOO_MANY_STEPS = "the allowed number of steps was used up; allow more"
    TOO_MANY_TANGENTS = "the allowed number of tangents was used up; allow more"
    INTERRUPTED = "it was interrupted"
    NOT_FINITE = "the equations gave values that are not finite"

    @property
    def done(self) -> bool:
        """Whether the path was completed."""
        return self is Outcome.DONE


@dataclass(frozen=True)
class Evidence:
    """Which unknowns a path failed at, as far as it shows.

    Attributes
    ----------
    unknown : int or None
        Number of the one whose pivot vanished, or that is not finite.
    residual : ndarray or None, shape (n,)
        Imbalance that stays, or where a step ends the first that comes.
    motion : ndarray or None, shape (n,)
        Change of state that goes wrong: the error of a step, or the way back of a fold.
    """

    unknown: int | None = None
    residual: Array | None = None
    motion: Array | None = None


NO_EVIDENCE = Evidence()


class PathStopped(Exception):  # noqa: N818
    """A path ended before its target.

    Attributes
    ----------
    outcome : Outcome
    control : float
        Where.
    detail : str
        What else is known.
    evidence : Evidence
        Where among the unknowns.
    """

    def __init__(
        self,
        outcome: Outcome,
        control: float,
        detail: str = "",
        evidence: Evidence = NO_EVIDENCE,
    ) -> None:
        super().__init__(f"{outcome.value} (at {control:.6g}){': ' + detail if detail else ''}")
        self.outcome = outcome
        self.control = control
        self.detail = detail
        self.evidence = evidence
