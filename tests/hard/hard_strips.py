"""Hard cases of a strip on a roller: a section, or a small shell, each with its answer."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

from anmstrip.driver.run import Run, Step
from anmstrip.driver.scene import Scene
from anmstrip.mechanics.shell import uniaxial_stretches
from anmstrip.results.state import State
from anmstrip.simulation.problem import FAINT_PRESSURE
from motions import Trial
from strips import CONTACT, MATERIAL, RADIUS, TENSION

Array = NDArray[np.float64]


def arc_ratio(f: float, angle: float, stiff: float) -> float:
    """Return the ratio of tensions in full slip around an arc, with bending, D/(T2 R²) = ``stiff``.

    Beyond the arc elasticas turn by α = 2 asin(√(D/T)/2R), to its curvature, and lean on its ends
    with T sin α; so that T1 (cos α1 − f sin α1) = T2 (cos α2 + f sin α2) e^(f (θ − α1 − α2)).
    """

    def excess(ratio: float) -> float:
        first, second = lift_off(np.array([stiff / ratio, stiff]))
        low = (np.cos(second) + f * np.sin(second)) * np.exp(f * (angle - first - second))
        return float(ratio * (np.cos(first) - f * np.sin(first)) - low)

    return brentq(excess, 0.5, 2.0 * np.exp(f * angle), xtol=1e-14)


def lift_off(stiff: Array) -> Array:
    """Return angles α = 2 asin(√(D/T)/2R) of an elastica up to an arc's curvature, by D/(T R²)."""
    return np.asarray(2.0 * np.arcsin(0.5 * np.sqrt(stiff)))


def line_tension(bending: float, angle: float) -> float:
    """Return the tension (N/m) below which the arc of contact is a line, D/(4R² sin²(θ/4))."""
    return float(bending / (4.0 * RADIUS**2 * np.sin(0.25 * angle) ** 2))


def line_ratio(f: float, angle: float) -> float:
    """Return the ratio of tensions where a strip turns by an angle about one line and slips there.

    Elasticas with the tensions T1, T2 turn by α1, α2 up to the line, with equal moments
    2 √(D T) sin(α/2); the reaction leans by f: T1 cos α1 − T2 cos α2 = f (T1 sin α1 + T2 sin α2).
    """

    def leaning(first: float) -> tuple[float, float]:
        second = angle - first
        ratio = (np.sin(0.5 * second) / np.sin(0.5 * first)) ** 2
        pulled = ratio * (np.cos(first) - f * np.sin(first))
        return float(ratio), float(pulled - np.cos(second) - f * np.sin(second))

    return leaning(brentq(lambda a: leaning(a)[1], 0.1 * angle, 0.5 * angle, xtol=1e-14))[0]


Tables = dict[str, Any]

PULL = {"name": "pull", "duration": 1.0, "friction": False, "exit": {"force": [TENSION, 0.0, 0.0]}}
LAY = {
    "name": "lay",
    "duration": 1.0,
    "friction": False,
    "entry": {"move": [0.0, 0.0, -0.45]},
    "exit": {"force": [TENSION, 0.0, -5773.5]},
}


def tables_of(*stages: Tables, level: str = "section", refined: float = 0.05) -> Tables:
    """Return four metres of steel under 10 kN/m, above a roller of half a metre.

    Parameters
    ----------
    stages : dict
    level : str
        Of the kinematics; a shell has two elements across.
    refined : float
        Element over the roller (m).
    """
    return {
        "strip": {
            "length": 4.0,
            "width": 1.0,
            "thickness": 1e-3,
            "cells": [16, 2],
            "refined": refined,
            "kinematics": level,
        },
        "material": dict(MATERIAL),
        "contact": dict(CONTACT),
        "friction": {
            "law": "norton-hoff",
            "coefficient": 0.3,
            "exponent": 0.05,
            "omega": 0.1,
            "speed": 1.0,
        },
        "rollers": [{"name": "r1", "radius": RADIUS, "centre": [0.0, 0.0, -RADIUS - 1e-3]}],
        "edges": {"entry": {"fixed": ["x", "z"], "centred": level == "shell"}},
        "stages": [deepcopy(stage) for stage in stages],
        "solver": {"tolerance": 1e-4, "max_tangents": 5000},
    }


