"""Warnings before a scene runs, and the level of kinematics that its numbers justify.

Every rule is a function that looks at a :class:`~anmstrip.advice.preview.Preview` and yields
sentences; those of statics stand in :mod:`anmstrip.advice.physics`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from anmstrip.advice import physics, units
from anmstrip.advice.preview import NEGLIGIBLE_BEARING, Preview, free_motions, unheld_words
from anmstrip.equilibrium import StageProblem
from anmstrip.fem.geometry import KINEMATICS, SECTION, Kinematics
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.string_path import least_pull
from anmstrip.results.plastic import MeanFlow
from anmstrip.results.rollers import RUNNING_SLIP, ContactState
from anmstrip.results.state import State
from anmstrip.results.wrinkles import COLUMN_FACTORS
from anmstrip.scene.checks import held_along
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.scene.tables import ENDS, SIDES, THREADING, FieldSpec
from anmstrip.simulation.defaults import (
    bending_stiffness,
    boundary_layer,
    edge_curl,
    elastic_creep,
    fastest,
    first_yield,
    held_ends,
    is_fed_by_default,
    largest_force,
    pulled_nowhere,
    stage_speeds,
)
from anmstrip.simulation.meshing import (
    BYTES_PER_UNKNOWN,
    CURL_ARC,
    CURL_WIDTH,
    LAYER_SHARE,
    MAX_ELEMENTS,
    contact_stands,
    hanging_runs,
    memory_of_machine,
    mesh_density,
    most_unknowns,
    pulls_of_runs,
    surface_speed,
)
from anmstrip.simulation.problem import MAX_HALVED_UNKNOWNS, Assembly, Size, naturals, size_of
from anmstrip.timestepping.formulas import AffineVelocity

PLATE_SLOPE = np.radians(5.0)
"""Slope up to which a plate is offered: it errs by slope²/2, which is 0.4 % there."""

MAX_ELEMENT_TURN = 0.5
"""Turn (rad) within one element over a roller that it cannot follow."""

MAX_PENETRATION = 0.1
"""Share of a roller's radius that a strip may sink into it, pressed by its tension."""

SLACK_END = 1e-2
"""Share of the largest force below which an end that was pulled is slack."""

STRAIGHT_SLOPE = 1e-6
"""Difference of slopes (rad) up to which nothing bends a span."""

STIFF_SLOPE = 0.3
"""Slope q L³/6D up to which its stiffness carries strip: a beam sags by 2 % of its span then."""

RESTING_SLOPE = 3.0
"""Slope q L³/6D up to which a beam on rollers L apart lies there by its weight, without tension.

On four rollers 0.8 m apart steel of 0.5 mm (2.7) comes to rest, and of 0.3 mm (7.4) it does not."""

STRICT_TOLERANCE = 1e-4
"""Tolerance below which round-off is looked at before a run."""

SAFE_TOLERANCE_RATIO = 20.0
"""Tolerance that is proposed, over what round-off makes of the imbalance."""

LOOSEST_TOLERANCE = 1e-2
"""The same at most: what needs a looser one has another cause."""

COARSE_RATIO = 1.2
"""Length of the shortest elements, over the one that is wanted, from which on a mesh is coarse."""

EXPLAIN_COST = 452e3, 281.0, 1.8
"""Unknowns of a shell, seconds that ``anmstrip explain`` takes for it, and the power of unknowns by
which they grow: 94 000 take 17 s."""

BALANCED_TORQUE = 1e-3
"""Share of the torque of friction within which a drive is balanced: the default tolerance."""

UNBALANCED_SHARE = 3.0
"""Share of the force on an idler times its radius, over the tolerance, beyond which it is out of
balance."""

SMALL_STRETCH = 0.02
"""Share of what carries a plate by which its sag may stretch it between held ends, unseen."""

MANY_TANGENTS = 300.0
"""Tangents of contact points that come to lie on rollers one after the other, from which on they
are told."""

TANGENTS_PER_PASSAGE = 5.0, 1.5
"""Tangents for each contact point that passes a roller in time, and on a rate-free path; those of
several rollers add up as squares do, since one step serves all.  Of 28 sections on one to five
rollers, elastic or not, the estimate is 0.6 to 2 times what they take, but 4 at V_c = 3e-8 m/s."""

SOFTER = 10.0
"""Ratio of the softer laws that are proposed where wraps grow: a dancer of 0.1 m that moves by
0.6 m takes 647 tangents, not 2271; loads on rollers change by about the tolerance."""

LAYER_COST = 0.2
"""Time that a layer of strip that yields adds to a tangent, over that of elastic strip."""

FRICTION_DIFFERENCE = 0.1
"""Share by which a friction coefficient may act as another one than was typed, unsaid."""


def warnings(preview: Preview) -> list[str]:
    """Return all warnings, the serious ones first."""
    told, judged = list(units.other_units(preview)), units.as_meant(preview)
    if judged is not None:
        others = (words for rule in OTHER_RULES for words in rule(judged))
        if_so = "" if judged is preview else "if so, "
        told += [if_so + words for words in (*serious_as_meant(judged), *others)]
        told += units.all_in_other_units(judged)
    return list(dict.fromkeys(told))


def serious(preview: Preview) -> list[str]:
    """Return the warnings for which a run may stop."""
    judged = units.as_meant(preview)
    others = [] if judged is None else serious_as_meant(judged)
    return [*units.other_units(preview), *others]


def serious_as_meant(preview: Preview) -> list[str]:
    """Return the same of a scene in which no value is likely to be in another unit."""
    if preview.tension == 0.0:  # the others compare with it
        rules = (
            *(unheld_strip, physics.roller_beyond_strip, physics.roller_over_an_end),
            *(physics.meeting_rollers, physics.rollers_without_friction, physics.tips_over),
        )
        return [told for rule in rules for told in rule(preview)]
    return [told for rule in SERIOUS_RULES for told in rule(preview)]


# for which a run may stop -----------------------------------------------------------------------


def sharp_roller(preview: Preview) -> Iterator[str]:
    """Elements that cannot follow a roller."""
    for roller in preview.assembly.rollers if preview.assembly.scene.contact else ():
        turn, h = preview.turn(roller), element_over(preview.assembly, roller)
        if min(h / roller.radius, turn) > MAX_ELEMENT_TURN:
            yield (
                f"roller {roller.name} turns the strip by {np.degrees(turn):.0f}°, and elements of "
                f"{h:.2g} m cannot follow its radius of {roller.radius:.2g} m. "
                f"Try {finer_mesh(preview.assembly.scene, LAYER_SHARE * roller.radius, 1)}"
            )


def soft_contact(preview: Preview) -> Iterator[str]:
    """Contact that lets the strip sink into a roller, or sets in far away from it.

    The setting that is told makes the strip sink in by a hundredth of the radius; the gap of a
    graded law goes with its onset.
    """
    contact = preview.assembly.scene.contact
    if contact is None:
        return
    for roller in preview.assembly.rollers:
        law, pressure = preview.assembly.signorini, preview.tension / roller.radius
        depth = -float(law.gap(np.float64(pressure))) if pressure else 0.0
        least = MAX_PENETRATION**2 * roller.radius
        if depth > MAX_PENETRATION * roller.radius and preview.turn(roller) > MAX_PENETRATION:
            key = f"contact.onset={law.width * least / depth:.1g}"
            if contact.constants is not None:
                key = f"contact.stiffness={pressure / least:.1g}"
            yield (
                f"pressed by T/r = {pressure:.2g} Pa the strip sinks {depth:.2g} m "
                f"into roller {roller.name}, of radius {roller.radius:.2g} m. Try --set {key}"
            )
        elif contact.constants is None and law.width > MAX_PENETRATION * roller.radius:
            cure = finer_mesh(preview.assembly.scene, LAYER_SHARE * roller.radius, 1)
            if contact.onset is not None:
                cure = f"--set contact.onset={least:.1g}"
            yield (
                f"contact sets in {law.width:.2g} m away from roller {roller.name}, of radius "
                f"{roller.radius:.2g} m. Try {cure}"
            )


