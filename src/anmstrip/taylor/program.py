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
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from anmstrip.arrays import Array
from anmstrip.taylor import tape
from anmstrip.taylor.tape import Tables, Tape, Variable

COMPILED = find_spec("numba") is not None and os.environ.get("ANMSTRIP_COMPILED", "1") != "0"
"""Whether programs are compiled; the environment variable ANMSTRIP_COMPILED=0 says no."""


COMPARISONS = {tape.LESS: np.less, tape.LESS_EQUAL: np.less_equal, tape.EQUAL: np.equal}
VALUES = {tape.ROOT: np.sqrt, tape.EXP: np.exp, tape.LOG: np.log}


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
        if compiled and COMPILED:
            from anmstrip.taylor.compiled import CompiledExecutor

            kind = CompiledExecutor
        else:
            kind = NumpyExecutor
        self.blocks = max(-(-self.points // kind.block), 1)
        self.lanes = -(-self.points // self.blocks)
        code = np.array(tape.code, dtype=np.int64).reshape(-1, 5)
        constants = np.stack(tape.constants or [np.zeros(self.points)])
        given = code, np.array(tape.parameters), self._in_blocks(constants), tape.kept(code)
        inputs = np.concatenate([x.rows.ravel() for x in self.inputs])
        self.tables = Tables(*given, inputs, output.rows.ravel())
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


class NumpyExecutor:
    """Executor in numpy: the instructions of :mod:`anmstrip.taylor.kernels`, each on all lanes."""

    block = 4096
    """Points that are treated at once (measured; 1024 takes 1.5 times as long)."""

    def __init__(self, tables: Tables) -> None:
        self.tables = tables
        kept = tables.kept.take(tables.code[:, 1:], mode="wrap")  # b may be a constant's number
        places = np.hstack([tables.code, kept])
        self.code = list(zip(places.tolist(), tables.parameters.tolist(), strict=True))
        self.rows = np.flatnonzero(tables.kept >= 0)

    def advance(self, w: Array, k: int, given: Array, changes: Array | None) -> Array:
        """Order k of the outputs, see :class:`Executor`."""
        found = np.empty((len(self.tables.outputs), *given.shape[1:]))
        with np.errstate(all="ignore"):
            for block, part in enumerate(w):
                if changes is not None:
                    part[:, k - 1] += self._changes(part, block, changes[:, block])[self.rows]
                found[:, block] = self._order(part, block, given[:, block], k)
        return found

    def derivative(self, w: Array, seeds: Array) -> Array:
        """Changes of the outputs, see :class:`Executor`."""
        found = np.empty((len(seeds), len(self.tables.outputs), *seeds.shape[2:]))
        with np.errstate(all="ignore"):
            for block, part in enumerate(w):
                change = self._changes(part, block, seeds[:, :, block].swapaxes(0, 1))
                found[:, :, block] = change[self.tables.outputs].swapaxes(0, 1)
        return found

    def _begun(self, inputs: Array) -> Array:
        """Rows (rows, ..., lanes), of which those of the inputs are given."""
        rows = np.empty((len(self.tables.kept), *inputs.shape[1:]))
        rows[self.tables.inputs] = inputs
        return rows

    def _order(self, w: Array, block: int, inputs: Array, k: int) -> Array:
        """Order k of the outputs (outputs, lanes) from that of the inputs."""
        now, constants = self._begun(inputs), self.tables.constants[:, block]
        w[:, k] = now[self.rows]
        for (kind, out, first, second, _d, place, a, b, condition), s in self.code:
            if kind <= tape.EQUAL:
                _combine((kind, out, first, second, condition, s), now, w, constants, k)
            elif kind == tape.MULTIPLY:
                now[out] = _cauchy(w[a], w[b], k)
            elif kind == tape.PRODUCT:
                now[out] += _cauchy(w[a], w[b], k)
            elif k == 0:
                now[out], companion = _value(kind, now[first], now[second], s)
            else:
                series = w[a], w[b], w[place]
                now[out], companion = _function(kind, now[first], series, s, k)
            if kind >= tape.TANH:
                now[second] = w[b, k] = companion
            if place >= 0:
                w[place, k] = now[out]
        return now[self.tables.outputs]

    def _changes(self, w: Array, block: int, seeds: Array) -> Array:
        """First changes (rows, ..., lanes) of all rows, from those of the inputs."""
        d, constants = self._begun(seeds), self.tables.constants[:, block]
        for (kind, out, first, second, _, place, a, b, condition), s in self.code:
            if kind <= tape.EQUAL:
                _combine((kind, out, first, second, condition, s), d, w, constants, 1)
            else:
                _change((kind, out, first, second, s), d, (w[a], w[b], w[place]))
        return d


def _combine(row: tuple[Any, ...], now: Array, w: Array, constants: Array, k: int) -> None:
    """Order k of a row that needs no lower orders of its operands."""
    kind, out, a, b, d, s = row
    match kind:
        case tape.CONSTANT:
            now[out] = 0.0
        case tape.SHIFT | tape.SCALE:
            now[out] = s * now[a]
        case tape.SCALE_BY:
            now[out] = constants[b] * now[a]
        case tape.COMBINE:
            now[out] += s * now[a]
        case tape.COMBINE_BY:
            now[out] += constants[b] * now[a]
        case tape.ADD:
            now[out] = now[a] + s * now[b]
        case tape.SELECT:
            now[out] = np.where(w[d, 0] != 0.0, now[a], now[b])
        case _:
            now[out] = 0.0 if k else COMPARISONS[kind](now[a], now[b])
    if k == 0 and kind <= tape.SHIFT:
        now[out] += constants[b]


def _cauchy(a: Array, b: Array, k: int, weights: Array | None = None) -> Any:
    """Σ a_j b_{k−j} over all orders j, or Σ weights_j a_j b_{k−j} from the first order on."""
    if weights is None:
        return np.einsum("jl,jl->l", a[: k + 1], b[k::-1])
    stop = len(weights) + 1
    return np.einsum("j,jl,jl->l", weights, a[1:stop], b[k - stop + 1 : k][::-1])


def _value(kind: int, a: Array, b: Array, s: float) -> tuple[Any, Any]:
    """Order 0 of a function, and of its companion."""
    match kind:
        case tape.DIVIDE:
            return a / b, None
        case tape.POWER:
            return a**s, None
        case tape.TANH:
            return np.tanh(a), 1.0 / np.cosh(np.clip(a, -350.0, 350.0)) ** 2
        case tape.SINE:
            return np.sin(a), np.cos(a)
    return VALUES[kind](a), None


def _function(
    kind: int, now: Array, w: tuple[Array, Array, Array], s: float, k: int
) -> tuple[Any, Any]:
    """Order k ≥ 1 of a function and of its companion, from lower orders and ``now``, that of a.

    ``w`` has the orders (order + 1, lanes) of the operands a and b, and of the result c.
    """
    a, b, c = w
    orders, companion = np.arange(1.0, k + 1.0), None
    match kind:
        case tape.DIVIDE:
            c[k] = (now - _cauchy(b, c, k, np.ones(k))) / b[0]
        case tape.ROOT:
            c[k] = 0.5 * (now - _cauchy(c, c, k, np.ones(k - 1))) / c[0]
        case tape.POWER:
            c[k] = _cauchy(a, c, k, (s + 1.0) * orders - k) / (k * a[0])
        case tape.EXP:
            c[k] = _cauchy(a, c, k, orders / k)
        case tape.LOG:
            c[k] = (now - _cauchy(c, a, k, orders[:-1] / k)) / a[0]
        case tape.TANH:
            c[k] = _cauchy(a, b, k, orders / k)
            companion = -_cauchy(c, c, k)
        case _:
            c[k] = _cauchy(a, b, k, orders / k)
            companion = _cauchy(a, c, k, -orders / k)
    return c[k], companion


def _change(row: tuple[Any, ...], d: Array, w: tuple[Array, Array, Array]) -> None:
    """First change of a row that is not linear in others, from orders 0 of a, b and c."""
    kind, out, first, second, s = row
    a, b, c = (orders[0] for orders in w)
    match kind:
        case tape.MULTIPLY:
            d[out] = d[first] * b + a * d[second]
        case tape.PRODUCT:
            d[out] += d[first] * b + a * d[second]
        case tape.DIVIDE:
            d[out] = (d[first] - c * d[second]) / b
        case tape.ROOT:
            d[out] = 0.5 * d[first] / c
        case tape.POWER:
            d[out] = s * c / a * d[first]
        case tape.EXP:
            d[out] = c * d[first]
        case tape.LOG:
            d[out] = d[first] / a
        case _:
            d[out] = b * d[first]
            d[second] = -2.0 * c * d[out] if kind == tape.TANH else -c * d[first]
