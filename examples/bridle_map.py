"""The bridle from back slip through stick to full slip: tension against speed, in one path.

``bridle_map.toml`` with the speed of its lower roller as the control; every state is stationary.

1. Limits: the tension between the rollers is T e^(−fθ) and T e^(fθ) where all of the lower roller
   slips (Euler and Eytelwein), with the angle θ between the strands and the tension T at the exit.
2. Between them the lower roller sticks where the strip runs on, so that creep theory has a tension
   between of E t (V/c − 1), whatever friction is; and slip on the arc ln(T_in/T_out)/f before the
   strip runs off, less √(D/T)/r, for which a line load stands there.  V_c rounds the corner between
   slip and stick.
3. The upper roller sticks where the strip runs on: the tension at the entry hardly changes until it
   slips too.

Prints what was found beside what was expected.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from anmstrip import Scene

SCENE = Path(__file__).parent / "bridle_map.toml"
ALONG = "rollers.lower.surface_speed=0.99996:1.00004"


def main(settings: list[str], directory: str | None) -> None:
    """Map the bridle, and compare."""
    scene = Scene.load(SCENE, settings)
    made = scene.map(ALONG, directory=directory)
    assert made.done, made.message
    print(made.message)
    thread, strip = made.run.assembly.thread, made.run.assembly.strip
    assert thread is not None and made.run.assembly.friction is not None
    friction, turn, pull = (
        made.run.assembly.friction.coefficient,
        thread.turns["lower"],
        thread.tension,
    )
    speed, between, arc = (
        np.array([row[f"lower_{column}"] for row in made.rows])
        for column in ("surface_speed", "tension_in", "slip_arc")
    )
    limits = pull * np.exp(friction * turn * np.array([-1.0, 1.0]))
    stick = strip.tensile_stiffness * (speed / made.rows[0]["strip_speed"] - 1.0)
    inside = (stick > limits[0] * 1.1) & (stick < limits[1] * 0.9)
    # the default law is at 0.95 of its limit from 3.04 V_c on
    drop = 3.04 * made.run.assembly.friction.speed / speed * strip.tensile_stiffness
    slipping = np.abs(np.log((stick - np.copysign(drop, stick - pull)) / pull)) / friction
    slipping -= np.sqrt(strip.bending_stiffness / pull) / made.run.assembly.rollers[-1].radius
    away = inside & (np.abs(stick - pull) > 2.0 * drop)
    entry = np.array([row["entry_tension"] for row in made.rows])
    compared = {
        "back slip (N/m)": (between[0], limits[0]),
        "full slip (N/m)": (between[-1], limits[1]),
        "rise with speed (N s/m²)": (
            np.polyfit(speed[inside], between[inside], 1)[0],
            np.polyfit(speed[inside], stick[inside], 1)[0],
        ),
        "entry in stick, least over most": (entry[inside].min() / entry[inside].max(), 1.0),
    }
    for name, (found, expected) in compared.items():
        print(f"{name}: {found:.6g}, expected {expected:.6g}, {found / expected - 1.0:+.2%}")
        assert abs(found / expected - 1.0) < 0.01
    behind = np.abs(arc[away] - slipping[away]).max()
    print(f"slip arc: within {behind:.3f} rad of what creep theory has")
    assert behind < 0.15


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a coarse mesh, a second or two")
    parser.add_argument("-o", "--output", help="directory for map.csv, map.png and map.json")
    given = parser.parse_args()
    quick = ["strip.refined=0.03", "friction.speed=1.5e-6", "solver.tolerance=1e-4"]
    main(quick if given.quick else [], given.output)
