"""Wrinkles before a roller that is crowned, and before one that is out of line.

A strip of 1 m × 0.2 mm over a roller that is 0.8 mm thinner at the strip's edges: smooth at 22
kN/m, and as the tension is lowered, about to wrinkle at 18.0 kN/m, 0.16 m apart, as
2 √π (D/T)^(1/4) √L says within 2 %.  A strip of 0.5 m × 0.1 mm that is led straight onto a roller
5 mrad out of line: with friction it is carried to the side, sheared, and after 0.03 m it wrinkles
askew, 2.0 thicknesses high after 0.04 m; without friction it stays smooth.  The second is written
for ParaView, with a picture of the moment across.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from anmstrip.pictures.render import render
from anmstrip.studies.roller_wrinkles import COARSE, EASED, FULL
from anmstrip.studies.wrinkle_onset import ended, onset
from anmstrip.studies.wrinkling_scenes import Crowned, Mesh, Skewed


def crowned(mesh: Mesh) -> None:
    """Onset over a crown."""
    crown, tension, end = EASED[1]
    found = onset(Crowned(crown, tension, mesh).eased(end))
    wave = found.wavelengths[1]
    print(f"crown {1e3 * crown:g} mm: wrinkles below {found.tension:.0f} N/m, {wave:.4f} m apart, "
          f"by the formula {found.formula:.4f} m")  # fmt: skip
    assert abs(wave / found.formula - 1.0) < 0.1


def skewed(mesh: Mesh, way: float, directory: Path) -> None:
    """Heights without and with friction."""
    strip = Skewed(5e-3, 1e4, mesh)
    smooth, rubbed = ended(strip.conveyed(way, 0.0)), ended(strip.conveyed(way, 0.3), directory)
    for name, found in (("without", smooth), ("with", rubbed)):
        print(f"{name} friction: {found.heights[0]:.3f} t high")
    for warning in rubbed.wrinkling.warnings:
        print(warning)
    print(*render(directory, "bending_moment.yy"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarse meshes, a shorter way")
    parser.add_argument("-o", type=Path, default=Path("results/roller_wrinkles"), help="where to")
    given = parser.parse_args()
    crowned(COARSE if given.quick else FULL)
    if given.quick:
        skewed(Mesh((8, 6), 2e-2), 0.01, given.o)
    else:
        skewed(Mesh((14, 12), 1.2e-2), 0.04, given.o)
