"""The error budget of a run: what path, time, mesh and regularised laws make its results wrong by.

The first three are changes of state, and count by what they change of all that is read off.  For
the mesh a scene is made on elements of half the length; its states are taken there and balanced.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse.linalg import ArpackError

from anmstrip.advice.warnings import time_words
from anmstrip.arrays import Array, Index
from anmstrip.continuation import newton
from anmstrip.continuation.follow import PathStep, Settings, follow
from anmstrip.continuation.path import Cost, Equations, Outcome, PathStopped
from anmstrip.equilibrium import Equilibrium, StageProblem
from anmstrip.fem.geometry import SHELL
from anmstrip.fem.sampling import l2_projection
from anmstrip.fem.strip import Strip, line, renumbered
from anmstrip.linalg.direct import SingularTangentError
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls, Effect, Values
from anmstrip.results.files import ERROR_WORDS
from anmstrip.results.plastic import YieldedStrip
from anmstrip.results.state import State
from anmstrip.results.wrinkles import (
    COLUMN_SHARE,
    ROUGH_TOLERANCE,
    TRACKED_MODES,
    Onset,
    Span,
    buckling,
    free_spans,
)
from anmstrip.scene.tables import ENDS
from anmstrip.simulation.march import March
from anmstrip.simulation.meshing import mesh_density
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course
from anmstrip.timestepping.formulas import AffineVelocity, Errors, Memory

if TYPE_CHECKING:
    from anmstrip.mechanics.laws import ContactLaw
    from anmstrip.simulation.growth import Growth


Part = dict[str, float]
"""Largest errors of a ``tension`` (N/m), of a roller's ``force`` (N), of a ``position`` (m), of the
``moment`` (N) of an edge where any is clamped, and of the ``curl`` (1/m) of strip that yields."""

LARGE_MESH_ERROR = 0.1
"""Share of the scene's tension, or of a compression, by which the mesh must not make one wrong
without a warning."""

LARGE_PATH_ERROR = 3.0
"""Times the tolerance's share of the scene's tension by which the path must not make one wrong
without a warning.  Scenes of tests and examples that are done end with half of it at most."""

BUDGET_ADVICE = {
    **dict.fromkeys(("path", "time"), "Try a smaller solver.tolerance."),
    "mesh": "Try shorter elements, and hold the strip in what nothing but friction holds.",
    "regularisation": "Try --set 'friction.regularisation=\"auto\"'",
    "flow": "Try a larger material.plasticity.exponent.",
}
"""What makes them smaller."""

EXPECTED_PRESSURE = 10.0
"""Largest pressure on elements of half the length, over that on the given ones, up to which the
law of contact is followed on the way to their balance.  A foil takes 30 tangents, 32 with 3
times as much and 40 with 1e4 times."""

LINEAR_RANGE = 1e-2
"""Change of gaps over the onset of contact, and of slip over V_c, over which laws are straight."""


def tension_readings(state: State) -> dict[str, float]:
    """Return the tensions (N/m) of the ends, and of the strip before and behind what it passes."""
    found = {name: state.tension(name) for name in ENDS}
    for passage in state.passages:
        for name in passage.names:
            found |= zip((f"{name}.in", f"{name}.out"), passage.tensions, strict=True)
    return found


def force_readings(state: State) -> dict[str, float]:
    """Return the normal force and the drag (N) of every roller."""
    found: dict[str, float] = {}
    for name, reading in state.rollers.items():
        found |= {f"{name}.normal": reading.normal_force, f"{name}.drag": reading.drag}
    return found


def largest_differences(
    state: State, other: State, moved: Array, clamped: Collection[str] = ()
) -> Part:
    """Return the largest differences of what is read off two states, also of different meshes.

    Parameters
    ----------
    state, other : State
    moved : ndarray, shape (unknowns,)
        Difference of displacements, on the mesh of the other.
    clamped : collection of str
        Edges whose moments count, where they are held.
    """

    def largest(here: dict[str, float], there: dict[str, float]) -> float:
        return max((abs(there[key] - here[key]) for key in here), default=0.0)

    position = np.abs(moved[other.plan.model.value_unknowns]).max()
    found = {
        "tension": largest(tension_readings(state), tension_readings(other)),
        "force": largest(force_readings(state), force_readings(other)),
        "position": float(position),
    }
    if moments := state.clamp_moments(clamped):
        found["moment"] = largest(moments, other.clamp_moments(clamped))
    if (here := YieldedStrip.of(state)) and (there := YieldedStrip.of(other)):
        found["curl"] = largest(here.curls, there.curls)
    return found


@dataclass
class Budget:
    """Errors of the latest state of a run.

    Attributes
    ----------
    assembly : Assembly
    parts : dict
        ``path``, ``time`` and ``mesh``, each None where it does not exist or is not known.
    lost : bool
        Whether elements of half the length have no such state, as far as could be found.
    error : ndarray, shape (unknowns of the finer mesh,), or None
        By the mesh.
    time, pulled : float
        Of the state that this is the error of (s), and its largest tension (N/m).
    took : float
        How long the last estimate of the errors by the mesh took (s).
    loads : dict
        Edge → what the mesh makes of the force (N/m) that holds it, or that it was released with.
    spans : list of tuple of Span
        Free spans of a shell, and the same on elements of half the length.
    bears : float
        Lowest factor of a buckling mode on elements of half the length, infinite if unknown.
    onset : tuple of Onset and ndarray, or None
        The latest onset whose factors are known on elements of half the length, and these.
    """

    assembly: Assembly
    parts: dict[str, Part | None] = field(default_factory=dict)
    lost: bool = False
    error: Array | None = None
    time: float = 0.0
    pulled: float = 0.0
    took: float = 0.0
    loads: dict[str, Array] = field(default_factory=dict)
    spans: list[tuple[Span, Span]] = field(default_factory=list)
    bears: float = np.inf
    onset: tuple[Onset, Array] | None = None
    solver: SparseSolver = field(default_factory=SparseSolver)  # of written states: one pattern

    @cached_property
    def halved(self) -> Halved | None:
        """The scene on elements of half the length; None if it cannot be."""
        return Halved.of(self.assembly) if self.assembly.can_halve else None

    @property
    def tension(self) -> float:
        """Largest tension (N/m) of the scene or of the state, of which errors are shares."""
        return max(self.assembly.scales.tension, self.pulled)

    @property
    def useless(self) -> list[str]:
        """Sentences about errors as large as the largest tension, or as half the width."""
        assembly, told, cures = self.assembly, list[str](), dict(BUDGET_ADVICE)
        if assembly.scene.friction is None:  # the onset of contact goes with the mesh
            cures["regularisation"] = self.shorter
        sideways, half = 1 in assembly.kinematics.components, 0.5 * assembly.strip.width
        for of, found in self.parts.items():
            wrong = []
            if found is not None and found["tension"] > self.tension:
                wrong.append(f"tensions by {found['tension']:.2g} N/m, more than they are,")
            if found is not None and sideways and found["position"] > half:
                wrong.append(f"positions by {found['position']:.2g} m, more than half the width,")
            if wrong:
                found_wrong = f"{ERROR_WORDS[of]} may make {' and '.join(wrong)} wrong"
                told.append(f"this state is of no use: {found_wrong}. {cures[of]}")
        return told

    @property
    def of_path(self) -> list[str]:
        """A sentence if it is far from the balance near it, over the tolerance."""
        tolerance, found = self.assembly.scene.solver.tolerance, self.parts.get("path")
        allowed = tolerance * self.assembly.scales.tension
        if found is None or found["tension"] <= LARGE_PATH_ERROR * allowed:
            return []
        return [
            f"this is not the state that was asked for: tensions are wrong by about "
            f"{found['tension']:.2g} N/m, {found['tension'] / allowed:.2g} times what the "
            f"tolerance allows. Try --set solver.tolerance={0.1 * tolerance:.1g}"
        ]

    @property
    def doubtful(self) -> list[tuple[Span, Span]]:
        """Spans near wrinkles whose compression depends on the mesh, and the same on the finer.

        None where modes say what the finer one bears.
        """
        if self.bears < np.inf:
            return []

        def changes(here: Span, there: Span) -> bool:
            change = abs(there.compression - here.compression)
            return here.near and change > LARGE_MESH_ERROR * here.compression

        return [pair for pair in self.spans if changes(*pair)]

    @property
    def of_wrinkles(self) -> list[str]:
        """A sentence for a run without wrinkles if elements of half the length have some."""
        if not 0.0 < self.bears < 1.0:
            return []
        return [
            "on elements of half the length the strip has begun to wrinkle before this state: "
            f"there it bears {self.bears:.2g} times its compression. {self.shorter}"
        ]

    def of_onset(self, here: float, there: float) -> list[str]:
        """A sentence for an onset at a time (s) far from the one on elements of half the length."""
        return [
            f"strip that begins to wrinkle at t = {here:.4g} s begins at {there:.4g} s on elements "
            f"of half the length: the mesh is too coarse for it. {self.shorter}"
        ]

    @property
    def shorter(self) -> str:
        """Settings that make elements half as long."""
        if self.assembly.scene.strip.mesh is not None:
            return "Try shorter elements"
        return f"Try --set strip.finer={2.0 * mesh_density(self.assembly.scene):g}"

    @property
    def of_mesh(self) -> list[str]:
        """Sentences about a mesh that is too coarse."""
        scene = self.assembly.scene
        laws = scene.friction is not None and scene.friction.regularisation == "auto"
        shorter = scene.strip.mesh is not None or scene.strip.refined == "auto" or laws
        more = "Try shorter elements." if shorter else "Try --set 'strip.refined=\"auto\"'"
        if self.lost:
            return [
                "elements of half the length have no such state nearby, as far as was found: a "
                f"limit point, a wave or a tension may come from the mesh alone. {more}"
            ]
        told = [
            f"the strip is compressed by {here.compression:.3g} N/m between {here.before} and "
            f"{here.after}, but by {there.compression:.3g} N/m on elements of half the length: "
            f"wrinkles there may come from the mesh alone. {more}"
            for here, there in self.doubtful
        ]
        found, scale = self.parts.get("mesh"), self.tension
        asked = None if scene.strip.refined == "auto" else scene.solver.mesh_tolerance
        if found is None or found["tension"] <= (asked or LARGE_MESH_ERROR) * scale:
            return told
        wrong = f"the mesh makes tensions wrong by about {found['tension']:.2g} N/m"
        wrong += f", above solver.mesh_tolerance = {asked:g} of {scale:.5g} N/m" if asked else ""
        return [f"{wrong}: elements of half the length have others. {more}", *told]

    def look(self, state: State, memory: Memory | None, released: Collection[str]) -> None:
        """Estimate the errors of the last state of a stage, or of the one where a run stopped.

        Parameters
        ----------
        state : State
        memory : Memory or None
            Of a stage in time, with the errors that its steps have carried on.
        released : collection of str
            Edges that were let go.
        """
        exact, self.parts = state, dict.fromkeys(ERROR_WORDS)
        if memory is None or memory.errors is None:
            if (found := balance_state(frozen_problem(state), state)) is None:
                self._forget()
                self.time = state.time  # as at a limit point: nothing is known of laws and meshes
                return
            exact, change = found, found.full - state.full
            self.parts["path"] = largest_differences(state, found, change, self.clamped)
            with suppress(SingularTangentError):
                self.parts |= self.by_laws(exact)
        else:
            names = ("time", "path", "regularisation", "flow")
            with suppress(SingularTangentError):
                self.parts |= zip(names, self.in_time(state, memory.errors), strict=False)
        pressed = self.assembly.pressing
        if any(len(p.names) > 1 and {*pressed}.isdisjoint(p.names) for p in state.passages):
            self.parts["regularisation"] = None  # a nip presses as its law makes of its gap
        if self.halved is not None and (state.plan.steady or self.assembly.flow is None):
            self._announce("estimating the errors by the mesh", self.halved)
            begin = perf_counter()
            try:
                self.look_finer(self.halved, exact, released)
            except MemoryError:  # what is solved stays; nothing is known of the mesh
                self._forget()
            self.took = perf_counter() - begin
        self.time = state.time
        self.pulled = max(map(abs, tension_readings(state).values()), default=0.0)

    def _announce(self, words: str, halved: Halved) -> None:
        """Log what is about to be looked for on elements of half the length, and for how long.

        As long as the last time, if that was longer than expected.
        """
        told = words + ", on elements of half the length, %d unknowns, about %s"
        given = halved.unknowns, time_words(max(self.assembly.estimate_seconds, self.took))
        logging.getLogger(__name__).info(told, *given)

    @property
    def clamped(self) -> list[str]:
        """Edges that the scene clamps."""
        return self.assembly.scene.clamped

    def _forget(self, lost: bool = False) -> None:
        """Forget what a finer mesh told of a state; ``lost`` if it has none of the next one."""
        self.lost, self.error, self.spans, self.bears = lost, None, [], np.inf

    def by_laws(self, state: State) -> dict[str, Part]:
        """Return what regularised laws, and a flow law with a rate, make of a state without a past.

        To first order in what is wrong with the laws of contact and friction, and in 1/n.
        """
        free, equations = state.plan.supports.free, frozen_problem(state).equations()
        zero, found = np.zeros(len(free)), dict[str, Part]()
        laws, *flow = equations.sharpenings(zero, 0.0)
        changes = {"regularisation": laws} if state.rollers else {}
        changes |= dict(zip(("flow",), flow, strict=False))
        if not changes:
            return found
        factors = SparseSolver().factorise(equations.recurrence(zero, 0.0, 1).tangent())
        for name, change in changes.items():
            moved = np.zeros((2, len(state.full)))
            moved[0, free] = factors.solve(change)
            found[name] = self.straight(state, moved, sharper=change is laws)
        return found

    def straight(self, state: State, moved: Array, sharper: bool = False) -> Part:
        """Return what a change of displacements and velocities makes of what is read off.

        To first order, as it is known: by a central difference over which the laws of contact and
        friction are straight.

        Parameters
        ----------
        state : State
        moved : ndarray, shape (2, unknowns)
        sharper : bool
            Whether the laws become sharper with the change.
        """
        scales = [self.assembly.scales.length, np.inf]
        if self.assembly.contact is not None:
            scales[0] = self.assembly.signorini.width
        if state.friction is not None:
            scales[1] = state.friction.law_of_slip.speed
        values = np.abs(moved[:, state.plan.model.value_unknowns]).max(axis=1)
        share = min(0.5, LINEAR_RANGE / max(*(values / scales), 1e-300))

        def changed(by: float) -> State:
            plan, full, velocity = state.plan, state.full - by * moved[0], None
            if plan.steady:
                velocity = plan.transport(full, state.control)
            elif state.velocity is not None:
                velocity = state.velocity - by * moved[1]
            if sharper:
                effects = [effect.sharper(by) for effect in plan.model.effects]
                plan = replace(plan, model=plan.model.with_effects(effects))
            return replace(state, plan=plan, full=full, velocity=velocity)

        sides = changed(-share), changed(share)
        found = largest_differences(*sides, 2.0 * share * moved[0], self.clamped)
        return {key: float(value / (2.0 * share)) for key, value in found.items()}

    def in_time(self, state: State, errors: Errors) -> Iterator[Part]:
        """Yield what formulas, their branches, laws, and the rate of flow make wrong of a state."""
        assert state.velocity is not None
        free = state.plan.supports.free
        velocity = AffineVelocity(errors.rate, state.velocity[free], np.zeros(len(free)))
        equations = frozen_problem(state).equations(velocity, state.velocity)
        zero = np.zeros(len(free))
        factors = SparseSolver().factorise(equations.recurrence(zero, 0.0, 1).tangent())
        resistance, left = equations.resistance(zero, 0.0), equations.residual(zero, 0.0)
        laws, *flow = equations.sharpenings(zero, 0.0)
        for number, rest in enumerate((zero, left, laws, *flow)):
            before, moved = errors.before[number], np.zeros((2, len(state.full)))
            moved[0, free] = factors.solve(resistance(errors.rate * before) + rest)
            moved[1, free] = errors.rate * (moved[0, free] - before)
            yield self.straight(state, moved, sharper=rest is laws)

    def of_solver(self, state: State, march: March) -> dict[str, float]:
        """Return what path and steps in time together make of any state, nothing if not known.

        The largest error of a membrane force (N/m) and of a ``position`` (m).  Of a state without
        a past one correction by Newton's method tells it.

        Parameters
        ----------
        state : State
        march : March
            That has come to it.
        """
        if state.plan.in_time:
            if march.memory is None or march.memory.errors is None:
                return {}
            moved = np.zeros_like(state.full)
            moved[state.plan.supports.free] = march.memory.errors.after[:2].sum(axis=0)
        else:
            try:
                moved = march.newton_correction(state)
            except (SingularTangentError, MemoryError):
                return {}
        with march.cost.timed("errors of states"):
            found = {"position": float(np.abs(moved[state.plan.model.value_unknowns]).max())}
            if (flow := state.plasticity) is not None and flow.operator.flows:
                forces, _ = flow.resultant_changes(state.full, moved)
            elif state.membrane is not None:
                forces = state.membrane.change(state.full, moved, state.controls)
            else:
                return found
            found["membrane_force"] = float(np.abs(forces).max())
        return found

    def finer_problem(self, finer: Halved, state: State, released: Collection[str]) -> StageProblem:
        """Return the problem of a state on elements of half the length."""
        loads = {f"{name}.force": self.loads[name] for name in released if name in self.loads}
        plan = finer.problem(state, released, loads)
        pressures = (float(c.pressure.max(initial=0.0)) for c in state.contacts.values())
        largest = max(pressures, default=0.0)
        if largest > 0.0:
            effects = [tangent_beyond(e, EXPECTED_PRESSURE * largest) for e in plan.model.effects]
            plan = replace(plan, model=plan.model.with_effects(effects))
        return plan

    def loads_on_halves(self, onset: Onset, released: Collection[str]) -> dict[str, float] | None:
        """Return at which loads an onset of wrinkles is on elements of half the length.

        By the factor of its mode there, in the state that was found here.

        Returns
        -------
        dict or None
            As of :func:`~anmstrip.results.wrinkles.loads`; None if it is not known, as of strip
            that is not flat, whose waves grow before.
        """
        if self.halved is None or onset.beside is None or self.assembly.imperfection is not None:
            return None
        state, known = onset.state, self.onset
        if known is None or not known[0].is_beside(onset):
            self._announce("looking for an onset of wrinkles", self.halved)
            plan = self.finer_problem(self.halved, state, released)
            try:
                known = self.onset = onset, buckling_factors(balance_state(plan, state))
            except MemoryError:
                return None
        before, factors = known
        factors = (onset.level / before.level * factors)[onset.number :]
        return onset.loads_by(float(factors[0])) if len(factors) and factors[0] > 0.0 else None

    def look_finer(self, halved: Halved, state: State, released: Collection[str]) -> None:
        """Balance a state on elements of half the length.

        What sticks has kept the error from the end of the stage before, as in one step of the
        backward Euler method over all of this stage.
        """
        plan = self.finer_problem(halved, state, released)
        start, elapsed = plan.supports.start, state.time - self.time
        velocity = None
        if plan.in_time and state.velocity is not None:
            velocity = halved.prolonged(state.velocity)
            if self.error is not None:
                velocity = velocity - self.error / elapsed
        finer = balance_state(plan, state, velocity, elapsed)
        self._forget(finer is None)
        if finer is None:
            return
        if self.assembly.kinematics is SHELL:
            known = {(span.before, span.after): span for span in free_spans(finer)}
            pairs = ((span, known.get((span.before, span.after))) for span in free_spans(state))
            self.spans = [(here, there) for here, there in pairs if there is not None]
            pressed = (b.compression > COLUMN_SHARE * b.bearable for _, b in self.spans)
            if self.assembly.scene.strip.bending and not plan.in_time and any(pressed):
                self.bears = float(buckling_factors(finer).min(initial=np.inf))
        self.error = finer.full - start
        self.parts["mesh"] = largest_differences(state, finer, self.error, self.clamped)
        for name in self.assembly.scene.edges.keys() - set(released):
            length = self.assembly.strip.edges[name].length
            self.loads[name] = (finer.edge_force(name) - state.edge_force(name)) / length


def buckling_factors(state: State | None) -> Array:
    """Return the lowest factors of a state's buckling modes, ascending; none if not known."""
    try:
        if state is None:
            return np.zeros(0)
        return buckling(state, TRACKED_MODES, tolerance=ROUGH_TOLERANCE)[0]
    except (SingularTangentError, ArpackError, MemoryError):
        return np.zeros(0)


