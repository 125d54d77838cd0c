"""Loads: forces and tension on edges, weight, pressure, and the tension of a plate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import CellOperator, gradients, jets
from .effects import LoadEffect
from .kinematics import Kinematics
from .strip import Strip

Array = NDArray[np.float64]

QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
"""From the tangent of a section to its normal, in the plane (x, z)."""

CROSS = np.zeros((3, 3, 3))
CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
CROSS[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0
"""ε_ijk in (a × b)_i = ε_ijk a_j b_k."""


def edge_force(strip: Strip, name: str) -> LoadEffect:
    """Dead force per length of an edge (N/m), scaled by the control ``NAME.force``."""
    load = strip.edges[name].load
    return LoadEffect(f"force on {name}", f"{name}.force", load, strip.kinematics)


def weight(strip: Strip) -> LoadEffect:
    """Weight ρ t per area, scaled by the control ``gravity`` (m/s²)."""
    basis = strip.basis
    density = strip.material.density * strip.thickness * strip.depth
    load = np.zeros(strip.scalars)
    for dofs, field in zip(basis.element_dofs, basis.basis, strict=True):
        np.add.at(load, dofs, density * (np.asarray(field[0]) * basis.dx).sum(axis=1))
    return LoadEffect("weight", "gravity", load, strip.kinematics)


@dataclass(frozen=True)
class Following:
    """A load that follows the strip: residual −control × force(tangent vectors).

    Attributes
    ----------
    name : str
    control : str
        Name of the control, a number.
    operator : CellOperator
        Value and derivatives; the force does work with the value.
    kinematics : Kinematics
    force : callable
        Force of a unit control per length or area, (components, points), from the tangent
        vectors, (components, directions, points).
    """

    name: str
    control: str
    operator: CellOperator
    kinematics: Kinematics
    force: Callable[[Any], Any]

    rate_dependent = False

    def near(self, full: Array, controls: Mapping[str, Any]) -> Following:
        """Everywhere."""
        return self

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """Generalised stress, (components, 1 + directions, points): the value's part alone."""
        value = np.zeros(1 + self.kinematics.directions)
        value[0] = -1.0
        force = self.force(x[:, 1:] + self.kinematics.flat) * controls[self.control]
        return np.einsum("i...,a->ia...", force, value)


def edge_tension(strip: Strip, name: str) -> Following:
    """Tension (N/m) along the strip's own direction at an edge, control ``NAME.tension``.

    ±r,x / |r,x|: forwards at the end of larger x, backwards at the other.
    """
    middle = strip.mesh.p[0].min() + 0.5 * strip.length
    sign = 1.0 if strip.nodes[0, strip.edges[name].nodes].mean() > middle else -1.0

    def direction(tangents: Any) -> Any:
        along = tangents[:, 0]
        return along * sign / np.sqrt(np.einsum("i...,i...->...", along, along))

    operator = jets(strip, strip.edge_basis(name))
    return Following(f"tension on {name}", f"{name}.tension", operator, strip.kinematics, direction)


def pressure(strip: Strip) -> Following:
    """Pressure (Pa) from below, normal to the deformed strip, control ``pressure``.

    r,x × r,y per reference area; of a section the tangent turned by a right angle, of a
    plate the upward direction.
    """
    forces = {"shell": _normal, "section": _turned, "plate": _upwards}
    force = forces[strip.kinematics.name]
    return Following("pressure", "pressure", jets(strip), strip.kinematics, force)


def _normal(tangents: Any) -> Any:
    matrix = np.einsum("ijk,j...->ik...", CROSS, tangents[:, 0])
    return np.einsum("ik...,k...->i...", matrix, tangents[:, 1])


def _turned(tangents: Any) -> Any:
    return np.einsum("ij,j...->i...", QUARTER_TURN, tangents[:, 0])


def _upwards(tangents: Any) -> Any:
    return tangents[:, 0] * 0.0 + 1.0


class Pretension:
    """Tension along x of a plate: residual T w,x against the derivative along x.

    The linear part of what the membrane does about a flat state under the force
    (T, 0) on the exit.  Control: ``exit.force`` (N/m), of which the first component
    is looked at.

    Parameters
    ----------
    strip : Strip
    """

    name = "tension"
    rate_dependent = False
    control = "exit.force"

    def __init__(self, strip: Strip) -> None:
        self.operator = gradients(strip)

    def near(self, full: Array, controls: Mapping[str, Any]) -> Pretension:
        """Everywhere."""
        return self

    def law(self, x: Any, v: Any, controls: Mapping[str, Any]) -> Any:
        """T (w,x, 0), shape (1, 2, points)."""
        return np.einsum("ia...,ab->ib...", x, np.diag([1.0, 0.0])) * controls[self.control][0]
