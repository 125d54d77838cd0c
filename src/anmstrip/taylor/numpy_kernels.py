"""Executor in numpy: the same instructions as :mod:`anmstrip.taylor.kernels`, in batches.

Instructions of one kind that do not wait for each other are one call.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.arrays import Array
from anmstrip.taylor import tape
from anmstrip.taylor.tape import Tables

Rows = NDArray[np.int64]

FEW = 128
"""Points below which a product of several rows is one call."""

COMPARISONS = {tape.LESS: np.less, tape.LESS_EQUAL: np.less_equal, tape.EQUAL: np.equal}
VALUES = {tape.ROOT: np.sqrt, tape.EXP: np.exp, tape.LOG: np.log}

FAMILIES = {
    tape.SHIFT: tape.SCALE,
    tape.COMBINE: tape.SCALE,
    tape.ADD: tape.SCALE,
    tape.COMBINE_BY: tape.SCALE_BY,
    tape.PRODUCT: tape.MULTIPLY,
}
"""Kinds that are treated as others: sums of factor × row, constant × row and row × row."""


@dataclass(frozen=True)
class Batch:
    """Instructions of one family: rows of results and operands, and their places in ``w``.

    Attributes
    ----------
    out : rows
        Results.
    a, b : rows
        Operands, one for each term; slices where they follow each other.
    terms : int
        Number of terms of each result.
    w_out, w_a, w_b, w_d : ndarray of int
        Their places among the kept rows.
    written : tuple or None
        Which of the results are kept, and their places.
    s : ndarray, shape (terms, 1, 1)
        Factors or exponents.
    plain : bool
        Whether all of them are 1.
    constants : ndarray, shape (blocks, terms or results, 1, lanes), or None
        What rows are multiplied by, or what is added to sums.
    """

    kind: int
    out: Any
    a: Any
    b: Any
    terms: int
    w_out: Rows
    w_a: Rows
    w_b: Rows
    w_d: Rows
    written: tuple[Any, Any] | None
    s: Array
    plain: bool
    constants: Array | None

    @classmethod
    def of(cls, kind: int, chosen: list[list[int]], tables: Tables) -> Batch:
        """Gather instructions of one family, those of each result together."""
        first = np.array([terms[0] for terms in chosen])
        kinds, out, _, number, _ = tables.code[first].T
        every = [m for terms in chosen for m in terms]
        code, s = tables.code[every], tables.parameters[every]
        a, b, d = code[:, 2:].T
        if kind == tape.SCALE:
            a, s = _terms(code, s)
        constants = None
        if kind == tape.SCALE_BY:
            constants = tables.constants[b]
        elif (kinds == tape.SHIFT).any():
            shifts = (kinds == tape.SHIFT)[:, None, None]
            constants = np.where(
                shifts, tables.constants[np.where(shifts[:, 0, 0], number, 0)], 0.0
            )
        elif kind == tape.CONSTANT:
            constants = tables.constants[number]
        places = tables.kept[out]
        kept = np.flatnonzero(places >= 0)
        whole = slice(None) if len(kept) == len(out) else kept
        return cls(
            kind=kind,
            out=_index(out),
            a=_index(a),
            b=_index(b),
            terms=len(a) // len(chosen),
            w_out=places,
            w_a=tables.kept[a],
            w_b=tables.kept[b % len(tables.kept)],
            w_d=tables.kept[d],
            written=(whole, places[kept]) if len(kept) else None,
            s=s[:, None, None],
            plain=bool((s == 1.0).all()),
            constants=None if constants is None else constants.swapaxes(0, 1)[:, :, None],
        )


def _terms(code: Rows, s: Array) -> tuple[Rows, Array]:
    """Rows and factors of the terms of sums of factor × row."""
    rows: list[int] = []
    factors: list[float] = []
    for (kind, _, a, b, _), factor in zip(code.tolist(), s.tolist(), strict=True):
        rows += [a, b] if kind == tape.ADD else [a]
        factors += [1.0, factor] if kind == tape.ADD else [factor]
    return np.array(rows), np.array(factors)


def _index(rows: Rows) -> Any:
    """Rows as a slice, if they follow each other."""
    count, first = len(rows), int(rows[0])
    return slice(first, first + count) if rows.tolist() == [*range(first, first + count)] else rows


def batches(tables: Tables) -> list[Batch]:
    """Instructions by how many others they have to wait for, family, and number of terms."""
    sums: list[list[int]] = []
    for m, kind in enumerate(tables.code[:, 0].tolist()):
        if kind in (tape.COMBINE, tape.COMBINE_BY, tape.PRODUCT):
            sums[-1].append(m)
        else:
            sums.append([m])
    code, ready = tables.code.tolist(), [0] * len(tables.kept)
    found: dict[tuple[int, int, int], list[list[int]]] = {}
    for terms in sums:
        kind, out, _, companion, _ = code[terms[0]]
        level = max((ready[row] for m in terms for row in _operands(*code[m])), default=0)
        ready[out] = level + 1
        if kind >= tape.TANH:
            ready[companion] = level + 1
        count = len(terms) + (kind == tape.ADD)
        found.setdefault((level, FAMILIES.get(kind, kind), count), []).append(terms)
    return [Batch.of(key[1], found[key], tables) for key in sorted(found)]


def _operands(kind: int, out: int, a: int, b: int, d: int) -> list[int]:
    """Rows that an instruction reads."""
    if kind == tape.CONSTANT:
        return []
    both = [a, b] if tape.ADD <= kind <= tape.DIVIDE else [a]
    return [*both, d] if kind == tape.SELECT else both


class NumpyExecutor:
    """Runs the instructions of a program by numpy."""

    block = 4096
    """Points that are treated at once (measured; 1024 takes 1.5 times as long)."""

    def __init__(self, tables: Tables) -> None:
        self.tables, self.batches = tables, batches(tables)
        self.rows = np.flatnonzero(tables.kept >= 0)
        places = tables.kept[tables.inputs]
        self.kept_inputs = np.flatnonzero(places >= 0), places[places >= 0]
        self.buffer = np.empty((0, 0, 0))

    def advance(self, w: Array, k: int, given: Array, changes: Array | None) -> Array:
        """Order k of the outputs, see :class:`anmstrip.taylor.program.Executor`."""
        found = np.empty((len(self.tables.outputs), *given.shape[1:]))
        kept, places = self.kept_inputs
        with np.errstate(all="ignore"):
            for block, part in enumerate(w):
                if changes is not None:
                    change = self._changes(part, block, changes[:, None, block])
                    part[:, k - 1] += change[self.rows, 0]
                now = self._begun(given[:, None, block])
                part[places, k] = given[kept, block]
                for batch in self.batches:
                    now_k = _order(batch, now, part, block, k)
                    if batch.written is not None:
                        which, where = batch.written
                        part[where, k] = now_k[which, 0]
                found[:, block] = now[self.tables.outputs, 0]
        return found

    def derivative(self, w: Array, seeds: Array) -> Array:
        """Changes of the outputs, see :class:`anmstrip.taylor.program.Executor`."""
        found = np.empty((len(seeds), len(self.tables.outputs), *seeds.shape[2:]))
        together = len(seeds) if w.shape[-1] < FEW else 1
        with np.errstate(all="ignore"):
            for first in range(0, len(seeds), together):
                chosen = slice(first, first + together)
                for block, part in enumerate(w):
                    change = self._changes(part, block, seeds[chosen, :, block].swapaxes(0, 1))
                    found[chosen, :, block] = change[self.tables.outputs].swapaxes(0, 1)
        return found

    def _begun(self, inputs: Array) -> Array:
        """An array (rows, seeds, lanes) for what follows from the inputs, always the same one."""
        shape = (len(self.tables.kept), *inputs.shape[1:])
        if self.buffer.shape != shape:
            self.buffer = np.empty(shape)
        self.buffer[self.tables.inputs] = inputs
        return self.buffer

    def _changes(self, w: Array, block: int, seeds: Array) -> Array:
        """First changes (rows, seeds, lanes) of all rows, from those of the inputs."""
        d = self._begun(seeds)
        for batch in self.batches:
            if batch.kind <= tape.EQUAL:
                _combine(batch, d, w, block, 1)
            else:
                _change(batch, d, w)
        return d


def _combine(x: Batch, now: Array, w: Array, block: int, k: int) -> None:
    """Order k of rows that need no lower orders of their operands."""
    match x.kind:
        case tape.SCALE:
            found = _summed(now[x.a] if x.plain else x.s * now[x.a], x)
            now[x.out] = found if k or x.constants is None else found + x.constants[block]
        case tape.SCALE_BY:
            assert x.constants is not None
            now[x.out] = _summed(x.constants[block] * now[x.a], x)
        case tape.SELECT:
            now[x.out] = np.where(w[x.w_d, :1] != 0.0, now[x.a], now[x.b])
        case tape.CONSTANT:
            now[x.out] = 0.0 if k or x.constants is None else x.constants[block]
        case kind:
            now[x.out] = 0.0 if k else COMPARISONS[kind](now[x.a], now[x.b])


def _summed(terms: Array, x: Batch) -> Array:
    """Results of a batch from its terms."""
    return terms if x.terms == 1 else terms.reshape(-1, x.terms, *terms.shape[1:]).sum(axis=1)


def _order(x: Batch, now: Array, w: Array, block: int, k: int) -> Array:
    """Order k of rows; what is asked for is also written into ``now``."""
    if x.kind <= tape.EQUAL:
        _combine(x, now, w, block, k)
    elif x.kind == tape.MULTIPLY:
        terms = _cauchy(w, x.w_a, x.w_b, (slice(k + 1), slice(k, None, -1)))
        now[x.out] = _summed(terms, x)[:, None]
    else:
        now[x.out] = _value(x, now, w) if k == 0 else _function(x, now, w, k)[:, None]
    return now[x.out]


def _cauchy(
    w: Array, a: Rows, b: Rows, orders: tuple[slice, slice], weights: Array | None = None
) -> Array:
    """Σ weights_j a_j b_j over some orders of rows a and of rows b, shape (rows, lanes).

    The weights have the shape (orders,) or (rows, orders).  Where there are few points, all rows
    are one call; where there are many, copies of the rows would cost more than calls for each.
    """
    left, right = orders
    if weights is not None:
        weights = np.broadcast_to(weights, (len(a), weights.shape[-1]))
    if w.shape[-1] < FEW:
        first = w[a, left] if weights is None else w[a, left] * weights[:, :, None]
        return np.einsum("rkl,rkl->rl", first, w[b, right])
    found = np.empty((len(a), w.shape[-1]))
    for row, (i, j) in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
        first, second = w[i, left], w[j, right]
        if weights is not None:
            first = first * weights[row, :, None]
        elif i == j:  # the terms of a square are the same from both ends
            half, odd = divmod(len(first), 2)
            np.einsum("kl,kl->l", first[:half], second[:half], out=found[row])
            found[row] *= 2.0
            if odd:
                found[row] += first[half] ** 2
            continue
        np.einsum("kl,kl->l", first, second, out=found[row])
    return found


def _value(x: Batch, now: Array, w: Array) -> Array:
    """Order 0 of functions; a companion goes into ``w`` and ``now`` at once."""
    a = now[x.a]
    match x.kind:
        case tape.DIVIDE:
            return np.asarray(a / now[x.b])
        case tape.POWER:
            return np.asarray(a**x.s)
        case tape.TANH:
            now[x.b] = 1.0 / np.cosh(np.clip(a, -350.0, 350.0)) ** 2
            w[x.w_b, 0] = now[x.b][:, 0]
            return np.tanh(a)
        case tape.SINE:
            now[x.b] = np.cos(a)
            w[x.w_b, 0] = now[x.b][:, 0]
            return np.sin(a)
    return np.asarray(VALUES[x.kind](a))


def _function(x: Batch, now: Array, w: Array, k: int) -> Array:
    """Order k ≥ 1 of functions, from their own lower orders."""
    a, b, c, orders = x.w_a, x.w_b, x.w_out, np.arange(1.0, k + 1.0)
    inner = slice(1, k), slice(k - 1, 0, -1)
    upper = slice(1, k + 1), slice(k - 1, None, -1)
    match x.kind:
        case tape.DIVIDE:
            return np.asarray((now[x.a][:, 0] - _cauchy(w, b, c, upper)) / w[b, 0])
        case tape.ROOT:
            return np.asarray(0.5 * (now[x.a][:, 0] - _cauchy(w, c, c, inner)) / w[c, 0])
        case tape.LOG:
            known = _cauchy(w, c, a, inner, orders[:-1] / k)
            return np.asarray((now[x.a][:, 0] - known) / w[a, 0])
        case tape.POWER:
            weights = (x.s[:, 0] + 1.0) * orders - k
            return np.asarray(_cauchy(w, a, c, upper, weights) / (k * w[a, 0]))
        case tape.EXP:
            return _cauchy(w, a, c, upper, orders / k)
    found = _cauchy(w, a, b, upper, orders / k)
    if x.kind == tape.TANH:
        w[c, k] = found
        w[b, k] = -_cauchy(w, c, c, (slice(k + 1), slice(k, None, -1)))
    else:
        w[b, k] = _cauchy(w, a, c, upper, -orders / k)
    now[x.b] = w[b, k][:, None]
    return found


def _change(x: Batch, d: Array, w: Array) -> None:
    """First changes of rows that are not linear in others."""
    a = d[x.a]
    if x.kind == tape.MULTIPLY:
        d[x.out] = _summed(w[x.w_a, :1] * d[x.b] + a * w[x.w_b, :1], x)
        return
    v = w[x.w_out, :1]
    match x.kind:
        case tape.DIVIDE:
            d[x.out] = (a - v * d[x.b]) / w[x.w_b, :1]
        case tape.ROOT:
            d[x.out] = 0.5 * a / v
        case tape.POWER:
            d[x.out] = x.s * v / w[x.w_a, :1] * a
        case tape.EXP:
            d[x.out] = v * a
        case tape.LOG:
            d[x.out] = a / w[x.w_a, :1]
        case tape.TANH:
            d[x.out] = w[x.w_b, :1] * a
            d[x.b] = -2.0 * v * d[x.out]
        case tape.SINE:
            d[x.out] = w[x.w_b, :1] * a
            d[x.b] = -v * a