def tangent_beyond(effect: Effect, reaction: float) -> Effect:
    """Return an effect whose law of contact, if any, goes on along its tangent beyond it (Pa)."""
    from anmstrip.mechanics.contact import Contact, Friction
    from anmstrip.mechanics.laws import TangentBeyond

    if isinstance(effect, Contact):
        return replace(effect, signorini=TangentBeyond(effect.signorini, reaction))
    if isinstance(effect, Friction):
        law = TangentBeyond(effect.contact.signorini, reaction)
        return replace(effect, contact=replace(effect.contact, signorini=law))
    return effect


def frozen_problem(state: State) -> StageProblem:
    """Return the stage of a state with all that is given as it is there, and nothing that moves."""
    still = np.zeros_like(state.full)
    supports = replace(state.plan.supports, start=state.full, slope=still, bow=None)
    return replace(state.plan, supports=supports, controls=Controls(state.controls))


IMBALANCE_REDUCTION = 1e-5
"""Imbalance that is left of the one that is taken away: the change is known to a few per cent."""

SMALLEST_IMBALANCE = 1e-10
"""Least imbalance that is asked for, over the force scale, where displacements are small."""

LARGEST_IMBALANCE_LEFT = 1e-4
"""Largest imbalance that is left, over the force scale: contact that a finer mesh finds deep inside
a roller begins with any."""

