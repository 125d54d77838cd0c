"""Effects joined to equations: residual series and one sparse tangent."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csc_matrix

from anmstrip.arrays import Array, Index
from anmstrip.continuation.path import Branch, Recurrence, Timer
from anmstrip.fem.operators import Blocks, Chain, Chained, Eliminated, Pattern
from anmstrip.fem.sampling import remember
from anmstrip.fem.strip import Scales, Strip, Supports
from anmstrip.linalg.direct import Factors
from anmstrip.linalg.solvers import Bordered, Condensed, Joined, Joining
from anmstrip.mechanics.effects import (
    LAW_WIDTH,
    Controls,
    Effect,
    Moment,
    RecordedLaws,
    add_force,
    series_of,
)
from anmstrip.mechanics.plasticity import Plasticity
from anmstrip.mechanics.shell import Membrane
from anmstrip.timestepping.formulas import AffineVelocity

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Friction

WRONG_SPEED_SHARE = 0.01
"""Share of the speed of a roller that hardly anything holds, by which it may be wrong."""

FULL_SLIP_SPEED = 1e3
"""Slip with full friction, to 1e-6 of it, over the speed V_c of the law."""


@dataclass(eq=False, repr=False)
class Model:
    """A strip and the effects that act on it.

    Parameters
    ----------
    strip : Strip
    pattern : Pattern
    effects : sequence of Effect
    scales : Scales
    turning : sequence of str, optional
        Rollers that turn freely: the travels of their surfaces (m) follow the strip's unknowns, in
        steady stages their speeds (m/s).
    pressing : int, optional
        Number of rollers that given forces press on the strip: their shifts (m) follow.
    conveyed : bool, optional
        Whether the unknown after these is the speed (m/s) of strip in steady stages beside its
        control.
    pull : ndarray, shape (unknowns of the strip,), optional
        Weights of the strip's residual whose sum has to vanish for that speed.
    internal : ndarray, shape (internal unknowns,), optional
        Of the unknowns of points' own, which are the last: the force (N) that a rate of 1 stands
        for in their equations.

    Attributes
    ----------
    seconds : dict
        Time spent in every effect so far.
    coupled : int
        Unknowns of the strip, of rollers that turn freely or are pressed, and its speed.
    unknowns : int
        All of them.
    """

    strip: Strip
    pattern: Pattern
    effects: Sequence[Effect]
    scales: Scales
    turning: Sequence[str] = ()
    pressing: int = 0
    conveyed: bool = False
    pull: Array | None = None
    internal: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        strip, self.others = self.strip, len(self.turning) + self.pressing + self.conveyed
        self.coupled = strip.unknowns + self.others
        self.unknowns = self.coupled + len(self.internal)
        self.seconds = {effect.name: 0.0 for effect in self.effects}
        self.value_unknowns = strip.unknowns_of(strip.node_values)
        self.units = np.append(np.repeat(strip.dof_lengths, strip.count), np.ones(self.others))
        self.units = np.append(self.units, self.internal)
        self.laws = RecordedLaws(self.unknowns)
        self._joinings: dict[bytes, Joining] = {}
        self._forces: tuple[Controls | None, dict[bytes, Array]] = None, {}

    def timed(self, effect: Effect) -> Timer:
        """Add the seconds spent inside to those of an effect."""
        return Timer(self.seconds, effect.name)

    def effect(self, name: str) -> Any:
        """Return an effect by its name, None if it does not act."""
        return next((effect for effect in self.effects if effect.name == name), None)

    @property
    def without_rates(self) -> Model:
        """The effects that do not look at the velocity."""
        kept = [effect for effect in self.effects if not effect.rate_dependent]
        return self if len(kept) == len(self.effects) else self.with_effects(kept)

    def with_effects(self, effects: Sequence[Effect]) -> Model:
        """Return the same with other effects."""
        return replace(self, effects=effects)

    def closed(self, total: Array) -> Array:
        """Return a residual with that of the strip's speed, from the one of the strip."""
        if self.pull is not None:
            total[self.coupled - 1] = self.pull @ total[: len(self.pull)]
        return total

    def closed_rows(self, blocks: Blocks) -> Blocks:
        """Return a tangent with the row of the strip's speed, from those of the strip."""
        if self.pull is not None:
            last, n = self.coupled - 1, blocks.strip
            rows, columns, values = blocks.entries
            on, kept = rows < n, rows != last
            pulled = np.append(self.pattern.sum_of_rows(self.pull, blocks), np.zeros(self.others))
            pulled += np.bincount(columns[on], self.pull[rows[on]] * values[on], self.coupled)
            blocks.border = [(rows[kept], columns[kept], values[kept])]
            blocks.add(last, np.arange(self.coupled), pulled)
        return blocks

    @cached_property
    def wider(self) -> Model:
        """The same for laws of other widths, whose programs are others."""
        model = self.with_effects(self.effects)
        model.seconds = self.seconds
        return model

    def joining(self, chain: Chain, matrix: csc_matrix, free: Index) -> Joining:
        """Assembler over the free unknowns and those that are carried along, remembered."""
        key = free.tobytes()
        if key not in self._joinings:
            n = self.strip.unknowns
            every = np.concatenate([free, np.arange(n, len(chain.steps))])
            place = np.full(len(chain.steps) + 1, -1)  # the last for what is no unknown
            place[every] = np.arange(len(every))
            order: Index = np.lexsort((every >= n, chain.steps[every]))
            rows, columns = place[chain.rows], place[chain.columns]
            at = np.bincount(2 * chain.steps[every] + (every >= n))
            ends = np.cumsum(at).reshape(-1, 2)
            self._joinings[key] = Joining(matrix, rows, columns, order, ends)
        return self._joinings[key]

    def force(
        self, full: Array, velocity: Array | None, controls: Controls, control: float
    ) -> Array:
        """Residual of all unknowns at λ in plain numbers: internal minus external forces.

        Remembered for the latest states under the same controls: by that of its end a branch is
        accepted, and then reactions are read off.
        """

        def found(_: Index) -> Array:
            state, values = (full, velocity, control), controls.at(control)
            total = self.laws.begin(full, velocity)
            for effect in self.effects:
                with self.timed(effect):
                    add_force(effect, state, values, controls, self.laws)
            return self.closed(total).copy()

        if self._forces[0] is not controls:
            self._forces = controls, {}
        key = np.concatenate([full, [control], *([] if velocity is None else [velocity])])
        return remember(self._forces[1], key, found)

    def tension_error(
        self, full: Array, change: Array, controls: Mapping[str, Any] = {}, moments: bool = True
    ) -> float:
        """Root mean square of the membrane forces of a change, over the tension scale.

        Or of the forces and moments of layers that can yield, if they are larger and count.
        """
        error = 0.0
        for effect in self.effects:
            if isinstance(effect, Membrane):
                forces = effect.change(full, change, controls)
                weights = effect.operator.weights
                mean = np.einsum("abp,abp,p->", forces, forces, weights) / weights.sum()
                error = max(error, float(np.sqrt(mean)) / self.scales.membrane)
            elif moments and isinstance(effect, Plasticity):
                error = max(error, effect.stress_error(full, change, self.scales.membrane))
        return error


