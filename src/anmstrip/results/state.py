"""States of a run: those between its steps, and what is along the strip."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.path import Branch
from anmstrip.equilibrium import StageProblem
from anmstrip.errors import Named
from anmstrip.results.fields import Profile
from anmstrip.results.strip_state import StripState


@dataclass(frozen=True, repr=False)
class State(StripState):
    """A state of a run; its attributes are those of a :class:`StripState`."""

    def at(self, time: float, before: State | None) -> State:
        """State at an instant of the step that ends here.

        On the series of a rate-free step, in time as the end of a shorter step, which takes a
        few tangents; linear where there is neither.

        Parameters
        ----------
        time : float
            s.
        before : State or None
            Where the step began; the undeformed strip if ``None``.

        Raises
        ------
        ValueError
            The instant is not within the step.
        """
        if time == self.time:
            return self
        begin, room = self.plan.start if before is None else before.time, 1e-9 * self.time
        if not begin - room <= time <= self.time + room:
            raise ValueError(f"t = {time:g} s is not from {begin:g} to {self.time:g} s")
        control = (time - self.plan.start) / self.plan.duration
        a = None
        if self.branch is not None:
            begins = control == self.branch.control[0]
            a = 0.0 if begins else self.branch.reaches(control)
        if a is not None:
            return replace(self.inside(a), time=time, control=control)
        begun, start, u = self.conveyed, self.plan.start, np.zeros_like(self.full)
        if before is not None:
            begun, start, u = before.conveyed, before.time, before.full
        s = (time - start) / (self.time - start)
        conveyed = begun + s * (self.conveyed - begun)
        if self.step is not None:
            free, moving = self.plan.supports.free, self.plan.moving(control)
            within, moving[free] = self.step.at(time)
            full = self.plan.supports.full(within, control)
            return State(self.plan, time, control, full, moving, conveyed=conveyed)
        change = self.full - u
        velocity = None if self.velocity is None else change / (self.time - start)
        return State(self.plan, time, control, u + s * change, velocity, conveyed=conveyed)

    def inside(self, a: float) -> State:
        """State at a parameter of the branch of a rate-free step that ends here."""
        assert self.branch is not None
        return State.on(self.plan, self.branch, a, self.conveyed)

    @classmethod
    def on(cls, plan: StageProblem, branch: Branch, a: float, conveyed: float = 0.0) -> State:
        """State at a parameter of a branch of a rate-free stage."""
        u, control = branch(a)
        full, time = plan.supports.full(u, control), plan.start + control * plan.duration
        return cls(plan, time, control, full, plan.transport(full, control), conveyed=conveyed)

    def along(self, name: str) -> Array:
        """Values along the strip, from the entry to the exit.

        Parameters
        ----------
        name : str
            A column of ``profile.csv``, such as ``"tension"``; ``"arc_length"`` is the abscissa.

        Returns
        -------
        ndarray, shape (stations,)
            At the ends and middles of the elements, in SI; NaN where the quantity needs contact
            and there is none.

        Raises
        ------
        KeyError
            There is no such column.
        """
        return self.profile[name]

    @cached_property
    def profile(self) -> dict[str, Array]:
        """All columns along the strip, see :meth:`along`."""
        return Named(Profile(self.plan.model.strip).columns(self))

    def __repr__(self) -> str:
        return f"<State of {self.plan.name!r} at t = {self.time:.6g} s>"
