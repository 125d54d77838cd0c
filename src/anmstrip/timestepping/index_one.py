"""Index-1 systems R(u, v, t) = 0 with u' = v, from plain functions.

In one state: consistency, error growth, stability; as equations for the implicit steps; and
integrated by Taylor series that are explicit in time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline, PPoly

from anmstrip.arrays import Array
from anmstrip.continuation.path import TINY, Cost, Outcome, PathStopped
from anmstrip.taylor.polynomials import derivative_coefficients, value_at
from anmstrip.taylor.program import Orders
from anmstrip.taylor.series import RecordedFunction, recorded
from anmstrip.timestepping.formulas import AffineVelocity, RateEquations, StepEquations, TimeStep

Residual = Callable[[Any, Any, Any], Any]
"""``residual(u, v, t)`` of arrays (n,), (n,), () → (n,), written in numpy."""

CONSISTENCY_SHARE = 1e-3
"""A state is consistent when Newton's correction is this fraction of the tolerance."""

MAX_NEWTON_ITERATIONS = 500
"""Of Newton's method: far away a saturating law, like |v|^q, lets it come nearer by a third."""


@dataclass(frozen=True)
class Point:
    """The equations at one state: residual, derivatives, and the split of directions."""

    orders: Orders  # of the residual, for those to come
    u: Array  # (n,)
    v: Array  # (n,)
    residual: Array  # (n,)
    stiffness: Array  # ∂R/∂u, (n, n)
    damping: Array  # ∂R/∂v, (n, n)
    driven: tuple[Array, Array]  # rows of R (r, n), directions (n, r) on which velocities act
    algebraic: tuple[Array, Array]  # the rest

    @classmethod
    def at(cls, residual: Residual, u: Array, v: Array, t: float, order: int = 0) -> Point:
        """Start the series of the residual."""
        orders = recorded(residual).start(u, v, t, order=order)
        unit = np.eye(len(u))
        stiffness, damping = orders.derivative(unit).T, orders.derivative(None, unit).T
        left, values, right = np.linalg.svd(damping)
        smallest = 1e-12 * np.abs(stiffness).max() + 1e-10 * values[0]
        rank = int((values > smallest).sum())
        driven, algebraic = (left[:, :rank].T, right[:rank].T), (left[:, rank:].T, right[rank:].T)
        return cls(orders, u, v, orders.value, stiffness, damping, driven, algebraic)

    def algebraic_part(self, r: Array) -> Array:
        """Change of u in algebraic directions that takes ``r`` out of the algebraic rows."""
        rows, Q = self.algebraic
        if not len(rows):
            return np.zeros(len(r))
        return Q @ np.linalg.solve(rows @ self.stiffness @ Q, -rows @ r)

    def driven_part(self, r: Array) -> Array:
        """Change of v in driven directions that takes ``r`` out of the driven rows."""
        rows, P = self.driven
        return P @ np.linalg.solve(rows @ self.damping @ P, -rows @ r)

    def correction(self) -> tuple[Array, Array]:
        """Newton's step to R = 0: algebraic part of u, driven part of v."""
        shift = self.algebraic_part(self.residual)
        return shift, self.driven_part(self.residual + self.stiffness @ shift)

    @property
    def driven_stiffness(self) -> Array:
        """∂R/∂u in the driven directions, the algebraic part eliminated, shape (r, r)."""
        rows, P = self.driven
        whole = [p + self.algebraic_part(self.stiffness @ p) for p in P.T]
        return rows @ self.stiffness @ np.stack(whole, axis=1)

    @property
    def growth_rate(self) -> float:
        """Rate at which neighbouring solutions drift apart (1/s; negative: come together).

        Of the error, the driven part obeys c' = −κ c, where the algebraic part has
        been eliminated; the rate is the largest eigenvalue of the symmetric part of
        −κ.  The turning of the directions during a step is neglected.
        """
        rows, P = self.driven
        if not len(rows):
            return -np.inf
        kappa = np.linalg.solve(rows @ self.damping @ P, self.driven_stiffness)
        return float(np.linalg.eigvalsh(-0.5 * (kappa + kappa.T))[-1])


