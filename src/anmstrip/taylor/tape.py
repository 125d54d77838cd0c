"""Recording of a law as instructions on rows.

A row is the truncated power series of one component, at all points.  The last axis of an array
that differs from point to point is carried in the lanes of its rows, so that an array of shape
(3, 2, points) has six of them.  Equal instructions are noted once: E_12 and E_21 share a row,
and indexing or stacking is no instruction at all.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anmstrip.arrays import Array

Rows = NDArray[np.int64]
Table = NDArray[Any]
"""Numbers of rows, or constants: floats and :class:`PerPoint`."""

# Kinds of instructions: c is the row of the result, a, b, d the operands, s the parameter, f the
# constant number b.  Up to EQUAL they need no lower orders of their operands.
CONSTANT = 0  # c = f
SHIFT = 1  # c = s a + f
SCALE = 2  # c = s a
SCALE_BY = 3  # c = f a
COMBINE = 4  # c += s a
COMBINE_BY = 5  # c += f a
ADD = 6  # c = a + s b
SELECT = 7  # c = a where d is not zero, else b
LESS = 8  # c = 1 where a < b, else 0
LESS_EQUAL = 9
EQUAL = 10
MULTIPLY = 11  # c = a b
PRODUCT = 12  # c += a b
DIVIDE = 13  # c = a / b
ROOT = 14  # c = √a
POWER = 15  # c = a^s
EXP = 16
LOG = 17
TANH = 18  # b, a result too: 1 − c²
SINE = 19  # b, a result too: the cosine

# What a row of numbers asks :func:`anmstrip.taylor.kernels.run` for, and how long it is.
LIFT, GATHER, ADVANCE, DERIVATIVES, ASSEMBLE = range(5)
CALL = 16


class MixedPointsError(Exception):
    """An operation joins what belongs to different points."""


class PerPoint(NamedTuple):
    """A constant that differs from point to point, by its number."""

    number: int


class Variable(NamedTuple):
    """Place of an array: its rows, its shape, and whether its last axis is in the lanes."""

    rows: Rows
    shape: tuple[int, ...]
    laned: bool


class Tables(NamedTuple):
    """A finished recording.

    Attributes
    ----------
    code : ndarray of int, shape (instructions, 5)
        Kind, result, and the operands a, b, d.
    parameters : ndarray, shape (instructions,)
        s.
    constants : ndarray, shape (constants, blocks, lanes)
    kept : ndarray of int, shape (rows,)
        Place among the rows whose lower orders are needed, −1 for the others.
    inputs, outputs : ndarray of int
        Rows.
    """

    code: NDArray[np.int64]
    parameters: Array
    constants: Array
    kept: Rows
    inputs: Rows
    outputs: Rows


class Tape:
    """Rows, instructions and constants in the making.

    Parameters
    ----------
    points : int
        Length of the axis that is carried in the lanes; 1 where every entry has a row.

    Attributes
    ----------
    values : list of ndarray
        The state at which to look where a law decides by values.
    decided : bool
        Whether it did; then the recording holds at this state alone.
    """

    def __init__(self, points: int) -> None:
        self.points, self.decided = points, False
        self.values: list[Array] = []
        self.inputs: list[Variable] = []
        self.count = 0
        self.code: list[tuple[int, int, int, int, int]] = []
        self.parameters: list[float] = []
        self.constants: list[Array] = []
        self.known: dict[Any, int] = {}

    def new(self, count: int) -> Rows:
        """Fresh rows."""
        self.count += count
        return np.arange(self.count - count, self.count)

    def input(self, shape: tuple[int, ...]) -> Variable:
        """A new input; its last axis is in the lanes if it runs over the points."""
        laned = self.ends_in_points(shape)
        rows = self.rows_shape(shape, laned)
        variable = Variable(self.new(int(np.prod(rows))).reshape(rows), shape, laned)
        self.inputs.append(variable)
        return variable

    def ends_in_points(self, shape: Sequence[int]) -> bool:
        """Whether the last axis may run over the points."""
        return self.points != 1 and len(shape) > 0 and shape[-1] == self.points

    @staticmethod
    def rows_shape(shape: tuple[int, ...], laned: bool) -> tuple[int, ...]:
        """Shape of the rows of an array: one for all lanes."""
        return (*shape[:-1], 1) if laned else shape

    def number(self, constant: float | PerPoint | Array) -> int:
        """Number of a constant in the table."""
        if isinstance(constant, PerPoint):
            return constant.number
        key = constant.tobytes() if isinstance(constant, np.ndarray) else constant
        if ("number", key) not in self.known:
            self.known["number", key] = len(self.constants)
            self.constants.append(np.broadcast_to(np.asarray(constant, float), self.points))
        return self.known["number", key]

    def spread(self, value: Any, laned: bool) -> Table:
        """Constants as floats, or one :class:`PerPoint` for a last axis that is in the lanes."""
        array = np.asarray(value, dtype=float)
        if not (laned and self.ends_in_points(array.shape)):
            return array
        table = np.empty(array.shape[:-1], dtype=object)
        rows = array.reshape(table.size, self.points)
        table.ravel()[:] = [PerPoint(self.number(row)) for row in rows]
        return table[..., None]

    def append(self, kind: int, out: int, a: int, b: int = 0, d: int = 0, s: float = 0.0) -> int:
        """Note an instruction."""
        self.code.append((kind, out, a, b, d))
        self.parameters.append(s)
        return out

    def once(self, kind: int, a: int, b: int = 0, d: int = 0, *, s: float = 0.0) -> int:
        """Row of an instruction, noted if there is no equal one yet."""
        key = (kind, a, b, d, s)
        if key not in self.known:
            self.count += 1
            self.known[key] = self.append(kind, self.count - 1, a, b, d, s)
        return self.known[key]

    def constant(self, value: float | PerPoint) -> int:
        """Row of a constant."""
        return self.once(CONSTANT, 0, self.number(value))

    def shifted(self, row: int, factor: float, value: float | PerPoint) -> int:
        """Row of factor × row + constant."""
        if value == 0.0:
            return self.combination([(factor, row)])
        return self.once(SHIFT, row, self.number(value), s=factor)

    def paired(self, kind: int, a: int) -> tuple[int, int]:
        """Rows of a function and of its companion."""
        if (kind, a) not in self.known:
            self.count += 2
            self.known[kind, a] = self.append(kind, self.count - 2, a, self.count - 1)
        return self.known[kind, a], self.known[kind, a] + 1

    def combination(self, terms: Iterable[tuple[Any, int]]) -> int:
        """Row of Σ factor × row."""
        merged: dict[tuple[int, int], Any] = {}
        for factor, row in terms:
            if isinstance(factor, PerPoint):
                merged[row, factor.number] = factor
            elif factor != 0.0:
                merged[row, -1] = merged.get((row, -1), 0.0) + factor
        if not merged:
            return self.constant(0.0)
        key = tuple((row, factor) for (row, _), factor in merged.items())
        if len(key) == 1 and key[0][1] == 1.0:
            return key[0][0]
        if key not in self.known:
            self.known[key] = self._combined(key)
        return self.known[key]

    def _combined(self, terms: tuple[tuple[int, Any], ...]) -> int:
        out = int(self.new(1)[0])
        (row, factor), *rest = terms
        if isinstance(factor, PerPoint):
            self.append(SCALE_BY, out, row, factor.number)
        elif factor == 1.0 and rest and not isinstance(rest[0][1], PerPoint):
            self.append(ADD, out, row, rest[0][0], s=rest[0][1])
            rest = rest[1:]
        else:
            self.append(SCALE, out, row, s=factor)
        for row, factor in rest:
            if isinstance(factor, PerPoint):
                self.append(COMBINE_BY, out, row, factor.number)
            else:
                self.append(COMBINE, out, row, s=factor)
        return out

    def products(self, pairs: Iterable[tuple[int, int]]) -> int:
        """Row of Σ row × row."""
        ordered = tuple((a, b) if a <= b else (b, a) for a, b in pairs)
        key = ("products", ordered)
        if key not in self.known:
            self.known[key] = out = int(self.new(1)[0])
            for i, (a, b) in enumerate(ordered):
                self.append(PRODUCT if i else MULTIPLY, out, a, b)
        return self.known[key]

    def kept(self, code: NDArray[np.int64]) -> Rows:
        """Place of every row among those whose lower orders are needed, −1 for the others."""
        kind, out, a, b, d = code.T
        whole = (kind >= MULTIPLY) & (kind != DIVIDE) & (kind != ROOT)
        both = (kind >= MULTIPLY) & ((kind <= DIVIDE) | (kind >= TANH))
        needed = (a[whole], b[both], d[kind == SELECT], out[kind >= DIVIDE])
        rows = np.unique(np.concatenate(needed))
        places = np.full(self.count, -1)
        places[rows] = np.arange(len(rows))
        return places
