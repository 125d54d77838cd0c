"""Programs in the making: a tape's operations become scalar instructions on rows.

One row stands for one component at all points.  Products of components are looked for once
(E_12 and E_21 share their row); indexing and stacking are no instructions at all.  What an
operation becomes is said by :mod:`anmstrip.series.translation_rules`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import arrangements as arr
from . import kernels
from . import recurrences as rec
from .power_series import Series

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
Table = NDArray[Any]
"""Rows, or constants: numbers and numbered rows of them."""

Rule = Callable[["Translation", Any], Rows]
"""What makes the rows of an operation's result."""


class UntranslatableError(Exception):
    """An operation that the kernels do not know."""


class Row:
    """A constant that differs from point to point, by its number."""

    __slots__ = ("number",)

    def __init__(self, number: int) -> None:
        self.number = number


class Translation:
    """Rows, instructions and constants of a program in the making.

    Parameters
    ----------
    points : int
        Length of the last axis of everything that differs from point to point.
    """

    def __init__(self, points: int) -> None:
        self.points = points
        self.count = 0
        self.rows: dict[Series, Rows] = {}
        self.laned: set[Series] = set()
        self.now_laned = False
        self.values: list[tuple[Rows, Array]] = []
        self.code: list[tuple[int, int, int, int]] = []
        self.parameters: list[float] = []
        self.constants: list[Array] = []
        self.known: dict[Any, int] = {}
        self.written: set[int] = set()

    def _ends_in_points(self, shape: Sequence[int]) -> bool:
        return self.points > 1 and len(shape) > 0 and shape[-1] == self.points

    def _becomes_laned(self, series: Series, operation: rec.Operation) -> bool:
        """Whether a result differs from point to point: an operand does, or a constant."""
        if any(x in self.laned for x in operation.operands):
            return True
        if isinstance(operation, arr.Stack) or not self._ends_in_points(series.shape):
            return False
        return not any(self._ends_in_points(x.shape) for x in operation.operands)

    def new(self, count: int = 1) -> Rows:
        """Fresh rows."""
        self.count += count
        return np.arange(self.count - count, self.count)

    def input(self, series: Series) -> None:
        """Rows of an input, laned unless it is a single number."""
        self.now_laned = series.ndim > 0 and self._ends_in_points(series.shape)
        shape = self.leading(series.shape)
        rows = self.new(int(np.prod(shape))).reshape(shape)
        self.written.update(rows.ravel().tolist())
        self._enter(series, rows)

    def leading(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Shape of the rows of an array: one row for all points."""
        return (*shape[:-1], 1) if self.now_laned and self._ends_in_points(shape) else shape

    def _enter(self, series: Series, rows: Rows) -> None:
        self.rows[series] = rows
        if self.now_laned:
            self.laned.add(series)
        self.begin(rows, series.value)

    def begin(self, rows: Rows, value: Array) -> None:
        """Order 0 of rows."""
        flat = np.reshape(value, (rows.size, -1))
        if flat.shape[1] != self.points:
            flat = np.broadcast_to(flat, (rows.size, self.points))
        self.values.append((rows.ravel(), flat))

    def result(self, series: Series, operation: rec.Operation, rule: Rule) -> None:
        """Rows of what an operation finds, as its rule says.

        Raises
        ------
        UntranslatableError
        """
        self.now_laned = self._becomes_laned(series, operation)
        rows = rule(self, operation)
        if rows.shape != self.leading(series.shape):
            raise UntranslatableError(f"{type(operation).__name__} of shape {series.shape}")
        self._enter(series, rows)

    def tables(self) -> tuple[NDArray[np.int64], Array]:
        """Code and parameters of the kernels."""
        return np.array(self.code, dtype=np.int64).reshape(-1, 4), np.array(self.parameters)

    def remembered(self) -> Rows:
        """Rows whose lower orders are needed: operands, and results of functions."""
        kind, out, first, second = np.array(self.code, dtype=np.int64).reshape(-1, 4).T
        single = (kind >= kernels.ROOT) & (kind <= kernels.LOG)
        products, functions = kind >= kernels.MULTIPLY, kind > kernels.PRODUCT
        found = (first[products], second[products & ~single], out[functions])
        return np.unique(np.concatenate(found))

    def fixed(self, rows: Rows) -> Rows:
        """Those rows whose higher orders nobody writes: they stay zero."""
        return np.array([row for row in rows.tolist() if row not in self.written], dtype=np.int64)

    def start(self) -> Array:
        """Order 0 of all rows, shape (rows, points)."""
        whole = np.zeros((self.count, self.points))
        whole[np.concatenate([r for r, _ in self.values])] = np.concatenate(
            [v for _, v in self.values]
        )
        return whole

    def constant(self, value: Any, *, spread: bool = True) -> Table:
        """Numbers, or numbered rows of them where the last axis runs over the points."""
        array = np.asarray(value, dtype=float)
        if not (spread and self.now_laned and self._ends_in_points(array.shape)):
            return array
        flat = array.reshape(-1, self.points)
        first = len(self.constants)
        self.constants.extend(flat)
        numbers = np.empty(len(flat), dtype=object)
        numbers[:] = [Row(first + i) for i in range(len(flat))]
        return numbers.reshape(self.leading(array.shape))

    def given(self, value: Any) -> Rows:
        """Rows of a series, or new ones that hold a constant."""
        if rec.is_series(value):
            return self.rows[value]
        array = np.asarray(value, dtype=float)
        shape = self.leading(array.shape)
        rows = self.new(int(np.prod(shape))).reshape(shape)
        self.begin(rows, array)
        return rows

    def instruct(self, kind: int, first: int, second: int = 0, s: float = 0.0) -> int:
        """One instruction with a row of its own, or the row of an equal one."""
        key = (kind, first, second, s)
        if key not in self.known:
            self.known[key] = self.append(kind, int(self.new()[0]), first, second, s)
        return self.known[key]

    def append(self, kind: int, out: int, first: int, second: int, s: float) -> int:
        self.code.append((kind, out, first, second))
        self.parameters.append(s)
        self.written.add(out)
        return out

    def combination(self, terms: Iterable[tuple[Any, int]]) -> int:
        """Σ factor × row."""
        terms = tuple([x for x in terms if x[0].__class__ is Row or x[0] != 0.0])
        if terms not in self.known:
            self.known[terms] = out = int(self.new()[0])
            for i, (factor, row) in enumerate(terms):
                if isinstance(factor, Row):
                    kind = kernels.COMBINE_ROW if i else kernels.SCALE_ROW
                    self.append(kind, out, row, factor.number, 0.0)
                else:
                    kind = kernels.COMBINE if i else kernels.SCALE
                    self.append(kind, out, row, 0, float(factor))
        return self.known[terms]

    def products(self, pairs: Iterable[tuple[int, int]]) -> int:
        """Σ row × row."""
        ordered = tuple([(a, b) if a <= b else (b, a) for a, b in pairs])
        key = ("products", *ordered)
        if key not in self.known:
            self.known[key] = out = int(self.new()[0])
            for i, (a, b) in enumerate(ordered):
                self.append(kernels.PRODUCT if i else kernels.MULTIPLY, out, a, b, 0.0)
        return self.known[key]
