"""What happens to the points of the strip on its rollers, and when: roots of the step's series."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anmstrip.arrays import Array, Index
from anmstrip.equilibrium import StageProblem
from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.effects import LawEffect
from anmstrip.mechanics.laws import FrictionLaw, cone_speed, corner_speed
from anmstrip.mechanics.roller import Roller
from anmstrip.results.rollers import TOUCHING_SHARE
from anmstrip.results.state import State
from anmstrip.taylor.polynomials import Watch, minima, value_at
from anmstrip.taylor.series import taylor_series

MIN_EVENT_ORDER = 8
"""Least order of the series of gap and slip; those of a parabola end long before."""

BEGINNING_SHARE = 1e-9
"""Share of a stage by which the time of its beginning may be off."""

NEVER = 1e150
"""Speed (m/s) that stands for never."""

EVENT_KINDS = (("contact lost", "contact made"), ("slip", "stick"), ("cone left", "cone regained"))
"""Names, where gap, slip and slip again rise through their levels and where they fall."""


@dataclass(frozen=True)
class Stretch:
    """A step as polynomials of a ∈ [0, length]."""

    full: Array  # displacements, shape (order + 1, unknowns)
    velocity: Array | None  # shape (order + 1, unknowns)
    control: Array  # λ, shape (order + 1,)
    length: float

    @classmethod
    def between(cls, before: State, state: State) -> Stretch:
        """Return the step that has ended in a state; see :meth:`State.at`."""
        plan, branch = state.plan, state.branch
        if branch is not None:
            pairs = list(zip(branch.u, branch.control, strict=True))
            first = plan.supports.full(*pairs[0])
            orders = [plan.supports.change(u, float(c)) for u, c in pairs[1:]]
            return cls(np.array([first, *orders]), None, branch.control, branch.length)
        begin = (before.time - plan.start) / plan.duration
        control, change = np.array([begin, state.control - begin]), state.full - before.full
        u = np.stack([before.full, change])
        if state.velocity is None:
            return cls(u, None, control, 1.0)
        if state.step is not None:
            free = plan.supports.free
            u = np.pad(u, [(0, state.step.order - 1), (0, 0)])
            u[:, free] = state.step.series
        v, start = state.velocity, before.velocity
        if start is None or (begin < BEGINNING_SHARE and moves_otherwise(before, plan)):
            start = v
        return cls(u, np.stack([start, v - start]), control, 1.0)


def moves_otherwise(before: State, plan: StageProblem) -> bool:
    """Return whether a roller begins or ceases to move as a stage begins: velocities jump."""
    at_rest = before.plan is plan  # the first stage
    centres = [name for name in plan.controls.start if name.endswith(".centre")]
    rates = ((plan.rate(n), 0.0 if at_rest else before.plan.rate(n)) for n in centres)
    return any(np.any(rate != other) for rate, other in rates)


def gap_and_slip(
    contact: Contact, friction: Friction | None, plan: StageProblem, stretch: Stretch
) -> tuple[Array, Array | None]:
    """Return h (m) and |v_s|² (m²/s²) of the pairs of a contact along a stretch.

    Parameters
    ----------
    contact : Contact
        At these pairs of points and rollers alone.
    friction : Friction or None
        To look at the slip, likewise.
    plan : StageProblem
        Of the stage.
    stretch : Stretch

    Returns
    -------
    gap : ndarray, shape (order + 1, pairs)
    slip_squared : ndarray, shape (order + 1, pairs), or None
    """

    def trace(x: Any, control: Any, v: Any = None) -> Any:
        controls = plan.controls.at(control)
        if friction is None:
            return np.stack([contact.seen(x, controls).gap])
        place, _, slip = friction.sliding(x, v, controls)
        return np.stack([place.gap, np.einsum("i...,i...->...", slip, slip)])

    inputs = [_at_points(friction or contact, stretch.full), stretch.control]
    if friction is not None and stretch.velocity is not None:
        inputs.append(_at_points(friction, stretch.velocity))
    count = max(len(stretch.full), MIN_EVENT_ORDER + 1)
    padded = (np.pad(c, [(0, count - len(c)), *[(0, 0)] * (c.ndim - 1)]) for c in inputs)
    found = taylor_series(trace, *padded)
    return found[:, 0], None if friction is None else found[:, 1]


def _at_points(effect: LawEffect, full: Array) -> Array:
    """Return orders of all unknowns at an effect's points, shape (orders, components, points)."""
    return np.stack([effect.operator.apply(u) for u in full])