@dataclass(eq=False, repr=False)
class Equilibrium:
    """R(u, λ) = 0 of the free unknowns; a :class:`~anmstrip.continuation.path.Equations`.

    Parameters
    ----------
    model : Model
    supports : Supports
    controls : Controls
    velocity : AffineVelocity, optional
        v of the free unknowns as a function of u and λ; needed with friction.
    moving : ndarray, shape (unknowns,), optional
        Velocity of what is held and moved, zero elsewhere.

    Attributes
    ----------
    metric : ndarray, shape (free,)
        Of changes of position: mean square over the nodes, over the length scale.
    ahead : tuple or None
        u, λ, order, series and factors of the next branch where they were needed before it.
    """

    model: Model
    supports: Supports
    controls: Controls
    velocity: AffineVelocity | None = None
    moving: Array | None = None
    ahead: tuple[Array, float, int, Recurrence, Factors] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        model, free, units = self.model, self.supports.free, self.model.units.copy()
        if self.velocity is not None:
            units[model.coupled :] /= self.velocity.rate
        self.free_units, nodes = 1.0 / units[free], len(model.strip.node_values)
        seen = np.isin(free, model.value_unknowns)
        self.metric: Array = seen / (model.scales.length**2 * nodes)

    def full_velocity(self, u: Array, control: float) -> Array | None:
        """Velocity of all unknowns, or ``None`` where nothing depends on it."""
        if self.velocity is None:
            return None
        whole = np.zeros(self.model.unknowns) if self.moving is None else self.moving.copy()
        whole[self.supports.free] = self.velocity(u, control)
        return whole

    def unaccelerated(self) -> Array | None:
        """Free unknowns at the end of a step in time whose velocities stay; None without any."""
        if self.velocity is None or not self.velocity.slope.any():
            return None
        return -self.velocity.slope / self.velocity.rate

    def with_wider_laws(self, width: float) -> Equilibrium:
        """The same with laws that set in over so many times the gap and the slip speed."""
        model = self.model.with_effects([e.sharper(1.0 - width) for e in self.model.effects])
        return replace(self, model=model)

    def smoother(self, width: float) -> tuple[Equilibrium, Equilibrium] | None:
        """The same with corners so many times as wide in velocity, and their narrowing at λ = 1.

        The logarithm of the width falls evenly.  None where no law has such corners.
        """
        if not any(effect.has_corners for effect in self.model.effects):
            return None
        model, wide = self.model.wider, np.array(np.log(width))
        before = replace(self.controls, start={**self.controls.start, LAW_WIDTH: wide})
        wider = replace(self, model=model, controls=before)
        still = np.zeros_like(self.supports.slope)
        end = self.supports.start + self.supports.slope
        supports = replace(self.supports, start=end, slope=still, bow=None)
        velocity = self.velocity
        if velocity is not None:
            base = velocity.base + velocity.slope
            velocity = replace(velocity, base=base, slope=np.zeros_like(base))
        controls = Controls(before.at(1.0), {LAW_WIDTH: -wide})
        return wider, replace(wider, supports=supports, controls=controls, velocity=velocity)

    def recurrence(self, u: Array, control: float, order: int) -> EquilibriumSeries:
        """Start the series at a point."""
        return EquilibriumSeries(self, u, control, order)

    def known(self, u: Array, control: float, order: int) -> tuple[Recurrence, Factors] | None:
        """Return the series and factors ``ahead`` if they are of this point, and forget them."""
        ahead, self.ahead = self.ahead, None
        if ahead is None or ahead[1:3] != (control, order) or not np.array_equal(ahead[0], u):
            return None
        return ahead[3:]

    def residual(self, u: Array, control: float) -> Array:
        """Imbalance of the free unknowns, shape (free,)."""
        state = self.supports.full(u, control), self.full_velocity(u, control)
        return self.supports.gathered(self.model.force(*state, self.controls, control))

    def interior_check(self, branch: Branch) -> float | None:
        """Return where on a branch the strip crosses a roller that neither end shows."""

        def states(shares: Array) -> Iterator[Moment]:
            for u, control in zip(*branch.many(shares * branch.length), strict=True):
                yield self.supports.full(u, control), None, self.controls.at(control)

        for effect in self.model.effects:
            if (share := effect.crossing(states)) is not None:
                return share * branch.length
        return None

    def resistance(self, u: Array, control: float) -> Callable[[Array], Array]:
        """∂R/∂v at a state, applied to changes of the free unknowns' velocity."""
        full, velocity = self.supports.full(u, control), self.full_velocity(u, control)
        given = (full, velocity, control), self.controls, self.model.laws
        effects = (effect for effect in self.model.effects if effect.rate_dependent)
        parts = [series_of(effect, 1, *given) for effect in effects]
        still = np.zeros_like(full)

        def applied(change: Array) -> Array:
            moved = np.zeros_like(full)
            moved[self.supports.free] = change
            total = still.copy()
            for part in parts:
                if (force := part.derivative(still, moved, 0.0)) is not None:
                    total[: len(force)] += force
            return total[self.supports.free]

        return applied

    def sharpenings(self, u: Array, control: float) -> list[Array]:
        """Derivatives of the residual by a share by which laws come nearer to sharp ones.

        Of contact and friction, and of the flow law where there is one.
        """
        full, values = self.supports.full(u, control), self.controls.at(control)
        velocity, effects = self.full_velocity(u, control), self.model.effects
        laws = [effect.sharpening(full, velocity, values) for effect in effects]
        flow = [effect.less_rate_dependent(full, values) for effect in effects]
        kinds, found = [laws, flow] if any(f is not None for f in flow) else [laws], list[Array]()
        for forces in kinds:
            total = np.zeros(self.model.unknowns)
            for force in (force for force in forces if force is not None):
                total[: len(force)] += force
            found.append(self.supports.gathered(self.model.closed(total)))
        return found

    def turned(self, u: Array) -> float:
        """Friction that may be wrong for slip that turns round until λ = 1, u, over all forces."""
        moments = [
            (self.supports.full(w, c), self.full_velocity(w, c), self.controls.at(c))
            for w, c in ((np.zeros_like(u), 0.0), (u, 1.0))
        ]
        reversed_friction = sum(e.reversed_friction(*moments) for e in self.model.effects)
        return reversed_friction / self.model.scales.force

    def let_turn(self, u: Array, resistance: Callable[[Array], Array], tolerance: float) -> Array:
        """Return u at λ = 1 where rollers that hardly anything holds turn as their forces ask.

        Where friction and bearing of a free roller together are below the tolerance, no speed of it
        is refused; its own torque, which rises with its speed, tells the right one.
        """
        drives = self.model.effect("drives")
        if (velocity := self.velocity) is None or drives is None:
            return u
        count, unit = len(self.model.turning), drives.speed
        own = np.searchsorted(self.supports.free, self.model.strip.unknowns + np.arange(count))
        begun, each = velocity(u, 1.0)[own], np.zeros_like(u)

        def turned(speeds: Array) -> Array:
            moved = u.copy()
            moved[own] += (speeds - begun) / velocity.rate
            return moved

        def force(speeds: Array) -> Array:
            return self.residual(turned(speeds), 1.0)[own]

        each[own] = 1.0
        off = np.abs(force(begun) / resistance(each)[own])
        if not np.any(off > np.maximum(WRONG_SPEED_SHARE * np.abs(begun), unit)):
            return u
        others = np.delete(velocity(u, 1.0), own)  # their own may be hundreds of m/s
        fast = FULL_SLIP_SPEED * unit + 2.0 * float(np.abs(others).max())
        least, most = (force(np.full(count, end)) for end in (-fast, fast))
        loose = (least < 0.0) & (most > 0.0)
        loose &= most - least < 2.0 * tolerance * self.model.scales.force
        if not loose.any():
            return u
        from scipy.optimize import brentq

        speeds = begun.copy()
        for k in np.flatnonzero(loose).tolist():

            def own_force(speed: float, k: int = k) -> float:
                return float(force(np.where(np.arange(count) == k, speed, begun))[k])

            speeds[k] = brentq(own_force, -fast, fast, xtol=1e-6 * unit)
        return turned(speeds)

    def imbalance(self, residual: Array) -> float:
        """Norm of nodal forces (moments over element size) over the force scale."""
        with np.errstate(over="ignore"):  # of orders that grow beyond all numbers
            forces = residual / self.free_units
            return math.sqrt(forces.dot(forces)) / self.model.scales.force

    def round_off(self, u: Array, control: float) -> float:
        """Imbalance that a change of the last digits of displacements and tangent vectors makes."""
        full, velocity = self.supports.full(u, control), self.full_velocity(u, control)
        signs = np.where(np.arange(len(full)) % 3 == 1, -1.0, 1.0)
        slopes = full + self.model.strip.flat_slopes(len(full))
        moved = full + np.finfo(float).eps * signs * slopes
        forces = [self.model.force(x, velocity, self.controls, control) for x in (moved, full)]
        return self.imbalance(self.supports.gathered(forces[0] - forces[1]))


