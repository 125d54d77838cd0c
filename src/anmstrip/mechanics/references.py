"""What the mass-spring cases must give: one scalar equation each, solved by scipy.

Once the normal reaction is known from a quadratic and the friction law is
inverted, a case is one ordinary differential equation; an implicit Runge-Kutta
method integrates it that shares nothing with the series.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from .friction import NortonHoff
from .mass_spring import MassSpring, MovingPlane, Parameters, PressedPlane

Array = NDArray[np.float64]

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
    """One scalar equation z' = rate(t, z), and the displacement that z stands for.

    Attributes
    ----------
    rate : callable
        ``rate(t, z)`` with arrays that broadcast.
    displacement : callable
        ``displacement(t, z)``, components on the first axis.
    """

    rate: Callable[[Array, Array], Array]
    displacement: Callable[[Array, Array], Array]


def reduced(case: MassSpring) -> Reduced:
    """The case with its normal problem solved."""
    p = case.parameters
    if isinstance(case, PressedPlane):
        return _pressed(p)
    return _on_plane(p) if isinstance(case, MovingPlane) else _on_circle(p)


def _pressed(p: Parameters) -> Reduced:
    """k u = −R_N μ(v − V), solved for v."""

    def rate(t: Array, u: Array) -> Array:
        return p.V - slip_at(p.friction, p.k * u / p.R_N)

    return Reduced(rate, lambda t, u: np.stack([u]))


def _on_plane(p: Parameters) -> Reduced:
    """As for the first case, with R_N from (5b) and (5c)."""

    def normal(t: Array) -> Array:
        return _normal_reaction(p, p.delta - p.F * t / p.k, p.F * t)

    def rate(t: Array, u: Array) -> Array:
        return p.V - slip_at(p.friction, p.k * u / p.regular_normal(normal(t)))

    return Reduced(rate, lambda t, u: np.stack([u, (normal(t) - p.F * t) / p.k + 0.0 * u]))


def _on_circle(p: Parameters) -> Reduced:
    """Polar coordinates (ρ, φ) about the centre, φ from the top in the sense of turning.

    With A = k (r + δ) − F t the equilibrium reads R_N = k ρ − A cos φ along the
    normal and R_T = A sin φ along the tangent.
    """

    def normal(t: Array, phi: Array) -> tuple[Array, Array, Array]:
        A = p.k * (p.r + p.delta) - p.F * t
        gap = A * np.cos(phi) / p.k - p.r
        R = _normal_reaction(p, gap, p.k * (p.delta - gap))
        return A, R, (R + A * np.cos(phi)) / p.k

    def rate(t: Array, phi: Array) -> Array:
        A, R, rho = normal(t, phi)
        slip = -slip_at(p.friction, A * np.sin(phi) / p.regular_normal(R))
        return (slip + p.Omega * p.r) / rho

    def displacement(t: Array, phi: Array) -> Array:
        rho = normal(t, phi)[2]
        return np.stack([rho * np.sin(phi), rho * np.cos(phi) - p.r - p.delta])

    return Reduced(rate, displacement)


def _normal_reaction(p: Parameters, gap: Array, load: Array) -> Array:
    """Root R of (5c) with h = gap + R/k, where ``load`` is k (δ − gap)."""
    b, c = gap + p.eta / p.k, p.eta * load / p.k
    compliance = 1.0 / p.K + 1.0 / p.k
    root = np.sqrt(b * b + 4.0 * compliance * c)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(b > 0.0, 2.0 * c / (b + root), (root - b) / (2.0 * compliance))


@dataclass(frozen=True)
class Reference:
    """Displacement of a regularised case, to about nine digits.

    Attributes
    ----------
    equation : Reduced
    angle : callable
        Dense output: times → z.
    nodes : ndarray
        Times of the integrator's own steps, dense where the mass is fast.
    """

    equation: Reduced
    angle: Callable[[Array], Array]
    nodes: Array

    def __call__(self, times: ArrayLike) -> Array:
        """Displacement, shape (m, n), at times (m,)."""
        t = np.asarray(times, dtype=float)
        return self.equation.displacement(t, self.angle(t)[0]).T

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


def solved(case: MassSpring, accuracy: float = ACCURACY) -> Reference:
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
