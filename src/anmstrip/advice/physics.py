"""What is wrong with the physics of a line, by statics and before it runs.

Every rule is a function that looks at a :class:`~anmstrip.advice.preview.Preview` and yields
sentences, each with what to type.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from anmstrip.advice.preview import Preview
from anmstrip.advice.units import in_megapascals, told_stress, typed_vector
from anmstrip.arrays import Array
from anmstrip.equilibrium import StageProblem
from anmstrip.fem.sampling import quadrature_points, shape_of
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.roller import Roller, placed
from anmstrip.mechanics.shell import eigenstrain
from anmstrip.mechanics.string_path import NoTangentError, NotTouchedError
from anmstrip.results.wrinkles import TO_SIDES
from anmstrip.scene.checks import PARALLEL_COSINE, ROUND_OFF, moved_ends
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.scene.tables import ENDS, EdgeSpec
from anmstrip.simulation.defaults import (
    bending_stiffness,
    bent_curvature,
    coefficient_on,
    distributed_load,
    edge_pulls,
    flow_stress,
    given_tensions,
    held_ends,
    largest_force,
    typed_tensions,
    varies_along,
)
from anmstrip.simulation.meshing import (
    MAX_LYING_TURN,
    NIP_RANGE,
    Nip,
    axis_crossing,
    carrying_sense,
    label_at,
    lengths_of_runs,
    rollers_in_stages,
    surface_speed,
    threaded_around,
)
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import ALIGNED_SINE, Course
from anmstrip.simulation.threading import STRIP_SAMPLES

METAL_YIELD_STRAIN = 5e-3
"""Strain at which no metal is elastic any more, for a scene without a yield stress."""

METAL_MODULUS = 1e10
"""Young's modulus (Pa) from which a strip is taken for metal; film and paper have less."""

LARGEST_ELONGATION = 0.05
"""Strain of strip that hardens up to which a line may stretch it as a whole, unsaid: no
tension leveller stretches by as much."""

CLEARANCE = 1.01
"""Distance of axes over the sum of radii that is proposed of rollers that move into one another."""

GRAZING_DEPTH = 1e-3
"""Share of a roller's radius by which a string may be nearer to it than its surface."""

SPEED_DIFFERENCE = 0.01
"""Share by which speeds of rollers may differ: far more than the elastic creep of any strip."""

BRAKING_SHARE = 0.1
"""Share of its tension to which rollers may brake a strip, unsaid."""

SAFE_ANGLE_SHARE = 0.8
"""Share of the angle, or of the uneven strain, at which an edge is slack that is proposed."""

PROFILE_SAMPLES = 41
"""Of the profile of a roller below a strip."""

SAGGING_SHARE = 1.1
"""Tension over what friction holds on the wraps of a taut string, up to which the longer wraps of
strip that sags may hold it: by 4 % in a line of 350 m."""

MAX_AXIS_ANGLE = 0.01
"""Angle (rad) of a roller out of line from which it is told, whatever its line: strip of 0.5 mm and
1 m under 5 kN/m, 2 m from the roller before, can be laid at 0.005, and not at 0.02."""

VISIBLE_TURN = 0.05
"""Angle (rad), 3°, by which weight turns the last run of strip so that it is told."""

SLENDER_RUN = 1.0
"""Least length of a run, in widths of the strip, that bends in its plane as a beam."""

BENT_ITERATIONS = 20
"""Iterations of the tension after a roller, whose bending depends on itself."""

NIP_SAFETY = 1.2
"""Force of a nip, an estimate, over the one by which friction would just hold the strip."""

CRUSHING_SHARE = 0.02
"""Pressure of a nip over Young's modulus from which on its gap is taken for a mistake."""

PLACE_DECIMALS = 9
"""Decimals of a place (m) that is typed: the rest is round-off."""


def meeting_rollers(preview: Preview) -> Iterator[str]:
    """Rollers that move into one another: those that press the strip may come as far as that."""
    pressed = [set(nip.names) for found in preview.assembly.nips for nip in found]
    for plan in preview.plans:
        end = plan.controls.at(1.0)
        moving = {key for key, slope in plan.controls.slope.items() if np.any(slope)}
        for a, b in combinations(preview.assembly.rollers, 2):
            keys = [f"rollers.{roller.name}.centre" for roller in (a, b)]
            if not moving.intersection(keys) or abs(a.unit_axis @ b.unit_axis) < PARALLEL_COSINE:
                continue
            way = across(np.subtract(*(np.asarray(end[key]) for key in keys)), a.unit_axis)
            overlap = a.radius + b.radius - float(np.linalg.norm(way))
            if overlap >= -ROUND_OFF * a.radius:
                moved, towards = (a, way) if keys[0] in moving else (b, -way)
                apart = a.radius + b.radius
                thick = float(a.half + b.half) if {a.name, b.name} in pressed else 0.0
                apart = apart + thick if thick else CLEARANCE * apart
                how = shorter_move(plan, moved, towards, apart)
                far = f"{overlap:.2g} m into one another"
                far = far if overlap > ROUND_OFF * a.radius else "until they touch each other"
                yield f"stage {plan.name} moves {a.name} and {b.name} {far}. Try {how}"


def across(way: Array, axis: Array) -> Array:
    """Return the part of a way that is perpendicular to a unit axis, (3,)."""
    return np.asarray(way - (way @ axis) * axis)


def roller_over_an_end(preview: Preview) -> Iterator[str]:
    """Rollers that move over an end of the strip which is held at its place."""
    assembly, edges = preview.assembly, preview.assembly.scene.edges
    if assembly.closed:
        return
    places, components = np.array([assembly.strip.span, (0.0, 0.0)]), {"z"}
    where = " at x = {:g} m"
    if assembly.thread is not None:
        middle, components, where = assembly.thread.middle, {"x", "z"}, ""
        places, _ = middle.at(np.array([0.0, float(middle.length[0])]), 0)
    held = {name for name in ENDS if name in edges and components <= set(edges[name].fixed)}
    for stage, plan, _ in preview:
        held -= {name for name, edge in stage.edges.items() if edge.release}
        for roller in assembly.rollers:
            centre = f"rollers.{roller.name}.centre"
            if not np.any(plan.controls.slope.get(centre, 0.0)):
                continue
            for name, (x, z) in zip(ENDS, places.T, strict=True):
                end = np.array([x, 0.0, z])
                ways = [
                    across(plan.controls.at(share)[centre] - end, roller.unit_axis)
                    for share in np.linspace(0.0, 1.0, MOVE_SAMPLES)
                ]
                depths = [roller.radius - float(np.linalg.norm(way)) for way in ways]
                grazing, inside = GRAZING_DEPTH * roller.radius, max(depths)
                if name in held and depths[0] < grazing < inside:
                    shorter = shorter_move(plan, roller, ways[-1], CLEARANCE * roller.radius)
                    yield (
                        f"stage {plan.name} moves {roller.name} {inside:.2g} m over the {name} of "
                        f"the strip{where.format(x + assembly.origin[0])}. Try {shorter}"
                    )


MOVE_SAMPLES = 21
"""Places of a roller on its way at which it is looked at."""


def shorter_move(plan: StageProblem, moved: Roller, way: Array, apart: float) -> str:
    """Return what to type for a roller that stops on its way at a distance from another (m).

    ``way`` (m) leads from the other one to its end, which is q of its move m too far:
    |way − q m| = ``apart``.  Where it is no further away at the start no move is named.
    """
    key, told = f"rollers.{moved.name}.centre", f"stages.{plan.name}.rollers.{moved.name}.move"
    move = np.asarray(plan.controls.slope[key], dtype=float)
    sideways = across(move, moved.unit_axis)
    half, square = float(way @ sideways), float(sideways @ sideways)
    q = (half + np.sqrt(half**2 + square * (apart**2 - float(way @ way)))) / square
    if q > 1.0:
        return f"a shorter {told}."
    end = np.asarray(plan.controls.at(1.0)[key]) - q * move
    return f"--set '{told}={typed_vector(end - moved.centre, '.4g')}'"


def roller_in_the_way(preview: Preview) -> Iterator[str]:
    """Rollers through which the strip is laid, on its way between others."""
    assembly = preview.assembly
    if assembly.thread is None:
        return
    drawn, *_ = assembly.nips
    nipping = {name for nip in drawn if nip.gap >= 0.0 for name in nip.names}
    for roller in assembly.rollers:
        inside = -preview.strings[0].gaps.get(roller.name, 0.0)
        if inside > GRAZING_DEPTH * roller.radius and roller.name not in nipping:
            told = f'rollers.{roller.name}.wrap = "over" or "under", in its place among the others'
            if roller.name in assembly.thread.turns:  # it is passed elsewhere
                told = "threading.entry in the place of threading.exit, or rollers in another order"
            yield (
                f"the threaded strip would run {inside:.2g} m inside of roller {roller.name}. "
                f"Try {told}, or another rollers.{roller.name}.centre."
            )


def beyond_flat_strip(preview: Preview) -> dict[str, float]:
    """Rollers past an end of flat strip that stays where it is, and how far past (m).

    A drawing may count from the entry, and a rectangle lies about the origin.
    """
    assembly, scene = preview.assembly, preview.assembly.scene
    ends = [end for stage in scene.stages for end in stage.edges.values()]
    turns = [turn for stage in scene.stages for turn in stage.rollers.values()]
    led = any(end.move or end.velocity or end.speed or end.release for end in ends)
    driven = any(turn.surface_speed or turn.angular_speed or turn.torque for turn in turns)
    if assembly.thread is not None or led or driven or not scene.held_in("x"):
        return {}
    first, last = assembly.strip.span
    found = dict[str, float]()
    for roller in assembly.rollers:
        key = f"rollers.{roller.name}.centre"
        x = [plan.controls.at(t)[key][0] for plan in preview.plans for t in (0.0, 1.0)]
        past = min(max(first - each, each - last) for each in x)
        if past > roller.radius and abs(roller.unit_axis[1]) > 0.1:
            found[roller.name] = past
    return found


def roller_beyond_strip(preview: Preview) -> Iterator[str]:
    """Rollers that flat strip does not reach along itself."""
    first, last = np.array(preview.assembly.strip.span) + preview.assembly.origin[0]
    for name, past in beyond_flat_strip(preview).items():
        yield (
            f"roller {name} is {past:.3g} m past an end of the strip, which lies from x = "
            f"{first:g} to {last:g} m and stays there. Try another rollers.{name}.centre."
        )


