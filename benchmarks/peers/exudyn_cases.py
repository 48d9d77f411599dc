"""The cases that Exudyn can compute; run by `run.py` in an environment that has it.

Its elements are in inertial coordinates q = R(Ωt) p. As rotations commute with the mass matrix and leave the elastic
forces f as they are, small motions about the steady state of the spinning structure have

    f(p̄) = Ω² M p̄,   (λ² M + 2Ωλ M J + ∂f/∂p − Ω² M) x = 0,

J the quarter turn about the axis, which is normal to the plane of all displacements. M and ∂f/∂p are Exudyn's.
"""

from __future__ import annotations

import json
import sys
from itertools import pairwise
from time import process_time
from typing import Any

import exudyn as exu
import exudyn.itemInterface as item
import numpy as np
from exudyn import symbolic
from exudyn.utilities import CreateSymbolicUserFunction

SPEED, DURATION, LENGTH, END = 6.0, 15.0, 10.0, 20.0


def cables(mbs: Any, elements: int, length: float, EA: float, EI: float, mass: float, start: float = 0.0) -> list[Any]:
    """Add a straight beam along x, from a start on, of cubic elements without shear; return its nodes."""
    places = start + np.arange(elements + 1) * length / elements
    h, nodes = length / elements, [item.NodePoint2DSlope1(referenceCoordinates=[x, 0, 1, 0]) for x in places]
    nodes = [mbs.AddNode(node) for node in nodes]
    stiffness = {"bendingStiffness": EI, "axialStiffness": EA, "massPerLength": mass}
    for pair in pairwise(nodes):
        mbs.AddObject(
            item.ObjectANCFCable2D(length=h, nodeNumbers=list(pair), useReducedOrderIntegration=1, **stiffness)
        )
    return nodes


def psi(t: Any) -> Any:
    """Return the angle of the spin-up as a symbolic expression."""
    k = 2 * np.pi / DURATION
    rising = (t * t * 0.5 + (symbolic.cos(t * k) - 1.0) * (1 / k**2)) * (SPEED / DURATION)
    return symbolic.IfThenElse(t < DURATION, rising, (t - 0.5 * DURATION) * SPEED)


def cosine(mbs: Any, t: Any, number: Any, offset: Any) -> Any:
    """Return what the first slope of the root changes by."""
    return symbolic.cos(psi(t)) - 1.0


def sine(mbs: Any, t: Any, number: Any, offset: Any) -> Any:
    """Return what the second one changes by."""
    return symbolic.sin(psi(t))


def spin_up(elements: int, steps: int, tolerance: float) -> tuple[float, Any]:
    """Return seconds of the time loop, and rows of t, u₂ of the tip in the rotating frame."""
    mbs = exu.SystemContainer().AddSystem()
    nodes = cables(mbs, elements, LENGTH, 2.8e7, 1.4e4, 1.2)
    drive(mbs, nodes[0], (None, None, cosine, sine))
    seconds, (t, _, y, _) = driven(mbs, nodes[-1], steps, tolerance, dense=elements < 12)
    return seconds, np.column_stack([t, y]).tolist()


