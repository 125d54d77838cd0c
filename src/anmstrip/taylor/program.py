"""Programs: recorded laws that are started at states and then give order after order.

Every recurrence splits an order into what is known from the orders below, and a part that is
linear in the same order of the operands.  The split gives three things from one recording:

* order k as if the input's were zero (:meth:`Orders.advance`), which is a right-hand side of
  the asymptotic numerical method,
* the completion by the input's coefficient once it is solved for (:meth:`Orders.correct`),
* the derivative of the law (:meth:`Orders.derivative`), from which the tangent is assembled:
  the same linear part, seeded with unit vectors.

All orders up to N cost O(N²) multiplications.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from functools import cached_property
from importlib.util import find_spec
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from anmstrip.arrays import Array
from anmstrip.taylor.tape import Tables, Tape, Variable

AVAILABLE = find_spec("numba") is not None and os.environ.get("ANMSTRIP_COMPILED", "1") != "0"
"""Whether programs are compiled; the environment variable ANMSTRIP_COMPILED=0 says no."""


class Executor(Protocol):
    """Runs the instructions of one program on coefficients ``w``.

    ``w`` has the shape (blocks, kept rows, order + 1, lanes).
    """

    block: int
    """Points that are treated at once."""

    def advance(self, w: Array, k: int, given: Array, changes: Array | None) -> Array:
        """Complete order k − 1 by changes of the inputs, if there are any, then find order k.

        Parameters
        ----------
        given, changes : ndarray, shape (inputs, blocks, lanes)
            Order k of the inputs, and what is added to their order k − 1.

        Returns
        -------
        ndarray, shape (outputs, blocks, lanes)
        """

    def derivative(self, w: Array, seeds: Array) -> Array:
        """First changes (seeds, outputs, blocks, lanes) from (seeds, inputs, blocks, lanes)."""


class Program:
    """A recorded law; :func:`anmstrip.taylor.series.record` makes it.

    Parameters
    ----------
    tape : Tape
    output : Variable
    compiled : bool
        Whether to use the compiled loops, where numba is installed.

    Attributes
    ----------
    reusable : bool
        Whether it holds at other states: the law has not decided by values.
    """

    def __init__(self, tape: Tape, output: Variable, *, compiled: bool = False) -> None:
        self.inputs, self.output, self.points = tuple(tape.inputs), output, tape.points
        self.reusable = not tape.decided
        kind: type[Executor]
        if compiled and AVAILABLE:
            from anmstrip.taylor.compiled import CompiledExecutor

            kind = CompiledExecutor
        else:
            from anmstrip.taylor.numpy_kernels import NumpyExecutor

            kind = NumpyExecutor
        block = kind.block
        self.blocks = max(-(-self.points // block), 1)
        self.lanes = -(-self.points // self.blocks)
        code = np.array(tape.code, dtype=np.int64).reshape(-1, 5)
        constants = np.stack([np.zeros(self.points), *tape.constants])
        self.tables = Tables(
            code,
            np.array(tape.parameters),
            self._in_blocks(constants)[1:] if tape.constants else self._in_blocks(constants),
            tape.kept(code),
            np.concatenate([x.rows.ravel() for x in self.inputs]),
            output.rows.ravel(),
        )
        self.kept = int(self.tables.kept.max(initial=-1)) + 1
        self.executor: Executor = kind(self.tables)

    def start(self, *values: ArrayLike, order: int = 1) -> Orders:
        """Compute order 0 at a state, the values of the inputs."""
        return Orders(self, [np.asarray(x, dtype=float) for x in values], order)

    def nbytes(self, order: int) -> int:
        """Memory of the coefficients that are kept up to an order (bytes)."""
        return self.kept * self.points * (order + 1) * 8

    @cached_property
    def zeros(self) -> Array:
        """Coefficients of inputs that are zero, shape (inputs, blocks, lanes)."""
        return np.zeros((len(self.tables.inputs), self.blocks, self.lanes))

    def packed(self, arrays: Sequence[ArrayLike | None], batch: tuple[int, ...] = ()) -> Array:
        """Arrays of all inputs, ``None`` for zero, as (seeds, inputs, blocks, lanes)."""
        count = math.prod(batch)
        flat = np.zeros((count, len(self.tables.inputs), self.points))
        first = 0
        for variable, array in zip(self.inputs, arrays, strict=False):
            stop = first + variable.rows.size
            if array is not None:
                width = self.points if variable.laned else 1
                flat[:, first:stop] = np.reshape(array, (count, variable.rows.size, width))
            first = stop
        return self._in_blocks(flat)

    def unpacked(self, found: Array, batch: tuple[int, ...] = ()) -> Array:
        """The output, shape (*batch, *shape), from (..., outputs, blocks, lanes)."""
        flat = found.reshape((*found.shape[:-2], -1))
        flat = flat[..., : self.points if self.output.laned else 1]
        return flat.reshape((*batch, *self.output.shape))

    def _in_blocks(self, flat: Array) -> Array:
        """(…, points) → (…, blocks, lanes), the last point repeated in lanes that are left."""
        spare = self.blocks * self.lanes - self.points
        if spare:
            flat = np.concatenate([flat, np.repeat(flat[..., -1:], spare, axis=-1)], axis=-1)
        return flat.reshape((*flat.shape[:-1], self.blocks, self.lanes))


class Orders:
    """Orders of a program's output about one state.

    Parameters
    ----------
    program : Program
    values : sequence of ndarray
        Order 0 of the inputs.
    order : int
        Highest order.

    Attributes
    ----------
    value : ndarray
        Order 0 of the output.
    """

    def __init__(self, program: Program, values: Sequence[Array], order: int) -> None:
        self.program = program
        self.w = np.empty((program.blocks, program.kept, max(order, 1) + 1, program.lanes))
        self.pending: Array | None = None
        self.value = self.advance(0, *values)
        self.w[:, :, 1] = 0.0

    def advance(self, k: int, *inputs: ArrayLike | None) -> Array:
        """Order k of the output for the inputs' order k, zero where none is given.

        Order k − 1 is completed before, by what :meth:`correct` was told.
        """
        program = self.program
        given = program.packed(inputs)[0] if inputs else program.zeros
        found = program.executor.advance(self.w, k, given, self.pending)
        self.pending = None
        return program.unpacked(found)

    def correct(self, *changes: ArrayLike | None) -> None:
        """Add to order k − 1 of the inputs before :meth:`advance` finds order k."""
        packed = self.program.packed(changes)[0]
        self.pending = packed if self.pending is None else self.pending + packed

    def derivative(self, *seeds: ArrayLike | None) -> Array:
        """Directional derivatives of the output at order 0.

        Parameters
        ----------
        *seeds : array_like or None
            A direction for every input, shape (*batch, *shape); ``None`` for zero.

        Returns
        -------
        ndarray, shape (*batch, *output.shape)
        """
        shapes = [
            np.shape(seed)[: np.ndim(seed) - len(variable.shape)]
            for variable, seed in zip(self.program.inputs, seeds, strict=False)
            if seed is not None
        ]
        batch = shapes[0] if shapes else ()
        found = self.program.executor.derivative(self.w, self.program.packed(seeds, batch))
        return self.program.unpacked(found, batch)
