"""The system of a nonlinear theory: residual and tangent are assembled at every state, or over a whole step.

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

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, la
from ufl.algorithms import expand_derivatives

from rotfem.equations.clamp import TurningClamp
from rotfem.equations.hub import BySpin
from rotfem.equations.modal_damping import EFFECT
from rotfem.equations.system import Instant, System, per_composition
from rotfem.mechanics import work
from rotfem.mechanics.effects import INTERNAL
from rotfem.mechanics.work import Mechanics, Variation
from rotfem.numerics import compat, forms
from rotfem.numerics.forms import SAME_PATTERN, Assembler, added, assembled, weighted
from rotfem.numerics.projection import summed, times, times_transposed

Array = npt.NDArray[np.float64]


class PointStresses:
    """Stresses of their own at the integration points, for the geometric part of Newton's tangent.

    In a slender structure the stress of an iterate, C Γ(q), is far from that of the solution: a correction that rotates
    sections also stretches the axis, by half the square of the rotation, which is a large spurious force by EA. With
    the stresses as unknowns of their own (mixed integration point Newton: Magisano, Leonetti & Garcea, Int. J. Numer.
    Meth. Eng. 112 (2017) 1237) a correction d of q_k gives

        σ_{k+1} = C (Γ(q_k) + DΓ(q_k)[d]),        q_{k+1} = q_k + d.

    Eliminated point by point they do not change the residual. In the tangent ∫ σ_{k+1}·D²Γ replaces
    ∫ C Γ(q_{k+1})·D²Γ. Both agree for small d, so solution and order of convergence are the same.
    """

    def __init__(self, mechanics: Mechanics, V: fem.FunctionSpace):
        self.mechanics = mechanics
        self._q, self._v, *_ = mechanics.k.functions
        self.functions = self._before, self._step = fem.Function(V), fem.Function(V)
        self._now, self._p, self._d = (x.x.array for x in (self._q, self._before, self._step))

    def come_from(self, before: Array) -> None:
        """Set the q (local dof array) from which the last correction started."""
        self._p[:] = before
        np.subtract(self._now, self._p, out=self._d)

    def change(self, trial: Any, c_v: Any = None) -> Any:
        """Return ∫ (σ − C Γ(q))·D²Γ[trial, δq], the UFL form added to K.

        A viscous stress C η Γ̇ = C η DΓ(q)[v] is taken the same way, with DΓ(q_k)[v_{k+1}] + D²Γ(q_k)[v_k, d].
        """
        k, out, viscosity = self.mechanics.k, 0, self.mechanics.damping.stiffness
        for s in self.mechanics.strains:
            before = ufl.replace(s.value, {self._q: self._before})
            stressed = before + ufl.derivative(before, self._before, self._step) - s.value
            if viscosity is not None and c_v is not None:
                rate, moved = (ufl.derivative(before, self._before, x) for x in (self._v, self._step))
                # v_k = v_{k+1} − c_v d
                rate += ufl.derivative(rate, self._before, self._step) - c_v * ufl.derivative(
                    moved, self._before, self._step
                )
                stressed += viscosity * (rate - k.rate(s.value))
            bent = ufl.derivative(k.variation(s.value), self._q, trial)
            out += ufl.inner(s.force(stressed), bent) * s.measure
        return out


class NonlinearSystem(System):
    """Residual F and tangent J = c_k K + c_v C + c_m M of a history; at rest F(q, 0, 0), K, C and M one by one.

    Args:
        model: the terms.
        moving: see `System`.

    Attributes:
        signs: −1 of every local unknown, 0 where it is clamped.
    """

    #: The equations over the step that is being solved; None for those at an instant.
    _over: EnergyBalance | None = None

    def _compile(self) -> Assembler:
        self._shift_values = [1.0, 0.0, 1.0]
        self._shifts = [self.structure.constant(c) for c in self._shift_values]
        self._shift_entries = [constant.value for constant in self._shifts]  # where they are
        self.signs = np.full_like(self._b_array, -1.0)
        self.signs[self.clamped] = 0.0
        if self.moving:
            made = self.model.derived_forms("moving", self._made_moving, tuple(self._shifts), once=False)[1]
            self._F, self._J = [made["F"]], [made["J"]]
            self._pattern = self._J[0]
        else:
            self._F = [self._parts["f"]]
            self._pattern = self._parts["K"]
        return Assembler(self._pattern, self.bcs)

    def _made_moving(self) -> dict[str, Any]:
        """Return F and its tangent as UFL forms."""
        return {"F": self.model.residual, "J": self._tangent_form}

    @per_composition
    def _tangent_form(self) -> Any:
        du = ufl.TrialFunction(self.V)
        parts = (ufl.derivative(self.model.residual, x, du) for x in (self.q, self.v, self.a))
        return weighted(self._shifts, parts)

    # --- over a whole step -------------------------------------------------------------------------------------------

    @per_composition
    def _balance(self) -> EnergyBalance:
        return EnergyBalance(self)

    @contextmanager
    def over_step(self, start: Instant, end: float, memory: Any) -> Iterator[EnergyBalance]:
        """Take the equations over a whole step (see `System`)."""
        balance: EnergyBalance = self._balance
        balance.begin(start, end, memory)
        self._over = balance
        try:
            yield balance
        finally:
            self._over = None

    def set_state(self, q: Array, v: Array | None = None, a: Array | None = None) -> None:
        """Write a state into the functions of the forms; over a step, whose middle it is, its end too."""
        super().set_state(q, v, a)
        if self._over is not None and v is not None and a is not None:
            self._over.set_middle(q, v, a)

    def prescribe(self, t: float, q: Array, v: Array, a: Array) -> None:
        """Write the motion of the clamp at time t (s); over a step so that it is exact at its end."""
        if self._over is None or self.clamp is None:
            super().prescribe(t, q, v, a)
        else:
            self._over.prescribe(self.clamp, q, v, a)

    # --- forms -------------------------------------------------------------------------------------------------------

    @per_composition
    def _stresses(self) -> PointStresses:
        return PointStresses(self.model.mechanics, self.V)

    @per_composition
    def _on_the_way(self) -> Any:
        """Return the tangent with these stresses, compiled; of a system that is not moving K alone at v = a = 0."""
        purpose = f"on the way {self.model.theory.name} {'moving' if self.moving else 'at rest'}"
        more = *self._stresses.functions, *self._shifts
        return self.model.derived_forms(purpose, self._made_on_the_way, more, once=not self.moving)[1]["K"]

    def _made_on_the_way(self) -> dict[str, Any]:
        """Return this tangent as a UFL form."""
        trial = ufl.TrialFunction(self.V)
        if self.moving:
            change = self._stresses.change(trial, self._shifts[1] / self._shifts[0])
            return {"K": self._tangent_form + self._shifts[0] * change}
        return {"K": self._at_rest["K"] + self._stresses.change(trial)}

    @per_composition
    def _at_rest(self) -> dict[str, Any]:
        return self.model.at_rest(self.model.residual)

    def _made(self) -> dict[str, Any]:
        return {name: form for name, form in self._at_rest.items() if not form.empty()}

    @per_composition
    def _parts(self) -> dict[str, Any]:
        """F, K, C and M at v = a = 0, compiled, without those that vanish."""
        return self.model.derived_forms("at rest", self._made)[1]

    def residual(self) -> Any:
        """Return −F at the state in q, v, a as a PETSc vector (reused), zero at clamped unknowns."""
        if self._over is not None:
            return self._over.residual()
        b = self.sum_of(self._F)
        b *= self.signs
        if self.moving and self.by_mode is not None:
            owned = self.b.array
            owned -= self.by_mode.times(self._state[1][: len(owned)])
        return self.b

    def sum_of(self, parts: list[Any]) -> Array:
        """Return compiled linear forms added up, a local dof array (reused) whose owned part counts."""
        b: Array = self._b_array
        b.fill(0.0)
        for form in parts:
            forms.add_vector(b, form)
        if self.shared:
            self._b.scatter_reverse(la.InsertMode.add)
        return b

    @per_composition
    def _at_clamp(self) -> ClampWork:
        return ClampWork(self)

    def clamp_forces(self) -> Array:
        """Return this process's part of the clamp's work in its unit motions (see `System`)."""
        return self._at_clamp(self.sum_of(self._F))

    def clamp_tangents(self) -> tuple[Array, Array, Array]:
        """Return the derivatives of the forces of the clamp to q, v and a (see `System`)."""
        return self._at_clamp.tangents()

    def whole(self, kind: str) -> Any:
        """Return K, C or M at the state with the rows of the clamp, a new matrix; None where it vanishes."""
        return self.whole_of(self._terms(tuple(float(kind == name) for name in "KCM")))

    def whole_of(self, parts: list[Any]) -> Any:
        """Return compiled bilinear forms added up, a new matrix with the rows of the clamp; None of none."""
        return self.assembler(*parts) if parts else None

    def tangent(self, c_k: float, c_v: float, c_m: float, before: Array | None = None) -> tuple[Any, bool]:
        """Return (c_k K + c_v C + c_m M at the state, True); clamped rows are identity rows.

        Of a system that is not moving one factor is 1, the others are 0. With the q before the last correction its
        geometric part has the stresses of `PointStresses`.
        """
        if self._over is not None:
            return self.with_modes(self._over.tangent((c_k, c_v, c_m), before, self.A), c_v), True
        if before is None or self.plain:
            parts = self._terms((c_k, c_v, c_m))
        else:
            self._stresses.come_from(before)
            self.shift((c_k, c_v, c_m))
            parts = [self._on_the_way]
        return self.with_modes(self.assembler(*parts, diagonal=1.0, into=self.A), c_v), True

    def matrix(self, c_k: float, c_v: float, c_m: float, diagonal: float) -> Any:
        """Return a new matrix c_k K + c_v C + c_m M at the state with `diagonal` at clamped unknowns."""
        return self.with_modes(self.assembler(*self._terms((c_k, c_v, c_m)), diagonal=diagonal), c_v)

    def shift(self, shifts: tuple[float, ...]) -> None:
        """Set the factors of K, C and M in the form J."""
        if self._shift_values != [*shifts]:
            for entry, value in zip(self._shift_entries, shifts, strict=True):
                entry[()] = value
            self._shift_values[:] = shifts

    def _terms(self, shifts: tuple[float, ...]) -> list[Any]:
        """Return the compiled forms whose sum is c_k K + c_v C + c_m M."""
        if self.moving:
            self.shift(shifts)
            return self._J
        assert sorted(shifts) == [0.0, 0.0, 1.0]
        return [self._parts[name] for name, c in zip("KCM", shifts, strict=True) if c and name in self._parts]

    @per_composition
    def _by_spin(self) -> BySpin:
        return BySpin(self.model, self.model.residual)

    @per_composition
    def _spin(self) -> Any:
        """Return the column of a free hub, compiled; None if the speed is not in F."""
        by_spin, purpose = self._by_spin, f"spin {self.model.motion.axis}"

        def make() -> dict[str, Any]:
            return {} if by_spin.ufl is None else {"spin": by_spin.ufl}

        return self.model.derived_forms(purpose, make, tuple(by_spin.constants), once=False)[1].get("spin")

    def spin_derivative(self, c_v: float, c_m: float) -> Any:
        """Return c_v ∂F/∂Omega + c_m ∂F/∂Omega' at the state, a PETSc vector (reused), zero at clamped unknowns."""
        if self._spin is None:
            self._spun.zeroEntries()
            return self._spun
        self._by_spin.set(c_v, c_m)
        return assembled(self._spin, self.V, self.clamped, self._spun)


