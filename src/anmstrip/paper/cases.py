"""The three mass-spring cases of the 2010 paper: both schemes, events, references and figures."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import brentq

from anmstrip.arrays import Array
from anmstrip.continuation.follow import Settings
from anmstrip.continuation.path import Cost, PathStopped, Tolerances
from anmstrip.errors import InputError, Mistake, nearest
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.mechanics.laws import NortonHoff, cone_speed, corner_speed
from anmstrip.paper.mass_spring import (
    CASES,
    MassSpring,
    Parameters,
    PressedPlane,
    Reference,
    RotatingCircle,
    balanced_reactions,
    coulomb,
    reference_solution,
)
from anmstrip.pictures.curves import paneled_figure, save_figure
from anmstrip.results.events import EVENT_KINDS
from anmstrip.results.files import make_directory, write_summary, write_table
from anmstrip.taylor.polynomials import Watch, derivative_coefficients, value_at
from anmstrip.taylor.series import recorded, taylor_series
from anmstrip.timestepping import index_one
from anmstrip.timestepping.formulas import start_memory
from anmstrip.timestepping.implicit import Stepping, integrate

Step = TypeVar("Step")

FIRST_STEP_SHARE = 1e-3
"""First step of the implicit scheme, as a fraction of the time span."""

FAST_SPEED = 4.0
"""Speed over V_c above which an error counts along the curve, in the explicit scheme.

In a snap an error along the curve is a larger one at equal times.  At V_c itself the third case
keeps 1e-4 m along the curve, and is off by 2.7e-4 m in a row of ``case.csv``.
"""

MAX_CASE_STEPS = 200_000


@dataclass(frozen=True)
class CaseSolution(index_one.Controlled):
    """Result of an integration; its error (m) is one along the curve in fast motion."""

    cost: Cost  # of all passes
    stopped: PathStopped | None  # why the path ended before its time


def solve_case(case: MassSpring, scheme: str, *, order: int, tolerance: float) -> CaseSolution:
    """Integrate a case from rest until the error of u is below the tolerance.

    Parameters
    ----------
    case : MassSpring
    scheme : str
        A key of :data:`SCHEMES`.
    order : int
    tolerance : float
        m, at all times; motion much faster than V_c counts along the curve in (V_c t, u).

    Raises
    ------
    PathStopped
        If not even one step was possible.
    """
    cost = Cost()
    reasons: list[PathStopped | None] = []

    def run(allowed: float) -> index_one.TimePath:
        path, reason = SCHEMES[scheme](case, order, allowed, cost)
        reasons.append(reason)
        return path

    speed = FAST_SPEED * case.parameters.V_c
    found = index_one.integrate_controlled(run, case.residual, tolerance, speed=speed)
    return CaseSolution(**vars(found), cost=cost, stopped=reasons[-1])


Integrated = tuple[index_one.TimePath, PathStopped | None]
"""Solution, and why it ended before its time."""


def explicit_scheme(case: MassSpring, order: int, tolerance: float, cost: Cost) -> Integrated:
    """The paper's scheme, explicit in time."""
    p, rest = case.parameters, np.zeros(case.size)
    how: dict[str, Any] = {"order": order, "tolerance": tolerance, "speed": FAST_SPEED * p.V_c}
    steps = index_one.integrate_explicitly(
        case.residual, rest, rest, (0.0, p.t_end), cost=cost, **how
    )
    pieces, reason = collect_steps(steps)
    return index_one.join_series(pieces), reason


def implicit_scheme(case: MassSpring, order: int, tolerance: float, cost: Cost) -> Integrated:
    """Backward differences of order 1 and 2, each step a path of its own."""
    p, rest = case.parameters, np.zeros(case.size)
    u, v = index_one.find_consistent_state(case.residual, rest, rest, 0.0, tolerance, 0.0)
    equations = index_one.FunctionRateEquations(case.residual, p.t_end, p.V_c)
    begin = start_memory(0.0, u, v, FIRST_STEP_SHARE * p.t_end)
    settings = Settings(order, Tolerances(tolerance).time_residual, MAX_CASE_STEPS)
    how: dict[str, Any] = {"solver": DenseSolver(), "settings": settings, "cost": cost}
    steps = integrate(equations, begin, p.t_end, stepping=Stepping(p.t_end, tolerance), **how)
    taken, reason = collect_steps(steps)
    return index_one.join_steps(u, v, taken, tolerance, p.V_c), reason


