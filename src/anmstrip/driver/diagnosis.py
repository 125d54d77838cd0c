"""Why a run has stopped: stage, time, place and likely cause, with what to type."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from anmstrip.continuation.status import Evidence, Outcome, PathStopped
from anmstrip.equilibrium import Equilibrium, StageProblem
from anmstrip.fem.strip import Strip
from anmstrip.mechanics.roller import Roller
from anmstrip.results.state import ContactState, State
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.scene.tables import THREADING
from anmstrip.simulation.meshing import QUARTER
from anmstrip.simulation.problem import Assembly, cheapest_order, size_of
from anmstrip.timestepping.implicit import RESIDUAL_SHARE

Array = NDArray[np.float64]

NEAR = 2.0
"""Gap, in lengths of the elements there, up to which a node counts as near a roller."""


@dataclass(frozen=True)
class Place:
    """A node of the strip and what is around it.

    Attributes
    ----------
    state : State
        Last one that was accepted.
    reference : ndarray, shape (3,)
        Position in the flat strip (m).
    component : str
        x, y or z: which displacement failed.
    """

    state: State
    reference: Array
    component: str

    @property
    def strip(self) -> Strip:
        """Whose place it is."""
        return self.state.plan.model.strip

    @cached_property
    def element(self) -> float:
        """Length of the elements here along the strip (m)."""
        mesh = self.strip.mesh
        distance = np.abs(mesh.p - self.reference[: len(mesh.p), None]).sum(axis=0)
        around = (mesh.t == int(distance.argmin())).any(axis=0)
        return float(self.strip.cell_sizes[0][around].max())

    @cached_property
    def roller(self) -> str:
        """Name of the nearest roller, empty if none is near."""
        gaps = [(self._gap(contact), name) for name, contact in self.state.contacts.items()]
        gap, name = min(gaps, default=(np.inf, ""))
        return name if gap < NEAR * self.element else ""

    def _gap(self, contact: ContactState) -> float:
        x = contact.contact.operator.reference
        nearest = np.abs(x - self.reference[:, None]).sum(axis=0).argmin()
        return float(contact.gap[nearest])

    def __str__(self) -> str:
        axes = "xy"[: self.strip.mesh.dim()]
        at = ", ".join(f"{n} = {v:.4g} m" for n, v in zip(axes, self.reference, strict=False))
        roller = f", at roller {self.roller}" if self.roller else ""
        return f"{at} (in {self.component}{roller})"


def place_of(evidence: Evidence, state: State) -> Place | None:
    """Node and component at which a path has failed, ``None`` if nothing shows it."""
    plan = state.plan
    free, strip = plan.supports.free, plan.model.strip
    number = _worst(evidence, plan.model.units[free])
    if number is None:
        return None
    scalar, component = divmod(int(free[number]), strip.count)
    name = "xyz"[strip.kinematics.components[component]]
    return Place(state, _reference(strip, scalar), name)


def _worst(evidence: Evidence, units: Array) -> int | None:
    """Number of the free unknown that has most to do with it, ``None`` if all have the same.

    A residual times the unit of its unknown is a force, a motion over it a length.
    """
    if evidence.unknown is not None:
        return evidence.unknown
    for values, scale in ((evidence.residual, units), (evidence.motion, 1.0 / units)):
        if values is None or len(values) != len(units):
            continue
        size = np.where(np.isfinite(values), np.abs(values * scale), np.inf)
        return int(np.argmax(size)) if size.max() > size.min() else None
    return None


def _reference(strip: Strip, scalar: int) -> Array:
    """Reference position of a scalar degree of freedom, shape (3,)."""
    at_node = np.argwhere(strip.basis.nodal_dofs == scalar)
    if len(at_node):
        return np.asarray(strip.nodes[:, at_node[0, 1]])
    facet = np.argwhere(strip.basis.facet_dofs == scalar)[0, 1]
    return strip.in_space(strip.mesh.p[:, strip.mesh.facets[:, [facet]]].mean(axis=1))[:, 0]


COARSE = 0.5
"""Element over a roller, in boundary layers √(D/T), that is called too long."""

CLEAR = 0.1
"""Share of the asked imbalance that round-off may make."""

SHARE, DIGITS = 0.01, 1e3
"""A usual step over the duration of a stage; speeds from which on friction is seen to turn."""


@dataclass(frozen=True)
class Failure:
    """A stopped path, seen from the scene.

    Attributes
    ----------
    assembly : Assembly
    stage : StageSpec
    state : State
        Last one that was accepted, with the plan of the stage.
    stopped : PathStopped
    """

    assembly: Assembly
    stage: StageSpec
    state: State
    stopped: PathStopped

    @property
    def scene(self) -> SceneSpec:
        """That was run."""
        return self.assembly.scene

    @property
    def plan(self) -> StageProblem:
        """Of the stage."""
        return self.state.plan

    @cached_property
    def place(self) -> Place | None:
        """Where on the strip."""
        return place_of(self.stopped.evidence, self.state)

    @cached_property
    def touched(self) -> list[ContactState]:
        """Rollers that the strip lies on."""
        return [c for c in self.state.contacts.values() if c.touching.any()]


def diagnosis(failure: Failure) -> str:
    """What has happened and where, then the likely cause and what to type."""
    stopped, place = failure.stopped, failure.place
    words = ": ".join(part for part in (stopped.outcome.value, stopped.detail) if part)
    where = "" if place is None else f"; worst at {place}"
    with np.errstate(all="ignore"):
        cause = next(found for f in CAUSES if (found := f(failure)))
    time = f"t = {failure.state.time:.6g} s"
    return f"Stopped in stage {failure.stage.name} at {time}: {words}{where}. {cause}"


def too_many_steps(failure: Failure) -> str | None:
    """The bound on steps or tangents was meant by the user, and nothing is wrong."""
    keys = {Outcome.TOO_MANY_STEPS: "max_steps", Outcome.TOO_MANY_TANGENTS: "max_tangents"}
    key = keys.get(failure.stopped.outcome)
    if key is None:
        return None
    doubt = forewarned(failure)
    more = f"Try --set solver.{key}={2 * getattr(failure.scene.solver, key)}, then --resume."
    return more if doubt is None else f"{more} But {doubt[0].lower()}{doubt[1:]}"


def not_held(failure: Failure) -> str | None:
    """A component that no edge holds, and no roller the strip lies on."""
    plan, strip = failure.plan, failure.plan.model.strip
    held = np.ones(strip.unknowns, dtype=bool)
    held[plan.supports.free] = False
    rubbed = "xy" if plan.in_time else ""
    by_rollers = rubbed + "z" if failure.touched else ""
    for place, component in enumerate(strip.kinematics.components):
        name = "xyz"[component]
        if held[strip.count * strip.node_values + place].any() or name in by_rollers:
            continue
        return f"Nothing holds the strip in {name}. Try {_holding(failure, name)}."
    return None


def _holding(failure: Failure, component: str) -> str:
    """What to type so that an edge holds a component."""
    edges = failure.scene.edges
    name = next(iter(edges), "entry")
    if component == "y":
        return f"--set edges.{name}.centred=true"
    fixed = {*(edges[name].fixed if name in edges else ()), component}
    listed = ", ".join(f'"{c}"' for c in sorted(fixed))
    return f"--set 'edges.{name}.fixed=[{listed}]'"


def squeezed(failure: Failure) -> str | None:
    """Two rollers that overlap, or press on the same points."""
    contacts, controls = failure.state.contacts, failure.state.controls
    for a, b in combinations(failure.assembly.rollers, 2):
        if not {a.name, b.name} <= set(contacts):
            continue
        centre = np.array(controls[f"rollers.{b.name}.centre"])
        across = centre - controls[f"rollers.{a.name}.centre"]
        across -= (across @ a.unit_axis) * a.unit_axis
        distance = float(np.linalg.norm(across))
        overlap = a.radius + b.radius - distance
        if overlap > 0.0 or (contacts[a.name].touching & contacts[b.name].touching).any():
            away = 1.1 * max(overlap, failure.assembly.strip.thickness) / distance * across
            return (
                f"Rollers {a.name} and {b.name} are {-overlap:.3g} m apart and squeeze the strip. "
                f"Try {_put(failure, b, centre + away)}."
            )
    return None


def _put(failure: Failure, roller: Roller, centre: Array) -> str:
    """What to type to have a roller elsewhere."""
    control = failure.stage.rollers.get(roller.name)
    if control is None or control.move is None:
        return f"--set 'rollers.{roller.name}.centre={_numbers(centre)}'"
    move = _numbers(centre - np.array(roller.centre))
    return f"--set 'stages.{failure.stage.name}.rollers.{roller.name}.move={move}'"


def slack(failure: Failure) -> str | None:
    """No tension, or membrane forces that press more than an element bears unbuckled."""
    membrane, strip = failure.assembly.membrane, failure.assembly.strip
    if membrane is None:
        return None
    forces = membrane.forces(membrane.operator.apply(failure.state.full) + membrane.flat)
    mean = forces.reshape(*forces.shape[:2], strip.mesh.nelements, -1).mean(axis=3)
    least = np.linalg.eigvalsh(np.moveaxis(mean, 2, 0))[:, 0]
    bearable = buckling_force(failure, 4.0 * strip.cell_sizes[0])
    worst = int(np.argmin(least + bearable))
    if least[worst] < -max(bearable[worst], 1e-3 * failure.assembly.scales.tension):
        x = strip.mesh.p[0, strip.mesh.t[:, worst]].mean()
        found = f"pressed at x = {x:.3g} m with {-least[worst]:.3g} N/m, and buckles"
    elif mean[0, 0].max() < buckling_force(failure, np.array(strip.length)):
        found = "under no tension, which is what holds a thin strip in shape"
    else:
        return None
    return f"The strip is {found}. Try {_more_tension(failure)}."


def buckling_force(failure: Failure, length: Array) -> Array:
    """π² D / l² (N/m) of a free length (m)."""
    strip = failure.assembly.strip
    return (strip.bending_stiffness if failure.scene.strip.bending else 0.0) * (np.pi / length) ** 2


def _more_tension(failure: Failure) -> str:
    """What to type to pull more: twice as much, or to a strain of 5e-5."""
    threading = failure.scene.threading
    if threading is not None and failure.stage.name == THREADING:
        return f"--set threading.tension={2.0 * threading.tension:.3g}"
    if failure.plan.in_time and not failure.state.full.any():
        return f"--set stages.{failure.stage.name}.friction=false, to pull it before it rubs"
    force = failure.plan.controls.at(1.0).get("exit.force", np.zeros(3))
    stage = failure.stage.name
    if force[0] > 0.0:
        return f"--set 'stages.{stage}.exit.force={_numbers(2.0 * force)}'"
    held = failure.scene.edges.get("exit")
    if held is not None and "x" in held.fixed:
        return f"a larger x in stages.{stage}.exit.move"
    tension = 5e-5 * failure.assembly.strip.tensile_stiffness
    return f"--set 'stages.{failure.scene.stages[0].name}.exit.force=[{tension:.3g}, 0.0, 0.0]'"


def forewarned(failure: Failure) -> str | None:
    """What could be told before the run, of this stage and those before it."""
    from anmstrip.driver.warnings import (
        serious,
        walked,
    )

    plans, ways = (list(found) for found in zip(*walked(failure.assembly), strict=True))
    until = 1 + next(k for k, plan in enumerate(plans) if plan.name == failure.stage.name)
    found = serious(failure.assembly, plans[:until], ways[:until])
    return f"{found[0][0].upper()}{found[0][1:]}" if found else None


def round_off(failure: Failure) -> str | None:
    """A tolerance that the last digits of the state do not allow."""
    plan, scene = failure.plan, failure.scene
    share = RESIDUAL_SHARE if plan.in_time else 1.0
    floor = last_digit(failure.state)
    if not floor > CLEAR * share * scene.solver.tolerance:
        return None
    return (
        f"The tolerance is near round-off: the last digit of the positions is worth {floor:.1g} "
        f"of the forces. Try --set solver.tolerance={2.0 * floor / CLEAR / share:.0e}."
    )


def last_digit(state: State) -> float:
    """Imbalance, over the force scale, that a change of the last digit of the state makes."""
    plan, full = state.plan, state.full
    signs = np.where(np.arange(len(full)) % 3 == 1, -1.0, 1.0)
    moved = full * (1.0 + np.finfo(float).eps * signs)
    model, free = plan.model, plan.supports.free
    change = model.force(moved, state.velocity, state.controls) - state.imbalance
    return Equilibrium(model, plan.supports, plan.controls).imbalance(change[free])


def coarse(failure: Failure) -> str | None:
    """Elements over a roller that do not see the strip bend onto it."""
    place = failure.place
    if place is None or not place.roller or not failure.scene.strip.bending:
        return None
    layer = np.sqrt(failure.assembly.strip.bending_stiffness / failure.assembly.scales.tension)
    if not place.element > COARSE * layer:
        return None
    return (
        f"Elements of {place.element:.3g} m over roller {place.roller} are long "
        f"against √(D/T) = {layer:.3g} m. Try {_finer(failure, QUARTER * float(layer))}."
    )


def _finer(failure: Failure, length: float) -> str:
    if failure.scene.strip.mesh is not None:
        return f"a mesh with elements of {length:.2g} m there"
    return f"--set strip.refined={length:.2g}"


def stiff_friction(failure: Failure) -> str | None:
    """Friction that turns round within a speed at which the positions have no digits left."""
    friction, strip = failure.scene.friction, failure.assembly.strip
    if not failure.plan.in_time or friction is None or not failure.touched:
        return None
    seen = np.finfo(float).eps * strip.length / (SHARE * failure.plan.duration)
    turns = friction.omega * friction.speed
    if not turns < DIGITS * seen:
        return None
    return (
        f"Friction turns round within {turns:.2g} m/s, and the last digit of the positions is "
        f"worth {seen:.2g} m/s in a step of time. "
        f"Try --set friction.speed={DIGITS * seen / friction.omega:.1g}."
    )


def low_order(failure: Failure) -> str | None:
    """Series of few terms, asked for: their steps may shrink where those of more do not."""
    given, assembly = failure.scene.solver.order, failure.assembly
    size = size_of(assembly, assembly.kinematics)
    if given is None or size is None or failure.stopped.outcome is not Outcome.STALLED:
        return None
    order = cheapest_order(size, failure.scene.solver.tolerance)
    if 2 * given > order:
        return None
    return f"Series of order {given} are short. Try --set solver.order={order}."


def still_coarse(failure: Failure) -> str | None:
    """Nothing else is known, but it is at a roller, where the mesh decides."""
    place = failure.place
    if place is None or not place.roller or failure.stopped.outcome is Outcome.FOLD:
        return None
    element = min(place.element, failure.scene.strip.refined or np.inf)
    return f"Try a finer mesh over roller {place.roller}: {_finer(failure, 0.5 * element)}."


def asked_too_much(failure: Failure) -> str:
    """What the stage changes is more than the strip can follow."""
    stage = failure.stage.name
    changed = ", ".join(f"stages.{stage}.{key}" for key in _changes(failure))
    if changed:
        return f"This stage changes {changed}: try a smaller change."
    return f"Try --set stages.{stage}.duration={2.0 * failure.plan.duration:g}."


def _changes(failure: Failure) -> Iterator[str]:
    """Keys of the stage that change something in it."""
    for name, edge in failure.stage.edges.items():
        yield from (f"{name}.{key}" for key in edge.model_dump(exclude_defaults=True))
    for name, roller in failure.stage.rollers.items():
        yield from (f"rollers.{name}.{key}" for key in roller.model_dump(exclude_defaults=True))
    yield from (key for key in ("gravity", "pressure") if getattr(failure.stage, key) is not None)


def _numbers(vector: Array) -> str:
    return f"[{', '.join(f'{float(v):.4g}' for v in vector)}]"


CAUSES: tuple[Callable[[Failure], str | None], ...] = (
    too_many_steps,
    not_held,
    squeezed,
    round_off,
    forewarned,
    slack,
    coarse,
    stiff_friction,
    low_order,
    still_coarse,
    asked_too_much,
)
"""Likely causes, the surest first; the last one always has words."""
