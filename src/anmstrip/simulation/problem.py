"""From a validated scene to mechanics: mesh, effects, scales."""

from __future__ import annotations

import importlib
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.errors import InputError, Mistake
from anmstrip.fem.geometry import KINEMATICS, PLATE, SECTION, Kinematics
from anmstrip.fem.operators import InternalOperator, Layers, Pattern, upwind_differences
from anmstrip.fem.sampling import (
    ContactOperator,
    RepeatedOperator,
    SlopeOperator,
    quadrature_points,
)
from anmstrip.fem.strip import Material, Scales, Strip, renumbered
from anmstrip.mechanics.effects import Effect, LawEffect
from anmstrip.mechanics.loads import (
    Foundation,
    GrownWeight,
    Pretension,
    curled_edge_tension,
    edge_force,
    edge_moment,
    edge_tension,
    pressure,
    uneven_edge_force,
    uneven_edge_tension,
    weight,
)
from anmstrip.mechanics.plasticity import FlowLaw, Plasticity
from anmstrip.mechanics.roller import Roller, Sides, combine
from anmstrip.mechanics.shell import KirchhoffLove, Membrane, isometric_bending
from anmstrip.scene.checks import pressed_against
from anmstrip.scene.schema import RollerSpec, SceneSpec, StageSpec
from anmstrip.scene.tables import ENDS, I_UNIT, THREADING, FieldSpec, NaturalShape
from anmstrip.simulation.defaults import (
    coefficient_on,
    distributed_load,
    eigenstrain,
    fastest,
    flow_rate,
    flow_stress,
    largest_force,
    line_speed,
    load_of_moves,
    passing_speed,
    resting_speed,
    resting_stages,
    tension_of_moves,
    with_defaults,
)
from anmstrip.simulation.meshing import (
    Layout,
    Loads,
    Nip,
    carrying_sense,
    label_at,
    loads_in_stages,
    mesh_density,
)
from anmstrip.simulation.threading import Thread, thread_of
from anmstrip.taylor.series import record

if TYPE_CHECKING:
    from skfem import Mesh

    from anmstrip.equilibrium import StageProblem
    from anmstrip.mechanics.contact import Contact, Friction, PressedRollers
    from anmstrip.mechanics.laws import ContactLaw, FrictionLaw
    from anmstrip.mechanics.transport import Drives
    from anmstrip.scene.tables import ContactSpec, FrictionSpec, PlasticitySpec
    from anmstrip.simulation.growth import Growth, Hanging

GENTLE_PROFILES = {
    "crown": "crown = [0.0, -{:g}]",
    "taper": "taper = {:g}",
    "sides": "sides = {{ taper = {:g}, flat = 0.5, rounding = 0.05 }}",
}
"""Profiles, with one to type instead."""

ORDERS = range(6, 41)
"""Orders to choose from."""


@dataclass(frozen=True)
class Size:
    """Counts of a level, and the seconds that they stand for.

    The shares per count were measured on one core, from 200 to 40 000 unknowns and orders from 5
    to 40 (``examples/benchmarks/solvers.py``, ``order.py``); they matter for ratios only.

    Attributes
    ----------
    unknowns : int
    points : int
        Of quadrature and of contact.
    values : int
        Series that are followed at these points.
    band : int
        Half bandwidth of the tangent.
    """

    unknowns: int
    points: int
    values: int
    band: int

    def seconds(self, order: int) -> float:
        """Calls; series of all values, and the tangent; factorisation; back-substitutions."""
        calls = 3e-3 + 2e-4 * order
        series = (8e-7 + 3.5e-8 * order + 1e-9 * order**2) * self.values
        factorisation = (2e-6 + 3e-8 * self.band) * self.unknowns
        solves = (1e-7 + 1e-9 * self.band) * self.unknowns * order
        return calls + series + factorisation + solves


def cheapest_order(size: Size, tolerance: float) -> int:
    """Order with the least seconds per length of path."""
    return min(ORDERS, key=lambda n: size.seconds(n) * tolerance ** (-1.0 / (n + 1)))


def size_of(assembly: Assembly, level: Kinematics) -> Size:
    """Counts of a level on the scene's own lines of nodes."""
    strip = assembly.strip
    lines = len(np.unique(np.round(strip.mesh.p[0] / strip.length, 9)))
    if level is SECTION:
        scalars, quadrature, touched = 2 * lines, 4 * (lines - 1), 2 * lines - 1
    elif assembly.kinematics is not SECTION:
        scalars, quadrature = strip.scalars, strip.basis.dx.size
        touched = 4 * strip.mesh.nelements
    else:
        across = len(assembly.layout.lines_across) - 1
        scalars, quadrature = 4 * lines * (across + 1), 16 * (lines - 1) * across
        touched = (2 * lines - 1) * (2 * across + 1)
    rubbed = 2 if assembly.scene.friction is not None and level is not PLATE else 1
    touched *= 0 if assembly.scene.contact is None or not assembly.rollers else rubbed
    m, per_line = level.count, scalars / lines
    values = m * (level.directions * quadrature + touched)
    return Size(m * scalars, quadrature + touched, values, int(m * (per_line + 8)))


EffectMaker = Callable[[Strip], Effect]

NIP_HOLD = 0.7
"""Friction of a nip by its force on straight strip, over the tension, from which on it is taken to
hold the strip: one that holds 1 840 of 2 000 N/m brings strip into a loop that keeps 180."""

MIN_ONSET_ELEMENT = 0.5
"""Share of the usual length of elements over rollers that the onset of contact counts with at
least: arcs that are shorter are single elements, with longer ones beside them that touch as well.
With 0 a leveller of nine rollers takes 330 tangents instead of 119."""

LYING_ONSET = 0.5
"""Onset of contact over the depth by which strip that lies on threaded rollers may sink: between
the least and the most loaded of them it sinks by some 1.5 onsets."""

ONSET_STRETCH = 0.01
"""Stretch that the onset of contact may make, over the elastic one."""

CURL_ONSET = 0.02
"""Onset of contact over the lift of edges that curl off rollers of one drive.  With 0.1 the tension
between two bridle rolls is 1 % lower than with 0.02, with 0.005 0.3 %."""

AIR_DRAG = 1e-14
"""Drag on a free roller at V_c, over the force scale: at the speed of a line, which is some 1e5
times V_c, a billionth of the strip's tension; and the one thing that holds an untouched roller."""

FLOATING_SHARE = 0.05
"""Share of its thickness by which a strip that only its weight presses may float: a tenth of the
half by which its middle is nearer to the roller than its face, which is not modelled."""

ESTIMATE_TANGENTS = 6.0
"""Tangents on elements of half the length of an estimate of the errors by the mesh: of seven
examples 2 to 5, of wide film on a roller out of line 13 to 19."""

DEFAULT_LAYERS = {"section": 21, "shell": 11}
"""Layers through the thickness unless the scene says: moments to 0.2 % and to 1 % of M_e; those
of a shell are most of its work."""

MAX_HALVED_UNKNOWNS = 100_000
"""On elements of half the length, beyond which the mesh's part is not looked for: the factors of a
shell of so many, twenty elements across, take 1.5 GB."""

FAINT_PRESSURE = 1e-4
"""Share of the pressure T/r of a wrapped strip below which there is no friction.

The regularised pressure never ends, but points without weight would shorten every
step: their friction is as singular as that of the others.
"""


