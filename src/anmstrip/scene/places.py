"""Where on the strip a path has failed: from numbers of unknowns to nodes and rollers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anmstrip.mechanics.strip import Strip
from anmstrip.scene.measures import ContactState, State
from anmstrip.series.outcome import Evidence

Array = NDArray[np.float64]

NEAR = 2.0
"""Gap, in lengths of the elements there, up to which a node counts as near a roller."""


@dataclass(frozen=True)
class Place:
    """A node of the strip and what is around it.

    Attributes
    ----------
    state : State
        Last one that was accepted.
    reference : ndarray, shape (3,)
        Position in the flat strip (m).
    component : str
        x, y or z: which displacement failed.
    """

    state: State
    reference: Array
    component: str

    @property
    def strip(self) -> Strip:
        """Whose place it is."""
        return self.state.plan.model.strip

    @cached_property
    def element(self) -> float:
        """Length of the elements here along the strip (m)."""
        mesh = self.strip.mesh
        distance = np.abs(mesh.p - self.reference[: len(mesh.p), None]).sum(axis=0)
        around = (mesh.t == int(distance.argmin())).any(axis=0)
        return float(self.strip.cell_sizes[0][around].max())

    @cached_property
    def roller(self) -> str:
        """Name of the nearest roller, empty if none is near."""
        gaps = [(self._gap(contact), name) for name, contact in self.state.contacts.items()]
        gap, name = min(gaps, default=(np.inf, ""))
        return name if gap < NEAR * self.element else ""

    def _gap(self, contact: ContactState) -> float:
        x = contact.contact.operator.reference
        nearest = np.abs(x - self.reference[:, None]).sum(axis=0).argmin()
        return float(contact.gap[nearest])

    def __str__(self) -> str:
        axes = "xy"[: self.strip.mesh.dim()]
        at = ", ".join(f"{n} = {v:.4g} m" for n, v in zip(axes, self.reference, strict=False))
        roller = f", at roller {self.roller}" if self.roller else ""
        return f"{at} (in {self.component}{roller})"


def place_of(evidence: Evidence, state: State) -> Place | None:
    """Node and component at which a path has failed, ``None`` if nothing shows it."""
    plan = state.plan
    free, strip = plan.supports.free, plan.model.strip
    number = _worst(evidence, plan.model.units[free])
    if number is None:
        return None
    scalar, component = divmod(int(free[number]), strip.count)
    name = "xyz"[strip.kinematics.components[component]]
    return Place(state, _reference(strip, scalar), name)


def _worst(evidence: Evidence, units: Array) -> int | None:
    """Number of the free unknown that has most to do with it, ``None`` if all have the same.

    A residual times the unit of its unknown is a force, a motion over it a length.
    """
    if evidence.unknown is not None:
        return evidence.unknown
    for values, scale in ((evidence.residual, units), (evidence.motion, 1.0 / units)):
        if values is None or len(values) != len(units):
            continue
        size = np.where(np.isfinite(values), np.abs(values * scale), np.inf)
        return int(np.argmax(size)) if size.max() > size.min() else None
    return None


def _reference(strip: Strip, scalar: int) -> Array:
    """Reference position of a scalar degree of freedom, shape (3,)."""
    at_node = np.argwhere(strip.basis.nodal_dofs == scalar)
    if len(at_node):
        return np.asarray(strip.nodes[:, at_node[0, 1]])
    facet = np.argwhere(strip.basis.facet_dofs == scalar)[0, 1]
    return strip.in_space(strip.mesh.p[:, strip.mesh.facets[:, [facet]]].mean(axis=1))[:, 0]