def onset_near_round_off(preview: Preview) -> Iterator[str]:
    """An onset of contact within which the last digit of a position is a share of the pressure.

    Pressures change by the factor e within an onset, so that a digit changes them by its share of
    that.  With shares of 2 and 6 times the tolerance two lines took four and five times as many
    tangents, and with ten times as much they stalled.
    """
    assembly, contact = preview.assembly, preview.assembly.scene.contact
    if contact is None or contact.onset is None:
        return
    digit = float(np.finfo(float).eps) * assembly.strip.length
    if digit > assembly.scene.solver.tolerance * contact.onset:
        yield (
            f"contact.onset = {contact.onset:g} m is near round-off: the last digit of a position, "
            f"{digit:.1g} m, changes pressures by {digit / contact.onset:.1g} of themselves. "
            "Try it without contact.onset, or the usual one, "
            f"--set contact.onset={usual_onset(assembly.scene):.1g}"
        )


def usual_onset(scene: SceneSpec) -> float:
    """Return the onset of contact (m) that a scene has if none is typed."""
    return Assembly(scene.with_values(contact={"onset": None})).signorini.width


def slack_start(preview: Preview) -> Iterator[str]:
    """A first stage that pulls the slack strip while it may rub, in time from no stiffness on."""
    first = preview.plans[0]
    ends = [first.controls.at(share).get("exit.force", np.zeros(3)) for share in (0.0, 1.0)]
    slack = preview.assembly.thread is None and not np.any(ends[0])
    rubs = preview.assembly.rubs(preview.stages[0])
    if slack and rubs and first.in_time and np.any(ends[1]):
        yield (
            f"stage {first.name} pulls a slack strip, which has no stiffness across, while it may "
            f"rub. To pull it before, try --set stages.{first.name}.friction=false"
        )


def unheld_strip(preview: Preview) -> Iterator[str]:
    """A flat strip that no edge holds along itself, in a first stage in time.

    Friction does not hold it there before it touches a roller.
    """
    scene, first = preview.assembly.scene, preview.plans[0]
    along = 0 in preview.assembly.kinematics.components
    held = preview.assembly.thread is not None or scene.held_in("x")
    if first.in_time and along and not held and not rubs_at_once(first):
        yield f"in stage {first.name} {unheld_words(scene, first.name, 'x')}"


def rubs_at_once(plan: StageProblem) -> bool:
    """Whether strip touches a roller on which it rubs before anything of a stage acts."""
    from anmstrip.mechanics.contact import Friction

    controls, free = plan.controls.at(0.0), np.zeros(len(plan.supports.free))
    full = plan.supports.full(free, 0.0)
    rubbed = [effect.contact for effect in plan.model.effects if isinstance(effect, Friction)]
    return any(bool(np.any(c.gap((full, full), controls) < c.reaches)) for c in rubbed)


def released_strip(preview: Preview) -> Iterator[str]:
    """Stages from which on no edge holds the strip in x, nor friction."""
    scene, names = preview.assembly.scene, {plan.name for plan in preview.plans}
    holding, let_go = set(scene.held_in("x")), ""
    for stage in (stage for stage in scene.stages if stage.name in names and (holding or let_go)):
        released = [name for name, edge in stage.edges.items() if edge.release]
        holding -= set(released)
        if released:
            let_go = f"stages.{stage.name}.{released[0]}.release"
        if stage.steady:  # its entry is held where it is
            holding.add("entry")
        if holding:
            continue
        if not preview.assembly.frictional(stage):
            yield (f"nothing holds the strip in x in stage {stage.name}. Try --set {let_go}=false")
            return
        if released and (loose := why_speed_is_free(preview)):
            yield f"nothing says how fast the strip runs in stage {stage.name}: {loose}"


def why_speed_is_free(preview: Preview) -> str:
    """Why no roller says how fast a strip runs that no edge holds; nothing if one does."""
    rollers = preview.assembly.scene.rollers
    if any(roller.drive == "speed" or roller.bearing for roller in rollers):
        return ""
    first, width = rollers[0], preview.assembly.strip.width
    bearing = NEGLIGIBLE_BEARING * preview.tension * width * first.radius
    return (
        "no edge holds it in x, and no roller is driven by speed or braked by bearings. "
        f"Try --set rollers.{first.name}.bearing={bearing:.1g}"
    )


def lifted_off(state: State, scene: SceneSpec) -> Iterator[str]:
    """Rollers that the strip is threaded around, and bent does not touch where it came to be."""
    moved = {name for stage in scene.stages for name in stage.moves}
    laid = state.plan.name != THREADING or state.control == 1.0
    for roller in scene.rollers if laid else ():
        contact = state.contacts.get(roller.name)
        if contact is None or roller.wrap is None or roller.name in moved:
            continue
        if not contact.touching.any():
            gap = float(contact.gap.min(initial=np.inf))
            led = [end for stage in scene.stages for end in stage.edges.values()]
            led_away = any(end.force or end.move or end.velocity for end in led)
            here = f"the strip passes at {gap:.2g} m"
            bent = f"bent over the others {here}, where a taut string would touch"
            yield (
                f"roller {roller.name} is touched by nothing: {here if led_away else bent}. "
                f"Try another rollers.{roller.name}.centre, if it should"
            )


def undriven(state: State, scene: SceneSpec) -> Iterator[str]:
    """Steady strip that comes to some speed: no roller that is driven by speed touches it."""
    if not state.plan.steady or state.plan.model.coupled - 1 not in state.plan.supports.free:
        return
    driven = [spec.name for spec in scene.rollers if spec.drive == "speed"]
    if driven and state.touched.keys().isdisjoint(driven):
        came = "stands still" if stands(state) else f"came to {state.strip_speed:.3g} m/s"
        yield (
            f"nothing says how fast the strip runs, since no driven roller touches it: it {came}. "
            f"Try another rollers.{driven[0]}.centre"
        )


def stands(state: State) -> bool:
    """Whether strip runs no faster than friction creeps at rest."""
    creep = 0.0 if state.friction is None else state.friction.law_of_slip.speed
    return abs(state.strip_speed or 0.0) <= creep


def standing_idlers(state: State, scene: SceneSpec) -> Iterator[str]:
    """Idle rollers that strip slides over and does not turn."""
    for spec in scene.rollers:
        contact = state.contacts.get(spec.name)
        if spec.drive != "idle" or contact is None or not slides(contact):
            continue
        given = abs(contact.torque)
        standing = abs(contact.surface_speed) < RUNNING_SLIP * contact.max_slip
        if standing and given < (1.0 + BALANCED_TORQUE) * spec.bearing:
            yield (
                f"idle roller {spec.name} stands still, and the strip slides over it at "
                f"{contact.max_slip:.3g} m/s: friction turns it with {given:.3g} N m, and its "
                f"bearings hold {spec.bearing:g} N m. "
                f"Try --set rollers.{spec.name}.bearing={0.5 * given:.2g}, or more wrap or friction"
            )


def unbalanced_idlers(state: State, scene: SceneSpec) -> Iterator[str]:
    """Idle rollers that friction turns with more than bearings hold, before a stage has ended."""
    unbalanced = list[str]()
    for spec in scene.rollers if state.plan.steady and not stands(state) else ():
        contact = state.contacts.get(spec.name)
        if spec.drive != "idle" or contact is None:
            continue
        taken, share = abs(contact.torque), UNBALANCED_SHARE * scene.solver.tolerance
        if taken > spec.bearing + share * contact.normal_force * spec.radius:
            unbalanced.append(f"{spec.name} with {taken:.3g} N m against {spec.bearing:g} N m")
    if unbalanced:
        yield (
            "idle rollers are not in balance yet: friction turns, against what bearings hold, "
            f"{', '.join(unbalanced)}. Only the end of this stage is a stationary state; until "
            "there tensions beside them are others"
        )


def spinning_rollers(state: State, scene: SceneSpec) -> Iterator[str]:
    """Rollers that a torque turns through under the strip, since friction takes less of it."""
    for spec in scene.rollers:
        contact, key = state.contacts.get(spec.name), f"rollers.{spec.name}.torque"
        given = float(state.controls.get(key, 0.0))
        taken = 0.0 if contact is None else abs(contact.torque)
        left = abs(given) - spec.bearing - taken
        if contact is None or not slides(contact) or left <= BALANCED_TORQUE * taken:
            continue
        until = 1 + [each.name for each in scene.course].index(state.plan.name)
        stage = [each.name for each in scene.course[:until] if spec.name in each.rollers][-1]
        yield (
            f"roller {spec.name} turns through under the strip: of its torque of {given:.4g} N m "
            f"friction takes {taken:.4g} N m. "
            f"Try --set stages.{stage}.{key}={np.copysign(0.5 * taken, given):.2g}"
        )