SCHEMES = {"taylor": explicit_scheme, "implicit": implicit_scheme}


def collect_steps(steps: Iterable[Step]) -> tuple[list[Step], PathStopped | None]:
    """All steps, and why there are no more if the path stopped early."""
    found: list[Step] = []
    try:
        for step in steps:
            found.append(step)
    except PathStopped as stopped:
        if not found:
            raise
        return found, stopped
    return found, None


CASE_EVENTS = (*EVENT_KINDS, ("law left", "law regained"))
"""Names of the events, where a function rises through zero and where it falls."""

SLIDING_SAMPLES = 9
"""Instants of a piece at which the sense of sliding is looked at."""


@dataclass(frozen=True)
class CaseEvent:
    """Change of contact, of stick and slip, of the cone; loss of Coulomb's solution."""

    time: float  # s
    kind: str
    ux: float  # m
    uy: float  # m
    value: float
    """Gap (m) of contact and law, slip (m/s) of stick, slip and cone, and of a loss of existence
    the slip that Coulomb's law asks for."""
    message: str = ""  # of a loss of existence

    @classmethod
    def at(cls, time: float, kind: str, u: Array, value: Any) -> CaseEvent:
        """Return an event at a place u, of which the first case has one component."""
        ux, uy = (*map(float, u), 0.0)[:2]
        return cls(float(time), kind, ux, uy, float(value))


def events_of(case: MassSpring, pieces: Iterator[tuple[float, float, Array]]) -> list[CaseEvent]:
    """All events along a path.

    Parameters
    ----------
    case : MassSpring
    pieces : iterable of (start, length, coefficients)
        Polynomials of u in the time since their start, shape (order + 1, n).
    """
    p = case.parameters
    pressed = isinstance(case, PressedPlane)
    level = -1.0 if pressed else touch_gap(p)
    corners = np.array([corner_speed(p.friction), cone_speed(p.friction)]) ** 2

    def indicators(u: Any, v: Any) -> Any:
        """Functions whose roots are events, in the order of ``CASE_EVENTS``."""
        h, slip = case.gap(u), case.slip(u, v)
        return np.stack([h - level, *(slip * slip - s for s in corners), h - p.delta])

    whole, watch, found = list(pieces), Watch(), list[CaseEvent]()
    watched = recorded(indicators)
    for start, length, u in whole:
        t = np.zeros(len(u))
        t[:2] = start, 1.0
        v = np.concatenate([derivative_coefficients(u), np.zeros((1, u.shape[1]))])
        changes = watch.changes(taylor_series(watched, u, v), length)
        for which, a, sense in zip(changes.which, changes.where, changes.sense, strict=True):
            x, speed = value_at(u, a), value_at(v, a)
            if which in (1, 2) and not (pressed or case.gap(x) <= level):
                continue
            value = case.slip(x, speed) if which in (1, 2) else case.gap(x)
            kind = CASE_EVENTS[which][0 if sense > 0 else 1]
            event = CaseEvent.at(start + a, kind, x, value)
            if kind == "stick":
                event = turn_of_sliding(case, event, whole, found[-1].time if found else 0.0)
            found.append(event)
            sliding = float(np.sign(value))
            if kind == "cone left" and (
                (slip := coulomb_slip(case, x, event.time, sliding)) * sliding <= 0.0
            ):
                message = (
                    "Coulomb's problem has no quasi-static solution from here on: friction has "
                    f"reached its cone, and sliding in equilibrium would go {abs(slip):.3g} m/s "
                    "the other way"
                )
                found.append(replace(event, kind="existence lost", value=slip, message=message))
    return found