def untouched_roller(preview: Preview) -> Iterator[str]:
    """Rollers that the strip never touches, or comes off when they move."""
    scene, thread = preview.assembly.scene, preview.assembly.thread
    if scene.contact is None:
        return
    beyond, loaded = beyond_flat_strip(preview), distributed_load(scene) > 0.0
    for roller in preview.assembly.rollers:
        if not abs(roller.unit_axis[1]) > 0.1 or roller.name in beyond:
            continue
        if loaded and not hangs_below(preview, roller):
            continue
        gap = min(string.gaps.get(roller.name, 0.0) for string in preview.strings)
        missed = gap > GRAZING_DEPTH * roller.radius and not moved_through(preview, roller)
        squeeze = closest_nip(preview, roller)
        if preview.turn(roller) == 0.0 and missed and squeeze <= 0.0:
            faces = "--set contact.faces=true, " if squeeze > -np.inf and not roller.half else ""
            yield (
                f"roller {roller.name} is touched by nothing: the strip passes at {gap:.2g} m. "
                f"Try {faces}another rollers.{roller.name}.centre, a move that long in a "
                "stage, or take the roller out."
            )
        touched = False
        for stage, _, string in preview:
            wrapped, before = thread is not None and roller.name in thread.turns, touched
            touched = roller.name in string.turns
            leaves = f"the strip comes off roller {roller.name} in stage {stage.name}"
            if wrapped and stage.moves and not touched:
                yield (
                    f"{leaves}, which moves {' and '.join(stage.moves)}. "
                    f"Try shorter moves (stages.{stage.name}.rollers)."
                )
                break
            if wrapped and before and not touched:
                yield from (f"{leaves}{why}" for why in pulled_off(preview.assembly, stage))


def hangs_below(preview: Preview, roller: Roller) -> bool:
    """Whether threaded strip passes below a roller, so that weight alone draws it further away."""
    stages, place = preview.assembly.scene.stages, axis_crossing(roller)
    if any(stage.pressure or (stage.gravity or (0.0, 0.0, 0.0))[2] > 0.0 for stage in stages):
        return False
    for string in preview.strings:
        if string.path is None:
            return False
        s, _ = string.path.passing(place, STRIP_SAMPLES)
        away = string.path.at(np.array([s]), 0)[0][:, 0] - np.ravel(place)
        if away[1] > -0.5 * np.linalg.norm(away):
            return False
    return True


def closest_nip(preview: Preview, roller: Roller) -> float:
    """Return the largest squeeze (m) of nips between which a roller presses strip, −∞ of none."""
    stages = preview.assembly.nips
    found = [nip.squeeze for nips in stages for nip in nips if roller.name in nip.names]
    return max(found, default=-np.inf)


def moved_through(preview: Preview, roller: Roller) -> bool:
    """Whether a stage moves a roller to the other side of the string around the others."""
    key = f"rollers.{roller.name}.centre"
    for _, plan, string in preview:
        path = string.path
        if path is None or not np.any(plan.controls.slope.get(key, 0.0)):
            continue
        ends = (axis_crossing(*placed([roller], plan.controls.at(share))) for share in (0.0, 1.0))
        if len({path.passing(place, STRIP_SAMPLES)[1] for place in ends}) > 1:
            return True
    return False


def pulled_off(assembly: Assembly, stage: StageSpec) -> Iterator[str]:
    """Say which force turns an end of a threaded strip, and the one that pulls as it was laid."""
    for name, end in stage.edges.items():
        if end.force and name in ENDS and assembly.thread is not None:
            laid = assembly.thread.ends_in_space(assembly.strip)
            way = np.linalg.norm(end.force) * np.asarray(laid[2 + ENDS.index(name)])
            typed = ", ".join(f"{part:.4g}" for part in (way[0], 0.0, way[-1]))
            key = f"stages.{stage.name}.{name}.force"
            yield f", as {key} turns its {name}. Try --set '{key}=[{typed}]'"


def rollers_without_friction(preview: Preview) -> Iterator[str]:
    """Rollers that turn, or have torques or bearings, where nothing rubs on them."""
    scene, frictional = preview.assembly.scene, preview.assembly.frictional
    for spec in scene.rollers:
        given = [(stage, stage.roller(spec.name)) for stage in scene.stages]
        turning = [stage for stage, c in given if c.surface_speed or c.angular_speed]
        rubs = coefficient_on(scene, spec)
        cure = "friction.coefficient=0.2"
        if spec.friction is not None:
            cure = f"rollers.{spec.name}.friction=0.2"
        if turning and not (rubs and any(s.steady or frictional(s) for s in turning)):
            if rubs:
                cure = f"stages.{turning[0].name}.friction=true"
            yield (
                f"roller {spec.name} turns, but nothing rubs on it, so that it drives nothing. "
                f"Try --set {cure}"
            )
        elif scene.friction is not None and not rubs and any(c.torque for _, c in given):
            yield (
                f"a torque turns roller {spec.name}, but nothing rubs on it, so that it spins and "
                f"drives nothing. Try --set {cure}"
            )
        elif scene.friction is not None and not rubs and spec.drive == "idle" and spec.bearing:
            yield (
                f"nothing rubs on the idle roller {spec.name}: it stands, and its bearings take "
                f"nothing. Try --set {cure}"
            )


def holding_ratio(preview: Preview, roller: Roller) -> float:
    """Return e^(fθ) of a driven roller: the ratio of tensions that friction on it can hold."""
    f = coefficient_on(preview.assembly.scene, preview.assembly.specs[roller.name])
    return float(np.exp(min(f * preview.turn(roller), 100.0)))


def taken_by_bending(preview: Preview, roller: Roller) -> float:
    """Return D/2r² (N/m), by which the tension of strip on a roller is less than before it.

    It is 0 where strip touches the roller along a line, which friction holds as it does a string.
    """
    if sharpest_curvature(preview, roller) * roller.radius < 1.0:
        return 0.0
    return 0.5 * bending_stiffness(preview.assembly.scene) / roller.radius**2


def tension_after(preview: Preview, roller: Roller, pull: float, sense: float) -> float:
    """Return the tension (N/m) after a roller on which all of the strip slips, from that before it.

    Where strip comes to lie on the roller its tension T is less by B = D/2r², and presses on the
    edge of the contact by Q with Q² = T² − (T − B)², an angle φ with cos φ = 1 − B/T later than
    a string would.  In between e^(f(θ − φ − φ')) multiplies T − B + f Q.  Strip that would come to
    lie there after half of the turn touches the roller along a line, which holds as a string does.

    Parameters
    ----------
    preview : Preview
    roller : Roller
    pull : float
        N/m.
    sense : {1.0, -1.0}
        Whether friction makes the tension larger or smaller.
    """
    f, bent = sense * np.log(holding_ratio(preview, roller)), taken_by_bending(preview, roller)
    turn = max(preview.turn(roller), 1e-300)
    f, after = f / turn, pull * np.exp(f)
    late, edge = _edge_of_contact(pull, bent)
    if 2.0 * late >= turn:
        return float(after)
    for _ in range(BENT_ITERATIONS):
        later, there = _edge_of_contact(max(after, bent), bent)
        within = (pull - bent + f * edge) * np.exp(f * max(turn - late - later, 0.0))
        after = within + bent + f * there
    return float(max(after, bent))


def _edge_of_contact(tension: float, bent: float) -> tuple[float, float]:
    """Angle (rad) by which strip comes to lie late, and the force on the edge there (N/m)."""
    angle = float(np.arccos(max(1.0 - bent / tension, -1.0))) if tension else 0.0
    return angle, tension * np.sin(angle)


def two_digits(value: float, towards: Callable[[float], float]) -> float:
    """Return a positive bound with two digits, rounded to the side where it still is one.

    Examples
    --------
    >>> two_digits(0.341, np.ceil), two_digits(2.166e4, np.floor)
    (0.35, 21000.0)
    """
    decimals = 1 - int(np.floor(np.log10(value)))
    scaled = round(value * 10.0**decimals, 9)  # a bound of two digits is its own
    return round(float(towards(scaled)) * 10.0**-decimals, 9)


@dataclass(frozen=True)
class Pulled:
    """Loads of a stage that pull at both ends of a strip that rollers alone hold along itself."""

    stage: StageSpec
    ends: Mapping[str, float]  # tension (N/m) at the entry and at the exit
    torques: Mapping[str, float]  # of the rollers that have one (N m)
    weight: float  # of the strip (N/m²), by which a tension grows with height
    nips: Sequence[Nip]  # by whose force friction holds as well

    def with_squeeze(self, nip: Nip, squeeze: float) -> Pulled:
        """Return the same with a nip that squeezes the strip by so much (m)."""
        other = replace(nip, gap=nip.gap + nip.squeeze - squeeze)
        nips = [other if each.names == nip.names else each for each in self.nips]
        return replace(self, nips=nips)


def pulled_at_both_ends(preview: Preview) -> Iterator[Pulled]:
    """Yield the stages in which rollers alone hold the strip along itself, at their ends.

    No edge holds it there, or it is a steady stage with the tension of its entry given: that edge
    stands, but the strip passes it as fast as that tension wants.  Steady strip that yields is
    left out, as bending it takes up tension as well.
    """
    scene, assembly = preview.assembly.scene, preview.assembly
    held = set(held_ends(scene))
    first = 0.0 if scene.threading is None else scene.threading.tension
    pulls, torques, weight = dict.fromkeys(ENDS, first), dict[str, float](), 0.0
    given = set[str]()  # ends whose tension is known, held as they may be
    course, known = Course(assembly), {plan.name for plan in preview.plans}
    for stage, nips in zip(scene.stages, assembly.nips[1:], strict=True):
        before = dict(pulls)
        torques |= {n: c.torque for n, c in stage.rollers.items() if c.torque is not None}
        if stage.gravity is not None:
            weight = -assembly.strip.mass * stage.gravity[2]
        for name in (name for name in ENDS if stage.edge(name).release):
            held.discard(name)
            if name not in given:
                pulls[name] = reaction(scene, name, before, weight)
        own = {name: pull for name, pull in edge_pulls(stage) if name in pulls}
        pulls |= own
        given |= own.keys()
        free = not held and assembly.frictional(stage)
        if stage.steady:
            answers = course.pulled(stage) and not assembly.closed
            given -= set[str]() if answers else {"entry"}  # it answers to the strip's speed
            free = answers and "exit" not in held and not assembly.yields(stage)
        if free and stage.name in known:
            yield Pulled(stage, dict(pulls), dict(torques), weight, nips)


def reaction(scene: SceneSpec, name: str, pulls: Mapping[str, float], weight: float) -> float:
    """Return what an end that is held bears (N/m) where strip weighs so much (N/m²).

    Weight is put on without friction; other tensions may have fallen with it.
    """
    ends = None if scene.threading is None else (scene.threading.entry, scene.threading.exit)
    if not weight or ends is None or None in ends:
        return max(pulls.values())
    heights = {end: place[2] for end, place in zip(ENDS, ends, strict=True) if place is not None}
    other = ENDS[name == ENDS[0]]
    return pulls[other] + weight * (heights[name] - heights[other])


TORQUE_SHARES = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1)
"""Shares of torques that are looked at where these pull the strip away."""