def overstretched(state: State, scene: SceneSpec) -> Iterator[str]:
    """Elastic strip that is pulled beyond its yield stress by more than the given tensions."""
    limit = physics.yield_stress(scene) * scene.strip.thickness
    if state.membrane is None or scene.material.plasticity or largest_force(scene) > limit:
        return
    most = float(state.along("tension").max(initial=0.0))
    if most > limit:
        edge = scene.edges.get("exit")
        free = [each for each in edge.fixed if each != "x"] if edge is not None else []
        cure = f"--set 'edges.exit.fixed={json.dumps(free)}'"
        held = edge is not None and "x" in edge.fixed and largest_force(scene) > 0.0
        yield (
            f"the strip is pulled by up to {most:.3g} N/m, and yields at {limit:.3g} N/m"
            f"{physics.assumed_yield(scene)}: what is held or moved stretches it. "
            f"Try {cure if held else 'smaller moves'}"
        )


def held_across(state: State, scene: SceneSpec) -> Iterator[str]:
    """A section that flows all through its thickness in tension, where strip contracts across."""
    plasticity, strip = scene.material.plasticity, scene.strip
    if plasticity is None or plasticity.uniaxial or strip.kinematics != "section":
        return
    most = float(state.along("tension").max(initial=0.0))
    if most > (limit := float(scene.material.yield_stress or np.inf) * strip.thickness):
        yield (
            f"the strip is pulled by {most:.3g} N/m, and yields all through at {limit:.3g} N/m if "
            "it may contract across. A section may not, and bears 2/√3 times as much. "
            "Try --set 'strip.kinematics=\"shell\"'"
        )


CURLED_TENSION = 0.01
"""Share of a tension that edges which curl may change, untold."""


def curled_edges(state: State, scene: SceneSpec) -> Iterator[str]:
    """Driven rollers of a section whose friction does not suffice for edges that curl as well.

    Strip that slides all over a roller, faster than it creeps as they curl, has all of it anyway.
    """
    led = [spec for spec in scene.rollers if spec.drive == "speed" and spec.name in state.touched]
    if scene.strip.kinematics != "section" or not scene.strip.bending or len(led) < 2:
        return
    strip = state.plan.model.strip
    for spec in led:
        contact, reading = state.touched[spec.name], state.rollers[spec.name]
        curl = edge_curl(scene, spec.radius)
        change = 2.0 * curl.force / strip.width
        friction = (contact.coefficient or 0.0) * contact.normal_force
        left = (1.0 - (reading.capacity_used or 0.0)) * friction
        creep = abs(contact.surface_speed) * change / strip.tensile_stiffness
        slip = np.linalg.norm(contact.slip[:, contact.touching], axis=0)
        narrow = CURL_WIDTH * curl.width > strip.width
        short = CURL_ARC * curl.width > reading.wrap * spec.radius
        if narrow or short or not friction or slip.min() > creep or left > 2.0 * curl.force:
            continue
        if change > CURLED_TENSION * max(reading.tension_in or 0.0, reading.tension_out or 0.0):
            yield (
                f"free edges curl up off {spec.name}, which takes {2.0 * curl.force:.0f} N of "
                f"friction, and the tension leaves {left:.0f} N of {friction:.0f} N: tensions are "
                f"up to {change:.2g} N/m off. Try --set 'strip.kinematics=\"shell\"'"
            )


FLOW_ERROR = 0.03
"""Share of the yield stress by which strip may flow at another, of a scene without its rate."""


def guessed_rate(scene: SceneSpec, guess: float, flow: MeanFlow) -> Iterator[str]:
    """Yield a rate to type where strip flows at another than was guessed for it (1/s)."""
    spec, level = scene.material.plasticity, flow.level
    if spec is None or spec.reference_rate is not None or level is None:
        return
    if abs(level - 1.0) > FLOW_ERROR:
        guess *= (fastest(scene) or 1.0) if flow.steady else 1.0
        rate = guess * level**spec.exponent
        yield (
            f"the strip flows at {level:.3g} times its yield stress: at about {rate:.2g} 1/s, "
            f"where {guess:.2g} 1/s were guessed. "
            f"Try --set material.plasticity.reference_rate={rate:.2g}"
        )


ELEMENTS_PER_WAVE = 2.0
"""Least number of elements across a wave: in a sheet that is stretched by a tenth between clamps
with 2.2 wrinkles begin 1 % early, with 1.4 a quarter late, and with 0.7 not at all."""


def unresolved_waves(state: State, scene: SceneSpec) -> Iterator[str]:
    """Free spans of a shell that are near to wrinkling on elements too long for their waves."""
    strip = state.plan.model.strip
    if strip.count != 3 or state.membrane is None or not scene.strip.bending:
        return
    from anmstrip.results.wrinkles import free_spans

    size, width = float(strip.cell_sizes[1].max()), strip.width
    spans = [s for s in free_spans(state) if s.near and size * ELEMENTS_PER_WAVE > s.spacing]
    if not spans:
        return
    span = min(spans, key=lambda each: each.spacing)
    longest = span.spacing / ELEMENTS_PER_WAVE
    more = np.ceil(width / longest) / np.round(width / size)
    finer = physics.two_digits(float(mesh_density(scene) * more), np.ceil)
    cure = f"Try --set strip.finer={finer:g}"
    unknowns = int(strip.unknowns * (finer / mesh_density(scene)) ** 2)
    if unknowns > MAX_HALVED_UNKNOWNS:
        cure = priced(f"--set strip.finer={finer:g}", unknowns)
    if scene.strip.mesh is not None:
        cure = f"Try elements of {longest:.2g} m in strip.mesh."
    others = f", the shortest of {len(spans)} spans," if len(spans) > 1 else ""
    yield (
        f"waves between {span.before} and {span.after}{others} would be {span.spacing:.2g} m long "
        f"across, and elements are {size:.2g} m wide: they hardly bend that way, and wrinkles "
        f"come late or not at all. {cure}"
    )


BUCKLING_DIGITS = 1e-3
"""Share of Euler's load to which forces are solved where a bowed strip buckles smoothly: steps do
not leave the branch of a bow of a tenth of the thickness for spans up to 3 000 thicknesses long."""

MIN_TOLERANCE = 1e-9
"""Tolerance that is proposed at least: below it digits of positions are lost."""


SECOND_BETWEEN_JAWS = 8.183
"""Load of the second mode of a column between jaws, over π² D/L²: 4 (x/π)² with tan x = x."""


def stays_elastic(state: State, scene: SceneSpec) -> Iterator[str]:
    """Yield strip without plasticity whose faces bear more than their yield stress.

    By von Mises's stress of N/t + 6 |M|/t² along the strip, and ν of its bending part across.
    """
    limit, t, material = physics.yield_stress(scene), scene.strip.thickness, scene.material
    if state.plasticity is not None or not state.bends or limit == np.inf:
        return
    profile = state.profile
    bent = 6.0 / t**2 * np.abs(profile["moment"])
    along, across = np.maximum(profile["tension_max"], 0.0) / t + bent, material.poisson * bent
    stress = np.sqrt(along**2 - along * across + across**2)
    most = int(stress.argmax())
    if stress[most] > limit:
        borne, yields = (units.told_stress(scene, each) for each in (stress[most], limit))
        instead = physics.yielding_instead(scene)
        yield (
            f"the strip bears {borne} at a face {profile['arc_length'][most]:.3g} m from its entry"
            f", above the yield stress {yields}{physics.assumed_yield(scene)}, but this strip "
            f"stays elastic.{f' Try {instead}' if instead else ''}"
        )


