"""What is read off a state: tensions, roller forces, wrap, slip."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import compress, permutations
from typing import TYPE_CHECKING, Any

import numpy as np

from anmstrip.arrays import Array, Index
from anmstrip.continuation.path import Branch
from anmstrip.equilibrium import StageProblem
from anmstrip.errors import Named
from anmstrip.fem.sampling import quadrature_points, shape_of
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.shell import Membrane, principal_values
from anmstrip.results.rollers import (
    FREE_DISTANCE,
    ContactState,
    Regularisation,
    RollerPassage,
    RollerReading,
    reading_of,
    regularisation_of,
)

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Contact, Friction
    from anmstrip.mechanics.plasticity import Plasticity
    from anmstrip.timestepping.formulas import TimeStep


STRIP_EFFECTS = ("membrane", "bending", "plasticity")
"""Effects that are forces of the strip itself."""


SHORT_LAYER = 0.1
"""Length √(D/T) over the strip's up to which the curl of an end is short: it falls by e along that
length, so to e⁻¹⁰ of itself along the strip."""


@dataclass(frozen=True, repr=False)
class StripState:
    """A state of the strip in a stage, and what is read off it.

    Attributes
    ----------
    plan : StageProblem
    time : float
        s.
    control : float
        λ of the stage.
    full : ndarray, shape (unknowns,)
        Displacements.
    velocity : ndarray, shape (unknowns,), or None
        Where the stage runs in time.
    branch : Branch or None
        Path of a rate-free step to this state, in the free unknowns.
    step : TimeStep or None
        In time, that ends in this state, if it is no snap.
    conveyed : float
        Length of unstressed strip (m) that has been fed in so far, in time.
    """

    plan: StageProblem
    time: float
    control: float
    full: Array
    velocity: Array | None
    branch: Branch | None = None
    conveyed: float = 0.0
    step: TimeStep | None = None

    @cached_property
    def controls(self) -> dict[str, Array]:
        """Values of the controls."""
        return self.plan.controls.at(self.control)

    def centre(self, roller: str) -> Array:
        """Return a point of a roller's axis (m), shape (3,)."""
        centre = np.asarray(self.controls[f"rollers.{roller}.centre"])
        pressed = self.plan.model.effect("press")
        return centre if pressed is None else centre + pressed.shift(roller, self.full)

    @property
    def strip_speed(self) -> float | None:
        """Speed of the strip (m of unstressed strip per second), if material passes its labels."""
        if self.plan.fed and self.velocity is not None:
            return float(self.velocity[self.plan.model.coupled - 1])
        return self.plan.strip_speed(self.full, self.control) if self.plan.steady else None

    def end_speed(self, edge: str) -> float | None:
        """Speed of the strip at an end (m of unstressed strip per second), if it passes it.

        That of its label, which sways as rollers move, and of the material that passes this.
        """
        if self.strip_speed is None:
            return None
        passing = self.strip_speed + float(self.controls.get(f"{edge}.drift", 0.0))
        if not self.plan.fed or self.velocity is None:
            return passing
        return passing + self.along_end(edge, self.velocity)

    def along_end(self, edge: str, full: Array, less: Array | None = None) -> float:
        """Displacement of an end along the strip (m of unstressed strip), or its velocity.

        Parameters
        ----------
        edge : str
        full : ndarray, shape (unknowns,)
        less : ndarray, shape (3,), optional
            What is taken off it.
        """
        strip = self.plan.model.strip
        nodes, along = strip.dofs("u")[strip.edges[edge].nodes], strip.edge_tangent(edge, self.full)
        moved = strip.kinematics.embed(strip.nodal(full)[nodes].mean(axis=0))
        return float((moved - (0.0 if less is None else less)) @ along / (along @ along))

    @cached_property
    def material_velocity(self) -> Array:
        """Velocity of the material, on the strip's functions, (unknowns of the strip,)."""
        unknowns = self.plan.model.strip.unknowns
        if self.velocity is None:
            return np.zeros(unknowns)
        moving, speed = self.velocity[:unknowns], self.strip_speed
        if not self.plan.fed or speed is None:
            return moving
        passing: Any = speed
        if "strip.drift" in self.controls:
            passing = (speed + self.controls["strip.drift"]) / self.controls["strip.growth"]
        return moving + self.plan.carried(self.full, passing)

    @property
    def bends(self) -> bool:
        """Whether the strip resists bending."""
        return self.plan.model.effect("bending") is not None

    @property
    def friction(self) -> Friction | None:
        """Friction of the strip on its rollers."""
        return self.plan.friction

    @property
    def membrane(self) -> Membrane | None:
        """Membrane of the strip; a plate has none."""
        return self.plan.model.effect("membrane")

    @property
    def plasticity(self) -> Plasticity | None:
        """Plastic strains, of strip that can yield."""
        return self.plan.model.effect("plasticity")

    @cached_property
    def principal_forces(self) -> Array:
        """Membrane forces (N/m), ascending, at the quadrature points, shape (points, d)."""
        return principal_values(self.membrane_forces)

    @cached_property
    def tension_profile(self) -> tuple[Array, Array] | None:
        """Reference x (m) and mean tension (N/m) there, at the ends and amid elements, (n,) each.

        The strip's own forces on all nodes before a section add up to the force on it, whatever
        acts on them; the tension is its component along the strip.  It is in equilibrium where the
        forces of the strains swing.  None of a plate, and where nodes do not stand in lines.
        """
        model = self.plan.model
        strip = model.strip
        number = strip.lines[1]
        if self.membrane is None or shape_of(strip) == "triangle" or np.ptp(np.bincount(number)):
            return None
        own = [effect for effect in model.effects if effect.name in STRIP_EFFECTS]
        here = self.full, self.velocity, self.controls
        forces = sum(effect.force(*here)[: strip.unknowns] for effect in own)
        values = strip.kinematics.embed(strip.nodal(np.asarray(forces))[strip.dofs("u")].T)
        before = np.stack([np.bincount(number, part) for part in values]).cumsum(axis=1)[:, :-1]
        (lines, moved), (_, slopes) = (self.lines_across(name) for name in ("u", "u_x"))
        lengths = np.diff(lines)
        along = 1.5 * np.diff(moved, axis=0) / lengths[:, None] - 0.25 * (slopes[1:] + slopes[:-1])
        along += np.array([1.0, 0.0, 0.0])
        along /= np.linalg.norm(along, axis=1)[:, None]
        inside = -np.einsum("ai,ia->i", before, along) / strip.width
        places = np.concatenate([lines[:1], lines[:-1] + 0.5 * lengths, lines[-1:]])
        return places, np.array([self.tension("entry"), *inside, self.tension("exit")])

    @cached_property
    def membrane_forces(self) -> Array:
        """Membrane forces (N/m) at the quadrature points, shape (d, d, points)."""
        assert self.membrane is not None
        elastic, flow = self.membrane.at(self.full, self.controls), self.plasticity
        return elastic if flow is None else elastic + flow.added_forces(self.full, self.controls)

    @cached_property
    def imbalance(self) -> Array:
        """Internal minus external force of every unknown; reactions where it is held."""
        return self.plan.model.force(self.full, self.velocity, self.plan.controls, self.control)

    def edge_force(self, name: str) -> Array:
        """Total force on an edge, its reaction and loads (N), shape (3,)."""
        strip = self.plan.model.strip
        edge = strip.edges[name]
        given = self.controls.get(f"{name}.force", np.zeros(3)) * edge.length
        if (pull := self.plan.model.effect(f"tension on {name}")) is not None:  # follows the strip
            stress = pull.law(pull.operator.apply(self.full), None, self.controls)
            given = given - strip.kinematics.embed(stress[:, 0] @ pull.operator.weights)
        if name == "entry" and 0 not in strip.kinematics.components:  # what holds a plate along
            given[0] -= self.controls.get("exit.force", np.zeros(3))[0] * edge.length
        values = strip.nodal(self.imbalance)[edge.values].sum(axis=0)
        return strip.kinematics.embed(values) + given

    def uneven_reaction(self, name: str) -> dict[str, Array]:
        """Return what holds an edge of a shell beyond an even force, ``NAME.uneven_force`` (N/m).

        Nothing as a whole, but a moment in the plane of strip that is out of line.
        """
        strip = self.plan.model.strip
        edge, forces = strip.edges[name], strip.nodal(self.imbalance)
        if strip.mesh.dim() == 1:
            return {}
        even, field = forces[edge.values].sum(axis=0) / edge.length, np.zeros_like(forces)
        field[edge.trace] = np.linalg.solve(edge.mass, forces[edge.trace])
        field[edge.values] -= even
        return {f"{name}.uneven_force": field.ravel()}

    def clamp_moments(self, names: Iterable[str]) -> dict[str, float]:
        """Mean moments at those of the clamped edges (N) that have not been let go."""
        strip, free = self.plan.model.strip, self.plan.supports.free
        held = (n for n in names if not np.isin(strip.edge_unknowns(n, (), [2], ()), free).any())
        return {name: self.clamp_moment(name) for name in held}

    def clamp_moment(self, name: str) -> float:
        """Mean moment at a clamped edge (N), positive where the upper side is stretched.

        Of what is out of balance there that which works on a uniform slope.
        """
        strip = self.plan.model.strip
        edge, basis = strip.edges[name], strip.basis
        across = int(np.ptp(strip.nodes[0, edge.nodes]) > 0.0)
        outward = np.sign(strip.nodes[across, edge.nodes[0]] - strip.nodes[across].mean())
        nodal = zip(basis.elem.dofnames, basis.nodal_dofs, strict=False)
        slopes = [(outward, dofs[edge.nodes]) for n, dofs in nodal if n == f"u_{'xy'[across]}"]
        slopes += [(1.0, dofs[edge.facets]) for dofs in basis.facet_dofs]  # of outward normals
        own = strip.nodal(self.imbalance)[:, strip.kinematics.place(2)]
        return sum(-float(sense * own[dofs].sum()) for sense, dofs in slopes) / edge.length

    def pull_direction(self, name: str) -> Array | None:
        """Direction of the force that pulls an edge, in the plane in which the strip bends, (3,).

        Strip that would be curved unstressed curls at an end that no moment holds, over √(D/T).
        Beyond, it has the direction of the force.  None where that length is no short one.
        """
        strip = self.plan.model.strip
        edge, force = strip.edges[name], self.edge_force(name)
        if strip.mesh.dim() == 2:
            ends = edge.nodes[[0, -1]]
            moved = strip.kinematics.embed(strip.nodal(self.full)[strip.node_values[ends]].T)
            (across,) = np.diff(strip.nodes[:, ends] + moved).T
            force = force - force @ across / (across @ across) * across
        pull = float(np.linalg.norm(force))
        layer = np.sqrt(strip.bending_stiffness * edge.length / max(pull, 1e-300))
        pulled = force @ strip.edge_tangent(name, self.full) * (-1.0 if name == "entry" else 1.0)
        along = 0 in strip.kinematics.components
        if pulled <= 0.0 or layer > SHORT_LAYER * strip.length or not along:
            return None
        return np.asarray(force / pull)

    def tension(self, name: str) -> float:
        """Mean force per length of an edge along the strip there (N/m).

        Along its pull, see :meth:`pull_direction`, else along the strip's own direction.
        """
        edge = self.plan.model.strip.edges[name]
        if (outward := self.pull_direction(name)) is None:
            along = self.plan.model.strip.edge_tangent(name, self.full)
            outward = along / np.linalg.norm(along) * (-1.0 if name == "entry" else 1.0)
        return float(self.edge_force(name) @ outward) / edge.length

    def offset(self, x: Any) -> Any:
        """Displacement along y of the strip at a reference x, mean over its width (m).

        Parameters
        ----------
        x : float or ndarray
            Between lines of nodes the means are interpolated linearly.
        """
        return self.mean_across("u", x)[..., 1][()]

    def slope(self, x: Any) -> Array:
        """Derivative ∂r/∂X of the strip at a reference x, mean over its width, (..., 3)."""
        return np.array([1.0, 0.0, 0.0]) + self.mean_across("u_x", x)

    def mean_across(self, name: str, x: Any) -> Array:
        """Mean of a degree of freedom of the nodes over the width at a reference x, (..., 3)."""
        lines, means = self.lines_across(name)
        return np.stack([np.interp(x, lines, part) for part in means.T], axis=-1)

    def lines_across(self, name: str) -> tuple[Array, Array]:
        """Reference x of the lines of nodes, (lines,), and means over them, (lines, 3)."""
        strip = self.plan.model.strip
        values = strip.kinematics.embed(strip.nodal(self.full)[strip.dofs(name)].T)
        lines, number = strip.lines
        count = np.bincount(number)
        return lines, np.stack([np.bincount(number, part) / count for part in values], axis=-1)

    @cached_property
    def contacts(self) -> dict[str, ContactState]:
        """Roller → what it does to the strip."""
        if (contact := self.contact) is None:
            return Named()
        rubbing = {} if self.friction is None else self.friction.by_roller
        parts, near = contact.by_roller, contact.elements_near(self.full, self.controls)
        elements = dict(zip(parts, near, strict=True))
        found = Named((n, self._contact(parts[n], rubbing.get(n), elements[n])) for n in parts)
        for one, other in permutations(found.values(), 2):
            _, mine, its = np.intersect1d(
                one.contact.sampling.chosen, other.contact.sampling.chosen, return_indices=True
            )
            one.opposed[mine] += other.pressure[its]
        return found

    @property
    def touched(self) -> dict[str, ContactState]:
        """Roller → what it does to the strip, of those that it lies on."""
        return {name: c for name, c in self.contacts.items() if c.touching.any()}

    @property
    def contact(self) -> Contact | None:
        """Normal contact with all rollers."""
        contact = self.plan.model.effect("contact")
        return contact if contact is not None and contact.by_roller else None

    @cached_property
    def gaps(self) -> Array:
        """Gap (m) of every contact point from the roller that it is nearest to, (points,)."""
        contact = self.contact
        return np.zeros(0) if contact is None else contact.nearest_gaps(self.full, self.controls)

    def _contact(self, contact: Contact, friction: Friction | None, near: Index) -> ContactState:
        points = np.unique(contact.sampling.cells[near])
        if not points.size:
            look = contact.look(self.full, self.controls)
            points = np.array([contact.gap(look, self.controls).argmin()])
        contact = contact.restricted(points)
        place = contact.seen(contact.operator.apply(self.full), self.controls)
        normal, pressure = contact.normal(place), np.maximum(contact.pressure(place), 0.0)
        slip, traction = np.zeros_like(normal), np.zeros_like(normal)
        if friction is not None and self.velocity is not None:
            rubbed = place.gap < friction.contact.reaches
            part = friction.restricted(points[rubbed])
            x, v = part.operator.apply(self.full), part.operator.apply(self.velocity)
            slip[:, rubbed], traction[:, rubbed] = part.in_space(x, v, self.controls)
        coefficient = None if friction is None else friction.law_of_slip.coefficient
        roller = contact.roller.members[0]
        ratio = 1.0 if place.ratio is None else place.ratio
        arm = roller.radius * np.broadcast_to(ratio, place.gap.shape)
        rubbing = slip, traction, coefficient, arm, *self._turning(roller.name)
        nearest = int(place.gap.argmin())
        slope = self.slope(contact.sampling.reference[0, nearest])
        up = turn_upwards(self.plan.model.strip, slope) @ normal[:, nearest]
        lifting = float(self.controls.get("pressure", 0.0) * np.sign(up))
        return ContactState(contact, place.gap, normal, pressure, *rubbing, near, lifting)

    def _turning(self, name: str) -> tuple[float, float]:
        """Speed of a roller's surface (m/s), and torque of its bearings against it (N m)."""
        model = self.plan.model
        if name not in model.turning:
            return float(self.controls[f"rollers.{name}.surface_speed"]), 0.0
        drives = self.plan.model.effect("drives")
        if drives is None or self.velocity is None:
            return 0.0, 0.0
        speeds, number = drives.operator.apply(self.velocity)[0], model.turning.index(name)
        return float(speeds[number]), float(drives.drag(speeds)[number])

    def surface_travel(self, name: str, before: StripState) -> float:
        """Travel (m) of a roller's surface since a state of the same stage or its beginning."""
        model, h = self.plan.model, self.time - before.time
        if name in model.turning:
            place = model.strip.unknowns + model.turning.index(name)
            if self.plan.steady:
                return h * float(self.full[place])
            if self.velocity is None:
                return 0.0
            begin = self.velocity if before.velocity is None else before.velocity
            return 0.5 * h * float(begin[place] + self.velocity[place])
        key = f"rollers.{name}.surface_speed"
        gained = float(self.plan.controls.rate(key)) * h / self.plan.duration
        return h * (float(self.controls[key]) - 0.5 * gained)

    @cached_property
    def rollers(self) -> dict[str, RollerReading]:
        """Roller → what is read off, in the order of the scene."""
        strip = self.plan.model.strip
        bending, sideways = self.bends * strip.bending_stiffness, 1 in strip.kinematics.components
        found = {name: passage for passage in self.passages for name in passage.names}
        readings, yields = Named[RollerReading](), self.plasticity is not None
        for name, contact in self.contacts.items():
            offset = self.offset(contact.arc[0]) if sideways else None
            readings[name] = reading_of(contact, found[name], bending, offset, yields)
        return readings

    @cached_property
    def passages(self) -> list[RollerPassage]:
        """Rollers from the entry on, one by one, or at once those whose contacts overlap."""
        strip, contacts = self.plan.model.strip, self.contacts
        passed: list[list[str]] = []
        near: list[str] = []  # what has been touched last
        for name in sorted(contacts, key=lambda n: contacts[n].middle):
            touches, reached = contacts[name].touching.any(), [contacts[n].arc[1] for n in near]
            if touches and contacts[name].arc[0] < max(reached, default=-np.inf):
                near.append(name)
                continue
            passed.append([name])
            near = passed[-1] if touches else near
        arcs = [np.array([contacts[name].arc for name in names]) for names in passed]
        ends = [(float(arc[:, 0].min()), float(arc[:, 1].max())) for arc in arcs]
        touched = [contacts[names[0]].touching.any() for names in passed]
        stops = np.array([*strip.span, *(x for arc in compress(ends, touched) for x in arc)])
        force = self.edge_force("entry") if "entry" in strip.edges else np.zeros(3)
        stiffness, found = self.bends * strip.bending_stiffness, []
        for names, (begin, end) in zip(passed, ends, strict=True):
            arc, before = np.array([begin, end]), force
            force = force + sum(contacts[name].resultant for name in names)
            pushed = self.pressure_before(arc)
            forces = np.stack([before, force]) + self.weight_before(arc) + pushed
            behind, ahead = stops[stops < begin], stops[stops > end]
            low, high = behind.max(initial=strip.span[0]), ahead.min(initial=strip.span[1])
            free = [begin - low, high - end]
            sizes = np.maximum(np.linalg.norm(forces, axis=1) / strip.width, 1e-200)
            away = np.minimum(FREE_DISTANCE * np.sqrt(stiffness / sizes), 0.5 * np.array(free))
            places = np.array([begin - away[0], end + away[1]])
            pulls, slopes = forces + self.pressure_before(places) - pushed, self.slope(places)
            given = tuple(names), (begin, end), places, slopes, forces, pulls
            found.append(RollerPassage(*given, strip.width))
        return found

    @cached_property
    def regularisation(self) -> dict[str, Regularisation]:
        """Roller → what its regularised laws cost in truth."""
        elapsed = np.inf if self.plan.steady else self.time
        given, pairs = (elapsed, self.plan.model.strip.tensile_stiffness), self.rollers.items()
        return Named((n, regularisation_of(self.contacts[n], read, *given)) for n, read in pairs)

    def unstressed_length(self, x: Any) -> Any:
        """Length of unstressed strip (m) between the entry and labels x, shape of x."""
        strip = self.plan.model.strip
        begin, end = strip.span
        growth = self.controls.get("strip.growth")
        if growth is None:
            return x - begin
        places, lines = np.unique(quadrature_points(strip)[0], return_inverse=True)
        weights = strip.weights().ravel() * (end - begin) / strip.areas.sum()
        held = np.bincount(lines, weights * growth)
        up_to = [0.0, *(np.cumsum(held) - 0.5 * held), held.sum()]
        return np.interp(x, [begin, *places, end], up_to)

    def way(self, x: Any) -> Array:
        """Way (m) from the entry to the strip at a reference x, mean over its width, (..., 3)."""
        from scipy.interpolate import CubicHermiteSpline  # slow to import

        (lines, moved), (_, slopes) = (self.lines_across(name) for name in ("u", "u_x"))
        along = (np.asarray(x) - lines[0])[..., None] * np.array([1.0, 0.0, 0.0])
        return np.asarray(along + CubicHermiteSpline(lines, moved, slopes)(x) - moved[0])

    def pressure_before(self, x: Any) -> Array:
        """Force (N) of the pressure p on the strip up to a reference x, (..., 3): p W Δr × e_y."""
        strip = self.plan.model.strip
        load = float(self.controls.get("pressure", 0.0)) * strip.width
        return load * turn_upwards(strip, self.way(x)) if load else np.zeros((*np.shape(x), 3))

    def weight_before(self, x: Any) -> Array:
        """Weight of the strip up to a reference position (N), shape (..., 3)."""
        return self.weight_of(self.unstressed_length(x))

    def weight_of(self, length: Any) -> Array:
        """Weight (N) of unstressed strip of a length (m), shape (3,) more."""
        strip, gravity = self.plan.model.strip, self.controls.get("gravity", np.zeros(3))
        begin, end = strip.span
        area = np.asarray(length)[..., None] / (end - begin) * strip.areas.sum()
        return np.asarray(strip.mass * area * gravity)


def turn_upwards(strip: Strip, way: Array) -> Array:
    """Return ways along a strip turned to its upper side, Δr × e_y, a plate's upwards, (..., 3)."""
    chosen = strip.kinematics.chosen
    return np.asarray(np.cross(way, [0.0, 1.0, 0.0]) @ chosen.T @ chosen)
