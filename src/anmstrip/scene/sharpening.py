"""``friction.regularisation = "auto"``: the laws are sharpened until that is no more seen.

The scene is run with its laws as they are given; what their regularisation costs in truth is
read off at the end of every stage, and the scene is run again with sharper ones until its
estimated effect on the tensions is below the tolerance.  Each part has its own remedy: a smaller
V_c for the creep of what sticks, a smaller exponent for friction beyond the cone, a stiffer
contact and a smaller η for penetration.  How much is needed follows from the estimate, so that
one or two more runs do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.regularisation import Regularisation
from anmstrip.scene.run import Run, Step
from anmstrip.scene.schema import Scene

MOST_RUNS = 6

AIM = 0.2
"""Share of the tolerance that each of the three parts is aimed at."""

LEAST_EXPONENT, LEAST_OMEGA_SPEED, STIFFEST = 1e-7, 1e-13, 1e14
"""Sharpest laws: q, ω V_c (m/s) near the last digit of positions, and K (Pa/m)."""


@dataclass(frozen=True)
class Pass:
    """One run on the way.

    Attributes
    ----------
    exponent, speed, stiffness, eta : float
        q, V_c (m/s), K (Pa/m) and η (Pa) that it was done with.
    effect : float
        Largest estimated effect of the regularisation on a tension.
    tangents : int
    """

    exponent: float
    speed: float
    stiffness: float
    eta: float
    effect: float
    tangents: int


def _not_resumed(scene: Scene) -> InputError:
    key, expected = "friction.regularisation", '"fixed": each run depends on the one before it'
    file = str(scene.source or "scene")
    return InputError([Mistake(file, key, "auto", expected, "the same without --resume")])


class SharpenedRun(Run):
    """A run of a scene that is repeated with sharper laws; results are those of the last one.

    It is not resumed.

    Attributes
    ----------
    passes : list of Pass
    """

    def __init__(self, scene: Scene, directory: str | Path | None = None, resume: bool = False):
        if resume:
            raise _not_resumed(scene)
        super().__init__(scene, directory)
        self.passes: list[Pass] = []
        self.worst: list[Regularisation] = []

    def __iter__(self) -> Iterator[Step]:
        while True:
            self.worst, reached = [], -1
            for step in super().__iter__():
                if step.state.plan.in_time and self.state is not None:
                    reached = self._watched(reached)
                yield step
            if not self.outcome.done or self._is_sharp():
                return
            passes, sharper = self.passes, self._sharpened()
            super().__init__(sharper, self.directory)
            self.passes = passes

    def _watched(self, reached: int) -> int:
        """Keep what the latest state of each stage says."""
        assert self.state is not None
        del self.worst[
            len(self.worst) - (reached == self.first_stage) * len(self.assembly.rollers) :
        ]
        self.worst += self.state.regularisation.values()
        return self.first_stage

    def facts(self) -> dict[str, Any]:
        """Counters of the run, and what was done to sharpen its laws."""
        return {**super().facts(), "sharpened": [vars(done) for done in self.passes]}

    @property
    def effect(self) -> float:
        """Largest effect in any stage."""
        return max((cost.effect for cost in self.worst), default=0.0)

    def _is_sharp(self) -> bool:
        """Count this run, and say whether it is good enough, or the last that makes sense."""
        f, c, spent = self.scene.friction, self.scene.contact, self.cost.expansions
        assert f is not None and c is not None
        done = Pass(f.exponent, f.speed, c.stiffness, c.eta, self.effect, spent)
        self.passes.append(done)
        tolerance = self.scene.solver.tolerance
        sharp = done.effect <= tolerance
        last = len(self.passes) == MOST_RUNS or self._tables() == self._sharper()
        words = "below" if sharp else "above"
        self.message += (
            f" Regularisation changes tensions by about {done.effect:.1g}, {words} the tolerance "
            f"of {tolerance:g}, with q = {f.exponent:.2g}, V_c = {f.speed:.2g} m/s, "
            f"K = {c.stiffness:.2g} Pa/m and η = {c.eta:.2g} Pa after {len(self.passes)} run(s)."
        )
        if sharp or last:
            self._finish()
        return sharp or last

    def _tables(self) -> dict[str, dict[str, float]]:
        f, c = self.scene.friction, self.scene.contact
        assert f is not None and c is not None
        return {
            "friction": {"exponent": f.exponent, "speed": f.speed},
            "contact": {"stiffness": c.stiffness, "eta": c.eta},
        }

    def _sharper(self) -> dict[str, dict[str, float]]:
        """Laws that bring every part of the effect to its share of the tolerance."""
        assert self.scene.friction is not None
        now, goal = self._tables(), AIM * self.scene.solver.tolerance
        creep, cone, depth = (
            min(1.0, goal / max([1e-300, *(getattr(cost, part) for cost in self.worst)]))
            for part in ("by_creep", "by_cone", "by_penetration")
        )
        f, c = now["friction"], now["contact"]
        least = LEAST_OMEGA_SPEED / self.scene.friction.omega
        return {
            "friction": {
                "exponent": max(f["exponent"] * cone, min(f["exponent"], LEAST_EXPONENT)),
                "speed": max(f["speed"] * creep, min(f["speed"], least)),
            },
            "contact": {
                "stiffness": min(c["stiffness"] / depth, max(c["stiffness"], STIFFEST)),
                "eta": c["eta"] * depth,
            },
        }

    def _sharpened(self) -> Scene:
        tables, sharper = self.scene.to_dict(), self._sharper()
        for table, values in sharper.items():
            tables[table].update({key: float(np.float64(v)) for key, v in values.items()})
        scene = Scene.model_validate(tables)
        scene._source = self.scene.source
        return scene
