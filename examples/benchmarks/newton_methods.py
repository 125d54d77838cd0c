"""Newton's method with adaptive steps, as good as we can make it: what the series are measured by.

The same equations, tangents and linear solver as the series have: steps along an arc, backward
Euler in fixed steps of time, and an iteration with stress and pressure of points as unknowns of
their own.  Steps of load are part of the package.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.follow import Pace, PathStep, Settings, follow
from anmstrip.continuation.newton import Corrected, Corrections, Newton, straight_step
from anmstrip.continuation.path import Cost, Equations, Outcome, PathStopped, Recurrence, inner
from anmstrip.equilibrium import Equilibrium
from anmstrip.fem.operators import Blocks, Pattern
from anmstrip.fem.sampling import remember
from anmstrip.fem.strip import Strip
from anmstrip.linalg.direct import Factors, SingularTangentError
from anmstrip.linalg.solvers import LinearSolver
from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.effects import Controls, EffectSeries, RecordedLaws, State, series_of
from anmstrip.mechanics.laws import ContactLaw
from anmstrip.mechanics.roller import Projection
from anmstrip.mechanics.shell import Membrane
from anmstrip.timestepping.formulas import AffineVelocity, RateEquations, StepEquations

Array = NDArray[np.float64]

# steps along an arc ----------------------------------------------------------------


@dataclass(frozen=True)
class RiksSettings:
    """Choices of Newton's method along an arc."""

    tolerance: float = 1e-6  # largest imbalance of a converged state
    first: float = 0.1  # step along the arc
    shortest: float = 1e-6
    sharpest: float = 0.5  # cosine of the largest angle between a step and the path at its ends
    wanted: int = 5  # iterations of a step that the next one is as long as
    most: int = 12  # iterations after which a step is given up
    growth: float = 2.0  # largest ratio of a step to the one before it
    max_steps: int = 1000


def arc_steps(
    equations: Equations,
    u: Array,
    *,
    solver: LinearSolver,
    settings: RiksSettings | None = None,
    target: float = 1.0,
    cost: Cost | None = None,
) -> Iterator[Corrected]:
    """Yield converged states from (u, 0) until the control has reached ``target``.

    A predictor along the tangent of the path is brought back to it in the plane across, with a
    new tangent in every iteration.  Steps that converge easily make the next one longer; those
    that do not, or that turn too far, are halved: without a bound on the angle the method leaps
    to other parts of the path, or goes back.  ``cost`` counts the tangents of all iterations.

    Source: Riks, *An incremental approach to the solution of snapping and buckling problems*,
    Int. J. Solids Struct. 15 (1979).

    Raises
    ------
    PathStopped
        If steps have become too short, or too many.
    """
    settings, cost = settings or RiksSettings(), Cost() if cost is None else cost
    arc = _Arc(equations, solver, settings, cost)
    control, length = 0.0, settings.first
    along = arc.tangent(u, control, (np.zeros_like(u), 1.0))
    for _ in range(settings.max_steps):
        step = arc.corrected(u, control, along, length)
        if step is not None:
            secant = (step.u - u, step.control - control)
            ahead = arc.tangent(step.u, step.control, secant)
            size = np.sqrt(inner(equations, secant[0], secant[0]) + secant[1] ** 2)
            turned = min(inner(equations, secant[0], t) + secant[1] * s for t, s in (along, ahead))
        if step is None or turned < settings.sharpest * size:
            length *= 0.5
            if length < settings.shortest:
                raise PathStopped(Outcome.STALLED, control, "Newton's method does not converge")
            continue
        u, control, along = step.u, step.control, ahead
        ratio = np.sqrt(settings.wanted / max(step.iterations, 1))
        length *= float(min(ratio, settings.growth))
        yield step
        if control >= target:
            return
    raise PathStopped(Outcome.TOO_MANY_STEPS, control)