def buckled_section(state: State, scene: SceneSpec) -> Iterator[str]:
    """Free spans of a section that are pressed by more than they bear.

    Bowed ones by more than they bear if their ends are clamped, or in the second mode if they are:
    what bows them may carry them.
    Strip that turns freely about one end and is free at the other bears nothing; where one of two
    jaws gives way across a quarter of what it bears between both, with one jaw a sixteenth.
    Nothing bends a straight strip on its path beyond the load at which it buckles; what is proposed
    is a curvature 0.8 t/L², by which a span is a tenth of its thickness high: with one thickness it
    bears a third less where it has not buckled far, and with some hundredths, or where imbalances
    across are lost beside heat that is held back, it may come to a higher mode.
    """
    strip, given = state.plan.model.strip, scene.strip
    profile = state.tension_profile if strip.count == 2 else None
    if profile is None or not given.bending or given.foundation:
        return
    begin, end = strip.span
    arcs = sorted(contact.arc for contact in state.touched.values())
    places, forces = profile
    loose = [name for name in ENDS if name not in scene.held_in("z")]
    clamped = [name for name in ENDS if name in scene.clamped]
    alone = bool(loose) and not arcs and scene.threading is None
    for (_, start), (stop, _) in pairwise([(begin, begin), *arcs, (end, end)]):
        within = (start <= places) & (places <= stop)
        pressed = -float(forces[within].mean()) if within.any() else 0.0
        thrust = pressed * (stop - start) ** 2 / strip.bending_stiffness
        if alone and not clamped and thrust > SLACK_END:
            yield (
                f"the strip is pressed by {pressed:.3g} N/m, and nothing holds its "
                f"{' and '.join(loose)} across: it turns freely, and this state is not stable."
            )
            continue
        slopes = state.slope(np.linspace(start, stop, 9))
        ways = slopes / np.linalg.norm(slopes, axis=1, keepdims=True)
        if np.ptp(ways, axis=0).max() > STRAIGHT_SLOPE:
            factor = SECOND_BETWEEN_JAWS if len(clamped) == len(ENDS) else COLUMN_FACTORS[0]
        elif alone:  # half of a column between jaws, or a quarter
            factor = COLUMN_FACTORS[0] / (4.0 if len(clamped) == len(ENDS) else 16.0)
        else:
            free = {"entry": start == begin, "exit": stop == end}
            factor = COLUMN_FACTORS[sum(free[name] and name not in clamped for name in ENDS)]
        if thrust <= factor * np.pi**2:
            continue
        told = (
            f"the strip is pressed by {pressed:.3g} N/m over {stop - start:.3g} m, more than it "
            "bears unbuckled: this state is not stable"
        )
        if state.plasticity is None:  # else pulled strip may have lost what it was bent by
            told += bowed_instead(state, scene, stop - start)
        yield told


def bowed_instead(state: State, scene: SceneSpec, length: float) -> str:
    """Return what to type so that a straight span of a section buckles smoothly, or nothing.

    A coil set makes moments, but no bow, between two jaws: there it is the mode itself, which needs
    a first stage that presses the strip.
    """
    strip, given = state.plan.model.strip, scene.strip
    tolerance, settings = scene.solver.tolerance, list[str]()
    curved = 0.8 * given.thickness / length**2
    straight = given.imperfection is None and abs(given.coil_set or 0.0) < 0.5 * curved
    if straight and set(ENDS) <= set(scene.clamped):
        if state.plan.name != scene.stages[0].name:
            return ""
        bow = f"mode=1,amplitude={0.1 * given.thickness:.2g}"
        settings, tolerance = [f"'strip.imperfection={{{bow}}}'"], min(tolerance, 1e-6)
    elif straight:
        settings = [f"strip.coil_set={curved:.1g}"]
    euler = np.pi**2 * strip.bending_stiffness / length**2
    finer = BUCKLING_DIGITS * euler / state.plan.model.scales.tension
    if MIN_TOLERANCE < finer < tolerance:
        settings.append(f"solver.tolerance=1e{np.floor(np.log10(finer)):.0f}")
    if not settings:
        return ""
    words = "is not quite straight" if straight else "is solved finer"
    return f". Try a strip that {words}, --set {' --set '.join(settings)}"


def wrinkled_instead(scene: SceneSpec, bifurcated: Collection[str]) -> Iterator[str]:
    """Tell flat strip that is not stable what to type so that it wrinkles smoothly.

    Where its path bifurcates in the first stage, whose end gives the mode; threaded strip with an
    imperfection is of finite length.
    """
    bent = scene.strip.imperfection is not None or scene.threading is not None
    if scene.course[0].name in bifurcated and not bent:
        bow = f"mode=1,amplitude={0.1 * scene.strip.thickness:.2g}"
        yield (
            "the strip stays smooth beyond its bifurcation, and this state is not stable. For its "
            f"wrinkles, try strip that is not quite flat, --set 'strip.imperfection={{{bow}}}'"
        )


def slides(contact: ContactState) -> bool:
    """Whether strip touches a roller and slides over it wherever it does."""
    return bool(contact.touching.any()) and contact.grip > 0.0


def touched_drives(state: State, scene: SceneSpec) -> dict[str, ContactState]:
    """Return the rollers with a drive that the strip lies on."""
    driven = {roller.name for roller in scene.rollers if roller.driven}
    return {name: contact for name, contact in state.touched.items() if name in driven}


def slides_as_a_whole(state: State, scene: SceneSpec) -> bool:
    """Whether strip slides over all rollers driven by speed that it lies on, and lies on one.

    A roller with a torque does not hold the strip, however it sticks.
    """
    led = {roller.name for roller in scene.rollers if roller.drive == "speed"} & set(state.touched)
    return bool(led) and all(slides(state.touched[name]) for name in led)


def beside_rollers(state: State, scene: SceneSpec) -> Iterator[str]:
    """Rollers that the strip lies beside, by more than half its width.

    From the middle of a roller with a profile; from where the strip was laid on a cylinder, whose
    middle is any place of its axis.
    """
    strip, beside = state.plan.model.strip, dict[str, float]()
    laid = 0.5 * (strip.nodes[1].min() + strip.nodes[1].max())
    for name, reading in state.rollers.items():
        contact = state.contacts[name]
        if reading.offset is None or not contact.touching.any():
            continue
        centre = float(state.controls[f"rollers.{name}.centre"][1])
        middle = laid if contact.roller.is_cylinder else centre
        beside[name] = laid + float(reading.offset) - middle
    if far := {name: y for name, y in beside.items() if abs(y) > 0.5 * strip.width}:
        name = max(far, key=lambda each: abs(far[each]))
        free = not any(edge.centred or "y" in edge.fixed for edge in scene.edges.values())
        advice = "Look whether axes and profiles of the rollers are as they were meant."
        if free:
            advice = "Try --set edges.entry.centred=true, which holds the entry in y"
        yield (
            f"the strip has left {', '.join(far)} sideways: its middle is {far[name]:.3g} m beside "
            f"{name}, more than half its width. This state is of no use. {advice}"
        )


def keeps_its_load(preview: Preview) -> Iterator[str]:
    """Stages that let an end go which moves have loaded, and no roller and no force: none unloads.

    Beside rollers a line goes on under the load that an end has borne.
    """
    scene = preview.assembly.scene
    if scene.rollers or pulled_nowhere(scene) or largest_force(scene):
        return
    for stage in scene.stages:
        for name in ENDS:
            edge = stage.edge(name)
            if not edge.release or edge.force or edge.tension is not None:
                continue
            yield (
                f"stage {stage.name} lets the {name} go, and the force that has held it stays as "
                "its load: the strip does not spring back. For strip that does, try --set "
                f"'stages.{stage.name}.{name}.force=[0.0, 0.0, 0.0]'"
            )


def slack_end(preview: Preview) -> Iterator[str]:
    """Stages at whose end an end that was pulled no longer is, and bending does not hold it.

    It does where the strip lies on rollers by its weight, and hardly sags between them, and where
    there are none.
    """
    strip, largest = preview.assembly.strip, preview.tension
    stiff = preview.assembly.scene.strip.bending
    if stiff and not preview.assembly.rollers:  # nothing bends it
        return
    bearable = strip.bending_stiffness * (np.pi / strip.length) ** 2 if stiff else 0.0
    for stage, plan, string in preview:
        end = plan.controls.at(1.0)
        force = end.get("exit.force")
        if force is None or "exit.tension" in end or largest < 10.0 * bearable:
            continue
        if max(np.linalg.norm(end.get(f"entry.{key}", 0.0)) for key in ("force", "tension")) > 0.0:
            continue  # pulled from the other end, the strip may run away
        if carries_itself(preview, plan, string.span):
            continue
        before = plan.controls.at(0.0)["exit.force"]
        if np.linalg.norm(force) < SLACK_END * largest < (pulled := np.linalg.norm(before)):
            kept = units.typed_vector(0.1 * largest / pulled * before, ".2g")
            key = f"'stages.{plan.name}.exit.force={kept}'"
            if stage.edge("exit").tension is not None:
                key = f"stages.{plan.name}.exit.tension={0.1 * largest:.2g}"
            yield (
                f"stage {plan.name} leaves the strip without tension, which is what holds it in "
                f"shape. Try --set {key}"
            )


