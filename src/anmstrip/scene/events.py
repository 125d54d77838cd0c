"""What happens to the points of the strip on its rollers, and when: roots of the step's series.

A regularised law has no contact and no stick, only more or less of them, so every kind of event
says what it is a root of, at a point and one roller:

* contact made, contact lost: the gap passes that at which the pressure is a tenth of T/r (at
  least η), which is what the readings call touching where the strip is wrapped;
* stick, slip, in contact: the slip passes the speed in the middle of the law's corner, see
  :func:`anmstrip.mechanics.friction.corner_speed`;
* cone left, cone regained, in contact: it passes the speed beyond which |R_T| exceeds f R_N;
* grazing: the gap has a least value that misses contact by less than 2 √(η δ/K), the length
  over which the law of contact goes round its corner.

Without a point they tell of the roller: its first contact and its last; slip where no point
sticks any more, stick where one does again.  A step without friction is the series that was
solved; one in time is a parabola with a velocity that changes linearly, from the one that
the step before had (in the first one, when friction takes hold, it is that of the end).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.friction import cone_speed, corner_speed
from anmstrip.scene.build import Assembly
from anmstrip.scene.measures import State
from anmstrip.scene.readings import TOUCHING
from anmstrip.scene.stages import Plan
from anmstrip.scene.stretch import PairSeries, Stretch, places
from anmstrip.series.events import Watch, minima
from anmstrip.series.power_series import value_at

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Contact, Friction

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FASTEST = 1e150
"""Speed (m/s) that stands for never."""

KINDS = (("contact lost", "contact made"), ("slip", "stick"), ("cone left", "cone regained"))
"""Names, where gap, slip and slip again rise through their levels and where they fall."""

RUBBING = (*KINDS[1], *KINDS[2])
"""Those that are told of points in contact only."""


@dataclass(frozen=True)
class Event:
    """Something that happened at a point of the strip and a roller.

    Attributes
    ----------
    time : float
        s.
    stage, kind, roller : str
    point : int or None
        Number of the contact point; None for the roller as a whole.
    x, y : float or None
        Reference position of the point (m).
    gap, slip : float or None
        Of the point at this moment (m, m/s).
    """

    time: float
    stage: str
    kind: str
    roller: str
    point: int | None = None
    x: float | None = None
    y: float | None = None
    gap: float | None = None
    slip: float | None = None


class EventWatch:
    """Follows a run from step to step and finds its events.

    Attributes
    ----------
    touching, sticking : ndarray of bool, shape (pairs,)
        For every pair of a point and a roller how it is now.
    """

    def __init__(self, assembly: Assembly) -> None:
        self.assembly = assembly
        self.watches = Watch(), Watch(), Watch()
        self.plan: Any = None
        self.touching = self.sticking = np.zeros(0, dtype=bool)

    @cached_property
    def contact(self) -> Contact | None:
        """All pairs of points and rollers."""
        return self.assembly.contact

    @cached_property
    def levels(self) -> Array:
        """Gap (m) below which a pair touches, shape (pairs,)."""
        assert self.contact is not None
        law, tension = self.contact.signorini, self.assembly.scales.tension
        found = [
            float(law.gap(max(TOUCHING * tension / roller.radius, law.faint)))
            for roller in self.assembly.rollers
        ]
        return self._of(found)

    @cached_property
    def margin(self) -> float:
        """Distance (m) from contact that counts as grazing."""
        assert self.contact is not None
        return self.contact.signorini.width

    @cached_property
    def which(self) -> Index:
        """Number of the roller of each pair."""
        return self._of(list(range(len(self.assembly.rollers)))).astype(np.int64)

    @cached_property
    def speeds(self) -> tuple[float, float]:
        """Slip (m/s) of the corner and of the cone."""
        law = self.assembly.friction
        assert law is not None
        return corner_speed(law), min(cone_speed(law), FASTEST)

    def _of(self, values: list[Any]) -> Array:
        """One value for each roller as one for each pair."""
        assert self.contact is not None
        value = np.asarray(self.contact.roller.of(values), dtype=float)
        return np.broadcast_to(value, (self.contact.operator.points,)).copy()

    def during(self, before: State, state: State) -> tuple[Event, ...]:
        """Events of the step between two states, in their order.

        Parameters
        ----------
        before : State
            In the labels of this step, if fresh strip has been fed in since.
        state : State
        """
        if self.contact is None:
            return ()
        plan, stretch = state.plan, Stretch.between(before, state)
        moved = places(self.contact, stretch.full)
        gap = self._excess(moved[0], plan, float(stretch.control[0]))
        if self.plan is None or (self.plan is not plan and self.assembly.scene.strip.feed):
            self._begin(gap)
        self.plan = plan
        friction = next((e for e in plan.model.effects if e.name == "friction"), None)
        rubbing: Any = None if stretch.velocity is None else friction
        chosen = self._chosen(gap, moved, stretch, rubbing is not None)
        if not len(chosen):
            return ()
        return tuple(self._told(self._series(chosen, rubbing, stretch), chosen, stretch))

    def _excess(self, x: Array, plan: Plan, control: float) -> Array:
        """Gap above the level of contact (m), shape (pairs,)."""
        assert self.contact is not None
        return np.asarray(self.contact.seen(x, plan.controls.at(control)).gap) - self.levels

    def _begin(self, gap: Array) -> None:
        """Take what is there for granted."""
        for watch in self.watches:
            watch.signs = np.zeros_like(gap)
        self.watches[0].signs = np.where(gap > 0.0, 1.0, -1.0)
        self.touching, self.sticking = gap <= 0.0, np.zeros(len(gap), dtype=bool)

    def _chosen(self, gap: Array, moved: Array, stretch: Stretch, rubbing: bool) -> Index:
        """Pairs that may have an event: no gap changes by more than its point and roller move."""
        powers = stretch.length ** np.arange(1.0, max(len(moved), len(stretch.control)))
        travel = powers[: len(moved) - 1] @ np.linalg.norm(moved[1:], axis=1)
        control = np.abs(stretch.control[1:]) @ powers[: len(stretch.control) - 1]
        rates = [
            float(np.linalg.norm(self.plan.controls.rate(f"rollers.{roller.name}.centre")))
            for roller in self.assembly.rollers
        ]
        near = np.abs(gap) <= 1.01 * (travel + control * self._of(rates)) + self.margin
        jumped = (gap <= 0.0) != self.touching
        return np.flatnonzero(near | jumped | (rubbing & self.touching))

    def _series(self, chosen: Index, friction: Friction | None, stretch: Stretch) -> PairSeries:
        assert self.contact is not None
        contact = self.contact.restricted(chosen)
        if friction is not None:
            friction = replace(friction, contact=friction.contact.restricted(chosen))
        return PairSeries(contact, friction, self.plan, stretch)

    def _told(self, series: PairSeries, chosen: Index, stretch: Stretch) -> Iterator[Event]:
        """Events of the chosen pairs, sorted, with what they mean for the rollers."""
        functions = [series.gap.copy()]
        functions[0][0] -= self.levels[chosen]
        if series.slip_squared is not None:
            functions += [series.slip_squared.copy() for _ in self.speeds]
            for function, speed in zip(functions[1:], self.speeds, strict=True):
                function[0] -= speed**2
            self._settle(chosen, functions[1])
        found = [*self._changes(functions, chosen, stretch.length)]
        least = minima(functions[0], stretch.length, self.margin)
        for column, a in zip(least.which, least.where, strict=True):
            if value_at(functions[0][:, column], a) > 0.0:
                found.append((float(a), int(column), "grazing"))
        for a, column, kind in sorted(found):
            slow = len(functions) > 1 and bool(value_at(functions[1][:, column], a) <= 0.0)
            pair = int(chosen[column])
            if kind in RUBBING and not self.touching[pair]:
                continue
            event = self._event(series, stretch, (a, column, kind), pair)
            yield from self._counted(event, pair, slow)

    def _changes(
        self, functions: list[Array], chosen: Index, length: float
    ) -> Iterator[tuple[float, int, str]]:
        """Changes of sign as (a, column, kind)."""
        for watch, values, kinds in zip(self.watches, functions, KINDS, strict=False):
            roots = watch.changes(values, length, chosen)
            columns = np.searchsorted(chosen, roots.which)
            for column, a, sense in zip(columns, roots.where, roots.sense, strict=True):
                yield float(a), int(column), kinds[0 if sense > 0 else 1]

    def _settle(self, chosen: Index, slow: Array) -> None:
        """What sticks of those pairs whose slip has not been looked at before."""
        slips, cones = self.watches[1:]
        assert slips.signs is not None
        assert cones.signs is not None
        apart = chosen[~self.touching[chosen]]
        slips.signs[apart] = cones.signs[apart] = 0.0
        fresh = self.touching[chosen] & (slips.signs[chosen] == 0.0)
        self.sticking[chosen[fresh]] = slow[0, fresh] <= 0.0

    def _counted(self, event: Event, pair: int, slow: bool) -> Iterator[Event]:
        """An event, and what it means for its roller."""
        mine = self.which == self.which[pair]
        touched, stuck = self.touching[mine].any(), self.sticking[mine].any()
        if event.kind in KINDS[0]:
            self.touching[pair] = event.kind == "contact made"
            self.sticking[pair] = self.touching[pair] and slow
        elif event.kind in KINDS[1]:
            self.sticking[pair] = event.kind == "stick"
        yield event
        whole = replace(event, point=None, x=None, y=None, gap=None, slip=None)
        touches, sticks = self.touching[mine].any(), self.sticking[mine].any()
        if touches != touched:
            yield replace(whole, kind="contact made" if touches else "contact lost")
        elif touches and sticks != stuck:
            yield replace(whole, kind="stick" if sticks else "slip")

    def _event(
        self, series: PairSeries, stretch: Stretch, what: tuple[float, int, str], pair: int
    ) -> Event:
        a, column, kind = what
        contact, squared = series.contact, series.slip_squared
        x, y = contact.operator.reference[:2, column]
        return Event(
            time=self.plan.start + self.plan.duration * float(value_at(stretch.control, a)),
            stage=self.plan.name,
            kind=kind,
            roller=self.assembly.rollers[self.which[pair]].name,
            point=int(contact.operator.chosen[column]),
            x=float(x),
            y=float(y),
            gap=float(value_at(series.gap[:, column], a)),
            slip=None
            if squared is None
            else max(float(value_at(squared[:, column], a)), 0.0) ** 0.5,
        )
