"""Shells bent by Kratos Multiphysics: thin corotational triangles, Newton with load steps.

Elements of three nodes, DKT in bending and with drilling rotations in the membrane.  Loads are
dead forces at nodes, and moments about y.  A roof is pressed down by a displacement: with its
strategy along an arc it comes to the first limit point and goes to and fro there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.studies.peer_capstan import timed
from anmstrip.studies.peer_plates import MOST, TOLERANCE, Bent, Plate, limits, ramped

ELEMENT = "ShellThinElementCorotational3D3N"

CELLS = {
    "end shear": (1, 16), "end moment": (1, 16), "slit annular plate": (10, 80),
    "hinged roof, t = 12.7": (16, 16), "hinged roof, t = 6.35": (16, 16),
}  # fmt: skip
"""Across and along, each of two triangles."""

LONGEST = 0.02
"""Largest step of a roof's displacement, so that limit points can be read off the path."""


def solved(name: str, plate: Plate) -> Bent:
    """Build, solve, read."""
    kratos = import_module("KratosMultiphysics")
    shells = import_module("KratosMultiphysics.StructuralMechanicsApplication")
    kratos.Logger.GetDefaultOutput().SetSeverity(kratos.Logger.Severity.WARNING)
    model = kratos.Model()
    part = model.CreateModelPart("plate")
    found: list[Bent] = []

    def work() -> None:
        forces = _built(kratos, shells, part, plate, CELLS[name])
        strategy = _strategy(kratos, part, bool(plate.force))
        if plate.force:
            found.append(_pushed(kratos, strategy, plate))
            return
        load = _loading(shells, forces)
        counts = ramped(lambda share: _advanced(kratos, strategy, load, share))
        corners = [part.GetNode(i) for i in (1, CELLS[name][0] + 1)]
        tip = np.array([list(n.GetSolutionStepValue(kratos.DISPLACEMENT)) for n in corners])
        unknowns = 6 * part.NumberOfNodes()
        found.append(Bent(plate.readings(tip).tolist(), *counts, unknowns, 0.0))

    seconds = timed(work)
    return replace(found[0], seconds=seconds)


def _built(
    kratos: Any, shells: Any, part: Any, plate: Plate, cells: tuple[int, int]
) -> list[tuple[Any, float, float]]:
    """Nodes, elements and supports; nodes that are loaded, with force along z and moment."""
    part.SetBufferSize(2)
    for name in ("DISPLACEMENT", "ROTATION", "REACTION", "REACTION_MOMENT", "VOLUME_ACCELERATION"):
        part.AddNodalSolutionStepVariable(getattr(kratos, name))
    part.AddNodalSolutionStepVariable(shells.POINT_LOAD)
    part.AddNodalSolutionStepVariable(shells.POINT_MOMENT)
    section = _section(kratos, shells, part, plate)
    across, along = cells[0] + 1, cells[1] + 1
    ids = np.arange(1, across * along + 1).reshape(along, across)
    b, a = np.meshgrid(np.linspace(0, 1, along), np.linspace(0, 1, across), indexing="ij")
    points = plate.in_space(*plate.place(a, b))
    for node, *point in zip(ids.flat, *(x.flat for x in points), strict=True):
        part.CreateNewNode(int(node), *map(float, point))
    _freedoms(kratos, part, plate, ids)
    for number, nodes in enumerate(_triangles(ids), start=1):
        part.CreateNewElement(ELEMENT, number, nodes.tolist(), section)
    shares = np.full(across, plate.width / cells[0])
    shares[[0, -1]] *= 0.5
    for node in ids[0].tolist():
        for kind, number in (("Load", node), ("Moment", node + ids.size)):
            part.CreateNewCondition(f"Point{kind}Condition3D1N", number, [node], section)
    forces = plate.pull * shares
    forces[0] += plate.force
    loads = zip(ids[0].tolist(), forces, plate.moment * shares, strict=True)
    return [(part.GetNode(i), float(force), float(moment)) for i, force, moment in loads]


def _section(kratos: Any, shells: Any, part: Any, plate: Plate) -> Any:
    """Thickness and material."""
    section = part.CreateNewProperties(1)
    section.SetValue(kratos.YOUNG_MODULUS, plate.young)
    section.SetValue(kratos.POISSON_RATIO, plate.poisson)
    section.SetValue(kratos.THICKNESS, plate.thickness)
    section.SetValue(kratos.DENSITY, 1.0)
    section.SetValue(kratos.CONSTITUTIVE_LAW, shells.LinearElasticPlaneStress2DLaw())
    return section


