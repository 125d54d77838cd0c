"""A step of a run as polynomials, and what the rollers see of it as series."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.scene.measures import State
from anmstrip.scene.stages import Plan
from anmstrip.series.power_series import taylor

if TYPE_CHECKING:
    from anmstrip.mechanics.contact import Contact, Friction

Array = NDArray[np.float64]

ORDER = 8
"""Least order of the series of gap and slip; those of a parabola end long before."""


@dataclass(frozen=True)
class Stretch:
    """A step as polynomials of a ∈ [0, length].

    Attributes
    ----------
    full : ndarray, shape (order + 1, unknowns)
    velocity : ndarray, shape (order + 1, unknowns), or None
    control : ndarray, shape (order + 1,)
    length : float
    """

    full: Array
    velocity: Array | None
    control: Array
    length: float

    @classmethod
    def between(cls, before: State, state: State) -> Stretch:
        """The step that has ended in a state; see :meth:`State.at`."""
        plan, branch = state.plan, state.branch
        if branch is not None:
            pairs = list(zip(branch.u, branch.control, strict=True))
            first = plan.supports.full(*pairs[0])
            orders = [plan.supports.change(u, float(c)) for u, c in pairs[1:]]
            stretch = cls(np.array([first, *orders]), None, branch.control, branch.length)
        else:
            begin = (before.time - plan.start) / plan.duration
            control, change = np.array([begin, state.control - begin]), state.full - before.full
            u = np.stack([before.full, change, np.zeros_like(change)])
            stretch = cls(u, None, control, 1.0)
            if state.velocity is not None:
                h, v = state.time - before.time, state.velocity
                u[1], u[2] = 2.0 * change - h * v, h * v - change
                start = v if before.velocity is None else before.velocity
                stretch = replace(stretch, velocity=np.stack([start, v - start]))
        return stretch

    @property
    def order(self) -> int:
        """Of the series of gap and slip."""
        return max(len(self.full) - 1, ORDER)

    def padded(self, coefficients: Array) -> Array:
        """The same with zeros up to the order."""
        more = np.zeros((self.order + 1 - len(coefficients), *coefficients.shape[1:]))
        return np.concatenate([coefficients, more])

    @property
    def powers(self) -> Array:
        """length^k for the orders k ≥ 1 of the motion."""
        return self.length ** np.arange(1.0, len(self.full))


class PairSeries:
    """Gap and slip of pairs of points and rollers along a stretch.

    Parameters
    ----------
    contact : Contact
        At these pairs alone.
    friction : Friction or None
        To look at the slip, likewise.
    plan : Plan
        Of the stage.
    stretch : Stretch

    Attributes
    ----------
    gap : ndarray, shape (order + 1, pairs)
        h (m).
    slip_squared : ndarray, shape (order + 1, pairs), or None
        m²/s².
    """

    def __init__(
        self, contact: Contact, friction: Friction | None, plan: Plan, stretch: Stretch
    ) -> None:
        self.contact, self.friction, self.plan = contact, friction, plan
        inputs = [places(contact, stretch.full), stretch.control]
        if friction is not None and stretch.velocity is not None:
            inputs.append(places(contact, stretch.velocity))
        found = taylor(self._traced, *(stretch.padded(c) for c in inputs))
        self.gap = found[:, 0]
        self.slip_squared = None if friction is None else found[:, 1]

    def _traced(self, x: Any, control: Any, v: Any = None) -> Any:
        """Gap and squared slip of displaced points, shape (1 or 2, pairs)."""
        controls = self.plan.controls.at(control)
        place = self.contact.seen(x, controls)
        if self.friction is None:
            return np.stack([place.gap])
        slip = self.friction.slip(place, self.friction.tangents(place), v, controls)
        return np.stack([place.gap, np.einsum("i...,i...->...", slip, slip)])


def places(contact: Contact, full: Array) -> Array:
    """Displacements of a contact's points, shape (orders, components, points)."""
    return np.stack([contact.operator.apply(u) for u in full])
