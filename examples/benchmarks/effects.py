"""What every effect costs, and what the cheaper levels of kinematics save.

One strip gets its effects one at a time; an expansion of order 20 is timed at the state in
which a run of each scene ends.  What a scene does not have must take no time, no points and
no import.  Then a section and a plate are compared with the shell that they stand for.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import islice
from statistics import median
from typing import Any

from anmstrip.continuation.expansion import Cost, Parameter, expand
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium, Motion
from anmstrip.timestepping.formulas import AffineVelocity
from comparisons import plate_against_shell, section_against_shell
from figures import stacked
from harness import Cell, Report, Sheet, main
from imports import import_sheet
from strips import growing

ORDER = 20

LEVELS = ("section", "plate", "shell")

COLUMNS = ("level", "added", "effect", "unknowns", "points", "seconds")

SHARE_OF_STEP = 1e-2
"""Time step of the expansions with friction, over the duration of their stage."""


@dataclass(frozen=True)
class Timing:
    """An expansion of one scene.

    Attributes
    ----------
    level, added : str
        Of the kinematics; the effect that was added last.
    unknowns : int
    points : dict
        Effect → points at which its law was looked at, 0 for constant matrices and vectors.
    effects : dict
        Effect → seconds.
    phases : dict
        What the solver does → seconds.
    seconds : float
        Of the whole expansion.
    order : int
        Reached.
    """

    level: str
    added: str
    unknowns: int
    points: dict[str, int]
    effects: dict[str, float]
    phases: dict[str, float]
    seconds: float
    order: int


def study(quick: bool = False) -> Report:
    """Time all rows and both comparisons."""
    cells, repeats, steps = ((30, 2), 3, 5) if quick else ((120, 4), 9, 10_000)
    timings = [
        timed(level, added, scene, repeats, steps)
        for level in LEVELS
        for added, scene in growing(level, cells)
    ]
    sheets = (
        _effect_sheet(timings),
        _whole_sheet(timings),
        import_sheet(),
        section_against_shell(quick),
        plate_against_shell(quick),
    )
    bars = {level: [(t.added, t.effects) for t in timings if t.level == level] for level in LEVELS}
    return Report(
        name="effects",
        title="Cost of every effect, and of every level of kinematics",
        data=_long_sheet(timings),
        sheets=sheets,
        figures={"effects.png": stacked(bars, "milliseconds per expansion")},
    )


# one scene -----------------------------------------------------------------------


def timed(level: str, added: str, scene: Scene, repeats: int, steps: int) -> Timing:
    """Time the expansion where a run has got to; medians over repeats.

    The run goes to the end of its scene, or as many steps into the last stage.
    """
    run = Run(scene)
    last = (step for step in run if step.stage == scene.course[-1].name)
    taken = len(list(islice(last, steps)))
    assert taken == steps or run.outcome.done, run.message
    equations, u, control = equations_at_end(run)
    model, samples = equations.model, []
    for _ in range(repeats + 1):  # the first finds the pattern of the matrix
        model.seconds.update(dict.fromkeys(model.seconds, 0.0))
        cost, begin = Cost(), time.perf_counter()
        branch = expand(
            equations,
            u,
            control,
            order=ORDER,
            solver=run.march.solver,
            parameter=Parameter(1.0),
            cost=cost,
        )
        samples.append((time.perf_counter() - begin, dict(model.seconds), cost.seconds))
    whole, effects, phases = zip(*samples[1:], strict=True)
    return Timing(
        level=level,
        added=added,
        unknowns=model.strip.unknowns,
        points=_points(equations, u, control),
        effects=_medians(effects),
        phases=_medians(phases),
        seconds=median(whole),
        order=branch.order,
    )


def equations_at_end(run: Run) -> tuple[Equilibrium, Any, float]:
    """Equations of the stage that a run has got to, with its state and control."""
    assert run.state is not None
    plan, full, control = run.state.plan, run.state.full, run.state.control
    free = plan.supports.free
    if not plan.in_time:
        return Equilibrium(plan.model, plan.supports, plan.controls), full[free], control
    h, v = SHARE_OF_STEP * plan.duration, run.march.velocity[free]
    motion = Motion(plan.model, plan.supports, plan.controls, plan.start, plan.duration)
    velocity = AffineVelocity(1.0 / h, v, 0.0 * v)
    return motion.during(run.state.time, h, velocity, full[free]), 0.0 * v, 0.0


def _points(equations: Equilibrium, u: Any, control: float) -> dict[str, int]:
    full, controls = equations.supports.full(u, control), equations.controls.at(control)
    return {
        effect.name: effect.near(full, controls).operator.points if hasattr(effect, "near") else 0
        for effect in equations.model.effects
    }


def _medians(samples: tuple[dict[str, float], ...]) -> dict[str, float]:
    return {name: median(sample[name] for sample in samples) for name in samples[0]}


# sheets --------------------------------------------------------------------------


def _long_sheet(timings: list[Timing]) -> Sheet:
    """A row for every effect of every scene."""
    rows = tuple(
        (t.level, t.added, effect, t.unknowns, t.points[effect], seconds)
        for t in timings
        for effect, seconds in t.effects.items()
    )
    return Sheet("Seconds of every effect", COLUMNS, rows)


def _effect_sheet(timings: list[Timing]) -> Sheet:
    """A row for every scene, a column for every effect."""
    names = list(dict.fromkeys(name for t in timings for name in t.effects))
    rows: list[tuple[Cell, ...]] = []
    for t in timings:
        times = [1e3 * t.effects[name] if name in t.effects else None for name in names]
        rows.append((t.level, f"+ {t.added}", *times))
    note = (
        f"Medians of expansions of order {ORDER} where each scene ends; an effect that is off "
        "has no entry, for it is not there."
    )
    columns = ("level", "added", *names)
    return Sheet("Milliseconds of every effect in an expansion", columns, tuple(rows), note)


def _whole_sheet(timings: list[Timing]) -> Sheet:
    phases = ("series", "tangent", "factorisation", "back-substitution")
    rows: list[tuple[Cell, ...]] = []
    for t in timings:
        counts = (t.unknowns, sum(t.points.values()), t.order)
        seconds = [t.phases.get(phase, 0.0) for phase in phases]
        rows.append((t.level, f"+ {t.added}", *counts, *(1e3 * s for s in [*seconds, t.seconds])))
    note = "Points are those near enough to be looked at; constant matrices and loads have none."
    columns = ("level", "added", "unknowns", "points", "order", *phases, "whole")
    return Sheet(
        "Milliseconds of an expansion, effects added one at a time", columns, tuple(rows), note
    )


if __name__ == "__main__":
    main(study)