def turn_of_sliding(
    case: MassSpring, stick: CaseEvent, pieces: list[tuple[float, float, Array]], since: float
) -> CaseEvent:
    """The latest instant, since the last event, at which sliding at the cone turned round."""
    sense = float(np.sign(stick.value))

    def sliding(t: float, u: Array, start: float) -> float:
        return sense * coulomb_slip(case, value_at(u, t - start), t, sense)

    for start, length, u in reversed(pieces):
        first, last = max(start, since), min(start + length, stick.time)
        if not last > first:
            continue
        times = np.linspace(first, last, SLIDING_SAMPLES)
        ahead = [sliding(t, u, start) > 0.0 for t in times]
        if ahead[-1]:
            return stick
        if any(ahead):
            k = SLIDING_SAMPLES - 1 - ahead[::-1].index(True)
            t = float(brentq(sliding, times[k], times[k + 1], args=(u, start), xtol=1e-12))
            x, v = value_at(u, t - start), value_at(derivative_coefficients(u), t - start)
            return CaseEvent.at(t, "stick", x, case.slip(x, v))
    return stick


def touch_gap(p: Parameters) -> float:
    """h with R_N(h) = k h, the positive root of (5c): h² (k + k²/K) + η h = η δ."""
    a = p.k * (1.0 + p.k / p.K)
    return float(2.0 * p.eta * p.delta / (p.eta + np.sqrt(p.eta**2 + 4.0 * a * p.eta * p.delta)))


def coulomb_slip(case: MassSpring, u: Array, t: float, sense: float) -> float:
    """Slip speed (m/s) with which equilibrium is kept while friction stays at its cone.

    R(u, t) = 0 with R_T = −sense f R_N gives u' = −(∂R/∂u)⁻¹ ∂R/∂t, without any rate in the
    law.  The result must have the sign ``sense``, for friction opposes slip.  If it has the
    other, and friction has reached the cone, neither stick nor slip go on: Coulomb's problem
    has no quasi-static solution.
    """
    unit = np.eye(len(u))
    slopes = [taylor_series(lambda x: case.sliding(x, t, -sense), [u, e])[1] for e in unit]
    rate = taylor_series(lambda s: case.sliding(u, s, -sense), [t, 1.0])[1]
    return float(case.slip(u, -np.linalg.solve(np.stack(slopes, axis=1), rate)))


PAPER_STEPS = {"pressed-plane": 34, "moving-plane": 90, "rotating-circle": 90}
"""Steps that the paper reports, at order 19 and tolerance 1e-4."""

CASE_COLUMNS = ("time", "ux", "uy", "vx", "vy", "normal_reaction", "tangential_reaction")

WRITTEN_ROWS = 401
"""Instants written, evenly spaced."""

ANY_SIGN = {"V", "Omega"}

SYMBOL_RANGE = 1e6
"""Factor from the paper's values within which all symbols together leave digits for the rest."""

