"""Stages as equations: which unknowns are held, and how the controls move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from anmstrip.arrays import Array
from anmstrip.equilibrium import Model, StageProblem
from anmstrip.fem.sampling import l2_projection, quadrature_points, shape_of
from anmstrip.fem.strip import Joint, Supports
from anmstrip.mechanics.effects import Controls
from anmstrip.mechanics.loads import Onward
from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.shell import eigenstrain, uneven_tension, uniaxial_stretches
from anmstrip.results.state import State
from anmstrip.scene.schema import StageSpec
from anmstrip.scene.tables import ENDS, THREADING
from anmstrip.simulation.defaults import (
    CREEP_SHARE,
    bending_stiffness,
    bent_curvature,
    elastic_creep,
    pulled_nowhere,
)
from anmstrip.simulation.meshing import label_at, surface_speed
from anmstrip.simulation.problem import Assembly, middle_node

ALIGNED_SINE = 0.02
"""Sine of the angle, 1°, up to which a velocity is that of strip that passes a held end."""

INITIAL_SPEED_SHARE = 0.1
"""Share of its speeds at which a steady stage with idlers, or of unguided strip, begins: there the
elastic creep is as fast as V_c by default."""


@dataclass
class Course:
    """Values that the stages so far have left, from which the next one starts.

    Attributes
    ----------
    moved : dict
        Edge → displacement of its held components (m), shape (3,).
    values : dict
        Control → value.
    released : set
        Edges let go.
    time : float
        s.
    begun : dict
        Edge → displacement (m) of a threaded strip at the beginning, from which moves count.
    speeds : dict
        Edge → velocity (m/s) of its held components, which lasts until a stage changes it.
    outward : dict
        Edge → direction in which a threaded strip goes on beyond it, where its tension pulls.
    """

    assembly: Assembly
    moved: dict[str, Array] = field(default_factory=dict)
    values: dict[str, Array] = field(default_factory=dict)
    released: set[str] = field(default_factory=set)
    time: float = 0.0
    begun: dict[str, Array] = field(default_factory=dict)
    speeds: dict[str, Array] = field(default_factory=dict)
    outward: dict[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        thread = self.assembly.thread
        if thread is not None:  # begin at the ends, pulled at the exit
            entry, exit, *outward = thread.ends_in_space(self.assembly.strip)
            self.begun = {"entry": entry, "exit": exit}
            self.moved.update(self.begun)
            self.outward = dict(zip(("entry", "exit"), outward, strict=True))
            if not self.assembly.closed:
                self.values["exit.force"] = thread.tension * self.outward["exit"]
        if self.assembly.flow is not None:  # a threaded strip begins as an elastic one
            self.values["yielding"] = np.array(float(thread is None))
        self.values |= self.assembly.natural(self.assembly.scene.strip)
        if self._is_laid(self.assembly.scene.stages[0]):  # flat at first
            self.values |= {key: np.array(0.0) for key in self._curls()}
        if self.assembly.conveyed:
            self.values["strip.speed"] = np.array(0.0)
        if self.assembly.growth is not None:
            self.values["strip.held"] = self.assembly.growth.nothing
        for roller in self.assembly.rollers:
            key, rest = f"rollers.{roller.name}", ("surface_speed", "torque")
            self.values[f"{key}.centre"] = np.array(roller.centre, dtype=float)
            self.values |= {f"{key}.{name}": np.array(0.0) for name in rest}
        for name in self.assembly.pressing:
            self.values[f"rollers.{name}.press"] = np.array(self.assembly.begun_press(name))

    def _is_laid(self, stage: StageSpec) -> bool:
        """Return whether a stage lays flat strip: its own curvature grows in it.

        As it does it is everywhere as far off the rollers as at the end.  All of it before any load
        would have the strip stand on a roller or two: a sheet that took 2 560 tangents for 3e-5 of
        the stage takes 82.  Without rollers a clamped strip that is curved by 1.6 would be led from
        the forces that hold it flat to none, which it leaves at a limit point.
        """
        scene = self.assembly.scene
        pressed = stage.gravity is not None or stage.pressure is not None
        free = not (scene.rollers or stage.edges or stage.strip.natural)
        return (pressed or free) and stage is scene.stages[0] and not scene.threading

    def _curls(self) -> dict[str, Array]:
        """Return curvatures that the strip has without moments."""
        natural = self.assembly.natural(self.assembly.scene.strip)
        return {key: natural[key] for key in ("strip.coil_set", "strip.crossbow") if key in natural}

    def plan(
        self, stage: StageSpec, reactions: dict[str, Array], full: Array | None = None
    ) -> StageProblem:
        """Prepare a stage.

        Parameters
        ----------
        stage : StageSpec
        reactions : dict
            Held edge → mean force (N/m), loads included, for those that the stage releases;
            without, as before a run, what it was loaded with.
        full : ndarray, shape (unknowns,), optional
            State at the beginning, of whose surfaces a stage without friction keeps the travel.
        """
        for name, control in stage.edges.items():
            if control.release and name not in self.released:
                self.released.add(name)
                force = self.values.get(f"{name}.force", np.zeros(3))
                if (tension := self.values.pop(f"{name}.tension", None)) is not None:
                    outward = 1.0 if name == "exit" else -1.0
                    force = force + outward * tension * self._directions[name]
                self.values[f"{name}.force"] = reactions.get(name, force)
        start = dict(self.values)
        end = self._targets(stage, start)
        end |= self.uneven_pull(stage, end)
        start |= self.uneven_pull(stage, start)
        if self.pulled(stage) and "entry.tension" in end:  # before a run, which knows what it was
            start.setdefault("entry.tension", end["entry.tension"])
        for name in end:
            start.setdefault(name, np.zeros_like(end[name]))
        slope = {n: end[n] - start[n] for n in end if np.any(end[n] != start[n])}
        for roller in self.assembly.rollers:
            key = f"rollers.{roller.name}"
            start[f"{key}.velocity"] = slope.get(f"{key}.centre", np.zeros(3)) / stage.duration
        follows = self.assembly.growth is not None
        curve = self._take_up(stage, start, slope) if follows else {}
        effects = self.assembly.effects(stage, start)
        self.assembly.check_added(stage, start)
        a, pull = self.assembly, self._pull(full) if self.pulled(stage) else None
        goes_on = "exit" in self.outward and not (a.closed or self._held().get("exit"))
        if goes_on and stage.steady and a.yields(stage):
            effects.append(Onward(a.strip, "exit", a.scales.tension))
        if self.fed(stage):
            edge, direction, tied = self.passing
            effects.append(a.passage(edge, direction, tied))
            before, after = (tied * float(v @ direction) for v in self._speeds(stage, edge))
            start["strip.passing"] = np.array(before)
            if after != before:
                slope["strip.passing"] = np.array(after - before)
        strains = a.plasticity(stage)
        units = np.zeros(0) if strains is None else strains.units
        given = a.scales_in(stage), a.turning, len(a.pressing), a.conveyed, pull, units
        return StageProblem(
            name=stage.name,
            start=self.time,
            duration=stage.duration,
            model=Model(a.strip, a.pattern, effects, *given),
            supports=self.supports(stage, full),
            controls=Controls(start, slope, curve),
            in_time=a.frictional(stage),
            steady=stage.steady,
            fed=self.fed(stage),
        )

    def uneven_pull(self, stage: StageSpec, values: Mapping[str, Array]) -> dict[str, Array]:
        """Return what uneven strip, which goes on beyond its ends, pulls there besides the mean.

        ``NAME.unevenness`` (N/m), at ends of a threaded shell that are free along it: an even pull
        on longer and shorter fibres alike would press it across beside the edge.  ``NAME.slack``
        (N/m) is the tension at which the longest bears none.
        """
        a, found = self.assembly, dict[str, Array]()
        if a.thread is None or a.closed or a.membrane is None or shape_of(a.strip) != "quad":
            return found
        for name in ENDS:
            excess = uneven_tension(a.strip, name, values)
            if excess is not None and not self._holds_along(name, self._held(stage)):
                found[f"{name}.unevenness"] = excess
                if (held := f"{name}.uneven_force") in values:  # of which that is the most
                    found[held] = 0.0 * values[held]
                found[f"{name}.slack"] = -excess.min(keepdims=True)
        return found

    def _take_up(
        self, stage: StageSpec, start: dict[str, Array], slope: dict[str, Array]
    ) -> dict[str, Array]:
        """Add controls of the strip that runs take up, and return their curves.

        In time these are quadratic where nips push strip into runs at speeds that change.
        """
        held, bent = start["strip.held"], 0.0 * start["strip.held"]
        change, rates, curve = slope.get("strip.held", bent), (bent, bent), dict[str, Array]()
        if not stage.steady:
            _, gathered = self.assembly.gathered_in(stage)
            bent[: len(gathered)] = gathered
            rates = (change - bent) / stage.duration, (change + bent) / stage.duration
        begun, ended = self.growing(held, rates[0]), self.growing(held + change, rates[1])
        if bent.any():
            curve["strip.held"] = bent
            curve["strip.growth"] = self.growing(bent, bent)["strip.growth"] - 1.0
        steeper = {key: ended[key] - begun[key] - curve.get(key, 0.0) for key in begun}
        start |= begun
        slope |= {key: each for key, each in steeper.items() if np.any(each)}
        return curve

    def growing(self, held: Array, rates: Array) -> dict[str, Array]:
        """Controls where runs hold so much more strip (m), which changes at rates (m/s).

        The stretch g that labels hold, ``strip.growth``, at the quadrature points, and the speed
        (m/s) that this adds to what passes them, ``strip.drift``; that at ends and at rollers.
        """
        growth, a = self.assembly.growth, self.assembly
        assert growth is not None
        x = quadrature_points(a.strip)[0]
        whole = growth.up_to(growth.x[-1:], rates)[0]
        last = whole if self.passing[0] == "exit" else 0.0
        found = {
            "strip.held": held,
            "strip.taking_up": rates,
            "strip.growth": growth.at(x, held),
            "strip.drift": last - growth.up_to(x, rates),
            "entry.drift": np.array(last),
            "exit.drift": np.array(last - whole),
        }
        for roller in a.rollers:
            label = np.array(label_at(roller, growth.thread))
            found[f"rollers.{roller.name}.drift"] = last - growth.up_to(label, rates)
        return found

    def fed(self, stage: StageSpec) -> bool:
        """Whether material passes labels that stay, in time."""
        return bool(self.assembly.scene.strip.feed) and self.assembly.rubs(stage)

    @property
    def passing(self) -> tuple[str, Array, bool]:
        """End of a fed strip whose label stays, the direction there, (3,), and if it is held along.

        The exit, if it alone is held along the strip, else the entry.
        """
        entry, exit = (self._holds_along(name, self._held()) for name in ENDS)
        edge = "exit" if exit and not entry else "entry"
        return edge, self._along(edge), entry or exit

    def pulled(self, stage: StageSpec) -> bool:
        """Whether a steady stage has the tension of its entry given, and the strip's speed not."""
        if not stage.steady or self.assembly.closed:
            return stage.steady
        given = None
        for each in self.assembly.scene.up_to(stage):
            if each.steady and each.strip.speed is not None:
                given = "strip.speed"
            elif each.steady and each.edge("entry").tension is not None:
                given = "entry.tension"
        return given == "entry.tension"

    def _asked_speed(self, stage: StageSpec, roller: Roller) -> float | None:
        """The surface speed (m/s) that a stage asks of a roller, None if none.

        Of a steady one of the scene, which may begin with other speeds than the stage before has
        ended with, the last that was asked for; one of a map goes on from where it has come to.
        """
        scene = self.assembly.scene
        known = stage.steady and any(each.name == stage.name for each in scene.course)
        stages = scene.up_to(stage) if known else (stage,)
        asked = (surface_speed(each, roller) for each in reversed(stages))
        return next((speed for speed in asked if speed is not None), None)

    def _pull(self, full: Array | None) -> Array:
        """Weights that sum up what holds the entry along the strip, (unknowns of the strip,).

        Of an endless strip what holds it at the joint of exit and entry, which must be nothing.
        """
        strip = self.assembly.strip
        edge, pull = strip.edges["entry"], np.zeros((strip.scalars, strip.count))
        along = self.values.get("entry.along")
        if along is None:
            along = strip.edge_tangent("entry", np.zeros(strip.unknowns) if full is None else full)
        along = strip.kinematics.pick(along)
        pull[edge.values] = along / np.linalg.norm(along)
        if self.assembly.closed:
            pull[strip.edges["exit"].values] = pull[edge.values]
        return pull.ravel()

    @property
    def joint(self) -> Joint | None:
        """Joint at which the exit of an endless strip goes on as its entry."""
        strip = self.assembly.strip
        if not self.assembly.closed:
            return None
        edges, slopes = (strip.edges[name] for name in ENDS), strip.dofs("u_x")
        entry, exit = (
            np.append(strip.unknowns_of(e.trace), strip.unknowns_of(slopes[e.nodes])) for e in edges
        )
        jump = np.zeros(len(entry))
        jump[: strip.count] = strip.kinematics.pick([-strip.length, 0.0, 0.0])
        return Joint(entry, exit, jump)

    def take_over(self, state: State) -> None:
        """Begin a steady stage from a state in time: its entry is held as it is."""
        from anmstrip.mechanics.transport import strip_speed

        speed, velocity = state.strip_speed, state.velocity
        assert velocity is not None
        if speed is None:
            speed = strip_speed(self.assembly.strip, state.full, velocity)
        self.hold_entry_again()
        self.hold("entry", state.full)
        self.values["strip.speed"] = np.array(speed)

    def hold_entry_again(self) -> None:
        """Hold the entry that stages in time have let go, as a steady one does."""
        self.released.discard("entry")
        for kind in ("force", "uneven_force"):
            self.values.pop(f"entry.{kind}", None)

    def hold(self, name: str, full: Array) -> None:
        """Hold an edge where it is in a state, (unknowns,), as far as it is held."""
        strip = self.assembly.strip
        places = strip.nodal(full)[strip.edges[name].values]
        self.moved[name] = strip.kinematics.embed(places[0])

    @property
    def guided(self) -> bool:
        """Whether the strip stays in its plane, or an edge holds it in y."""
        a = self.assembly
        centred = any(edge.centred for edge in a.scene.edges.values())
        held = any("y" in components for components in self._held().values())
        return 1 not in a.strip.kinematics.components or centred or held

    @property
    def may_begin_running(self) -> bool:
        """Whether a threaded strip is unguided, or has rollers that turn freely at a usual V_c.

        A crown drives strip off that slides on it, and guides strip that it carries along: on the
        way from rest nothing holds unguided strip where the one becomes the other, at 0.5 % of the
        speed for a crown of 0.1 mm/m², and the path went on 1.5 m beside it.  With V_c below its
        default, point after point begins to slip: down to 1e-8 m/s a line of four rollers takes up
        to 233 tangents, from rest up to 76.
        """
        a = self.assembly
        if a.friction is None or a.thread is None:
            return False
        usual = a.friction.speed > 0.99 * CREEP_SHARE * elastic_creep(a.scene)
        return not self.guided or bool(a.turning and usual)

    def set_going(self, stage: StageSpec, full: Array) -> Array:
        """Let a strip at rest run slowly, INITIAL_SPEED_SHARE; return the speeds of free rollers.

        From rest, bearings would begin to brake at about V_c: a line of forty rollers takes 14
        tangents, so 5.  Those that the strip does not touch rest.  A threaded strip under T with
        the stretch λ sticks to rollers that run at c (λ − 3 D κ²/(2 E t)), with the membrane force
        of strip that is bent to κ (m/s).  The pull at its exit may have grown since.
        """
        a, end = self.assembly, self._targets(stage, dict(self.values))
        assert a.thread is not None and a.friction is not None and a.scene.threading is not None
        pull = float(np.linalg.norm(self.values.get("exit.force", 0.0)))
        pull += float(self.values.get("exit.tension", 0.0))
        grown = (pull - a.scene.threading.tension) / a.strip.tensile_stiffness if pull else 0.0
        bent, turns = 1.5 * bending_stiffness(a.scene) / a.strip.tensile_stiffness, a.thread.turns
        sticking = {
            r.name: a.thread.stretch(label_at(r, a.thread))
            + grown
            - bent * bent_curvature(a.scene, r.radius, turns.get(r.name, 0.0)) ** 2
            for r in a.rollers
        }
        driven = {r: f"rollers.{r}.surface_speed" for r in sticking if r not in a.turning}
        speed = float(end["strip.speed"])
        if self.pulled(stage):
            speed = max((float(end[driven[r]]) / sticking[r] for r in driven), key=abs, default=0.0)
        self.values |= {key: INITIAL_SPEED_SHARE * end[key] for key in driven.values()}
        self.values["strip.speed"] = np.array(INITIAL_SPEED_SHARE * speed)
        assert a.rubbing is not None
        near = a.rubbing.contact.elements_near(full, self.values)
        touched = {r.name: elements.size > 0 for r, elements in zip(a.rollers, near, strict=True)}
        running = INITIAL_SPEED_SHARE * speed
        return np.array([running * sticking[name] * touched[name] for name in a.turning])

    def finish(self, stage: StageSpec, full: Array | None = None, speed: float = 0.0) -> None:
        """Remember where a stage has ended; if it was steady, in which state and at which speed."""
        self.values.update(self._targets(stage, dict(self.values)))
        for name in self._held():
            self.moved[name] = self._destination(stage, name)
            self.speeds[name] = self._speeds(stage, name)[1]
            if full is not None:
                self.speeds[name] = speed * self.assembly.strip.edge_tangent(name, full)
                if self.assembly.scene.strip.feed and name in ENDS:
                    passing = np.copysign(np.linalg.norm(self.speeds[name]), speed)
                    self.speeds[name] = passing * self._along(name)
        self.time += stage.duration

    def _targets(self, stage: StageSpec, start: dict[str, Array]) -> dict[str, Array]:
        kept = {"entry.tension"} if self.pulled(stage) else set[str]()
        end = start | {key: self.begun[key] for key in kept & self.begun.keys()}
        for name, edge in stage.edges.items():
            if edge.force is not None:
                end[f"{name}.force"] = np.array(edge.force, dtype=float)
            elif edge.release and pulled_nowhere(self.assembly.scene):
                end[f"{name}.force"] = np.zeros(3)  # what friction or weight alone made it bear
            uneven, threaded = f"{name}.uneven_force", name in self.outward
            anew = edge.force is not None or (edge.tension is not None and not threaded)
            if uneven in start and (anew or (edge.release and pulled_nowhere(self.assembly.scene))):
                end[uneven] = 0.0 * start[uneven]
            scalar = stage.steady and name == "entry"  # the strip's speed answers to it
            guided = scalar or "z" in self._held().get(name, ())
            if edge.tension is not None and name in self.outward and not guided:
                end[f"{name}.force"] = edge.tension * self.outward[name]
            elif edge.tension is not None:
                end[f"{name}.tension"] = np.array(edge.tension, dtype=float)
                if edge.force is None and f"{name}.force" in end:
                    end[f"{name}.force"] = np.zeros(3)
        plain: dict[str, Any] = {"gravity": stage.gravity, "pressure": stage.pressure}
        plain["strip.speed"] = stage.strip.speed
        plain |= {f"{name}.moment": edge.moment for name, edge in stage.edges.items()}
        if self.assembly.yields(stage):
            end["yielding"] = np.array(1.0)
        if self._is_laid(stage):
            end |= self._curls()
        end |= self.assembly.natural(stage.strip)
        for roller in self.assembly.rollers:
            key = f"rollers.{roller.name}"
            plain[f"{key}.surface_speed"] = self._asked_speed(stage, roller)
            plain[f"{key}.torque"] = stage.roller(roller.name).torque
            plain[f"{key}.press"] = self._asked_press(stage, roller.name)
            if roller.name in stage.moves:
                end[f"{key}.centre"] = np.array(roller.centre) + stage.moves[roller.name]
        end |= {key: np.array(to, dtype=float) for key, to in plain.items() if to is not None}
        held = (self._holds_along(name, self._held()) for name in ENDS)
        if (growth := self.assembly.growth) is not None and not all(held):
            centres = {r.name: end[f"rollers.{r.name}.centre"] for r in growth.rollers}
            given = self.assembly.loads_of(stage), stage.strip.temperature
            gathered, _ = self.assembly.gathered_in(stage)
            end["strip.held"] = growth.held(centres, start["strip.held"], *given, gathered)
        return end

    def _asked_press(self, stage: StageSpec, name: str) -> float | None:
        """Force (N) with which a stage presses a roller; flat strip is pressed in the first one."""
        first = stage is self.assembly.scene.stages[0]
        return stage.roller(name).press or (self.assembly.specs[name].press if first else None)

    def _held(self, stage: StageSpec | None = None) -> dict[str, tuple[str, ...]]:
        """Components that edges hold in a stage; strip that is threaded is pulled at its exit."""
        if self.assembly.closed:  # what labels the strip: the rollers hold the rest
            return {"entry": ("xyz"[int(np.abs(self.outward["entry"]).argmax())],)}
        edges = self.assembly.scene.edges
        held: dict[str, tuple[str, ...]]
        held = {name: spec.fixed for name, spec in edges.items() if name not in self.released}
        threading = stage is not None and stage.name == THREADING
        if threading and self._holds_along("exit", held):
            held["exit"] = tuple(c for c in held["exit"] if c == "y")
        return held

    def _holds_along(self, name: str, held: Mapping[str, tuple[str, ...]]) -> bool:
        """Whether components that are held at an end hold it along the strip, not guide it."""
        return "xyz"[int(np.abs(self._directions[name]).argmax())] in held.get(name, ())

    def _destination(self, stage: StageSpec, name: str) -> Array:
        now = self.moved.get(name, np.zeros(3))
        if (move := stage.edge(name).move) is not None:
            return self.begun.get(name, np.zeros(3)) + np.array(move, dtype=float)
        return now + 0.5 * stage.duration * sum(self._label_speeds(stage, name))

    @property
    def _directions(self) -> dict[str, Array]:
        """Directions of the strip at its ends, as drawn, shape (3,)."""
        flat = np.array([1.0, 0.0, 0.0])
        entry, exit = self.outward.get("entry", -flat), self.outward.get("exit", flat)
        return {"entry": -entry, "exit": exit}

    def _along(self, name: str) -> Array:
        """Direction of the strip at an end where a stage began that says its speed, (3,)."""
        along = self.values.get(f"{name}.along", self._directions[name])
        return np.asarray(along / np.linalg.norm(along))

    def _label_speeds(self, stage: StageSpec, name: str) -> tuple[Array, Array]:
        """The same of the labels there: of a fed strip those that material passes stay.

        Also where nothing rubs, which is independent of time: the line rests meanwhile.
        """
        before, after = self._speeds(stage, name)
        edge, direction, held = self.passing
        if not (self.assembly.scene.strip.feed and held and edge == name):
            return before, after
        both = np.stack([before, after])
        across = both - np.outer(both @ direction, direction)
        large = np.linalg.norm(across, axis=1) > ALIGNED_SINE * np.linalg.norm(both, axis=1)
        first, last = np.where(large[:, None], across, 0.0)
        return first, last

    def _speeds(self, stage: StageSpec, name: str) -> tuple[Array, Array]:
        """Velocities of an edge at the beginning and at the end of a stage (m/s)."""
        begin, control = self.speeds.get(name, np.zeros(3)), stage.edge(name)
        if stage.steady or control.move is not None:
            return np.zeros(3), np.zeros(3)
        if control.speed is not None:
            return begin, control.speed * self._along(name)
        if control.velocity is None:
            return begin, begin
        return begin, np.array(control.velocity, dtype=float)

    def supports(self, stage: StageSpec, full: Array | None = None) -> Supports:
        """Return which unknowns a stage holds, and how they move."""
        strip, unknowns = self.assembly.strip, self.assembly.unknowns
        held = np.zeros(unknowns, dtype=bool)
        start, end, bows = (np.zeros(unknowns) for _ in range(3))
        a, still = self.assembly, not (stage.steady or self.assembly.rubs(stage))
        held[strip.unknowns : strip.unknowns + len(a.turning)] = still  # what turns rests
        if a.conveyed:
            held[a.coupled - 1] = still or not (self.pulled(stage) or self.fed(stage))
        if not self.assembly.yields(stage):  # plastic strains stay
            held[self.assembly.coupled :] = True
        across = strip.kinematics.place(1)
        for name, spec in self.assembly.scene.edges.items():
            middle = middle_node(strip, name) if spec.centred else None
            if middle is not None and across is not None:  # it keeps its y
                held[strip.count * strip.node_values[middle] + across] = True
            if spec.clamped and name not in self.released:
                held[strip.edge_unknowns(name, (), [2], ())] = True
        if full is not None:
            resting = np.flatnonzero(held)
            start[resting] = end[resting] = full[resting]
        for name, components in self._held(stage).items():
            edge, now = strip.edges[name], self.moved.get(name, np.zeros(3))
            destination = self._destination(stage, name)
            before, after = self._label_speeds(stage, name)
            bow = 0.5 * stage.duration * (after - before)  # half of what the velocity gains
            for c in ("xyz".index(x) for x in components):
                place = strip.kinematics.place(c)
                if place is None:
                    continue
                values, trace = (strip.count * d + place for d in (edge.values, edge.trace))
                held[trace], shape = True, np.zeros(len(values))
                if full is not None:  # an edge that was free before keeps its shape
                    start[trace] = end[trace] = full[trace]
                    shape = full[values] - full[values[0]]
                start[values], end[values] = now[c] + shape, destination[c] + shape
                bows[values] = bow[c]
        if (joint := self.joint) is not None:
            held[joint.exit] = True
        bent = self.assembly.frictional(stage) and np.any(bows)
        free, slope = np.flatnonzero(~held), end - start
        return Supports(free, start, slope, bows if bent else None, joint)


