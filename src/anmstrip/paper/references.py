"""References of the mass-spring cases: closed forms for Coulomb friction, and scalar equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from anmstrip.arrays import Array
from anmstrip.mechanics.laws import NortonHoff
from anmstrip.paper.mass_spring import (
    MassSpring,
    MovingPlane,
    Parameters,
    PressedPlane,
    RotatingCircle,
)


@dataclass(frozen=True)
class Coulomb:
    """Solution of the rigid obstacle with Coulomb's law."""

    displacement: Callable[[Array], Array]  # of times (m,), shape (m, n)
    until: float = np.inf  # time from which no quasi-static solution exists (s)


def coulomb(case: MassSpring) -> Coulomb:
    """Closed-form solution of a case without regularisation."""
    p = case.parameters
    if isinstance(case, RotatingCircle):
        return coulomb_on_circle(p)
    if isinstance(case, PressedPlane):
        limit = p.f * p.R_N / p.k
        return Coulomb(lambda t: np.clip(p.V * t, -limit, limit)[:, None])
    speed = float(np.clip(p.V, -p.f * p.F / p.k, p.f * p.F / p.k))  # stick, or slide at once

    def displacement(t: Array) -> Array:
        pressed = np.maximum(t - p.k * p.delta / p.F, 0.0)
        return np.stack([speed * pressed, -np.minimum(p.F * t / p.k, p.delta)], axis=1)

    return Coulomb(displacement)


def coulomb_on_circle(p: Parameters) -> Coulomb:
    """Free, sliding with sin φ + f cos φ = f k r/A, then sticking until the cone is left.

    A = k (r + δ) − F t is what the springs and the load leave to lift the mass.  The cone is
    left when |A| (sin φ − f cos φ) = f k r, with A < 0.
    """
    contact, cone = p.k * p.delta / p.F, np.arctan(p.f)
    sense, Omega = np.sign(p.Omega), abs(p.Omega)

    def lift(t: Any) -> Any:
        return p.k * (p.r + p.delta) - p.F * t

    def sliding(t: Any) -> Any:
        return np.arcsin(np.minimum(np.sin(cone) * p.k * p.r / lift(t), 1.0)) - cone

    def excess(t: float) -> float:
        """Rate of sliding over that of the circle; negative while it slides."""
        return float(np.tan(sliding(t) + cone) * p.F / lift(t) - Omega)

    last = (p.k * (p.r + p.delta) - p.k * p.r * np.sin(cone)) / p.F
    slides = excess(contact) < 0.0
    stuck = brentq(excess, contact, last * (1.0 - 1e-9)) if slides else contact

    def angle(t: Array) -> Array:
        later = sliding(stuck) + Omega * (t - stuck)
        return np.where(t < contact, 0.0, np.where(t < stuck, sliding(np.minimum(t, stuck)), later))

    def beyond(t: Array) -> Array:
        return -lift(t) * (np.sin(angle(t)) - p.f * np.cos(angle(t))) - p.f * p.k * p.r

    times = np.linspace(stuck, max(p.t_end, stuck), 2001)
    outside, until = np.flatnonzero(beyond(times) > 0.0), np.inf
    if outside.size and outside[0]:
        until = float(brentq(beyond, times[outside[0] - 1], times[outside[0]]))

    def displacement(t: Array) -> Array:
        phi = np.where(t <= until, sense * angle(t), np.nan)
        rho = np.where(t < contact, lift(t) / p.k, p.r)
        return np.stack([rho * np.sin(phi), rho * np.cos(phi) - p.r - p.delta], axis=1)

    return Coulomb(displacement, until)


def balanced_reactions(case: MovingPlane | RotatingCircle, t: Array, u: Array) -> Array:
    """Normal and tangential reaction that equilibrium asks for at given displacements.

    Parameters
    ----------
    t : ndarray, shape (m,)
    u : ndarray, shape (m, 2)

    Returns
    -------
    ndarray, shape (2, m)
    """
    p = case.parameters
    force = np.stack([p.k * u[:, 0], p.k * u[:, 1] + p.F * t])
    n = np.stack([np.zeros_like(t), np.ones_like(t)])
    if isinstance(case, RotatingCircle):
        n = np.stack(case.contact(u.T)[1])
    return np.stack([(force * n).sum(0), force[0] * n[1] - force[1] * n[0]])


ACCURACY = 1e-10
"""Relative tolerance of the reduced equations."""

TINY = 1e-300


def slip_at(law: NortonHoff, ratio: ArrayLike) -> Array:
    """Slip velocity at which the law gives a ratio R_T/R_N of the opposite sign.

    Solves s (s² + ω²)^((q−1)/2) = y = |ratio|/f for s = |slip|/V_c.  As a
    function of log s the logarithm of the left-hand side is concave and
    increasing, with slopes in [q, 1]; so Newton's method from the left of the
    root converges from one side and cannot fail.  Both asymptotes of the law,
    s = y ω^(1−q) and s = y^(1/q), lie there.

    Parameters
    ----------
    law : NortonHoff
    ratio : array_like
        −R_T/R_N.

    Returns
    -------
    ndarray
        Slip velocity (m/s), with the sign of ``ratio``.

    Examples
    --------
    >>> law = NortonHoff(coefficient=0.3, exponent=0.1, omega=0.1, speed=1.0)
    >>> float(slip_at(law, law.effective(2.0)).round(12))
    2.0
    """
    q, w = law.exponent, law.omega
    y = np.abs(np.asarray(ratio, dtype=float)) / law.coefficient
    s = np.maximum(y * w ** (1.0 - q), y ** (1.0 / q))
    target = np.log(np.maximum(y, TINY))
    for _ in range(60):
        m2 = s * s + w * w
        excess = np.log(np.maximum(s, TINY)) + 0.5 * (q - 1.0) * np.log(m2) - target
        step = -excess / (1.0 + (q - 1.0) * s * s / m2)
        s = s * np.exp(np.maximum(step, 0.0))
        if np.all(step <= 1e-15):
            break
    return np.sign(ratio) * s * law.speed


