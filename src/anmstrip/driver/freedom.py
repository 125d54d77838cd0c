"""What nothing holds: null vectors of the tangent, in words, with what to type."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from anmstrip.arrays import Array
from anmstrip.driver.preview import Preview
from anmstrip.equilibrium import Equilibrium, StageProblem
from anmstrip.linalg.direct import Factors, SingularTangentError
from anmstrip.linalg.solvers import SparseSolver
from anmstrip.mechanics.effects import Controls
from anmstrip.scene.tables import ENDS, EdgeSpec
from anmstrip.simulation.problem import Assembly
from anmstrip.simulation.stages import stretched
from anmstrip.timestepping.formulas import AffineVelocity

FREE = 1e-4
"""Stiffness of a motion, over force/length of the scene, below which nothing holds the strip.

Measured on 105 stages of the examples and of lines of the field: 0.6 at the least; of motions that
nothing holds 3e-9 at the most.
"""

MOST = 3
"""Motions that are looked for at once: along, across and out of the plane."""

ITERATIONS = 6
"""Of the inverse iteration: what is free is 1e8 times softer than the rest, so that two do."""

UNSEEN = 1e-3
"""Torque of bearings that hardly counts, over that of the tension."""

WORK = 1e-6
"""Share of the forces that may work on a motion to an equilibrium that is indifferent to it."""


def softest_motions(factors: Factors, metric: Array) -> Iterator[tuple[float, Array]]:
    """Yield |μ| and x of K x = μ M x, the least |μ| first, by inverse subspace iteration.

    Parameters
    ----------
    factors : Factors
        Of K, (n, n).
    metric : ndarray, shape (n,)
        Diagonal of M, zero where a motion does not count.

    Yields
    ------
    stiffness : float
    motion : ndarray, shape (n,)
    """
    root, count = np.sqrt(metric), min(MOST, int(np.count_nonzero(metric)))
    motions = np.cos(np.outer(np.arange(1.0, len(metric) + 1.0) ** 2, np.arange(1.0, count + 1.0)))
    for _ in range(ITERATIONS):
        basis, _ = np.linalg.qr(root[:, None] * motions)
        motions = np.stack([factors.solve(root * column) for column in basis.T], axis=1)
    softness, shapes = np.linalg.eig(basis.T @ (root[:, None] * motions))
    for k in np.argsort(-np.abs(softness)):
        yield 1.0 / abs(softness[k]), (motions @ shapes[:, k]).real


def free_motions(preview: Preview) -> Iterator[str]:
    """Yield what nothing holds in any stage, as far as its state is known before a run."""
    assembly, known, told = preview.assembly, set[object](), set[str]()
    thread, guess = assembly.thread, None
    if thread is not None:
        guess = np.zeros(assembly.unknowns)
        guess[: assembly.strip.unknowns] = thread.guess(assembly.strip, assembly.pattern)
    for plan in preview.plans:
        acting = (plan.supports.free.tobytes(), *(effect.name for effect in plan.model.effects))
        if acting in known:
            continue
        found = [(plan, guess)] if guess is not None else flat_states(assembly, plan, not known)
        for part, full in found:
            for words in motions_at(assembly, part, full):
                if words not in told:
                    told.add(words)
                    yield f"in stage {plan.name} {words}"
        known.add(acting)


def flat_states(
    assembly: Assembly, plan: StageProblem, first: bool
) -> Iterator[tuple[StageProblem, Array]]:
    """Yield a stage of a flat strip with its state, stretched by what pulls there, (unknowns,).

    What the strip touches after the first stage is not known; but from a roller to an end that is
    pulled along its own direction it is straight again, and turns about the roller as it would
    about its other end.
    """
    strip, end = assembly.strip, plan.controls.at(1.0)
    along, pulls = (
        [float(np.linalg.norm(end.get(f"{name}.{key}", 0.0))) for name in ENDS]
        for key in ("tension", "force")
    )
    if first:
        yield plan, stretched(assembly, max(along + pulls) or assembly.scales.tension, end)
        return
    effects = [effect for effect in plan.model.effects if not effect.by_roller]
    for tension, other in zip(along, ENDS[::-1], strict=True):
        if not tension:
            continue
        held = strip.count * strip.edges[other].trace[:, None] + np.arange(strip.count)
        free = np.setdiff1d(plan.supports.free, held)
        supports = replace(plan.supports, free=free)
        run = replace(plan, model=plan.model.with_effects(effects), supports=supports)
        yield run, stretched(assembly, tension, end)


def motions_at(assembly: Assembly, plan: StageProblem, full: Array) -> Iterator[str]:
    """Yield a sentence for every motion that nothing holds at a state."""
    free, model = plan.supports.free, plan.model
    held, u, rate = full.copy(), full[free], 1.0 / plan.duration
    held[free] = 0.0
    velocity = AffineVelocity(rate, -rate * u, np.zeros_like(u)) if plan.in_time else None
    still = replace(plan.supports, start=held, slope=np.zeros_like(full), bow=None)
    rest = still, Controls(plan.controls.at(1.0))
    equations = Equilibrium(model, *rest, velocity)
    series, force = equations.recurrence(u, 1.0, 1), model.scales.force
    try:
        factors = SparseSolver().factorise(series.tangent())
    except SingularTangentError as error:
        number = -1 if error.unknown is None else int(free[error.unknown]) - model.strip.unknowns
        if 0 <= number < len(model.turning):
            name = model.turning[number]
            bearing = UNSEEN * force * next(r.radius for r in assembly.rollers if r.name == name)
            yield (
                f"roller {name} is touched by nothing and free to turn. "
                f"Try --set rollers.{name}.bearing={bearing:.1g}"
            )
        return
    for stiffness, motion in softest_motions(factors, equations.metric):
        if not stiffness < FREE * force * model.scales.length:
            return
        moved = np.zeros(model.unknowns)
        moved[free] = motion
        moved /= np.abs(moved[model.value_unknowns]).max()
        indifferent = bool(abs(moved[free] @ series.residual) < WORK * force)
        yield from _words(assembly, plan, moved, indifferent)


def _words(
    assembly: Assembly, plan: StageProblem, moved: Array, indifferent: bool
) -> Iterator[str]:
    """Yield the sentence for one motion, of size 1.

    A motion that leaves both ends in place is a mode of buckling.  A turn on which forces work
    goes on until they no longer do.
    """
    strip, edges = assembly.strip, assembly.scene.edges
    nodal = np.abs(strip.nodal(moved[: strip.unknowns]))
    sizes = np.array([nodal[strip.edges[name].values].max(axis=0) for name in ENDS])
    place = int(sizes.max(axis=0).argmax())
    least, most = np.sort(sizes[:, place])
    shifted = least > 0.5 * most
    if most < 0.5 or not (shifted or indifferent):
        return
    component = "xyz"[strip.kinematics.components[place]]
    end = ENDS[int(sizes[:, place].argmax())]
    if shifted:
        end = next((name for name in edges if name in ENDS), ENDS[0])
    fixed = edges.get(end, EdgeSpec()).fixed
    advice = f"try --set 'edges.{end}.fixed={json.dumps(sorted({*fixed, component}))}'"
    if component in fixed:
        advice = f"try it without {end}.release."
    elif shifted and component == "y":
        advice = f"try --set edges.{end}.centred=true"
    loose = f"nothing holds the strip in {component}"
    if not shifted:
        pulled, way = np.any(plan.controls.at(1.0).get(f"{end}.tension", 0.0)), "free"
        if pulled:
            way = "pulled along its own direction and free"
            advice = f"give {end}.force, which has a direction of its own, or {advice}"
        loose = (
            f"the {end} is {way} in {component}: it is in equilibrium at any angle, and its place "
            "is what came before"
        )
    yield f"{loose}. {advice[0].upper()}{advice[1:]}"
