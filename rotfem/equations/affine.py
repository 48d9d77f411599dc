"""Linear theories: M a + C(t) v + K(t) q + f(t) = 0 with operators affine in (1, Omega, Omega², dOmega/dt, a_o, loads).

The pieces are the derivatives of the residual at the undeformed state, assembled once; a new speed costs matrix sums.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from ufl.algorithms import expand_derivatives

from rotfem.equations.model import integral_count
from rotfem.equations.system import System
from rotfem.mechanics.accelerations import ACCELERATIONS
from rotfem.mechanics.motion import Motion
from rotfem.numerics import compat, forms
from rotfem.numerics.linear import DirectSolver, combine

Array = npt.NDArray[np.float64]

#: A piece belongs to the product of these entries (constant name, component): () is 1, (("w", 0), ("w", 0)) is Omega².
Key = tuple[tuple[str, int], ...]

#: What the pieces of the geometric stiffness are marked with; without them a prestressed theory is the linear one.
PRESTRESS = "prestress"

ONE = np.ones(1)


@dataclass
class Piece:
    """One operator (PETSc matrix, or vector for "f"), the constants whose product multiplies it, and its term.

    A term's name may say which body it is of, and that it is geometric stiffness: "centrifugal@tip_mass@prestress".
    """

    kind: str
    key: Key
    operator: Any
    term: str


class AffineSystem(System):
    """System of a linear theory, about the undeformed state.

    With a prestressed theory the stiffness gains ∫ N⁰ D²Γ₁[δq, q] where N⁰ is the axial force of the linear structure
    under each load piece (centrifugal, base, gravity, applied) and Γ₁ the axial strain of the theory's second order:
    Simo & Vu-Quoc 1986 eqs. (12), (23) as corrected in docs/theory.md.
    """

    linear = True

    def _compile(self) -> None:
        model, du = self.model, ufl.TrialFunction(self.V)
        F = model.residual
        union = sum(ufl.derivative(F, x, du) for x in (self.q, self.v, self.a))
        self.integrals = {"F": integral_count(F), "J": 0}
        pattern = forms.form(union)
        self.A = fem_petsc.create_matrix(pattern)
        fem_petsc.assemble_matrix(self.A, pattern, self.bcs)
        self.A.assemble()
        self._zero_constants()
        self.pieces: list[Piece] = []
        for name, term in model.terms.items():
            self._decompose(name, term, du)
        if model.theory.prestressed is not None:
            self._prestress(du)
        self._operators = {kind: self.A.duplicate() for kind in "MCK"}
        self._load = compat.create_vector(self.V)
        self._work = compat.create_vector(self.V)
        self._qva = [compat.wrap(x.x) for x in (self.q, self.v, self.a)]
        self._rest_inertia: float | None = None
        self._weights: Array = np.ones(len(self.pieces))
        self._factors = self._factor_indices()
        self._all_constants = list(self._constants().values())
        chosen = {kind: [i for i, p in enumerate(self.pieces) if p.kind == kind] for kind in "MCKf"}
        self._by_kind = {kind: (index, [self.pieces[i].operator for i in index]) for kind, index in chosen.items()}
        self._coefficients: Array | None = None
        self._shift: tuple[float, float, float] | None = None
        self._changed = True
        self.settled = False

    def leave_out(self, effects: Collection[str]) -> None:
        """Take the pieces of some effects, bodies or the PRESTRESS out of the equations, and put all others back in."""
        left_out = set(effects)
        self._weights = np.array([0.0 if left_out & set(p.term.split("@")) else 1.0 for p in self.pieces])
        self._coefficients = None

    # --- pieces -------------------------------------------------------------------------------------------------

    def _constants(self) -> dict[str, fem.Constant]:
        loads = {name: constant for name, (constant, _) in self.structure.load_constants.items()}
        return {**self.model.frame.constants, **loads}

    def _zero_constants(self) -> None:
        for constant in self._constants().values():
            constant.value[...] = 0.0

    def _factor_indices(self) -> npt.NDArray[np.int64]:
        """Return for every piece the two places of its factors in (1, all constants one after the other)."""
        places: dict[tuple[str, int], int] = {}
        for name, constant in self._constants().items():
            for i in range(constant.value.size):
                places[name, i] = 1 + len(places)
        pairs = [[places[entry] for entry in p.key] for p in self.pieces]
        return np.array([(*pair, 0, 0)[:2] for pair in pairs], dtype=np.int64).reshape(-1, 2)

    def _keys(self, term: str) -> list[Key]:
        """Return the products of constants a term consists of: its effect says which constant, to which power."""
        if term == "loads":
            return [((name, i),) for name, (c, _) in self.structure.load_constants.items() for i in range(c.value.size)]
        _, name, power = ACCELERATIONS.get(term.split("@")[0], (None, None, 0))
        if name is None:
            return [()]
        n: Iterable[int] = range(self.model.frame.constants[name].value.size)
        if name in ("w", "dw"):  # the axis is fixed in the frame: a component it has not is never there
            n = [i for i, c in enumerate(self._axis) if c != 0.0]
        if power == 1:
            return [((name, i),) for i in n]
        return [((name, i), (name, j)) for i in n for j in n if i <= j]

    def _decompose(self, name: str, term: Any, du: Any) -> None:
        """Assemble K, C, M and f of one term for every product of constants it is made of."""
        for kind, form in (
            ("f", term),
            ("K", ufl.derivative(term, self.q, du)),
            ("C", ufl.derivative(term, self.v, du)),
            ("M", ufl.derivative(term, self.a, du)),
        ):
            if expand_derivatives(form).empty():
                continue
            compiled = forms.form(form)
            started = perf_counter()
            self.integrals["J"] += 0 if kind == "f" else len(expand_derivatives(form).integrals())
            for key in self._keys(name):
                first = kind == "K" and name == "internal"
                operator = self._polarised(compiled, key, kind, 1.0 if first else 0.0)
                if operator.norm() > 0.0:
                    self.pieces.append(Piece(kind, key, operator, name))
            self.assembled += perf_counter() - started

    def _polarised(self, form: Any, key: Key, kind: str, diagonal: float) -> Any:
        """Assemble the part of a form that belongs to the product `key` (a quadratic one by polarisation)."""
        constants = self._constants()

        def at(*entries: tuple[str, int]) -> Any:
            self._zero_constants()
            for name, i in entries:
                constants[name].value.flat[i] = 1.0
            operator = self._assemble(form, kind, diagonal)
            self._zero_constants()
            return operator

        operator = at(*key)
        if len(key) == 2 and key[0] != key[1]:
            for entry in key:
                operator.axpy(-1.0, at(entry))
        return operator

    def _assemble(self, form: Any, kind: str, diagonal: float = 0.0) -> Any:
        if kind == "f":
            b = compat.create_vector(self.V)
            fem_petsc.assemble_vector(b, form)
            b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
            b.array[self.clamped] = 0.0
            return b
        A = self.A.duplicate()
        fem_petsc.assemble_matrix(A, form, self.bcs, diagonal)
        A.assemble()
        return A

    def _prestress(self, du: Any) -> None:
        """Add the geometric stiffness of the axial force that each load piece causes in the linear structure."""
        s, q0 = self.structure, fem.Function(self.V)
        material = next(p.operator for p in self.pieces if p.kind == "K" and p.key == ())
        solver, x = DirectSolver(material, symmetric=True), compat.wrap(q0.x)
        second = s.strains(self.model.theory.prestress_measures(s.type))
        form: Any = 0
        for first, higher in zip(self.model.strains, second, strict=True):
            if first.name in s.prestressing:
                force = first.force(ufl.replace(first.value, {self.q: q0}))
                curvature = ufl.derivative(ufl.derivative(higher.value, self.q, self.structure.k.dq), self.q, du)
                form += ufl.inner(force, curvature) * higher.measure
        compiled = forms.form(form)
        self.integrals["J"] += len(expand_derivatives(form).integrals())
        started = perf_counter()
        for piece in [p for p in self.pieces if p.kind == "f"]:
            solver.solve(piece.operator, x)
            x.scale(-1.0)
            q0.x.scatter_forward()
            K = self._assemble(compiled, "K")
            if K.norm() > 0.0:
                self.pieces.append(Piece("K", piece.key, K, f"{piece.term}@{PRESTRESS}"))
        self.assembled += perf_counter() - started

    @property
    def _axis(self) -> Array:
        """Components of the spin axis that w and dw have."""
        return self.motion.axis[2:] if self.structure.planar else self.motion.axis

    # --- operators at a time ---------------------------------------------------------------------------------------

    def set_time(self, t: float, motion: Motion | None = None, load_factor: float = 1.0) -> None:
        """Set the constants of time t (s) and form M, C, K and f there if their coefficients have changed."""
        super().set_time(t, motion, load_factor)
        c = self._products([constant.value.ravel() for constant in self._all_constants])
        old = self._coefficients
        self._coefficients = c
        self.settled = True
        if old is not None and np.array_equal(old, c):
            return
        for kind, operator in self._operators.items():
            selected, operators = self._by_kind[kind]
            if old is None or not np.array_equal(old[selected], c[selected]):
                combine(operator, operators, c[selected])
                self._changed, self.settled = True, False
        self._load.zeroEntries()
        selected, operators = self._by_kind["f"]
        for operator, value in zip(operators, c[selected], strict=True):
            if value != 0.0:
                self._load.axpy(value, operator)

    def coefficients(self, motion: Motion) -> Array:
        """Return the factor of every piece at the start of another motion, shape (n,); nothing is set."""
        values = {**self.model.frame.values(motion, 0.0), **self.load_values(0.0, motion)}
        return self._products([np.ravel(values[name]) for name in self._constants()])

    def _products(self, values: list[Array]) -> Array:
        """Return the product that multiplies each piece, from the values of all constants in their order."""
        flat = np.concatenate([ONE, *values])
        return np.asarray(self._weights * flat[self._factors[:, 0]] * flat[self._factors[:, 1]])

    def residual(self) -> Any:
        """Return −(M a + C v + K q + f), zero at clamped unknowns."""
        self._load.copy(self.b)
        for operator, x in zip((self._operators[k] for k in "KCM"), self._qva, strict=True):
            operator.multAdd(x, self.b, self._work)
            self._work.copy(self.b)
        self.b.scale(-1.0)
        self.b.array[self.clamped] = 0.0
        return self.b

    @property
    def current(self) -> bool:
        """Whether the last tangent is that of this time, but for its shifts (see `System`)."""
        return not self._changed

    def tangent(self, c_k: float, c_v: float, c_m: float) -> tuple[Any, bool]:
        """Return (c_k K + c_v C + c_m M, whether it changed since the last call)."""
        shift = (c_k, c_v, c_m)
        changed = self._changed or shift != self._shift
        if changed:
            combine(self.A, [self._operators[k] for k in "KCM"], np.array(shift))
            self._changed, self._shift = False, shift
        return self.A, changed

    def spin_derivative(self, c_v: float, c_m: float, out: Any) -> None:
        """Write c_v ∂F/∂Omega + c_m ∂F/∂Omega' of the state into a PETSc vector: the speed along the axis varies."""
        axis = self._axis
        values = {name: constant.value.ravel() for name, constant in self._constants().items()}
        states = dict(zip("KCM", self._qva, strict=True))
        out.zeroEntries()
        for p, weight in zip(self.pieces, self._weights, strict=True):
            slope = 0.0
            for i, (name, component) in enumerate(p.key):
                if name in ("w", "dw"):
                    others = np.prod([values[n][c] for j, (n, c) in enumerate(p.key) if j != i])
                    slope += (c_v if name == "w" else c_m) * axis[component] * float(others) * weight
            if slope == 0.0:
                continue
            if p.kind == "f":
                out.axpy(slope, p.operator)
            else:
                p.operator.mult(states[p.kind], self._work)
                out.axpy(slope, self._work)

    def matrix(self, c_k: float, c_v: float, c_m: float, diagonal: float) -> Any:
        """Return a new matrix c_k K + c_v C + c_m M with `diagonal` at clamped unknowns (where K has 1)."""
        A = self.A.duplicate()
        combine(A, [self._operators[k] for k in "KCM"], np.array([c_k, c_v, c_m]))
        d = A.getDiagonal()
        d.array[self.clamped] = diagonal
        A.setDiagonal(d)
        return A

    def mass_damping_stiffness(self, keep: bool = True) -> tuple[Any, Any, Any]:
        """Return (M, C, K) (see `System`); without keeping, these are the system's own matrices, no copies."""
        if keep:
            return super().mass_damping_stiffness()
        return self._operators["M"], self._operators["C"], self._operators["K"]

    def stiffness_pieces(self) -> tuple[Any, Any]:
        """Return (K_1, K_2) of K = K_1 + Omega² K_2 without base acceleration and loads; clamped rows 1 and 0."""
        axis = self._axis
        parts = (self.A.duplicate(), self.A.duplicate())
        for part, size in zip(parts, (0, 2), strict=True):
            chosen = [p for p in self.pieces if p.kind == "K" and len(p.key) == size]
            weights = [np.prod([axis[i] for _, i in p.key]) if p.key else 1.0 for p in chosen]
            combine(part, [p.operator for p in chosen], np.array(weights))
        return parts

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral ½ v·Mv + ½ q·Kq + f·q − T0(0), J."""
        e = super().energies()
        q, v, _ = self._qva
        half = [self._quadratic(self._operators[k], x) / 2 for k, x in (("M", v), ("K", q))]
        e["jacobi"] = sum(half) + self._load.dot(q) - self._rest_energy()
        return e

    def _quadratic(self, A: Any, x: Any) -> float:
        A.mult(x, self._work)
        return float(self._work.dot(x))

    def _rest_energy(self) -> float:
        """Return T0 of the undeformed structure at the present speed, J: the constant of the Jacobi integral."""
        spin = self.model.frame.constants.get("w")
        if spin is None or "T0" not in self._energies:
            return 0.0
        if self._rest_inertia is None:
            state, w = self.q.x.array.copy(), spin.value.copy()
            self.q.x.array[:] = 0.0
            spin.value[...] = self.motion.axis[-spin.value.size :]
            self._rest_inertia = self.model.comm.allreduce(float(fem.assemble_scalar(self._energies["T0"])))
            self.q.x.array[:], spin.value[...] = state, w
        return self._rest_inertia * float(np.dot(spin.value, spin.value))