def uniform_stretch(
    assembly: Assembly, tension: float, controls: Mapping[str, Array], stays: str = "entry"
) -> Array:
    """Displacement of the uniformly stretched flat strip, all unknowns.

    Parameters
    ----------
    tension : float
        T (N/m) along x.
    controls : mapping
        Of whose eigenstrain the mean counts.
    stays : str
        End that stays where it is.
    """
    strip = assembly.strip
    end = strip.nodes[0].min() if stays == "entry" else strip.nodes[0].max()
    own, weights = eigenstrain(strip, controls), strip.weights().ravel()
    mean = (0.0, 0.0)
    if own is not None:
        xx, yy = (own[i, i] @ weights / weights.sum() for i in (0, -1))
        mean = float(xx), float(yy)
    given = strip.tensile_stiffness, strip.material.poisson, mean
    along, across = uniaxial_stretches(tension, *given)
    p = quadrature_points(strip)
    middle = 0.5 * (strip.nodes[1].min() + strip.nodes[1].max())
    x, y = (along - 1.0) * (p[0] - end), (across - 1.0) * (p[1] - middle)
    pulled = l2_projection(strip, assembly.pattern, np.stack([x, y, np.zeros_like(x)]))
    return np.append(pulled, np.zeros(assembly.unknowns - strip.unknowns))
