"""Series: symbols on which plain numpy expressions run while a law is recorded.

Every numpy function is lowered here to instructions on the rows of its operands; how an
instruction is computed is left to the executors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from anmstrip.arrays import Array
from anmstrip.taylor import tape as kinds
from anmstrip.taylor.program import Orders, Program
from anmstrip.taylor.tape import MixedPointsError, PerPoint, Rows, Table, Tape, Variable

FEW_POINTS = 32
"""Entries of the last axis from which on they are taken for points."""


class Series(np.lib.mixins.NDArrayOperatorsMixin):
    """An array whose entries are truncated power series, while a law is recorded.

    Parameters
    ----------
    tape : Tape
        Where the operations on it are noted.
    variable : Variable
    """

    __slots__ = ("laned", "rows", "shape", "tape")
    __array_priority__ = 1000
    __hash__ = object.__hash__

    def __init__(self, tape: Tape, variable: Variable) -> None:
        self.tape = tape
        self.rows, self.shape, self.laned = variable

    @classmethod
    def input(cls, tape: Tape, value: ArrayLike) -> Series:
        """A new input of a recording; the value counts where the law decides by it."""
        array = np.asarray(value, dtype=float)
        tape.values.append(array)
        return cls(tape, tape.input(array.shape))

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def value(self) -> Array:
        """Order 0 at the state of the recording, which then holds at this state alone."""
        self.tape.decided = True
        program = Program(self.tape, Variable(self.rows, self.shape, self.laned))
        return program.start(*self.tape.values).value

    def __bool__(self) -> bool:
        return bool(self.value)

    def __repr__(self) -> str:
        return f"Series(shape={self.shape})"

    def __getitem__(self, index: Any) -> Series:
        return _indexed(self, index if isinstance(index, tuple) else (index,))

    def sum(self, axis: int | None = None) -> Series:
        """Sum along one axis, or over all of them."""
        return _sum(self.tape, self, axis)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        lower = UFUNCS.get(ufunc)
        if method != "__call__" or options or lower is None:
            raise without_series(ufunc)
        return lower(self.tape, *inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        lower = FUNCTIONS.get(function)
        if lower is None:
            raise without_series(function)
        return lower(self.tape, *args, **kwargs)


def without_series(function: Any) -> TypeError:
    """Return the error of a numpy function that a law calls and that has no series."""
    some = "sqrt, exp, log, tanh, sin, cos, einsum, stack and where"
    return TypeError(f"np.{function.__name__} has no series; np's {some} have")


def record(
    law: Callable[..., Any], *values: ArrayLike, points: int = 1, compiled: bool = False
) -> Program:
    """Record a law once, for all states of these shapes.

    Parameters
    ----------
    law : callable
        Function of as many arrays as there are values, written in numpy.
    *values : array_like
        A state: its shapes count, and its values where the law decides by them.
    points : int
        Length of the last axis of everything that differs from point to point.  It is carried
        in lanes if the law leaves the points apart, else every entry is on its own.
    compiled : bool
        Whether to use the compiled loops, where numba is installed.
    """
    for lanes in (points, 1):
        tape = Tape(lanes)
        inputs = [Series.input(tape, x) for x in values]
        try:
            output = law(*inputs)
            if not isinstance(output, Series):
                output = np.asarray(output, dtype=float)
                output = _each(tape, tape.constant, output)
        except MixedPointsError:
            continue
        return Program(tape, Variable(output.rows, output.shape, output.laned), compiled=compiled)
    raise AssertionError("the last recording mixes no points")


class RecordedFunction:
    """A function of arrays, with its program once that is needed.

    Parameters
    ----------
    function : callable
        Function of arrays, written in numpy.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.program: Program | None = None

    def __call__(self, *values: Any) -> Any:
        return self.function(*values)

    def start(self, *values: ArrayLike, order: int = 1) -> Orders:
        """Orders about a state; recorded anew for other shapes, or where values decide."""
        program = self.program
        shapes = [np.shape(x) for x in values]
        if program is None or not program.reusable or shapes != [x.shape for x in program.inputs]:
            lengths = {shape[-1] for shape in shapes if shape}
            alike = len(lengths) == 1 and min(lengths) >= FEW_POINTS
            points = lengths.pop() if alike else 1
            self.program = program = record(self.function, *values, points=points)
        return program.start(*values, order=order)


