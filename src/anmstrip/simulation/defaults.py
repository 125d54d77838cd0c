"""What a scene leaves open: slip speed, whether fresh strip comes in, and what centres it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from anmstrip.arrays import Array
from anmstrip.scene.checks import (
    ROUND_OFF,
    edge_controls,
    held_along,
    moved_ends,
    pressed_against,
    strain_units,
)
from anmstrip.scene.schema import SceneSpec
from anmstrip.scene.tables import ENDS, FieldSpec, NaturalShape, RollerSpec, StageSpec

CREEP_SHARE = 0.1
"""Share of the elastic creep that V_c is by default.

What sticks creeps at up to about V_c, and the algebraic law in full slip, which the elastic creep
at least is, then misses f by 0.5 %."""


SLACK_SHARE = 0.1
"""Share of the largest tension below which a tension does not make V_c smaller.

Errors are told relative to the largest; strip that breaks, 30 to 0.3 kN/m within 20 ms, takes
1 155 tangents with it, and without it is not at rest after 2 070."""


STANDING_GIVE = 0.2
"""Share of a radius by which strip around rollers that stand gives way to a change of tension.

What sticks creeps on while the line rests: a step of 10 to 16 kN/m on a quarter of a turn at
f = 0.25 leaves 1.7 % more at the entry than e^(fθ) after two seconds with 1, with 0.2 0.6 %."""


REST_CREEP_SHARE = 1e-4
"""Share of the stretch of the shortest span by which strip on rollers creeps while a line stands.

Of the drag of an idler, 80 N/m, that leaves all but 2 N/m after 5 s; with the V_c of the line that
runs it is gone.  Between two rolls of a bridle that rests for 2 s the 10.711 kN/m rise by 1 N/m in
three tangents, else by 170 in 16."""


REST_SLIP_SHARE = 1e-2
"""Share of the speed at which tensions or heat that change stretch the shortest span of a line that
stands, by which V_c is larger.

A line of two rollers that is pulled by half as much more in ten minutes, or heated by 300 K, takes
24 and 30 tangents; with 0.1 they take 13 and 61, and the first is off by 4 % instead of 1 %."""


HELD_SLIP_SHARE = 1e-3
"""Share of the speed at which held strip comes to slip on its rollers that V_c is by default.

