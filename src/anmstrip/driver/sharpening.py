"""Friction laws sharpened until their regularisation is no longer seen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anmstrip.driver.run import Run, Step
from anmstrip.errors import InputError, Mistake
from anmstrip.results.rollers import Regularisation
from anmstrip.scene.schema import SceneSpec

MOST_RUNS = 6

AIM = 0.2
"""Share of the tolerance that each of the three parts is aimed at."""

LEAST_EXPONENT, LEAST_OMEGA_SPEED, STIFFEST = 1e-7, 1e-13, 1e14
"""Sharpest laws: q, ω V_c (m/s) near the last digit of positions, and K (Pa/m)."""


Laws = dict[str, dict[str, float]]


@dataclass(frozen=True)
class Pass:
    """One run on the way.

    Attributes
    ----------
    laws : dict
        Table → keys and values that it was done with: q and V_c (m/s); K (Pa/m) and η (Pa), or
        the onset of contact (m).
    effect : float
        Largest estimated effect of the regularisation on a tension.
    tangents : int
    """

    laws: Laws
    effect: float
    tangents: int


def _not_resumed(scene: SceneSpec) -> InputError:
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

    def __init__(self, scene: SceneSpec, directory: str | Path | None = None, resume: bool = False):
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
        passes = [
            {**p.laws["friction"], **p.laws["contact"], "effect": p.effect, "tangents": p.tangents}
            for p in self.passes
        ]
        return {**super().facts(), "sharpened": passes}

    @property
    def effect(self) -> float:
        """Largest effect in any stage."""
        return max((cost.effect for cost in self.worst), default=0.0)

    def _is_sharp(self) -> bool:
        """Count this run, and say whether it is good enough, or the last that makes sense."""
        laws = self._tables()
        done = Pass(laws, self.effect, self.cost.expansions)
        self.passes.append(done)
        tolerance = self.scene.solver.tolerance
        sharp = done.effect <= tolerance
        last = len(self.passes) == MOST_RUNS or laws == self._sharper()
        words = "below" if sharp else "above"
        self.message += (
            f" Regularisation changes tensions by about {done.effect:.1g}, {words} the tolerance "
            f"of {tolerance:g}, with {_named(laws)} after {len(self.passes)} run(s)."
        )
        if sharp or last:
            self._finish()
        return sharp or last

    def _tables(self) -> Laws:
        f, c = self.scene.friction, self.scene.contact
        assert f is not None and c is not None
        if c.constants is None:
            contact = {"onset": self.assembly.signorini.width}
        else:
            contact = {"stiffness": c.constants[0], "eta": c.constants[1]}
        return {"friction": {"exponent": f.exponent, "speed": f.speed}, "contact": contact}

    def _sharper(self) -> Laws:
        """Laws that bring every part of the effect to its share of the tolerance."""
        assert self.scene.friction is not None
        now, goal = self._tables(), AIM * self.scene.solver.tolerance
        creep, cone, depth = (
            min(1.0, goal / max([1e-300, *(getattr(cost, part) for cost in self.worst)]))
            for part in ("by_creep", "by_cone", "by_penetration")
        )
        f = now["friction"]
        least = LEAST_OMEGA_SPEED / self.scene.friction.omega
        return {
            "friction": {
                "exponent": max(f["exponent"] * cone, min(f["exponent"], LEAST_EXPONENT)),
                "speed": max(f["speed"] * creep, min(f["speed"], least)),
            },
            "contact": _closer(now["contact"], depth),
        }

    def _sharpened(self) -> SceneSpec:
        tables, sharper = self.scene.to_dict(), self._sharper()
        for table, values in sharper.items():
            tables[table].update({key: float(np.float64(v)) for key, v in values.items()})
        scene = SceneSpec.model_validate(tables)
        scene._source = self.scene.source
        return scene


def _closer(contact: dict[str, float], depth: float) -> dict[str, float]:
    """A law of contact whose gaps are so many times as deep."""
    if "onset" in contact:
        return {"onset": contact["onset"] * depth}
    stiffness = contact["stiffness"]
    return {
        "stiffness": min(stiffness / depth, max(stiffness, STIFFEST)),
        "eta": contact["eta"] * depth,
    }


def _named(laws: Laws) -> str:
    """Symbols, values and units, as they stand in a message."""
    signs = {
        "exponent": ("q", ""), "speed": ("V_c", " m/s"), "stiffness": ("K", " Pa/m"),
        "eta": ("η", " Pa"), "onset": ("an onset of", " m"),
    }  # fmt: skip
    parts = []
    for key, value in {**laws["friction"], **laws["contact"]}.items():
        name, unit = signs[key]
        parts.append(f"{name} {'' if key == 'onset' else '= '}{value:.2g}{unit}")
    return f"{', '.join(parts[:-1])} and {parts[-1]}"