def beyond_capacity(preview: Preview) -> Iterator[str]:
    """Stages that pull at both ends by more than the rollers can hold, which alone hold there."""
    assembly = preview.assembly
    turn = sum(preview.turn(roller) for roller in assembly.driven)
    for pulled in pulled_at_both_ends(preview):
        for end, other in (ENDS, ENDS[::-1]):
            high, low, stage = pulled.ends[end], pulled.ends[other], pulled.stage
            most = largest_held_tension(preview, end, pulled)
            bound = largest_held_tension(preview, end, pulled, NIP_SAFETY)
            if high <= bound * 1.001:
                continue
            others = any(pulled.torques.values()) or any(s.bearing for s in assembly.scene.rollers)
            by_nips = ", that of nips" * bool(pulled.nips)
            held_by = f"friction{by_nips}, torques, bearings and weight hold {most:.3g} N/m there"
            if plain := not (pulled.weight or others or pulled.nips):
                held_by = f"friction holds {most / low if low else 1.0:.3g} times as much"
            lost = high > most * (SAGGING_SHARE if pulled.weight else 1.0)
            none = "there is no stationary state, and " * (stage.steady and lost)
            runs = "runs away" if lost else "may run away"
            key = "tension" if stage.edge(end).force is None else "force"
            typed = f"stages.{stage.name}.{end}.{key}"
            if plain and not turn and key == "tension":
                lower = f"--set {typed}={low:g}, or rollers that the strip wraps"
            elif bound > 0.0:
                below = two_digits(bound, np.floor)
                if below <= low < high:
                    below = float(f"{0.5 * (low + bound):.4g}")
                lower = f"{typed} below {below:.4g} N/m"
            else:
                lower = f"a lower {typed}"
            lower += f"{other_ways_to_hold(preview, end, pulled, plain)}."
            lower = smaller_torques(preview, pulled) or lower
            yield (
                f"only friction holds the strip in x in stage {stage.name}, which pulls at its "
                f"{end} by {high:.3g} N/m against {low:.3g} N/m, and on {np.degrees(turn):.0f}° of "
                f"wrap {held_by} at most: {none}the strip {runs}. "
                f"Try {lower}"
            )
            if lost and not pulled.weight:  # no later stage is reached
                return


