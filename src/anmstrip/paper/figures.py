"""Counterparts of the paper's figures 1, 2, 4, 6, 8 and 9, drawn without a display."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from anmstrip.arrays import Array
from anmstrip.mechanics.laws import NortonHoff
from anmstrip.paper.mass_spring import MassSpring, PressedPlane, RotatingCircle
from anmstrip.paper.references import balanced_reactions, coulomb

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


EXPONENTS = (0.0, 0.05, 0.1, 0.3, 0.5)
"""Values of q in the first figure."""

WIDTHS = (0.0, 0.02, 0.1, 0.3, 0.5)
"""Values of ω in the second figure."""

INK, ACCENT, QUIET = "#1f4e79", "#c0392b", "#8c8c8c"


def draw_figures(case: MassSpring, rows: Array, directory: Path) -> tuple[Path, ...]:
    """Draw the figures of a case.

    Parameters
    ----------
    case : MassSpring
    rows : ndarray, shape (m, 7)
        time, ux, uy, vx, vy, normal and tangential reaction.
    directory : Path

    Returns
    -------
    tuple of Path
        PNG files.
    """
    from anmstrip.pictures.curves import save_figure

    figures = {"displacement": displacement(case, rows)}
    if isinstance(case, PressedPlane):
        p = case.parameters
        figures["friction-law-q"] = friction_law(
            {f"q = {q:g}": NortonHoff(1.0, q, p.omega, 1.0) for q in EXPONENTS}, f"ω = {p.omega:g}"
        )
        figures["friction-law-omega"] = friction_law(
            {f"ω = {w:g}": NortonHoff(1.0, p.q, w, 1.0) for w in WIDTHS}, f"q = {p.q:g}"
        )
    elif isinstance(case, RotatingCircle):
        figures["trajectory"] = trajectory(case, rows)
        figures["reactions"] = reactions(case, rows)
    paths = tuple(directory / f"{name}.png" for name in figures)
    for path, figure in zip(paths, figures.values(), strict=True):
        save_figure(figure, path)
    return paths


def displacement(case: MassSpring, rows: Array) -> Figure:
    """u_x against time, with Coulomb's law (figures 4 and 6)."""
    figure, axes = axes_of_figure("time (s)", "$u_x$ (m)")
    times = rows[:, 0]
    plot_coulomb(axes, times, coulomb(case).displacement(times)[:, 0])
    axes.plot(times, rows[:, 1], color=INK, label="series")
    axes.legend(frameon=False)
    return figure


def friction_law(laws: dict[str, NortonHoff], title: str) -> Figure:
    """−R_T/(f R_N) against slip (figures 1 and 2)."""
    figure, axes = axes_of_figure("slip velocity / $V_c$", "$-R_T / (f R_N)$")
    slip = np.linspace(-2.0, 2.0, 800)  # even: no sample at rest, where Coulomb's law jumps
    for label, law in laws.items():
        axes.plot(slip, -law(np.ones_like(slip), slip[None])[0], label=label)
    axes.legend(frameon=False, title=title)
    return figure


def trajectory(case: RotatingCircle, rows: Array) -> Figure:
    """Path of the mass around the circle (figure 8)."""
    figure, axes = axes_of_figure("x (m)", "y (m)")
    p = case.parameters
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.fill(p.r * np.sin(angle), p.r * np.cos(angle), color="#e6e6e6", label="circle")
    axes.axvline(0.0, color=QUIET, linewidth=0.6)
    height = p.r + p.delta
    exact = coulomb(case).displacement(rows[:, 0])
    plot_coulomb(axes, exact[:, 0], exact[:, 1] + height)
    axes.plot(rows[:, 1], rows[:, 2] + height, color=INK, label="series")
    axes.set_aspect("equal")
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return figure


def reactions(case: RotatingCircle, rows: Array) -> Figure:
    """Normal and tangential reaction against time (figure 9)."""
    figure, axes = axes_of_figure("time (s)", "reaction (N)")
    times, exact = rows[:, 0], coulomb(case)
    normal, tangential = balanced_reactions(case, times, exact.displacement(times))
    plot_coulomb(axes, times, normal)
    axes.plot(times, tangential, color=ACCENT, linestyle="--")
    axes.plot(times, rows[:, 5], color=INK, label="$R_N$, series")
    axes.plot(times, rows[:, 6], color=QUIET, label="$R_T$, series")
    if np.isfinite(exact.until):
        axes.axvline(exact.until, color=QUIET, linewidth=0.6)
        axes.text(exact.until, axes.get_ylim()[1], " cone left", fontsize=8, va="top")
    axes.legend(frameon=False)
    return figure


def plot_coulomb(axes: Axes, x: Array, y: Array) -> None:
    axes.plot(x, y, color=ACCENT, linestyle="--", label="Coulomb")


def axes_of_figure(x: str, y: str) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.0), dpi=150, layout="constrained")
    axes = figure.add_subplot(xlabel=x, ylabel=y)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes
