"""Linear operations on series: they act on every order in the same way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .recurrences import Array, Change, Operation, is_series, lifted

if TYPE_CHECKING:
    from .power_series import Series


class Add(Operation):
    """c = a ± b; either may be a constant."""

    def __init__(self, a: Any, b: Any, sign: float = 1.0) -> None:
        self.terms = [(a, 1.0), (b, sign)]
        self.operands = [x for x, _ in self.terms if is_series(x)]
        self.signs = [s for x, s in self.terms if is_series(x)]

    def start(self) -> Array:
        a, b = (x.value if is_series(x) else np.asarray(x, dtype=float) for x, _ in self.terms)
        value = a + b if self.terms[1][1] > 0.0 else a - b
        self.shape = value.shape
        return value

    def linear(self, d: Sequence[Change]) -> Change:
        parts = [
            (sign, lifted(c, x.ndim, len(self.shape)))
            for x, sign, c in zip(self.operands, self.signs, d, strict=True)
            if c is not None
        ]
        if not parts:
            return None
        sign, part = parts[0]
        if len(parts) == 2:
            return part + parts[1][1] if parts[1][0] > 0.0 else part - parts[1][1]
        lead = part.shape[: part.ndim - len(self.shape)]
        if part.shape != lead + self.shape:
            part = np.broadcast_to(part, lead + self.shape)
        return part if sign > 0.0 else -part


class Scale(Operation):
    """c = s a with a constant s."""

    def __init__(self, a: Series, factor: Any) -> None:
        self.operands = [a]
        self.factor = np.asarray(factor, dtype=float)[()]
        self.ndim = max(a.ndim, self.factor.ndim)

    def start(self) -> Array:
        return self.operands[0].value * self.factor

    def linear(self, d: Sequence[Change]) -> Change:
        if d[0] is None:
            return None
        return lifted(d[0], self.operands[0].ndim, self.ndim) * self.factor


class Where(Operation):
    """c = a where a condition holds, b elsewhere; the branch not taken leaves no trace."""

    def __init__(self, condition: Any, a: Any, b: Any) -> None:
        self.condition = np.asarray(condition, dtype=bool)
        self.both = (a, b)
        self.operands = [x for x in self.both if is_series(x)]

    def start(self) -> Array:
        value = np.where(self.condition, *(x.value if is_series(x) else x for x in self.both))
        self.shape = value.shape
        return value

    def linear(self, d: Sequence[Change]) -> Change:
        if all(c is None for c in d):
            return None
        changes = iter(d)
        parts = []
        for x in self.both:
            change = next(changes) if is_series(x) else None
            parts.append(0.0 if change is None else lifted(change, x.ndim, len(self.shape)))
        return np.where(self.condition, *parts)


class Index(Operation):
    """c = a[index], basic indexing on the coefficient's own axes."""

    def __init__(self, a: Series, index: Any) -> None:
        self.operands = [a]
        self.index = index if isinstance(index, tuple) else (index,)

    def start(self) -> Array:
        return np.asarray(self.operands[0].value[self.index])

    def linear(self, d: Sequence[Change]) -> Change:
        if d[0] is None:
            return None
        lead = d[0].ndim - self.operands[0].ndim
        return d[0][(slice(None),) * lead + self.index]


class Sum(Operation):
    """Sum along one axis of the coefficients, or over all of them (``None``)."""

    def __init__(self, a: Series, axis: int | None) -> None:
        self.operands = [a]
        axes = range(a.ndim) if axis is None else (axis % a.ndim,)
        self.axes = tuple(i - a.ndim for i in axes)

    def start(self) -> Array:
        return np.asarray(self.operands[0].value.sum(axis=self.axes))

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else d[0].sum(axis=self.axes)


class Stack(Operation):
    """Series and constants stacked along a new axis."""

    def __init__(self, arrays: Sequence[Any], axis: int) -> None:
        self.arrays = arrays
        self.operands = [x for x in arrays if is_series(x)]
        self.shape = np.broadcast_shapes(
            *(x.shape if is_series(x) else np.shape(x) for x in arrays)
        )
        self.axis = axis % (len(self.shape) + 1)

    def start(self) -> Array:
        values = [x.value if is_series(x) else x for x in self.arrays]
        return np.stack([np.broadcast_to(v, self.shape) for v in values], axis=self.axis)

    def linear(self, d: Sequence[Change]) -> Change:
        leads = [
            c.shape[: c.ndim - x.ndim]
            for x, c in zip(self.operands, d, strict=True)
            if c is not None
        ]
        if not leads:
            return None
        batch = max(leads, key=len)
        shape = (*batch, *self.shape[: self.axis], len(self.arrays), *self.shape[self.axis :])
        whole = np.zeros(shape)
        rows = np.moveaxis(whole, self.axis + len(batch), 0)
        changes = iter(d)
        for i, x in enumerate(self.arrays):
            change = next(changes) if is_series(x) else None
            if change is not None:
                rows[i] = lifted(change, x.ndim, len(self.shape))
        return whole


class LinearMap(Operation):
    """c = A a for any linear function A of arrays."""

    def __init__(self, operator: Callable[[Array], Array], a: Series) -> None:
        self.operands = [a]
        self.operator = operator

    def start(self) -> Array:
        return self.operator(self.operands[0].value)

    def linear(self, d: Sequence[Change]) -> Change:
        if d[0] is None:
            return None
        if d[0].ndim == self.operands[0].ndim:
            return self.operator(d[0])
        return np.stack([self.operator(x) for x in d[0]])