def turning(speed: float = 1.0, duration: float = 0.6, **more: Any) -> Tables:
    """A stage in which the roller turns."""
    return {
        "name": "turn",
        "duration": duration,
        "rollers": {"r1": {"surface_speed": speed}},
        **more,
    }


def ran(tables: Tables) -> tuple[Run, list[Step]]:
    """All steps of a scene."""
    run = Run(Scene.model_validate(tables))
    return run, list(run)


def trial(run: Run, found: float, exact: float, unit: float | None = None) -> Trial:
    """A run beside its answer."""
    error = abs(found - exact) / abs(exact if unit is None else unit)
    outcome = "done" if run.outcome.done else run.message
    return Trial(float(found), float(exact), float(error), run.steps, run.cost.expansions, outcome)


def end_of(run: Run) -> State:
    """Return the last state of a run."""
    assert run.state is not None
    return run.state


# cases ---------------------------------------------------------------------------


def tangent(speed: float = 1.0, gap: float = 1e-3) -> Trial:
    """D1: a straight strip beside a turning roller, which rubs with the faint pressure there.

    At a distance the drag is exactly 0; else an error is what is outside of 0 to f_eff R_N, of
    which a part has no friction, see :data:`anmstrip.simulation.problem.FAINT_PRESSURE`.
    """
    tables = tables_of(PULL, turning(duration=0.1))
    tables["friction"]["speed"] = speed
    tables["rollers"][0]["centre"] = [0.0, 0.0, -RADIUS - gap]
    run, _ = ran(tables)
    reading = end_of(run).rollers["r1"]
    assert run.assembly.friction is not None
    most = run.assembly.friction.effective(1.0) * reading.normal_force
    least = 1e-3 * most if gap <= 1e-3 else 0.0
    nearest = float(np.clip(reading.drag, least, most if least else 0.0))
    return trial(run, reading.drag, nearest, most)


def smooth_roller(stiffness: float = 1e10, thickness: float = 1e-3) -> Trial:
    """D2, D17: without friction both tensions are the same, however stiff or thin.

    The tension goes with the thickness, and with K where it would sink in by more than 2 mm.
    """
    tables = tables_of(PULL, LAY)
    del tables["friction"]
    scaled = min(thickness / 1e-3, stiffness / 1e7)
    tables["contact"] |= {"stiffness": stiffness, "eta": min(10.0, 1e-4 * stiffness)}
    tables["strip"]["thickness"] = thickness
    for stage in tables["stages"]:
        stage["exit"]["force"] = [scaled * force for force in stage["exit"]["force"]]
    tables["contact"]["eta"] *= min(scaled, 1.0)
    run, _ = ran(tables)
    reading = end_of(run).rollers["r1"]
    return trial(run, reading.tension_in, reading.tension_out)


def capstan(
    level: str = "section",
    *,
    omega: float = 0.1,
    q: float = 0.05,
    speed: float = 1.0,
    thickness: float = 1e-3,
    refined: float = 0.05,
) -> Trial:
    """D3, D12, D17: full slip under a held strip, by the capstan formula with bending.

    The coefficient is chosen so that f_eff stays 0.3 at the roller's speed of 1 m/s; the
    tension goes with the thickness.
    """
    tables = tables_of(PULL, LAY, turning(), level=level, refined=refined)
    scaled, strength = thickness / 1e-3, (1.0 / speed) ** q
    tables["strip"]["thickness"] = thickness
    law = {"coefficient": 0.3 / strength, "exponent": q, "omega": omega, "speed": speed}
    tables["friction"] = {"law": "norton-hoff", **law}
    for stage in tables["stages"][:2]:
        stage["exit"]["force"] = [scaled * force for force in stage["exit"]["force"]]
    tables["contact"]["eta"] *= min(scaled, 1.0)
    run, _ = ran(tables)
    return trial(run, *_ratios(run))


