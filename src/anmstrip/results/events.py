"""What happens to the points of the strip on its rollers, and when: roots of the step's series."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any
import numpy as np
from numpy.typing import NDArray
from anmstrip.results.state import State
from anmstrip.equilibrium import StageProblem
from anmstrip.taylor.series import taylor
from collections.abc import Iterator, Sequence
from functools import cached_property
from anmstrip.mechanics.laws import cone_speed, corner_speed
from anmstrip.results.rollers import TOUCHING
from anmstrip.taylor.polynomials import Watch, minima, value_at

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Contact, Friction
    from anmstrip.mechanics.laws import FrictionLaw
    from anmstrip.mechanics.roller import Roller

Array = NDArray[np.float64]

ORDER = 8
"""Least order of the series of gap and slip; those of a parabola end long before."""


@dataclass(frozen=True)
class Stretch:
    """A step as polynomials of a ∈ [0, length].

    Attributes
    ----------
    full : ndarray, shape (order + 1, unknowns)
    velocity : ndarray, shape (order + 1, unknowns), or None
    control : ndarray, shape (order + 1,)
    length : float
    """

    full: Array
    velocity: Array | None
    control: Array
    length: float

    @classmethod
    def between(cls, before: State, state: State) -> Stretch:
        """The step that has ended in a state; see :meth:`State.at`."""
        plan, branch = state.plan, state.branch
        if branch is not None:
            pairs = list(zip(branch.u, branch.control, strict=True))
            first = plan.supports.full(*pairs[0])
            orders = [plan.supports.change(u, float(c)) for u, c in pairs[1:]]
            stretch = cls(np.array([first, *orders]), None, branch.control, branch.length)
        else:
            begin = (before.time - plan.start) / plan.duration
            control, change = np.array([begin, state.control - begin]), state.full - before.full
            u = np.stack([before.full, change, np.zeros_like(change)])
            stretch = cls(u, None, control, 1.0)
            if state.velocity is not None:
                h, v = state.time - before.time, state.velocity
                u[1], u[2] = 2.0 * change - h * v, h * v - change
                start = v if before.velocity is None else before.velocity
                stretch = replace(stretch, velocity=np.stack([start, v - start]))
        return stretch

    @property
    def order(self) -> int:
        """Of the series of gap and slip."""
        return max(len(self.full) - 1, ORDER)

    def padded(self, coefficients: Array) -> Array:
        """The same with zeros up to the order."""
        more = np.zeros((self.order + 1 - len(coefficients), *coefficients.shape[1:]))
        return np.concatenate([coefficients, more])

    @property
    def powers(self) -> Array:
        """length^k for the orders k ≥ 1 of the motion."""
        return self.length ** np.arange(1.0, len(self.full))


class PairSeries:
    """Gap and slip of pairs of points and rollers along a stretch.

    Parameters
    ----------
    contact : Contact
        At these pairs alone.
    friction : Friction or None
        To look at the slip, likewise.
    plan : StageProblem
        Of the stage.
    stretch : Stretch

    Attributes
    ----------
    gap : ndarray, shape (order + 1, pairs)
        h (m).
    slip_squared : ndarray, shape (order + 1, pairs), or None
        m²/s².
    """

    def __init__(
        self, contact: Contact, friction: Friction | None, plan: StageProblem, stretch: Stretch
    ) -> None:
        self.contact, self.friction, self.plan = contact, friction, plan
        inputs = [places(contact, stretch.full), stretch.control]
        if friction is not None and stretch.velocity is not None:
            inputs.append(places(contact, stretch.velocity))
        found = taylor(self._traced, *(stretch.padded(c) for c in inputs))
        self.gap = found[:, 0]
        self.slip_squared = None if friction is None else found[:, 1]

    def _traced(self, x: Any, control: Any, v: Any = None) -> Any:
        """Gap and squared slip of displaced points, shape (1 or 2, pairs)."""
        controls = self.plan.controls.at(control)
        place = self.contact.seen(x, controls)
        if self.friction is None:
            return np.stack([place.gap])
        slip = self.friction.slip(place, self.friction.tangents(place), v, controls)
        return np.stack([place.gap, np.einsum("i...,i...->...", slip, slip)])


def places(contact: Contact, full: Array) -> Array:
    """Displacements of a contact's points, shape (orders, components, points)."""
    return np.stack([contact.operator.apply(u) for u in full])


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
    """The events of a run, found step after step.

    Parameters
    ----------
    contact : Contact or None
        Contact of all pairs of points and rollers.
    rollers : sequence of Roller
    friction_law : FrictionLaw or None
    tension : float
        Scale of the tension (N/m).
    fed : bool
        Whether points change their labels when fresh strip is fed in.

    Attributes
    ----------
    touching, sticking : ndarray of bool, shape (pairs,)
        For every pair of a point and a roller how it is now.
    """

    def __init__(
        self,
        contact: Contact | None,
        rollers: Sequence[Roller],
        friction_law: FrictionLaw | None,
        tension: float,
        fed: bool = False,
    ) -> None:
        self.contact, self.rollers, self.friction_law = contact, rollers, friction_law
        self.tension, self.fed = tension, fed
        self.watches = Watch(), Watch(), Watch()
        self.plan: Any = None
        self.touching = self.sticking = np.zeros(0, dtype=bool)

    @cached_property
    def levels(self) -> Array:
        """Gap (m) below which a pair touches, shape (pairs,)."""
        assert self.contact is not None
        law, tension = self.contact.signorini, self.tension
        found = [
            float(law.gap(max(TOUCHING * tension / roller.radius, law.faint)))
            for roller in self.rollers
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
        return self._of(list(range(len(self.rollers)))).astype(np.int64)

    @cached_property
    def speeds(self) -> tuple[float, float]:
        """Slip (m/s) of the corner and of the cone."""
        law = self.friction_law
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
        if self.plan is None or (self.plan is not plan and self.fed):
            self._begin(gap)
        self.plan = plan
        friction = next((e for e in plan.model.effects if e.name == "friction"), None)
        rubbing: Any = None if stretch.velocity is None else friction
        chosen = self._chosen(gap, moved, stretch, rubbing is not None)
        if not len(chosen):
            return ()
        return tuple(self._told(self._series(chosen, rubbing, stretch), chosen, stretch))

    def _excess(self, x: Array, plan: StageProblem, control: float) -> Array:
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
            for roller in self.rollers
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
            roller=self.rollers[self.which[pair]].name,
            point=int(contact.operator.chosen[column]),
            x=float(x),
            y=float(y),
            gap=float(value_at(series.gap[:, column], a)),
            slip=None
            if squared is None
            else max(float(value_at(squared[:, column], a)), 0.0) ** 0.5,
        )
