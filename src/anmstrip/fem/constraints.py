"""Constraints: unknowns that are held, their motion, and scales of error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anmstrip.fem.strip import Strip

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Scales:
    """What errors are measured against.

    Attributes
    ----------
    length : float
        m, for positions.
    force : float
        N, for imbalances.
    tension : float
        N/m, for membrane forces.
    """

    length: float
    force: float
    tension: float


@dataclass(frozen=True)
class Supports:
    """Which unknowns are free, and the motion of the others.

    u = start + λ slope + λ (λ − 1) bow, where the bow is that of a velocity that changes
    linearly.

    Attributes
    ----------
    free : ndarray of int
        Numbers of the free unknowns.
    start, slope : ndarray, shape (unknowns,)
        At the free unknowns the slope is zero, and the start what they are counted from.
    bow : ndarray, shape (unknowns,), or None
        Of a whole stage in time; a path in λ is straight.
    """

    free: Index
    start: Array
    slope: Array
    bow: Array | None = None

    @classmethod
    def at_rest(cls, unknowns: int, held: Index) -> Supports:
        """Some of the unknowns held at zero, the others free."""
        zero = np.zeros(unknowns)
        return cls(np.setdiff1d(np.arange(unknowns), held), zero, zero)

    def full(self, u: Array, control: float) -> Array:
        """All unknowns from the free ones, shape (unknowns,)."""
        whole = self.start + control * self.slope
        if self.bow is not None:
            whole += control * (control - 1.0) * self.bow
        whole[self.free] += u
        return whole

    def rate(self, control: float) -> Array:
        """du/dλ of what is held, zero elsewhere, shape (unknowns,)."""
        bent = 0.0 if self.bow is None else (2.0 * control - 1.0) * self.bow
        return self.slope + bent

    def change(self, u: Array, control: float) -> Array:
        """Change of all unknowns with a change of the free ones and of λ."""
        whole = control * self.slope
        whole[self.free] = u
        return whole


def traced(strip: Strip, name: str, component: int) -> Index:
    """Unknowns that fix one component of space all along a straight edge of the mesh."""
    return _on_edge(strip, name, lambda odd: [] if odd else [component], facets=False)


def gripped(strip: Strip, name: str) -> Index:
    """Unknowns that fix positions all along an edge of a flat strip, and slopes out of its plane.

    Unlike :meth:`Strip.clamp` this leaves strains in the plane free, for strips that are pulled.
    """
    positions = [traced(strip, name, component) for component in strip.kinematics.components]
    slopes = _on_edge(strip, name, lambda odd: [2] if odd else [], facets=True)
    return np.union1d(np.concatenate(positions), slopes)


def mirrored(strip: Strip, name: str, component: int) -> Index:
    """Unknowns that vanish where an edge lies in a plane of symmetry.

    That component of space, normal to the plane, is odd across the edge, the others even.
    """
    others = [c for c in strip.kinematics.components if c != component]
    return _on_edge(strip, name, lambda odd: others if odd else [component], facets=True)


def _on_edge(strip: Strip, name: str, held: Callable[[bool], Sequence[int]], facets: bool) -> Index:
    """Unknowns on an edge, the components held by the parity of the derivatives across it."""
    edge, level = strip.edges[name], strip.kinematics
    across = "xy"[int(np.ptp(strip.mesh.p[0, edge.nodes]) > 0.0)]
    names = [n[2:] for n in strip.basis.elem.dofnames[: len(strip.basis.nodal_dofs)]]
    found = [
        (dofs[edge.nodes], level.place(component))
        for n, dofs in zip(names, strip.basis.nodal_dofs, strict=True)
        if facets or across not in n
        for component in held(n.count(across) % 2 == 1)
    ]
    if facets:
        normal = [dofs[edge.facets] for dofs in strip.basis.facet_dofs]
        found += [(dofs, level.place(c)) for dofs in normal for c in held(True)]
    places = [strip.count * d + place for d, place in found if place is not None]
    return np.sort(np.concatenate(places))
