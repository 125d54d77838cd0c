"""Effects, of which a residual is the sum: operator, law, weights, and their orders as series."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy.sparse import csr_matrix

from anmstrip.arrays import Array
from anmstrip.fem.geometry import Kinematics
from anmstrip.fem.operators import Blocks, Part, Pattern
from anmstrip.fem.sampling import CACHE_SIZE
from anmstrip.taylor.program import COMPILED
from anmstrip.taylor.series import Series, record
from anmstrip.taylor.tape import Tape

if TYPE_CHECKING:
    from anmstrip.mechanics.compiled import CompiledLaw

SHARPENING_STEP = 1e-4
"""Share in the difference that tells what sharper laws would do: its error is of the order of its
square and, by round-off, of 1e-16 over it."""


class Operator(Protocol):
    """L: from unknowns to points."""

    @property
    def points(self) -> int:
        """Number of points."""

    @property
    def matrices(self) -> tuple[list[Part], list[Part]]:
        """L as sparse matrices, and that of which forces are the transposed."""

    def apply(self, full: Array) -> Array:
        """L u."""

    def gather(self, forces: Array) -> Array:
        """Lᵀ w f."""

    def add_tangent(self, derivative: Array, pattern: Pattern, blocks: Blocks) -> None:
        """Add Lᵀ w J L."""


Values = Mapping[str, Any]
"""Values of the controls, by name."""

State = tuple[Array, Array | None, float]
"""Displacements and velocities of all unknowns, and λ."""

Moment = tuple[Array, Array | None, Values]
"""Displacements and velocities of all unknowns, and the values of the controls."""


LAW_WIDTH = "laws.width"
"""Control: logarithm of the width of the corners of laws in velocity over that given, 0 without."""


def scale_speeds(speeds: Any, controls: Values) -> Any:
    """Return speeds (m/s) over the width of the corners: what wider laws see is what these see."""
    return speeds * np.exp(-controls[LAW_WIDTH]) if LAW_WIDTH in controls else speeds


class Effect:
    """One term of the residual R(u, v, controls) of a strip.

    1. ``name`` stands in reports, and ``points`` counts the points of evaluation.
    2. ``force`` is the residual in plain numbers, shape (unknowns,); one that the rollers do not
       feel may end with the unknowns of the strip.
    3. ``rate_dependent`` says that the residual depends on v; stages with such an effect run
       in time.
    4. ``has_corners`` says that its law has corners in velocity, which ``LAW_WIDTH`` widens.
    5. The remaining methods matter to contact and friction; others keep the defaults.
    """

    name: str
    points: int
    rate_dependent: bool = False
    has_corners: bool = False

    def force(self, full: Array, velocity: Array | None, controls: Values) -> Array:
        """Return the residual of all unknowns, shape (unknowns,)."""
        raise NotImplementedError

    @property
    def by_roller(self) -> Mapping[str, Effect]:
        """The parts of an effect of rollers, by the names of the rollers."""
        return {}

    def crossing(self, states: Callable[[Array], Iterable[Moment]]) -> float | None:
        """Return where a step crosses a roller, as a share of it, though neither end shows it.

        Parameters
        ----------
        states : callable
            Shares of the step, shape (m,), to the states there.
        """
        return None

    def reversed_friction(self, before: Moment, after: Moment) -> float:
        """Return the friction (N) of points whose slip has turned round between two states."""
        return 0.0

    def sharper(self, share: float) -> Effect:
        """Return the effect with its law nearer to a sharp one by a share."""
        return self

    def at_speed(self, speed: float) -> Effect:
        """Return the effect with another V_c (m/s) of slip."""
        return self

    def sharpening(self, full: Array, velocity: Array | None, controls: Values) -> Array | None:
        """Return the derivative of the residual by that share; None where no law changes."""
        return None

    def less_rate_dependent(self, full: Array, controls: Values) -> Array | None:
        """Return that by a share that the exponent's inverse loses; None where nothing flows."""
        return None