# --- at the clamp -----------------------------------------------------------------------------------------------------


class ClampWork:
    """The constraint forces of the clamp, as work in the unit motions."""

    def __init__(self, system: NonlinearSystem):
        self._system, weights = system, system.root.weights
        fixed = np.zeros((len(weights), 1), dtype=bool)
        fixed[system.clamped] = True
        self._motions: Array = weights[system.clamped]
        self._fixed, self._turns = np.where(fixed, weights, 0.0), np.where(fixed, 0.0, weights)  # those of hinges

    def __call__(self, residual: Array) -> Array:
        """Return this process's part of their work at the state set, (motions,), of F with its clamped rows."""
        system = self._system
        reaction = np.asarray(residual[system.clamped] @ self._motions) - self._damping()
        if not self._springs:
            return reaction
        forces = system.sum_of(self._springs)[: len(self._turns)]
        return np.asarray(reaction - forces @ self._turns)  # springs act against the turns of hinges

    @cached_property
    def _springs(self) -> list[Any]:
        """The work of springs and dampers of the root, compiled; empty without any."""
        terms = self._terms
        return [forms.form(added(terms), once=True)] if terms else []

    @property
    def _terms(self) -> list[Any]:
        model = self._system.model
        terms = [term for name, term in model.terms.items() if model.acting[name].at_root]
        return [term for term in terms if not expand_derivatives(term).empty()]  # of turns that are left out

    def tangents(self) -> tuple[Array, Array, Array]:
        """Return the derivatives of these forces to q, v and a about an equilibrium, (unknowns, motions) each."""
        system = self._system
        wholes = {kind: system.whole(kind) for kind in "KCM"}
        K, C, M = (self._rows_times(wholes[kind], self._fixed) for kind in "KCM")
        if self._springs:
            du, terms = ufl.TrialFunction(system.V), added(self._terms)
            for part, x in ((K, system.q), (C, system.v)):
                slope = forms.form(ufl.derivative(terms, x, du), once=True)
                part -= self._rows_times(system.whole_of([slope]), self._turns)
        return K, C - self._damping_tangent(wholes["M"]), M

    @staticmethod
    def _rows_times(A: Any, columns: Array) -> Array:
        """Return Aᵀ times columns; zero of None."""
        return np.zeros_like(columns) if A is None else times_transposed(A, columns)

    # --- forces between the hub and all of the structure ----------------------------------------------------------

    @cached_property
    def _by_mass(self) -> list[Any]:
        """The work of a0 M v, compiled; empty without."""
        model = self._system.model
        m = model.mechanics
        if EFFECT not in model.effects or m.damping.mass is None:
            return []
        alone = replace(m, damping=replace(m.damping, stiffness=None))
        return [forms.form(model.switches[EFFECT] * work.damping(alone, Variation(m.k)), once=True)]

    def _damping_tangent(self, M: Any) -> Array | float:
        """Return their derivatives to velocities, (owned unknowns, motions), of M with the rows of the clamp."""
        system, by_mode = self._system, self._system.by_mode
        mass = system.model.mechanics.damping.mass if EFFECT in system.model.effects else None
        if mass is None and by_mode is None:
            return 0.0
        rigid = system.root.carried(system.q.x.array)
        out: Array = np.zeros_like(rigid)
        if mass is not None:
            out += float(mass.value) * times(M, rigid)
        if by_mode is not None:
            out += by_mode.times(rigid)
        return out

    def _damping(self) -> Array | float:
        """Return this process's part of the work of the damping forces at the state set, (motions,); 0 without."""
        system, by_mode = self._system, self._system.by_mode
        if not self._by_mass and by_mode is None:
            return 0.0
        q, v = system.q.x.array, system.v.x.array
        owned = len(system.root.weights)
        force: Array = np.zeros(owned)
        if self._by_mass:
            force += system.sum_of(self._by_mass)[:owned]
        if by_mode is not None:
            force += by_mode.times(v[:owned])
        return np.asarray(force @ system.root.carried(q))


