"""Contact of the strip with rollers: normal pressure, and friction."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.sparse import csr_matrix

from anmstrip.arrays import Array, Index
from anmstrip.fem.geometry import SHELL, Kinematics
from anmstrip.fem.operators import LinearOperator, Part
from anmstrip.fem.sampling import ContactOperator, RollerOperator, RollerUnknowns, remember
from anmstrip.mechanics.effects import (
    LAW_WIDTH,
    Controls,
    LawEffect,
    Moment,
    RecordedLaw,
    RecordedLaws,
    Values,
    scale_speeds,
)
from anmstrip.mechanics.laws import ContactLaw, FrictionLaw
from anmstrip.mechanics.roller import Projection, Roller, at_points

LONGEST_WAY = 0.25
"""Longest way of a point between two looks, in radii; it is taken as straight in between."""

MAX_CHECKS = 1024
"""Looks at one step."""

ALWAYS_CHECKED = 1000
"""Pairs up to which all are looked at always: that takes less time than to tell how far they have
moved."""

GAP_RATE = 1.5
"""Bound of the change of a gap over the way of its point: (1 + |R'|)/√(1 + R'²) ≤ √2."""


Look = tuple[Array, Array]
"""Unknowns of the strip, and centres of rollers (m), (rollers, 3)."""

FIRST_CHECKS = np.linspace(0.0, 1.0, 3)
"""Shares of a step at which it is looked at first."""


def deepest_place(contact: Contact, places: Callable[[Array], Array]) -> float | None:
    """Return where on its way a point lies deeper than at either end, by more than the onset.

    Within reach, for farther away nothing acts.

    Parameters
    ----------
    contact : Contact
    places : callable
        Shares of the way, shape (m,), to positions in the rollers' frames, (m, rows, points).

    Returns
    -------
    float or None
        Share of the way at which the deepest of them is.
    """

    def gaps(y: Array) -> Array:
        with np.errstate(invalid="ignore"):  # on the axis there is no direction
            return np.asarray(contact.roller.project(y.swapaxes(0, 1)).gap)

    shares = FIRST_CHECKS
    y = places(shares)
    least = gaps(y).min(axis=0) - contact.reaches
    while True:
        step = y[1:] - y[:-1]
        moved = np.sqrt((step**2).sum(axis=1))
        chords = np.where(least < GAP_RATE * moved, moved / contact.roller.radius, 0.0)
        more = float(chords.max(initial=0.0)) / LONGEST_WAY
        if more <= 1.0 or len(shares) >= MAX_CHECKS:
            break
        shares = np.linspace(0.0, 1.0, min(int(np.ceil(more * (len(shares) - 1))), MAX_CHECKS) + 1)
        y = places(shares)
    across = step[:, :2]  # every piece is nearest to the axis at a share of it
    square = np.maximum((across**2).sum(axis=1), np.finfo(float).tiny)
    nearest = np.clip(-(y[:-1, :2] * across).sum(axis=1) / square, 0.0, 1.0)
    looks = np.concatenate([y[[0, -1]], y[:-1] + nearest[:, None] * step])
    gap = gaps(looks)
    dip = np.where(gap[2:] < contact.reaches, np.minimum(gap[0], gap[1]) - gap[2:], -np.inf)
    if not dip.max() > contact.signorini.width:
        return None
    j, point = np.unravel_index(dip.argmax(), dip.shape)
    return float(shares[j] + nearest[j, point] * (shares[j + 1] - shares[j]))


class PointEffect(LawEffect):
    """An effect at points of the strip, of which some may be chosen."""

    @cached_property
    def parts(self) -> dict[bytes, Self]:
        """The latest choices of points."""
        return {}

    def restricted(self, points: Index) -> Self:
        """The same on some of the points."""
        return remember(self.parts, points, self._part)

    def _part(self, points: Index) -> Self:
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class PressedRollers(LawEffect):
    """Rollers that given forces press on the strip: how far they shift is unknown.

    Each shifts along a line by q, of which points of the strip see −q; what they then answer with
    is in equilibrium with the force.  Controls: ``rollers.NAME.press`` (N).

    Attributes
    ----------
    names : sequence of str
    ways : ndarray, shape (rollers, 3)
        Unit vectors along which they shift.
    first : int
        Number of the first of their unknowns.
    """

    names: Sequence[str]
    ways: Array
    first: int

    name = "press"

    @property
    def stop(self) -> int:
        """Number of the unknown behind theirs."""
        return self.first + len(self.names)

    def number(self, name: str) -> int:
        """Return the number of a roller among them, −1 of one that is not pressed."""
        return self.names.index(name) if name in self.names else -1

    def way(self, name: str) -> Array:
        """Return the unit vector along which a roller shifts; 0 of one that is not pressed."""
        return self.ways[self.number(name)] if name in self.names else np.zeros(3)

    def shift(self, name: str, full: Array) -> Array:
        """Return how far a roller has shifted in a state (m), shape (3,)."""
        return self.way(name) * full[self.first + self.number(name)]

    @cached_property
    def operator(self) -> LinearOperator:  # type: ignore[override]
        """The rollers are their own points."""
        count = len(self.names)
        parts = [Part(csr_matrix(np.eye(count)), np.ones(count), self.first)]
        return LinearOperator(count, (parts, parts))

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Residual (N), minus the forces, shape (1, rollers)."""
        given = [controls[f"rollers.{name}.press"] for name in self.names]
        none = x[0] * 0.0  # which is of as many points as the rollers, also of a series
        return np.stack([none - at_points(given, np.arange(len(given)))])