Until it slips as a whole, strip creeps on them by that share of the way that stretches it.  On two
half turns at f = 0.5 the 21.36 kN/m at the held end are right to 0.001 N/m in 824 tangents; with a
tenth of the elastic creep, a fiftieth of that, they take 2 612.  With 3e-3 they take 246, but a
section that slips at a tolerance of 1e-6 is off by six of these, and not by 0.5."""


BENDING_SPAN = 1.0 / 3.0
"""Share of a span over which strip is bent onto a roller at most: by √(D/T) alone a leveller of
seven rollers 60 mm apart, under 10 kN/m, flows at 1.031 of its yield stress instead of 0.988."""

PLASTIC_SHAPE = 1.5
"""Moment of a strip that is plastic all through its thickness over that of its first yield."""

YIELDED_STRAIN = 3.0
"""Plastic strain of strip that is drawn or moved, over that of first yield, of which its rate is
guessed: with n = 51 three times as much changes the stress by 2 %."""


USUAL_STRAIN = 1e-4
"""Strain of strip that nothing pulls, from which its V_c is chosen: of steel under 20 MPa."""


def with_defaults(scene: SceneSpec) -> SceneSpec:
    """Return the scene with what it has left open, and pressed rollers at the strip."""
    scene = scene.model_copy(update={"rollers": closed_rollers(scene)})
    if scene.strip.feed is None:
        scene = scene.with_values(strip={"feed": is_fed_by_default(scene)})
    if loose_across(scene):
        entry = scene.edges["entry"].model_copy(update={"centred": True})
        scene = scene.model_copy(update={"edges": {**scene.edges, "entry": entry}})
    if scene.friction is None or scene.friction.speed is not None:
        return scene
    return scene.with_values(friction={"speed": regularising_speed(scene)})


def closed_rollers(scene: SceneSpec) -> tuple[RollerSpec, ...]:
    """Return the rollers, of which those that are pressed touch both sides of straight strip.

    However far open they are drawn; see :attr:`Assembly.faces`.
    """
    faces = scene.contact is None or scene.contact.faces is not False
    found = {roller.name: roller for roller in scene.rollers}
    for name, roller in found.items():
        partner = None if roller.press is None else pressed_against(scene.rollers, roller)
        closing = 0.0 if partner is None else partner.gap - faces * scene.strip.thickness
        if partner is not None and abs(closing) > ROUND_OFF * roller.radius:
            centre = np.asarray(roller.centre) + closing * partner.way
            found[name] = roller.model_copy(update={"centre": tuple(centre.tolist())})
    return tuple(found.values())


def loose_across(scene: SceneSpec) -> bool:
    """Return whether a threaded shell has its entry centred by default: nothing else holds its y.

    Threading is without friction, and steady strip slides through its shape.  Rollers that are
    thicker in the middle may guide it, unless a taper or an axis out of line drives it to a side;
    an odd number of elements across has no node in the middle.
    """
    strip, edges = scene.strip, scene.edges
    driven = any(roller.taper or roller.axis[0] or roller.axis[2] for roller in scene.rollers)
    guided = any(guides_strip(roller, strip.width) for roller in scene.rollers) and not driven
    odd = strip.cells is not None and strip.cells[1] % 2 == 1
    free = free_across(scene) and not (guided or odd)
    return free and "entry" in edges and edges["entry"].centred is None


def guides_strip(roller: RollerSpec, width: float | None) -> bool:
    """Return whether a roller is thinner under both edges of the strip than in its middle.

    Strip runs to where a roller is thicker: a spreader with a hollow drives it off.
    """
    half = 0.5 * (width or 0.0)
    crown = [np.polyval((*reversed(roller.crown), 0.0), y) for y in (-half, half)]
    return bool(max(crown) < 0.0) or (roller.sides is not None and roller.sides.taper > 0.0)


def free_across(scene: SceneSpec) -> bool:
    """Return whether no edge of a threaded shell is held in y."""
    threading = scene.threading
    if threading is None or threading.closed or scene.strip.kinematics != "shell":
        return False
    held = any(edge.centred or "y" in edge.fixed for edge in scene.edges.values())
    return not (held or scene.strip.mesh)


def varies_along(scene: SceneSpec) -> bool:
    """Return whether strip has a shape of its own that varies along; heat is that of its place."""
    given = [item for shape in scene.shapes for item in shape.natural.items()]
    return any(getattr(value, "along", ()) for key, value in given if key != "temperature")


def is_fed_by_default(scene: SceneSpec) -> bool:
    """Return whether the strip is fed by default: it goes on beyond entry and exit.

    It does if it is threaded, or if it is pulled and an end that was held is let go.  Not where
    ends are moved so that it cannot, where nothing rubs, and where its shape or its yield belongs
    to the material; heat belongs to its place, as in a furnace.
    """
    strip = scene.strip
    own = strip.mesh or strip.imperfection or scene.material.plasticity or varies_along(scene)
    let_go = scene.released and largest_force(scene) > 0.0
    endless = scene.threading is not None or let_go
    closed = scene.threading is not None and scene.threading.closed
    if closed or not endless or scene.friction is None or own:
        return False
    return not any(moved_ends(scene.threading, scene.edges, scene.stages))


def open_stages(scene: SceneSpec) -> list[StageSpec]:
    """Return stages in which runs of a fed strip can take it up: an end is not held along."""
    threading = scene.threading
    if not scene.strip.feed or scene.strip.mesh or threading is None or threading.closed:
        return []
    stages = held_along(threading, scene.edges, scene.stages)
    return [stage for stage, held in stages if not set(ENDS) <= held]


def follows_rollers(scene: SceneSpec) -> bool:
    """Return whether labels of a fed strip follow rollers that move, and runs take strip up."""
    wrapped = {r.name for r in scene.rollers if r.wrap is not None}
    moved = {name for stage in open_stages(scene) for name in stage.moves}
    return not wrapped.isdisjoint(moved)


def thermal_growth(scene: SceneSpec, given: FieldSpec, places: Array) -> Array:
    """Return ∂S/∂X − 1 by which labels of warm strip stay where it was threaded, (places,).

    Parameters
    ----------
    scene : SceneSpec
    given : FieldSpec
        Temperature (K), of which the mean across counts.
    places : ndarray, shape (places,)
        Distances from the entry (m).
    """
    fields = scene.strip.temperature or FieldSpec(across=(0.0,)), given
    expansion = scene.material.expansion or 0.0
    before, after = (1.0 + expansion * field.means(places) for field in fields)
    return np.asarray(before / after - 1.0) * np.ones_like(places)


def regularising_speed(scene: SceneSpec) -> float:
    """Return V_c (m/s): a share of the elastic creep, or of held strip's slip if that is more."""
    creep, slip = CREEP_SHARE * elastic_creep(scene), slip_of_held_strip(scene)
    return max(creep, HELD_SLIP_SHARE * slip)


