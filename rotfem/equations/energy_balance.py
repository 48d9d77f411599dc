"""The equations of motion over a whole step, with the balance of energy exact.

A step from (q_0, v_0) to (q_1, v_1) is met at its middle, q = (q_0 + q_1)/2, q_1 − q_0 = h v, v_1 − v_0 = h a, by

    F̄(q, v, a; δq) + λ Δq·N δq = 0,    Δq = q_1 − q_0,

where F̄ is F with the mean of the stresses at both ends, ½ C (Γ(q_0) + Γ(q_1)), instead of those of the middle (Simo &
Tarnow, Z. angew. Math. Phys. 43 (1992) 757): the middle of two rotated configurations is shorter than both, which would
be a large force in a slender structure. With strains quadratic in q and constant inertia that conserves the energy. The
remainder, of third order in Δq, is corrected by a discrete gradient (Gonzalez, J. Nonlinear Sci. 6 (1996) 449): with H
the energy of the conservative terms F^c of F̄,

    λ |Δq|²_N = H(q_1, v_1) − H(q_0, v_0) − F̄^c·Δq,

so H changes by the work of all other terms and of the clamp on Δq alone. N is the mass matrix of the
undeformed structure. H is the Jacobi integral for the spin, loads and base acceleration of the middle of the step. On a
free hub, whose speed is an unknown, there is no such integral, and λ = 0.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from petsc4py import PETSc

from rotfem.equations.solutions import Solutions
from rotfem.mechanics.effects import INTERNAL
from rotfem.numerics import compat, forms
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]


class EnergyBalance(Solutions):
    """The equations of a nonlinear system over a step; attributes that it does not define are those of the system."""

    keeps_factor = False

    def __init__(self, system: Any):
        self.system, self.model, self.comm = system, system.model, system.comm
        self.seconds, self._solver, self.local = system.seconds, None, system.local
        self._k = system.structure.k
        *self._functions, self._test = self._k.functions
        self._start, self._end, self._before, self._ahead, self._move = (fem.Function(system.V) for _ in range(5))
        self._shifts = [system.structure.constant(c) for c in (1.0, 0.0, 0.0)]
        self._F, self._J = forms.form(self._residual), forms.form(self._tangent)
        self.A = system.assembler.zero()
        self._inertia = compat.create_vector(system.V)
        self._moved = compat.wrap(self._move.x)
        self._owned = slice(0, system.V.dofmap.index_map.size_local * system.V.dofmap.index_map_bs)
        self._factor = self._due = 0.0

    def __getattr__(self, name: str) -> Any:
        if name == "system":
            raise AttributeError(name)
        return getattr(self.system, name)

    # --- forms -------------------------------------------------------------------------------------------------------

    @cached_property
    def _others(self) -> Any:
        """All terms but that of the stresses."""
        return sum(term for name, term in self.model.terms.items() if name != INTERNAL.name)

    def _at(self, strain: Any, q: Any) -> Any:
        return ufl.replace(strain.value, {self._functions[0]: q})

    @property
    def _residual(self) -> Any:
        F = self._others
        for s in self.model.mechanics.strains:
            mean = (self._at(s, self._start) + self._at(s, self._end)) / 2
            F += ufl.inner(s.force(mean), self._k.variation(s.value)) * s.measure
        return F

    @property
    def _tangent(self) -> Any:
        """The derivative, with stresses that are linear in the last correction (see `PointStresses`)."""
        k, du = self._k, ufl.TrialFunction(self.system.V)
        J = sum(c * ufl.derivative(self._others, x, du) for c, x in zip(self._shifts, self._functions, strict=True))
        for s in self.model.mechanics.strains:
            change = ufl.derivative(self._at(s, self._end), self._end, du)  # twice the half of it: q_1 = 2q − q_0
            before = self._at(s, self._before)
            end = before + ufl.derivative(before, self._before, self._ahead)
            mean, varied = (self._at(s, self._start) + end) / 2, k.variation(s.value)
            J += ufl.inner(s.force(change), varied) * s.measure
            J += ufl.inner(s.force(mean), ufl.derivative(varied, self._functions[0], du)) * s.measure
        return J

    @cached_property
    def _energy(self) -> Any:
        return forms.form(self.model.energy())

    @cached_property
    def _work(self) -> Any:
        """F of the terms without energy, on Δq; None if there are none."""
        terms = self.model.terms_without_energy()
        return forms.form(ufl.replace(sum(terms), {self._test: self._move})) if terms else None

    @cached_property
    def _N(self) -> Any:
        self.system.set_state(self.system.zeros())
        return self.system.matrix(0.0, 0.0, 1.0, 0.0)

    # --- a step ------------------------------------------------------------------------------------------------------

    def begin(self, start: Any, end: float) -> None:
        """Set start state and end (s) of a step; the time of its middle is set."""
        self._q_0, self._v_0, self._t_0, self._t_1 = start.q, start.v, start.t, end
        self._start.x.array[:] = start.q
        if self.model.hub is not None:
            return
        _ = self._N
        energy, self._due = start.memory or (None, 0.0)
        self._H_0 = self._H(start.q, start.v) if energy is None or not self.model.closed else energy

    def finish(self, stage: Any) -> tuple[float, float] | None:
        """Return the energy at the end of a solved step and the defect of its balance, for the next one (J)."""
        if self.model.hub is not None:
            return None
        self.set_state(stage.q, stage.v, stage.a)
        given = self._given()
        H_1 = self._H(self._end.x.array, 2 * stage.v - self._v_0)
        return H_1, self._due + self._H_0 + given - H_1

    def prescribe(self, t: float, q: Array, v: Array, a: Array) -> None:
        """Write the motion of the clamp so that it is exact at the end of the step."""
        if self.system.clamp is None:
            return
        dofs, h = self.system.clamp.dofs, self._t_1 - self._t_0
        start, end = self._q_0[dofs], self.system.clamp.at(self._t_1)[0]
        q[dofs], v[dofs] = (start + end) / 2, (end - start) / h
        a[dofs] = (v[dofs] - self._v_0[dofs]) * 2 / h

    def set_state(self, q: Array, v: Array | None = None, a: Array | None = None) -> None:
        """Write the middle of the step, and with it its end, into the functions of the forms."""
        assert v is not None
        assert a is not None
        self._state = q, v, a
        self._end.x.array[:] = 2 * q - self._q_0
        self._move.x.array[:] = 2 * (q - self._q_0)
        self.system.set_state(q, v, a)

    def _H(self, q: Array, v: Array) -> float:
        self.system.set_state(q, v)
        return float(self.system.total(self._energy))

    def _given(self) -> float:
        """Return the work of the clamp and of the terms without energy over the step to the state set, J."""
        work = -self.system.total(self._work)
        if (part := self.system.by_mode) is not None:
            force = part.times(self._state[1][self._owned])
            work -= self._product(force, self._move.x.array[self._owned], slice(None))
        if self.system.clamp is not None:
            work += self._product(self.system.sum_of([self._F]), self._move.x.array, self.system.clamped)
        return float(work)

    def _product(self, x: Array, y: Array, chosen: Any = None) -> float:
        chosen = self._owned if chosen is None else chosen
        return float(summed(self.comm, x[chosen] @ y[chosen]))

    # --- solutions ---------------------------------------------------------------------------------------------------

    def residual(self) -> Any:
        """Return −(F̄ + λ N Δq) at the state set, zero at clamped unknowns."""
        b = self.system.sum_of([self._F])
        if self.model.hub is None:
            self._balance(b)
        if (part := self.system.by_mode) is not None:
            b[self._owned] += part.times(self._state[1][self._owned])
        b *= self.system.signs
        return self.system.b

    def _balance(self, b: Array) -> None:
        """Add λ N Δq to the assembled F̄."""
        work = self._product(b, self._move.x.array) - self.system.total(self._work)
        self._N.mult(self._moved, self._inertia)
        size = self._product(self._inertia.array, self._move.x.array)
        q, v, a = self._state
        H_1 = self._H(self._end.x.array, 2 * v - self._v_0)
        self.system.set_state(q, v, a)
        moved = size / (self._t_1 - self._t_0) ** 2
        due = np.clip(self._due, -1e-3 * moved, 1e-3 * moved)  # what may be made up of what steps before have left
        enough = moved > 1e-10 * max(abs(self._H_0), abs(H_1))  # in less the digits of H are lost
        self._factor = (H_1 - self._H_0 - due - work) / size if enough else 0.0
        b[self._owned] += self._factor * self._inertia.array

    def tangent(self, c_k: float, c_v: float, c_m: float, before: Array | None = None) -> tuple[Any, bool]:
        """Return (the tangent of the residual but for the change of λ, True); clamped rows are identity rows."""
        for constant, value in zip(self._shifts, (c_k, c_v, c_m), strict=True):
            constant.value = value
        self._before.x.array[:] = self._end.x.array if before is None else 2 * before - self._q_0
        self._ahead.x.array[:] = self._end.x.array - self._before.x.array
        self.system.assembler(self._J, diagonal=1.0, into=self.A)
        self.A.axpy(self._factor, self._N, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        return self.system.with_modes(self.A, c_v), True
