"""Outcomes of a path, and the exception that tells one."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Outcome(Enum):
    """Outcome of a path; the value is the sentence for the user."""

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
    """Unknowns at which a path failed, as far as it shows."""

    unknown: int | None = None  # number of the one whose pivot vanished, or that is not finite
    residual: Array | None = None  # (n,), imbalance that stays, or the first that comes
    motion: Array | None = None  # (n,), change that goes wrong: error of a step, way back of a fold


NO_EVIDENCE = Evidence()


class PathStopped(Exception):  # noqa: N818
    """A path ended before its target, at ``control``, for the reason ``outcome``.

    ``detail`` says what else is known, ``evidence`` which unknowns show it.
    """

    def __init__(
        self, outcome: Outcome, control: float, detail: str = "", evidence: Evidence = NO_EVIDENCE
    ) -> None:
        super().__init__(f"{outcome.value} (at {control:.6g}){': ' + detail if detail else ''}")
        self.outcome, self.control, self.detail = outcome, control, detail
        self.evidence = evidence
