"""The bridle against the capstan formula: in full slip, and driven with partial slip.

1. Held at the entry while both rollers turn (``bridle.toml``): the tension ratio over both is the
   product of two capstans, less the correction for bending.
2. Free, pulled harder at the exit and driven by both rollers at the same speed: the strip
   leaves the first as it came, T_mid = T_entry, since it sticks where it comes on to either;
   the second takes the whole difference on the last part of its arc, of the angle
   ln(T_exit/T_mid)/f_eff, and the strip leaves it faster by the creep (T_exit − T_mid)/(E t).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from anmstrip import Scene
from anmstrip.scene.measures import State
from anmstrip.scene.run import Run

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


def driven(settings: list[str], pull: float, travel: float) -> dict[str, tuple[float, float]]:
    """What partial slip leaves after some metres: quantity → found, expected."""
    speed = 1.0
    tables = Scene.load(HERE / "bridle.toml", settings).to_dict()
    tables["strip"]["feed"] = True
    turning = {"upper": {"surface_speed": speed}, "lower": {"surface_speed": -speed}}
    tables["stages"] = [
        {"name": "pull", "duration": 0.1, "exit": {"force": [pull, 0.0, 0.0]}},
        {"name": "go", "duration": 0.3, "entry": {"release": True}, "rollers": turning},
        {"name": "run", "duration": travel / speed},
    ]
    run, state = finished(Scene.model_validate(tables))
    strip, law = run.assembly.strip, run.assembly.friction
    assert law is not None
    reading = state.rollers["lower"]
    creep = speed * (reading.tension_out - reading.tension_in) / strip.tensile_stiffness
    entry, mid, leaving = state.tension("entry"), reading.tension_in, reading.tension_out
    return {
        "tension between the rollers (N/m)": (mid, entry),
        "slip arc (rad)": (slip_arc(state), np.log(leaving / mid) / law.effective(creep)),
        "creep at the exit (m/s)": (speed_at_exit(state) - speed, creep),
    }


def slip_arc(state: State) -> float:
    """Angle on the lower roller where friction is near the cone (rad)."""
    contact = state.contacts["lower"]
    used = np.linalg.norm(contact.traction, axis=0)
    assert contact.coefficient is not None
    slips = contact.touching & (used > SLIDING * contact.coefficient * contact.pressure)
    length = np.ptp(contact.contact.operator.reference[0, slips]) if slips.any() else 0.0
    return float(length / contact.roller.radius)


def speed_at_exit(state: State) -> float:
    """Along the strip, at its end (m/s)."""
    assert state.velocity is not None
    strip = state.plan.model.strip
    values = state.velocity.reshape(-1, strip.count)[strip.edges["exit"].values]
    return float(strip.kinematics.embed(values.T)[0].mean())


def main() -> None:
    """Print both comparisons."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarse: a few seconds")
    quick = parser.parse_args().quick
    settings = ["strip.refined=0.05"] if quick else []
    found, expected = full_slip(settings)
    print(f"full slip: ratio {found:.5f}, formula {expected:.5f}, {found / expected - 1:+.3%}")
    assert abs(found / expected - 1.0) < 0.01
    honest = ["strip.refined=0.05", "friction.speed=1e-6", "solver.tolerance=1e-3"]
    soft = ["contact.stiffness=1e8"]
    for name, (value, theory) in driven([*honest, *soft], 1.2e4, 0.1 if quick else 4.0).items():
        print(f"driven: {name} {value:.6g}, expected {theory:.6g}")


if __name__ == "__main__":
    main()
