"""The free hub: its angle psi as one more unknown, driven by a torque (Yigit, Scott & Ulsoy 1988).

The hub equation is the virtual work of all inertia forces in a rigid turn δx = e×x δpsi about the axis e,

    I_R psi'' + c psi' + Σ ∫ ρ a·(e×x) − (moment of the loads) = M(t),

so it holds the angular momentum of hub and structure, exactly and for every theory. Together with F(q, …) = 0 it is
solved by block elimination, one factorisation for both right-hand sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc
from ufl.algorithms import expand_derivatives

from rotfem.equations.affine import AffineSystem
from rotfem.equations.system import System
from rotfem.mechanics.accelerations import ACCELERATIONS
from rotfem.mechanics.motion import Motion
from rotfem.numerics import compat, forms
from rotfem.scene import TorqueMotion

Array = npt.NDArray[np.float64]

#: Relative difference of two times that rounding can make.
ROUNDING = 1e-14


@dataclass(frozen=True)
class Torque:
    """M(t) about the axis, N·m, with the times at which it jumps.

    Attributes:
        scene: the motion table of the scene.
    """

    scene: TorqueMotion

    @cached_property
    def pulses(self) -> tuple[tuple[float, float, float], ...]:
        """Pulses (start, end, torque) in s, s, N·m; times that differ by a rounding only are one and the same."""
        rows, last = self.scene.pulses or (), -np.inf
        same: dict[float, float] = {}
        for t in sorted({t for start, end, _ in rows for t in (start, end)}):
            last = last if t - last <= ROUNDING * abs(t) else t
            same[t] = last
        return tuple((same[start], same[end], torque) for start, end, torque in rows)

    @property
    def jumps(self) -> tuple[float, ...]:
        """Times (s) of discontinuity."""
        return tuple(sorted({t for start, end, _ in self.pulses for t in (start, end)}))

    def at(self, t: float, after: bool = False) -> float:
        """Return M(t): the limit from the left, or from the right with `after` (they differ at a jump)."""
        if self.scene.table is not None:
            rows = np.array(self.scene.table)
            return float(np.interp(t, rows[:, 0], rows[:, 1]))
        inside = (lambda a, b: a <= t < b) if after else (lambda a, b: a < t <= b)
        return float(sum(torque for start, end, torque in self.pulses if inside(start, end)))


def border(A: Any, row: Array, column: Array, corner: float) -> Any:
    """Return [[A, column], [row, corner]] as a new PETSc matrix; the last rank holds the new row.

    Args:
        A: square PETSc matrix.
        row, column: owned parts of the vectors.
        corner: the last diagonal entry.
    """
    comm = A.comm.tompi4py()
    size, last = A.getSize()[0], comm.rank == comm.size - 1
    indptr, indices, data = A.getValuesCSR()
    ends = indptr[1:]
    data, indices = np.insert(data, ends, column), np.insert(indices, ends, size)
    indptr = indptr + np.arange(len(indptr), dtype=indptr.dtype)
    whole = np.concatenate(comm.allgather(row))
    if last:
        data = np.concatenate([data, whole, [corner]])
        indices = np.concatenate([indices, np.arange(size + 1)]).astype(indptr.dtype)
        indptr = np.append(indptr, indptr[-1] + size + 1).astype(indptr.dtype)
    local = len(row) + int(last)
    shape = ((local, size + 1), (local, size + 1))
    return PETSc.Mat().createAIJ(shape, csr=(indptr, indices.astype(indptr.dtype), data), comm=A.comm)


class Hub:
    """Compiled hub equation of a system.

    Args:
        system: equations of motion; its motion is replaced by the hub's own.
        data: motion table of the scene.
        coupled: whether the hub feels the elastic motion; otherwise it turns as if the structure were rigid.
    """

    def __init__(self, system: System, data: TorqueMotion, coupled: bool):
        self.system, self.data, self.coupled = system, data, coupled
        self.torque = Torque(data)
        self.values = np.array([0.0, data.speed, 0.0])
        psi = self.values
        old = system.motion
        system.motion = Motion(
            speed=lambda t: float(psi[1]),
            rate=lambda t: float(psi[2]),
            angle=lambda t: float(psi[0]),
            axis=old.axis,
            base_acceleration=old.base_acceleration,
            constant=False,
        )
        system.model.motion = system.motion
        self._compile()

    def _compile(self) -> None:
        model, system = self.system.model, self.system
        k, frame = system.structure.k, model.frame
        e = ufl.as_vector([float(c) for c in system.motion.axis])
        h: Any = 0
        for name in ("inertia", *model.effects):
            if name not in ACCELERATIONS:
                continue
            for body in model.bodies:
                a = ACCELERATIONS[name][0](body, k, frame)
                if a is not None:
                    h += (
                        model.switches.get(name, 1)
                        * body.density
                        * ufl.inner(a, ufl.cross(body.resolve(e), body.x))
                        * body.measure
                    )
        for load in model.applied:
            turn = load.turn(e)
            h -= ufl.inner(load.force, turn) * load.measure
        self._h = forms.form(h)
        momentum = sum(
            b.density
            * ufl.inner(ufl.cross(b.resolve(e), b.x), b.rate(k) + ufl.cross(b.resolve(frame.w), b.x))
            * b.measure
            for b in model.bodies
        )
        self._momentum = forms.form(momentum)
        s = system.structure.constant(0.0)
        spin, rate = ufl.variable(s), ufl.variable(s)
        self._dh = [self._by_spin(h, name, variable) for name, variable in (("w", spin), ("dw", rate))]
        shifts = [system.structure.constant(0.0) for _ in range(3)]
        self._shifts = shifts
        row = sum(c * ufl.derivative(h, x, k.dq) for c, x in zip(shifts, (k.q, k.v, k.a), strict=True))
        self._row = forms.form(row)
        if not isinstance(system, AffineSystem):
            F = model.residual
            self._dF = [self._by_spin(F, name, variable) for name, variable in (("w", spin), ("dw", rate))]
        self._vectors = [compat.create_vector(system.V) for _ in range(2)]

    def _by_spin(self, form: Any, name: str, s: Any) -> Any:
        """Compile ∂form/∂s where the constant w (or its rate) is w + s e; None if it is not in the form."""
        constant = self.system.model.frame.constants.get(name)
        if constant is None:
            return None
        axis = self.system.motion.axis[-constant.value.size :]
        shifted = ufl.as_vector([constant[i] + s * float(e) for i, e in enumerate(axis)])
        derivative = expand_derivatives(ufl.diff(ufl.replace(form, {constant: shifted}), s))
        return None if derivative.empty() else forms.form(derivative)

    # --- the hub equation at the state written into the system --------------------------------------------------------

    def _scalar(self, form: Any) -> float:
        return 0.0 if form is None else float(self.system.model.comm.allreduce(float(fem.assemble_scalar(form))))

    def _at_rest(self, form: Any) -> float:
        """Evaluate a form with the structure undeformed and at rest in the frame."""
        state = [x.x.array.copy() for x in (self.system.q, self.system.v, self.system.a)]
        zero = np.zeros_like(state[0])
        self.system.set_state(zero, zero, zero)
        value = self._scalar(form)
        self.system.set_state(*state)
        return value

    def residual(self, t: float, after: bool = False) -> float:
        """Return I_R psi'' + c psi' + (moment of inertia forces and loads) − M(t), N·m."""
        reaction = self._scalar(self._h) if self.coupled else self._at_rest(self._h)
        own = self.data.hub_inertia * self.values[2] + self.data.hub_damping * self.values[1]
        return float(own + reaction - self.torque.at(t, after))

    def diagonal(self, c_v: float, c_m: float) -> float:
        """Return ∂(hub residual)/∂psi_{n+1}: c_v ∂/∂psi' + c_m ∂/∂psi''."""
        value = self._scalar if self.coupled else self._at_rest
        by_speed = value(self._dh[0]) + self.data.hub_damping
        by_rate = value(self._dh[1]) + self.data.hub_inertia
        return c_v * by_speed + c_m * by_rate

    def row(self, shifts: tuple[float, float, float]) -> Any:
        """Return ∂(hub residual)/∂q_{n+1} as a PETSc vector (reused); zero if uncoupled."""
        r = self._vectors[0]
        if not self.coupled:
            r.zeroEntries()
            return r
        for constant, value in zip(self._shifts, shifts, strict=True):
            constant.value = value
        return self._assembled(self._row, r)

    def column(self, c_v: float, c_m: float) -> Any:
        """Return ∂F/∂psi_{n+1} = c_v ∂F/∂psi' + c_m ∂F/∂psi'' as a PETSc vector (reused)."""
        out = self._vectors[1]
        if isinstance(self.system, AffineSystem):
            self.system.spin_derivative(c_v, c_m, out)
        else:
            out.zeroEntries()
            for form, factor in zip(self._dF, (c_v, c_m), strict=True):
                if form is not None and factor != 0.0:
                    part = self._assembled(form, compat.create_vector(self.system.V))
                    out.axpy(factor, part)
        out.array[self.system.clamped] = 0.0
        return out

    def bordered(self, M: Any, C: Any, K: Any) -> tuple[Any, Any, Any]:
        """Return M, C, K with one more unknown, the last: the angle of the hub, about the state and speed set."""
        out = []
        for A, shifts, factors in (
            (M, (0.0, 0.0, 1.0), (0.0, 1.0)),
            (C, (0.0, 1.0, 0.0), (1.0, 0.0)),
            (K, (1.0, 0.0, 0.0), (0.0, 0.0)),
        ):
            row, column = self.row(shifts).array.copy(), self.column(*factors).array.copy()
            out.append(border(A, row, column, self.diagonal(*factors)))
        return out[0], out[1], out[2]

    def _assembled(self, form: Any, b: Any) -> Any:
        with b.localForm() as local:
            local.set(0.0)
        fem_petsc.assemble_vector(b, form)
        b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
        b.array[self.system.clamped] = 0.0
        return b

    def angular_momentum(self) -> float:
        """Return the angular momentum of hub and structure about the axis, kg·m²/s (rigid structure if uncoupled)."""
        value = self._scalar if self.coupled else self._at_rest
        return self.data.hub_inertia * float(self.values[1]) + value(self._momentum)

    def kinetic(self) -> float:
        """Return ½ I_R psi'², J."""
        return 0.5 * self.data.hub_inertia * float(self.values[1]) ** 2