def carries_itself(preview: Preview, plan: StageProblem, span: float) -> bool:
    """Whether strip lies on rollers and hardly sags between them, or no edge of it is held."""
    scene, load = preview.assembly.scene, weight_of(preview, plan) * span**3
    edges = [*scene.edges.values(), *(end for s in scene.stages for end in s.edges.values())]
    bears = 6.0 * RESTING_SLOPE * bending_stiffness(scene)
    return load < bears and (load > 0.0 or not edges)


def pulled_twice(preview: Preview) -> Iterator[str]:
    """Ends on which the force of one stage and the tension of another act at once."""
    for stage, plan, _ in preview:
        end = plan.controls.at(1.0)
        for name, typed in stage.edges.items():
            force = float(np.linalg.norm(end.get(f"{name}.force", 0.0)))
            tension = float(end.get(f"{name}.tension", 0.0))
            if 0.0 in (force, tension) or (typed.force is None) == (typed.tension is None):
                continue
            other = "force=[0, 0, 0]" if typed.force is None else "tension=0"
            yield (
                f"in stage {stage.name} {name}.force, {force:.3g} N/m, and {name}.tension, "
                f"{tension:.3g} N/m, act both. So that the one takes the place of the other, try "
                f"--set 'stages.{stage.name}.{name}.{other}'"
            )


def heavy_strip(preview: Preview) -> Iterator[str]:
    """Stages in which a span weighs more than tension or bending carries without a deep sag."""
    largest, sagging = preview.tension, dict[str, float]()
    for _, plan, string in preview:
        load, span = weight_of(preview, plan), string.span
        weight, bent = load * span, bending_stiffness(preview.assembly.scene)
        if weight > largest and load * span**3 > 6.0 * STIFF_SLOPE * bent:
            sagging[plan.name] = weight
    if sagging:
        (first, weight), *others = sagging.items()
        also = f", as in {', '.join(name for name, _ in others)}" if others else ""
        pull = f"{weight / largest:.2g} times its tension" if largest else "nothing pulls it"
        yield (
            f"in stage {first} a span of the strip weighs {weight:.2g} N/m, {pull}, and it sags "
            f"deeply{also}. Try a larger tension, unless it is meant to hang."
        )


def heavy_pass(preview: Preview) -> Iterator[str]:
    """Stages in which strip from an end down to the next roller weighs more than pulls it."""
    given = preview.assembly.scene.threading
    for _, plan, string in preview:
        end, path = plan.controls.at(1.0), string.path
        if given is None or path is None or "gravity" not in end:
            continue
        upright = -end["gravity"][2] / (np.linalg.norm(end["gravity"]) or 1.0)
        ends = (given.entry, path.points[1, 1, 0]), (given.exit, path.points[1, -1, 0])
        for name, (place, low) in zip(ENDS, ends, strict=True):
            force = end.get(f"{name}.tension", end.get(f"{name}.force"))
            if place is None or force is None:
                continue
            pull = float(np.linalg.norm(force))
            rise = float(place[2] - preview.assembly.origin[2] - low)
            if (weight := float(weight_of(preview, plan) * upright * rise)) > pull > 0.0:
                yield (
                    f"in stage {plan.name} the strip between its {name} and the next roller, "
                    f"{rise:.3g} m below, weighs {weight:.3g} N/m, and {pull:.3g} N/m pull it: it "
                    "slides down. "
                    f"Try --set stages.{plan.name}.{name}.tension={2.0 * weight:.2g}"
                )


def bottomless_loop(preview: Preview) -> Iterator[str]:
    """Stages that pull a run of string by less than any catenary bears, so that it sinks on and on.

    Runs are looked at up to the first roller before the exit that friction may hold.
    """
    scene, thread = preview.assembly.scene, preview.assembly.thread
    if thread is None or scene.threading is None or scene.threading.closed:
        return
    bent, runs = bending_stiffness(scene), np.diff(thread.middle.points[..., 0])[:, ::2].T
    for stage, held in held_along(scene.threading, scene.edges, scene.stages):
        loads = preview.assembly.loads_of(stage)
        if loads is None or loads.weight <= 0.0 or "exit" in held:
            continue
        pulls, hanging = pulls_of_runs(thread, loads), hanging_runs(thread, loads)
        for k in reversed(range(1, len(thread.rollers))):
            behind, run = thread.rollers[k].name, runs[k]
            if stage.friction and scene.friction is not None and behind not in loads.gains:
                break
            least, across = least_pull(run, loads.weight), abs(float(run[0]))
            sags = loads.weight * across**3 > 6.0 * STIFF_SLOPE * bent
            if sags and 0.0 < pulls[k] <= least and not hanging[k].any():
                pull = physics.two_digits(loads.exit + 1.5 * least - pulls[k], np.ceil)
                yield (
                    f"in stage {stage.name} the strip between {thread.rollers[k - 1].name} and "
                    f"{behind} is pulled by {pulls[k]:.3g} N/m, and hangs by no less than "
                    f"{least:.3g}: it sinks on and on. "
                    f"Try --set stages.{stage.name}.exit.tension={pull:g}"
                )
                break


def weight_of(preview: Preview, plan: StageProblem) -> float:
    """Return the weight of the strip at the end of a stage, per area (Pa)."""
    strip, gravity = preview.assembly.strip, plan.controls.at(1.0).get("gravity", np.zeros(3))
    return float(np.linalg.norm(gravity)) * strip.mass


# others ------------------------------------------------------------------------------------------


def coarse_mesh(preview: Preview) -> Iterator[str]:
    """Elements over rollers that are longer than a quarter of the boundary layer."""
    scene, strip = preview.assembly.scene, preview.assembly.strip
    layer = boundary_layer(scene)
    coarse: dict[str, list[str]] = {}
    if scene.contact is None:
        return
    if scene.strip.cells is None and scene.strip.mesh is None:
        wanted = preview.assembly.layout.shortest_wanted
        finest = float(strip.cell_sizes[0].min())
        if finest * min(1.0, mesh_density(scene)) > COARSE_RATIO * wanted > 0.0:
            why = f"since a mesh by default has about {most_unknowns(len(scene.rollers))} unknowns"
            if scene.strip.finer is not None:
                why = f"with strip.finer = {scene.strip.finer:g}"
            shorter = shorter_elements(preview.assembly, COARSE_RATIO * wanted)
            yield (
                f"elements where the strip lifts off its rollers are {finest:.2g} m long instead "
                f"of {wanted:.2g} m, {why}. {shorter}"
            )
        return
    for roller in preview.assembly.rollers if scene.strip.bending else ():
        if (h := element_over(preview.assembly, roller)) > 1.01 * LAYER_SHARE * layer:
            coarse.setdefault(f"{h:.3g} m", []).append(roller.name)
    for size, names in coarse.items():
        estimated = "; the run estimates what that costs" * preview.assembly.can_halve
        yield (
            f"elements over {', '.join(names)} are {size} long, more than a quarter of the "
            f"boundary layer of {layer:.3g} m{estimated}. "
            f"Try {finer_mesh(scene, LAYER_SHARE * layer)}"
        )


def coarse_hinges(preview: Preview) -> Iterator[str]:
    """Elements over rollers that are longer than a quarter of the hinges in which strip yields.

    By default they are not where strip that runs in time brings all its labels onto the rollers.
    """
    scene, assembly = preview.assembly.scene, preview.assembly
    wanted = LAYER_SHARE * assembly.layout.hinge_length
    finest = float(assembly.strip.cell_sizes[0].min())
    steady = all(stage.steady or not stage.friction for stage in scene.stages)
    other = "" if steady or assembly.thread is None else " or steady stages alone"
    if finest > COARSE_RATIO * wanted:
        yield (
            f"strip yields on its rollers in hinges {wanted / LAYER_SHARE:.2g} m long, but the "
            f"shortest elements have {finest:.2g} m: what is left of bends may be wrong by tens of "
            f"per cent. Try {finer_mesh(scene, wanted)}{other}"
        )


