"""Constraints: unknowns that are held, their motion, and scales of error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from anmstrip.arrays import Array, Index
from anmstrip.fem.strip import Strip
from anmstrip.linalg.solvers import Bordered


@dataclass(frozen=True)
class Scales:
    """Units in which errors are measured."""

    length: float  # m, for positions
    force: float  # N, for imbalances
    tension: float  # N/m, for membrane forces


@dataclass(frozen=True)
class Joint:
    """The exit of an endless strip goes on as its entry: u_exit = u_entry + jump."""

    entry: Index  # unknowns
    exit: Index  # those that follow
    jump: Array  # minus the way from entry to exit in the reference (m)

    def closed(self, full: Array, jump: float = 1.0) -> Array:
        """Return all unknowns, or changes of them without the jump, with those of the exit."""
        full[self.exit] = full[self.entry] + jump * self.jump
        return full

    def gathered(self, total: Array) -> Array:
        """Return a residual of all unknowns with that of the exit added to the entry's."""
        total = total.copy()
        total[self.entry] += total[self.exit]
        return total

    def folded(self, matrix: csc_matrix | Bordered, chosen: Index, free: Index) -> Any:
        """Return a tangent over free unknowns, from that over these and the exit's, (chosen,)."""
        places = np.arange(chosen.max() + 1)
        places[self.exit] = self.entry
        rows = np.flatnonzero(np.isin(places[chosen], free))
        columns = np.searchsorted(free, places[chosen[rows]])
        fold = csc_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(chosen), len(free)))
        if not isinstance(matrix, Bordered):
            return csc_matrix(fold.T @ matrix @ fold)
        inner = csc_matrix(fold.T @ matrix.inner @ fold)
        return Bordered(inner, fold.T @ matrix.columns, matrix.rows @ fold, matrix.corner)


@dataclass(frozen=True)
class Supports:
    """Free unknowns, and the motion of the others.

    u = start + λ slope + λ (λ − 1) bow, where the bow is that of a velocity that changes
    linearly.
    """

    free: Index  # numbers of the free unknowns
    start: Array  # (unknowns,); at the free ones what they are counted from
    slope: Array  # (unknowns,); zero at the free ones
    bow: Array | None = None  # (unknowns,), of a whole stage in time; a path in λ is straight
    joint: Joint | None = None  # of an endless strip

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
        return whole if self.joint is None else self.joint.closed(whole)

    def rate(self, control: float) -> Array:
        """du/dλ of what is held, zero elsewhere, shape (unknowns,)."""
        bent = 0.0 if self.bow is None else (2.0 * control - 1.0) * self.bow
        return self.slope + bent

    def change(self, u: Array, control: float) -> Array:
        """Change of all unknowns with a change of the free ones and of λ."""
        whole = control * self.slope
        whole[self.free] = u
        return whole if self.joint is None else self.joint.closed(whole, 0.0)

    def gathered(self, total: Array) -> Array:
        """Residual of the free unknowns, from that of all."""
        return (total if self.joint is None else self.joint.gathered(total))[self.free]


def simple_support(strip: Strip, name: str, component: int) -> Index:
    """Unknowns that fix one component of space all along a straight edge of the mesh."""
    return strip.edge_unknowns(name, [component], (), ())


def grip(strip: Strip, name: str) -> Index:
    """Unknowns that fix positions all along an edge of a flat strip, and slopes out of its plane.

    Unlike :meth:`Strip.clamp` this leaves strains in the plane free, for strips that are pulled.
    """
    return strip.edge_unknowns(name, strip.kinematics.components, [2], ())


def symmetry(strip: Strip, name: str, component: int) -> Index:
    """Unknowns that vanish where an edge lies in a plane of symmetry.

    That component of space, normal to the plane, is odd across the edge, the others even.
    """
    others = [c for c in strip.kinematics.components if c != component]
    return strip.edge_unknowns(name, [component], others, [component])
