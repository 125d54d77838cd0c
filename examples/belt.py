"""A belt drive in its stationary state, beside a published one that took 245 000 time steps.

``belt.toml`` with a belt whose force is E A times its stretch, as that of the published model: an
effect of one's own, which adds the difference from the membrane law of strips.  The torque of the
driven pulley is 25 + 2 ω N m of its own speed ω, which four runs find.

1. String theory: each pulley sticks where the belt runs on, at the tension of that strand, and
   slips on the arc ln(T₁/T₂)/f before it runs off; T₁ − T₂ = M/r; both pulleys have the speed c λ
   of what sticks to them; and the whole belt is as long as it was.
2. Exudyn, with the inertia of the belt: 664.52 and 186.27 N, slip arc 2.544 rad, speeds as 1.06155.
   This arc is ln(T₁/T₂)/f of its tensions, to all its digits, and so is that of this run.  The arc
   on which friction is above 0.95 of its limit is shorter where V_c lets it grow: 2.451 rad, and
   2.498 with V_c = 1e-4 m/s, which takes 98 tangents.

Prints what was found beside both.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import fsolve

from anmstrip import LawEffect, Scene
from anmstrip.driver.run import Run, Step
from anmstrip.mechanics.shell import Membrane

SCENE = Path(__file__).parent / "belt.toml"

PUBLISHED = {"tight": 664.52, "slack": 186.27, "arc": 2.544, "ratio": 1.06155}
"""For the model of Exudyn's example ``beltDriveALE`` (N, N, rad, 1), after 245 000 time steps."""


class LinearStretch(LawEffect):
    """What makes the force of a section E t (λ − 1), λ = |r,X|, along the strip."""

    name = "linear stretch"

    def __init__(self, strip: Any) -> None:
        self.stiffness, self.membrane = strip.tensile_stiffness, Membrane(strip)
        self.operator = self.membrane.operator

    def law(self, x: Any, v: Any, controls: Any) -> Any:
        """Stress (N/m): (λ − 1)/λ r,X less (λ² − 1)/2 r,X of the membrane, times E t."""
        tangent = x + self.membrane.flat
        square = np.einsum("ia...,ia...->...", tangent, tangent)
        share = 1.0 - 1.0 / np.sqrt(square) - (square - 1.0) * 0.5
        return tangent * (share * self.stiffness)


def string_theory(
    scene: Scene, length: float, torque: float, stretch: Callable[[float], float]
) -> dict[str, float]:
    """Stationary state of a string round two pulleys of one radius, in full grip where it runs on.

    Parameters
    ----------
    scene : Scene
    length : float
        Of the belt at rest (m).
    torque : float
        N m.
    stretch : callable
        Force (N) to λ.
    """
    assert scene.friction is not None
    f, (first, second) = scene.friction.coefficient, scene.rollers
    r, run = first.radius, float(np.linalg.norm(np.subtract(second.centre, first.centre)))

    def missing(slack: float) -> float:
        tight = slack + torque / r
        sticks = np.pi - np.log(tight / slack) / f
        slips = 2.0 * quad(lambda t: 1.0 / (f * t * stretch(t)), slack, tight)[0]
        strands = (run + r * sticks) * (1.0 / stretch(tight) + 1.0 / stretch(slack))
        return float(strands + r * slips - length)

    slack = float(fsolve(lambda t: missing(t[0]), torque / r / (np.exp(f * np.pi) - 1.0) * 1.2)[0])
    tight = slack + torque / r
    ratio = stretch(tight) / stretch(slack)
    return {"tight": tight, "slack": slack, "arc": float(np.log(tight / slack)) / f, "ratio": ratio}


def found(run: Run, last: Step) -> dict[str, float]:
    """The same of a run."""
    driving, driven = (last.state.rollers[name] for name in ("driving", "driven"))
    width, friction = run.assembly.strip.width, run.scene.friction
    assert friction is not None
    return {
        "tight": driving.tension_in * width,
        "slack": driving.tension_out * width,
        "arc": float(np.log(driving.tension_in / driving.tension_out)) / friction.coefficient,
        "ratio": driving.surface_speed / driven.surface_speed,
    }


def settled(settings: list[str]) -> tuple[Run, Step]:
    """Run the scene with the torque 25 + 2 ω that belongs to the speed it has."""
    omega = 12.0
    for _ in range(4):
        torque = f"stages.run.rollers.driven.torque={-25.0 - 2.0 * omega!r}"
        run = Scene.load(SCENE, [*settings, torque]).run(effects=[LinearStretch])
        *_, last = run
        assert run.outcome.done, run.message
        omega = last.state.rollers["driven"].surface_speed / 0.1
    return run, last


def main(settings: list[str]) -> None:
    """Run the belt, and compare."""
    run, last = settled(settings)
    torque = -last.state.rollers["driven"].torque
    ea = run.assembly.strip.tensile_stiffness * run.assembly.strip.width
    theory = string_theory(
        run.scene, run.assembly.strip.length, torque, lambda force: 1.0 + force / ea
    )
    print(f"{run.cost.expansions} tangents; published: 245 000 time steps")
    print(f"{'':22}{'found':>10}{'string':>10}{'published':>10}")
    names = {"tight": "tight strand (N)", "slack": "slack strand (N)"}
    names |= {"arc": "slip arc (rad)", "ratio": "ratio of speeds"}
    for key, value in found(run, last).items():
        print(f"{names[key]:22}{value:10.6g}{theory[key]:10.6g}{PUBLISHED[key]:10.6g}")
    counted = last.state.rollers["driving"].slip_arc
    print(f"{'above 0.95 of the cone':22}{counted:10.6g}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="ten times the V_c")
    main(["friction.speed=1.0e-2"] if parser.parse_args().quick else [])
