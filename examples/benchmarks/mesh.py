"""Element length: errors against √(D/T) over a roller, and against the elastica."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import Cost
from anmstrip.driver.run import Run
from anmstrip.linalg.solvers import SparseSolver
from cantilever import LENGTH, cantilever, elastica, tip
from contact import ratio_error
from figures import Plot, curves
from harness import Cell, Report, Sheet, main
from runs import finished
from strips import RADIUS, TENSION, capstan

Array = NDArray[np.float64]

CELLS = (2, 4, 8, 16, 32, 64)
"""Elements of the cantilever."""

THIN = 1e-2
"""Thickness of the cantilever (m): its membrane strain is then below 1e-6."""

SIZES = (4.0, 2.0, 1.0, 0.5, 0.25)
"""Element lengths over the roller, in √(D/T)."""

FINEST = 0.125
"""That of the reference, a section."""


def study(quick: bool = False) -> Report:
    """Compare errors of a cantilever, a section and a shell."""
    cells, sizes = (CELLS[:4], SIZES[:3]) if quick else (CELLS, SIZES)
    bent = [bending_error(n) for n in cells]
    finest = profile("section", sizes[-1] / 2.0 if quick else FINEST)
    found = {
        level: [profile(level, size) for size in own]
        for level, own in {"section": sizes, "shell": sizes[: 2 if quick else 4]}.items()
    }
    rows: list[tuple[Cell, ...]] = [
        (level, *p.errors(finest)) for level, own in found.items() for p in own
    ]
    beam = _orders([(n, LENGTH / n, e) for n, e in zip(cells, bent, strict=True)])
    names = ("h / √(D/T)", "tension ratio", "pressure", "bending moment")
    columns = ("level", *names, "against the formula", "unknowns", "tangents", "seconds")
    plots = [_plot(names[i], found, finest, i) for i in (1, 2, 3)]
    tips = Plot(
        "h (m)", "error of the tip / L", {"cantilever": ([LENGTH / n for n in cells], bent)}
    )
    return Report(
        name="mesh",
        title="Element length: errors over a roller, and of a cantilever",
        data=Sheet("", columns, tuple(rows)),
        sheets=(
            Sheet("Capstan", columns, tuple(rows), NOTE),
            Sheet(
                "Cantilever against the inextensible elastica at P L²/D = 4",
                ("elements", "h (m)", "error of the tip / L", "order"),
                tuple(beam),
            ),
        ),
        figures={"mesh.png": curves(*plots), "mesh-cantilever.png": curves(tips)},
    )


NOTE = (
    "Differences from a section with elements of an eighth of √(D/T) (a half of the smallest with "
    "--quick): the tension ratio, relative; pressure over T/R as root mean square over the middle "
    "half of the arc, away from the line forces at its ends; bending moment over D/R likewise, "
    "wherever the strip is bent. The capstan formula with bending "
    "neglects terms of higher order."
)


def _plot(label: str, found: dict[str, list[Profile]], finest: Profile, i: int) -> Plot:
    errors = {level: [p.errors(finest) for p in own] for level, own in found.items()}
    pairs = {level: ([e[0] for e in own], [e[i] for e in own]) for level, own in errors.items()}
    return Plot("h / √(D/T)", label, pairs)


def bending_error(cells: int, tolerance: float = 1e-7) -> float:
    """Return the error of the cantilever's tip over its length, against the elastica."""
    equations = cantilever(cells, THIN)
    settings = Settings(tolerance=tolerance, arclength=True)
    u = np.zeros(len(equations.supports.free))
    *_, last = follow(equations, u, solver=SparseSolver(), settings=settings, cost=Cost())
    found = tip(equations, last.branch.end[0]) / LENGTH
    return float(np.linalg.norm(found - elastica()))


def _orders(rows: Sequence[tuple[int, float, float]]) -> list[tuple[Cell, ...]]:
    """Rows of (elements, h, error) with the order between each and the one before."""
    orders: list[float | None] = [None]
    for (_, coarse, before), (_, fine, after) in pairwise(rows):
        orders.append(float(np.log(before / after) / np.log(coarse / fine)))
    return [(*row, order) for row, order in zip(rows, orders, strict=True)]


@dataclass(frozen=True)
class Profile:
    """A capstan on one mesh."""

    size: float  # element length over the roller, in √(D/T)
    ratio: float  # of tensions
    off: float  # error of the ratio against the formula
    x: Array  # points of contact (m)
    pressure: Array  # over T/R
    middles: Array  # of elements (m)
    moment: Array  # bending moment there, over D/R
    unknowns: int
    tangents: int
    seconds: float  # of the processor

    def errors(self, finest: Profile) -> tuple[float, ...]:
        """Return the differences from a finer one, and what it cost."""
        pressure = _distance(self.x, self.pressure, finest.x, finest.pressure, 0.5)
        moment = _distance(self.middles, self.moment, finest.middles, finest.moment, 1.0)
        ratio = abs(self.ratio / finest.ratio - 1.0)
        cost = (self.unknowns, self.tangents, self.seconds)
        return self.size, ratio, pressure, moment, self.off, *cost


def _distance(x: Array, y: Array, fine: Array, exact: Array, share: float) -> float:
    """Return the root mean square difference over the middle share of the finer one's support."""
    seen = fine[np.abs(exact) > 0.1]
    middle, half = 0.5 * (seen.max() + seen.min()), 0.5 * share * np.ptp(seen)
    even = np.linspace(middle - half, middle + half, 400)
    return float(np.sqrt(np.mean((np.interp(even, x, y) - np.interp(even, fine, exact)) ** 2)))


def profile(level: str, size: float, tolerance: float = 1e-5) -> Profile:
    """Run the capstan with elements of ``size`` √(D/T) over the roller."""
    D = 2e11 * 1e-9 / 12.0 / (1.0 - 0.3**2)
    scene = capstan(level, 2, size * float(np.sqrt(D / TENSION)), tolerance)
    begin = time.process_time()
    run = finished(scene)
    spent = time.process_time() - begin
    contact, reading = run.state.contacts["r1"], run.state.rollers["r1"]
    x, pressure = _row(contact.contact.operator.reference, contact.pressure)
    return Profile(
        size,
        reading.tension_ratio or np.nan,
        ratio_error(run),
        x,
        pressure * RADIUS / TENSION,
        *_moment(run),
        run.assembly.strip.unknowns,
        run.cost.factorisations,
        spent,
    )


def _row(places: Array, values: Array) -> tuple[Array, Array]:
    """Return values along the line of least y, by x."""
    row = np.flatnonzero(places[1] <= places[1].min() + 1e-9)
    row = row[np.argsort(places[0, row])]
    return places[0, row], values[..., row]


def _moment(run: Run) -> tuple[Array, Array]:
    """Return middles of the elements and |∂²r/∂x²| R there; exact for cubics."""
    strip, full = run.assembly.strip, run.march.full.reshape(-1, run.assembly.strip.count)
    nodes = np.vstack([strip.nodes, 0.0 * strip.nodes[:1]])[:2]
    x, slopes = _row(nodes, full[strip.dofs("u_x")].T)
    curvature = np.linalg.norm(np.diff(slopes, axis=1) / np.diff(x), axis=0)
    return 0.5 * (x[1:] + x[:-1]), curvature * RADIUS


if __name__ == "__main__":
    main(study)
