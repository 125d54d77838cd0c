"""Compiled loops: one call computes an order of a whole program, at all points.

The kernels go through a program block of points by block, so that what one instruction writes is
still in the cache when the next reads it.  Between two orders all unknowns are solved for, and by
then the caches have forgotten: an order costs what is read again from memory.  Only the rows
whose lower orders are needed are therefore kept; of all others there is only the order at hand.
Recurrences as in Griewank & Walther, *Evaluating Derivatives* (2008), ch. 13.

Only this module imports numba, and only :mod:`anmstrip.taylor.compiled` imports this module, where
there is no machine code yet.  Loops are written out, for that of slices would call numba's library.

Arrays: ``w`` (blocks, kept rows, order + 1, lanes); ``now`` (rows, lanes), one order of all
rows of a block; the others as in :class:`anmstrip.taylor.tape.Tables`.
"""

# ruff: noqa: PLR0913, PLR0917 (kernels take arrays, not objects)

from __future__ import annotations

import math

import numpy as np
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic

from anmstrip.taylor import tape

compiled = njit(error_model="numpy", _nrt=False)
"""Arguments like np.int64(0) stand for numbers of which numba would make a version for itself."""

called = njit(error_model="numpy")
"""The same for those that make arrays of pointers, for which numba asks for its own memory."""


@compiled
def fill(c, value):
    """Set all lanes to a value."""
    for i in range(c.shape[0]):
        c[i] = value


@compiled
def copy(c, a):
    """Set all lanes to those of another row."""
    for i in range(c.shape[0]):
        c[i] = a[i]


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
def combined(kind, now, w, condition, out, first, second, s, constants, block, k):  # noqa: PLR0912 (one switch)
    """Order k of a row that needs no lower orders of its operands, for kinds up to EQUAL."""
    c, a, b = now[out], now[first], now[second if kind >= tape.ADD else first]
    n = c.shape[0]
    f = constants[second if kind <= tape.COMBINE_BY else 0, block]
    if kind == tape.SCALE or kind == tape.SHIFT:  # noqa: PLR1714 (no sets in kernels)
        for i in range(n):
            c[i] = s * a[i]
    elif kind == tape.ADD:
        for i in range(n):
            c[i] = a[i] + s * b[i]
    elif kind == tape.COMBINE:
        for i in range(n):
            c[i] += s * a[i]
    elif kind == tape.SCALE_BY:
        for i in range(n):
            c[i] = f[i] * a[i]
    elif kind == tape.COMBINE_BY:
        for i in range(n):
            c[i] += f[i] * a[i]
    elif kind == tape.SELECT:
        for i in range(n):
            c[i] = a[i] if w[condition, 0, i] != 0.0 else b[i]
    else:
        fill(c, 0.0)
        if k == 0 and kind >= tape.LESS:
            less, equal = kind != tape.EQUAL, kind != tape.LESS
            for i in range(n):
                c[i] = 1.0 if (less and a[i] < b[i]) or (equal and a[i] == b[i]) else 0.0
    if k == 0 and kind <= tape.SHIFT:
        for i in range(n):
            c[i] += f[i]


@compiled
def multiplied(kind, c, a, b, k, same):
    """Order k of a product into c, or added to it; ``same`` says that b is a."""
    if kind == tape.MULTIPLY:
        fill(c, 0.0)
    if same:
        square(c, a, k, np.int64(0))
    else:
        cauchy(c, a, b, k, np.int64(0), k + 1)


@compiled
def valued(kind, c, d, a, b, s):
    """Order 0 of a function, and of its companion d."""
    for i in range(c.shape[0]):
        if kind == tape.DIVIDE:
            c[i] = a[i] / b[i]
        elif kind == tape.ROOT:
            c[i] = math.sqrt(a[i])
        elif kind == tape.POWER:
            c[i] = a[i] ** s
        elif kind == tape.EXP:
            c[i] = math.exp(a[i])
        elif kind == tape.LOG:
            c[i] = math.log(a[i])
        elif kind == tape.TANH:
            c[i] = math.tanh(a[i])
            d[i] = 1.0 / math.cosh(min(max(a[i], -350.0), 350.0)) ** 2
        else:
            c[i] = math.sin(a[i])
            d[i] = math.cos(a[i])


