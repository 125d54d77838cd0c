"""The belt drive of ``examples/belt.py`` by EXUDYN: a closed planar cable, marched in time.

    python examples/benchmarks/peer_belt.py [--quick]

A belt of 120 elements (absolute nodal coordinates) is stretched round two fixed pulleys without
friction.  Then the driving one is brought to 12 rad/s in 0.55 s, and from 1 s to 1.5 s a torque
of 25 N m comes to act on the other, beside 2 N m s/rad of drag.  Contact and sticking are as
stiff, and steps as short, as the published model has them; each element meets a pulley in two
segments.  At 2.45 s the strands are read, and the speed of the driven pulley, which still swings,
as its mean over the last fifth of a second; beside the stationary state of this program, found
in the same process.  Needs ``pip install exudyn``.
"""

from __future__ import annotations

import argparse
import runpy
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

ELEMENTS, SEGMENTS = 120, 2
WIDTH, HEIGHT, YOUNG, DENSITY = 0.08, 0.01, 1e7, 1036.0
AXIAL, BENDING = YOUNG * WIDTH * HEIGHT, 0.02 * YOUNG * WIDTH * HEIGHT**3 / 12.0
RADIUS, DISTANCE, STRETCH, COEFFICIENT = 0.1, 0.1 * np.pi, 0.05, 0.5
DRIVEN, TORQUE, DRAG = 12.0, 25.0, 2.0  # rad/s, N m, N m s
END, STEP = 2.45, 1e-5  # s


def ramp(t: float, begin: float, end: float) -> float:
    """Return the share of a ramp at a time."""
    return min(max((t - begin) / (end - begin), 0.0), 1.0)


def oval(count: int) -> tuple[np.ndarray, float]:
    """Return places and directions (count, 4) along the belt round both pulleys, and its length."""
    arc, length = np.pi * RADIUS, 2.0 * DISTANCE + 2.0 * np.pi * RADIUS
    rows = []
    for s in np.arange(count) * length / count:
        lower, along = s < DISTANCE + arc, s % (DISTANCE + arc)
        angle = max(along - DISTANCE, 0.0) / RADIUS
        place = np.array([min(along, DISTANCE) - 0.5 * DISTANCE, -RADIUS])
        place += RADIUS * np.array([np.sin(angle), 1.0 - np.cos(angle)])
        both = np.concatenate([place, [np.cos(angle), np.sin(angle)]])
        rows.append(both if lower else -both)
    return np.array(rows), length


