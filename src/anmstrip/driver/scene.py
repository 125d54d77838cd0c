"""A scene that can be run: once, or with laws that are sharpened until that is no longer seen."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anmstrip.continuation.path import Outcome
from anmstrip.driver.run import Run
from anmstrip.results.rollers import Regularisation
from anmstrip.scene.schema import SceneSpec
from anmstrip.simulation.march import Step
from anmstrip.simulation.problem import MAX_HALVED_UNKNOWNS, EffectMaker

if TYPE_CHECKING:
    from anmstrip.driver.stationary import OperatingMap


class Scene(SceneSpec):
    """A strip, what it touches, what happens to it, and how that is solved; it can be run.

    Examples
    --------
    >>> scene = Scene(
    ...     strip={"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [16, 2]},
    ...     material={"young": 2e11, "poisson": 0.3},
    ...     edges={"entry": {"fixed": ["x", "y", "z"]}, "exit": {"fixed": ["y", "z"]}},
    ...     stages=[{"duration": 1.0, "exit": {"force": [1e4, 0.0, 0.0]}}],
    ... )
    >>> [step.time for step in scene.run()]
    [1.0]
    """

    def run(
        self,
        directory: str | Path | None = None,
        resume: bool = False,
        effects: Iterable[EffectMaker] = (),
    ) -> Run:
        """Return an iterator over accepted steps that writes to a directory.

        Parameters
        ----------
        directory : path, optional
            Where the results go; nothing is written without it.
        resume : bool, optional
            Whether to go on from the checkpoint in the directory.
        effects : iterable of callables, optional
            Effects of one's own, see :class:`~anmstrip.driver.run.Run`.

        Returns
        -------
        Run
        """
        if resume and directory is None:
            expected = "the directory of the run that is to go on"
            raise self.refused("directory", None, expected, 'run("results/line", resume=True)')
        if self.repeated and resume:
            refined = self.strip.refined == "auto"
            expected = "a length" if refined else '"fixed"'
            key = "strip.refined" if refined else "friction.regularisation"
            expected += ": each run depends on the one before it"
            raise self.refused(key, "auto", expected, "the same without --resume")
        if self.strip.refined == "auto":
            return RefinedRun(self, directory, effects=effects)
        if self.repeated:
            return SharpenedRun(self, directory, effects=effects)
        return Run(self, directory, resume=resume, effects=effects)

    @property
    def repeated(self) -> bool:
        """Whether the scene is run several times, so that it cannot be resumed."""
        sharpened = self.friction is not None and self.friction.regularisation == "auto"
        return sharpened or self.strip.refined == "auto"

    def map(
        self, *along: str, directory: str | Path | None = None, effects: Iterable[EffectMaker] = ()
    ) -> OperatingMap:
        """Return the stationary states along one control, or along one for values of another.

        Parameters
        ----------
        *along : str
            ``KEY=first:last`` or ``KEY=first:last:number``, with a key of a steady stage.
        directory : path, optional
            Where ``map.csv``, ``map.json`` and ``map.png`` go; nothing is written without it.
        effects : iterable of callables, optional
            Effects of one's own, see :class:`~anmstrip.driver.run.Run`.

        Returns
        -------
        OperatingMap
            It has been followed to its end.
        """
        from anmstrip.driver.stationary import OperatingMap

        made = OperatingMap(self, along, directory, effects)
        for _ in made:
            pass
        return made


MAX_RUNS = 6

USEFUL_REDUCTION = 0.5
"""Share of the effect of the laws, of that of the run before, up to which a further run is made:
what is estimated then is not theirs alone."""

PART_SHARE = 0.2
"""Share of the tolerance that each of the three parts is aimed at."""

SUM_SHARE = 3.0 * PART_SHARE
"""The same of the three together, where the error budget knows their sum alone."""

SHARPENED_CONSTANTS = {
    "exponent": ("friction", "q = {:.2g}", "by_cone", 1e-7),
    "omega": ("friction", "ω = {:.2g}", "by_creep", 1e-13),
    "speed": ("friction", "V_c = {:.2g} m/s", "by_creep", 1e-12),
    "stiffness": ("contact", "K = {:.2g} Pa/m", "by_penetration", 1e14),
    "eta": ("contact", "η = {:.2g} Pa", "by_penetration", 0.0),
    "onset": ("contact", "an onset of {:.2g} m", "by_penetration", 0.0),
}
"""Table of each constant that is sharpened, how it is written, the effect that goes with it, and
its sharpest value; ω V_c instead of ω.  V_c and ω V_c are near the last digit of positions."""


class SharpenedRun(Run):
    """A run of a scene that is repeated with sharper laws; results are those of the last one.

    It is not resumed.  What its laws cost is the part of the error budget; where that is not known
    it is estimated from the slip, the traction and the gaps on every roller.

    Attributes
    ----------
    passes : tuple of dict
        Constants of the laws of every run, the largest estimated ``effect`` of its regularisation
        on a tension, and its ``tangents``.
    """

    passes: tuple[dict[str, float], ...] = ()
    estimates = True

    def __iter__(self) -> Iterator[Step]:
        while True:
            self.costs: dict[str, list[Regularisation]] = {}
            for step in super().__iter__():
                if step.state.plan.in_time:  # the last state of each stage stays
                    self.costs[step.stage] = list(step.state.regularisation.values())
                yield step
            if not self.outcome.done:
                return
            laws, sharper, tolerance = self.laws(), self.sharper(), self.scene.solver.tolerance
            self.passes += ({**laws, "effect": self.effect, "tangents": self.cost.expansions},)
            words = [SHARPENED_CONSTANTS[key][1].format(value) for key, value in laws.items()]
            sharp = self.effect <= tolerance
            self.message += (
                f" Regularisation changes tensions by about {self.effect:.2g}, "
                f"{'below' if sharp else 'above'} the tolerance of {tolerance:g}, with "
                f"{', '.join(words[:-1])} and {words[-1]} after {len(self.passes)} run(s)"
            )
            bound = "their constants are the least" if laws == sharper else "there are no more"
            effects = [each["effect"] for each in self.passes]
            useless = len(effects) > 1 and effects[-1] > USEFUL_REDUCTION * effects[-2]
            bound = "sharper ones change that no more" if useless else bound
            self.message += "." if sharp else f": {bound}."
            if sharp or useless or len(self.passes) == MAX_RUNS or laws == sharper:
                self._finish()
                return
            restart(self, {(SHARPENED_CONSTANTS[key][0], key): sharper[key] for key in sharper})

    def facts(self) -> dict[str, Any]:
        """Return the counters of the run, and what was done to sharpen its laws."""
        return {**super().facts(), "sharpened": self.passes}

    @property
    def budgeted(self) -> float | None:
        """Part of the laws in the error of tensions, as a share; None if it is not known."""
        found = self.errors()["regularisation"]
        return None if found is None else found["tension"] / self.assembly.scales.tension

    @property
    def effect(self) -> float:
        """Part of the error budget, or the largest estimate in any stage."""
        if self.budgeted is not None:
            return self.budgeted
        return max((cost.effect for costs in self.costs.values() for cost in costs), default=0.0)

    def laws(self) -> dict[str, float]:
        """Return q and ω or V_c (m/s), and K (Pa/m) and η (Pa) or the onset of contact (m)."""
        f, c = self.scene.friction, self.scene.contact
        assert f and c and f.speed
        friction = {"speed": f.speed}
        if f.law == "norton-hoff":
            friction = {"exponent": f.exponent, "omega": f.omega}
        if c.constants is None:
            return {**friction, "onset": self.assembly.signorini.width}
        return {**friction, "stiffness": c.constants[0], "eta": c.constants[1]}

    def sharper(self) -> dict[str, float]:
        """Return laws that bring every part of the effect to its share of the tolerance.

        Friction all at once where the error budget is known, and contact by no more than that.
        """
        friction = self.scene.friction
        assert friction and friction.speed
        tolerance, whole, sharper = self.scene.solver.tolerance, self.budgeted, {}
        every = [cost for costs in self.costs.values() for cost in costs]
        for key, value in self.laws().items():
            table, _, part, limit = SHARPENED_CONSTANTS[key]
            found = max((getattr(cost, part) for cost in every), default=0.0)
            factor = min(1.0, PART_SHARE * tolerance / max(found, 1e-300))
            if whole is not None:
                together = min(1.0, SUM_SHARE * tolerance / max(whole, 1e-300))
                factor = together if table == "friction" else max(factor, together)
            limit = limit / friction.speed if key == "omega" else limit
            least, most = sorted((value, limit))
            new = value / factor if key == "stiffness" else value * factor
            sharper[key] = float(np.clip(new, least, most))
        return sharper


class RefinedRun(Run):
    """A run of a scene that is repeated on elements of half the length; results are the last one's.

    It ends where the mesh's part of the error of tensions is below ``solver.mesh_tolerance`` and no
    wrinkles are told that may come from the mesh alone, or where half the length would take more
    than :data:`~anmstrip.simulation.problem.MAX_HALVED_UNKNOWNS`.  A path that stops is followed
    again too, as long as the mesh may be what stopped it, and not the sharpness of friction.

    Attributes
    ----------
    passes : tuple of dict
        How many times ``finer`` than usual the elements of every run were, the shortest
        ``element`` (m), ``unknowns``, the mesh's part of the error of tensions (``error``, N/m,
        None if it is not known) and ``tangents``.
    """

    passes: tuple[dict[str, Any], ...] = ()
    estimates = True

    def __iter__(self) -> Iterator[Step]:
        while True:
            yield from super().__iter__()
            strip, found = self.assembly.strip, self.errors()["mesh"]
            told: dict[str, Any] = {
                "finer": self.scene.strip.finer or 1.0,
                "element": float(strip.cell_sizes[0].min()),
                "unknowns": strip.unknowns,
                "error": None if found is None else found["tension"],
                "tangents": self.cost.expansions,
            }
            self.passes += (told,)
            spent = self.outcome in (Outcome.TOO_MANY_STEPS, Outcome.TOO_MANY_TANGENTS)
            spent |= self.stopped is not None and self.stopped.width is not None
            if self.fine_enough or spent or not self.assembly.can_halve:
                between = " " if self.outcome.done else "\n"  # behind what may be typed
                self.message += between + self.words()
                self._finish()
                return
            restart(self, {("strip", "finer"): 2.0 * told["finer"]})

    def words(self) -> str:
        """Return what refinement has come to, as a sentence."""
        last, share = self.passes[-1], self.scene.solver.mesh_share
        told = f"On elements of {last['element']:.2g} m ({len(self.passes)} run(s)) the mesh "
        if last["error"] is None:
            told += "makes tensions wrong by an unknown part"
            if known := [each["error"] for each in self.passes if each["error"] is not None]:
                told += f", by less than {known[-1]:.2g} N/m, that of longer ones, if it converges"
        else:
            scale = self.budget.tension
            side = "below" if last["error"] <= share * scale else "above"
            told += f"makes tensions wrong by about {last['error']:.2g} N/m, {side}"
            told += f" the {share:g} of {scale:.5g} N/m that is asked for"
        if not self.fine_enough and not self.assembly.can_halve:
            told += f"; half the length would take more than {MAX_HALVED_UNKNOWNS} unknowns"
        return f"{told}."

    def facts(self) -> dict[str, Any]:
        """Return the counters of the run, and what every mesh has come to."""
        return {**super().facts(), "refined": self.passes}


def restart(run: Run, changes: Mapping[tuple[str, str], object]) -> None:
    """Begin a run again with other values of keys in tables of its scene."""
    tables = run.scene.to_dict()
    for (table, key), value in changes.items():
        tables[table][key] = value
    scene = SceneSpec.model_validate(tables)
    scene._source = run.scene.source
    Run.__init__(run, scene, run.directory, effects=run.assembly.added)