class EquilibriumSeries:
    """Orders of R at one point; a :class:`~anmstrip.continuation.path.Recurrence`."""

    def __init__(self, equations: Equilibrium, u: Array, control: float, order: int) -> None:
        self.equations, self.model = equations, equations.model
        self.free = equations.supports.free
        at = equations.supports.full(u, control), equations.full_velocity(u, control), control
        given = at, equations.controls, self.model.laws
        self.parts = [series_of(effect, order, *given) for effect in self.model.effects]
        self.residual = self._summed(lambda part: part.residual())
        self.curved = [part for part in self.parts if part.curved]

    def _summed(self, contribution: Any) -> Array:
        total = np.zeros(self.model.unknowns)
        for part in self.parts:
            with self.model.timed(part.effect):
                if (found := contribution(part)) is not None:
                    total[: len(found)] += found
        return self.equations.supports.gathered(self.model.closed(total))

    def tangent(self) -> csc_matrix | Bordered | Condensed:
        """∂R/∂u + rate ∂R/∂v over the free unknowns; those of rollers and speed are a border.

        Where laws overflow it is not finite, which the factorisation tells.
        """
        blocks = self.model.pattern.zeros(self.model.others)
        rate = 0.0 if (velocity := self.equations.velocity) is None else velocity.rate
        for part in self.parts:
            with self.model.timed(part.effect), np.errstate(over="ignore", invalid="ignore"):
                part.add_tangent(self.model.pattern, blocks, rate)
        blocks = self.model.closed_rows(blocks)
        coupled = self.free[self.free < self.model.coupled]
        matrix = self.restricted(blocks, coupled)
        if blocks.internal is None:
            return matrix
        if isinstance(blocks.internal, Chained):
            matrix = self._joined(matrix, blocks.internal, coupled)
        return self._condensed(matrix, blocks.internal, coupled)

    def restricted(self, blocks: Blocks, coupled: Index) -> Any:
        """Return a tangent over free unknowns, from its blocks."""
        if (joint := self.equations.supports.joint) is None:
            return self.model.pattern.restricted(coupled).matrix(blocks)
        chosen, n = np.union1d(coupled, joint.exit), self.model.strip.unknowns
        matrix = self.model.pattern.restricted(chosen).matrix(blocks)
        return joint.folded(matrix, chosen[chosen < n], coupled[coupled < n])

    def _joined(self, matrix: Any, part: Chained, coupled: Index) -> Joined:
        """Return the tangent with those of the points' own unknowns that are kept."""
        model, chain, values = self.model, part.operator.chain, part.values
        inner = matrix.inner if isinstance(matrix, Bordered) else matrix
        strip, pull = model.strip.unknowns, np.zeros(1 + len(chain.steps))
        if model.pull is not None:
            on = np.flatnonzero(chain.rows < strip)  # entries of forces, some of no unknown
            pulled = model.pull[chain.rows[on]] * values[on]
            pull[:] = np.bincount(1 + chain.columns[on], pulled, len(pull))
        joining = model.joining(chain, inner, coupled[coupled < strip])
        return joining.joined(matrix, values, pull[1 + strip :])

    def _condensed(self, matrix: Any, part: Eliminated, coupled: Index) -> Condensed:
        """Return the tangent whose points have unknowns of their own."""
        model = self.model

        def condensed(right: Array, solved: Array) -> Array:
            total, (forces, kept) = np.zeros(model.coupled), part.reduced(solved)
            total[: len(forces)] = forces
            return np.concatenate([right - model.closed(total)[coupled], kept])

        def recovered(x: Array, solved: Array) -> Array:
            full = np.zeros(model.coupled)
            full[coupled] = x[: len(coupled)]
            return part.recovered(full, x[len(coupled) :], solved)

        return Condensed(matrix, len(coupled), part.solved, condensed, recovered)

    def _changes(self, u: Array, control: float) -> tuple[Array, Array | None]:
        change = self.equations.supports.change(u, control)
        velocity = self.equations.velocity
        if velocity is None:
            return change, None
        rate = np.zeros_like(change)
        rate[self.free] = velocity.rate * u + control * velocity.slope
        return change, rate

    def control_derivative(self) -> Array:
        """∂R/∂λ over the free unknowns."""
        u, v = self._changes(np.zeros(len(self.free)), 1.0)
        return self._summed(lambda part: part.derivative(u, v, 1.0))

    def advance(self, k: int) -> Array:
        """Order k of R for u_k = 0 and λ_k = 0."""
        total = self.model.laws.total
        total.fill(0.0)
        for part in self.curved:
            with self.model.timed(part.effect):
                part.advance(k, total)
        return self.equations.supports.gathered(self.model.closed(total))

    def correct(self, k: int, u: Array, control: float) -> None:
        """Fix order k of the unknowns in all effects."""
        change, rate = self._changes(u, control)
        self.model.laws.set_motion(change, rate)
        for part in self.curved:
            with self.model.timed(part.effect):
                part.correct(k, change, rate, control)


