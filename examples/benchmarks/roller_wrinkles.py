"""Wrinkles before a roller that turns and rubs: what friction adds on a crown, and out of line.

*Crown.*  The roller brings more strip to its middle; the compression grows with the way, and a
strip that is pulled harder and harder while it runs wrinkles at a lower tension than one that may
slide, over lesser crowns too.

*Out of line.*  What sticks is carried to the side by the yaw ψ times the way w: a shear force
N_xy ∝ ψ w, whatever the tension is.  N_xy² / T reaches 2 q √(D T) at a tension T ∝ (ψ w)^(4/3),
below which the strip wrinkles; it falls faster with ψ where so low a tension lets the strip slip.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from anmstrip.driver.scene import Scene
from anmstrip.results.wrinkles import buckling
from figures import Line, Map, drawn, mapped
from harness import Cell, Report, Sheet, main
from wrinkling import ONSET, SPEED, Crowned, Ended, Mesh, Onset, Skewed, ended, onset, onsets

THICK = 4e-4
"""Of the strip that is pulled harder and harder (m)."""

SMOOTH = Crowned(8e-4, 6e3, Mesh((8, 12), 2e-2), THICK)
"""Over a crown that makes no wrinkles without friction, at any tension."""

PULLED, HARDEST = 2.5e3, 9e3
"""Tension when threaded, and in the end, of a strip that is pulled harder and harder (N/m)."""

LEVELS = (1.05, ONSET)
"""Growth of the compression: near the onset, and what is called so.

