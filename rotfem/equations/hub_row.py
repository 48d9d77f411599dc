"""The equation of a free hub at a state of its structure, and its derivatives (see `rotfem.equations.bordered`)."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
import ufl

from rotfem.equations.by_spin import BySpin
from rotfem.equations.nonlinear import assembled
from rotfem.equations.system import System
from rotfem.mechanics import work
from rotfem.mechanics.sums import added, weighted
from rotfem.numerics import compat, forms


class HubRow:
    """The hub's equation at the state that is written into a system, and its derivatives.

    Args:
        system: equations of motion of the structure.
        once: whether its forms are to be compiled in haste (see `rotfem.numerics.forms`).
    """

    def __init__(self, system: System, once: bool = False):
        self.system, self.model = system, system.model
        assert system.model.hub is not None
        self.angle, self.hub = system.model.hub, system.model.hub.hub
        self.coupled = "hub_coupling" in self.model.effects
        moments = self.model.work(self.model.turn)
        moment, self._shifts = added(moments.values()), [system.structure.constant(0.0) for _ in range(3)]
        self._by_spin = BySpin(self.model, moment)
        outside = [term for name, term in moments.items() if not self.model.acting[name].momentum]
        wanted = {
            "moment": moment,
            "spin": self._by_spin.ufl,
            "row": self._row_of(moment) if self.coupled else None,
            "outside": added(outside) if outside else None,
        }
        there = {name: form for name, form in wanted.items() if form is not None}
        self._forms = dict(zip(there, forms.together(list(there.values()), once), strict=True))
        self._vector = compat.create_vector(system.V)

    def of_twin(self, system: System) -> HubRow:
        """Return the same equation of the structure's twin (see `System.twin`)."""
        other = copy(self)
        other.system = system
        return other

    def _row_of(self, moment: Any) -> Any:
        """Return c_k ∂/∂q + c_v ∂/∂v + c_m ∂/∂a of the moment, a UFL form."""
        *state, dq = self.system.structure.k.functions
        parts = (ufl.derivative(moment, x, dq) for x in state)
        return weighted(self._shifts, parts)

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
        """Return M at time t (s) and the state, N·m; after a jump there if so wanted."""
        return self.hub.torque.on(t, self._seen, after)

    def impulse(self, start: float, end: float) -> float:
        """Return ∫ M dt from start to end (s), N·m·s; of a controller at the state."""
        torque = self.hub.torque
        return self.torque(end) * (end - start) if torque.controlled else torque.impulse(start, end)

    def _seen(self) -> tuple[float, float, dict[str, float]]:
        """Return psi (rad), psi' (rad/s) and the tip at the state, by the names of its components."""
        system, (psi, speed, _) = self.system, self.angle.values
        tip = system.tip(system.q.x.array, system.time)
        return float(psi), float(speed), dict(zip(system.structure.components, map(float, tip), strict=True))

    def torque_slope(self, c_k: float, c_v: float) -> float:
        """Return −∂M/∂psi c_k − ∂M/∂psi' c_v of a torque that answers to the motion; 0 of others."""
        by_angle, by_speed = self.hub.torque.slopes(self.system.time, self._seen)
        return -c_k * by_angle - c_v * by_speed

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
        """Whether there are forces that are no change of momentum."""
        return "outside" in self._forms

    def outside(self) -> float:
        """Return the moment of all forces that are no change of momentum, with torque and brake left out (N·m)."""
        return -self._value(self._forms["outside"]) if self.has_outside else 0.0

    def angular_momentum(self) -> float:
        """Return the angular momentum of hub and structure about the axis, kg·m²/s (rigid structure if uncoupled)."""
        return self.hub.inertia * float(self.angle.values[1]) + self._value(self._momentum)

    def kinetic(self) -> float:
        """Return ½ I_R psi'², J."""
        return 0.5 * self.hub.inertia * float(self.angle.values[1]) ** 2
