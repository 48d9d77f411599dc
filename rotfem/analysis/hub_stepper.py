"""Steps of structure and free hub together."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

from rotfem.analysis.stepper import Array, Scheme, State, Stepper
from rotfem.equations.hub import Hub
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.numerics.linear import Increment
from rotfem.numerics.newton import Newton


class HubStepper(Stepper):
    """Advances structure and hub together; psi follows the same scheme as q.

    Args:
        system: equations of motion.
        hub: hub equation of the system.
        scheme: parameters.
        newton: iteration control.
    """

    def __init__(self, system: System, hub: Hub, scheme: Scheme, newton: Newton):
        super().__init__(system, scheme, newton)
        self.hub = hub
        self._keeps = False  # the border changes with the speed
        self._dz = Increment(system.V)

    def start(self, t: float, q: Array, v: Array) -> State:
        """Return the state at t with the accelerations of structure and hub that balance (torque after a jump)."""
        s, hub = self.system, self.hub
        hub.values[2] = 0.0
        s.set_time(t)
        zero = np.zeros_like(q)
        s.set_state(q, v, zero)
        solver, massless = self._mass_solver()
        R, b = s.residual(), hub.column(0.0, 1.0)
        R.array[massless] = 0.0
        b.array[massless] = 0.0
        y = self._dx.solve(solver, R).copy()
        z = self._dz.solve(solver, b)
        c = hub.row((0.0, 0.0, 1.0))
        psi = self._eliminate(-hub.residual(t, after=True), hub.diagonal(0.0, 1.0), c, y, z)
        hub.values[2] = psi
        a = y - z * psi
        values = np.array([hub.values[0], hub.values[1], psi, psi, 0.0, 0.0])
        return State(t, q.copy(), v.copy(), a, a.copy(), values)

    def restart(self, state: State) -> State:
        """Return a state with the accelerations that hold after a jump of the torque."""
        assert state.hub is not None
        self.hub.values[:2] = state.hub[:2]
        new = self.start(state.t, state.q, state.v)
        assert new.hub is not None
        new.hub[4:] = state.hub[4:]
        return new

    def step(self, state: State, h: float, end: float | None = None) -> State:
        """Return the state at state.t + h (see `Stepper.step`)."""
        new = super().step(state, h, end)
        assert new.hub is not None and state.hub is not None
        turn, speed = new.hub[0] - state.hub[0], 0.5 * (new.hub[1] + state.hub[1])
        mean = 0.5 * (self.hub.torque.at(state.t, after=True) + self.hub.torque.at(new.t))
        brake = self.hub.data.hub_damping
        new.hub[4] = state.hub[4] + mean * turn - brake * speed**2 * h
        new.hub[5] = state.hub[5] + mean * h - brake * turn
        return new

    def _predict(self, state: State, h: float, end: float) -> State:
        p = self.scheme
        new = super()._predict(state, h, end)
        assert state.hub is not None
        psi, speed, rate, old = state.hub[:4]
        auxiliary = (rate - p.alpha_m * old) / (1 - p.alpha_m)
        angle = psi + h * speed + h * h * ((0.5 - p.beta) * old + p.beta * auxiliary)
        ahead = speed + h * ((1 - p.gamma) * old + p.gamma * auxiliary)
        new.hub = np.array([angle, ahead, rate, auxiliary, *state.hub[4:]])
        self.hub.values[:] = new.hub[:3]
        return new

    def _correction(self, new: State, shifts: tuple[float, float, float], h: float) -> Array:
        """Return the correction of q and apply that of psi: A y = R, A z = b, dpsi = (r − c·y)/(d − c·z)."""
        s, hub, (_, c_v, c_m) = self.system, self.hub, shifts
        assert new.hub is not None
        started = perf_counter()
        hub.values[:] = new.hub[:3]
        s.set_time(new.t)
        R = s.residual()
        A, changed = s.tangent(*shifts)
        b, c = hub.column(c_v, c_m), hub.row(shifts)
        r, d = -hub.residual(new.t), hub.diagonal(c_v, c_m)
        assembled = perf_counter()
        self._factor(A, changed)
        assert self._solver is not None
        y = self._dx.solve(self._solver, R)
        z = self._dz.solve(self._solver, b)
        dpsi = self._eliminate(r, d, c, y, z)
        self.seconds["assemble"] += assembled - started
        self.seconds["solve"] += perf_counter() - assembled
        new.hub[:4] += dpsi * np.array([1.0, c_v, c_m, 1 / (self.scheme.beta * h * h)])
        hub.values[:] = new.hub[:3]
        self._hub_increment = abs(dpsi)
        return y - z * dpsi

    def _eliminate(self, r: float, d: float, c: Any, y: Array, z: Array) -> float:
        row = c.array
        sums = np.array([row @ y[: len(row)], row @ z[: len(row)]])
        cy, cz = self.system.model.comm.allreduce(sums) if self.system.model.comm.size > 1 else sums
        if d == cz:
            raise ComputationError("the hub equation is singular")
        return float((r - cy) / (d - cz))