def late_yield(preview: Preview) -> Iterator[str]:
    """A stage that runs threaded strip over rollers as the stresses of the flow law still grow.

    Those of the first stage in time grow from nothing, as strip is threaded as an elastic one.
    """
    scene, assembly = preview.assembly.scene, preview.assembly
    first = next(filter(assembly.yields, preview.stages), None)
    if assembly.thread is None or first is None or first.steady:
        return
    bent = max((physics.sharpest_curvature(preview, r) for r in assembly.rollers), default=0.0)
    ways = [float(np.linalg.norm(edge.move or 0.0)) for edge in first.edges.values()]
    ways += [0.5 * abs(speed) * first.duration for _, speed in stage_speeds(scene, first)]
    way = max(ways, default=0.0)
    if way > boundary_layer(scene) and bent > (first_yield(scene) or np.inf):
        yield (
            f"stage {first.name} runs strip over rollers by {way:.3g} m while the stresses by "
            "which it flows still grow from nothing, since it is threaded as an elastic one: it "
            "yields too little there. Put a stage before it in which nothing moves: [[stages]] "
            f"with duration = {0.1 * first.duration:g}"
        )


def shorter_elements(assembly: Assembly, longest: float) -> str:
    """Return what to type for shorter elements by default (m), or what they would cost."""
    scene = assembly.scene
    found = assembly.layout.refined(longest)
    key, count = f"--set strip.finer={found.finer:g}", f"{found.unknowns} unknowns"
    if found.elements > MAX_ELEMENTS:
        return f"Shorter ones would be {found.elements}, more than a mesh may have."
    if found.unknowns <= MAX_HALVED_UNKNOWNS:
        less = " or less travel" * any(not stage.steady for stage in scene.stages)
        return f"Shorter ones need {count}. Try {key}{less}"
    return priced(key, found.unknowns)


def priced(key: str, unknowns: int) -> str:
    """Say what a key for shorter elements costs before anything is solved, if they fit."""
    known, seconds, power = EXPLAIN_COST
    memory, seconds = BYTES_PER_UNKNOWN * unknowns / 1e9, seconds * (unknowns / known) ** power
    there = memory_of_machine() / 1e9
    if memory > there:
        return f"Shorter ones do not fit into the {there:.0f} GB of this machine."
    return (
        f"{key} makes them so short, but with {unknowns} unknowns, for which `anmstrip explain` "
        f"alone takes about {memory:.0f} GB and {time_words(seconds)}."
    )


def time_words(seconds: float) -> str:
    """Return a time in seconds, or in minutes where it is long.

    Examples
    --------
    >>> time_words(0.2), time_words(40.0), time_words(600.0)
    ('1 s', '40 s', '10 minutes')
    """
    return f"{max(seconds, 1.0):.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} minutes"


def strict_tolerance(preview: Preview) -> Iterator[str]:
    """A tolerance that the last digits of the positions of the strip as laid do not allow."""
    assembly, plan = preview.assembly, preview.plans[0]
    if assembly.scene.solver.tolerance >= STRICT_TOLERANCE:
        return
    laid = np.zeros(len(plan.supports.free))  # flat
    if assembly.thread is not None:
        laid = assembly.laid[plan.supports.free]
    rate, still = 1.0 / plan.duration, np.zeros_like(laid)
    velocity = AffineVelocity(rate, -rate * laid, still) if plan.in_time else None
    equations = plan.equations(velocity)
    if told := below_round_off(assembly.scene, equations.round_off(laid, 0.0)):
        yield told


def below_round_off(scene: SceneSpec, floor: float, share: float = 1.0) -> str:
    """Return what to type where the last digits are worth so much of the forces, or nothing.

    The imbalance that is allowed is the given share of the tolerance.
    """
    reachable = SAFE_TOLERANCE_RATIO * floor / share
    if not scene.solver.tolerance < 0.5 * reachable < 0.5 * LOOSEST_TOLERANCE:
        return ""
    return (
        f"solver.tolerance = {scene.solver.tolerance:g} is near round-off: the last digit of the "
        f"positions is worth {floor:.1g} of the forces. "
        f"Try --set solver.tolerance={reachable:.0e}"
    )


def finer_mesh(scene: SceneSpec, length: float, digits: int = 3) -> str:
    """Return what to type for elements of a length (m) over rollers, with so many digits."""
    if scene.strip.mesh is not None:
        return f"elements of {length:.{digits}g} m in strip.mesh."
    return f"--set strip.refined={length:.{digits}g}"


def slip_speed(preview: Preview) -> float:
    """Return the speed (m/s) at which the strip slips on rollers that are driven or stand.

    That is their own less that of an edge which is held in x throughout, or in steady stages, whose
    edges strip passes, less ``strip.speed``; else the elastic creep; infinite if nothing moves.
    """
    scene, rollers = preview.assembly.scene, preview.assembly.rollers
    held = [name for name in scene.held_in("x") if name not in scene.released]
    idle = {spec.name for spec in scene.rollers if spec.drive != "speed"}
    turning, moving, passing = dict[str, float](), dict[str, float](), list[float]()
    slip, moves = 0.0, False
    for stage in scene.stages:
        for roller in rollers:
            if (given := surface_speed(stage, roller)) is not None:
                turning[roller.name] = given
        moving |= {n: e.signed_speed for n, e in stage.edges.items() if e.signed_speed is not None}
        moves = moves or any(turning.values()) or any(moving.values())
        speeds = [turning.get(r.name, 0.0) for r in rollers if r.name not in idle]
        if stage.edge("entry").tension is not None:
            passing = []
        passing = passing if stage.strip.speed is None else [stage.strip.speed]
        strip = passing if stage.steady else [moving.get(name, 0.0) for name in held]
        slip = max([slip, *(abs(v - passes) for v in speeds for passes in strip)])
    return slip or (elastic_creep(scene) if moves and scene.friction is not None else np.inf)


def slipping_friction(preview: Preview) -> Iterator[str]:
    """A slip speed of friction far above that of the scene, or a typed f that acts as another."""
    law, spec = preview.assembly.friction, preview.assembly.scene.friction
    if law is None or spec is None or preview.tension == 0.0:
        return
    slip = slip_speed(preview)
    if law.speed > 10.0 * slip:
        yield (
            f"friction.speed V_c = {law.speed:g} m/s is far above the speed at which the strip "
            f"slips, about {slip:.2g} m/s (elastic creep, unless an edge is held): rollers will "
            f"slip visibly. Try --set friction.speed={slip:.1g}"
        )
    elif spec.law == "norton-hoff" and np.isfinite(slip):
        share = float(law.share(slip))
        if abs(share - 1.0) > FRICTION_DIFFERENCE:
            f = spec.coefficient
            yield (
                f"friction.coefficient = {f:g} acts as {share * f:.3g} at a slip of {slip:.2g} "
                "m/s, since Norton and Hoff's law grows with the slip. "
                f'Try law = "algebraic", or --set friction.speed={slip:.1g}'
            )


LARGE_SHELL, LARGE_YIELDING_SHELL = 5000, 1000
"""Unknowns of a shell from which on it is told that a section would do.  One of 4 260 that yields
over a roller takes 52 tangents of 2 s; its section takes 10 s in all."""


@dataclass(frozen=True)
class Passages:
    """Contact points that come to lie on rollers in a stage, and what they cost."""

    plan: StageProblem
    along: Mapping[str, float]  # strip (m) that passes each roller
    laid: float  # strip (m) by which wraps grow
    pitch: float  # of the contact points (m)
    ripple: float  # slip (m/s) of points when one of them passes
    tangents: float

    @property
    def words(self) -> str:
        """Return what happens, where, and how often."""
        most = max(self.along.values())
        names = ", ".join(name for name, way in self.along.items() if way > 0.1 * most)
        way, does = (most, "passes") if self.laid < most else (self.laid, "comes to lie on")
        happens = f"{way:.2g} m of strip {does} {names}, {way / self.pitch:.0f} contact points"
        return f"in stage {self.plan.name} {happens}"


def contact_passages(preview: Preview) -> Iterator[Passages]:
    """Yield what every stage lays on rollers, where elements are what contact resolves.

    Where a point of pitch p comes to lie on a roller, the strip that passes it at a speed v is a
    chord before and an arc thereafter: points slip to and fro by v (p/r)²/12, and turn round the
    corners of friction where that is more than V_c.
    """
    assembly, contact = preview.assembly, preview.assembly.scene.contact
    typed = contact is None or contact.onset or contact.constants or contact.law  # softer, or known
    pitch = float(assembly.strip.cell_sizes[0].min()) / (2 * assembly.strip.contact_parts)
    names, before = [roller.name for roller in assembly.rollers], None
    radii = np.array([roller.radius for roller in assembly.rollers], dtype=float)
    for (_, plan, after), way in zip(preview, label_travel(preview), strict=True):
        turns = np.array([after.turns.get(name, 0.0) for name in names])
        past = turns if typed or before is None else before
        before, laid = turns, np.maximum(radii * (turns - past), 0.0)
        along = way * (np.maximum(turns, past) > 0.0) + 0.5 * laid
        slip = along / plan.duration * (pitch / radii) ** 2 / 12.0
        speed = plan.friction.law_of_slip.speed if plan.in_time and plan.friction else np.inf
        count = np.sqrt(np.square(along / pitch) @ (1.0 + slip / speed))
        cost = TANGENTS_PER_PASSAGE[0 if plan.in_time else 1] * float(count)
        each = dict(zip(names, along.tolist(), strict=True))
        yield Passages(plan, each, float(laid.sum()), pitch, float(slip.max()), cost)


