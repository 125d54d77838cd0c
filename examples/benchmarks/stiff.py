"""A stiff point: what an error costs, ours and the solvers that everybody has.

A point without mass is pulled by a spring of unit stiffness at 1 + ½ sin 2t, against friction
v/√(v² + ε²).  It sticks until the spring has reached the force of friction; then, within a
time of ε², it slides as it is pulled.  The smaller ε, the sharper the corner and the stiffer
what follows: an explicit step is bounded by ε².
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from figures import Curves, against
from harness import Cell, Report, Sheet, installed, left_out, main
from stiff_methods import END, METHODS, REST, Method, rate, timed
from stiff_reference import Reference

EPSILONS = (0.3, 0.1, 0.03, 0.01, 1e-3)

WANTED = 1e-8
"""Error that the methods are compared at."""

COLUMNS = ("epsilon", "method", "tolerance", "steps", "evaluations", "tangents", "seconds", "error")


@dataclass(frozen=True)
class Attempt:
    """One method at one tolerance; the attributes are those of the columns."""

    epsilon: float
    method: str
    tolerance: float
    steps: int
    evaluations: int | None
    tangents: int | None
    seconds: float
    error: float

    @property
    def row(self) -> tuple[Cell, ...]:
        """Cells of the columns."""
        return tuple(getattr(self, column) for column in COLUMNS)


def study(quick: bool = False) -> Report:
    """All methods at all tolerances and sharpnesses."""
    epsilons = (0.3, 1e-2) if quick else EPSILONS
    references = {epsilon: Reference(epsilon, END) for epsilon in epsilons}
    attempts = [a for e, r in references.items() for a in attempted(e, r, quick)]
    return Report(
        name="stiff",
        title="A stiff sliding point: error against cost",
        data=Sheet("All attempts", COLUMNS, tuple(a.row for a in attempts)),
        sheets=(_compared(attempts), _own(attempts), _checked(references)),
        figures={
            "stiff_tangents.png": against(_curves(attempts, "tangents"), "tangents", "error (m)"),
            "stiff_seconds.png": against(_curves(attempts, "seconds"), "seconds", "error (m)"),
        },
    )


def attempted(epsilon: float, reference: Reference, quick: bool) -> Iterable[Attempt]:
    """Every installed method at its tolerances."""
    for method in METHODS:
        if method.module and not installed(method.module):
            continue
        tolerances = method.tolerances[1:-1:2] if quick else method.tolerances
        for tolerance in tolerances:
            yield attempt(method, epsilon, tolerance, reference)


def attempt(method: Method, epsilon: float, tolerance: float, reference: Reference) -> Attempt:
    """One method at one tolerance, beside the reference."""
    found, seconds = timed(method.solver, epsilon, tolerance)
    through = found.times[-1] > END * (1.0 - 1e-9)
    error = np.abs(found.states - reference(found.times)).max() if through else np.inf
    counts = (found.steps, found.evaluations, found.tangents)
    return Attempt(epsilon, method.name, tolerance, *counts, seconds, float(error))


# sheets --------------------------------------------------------------------------


def _compared(attempts: list[Attempt]) -> Sheet:
    """The cheapest attempt of each method that is good enough, else its best."""
    rows = []
    for epsilon in dict.fromkeys(a.epsilon for a in attempts):
        for name in dict.fromkeys(a.method for a in attempts):
            own = [a for a in attempts if (a.epsilon, a.method) == (epsilon, name)]
            good = [a for a in own if a.error <= WANTED]
            best = min(own, key=lambda a: a.error)
            rows.append((min(good, key=lambda a: a.steps) if good else best).row)
    note = (
        f"For every method the loosest tolerance tried that gives an error of {WANTED:g}, or the "
        f"one with the least error; inf: given up. t from 0 to {END:g} s; errors at the ends of "
        "steps (heyoka: at 2000 times). Tangents are matrices factorised: of 3 unknowns as one "
        "real and one complex for Radau, of 1 else."
    )
    missing = left_out(m.module for m in METHODS if m.module)
    return Sheet("Cost of an error", COLUMNS, tuple(rows), " ".join(filter(None, (note, missing))))


def _own(attempts: list[Attempt]) -> Sheet:
    """What ours makes of the tolerance, and of ε."""
    own = [a for a in attempts if a.method == METHODS[0].name]
    rows = [
        (a.epsilon, a.tolerance, a.steps, a.tangents, a.error, a.error / a.tolerance) for a in own
    ]
    columns = ("epsilon", "tolerance", "steps", "tangents", "error", "error / tolerance")
    return Sheet("The tolerance and the error of our backward differences", columns, tuple(rows))


def _checked(references: dict[float, Reference]) -> Sheet:
    """The reference beside scipy's Radau, which knows nothing of it."""
    rows = []
    for epsilon, reference in references.items():
        found = solve_ivp(rate(epsilon), (0, END), REST, method="Radau", rtol=1e-12, atol=1e-14)
        difference = float(np.abs(found.y[0] - reference(found.t)).max())
        rows.append((epsilon, len(reference.pieces), len(found.t) - 1, difference))
    columns = ("epsilon", "pieces of degree 24", "steps of Radau", "largest difference")
    return Sheet("The reference beside Radau at a tolerance of 1e-12", columns, tuple(rows))


def _curves(attempts: list[Attempt], cost: str) -> Curves:
    """Sharpness → method → cost and error of its attempts."""
    curves: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for a in attempts:
        spent = getattr(a, cost)
        if spent:
            panel = curves.setdefault(f"ε = {a.epsilon:g}", {})
            panel.setdefault(a.method, []).append((spent, a.error))
    return curves


if __name__ == "__main__":
    main(study)
