"""Stages as equations: which unknowns are held, and how the controls move.

A :class:`Course` walks through the stages and keeps what one leaves to the
next: displacements of held edges, forces, rollers.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anmstrip.model import Controls, Model, Supports
from anmstrip.scene.build import Assembly, middle_node
from anmstrip.scene.schema import StageSpec

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """One stage, ready to be solved: λ = 0 is its start, λ = 1 its end.

    Attributes
    ----------
    name : str
    start, duration : float
        s.
    model : Model
    supports : Supports
    controls : Controls
    in_time : bool
        Whether velocities matter; else the stage is rate-free.
    """

    name: str
    start: float
    duration: float
    model: Model
    supports: Supports
    controls: Controls
    in_time: bool

    @property
    def held_at_end(self) -> tuple[Supports, Controls]:
        """Supports and controls that stay at their final values."""
        supports, zero = self.supports, np.zeros_like(self.supports.slope)
        end = Supports(supports.free, supports.start + supports.slope, zero)
        return end, Controls(self.controls.at(1.0))


@dataclass
class Course:
    """What the stages so far have left: the values that the next one starts from.

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
    """

    assembly: Assembly
    moved: dict[str, Array] = field(default_factory=dict)
    values: dict[str, Array] = field(default_factory=dict)
    released: set[str] = field(default_factory=set)
    time: float = 0.0

    def __post_init__(self) -> None:
        for roller in self.assembly.rollers:
            key = f"rollers.{roller.name}"
            self.values.setdefault(f"{key}.centre", np.array(roller.centre, dtype=float))
            self.values.setdefault(f"{key}.surface_speed", np.array(0.0))

    def plan(self, stage: StageSpec, reactions: dict[str, Array]) -> Plan:
        """Prepare a stage.

        Parameters
        ----------
        stage : StageSpec
        reactions : dict
            Held edge → mean reaction (N/m), for those that the stage releases.
        """
        for name, control in stage.edges.items():
            if control.release and name not in self.released:
                self.released.add(name)
                held = self.values.get(f"{name}.force", np.zeros(3))
                self.values[f"{name}.force"] = held + reactions.get(name, np.zeros(3))
        start = dict(self.values)
        end = self._targets(stage, start)
        for name in end:
            start.setdefault(name, np.zeros_like(end[name]))
        slope = {n: end[n] - start[n] for n in end if np.any(end[n] != start[n])}
        for roller in self.assembly.rollers:
            key = f"rollers.{roller.name}"
            rate = slope.get(f"{key}.centre", np.zeros(3)) / stage.duration
            start[f"{key}.velocity"] = rate
        forces = {n.removesuffix(".force") for n in start if n.endswith(".force")}
        effects = self.assembly.effects(stage, forces, "gravity" in start)
        a = self.assembly
        return Plan(
            name=stage.name,
            start=self.time,
            duration=stage.duration,
            model=Model(a.strip, a.pattern, effects, a.scales),
            supports=self._supports(stage),
            controls=Controls(start, slope),
            in_time=a.frictional(stage),
        )

    def finish(self, stage: StageSpec) -> None:
        """Remember where a stage has ended."""
        self.values.update(self._targets(stage, dict(self.values)))
        for name in self._held():
            self.moved[name] = self._destination(stage, name)
        self.time += stage.duration

    def _targets(self, stage: StageSpec, start: dict[str, Array]) -> dict[str, Array]:
        end = dict(start)
        for name, edge in stage.edges.items():
            if edge.force is not None:
                end[f"{name}.force"] = np.array(edge.force, dtype=float)
        if stage.gravity is not None:
            end["gravity"] = np.array(stage.gravity, dtype=float)
        for roller in self.assembly.rollers:
            control, key = stage.rollers.get(roller.name), f"rollers.{roller.name}"
            if control is not None and control.surface_speed is not None:
                end[f"{key}.surface_speed"] = np.array(control.surface_speed, dtype=float)
            if control is not None and control.move is not None:
                end[f"{key}.centre"] = np.array(roller.centre) + np.array(control.move)
        return end

    def _held(self) -> dict[str, tuple[str, ...]]:
        return {
            name: spec.fixed
            for name, spec in self.assembly.scene.edges.items()
            if name not in self.released
        }

    def _destination(self, stage: StageSpec, name: str) -> Array:
        now = self.moved.get(name, np.zeros(3))
        control = stage.edges.get(name)
        if control is None:
            return now
        if control.move is not None:
            return np.array(control.move, dtype=float)
        if control.velocity is not None:
            return now + np.array(control.velocity) * stage.duration
        return now

    def _supports(self, stage: StageSpec) -> Supports:
        strip = self.assembly.strip
        held = np.zeros(strip.unknowns, dtype=bool)
        start, end = np.zeros(strip.unknowns), np.zeros(strip.unknowns)
        for name, components in self._held().items():
            edge, now = strip.edges[name], self.moved.get(name, np.zeros(3))
            destination = self._destination(stage, name)
            for c in ("xyz".index(x) for x in components):
                held[3 * edge.values + c] = held[3 * edge.slopes + c] = True
                start[3 * edge.values + c] = now[c]
                end[3 * edge.values + c] = destination[c]
        for name, spec in self.assembly.scene.edges.items():
            middle = middle_node(strip, name) if spec.centred else None
            if middle is not None:
                held[3 * strip.node_values[middle] + 1] = True
        return Supports(np.flatnonzero(~held), start, end - start)


def stretched(assembly: Assembly, tension: float) -> Array:
    """Displacement of the uniformly stretched flat strip, all unknowns.

    Parameters
    ----------
    tension : float
        T (N/m) along x; the stretch solves T = √(1 + 2E) E_young t E.
    """
    strip, nu = assembly.strip, assembly.material.poisson
    stiffness = assembly.material.young * strip.thickness
    strain = tension / stiffness
    for _ in range(30):
        stretch = np.sqrt(1.0 + 2.0 * strain)
        change = (stiffness * strain * stretch - tension) / (
            stiffness * (stretch + strain / stretch)
        )
        strain -= change
    along, across = np.sqrt(1.0 + 2.0 * strain) - 1.0, np.sqrt(1.0 - 2.0 * nu * strain) - 1.0
    x, y = strip.mesh.p
    u = np.zeros((strip.scalars, 3))
    values, slopes_x, slopes_y, _ = strip.basis.nodal_dofs
    u[values, 0], u[values, 1] = along * (x - x.min()), across * (y - 0.5 * (y.min() + y.max()))
    u[slopes_x, 0], u[slopes_y, 1] = along, across
    return u.ravel()