CONTACT_IMBALANCE = 1.0
"""Imbalance, over the force scale, above which contact is elsewhere on the finer mesh.  Of 40
random lines none begins with more than 0.15, paper on rollers out of line with 17 to 90, and a
furnace of six conical rolls with 88."""

WIDER_LAWS = 10.0, 3.0
"""Widths of laws over the given ones, by way of which Newton's method goes on: of friction alone,
and of all laws where contact is elsewhere.

Friction takes two or three tangents, and three to five from there to the given one, for which a
width of 100 is too far, and for some lines 10.  By way of all laws paper 0.5 to 2 mm/m out of line
takes 11 to 16 tangents instead of 14 to 25, and the furnace 20, by way of friction alone 38 to no
end.  Lines of idlers at corners of friction take up to seven times as many by way of all laws.
From there Newton's method goes on at once, or by way of friction as soon as a tangent leaves more
than half: film on a roller 0.3 to 6 mm/m out of line takes 15 to 19 tangents, without turning 11 to
37, or more than 60 and then a path.  Friction is also widened from where nothing has led yet: a
leveller takes 46 tangents so, and 23 without all laws, by way of which it has no balance.
"""

WIDER_REDUCTION = 0.1
"""Part of the imbalance, and of the force scale, that is left with wider laws."""

