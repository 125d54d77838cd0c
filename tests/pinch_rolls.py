"""Pinch rolls that hold different tensions of a strip between them."""

from __future__ import annotations

from typing import Any

DRAWN: dict[str, Any] = {
    "strip": {"kinematics": "section", "width": 1.0, "thickness": 1e-3},
    "material": {"young": 2e11, "poisson": 0.3},
    "contact": {"faces": True},
    "friction": {"coefficient": 0.2},
    "threading": {"tension": 4e3, "entry": [-1.0, 0.0, 0.0], "exit": [1.0, 0.0, 0.0]},
    "rollers": [
        {"name": "lower", "radius": 0.1, "centre": [0.0, 0.0, -0.1005], "wrap": "over"},
        {"name": "upper", "radius": 0.1, "centre": [0.0, 0.0, 0.1005]},
    ],
    "edges": {"entry": {"fixed": ["x", "z"]}, "exit": {"fixed": ["z"]}},
    "stages": [
        {
            "name": "run", "steady": True,
            "entry": {"tension": 5e3}, "exit": {"tension": 4e3},
            "rollers": {"lower": {"surface_speed": 1.0}, "upper": {"surface_speed": 1.0}},
        },
    ],
}  # fmt: skip
"""Driven pinch rolls whose gap is drawn as wide as the strip is thick."""