A strip leans into wrinkles to which the crown has bent it and may stay between both for long.
"""

RUN = 0.1
"""Way (m) at constant tension, and again while the strip is pulled harder."""

# A crown -------------------------------------------------------------------------


def pulled(case: Crowned, friction: float) -> Scene:
    """Return a strip pulled harder: conveyed with friction, or frictionless."""
    case = replace(case, tension=PULLED)
    return case.conveyed(RUN, friction, HARDEST) if friction else case.eased(HARDEST)


def onset_sheet(cases: tuple[tuple[float, Mesh, float], ...]) -> Sheet:
    """Return the tension at which a strip wrinkles as it rises, by crown (m), mesh and friction."""
    rows: list[tuple[Cell, ...]] = []
    for crown, mesh, friction in cases:
        case = replace(SMOOTH, crown=crown, mesh=mesh)
        rows.append((1e3 * crown, str(mesh), friction, *_levels(pulled(case, friction))))
    columns = ("crown (mm)", "mesh", "friction", f"tension at {LEVELS[0]} (N/m)",
               "compression (N/m)", "wavelength (m)", "where", f"tension at {LEVELS[1]} (N/m)",
               "where")  # fmt: skip
    note = (
        f"{1e3 * THICK:g} mm thick, pulled by {1e-3 * PULLED:g} to {1e-3 * HARDEST:g} kN/m; with "
        f"friction conveyed by {RUN:g} m first, and by as much meanwhile. Where the compression "
        "would have to grow by these factors for the strip to buckle."
    )
    return Sheet("Onset by crown with friction", columns, tuple(rows), note)


def _levels(scene: Scene) -> Iterator[Cell]:
    near, found = onsets(scene, LEVELS)
    if near is None:
        yield from (None,) * 4
    else:
        yield from (near.tension, near.compression, near.wavelengths[1], _side(near))
    yield from (None, None) if found is None else (found.tension, _side(found))


def _side(found: Onset) -> str:
    """The strip runs over a crown from its exit to its entry."""
    return "behind" if found.place.startswith("the entry") else "before"


FRICTION_COLUMNS = (
    "crown (mm)", "tension (kN/m)", "friction", "way (m)", "factor", "compression (N/m)",
    "height / t before", "behind", "lean / t", "tangents", "outcome",
)  # fmt: skip


def friction_sheet(cases: tuple[tuple[float, float], ...], friction: float, way: float) -> Sheet:
    """The same crowns and tensions: as threaded, and conveyed with friction."""
    rows: list[tuple[Cell, ...]] = []
    for crown, tension in cases:
        case, head = replace(SMOOTH, crown=crown, tension=tension), (1e3 * crown, 1e-3 * tension)
        rows.append((*head, 0.0, *_pressed(case.eased(tension), 0.0)))
        rows.append((*head, friction, *_pressed(case.conveyed(way, friction), way)))
    note = (
        f"{1e3 * THICK:g} mm thick, mesh {SMOOTH.mesh}: as threaded, and conveyed. By the factor "
        "the compression would have to grow for the strip to buckle. Before the roller, which is "
        "towards the exit, and behind it. Lean is what both sides differ by."
    )
    return Sheet("Friction on a crown", FRICTION_COLUMNS, rows=tuple(rows), note=note)


def _pressed(scene: Scene, way: float) -> tuple[Cell, ...]:
    """Return the way that the strip has come, and the columns after that."""
    found = ended(scene)
    compression, (behind, *_, height) = found.wrinkling.spans[-1].compression, found.heights
    wrinkles = (found.factor, compression, height, behind, found.lean)
    return _gone(scene, found, way), *wrinkles, found.tangents, found.outcome.value


def _gone(scene: Scene, found: Ended | Onset, way: float) -> float:
    """The part of a way (m) that it has come."""
    missing = sum(stage.duration for stage in scene.course) - found.state.time
    return round(way - SPEED * missing, 4) if way else 0.0


def height_sheet(crown: float, frictions: tuple[float, ...]) -> Sheet:
    """Return the heights of wrinkles of a strip that was pulled harder and harder."""
    rows: list[tuple[Cell, ...]] = []
    for friction in frictions:
        scene = pulled(replace(SMOOTH, crown=crown), friction)
        rows.append((friction, *_pressed(scene, 2.0 * RUN if friction else 0.0)))
    note = f"Crown {1e3 * crown:g} mm, pulled as above, at {1e-3 * HARDEST:g} kN/m."
    return Sheet("Heights with friction", FRICTION_COLUMNS[2:], tuple(rows), note)


# Out of line ---------------------------------------------------------------------


def skew_sheet(cases: tuple[tuple[float, float], ...], way: float, mesh: Mesh) -> Sheet:
    """Return heights by yaw (rad) and friction."""
    rows: list[tuple[Cell, ...]] = []
    for yaw, friction in cases:
        scene = Skewed(yaw, 1e4, mesh).conveyed(way, friction)
        found = ended(scene)
        before, gone = found.wrinkling.spans[0], _gone(scene, found, way if friction else 0.0)
        rows.append((1e3 * yaw, friction, gone, before.compression, before.bearable,
                     found.heights[0], found.tangents, found.outcome.value))  # fmt: skip
    columns = ("yaw (mrad)", "friction", "way (m)", "compression (N/m)", "bearable (N/m)",
               "height / t", "tangents", "outcome")  # fmt: skip
    note = (
        f"{Skewed.width:g} m wide, {1e3 * Skewed.thickness:g} mm thick, 10 kN/m, mesh {mesh}: as "
        f"threaded, and with friction conveyed by {way:g} m. Before the roller."
    )
    return Sheet("A roller out of line", columns, tuple(rows), note)


TAKEN = 0.05
"""Longest way (m) in which wrinkles are waited for."""

LIKENED = 0.04
"""Way (m) that tensions at the onset are compared for."""


def askew(case: Skewed, friction: float, way: float = TAKEN) -> tuple[Onset | None, float]:
    """Return the state in which the strip is about to buckle, and the way (m) until then."""
    scene = case.conveyed(way, friction)
    (found,) = onsets(scene, LEVELS[:1])
    return found, way if found is None else _gone(scene, found, way)


def likened(tension: float, way: float) -> float:
    """Return the tension of the onset (N/m) after the same way for all, by T ∝ w^(4/3)."""
    return tension * float(LIKENED / way) ** (4.0 / 3.0)


def yaw_sheet(
    cases: tuple[tuple[float, float, float], ...], mesh: Mesh
) -> tuple[Sheet, dict[str, Map]]:
    """The onset by yaw (rad), tension (N/m) and friction, with the modes."""
    rows: list[tuple[Cell, ...]] = []
    maps: dict[str, Map] = {}
    for yaw, tension, friction in cases:
        case = Skewed(yaw, tension, mesh)
        found, way = askew(case, friction)
        (free,), _ = buckling(ended(case.conveyed(way, 0.0)).state, 1)
        head = (1e3 * yaw, tension, friction, float(free))
        if found is None:
            rows.append((*head, *(None,) * 7))
            continue
        wave, angle = found.crests
        bearable = found.wrinkling.spans[0].bearable
        rows.append((*head, way, found.compression, bearable, found.count, wave,
                     np.degrees(angle), likened(tension, way)))  # fmt: skip
        maps[f"{1e3 * yaw:g} mrad, {1e-3 * tension:g} kN/m, {1e3 * way:.0f} mm"] = Map(*found.map)
    columns = ("yaw (mrad)", "tension (N/m)", "friction", "factor, nothing rubs", "way (m)",
               "compression (N/m)", "bearable (N/m)", "crests", "wavelength (m)", "angle (°)",
               f"tension at {LIKENED:g} m (N/m)")  # fmt: skip
    note = (
        f"Mesh {mesh}. Conveyed at constant tension, at most by {TAKEN:g} m, until the compression "
        f"would have to grow by {LEVELS[0]} for the strip to buckle; beside it this factor where "
        "nothing rubs. "
        "Crests and troughs, their wavelength, and their angle to the strip. In the last column "
        f"the tension below which it wrinkles within {LIKENED:g} m, by T ∝ way^(4/3)."
    )
    return Sheet("Onset out of line with friction", columns, tuple(rows), note), maps


FULL, COARSE = Mesh((16, 16), 7.5e-3), Mesh((12, 12), 1e-2)

SKEWED = Mesh((14, 12), 1.2e-2)
"""Of strips over a roller out of line."""

CONES = 0.4
"""Length of the cylinder between conical sides (m)."""

EASED = ((6e-4, 1.5e4, 7e3), (8e-4, 2.2e4, 1.5e4), (1e-3, 3.6e4, 2.5e4))
"""Crown (m), tension of the threaded strip and tension to which it is lowered (N/m)."""

HELD = ((8e-4, 6e3), (1e-3, 6e3))
"""Crown (m) and tension (N/m) of strips that are conveyed with friction at constant tension."""

PULLED_CASES = (
    *((crown, SMOOTH.mesh, friction)
      for friction in (0.0, 0.3) for crown in (1e-3, 1.2e-3, 1.4e-3, 1.6e-3)),
    (1.4e-3, Mesh((8, 10), 2.5e-2), 0.3),
    (1.4e-3, Mesh((10, 14), 1.6e-2), 0.3),
)  # fmt: skip
"""Crown (m), mesh and friction of strips that are pulled harder and harder."""

YAWS = ((5e-3, 0.0), (5e-3, 0.1), (5e-3, 0.3), (1e-2, 0.3))
"""Yaw (rad) and friction of strips that are conveyed under one tension."""

ASKEW = (
    (2.5e-3, 5.3e3, 0.3), (5e-3, 1.9e4, 0.3), (7.5e-3, 3.6e4, 0.3), (1e-2, 5.7e4, 0.3),
    (1e-2, 1e4, 0.1),
)  # fmt: skip
"""Yaw (rad), tension (N/m) and friction of strips that are conveyed until they wrinkle."""


def study(quick: bool = False) -> Report:
    """Find onsets by crown and mesh, and what friction adds on a crown and out of line."""
    crowns, panels = _crown_sheet(EASED[:2] if quick else EASED, COARSE if quick else FULL)
    sheets = [crowns]
    sheets += [] if quick else [_mesh_sheet((COARSE, FULL, Mesh((20, 20), 6e-3)))]
    sheets.append(_rise_sheet((1e-3, 1.6e-3) if quick else (1.2e-3, 1.4e-3, 1.6e-3, 2e-3)))
    rubbed, maps = _rubbed(quick)
    return Report(
        name="roller_wrinkles",
        title="Wrinkles before a roller",
        data=crowns,
        sheets=(*sheets, *rubbed),
        figures={
            "roller_wrinkles.png": drawn(panels, "y (m)", "height"),
            "roller_wrinkles_askew.png": mapped(maps, "x (m)", "y (m)"),
        },
    )


def _rubbed(quick: bool) -> tuple[list[Sheet], dict[str, Map]]:
    """Return sheets of what friction adds, and modes on a roller out of line."""
    mesh = Mesh((10, 8), 2e-2) if quick else SKEWED
    askew, maps = yaw_sheet(((1e-2, 1e4, 0.3),) if quick else ASKEW, mesh)
    if quick:
        way, held, yaws = 0.03, ((8e-4, 6e3),), ((5e-3, 0.0), (5e-3, 0.3))
        return [friction_sheet(held, 0.3, way), skew_sheet(yaws, 0.02, mesh), askew], maps
    return [
        friction_sheet(HELD, 0.3, 0.15),
        onset_sheet(PULLED_CASES),
        height_sheet(1.2e-3, (0.0, 0.15, 0.3)),
        skew_sheet(YAWS, 0.04, mesh),
        askew,
    ], maps


def _row(found: Onset) -> tuple[Cell, ...]:
    share = found.wavelengths[1] / found.formula - 1.0
    return found.tension, found.compression, found.wavelengths[1], 100.0 * share


ONSET_COLUMNS = ("tension (N/m)", "compression (N/m)", "wavelength (m)", "off the formula (%)")


@cache
def _eased(crown: float, tension: float, mesh: Mesh, end: float) -> Onset:
    """Return the onset of a strip whose tension is lowered."""
    return onset(Crowned(crown, tension, mesh).eased(end))


def _crown_sheet(
    eased: tuple[tuple[float, float, float], ...], mesh: Mesh
) -> tuple[Sheet, dict[str, list[Line]]]:
    rows: list[tuple[Cell, ...]] = []
    panels: dict[str, list[Line]] = {}
    for crown, tension, end in eased:
        found = _eased(crown, tension, mesh, end)
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
    rows = tuple((str(mesh), *_row(_eased(crown, tension, mesh, end))) for mesh in meshes)
    return Sheet("Three meshes", ("mesh", *ONSET_COLUMNS), rows, f"Crown {1e3 * crown:g} mm.")


def risen(case: Crowned, tension: float) -> Onset | None:
    """Return the onset of a strip that is pulled harder, if it wrinkles."""
    try:
        return onset(case.eased(tension))
    except ValueError:
        return None


def _rise_sheet(crowns: tuple[float, ...]) -> Sheet:
    """Return onsets from below, over parabolas and over conical sides."""
    rows: list[tuple[Cell, ...]] = []
    for flat, profile in ((None, "parabola"), (CONES, "conical sides")):
        for crown in crowns:
            found = risen(Crowned(crown, 2.5e3, COARSE, THICK, flat), 1e4)
            row = (None,) * len(ONSET_COLUMNS) if found is None else _row(found)
            rows.append((profile, 1e3 * crown, *row))
    columns = ("profile", "crown (mm)", *ONSET_COLUMNS)
    note = (
        f"{1e3 * THICK:g} mm thick, pulled by 2.5 to 10 kN/m, mesh {COARSE}. Nothing rubs; below "
        "the onset, or without one, the strip is smooth. Conical sides begin "
        f"{0.5 * CONES:g} m from the middle and are as much thinner at the strip's edges."
    )
    return Sheet("Onset as the tension rises", columns, tuple(rows), note)


if __name__ == "__main__":
    main(study)
