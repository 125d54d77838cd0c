"""Lines that several tests share, as tables."""

from __future__ import annotations

from typing import Any

SNUBBED: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 5e-4},
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {},
    "friction": {"coefficient": 0.25},
    "threading": {"tension": 8e3, "entry": [-2.0, 0.0, 0.0], "exit": [3.0, 0.0, 0.0]},
    "rollers": [{"name": "a", "radius": 0.25, "centre": [0.0, 0.0, 0.6], "wrap": "over"}],
    "edges": {"entry": {"fixed": ["x", "z"]}},
}
"""One driven roller of 40° over the strip; its stages are still to come."""
