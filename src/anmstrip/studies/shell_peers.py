"""Shells by programs that others have written, beside ours.

``python -m anmstrip.studies.shell_peers NAME BENCHMARK`` prints what one program finds, as one
line of JSON; a study has each in a process of its own, on one core.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from importlib import import_module

import numpy as np

from anmstrip.series.expansion import Cost
from anmstrip.series.linear_solvers import SparseSolver
from anmstrip.series.newton import Corrections, Newton
from anmstrip.studies.benchmarks import (
    Benchmark,
    end_moment,
    end_shear,
    hinged_roof,
    slit_plate,
)
from anmstrip.studies.optional import asked, installed, left_out
from anmstrip.studies.peer_capstan import timed
from anmstrip.studies.peer_plates import (
    ALONG,
    MOST,
    PLATES,
    TOLERANCE,
    Array,
    Bent,
    limits,
    ramped,
)
from anmstrip.studies.reports import Cell, Sheet
from anmstrip.studies.riks import arc_steps
from anmstrip.studies.shell_runs import Followed, followed, settings

KNOWN: dict[str, Callable[[], Benchmark]] = {
    "end shear": end_shear,
    "end moment": end_moment,
    "slit annular plate": slit_plate,
    "hinged roof, t = 12.7": lambda: hinged_roof(12.7),
    "hinged roof, t = 6.35": lambda: hinged_roof(6.35),
}


@dataclass(frozen=True)
class Program:
    """Who is asked, and the module that it needs (empty for this program)."""

    name: str
    title: str
    module: str = ""


PROGRAMS = (
    Program("series", "ours, series"),
    Program("newton", "ours, Newton's method"),
    Program("kratos", "Kratos, thin corotational triangles", "KratosMultiphysics"),
    Program("ngsolve", "NGSolve, mixed, cubic", "ngsolve"),
)

COLUMNS = ("benchmark", "program", "outcome", "seconds", "steps", "linear solves", "unknowns",
           "off the table (%)", "off our finer mesh (%)")  # fmt: skip

NOTE = (
    "Displacements at full load; of roofs the loads at limit points. One core, each program in a "
    "process of its own, seconds of the processor (of the clock where there is no answer). Meshes "
    "were chosen so that the errors are alike (that of the table for Kratos, 10 x 80 cells). All "
    "but the series take Newton's method with steps of load that grow by half after an easy one "
    "and are halved where it fails; linear solves count those too. The imbalance is 1e-4 of the "
    "load (Kratos: of a step's; NGSolve: 1e-8 in energy). On roofs they go in steps short enough "
    "to read limit points off the path: ours and NGSolve along our arc, with its own linear "
    "solver; Kratos by displacement of the middle, which leaps where the thin roof snaps back, so "
    "that its second load there is no limit point (its strategy along an arc comes to the first "
    "limit point of the thick roof, and goes to and fro there)."
)


def sheet(finer: Iterable[Followed], limit: float) -> Sheet:
    """All programs on the benchmarks that were followed on a finer mesh, and that they know."""
    paths = [path for path in finer if path.benchmark.name in KNOWN]
    programs = [p for p in PROGRAMS if not p.module or installed(p.module)]
    rows = tuple(row(program, path, limit) for path in paths for program in programs)
    missing = left_out(p.module for p in PROGRAMS if p.module)
    return Sheet("Other programs", COLUMNS, rows, " ".join(filter(None, (NOTE, missing))))


def row(program: Program, finer: Followed, limit: float) -> tuple[Cell, ...]:
    """One program on one benchmark; what goes wrong is the outcome."""
    name = finer.benchmark.name
    reply = asked("anmstrip.studies.shell_peers", program.name, name, limit=limit)
    head = (name, program.title, reply.outcome)
    if reply.said is None:
        return (*head, reply.seconds, None, None, None, None, None)
    found = Bent(**reply.said)
    expected = _expected(finer)
    off = [100.0 * float(np.abs(found.readings - e).max() / np.abs(e).max()) for e in expected]
    return (*head, found.seconds, found.steps, found.solves, found.unknowns, *off)


def _expected(finer: Followed) -> tuple[Array, Array]:
    """Readings by the published table and by our finer mesh."""
    table = finer.benchmark.published
    if finer.benchmark.snaps:
        return np.array(limits(*table.T)), np.array(finer.folds)
    return table[-1, 1:], finer.at(np.ones(1))[0, 1:]


def solved(program: str, name: str) -> Bent:
    """A benchmark at full load, by the program of that name."""
    if program in OURS:
        return OURS[program](KNOWN[name]())
    found: Bent = import_module(f"anmstrip.studies.peer_{program}").solved(name, PLATES[name])
    return found


def _series(benchmark: Benchmark) -> Bent:
    paths: list[Followed] = []
    seconds = timed(lambda: paths.append(followed(benchmark, settings())))
    path = paths[0]
    readings = path.folds if benchmark.snaps else path.at(np.ones(1))[0, 1:].tolist()
    return Bent(readings, len(path.steps), path.tangents, len(benchmark.start), seconds)


def _newton(benchmark: Benchmark) -> Bent:
    """The same equations as the series', with the same steps of load as the others."""
    if benchmark.snaps:
        return _along(benchmark)
    choices = Corrections(tolerance=TOLERANCE, most=MOST)
    newton = Newton(benchmark.equations, SparseSolver(), choices, Cost())
    states, counts = [benchmark.start], []

    def advance(load: float) -> tuple[bool, int]:
        before = newton.cost.factorisations
        found = newton.corrected(states[-1], load)
        if found is not None:
            states.append(found.u)
        return found is not None, newton.cost.factorisations - before

    seconds = timed(lambda: counts.append(ramped(advance)))
    return Bent(benchmark.reading(states[-1]).tolist(), *counts[0], len(states[0]), seconds)


def _along(benchmark: Benchmark) -> Bent:
    """Newton's method around limit points."""
    cost, path = Cost(), [(0.0, 0.0)]

    def work() -> None:
        steps = arc_steps(benchmark.equations, benchmark.start, solver=SparseSolver(),
                          settings=ALONG, target=benchmark.target, cost=cost)  # fmt: skip
        path.extend((step.control, float(benchmark.reading(step.u)[0])) for step in steps)

    seconds = timed(work)
    return Bent(limits(*zip(*path, strict=True)), len(path) - 1, cost.factorisations,
                len(benchmark.start), seconds)  # fmt: skip


OURS: dict[str, Callable[[Benchmark], Bent]] = {"series": _series, "newton": _newton}


def main() -> None:
    """Solve what the command line says."""
    print(json.dumps(asdict(solved(*sys.argv[1:3]))))


if __name__ == "__main__":
    main()
