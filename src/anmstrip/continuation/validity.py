"""The range in which a branch holds, decided on the residual at its end."""

from __future__ import annotations

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation.equations import Cost, Equations, Evidence, Outcome, PathStopped
from anmstrip.continuation.path import Branch


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

    def predicted(length: float, error: float) -> float:
        """Length at which the error would be half the tolerance."""
        if not np.isfinite(error):
            return 0.2 * length
        return np.inf if error == 0.0 else length * (0.5 * tolerance / error) ** power

    power = 1.0 / (branch.order + 1)
    guess, reach = guessed_range(equations, branch, tolerance, reach)
    error, imbalance = residual_error(equations, branch, guess, cost, tolerance)
    longer = predicted(guess, error)
    if error <= tolerance and longer > 1.05 * guess and guess < reach:
        trial = min(longer, 2.0 * guess, reach)
        better = residual_error(equations, branch, trial, cost, tolerance)
        if better[0] <= tolerance:
            return branch.cut(trial), better[1]
    while error > tolerance:
        guess *= np.clip(predicted(1.0, error), 0.2, 0.9)
        if guess < 1e-9:
            raise PathStopped(
                Outcome.STALLED if np.isfinite(error) else Outcome.NOT_FINITE,
                float(branch.control[0]),
                f"the series does not meet the tolerance {tolerance:g} at any length",
                Evidence(residual=excess(equations, branch, guess, cost)),
            )
        error, imbalance = residual_error(equations, branch, guess, cost, tolerance)
    return branch.cut(guess), imbalance


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


def residual_error(
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
