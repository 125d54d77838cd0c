"""From a validated scene to mechanics: mesh, effects, scales."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from skfem import MeshQuad

from anmstrip.mechanics.bending import isometric_bending
from anmstrip.mechanics.cells import ContactOperator, Pattern
from anmstrip.mechanics.contact import Contact, Friction
from anmstrip.mechanics.effects import Effect, LinearEffect
from anmstrip.mechanics.friction import FrictionLaw, NortonHoff, Tanh
from anmstrip.mechanics.loads import edge_force, weight
from anmstrip.mechanics.membrane import Membrane
from anmstrip.mechanics.roller import Roller
from anmstrip.mechanics.signorini import RepulsiveSignorini
from anmstrip.mechanics.strip import Material, Strip, grid
from anmstrip.model import Scales
from anmstrip.scene.errors import InputError, Mistake
from anmstrip.scene.mesh_file import read_mesh
from anmstrip.scene.schema import Scene, StageSpec

Array = NDArray[np.float64]

QUARTER = 0.25
"""Share of the boundary layer √(D/T) that an element over a roller may cover."""


FAINT = 1e-4
"""Share of the pressure T/r of a wrapped strip below which there is no friction.

The regularised pressure never ends, but points without weight would shorten every
step: their friction is as singular as that of the others.
"""


@dataclass(frozen=True)
class Assembly:
    """A scene's strip and what can act on it.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    InputError
        Mesh file unreadable, edges unknown, a roller inside the strip.
    """

    scene: Scene

    @cached_property
    def rollers(self) -> tuple[Roller, ...]:
        """Geometry of the rollers."""
        return tuple(Roller(r.name, r.radius, r.centre, r.axis) for r in self.scene.rollers)

    @cached_property
    def material(self) -> Material:
        """Of the strip."""
        m = self.scene.material
        return Material(m.young, m.poisson, m.density or 0.0)

    @cached_property
    def strip(self) -> Strip:
        """Mesh and basis."""
        spec = self.scene.strip
        mesh = strip_mesh(self.scene) if spec.mesh is None else read_mesh(self.scene)
        strip = Strip(mesh, spec.thickness, self.material)
        _check(self.scene, strip, self.rollers)
        return strip

    @cached_property
    def pattern(self) -> Pattern:
        """Of the tangent."""
        return Pattern(self.strip)

    @cached_property
    def membrane(self) -> Membrane:
        """Always present."""
        return Membrane(self.strip)

    @cached_property
    def bending(self) -> LinearEffect:
        """Always present."""
        return isometric_bending(self.strip, self.pattern)

    @cached_property
    def contact_operator(self) -> ContactOperator:
        """Where contact is looked at."""
        return ContactOperator(self.strip)

    @cached_property
    def friction(self) -> FrictionLaw | None:
        """The scene's friction law."""
        f = self.scene.friction
        if f is None:
            return None
        if f.law == "tanh":
            return Tanh(f.coefficient, f.omega, f.speed)
        return NortonHoff(f.coefficient, f.exponent, f.omega, f.speed)

    @cached_property
    def contacts(self) -> list[Contact]:
        """One normal contact per roller, if the scene has contact.

        It reaches a radius far: a strip that comes near is felt long before it
        could pass through a roller within one step.
        """
        return [self._contact(roller, roller.radius) for roller in self._touched]

    @property
    def frictions(self) -> list[Friction]:
        """Friction of each contact."""
        law = self.friction
        if law is None:
            return []
        return [Friction(self._contact(r, self._friction_reach(r)), law) for r in self._touched]

    @property
    def _touched(self) -> tuple[Roller, ...]:
        return () if self.scene.contact is None else self.rollers

    @cached_property
    def signorini(self) -> RepulsiveSignorini:
        """The scene's contact law."""
        c = self.scene.contact
        assert c is not None
        return RepulsiveSignorini(c.stiffness, c.eta, c.delta)

    def _contact(self, roller: Roller, reach: float) -> Contact:
        return Contact(roller, self.signorini, self.contact_operator, reach)

    def _friction_reach(self, roller: Roller) -> float:
        return float(self.signorini.gap(FAINT * self.scales.tension / roller.radius))

    def effects(self, stage: StageSpec, forces: set[str], gravity: bool) -> list[Effect]:
        """What acts in a stage.

        Parameters
        ----------
        stage : StageSpec
        forces : set of str
            Edges on which dead forces act, now or before.
        gravity : bool
            Whether there is weight, now or before.
        """
        effects: list[Effect] = [self.membrane, self.bending]
        effects += self.contacts
        effects += self.frictions if self.frictional(stage) else []
        effects += [edge_force(self.strip.edges[name]) for name in sorted(forces)]
        return [*effects, weight(self.strip)] if gravity else effects

    def frictional(self, stage: StageSpec) -> bool:
        """Whether friction acts in a stage, so that it runs in time."""
        return stage.friction and self.friction is not None and bool(self.rollers)

    @cached_property
    def scales(self) -> Scales:
        """From the largest edge force of the scene, else from bending."""
        tension = largest_force(self.scene)
        if tension == 0.0:
            tension = self.strip.bending_stiffness / self.strip.length**2
        return Scales(self.strip.length, tension * self.strip.width, tension)


