"""First orders of stationary states in controls and in the data of a line, at rest or oscillating.

All of them by one tangent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, vstack
from scipy.sparse.linalg import splu

from anmstrip.arrays import Array
from anmstrip.fem.sampling import quadrature_points
from anmstrip.linalg.direct import Factors, equilibrate
from anmstrip.linalg.solvers import Bordered, SparseSolver
from anmstrip.mechanics.contact import Contact
from anmstrip.mechanics.effects import EffectSeries, LawEffect, LawSeries, LoadEffect
from anmstrip.mechanics.loads import FollowerLoad, GrownWeight
from anmstrip.mechanics.roller import Roller, combine
from anmstrip.mechanics.shell import principal_forces
from anmstrip.mechanics.transport import Drives, SteadyFriction
from anmstrip.results.state import State
from anmstrip.results.strip_state import turn_upwards
from anmstrip.results.wrinkles import free_spans
from anmstrip.scene.tables import ENDS
from anmstrip.simulation.growth import Hanging

Explicit = Mapping[str, Array]
"""Effect → derivative of its law at its points, or of its residual if it has no law."""

STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))
"""Places and weights of the difference of fourth order for a first derivative."""

DIFFERENCE_STEP = 1e-2
"""Change of gaps over the onset of contact, and of slip over V_c, in a difference: its error is of
the order SMALL⁴/30 and, by round-off, 1e-16/DIFFERENCE_STEP of radii over onsets."""

THICKNESS_POWERS = {"membrane": 1.0, "bending": 3.0}
"""Powers of the thickness to which elastic effects are proportional."""


class StationaryTangent:
    """A stationary state with its tangent, factorised once.

    Parameters
    ----------
    state : State
        Of a steady stage.
    hanging : Hanging, optional
        How labels follow strip that hangs between its rollers.

    Attributes
    ----------
    friction : SteadyFriction
        At the points near rollers.
    order : dict
        Rollers and their numbers, from the entry on.
    turning : ndarray of int, shape (rollers,)
        Unknowns that are their speeds, in this order; −1 of rollers that do not turn freely.
    arcs : ndarray, shape (passages, 2)
        Reference x (m) where contact begins and ends, from the entry on.
    weights : ndarray, shape (passages, 2, 3)
        Weight (N) of the strip up to there.
    """

    def __init__(self, state: State, hanging: Hanging | None = None) -> None:
        self.state, self.model, self.hanging = state, state.plan.model, hanging
        self.taken_up: dict[str, Array] = {}
        self.free = state.plan.supports.free
        self.equations = state.plan.equations()
        self.series = self.equations.recurrence(state.full[self.free], state.control, 1)
        self.matrix = self.series.tangent()
        self.parts = {part.effect.name: self._at_points(part) for part in self.series.parts}
        friction, first = self.law_part("friction").effect, self.model.strip.unknowns
        assert isinstance(friction, SteadyFriction)
        self.friction = friction
        numbers = {roller.name: n for n, roller in enumerate(friction.roller.members)}
        self.order = {name: numbers[name] for passed in state.passages for name in passed.names}
        places = {name: first + number for number, name in enumerate(self.model.turning)}
        self.turning = np.array([places.get(name, -1) for name in self.order])
        self.arcs = np.array([passed.arc for passed in state.passages])
        self.weights = state.weight_before(self.arcs)

    def _at_points(self, part: EffectSeries) -> EffectSeries:
        """Return the series of a law, whatever its executor, as one of values at points."""
        effect = part.effect
        if not isinstance(effect, LawEffect):
            return part
        at = (self.state.full, None, self.state.control), self.equations.controls
        return LawSeries(self.model.laws.of(effect, *at), 1, *at)

    @cached_property
    def factors(self) -> Factors:
        """Factors of the tangent."""
        return SparseSolver().factorise(self.matrix)

    @cached_property
    def edge_rows(self) -> dict[str, Any]:
        """Rows of the residual summed over entry and exit, and of the tangent over all unknowns."""
        model, chosen = self.model, {}
        blocks = model.pattern.zeros(model.others)
        for part in self.series.parts:
            part.add_tangent(model.pattern, blocks, 0.0)
        whole = model.pattern.restricted(np.arange(model.unknowns)).matrix(blocks)
        matrix = whole.assembled() if isinstance(whole, Bordered) else whole
        for name in ENDS:
            sums = np.zeros((model.strip.count, model.unknowns))
            for component, row in enumerate(sums):
                row[model.strip.count * model.strip.edges[name].values + component] = 1.0
            chosen[name] = csr_matrix(sums), csr_matrix(sums) @ matrix
        return chosen

    def held(self, key: str) -> Array:
        """Strip (m) that runs take up where a parameter grows by one, (rollers + 1,)."""
        if self.hanging is None:
            return np.zeros(0)
        if key not in self.taken_up:
            self.taken_up[key] = self.hanging.changed(key)
        return self.taken_up[key]

    def grown(self, key: str) -> Array:
        """Change of ∂S/∂X by that at the quadrature points, (points,)."""
        held, x = self.held(key), quadrature_points(self.model.strip)[0]
        if self.hanging is None or not held.any():
            return np.zeros_like(x)
        return self.hanging.growth.at(x, held) - 1.0

    def law_part(self, name: str) -> LawSeries:
        """Series of a law."""
        part = self.parts[name]
        assert isinstance(part, LawSeries)
        return part

    def gathered(self, explicit: Explicit) -> Array:
        """Residual of derivatives at points, shape (unknowns,)."""
        total = np.zeros(self.model.unknowns)
        for name, values in explicit.items():
            part = self.parts[name]
            vector = part.operator.gather(values) if isinstance(part, LawSeries) else values
            total[: len(vector)] += vector
        return total

    def change(self, explicit: Explicit) -> Array:
        """Change −K⁻¹ ∂R/∂p of all unknowns, shape (unknowns,)."""
        supports = self.state.plan.supports
        right = supports.gathered(self.model.closed(self.gathered(explicit)))
        return supports.change(-self.factors.solve(right), 0.0)

    def at_points(self, name: str, change: Array, explicit: Explicit) -> Array:
        """Whole derivative of a law at its points for a change of the unknowns."""
        part = self.law_part(name)
        return part.orders.derivative(part.operator.apply(change)) + explicit.get(name, 0.0)

    def on_rollers(self, name: str, change: Array, explicit: Explicit) -> Array:
        """The same of contact or friction, summed over the areas of rollers, (values, rollers)."""
        areas, rows = self.areas[name], self.roller_rows[name]
        found = (rows @ change[: rows.shape[1]]).reshape(-1, areas.shape[1])
        return found + explicit[name] @ areas if name in explicit else found

    @cached_property
    def roller_rows(self) -> dict[str, csr_matrix]:
        """Rows of those sums by all unknowns, (values · rollers, unknowns)."""
        chosen = {}
        for name, areas in self.areas.items():
            part, entries, rows = self.law_part(name), 0, 0
            count, points = int(np.prod(part.shape[:-1])), part.shape[-1]
            each = np.eye(count).reshape(-1, *part.shape[:-1], 1)
            unit = np.broadcast_to(each, (count, *part.shape))
            slopes = part.orders.derivative(unit).reshape(count, -1, points)
            operator: Any = part.operator
            for given in operator.matrices[0]:
                m = given.matrix
                for component in range(given.count):
                    places = given.first + component + given.count * m.indices
                    at = csr_matrix((m.data, places, m.indptr), (points, self.model.unknowns))
                    by = [areas.T.multiply(slope) @ at for slope in slopes[entries]]
                    rows, entries = rows + vstack(by, "csr"), entries + 1
            chosen[name] = rows
        return chosen

    @cached_property
    def areas(self) -> dict[str, csc_matrix]:
        """Areas of the points of contact, and of those of friction, (points, rollers) each."""
        rollers, areas = self.friction.roller.members, {}
        for name in ("contact", "friction"):
            effect: Any = self.law_part(name).effect
            which = effect.roller.seen_by(effect.points)
            places = np.arange(len(which)), which
            shape = len(which), len(rollers)
            areas[name] = csc_matrix((effect.operator.weights, places), shape=shape)
        return areas


@dataclass(frozen=True)
class Partials:
    """Derivatives of all laws by what a state depends on: controls, and data of the line.

    Parameters
    ----------
    tangent : StationaryTangent
    own : sequence of bool
        Rollers with a coefficient of friction of their own.
    """

    tangent: StationaryTangent
    own: tuple[bool, ...]

    def __iter__(self) -> Iterator[tuple[str, Explicit]]:
        """Yield parameters by their keys, with the explicit derivative of every effect."""
        shapes = self.by_shapes() if self.tangent.model.strip.kinematics.count == 3 else ()
        for key, explicit in chain(self.by_speeds(), self.by_loads(), self.by_data(), shapes):
            more = self.by_labels(key)
            both = {name: explicit[name] + more[name] for name in explicit.keys() & more.keys()}
            yield key, {**explicit, **more, **both}

    def by_labels(self, key: str) -> Explicit:
        """Derivatives of all that counts by labels, of strip that runs take up to hang deeper."""
        tangent, state = self.tangent, self.tangent.state
        if not (change := tangent.grown(key)).any():
            return {}
        step = DIFFERENCE_STEP / float(np.abs(change).max())

        def law(effect: Any, h: float) -> Array:
            grown = {"strip.growth": state.controls["strip.growth"] + h * change}
            x, controls = effect.operator.apply(state.full), state.controls | grown
            return np.asarray(effect.law(x, None, controls))

        names = [name for name in (*THICKNESS_POWERS, "weight") if name in tangent.parts]
        return {**self._difference(law, names, step), "friction": self.by_passing_labels(key)}

    def _difference(
        self, law: Callable[[Any, float], Array], names: Iterable[str], step: float
    ) -> Explicit:
        """Derivatives of laws of effects, changed by h, by a difference of fourth order."""
        effects = {name: self.tangent.law_part(name).effect for name in names}
        return {
            name: sum((w / step * law(effect, at * step) for at, w in STENCIL), np.array(0.0))
            for name, effect in effects.items()
        }

    def by_passing_labels(self, key: str) -> Array:
        """Derivative of friction, of strip that passes labels with c/g, as by a change of c."""
        tangent, state = self.tangent, self.tangent.state
        part, friction = tangent.law_part("friction"), tangent.friction
        held = {"strip.held": tangent.held(key)}
        g = 1.0 + friction.growth(state.controls)
        seed = np.zeros(part.shape)
        seed[-1] = -(state.strip_speed or 0.0) / g * friction.growth(held)
        return part.orders.derivative(seed)

    def by_speeds(self) -> Iterator[tuple[str, Explicit]]:
        """Speeds enter as those of the strip and of free surfaces do, which are unknowns."""
        tangent, model = self.tangent, self.tangent.model
        part = tangent.law_part("friction")

        def moved(component: int, points: Array) -> Explicit:
            seed = np.zeros(part.shape)
            seed[component, points] = 1.0
            return {"friction": part.orders.derivative(seed)}

        if model.pull is None:
            yield "strip.speed", moved(-1, np.ones(part.shape[-1], dtype=bool))
        for number, roller in enumerate(tangent.friction.roller.members):
            if roller.name not in model.turning:
                points = tangent.areas["friction"][:, [number]].indices
                yield f"rollers.{roller.name}.surface_speed", moved(-2, points)

    def by_loads(self) -> Iterator[tuple[str, Explicit]]:
        """A vector is changed by its length."""
        controls = self.tangent.state.controls
        for name, part in self.tangent.parts.items():
            effect = part.effect
            if isinstance(effect, FollowerLoad):
                x = effect.operator.apply(self.tangent.state.full)
                yield effect.control, {name: np.asarray(effect.unit_law(x, controls))}
            elif type(effect) is LoadEffect:
                given = controls[effect.control]
                if (size := float(np.linalg.norm(given))) > 0.0:
                    unit = {effect.control: given / size}
                    yield effect.control, {name: effect.force(self.tangent.state.full, None, unit)}
            elif isinstance(effect, GrownWeight):
                size = float(np.linalg.norm(controls["gravity"]))
                yield "gravity", {name: self._of_law(name) / size}
            elif isinstance(effect, Drives):
                for roller, row in zip(effect.names, np.diag(-1.0 / effect.radii), strict=True):
                    yield f"rollers.{roller}.torque", {name: row[None]}

    def by_data(self) -> Iterator[tuple[str, Explicit]]:
        """Friction is proportional to f, the membrane to E t, bending to E t³, weight to t."""
        tangent, state = self.tangent, self.tangent.state
        strip, friction = tangent.model.strip, tangent.friction
        unit = replace(friction, coefficients=[0.0 if own else 1.0 for own in self.own])
        x = tangent.law_part("friction").operator.apply(state.full)
        yield "friction.coefficient", {"friction": np.asarray(unit.law(x, None, state.controls))}
        parts = {name: tangent.parts[name] for name in THICKNESS_POWERS if name in tangent.parts}
        elastic = {name: self._of_law(name) for name in parts}
        yield "material.young", {n: e / strip.material.young for n, e in elastic.items()}
        t = strip.thickness
        thicker = {n: THICKNESS_POWERS[n] / t * e for n, e in elastic.items()}
        if "weight" in tangent.parts:
            thicker["weight"] = self._of_law("weight") / t
        if any(roller.half for roller in friction.roller.members):
            thicker |= self._changed(lambda roller, h: replace(roller, half=roller.half + 0.5 * h))
        yield "strip.thickness", thicker

    def _of_law(self, name: str) -> Array:
        """Return the values of a law at its points, or the residual of an effect without one."""
        part = self.tangent.parts[name]
        return part.orders.value if isinstance(part, LawSeries) else part.residual()

    def by_shapes(self) -> Iterator[tuple[str, Explicit]]:
        """Crowns c₂ s², and angles about the vertical through a roller's centre."""

        def crowned(roller: Roller, h: float) -> Roller:
            first, second, *others = (*roller.crown, 0.0, 0.0)[: max(2, len(roller.crown))]
            return replace(roller, crown=(first, second + h, *others))

        def yawed(roller: Roller, h: float) -> Roller:
            x, y, z = roller.axis
            turned = x * np.cos(h) - y * np.sin(h), x * np.sin(h) + y * np.cos(h)
            return replace(roller, axis=(*turned, z))

        half = 0.5 * self.tangent.model.strip.width
        for roller in self.tangent.friction.roller.members:
            yield f"rollers.{roller.name}.crown", self._changed(crowned, roller.name, half**2)
            yield f"rollers.{roller.name}.yaw", self._changed(yawed, roller.name, half)

    def _changed(
        self, change: Callable[[Roller, float], Roller], name: str | None = None, arm: float = 1.0
    ) -> Explicit:
        """Derivative of contact and friction for a change of one roller, or of all.

        Parameters
        ----------
        change : callable
            The roller after a change h.
        name : str, optional
        arm : float
            Gap (m), and slip over the roller's speed (m), for a unit of h.
        """
        tangent, state = self.tangent, self.tangent.state
        speed = max(abs(c.surface_speed) for c in state.contacts.values()) or 1.0
        slip = tangent.friction.law_of_slip.speed / speed
        h = DIFFERENCE_STEP * min(tangent.friction.contact.signorini.width / arm, slip * 0.5 * arm)

        def law(effect: Any, h: float) -> Array:
            roller = effect.roller
            members = [change(r, h) if name in (r.name, None) else r for r in roller.members]
            made = members[0] if roller.which is None else combine(members, roller.which)
            if isinstance(effect, Contact):
                effect = replace(effect, roller=made)
            else:
                effect = replace(effect, contact=replace(effect.contact, roller=made))
            return np.asarray(effect.law(effect.operator.apply(state.full), None, state.controls))

        return self._difference(law, ("contact", "friction"), h)