def label_travel(preview: Preview) -> Iterator[float]:
    """Yield how far (m) the points of the strip go in every stage: nowhere but in time.

    As an end that is held, else as the fastest roller of a given speed; strip that is fed, and that
    of a closed line, passes points that stay.  Speeds are linear in a stage, and may turn round.
    """
    assembly, scene = preview.assembly, preview.assembly.scene
    driven = [f"rollers.{r.name}.surface_speed" for r in scene.rollers if r.drive == "speed"]
    stages = held_along(scene.threading, scene.edges, tuple(preview.stages))
    for (stage, held), plan in zip(stages, preview.plans, strict=True):
        stay = plan.fed or assembly.closed or not (plan.in_time and (held or assembly.rubs(stage)))
        speeds = np.zeros((2, 1))
        if held and not stay:
            speeds = np.array([plan.moving(c)[plan.model.value_unknowns] for c in (0.0, 1.0)])
        elif driven and not stay:
            given = (plan.controls.at(c) for c in (0.0, 1.0))
            speeds = np.array([[float(values[key]) for key in driven] for values in given])
        total, least = np.abs(speeds).sum(axis=0), np.finfo(float).tiny
        turning = 0.5 * np.square(speeds).sum(axis=0) / np.maximum(total, least)
        mean = np.where(speeds[0] * speeds[1] < 0.0, turning, 0.5 * total)
        yield float(mean.max()) * plan.duration


def many_tangents(preview: Preview) -> Iterator[str]:
    """Yield what the stages take in which many contact points come to lie on rollers."""
    assembly, touches = preview.assembly, preview.assembly.scene.contact is not None
    found = [*contact_passages(preview)] if touches and assembly.rollers else []
    total = sum(passages.tangents for passages in found)
    if total < MANY_TANGENTS:
        return
    dearest = max(found, key=lambda passages: passages.tangents)
    friction = assembly.friction if dearest.plan.in_time else None
    each = size_of(assembly, assembly.kinematics).seconds(assembly.order)
    if (layers := assembly.plastic_strains(grow=True)) is not None:
        each *= 1.0 + LAYER_COST * len(layers.operator.layers.heights)
    cures, steady = list[str](), ""
    if dearest.laid >= max(dearest.along.values()):
        cures = [f"contact.onset={SOFTER * assembly.signorini.width:.2g}"]
        cures += [f"friction.speed={SOFTER * friction.speed:.2g}"] if friction else []
    elif not assembly.scene.strip.feed and is_fed_by_default(assembly.scene):
        cures = ["strip.feed=true"]
    else:
        steady = " A stationary state, steady = true, takes some tens."
        if friction and dearest.ripple > SOFTER * friction.speed:
            cures = [f"friction.speed={min(dearest.ripple, SOFTER * slip_speed(preview)):.1g}"]
    told = f" Try --set {' --set '.join(cures)}" if cures else ""
    yield (
        f"{dearest.words} one after the other: the run takes about {round(total, -2):.0f} "
        f"tangents, {time_words(total * each)}.{steady}{told}"
    )


def rates_of_labels(preview: Preview) -> Iterator[str]:
    """Effects of the user's own that use velocities, where material passes labels that stay."""
    assembly = preview.assembly
    steady = [stage.name for stage in assembly.scene.course if stage.steady]
    passing = [plan.name for plan in preview.plans if plan.in_time and assembly.scene.strip.feed]
    for effect in assembly.added_effects:
        if effect.rate_dependent and steady:
            yield (
                f"effect {effect.name} depends on velocities, and is left out of stage "
                f"{steady[0]}, which is steady. Try the stage in time"
            )
        if effect.rate_dependent and passing:
            yield (
                f"effect {effect.name} depends on velocities, which in stage {passing[0]} are "
                "those of labels that stay while fed strip passes them. Try --set strip.feed=false"
            )


def needless_shell(preview: Preview) -> Iterator[str]:
    """Large shells, by default, of scenes in which nothing varies across the strip.

    Heat or flatness that varies along it does: strip that is wider behind is pressed across.  So
    does a stretched sheet without rollers, whose held ends keep it from becoming narrower.
    """
    assembly, scene = preview.assembly, preview.assembly.scene
    count, typed = assembly.strip.unknowns, scene.strip.model_fields_set
    fields = [given for strip in scene.shapes for given in strip.natural.values()]
    along = any(isinstance(given, FieldSpec) and given.along for given in fields)
    clamped = not scene.rollers and scene.held_in("y")
    large = LARGE_SHELL if assembly.flow is None else LARGE_YIELDING_SHELL
    if count < large or "kinematics" in typed or along or clamped:
        return
    if not any(against_section(preview)):
        flows = "" if assembly.flow is None else " that yields, of which each state takes seconds"
        less = "" if assembly.flow is None else ", and tells no crossbow"
        yield (
            f"nothing varies across the strip, which is a shell of {count} unknowns{flows}: a "
            f"section has {size_of(assembly, SECTION).unknowns}{less}. "
            "Try --set 'strip.kinematics=\"section\"'"
        )


def unseen_facts(preview: Preview) -> Iterator[str]:
    """Yield what the chosen level of kinematics leaves out of a scene that it can solve."""
    found, own = levels(preview), preview.assembly.kinematics
    (against,) = (level.against for level in found if level.kinematics is own)
    if against:
        best = justified_level(found).kinematics.name
        yield (
            f"kinematics {own.name} does not see that {'; '.join(against)}. "
            f"Try --set 'strip.kinematics=\"{best}\"'"
        )


SERIOUS_RULES = (
    physics.roller_in_the_way, physics.roller_beyond_strip, physics.meeting_rollers,
    physics.turned_axis, physics.roller_over_an_end, physics.rollers_without_friction,
    sharp_roller, soft_contact, onset_near_round_off, slack_start, unheld_strip, released_strip,
    physics.beyond_capacity, physics.torque_beyond_friction, physics.strip_without_tension,
    physics.slack_by_heat, physics.strip_runs_out, slack_end, heavy_strip, heavy_pass,
    bottomless_loop, strict_tolerance,
)  # fmt: skip
OTHER_RULES = (
    free_motions, coarse_mesh, coarse_hinges, late_yield, slipping_friction, many_tangents,
    rates_of_labels, needless_shell, unseen_facts, pulled_twice, keeps_its_load,
    *physics.PHYSICS_RULES,
)  # fmt: skip
RULES_OF_STAGES = buckled_section, unresolved_waves, stays_elastic
"""Rules for the state at the end of each stage; the others are for the last state alone."""

RULES_AT_END = (
    lifted_off, undriven, standing_idlers, unbalanced_idlers, spinning_rollers, overstretched,
    held_across, curled_edges, *RULES_OF_STAGES,
)  # fmt: skip


def propose_one_mesh(told: Sequence[str]) -> list[str]:
    """Return sentences of which only the one with the shortest elements says what to type."""
    proposed = [re.search(r" Try --set strip\.finer=([\d.e+]+)$", words) for words in told]
    finest = max((float(found[1]) for found in proposed if found), default=0.0)
    left = []
    for words, found in zip(told, proposed, strict=True):
        shortest = found is not None and float(found[1]) == finest
        left.append(words if found is None or shortest else words[: found.start()])
        finest = np.inf if shortest else finest
    return left


def proposed_keys(words: str) -> list[str]:
    """Return the keys that a warning proposes to set.

    Examples
    --------
    >>> proposed_keys("Try --set rollers.r1.radius=0.2 --set 'edges.exit.fixed=[]'")
    ['rollers.r1.radius', 'edges.exit.fixed']
    """
    return re.findall(r"--set '?([\w.-]+)=", words)


