"""The pieces of a linear theory: the coefficients of f, K, C and M as polynomials of the constants.

f, K, C and M are the residual and its derivatives at the undeformed state, one form each with named constants: the
switches of terms and bodies, and the constants of frame and loads. So every term, body and product of constants can be
assembled by itself. The gains of effects in strains are pieces of their own, so that effects can be left out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from petsc4py import PETSc
from ufl.algorithms import expand_derivatives
from ufl.algorithms.analysis import extract_constants

from rotfem.equations.clamp import AtClamp, RootReaction
from rotfem.equations.model import Model
from rotfem.mechanics.effects import INTERNAL
from rotfem.mechanics.theories import Theory
from rotfem.numerics import compat, forms
from rotfem.numerics.forms import SAME_PATTERN, Assembler, assembled
from rotfem.numerics.linear import SMALL, DirectSolver, combine, restrained, set_diagonal
from rotfem.numerics.projection import summed, with_ghosts


def geometric_stiffness(model: Model, state: tuple[Any, Any], u: Any, w: Any, theory: Theory) -> Any:
    """Return ∫ σ⁰·D²Γ[u, w] at rest, a UFL form: of N⁰ alone, or of all stress resultants (`Model.prestresses`).

    It is 0 if no active component has such forces.
    """
    q, base = state
    s = model.structure
    out: Any = 0
    second = model.strains(theory.prestress_measures(s.type))
    for first, higher in zip(model.mechanics.strains, second, strict=True):
        if model.prestresses(first):
            force = first.force(ufl.replace(first.value, {q: base}))
            curvature = ufl.derivative(ufl.derivative(higher.value, q, u), q, w)
            out += ufl.inner(force, forms.without(curvature, q)) * higher.measure
    return 0 if isinstance(out, int) or expand_derivatives(out).empty() else out


def geometric_pieces(pieces: Pieces, parts: list[Any], compiled: Any) -> list[tuple[Piece, Any, frozenset[str]]]:
    """Return (load piece, its nonzero geometric stiffness, the effect that adds it or none) of all."""
    switches = pieces.model.switches
    there = {constant for part in parts for constant in part}
    adding = [name for name, switch in switches.items() if switch in there]
    loads, displaced = _stressing(pieces, compiled), list[tuple[Any, list[Array]]]()

    def stiffness(without: Collection[str]) -> list[Any]:
        material = pieces.material_without(without)
        if not any(known is material for known, _ in displaced):
            displaced.append((material, _displaced(pieces, material, loads)))
        for name in adding:
            switches[name].value = 0.0 if name in without else 1.0
        out = []
        for q in next(states for known, states in displaced if known is material):
            pieces.prestress_displacement.x.array[:] = q
            out.append(pieces.assemble(compiled, "K"))
        return out

    plain = stiffness(adding)
    found = [(load, K, frozenset[str]()) for load, K in zip(loads, plain, strict=True)]
    for name in adding:
        for load, K, bare in zip(loads, stiffness([other for other in adding if other != name]), plain, strict=True):
            K.axpy(-1.0, bare, SAME_PATTERN)
            found.append((load, K, frozenset((name,))))
    for name in adding:
        switches[name].value = 1.0
    return [(load, K, added) for load, K, added in found if K.norm() > 0.0]


def _stressing(pieces: Pieces, compiled: Any) -> list[Piece]:
    """Return the load pieces that may have a geometric stiffness.

    A load at the nodes of a mesh has a piece for each; all are left out if a random sum of them has no stiffness.
    """
    of: dict[str, list[Piece]] = {}
    for p in (p for p in pieces.all if p.kind == "f"):
        of.setdefault(p.key[0][0] if p.key else "", []).append(p)
    out, random, material = list[Any](), np.random.default_rng(1), pieces.material
    for group in of.values():
        if len(group) > 8:  # first it is seen whether they make any
            mixed = group[0].operator.duplicate()
            mixed.zeroEntries()
            for p, factor in zip(group, random.uniform(0.5, 1.5, len(group)), strict=True):
                mixed.axpy(factor, p.operator)
            (pieces.prestress_displacement.x.array[:],) = _displaced(
                pieces, material, [replace(group[0], operator=mixed)]
            )
            if pieces.assemble(compiled, "K").norm() == 0.0:
                continue
        out += group
    return out


def _displaced(pieces: Pieces, material: Any, loads: list[Piece]) -> list[Array]:
    """Return the displacement of the linear structure under each load, local dof arrays."""
    if not loads:
        return []
    right = np.array([load.operator.array for load in loads]).T
    loaded = np.any(right.reshape(-1, pieces.V.dofmap.index_map_bs, len(loads)) != 0.0, axis=(0, 2))
    moved = np.any(pieces.assembler.coupled[summed(material.comm.tompi4py(), loaded.astype(int)) > 0], axis=0)
    rows = np.flatnonzero(np.tile(moved, len(right) // len(moved)))
    if 0 < np.count_nonzero(moved) < len(moved):  # of a flat plate those in its plane
        numbers = (rows + material.getOwnershipRange()[0]).astype(PETSc.IntType)
        chosen = PETSc.IS().createGeneral(numbers, material.comm)
        solver = DirectSolver(material.createSubMatrix(chosen, chosen), symmetric=True)
    elif material is not pieces.material:
        solver = DirectSolver(material, symmetric=True)
    else:
        solver = pieces.analysed or pieces.material_solver
    out = np.zeros_like(right)
    out[rows] = -solver.solve_all(right[rows])
    return [*with_ghosts(pieces.V, out).T]


Array = npt.NDArray[np.float64]

#: A piece belongs to the product of these entries (constant name, component): () is 1, (("w", 0), ("w", 0)) is Omega².
Key = tuple[tuple[str, int], ...]

#: Mark of the pieces of the geometric stiffness.
PRESTRESS = "prestress"


@dataclass
class Piece:
    """One operator (PETSc matrix, or vector for "f"), with the constants whose product multiplies it.

    Attributes:
        of: names of the switches that must be on: the term, the effect of the bodies or of a gain in strain, PRESTRESS.
        at_root: its work in the unit motions of the clamp (see `RootReaction`), of this process: a row for each
            owned unknown, of "f" one number for each motion.
    """

    kind: str
    key: Key
    operator: Any
    of: frozenset[str]
    at_root: Array

    def add(self, other: Piece) -> None:
        """Make it the sum with another piece of the same kind and constants."""
        self.operator.axpy(1.0, other.operator, *(() if self.kind == "f" else (SAME_PATTERN,)))
        self.of, self.at_root = self.of | other.of, self.at_root + other.at_root


class Pieces:
    """All pieces of a model, assembled.

    With a prestressed theory the stiffness gains ∫ N⁰ D²Γ₁[δq, q] where N⁰ is the axial force of the linear structure
    under each load piece (centrifugal, base, gravity, applied) and Γ₁ the axial strain of the theory's second order:
    Simo & Vu-Quoc 1986 eqs. (12), (23) as corrected in docs/theory.md; or that of all its stress resultants.

    Args:
        apart: whether effects have pieces of their own; else terms of the same constants are one piece.

    Attributes:
        at_rest: "f", "K", "C", "M" ↦ constants of each integral of the form at q = v = a = 0, where there is one.
        constants: name ↦ constant of frame and loads.
        axis: components of the spin axis that w and dw have.
        assembler: makes matrices of the pattern of all.
        all: the pieces.
        not_polynomial: names of terms that are no polynomials of the constants.
        assembled: time spent on assembly, s.
        stiffness: a matrix for K of a time, zero, or the `material` where it was factorised.
        analysed: solver of this matrix, if the structure is large and effects are not apart.
    """

    def __init__(self, model: Model, clamped: npt.NDArray[Any], root: RootReaction, apart: bool = True):
        self.model, self.structure, self.clamped, self._apart = model, model.structure, clamped, apart
        self.q, self.V = model.structure.k.functions[0], model.structure.V
        self._at_clamp = AtClamp(model, clamped, root)
        self._hinged = self.structure.hinged_unknowns()
        self._free = compat.create_vector(self.V)
        self._free.array[:] = 1.0
        self._free.array[clamped] = 0.0
        self.assembled = 0.0
        self.analysed: DirectSolver | None = None
        self.constants: dict[str, Any] = {**model.frame.constants, **self.structure.load_constants}
        self.axis: Array = model.motion.axis[2:] if self.structure.planar else model.motion.axis
        self.at_rest, self._forms = model.derived_forms("pieces", self._made)
        symbols = self.structure.section | self.structure.scalars | model.switches
        purpose = " ".join(("geometric", model.theory.name, str(model.problem.prestress), *model.effects, *symbols))
        known, compiled = model.derived_forms(
            purpose, self._made_geometric, (self.prestress_displacement, *symbols.values())
        )
        self._forms |= compiled
        self.assembler = Assembler(self._forms["K"], [])
        large = self.assembler.pattern.getSize()[0] > SMALL
        if large:
            self._narrow()
        self.stiffness = self.assembler.zero()
        self.all: list[Piece] = []
        self.not_polynomial: list[str] = []
        for kind in self.at_rest:
            self._decompose(kind)
        self._set_switches(model.switches)
        if self.not_polynomial:
            model.check_smooth()
        if compiled:
            self._prestress(known["G"], compiled["G"])
        if large:  # a factor and a matrix, which are hardly needed again
            self.__dict__.pop("material_solver", None)
            self.assembler.release()

    def _made(self) -> dict[str, Any]:
        """Return f, K, C and M at q = v = a = 0, UFL forms; those that vanish are left out."""
        at_rest = self.model.at_rest(self.model.residual, undeformed=True)
        return {kind: form for kind, form in at_rest.items() if not form.empty()}

    def _made_geometric(self) -> dict[str, Any]:
        """Return the geometric stiffness likewise, if there is one."""
        u, w, theory, form = ufl.TestFunction(self.V), ufl.TrialFunction(self.V), self.model.theory, 0
        if theory.prestress:
            form = geometric_stiffness(self.model, (self.q, self.prestress_displacement), u, w, theory)
        return {} if isinstance(form, int) else {"G": form}

    def _narrow(self) -> None:
        """Remove zero entries from the pattern, found at random constants and a random state."""
        started, random = perf_counter(), np.random.default_rng(1)
        self._set_switches(self.model.switches)
        self._set_constants({e: random.uniform(0.5, 1.5) for name in self.constants for e in self._entries(name)})
        self.prestress_displacement.x.array[:] = random.uniform(0.5, 1.5, len(self.prestress_displacement.x.array))
        several: dict[str, list[Any]] = {}
        for kind, form in self._forms.items():
            if kind != "f":
                several.setdefault(kind if kind in "CM" and not self._apart else "K", []).append(form)
        self.assembler.narrow(several)
        self._set_constants({})
        self.assembled += perf_counter() - started

    def _set_constants(self, values: Mapping[tuple[str, int], float]) -> None:
        """Set components of constants, all others zero."""
        for constant in self.constants.values():
            constant.value[...] = 0.0
        for (name, i), value in values.items():
            self.constants[name].value.flat[i] = value
        self.structure.update_loads()

    def _set_switches(self, on: Collection[str]) -> None:
        """Switch these on and all others off."""
        for name, switch in self.model.switches.items():
            switch.value = float(name in on)

    def _entries(self, name: str) -> list[tuple[str, int]]:
        """Return the components of a constant that may be nonzero: w and dw are along the axis if nothing pitches."""
        if name == "loads":
            return [entry for load in self.structure.load_constants for entry in self._entries(load)]
        if name == "supports":
            return [entry for matrix in self.model.frame.of_supports for entry in self._entries(matrix)]
        n = self.constants[name].value.size
        if name in ("w", "dw") and self.model.motion.pitch is None:
            return [(name, i) for i, c in enumerate(self.axis) if c != 0.0]
        return [(name, i) for i in range(n)]

    def _keys(self, name: str) -> list[Key]:
        """Return the products of constants of a term: those its effect declares, or any two of its constants."""
        declared = self.model.acting[name].constants
        if declared is not None:
            if not declared:
                return [()]
            entries = self._entries(declared[0])
            return list(combinations_with_replacement(entries, len(declared)))
        found = self.entries_of(name)
        return [(), *((entry,) for entry in found), *combinations_with_replacement(found, 2)]

    def entries_of(self, name: str) -> list[tuple[str, int]]:
        """Return the components of the constants that a term has."""
        mine = extract_constants(self.model.terms[name])
        return [entry for known, c in self.constants.items() if c in mine for entry in self._entries(known)]

    def _is_checked(self, name: str) -> bool:
        """Return whether a term is a user's, or has no declared constants."""
        effect = self.model.acting[name]
        models = name == "damping" and bool(self.model.mechanics.damping.models)
        return effect.constants is None or callable(effect.work) or models

    def _parts(self, kind: str) -> list[tuple[str, tuple[str, ...]]]:
        """Return the terms in one of the forms, each with the switches of the bodies it acts on there, none first."""
        switches, found = self.model.switches, dict[str, set[str]]()
        for there in self.at_rest[kind]:
            names = [name for name, switch in switches.items() if switch in there]
            term = next(name for name in names if name in self.model.terms)
            found.setdefault(term, set()).update([name for name in names if name != term] or [""])
        return [(term, tuple(sorted(found[term]))) for term in self.model.terms if term in found]

    def _decompose(self, kind: str) -> None:
        """Assemble one form for every term, part of the bodies and product of constants; clamped rows come last."""
        started = perf_counter()
        found: list[tuple[Key, Any, frozenset[str]]] = []
        for name, parts in self._parts(kind):
            bodiless: dict[Key, Any] = {}
            same = () if kind == "f" else (SAME_PATTERN,)
            apart = self._apart or name == INTERNAL.name  # strains are wanted without what an effect adds to them
            for part in [(p,) for p in parts] if apart else [parts]:
                self._set_switches((name, *part))
                declared = self.model.acting[name].constants is not None
                whole = {key: self._polarised(kind, key, declared) for key in self._keys(name)}
                if self._is_checked(name) and not self._is_made_up(kind, name, whole):
                    self.not_polynomial.append(name)
                for key, operator in whole.items():
                    if "" in part:
                        bodiless[key] = operator
                    elif key in bodiless:
                        operator.axpy(-1.0, bodiless[key], *same)
                    if operator.norm() > 0.0:
                        found.append((key, operator, frozenset((name, *part))))
        for key, operator, of in found:
            self._keep(kind, key, operator, of)
        self.assembled += perf_counter() - started

    def _is_made_up(self, kind: str, name: str, parts: Mapping[Key, Any]) -> bool:
        """Return whether a term at random constants equals the sum of its pieces there.

        Pieces follow from values at 0, 1 and −1, which determine a polynomial of second degree; c|v|v is none.
        """
        values = {entry: 1.7 + 0.3 * i for i, entry in enumerate(self.entries_of(name))}
        left, same = self.assemble_at(kind, values), () if kind == "f" else (SAME_PATTERN,)
        size = left.norm()
        for key, operator in parts.items():
            factor = float(np.prod([values[entry] for entry in key]))
            size += abs(factor) * operator.norm()
            left.axpy(-factor, operator, *same)
        return bool(left.norm() <= 1e-10 * size)  # round-off of sums of some hundred numbers

    def _keep(self, kind: str, key: Key, operator: Any, of: frozenset[str]) -> None:
        """Add a piece, with its work at the clamp; clamped rows and columns are zero, of the strains 1."""
        if kind == "f":
            at_root = self._at_clamp.of_vector(operator)
            operator.array[self.clamped] = 0.0
        else:
            at_root = self._at_clamp.of_matrix(operator, of)
            operator.diagonalScale(self._free, self._free)
            if kind == "K" and of == {"internal", ""}:
                set_diagonal(self.clamped, operator, 1.0)
        piece = Piece(kind, key, operator, of, at_root)
        for other in () if self._apart or INTERNAL.name in of else self.all:
            if (other.kind, other.key) == (kind, key) and INTERNAL.name not in other.of:
                other.add(piece)
                return
        self.all.append(piece)

    def _polarised(self, kind: str, key: Key, declared: bool) -> Any:
        """Assemble what belongs to the product `key` of constants.

        A term that is declared to be of one degree gives it with the constants at 1; a mixed product by polarisation.
        Of any other polynomial of second degree, p, the constant part is p(0), that of x is (p(x) − p(−x))/2, that of
        x² (p(x) + p(−x))/2 − p(0), and that of x y follows from p(x, y).
        """

        def at(*entries: tuple[tuple[str, int], float]) -> Any:
            return self.assemble_at(kind, dict(entries))

        same = () if kind == "f" else (SAME_PATTERN,)
        if len(key) == 2 and key[0] != key[1]:
            operator = at((key[0], 1.0), (key[1], 1.0))
            for entry in key:
                operator.axpy(-1.0, at((entry, 1.0)), *same)
            if not declared:
                operator.axpy(1.0, at(), *same)
            return operator
        if declared or not key:
            return at(*((entry, 1.0) for entry in key))
        operator, mirrored = at((key[0], 1.0)), at((key[0], -1.0))
        operator.axpy(-1.0 if len(key) == 1 else 1.0, mirrored, *same)
        operator.scale(0.5)
        if len(key) == 2:
            operator.axpy(-1.0, at(), *same)
        return operator

    def assemble_at(self, kind: str, values: dict[tuple[str, int], float]) -> Any:
        """Return one of the forms with these components of constants, all others zero."""
        self._set_constants(values)
        operator = self.assemble(self._forms[kind], kind)
        self._set_constants({})
        return operator

    def assemble(self, form: Any, kind: str) -> Any:
        """Return a compiled form as a new PETSc vector (of "f") or matrix, the clamp not held."""
        if kind == "f":
            return assembled(form, self.V, [])
        return self.assembler(form, kind=kind)

    @cached_property
    def material(self) -> Any:
        """Stiffness of the strains alone, clamped rows 1; hinges have springs, which do not change N⁰."""
        return self.material_without(())

    @cached_property
    def material_solver(self) -> DirectSolver:
        """Solver of the `material`."""
        return DirectSolver(self.material, symmetric=True)

    def material_without(self, without: Collection[str]) -> Any:
        """Return the `material` without what these effects add to the strains."""
        parts = [p for p in self.all if p.kind == "K" and "internal" in p.of and PRESTRESS not in p.of]
        K, *others = [p.operator for p in parts if p.of.isdisjoint(without)]
        loose = bool(self.structure.released or self.structure.extra)  # held by other than strains
        if others or loose:
            K = K.copy()
        for other in others:
            K.axpy(1.0, other, SAME_PATTERN)
        if loose:
            restrained(K, self._hinged)
        return K

    @cached_property
    def prestress_displacement(self) -> fem.Function:
        """The displacement of the linear structure that carries N⁰."""
        return fem.Function(self.V)

    def _prestress(self, parts: list[Any], compiled: Any) -> None:
        """Add the geometric stiffness of the stresses that each load piece causes in the linear structure."""
        started = perf_counter()
        if not self._apart and self.stiffness.getSize()[0] > SMALL:
            combine(self.stiffness, [self.material], np.ones(1))
            self.analysed = DirectSolver(self.stiffness, symmetric=True)
        for load, K, added in geometric_pieces(self, parts, compiled):
            self._keep("K", load.key, K, load.of | {PRESTRESS} | added)
        self.assembled += perf_counter() - started