BUILT_IN_EFFECTS = ("membrane", "bending", "plasticity", "contact", "press", "friction", "drives")
"""Effects that are asked for by their names when a state is read."""


class Weighing(StageSpec):
    """Stage that puts weight on a strip that has been threaded, before it runs and yields."""


@dataclass(eq=False, repr=False)
class Assembly:
    """A scene's strip and what can act on it.

    Parameters
    ----------
    scene : SceneSpec
        What it leaves open is filled in, see :mod:`anmstrip.simulation.defaults`.
    imperfection : ndarray, shape (unknowns,), optional
        Displacement of the flat strip that makes no stress, see
        :mod:`anmstrip.simulation.march`.
    added : tuple of callables
        Effects of the user's own beside those of the scene, each made from the strip.

    Attributes
    ----------
    material : Material
        Of the strip.
    kinematics : Kinematics
        Level of kinematics: the displacements that are unknown.
    specs : dict
        Roller → its table in the scene.
    turning : tuple of str
        Rollers whose speed is unknown: those that a torque or the strip turns.
    pressing : tuple of str
        Rollers whose place is unknown: those that a given force presses on the strip.
    closed : bool
        Whether the strip is endless.
    conveyed : bool
        Whether the strip has a speed of its own: it is fed, or there are steady stages.

    Raises
    ------
    InputError
        Mesh file unreadable, edges unknown, a roller inside the strip.
    """

    scene: SceneSpec
    imperfection: Array | None = None
    added: tuple[EffectMaker, ...] = ()
    _plastic: dict[tuple[bool, float | None], Plasticity] = field(default_factory=dict, init=False)
    """Plastic strains so far made, by whether they grow, and the strip's speed (m/s)."""

    def __post_init__(self) -> None:
        self.scene = scene = with_defaults(self.scene)
        m, course = scene.material, scene.threading
        self.material = Material(m.young, m.poisson, m.density or 0.0, m.expansion or 0.0)
        self.kinematics = KINEMATICS[scene.strip.kinematics]
        self.specs = {spec.name: spec for spec in scene.rollers}
        self.turning = tuple(spec.name for spec in scene.rollers if spec.drive != "speed")
        self.pressing = tuple(spec.name for spec in scene.rollers if spec.press is not None)
        self.closed = course is not None and course.closed
        self.conveyed = bool(scene.strip.feed) or any(stage.steady for stage in scene.stages)

    @cached_property
    def origin(self) -> Array:
        """Local origin (m), from which positions in space count, shape (3,).

        Far from its origin a scene would lose the last digits of its lengths.  Results are
        written in the scene's own coordinates again.
        """
        spec = self.scene.threading
        if spec is None:
            return np.append(self.flat_origin, 0.0)
        ends = [place for place in (spec.entry, spec.exit) if place is not None]
        wrapped = [roller.centre for roller in self.scene.rollers if roller.wrap is not None]
        x, _, z = local_origin(np.transpose([*ends, *wrapped]))
        return np.array([x, 0.0, z])  # the middle of the strip runs in the plane y = 0

    @cached_property
    def flat_origin(self) -> Array:
        """Local origin (m) from which points of the flat strip count, shape (2,).

        A threaded strip keeps its y: its middle runs in the plane y = 0.
        """
        if self.scene.strip.mesh is None:
            return np.zeros(2)
        origin = local_origin(self.mesh_of_file.p)
        return origin if self.scene.threading is None else origin * [1.0, 0.0]

    @cached_property
    def mesh_of_file(self) -> Mesh:
        """Mesh of the scene's file, in its own coordinates."""
        from anmstrip.scene.mesh_file import read_mesh

        return read_mesh(self.scene)

    @cached_property
    def rollers(self) -> tuple[Roller, ...]:
        """Geometry of the rollers; those of a threaded strip carry it at positive speeds."""
        rollers = rollers_of(self.scene, self.origin, self.faces)
        if self.thread is None:
            return rollers
        return tuple(replace(r, sense=carrying_sense(r, self.thread)) for r in rollers)

    @cached_property
    def driven(self) -> tuple[Roller, ...]:
        """Rollers whose speed is given: all that do not turn freely."""
        return tuple(roller for roller in self.rollers if roller.name not in self.turning)

    @property
    def coupled(self) -> int:
        """Number of unknowns of the strip, of rollers, and of the strip's speed."""
        return self.strip.unknowns + len(self.turning) + len(self.pressing) + self.conveyed

    @property
    def unknowns(self) -> int:
        """Number of all unknowns: these, and the plastic strains."""
        strains = self.plastic_strains(grow=False)
        return self.coupled + (0 if strains is None else len(strains.units))

    @cached_property
    def order(self) -> int:
        """Order of the series: the scene's, or the cheapest."""
        if self.scene.solver.order is not None:
            return self.scene.solver.order
        return cheapest_order(size_of(self, self.kinematics), self.scene.solver.tolerance)

    def input(self) -> dict[str, Any]:
        """Return the scene as it is run, with what the mesh and the machine decide; JSON-ready."""
        found = self.scene.to_dict()
        found["solver"]["order"] = self.order
        given = self.scene.contact if self.scene.rollers else None
        if given is not None and given.law is None and given.constants is None:
            law: Any = self.signorini
            found["contact"] |= {"pressure": law.pressure, "onset": law.width}
        if (p := self.scene.material.plasticity) is not None and p.reference_rate is None:
            found["material"]["plasticity"]["reference_rate"] = self.usual_rate
        return found

    @cached_property
    def faces(self) -> bool:
        """Whether rollers touch the faces of the strip: as typed, or as those of nips are drawn.

        Two that leave half of its thickness or more between them do not touch its mid-surface, nor
        does the lower one of pinch rolls whose top stands at the lower face of straight strip.
        """
        scene, contact = self.scene, self.scene.contact
        if contact is None or contact.faces is not None or len(scene.rollers) < 2:
            return contact is not None and bool(contact.faces)
        rollers, room = rollers_of(scene, self.origin, False), 0.5 * scene.strip.thickness
        wrapped = {r.name for r in scene.rollers if r.wrap}
        try:
            layout = Layout(scene, rollers, self._thread(rollers))
        except InputError:
            if len(wrapped) < len(rollers):
                with suppress(InputError):
                    return self._thread(rollers_of(scene, self.origin, True)) is not None
            raise
        found = {nip.names for nips in layout.nips for nip in nips if nip.gap >= room}
        return any(not wrapped.issuperset(names) for names in found)

    @cached_property
    def thread(self) -> Thread | None:
        """Path of a threaded strip around its rollers."""
        return self._thread(rollers_of(self.scene, self.origin, self.faces))

    def _thread(self, rollers: Sequence[Roller]) -> Thread | None:
        """Return the same around rollers that touch its faces or not."""
        if self.scene.threading is None:
            return None
        length = self.scene.strip.length
        if self.scene.strip.mesh is not None:
            length = float(np.ptp(self.mesh_of_file.p[0]))
        return thread_of(self.scene, rollers, self.origin, length)

    @cached_property
    def layout(self) -> Layout:
        """Rollers and the way of the strip past them, by which the mesh is chosen."""
        return Layout(self.scene, self.rollers, self.thread)

    @cached_property
    def laid(self) -> Array:
        """Displacements of a threaded strip before equilibrium, shape (unknowns,)."""
        assert self.thread is not None
        guess = self.thread.guess(self.strip, self.pattern, self.natural(self.scene.strip))
        found = np.zeros(self.unknowns)
        found[: len(guess)] = guess
        if (pressed := self.pressed) is not None:
            squeezes = {name: nip.squeeze for nip in self.nips[0] for name in nip.names}
            found[pressed.first : pressed.stop] = [squeezes[name] for name in pressed.names]
        return found

    @cached_property
    def growth(self) -> Growth | None:
        """The strip that runs take up, where labels follow rollers, or stay on them."""
        if not self.layout.follows:
            return None
        from anmstrip.simulation.growth import Growth

        return Growth.of(self.layout, np.unique(self.strip.mesh.p[0]))

    def gathered_in(self, stage: StageSpec) -> tuple[Array, Array]:
        """Return what :meth:`Layout.gathered_in` does, nothing where a nip lets the strip slip."""
        held, bent = self.layout.gathered_in(stage)
        return (0.0 * held, 0.0 * bent) if self.slipping_nips else (held, bent)

    @cached_property
    def slipping_nips(self) -> list[Nip]:
        """Nips that would push strip into a run or take it away, but do not hold its tension."""
        found, thread = dict[tuple[str, str], Nip](), self.thread
        for stage, nips in zip(self.scene.stages, self.nips[1:], strict=True):
            held, bent = self.layout.gathered_in(stage)
            runs = np.flatnonzero(held + abs(bent)).tolist()
            if not runs or thread is None:
                continue
            beside = {thread.rollers[k].name for run in runs for k in (run - 1, run)}
            for nip in (nip for nip in nips if not beside.isdisjoint(nip.names)):
                friction = self.driven_friction(nip) * nip.line_load(self.signorini)
                if friction < NIP_HOLD * self.scales.tension:
                    found[nip.names] = nip
        return [*found.values()]

    def driven_friction(self, nip: Nip) -> float:
        """Return the sum of the friction coefficients of those of its rollers that are driven."""
        driven = (self.specs[name] for name in nip.names if name not in self.turning)
        return sum(coefficient_on(self.scene, spec) for spec in driven)

    @property
    def sways(self) -> bool:
        """Whether the ends of fed strip have speeds of their own: runs take strip up, or give off.

        By rollers that move, those without a wrap too, or by weight, tension or heat.
        """
        fed = self.thread is not None and bool(self.scene.strip.feed)
        return self.growth is not None or (fed and any(s.moves for s in self.scene.stages))

    @cached_property
    def loads(self) -> dict[str, Loads]:
        """Stage → what a threaded strip is pulled with at its end."""
        names = (stage.name for stage in self.scene.stages)
        return dict(zip(names, loads_in_stages(self.scene), strict=True))

    def loads_of(self, stage: StageSpec) -> Loads | None:
        """Loads of a threaded strip at the end of a stage, also of one of a map."""
        if stage.name == THREADING:
            return None
        if (known := self.loads.get(stage.name)) is None:
            *_, known = loads_in_stages(self.scene, stage)
        return known

    def hanging(self, plan: StageProblem) -> Hanging | None:
        """The labels that follow strip hanging between its rollers at the end of a stage."""
        if self.growth is None or (loads := self.loads.get(plan.name)) is None:
            return None
        from anmstrip.simulation.growth import Hanging

        controls = plan.controls.at(1.0)
        centres = {r.name: controls[f"rollers.{r.name}.centre"] for r in self.rollers}
        size = float(np.linalg.norm(controls.get("gravity", 0.0)))
        strip = self.strip
        return Hanging(self.growth, centres, loads, size, strip.thickness, strip.width)

    @cached_property
    def strip(self) -> Strip:
        """Mesh and basis."""
        spec = self.scene.strip
        if spec.mesh is None:
            mesh = self.layout.mesh
        else:
            mesh = renumbered(self.mesh_of_file.translated(-self.flat_origin))
        strip = Strip(mesh, spec.thickness, self.material, self.kinematics, spec.width or 1.0)
        strip.origin, strip.flat_origin = self.origin, self.flat_origin
        strip.contact_parts = self.layout.contact_parts
        check_geometry(self.scene, strip, self.rollers)
        return strip

    @cached_property
    def pattern(self) -> Pattern:
        """Sparsity pattern of the tangent."""
        return Pattern(self.strip)

    def natural(self, shape: NaturalShape) -> dict[str, Array]:
        """Return controls of eigenstrain and eigencurvature, see :mod:`anmstrip.mechanics.shell`.

        Fields are values at the quadrature points, shape (points,).
        """
        strip, found = self.strip, {}
        for key, given in shape.natural.items():
            if key in ("coil_set", "crossbow"):
                found[f"strip.{key}"] = np.array(given)
                continue
            x, y, _ = quadrature_points(strip)
            right, left = strip.nodes[1].min(), strip.nodes[1].max()
            y = y - 0.5 * (right + left)
            if isinstance(given, FieldSpec):
                unit = 1.0 if key == "temperature" else I_UNIT
                values = unit * given.at(y / strip.width, x - strip.nodes[0].min())
            else:
                values = -given * y
            found[f"strip.{key}"] = np.broadcast_to(values, y.shape).copy()
        material = self.scene.material
        tables = {"softening": material.young_at, "weakening": material.yield_stress_at}
        for name, table in tables.items() if "strip.temperature" in found else ():
            if table:
                share = np.interp(found["strip.temperature"], *np.transpose(table))
                found[f"strip.{name}"] = 1.0 - share
        return found

    @cached_property
    def membrane(self) -> Membrane | None:
        """Membrane of all but a plate, which has a given tension instead."""
        return None if self.kinematics is PLATE else Membrane(self.strip, self.imperfection)

    @cached_property
    def bending(self) -> Effect | None:
        """If the strip resists it; a plate's slopes are small, for which all energies agree.

        Curvature without moments turns with the strip, as Kirchhoff and Love have it.
        """
        spec = self.scene.strip
        if not spec.bending:
            return None
        turns = spec.bending == "kirchhoff-love" or spec.imperfection is not None
        turns = turns or bool(self.scene.material.plasticity or self.scene.material.young_at)
        turns = turns or not naturals(self.scene).isdisjoint(("coil_set", "crossbow"))
        turns = turns or self.growth is not None  # the other one counts along labels
        if turns and self.kinematics is not PLATE:
            return KirchhoffLove(self.strip, self.imperfection)
        return isometric_bending(self.strip, self.pattern)

    @property
    def can_halve(self) -> bool:
        """Whether elements of half the length are few enough, of strip whose flow is known there.

        Layers that flow are taken to the finer mesh of a section, and in a stationary state, whose
        past is all upstream; in time it would be that of every point.
        """
        few = int(2 ** self.strip.mesh.dim()) * self.coupled <= MAX_HALVED_UNKNOWNS
        steady = self.kinematics is SECTION and self.scene.stages[-1].steady
        return few and (self.flow is None or steady)

    @property
    def estimate_seconds(self) -> float:
        """Time (s) that an estimate of the errors by the mesh takes."""
        size, parts = size_of(self, self.kinematics), int(2 ** self.strip.mesh.dim())
        unknowns, points, values = (parts * n for n in (size.unknowns, size.points, size.values))
        finer = Size(unknowns, points, values, parts // 2 * size.band)
        return ESTIMATE_TANGENTS * finer.seconds(self.order)

    @cached_property
    def usual_rate(self) -> float:
        """Rate (1/s) at which strip that can yield flows, of a scene that gives none."""
        return flow_rate(self.scene, {} if self.thread is None else self.thread.turns)

    @cached_property
    def flow(self) -> FlowLaw | None:
        """Flow law of the scene's material, if it yields.

        A section flows in plane strain, beginning at 2/√3 of the yield stress (Hill, The
        Mathematical Theory of Plasticity, ch. IV), and hardens 4/3 times as much.
        """
        m = self.scene.material
        if m.plasticity is None or m.yield_stress is None:
            return None
        p = m.plasticity
        free = p.uniaxial or self.kinematics is not SECTION
        held = 1.0 if free else 2.0 / np.sqrt(3.0)
        given: dict[str, Any] = {
            "yield_stress": held * m.yield_stress,
            "exponent": p.exponent,
            "rate": p.reference_rate or self.usual_rate,
            "isotropic": held**2 * p.isotropic_hardening,
            "kinematic": held**2 * p.kinematic_hardening,
            "equivalent": 1.0 / held,
        }
        if p.law is not None:
            return own_law(self.scene, "material.plasticity", p, FlowLaw, given)
        return FlowLaw(**given)

    def plastic_strains(self, grow: bool, speed: float | None = None) -> Plasticity | None:
        """Return plastic strains that are frozen, or grow: in time, or at a speed along the strip.

        Parameters
        ----------
        grow : bool
        speed : float, optional
            Of the strip in a stationary state (m/s).
        """
        flow, p, key = self.flow, self.scene.material.plasticity, (grow, speed)
        if flow is None or p is None:
            return None
        if key not in self._plastic:
            assert self.membrane is not None and isinstance(self.bending, KirchhoffLove)
            count = p.layers or DEFAULT_LAYERS[self.scene.strip.kinematics]
            layers = Layers.of(self.strip.thickness, count)
            variables, slopes = flow.variables(self.kinematics.directions), None
            if speed is not None:
                flow, slopes = replace(flow, rate=flow.rate / speed), upwind_differences(self.strip)
            given = self.bending.operator, self.coupled, variables, layers, slopes, grow
            operator = InternalOperator(*given)
            self._plastic[key] = Plasticity(self.membrane, self.bending, flow, operator)
        return self._plastic[key]

    def plasticity(self, stage: StageSpec) -> Plasticity | None:
        """Return plastic strains as they grow in a stage, if the material yields.

        In a stationary state at its speed at the stage's end.  A rate that is guessed is that of
        the fastest speed, and grows with it.
        """
        p, speed = self.scene.material.plasticity, None
        if p is not None and stage.steady and self.yields(stage):
            given = p.reference_rate and passing_speed(self.scene, stage)
            speed = given or fastest(self.scene) or 1.0
        return self.plastic_strains(self.yields(stage), speed)

    @cached_property
    def contact_operator(self) -> ContactOperator:
        """Operator to the contact points."""
        return ContactOperator(self.strip)

    @cached_property
    def friction(self) -> FrictionLaw | None:
        """The scene's friction law."""
        f = self.scene.friction
        if f is None:
            return None
        from anmstrip.mechanics.laws import Algebraic, FrictionLaw, NortonHoff, Tanh

        given = f.model_dump(include={"coefficient", "exponent", "omega", "speed"})
        if ":" in f.law:
            return own_law(self.scene, "friction", f, FrictionLaw, given)
        law = {"norton-hoff": NortonHoff, "tanh": Tanh, "algebraic": Algebraic}[f.law]
        return law(**{field.name: given[field.name] for field in fields(law)})

    @cached_property
    def contact(self) -> Contact | None:
        """Normal contact with all rollers, if the scene has contact.

        It reaches a radius far: a strip that comes near is felt long before it
        could pass through a roller within one step.
        """
        return self._contact([roller.radius for roller in self.rollers])

    @cached_property
    def laid_points(self) -> tuple[Array, Array]:
        """Places (m) of contact points where the strip is laid, (3, n), and their areas (m²)."""
        operator, moved = self.contact_operator, np.zeros(self.strip.unknowns)
        if self.thread is not None:
            moved = self.thread.laid(self.strip, self.pattern)
        displacement = self.strip.kinematics.embed(operator.apply(moved))
        return operator.reference + displacement, operator.weights

    @cached_property
    def rubbing(self) -> Friction | None:
        """Friction on all rollers, if the scene has it."""
        law = self.friction
        if law is None or self.contact is None:
            return None
        faint = [FAINT_PRESSURE * self.scales.tension / roller.radius for roller in self.rollers]
        contact = self._contact([float(self.signorini.gap(pressure)) for pressure in faint])
        assert contact is not None
        from anmstrip.mechanics.contact import Friction

        own = [spec.friction for spec in self.scene.rollers]
        coefficients = None
        if any(f is not None for f in own):
            coefficients = [law.coefficient if f is None else f for f in own]
        if not self.turning:
            return Friction(contact, law, coefficients)
        from anmstrip.mechanics.transport import TurningFriction

        return TurningFriction(contact, law, coefficients, self._numbers, len(self.turning))

    @property
    def _numbers(self) -> list[int]:
        """Number of each roller's own unknown, or ``DRIVEN``."""
        from anmstrip.mechanics.transport import DRIVEN

        numbers = {name: number for number, name in enumerate(self.turning)}
        return [numbers.get(roller.name, DRIVEN) for roller in self.rollers]

    def law_of_slip(self, stage: StageSpec) -> FrictionLaw | None:
        """Friction law in a stage: with a V_c of its own where the line stands after it has run."""
        spec = self.scene.friction
        if self.friction is None or spec is None or stage.name not in resting_stages(self.scene):
            return self.friction
        assert spec.speed is not None
        speed = spec.speed_at_rest or min(spec.speed, resting_speed(self.scene, stage))
        return self.friction.sharper(1.0 - speed / spec.speed)

    def drives(self, stage: StageSpec) -> Drives | None:
        """Torques and bearings of the rollers that turn freely in a stage, if there are any."""
        if not self.turning or (law := self.law_of_slip(stage)) is None:
            return None
        from anmstrip.mechanics.transport import Drives, SteadyDrives

        chosen = [spec for spec in self.scene.rollers if spec.name in self.turning]
        radii = np.array([spec.radius for spec in chosen])
        turned = [s.drive == "torque" or coefficient_on(self.scene, s) > 0.0 for s in chosen]
        bearings = np.array([s.bearing for s in chosen]) * turned  # nothing turns the others
        drag = AIR_DRAG * self.scales.force / law.speed
        given = self.turning, radii, bearings, law.speed, drag, self.strip.unknowns
        return SteadyDrives(*given) if stage.steady else Drives(*given)

    def friction_in(self, stage: StageSpec) -> Friction | None:
        """Friction in a stage: of strip that moves through its own shape, or lies on its rollers.

        A strip that nothing pulls is aligned with all that moves it.
        """
        if self.rubbing is None or (law := self.law_of_slip(stage)) is None:
            return None
        rubbing = replace(self.rubbing, law_of_slip=law)
        through = stage.steady or self.scene.strip.feed
        if not (through or largest_force(self.scene) == 0.0):
            return rubbing
        from anmstrip.mechanics.transport import AlignedFriction, CarriedFriction, SteadyFriction

        kind = CarriedFriction if through else AlignedFriction
        kind = SteadyFriction if stage.steady else kind
        given = rubbing.contact, law, rubbing.coefficients, self._numbers
        grown = self.grown_at_contact if through else ()
        return kind(*given, len(self.turning), self.slope_operator, *grown)

    @cached_property
    def grown_at_contact(self) -> tuple[Array, ...]:
        """Strip that labels of contact points and rollers hold, as ``CarriedFriction`` takes it."""
        if (growth := self.growth) is None:
            return ()
        places = self.slope_operator.reference[0]
        labels = np.array([label_at(roller, growth.thread) for roller in self.rollers])
        runs = np.eye(growth.shapes.shape[1])
        shapes = [growth.at(places, run) - 1.0 for run in runs]
        passed, drifts = ([growth.up_to(x, run) for run in runs] for x in (places, labels))
        return np.array(shapes), np.array(passed), np.array(drifts)

    @cached_property
    def slope_operator(self) -> SlopeOperator:
        """Values and slopes at all contact points."""
        return SlopeOperator(self.strip)

    def passage(self, edge: str, direction: Array, held: bool) -> Effect:
        """Condition for the length of strip that has passed an end, see ``Passage``."""
        from anmstrip.mechanics.transport import Passage

        stiffness = self.strip.tensile_stiffness * self.strip.width / line_speed(self.scene)
        grown = None
        if self.growth is not None:
            grown = self.growth.shapes[[0 if edge == "entry" else -1]].T
        return Passage(self.strip, edge, direction, held, stiffness, self.coupled, grown)

    @cached_property
    def signorini(self) -> ContactLaw:
        """The scene's contact law.

        Left open, it is graded: p₀ is the pressure of the taut strip on its rollers, or its
        weight or the pressure on it if that is more.  Flat strip bears it, and rollers
        that bend it, on lines, where it would sink by several onsets else.  The onset is
        the gap that a straight strip has half a spacing of contact points beyond where it lifts
        off.  It is that at a whole spacing where elements have several parts: the load of a roller
        then does not change by 17 %, but by 1e-4, as points pass it, and a plate takes half as many
        tangents.  Where only weight or pressure presses, q, the strip floats w log(p₀/q) high,
        which must be a small share of its thickness.  Where rollers press with given forces they do
        so over an element, see ``Layout.nip_onset``.  Where tension varies across, by rollers, heat
        or flatness, a gap stretches fibres by its share of the radius, which must not be seen
        beside T/(E t), nor beside the lift of edges that curl, see ``Layout.curling``.  A belt is
        as long as on its rollers if that pressure is by the mean of log(r) over its wraps.
        """
        c = self.scene.contact
        assert c is not None
        from anmstrip.mechanics.laws import ContactLaw, GradedSignorini, RepulsiveSignorini

        if c.law is not None:
            return own_law(self.scene, "contact", c, ContactLaw, {})
        if c.constants is not None:
            return RepulsiveSignorini(*c.constants)
        tension = largest_force(self.scene) or tension_of_moves(self.scene)
        thickness = self.strip.thickness
        turns, thread = np.ones(len(self.rollers)), self.thread
        if thread is not None and self.closed:
            turns = np.abs([thread.turns.get(roller.name, 0.0) for roller in self.rollers])
        logarithms = np.log([roller.radius for roller in self.rollers])
        radius = float(np.exp(np.average(logarithms, weights=turns)))
        load = distributed_load(self.scene)
        if tension == load == 0.0:
            tension = self.scales.tension
        pressure = c.pressure or max(tension / radius, load)
        element, nips = float(self.strip.cell_sizes[0].min()), False
        if self.scene.strip.cells is None and self.scene.strip.mesh is None:
            usual = self.layout.shortest_wanted
            if nips := bool(self.layout.nipping):
                element = usual  # on any mesh: the law makes the force of a gap
            element = max(element, MIN_ONSET_ELEMENT * usual / mesh_density(self.scene))
        parts = 1 if nips else self.strip.contact_parts
        apart = 0.5 * element / parts  # two points to a part
        onset = (apart if parts > 1 else 0.5 * apart) ** 2 / (2.0 * radius)
        onset = max(onset, self.layout.nip_onset)
        if c.pressure is None and not nips:
            line = self._line_load(load) / float(np.sqrt(2.0 * np.pi * radius * onset))
            pressure = max(pressure, line)
        if load:
            onsets = max(1.0, float(np.log(pressure / load)))
            onset = min(onset, FLOATING_SHARE * thickness / onsets)
        if self.thread is not None:
            onset = min(onset, LYING_ONSET * float(self.layout.deepest_bearing.min()))
        if tension and self.kinematics.count == 3 and fibres_differ(self.scene):
            stretch = tension / (self.material.young * thickness)
            onset = min(onset, ONSET_STRETCH * stretch * radius * self._spread())
        lifts = [curl.lift for curl, _ in self.layout.curling.values()]
        if self.kinematics.count == 3:
            onset = min([onset, *(CURL_ONSET * lift for lift in lifts)])
        return GradedSignorini(pressure, c.onset or onset)

    def _line_load(self, load: float) -> float:
        """Return the largest load (N/m) that strip bears on lines along rollers, 0 if it wraps one.

        On flat strip that is the share of one roller in the load (Pa), or what bends the strip.
        Threaded strip that turns by θ between runs a and b bears (T + 3 D/ab) θ, and wraps the
        roller where r θ is above twice √(D/T) or (a + b)/6, over which tension and neighbours bend
        it.
        """
        if self.thread is None:
            below = sum(roller.centre[2] < 0.0 for roller in self.rollers)
            line = load * self.strip.length / max(below, len(self.rollers) - below)
            return max(line, load_of_moves(self.scene))
        path, rollers = self.thread.middle, self.thread.rollers
        turns, runs = path.arcs.turn[:, 0], np.diff(path.starts[:, 0])[::2]
        before, after, radii = runs[:-1], runs[1:], np.array([roller.radius for roller in rollers])
        reach = np.minimum(self.thread.layer, (before + after) / 6.0)
        if self.closed or np.any(radii * turns > 2.0 * reach):
            return 0.0
        stiffened = self.thread.tension + 3.0 * self.strip.bending_stiffness / (before * after)
        return float((stiffened * turns).max(initial=0.0))

    def _spread(self) -> float:
        """Width over the longest arc of uneven strip on cylinders, at least 1.

        What differs between fibres on a short arc spreads along over a width; on strip that touches
        its rollers along lines nothing does.
        """
        if self.thread is None or any(map(varies_across, self.scene.rollers)):
            return 1.0
        longest = max((end - start for start, end in self.thread.arcs.values()), default=np.inf)
        return max(1.0, self.strip.width / longest) if longest > 0.0 else np.inf

    def _contact(self, reaches: list[float]) -> Contact | None:
        """Contact of every point with every roller, up to the given gaps."""
        if self.scene.contact is None or not self.rollers:
            return None
        from anmstrip.mechanics.contact import Contact

        pairs, count = self.contact_operator, len(self.rollers)
        roller = combine(self.rollers, np.repeat(np.arange(count), pairs.points))
        if count > 1:
            pairs = RepeatedOperator(pairs, count)
        given = self.signorini, pairs, tuple(reaches), self.kinematics
        return Contact(roller, *given, self.pressed)

    @cached_property
    def pressed(self) -> PressedRollers | None:
        """Rollers that given forces press on the strip, if there are any."""
        if not self.pressing:
            return None
        from anmstrip.mechanics.contact import PressedRollers

        first, ways = self.strip.unknowns + len(self.turning), []
        for name in self.pressing:
            spec = self.specs[name]
            partner = pressed_against(self.scene.rollers, spec)
            assert partner is not None
            ways.append(partner.way)
            if {name, partner.name} not in [{*nip.names} for nip in self.layout.nips[0]]:
                expected = f"strip that runs between {name} and {partner.name}, where it presses"
                hint = f"no press of {name}, or another rollers.{name}.centre"
                raise self.scene.refused(f"rollers.{name}.press", spec.press, expected, hint)
        return PressedRollers(self.pressing, np.array(ways), first)

    @cached_property
    def nips(self) -> list[list[Nip]]:
        """Nips at the beginning and at the end of each stage.

        Those that a force presses are as close as straight strip bears it.
        """
        found, presses = list[list[Nip]](), {s.name: s.press for s in self.scene.rollers if s.press}
        for stage, nips in zip([None, *self.scene.stages], self.layout.nips, strict=True):
            controls = {} if stage is None else stage.rollers
            presses |= {name: c.press for name, c in controls.items() if c.press is not None}
            forces = [sum(presses.get(name, 0.0) for name in nip.names) for nip in nips]
            pairs = zip(nips, forces, strict=True)
            found.append([self._pressed(nip, force) if force else nip for nip, force in pairs])
        return found

    def _pressed(self, nip: Nip, force: float) -> Nip:
        """Return a nip as close as straight strip bears a force (N)."""
        return nip.pressed(force, self.signorini, self.strip.width)

    def begun_press(self, name: str) -> float:
        """Return the force (N) with which a roller that is pressed begins.

        On flat strip that of one that has not shifted yet.
        """
        press = self.specs[name].press
        assert press is not None
        if self.thread is not None:
            return press
        nips = (nip for nip in self.layout.nips[0] if name in nip.names)
        return sum(nip.line_load(self.signorini) for nip in nips) * self.strip.width

    def effects(self, stage: StageSpec, controls: Iterable[str]) -> list[Effect]:
        """Return the effects that act in a stage.

        Parameters
        ----------
        stage : StageSpec
        controls : iterable of str
            Names of the controls that are given, now or before.
        """
        given = sorted(controls)
        own = [self.membrane, self.bending, self.plasticity(stage), self.contact, self.pressed]
        if self.membrane is None and "exit.force" in given:
            own.insert(0, Pretension(self.strip))
        if stage.friction:
            own.append(self.friction_in(stage))
            own.append(self.drives(stage))
        if (stiffness := self.scene.strip.foundation) is not None:
            own.append(Foundation(self.strip, stiffness))
        effects: list[Effect] = [effect for effect in own if effect is not None]
        makers = {"force": edge_force, "tension": edge_tension, "moment": edge_moment}
        makers["uneven_force"] = uneven_edge_force
        laid = self.thread.ends_in_space(self.strip)[2:] if self.thread else ()
        outward = dict(zip(ENDS, laid, strict=False))
        for control in given:
            edge, _, kind = control.rpartition(".")
            curls = {"strip.coil_set", "strip.crossbow", f"{edge}.moment"}
            curled = kind == "tension" and self.bending and curls & set(given)
            if curled and edge in outward:
                effects.append(curled_edge_tension(self.strip, edge, outward[edge]))
            elif kind == "unevenness" and edge in outward:
                ended = self.strip, edge, outward[edge], self.scales.tension
                effects.append(uneven_edge_tension(*ended))
            elif kind in makers:
                effects.append(makers[kind](self.strip, edge))
            elif kind == "gravity":
                effects.append((weight if self.growth is None else GrownWeight)(self.strip))
            elif kind == "pressure":
                effects.append(pressure(self.strip))
        rates = stage.friction and not stage.steady
        return effects + [e for e in self.added_effects if rates or not e.rate_dependent]

    @cached_property
    def added_effects(self) -> list[LawEffect]:
        """Effects of the user's own, which have names of their own."""
        made, taken = list[LawEffect](), set(BUILT_IN_EFFECTS)
        for make in self.added:
            expected = "functions of the strip, each of which returns an effect"
            hint = "lambda strip: Mine(strip)"
            if not callable(make):
                raise self.scene.refused("effects", repr(make), expected, hint)
            try:
                signature(make).bind(self.strip)
            except TypeError as error:
                raise self.scene.refused("effects", str(error), expected, hint) from error
            effect = make(self.strip)
            name = getattr(effect, "name", None)
            if not isinstance(effect, LawEffect) or name in taken or not isinstance(name, str):
                expected = "an anmstrip.LawEffect with a name that no other effect has"
                hint = 'name = "my_effect"'
                raise self.scene.refused("effects", name or repr(effect), expected, hint)
            taken.add(name)
            made.append(effect)
        return made

    def check_added(self, stage: StageSpec, controls: Mapping[str, Array]) -> None:
        """Try the laws of effects of the user's own, at points of the flat strip at rest.

        Raises
        ------
        InputError
            One does not work on arrays and series, or returns something else than forces.
        """
        for effect in self.added_effects:
            if effect.rate_dependent and not stage.friction:
                continue
            if wrong := wrong_effect(effect, self.strip.unknowns, controls):
                hint = "def law(self, x, v, controls): return …"
                raise self.scene.refused("effects", effect.name, wrong, hint)

    def yields(self, stage: StageSpec) -> bool:
        """Whether plastic strains grow in a stage; a strip is threaded as an elastic one."""
        laid = stage.name == THREADING or isinstance(stage, Weighing)
        return self.scene.material.plasticity is not None and not laid

    def frictional(self, stage: StageSpec) -> bool:
        """Whether friction, flow, or an effect like them, acts in a stage: it runs in time."""
        return self.rubs(stage) or (self.yields(stage) and not stage.steady)

    def rubs(self, stage: StageSpec) -> bool:
        """Whether friction, or an effect of the user's like it, acts in a stage in time."""
        rubs = self.friction is not None and bool(self.rollers)
        rates = stage.friction and not stage.steady
        return rates and (rubs or any(e.rate_dependent for e in self.added_effects))

    @cached_property
    def scales(self) -> Scales:
        """Scales of length, force and tension of all stages: those of the last one."""
        return self.scales_in(self.scene.course[-1])

    def scales_in(self, stage: StageSpec) -> Scales:
        """Scales of a stage: the largest edge force up to its end, else of heat or moves.

        Else that of the weight of the whole strip or the pressure on it, or of bending.  Beside a
        load that is no unit of forces: by a share of it a sheet of 3 mm left its rollers.  Membrane
        forces of strip that is bent until it flows count beside M/t of first yield then: a unit of
        D/L² makes a three-point bending test take 462 tangents instead of 166.
        """
        names = {each.name for each in self.scene.up_to(stage)}
        stages = tuple(each for each in self.scene.stages if each.name in names)
        scene = self.scene.model_copy(update={"stages": stages})
        tension, yielding = largest_force(scene), 0.0
        if tension == 0.0:
            strains = (eigenstrain(scene, s, stressing=True) for s in scene.shapes)
            heat = self.strip.tensile_stiffness * max(strains)
            tension = max(heat, tension_of_moves(scene))
        force = tension
        if tension == 0.0:
            load = distributed_load(scene) * self.strip.length
            tension = max(load, self.strip.bending_stiffness / self.strip.length**2)
            force = load or tension
            yielding = (flow_stress(scene) or 0.0) * self.strip.thickness / 6.0
        return Scales(self.strip.length, force * self.strip.width, tension, yielding)


def own_law(
    scene: SceneSpec,
    table: str,
    spec: ContactSpec | FrictionSpec | PlasticitySpec,
    base: type,
    given: Mapping[str, Any],
) -> Any:
    """Return the user's law that a table of the scene names, ``module:Class``.

    The module is looked for beside the scene's file, then where Python looks.  The class takes
    those of the values given that its signature names, and all of the table's ``parameters``.

    Raises
    ------
    InputError
        There is no such class, it is not a law, or it does not take these parameters.
    """
    assert spec.law is not None
    reference, parameters = spec.law, spec.parameters
    module, _, name = reference.partition(":")
    beside = str((scene.source or Path("scene")).absolute().parent)
    key, hint = f"{table}.law", f"a subclass of {base.__name__}"
    sys.path.insert(0, beside)
    try:
        law = getattr(importlib.import_module(module), name)
    except (Exception, SystemExit) as error:  # whatever the user's module raises
        expected = f"a module and a class in it that can be imported ({words_of(error)})"
        raise scene.refused(key, reference, expected, hint) from error
    finally:
        sys.path.remove(beside)
    if not (isinstance(law, type) and issubclass(law, base)):
        expected = f"a subclass of anmstrip.{base.__name__}"
        raise scene.refused(key, reference, expected, f"class {name}({base.__name__})")
    known = signature(law).parameters
    if hidden := [each for each in known if callable(getattr(base, each, None))]:
        expected = f"other names than {', '.join(hidden)} for what {name} is made of"
        hint = f"{hidden[0]}_ instead: {base.__name__}.{hidden[0]} is a function of every law"
        raise scene.refused(key, reference, expected, hint)
    try:
        made = law(**{k: v for k, v in given.items() if k in known}, **parameters)
    except (TypeError, ValueError) as error:
        expected = f"the arguments of {name}{signature(law)} ({words_of(error)})"
        typed = dict(parameters)
        hint = "parameters = { … }"
        raise scene.refused(f"{table}.parameters", typed, expected, hint) from error
    if wrong := wrong_law(made):
        raise scene.refused(key, reference, *wrong)
    return made


def wrong_law(law: Any) -> tuple[str, str] | None:
    """Return what is expected of a user's law of contact, friction or flow, and what to type.

    Nothing if it works on arrays and series; if it pushes the less the wider the gap, rubs against
    the slip as its coefficient says, or flows with the stress.
    """
    from anmstrip.mechanics.laws import ContactLaw, FrictionLaw

    points = np.array([-1.0, 0.5, 2.0, 30.0])
    check: Callable[[Any, Array], bool]
    if isinstance(law, FrictionLaw):
        check, wanted = _rubs, "friction against the slip, proportional to coefficient"
        hint = "return -f * normal * …"
    elif isinstance(law, ContactLaw):
        check, wanted = _pushes, "a pressure that falls with the gap, and faint above 0"
        hint = "return p * np.exp(-gap / w)"
    else:
        check, wanted = _flows, "flow with the stress, of a resistance above 0"
        hint = "return p * h + yield_stress"
    if not (is_dataclass(law) or isinstance(law, ContactLaw)):
        return "a frozen dataclass", "@dataclass(frozen=True) before its class"
    try:
        with np.errstate(all="ignore"):
            return None if check(law, points) else (wanted, hint)
    except Exception as error:  # whatever the user's law raises
        return f"a law that works on arrays ({words_of(error)})", hint


def wrong_effect(effect: LawEffect, unknowns: int, controls: Mapping[str, Array]) -> str | None:
    """Return what is expected of a user's effect whose law does not work, else None."""
    if not hasattr(effect, "operator"):
        return "an operator, as anmstrip.ContactOperator(strip), beside its law"
    operator = effect.operator
    x = operator.apply(np.zeros(unknowns))
    given = (x, 0.0 * x) if effect.rate_dependent else (x,)

    def law(x: Any, v: Any = None) -> Any:
        return effect.law(x, v, controls)

    try:
        with np.errstate(all="ignore"):
            found = np.asarray(law(*given), dtype=float)
            record(law, *given)
    except Exception as error:  # whatever the user's law raises
        v = "" if effect.rate_dependent else "; v is None without rate_dependent = True"
        return f"a law that works on arrays and series ({words_of(error)}{v})"
    rows = max(part.row + part.count for part in operator.matrices[1])
    if found.shape != (rows, *x.shape[1:]):
        return f"forces of shape {(rows, *x.shape[1:])}, and it returned {found.shape}"
    return None if np.isfinite(found).any() else "finite forces where the strip is flat and at rest"


def words_of(error: BaseException) -> str:
    """Return what went wrong in a user's code, and in which line of it, if it was there."""
    others = str(Path(__file__).parents[1]), str(Path(importlib.__file__).parent), "<"
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if not f.filename.startswith(others)]
    place = f", line {own[-1].lineno} of {Path(own[-1].filename).name}" if own else ""
    return f"{type(error).__name__}: {error}{place}".replace(": ,", ",").removesuffix(": ")


