"""Compiled recurrences: one call computes an order of a whole program, at all points.

A program is a list of scalar instructions on rows; a row is one truncated series per
point.  The kernels go through it block of points by block, so that what one instruction
writes is still in the cache when the next reads it.  Between two orders all unknowns are
solved for, and by then the caches have forgotten: an order costs what is read again from
memory.  Only the rows whose lower orders are needed are therefore kept, operands of products
and results of functions; of all others there is only the order at hand.  Only this module
imports numba; what it computes agrees with :mod:`anmstrip.series.recurrences` to round-off.

Arrays: ``w`` (blocks, kept rows, order + 1, lanes); ``now`` (rows, lanes), one order of all
rows of a block; ``kept`` (rows,), the place of a row in ``w``, −1 where it has none;
``constants`` (numbers, blocks, lanes); ``code`` (instructions, 4): kind, result, first and
second operand; ``parameters`` (instructions,): a number that belongs to each.
"""

# ruff: noqa: PLR0913, PLR0917 (kernels take arrays, not objects)

from __future__ import annotations

import numpy as np
from numba import njit

# Kinds of instructions: c is the row of the result, a and b those of the operands, s the number.
SCALE = 0  # c = s a
SCALE_ROW = 1  # c = a times a constant of each lane
COMBINE = 2  # c += s a
COMBINE_ROW = 3  # c += a times a constant of each lane
ADD = 4  # c = a + s b
SELECT = 5  # c = a where constant number s is not zero, else b
MULTIPLY = 6  # c = a b
PRODUCT = 7  # c += a b
DIVIDE = 8  # c = a / b
ROOT = 9  # c = √a
POWER = 10  # c = a^s
EXP = 11
LOG = 12
TANH = 13  # b: its companion, 1 − c²
SINE = 14  # b: the cosine
COSINE = 15  # b: minus the sine

compiled = njit(cache=True, error_model="numpy", nogil=True)


@compiled
def cauchy(c, a, b, k, first, stop):
    """Add Σ a_j b_{k−j}, j = first … stop − 1, to c."""
    n = c.shape[0]
    j = first
    while j + 3 < stop:
        for i in range(n):
            c[i] += (
                a[j, i] * b[k - j, i]
                + a[j + 1, i] * b[k - j - 1, i]
                + a[j + 2, i] * b[k - j - 2, i]
                + a[j + 3, i] * b[k - j - 3, i]
            )
        j += 4
    while j < stop:
        for i in range(n):
            c[i] += a[j, i] * b[k - j, i]
        j += 1


@compiled
def weighted(c, a, b, k, stop, slope, offset):
    """Add Σ (slope j + offset) a_j b_{k−j}, j = 1 … stop − 1, to c."""
    for j in range(1, stop):
        s = slope * j + offset
        for i in range(c.shape[0]):
            c[i] += s * a[j, i] * b[k - j, i]


