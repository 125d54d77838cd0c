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
from anmstrip.studies.benchmarks import Benchmark, end_shear, slit_plate
from anmstrip.studies.optional import asked, installed, left_out
from anmstrip.studies.peer_capstan import timed
from anmstrip.studies.peer_plates import MOST, PLATES, TOLERANCE, Bent, ramped
from anmstrip.studies.reports import Cell, Sheet
from anmstrip.studies.shell_runs import Followed, followed, settings

BENCHMARKS: dict[str, Callable[[], Benchmark]] = {
    "end shear": end_shear,
    "slit annular plate": slit_plate,
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
    "Displacements at full load. One core, each program in a process of its own, seconds of the "
    "processor (of the clock where there is no answer). Meshes were chosen so that the errors are "
    "alike (that of the table for Kratos, 10 x 80 cells). All but the series take Newton's method "
    "with steps of load that grow by half after an easy one and are halved where it fails; linear "
    "solves count those too. The imbalance is 1e-4 of the load (Kratos: of a step's; NGSolve: "
    "1e-8 in energy)."
)


def sheet(finer: Iterable[Followed], limit: float) -> Sheet:
    """All programs on the benchmarks that were followed on a finer mesh, and that they know."""
    paths = [path for path in finer if path.benchmark.name in BENCHMARKS]
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
    expected = finer.benchmark.published[-1, 1:], finer.at(np.ones(1))[0, 1:]
    off = [100.0 * float(np.abs(found.readings - e).max() / np.abs(e).max()) for e in expected]
    return (*head, found.seconds, found.steps, found.solves, found.unknowns, *off)


def solved(program: str, name: str) -> Bent:
    """A benchmark at full load, by the program of that name."""
    if program in OURS:
        return OURS[program](BENCHMARKS[name]())
    found: Bent = import_module(f"anmstrip.studies.peer_{program}").solved(name, PLATES[name])
    return found


def _series(benchmark: Benchmark) -> Bent:
    paths: list[Followed] = []
    seconds = timed(lambda: paths.append(followed(benchmark, settings())))
    path = paths[0]
    readings = path.at(np.ones(1))[0, 1:].tolist()
    return Bent(readings, len(path.steps), path.tangents, len(benchmark.start), seconds)


def _newton(benchmark: Benchmark) -> Bent:
    """The same equations as the series', with the same steps of load as the others."""
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


OURS: dict[str, Callable[[Benchmark], Bent]] = {"series": _series, "newton": _newton}


def main() -> None:
    """Solve what the command line says."""
    print(json.dumps(asdict(solved(*sys.argv[1:3]))))


if __name__ == "__main__":
    main()
