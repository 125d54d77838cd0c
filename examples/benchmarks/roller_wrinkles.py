"""Strips that wrinkle before a roller: over a crown, or out of line; and what friction adds.

*Crown.*  The middle goes a longer way than the edges and carries more; away from the roller the
tension spreads again to the width of the strip.  That takes compression across, which comes from
the crown whatever the tension is, once the strip lies on all of the roller, while it is tension
that holds the strip smooth.  So it wrinkles where the tension falls below an onset, which grows
with the square of the crown: the strip bears 2 q √(D T).  At low tension it lies on the middle of
the roller alone, compression is a share of the tension, and there is another onset, above which it
wrinkles: T against √(D T) makes it depend on D, and hardly on the crown.  A lesser crown than that
at which both meet makes no wrinkles at any tension.  A roller that turns and rubs brings more strip
to where its surface goes, towards the middle, and the compression grows with the way.

*Out of line.*  A strip that may slide does so, and nothing happens.  One that sticks is carried to
the side and sheared: N_xy² / T is compression across, and wrinkles lie askew.
"""

from __future__ import annotations

from functools import cache

from figures import Line, Map, drawn, mapped
from harness import Cell, Report, Sheet, main
from rubbed_wrinkles import (
    SMOOTH,
    THICK,
    friction_sheet,
    height_sheet,
    onset_sheet,
    skew_sheet,
    yaw_sheet,
)
from wrinkle_onset import Onset, onset
from wrinkling_scenes import Crowned, Mesh

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
    """Onset by crown and mesh; what friction adds on a crown, and on a roller out of line."""
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
    """Sheets of what friction adds, and modes on a roller out of line."""
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
    """Where a strip wrinkles whose tension is lowered."""
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
    """Where a strip that is pulled harder begins to wrinkle, if it does."""
    try:
        return onset(case.eased(tension))
    except ValueError:
        return None


def _rise_sheet(crowns: tuple[float, ...]) -> Sheet:
    """Onset from below, over parabolas and over conical sides."""
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
