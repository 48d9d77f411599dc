"""A problem's equations, compiled: those of a structure, and with the angle psi of a free hub as last unknown.

The hub's equation (`rotfem.equations.hub`) borders those of the structure. Both are solved together by block
elimination, with one factorisation for two right-hand sides.
"""

from __future__ import annotations

from collections.abc import Collection
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.equations.affine import AffineSystem
from rotfem.equations.clamp import along_axis
from rotfem.equations.hub import HubRow
from rotfem.equations.model import Model
from rotfem.equations.nonlinear import NonlinearSystem
from rotfem.equations.system import Instant, System
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.time_signals import View, viewed
from rotfem.numerics.projection import bordered
from rotfem.structures.structure import check_memory

Array = npt.NDArray[np.float64]


def compile_system(
    problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD, moving: bool = True, parted: bool = False
) -> System:
    """Return the system of a problem.

    A system that is not `moving`, of steady states and modes, needs fewer forms; effects can be left out of one that is
    `parted`, or moving.
    """
    if moving and any(support.of_frequency for support in getattr(problem.structure, "supports", ())):
        why = "depend on the frequency of whirl, which a history does not have; modes, campbell and unbalance take them"
        raise InputError("structure.supports", None, why)
    view = View()
    free = problem.motion.hub is not None  # whose angle is an unknown of the model
    seen, signals = viewed(problem if free else problem.pushed(problem.motion), view) if moving else (problem, [])
    model = Model(seen, comm, moving)
    if problem.theory.linear and moving:  # its pieces are held apart, 12 kB for each unknown of a plate
        V, file = model.structure.V, getattr(problem.structure, "mesh", None)
        key, value = ("mesh.elements", problem.mesh.elements) if file is None else ("structure.mesh", str(file))
        nodes, components, dimension = V.dofmap.index_map.size_global, V.dofmap.index_map_bs, V.mesh.topology.dim
        check_memory(key, value, nodes, components, dimension, comm, times=2.0)
    kinds = (AffineSystem, AffineWithHub) if problem.theory.linear else (NonlinearSystem, NonlinearWithHub)
    system: System = kinds[model.hub is not None](model, moving, parted, view, signals)
    if not parted:
        system.check_terms()
    return system


def with_all_unknowns(system: System) -> System:
    """Return a system; if it has inactive components that with all of them, at rest, as stability depends on all."""
    problem = system.model.problem
    return compile_system(problem.replace(inactive=()), system.comm, moving=False) if problem.inactive else system


