"""The equation of a free hub, whose angle psi is one more unknown (Yigit, Scott & Ulsoy 1988).

It is the virtual work of all effects in a rigid turn δx = e×x δpsi about the axis e,

    I_R psi'' + c psi' + (work in the turn) = M(t),

which is the balance of angular momentum of hub and structure, exactly and for every theory. An unbalance m ε n at x_c
pushes the structure, and takes from the drive the moment m ε e·(n×ẍ_c).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from ufl.algorithms import expand_derivatives
from ufl.algorithms.analysis import extract_constants

from rotfem.equations.model import Model
from rotfem.mechanics import work
from rotfem.numerics import compat, forms
from rotfem.numerics.forms import added, assembled, weighted
from rotfem.numerics.projection import summed
from rotfem.structures.structure import PointValues

Array = npt.NDArray[np.float64]


class BySpin:
    """The column of a free hub's angle in the tangent: c_v ∂/∂Omega + c_m ∂/∂Omega' of a form.

    The speed along the axis of the motion is varied.

    Attributes:
        constants: in it: the factors c_v and c_m, and the variation of the speed, 0.
    """

    def __init__(self, model: Model, form: Any):
        self.constants = [model.structure.constant(0.0) for _ in range(3)]
        self._model, self._form, self._entries = model, form, [c.value for c in self.constants]

    @cached_property
    def ufl(self) -> Any:
        """The derivative, a UFL form; None if the speed is not in the form."""
        model, parts, expanded = self._model, [], expand_derivatives(self._form)
        *factors, zero = self.constants
        for name, factor in zip(("w", "dw"), factors, strict=True):
            constant = model.frame.constants.get(name)
            if constant is None:
                continue
            within = [part for part in expanded.integrals() if constant in extract_constants(part.integrand())]
            s = ufl.variable(zero)
            axis = model.motion.axis[-constant.value.size :]
            shifted = ufl.as_vector([constant[i] + s * float(e) for i, e in enumerate(axis)])
            derivative = expand_derivatives(ufl.diff(ufl.replace(ufl.Form(within), {constant: shifted}), s))
            if not derivative.empty():
                parts.append(factor * derivative)
        return added(parts) if parts else None

    def set(self, c_v: float, c_m: float) -> None:
        """Set the factors."""
        self._entries[0][()], self._entries[1][()] = c_v, c_m


class HubRow:
    """The hub's equation and its derivatives at the state in the functions of a model.

    Args:
        model: the terms, with a free hub.
        clamped: numbers of the clamped unknowns.

    Attributes:
        angle: psi and its rates, and the motion of the frame that they make.
        hub: inertia, torque, brake.
        coupled: whether it feels the elastic motion; else its work is that of the undeformed structure at rest.
        has_outside: whether there are external forces.
    """

    def __init__(self, model: Model, clamped: Any):
        assert model.hub is not None
        self.model, self.angle, self.hub, self._clamped = model, model.hub, model.hub.hub, clamped
        self.coupled = "hub_coupling" in model.effects
        moments = model.work(model.turn)
        moment, shifts = added(moments.values()), [model.structure.constant(0.0) for _ in range(3)]
        self._shift_entries = [c.value for c in shifts]
        self._by_spin = BySpin(model, moment)
        *state, dq = model.structure.k.functions
        self._state = [x.x.array for x in state]

        def make() -> dict[str, Any]:
            outside = [term for name, term in moments.items() if not model.acting[name].momentum]
            wanted = {
                "moment": moment,
                "spin": self._by_spin.ufl,
                "row": weighted(shifts, (ufl.derivative(moment, x, dq) for x in state)) if self.coupled else None,
                "outside": added(outside) if outside else None,
            }
            return {name: form for name, form in wanted.items() if form is not None}

        purpose, more = f"hub {model.motion.axis} {model.effects}", (*shifts, *self._by_spin.constants)
        self._forms = model.derived_forms(purpose, make, more, once=False)[1]
        self.has_outside, self._momentum = "outside" in self._forms, None
        self._vector = compat.create_vector(model.structure.V)
        places = (np.array([u.x, 0.0, 0.0]) for u in model.reacting)
        self._unbalances = [(u, PointValues(model.structure.V, x)) for u, x in zip(model.reacting, places, strict=True)]

    def _reaction(self) -> tuple[float, Array]:
        """Return Σ m ε e·(n×ẍ_c) of unbalances, N·m, and its derivative to the owned unknowns of a."""
        t, structure, (psi, speed, rate) = self.model.time, self.model.structure, self.angle.values
        moment, by_a = 0.0, np.zeros(self._vector.getLocalSize())
        across = [structure.unknowns.index(name) for name in ("u2", "u3") if self._unbalances]
        for u, at in self._unbalances if self.coupled else ():
            if t > u.start:
                (x, v, a), sense = (complex(*at(y)[across]) for y in self._state), float(self.model.motion.axis[0])
                n = u.moment * sense * np.exp(1j * (u.phase + (sense * psi if self.model.frame.spun else 0.0)))
                if not self.model.frame.spun:
                    a += 2j * sense * speed * v + (1j * sense * rate - speed**2) * x
                moment += (n.conjugate() * a).imag
                by_a += at.columns(len(by_a))[:, across] @ [-n.imag, n.real]
        return moment, by_a

    def _value(self, form: Any) -> float:
        """Evaluate a functional; of an uncoupled hub with the structure undeformed and at rest in the frame."""
        kept = None if self.coupled else [x.copy() for x in self._state]
        if kept is not None:
            self._write([0.0] * 3)
        value = float(summed(self.model.comm, forms.functional(form)))
        if kept is not None:
            self._write(kept)
        return value

    def _write(self, values: list[Any]) -> None:
        for x, value in zip(self._state, values, strict=True):
            x[:] = value

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
        s, (psi, speed, _) = self.model.structure, self.angle.values
        tip = s.whole_values(s.tip_values(s.total(self._state[0])))
        return float(psi), float(speed), dict(zip(s.components, map(float, tip), strict=True))

    def work(self) -> float:
        """Return the work of the structure and its unbalances in the rigid turn, N·m."""
        return self._value(self._forms["moment"]) + self._reaction()[0]

    def diagonal(self, c_v: float, c_m: float) -> float:
        """Return ∂(residual)/∂psi: c_v ∂/∂psi' + c_m ∂/∂psi''."""
        own = c_v * self.hub.damping + c_m * self.hub.inertia
        if "spin" not in self._forms:
            return own
        self._by_spin.set(c_v, c_m)
        return own + self._value(self._forms["spin"])

    def rest_inertia(self) -> float:
        """Return the moment of inertia of hub and undeformed structure about the axis, kg·m²; writes that state."""
        self._write([0.0] * 3)
        return self.diagonal(0.0, 1.0)

    def row(self, shifts: tuple[float, float, float]) -> Any:
        """Return ∂(residual)/∂q as a PETSc vector (reused); zero if uncoupled."""
        if not self.coupled:
            self._vector.zeroEntries()
            return self._vector
        for entry, value in zip(self._shift_entries, shifts, strict=True):
            entry[()] = value
        out = assembled(self._forms["row"], self.model.structure.V, self._clamped, self._vector)
        if self._unbalances:
            out.array[:] += shifts[2] * self._reaction()[1]
        return out

    def outside(self) -> float:
        """Return the moment of all external forces but torque and brake (N·m)."""
        return -self._value(self._forms["outside"]) - self._reaction()[0]

    def angular_momentum(self) -> float:
        """Return the angular momentum of hub and structure about the axis, kg·m²/s (rigid structure if uncoupled)."""
        if self._momentum is None:
            self._momentum = forms.form(work.momentum(self.model.mechanics, self.model.turn))
        return self.hub.inertia * float(self.angle.values[1]) + self._value(self._momentum)

    def kinetic(self) -> float:
        """Return ½ I_R psi'², J."""
        return 0.5 * self.hub.inertia * float(self.angle.values[1]) ** 2
