"""Executor in numpy: the same instructions as :mod:`anmstrip.taylor.kernels`, in batches.

Instructions of one kind that do not wait for each other are one call.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.taylor import tape
from anmstrip.taylor.tape import Tables

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

WITH_CONSTANT = {tape.CONSTANT, tape.SHIFT, tape.SCALE_BY, tape.COMBINE_BY}
COMPARISONS = {tape.LESS: np.less, tape.LESS_EQUAL: np.less_equal, tape.EQUAL: np.equal}
VALUES = {tape.ROOT: np.sqrt, tape.EXP: np.exp, tape.LOG: np.log}


@dataclass(frozen=True)
class Batch:
    """Instructions of one kind: rows of result and operands, and their places in ``w``.

    Attributes
    ----------
    out, a, b
        Rows; slices where they follow each other.
    w_out, w_a, w_b, w_d
        Their places among the kept rows.
    written : tuple or None
        Which of the results are kept, and their places.
    s : ndarray, shape (instructions, 1, 1)
    constants : ndarray, shape (blocks, instructions, 1, lanes)
    """

    kind: int
    out: Any
    a: Any
    b: Any
    w_out: Any
    w_a: Any
    w_b: Any
    w_d: Any
    written: tuple[Any, Any] | None
    s: Array
    constants: Array

    @classmethod
    def of(cls, chosen: list[int], tables: Tables) -> Batch:
        """Gather some instructions of a program."""
        kind, out, a, b, d = tables.code[chosen].T
        places = tables.kept[out]
        kept = np.flatnonzero(places >= 0)
        constants = tables.constants[b if kind[0] in WITH_CONSTANT else []]
        return cls(
            kind=int(kind[0]),
            out=_index(out),
            a=_index(a),
            b=_index(b),
            w_out=_index(places),
            w_a=_index(tables.kept[a]),
            w_b=_index(tables.kept[b % len(tables.kept)]),
            w_d=_index(tables.kept[d]),
            written=(_index(kept), _index(places[kept])) if len(kept) else None,
            s=tables.parameters[chosen][:, None, None],
            constants=constants.swapaxes(0, 1)[:, :, None],
        )


def _index(rows: Rows) -> Any:
    """Rows as a slice, if they follow each other."""
    if len(rows) and (np.diff(rows) == 1).all() and rows[0] >= 0:
        return slice(int(rows[0]), int(rows[-1]) + 1)
    return rows


def batches(tables: Tables) -> list[Batch]:
    """Instructions by their kind, and by how many others they have to wait for."""
    ready = [0] * len(tables.kept)
    found: dict[tuple[int, int], list[int]] = {}
    for m, (kind, out, a, b, d) in enumerate(tables.code.tolist()):
        waits = [ready[a]] if kind != tape.CONSTANT else [0]
        if kind in (tape.COMBINE, tape.COMBINE_BY, tape.PRODUCT):
            waits.append(ready[out])
        if tape.ADD <= kind <= tape.DIVIDE:
            waits.append(ready[b])
        if kind == tape.SELECT:
            waits.append(ready[d])
        level = ready[out] = 1 + max(waits)
        if kind >= tape.TANH:
            ready[b] = level
        found.setdefault((level, kind), []).append(m)
    return [Batch.of(found[key], tables) for key in sorted(found)]


class NumpyExecutor:
    """Runs the instructions of a program by numpy."""

    block = 4096
    """Points that are treated at once."""

    def __init__(self, tables: Tables) -> None:
        self.tables, self.batches = tables, batches(tables)
        self.rows = np.flatnonzero(tables.kept >= 0)
        places = tables.kept[tables.inputs]
        self.kept_inputs = np.flatnonzero(places >= 0), places[places >= 0]

    def advance(self, w: Array, k: int, given: Array, changes: Array | None) -> Array:
        """Order k of the outputs, see :class:`anmstrip.taylor.program.Executor`."""
        found = np.empty((len(self.tables.outputs), *given.shape[1:]))
        inputs, (kept, places) = self.tables.inputs, self.kept_inputs
        for block, part in enumerate(w):
            if changes is not None:
                change = self._changes(part, block, changes[:, None, block])
                part[:, k - 1] += change[self.rows, 0]
            now = np.zeros((len(self.tables.kept), 1, part.shape[-1]))
            now[inputs, 0] = given[:, block]
            part[places, k] = given[kept, block]
            with np.errstate(all="ignore"):
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
        for block, part in enumerate(w):
            change = self._changes(part, block, seeds[:, :, block].swapaxes(0, 1))
            found[:, :, block] = change[self.tables.outputs].swapaxes(0, 1)
        return found

    def _changes(self, w: Array, block: int, seeds: Array) -> Array:
        """First changes (rows, seeds, lanes) of all rows, from those of the inputs."""
        d = np.zeros((len(self.tables.kept), *seeds.shape[1:]))
        d[self.tables.inputs] = seeds
        with np.errstate(all="ignore"):
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
            now[x.out] = x.s * now[x.a]
        case tape.ADD:
            now[x.out] = now[x.a] + x.s * now[x.b]
        case tape.COMBINE:
            now[x.out] += x.s * now[x.a]
        case tape.SCALE_BY:
            now[x.out] = x.constants[block] * now[x.a]
        case tape.COMBINE_BY:
            now[x.out] += x.constants[block] * now[x.a]
        case tape.SHIFT:
            now[x.out] = x.s * now[x.a]
            if k == 0:
                now[x.out] += x.constants[block]
        case tape.SELECT:
            now[x.out] = np.where(w[x.w_d, :1] != 0.0, now[x.a], now[x.b])
        case tape.CONSTANT if k == 0:
            now[x.out] = x.constants[block]
        case kind if k == 0:
            now[x.out] = COMPARISONS[kind](now[x.a], now[x.b])


def _order(x: Batch, now: Array, w: Array, block: int, k: int) -> Array:
    """Order k of rows; what is asked for is also written into ``now``."""
    if x.kind <= tape.EQUAL:
        _combine(x, now, w, block, k)
    elif x.kind <= tape.PRODUCT:
        product = _cauchy(w[x.w_a, : k + 1], w[x.w_b, k::-1])[:, None]
        if x.kind == tape.PRODUCT:
            now[x.out] += product
        else:
            now[x.out] = product
    else:
        now[x.out] = _value(x, now, w) if k == 0 else _function(x, now, w, k)[:, None]
    return now[x.out]


def _cauchy(a: Array, b: Array) -> Array:
    """Σ a_j b_j over the orders, shape (rows, lanes)."""
    return np.einsum("rkl,rkl->rl", a, b)


def _weighted(a: Array, b: Array, weights: Array) -> Array:
    """Σ weights_j a_j b_j; the weights are of shape (orders,) or (rows, orders)."""
    return np.einsum("rkl,rkl->rl", a * weights[..., None], b)


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
    orders = np.arange(1.0, k + 1.0)
    match x.kind:
        case tape.DIVIDE:
            known = _cauchy(w[x.w_b, 1 : k + 1], w[x.w_out, k - 1 :: -1])
            return np.asarray((now[x.a][:, 0] - known) / w[x.w_b, 0])
        case tape.ROOT:
            known = _cauchy(w[x.w_out, 1:k], w[x.w_out, k - 1 : 0 : -1])
            return np.asarray(0.5 * (now[x.a][:, 0] - known) / w[x.w_out, 0])
        case tape.LOG:
            known = _weighted(w[x.w_out, 1:k], w[x.w_a, k - 1 : 0 : -1], orders[:-1] / k)
            return np.asarray((now[x.a][:, 0] - known) / w[x.w_a, 0])
        case tape.POWER:
            weights = (x.s[:, 0] + 1.0) * orders - k
            found = _weighted(w[x.w_a, 1 : k + 1], w[x.w_out, k - 1 :: -1], weights)
            return np.asarray(found / (k * w[x.w_a, 0]))
        case tape.EXP:
            return _weighted(w[x.w_a, 1 : k + 1], w[x.w_out, k - 1 :: -1], orders / k)
    found = _weighted(w[x.w_a, 1 : k + 1], w[x.w_b, k - 1 :: -1], orders / k)
    if x.kind == tape.TANH:
        w[x.w_out, k] = found
        w[x.w_b, k] = -_cauchy(w[x.w_out, : k + 1], w[x.w_out, k::-1])
    else:
        w[x.w_b, k] = _weighted(w[x.w_a, 1 : k + 1], w[x.w_out, k - 1 :: -1], -orders / k)
    now[x.b] = w[x.w_b, k][:, None]
    return found


def _change(x: Batch, d: Array, w: Array) -> None:
    """First changes of rows that are not linear in others."""
    a = d[x.a]
    if x.kind <= tape.PRODUCT:
        product = w[x.w_a, :1] * d[x.b] + a * w[x.w_b, :1]
        d[x.out] = product if x.kind == tape.MULTIPLY else d[x.out] + product
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
