"""Threading: the path of a taut string round the rollers, and a first guess from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, combinations, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.arrays import Array
from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.path import PathStopped
from anmstrip.equilibrium import Equilibrium, Model
from anmstrip.errors import InputError
from anmstrip.fem.operators import Pattern
from anmstrip.fem.sampling import l2_projection, quadrature_points
from anmstrip.fem.strip import Scales, Strip, Supports
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls, Effect, Values
from anmstrip.mechanics.loads import Guide, edge_force
from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.shell import Membrane, green_strain, uniaxial_stretches
from anmstrip.mechanics.string_path import (
    FixedEnd,
    NoTangentError,
    NotTouchedError,
    StraightEnd,
    StringPath,
    closing_point,
    string_path,
)
from anmstrip.scene.checks import meant_modulus
from anmstrip.scene.schema import SceneSpec
from anmstrip.scene.tables import ENDS, I_UNIT, RollerSpec
from anmstrip.simulation.defaults import bending_stiffness

Interval = tuple[float, float]
"""Labels (m) between which something is."""

SENSES = {"over": 1.0, "left": 1.0, "under": -1.0, "right": -1.0}
"""Sides on which a strip passes: +1 on the left of its travel, with x to the right and z upwards,
so that it turns to the right."""

MOST_WAYS = 500
"""Ways around the rollers that are tried where the one that is given does not touch them all."""

LARGEST_RADIUS = 20.0
"""Radius (m) of which there is no roller in a line."""

FAR_AWAY = 30.0
"""Ratio of successive sizes and places of a line from which on the larger ones may be in mm, as
is said besides of a line that cannot be threaded."""

OTHER_SIDE = {"over": "under", "under": "over", "left": "right", "right": "left"}

MAX_DEPTH = 0.5
"""Share of a roller's radius that a threaded strip may sink into it."""

FREE_RUN = 4.0
"""Run beside a roller, in boundary layers √(D/T), above which the guess bends the strip onto it,
and length of the finest elements below which: with 9 a yawed roller is not threaded.  Lines of 2
and 40 rollers so take 3 and 5 corrections, without 9 and 9; with 1 as many."""

TOUCHING_DEPTH = 0.01
"""Share of its radius by which a roller that stands clear of the strip is told to stand in it."""

STRIP_SAMPLES = 2001
"""Places along a threaded strip, of which the one next to a roller is sought."""

TABLE_PIECES = 16
"""Of each piece of a table along, between which the stretch is linear: to 1e-8 beside strains of
1 %, a thousandth of that of a usual tension."""

RELAXATION_ORDER, RELAXATION_TOLERANCE = 8, 1e-4
"""Of the path that lets the guess slide into place: almost linear, and a guess."""


@dataclass(frozen=True)
class Stretches:
    """Stretch of a threaded strip by tension and heat, linear between labels.

    Attributes
    ----------
    labels : ndarray, shape (n,)
        Distances from the entry in the unstressed strip (m), increasing from 0.
    along, across : ndarray, shape (n,)
        Stretches there; beyond the last label they stay.
    """

    labels: Array
    along: Array
    across: Array

    @cached_property
    def slopes(self) -> Array:
        """Slopes of the stretch along, behind each label (1/m), shape (n,)."""
        return np.append(np.diff(self.along) / np.diff(self.labels), 0.0)

    @cached_property
    def places(self) -> Array:
        """Lengths of stretched strip up to the labels (m), shape (n,)."""
        means = 0.5 * (self.along[1:] + self.along[:-1])
        return np.append(0.0, np.cumsum(means * np.diff(self.labels)))

    def place(self, label: Any) -> Any:
        """Length of stretched strip (m) up to labels (m)."""
        k = np.maximum(np.searchsorted(self.labels, label, side="right") - 1, 0)
        further = label - self.labels[k]
        return self.places[k] + further * (self.along[k] + 0.5 * self.slopes[k] * further)

    def label(self, place: Any) -> Any:
        """Labels (m) up to which stretched strip is so long (m)."""
        k = np.maximum(np.searchsorted(self.places, place, side="right") - 1, 0)
        further = place - self.places[k]
        root = np.sqrt(self.along[k] ** 2 + 2.0 * self.slopes[k] * further)
        return self.labels[k] + 2.0 * further / (self.along[k] + root)