@dataclass(frozen=True)
class Motion:
    """A stage in time; a :class:`~anmstrip.timestepping.formulas.RateEquations`.

    Parameters
    ----------
    model : Model
    supports, controls
        Of the whole stage, λ = 0 at its start and 1 at its end.
    start, duration : float
        Times (s).
    before : mapping, optional
        Controls that jump as the stage begins, with their values before: the path of its first
        step leads from these, with which the velocities of the state before are in equilibrium.
    """

    model: Model
    supports: Supports
    controls: Controls
    start: float
    duration: float
    before: Mapping[str, Array] = field(default_factory=dict)

    def during(self, t: float, h: float, velocity: AffineVelocity, about: Array) -> Equilibrium:
        """Equations of one time step, for increments from ``about``."""
        begin, share = (t - self.start) / self.duration, h / self.duration
        start, zero = self.supports.full(about, begin), np.zeros_like(about)
        change = self.supports.full(zero, begin + share) - self.supports.full(zero, begin)
        supports = Supports(self.supports.free, start, change)
        values, slope = self.controls.at(begin), dict[str, Any]()
        for name in self.controls.slope:  # over the step, at whose end alone velocities count
            rates = (self.controls.rate(name, at) for at in (begin, begin + share))
            slope[name] = 0.5 * share * sum(rates)
        if t == self.start:
            slope |= {name: values[name] - old for name, old in self.before.items() if h > 0.0}
            values |= self.before
        controls = Controls(values, slope)
        moving = self.supports.rate(begin + share) / self.duration
        return Equilibrium(self.model, supports, controls, velocity, moving)

    def dragged(self, t: float, u: Array, v: Array, time: float) -> Motion | None:
        """The same with a drag as large as tension/length at a speed of length/time."""
        if not v.any():
            return None
        from anmstrip.fem.sampling import ContactOperator
        from anmstrip.mechanics.loads import Drag

        model, size = self.model, self.model.scales
        drag = Drag(ContactOperator(model.strip), size.tension * time / size.length**2)
        return replace(self, model=model.with_effects([*model.effects, drag]))

    def error(self, u: Array, change: Array) -> float:
        """Largest error in position over the length scale: it is carried along."""
        moved = np.zeros(self.model.unknowns)
        moved[self.supports.free] = change
        return float(np.abs(moved[self.model.value_unknowns]).max()) / self.model.scales.length

    def fading_error(self, u: Array, change: Array, *, moments: bool = True) -> float:
        """Error in membrane force over the tension scale, or in moments: slip lets it relax."""
        full, moved = self.supports.start.copy(), np.zeros(self.model.unknowns)
        full[self.supports.free], moved[self.supports.free] = u, change
        return self.model.tension_error(full, moved, self.controls.start, moments)

    def abrupt_error(self, u: Array, change: Array) -> float:
        """Error in membrane force, where slip changes it from one moment to the next."""
        if not any(effect.has_corners for effect in self.model.effects):
            return 0.0
        return self.fading_error(u, change, moments=False)