MAX_CORRECTIONS = 8
"""Iterations of Newton's method, each with a line search.  23 random lines with idlers, where it
goes back and forth at corners, take 390 tangents for all balances; 381 with 6, 429 with 12."""

MAX_ROUGH_CORRECTIONS = 30
"""The same with wider laws.  A foil on a roller 0.4 mm/m out of line takes 20 to 29
to find where it touches; with 8, and paths from there, it took four times as long to find nothing.
"""

FAST_REDUCTION = 0.5
"""Part of the imbalance below which an iteration is not counted: contact that begins deep inside a
roller gives way by its onset at a time, and leaves 1/e.  A shell of 8 m on a roller 0.3 mm/m out of
line begins with 1.5e6 times its force scale and takes 23 tangents."""

MAX_BALANCING_BRANCHES = 20
"""Of paths by way of the smoothest laws, and of that on which the imbalance fades away, where
friction holds the strip and Newton's method finds no way: one to ten are enough.  Without smoothest
laws, which take six to ten tangents, seven of 109 stages of 35 such lines had no balance.  Before
the path they found none of a shell that gathers between nips, with 40 tangents of its finer mesh,
and the path took four."""

CRAWLING = 10.0
"""Branches that the rest of such a path would take at the pace of the last three, over those that
are left, beyond which it is given up: it crawls past a limit point.  Of 328 paths of random lines
that arrive one comes to 4, and the others to 0.3 at most; a furnace beyond its limit has 65."""