def recorded(function: Callable[..., Any]) -> RecordedFunction:
    """A function that keeps its program, itself if it does already."""
    return function if isinstance(function, RecordedFunction) else RecordedFunction(function)


def taylor_series(law: Callable[..., Any], *inputs: ArrayLike) -> Array:
    """Taylor coefficients of ``law`` along inputs given by theirs.

    Parameters
    ----------
    law : callable
        Function of as many arrays as there are inputs, written in numpy.
    *inputs : array_like, shape (order + 1, ...)
        Coefficients of each argument.

    Returns
    -------
    ndarray, shape (order + 1, ...)

    Raises
    ------
    ValueError
        An input has no coefficients, or they have different numbers of them.

    Examples
    --------
    >>> taylor_series(np.exp, [0.0, 1.0, 0.0])
    array([1. , 1. , 0.5])
    """
    given = [np.asarray(c, dtype=float) for c in inputs]
    counts = {len(c) if c.ndim else 0 for c in given}
    if len(counts) != 1 or 0 in counts:
        shapes = ", ".join(str(c.shape) for c in given) or "none"
        raise ValueError(
            f"expected inputs of shape (order + 1, ...), all of one order; got {shapes}"
        )
    order = len(given[0]) - 1
    orders = recorded(law).start(*(c[0] for c in given), order=order)
    higher = [orders.advance(k, *(c[k] for c in given)) for k in range(1, order + 1)]
    return np.stack([orders.value, *higher])


def _shape(x: Any) -> tuple[int, ...]:
    return x.shape if isinstance(x, Series) else np.shape(x)


def _each(tape: Tape, function: Callable[..., int], *operands: Any) -> Series:
    """Rows that a function of scalars gives, on arrays of series and constants, broadcast."""
    shape = np.broadcast_shapes(*(_shape(x) for x in operands))
    laned = _is_laned(tape, shape, operands)
    tables = [_table(tape, x, laned) for x in operands]
    rows = tape.rows_shape(shape, laned)
    if any(x.shape != rows for x in tables):
        tables = [np.broadcast_to(x, rows) for x in tables]
    found = [function(*x) for x in zip(*(x.ravel().tolist() for x in tables), strict=True)]
    return Series(tape, Variable(np.array(found, dtype=np.int64).reshape(rows), shape, laned))


def _is_laned(tape: Tape, shape: tuple[int, ...], operands: Iterable[Any]) -> bool:
    """Whether the last axis of a result is in the lanes: that of an operand is, or a constant's."""
    series = [x for x in operands if isinstance(x, Series)]
    if any(x.laned for x in series):
        return True
    return tape.ends_in_points(shape) and not any(tape.ends_in_points(x.shape) for x in series)


def _table(tape: Tape, x: Any, laned: bool) -> Table:
    """Rows of a series, or constants."""
    if not isinstance(x, Series):
        return tape.spread(x, laned)
    if laned and not x.laned and tape.ends_in_points(x.shape):
        raise MixedPointsError
    return x.rows


def _wrapped(tape: Tape, x: Any) -> Series:
    """A series as it is, constants as one."""
    return x if isinstance(x, Series) else _each(tape, tape.constant, x)


def _instruction(kind: int, s: float = 0.0) -> Callable[..., Series]:
    """An instruction for one or two operands, entry by entry."""

    def lower(tape: Tape, *operands: Any) -> Series:
        series = (_wrapped(tape, x) for x in operands)
        return _each(tape, lambda *rows: tape.once(kind, *rows, s=s), *series)

    return lower


