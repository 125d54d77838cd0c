"""A cheaper level of kinematics beside the shell that it stands for: results and cost."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from anmstrip.driver.run import Run
from anmstrip.driver.scene import Scene
from harness import Sheet
from strips import capstan, lightly_wrapped

COLUMNS = ("level", "unknowns", "expansions", "seconds", "ms per expansion")

DEGREES = 1.0
"""Wrap of the strip that a plate is tried on."""


@dataclass(frozen=True)
class Finished:
    """A run to the end of a scene.

    Attributes
    ----------
    run : Run
    seconds : float
        From the scene's tables to the end.
    """

    run: Run
    seconds: float

    @classmethod
    def of(cls, scene: Scene) -> Finished:
        """Run a scene."""
        begin = time.perf_counter()
        run = Run(scene)
        for _ in run:
            pass
        assert run.outcome.done, run.message
        return cls(run, time.perf_counter() - begin)

    @property
    def per_expansion(self) -> float:
        """Seconds."""
        return sum(self.run.cost.seconds.values()) / self.run.cost.expansions

    @property
    def costs(self) -> tuple[int, int, float, float]:
        """What stands in the columns after the level."""
        run = self.run
        unknowns = run.assembly.strip.unknowns
        return unknowns, run.cost.expansions, self.seconds, 1e3 * self.per_expansion

    @property
    def normal_force(self) -> float:
        """Of the roller (N)."""
        assert self.run.state is not None
        return self.run.state.rollers["r1"].normal_force

    @property
    def tension_ratio(self) -> float:
        """Across the roller."""
        assert self.run.state is not None
        return self.run.state.rollers["r1"].tension_ratio or np.nan

    @property
    def lift(self) -> float:
        """Largest displacement upwards of a node (m)."""
        strip = self.run.assembly.strip
        return float(self.run.march.full.reshape(-1, strip.count)[strip.node_values, -1].max())


def section_against_shell(quick: bool) -> Sheet:
    """Capstan, in time with friction: a line of elements beside ten of them across."""
    refined, tolerance = (0.2, 1e-3) if quick else (0.025, 1e-4)
    found = {
        level: Finished.of(capstan(level, 10, refined, tolerance)) for level in ("section", "shell")
    }
    ratio = {level: end.tension_ratio for level, end in found.items()}
    rows = [(level, *end.costs, ratio[level]) for level, end in found.items()]
    quotients = _quotients(found["shell"], found["section"])
    difference = ratio["section"] / ratio["shell"] - 1.0
    return Sheet(
        "Section against a shell of 10 elements across: capstan, 0.6 s of turning",
        (*COLUMNS, "tension ratio"),
        (*rows, ("shell / section", *quotients, ratio["shell"] / ratio["section"])),
        f"Elements of {refined:g} m over the roller, tolerance {tolerance:g}. The section's ratio "
        f"of tensions is off by {100.0 * difference:+.3g} %.",
    )


def plate_against_shell(quick: bool) -> Sheet:
    """A roller that lifts the strip to a small wrap, without friction."""
    cells, refined = ((16, 2), 0.1) if quick else ((16, 4), 0.01)
    found = {
        level: Finished.of(lightly_wrapped(level, DEGREES, cells, refined))
        for level in ("plate", "shell")
    }
    results = {level: (end.normal_force, end.lift) for level, end in found.items()}
    rows = [(level, *end.costs, *results[level]) for level, end in found.items()]
    quotients = _quotients(found["shell"], found["plate"])
    force, lift = (a / b for a, b in zip(results["shell"], results["plate"], strict=True))
    return Sheet(
        f"Plate against shell: {DEGREES:g}° of wrap, no friction",
        (*COLUMNS, "normal force (N)", "lift (m)"),
        (*rows, ("shell / plate", *quotients, force, lift)),
        f"Elements of {refined:g} m over the roller. The plate's normal force is off by "
        f"{100.0 / force - 100.0:+.2g} %, its lift by {100.0 / lift - 100.0:+.2g} %.",
    )


def _quotients(shell: Finished, cheap: Finished) -> tuple[float, ...]:
    return tuple(float(a / b) for a, b in zip(shell.costs, cheap.costs, strict=True))
