"""Laws between unknowns and forces, by machine code alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
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
            list(self.lifted(matrices[0], stop - size))
            for size, stop in zip(self.sizes[:inputs], self.stops, strict=False)
        ]
        self.gathers = list(self.gathered(matrices[1]))
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

    def lifted(self, parts: list[Part], first: int) -> Iterator[Operand]:
        """Yield the parts of L, whose places are in the inputs."""
        for part, places in self.merged(parts, first):
            m = part.matrix
            yield self.operand(part, m.indptr, m.indices, m.data, places)

    def gathered(self, parts: list[Part]) -> Iterator[Operand]:
        """Yield the parts of Lᵀ w, whose places are in the outputs."""
        for part, places in self.merged(parts, 0):
            m = part.matrix.multiply(part.weights[:, None]).T.tocsr()
            yield self.operand(part, m.indptr, places[m.indices], m.data)

    def merged(self, parts: list[Part], first: int) -> Iterator[tuple[Part, Array]]:
        """Yield parts that are alike as one, which is one call instead of several, and its places.

        Alike are those for the same components, and all for a single one.
        """
        kinds: dict[tuple[int, ...], list[Part]] = {}
        for part in parts:
            alike = (part.count, part.stride, part.first) if part.count > 1 else (1,)
            kinds.setdefault(alike, []).append(part)
        for own in kinds.values():
            begin = min(part.first for part in own)
            size = max(part.first + part.matrix.shape[1] for part in own) - begin
            moved = [
                csr_matrix((m.data, m.indices + (part.first - begin), m.indptr), (m.shape[0], size))
                for part, m in ((part, part.matrix) for part in own)
            ]
            weights = np.concatenate([part.weights for part in own])
            whole = replace(own[0], matrix=vstack(moved, "csr"), weights=weights, first=begin)
            yield whole, np.concatenate([self.places(part, first) for part in own])

    def operand(self, part: Part, starts: Array, *arrays: Array) -> Operand:
        """Arrays and numbers for the machine."""
        kept = [x if x.dtype == float else x.astype(np.int32) for x in (starts, *arrays)]
        numbers = len(starts) - 1, part.count, part.stride * self.lanes
        return Operand(kept, addresses(*kept), 8 * part.first, numbers)

    def lift(self, motions: Sequence[Array | None], moved: Sequence[Any], into: Array) -> None:
        """Set inputs, from values or changes of unknowns and of controls."""
        begin = self.buffers[0 if into is self.given else 1]
        for operands, motion in zip(self.lifts, motions, strict=True):
            assert motion is not None
            x = motion.ctypes.data
            for m in operands:
                self.lift_part(SPARE, SPARE, *m.addresses, x + m.first, begin, *m.numbers)
        flat, points = into.reshape(len(into), -1), self.program.points
        for (rows, shape), value in zip(self.moving, moved, strict=True):
            if value is None:
                flat[rows] = 0.0
                continue
            flat[rows, :points] = np.broadcast_to(value, shape).reshape(rows.stop - rows.start, -1)

    def gather(self, total: Array) -> Array:
        """Add the forces that were found last to a residual, shape (unknowns,)."""
        begin, found = total.ctypes.data, self.buffers[2]
        for m in self.gathers:
            self.gather_part(SPARE, SPARE, *m.addresses, found, begin + m.first, *m.numbers)
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