def find_consistent_state(
    residual: Residual,
    u: Array,
    v: Array,
    t: float,
    tolerance: float = 1e-9,
    rate_tolerance: float | None = None,
) -> tuple[Array, Array]:
    """State nearby with R = 0, by Newton's method on algebraic u and driven v.

    The residual must fall from step to step, else the step is halved: a friction
    law saturates, and full steps from far away would diverge.

    Parameters
    ----------
    residual : callable
    u, v : ndarray, shape (n,)
    t : float
    tolerance, rate_tolerance : float
        Errors of u and v beside which the last corrections are negligible; the
        second is the first per unit of time if not given.

    Raises
    ------
    PathStopped
    """
    residual = recorded(residual)
    allowed = tolerance if rate_tolerance is None else rate_tolerance
    for _ in range(MAX_NEWTON_ITERATIONS):
        point = Point.at(residual, u, v, t)
        shift, kick = point.correction()
        changes = ((shift, tolerance, u), (kick, allowed, v))
        if all(
            np.abs(change).max() <= CONSISTENCY_SHARE * max(bound, 1e-9 * np.abs(value).max(), TINY)
            for change, bound, value in changes  # the second bound is that of round-off
        ):
            return u + shift, v + kick
        size, part = np.abs(point.residual).max(), 1.0
        while part > 1e-6 and residual_size(residual, u + part * shift, v + part * kick, t) >= size:
            part *= 0.5
        u, v = u + part * shift, v + part * kick
    raise PathStopped(Outcome.STALLED, t, "no velocity satisfies the friction law here")


def residual_size(residual: Residual, u: Array, v: Array, t: float) -> float:
    """Largest entry of the residual, infinite where it is not a number."""
    with np.errstate(all="ignore"):
        return float(np.nan_to_num(np.abs(residual(u, v, t)).max(), nan=np.inf))


def time_stretch(v: Array, speed: float) -> float:
    """√(1 + |v|²/V²): error at equal times over the distance of the curves (V t, u)."""
    return float(np.hypot(1.0, np.abs(v).max() / speed))


GAUSS_NODES = np.array([0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)])
GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


@dataclass(frozen=True)
class TimePath:
    """A computed solution u(t) of m steps."""

    curve: PPoly  # of n polynomials in every step
    errors: Array  # error of u for good that each step adds, (m,)
    passing: Array  # error of u at the end of each step that the next takes away, (m,)

    @property
    def knots(self) -> Array:
        """Ends of the steps, shape (m + 1,)."""
        return np.asarray(self.curve.x)

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""
        return self.curve(t), self.curve(t, 1)

    def polynomials(self) -> Iterator[tuple[float, float, Array]]:
        """Start, length and coefficients (order + 1, n) of the pieces."""
        for i, (start, end) in enumerate(pairwise(self.knots)):
            yield start, end - start, self.curve.c[::-1, i]


@dataclass(frozen=True)
class Controlled:
    """A solution with its estimated error."""

    path: TimePath
    error: float  # estimate of the largest error of u at any time
    passes: int  # integrations that it took


def estimate_error(residual: Residual, path: TimePath) -> Array:
    """Estimated error of u at the knots of a path, shape (m + 1,)."""
    residual, total, errors = recorded(residual), 0.0, [0.0]
    for start, end, error in zip(path.knots[:-1], path.knots[1:], path.errors, strict=True):
        times = start + (end - start) * GAUSS_NODES
        rates = np.array([Point.at(residual, *path(t), t).growth_rate for t in times])
        grown = np.exp(min((end - start) * float(GAUSS_WEIGHTS @ rates), 700.0))
        total = total * grown + error
        errors.append(total)
    return np.array(errors) + np.array([0.0, *path.passing])


def integrate_controlled(
    run: Callable[[float], TimePath],
    residual: Residual,
    tolerance: float,
    *,
    speed: float = np.inf,
    max_passes: int = 6,
) -> Controlled:
    """Integrate until the estimated error of u is below the tolerance at all times.

    In motion faster than V an error along the way is a shift in time, and
    measured as such: an error e at the velocity v counts as e/√(1 + |v|²/V²),
    the distance of the solutions as curves in (V t, u).  With V = 1 m/s and a
    tolerance of 1e-4 m, a snap is then right to 1e-4 s and 1e-4 m; at equal
    times no number of digits would do where v is 1e7 m/s.

    Parameters
    ----------
    run : callable
        ``run(tolerance)`` integrates; the errors of its steps may add up to its
        argument.
    residual : callable
        R(u, v, t), for the growth of errors.
    tolerance : float
    speed : float
        V; infinite for errors at equal times.
    max_passes : int

    Returns
    -------
    Controlled
        Its error is above the tolerance only if all passes did not suffice.
    """
    allowed = tolerance
    for passes in range(1, max_passes + 1):
        path = run(allowed)
        slowness = [1.0 / time_stretch(path(t)[1], speed) for t in path.knots]
        error = float((estimate_error(residual, path) * slowness).max())
        if error <= tolerance or passes == max_passes:
            break
        allowed *= 0.5 * tolerance / error
    return Controlled(path, error, passes)


