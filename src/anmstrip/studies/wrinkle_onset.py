"""Where a strip begins to wrinkle on its way through a scene, and how it has come out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from anmstrip.mechanics.cells import jets
from anmstrip.scene.build import Assembly
from anmstrip.scene.imperfection import buckling, flattened
from anmstrip.scene.march import Arrival, March
from anmstrip.scene.measures import State
from anmstrip.scene.schema import Scene
from anmstrip.scene.wrinkling import Wrinkling
from anmstrip.series.outcome import Outcome

Array = NDArray[np.float64]

ONSET = 1.01
"""Growth of the compression that is called the onset.

A strip leans into those wrinkles that its roller has bent it a little towards, and holds the
factor just above 1.
"""

DATED = 1e-3
"""Error of an onset, as a share of the step that it lies in."""

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
    def wavelengths(self) -> tuple[float, float]:
        """2π times the mean height over the mean slope, along and across (m)."""
        operator = jets(self.state.plan.model.strip)
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


def onset(scene: Scene) -> Onset:
    """First state after threading in which the strip is about to buckle.

    Raises
    ------
    PathStopped
        From the path.
    ValueError
        If the strip stays smooth, or is wrinkled from the beginning.
    """
    march = March(Assembly(scene))
    for stage in scene.course:
        plan = march.planned(stage, None)
        for arrival in march.through(plan, MOST_STEPS):
            march.accept(arrival)
            if stage is not scene.course[0] and _excess(arrival.state) < 0.0:
                return _dated(arrival)
        if stage is scene.course[0] and _excess(arrival.state) < 0.0:
            raise ValueError("the strip is wrinkled when threaded; take a higher tension")
        march.finish(stage, plan)
    raise ValueError("the strip stays smooth")


def _excess(state: State) -> float:
    return float(buckling(state, 1)[0][0]) - ONSET


def _dated(arrival: Arrival) -> Onset:
    """The onset inside a step."""
    branch, plan = arrival.branch, arrival.plan
    assert branch is not None

    def state(a: float) -> State:
        u, control = branch(a)
        full, time = plan.supports.full(u, control), plan.start + control * plan.duration
        return replace(arrival.state, full=full, control=float(control), time=time)

    found = state(brentq(lambda a: _excess(state(a)), 0.0, branch.length,
                         xtol=DATED * branch.length))  # fmt: skip
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
        return float(buckling(self.state, 1)[0][0])

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
