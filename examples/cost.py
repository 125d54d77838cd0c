"""Seconds per expansion of the capstan at 80 × 10 elements, split by what they are spent on.

Expected: one factorisation per expansion, and a series that costs less than the tangent, the
factorisation and the back-substitutions together (0.7 of them).
"""

from __future__ import annotations

import argparse
from itertools import islice
from pathlib import Path

from anmstrip import Scene

SCENE = Path(__file__).parent / "capstan.toml"


def main(cells: tuple[int, int], expansions: int) -> None:
    """Take the first steps of the scene and print where the time went."""
    along, across = cells
    sizes = [f"strip.cells=[{along}, {across}]", f"strip.refined={4.0 / along}"]
    run = Scene.load(SCENE, [*sizes, "solver.tolerance=1e-6"]).run()
    steps = list(islice(run, expansions))
    cost = run.cost
    print(f"{run.assembly.strip.unknowns} unknowns, {along} × {across} elements, order 20")
    print(f"{len(steps)} steps, {cost.expansions} expansions, {cost.factorisations} factorisations")
    for phase, seconds in cost.seconds.items():
        print(f"{phase:20s} {seconds / cost.expansions:8.4f} s per expansion")
    algebra = sum(cost.seconds[k] for k in ("tangent", "factorisation", "back-substitution"))
    ratio = cost.seconds["series"] / algebra
    print(f"series / (tangent + factorisation + back-substitution) = {ratio:.2f}")
    assert cost.expansions == cost.factorisations


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a small mesh, a few steps")
    quick = parser.parse_args().quick
    main((20, 4) if quick else (80, 10), 5 if quick else 20)