def arm(elements: int, steps: int, tolerance: float) -> tuple[float, Any]:
    """Return seconds of the time loop, and rows of t, u₁, u₂, u₃ of an arm about the axis (0, 0.6, 0.8)."""

    def angle(t: Any, cos: Any, where: Any) -> Any:
        return where(t < 2.0, t * t * 0.5 + (cos(t * np.pi) - 1.0) * (1 / np.pi**2), (t - 1.0) * 2.0)

    def of(turned: Any) -> Any:
        return lambda mbs, t, number, offset: turned(angle(t, symbolic.cos, symbolic.IfThenElse))

    mbs, h = exu.SystemContainer().AddSystem(), 8.0 / elements
    nodes = [
        mbs.AddNode(item.NodePointSlope1(referenceCoordinates=[i * h, 0, 0, 1, 0, 0])) for i in range(elements + 1)
    ]
    for pair in pairwise(nodes):
        stiffness = {"bendingStiffness": 1.4e4, "axialStiffness": 2.8e7, "massPerLength": 1.2}
        mbs.AddObject(item.ObjectANCFCable(length=h, nodeNumbers=list(pair), useReducedOrderIntegration=1, **stiffness))
    slopes = (lambda a: symbolic.cos(a) - 1.0, lambda a: symbolic.sin(a) * 0.8, lambda a: symbolic.sin(a) * -0.6)
    drive(mbs, nodes[0], (None, None, None, *map(of, slopes)))
    seconds, t, (x, y, z) = marched(mbs, nodes[-1], steps, tolerance, dense=elements < 8)
    psi = angle(t, np.cos, np.where)
    c, s, along = (
        np.cos(psi),
        np.sin(psi),
        0.6 * y + 0.8 * z,
    )  # back by ψ about the axis e: r c − e×r s + e (e·r)(1 − c)
    u = (x * c - (0.6 * z - 0.8 * y) * s, y * c - 0.8 * x * s, z * c + 0.6 * x * s)
    u = (u[0] - 8.0, u[1] + 0.6 * along * (1 - c), u[2] + 0.8 * along * (1 - c))
    return seconds, np.column_stack([t, *u]).tolist()


def hub(elements: int, steps: int, tolerance: float) -> tuple[float, Any]:
    """Return seconds of the time loop, and rows of t, u₁, u₂ of a beam on a free hub under a torque 100 sin 2t."""
    mbs, radius = exu.SystemContainer().AddSystem(), 0.5
    nodes = cables(mbs, elements, LENGTH, 2.8e7, 1.4e4, 1.2, radius)
    turning = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=[0, 0, 0]))
    body = mbs.AddObject(item.ObjectRigidBody2D(mass=1.0, inertia=200.0, nodeNumber=turning))
    drive(mbs, turning, (None, None))
    sides = [
        item.MarkerBodyRigid(bodyNumber=body, localPosition=[radius, 0, 0]),
        item.MarkerBodyRigid(bodyNumber=0, localPosition=[0, 0, 0]),
    ]
    mbs.AddObject(item.GenericJoint(markerNumbers=list(map(mbs.AddMarker, sides)), constrainedAxes=[1, 1, 0, 0, 0, 1]))
    angle = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=turning, coordinate=2))
    load = mbs.AddLoad(item.LoadCoordinate(markerNumber=angle, load=1.0))
    torque = CreateSymbolicUserFunction(mbs, lambda mbs, t, load: symbolic.sin(t * 2) * 100, "loadUserFunction", load)
    mbs.SetLoadParameter(load, "loadUserFunction", torque)
    seen = mbs.AddSensor(
        item.SensorNode(nodeNumber=turning, outputVariableType=exu.OutputVariableType.Coordinates, storeInternal=True)
    )
    seconds, t, (x, y, _) = marched(mbs, nodes[-1], steps, tolerance, dense=elements < 12)
    psi = np.asarray(mbs.GetSensorStoredData(seen))[:, 3]
    c, s = np.cos(psi), np.sin(psi)
    return seconds, np.column_stack([t, c * x + s * y - LENGTH - radius, c * y - s * x]).tolist()


def spatial(elements: int, steps: int, tolerance: float) -> tuple[float, Any]:
    """Return seconds of the time loop, and rows of t, u₁, u₂, u₃ of a beam that hangs by its weight and spins up."""
    mbs = exu.SystemContainer().AddSystem()
    h = LENGTH / elements
    nodes = [
        mbs.AddNode(item.NodePointSlope1(referenceCoordinates=[i * h, 0, 0, 1, 0, 0])) for i in range(elements + 1)
    ]
    for pair in pairwise(nodes):
        stiffness = {"bendingStiffness": 1.4e4, "axialStiffness": 2.8e7, "massPerLength": 1.2}
        body = mbs.AddObject(
            item.ObjectANCFCable(length=h, nodeNumbers=list(pair), useReducedOrderIntegration=1, **stiffness)
        )
        whole = mbs.AddMarker(item.MarkerBodyMass(bodyNumber=body))
        mbs.AddLoad(item.LoadMassProportional(markerNumber=whole, loadVector=[0, 0, -9.81]))
    drive(mbs, nodes[0], (None, None, None, cosine, sine, None))
    seconds, (t, x, y, z) = driven(mbs, nodes[-1], steps, tolerance, dense=elements < 8, hanging=True)
    return seconds, np.column_stack([t, x - LENGTH, y, z]).tolist()