def _freedoms(kratos: Any, part: Any, plate: Plate, ids: NDArray[np.int64]) -> None:
    """Displacements and rotations, held along sides."""
    sides = {"top": ids[-1], "bottom": ids[0], "left": ids[:, 0], "right": ids[:, -1]}
    for kind, reaction in (("DISPLACEMENT", "REACTION"), ("ROTATION", "REACTION_MOMENT")):
        for axis in "XYZ":
            freedom = getattr(kratos, f"{kind}_{axis}")
            back = getattr(kratos, f"{reaction}_{axis}")
            kratos.VariableUtils().AddDof(freedom, back, part)
            what = axis if kind == "ROTATION" else axis.lower()
            for side in plate.sides(what):
                for node in sides[side].tolist():
                    part.GetNode(node).Fix(freedom)


def _triangles(ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """Two of each cell, shape (elements, 3)."""
    low, right = ids[:-1, :-1].ravel(), ids[:-1, 1:].ravel()
    up, far = ids[1:, :-1].ravel(), ids[1:, 1:].ravel()
    return np.concatenate([np.stack([low, right, far], 1), np.stack([low, far, up], 1)])


def _strategy(kratos: Any, part: Any, pushed: bool) -> Any:
    """Newton's method with a sparse LU of each tangent; the imbalance is over that of the step.

    Where a displacement is prescribed its reaction would count as imbalance: the change counts.
    """
    solver = import_module("KratosMultiphysics.LinearSolversApplication").SparseLUSolver()
    kind = kratos.DisplacementCriteria if pushed else kratos.ResidualCriteria
    criterion = kind(TOLERANCE, 1e-9)
    strategy = kratos.ResidualBasedNewtonRaphsonStrategy(
        part,
        kratos.ResidualBasedIncrementalUpdateStaticScheme(),
        criterion,
        kratos.ResidualBasedBlockBuilderAndSolver(solver),
        MOST, True, False, True,
    )  # fmt: skip
    strategy.SetEchoLevel(0)
    strategy.Check()
    strategy.Initialize()
    return strategy


def _loading(shells: Any, loads: list[tuple[Any, float, float]]) -> Callable[[float], None]:
    """What sets a share of the load."""

    def load(share: float) -> None:
        for node, force, moment in loads:
            node.SetSolutionStepValue(shells.POINT_LOAD, 0, [0.0, 0.0, share * force])
            node.SetSolutionStepValue(shells.POINT_MOMENT, 0, [0.0, -share * moment, 0.0])

    return load


def _pushed(kratos: Any, strategy: Any, plate: Plate) -> Bent:
    """The corner goes down as far as it does under the full load."""
    part, path = strategy.GetModelPart(), [(0.0, 0.0)]
    corner = part.GetNode(1)
    corner.Fix(kratos.DISPLACEMENT_Z)

    def push(share: float) -> None:
        corner.SetSolutionStepValue(kratos.DISPLACEMENT_Z, 0, -share * plate.depth)

    def advance(share: float) -> tuple[bool, int]:
        there, spent = _advanced(kratos, strategy, push, share)
        if there:
            load = corner.GetSolutionStepValue(kratos.REACTION_Z) / plate.force
            path.append((load, share * plate.depth))
        return there, spent

    counts = ramped(advance, LONGEST)
    return Bent(limits(*zip(*path, strict=True)), *counts, 6 * part.NumberOfNodes(), 0.0)


def _advanced(
    kratos: Any, strategy: Any, load: Callable[[float], None], share: float
) -> tuple[bool, int]:
    """Go to a share of the load, or stay."""
    part = strategy.GetModelPart()
    part.CloneTimeStep(share)
    load(share)
    strategy.InitializeSolutionStep()
    strategy.Predict()
    there = bool(strategy.SolveSolutionStep())
    if there:
        strategy.FinalizeSolutionStep()
    else:
        for node in part.Nodes:
            for kind in (kratos.DISPLACEMENT, kratos.ROTATION):
                node.SetSolutionStepValue(kind, 0, node.GetSolutionStepValue(kind, 1))
        kratos.VariableUtils().UpdateCurrentPosition(part.Nodes, kratos.DISPLACEMENT)
    return there, int(part.ProcessInfo[kratos.NL_ITERATION_NUMBER])
