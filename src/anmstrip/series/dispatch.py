"""Which operation stands for which numpy function, when an operand is a series."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import arrangements as arr
from . import products as prod
from . import recurrences as rec

if TYPE_CHECKING:
    from .power_series import Series, Tape

COMPARISONS = {
    np.greater,
    np.greater_equal,
    np.less,
    np.less_equal,
    np.equal,
    np.not_equal,
    np.isfinite,
    np.isnan,
}
"""Functions that look at order 0 alone and give plain booleans."""


def _multiply(tape: Tape, a: Any, b: Any) -> Series:
    if rec.is_series(a) and rec.is_series(b):
        return tape.record(prod.Square(a) if a is b else prod.Multiply(a, b))
    return tape.record(arr.Scale(a, b) if rec.is_series(a) else arr.Scale(b, a))


def _divide(tape: Tape, a: Any, b: Any) -> Series:
    if rec.is_series(b):
        return tape.record(rec.Divide(a, b))
    return tape.record(arr.Scale(a, 1.0 / np.asarray(b, dtype=float)))


def _power(tape: Tape, a: Any, exponent: Any) -> Any:
    if rec.is_series(exponent):
        return np.exp(exponent * np.log(a))
    exponent = float(exponent)
    if exponent == 0.0:
        return a * 0.0 + 1.0
    if exponent > 0.0 and exponent.is_integer():
        return _repeated(a, int(exponent))
    return tape.record(rec.Power(a, exponent))


def _repeated(a: Any, n: int) -> Any:
    """a^n by repeated squaring, which also holds where a = 0."""
    if n == 1:
        return a
    half = _repeated(a, n // 2)
    square = half * half
    return square * a if n % 2 else square


def _matmul(tape: Tape, a: Any, b: Any) -> Any:
    if rec.is_series(a) or np.ndim(a) != 2:
        return NotImplemented
    subscripts = "ij,j->i" if b.ndim == 1 else "ij,...jk->...ik"
    return tape.record(prod.einsum(subscripts, a, b))


def _sum(tape: Tape, a: Series, axis: int | None = None) -> Series:
    return a.sum(axis)


def _stack(tape: Tape, arrays: Sequence[Any], axis: int = 0) -> Series:
    return tape.record(arr.Stack(arrays, axis))


def _unary(kind: type[rec.Operation]) -> Callable[[Tape, Series], Series]:
    return lambda tape, a: tape.record(kind(a))  # type: ignore[call-arg]


UFUNCS: dict[Any, Callable[..., Any]] = {
    np.add: lambda tape, a, b: tape.record(arr.Add(a, b)),
    np.subtract: lambda tape, a, b: tape.record(arr.Add(a, b, sign=-1.0)),
    np.multiply: _multiply,
    np.divide: _divide,
    np.power: _power,
    np.matmul: _matmul,
    np.negative: lambda tape, a: tape.record(arr.Scale(a, -1.0)),
    np.square: _unary(prod.Square),
    np.sqrt: _unary(rec.SquareRoot),
    np.exp: _unary(rec.Exp),
    np.log: _unary(rec.Log),
    np.tanh: _unary(rec.Tanh),
    np.sin: _unary(rec.Sine),
    np.cos: _unary(rec.Cosine),
}

FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.einsum: lambda tape, subscripts, a, b: tape.record(prod.einsum(subscripts, a, b)),
    np.where: lambda tape, condition, a, b: tape.record(arr.Where(condition, a, b)),
    np.sum: _sum,
    np.stack: _stack,
}
