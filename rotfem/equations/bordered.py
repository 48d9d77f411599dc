"""A system with the angle psi of a free hub as one more unknown, the last (Yigit, Scott & Ulsoy 1988).

Its equation is the virtual work of all effects in a rigid turn δx = e×x δpsi about the axis e,

    I_R psi'' + c psi' + (work in the turn) = M(t),

which is the balance of angular momentum of hub and structure, exactly and for every theory. Together with F(q, …) = 0
it is solved by block elimination, with one factorisation for both right-hand sides.
"""

from __future__ import annotations

from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl

from rotfem.equations.nonlinear import BySpin, assembled
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.mechanics import work
from rotfem.numerics import compat, forms
from rotfem.numerics.forms import added, weighted
from rotfem.numerics.projection import bordered
from rotfem.structures.root_reaction import along_axis


class HubRow:
    """The hub's equation and its derivatives at the state of a system.

    Args:
        system: equations of motion of the structure.
        once: whether its forms are compiled without optimisation (see `rotfem.numerics.forms`).
    """

    def __init__(self, system: System, once: bool = False):
        self.system, self.model = system, system.model
        assert system.model.hub is not None
        self.angle, self.hub = system.model.hub, system.model.hub.hub
        self.coupled = "hub_coupling" in self.model.effects
        moments = self.model.work(self.model.turn)
        moment, self._shifts = added(moments.values()), [system.structure.constant(0.0) for _ in range(3)]
        self._by_spin = BySpin(self.model, moment)
        *state, dq = system.structure.k.functions
        by_state = (ufl.derivative(moment, x, dq) for x in state)
        outside = [term for name, term in moments.items() if not self.model.acting[name].momentum]
        wanted = {
            "moment": moment,
            "spin": self._by_spin.ufl,
            "row": weighted(self._shifts, by_state) if self.coupled else None,
            "outside": added(outside) if outside else None,
        }
        there = {name: form for name, form in wanted.items() if form is not None}
        self._forms = {name: forms.form(f, once) for name, f in there.items()}
        self._vector = compat.create_vector(system.V)

    @cached_property
    def _momentum(self) -> Any:
        return forms.form(work.momentum(self.model.mechanics, self.model.turn))

    def _value(self, form: Any) -> float:
        """Evaluate a functional; of an uncoupled hub with the structure undeformed and at rest in the frame."""
        system = self.system
        if self.coupled:
            return system.total(form)
        state = [x.x.array.copy() for x in (system.q, system.v, system.a)]
        system.set_state(np.zeros_like(state[0]))
        value = system.total(form)
        system.set_state(*state)
        return value

    def residual(self, t: float) -> float:
        """Return I_R psi'' + c psi' + (work in the turn) − M(t), N·m."""
        _, speed, rate = self.angle.values
        own = self.hub.inertia * rate + self.hub.damping * speed
        return float(own + self.work() - self.torque(t))

    def torque(self, t: float, after: bool = False) -> float:
        """Return M at time t (s) and the state, N·m; after a jump there if wanted."""
        return self.hub.torque.on(t, self.seen, after)

    def seen(self) -> tuple[float, float, dict[str, float]]:
        """Return psi (rad), psi' (rad/s) and the unknowns at the tip by name: the arguments of a controller."""
        system, (psi, speed, _) = self.system, self.angle.values
        tip = system.tip(system.q.x.array, system.time)
        return float(psi), float(speed), dict(zip(system.structure.components, map(float, tip), strict=True))

    def work(self) -> float:
        """Return the work of the structure in the rigid turn, N·m."""
        return self._value(self._forms["moment"])

    def diagonal(self, c_v: float, c_m: float) -> float:
        """Return ∂(residual)/∂psi: c_v ∂/∂psi' + c_m ∂/∂psi''."""
        own = c_v * self.hub.damping + c_m * self.hub.inertia
        if "spin" not in self._forms:
            return own
        self._by_spin.set(c_v, c_m)
        return own + self._value(self._forms["spin"])

    def rest_inertia(self) -> float:
        """Return the moment of inertia of hub and undeformed structure about the axis, kg·m²; writes that state."""
        self.system.set_state(self.system.zeros())
        return self.diagonal(0.0, 1.0)

    def row(self, shifts: tuple[float, float, float]) -> Any:
        """Return ∂(residual)/∂q as a PETSc vector (reused); zero if uncoupled."""
        if not self.coupled:
            self._vector.zeroEntries()
            return self._vector
        for constant, value in zip(self._shifts, shifts, strict=True):
            constant.value = value
        return assembled(self._forms["row"], self.system.V, self.system.clamped, self._vector)

    @property
    def has_outside(self) -> bool:
        """Whether there are external forces."""
        return "outside" in self._forms

    def outside(self) -> float:
        """Return the moment of all external forces but torque and brake (N·m)."""
        return -self._value(self._forms["outside"]) if self.has_outside else 0.0

    def angular_momentum(self) -> float:
        """Return the angular momentum of hub and structure about the axis, kg·m²/s (rigid structure if uncoupled)."""
        return self.hub.inertia * float(self.angle.values[1]) + self._value(self._momentum)

    def kinetic(self) -> float:
        """Return ½ I_R psi'², J."""
        return 0.5 * self.hub.inertia * float(self.angle.values[1]) ** 2


