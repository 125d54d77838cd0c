"""Laws between unknowns and forces, by machine code alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix, vstack

from anmstrip.arrays import Array
from anmstrip.fem.operators import Part
from anmstrip.taylor.compiled import SPARE, CompiledExecutor, addresses, call, entry
from anmstrip.taylor.program import Program


class Operand(NamedTuple):
    """A sparse matrix for the machine."""

    arrays: list[Any]  # kept
    addresses: list[int]
    first: int  # unknown, in bytes
    numbers: tuple[int, int, int]  # rows, components, stride


class CompiledLaw:
    """The forces Lᵀ w law(L u) on unknowns from changes of these, by machine code alone.

    Parameters
    ----------
    program : Program
        Compiled, with all points in its lanes.
    matrices : tuple of lists of Part
        L of one input, and what forces are gathered by.
    inputs : int
        How many inputs L is for: 1, or 2 with the velocity; the others are controls.
    seeds : ndarray, shape (seeds, entries of x), optional
        Changes of x that the tangent is found for; of every entry alone by default.

    Attributes
    ----------
    given, changes : ndarray, shape (inputs, blocks, lanes)
        Inputs of order 0, and changes of others.
    found : ndarray, shape (outputs, blocks, lanes)
        Outputs that were found last.
    """

    def __init__(
        self,
        program: Program,
        matrices: tuple[list[Part], list[Part]],
        inputs: int,
        seeds: Array | None = None,
    ) -> None:
        assert isinstance(program.executor, CompiledExecutor)
        self.program, self.executor = program, program.executor
        self.lanes = program.blocks * program.lanes
        self.sizes = [variable.rows.size for variable in program.inputs]
        self.stops = np.cumsum(self.sizes)
        self.seeds = np.eye(self.sizes[0]) if seeds is None else seeds
        self.lifts = [
            self.lifted(matrices[0], stop - size)
            for size, stop in zip(self.sizes[:inputs], self.stops, strict=False)
        ]
        self.gathered_by = self.gathered(matrices[1])
        ends, shapes = (
            pairwise(self.stops[inputs - 1 :]),
            [x.shape for x in program.inputs[inputs:]],
        )
        self.moving = [(slice(*rows), shape) for rows, shape in zip(ends, shapes, strict=True)]
        self.given, self.changes = np.zeros((2, self.stops[-1], program.blocks, program.lanes))
        self.found = np.empty((len(program.tables.outputs), program.blocks, program.lanes))
        inside = self.executor.now, self.executor.change
        self.buffers = addresses(self.given, self.changes, self.found, *inside)
        self.lift_part, self.gather_part = entry("lift"), entry("gather")

    def places(self, part: Part, first: int) -> Array:
        """Places of the rows of a part in what a program takes or gives."""
        derivatives, points = np.divmod(np.arange(part.matrix.shape[0]), self.program.points)
        return np.asarray((first + part.row + derivatives * part.step) * self.lanes + points)

    def lifted(self, parts: list[Part], first: int) -> Operand:
        """L, whose places are in the inputs."""
        part, places = self.whole(parts, first)
        m = part.matrix
        return self.operand(part, m.indptr, m.indices, m.data, places)

    def gathered(self, parts: list[Part]) -> Operand:
        """Lᵀ w, whose places are in the outputs."""
        part, places = self.whole(parts, 0)
        m = part.matrix.multiply(part.weights[:, None]).T.tocsr()
        return self.operand(part, m.indptr, places[m.indices], m.data)

    def whole(self, parts: list[Part], first: int) -> tuple[Part, Array]:
        """Return parts as one, component by component, and the places of its rows."""
        if len(parts) == 1:
            return parts[0], self.places(parts[0], first)
        matrices, weights, places = [], [], []
        size = max(part.first + part.count * part.matrix.shape[1] for part in parts)
        for part in parts:
            m = part.matrix
            for c in range(part.count):
                columns = part.first + part.count * m.indices.astype(np.int64) + c
                matrices.append(csr_matrix((m.data, columns, m.indptr), (m.shape[0], size)))
                places.append(self.places(part, first) + c * part.stride * self.lanes)
                weights.append(part.weights)
        joined = Part(csr_matrix(vstack(matrices)), np.concatenate(weights))
        return joined, np.concatenate(places)

    def operand(self, part: Part, starts: Array, *arrays: Array) -> Operand:
        """Arrays and numbers for the machine."""
        kept = [x if x.dtype == float else x.astype(np.int32) for x in (starts, *arrays)]
        numbers = len(starts) - 1, part.count, part.stride * self.lanes
        return Operand(kept, addresses(*kept), 8 * part.first, numbers)

    def lift(self, motions: Sequence[Array | None], moved: Sequence[Any], into: Array) -> None:
        """Set inputs, from values or changes of unknowns and of controls."""
        begin = into.ctypes.data
        for m, motion in zip(self.lifts, motions, strict=True):
            assert motion is not None
            x = motion.ctypes.data + m.first
            self.lift_part(SPARE, SPARE, *m.addresses, x, begin, *m.numbers)
        flat, points = into.reshape(len(into), -1), self.program.points
        for (rows, shape), value in zip(self.moving, moved, strict=True):
            if value is None:
                flat[rows] = 0.0
                continue
            flat[rows, :points] = np.broadcast_to(value, shape).reshape(rows.stop - rows.start, -1)

    def gather(self, total: Array) -> Array:
        """Add the forces that were found last to a residual, shape (unknowns,)."""
        m, found = self.gathered_by, self.buffers[2]
        into = total.ctypes.data + m.first
        self.gather_part(SPARE, SPARE, *m.addresses, found, into, *m.numbers)
        return total

    def start(
        self, w: Array, motions: Sequence[Array | None], values: Sequence[Any]
    ) -> Callable[[int], None]:
        """Find order 0 at the values of unknowns and controls, and return what finds others.

        Called with k it completes order k − 1 by the changes and finds order k.
        """
        self.lift(motions, values, self.given)
        flat, points = self.given.reshape(len(self.given), -1), self.program.points
        flat[:, points:] = flat[:, points - 1 : points]  # lanes that are left
        arguments, advance = [*self.executor.tables_and(w), *self.buffers], entry("advance")
        advance(SPARE, SPARE, *arguments, 0, False)
        self.given[:], w[:, :, 1] = 0.0, 0.0
        return lambda k: advance(SPARE, SPARE, *arguments, k, True)

    def derivative(self, w: Array) -> None:
        """Find the changes of the outputs that those of the inputs make."""
        _, changes, found, _, inside = self.buffers
        call("derivatives", *self.executor.tables_and(w), changes, found, inside, 1)

    def tangent(self, w: Array, rate: float) -> Array:
        """Return ∂law/∂x + rate ∂law/∂v along the seeds, shape (seeds, *output)."""
        if len(self.lifts) > 1:
            self.units[:, self.sizes[0] : self.stops[1]] = rate * self.seeds[..., None, None]
        found = self.executor.derivative(w, self.units)
        return self.program.unpacked(found, (len(self.seeds),))

    @cached_property
    def units(self) -> Array:
        """Changes of x, shape (seeds, inputs, blocks, lanes)."""
        units = np.zeros((len(self.seeds), *self.changes.shape))
        units[:, : self.sizes[0]] = self.seeds[..., None, None]
        return units
