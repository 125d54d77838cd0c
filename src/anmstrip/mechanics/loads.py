"""Loads: forces and tension on edges, weight, pressure, drag, guides and foundations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.fem.geometry import PLATE, dot, normal_vector, normal_work
from anmstrip.fem.operators import CellOperator
from anmstrip.fem.sampling import ContactOperator
from anmstrip.fem.strip import Edge, Strip
from anmstrip.mechanics.effects import LawEffect, LoadEffect, Operator, Values

SLACK_POWER = 4
"""Logarithm (base 2) of the power by which fibres cease to bear less than nothing: 3 is 5 % off
where a tenth of the mean is left, 5 has twice as short a series there."""

NO_SLACK = 1e-100
"""What that power of tension over its scale is added to, so that its root is smooth at 0."""

UNIT_STEP = 1e-4
"""Share of a tension over which a law is differentiated: it is wrong by 1e-8 or less."""


def edge_force(strip: Strip, name: str) -> LoadEffect:
    """Dead force per length of an edge (N/m), scaled by the control ``NAME.force``."""
    load = strip.edges[name].load
    return LoadEffect(f"force on {name}", f"{name}.force", load, strip.kinematics)


@dataclass(frozen=True)
class UnevenForce(LoadEffect):
    """Dead force per length of an edge that varies along it, control ``NAME.uneven_force``.

    That is a field (N/m) on the unknowns, of which those that hold the edge count, (unknowns,).
    """

    edge: Edge

    def force(self, full: Array, velocity: Array | None, controls: Values) -> Array:
        """Return minus the work of the control on all unknowns; none without it."""
        strip, trace = self.edge.strip, self.edge.trace
        force = np.zeros((strip.scalars, strip.count))
        if (given := controls.get(self.control)) is not None:
            force[trace] = -self.edge.mass @ strip.nodal(given)[trace]
        return force.ravel()


def uneven_edge_force(strip: Strip, name: str) -> UnevenForce:
    """Return the force that has held an edge that is let go, beyond its mean per length."""
    edge, control = strip.edges[name], f"{name}.uneven_force"
    return UnevenForce(f"uneven force on {name}", control, edge.load, strip.kinematics, edge)


def weight(strip: Strip) -> LoadEffect:
    """Weight ρ t per area, scaled by the control ``gravity`` (m/s²)."""
    return LoadEffect("weight", "gravity", strip.mass * strip.integrals(), strip.kinematics)


class GrownWeight(LawEffect):
    """Weight of strip whose labels hold more of it, or less: −ρ t g per area of the reference.

    Controls: ``gravity`` (m/s²) and ``strip.growth``, g (points,).

    Parameters
    ----------
    strip : Strip
    """

    name = "weight"

    def __init__(self, strip: Strip) -> None:
        self.strip, self.operator = strip, CellOperator(strip, (0,))

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Minus the weight, on the value, (components, 1, points)."""
        held = (x[0, 0] * 0.0 + self.strip.mass) * controls["strip.growth"]
        pull = np.einsum("ij,j->i", self.strip.kinematics.chosen, controls["gravity"])
        return np.einsum("i,...->i...", pull * -1.0, held)[:, None]


@dataclass(frozen=True)
class FollowerLoad(LawEffect):
    """A load that follows the strip: residual −control × stress(tangent vectors)."""

    name: str
    control: str  # name of the control, a number
    operator: CellOperator  # value and first derivatives
    reference: Array  # tangent vectors of the reference, (components, directions, points or 1)
    stress: Callable[[Any], Any]
    """Stress that does work with value and derivatives for a unit control per length or area,
    (components, 1 + directions, points), from tangent vectors (components, directions, points)."""

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Generalised stress, (components, 1 + directions, points)."""
        return self.stress(x[:, 1:] + self.reference) * controls[self.control] * -1.0

    def unit_law(self, x: Any, controls: Values) -> Any:
        """Change of the stress with the control, shape as of :meth:`law`."""
        return self.law(x, None, {**controls, self.control: 1.0})


@dataclass(frozen=True)
class CurledTension(FollowerLoad):
    """Tension T (N/m) of strip that curls at its end: along the strip beyond the curl.

    A curvature κ at the end, at which its moment vanishes, straightens inwards.  By the first
    integral of the elastica the end turns out of the line by an angle θ, and under a pull P, T and
    what a dead force adds, sin(θ/2) = κ √(D/P)/2.
    """

    strip: Strip
    outward: Array  # direction of the line, (3,)

    def direction(self, x: Any, controls: Values) -> Any:
        """Stress of a unit pull beyond the curl.

        κ is the coil set, with the crossbow through Poisson's ratio, and what a moment adds; it
        turns the strip away from its normal.
        """
        tangents, d = x[:, 1:] + self.reference, self.strip.bending_stiffness
        edge = self.control.partition(".")[0]
        shares = {"strip.coil_set": 1.0, "strip.crossbow": self.strip.material.poisson}
        shares[f"{edge}.moment"] = -1.0 / d
        parts = [controls[key] * share for key, share in shares.items() if key in controls]
        pull = controls[self.control]
        if f"{edge}.force" in controls:
            pull = pull + dot(controls[f"{edge}.force"], self.outward)
        sine = sum(parts[1:], parts[0]) * (0.5 * np.sqrt(d)) / np.sqrt(pull)
        m = normal_vector(tangents)
        normal = on_value(m / np.sqrt(dot(m, m)), tangents.shape[1])
        aside = normal * (sine * np.sqrt(sine * sine * -1.0 + 1.0) * 2.0)
        return self.stress(tangents) * (sine * sine * -2.0 + 1.0) + aside

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Generalised stress, (components, 1 + directions, points)."""
        return self.direction(x, controls) * controls[self.control] * -1.0

    def unit_law(self, x: Any, controls: Values) -> Any:
        """Change of the stress with the tension, by a central difference."""
        tension, step = controls[self.control], UNIT_STEP * controls[self.control]
        ends = ({**controls, self.control: tension + by} for by in (-step, step))
        before, after = (self.law(x, None, each) for each in ends)
        return (after - before) / (2.0 * step)


