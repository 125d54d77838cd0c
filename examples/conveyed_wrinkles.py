"""Tension below which strip wrinkles while it is conveyed, over crown and over misalignment.

The stationary path of a line is followed to lower tensions, until a mode of the strip with its
friction is within 1 % of being unstable; no march through time.  A strip of 1 m × 0.2 mm over a
crowned roller, without friction and with f = 0.3: without it the onset is that of the strip that
stands.  A strip of 0.5 m × 0.2 mm over a roller out of line, to which friction steers it: it
bends in its plane as a beam, and its inner edge is slack at W θ E t/L, near which it wrinkles.
Without friction it stays where it is threaded, and smooth.

Writes ``conveyed_wrinkles.csv`` and ``.png``.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip import Scene

CONTACT = {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3}
YOUNG, FRICTION = 2e11, 0.3
COARSE, FINE = ((6, 12), 0.02), ((8, 16), 0.0125)

Mesh = tuple[tuple[int, int], float]


def slack(yaw: Any) -> Any:
    """Return the tension (N/m) at which the inner edge of the skewed beam is slack."""
    return 0.5 / 0.6 * yaw * YOUNG * 2e-4


def line(friction: float, high: float, low: float, tables: dict[str, Any]) -> Scene:
    """Return a scene whose tension is lowered in stationary states, from a driven roller on."""
    driven = {"r1": {"surface_speed": 1.0}}
    given: dict[str, Any] = {"entry": {"tension": high}}
    eased: dict[str, Any] = {"entry": {"tension": low}, "exit": {"tension": low}}
    if not friction:  # nothing else tells how fast the strip runs
        given, eased = {"strip": {"speed": 1.0}}, {"exit": {"tension": low}}
    stages = [
        {"name": "run", "steady": True, "rollers": driven, **given},
        {"name": "ease", "steady": True, **eased},
    ]
    common = {"contact": CONTACT, "friction": {"coefficient": friction}, "stages": stages}
    return Scene.model_validate({**common, "solver": {"tolerance": 1e-5, "order": 15}, **tables})


def crowned(crown: float, friction: float, mesh: Mesh) -> Scene:
    """Return a strip over a roller that is thinner by a crown (m) at the strip's edges."""
    radius, free, half, width = 0.4, 0.8, np.radians(5.0), 1.0
    x = radius * np.sin(half) + free * np.cos(half)
    z = radius * (np.cos(half) - 1.0) - free * np.sin(half)
    high, low = (crown / 8e-4) ** 2 * np.array([4e4, 2.4e4] if friction else [2.2e4, 1.5e4])
    tables: dict[str, Any] = {
        "strip": {"width": width, "thickness": 2e-4, "cells": mesh[0], "refined": mesh[1]},
        "material": {"young": YOUNG, "poisson": 0.3},
        "rollers": [{"name": "r1", "centre": [0.0, 0.0, -radius], "wrap": "over",
                     "radius": radius, "crown": [0.0, -crown / (0.5 * width) ** 2]}],
        "threading": {"tension": high, "entry": [-x, 0.0, z], "exit": [x, 0.0, z]},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
    }  # fmt: skip
    return line(friction, high, low, tables)


def skewed(yaw: float, friction: float, mesh: Mesh) -> Scene:
    """Return a strip that is guided straight, 0.6 m before a roller out of line (rad)."""
    radius, before, behind, wrap, width = 0.2, 0.6, 0.3, np.radians(40.0), 0.5
    x = radius * np.sin(wrap) + behind * np.cos(wrap)
    z = radius * (np.cos(wrap) - 1.0) - behind * np.sin(wrap)
    high, low = slack(yaw) * np.array([3.0, 0.7])
    tables: dict[str, Any] = {
        "strip": {"width": width, "thickness": 2e-4, "cells": mesh[0], "refined": mesh[1]},
        "material": {"young": YOUNG, "poisson": 0.3},
        "rollers": [{"name": "r1", "centre": [0.0, 0.0, -radius], "wrap": "over",
                     "radius": radius, "axis": [yaw, 1.0, 0.0]}],
        "threading": {"tension": high, "entry": [-before, 0.0, 0.0], "exit": [x, 0.0, z]},
        "edges": {"entry": {"fixed": ["x", "z"], "centred": True}},
    }  # fmt: skip
    return line(friction, high, low, tables)


def onset(scene: Scene) -> tuple[float, int]:
    """Return the tension of the first onset (N/m), and the tangents up to it."""
    run = scene.run()
    step = next(step for step in run if run.wrinkles)
    return float(run.wrinkles[0]["exit_tension"]), step.tangents


def limits(
    mesh: Mesh, crowns: list[tuple[float, float]], yaws: list[float]
) -> list[dict[str, Any]]:
    """Return the rows of the table."""
    cases = [("crown (m)", crowned, crown, friction) for crown, friction in crowns]
    cases += [("yaw (rad)", skewed, yaw, FRICTION) for yaw in yaws]
    rows = []
    for name, make, value, friction in cases:
        tension, tangents = onset(make(value, friction, mesh))
        print(f"{name} {value:g}, f = {friction:g}: wrinkles below {tension:.0f} N/m "
              f"({tangents} tangents)")  # fmt: skip
        rows.append({"of": name, "value": value, "friction": friction, "tension": tension,
                     "tangents": tangents})  # fmt: skip
    return rows


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the tension over crown and over yaw."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 2)
    labels = {"crown (m)": "crown (mm)", "yaw (rad)": "roller out of line (mrad)"}
    for axis, (name, label) in zip(axes, labels.items(), strict=True):
        for friction, colour in ((0.0, "tab:blue"), (FRICTION, "tab:red")):
            mine = [row for row in rows if (row["of"], row["friction"]) == (name, friction)]
            if mine:
                points = [(1e3 * row["value"], 1e-3 * row["tension"]) for row in mine]
                axis.plot(*zip(*points, strict=True), "o-", color=colour, label=f"f = {friction:g}")
        axis.set(xlabel=label, ylabel="wrinkles below (kN/m)", xlim=(0.0, None), ylim=(0.0, None))
        axis.grid(alpha=0.3)
    if yawed := [row["value"] for row in rows if row["of"] == "yaw (rad)"]:
        ends = np.array([0.0, max(yawed)])
        axes[1].plot(1e3 * ends, 1e-3 * slack(ends), "k--", label="inner edge slack, beam")
    for axis in axes:
        if axis.lines:
            axis.legend(frameon=False)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a coarse mesh, one onset")
    parser.add_argument("-o", type=Path, default=Path("results/conveyed_wrinkles"), help="where to")
    given = parser.parse_args()
    given.o.mkdir(parents=True, exist_ok=True)
    if given.quick:
        found = limits(COARSE, [(8e-4, 0.0)], [])
    else:
        crowns = [(crown, f) for f in (0.0, FRICTION) for crown in (6e-4, 8e-4, 1e-3)]
        found = limits(FINE, crowns, [5e-4, 1e-3, 1.5e-3])
    with (given.o / "conveyed_wrinkles.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, list(found[0]))
        table.writeheader()
        table.writerows(found)
    draw(found, given.o / "conveyed_wrinkles.png")
