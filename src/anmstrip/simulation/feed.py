"""Fresh strip for what has left: the mesh stays, the material moves through it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from anmstrip.arrays import Array, Index
from anmstrip.equilibrium import StageProblem
from anmstrip.fem.strip import Edge, Strip
from anmstrip.simulation.stages import Course
from anmstrip.timestepping.formulas import Memory


@dataclass
class Feed:
    """Moves the labels of a strip along.

    Attributes
    ----------
    strip : Strip
        Of equal elements along x.
    elements : int
        How many have been fed in so far, those taken back counted negative.
    home : dict
        Edge → where entry and exit were at the beginning (m), and the strip's direction there,
        shape (2, 3).
    """

    strip: Strip
    elements: int = 0
    home: dict[str, Array] = field(default_factory=dict)

    @cached_property
    def columns(self) -> Index:
        """Scalar degrees of freedom by column, name and place, (columns, names, nodes)."""
        x = self.strip.mesh.p[0]
        order = np.lexsort((*self.strip.mesh.p[1:], np.round(x / self.length * 1e3)))
        nodes = order.reshape(round(self.strip.length / self.length) + 1, -1)
        return self.strip.basis.nodal_dofs[:, nodes].swapaxes(0, 1)

    @property
    def length(self) -> float:
        """Length of an element (m)."""
        return float(self.strip.cell_sizes[0].mean())

    @cached_property
    def flat(self) -> Array:
        """Degrees of freedom of the reference positions, shape (scalars, components)."""
        strip = self.strip
        flat = np.zeros((strip.scalars, strip.count))
        for component, name in enumerate(("u_x", "u_y")[: strip.mesh.dim()]):
            place = strip.kinematics.place(component)
            if place is not None:
                flat[strip.node_values, place] = strip.mesh.p[component]
                flat[strip.dofs(name), place] = 1.0
        return flat

    def due(self, full: Array) -> int:
        """Whole elements by which the exit is ahead (behind, if negative) of its beginning."""
        for name in ("entry", "exit"):
            self.home.setdefault(name, self._end(self.strip.edges[name], full))
        return int(np.trunc(self._ahead("exit", full) / self.length + 1e-9))

    def travel(self, name: str, full: Array) -> float:
        """Length of strip (m, unstretched) that has passed where an end was at the beginning."""
        return self.elements * self.length + self._ahead(name, full)

    def _ahead(self, name: str, full: Array) -> float:
        """Return how far an end is ahead of its beginning, as unstretched length (m)."""
        position, direction = self._end(self.strip.edges[name], full)
        before, along = self.home[name]
        unit = along / np.linalg.norm(along)
        return float((position - before) @ unit) / float(np.linalg.norm(direction))

    def _end(self, edge: Edge, full: Array) -> Array:
        """Mean position and tangent vector of an end, shape (2, 3)."""
        place = self.strip.nodal(full) + self.flat
        slopes = self.strip.dofs("u_x")[edge.nodes]
        means = np.stack([place[edge.values].mean(axis=0), place[slopes].mean(axis=0)])
        return self.strip.kinematics.embed(means.T).T

    def moved(self, values: Array, elements: int, position: bool = True) -> Array:
        """The same state or velocity of a strip whose labels have moved back by elements.

        Parameters
        ----------
        values : ndarray, shape (unknowns,)
        elements : int
        position : bool
            Whether these are displacements, from reference positions that move along.
        """
        flat = self.flat if position else 0.0
        old = self.strip.nodal(values) + flat
        new = np.empty_like(old)
        columns, count = self.columns, len(self.columns)
        for column in range(count):
            source = min(max(column - elements, 0), count - 1)
            beyond = (column - elements - source) * self.length
            new[columns[column]] = self._continued(old[columns[source]], beyond)
        return np.append(new - flat, values[self.strip.unknowns :])

    def _continued(self, column: Array, distance: float) -> Array:
        """A column of nodes some distance further along the straight strip."""
        names = self.strip.basis.elem.dofnames
        moved = column.copy()
        for row, name in enumerate(names):
            slope = "u_x" + name[2:]
            if "x" not in name and slope in names:
                moved[row] += distance * column[names.index(slope)]
        return moved

    def facts(self, full: Array) -> dict[str, Any]:
        """Return what went through, for the summary."""
        strip = self.strip
        passed = {name: self.travel(name, full) for name in self.home}
        mass = strip.material.density * strip.thickness * strip.width
        return {
            "elements": self.elements,
            **{f"{name}_travel": length for name, length in passed.items()},
            **{f"mass_{way}": mass * passed[name] for way, name in WAYS.items() if name in passed},
        }


WAYS = {"in": "entry", "out": "exit"}


def relabelled(
    feed: Feed, elements: int, plan: StageProblem, course: Course, memory: Memory
) -> tuple[StageProblem, Memory]:
    """A stage and its past after the labels have moved back by elements.

    What is held stays where it is; the course learns by how much its labels' places changed.
    """
    supports, free = plan.supports, plan.supports.free
    held = np.ones(len(supports.start), dtype=bool)
    held[free] = False

    def at(t: float, state: Array) -> Array:
        return supports.full(state, (t - plan.start) / plan.duration)

    before = [at(t, state) for t, state in zip(memory.times, memory.states, strict=True)]
    after = [feed.moved(full, elements) for full in before]
    change = np.where(held, after[0] - before[0], 0.0)
    for name in course.moved:
        values = feed.strip.edges[name].values
        step = feed.strip.nodal(change)[values].mean(axis=0)
        course.shift(name, feed.strip.kinematics.embed(step))
    velocity = plan.moving((memory.times[0] - plan.start) / plan.duration)
    velocity[free] = memory.v
    velocity = feed.moved(velocity, elements, position=False)
    feed.elements += elements
    shifted = replace(supports, start=supports.start + change)
    states = tuple(full[free] for full in after)
    return replace(plan, supports=shifted), replace(memory, states=states, v=velocity[free])