@dataclass(frozen=True)
class _Arc:
    """Tangents of a path, and corrections in the plane across them."""

    equations: Equations
    solver: LinearSolver
    settings: RiksSettings
    cost: Cost

    def tangent(
        self, u: Array, control: float, forward: tuple[Array, float]
    ) -> tuple[Array, float]:
        """Return the unit tangent of the path, in the sense of the last step."""
        recurrence = self.equations.recurrence(u, control, 1)
        self.cost.factorisations += 1
        factors = self.solver.factorise(recurrence.tangent())
        per_control = -factors.solve(recurrence.control_derivative())
        norm = np.sqrt(inner(self.equations, per_control, per_control) + 1.0)
        if inner(self.equations, forward[0], per_control) + forward[1] < 0.0:
            norm = -norm
        return per_control / norm, 1.0 / norm

    def corrected(
        self, u: Array, control: float, along: tuple[Array, float], length: float
    ) -> Corrected | None:
        """Return the state in the plane across by Newton's iteration; None without convergence."""
        u, control = u + length * along[0], control + length * along[1]
        for iteration in range(self.settings.most + 1):
            with np.errstate(over="ignore", invalid="ignore"):
                recurrence = self.equations.recurrence(u, control, 1)
            self.cost.residuals += 1
            imbalance = self.equations.imbalance(recurrence.residual)
            if imbalance <= self.settings.tolerance:
                return Corrected(u, control, iteration, imbalance)
            if not np.isfinite(imbalance) or iteration == self.settings.most:
                return None
            self.cost.factorisations += 1
            try:
                factors = self.solver.factorise(recurrence.tangent())
            except SingularTangentError:
                return None
            free = -factors.solve(recurrence.residual)
            per_control = -factors.solve(recurrence.control_derivative())
            across = inner(self.equations, along[0], free)
            change = -across / (inner(self.equations, along[0], per_control) + along[1])
            u, control = u + free + change * per_control, control + change
        return None


# unknowns of points' own -------------------------------------------------------------

SHARE = 0.3
"""Of its pressure that a point keeps at least in an iteration: with 0.2 and 0.5 the four sections
of ``newton.py`` take as many tangents, within a tenth."""

NEAR = 0.1
"""Imbalance below which pressures are those of the gaps again: points that leave a roller would
lose theirs by ``SHARE`` in every iteration, up to the last."""

BOUNDS = 1e-250, 1e250
"""Of a pressure (Pa): far from where a law has any, so that it has a gap."""

IMAGINARY = 1e-30
"""Step of a derivative in the complex plane, which has no round-off (Squire & Trapp 1998)."""

OFFSET, SLOPE = "pressure.offset", "pressure.slope"
"""Controls: a and k of the pressure a − k h."""


@dataclass
class Own:
    """Which unknowns are points' own, and their past on the latest strip.

    Attributes
    ----------
    stress, pressure : bool
    balanced, latest : tuple of ndarray or None
        Displacements (unknowns,), and pressures (Pa) of all pairs of a point and a roller, of the
        last state in equilibrium, and of the last iterate.
    """

    stress: bool = True
    pressure: bool = True
    strip: Strip | None = None
    balanced: tuple[Array, Array | None] | None = None
    latest: tuple[Array, Array | None] | None = None
    residual: Array | None = None  # (free,), with the pressures of the last iterate
    laws: RecordedLaws = field(default_factory=lambda: RecordedLaws(0))
    parts: dict[str, dict[bytes, Any]] = field(default_factory=dict)  # effects of such pressures


