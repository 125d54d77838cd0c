"""The bridle against the capstan formula: in full slip, and with slip on a part of an arc.

1. Held at the entry while both rollers turn (``bridle.toml``): the tension ratio over both is the
   product of two capstans, less the correction for bending.
2. Pulled harder at the exit while the rollers stand: the last arc of the lower roller slips, of
   the angle ln(T_exit/T_entry)/f; where the strip sticks before it, nothing has changed, nor
   on the upper roller.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from anmstrip import Scene
from anmstrip.driver.run import Run
from anmstrip.results.state import State

HERE = Path(__file__).parent
SLIDING = 0.5
"""Share of the cone f R_N above which a point counts as slipping."""


def finished(scene: Scene) -> tuple[Run, State]:
    """The run and its last state."""
    run = scene.run()
    for _ in run:
        pass
    assert run.state is not None and run.outcome.done, run.message
    return run, run.state


def full_slip(settings: list[str]) -> tuple[float, float]:
    """Tension ratio over both rollers, and that of the formula."""
    run, state = finished(Scene.load(HERE / "bridle.toml", settings))
    strip, law = run.assembly.strip, run.assembly.friction
    thread = run.assembly.thread
    assert law is not None and thread is not None
    high, low = state.tension("entry"), state.tension("exit")
    radius, d = run.assembly.rollers[0].radius, strip.bending_stiffness
    bending = (1.0 + law.coefficient**2) * d / (2.0 * radius**2) * (1.0 / low - 1.0 / high)
    expected = np.exp(law.effective(1.0) * sum(thread.turns.values()) - bending)
    return high / low, float(expected)


def pulled(settings: list[str], pull: float, seconds: float) -> dict[str, tuple[float, float]]:
    """Return what partial slip leaves on rollers that stand: quantity → found, expected.

    The pull is slow, so that slip is as fast as V_c, where the law has its nominal coefficient.
    """
    tables = Scene.load(HERE / "bridle.toml", [*settings, "friction.speed=1e-6"]).to_dict()
    load = {"force": [pull, 0.0, 0.0]}
    tables["stages"] = [{"name": "pull", "duration": seconds, "exit": load}]
    _, state = finished(Scene.model_validate(tables))
    lower, upper = state.rollers["lower"], state.rollers["upper"]
    arc = np.log(lower.tension_out / lower.tension_in) / tables["friction"]["coefficient"]
    return {
        "tension between the rollers (N/m)": (lower.tension_in, state.tension("entry")),
        "slip arc of the lower roller (rad)": (slip_arc(state), float(arc)),
        "drag of the upper roller (N)": (upper.drag, 0.0),
    }


def slip_arc(state: State) -> float:
    """Angle on the lower roller where friction is near the cone (rad)."""
    contact = state.contacts["lower"]
    used = np.linalg.norm(contact.traction, axis=0)
    assert contact.coefficient is not None
    slips = contact.touching & (used > SLIDING * contact.coefficient * contact.pressure)
    length = np.ptp(contact.contact.operator.reference[0, slips]) if slips.any() else 0.0
    return float(length / contact.roller.radius)


def main() -> None:
    """Print both comparisons."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarse: a few seconds")
    quick = parser.parse_args().quick
    settings = ["strip.refined=0.05"] if quick else []
    found, expected = full_slip(settings)
    print(f"full slip: ratio {found:.5f}, formula {expected:.5f}, {found / expected - 1:+.3%}")
    assert abs(found / expected - 1.0) < 0.01
    for name, (value, theory) in pulled(settings, 1.2e4, 10.0).items():
        print(f"pulled: {name} {value:.6g}, expected {theory:.6g}")


if __name__ == "__main__":
    main()
