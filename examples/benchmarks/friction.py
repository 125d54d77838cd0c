"""Sharp friction: tangents against ω, q and V_c, beside Newton's method in fixed steps.

A mass on a plane that goes to and fro slips, sticks and slips back, so that its slip passes
through zero; a section strip lies on a roller that slows down and turns back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from anmstrip.continuation.follow import Settings
from anmstrip.continuation.path import Cost, PathStopped, Tolerances
from anmstrip.driver.scene import Scene
from anmstrip.linalg.solvers import DenseSolver
from anmstrip.paper.mass_spring import Parameters, slip_at
from anmstrip.timestepping.formulas import start_memory
from anmstrip.timestepping.implicit import Stepping, integrate
from anmstrip.timestepping.index_one import FunctionRateEquations, find_consistent_state, join_steps
from figures import (
    Measured,
    by_line,
    curves,
    exponent,
    fitted,
    measured,
    plotted,
    sheet,
    work_precision,
)
from harness import Cell, Report, Sheet, main
from newton_methods import backward_euler
from runs import Turning, altered, wrapped
from strips import capstan

Array = NDArray[np.float64]

SWEEPS = {
    "omega": tuple(10.0**-k for k in range(2, 9)),
    "exponent": (0.3, 0.1, 0.03, 0.01),
    "speed": tuple(10.0**-k for k in range(8)),
}
"""Keys of [friction]: ω, q, V_c (m/s)."""

FIXED = (1e-1, 1e-2, 1e-3)
"""ω for which fixed steps are tried as well."""

SLIPS = {"stages.wrap.rollers.r1.surface_speed": 1.0, "stages.turn.rollers.r1.surface_speed": -0.01}
"""The roller slips when friction begins, comes to rest, and has just begun to turn back."""

TOLERANCE = {"mass": 1e-3, "strip": 1e-5}

FINEST = 2**13
"""Steps after which fixed steps are given up."""

INSTANTS = 201


def study(quick: bool = False) -> Report:
    """Sweep both problems."""
    every = slice(None, None, 3) if quick else slice(None)
    sweeps = {name: values[every] for name, values in SWEEPS.items()}
    problems: list[Mass | Strip] = [Mass(), Strip(0.2 if quick else 0.1)]
    runs = [run for problem in problems for run in _swept(problem, sweeps)]
    fixed = [run for problem in problems for run in _fixed(problem, FIXED[: 2 if quick else 3])]
    sharp = [run for run in runs if "omega" in run.line] + fixed
    sharpness = plotted(sharp, ("1/ω", lambda r: 1.0 / r.at), ("tangents", lambda r: r.tangents))
    others = [
        plotted(
            [run for run in runs if key in run.line],
            (label, lambda r: 1.0 / r.at),
            ("tangents", lambda r: r.tangents),
        )
        for key, label in (("exponent", "1/q"), ("speed", "1/V_c (s/m)"))
    ]
    return Report(
        name="friction",
        title="Sharp friction: tangents against ω, q and V_c",
        data=sheet("", "value", [*runs, *fixed]),
        sheets=(_fits(runs, fixed), sheet("All runs", "value", [*runs, *fixed], NOTE)),
        figures={
            "friction-sharpness.png": curves(sharpness),
            "friction-others.png": curves(*others),
            "friction-precision.png": work_precision(sharp, "error"),
        },
    )


NOTE = (
    "Errors of the mass are the largest difference at equal times from a scalar reference (m), "
    "those of the strip the change of the tension ratio from a run at a tenth of the tolerance. "
    "Fixed steps are as long as errors of 0.01 m and 0.001 allow. nan: "
    "the path stopped, with the tangents up to there, or its reference did. Tolerances of the "
    f"series: {TOLERANCE['mass']:g} and {TOLERANCE['strip']:g}; at 1e-2 the mass stops from "
    "ω = 1e-7 on, where a step's series end in the corner of the law. What is not "
    "varied: q = 0.05, ω = 0.1 (0.001 for the mass), V_c = 1 m/s."
)


def _swept(problem: Mass | Strip, sweeps: dict[str, tuple[float, ...]]) -> Iterator[Measured]:
    """Yield runs by series, a line for every number that is varied."""
    for name, values in sweeps.items():
        for value in values:
            line = f"{problem.name}, series, {name}"
            yield measured(line, value, partial(problem.series, **{name: value}))


def _fixed(problem: Mass | Strip, widths: Sequence[float]) -> Iterator[Measured]:
    """Yield runs in the longest fixed steps for which Newton's method is exact enough."""
    count = 8
    for omega in widths:
        while count <= FINEST:
            line = f"{problem.name}, Newton, fixed steps"
            run = measured(line, omega, partial(problem.newton, count, omega=omega))
            if run.error <= problem.enough:
                yield run
                break
            count *= 2


def _fits(runs: Sequence[Measured], fixed: Sequence[Measured]) -> Sheet:
    """Return straight lines against the logarithm for the series, a power for fixed steps."""
    rows: list[tuple[Cell, ...]] = []
    for line, own in by_line(runs).items():
        done = [r for r in own if np.isfinite(r.error)]
        line_fit = fitted([-np.log10(r.at) for r in done], [r.tangents for r in done])
        power = exponent([1.0 / r.at for r in done], [r.tangents for r in done])
        rows.append((line, len(done), len(own), line_fit.base, line_fit.slope, line_fit.r2, power))
    for line, own in by_line(fixed).items():
        power = exponent([1.0 / r.at for r in own], [r.tangents for r in own])
        rows.append((line, len(own), len(own), None, None, None, power))
    columns = ("line", "done", "of", "tangents at 1", "per decade", "R²", "power of 1/x")
    note = "Tangents are fitted by a straight line in log10(1/x), and by a power of 1/x."
    return Sheet("How tangents grow as friction gets sharper", columns, tuple(rows), note)


