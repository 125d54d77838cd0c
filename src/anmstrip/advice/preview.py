"""A scene before it runs: its stages, the strip as a taut string, and motions that nothing holds.

Those are null vectors of the tangent, told in words with what to type.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from anmstrip.arrays import Array
from anmstrip.equilibrium import Equilibrium, StageProblem
from anmstrip.linalg.direct import Factors, SingularTangentError
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.roller import Roller, placed
from anmstrip.mechanics.string_path import (
    End,
    FixedEnd,
    NoTangentError,
    NotTouchedError,
    StraightEnd,
    StringPath,
    string_path,
)
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.scene.tables import ENDS, SIDES, EdgeSpec
from anmstrip.simulation import defaults
from anmstrip.simulation.meshing import axis_crossing
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course, uniform_stretch
from anmstrip.timestepping.formulas import AffineVelocity

REACHED_SAG = 1.0 / 16.0
"""Of a span: at least half of what strip sags by whose weight is as large as its tension."""


@dataclass(frozen=True)
class Preview:
    """A scene before it runs."""

    assembly: Assembly
    plans: Sequence[StageProblem]  # the stages as they would be solved
    strings: Sequence[StringEstimate]  # the strip as a taut string at the end of each

    @classmethod
    def of(cls, assembly: Assembly) -> Preview:
        """Walk through all stages."""
        course, strings = Course(assembly), list[StringEstimate]()
        plans = list[StageProblem]()
        for stage in assembly.scene.course:
            if stage.steady and plans and plans[-1].in_time:
                course.hold_entry_again()
            plans.append(course.plan(stage, {}))
            course.finish(stage)
            strings.append(string_estimate(course))
        return cls(assembly, plans, strings)

    def __iter__(self) -> Iterator[tuple[StageSpec, StageProblem, StringEstimate]]:
        """Yield stages as typed and as they would be solved, and the string at the end of each."""
        return zip(self.stages, self.plans, self.strings, strict=True)

    @property
    def stages(self) -> Sequence[StageSpec]:
        """The stages that are seen: of a run that stopped up to the one where it did."""
        return self.assembly.scene.course[: len(self.plans)]

    @property
    def tension(self) -> float:
        """Largest force of the scene (N/m)."""
        return defaults.largest_force(self.assembly.scene)

    @property
    def steepest(self) -> StringEstimate:
        """The string with the largest slope, the first of equal ones."""
        return max(self.strings, key=lambda string: round(string.slope, 9))

    def turn(self, roller: Roller) -> float:
        """Largest wrap of a roller in any stage (rad)."""
        return max((string.turns.get(roller.name, 0.0) for string in self.strings), default=0.0)

    def lies(self, roller: Roller) -> tuple[Array, float] | None:
        """Direction to the middle of the wrap and the wrap (rad), None where nothing touches it."""
        name = roller.name
        found = [(s.places[name], s.turns[name]) for s in self.strings if name in s.places]
        return found[0] if found else None

    def passes(self, roller: Roller) -> str:
        """Say on which side of a roller the strip is, in the middle of its wrap, seen along y."""
        here = self.lies(roller)
        if here is None:
            return "–"
        x, z = here[0]
        if abs(z) >= abs(x):
            return "above" if z > 0.0 else "below"
        return "to the right" if x > 0.0 else "to the left"


@dataclass(frozen=True)
class StringEstimate:
    """The strip at the end of a stage, seen as a taut string."""

    turns: dict[str, float]  # wraps of the rollers that are touched (rad)
    senses: dict[str, str]  # "over" or "under", of those
    slope: float  # steepest angle to the flat strip, sag included (rad)
    places: dict[str, Array] = field(default_factory=dict)  # direction to the middle of the wrap
    path: StringPath | None = None  # around those rollers; None where it touches none
    gaps: dict[str, float] = field(default_factory=dict)  # least ones of all rollers (m)
    span: float = 0.0  # longest straight run between rollers, or ones below it, from above (m)


def string_estimate(course: Course) -> StringEstimate:
    """Lay a taut string over or under the rollers, where they are at the end of a stage.

    An end that is held is where it was moved to, a free one runs in the direction of its
    force.  Rollers that a taut string would not touch are left out, and those that lie along
    the strip.  Between rollers L apart a string sags by q L / 2 T, a beam by at most q L³ / 6 D;
    both carry together.  Flat strip between edges that are held sags by less, and by no more than
    it would between its sides alone, if they are.  Where both ends are held, strip that sags by s
    stretches by s² / 6, and E t s³ / 3 carries q L.  On an elastic foundation k it sinks by q/k,
    and an end that is held or moved by as much turns by that over (4 D/k)^(1/4) or √(T/k),
    whichever is longer.
    """
    a, values = course.assembly, course.values
    weight = a.strip.mass * abs(values.get("gravity", np.zeros(3))[2])
    load = float(weight + abs(values.get("pressure", 0.0)))

    tension = defaults.largest_force(a.scene) or defaults.tension_of_moves(a.scene)
    held = len(defaults.held_ends(a.scene)) == len(ENDS)
    stretches = held * a.scene.material.young * a.strip.thickness
    k, bends = a.scene.strip.foundation or 0.0, defaults.bending_stiffness(a.scene)
    reach = max((4.0 * bends / k) ** 0.25, np.sqrt(tension / k), 1e-300) if k else np.inf

    def sag(span: float, share: float = CANTILEVER) -> float:
        if not load:
            return 0.0
        stiffness = 2.0 * tension / span + share * bends / span**3
        slopes = [load / stiffness if stiffness else np.inf]
        if stretches:
            slopes.append(np.cbrt(3.0 * load * span / stretches))
        if k:
            slopes.append(load / (k * reach))
        return float(np.arctan(min(slopes)))

    if (found := laid_string(course)) is not None:
        path, rollers, centres = found
        names = [roller.name for roller, _ in rollers]
        angles = path.angles[0::2, 0]
        slopes = np.arctan2(np.sin(angles), np.cos(angles))
        middles = path.at(0.5 * (path.arcs.start[:, 0] + path.arcs.end[:, 0]), 0)[0].T
        arcs = zip(*(part[:, 0] for part in path.arcs), strict=True)
        # chords cut in by r/3200
        looks = [np.linspace(start, end, int(20.0 * turn) + 2) for start, end, turn in arcs]
        joints = np.unique(np.concatenate([path.starts[:, 0], *looks]))
        sides = ["over" if sense > 0.0 else "under" for _, sense in rollers]
        kept = path.arcs.turn[:, 0].tolist(), sides, middles - centres
        turns, sides_of, places = (dict(zip(names, values, strict=True)) for values in kept)
        gaps = roller_gaps(course, path.at(joints, 0)[0])
        slope = float(np.abs(slopes).max()) + sag(float(np.diff(path.starts[:, 0])[::2].max()))
        span = carried_span(course, path, {n: gap for n, gap in gaps.items() if n not in turns})
        return StringEstimate(turns, sides_of, slope, places, path, gaps, span)
    entry, exit = (thread_end(course, name) for name in ENDS)
    moved = [course.moved.get(name, np.zeros(3)) for name in ENDS]
    straight = np.array([[x, 0.0] for x in a.strip.span]) + np.array(moved)[:, [0, 2]]
    gaps = roller_gaps(course, straight.T)
    if isinstance(entry, FixedEnd) and isinstance(exit, FixedEnd):
        along = np.subtract(exit.position, entry.position)
        slope = float(abs(np.arctan2(along[1], along[0])))
    else:
        slope = max(abs(end.angle) for end in (entry, exit) if isinstance(end, StraightEnd))
    length = a.strip.length
    slope = max(slope, *(abs(float(move[2])) / reach for move in moved))
    sagged = sag(length, beam_share(course, ENDS))
    if bends and (across := beam_share(course, SIDES)) > CANTILEVER:
        sagged = min(sagged, float(np.arctan(load * a.strip.width**3 / (across * bends))))
    return StringEstimate({}, {}, float(slope) + sagged, gaps=gaps, span=length)


def beam_share(course: Course, edges: Iterable[str]) -> float:
    """Return n in the slope q L³ / n D of a beam between two edges, as they are held in a stage."""
    scene = course.assembly.scene
    held = set(edges).intersection(scene.held_in("z")) - course.released
    if len(held) < len(ENDS):
        return CANTILEVER
    return BETWEEN_SUPPORTS[len(held.intersection(scene.clamped))]


def laid_string(course: Course) -> tuple[StringPath, list[tuple[Roller, float]], Array] | None:
    """Return a taut string, the rollers that it touches, with senses, and places on their axes.

    None where it touches none.  It is as long as the strip if one of its ends is not held.
    """
    a, values = course.assembly, course.values
    entry, exit = (thread_end(course, name) for name in ENDS)
    crossing = {spec.name for spec in a.scene.rollers if spec.crossing}
    rollers: list[tuple[Roller, float]] = []
    if a.scene.contact is not None and a.thread is not None:
        rollers = list(zip(a.thread.rollers, a.thread.senses, strict=True))
    elif a.scene.contact is not None:
        across = [roller for roller in a.rollers if abs(roller.unit_axis[1]) > 0.1]
        across.sort(key=lambda roller: roller.centre[0])
        rollers = [(roller, 1.0 if roller.centre[2] < 0.0 else -1.0) for roller in across]
    while rollers:
        here = placed([roller for roller, _ in rollers], values)
        centres, radii = zip(*(roller.section(np.zeros(1)) for roller in here), strict=True)
        crossed = [roller.name in crossing for roller in here]
        given = centres, radii, [float(sense) for _, sense in rollers]
        try:
            path = string_path(*given, entry, exit, crossed)
            if isinstance(entry, StraightEnd) != isinstance(exit, StraightEnd):
                rest = a.strip.length - float(path.length[0])
                entry, exit = longer(entry, rest), longer(exit, rest)
                path = string_path(*given, entry, exit, crossed)
            return path, rollers, np.array(centres)[:, :, 0]
        except (NotTouchedError, NoTangentError) as error:
            del rollers[min(error.index, len(rollers) - 1)]
    return None


def longer(end: End, length: float) -> End:
    """Return an end with a straight run that is longer (m), if it has one and one is left."""
    if not isinstance(end, StraightEnd):
        return end
    run = float(np.asarray(end.length)) + length
    return StraightEnd(run, end.angle) if run > 0.0 else end


def carried_span(course: Course, path: StringPath, gaps: Mapping[str, float]) -> float:
    """Return the longest straight run of a string, seen from above, between what carries it (m).

    Rollers besides those around which it runs do so where they are below a run, by less than
    strip of its own weight would sag there.
    """
    joints, longest = path.at(path.starts[:, 0], 0)[0], 0.0
    for (x, z), (end, low) in zip(joints.T[:-1:2], joints.T[1::2], strict=True):
        marks = [x, end]
        for roller in placed(course.assembly.rollers, course.values):
            place = axis_crossing(roller)
            share = (place[0] - x) / (end - x) if end != x else 0.0
            below = 0.0 < share < 1.0 and place[1] < z + share * (low - z)
            if below and gaps.get(roller.name, np.inf) < REACHED_SAG * abs(end - x):
                marks.append(place[0])
        longest = max(longest, float(np.diff(np.sort(marks)).max()))
    return longest


def roller_gaps(course: Course, places: Array) -> dict[str, float]:
    """Return the least gap (m) between every roller and straight pieces between places, (2, n)."""
    gaps, step = {}, np.diff(places)
    longest = float(np.hypot(*step).max(initial=0.0))
    for roller in placed(course.assembly.rollers, course.values):
        way = axis_crossing(roller)[:, None] - places[:, :-1]
        distance = np.sqrt((way**2).sum(axis=0))
        near = distance <= distance.min() + longest  # others are behind these pieces
        way, piece = way[:, near], step[:, near]
        square = np.maximum((piece**2).sum(axis=0), np.finfo(float).tiny)
        nearest = way - np.clip((way * piece).sum(axis=0) / square, 0.0, 1.0) * piece
        gaps[roller.name] = float(np.hypot(*nearest).min()) - float(roller.radius + roller.half)
    return gaps


def thread_end(course: Course, name: str) -> End:
    """Place of an end, or the direction in which it is pulled, or else in which it was laid."""
    x, edges = course.assembly.strip.mesh.p[0], course.assembly.scene.edges
    if course.assembly.closed and course.assembly.thread is not None:
        end: End = course.assembly.thread.ends[0]
        return end
    if name in edges and "z" in edges[name].fixed:  # released ones stay about where they were
        moved = course.moved.get(name, np.zeros(3))
        return FixedEnd([(x.max() if name == "exit" else x.min()) + moved[0], moved[2]])
    force = np.asarray(course.values.get(f"{name}.force", np.zeros(3)))
    outward = np.array([1.0 if name == "exit" else -1.0, 0.0, 0.0])
    way = force if force.any() else course.outward.get(name, outward)
    way = way if name == "exit" else -way
    return StraightEnd(0.25 * float(np.ptp(x)), float(np.arctan2(way[2], way[0])))


CANTILEVER = 6.0
"""D/q L³ over the slope of a beam at its free end, the largest there is."""

BETWEEN_SUPPORTS = (24.0, 48.0, 72.0 * 3.0**0.5)
"""The same of a beam between two supports, of which none, one or both are clamped."""

FREE_STIFFNESS = 1e-4
"""Stiffness of a motion, over force/length of the scene, below which nothing holds the strip.

