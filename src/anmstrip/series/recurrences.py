"""Recurrences of the elementary functions on truncated power series.

For c = operation(a, b, …) every class gives

* ``start()``: order 0,
* ``remainder(k)``: the part of c_k, k ≥ 2, that is known from the orders 1 … k − 1,
* ``linear(d)``: the part that is linear in order k of the operands; it uses
  order 0 alone, hence is also the derivative applied to ``d``.  Entries of
  ``d`` may carry one more leading axis (several directions at once) and are
  ``None`` where they vanish.

Recurrences as in Griewank & Walther, *Evaluating Derivatives* (2008), ch. 13.
Cauchy sums run over the order axis in one call.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .power_series import Series

Array = NDArray[np.float64]
Change = Array | None

LARGE = 2000
"""Entries from which half the products of a square repay a second call (measured)."""


class Operation(ABC):
    """One recorded operation; subclasses are final."""

    operands: Sequence[Series]
    value: Array
    """Order 0 of the operation's own series, set when it is recorded."""
    result: Array
    """Its coefficients, set when the orders begin."""

    @abstractmethod
    def start(self) -> Array:
        """Order 0."""

    def remainder(self, k: int) -> Change:
        """Part of order k known from lower orders (``None``: zero)."""
        return None

    @abstractmethod
    def linear(self, d: Sequence[Change]) -> Change:
        """Derivative applied to the operands' changes."""

    def at(self, k: int, d: Sequence[Change]) -> Change:
        """Order k when order k of the operands is ``d``, which they hold already."""
        rest = self.remainder(k) if k > 1 else None
        change = self.linear(d)
        if rest is None:
            return change
        if change is not None:
            rest += change
        return rest


def is_series(x: Any) -> bool:
    """Whether x is a series, not a constant."""
    return hasattr(x, "coefficients")


def lifted(d: Array, ndim: int, target: int) -> Array:
    """Insert axes so that the last ``ndim`` axes of d broadcast as ``target`` axes."""
    if ndim == target:
        return d
    lead = d.ndim - ndim
    return d.reshape(d.shape[:lead] + (1,) * (target - ndim) + d.shape[lead:])


def cauchy(a: Array, b: Array, k: int, first: int, stop: int) -> Array:
    """Σ a_j b_{k−j}, j = first … stop − 1."""
    left, right = a[first:stop], b[k - stop + 1 : k - first + 1][::-1]
    if left.ndim == right.ndim == 1:
        return left.dot(right)
    return np.einsum("k...,k...->...", left, right)


def square_sum(a: Array, k: int, first: int = 1) -> Array:
    """Σ a_j a_{k−j}, j = first … k − first; of large arrays by symmetry."""
    if a[0].size < LARGE:
        return cauchy(a, a, k, first, k - first + 1)
    total = 2.0 * cauchy(a, a, k, first, (k + 1) // 2)
    if k % 2 == 0:
        total += a[k // 2] ** 2
    return total


def weighted_cauchy(a: Array, b: Array, k: int) -> Array:
    """Σ j a_j b_{k−j}, j = 1 … k − 1."""
    return _weighted(np.arange(1.0, k), a, b, k)


def _weighted(weights: Array, a: Array, b: Array, k: int) -> Array:
    """Σ weights_j a_j b_{k−j}, j = 1 … k − 1."""
    left, right = a[1:k], b[k - 1 : 0 : -1]
    if left.ndim == 1:
        return (weights * left).dot(right)
    return np.einsum("k,k...,k...->...", weights, left, right)


class Divide(Operation):
    """c = a / b, from a = b c; a may be a constant."""

    def __init__(self, a: Any, b: Series) -> None:
        self.numerator = a
        self.operands = [a, b] if is_series(a) else [b]
        self.b = b
        self.ndim = max(np.ndim(a) if not is_series(a) else a.ndim, b.ndim)

    def start(self) -> Array:
        a = self.numerator
        return (a.value if is_series(a) else np.asarray(a, dtype=float)) / self.b.value

    def remainder(self, k: int) -> Change:
        b = lifted(self.b.coefficients, self.b.ndim, self.ndim)
        return cauchy(b, self.result, k, 1, k) / -self.b.value

    def linear(self, d: Sequence[Change]) -> Change:
        change = d[-1]
        part = None
        if change is not None:
            part = -lifted(change, self.b.ndim, self.ndim) * self.value
        if len(d) == 2 and d[0] is not None:
            top = lifted(d[0], self.operands[0].ndim, self.ndim)
            part = top if part is None else top + part
        return None if part is None else part / self.b.value


class SquareRoot(Operation):
    """c = √a, from c² = a."""

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        value = np.sqrt(self.operands[0].value)
        self.slope = 0.5 / value
        return value

    def remainder(self, k: int) -> Change:
        return square_sum(self.result, k) * -self.slope

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else d[0] * self.slope


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
        a = self.operands[0].coefficients
        weights = (self.exponent + 1.0) * np.arange(1.0, k) - k
        return _weighted(weights, a, self.result, k) / (k * a[0])

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else self.slope * d[0]


class Exp(Operation):
    """c = exp a, from c' = a' c."""

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        return np.exp(self.operands[0].value)

    def remainder(self, k: int) -> Change:
        return weighted_cauchy(self.operands[0].coefficients, self.result, k) / k

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else self.value * d[0]


class Log(Operation):
    """c = log a, from a c' = a'."""

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        return np.log(self.operands[0].value)

    def remainder(self, k: int) -> Change:
        a = self.operands[0].coefficients
        return weighted_cauchy(self.result, a, k) / (-k * a[0])

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
        value, self.slope = self.values(a.value)
        return value

    @abstractmethod
    def values(self, a: Array) -> tuple[Array, Array]:
        """Order 0 of the function and of its companion."""

    @abstractmethod
    def companion_order(self, k: int) -> Array:
        """Order k of the companion, all else known."""

    def remainder(self, k: int) -> Change:
        if k == 2:
            self.companion = np.zeros_like(self.result)
            self.companion[0] = self.slope
        self.companion[k - 1] = self.companion_order(k - 1)
        return weighted_cauchy(self.operands[0].coefficients, self.companion, k) / k

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else self.slope * d[0]


class Tanh(_WithCompanion):
    """c = tanh a, companion s = 1 − c²."""

    def values(self, a: Array) -> tuple[Array, Array]:
        value = np.tanh(a)
        return value, 1.0 / np.cosh(np.clip(a, -350.0, 350.0)) ** 2

    def companion_order(self, k: int) -> Array:
        return -square_sum(self.result, k, first=0)


class Sine(_WithCompanion):
    """c = sin a, companion s = cos a."""

    def values(self, a: Array) -> tuple[Array, Array]:
        return np.sin(a), np.cos(a)

    def companion_order(self, k: int) -> Array:
        a, c = self.operands[0].coefficients, self.result
        inner = weighted_cauchy(a, c, k) / k if k > 1 else 0.0
        return -(inner + a[k] * c[0])


class Cosine(Sine):
    """c = cos a, companion s = −sin a, hence s' = −c a' as for the sine."""

    def values(self, a: Array) -> tuple[Array, Array]:
        return np.cos(a), -np.sin(a)
