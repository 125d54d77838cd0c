"""The strip's way through the stages: what is solved, and where it has arrived."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.continuation import newton
from anmstrip.continuation.expansion import linearised
from anmstrip.continuation.follow import Pace, PathSolver, PathStep, Relaxation, Settings, follow
from anmstrip.continuation.path import (
    LARGEST_PATH_IMBALANCE,
    NEGLIGIBLE_SHARE,
    Cost,
    Equations,
    Outcome,
    PathStopped,
    Tolerances,
)
from anmstrip.equilibrium import Equilibrium, Motion, StageProblem
from anmstrip.errors import InputError
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.results.state import State
from anmstrip.results.wrinkles import buckling, mode_heights
from anmstrip.scene.schema import SceneSpec, StageSpec
from anmstrip.scene.tables import ENDS, THREADING
from anmstrip.simulation.defaults import held_ends
from anmstrip.simulation.problem import Assembly, Weighing
from anmstrip.simulation.stages import Course, uniform_stretch
from anmstrip.timestepping.formulas import Errors, Memory, TimeStep, start_memory
from anmstrip.timestepping.implicit import Stepping, integrate, settle

if TYPE_CHECKING:
    from anmstrip.results.events import Event


MAX_GUESS_CORRECTIONS = 100
"""Iterations on the guess of a threaded strip, after which its path is followed: with 20, strips
that begin deep inside a roller, or on soft contact over a crown, stall."""

GUESS_GROWTH = 2.0
"""Growth of the imbalance that one of these corrections may make (a nonmonotone line search:
Grippo, Lampariello & Lucidi, SIAM J. Numer. Anal. 23, 707, 1986), for contact overshoots where the
strip lifts off before it settles.  On a contact a ten thousandth as stiff a strip is threaded and
started in less than 60 tangents, with 1 in 113."""

WIDER_CONTACT = (1000.0, 100.0, 30.0, 10.0, 3.0, 1.0)
"""Onsets of contact over the given one, by way of which strip is laid where that one fails: on
rollers so crowned that edges bear nothing, or that a taut string just passes.  Strip of 6 kN/m on
crowns of 0.4 to 1.1 mm takes 50 to 66 tangents; with 100 as the first two of five fail, with 10
all.  Weight is put on from 100: with 1000 it fails on a roller of r = 150 mm, crowned by 0.5 mm."""

LEAST_NARROWING = 4.0
"""Ratio of two such onsets, between which another one is tried where the narrower fails.  Web of
50 µm beside which a bar of 6 mm stands in the pass line is laid by way of 1000, 316, 100 …; with
1.2 rollers that crush strip take more than 400 tangents before they are told to."""

SLIDING_IMBALANCE, MAX_SLIDING_BRANCHES = 0.05, 4
"""Imbalance from which strip slides into place on a path, where corrections make it grow, and the
branches of this path.  Lines of 100 to 200 rollers so take 6 tangents, without 10 to 12."""

NEGLIGIBLE_IMBALANCE = 1e-6
"""Imbalance at which a steady stage with free rollers ends as it is.  In a line that is pulled by
18 kN it is 0.02 N, and the drag of a roller's bearings some 10 to 300 N."""

MAX_LAST_CORRECTIONS = 8
"""Iterations at most that balance the state in which a steady stage ends; four lines took one."""

LAST_REDUCTION = 0.01
"""Part of the imbalance that a last correction leaves, else it is done again with a line search:
a shell on a crown that alone guides it ended 2 mm aside at a tolerance of 3e-3."""

BALANCING_FRICTION, MAX_LAST_STATES = 1000.0, 20
"""Widths of the corners of friction over the given ones, from which a state is balanced on a path
where corrections fail, and the states of that.  Strip on three hearth rollers, whose crown makes it
slip forwards and backwards on each, takes 9 tangents; with a width of 10 some 11, and without it
torques are 25 % wrong at a tolerance of 1e-3."""

LONG_PATH_STATES, MAX_STATES = 80, 100
"""States of a steady stage, after which smoother laws lead to its end, and of the path there.  Of
random lines most take 4 to 15.  With 30 a line of four rollers with the law of Norton and Hoff
takes 105 tangents at V_c = 1e-8 m/s, not 76."""

