"""One tangent, N orders: a point of a solution path becomes a branch of it.

The range in which the branch holds is decided on the residual at its end.  As a quotient of
polynomials it reaches beyond the circle of convergence.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lapack

from anmstrip.arrays import Array
from anmstrip.continuation.path import (
    TINY,
    Branch,
    Cost,
    Equations,
    Evidence,
    Outcome,
    PathStopped,
    Recurrence,
    inner,
    size,
)
from anmstrip.linalg.direct import Factors
from anmstrip.linalg.solvers import LinearSolver
from anmstrip.taylor.polynomials import first_root

LARGEST_COEFFICIENT = float(np.finfo(float).max) ** (1.0 / 3.0)
"""Size of a coefficient after which a series ends, so that products of three do not overflow."""

SIGNIFICANT_SHARE = 0.1
"""Share of the tolerance above which an order is seen.  With a half of it sharp friction
(ω = 1e-10, q = 0.01) stalls and conveying takes 327 tangents instead of 296; with a tenth of it
a press roll takes up to 186 tangents instead of 58, at tolerances within 6 %."""


@dataclass(frozen=True)
class Parameter:
    """Meaning of the path parameter a, and how far a = 1 is to reach."""

    scale: float  # change of the control, or arclength, at a = 1
    reach: float = np.inf  # largest a of interest; orders that are not seen there are left out
    arclength: bool = False  # follow pseudo-arclength instead of the control
    forward: tuple[Array, float] | None = None  # direction (u, λ) of travel so far, on an arc
    relaxation: float = 0.0  # change of the control over which a small imbalance is taken away


def linearised(
    equations: Equations, u: Array, control: float, order: int, solver: LinearSolver, cost: Cost
) -> tuple[Recurrence, Factors]:
    """Return series that begin at a point, and factors of its tangent; ``cost`` times them."""
    with cost.timed("series"):
        recurrence = equations.recurrence(u, control, order)
    with cost.timed("tangent"):
        matrix = recurrence.tangent()
    with cost.timed("factorisation"):
        return recurrence, solver.factorise(matrix)


def expand(
    equations: Equations,
    u: Array,
    control: float,
    *,
    order: int,
    solver: LinearSolver,
    parameter: Parameter,
    tolerance: float = 0.0,
    cost: Cost | None = None,
) -> Branch:
    """Series of the path through (u, control), with one factorisation.

    Order k of R is K u_k + λ_k ∂R/∂λ + advance(k), so that u_k = ū_k + λ_k û with
    K ū_k = −advance(k) and K û = −∂R/∂λ.  The border equation closes it: λ = λ_0 + scale a, or
    ⟨t, (u, λ)⟩ = scale a along the arc, where t is the unit vector along (û, 1).

    Parameters
    ----------
    equations : Equations
    u : ndarray, shape (n,)
    control : float
        λ at the start.
    order : int
        N, the highest order.
    solver : LinearSolver
        Factorises the tangent K once and solves for every order.
    parameter : Parameter
        Meaning and scale of the path parameter.
    tolerance : float
        Largest imbalance that is wanted.  Where two successive orders would leave
        less than a tenth of it at ``parameter.reach``, the series ends.  An initial
        imbalance above it is taken away over the whole reach, on an arc up to a = 1; a
        smaller one over a change of the control by ``parameter.relaxation``, but not
        before a = 1.
    cost : Cost, optional
        Counters to add to.

    Returns
    -------
    Branch
        Of unlimited length: its range is not known yet.

    Raises
    ------
    SingularTangentError
        From the solver, if the tangent cannot be factorised.
    PathStopped
        As many expansions as ``cost`` allows were made.
    """
    cost = Cost() if cost is None else cost
    if cost.expansions >= cost.most:
        raise PathStopped(Outcome.TOO_MANY_TANGENTS, control)
    known = equations.known(u, control, order)
    recurrence, factors = known or linearised(equations, u, control, order, solver, cost)
    cost.expansions += 1
    cost.factorisations += 1

    def solve(right: Array) -> Array:
        cost.solves += 1
        with cost.timed("back-substitution"):
            return factors.solve(right)

    per_control = -solve(recurrence.control_derivative())
    away = equations.imbalance(recurrence.residual) > tolerance
    if parameter.arclength:
        norm = np.sqrt(inner(equations, per_control, per_control) + 1.0)
        forward_u, forward_control = parameter.forward or (np.zeros_like(u), 1.0)
        if inner(equations, forward_u, per_control) + forward_control < 0.0:
            norm = -norm
        t_u, t_control = per_control / norm, 1.0 / norm
        along = inner(equations, t_u, per_control) + t_control
        share = 0.0 if away else parameter.relaxation
        carried_over = max(1.0, share / max(abs(t_control) * parameter.scale, TINY))
    else:
        reach = parameter.reach if np.isfinite(parameter.reach) else 1.0
        share = parameter.relaxation / max(abs(parameter.scale), TINY)
        carried_over = max(1.0, reach if away else share)
    u_orders, control_orders, forces, unseen = [u], [control], [0.0], 0
    right = recurrence.residual / carried_over
    for k in range(1, order + 1):
        force = equations.imbalance(right)
        free = -solve(right) if force else np.zeros_like(u)
        control_k = parameter.scale if k == 1 else 0.0
        if parameter.arclength:
            control_k = (control_k - inner(equations, t_u, free)) / along
        u_k = free + control_k * per_control if control_k else free
        u_orders.append(u_k)
        control_orders.append(control_k)
        forces.append(force if k > 1 else 0.0)
        seen = k == 1 or _is_seen(force, k, parameter.reach, tolerance)
        unseen = 0 if seen else unseen + 1
        if unseen == 2 or k == order or size(equations, u_k) > LARGEST_COEFFICIENT:
            break
        with cost.timed("series"):
            recurrence.correct(k, u_k, control_k)
            right = recurrence.advance(k + 1)
    u, controls, last = np.array(u_orders), np.array(control_orders), (forces[-2], forces[-1])
    return Branch(u, controls, np.inf, recurrence.residual, carried_over, last)


def _is_seen(force: float, k: int, reach: float, tolerance: float) -> bool:
    """Whether force · reach^k, left without order k, is more than a share of the tolerance."""
    if not force > 0.0:
        return force != 0.0
    least = max(SIGNIFICANT_SHARE * tolerance, TINY)
    return math.log(force) + k * math.log(reach) > math.log(least)


def validate(
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
            outcome = Outcome.STALLED if np.isfinite(error) else Outcome.NOT_FINITE
            detail = f"the series does not meet the tolerance {tolerance:g} at any length"
            evidence = Evidence(residual=excess_imbalance(equations, branch, guess, cost))
            raise PathStopped(outcome, float(branch.control[0]), detail, evidence)
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


def excess_imbalance(equations: Equations, branch: Branch, a: float, cost: Cost) -> Array:
    """Imbalance at a that was not there at the start, shape (n,)."""
    cost.residuals += 1
    with cost.timed("residual"), np.errstate(over="ignore", invalid="ignore"):
        residual = equations.residual(*branch(a))
        return np.asarray(residual - branch.residual * (1.0 - a / branch.carried_over))


COMPARED_ORDERS = 4
"""Last orders that must be parallel, and in one ratio."""

PROGRESSION_TOLERANCE = 1e-3
"""Deviation from a progression, relative, that is allowed."""

ROUND_OFF_SHARE = 1e-5
"""Share of the first order up to which a progression is an answer to round-off."""


def progression(equations: Equations, branch: Branch) -> float | None:
    """Ratio a_c of the last orders, signed, if they are a progression that began faintly."""
    last, count = branch.u[-1], COMPARED_ORDERS
    norm = inner(equations, last, last)
    if branch.order < 2 * count or not 0.0 < norm < np.inf:
        return None
    shares = [inner(equations, u, last) / norm for u in branch.u[-2 : -count - 1 : -1]]
    ratio = shares[0]
    if ratio == 0.0:
        return None
    for j, (share, u) in enumerate(zip(shares, branch.u[-2 : -count - 1 : -1], strict=True)):
        parallel = size(equations, u - share * last) <= PROGRESSION_TOLERANCE * size(equations, u)
        if not parallel or abs(share / ratio ** (j + 1) - 1.0) > PROGRESSION_TOLERANCE:
            return None
    began = np.sqrt(norm) * abs(ratio) ** (branch.order - 1)
    return ratio if began < ROUND_OFF_SHARE * size(equations, branch.u[1]) else None


def without_progression(
    equations: Equations, branch: Branch, tolerance: float, cost: Cost
) -> Branch:
    """The branch without its progression, one order less.

    Itself if there is none, or if it is no answer to round-off: without it the equation is not met
    as far as the last terms allow with it.
    """
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
    shorter = replace(branch, u=u, control=control, forces=forces)
    length, _ = guessed_range(equations, branch, tolerance, np.inf)
    error, _ = residual_error(equations, shorter, length, cost, tolerance)
    return shorter if error <= tolerance else branch


LENGTH_RATIO = 1.05
"""Lengths that are tried are powers of this, times that of the series: what round-off changes in
an error does not change them.  Only the end of the path is one of its own."""

MATCHED_ORDERS = 4
"""Orders of the product that are to vanish.  With one, stiff plate on a roller table stalled; with
fourteen conveying takes a quarter more tangents."""

LONGEST_QUOTIENT = 4.0
"""Where they are weighted, and the longest that is tried, over the length of the series.  With 2
conveying takes 368 tangents instead of 333."""

DENOMINATOR_DAMPING = 1e-7
"""Damping of the denominator's coefficients, over the largest term.  With 1e-9 steps in mm and in
m are of other lengths, by 4e-3 after 50 of them, with 1e-7 by 5e-9; tangents are hardly fewer."""


BLOCK_ROWS = 256
"""Rows of a matrix that are orthogonalised (Demmel, Grigori, Hoemmen & Langou, SIAM J. Sci. Comput.
34, 2012) or multiplied at once: BLAS shares larger ones among threads, which wait for others."""


def longest_quotient(
    equations: Equations, series: Branch, tolerance: float, reach: float, cost: Cost
) -> tuple[Branch, float] | None:
    """The rational form of a series, if it meets the tolerance further on than its terms tell.

    Its length is sought by bisection, as if errors grew with the length.

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
    quotient, longest = as_quotient(equations, series.cut(guess)), LONGEST_QUOTIENT * guess
    if quotient is None:
        return None
    pole = first_root(quotient.denominator, longest) or longest
    rungs = np.arange(1, np.log(LONGEST_QUOTIENT) / np.log(LENGTH_RATIO))
    lengths = guess * LENGTH_RATIO**rungs
    lengths = np.unique(np.minimum(lengths[lengths < pole], reach))
    found: tuple[Branch, float] | None = None
    holds, fails = -1, len(lengths)
    while fails - holds > 1:
        tried = (holds + fails) // 2
        error, imbalance = residual_error(equations, quotient, lengths[tried], cost, tolerance)
        if error <= tolerance:
            found, holds = (quotient.cut(lengths[tried]), imbalance), tried
        else:
            fails = tried
    return found