def element_over(assembly: Assembly, roller: Roller) -> float:
    """Length of the longest element that comes to lie on a roller (m), 0 if none does.

    On a mesh that stands still, of those where the strip lifts on and off.
    """
    mesh, reach = assembly.strip.mesh, 0.5 * np.pi * roller.radius
    first, last = roller.centre[0] - reach, roller.centre[0] + reach
    if assembly.thread is not None:
        if roller.name not in assembly.thread.arcs:
            return 0.0
        first, last = assembly.thread.arcs[roller.name]
        if contact_stands(assembly.scene):
            nodes = np.unique(mesh.p[0])
            around = np.abs(nodes[1:-1, None] - [first, last]).argmin(axis=0) + 1
            return float(np.diff(nodes)[[around - 1, around]].max())
    x = mesh.p[0, mesh.t].mean(axis=0)
    return float(assembly.strip.cell_sizes[0, (first <= x) & (x <= last)].max(initial=0.0))


# levels of kinematics ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Level:
    """A level of kinematics, for one scene."""

    kinematics: Kinematics
    size: Size | None  # None where the scene's mesh cannot be used
    cost: float | None  # estimated seconds of an expansion over those at the scene's own level
    against: tuple[str, ...]  # what the scene has that it cannot see; empty if it can be used
    lost: str  # what it leaves out even so


def levels(preview: Preview) -> list[Level]:
    """Return the three levels, the cheapest first."""
    assembly, slope = preview.assembly, preview.steepest.slope
    own = size_of(assembly, assembly.kinematics).seconds(assembly.order)
    edges = curl_words(preview)
    told = {
        "section": (
            tuple(against_section(preview)),
            f"It leaves out what varies across the width: anticlastic edges{edges}, contraction "
            "that held ends prevent, wrinkles, motion to the side",
        ),
        "plate": (
            tuple(against_plate(preview)),
            "It leaves out motion in the plane: the tension stays as given, and slopes of "
            f"{np.degrees(slope):.2g}° make an error of {50.0 * slope**2:.2g} % (slope²/2)",
        ),
        "shell": ((), "It leaves nothing out"),
    }
    found = []
    for name, (against, lost) in told.items():
        level, size, cost = KINEMATICS[name], None, None
        if assembly.scene.strip.mesh is None or level is not SECTION:
            size = size_of(assembly, level)
            cost = size.seconds(assembly.order) / own
        found.append(Level(level, size, cost, against, lost))
    return found


def curl_words(preview: Preview) -> str:
    """Say how free edges curl off the smallest roller that strip is bent on, if any."""
    assembly, radii = preview.assembly, list[float]()
    scene, strip = assembly.scene, assembly.strip
    for roller in assembly.rollers if scene.strip.bending else ():
        if roller.radius * preview.turn(roller) > CURL_ARC * edge_curl(scene, roller.radius).width:
            radii.append(roller.radius)
    if not radii or not scene.material.poisson:
        return ""
    curl = edge_curl(scene, min(radii))
    stretched = strip.tensile_stiffness * curl.lift / min(radii)
    words = f"curled up by {curl.lift:.2g} m over {curl.width:.2g} m, pulled by {stretched:.2g} N/m"
    if sum(spec.drive == "speed" for spec in scene.rollers) > 1:
        most = 2.0 * curl.force / strip.width
        words += f"; that changes tensions between driven rollers by up to {most:.2g} N/m"
    return f" ({words})"


def justified_level(found: Sequence[Level]) -> Level:
    """Return the cheapest level that sees all that the scene has."""
    costs = [(level.cost, k) for k, level in enumerate(found) if level.cost and not level.against]
    return found[min(costs)[1]]


def against_section(preview: Preview) -> Iterator[str]:
    """Facts that a section, without width, does not see."""
    scene = preview.assembly.scene
    if scene.strip.mesh is not None:
        yield "the mesh comes from a file, which may have holes or any outline"
    for roller in scene.rollers:
        if roller.axis[0] or roller.axis[2]:
            yield f"the axis of {roller.name} is not along y"
        if roller.profile:
            yield f"{roller.name} is crowned or tapered"
    for name, (curl, friction) in preview.assembly.layout.curled.items():
        yield (
            f"free edges curl up off {name}, which takes {2.0 * curl.force:.0f} N of the "
            f"{friction:.0f} N of friction there"
        )
    for key in dict.fromkeys(key for shape in scene.shapes for key in shape.varying_across):
        yield f"{key.replace('_', ' ')} varies across the strip"
    for stage in scene.stages:
        if stage.gravity is not None and stage.gravity[1]:
            yield f"stage {stage.name} has gravity across the strip"
        for name in (name for name, move in stage.moves.items() if move[1]):
            yield f"stage {stage.name} moves {name} across the strip"
        for name, c in stage.edges.items():
            given = (c.force, c.move, c.velocity)
            if name in ENDS and any(v is not None and v[1] for v in given):
                yield f"stage {stage.name} pulls or moves {name} across the strip"
    touched = {*scene.edges, *(name for stage in scene.stages for name in stage.edges)}
    for name in sorted(touched - {*ENDS}):
        yield f"{name}, a side, is held, pulled or moved"


def stretched_between(assembly: Assembly) -> tuple[str, float]:
    """Return what stretches flat strip that sags, and its span (m), 0 if nothing does.

    Strip that is held at ends and sides becomes a dish, which stretches however they slide.
    """
    scene, strip = assembly.scene, assembly.strip
    held = {*scene.held_in("z")}
    if scene.threading is None and held.intersection(ENDS) and held.intersection(SIDES):
        return "held edges", min(strip.length, strip.width)
    taut = scene.threading is None and len(held_ends(scene)) == len(ENDS)
    return "held ends", strip.length if taut else 0.0


def fills_rectangle(strip: Strip) -> bool:
    """Whether a strip has no holes, and edges along x and y."""
    size = np.ptp(strip.nodes, axis=1)
    return bool(np.isclose(strip.weights().sum(), size[0] * size[1], rtol=1e-6))


def against_plate(preview: Preview) -> Iterator[str]:
    """Facts that a plate, with small slopes and nothing in its plane, does not see."""
    scene, steep = preview.assembly.scene, preview.steepest
    if scene.friction is not None and any(map(preview.assembly.frictional, scene.course)):
        yield "friction moves the strip along"
    if scene.material.plasticity is not None:
        yield "the strip yields"
    if naturals(scene):
        yield "heat, flatness or coil set stress the strip in its plane, or bend it"
    if steep.slope > PLATE_SLOPE:
        wraps = [f"{n} by {np.degrees(t):.3g}°" for n, t in steep.turns.items() if t > 0.0]
        share = f"{50.0 * steep.slope**2:.0f} %"
        error = share if steep.slope <= 1.0 else "beyond all small slopes"
        yield (
            f"slopes reach {np.degrees(steep.slope):.3g}°"
            f"{', wrapping ' if wraps else ''}{', '.join(wraps)}: the error, slope²/2, would be "
            f"{error} (bound {np.degrees(PLATE_SLOPE):.0f}°)"
        )
    stretches = scene.material.young * scene.strip.thickness * steep.slope**2 / 6.0
    between, span = stretched_between(preview.assembly)
    held = preview.tension + 12.0 * bending_stiffness(scene) / (span or 1.0) ** 2
    if span and stretches > SMALL_STRETCH * held:
        yield f"as it sags between {between}, {stretches:.3g} N/m come to pull it"
    if scene.strip.mesh is not None and not fills_rectangle(preview.assembly.strip):
        yield "the outline of its mesh is no rectangle, so that tension varies along"
    if scene.threading is not None:
        yield "[threading] lays the strip around rollers"
    for stage in scene.stages:
        yield from no_load_of_a_plate(stage)


def no_load_of_a_plate(stage: StageSpec) -> Iterator[str]:
    """Yield what a stage does to edges in the plane, or about them, which no plate takes."""
    for name, c in stage.edges.items():
        if c.moment:
            yield f"stage {stage.name} bends {name}"
        if any(v is not None and (v[0] or v[1]) for v in (c.move, c.velocity)):
            yield f"stage {stage.name} moves {name} in the plane"
        if c.tension is not None:
            yield f"{name}.tension in stage {stage.name}: only exit.force pulls a plate"
        elif c.force is not None and any(c.force[name == "exit" : 2]):
            yield f"stage {stage.name} pulls {name} in the plane, not by exit.force along x"