@dataclass(frozen=True)
class Mixed(Newton):
    """Newton's iteration with membrane stress and pressure as unknowns of points' own.

    They are eliminated point by point, and a state is judged by the residual of the displacements.
    With N̂ = N(u′) + C B(u′) (u − u′), what the last iterate u′ foretold, the geometric stiffness
    is that of N̂; the residual stays (Magisano, Leonetti & Garcea, Comput. Methods Appl. Mech.
    Engrg. 313, 2017).  The law of contact is inverted, and linearised at the pressure that the last
    linear law foretold: a point that has sunk deep keeps a moderate pressure instead of one that
    is exponentially large, and one that leaves keeps a share.  Of one roller.
    """

    equations: Equilibrium
    own: Own = field(default_factory=Own)

    def corrected(self, u: Array, control: float) -> Corrected | None:
        """Return the state nearby in equilibrium; None if the iteration does not converge."""
        own, model = self.own, self.equations.model
        if own.strip is not model.strip:
            own.strip, own.balanced, own.parts = model.strip, None, {}
            own.laws = RecordedLaws(model.unknowns)
        own.latest = own.balanced
        found = super().corrected(u, control)
        if found is not None:
            full = self.equations.supports.full(found.u, control)
            contact, gap = self._gaps(full, control)
            own.balanced = full, contact and np.clip(contact.signorini(gap), *BOUNDS)
        return found

    def _gaps(self, full: Array, control: float) -> tuple[Contact | None, Array]:
        values = self.equations.controls.at(control)
        for contact in self.equations.model.effects:
            if isinstance(contact, Contact):
                return contact, contact.gap(contact.look(full, values), values)
        return None, np.zeros(0)

    def _factors(self, u: Array, control: float) -> Factors | None:
        factors, residual = super()._factors(u, control), self.own.residual
        if factors is None or residual is None:
            return factors
        return Factors(lambda _: factors.solve(residual), factors.count_negatives)

    def _recurrence(self, u: Array, control: float) -> Recurrence:
        own, series = self.own, self.equations.recurrence(u, control, 1)
        full, pressure = self.equations.supports.full(u, control), None
        contact, gap = self._gaps(full, control) if own.pressure else (None, np.zeros(0))
        before, own.residual = own.latest, None
        if contact is not None:
            pressure = np.clip(contact.signorini(gap), *BOUNDS)
            foretold = None if before is None else before[1]
            if foretold is not None and self.equations.imbalance(series.residual) > NEAR:
                at, slope = tangent_of(contact.signorini, foretold)
                pressure = np.maximum(foretold + slope * (at - gap), SHARE * foretold)
            moment = full, self.equations.full_velocity(u, control), control
            self._linearise(series, contact.signorini, pressure, moment)
            own.residual = series._summed(lambda part: part.residual())
        if own.stress and before is not None:
            (membrane,) = (e for e in self.equations.model.effects if isinstance(e, Membrane))
            series.parts.append(ForetoldStress(membrane, full - before[0]))
        own.latest = full, pressure
        return series

    def _linearise(self, series: Any, law: ContactLaw, pressure: Array, state: State) -> None:
        """Let the roller's tractions be those of a law linearised at the pressures of all pairs."""
        controls, own = self.equations.controls, self.own
        gap, slope = tangent_of(law, pressure)
        for i, part in enumerate(series.parts):
            effect = part.effect
            if isinstance(effect, (Contact, Friction)):
                contact = effect if isinstance(effect, Contact) else effect.contact
                pairs = contact.sampling.chosen
                parts = own.parts.setdefault(effect.name, {})
                linear = remember(parts, pairs, lambda _, effect=effect: linear_in_gaps(effect))
                given = {OFFSET: (pressure + slope * gap)[pairs], SLOPE: slope[pairs]}
                start = Controls({**controls.start, **given}, {**controls.slope, **UNCHANGING})
                series.parts[i] = series_of(linear, 1, state, start, own.laws)


UNCHANGING = {OFFSET: 0.0, SLOPE: 0.0}


def tangent_of(law: ContactLaw, pressure: Array) -> tuple[Array, Array]:
    """Gaps (m) at pressures (Pa), and minus the derivatives of the law there (Pa/m)."""
    gap = law.gap(pressure)
    return gap, -law(gap + 1j * IMAGINARY).imag / IMAGINARY


@dataclass(frozen=True)
class LinearContact(Contact):
    """Contact with the pressure a − k h, for a and k of each point among the controls."""

    def seen(self, x: Any, controls: Mapping[str, Any], row: int | None = None) -> Projection:
        """Return the projections of points, with pressures in the place of gaps."""
        place = super().seen(x, controls, row)
        return replace(place, gap=controls[OFFSET] - controls[SLOPE] * place.gap)

    def pressure(self, place: Projection) -> Any:
        """Return the pressure (Pa), shape (points,)."""
        return place.gap - self.least

    def near(self, full: Array, controls: Mapping[str, Any]) -> LinearContact:
        """Return this contact, which is of points that are near."""
        return self


@dataclass(frozen=True)
class LinearFriction(Friction):
    """Friction under such a pressure."""

    def near(self, full: Array, controls: Mapping[str, Any]) -> LinearFriction:
        """Return this friction, which is of points that are near."""
        return self


