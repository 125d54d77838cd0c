"""Friction laws sharpened until their regularisation is no longer seen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.driver.run import Run
from anmstrip.errors import InputError, Mistake
from anmstrip.results.rollers import Regularisation
from anmstrip.scene.schema import SceneSpec
from anmstrip.simulation.march import Step
from anmstrip.simulation.problem import EffectMaker

MOST_RUNS = 6

AIM = 0.2
"""Share of the tolerance that each of the three parts is aimed at."""

CONSTANTS = {
    "exponent": ("friction", "q = {:.2g}", "by_cone", 1e-7),
    "speed": ("friction", "V_c = {:.2g} m/s", "by_creep", 1e-13),
    "stiffness": ("contact", "K = {:.2g} Pa/m", "by_penetration", 1e14),
    "eta": ("contact", "η = {:.2g} Pa", "by_penetration", 0.0),
    "onset": ("contact", "an onset of {:.2g} m", "by_penetration", 0.0),
}
"""Table of each constant that is sharpened, how it is written, the effect that goes with it, and
its sharpest value; ω V_c instead of V_c, near the last digit of positions."""


class SharpenedRun(Run):
    """A run of a scene that is repeated with sharper laws; results are those of the last one.

    It is not resumed.

    Attributes
    ----------
    passes : list of dict
        Constants of the laws of every run, the largest estimated ``effect`` of its regularisation
        on a tension, and its ``tangents``.
    """

    def __init__(
        self,
        scene: SceneSpec,
        directory: str | Path | None = None,
        resume: bool = False,
        effects: Iterable[EffectMaker] = (),
    ) -> None:
        if resume:
            file, key = str(scene.source or "scene"), "friction.regularisation"
            expected = '"fixed": each run depends on the one before it'
            raise InputError([Mistake(file, key, "auto", expected, "the same without --resume")])
        super().__init__(scene, directory, effects=effects)
        self.passes: list[dict[str, float]] = []
        self.costs: dict[str, list[Regularisation]] = {}

    def __iter__(self) -> Iterator[Step]:
        while True:
            self.costs = {}
            for step in super().__iter__():
                if step.state.plan.in_time:  # the last state of each stage stays
                    self.costs[step.stage] = list(step.state.regularisation.values())
                yield step
            if not self.outcome.done:
                return
            laws, sharper, tolerance = self.laws(), self.sharper(), self.scene.solver.tolerance
            done = {"effect": self.effect, "tangents": self.cost.expansions}
            self.passes.append({**laws, **done})
            *words, last = (CONSTANTS[key][1].format(value) for key, value in laws.items())
            sharp = self.effect <= tolerance
            self.message += (
                f" Regularisation changes tensions by about {self.effect:.1g}, "
                f"{'below' if sharp else 'above'} the tolerance of {tolerance:g}, with "
                f"{', '.join(words)} and {last} after {len(self.passes)} run(s)."
            )
            if sharp or len(self.passes) == MOST_RUNS or laws == sharper:
                self._finish()
                return
            tables, passes = self.scene.to_dict(), self.passes
            for key, value in sharper.items():
                tables[CONSTANTS[key][0]][key] = value
            scene = SceneSpec.model_validate(tables)
            scene._source = self.scene.source
            super().__init__(scene, self.directory, effects=self.assembly.added)
            self.passes = passes

    def facts(self) -> dict[str, Any]:
        """Return the counters of the run, and what was done to sharpen its laws."""
        return {**super().facts(), "sharpened": self.passes}

    @property
    def effect(self) -> float:
        """Largest effect in any stage."""
        return max((cost.effect for costs in self.costs.values() for cost in costs), default=0.0)

    def laws(self) -> dict[str, float]:
        """Return q and V_c (m/s), and K (Pa/m) and η (Pa) or the onset of contact (m)."""
        f, c = self.scene.friction, self.scene.contact
        assert f is not None and c is not None
        friction = {"exponent": f.exponent, "speed": f.speed}
        if c.constants is None:
            return {**friction, "onset": self.assembly.signorini.width}
        return {**friction, "stiffness": c.constants[0], "eta": c.constants[1]}

    def sharper(self) -> dict[str, float]:
        """Return laws that bring every part of the effect to its share of the tolerance."""
        assert self.scene.friction is not None
        goal, sharper = AIM * self.scene.solver.tolerance, {}
        every = [cost for costs in self.costs.values() for cost in costs]
        for key, value in self.laws().items():
            _, _, part, limit = CONSTANTS[key]
            factor = min(1.0, goal / max([1e-300, *(getattr(cost, part) for cost in every)]))
            limit = limit / self.scene.friction.omega if key == "speed" else limit
            least, most = sorted((value, limit))
            new = value / factor if key == "stiffness" else value * factor
            sharper[key] = float(np.clip(new, least, most))
        return sharper
