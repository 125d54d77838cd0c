"""Where a strip begins to wrinkle on its way through a scene, and how it has come out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from anmstrip.continuation.status import Outcome, PathStopped
from anmstrip.driver.scene import Scene
from anmstrip.fem.operators import CellOperator
from anmstrip.fem.sampling import quadrature_points
from anmstrip.results.state import State
from anmstrip.results.wrinkles import Wrinkling
from anmstrip.simulation.imperfection import buckling, flattened
from anmstrip.simulation.march import March, Step
from anmstrip.simulation.problem import Assembly

Array = NDArray[np.float64]

ONSET = 1.01
"""Growth of the compression that is called the onset.

A strip leans into those wrinkles that its roller has bent it a little towards, and holds the
factor just above 1.
"""

DATED = 1e-3
"""Error of an onset, as a share of the step that it lies in."""

SEEN = 0.2
"""Height of a crest that is counted, over the highest."""

MOST_STEPS = 500


@dataclass(frozen=True)
class Onset:
    """Where the strip begins to wrinkle.

    Attributes
    ----------
    state : State
    tension : float
        N/m.
    compression : float
        N/m.
    heights : ndarray, shape (unknowns,)
        The mode, along the normals, as heights of the flat strip.
    """

    state: State
    tension: float
    compression: float
    heights: Array

    @cached_property
    def wrinkling(self) -> Wrinkling:
        """What is known of the state."""
        return Wrinkling(self.state)

    @cached_property
    def wavelengths(self) -> tuple[float, float]:
        """2π times the mean height over the mean slope, along and across (m)."""
        operator = CellOperator(self.state.plan.model.strip, (0, 1))
        height, *slopes = operator.apply(self.heights)[2] ** 2 @ operator.weights
        along, across = (2.0 * np.pi * np.sqrt(height / slope) for slope in slopes)
        return float(along), float(across)

    @property
    def formula(self) -> float:
        """2 √π (D/T)^(1/4) √L with half a wavelength along as the length of the wrinkles."""
        stiffness = self.state.plan.model.strip.bending_stiffness / self.tension
        return float(2.0 * np.sqrt(0.5 * np.pi * self.wavelengths[0]) * stiffness**0.25)

    @property
    def profile(self) -> tuple[Array, Array]:
        """y and height across the strip where the mode is highest."""
        strip, z = self.state.plan.model.strip, self.heights.reshape(-1, 3)[:, 2]
        value, slope = (z[strip.dofs(name)] for name in ("u", "u_y"))
        there = np.isclose(strip.nodes[0], strip.nodes[0][np.abs(value).argmax()])
        y = np.linspace(strip.nodes[1].min(), strip.nodes[1].max(), 300)
        return y, CubicHermiteSpline(strip.nodes[1][there], value[there], slope[there])(y)

    @cached_property
    def crests(self) -> tuple[float, float]:
        """Wavelength (m) across the crests, and their angle to the strip (rad).

        The mean square slope is largest across the crests, which are turned towards +y at the
        exit if the angle is positive.
        """
        operator = CellOperator(self.state.plan.model.strip, (0, 1))
        height, *slopes = operator.apply(self.heights)[2]
        squares = np.einsum("ip,jp,p->ij", slopes, slopes, operator.weights)
        (_, steepest), axes = np.linalg.eigh(squares)
        wave = 2.0 * np.pi * np.sqrt(height**2 @ operator.weights / steepest)
        return float(wave), float(-np.arctan(axes[0, 1] / axes[1, 1]))

    @property
    def map(self) -> tuple[Array, Array, Array]:
        """x, y and height of the mode at the quadrature points of the flat strip."""
        strip = self.state.plan.model.strip
        x, y = quadrature_points(strip)[:2]
        return x, y, CellOperator(strip, (0, 1)).apply(self.heights)[2, 0]

    @property
    def count(self) -> int:
        """Crests and troughs across the strip where the mode is highest."""
        height = self.profile[1]
        turns = np.flatnonzero(np.diff(np.sign(np.diff(height)))) + 1
        return int(np.sum(np.abs(height[turns]) > SEEN * np.abs(height).max()))

    @property
    def place(self) -> str:
        """Name of the span in which the mode is highest, by its ends."""
        strip, z = self.state.plan.model.strip, self.heights.reshape(-1, 3)[:, 2]
        x = strip.nodes[0, np.abs(z[strip.node_values]).argmax()]
        nearest = min(self.wrinkling.spans, key=lambda span: abs(x - 0.5 * (span.start + span.end)))
        return f"{nearest.before} to {nearest.after}"


def onset(scene: Scene) -> Onset:
    """First state of the last stage in which the strip is about to buckle.

    Raises
    ------
    PathStopped
        From the path.
    ValueError
        If the strip stays smooth, or is wrinkled from the beginning.
    """
    (found,) = onsets(scene, (ONSET,))
    if found is None:
        raise ValueError("the strip stays smooth")
    return found


def onsets(scene: Scene, levels: Sequence[float]) -> list[Onset | None]:
    """First states of the last stage in which the factor is down to some levels, the highest first.

    Raises
    ------
    PathStopped
        From the path, before the first of them.
    ValueError
        If the strip is wrinkled when that stage begins.
    """
    found: list[Onset | None] = []
    steps = _last_stage(scene)
    before = next(steps).state
    if _factor(before) < levels[0]:
        raise ValueError("the strip is wrinkled before the last stage; begin at another tension")
    try:
        for arrival in steps:
            factor = _factor(arrival.state)
            while factor < levels[len(found)]:
                found.append(_dated(arrival, before, levels[len(found)]))
                if len(found) == len(levels):
                    return found
            before = arrival.state
    except PathStopped:
        if not found:
            raise
    return found + [None] * (len(levels) - len(found))


def _last_stage(scene: Scene) -> Iterator[Step]:
    """Where the last stage begins, and its steps."""
    march, course = March(Assembly(scene)), scene.course
    for left, stage in zip(range(len(course))[::-1], course, strict=True):
        plan = march.planned(stage, None)
        for arrival in march.through(plan, MOST_STEPS):
            march.accept(arrival)
            if not left:
                yield arrival
        if left == 1:
            yield arrival
        march.finish(stage, plan)


def _factor(state: State) -> float:
    """By which the compression would have to grow for the strip to buckle."""
    return float(buckling(state, 1)[0][0])


def _dated(arrival: Step, before: State, level: float) -> Onset:
    """The onset inside a step."""
    end = arrival.state
    branch, plan = end.branch, end.plan
    length = end.time - before.time if branch is None else branch.length

    def state(a: float) -> State:
        if branch is None:
            return end.at(before.time + a, before)
        u, control = branch(a)
        full, time = plan.supports.full(u, control), plan.start + control * plan.duration
        return replace(end, full=full, control=float(control), time=time)

    found = state(brentq(lambda a: _factor(state(a)) - level, 0.0, length, xtol=DATED * length))
    heights = flattened(found, buckling(found, 1)[1][:, 0])
    return Onset(found, found.tension("exit"), Wrinkling(found).compression, heights)


@dataclass(frozen=True)
class Ended:
    """How a strip has come out.

    Attributes
    ----------
    state : State
    wrinkling : Wrinkling
    tangents : int
    outcome : Outcome
        Of the run, which may have stopped before its end.
    """

    state: State
    wrinkling: Wrinkling
    tangents: int
    outcome: Outcome = Outcome.DONE

    @property
    def factor(self) -> float:
        """By which the compression would have to grow for the strip to buckle."""
        return _factor(self.state)

    @property
    def heights(self) -> list[float]:
        """Of the wrinkles in every span, over the thickness."""
        found = self.wrinkling.amplitudes()
        assert found is not None
        return [height / self.state.plan.model.strip.thickness for height in found]

    @property
    def lean(self) -> float:
        """Largest difference in height between both sides of the strip, over the thickness."""
        strip = self.state.plan.model.strip
        z = self.state.full.reshape(-1, 3)[strip.node_values, 2]
        here, there = (np.lexsort(np.round([side * strip.nodes[1], strip.nodes[0]], 9))
                       for side in (1.0, -1.0))  # fmt: skip
        return float(np.abs(z[here] - z[there]).max()) / strip.thickness


def ended(scene: Scene, directory: Path | None = None) -> Ended:
    """Run a scene as far as it goes, and write it if a directory is given."""
    run = scene.run(directory)
    *_, last = run
    return Ended(last.state, Wrinkling(last.state), run.cost.expansions, run.outcome)
