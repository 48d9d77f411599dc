"""Derivatives dλ/dp of eigenvalues to section properties, hub radius, tip mass and speed, by the adjoint formula.

With Q(λ; q̄, p) = λ² M + λ C + K about the equilibrium R(q̄, p) = 0,

    dλ/dp = − [ y^H Q_p x − z^T R_p ] / [ y^H (2λ M + C) x ],     K_R^T z = ∂(y^H Q x)/∂q̄ ,

(Adhikari & Friswell 2001 for the first term; the second carries the dependence of the equilibrium on p). All
derivatives are `ufl.derivative` and `ufl.diff` of the residual.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from ufl.algorithms import expand_derivatives

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.equations.modal_damping import KEY
from rotfem.equations.nonlinear import assembled
from rotfem.errors import InputError
from rotfem.numerics import compat, forms
from rotfem.numerics.linear import DirectSolver, transposed

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Parameter:
    """A quantity of the scene: its constant (or field) in the forms, and what a relative change multiplies.

    Attributes:
        name: "EI", "hub_radius", "speed", …
        symbol: the UFL constant, component or field that is replaced.
        value: its value; a tapered property counts as 1 and its derivative is that of a common factor.
    """

    name: str
    symbol: Any
    value: float


class Sensitivity:
    """Derivatives of eigenvalues at one spinning state.

    Args:
        analysis: compiled scene.
        spinning: equilibrium and eigenpairs.
    """

    def __init__(self, analysis: ModalAnalysis, spinning: Spinning):
        self.analysis, self.spinning = analysis, spinning
        self.system, self.model = analysis.system, analysis.model
        self.structure, self.V = analysis.structure, analysis.system.V
        k = self.structure.k
        self.base = k.q
        self.vectors = {name: fem.Function(self.V) for name in "yx"}
        self.factors = {name: self.structure.constant(0.0) for name in "KCM"}
        if self.system.linear:
            self._prepare_linear(self.system)
        else:
            self.equation = self.model.residual
            self.pencil_form = self.model.residual
            self.base_state = spinning.q
        self.s = self._bilinear()
        self._stiffness: Any = None

    def _prepare_linear(self, system: Any) -> None:
        """Write the linear theory as a residual: its base state q̄ is the linear response that carries N⁰."""
        k, model = self.structure.k, self.model
        internal = model.terms["internal"]
        loads = sum(t for name, t in model.terms.items() if name not in ("internal", "damping"))
        # f(p) is the residual of the undeformed structure; K q̄ = −f defines N⁰.
        self.equation = internal + (forms.without(loads, k.q, k.v, k.a) if not isinstance(loads, int) else 0)
        self.pencil_form = model.residual
        self.base_state = self._static(system)

    def _static(self, system: Any) -> Array:
        zero = np.zeros_like(self.spinning.q)
        system.set_time(0.0, system.motion.at_speed(self.spinning.speed))
        system.set_state(zero)
        if not system.model.theory.prestress:
            return zero
        solution = fem.Function(self.V)
        x = compat.wrap(solution.x)
        b = system.residual().copy()
        DirectSolver(system.material).solve(b, x)
        solution.x.scatter_forward()
        static: Array = solution.x.array.copy()
        return static

    # --- the forms ---------------------------------------------------------------------------------------------------

    def _operators(self) -> dict[str, Any]:
        """Return K, C, M as functions (u, w) ↦ form, at the base state in k.q."""
        k = self.structure.k
        F = self.pencil_form

        def tangent(variable: Any) -> Any:
            return lambda u, w: ufl.replace(ufl.derivative(F, variable, w), {k.dq: u})

        if not self.system.linear:
            return {"K": tangent(k.q), "C": tangent(k.v), "M": tangent(k.a)}

        # Linear theory: tangents at the undeformed state, and the geometric stiffness of the base state.
        def at_rest(variable: Any) -> Any:
            def form(u: Any, w: Any) -> Any:
                return ufl.replace(forms.without(ufl.derivative(F, variable, w), k.q, k.v, k.a), {k.dq: u})

            return form

        def stiffness(u: Any, w: Any) -> Any:
            return at_rest(k.q)(u, w) + self.system.geometric(u, w, self.base)

        return {"K": stiffness, "C": at_rest(k.v), "M": at_rest(k.a)}

    def _bilinear(self) -> Any:
        """Return y·(k K + c C + m M) x as a form of real vectors, the base state and the constants k, c, m.

        y^H Q(λ) x is a sum of these, see `_combinations`: so each form is differentiated once, not in four variants.
        """
        y, x = self.vectors["y"], self.vectors["x"]
        return sum(self.factors[name] * form(y, x) for name, form in self._operators().items())

    def _combinations(self, j: int) -> Iterator[complex]:
        """Write the real products that y^H Q(λ) x consists of into vectors and factors; yield what multiplies each.

        y^H A x = (y_r·A x_r + y_i·A x_i) + i (y_r·A x_i − y_i·A x_r), with A = Re Q and i Im Q in turn.
        """
        pairs = self.spinning.pairs
        lam, x, y = pairs.values[j], pairs.right[:, j], pairs.left[:, j]
        powers = {"K": 1.0 + 0.0j, "C": complex(lam), "M": complex(lam * lam)}
        products = ((y.real, x.real, 1), (y.imag, x.imag, 1), (y.real, x.imag, 1j), (y.imag, x.real, -1j))
        for y_part, x_part, unit in products:
            for name, part in (("y", y_part), ("x", x_part)):
                f = self.vectors[name]
                f.x.array[: len(part)] = part
                f.x.scatter_forward()
            for imaginary in (False, True):
                for name, power in powers.items():
                    self.factors[name].value = power.imag if imaginary else power.real
                yield unit * (1j if imaginary else 1)

    # --- parameters ------------------------------------------------------------------------------------------------

    def parameters(self) -> list[Parameter]:
        """Return the parameters of the scene that its forms contain."""
        out = []
        for name, symbol in self.structure.section.items():
            value = float(symbol.value) if isinstance(symbol, fem.Constant) else 1.0
            out.append(Parameter(name, symbol, value))
        for name, symbol in self.structure.scalars.items():
            out.append(Parameter(name, symbol, float(symbol.value)))
        if "w" in self.model.frame.constants:
            out.append(Parameter("speed", self.model.frame.constants["w"], self.spinning.speed))
        return out

    def _shifted(self, form: Any, parameter: Parameter, s: Any) -> Any:
        """Return the form with the parameter p replaced by p (1 + s) (a speed by w + s e, a zero value by s)."""
        symbol = parameter.symbol
        if parameter.name == "speed":
            axis = self.system.motion.axis[-symbol.value.size :]
            return ufl.replace(form, {symbol: ufl.as_vector([symbol[i] + s * float(e) for i, e in enumerate(axis)])})
        if parameter.value == 0.0:
            return ufl.replace(form, {symbol: symbol + s})
        return ufl.replace(form, {symbol: symbol * (1 + s)})

    def of(self, modes: range) -> list[dict[str, complex]]:
        """Return name ↦ dλ/dp for every mode (per unit of p; of a tapered property, per unit factor)."""
        parameters = self.parameters()
        s = self.structure.constant(0.0)
        variable = ufl.variable(s)
        equations, pencils = {}, {}
        for p in parameters:
            equations[p.name] = self._compiled_diff(self.equation, p, variable)
            pencils[p.name] = self._compiled_diff(self.s, p, variable)
        gradient = forms.form(ufl.derivative(self.s, self.base))
        system = self.system
        system.set_time(0.0, system.motion.at_speed(self.spinning.speed))
        solver = DirectSolver(self._base_tangent())
        out = []
        for j in modes:
            system.set_state(self.base_state)
            direct = dict.fromkeys(pencils, 0j)
            force = np.zeros(len(self._vector(gradient).array), dtype=complex)
            for factor in self._combinations(j):
                force += factor * self._vector(gradient).array
                for name, form in pencils.items():
                    direct[name] += factor * self._scalar(form) if form is not None else 0.0
            z = self._adjoint(force.real, solver) + 1j * self._adjoint(force.imag, solver)
            denominator = self._denominator(j)
            row = {}
            for p in parameters:
                if equations[p.name] is not None:
                    direct[p.name] -= self._dot(z, self._vector(equations[p.name]).array)
                unit = 1.0 if p.name == "speed" or p.value == 0.0 else p.value
                row[p.name] = -direct[p.name] / denominator / unit
            out.append(row)
        return out

    def _compiled_diff(self, form: Any, parameter: Parameter, variable: Any) -> Any:
        derivative = expand_derivatives(ufl.diff(self._shifted(form, parameter, variable), variable))
        return None if derivative.empty() else forms.form(derivative)

    def _base_tangent(self) -> Any:
        """Return K_Rᵀ of the base equation, clamped rows 1."""
        system = self.system
        if system.linear:
            return system.material
        system.set_state(self.base_state)
        return transposed(system.matrix(1.0, 0.0, 0.0, 1.0))

    def _denominator(self, j: int) -> complex:
        """Return y^H (2λ M + C) x of one pair."""
        pairs = self.spinning.pairs.select(np.array([j]))
        return complex(self.spinning.pencil.gram(pairs.left, pairs.values, pairs.right, pairs.values)[0, 0])

    def _scalar(self, form: Any) -> float:
        return float(self.analysis.comm.allreduce(fem.assemble_scalar(form)))

    def _vector(self, form: Any) -> Any:
        return assembled(form, self.V, self.system.clamped)

    def _adjoint(self, force: Array, solver: DirectSolver) -> Array:
        b = compat.create_vector(self.V)
        b.array[:] = force
        z = b.duplicate()
        solver.solve(b, z)
        return np.asarray(z.array.copy())

    def _dot(self, z: Array, r: Array) -> complex:
        return complex(self.analysis.comm.allreduce(complex(np.dot(z, r))))


def sensitivities(analysis: ModalAnalysis, spinning: Spinning) -> list[dict[str, Any]]:
    """Return one row a mode and parameter: dω/dp, dσ/dp (λ = σ + iω) and the relative p/ω dω/dp.

    Rows hold `mode` (from 1), `parameter`, `value`, `dfrequency` (rad/s per unit), `dgrowth` (1/s per unit) and
    `relative`.

    Raises:
        InputError: the hub is free, or damping is by mode.
    """
    analysis.needs_fixed_hub("sensitivities")
    if analysis.system.by_mode is not None:
        damping = analysis.problem.structure.damping.modal
        raise InputError(KEY, damping, "sensitivities need damping whose derivatives are known; leave it out for them")
    study = Sensitivity(analysis, spinning)
    values = {p.name: p.value for p in study.parameters()}
    rows = []
    for j, row in enumerate(study.of(range(len(spinning.pairs.values)))):
        omega = float(spinning.pairs.values[j].imag)
        for name, derivative in row.items():
            rows.append(
                {
                    "mode": j + 1,
                    "parameter": name,
                    "value": values[name],
                    "dfrequency": derivative.imag,
                    "dgrowth": derivative.real,
                    "relative": values[name] * derivative.imag / omega if omega > 0 else 0.0,
                }
            )
    return rows
