"""What every effect costs, and what the cheaper levels of kinematics save.

One strip gets its effects one at a time; an expansion of order 20 is timed at the state in
which a run of each scene ends.  What a scene does not have must take no time, no points and
no import.  Then a section and a plate are compared with the shell that they stand for.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from statistics import median
from typing import Any

import numpy as np

from anmstrip.continuation.expansion import Parameter, expand
from anmstrip.continuation.path import Cost
from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.equilibrium import Equilibrium, Motion
from anmstrip.mechanics.effects import LawEffect
from anmstrip.timestepping.formulas import AffineVelocity
from figures import stacked
from harness import Cell, Report, Sheet, main
from imports import import_sheet
from runs import altered, finished
from strips import capstan, growing, lightly_wrapped, threaded

ORDER = 20

LEVELS = ("section", "plate", "shell")

SHARE_OF_STEP = 1e-2
"""Time step of the expansions with friction, over the duration of their stage."""


@dataclass(frozen=True)
class Timing:
    """An expansion of one scene, to which the effect ``added`` was added last."""

    level: str
    added: str
    unknowns: int
    points: dict[str, int]  # effect → points of its law, 0 for constant matrices and vectors
    effects: dict[str, float]  # effect → s
    phases: dict[str, float]  # of the solver → s
    seconds: float
    order: int  # reached


def study(quick: bool = False) -> Report:
    """Time all rows and both comparisons."""
    cells, repeats, steps = ((30, 2), 3, 5) if quick else ((120, 4), 9, 10_000)
    timings = [
        timed(level, added, scene, repeats, steps)
        for level in LEVELS
        for added, scene in growing(level, cells)
    ]
    rows = tuple(
        (t.level, t.added, effect, t.unknowns, t.points[effect], seconds)
        for t in timings
        for effect, seconds in t.effects.items()
    )
    columns = ("level", "added", "effect", "unknowns", "points", "seconds")
    comparisons = (
        section_against_shell(quick),
        plate_against_shell(quick),
        yielding_against_elastic(quick),
    )
    bars = {level: [(t.added, t.effects) for t in timings if t.level == level] for level in LEVELS}
    return Report(
        name="effects",
        title="Cost of every effect, and of every level of kinematics",
        data=Sheet("Seconds of every effect", columns, rows),
        sheets=(_effect_sheet(timings), _whole_sheet(timings), import_sheet(), *comparisons),
        figures={"effects.png": stacked(bars, "milliseconds per expansion")},
    )


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
        choices = {"solver": run.march.solver, "parameter": Parameter(1.0), "cost": cost}
        branch = expand(equations, u, control, order=ORDER, **choices)
        samples.append((time.perf_counter() - begin, dict(model.seconds), cost.seconds))
    whole, *parts = zip(*samples[1:], strict=True)
    effects, phases = ({name: median(s[name] for s in part) for name in part[0]} for part in parts)
    full, controls = equations.supports.full(u, control), equations.controls.at(control)
    points = {
        e.name: e.near(full, controls).operator.points if isinstance(e, LawEffect) else 0
        for e in model.effects
    }
    counts = (model.strip.unknowns, points)
    return Timing(level, added, *counts, effects, phases, median(whole), branch.order)


def equations_at_end(run: Run) -> tuple[Equilibrium, Any, float]:
    """Return the equations of the stage that a run has got to, with its state and control."""
    assert run.state is not None
    plan, full, control = run.state.plan, run.state.full, run.state.control
    free = plan.supports.free
    if not plan.in_time:
        return Equilibrium(plan.model, plan.supports, plan.controls), full[free], control
    h, v = SHARE_OF_STEP * plan.duration, run.march.velocity[free]
    motion = Motion(plan.model, plan.supports, plan.controls, plan.start, plan.duration)
    velocity = AffineVelocity(1.0 / h, v, 0.0 * v)
    return motion.during(run.state.time, h, velocity, full[free]), 0.0 * v, 0.0


def _effect_sheet(timings: list[Timing]) -> Sheet:
    """Return a row for every scene, a column for every effect."""
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
        seconds = [t.phases.get(phase, 0.0) for phase in phases]
        counts = (t.unknowns, sum(t.points.values()), t.order)
        rows.append((t.level, f"+ {t.added}", *counts, *(1e3 * s for s in [*seconds, t.seconds])))
    note = "Points are those near enough to be looked at; constant matrices and loads have none."
    columns = ("level", "added", "unknowns", "points", "order", *phases, "whole")
    title = "Milliseconds of an expansion, effects added one at a time"
    return Sheet(title, columns, tuple(rows), note)


# levels of kinematics --------------------------------------------------------------

LEVEL_COLUMNS = ("level", "unknowns", "expansions", "seconds", "ms per expansion")

DEGREES = 1.0
"""Wrap of the strip that a plate is tried on."""


def _run_with_costs(scene: Scene) -> tuple[Run, tuple[float, ...]]:
    """Run a scene; return the run and what stands in the columns after the level."""
    begin = time.perf_counter()
    run = finished(scene)
    seconds, expansions = time.perf_counter() - begin, run.cost.expansions
    milliseconds = 1e3 * sum(run.cost.seconds.values()) / expansions
    return run, (run.assembly.strip.unknowns, expansions, seconds, milliseconds)


def section_against_shell(quick: bool) -> Sheet:
    """Compare, on a capstan in time with friction, a line of elements and ten of them across."""
    refined, tolerance = (0.2, 1e-3) if quick else (0.025, 1e-4)
    costs, ratios = {}, {}
    for level in ("section", "shell"):
        run, costs[level] = _run_with_costs(capstan(level, 10, refined, tolerance))
        ratios[level] = run.state.rollers["r1"].tension_ratio or np.nan
    rows = [(level, *costs[level], ratios[level]) for level in costs]
    quotients = (a / b for a, b in zip(costs["shell"], costs["section"], strict=True))
    difference = ratios["section"] / ratios["shell"] - 1.0
    return Sheet(
        "Section against a shell of 10 elements across: capstan, 0.6 s of turning",
        (*LEVEL_COLUMNS, "tension ratio"),
        (*rows, ("shell / section", *quotients, ratios["shell"] / ratios["section"])),
        f"Elements of {refined:g} m over the roller, tolerance {tolerance:g}. The section's ratio "
        f"of tensions is off by {100.0 * difference:+.3g} %.",
    )


def plate_against_shell(quick: bool) -> Sheet:
    """Compare plate and shell where a roller lifts the strip to a small wrap, without friction."""
    cells, refined = ((16, 2), 0.1) if quick else ((16, 4), 0.01)
    costs, results = {}, {}
    for level in ("plate", "shell"):
        run, costs[level] = _run_with_costs(lightly_wrapped(level, DEGREES, cells, refined))
        strip = run.assembly.strip
        lift = float(run.march.full.reshape(-1, strip.count)[strip.node_values, -1].max())
        results[level] = (run.state.rollers["r1"].normal_force, lift)
    rows = [(level, *costs[level], *results[level]) for level in costs]
    quotients = (a / b for a, b in zip(costs["shell"], costs["plate"], strict=True))
    force, lift = (a / b for a, b in zip(results["shell"], results["plate"], strict=True))
    return Sheet(
        f"Plate against shell: {DEGREES:g}° of wrap, no friction",
        (*LEVEL_COLUMNS, "normal force (N)", "lift (m)"),
        (*rows, ("shell / plate", *quotients, force, lift)),
        f"Elements of {refined:g} m over the roller. The plate's normal force is off by "
        f"{100.0 / force - 100.0:+.2g} %, its lift by {100.0 / lift - 100.0:+.2g} %.",
    )


LAYERS = {
    "section": (11, 21),
    "steady section": (11, 21),
    "shell": (5, 11),
    "steady shell": (5, 11),
}
"""Numbers of layers that yielding strip is tried with."""

YIELD_STRESS = 1.0e8
"""Half of what bending over the roller makes of an elastic strip's faces (Pa)."""