class Belt:
    """The model, and what is read off it."""

    def __init__(self) -> None:
        self.exu, self.items = import_module("exudyn"), import_module("exudyn.itemInterface")
        self.system = self.exu.SystemContainer().AddSystem()
        ground = self.system.AddNode(self.items.NodePointGround())
        self.ground = self._coordinate(ground, 0)
        self._cable()
        self.contacts: list[Any] = []
        self.friction = {"frictionCoefficient": COEFFICIENT}
        pulleys = [self._pulley(x) for x in (-0.5 * DISTANCE, 0.5 * DISTANCE)]
        kinds = self.exu.OutputVariableType
        sensor = {"storeInternal": True, "outputVariableType": kinds.AngularVelocity}
        self.turning = self.system.AddSensor(self.items.SensorNode(nodeNumber=pulleys[1], **sensor))
        turns = [self._coordinate(pulley, 2) for pulley in pulleys]
        self.held = [self._joined(turn) for turn in turns] + [self._fixed_along]

        def speed(mbs: Any, t: float, item: int, offset: float) -> float:
            return DRIVEN * ramp(t, 0.05, 0.6)

        self.drive = self._joined(turns[0], velocityLevel=True, offsetUserFunction_t=speed)
        self._torque(turns[1])
        self.system.Assemble()

    def _coordinate(self, node: Any, coordinate: int) -> Any:
        items = self.items
        return self.system.AddMarker(
            items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate)
        )

    def _joined(self, marker: Any, **options: Any) -> Any:
        items = self.items
        both = [self.ground, marker]
        return self.system.AddObject(items.CoordinateConstraint(markerNumbers=both, **options))

    def _cable(self) -> None:
        items, system = self.items, self.system
        places, length = oval(ELEMENTS)
        nodes = [
            system.AddNode(items.NodePoint2DSlope1(referenceCoordinates=list(row)))
            for row in places
        ]
        self.length = length / ELEMENTS
        self.cables = [
            system.AddObject(
                items.ObjectANCFCable2D(
                    length=self.length,
                    massPerLength=DENSITY * WIDTH * HEIGHT,
                    bendingStiffness=BENDING,
                    axialStiffness=AXIAL,
                    referenceAxialStrain=-STRETCH,
                    strainIsRelativeToReference=0.0,
                    nodeNumbers=[nodes[i], nodes[(i + 1) % ELEMENTS]],
                    useReducedOrderIntegration=2,
                )
            )
            for i in range(ELEMENTS)
        ]
        self._fixed_along = self._joined(self._coordinate(nodes[0], 0))

    def _pulley(self, x: float) -> Any:
        items, system = self.items, self.system
        node = system.AddNode(items.NodeRigidBody2D(referenceCoordinates=[x, 0.0, 0.0]))
        system.AddObject(items.ObjectRigidBody2D(mass=50.0, inertia=0.25, nodeNumber=node))
        for coordinate in (0, 1):
            self._joined(self._coordinate(node, coordinate))
        circle = system.AddMarker(items.MarkerNodeRigid(nodeNumber=node))
        area = WIDTH * self.length / SEGMENTS
        mass = DENSITY * HEIGHT * area
        stick = 5e9 * area
        self.friction["frictionStiffness"] = 0.1 * stick
        for cable in self.cables:
            shape = items.MarkerBodyCable2DShape(bodyNumber=cable, numberOfSegments=SEGMENTS)
            start = [0.1] * SEGMENTS + [-2] * SEGMENTS + [0.0] * SEGMENTS
            data = items.NodeGenericData(
                initialCoordinates=start, numberOfDataCoordinates=3 * SEGMENTS
            )
            self.contacts.append(
                system.AddObject(
                    items.ObjectContactFrictionCircleCable2D(
                        markerNumbers=[circle, system.AddMarker(shape)],
                        nodeNumber=system.AddNode(data),
                        numberOfContactSegments=SEGMENTS,
                        contactStiffness=4e9 * area,
                        contactDamping=8e4 * area,
                        frictionVelocityPenalty=10.0 * np.sqrt(stick * mass),
                        circleRadius=RADIUS,
                        **self.friction,
                    )
                )
            )
        return node

    def _torque(self, turn: Any) -> None:
        items, both = self.items, [self.ground, turn]
        self.system.AddObject(items.CoordinateSpringDamper(markerNumbers=both, damping=DRAG))

        def resisting(mbs: Any, t: float, load: float) -> float:
            share = ramp(t, 1.0, 1.5)
            return -TORQUE * share**2 * (3.0 - 2.0 * share)

        self.system.AddLoad(
            items.LoadCoordinate(markerNumber=turn, load=0.0, loadUserFunction=resisting)
        )

    def _rubbing(self, **values: float) -> None:
        for contact in self.contacts:
            for name, value in values.items():
                self.system.SetObjectParameter(contact, name, value)

    def _active(self, constraints: list[Any], active: bool) -> None:
        for each in constraints:
            self.system.SetObjectParameter(each, "activeConnector", active)

    def run(self, step: float) -> dict[str, float]:
        """Stretch the belt, march, and read the strands."""
        settings = self.exu.SimulationSettings()
        settings.solution.file.write = False
        settings.linearSolver.solverType = self.exu.LinearSolverType.EigenSparse
        settings.parallel.numberOfThreads = 1
        static, marching = settings.staticSolver, settings.timeIntegration
        static.numberOfLoadSteps, static.adaptiveStep, static.stabilizerODE2term = 10, True, 1e6
        static.newton.relativeTolerance = static.newton.absoluteTolerance = 1e-6
        marching.endTime, marching.numberOfSteps = END, round(END / step)
        marching.newton.useModifiedNewton = True
        marching.discontinuous.iterationTolerance = 1e-3
        marching.discontinuous.maxIterations = 3
        self._active([self.drive], False)
        self._rubbing(frictionCoefficient=0.0, frictionStiffness=1e-8)
        if not self.system.SolveStatic(settings, updateInitialValues=True):
            raise RuntimeError("the belt is not stretched")
        self._rubbing(**self.friction)
        self._active([self.drive], True)
        self._active(self.held, False)
        solver = self.exu.DynamicSolverType.TrapezoidalIndex2
        if not self.system.SolveDynamic(settings, solverType=solver):
            raise RuntimeError("the march does not end")
        return self._strands()

    def _strands(self) -> dict[str, float]:
        """Return what the stationary state is judged by: means over the middle of both strands."""
        kinds, rows = self.exu.OutputVariableType, []
        for cable in self.cables:
            given = {"localPosition": [0.5 * self.length, 0.0, 0.0]}
            place = self.system.GetObjectOutputBody(cable, kinds.Position, **given)
            force = self.system.GetObjectOutputBody(cable, kinds.ForceLocal, **given)
            rows.append((*place[:2], np.atleast_1d(force)[0]))
        x, y, force = np.array(rows).T
        middle = np.abs(x) < 0.3 * DISTANCE
        strands = sorted(force[middle & side].mean() for side in (y > 0.0, y < 0.0))
        slack, tight = (float(each) for each in strands)
        times, *_, turning = self.system.GetSensorStoredData(self.turning).T
        return {
            "tight": tight,
            "slack": slack,
            "arc": float(np.log(tight / slack)) / COEFFICIENT,
            "ratio": DRIVEN / float(turning[times > END - 0.2].mean()),
        }


def timed(work: Callable[[], dict[str, float]]) -> tuple[dict[str, float], float]:
    """Return what some work finds, and the processor seconds that it takes."""
    begin = time.process_time()
    return work(), time.process_time() - begin


def main(step: float) -> None:
    """Find the state both ways, and print a row of each."""
    ours = runpy.run_path(str(Path(__file__).parents[1] / "belt.py"))
    counts = []

    def stationary() -> dict[str, float]:
        run, last = ours["settled"]([])
        counts.append(f"{run.cost.expansions} tangents")
        found: dict[str, float] = ours["found"](run, last)
        return found

    rows = [("published", ours["PUBLISHED"], "245000 steps", None)]
    found, seconds = timed(stationary)
    rows.append(("stationary", found, counts[0], seconds))
    found, seconds = timed(lambda: Belt().run(step))
    rows.append(("EXUDYN, here", found, f"{round(END / step)} steps", seconds))
    print(f"{'':14}{'tight (N)':>11}{'slack (N)':>11}{'arc (rad)':>11}{'ratio':>9}")
    for name, values, count, spent in rows:
        numbers = "".join(
            f"{values[key]:{width}.6g}"
            for key, width in zip(("tight", "slack", "arc", "ratio"), (11, 11, 11, 9), strict=True)
        )
        print(f"{name:14}{numbers}  {count}{'' if spent is None else f', {spent:.1f} s'}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="steps ten times as long")
    main(10.0 * STEP if parser.parse_args().quick else STEP)