def shaped_like(given: Array, found: Any) -> Array:
    """Return what a user's law has made of an array, refused unless it is as large."""
    values = np.asarray(found, dtype=float)
    if values.shape != given.shape:
        raise ValueError(f"given an array of {given.shape}, it returned {values.shape}")
    return values


def _rubs(law: Any, points: Array) -> bool:
    """Return whether a law of friction opposes slip, in proportion to its coefficient."""
    slip, ones = law.speed * np.stack([points, 0.0 * points, points[::-1]]), np.ones(4)
    laws = law, replace(law, coefficient=2.0 * law.coefficient)
    found, twice = (shaped_like(slip, each(ones, slip)) for each in laws)
    record(law, ones, slip)
    return bool(np.all((found * slip).sum(axis=0) < 0.0) and np.allclose(twice, 2.0 * found))


def _pushes(law: Any, points: Array) -> bool:
    """Return whether the pressure of a law of contact falls with the gap, and has a faint one."""
    found, faint = shaped_like(points, law(points * law.width)), float(law.faint)
    record(law, points * law.width)
    return bool(np.all(np.diff(found) <= 0.0) and found[-1] < found[0] and faint > 0.0)


def _flows(law: Any, points: Array) -> bool:
    """Return whether strip flows with the stress by a law of flow, and resists."""
    stress = law.yield_stress / 30.0 * points[None, :, None] * np.ones((1, 1, 3))
    internal = np.zeros((law.variables(1), *stress.shape[1:]))

    def rates(stress: Any, internal: Any) -> Any:
        return law.rates(stress, internal, 1.0)

    path = np.full(stress.shape[1:], 0.01)
    grown = shaped_like(path, law.resistance(path))
    shaped_like(stress, law.normal(stress))
    flow = np.asarray(rates(stress, internal))[0]
    record(rates, stress, internal)
    return bool(np.all(grown > 0.0) and np.all(flow * stress[0] > 0.0))