UNSTABLE_GROWTH = 10.0
"""Powers of e by which neighbours would drift apart in the whole time, that count as unstable."""


@dataclass(frozen=True)
class Instability:
    """A stretch of time in which a motion was unstable, from the first to the last such step."""

    start: float  # s
    end: float  # s
    pivot: float  # lowest pivot of the rate-free tangent along the motion there (N/m)
    rate: float  # largest rate at which it left its equilibria (1/s)
    distance: float  # by which the state has changed meanwhile (its own unit)

    def __str__(self) -> str:
        return (
            f"Unstable from t = {self.start:.6g} s to {self.end:.6g} s: the rate-free tangent has "
            f"the negative pivot {self.pivot:.3g} N/m along the motion, so that Coulomb's law has "
            f"no equilibrium to follow; the regularised law moved on by {self.distance:.3g} m, "
            f"at up to {self.rate:.2g} times its distance per second."
        )


def pivot(residual: Residual, u: Array, v: Array, t: float) -> tuple[float, float]:
    """Pivot S of the rate-free tangent along the motion, and the growth rate −S/D there.

    Both are positive and negative as for a spring and a dashpot, whatever the sign of the
    residual; a state without resistance to motion has the pivot ∞.
    """
    point = Point.at(residual, u, v, t)
    rows, P = point.driven
    if not len(rows):
        return np.inf, -np.inf
    along = P.T @ v
    length = float(np.linalg.norm(along))
    along = along / length if length > 0.0 else np.eye(len(along))[0]
    D, S = along @ rows @ point.damping @ P @ along, along @ point.driven_stiffness @ along
    return float(S * np.sign(D)), float(-S / D)


def instabilities(residual: Residual, path: TimePath) -> list[Instability]:
    """Stretches in which a computed motion is unstable, in the order of time."""
    residual, whole = recorded(residual), path.knots[-1] - path.knots[0]
    found, ends = list[Instability](), path.knots[1:].tolist()
    known = [(n, *pivot(residual, *path(t), t)) for n, t in enumerate(ends)]
    for unstable, stretch in groupby(known, lambda step: step[2] * whole > UNSTABLE_GROWTH):
        if unstable:
            numbers, pivots, rates = zip(*stretch, strict=True)
            start, end, after = ends[numbers[0]], ends[numbers[-1]], ends[numbers[-1] + 1 :]
            moved = np.abs(path(after[0] if after else end)[0] - path(start)[0]).max()
            found.append(Instability(start, end, min(pivots), max(rates), float(moved)))
    return found


class Substitution(Protocol):
    """Arguments of a function as affine functions of the unknowns u and the control."""

    def arguments(self, u: Array, control: float) -> tuple[ArrayLike, ...]:
        """Values of the arguments."""

    def changes(self, u: Array | None, control: float) -> tuple[ArrayLike | None, ...]:
        """Changes of the arguments with changes of u, (*batch, n), and of the control."""


class TracedRecurrence:
    """Orders of a recorded residual in u and the control.

    Parameters
    ----------
    residual : RecordedFunction
    inputs : Substitution
        What the arguments of the residual are.
    u : ndarray, shape (n,)
    control : float
    order : int

    Attributes
    ----------
    residual : ndarray, shape (n,)
        Order 0.
    """

    def __init__(
        self, residual: RecordedFunction, inputs: Substitution, u: Array, control: float, order: int
    ) -> None:
        self.inputs, self.size = inputs, len(u)
        self.orders = residual.start(*inputs.arguments(u, control), order=order)
        self.residual = self.orders.value.ravel()

    def tangent(self) -> Array:
        """∂R/∂u, shape (n, n)."""
        found = self.orders.derivative(*self.inputs.changes(np.eye(self.size), 0.0))
        return found.reshape(self.size, self.size).T

    def control_derivative(self) -> Array:
        """∂R/∂λ, shape (n,)."""
        return self.orders.derivative(*self.inputs.changes(None, 1.0)).ravel()

    def advance(self, k: int) -> Array:
        """Order k of R as if u_k = 0 and λ_k = 0."""
        return self.orders.advance(k).ravel()

    def correct(self, k: int, u: Array, control: float) -> None:
        """Fix order k of the unknowns."""
        self.orders.correct(*self.inputs.changes(u, control))


