"""Readings of a roller: forces, wrap, slip, tensions, and the cost of regularisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from anmstrip.arrays import Array, Index

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Contact


TOUCHING_SHARE = 0.1
"""Share of the mean pressure around it above which a point counts as in contact."""

DRAWN_SHARE = 0.02
"""Share of the force on a roller that tension presses, beside a nip, from which on strip is drawn
round it: 0.01 at most in 31 nips of straight strip, 0.43 at least on 55 rollers that are wrapped,
and 0.04 on a drum on which a roller presses with 33 kN beside 1.5 kN of the wrap."""

MEAN_RANGE = 0.5
"""Distance from a point, in radii, up to which pressures count in this mean.  Friction lets the
tension, and with it the pressure, fall by a hundred times over a wrap, but by e^(0.5 f) at most
over half a radius; of a line of contact all counts."""

LOAD_RANGE = 2.0
"""Distance from an end of contact, in √(D/T), up to which its line load is looked for.  On meshes
of 1 to 1/8 of that length and onsets of contact over 1e-6 to 1e-4 m the loads of a roller in the
middle of a 50° wrap are then within 2 per cent of the theory; at 1 they are up to 40 per cent off,
at 4 up to 6."""

FREE_DISTANCE = 4.0
"""Distance from a roller, in √(D/T), from which on a strip is free: what it bends where it lifts
off falls off as e^(−x/√(D/T)), to 2 % there."""

RUNNING_SLIP = 0.01
"""Slip over the speed of a roller at which it runs: elastic strip on one creeps by 1e-3 at most."""

LINE_CONTACT = 0.2
"""Length of contact, in √(D/T), up to which it is along a line: where its length is 0 in theory, it
is 0.01 to 0.17 by the default law."""

STICKING_SHARE = 0.95
"""Share of the cone f R_N up to which a point counts as sticking."""

STEP_READINGS = ("normal_force", "drag", "wrap", "max_slip", "surface_speed", "torque")
"""Attributes of a :class:`RollerReading` that are read off after every step."""

READ_AS_THEY_ARE = (*STEP_READINGS[:2], *STEP_READINGS[3:], "bearing_torque", "resultant")
"""Those of a :class:`ContactState` that are readings themselves."""

WIDTH_STRIPES = 16
"""Stripes of the width, along each of which gaps are averaged."""


@dataclass(eq=False)
class ContactState:
    """State of the points of the strip near one roller, or of the nearest.

    Attributes
    ----------
    roller : Roller
        Its geometry.
    area : ndarray, shape (points,)
        Area that belongs to each point (m²).
    width : float
        Of the strip (m).
    cells : ndarray of int, shape (elements, points of one)
        Points of the elements.
    turning : ndarray, shape (3, points)
        Unit direction of a positive surface speed, ± a × n.
    normal_force : float
        Sum of the normal forces (N).
    friction_forces : ndarray, shape (points,)
        Friction force (N) of every point in the sense of a positive speed.
    drag : float
        Their sum (N).
    torque : float
        Moment of friction about the axis on the strip, in the sense of drag (N m).
    resultant : ndarray, shape (3,)
        Force of the roller on the strip (N).
    opposed : ndarray, shape (points,)
        Pressure (Pa) of rollers that nip the strip with this one.
    """

    contact: Contact
    gap: Array  # m, shape (points,)
    normal: Array  # shape (3, points)
    pressure: Array  # Pa, shape (points,)
    slip: Array  # m/s, shape (3, points); zero where there is no friction
    traction: Array  # Pa, shape (3, points); zero where there is no friction
    coefficient: float | None  # f, with friction
    arm: Array  # distance of the surface from the axis (m), shape (points,)
    surface_speed: float  # where the profile has the nominal radius (m/s)
    bearing_torque: float  # against it (N m)
    elements: Index  # with a point within reach; all of their points are among these
    lifting: float = 0.0  # pressure on the strip that takes it off the roller (Pa)

    def __post_init__(self) -> None:
        self.opposed = np.zeros_like(self.pressure)
        operator = self.contact.sampling
        self.roller, self.area = self.contact.roller.members[0], operator.weights
        self.width = operator.width
        self.cells = np.searchsorted(operator.chosen, operator.cells[self.elements])
        across = self.roller.sense * self.roller.cross_matrix @ self.normal
        self.turning = across / np.linalg.norm(across, axis=0)
        self.normal_force = float((self.pressure * self.area).sum())
        self.friction_forces = (self.traction * self.turning).sum(axis=0) * self.area
        self.drag = float(self.friction_forces.sum())
        self.torque = float(self.friction_forces @ self.arm)
        self.resultant = ((self.pressure * self.normal + self.traction) * self.area).sum(axis=1)

    @cached_property
    def touching(self) -> NDArray[np.bool_]:
        """Whether each point is in contact, shape (points,)."""
        return np.asarray(self.pressure > self.least)

    @cached_property
    def max_slip(self) -> float:
        """Largest slip speed in contact (m/s)."""
        speeds = np.linalg.norm(self.slip, axis=0)
        return float(speeds[self.touching].max(initial=0.0))

    @cached_property
    def least(self) -> Array:
        """Pressure (Pa) above which each point is in contact, shape (points,).

        What is faint, and a tenth of the mean pressure around the point, weighted by force.  Of a
        roller round which strip is drawn, points that another one presses on it are left out:
        strip that resists bending bears other pressures on its two sides there.
        """
        alone = np.maximum(self.pressure - self.opposed, 0.0)
        drawn = alone @ self.area > DRAWN_SHARE * self.normal_force
        nipped = drawn & (self.opposed > self.contact.signorini.faint)
        pressure, x = np.where(nipped, 0.0, self.pressure), self.contact.sampling.reference[0]
        order, force = np.argsort(x), pressure * self.area
        sums = np.stack([force * pressure, force])[:, order].cumsum(axis=1)
        sums = np.pad(sums, ((0, 0), (1, 0)))
        reach = MEAN_RANGE * self.roller.radius
        first, last = np.searchsorted(x[order], [x - reach, x + reach])
        squares, forces = sums[:, last] - sums[:, first]
        mean = np.divide(squares, forces, out=np.zeros_like(x), where=forces > 0.0)
        return np.maximum(TOUCHING_SHARE * mean, self.contact.signorini.faint)

    @cached_property
    def pressed(self) -> Index:
        """Numbers of these points in the whole strip."""
        return np.asarray(self.contact.sampling.chosen[self.touching])

    @cached_property
    def cone_share(self) -> Array:
        """|R_T| / (f R_N) of the points in contact, 0 elsewhere and without friction."""
        cone = (self.coefficient or 0.0) * self.pressure
        size = np.linalg.norm(self.traction, axis=0)
        return np.divide(size, cone, out=np.zeros_like(size), where=self.touching & (cone > 0.0))

    @cached_property
    def status(self) -> Array:
        """Status of each point: 0 free, 1 in contact, 2 in contact and slipping."""
        return np.where(self.touching, np.where(self.cone_share >= STICKING_SHARE, 2.0, 1.0), 0.0)

    @cached_property
    def sliding(self) -> Array:
        """Share |R_T| / (f R_N) of every row of elements in contact, and its angle (rad).

        Shape (2, rows), by angle.  Friction and its limit are summed up over the row: where the
        law is sharper than the mesh, friction alternates from point to point.
        """
        operator, on = self.contact.sampling, self.touching[self.cells].any(axis=1)
        cells, areas = self.cells[on], operator.shares[self.elements[on]]
        x = np.round(operator.reference[0][cells].mean(axis=1), 9)
        rows, row = np.unique(x, return_inverse=True)
        limit = (self.coefficient or 0.0) * self.pressure
        parts = np.ones_like(limit), self.angle, limit, np.linalg.norm(self.traction, axis=0)
        sums = ((part[cells] * areas).sum(axis=1) for part in parts)
        area, angle, limit, used = (np.bincount(row, s, len(rows)).astype(float) for s in sums)
        share = np.divide(used, limit, out=np.zeros_like(used), where=limit > 0.0)
        order = np.argsort(angle / area)
        return np.stack([share, angle / area])[:, order]

    def slip_arc(self, ends: Array) -> float | None:
        """Angle (rad) between two, over which friction is above :data:`STICKING_SHARE` of the cone.

        The share is linear between rows of elements, and constant beyond the outermost ones.  There
        is no such angle without friction, nor at rest, where what sticks creeps as fast as the
        roller: the friction that is left of where strip slipped before is below f p.
        """
        share, angle = self.sliding
        if not (share.size and self.coefficient):
            return None
        first, last = np.sort(ends)  # angles may fall along the strip
        angle = np.clip(np.concatenate([[first], angle, [last]]), first, last)
        above = np.concatenate([share[:1], share, share[-1:]]) - STICKING_SHARE
        low, high = np.sort([above[:-1], above[1:]], axis=0)
        part = np.clip(high / np.maximum(high - low, 1e-300), 0.0, 1.0)
        arc = float(np.diff(angle) @ part)
        slips = self.max_slip >= RUNNING_SLIP * abs(self.surface_speed)
        return None if arc == 0.0 and slips else arc

    @property
    def grip(self) -> float:
        """Least share of the cone in contact, less :data:`STICKING_SHARE`: above 0 all slips.

        Or that of the sum of friction, if it is less: strip that slips to both sides, as one that
        cools on a roller does, sticks between them, and is held.
        """
        across = self.roller.unit_axis @ self.traction * self.area
        whole = np.hypot(self.drag, across.sum())
        limit = (self.coefficient or 0.0) * self.normal_force
        share = min(float(self.sliding[0].min(initial=1.0)), whole / limit if limit else 1.0)
        return float(share) - STICKING_SHARE

    @cached_property
    def ends(self) -> Array:
        """Ends of the contact: angle about the axis (rad) and reference x, shape (2, n).

        Along every line of three contact points of an element that does not run straight across
        the gap is taken as a parabola, and contact is where it is below the gap of the least
        pressure; so the ends move continuously with the state, not from point to point.  Empty
        without contact.
        """
        operator = self.contact.sampling
        lines = self.cells[:, operator.whole.lines].reshape(-1, 3)
        reference, values = operator.reference, np.stack([self.angle, operator.reference[0]])
        along, across, _ = np.abs(reference[:, lines[:, 2]] - reference[:, lines[:, 0]])
        lines = lines[along > 1e-6 * across]
        gap = (self.gap - self.contact.signorini.gap(self.least + self.contact.least))[lines]
        inner = parabola_roots(gap)
        line, root = np.nonzero(np.isfinite(inner))
        s = inner[line, root]
        quadratic = np.stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)], axis=1)
        at_roots = (values[:, lines[line]] * quadratic).sum(axis=2)
        return np.concatenate([values[:, lines[gap < 0.0]], at_roots], axis=1)

    @cached_property
    def angle(self) -> Array:
        """Angle of each point about the axis, from the middle of contact or the nearest point.

        It goes on along the strip: a helix may touch more than half a turn from there.
        """
        weight = self.pressure * self.area * self.touching
        middle = self.normal @ weight if weight.any() else self.normal[:, self.gap.argmin()]
        middle = middle / np.linalg.norm(middle)
        across = self.roller.cross_matrix @ middle
        angle = np.arctan2(across @ self.normal, middle @ self.normal)
        order = np.argsort(self.contact.sampling.reference[0], kind="stable")
        angle[order] = np.unwrap(angle[order])
        mean = np.average(angle, weights=weight) if weight.any() else angle[self.gap.argmin()]
        return np.asarray(angle - 2.0 * np.pi * np.round(mean / (2.0 * np.pi)))

    @cached_property
    def arc(self) -> tuple[float, float]:
        """Reference x where contact begins and ends; of the nearest point if there is none."""
        nearest = self.contact.sampling.reference[0, [self.gap.argmin()]]
        x = self.ends[1] if self.ends.size else nearest
        return float(x.min()), float(x.max())

    @property
    def middle(self) -> float:
        """Reference x of the middle of the contact."""
        return 0.5 * sum(self.arc)


def parabola_roots(values: Array) -> Array:
    """Return the roots in ]0, 1[ of parabolas with values (n, 3) at 0, 1/2, 1; NaN else, (n, 2)."""
    c, middle, end = values.T
    a, b = 2.0 * (c + end) - 4.0 * middle, 4.0 * middle - 3.0 * c - end
    with np.errstate(invalid="ignore", divide="ignore"):
        q = -0.5 * (b + np.copysign(np.sqrt(b * b - 4.0 * a * c), b))
        roots = np.stack([q / a, c / q], axis=1)
        return np.where((roots > 0.0) & (roots < 1.0), roots, np.nan)


@dataclass(frozen=True)
class RollerPassage:
    """The place where strip passes a roller, or several that nip it, whose contacts overlap.

    The tension is the component, along the strip, of the force on it, which by equilibrium from the
    entry is known where contact begins and ends.  The strip's direction is that at
    :data:`FREE_DISTANCE` √(D/T) from there, or in the middle of the way to the next contact or to
    the end: where the strip bends onto the roller shear takes a part of the force.
    """

    names: tuple[str, ...]
    arc: tuple[float, float]  # reference x where contact begins and ends
    places: Array  # reference x before and behind it where the strip's direction is taken, (2,)
    slopes: Array  # ∂r/∂X there, shape (2, 3)
    forces: Array  # on all strip up to where contact begins and ends (N), shape (2, 3)
    pulls: Array  # the same with the pressure on it up to the places
    width: float  # of the strip (m)

    @property
    def tensions(self) -> tuple[float, float]:
        """Tension before and behind (N/m)."""
        along = self.slopes / np.linalg.norm(self.slopes, axis=1)[:, None]
        before, behind = (-(self.pulls * along).sum(axis=1) / self.width).tolist()
        return before, behind


@dataclass(frozen=True)
class RollerReading:
    """Forces of a roller on the strip, and how they come about."""

    normal_force: float  # sum of the normal forces (N)
    drag: float  # sum of the friction forces in the sense of a positive speed (N)
    wrap: float  # angle from the beginning to the end of contact (rad), see lift_offs
    tension_in: float | None  # along the strip before the roller (N/m); None if nothing touches
    tension_out: float | None  # behind it, likewise
    max_slip: float  # largest slip speed in contact (m/s)
    creep_speed: float  # roller's surface speed less the strip's, mean over the contact (m/s)
    cone_violation: float  # largest |R_T| / (f R_N) − 1 in contact, at least 0
    surface_speed: float  # where the profile has the nominal radius (m/s)
    torque: float  # moment of friction about the axis on the strip, in the sense of drag (N m)
    bearing_torque: float  # with which bearings brake a roller that turns freely (N m)
    capacity_used: float | None  # share of the largest friction, at most 1; None without friction
    slip_arc: float | None  # angle over which friction is at 0.95 of f R_N or more (rad)
    line_load_in: float | None  # where the strip runs on, beyond N/r (N/m), see lift_offs
    line_load_out: float | None  # where it runs off
    offset: float | None  # of the strip along y where it runs on (m); None if it stays in its plane
    resultant: Array  # force of the roller on the strip (N), shape (3,)

    @property
    def tension_ratio(self) -> float | None:
        """Tension before the roller over tension after it."""
        if self.tension_in is None or self.tension_out is None or self.tension_out <= 0.0:
            return None
        return self.tension_in / self.tension_out


def reading_of(
    state: ContactState, passage: RollerPassage, bending: float, offset: float | None, yields: bool
) -> RollerReading:
    """Read off a roller.

    Parameters
    ----------
    state : ContactState
    passage : RollerPassage
        What is before and behind the roller, and those that nip the strip with it.
    bending : float
        D (N m); 0 of a strip that does not resist bending.
    offset : float or None
        Of the strip along y where contact begins (m).
    yields : bool
        Whether the strip may: bending it then takes up tension as well, and the theory of the line
        loads is not its own.
    """
    touching = state.touching
    force = state.pressure * state.area * touching
    along = np.einsum("ip,ip->p", state.slip, state.turning)
    tensions = passage.tensions if touching.any() else (None, None)
    ends, loads = lift_offs(state, passage.tensions, bending, not yields)
    loads = [None, None] if yields else loads
    wrap = float(np.ptp(ends))
    return RollerReading(
        **{name: getattr(state, name) for name in READ_AS_THEY_ARE},
        wrap=wrap,
        slip_arc=state.slip_arc(ends),
        tension_in=tensions[0],
        tension_out=tensions[1],
        creep_speed=-float((along * force).sum() / force.sum()) if force.any() else 0.0,
        cone_violation=max(0.0, float(state.cone_share.max()) - 1.0),
        capacity_used=capacity_used(state, passage, wrap, yields),
        line_load_in=loads[0],
        line_load_out=loads[1],
        offset=offset,
    )


def capacity_used(
    state: ContactState, passage: RollerPassage, wrap: float, yields: bool
) -> float | None:
    """Share of the largest friction, between 0 and 1: by Euler's formula where tension presses.

    That is |ln(T1/T2)| / (f θ), of T − p r where p lifts the strip.  θ is the angle by which the
    roller turns the strip, between the directions of its forces before and behind, to whole turns
    nearest to the wrap.  The angle of contact is smaller by √(D/T)/r at both ends, where the line
    loads do as much as it lacks.  Where more than the largest tension times θ presses, as a nip or
    strip so stiff that its shear forces bear its weight do, it is the friction force over f times
    the normal force; and where the strip yields, which takes up tension without friction.  What
    friction takes along the axis, over f times the normal force, is added as a square.
    """
    if not state.coefficient or not state.ends.size:
        return None
    before, after = passage.forces
    axis = state.roller.unit_axis
    turn = np.arctan2(axis @ np.cross(before, after), before @ after)
    angles = np.abs(turn + 2.0 * np.pi * np.array([-1.0, 0.0, 1.0]))
    angle = float(angles[np.abs(angles - wrap).argmin()])
    low, high = np.sort(passage.tensions) - state.lifting * state.roller.radius
    pressed, most = state.normal_force / state.width, state.coefficient * state.normal_force

    def share(force: float) -> float:  # of points that barely touch both are near to nothing
        return force / most if force < most else float(force > 0.0)

    if not yields and len(passage.names) == 1 and low > 0.0 and 0.0 < pressed <= high * angle:
        used = float(np.log(high / low)) / angle / state.coefficient
    else:
        used = share(abs(state.drag))
    sideways = share(abs(float(axis @ state.traction @ state.area)))
    return float(min(np.hypot(used, sideways), 1.0))


def lift_offs(
    state: ContactState, tensions: Sequence[float], bending: float, elastic: bool
) -> tuple[Array, list[float | None]]:
    """Angles (rad) where contact begins and ends, and loads per width (N/m) there, beyond N/r.

    In theory a strip that resists bending presses with N/r on the way, and with a line load at both
    ends, where its curvature falls off.  As N + D κ²/2 is the same on and off the roller, with the
    curvature 1/r on it and none far away,

        N = T − D/(2 r²),  q² = T² − N²,  q ≈ √(D T)/r of thin strip.

    A mesh and a soft law spread the loads, in peaks that grow with every refinement.  Of the forces
    F_i up to a point at the distances u_i from them, a pressure κ = N/r − p that begins at u, where
    p lifts the strip, and a load q there have the same sum and moment:

        q + κ u = Σ F_i,  q u + κ u²/2 = Σ F_i u_i  ⟹  q² = (Σ F_i)² − 2 κ Σ F_i u_i.

    Distances are those of strip as it is cut, along which hot strip turns by more than 1/r.
    What friction has taken of N/r up to a point is added to F_i there.  Strip that yields is bent
    by less than D/r, and its N is taken for T.

    The point is :data:`LOAD_RANGE` √(D/T) behind the place where the gap is that of the least
    pressure, at most in the middle.  By a soft law strip has lifted off before that place, whose
    distance from the load falls with the cube root of the onset alone.  There are no such loads
    along a line of contact, shorter than :data:`LINE_CONTACT` √(D/T), where elements are longer
    than √(D/T), and where forces and moment have no such load.
    """
    if not (state.ends.size and state.pressure.any()):
        return np.zeros(2), [None, None]
    radius = state.roller.radius
    bent = 0.5 * bending / radius**2 if elastic else 0.0
    if min(tensions) - bent <= max(state.lifting * radius, 0.0):
        return np.array([state.ends[0].min(), state.ends[0].max()]), [None, None]
    near = np.flatnonzero(state.pressure)
    places = np.round(state.contact.sampling.reference[0, near], 9)
    x, station = np.unique(places, return_inverse=True)
    share = state.area[near] / state.width
    parts = state.pressure[near], (state.traction * state.turning).sum(axis=0)[near]
    force, rubbed = (np.bincount(station, part * share).astype(float) for part in parts)
    angle = np.bincount(station, state.angle[near] * share) / np.bincount(station, share)
    elements = state.contact.sampling.reference[0][state.cells]
    ends, layers, loads = np.zeros(2), np.zeros(2), list[float | None]()
    onwards = state.roller.sense * np.sign(angle[-1] - angle[0])  # a positive speed along x
    length, turn = np.bincount(station, share), np.ptp(np.interp(state.arc, x, angle))
    label_radius = np.ptp(state.arc) / turn if turn > 0.0 else radius  # r over the stretch
    for k, tension in enumerate(tensions):
        sense, layers[k] = 1 - 2 * k, np.sqrt(bending / tension)
        first, last = sense * state.arc[k], sense * state.middle
        point = min(first + LOAD_RANGE * layers[k], last)
        u = np.maximum(point - sense * x, 0.0)
        lost = up_to_the_middle(sense * onwards * rubbed[::sense])[::sense]
        borne = force + lost * length / label_radius  # as if friction had left the tension alone
        held = np.interp(point, np.sort(sense * x), up_to_the_middle(borne[::sense]))
        pressure = (tension - bent) / label_radius - state.lifting
        square = held**2 - 2.0 * pressure * float(borne @ u)
        load = float(np.sqrt(max(square, 0.0)))
        ends[k] = sense * (point - (held - load) / pressure)
        there = elements[np.abs(elements.mean(axis=1) - state.arc[k]).argmin()]
        loads.append(load if square > 0.0 and np.ptp(there) <= layers[k] else None)
    along_a_line = np.ptp(ends) <= LINE_CONTACT * layers.max()
    return np.interp(ends, x, angle), [None, None] if along_a_line else loads


def up_to_the_middle(values: Array) -> Array:
    """Return the sums of values up to the middle of each."""
    return np.asarray(np.cumsum(values) - 0.5 * values)


@dataclass(frozen=True)
class Regularisation:
    """Effects of a roller's regularised laws, on the tensions as shares."""

    sticking_creep: float = 0.0  # largest slip speed where friction is below the cone (m/s)
    penetration: float = 0.0  # largest distance in contact from the surface, either side (m)
    by_creep: float = 0.0  # strain that what sticks creeps while on the roller, over the tension's
    by_cone: float = 0.0  # friction beyond f R_N, over the tension
    by_penetration: float = 0.0
    """Penetration over the radius: the moment and the way of the strip go with the radius; and
    the strain of the fibre whose gap is farthest from the others', in units of the tension's."""

    @property
    def effect(self) -> float:
        """Estimated change of the tensions by all, as a share."""
        return self.by_creep + self.by_cone + self.by_penetration


def regularisation_of(
    state: ContactState, reading: RollerReading, elapsed: float, stiffness: float
) -> Regularisation:
    """Estimate what regularisation does on one roller.

    Parameters
    ----------
    state : ContactState
    reading : RollerReading
    elapsed : float
        Time for which the strip may have crept (s).
    stiffness : float
        E t of the strip (N/m).
    """
    touching, radius, speed = state.touching, state.roller.radius, reading.surface_speed
    if not touching.any():
        return Regularisation()
    tension = max(reading.tension_in or 0.0, reading.tension_out or 0.0)
    creep = by_creep = by_cone = uneven = 0.0
    if state.coefficient and tension > 0.0:
        slip, traction = (np.linalg.norm(v, axis=0) for v in (state.slip, state.traction))
        cone = state.coefficient * state.pressure
        creep = float(slip[touching & (traction < STICKING_SHARE * cone)].max(initial=0.0))
        excess = np.maximum(traction - cone, 0.0) * state.area
        by_cone = float(excess[touching].sum()) / (tension * state.width)
        arc = max(reading.wrap, 1e-3) * radius
        stay = min(arc / max(abs(speed - reading.creep_speed), 1e-300), elapsed)
        by_creep = creep * stay / arc * stiffness / tension
    y = state.contact.sampling.reference[1, touching]
    _, fibre = np.unique(np.round(WIDTH_STRIPES * y / state.width), return_inverse=True)
    if tension > 0.0 and fibre.any():
        gaps = np.bincount(fibre, state.gap[touching]) / np.bincount(fibre)
        uneven = float(np.abs(gaps - gaps.mean()).max()) / radius / (tension / stiffness)
    penetration = float(np.abs(state.gap[touching]).max())
    return Regularisation(creep, penetration, by_creep, by_cone, penetration / radius + uneven)
