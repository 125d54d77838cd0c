"""A mass on springs against a moving obstacle: the three cases of the 2010 paper.

Their references are closed forms for Coulomb friction, and scalar equations.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from anmstrip.arrays import Array
from anmstrip.mechanics.laws import NortonHoff, Signorini


@dataclass(frozen=True)
class Parameters:
    """The paper's symbols, with the values used here.

    ω, q, V, V_c, k and (for the first case) R_N are printed in the paper; f, δ,
    F, r and Ω are inferred from its figures; K, η, ζ, R_C and the time spans are
    chosen here.
    """

    k: float = 1.0  # N/m, spring
    F: float = 1.0  # N/s, rate of the load (inferred)
    delta: float = 1.0  # m, initial gap (inferred)
    r: float = 0.5  # m, radius of the obstacle (inferred)
    Omega: float = 1.0  # rad/s, its angular speed (inferred)
    V: float = 1.0  # m/s, speed of the plane
    f: float = 0.3  # friction coefficient (inferred)
    q: float = 0.05  # exponent of the friction law
    omega: float = 0.1  # width of its smoothed corner
    V_c: float = 1.0  # m/s, its characteristic speed
    R_N: float = 1.0  # N, prescribed normal force of the first case
    zeta: float = 0.12  # floor of the normal force in the friction law (chosen)
    R_C: float = 1.0  # N, its characteristic force (chosen)
    K: float = 1.0e3  # N/m, stiffness of the obstacle (chosen)
    eta: float = 1.0e-2  # N, regularisation of contact (chosen)
    t_end: float = 3.0  # s (chosen)

    @property
    def friction(self) -> NortonHoff:
        """Equation (2)."""
        return NortonHoff(self.f, self.q, self.omega, self.V_c)

    @property
    def contact(self) -> Signorini:
        """Equation (5c)."""
        return Signorini(self.K, self.eta, self.delta)

    def regular_normal(self, reaction: Any) -> Any:
        """|R_N|_reg = √(R_N² + ζ² R_C²), equation (5d)."""
        return np.sqrt(reaction * reaction + (self.zeta * self.R_C) ** 2)


@dataclass(frozen=True)
class MassSpring(ABC):
    """Quasi-static equilibrium of a mass on springs, pressed against an obstacle.

    n is the unit normal of the obstacle, and (n_y, −n_x) its tangent, in the sense in which
    the obstacle moves.  All methods take arrays or series, components first.
    """

    parameters: Parameters = Parameters()
    size: ClassVar[int] = 2  # number of unknowns, u_x and u_y

    @abstractmethod
    def contact(self, u: Any) -> tuple[Any, Any]:
        """Gap h (m) and unit normal n."""

    @abstractmethod
    def slip_along(self, n: Any, v: Any) -> Any:
        """Tangential velocity relative to the obstacle (m/s)."""

    @abstractmethod
    def imbalance(self, u: Any, t: Any, n: Any, normal: Any, tangential: Any) -> Any:
        """Sum of all forces on the mass (N), shape (size,)."""

    def gap(self, u: Any) -> Any:
        """Gap h (m)."""
        return self.contact(u)[0]

    def slip(self, u: Any, v: Any) -> Any:
        """Tangential velocity relative to the obstacle (m/s)."""
        return self.slip_along(self.contact(u)[1], v)

    def forces(self, h: Any, n: Any, v: Any) -> tuple[Any, Any]:
        """Normal and tangential reaction (N), (5c) and (5d)."""
        p = self.parameters
        normal = p.contact(h)
        slip = np.stack([self.slip_along(n, v)])
        return normal, p.friction(p.regular_normal(normal), slip)[0]

    def residual(self, u: Any, v: Any, t: Any) -> Any:
        """Equilibrium with the law of friction, equations (3) or (5a) and (5b)."""
        h, n = self.contact(u)
        return self.imbalance(u, t, n, *self.forces(h, n, v))

    def sliding(self, u: Any, t: Any, share: float) -> Any:
        """Equilibrium with the friction ``share`` f R_N, whatever the velocity."""
        h, n = self.contact(u)
        normal = self.parameters.contact(h)
        return self.imbalance(u, t, n, normal, normal * (share * self.parameters.f))


@dataclass(frozen=True)
class MovingPlane(MassSpring):
    """§3.2: a mass lowered by a growing force onto a moving plane; u = (u_x, u_y)."""

    parameters: Parameters = Parameters(t_end=3.0)

    def contact(self, u: Any) -> tuple[Any, Any]:
        return u[1] + self.parameters.delta, (0.0, 1.0)

    def slip_along(self, n: Any, v: Any) -> Any:
        return v[0] - self.parameters.V

    def imbalance(self, u: Any, t: Any, n: Any, normal: Any, tangential: Any) -> Any:
        p = self.parameters
        return np.stack([tangential - u[0] * p.k, normal - u[1] * p.k - t * p.F])


@dataclass(frozen=True)
class PressedPlane(MovingPlane):
    """§3.1: a mass pressed with a given force on a plane that moves; one unknown, u_x."""

    parameters: Parameters = Parameters(t_end=4.0)
    size: ClassVar[int] = 1

    def contact(self, u: Any) -> tuple[Any, Any]:
        return 0.0 * u[0], (0.0, 1.0)

    def forces(self, h: Any, n: Any, v: Any) -> tuple[Any, Any]:
        p = self.parameters
        slip = np.stack([self.slip_along(n, v)])
        return p.R_N, p.friction(p.R_N + h, slip)[0]

    def imbalance(self, u: Any, t: Any, n: Any, normal: Any, tangential: Any) -> Any:
        return np.stack([tangential - u[0] * self.parameters.k])

    def sliding(self, u: Any, t: Any, share: float) -> Any:
        p = self.parameters
        return share * p.f * p.R_N - u * p.k + t * 0.0


@dataclass(frozen=True)
class RotatingCircle(MassSpring):
    """§3.3: the same mass on a circle that turns; u = (u_x, u_y), centre at the origin."""

    parameters: Parameters = Parameters(t_end=2.5)

    def contact(self, u: Any) -> tuple[Any, Any]:
        p = self.parameters
        x, y = u[0], u[1] + (p.r + p.delta)
        distance = np.sqrt(x * x + y * y)
        return distance - p.r, (x / distance, y / distance)

    def slip_along(self, n: Any, v: Any) -> Any:
        return v[0] * n[1] - v[1] * n[0] - self.parameters.Omega * self.parameters.r

    def imbalance(self, u: Any, t: Any, n: Any, normal: Any, tangential: Any) -> Any:
        p = self.parameters
        x = normal * n[0] + tangential * n[1]
        y = normal * n[1] - tangential * n[0] - t * p.F
        return np.stack([x, y]) - u * p.k


CASES: dict[str, type[MassSpring]] = {
    "pressed-plane": PressedPlane,
    "moving-plane": MovingPlane,
    "rotating-circle": RotatingCircle,
}


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


REDUCED_TOLERANCE = 1e-10
"""Relative tolerance of the reduced equations."""

SMALLEST_DIVISOR = 1e-300


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
    target = np.log(np.maximum(y, SMALLEST_DIVISOR))
    for _ in range(60):
        m2 = s * s + w * w
        excess = np.log(np.maximum(s, SMALLEST_DIVISOR)) + 0.5 * (q - 1.0) * np.log(m2) - target
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


def reference_solution(case: MassSpring, accuracy: float = REDUCED_TOLERANCE) -> Reference:
    """Solution of the reduced equation by Radau's method, from rest to ``t_end``."""
    equation = reduced(case)
    how: dict[str, Any] = {"method": "Radau", "rtol": accuracy, "atol": 1e-3 * accuracy}
    whole = 0.0, case.parameters.t_end
    solution = solve_ivp(equation.rate, whole, [0.0], dense_output=True, **how)
    if not solution.success:
        raise ArithmeticError(f"the reference could not be computed: {solution.message}")
    return Reference(equation, solution.sol, solution.t)