def has_default_slip_speed(scene: SceneSpec) -> bool:
    """Return whether friction has the V_c that follows from the rest of a scene."""
    return scene.friction is not None and scene.friction.speed == regularising_speed(scene)


def resting_speed(scene: SceneSpec, stage: StageSpec) -> float:
    """Return V_c (m/s) by which strip hardly creeps in a stage in which it stands."""
    strain = REST_CREEP_SHARE * working_strain(scene)
    strain += REST_SLIP_SHARE * resting_stages(scene)[stage.name]
    return strain * shortest_span(scene) / stage.duration


def slip_of_held_strip(scene: SceneSpec) -> float:
    """Return the speed (m/s) at which strip with a held end comes to slip on all rollers.

    Rollers that come to a difference of speeds V in the time τ from rest have stretched a run by
    s = l T/(E t) when it is √(2 V s/τ), or V if that is less.  It is 0 where strip may stick: on
    rollers that follow it, are moved, stand as it does or come to rest, in a steady stage, and
    where no end is held throughout.
    """
    held = [name for name in scene.held_in("x") if name not in scene.released]
    driven = all(roller.drive == "speed" for roller in scene.rollers)
    closed = scene.threading is not None and scene.threading.closed
    if not (held and driven) or closed:
        return 0.0
    run = scene.strip.length if scene.threading is None else shortest_span(scene)
    if run is None:
        return 0.0
    begun = next((s.duration for s in scene.stages if any(v for _, v in stage_speeds(scene, s))), 0)
    rollers, slips = [f"rollers.{roller.name}" for roller in scene.rollers], list[float]()
    speeds = dict.fromkeys([*held, *rollers], 0.0)
    for stage in scene.stages:
        before, speeds = speeds, speeds | dict(stage_speeds(scene, stage))
        moved = stage.friction and any(move_lengths(stage))
        if stage.steady or moved or any(before[name] * speeds[name] < 0.0 for name in speeds):
            return 0.0
        if stage.friction and (slips or any(speeds.values())):
            turning = np.abs([speeds[name] for name in rollers])
            slips += [float(np.abs(turning - abs(speeds[end])).min(initial=np.inf)) for end in held]
    slip, way = min(slips, default=0.0), run * working_strain(scene)
    return min(slip, float(np.sqrt(2.0 * slip * way / begun))) if slip else 0.0


def resting_stages(scene: SceneSpec) -> dict[str, float]:
    """Return the stages in which a threaded line stands after it has run.

    Each with the strain by which tensions or heat that are given anew stretch the strip in it.
    Strip that hangs by its weight moves with its tensions.
    """
    if scene.threading is None:
        return {}
    speeds, resting, ran = dict[str, float](), dict[str, float](), False
    pulls = dict.fromkeys(ENDS, scene.threading.tension)
    for stage in scene.stages:
        running, before = any(speeds.values()), pulls
        speeds = speeds | dict(stage_speeds(scene, stage))
        pulls = pulls | dict(edge_pulls(stage))
        moving = running or any(speeds.values()) or any(move_lengths(stage)) or stage.steady
        change = max(abs(pull - before.get(name, 0.0)) for name, pull in pulls.items())
        hauled = change > 0.0 and distributed_load(scene) > 0.0
        if ran and not (moving or hauled):
            pulled = change / (scene.material.young * scene.strip.thickness)
            resting[stage.name] = max(pulled, eigenstrain(scene, stage.strip))
        ran = ran or any(speeds.values())
    return resting


