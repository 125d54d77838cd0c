"""A scene that can be run."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from anmstrip.driver.run import Run
from anmstrip.scene.schema import SceneSpec
from anmstrip.simulation.problem import EffectMaker


class Scene(SceneSpec):
    """A strip, what it touches, what happens to it, and how that is solved; it can be run.

    Examples
    --------
    >>> scene = Scene(
    ...     strip={"length": 4.0, "width": 1.0, "thickness": 1e-3, "cells": [16, 2]},
    ...     material={"young": 2e11, "poisson": 0.3},
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
        if self.friction is not None and self.friction.regularisation == "auto":
            from anmstrip.driver.sharpening import SharpenedRun

            return SharpenedRun(self, directory, resume=resume, effects=effects)
        return Run(self, directory, resume=resume, effects=effects)
