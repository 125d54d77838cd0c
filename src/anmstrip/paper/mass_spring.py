"""A mass on springs against a moving obstacle: the three cases of the 2010 paper."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

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
