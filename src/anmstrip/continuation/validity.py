"""The range in which a branch holds, decided on the residual at its end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.expansion import Cost, Equations, term_range
from anmstrip.continuation.path import Branch
from anmstrip.continuation.status import Evidence, Outcome, PathStopped

Array = NDArray[np.float64]


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
    order = branch.order
    reach = min(reach, without_overshoot(equations, branch, tolerance))
    guess = guessed(branch, tolerance, reach)
    error, imbalance = errors(equations, branch, guess, cost, tolerance)
    longer = _predicted(guess, error, tolerance, order)
    if error <= tolerance and longer > 1.05 * guess and guess < reach:
        trial = min(longer, 2.0 * guess, reach)
        better = errors(equations, branch, trial, cost, tolerance)
        if better[0] <= tolerance:
            return branch.cut(trial), better[1]
    while error > tolerance:
        guess *= np.clip(_predicted(1.0, error, tolerance, order), 0.2, 0.9)
        if guess < 1e-9:
            raise PathStopped(
                Outcome.STALLED if np.isfinite(error) else Outcome.NOT_FINITE,
                float(branch.control[0]),
                f"the series does not meet the tolerance {tolerance:g} at any length",
                Evidence(residual=excess(equations, branch, guess, cost)),
            )
        error, imbalance = errors(equations, branch, guess, cost, tolerance)
    return branch.cut(guess), imbalance


def guessed(branch: Branch, tolerance: float, reach: float) -> float:
    """Length at which the last terms reach the tolerance, at most ``reach``."""
    guess = min(term_range(branch, tolerance), reach)
    return guess if np.isfinite(guess) else 1.0


def _predicted(length: float, error: float, tolerance: float, order: int) -> float:
    """Length at which an error that grows like a^(N+1) would be half the tolerance."""
    if not np.isfinite(error):
        return 0.2 * length
    if error == 0.0:
        return np.inf
    return length * (0.5 * tolerance / error) ** (1.0 / (order + 1))


def without_overshoot(equations: Equations, branch: Branch, tolerance: float) -> float:
    """Length up to which taking the initial imbalance away does not make a new one."""
    initial = equations.imbalance(branch.residual)
    if initial == 0.0:
        return np.inf
    spare = 0.5 * tolerance / initial if initial <= tolerance else 0.0
    return branch.carried_over * (1.0 + spare)


def errors(
    equations: Equations, branch: Branch, a: float, cost: Cost, tolerance: float = 0.0
) -> tuple[float, float]:
    """What is to meet the tolerance at a, and the imbalance there."""
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
