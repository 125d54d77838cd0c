"""What each operation of a tape becomes in a program: instructions on rows.

A rule takes the translation and the operation, and returns the rows of the result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from . import arrangements as arr
from . import kernels
from . import products as prod
from . import recurrences as rec
from .power_series import Series
from .translation import Row, Rows, Rule, Table, Translation, UntranslatableError


def translate(t: Translation, series: Series, operation: rec.Operation) -> None:
    """Add what finds a series to a program.

    Raises
    ------
    UntranslatableError
        The kernels do not know the operation, or not in this shape.
    """
    rule = RULES.get(type(operation))
    if rule is None:
        raise UntranslatableError(type(operation).__name__)
    t.result(series, operation, rule)


def _each(function: Callable[..., int], *operands: Table) -> Rows:
    """A function of scalars on arrays of rows or constants, broadcast."""
    shape = operands[0].shape
    if any(x.shape != shape for x in operands):
        shape = np.broadcast_shapes(*(x.shape for x in operands))
        operands = tuple(np.broadcast_to(x, shape) for x in operands)
    found = [function(*x) for x in zip(*(x.ravel().tolist() for x in operands), strict=True)]
    return np.array(found, dtype=np.int64).reshape(shape)


def _add(t: Translation, operation: arr.Add) -> Rows:
    (a, _), (b, sign) = operation.terms
    if rec.is_series(a) and rec.is_series(b):
        return _each(lambda x, y: t.instruct(kernels.ADD, x, y, sign), t.rows[a], t.rows[b])
    series, constant = (a, b) if rec.is_series(a) else (b, a)
    factor = 1.0 if rec.is_series(a) else sign
    array = np.asarray(constant, dtype=float)
    values = np.empty(t.leading(array.shape), dtype=object)
    values.ravel()[:] = [row.tobytes() for row in array.reshape(values.size, -1)]
    return _each(lambda x, value: _shifted(t, x, factor, value), t.rows[series], values)


def _shifted(t: Translation, row: int, factor: float, value: bytes) -> int:
    """A row plus a constant: the higher orders are the row's own."""
    key = ("shifted", row, factor, value)
    if key not in t.known:
        out = int(t.new()[0])
        t.known[key] = t.append(kernels.SCALE, out, row, 0, factor)
    return t.known[key]


def _scale(t: Translation, operation: arr.Scale) -> Rows:
    rows = t.rows[operation.operands[0]]
    return _each(lambda f, r: t.combination([(f, r)]), t.constant(operation.factor), rows)


def _where(t: Translation, operation: arr.Where) -> Rows:
    a, b = (t.given(x) for x in operation.both)
    mask = t.constant(np.broadcast_to(operation.condition, operation.shape).astype(float))

    def chosen(m: Any, x: int, y: int) -> int:
        if isinstance(m, Row):
            return t.instruct(kernels.SELECT, x, y, float(m.number))
        return x if m else y

    return _each(chosen, mask, a, b)


def _index(t: Translation, operation: arr.Index) -> Rows:
    source = operation.operands[0]
    rows, index = t.rows[source], operation.index
    if source not in t.laned:
        if any(isinstance(i, np.ndarray) for i in index):
            return _picked(t, rows, index)
        return np.asarray(rows[index])
    numbers = np.broadcast_to(np.arange(t.points), source.shape)[index]
    if numbers.ndim == 0 or numbers.shape[-1] != t.points or (numbers != np.arange(t.points)).any():
        raise UntranslatableError("an index on the axis of the points")
    return np.asarray(np.broadcast_to(rows, source.shape)[index][..., :1])


def _picked(t: Translation, rows: Rows, index: tuple[Any, ...]) -> Rows:
    """One of several rows for each point: array[..., which]."""
    if len(index) != 2 or index[0] is not Ellipsis or np.shape(index[1]) != (t.points,):
        raise UntranslatableError("an index by arrays")
    masks = np.stack([index[1] == r for r in range(rows.shape[-1])]).astype(float)
    choice = t.constant(masks).reshape(-1) if t.points > 1 else masks.ravel()
    if len(choice) != len(masks):
        raise UntranslatableError("an index on as many rows as there are points")
    leading = rows.reshape(-1, rows.shape[-1])
    found = [t.combination(list(zip(choice, row.tolist(), strict=True))) for row in leading]
    return np.array(found, dtype=np.int64).reshape((*rows.shape[:-1], 1))


def _sum(t: Translation, operation: arr.Sum) -> Rows:
    source = operation.operands[0]
    if source in t.laned and -1 in operation.axes:
        raise UntranslatableError("a sum over the points")
    rows = np.moveaxis(t.rows[source], operation.axes, range(len(operation.axes)))
    columns = rows.reshape(-1, *rows.shape[len(operation.axes) :])
    return _each(lambda *terms: t.combination([(1.0, r) for r in terms]), *columns)


def _stack(t: Translation, operation: arr.Stack) -> Rows:
    parts = [t.given(x) for x in operation.arrays]
    shape = t.leading(operation.shape)
    return np.stack([np.broadcast_to(p, shape) for p in parts], axis=operation.axis)