@dataclass(frozen=True)
class UnevenTension(FollowerLoad):
    """Tensions of fibres beyond their mean T (N/m), where uneven strip goes on at its end.

    No fibre pushes: of what the longest bear less than the mean, S (N/m, control ``NAME.slack``),
    a mean below that leaves the share T/S.  Here it is T (Tⁿ + Sⁿ)^(−1/n), n = 16, which is smooth:
    0.988 where T is 1.1 S.
    """

    outward: Array  # direction of the line, (3,)
    scale: float  # of tensions (N/m)

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Generalised stress, (components, 1 + directions, points)."""
        edge = self.control.partition(".")[0]
        pull = controls.get(f"{edge}.tension", 0.0)
        if f"{edge}.force" in controls:
            pull = pull + dot(controls[f"{edge}.force"], self.outward)
        mean = t = pull / self.scale
        s = controls[f"{edge}.slack"] / self.scale
        for _ in range(SLACK_POWER):
            t, s = t * t, s * s
        larger = t + s + NO_SLACK
        for _ in range(SLACK_POWER):
            larger = np.sqrt(larger)
        return super().law(x, v, controls) * (mean / larger)


def on_value(force: Any, directions: int) -> Any:
    """Stress (components, 1 + directions, points) of a force, which works on the value alone."""
    return np.einsum("i...,a->ia...", force, np.eye(1 + directions)[0])


def edge_tension(strip: Strip, name: str) -> FollowerLoad:
    """Tension (N/m) along the strip's own direction at an edge, control ``NAME.tension``.

    ±r,x / |r,x|: forwards at the end of larger x, backwards at the other.
    """
    middle = strip.mesh.p[0].min() + 0.5 * strip.length
    sign = 1.0 if strip.nodes[0, strip.edges[name].nodes].mean() > middle else -1.0

    def stress(tangents: Any) -> Any:
        along = tangents[:, 0]
        return on_value(along * sign / np.sqrt(dot(along, along)), strip.kinematics.directions)

    basis = strip.edge_basis(name)
    operator, reference = CellOperator(strip, (0, 1), basis), strip.frames(basis).tangents
    return FollowerLoad(f"tension on {name}", f"{name}.tension", operator, reference, stress)


def curled_edge_tension(strip: Strip, name: str, outward: Array) -> FollowerLoad:
    """The same of strip that curls at the edge, by a coil set, a crossbow or a moment."""
    even = edge_tension(strip, name)
    given = even.name, even.control, even.operator, even.reference, even.stress
    return CurledTension(*given, strip, outward)


def uneven_edge_tension(strip: Strip, name: str, outward: Array, scale: float) -> UnevenTension:
    """The same of every fibre, beyond the mean of all, control ``NAME.unevenness`` (points,)."""
    even = edge_tension(strip, name)
    given = even.operator, even.reference, even.stress, outward, scale
    return UnevenTension(f"uneven {even.name}", f"{name}.unevenness", *given)


def edge_moment(strip: Strip, name: str) -> FollowerLoad:
    """Moment (N m/m) about an edge, control ``NAME.moment``; it bends towards the normal n.

    Does work with the angle by which the strip turns about the edge: M n · δr,a (a^a · c),
    where a^a are the reciprocals of the tangent vectors, and c is the unit vector across the
    edge, outwards, in the deformed surface.  That angle is the one of Kirchhoff–Love bending.
    """
    basis = strip.edge_basis(name)
    frames = strip.frames(basis)
    outwards = frames.covector(np.asarray(basis.normals))
    directions = range(strip.kinematics.directions)

    def stress(tangents: Any) -> Any:
        m = normal_vector(tangents)
        size = np.sqrt(dot(m, m))
        n = m / size
        reciprocal = [q / size for q in normal_work(tangents, n)]
        across = sum(reciprocal[a] * outwards[a] for a in directions)
        across = across / np.sqrt(dot(across, across))
        return np.stack([n * 0.0, *(n * dot(reciprocal[a], across) for a in directions)], axis=1)

    operator = CellOperator(strip, (0, 1), basis)
    return FollowerLoad(f"moment on {name}", f"{name}.moment", operator, frames.tangents, stress)


class Onward(LawEffect):
    """Moment by which strip that goes on beyond an edge keeps to the direction of its pull.

    Residual k (r,x · m) m against r,x, where m = Q F/T is across the force F of the edge, in the
    plane of x and z.  Strip that leaves a roller curled is straight under tension, and its moment
    stays; a free end would curl, and take M²/2D of the tension.  k = E t² is so large beside
    √(T D), the stiffness of the taut strip, that the end turns by less than σ_y/(4 E).

    Control: ``NAME.force`` (N/m).

    Parameters
    ----------
    strip : Strip
    edge : str
        Its name.
    tension : float
        T (N/m) for which k is what it is; it grows like the square of the force.
    """

    def __init__(self, strip: Strip, edge: str, tension: float) -> None:
        basis = strip.edge_basis(edge)
        self.name, self.control = f"strip beyond {edge}", f"{edge}.force"
        self.operator = CellOperator(strip, (1,), basis)
        self.tangents = strip.frames(basis).tangents
        turn = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]) / tension
        self.turn = strip.kinematics.chosen @ turn
        self.stiffness = strip.tensile_stiffness * strip.thickness

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Return k (r,x · m) m on the derivative along x, (components, directions, points)."""
        across = np.einsum("ij,j->i", self.turn, controls[self.control])
        turned = np.einsum("i,ia...->a...", across, x + self.tangents)
        along = np.eye(x.shape[1])[0] * self.stiffness
        return np.einsum("i,a...->ia...", across, np.einsum("a,a...->a...", along, turned))