def local_origin(points: Array) -> Array:
    """Return the middle of points of shape (d, n), so rounded that differences to it are not.

    In thousandths of a power of two of their size: a line that is moved by a multiple of that,
    or mirrored, is solved by the same numbers.
    """
    size = float(np.ptp(points, axis=1).max()) or float(np.abs(points).max()) or 1.0
    step = 2.0 ** (np.ceil(np.log2(size)) - 10.0)
    middle = 0.5 * (points.min(axis=1) + points.max(axis=1))
    return np.asarray(step * np.round(middle / step) + 0.0)


def rollers_of(scene: SceneSpec, origin: Array, faces: bool) -> tuple[Roller, ...]:
    """Return rollers of a scene, which touch faces or not, from a local origin, shape (3,)."""
    half = 0.5 * scene.strip.thickness if faces else 0.0
    return tuple(roller_of(spec, origin, half) for spec in scene.rollers)


def roller_of(spec: RollerSpec, origin: Array, half: float) -> Roller:
    """Return the geometry of a roller, which touches the strip so far from its mid-surface (m)."""
    crown, given = spec.crown, spec.sides
    if spec.taper:
        crown = (spec.taper + sum(crown[:1]), *crown[1:])
    sides = None if given is None else Sides(given.taper, 0.5 * given.flat, given.rounding)
    x, y, z = (float(c) for c in np.asarray(spec.centre) - origin)
    return Roller(spec.name, spec.radius, (x, y, z), spec.axis, crown, sides, half)