class WithHub(System):
    """What the angle of a free hub adds to a system: unknowns of a motion are those of the structure, then psi.

    An array without psi is of the structure alone, as in modes about a constant speed.
    """

    row: HubRow

    def __init__(self, *arguments: Any):
        super().__init__(*arguments)
        self.solved_at_once = self.keeps_factor = False  # the border changes with the speed

    # --- state -------------------------------------------------------------------------------------------------------

    def start(self, q: Array) -> tuple[Array, Array]:
        """Return (q, v) of a structure at rest in the frame, with angle and speed that the hub starts with."""
        self.row.angle.start()
        psi, speed, _ = self.row.angle.values
        return np.append(q, psi), np.append(np.zeros_like(q), speed)

    def set_state(self, q: Array, v: Array | None = None, a: Array | None = None) -> None:
        """Write unknowns and their rates, and with psi the speed of the frame."""
        n = len(self._state[0])
        super().set_state(q[:n], None if v is None else v[:n], None if a is None else a[:n])
        if len(q) > n and v is not None and a is not None:
            self.row.angle.values[:] = q[-1], v[-1], a[-1]
            self.set_time(self.time)

    def driven(self, t: float) -> Array:
        """Return all prescribed data at time t (s), the torque last (see `System.driven`)."""
        return np.append(super().driven(t), self.row.torque(t))

    def leave_out(self, effects: Collection[str]) -> None:
        """Switch effects off, all others on, and reset the hub to its start."""
        super().leave_out(effects)
        self.row.coupled = "hub_coupling" in self.model.effects and "hub_coupling" not in effects
        self.row.angle.start()

    # --- solutions ---------------------------------------------------------------------------------------------------

    def correction(self, shifts: tuple[float, float, float], before: Array | None = None) -> Array:
        """Return Newton's correction of (q, psi): A y = R, A z = b, dpsi = (r − c·y)/(d − c·z)."""
        row, (c_k, c_v, c_m), started = self.row, shifts, perf_counter()
        R = self.residual()
        A, changed = self.tangent(*shifts, None if before is None else before[:-1])
        b, c = self.spin_derivative(c_v, c_m), row.row(shifts)
        by_angle, by_speed = row.hub.torque.slopes(self.time, row.seen)
        r, d = -row.residual(self.time), row.diagonal(c_v, c_m) - c_k * by_angle - c_v * by_speed
        assembled_at = perf_counter()
        out = self._eliminated(self.factor(A, changed), (R, b), c, r, d)
        self.seconds["assemble"] += assembled_at - started
        self.seconds["solve"] += perf_counter() - assembled_at
        return out

    def acceleration(self) -> Array:
        """Return the correction of a with which the equations hold at the state (see `System.acceleration`)."""
        row, (solver, massless) = self.row, self.mass_solver()
        r, R, b = -row.residual(self.time), self.residual(), self.spin_derivative(0.0, 1.0)
        R.array[massless] = b.array[massless] = 0.0
        return self._eliminated(solver, (R, b), row.row((0.0, 0.0, 1.0)), r, row.diagonal(0.0, 1.0))

    def _eliminated(self, solver: Any, right: tuple[Any, Any], c: Any, r: float, d: float) -> Array:
        y, z = (self.local(solver.solve(b)) for b in right)
        n, comm = len(c.array), self.comm
        sums = np.array([c.array @ y[:n], c.array @ z[:n]])
        cy, cz = comm.allreduce(sums) if comm.size > 1 else sums
        if d == cz:
            raise ComputationError("the hub equation is singular")
        dpsi = float((r - cy) / (d - cz))
        return np.append(y - z * dpsi, dpsi)

    def imbalance(self) -> Array:
        """Return the owned part of −F at the state, and that of the hub."""
        return np.append(super().imbalance(), -self.row.residual(self.time))

    def with_hub(self, matrices: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
        """Return M, C, K of the structure with the angle of the hub as last unknown, about the state and speed set."""
        out = []
        for A, shifts in zip(matrices, ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)), strict=True):
            row, column = self.row.row(shifts).array.copy(), self.spin_derivative(*shifts[1:]).array.copy()
            out.append(bordered(A, row, column, self.row.diagonal(*shifts[1:])))
        return out[0], out[1], out[2]

    # --- what is read of a state -------------------------------------------------------------------------------------

    def increment_size(self, dq: Array) -> float:
        """Return the scaled size of a correction, that of the angle included."""
        return max(self.size(dq), abs(float(dq[-1])))

    def root_reaction(self) -> dict[str, float]:
        """Return force and moment of the hub on the structure (see `System`), in balance with the hub's equation.

        The moment about the axis is the work in a rigid turn of the displaced structure. The residual in a turn of the
        clamp differs from it by the order of the theory, or of the mesh if the theory is exact.
        """
        found = super().root_reaction()
        if not self.row.coupled:
            return found
        arms, turn = along_axis(self.root.names, self.root.place, self.motion.axis)
        values = np.array(list(found.values()))
        values = values + (self.row.work() - arms @ values) * turn
        return dict(zip(self.root.names, map(float, values), strict=True))

    def hub_work(self, new: Instant, old: Instant | None = None) -> Array:
        """Return (work, impulse, moment) at the end of a step (see `System`), by the trapezoidal rule over it.

        The impulse of a prescribed torque is exact.
        """
        moment = self._outside(new)
        if old is None or old.hub_work is None:
            return np.array([0.0, 0.0, moment])
        turn, h = new.q[-1] - old.q[-1], new.t - old.t
        speed, before, brake = 0.5 * (new.v[-1] + old.v[-1]), old.hub_work, self.row.hub.damping
        impulse = self._impulse(old, new)
        work = before[0] + impulse / h * turn - brake * speed**2 * h
        impulse += before[1] + 0.5 * (before[2] + moment) * h - brake * turn
        return np.array([work, impulse, moment])

    def _impulse(self, old: Instant, new: Instant) -> float:
        """Return ∫ M dt from one state to another, exact or, of a controller, by the trapezoidal rule, N·m·s."""
        torque, mean = self.row.hub.torque, 0.0
        if not torque.controlled:
            return float(torque.impulse(old.t, new.t))
        for state in (old, new):
            self.set_time(state.t)
            self.set_state(state.q, state.v, state.a)
            mean += 0.5 * self.row.torque(state.t)
        return float((new.t - old.t) * mean)

    def _outside(self, state: Instant) -> float:
        """Return the moment of all external forces but torque and brake at a state (N·m)."""
        if not self.row.has_outside:
            return 0.0
        self.set_time(state.t)
        self.set_state(state.q, state.v, state.a)
        return self.row.outside()


class AffineWithHub(WithHub, AffineSystem):
    """That of a linear theory."""


class NonlinearWithHub(WithHub, NonlinearSystem):
    """That of a nonlinear theory."""