def largest_force(scene: Scene) -> float:
    """Largest edge force of all stages (N/m), 0 if there is none."""
    forces = [
        float(np.linalg.norm(control.force))
        for stage in scene.stages
        for control in stage.edges.values()
        if control.force is not None
    ]
    return max(forces, default=0.0)


def boundary_layer(scene: Scene) -> float:
    """√(D/T) (m) of the largest tension; infinite without tension."""
    m, t = scene.material, scene.strip.thickness
    bending = m.young * t**3 / (12.0 * (1.0 - m.poisson**2))
    tension = largest_force(scene)
    return float(np.sqrt(bending / tension)) if tension > 0.0 else np.inf


def strip_mesh(scene: Scene) -> MeshQuad:
    """Rectangular mesh, finer over and near the rollers.

    The fine part covers a quarter of each roller's circumference on both sides
    of its axis, and the stretch of strip that its surface speeds carry over it.
    """
    spec = scene.strip
    assert spec.length is not None and spec.width is not None and spec.cells is not None
    half, coarse = spec.length / 2.0, spec.length / spec.cells[0]
    fine = spec.refined or QUARTER * boundary_layer(scene)
    zones = fine_zones(scene, half) if scene.contact is not None and fine < coarse else []
    marks = sorted({-half, half, *(x for zone in zones for x in zone)})
    xs = [np.array([-half])]
    for a, b in pairwise(marks):
        inside = any(lo <= a and b <= hi for lo, hi in zones)
        count = max(1, int(np.ceil((b - a) / (fine if inside else coarse) - 1e-9)))
        xs.append(np.linspace(a, b, count + 1)[1:])
    ys = np.linspace(-spec.width / 2.0, spec.width / 2.0, spec.cells[1] + 1)
    return grid(np.concatenate(xs), ys)


def fine_zones(scene: Scene, half: float) -> list[tuple[float, float]]:
    """Stretches of strip, in the reference, that come to lie on rollers."""
    zones = []
    for roller in scene.rollers:
        reach = 0.5 * np.pi * roller.radius
        back, ahead = _carried(scene, roller.name)
        lo = max(-half, roller.centre[0] - reach - ahead)
        hi = min(half, roller.centre[0] + reach + back)
        if lo < hi:
            zones.append((float(lo), float(hi)))
    return _united(zones)


def _carried(scene: Scene, name: str) -> tuple[float, float]:
    """Largest travel of a roller's surface, backwards and forwards (m)."""
    speed = travel = lowest = highest = 0.0
    for stage in scene.stages:
        control = stage.rollers.get(name)
        new = speed if control is None or control.surface_speed is None else control.surface_speed
        travel += 0.5 * (speed + new) * stage.duration
        speed, lowest, highest = new, min(lowest, travel), max(highest, travel)
    held = any(edge.fixed for edge in scene.edges.values())
    let_go = any(c.release for stage in scene.stages for c in stage.edges.values())
    return (0.0, 0.0) if held and not let_go else (-lowest, highest)


def _united(zones: list[tuple[float, float]]) -> list[tuple[float, float]]:
    united: list[tuple[float, float]] = []
    for lo, hi in sorted(zones):
        if united and lo <= united[-1][1]:
            united[-1] = (united[-1][0], max(hi, united[-1][1]))
        else:
            united.append((lo, hi))
    return united


def _check(scene: Scene, strip: Strip, rollers: tuple[Roller, ...]) -> None:
    """Mistakes that only the mesh shows."""
    file = str(scene.source or "scene")
    mistakes = [
        Mistake(
            file,
            f"rollers.{roller.name}.centre",
            list(roller.centre),
            f"a roller outside the flat strip; its surface is {-gap:.4g} m inside",
            f"move centre at least {-gap:.4g} m away from the strip, or reduce radius",
        )
        for roller in rollers
        if (gap := flat_gap(strip, roller)) < -1e-12 * roller.radius
    ]
    for name, edge in scene.edges.items():
        if edge.centred and name in strip.edges and middle_node(strip, name) is None:
            mistakes.append(
                Mistake(
                    file,
                    f"edges.{name}.centred",
                    True,
                    "a mesh node in the middle of the edge",
                    "an even number of cells across, e.g. cells = [16, 2]",
                )
            )
    if mistakes:
        raise InputError(mistakes)


def flat_gap(strip: Strip, roller: Roller) -> float:
    """Least gap (m) between a roller, where it begins, and the flat strip's rectangle."""
    across = roller.across
    p = strip.mesh.p
    nearest = lsq_linear(
        across[:, :2], across @ np.asarray(roller.centre), (p.min(axis=1), p.max(axis=1))
    )
    return float(np.linalg.norm(nearest.fun)) - roller.radius


def middle_node(strip: Strip, name: str) -> int | None:
    """Mesh node in the middle of an edge."""
    nodes = strip.edges[name].nodes
    points = strip.mesh.p[:, nodes]
    middle = 0.5 * (points[:, 0] + points[:, -1])
    distance = np.linalg.norm(points - middle[:, None], axis=0)
    nearest = int(distance.argmin())
    return int(nodes[nearest]) if distance[nearest] < 1e-6 * strip.edges[name].length else None
