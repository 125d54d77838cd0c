"""The capstan by EXUDYN: a planar cable of 80 elements (absolute nodal coordinates).

Static steps of adapted length: tension, then wrapping, then the roller turns; contact by
penalty with Coulomb's friction, in four segments of each element.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from peer_capstan import (
    BENDING,
    COEFFICIENT,
    DOWN,
    LENGTH,
    PULL,
    RADIUS,
    THICKNESS,
    YOUNG,
    Answer,
    answer,
    timed,
)
from strips import CONTACT, TENSION

ELEMENTS, SEGMENTS, STEPS = 80, 4, 120

TURN = 0.6
"""rad, far more than friction takes to be in full slip."""

SLACK = 0.01
"""Stiffness of sticking over that of contact."""


def solved(stiffer: float) -> Answer:
    """Build, solve, read."""
    exu, items = import_module("exudyn"), import_module("exudyn.itemInterface")
    system = exu.SystemContainer().AddSystem()
    cables, nodes = _cable(system, items)
    _moved(system, items, nodes)
    _roller(system, items, cables, stiffer * CONTACT["stiffness"])
    system.Assemble()
    settings = _settings(exu)
    done: list[bool] = []
    seconds = timed(lambda: done.append(bool(system.SolveStatic(settings))))
    if not done[0]:
        raise RuntimeError("Newton's method does not converge, at the smallest step")
    iterations = system.sys["staticSolver"].it
    counts = (iterations.currentStepIndex - 1, iterations.newtonStepsCount, 4 * len(nodes))
    ends = tuple(_force(exu, system, cables[i], nodes[j]) for i, j in ((1, 0), (-2, -1)))
    return answer((-ends[0], ends[1]), COEFFICIENT, seconds, counts)


def _cable(system: Any, items: Any) -> tuple[list[Any], list[Any]]:
    h = LENGTH / ELEMENTS
    x = np.linspace(-0.5 * LENGTH, 0.5 * LENGTH, ELEMENTS + 1)
    nodes = [
        system.AddNode(items.NodePoint2DSlope1(referenceCoordinates=[place, 0.0, 1.0, 0.0]))
        for place in x
    ]
    cables = [
        system.AddObject(
            items.ObjectANCFCable2D(
                length=h,
                massPerLength=1.0,
                bendingStiffness=BENDING,
                axialStiffness=YOUNG * THICKNESS,
                nodeNumbers=[nodes[i], nodes[i + 1]],
                useReducedOrderIntegration=1,
            )
        )
        for i in range(ELEMENTS)
    ]
    return cables, nodes


def _held(system: Any, items: Any, node: Any, coordinate: int, moved: Any = None) -> None:
    """A coordinate prescribed; ``moved`` is a function of the time of the steps."""
    ground = system.AddNode(items.NodePointGround())
    markers = [
        system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=n, coordinate=c))
        for n, c in ((ground, 0), (node, coordinate))
    ]
    options = {} if moved is None else {"offsetUserFunction": lambda mbs, t, i, o: moved(t)}
    system.AddObject(items.CoordinateConstraint(markerNumbers=markers, **options))


def _ramp(t: float, begin: float) -> float:
    return min(max(t - begin, 0.0), 1.0)


def _moved(system: Any, items: Any, nodes: list[Any]) -> None:
    """The entry held and moved, the exit pulled."""
    _held(system, items, nodes[0], 0)
    _held(system, items, nodes[0], 1, lambda t: DOWN * _ramp(t, 1.0))
    exit = system.AddMarker(items.MarkerNodePosition(nodeNumber=nodes[-1]))

    def pull(mbs: Any, t: float, load: Any) -> list[float]:
        return [TENSION * _ramp(t, 0.0), PULL * _ramp(t, 1.0), 0.0]

    system.AddLoad(items.Force(markerNumber=exit, loadVectorUserFunction=pull))


def _roller(system: Any, items: Any, cables: list[Any], stiffness: float) -> None:
    """A circle that turns, in contact with the cable."""
    place = [0.0, -RADIUS - 1e-3, 0.0]
    node = system.AddNode(items.NodeRigidBody2D(referenceCoordinates=place))
    system.AddObject(items.ObjectRigidBody2D(mass=1.0, inertia=1.0, nodeNumber=node))
    for coordinate in (0, 1):
        _held(system, items, node, coordinate)
    _held(system, items, node, 2, lambda t: -TURN * _ramp(t, 2.0))
    circle = system.AddMarker(items.MarkerNodeRigid(nodeNumber=node))
    segment = LENGTH / ELEMENTS / SEGMENTS
    for i, cable in enumerate(cables):
        if abs((i + 0.5) / ELEMENTS - 0.5) * LENGTH > 2.0 * RADIUS:
            continue
        shape = items.MarkerBodyCable2DShape(bodyNumber=cable, numberOfSegments=SEGMENTS)
        start = [0.1] * SEGMENTS + [-2] * SEGMENTS + [0.0] * SEGMENTS
        data = items.NodeGenericData(initialCoordinates=start, numberOfDataCoordinates=3 * SEGMENTS)
        system.AddObject(
            items.ObjectContactFrictionCircleCable2D(
                markerNumbers=[circle, system.AddMarker(shape)],
                nodeNumber=system.AddNode(data),
                numberOfContactSegments=SEGMENTS,
                contactStiffness=stiffness * segment,
                frictionStiffness=SLACK * CONTACT["stiffness"] * segment,
                frictionCoefficient=COEFFICIENT,
                circleRadius=RADIUS,
                useSegmentNormals=False,
            )
        )


def _settings(exu: Any) -> Any:
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    static = settings.staticSolver
    static.numberOfLoadSteps, static.loadStepDuration, static.adaptiveStep = STEPS, 3.0, True
    static.newton.relativeTolerance, static.newton.absoluteTolerance = 1e-8, 1e-3
    static.newton.maxIterations, static.verboseMode = 30, 0
    static.discontinuous.maxIterations, static.discontinuous.ignoreMaxIterations = 20, True
    static.discontinuous.iterationTolerance = 0.1
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.parallel.numberOfThreads = 1
    return settings


def _force(exu: Any, system: Any, cable: Any, node: Any) -> Any:
    """Return the axial force of an end (N), along the cable there."""
    middle = [0.5 * LENGTH / ELEMENTS, 0.0, 0.0]
    kinds = exu.OutputVariableType
    force = np.atleast_1d(system.GetObjectOutputBody(cable, kinds.ForceLocal, localPosition=middle))
    slope = np.array([1.0, 0.0]) + system.GetNodeOutput(node, kinds.Coordinates)[2:4]
    return force[0] * slope / np.linalg.norm(slope)