NOTHING_SET: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True)
class CaseReport:
    """Result of a case; ``str`` is a table."""

    name: str
    scheme: str
    order: int
    tolerance: float  # m
    case: MassSpring
    solution: CaseSolution
    rows: Array  # columns of case.csv, shape (401, 7)
    error: float | None
    """Largest distance of the rows from the reference (m), motion faster than V_c measured along
    the curve in (V_c t, u); None if there is no reference."""
    error_at_equal_times: float | None  # largest difference at the time of a row (m)
    seconds: float
    events: tuple[CaseEvent, ...] = ()
    unstable: tuple[index_one.Instability, ...] = ()  # stretches with no equilibrium to follow
    files: tuple[Path, ...] = ()

    @property
    def steps(self) -> int:
        """Steps of the integration that kept the tolerance."""
        return len(self.solution.path.errors)

    @property
    def tangents(self) -> int:
        """Tangents factorised, in all passes."""
        return self.solution.cost.factorisations

    @property
    def end(self) -> Array:
        """Displacement at the end, shape (2,)."""
        return self.rows[-1, 1:3]

    @property
    def done(self) -> bool:
        """Whether the end of the time span was reached within the tolerance."""
        return self.solution.stopped is None and self.solution.error <= self.tolerance

    @property
    def message(self) -> str:
        """The outcome as a sentence."""
        if self.solution.stopped is not None:
            return f"stopped: {self.solution.stopped}"
        if self.solution.error > self.tolerance:
            return "the tolerance could not be kept"
        return "reached the end"

    def summary(self) -> dict[str, object]:
        """Content of ``case.json``."""
        given = ("name", "scheme", "order", "tolerance", "seconds", "error", "error_at_equal_times")
        return {key: getattr(self, key) for key in given} | {
            "message": self.message,
            "steps": self.steps,
            "tangents": self.tangents,
            "paper_steps": PAPER_STEPS[self.name],
            "passes": self.solution.passes,
            "end": {"time": self.rows[-1, 0], "ux": self.end[0], "uy": self.end[1]},
            "estimated_error": self.solution.error,
            "events": [asdict(event) for event in self.events],
            "unstable": [str(stretch) for stretch in self.unstable],
            "parameters": asdict(self.case.parameters),
        }

    def __str__(self) -> str:
        ux, uy = self.end
        told = [". ".join(filter(None, (e.kind, e.message))) for e in self.events]
        times = [f"t = {e.time:.6f} s" for e in self.events]
        errors = [("error to Radau", "unknown: scipy could not integrate this case")]
        if self.error is not None and self.error_at_equal_times is not None:
            errors = [("error to Radau", f"{self.error:.2g} m")]
            if self.error_at_equal_times > 1.01 * self.error:
                text = f"{self.error_at_equal_times:.2g} m at equal times, where it is fast"
                errors.append(("", text))
        lines = [
            ("case", f"{self.name}: {self.message}"),
            ("scheme", f"{self.scheme}, order {self.order}, tolerance {self.tolerance:g} m"),
            ("steps", f"{self.steps} (paper: {PAPER_STEPS[self.name]})"),
            ("tangents", f"{self.tangents} in {self.solution.passes} pass(es)"),
            ("time taken", f"{self.seconds:.2f} s"),
            ("end", f"t = {self.rows[-1, 0]:g} s, ux = {ux:.6f} m, uy = {uy:.6f} m"),
            *zip(times, told, strict=True),
            *(("unstable", str(stretch)) for stretch in self.unstable),
            ("estimated error", f"{self.solution.error:.2g} m"),
            *errors,
            *(("written", str(file)) for file in self.files),
        ]
        return "\n".join(f"{label:<18}{text}" for label, text in lines)


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
    if mistakes := list(find_mistakes(name, order, tolerance, settings, scheme)):
        raise InputError(mistakes)
    case = CASES[name]()
    p = replace(case.parameters, **{key: float(value) for key, value in settings.items()})
    if p.eta >= p.K * p.delta:
        raise InputError([Mistake("--set", "eta", p.eta, "below K delta (N)", "eta=0.01")])
    case = replace(case, parameters=p)
    begin = time.perf_counter()
    solution = solve_case(case, scheme, order=order, tolerance=tolerance)
    seconds = time.perf_counter() - begin
    rows = table_rows(case, solution, np.linspace(0.0, solution.path.knots[-1], WRITTEN_ROWS))
    events = tuple(events_of(case, solution.path.polynomials()))
    unstable = tuple(index_one.instabilities(case.residual, solution.path))
    error = equal = None
    with suppress(ArithmeticError, ValueError):  # where scipy finds no way through either
        u = rows[:, 1 : 1 + case.size]
        error, equal = distances(reference_solution(case), rows[:, 0], u, p.V_c, 0.1 * tolerance)
    asked = name, scheme, order, tolerance, case
    report = CaseReport(*asked, solution, rows, error, equal, seconds, events, unstable)
    return replace(report, files=write_case(report, Path(directory or f"results/case-{name}")))


