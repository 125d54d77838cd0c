"""Where rollers are and how they turn at the instants of the written states, by the scenes."""

from __future__ import annotations

import numpy as np
from reported_files import Results, Surface
from reported_rollers import Law, Look, Shape

SLANTED = float(np.hypot(1.0e4, 5773.5))
"""Largest edge force of the section that is wrapped (N/m)."""

NARROW = Law(SLANTED, graded=(2.0e4, 1.0e-4), exponent=0.05, speed=0.1)
WIDE = Law(1.0e4, graded=(2.0e4, 2.0e-4), exponent=0.1, speed=1.0e-3)

SHAPES: dict[str, dict[str, Shape]] = {
    "turning": {"r1": Shape(0.5, (0.0, 0.0, -0.501), friction=0.3, law=NARROW)},
    "shell": {
        "front": Shape(
            0.5, (0.0, 0.1, -0.5), (0.006, 2.0, 0.004), (1.0e-5, -2.0e-4), friction=0.3, law=WIDE
        ),
        "back": Shape(0.4, (1.3, 0.0, -1.2), friction=0.2, law=WIDE, sense=-1),
    },
    "plate": {"r1": Shape(0.5, (0.0, 0.0, -0.501), law=Law(1e4, penalty=(1.0e9, 10.0, 1.0e-3)))},
    "lifted": {"r": Shape(0.5, (0.0, 0.0, -0.52), law=Law(1e4, penalty=(1.0e10, 10.0, 1.0e-3)))},
}

SHAPES["thin"] = {
    "front": Shape(0.5, (0.0, 0.1, -0.5), (0.006, 2.0, 0.004), (0.0, -2.0e-3), 0.3, law=WIDE),
    "back": SHAPES["shell"]["back"],
}


def looks_at(results: Results, surface: Surface) -> dict[str, Look]:
    """Every roller of a run beside a written state."""
    name, time = results.name, surface.time
    shapes = SHAPES[name]
    if name == "turning":
        share = max(time - 2.5, 0.0) / 0.4
        full, rubs = np.array([0.01, 0.0, 0.02]), time > 2.5
        velocity = full / 0.4 if rubs else np.zeros(3)
        return {"r1": Look(surface, shapes["r1"], share * full, share * 1.0, velocity, rubs)}
    if name in ("shell", "thin"):
        share, rubs = max(time - 2.0, 0.0) / 0.1, time > 2.0
        speeds = {"front": 0.002 * share, "back": 0.0004 * share}
        return {n: Look(surface, s, speed=speeds[n], rubs=rubs) for n, s in shapes.items()}
    if name == "plate":
        move = np.array([0.0, 0.0, 0.011 * max(time - 1.0, 0.0)])
        return {"r1": Look(surface, shapes["r1"], move)}
    lift = np.interp(time, [1.0, 2.0, 3.0], [0.0, 0.1, 0.0])
    return {"r": Look(surface, shapes["r"], np.array([0.0, 0.0, lift]))}