Measured on 105 stages of the examples and of lines of the field: 0.6 at the least; of motions that
nothing holds 3e-9 at the most.
"""

MAX_FREE_MOTIONS = 3
"""Motions that are looked for at once: along, across and out of the plane."""

INVERSE_ITERATIONS = 6
"""Of the inverse iteration: what is free is 1e8 times softer than the rest, so that two do."""

NEGLIGIBLE_BEARING = 1e-3
"""Torque of bearings that hardly counts, over that of the tension."""

INDIFFERENT_WORK = 1e-6
"""Share of the forces that may work on a motion to an equilibrium that is indifferent to it."""


def softest_motions(factors: Factors, metric: Array) -> Iterator[tuple[float, Array]]:
    """Yield |μ| and x of K x = μ M x, the least |μ| first, by inverse subspace iteration.

    Parameters
    ----------
    factors : Factors
        Of K, (n, n).
    metric : ndarray, shape (n,)
        Diagonal of M, zero where a motion does not count.

    Yields
    ------
    stiffness : float
    motion : ndarray, shape (n,)
    """
    root, count = np.sqrt(metric), min(MAX_FREE_MOTIONS, int(np.count_nonzero(metric)))
    motions = np.cos(np.outer(np.arange(1.0, len(metric) + 1.0) ** 2, np.arange(1.0, count + 1.0)))
    for _ in range(INVERSE_ITERATIONS):
        basis, _ = np.linalg.qr(root[:, None] * motions)
        motions = np.stack([factors.solve(root * column) for column in basis.T], axis=1)
    softness, shapes = np.linalg.eig(basis.T @ (root[:, None] * motions))
    for k in np.argsort(-np.abs(softness)):
        yield 1.0 / abs(softness[k]), (motions @ shapes[:, k]).real


def free_motions(preview: Preview) -> Iterator[str]:
    """Yield what nothing holds in any stage, as far as its state is known before a run."""
    assembly, known, told = preview.assembly, set[object](), set[str]()
    guess = None if assembly.thread is None else assembly.laid
    for plan in preview.plans:
        acting = (plan.supports.free.tobytes(), *(effect.name for effect in plan.model.effects))
        if acting in known:
            continue
        found = [(plan, guess)] if guess is not None else flat_states(assembly, plan, not known)
        for part, full in found:
            for words in motions_at(assembly, part, full, float(guess is None)):
                if words not in told:
                    told.add(words)
                    yield f"in stage {plan.name} {words}"
        known.add(acting)


def flat_states(
    assembly: Assembly, plan: StageProblem, first: bool
) -> Iterator[tuple[StageProblem, Array]]:
    """Yield a stage of a flat strip with its state, stretched by what pulls there, (unknowns,).

    Weight along it stretches it by the mean of its tension.
    Strip that yields is stretched no further than half of that: what holds it is the same.
    What the strip touches after the first stage is not known; but from a roller to an end that is
    pulled along its own direction it is straight again, and turns about the roller as it would
    about its other end.
    """
    strip, end, most = assembly.strip, plan.controls.at(1.0), np.inf
    if assembly.scene.material.plasticity is not None:
        most = 0.5 * float(assembly.scene.material.yield_stress or np.inf) * strip.thickness
    along, pulls = (
        [min(most, float(np.linalg.norm(end.get(f"{name}.{key}", 0.0)))) for name in ENDS]
        for key in ("tension", "force")
    )
    if first:
        bends = assembly.scene.strip.bending
        drawn = defaults.tension_of_moves(assembly.scene) if bends else assembly.scales.tension
        pull = abs(end.get("gravity", np.zeros(3))[0]) * (assembly.scene.material.density or 0.0)
        hung = 0.5 * pull * strip.thickness * strip.length
        tension = max(along + pulls) or min(most, max(drawn, hung))
        yield plan, uniform_stretch(assembly, tension, end)
        return
    effects = [effect for effect in plan.model.effects if not effect.by_roller]
    for tension, other in zip(along, ENDS[::-1], strict=True):
        if not tension:
            continue
        held = strip.count * strip.edges[other].trace[:, None] + np.arange(strip.count)
        supports = replace(plan.supports, free=np.setdiff1d(plan.supports.free, held))
        run = replace(plan, model=plan.model.with_effects(effects), supports=supports)
        yield run, uniform_stretch(assembly, tension, end)


def motions_at(assembly: Assembly, plan: StageProblem, full: Array, share: float) -> Iterator[str]:
    """Yield a sentence for every motion that nothing holds at a state, at a share of its stage."""
    free, model = plan.supports.free, plan.model
    held, u, rate = full.copy(), full[free], 1.0 / plan.duration
    held[free] = 0.0
    velocity = AffineVelocity(rate, -rate * u, np.zeros_like(u)) if plan.in_time else None
    still = replace(plan.supports, start=held, slope=np.zeros_like(full), bow=None)
    equations = Equilibrium(model, still, Controls(plan.controls.at(share)), velocity)
    series, force = equations.recurrence(u, 1.0, 1), model.scales.force
    try:
        factors = SparseSolver().factorise(series.tangent())
    except (MemoryError, SingularTangentError):  # the run will say so
        return
    for stiffness, motion in softest_motions(factors, equations.metric):
        if not stiffness < FREE_STIFFNESS * force * model.scales.length:
            return
        moved = np.zeros(model.unknowns)
        moved[free] = motion
        moved /= np.abs(moved[model.value_unknowns]).max()
        indifferent = bool(abs(moved[free] @ series.residual) < INDIFFERENT_WORK * force)
        yield from motion_words(assembly, plan, moved, indifferent)


def motion_words(
    assembly: Assembly, plan: StageProblem, moved: Array, indifferent: bool
) -> Iterator[str]:
    """Yield the sentence for one motion, of size 1.

    A motion that leaves both ends in place is a mode of buckling.  A turn on which forces work
    goes on until they no longer do.
    """
    strip, edges = assembly.strip, assembly.scene.edges
    nodal = np.abs(strip.nodal(moved[: strip.unknowns]))
    sizes = np.array([nodal[strip.edges[name].values].max(axis=0) for name in ENDS])
    place = int(sizes.max(axis=0).argmax())
    least, most = np.sort(sizes[:, place])
    shifted = least > 0.5 * most
    if most < 0.5 or not (shifted or indifferent):
        return
    component = "xyz"[strip.kinematics.components[place]]
    end = ENDS[int(sizes[:, place].argmax())]
    if shifted:
        end = edge_to_hold(assembly.scene)
    fixed = edges.get(end, EdgeSpec()).fixed
    advice = f"try --set 'edges.{end}.fixed={json.dumps(sorted({*fixed, component}))}'"
    if component in fixed:
        advice = f"try it without {end}.release."
    elif shifted:
        yield unheld_words(assembly.scene, plan.name, component)
        return
    loose = f"nothing holds the strip in {component}"
    if not shifted:
        pulled, way = np.any(plan.controls.at(1.0).get(f"{end}.tension", 0.0)), "free"
        if pulled:
            way = "pulled along its own direction and free"
            advice = f"give {end}.force, which has a direction of its own, or {advice}"
        loose = (
            f"the {end} is {way} in {component}: it is in equilibrium at any angle, and its place "
            "is what came before"
        )
    yield f"{loose}. {as_sentence(advice)}"


def edge_to_hold(scene: SceneSpec) -> str:
    """Return the edge that is proposed to be held: one that is, an end first, or the entry."""
    return min(scene.edges, key=lambda name: name not in ENDS, default=ENDS[0])


def unheld_words(scene: SceneSpec, stage: str, component: str) -> str:
    """Say that nothing holds a strip in a component in a stage, and what to type.

    What is held in x is let go in the first stage after that one in which rollers turn, so that
    they carry it; what a stage before has let go is held on.
    """
    edge = edge_to_hold(scene)
    before = scene.edges.get(edge, EdgeSpec()).fixed
    for each in scene.stages if component in before else ():
        if each.edge(edge).release:
            key = f"stages.{each.name}.{edge}.release=false"
            return f"nothing holds the strip in {component}. Try --set {key}"
    key = f"'edges.{edge}.fixed={json.dumps(sorted({*before, component}))}'"
    if component == "y":
        key = f"edges.{edge}.centred=true"
    names = [each.name for each in scene.course]
    turning = [
        each.name
        for each in scene.course[names.index(stage) if stage in names else len(names) :]
        if any(c.surface_speed or c.angular_speed or c.torque for c in each.rollers.values())
    ]
    if component == "x" and edge in ENDS and turning:
        let_go = f" and turn the rollers in a later stage, with {edge}.release = true there."
        if later := [name for name in turning if name != stage]:
            let_go = f" --set stages.{later[0]}.{edge}.release=true"
        key += let_go
    return f"nothing holds the strip in {component}. Try --set {key}"


def as_sentence(words: str) -> str:
    """Return words with a capital letter in front, but keys as they are typed."""
    key = "." in words.split(" ", 1)[0].rstrip(".")
    return words if key else words[:1].upper() + words[1:]