@compiled
def inverted(kind, c, ak, a, b, s, k):
    """Order k ≥ 1 of c that is a / b, √a, a^s, exp a or log a, by c's own lower orders."""
    ck, n = c[k], c.shape[1]
    fill(ck, 0.0)
    if kind == tape.DIVIDE:
        cauchy(ck, b, c, k, np.int64(1), k)
        for i in range(n):
            ck[i] = (ak[i] - ck[i] - b[k, i] * c[0, i]) / b[0, i]
    elif kind == tape.ROOT:
        square(ck, c, k, np.int64(1))
        for i in range(n):
            ck[i] = 0.5 * (ak[i] - ck[i]) / c[0, i]
    elif kind == tape.POWER:
        weighted(ck, a, c, k, k + 1, s + 1.0, -float(k))
        for i in range(n):
            ck[i] /= k * a[0, i]
    elif kind == tape.EXP:
        weighted(ck, a, c, k, k + 1, 1.0 / k, 0.0)
    else:
        weighted(ck, c, a, k, k, 1.0 / k, 0.0)
        for i in range(n):
            ck[i] = (ak[i] - ck[i]) / a[0, i]


@compiled
def paired(kind, c, a, slope, k):
    """Order k ≥ 1 of c = f(a) and of its companion f'(a), for tanh and sine."""
    ck, d = c[k], slope[k]
    fill(ck, 0.0)
    weighted(ck, a, slope, k, k + 1, 1.0 / k, 0.0)
    fill(d, 0.0)
    if kind == tape.TANH:
        square(d, c, k, np.int64(0))
        for i in range(d.shape[0]):
            d[i] = -d[i]
    else:
        weighted(d, a, c, k, k + 1, -1.0 / k, 0.0)


@compiled
def order_k(code, parameters, constants, block, w, kept, now, k):
    """Order k of all rows of a block, the inputs' as it stands."""
    for m in range(code.shape[0]):
        kind, out, first, second = code[m, 0], code[m, 1], code[m, 2], code[m, 3]
        s, place, a, b = parameters[m], kept[out], kept[first], -1
        if kind >= tape.MULTIPLY:
            b = kept[second]
        if kind <= tape.EQUAL:
            combined(kind, now, w, kept[code[m, 4]], out, first, second, s, constants, block, k)
        elif kind <= tape.PRODUCT:
            multiplied(kind, now[out], w[a], w[b], k, first == second)
        elif k == 0:
            valued(kind, w[place, 0], w[b, 0], now[first], now[second], s)
        elif kind <= tape.LOG:
            inverted(kind, w[place], now[first], w[a], w[b], s, k)
        else:
            paired(kind, w[place], w[a], w[b], k)
        if kind >= tape.TANH:
            copy(now[second], w[b, k])
        if kind > tape.PRODUCT:
            copy(now[out], w[place, k])
        elif place >= 0:
            copy(w[place, k], now[out])


@compiled
def changed(kind, w, kept, d, out, first, second, s):  # noqa: PLR0912 (one switch)
    """First change d (rows, lanes) of a row that is not linear in others."""
    c, a, b = d[out], d[first], d[second]
    v, a0, b0 = w[kept[out], 0], w[kept[first], 0], w[kept[second], 0]
    n = c.shape[0]
    if kind == tape.MULTIPLY:
        for i in range(n):
            c[i] = a0[i] * b[i] + a[i] * b0[i]
    elif kind == tape.PRODUCT:
        for i in range(n):
            c[i] += a0[i] * b[i] + a[i] * b0[i]
    elif kind == tape.DIVIDE:
        for i in range(n):
            c[i] = (a[i] - v[i] * b[i]) / b0[i]
    elif kind == tape.ROOT:
        for i in range(n):
            c[i] = 0.5 * a[i] / v[i]
    elif kind == tape.POWER:
        for i in range(n):
            c[i] = s * v[i] / a0[i] * a[i]
    elif kind == tape.EXP:
        for i in range(n):
            c[i] = v[i] * a[i]
    elif kind == tape.LOG:
        for i in range(n):
            c[i] = a[i] / a0[i]
    else:
        for i in range(n):
            c[i] = b0[i] * a[i]
            b[i] = -2.0 * v[i] * c[i] if kind == tape.TANH else -v[i] * a[i]


