"""Strips that wrinkle before a roller: over a crown, or out of line; and what friction adds.

*Crown.*  The middle goes a longer way than the edges and carries more; away from the roller the
tension spreads again to the width of the strip.  That takes compression across, which comes from
the crown whatever the tension is, while it is tension that holds the strip smooth.  So it wrinkles
where the tension falls below an onset, which grows with the square of the crown: the strip bears
2 q √(D T).  A roller that turns and rubs brings more strip to where its surface goes, towards the
middle, and the compression grows with the way.

*Out of line.*  A strip that may slide does so, and nothing happens.  One that sticks is carried to
the side and sheared: N_xy² / T is compression across, and wrinkles lie askew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from anmstrip.mechanics.cells import jets
from anmstrip.scene.build import Assembly
from anmstrip.scene.imperfection import buckling, flattened
from anmstrip.scene.march import Arrival, March
from anmstrip.scene.measures import State
from anmstrip.scene.schema import Scene
from anmstrip.scene.wrinkling import Wrinkling
from anmstrip.studies.reports import Cell, Sheet, StudyReport
from anmstrip.studies.shell_figure import Line, drawn
from anmstrip.studies.wrinkling_scenes import Crowned, Mesh, Skewed

Array = NDArray[np.float64]

ONSET = 1.01
"""Growth of the compression that is called the onset.