def drive(mbs: Any, root: Any, functions: tuple[Any, ...]) -> None:
    """Give the coordinates of the root what they change by over time; None is nothing."""
    ground = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(item.NodePointGround()), coordinate=0))
    for coordinate, turned in enumerate(functions):
        own = mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=root, coordinate=coordinate))
        constraint = mbs.AddObject(item.CoordinateConstraint(markerNumbers=[ground, own]))
        if turned is not None:
            function = CreateSymbolicUserFunction(mbs, turned, "offsetUserFunction", constraint)
            mbs.SetObjectParameter(constraint, "offsetUserFunction", function)


def driven(mbs: Any, tip: Any, steps: int, tolerance: float, dense: bool, hanging: bool = False) -> tuple[float, Any]:
    """March; return seconds of the time loop, and t and the position of the tip in the rotating frame.

    A beam that is hanging begins in its equilibrium at rest, which is not timed.
    """
    seconds, t, (x, y, z) = marched(mbs, tip, steps, tolerance, dense, END, 0.5, hanging)
    k = 2 * np.pi / DURATION
    angle = np.where(
        t < DURATION, SPEED / DURATION * (t * t / 2 + (np.cos(k * t) - 1) / k**2), SPEED * (t - DURATION / 2)
    )
    c, s = np.cos(angle), np.sin(angle)
    return seconds, (t, c * x + s * y, c * y - s * x, z)


