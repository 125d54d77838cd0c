"""Stiffness K and regularisation η of contact: tangents, penetration, errors.

A section strip is pressed on a roller, and then the roller turns under it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np

from anmstrip.mechanics.signorini import RepulsiveSignorini
from anmstrip.scene.measures import State
from anmstrip.scene.run import Run
from anmstrip.scene.schema import Scene
from anmstrip.studies.figures import Plot, curves
from anmstrip.studies.reports import Sheet, StudyReport
from anmstrip.studies.strips import RADIUS, capstan
from anmstrip.studies.turning import altered

STIFFNESSES = tuple(10.0**k for k in range(6, 13))
"""K (Pa/m), at η = 10 Pa."""

REGULARISATIONS = tuple(10.0**k for k in range(3, -1, -1))
"""η (Pa), at K = 1e10 Pa/m."""


@dataclass(frozen=True)
class Pressed:
    """What one contact law gives.

    Attributes
    ----------
    stiffness, eta : float
        Pa/m, Pa.
    pressing, turning : int
        Tangents of either stage.
    penetration : float
        In the middle of the arc (m); negative where a gap is left.
    off_law : float
        Its difference from the law's at the pressure there, over δ.
    pressure_error, ratio_error : float
        Of the pressure in the middle of the arc against (T − D/2R²)/R, and of the tension
        ratio against the capstan formula with bending.
    seconds : float
        Of the processor.
    """

    stiffness: float
    eta: float
    pressing: int
    turning: int
    penetration: float
    off_law: float
    pressure_error: float
    ratio_error: float
    seconds: float


def study(quick: bool = False) -> StudyReport:
    """Both sweeps."""
    every, refined = (slice(None, None, 3), 0.1) if quick else (slice(None), 0.05)
    base = capstan("section", 1, refined, 1e-5)
    stiff = [pressed(base, K, 10.0) for K in STIFFNESSES[every]]
    soft = [pressed(base, 1e10, eta) for eta in REGULARISATIONS[every]]
    names = tuple(field.name.replace("_", " ") for field in fields(Pressed))
    note = (
        "Tangents of pressing (without friction) and of turning (with it). Pressure and tension "
        "ratio are compared with the theory of a strip on a rigid cylinder without penetration."
    )
    sheets = (
        Sheet("Stiffness K", names, tuple(astuple(p) for p in stiff), note),
        Sheet("Regularisation η", names, tuple(astuple(p) for p in soft)),
    )
    return StudyReport(
        name="contact",
        title="Stiffness and regularisation of contact: tangents, penetration, errors",
        data=Sheet("", names, tuple(astuple(p) for p in [*stiff, *soft])),
        sheets=sheets,
        figures={
            "contact-stiffness.png": _figure("K (Pa/m)", stiff, [p.stiffness for p in stiff]),
            "contact-eta.png": _figure("η (Pa)", soft, [p.eta for p in soft]),
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


def pressed(base: Scene, stiffness: float, eta: float) -> Pressed:
    """Run a scene with another law of contact."""
    scene = altered(base, {"contact.stiffness": stiffness, "contact.eta": eta})
    begin, run, states = time.process_time(), Run(scene), {}
    for step in run:
        states[step.stage] = step.state
    assert run.outcome.done, run.message
    spent = time.process_time() - begin
    penetration, pressure, tension = _middle(states["wrap"])
    assert scene.contact is not None
    law = RepulsiveSignorini(stiffness, eta, scene.contact.delta)
    bending = run.assembly.strip.bending_stiffness / (2.0 * RADIUS**2)
    return Pressed(
        stiffness,
        eta,
        run.stages["wrap"]["tangents"],
        run.stages["turn"]["tangents"],
        penetration,
        (law.gap(pressure) + penetration) / law.delta,
        pressure * RADIUS / (tension - bending) - 1.0,
        ratio_error(run),
        spent,
    )


def _middle(state: State) -> tuple[float, float, float]:
    """Penetration (m) and pressure (Pa) in the middle third of the arc, tension (N/m)."""
    contact = state.contacts["r1"]
    begin, end = contact.arc
    x = contact.contact.operator.reference[0]
    middle = np.abs(x - contact.middle) <= (end - begin) / 6.0
    weights = contact.area[middle]
    pressure = float(contact.pressure[middle] @ weights / weights.sum())
    gap = float(contact.gap[middle] @ weights / weights.sum())
    return -gap, pressure, state.rollers["r1"].tension_in


def ratio_error(run: Run) -> float:
    """Of the tension ratio, against ln(T1/T2) = f_eff θ − (1 + f²) D/2R² (1/T2 − 1/T1)."""
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
