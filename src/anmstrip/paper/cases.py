"""The three mass-spring cases of the 2010 paper: run, compare with references, report."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from anmstrip.errors import InputError, Mistake, nearest
from anmstrip.paper.figures import draw_figures
from anmstrip.paper.mass_spring import CASES, MassSpring, Parameters
from anmstrip.paper.references import Reference, reference_solution
from anmstrip.paper.schemes import SCHEMES, CaseEvent, CaseSolution, events_of, solve_case
from anmstrip.results.files import atomic_write, write_table
from anmstrip.timestepping.index_one import Instability, instabilities

Array = NDArray[np.float64]

PAPER_STEPS = {"pressed-plane": 34, "moving-plane": 90, "rotating-circle": 90}
"""Steps that the paper reports, at order 19 and tolerance 1e-4."""

COLUMNS = ("time", "ux", "uy", "vx", "vy", "normal_reaction", "tangential_reaction")

ROWS = 401
"""Instants written, evenly spaced."""

ANY_SIGN = {"V", "Omega"}

NOTHING_SET: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True)
class CaseReport:
    """What a case gave; ``str`` is a table.

    Attributes
    ----------
    name, scheme : str
    order : int
    tolerance : float
        m.
    case : MassSpring
    solved : CaseSolution
    rows : ndarray, shape (401, 7)
        The columns of ``case.csv``.
    error : float
        Largest distance of the rows from the reference (m), motion faster than
        V_c measured along the curve in (V_c t, u); None if there is no reference.
    error_at_equal_times : float
        Largest difference at the time of a row (m).
    seconds : float
    events : tuple of CaseEvent
        Contact, stick and slip, the cone, and the loss of Coulomb's solution.
    unstable : tuple of Instability
        Stretches in which there is no equilibrium to follow.
    files : tuple of Path
    """

    name: str
    scheme: str
    order: int
    tolerance: float
    case: MassSpring
    solved: CaseSolution
    rows: Array
    error: float | None
    error_at_equal_times: float | None
    seconds: float
    events: tuple[CaseEvent, ...] = ()
    unstable: tuple[Instability, ...] = ()
    files: tuple[Path, ...] = ()

    @property
    def steps(self) -> int:
        """Steps of the integration that kept the tolerance."""
        return len(self.solved.path.errors)

    @property
    def tangents(self) -> int:
        """Tangents factorised, in all passes."""
        return self.solved.cost.factorisations

    @property
    def end(self) -> Array:
        """Displacement at the end, shape (2,)."""
        return self.rows[-1, 1:3]

    @property
    def done(self) -> bool:
        """Whether the end of the time span was reached within the tolerance."""
        return self.solved.stopped is None and self.solved.error <= self.tolerance

    @property
    def message(self) -> str:
        """How it ended, as a sentence."""
        if self.solved.stopped is not None:
            return f"stopped: {self.solved.stopped}"
        if self.solved.error > self.tolerance:
            return "the tolerance could not be kept"
        return "reached the end"

    def summary(self) -> dict[str, object]:
        """What ``case.json`` holds."""
        return {
            "name": self.name,
            "scheme": self.scheme,
            "order": self.order,
            "tolerance": self.tolerance,
            "message": self.message,
            "steps": self.steps,
            "paper_steps": PAPER_STEPS[self.name],
            "passes": self.solved.passes,
            "tangents": self.tangents,
            "seconds": self.seconds,
            "end": {"time": self.rows[-1, 0], "ux": self.end[0], "uy": self.end[1]},
            "error": self.error,
            "error_at_equal_times": self.error_at_equal_times,
            "estimated_error": self.solved.error,
            "events": [asdict(event) for event in self.events],
            "unstable": [str(stretch) for stretch in self.unstable],
            "parameters": asdict(self.case.parameters),
        }

    def __str__(self) -> str:
        lines = [f"{label:<18}{text}" for label, text in self._lines()]
        return "\n".join([*lines, *(f"{'written':<18}{file}" for file in self.files)])

    def _lines(self) -> Iterator[tuple[str, str]]:
        yield "case", f"{self.name}: {self.message}"
        yield "scheme", f"{self.scheme}, order {self.order}, tolerance {self.tolerance:g} m"
        yield "steps", f"{self.steps} (paper: {PAPER_STEPS[self.name]})"
        yield "tangents", f"{self.tangents} in {self.solved.passes} pass(es)"
        yield "time taken", f"{self.seconds:.2f} s"
        ux, uy = self.end
        yield "end", f"t = {self.rows[-1, 0]:g} s, ux = {ux:.6f} m, uy = {uy:.6f} m"
        for event in self.events:
            label = f"t = {event.time:.6f} s"
            yield label, ". ".join(filter(None, (event.kind, event.message)))
        for stretch in self.unstable:
            yield "unstable", str(stretch)
        yield "estimated error", f"{self.solved.error:.2g} m"
        if self.error is None or self.error_at_equal_times is None:
            yield "error to Radau", "unknown: scipy could not integrate this case"
            return
        yield "error to Radau", f"{self.error:.2g} m"
        if self.error_at_equal_times > 1.01 * self.error:
            yield "", f"{self.error_at_equal_times:.2g} m at equal times, where it is fast"


def run_case(
    name: str,
    *,
    order: int = 19,
    tolerance: float = 1e-4,
    settings: Mapping[str, float] = NOTHING_SET,
    scheme: str = "taylor",
    directory: str | Path | None = None,
) -> CaseReport:
    """Run a case of the paper; write ``case.csv``, ``events.csv``, ``case.json`` and figures.

    Parameters
    ----------
    name : str
        ``"pressed-plane"``, ``"moving-plane"`` or ``"rotating-circle"``.
    order : int
        Of the series.
    tolerance : float
        Error of u (m).
    settings : mapping
        Values of the paper's symbols, for :class:`Parameters`.
    scheme : str
        ``"taylor"`` (the paper's) or ``"implicit"``.
    directory : path, optional
        Where to write; ``results/case-<name>`` if not given.

    Returns
    -------
    CaseReport

    Raises
    ------
    InputError
        With all mistakes; then nothing was written.
    """
    mistakes = [*_mistakes(name, order, tolerance, scheme), *_wrong_settings(settings)]
    if mistakes:
        raise InputError(mistakes)
    case = _with(CASES[name](), settings)
    if case.parameters.eta >= case.parameters.K * case.parameters.delta:
        wrong = case.parameters.eta
        raise InputError([Mistake("--set", "eta", wrong, "below K delta (N)", "eta=0.01")])
    begin = time.perf_counter()
    found = solve_case(case, scheme, order=order, tolerance=tolerance)
    seconds = time.perf_counter() - begin
    rows = _rows(case, found, np.linspace(0.0, found.path.knots[-1], ROWS))
    error, equal = _errors(case, rows[:, 0], rows[:, 1 : 1 + case.size], tolerance)
    events = tuple(events_of(case, found.path.polynomials()))
    unstable = tuple(instabilities(case.residual, found.path))
    report = CaseReport(
        name, scheme, order, tolerance, case, found, rows, error, equal, seconds, events, unstable
    )
    return replace(report, files=_written(report, Path(directory or f"results/case-{name}")))


def _with(case: MassSpring, settings: Mapping[str, float]) -> MassSpring:
    values = {key: float(value) for key, value in settings.items()}
    return replace(case, parameters=replace(case.parameters, **values))


def _rows(case: MassSpring, found: CaseSolution, times: Array) -> Array:
    """The columns of ``case.csv``, from the dense output."""
    rows = np.zeros((len(times), len(COLUMNS)))
    rows[:, 0] = times
    for row in rows:
        u, v = found.path(row[0])
        row[1 : 1 + case.size], row[3 : 3 + case.size] = u, v
        row[5:] = [float(np.squeeze(r)) for r in case.reactions(u, v, row[0])]
    return rows


def _errors(
    case: MassSpring, times: Array, u: Array, tolerance: float
) -> tuple[float, float] | tuple[None, None]:
    """Largest distance from the reference, along the curve and at equal times."""
    try:
        reference = reference_solution(case)
    except ArithmeticError:
        return None, None
    return distances(reference, times, u, case.parameters.V_c, 0.1 * tolerance)


def distances(
    reference: Reference, times: Array, u: Array, speed: float, seen: float
) -> tuple[float, float]:
    """Largest distance from the reference, along the curve and at equal times.

    Parameters
    ----------
    times, u : ndarray, shapes (m,) and (m, n)
    speed : float
        V of the curve in (V t, u).
    seen : float
        Difference at equal times (m) up to which the curve is not looked at.
    """
    equal = np.abs(u - reference(times)).max(axis=1)
    along = [
        reference.distance(t, x, speed) if e > seen else e
        for t, x, e in zip(times, u, equal, strict=True)
    ]
    return float(max(along)), float(equal.max())


def _written(report: CaseReport, directory: Path) -> tuple[Path, ...]:
    directory.mkdir(parents=True, exist_ok=True)
    table, summary = directory / "case.csv", directory / "case.json"
    with atomic_write(table) as temporary:
        np.savetxt(
            temporary, report.rows, "%.12g", delimiter=",", header=",".join(COLUMNS), comments=""
        )
    with atomic_write(summary) as temporary:
        temporary.write_text(json.dumps(report.summary(), indent=2) + "\n", encoding="utf-8")
    events = directory / "events.csv"
    write_table(events, [f.name for f in fields(CaseEvent)], map(asdict, report.events))
    times = np.union1d(report.rows[:, 0], report.solved.path.knots)  # a snap falls between rows
    states = _rows(report.case, report.solved, times)
    return table, summary, events, *draw_figures(report.case, states, directory)


def _mistakes(name: str, order: int, tolerance: float, scheme: str) -> Iterator[Mistake]:
    if name not in CASES:
        yield Mistake("case", "", name, "a case of the paper", nearest(name, CASES))
    if scheme not in SCHEMES:
        yield Mistake("--scheme", "", scheme, "a scheme", nearest(scheme, SCHEMES))
    if order < 2:
        yield Mistake("--order", "", order, "an order of at least 2", "--order 19")
    if not 0.0 < tolerance < 1.0:
        yield Mistake("--tolerance", "", tolerance, "above 0 and below 1 (m)", "--tolerance 1e-4")


def _wrong_settings(settings: Mapping[str, float]) -> Iterator[Mistake]:
    defaults = Parameters()
    for key, value in settings.items():
        if key not in Parameters.names():
            hint = nearest(key, Parameters.names())
            yield Mistake("--set", key, value, "a symbol of the paper", hint)
        elif not np.isfinite(value):
            yield Mistake("--set", key, value, "a finite number", f"{key}={getattr(defaults, key)}")
        elif key == "q" and not 0.0 < value <= 1.0:
            yield Mistake("--set", key, value, "above 0 and at most 1", "q=0.05")
        elif key not in ANY_SIGN and value <= 0.0:
            hint = f"{key}={getattr(defaults, key)}"
            yield Mistake("--set", key, value, "a number above 0", hint)
