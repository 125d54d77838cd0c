"""The imperfection of a scene's strip: a buckling mode of the perfect one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, eigsh

from anmstrip.arrays import Array
from anmstrip.continuation.equations import PathStopped
from anmstrip.equilibrium import Equilibrium
from anmstrip.errors import InputError
from anmstrip.fem.operators import Blocks, CellOperator, Pattern
from anmstrip.fem.sampling import l2_projection
from anmstrip.linalg.solvers import LinearSolver, SparseSolver
from anmstrip.mechanics.shell import Membrane, principal
from anmstrip.results.state import State
from anmstrip.scene.schema import SceneSpec
from anmstrip.simulation.march import March
from anmstrip.simulation.problem import Assembly


def compressive_stiffness(membrane: Membrane, forces: Array, pattern: Pattern) -> Blocks:
    """Blocks of G, see :class:`~anmstrip.fem.operators.Pattern`, from N (d, d, points)."""
    values, vectors = principal(forces)
    part = np.einsum("pak,pk,pbk->abp", vectors, -np.minimum(values, 0.0), vectors)
    m, blocks = pattern.count, pattern.zeros()
    derivative = np.einsum("ij,bap->jbiap", np.eye(m), part)
    membrane.operator.add_tangent(derivative, pattern, blocks)
    return blocks


def buckling_modes(
    tangent: csc_matrix, compressive: csc_matrix, solver: LinearSolver, count: int
) -> tuple[Array, Array]:
    """The lowest factors μ, ascending, and modes φ in columns.

    Parameters
    ----------
    tangent, compressive : csc_matrix, shape (n, n)
        K and G.
    solver : LinearSolver
    count : int
        Number of modes.
    """
    spared = (tangent + compressive).tocsc()
    spared.sort_indices()
    inverse = LinearOperator(spared.shape, matvec=solver.factorise(spared).solve)
    start = np.cos(np.arange(1.0, spared.shape[0] + 1.0) ** 2)
    found = eigsh(compressive, count, spared, which="LA", Minv=inverse, v0=inverse @ start)
    order = np.argsort(found[0])[::-1]
    with np.errstate(divide="ignore"):
        return 1.0 / found[0][order], found[1][:, order]


NOTHING = 1e-9
"""Compression, over the scale of tension, that is round-off."""

FARTHEST = 1e4
"""Growth of a compression up to which it is one, and no imprecision."""


def imperfection_of(scene: SceneSpec) -> Array:
    """Displacement of the flat strip that makes no stress, shape (unknowns,).

    Raises
    ------
    InputError
        The perfect strip does not reach the end of the first stage, or hardly is compressed there.
    """
    assert scene.strip.imperfection is not None
    state = _perfect(scene)
    factors, modes = buckling(state, scene.strip.imperfection.mode)
    if factors[-1] > FARTHEST:
        raise _refused(scene, f"it would take {factors[-1]:.1g} times as much to buckle it")
    return flattened(state, modes[:, -1]) * scene.strip.imperfection.amplitude


def _perfect(scene: SceneSpec) -> State:
    """The perfect strip at the end of the first stage."""
    strip = scene.strip.model_copy(update={"imperfection": None})
    perfect = scene.model_copy(update={"strip": strip})
    march = March(Assembly(perfect))
    plan = march.planned(perfect.course[0].model_copy(update={"friction": False}), None)
    try:
        *_, last = march.through(plan, scene.solver.max_steps)
    except PathStopped as stopped:
        raise _refused(scene, f"without imperfection it stops: {stopped}") from stopped
    if last.state.principal_forces.min() > -NOTHING * march.assembly.scales.tension:
        raise _refused(scene, "nothing compresses it")
    return last.state


def buckling(state: State, count: int) -> tuple[Array, Array]:
    """Factors and modes of a state, as if nothing rubbed, see :func:`buckling_modes`.

    Returns
    -------
    factors : ndarray, shape (count,)
    modes : ndarray, shape (free, count)
    """
    plan, model = state.plan, state.plan.model.without_rates
    free = plan.supports.free[plan.supports.free < model.strip.unknowns]  # what turns rests
    supports = replace(plan.supports, free=free)
    equations = Equilibrium(model, supports, plan.controls)
    tangent = equations.recurrence(state.full[free], state.control, 1).tangent()
    assert state.membrane is not None
    forces = state.membrane.at(state.full, state.controls)
    blocks = compressive_stiffness(state.membrane, forces, model.pattern)
    return buckling_modes(tangent, model.restriction(free).matrix(blocks), SparseSolver(), count)


def flattened(state: State, mode: Array) -> Array:
    """A change of a state, along its normals, as heights of the flat strip; 1 m the largest.

    Parameters
    ----------
    mode : ndarray, shape (free,)

    Returns
    -------
    ndarray, shape (unknowns,)
        Upwards where the height is largest.
    """
    strip, change = state.plan.model.strip, state.plan.supports.change(mode, 0.0)
    operator = CellOperator(strip, (0, 1))
    tangents = operator.apply(state.full)[:, 1:] + strip.kinematics.flat
    normal = np.cross(tangents[:, 0], tangents[:, 1], axis=0)
    normal /= np.linalg.norm(normal, axis=0)
    height = np.einsum("ip,ip->p", normal, operator.apply(change)[:, 0])
    lifted = np.zeros_like(normal)
    lifted[2] = height / height[np.abs(height).argmax()]
    return l2_projection(strip, state.plan.model.pattern, lifted)


def _refused(scene: SceneSpec, found: str) -> InputError:
    """The scene has no buckling mode to be bent by."""
    spec = scene.strip.imperfection
    assert spec is not None
    value = {"mode": spec.mode, "amplitude": spec.amplitude}
    expected = f"a first stage, threading included, that ends compressed across or along; {found}"
    hint = "no imperfection, or a first stage in which the strip is compressed"
    return scene.refused("strip.imperfection", value, expected, hint)