class FunctionRateEquations(RateEquations):
    """R(u, v, t) = 0 with u' = v for :func:`anmstrip.timestepping.implicit.integrate`.

    Errors are changes of u in its own unit; a residual is measured by the change
    of u that takes it away, and counts against the share h/T of a step, as the
    error in time does.  In fast motion an error along the way is a shift in
    time: e at the velocity v counts as e/√(1 + |v|²/V²), the distance of the
    solutions as curves in (V t, u).

    Parameters
    ----------
    function : callable
        ``function(u, v, t)`` of arrays (n,), (n,), () → (n,), written in numpy.
    whole : float
        T, duration over which all errors may add up to the tolerance.
    speed : float
        V, from which on motion counts as fast; infinite for errors at equal times.
    """

    def __init__(self, function: Residual, whole: float, speed: float = np.inf) -> None:
        self.function = recorded(function)
        self.whole, self.speed = whole, speed
        self.latest: tuple[Array, AffineVelocity] | None = None

    def during(
        self, t: float, h: float, velocity: AffineVelocity, about: Array
    ) -> FunctionStepEquations:
        """The equations of the step from t to t + h, with λ ∈ [0, 1] as control."""
        self.latest = (about, velocity)
        return FunctionStepEquations(self, t, h, velocity, about)

    def dragged(self, t: float, u: Array, v: Array, time: float) -> FunctionRateEquations | None:
        """The same with a drag as large as friction at a speed of 1 in this time, if it moves."""
        if not v.any():
            return None
        fast = v / (np.abs(v).max() * time)
        friction = self.function(u, fast, t) - self.function(u, -fast, t)
        drag = 0.5 * float(friction @ fast) / float(fast @ fast)
        return FunctionRateEquations(
            lambda u, v, t: self.function(u, v, t) + v * drag, self.whole, self.speed
        )

    def error(self, u: Array, change: Array) -> float:
        """Largest change of the state, as a distance of curves."""
        assert self.latest is not None
        about, velocity = self.latest
        return float(np.abs(change).max()) / time_stretch(velocity(u - about, 1.0), self.speed)


@dataclass
class FunctionStepEquations(StepEquations):
    """One step of a formula, as equations for the increment u with λ as control."""

    problem: FunctionRateEquations
    t: float
    h: float
    velocity: AffineVelocity
    about: Array

    def __post_init__(self) -> None:
        self.softness = np.eye(len(self.about))
        self.share = self.h / self.problem.whole if self.h > 0.0 else 1.0
        self.unit = self.share

    def arguments(self, u: Array, control: float) -> tuple[ArrayLike, ...]:
        """State, velocity and time."""
        return u + self.about, self.velocity(u, control), control * self.h + self.t

    def changes(self, u: Array | None, control: float) -> tuple[ArrayLike | None, ...]:
        """Changes of state, velocity and time."""
        moved = control * self.velocity.slope if control else None
        if u is None:
            return None, moved, control * self.h
        rate = u * self.velocity.rate
        return u, rate if moved is None else rate + moved, control * self.h if control else None

    def recurrence(self, u: Array, control: float, order: int) -> TracedRecurrence:
        """Start the series at a point; its tangent turns residuals into changes of u."""
        recurrence = TracedRecurrence(self.problem.function, self, u, control, order)
        tangent = recurrence.tangent()
        if np.isfinite(tangent).all():  # the linear solver tells of one that is not
            self.softness = np.abs(np.linalg.pinv(tangent))
        self.unit = self.share * time_stretch(self.velocity(u, control), self.problem.speed)
        return recurrence

    def resistance(self, u: Array, control: float) -> Callable[[Array], Array]:
        """∂R/∂v at a state, applied to changes of the velocity."""
        state, t, v = u + self.about, control * self.h + self.t, self.velocity(u, control)
        orders = self.problem.function.start(state, v, t)
        return lambda change: orders.derivative(None, change)

    def residual(self, u: Array, control: float) -> Array:
        """R at a point of the step."""
        return np.asarray(self.problem.function(*self.arguments(u, np.float64(control))))

    @property
    def metric(self) -> float:
        """Metric of changes in units of what the step may err."""
        return self.unit**-2

    def imbalance(self, residual: Array) -> float:
        """Change of u that takes a residual away, in units of what the step may err."""
        return float((self.softness @ np.abs(residual)).max()) / self.unit


