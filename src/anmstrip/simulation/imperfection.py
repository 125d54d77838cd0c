"""The imperfection of a scene's strip: a buckling mode of the perfect one."""

from __future__ import annotations

from anmstrip.arrays import Array
from anmstrip.continuation.equations import PathStopped
from anmstrip.errors import InputError
from anmstrip.results.buckling import buckling, flattened
from anmstrip.results.state import State
from anmstrip.scene.schema import SceneSpec
from anmstrip.simulation.march import March
from anmstrip.simulation.problem import Assembly

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
    """Return the perfect and elastic strip at the end of the first stage."""
    strip = scene.strip.model_copy(update={"imperfection": None})
    material = scene.material.model_copy(update={"plasticity": None})
    perfect = scene.model_copy(update={"strip": strip, "material": material})
    march = March(Assembly(perfect))
    plan = march.planned(perfect.course[0].model_copy(update={"friction": False}), None)
    try:
        *_, last = march.through(plan, scene.solver.max_steps)
    except PathStopped as stopped:
        raise _refused(scene, f"without imperfection it stops: {stopped}") from stopped
    if last.state.principal_forces.min() > -NOTHING * march.assembly.scales.tension:
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