def shortest_span(scene: SceneSpec) -> float:
    """Return the least distance (m) between rollers that strip is threaded on, and its ends."""
    threading = scene.threading
    assert threading is not None
    centres = [roller.centre for roller in scene.rollers if roller.wrap is not None]
    way = (threading.entry, *centres, threading.exit)
    points = np.array([point for point in way if point is not None])
    spans = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return float(spans.min(initial=scene.strip.length or np.inf))


def elastic_creep(scene: SceneSpec) -> float:
    """Return the speed (m/s) at which a driven strip slips because tension stretches it.

    Where friction takes up to f T of the tension T, strains differ by f T/(E t), and speeds by as
    much of the speed of the line: V f T/(E t).  T is the least tension that the scene asks for, or
    a tenth of the largest if that is more.
    """
    assert scene.friction is not None
    own = [roller.friction for roller in scene.rollers]
    f = max([scene.friction.coefficient, *(g for g in own if g is not None)]) or 1.0
    return f * working_strain(scene) * line_speed(scene)


def coefficient_on(scene: SceneSpec, roller: RollerSpec) -> float:
    """Return the friction coefficient on a roller, 0 without friction."""
    given = 0.0 if scene.friction is None else scene.friction.coefficient
    return given if roller.friction is None else roller.friction


def working_strain(scene: SceneSpec) -> float:
    """Return that of the least tension of a scene, or of a tenth of the largest if that is more."""
    young, thickness = scene.material.young, scene.strip.thickness
    wanted = [pull for pull in given_tensions(scene) if pull > 0.0]
    least = min(wanted, default=USUAL_STRAIN * young * thickness)
    return max(least, SLACK_SHARE * largest_force(scene)) / (young * thickness)


def given_tensions(scene: SceneSpec) -> Iterator[float]:
    """Yield the tensions and the sizes of edge forces that a scene asks for (N/m)."""
    if scene.threading is not None:
        yield scene.threading.tension
    for stage in scene.stages:
        yield from (pull for _, pull in edge_pulls(stage))


def typed_tensions(scene: SceneSpec) -> dict[str, float]:
    """Return the tensions above 0 that a scene gives (N/m), by their keys, threading first."""
    given = {"threading": 0.0 if scene.threading is None else scene.threading.tension}
    given |= {key: end.tension or 0.0 for key, _, end in edge_controls(scene.stages)}
    return {f"{key}.tension": tension for key, tension in given.items() if tension}


def edge_pulls(stage: StageSpec) -> Iterator[tuple[str, float]]:
    """Yield edges whose force or tension a stage gives, and its size (N/m); the tension last."""
    for name, edge in stage.edges.items():
        if edge.force is not None:
            yield name, float(np.linalg.norm(edge.force))
        if edge.tension is not None:
            yield name, edge.tension


NO_STRAIN = 1e-9
"""Part of heat or flatness that is none: round-off of what is not linear across."""