def yielding_against_elastic(quick: bool) -> Sheet:
    """Compare expansions of a strip that yields on its roller with those of elastic strip.

    Both bend as Kirchhoff and Love have it.  They alternate, at the states where their runs end.
    """
    refined, across, repeats = (0.4, 2, 3) if quick else (0.1, 10, 9)
    rows: list[tuple[Cell, ...]] = []
    for level, numbers in LAYERS.items():
        changes = {"strip.bending": '"kirchhoff-love"'}
        if "steady" in level:
            changes |= {"stages.turn.steady": "true", "stages.turn.strip.speed": "1.0"}
        width = 2 if level == "steady shell" else across
        elastic = altered(threaded(level.split()[-1], width, refined, 1e-3), changes)
        yields = [altered(elastic, _yielding(number)) for number in numbers]
        expansions = [expansion_at_end(scene) for scene in (elastic, *yields)]
        spent = np.array([[each() for each in expansions] for _ in range(repeats + 1)])[1:]
        times = 1e3 * np.median(spent, axis=0), np.median(spent / spent[:, :1], axis=0)
        names = "elastic", *(f"{number} layers" for number in numbers)
        for name, milliseconds, ratio in zip(names, *times, strict=True):
            rows.append((level, name, float(milliseconds), float(ratio)))
    return Sheet(
        "Milliseconds of an expansion of strip that yields on its roller, order 15",
        ("strip", "material", "ms of a processor", "over elastic"),
        tuple(rows),
        f"Elements of {refined:g} m over the roller, {across} across of the shell in time, 2 of "
        "that in its stationary state.",
    )


def expansion_at_end(scene: Scene) -> Callable[[], float]:
    """Return an expansion of order 15 where a run ends, which tells its seconds of a processor."""
    run = finished(scene)
    equations, u, control = equations_at_end(run)

    def spent() -> float:
        begin = time.process_time()
        expand(equations, u, control, order=15, solver=run.march.solver, parameter=Parameter(1.0))
        return time.process_time() - begin

    return spent


def _yielding(layers: int) -> dict[str, str]:
    """Return what makes a strip yield."""
    flow = {"exponent": 21, "layers": layers}
    table = ", ".join(f"{key} = {value}" for key, value in flow.items())
    return {"material.yield_stress": f"{YIELD_STRESS:g}", "material.plasticity": f"{{ {table} }}"}


if __name__ == "__main__":
    main(study)