@dataclass(eq=False, repr=False)
class Halved(Assembly):
    """The assembly of a scene on elements of half the length.

    The laws stay what the given mesh resolves, so that the mesh alone makes the difference.
    """

    coarse: Assembly = field(kw_only=True)  # of the given mesh

    @property
    def growth(self) -> Growth | None:
        """Growth of the given mesh, which this one follows."""
        return self.coarse.growth

    @classmethod
    def of(cls, given: Assembly) -> Halved:
        """Return the assembly on elements of half the length of a given one."""
        made = cls(given.scene, None, given.added, coarse=given)
        if given.imperfection is None:
            return made
        return replace(made, imperfection=made.prolonged(given.imperfection))

    @cached_property
    def strip(self) -> Strip:
        """Mesh and basis."""
        old, finer = self.coarse.strip, self.coarse.strip.mesh.refined()
        mesh = line(np.sort(finer.p[0])) if finer.dim() == 1 else renumbered(finer)
        strip = Strip(mesh, old.thickness, old.material, old.kinematics, old.width, old.surface)
        strip.origin, strip.flat_origin = old.origin, old.flat_origin
        strip.contact_parts = old.contact_parts
        return strip

    @property
    def signorini(self) -> ContactLaw:
        """Contact law of the given mesh."""
        return self.coarse.signorini

    def prolonged(self, full: Array) -> Array:
        """Return the same displacements on this mesh, (unknowns,); other unknowns stay."""
        old, (functions, dofs) = self.coarse.strip, self.inherited
        values = np.einsum("nep,nec->cep", functions, old.nodal(full)[dofs])
        displacement = old.kinematics.embed(values.reshape(old.count, -1))
        own = l2_projection(self.strip, self.pattern, displacement)
        free = full[old.unknowns : self.coarse.coupled]
        return np.concatenate([own, free, self.inherited_flow(full)])

    @cached_property
    def children(self) -> tuple[Index, Array]:
        """Parents of this mesh's elements, and the places of its points in them.

        Shapes (elements,) and (dimensions, elements, points).
        """
        old, points = self.coarse.strip, np.asarray(self.strip.basis.global_coordinates())
        numbers: Index = np.arange(points.shape[1])  # as scikit-fem numbers them
        parents = numbers // 2 if old.mesh.dim() == 1 else numbers % old.mesh.nelements
        mapping, middle = old.basis.mapping, np.full(points.shape, 0.5)
        away = points - mapping.F(middle, parents)  # elements are mapped linearly
        return parents, middle + np.einsum("ijkl,jkl->ikl", mapping.invDF(middle, parents), away)

    @cached_property
    def inherited(self) -> tuple[Array, Index]:
        """The given mesh's functions at the points of this one, and their numbers.

        Shapes (functions of one element, elements, points) and (functions of one, elements).
        """
        basis, (parents, local) = self.coarse.strip.basis, self.children
        elem, at = basis.elem, (basis.mapping, local)
        fields = [np.asarray(elem.gbasis(*at, i, tind=parents)[0]) for i in range(basis.Nbfun)]
        return np.array(fields), basis.element_dofs[:, parents]

    def inherited_flow(self, full: Array) -> Array:
        """Return what the layers of a section have flown, on this mesh, (internal unknowns,).

        By the polynomials through the points of every element: strains jump between them.
        """
        if (layers := self.coarse.plastic_strains(grow=False)) is None:
            return np.zeros(0)
        old, (parents, local) = self.coarse.strip, self.children
        own = old.basis.X[0]
        powers = np.vander(local.ravel(), len(own)) @ np.linalg.inv(np.vander(own))
        values = layers.operator.values(full).reshape(-1, old.mesh.nelements, len(own))
        functions = powers.reshape(len(parents), -1, len(own))
        return np.einsum("epq,leq->lep", functions, values[:, parents]).ravel()

    def problem(self, state: State, released: Iterable[str], more: Values) -> StageProblem:
        """Return the stage of a state on this mesh, with all that is given held as it is there.

        Parameters
        ----------
        state : State
            On the given mesh.
        released : iterable of str
            Edges that were let go.
        more : mapping
            Control → what is added to it.
        """
        start, control = self.prolonged(state.full), state.control
        values, before = dict(state.controls), self.natural(self.scene.strip)
        for stage in self.scene.course:
            after = before | self.natural(stage.strip)
            if stage.name == state.plan.name:
                kept = {key: (1.0 - control) * before.get(key, 0.0) for key in after}
                values |= {key: kept[key] + control * after[key] for key in after}
                break
            before = after
        values |= {key: values[key] + more[key] for key in more}
        for key in (key for key in values if key.endswith(".uneven_force")):
            field = np.zeros_like(state.full)
            field[: self.coarse.strip.unknowns] = values[key]
            values[key] = self.prolonged(field)[: self.strip.unknowns]
        course = Course(self, released=set(released))
        course.values = {**values, **course.values}
        values |= course.uneven_pull(stage, values)
        if self.growth is not None:
            values |= course.growing(values["strip.held"], values["strip.taking_up"])
        plan = course.plan(stage, {}, start)
        supports = replace(plan.supports, start=start, slope=np.zeros_like(start), bow=None)
        return replace(plan, supports=supports, controls=Controls(values))


