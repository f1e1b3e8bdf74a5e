"""Contestant: Exudyn's ANCF cable (cubic, no shear, no torsion), generalised alpha with a fixed step and its modified Newton method.

Exudyn has no drag. It is added as one object on all nodes whose generalised force is integrated in a compiled function, with three Gauss
points an element; its derivative is left to the modified Newton method, which is faster than to supply it (measured). Newton's tolerance
is the loosest that keeps the error; the compiled library without range checks is used. A run without drag shows what the drag adds.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from master.studies.benchmarks.histories import SAMPLE, Histories, LineCase, Setting, instants
from pipe_fmu import Pipe, PipeParameters
from pipe_fmu.compiled import kernel
from pipe_fmu.maths.so3 import matrix

_NEWTON = 1e-5  # relative tolerance; 1e-8, the default, takes half as long again and gives the same errors
_SPECTRAL_RADIUS = 0.9  # Exudyn's default
GAUSS = 0.5 * np.column_stack(np.polynomial.legendre.leggauss(3)) + [0.5, 0.0]  # points and weights on (0, 1)


@kernel
def drag(shape, speed, length, across, along, depth, surface, gauss):
    """Generalised drag (6 n,) of positions and slopes `shape` (6 n,), their rates `speed`; a current linear in depth, along y.

    across, along: force per length over the squared normal and tangential speed relative to the water.
    """
    out = np.zeros(len(shape))
    for e in range(len(shape) // 6 - 1):
        for k in range(len(gauss)):
            s, weight = gauss[k, 0], gauss[k, 1] * length
            value = (1 - 3 * s**2 + 2 * s**3, length * s * (1 - s) ** 2, 3 * s**2 - 2 * s**3, length * s**2 * (s - 1))
            slope = (6 * s * (s - 1) / length, 1 - 4 * s + 3 * s**2, 6 * s * (1 - s) / length, 3 * s**2 - 2 * s)
            t, v, z = np.zeros(3), np.zeros(3), 0.0
            for a in range(4):
                z += value[a] * shape[6 * e + 3 * a + 2]
                for i in range(3):
                    t[i] += slope[a] * shape[6 * e + 3 * a + i]
                    v[i] -= value[a] * speed[6 * e + 3 * a + i]
            v[1] += surface * min(max(-z / depth, 0.0), 1.0)
            size = math.sqrt(t[0] ** 2 + t[1] ** 2 + t[2] ** 2)
            for i in range(3):
                t[i] /= size
            forward = v[0] * t[0] + v[1] * t[1] + v[2] * t[2]
            sideways = math.sqrt(max(v[0] ** 2 + v[1] ** 2 + v[2] ** 2 - forward**2, 0.0))
            for i in range(3):
                force = weight * (across * sideways * (v[i] - forward * t[i]) + along * abs(forward) * forward * t[i])
                for a in range(4):
                    out[6 * e + 3 * a + i] += value[a] * force
    return out


def run(parameters: PipeParameters, case: LineCase, setting: Setting) -> tuple[float, Histories]:
    """CPU time [s] of the steps and the histories. Contestant "Exudyn ANCF", or "Exudyn without drag" for the time of a bare step.

    The model starts from Exudyn's own static solution in the current. Raises ImportError where Exudyn is not installed.
    """
    sys.exudynFast = True  # type: ignore[attr-defined]
    import exudyn as exu
    items = import_module("exudyn.itemInterface")

    mbs = exu.SystemContainer().AddSystem()
    nodes, start = _cable(mbs, items, parameters, setting, "without" not in setting.contestant)
    held = _supports(mbs, items, nodes, case)
    kind = exu.OutputVariableType
    sensors = [
        *(_sensor(mbs, items.SensorNode(nodeNumber=n, outputVariableType=kind.Coordinates)) for n in nodes),
        *(_sensor(mbs, items.SensorObject(objectNumber=o, outputVariableType=kind.Force)) for o in held),
    ]
    mbs.Assemble()
    settings = _settings(exu, case, setting)
    mbs.variables["moves"] = False  # the static solver has a time of its own
    mbs.SolveStatic(settings, updateInitialValues=True)
    mbs.variables["moves"] = True
    begin = time.process_time()
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
    spent = time.process_time() - begin
    stored = [np.asarray(mbs.GetSensorStoredData(sensor))[1 : len(instants(case.duration)) + 1, 1:] for sensor in sensors]
    shapes = np.stack(stored[: len(nodes)], axis=1) + start
    quarters = [k * setting.elements // 4 for k in (1, 2, 3)]
    force = -np.hstack(stored[len(nodes) :])
    bending = parameters.section.stiffness[3] * _largest_curvature(shapes, parameters.length / setting.elements)
    return spent, Histories(shapes[:, quarters, :3], force, bending)


def _cable(mbs: Any, items: Any, parameters: PipeParameters, setting: Setting, drags: bool) -> tuple[list[Any], np.ndarray]:
    """Nodes of the cable in its water, placed where the pipe hangs, and their coordinates (n, 6)."""
    section, environment = parameters.section, parameters.environment
    axial, _, _, bending, _ = section.stiffness
    mass, length = section.mass_per_length, parameters.length / setting.elements
    weight = (mass - environment.water_density * section.outer_area) * environment.gravity
    found, _ = Pipe(parameters).start(0.0)
    start = np.array([[*x, *np.array(matrix(tuple(q)))[:, 0]] for x, q in zip(found.position, found.quaternion, strict=True)])
    nodes = [mbs.AddNode(items.NodePointSlope1(referenceCoordinates=list(x))) for x in start]
    for pair in pairwise(nodes):
        element = items.ObjectANCFCable(
            length=length, massPerLength=mass, bendingStiffness=bending, axialStiffness=axial,
            nodeNumbers=list(pair), useReducedOrderIntegration=1,
        )  # fmt: skip
        whole = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=mbs.AddObject(element)))
        mbs.AddLoad(items.LoadMassProportional(markerNumber=whole, loadVector=[0.0, 0.0, weight / mass]))
    if drags:
        _add_drag(mbs, items, parameters, nodes, start.ravel(), length)
    return nodes, start


def _add_drag(mbs: Any, items: Any, parameters: PipeParameters, nodes: list[Any], start: np.ndarray, length: float) -> None:
    import exudyn as exu

    section, environment = parameters.section, parameters.environment
    assert environment.current is not None
    factor = 0.5 * environment.water_density * section.outer_diameter
    constants = (factor * section.drag_normal, factor * section.drag_tangential, environment.depth, environment.current.velocity[1], GAUSS)
    nothing = exu.MatrixContainer()
    nothing.SetWithSparseMatrix(np.array([[0.0, 0.0, 1e-12]]), len(start), len(start))

    def force(mbs: Any, t: float, item: int, shape: Sequence[float], speed: Sequence[float]) -> np.ndarray:
        return np.asarray(drag(start + np.array(shape), np.array(speed), length, *constants))

    def jacobian(*_: Any) -> Any:
        return nothing

    mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=nodes, massMatrix=nothing, forceUserFunction=force, jacobianUserFunction=jacobian))


def _supports(mbs: Any, items: Any, nodes: list[Any], case: LineCase) -> list[Any]:
    """Clamp the foot along x and hold the top where the motion says; the three constraints of the top."""
    ground = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(items.NodePointGround()), coordinate=0))

    def hold(node: Any, coordinate: int, **options: Any) -> Any:
        marker = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
        return mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[ground, marker], **options))

    for coordinate in (0, 1, 2, 4, 5):
        hold(nodes[0], coordinate)

    def heave(mbs: Any, t: float, item: int, offset: float) -> float:
        return float(case.motion(t)[0][2]) if mbs.variables["moves"] else 0.0

    return [hold(nodes[-1], 0), hold(nodes[-1], 1), hold(nodes[-1], 2, offsetUserFunction=heave)]


def _sensor(mbs: Any, sensor: Any) -> Any:
    sensor.storeInternal, sensor.writeToFile = True, False
    return mbs.AddSensor(sensor)


def _settings(exu: Any, case: LineCase, setting: Setting) -> Any:
    settings = exu.SimulationSettings()
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.linearSolver.reuseAnalyzedPattern = True
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = SAMPLE
    settings.staticSolver.newton.relativeTolerance, settings.staticSolver.newton.absoluteTolerance = 1e-9, 1e-6
    settings.staticSolver.verboseMode = settings.timeIntegration.verboseMode = 0
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime = round(case.duration / setting.step_s), case.duration
    integration.generalizedAlpha.spectralRadius = _SPECTRAL_RADIUS
    integration.newton.useModifiedNewton, integration.newton.relativeTolerance = True, _NEWTON
    return settings


def _largest_curvature(shapes: np.ndarray, length: float) -> np.ndarray:
    """Largest curvature (k,) [1/m] at the ends of the elements of `shapes` (k, n, 6), of the cubics between the nodes."""
    r, t, r2, t2 = shapes[:, :-1, :3], shapes[:, :-1, 3:], shapes[:, 1:, :3], shapes[:, 1:, 3:]
    chord = (r2 - r) / length
    bends = np.concatenate([(6.0 * chord - 4.0 * t - 2.0 * t2) / length, (-6.0 * chord + 2.0 * t + 4.0 * t2) / length], axis=1)
    slopes = np.concatenate([t, t2], axis=1)
    curvature = np.linalg.norm(np.cross(slopes, bends), axis=-1) / np.linalg.norm(slopes, axis=-1) ** 3
    return np.asarray(curvature.max(axis=1))