def table_rows(case: MassSpring, solution: CaseSolution, times: Array) -> Array:
    """The columns of ``case.csv``, from the dense output."""
    rows = np.zeros((len(times), len(CASE_COLUMNS)))
    rows[:, 0] = times
    for row in rows:
        u, v = solution.path(row[0])
        row[1 : 1 + case.size], row[3 : 3 + case.size] = u, v
        row[5:] = [float(np.squeeze(r)) for r in case.forces(*case.contact(u), v)]
    return rows


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
    states = zip(times, u, equal, strict=True)
    along = [reference.distance(t, x, speed) if e > seen else e for t, x, e in states]
    return float(max(along)), float(equal.max())


def write_case(report: CaseReport, directory: Path) -> tuple[Path, ...]:
    """Write table, summary, events and figures, and return their paths."""
    make_directory(directory)
    table, summary = directory / "case.csv", directory / "case.json"
    rows = (dict(zip(CASE_COLUMNS, row, strict=True)) for row in report.rows.tolist())
    write_table(table, CASE_COLUMNS, rows)
    write_summary(summary, report.summary())
    events = directory / "events.csv"
    write_table(events, [f.name for f in fields(CaseEvent)], map(asdict, report.events))
    times = np.union1d(report.rows[:, 0], report.solution.path.knots)  # a snap falls between rows
    states = table_rows(report.case, report.solution, times)
    return table, summary, events, *draw_figures(report.case, states, directory)


def find_mistakes(
    name: str, order: int, tolerance: float, settings: Mapping[str, float], scheme: str
) -> Iterator[Mistake]:
    """Check what a user gave."""
    if name not in CASES:
        yield Mistake("case", "", name, "a case of the paper", nearest(name, CASES))
    if scheme not in SCHEMES:
        yield Mistake("--scheme", "", scheme, "a scheme", nearest(scheme, SCHEMES))
    if order < 2:
        yield Mistake("--order", "", order, "an order of at least 2", "--order 19")
    if not 0.0 < tolerance < 1.0:
        yield Mistake("--tolerance", "", tolerance, "above 0 and below 1 (m)", "--tolerance 1e-4")
    defaults = asdict(Parameters())
    for key, value in settings.items():
        if key not in defaults:
            hint = nearest(key, defaults)
            yield Mistake("--set", key, value, "a symbol of the paper", hint)
            continue
        usual = defaults[key]
        hint = f"{key}={usual}"
        if not np.isfinite(value):
            yield Mistake("--set", key, value, "a finite number", hint)
        elif value and not 1.0 / SYMBOL_RANGE <= abs(value / usual) <= SYMBOL_RANGE:
            expected = f"a number within a factor of {SYMBOL_RANGE:g} of the paper's {usual:g}"
            yield Mistake("--set", key, value, expected, hint)
        elif key == "q" and not 0.0 < value <= 1.0:
            yield Mistake("--set", key, value, "above 0 and at most 1", hint)
        elif key not in ANY_SIGN and value <= 0.0:
            yield Mistake("--set", key, value, "a number above 0", hint)


EXPONENTS = (0.0, 0.05, 0.1, 0.3, 0.5)
"""Values of q in the first figure."""

WIDTHS = (0.0, 0.02, 0.1, 0.3, 0.5)
"""Values of ω in the second figure."""

INK, ACCENT, QUIET = "#1f4e79", "#c0392b", "#8c8c8c"


