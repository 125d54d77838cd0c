"""A scene on elements of half the length, to which its states are taken and balanced there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from anmstrip.arrays import Array, Index
from anmstrip.continuation.equations import Cost, PathStopped
from anmstrip.continuation.follow import Settings, follow
from anmstrip.continuation.newton import Corrections, Newton
from anmstrip.equilibrium import Equilibrium, StageProblem
from anmstrip.fem.sampling import l2_projection
from anmstrip.fem.strip import Strip, line, renumbered
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.results.state import State
from anmstrip.scene.schema import StageSpec
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import Course
from anmstrip.timestepping.formulas import AffineVelocity

if TYPE_CHECKING:
    from anmstrip.mechanics.laws import ContactLaw

REMAINS = 1e-4
"""Imbalance that is left of the one that is taken away: the change is known to a few per cent."""

ROUND_OFF = 1e-10
"""Least imbalance that is asked for, over the force scale."""

MOST_CORRECTIONS, HALVINGS = 12, 8
"""Iterations of Newton's method, each with a line search: contact that moves by an element takes
four to eight."""

MOST_BRANCHES = 20
"""Of the path on which the imbalance fades away, where friction holds the strip and Newton's method
finds no way: one to ten are enough."""


@dataclass(frozen=True)
class Halved(Assembly):
    """The assembly of a scene on elements of half the length.

    The laws stay what the given mesh resolves, so that the mesh alone makes the difference.
    """

    given: Assembly | None = None

    @classmethod
    def of(cls, given: Assembly) -> Halved:
        """Return the assembly on elements of half the length of a given one."""
        made = cls(given.scene, None, given.added, given)
        if given.imperfection is None:
            return made
        return replace(made, imperfection=made.prolonged(given.imperfection))

    @property
    def coarse(self) -> Assembly:
        """The given assembly."""
        assert self.given is not None
        return self.given

    @cached_property
    def strip(self) -> Strip:
        """Mesh and basis."""
        old, finer = self.coarse.strip, self.coarse.strip.mesh.refined()
        mesh = line(np.sort(finer.p[0])) if finer.dim() == 1 else renumbered(finer)
        strip = Strip(mesh, old.thickness, old.material, old.kinematics, old.width, old.surface)
        strip.origin, strip.flat_origin = old.origin, old.flat_origin
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
        return np.append(own, full[old.unknowns :])

    @cached_property
    def inherited(self) -> tuple[Array, Index]:
        """The given mesh's functions at the points of this one, and their numbers.

        Shapes (functions of one element, elements, points) and (functions of one, elements).
        """
        old, basis = self.coarse.strip, self.coarse.strip.basis
        points = np.asarray(self.strip.basis.global_coordinates())
        children: Index = np.arange(points.shape[1])  # as scikit-fem numbers them
        parents = children // 2 if old.mesh.dim() == 1 else children % old.mesh.nelements
        local = basis.mapping.invF(points, tind=parents)
        fields = [
            np.asarray(basis.elem.gbasis(basis.mapping, local, number, tind=parents)[0])
            for number in range(basis.Nbfun)
        ]
        return np.array(fields), basis.element_dofs[:, parents]

    def problem(
        self, stage: StageSpec, state: State, released: Iterable[str], more: Mapping[str, Array]
    ) -> StageProblem:
        """Return a stage on this mesh, with all that is given held as it is in a state.

        Parameters
        ----------
        stage : StageSpec
        state : State
            On the given mesh.
        released : iterable of str
            Edges that were let go.
        more : mapping
            Control → what is added to it.
        """
        start, control = self.prolonged(state.full), state.control
        values, before = dict(state.controls), self.natural(self.scene.strip)
        for each in self.scene.course:
            after = before | self.natural(each.strip)
            if each.name == stage.name:
                kept = {key: (1.0 - control) * before.get(key, 0.0) for key in after}
                values |= {key: kept[key] + control * after[key] for key in after}
                break
            before = after
        values |= {key: values[key] + more[key] for key in more}
        course = Course(self, released=set(released))
        course.values = {**values, **course.values}
        plan = course.plan(stage, {}, start)
        supports = replace(plan.supports, start=start, slope=np.zeros_like(start), bow=None)
        return replace(plan, supports=supports, controls=Controls(values))


def balanced(
    plan: StageProblem, state: State, velocity: Array | None = None, elapsed: float = 0.0
) -> State | None:
    """Return the state in balance near the start of a problem, or None.

    By Newton's method, else along the path on which the imbalance of the start fades away.

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
    equations = Equilibrium(plan.model, plan.supports, plan.controls, rates, moving)
    zero = np.zeros(len(free))
    first = equations.imbalance(equations.residual(zero, 0.0))
    wanted, solver = max(REMAINS * first, ROUND_OFF), SparseSolver()
    corrections = Corrections(wanted, most=MOST_CORRECTIONS, halvings=HALVINGS)
    found = Newton(equations, solver, corrections, Cost()).corrected(zero, 0.0)
    if found is None:
        settings = Settings(
            tolerance=wanted, max_steps=MOST_BRANCHES, give_way=False, rational=True
        )
        try:
            *_, last = follow(equations, zero, solver=solver, settings=settings)
        except PathStopped:
            return None
    u, control = (last.branch.end[0] if found is None else found.u), state.control
    full = plan.supports.full(u, 0.0)
    if moving is None:
        return State(plan, state.time, control, full, plan.transport(full, control))
    return State(plan, state.time, control, full, equations.full_velocity(u, 0.0))
