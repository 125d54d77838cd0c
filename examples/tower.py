"""The tower for ten lengths of its mesh: do the tensions settle, does as much leave as enters?

Runs ``tower.toml`` on and on; prints, for every window of travel with a step in it, the mean
tension before each roller and behind the last, the drift of their mean, and the mass that has
passed.  The mesh stays while strip passes through it, so that steps become as long as the
windows; ``--quick`` is no more than a start on a coarse mesh.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.integrate import trapezoid

from anmstrip import Scene

SCENE = Path(__file__).parent / "tower.toml"
SPEED = 2.0
"""Of the rollers' surfaces (m/s)."""


def main(lengths: float, settings: list[str], windows: int) -> None:
    """Print a row for every window."""
    duration = lengths * 11.43 / SPEED
    scene = Scene.load(SCENE, [*settings, f"stages.run.duration={duration}"])
    run = scene.run()
    edges = np.linspace(run.end_time - duration, run.end_time, windows + 1)
    names = [roller.name for roller in scene.rollers]
    print("passed (m)   ", *(f"before {n:3s}" for n in names), "behind     mean   mass (kg)")
    rows, window, means = [], 1, []
    for step in run:
        if step.stage != "run":
            continue
        readings = step.state.rollers
        tensions = [readings[n].tension_in for n in names] + [readings[names[-1]].tension_out]
        rows.append((step.time, *tensions))
        if step.time >= edges[window] * (1.0 - 1e-12):
            means.append(averaged(np.array(rows)))
            feed = run.facts()["feed"]
            words = " ".join(f"{tension:10.1f}" for tension in means[-1])
            mean, mass = means[-1][1:-1].mean(), f"{feed['mass']:9.3f}"
            print(f"{feed['length']:10.2f} {words} {mean:10.2f} {mass}")
            rows, window = rows[-1:], min(windows, int(np.searchsorted(edges, step.time, "right")))
    assert run.outcome.done, run.message
    half = (len(means) - 1) // 2
    inner = [m[1:-1].mean() for m in means[half:]]
    way = SPEED * (edges[-1] - edges[half + 1])
    drift = (max(inner) - min(inner)) / inner[-1] / way
    print(f"{run.message} Drift of the mean over the second half: {drift:.4%} per metre.")


def averaged(rows: np.ndarray) -> np.ndarray:
    """Means over time of all columns but the first."""
    time, values = rows[:, 0], rows[:, 1:]
    return np.asarray(trapezoid(values, time, axis=0)) / (time[-1] - time[0])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a start on a coarse mesh")
    parser.add_argument("--lengths", type=float, default=10.0, help="lengths of the mesh")
    given = parser.parse_args()
    if given.quick:
        main(0.02, ["strip.refined=0.1", "stages.start.duration=0.1"], 2)
    else:
        main(given.lengths, [], 10)
