"""The range in which a branch holds, decided on the residual at its end."""

from __future__ import annotations

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.equations import Cost, Equations, Evidence, Outcome, PathStopped
from anmstrip.continuation.path import Branch
from anmstrip.taylor.polynomials import EPSILON

RUNG = 1.05
"""Lengths that are tried are powers of this, times a guess: what round-off changes in an error does
not change them.  With 1.001 three examples take 444 tangents instead of 446, and more residuals."""

FURTHER = 4.0
"""The longest that is tried, over the guess.  With 2 the bridle takes 363 tangents, not 309."""


def validated(
    equations: Equations, branch: Branch, tolerance: float, reach: float, cost: Cost
) -> tuple[Branch, float]:
    """Cut a branch where its own equation is met to the tolerance.

    The range at which the last terms reach the tolerance is a guess; it is
    corrected by the residual, which grows like a^(N+1), in both directions.  An
    imbalance that is being taken away is not counted while it lasts; any other
    is, with its part that grows again beyond ``carried_over``.

    Returns
    -------
    branch : Branch
        With a verified length, at most ``reach``.
    imbalance : float
        Residual at its end.

    Raises
    ------
    PathStopped
        If no length is found.
    """
    guess, reach = guessed_range(equations, branch, tolerance, reach)
    limit = min(reach, FURTHER * guess)
    if (found := longest(equations, branch, guess, limit, tolerance, cost)) is not None:
        return found
    residual = excess(equations, branch, guess * EPSILON, cost)
    raise PathStopped(
        Outcome.STALLED if np.isfinite(residual).all() else Outcome.NOT_FINITE,
        float(branch.control[0]),
        f"the series does not meet the tolerance {tolerance:g} at any length",
        Evidence(residual=residual),
    )


def longest(
    equations: Equations,
    branch: Branch,
    guess: float,
    limit: float,
    tolerance: float,
    cost: Cost,
    rung: int = 0,
) -> tuple[Branch, float] | None:
    """The longest piece of a branch found that meets the tolerance, and the imbalance at its end.

    Lengths are the rungs of a ladder, guess · RUNG^rung up to the limit.  The error is taken for
    a power of the length, a^(N+1) at first and then as the last two lengths tell; the next one
    is at most twice, at least half as long.  Half of the tolerance is aimed at, so that the
    imbalance at the end leaves room for the next branch; all of it where a quotient went too far,
    from which conveying takes 333 tangents instead of 356.

    Parameters
    ----------
    rung : int
        The one that is tried first: 0 for a series; above 0, as are all others, for a quotient.
    """
    quotient = rung > 0
    best, least = (0 if quotient else -np.inf), np.inf
    power, last, last_error = branch.order + 1.0, np.inf, np.inf
    found: tuple[Branch, float] | None = None
    while best < rung < least and guess * RUNG**rung > EPSILON * guess:
        length = min(guess * RUNG**rung, limit)
        if found is not None and length <= found[0].length:
            break
        error, imbalance = errors(equations, branch, length, cost, tolerance)
        if error <= tolerance:
            found, best = (branch.cut(length), imbalance), rung
        else:
            least = rung
        if length != last and 0.0 < error < np.inf and 0.0 < last_error < np.inf:
            power = max(float(np.log(error / last_error) / np.log(length / last)), 1.0)
        last, last_error = length, error
        share = np.clip(error / tolerance, EPSILON, 1.0 / EPSILON)
        share *= 1.0 if quotient and error > tolerance else 2.0
        growth = np.clip(-np.log(share) / power, -np.log(2.0), np.log(2.0))
        rung += int(np.floor(growth / np.log(RUNG)))
    return found


def guessed_range(
    equations: Equations, branch: Branch, tolerance: float, reach: float
) -> tuple[float, float]:
    """Length at which the last two terms reach the tolerance, and the longest of interest.

    A term is measured by the imbalance that would be left without it.  Both are
    looked at because every other coefficient may vanish.  The longest is at most ``reach``, and
    no longer than taking the initial imbalance away does not make a new one.
    """
    initial = equations.imbalance(branch.residual)
    if initial > 0.0:
        spare = 0.5 * tolerance / initial if initial <= tolerance else 0.0
        reach = min(reach, branch.carried_over * (1.0 + spare))
    terms = zip((branch.order - 1, branch.order), branch.forces, strict=True)
    ranges = [(tolerance / force) ** (1.0 / k) for k, force in terms if k > 0 and force > 0.0]
    guess = min([*ranges, reach])
    return (guess if np.isfinite(guess) else 1.0), reach


def errors(
    equations: Equations, branch: Branch, a: float, cost: Cost, tolerance: float = 0.0
) -> tuple[float, float]:
    """Error that is to meet the tolerance at a, and the imbalance there."""
    cost.residuals += 1
    with cost.timed("residual"), np.errstate(over="ignore", invalid="ignore"):
        residual = equations.residual(*branch(a))
        error = imbalance = equations.imbalance(residual)
        if equations.imbalance(branch.residual) > tolerance:
            rest = branch.residual * (1.0 - a / branch.carried_over)
            error = equations.imbalance(residual - rest)
    return (error if np.isfinite(error) else np.inf), imbalance


def excess(equations: Equations, branch: Branch, a: float, cost: Cost) -> Array:
    """Imbalance at a that was not there at the start, shape (n,)."""
    cost.residuals += 1
    with cost.timed("residual"), np.errstate(over="ignore", invalid="ignore"):
        residual = equations.residual(*branch(a))
        return np.asarray(residual - branch.residual * (1.0 - a / branch.carried_over))
