"""A crease: what a wrinkle before a roller leaves in strip that yields, once it is cold.

Steel of 0.12 m × 0.1 mm, σ_y = 60 MPa, is heated by 80 K in the 0.1 m between a roller to which it
sticks and another, and would be 0.12 mm wider.  Its width is held: it wrinkles along, 0.41 mm high,
and yields.  Cold, with the tension eased to 30 %, a crease of 0.040 mm is left.  Strip that does
not yield is flat again, to 0.003 mm.

Writes ``crease.csv``, and of the first case the states for ParaView and ``crease.png``.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline

from anmstrip import Scene
from anmstrip.results.wrinkles import Wrinkling

SPAN, RADIUS, WRAP, BEHIND = 0.1, 0.3, np.radians(30.0), 0.04
COARSE, FINE = ((10, 12), 0.012), ((14, 16), 0.009)
ELASTIC = 1e11
"""Yield stress (Pa) of strip that does not yield."""

Mesh = tuple[tuple[int, int], float]


def hot_strip(
    mesh: Mesh = COARSE,
    tension: float = 3e3,
    yield_stress: float = 6e7,
    friction: float = 0.3,
    heat: float = 80.0,
) -> Scene:
    """Return a strip that is heated before a roller (K) under a tension (N/m), and cooled."""
    x = RADIUS * np.sin(WRAP) + BEHIND * np.cos(WRAP)
    z = RADIUS * (np.cos(WRAP) - 1.0) - BEHIND * np.sin(WRAP)
    along = [[0.0, 1.0], [SPAN, 1.0], [1.2 * SPAN, 0.0]]
    hot, cold = ({"across": [warm], "along": along} for warm in (heat, 0.0))
    tables: dict[str, Any] = {
        "strip": {"width": 0.12, "thickness": 1e-4, "cells": mesh[0], "refined": mesh[1],
                  "feed": False, "bending": "kirchhoff-love", "temperature": cold,
                  "crossbow": 0.05},
        "material": {"young": 2e11, "poisson": 0.3, "expansion": 1.2e-5,
                     "yield_stress": yield_stress,
                     "plasticity": {"exponent": 21, "reference_rate": 1e-3, "layers": 5}},
        "contact": {},
        "rollers": [{"name": "r1", "centre": [0.0, 0.0, -RADIUS], "wrap": "over",
                     "radius": RADIUS}],
        "threading": {"tension": tension, "entry": [-SPAN, 0.0, 0.0], "exit": [x, 0.0, z]},
        "edges": {"entry": {"fixed": ["x", "y", "z"]}},
        "stages": [
            {"name": "heat", "duration": 1.0, "strip": {"temperature": hot}},
            {"name": "cool", "duration": 1.0, "strip": {"temperature": cold},
             "exit": {"tension": 0.3 * tension}},
        ],
        "solver": {"tolerance": 1e-4},  # at 1e-3 wrinkles may take a form that snaps
    }  # fmt: skip
    if friction:
        tables["friction"] = {"coefficient": friction, "speed": 1e-5}
    return Scene.model_validate(tables)


def draw(states: list[Wrinkling], path: Path) -> None:
    """Draw the span before the roller, hot and cold, with heights larger than they are."""
    from matplotlib import colormaps
    from matplotlib.colors import LightSource
    from matplotlib.figure import Figure

    figure, light = Figure(figsize=(11.0, 5.0), layout="constrained"), LightSource(225.0, 40.0)
    panels = zip(
        states, ("hot, heights × 40", "cold: the crease, heights × 300"), (40, 300), strict=True
    )
    for number, (state, title, times) in enumerate(panels):
        lines = [line for line in state.lines() if line[0] <= state.spans[0].end]
        rows = [np.array([line[k] for line in lines]) for k in (0, 2)]
        surface = RectBivariateSpline(rows[0], lines[0][1], rows[1])
        x, y = (np.linspace(ends.min(), ends.max(), 160) for ends in (rows[0], lines[0][1]))
        w = surface(x, y)
        axes = figure.add_subplot(1, 2, number + 1, projection="3d")
        colours = light.shade(w, colormaps["coolwarm"], vert_exag=0.1 * times, blend_mode="soft")
        grid = (1e3 * values for values in (*np.meshgrid(x, y, indexing="ij"), w))
        axes.plot_surface(*grid, facecolors=colours, rcount=160, ccount=160, shade=False)
        axes.set(title=f"{title}, {1e3 * np.ptp(w):.2f} mm from crest to trough", zticks=[])
        axes.set(xlabel="along (mm)", ylabel="across (mm)")
        axes.locator_params(axis="x", nbins=4)
        axes.set_box_aspect((np.ptp(x), np.ptp(y), times * np.ptp(w)))
        axes.view_init(30.0, -60.0)
    figure.savefig(path, dpi=150)


def creased(scene: Scene, directory: Path | None = None) -> dict[str, float]:
    """Return heights and spacings (m) of the wrinkles while hot and of the crease they leave.

    With a directory the states are written there, and both are drawn.
    """
    ends = {step.stage: step for step in scene.run(directory)}
    if directory is not None:
        draw([Wrinkling(ends[stage].state) for stage in ("heat", "cool")], directory / "crease.png")
    found: dict[str, float] = {"tangents": float(ends["cool"].tangents)}
    for name, stage in (("wrinkle", "heat"), ("crease", "cool")):
        height, spacing = (Wrinkling(ends[stage].state).waves() or [])[0]
        found |= {f"{name}_height": height, f"{name}_spacing": spacing}
    return found


def main(cases: list[dict[str, Any]], mesh: Mesh, directory: Path) -> None:
    """Print and write a row for each case, the first with its states and a picture."""
    rows = []
    for number, case in enumerate(cases):
        row = case | creased(hot_strip(mesh, **case), None if number else directory)
        told = ", ".join(f"{key} {value:g}" for key, value in case.items()) or "60 MPa, f = 0.3"
        for name in ("wrinkle", "crease"):
            high, apart = (1e3 * row[f"{name}_{key}"] for key in ("height", "spacing"))
            told += f"; {name} {high:.4f} mm high, {apart:.1f} mm apart"
        print(f"{told} ({row['tangents']:.0f} tangents)", flush=True)
        rows.append(row)
    with (directory / "crease.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, sorted({key for row in rows for key in row}))
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one case")
    parser.add_argument("--fine", action="store_true", help="more elements across and along")
    parser.add_argument("-o", type=Path, default=Path("results/crease"), help="where to write")
    given = parser.parse_args()
    others = [{"yield_stress": 1e8}, {"yield_stress": ELASTIC}, {"friction": 0.0}, {"tension": 2e3}]
    main([{}, *([] if given.quick else others)], FINE if given.fine else COARSE, given.o)
