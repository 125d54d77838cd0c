"""The paper's cases: true error against the tolerance that was asked for, and against cost."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from anmstrip.continuation.path import PathStopped
from anmstrip.paper.cases import WRITTEN_ROWS, distances, solve_case
from anmstrip.paper.mass_spring import CASES, MassSpring, Reference, reference_solution
from figures import Measured, crossed, curves, measured, patiently, plotted, sheet, work_precision
from harness import Report, main


class Extent(NamedTuple):
    """The cases that are run, and how."""

    cases: tuple[str, ...]
    tolerances: tuple[float, ...]  # m
    lines: tuple[tuple[str, int], ...]  # scheme and order
    accuracy: float  # of the reference, relative
    patience: float  # s of a run after which its line ends


FULL = Extent(
    tuple(CASES),
    tuple(10.0**-k for k in range(3, 11)),
    (*(("taylor", order) for order in (8, 11, 15, 20, 24)), ("implicit", 12)),
    1e-12,
    12.0,
)

QUICK = Extent(
    ("pressed-plane", "moving-plane"), (1e-3, 1e-6), (("taylor", 8), ("taylor", 20)), 1e-10, 4.0
)

NOTE = (
    "Columns are tolerances (m), lines say case, scheme and order. Errors are distances from the "
    "solution of one scalar equation by Radau's method, as curves in (V_c t, u). nan: the path "
    "stopped before its time; –: a looser tolerance had taken too long already."
)


def study(quick: bool = False) -> Report:
    """Run all lines of all cases."""
    extent = QUICK if quick else FULL
    found = {name: list(_runs(name, extent)) for name in extent.cases}
    runs = [run for own in found.values() for run in own]
    precision = {
        f"cases-{name}.png": work_precision(own, "error (m)") for name, own in found.items()
    }
    ratio = plotted(runs, ("tolerance (m)", lambda r: r.at), ("error / tolerance", _ratio))
    return Report(
        name="cases",
        title="The paper's cases: true error against tolerance and cost",
        data=sheet("", "tolerance", runs),
        sheets=(
            crossed("True error / tolerance", runs, _ratio, NOTE),
            crossed("Tangents, of all passes", runs, lambda r: r.tangents),
            crossed("Seconds", runs, lambda r: r.seconds),
        ),
        figures={"cases-ratio.png": curves(ratio), **precision},
    )


def _ratio(run: Measured) -> float:
    return run.error / run.at


def _runs(name: str, extent: Extent) -> Iterator[Measured]:
    case = CASES[name]()
    reference = reference_solution(case, extent.accuracy)
    for scheme, order in extent.lines:
        attempt = partial(true_error, case, reference, scheme, order)

        def run(tolerance: float, line: str = f"{name}, {scheme} {order}") -> Measured:
            return measured(line, tolerance, partial(attempt, tolerance))  # noqa: B023

        yield from patiently(extent.tolerances, run, extent.patience)


def true_error(
    case: MassSpring, reference: Reference, scheme: str, order: int, tolerance: float
) -> tuple[float, int]:
    """Return the largest distance from the reference at ``WRITTEN_ROWS`` times (m), and tangents.

    The distance is that of the curves in (V_c t, u), as in the report of a case; it is
    not a number where the path has stopped before its time.
    """
    try:
        found = solve_case(case, scheme, order=order, tolerance=tolerance)
    except PathStopped:
        return np.nan, 0
    if found.stopped is not None:
        return np.nan, found.cost.factorisations
    times = np.linspace(0.0, case.parameters.t_end, WRITTEN_ROWS)
    u = np.array([found.path(t)[0] for t in times])
    error = distances(reference, times, u, case.parameters.V_c, 0.01 * tolerance)[0]
    return error, found.cost.factorisations


if __name__ == "__main__":
    main(study)