@dataclass(frozen=True)
class Readings:
    """First orders of what is read off a stationary state.

    Parameters
    ----------
    tangent : StationaryTangent
    key : str
        The parameter that changes by one, or nothing if none does.
    explicit : mapping
        Derivatives of the effects for fixed unknowns.
    change : ndarray, shape (unknowns,)
        Of all unknowns.
    """

    tangent: StationaryTangent
    key: str
    explicit: Explicit
    change: Array

    @cached_property
    def edge_forces(self) -> dict[str, Array]:
        """Changes of the forces on entry and exit (N), (3,) each; see :meth:`State.edge_force`."""
        return {name: self._edge_force(name) for name in ENDS}

    def _edge_force(self, name: str) -> Array:
        tangent, state = self.tangent, self.tangent.state
        strip = tangent.model.strip
        edge, (sums, rows) = strip.edges[name], tangent.edge_rows[name]
        force = strip.kinematics.embed(sums @ tangent.gathered(self.explicit) + rows @ self.change)
        if self.key == f"{name}.force":
            given = state.controls[self.key]
            force = force + given / np.linalg.norm(given) * edge.length
        if f"tension on {name}" in tangent.parts:
            stress = tangent.at_points(f"tension on {name}", self.change, self.explicit)
            operator: Any = tangent.law_part(f"tension on {name}").operator
            force = force - strip.kinematics.embed(stress[:, 0] @ operator.weights)
        return force

    def tension(self, name: str) -> float:
        """Change of the tension of an edge, see :meth:`State.tension`."""
        state, strip = self.tangent.state, self.tangent.model.strip
        edge, sign = strip.edges[name], -1.0 if name == "entry" else 1.0
        if (outward := state.pull_direction(name)) is not None:
            return float(self.edge_forces[name] @ outward) / edge.length
        slope = strip.edge_tangent(name, state.full)
        turn = strip.edge_tangent(name, self.change) - [1.0, 0.0, 0.0]
        force, change = state.edge_force(name), self.edge_forces[name]
        found = change_along_slope(force, change, slope, turn)
        return sign * float(found) / edge.length

    @property
    def heavier(self) -> float:
        """Change of the weight of the strip, as a share of it."""
        if self.key == "gravity":
            return 1.0 / float(np.linalg.norm(self.tangent.state.controls["gravity"]))
        return (self.key == "strip.thickness") / self.tangent.model.strip.thickness

    def blown(self, changed: State) -> Array:
        """Change of :meth:`State.pressure_before` at the places of all passages, (passages, 2, 3).

        Parameters
        ----------
        changed : State
            With the change of all unknowns as its displacements.
        """
        state, strip = self.tangent.state, self.tangent.model.strip
        places = np.array([passage.places for passage in state.passages])
        still = (places - strip.span[0])[..., None] * np.array([1.0, 0.0, 0.0])
        ways = float(state.controls.get("pressure", 0.0)) * (changed.way(places) - still)
        if self.key == "pressure":
            ways = ways + state.way(places)
        return strip.width * turn_upwards(strip, ways)

    def read(self) -> dict[str, float]:
        """Derivatives with respect to the parameter, by what is read off."""
        tangent, state = self.tangent, self.tangent.state
        model, change = tangent.model, self.change
        found = {f"{name}_tension": self.tension(name) for name in ENDS}
        found["strip_speed"] = float(change[model.coupled - 1]) + (self.key == "strip.speed")
        pushes, drags = (tangent.on_rollers(name, change, self.explicit) for name in tangent.areas)
        count, places = model.strip.kinematics.count, list(tangent.order.values())
        each = -model.strip.kinematics.embed(pushes + drags[:count]).T[places]
        passages = state.passages
        passed = np.repeat(range(len(passages)), [len(passage.names) for passage in passages])
        gained = np.zeros((len(passages), 3))
        np.add.at(gained, passed, each)
        behind = self.edge_forces["entry"] + np.cumsum(gained, axis=0)
        rises = np.stack([behind - gained, behind], axis=1) + self.heavier * tangent.weights
        if (held := tangent.held(self.key)).any() and tangent.hanging is not None:
            longer = tangent.hanging.growth.up_to(tangent.arcs.ravel(), held)
            rises += state.weight_of(longer).reshape(rises.shape)
        changed = replace(state, full=change)
        rises += self.blown(changed)
        pulls, slopes = (np.array([getattr(p, n) for p in passages]) for n in ("pulls", "slopes"))
        turns = np.array([changed.mean_across("u_x", p.places) for p in passages])
        tensions = -change_along_slope(pulls, rises, slopes, turns)[passed] / model.strip.width
        radii = np.array([roller.radius for roller in tangent.friction.roller.members])
        given = [float(self.key == f"rollers.{name}.surface_speed") for name in tangent.order]
        speeds = np.where(tangent.turning < 0, given, change[tangent.turning])
        columns = [*tensions.T, (radii * drags[-1])[places], speeds]
        if count == 3:
            columns.append(changed.offset(tangent.arcs[passed, 0]))
        words = ("tension_in", "tension_out", "torque", "surface_speed", "offset")[: len(columns)]
        for name, values in zip(tangent.order, np.transpose(columns).tolist(), strict=True):
            first = 2 * (state.rollers[name].tension_in is None)  # there is no tension
            found |= {f"{name}_{w}": v for w, v in zip(words[first:], values[first:], strict=True)}
        if count == 3:
            found["least_membrane_force"] = self.least_membrane_force()
        return found

    def least_membrane_force(self) -> float:
        """Change of the least principal membrane force of the free spans (N/m): λ' = e · N' e."""
        state, strip = self.tangent.state, self.tangent.model.strip
        membrane = state.membrane
        assert membrane is not None
        free = np.any([span.points for span in free_spans(state)], axis=0)
        forces = membrane.at(state.full, state.controls)
        values, directions = principal_forces(forces)
        worst = int(np.where(free, values[:, 0], np.inf).argmin())
        changed = membrane.change(state.full, self.change, state.controls)[:, :, worst]
        if (grown := self.tangent.grown(self.key)).any():
            at, step = state.controls["strip.growth"], DIFFERENCE_STEP / float(np.abs(grown).max())
            sides = [state.controls | {"strip.growth": at + h * grown} for h in (-step, step)]
            before, after = (membrane.at(state.full, c)[:, :, worst] for c in sides)
            changed = changed + (after - before) / (2.0 * step)
        if self.key in ("material.young", "strip.thickness"):
            data = strip.material.young, strip.thickness
            changed = changed + forces[:, :, worst] / data[self.key == "strip.thickness"]
        e = directions[worst, :, 0]
        return float(e @ changed @ e)


