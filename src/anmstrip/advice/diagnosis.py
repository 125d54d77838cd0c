"""Why a run has stopped: stage, time, place and likely cause, with what to type.

Every cause is a function that looks at a :class:`Failure` and returns a sentence, or None.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, takewhile

import numpy as np

from anmstrip.advice import physics, warnings
from anmstrip.advice.preview import Preview, as_sentence, motions_at, unheld_words
from anmstrip.advice.units import other_units, typed_vector
from anmstrip.arrays import Array
from anmstrip.continuation.path import NEGLIGIBLE_SHARE, Evidence, Outcome, PathStopped
from anmstrip.equilibrium import StageProblem
from anmstrip.fem.sampling import shape_of
from anmstrip.mechanics.roller import placed
from anmstrip.mechanics.shell import eigenstrain
from anmstrip.results.state import State
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.scene.tables import ENDS, THREADING
from anmstrip.simulation.defaults import typed_tensions
from anmstrip.simulation.meshing import LAYER_SHARE, Nip
from anmstrip.simulation.problem import Assembly, cheapest_order, size_of
from anmstrip.simulation.stages import Course
from anmstrip.timestepping.formulas import AffineVelocity

NEAR_ROLLER = 2.0
"""Gap, in lengths of the elements there, up to which a node counts as near a roller."""

COARSE_ELEMENT = 0.5
"""Element over a roller, in boundary layers √(D/T), that is called too long."""

SHARP_ONSET = 1e-3
"""Onset of contact, over the one that the mesh resolves, that is called too sharp."""

LINE_ELEMENTS = 4.0
"""Elements over which strip touches a roller up to which that is a line."""

STIFF_LAYER = 2.0
"""Boundary layer √(D/T) over a radius from which on strip does not follow its thread."""

WIDER_FRICTION = 2.0
"""V_c that is proposed, over the least with which a stationary state was found."""

USUAL_STEP, TURNING_SPEEDS = 0.01, 1e3
"""A usual step over the duration of a stage; speeds from which on friction is seen to turn."""


TURNED_BACK = 1e-3
"""Share of a stage by which a path has gone back that is told to have turned."""


@dataclass(frozen=True)
class Location:
    """A node of the strip at which a path has failed."""

    place: str  # see :func:`place_of`
    component: str  # x, y or z: which displacement failed
    element: float  # length of the elements there along the strip (m)
    roller: str  # name of the nearest roller, empty if none is near

    def __str__(self) -> str:
        roller = f", at roller {self.roller}" if self.roller else ""
        return f"{self.place} (in {self.component}{roller})"


def place_of(nodes: Array, state: State, threaded: bool) -> str:
    """Say where nodes are in the mean: in space of a threaded line, else in the flat strip."""
    strip = state.plan.model.strip
    point, names = strip.mesh.p[:, nodes].mean(axis=1), "xy"
    point = point + strip.flat_origin[: len(point)]
    if threaded:
        moved = strip.kinematics.embed(strip.nodal(state.full)[strip.node_values[nodes]].T)
        names = "".join("xyz"[component] for component in strip.kinematics.components)
        point = (strip.nodes[:, nodes] + moved).mean(axis=1) + strip.origin
        point = point[list(strip.kinematics.components)]
    places = zip(names, np.round(point, physics.PLACE_DECIMALS), strict=False)
    return ", ".join(f"{name} = {x + 0.0:.4g} m" for name, x in places)


def locate(evidence: Evidence, state: State, threaded: bool) -> Location | None:
    """Return the node that has most to do with a failure, None if nothing shows it.

    A residual times the unit of its unknown is a force, a motion over it a length.
    """
    strip, free = state.plan.model.strip, state.plan.supports.free
    number, units = evidence.unknown, state.plan.model.units[free]
    for values, scale in ((evidence.residual, units), (evidence.motion, 1.0 / units)):
        if number is None and values is not None and len(values) == len(units):
            size = np.where(np.isfinite(values), np.abs(values * scale), np.inf)
            number = int(np.argmax(size)) if size.max() > size.min() else None
    if number is None or free[number] >= strip.unknowns:  # a roller's
        return None
    scalar, component = divmod(int(free[number]), strip.count)
    mesh, at_node = strip.mesh, np.argwhere(strip.basis.nodal_dofs == scalar)
    if len(at_node):
        point = mesh.p[:, at_node[0, 1]]
    else:
        facet = np.argwhere(strip.basis.facet_dofs == scalar)[0, 1]
        point = mesh.p[:, mesh.facets[:, facet]].mean(axis=1)
    node = int(np.abs(mesh.p - point[:, None]).sum(axis=0).argmin())
    element = float(strip.cell_sizes[0][(mesh.t == node).any(axis=0)].max())
    gaps = [(np.inf, "")]
    if (contact := state.contact) is not None:
        x, look = contact.sampling.whole.reference, contact.look(state.full, state.controls)
        near = np.array([np.abs(x[: len(point)] - point[:, None]).sum(axis=0).argmin()])
        for name, part in contact.by_roller.items():
            gaps.append((float(part.restricted(near).gap(look, state.controls)[0]), name))
    gap, roller = min(gaps)
    name = "xyz"[strip.kinematics.components[component]]
    place = place_of(np.array([node]), state, threaded)
    return Location(place, name, element, roller if gap < NEAR_ROLLER * element else "")


@dataclass(frozen=True)
class Failure:
    """A stopped path, seen from the scene."""

    assembly: Assembly
    stage: StageSpec
    state: State  # last one that was accepted, with the plan of the stage
    stopped: PathStopped
    place: str | None = None  # of a path that is none of the scene's
    resumable: bool = False  # whether the run can be resumed

    @property
    def scene(self) -> SceneSpec:
        """Scene that was run."""
        return self.assembly.scene

    @property
    def plan(self) -> StageProblem:
        """Equations of the stage."""
        return self.state.plan

    @cached_property
    def location(self) -> Location | None:
        """Node of the strip that shows it."""
        return locate(self.stopped.evidence, self.state, self.assembly.thread is not None)


def diagnosis(failure: Failure, cause: str | None = None) -> str:
    """Say what has happened and where, then the cause, the likely one if none is known."""
    stopped, location = failure.stopped, failure.location
    words = ": ".join(part for part in (stopped.outcome.value, stopped.detail) if part)
    words += turning_point(failure)
    where = "" if location is None else f"; worst at {location}"
    with np.errstate(all="ignore"):
        cause = cause or next(found for rule in CAUSES if (found := rule(failure)))
    place = failure.place or f"in stage {failure.stage.name} at t = {failure.state.time:.6g} s"
    return f"Stopped {place}: {words}{where}. {cause}"


def turning_point(failure: Failure) -> str:
    """Say where a path turned back: when, and what the stage had changed until then."""
    farthest, plan = failure.stopped.farthest, failure.plan
    fold = failure.stopped.outcome is Outcome.FOLD
    if farthest is None or plan.in_time:
        return ""
    if farthest - failure.state.control < TURNED_BACK and not (fold and plan.steady):
        return ""
    said = "" if fold else ", after the path turned back at a limit point"
    reached = plan.controls.at(farthest)
    numbers = {k: v for k, v in reached.items() if not v.ndim or k.endswith("force")}
    moving = {k: v for k, v in numbers.items() if k in plan.controls.slope}
    sizes = {k: float(np.linalg.norm(v) if v.ndim else v) for k, v in moving.items()}
    changed = [f"{failure.scene.as_typed(k)} of {size:.3g}" for k, size in sizes.items()]
    with_what = f" with {', '.join(changed)}" if changed else ""
    return f"{said} at t = {plan.start + farthest * plan.duration:.6g} s{with_what}"


def too_many_steps(failure: Failure) -> str | None:
    """The bound on steps or tangents was meant by the user, and nothing is wrong."""
    keys = {Outcome.TOO_MANY_STEPS: "max_steps", Outcome.TOO_MANY_TANGENTS: "max_tangents"}
    key = keys.get(failure.stopped.outcome)
    if key is None:
        return None
    doubt = forewarned(failure) or slack(failure) or low_order(failure)
    goes_on, most = "--resume " * failure.resumable, getattr(failure.scene.solver, key)
    more = f"Try {goes_on}--set solver.{key}={2 * most}"
    return more if doubt is None else f"{more} but {doubt[0].lower()}{doubt[1:]}"


def too_large(failure: Failure) -> str | None:
    """The factors of the tangent do not fit into memory."""
    if failure.stopped.outcome is not Outcome.TOO_LARGE:
        return None
    assembly, kinematics = failure.assembly, failure.scene.strip.kinematics
    if kinematics == "shell" and not any(warnings.against_section(Preview(assembly, (), ()))):
        return "Nothing varies across the strip. Try --set 'strip.kinematics=\"section\"'"
    longer = 2.0 * float(assembly.strip.cell_sizes[0].min())
    return f"Try longer elements: --set strip.refined={physics.two_digits(longer, np.ceil):g}"


def slides_away(failure: Failure) -> str | None:
    """The strip runs away over rollers that hold less than what pulls at its ends."""
    if failure.stopped.outcome is not Outcome.RAN_AWAY:
        return None
    return forewarned(failure) or where_it_slides(failure)


def turns_through(failure: Failure) -> str | None:
    """A torque turns a roller through under the strip."""
    if failure.stopped.outcome is not Outcome.SPUN:
        return None
    found = next(warnings.spinning_rollers(failure.state, failure.scene), None)
    return None if found is None else as_sentence(found)


def nothing_grips(failure: Failure) -> str | None:
    """Steady strip with tensions at both ends slides over every roller with a drive.

    As where it yields: bending it takes up tension, which statics before the run leaves out.
    """
    stage, slid = failure.stage, warnings.slides_as_a_whole(failure.state, failure.scene)
    answers = stage.steady and Course(failure.assembly).pulled(stage)
    return where_it_slides(failure) if answers and slid else None


def where_it_slides(failure: Failure) -> str:
    """Say over which rollers the strip slides, and what helps."""
    readings = failure.state.rollers
    found = [
        f"{name} ({np.degrees(readings[name].wrap):.3g}°, {readings[name].tension_in:.5g} and "
        f"{readings[name].tension_out:.5g} N/m)"
        for name, contact in warnings.touched_drives(failure.state, failure.scene).items()
        if warnings.slides(contact)
    ]
    where = f"It slides over {', '.join(found)}. " if found else ""
    torques = ", other torques" * any(r.drive == "torque" for r in failure.scene.rollers)
    return (
        f"{where}Try more wrap or friction there{torques}, or less difference of the tensions at "
        "its ends."
    )


def not_held(failure: Failure) -> str | None:
    """No edge holds a component, and no roller the strip lies on."""
    strip = failure.plan.model.strip
    held = np.ones(failure.plan.model.unknowns, dtype=bool)
    held[failure.plan.supports.free] = False
    rubbed = "xy" if failure.plan.in_time else ""
    by_rollers = rubbed + "z" if failure.state.touched else ""
    for place, component in enumerate(strip.kinematics.components):
        name = "xyz"[component]
        if held[strip.count * strip.node_values + place].any() or name in by_rollers:
            continue
        return as_sentence(unheld_words(failure.scene, failure.stage.name, name))
    return None


def squeezed(failure: Failure) -> str | None:
    """Two rollers overlap, or press on the same points while friction can hold the strip.

    Those that press with a given force do so as they are meant to, unless they crush the strip.
    """
    contacts, controls = failure.state.contacts, failure.state.controls
    assembly, thickness = failure.assembly, failure.assembly.strip.thickness
    for pair in combinations(assembly.rollers, 2):
        if not {roller.name for roller in pair} <= set(contacts):
            continue
        a, b = placed(pair, controls)
        apart = float(np.linalg.norm(physics.across(np.subtract(b.centre, a.centre), a.unit_axis)))
        nip = Nip(a, b, apart - a.radius - b.radius)
        first, second = (contacts[r.name].pressed for r in pair)
        pressed = np.isin(first, second).any() and (nip.squeeze > 0.0 or not a.half)
        pressed &= not set(nip.names).intersection(assembly.pressing)
        pressed |= physics.crushes(assembly, nip)  # strip that may not have come to touch them yet
        doubt = pressed and (forewarned(failure) or physics.held_by_nip(seen_before(failure), nip))
        if nip.gap < 0.0 or (pressed and not doubt):
            nips = a.half and nip.gap >= 0.0
            least = 0.0 if nips else nip.squeeze - 1.1 * max(-nip.gap, thickness)
            return (
                f"Rollers {a.name} and {b.name} are {nip.gap:.3g} m apart and squeeze the strip. "
                f"Try {physics.closer_rollers(assembly, failure.stage.name, nip, least)}"
            )
    return None


def round_off(failure: Failure) -> str | None:
    """The last digits of the state do not allow the tolerance."""
    plan, state = failure.plan, failure.state
    free, rates = plan.supports.free, None
    u = state.full[free] - plan.supports.start[free]
    if plan.in_time and state.velocity is not None:
        rates = AffineVelocity(1.0, state.velocity[free] - u, np.zeros_like(u))
    equations = plan.equations(rates, state.velocity)
    share = NEGLIGIBLE_SHARE if plan.in_time else 1.0
    told = warnings.below_round_off(failure.scene, equations.round_off(u, state.control), share)
    return f"The value {told}" if told else None


def forewarned(failure: Failure) -> str | None:
    """It could be told before the run, of this stage or else of those before it."""
    names, here = [stage.name for stage in failure.scene.course], failure.stage.name
    later = names[names.index(here) + 1 :] if here in names else []

    def is_of(told: str, stages: Sequence[str]) -> bool:
        return any(re.search(rf"\bstages?[ .]{re.escape(name)}\b", told) for name in stages)

    def so_far(told: Iterable[str]) -> list[str]:
        return [each for each in told if is_of(each, [here]) or not is_of(each, later)]

    preview = seen_before(failure)
    if doubted := so_far(other_units(preview)):
        return as_sentence(" and ".join(doubted))
    found = so_far(warnings.serious_as_meant(preview))
    return as_sentence(min(found, key=lambda told: not is_of(told, [here]))) if found else None


def ran_away(failure: Failure) -> bool:
    """Whether statics say that the strip runs away in this stage, on any mesh and by any laws."""
    preview, stage = seen_before(failure), failure.stage.name
    pulls = physics.pulled_at_both_ends(preview)
    return any(physics.runs_away(preview, each) for each in pulls if each.stage.name == stage)


def seen_before(failure: Failure) -> Preview:
    """Return what could be seen before the run, of this stage and those before it."""
    preview = Preview.of(failure.assembly)
    names = [plan.name for plan in preview.plans]  # a map goes on after the last of them
    until = 1 + names.index(failure.stage.name) if failure.stage.name in names else None
    return replace(preview, plans=preview.plans[:until], strings=preview.strings[:until])


def stiff_strip(failure: Failure) -> str | None:
    """Bending keeps a threaded strip from lying on its rollers."""
    scene, stiffness = failure.scene, failure.assembly.strip.bending_stiffness
    if failure.stage.name != THREADING or scene.threading is None or not scene.strip.bending:
        return None
    roller = min(failure.assembly.rollers, key=lambda roller: roller.radius)
    layer = float(np.sqrt(stiffness / scene.threading.tension))
    if not layer > STIFF_LAYER * roller.radius:
        return None
    return (
        f"The strip bends over √(D/T) = {layer:.2g} m, and cannot lie on roller {roller.name} of "
        f"radius {roller.radius:.2g} m. "
        f"Try --set threading.tension={physics.two_digits(stiffness / roller.radius**2, np.ceil):g}"
    )


def profiled(failure: Failure) -> str | None:
    """Rollers whose profiles leave fibres of the strip without tension."""
    return as_sentence(next(physics.loose_fibres(seen_before(failure)), "")) or None


def slack(failure: Failure) -> str | None:
    """No tension, or membrane forces that press more than an element bears unbuckled."""
    membrane, strip = failure.assembly.membrane, failure.assembly.strip
    if membrane is None:
        return None
    forces = membrane.at(failure.state.full, failure.state.controls)
    mean = forces.reshape(*forces.shape[:2], strip.mesh.nelements, -1).mean(axis=3)
    least = np.linalg.eigvalsh(np.moveaxis(mean, 2, 0))[:, 0]
    seen = seen_before(failure)
    euler = np.pi**2 * strip.bending_stiffness if failure.scene.strip.bending else 0.0
    bearable = euler / (4.0 * strip.cell_sizes[0]) ** 2
    worst = int(np.argmin(least + bearable))
    if least[worst] < -max(bearable[worst], 1e-3 * failure.assembly.scales.tension):
        nodes, threaded = strip.mesh.t[:, worst], failure.assembly.thread is not None
        at = place_of(nodes, failure.state, threaded)
        found = f"pressed at {at} with {-least[worst]:.3g} N/m, and buckles"
    elif (pull := float(mean[0, 0].max())) < -euler / strip.length**2 < 0.0:
        return snapping(failure, -pull)
    elif not warnings.carries_itself(seen, seen.plans[-1], seen.strings[-1].span) and (
        pull < euler / strip.length**2
        or (failure.stopped.outcome is Outcome.SINGULAR and not forces.any())
    ):
        found = "under no tension, which is what holds a thin strip in shape"
        if not failure.scene.strip.bending:
            return (
                f"The strip is {found}, and without bending nothing else. "
                "Try --set strip.bending=true, or a stage before that pulls the strip"
            )
    else:
        return None
    crooked = next(physics.slack_edge(seen), "")
    cure = uneven_heat(failure, -least[worst]) or pressed_by_ends(failure, mean[0, 0, worst])
    return f"The strip is {found}. {cure or as_sentence(crooked) or more_tension(failure)}"


def snapping(failure: Failure, pressed: float) -> str:
    """Say that strip that has buckled, pressed all along (N/m), finds no shape nearby."""
    plan, name, farthest = failure.plan, failure.stage.name, failure.stopped.farthest
    reached = failure.state.control if plan.in_time or farthest is None else farthest
    return (
        f"The strip is pressed by {pressed:.3g} N/m all along and has buckled: here it snaps to "
        f"another shape. Try at most {np.floor(99.0 * reached) / 100.0:.2g} of what stage {name} "
        "moves and loads."
    )


def pressed_by_ends(failure: Failure, pull: float) -> str | None:
    """Ends that hold a shell in y and press it across where it is pulled along (N/m)."""
    held = [f"the {name}" for name in ENDS if name in failure.scene.held_in("y")]
    if not held or pull <= 0.0:
        return None
    return (
        f"It is pulled by {pull:.3g} N/m there, and may not contract at {' and '.join(held)}, held "
        "in y: the harder the pull, the more that presses it. "
        f"Try a smaller pull in stage {failure.stage.name}."
    )


def uneven_heat(failure: Failure, pressed: float) -> str | None:
    """Heat or flatness whose strains differ so much over the strip that they press it (N/m).

    A threaded shell, which may lengthen, by what its longest fibres exceed the mean across.
    """
    strip, stage, made = failure.assembly.strip, failure.stage, dict[str, float]()
    across = failure.assembly.thread is not None and shape_of(strip) == "quad"
    for key in ("temperature", "flatness", "camber"):
        controls = {k: v for k, v in failure.state.controls.items() if k == f"strip.{key}"}
        if (own := eigenstrain(strip, controls)) is not None:
            where = f"stages.{stage.name}.strip" if key in stage.strip.natural else "strip"
            strain = own[0, 0]
            most = physics.longest_fibre(strip, strain, True) if across else float(np.ptp(strain))
            made[f"{where}.{key}"] = strip.tensile_stiffness * most
    key = max(made, key=lambda each: made[each], default="")
    if not key or made[key] <= pressed:
        return None
    return (
        f"{key} varies so much over it that this alone may press it by {made[key]:.3g} N/m. Try "
        "less of it, or more tension than that"
    )


def more_tension(failure: Failure) -> str:
    """Say what to type to pull more: twice as much all along, or at least to a strain of 5e-5."""
    scene = failure.scene
    stage = failure.stage.name if failure.place is None else scene.stages[-1].name
    if scene.threading is not None:
        pulls = typed_tensions(scene)
        if stage == THREADING:
            pulls = {"threading.tension": scene.threading.tension}
        settings = (f"--set {key}={2.0 * tension:.3g}" for key, tension in pulls.items())
        return f"Try {' '.join(settings)}"
    held, least = scene.edges.get("exit"), 5e-5 * failure.assembly.strip.tensile_stiffness
    end = failure.plan.controls.at(1.0)
    if (tension := float(end.get("exit.tension", 0.0))) > 0.0:
        return f"Try --set stages.{stage}.exit.tension={max(2.0 * tension, least):.3g}"
    force = np.asarray(end.get("exit.force", np.zeros(3)))
    if force[0] > 0.0:
        larger = max(2.0, least / float(np.linalg.norm(force))) * force
        return f"Try --set 'stages.{stage}.exit.force={typed_vector(larger, '.4g')}'"
    if held is not None and "x" in held.fixed:
        holding = takewhile(lambda each: not each.edge("exit").release, scene.stages)
        before = [each.name for each in holding]
        if stage in before:
            return f"Try a larger x in stages.{stage}.exit.move."
        if before:
            return f"Try a larger x in stages.{before[-1]}.exit.move, before the exit is let go."
    first = scene.stages[0]
    calm = f" --set stages.{first.name}.friction=false" * failure.assembly.frictional(first)
    return f"Try --set 'stages.{first.name}.exit.force=[{least:.3g}, 0.0, 0.0]'{calm}"


def free_motion(failure: Failure) -> str | None:
    """A null vector of the tangent where it has stopped, which at a limit point is another one."""
    if failure.stopped.outcome is Outcome.FOLD:
        return None
    state = failure.state
    found = next(motions_at(failure.assembly, failure.plan, state.full, state.control), "")
    return as_sentence(found) or None


def coarse(failure: Failure) -> str | None:
    """Elements over a roller do not see the strip bend onto it."""
    location, strip = failure.location, failure.assembly.strip
    if location is None or not location.roller or not failure.scene.strip.bending:
        return None
    layer = float(np.sqrt(strip.bending_stiffness / failure.assembly.scales.tension))
    if not location.element > COARSE_ELEMENT * layer:
        return None
    finer = warnings.finer_mesh(failure.scene, LAYER_SHARE * layer)
    return (
        f"Elements of {location.element:.3g} m over roller {location.roller} are long "
        f"against √(D/T) = {layer:.3g} m. Try {finer}"
    )


def sharp_contact(failure: Failure) -> str | None:
    """A typed onset of contact that the mesh is far from resolving."""
    contact = failure.scene.contact
    if contact is None or contact.onset is None:
        return None
    onset = warnings.usual_onset(failure.scene)
    if not contact.onset < SHARP_ONSET * onset:
        return None
    return (
        f"Contact sets in over {contact.onset:.2g} m, and elements resolve {onset:.2g} m. "
        f"Try --set contact.onset={onset:.1g}"
    )


def sharp_nip(failure: Failure) -> str | None:
    """A given force presses strip over less than an element, in which friction has corners."""
    assembly, contact = failure.assembly, failure.scene.contact
    if contact is None or contact.constants or contact.law or not failure.state.touched:
        return None
    length = float(np.diff(np.unique(np.round(assembly.strip.nodes[0], 9))).min())
    for nip in assembly.nips[-1]:
        reach = np.sqrt(2.0 * assembly.signorini.width / nip.curvature)
        if set(nip.names).intersection(assembly.pressing) and reach < length:
            return (
                f"Rollers {' and '.join(nip.names)} press the strip over {2.0 * reach:.2g} m, and "
                f"elements are {length:.2g} m long: friction comes and goes there from point to "
                "point. With a wider onset of contact the force of the nip stays as typed. "
                f"Try --set contact.onset={2.0 * length**2 * nip.curvature:.1g}"
            )
    return None


def sharp_line(failure: Failure) -> str | None:
    """Strip too stiff for a roller touches it over less than elements, and friction moves it."""
    assembly, contact, place = failure.assembly, failure.scene.contact, failure.location
    touched = failure.state.touched.get(place.roller) if place and place.roller else None
    if contact is None or contact.constants or contact.law or place is None or touched is None:
        return None
    begin, end = touched.arc
    wider = place.element**2 / (2.0 * touched.roller.radius)
    rubs = assembly.frictional(failure.stage) or failure.stage.steady
    if not rubs or end - begin > LINE_ELEMENTS * place.element or assembly.signorini.width >= wider:
        return None
    return (
        f"The strip touches {place.roller} along a line, over {end - begin:.2g} m, and elements "
        f"are {place.element:.2g} m long: friction comes and goes there from point to point. "
        f"Try --set contact.onset={wider:.1g}"
    )


def stiff_friction(failure: Failure) -> str | None:
    """Friction turns round within a speed at which the positions have no digits left."""
    friction, strip = failure.scene.friction, failure.assembly.strip
    law = failure.assembly.law_of_slip(failure.stage)
    if not failure.plan.in_time or friction is None or law is None or not failure.state.touched:
        return None
    seen = np.finfo(float).eps * strip.length / (USUAL_STEP * failure.plan.duration)
    corner = friction.omega if "omega" in friction.constants else 1.0
    key = "speed" if law.speed == friction.speed else "speed_at_rest"
    turns = corner * law.speed
    if not turns < TURNING_SPEEDS * seen:
        return None
    return (
        f"Friction turns round within {turns:.2g} m/s, and the last digit of the positions is "
        f"worth {seen:.2g} m/s in a step of time. "
        f"Try --set friction.{key}={TURNING_SPEEDS * seen / corner:.1g}"
    )


def sharp_friction(failure: Failure) -> str | None:
    """A steady stage whose end was found with a larger V_c, but not with the given one."""
    width, friction = failure.stopped.width, failure.scene.friction
    law = failure.assembly.law_of_slip(failure.stage)
    if width is None or friction is None or law is None or law.growth:
        return None
    reached, key = width * law.speed, "speed" if law.speed == friction.speed else "speed_at_rest"
    return (
        f"Friction turns round within V_c = {law.speed:.2g} m/s, and within {reached:.2g} m/s "
        f"there is a stationary state at the end of the stage. "
        f"Try --set friction.{key}={WIDER_FRICTION * reached:.2g}"
    )


def low_order(failure: Failure) -> str | None:
    """Series of few terms, asked for: their steps may shrink where those of more do not."""
    given, assembly = failure.scene.solver.order, failure.assembly
    if given is None or failure.stopped.outcome is Outcome.FOLD:
        return None
    size = size_of(assembly, assembly.kinematics)
    order = cheapest_order(size, failure.scene.solver.tolerance)
    if 2 * given > order:
        return None
    return f"Series of order {given} are short. Try --set solver.order={order}"


def asked_too_much(failure: Failure) -> str:
    """The last change, in this stage or before it, is more than the strip can follow."""
    if failure.place is not None:
        return "Try a smaller range."
    for stage in reversed(failure.scene.up_to(failure.stage)):
        rollers = {f"rollers.{name}": roller for name, roller in stage.rollers.items()}
        keys = [
            f"{name}.{key}"
            for name, table in {**stage.edges, **rollers}.items()
            for key in table.model_dump(exclude_defaults=True, exclude={"release"})
        ]
        keys += [key for key in ("gravity", "pressure") if getattr(stage, key) is not None]
        keys += [f"strip.{key}" for key in stage.strip.natural]
        if keys:
            changed = ", ".join(f"stages.{stage.name}.{key}" for key in keys)
            idle = any(roller.drive == "idle" for roller in failure.scene.rollers)
            if stage.name == failure.stage.name and stage.steady and "gravity" in keys and idle:
                return (
                    f"Stage {stage.name} puts weight on strip that runs: rollers that it only just "
                    "touches cannot turn before. Put it on in a stage before, of its own with "
                    f"friction = false and gravity = {typed_vector(stage.gravity or (), '.4g')}."
                )
            return f"Stage {stage.name} changes {changed}: try a smaller change."
    return more_tension(failure)


CAUSES: tuple[Callable[[Failure], str | None], ...] = (
    too_many_steps, too_large, slides_away, turns_through, not_held, squeezed, forewarned,
    stiff_strip, profiled, slack, round_off, free_motion, sharp_contact, sharp_nip,
    stiff_friction, sharp_friction, low_order, nothing_grips, coarse, sharp_line, asked_too_much,
)  # fmt: skip
"""Likely causes, the surest first; the last one always has words."""