MAX_WEIGHING_STATES = 500
"""States in which weight is put on strip before it runs; four supports 25 m apart take 141.  A loop
of 6 m takes 220 and 428 on elements a quarter and an eighth as long as usual; after 200 of them,
given up, weight that grew as it ran took 730 tangents, and on the shorter ones no end of them."""

WEIGHING_STATES = 12
"""States after which weight is put on by way of wider laws of contact: strip that 4 kN/m pull over
crowned rollers that it only touches takes 36 tangents, not 274."""

MAX_MOVING_IMBALANCE = 0.1
"""Imbalance of a state in time, seen as a stationary one, from which a steady stage begins anew.
Lines that run or have come to rest are below 0.04.  Of 25 random ones whose rollers had just been
moved, at 0.12 to 0.97, four stalled when they went on from there."""

FIRST_STEP = 0.01
"""First time step, of its stage; the error control corrects it.  From the whole stage on the bridle
takes a quarter fewer tangents, and nothing is seen of how it begins to slip; with 0.1 29 scenes
take 23 % fewer, but the length passed, events and plastic strains are less exact."""

COMPRESSION_ROUND_OFF = 1e-9
"""Compression, over the scale of tension, that is round-off."""

MAX_COMPRESSION_GROWTH = 1e4
"""Growth of a compression up to which it is one, and no imprecision."""


@dataclass(frozen=True, repr=False)
class Step:
    """One accepted step.

    The stepper gives the state, what the solver tells, and what the next step needs; the run
    adds the counts over the whole run.
    """

    state: State
    order: int  # of the series
    range: float  # part of λ that the step has covered, or of time (s)
    residual: float  # imbalance that the step leaves, over the force scale
    past: Pace | Memory | None = None  # what the next step needs: of a rate-free path, or in time
    snapped: bool = False  # whether the strip ran away and came to rest, faster than can be dated
    step: int = 0  # number of the step
    tangents: int = 0  # factorised up to here
    end_time: float = 0.0  # at which the run ends (s)
    events: tuple[Event, ...] = ()  # if the scene asks for them

    def __repr__(self) -> str:
        return f"<Step {self.step} of {self.stage!r} to t = {self.time:.6g} s>"

    @property
    def stage(self) -> str:
        """Name of the stage."""
        return self.state.plan.name

    @property
    def time(self) -> float:
        """Time reached (s)."""
        return self.state.time

    @property
    def fraction(self) -> float:
        """Share of the whole run that is done."""
        return self.time / self.end_time

    @property
    def tension_ratio(self) -> float | None:
        """Tension before the first roller over that after it, or None without a roller."""
        return next((reading.tension_ratio for reading in self.state.rollers.values()), None)


