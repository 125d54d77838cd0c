"""Single points with friction: the smallest problems on which friction codes break.

Each is a residual R(u, v, t), a plain function of arrays that also runs on series, and has its
answer in closed form with Coulomb's law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.laws import FrictionLaw, RepulsiveSignorini

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Slider:
    """A point on a spring, pressed on a surface that moves, and pulled along it; one unknown.

    Equilibrium: W(t) − k u + R_T = 0, with W and R_N linear in time.

    Attributes
    ----------
    law : FrictionLaw
    stiffness : float
        k (N/m); none for a point on a slope.
    normal, load : tuple of float
        R_N and W at t = 0 (N), and their rates (N/s).
    speed : float
        V of the surface (m/s).
    """

    law: FrictionLaw
    stiffness: float = 0.0
    normal: tuple[float, float] = (1.0, 0.0)
    load: tuple[float, float] = (0.0, 0.0)
    speed: float = 0.0

    def residual(self, u: Any, v: Any, t: Any) -> Any:
        """Shape (1,)."""
        pressed = u * 0.0 + (t * self.normal[1] + self.normal[0])
        pulled = u * -self.stiffness + (t * self.load[1] + self.load[0])
        return pulled + self.law(pressed, v - self.speed)


@dataclass(frozen=True)
class CoupledNode:
    """A point above a fixed plane whose springs couple both directions; u = (u_x, u_z).

    Equilibrium: [[1, −c], [−c, k]] u = (W + R_T, −P + R_N), with W linear in time.  With c > 0
    motion along the plane unloads the contact: sliding at u_z = 0 obeys
    (1 − c f) u_x = W − f P, and beyond f = 1/c equilibria are no longer unique.

    Source: Klarbring, *Examples of non-uniqueness and non-existence of solutions to quasistatic
    contact problems with friction*, Ingenieur-Archiv 60 (1990).

    Attributes
    ----------
    law : FrictionLaw
    contact : RepulsiveSignorini
        N/m and N.
    load : tuple of float
        W at t = 0 (N), and its rate (N/s).
    coupling, lift : float
        c and k (N/m).
    pressing : float
        P (N).
    """

    law: FrictionLaw
    contact: RepulsiveSignorini
    load: tuple[float, float]
    coupling: float = 0.8
    lift: float = 2.0
    pressing: float = 1.0

    @property
    def critical(self) -> float:
        """Friction coefficient 1/c beyond which sliding is unstable."""
        return 1.0 / self.coupling

    def residual(self, u: Any, v: Any, t: Any) -> Any:
        """Shape (2,)."""
        normal = self.contact(u[1])
        tangential = self.law(normal, np.stack([v[0]]))[0]
        x = tangential - u[0] + u[1] * self.coupling + (t * self.load[1] + self.load[0])
        z = normal - u[1] * self.lift + u[0] * self.coupling - self.pressing
        return np.stack([x, z])

    def sliding(self, load: float) -> float:
        """u_x in contact with Coulomb's law, sliding forwards."""
        f = self.law.coefficient
        return float((load - f * self.pressing) / (1.0 - self.coupling * f))

    def separated(self, load: float) -> Array:
        """u without contact, shape (2,)."""
        matrix = np.array([[1.0, -self.coupling], [-self.coupling, self.lift]])
        return np.linalg.solve(matrix, [load, -self.pressing])


@dataclass(frozen=True)
class WrappedLinks:
    """A chain of elastic links laid around a cylinder that stands, and pulled; n unknowns.

    At every point the chain turns by θ/n between two links, so that
    R_N = (T + T') sin(θ/2n) and (T' − T) cos(θ/2n) = |R_T|.

    Attributes
    ----------
    law : FrictionLaw
    turn : float
        θ/n (rad).
    stiffness : ndarray, shape (n,)
        Of the link behind each point, towards the end that is pulled (N/m).
    tension : float
        At the slack end (N).
    speed : float
        Of the end that is pulled (m/s).
    """

    law: FrictionLaw
    turn: float
    stiffness: Array
    tension: float = 1.0
    speed: float = 1.0

    @property
    def start(self) -> Array:
        """Displacements under the same tension everywhere, shape (n,)."""
        return -np.cumsum(self.tension / self.stiffness[::-1])[::-1]

    def tensions(self, u: Any, t: Any) -> tuple[Any, Any]:
        """Before and behind every point (N), shape (n,) each."""
        n = len(self.stiffness)
        behind = np.diag(self.stiffness[:-1], 1) - np.diag(self.stiffness)
        before = np.diag(self.stiffness[:-1], -1) * -1.0
        before += np.diag(np.concatenate([[0.0], self.stiffness[:-1]]))
        pulled, slack = np.zeros(n), np.zeros(n)
        pulled[-1], slack[0] = self.stiffness[-1] * self.speed, self.tension
        after = np.einsum("ij,j->i", behind, u) + t * pulled
        return np.einsum("ij,j->i", before, u) + slack, after

    def residual(self, u: Any, v: Any, t: Any) -> Any:
        """Shape (n,)."""
        before, after = self.tensions(u, t)
        normal = (before + after) * np.sin(0.5 * self.turn)
        friction = self.law(normal, np.stack([v]))[0]
        return (after - before) * np.cos(0.5 * self.turn) + friction

    def exact_ratio(self, coefficient: float) -> float:
        """T_n/T_0 in full slip: [(1 + f tan(θ/2n)) / (1 − f tan(θ/2n))]^n."""
        s = coefficient * np.tan(0.5 * self.turn)
        return float(((1.0 + s) / (1.0 - s)) ** len(self.stiffness))
