"""Laws between unknowns and forces, by machine code alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.fem.operators import Part
from anmstrip.taylor.compiled import SPARE, CompiledExecutor, entry
from anmstrip.taylor.program import Program


class CompiledLaw:
    """From changes of unknowns to forces on them, Lᵀ w law(L u), by machine code alone.

    Parameters
    ----------
    program : Program
        Compiled, with all points in its lanes.
    parts : tuple of lists
        L of one input, and what forces are gathered by, see :class:`anmstrip.fem.operators.Part`.
    inputs : int
        How many inputs L is for: 1, or 2 with the velocity.
    """

    def __init__(self, program: Program, parts: tuple[list[Part], list[Part]], inputs: int) -> None:
        self.program, self.lanes = program, program.blocks * program.lanes
        first, self.lifts = 0, []
        self.kept: list[Any] = []
        for variable in program.inputs[:inputs]:
            self.lifts.append([self.lifted(part, first) for part in parts[0]])
            first += variable.rows.size
        self.gathers = [self.gathered(part) for part in parts[1]]
        self.moving = []
        for variable in program.inputs[inputs:]:
            self.moving.append(slice(first, first + variable.rows.size))
            first += variable.rows.size
        self.changes = np.zeros((first, program.blocks, program.lanes))
        self.found = np.empty((len(program.tables.outputs), program.blocks, program.lanes))

    def places(self, part: Part, first: int) -> Array:
        """Places of the rows of a part in what a program takes or gives."""
        derivatives, points = np.divmod(np.arange(part.matrix.shape[0]), self.program.points)
        rows = first + part.row + derivatives * part.step
        return np.asarray(rows * self.lanes + points, dtype=np.int32)

    def addresses(self, *arrays: Array) -> list[int]:
        """Addresses of compressed rows, which are kept."""
        kept = [x if x.dtype.kind == "f" else np.asarray(x, dtype=np.int32) for x in arrays]
        self.kept += kept
        return [x.ctypes.data for x in kept]

    def lifted(self, part: Part, first: int) -> tuple[list[int], int, tuple[int, int, int]]:
        """Arrays for ``lift``, the first unknown, and numbers."""
        m = part.matrix
        arrays = self.addresses(m.indptr, m.indices, m.data, self.places(part, first))
        return arrays, 8 * part.first, (m.shape[0], part.count, part.stride * self.lanes)

    def gathered(self, part: Part) -> tuple[list[int], int, tuple[int, int, int]]:
        """Arrays for ``gather``, the first unknown, and numbers."""
        m = part.matrix.multiply(part.weights[:, None]).T.tocsr()
        arrays = self.addresses(m.indptr, self.places(part, 0)[m.indices], m.data)
        return arrays, 8 * part.first, (m.shape[0], part.count, part.stride * self.lanes)

    def lift(self, motions: Sequence[Array | None], moved: Sequence[Any]) -> None:
        """Set the changes of the inputs, from those of unknowns and of controls."""
        begin, lift = self.changes.ctypes.data, entry("lift")
        for parts, motion in zip(self.lifts, motions, strict=True):
            if motion is None:
                continue
            x = motion.ctypes.data
            for arrays, first, numbers in parts:
                lift(SPARE, SPARE, *arrays, x + first, begin, *numbers)
        for rows, change in zip(self.moving, moved, strict=True):
            self.changes[rows] = 0.0 if change is None else np.reshape(change, (-1, 1, 1))

    def advance(self, w: Array, k: int, total: Array, *, pending: bool) -> None:
        """Complete order k − 1 by the changes, and add order k to a residual."""
        executor = self.program.executor
        assert isinstance(executor, CompiledExecutor)
        given, found = self.program.zeros, self.found
        arrays = given, self.changes, found, executor.now, executor.change
        entry("advance")(SPARE, SPARE, *executor.arguments(w, *arrays), k, pending)
        gather, forces, begin = entry("gather"), found.ctypes.data, total.ctypes.data
        for addresses, first, numbers in self.gathers:
            gather(SPARE, SPARE, *addresses, forces, begin + first, *numbers)
