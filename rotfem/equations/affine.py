"""Linear theories: M a + C(t) v + K(t) q + f(t) = 0 with operators affine in (1, Omega, Omega², dOmega/dt, a_o, loads).

f, K, C and M are the residual and its derivatives at the undeformed state, one form each with named constants: the
switches of the terms, and those of frame and loads. The pieces are what they give with one product of constants at a
time, assembled once; a new speed costs matrix sums.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from ufl.algorithms.analysis import extract_constants

from rotfem.equations.system import System
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
    """One operator (PETSc matrix, or vector for "f"), the constants whose product multiplies it, and what it is of.

    Attributes:
        of: names of the switches that must be on: the term, the bodies' effect, PRESTRESS.
    """

    kind: str
    key: Key
    operator: Any
    of: frozenset[str]


class AffineSystem(System):
    """System of a linear theory, about the undeformed state.

    With a prestressed theory the stiffness gains ∫ N⁰ D²Γ₁[δq, q] where N⁰ is the axial force of the linear structure
    under each load piece (centrifugal, base, gravity, applied) and Γ₁ the axial strain of the theory's second order:
    Simo & Vu-Quoc 1986 eqs. (12), (23) as corrected in docs/theory.md.
    """

    linear = True
    solved_at_once = True

    def _compile(self) -> Any:
        self._at_rest = self._forms_at_rest()
        self._forms = {kind: forms.form(form, once=True) for kind, form in self._at_rest.items()}
        pattern = fem_petsc.create_matrix(self._forms["K"])
        fem_petsc.assemble_matrix(pattern, self._forms["K"], self.bcs)
        pattern.assemble()
        self._pattern = pattern
        self._zero_constants()
        self.pieces: list[Piece] = []
        for kind in self._at_rest:
            self._decompose(kind)
        self._set_switches(None)
        if self.model.theory.prestress:
            self._prestress()
        self._operators = {kind: pattern.duplicate() for kind in "MCK"}
        self._load = compat.create_vector(self.V)
        self._work = compat.create_vector(self.V)
        self._qva = [compat.wrap(x.x) for x in (self.q, self.v, self.a)]
        self._weights: Array = np.ones(len(self.pieces))
        self._factors = self._factor_indices()
        self._all_constants = list(self._constants().values())
        chosen = {kind: [i for i, p in enumerate(self.pieces) if p.kind == kind] for kind in "MCKf"}
        self._by_kind = {kind: (index, [self.pieces[i].operator for i in index]) for kind, index in chosen.items()}
        self._coefficients: Array | None = None
        self._shift: tuple[float, float, float] | None = None
        self._changed = True
        self.settled = False
        return pattern

    def _forms_at_rest(self) -> dict[str, Any]:
        """Return f, K, C and M at q = v = a = 0 as UFL forms; those that vanish are left out."""
        F, du, state = self.model.residual, ufl.TrialFunction(self.V), (self.q, self.v, self.a)
        tangents = {kind: ufl.derivative(F, x, du) for kind, x in zip("KCM", state, strict=True)}
        at_rest = {kind: forms.without(form, *state) for kind, form in {"f": F, **tangents}.items()}
        return {kind: form for kind, form in at_rest.items() if not form.empty()}

    @property
    def integrals(self) -> dict[str, int]:
        """Number of integrals in F, and in the pieces' forms."""
        count = sum(len(form.integrals()) for kind, form in self._at_rest.items() if kind != "f")
        return {"F": forms.integral_count(self.model.residual), "J": count}

    def leave_out(self, effects: Collection[str]) -> None:
        """Take the pieces of some effects, their bodies or the PRESTRESS out, and put all others back in."""
        super().leave_out(effects)
        left_out = set(effects)
        self._weights = np.array([0.0 if left_out & p.of else 1.0 for p in self.pieces])
        self._coefficients = None

    # --- pieces ------------------------------------------------------------------------------------------------------

    def _constants(self) -> dict[str, fem.Constant]:
        loads = {name: constant for name, (constant, _) in self.structure.load_constants.items()}
        return {**self.model.frame.constants, **loads}

    def _zero_constants(self) -> None:
        for constant in self._constants().values():
            constant.value[...] = 0.0

    def _set_switches(self, on: Collection[str] | None) -> None:
        """Switch these on and all others off; all on if None."""
        for name, switch in self.model.switches.items():
            switch.value = 1.0 if on is None or name in on else 0.0

    def _factor_indices(self) -> npt.NDArray[np.int64]:
        """Return for every piece the two places of its factors in (1, all constants one after the other)."""
        places: dict[tuple[str, int], int] = {}
        for name, constant in self._constants().items():
            for i in range(constant.value.size):
                places[name, i] = 1 + len(places)
        pairs = [[places[entry] for entry in p.key] for p in self.pieces]
        return np.array([(*pair, 0, 0)[:2] for pair in pairs], dtype=np.int64).reshape(-1, 2)

    def _entries(self, name: str) -> list[tuple[str, int]]:
        """Return the components of a constant that are ever there: w and dw keep to the axis, which is fixed."""
        n = self._constants()[name].value.size
        if name in ("w", "dw"):
            return [(name, i) for i, c in enumerate(self._axis) if c != 0.0]
        return [(name, i) for i in range(n)]

    def _keys(self, name: str) -> list[Key]:
        """Return the products of constants that a term consists of: its effect says which, or any two that it has."""
        declared = self.model.acting[name].constants
        if declared is not None:
            if not declared:
                return [()]
            entries = self._entries(declared[0])
            return list(combinations_with_replacement(entries, len(declared)))
        mine = extract_constants(self.model.terms[name])
        found = [entry for known, c in self._constants().items() if c in mine for entry in self._entries(known)]
        return [(), *((entry,) for entry in found), *combinations_with_replacement(found, 2)]

    def _parts(self, kind: str) -> list[tuple[str, tuple[str, ...]]]:
        """Return the terms in one of the forms, each with the switches of the bodies it acts on there, none first."""
        switches, found = self.model.switches, dict[str, set[str]]()
        for integral in self._at_rest[kind].integrals():
            there = set(extract_constants(integral.integrand()))
            names = [name for name, switch in switches.items() if switch in there]
            term = next(name for name in names if name in self.model.terms)
            found.setdefault(term, set()).update([name for name in names if name != term] or [""])
        return [(term, tuple(sorted(found[term]))) for term in self.model.terms if term in found]

    def _decompose(self, kind: str) -> None:
        """Assemble one form for every term, part of the bodies and product of constants."""
        started = perf_counter()
        for name, parts in self._parts(kind):
            bodiless: dict[Key, Any] = {}
            for part in parts:
                for key in self._keys(name):
                    self._set_switches((name, part))
                    operator = self._polarised(kind, key, declared=self.model.acting[name].constants is not None)
                    if part and key in bodiless:
                        operator.axpy(-1.0, bodiless[key])
                    elif not part:
                        bodiless[key] = operator
                    if operator.norm() > 0.0:
                        if kind == "K" and name == "internal":
                            self._set_diagonal(operator, 1.0)
                        self.pieces.append(Piece(kind, key, operator, frozenset((name, part))))
        self.assembled += perf_counter() - started

    def _polarised(self, kind: str, key: Key, declared: bool) -> Any:
        """Assemble what belongs to the product `key` of constants.

        A term that is declared to be of one degree gives it with the constants at 1; a mixed product by polarisation.
        Of any other polynomial of second degree, p, the constant part is p(0), that of x is (p(x) − p(−x))/2, that of
        x² (p(x) + p(−x))/2 − p(0), and that of x y follows from p(x, y).
        """

        def at(*entries: tuple[tuple[str, int], float]) -> Any:
            return self._assemble_at(kind, dict(entries))

        if len(key) == 2 and key[0] != key[1]:
            operator = at((key[0], 1.0), (key[1], 1.0))
            for entry in key:
                operator.axpy(-1.0, at((entry, 1.0)))
            if not declared:
                operator.axpy(1.0, at())
            return operator
        if declared or not key:
            return at(*((entry, 1.0) for entry in key))
        operator, mirrored = at((key[0], 1.0)), at((key[0], -1.0))
        operator.axpy(-1.0 if len(key) == 1 else 1.0, mirrored)
        operator.scale(0.5)
        if len(key) == 2:
            operator.axpy(-1.0, at())
        return operator

    def _assemble_at(self, kind: str, values: dict[tuple[str, int], float]) -> Any:
        constants = self._constants()
        self._zero_constants()
        for (name, i), value in values.items():
            constants[name].value.flat[i] = value
        operator = self._assemble(self._forms[kind], kind)
        self._zero_constants()
        return operator

    def _assemble(self, form: Any, kind: str) -> Any:
        if kind == "f":
            b = compat.create_vector(self.V)
            fem_petsc.assemble_vector(b, form)
            b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
            b.array[self.clamped] = 0.0
            return b
        A = self._pattern.duplicate()
        fem_petsc.assemble_matrix(A, form, self.bcs, 0.0)
        A.assemble()
        return A

    def _set_diagonal(self, A: Any, value: float) -> None:
        d = A.getDiagonal()
        d.array[self.clamped] = value
        A.setDiagonal(d)

    @property
    def material(self) -> Any:
        """Stiffness of the strains alone, clamped rows 1."""
        return next(p.operator for p in self.pieces if p.kind == "K" and "internal" in p.of)

    @cached_property
    def geometric_form(self) -> Any:
        """∫ N⁰ D²Γ₁[δq, q], N⁰ the force of the linear structure at `prestressed`, a UFL form."""
        return self.geometric(ufl.TestFunction(self.V), ufl.TrialFunction(self.V), self.prestressed)

    @cached_property
    def prestressed(self) -> fem.Function:
        """The displacement of the linear structure that carries N⁰."""
        return fem.Function(self.V)

    def geometric(self, u: Any, w: Any, base: Any) -> Any:
        """Return ∫ N⁰ D²Γ₁[u, w] with N⁰ of the displacement `base`, a UFL form; 0 without a prestressed theory."""
        s, theory = self.structure, self.model.theory
        if not theory.prestress:
            return 0
        out: Any = 0
        second = s.strains(theory.prestress_measures(s.type))
        for first, higher in zip(self.model.mechanics.strains, second, strict=True):
            if first.name in s.prestressing:
                force = first.force(ufl.replace(first.value, {self.q: base}))
                curvature = ufl.derivative(ufl.derivative(higher.value, self.q, u), self.q, w)
                out += ufl.inner(force, forms.without(curvature, self.q)) * higher.measure
        return out

    def _prestress(self) -> None:
        """Add the geometric stiffness of the axial force that each load piece causes in the linear structure."""
        q0 = self.prestressed
        solver, x = DirectSolver(self.material, symmetric=True), compat.wrap(q0.x)
        compiled = forms.form(self.geometric_form, once=True)
        started = perf_counter()
        for piece in [p for p in self.pieces if p.kind == "f"]:
            solver.solve(piece.operator, x)
            x.scale(-1.0)
            q0.x.scatter_forward()
            K = self._assemble(compiled, "K")
            if K.norm() > 0.0:
                self.pieces.append(Piece("K", piece.key, K, piece.of | {PRESTRESS}))
        self.assembled += perf_counter() - started

    @property
    def _axis(self) -> Array:
        """Components of the spin axis that w and dw have."""
        return self.motion.axis[2:] if self.structure.planar else self.motion.axis

    # --- operators at a time -----------------------------------------------------------------------------------------

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

    def matrix(self, c_k: float, c_v: float, c_m: float, diagonal: float) -> Any:
        """Return a new matrix c_k K + c_v C + c_m M with `diagonal` at clamped unknowns (where K has 1)."""
        A = self.A.duplicate()
        combine(A, [self._operators[k] for k in "KCM"], np.array([c_k, c_v, c_m]))
        self._set_diagonal(A, diagonal)
        return A

    def mass_damping_stiffness(self, keep: bool = True) -> tuple[Any, Any, Any]:
        """Return (M, C, K) (see `System`); without keeping, these are the system's own matrices, no copies."""
        if keep:
            return super().mass_damping_stiffness()
        return self._operators["M"], self._operators["C"], self._operators["K"]

    def spin_derivative(self, c_v: float, c_m: float) -> Any:
        """Return c_v ∂F/∂Omega + c_m ∂F/∂Omega' of the state, a PETSc vector: the speed along the axis varies."""
        axis, out = self._axis, compat.create_vector(self.V)
        values = {name: constant.value.ravel() for name, constant in self._constants().items()}
        states = dict(zip("KCM", self._qva, strict=True))
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
        out.array[self.clamped] = 0.0
        return out

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
        return self._rest_inertia * float(np.dot(spin.value, spin.value))

    @cached_property
    def _rest_inertia(self) -> float:
        spin = self.model.frame.constants["w"]
        state, w = self.q.x.array.copy(), spin.value.copy()
        self.q.x.array[:] = 0.0
        spin.value[...] = self.motion.axis[-spin.value.size :]
        inertia = self.total(self._energies["T0"])
        self.q.x.array[:], spin.value[...] = state, w
        return inertia