def ends_of(run: Run) -> tuple[float, float, float]:
    """Return tensions (N) at entry and exit, and the angle (rad) between them."""
    state = end_of(run)
    entry, end = state.edge_force("entry"), state.edge_force("exit")
    angle = np.arctan2(-end[2], end[0]) + np.arctan2(-entry[2], -entry[0])
    return float(np.linalg.norm(entry)), float(np.linalg.norm(end)), float(angle)


def _ratios(run: Run) -> tuple[float, float]:
    """Return the ratio of tensions, and that of the formula."""
    friction = run.assembly.friction
    assert friction is not None
    high, low, angle = ends_of(run)
    f = friction.effective(end_of(run).rollers["r1"].creep_speed)
    bending = run.assembly.strip.bending_stiffness
    if low < line_tension(bending, angle):
        return high / low, line_ratio(f, angle)
    return high / low, arc_ratio(f, angle, bending / low / RADIUS**2)


def hold(duration: float = 1e3, refined: float = 0.0125) -> tuple[Trial, Run]:
    """D4: hung over a standing roller by half of what friction carries, for long: its drift.

    It creeps as a whole, at V_c ρ^(1/q), where ρ f is the friction that this ratio of tensions
    takes.  Contact is as sharp as the mesh resolves; what rubs lacks the faint pressure.
    Before, what the slackening left behind relaxes: 100 times this drift at first, 1.25 times after
    5 s; its last half is steady to 1e-3 from holds of 30 s on.
    """
    less = {"force": [0.9 * TENSION, 0.0, -0.9 * 5773.5]}
    slacken = {"name": "slacken", "duration": 1.0, "exit": less}
    half = {"name": "hold", "duration": 0.5 * duration, "entry": {"release": True}}
    rest = {"name": "rest", "duration": 0.5 * duration}
    tables = tables_of(PULL, LAY, slacken, half, rest, refined=refined)
    law = {"coefficient": 0.3, "exponent": 0.1, "omega": 1e-6, "speed": 1e-4}
    tables["friction"] = {"law": "norton-hoff", **law}
    tables["contact"] = {}
    run, steps = ran(tables)
    late = [step for step in steps if step.time >= steps[-1].time - 0.5 * duration]
    ends, strip = (late[0], late[-1]), run.assembly.strip
    first, last = (step.state.full.reshape(-1, strip.count) for step in ends)
    moved = np.linalg.norm((last - first)[strip.edges["exit"].values].mean(axis=0))
    high, low, angle = ends_of(run)
    stiff = strip.bending_stiffness / low / RADIUS**2
    taken = brentq(lambda f: arc_ratio(f, angle, stiff) - high / low, 0.0, 0.3, xtol=1e-15)
    exact = 1e-4 * (taken / (0.3 * (1.0 - FAINT_PRESSURE))) ** 10.0
    return trial(run, float(moved) / (ends[1].time - ends[0].time), exact), run


def graze(depth: float = 0.1, delta: float = 1e-3) -> Trial:
    """D9: a roller comes as near as a share of δ, and goes; the strip is back to 1e-10 m."""
    up = {"r1": {"move": [0.0, 0.0, (1.0 + depth) * delta]}}
    there, back = {"name": "up", "duration": 1.0, "rollers": up}, {"name": "down", "duration": 1.0}
    tables = tables_of(PULL, there, {**back, "rollers": {"r1": {"move": [0.0, 0.0, 0.0]}}})
    del tables["friction"]
    tables["edges"]["exit"] = {"fixed": ["z"]}
    tables["solver"]["tolerance"] = 3e-10
    run, steps = ran(tables)
    first = next(step.state.full for step in reversed(steps) if step.stage == "pull")
    values = run.march.course.assembly.strip.unknowns_of(run.assembly.strip.node_values)
    moved = float(np.abs(run.march.full - first)[values].max())
    return trial(run, moved, 0.0, 1.0)


