"""Hard cases over ranges of what makes them hard: nothing may fail, and cost at most creep up.

Every row of the table is a sweep of one quantity in one case: its range, the worst error beside
the answer in closed form, steps and tangents from one end of the range to the other, and how it
ended.  A sweep fails where one run does not get to its end, or where steps or tangents grow faster
than with the logarithm of the quantity.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.continuation.path import PathStopped
from anmstrip.mechanics.laws import NortonHoff, Tanh

sys.path.append(str(Path(__file__).resolve().parents[1]))
sys.path.append(str(Path(__file__).resolve().parents[2] / "examples" / "benchmarks"))

import hard_nodes as nodes
import hard_strips as strips
from harness import Cell, Report, Sheet, main
from motions import Trial

COLUMNS = (
    "case", "what", "level", "quantity", "from", "to", "worst error", "allowed", "steps",
    "tangents", "tangents per decade", "outcome",
)  # fmt: skip

LONG = ("case", "level", "quantity", "value", "found", "exact", "error", "steps", "tangents")

PER_DECADE = 1.0
"""Steps, and tangents, that a decade of any quantity may add for each step of the cheapest run:
a corner that is a decade sharper may ask every step for one branch more."""


@dataclass(frozen=True)
class Sweep:
    """A case over a range of one quantity."""

    case: str  # number in the list of hard cases, with a D
    what: str
    level: str
    quantity: str
    run: Callable[[Any], Any]  # value → trial, or a tuple that begins with one
    values: Sequence[float]
    allowed: float  # largest error
    quick: bool = True  # whether it belongs to the quick study

    def trials(self, quick: bool) -> list[tuple[float, Trial]]:
        """All runs; of a quick study the ends of the range."""
        values = [self.values[0], self.values[-1]] if quick else self.values
        return [(value, self._trial(value)) for value in dict.fromkeys(values)]

    def _trial(self, value: float) -> Trial:
        try:
            found = self.run(value)
        except PathStopped as stopped:
            return Trial(np.nan, np.nan, np.inf, 0, 0, str(stopped))
        return found[0] if isinstance(found, tuple) else found


DECADES = tuple(10.0**-k for k in (2, 4, 6, 8, 10))
EXPONENTS = (0.3, 0.1, 0.03, 0.01)
SPEEDS = (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
STIFFNESSES = (1e3, 1e6, 1e9, 1e12)
THICKNESSES = (1e-2, 1e-3, 1e-4, 1e-5)

SWEEPS = (
    Sweep("D1", "no normal force", "node", "ω", nodes.zero_normal_force, DECADES, 1e-6),
    Sweep("D1", "tangent", "section", "V_c", strips.tangent, (1.0, 1e-3, 1e-6), 1e-6),
    Sweep("D2", "penetration", "node", "K", nodes.penetration, STIFFNESSES, 1e-10),
    Sweep("D2", "smooth roller", "section", "K",
          lambda K: strips.smooth_roller(K, 1e-5 if K < 1e7 else 1e-3),
          (1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e10, 1e12), 3e-4),
    Sweep("D3", "sharp corner", "node", "ω", nodes.sharp_corner, DECADES, 1e-5),
    Sweep("D3", "sharp corner", "node", "q",
          lambda q: nodes.sharp_corner(1e-4, q), EXPONENTS, 1e-5),
    Sweep("D3", "sharp corner", "node", "V_c",
          lambda v: nodes.sharp_corner(1e-2, 0.1, v), SPEEDS, 1e-5),
    Sweep("D3", "capstan", "section", "ω",
          lambda w: strips.capstan(omega=w), DECADES, 5e-5, quick=False),
    Sweep("D3", "capstan", "section", "q",
          lambda q: strips.capstan(q=q), EXPONENTS, 5e-5, quick=False),
    Sweep("D12", "capstan", "section", "V_c",
          lambda v: strips.capstan(speed=v), SPEEDS, 5e-5, quick=False),
    Sweep("D4", "hold", "node", "q", nodes.held, EXPONENTS, 1e-9),
    Sweep("D4", "hold", "section", "s", strips.hold, (1e2, 1e3, 1e5), 2e-3, quick=False),
    Sweep("D5", "reversal", "node", "q", nodes.reversal, (0.1, 0.03, 0.01), 1e-5,
          quick=False),
    Sweep("D6", "beyond the cone", "node", "tan α/f",
          lambda r: nodes.beyond_the_cone(0.1, r), (1.2, 2.0), 1e-6),
    Sweep("D7", "coupled node", "node", "f",
          lambda f: nodes.coupled(NortonHoff(f, 0.1, 1e-3, 0.1)), (1.3, 1.5, 1.8), 1e-6),
    Sweep("D7", "coupled node, gliding off", "node", "q",
          lambda q: nodes.coupled(NortonHoff(1.5, q, 1e-3, 0.1)), (0.3, 0.2), 1e-6),
    Sweep("D7", "coupled node, snapping", "node", "q",
          lambda q: nodes.coupled(NortonHoff(1.5, q, 1e-3, 0.1)),
          (0.1, 0.07, 0.05, 0.03, 0.02, 0.01), 1e-6),
    Sweep("D7", "coupled node, gliding off", "node", "V_c",
          lambda v: nodes.coupled(NortonHoff(1.5, 0.1, 1e-3, v)), (10.0, 1.0), 1e-6),
    Sweep("D7", "coupled node, snapping", "node", "V_c",
          lambda v: nodes.coupled(NortonHoff(1.5, 0.1, 1e-3, v)), SPEEDS[1:5], 1e-6, quick=False),
    Sweep("D7", "coupled node, creeping", "node", "V_c",
          lambda v: nodes.coupled(NortonHoff(1.5, 0.1, 1e-3, v)), SPEEDS[5:7], 1e-3),
    Sweep("D7", "coupled node", "node", "ω",
          lambda w: nodes.coupled(NortonHoff(1.5, 0.1, w, 0.1)), DECADES, 1e-6, quick=False),
    Sweep("D7", "coupled node, tanh, gliding off", "node", "V_c",
          lambda v: nodes.coupled(Tanh(1.5, 1e-3, v)), SPEEDS[:3], 1e-5),
    Sweep("D7", "coupled node, tanh, snapping", "node", "V_c",
          lambda v: nodes.coupled(Tanh(1.5, 1e-3, v)), SPEEDS[3:], 1e-5),
    Sweep("D8", "near critical", "node", "1 − f/f_c",
          nodes.near_critical, (0.5, 1e-1, 1e-2, 1e-4, 1e-6), 1e-6),
    Sweep("D9", "grazing", "node", "K", lambda K: nodes.grazing(0.1, K), STIFFNESSES, 1e-10),
    Sweep("D9", "grazing", "section", "depth/δ", strips.graze, (0.1, -0.1), 1e-10),
    Sweep("D10", "many turns", "node", "f θ",
          lambda r: nodes.many_turns(r, 80), (2.0, 9.0, 18.4), 2e-4, quick=False),
    Sweep("D11", "tension lowered", "section", "N/m",
          lambda t: strips.lowered(last=t), (1.0, -0.1), 1.0, quick=False),
    Sweep("D12", "driven roller", "section", "V_c",
          strips.driven, (1e-2, 1e-4, 1e-6), 1e-2, quick=False),
    Sweep("D13", "ironing", "section", "element", strips.ironed, (0.1, 0.05), 2e-3, quick=False),
    Sweep("D14", "uneven links", "node", "ratio",
          lambda r: nodes.many_turns(2.0, 20, r), (1.0, 1e3, 1e6), 1e-7, quick=False),
    Sweep("D16", "other units", "section", "unit per m",
          strips.in_units, (1.0, 1e3), 1e-9, quick=False),
    Sweep("D17", "thin, capstan", "section", "thickness",
          lambda t: strips.capstan(thickness=t, refined=0.025), THICKNESSES, 1e-3, quick=False),
    Sweep("D17", "thin, smooth roller", "section", "thickness",
          lambda t: strips.smooth_roller(thickness=t), THICKNESSES, 5e-3, quick=False),
    Sweep("D17", "fine", "section", "elements",
          lambda n: strips.slender(int(n)), (1, 100, 10_000), 1e-6),
    Sweep("D18", "beyond existence", "node", "tolerance",
          nodes.leaves_the_cone, (1e-3, 1e-4), 1e-2),
)  # fmt: skip
"""All but one of the eighteen; rejected steps and restarts (D15) are tests of their own."""


def study(quick: bool = False) -> Report:
    """Do all sweeps over the ranges of the hard cases."""
    chosen = [sweep for sweep in SWEEPS if sweep.quick or not quick]
    found = [(sweep, sweep.trials(quick)) for sweep in chosen]
    rows = tuple(_row(sweep, trials) for sweep, trials in found)
    failed = sum(row[-1] != "done" for row in rows)
    note = (
        f"{len(rows) - failed} of {len(rows)} sweeps without a failure. Errors are relative to the "
        "answer, or to the size named with the case in the source."
    )
    return Report(
        name="stability",
        title="Hard cases: ranges, errors, work",
        data=_long(found),
        sheets=(Sheet("Hard cases", COLUMNS, rows, note),),
    )


def _row(sweep: Sweep, trials: list[tuple[float, Trial]]) -> tuple[Cell, ...]:
    first, last = trials[0], trials[-1]
    worst = max(t.error if np.isfinite(t.error) else np.inf for _, t in trials)
    return (
        sweep.case, sweep.what, sweep.level, sweep.quantity, float(first[0]), float(last[0]),
        float(worst), sweep.allowed, f"{first[1].steps} → {last[1].steps}",
        f"{first[1].tangents} → {last[1].tangents}", growth(trials), outcome(sweep, trials),
    )  # fmt: skip


def growth(trials: list[tuple[float, Trial]], of: str = "tangents") -> float | None:
    """Return what a decade adds, between the cheapest and the dearest run, if they span one."""
    counts = [getattr(trial, of) for _, trial in trials]
    values = [value for value, _ in trials if value > 0.0]
    decades = float(np.log10(max(values) / min(values))) if values else 0.0
    return (max(counts) - min(counts)) / decades if decades >= 1.0 else None


def outcome(sweep: Sweep, trials: list[tuple[float, Trial]]) -> str:
    """Return ``done``, or what is wrong first."""
    for value, trial in trials:
        if trial.outcome != "done":
            return f"{sweep.quantity} = {value:g}: {trial.outcome}"
        if not trial.error <= sweep.allowed:
            return f"{sweep.quantity} = {value:g}: error {trial.error:.2g}"
    least = min(trial.steps for _, trial in trials)
    for of in ("steps", "tangents"):
        more = growth(trials, of)
        if more is not None and more > PER_DECADE * least:
            return f"{more:.0f} {of} more per decade"
    return "done"


def _long(found: list[tuple[Sweep, list[tuple[float, Trial]]]]) -> Sheet:
    rows = tuple(
        (s.case, s.level, s.quantity, float(v), t.found, t.exact, t.error, t.steps, t.tangents)
        for s, trials in found
        for v, t in trials
    )
    return Sheet("Runs", LONG, rows)


if __name__ == "__main__":
    main(study)