class LawEffect(Effect):
    """Residual Lᵀ w law(L u, L v, controls): an operator, a pointwise law, and weights.

    A law is a plain function of arrays that also runs on truncated power series; from it follow
    the orders of the residual and the tangent.  A subclass has a ``name``, an ``operator``
    (L and w) and a ``law``.
    """

    operator: Operator

    seeds: Array | None = None
    """Changes of the entries of x, (seeds, entries), of which the operator makes the tangent;
    those of every entry alone, in the shape of x, by default."""

    @property
    def points(self) -> int:  # type: ignore[override]
        """Number of points of the operator."""
        return self.operator.points

    def near(self, full: Array, controls: Values) -> LawEffect:
        """Return the effect on those points where it is not negligible in a state."""
        return self

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Return the generalised stress at the points, of the shape of ``x`` = L u."""
        raise NotImplementedError

    def force(self, full: Array, velocity: Array | None, controls: Values) -> Array:
        """Return Lᵀ w law(L u, L v, controls), shape (unknowns,)."""
        return self.near(full, controls).force_here(full, velocity, controls)

    def force_here(self, full: Array, velocity: Array | None, controls: Values) -> Array:
        """Return the same of all points."""
        operator = self.operator
        v = operator.apply(velocity) if self.rate_dependent and velocity is not None else None
        return operator.gather(self.law(operator.apply(full), v, controls))

    @cached_property
    def sharpened(self) -> tuple[Any, ...]:
        """The effect with laws nearer to sharp by ``± SHARPENING_STEP``."""
        return self.sharper(SHARPENING_STEP), self.sharper(-SHARPENING_STEP)

    def sharpening(self, full: Array, velocity: Array | None, controls: Values) -> Array | None:
        near = self.near(full, controls)
        if near.sharpened[0] is near:
            return None
        more, less = (law.force_here(full, velocity, controls) for law in near.sharpened)
        return (more - less) / (2.0 * SHARPENING_STEP)


@dataclass(frozen=True)
class LinearEffect(Effect):
    """Residual K u, the same scalar matrix K for every component.

    Attributes
    ----------
    name : str
    points : int
        Quadrature points that K was made with.
    block : ndarray, shape (couplings,)
        Entries of K on the pattern.
    pattern : Pattern
    """

    name: str
    points: int
    block: Array
    pattern: Pattern

    def force(self, full: Array, velocity: Array | None, controls: Values) -> Array:
        """Return K u, shape (unknowns of the strip,)."""
        own = full[: self.pattern.scalars * self.pattern.count]
        return (self.matrix @ own.reshape(-1, self.pattern.count)).ravel()

    @cached_property
    def matrix(self) -> csr_matrix:
        """K, shape (scalars, scalars)."""
        p = self.pattern
        return csr_matrix((self.block, (p.row, p.column)), shape=(p.scalars, p.scalars))

    def add_tangent(self, blocks: Blocks) -> None:
        """Add K to the diagonal blocks."""
        for c in range(self.pattern.count):
            blocks.pairs[c, c] += self.block


@dataclass(frozen=True)
class LoadEffect(Effect):
    """Residual −load ⊗ control: a dead force that a vector in space scales.

    Attributes
    ----------
    name : str
    control : str
        Name of the control, a vector (N/m for an edge, m/s² for gravity).
    load : ndarray, shape (scalars,)
        Generalised force of a unit control.
    kinematics : Kinematics
        Which of its components do work.
    """

    name: str
    control: str
    load: Array
    kinematics: Kinematics

    points = 0

    def force(self, full: Array, velocity: Array | None, controls: Values) -> Array:
        """Return minus the load, shape (unknowns,); none without its control."""
        given = controls.get(self.control, np.zeros(3))
        return (self.load[:, None] * -self.kinematics.pick(given)).ravel()

    def add_tangent(self, blocks: Blocks) -> None:
        """Add nothing: it does not look at the unknowns."""


@dataclass(frozen=True)
class Controls:
    """Given quantities: value(λ) = start + λ slope, and few of them + λ² curve.

    What has a curve has a slope.
    """

    start: Mapping[str, Array]
    slope: Mapping[str, Array] = field(default_factory=dict)
    curve: Mapping[str, Array] = field(default_factory=dict)

    def value(self, name: str, control: Any) -> Any:
        """One of them at λ, a number or a series; what does not change stays an array."""
        value = self.start[name]
        if name in self.slope:
            value = value + control * self.slope[name]
        if name in self.curve:
            value = value + control * control * self.curve[name]
        return value

    def at(self, control: Any) -> dict[str, Any]:
        """All of them at λ."""
        return {name: self.value(name, control) for name in self.start}

    def rate(self, name: str, control: float = 0.0) -> Array | float:
        """Derivative of one control with respect to λ."""
        slope = self.slope.get(name, 0.0)
        return slope + 2.0 * control * self.curve[name] if name in self.curve else slope


class AskedControls(Mapping[str, Any]):
    """Controls as a law under record sees them: those that change are inputs.

    Parameters
    ----------
    tape : Tape
        Of the recording.
    given : mapping
    slope : mapping
        Only its names count.

    Attributes
    ----------
    moving : dict
        Name → input, of those that the law asked for.
    constant : dict
        Name → value, of the others that it asked for.
    missing : set of str
        Those that it asked for and that there are not.
    """

    def __init__(self, tape: Tape, given: Mapping[str, Any], slope: Mapping[str, Any]) -> None:
        self.tape, self.given, self.slope = tape, given, slope
        self.moving: dict[str, Series] = {}
        self.constant: dict[str, Any] = {}
        self.missing: set[str] = set()

    def __getitem__(self, name: str) -> Any:
        if name not in self.given:
            self.missing.add(name)
        if name not in self.slope:
            return self.constant.setdefault(name, self.given[name])
        if name not in self.moving:
            self.moving[name] = Series.input(self.tape, self.given[name])
        return self.moving[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.given)

    def __len__(self) -> int:
        return len(self.given)


class RecordedLaw:
    """Program of an effect's law: inputs x, v if the effect looks at it, and moving controls.

    Parameters
    ----------
    effect : LawEffect
    state : tuple
        All unknowns, their velocities, and λ, whose values count where the law decides by them.
    controls : Controls
    laws : RecordedLaws
        Those of the model.
    """

    def __init__(
        self, effect: LawEffect, state: State, controls: Controls, laws: RecordedLaws
    ) -> None:
        self.effect, self.laws = effect, laws
        values, slope = controls.at(state[2]), controls.slope
        kinematic = [effect.operator.apply(x) for x in motions_of(effect, state)]

        def law(x: Series, v: Series | None = None) -> Any:
            self.asked = AskedControls(x.tape, values, slope)
            return effect.law(x, v, self.asked)

        self.program = record(law, *kinematic, points=effect.operator.points, compiled=True)
        self.kinematic = len(kinematic)

    @cached_property
    def compiled(self) -> CompiledLaw | None:
        """Return the way from unknowns to forces, if it is compiled and keeps points apart."""
        program = self.program
        laned = program.output.laned and all(x.laned for x in program.inputs[: self.kinematic])
        if not (COMPILED and (laned or self.effect.operator.points == 1)):
            return None
        from anmstrip.mechanics.compiled import CompiledLaw

        given = self.effect.operator.matrices, self.kinematic, self.effect.seeds
        return CompiledLaw(program, *given, self.laws.motion, self.laws.total)

    def values(self, controls: Controls, control: float) -> list[Any]:
        """Return the values at λ of the controls that are inputs."""
        return [controls.value(name, control) for name in self.asked.moving]

    def at_points(self, u: Array, controls: Values) -> Array:
        """Return the law of displacements, or their functions, at the points, (rows, points)."""
        law, effect = self.compiled, self.effect
        if law is None:
            return np.asarray(effect.law(effect.operator.apply(u), None, controls))
        law.move([controls[name] for name in self.asked.moving], law.given)
        self.laws.set_motion(u, None)
        law.add_force(0, *law.spare)
        return law.found[:, : self.program.points].copy()

    def fits(self, effect: LawEffect, inputs: int, controls: Controls) -> bool:
        """Whether the program holds for an effect with other controls."""
        return (
            effect is self.effect
            and self.program.reusable
            and len(self.program.inputs) == inputs + len(self.asked.moving)
            and self.asked.missing.isdisjoint(controls.start)
            and controls.start.keys() >= self.asked.moving.keys() | self.asked.constant.keys()
            and all(
                name not in controls.slope
                and (controls.start[name] is value or np.array_equal(controls.start[name], value))
                for name, value in self.asked.constant.items()
            )
        )


def motions_of(effect: LawEffect, state: State) -> list[Array]:
    """Displacements, and velocities if the effect looks at them and there are any."""
    full, velocity, _ = state
    return [full] if velocity is None or not effect.rate_dependent else [full, velocity]


class RecordedLaws:
    """Programs of the effects of a model, recorded once for the same points and constants.

    Attributes
    ----------
    motion : ndarray, shape (2, unknowns)
        Where machine code reads values or changes of the unknowns and of their velocities.
    total : ndarray, shape (unknowns,)
        Where it adds forces.
    """

    def __init__(self, unknowns: int) -> None:
        self.latest: dict[str, list[RecordedLaw]] = {}
        self.motion, self.total = np.zeros((2, unknowns)), np.zeros(unknowns)

    def begin(self, u: Array, v: Array | None) -> Array:
        """Return the forces that machine code adds to, none as yet, for such a motion."""
        self.set_motion(u, v)
        self.total.fill(0.0)
        return self.total

    def forces(
        self, u: Array, v: Array | None, add: Callable[..., None], w: tuple[int, int]
    ) -> Array:
        """Return the forces that machine code finds for such a motion, with coefficients ``w``."""
        total = self.begin(u, v)
        add(0, *w)
        return total.copy()

    def set_motion(self, u: Array, v: Array | None) -> None:
        """Set what machine code reads."""
        self.motion[0] = u
        if v is not None:
            self.motion[1] = v

    def known(self, effect: LawEffect, state: State, controls: Controls) -> RecordedLaw | None:
        """The program for an effect at some of its points, if it was recorded."""
        inputs = len(motions_of(effect, state))
        latest = self.latest.setdefault(effect.name, [])
        return next((law for law in latest if law.fits(effect, inputs, controls)), None)

    def of(self, effect: LawEffect, state: State, controls: Controls) -> RecordedLaw:
        """The program for an effect at some of its points."""
        if (law := self.known(effect, state, controls)) is not None:
            return law
        latest = self.latest[effect.name]
        latest.insert(0, RecordedLaw(effect, state, controls, self))
        del latest[CACHE_SIZE:]
        return latest[0]


class EffectSeries:
    """Orders of one effect; left out is what an effect of order 1 at most need not do."""

    effect: Effect
    curved = False  # whether it has orders above 1

    def residual(self) -> Array:
        """Return order 0."""
        raise NotImplementedError

    def derivative(self, u: Array, v: Array | None, control: float) -> Array | None:
        """Return order 1 for changes of the unknowns, their velocities and λ."""
        raise NotImplementedError

    def advance(self, k: int, total: Array) -> None:
        """Add order k of what the lower orders make, shape (unknowns,)."""

    def correct(self, k: int, u: Array, v: Array | None, control: float) -> None:
        """Fix order k of the unknowns."""

    def add_tangent(self, pattern: Pattern, blocks: Blocks, rate: float) -> None:
        """Add ∂R/∂u + rate ∂R/∂v to the blocks."""


class LawSeries(EffectSeries):
    """A pointwise effect."""

    curved = True

    def __init__(self, law: RecordedLaw, order: int, state: State, controls: Controls) -> None:
        self.effect: LawEffect = law.effect
        self.operator, moving = law.effect.operator, law.asked.moving
        kinematic = [self.operator.apply(x) for x in motions_of(law.effect, state)]
        self.in_rate = len(kinematic) > 1
        self.slopes = [controls.rate(name, state[2]) for name in moving]
        values = controls.at(state[2])
        self.orders = law.program.start(*kinematic, *(values[name] for name in moving), order=order)
        self.shape = kinematic[0].shape

    def _changes(self, u: Array, v: Array | None, control: float) -> list[Any]:
        """Changes of the inputs, ``None`` for zero."""
        found = [self.operator.apply(u) if u.any() else None]
        if self.in_rate:
            found.append(None if v is None else self.operator.apply(v))
        return found + [
            control * slope if control and np.any(slope) else None for slope in self.slopes
        ]

    def residual(self) -> Array:
        return self.operator.gather(self.orders.value)

    def derivative(self, u: Array, v: Array | None, control: float) -> Array | None:
        changes = self._changes(u, v, control)
        if all(change is None for change in changes):
            return None
        return self.operator.gather(self.orders.derivative(*changes))

    def advance(self, k: int, total: Array) -> None:
        force = self.operator.gather(self.orders.advance(k))
        total[: len(force)] += force

    def correct(self, k: int, u: Array, v: Array | None, control: float) -> None:
        self.orders.correct(*self._changes(u, v, control))

    def add_tangent(self, pattern: Pattern, blocks: Blocks, rate: float) -> None:
        count, given = int(np.prod(self.shape[:-1])), self.effect.seeds
        changes = (np.eye(count) if given is None else given).reshape(-1, *self.shape[:-1], 1)
        unit = np.broadcast_to(changes, (len(changes), *self.shape))
        derivative = self.orders.derivative(*([unit, rate * unit] if self.in_rate else [unit]))
        if given is None:
            derivative = derivative.reshape(self.shape[:-1] + derivative.shape[1:])
        self.operator.add_tangent(derivative, pattern, blocks)


class CompiledSeries(EffectSeries):
    """A pointwise effect, by machine code, of which every order is one call."""

    curved = True

    def __init__(self, law: RecordedLaw, order: int, state: State, controls: Controls) -> None:
        assert law.compiled is not None
        self.effect: LawEffect = law.effect
        self.operator = law.effect.operator
        self.laws, self.law, program = law.laws, law.compiled, law.program
        self.slopes = [controls.rate(name, state[2]) for name in law.asked.moving]
        self.w = np.empty((program.blocks, program.kept, max(order, 1) + 1, program.lanes))
        self.at = self.w.ctypes.data, self.w.shape[2]
        self.law.move(law.values(controls, state[2]), self.law.given)
        self.force = self.laws.forces(state[0], state[1], self.law.add_force, self.at)
        self.w[:, :, 1] = 0.0

    def residual(self) -> Array:
        return self.force

    def derivative(self, u: Array, v: Array | None, control: float) -> Array | None:
        moves = (self.law.inputs > 1 and v is not None) or any(map(np.any, self.slopes))
        if not (moves or u.any()):
            return None
        self.correct(1, u, v, control)
        return self.laws.forces(u, v, self.law.add_derivative, self.at)

    def advance(self, k: int, total: Array) -> None:
        self.law.add_order(k, *self.at)

    def correct(self, k: int, u: Array, v: Array | None, control: float) -> None:
        if self.slopes:
            moved = [control * slope if control else None for slope in self.slopes]
            self.law.move(moved, self.law.changes)

    def add_tangent(self, pattern: Pattern, blocks: Blocks, rate: float) -> None:
        x, *_ = self.law.program.inputs
        found = self.law.tangent(self.at, rate)
        if self.effect.seeds is None:
            found = found.reshape(x.shape[:-1] + found.shape[1:])
        self.operator.add_tangent(found, pattern, blocks)


class StraightSeries(EffectSeries):
    """An effect that is linear in unknowns and controls: a constant matrix, or a dead load."""

    effect: LinearEffect | LoadEffect

    def __init__(self, effect: LinearEffect | LoadEffect, state: State, controls: Controls) -> None:
        self.effect, self.state, self.controls = effect, state, controls

    def residual(self) -> Array:
        full, velocity, control = self.state
        return self.effect.force(full, velocity, self.controls.at(control))

    def derivative(self, u: Array, v: Array | None, control: float) -> Array | None:
        moved = {name: control * slope for name, slope in self.controls.slope.items()}
        return self.effect.force(u, v, moved)

    def add_tangent(self, pattern: Pattern, blocks: Blocks, rate: float) -> None:
        self.effect.add_tangent(blocks)


def series_of(
    effect: Effect, order: int, state: State, controls: Controls, laws: RecordedLaws
) -> EffectSeries:
    """Return the orders of an effect about a state: all unknowns, their velocities, and λ."""
    full, _, control = state
    if isinstance(effect, LinearEffect | LoadEffect):
        return StraightSeries(effect, state, controls)
    assert isinstance(effect, LawEffect)
    law = laws.of(effect.near(full, controls.at(control)), state, controls)
    kind = LawSeries if law.compiled is None else CompiledSeries
    return kind(law, order, state, controls)


def add_force(
    effect: Effect, state: State, values: Values, controls: Controls, laws: RecordedLaws
) -> None:
    """Add the residual of an effect to what was begun for a state, by its program if it has one."""
    full, velocity, _ = state
    if not isinstance(effect, LawEffect):
        force = effect.force(full, velocity, values)
    else:
        near = effect.near(full, values)
        law = laws.known(near, state, controls)
        if law is not None and law.compiled is not None:
            law.compiled.move(law.values(controls, state[2]), law.compiled.given)
            law.compiled.add_force(0, *law.compiled.spare)
            return
        force = near.force_here(full, velocity, values)
    laws.total[: len(force)] += force
