"""What a roller does to a strip, worked out anew from the files of a state and the scene's data."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from reported_files import Surface


@dataclass(frozen=True)
class Law:
    """Contact and friction as the scene has them.

    Pressure p0 exp(-h/w), or R (R/K + h) = η δ; friction f R |v|^(q-1) v / V_c^q.  Beyond the gap
    at which the pressure is 1e-4 T/r there is no friction, and the pressure there is taken off.
    """

    tension: float
    graded: tuple[float, float] | None = None
    penalty: tuple[float, float, float] | None = None
    exponent: float = 0.05
    omega: float = 0.1
    speed: float = 1.0

    def pressure(self, gap: np.ndarray) -> np.ndarray:
        """Pressure (Pa) at gaps (m)."""
        if self.graded is not None:
            p0, w = self.graded
            return np.asarray(p0 * np.exp(-gap / w))
        assert self.penalty is not None
        k, eta, delta = self.penalty
        root = np.sqrt(gap**2 + 4.0 * eta * delta / k)
        apart = 2.0 * eta * delta / (root + np.abs(gap))  # without cancellation
        return np.where(gap > 0.0, apart, 0.5 * k * (root - gap))

    @property
    def faint(self) -> float:
        """Pressure below which nothing touches (Pa)."""
        if self.graded is not None:
            return 0.01 * self.graded[0]
        assert self.penalty is not None
        return self.penalty[1]

    def share(self, slip: np.ndarray) -> np.ndarray:
        """Friction over f R at speeds of slip (m/s)."""
        s = np.asarray(slip) / self.speed
        return np.asarray(s * (s**2 + self.omega**2) ** (0.5 * (self.exponent - 1.0)))


@dataclass(frozen=True)
class Shape:
    """A roller as the scene has it."""

    radius: float
    centre: tuple[float, float, float]
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    crown: tuple[float, ...] = ()
    friction: float = 0.0
    law: Law = field(default_factory=lambda: Law(1.0))
    sense: int = 1  # of a positive speed about the axis


@dataclass(frozen=True)
class Look:
    """A state of the strip beside a roller, at the contact points of its patches.

    Parameters
    ----------
    surface : Surface
    shape : Shape
    move : array, shape (3,)
        Displacement of the roller (m).
    speed : float
        Of its surface (m/s).
    velocity : array, shape (3,)
        Of its centre (m/s).
    rubs : bool
        Whether friction acts.
    """

    surface: Surface
    shape: Shape
    move: np.ndarray = field(default_factory=lambda: np.zeros(3))
    speed: float = 0.0
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    rubs: bool = False

    @cached_property
    def axis(self) -> np.ndarray:
        a = np.array(self.shape.axis)
        return np.asarray(a / np.linalg.norm(a))

    @cached_property
    def away(self) -> np.ndarray:
        """Points relative to the roller's centre."""
        at = self.surface.at_contact(self.surface.positions)
        return np.asarray(at - np.array(self.shape.centre) - self.move)

    @cached_property
    def profile(self) -> tuple[np.ndarray, np.ndarray]:
        """Radius and its slope at the points' places along the axis."""
        s = self.away @ self.axis
        radius = np.polynomial.Polynomial([self.shape.radius, *self.shape.crown])
        return radius(s), radius.deriv()(s)

    @cached_property
    def radial(self) -> np.ndarray:
        """Unit vectors away from the axis."""
        across = self.away - (self.away @ self.axis)[..., None] * self.axis
        return np.asarray(across / np.linalg.norm(across, axis=-1, keepdims=True))

    @cached_property
    def gap(self) -> np.ndarray:
        across = self.away - (self.away @ self.axis)[..., None] * self.axis
        radius, slope = self.profile
        return np.asarray((np.linalg.norm(across, axis=-1) - radius) / np.sqrt(1.0 + slope**2))

    @cached_property
    def normal(self) -> np.ndarray:
        slope = self.profile[1][..., None]
        return np.asarray((self.radial - slope * self.axis) / np.sqrt(1.0 + slope**2))

    @cached_property
    def turning(self) -> np.ndarray:
        """Unit direction in which a positive speed moves the surface."""
        return self.shape.sense * np.cross(self.axis, self.radial)

    @cached_property
    def pressure(self) -> np.ndarray:
        """Pressure at a point, less what it is a radius away."""
        law = self.shape.law
        beyond = law.pressure(np.array(self.shape.radius))
        return np.asarray(np.maximum(law.pressure(self.gap) - beyond, 0.0))

    @cached_property
    def slip(self) -> np.ndarray:
        """Velocity of the strip along the surface, relative to it."""
        strip = self.surface.at_contact(self.surface.patch("velocity"))
        relative = strip - self.velocity
        relative = relative - np.sum(relative * self.normal, -1, keepdims=True) * self.normal
        ratio = (self.profile[0] / self.shape.radius)[..., None]
        return np.asarray((relative - self.speed * ratio * self.turning) * self.near[..., None])

    @cached_property
    def near(self) -> np.ndarray:
        """Whether friction reaches a point."""
        law = self.shape.law
        limit = 1e-4 * law.tension / self.shape.radius
        return np.asarray((law.pressure(self.gap) > limit) & self.rubs)

    @cached_property
    def traction(self) -> np.ndarray:
        law = self.shape.law
        pressure = law.pressure(self.gap) - 1e-4 * law.tension / self.shape.radius
        speed = np.linalg.norm(self.slip, axis=-1)
        size = self.shape.friction * pressure * law.share(speed) * self.near
        return np.asarray(-self.slip * (size / np.where(speed > 0.0, speed, 1.0))[..., None])

    # what follows from these -----------------------------------------------------------------

    @property
    def normal_force(self) -> float:
        return float(self.surface.integral(self.pressure))

    @property
    def drag(self) -> float:
        along = np.sum(self.traction * self.turning, axis=-1)
        return float(self.surface.integral(along))

    @property
    def torque(self) -> float:
        """Moment about the axis of the tractions at their distances from it."""
        axis = self.shape.sense * self.axis
        moments = np.cross(self.radial * self.profile[0][..., None], self.traction) @ axis
        return float(self.surface.integral(moments))

    @cached_property
    def resultant(self) -> np.ndarray:
        """Force on the strip (N)."""
        total = self.pressure[..., None] * self.normal + self.traction
        return np.asarray(self.surface.integral(total))

    @cached_property
    def least(self) -> np.ndarray:
        """A tenth of the mean pressure up to half a radius away, weighted by force (Pa)."""
        p, area = self.pressure, self.surface.areas
        places = self.surface.at_contact(self.surface.reference)[..., 0]
        x, station = np.unique(places, return_inverse=True)
        near = np.abs(x[:, None] - x) <= 0.5 * self.shape.radius
        squares, forces = (
            near @ np.bincount(station.ravel(), (v * area).ravel()) for v in (p**2, p)
        )
        mean = np.divide(squares, forces, out=np.zeros_like(x), where=forces > 0.0)
        return np.maximum(0.1 * mean, self.shape.law.faint)[station].reshape(p.shape)

    @cached_property
    def touching(self) -> np.ndarray:
        """Points with more than the least pressure."""
        return np.asarray(self.pressure > self.least)

    @cached_property
    def touched(self) -> np.ndarray:
        """Places on the flat strip (m) of all that touches.

        At 4000 places along every line of contact points, on parabolas through the three.
        """
        s = np.linspace(0.0, 1.0, 4001)[:, None]
        hats = np.hstack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)])
        x = self.surface.at_contact(self.surface.reference)[..., 0]
        gap, x = (v @ hats.T for v in (self.gap, x))
        law = self.shape.law
        pressure = law.pressure(gap) - law.pressure(np.array(self.shape.radius))
        inside = pressure > np.exp(np.log(self.least) @ hats.T)
        return np.asarray(x[inside])

    def angle_at(self, place: float) -> float:
        """Angle about the axis at a place on the flat strip (m), from where the gap is least."""
        n = self.normal[self.gap == self.gap.min()][0]
        first = n - (n @ self.axis) * self.axis
        angle = np.arctan2(self.normal @ np.cross(self.axis, first), self.normal @ first)
        x = np.round(self.surface.at_contact(self.surface.reference)[..., 0], 9)
        near = self.pressure > 0.0
        lines, number = np.unique(x[near], return_inverse=True)
        area = self.surface.areas[near]
        means = np.bincount(number, angle[near] * area) / np.bincount(number, area)
        return float(np.interp(place, lines, means))

    @property
    def speeds(self) -> np.ndarray:
        """Slip speeds of the points that touch."""
        return np.asarray(np.linalg.norm(self.slip, axis=-1)[self.touching])

    @property
    def creep_speed(self) -> float:
        """Surface speed less that of the strip, mean over the force in contact."""
        force = self.pressure * self.touching
        less = -np.sum(self.slip * self.turning, axis=-1)
        return float(self.surface.integral(force * less) / self.surface.integral(force))

    @property
    def shares(self) -> np.ndarray:
        """Friction over f R of the points that touch."""
        size = np.linalg.norm(self.traction, axis=-1)[self.touching]
        return np.asarray(size / (self.shape.friction * self.pressure[self.touching]))

    @property
    def arc(self) -> tuple[float, float]:
        """Places on the flat strip where contact begins and ends (m)."""
        return float(self.touched.min()), float(self.touched.max())