# --- over a whole step ------------------------------------------------------------------------------------------------


class EnergyBalance:
    """The equations of a nonlinear system over a step: their residual and tangent at the state of its functions.

    Args:
        system: the equations at an instant, whose functions hold the middle of the step.
    """

    def __init__(self, system: NonlinearSystem):
        self.system, self.model, self.comm = system, system.model, system.model.comm
        self._k = system.structure.k
        *self._functions, self._test = self._k.functions
        self._start, self._end, self._before, self._ahead, self._move = (fem.Function(system.V) for _ in range(5))
        self._shifts = [system.structure.constant(c) for c in (1.0, 0.0, 0.0)]
        more = (*self._shifts, self._start, self._end, self._before, self._ahead)
        purpose = f"energy balance {self.model.theory.name}"
        made = self.model.derived_forms(purpose, self._made, more, once=False)[1]
        self._F, self._J = made["F"], made["J"]
        self._inertia = compat.create_vector(system.V)
        self._moved = compat.wrap(self._move.x)
        self._owned = slice(0, system.V.dofmap.index_map.size_local * system.V.dofmap.index_map_bs)
        self._factor = self._due = 0.0

    # --- forms -------------------------------------------------------------------------------------------------------

    def _made(self) -> dict[str, Any]:
        return {"F": self._residual, "J": self._tangent}

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
        System.set_state(self.system, self.system.zeros())
        return self.system.matrix(0.0, 0.0, 1.0, 0.0)

    # --- a step ------------------------------------------------------------------------------------------------------

    def begin(self, start: Instant, end: float, memory: Any) -> None:
        """Set start, end (s) and what the last one left (see `finish`) of a step; the time of its middle is set."""
        n = len(self._start.x.array)
        self._q_0, self._v_0, self._t_0, self._t_1 = start.q[:n], start.v[:n], start.t, end
        self._start.x.array[:] = self._q_0
        if self.model.hub is not None:
            return
        _ = self._N
        self._due = memory or 0.0
        self._H_0 = self._H(self._q_0, self._v_0)

    def finish(self) -> float | None:
        """Return the defect of the energy's balance of the solved step (J), for the next one."""
        if self.model.hub is not None:
            return None
        work = self._work_done()
        return self._due + self._H_0 + work - self._H(self._end.x.array, 2 * self._middle[1] - self._v_0)

    def prescribe(self, clamp: TurningClamp, q: Array, v: Array, a: Array) -> None:
        """Write the motion of the clamp so that it is exact at the end of the step."""
        dofs, h = clamp.dofs, self._t_1 - self._t_0
        start, end = self._q_0[dofs], clamp.at(self._t_1)[0]
        q[dofs], v[dofs] = (start + end) / 2, (end - start) / h
        a[dofs] = (v[dofs] - self._v_0[dofs]) * 2 / h

    def set_middle(self, q: Array, v: Array, a: Array) -> None:
        """Write the end of the step whose middle is in the functions of the forms."""
        self._middle = q, v, a
        self._end.x.array[:] = 2 * q - self._q_0
        self._move.x.array[:] = 2 * (q - self._q_0)

    def _H(self, q: Array, v: Array) -> float:
        """Return the energy at a state, J; writes it."""
        System.set_state(self.system, q, v)
        return float(self.system.total(self._energy))

    def _work_done(self) -> float:
        """Return the work of the clamp and of the terms without energy over the step to the state set, J."""
        work = -self.system.total(self._work)
        if (part := self.system.by_mode) is not None:
            force = part.times(self._middle[1][self._owned])
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
            b[self._owned] += part.times(self._middle[1][self._owned])
        b *= self.system.signs
        return self.system.b

    def _balance(self, b: Array) -> None:
        """Add λ N Δq to the assembled F̄."""
        work = self._product(b, self._move.x.array) - self.system.total(self._work)
        self._N.mult(self._moved, self._inertia)
        size = self._product(self._inertia.array, self._move.x.array)
        q, v, a = self._middle
        H_1 = self._H(self._end.x.array, 2 * v - self._v_0)
        System.set_state(self.system, q, v, a)
        moved = size / (self._t_1 - self._t_0) ** 2
        due = np.clip(self._due, -1e-3 * moved, 1e-3 * moved)  # what may be made up of what steps before have left
        enough = moved > 1e-10 * max(abs(self._H_0), abs(H_1))  # in less the digits of H are lost
        self._factor = (H_1 - self._H_0 - due - work) / size if enough else 0.0
        b[self._owned] += self._factor * self._inertia.array

    def tangent(self, shifts: tuple[float, float, float], before: Array | None, into: Any) -> Any:
        """Return the tangent of the residual but for the change of λ, in a matrix; clamped rows are identity rows."""
        for constant, value in zip(self._shifts, shifts, strict=True):
            constant.value = value
        self._before.x.array[:] = self._end.x.array if before is None else 2 * before - self._q_0
        self._ahead.x.array[:] = self._end.x.array - self._before.x.array
        self.system.assembler(self._J, diagonal=1.0, into=into)
        if self._factor != 0.0:
            into.axpy(self._factor, self._N, SAME_PATTERN)
        return into