def _paired(kind: int, which: int) -> Callable[[Tape, Series], Series]:
    return lambda tape, a: _each(tape, lambda row: tape.paired(kind, row)[which], a)


def _add(sign: float) -> Callable[[Tape, Any, Any], Series]:
    def lower(tape: Tape, a: Any, b: Any) -> Series:
        if not isinstance(b, Series):
            b = sign * np.asarray(b, dtype=float)
            return _each(tape, lambda x, f: tape.shifted(x, 1.0, f), a, b)
        if not isinstance(a, Series):
            return _each(tape, lambda f, x: tape.shifted(x, sign, f), a, b)
        return _each(tape, lambda x, y: tape.combination([(1.0, x), (sign, y)]), a, b)

    return lower


def _multiply(tape: Tape, a: Any, b: Any) -> Series:
    if isinstance(a, Series) and isinstance(b, Series):
        return _each(tape, lambda x, y: tape.products([(x, y)]), a, b)
    if isinstance(a, Series):
        a, b = b, a
    return _each(tape, lambda f, x: tape.combination([(f, x)]), a, b)


def _divide(tape: Tape, a: Any, b: Any) -> Series:
    if isinstance(b, Series):
        return _instruction(kinds.DIVIDE)(tape, a, b)
    return _multiply(tape, a, 1.0 / np.asarray(b, dtype=float))


def _power(tape: Tape, a: Any, exponent: Any) -> Any:
    if isinstance(exponent, Series):
        return np.exp(exponent * np.log(a))
    exponent = float(exponent)
    if exponent == 0.0:
        return a * 0.0 + 1.0
    if exponent > 0.0 and exponent.is_integer():
        return _repeated(a, int(exponent))
    return _instruction(kinds.POWER, s=exponent)(tape, a)


