"""A sheet that wrinkles because it is stretched between two grips.

3.5 × 1, thickness 2e-4, ν = 0.45.  Expected: flat up to a strain of 0.00235, then wrinkles along
the pull, 0.202 apart at the onset and 0.149 at four times that strain, 13 thicknesses high.
Cerda and Mahadevan's 2 √π (D/T)^(1/4) √L gives these within 3 % when L is the length of the
wrinkles; with the length between the grips it gives 14 % more at the end.  The wrinkled quarter and
the buckling mode are written for ParaView.
"""

from __future__ import annotations  # noqa: I001

import argparse
from pathlib import Path

from anmstrip.continuation.expansion import Cost
from anmstrip.studies.shell_pictures import write_shape
from anmstrip.studies.wrinkles import Stretched, THIN, onset, sheet_of, wrinkled


def said(sheet: Stretched, label: str, wave: float, expected: float, strain: float) -> None:
    """Print a line, and check it."""
    print(f"{label} at strain {strain:.4f}: wavelength {wave:.4f}, formula {expected:.4f}")
    assert abs(wave / expected - 1.0) < 0.08


def main(cells: tuple[int, int], directory: Path) -> None:
    """Onset, then four times the strain."""
    sheet, cost = sheet_of(THIN, cells), Cost()
    point = onset(sheet)
    length, wave = sheet.wrinkled_length(point.mode), sheet.wavelength(point.mode)
    expected = sheet.formula(point.u, point.control, length)
    said(sheet, "onset", wave, expected, point.control * sheet.strain)
    *_, (u, control) = wrinkled(sheet, point, cost)
    expected = sheet.formula(u, control, sheet.wrinkled_length(u))
    said(sheet, "end", sheet.wavelength(u), expected, sheet.strain)
    print(f"{sheet.amplitude(u) / sheet.thickness:.2f} t high, {cost.factorisations} tangents")
    directory.mkdir(parents=True, exist_ok=True)
    write_shape(directory / "wrinkles.vtu", sheet.equations, u, {"mode": point.mode})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="14 × 18 elements of a quarter")
    parser.add_argument("-o", type=Path, default=Path("results/sheet"), help="where to write")
    given = parser.parse_args()
    main((14, 18) if given.quick else (16, 24), given.o)
