"""Tension below which strip wrinkles while it is conveyed, over crown and over misalignment.

The stationary path of a line is followed to lower tensions, until a mode of the strip with its
friction is within 1 % of being unstable; no march through time.

1. A strip of 1 m × 0.2 mm over a crowned roller.  Without friction the onset is that of the strip
   that stands: what presses it across is in proportion to the crown whatever the tension T, what it
   bears is in proportion to √T, so that the limit is in proportion to the square of the crown.
   With f = 0.3 the middle of the roller runs ahead and draws the strip together the more, the
   harder it is pulled: what presses it then grows with T as well, up to a crown over which strip
   wrinkles at any tension.
2. A strip of 0.5 m × 0.2 mm, guided straight 0.6 m before a roller out of line by θ.  Friction
   steers it, and it bends in its plane: the shear N_xy that this takes is in proportion to θ
   whatever the tension, and presses the strip aslant by N_xy²/T.  What it bears being in proportion
   to √T, the limit is about in proportion to θ^(4/3), near the tension W θ E t/L below which the
   inner edge of a beam is slack.  Without friction it stays where it is threaded, and smooth.

Writes ``conveyed_wrinkles.csv`` and ``.png``.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip import Scene
from anmstrip.results.wrinkles import Wrinkling

CONTACT = {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3}
YOUNG, FRICTION = 2e11, 0.3
Mesh = tuple[tuple[int, int], float]
COARSE, FINE = ((6, 12), 0.02), ((8, 16), 0.0125)

BEGINS = 2.8e10
"""Onset over a crown without friction, over the square of the crown (N/m³)."""

CROWNS = {0.0: (6e-4, 8e-4, 1e-3), FRICTION: (4e-4, 5e-4, 6e-4, 7e-4, 8e-4)}
YAWS = {0.0: (1e-3,), FRICTION: (5e-4, 7.5e-4, 1e-3, 1.25e-3)}
AGAIN = {"crown (m)": (4e-4, 6e-4, 8e-4), "yaw (rad)": (5e-4, 1e-3)}
"""Values of which the coarse mesh is run as well."""


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
    high, low = BEGINS * crown**2 * np.array([3.0, 0.7] if friction else [1.25, 0.85])
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
    high, low = slack(yaw) * np.array([1.2, 0.3])
    tables: dict[str, Any] = {
        "strip": {"width": width, "thickness": 2e-4, "cells": mesh[0], "refined": mesh[1]},
        "material": {"young": YOUNG, "poisson": 0.0},
        "rollers": [{"name": "r1", "centre": [0.0, 0.0, -radius], "wrap": "over",
                     "radius": radius, "axis": [yaw, 1.0, 0.0]}],
        "threading": {"tension": high, "entry": [-before, 0.0, 0.0], "exit": [x, 0.0, z]},
        "edges": {"entry": {"fixed": ["x", "y", "z"]}},
    }  # fmt: skip
    return line(friction, high, low, tables)


def limit(scene: Scene) -> dict[str, Any]:
    """Return what the path to lower tensions meets: an onset, or that there is none."""
    run, before = scene.run(), None
    for step in run:
        if run.wrinkles:
            break
        before = step.state
    assert run.wrinkles or run.outcome.done, run.message
    first = run.wrinkles[0] if run.wrinkles else {"stage": "ease", "time": step.time}
    state = step.state.at(first["time"], before)
    span = max(Wrinkling(state).spans, key=lambda span: span.compression)
    word = "below" if run.wrinkles else "smooth down to"
    return {
        "wrinkles": word if first["stage"] == "ease" else "throughout, up to",
        "tension": state.tension("exit"),
        "compression": span.compression,
        "bearable": span.bearable,
        "wavelength": first.get("wavelength"),
        "offset": state.offset(state.contacts["r1"].arc[0]),
        "tangents": step.tangents,
    }


def limits(cases: list[tuple[str, float, float, Mesh]]) -> list[dict[str, Any]]:
    """Return the rows of the table."""
    rows = []
    for name, value, friction, mesh in cases:
        found = limit((crowned if name == "crown (m)" else skewed)(value, friction, mesh))
        print(f"{name} {value:g}, f = {friction:g}, {mesh[0][1]} across: "
              f"{found['wrinkles']} {found['tension']:.0f} N/m ({found['tangents']} tangents)",
              flush=True)  # fmt: skip
        rows.append({"of": name, "value": value, "friction": friction, "across": mesh[0][1]})
        rows[-1] |= found
    return rows


def cases() -> list[tuple[str, float, float, Mesh]]:
    """Return what is run: roller, crown (m) or yaw (rad), friction, mesh."""
    made = []
    for name, values in (("crown (m)", CROWNS), ("yaw (rad)", YAWS)):
        for friction, chosen in values.items():
            for mesh, some in ((FINE, chosen), (COARSE, AGAIN[name])):
                made += [(name, value, friction, mesh) for value in some if value in chosen]
    return made


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the tension over crown and over yaw."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 2)
    labels = {"crown (m)": "crown (mm)", "yaw (rad)": "roller out of line (mrad)"}
    for axis, (name, label) in zip(axes, labels.items(), strict=True):
        for friction, colour in ((0.0, "tab:blue"), (FRICTION, "tab:red")):
            for mesh, line, word in ((FINE, "o-", ""), (COARSE, "x:", ", coarse")):
                mine = [row for row in rows if (row["of"], row["friction"], row["across"]) ==
                        (name, friction, mesh[0][1]) and row["wrinkles"] == "below"]  # fmt: skip
                points = [(1e3 * row["value"], 1e-3 * row["tension"]) for row in mine]
                if points:
                    given = {"color": colour, "label": f"f = {friction:g}{word}"}
                    axis.plot(*zip(*points, strict=True), line, **given)
        axis.set(xlabel=label, ylabel="wrinkles below (kN/m)", xlim=(0.0, None), ylim=(0.0, None))
        axis.grid(alpha=0.3)
    for row in rows:
        x, y = 1e3 * row["value"], 1e-3 * row["tension"]
        word = f"f = {row['friction']:g}: {row['wrinkles']} {y:.0f} kN/m"
        if row["across"] == FINE[0][1] and row["wrinkles"] == "smooth down to":
            axes[1].plot(x, y, "v", color="tab:blue", label=word)
        elif row["across"] == FINE[0][1] and row["wrinkles"] == "throughout, up to":
            axes[0].axvspan(x, axes[0].get_xlim()[1], alpha=0.1, lw=0.0, color="r", label=word)
    yaws = np.linspace(0.0, max((r["value"] for r in rows if r["of"] == "yaw (rad)"), default=0.0))
    axes[1].plot(1e3 * yaws, 1e-3 * slack(yaws), "k--", label="inner edge slack, beam")
    for axis in axes:
        if axis.lines:
            axis.legend(frameon=False)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a coarse mesh, one onset")
    parser.add_argument("-o", type=Path, default=Path("results/conveyed_wrinkles"), help="where to")
    given = parser.parse_args()
    given.o.mkdir(parents=True, exist_ok=True)
    found = limits([("crown (m)", 8e-4, 0.0, COARSE)] if given.quick else cases())
    with (given.o / "conveyed_wrinkles.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, list(found[0]))
        table.writeheader()
        table.writerows(found)
    draw(found, given.o / "conveyed_wrinkles.png")