@dataclass(frozen=True)
class Thread:
    """The way of a strip around its rollers.

    Attributes
    ----------
    rollers : sequence of Roller
        Those that it is wrapped around, in their order along the strip.
    senses : ndarray, shape (rollers,)
        +1 over or left, −1 under or right.
    crossing : ndarray of bool, shape (rollers,)
        Where the strip may cross itself.
    depths : ndarray, shape (rollers,)
        Gap of the pressed strip (m), negative where it is pressed in.
    ends : tuple of End or None
        Entry and exit of the path in the plane (x, z); ``None`` until its run is known.
    stretches : Stretches
        Of the strip under the tension.
    tension : float
        N/m.
    given : float or None
        Length of the strip (m), if it does not follow from the ends.
    layer : float
        √(D/T) (m), over which the strip bends onto a roller.
    supports : ndarray, shape (2, others)
        Highest points (x, z) of the other rollers at the beginning (m), on which it may lie.
    """

    rollers: Sequence[Roller]
    senses: Array
    crossing: NDArray[np.bool_]
    depths: Array
    ends: tuple[Any, ...]
    stretches: Stretches
    tension: float
    given: float | None
    layer: float
    supports: Array

    @cached_property
    def middle(self) -> StringPath:
        """Path of the fibre y = 0."""
        return self.string_path(np.zeros(1))

    @property
    def length(self) -> float:
        """Length of the unstretched strip (m)."""
        if self.given is not None:
            return self.given
        return float(self.stretches.label(self.middle.length[0]))

    @property
    def arcs(self) -> dict[str, Interval]:
        """Roller → reference x where contact begins and ends."""
        arcs = self.middle.arcs
        x = self.stretches.label(np.stack([arcs.start[:, 0], arcs.end[:, 0]], axis=1))
        x -= self.length / 2.0
        return {r.name: (float(a), float(b)) for r, (a, b) in zip(self.rollers, x, strict=True)}

    @property
    def turns(self) -> dict[str, float]:
        """Roller → wrap (rad)."""
        turn = self.middle.arcs.turn[:, 0]
        return {r.name: float(angle) for r, angle in zip(self.rollers, turn, strict=True)}

    def passing(self, centre: Array) -> tuple[float, float]:
        """Reference x at which the strip passes a point (x, z), and its sense round it."""
        s, sense = self.middle.passing(centre, STRIP_SAMPLES)
        return float(self.stretches.label(s)) - self.length / 2.0, sense

    def stretch(self, x: float) -> float:
        """Stretch along at a reference x (m)."""
        label = x + self.length / 2.0
        return float(np.interp(label, self.stretches.labels, self.stretches.along))

    def chosen(self, numbers: Sequence[int]) -> Thread:
        """Return the way around some of the rollers, or around all in another order."""
        rollers, arrays = [self.rollers[k] for k in numbers], ("senses", "crossing", "depths")
        of_these = {name: getattr(self, name)[list(numbers)] for name in arrays}
        return replace(self, rollers=rollers, **of_these)

    def string_path(self, y: Array) -> StringPath:
        """Paths of the fibres at y, shape (fibres,)."""
        sections, (entry, exit) = [roller.section(y) for roller in self.rollers], self.ends
        centres = np.reshape([centre for centre, _ in sections], (-1, 2, len(y)))
        radii = np.reshape([radius for _, radius in sections], (-1, len(y))) + self.depths[:, None]
        return string_path(centres, radii, self.senses, entry, exit, self.crossing)

    def touching(self, y: Array, heights: Array) -> tuple[StringPath, Array]:
        """Paths of fibres at y around the rollers that they touch, larger by half of heights (m).

        Strip that bends onto its rollers comes off one that a string only just touches, and so do
        some of the fibres over a roller out of line.

        Returns
        -------
        path : StringPath
        heights : ndarray
            Of the rollers that are touched, on the left of the path (m).
        """
        every, kept = replace(self, depths=self.depths + 0.5 * heights), list(range(len(heights)))
        while True:
            thread = every.chosen(kept)
            try:
                return thread.string_path(y), heights[kept] * thread.senses
            except NotTouchedError as error:
                del kept[error.index]

    @property
    def heights(self) -> Array:
        """ℓ²/R (m) of the layers ℓ in which the strip bends onto rollers, shape (rollers,).

        0 where it does not lie on the roller, or has no room for a layer.
        """
        runs, turn = np.diff(self.middle.starts[:, 0])[::2], self.middle.arcs.turn[:, 0]
        radii = np.array([roller.radius for roller in self.rollers])
        room = np.minimum(runs[:-1], runs[1:]) > FREE_RUN * self.layer
        return np.where(room & (radii * turn > 2.0 * self.layer), self.layer**2 / radii, 0.0)

    def ends_in_space(self, strip: Strip) -> tuple[Array, Array, Array, Array]:
        """Displacements of entry and exit, and outward directions of the strip there, (3,) each."""
        reference = np.array(strip.span)
        position, direction = self.middle.at(self.stretches.place(reference - reference[0]), 0)
        in_space = np.stack([position[0], np.zeros(2), position[1]])
        moved = in_space - np.stack([reference, np.zeros(2), np.zeros(2)])
        outward = np.stack([direction[0], np.zeros(2), direction[1]]) * [-1.0, 1.0]
        return moved[:, 0], moved[:, 1], outward[:, 0], outward[:, 1]

    def guess(self, strip: Strip, pattern: Pattern, natural: Values | None = None) -> Array:
        """Displacements of the threaded strip before equilibrium, shape (unknowns,).

        `natural` are the controls of its heat, flatness and camber.
        """
        full = self.laid(strip, pattern)
        # Fibres that go ways of different lengths slide along their own surface first.
        uneven = any(not r.is_cylinder or r.unit_axis[0] or r.unit_axis[2] for r in self.rollers)
        return self._relaxed(strip, pattern, full, natural or {}) if uneven else full

    def laid(self, strip: Strip, pattern: Pattern) -> Array:
        """Displacements onto the path, in the mean square over the strip, shape (unknowns,).

        It is bent onto rollers over layers, if elements resolve these, else taut as a string.
        """
        reference, heights = quadrature_points(strip), self.heights
        lines, fibre = np.unique(reference[1], return_inverse=True)
        label, stretches = reference[0] - strip.span[0], self.stretches
        s = stretches.place(label)
        if strip.cell_sizes[0].min() < FREE_RUN * self.layer and heights.any():
            path, signed = self.touching(lines, heights)
            position = path.stiff(s, fibre, self.layer, signed)
        else:
            position, _ = self.touching(lines, 0.0 * heights)[0].at(s, fibre)
        across = np.interp(label, stretches.labels, stretches.across)
        places = np.stack([position[0], reference[1] * across, position[1]])
        return l2_projection(strip, pattern, places - reference)

    def _relaxed(self, strip: Strip, pattern: Pattern, full: Array, natural: Values) -> Array:
        """Let a shell slide along its own surface, between entry and exit, to equilibrium."""
        entry, (*_, leaving) = strip.edges["entry"], self.ends_in_space(strip)
        one = entry.values[[len(entry.values) // 2]]
        held = np.concatenate([3 * entry.trace, 3 * entry.trace + 2, 3 * one + 1])
        at_rest = Supports.at_rest(strip.unknowns, held)
        start = full.copy()
        start[at_rest.free] = 0.0
        supports = replace(at_rest, start=start)
        effects: list[Effect] = [Membrane(strip), edge_force(strip, "exit"), Guide(strip, full)]
        scales = Scales(strip.length, self.tension * strip.width, self.tension)
        pull = Controls({"exit.force": self.tension * leaving, **natural})
        equations = Equilibrium(Model(strip, pattern, effects, scales), supports, pull)
        settings = Settings(order=RELAXATION_ORDER, tolerance=RELAXATION_TOLERANCE)
        u = full[at_rest.free]
        try:
            *_, last = follow(equations, u, solver=SparseSolver(), settings=settings)
        except PathStopped:  # of rollers too far out of line, where threading says why
            return full
        return supports.full(*last.branch.end)


def thread_of(
    scene: SceneSpec, rollers: Sequence[Roller], origin: Array, length: float | None
) -> Thread:
    """Return the way of a threaded strip, from a local origin, shape (3,).

    Raises
    ------
    InputError
        The strip cannot pass a roller on the side that is asked for, or is too short.
    """
    assert scene.threading is not None
    spec = scene.threading
    sides = {r.name: r.wrap for r in scene.rollers if r.wrap is not None}
    chosen = [roller for roller in rollers if roller.name in sides]
    given = spec.entry, spec.exit
    ends = [None if place is None else (place - origin)[[0, 2]] for place in given]
    senses = np.array([SENSES[sides[roller.name]] for roller in chosen])
    depths = np.array([_depth(scene, roller) for roller in chosen])
    if spec.closed:
        centres = [(roller.centre[0], roller.centre[2]) for roller in chosen]
        radii = [r.radius + r.half + depth for r, depth in zip(chosen, depths, strict=True)]
        joint = closing_point(centres, radii, senses)
        ends = [joint, joint]
    crossing = np.array([roller.crossing for roller in scene.rollers if roller.wrap is not None])
    fixed = tuple(None if place is None else FixedEnd(place) for place in ends)
    layer = float(np.sqrt(bending_stiffness(scene) / spec.tension))
    others = [roller for roller in rollers if roller.name not in sides]
    tops = [(r.centre[0], r.centre[2] + r.radius + r.half) for r in others]
    shape = chosen, senses, crossing, depths, fixed, stretches_of(scene)
    thread = Thread(*shape, spec.tension, length, layer, np.array(tops).reshape(-1, 2).T)
    try:
        thread = _with_ends(scene, thread)
        if not spec.closed:
            return thread
        length = float(thread.middle.length[0])
        along = length / (length + bent_longer(thread)) * thread.stretches.along
        return replace(thread, stretches=replace(thread.stretches, along=along))
    except (NotTouchedError, NoTangentError) as error:
        raise _refused(scene, thread, error) from error


def bent_longer(thread: Thread) -> float:
    """Return by how much the way of stiff strip is longer than that of a string (m).

    It is bent beside a roller over λ = √(D/T), and straight from λ²/2R outside the string's way on:
    a² λ/4 − R a³/6 at either end of a wrap θ, a = λ/R, at most θ/2 of one that it only touches
    along a line.
    """
    layer, longer, (starts, ends, _) = thread.layer, 0.0, thread.middle.arcs
    for roller, depth, start, end in zip(thread.rollers, thread.depths, starts, ends, strict=True):
        radius = roller.radius + roller.half + depth
        angle = min(layer, 0.5 * float(end[0] - start[0])) / radius
        longer += 2.0 * (0.25 * angle**2 * layer - radius * angle**3 / 6.0)
    return longer


def stretches_of(scene: SceneSpec) -> Stretches:
    """Return the stretches of the threaded strip, with means across of its eigenstrain.

    Where heat softens it, its tension stretches it more.
    """
    assert scene.threading is not None
    m, fields = scene.material, (scene.strip.temperature, scene.strip.flatness)
    ends = sorted({0.0}.union(*(dict(field.along) for field in fields if field is not None)))
    pieces = np.arange(TABLE_PIECES * (len(ends) - 1) + 1) / TABLE_PIECES
    labels = np.interp(pieces, np.arange(len(ends)), ends)
    warm, rolled = (0.0 * labels + (0.0 if f is None else f.means(labels)) for f in fields)
    share = np.interp(warm, *np.transpose(m.young_at)) if m.young_at else 1.0
    heat = (m.expansion or 0.0) * warm
    stiffness, eigen = m.young * scene.strip.thickness * share, (heat + I_UNIT * rolled, heat)
    given = scene.threading.tension, stiffness, m.poisson, tuple(map(green_strain, eigen))
    return Stretches(labels, *uniaxial_stretches(*given))


def _with_ends(scene: SceneSpec, thread: Thread) -> Thread:
    """Ends that are not given get level runs, as long as the strip allows.

    They then are points, the same for all fibres: the edges of the strip stay straight.
    """
    missing = sum(end is None for end in thread.ends)
    if not missing:
        thread.middle  # noqa: B018
        return thread
    assert thread.given is not None
    ends = tuple(end or StraightEnd(1.0) for end in thread.ends)
    # whether runs meet where a wrap is large is told by how long they are, not yet known
    trial = replace(thread, ends=ends, crossing=np.ones_like(thread.crossing))
    spare = float(thread.stretches.place(thread.given)) - float(trial.middle.length[0])
    run = 1.0 + spare / missing
    if run <= 0.0:
        replace(thread, ends=ends).middle  # noqa: B018
        least = float(thread.stretches.label(thread.stretches.place(thread.given) - missing * run))
        expected, hint = f"more than {least:.4g} (m) for this way", f"length = {1.3 * least:.3g}"
        raise scene.refused("strip.length", thread.given, expected, hint)
    level = replace(thread, ends=tuple(end or StraightEnd(run) for end in thread.ends)).middle
    places, _ = level.at(np.array([0.0, level.length[0]]), 0)
    return replace(thread, ends=tuple(FixedEnd(place) for place in places.T))


def _depth(scene: SceneSpec, roller: Roller) -> float:
    """Gap at which a roller carries the tension: pressure (T − D/2R²)/R."""
    from anmstrip.mechanics.laws import RepulsiveSignorini

    assert scene.threading is not None and scene.contact is not None
    if scene.contact.constants is None:
        return 0.0  # such a law carries the tension on the surface
    line_force = scene.threading.tension - bending_stiffness(scene) / (2.0 * roller.radius**2)
    pressure = max(line_force, 0.1 * scene.threading.tension) / roller.radius
    gap = float(RepulsiveSignorini(*scene.contact.constants).gap(pressure))
    if gap < -MAX_DEPTH * roller.radius:
        expected = (
            f"a contact that carries the tension: pressed by T/r = {pressure:.3g} Pa the strip "
            f"would sink {-gap:.3g} m into roller {roller.name}, of radius {roller.radius:g} m"
        )
        hint = f"stiffness = {100.0 * pressure / roller.radius:.1g}"
        raise scene.refused("contact.stiffness", scene.contact.stiffness, expected, hint)
    return gap


def _sides_that_fit(scene: SceneSpec, thread: Thread) -> dict[str, str]:
    """Return the fewest sides of rollers, by name, with which a taut string touches all of them.

    Of as many those with the largest least wrap.  None where there are none among ``MOST_WAYS``
    that are tried.
    """
    found: list[tuple[float, tuple[int, ...]]] = []
    each = range(len(thread.rollers))
    ways = chain.from_iterable(combinations(each, count) for count in range(1, 1 + len(each)))
    for turned in islice(ways, MOST_WAYS):
        if found and len(turned) > len(found[0][1]):
            break
        senses = thread.senses.copy()
        senses[list(turned)] *= -1
        with suppress(NotTouchedError, NoTangentError, InputError):
            way = _with_ends(scene, replace(thread, senses=senses))
            found.append((-min(way.turns.values()), turned))
    if not found:
        return {}
    names = (thread.rollers[k].name for k in min(found)[1])
    return {name: _other_side(scene, name) for name in names}


def _order_that_fits(scene: SceneSpec, thread: Thread) -> str:
    """Return the order of rollers, two neighbours swapped, in which their sides fit, or nothing."""
    for k in range(len(thread.rollers) - 1):
        order = [*range(k), k + 1, k, *range(k + 2, len(thread.rollers))]
        with suppress(NotTouchedError, NoTangentError, InputError):
            way = _with_ends(scene, thread.chosen(order))
            return ", ".join(roller.name for roller in way.rollers)
    return ""


def _clear_of(scene: SceneSpec, thread: Thread, index: int) -> tuple[float, list[float]] | None:
    """Return how far from a roller (m) taut strip passes on its side, and a centre that it touches.

    None where strip passes on the other side, by more than the radius, or not at all.
    """
    roller, rollers = thread.rollers[index], list(thread.rollers)
    with suppress(NotTouchedError, NoTangentError, InputError):
        others = [k for k in range(len(rollers)) if k != index]
        way = _with_ends(scene, thread.chosen(others)).middle
        centre = roller.section(np.zeros(1))[0][:, 0]
        s, sense = way.passing(centre, STRIP_SAMPLES)
        towards = way.at(np.array([s]), 0)[0][:, 0] - centre
        gap = float(np.linalg.norm(towards)) - roller.radius
        if sense != thread.senses[index] or not 0.0 < gap < roller.radius:
            return None
        typed = next(each.centre for each in scene.rollers if each.name == roller.name)
        for depth in (TOUCHING_DEPTH, 0.0):  # at pass line where others beside it stand there
            x, z = towards * (1.0 - (1.0 - depth) * roller.radius / (gap + roller.radius))
            rollers[index] = replace(roller, centre=tuple(np.add(roller.centre, [x, 0.0, z])))
            with suppress(NotTouchedError):
                _with_ends(scene, replace(thread, rollers=rollers)).middle  # noqa: B018
                return gap, [round(float(v), 6) for v in np.add(typed, [x, 0.0, z])]
    return None


def _other_side(scene: SceneSpec, name: str) -> str:
    """Return the other side of a roller, "left" or "right" in a line that runs along −x.

    There "over" is below.
    """
    given = next(roller.wrap for roller in scene.rollers if roller.name == name)
    other, ends = OTHER_SIDE[given or "over"], scene.threading
    back = ends and ends.entry and ends.exit and ends.exit[0] < ends.entry[0]
    return {"over": "left", "under": "right"}.get(other, other) if back else other


def _refused(scene: SceneSpec, thread: Thread, error: ValueError) -> InputError:
    """Return what is wrong with the way of the strip, in terms of the scene."""
    rollers = thread.rollers
    index, turn = getattr(error, "index", 0), getattr(error, "turn", None)
    names = [roller.name for roller in rollers]
    if turn is not None:
        own = next(r for r in scene.rollers if r.name == names[index])
        expected = (
            "a side on which the taut strip touches this roller; "
            f"there it would have to turn by {np.degrees(turn):.3g} degrees"
        )
        clear = _clear_of(scene, thread, index)
        fitting = _sides_that_fit(scene, thread)
        hint = f'wrap = "{_other_side(scene, names[index])}"'
        if fitting and set(fitting) != {names[index]}:
            hint = "wrap = " + ", ".join(f'"{new}" of {name}' for name, new in fitting.items())
        for other in scene.rollers:
            if other.wrap is None and 0.0 <= _room(own, other) <= scene.strip.thickness:
                hint = f"no wrap: the strip passes between it and {other.name}, or {hint}"
        if clear is None:
            hint += ", another centre, or no wrap: weight or its move then brings it there"
            hint += "; crossing = true if the strip crosses itself there"
        else:
            gap, centre = clear
            expected += f", as without it the strip passes at {gap:.3g} m"
            laid = any(stage.gravity or own.name in stage.moves for stage in scene.stages)
            brings = "no wrap: weight or its move then brings it there, or " * laid
            hint = f"{brings}centre = {centre}, on which it comes to lie, or {hint}"
        hint = ", or ".join([*_if_in_millimetres(scene), *_heights_for_y(scene, thread), hint])
        if turn < -0.5 * np.pi and (order := _order_that_fits(scene, thread)):  # it doubles back
            hint = f"the tables of rollers in the order {order}, as strip passes them, or {hint}"
        return scene.refused(f"rollers.{names[index]}.wrap", own.wrap, expected, hint)
    if 0 < index < len(names):
        first, second = rollers[index - 1 : index + 1]
        if 0.0 <= _room(first, second) <= scene.strip.thickness:  # as pinch rolls are drawn
            expected = f"wrap on {first.name} or {second.name}, which press the strip between them"
            side = next(r.wrap for r in scene.rollers if r.name == second.name)
            hint = f"no wrap in the table of {second.name}"
            return scene.refused(f"rollers.{second.name}.wrap", side, expected, hint)
    before = names[index - 1] if index else "the entry"
    after = names[index] if index < len(names) else "the exit"
    key = f"rollers.{after}.centre" if index < len(names) else "threading.exit"
    key = key if index else "threading.entry"
    expected = f"room for a straight run from {before} to {after}, which overlap"
    hint = ", or ".join(["a place further away", *_if_in_millimetres(scene)])
    return scene.refused(key, _places(scene)[key], expected, hint)


def _heights_for_y(scene: SceneSpec, thread: Thread) -> Iterator[str]:
    """Yield centres with y and z exchanged, if the strip then passes all rollers as it is asked to.

    Rollers that are typed at z = 0, beside the strip, may come from a drawing with y upwards.
    """
    typed = {r.name: r.centre for r in scene.rollers if r.centre[1] != 0.0 == r.centre[2]}
    moved = []
    for roller in thread.rollers:
        _, y, _ = typed.get(roller.name, (0.0, 0.0, 0.0))
        moved.append(replace(roller, centre=tuple(np.add(roller.centre, [0.0, -y, y]))))
    with suppress(NotTouchedError, NoTangentError, InputError):
        _with_ends(scene, replace(thread, rollers=moved)).middle  # noqa: B018
        yield from (
            f"rollers.{name}.centre = [{x:g}, 0.0, {y:g}]" for name, (x, y, _) in typed.items()
        )


def _places(scene: SceneSpec) -> dict[str, Any]:
    """Return keys of the places between which strip is threaded, as typed (m)."""
    assert scene.threading is not None
    centres = {f"rollers.{roller.name}.centre": roller.centre for roller in scene.rollers}
    return centres | {f"threading.{name}": getattr(scene.threading, name) for name in ENDS}


def _room(first: Roller | RollerSpec, second: Roller | RollerSpec) -> float:
    """Return the distance between two rollers (m), but for round-off."""
    apart = float(np.linalg.norm(np.subtract(second.centre, first.centre)))
    return round(apart - first.radius - second.radius, 12)


def _if_in_millimetres(scene: SceneSpec) -> Iterator[str]:
    """Yield what to type besides if radii or places, far larger than all others, are in mm.

    Places that are all as far from the origin of a drawing are not, nor are centres that count from
    another one than the ends, nor what stands beside a modulus in MPa.
    """
    if meant_modulus(scene.material.young) is not None:
        return
    for roller in scene.rollers:
        if roller.radius > LARGEST_RADIUS:
            yield f"rollers.{roller.name}.radius = {1e-3 * roller.radius:g} if it is in mm"
            return
    places = {key: place for key, place in _places(scene).items() if place}
    radii, centres = zip(*((roller.radius, roller.centre) for roller in scene.rollers), strict=True)
    together = np.array(list(places.values()), dtype=float)
    if not np.isfinite(_far_size(radii, together - _common_offset(together))):
        return
    far, drawn = _far_size(radii, together), np.array(centres)
    offset = _common_offset(drawn)
    apart = np.isfinite(_far_size(radii, drawn - offset))
    if np.abs(offset).max() >= far and len(drawn) > 1 and not apart:
        yield (
            "threading.entry and threading.exit from the same origin as the centres, which are all "
            f"about {np.linalg.norm(offset):.3g} m away from it"
        )
        return
    typed = [
        f"{key} = [{', '.join(f'{1e-3 * x if abs(x) >= far else x:g}' for x in place)}]"
        for key, place in places.items()
        if max(map(abs, place)) >= far
    ]
    if typed:
        yield f"{', '.join(typed)} if it is in mm there"


def _common_offset(places: Array) -> Array:
    """Return the least coordinates (m) where all are farther from 0 than from each other, else 0.

    Places have the shape (n, 3).
    """
    least = np.abs(places).min(axis=0)
    return np.where(least > np.ptp(places, axis=0), np.copysign(least, places[0]), 0.0)


def _far_size(radii: Sequence[float], places: Array) -> float:
    """Return the size (m) from which radii and coordinates are far larger than all others."""
    sizes = np.unique([*radii, *np.abs(places).ravel()])
    sizes = sizes[sizes >= min(radii)]
    return float(sizes[1:][sizes[1:] > FAR_AWAY * sizes[:-1]].min(initial=np.inf))
