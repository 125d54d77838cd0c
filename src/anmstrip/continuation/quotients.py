"""Branches as quotients of polynomials, which reach beyond the circle of convergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import toeplitz

from anmstrip.arrays import Array
from anmstrip.continuation.equations import TINY, Cost, Equations, inner, size
from anmstrip.continuation.path import Branch
from anmstrip.continuation.validity import guessed_range, residual_error
from anmstrip.taylor.polynomials import first_root

LOOKED_AT = 4
"""Last orders that must be parallel, and in one ratio."""

ALIKE = 1e-3
"""Deviation from a progression, relative, that is allowed."""

FAINT = 1e-5
"""Share of the first order up to which a progression is an answer to round-off."""


def progression(equations: Equations, branch: Branch) -> float | None:
    """Ratio a_c of the last orders, signed, if they are a progression that began faintly."""
    last, count = branch.u[-1], LOOKED_AT
    norm = inner(equations, last, last)
    if branch.order < 2 * count or not 0.0 < norm < np.inf:
        return None
    shares = [inner(equations, u, last) / norm for u in branch.u[-2 : -count - 1 : -1]]
    ratio = shares[0]
    if ratio == 0.0:
        return None
    for j, (share, u) in enumerate(zip(shares, branch.u[-2 : -count - 1 : -1], strict=True)):
        bent = size(equations, u - share * last)
        if bent > ALIKE * size(equations, u) or abs(share / ratio ** (j + 1) - 1.0) > ALIKE:
            return None
    began = np.sqrt(norm) * abs(ratio) ** (branch.order - 1)
    return ratio if began < FAINT * size(equations, branch.u[1]) else None


def cleared(equations: Equations, branch: Branch) -> Branch:
    """The branch without its progression, one order less; itself if there is none."""
    ratio = progression(equations, branch)
    if ratio is None:
        return branch
    n = branch.order
    shares = ratio ** np.arange(n - 1.0, 0.0, -1.0)
    u, control = branch.u[:n].copy(), branch.control[:n].copy()
    u[1:] -= shares[:, None] * branch.u[n]
    control[1:] -= shares * branch.control[n]
    unit = branch.forces[0] / size(equations, branch.u[n - 1])
    forces = (unit * size(equations, u[-2]), unit * size(equations, u[-1]))
    return replace(branch, u=u, control=control, forces=forces)


RUNG = 1.05
"""Lengths that are tried are powers of this, times that of the series: what round-off changes in
an error does not change them.  With 1.0001 the capstan takes 102 tangents instead of 97."""

FIRST = 10
"""Rung that is tried first: most quotients hold up to there.  From 0 the coarse capstan takes 47
tangents instead of 38."""

TRIALS = 4
"""Lengths that are tried.  Without a bound conveying takes 339 tangents instead of 322."""

AIM = 0.7
"""Share of the tolerance that the next one aims at.  With half of it conveying takes 354 tangents
instead of 322."""

LAST = 4
"""Orders of the product that are to vanish.  With one, levelling takes 53 tangents, not 50."""

FURTHER = 4.0
"""Where they are weighted, and the longest that is tried, over the length of the series.  With 3
conveying takes 340 tangents instead of 322."""

DAMPING = 1e-7
"""Damping of the denominator's coefficients, over the largest term.  With 1e-9 steps in mm and in
m are of other lengths, by 4e-3 after 50 of them, with 1e-7 by 5e-9; tangents are hardly fewer."""


TALL = 256
"""Rows of a matrix that are orthogonalised (Demmel, Grigori, Hoemmen & Langou, SIAM J. Sci. Comput.
34, 2012) or multiplied at once: BLAS shares larger ones among threads, which wait for others."""


def longest_quotient(
    equations: Equations, series: Branch, tolerance: float, reach: float, cost: Cost
) -> tuple[Branch, float] | None:
    """The rational form of a series, if it meets the tolerance further on than its terms tell.

    Its error is taken for a power of the length, which the lengths that are tried tell.

    Returns
    -------
    branch : Branch
        At most ``reach`` long, with no pole inside.
    imbalance : float
        Residual at its end.

    None where the quotient does not meet it, or the series itself arrives.
    """
    guess, reach = guessed_range(equations, series, tolerance, reach)
    if series.order < 3 or guess >= reach:
        return None
    quotient, limit = rational(equations, series.cut(guess)), min(reach, FURTHER * guess)
    if quotient is None:
        return None
    pole = first_root(quotient.denominator, limit)
    limit = limit if pole is None else pole / RUNG
    rung, best, least, power = FIRST, 0, np.inf, series.order + 1.0
    last, last_error = np.inf, np.inf
    found: tuple[Branch, float] | None = None
    for _ in range(TRIALS):
        length = min(guess * RUNG**rung, limit)
        if not best < rung < least or length <= (guess if found is None else found[0].length):
            break
        error, imbalance = residual_error(equations, quotient, length, cost, tolerance)
        if error <= tolerance:
            found, best = (quotient.cut(length), imbalance), rung
        else:
            least = rung
        if length != last and 0.0 < error < np.inf and 0.0 < last_error < np.inf:
            power = max(float(np.log(error / last_error) / np.log(length / last)), 1.0)
        last, last_error = length, error
        growth = np.log(AIM * tolerance / max(error, TINY)) / power
        rung += int(np.floor(np.clip(growth, -np.log(2.0), np.log(2.0)) / np.log(RUNG)))
    return found


def rational(equations: Equations, branch: Branch) -> Branch | None:
    """The same orders as a quotient; None if there are numbers too large for that.

    The denominator's coefficients d_1 … d_m make the last orders of the product vanish, in
    coordinates of what the orders span, by damped least squares.
    """
    n, scale = branch.order, FURTHER * branch.length
    degree, last = n - 1, min(LAST, n - 1)
    with np.errstate(all="ignore"):
        powers = scale ** np.arange(1.0, n + 1)
        terms = coordinates(equations, branch) * powers[:, None]
        largest = np.linalg.norm(terms, axis=1).max()
        if not np.isfinite(largest):
            return None
        padded = np.vstack([np.zeros((degree, terms.shape[1])), terms])
        columns = [
            padded[degree + n - last - j : degree + n - j].ravel() for j in range(degree + 1)
        ]
        matrix = np.vstack([np.stack(columns[1:], axis=1), DAMPING * largest * np.eye(degree)])
        wanted = -np.concatenate([columns[0], np.zeros(degree)])
        found = np.linalg.lstsq(matrix, wanted, rcond=None)[0] / powers[:degree]
        denominator = np.concatenate([[1.0], found])
        first = np.concatenate([denominator, np.zeros(n - degree)])
        product = toeplitz(first, np.zeros(n + 1))
        parts = np.array_split(branch.u, -(-branch.u.shape[1] // TALL), axis=1)
        u, control = np.hstack([product @ part for part in parts]), product @ branch.control
    return replace(branch, u=u, control=control, denominator=denominator)


def coordinates(equations: Equations, branch: Branch) -> Array:
    """Orders 1 … N (rows) in an orthonormal basis of what they span, with the control."""
    motion = branch.u[1:] * np.sqrt(equations.metric)
    both = np.column_stack([motion, branch.control[1:]]).T
    while len(both) > TALL:  # R of tall matrices from those of their parts
        whole, rest = np.split(both, [len(both) // TALL * TALL])
        parts = np.asarray(np.linalg.qr(whole.reshape(-1, TALL, both.shape[1]), mode="r"))
        both = np.vstack([parts.reshape(-1, both.shape[1]), rest])
    return np.asarray(np.linalg.qr(both, mode="r")).T