def eigenstrain(scene: SceneSpec, shape: NaturalShape, *, stressing: bool = False) -> float:
    """Return the largest strain that heat, flatness or camber give the unstressed strip.

    With `stressing` the part of it that stresses the strip: all where edges hold it in its plane,
    else of a shell what is not linear across, and of what varies along by Δ its (b/L)² Δ.
    """
    strip, found = scene.strip, [0.0]
    units = strain_units(strip, scene.material)
    across = any("y" in edge.fixed and not edge.centred for edge in scene.edges.values())
    free = stressing and not across and len(held_ends(scene)) < len(ENDS)
    for key in units.keys() & shape.natural.keys():
        given = shape.natural[key]
        values = np.asarray(given.samples if isinstance(given, FieldSpec) else given)
        if free and (strip.kinematics == "section" or not isinstance(given, FieldSpec)):
            continue
        if free and isinstance(given, FieldSpec):
            slender = min(1.0, strip.width / strip.length) if strip.length and strip.width else 1.0
            found.append(units[key] * slender**2 * float(np.ptp(values, axis=1).max()))
            bent = values - np.vander(given.places, 2) @ np.polyfit(given.places, values, 1)
            values = np.where(np.abs(bent) > NO_STRAIN * np.abs(values).max(), bent, 0.0)
        found.append(units[key] * float(np.abs(values).max()))
    return max(found)


def held_ends(scene: SceneSpec) -> list[str]:
    """Return which ends of the strip are held along it."""
    return [name for name in ENDS if name in scene.held_in("x")]


def largest_force(scene: SceneSpec) -> float:
    """Largest tension or edge force of all stages (N/m), 0 if there is none."""
    return max(map(abs, given_tensions(scene)), default=0.0)


def pulled_nowhere(scene: SceneSpec) -> bool:
    """Whether only weight, pressure, rollers and friction act on flat strip."""
    led = any(moved_ends(scene.threading, scene.edges, scene.stages))
    return not (scene.threading or led or largest_force(scene) or tension_of_moves(scene))


def tension_of_moves(scene: SceneSpec) -> float:
    """Return what stretches flat strip between held ends (N/m) if they or rollers are moved.

    A roller that comes in by h at the distances a and b from the ends makes the way longer by
    h² (1/a + 1/b)/2.  Strip that yields bears no more than its yield stress.
    """
    length = scene.strip.length
    if length is None or scene.threading or len(held_ends(scene)) < len(ENDS):
        return 0.0
    ways, places = [length], {name: (np.zeros(3), np.zeros(3)) for name in ENDS}
    for stage in scene.stages:
        places = {name: carried(stage, name, *places[name]) for name in ENDS}
        apart = np.array([length, 0.0, 0.0]) + places["exit"][0] - places["entry"][0]
        way = float(np.linalg.norm(apart))
        for roller in scene.rollers:
            x, _, z = np.add(roller.centre, stage.moves.get(roller.name, 0.0))
            into = roller.radius - np.copysign(z, z * roller.centre[2])
            if into > 0.0 and abs(x) < 0.5 * length:
                way += 0.5 * into**2 * (1.0 / (0.5 * length + x) + 1.0 / (0.5 * length - x))
        ways.append(way)
    stretched = scene.material.young * (max(ways) / length - 1.0)
    return scene.strip.thickness * min(stretched, flow_stress(scene) or np.inf)


def tension_of_loads(scene: SceneSpec) -> float:
    """Return what pulls flat strip between held ends (N/m) as weight or pressure q bends it.

    T³ = E t (q L)²/24, without rollers, of strip that hardly resists bending.
    """
    length, m = scene.strip.length, scene.material
    if length is None or scene.threading or scene.rollers or len(held_ends(scene)) < len(ENDS):
        return 0.0
    load = distributed_load(scene) * length
    return float(np.cbrt(m.young * scene.strip.thickness * load**2 / 24.0))