@dataclass(frozen=True)
class Contact(PointEffect):
    """Normal tractions R n of rollers at points of the strip.

    Controls: ``rollers.NAME.centre`` (m), from which the unknown shift counts of one that is
    pressed.

    Attributes
    ----------
    roller : Roller
    signorini : ContactLaw
        In pressures.
    sampling : ContactOperator
        At the points, once for every roller.
    reach : float or sequence of float
        Gap (m) beyond which a point is left out, for all or for each roller.
    kinematics : Kinematics
        Which displacements the points have.
    pressed : PressedRollers or None
    latest : dict
        The neighbours that were looked up last.
    reached : dict
        Numbers of the points within reach in the latest states.
    """

    roller: Roller
    signorini: ContactLaw
    sampling: ContactOperator
    reach: float | Sequence[float] = np.inf
    kinematics: Kinematics = SHELL
    pressed: PressedRollers | None = None
    latest: dict[str, Neighbours] = field(default_factory=dict, init=False, compare=False)
    reached: dict[bytes, Index] = field(default_factory=dict, init=False, compare=False)

    name = "contact"

    @cached_property
    def operator(self) -> ContactOperator | RollerOperator:  # type: ignore[override]
        """Operator to the points, and to the shifts of the rollers that they see."""
        return RollerOperator(self.sampling, *self.shifts) if self.pressed else self.sampling

    @property
    def shifts(self) -> list[RollerUnknowns]:
        """Unknowns of rollers that are pressed, as points see them: one entry, if there are any."""
        if self.pressed is None:
            return []
        numbers = [self.pressed.number(roller.name) for roller in self.roller.members]
        which = np.array(numbers)[self.roller.seen_by(self.sampling.points)]
        return [RollerUnknowns(which, len(self.pressed.names), self.pressed.first)]

    @cached_property
    def ways(self) -> Array:
        """Unit vectors along which the points' rollers shift, (components[, points])."""
        assert self.pressed is not None
        ways = [self.pressed.way(roller.name) for roller in self.roller.members]
        return np.asarray(self.kinematics.chosen @ self.roller.of(ways))

    def answered(self, force: Any) -> Any:
        """Residual per area of the strip, and below it that of the shifts of pressed rollers."""
        if self.pressed is None:
            return force
        along = sum(way * own * -1.0 for way, own in zip(self.ways, force, strict=True))
        return np.stack([*force, along])

    @cached_property
    def reaches(self) -> Any:
        """Reach of each point's roller."""
        many = np.broadcast_to(np.asarray(self.reach, dtype=float), len(self.roller.members))
        return self.roller.of(list(many))

    def sharper(self, share: float) -> Contact:
        """Return the same with a sharper law."""
        return replace(self, signorini=self.signorini.sharper(share))

    @cached_property
    def least(self) -> Array:
        """Pressure at the reach, taken off everywhere so that contact begins without a jump."""
        if np.all(np.isinf(self.reaches)):
            return np.array(0.0)
        return np.asarray(self.signorini(np.asarray(self.reaches)))

    @cached_property
    def by_roller(self) -> dict[str, Contact]:
        """Roller → its own contact, at all points of the strip."""
        if self.roller.which is None:
            return {self.roller.name: self}
        reaches = np.broadcast_to(np.asarray(self.reach, dtype=float), len(self.roller.members))
        found = {}
        for roller, reach, numbers in zip(self.roller.members, reaches, self.numbers, strict=True):
            sampling = self.sampling.restricted(numbers)
            found[roller.name] = replace(self, roller=roller, sampling=sampling, reach=float(reach))
        return found

    @cached_property
    def numbers(self) -> list[Index]:
        """Numbers of the pairs of each roller."""
        which = self.roller.seen_by(self.sampling.points)
        ends = np.bincount(which, minlength=len(self.roller.members)).cumsum()[:-1]
        return np.split(np.argsort(which, kind="stable"), ends)

    def _part(self, points: Index) -> Self:
        sampling, roller = self.sampling.restricted(points), self.roller.restricted(points)
        return replace(self, sampling=sampling, roller=roller)

    @cached_property
    def view(self) -> Array:
        """The strip's components in the frames, shape (rows, components[, points])."""
        frame = self.roller.frame[: self.roller.rows]
        return np.einsum("ix...,cx->ic...", frame, self.kinematics.chosen)

    @cached_property
    def origin(self) -> Array:
        """Reference positions in the frames, shape (rows, points)."""
        return np.asarray(transform(self.roller.frame[: self.roller.rows], self.sampling.reference))

    def position(self, x: Any, controls: Values, row: int | None = None) -> Any:
        """Displaced points in the rollers' frames, (rows, points), on arrays or series.

        Parameters
        ----------
        x : array or Series, shape (rows of an operator, points)
        controls : mapping
        row : int, optional
            Where the shifts of rollers that are pressed stand in x, else below displacements.
        """
        centre, count = control_of(self.roller, controls, "centre"), self.kinematics.count
        offset = self.origin - transform(self.roller.frame[: self.roller.rows], centre)
        moved = x[:count]
        if self.pressed is not None:
            shift = x[count if row is None else row]
            moved = moved - np.stack([way * shift for way in self.ways])
        return transform(self.view, moved) + offset

    def seen(self, x: Any, controls: Values, row: int | None = None) -> Projection:
        """Return the projections of displaced points on the roller, see :meth:`position`."""
        return self.roller.project(self.position(x, controls, row))

    def crossing(self, states: Callable[[Array], Iterable[Moment]]) -> float | None:
        """Return where a step crosses a roller, as a share of it; see :func:`deepest_place`.

        Of more pairs, if anything moves so far that these neighbours say nothing.
        """

        def looked(shares: Array) -> list[tuple[Look, Mapping[str, Any]]]:
            return [(self.look(full, controls), controls) for full, _, controls in states(shares)]

        first = looked(FIRST_CHECKS)
        near = self.neighbours(*first[0])
        farthest = max(near.moved(look) for look, _ in first[1:])

        def places(shares: Array) -> Array:
            nonlocal farthest
            looks = first
            if len(shares) != len(first):
                looks = looked(shares)
                farthest = max(farthest, *(near.moved(look) for look, _ in looks))
            return np.array([near.seen(look, controls)[:-1] for look, controls in looks])

        while True:
            found = deepest_place(near.part, places) if near.part.points else None
            if farthest <= near.skin:
                return found
            near = self._looked_up(*first[0], 2.0 * farthest)

    def look(self, full: Array, controls: Values) -> Look:
        """Unknowns of strip and rollers that are looked at, and centres of the rollers."""
        if self.pressed is None:
            return full[: self.sampling.whole.unknowns], self.centres(controls)
        shifts = [self.pressed.shift(roller.name, full) for roller in self.roller.members]
        return full[: self.pressed.stop], self.centres(controls) + np.array(shifts)

    def centres(self, controls: Values) -> Array:
        """Centres of the rollers (m) but for unknown shifts, (rollers, 3)."""
        names = (f"rollers.{roller.name}.centre" for roller in self.roller.members)
        return np.array([controls[name] for name in names])

    def neighbours(self, look: Look, controls: Values) -> Neighbours:
        """Pairs that are near, looked up anew when something has moved far.

        As lists of neighbours of particles are (Verlet, Phys. Rev. 159, 98, 1967): all pairs are
        looked at only then, so that the work of a state grows with the points and not with their
        number times that of the rollers.
        """
        latest = self.latest.get("neighbours")
        if latest is None or not latest.moved(look) <= latest.skin:
            if self.sampling.points <= ALWAYS_CHECKED:
                pairs = np.arange(self.sampling.points)
                latest = Neighbours(self._part(pairs), pairs, np.inf, *look)
            else:
                skin = min(float(roller.radius) for roller in self.roller.members)
                latest = self._looked_up(look, controls, skin)
            self.latest["neighbours"] = latest
        return latest

    def _looked_up(self, look: Look, controls: Values, skin: float) -> Neighbours:
        """Pairs that may come within reach while nothing moves farther than the skin (m)."""
        found, farthest = [], GAP_RATE * skin
        whole = self.sampling.whole
        places = (whole.reference + self.kinematics.embed(whole.apply(look[0])))[[0, 2]]
        rollers = zip(self.numbers, self.by_roller.values(), look[1], strict=True)
        for numbers, part, centre in rollers:
            roller, points, reach = part.roller, np.arange(part.points), float(np.max(part.reach))
            if roller.is_across and np.isfinite(reach):  # of others gaps alone tell it
                reached = roller.radius + roller.half + reach + farthest
                points = np.flatnonzero(((places.T - centre[[0, 2]]) ** 2).sum(axis=1) < reached**2)
            near = part._part(points).gap(look, controls) < part.reaches + farthest
            found.append(numbers[points[near]])
        pairs = np.sort(np.concatenate(found))
        return Neighbours(self._part(pairs), pairs, skin, look[0].copy(), look[1])

    def gap(self, look: Look, controls: Values) -> Array:
        """Gaps of the points (m), shape (points,)."""
        return np.asarray(self.seen(self.operator.apply(look[0]), controls).gap)

    def near(self, full: Array, controls: Values) -> Contact:
        """The same effect on the points within reach."""
        return self.restricted(self.within_reach(full, controls))

    def within_reach(self, full: Array, controls: Values) -> Index:
        """Numbers of the points within reach, remembered for the latest state.

        A state is looked at by its residual, the series from it and its error in time.
        """

        def found(_: Index) -> Index:
            look = self.look(full, controls)
            near = self.neighbours(look, controls)
            return np.asarray(near.pairs[near.seen(look, controls)[-1] < near.part.reaches])

        state = np.concatenate([full, self.centres(controls).ravel()])
        return remember(self.reached, state, found)

    def elements_near(self, full: Array, controls: Values) -> list[Index]:
        """Elements with a point within reach of each roller, in ascending order."""
        near, whole = self.near(full, controls), self.sampling.whole
        which, elements = near.roller.seen_by(near.points), whole.owners[near.sampling.chosen]
        pairs = np.unique((which[:, None] * len(whole.cells) + elements)[elements >= 0])
        roller, element = np.divmod(pairs, len(whole.cells))
        return np.split(element, np.searchsorted(roller, np.arange(1, len(self.roller.members))))

    def nearest_gaps(self, full: Array, controls: Values) -> Array:
        """Gap (m) of every point of the strip from the roller that it is nearest to, (points,).

        What is not among the neighbours is farther than the least reach.
        """
        look = self.look(full, controls)
        near = self.neighbours(look, controls).part
        gaps = np.full(self.sampling.whole.points, np.inf)
        np.minimum.at(gaps, near.sampling.chosen, near.gap(look, controls))
        far = np.flatnonzero(gaps > np.min(self.reach))
        for part in self.by_roller.values() if far.size else ():
            gaps[far] = np.minimum(gaps[far], part.restricted(far).gap(look, controls))
        return gaps

    def pressure(self, place: Projection) -> Any:
        """R (Pa), shape (points,)."""
        return self.signorini(place.gap) - self.least

    def normal(self, place: Projection) -> Array:
        """Unit normal in space, shape (3, points)."""
        frame = self.roller.frame[: self.roller.rows]
        return np.einsum("ix...,i...->x...", frame, self.roller.normal(place))

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Residual per area: minus the traction of the roller, (components, points)."""
        place = self.seen(x, controls)
        traction = self.roller.normal(place, self.pressure(place))
        return self.answered(transform(-self.view.swapaxes(0, 1), traction))


@dataclass(frozen=True)
class Sight(LawEffect):
    """Positions of points in the frames of their rollers, and gaps in the last row: no force."""

    contact: Contact

    name = "sight"

    @property
    def operator(self) -> ContactOperator | RollerOperator:  # type: ignore[override]
        """Operator of the contact."""
        return self.contact.operator

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Return positions and gaps (m), shape (rows + 1, points)."""
        y = self.contact.position(x, controls)
        return np.stack([*y, self.contact.roller.project(y).gap])