def join_steps(
    u: Array, v: Array, steps: Sequence[TimeStep], tolerance: float, speed: float
) -> TimePath:
    """Steps of the implicit scheme joined by cubics.

    Parameters
    ----------
    u, v : ndarray, shape (n,)
        Start.
    steps : sequence of TimeStep
    tolerance : float
        In units of which their errors are given.
    speed : float
        V of the equations.
    """
    knots = np.array([steps[0].start, *(s.end for s in steps)])
    curve = CubicHermiteSpline(knots, [u, *(s.u for s in steps)], [v, *(s.v for s in steps)])
    share = np.diff(knots) / (knots[-1] - knots[0])
    stretches = np.array([time_stretch(s.v, speed) for s in steps])
    found = np.array([s.error * tolerance + s.imbalance for s in steps])
    return TimePath(curve, share * stretches * found, np.zeros(len(steps)))


MAX_EXPLICIT_STEPS = 200_000

MAX_ERROR_RATE = 1.5
"""Largest error per time over that which would use the tolerance up evenly.

What is left near the end would allow any velocity there.
"""

LENGTHENING_SHARE = 0.1
"""Share of what a step may err below which a longer one is tried: its last terms had told of a
shorter one."""


@dataclass(frozen=True)
class TimeSeries:
    """Taylor series of u in time on [start, end]."""

    coefficients: Array  # (order + 1, n)
    start: float
    end: float
    error: float = 0.0  # estimated error of u that the step hands on to the next
    passing: float = 0.0  # estimated error of its algebraic part, which the next takes away

    def __call__(self, t: float) -> tuple[Array, Array]:
        """State and velocity at time ``t``."""
        a = t - self.start
        rates = derivative_coefficients(self.coefficients)
        return value_at(self.coefficients, a), value_at(rates, a)


def join_series(pieces: Sequence[TimeSeries]) -> TimePath:
    """Time series end to end, callable at any time inside."""
    knots = [pieces[0].start, *(p.end for p in pieces)]
    curve = PPoly(np.stack([p.coefficients[::-1] for p in pieces], axis=1), knots)
    errors, passing = np.array([(p.error, p.passing) for p in pieces]).T
    return TimePath(curve, errors, passing)


def integrate_explicitly(
    residual: Residual,
    u: Array,
    v: Array,
    span: tuple[float, float],
    *,
    order: int = 19,
    tolerance: float = 1e-4,
    speed: float = np.inf,
    cost: Cost | None = None,
) -> Iterator[TimeSeries]:
    """Steps of the explicit Taylor scheme.

    A step ends where Newton's correction of the truncated series (one iteration,
    with the derivatives there) is still small.  Its algebraic part is the error
    of the algebraic unknowns.  Its driven part Δv is the defect u' − v(u, t) of
    the series, which grows like a^N along the step a: the step adds
    |Δv| a/(N + 1) to the error of u.  That may be ε a/T, where T is the time that is
    left and ε what the steps before have left of ``tolerance``, so |Δv| ≤ (N + 1) ε/T,
    or half as much again as an even share if that is less; in motion faster than V by
    √(1 + |v|²/V²) more, for an error along the way is a shift in time, and counted as
    such.

    Guaranteed, as far as these leading terms go: in a problem whose solutions
    do not drift apart (∂R/∂u and ∂R/∂v of one sign) the error of u stays below
    the tolerance at all times.  Where they do, see
    :func:`integrate_controlled`.

    Parameters
    ----------
    residual : callable
        ``residual(u, v, t)`` of arrays (n,), (n,), () → (n,), written in numpy.
    u, v : ndarray, shape (n,)
        Start; algebraic u and driven v are made consistent by Newton's method.
    span : tuple of float
    order : int
        N.
    tolerance : float
        Error of u, in its own unit, that all steps together may make.
    speed : float
        V, from which on motion counts as fast; infinite for errors at equal times.

    Yields
    ------
    TimeSeries

    Raises
    ------
    PathStopped
    """
    cost = Cost() if cost is None else cost
    stepper = _Stepper(recorded(residual), order, tolerance, span[1] - span[0], speed, cost)
    left, (t, end) = tolerance, span
    for _ in range(MAX_EXPLICIT_STEPS):
        rate = min(left / (end - t), MAX_ERROR_RATE * tolerance / stepper.whole)
        piece = replace(stepper, rate=rate).step(u, v, t, end)
        yield piece
        left -= piece.error / time_stretch(piece(piece.end)[1], speed)
        t = piece.end
        if t >= end:
            return
        u, v = piece(t)
    raise PathStopped(Outcome.TOO_MANY_STEPS, t)