def marched(
    mbs: Any,
    tip: Any,
    steps: int,
    tolerance: float,
    dense: bool,
    end: float = 4.0,
    period: float = 0.1,
    hanging: bool = False,
) -> tuple[float, Any, Any]:
    """March; return seconds of the time loop, instants a period apart, and the position of the tip, (3, instants)."""
    sensor = mbs.AddSensor(
        item.SensorNode(nodeNumber=tip, outputVariableType=exu.OutputVariableType.Position, storeInternal=True)
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, end
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.automaticStepSize = False
    newton = settings.timeIntegration.newton
    newton.useModifiedNewton = newton.modifiedNewtonJacUpdatePerStep = True
    newton.relativeTolerance = newton.absoluteTolerance = tolerance
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = period
    settings.linearSolver.solverType = exu.LinearSolverType.EXUdense if dense else exu.LinearSolverType.EigenSparse
    if hanging:
        still = settings.staticSolver
        still.loadStepDuration = 1e-6  # it is a time, in which the root turns
        still.numberOfLoadSteps, still.newton.relativeTolerance, still.newton.absoluteTolerance = 20, 1e-8, 1e-8
        mbs.SolveStatic(settings, updateInitialValues=True)
    started = process_time()
    mbs.SolveDynamic(settings)
    seconds = process_time() - started
    t, *places = np.asarray(mbs.GetSensorStoredData(sensor)).T
    return seconds, t, np.array(places)


def spinning(mbs: Any, held: Any, turns: tuple[Any, Any], speeds: list[float], count: int) -> list[list[float]]:
    """Return the first frequencies at each speed (rad/s), about the steady state.

    Args:
        mbs: assembled system.
        held: coordinates that are clamped.
        turns: those along the first and along the second axis of the plane of rotation.
        speeds: Ω, rad/s.
        count: number of frequencies.
    """
    settings, solver = exu.SimulationSettings(), exu.MainSolverStatic()
    settings.solution.file.write = False
    reference = mbs.systemData.GetODE2Coordinates(configuration=exu.ConfigurationType.Reference)
    n = len(reference)
    free, p, found = np.setdiff1d(np.arange(n), held), np.zeros(n), []
    solver.InitializeSolver(mbs, settings)
    solver.ComputeMassMatrix(mbs)
    M = np.array(solver.GetSystemMassMatrix())[:n, :n]
    first, second = turns
    J, plane = np.zeros((n, n)), np.zeros(n)
    J[first, second], J[second, first] = -1.0, 1.0
    plane[first] = plane[second] = 1.0
    inner = np.ix_(free, free)

    def stiffness() -> Any:
        solver.ComputeJacobianODE2RHS(mbs, scalarFactor_ODE2=-1.0, scalarFactor_ODE2_t=0.0, scalarFactor_ODE1=0.0)
        return np.array(solver.GetSystemJacobian())[:n, :n]

    for speed in speeds:
        for _ in range(20):
            mbs.systemData.SetODE2Coordinates(p)
            K = stiffness() - speed**2 * M * plane
            solver.ComputeODE2RHS(mbs)
            force = np.array(solver.GetSystemResidual())[:n] + speed**2 * M @ (plane * (reference + p))
            step = np.linalg.solve(K[inner], force[free])
            p[free] += step
            if np.linalg.norm(step) < 1e-9 * np.linalg.norm(reference):
                break
        C = 2 * speed * M @ J
        size, identity = len(free), np.eye(len(free))
        A = np.block(
            [[np.zeros((size, size)), identity], [-np.linalg.solve(M[inner], np.hstack([K[inner], C[inner]]))]]
        )
        values = np.linalg.eigvals(A)
        found.append(np.sort(values.imag[values.imag > 0])[:count].tolist())
    return found


def lag(elements: int, speeds: list[float]) -> tuple[float, Any]:
    """Return seconds, and three frequencies at each speed of a thin beam in its plane, L = EI = ρA = 1, EA = 1e6."""
    started = process_time()
    mbs = exu.SystemContainer().AddSystem()
    nodes = cables(mbs, elements, 1.0, 1e6, 1.0, 1.0)
    mbs.Assemble()
    place = np.array([mbs.GetNodeODE2Index(n) for n in nodes])
    held = place[0] + np.array([0, 1, 3])
    found = spinning(mbs, held, (np.r_[place, place + 2], np.r_[place + 1, place + 3]), speeds, 3)
    return process_time() - started, found


def plate(cells: int, speeds: list[float]) -> tuple[float, Any]:
    """Return seconds, and five frequencies at each speed (rad/s) of a thin square plate that turns in its plane."""
    E, nu, rho, h = 70e9, 0.3, 2700.0, 0.01
    started = process_time()
    mbs = exu.SystemContainer().AddSystem()
    grid = np.linspace(0.0, 1.0, cells + 1)
    nodes = np.array(
        [
            [mbs.AddNode(item.NodePointSlope12(referenceCoordinates=[x, y, 0, 1, 0, 0, 0, 1, 0])) for x in grid]
            for y in grid - 0.5
        ]
    )
    law = np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1 - nu) / 2]]) * E / (1 - nu**2)
    for i in range(cells):
        for j in range(cells):
            corners = [nodes[i, j], nodes[i, j + 1], nodes[i + 1, j + 1], nodes[i + 1, j]]
            mbs.AddObject(
                item.ObjectANCFThinPlate(
                    thickness=h,
                    density=rho,
                    strainCoefficients=law * h,
                    curvatureCoefficients=law * h**3 / 12,
                    nodeNumbers=corners,
                )
            )
    mbs.Assemble()
    place = np.array([mbs.GetNodeODE2Index(n) for n in nodes.ravel()])
    clamped = np.array([mbs.GetNodeODE2Index(n) for n in nodes[:, 0]])
    # the slope along the edge follows from the positions; that across it may stretch
    held = np.r_[clamped, clamped + 1, clamped + 2, clamped + 5, clamped + 6, clamped + 7, clamped + 8]
    first, second = (np.r_[place + i, place + 3 + i, place + 6 + i] for i in (0, 1))
    found = spinning(mbs, held, (first, second), speeds, 5)
    return process_time() - started, found


if __name__ == "__main__":
    case, arguments = globals()[sys.argv[1]], json.loads(sys.argv[2])
    case(**arguments)  # the first time is not measured
    seconds, values = case(**arguments)
    print(json.dumps({"seconds": seconds, "values": values}))