def corrected_by_width(
    equations: Equilibrium, solver: SparseSolver, wanted: float, first: float
) -> tuple[newton.Corrected | None, Array]:
    """Return the state in balance near zero by Newton's method, and where to go on if it is None.

    At once, or from where wider laws lead.

    Parameters
    ----------
    equations : Equilibrium
    solver : SparseSolver
    wanted, first : float
        Imbalance that is asked for, and that of zero.
    """
    begin = np.zeros(len(equations.supports.free))
    usual = newton.Corrections(
        wanted, MAX_CORRECTIONS, FAST_REDUCTION, least=1, kept=newton.TANGENT_REUSE_RATIO
    )
    quick = replace(usual, near=np.inf, helpful=newton.SLOW_CONVERGENCE_RATIO)
    found = newton.Newton(equations, solver, quick, Cost()).corrected(begin, 0.0)
    if found is None or found.imbalance <= wanted:
        return found, begin
    smoother = [pair[0] for pair in map(equations.smoother, WIDER_LAWS) if pair is not None]
    ladders = [(smoother, usual)]
    if first > CONTACT_IMBALANCE:
        wider = [equations.with_wider_laws(width) for width in WIDER_LAWS]
        ladders = [(wider, quick if smoother else usual), (smoother, usual)]
    starts = [found.u]
    for ladder, choices in ladders:
        for start in reversed(starts.copy()):
            near = led_by(ladder, start, solver, usual)
            if near is None:
                continue
            starts.append(begin := near)
            balanced = newton.Newton(equations, solver, choices, Cost()).corrected(near, 0.0)
            if balanced is not None and balanced.imbalance <= wanted:
                return balanced, begin
    return None, begin