class March:
    """The steps of a scene's stages, from the state that the steps before have reached.

    Parameters
    ----------
    assembly : Assembly

    Attributes
    ----------
    full, velocity : ndarray, shape (unknowns,)
    reached : float or None
        λ of a stage that has begun.
    pace, memory
        Of the path in this stage, see :class:`Step`.
    slack : bool
        Whether this stage began with a slack strip, see :meth:`_slack`.
    past : StageProblem or None
        The stage before.
    equations : Equilibrium or None
        Of the rate-free path under way.
    conveyed : float
        Unstressed length (m) of the strip that has been fed in, in time.
    follow : callable
        Follows paths, by series or by Newton's method (``solver.method``).
    """

    def __init__(self, assembly: Assembly) -> None:
        self.assembly, self.scene = assembly, assembly.scene
        series = assembly.scene.solver.method == "series"
        self.follow: PathSolver = follow if series else newton.NewtonPath(own=False)
        self.tolerances = Tolerances(assembly.scene.solver.tolerance)
        self.course, self.solver = Course(assembly), SparseSolver()
        self.cost = Cost(most=assembly.scene.solver.max_tangents)
        self.full = np.zeros(assembly.unknowns)
        self.velocity = np.zeros_like(self.full)
        self.reached: float | None = None
        self.pace: Pace | None = None
        self.memory: Memory | None = None
        self.slack = False
        self.past: StageProblem | None = None
        self.equations: Equilibrium | None = None
        self.conveyed = 0.0

    def planned(self, stage: StageSpec, state: State | None) -> StageProblem:
        """A stage ready to be solved; what it releases goes on as a load."""
        reactions = {}
        for name, control in stage.edges.items():
            if state is not None and control.release and name not in self.course.released:
                reactions[name] = state.edge_force(name) / self.assembly.strip.edges[name].length
                self.course.values |= state.uneven_reaction(name)
        if stage.steady and state is not None and state.plan.in_time:
            self.course.take_over(state)
        if stage.steady and self.reached is None:
            if state is not None and not self.assembly.closed:  # as before it slides into place
                self.course.begun["entry.tension"] = np.array(state.tension("entry"))
            self._begin_steady(stage, state)
        if self.reached is None:
            before, usual = None if state is None else state.friction, self.assembly.friction
            if before is not None and usual is not None:  # at rest, friction is that of v/V_c
                self.velocity = self.velocity * (usual.speed / before.law_of_slip.speed)
            told = (name for name, control in stage.edges.items() if control.speed is not None)
            for name in told:  # along the strip as it hangs there
                along = self.assembly.strip.edge_tangent(name, self.full)
                self.course.values[f"{name}.along"] = along
        plan = self.course.plan(stage, reactions, self.full)
        if stage.steady and self.reached is None and state is not None and state.plan.in_time:
            free = plan.supports.free
            equations = plan.equations()
            imbalance = equations.imbalance(equations.residual(self.full[free], 0.0))
            if imbalance > MAX_MOVING_IMBALANCE and self._let_slide(stage):
                self._begin_steady(stage, replace(state, full=self.full))
                plan = self.course.plan(stage, reactions, self.full)
        if self.reached is None and not np.any(self.full):
            self.slack = plan.pulls_slack_strip
        # where nothing else comes, states in between are drawn as if the pull grew
        return plan.pulled if self.slack and plan.pulled.controls.slope else plan

    def _begin_steady(self, stage: StageSpec, state: State | None) -> None:
        """Prepare the values and the speeds of free rollers that a steady stage begins with."""
        along = self.assembly.strip.edge_tangent("entry", self.full)
        self.course.values["entry.along"] = along  # of the whole stage, also of one resumed
        weighed = self.velocity.any() or np.any(self.course.values.get("gravity", 0.0))
        if stage.gravity is not None and not weighed:
            state = self._weighed(stage, state)
        first = self.assembly.strip.unknowns
        turning = slice(first, first + len(self.assembly.turning))
        self.full = self.full.copy()
        self.full[turning] = self.velocity[turning]
        if self.course.may_begin_running and not self.velocity.any():
            self.full[turning] = self.course.set_going(stage, self.full)
        self.full[self.assembly.coupled - 1] = 0.0  # c counts from its control
        if state is not None and self.course.pulled(stage) and not self.assembly.closed:
            self.course.values["entry.tension"] = np.array(state.tension("entry"))

    def _weighed(self, stage: StageSpec, state: State | None) -> State | None:
        """Put weight on a threaded strip before it runs, where a path does that.

        Rollers onto which only weight presses it cannot carry the drag of their bearings before.
        """
        if self.assembly.thread is None:
            return state
        weighing = Weighing(
            name=stage.name, duration=stage.duration, friction=False, gravity=stage.gravity
        )
        plan = self.course.plan(weighing, {}, self.full)
        with suppress(PathStopped):
            for number, step in enumerate(self.through(plan, MAX_WEIGHING_STATES), start=1):
                weighed = step.state
                if number == WEIGHING_STATES and weighed.control < 1.0:
                    weighed = self._weighed_by_width(plan) or weighed
                if weighed.control == 1.0:
                    self.full, controls = weighed.full, weighed.controls
                    kept = {"gravity", "strip.held"} & controls.keys()  # what labels hold, too
                    self.course.values |= {key: controls[key] for key in kept}
                    return weighed
        return state

    def _weighed_by_width(self, plan: StageProblem) -> State | None:
        """The state at the end of a stage by way of laws of contact that set in over more.

        Where rollers touch strip along a line, its nodes come to bear one by one, each in some
        states of its own.
        """
        _, widest, *narrower = WIDER_CONTACT
        equations, u = plan.equations(), self.full[plan.supports.free]
        few = Settings(
            self.assembly.order, self.tolerances.path, MAX_STATES, rational=True, backwards=0.0
        )
        with suppress(PathStopped):
            *_, last = self.follow(equations.with_wider_laws(widest), u, settings=few, **self.ways)
            u = last.branch.end[0]
            aim = self.tolerances.tolerance
            settings = newton.Corrections(aim, MAX_GUESS_CORRECTIONS, growth=GUESS_GROWTH)
            for width in narrower:
                laws = equations.with_wider_laws(width)
                found = newton.Newton(laws, self.solver, settings, self.cost).corrected(u, 1.0)
                if found is None:
                    return None
                u = found.u
            end, full = plan.start + plan.duration, plan.supports.full(u, 1.0)
            return State(plan, end, 1.0, full, None, conveyed=self.conveyed)
        return None

    def _let_slide(self, stage: StageSpec) -> bool:
        """Let strip that rollers have moved slide into place without friction, and come to rest.

        So the first steady stage begins.  Returns whether that was done: not where strip yields,
        which remembers how it came there, and where its speed is given by what it was.
        """
        given = self.course.pulled(stage) or stage.strip.speed is not None
        if self.assembly.thread is None or self.assembly.flow is not None or not given:
            return False
        sliding = StageSpec(name=stage.name, duration=stage.duration, friction=False)
        plan = self.course.plan(sliding, {}, self.full)
        found = self._corrected(plan.equations(), self.full[plan.supports.free])
        if found is None:
            return False
        self.full, self.velocity = plan.supports.full(found, 0.0), np.zeros_like(self.velocity)
        values = self.course.values
        values |= {key: np.array(0.0) for key in values if key.endswith("speed")}  # all stands
        return True

    @property
    def ways(self) -> dict[str, Any]:
        """The solver and the counters, which all that solves is given."""
        return {"solver": self.solver, "cost": self.cost}

    def here(self, plan: StageProblem) -> State:
        """Return the present state, as one of a stage."""
        velocity = self.velocity if plan.in_time or plan.steady else None
        control = self.reached or 0.0
        time = plan.start + control * plan.duration
        return State(plan, time, control, self.full, velocity, conveyed=self.conveyed)

    def accept(self, step: Step) -> None:
        """Move to the end of a step."""
        state = step.state
        self.full, self.reached, self.conveyed = state.full, state.control, state.conveyed
        self.velocity = np.zeros_like(self.full) if state.velocity is None else state.velocity
        self.pace = step.past if isinstance(step.past, Pace) else None
        self.memory = step.past if isinstance(step.past, Memory) else None

    def newton_correction(self, state: State) -> Array:
        """Return the correction of a state on the rate-free path, of all unknowns.

        Its series and factors are kept for the branch that goes on from there.

        Raises
        ------
        SingularTangentError
        MemoryError
        """
        free, moved = state.plan.supports.free, np.zeros_like(state.full)
        equations, order = self.equations or state.plan.equations(), self.assembly.order
        point = state.full[free], state.control, order
        series, factors = linearised(equations, *point, self.solver, self.cost)
        equations.ahead = (*point, series, factors)
        with self.cost.timed("back-substitution"):
            moved[free] = factors.solve(series.residual)
        return moved

    def finish(self, stage: StageSpec, plan: StageProblem) -> None:
        """Leave a stage."""
        if not plan.steady:
            self.course.finish(stage)
            if plan.name == THREADING:  # it was pulled there
                self.course.hold("exit", self.full)
                self.course.begun["exit"] = self.course.moved["exit"]
        else:
            speed, last = plan.strip_speed(self.full, 1.0), self.assembly.coupled - 1
            self.course.finish(stage, self.full, speed)
            self.course.values["strip.speed"] = np.array(speed)
            self.full = self.full.copy()
            self.full[last] = 0.0
            if self.scene.strip.feed:
                self.velocity = self.velocity.copy()
                self.velocity[: self.assembly.strip.unknowns] = 0.0
                self.velocity[last] = speed
        self.reached, self.pace, self.slack, self.past = None, None, False, plan
        self.equations = None

    def through(self, plan: StageProblem, steps: int, *, between: bool = False) -> Iterator[Step]:
        """Steps to the end of a stage, at most so many; each must be accepted.

        ``between`` asks for the states between those at their ends as well.  Smoother laws may lead
        to the end of a steady stage without them.

        Raises
        ------
        PathStopped
        """
        tolerance = self.tolerances.time_residual if plan.in_time else self.tolerances.path
        rational = not self.scene.output.events  # events are roots of polynomials
        settings = Settings(self.assembly.order, tolerance, steps, rational=rational)
        if plan.in_time:
            yield from self._in_time(plan, settings)
        else:
            yield from self._rate_free(plan, settings, direct=plan.steady and not between)

    def _rate_free(self, plan: StageProblem, settings: Settings, direct: bool) -> Iterator[Step]:
        path = self._settled if direct else self._path
        u, equations = self._start(plan)
        self.equations = equations
        begun, floor = self.reached or 0.0, 0.0
        imbalance = equations.imbalance(equations.residual(u, begun))
        if imbalance < LARGEST_PATH_IMBALANCE:  # not of a guess
            floor = equations.round_off(u, begun)
        tolerance = max(settings.tolerance, floor)
        relaxation: Relaxation = "ahead"
        if plan.steady:  # its end is balanced, and strip that yields remembers
            relaxation = "whole" if self.assembly.flow is None else "branch"
        settings = replace(settings, tolerance=tolerance, relaxation=relaxation)
        if self.assembly.thread is not None:  # an arch may ask for less than nothing, a line not
            settings = replace(settings, backwards=0.0)
        for step in path(equations, u, settings):
            (u, control), imbalance = step.branch.end, step.imbalance
            if plan.steady and control == 1.0:
                u, imbalance = self._balanced(equations, u, imbalance)
            branch = step.branch if equations.controls is plan.controls else None
            time = plan.start + control * plan.duration
            full = plan.supports.full(u, control)
            velocity = plan.transport(full, control)
            state = State(plan, time, control, full, velocity, branch, self.conveyed)
            covered = abs(control - float(step.branch.control[0]))
            yield Step(state, step.branch.order, covered, imbalance, step.pace)

    def _balanced(self, equations: Equilibrium, u: Array, imbalance: float) -> tuple[Array, float]:
        """The state in which a steady stage ends, balanced as far as digits go, and what is left.

        Balanced to the tolerance the drag of free rollers would be wrong by that share of the
        line's tension, which is many times as large, and the tension of 20 µm foil after a roller
        of 10 mm by seven times that share.  Where corners of friction turn the iteration back and
        forth, each correction is shortened until it helps.
        """
        floor = newton.ROUND_OFF_MARGIN * equations.round_off(u, 1.0)
        if imbalance <= max(floor, NEGLIGIBLE_IMBALANCE):
            return u, imbalance
        begin, kept, slow = imbalance, newton.TANGENT_REUSE_RATIO, newton.SLOW_CONVERGENCE_RATIO
        patient = newton.Corrections(floor, MAX_LAST_CORRECTIONS, slow, kept=kept)
        quick = replace(patient, uncounted=0.0, least=1, helpful=slow, near=np.inf)
        for aim in (quick, patient):
            found = newton.Newton(equations, self.solver, aim, self.cost).corrected(u, 1.0)
            if found is not None and found.imbalance < imbalance:
                u, imbalance = found.u, found.imbalance
            if imbalance < LAST_REDUCTION * begin:
                return u, imbalance
        last = self._balanced_by_narrowing(equations, u, max(floor, NEGLIGIBLE_IMBALANCE))
        if last is not None and last.imbalance < imbalance:
            u, imbalance = last.branch.end[0], last.imbalance
        return u, imbalance

    def _balanced_by_narrowing(
        self, equations: Equilibrium, u: Array, tolerance: float
    ) -> PathStep | None:
        """The last step to a balanced state nearby, from friction that turns round less sharply."""
        laws = equations.smoother(BALANCING_FRICTION)
        if laws is None:
            return None
        aim = newton.Corrections(tolerance, MAX_LAST_CORRECTIONS, near=np.inf)
        found = newton.Newton(laws[1], self.solver, aim, self.cost).corrected(u, 0.0)
        if found is None:
            return None
        order, few = self.assembly.order, MAX_LAST_STATES
        settings = Settings(order, tolerance, few, rational=True, give_way=False)
        with suppress(PathStopped):
            *_, last = self.follow(laws[1], found.u, settings=settings, **self.ways)
            return last
        return None

    def _path(self, equations: Equilibrium, u: Array, settings: Settings) -> Iterator[PathStep]:
        """Steps of a path from where it has come to."""
        return self.follow(equations, u, settings=settings, pace=self.pace, **self.ways)

    def _settled(self, equations: Equilibrium, u: Array, settings: Settings) -> Iterator[PathStep]:
        """Steps of a steady stage; where they are many or stall, the last is by smoother laws."""
        pace, stopped = self.pace or Pace(0.0, 1.0), PathStopped(Outcome.NOT_ENDED, 0.0)
        try:
            if not _many(pace):
                for step in self._path(equations, u, settings):
                    yield step
                    u, pace = step.branch.end[0], step.pace
                    if _many(pace):
                        break
                else:
                    return
        except PathStopped as reason:
            if reason.outcome not in {Outcome.STALLED, Outcome.FOLD}:
                raise
            stopped = reason
        found = self._narrowed(equations, u, pace.control, settings, stopped)
        if found is not None:
            yield newton.straight_step(u, pace.control, found)
            return
        if stopped.outcome is Outcome.NOT_ENDED:
            self.pace = replace(pace, taken=pace.taken + 1)
            try:
                yield from self._path(equations, u, settings)
                return
            except PathStopped as reason:
                reason.width, stopped = stopped.width, reason
        raise stopped

    def _narrowed(
        self,
        equations: Equilibrium,
        u: Array,
        control: float,
        settings: Settings,
        stopped: PathStopped,
    ) -> newton.Corrected | None:
        """Stationary state at the end of a stage by way of smoother laws, None if there is none."""
        few = replace(settings, max_steps=MAX_STATES, give_way=False, rational=True)
        aim = settings.tolerance

        def path(laws: Equations, u: Array, start: float) -> PathStep:
            *_, last = self.follow(laws, u, settings=few, start=start, **self.ways)
            return last

        given: dict[str, Any] = {"tolerance": aim, "stopped": stopped, **self.ways}
        return newton.solve_by_narrowing(equations, u, control, path, **given)

    def _start(self, plan: StageProblem) -> tuple[Array, Equilibrium]:
        """First point of a rate-free path, and its equations."""
        free, u = plan.supports.free, self.full[plan.supports.free]
        equations = plan.equations()
        found: Array | None = None
        if plan.name == THREADING and self.reached is None:
            assert self.assembly.thread is not None
            u = self.assembly.laid[free]
            found = self._corrected(equations, u)
            if found is None:
                found = self._corrected_by_width(equations, u)
        elif self.slack:
            pulled = plan.pulled
            equations = pulled.equations()
            if self.reached is None:
                begin = pulled.controls.at(0.0)
                u = uniform_stretch(self.assembly, pulled.pull_at_exit(0.0), begin)[free]
                found = self._corrected(equations, u)
        elif self.assembly.imperfection is not None and not np.any(self.full):
            found = self._corrected(equations, self.assembly.imperfection[free])
        elif self._lies_flat(plan):
            holds = held_ends(self.scene)
            if len(holds) < len(ENDS):  # it lengthens without stress
                begin = plan.controls.at(0.0)
                u = uniform_stretch(self.assembly, 0.0, begin, *holds)[free]
            found = self._corrected(equations, u)
        return u if found is None else found, equations

    def _corrected_by_width(self, equations: Equilibrium, guess: Array) -> Array | None:
        """The state near a guess by way of laws of contact that set in over longer distances."""
        aims, reached = [*reversed(WIDER_CONTACT)], np.inf
        while aims:
            found = self._corrected(equations.with_wider_laws(aims[-1]), guess)
            if found is not None:
                guess, reached = found, aims.pop()
            elif LEAST_NARROWING * aims[-1] < reached < np.inf:
                aims.append(float(np.sqrt(aims[-1] * reached)))
            else:
                return None
        return guess

    def _lies_flat(self, plan: StageProblem) -> bool:
        """Return whether strip that would not be flat unstressed still lies in its plane."""
        given = plan.controls.at(0.0).items()
        shaped = any(np.any(value) for key, value in given if key.startswith("strip."))
        return shaped and not np.any(self.full)

    def _corrected(self, equations: Equilibrium, guess: Array) -> Array | None:
        """The state near a guess, perhaps with a path still to go, or None if there is none.

        Near to it corrections of a long line may fail, for its strip slides round many rollers by
        what each of them makes its way longer: this is a path along the rollers, not straight.
        """
        aim = self.tolerances.tolerance
        settings = newton.Corrections(
            aim, MAX_GUESS_CORRECTIONS, growth=GUESS_GROWTH, near=SLIDING_IMBALANCE
        )
        found = newton.Newton(equations, self.solver, settings, self.cost).corrected(guess, 0.0)
        if found is None:
            return None
        aim = max(aim, equations.round_off(found.u, 0.0))
        if found.imbalance <= aim:
            return found.u
        few = Settings(tolerance=aim, max_steps=MAX_SLIDING_BRANCHES, give_way=False, rational=True)
        try:
            *_, last = self.follow(equations, found.u, settings=few, **self.ways)
            return last.branch.end[0]
        except PathStopped:
            settings = replace(settings, near=0.0)
            found = newton.Newton(equations, self.solver, settings, self.cost).corrected(
                found.u, 0.0
            )
            return None if found is None else found.u

    def _in_time(self, plan: StageProblem, settings: Settings) -> Iterator[Step]:
        solver, memory = self.scene.solver, self._memory(plan)
        aim, most = self.tolerances.tolerance, solver.highest_time_order
        stages_in_time = sum(map(self.assembly.frictional, self.scene.course))
        whole = stages_in_time * plan.duration  # every stage may add as much to the error
        stepping = Stepping(whole, aim, most, solver.time_step, self.follow)
        given = plan.model, plan.supports, plan.controls, plan.start, plan.duration
        motion = Motion(*given, plan.before(self.past))
        ways = {**self.ways, "stepping": stepping}
        friction, ends = self.assembly.friction, [plan.start + plan.duration]
        if friction is not None and solver.time_step is None:
            ends = [*plan.reversals(friction.speed / NEGLIGIBLE_SHARE), *ends]
        begin, velocity = memory.times[0], self.velocity
        if not memory.settled:
            memory = replace(memory, step=min(memory.step, ends[0] - begin))
            memory = self._begun(plan, motion, memory, settings=settings, **ways)
            velocity = plan.moving(0.0)
            velocity[plan.supports.free] = memory.v
        for until, following in zip(ends, [*ends[1:], np.inf], strict=True):
            if until > memory.times[0]:
                for step in integrate(motion, memory, until, settings=settings, **ways):
                    memory = step.memory
                    settings = replace(settings, max_steps=settings.max_steps - 1)
                    taken = self._step(plan, replace(step, start=begin), settings.order, velocity)
                    yield taken
                    assert taken.state.velocity is not None
                    begin, velocity = step.end, taken.state.velocity
            if memory.times[0] == until < ends[-1]:  # slip turns round: it begins anew
                now = memory.errors and Errors(memory.errors.after, memory.errors.after, 0.0)
                past = memory.states[0], memory.v
                memory = start_memory(until, *past, min(self._first(plan), following - until), now)

    def _begun(self, plan: StageProblem, motion: Motion, memory: Memory, **ways: Any) -> Memory:
        """The memory of a stage that begins anew, with the velocity after its first instant.

        Where the line stands it is found with the line's own V_c, in as short an instant as strip
        creeps no farther by that: friction at rest is that of v/V_c, and slip that has to settle
        would turn round corners without end by a much smaller one.
        """
        usual, friction = self.assembly.friction, plan.friction
        if usual is None or friction is None or friction.law_of_slip.speed == usual.speed:
            return settle(motion, memory, **ways)
        ratio = friction.law_of_slip.speed / usual.speed
        wide = [effect.at_speed(usual.speed) for effect in plan.model.effects]
        brief = replace(memory, step=ratio * memory.step)
        found = settle(replace(motion, model=plan.model.with_effects(wide)), brief, **ways)
        return replace(found, v=ratio * found.v, step=memory.step)

    def _step(self, plan: StageProblem, step: TimeStep, order: int, before: Array) -> Step:
        """An accepted step in time, as one of the march, with the velocity that it began with."""
        control = (step.end - plan.start) / plan.duration
        velocity = plan.moving(control)
        velocity[plan.supports.free] = step.v
        covered = step.end - step.start
        full, within = plan.supports.full(step.u, control), None if step.snap else step
        state = State(plan, step.end, control, full, velocity, step=within)
        if plan.fed:
            speeds = (before + velocity)[self.assembly.coupled - 1]  # linear in a step
            state = replace(state, conveyed=self.conveyed + 0.5 * covered * float(speeds))
        return Step(state, order, covered, step.imbalance, step.memory, step.snap)

    def _memory(self, plan: StageProblem) -> Memory:
        """The past of a stage in time: that of the stage before, if nothing jumps.

        No formula looks back across a jump of an acceleration.
        """
        past, memory, first = self.past, self.memory, self._first(plan)
        fresh = past is not None and (plan.still or past.still or not plan.continues(past))
        if memory is not None and not fresh:
            if past is None or plan.continues(past, smoothly=True):
                return memory
            latest = memory.times[:1], memory.states[:1], memory.v
            return Memory(*latest, first, errors=memory.errors)
        free, errors = plan.supports.free, None
        if memory is not None and memory.errors is not None and past is not None:
            whole = np.zeros((len(memory.errors.after), len(self.full)))
            whole[:, past.supports.free] = memory.errors.after
            errors = Errors(whole[:, free], whole[:, free], 0.0)
        return start_memory(plan.start, self.full[free], self.velocity[free], first, errors)

    def _first(self, plan: StageProblem) -> float:
        """First time step (s) of a stage that begins anew: all of it if nothing is to move."""
        first = plan.duration * (1.0 if plan.still else FIRST_STEP)
        return self.scene.solver.time_step or first


