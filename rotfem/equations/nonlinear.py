"""The system of a nonlinear theory: residual and tangent are assembled at every state."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from ufl.algorithms import expand_derivatives
from ufl.algorithms.analysis import extract_constants

from rotfem.equations.clamp import ClampWork
from rotfem.equations.energy_balance import EnergyBalance
from rotfem.equations.system import System
from rotfem.mechanics.work import Mechanics
from rotfem.numerics import compat, forms
from rotfem.numerics.forms import Assembler, added, weighted

Array = npt.NDArray[np.float64]


class BySpin:
    """The column of a free hub's angle in the tangent: c_v ∂/∂Omega + c_m ∂/∂Omega' of a form.

    The speed along the axis of the motion is varied.

    Attributes:
        ufl: the derivative, a UFL form; None if the speed is not in the form.
    """

    def __init__(self, model: Any, form: Any):
        self._factors = [model.structure.constant(0.0) for _ in range(2)]
        parts, expanded = [], expand_derivatives(form)
        for name, factor in zip(("w", "dw"), self._factors, strict=True):
            constant = model.frame.constants.get(name)
            if constant is None:
                continue
            within = [part for part in expanded.integrals() if constant in extract_constants(part.integrand())]
            s = ufl.variable(model.structure.constant(0.0))
            axis = model.motion.axis[-constant.value.size :]
            shifted = ufl.as_vector([constant[i] + s * float(e) for i, e in enumerate(axis)])
            derivative = expand_derivatives(ufl.diff(ufl.replace(ufl.Form(within), {constant: shifted}), s))
            if not derivative.empty():
                parts.append(factor * derivative)
        self.ufl = added(parts) if parts else None

    def set(self, c_v: float, c_m: float) -> None:
        """Set the factors."""
        for constant, value in zip(self._factors, (c_v, c_m), strict=True):
            constant.value = value


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
        self._before, self._step = fem.Function(V), fem.Function(V)
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
        parted: whether terms with strains are compiled by themselves in a history. The rest, inertia and loads, is most
            of the compilation, and shared with other theories.

    Attributes:
        signs: −1 of every local unknown, 0 where it is clamped.
    """

    def _compile(self) -> Assembler:
        self._shift_values = [1.0, 0.0, 1.0]
        self._shifts = [self.structure.constant(c) for c in self._shift_values]
        self._shift_entries = [constant.value for constant in self._shifts]  # where they are
        self._spin: Any = None
        self.signs = np.full_like(self._b_array, -1.0)
        self.signs[self.clamped] = 0.0
        if self.moving:
            residuals = self.model.by_strains() if self.parted else [self._residual_form]
            libraries = [[F, self._tangent_of(F) if self.parted else self._tangent_form] for F in residuals]
            if self.model.hub is not None and self._by_spin.ufl is not None:
                libraries[-1].append(self._by_spin.ufl)
            once = self.parted and self.structure.planar
            compiled = [[forms.form(f, once) for f in library] for library in libraries]
            self._F, self._J = [part[0] for part in compiled], [part[1] for part in compiled]
            self._spin = compiled[-1][2] if len(compiled[-1]) > 2 else None
            self._pattern = self._J[0]
        else:
            self._F = [self._parts["f"]]
            self._pattern = self._parts["K"]
        return Assembler(self._pattern, self.bcs)

    @cached_property
    def _residual_form(self) -> Any:
        return self.model.residual

    @cached_property
    def _tangent_form(self) -> Any:
        return self._tangent_of(self._residual_form)

    def _tangent_of(self, F: Any) -> Any:
        du = ufl.TrialFunction(self.V)
        parts = (ufl.derivative(F, x, du) for x in (self.q, self.v, self.a))
        return weighted(self._shifts, parts)

    @cached_property
    def balance(self) -> EnergyBalance:
        """The equations over a whole step, with the balance of energy kept, compiled."""
        return EnergyBalance(self)

    @cached_property
    def _stresses(self) -> PointStresses:
        return PointStresses(self.model.mechanics, self.V)

    @cached_property
    def _on_the_way(self) -> Any:
        """The tangent with these stresses, compiled; of a system that is not moving K alone at v = a = 0."""
        trial = ufl.TrialFunction(self.V)
        if self.moving:
            change = self._stresses.change(trial, self._shifts[1] / self._shifts[0])
            return forms.form(self._tangent_form + self._shifts[0] * change)
        change = self._stresses.change(trial)
        return forms.form(self._at_rest["K"] + change, once=True)

    @cached_property
    def _at_rest(self) -> dict[str, Any]:
        return self.model.at_rest(self._residual_form)

    def _made(self) -> dict[str, Any]:
        return {name: form for name, form in self._at_rest.items() if not form.empty()}

    @cached_property
    def _parts(self) -> dict[str, Any]:
        """F, K, C and M at v = a = 0, compiled, without those that vanish."""
        return self.model.derived_forms("at rest", self._made)[1]

    def residual(self) -> Any:
        """Return −F at the state in q, v, a as a PETSc vector (reused), zero at clamped unknowns."""
        return self._negative(self._F, self.moving)

    def residual_in_motion(self) -> Any:
        """Return −F as `residual` does, of a system that is not moving with velocities and accelerations too."""
        return self._negative(self._F_in_motion, True)

    @cached_property
    def _F_in_motion(self) -> list[Any]:
        return self._F if self.moving else [forms.form(self._residual_form, once=True)]

    def _negative(self, parts: list[Any], moving: bool) -> Any:
        b = self.sum_of(parts)
        b *= self.signs
        if moving and self.by_mode is not None:
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

    @cached_property
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

    @cached_property
    def _by_spin(self) -> BySpin:
        return BySpin(self.model, self._residual_form)

    def spin_derivative(self, c_v: float, c_m: float) -> Any:
        """Return c_v ∂F/∂Omega + c_m ∂F/∂Omega' at the state, a PETSc vector (reused), zero at clamped unknowns."""
        if self._by_spin.ufl is None:
            self._spun.zeroEntries()
            return self._spun
        self._spin = forms.form(self._by_spin.ufl) if self._spin is None else self._spin
        self._by_spin.set(c_v, c_m)
        return assembled(self._spin, self.V, self.clamped, self._spun)


def assembled(form: Any, V: fem.FunctionSpace, clamped: Any, b: Any = None) -> Any:
    """Return a linear form as a PETSc vector (b if given, overwritten), zero at clamped unknowns."""
    b = compat.create_vector(V) if b is None else b
    with b.localForm() as local:
        local.set(0.0)
    fem_petsc.assemble_vector(b, form)
    b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
    b.array[clamped] = 0.0
    return b