@compiled
def linear(code, parameters, constants, block, w, kept, d, k):
    """Carry changes d (rows, lanes) of the inputs' order k ≥ 1 through all rows of a block."""
    for m in range(code.shape[0]):
        kind, out, first, second = code[m, 0], code[m, 1], code[m, 2], code[m, 3]
        s = parameters[m]
        if kind <= tape.EQUAL:
            combined(kind, d, w, kept[code[m, 4]], out, first, second, s, constants, block, k)
        else:
            changed(kind, w, kept, d, out, first, second, s)


@compiled
def completed(code, parameters, constants, block, w, kept, d, k):
    """Add changes d of the inputs' order k, and what follows from them, to a block's order k."""
    linear(code, parameters, constants, block, w, kept, d, np.int64(1))
    for r in range(kept.shape[0]):
        if kept[r] >= 0:
            c = w[kept[r], k]
            for i in range(c.shape[0]):
                c[i] += d[r, i]


@called
def advance(
    code, parameters, constants, kept, inputs, outputs, sizes,
    given, changes, found, now, d, pending, k, w, orders,
):  # fmt: skip
    """Complete order k − 1 by the inputs' changes if they are pending, then find order k.

    ``given``, order k of the inputs, and ``changes`` have the shape (inputs, blocks, lanes),
    ``found`` (outputs, blocks, lanes); ``now`` and ``d`` are for use inside.
    """
    s = carray(sizes, 8)
    n, rows, ins, outs = s[0], s[1], s[2], s[3]
    blocks, lanes, places, count = s[4], s[5], s[6], s[7]
    code, parameters = carray(code, (n, 5)), carray(parameters, n)
    constants, kept = carray(constants, (count, blocks, lanes)), carray(kept, rows)
    inputs, outputs = carray(inputs, ins), carray(outputs, outs)
    w, given = carray(w, (blocks, places, orders, lanes)), carray(given, (ins, blocks, lanes))
    changes, found = carray(changes, (ins, blocks, lanes)), carray(found, (outs, blocks, lanes))
    now, d = carray(now, (rows, lanes)), carray(d, (rows, lanes))
    for block in range(blocks):
        part = w[block]
        if pending:
            for r in range(ins):
                copy(d[inputs[r]], changes[r, block])
            completed(code, parameters, constants, block, part, kept, d, k - 1)
        for r in range(ins):
            copy(now[inputs[r]], given[r, block])
            if kept[inputs[r]] >= 0:
                copy(part[kept[inputs[r]], k], given[r, block])
        order_k(code, parameters, constants, block, part, kept, now, k)
        for r in range(outs):
            copy(found[r, block], now[outputs[r]])


@called
def derivatives(
    code, parameters, constants, kept, inputs, outputs, sizes, seeds, found, d, most, w, orders
):  # fmt: skip
    """Changes (seeds, outputs, blocks, lanes) that seeds (seeds, inputs, blocks, lanes) make."""
    s = carray(sizes, 8)
    n, rows, ins, outs = s[0], s[1], s[2], s[3]
    blocks, lanes, places, count = s[4], s[5], s[6], s[7]
    code, parameters = carray(code, (n, 5)), carray(parameters, n)
    constants, kept = carray(constants, (count, blocks, lanes)), carray(kept, rows)
    inputs, outputs = carray(inputs, ins), carray(outputs, outs)
    w, seeds = carray(w, (blocks, places, orders, lanes)), carray(seeds, (most, ins, blocks, lanes))
    found, d = carray(found, (most, outs, blocks, lanes)), carray(d, (rows, lanes))
    for block in range(blocks):
        for q in range(most):
            for r in range(ins):
                copy(d[inputs[r]], seeds[q, r, block])
            linear(code, parameters, constants, block, w[block], kept, d, np.int64(1))
            for r in range(outs):
                copy(found[q, r, block], d[outputs[r]])


