"""Flat shells bent by Kratos Multiphysics: thin corotational triangles, Newton with load steps.

Elements of three nodes, DKT in bending and with drilling rotations in the membrane.  Loads are
dead forces at nodes.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anmstrip.studies.peer_capstan import timed
from anmstrip.studies.peer_plates import MOST, TOLERANCE, Bent, Plate, ramped

ELEMENT = "ShellThinElementCorotational3D3N"

CELLS = {"end shear": (1, 16), "slit annular plate": (10, 80)}
"""Across and along, each of two triangles."""


def solved(name: str, plate: Plate) -> Bent:
    """Build, solve, read."""
    kratos = import_module("KratosMultiphysics")
    shells = import_module("KratosMultiphysics.StructuralMechanicsApplication")
    kratos.Logger.GetDefaultOutput().SetSeverity(kratos.Logger.Severity.WARNING)
    model = kratos.Model()
    part = model.CreateModelPart("plate")
    counts: list[tuple[int, int]] = []

    def work() -> None:
        forces = _built(kratos, shells, part, plate, CELLS[name])
        strategy = _strategy(kratos, part)
        counts.append(ramped(lambda load: _advanced(kratos, shells, strategy, forces, load)))

    seconds = timed(work)
    corners = [part.GetNode(i) for i in (1, CELLS[name][0] + 1)]
    tip = np.array([list(n.GetSolutionStepValue(kratos.DISPLACEMENT)) for n in corners])
    unknowns = 6 * (CELLS[name][0] + 1) * CELLS[name][1]
    return Bent(plate.readings(tip).tolist(), *counts[0], unknowns, seconds)


def _built(
    kratos: Any, shells: Any, part: Any, plate: Plate, cells: tuple[int, int]
) -> list[tuple[Any, float]]:
    """Nodes, elements and supports; nodes that are pulled, each with its force."""
    part.SetBufferSize(2)
    for name in ("DISPLACEMENT", "ROTATION", "REACTION", "REACTION_MOMENT", "VOLUME_ACCELERATION"):
        part.AddNodalSolutionStepVariable(getattr(kratos, name))
    part.AddNodalSolutionStepVariable(shells.POINT_LOAD)
    section = _section(kratos, shells, part, plate)
    across, along = cells[0] + 1, cells[1] + 1
    ids = np.arange(1, across * along + 1).reshape(along, across)
    b, a = np.meshgrid(np.linspace(0, 1, along), np.linspace(0, 1, across), indexing="ij")
    x, y = plate.place(a, b)
    for node, *point in zip(ids.flat, x.flat, y.flat, strict=True):
        part.CreateNewNode(int(node), *map(float, point), 0.0)
    _freedoms(kratos, part, ids[-1])
    for number, nodes in enumerate(_triangles(ids), start=1):
        part.CreateNewElement(ELEMENT, number, nodes.tolist(), section)
    shares = np.full(across, plate.pull * plate.width / cells[0])
    shares[[0, -1]] *= 0.5
    for node in ids[0].tolist():
        part.CreateNewCondition("PointLoadCondition3D1N", node, [node], section)
    return [(part.GetNode(int(i)), float(f)) for i, f in zip(ids[0], shares, strict=True)]


def _section(kratos: Any, shells: Any, part: Any, plate: Plate) -> Any:
    """Thickness and material."""
    section = part.CreateNewProperties(1)
    section.SetValue(kratos.YOUNG_MODULUS, plate.young)
    section.SetValue(kratos.POISSON_RATIO, 0.0)
    section.SetValue(kratos.THICKNESS, plate.thickness)
    section.SetValue(kratos.DENSITY, 1.0)
    section.SetValue(kratos.CONSTITUTIVE_LAW, shells.LinearElasticPlaneStress2DLaw())
    return section


def _freedoms(kratos: Any, part: Any, clamped: NDArray[np.int64]) -> None:
    """Displacements and rotations, held at the clamped nodes."""
    for kind, reaction in (("DISPLACEMENT", "REACTION"), ("ROTATION", "REACTION_MOMENT")):
        for axis in "XYZ":
            freedom = getattr(kratos, f"{kind}_{axis}")
            back = getattr(kratos, f"{reaction}_{axis}")
            kratos.VariableUtils().AddDof(freedom, back, part)
            for node in clamped.tolist():
                part.GetNode(node).Fix(freedom)


def _triangles(ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """Two of each cell, shape (elements, 3)."""
    low, right = ids[:-1, :-1].ravel(), ids[:-1, 1:].ravel()
    up, far = ids[1:, :-1].ravel(), ids[1:, 1:].ravel()
    return np.concatenate([np.stack([low, right, far], 1), np.stack([low, far, up], 1)])


def _strategy(kratos: Any, part: Any) -> Any:
    """Newton's method with a sparse LU of each tangent; the imbalance is over that of the step."""
    solver = import_module("KratosMultiphysics.LinearSolversApplication").SparseLUSolver()
    strategy = kratos.ResidualBasedNewtonRaphsonStrategy(
        part,
        kratos.ResidualBasedIncrementalUpdateStaticScheme(),
        kratos.ResidualCriteria(TOLERANCE, 1e-9),
        kratos.ResidualBasedBlockBuilderAndSolver(solver),
        MOST, False, False, True,
    )  # fmt: skip
    strategy.SetEchoLevel(0)
    strategy.Check()
    strategy.Initialize()
    return strategy


def _advanced(
    kratos: Any, shells: Any, strategy: Any, forces: list[tuple[Any, float]], load: float
) -> tuple[bool, int]:
    """Go to a share of the load, or stay."""
    part = strategy.GetModelPart()
    part.CloneTimeStep(load)
    for node, force in forces:
        node.SetSolutionStepValue(shells.POINT_LOAD, 0, [0.0, 0.0, load * force])
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