def _multiply(t: Translation, operation: prod.Multiply) -> Rows:
    return _each(lambda x, y: t.products([(x, y)]), *(t.rows[x] for x in operation.operands))


def _square(t: Translation, operation: prod.Square) -> Rows:
    return _each(lambda x: t.products([(x, x)]), t.rows[operation.operands[0]])


def _einsum(t: Translation, operation: prod.Einsum) -> Rows:
    a, b = operation.operands
    return _contracted(
        t.products, (operation.left, operation.right, operation.out), t.rows[a], t.rows[b]
    )


def _einsum_with_constant(t: Translation, operation: prod.EinsumWithConstant) -> Rows:
    rows = t.rows[operation.operands[0]]
    constant = t.constant(operation.constant, spread="..." in operation.labels)
    return _contracted(
        t.combination, (operation.labels, operation.own, operation.out), constant, rows
    )


def _contracted(
    join: Callable[[Iterable[tuple[Any, Any]]], int],
    labels: tuple[str, str, str],
    a: Table,
    b: Table,
) -> Rows:
    """An Einstein sum over arrays of rows or constants; ``join`` adds up the products."""
    shape, terms = _terms(labels, a.shape, b.shape)
    first, second = a.ravel().tolist(), b.ravel().tolist()
    found = [join([(first[i], second[j]) for i, j in entry]) for entry in terms]
    return np.array(found, dtype=np.int64).reshape(shape)


@lru_cache(maxsize=256)
def _terms(
    labels: tuple[str, str, str], left: tuple[int, ...], right: tuple[int, ...]
) -> tuple[tuple[int, ...], list[list[tuple[int, int]]]]:
    """Shape of an Einstein sum, and which entries are multiplied for each of its own."""
    names = _spelt(labels, len(left), len(right))
    sizes: dict[str, int] = {}
    for name, shape in ((names[0], left), (names[1], right)):
        for label, size in zip(name, shape, strict=True):
            sizes[label] = max(size, sizes.get(label, 1))
    summed = [x for x in sizes if x not in names[2]]
    whole = tuple(sizes[x] for x in names[2])
    first, second = (np.arange(int(np.prod(shape))).reshape(shape) for shape in (left, right))
    terms = []
    for place in np.ndindex(whole):
        at = dict(zip(names[2], place, strict=True))
        entry = []
        for inner in product(*(range(sizes[x]) for x in summed)):
            at.update(zip(summed, inner, strict=True))
            entry.append((_entry(first, names[0], at), _entry(second, names[1], at)))
        terms.append(entry)
    return whole, terms


def _spelt(labels: tuple[str, str, str], left: int, right: int) -> list[str]:
    """Labels with names for the axes of an ellipsis, the last axis always the same."""
    a, b, out = (x.replace("...", ".") for x in labels)
    tails = [
        "".join(chr(ord("0") + i) for i in reversed(range(ndim - len(x.replace(".", "")))))
        for x, ndim in ((a, left), (b, right))
    ]
    return [
        x.replace(".", t) for x, t in ((a, tails[0]), (b, tails[1]), (out, max(tails, key=len)))
    ]


def _entry(array: Table, labels: str, at: Mapping[str, int]) -> int:
    """One entry; axes of length one broadcast."""
    return int(
        array[tuple(at[x] if n > 1 else 0 for x, n in zip(labels, array.shape, strict=True))]
    )


def _divide(t: Translation, operation: rec.Divide) -> Rows:
    top = t.given(operation.numerator)
    return _each(lambda x, y: t.instruct(kernels.DIVIDE, x, y), top, t.rows[operation.b])


def _unary(name: str) -> Rule:
    def make(t: Translation, operation: rec.Operation) -> Rows:
        s = getattr(operation, "exponent", 0.0)
        kind = getattr(kernels, name)
        return _each(lambda x: t.instruct(kind, x, 0, s), t.rows[operation.operands[0]])

    return make


def _with_companion(name: str) -> Rule:
    def make(t: Translation, operation: Any) -> Rows:
        rows = t.rows[operation.operands[0]]
        companions = t.new(rows.size).reshape(rows.shape)
        t.written.update(companions.ravel().tolist())
        t.begin(companions, operation.slope)
        return _each(lambda x, y: t.instruct(getattr(kernels, name), x, y), rows, companions)

    return make


RULES: dict[type[rec.Operation], Rule] = {
    arr.Add: _add,
    arr.Scale: _scale,
    arr.Where: _where,
    arr.Index: _index,
    arr.Sum: _sum,
    arr.Stack: _stack,
    prod.Multiply: _multiply,
    prod.Square: _square,
    prod.Einsum: _einsum,
    prod.EinsumWithConstant: _einsum_with_constant,
    rec.Divide: _divide,
    rec.SquareRoot: _unary("ROOT"),
    rec.Power: _unary("POWER"),
    rec.Exp: _unary("EXP"),
    rec.Log: _unary("LOG"),
    rec.Tanh: _with_companion("TANH"),
    rec.Sine: _with_companion("SINE"),
    rec.Cosine: _with_companion("COSINE"),
}