def smaller_torques(preview: Preview, pulled: Pulled) -> str:
    """Return torques to type that pull the strip away no more, in the middle of those that do not.

    Nothing without torques, or where it runs away with all shares of them.
    """
    shares = []
    for share in TORQUE_SHARES if any(pulled.torques.values()) else ():
        torques = {name: share * torque for name, torque in pulled.torques.items()}
        if not runs_away(preview, replace(pulled, torques=torques)):
            shares.append(share)
    if not shares:
        return ""
    middle = shares[len(shares) // 2]
    key, found = f"stages.{pulled.stage.name}.rollers", pulled.torques.items()
    each = ((name, float(f"{middle * torque:.2g}")) for name, torque in found)
    return " ".join(f"--set {key}.{name}.torque={torque:g}" for name, torque in each)


def other_ways_to_hold(preview: Preview, end: str, pulled: Pulled, plain: bool) -> str:
    """Return what else to type so that rollers hold what pulls more than they hold, at an end.

    A nip that is closed farther, torques that act the other way, or, where it is plain that wraps
    alone hold it, their friction coefficient.
    """
    assembly, high = preview.assembly, pulled.ends[end]
    for nip in pulled.nips:
        if not (presses(assembly, nip) and assembly.driven_friction(nip)):
            continue
        squeeze = holding_squeeze(preview, end, pulled, nip)
        return (
            f", or a nip that presses with about {nip_force(assembly, nip, squeeze):.2g} N, "
            f"{NIP_SAFETY:g} times what would hold the strip: "
            f"{closer_rollers(assembly, pulled.stage.name, nip, squeeze)}"
        )
    turned = replace(pulled, torques={name: -torque for name, torque in pulled.torques.items()})
    held, other = (largest_held_tension(preview, end, p, NIP_SAFETY) for p in (pulled, turned))
    if other > max(high, held):
        keys = (f"stages.{pulled.stage.name}.rollers.{name}.torque" for name in pulled.torques)
        return f", or the other sign of {', '.join(keys)}"
    return holding_coefficient(preview, pulled) if plain else ""


def holding_coefficient(preview: Preview, pulled: Pulled) -> str:
    """Return the friction coefficient with which wraps alone hold what pulls, as an advice.

    Rollers that have coefficients of their own keep them.
    """
    assembly, high = preview.assembly, max(pulled.ends.values())
    own = {s.name: s.friction for s in assembly.scene.rollers if s.friction is not None}
    driven = {roller.name: preview.turn(roller) for roller in assembly.driven}
    common = [name for name, turn in driven.items() if turn and name not in own]
    turn = sum(driven[name] for name in common)
    bent = max(taken_by_bending(preview, roller) for roller in assembly.rollers)
    low = min(pulled.ends.values()) - bent
    if low <= 0.0 or not turn:
        return ""
    kept = sum(own[name] * driven[name] for name in driven if name in own)
    f = (np.log((high - bent) / low) - kept) / turn
    there = f" on {', '.join(common)}" if kept else ""
    return f", or a friction coefficient above {two_digits(f, np.ceil):g}{there}" if f < 2.0 else ""


def held_by_nip(preview: Preview, nip: Nip) -> bool:
    """Whether the strip would run away in any stage if a nip only just touched it."""
    loose = (pulled.with_squeeze(nip, 0.0) for pulled in pulled_at_both_ends(preview))
    return any(runs_away(preview, pulled) for pulled in loose)


def runs_away(preview: Preview, pulled: Pulled) -> bool:
    """Whether an end is pulled by more than rollers, bearings and weight hold."""
    return any(pulled.ends[end] > largest_held_tension(preview, end, pulled) for end in ENDS)


def holding_squeeze(preview: Preview, end: str, pulled: Pulled, nip: Nip) -> float:
    """Return by how much a nip squeezes the strip (m) that surely holds what pulls at an end."""

    def spare(squeeze: float) -> float:
        held = largest_held_tension(preview, end, pulled.with_squeeze(nip, squeeze), NIP_SAFETY)
        return held - pulled.ends[end]

    from scipy.optimize import brentq

    least, further = nip.squeeze, preview.assembly.signorini.width
    while spare(least + further) < 0.0:
        further *= 2.0
    return float(brentq(spare, least, least + further))


def largest_held_tension(preview: Preview, end: str, pulled: Pulled, sure: float = 1.0) -> float:
    """Largest tension (N/m) at an end that rollers, bearings and weight hold against the other's.

    See :func:`largest_tensions`, which ends with it.
    """
    return dict(largest_tensions(preview, end, pulled, sure))[end]


def largest_tensions(
    preview: Preview, end: str, pulled: Pulled, sure: float = 1.0
) -> Iterator[tuple[str, float]]:
    """Yield rollers on the way to an end, and the largest tension (N/m) of strip that comes there.

    Rollers, bearings and weight on the way hold it against the pull at the other end.  The end
    itself is the last.

    Parameters
    ----------
    preview : Preview
    end : {"entry", "exit"}
    pulled : Pulled
    sure : float, optional
        By which the forces of nips are divided: estimates, as strip that bends off bears some.
    """
    assembly, forth = preview.assembly, end == ENDS[-1]
    order, places = with_supports(assembly, pulled)
    ways = np.diff(places, axis=0)
    lain = 0.5 * pulled.weight * np.abs(ways[:, 0])
    if "exit" not in assembly.scene.held_in("z"):  # the last roller bears the last run
        lain[-1] *= 2.0
    loads, rises = lain[:-1] + lain[1:], ways[:, 1]
    if not forth:
        order, loads, rises = order[::-1], loads[::-1], -rises[::-1]
    passed, pressed = [roller.name for roller in order], dict[str, list[Nip]]()
    gained = torque_gains(preview, pulled, forth)
    for nip in (nip for nip in pulled.nips if presses(assembly, nip)):
        first = min(nip.names, key=lambda name: [*passed, name].index(name))
        pressed.setdefault(first, []).append(nip)
    pull, weight = pulled.ends[ENDS[0] if forth else ENDS[-1]], pulled.weight
    for roller, rise, weighs in zip(order, rises, loads, strict=False):
        pull = max(pull + weight * float(rise), 0.0)
        yield roller.name, pull
        lies = preview.lies(roller)
        upwards = 1.0 if lies is None else lies[0][1] / np.linalg.norm(lies[0])
        rests = max(float(upwards * weighs), 0.0)
        load = pull * preview.turn(roller) + rests
        friction = coefficient_on(assembly.scene, assembly.specs[roller.name])
        nipped, later = 0.0, {roller.name: 0.0} if roller.name in gained else {}
        for nip in pressed.pop(roller.name, ()):
            force = nip_load(assembly, nip, load, sure)
            pull += nip_friction(assembly, nip, force, gained | later)
            nipped += friction * force
        most = tension_after(preview, roller, pull, 1.0) + friction * rests
        if roller.name in gained:
            held = pull + gained[roller.name]
            least = tension_after(preview, roller, pull, -1.0) - nipped
            most = min(most + nipped, max(held, least))
        pull = max(most, 0.0)
    for nip in (nip for each in pressed.values() for nip in each):
        pull += nip_friction(assembly, nip, nip_load(assembly, nip, 0.0, sure), gained)
    yield end, max(pull + weight * float(rises[-1]), 0.0)


def torque_gains(preview: Preview, pulled: Pulled, forth: bool) -> dict[str, float]:
    """Return by how much tension (N/m) rises at rollers that turn freely, by torques and bearings.

    Along the strip, or against it.
    """
    assembly, found = preview.assembly, dict[str, float]()
    for roller in (roller for roller in assembly.rollers if roller.name in assembly.turning):
        torque = pulled.torques.get(roller.name, 0.0) * roller.sense
        carried = torque * carrying_sense(roller, assembly.thread)
        gained = assembly.specs[roller.name].bearing + (-carried if forth else carried)
        found[roller.name] = gained / (roller.radius * assembly.strip.width)
    return found


def rollers_in_order(assembly: Assembly) -> tuple[list[Roller], Array]:
    """Return the rollers along the strip, and x and z (m) of its entry, of them and of its exit."""
    thread, given = assembly.thread, assembly.scene.threading
    if thread is None or given is None:  # flat
        order = sorted(assembly.rollers, key=lambda roller: float(roller.centre[0]))
        half = 0.5 * assembly.strip.length
        return order, np.array([[x, 0.0] for x in (-half, *(r.centre[0] for r in order), half)])
    rollers = {roller.name: roller for roller in assembly.rollers}
    order = [rollers[roller.name] for roller in thread.rollers]
    typed = ((given.entry, order[0]), (given.exit, order[-1]))
    first, last = (
        near.centre if end is None else np.subtract(end, assembly.origin) for end, near in typed
    )
    return order, np.array([first, *(roller.centre for roller in order), last])[:, [0, 2]]


def with_supports(assembly: Assembly, pulled: Pulled) -> tuple[list[Roller], Array]:
    """Return what :func:`rollers_in_order` does, also of rollers on which runs only hang through.

    A run hangs from its chord by w x (l − x)/2T, and supports are touched from their tops.
    """
    order, places = rollers_in_order(assembly)
    known, tension = {roller.name for roller in order}, min(pulled.ends.values())
    if assembly.thread is None or not pulled.weight or tension <= 0.0:
        return order, places
    path = assembly.thread.middle.points[..., 0]
    runs = list(zip(path[:, ::2].T, [*path[:, 1::2].T, places[-1]], strict=True))
    for k, (start, end) in reversed(list(enumerate(runs))):
        across, found = end[0] - start[0], list[Roller]()
        for roller in (each for each in assembly.rollers if each.name not in known):
            x, z = np.array(axis_crossing(roller)) - start
            share = x / across if across else -1.0
            gap = share * (end[1] - start[1]) - z - roller.radius - roller.half
            sag = 0.5 * pulled.weight * x * (across - x) / tension
            if 0.0 < share < 1.0 and -roller.half <= gap <= sag:
                found.append(roller)
        found.sort(key=lambda roller: float((roller.centre[0] - start[0]) / across))
        order[k:k] = found
        tops = [(roller.centre[0], roller.centre[2]) for roller in found]
        places = np.insert(places, [k + 1] * len(tops), np.reshape(tops, (-1, 2)), axis=0)
    return order, places


def sharpest_curvature(preview: Preview, roller: Roller) -> float:
    """Curvature (1/m) of the strip on a roller."""
    return bent_curvature(preview.assembly.scene, roller.radius, preview.turn(roller))


def beyond_yield(preview: Preview) -> Iterator[str]:
    """Rollers over which the bent strip is stressed beyond its yield stress."""
    scene, m = preview.assembly.scene, preview.assembly.material
    limit, t = scene.material.yield_stress, scene.strip.thickness
    if scene.contact is None or not bending_stiffness(scene) or scene.material.plasticity:
        return
    if limit is not None:
        bound = f"above the yield stress {told_stress(scene, limit)}"
        most = limit * (1.0 - m.poisson**2) / m.young
    else:
        most = METAL_YIELD_STRAIN if is_metal(scene) else np.inf
    bent: dict[float, list[Roller]] = {}
    for roller in preview.assembly.rollers:
        bent.setdefault(0.5 * t * sharpest_curvature(preview, roller), []).append(roller)
    for strain, rollers in bent.items():
        if strain <= most:
            continue
        if limit is None:
            bound = f"a strain of {100.0 * strain:.2g} %"
        larger = two_digits(0.5 * t / most, np.ceil)
        tries = [yielding_instead(scene)]
        if has_room(preview.assembly, rollers, larger):
            radii = " ".join(f"--set rollers.{r.name}.radius={larger:g}" for r in rollers)
            tries += [radii if len(rollers) < 5 else f"radii of {larger:g}"]
        advice = ", or ".join(filter(None, tries)) or "a thinner strip"
        stress = told_stress(scene, m.young * strain / (1.0 - m.poisson**2))
        yield (
            f"bending over {', '.join(roller.name for roller in rollers)} gives {stress} at the "
            f"surface, {bound}, but this strip stays elastic. Try {advice}"
        )


def has_room(assembly: Assembly, widened: Collection[Roller], radius: float) -> bool:
    """Whether rollers of another radius (m) overlap no parallel one, and are still wrapped."""
    names = {roller.name for roller in widened}
    rollers = [replace(r, radius=radius) if r.name in names else r for r in assembly.rollers]
    for roller, other in combinations(rollers, 2):
        way = across(np.subtract(other.centre, roller.centre), roller.unit_axis)
        parallel = abs(other.unit_axis @ roller.unit_axis) > PARALLEL_COSINE
        near = np.linalg.norm(way) < other.radius + roller.radius
        if names & {roller.name, other.name} and parallel and near:
            return False
    if (thread := assembly.thread) is None:
        return True
    rollers = [replace(r, radius=radius) if r.name in names else r for r in thread.rollers]
    try:
        return bool(replace(thread, rollers=rollers).turns)
    except ValueError:
        return False


def is_metal(scene: SceneSpec) -> bool:
    """Return whether strip is as stiff as metal, in the units of the scene."""
    return 1e6 * in_megapascals(scene, scene.material.young) > METAL_MODULUS


def yielding_instead(scene: SceneSpec) -> str:
    """Return what lets strip yield; nothing where it cannot.

    Strip that runs in time and is fed does not yield, since its labels change.
    """
    runs = any(stage.steady for stage in scene.stages) or not scene.strip.feed
    if scene.material.yield_stress is None or scene.strip.kinematics == "plate" or not runs:
        return ""
    return "--set 'material.plasticity={}' so that it can yield"


def yield_stress(scene: SceneSpec) -> float:
    """Return the yield stress (Pa), or what no metal bears without yielding."""
    m = scene.material
    return m.yield_stress or (METAL_YIELD_STRAIN * m.young if is_metal(scene) else np.inf)


def assumed_yield(scene: SceneSpec) -> str:
    """Return what a yield stress is taken from that nobody has typed, else nothing."""
    if scene.material.yield_stress is not None:
        return ""
    strain = 100.0 * METAL_YIELD_STRAIN
    return f" (taken for a strain of {strain:g} %, as there is no material.yield_stress)"


def stretched_beyond_yield(preview: Preview) -> Iterator[str]:
    """Tensions beyond the yield stress, or under which all of strip that yields flows.

    It hardens by H until it has stretched by (σ − σ_y)/H, and flows on and on if H is 0.
    """
    scene, t = preview.assembly.scene, preview.assembly.scene.strip.thickness
    stress, limit, how = preview.tension / t, yield_stress(scene), "yields"
    if (flow := preview.assembly.flow) is not None:
        hardening = flow.isotropic + flow.kinematic
        if scene.material.plasticity and scene.material.plasticity.law:
            return  # which may harden by itself
        limit = flow.yield_stress + LARGEST_ELONGATION * hardening
        longer = f"stretches by more than {100.0 * LARGEST_ELONGATION:g} %"
        how = longer if hardening else "flows, on and on"
    if stress > limit:
        pulled, yields = (told_stress(scene, each) for each in (stress, limit))
        yield (
            f"the largest tension, {preview.tension:.3g} N/m, is a stress of {pulled}, beyond "
            f"{yields}{assumed_yield(scene)}, at which all of the strip {how}. Try tensions below "
            f"{two_digits(limit * t, np.floor):.2g} N/m, in N per metre of width."
        )


def gravity_upwards(preview: Preview) -> Iterator[str]:
    """Gravity that points upwards, or is not that of the earth."""
    for stage in preview.assembly.scene.stages:
        g = stage.gravity
        if g is not None and g[2] > 0.0:
            yield (
                f"gravity in stage {stage.name} points upwards, as z does. "
                f"Try --set 'stages.{stage.name}.gravity={typed_vector((*g[:2], -g[2]))}'"
            )


def carrying_speeds(
    assembly: Assembly, rollers: Sequence[Roller]
) -> Iterator[tuple[StageSpec, dict[str, float]]]:
    """Yield stages with the speeds (m/s) with which rollers carry strip on, as given until then."""
    last = dict[str, float]()
    for stage in assembly.scene.stages:
        for roller in rollers:
            if (speed := surface_speed(stage, roller)) is not None:
                last[roller.name] = speed * roller.sense * carrying_sense(roller, assembly.thread)
        yield stage, last


def unequal_speeds(preview: Preview) -> Iterator[str]:
    """Driven rollers of which some must slip or brake, since their surfaces go at other speeds.

    Not those between which strip stretches as much, by less tension than they hold, or yields, nor
    where runs take strip up, or give it off, as rollers move or as nips push it into them.
    """
    assembly = preview.assembly
    touched = [roller for roller in assembly.driven if preview.turn(roller) > 0.0]
    if assembly.friction is None:
        return
    others = {r.name: r for r in touched if holding_ratio(preview, r) > 1.0}
    usual, surely = stretched_unsaid(preview, touched), held_stretches(preview)
    before = dict[str, float]()
    for (stage, last), (runs, rates) in zip(
        carrying_speeds(assembly, touched), lengthening_runs(assembly), strict=True
    ):
        line = float(np.sum(np.sign(list(last.values())))) or 1.0
        fast = max(last, key=lambda name: last[name] * line, default="")
        runs_on = surely.get(stage.name, {}) if line > 0.0 else {}
        for name, told in others.items() if any(last.values()) else ():
            if name == fast or gathers(assembly, stage, name, fast):
                continue
            held = runs_on[fast][1] - runs_on[name][0] if runs_on else np.inf
            bound = min(usual, held)
            taken = sum_between(assembly, rates, name, fast)
            for speeds in (last, before) if taken else (last,):
                speed, given = speeds.get(name, 0.0), speeds.get(fast, 0.0)
                apart = abs(speed - given + taken)
                draw = apart / abs(last[fast])
                if not stage.steady and (length := abs(sum_between(assembly, runs, name, fast))):
                    draw = min(draw, apart * stage.duration / length)
                if draw > bound:
                    when = f"in stage {stage.name}"
                    other = typed_speed(assembly, stage, told, given - taken)
                    if speeds is before:
                        when = f"as stage {stage.name} begins"
                        other = "a short stage before, in which rollers come to their speeds"
                    words = unequal_words(preview, when, (name, speed), (fast, given), taken)
                    if draw <= usual:
                        takes = draw * assembly.strip.tensile_stiffness
                        words += f", since it would stretch by {takes:.3g} N/m more, of which "
                        holds = max(bound, 0.0) * assembly.strip.tensile_stiffness
                        words += f"friction holds {holds:.3g} N/m at most"
                    unless = "Unless that is meant, try" if speed * given < 0.0 else "Try"
                    yield (
                        f'{words}. {unless} rollers.{name}.drive = "idle" and no speed of it, '
                        f"or {other}"
                    )
                    return
        before = dict(last)


def unequal_words(
    preview: Preview, when: str, slow: tuple[str, float], fast: tuple[str, float], taken: float
) -> str:
    """Return that strip slips on one of two rollers, given their names and speeds (m/s).

    With what runs between them take up (m/s), as other rollers move.
    """
    assembly, (name, speed), (other, given) = preview.assembly, slow, fast
    how = f"goes at {speed:g} m/s" if speed else "stands"
    order = [r.name for r in assembly.driven if preview.turn(r) > 0.0]  # along the strip
    piles = order.index(other) < order.index(name) and distributed_load(assembly.scene)
    or_not = ", or gathers between them and hangs slack" if piles else ""
    way = abs(taken)
    moves = f", and rollers that move change the way between them by {way:.3g} m/s" if way else ""
    return (
        f"roller {name} {how} {when} while {other} goes at {given:g} m/s{moves}: "
        f"the strip slips on one of them{or_not}"
    )


def stretched_unsaid(preview: Preview, touched: Sequence[Roller]) -> float:
    """Return the share by which driven rollers may go at unequal speeds, as strip stretches."""
    assembly = preview.assembly
    grip = min((holding_ratio(preview, roller) for roller in touched), default=1.0)
    held = (grip - 1.0) * preview.tension / assembly.strip.tensile_stiffness
    if (flow := flow_stress(assembly.scene)) is not None:  # half of the rollers are on either side
        whole = float(np.prod([holding_ratio(preview, roller) for roller in touched]))
        yields = preview.tension * np.sqrt(whole) > flow * assembly.strip.thickness
        held = LARGEST_ELONGATION if yields else held
    return max(SPEED_DIFFERENCE, held)


def held_stretches(preview: Preview) -> dict[str, dict[str, tuple[float, float]]]:
    """Return steady stages, and by roller the least and the largest strain of strip that comes on.

    Strip sticks where it comes on, so that the speeds of two rollers differ by the difference of
    these strains.  The least is known where no driven roller is before.  None of strip that
    yields, or that heat lengthens.
    """
    assembly = preview.assembly
    warm = any(shape.temperature for shape in assembly.scene.shapes)
    if warm or flow_stress(assembly.scene) is not None:
        return {}
    found, stretches = dict[str, dict[str, tuple[float, float]]](), assembly.strip.tensile_stiffness
    driven = [roller.name for roller in assembly.driven if preview.turn(roller) > 0.0]
    for pulled in pulled_at_both_ends(preview):
        if pulled.stage.steady:
            forth = list(largest_tensions(preview, "exit", pulled))[:-1]
            back = list(largest_tensions(preview, "entry", pulled))[1:]
            first = next((name for name, _ in forth if name in driven), "")
            found[pulled.stage.name] = {
                name: (one * (name == first) / stretches, min(one, other) / stretches)
                for (name, one), (_, other) in zip(forth, back[::-1], strict=True)
            }
    return found


def lengthening_runs(assembly: Assembly) -> Iterator[tuple[Array, Array]]:
    """Yield lengths of runs (m) in each stage, and by how much they grow as rollers move (m/s)."""
    thread, others = assembly.thread, assembly.layout.pressed
    if thread is None:
        yield from ((np.zeros(1), np.zeros(1)) for _ in assembly.scene.stages)
        return
    every = [*thread.rollers, *(other.roller for other in others)]
    runs = lengths_of_runs(thread)
    places = rollers_in_stages(assembly.scene, every)
    for stage, moved in zip(assembly.scene.stages, places, strict=True):
        before = runs
        if moved is not None:
            try:
                runs = lengths_of_runs(*threaded_around(thread, others, moved))
            except (NotTouchedError, NoTangentError):
                runs = np.full_like(runs, np.nan)
        yield runs, 0.0 * runs if stage.steady else (runs - before) / stage.duration


def sum_between(assembly: Assembly, values: Array, name: str, other: str) -> float:
    """Return the sum of values of runs between two rollers, negative if the second comes last."""
    if assembly.thread is None:
        return 0.0
    order = [roller.name for roller in assembly.thread.rollers]
    at, there = order.index(name) + 1, order.index(other) + 1
    return float(values[min(at, there) : max(at, there)].sum()) * float(np.sign(at - there))


def gathers(assembly: Assembly, stage: StageSpec, *names: str) -> bool:
    """Whether nips push strip into a run between two rollers, or draw it out, in a stage."""
    if (thread := assembly.thread) is None:
        return False
    order = [roller.name for roller in thread.rollers]
    first, last = sorted(order.index(name) + 1 for name in names)
    held, bent = assembly.gathered_in(stage)
    return bool(np.any((held + abs(bent))[first:last]))


def slipping_nips(preview: Preview) -> Iterator[str]:
    """Nips at unequal speeds that do not hold the tension of the strip that would gather."""
    assembly, tension = preview.assembly, preview.assembly.scales.tension
    last = assembly.scene.stages[-1].name
    for nip in assembly.slipping_nips:
        if not (friction := assembly.driven_friction(nip)):
            continue
        held = friction * nip.line_load(assembly.signorini)
        closer = closer_rollers(assembly, last, nip, pressing(assembly, nip, tension / friction))
        yield (
            f"strip that gathers between nips pulls at {' and '.join(nip.names)} with up to "
            f"{tension:.3g} N/m, and friction holds about {held:.2g} N/m there: it slips. "
            f"Try {closer}"
        )


def pressing(assembly: Assembly, nip: Nip, load: float) -> float:
    """Return by how much a nip squeezes straight strip (m) that it surely presses so (N/m)."""
    from scipy.optimize import brentq

    law = assembly.signorini

    def spare(squeeze: float) -> float:
        other = replace(nip, gap=nip.gap + nip.squeeze - squeeze)
        return other.line_load(law) - NIP_SAFETY * load

    further = law.width
    while spare(nip.squeeze + further) < 0.0:
        further *= 2.0
    return float(brentq(spare, nip.squeeze, nip.squeeze + further))


def typed_speed(assembly: Assembly, stage: StageSpec, roller: Roller, speed: float) -> str:
    """Return what to type so that a roller carries strip on at a speed (m/s) in a stage."""
    key, typed = "surface_speed", speed * carrying_sense(roller, assembly.thread)
    if stage.roller(roller.name).angular_speed is not None:
        key, typed = "angular_speed", typed / roller.radius
    else:
        typed *= roller.sense
    return f"--set stages.{stage.name}.rollers.{roller.name}.{key}={typed:g}"


def opposed_nip(preview: Preview) -> Iterator[str]:
    """Driven rollers of a nip that rub the strip in opposite directions.

    The one is told that turns against most of the line, else the one that carries strip back.
    """
    assembly = preview.assembly
    rub = {spec.name for spec in assembly.scene.rollers if coefficient_on(assembly.scene, spec)}
    driven = [roller for roller in assembly.driven if roller.name in rub]
    carried = carrying_speeds(assembly, driven)
    for (stage, last), nips in zip(carried, assembly.nips[1:], strict=True):
        for nip in nips if stage.steady or assembly.rubs(stage) else ():
            pair = (nip.second, nip.first)
            speeds = {roller.name: last.get(roller.name, 0.0) for roller in pair}
            wrapped = all(preview.turn(roller) for roller in pair)  # see unequal_speeds
            if np.prod(list(speeds.values())) >= 0.0 or wrapped:
                continue
            line = sum(map(np.sign, last.values())) or 1.0
            wrong, right = sorted(pair, key=lambda roller: speeds[roller.name] * line)
            yield (
                f"rollers {right.name} and {wrong.name} nip the strip in stage {stage.name} and "
                f"carry it on at {speeds[right.name]:g} m/s and at {speeds[wrong.name]:g} m/s, "
                "against each other: it slips on one of them. Unless that is meant, try "
                f"{typed_speed(assembly, stage, wrong, speeds[right.name])}"
            )
            return


def standing_rollers(preview: Preview) -> Iterator[str]:
    """Driven rollers without any speed, over which strip slides that comes in at a given one."""
    assembly = preview.assembly
    driven = [roller for roller in assembly.driven if preview.turn(roller) > 0.0]
    touched = [roller for roller in driven if holding_ratio(preview, roller) > 1.0]
    for stage, last in carrying_speeds(assembly, touched):
        given = stage.strip.speed if stage.steady else stage.edge("entry").speed
        stand = [roller.name for roller in touched if roller.name not in last]
        rubs = stage.steady or assembly.rubs(stage)
        if not rubs or not given or not stand or any(last.values()):
            continue
        idle = " ".join(f"--set 'rollers.{name}.drive=\"idle\"'" for name in stand)
        keys = (f"stages.{stage.name}.rollers.{name}.surface_speed = 0" for name in stand)
        verb, it, they = ("s", "it", "it") if len(stand) == 1 else ("", "them", "they")
        yield (
            f"roller{'' if verb else 's'} {', '.join(stand)} stand{verb} in stage {stage.name} and "
            f"the strip, which comes in at {given:g} m/s, slides over {it}. Try {idle}, or "
            f"{' and '.join(keys)} if {they} should stand"
        )
        return


def standing_line(preview: Preview) -> Iterator[str]:
    """A steady stage that comes to rest, in a scene that gives no roller and no end a speed."""
    assembly, scene = preview.assembly, preview.assembly.scene
    gripping = [
        r.name for r in assembly.driven if preview.turn(r) * holding_ratio(preview, r) > 0.0
    ]
    steady = [stage.name for stage in scene.stages if stage.steady]
    for stage in scene.stages:
        ends = [edge.speed or edge.velocity for edge in stage.edges.values()]
        turned = [c.surface_speed or c.angular_speed or c.torque for c in stage.rollers.values()]
        if any([*ends, *turned, stage.strip.speed]):
            return
    if steady and gripping and assembly.friction is not None:
        key = f"stages.{steady[-1]}.rollers"
        yield (
            f"nothing sets the strip going in stage {steady[-1]}: no roller has a speed, and it "
            f"stands. Try {' '.join(f'--set {key}.{name}.surface_speed=1' for name in gripping)}"
        )


def drawn_across(preview: Preview) -> Iterator[str]:
    """Cylinders that are placed along themselves, where y was typed for z."""
    for spec in preview.assembly.scene.rollers:
        x, y, z = spec.centre
        if y and not (z or spec.profile or any(spec.axis[::2])):
            key, better = f"rollers.{spec.name}.centre", typed_vector([x, 0.0, y])
            yield (
                f"{key} = {typed_vector(spec.centre)} is {abs(y):g} m along the axis of a "
                "cylinder, which is the same there; was it meant in z, which points upwards? "
                f"Try --set {shlex.quote(f'{key}={better}')}"
            )


BELT_MARGIN = 1.1
"""Larger than 1, as runs of a belt are not equally long: a tenth more torque is not told."""


def torque_beyond_friction(preview: Preview) -> Iterator[str]:
    """Torques that turn a roller through under the strip, since friction cannot take them.

    At most (1 − e^(−fθ)) of the larger of its tensions, and e^(fθ) − 1 of the smaller; the mean of
    both is about what an endless strip has at rest.  In a nip, f F besides.
    """
    assembly, thread = preview.assembly, preview.assembly.thread
    pulls = {pulled.stage.name: pulled for pulled in pulled_at_both_ends(preview)}
    held = "exit" in assembly.scene.held_in("x")
    last = {} if thread is None or held else {thread.rollers[-1].name: preview.tension}
    for stage, nips in zip(assembly.scene.stages, assembly.nips[1:], strict=True):
        before, behind = dict[str, float](), dict[str, float]()
        if (pulled := pulls.get(stage.name)) is not None:
            before, behind = (dict(largest_tensions(preview, end, pulled)) for end in ENDS[::-1])
        for roller in assembly.rollers if assembly.rubs(stage) or stage.steady else ():
            if not (torque := stage.roller(roller.name).torque):
                continue
            forward = torque * roller.sense * carrying_sense(roller, thread) > 0.0
            high, low = (side.get(roller.name, np.inf) for side in (before, last | behind))
            high, low = (high, low) if forward else (low, high)
            grip = holding_ratio(preview, roller)
            tension = min(high / grip, low)  # the smaller one, at most
            tension = tension if np.isfinite(tension) else preview.tension
            if assembly.closed:  # at rest about the mean of both
                tension = BELT_MARGIN * 2.0 * preview.tension / (grip + 1.0)
            own = [nip for nip in nips if roller.name in nip.names and presses(assembly, nip)]
            force = sum(nip_force(assembly, nip, nip.squeeze) for nip in own)
            most = assembly.strip.width * tension * (grip - 1.0)
            most += coefficient_on(assembly.scene, assembly.specs[roller.name]) * force
            most *= roller.radius
            if not 0.0 < most < abs(torque) - assembly.specs[roller.name].bearing:
                continue
            key = f"stages.{stage.name}.rollers.{roller.name}.torque"
            half = np.copysign(two_digits(0.5 * most, np.floor), torque)
            yield (
                f"{key} = {torque:g} N m is more than friction can take on a wrap of "
                f"{np.degrees(preview.turn(roller)):.3g}°{' and in its nip' * bool(own)}, which is "
                f"{most:.2g} N m under {tension:.3g} N/m: the roller turns through. "
                f"Try --set {key}={half:g}"
            )


def turn_by_weight(preview: Preview, roller: Roller) -> float:
    """Largest angle (rad), w (l₁ + l₂)/2T, by which runs beside a roller wrap it by their weight.

    The weight of half of both, across the strip, is what the roller bears besides T θ.
    """
    assembly, found = preview.assembly, 0.0
    mass = assembly.strip.mass / (preview.tension or np.inf)
    for _, plan, string in preview:
        gravity, path = plan.controls.at(1.0).get("gravity"), string.path
        if gravity is None or path is None or roller.name not in string.turns:
            continue
        sense = 1.0 if string.senses[roller.name] == "over" else -1.0
        beside = slice(first := list(string.turns).index(roller.name), first + 2)
        headings, runs = path.angles[::2, 0][beside], np.diff(path.starts[:, 0])[::2][beside]
        pressing = gravity[0] * np.sin(headings) - gravity[2] * np.cos(headings)
        found = max(found, 0.5 * mass * sense * float(runs @ pressing))
    return found


def heavy_bearings(preview: Preview) -> Iterator[str]:
    """Idle rollers that stand, since their bearings hold more than friction turns them with.

    Friction makes of a tension T at most T e^(fθ), and turns the roller with the difference.
    """
    assembly = preview.assembly
    nipped = assembly.layout.nipping
    for spec, roller in zip(assembly.scene.rollers, assembly.rollers, strict=True):
        arm = roller.radius * assembly.strip.width
        sag = turn_by_weight(preview, roller)
        grip = float(np.exp(coefficient_on(assembly.scene, spec) * sag))
        most = arm * preview.tension * (grip * holding_ratio(preview, roller) - 1.0)
        if spec.name in nipped or spec.drive != "idle" or not 0.0 < most < spec.bearing:
            continue
        yield (
            f"idle roller {spec.name} stands still, and the strip slides over it: its bearings "
            f"hold {spec.bearing:g} N m, and friction on a wrap of "
            f"{np.degrees(preview.turn(roller) + sag):.3g}° under {preview.tension:.3g} N/m turns "
            f"it with {most:.2g} N m at most. "
            f"Try --set rollers.{spec.name}.bearing={two_digits(0.5 * most, np.floor):g}"
        )


def strip_without_tension(preview: Preview) -> Iterator[str]:
    """Steady stages in which a roller carries strip off no faster than it comes in unstressed.

    Where friction could brake it to nothing, or where both speeds are nearly the same number.
    """
    assembly = preview.assembly
    if (thread := assembly.thread) is None or assembly.friction is None:
        return
    stretch = {r.name: thread.stretch(label_at(r, thread)) for r in assembly.rollers}
    unpulled = (1.0 - BRAKING_SHARE) * thread.tension / assembly.strip.tensile_stiffness
    for stage, last in carrying_speeds(assembly, assembly.rollers):
        if not (stage.steady and (given := stage.strip.speed)):
            continue
        ratios = {r.name: last.get(r.name, 0.0) / given for r in assembly.rollers}
        slow = [r for r in assembly.rollers if 0.0 < ratios[r.name] < stretch[r.name] - unpulled]
        held = float(np.prod([holding_ratio(preview, roller) for roller in slow]))
        same = [abs(ratios[r.name] - 1.0) < stretch[r.name] - 1.0 for r in slow]
        elastic = not assembly.yields(stage)
        if held > 1.0 / BRAKING_SHARE or (elastic and any(same)):
            name = min((roller.name for roller in slow), key=lambda each: last[each])
            yield (
                f"roller {name} goes at {last[name]:.9g} m/s in stage {stage.name}: strip slides "
                f"over it, or is under no tension where it sticks, since strip.speed = "
                f"{given:.9g} m/s is its speed unstressed. Try entry.tension and no strip.speed "
                f"there, or --set stages.{stage.name}.strip.speed={last[name] / stretch[name]:.12g}"
            )


def slack_by_heat(preview: Preview) -> Iterator[str]:
    """Stages whose heat or flatness lengthens strip between fixed places by more than it is pulled.

    An endless strip keeps its length, and one that both ends hold, without weight to hang in, where
    no end and no roller has been moved.
    """
    assembly, tension = preview.assembly, preview.tension
    scene, strip = assembly.scene, assembly.strip
    if scene.threading is None or strip.kinematics.name == "plate":
        return
    held = held_ends(scene)
    weights, laid = strip.weights().ravel(), 0.0
    for stage, plan, _ in preview:
        ends = [stage.edges[name] for name in ENDS if name in stage.edges]
        led = ends or stage.steady or stage.moves
        if not assembly.closed and (len(held) < len(ENDS) or led):
            return
        own = eigenstrain(strip, plan.controls.at(1.0))
        longer = 0.0 if own is None else float(weights @ own[0, 0] / weights.sum())
        if plan is preview.plans[0]:
            laid = longer
        if "gravity" in plan.controls.at(1.0):
            return
        needed = strip.tensile_stiffness * (longer - laid)
        if needed > tension > 0.0:
            given, share = stage.strip.temperature, SAFE_ANGLE_SHARE * tension / needed
            less = f"{two_digits(share, np.floor):g} of it"
            if given and not given.along and len(given.across or ()) == 1 and laid == 0.0:
                degrees = two_digits(share * given.across[0], np.floor)
                less = f"--set stages.{stage.name}.strip.temperature={degrees:g}"
            yield (
                f"heat or flatness in stage {stage.name} lengthens the strip by "
                f"{longer - laid:.2g} of its length, between places that stay. Of its tension of "
                f"{tension:.3g} N/m that takes {needed:.2g} N/m: it goes slack. "
                f"Try more tension, or {less}"
            )
            return


def tips_over(preview: Preview) -> Iterator[str]:
    """Flat strip that nothing pulls, with its middle beyond the rollers that it weighs on."""
    assembly, scene = preview.assembly, preview.assembly.scene
    weighed = [s.name for s in scene.stages if s.gravity is not None and s.gravity[2] < 0.0]
    held = scene.held_in("z")
    above = any(roller.centre[2] > 0.0 for roller in assembly.rollers)
    if assembly.thread is not None or held or above or not weighed:
        return
    first, last = assembly.strip.span
    places = [r.centre[0] for r in assembly.rollers if first <= r.centre[0] <= last]
    if places and not min(places) < 0.5 * (first + last) < max(places):
        yield (
            f"the strip, from x = {first:g} to {last:g} m, tips over in stage {weighed[0]}: the "
            f"rollers below it, from x = {min(places):g} to {max(places):g} m, are not on both "
            f"sides of its middle. Try other rollers.{assembly.rollers[0].name}.centre"
        )


def sideways_entry(preview: Preview) -> Iterator[str]:
    """Ends of a fed strip that are moved across it, since their velocity is not along it."""
    course = Course(preview.assembly)
    for stage in preview.assembly.scene.stages:
        course.released |= {name for name, each in stage.edges.items() if each.release}
        edge, direction, held = course.passing
        velocity = stage.edge(edge).velocity
        if not (course.fed(stage) and held and velocity):
            continue
        along = float(np.dot(velocity, direction))
        speed = float(np.linalg.norm(velocity))
        apart = np.arccos(np.clip(abs(along) / speed, 0.0, 1.0)) if speed else 0.0
        if np.sin(apart) > ALIGNED_SINE:
            typed = typed_vector(np.copysign(speed, along) * np.asarray(direction), ".4g")
            yield (
                f"{edge}.velocity in stage {stage.name} is {np.degrees(apart):.2g}° off the strip "
                f"there, so that the {edge} itself moves across it, by {speed * np.sin(apart):.2g} "
                f"m/s. Type {edge}.speed = {np.copysign(speed, along):.4g} instead, or "
                f"try --set 'stages.{stage.name}.{edge}.velocity={typed}'"
            )


def strip_runs_out(preview: Preview) -> Iterator[str]:
    """An end of the strip that travels as far as the first roller on its way."""
    scene, thread = preview.assembly.scene, preview.assembly.thread
    if thread is None or scene.strip.feed:
        return
    back, ahead = preview.assembly.layout.travel
    half = 0.5 * thread.length
    first = min(start for start, _ in thread.arcs.values()) + half
    last = half - max(end for _, end in thread.arcs.values())
    moved = moved_ends(scene.threading, scene.edges, scene.stages)
    led = [key for key, _ in moved if ".exit." in key]
    advice = "So that fresh strip follows, try --set strip.feed=true"
    if led:  # a fed strip passes ends that stay, one of them free
        led = [*dict.fromkeys(led), "edges.exit"]
        advice = f"So that fresh strip follows and runs off at its tension, try it without {led[0]}"
        advice += "".join(f", {key}" for key in led[1:])
    in_time = [stage.name for stage in scene.stages if stage.friction and not stage.steady]
    if varies_along(scene):
        advice = "What a table along gives travels with the strip, which therefore is not fed; in "
        advice += "a steady stage it stays where it is. Try" + "".join(
            f" --set stages.{name}.steady=true" for name in in_time
        )
    for travel, run, end in ((ahead, first, "entry"), (back, last, "exit")):
        if travel > run > 0.0:
            yield (
                f"the strip travels {travel:.3g} m, and after {run:.3g} m its {end} comes to a "
                f"roller. {advice}"
            )


def nip_forces(preview: Preview) -> Iterator[str]:
    """Rollers that nip the strip: their force follows from the gap, where they touch its faces.

    Strip that is drawn round one of them lies otherwise in the gap than straight strip, for which
    the force is told: tension lays it on that one, and its bending lifts it off.
    """
    assembly, thickness = preview.assembly, preview.assembly.strip.thickness
    narrowest = dict[tuple[str, str], tuple[Nip, str]]()
    stages = ["", *(stage.name for stage in assembly.scene.stages)]
    found = assembly.nips
    for stage, each in ((s, nip) for s, nips in zip(stages, found, strict=True) for nip in nips):
        if each.names not in narrowest or each.gap < narrowest[each.names][0].gap:
            narrowest[each.names] = each, stage
    for (a, b), (nip, stage) in narrowest.items() if assembly.scene.contact else ():
        if nip.gap < 0.0:  # see meeting_rollers
            continue
        told = f"rollers {a} and {b} leave a gap of {nip.gap:.3g} m to a strip of {thickness:.3g} m"
        if crushes(assembly, nip):
            yield (
                f"{told}, and would crush it, which does not become thinner. "
                f"Try {closer_rollers(assembly, stage, nip, 0.0)}"
            )
        elif {a, b}.intersection(assembly.pressing):
            continue
        elif nip.first.half:
            closer = assembly.signorini.width
            force, more = (nip_force(assembly, nip, nip.squeeze + s) for s in (0.0, closer))
            drawn = [r.name for r in (nip.first, nip.second) if preview.turn(r) > MAX_LYING_TURN]
            bent = f" were it straight, but it is drawn round {drawn[0]}" if drawn else ""
            low = min(nip.first, nip.second, key=lambda roller: roller.centre[2])
            if weight := borne_weight(preview, low):
                force, more = (off_one_roller(each, weight) for each in (force, more))
                bent = f", as {weight:.3g} N of its weight lay it on {low.name}"
            yield (
                f"{told}, and press it with about {force:.2g} N{bent}. The force of a nip follows "
                f"from its gap by the law of contact, and is {more:.2g} N with one smaller by "
                f"{closer:.1g} m.{given_force(assembly, nip, force)}"
            )
        elif nip.gap < thickness * (1.0 - 1e-9):
            yield f"{told}, and touch its mid-surface alone (contact.faces)."


def given_force(assembly: Assembly, nip: Nip, force: float) -> str:
    """Return what to type so that a roller without a wrap presses the strip with a force (N)."""
    moved = {name for stage in assembly.scene.stages for name in stage.moves}
    free = [name for name in nip.names if assembly.specs[name].wrap is None]
    if not free:
        return ""
    if not moved.isdisjoint(nip.names):
        return f" To give the force, leave the moves out, and give {free[-1]} a press (N)."
    return f" To give it instead, --set rollers.{free[-1]}.press={float(f'{force:.2g}'):g}."


def borne_weight(preview: Preview, roller: Roller) -> float:
    """Return the weight (N) of flat strip that a roller below it bears: half of the spans beside.

    The outermost one bears all that is beyond it.
    """
    assembly = preview.assembly
    gravity = [plan.controls.at(1.0).get("gravity", np.zeros(3))[2] for plan in preview.plans]
    if assembly.thread is not None:
        return 0.0
    held = assembly.scene.held_in("z")
    ends, x = assembly.strip.span, roller.centre[0]
    places = [end for name, end in zip(ENDS, ends, strict=True) if name in held]
    places += [each.centre[0] for each in assembly.rollers if each.centre[2] < 0.0]
    before = max((0.5 * (place + x) for place in places if place < x), default=ends[0])
    behind = min((0.5 * (place + x) for place in places if place > x), default=ends[1])
    weight = assembly.strip.mass * assembly.strip.width * max(-min(gravity), 0.0)
    return weight * (behind - before)


def off_one_roller(force: float, load: float) -> float:
    """Return the force of a nip on the roller off which a load comes that lies on the other one.

    By an exponential law the product of both forces stays, so that from F each they become
    √(F² + load²/4) ± load/2.
    """
    return float(np.hypot(force, 0.5 * load)) - 0.5 * load


def presses(assembly: Assembly, nip: Nip) -> bool:
    """Whether the rollers of a nip touch the faces of the strip, or a force presses one of them."""
    given = not set(nip.names).isdisjoint(assembly.pressing)
    return assembly.scene.contact is not None and bool(nip.first.half or given)


def crushes(assembly: Assembly, nip: Nip) -> bool:
    """Whether a nip that touches faces presses straight strip with more than E/50."""
    with np.errstate(over="ignore"):
        pressure = np.asarray(assembly.signorini(np.array([-0.5 * nip.squeeze])))
    return bool(nip.first.half and pressure[0] > CRUSHING_SHARE * assembly.scene.material.young)


def nip_force(assembly: Assembly, nip: Nip, squeeze: float) -> float:
    """Return the force (N) of rollers on straight strip that is squeezed by so much (m).

    It is summed up over the contact points of the mesh, as in a run: where they stand farther apart
    than the onset reaches, a sum is another force than the integral.
    """
    law, curvature = assembly.signorini, 0.5 / nip.first.radius + 0.5 / nip.second.radius
    reach = np.sqrt((max(squeeze, 0.0) + NIP_RANGE * law.width) / curvature)
    axis = nip.first.unit_axis
    way = across(np.subtract(nip.second.centre, nip.first.centre), axis)
    way /= np.linalg.norm(way)
    middle = np.asarray(nip.first.centre) + (nip.first.radius + 0.5 * nip.gap) * way
    points, areas = assembly.laid_points
    away = points - middle[:, None]
    x = np.cross(axis, way) @ away
    near = (np.abs(x) < reach) & (np.abs(way @ away) < nip.first.radius)
    pressure = np.asarray(law(0.5 * curvature * x[near] ** 2 - 0.5 * squeeze))
    return float(pressure @ areas[near])


def nip_load(assembly: Assembly, nip: Nip, load: float, sure: float) -> float:
    """Return the force of a nip (N/m) on both rollers, beyond that of what loads one (N/m).

    Strip that is laid on one roller by its tension comes off the other one, unless this is pressed.
    """
    force = nip_force(assembly, nip, nip.squeeze) / (sure * assembly.strip.width)
    given = not set(nip.names).isdisjoint(assembly.pressing)
    return force if given else off_one_roller(force, load)


def nip_friction(assembly: Assembly, nip: Nip, load: float, gained: Mapping[str, float]) -> float:
    """Return what friction of a nip that presses so (N/m) holds by both rollers (N/m).

    Those that turn freely hold by their torques (N/m), as far as friction takes these.
    """
    held = 0.0
    for name in nip.names:
        most = coefficient_on(assembly.scene, assembly.specs[name]) * load
        held += float(np.clip(gained.get(name, most), -most, most))
    return held


def typed_place(assembly: Assembly, stage: str, roller: Roller, centre: Array) -> str:
    """Return what to type for a roller that is at a place (m) in a stage: moves are from the first.

    By the last stage until then that moves it, else by where it is drawn.
    """
    key, value = f"rollers.{roller.name}.centre", np.asarray(centre + assembly.origin)
    for each in assembly.scene.course:
        if roller.name in each.moves:
            key = f"stages.{each.name}.rollers.{roller.name}.move"
            value = centre - np.asarray(roller.centre)
        if each.name == stage:
            break
    return f"--set '{key}={typed_vector(np.round(value, PLACE_DECIMALS) + 0.0, '.12g')}'"


def closer_rollers(assembly: Assembly, stage: str, nip: Nip, squeeze: float) -> str:
    """Return what to type for a nip that squeezes the strip by so much in a stage.

    Of its rollers the one that moves, else the second; of one that is pressed the force.
    """
    for name in set(nip.names).intersection(assembly.pressing):
        course, key = assembly.scene.stages, f"rollers.{name}.press"
        until = [each.name for each in course].index(stage) + 1 if stage else 0
        for each in course[:until]:
            if name in each.rollers and each.rollers[name].press is not None:
                key = f"stages.{each.name}.rollers.{name}.press"
        force = two_digits(nip_force(assembly, nip, squeeze), np.ceil)
        return f"--set {key}={force:g}"
    moved = {name for each in assembly.scene.stages for name in each.moves}
    here, other = nip.second, nip.first
    if other.name in moved and here.name not in moved:
        here, other = other, here
    way = across(np.subtract(other.centre, here.centre), here.unit_axis)
    centre = np.asarray(here.centre) + (squeeze - nip.squeeze) / np.linalg.norm(way) * way
    (drawn,) = (roller for roller in assembly.rollers if roller.name == here.name)
    return typed_place(assembly, stage, drawn, centre)


def slack_edge(preview: Preview) -> Iterator[str]:
    """Rollers so far out of line that an edge of the strip that they steer bears no tension.

    Strip that sticks to a roller comes to it at right angles, and bends in its plane between the
    roller and what guides it a length L before.  Out of line by θ, its curvature there is
    θ K coth(K L/2) with K² = 12 T/(E t W²), that of Shelton's beam (Lateral dynamics of a moving
    web, 1968); the inner edge, W/2 away, is slack where that is more than 2 T/(E t W).  A short run
    shears as well, by which it bends 1 + 2 E I/(G A_s L²) times less, with A_s = 5/6 t W
    (Timoshenko's beam, without tension).
    """
    assembly, thread = preview.assembly, preview.assembly.thread
    scene = assembly.scene
    runs = scene.strip.feed or any(stage.steady for stage in scene.stages)
    if thread is None or scene.friction is None or scene.strip.kinematics != "shell" or not runs:
        return
    width, path = assembly.strip.width, thread.middle
    strain = largest_force(scene) / (scene.material.young * assembly.strip.thickness)
    k = np.sqrt(12.0 * strain) / width
    before, since = np.array([0.0, 1.0, 0.0]), 0.0
    guided = not scene.released
    for roller, start, end in zip(thread.rollers, *path.arcs[:2], strict=True):
        axis = roller.unit_axis / roller.unit_axis[1]
        heading = path.at(start[0], 0)[1]
        angle = abs(float((axis - before)[[0, 2]] @ heading))
        run = start[0] - since
        sheared = 0.4 * (1.0 + scene.material.poisson) * (width / run) ** 2
        bearable = (1.0 + sheared) * 2.0 * strain / (width * k) * np.tanh(0.5 * k * run)
        slender = run > SLENDER_RUN * width
        if guided and slender and angle > bearable:
            axis = before + SAFE_ANGLE_SHARE * bearable / angle * (axis - before)
            yield (
                f"roller {roller.name} is out of line by {1e3 * angle:.3g} mrad with what guides "
                f"the strip {run:.3g} m before. Strip that it steers has a slack edge "
                f"from {1e3 * bearable:.2g} mrad on, and wrinkles. "
                f"Try --set 'rollers.{roller.name}.axis={typed_vector(axis, '.2g')}'"
            )
        before, since, guided = axis, end[0], True


def turned_axis(preview: Preview) -> Iterator[str]:
    """Rollers turned so far that a wide strip cannot be laid around them: in degrees, perhaps."""
    scene, thread = preview.assembly.scene, preview.assembly.thread
    if thread is None or scene.strip.kinematics != "shell":
        return
    told = " ".join(slack_edge(preview))
    for roller in thread.rollers:
        axis = roller.unit_axis / roller.unit_axis[1]
        angle = float(np.hypot(axis[0], axis[2]))
        if angle <= MAX_AXIS_ANGLE or f"roller {roller.name} " in told:
            continue
        axis[[0, 2]] *= np.radians(1.0)
        yield (
            f"the axis of roller {roller.name} is {np.degrees(angle):.2g}° off the direction "
            "across the strip, and edges of a wide strip are slack by much less than one. For an "
            "angle in degrees, "
            f"try --set 'rollers.{roller.name}.axis={typed_vector(axis, '.2g')}'"
        )


def longest_fibre(strip: Strip, own: Array, led: bool) -> float:
    """Return by which strain the longest fibre exceeds the mean across, on a mesh of rectangles.

    Up to the sides of its elements, where edges of the strip are and corners of what is typed.

    Parameters
    ----------
    strip : Strip
    own : ndarray, shape (points,)
        Strains along the strip without stress, at quadrature points.
    led : bool
        Whether rollers lead it straight; else it bends by what is linear across.
    """
    _, row = np.unique(np.round(quadrature_points(strip)[0] / strip.length, 9), return_inverse=True)
    weights = strip.weights().ravel()
    width, y = np.bincount(row, weights), quadrature_points(strip)[1]
    y = y - (np.bincount(row, weights * y) / width)[row]
    uneven = own - (np.bincount(row, own * weights) / width)[row]
    if not led:
        bend = np.bincount(row, weights * y * uneven) / np.bincount(row, weights * y**2)
        uneven = uneven - bend[row] * y
    sides = uneven.reshape(-1, len(TO_SIDES), len(TO_SIDES)).swapaxes(1, 2) @ TO_SIDES
    return float(max(uneven.max(), sides.max()))


def uneven_fibres(preview: Preview) -> Iterator[str]:
    """Heat, flatness or camber by which the longest fibres of a section bear no tension.

    A fibre whose length without stress is larger by the share e than the mean across bears
    T − E t e, with the mean T.  Strip that no roller leads straight bends by what is linear in e.
    """
    strip, tension = preview.assembly.strip, preview.tension
    if strip.kinematics.name != "shell" or shape_of(strip) != "quad" or tension == 0.0:
        return
    led = bool(preview.assembly.rollers)
    for key in ("temperature", "flatness", "camber"):
        needed = 0.0
        for plan in preview.plans:
            given = {k: v for k, v in plan.controls.at(1.0).items() if k == f"strip.{key}"}
            if (own := eigenstrain(strip, given)) is not None:
                excess = longest_fibre(strip, own[0, 0], led)
                needed = max(needed, strip.tensile_stiffness * excess)
        if needed > tension:
            share = two_digits(SAFE_ANGLE_SHARE * tension / needed, np.floor)
            camber = preview.assembly.scene.strip.camber if key == "camber" else None
            less = f"{share:g} of it"
            if camber is not None:
                less = f"--set strip.camber={share * camber:.2g}"
            straight = ", where rollers lead strip straight," if led else ""
            yield (
                f"fibres are so unequal by strip.{key} that{straight} the longest "
                f"bear none of a tension below about {needed:.2g} N/m. At "
                f"{tension:.3g} N/m they are slack, and may wrinkle. "
                f"Try {less}, or more tension"
            )


def loose_fibres(preview: Preview) -> Iterator[str]:
    """Rollers with profiles on which the shortest fibres of a shell bear no tension.

    On a roller of the profile r(y) a fibre is shorter than the mean by e = (r̄ − r)/r̄, but for what
    is linear in y, which bends the strip in its plane.  If the arc a is long it bears T − E t e
    there.  Shorter arcs share e with the strip beside them: what balances itself across a width W
    decays like e^(−4.21 x/W) (Timoshenko and Goodier, Theory of elasticity, 1970, §26), so that
    1 − e^(−2.1 a/W) of it is left in the middle.
    """
    strip, thread, scene = preview.assembly.strip, preview.assembly.thread, preview.assembly.scene
    tension = min((pull for pull in given_tensions(scene) if pull > 0.0), default=0.0)
    if strip.kinematics.name != "shell" or thread is None or tension == 0.0:
        return
    needed, turns = dict[str, float](), thread.turns
    y = strip.width * np.linspace(-0.5, 0.5, PROFILE_SAMPLES)
    for roller in thread.rollers:
        radii = roller.radius_at((y - roller.centre[1]) / roller.unit_axis[1])
        shorter = float((np.polyval(np.polyfit(y, radii, 1), y) - radii).max() / radii.mean())
        least, bending = 0.0, taken_by_bending(preview, roller)
        for _ in range(8):  # the more tension, the longer is the arc
            lifted = 2.0 * np.arccos(max(1.0 - bending / max(least, tension), -1.0))
            arc = max(turns[roller.name] - lifted, 0.0) * radii.mean()
            least = strip.tensile_stiffness * -np.expm1(-2.1 * arc / strip.width) * shorter
        if least > tension:
            needed[roller.name] = least
    if needed:
        most = two_digits(max(needed.values()), np.ceil)
        share = two_digits(SAFE_ANGLE_SHARE * tension / most, np.floor)
        yield (
            f"the radius of {', '.join(needed)} varies so much below the strip that its "
            f"shortest fibres there bear none of a tension below about {most:.2g} N/m. At "
            f"{tension:.3g} N/m they come off, and the strip beside may wrinkle. "
            f"Try {share:g} of the crown or taper, or {raised_tensions(scene, most)}"
        )


def raised_tensions(scene: SceneSpec, least: float) -> str:
    """Return settings by which no tension that pulls a threaded line is below one (N/m)."""
    low = [key for key, tension in typed_tensions(scene).items() if tension < least]
    return " ".join(f"--set {key}={least:g}" for key in low)


def sinking_exit(preview: Preview) -> Iterator[str]:
    """An exit that is free to sink under the weight of the last run, by q l²/2T.

    It is pulled in the direction in which it is drawn, and the strip there turns by q l/T.
    """
    scene, thread = preview.assembly.scene, preview.assembly.thread
    given = scene.threading
    if thread is None or given is None or given.exit is None or preview.tension == 0.0:
        return
    gravity = max((-stage.gravity[2] for stage in scene.stages if stage.gravity), default=0.0)
    weight = preview.assembly.strip.mass * gravity
    last = thread.rollers[-1]
    run = abs(given.exit[0] - preview.assembly.origin[0] - float(last.centre[0]))
    turn = weight * run / preview.tension
    if turn > VISIBLE_TURN and "exit" not in scene.held_in("z"):
        yield (
            f"the exit is free to sink, by about {0.5 * turn * run:.2g} m under the weight of the "
            f"last {run:.3g} m, which turns the strip behind {last.name} by "
            f"{np.degrees(turn):.2g}°. To hold it at the height where it is drawn, "
            "try --set 'edges.exit.fixed=[\"z\"]'"
        )


def turning_pull(preview: Preview) -> Iterator[str]:
    """Tension of flat strip on rollers whose end is free to turn under weight or pressure.

    It turns with the end, and its part across, T sin, is borne by the last roller: of 5 m that
    weigh 132 N and reach 0.1 m beyond it under 22 kN/m, 190 N instead of 19.
    """
    scene, told = preview.assembly.scene, set[str]()
    if scene.threading is not None or not scene.rollers:
        return
    for plan in preview.plans:
        end = plan.controls.at(1.0)
        for name in ENDS:
            loaded = np.any(end.get("gravity", 0.0)) or np.any(end.get("pressure", 0.0))
            free = name not in scene.held_in("z")
            pull = float(end.get(f"{name}.tension", 0.0))
            if not (loaded and free and pull) or name in told:
                continue
            told.add(name)
            held = json.dumps([*scene.edges.get(name, EdgeSpec()).fixed, "z"])
            force = typed_vector((pull if name == "exit" else -pull, 0.0, 0.0))
            yield (
                f"the tension of the {name} in stage {plan.name} turns with the strip there, which "
                "loads bend: rollers bear its part across besides. Instead of it give "
                f"{name}.force = {force}, which has a direction of its own, or try "
                f"--set 'edges.{name}.fixed={held}'"
            )


def lifting_pressure(preview: Preview) -> Iterator[str]:
    """Pressure p that carries strip of tension T off a roller of radius r, or blows a run up.

    Strip on the roller is lifted for p > T/r.  A run of length L beside it is an arc of the radius
    T/p, which there is none of for p > 2 T/L, and takes p L/2T of the wrap, a run to an end that is
    free across p L/T.  Weight across a run counts against p, or with it.
    """
    scene, tension, mass = preview.assembly.scene, preview.tension, preview.assembly.strip.mass
    radii = {roller.name: roller.radius for roller in scene.rollers}
    for stage, plan, string in preview:
        pressure, path = stage.pressure or 0.0, string.path
        if not pressure or path is None or tension == 0.0:
            continue
        runs, sense = np.diff(path.starts[:, 0])[::2], np.sign(pressure)
        side = "over" if sense > 0.0 else "under"
        heading = path.angles[::2, 0]
        gx, _, gz = plan.controls.at(1.0).get("gravity", np.zeros(3))
        against = -sense * mass * (gz * np.cos(heading) - gx * np.sin(heading))
        free = [end not in scene.held_in("z") for end in ENDS]
        taken = 0.5 * runs
        taken[[0, -1]] *= np.where(free, 2.0, 1.0)
        arcs = 2.0 * tension / runs + against
        bounds = [(arcs.min(), f"a run of {runs[arcs.argmin()]:.3g} m is no arc of it")]
        for i, (name, turn) in enumerate(string.turns.items()):
            if string.senses[name] == side:
                beside, weight = taken[i : i + 2], against[i : i + 2]
                turned = (tension * turn + beside @ weight) / beside.sum()
                limit = min(turned, tension / radii[name] + weight.mean())
                bounds.append((limit, f"strip leaves roller {name}"))
        least, what = min(bounds)
        if abs(pressure) > least:
            key = f"stages.{stage.name}.pressure"
            advice = ", as under any pressure"
            if least > 0.0:
                safe = sense * two_digits(SAFE_ANGLE_SHARE * least, np.floor)
                advice = f". Try --set {key}={safe:g}"
            yield (
                f"{key} = {pressure:g} bends strip under {tension:.3g} N/m to a radius of "
                f"{tension / abs(pressure):.2g} m: {what}{advice}"
            )
            return


def lifted_off_by_pressure(preview: Preview) -> Iterator[str]:
    """Pressure on flat strip that nothing pulls, by which it leaves the rollers that carry it."""
    scene, material = preview.assembly.scene, preview.assembly.material
    held = scene.held_in("z")
    if scene.threading is not None or preview.tension > 0.0 or len(held) >= len(ENDS):
        return
    sides = {np.sign(roller.centre[2]) for roller in scene.rollers}
    for stage, plan, _ in preview:
        pressure, gravity = stage.pressure or 0.0, plan.controls.at(1.0).get("gravity", np.zeros(3))
        weight = material.density * scene.strip.thickness * float(gravity[2])
        if pressure * weight < 0.0 and np.sign(pressure + weight) not in {*sides, 0.0}:
            key, least = f"stages.{stage.name}.pressure", SAFE_ANGLE_SHARE * abs(weight)
            yield (
                f"{key} = {pressure:g} is more than the strip weighs, {abs(weight):.3g} Pa, and "
                "lifts it off its rollers: nothing beyond holds it. "
                f"Try --set {key}={np.sign(pressure) * two_digits(least, np.floor):g}"
            )
            return


def side_of_return(preview: Preview) -> Iterator[str]:
    """Rollers "over" which strip that travels back along −x passes below, or "under" them above.

    The sides are those of travel along +x; "left" and "right" are plain either way.
    """
    meant = {"over": ("above", "right", "left"), "under": ("below", "left", "right")}
    for spec, roller in zip(preview.assembly.scene.rollers, preview.assembly.rollers, strict=True):
        where, other, same = meant.get(spec.wrap or "", ("", "", ""))
        found, here = preview.passes(roller), preview.lies(roller)
        if where and here is not None and found in {"above", "below"} and found != where:
            place, turn = here
            z = place[1] / np.linalg.norm(place) * (1.0 if where == "above" else -1.0)
            if turn > np.pi or z > np.cos(0.5 * turn) - 1e-9:
                continue  # it passes there as well, or turns back over itself
            yield (
                f'wrap = "{spec.wrap}" is meant along +x, and strip that travels back along −x '
                f'passes {found} roller {roller.name} by it. If that is meant, type "{same}". '
                f"To pass {where}, try --set 'rollers.{roller.name}.wrap=\"{other}\"'"
            )


PHYSICS_RULES = (
    side_of_return, lifting_pressure, lifted_off_by_pressure, sinking_exit, turning_pull,
    nip_forces, heavy_bearings, slack_edge, uneven_fibres, loose_fibres, untouched_roller,
    sideways_entry, beyond_yield, stretched_beyond_yield, gravity_upwards, unequal_speeds,
    opposed_nip, slipping_nips, standing_rollers, standing_line, drawn_across,
)  # fmt: skip
