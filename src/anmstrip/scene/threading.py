"""Threading: from rollers that say on which side the strip passes, to a first guess.

The guess is geometric.  Every fibre along the strip lies on the shortest path around the
circles in which its plane y = const cuts the rollers, uniformly stretched by the tension
and pressed in as deep as the contact law asks for.  What is missing to equilibrium, the
bending where the strip lifts off above all, is taken away by a path without friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.scene.errors import InputError, Mistake

if TYPE_CHECKING:
    from anmstrip.mechanics.belt import Belt
    from anmstrip.mechanics.cells import Pattern
    from anmstrip.mechanics.roller import Roller
    from anmstrip.mechanics.strip import Strip
    from anmstrip.scene.schema import Scene

Array = NDArray[np.float64]

SENSES = {"over": 1.0, "under": -1.0}


def stretches(tension: float, tensile_stiffness: float, poisson: float) -> tuple[float, float]:
    """Stretch along and across a strip under tension.

    The strain E along solves T = √(1 + 2E) E_young t E; the strip contracts across by −ν E.
    """
    strain = tension / tensile_stiffness
    for _ in range(30):
        stretch = np.sqrt(1.0 + 2.0 * strain)
        change = (tensile_stiffness * strain * stretch - tension) / (
            tensile_stiffness * (stretch + strain / stretch)
        )
        strain -= change
    return float(np.sqrt(1.0 + 2.0 * strain)), float(np.sqrt(1.0 - 2.0 * poisson * strain))


@dataclass(frozen=True)
class Thread:
    """The way of a strip around its rollers.

    Attributes
    ----------
    rollers : sequence of Roller
        Those that it is wrapped around, in their order along the strip.
    senses : ndarray, shape (rollers,)
        +1 over, −1 under.
    depths : ndarray, shape (rollers,)
        Gap of the pressed strip (m), negative where it is pressed in.
    ends : tuple of End or None
        Entry and exit of the path in the plane (x, z); ``None`` until its run is known.
    along, across : float
        Stretches under the tension.
    tension : float
        N/m.
    given : float or None
        Length of the strip (m), if it does not follow from the ends.
    """

    rollers: Sequence[Roller]
    senses: Array
    depths: Array
    ends: tuple[Any, ...]
    along: float
    across: float
    tension: float
    given: float | None

    @cached_property
    def middle(self) -> Belt:
        """Path of the fibre y = 0."""
        return self.belt(np.zeros(1))

    @property
    def length(self) -> float:
        """Of the unstretched strip (m)."""
        return float(self.middle.length[0]) / self.along if self.given is None else self.given

    @property
    def arcs(self) -> dict[str, tuple[float, float]]:
        """Roller → reference x where contact begins and ends."""
        arcs = self.middle.arcs
        x = np.stack([arcs.start[:, 0], arcs.end[:, 0]], axis=1) / self.along - self.length / 2.0
        return {r.name: (float(a), float(b)) for r, (a, b) in zip(self.rollers, x, strict=True)}

    @property
    def turns(self) -> dict[str, float]:
        """Roller → wrap (rad)."""
        turn = self.middle.arcs.turn[:, 0]
        return {r.name: float(angle) for r, angle in zip(self.rollers, turn, strict=True)}

    def belt(self, y: Array) -> Belt:
        """Paths of the fibres at y, shape (fibres,)."""
        from anmstrip.mechanics.belt import belt  # noqa: PLC0415 (only threaded strips pay for it)

        centres, radii = [], []
        for roller, depth in zip(self.rollers, self.depths, strict=True):
            s = (y - roller.centre[1]) / roller.unit_axis[1]
            point = np.asarray(roller.centre)[:, None] + roller.unit_axis[:, None] * s
            centres.append(point[[0, 2]])
            radii.append(roller.radius_at(s) + depth)
        return belt(np.array(centres), np.array(radii), self.senses, *self.ends)

    def ends_in_space(self, reference: Array) -> tuple[Array, Array, Array]:
        """Displacements of entry and exit, and direction of the strip at the exit, (3,) each.

        Parameters
        ----------
        reference : ndarray, shape (2,)
            Reference x of entry and exit.
        """
        s = (reference - reference[0]) * self.along
        position, direction = self.middle.at(s, 0)
        in_space = np.stack([position[0], np.zeros(2), position[1]])
        moved = in_space - np.stack([reference, np.zeros(2), np.zeros(2)])
        leaving = direction[:, 1]
        return moved[:, 0], moved[:, 1], np.array([leaving[0], 0.0, leaving[1]])

    def guess(self, strip: Strip, pattern: Pattern) -> Array:
        """Displacements of the threaded strip before equilibrium, shape (unknowns,).

        Projected in the mean square on the strip's own functions.
        """
        from anmstrip.mechanics.projection import projected, quadrature_points  # noqa: PLC0415

        reference, begin = quadrature_points(strip), float(strip.mesh.p[0].min())
        return projected(strip, pattern, self.positions(reference, begin) - reference)

    def positions(self, reference: Array, begin: float) -> Array:
        """Where points of the flat strip, which begins at x = begin, come to lie, (3, points)."""
        x, y = reference[0], reference[1]
        lines, fibre = np.unique(y, return_inverse=True)
        position, _ = self.belt(lines).at((x - begin) * self.along, fibre)
        return np.stack([position[0], y * self.across, position[1]])


def thread_of(scene: Scene, rollers: Sequence[Roller]) -> Thread | None:
    """The way of a scene's strip, ``None`` if it is not threaded.

    Raises
    ------
    InputError
        The strip cannot pass a roller on the side that is asked for, or is too short.
    """
    if scene.threading is None:
        return None
    from anmstrip.mechanics.belt import (  # noqa: PLC0415 (only threaded strips pay for it)
        NoTangentError,
        NotTouchedError,
        Point,
    )

    spec, m = scene.threading, scene.material
    sides = {r.name: r.wrap for r in scene.rollers if r.wrap is not None}
    chosen = [roller for roller in rollers if roller.name in sides]
    thread = Thread(
        chosen,
        np.array([SENSES[sides[roller.name]] for roller in chosen]),
        np.array([_depth(scene, roller) for roller in chosen]),
        tuple(None if p is None else Point((p[0], p[2])) for p in (spec.entry, spec.exit)),
        *stretches(spec.tension, m.young * scene.strip.thickness, m.poisson),
        spec.tension,
        _given_length(scene),
    )
    try:
        return _with_ends(scene, thread)
    except (NotTouchedError, NoTangentError) as error:
        raise _refused(scene, chosen, error) from error


def _given_length(scene: Scene) -> float | None:
    """Length of the strip (m), from the mesh file if there is one."""
    if scene.strip.mesh is None:
        return scene.strip.length
    from anmstrip.scene.mesh_file import read_mesh  # noqa: PLC0415

    return float(np.ptp(read_mesh(scene).p[0]))


def _with_ends(scene: Scene, thread: Thread) -> Thread:
    """Ends that are not given get level runs, as long as the strip allows."""
    from anmstrip.mechanics.belt import Straight  # noqa: PLC0415

    missing = sum(end is None for end in thread.ends)
    if not missing:
        thread.middle  # noqa: B018 (the path is looked for here, so that mistakes show)
        return thread
    assert thread.given is not None
    trial = replace(thread, ends=tuple(end or Straight(1.0) for end in thread.ends))
    spare = thread.given * thread.along - float(trial.middle.length[0])
    run = 1.0 + spare / missing
    if run <= 0.0:
        least = thread.given - missing * run / thread.along
        raise _too_short(scene, thread.given, least)
    return replace(thread, ends=tuple(end or Straight(run) for end in thread.ends))


def _depth(scene: Scene, roller: Roller) -> float:
    """Gap at which a roller carries the tension: pressure (T − D/2R²)/R."""
    from anmstrip.mechanics.signorini import RepulsiveSignorini  # noqa: PLC0415

    assert scene.threading is not None and scene.contact is not None
    c, m, t = scene.contact, scene.material, scene.strip.thickness
    bending = m.young * t**3 / (12.0 * (1.0 - m.poisson**2)) if scene.strip.bending else 0.0
    line_force = scene.threading.tension - bending / (2.0 * roller.radius**2)
    pressure = max(line_force, 0.1 * scene.threading.tension) / roller.radius
    return float(RepulsiveSignorini(c.stiffness, c.eta, c.delta).gap(pressure))


def _refused(scene: Scene, rollers: Sequence[Roller], error: ValueError) -> InputError:
    """What is wrong with the way, in terms of the scene."""
    index = min(getattr(error, "index", 0), len(rollers) - 1)
    name = rollers[index].name
    other = {"over": "under", "under": "over"}
    side = next(r.wrap for r in scene.rollers if r.name == name)
    expected = f"rollers that a taut strip can pass in this order: {error}"
    hint = f'wrap = "{other[side or "over"]}", or another centre'
    file = str(scene.source or "scene")
    return InputError([Mistake(file, f"rollers.{name}.wrap", side, expected, hint)])


def _too_short(scene: Scene, length: float, least: float) -> InputError:
    file, expected = str(scene.source or "scene"), f"more than {least:.4g} (m) for this way"
    return InputError(
        [Mistake(file, "strip.length", length, expected, f"length = {1.3 * least:.3g}")]
    )
