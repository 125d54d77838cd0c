"""The mass-spring cases with Coulomb's law on a rigid obstacle, in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from .mass_spring import MassSpring, MovingPlane, Parameters, PressedPlane, RotatingCircle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coulomb:
    """The rigid obstacle with Coulomb's law.

    Attributes
    ----------
    displacement : callable
        ``displacement(times)``, shape (m,) → (m, n).
    until : float
        Time from which no quasi-static solution exists (s).
    """

    displacement: Callable[[Array], Array]
    until: float = np.inf


def coulomb(case: MassSpring) -> Coulomb:
    """Closed-form solution of a case without regularisation."""
    p = case.parameters
    if isinstance(case, PressedPlane):
        limit = p.f * p.R_N / p.k
        return Coulomb(lambda t: np.clip(p.V * t, -limit, limit)[:, None])
    return _coulomb_on_plane(p) if isinstance(case, MovingPlane) else _coulomb_on_circle(p)


def _coulomb_on_plane(p: Parameters) -> Coulomb:
    """Slides at once, or sticks for ever where the plane is slower than the cone grows."""
    speed = float(np.clip(p.V, -p.f * p.F / p.k, p.f * p.F / p.k))

    def displacement(t: Array) -> Array:
        pressed = np.maximum(t - p.k * p.delta / p.F, 0.0)
        return np.stack([speed * pressed, -np.minimum(p.F * t / p.k, p.delta)], axis=1)

    return Coulomb(displacement)


def _coulomb_on_circle(p: Parameters) -> Coulomb:
    """Free, sliding with sin φ + f cos φ = f k r/A, then sticking until the cone is left.

    A = k (r + δ) − F t is what the springs and the load leave to lift the mass.
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

    until = _cone_left(p, lift, angle, stuck)

    def displacement(t: Array) -> Array:
        phi = np.where(t <= until, sense * angle(t), np.nan)
        rho = np.where(t < contact, lift(t) / p.k, p.r)
        return np.stack([rho * np.sin(phi), rho * np.cos(phi) - p.r - p.delta], axis=1)

    return Coulomb(displacement, until)


def _cone_left(
    p: Parameters, lift: Callable[[Array], Array], angle: Callable[[Array], Array], stuck: float
) -> float:
    """First time at which |A| (sin φ − f cos φ) = f k r, with A < 0; infinite if none."""

    def beyond(t: Array) -> Array:
        return -lift(t) * (np.sin(angle(t)) - p.f * np.cos(angle(t))) - p.f * p.k * p.r

    times = np.linspace(stuck, max(p.t_end, stuck), 2001)
    outside = np.flatnonzero(beyond(times) > 0.0)
    if not outside.size or outside[0] == 0:
        return np.inf
    i = int(outside[0])
    return float(brentq(beyond, times[i - 1], times[i]))


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
        n = np.stack(case.frame(u.T)[1])
    return np.stack([(force * n).sum(0), force[0] * n[1] - force[1] * n[0]])