@dataclass(frozen=True)
class StageProblem:
    """One stage, ready to be solved: λ = 0 is its start, λ = 1 its end.

    Attributes
    ----------
    name : str
    start, duration : float
        s.
    model : Model
    supports : Supports
    controls : Controls
    in_time : bool
        Whether velocities matter; else the stage is rate-free.
    steady : bool
        Whether strip moves through its states, which are stationary.
    fed : bool
        Whether material passes labels that stay, in time; the last unknown is the length passed.
    """

    name: str
    start: float
    duration: float
    model: Model
    supports: Supports
    controls: Controls
    in_time: bool
    steady: bool = False
    fed: bool = False

    def equations(
        self, velocity: AffineVelocity | None = None, moving: Array | None = None
    ) -> Equilibrium:
        """Equations of the free unknowns; see :class:`Equilibrium` for velocities."""
        return Equilibrium(self.model, self.supports, self.controls, velocity, moving)

    @property
    def fastest(self) -> float:
        """Largest speed (m/s) that is given to rollers, ends and strip."""
        given = (self.controls.at(share) for share in (0.0, 1.0))
        speeds = (abs(float(v)) for at in given for key, v in at.items() if key.endswith("speed"))
        return max(speeds, default=0.0)

    @property
    def friction(self) -> Friction | None:
        """Friction of the strip on its rollers, if it acts."""
        return self.model.effect("friction")

    def transport(self, full: Array, control: float) -> Array | None:
        """Velocities in a stationary state, of strip and free rollers; None of another stage.

        Shape (unknowns,).
        """
        if not self.steady:
            return None
        growth = self.controls.at(control).get("strip.growth", 1.0)
        velocity, model = self.carried(full, self.strip_speed(full, control) / growth), self.model
        first, count = model.strip.unknowns, len(model.turning)
        still = np.zeros(model.unknowns - first - count)
        return np.concatenate([velocity, full[first : first + count], still])

    def carried(self, full: Array, speed: Any) -> Array:
        """Velocity c ∂r/∂X of strip that moves through its own shape, (unknowns of the strip,)."""
        from anmstrip.mechanics.transport import transport_velocity

        return transport_velocity(self.model.strip, self.model.pattern, full, speed)

    def strip_speed(self, full: Array, control: float) -> float:
        """Speed of the strip in a state of a steady stage (m of unstressed strip per second)."""
        return float(self.controls.at(control)["strip.speed"] + full[self.model.coupled - 1])

    def continues(self, past: StageProblem, *, smoothly: bool = False) -> bool:
        """Whether a stage in time goes on where another ended, with no jump of a velocity.

        A velocity jumps with the rate of any control but a surface speed, which is one itself:
        an acceleration jumps with that, and the stage does not go on smoothly.
        """
        if not (self.in_time and past.in_time):
            return False
        if not np.array_equal(self.supports.free, past.supports.free):
            return False
        if not np.allclose(self.moving(0.0), past.moving(1.0), rtol=1e-9, atol=0.0):
            return False
        names = {*self.controls.slope, *past.controls.slope}
        return all(
            np.allclose(self.rate(name), past.rate(name, 1.0), rtol=1e-9, atol=0.0)
            for name in names
            if smoothly or not name.endswith((".surface_speed", ".passing"))
        )

    def before(self, past: StageProblem | None) -> dict[str, Array]:
        """Velocities of rollers that jump as this stage begins, with their values before."""
        then = past.controls.at(1.0) if past is not None and past.in_time else {}
        moving = (".velocity", ".drift", ".taking_up")
        now = {n: v for n, v in self.controls.start.items() if n.endswith(moving)}
        velocities = {name: then.get(name, np.zeros_like(v)) for name, v in now.items()}
        return {name: v for name, v in velocities.items() if np.any(v != now[name])}

    @property
    def still(self) -> bool:
        """Whether it asks for nothing to move or to change in time."""
        given = (".surface_speed", ".passing", ".speed")
        speeds = [value for name, value in self.controls.start.items() if name.endswith(given)]
        held = [*self.moving(0.0), *self.moving(1.0)]
        return not (self.controls.slope or np.any(held) or np.any(speeds))

    def reversals(self, slow: float) -> list[float]:
        """Times (s) at which surfaces that turn round in the stage have slowed down to a speed.

        Also those that come to rest at its end, where rollers turn freely: their bearings brake up
        to the last instant.
        """
        shares = set()
        for name, slope in self.controls.slope.items():
            start = self.controls.start[name]
            if not name.endswith(".surface_speed") or abs(start) <= slow:
                continue
            end = -np.sign(start) * (start + slope)
            if end > slow or (self.model.turning and abs(end) <= slow):
                shares.add(float((abs(start) - slow) / abs(slope)))
        return [self.start + share * self.duration for share in sorted(shares)]

    def rate(self, name: str, control: float = 0.0) -> Any:
        """Rate of a control at λ (its unit per s), 0 if it stands still."""
        return self.controls.rate(name, control) / self.duration

    def moving(self, control: float) -> Array:
        """Velocities of what is held (m/s), zero elsewhere, shape (unknowns,)."""
        return self.supports.rate(control) / self.duration

    def pull_at_exit(self, control: float) -> float:
        """Given pull along x at the exit (N/m)."""
        now = self.controls.at(control)
        return float(now.get("exit.force", np.zeros(3))[0]) + float(now.get("exit.tension", 0.0))

    @property
    def pulls_slack_strip(self) -> bool:
        """Whether a stage that begins with flat strip is the first to pull it.

        Slack it has no transverse stiffness, but its uniformly stretched state is known: there the
        path of all else that the stage brings starts, see :attr:`pulled`.
        """
        still = not (self.in_time or self.steady or np.any(self.supports.slope))
        return still and self.pull_at_exit(0.0) <= 0.0 < self.pull_at_exit(1.0)

    @property
    def pulled(self) -> StageProblem:
        """The stage with the pull along x at the exit that it ends with from its start."""
        if self.pull_at_exit(0.0) == self.pull_at_exit(1.0):
            return self
        start, slope = dict(self.controls.start), dict(self.controls.slope)
        for name in {"exit.force", "exit.tension"} & slope.keys():
            along = slope[name] * (np.eye(3)[0] if np.ndim(slope[name]) else 1.0)
            start[name], slope[name] = start[name] + along, slope[name] - along
            if not np.any(slope[name]):
                del slope[name]
        return replace(self, controls=Controls(start, slope))