@dataclass(frozen=True)
class Neighbours:
    """Pairs that may come within reach until points and rollers have moved by the skin."""

    part: Contact  # of these pairs
    pairs: Index  # their numbers among all
    skin: float  # m
    full: Array  # unknowns of the strip when they were looked up
    centres: Array  # of the rollers (m), (rollers, 3)
    programs: list[RecordedLaw] = field(default_factory=list, init=False)
    """Program of what is seen of these pairs, once they were seen."""

    def seen(self, look: Look, controls: Values) -> Array:
        """Return positions in the rollers' frames and gaps in the last row, (rows + 1, points)."""
        full, _ = look
        if not self.programs:
            centres = [f"rollers.{roller.name}.centre" for roller in self.part.roller.members]
            given = Controls(controls, dict.fromkeys(centres, np.zeros(())))
            laws = RecordedLaws(len(full))
            self.programs.append(laws.of(Sight(self.part), (full, None, 0.0), given))
        return self.programs[0].at_points(full, controls)

    def moved(self, here: Look) -> float:
        """Return the largest distance (m) by which a point and a roller may have come nearer.

        It does not matter where all pairs are these: then it is 0.
        """
        if self.skin == np.inf:
            return 0.0
        points = self.part.sampling.whole.apply(here[0] - self.full)
        moved = math.sqrt((points**2).sum(axis=0).max(initial=0.0))
        rollers = here[1] - self.centres
        return moved + math.sqrt((rollers**2).sum(axis=1).max(initial=0.0))


