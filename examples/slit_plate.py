"""A slit annular plate, one side of the slit clamped, the other lifted by more than its radius.

Radii 6 and 10, thickness 0.03, E = 21e6, ν = 0, force 0.8 per length (Sze, Liu & Lo 2004, §3.3).
The elements lie in the plane of radius and angle, so that no edge is approximated.  Expected:
W = 13.843 inside and 17.481 outside, to 0.15 % with 5 × 40 elements, in 9 tangents of
order 20; Newton's method needs some 270 along the same arc.  The published table has 13.891 and
17.528, 0.35 and 0.27 % more.
"""

from __future__ import annotations

import argparse

import numpy as np

from anmstrip.studies.benchmarks import slit_plate
from anmstrip.studies.shell_runs import Followed, followed, settings


def main(cells: tuple[int, int], error: float) -> Followed:
    """Lift it and compare its corners."""
    found = followed(slit_plate(cells), settings())
    lifted = found.curve[-1, 1:]
    print(f"{cells} elements, {found.tangents} tangents, W = {lifted[0]:.3f}, {lifted[1]:.3f}")
    assert found.tangents <= 12
    assert np.abs(lifted / (13.843, 17.481) - 1.0).max() < error
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="3 × 24 elements")
    main(*(((3, 24), 8e-3) if parser.parse_args().quick else ((5, 40), 1.5e-3)))