def naturals(scene: SceneSpec) -> set[str]:
    """Return the kinds of eigenstrain and eigencurvature of a scene, from its strip or a stage."""
    return {key for shape in scene.shapes for key in shape.natural}


def varies_across(roller: RollerSpec) -> bool:
    """Whether the strip's fibres go different ways over a roller."""
    across = np.abs(roller.axis) / np.linalg.norm(roller.axis)
    return bool(roller.crown or roller.taper or roller.sides or across[1] < 1.0)


def fibres_differ(scene: SceneSpec) -> bool:
    """Whether tensions differ across on a roller, by its shape or by that of the strip itself."""
    return any(map(varies_across, scene.rollers)) or any(s.varying_across for s in scene.shapes)


def check_geometry(scene: SceneSpec, strip: Strip, rollers: Sequence[Roller]) -> None:
    """Refuse rollers and edges with which this mesh cannot do.

    Raises
    ------
    InputError
        A roller without a radius somewhere across the strip, or inside the flat strip; an edge to
        be centred without a node in its middle, or to be clamped that is neither along x nor y.
    """
    mistakes = []
    across = np.linspace(-0.5, 0.5, 33) * (scene.strip.width or 0.0)
    for spec, roller in zip(scene.rollers, rollers, strict=True):
        least = float(np.min(roller.radius_at(across - roller.centre[1])))
        if not least > 0.0:
            profile, value = next(iter(spec.profile.items()))
            key = f"rollers.{spec.name}.{profile}"
            hint = GENTLE_PROFILES[profile].format(1e-3 * spec.radius)
            expected = f"a radius above 0 all across the strip; it falls to {least:.3g} (m)"
            mistakes.append(scene.mistake(key, value, expected, hint))
        elif scene.threading is None and (gap := flat_gap(strip, roller)) < -1e-12 * spec.radius:
            mistakes.append(inside_flat_strip(scene, spec, -gap))
    for name, edge in scene.edges.items():
        if edge.centred and name in strip.edges and middle_node(strip, name) is None:
            expected = "a mesh node in the middle of the edge"
            key, value, hint = f"edges.{name}.centred", True, "centred = false, or such a mesh"
            if (cells := scene.strip.cells) is not None:
                expected = f"an even number across: the middle of the {name} keeps its y ({key})"
                key, value, hint = "strip.cells", cells, f"cells = [{cells[0]}, {cells[1] + 1}]"
            mistakes.append(scene.mistake(key, value, expected, hint))
        if edge.clamped and name in strip.edges:
            extent = np.ptp(strip.nodes[:2, strip.edges[name].nodes], axis=1)
            if extent.min() > 1e-9 * extent.max():
                key, expected = f"edges.{name}.clamped", "an edge along x or y, whose slope is one"
                mistakes.append(scene.mistake(key, True, expected, "clamped = false"))
    if mistakes:
        raise InputError(mistakes)