@dataclass(frozen=True)
class Event:
    """Something that happened at a point of the strip and a roller."""

    time: float  # s
    stage: str
    kind: str
    roller: str
    point: int | None = None  # number of the contact point; None for the roller as a whole
    x: float | None = None  # reference position (m)
    y: float | None = None
    gap: float | None = None  # of the point at this moment (m)
    slip: float | None = None  # m/s
    step: float | None = None  # of time (s), to which its date is known; None along a path


def without_flickers(found: Iterable[Event]) -> tuple[Event, ...]:
    """Return events of points, and those of whole rollers that leave them otherwise than before.

    What is lost and made again, or slips and sticks again, within a step that is not halved may be
    what a polynomial makes of a long step.
    """
    kept, last = list[Event](), dict[tuple[str, bool], list[Event]]()
    for event in found:
        if event.point is None:
            last.setdefault((event.roller, event.kind in EVENT_KINDS[0]), []).append(event)
        else:
            kept.append(event)
    kept += (events[-1] for events in last.values() if len(events) % 2)
    return tuple(sorted(kept, key=lambda event: event.time))


MAX_DATED = 2
"""Events of one roller as a whole in a step, at most, that are dated by halves of it.

A roller that few points touch at a time slips and sticks with every one that passes: an idle one of
0.1 m wrapped by 6° 184 times in 0.4 m, and their dates took 27 of 28 tangents of the run.
"""


