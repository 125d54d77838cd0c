"""Laws between unknowns and forces, by machine code alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, vstack

from anmstrip.arrays import Array
from anmstrip.fem.operators import Part
from anmstrip.taylor.compiled import CompiledExecutor, addresses, script, table_of
from anmstrip.taylor.program import Program
from anmstrip.taylor.tape import GATHER, LIFT


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
    seeds : ndarray or None, shape (seeds, entries of x)
        Changes of x that the tangent is found for; of every entry alone by default.
    motion : ndarray, shape (2, unknowns)
        Where values or changes of the unknowns and of their velocities are read.
    total : ndarray, shape (unknowns,)
        Where forces are added.
    """

    def __init__(
        self,
        program: Program,
        matrices: tuple[list[Part], list[Part]],
        inputs: int,
        seeds: Array | None,
        motion: Array,
        total: Array,
    ) -> None:
        assert isinstance(program.executor, CompiledExecutor)
        self.program, self.executor = program, program.executor
        self.lanes = program.blocks * program.lanes
        self.sizes = [variable.rows.size for variable in program.inputs]
        self.stops = np.cumsum(self.sizes)
        self.inputs, self.seeds = inputs, np.eye(self.sizes[0]) if seeds is None else seeds
        controls = zip(pairwise(self.stops[inputs - 1 :]), program.inputs[inputs:], strict=True)
        self.moving = [(slice(*own), variable.shape) for own, variable in controls]
        self.given, self.changes, nothing = np.zeros((3, self.stops[-1], self.lanes))
        self.found = np.empty((len(program.tables.outputs), self.lanes))
        self.kept: list[Any] = [motion, total, nothing]  # what is known by addresses alone
        given, changes, zero, found = addresses(self.given, self.changes, nothing, self.found)
        starts = self.stops[:inputs] - self.sizes[:inputs]
        lifting: list[list[int]] = []
        changing: list[list[int]] = []
        for first, x in zip(starts, motion, strict=False):
            for source, numbers in self.lifted(matrices[0], first, x.ctypes.data):
                lifting.append([*source, given, *numbers])
                changing.append([*source, changes, *numbers])
        gathering = list(self.gathered(matrices[1], total.ctypes.data))
        first = self.executor.advancing(given, given, found, False)
        others = self.executor.advancing(zero, changes, found, True)
        derivative = self.executor.changing(changes, found, 1)
        self.add_force = script(table_of([*lifting, first, *gathering]))
        self.add_order = script(table_of([*changing, others, *gathering]))
        self.add_derivative = script(table_of([*changing, derivative, *gathering]))

    def places(self, part: Part, first: int) -> Array:
        """Places of the rows of a part in what a program takes or gives."""
        derivatives, points = np.divmod(np.arange(part.matrix.shape[0]), self.program.points)
        return np.asarray((first + part.row + derivatives * part.step) * self.lanes + points)

    def lifted(self, parts: list[Part], first: int, x: int) -> Iterator[tuple[list[int], ...]]:
        """Yield the calls for L, before and behind the address of the inputs to set."""
        for part, places in self.merged(parts, first):
            m = part.matrix
            arrays = self.addresses(m.indptr, m.indices, m.data, places)
            yield [LIFT, *arrays, x + 8 * part.first], list(self.numbers(part, m.shape[0]))

    def gathered(self, parts: list[Part], total: int) -> Iterator[list[int]]:
        """Yield the calls for Lᵀ w, whose places are in the outputs."""
        for part, places in self.merged(parts, 0):
            m = part.matrix.multiply(part.weights[:, None]).T.tocsr()
            arrays = self.addresses(m.indptr, places[m.indices], m.data)
            found, into = self.found.ctypes.data, total + 8 * part.first
            yield [GATHER, *arrays, found, into, *self.numbers(part, m.shape[0])]

    def addresses(self, *arrays: Array) -> list[int]:
        """Return where arrays are for the machine, which are kept."""
        kept = [x if x.dtype == float else x.astype(np.int32) for x in arrays]
        self.kept += kept
        return addresses(*kept)

    def numbers(self, part: Part, rows: int) -> tuple[int, int, int]:
        """Return rows, components, and the stride of these."""
        return rows, part.count, part.stride * self.lanes

    def merged(self, parts: list[Part], first: int) -> Iterator[tuple[Part, Array]]:
        """Yield parts that are alike as one, which is one call instead of several, and its places.

        Alike are those for the same components, and all for a single one.
        """
        kinds: dict[tuple[int, ...], list[Part]] = {}
        for part in parts:
            alike = (part.count, part.stride, part.first) if part.count > 1 else (1,)
            kinds.setdefault(alike, []).append(part)
        for own in kinds.values():
            if len(own) == 1:
                yield own[0], self.places(own[0], first)
                continue
            begin = min(part.first for part in own)
            size = max(part.first + part.matrix.shape[1] for part in own) - begin
            moved = []
            for part in own:
                m, index = part.matrix, part.matrix.indices + (part.first - begin)
                moved.append(csr_matrix((m.data, index, m.indptr), (m.shape[0], size)))
            weights = np.concatenate([part.weights for part in own])
            whole = replace(own[0], matrix=vstack(moved, "csr"), weights=weights, first=begin)
            yield whole, np.concatenate([self.places(part, first) for part in own])

    def move(self, values: list[Any], into: Array) -> None:
        """Set controls, from values or changes of them; None is zero."""
        points = self.program.points
        for (rows, shape), value in zip(self.moving, values, strict=True):
            if value is None:
                into[rows] = 0.0
                continue
            whole = value if np.shape(value) == shape else np.broadcast_to(value, shape)
            into[rows, :points] = np.reshape(whole, (rows.stop - rows.start, -1))

    @cached_property
    def spare(self) -> tuple[int, int]:
        """Address of coefficients for forces of order 0 alone, and how many orders they have."""
        w = np.empty((self.program.blocks, self.program.kept, 1, self.program.lanes))
        self.kept.append(w)
        return w.ctypes.data, 1

    def tangent(self, w: tuple[int, int], rate: float) -> Array:
        """Return ∂law/∂x + rate ∂law/∂v along the seeds, shape (seeds, *output).

        ``w`` are the address of the coefficients and how many orders they have.
        """
        if self.inputs > 1:
            self.units[:, self.sizes[0] : self.stops[1]] = rate * self.seeds[..., None, None]
        self.find_tangent(1, *w)
        return self.program.unpacked(self.tangents, (len(self.seeds),))

    @cached_property
    def tangents(self) -> Array:
        """Array that receives the tangent, shape (seeds, outputs, blocks, lanes)."""
        return np.empty((len(self.seeds), len(self.found), *self.units.shape[2:]))

    @cached_property
    def find_tangent(self) -> Callable[..., None]:
        """Machine code that finds the tangent."""
        begin, end = addresses(self.units, self.tangents)
        return script(table_of([self.executor.changing(begin, end, len(self.seeds))]))

    @cached_property
    def units(self) -> Array:
        """Changes of x, shape (seeds, inputs, blocks, lanes)."""
        program = self.program
        units = np.zeros((len(self.seeds), self.stops[-1], program.blocks, program.lanes))
        units[:, : self.sizes[0]] = self.seeds[..., None, None]
        return units
