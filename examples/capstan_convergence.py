"""The capstan on four meshes: tension ratio against the capstan formula with bending.

Expected: ln(T1/T2) = f_eff θ − (1 + f²) D / (2 R²) (1/T2 − 1/T1), where f_eff is the
friction law's coefficient at the speed of slip and θ the angle between the edge forces;
the ratio is within 0.05 % of it for elements of 0.05 m over the roller and below.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from anmstrip import Scene

SCENE = Path(__file__).parent / "capstan.toml"


def tension_ratio(element: float) -> tuple[float, float, str]:
    """Computed tension ratio, that of the formula, and the run's message."""
    scene = Scene.load(SCENE, [f"strip.refined={element}", "solver.tolerance=1e-5"])
    run = scene.run()
    *_, last = run
    state, friction, f = last.state, run.assembly.friction, scene.friction.coefficient
    entry, end = state.edge_force("entry"), state.edge_force("exit")
    angle = np.arctan2(-end[2], end[0]) + np.arctan2(-entry[2], -entry[0])
    high, low = np.linalg.norm(entry), np.linalg.norm(end)
    bending = run.assembly.strip.bending_stiffness / (2.0 * scene.rollers[0].radius ** 2)
    slope = friction.effective(state.rollers["r1"].creep_speed) * angle
    formula = np.exp(slope - (1.0 + f**2) * bending * (1.0 / low - 1.0 / high))
    return float(high / low), float(formula), run.message


def main(elements: tuple[float, ...]) -> None:
    """Print a row per mesh."""
    print("element (m)  T1/T2     formula   difference")
    for element in elements:
        ratio, formula, message = tension_ratio(element)
        error = ratio / formula - 1.0
        print(f"{element:11g}  {ratio:.5f}   {formula:.5f}   {100 * error:+.4f} %   {message}")
        assert abs(error) < (5e-4 if element <= 0.05 else 5e-3)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the two coarse meshes")
    main((0.1, 0.05) if parser.parse_args().quick else (0.1, 0.05, 0.025, 0.0125))