@dataclass
class EventWatch:
    """The events of a run, found step after step.

    Parameters
    ----------
    contact : Contact
        Contact of all pairs of points and rollers.
    rollers : sequence of Roller
    friction_law : FrictionLaw or None
    tension : float
        Scale of the tension (N/m).
    tolerance : float
        To which the beginnings and ends of contact and slip of whole rollers are dated in time, as
        a share of the stage.

    Attributes
    ----------
    touching, sticking : ndarray of bool, shape (pairs,)
        For every pair of a point and a roller how it is now.
    which : ndarray of int, shape (pairs,)
        Number of the roller of each pair.
    levels : ndarray, shape (pairs,)
        Gap (m) below which a pair touches.
    speeds : tuple of float
        Slip (m/s) of the corner and of the cone, with friction.
    """

    contact: Contact
    rollers: Sequence[Roller]
    friction_law: FrictionLaw | None
    tension: float
    tolerance: float

    def __post_init__(self) -> None:
        self.watches = Watch(), Watch(), Watch()
        self.plan: Any = None
        self.touching = self.sticking = np.zeros(0, dtype=bool)
        self.which = self._of_pairs(list(range(len(self.rollers)))).astype(np.int64)
        law, tension = self.contact.signorini, self.tension
        least = [max(TOUCHING_SHARE * tension / r.radius, law.faint) for r in self.rollers]
        self.levels = self._of_pairs([float(law.gap(pressure)) for pressure in least])
        if (rubs := self.friction_law) is not None:
            self.speeds = corner_speed(rubs), min(cone_speed(rubs), NEVER)

    def _of_pairs(self, values: list[Any]) -> Array:
        """Return one value for each roller as one for each pair."""
        value = np.asarray(self.contact.roller.of(values), dtype=float)
        return np.broadcast_to(value, (self.contact.operator.points,)).copy()

    def during(self, before: State, state: State) -> tuple[Event, ...]:
        """Return the events of the step between two states, in their order.

        In time the velocity is linear within a step, and slip that begins late in a long one would
        be dated early.  A step in which a roller as a whole begins or ceases to touch or to slip is
        halved until the halves are as short as its tolerance; each takes a few tangents.

        Parameters
        ----------
        before, state : State
        """
        plan = state.plan
        if not plan.in_time or state.step is None:
            return self._between(before, state)

        def halved(begin: State, end: State) -> tuple[Event, ...]:
            kept = deepcopy(self.watches), self.touching.copy(), self.sticking.copy(), self.plan
            found, length = self._between(begin, end), end.time - begin.time
            whole = Counter(event.roller for event in found if event.point is None)
            flickers = max(whole.values(), default=0) > MAX_DATED
            if not whole or flickers or length <= self.tolerance * plan.duration:
                return without_flickers(found) if flickers else found
            self.watches, self.touching, self.sticking, self.plan = kept
            middle = state.at(begin.time + 0.5 * length, before)
            return (*halved(begin, middle), *halved(middle, replace(end, step=None)))

        return halved(before, state)

    def _between(self, before: State, state: State) -> tuple[Event, ...]:
        """Events between two states, by polynomials between them."""
        plan, stretch = state.plan, Stretch.between(before, state)
        moved = _at_points(self.contact, stretch.full)
        controls = plan.controls.at(float(stretch.control[0]))
        gap = np.asarray(self.contact.seen(moved[0], controls).gap) - self.levels
        if self.plan is None:
            for watch in self.watches:
                watch.signs = np.zeros_like(gap)
            self.watches[0].signs = np.where(gap > 0.0, 1.0, -1.0)
            self.touching, self.sticking = gap <= 0.0, np.zeros(len(gap), dtype=bool)
        self.plan = plan
        friction = None if stretch.velocity is None else plan.friction
        # No gap changes by more than its point and its roller move
        powers = stretch.length ** np.arange(1.0, max(len(moved), len(stretch.control)))
        travel = powers[: len(moved) - 1] @ np.linalg.norm(moved[1:], axis=1)
        control = np.abs(stretch.control[1:]) @ powers[: len(stretch.control) - 1]
        rates = [plan.controls.rate(f"rollers.{roller.name}.centre") for roller in self.rollers]
        travel += control * self._of_pairs([float(np.linalg.norm(rate)) for rate in rates])
        near = np.abs(gap) <= 1.01 * travel + self.contact.signorini.width
        jumped, rubbing = (gap <= 0.0) != self.touching, friction is not None
        chosen = np.flatnonzero(near | jumped | (rubbing & self.touching))
        if not len(chosen):
            return ()
        contact = self.contact.restricted(chosen)
        if friction is not None:
            friction = replace(friction, contact=friction.contact.restricted(chosen))
        gap, squared = gap_and_slip(contact, friction, plan, stretch)
        found = self._events(gap, squared, chosen, stretch)
        if not plan.in_time:
            return tuple(found)
        return tuple(replace(event, step=state.time - before.time) for event in found)

    def _events(
        self, gap: Array, squared: Array | None, chosen: Index, stretch: Stretch
    ) -> Iterator[Event]:
        """Events of the chosen pairs, sorted, with what they mean for the rollers."""
        functions = [gap.copy()]
        functions[0][0] -= self.levels[chosen]
        if squared is not None:
            functions += [squared.copy() for _ in self.speeds]
            for function, speed in zip(functions[1:], self.speeds, strict=True):
                function[0] -= speed**2
            slips, cones = self.watches[1:]
            assert slips.signs is not None
            assert cones.signs is not None
            touching = self.touching[chosen]
            slips.signs[chosen[~touching]] = cones.signs[chosen[~touching]] = 0.0
            fresh = touching & (slips.signs[chosen] == 0.0)  # not looked at before
            self.sticking[chosen[fresh]] = functions[1][0, fresh] <= 0.0
        found = []
        for watch, values, kinds in zip(self.watches, functions, EVENT_KINDS, strict=False):
            roots = watch.changes(values, stretch.length, chosen)
            columns = np.searchsorted(chosen, roots.which)
            for column, a, sense in zip(columns, roots.where, roots.sense, strict=True):
                found.append((float(a), int(column), kinds[0 if sense > 0 else 1]))
        least = minima(functions[0], stretch.length, self.contact.signorini.width)
        for column, a in zip(least.which, least.where, strict=True):
            if value_at(functions[0][:, column], a) > 0.0:
                found.append((float(a), int(column), "grazing"))
        x, y = self.contact.sampling.reference[:2, chosen]
        x, y = np.add([x, y], self.plan.model.strip.flat_origin[:, None])
        for a, column, kind in sorted(found):
            pair = int(chosen[column])
            if kind in (*EVENT_KINDS[1], *EVENT_KINDS[2]) and not self.touching[pair]:
                continue
            slow = len(functions) > 1 and bool(value_at(functions[1][:, column], a) <= 0.0)
            time = self.plan.start + self.plan.duration * float(value_at(stretch.control, a))
            point, name = self.contact.sampling.chosen[pair], self.rollers[self.which[pair]].name
            here = float(x[column]), float(y[column]), float(value_at(gap[:, column], a))
            slip = None
            if squared is not None:
                slip = max(float(value_at(squared[:, column], a)), 0.0) ** 0.5
            event = Event(time, self.plan.name, kind, name, int(point), *here, slip)
            yield from self._count(event, pair, slow)

    def _count(self, event: Event, pair: int, slow: bool) -> Iterator[Event]:
        """Yield an event, and what it means for its roller as a whole."""
        mine = self.which == self.which[pair]
        touched, stuck = self.touching[mine].any(), self.sticking[mine].any()
        if event.kind in EVENT_KINDS[0]:
            self.touching[pair] = event.kind == "contact made"
            self.sticking[pair] = self.touching[pair] and slow
        elif event.kind in EVENT_KINDS[1]:
            self.sticking[pair] = event.kind == "stick"
        yield event
        whole = Event(event.time, event.stage, "", event.roller)
        touches, sticks = self.touching[mine].any(), self.sticking[mine].any()
        if touches != touched:
            yield replace(whole, kind="contact made" if touches else "contact lost")
        elif touches and sticks != stuck:
            yield replace(whole, kind="stick" if sticks else "slip")