def load_of_moves(scene: SceneSpec) -> float:
    """Return the largest load (N/m) of a roller that moves into flat strip and bends it.

    As of a beam on two supports, 3 D δ (a + b)/a²b², for a roller that comes by δ beyond the line
    between the nearest ones on the other side of the strip, at the distances a and b from it.  On a
    foundation k a roller by δ beyond the flat strip bears √8 (D k³)^(1/4) δ (Hetényi 1946).
    """
    rollers, moves, largest = scene.rollers, dict[str, tuple[float, ...]](), 0.0
    D, k3 = bending_stiffness(scene), (scene.strip.foundation or 0.0) ** 3
    sides = np.array([np.copysign(1.0, -roller.centre[2]) for roller in rollers])  # 1: below
    radii = np.array([roller.radius for roller in rollers])
    for stage in scene.stages:
        moves |= stage.moves
        x, _, z = np.array([np.add(r.centre, moves.get(str(r.name), 0.0)) for r in rollers]).T
        edges = z + sides * radii
        for k, side in enumerate(sides):
            before, after = ((sides == -side) & way for way in (x < x[k], x > x[k]))
            largest = max(largest, np.sqrt(8.0) * (D * k3) ** 0.25 * side * edges[k])
            if not (before.any() and after.any()):
                continue
            i, j = x[before].argmax(), x[after].argmin()
            a, b = np.maximum([x[k] - x[before][i], x[after][j] - x[k]], radii[k])  # no nip
            line = (b * edges[before][i] + a * edges[after][j]) / (a + b)
            beyond = side * (edges[k] - line)
            largest = max(largest, 3.0 * D * beyond * (a + b) / (a * b) ** 2)
    return float(largest)


def carried(stage: StageSpec, name: str, place: Array, velocity: Array) -> tuple[Array, Array]:
    """Return where an end has been moved to (m) at the end of a stage, and its velocity there."""
    edge, after = stage.edge(name), velocity
    if edge.move is not None:
        return np.array(edge.move), np.zeros(3)
    if edge.velocity is not None:
        after = np.array(edge.velocity)
    elif edge.speed is not None:
        after = np.array([edge.speed, 0.0, 0.0])
    return place + 0.5 * stage.duration * (velocity + after), after


def bending_stiffness(scene: SceneSpec) -> float:
    """D (N m), zero for a strip that does not resist bending."""
    m, t = scene.material, scene.strip.thickness
    return m.young * t**3 / (12.0 * (1.0 - m.poisson**2)) if scene.strip.bending else 0.0


def boundary_layer(scene: SceneSpec) -> float:
    """√(D/T) (m) of the largest tension, given, by moves or loads, or what a foundation leaves.

    That is (4 D/k)^(1/4) (Hetényi, Beams on elastic foundation, 1946); without both infinite.
    """
    tension, k = largest_force(scene) or tension_of_moves(scene), scene.strip.foundation
    tension = tension or tension_of_loads(scene)
    layer = float(np.sqrt(bending_stiffness(scene) / tension)) if tension > 0.0 else np.inf
    return min(layer, (4.0 * bending_stiffness(scene) / k) ** 0.25) if k else layer


class EdgeCurl(NamedTuple):
    """Strip that lifts off a cylinder beside a free edge."""

    width: float  # m
    lift: float  # m, of the edge
    force: float  # N, along, by which it relieves the middle of the strip


def edge_curl(scene: SceneSpec, radius: float) -> EdgeCurl:
    """Return how free edges curl off a cylinder of radius r.

    The moment ν D/r that keeps strip straight across ends at its edges.  Over a width b each lifts
    off as a beam on the stiffness E t/r² of hoops, which rests without a moment where it touches:
    β b = π/2 with β⁴ = 3 (1 − ν²)/(r t)², up to w = ν/(2 β² r).  Its fibres are longer by the lift
    over r, which pulls them by F = E t w/(cosh(π/2) β r), less where the strip yields as it bends.
    """
    m, thickness = scene.material, scene.strip.thickness
    beta = (3.0 * (1.0 - m.poisson**2)) ** 0.25 / np.sqrt(radius * thickness)
    bent = min(1.0 / radius, PLASTIC_SHAPE * (first_yield(scene) or np.inf))
    lift = m.poisson * bent / (2.0 * beta**2)
    force = m.young * thickness * lift / (np.cosh(np.pi / 2.0) * beta * radius)
    return EdgeCurl(0.5 * np.pi / beta, lift, float(force))


def bent_curvature(scene: SceneSpec, radius: float, turn: float) -> float:
    """Curvature (1/m) of strip on a roller: 1/r, or θ/2λ where it only touches along a line."""
    return min(1.0 / radius, turn / (2.0 * boundary_layer(scene) or 1e-300))