def linear_in_gaps(effect: Contact | Friction) -> LinearContact | LinearFriction:
    """Return an effect of a roller on points near to it with pressures linear in their gaps."""
    given = {each.name: getattr(effect, each.name) for each in fields(effect) if each.init}
    if isinstance(effect, Contact):
        return LinearContact(**given)
    return LinearFriction(**{**given, "contact": linear_in_gaps(effect.contact)})


class ForetoldStress(EffectSeries):
    """Geometric stiffness of N̂ less that of N, which is that of −½ C : ∇(u − u′)ᵀ ∇(u − u′)."""

    def __init__(self, membrane: Membrane, change: Array) -> None:
        self.effect: Membrane = membrane
        self.change = change

    def add_tangent(self, pattern: Pattern, blocks: Blocks, rate: float) -> None:
        """Add it to the blocks."""
        operator, stiffness = self.effect.operator, self.effect.stiffness
        moved = operator.apply(self.change)
        forces = -0.5 * np.einsum("abcd,icp,idp->abp", stiffness, moved, moved)
        derivative = np.einsum("ij,bap->jbiap", np.eye(pattern.count), forces)
        operator.add_tangent(derivative, pattern, blocks)


@dataclass(frozen=True)
class ByWayOf:
    """Series on another law of contact where nothing depends on time; their end is corrected.

    In the place of :func:`~anmstrip.continuation.follow.follow`; a path is one step.
    """

    law: ContactLaw
    last: Corrections

    def __call__(
        self,
        equations: Equilibrium,
        u: Array,
        *,
        solver: LinearSolver,
        settings: Settings,
        start: float = 0.0,
        target: float = 1.0,
        pace: Pace | None = None,
        cost: Cost | None = None,
    ) -> Iterator[PathStep]:
        """Yield the steps of the path from (u, start) to the control ``target``."""
        cost, model = cost or Cost(), equations.model
        ways = {"solver": solver, "settings": settings, "start": start, "target": target}
        if equations.velocity is not None:
            yield from follow(equations, u, pace=pace, cost=cost, **ways)
            return
        effects = [
            replace(e, signorini=self.law, reach=np.inf) if isinstance(e, Contact) else e
            for e in model.effects
        ]
        graded = Equilibrium(model.with_effects(effects), equations.supports, equations.controls)
        *_, step = follow(graded, u, cost=cost, **ways)
        end = step.branch.end[0]
        found = Mixed(equations, solver, self.last, cost).corrected(end, target)
        if found is None:
            raise PathStopped(Outcome.STALLED, target, "Newton's method does not converge")
        yield straight_step(u, start, found)


# steps of time ---------------------------------------------------------------------

MOST_ITERATIONS = 20
"""Iterations after which backward Euler gives up."""


def backward_euler(
    equations: RateEquations,
    u: Array,
    v: Array,
    times: Array,
    *,
    solver: LinearSolver,
    tolerance: float,
) -> tuple[Array, int] | None:
    """Return the states at all times, shape (m, n), and the tangents; None if an iteration fails.

    The steps are of one length, which is what is usual; u and v are those at the first time, from
    which Newton's method starts.  A converged step has at most the imbalance ``tolerance``.
    """
    states, tangents, zero = [u], 0, np.zeros_like(u)
    for t, h in zip(times, np.diff(times), strict=False):
        path = equations.during(float(t), float(h), AffineVelocity(1.0 / h, zero, zero), u)
        increment, spent = _increment(path, h * v, solver, tolerance)
        tangents += spent
        if increment is None:
            return None
        u, v = u + increment, increment / h
        states.append(u)
    return np.array(states), tangents


def _increment(
    path: StepEquations, x: Array, solver: LinearSolver, tolerance: float
) -> tuple[Array | None, int]:
    """Return the increment of a step, and tangents."""
    for iteration in range(MOST_ITERATIONS + 1):
        with np.errstate(all="ignore"):
            recurrence = path.recurrence(x, 1.0, 1)
        imbalance = path.imbalance(recurrence.residual)
        if imbalance <= tolerance:
            return x, iteration
        if not np.isfinite(imbalance) or iteration == MOST_ITERATIONS:
            break
        try:
            x = x - solver.factorise(recurrence.tangent()).solve(recurrence.residual)
        except SingularTangentError:
            break
    return None, iteration