class Mass:
    """A mass on a plane that goes to and fro once: −k u + R_T(u' − V cos 2πt/T) = 0."""

    name, tolerance, enough = "mass", TOLERANCE["mass"], 1e-2

    def __init__(self) -> None:
        self.times = np.linspace(0.0, 4.0, INSTANTS)

    def _problem(
        self, omega: float = 1e-3, exponent: float = 0.05, speed: float = 1.0
    ) -> tuple[Parameters, FunctionRateEquations, Array, Array]:
        """Return the equations of the paper's first case, with the state at the start."""
        p = Parameters(t_end=4.0, omega=omega, q=exponent, V_c=speed)
        rate = 2.0 * np.pi / p.t_end

        def residual(u: Any, v: Any, t: Any) -> Any:
            return p.friction(p.R_N + 0.0 * u[0], v - p.V * np.cos(rate * t)) - u * p.k

        u, v = find_consistent_state(residual, np.zeros(1), np.full(1, p.V), 0.0, 1e-9)
        return p, FunctionRateEquations(residual, p.t_end, p.V), u, v

    def reference(self, p: Parameters, times: Array) -> Array:
        """Return u at the times, from u' = V cos 2πt/T − slip(k u)."""
        rate = 2.0 * np.pi / p.t_end
        found = solve_ivp(
            lambda t, u: p.V * np.cos(rate * t) - slip_at(p.friction, p.k * u / p.R_N),
            (0.0, p.t_end), [0.0], method="Radau", t_eval=times, rtol=1e-9, atol=1e-12,
        )  # fmt: skip
        return found.y[0]

    def series(self, **sharpness: float) -> tuple[float, int]:
        """Return error (m) and tangents."""
        (p, equations, u, v), cost, steps = self._problem(**sharpness), Cost(), []
        try:
            for step in integrate(
                equations,
                start_memory(0.0, u, v, 1e-3 * p.t_end),
                p.t_end,
                solver=DenseSolver(),
                settings=Settings(20, Tolerances(self.tolerance).time_residual, 100_000),
                stepping=Stepping(p.t_end, self.tolerance),
                cost=cost,
            ):
                steps.append(step)
        except PathStopped:
            return np.nan, cost.factorisations
        path = join_steps(u, v, steps, self.tolerance, p.V)
        found = np.array([path(t)[0][0] for t in self.times])
        return float(np.abs(found - self.reference(p, self.times)).max()), cost.factorisations

    def newton(self, count: int, **sharpness: float) -> tuple[float, int]:
        """Return the same of Newton's method in fixed steps."""
        p, equations, u, v = self._problem(**sharpness)
        times = np.linspace(0.0, p.t_end, count + 1)
        found = backward_euler(equations, u, v, times, solver=DenseSolver(), tolerance=1e-4)
        if found is None:
            return np.inf, 0
        states, tangents = found
        return float(np.abs(states[:, 0] - self.reference(p, times)).max()), tangents


class Strip:
    """A section strip held at its entry, on a roller that slips, stops, and begins to turn back."""

    name, tolerance, enough = "strip", TOLERANCE["strip"], 1e-3

    def __init__(self, refined: float) -> None:
        self.base: Scene = altered(capstan("section", 1, refined, self.tolerance), SLIPS)
        self.full = wrapped(self.base)  # friction has no part in it
        self.known: dict[tuple[tuple[str, float], ...], float] = {}

    def turning(self, tolerance: float, **sharpness: float) -> Turning:
        """Return the last stage with other friction."""
        changes = {f"friction.{key}": value for key, value in sharpness.items()}
        return Turning(altered(self.base, {**changes, "solver.tolerance": tolerance}), self.full)

    def reference(self, **sharpness: float) -> float:
        """Return the tension ratio of a strict run, which is made once."""
        key = tuple(sharpness.items())
        if key not in self.known:
            *_, last = self.turning(0.1 * self.tolerance, **sharpness).states()
            self.known[key] = last.rollers["r1"].tension_ratio
        return self.known[key]

    def series(self, **sharpness: float) -> tuple[float, int]:
        """Return the error of the tension ratio, and tangents."""
        turning, error = self.turning(self.tolerance, **sharpness), np.nan
        with suppress(PathStopped):
            *_, last = turning.states()
            error = abs(last.rollers["r1"].tension_ratio / self.reference(**sharpness) - 1.0)
        return error, turning.march.cost.factorisations

    def newton(self, count: int, **sharpness: float) -> tuple[float, int]:
        """Return the same of Newton's method in fixed steps."""
        turning = self.turning(self.tolerance, **sharpness)
        plan, u = turning.plan, self.full[turning.plan.supports.free]
        times, solver = (
            plan.start + np.linspace(0.0, plan.duration, count + 1),
            turning.march.solver,
        )
        found = backward_euler(turning.motion, u, 0.0 * u, times, solver=solver, tolerance=1e-5)
        if found is None:
            return np.inf, 0
        states, tangents = found
        velocity = (states[-1] - states[-2]) * count / plan.duration
        ratio = turning.ending(states[-1], velocity).rollers["r1"].tension_ratio
        return abs(ratio / self.reference(**sharpness) - 1.0), tangents


if __name__ == "__main__":
    main(study)