def lowered(level: str = "section", last: float = -0.1) -> Trial:
    """D11: tension taken away, and a little beyond: an arc, a line, and no crash.

    It ends done, or with one structured outcome: without tension a hinged strip swings freely,
    and its path may turn back there.  The error is then that the least tension on the way was
    above a tenth of that at which the arc becomes a line, D/(4R² sin²(θ/4)).
    """
    less = {"name": "less", "duration": 1.0, "friction": False}
    end = {"force": [last, 0.0, -0.57735 * last]}
    tables = tables_of(PULL, LAY, {**less, "exit": end}, level=level)
    del tables["friction"]
    tables["solver"]["max_tangents"] = 500  # it may swing to and fro for ever
    run, steps = ran(tables)
    line = line_tension(run.assembly.strip.bending_stiffness, 0.75)
    tensions = [np.linalg.norm(step.state.edge_force("exit")) for step in steps]
    return trial(run, float(min(tensions)), 0.0, 0.1 * line)


def driven(speed: float = 1e-4, refined: float = 0.05) -> Trial:
    """D12: a belt carried by the roller alone, with less tension behind: its mean creep.

    The belt has a four hundredth of the stiffness of steel, in stretching alone, so that creep
    is 1e-3 of the speed: of steel it is 3e-6.  Contact is as sharp as the mesh resolves: on a
    sharper one nodes that pass shake the slip by a tenth of what the belt creeps, however fine the
    mesh.  The error is in units of (T1 − T2)/(E t).
    """
    less = {"force": [0.95 * TENSION, 0.0, -0.95 * 5773.5]}
    slacken = {"name": "slacken", "duration": 0.1, "exit": less}
    start = turning(1.0, 0.5, entry={"release": True})
    convey = {**turning(1.0, 0.1), "name": "convey"}
    tables = tables_of(PULL, LAY, slacken, start, convey, refined=refined)
    tables["strip"] |= {"cells": [round(4.0 / refined), 2], "thickness": 2e-2}
    tables["material"]["young"] = 2.6e7
    tables["contact"], tables["friction"]["speed"] = {}, speed
    run, steps = ran(tables)
    late = steps[[step.stage for step in steps].index("convey") - 1 :]
    times = np.array([step.time for step in late])
    creeps = np.array([step.state.rollers["r1"].creep_speed for step in late])
    creep = np.trapezoid(creeps, times) / np.ptp(times)
    exact, most = _creep(run)
    return trial(run, float(creep), exact, most)


def _creep(run: Run) -> tuple[float, float]:
    """Return the creep of a driven belt at 1 m/s, mean over the pressure, and its largest.

    Mass that passes makes slip grow with what the membrane force N falls, c = c0 + (N0 − N)/(E t).
    It falls by f_eff(c) times what presses: T sin α at both ends of the arc, from N0 = T1 cos α1 to
    T2 cos α2, and N dθ within.  That this takes the whole angle tells c0.
    """
    law = run.assembly.friction
    assert law is not None
    ends, angle = np.array(ends_of(run)[:2]), ends_of(run)[2]
    stiffness, poisson = run.assembly.strip.tensile_stiffness, run.assembly.material.poisson
    stretch, _ = uniaxial_stretches(float(ends.mean()), stiffness, poisson)
    stiffness *= stretch * (1.5 * stretch**2 - 0.5)  # λ dT/dλ by Green's strain
    lift = lift_off(run.assembly.strip.bending_stiffness / ends / RADIUS**2)
    first, last = ends * np.cos(lift)
    fall = np.concatenate([[0.0], np.geomspace(1e-12, 1.0, 2001)]) * (first - last)

    def pressed(slowest: float) -> tuple[Array, Array]:
        creep = slowest + fall / stiffness
        return creep, 1.0 / np.array([law.effective(c) for c in creep])

    def excess(logarithm: float) -> float:
        _, rate = pressed(np.exp(logarithm))
        force, turned = (
            cumulative_trapezoid(y, fall, initial=0.0) for y in (rate, rate / (first - fall))
        )
        line = ends * np.sin(lift)
        begin, end = np.interp([line[0], force[-1] - line[1]], force, turned)
        return float(end - begin - (angle - lift.sum()))

    creep, weights = pressed(np.exp(brentq(excess, -60.0, 0.0)))
    mean = np.trapezoid(creep * weights, fall) / np.trapezoid(weights, fall)
    return float(mean), (ends[0] - ends[1]) / stiffness


