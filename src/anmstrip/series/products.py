"""Products of series: pointwise and by Einstein summation.

Order k of a product is one Cauchy sum Σ a_j b_{k−j}; the ends j = 0 and j = k
are left out where order k of an operand is zero so far.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .recurrences import LARGE, Array, Change, Operation, cauchy, is_series, lifted, square_sum

if TYPE_CHECKING:
    from .power_series import Series


class Multiply(Operation):
    """c = a b."""

    def __init__(self, a: Series, b: Series) -> None:
        self.operands = [a, b]
        self.ndim = max(a.ndim, b.ndim)

    def start(self) -> Array:
        a, b = self.operands
        return a.value * b.value

    def at(self, k: int, d: Sequence[Change]) -> Change:
        first, stop = _range(k, d)
        if first == stop:
            return None
        a, b = (lifted(x.coefficients, x.ndim, self.ndim) for x in self.operands)
        return cauchy(a, b, k, first, stop)

    def linear(self, d: Sequence[Change]) -> Change:
        a, b = self.operands
        left = None if d[0] is None else lifted(d[0], a.ndim, self.ndim) * b.value
        right = None if d[1] is None else lifted(d[1], b.ndim, self.ndim) * a.value
        return _sum(left, right)


class Square(Operation):
    """c = a²."""

    def __init__(self, a: Series) -> None:
        self.operands = [a]

    def start(self) -> Array:
        return self.operands[0].value ** 2

    def at(self, k: int, d: Sequence[Change]) -> Change:
        if k == 1 and d[0] is None:
            return None
        return square_sum(self.operands[0].coefficients, k, int(d[0] is None))

    def linear(self, d: Sequence[Change]) -> Change:
        return None if d[0] is None else 2.0 * self.operands[0].value * d[0]


class Einsum(Operation):
    """c = einsum of two series.

    Subscripts are explicit (``"ia...,ib...->ab..."``).
    """

    def __init__(self, subscripts: str, a: Series, b: Series) -> None:
        self.left, self.right, self.out = split(subscripts)
        self.summed = f"Z{self.left},Z{self.right}->{self.out}"
        self.operands = [a, b]
        mirror = mirrored(self.left, self.right, self.out) if a is b else None
        self.mirror = mirror if a.value.size >= LARGE else None

    def start(self) -> Array:
        a, b = self.operands
        return np.einsum(f"{self.left},{self.right}->{self.out}", a.value, b.value)

    def at(self, k: int, d: Sequence[Change]) -> Change:
        first, stop = _range(k, d)
        if first == stop:
            return None
        if self.mirror is None:
            return self._orders(k, first, stop)
        total = self._both_ways(self._orders(k, first, (k + 1) // 2), self.mirror)
        if k % 2 == 0:
            total += self._orders(k, k // 2, k // 2 + 1)
        return total

    def linear(self, d: Sequence[Change]) -> Change:
        a, b = self.operands
        if self.mirror is not None and d[0] is not None and d[0].ndim == a.ndim:
            half = np.einsum(f"{self.left},{self.right}->{self.out}", d[0], b.value)
            return self._both_ways(half, self.mirror)
        left = right = None
        if d[0] is not None:
            z = "Z" * (d[0].ndim - a.ndim)
            left = np.einsum(f"{z}{self.left},{self.right}->{z}{self.out}", d[0], b.value)
        if d[1] is not None:
            z = "Z" * (d[1].ndim - b.ndim)
            right = np.einsum(f"{self.left},{z}{self.right}->{z}{self.out}", a.value, d[1])
        return _sum(left, right)

    def _orders(self, k: int, first: int, stop: int) -> Array:
        """Σ a_j b_{k−j}, j = first … stop − 1."""
        a, b = (x.coefficients for x in self.operands)
        return np.einsum(self.summed, a[first:stop], b[k - stop + 1 : k - first + 1][::-1])

    def _both_ways(self, half: Array, mirror: str) -> Array:
        """Sum with the operands' places exchanged."""
        return half + (half if mirror == self.out else np.einsum(f"{mirror}->{self.out}", half))


class EinsumWithConstant(Operation):
    """c = einsum of a series and a constant; a product of matrices where it is one.

    ``swapped`` says that the constant is the second operand.
    """

    def __init__(self, subscripts: str, constant: Any, a: Series, swapped: bool) -> None:
        left, right, self.out = split(subscripts)
        self.labels, self.own = (right, left) if swapped else (left, right)
        self.constant = np.asarray(constant, dtype=float)
        self.operands = [a]
        self.matrix = self._as_matrix()

    def start(self) -> Array:
        value = self._apply(self.operands[0].value, "")
        self.shape = value.shape
        return value

    def linear(self, d: Sequence[Change]) -> Change:
        if d[0] is None:
            return None
        a = self.operands[0]
        lead = d[0].shape[: d[0].ndim - a.ndim]
        if self.matrix is None:
            return self._apply(d[0], "Z" * len(lead))
        columns = d[0].reshape((*lead, self.matrix.shape[1], -1))
        return (self.matrix @ columns).reshape(lead + self.shape)

    def _apply(self, a: Array, z: str) -> Array:
        return np.einsum(f"{self.labels},{z}{self.own}->{z}{self.out}", self.constant, a)

    def _as_matrix(self) -> Array | None:
        """The constant as a matrix that acts on the leading axes of the series, if it can."""
        summed = "".join(x for x in self.own if x in self.labels)
        kept = self.out[: len(self.labels) - len(summed)]
        distinct = all(len(set(x)) == len(x) for x in (self.labels, summed))
        fits = self.own.startswith(summed) and self.out == kept + self.own[len(summed) :]
        if not (fits and distinct and set(kept + summed) == set(self.labels)):
            return None
        order = [self.labels.index(x) for x in kept + summed]
        columns = int(np.prod(self.operands[0].shape[: len(summed)]))
        return np.ascontiguousarray(self.constant.transpose(order).reshape(-1, columns))


def einsum(subscripts: str, a: Any, b: Any) -> Operation:
    """The operation for two operands, at least one of them a series."""
    if is_series(a) and is_series(b):
        return Einsum(subscripts, a, b)
    if is_series(a):
        return EinsumWithConstant(subscripts, b, a, swapped=True)
    return EinsumWithConstant(subscripts, a, b, swapped=False)


def split(subscripts: str) -> tuple[str, str, str]:
    """Labels of the two operands and of the result."""
    if subscripts.count(",") != 1 or "->" not in subscripts:
        raise ValueError(f"einsum of series takes 'left,right->out', not {subscripts!r}")
    inputs, out = subscripts.replace(" ", "").split("->")
    left, right = inputs.split(",")
    return left, right, out


def mirrored(left: str, right: str, out: str) -> str | None:
    """Labels of ``out`` when two equal operands trade places, ``None`` if they cannot."""
    left, right = left.replace("...", "."), right.replace("...", ".")
    if len(left) != len(right):
        return None
    swap = dict(zip(left + right, right + left, strict=True))
    if [swap[x] for x in left + right] != list(right + left) or swap.get(".", ".") != ".":
        return None
    return "".join(swap.get(x, x) for x in out)


def _range(k: int, d: Sequence[Change]) -> tuple[int, int]:
    """First and stop of the j with a_j b_{k−j} ≠ 0, for order k of (a, b) as in ``d``."""
    return int(d[1] is None), k + int(d[0] is not None)


def _sum(a: Change, b: Change) -> Change:
    if a is None or b is None:
        return b if a is None else a
    return a + b