def draw_figures(case: MassSpring, rows: Array, directory: Path) -> tuple[Path, ...]:
    """Draw the figures of a case.

    Parameters
    ----------
    case : MassSpring
    rows : ndarray, shape (m, 7)
        time, ux, uy, vx, vy, normal and tangential reaction.
    directory : Path

    Returns
    -------
    tuple of Path
        PNG files.
    """
    figures = {"displacement": displacement(case, rows)}
    if isinstance(case, PressedPlane):
        p = case.parameters
        by_q = {f"q = {q:g}": NortonHoff(1.0, q, p.omega, 1.0) for q in EXPONENTS}
        by_width = {f"ω = {w:g}": NortonHoff(1.0, p.q, w, 1.0) for w in WIDTHS}
        figures["friction-law-q"] = friction_law(by_q, f"ω = {p.omega:g}")
        figures["friction-law-omega"] = friction_law(by_width, f"q = {p.q:g}")
    elif isinstance(case, RotatingCircle):
        figures["trajectory"] = trajectory(case, rows)
        figures["reactions"] = reactions(case, rows)
    paths = tuple(directory / f"{name}.png" for name in figures)
    for path, figure in zip(paths, figures.values(), strict=True):
        save_figure(figure, path)
    return paths


def displacement(case: MassSpring, rows: Array) -> Figure:
    """u_x against time, with Coulomb's law (figures 4 and 6)."""
    figure, axes = axes_of_figure("time (s)", "$u_x$ (m)")
    times = rows[:, 0]
    plot_coulomb(axes, times, coulomb(case).displacement(times)[:, 0])
    axes.plot(times, rows[:, 1], color=INK, label="series")
    axes.legend(frameon=False)
    return figure


def friction_law(laws: dict[str, NortonHoff], title: str) -> Figure:
    """−R_T/(f R_N) against slip (figures 1 and 2)."""
    figure, axes = axes_of_figure("slip velocity / $V_c$", "$-R_T / (f R_N)$")
    slip = np.linspace(-2.0, 2.0, 800)  # even: no sample at rest, where Coulomb's law jumps
    for label, law in laws.items():
        axes.plot(slip, -law(np.ones_like(slip), slip[None])[0], label=label)
    axes.legend(frameon=False, title=title)
    return figure


def trajectory(case: RotatingCircle, rows: Array) -> Figure:
    """Path of the mass around the circle (figure 8)."""
    figure, axes = axes_of_figure("x (m)", "y (m)")
    p = case.parameters
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.fill(p.r * np.sin(angle), p.r * np.cos(angle), color="#e6e6e6", label="circle")
    axes.axvline(0.0, color=QUIET, linewidth=0.6)
    height = p.r + p.delta
    exact = coulomb(case).displacement(rows[:, 0])
    plot_coulomb(axes, exact[:, 0], exact[:, 1] + height)
    axes.plot(rows[:, 1], rows[:, 2] + height, color=INK, label="series")
    axes.set_aspect("equal")
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return figure


def reactions(case: RotatingCircle, rows: Array) -> Figure:
    """Normal and tangential reaction against time (figure 9)."""
    figure, axes = axes_of_figure("time (s)", "reaction (N)")
    times, exact = rows[:, 0], coulomb(case)
    normal, tangential = balanced_reactions(case, times, exact.displacement(times))
    plot_coulomb(axes, times, normal)
    axes.plot(times, tangential, color=ACCENT, linestyle="--")
    axes.plot(times, rows[:, 5], color=INK, label="$R_N$, series")
    axes.plot(times, rows[:, 6], color=QUIET, label="$R_T$, series")
    if np.isfinite(exact.until):
        axes.axvline(exact.until, color=QUIET, linewidth=0.6)
        axes.text(exact.until, axes.get_ylim()[1], " cone left", fontsize=8, va="top")
    axes.legend(frameon=False)
    return figure


def plot_coulomb(axes: Axes, x: Array, y: Array) -> None:
    """Plot what Coulomb's law would give."""
    axes.plot(x, y, color=ACCENT, linestyle="--", label="Coulomb")


def axes_of_figure(x: str, y: str) -> tuple[Figure, Axes]:
    """Return a figure and its only panel, with the titles of its axes."""
    figure, (axes,) = paneled_figure(1, 1, (6.0, 4.0))
    axes.set(xlabel=x, ylabel=y)
    return figure, axes