def as_quotient(equations: Equations, branch: Branch) -> Branch | None:
    """The same orders as a quotient; None if there are numbers too large for that.

    The denominator's coefficients d_1 … d_m make the last orders of the product vanish, in
    coordinates of what the orders span, by damped least squares.
    """
    n, scale = branch.order, LONGEST_QUOTIENT * branch.length
    degree, last = n - 1, min(MATCHED_ORDERS, n - 1)
    with np.errstate(all="ignore"):
        powers = scale ** np.arange(1.0, n + 1)
        terms = coordinates(equations, branch) * powers[:, None]
        largest = np.sqrt(np.square(terms).sum(axis=1).max())
        if not np.isfinite(largest):
            return None
        padded = np.vstack([np.zeros((degree, terms.shape[1])), terms])
        columns = [padded[degree + n - last - j : degree + n - j].ravel() for j in range(n)]
        damping = DENOMINATOR_DAMPING * largest * np.eye(degree)
        matrix = np.vstack([np.stack(columns[1:], axis=1), damping])
        wanted = -np.concatenate([columns[0], np.zeros(degree)])
        found = lapack.dgels(matrix, wanted)[1][:degree] / powers[:degree]
        denominator = np.concatenate([[1.0], found])
        first = np.concatenate([denominator, np.zeros(n - degree)])
        orders = np.arange(n + 1)
        product = np.tril(first[orders[:, None] - orders])
        parts = np.array_split(branch.u, -(-branch.u.shape[1] // BLOCK_ROWS), axis=1)
        u, control = np.hstack([product @ part for part in parts]), product @ branch.control
    return replace(branch, u=u, control=control, denominator=denominator)


def coordinates(equations: Equations, branch: Branch) -> Array:
    """Orders 1 … N (rows) in an orthonormal basis of what they span, with the control."""
    weights = np.broadcast_to(np.sqrt(equations.metric), branch.u.shape[1:])
    seen = np.flatnonzero(weights)
    both = np.vstack([(branch.u[1:, seen] * weights[seen]).T, branch.control[1:]])
    found = both[:0]
    for first in range(0, len(both), BLOCK_ROWS):  # R of a tall matrix from those of its parts
        part = np.vstack([found, both[first : first + BLOCK_ROWS]])
        found = np.triu(lapack.dgeqrf(part)[0][: part.shape[1]])
    return found.T