@dataclass(frozen=True)
class Reduced:
    """One scalar equation z' = rate(t, z), and the displacement that z stands for."""

    rate: Callable[[Array, Array], Array]  # of arrays that broadcast
    displacement: Callable[[Array, Array], Array]  # of t and z, components first


def reduced(case: MassSpring) -> Reduced:
    """Scalar equation of a case whose normal problem is solved.

    Of the planes z = u_x, and the friction law is solved for the slip that it needs.  Of the
    circle z is the angle φ from the top in the sense of turning: with A = k (r + δ) − F t the
    equilibrium in polar coordinates (ρ, φ) reads R_N = k ρ − A cos φ along the normal and
    R_T = A sin φ along the tangent.
    """
    p = case.parameters
    if isinstance(case, RotatingCircle):

        def contact(t: Array, phi: Array) -> tuple[Array, Array, Array]:
            A = p.k * (p.r + p.delta) - p.F * t
            gap = A * np.cos(phi) / p.k - p.r
            R = normal_reaction(p, gap, p.k * (p.delta - gap))
            return A, R, (R + A * np.cos(phi)) / p.k

        def turning(t: Array, phi: Array) -> Array:
            A, R, rho = contact(t, phi)
            slip = -slip_at(p.friction, A * np.sin(phi) / p.regular_normal(R))
            return (slip + p.Omega * p.r) / rho

        def position(t: Array, phi: Array) -> Array:
            rho = contact(t, phi)[2]
            return np.stack([rho * np.sin(phi), rho * np.cos(phi) - p.r - p.delta])

        return Reduced(turning, position)
    if isinstance(case, PressedPlane):
        return Reduced(
            lambda t, u: p.V - slip_at(p.friction, p.k * u / p.R_N), lambda t, u: np.stack([u])
        )

    def normal(t: Array) -> Array:
        return normal_reaction(p, p.delta - p.F * t / p.k, p.F * t)

    return Reduced(
        lambda t, u: p.V - slip_at(p.friction, p.k * u / p.regular_normal(normal(t))),
        lambda t, u: np.stack([u, (normal(t) - p.F * t) / p.k + 0.0 * u]),
    )


def normal_reaction(p: Parameters, gap: Array, load: Array) -> Array:
    """Root R of (5c) with h = gap + R/k, where ``load`` is k (δ − gap)."""
    b, c = gap + p.eta / p.k, p.eta * load / p.k
    compliance = 1.0 / p.K + 1.0 / p.k
    root = np.sqrt(b * b + 4.0 * compliance * c)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(b > 0.0, 2.0 * c / (b + root), (root - b) / (2.0 * compliance))


@dataclass(frozen=True)
class Reference:
    """Displacement of a regularised case, to about nine digits."""

    equation: Reduced
    unknown: Callable[[Array], Array]  # dense output, times → z
    nodes: Array  # times of the integrator's own steps, dense where the mass is fast

    def __call__(self, times: ArrayLike) -> Array:
        """Displacement, shape (m, n), at times (m,)."""
        t = np.asarray(times, dtype=float)
        return self.equation.displacement(t, self.unknown(t)[0]).T

    def distance(self, t: float, u: Array, speed: float) -> float:
        """Distance of (t, u) from the solution as a curve in (V t, u).

        Where the mass snaps, positions at equal times differ by the length of the
        snap as soon as times differ in the last digits.
        """
        gaps = np.maximum(np.abs(self.at_nodes - u).max(axis=1), speed * np.abs(self.nodes - t))
        i = int(gaps.argmin())
        a, b = self.nodes[max(i - 1, 0)], self.nodes[min(i + 1, len(self.nodes) - 1)]

        def gap(share: float) -> float:
            s = a + share * (b - a)
            return max(float(np.abs(self([s])[0] - u).max()), speed * abs(s - t))

        found = minimize_scalar(gap, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-6})
        return float(min(found.fun, gaps[i], np.abs(self([t])[0] - u).max()))

    @cached_property
    def at_nodes(self) -> Array:
        """Displacement at the nodes."""
        return self(self.nodes)


def reference_solution(case: MassSpring, accuracy: float = ACCURACY) -> Reference:
    """Solution of the reduced equation by Radau's method, from rest to ``t_end``."""
    equation = reduced(case)
    solution = solve_ivp(
        equation.rate,
        (0.0, case.parameters.t_end),
        [0.0],
        method="Radau",
        dense_output=True,
        rtol=accuracy,
        atol=1e-3 * accuracy,
    )
    if not solution.success:
        raise ArithmeticError(f"the reference could not be computed: {solution.message}")
    return Reference(equation, solution.sol, solution.t)