A strip leans into those wrinkles that its roller has bent it a little towards, and holds the
factor just above 1.
"""

DATED = 1e-3
"""Error of an onset, as a share of the step that it lies in."""

MOST_STEPS = 500


@dataclass(frozen=True)
class Onset:
    """Where the strip begins to wrinkle.

    Attributes
    ----------
    state : State
    tension : float
        N/m.
    compression : float
        N/m.
    heights : ndarray, shape (unknowns,)
        The mode, along the normals, as heights of the flat strip.
    """

    state: State
    tension: float
    compression: float
    heights: Array

    @cached_property
    def wavelengths(self) -> tuple[float, float]:
        """2π times the mean height over the mean slope, along and across (m)."""
        operator = jets(self.state.plan.model.strip)
        height, *slopes = operator.apply(self.heights)[2] ** 2 @ operator.weights
        along, across = (2.0 * np.pi * np.sqrt(height / slope) for slope in slopes)
        return float(along), float(across)

    @property
    def formula(self) -> float:
        """2 √π (D/T)^(1/4) √L with half a wavelength along as the length of the wrinkles."""
        stiffness = self.state.plan.model.strip.bending_stiffness / self.tension
        return float(2.0 * np.sqrt(0.5 * np.pi * self.wavelengths[0]) * stiffness**0.25)

    @property
    def profile(self) -> tuple[Array, Array]:
        """y and height across the strip where the mode is highest."""
        strip, z = self.state.plan.model.strip, self.heights.reshape(-1, 3)[:, 2]
        value, slope = (z[strip.dofs(name)] for name in ("u", "u_y"))
        there = np.isclose(strip.nodes[0], strip.nodes[0][np.abs(value).argmax()])
        y = np.linspace(strip.nodes[1].min(), strip.nodes[1].max(), 300)
        return y, CubicHermiteSpline(strip.nodes[1][there], value[there], slope[there])(y)


def onset(scene: Scene) -> Onset:
    """First state after threading in which the strip is about to buckle.

    Raises
    ------
    PathStopped
        From the path.
    ValueError
        If the strip stays smooth, or is wrinkled from the beginning.
    """
    march = March(Assembly(scene))
    for stage in scene.course:
        plan = march.planned(stage, None)
        for arrival in march.through(plan, MOST_STEPS):
            march.accept(arrival)
            if stage is not scene.course[0] and _excess(arrival.state) < 0.0:
                return _dated(arrival)
        if stage is scene.course[0] and _excess(arrival.state) < 0.0:
            raise ValueError("the strip is wrinkled when threaded; take a higher tension")
        march.finish(stage, plan)
    raise ValueError("the strip stays smooth")


def _excess(state: State) -> float:
    return float(buckling(state, 1)[0][0]) - ONSET


def _dated(arrival: Arrival) -> Onset:
    """The onset inside a step."""
    branch, plan = arrival.branch, arrival.plan
    assert branch is not None

    def state(a: float) -> State:
        u, control = branch(a)
        full, time = plan.supports.full(u, control), plan.start + control * plan.duration
        return replace(arrival.state, full=full, control=float(control), time=time)

    found = state(brentq(lambda a: _excess(state(a)), 0.0, branch.length,
                         xtol=DATED * branch.length))  # fmt: skip
    heights = flattened(found, buckling(found, 1)[1][:, 0])
    return Onset(found, found.tension("exit"), Wrinkling(found).compression, heights)


@dataclass(frozen=True)
class Ended:
    """How a strip has come out.

    Attributes
    ----------
    state : State
    wrinkling : Wrinkling
    tangents : int
    """

    state: State
    wrinkling: Wrinkling
    tangents: int

    @property
    def heights(self) -> list[float]:
        """Of the wrinkles in every span, over the thickness."""
        found = self.wrinkling.amplitudes()
        assert found is not None
        return [height / self.state.plan.model.strip.thickness for height in found]

    @property
    def lean(self) -> float:
        """Largest difference in height between both sides of the strip, over the thickness."""
        strip = self.state.plan.model.strip
        z = self.state.full.reshape(-1, 3)[strip.node_values, 2]
        here, there = (np.lexsort(np.round([side * strip.nodes[1], strip.nodes[0]], 9))
                       for side in (1.0, -1.0))  # fmt: skip
        return float(np.abs(z[here] - z[there]).max()) / strip.thickness


def ended(scene: Scene, directory: Path | None = None) -> Ended:
    """Run a scene to its end, and write it if a directory is given.

    Raises
    ------
    RuntimeError
        If it stops before.
    """
    run = scene.run(directory)
    *_, last = run
    if not run.outcome.done:
        raise RuntimeError(run.message)
    return Ended(last.state, Wrinkling(last.state), run.cost.expansions)


# report --------------------------------------------------------------------------

FULL, COARSE = Mesh((16, 16), 7.5e-3), Mesh((12, 12), 1e-2)

EASED = ((6e-4, 1.5e4, 7e3), (8e-4, 2.2e4, 1.5e4), (1e-3, 3.6e4, 2.5e4))
"""Crown (m), tension of the threaded strip and tension to which it is lowered (N/m)."""


def study(quick: bool = False) -> StudyReport:
    """Onset by crown and mesh; what friction adds on a crown, and on a roller out of line."""
    crowns, panels = _crown_sheet(EASED[:2] if quick else EASED, COARSE if quick else FULL)
    sheets = [crowns]
    sheets += [] if quick else [_mesh_sheet((COARSE, FULL, Mesh((20, 20), 6e-3)))]
    conveyed = (0.03, COARSE) if quick else (0.05, COARSE)
    sheets.append(_friction_sheet(*conveyed, (0.3,) if quick else (0.1, 0.3)))
    skewed = Mesh((10, 8), 2e-2) if quick else Mesh((14, 12), 1.2e-2)
    sheets.append(_skew_sheet(0.02 if quick else 0.04, skewed, quick))
    return StudyReport(
        name="roller_wrinkles",
        title="Wrinkles before a roller",
        data=crowns,
        sheets=tuple(sheets),
        figures={"roller_wrinkles.png": drawn(panels, "y (m)", "height")},
    )


def _row(found: Onset) -> tuple[Cell, ...]:
    share = found.wavelengths[1] / found.formula - 1.0
    return found.tension, found.compression, found.wavelengths[1], 100.0 * share


ONSET_COLUMNS = ("tension (N/m)", "compression (N/m)", "wavelength (m)", "off the formula (%)")


def _crown_sheet(
    eased: tuple[tuple[float, float, float], ...], mesh: Mesh
) -> tuple[Sheet, dict[str, list[Line]]]:
    rows: list[tuple[Cell, ...]] = []
    panels: dict[str, list[Line]] = {}
    for crown, tension, end in eased:
        found = onset(Crowned(crown, tension, mesh).eased(end))
        rows.append((1e3 * crown, *_row(found), found.tension / crown**2))
        panels[f"crown {1e3 * crown:g} mm: onset at {1e-3 * found.tension:.1f} kN/m"] = [
            Line("mode", *found.profile)
        ]
    columns = ("crown (mm)", *ONSET_COLUMNS, "tension / crown² (N/m³)")
    note = (
        f"{Crowned.width:g} m wide, {1e3 * Crowned.thickness:g} mm thick, mesh {mesh}. Nothing "
        "rubs; above the onset the strip is smooth."
    )
    return Sheet("Onset by crown", columns, tuple(rows), note), panels


def _mesh_sheet(meshes: tuple[Mesh, ...]) -> Sheet:
    crown, tension, end = EASED[1]
    rows = tuple((str(m), *_row(onset(Crowned(crown, tension, m).eased(end)))) for m in meshes)
    return Sheet("Three meshes", ("mesh", *ONSET_COLUMNS), rows, f"Crown {1e3 * crown:g} mm.")


def _friction_sheet(way: float, mesh: Mesh, coefficients: tuple[float, ...]) -> Sheet:
    """The same crown and tension: as threaded, and conveyed with friction."""
    case = Crowned(6e-4, 2e4, mesh)
    scenes = [(0.0, case.eased(case.tension))]
    scenes += [(f, case.conveyed(way, f)) for f in coefficients]
    rows: list[tuple[Cell, ...]] = []
    for friction, scene in scenes:
        found = ended(scene)
        before = found.wrinkling.spans[0]
        rows.append((friction, before.compression, before.bearable, *found.heights, found.lean,
                     found.tangents))  # fmt: skip
    columns = ("friction", "compression (N/m)", "bearable (N/m)", "height / t before", "behind",
               "lean / t", "tangents")  # fmt: skip
    note = (
        f"Crown {1e3 * case.crown:g} mm, {1e-3 * case.tension:g} kN/m, mesh {mesh}: as threaded, "
        f"and conveyed by {way:g} m. Before the roller; lean is what both sides differ by."
    )
    return Sheet("Friction on a crown", columns, rows=tuple(rows), note=note)


def _skew_sheet(way: float, mesh: Mesh, quick: bool) -> Sheet:
    cases = [(5e-3, 0.0), (5e-3, 0.3)] if quick else [
        (5e-3, 0.0), (5e-3, 0.1), (2.5e-3, 0.3), (5e-3, 0.3), (1e-2, 0.3)
    ]  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for yaw, friction in cases:
        found = ended(Skewed(yaw, 1e4, mesh).conveyed(way, friction))
        before = found.wrinkling.spans[0]
        rows.append((1e3 * yaw, friction, before.compression, before.bearable, found.heights[0],
                     found.tangents))  # fmt: skip
    columns = ("yaw (mrad)", "friction", "compression (N/m)", "bearable (N/m)", "height / t",
               "tangents")  # fmt: skip
    note = (
        f"{Skewed.width:g} m wide, {1e3 * Skewed.thickness:g} mm thick, 10 kN/m, mesh {mesh}: as "
        f"threaded, and with friction conveyed by {way:g} m. Before the roller."
    )
    return Sheet("A roller out of line", columns, tuple(rows), note)
