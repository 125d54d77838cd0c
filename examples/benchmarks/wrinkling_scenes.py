"""Scenes of thin strips that wrinkle at a roller: crowned, or out of line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from anmstrip.driver.scene import Scene

SPEED = 0.5
"""Of a roller that turns, and of the strip on it (m/s)."""

EXPONENT, CREEP = 0.1, 1e-3
"""Of friction: q, and V_c (m/s)."""

ON_THE_WAY = 1e-3
"""Tolerance of scenes in time."""


@dataclass(frozen=True)
class Mesh:
    """Elements: along (off the roller) and across, and their length over the roller (m)."""

    cells: tuple[int, int]
    refined: float

    def __str__(self) -> str:
        return f"{self.cells[0]} × {self.cells[1]}, {1e3 * self.refined:g} mm"


@dataclass(frozen=True)
class Crowned:
    """A strip 1 m wide, 0.8 m of it before and behind a roller that is thicker in the middle.

    Attributes
    ----------
    crown : float
        By which the radius is smaller at the strip's edges than in the middle (m).
    tension : float
        Of the threaded strip (N/m).
    mesh : Mesh
    thickness : float
        m.
    flat : float, optional
        Length (m) of the cylinder in the middle, beside conical sides; left out: a parabola.
    """

    crown: float
    tension: float
    mesh: Mesh
    thickness: float = 2e-4
    flat: float | None = None

    width, radius, free, wrap = 1.0, 0.4, 0.8, np.radians(10.0)

    @property
    def profile(self) -> dict[str, Any]:
        """Of the roller."""
        half = 0.5 * self.width
        if self.flat is None:
            return {"crown": [0.0, -self.crown / half**2]}
        taper = self.crown / (half - 0.5 * self.flat)
        return {"sides": {"taper": taper, "flat": self.flat, "rounding": 0.1 * self.width}}

    def eased(self, tension: float, **strip: Any) -> Scene:
        """The tension is lowered, or raised; nothing rubs."""
        solver = {"tolerance": 1e-6, "order": 15}
        ease = {"name": "ease", "duration": 1.0, "exit": {"force": self._pull(tension)}}
        return self._scene([ease], strip, solver=solver)

    def conveyed(self, way: float, friction: float, pulled: float | None = None) -> Scene:
        """The roller takes the strip along by a way (m), 0.025 m of it to come to speed.

        Over another such way it is pulled harder, if that is given (N/m).  From exit to entry: the
        exit is pulled where it is held up, and the entry is drawn away as fast as the roller turns.
        """
        turn = {"rollers": {"r1": {"surface_speed": -SPEED}}}
        half = 0.5 * self.wrap
        away = {"velocity": [-SPEED * float(np.cos(half)), 0.0, -SPEED * float(np.sin(half))]}
        start = {"name": "start", "duration": 0.1, "entry": away, **turn}
        run = {"name": "run", "duration": way / SPEED - 0.05, **turn}
        stages = [{"name": "hold", "duration": 0.1}, start, run]
        if pulled is not None:
            harder = {"exit": {"force": self._pull(pulled)}, **turn}
            stages.append({"name": "pull", "duration": way / SPEED, **harder})
        return self._scene(stages, {}, **rubbing(friction))

    def _pull(self, tension: float) -> list[float]:
        """Force at the exit (N/m), which is held up."""
        return [float(tension * np.cos(0.5 * self.wrap)), 0.0, 0.0]

    def _scene(self, stages: list[dict[str, Any]], strip: dict[str, Any], **others: Any) -> Scene:
        half = 0.5 * self.wrap
        x = self.radius * np.sin(half) + self.free * np.cos(half)
        z = self.radius * (np.cos(half) - 1.0) - self.free * np.sin(half)
        roller = {"radius": self.radius, **self.profile}
        return _made(
            {"width": self.width, "thickness": self.thickness, **strip},
            self.mesh,
            roller,
            threading={"tension": self.tension, "entry": [-x, 0.0, z], "exit": [x, 0.0, z]},
            edges={"entry": {"fixed": ["x", "z"], "centred": True}, "exit": {"fixed": ["z"]}},
            stages=stages,
            **others,
        )


@dataclass(frozen=True)
class Skewed:
    """A strip 0.5 m wide and 0.1 mm thick, led straight for 0.6 m onto a roller out of line.

    It does not contract across (ν = 0), so that its entry can be held all along without any
    stress.

    Attributes
    ----------
    yaw : float
        Angle of the roller's axis, in the plane of the strip (rad).
    tension : float
        N/m.
    mesh : Mesh
    """

    yaw: float
    tension: float
    mesh: Mesh

    width, thickness, radius, before, behind, wrap = 0.5, 1e-4, 0.2, 0.6, 0.3, np.radians(40.0)

    def conveyed(self, way: float, friction: float) -> Scene:
        """Entry and roller take the strip along by a way (m), 0.005 m of it to come to speed.

        Without friction it is left where threading brings it.
        """
        turn = {"rollers": {"r1": {"surface_speed": SPEED}}}
        start = {"name": "start", "duration": 0.02, "entry": {"velocity": [SPEED, 0.0, 0.0]}}
        run = {"name": "run", "duration": way / SPEED - 0.01}
        if not friction:
            return self._scene([{"name": "rest", "duration": 1.0}])
        stages = [{"name": "hold", "duration": 0.02}, {**start, **turn}, run]
        return self._scene(stages, **rubbing(friction))

    def _scene(self, stages: list[dict[str, Any]], **others: Any) -> Scene:
        down, r = self.wrap, self.radius
        x = r * np.sin(down) + self.behind * np.cos(down)
        z = r * (np.cos(down) - 1.0) - self.behind * np.sin(down)
        ends = {"entry": [-self.before, 0.0, 0.0], "exit": [x, 0.0, z]}
        return _made(
            {"width": self.width, "thickness": self.thickness},
            self.mesh,
            {"radius": r, "axis": [self.yaw, 1.0, 0.0]},
            material={"young": 2e11, "poisson": 0.0},
            threading={"tension": self.tension, **ends},
            edges={"entry": {"fixed": ["x", "y", "z"]}},
            stages=stages,
            **others,
        )


def rubbing(friction: float) -> dict[str, Any]:
    """Tables of friction, and of what it takes to solve with it."""
    law = {"coefficient": friction, "exponent": EXPONENT, "speed": CREEP}
    return {"friction": law, "solver": {"tolerance": ON_THE_WAY}}


def _made(strip: dict[str, Any], mesh: Mesh, roller: dict[str, Any], **others: Any) -> Scene:
    """What both have in common: steel, contact, a roller below the origin."""
    own = {"name": "r1", "centre": [0.0, 0.0, -roller["radius"]], "wrap": "over", **roller}
    tables = {
        "strip": {**strip, "cells": mesh.cells, "refined": mesh.refined},
        "material": {"young": 2e11, "poisson": 0.3},
        "contact": {"stiffness": 1e9, "eta": 10.0, "delta": 1e-3},
        "rollers": [own],
    }
    return Scene.model_validate({**tables, **others})