def ironed(refined: float = 0.05, eta: float = 10.0) -> tuple[Trial, float]:
    """D13: a roller dragged along a held strip: drag = f_eff times the normal force.

    Returns
    -------
    trial
    ripple : float
        Scatter of the normal force about its trend, over its mean.
    """
    along = {"r1": {"move": [0.3, 0.0, 0.06]}}
    up = {"name": "up", "duration": 1.0, "friction": False}
    held = {"name": "iron", "duration": 0.3, "rollers": along}
    tables = tables_of(
        PULL, {**up, "rollers": {"r1": {"move": [0.0, 0.0, 0.06]}}}, held, refined=refined
    )
    tables["strip"]["cells"] = [round(4.0 / refined), 2]
    tables["edges"]["exit"] = {"fixed": ["z"]}
    tables["contact"]["eta"] = eta
    run, steps = ran(tables)
    assert run.assembly.friction is not None
    f = run.assembly.friction.effective(1.0)
    late = [s.state for s in steps if s.stage == "iron" and s.time > 2.15]
    times = np.array([s.time for s in late])
    drags = np.array([abs(s.rollers["r1"].drag) for s in late])
    normals = np.array([s.rollers["r1"].normal_force for s in late])
    worst = int(np.abs(drags / normals / f - 1.0).argmax())
    trend = np.polyval(np.polyfit(times, normals, 2), times)
    ripple = float(np.std(normals - trend) / normals.mean())
    return trial(run, float(drags[worst]), float(f * normals[worst])), ripple


def in_units(length: float = 1.0) -> tuple[Trial, list[float]]:
    """D16: the capstan with lengths in another unit (1e3 for mm), forces in N.

    Returns
    -------
    trial
        Its ratio beside that in metres.
    times : list of float
        Ends of the steps, which must not depend on units.
    """
    tables = tables_of(PULL, LAY, turning(duration=0.2), refined=0.1)
    strip, contact = tables["strip"], tables["contact"]
    for key in ("length", "width", "thickness", "refined"):
        strip[key] *= length
    tables["material"] = {"young": MATERIAL["young"] / length**2, "poisson": MATERIAL["poisson"]}
    contact["stiffness"] /= length**3
    contact["eta"] /= length**2
    contact["delta"] *= length
    tables["friction"]["speed"] *= length
    tables["rollers"][0]["radius"] *= length
    tables["rollers"][0]["centre"] = [length * x for x in tables["rollers"][0]["centre"]]
    pull, lay, turn = tables["stages"]
    for stage in (pull, lay):
        stage["exit"]["force"] = [force / length for force in stage["exit"]["force"]]
    lay["entry"]["move"] = [length * x for x in lay["entry"]["move"]]
    turn["rollers"]["r1"]["surface_speed"] *= length
    run, steps = ran(tables)
    ratio = end_of(run).rollers["r1"].tension_ratio or np.nan
    return trial(run, ratio, ratio), [step.time for step in steps]


def slender(elements: int = 100, thickness: float = 1e-3) -> Trial:
    """D17: a strip pulled from 1 to 10⁴ elements; elongation by Green's strain, exactly."""
    tables = tables_of(PULL)
    for key in ("contact", "friction", "rollers"):
        del tables[key]
    del tables["strip"]["refined"]
    tables["strip"] |= {"cells": [elements, 1], "thickness": thickness}
    force = TENSION * thickness / 1e-3
    tables["stages"][0]["exit"]["force"] = [force, 0.0, 0.0]
    tables["solver"]["tolerance"] = 1e-8
    run, _ = ran(tables)
    strip = run.assembly.strip
    stretch = 1.0 + run.march.full.reshape(-1, strip.count)[strip.edges["exit"].values, 0][0] / 4.0
    stiffness = MATERIAL["young"] * thickness
    found = float(stiffness * 0.5 * (stretch**2 - 1.0) * stretch)
    return trial(run, found, force)
