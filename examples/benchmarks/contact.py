"""Laws of contact: stiffness K and regularisation η of the penalty, width w of the graded law.

A section strip is pressed on a roller, and then the roller turns under it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from anmstrip.results.state import State
from figures import Plot, curves
from harness import Report, Sheet, main
from strips import RADIUS, capstan

STIFFNESSES = tuple(10.0**k for k in range(6, 13))
"""K (Pa/m), at η = 10 Pa."""

REGULARISATIONS = tuple(10.0**k for k in range(3, -1, -1))
"""η (Pa), at K = 1e10 Pa/m."""

ONSETS = tuple(4.0**k for k in range(-3, 3))
"""w, over what the program chooses."""


class Pressed(NamedTuple):
    """Results of one contact law."""

    stiffness: float | None  # K of the penalty (Pa/m)
    eta: float | None  # of the penalty (Pa)
    onset: float  # gap over which contact sets in (m)
    pressing: int  # tangents of the stage
    turning: int  # tangents of the stage
    penetration: float  # in the middle of the arc (m), negative where a gap is left
    # of the pressure in the middle of the arc against (T − D/2R²)/R, its standard deviation there
    # over its mean, and the error of the tension ratio against the capstan formula with bending
    pressure_error: float
    alternation: float
    ratio_error: float
    seconds: float  # of the processor


def study(quick: bool = False) -> Report:
    """Sweep stiffness, regularisation and width."""
    every, refined = (slice(None, None, 3), 0.1) if quick else (slice(None), 0.05)
    base = capstan("section", 1, refined, 1e-5)
    stiff = [pressed(base, penalty(K, 10.0)) for K in STIFFNESSES[every]]
    soft = [pressed(base, penalty(1e10, eta)) for eta in REGULARISATIONS[every]]
    chosen = pressed(base, {})
    graded = [pressed(base, {"onset": factor * chosen.onset}) for factor in ONSETS[every]]
    names = tuple(name.replace("_", " ") for name in Pressed._fields)
    note = (
        "Tangents of pressing (without friction) and of turning (with it). Pressure and tension "
        "ratio are compared with the theory of a strip on a rigid cylinder without penetration."
    )
    sheets = (
        Sheet("Stiffness K", names, tuple(stiff), note),
        Sheet("Regularisation η", names, tuple(soft)),
        Sheet(
            "Graded contact: as the mesh resolves it, and other widths", names, (chosen, *graded)
        ),
    )
    return Report(
        name="contact",
        title="Laws of contact: tangents, penetration, errors",
        data=Sheet("", names, (*stiff, *soft, chosen, *graded)),
        sheets=sheets,
        figures={
            "contact-stiffness.png": _figure("K (Pa/m)", stiff, STIFFNESSES[every]),
            "contact-eta.png": _figure("η (Pa)", soft, REGULARISATIONS[every]),
            "contact-onset.png": _figure("w (m)", graded, [p.onset for p in graded]),
        },
    )


def _figure(x: str, runs: Sequence[Pressed], at: Sequence[float]) -> bytes:
    tangents = {
        "tangents, pressing": (at, [p.pressing for p in runs]),
        "tangents, turning": (at, [p.turning for p in runs]),
    }
    errors = {
        "|penetration| / R": (at, [abs(p.penetration) / RADIUS for p in runs]),
        "error of pressure": (at, [abs(p.pressure_error) for p in runs]),
        "error of tension ratio": (at, [abs(p.ratio_error) for p in runs]),
    }
    counts = Plot(x, "tangents", tangents, ("log", "linear"))
    return curves(counts, Plot(x, "relative", errors))


def penalty(stiffness: float, eta: float) -> dict[str, float]:
    """Return the table of a contact with K and η, δ = 1 mm."""
    return {"stiffness": stiffness, "eta": eta, "delta": 1e-3}


def pressed(base: Scene, contact: Mapping[str, float]) -> Pressed:
    """Run a scene with another law of contact."""
    scene = Scene.model_validate({**base.to_dict(), "contact": dict(contact)})
    begin, run, states = time.process_time(), Run(scene), {}
    for step in run:
        states[step.stage] = step.state
    assert run.outcome.done, run.message
    spent = time.process_time() - begin
    penetration, pressure, alternation, tension = _middle(states["wrap"])
    bending = run.assembly.strip.bending_stiffness / (2.0 * RADIUS**2)
    return Pressed(
        contact.get("stiffness"),
        contact.get("eta"),
        run.assembly.signorini.width,
        run.stages["wrap"]["tangents"],
        run.stages["turn"]["tangents"],
        penetration,
        pressure * RADIUS / (tension - bending) - 1.0,
        alternation,
        ratio_error(run),
        spent,
    )


def _middle(state: State) -> tuple[float, float, float, float]:
    """Return penetration (m), pressure (Pa), its alternation, and tension (N/m), mid-arc."""
    contact = state.contacts["r1"]
    begin, end = contact.arc
    x = contact.contact.operator.reference[0]
    middle = np.abs(x - contact.middle) <= (end - begin) / 6.0
    weights = contact.area[middle] / contact.area[middle].sum()
    pressure = float(contact.pressure[middle] @ weights)
    spread = np.sqrt((contact.pressure[middle] - pressure) ** 2 @ weights)
    gap = float(contact.gap[middle] @ weights)
    return -gap, pressure, float(spread) / pressure, state.rollers["r1"].tension_in


def ratio_error(run: Run) -> float:
    """Return the error against ln(T1/T2) = f_eff θ − (1 + f²) D/2R² (1/T2 − 1/T1)."""
    state, friction = run.state, run.assembly.friction
    assert state is not None
    assert friction is not None
    entry, end = state.edge_force("entry"), state.edge_force("exit")
    angle = np.arctan2(-end[2], end[0]) + np.arctan2(-entry[2], -entry[0])
    high, low = np.linalg.norm(entry), np.linalg.norm(end)
    f, D = friction.coefficient, run.assembly.strip.bending_stiffness
    slope = friction.effective(state.rollers["r1"].creep_speed) * angle
    formula = slope - (1.0 + f**2) * D / (2.0 * RADIUS**2) * (1.0 / low - 1.0 / high)
    return float(high / low * np.exp(-formula)) - 1.0


if __name__ == "__main__":
    main(study)
