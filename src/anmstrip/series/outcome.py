"""How a path ends, and the exception that says so."""

from __future__ import annotations

from enum import Enum


class Outcome(Enum):
    """How a path ended; the value is the sentence for the user."""

    DONE = "reached the end"
    FOLD = "the control cannot be increased further: the path turned back at a limit point"
    STALLED = "steps became too short: the path has a singular point here"
    SINGULAR = "the tangent is singular: something is not held, or a bifurcation"
    TOO_MANY_STEPS = "the allowed number of steps was used up; allow more"
    INTERRUPTED = "it was interrupted"
    NOT_FINITE = "the equations gave values that are not finite"

    @property
    def done(self) -> bool:
        """Whether the path was completed."""
        return self is Outcome.DONE


class PathStopped(Exception):  # noqa: N818 - an outcome, not a programming error
    """A path ended before its target.

    Attributes
    ----------
    outcome : Outcome
    control : float
        Where.
    detail : str
        What else is known.
    """

    def __init__(self, outcome: Outcome, control: float, detail: str = "") -> None:
        super().__init__(f"{outcome.value} (at {control:.6g}){': ' + detail if detail else ''}")
        self.outcome = outcome
        self.control = control
        self.detail = detail