def first_yield(scene: SceneSpec) -> float | None:
    """κ_e (1/m), at which the faces of a strip that is held across begin to flow; None if none."""
    m, held = scene.material, flow_stress(scene)
    if held is None:
        return None
    return 2.0 * held * (1.0 - m.poisson**2) / (m.young * scene.strip.thickness)


def flow_stress(scene: SceneSpec) -> float | None:
    """Return the stress (Pa) at which strip that is held across begins to flow; None if none."""
    m = scene.material
    if m.plasticity is None or m.yield_stress is None:
        return None
    return float(2.0 / np.sqrt(3.0) * m.yield_stress)


def flow_rate(scene: SceneSpec, turns: Mapping[str, float]) -> float:
    """Return about the rate (1/s) at which the strip of a scene flows.

    Running at c onto rollers, over ℓ to the curvature κ, its faces flow at c t κ/2ℓ.  ℓ is √(D/T),
    or a third of the shortest span if that is less, and κ the geometric mean of θ/2ℓ, that of strip
    that stays elastic, and of 1/r, or 1/r if that is less.
    Between driven rollers a draw flows at the difference of their speeds over their distance, if no
    bend between them takes it, and flat strip at the speed of an end that is moved over its length.
    The rate is the mean of these, by what each leaves of plastic strain.  Without any it is some
    strains of first yield, over the time in which the shortest span passes, or over stages that
    load the strip more; of flat strip with an end that travels the speed of this over its length.

    Parameters
    ----------
    scene : SceneSpec
        Of strip that can yield.
    turns : mapping
        Wraps of threaded rollers (rad).
    """
    curvature, layer, speed = first_yield(scene), boundary_layer(scene), fastest(scene)
    assert curvature is not None
    threaded = scene.threading is not None
    over = min(layer, BENDING_SPAN * shortest_span(scene)) if threaded else layer
    faces = 0.5 * scene.strip.thickness
    first, found = faces * curvature, dict[str, tuple[float, float]]()
    for roller in scene.rollers if speed and np.isfinite(over) else ():
        elastic = turns.get(roller.name, 0.0) / (2.0 * over)
        bent = faces * float(np.sqrt(min(elastic, 1.0 / roller.radius) / roller.radius))
        if bent > first:
            found[roller.name] = speed * bent / over, bent - first
    draws = [
        (drawn / length, drawn / speed - first)
        for drawn, length, between in draws_between_rollers(scene)
        if drawn > first * speed and found.keys().isdisjoint(between)
    ]
    stretches = [(rate, strain - first) for rate, strain in stretches_by_ends(scene)]
    draws += [(rate, plastic) for rate, plastic in stretches if plastic > 0.0]
    if flows := [*found.values(), *draws]:
        rates, strains = np.transpose(flows)
        return float(np.exp(np.average(np.log(rates), weights=strains)))
    if not threaded and speed:
        return speed / (scene.strip.length or 1.0)
    strain = YIELDED_STRAIN * first
    if speed:
        return strain * speed / shortest_span(scene)
    times = loading_times(scene) or [stage.duration for stage in scene.stages]
    return strain / float(np.exp(np.mean(np.log(times))))


def stretches_by_ends(scene: SceneSpec) -> Iterator[tuple[float, float]]:
    """Yield rates (1/s) and strains by which moves of its ends stretch flat strip in a stage."""
    length, moved = scene.strip.length, dict.fromkeys(ENDS, 0.0)
    if length is None or scene.threading is not None:
        return
    for stage in scene.stages:
        before = moved["exit"] - moved["entry"]
        moved |= {n: edge.move[0] for n, edge in stage.edges.items() if n in ENDS and edge.move}
        strain = abs(moved["exit"] - moved["entry"] - before) / length
        yield strain / stage.duration, strain


def loading_times(scene: SceneSpec) -> list[float]:
    """Return the durations (s) of stages that move, pull, bend or heat strip more than before."""
    before, times = dict[str, float](), list[float]()
    for stage in scene.stages:
        given = {
            f"{name}.{key}": float(np.linalg.norm(value))
            for name, control in (*stage.rollers.items(), *stage.edges.items())
            for key in ("move", "force", "moment", "tension")
            if (value := getattr(control, key, None)) is not None
        }
        for key, shape in stage.strip.natural.items():
            values = shape.samples if isinstance(shape, FieldSpec) else shape
            given[key] = float(np.abs(values).max())
        if any(size > before.get(name, 0.0) for name, size in given.items()):
            times.append(stage.duration)
        before |= given
    return times