@dataclass(frozen=True)
class _Stepper:
    """Expand and validate, with the allowed corrections of u, and of u per time by those of v."""

    residual: Residual
    order: int
    tolerance: float
    whole: float
    speed: float
    cost: Cost
    rate: float = 0.0

    def allowed(self, v: Array) -> float:
        """Largest |Δv| at the velocity v."""
        return (self.order + 1) * self.rate * time_stretch(v, self.speed)

    def step(self, u: Array, v: Array, t: float, end: float) -> TimeSeries:
        """The longest series from t on that keeps the tolerance."""
        u, v = find_consistent_state(self.residual, u, v, t, self.tolerance, self.allowed(v))
        with self.cost.timed("series"):
            u_orders, v_last = _orders(Point.at(self.residual, u, v, t, self.order), self.order)
        self.cost.expansions += 1
        self.cost.factorisations += 1
        series, N = TimeSeries(u_orders, t, end), self.order
        terms = [(N, np.abs(v_last).max()), (N - 1, N * np.abs(u_orders[N]).max())]
        guesses = [(self.allowed(v) / x) ** (1.0 / k) for k, x in terms if x > 0.0 and k > 0]
        length = min(guesses, default=np.inf)  # where the last two terms of u' reach the defect
        while True:
            if length < 1e-12 * self.whole:
                reason = f"no step above {length:.2g} keeps the tolerance"
                raise PathStopped(Outcome.STALLED, t, reason)
            piece, excess = self.tried(series, length)
            if excess <= 1.0:
                break
            length = (piece.end - t) * min(max(self.longer(excess), 0.2), 0.95)
        if excess < LENGTHENING_SHARE and piece.end < end:
            longer, excess = self.tried(series, (piece.end - t) * min(self.longer(excess), 2.0))
            return longer if excess <= 1.0 else piece
        return piece

    def longer(self, excess: float) -> float:
        """Length, over that of a piece, at which it would err by half of what it may."""
        if not np.isfinite(excess):
            return 0.0
        return float((0.5 / max(excess, TINY)) ** (1.0 / self.order))

    def tried(self, piece: TimeSeries, length: float) -> tuple[TimeSeries, float]:
        """So much of a piece, with its errors, and these over what they may be."""
        ahead = piece.end - piece.start
        if length < ahead * (1.0 - 1e-12):
            piece = replace(piece, end=piece.start + length)
        piece = self.judged(piece)
        rate = self.rate * time_stretch(piece(piece.end)[1], self.speed)
        share = (piece.end - piece.start) * rate
        return piece, max(piece.passing / self.tolerance, piece.error / share)

    def judged(self, piece: TimeSeries) -> TimeSeries:
        """The piece with its errors, from Newton's correction at its end."""
        self.cost.residuals += 1
        with np.errstate(all="ignore"):
            u, v = piece(piece.end)
            if not np.isfinite(residual_size(self.residual, u, v, piece.end)):
                return replace(piece, error=np.inf, passing=np.inf)
            shift, kick = Point.at(self.residual, u, v, piece.end).correction()
        inherited = float(np.abs(kick).max()) * (piece.end - piece.start) / (self.order + 1)
        return replace(piece, error=inherited, passing=float(np.abs(shift).max()))


def _orders(point: Point, order: int) -> tuple[Array, Array]:
    """Coefficients of u, order by order, and the last one of v."""
    u, v = np.zeros((2, order + 1, len(point.u)))
    u[0], v[0] = point.u, point.v
    P = point.driven[1]
    coupled = len(point.algebraic[0]) > 0
    for p in range(1, order + 1):
        u[p] = P @ (P.T @ v[p - 1]) / p
        time = 1.0 if p == 1 else None
        residual = point.orders.advance(p, u[p], None, time)
        if coupled:
            u[p] += point.algebraic_part(residual)
            point.orders.correct(None, p * u[p] - v[p - 1])
            v[p - 1] = p * u[p]
            residual = point.orders.advance(p, u[p], None, time)
        v[p] = point.driven_part(residual)
        point.orders.correct(None, v[p])
    return u, v[-1]