def change_along_slope(force: Array, change: Array, slope: Array, turn: Array) -> Array:
    """Change of the component of a force along a slope that turns, vectors last."""
    size = np.linalg.norm(slope, axis=-1, keepdims=True)
    along = slope / size
    turned = (turn - along * (along * turn).sum(axis=-1, keepdims=True)) / size
    return np.asarray((change * along + force * turned).sum(axis=-1))


def sensitivities(
    state: State, own: Iterable[bool], hanging: Hanging | None = None
) -> dict[str, dict[str, float]]:
    """Derivatives of what is read off a stationary state, by parameter and reading.

    One factorisation, and one back-substitution for each parameter.

    Parameters
    ----------
    state : State
        Of a steady stage.
    own : iterable of bool
        Rollers that have a coefficient of friction of their own.
    hanging : Hanging, optional
        How labels follow strip that hangs: the ends stay where they are, as in other runs.
    """
    tangent = StationaryTangent(state, hanging)
    return {
        key: Readings(tangent, key, explicit, tangent.change(explicit)).read()
        for key, explicit in Partials(tangent, tuple(own))
    }


@dataclass(frozen=True)
class Oscillation:
    """Small oscillations about a stationary state: (K + i ω C) u = −b.

    K is the tangent of the stationary state, and C = ∂R/∂v.  Material moves with c ∂r/∂X + ∂r/∂t,
    so that friction sees a velocity ∂r/∂t as it sees a change ∂r/∂t / c of the slope ∂r/∂X.

    Parameters
    ----------
    tangent : StationaryTangent
    key : str
        Of the parameter that oscillates, as in the sensitivities.
    explicit : mapping
        Derivatives of the effects with respect to it.
    """

    tangent: StationaryTangent
    key: str
    explicit: Explicit

    @cached_property
    def by_velocity(self) -> Array:
        """Derivative of friction at its points by ∂r/∂t, (count, count + 1, points)."""
        part, count = self.tangent.law_part("friction"), self.tangent.model.strip.count
        inputs, points = part.shape
        unit = np.broadcast_to(np.eye(inputs)[count : 2 * count, :, None], (count, inputs, points))
        g = 1.0 + self.tangent.friction.growth(self.tangent.state.controls)
        c = float(self.tangent.state.strip_speed or 0.0)
        return part.orders.derivative(unit) * (g / c)

    @cached_property
    def rate(self) -> Array:
        """Derivative of friction at its points by the rate of the parameter, (count + 1, points).

        A roller that is yawed moves its surface with w × (r − c), w the vertical.
        """
        tangent, state = self.tangent, self.tangent.state
        operator = tangent.friction.contact.operator
        moved = operator.apply(state.full)
        surface = np.zeros_like(moved)
        for number, roller in enumerate(tangent.friction.roller.members):
            if self.key == f"rollers.{roller.name}.yaw":
                seen = tangent.areas["friction"][:, [number]].indices
                centre = state.controls[f"rollers.{roller.name}.centre"]
                x, y, _ = operator.reference + moved - centre[:, None]
                surface[:2, seen] = -y[seen], x[seen]
        return -np.einsum("ijp,ip->jp", self.by_velocity, surface)

    @cached_property
    def matrices(self) -> tuple[csc_matrix, csc_matrix, Array]:
        """K and C over the free unknowns, and factors that equilibrate them."""
        tangent, model = self.tangent, self.tangent.model
        part, count = tangent.law_part("friction"), model.strip.count
        derivative = np.zeros((part.shape[0], *self.by_velocity.shape[1:]))
        derivative[:count] = self.by_velocity
        blocks = model.pattern.zeros(model.others)
        part.operator.add_tangent(derivative, model.pattern, blocks)
        resistance = tangent.series.restricted(model.closed_rows(blocks), tangent.free)
        both = tangent.matrix, resistance
        k, c = (m.assembled() if isinstance(m, Bordered) else m for m in both)
        return k, c, equilibrate(k)

    def at(self, omega: float) -> dict[str, complex]:
        """Complex amplitudes of what is read off, for an amplitude of one of the parameter.

        Parameters
        ----------
        omega : float
            Angular frequency ω (rad/s).
        """
        tangent, (k, c, d) = self.tangent, self.matrices
        rate = {"friction": self.rate}
        forces = [tangent.gathered(e) for e in (self.explicit, rate)]
        supports = tangent.state.plan.supports
        static, moving = (supports.gathered(tangent.model.closed(f)) for f in forces)
        matrix = csc_matrix((k + 1j * omega * c).multiply(d[:, None]).multiply(d))
        u = -splu(matrix).solve((static + 1j * omega * moving) * d) * d
        full = supports.change(u.real, 0.0) + 1j * supports.change(u.imag, 0.0)
        moved = tangent.friction.contact.operator
        velocity = 1j * omega * (moved.apply(full.real) + 1j * moved.apply(full.imag))
        rubbing = np.einsum("ijp,ip->jp", self.by_velocity, velocity) + 1j * omega * self.rate
        real = {**self.explicit, "friction": self.explicit.get("friction", 0.0) + rubbing.real}
        first = Readings(tangent, self.key, real, full.real).read()
        second = Readings(tangent, "", {"friction": rubbing.imag}, full.imag).read()
        return {name: complex(first[name], second[name]) for name in first}


def response(state: State, own: Sequence[bool], key: str, omegas: Array) -> dict[str, Array]:
    """Complex amplitudes of what is read off a stationary state over the frequency.

    Parameters
    ----------
    state : State
        Of a steady stage.
    own : sequence of bool
        Rollers that have a coefficient of friction of their own.
    key : str
        Parameter that oscillates: a key of the sensitivities, such as ``rollers.r1.yaw``.
    omegas : ndarray, shape (n,)
        Angular frequencies (rad/s).

    Returns
    -------
    dict
        Reading → amplitudes for an amplitude of one of the parameter, shape (n,).
    """
    tangent = StationaryTangent(state)
    oscillation = Oscillation(tangent, key, dict(Partials(tangent, tuple(own)))[key])
    rows = [oscillation.at(float(omega)) for omega in omegas]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