@dataclass(frozen=True)
class Friction(PointEffect):
    """Tangential tractions R_T of rollers at points of the strip.

    The slip has one component along the direction of turning and, in space, one along
    the meridian.  Controls: ``rollers.NAME.centre`` (m), ``rollers.NAME.surface_speed``
    (m/s, in the roller's sense, where the profile has the nominal radius) and
    ``rollers.NAME.velocity`` (m/s, of the centre).

    Attributes
    ----------
    contact : Contact
        Gives gap and pressure; its reach is that of friction.
    law_of_slip : FrictionLaw
    coefficients : sequence of float or None
        f on each roller, if it is not that of the law.
    """

    contact: Contact
    law_of_slip: FrictionLaw
    coefficients: Sequence[float] | None = None

    name = "friction"
    rate_dependent = True
    has_corners = True

    @property
    def roller(self) -> Roller:
        """Roller of the contact."""
        return self.contact.roller

    @property
    def operator(self) -> ContactOperator | RollerOperator:  # type: ignore[override]
        """Operator of the contact."""
        return self.contact.operator

    @cached_property
    def frame(self) -> Array:
        """Directions in which points move, of the frames, shape (2 or 3, 3[, points])."""
        return self.roller.frame[: self.contact.kinematics.count]

    @cached_property
    def view(self) -> Array:
        """The strip's components in these frames."""
        return np.einsum("ix...,cx->ic...", self.frame, self.contact.kinematics.chosen)

    @cached_property
    def by_roller(self) -> dict[str, Friction]:
        """Roller → its own friction, at all points of the strip."""
        own = self.coefficients or [self.law_of_slip.coefficient] * len(self.roller.members)
        found = {}
        for f, (name, contact) in zip(own, self.contact.by_roller.items(), strict=True):
            law = self.law_of_slip.with_coefficient(f)
            found[name] = replace(self, contact=contact, law_of_slip=law, coefficients=None)
        return found

    @cached_property
    def acting(self) -> FrictionLaw:
        """The law with the coefficient of each point's roller."""
        if self.coefficients is None:
            return self.law_of_slip
        return self.law_of_slip.with_coefficient(self.roller.of(list(self.coefficients)))

    def sharper(self, share: float) -> Friction:
        """Return the same with sharper laws of friction and contact."""
        law_of_slip, contact = self.law_of_slip.sharper(share), self.contact.sharper(share)
        return replace(self, law_of_slip=law_of_slip, contact=contact)

    def at_speed(self, speed: float) -> Friction:
        """Return the same with another V_c (m/s)."""
        law = self.law_of_slip.sharper(1.0 - speed / self.law_of_slip.speed)
        return replace(self, law_of_slip=law)

    def near(self, full: Array, controls: Values) -> Friction:
        """The same effect on the points within reach."""
        return self.restricted(self.contact.within_reach(full, controls))

    def _part(self, points: Index) -> Self:
        return replace(self, contact=self.contact.restricted(points))

    def slip(self, place: Projection, tangents: Any, v: Any, controls: Values) -> Any:
        """Tangential velocity relative to the surface (m/s), (components of slip, points)."""
        own = transform(self.frame, control_of(self.roller, controls, "velocity"))
        relative = transform(self.view, v[: self.contact.kinematics.count]) - own
        return np.einsum("ki...,i...->k...", tangents, relative) - self.surface(place, controls)

    def surface(self, place: Projection, controls: Values) -> Any:
        """Velocity of the surface along the tangents (m/s), (components of slip, points)."""
        speed = control_of(self.roller, controls, "surface_speed") * self.roller.sense
        return self.turned(place) * speed

    def turned(self, place: Projection) -> Any:
        """Components of slip of a surface that turns with unit speed, (components, points or 1)."""
        turning = np.eye(len(self.frame) - 1)[0][:, None]
        return turning if place.ratio is None else place.ratio * turning

    def sliding(self, x: Any, v: Any, controls: Values) -> tuple[Projection, Any, Any]:
        """Return where the points are on the roller, its tangents there, and their slip."""
        place = self.contact.seen(x, controls)
        tangents = self.roller.tangents(place, len(self.frame))
        return place, tangents, self.slip(place, tangents, v, controls)

    def reversed_friction(self, before: Moment, after: Moment) -> float:
        """Friction (N) by which the strip may be off where points slip the other way than before.

        Of a point that slips at half the cone or more before and after, and touches both times,
        that is twice its friction; one that sticks in between tells of it.
        """
        effect = self.near(after[0], after[2])
        (slip, pressure), (now, pressure_now) = (effect._sliding(m) for m in (before, after))
        slower = np.minimum(np.linalg.norm(slip, axis=0), np.linalg.norm(now, axis=0))
        bearing = np.clip(np.minimum(pressure, pressure_now), 0.0, None) * effect.operator.weights
        law = effect.acting
        sure = (np.einsum("kp,kp->p", slip, now) < 0.0) & (law.share(slower) > 0.5)
        return float((2.0 * law.coefficient * bearing * sure).sum())

    def _sliding(self, moment: Moment) -> tuple[Array, Array]:
        """Slip (m/s), (components of slip, points), and pressure (Pa) of all points."""
        full, velocity, controls = moment
        assert velocity is not None
        x, v = self.operator.apply(full), self.operator.apply(velocity)
        place, _, slip = self.sliding(x, v, controls)
        return np.asarray(slip), np.asarray(self.contact.pressure(place))

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Residual per area: minus the traction of the roller, (components, points)."""
        place, tangents, slip = self.sliding(x, v, controls)
        force = self.on_strip(tangents, self.traction(place, slip, controls))
        return self.contact.answered(force)

    def traction(self, place: Projection, slip: Any, controls: Values) -> Any:
        """Traction of points that slip, by a law whose corner is as wide as controls tell.

        It is that of the slip over the width, times what this takes off in full slip.
        """
        found = self.acting(self.contact.pressure(place), scale_speeds(slip, controls))
        if not (growth := self.law_of_slip.growth) or LAW_WIDTH not in controls:
            return found
        return found * np.exp(growth * controls[LAW_WIDTH])

    def on_strip(self, tangents: Any, traction: Any) -> Any:
        """Residual per area of a traction along the tangents, (components, points)."""
        local = np.einsum("ki...,k...->i...", tangents, traction)
        return transform(-self.view.swapaxes(0, 1), local)

    def in_space(self, x: Array, v: Array, controls: Values) -> tuple[Array, Array]:
        """Slip (m/s) and traction (Pa) in space, shape (3, points) each."""
        place, tangents, slip = self.sliding(x, v, controls)
        traction = self.acting(self.contact.pressure(place), slip)
        directions = np.einsum("ki...,ix...->kx...", tangents, self.frame)
        along, across = (np.einsum("kxp,kp->xp", directions, s) for s in (slip, traction))
        return along, across


def transform(matrix: Array, vectors: Any) -> Any:
    """One matrix (i, c), or one for each point (i, c, points), times vectors (c, points)."""
    subscripts = "ic,c...->i..." if matrix.ndim == 2 else "ic...,c...->i..."
    return np.einsum(subscripts, matrix, vectors)


def control_of(roller: Roller, controls: Values, name: str) -> Any:
    """A control of the roller that sees each point, a vector as (3, 1 or points)."""
    values = [controls[f"rollers.{r.name}.{name}"] for r in roller.members]
    value = roller.of(values)
    single = len(roller.members) == 1 and values[0].ndim == 1
    return value[:, None] if single else value
