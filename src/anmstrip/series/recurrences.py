"""Recurrences of the elementary operations on truncated power series.

For c = operation(a, b, …) every class gives

* ``start()``: order 0,
* ``remainder(k)``: the part of c_k that is known from the orders 1 … k − 1,
* ``linear(d)``: the part that is linear in order k of the operands; it uses
  order 0 alone, hence is also the derivative applied to ``d``.  Entries of
  ``d`` may carry one more leading axis (several directions at once) and are
  ``None`` where they vanish.

Recurrences as in Griewank & Walther, *Evaluating Derivatives* (2008), ch. 13.
Cauchy sums run over the order axis in one call; those of squares use half the
products.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .power_series import Series

Array = NDArray[np.float64]
Change = Array | None


class Operation:
    """One recorded operation; subclasses are final."""

    operands: Sequence[Series]
    result: Series

    def start(self) -> Array:
        """Order 0."""
        raise NotImplementedError

    def remainder(self, k: int) -> Change:
        """Part of order k known from lower orders (``None``: zero)."""
        return None

    def linear(self, d: Sequence[Change]) -> Change:
        """Derivative applied to the operands' changes."""
        raise NotImplementedError


def _is_series(x: Any) -> bool:
    return hasattr(x, "coefficients")


def _lifted(d: Array, ndim: int, target: int) -> Array:
    """Insert axes so that the last ``ndim`` axes of d broadcast as ``target`` axes."""
    if ndim == target:
        return d
    lead = d.ndim - ndim
    return d.reshape(d.shape[:lead] + (1,) * (target - ndim) + d.shape[lead:])


def _orders(x: Series, target: int) -> Array:
    return _lifted(x.coefficients, x.ndim, target)


def _cauchy(a: Array, b: Array, k: int) -> Array:
    """Σ a_j b_{k−j}, j = 1 … k − 1."""
    return np.einsum("k...,k...->...", a[1:k], b[k - 1 : 0 : -1])