@compiled
def lift(starts, columns, entries, places, x, found, rows, count, stride):
    """Set found[places[r] + c stride] to Σ M_rn x[n count + c], M in compressed rows."""
    for r in range(rows):
        for c in range(0, count - 2, 3):  # three components at once
            first, second, third = 0.0, 0.0, 0.0
            for e in range(starts[r], starts[r + 1]):
                entry, n = entries[e], columns[e] * count + c
                first += entry * x[n]
                second += entry * x[n + 1]
                third += entry * x[n + 2]
            place = places[r] + c * stride
            found[place], found[place + stride], found[place + 2 * stride] = first, second, third
        c = count - count % 3
        if count % 3 == 2:
            first, second = 0.0, 0.0
            for e in range(starts[r], starts[r + 1]):
                entry, n = entries[e], columns[e] * count + c
                first += entry * x[n]
                second += entry * x[n + 1]
            place = places[r] + c * stride
            found[place], found[place + stride] = first, second
        elif count % 3 == 1:
            total = 0.0
            for e in range(starts[r], starts[r + 1]):
                total += entries[e] * x[columns[e] * count + c]
            found[places[r] + c * stride] = total


@compiled
def gather(starts, places, entries, forces, total, rows, count, stride):
    """Add Σ M_nr forces[places of r + c stride] to total[n count + c], M in compressed rows."""
    for n in range(rows):
        for c in range(0, count - 2, 3):
            first, second, third = 0.0, 0.0, 0.0
            for e in range(starts[n], starts[n + 1]):
                entry, place = entries[e], places[e] + c * stride
                first += entry * forces[place]
                second += entry * forces[place + stride]
                third += entry * forces[place + 2 * stride]
            total[n * count + c] += first
            total[n * count + c + 1] += second
            total[n * count + c + 2] += third
        c = count - count % 3
        if count % 3 == 2:
            first, second = 0.0, 0.0
            for e in range(starts[n], starts[n + 1]):
                entry, place = entries[e], places[e] + c * stride
                first += entry * forces[place]
                second += entry * forces[place + stride]
            total[n * count + c] += first
            total[n * count + c + 1] += second
        elif count % 3 == 1:
            added = 0.0
            for e in range(starts[n], starts[n + 1]):
                added += entries[e] * forces[places[e] + c * stride]
            total[n * count + c] += added


@compiled
def set_stresses(middle, t, weights, derivative, j, i, first):
    """Set rows (q, a) to Σ_b w_q J[j, b, i, a] B_b at the points q of an element from ``first``."""
    k, functions = derivative.shape[1], t.shape[1]
    for q in range(weights.shape[0]):
        for a in range(k):
            into, w, point = middle[q * k + a], weights[q], first + q
            fill(into, 0.0)
            for b in range(0, k - 1, 2):
                f0, f1 = w * derivative[j, b, i, a, point], w * derivative[j, b + 1, i, a, point]
                r = q * k + b
                for n in range(functions):
                    into[n] += f0 * t[r, n] + f1 * t[r + 1, n]
            if k % 2:
                f0, r = w * derivative[j, k - 1, i, a, point], q * k + k - 1
                for n in range(functions):
                    into[n] += f0 * t[r, n]