@compiled
def square(c, a, k, first):
    """Add Σ a_j a_{k−j}, j = first … k − first, to c, by symmetry."""
    n = c.shape[0]
    for j in range(first, (k + 1) // 2):
        for i in range(n):
            c[i] += 2.0 * a[j, i] * a[k - j, i]
    if k % 2 == 0 and k // 2 >= first:
        for i in range(n):
            c[i] += a[k // 2, i] * a[k // 2, i]


@compiled
def combined(kind, now, out, first, second, s, constants, block):
    """One order of a row that is linear in others, for kinds up to SELECT."""
    c, a = now[out], now[first]
    n = c.shape[0]
    if kind == SCALE:
        for i in range(n):
            c[i] = s * a[i]
    elif kind == ADD:
        b = now[second]
        for i in range(n):
            c[i] = a[i] + s * b[i]
    elif kind == COMBINE:
        for i in range(n):
            c[i] += s * a[i]
    elif kind == SCALE_ROW:
        f = constants[second, block]
        for i in range(n):
            c[i] = f[i] * a[i]
    elif kind == COMBINE_ROW:
        f = constants[second, block]
        for i in range(n):
            c[i] += f[i] * a[i]
    else:
        f, b = constants[int(s), block], now[second]
        for i in range(n):
            c[i] = a[i] if f[i] != 0.0 else b[i]


@compiled
def multiplied(kind, c, a, b, k, same):
    """Order k of a product into c, or added to it; ``same`` says that b is a."""
    if kind == MULTIPLY:
        c[:] = 0.0
    if same:
        square(c, a, k, 0)
    else:
        cauchy(c, a, b, k, 0, k + 1)


@compiled
def inverted(kind, c, a, b, s, k):
    """Order k of c that is a / b, √a, a^s, exp a or log a, by c's own lower orders."""
    ck, n = c[k], c.shape[1]
    ck[:] = 0.0
    if kind == DIVIDE:
        cauchy(ck, b, c, k, 1, k)
        for i in range(n):
            ck[i] = (a[k, i] - ck[i] - b[k, i] * c[0, i]) / b[0, i]
    elif kind == ROOT:
        square(ck, c, k, 1)
        for i in range(n):
            ck[i] = 0.5 * (a[k, i] - ck[i]) / c[0, i]
    elif kind == POWER:
        weighted(ck, a, c, k, k + 1, s + 1.0, -float(k))
        for i in range(n):
            ck[i] /= k * a[0, i]
    elif kind == EXP:
        weighted(ck, a, c, k, k + 1, 1.0 / k, 0.0)
    else:
        weighted(ck, c, a, k, k, 1.0 / k, 0.0)
        for i in range(n):
            ck[i] = (a[k, i] - ck[i]) / a[0, i]


@compiled
def paired(kind, c, a, slope, k):
    """Order k of c = f(a) and of its companion f'(a), for tanh, sine and cosine."""
    ck, d = c[k], slope[k]
    ck[:] = 0.0
    weighted(ck, a, slope, k, k + 1, 1.0 / k, 0.0)
    d[:] = 0.0
    if kind == TANH:
        square(d, c, k, 0)
        for i in range(d.shape[0]):
            d[i] = -d[i]
    else:
        weighted(d, a, c, k, k + 1, -1.0 / k, 0.0)


@compiled
def order_k(code, parameters, constants, block, w, kept, now, k):
    """Order k ≥ 1 of all rows of a block, the inputs' as it stands."""
    for m in range(code.shape[0]):
        kind, out, first, second = code[m, 0], code[m, 1], code[m, 2], code[m, 3]
        s, place = parameters[m], kept[out]
        if kind <= SELECT:
            combined(kind, now, out, first, second, s, constants, block)
        elif kind <= PRODUCT:
            multiplied(kind, now[out], w[kept[first]], w[kept[second]], k, first == second)
        elif kind <= LOG:
            inverted(kind, w[place], w[kept[first]], w[kept[second]], s, k)
        else:
            paired(kind, w[place], w[kept[first]], w[kept[second]], k)
            now[second] = w[kept[second], k]
        if kind > PRODUCT:
            now[out] = w[place, k]
        elif place >= 0:
            w[place, k] = now[out]


@compiled
def changed(kind, w, kept, d, out, first, second, s):  # noqa: PLR0912 (one switch)
    """First change d (rows, lanes) of a row that is not linear in others."""
    c, a, b = d[out], d[first], d[second]
    v, a0, b0 = w[kept[out], 0], w[kept[first], 0], w[kept[second], 0]
    n = c.shape[0]
    if kind == MULTIPLY:
        for i in range(n):
            c[i] = a0[i] * b[i] + a[i] * b0[i]
    elif kind == PRODUCT:
        for i in range(n):
            c[i] += a0[i] * b[i] + a[i] * b0[i]
    elif kind == DIVIDE:
        for i in range(n):
            c[i] = (a[i] - v[i] * b[i]) / b0[i]
    elif kind == ROOT:
        for i in range(n):
            c[i] = 0.5 * a[i] / v[i]
    elif kind == POWER:
        for i in range(n):
            c[i] = s * v[i] / a0[i] * a[i]
    elif kind == EXP:
        for i in range(n):
            c[i] = v[i] * a[i]
    elif kind == LOG:
        for i in range(n):
            c[i] = a[i] / a0[i]
    else:
        for i in range(n):
            c[i] = b0[i] * a[i]
            b[i] = -2.0 * v[i] * c[i] if kind == TANH else -v[i] * a[i]


@compiled
def linear(code, parameters, constants, block, w, kept, d):
    """Carry changes d (rows, lanes) of the inputs' order through all rows of a block."""
    for m in range(code.shape[0]):
        kind, out, first, second = code[m, 0], code[m, 1], code[m, 2], code[m, 3]
        if kind <= SELECT:
            combined(kind, d, out, first, second, parameters[m], constants, block)
        else:
            changed(kind, w, kept, d, out, first, second, parameters[m])


@compiled
def completed(code, parameters, constants, block, w, kept, d, k):
    """Add changes d of the inputs' order k, and what follows from them, to a block's order k."""
    linear(code, parameters, constants, block, w, kept, d)
    for r in range(kept.shape[0]):
        if kept[r] >= 0:
            c = w[kept[r], k]
            for i in range(c.shape[0]):
                c[i] += d[r, i]


@compiled
def advanced(code, parameters, constants, w, kept, k, inputs, changes, pending, outputs):
    """Complete order k − 1 by the inputs' changes if they are pending, then find order k.

    ``changes`` has the shape (inputs, blocks, lanes), the result (outputs, blocks, lanes).
    """
    blocks, lanes = w.shape[0], w.shape[3]
    found = np.empty((len(outputs), blocks, lanes))
    d = np.zeros((len(kept), lanes))
    now = np.zeros((len(kept), lanes))
    for block in range(blocks):
        part = w[block]
        if pending:
            for r in range(len(inputs)):
                d[inputs[r]] = changes[r, block]
            completed(code, parameters, constants, block, part, kept, d, k - 1)
        for r in range(len(inputs)):
            if kept[inputs[r]] >= 0:
                part[kept[inputs[r]], k] = 0.0
        order_k(code, parameters, constants, block, part, kept, now, k)
        for r in range(len(outputs)):
            found[r, block] = now[outputs[r]]
    return found


@compiled
def derivatives(code, parameters, constants, w, kept, inputs, seeds, outputs):
    """Changes (seeds, outputs, blocks, lanes) that seeds (seeds, inputs, blocks, lanes) make."""
    blocks, lanes = w.shape[0], w.shape[3]
    found = np.empty((len(seeds), len(outputs), blocks, lanes))
    d = np.zeros((len(kept), lanes))
    for block in range(blocks):
        for q in range(len(seeds)):
            for r in range(len(inputs)):
                d[inputs[r]] = seeds[q, r, block]
            linear(code, parameters, constants, block, w[block], kept, d)
            for r in range(len(outputs)):
                found[q, r, block] = d[outputs[r]]
    return found