def draws_between_rollers(scene: SceneSpec) -> Iterator[tuple[float, float, list[str]]]:
    """Yield differences of speed (m/s) of driven rollers, one after the other on threaded strip.

    With their distances (m) and the names of the rollers between them.
    """
    threaded = [roller for roller in scene.rollers if roller.wrap is not None]
    for stage in scene.stages:
        speeds = dict(stage_speeds(scene, stage))
        driven = [k for k, each in enumerate(threaded) if f"rollers.{each.name}" in speeds]
        for one, other in pairwise(driven):
            first, *between, last = threaded[one : other + 1]
            drawn = speeds[f"rollers.{last.name}"] - speeds[f"rollers.{first.name}"]
            names = [roller.name for roller in between]
            yield abs(drawn), math.dist(first.centre, last.centre), names


def fastest(scene: SceneSpec) -> float:
    """Return the largest speed (m/s) that a scene gives rollers, ends and strip, 0 if none."""
    speeds = [abs(v) for stage in scene.stages for _, v in stage_speeds(scene, stage)]
    return max([*speeds, *(abs(stage.strip.speed or 0.0) for stage in scene.stages)], default=0.0)


def passing_speed(scene: SceneSpec, stage: StageSpec) -> float:
    """Return about the speed (m/s) of the strip at the end of a stage, also of one of a map.

    That of the strip if it is given there, else the median of those of the driven rollers.
    """
    if stage.strip.speed is not None:
        return abs(stage.strip.speed)
    speeds = dict[str, float]()
    for each in scene.up_to(stage):
        speeds |= dict(stage_speeds(scene, each))
    return float(np.median(np.abs([*speeds.values()]))) if speeds else 0.0


def line_speed(scene: SceneSpec) -> float:
    """Return the largest speed (m/s) of rollers' surfaces and of edges.

    Where all stand, it is the longest way that a roller or an edge is moved by, else the part of
    the smallest radius by which strip gives way to its tension; over the time with friction.
    """
    if speed := fastest(scene):
        return speed
    moves = [0.0, *(way for stage in scene.stages for way in move_lengths(stage))]
    time = sum(stage.duration for stage in scene.stages if stage.friction)
    way = max(moves) or STANDING_GIVE * min((r.radius for r in scene.rollers), default=1.0)
    return way / (time or sum(stage.duration for stage in scene.stages))


def stage_speeds(scene: SceneSpec, stage: StageSpec) -> Iterator[tuple[str, float]]:
    """Yield ``rollers.NAME`` and edges whose speed a stage gives, and that speed (m/s)."""
    radii = {roller.name: roller.radius for roller in scene.rollers}
    for name, roller in stage.rollers.items():
        if roller.surface_speed is not None or roller.angular_speed is not None:
            turning = radii[name] * (roller.angular_speed or 0.0)
            yield f"rollers.{name}", roller.surface_speed or turning
    for name, edge in stage.edges.items():
        if edge.signed_speed is not None:
            yield name, edge.signed_speed


def move_lengths(stage: StageSpec) -> list[float]:
    """Return how far (m) rollers and edges are moved in a stage."""
    given = [*stage.moves.values(), *(edge.move or 0.0 for edge in stage.edges.values())]
    return [float(np.linalg.norm(move)) for move in given]


def distributed_load(scene: SceneSpec) -> float:
    """Return the largest weight of the strip, or pressure on it, in any stage (Pa)."""
    weight = (scene.material.density or 0.0) * scene.strip.thickness
    gravity = [float(np.linalg.norm(stage.gravity or (0.0,))) for stage in scene.stages]
    return max([abs(stage.pressure or 0.0) for stage in scene.stages] + [weight * max(gravity)])
