"""What runs on behind a roller: stationary strip that wrinkles before it, and yields there.

Steel of 0.12 m × 0.1 mm under 3 kN/m runs at 0.1 m/s to a crowned roller 0.1 m behind a place that
holds its width, is heated on the way there and cooled behind.  It wrinkles along, just before the
roller, whose axis is out of line by 0.8 mrad: where it rubs it steers the strip and pulls one side
more.  Where strip yields as it is bent onto the roller it carries a crease away, which stays in the
cold strip; elastic strip leaves the roller flat.  Without friction, or in line, the wrinkle alone
leaves a ridge.

The stationary state is followed as the heat rises.  The height of the crease is told under the
strip's tension, and of strip that is cut free: its residual curvature across, integrated twice.

Writes ``conveyed_crease.csv``, and of the first case the states for ParaView and pictures.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from anmstrip import Scene
from anmstrip.arrays import Array
from anmstrip.results.fields import FieldSampler
from anmstrip.results.state import State
from anmstrip.results.wrinkles import Wrinkling

SPAN, BEHIND, WIDTH, RADIUS, WRAP, CROWN = 0.1, 0.1, 0.12, 0.3, np.radians(30.0), 2e-5
HEAT, YAW = 60.0, 8e-4
"""Heat at the roller (K), and how far its axis is out of line."""

MESHES = {8: ((10, 8), 0.012), 10: ((10, 10), 0.012), 12: ((14, 12), 0.009)}
BAR = {"vertical": True, "position_x": 0.04, "position_y": 0.1, "height": 0.4, "fmt": "%.2f"}
Mesh = tuple[tuple[int, int], float]


def conveyed(
    mesh: Mesh = MESHES[8],
    tension: float = 3e3,
    yield_stress: float | None = 6e7,
    friction: float = 0.3,
    yaw: float = YAW,
    heat: float = HEAT,
) -> Scene:
    """Return a strip that is conveyed under a tension (N/m), then heated (K) before a roller."""
    x = RADIUS * np.sin(WRAP) + BEHIND * np.cos(WRAP)
    z = RADIUS * (np.cos(WRAP) - 1.0) - BEHIND * np.sin(WRAP)
    along = [[0.0, 0.0], [SPAN, 1.0], [1.5 * SPAN, 0.0]]
    cold, hot = ({"across": [warm], "along": along} for warm in (0.0, heat))
    material: dict[str, Any] = {"young": 2e11, "poisson": 0.3, "expansion": 1.2e-5}
    if yield_stress is not None:
        flow = {"exponent": 21, "reference_rate": 1e-3, "layers": 5}
        material |= {"yield_stress": yield_stress, "plasticity": flow}
    # without friction nothing else tells how fast the strip runs
    pulled = {"entry": {"tension": tension}} if friction else {"strip": {"speed": 0.1}}
    driven = {**pulled, "rollers": {"r1": {"surface_speed": 0.1}}}
    tables: dict[str, Any] = {
        "strip": {"width": WIDTH, "thickness": 1e-4, "cells": mesh[0], "refined": mesh[1],
                  "feed": False, "bending": "kirchhoff-love", "temperature": cold,
                  "crossbow": 0.05},
        "material": material,
        "contact": {},
        "friction": {"coefficient": friction},
        "rollers": [{"name": "r1", "centre": [0.0, 0.0, -RADIUS], "wrap": "over",
                     "radius": RADIUS, "axis": [yaw, 1.0, 0.0],
                     "crown": [0.0, -CROWN / (0.5 * WIDTH) ** 2]}],
        "threading": {"tension": tension, "entry": [-SPAN, 0.0, 0.0], "exit": [x, 0.0, z]},
        "edges": {"entry": {"fixed": ["x", "y", "z"]}},
        "stages": [
            {"name": "run", "steady": True, **driven},
            {"name": "heat", "steady": True, "strip": {"temperature": hot}},
        ],
        "solver": {"tolerance": 3e-4},
    }  # fmt: skip
    return Scene.model_validate(tables)


def free_shape(state: State) -> tuple[Array, Array]:
    """Return y and the height (m) across that strip cut free behind the roller would have."""
    sampler = FieldSampler(state.plan.model.strip)
    x, y, _ = sampler.reference
    rows = np.unique(np.round(x, 9))
    line = np.flatnonzero(np.abs(x - rows[np.abs(rows - (x.max() - 0.5 * BEHIND)).argmin()]) < 1e-8)
    line = line[np.argsort(y[line])]
    if state.plasticity is None:
        return y[line], np.zeros(len(line))
    bent = sampler.sample(state)["residual_curvature"][line, 1]
    w = cumulative_trapezoid(cumulative_trapezoid(bent, y[line], initial=0), y[line], initial=0)
    return y[line], w - np.polyval(np.polyfit(y[line], w, 2), y[line])


def creased(scene: Scene, directory: Path | None = None) -> tuple[dict[str, Any], State]:
    """Return heights and spacings (m) of wrinkles and crease while hot, and the state."""
    run = scene.run(directory)
    *_, last = run
    assert run.outcome.done, run.message
    before, behind = Wrinkling(last.state).waves() or []
    names = "wrinkle_height", "wrinkle_spacing", "crease_height", "crease_spacing", "free_height"
    values = *before, *behind, float(np.abs(free_shape(last.state)[1]).max())
    return dict(zip(names, values, strict=True)) | {"tangents": last.tangents}, last.state


def draw(state: State, path: Path, times: float = 40.0) -> None:
    """Draw the strip on its roller with pyvista, waves across larger than they are."""
    import pyvista

    lines = Wrinkling(state).lines()
    x, y = np.array([line[0] for line in lines]), lines[0][1]
    w = np.array([np.interp(y, line[1], line[2]) for line in lines])
    sampler = FieldSampler(state.plan.model.strip)
    places, along = sampler.interpolate(state.full), sampler.reference
    order = np.flatnonzero(np.abs(along[1]) < 1e-9)
    order = order[np.argsort(along[0, order])]
    middle = [np.interp(x, along[0, order], (along[k] + places[:, k])[order]) for k in (0, 2)]
    dx, dz = np.gradient(middle, x, axis=1) / np.hypot(*np.gradient(middle, x, axis=1))
    x = (middle[0] - middle[0][0] - SPAN)[:, None] - times * w * dz[:, None]
    z = (middle[1] - middle[1][0])[:, None] + times * w * dx[:, None]
    grid = pyvista.StructuredGrid(*(k[..., None] for k in (x, np.broadcast_to(y, w.shape), z)))
    grid["height across (mm)"] = 1e3 * w.ravel(order="F")
    angle, side = np.meshgrid(np.linspace(-0.02, WRAP + 0.02, 60), [-0.6 * WIDTH, 0.6 * WIDTH])
    around = RADIUS * np.sin(angle), side, RADIUS * (np.cos(angle) - 1.0) - 3e-3
    plotter = pyvista.Plotter(off_screen=True, window_size=(1400, 700))
    plotter.add_mesh(pyvista.StructuredGrid(*(k[..., None] for k in around)), color="silver")
    limit = 1e3 * np.abs(w).max()
    plotter.add_mesh(grid, cmap="coolwarm", clim=(-limit, limit), scalar_bar_args=BAR)
    plotter.view_vector((0.45, -0.75, 0.6), viewup=(0.0, 0.0, 1.0))
    plotter.camera.zoom(1.4)
    plotter.screenshot(path)


def main(cases: list[dict[str, Any]], directory: Path) -> None:
    """Print and write a row for each case, the first with its states and a picture."""
    rows = []
    for number, case in enumerate(cases):
        found, state = creased(conveyed(**case), None if number else directory)
        if not number:
            draw(state, directory / "conveyed_crease.png")
        told = ", ".join(f"{key} {value}" for key, value in case.items()) or "60 MPa, f = 0.3"
        high, apart, left, between, free = (1e3 * value for value in list(found.values())[:5])
        print(f"{told}: wrinkle {high:.3f} mm high, {apart:.1f} mm apart; crease {left:.4f} mm, "
              f"{between:.1f} mm apart, {free:.4f} mm if free ({found['tangents']} tangents)",
              flush=True)  # fmt: skip
        rows.append(case | found)
    with (directory / "conveyed_crease.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, sorted({key for row in rows for key in row}))
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one case")
    parser.add_argument("-o", type=Path, default=Path("results/conveyed_crease"), help="where to")
    given = parser.parse_args()
    others: list[dict[str, Any]] = [{"mesh": MESHES[10]}, {"mesh": MESHES[12]}]
    others += [{"friction": 0.1}, {"friction": 0.0}, {"heat": 0.5}]
    others += [{"tension": 2e3}, {"tension": 5e3}]
    others += [{"yaw": 0.0, "mesh": mesh} for mesh in MESHES.values()]
    others += [{"yield_stress": stress} for stress in (8e7, 1e8, 1.5e8, None)]
    main([{}, *([] if given.quick else others)], given.o)
