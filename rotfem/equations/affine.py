"""Linear theories: M a + C(t) v + K(t) q + f(t) = 0 with operators affine in (1, Omega, Omega², dOmega/dt, a_o, loads).

The pieces are assembled once (`rotfem.equations.pieces`); a new speed costs sums of matrices. Each has the names of its
effects, so that effects can be left out.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.clamp import ClampRows
from rotfem.equations.modal_damping import EFFECT
from rotfem.equations.pieces import PRESTRESS, Piece, Pieces
from rotfem.equations.system import System, per_composition
from rotfem.errors import InputError
from rotfem.mechanics.effects import INTERNAL
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.theories import theories
from rotfem.numerics import compat, forms
from rotfem.numerics.linear import combine, set_diagonal

Array = npt.NDArray[np.float64]

UNIT_FACTOR = np.ones(1)


class AffineSystem(System):
    """System of a linear theory, about the undeformed state: sums of its pieces."""

    linear = True
    solved_at_once = True
    pieces: list[Piece]

    def __init__(self, *arguments: Any):
        super().__init__(*arguments)
        if self._by_mode is not None:  # to the rows of the clamp it is one like others
            taken_up = -self._by_mode.B @ self._by_mode.along(self.root.carried())  # by the hub, see `hub_damping`
            self.pieces = [*self.pieces, Piece("C", (), self._by_mode, frozenset((EFFECT, "")), taken_up)]
            self._factors = self._factor_indices()
            self.leave_out(())

    def _compile(self) -> forms.Assembler:
        self._decomposed = Pieces(self.model, self.clamped, self.root, self.moving or self.parted)
        self.pieces = self._decomposed.all
        self._constants = self._decomposed.constants
        self.assembled, self.analysed = self._decomposed.assembled, self._decomposed.analysed
        self._work = compat.create_vector(self.V)
        self._qva = [compat.wrap(x.x) for x in (self.q, self.v, self.a)]
        self._weights: Array = np.ones(len(self.pieces))
        self._factors = self._factor_indices()
        self._all_constants = list(self._constants.values())
        chosen = {kind: [i for i, p in enumerate(self.pieces) if p.kind == kind] for kind in "MCKf"}
        self._by_kind = {kind: (index, [self.pieces[i].operator for i in index]) for kind, index in chosen.items()}
        self._make_operators()
        self._sums["K"] = self._decomposed.stiffness
        return self._decomposed.assembler

    def _make_operators(self) -> None:
        """Allocate M, C, K and f."""
        self._sums, self._operators = dict[str, Any](), dict[str, Any]()
        self._load = compat.create_vector(self.V)
        self._coefficients: Array | None = None
        self._shift: tuple[float, float, float] | None = None
        self._changed, self.settled = True, False

    def check_terms(self) -> None:
        """Refuse terms of a user that are no polynomials of the constants."""
        problem = self.model.problem
        for name in self._decomposed.not_polynomial:
            others = ", ".join(f'"{theory.name}"' for theory in theories() if not theory.linear)
            why = (
                "is no polynomial of second degree in speed, its rate, gravity and loads, or not of those that its "
                f'effect declares, so model.theory = "{problem.theory.name}" cannot have it; allowed: {others}'
            )
            raise InputError("terms" if name in problem.terms else "model.effects", name, why)

    def leave_out(self, effects: Collection[str]) -> None:
        """Leave out the pieces of some effects, or the PRESTRESS, and include all others."""
        super().leave_out(effects)
        left_out = set(effects)
        self._weights = np.array([0.0 if left_out & p.of else 1.0 for p in self.pieces])
        self._coefficients = None

    def _factor_indices(self) -> npt.NDArray[np.int64]:
        """Return for every piece the indices of its two factors in (1, all constants one after the other)."""
        places: dict[tuple[str, int], int] = {}
        for name, constant in self._constants.items():
            for i in range(constant.value.size):
                places[name, i] = 1 + len(places)
        pairs = [[places[entry] for entry in p.key] for p in self.pieces]
        return np.array([(*pair, 0, 0)[:2] for pair in pairs], dtype=np.int64).reshape(-1, 2)

    # --- operators at a time -----------------------------------------------------------------------------------------

    def set_time(self, t: float, motion: Motion | None = None, load_factor: float = 1.0) -> None:
        """Set the constants of time t (s) and form M, C, K and f there if their coefficients have changed."""
        super().set_time(t, motion, load_factor)
        c = self._products(np.concatenate([UNIT_FACTOR, *(constant.value.ravel() for constant in self._all_constants)]))
        first, self.settled = self._coefficients is None, True
        changed = np.asarray(c != self._coefficients)
        self._coefficients = c
        if not changed.any():
            return
        for kind in "MCK":
            selected, operators = self._by_kind[kind]
            if first or changed[selected].any():
                there = np.flatnonzero(c[selected])
                if len(there) == 1 and c[selected][there[0]] == 1.0:
                    self._operators[kind] = operators[there[0]]  # as it is, which saves a matrix
                else:
                    if kind not in self._sums:
                        self._sums[kind] = self._decomposed.assembler.zero(kind)
                    self._operators[kind] = self._sums[kind]
                    combine(self._sums[kind], operators, c[selected])
                self._changed, self.settled = True, False
        self._load.zeroEntries()
        selected, operators = self._by_kind["f"]
        for operator, value in zip(operators, c[selected], strict=True):
            if value != 0.0:
                self._load.axpy(value, operator)

    def _products(self, values: Array) -> Array:
        """Return the product that multiplies each piece, from 1 and the values of all constants in their order."""
        return np.asarray((values[self._factors[:, 0]] * values[self._factors[:, 1]]).T * self._weights)

    def residual(self) -> Any:
        """Return −(M a + C v + K q + f), zero at clamped unknowns."""
        self._load.copy(self.b)
        for operator, x in zip((self._operators[k] for k in "KCM"), self._qva, strict=True):
            operator.multAdd(x, self.b, self.b)
        if self.by_mode is not None:
            self.b.array[:] += self.by_mode.times(self._qva[1].array)
        self.b.scale(-1.0)
        self.b.array[self.clamped] = 0.0
        return self.b

    @per_composition
    def _at_clamp(self) -> ClampRows:
        return ClampRows(self.pieces, len(self.root.names))

    def clamp_forces(self) -> Array:
        """Return this process's part of the clamp's work in its unit motions (see `System`)."""
        assert self._coefficients is not None
        return self._at_clamp(self._coefficients, self._state)

    def clamp_tangents(self) -> tuple[Array, Array, Array]:
        """Return the derivatives of the forces of the clamp to q, v and a (see `System`)."""
        assert self._coefficients is not None
        return self._at_clamp.tangents(self._coefficients, len(self.root.weights))

    @property
    def current(self) -> bool:
        """Whether M, C and K of the last tangent are those of this time (see `System`)."""
        return not self._changed

    def tangent(self, c_k: float, c_v: float, c_m: float, before: Array | None = None) -> tuple[Any, bool]:
        """Return (c_k K + c_v C + c_m M, whether it changed since the last call)."""
        shift = (c_k, c_v, c_m)
        changed = self._changed or shift != self._shift
        if changed:
            combine(self.A, [self._operators[k] for k in "KCM"], np.array(shift))
            self._changed, self._shift = False, shift
        return self.with_modes(self.A, c_v), changed

    def matrix(self, c_k: float, c_v: float, c_m: float, diagonal: float) -> Any:
        """Return a new matrix c_k K + c_v C + c_m M with `diagonal` at clamped unknowns (where K has 1)."""
        A = self.A.duplicate()
        combine(A, [self._operators[k] for k in "KCM"], np.array([c_k, c_v, c_m]))
        set_diagonal(self.clamped, A, diagonal)
        return self.with_modes(A, c_v)

    def mass_damping_stiffness(self, keep: bool = True) -> tuple[Any, Any, Any]:
        """Return (M, C, K) (see `System`); without keeping, these are the system's own matrices, no copies."""
        if keep:
            return super().mass_damping_stiffness()
        return self._operators["M"], self.with_modes(self._operators["C"], 1.0), self._operators["K"]

    def spin_derivative(self, c_v: float, c_m: float) -> Any:
        """Return c_v ∂F/∂Omega + c_m ∂F/∂Omega' of the state, a PETSc vector (reused): the speed varies."""
        axis, out = self._decomposed.axis, self._spun
        out.zeroEntries()
        values = {name: constant.value.ravel() for name, constant in self._constants.items()}
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

    # --- the parts of the stiffness ------------------------------------------------------------------------------

    def matrices_at_rest(self) -> tuple[Any, Any]:
        """Return (M, K) of the undeformed structure at rest on its supports (see `System`)."""
        out, still = [], {name: of(0.0) for name, of in self.model.frame.of_supports.items()}
        for kind in "MK":
            A = self.A.duplicate()
            there = [p for p in self.pieces if p.kind == kind and PRESTRESS not in p.of]
            chosen = [p for p in there if all(name in still for name, _ in p.key)]
            factors = [np.prod([still[name][i] for name, i in p.key]) for p in chosen]
            combine(A, [p.operator for p in chosen], np.array(factors))
            out.append(A)
        return out[0], out[1]

    @property
    def has_prestress(self) -> bool:
        """Whether there is geometric stiffness at the time set."""
        weights = self._coefficients if self._coefficients is not None else np.zeros(len(self.pieces))
        return any(PRESTRESS in p.of and value != 0.0 for p, value in zip(self.pieces, weights, strict=True))

    def add_other_stiffness(self, A: Any) -> None:
        """Add to a matrix the stiffness of effects and prestress at the time set."""
        assert self._coefficients is not None
        for p, value in zip(self.pieces, self._coefficients, strict=True):
            if p.kind == "K" and value != 0.0 and (INTERNAL.name not in p.of or PRESTRESS in p.of):
                A.axpy(value, p.operator)

    def stiffness_pieces(self) -> tuple[Any, Any]:
        """Return (K_1, K_2) of K = K_1 + Omega² K_2 without base acceleration and loads; clamped rows 1 and 0."""
        axis = self._decomposed.axis
        parts = (self.A.duplicate(), self.A.duplicate())
        for part, size in zip(parts, (0, 2), strict=True):
            chosen = [p for p in self.pieces if p.kind == "K" and len(p.key) == size]
            weights = [np.prod([axis[i] for _, i in p.key]) if p.key else 1.0 for p in chosen]
            combine(part, [p.operator for p in chosen], np.array(weights))
        return parts

    # --- energies ------------------------------------------------------------------------------------------------

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral ½ v·Mv + ½ q·Kq + f·q − T0(0), J."""
        e = super().energies()
        q, v, _ = self._qva
        jacobi = self._load.dot(q) - self._rest_energy()
        for kind, x in (("M", v), ("K", q)):
            self._operators[kind].mult(x, self._work)
            jacobi += self._work.dot(x) / 2
        return e | {"jacobi": float(jacobi)}

    def _rest_energy(self) -> float:
        """Return T0 of the undeformed structure at the present speed, J: the constant of the Jacobi integral."""
        spin = self.model.frame.constants.get("w")
        if spin is None or "T0" not in self._energies.names:
            return 0.0
        if self.motion.pitch is not None:
            return self._undeformed_rest_energy()
        return self.rest_inertia * float(np.dot(spin.value, spin.value))

    def _undeformed_rest_energy(self) -> float:
        state = self.q.x.array.copy()
        self.q.x.array[:] = 0.0
        energy = self._energies()["T0"]
        self.q.x.array[:] = state
        return energy

    @cached_property
    def rest_inertia(self) -> float:
        """T0 of the undeformed structure at unit speed, kg·m²: half its moment of inertia about the axis."""
        spin = self.model.frame.constants["w"]
        w = spin.value.copy()
        spin.value[...] = self.motion.axis[-spin.value.size :]
        inertia = self._undeformed_rest_energy()
        spin.value[...] = w
        return inertia