Array = npt.NDArray[np.float64]


class BorderedSystem:
    """A system of a structure, bordered by the angle of its hub; unknowns are those of the structure, then psi.

    Attributes that it does not define are those of the structure's system.

    Args:
        inner: equations of motion of the structure, its model with a free hub.
        once: whether the forms of the hub's equation are compiled without optimisation.
    """

    solved_at_once = False
    keeps_factor = False  # the border changes with the speed
    clamp = None

    def __init__(self, inner: System, once: bool = False):
        self.inner, self._once = inner, once
        self._row = inner.compilations, HubRow(inner, once)
        self.angle = self.row.angle
        self.hub = self.row.hub

    def __getattr__(self, name: str) -> Any:
        if name == "inner":
            raise AttributeError(name)
        return getattr(self.inner, name)

    @property
    def row(self) -> HubRow:
        """The hub's equation, compiled again where the structure's were."""
        if self._row[0] != self.inner.compilations:
            coupled = self._row[1].coupled
            self._row = self.inner.compilations, HubRow(self.inner, self._once)
            self._row[1].coupled = coupled
        return self._row[1]

    # --- state -------------------------------------------------------------------------------------------------------

    @property
    def held(self) -> System:
        """The system of the structure alone, with the hub fixed."""
        return self.inner

    def zeros(self) -> Array:
        """Return unknowns that are all zero."""
        return np.append(self.inner.zeros(), 0.0)

    def start(self, q: Array) -> tuple[Array, Array]:
        """Return (q, v) of a structure at rest in the frame, with angle and speed that the hub starts with."""
        self.angle.start()
        psi, speed, _ = self.angle.values
        return np.append(q, psi), np.append(np.zeros_like(q), speed)

    def set_state(self, q: Array, v: Array | None = None, a: Array | None = None) -> None:
        """Write unknowns and their rates, and with them the speed of the frame; without rates that is left as it is."""
        if v is None or a is None:
            self.inner.set_state(q[: len(self.inner.q.x.array)])
            return
        self.angle.values[:] = q[-1], v[-1], a[-1]
        self.inner.set_state(q[:-1], v[:-1], a[:-1])
        self.inner.set_time(self.inner.time)

    def driven(self, t: float) -> Array:
        """Return all prescribed data at time t (s), the torque last (see `System.driven`)."""
        return np.append(self.inner.driven(t), self.row.torque(t))

    def leave_out(self, effects: Any) -> None:
        """Switch effects off, all others on, and reset the hub to its start."""
        self.inner.leave_out(effects)
        self.row.coupled = "hub_coupling" in self.inner.model.effects and "hub_coupling" not in effects
        self.angle.start()

    @property
    def balance(self) -> OverStep:
        """The equations over a whole step."""
        return OverStep(self)

    # --- solutions ---------------------------------------------------------------------------------------------------

    def correction(self, shifts: tuple[float, float, float], before: Array | None = None) -> Array:
        """Return Newton's correction of (q, psi): A y = R, A z = b, dpsi = (r − c·y)/(d − c·z)."""
        s, row, (c_k, c_v, c_m) = self.inner, self.row, shifts
        started = perf_counter()
        R = s.residual()
        A, changed = s.tangent(*shifts, None if before is None else before[:-1])
        b, c = s.spin_derivative(c_v, c_m), row.row(shifts)
        by_angle, by_speed = self.hub.torque.slopes(s.time, row.seen)
        r, d = -row.residual(s.time), row.diagonal(c_v, c_m) - c_k * by_angle - c_v * by_speed
        assembled_at = perf_counter()
        out = self._eliminated(s.factor(A, changed), (R, b), c, r, d)
        s.seconds["assemble"] += assembled_at - started
        s.seconds["solve"] += perf_counter() - assembled_at
        return out

    def acceleration(self, at_rest: bool = False) -> Array:
        """Return the correction of a with which the equations hold at the state (see `Solutions.acceleration`)."""
        s, row = self.inner, self.row
        solver, massless = s.mass_solver(at_rest)
        r, R, b = -row.residual(s.time), s.residual(), s.spin_derivative(0.0, 1.0)
        R.array[massless] = b.array[massless] = 0.0
        return self._eliminated(solver, (R, b), row.row((0.0, 0.0, 1.0)), r, row.diagonal(0.0, 1.0))

    def _eliminated(self, solver: Any, right: tuple[Any, Any], c: Any, r: float, d: float) -> Array:
        y, z = (self.inner.local(solver.solve(b)) for b in right)
        n, comm = len(c.array), self.inner.comm
        sums = np.array([c.array @ y[:n], c.array @ z[:n]])
        cy, cz = comm.allreduce(sums) if comm.size > 1 else sums
        if d == cz:
            raise ComputationError("the hub equation is singular")
        dpsi = float((r - cy) / (d - cz))
        return np.append(y - z * dpsi, dpsi)

    def imbalance(self) -> Array:
        """Return the owned part of −F at the state, and that of the hub."""
        return np.append(self.inner.imbalance(), -self.row.residual(self.inner.time))

    def local(self, x: Array) -> Array:
        """Return the local dof array of an owned one, the angle last, which the last process has."""
        comm, n = self.inner.comm, len(self.inner.root.weights)
        return np.append(self.inner.local(x[:n]), comm.bcast(x[n:], comm.size - 1) if comm.size > 1 else x[n:])

    def with_hub(self, matrices: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
        """Return M, C, K of the structure with the angle of the hub as last unknown, about the state and speed set."""
        out = []
        for A, shifts in zip(matrices, ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)), strict=True):
            row, column = self.row.row(shifts).array.copy(), self.inner.spin_derivative(*shifts[1:]).array.copy()
            out.append(bordered(A, row, column, self.row.diagonal(*shifts[1:])))
        return out[0], out[1], out[2]

    # --- what is read of a state -------------------------------------------------------------------------------------

    def increment_size(self, dq: Array) -> float:
        """Return the scaled size of a correction, that of the angle included."""
        return max(self.inner.size(dq), abs(float(dq[-1])))

    def root_reaction(self) -> dict[str, float]:
        """Return force and moment of the hub on the structure (see `System`), in balance with the hub's equation.

        The moment about the axis is the work in a rigid turn of the displaced structure. The residual in a turn of the
        clamp differs from it by the order of the theory, or of the mesh if the theory is exact.
        """
        found = self.inner.root_reaction()
        if not self.row.coupled:
            return found
        root = self.inner.root
        arms, turn = along_axis(root.names, root.place, self.inner.motion.axis)
        values = np.array(list(found.values()))
        return dict(zip(root.names, map(float, values + (self.row.work() - arms @ values) * turn), strict=True))

    def given(self, new: Any, old: Any = None) -> Array:
        """Return (work, impulse, moment) at the end of a step, by the trapezoidal rule over it, or of a first state.

        The impulse of a prescribed torque is exact.

        Work (J) is that of torque and brake; the angular impulse (N·m·s) has the moment (N·m) of all forces from
        outside in it too, which is kept for the next step.
        """
        if old is None:
            return np.array([0.0, 0.0, self.moment(new)])
        turn, h = new.q[-1] - old.q[-1], new.t - old.t
        speed, before = 0.5 * (new.v[-1] + old.v[-1]), old.given
        impulse = self._impulse(old, new)
        brake, moment = self.hub.damping, self.moment(new)
        work_done = before[0] + impulse / h * turn - brake * speed**2 * h
        impulse += before[1] + 0.5 * (before[2] + moment) * h - brake * turn
        return np.array([work_done, impulse, moment])

    def _impulse(self, old: Any, new: Any) -> float:
        """Return ∫ M dt from one state to another, exact or, of a controller, by the trapezoidal rule, N·m·s."""
        torque, mean = self.hub.torque, 0.0
        if not torque.controlled:
            return float(torque.impulse(old.t, new.t))
        for state in (old, new):
            self.set_time(state.t)
            self.set_state(state.q, state.v, state.a)
            mean += 0.5 * self.row.torque(state.t)
        return float((new.t - old.t) * mean)

    def moment(self, state: Any) -> float:
        """Return the moment of all external forces but torque and brake at a state (N·m)."""
        if not self.row.has_outside:
            return 0.0
        self.set_time(state.t)
        self.set_state(state.q, state.v, state.a)
        return self.row.outside()


class OverStep(BorderedSystem):
    """A bordered system of the equations over a whole step (see `EnergyBalance`)."""

    inner: Any

    def __init__(self, whole: BorderedSystem):
        _ = whole.row  # of the forms that are now
        vars(self).update(vars(whole))
        self.inner = whole.inner.balance

    def begin(self, start: Any, end: float) -> None:
        """Set start state and end (s) of a step; the time of its middle is set."""
        self.inner.begin(start.changed(q=start.q[:-1], v=start.v[:-1]), end)

    def finish(self, stage: Any) -> None:
        """Return the memory for the next step: none."""