def pressure(strip: Strip) -> FollowerLoad:
    """Pressure (Pa) from below, normal to the deformed strip, control ``pressure``.

    r,x × r,y per reference area; of a section the tangent turned by a right angle, of a
    plate the upward direction.
    """
    level = strip.kinematics

    def stress(tangents: Any) -> Any:
        up = tangents[:, 0] * 0.0 + 1.0 if level is PLATE else normal_vector(tangents)
        return on_value(up, level.directions)

    operator, reference = CellOperator(strip, (0, 1)), strip.frames().tangents
    return FollowerLoad("pressure", "pressure", operator, reference, stress)


class Pretension(LawEffect):
    """Tension along x of a plate: residual T w,x against the derivative along x.

    The linear part of what the membrane does about a flat state under the force
    (T, 0) on the exit.  Control: ``exit.force`` (N/m), of which the first component
    is looked at.

    Parameters
    ----------
    strip : Strip
    """

    name = "tension"
    control = "exit.force"

    def __init__(self, strip: Strip) -> None:
        self.operator = CellOperator(strip, [1])

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """T (w,x, 0), shape (1, 2, points)."""
        return np.einsum("ia...,ab->ib...", x, np.diag([1.0, 0.0])) * controls[self.control][0]


@dataclass(frozen=True)
class Drag(LawEffect):
    """Residual c v per area."""

    operator: Operator  # values at points, with areas as weights
    coefficient: float  # c (Pa s/m)

    name = "drag"
    rate_dependent = True

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """c v, (components, points)."""
        return v * self.coefficient


class Guide(LawEffect):
    """Springs along the normals of a state of a shell: residual k n (n · (u − u_0)).

    Along the surface nothing holds the strip, so that the membrane can relax there without
    buckling.

    Parameters
    ----------
    strip : Strip
        A shell.
    full : ndarray, shape (unknowns,)
        The state u_0 whose surface guides.
    """

    name = "guide"

    def __init__(self, strip: Strip, full: Array) -> None:
        self.operator = CellOperator(strip, (0, 1))
        at = self.operator.apply(full)
        tangents = at[:, 1:] + strip.kinematics.flat
        normal = np.cross(tangents[:, 0], tangents[:, 1], axis=0)
        self.start: Array = at[:, 0]
        self.normal: Array = normal / np.linalg.norm(normal, axis=0)
        self.stiffness = strip.membrane_stiffness / float(strip.cell_sizes.min()) ** 2

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Generalised stress, (3, 3, points): the value's part alone."""
        away = dot(self.normal, x[:, 0] - self.start)
        return on_value(self.normal * away * self.stiffness, 2)


class Foundation(LawEffect):
    """An elastic foundation, as an air cushion or a felt: the pressure −k w against the
    displacement w along z (Winkler 1867).

    Parameters
    ----------
    strip : Strip
    stiffness : float
        k (Pa/m).
    """

    name = "foundation"

    def __init__(self, strip: Strip, stiffness: float) -> None:
        self.operator, self.stiffness = ContactOperator(strip), stiffness
        self.upwards = strip.kinematics.chosen[:, 2:]

    def law(self, x: Any, v: Any, controls: Values) -> Any:
        """Return the residual per area, k w along z, shape (components, points)."""
        return x * self.upwards * self.stiffness
