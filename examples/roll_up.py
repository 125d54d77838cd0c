"""A strip rolled up to a full circle by a moment at its end.

Length 12, width 1, thickness 0.1, E = 1.2e6, ν = 0 (Sze, Liu & Lo 2004, §3.2).  Without stretch
the tip follows U = L (sin θ/θ − 1), W = L (1 − cos θ)/θ with θ = M L/D.  Expected: at most 6
tangents of order 20 to the full circle, 4 with 16 elements, and 0.03 % off the formula.
"""

from __future__ import annotations

import argparse

import numpy as np

from anmstrip.studies.benchmarks import end_moment
from anmstrip.studies.shell_runs import Followed, followed, settings


def main(cells: int) -> Followed:
    """Roll it up and compare along the way."""
    found = followed(end_moment(cells), settings())
    angle = 2.0 * np.pi * np.linspace(0.05, 1.0, 20)
    exact = 12.0 * np.stack([1.0 - np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle])
    error = np.abs(found.at(angle / (2.0 * np.pi))[:, 1:].T - exact).max() / exact.max()
    print(f"{cells} elements, {found.tangents} tangents, {100 * error:.3f} % off the formula")
    assert found.tangents <= 6
    assert error < 1.5e-3
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="half the elements")
    main(8 if parser.parse_args().quick else 16)