def led_by(
    ladder: Iterable[Equilibrium], near: Array, solver: SparseSolver, usual: newton.Corrections
) -> Array | None:
    """Return where wider laws lead from near one to the next, or None if one has no balance."""
    for wider in ladder:
        least = WIDER_REDUCTION * min(wider.imbalance(wider.residual(near, 0.0)), 1.0)
        least = max(usual.tolerance, least)
        rough = replace(usual, tolerance=least, least=0, most=MAX_ROUGH_CORRECTIONS)
        found = newton.Newton(wider, solver, rough, Cost()).corrected(near, 0.0)
        if found is None:
            return None
        near = found.u
    return near


@np.errstate(over="ignore", invalid="ignore")  # of iterations that run away
def balance_state(
    plan: StageProblem, state: State, velocity: Array | None = None, elapsed: float = 0.0
) -> State | None:
    """Return the state in balance near the start of a problem, or None.

    By Newton's method, at once or from where wider laws lead, else along the path on which the
    imbalance of the start fades away, else by way of the smoothest laws.

    Parameters
    ----------
    plan : StageProblem
        Nothing given moves; its supports start at the state.
    state : State
        For its time; also on another mesh.
    velocity : ndarray, shape (unknowns,), optional
        Of a stage in time, if nothing moves from the start of the problem.
    elapsed : float
        Duration (s) in which what moves from there has moved.
    """
    free, moving, rates = plan.supports.free, velocity, None
    if moving is not None:
        rates = AffineVelocity(1.0 / elapsed, moving[free], np.zeros(len(free)))
    equations = plan.equations(rates, moving)
    zero = np.zeros(len(free))
    first = equations.imbalance(equations.residual(zero, 0.0))
    floor = newton.ROUND_OFF_MARGIN * equations.round_off(zero, 0.0)
    wanted = min(max(IMBALANCE_REDUCTION * first, floor), LARGEST_IMBALANCE_LEFT)
    wanted, solver = max(wanted, SMALLEST_IMBALANCE), SparseSolver()
    found, begin = corrected_by_width(equations, solver, wanted, first)
    settings = Settings(
        tolerance=wanted, max_steps=MAX_BALANCING_BRANCHES, give_way=False, rational=True
    )

    def path(laws: Equations, u: Array, start: float) -> PathStep:
        controls = [start]
        for last in follow(laws, u, solver=solver, settings=settings, start=start):
            controls.append(last.pace.control)
            left, far = MAX_BALANCING_BRANCHES + 1 - len(controls), CRAWLING * np.ptp(controls[-4:])
            if len(controls) > 3 and 3.0 * (1.0 - controls[-1]) > left * far:
                raise PathStopped(Outcome.TOO_MANY_STEPS, controls[-1])
        return last

    try:
        u = path(equations, begin, 0.0).branch.end[0] if found is None else found.u
    except PathStopped:
        given: dict[str, Any] = {"solver": solver, "tolerance": wanted, "cost": Cost()}
        if (found := newton.solve_by_narrowing(equations, begin, 0.0, path, **given)) is None:
            return None
        u = found.u
    full, moved = plan.supports.full(u, 0.0), equations.full_velocity(u, 0.0)
    moved = plan.transport(full, state.control) if moving is None else moved
    return State(plan, state.time, state.control, full, moved)