def _many(pace: Pace) -> bool:
    """Whether a path of stationary states has just become long."""
    return pace.taken == LONG_PATH_STATES and pace.control < 1.0


@contextmanager
def delay_interrupts() -> Iterator[None]:
    """Let Ctrl-C, and SIGTERM where it is handled, wait until the body has ended.

    For what has to be changed and written together; they do what they do afterwards.  In other
    threads than the main one, where Python never raises ``KeyboardInterrupt``, there is nothing
    to wait for.

    Examples
    --------
    >>> import os, signal
    >>> before = signal.signal(signal.SIGINT, signal.default_int_handler)
    >>> done = []
    >>> try:
    ...     with delay_interrupts():
    ...         os.kill(os.getpid(), signal.SIGINT)
    ...         done.append("all of it")
    ... except KeyboardInterrupt:
    ...     done.append("then the interruption")
    >>> done
    ['all of it', 'then the interruption']
    >>> handler = signal.signal(signal.SIGINT, before)
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    usual = {s: handler for s, handler in signals.items() if callable(handler)}
    pressed: list[tuple[Any, ...]] = []
    for number in usual:
        signal.signal(number, lambda *given: pressed.append(given))
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
        if pressed:
            usual[pressed[-1][0]](*pressed[-1])


def imperfection_of(scene: SceneSpec) -> Array:
    """Displacement of the flat strip that makes no stress, shape (unknowns,).

    Raises
    ------
    InputError
        The perfect strip does not reach the end of the first stage, or hardly is compressed there.
    """
    assert scene.strip.imperfection is not None
    state = _perfect(scene)
    factors, modes = buckling(state, mode := scene.strip.imperfection.mode)
    if len(factors) < mode or factors[-1] <= 0.0:
        raise _refused(scene, f"{int((factors > 0.0).sum())} modes buckle it there")
    if factors[-1] > MAX_COMPRESSION_GROWTH:
        raise _refused(scene, f"it would take {factors[-1]:.1g} times as much to buckle it")
    return mode_heights(state, modes[:, -1]) * scene.strip.imperfection.amplitude


def _perfect(scene: SceneSpec) -> State:
    """Return the perfect and elastic strip at the end of the first stage."""
    perfect = scene.with_values(strip={"imperfection": None}, material={"plasticity": None})
    march = March(Assembly(perfect))
    plan = march.planned(perfect.course[0].model_copy(update={"friction": False}), None)
    try:
        *_, last = march.through(plan, scene.solver.max_steps)
    except PathStopped as stopped:
        raise _refused(scene, f"without imperfection it stops: {stopped}") from stopped
    if last.state.principal_forces.min() > -COMPRESSION_ROUND_OFF * march.assembly.scales.tension:
        raise _refused(scene, "nothing compresses it")
    return last.state


def _refused(scene: SceneSpec, found: str) -> InputError:
    """The scene has no buckling mode to be bent by."""
    spec = scene.strip.imperfection
    assert spec is not None
    value = {"mode": spec.mode, "amplitude": spec.amplitude}
    expected = f"a first stage, threading included, that ends compressed across or along; {found}"
    hint = "no imperfection, or a first stage in which the strip is compressed"
    return scene.refused("strip.imperfection", value, expected, hint)