def _square_sum(a: Array, k: int) -> Array:
    """Σ a_j a_{k−j}, j = 1 … k − 1, by symmetry."""
    half = (k + 1) // 2
    total = 2.0 * np.einsum("k...,k...->...", a[1:half], a[k - 1 : k - half : -1])
    return total if k % 2 else total + a[k // 2] ** 2


def _weighted_cauchy(a: Array, b: Array, k: int) -> Array:
    """Σ j a_j b_{k−j}, j = 1 … k − 1."""
    orders = np.arange(1.0, k)
    return np.einsum("k,k...,k...->...", orders, a[1:k], b[k - 1 : 0 : -1])


class Add(Operation):
    """c = a ± b; either may be a constant."""

    def __init__(self, a: Any, b: Any, sign: float = 1.0) -> None:
        self.terms = [(a, 1.0), (b, sign)]
        self.operands = [x for x, _ in self.terms if _is_series(x)]
        self.signs = [s for x, s in self.terms if _is_series(x)]

    def start(self) -> Array:
        a, b = (x.value if _is_series(x) else np.asarray(x, dtype=float) for x, _ in self.terms)
        value = a + self.terms[1][1] * b
        self.shape = value.shape
        return value

    def linear(self, d: Sequence[Change]) -> Change:
        ndim = len(self.shape)
        parts = [
            (s, _lifted(c, x.ndim, ndim))
            for x, s, c in zip(self.operands, self.signs, d, strict=True)
            if c is not None
        ]
        if not parts:
            return None
        if len(parts) == 2:
            (s, a), (t, b) = parts
            return a + b if s == t else a - b
        sign, only = parts[0]
        lead = only.shape[: only.ndim - ndim]
        if only.shape != lead + self.shape:
            only = np.broadcast_to(only, lead + self.shape)
        return only if sign > 0 else -only


class Scale(Operation):
    """c = s a with a constant s."""

    def __init__(self, a: Series, factor: Any) -> None:
        self.operands = [a]
        self.factor = np.asarray(factor, dtype=float)
        self.ndim = max(a.ndim, self.factor.ndim)

    def start(self) -> Array:
        return self.operands[0].value * self.factor

    def linear(self, d: Sequence[Change]) -> Change:
        if d[0] is None:
            return None
        return _lifted(d[0], self.operands[0].ndim, self.ndim) * self.factor


class Multiply(Operation):
    """c = a b."""

    def __init__(self, a: Series, b: Series) -> None:
        self.operands = [a, b]
        self.ndim = max(a.ndim, b.ndim)

    def start(self) -> Array:
        a, b = self.operands
        return a.value * b.value

    def remainder(self, k: int) -> Change:
        if k < 2:
            return None
        a, b = self.operands
        return _cauchy(_orders(a, self.ndim), _orders(b, self.ndim), k)

    def linear(self, d: Sequence[Change]) -> Change:
        a, b = self.operands
        left = None if d[0] is None else _lifted(d[0], a.ndim, self.ndim) * b.value
        right = None if d[1] is None else _lifted(d[1], b.ndim, self.ndim) * a.value
        if left is None or right is None:
            return right if left is None else left
        return left + right


class Square(Operation):
    """c = a²."""

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        return self.operands[0].value ** 2

    def remainder(self, k: int) -> Change:
        return _square_sum(self.operands[0].coefficients, k) if k > 1 else None

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else 2.0 * self.operands[0].value * d[0]


class Divide(Operation):
    """c = a / b, from a = b c; a may be a constant."""

    def __init__(self, a: Any, b: Series) -> None:
        self.numerator = a
        self.operands = [a, b] if _is_series(a) else [b]
        self.b = b
        self.ndim = max(np.ndim(a) if not _is_series(a) else a.ndim, b.ndim)

    def start(self) -> Array:
        a = self.numerator
        return (a.value if _is_series(a) else np.asarray(a, dtype=float)) / self.b.value

    def remainder(self, k: int) -> Change:
        if k < 2:
            return None
        return -_cauchy(_orders(self.b, self.ndim), self.result.coefficients, k) / self.b.value

    def linear(self, d: Sequence[Change]) -> Change:
        change = d[-1]
        part = None
        if change is not None:
            part = -_lifted(change, self.b.ndim, self.ndim) * self.result.value
        if len(d) == 2 and d[0] is not None:
            top = _lifted(d[0], self.operands[0].ndim, self.ndim)
            part = top if part is None else top + part
        return None if part is None else part / self.b.value


class SquareRoot(Operation):
    """c = √a, from c² = a."""

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        return np.sqrt(self.operands[0].value)

    def remainder(self, k: int) -> Change:
        if k < 2:
            return None
        return -0.5 * _square_sum(self.result.coefficients, k) / self.result.value

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else 0.5 * d[0] / self.result.value


class Power(Operation):
    """c = a^s, constant s, from a c' = s a' c; needs a ≠ 0."""

    def __init__(self, a: Series, exponent: float) -> None:
        self.operands = [a]
        self.exponent = exponent

    def start(self) -> Array:
        a = self.operands[0].value
        value = a**self.exponent
        self.slope = self.exponent * value / a
        return value

    def remainder(self, k: int) -> Change:
        if k < 2:
            return None
        a, c = self.operands[0].coefficients, self.result.coefficients
        weights = self.exponent * np.arange(1.0, k) - np.arange(k - 1.0, 0.0, -1.0)
        total = np.einsum("k,k...,k...->...", weights, a[1:k], c[k - 1 : 0 : -1])
        return total / (k * a[0])

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else self.slope * d[0]


class Exp(Operation):
    """c = exp a, from c' = a' c."""

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        return np.exp(self.operands[0].value)

    def remainder(self, k: int) -> Change:
        if k < 2:
            return None
        return _weighted_cauchy(self.operands[0].coefficients, self.result.coefficients, k) / k

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else self.result.value * d[0]


class Log(Operation):
    """c = log a, from a c' = a'."""

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        return np.log(self.operands[0].value)

    def remainder(self, k: int) -> Change:
        if k < 2:
            return None
        a = self.operands[0].coefficients
        return -_weighted_cauchy(self.result.coefficients, a, k) / (k * a[0])

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else d[0] / self.operands[0].value


class _WithCompanion(Operation):
    """c = φ(a) with c' = s a', where s(a) is a companion series of its own.

    The companion's order k − 1 is completed when order k begins, since order
    k − 1 of c is final only then.
    """

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        a = self.operands[0]
        value, slope = self.values(a.value)
        self.companion = np.zeros((a.tape.order + 1, *a.shape))
        self.companion[0] = slope
        return value

    def values(self, a: Array) -> tuple[Array, Array]:
        """Order 0 of the function and of its companion."""
        raise NotImplementedError

    def companion_order(self, k: int) -> Array:
        """Order k of the companion, all else known."""
        raise NotImplementedError

    def remainder(self, k: int) -> Change:
        if k < 2:
            return None
        self.companion[k - 1] = self.companion_order(k - 1)
        return _weighted_cauchy(self.operands[0].coefficients, self.companion, k) / k

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else self.companion[0] * d[0]


class Tanh(_WithCompanion):
    """c = tanh a, companion s = 1 − c²."""

    def values(self, a: Array) -> tuple[Array, Array]:
        value = np.tanh(a)
        return value, 1.0 / np.cosh(np.clip(a, -350.0, 350.0)) ** 2

    def companion_order(self, k: int) -> Array:
        c = self.result.coefficients
        inner = _square_sum(c, k) if k > 1 else 0.0
        return -(2.0 * c[0] * c[k] + inner)


class Sine(_WithCompanion):
    """c = sin a, companion s = cos a."""

    def values(self, a: Array) -> tuple[Array, Array]:
        return np.sin(a), np.cos(a)

    def companion_order(self, k: int) -> Array:
        a, c = self.operands[0].coefficients, self.result.coefficients
        inner = _weighted_cauchy(a, c, k) / k if k > 1 else 0.0
        return -(inner + a[k] * c[0])


class Cosine(Sine):
    """c = cos a, companion s = −sin a, hence s' = −c a' as for the sine."""

    def values(self, a: Array) -> tuple[Array, Array]:
        return np.cos(a), -np.sin(a)


class Einsum(Operation):
    """c = einsum of two operands, at least one of them a series.

    Subscripts are explicit (``"ia...,ib...->ab..."``).
    """

    def __init__(self, subscripts: str, a: Any, b: Any) -> None:
        inputs, self.out = subscripts.replace(" ", "").split("->")
        self.left, self.right = inputs.split(",")
        self.both = [x if _is_series(x) else np.asarray(x, dtype=float) for x in (a, b)]
        self.operands = [x for x in self.both if _is_series(x)]
        self.mirror = self._mirrored_output() if a is b else None

    def start(self) -> Array:
        a, b = (x.value if _is_series(x) else x for x in self.both)
        return np.einsum(f"{self.left},{self.right}->{self.out}", a, b)

    def remainder(self, k: int) -> Change:
        if k < 2 or len(self.operands) < 2:
            return None
        a, b = (x.coefficients for x in self.operands)
        summed = f"Z{self.left},Z{self.right}->{self.out}"
        if self.mirror is None:
            return np.einsum(summed, a[1:k], b[k - 1 : 0 : -1])
        half = (k + 1) // 2
        total = np.einsum(summed, a[1:half], a[k - 1 : k - half : -1])
        total = total + np.einsum(f"{self.mirror}->{self.out}", total)
        if k % 2 == 0:
            middle = a[k // 2]
            total += np.einsum(f"{self.left},{self.right}->{self.out}", middle, middle)
        return total

    def linear(self, d: Sequence[Change]) -> Change:
        total: Change = None
        changes = iter(d)
        for side, x in enumerate(self.both):
            change = next(changes) if _is_series(x) else None
            if change is None:
                continue
            part = self._one_side(side, x.ndim, change)
            total = part if total is None else total + part
        return total

    def _one_side(self, side: int, ndim: int, change: Array) -> Array:
        other = self.both[1 - side]
        value = other.value if _is_series(other) else other
        lead = "Z" if change.ndim > ndim else ""
        terms = [self.left, self.right]
        terms[side] = lead + terms[side]
        arrays = [change, value] if side == 0 else [value, change]
        return np.einsum(f"{terms[0]},{terms[1]}->{lead}{self.out}", *arrays)

    def _mirrored_output(self) -> str | None:
        """Output labels when the two (equal) operands trade places, if consistent."""
        left, right = self.left.replace("...", ""), self.right.replace("...", "")
        if len(left) != len(right) or ("..." in self.left) != ("..." in self.right):
            return None
        swap = dict(zip(left + right, right + left, strict=True))
        if any(swap[swap[x]] != x for x in swap):
            return None
        return "".join(swap.get(x, x) for x in self.out)


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
    """Sum along one axis of the coefficients."""

    def __init__(self, a: Series, axis: int) -> None:
        self.operands = [a]
        self.axis = axis % a.ndim - a.ndim

    def start(self) -> Array:
        return self.operands[0].value.sum(axis=self.axis)

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else d[0].sum(axis=self.axis)


class Stack(Operation):
    """Series and constants stacked along a new axis."""

    def __init__(self, arrays: Sequence[Any], axis: int) -> None:
        self.arrays = arrays
        self.operands = [x for x in arrays if _is_series(x)]
        self.shape = np.broadcast_shapes(*(x.shape if _is_series(x) else () for x in arrays))
        self.axis = axis % (len(self.shape) + 1)

    def start(self) -> Array:
        values = [x.value if _is_series(x) else x for x in self.arrays]
        return np.stack([np.broadcast_to(v, self.shape) for v in values], axis=self.axis)

    def linear(self, d: Sequence[Change]) -> Change:
        if all(c is None for c in d):
            return None
        lead = max(c.ndim - x.ndim for x, c in zip(self.operands, d, strict=True) if c is not None)
        batch = next(c.shape[:lead] for c in d if c is not None)
        changes = iter(d)
        parts = []
        for x in self.arrays:
            change = next(changes) if _is_series(x) else None
            whole = 0.0 if change is None else _lifted(change, x.ndim, len(self.shape))
            parts.append(np.broadcast_to(whole, batch + self.shape))
        return np.stack(parts, axis=self.axis + lead)


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
