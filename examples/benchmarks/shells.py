"""Shells beside published tables: tangents, seconds, limit points, bifurcations, convergence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from figures import Line, drawn
from harness import Cell, Report, Sheet, main
from shell_problems import (
    ROOF_LOAD,
    Benchmark,
    Followed,
    Iterated,
    end_moment,
    end_shear,
    followed,
    hinged_roof,
    iterated,
    miss,
    settings,
    slit_plate,
)

ROOFS = (12.7, 6.35)

Make = Callable[[], Benchmark]


@dataclass(frozen=True)
class Compared:
    """A benchmark by both methods, and on a finer mesh."""

    benchmark: Benchmark
    series: Followed
    newton: Iterated
    finer: Followed


def study(quick: bool = False) -> Report:
    """Follow all benchmarks by both methods, and what belongs to them."""
    compared = []
    for make, finer in coarse() if quick else full():
        found = followed(make(), settings())
        strict = followed(finer(), settings(tolerance=1e-6))
        compared.append(Compared(found.benchmark, found, iterated(found.benchmark), strict))
    counts = _main_sheet(compared)
    return Report(
        name="shells",
        title="Large deflections of shells, beside published tables and Newton's method",
        data=counts,
        sheets=(
            counts,
            _table_sheet(compared),
            _limit_sheet(4 if quick else 8),
            _whole_sheet(4 if quick else 8),
            _order_sheet([c.benchmark for c in compared], (20,) if quick else (20, 30, 40)),
            _mesh_sheet((4, 8, 16) if quick else (4, 8, 16, 32)),
            _strain_sheet(32 if quick else 64),
        ),
        figures={"shells.png": drawn(_panels(compared), "displacement", "share of the load")},
    )


def full() -> list[tuple[Make, Make]]:
    """Return every benchmark, and the same on a finer mesh."""
    return [
        (end_shear, lambda: end_shear(32)),
        (end_moment, lambda: end_moment(32)),
        (slit_plate, lambda: slit_plate((8, 80))),
        *((lambda t=t: hinged_roof(t), lambda t=t: hinged_roof(t, 16)) for t in ROOFS),
    ]


def coarse() -> list[tuple[Make, Make]]:
    """Return the same on meshes for a quick study."""
    return [
        (lambda: end_shear(8), end_shear),
        (lambda: end_moment(8), end_moment),
        (lambda: slit_plate((2, 16)), lambda: slit_plate((3, 24))),
        *((lambda t=t: hinged_roof(t, 4), lambda t=t: hinged_roof(t, 6)) for t in ROOFS),
    ]


# sheets --------------------------------------------------------------------------


def _main_sheet(compared: list[Compared]) -> Sheet:
    """Return counts, seconds and errors."""
    rows: list[tuple[Cell, ...]] = []
    for c in compared:
        if c.benchmark.snaps:
            expected = c.finer.curve[c.finer.curve[:, 0] <= c.benchmark.target]
        else:
            expected = c.finer.at(c.benchmark.published[1:, 0])
        newton = (len(c.newton.steps), c.newton.tangents, c.newton.seconds)
        rows.append((c.benchmark.name, len(c.benchmark.start), c.series.tangents, c.series.seconds,
                     *newton, 100.0 * miss(c.series, expected)))  # fmt: skip
    columns = ("benchmark", "unknowns", "tangents", "seconds", "Newton's steps",
               "Newton's tangents", "Newton's seconds", "off the finer mesh (%)")  # fmt: skip
    note = (
        "Series of order 20 with quotients, and Newton's method along the same arc (Riks), both to "
        "an imbalance of 1e-4 of the load. Errors are the largest along the path, in units of "
        "the largest displacement, against twice the elements (8 x 80 for the plate)."
    )
    return Sheet("Counts and seconds", columns, tuple(rows), note)


def _table_sheet(compared: list[Compared]) -> Sheet:
    """The published tables, from the finer mesh and from ours."""
    rows: list[tuple[Cell, ...]] = []
    for c in compared:
        table = c.benchmark.published
        shear = None
        if c.benchmark.snaps:
            thickness = c.benchmark.equations.model.strip.thickness
            gap = table[-1, 1] - c.finer.curve[-1, 1]
            shear = 1e3 * gap * thickness / (ROOF_LOAD * table[-1, 0])
        errors = [100.0 * miss(path, table) for path in (c.series, c.finer)]
        rows.append((c.benchmark.name, *errors, shear))
    note = (
        "The rolled-up strip has an exact solution without stretch, which stands for its table. "
        "The others were computed with shear-flexible elements (S4R of Abaqus, one point of "
        "integration). Under a point force these give in by c F/t more than any thin shell does: "
        "what is missing at the end of both roofs' tables is indeed one constant c."
    )
    columns = ("benchmark", "off the table (%)", "finer mesh, off the table (%)",
               "gap t/F (1e-3 mm²/N)")  # fmt: skip
    return Sheet("Published tables", columns, tuple(rows), note)


def _limit_sheet(cells: int) -> Sheet:
    """Return the limit points of the roofs, dated on a coarse path, beside a fine one."""
    rows: list[tuple[Cell, ...]] = []
    for thickness in ROOFS:
        roof = hinged_roof(thickness, cells)
        found = followed(roof, settings(), watch=True)
        fine = followed(roof, settings(30, 1e-9, rational=False))
        for point, load in zip(found.points, fine.folds, strict=True):
            read = float(roof.reading(point.u)[0])
            change = f"{point.before} → {point.after}"
            rows.append((roof.name, point.control, read, change, point.control - load))
    columns = ("benchmark", "share of the load", "−W centre", "negative eigenvalues", "off fine")
    note = (
        "Found on the path of the first table, and refined by one series about each. The fine path "
        "has order 30, tolerance 1e-9 and no quotients."
    )
    return Sheet("Limit points", columns, tuple(rows), note)


def _whole_sheet(cells: int) -> Sheet:
    """Return the singular points of whole roofs, which may lose their symmetry."""
    rows: list[tuple[Cell, ...]] = []
    for thickness in ROOFS:
        roof = hinged_roof(thickness, cells, whole=True)
        for p in followed(roof, settings(tolerance=1e-6), watch=True).points:
            read = float(roof.reading(p.u)[0])
            rows.append((roof.name, p.kind.value, p.control, read, f"{p.before} → {p.after}"))
    columns = ("benchmark", "point", "share of the load", "−W centre", "negative eigenvalues")
    note = (
        "The thin roof buckles to one side at a bifurcation, before the limit point of its table: "
        "that path is one of unstable states."
    )
    return Sheet("Whole roofs", columns, tuple(rows), note)


def _order_sheet(benchmarks: list[Benchmark], orders: tuple[int, ...]) -> Sheet:
    """Return the tangents (and seconds) by order, as series and as quotients."""
    kinds = [(order, rational) for order in orders for rational in (False, True)]
    rows = []
    for benchmark in benchmarks:
        found = [followed(benchmark, settings(n, rational=rational)) for n, rational in kinds]
        rows.append((benchmark.name, *(f"{f.tangents} ({f.seconds:.1f} s)" for f in found)))
    columns = tuple(f"{n}{', quotients' if rational else ''}" for n, rational in kinds)
    return Sheet("Tangents by order", ("benchmark", *columns), tuple(rows))


def _mesh_sheet(meshes: tuple[int, ...]) -> Sheet:
    """Return the order of convergence on the elastica."""
    rows: list[tuple[Cell, ...]] = []
    for curved, name in ((True, "Kirchhoff–Love"), (False, "isometric")):
        tips = [_tip(cells, curved) for cells in (*meshes, 2 * meshes[-1])]
        errors = [float(np.abs(tip - tips[-1]).max()) for tip in tips[:-1]]
        for i, cells in enumerate(meshes):
            order = np.log2(errors[i - 1] / errors[i]) if i else None
            rows.append((name, cells, errors[i], None if order is None else float(order)))
    columns = ("bending", "elements", "error of the tip", "order")
    note = "Cantilever under end shear; against twice the elements of the last row."
    return Sheet("Convergence on the elastica", columns, tuple(rows), note)


def _strain_sheet(cells: int) -> Sheet:
    """Return the difference of the two bending energies against the membrane strain."""
    rows: list[tuple[Cell, ...]] = []
    for thickness in (0.8, 0.4, 0.2, 0.1):
        tips = [_tip(cells, curved, thickness) for curved in (True, False)]
        gap, strain = float(np.abs(tips[0] - tips[1]).max()) / 10.0, 4.0 * thickness**2 / 1200.0
        rows.append((thickness, strain, gap, gap / strain))
    columns = ("thickness", "membrane strain F/Et", "difference of the tips / L", "ratio")
    note = (
        "At the same bending stiffness. The energies differ by D |r,a · r,bc|² / 2, hence by the "
        "square of the gradient of the membrane strain: the difference falls faster than it."
    )
    return Sheet("Kirchhoff–Love beside isometric bending", columns, tuple(rows), note)


def _tip(cells: int, curved: bool, thickness: float = 0.1) -> np.ndarray:
    benchmark = end_shear(cells, curved=curved, thickness=thickness)
    last = followed(benchmark, settings(tolerance=1e-7)).steps[-1]
    return benchmark.reading(last.branch.end[0])


# figure --------------------------------------------------------------------------


def _panels(compared: list[Compared]) -> dict[str, list[Line]]:
    """Return the load over displacement: path, ends of steps, table."""
    panels = {}
    for c in compared:
        table = c.benchmark.published
        lines = []
        for i, label in enumerate(c.benchmark.labels, start=1):
            lines.append(Line(label, c.series.curve[:, i], c.series.curve[:, 0]))
            lines.append(Line("steps", c.series.ends[:, i], c.series.ends[:, 0], "o"))
            lines.append(Line("table", table[:, i], table[:, 0], "x"))
        panels[f"{c.benchmark.name}: {c.series.tangents} tangents"] = lines
    return panels


if __name__ == "__main__":
    main(study)