@called
def assemble(table, weights, derivative, places, pairs, middle, local, sizes):
    """Add Σ_q w_q Bᵀ J_ji B of every element to the blocks of components i and j.

    ``table`` holds B (elements, points · components, functions), ``derivative`` J[j, b, i, a] of
    forces (i, a) by derivatives (j, b) in rows as long as ``stride``; ``middle`` and ``local`` are
    for use inside.  Where J is symmetric only i ≥ j is integrated.
    """
    s = carray(sizes, 8)
    elements, points, k, functions = s[0], s[1], s[2], s[3]
    m, couplings, stride, symmetric = s[4], s[5], s[6], s[7]
    rows = points * k
    table = carray(table, (elements, rows, functions))
    weights = carray(weights, (elements, points))
    derivative = carray(derivative, (m, k, m, k, stride))
    places = carray(places, (elements, functions, functions))
    pairs, middle = carray(pairs, (m, m, couplings)), carray(middle, (rows, functions))
    local = carray(local, functions)
    for e in range(elements):
        t, place = table[e], places[e]
        for j in range(m):
            for i in range(j if symmetric else 0, m):
                set_stresses(middle, t, weights[e], derivative, j, i, e * points)
                for f in range(functions):
                    fill(local, 0.0)
                    r = 0
                    while r + 7 < rows:
                        t0, t1, t2, t3 = t[r, f], t[r + 1, f], t[r + 2, f], t[r + 3, f]
                        t4, t5, t6, t7 = t[r + 4, f], t[r + 5, f], t[r + 6, f], t[r + 7, f]
                        for n in range(functions):
                            local[n] += (
                                t0 * middle[r, n]
                                + t1 * middle[r + 1, n]
                                + t2 * middle[r + 2, n]
                                + t3 * middle[r + 3, n]
                                + t4 * middle[r + 4, n]
                                + t5 * middle[r + 5, n]
                                + t6 * middle[r + 6, n]
                                + t7 * middle[r + 7, n]
                            )
                        r += 8
                    while r < rows:
                        for n in range(functions):
                            local[n] += t[r, f] * middle[r, n]
                        r += 1
                    for n in range(functions):
                        pairs[i, j, place[f, n]] += local[n]
                        if symmetric and i > j:
                            pairs[j, i, place[n, f]] += local[n]


def pointer_to(kind):
    """Function from an address to a pointer to numbers of a kind."""

    @intrinsic
    def pointer(typing, address):
        def code(context, builder, signature, arguments):
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return types.CPointer(kind)(address), code

    return pointer


integers, indices, floats = map(pointer_to, (types.int64, types.int32, types.float64))


def run(calls, count, k, w, orders):
    """Make calls one after the other; k is the order that is advanced to.

    Each is a row of numbers: which call it is, and its arguments, arrays by their addresses.  The
    address ``w`` of the coefficients, which have so many orders, is the same for all.
    """
    table = carray(calls, (count, tape.CALL))
    for m in range(count):
        c = table[m]
        if c[0] == tape.LIFT:
            lift(
                indices(c[1]), indices(c[2]), floats(c[3]), indices(c[4]), floats(c[5]),
                floats(c[6]), c[7], c[8], c[9],
            )  # fmt: skip
        elif c[0] == tape.GATHER:
            gather(
                indices(c[1]), indices(c[2]), floats(c[3]), floats(c[4]), floats(c[5]),
                c[6], c[7], c[8],
            )  # fmt: skip
        elif c[0] == tape.ADVANCE:
            advance(
                integers(c[1]), floats(c[2]), floats(c[3]), integers(c[4]), integers(c[5]),
                integers(c[6]), integers(c[7]), floats(c[8]), floats(c[9]), floats(c[10]),
                floats(c[11]), floats(c[12]), c[13], k, floats(w), orders,
            )  # fmt: skip
        elif c[0] == tape.ASSEMBLE:
            assemble(
                floats(c[1]), floats(c[2]), floats(c[3]), integers(c[4]), floats(c[5]),
                floats(c[6]), floats(c[7]), integers(c[8]),
            )  # fmt: skip
        else:
            derivatives(
                integers(c[1]), floats(c[2]), floats(c[3]), integers(c[4]), integers(c[5]),
                integers(c[6]), integers(c[7]), floats(c[8]), floats(c[9]), floats(c[10]),
                c[11], floats(w), orders,
            )  # fmt: skip


def instructions():
    """Instructions of :func:`run` for LLVM, and the name it has there."""
    signature = types.void(types.CPointer(types.int64), *4 * [types.int64])
    made = cfunc(signature, error_model="numpy")(run)
    return made.inspect_llvm(), made.native_name.removeprefix("cfunc.")