def _repeated(a: Any, n: int) -> Any:
    """a^n by repeated squaring, which also holds where a = 0."""
    if n == 1:
        return a
    half = _repeated(a, n // 2)
    square = half * half
    return square * a if n % 2 else square


def _matmul(tape: Tape, a: Any, b: Any) -> Any:
    if isinstance(a, Series) or len(_shape(a)) != 2:
        return NotImplemented
    return _einsum(tape, "ij,j->i" if b.ndim == 1 else "ij,...jk->...ik", a, b)


def _where(tape: Tape, condition: Any, a: Any, b: Any) -> Series:
    """The branch that is not taken leaves no trace."""

    def chosen(c: int | float | PerPoint, x: int, y: int) -> int:
        if isinstance(c, float):
            return x if c else y
        return tape.once(kinds.SELECT, x, y, tape.constant(c) if isinstance(c, PerPoint) else c)

    return _each(tape, chosen, condition, _wrapped(tape, a), _wrapped(tape, b))


def _negated(tape: Tape, condition: Any) -> Series:
    """1 where a condition is 0, 0 where it is 1."""
    return _each(tape, lambda x: tape.shifted(x, -1.0, 1.0), condition)


def _either(tape: Tape, a: Any, b: Any) -> Series:
    """1 where one of two conditions is."""
    return _negated(tape, (1.0 - a) * (1.0 - b))


def _indexed(x: Series, index: tuple[Any, ...]) -> Series:
    """Part of an array; the axis of the points stays whole, unless it is made by the index."""
    tape, points = x.tape, x.tape.points
    if not x.laned:
        if points != 1 and any(_shape(i) == (points,) for i in index):
            return _picked(x, index)
        rows = np.asarray(x.rows[index])
        return Series(tape, Variable(rows, rows.shape, False))
    numbers = np.broadcast_to(np.arange(points), x.shape)[index]
    if numbers.ndim == 0 or numbers.shape[-1] != points or (numbers != np.arange(points)).any():
        raise MixedPointsError("an index on the axis of the points")
    rows = np.broadcast_to(x.rows, (*x.shape[:-1], max(points, 1)))[index][..., :1]
    return Series(tape, Variable(rows, numbers.shape, True))


def _picked(x: Series, index: tuple[Any, ...]) -> Series:
    """One of several entries for each point: array[..., which]."""
    if len(index) != 2 or index[0] is not Ellipsis:
        raise MixedPointsError("an index by arrays")
    tape, which = x.tape, np.asarray(index[1])
    masks = tape.spread([which == r for r in range(x.shape[-1])], laned=True).ravel()
    leading = x.rows.reshape(-1, x.shape[-1])
    found = [tape.combination(zip(masks, row.tolist(), strict=True)) for row in leading]
    rows = np.array(found, dtype=np.int64).reshape((*x.shape[:-1], 1))
    return Series(tape, Variable(rows, (*x.shape[:-1], tape.points), True))


def _sum(tape: Tape, x: Series, axis: int | None = None) -> Series:
    axes = tuple(range(x.ndim)) if axis is None else (axis % x.ndim,)
    if x.laned and x.ndim - 1 in axes:
        raise MixedPointsError("a sum over the points")
    shape = tuple(n for i, n in enumerate(x.shape) if i not in axes)
    rows = tape.rows_shape(shape, x.laned)
    terms = np.moveaxis(x.rows, axes, range(len(axes))).reshape(-1, int(np.prod(rows))).T
    found = [tape.combination([(1.0, row) for row in entry]) for entry in terms.tolist()]
    return Series(tape, Variable(np.array(found, dtype=np.int64).reshape(rows), shape, x.laned))


def _stack(tape: Tape, arrays: Sequence[Any], axis: int = 0) -> Series:
    shape = np.broadcast_shapes(*(_shape(x) for x in arrays))
    laned = _is_laned(tape, shape, arrays)
    axis %= len(shape) + 1
    if laned and axis == len(shape):
        raise MixedPointsError("a stack behind the points")
    rows = tape.rows_shape(shape, laned)
    tables = [_table(tape, _wrapped(tape, x), laned) for x in arrays]
    found = np.stack([np.broadcast_to(x, rows) for x in tables], axis=axis)
    return Series(tape, Variable(found, (*shape[:axis], len(arrays), *shape[axis:]), laned))


def _einsum(tape: Tape, subscripts: str, a: Any, b: Any) -> Series:
    """Einstein sum of two operands, at least one of them a series."""
    left, right, out = _spelt(subscripts, len(_shape(a)), len(_shape(b)))

    def at_points(x: Any, labels: str) -> bool:
        """Whether the last axis is that of the points, if the result has one."""
        return tape.ends_in_points(_shape(x)) and labels[-1:] == out[-1:]

    operands = [(a, left), (b, right)]
    given = [at_points(x, labels) for x, labels in operands if isinstance(x, Series)]
    laned = any(x.laned for x, _ in operands if isinstance(x, Series))
    laned = laned or (not any(given) and any(at_points(*operand) for operand in operands))
    tables = []
    for x, labels in operands:
        ends = at_points(x, labels)
        if laned and (out[-1:] in labels[:-1] or (isinstance(x, Series) and x.laned != ends)):
            raise MixedPointsError(subscripts)
        tables.append(x.rows if isinstance(x, Series) else tape.spread(x, laned and ends))
    if isinstance(a, Series) and not isinstance(b, Series):
        tables, left, right = tables[::-1], right, left
    join: Callable[..., int] = tape.products if len(given) == 2 else tape.combination
    rows, terms = _terms((left, right, out), tables[0].shape, tables[1].shape)
    first, second = (x.ravel().tolist() for x in tables)
    found = [join([(first[i], second[j]) for i, j in entry]) for entry in terms]
    shape = (*rows[:-1], tape.points) if laned else rows
    return Series(tape, Variable(np.array(found, dtype=np.int64).reshape(rows), shape, laned))


def _spelt(subscripts: str, left: int, right: int) -> tuple[str, str, str]:
    """Labels of the operands and of the result, with digits for the axes of an ellipsis.

    The last axis of an ellipsis has the same digit everywhere.
    """
    if subscripts.count(",") != 1 or "->" not in subscripts:
        raise ValueError(f"einsum of series takes 'left,right->out', not {subscripts!r}")
    inputs, out = subscripts.replace(" ", "").replace("...", ".").split("->")
    a, b = inputs.split(",")
    tails = [
        "".join(str(i) for i in reversed(range(ndim - len(x.replace(".", "")))))
        for x, ndim in ((a, left), (b, right))
    ]
    longest = max(tails, key=len)
    return a.replace(".", tails[0]), b.replace(".", tails[1]), out.replace(".", longest)


@lru_cache(maxsize=256)
def _terms(
    labels: tuple[str, str, str], left: tuple[int, ...], right: tuple[int, ...]
) -> tuple[tuple[int, ...], list[list[tuple[int, int]]]]:
    """Shape of an Einstein sum, and which entries are multiplied for each of its own."""
    sizes: dict[str, int] = {}
    for label, size in zip(labels[0] + labels[1], left + right, strict=True):
        sizes[label] = max(size, sizes.get(label, 1))
    summed = [x for x in sizes if x not in labels[2]]
    shape = tuple(sizes[x] for x in labels[2])
    first, second = (np.arange(int(np.prod(n))).reshape(n) for n in (left, right))
    terms = []
    for place in np.ndindex(shape):
        at = dict(zip(labels[2], place, strict=True))
        entry = []
        for inner in product(*(range(sizes[x]) for x in summed)):
            at.update(zip(summed, inner, strict=True))
            entry.append((_entry(first, labels[0], at), _entry(second, labels[1], at)))
        terms.append(entry)
    return shape, terms


def _entry(array: Rows, labels: str, at: Mapping[str, int]) -> int:
    """One entry; axes of length one broadcast."""
    index = (at[x] if n > 1 else 0 for x, n in zip(labels, array.shape, strict=True))
    return int(array[tuple(index)])


UFUNCS: dict[Any, Callable[..., Any]] = {
    np.add: _add(1.0),
    np.subtract: _add(-1.0),
    np.multiply: _multiply,
    np.divide: _divide,
    np.power: _power,
    np.matmul: _matmul,
    np.negative: lambda tape, a: _multiply(tape, -1.0, a),
    np.square: lambda tape, a: _multiply(tape, a, a),
    np.sqrt: _instruction(kinds.ROOT),
    np.exp: _instruction(kinds.EXP),
    np.log: _instruction(kinds.LOG),
    np.tanh: _paired(kinds.TANH, 0),
    np.sin: _paired(kinds.SINE, 0),
    np.cos: _paired(kinds.SINE, 1),
    np.less: _instruction(kinds.LESS),
    np.less_equal: _instruction(kinds.LESS_EQUAL),
    np.greater: lambda tape, a, b: _instruction(kinds.LESS)(tape, b, a),
    np.greater_equal: lambda tape, a, b: _instruction(kinds.LESS_EQUAL)(tape, b, a),
    np.equal: _instruction(kinds.EQUAL),
    np.not_equal: lambda tape, a, b: _negated(tape, _instruction(kinds.EQUAL)(tape, a, b)),
    np.isfinite: lambda tape, a: _instruction(kinds.EQUAL)(tape, a - a, 0.0),
    np.isnan: lambda tape, a: _negated(tape, _instruction(kinds.EQUAL)(tape, a, a)),
    np.invert: _negated,
    np.logical_not: _negated,
    np.bitwise_and: _multiply,
    np.logical_and: _multiply,
    np.bitwise_or: _either,
    np.logical_or: _either,
}
"""Functions of series, entry by entry; comparisons and what joins them give 0 and 1."""

FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.einsum: _einsum,
    np.where: _where,
    np.sum: _sum,
    np.stack: _stack,
    np.any: lambda tape, a: bool(np.any(a.value)),
    np.all: lambda tape, a: bool(np.all(a.value)),
}
"""Other functions; those that answer yes or no look at the values."""