def inside_flat_strip(scene: SceneSpec, spec: RollerSpec, depth: float) -> Mistake:
    """Return the mistake of a roller that is inside the flat strip by a depth (m).

    One that is pressed has come there, since the one across does not touch the strip.
    """
    if spec.press is not None and (partner := pressed_against(scene.rollers, spec)) is not None:
        (other,) = (each for each in scene.rollers if each.name == partner.name)
        expected = (
            f"a roller that touches the flat strip, which {spec.name} presses on it; it is "
            f"{depth:.4g} m away"
        )
        nearer = ", ".join(f"{c:.9g}" for c in other.centre - depth * partner.way + 0.0)
        given = f"rollers.{other.name}.centre", list(other.centre)
        return scene.mistake(*given, expected, f"centre = [{nearer}]")
    expected = f"a roller outside the flat strip; its surface is {depth:.4g} m inside"
    hint = f"move centre at least {depth:.4g} m away from the strip, or reduce radius"
    return scene.mistake(f"rollers.{spec.name}.centre", list(spec.centre), expected, hint)


def flat_gap(strip: Strip, roller: Roller) -> float:
    """Return the least gap (m) between a roller, where it begins, and the flat strip."""
    low, high = strip.nodes[:2].min(axis=1), strip.nodes[:2].max(axis=1)
    axis, slope = roller.unit_axis, roller.unit_axis[2]
    if slope:  # the axis may go through the rectangle itself
        crossing = (np.asarray(roller.centre) - axis * (roller.centre[2] / slope))[:2]
        if ((low <= crossing) & (crossing <= high)).all():
            return -float(roller.radius + roller.half)
    (west, south), (east, north) = low, high
    corners = np.array([[west, south], [east, south], [east, north], [west, north]])
    from_axis = np.column_stack([corners, np.zeros(4)]) - roller.centre
    from_axis -= np.outer(from_axis @ axis, axis)
    along = np.roll(from_axis, -1, axis=0) - from_axis
    squared = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(-(from_axis * along).sum(axis=1) / squared, 0.0, 1.0)
    nearest = np.linalg.norm(from_axis + share[:, None] * along, axis=1).min()
    return float(nearest) - float(roller.radius + roller.half)


def middle_node(strip: Strip, name: str) -> int | None:
    """Mesh node in the middle of an edge."""
    nodes = strip.edges[name].nodes
    points = strip.mesh.p[:, nodes]
    middle = 0.5 * (points[:, 0] + points[:, -1])
    distance = np.linalg.norm(points - middle[:, None], axis=0)
    nearest = int(distance.argmin())
    return int(nodes[nearest]) if distance[nearest] < 1e-6 * strip.edges[name].length else None
