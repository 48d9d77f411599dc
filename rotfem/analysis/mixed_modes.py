"""Modes once more, with the stiff strains as unknowns, where round-off of the stiffness has spoilt them.

In K = Σ ∫ DΓᵀ C DΓ + … a bending mode is what is left when axial and shear strains of 1e12 times its stiffness cancel,
so round-off of the sums alone is as large as it. With the strains e at the integration points as further unknowns,

    [ K_rest   R_Cᵀ ] [ x ]
    [ R_C     −W_C  ] [ e ],      R_C = ∫ τ·C DΓ,   W_C = ∫ τ·C e,

nothing is summed that cancels: the second row says e = DΓ x, and the eigenvalues are those of (M, C, K). K_rest has the
soft strains, the effects, and the stress of the state on the second derivative of the stiff strains.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any, cast

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from rotfem.equations.affine import AffineSystem
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.mechanics import work
from rotfem.mechanics.work import Variation
from rotfem.numerics import forms
from rotfem.numerics.eigenproblem import DIGITS_LOST, Eigenpairs, Pencil, RoundOff, relative
from rotfem.numerics.linear import ROUNDED, power_of_two, set_diagonal
from rotfem.numerics.projection import sparse_part, summed

Array = npt.NDArray[Any]


class MixedModes:
    """Modes of a system from its saddle form; compiled when it is first needed.

    Args:
        system: equations of motion of the structure, hub held, not moving.

    Attributes:
        used: whether it has kept more digits of some pairs.
    """

    def __init__(self, system: System):
        self.system, self.model, self.V, self.used = system, system.model, system.V, False
        self._state = fem.Function(system.V)

    @cached_property
    def _forms(self) -> tuple[list[tuple[Any, Any]], Any, Any]:
        """Forms of the rows of each stiff strain, of K_rest, and of `_compile_stressed`."""
        strains, names = self.model.mechanics.strains, self.system.structure.stiff
        stiff, soft = ([s for s in strains if (s.name in names) == wanted] for wanted in (True, False))
        return [self._compile_row(s) for s in stiff], self._compile_rest(stiff, soft), self._compile_stressed()

    def _at_rest(self, form: Any) -> Any:
        q, v, a, _ = self.model.mechanics.k.functions
        zero = (q, v, a) if self.system.linear else (v, a)
        return forms.without(form, *zero)

    def _compile_row(self, strain: Any) -> tuple[Any, Any]:
        """Return the forms of R_C and W_C of one strain."""
        mesh, q = self.V.mesh, self.system.q
        shape, degree = ufl.as_ufl(strain.value).ufl_shape, strain.measure.metadata()["quadrature_degree"]
        element = basix.ufl.quadrature_element(mesh.basix_cell(), value_shape=shape, degree=degree)
        Q = fem.functionspace(mesh, element)
        tau, e, du = ufl.TestFunction(Q), ufl.TrialFunction(Q), ufl.TrialFunction(self.V)
        slope = ufl.derivative(strain.value, q, du)
        rows = self._at_rest(ufl.inner(tau, strain.force(slope)) * strain.measure)
        return forms.form(rows, once=True), forms.form(ufl.inner(tau, strain.force(e)) * strain.measure, once=True)

    def _compile_rest(self, stiff: list[Any], soft: list[Any]) -> Any:
        """Return the form of K_rest, in a linear theory without what its pieces hold; None where it is empty."""
        m, du = self.model.mechanics, ufl.TrialFunction(self.V)
        if self.system.linear and not soft:
            return None
        inner = work.internal(replace(m, strains=soft), Variation(m.k)) if soft else 0
        if not self.system.linear:
            inner += sum(term for name, term in self.model.terms.items() if name != "internal")
            for s in stiff:  # the stress of the state, which the derivative does not see
                stress = s.force(ufl.replace(s.value, {self.system.q: self._state}))
                inner += ufl.inner(stress, m.k.variation(s.value)) * s.measure
        form = self._at_rest(ufl.derivative(inner, self.system.q, du))
        return None if form.empty() else forms.form(form, once=True)

    def _compile_stressed(self) -> Any:
        """Return the form of ∫ C 1·D²Γ of the strains with large stresses; None where there is none."""
        m, s, theory, du = self.model.mechanics, self.system.structure, self.model.theory, ufl.TrialFunction(self.V)
        higher = self.model.strains(theory.prestress_measures(s.type)) if theory.prestress else m.strains
        out: Any = 0
        for first, strain in zip(m.strains, higher, strict=True):
            if strain.name in {*s.stiff, *s.prestress_strains}:
                shape = ufl.as_ufl(strain.value).ufl_shape
                force = first.force(ufl.as_vector([1.0] * shape[0]) if shape else ufl.as_ufl(1.0))
                out += ufl.inner(force, ufl.derivative(m.k.variation(strain.value), self.system.q, du)) * strain.measure
        form = self._at_rest(out)
        return None if form.empty() else forms.form(form, once=True)

    def _at_state(self, M: Any, C: Any, unit: float) -> tuple[Pencil, Any]:
        """Return the pencil over (x, e) at the state and time set in the system, given its M and C.

        With it the geometric stiffness of x per unit strain of the state, whose own round-off is one of numbers of
        order one; None of a state without stress.
        """
        system = self.system
        each, rest_form, stressed_form = self._forms
        self._state.x.array[:] = system.q.x.array
        rest = system.A.duplicate()
        if rest_form is not None:
            rest.zeroEntries()
            fem_petsc.assemble_matrix(rest, rest_form, system.bcs, 0.0)
            rest.assemble()
        if system.linear:
            cast(AffineSystem, system).add_other_stiffness(rest)
        set_diagonal(system.clamped, rest, 1.0)
        free = M.createVecRight()
        free.array[:] = 1.0
        free.array[system.clamped] = 0.0
        rows, blocks = [], []
        for row, block in each:
            R, W = (fem_petsc.assemble_matrix(form) for form in (row, block))
            R.assemble()
            W.assemble()
            R.diagonalScale(None, free)
            W.scale(-1.0)
            rows.append(R)
            blocks.append(W)
        zero, apart = [_empty(W) for W in blocks], [None for W in blocks]
        K, factors = (_bordered(corner, rows, blocks) for corner in (rest, _empty(M)))
        pencil = Pencil(_bordered(M, apart, zero), _bordered(C, apart, zero), K)
        scale(pencil, rest, factors, unit)
        stressed = bool(np.any(self._state.x.array))
        has_stress = cast(AffineSystem, system).has_prestress if system.linear else stressed
        if stressed_form is None or not system.comm.allreduce(has_stress, op=MPI.LOR):
            return pencil, None
        stressed = fem_petsc.assemble_matrix(stressed_form, system.bcs, 0.0)
        stressed.assemble()
        return pencil, stressed

    def better(self, pencil: Pencil, pairs: Eigenpairs, count: int) -> Eigenpairs:
        """Return the pairs, or those of the saddle form where digits are lost and it keeps more of them."""
        worst = float(np.max(pairs.bounds[:count], initial=0.0))
        if worst <= DIGITS_LOST or sparse_part(pencil.C) is not pencil.C or not self.system.structure.stiff:
            return pairs
        kept, stressed = self._at_state(pencil.M, pencil.C, pencil.unit or 1.0)
        try:
            kept.overdamped = pencil.overdamped
            found = kept.first(count)
        except ComputationError:
            return pairs
        n = pairs.right.shape[0]
        right, left, bounds = found.right[:n], found.left[:n], found.bounds

        def products(X: Array) -> Array:
            return np.asarray(summed(pencil.comm, np.sum(left.conj() * X, axis=0)))

        eta = self.system.model.mechanics.damping.stiffness
        round_off: Array = np.zeros(len(bounds))
        if stressed is not None:
            round_off += ROUNDED * np.abs(products(pencil.apply(stressed, right)))
        if eta is not None:  # C = η K + … is summed as K was
            round_off += np.abs(float(eta.value) * found.values) * RoundOff(pencil).stiffness(left, right)
        if np.any(round_off):
            MX, CX = (pencil.apply(A, right) for A in (pencil.M, pencil.C))
            slope = np.abs(products(2 * found.values * MX + CX) * found.values)
            bounds = bounds + relative(round_off / np.maximum(slope, np.finfo(float).tiny))
        if len(bounds) < min(count, len(pairs.bounds)) or _digits(bounds[:count]) <= _digits(pairs.bounds[:count]):
            return pairs
        self.used = True
        return Eigenpairs(found.values, right, left, found.errors, bounds)


def _empty(A: Any) -> Any:
    """Return a matrix of the size of a square one, without entries."""
    out = PETSc.Mat().createAIJ((A.getSizes()[0], A.getSizes()[0]), nnz=0, comm=A.comm)
    out.assemble()
    return out


def _bordered(corner: Any, rows: list[Any], blocks: list[Any]) -> Any:
    """Return [[corner, R₁ᵀ, …], [R₁, W₁], …]; without rows that are None."""
    grid = [[corner, *(None if R is None else R.transpose(PETSc.Mat()) for R in rows)]]
    for i, (R, W) in enumerate(zip(rows, blocks, strict=True)):
        grid.append([R, *(W if i == j else None for j in range(len(rows)))])
    out = PETSc.Mat().createNest(grid, comm=corner.comm)
    out.assemble()
    return out.convert("aij")


def _digits(bounds: Array) -> float:
    """Return how many digits relative bounds leave, in the mean."""
    return -float(np.mean(np.log10(np.maximum(bounds, np.finfo(float).eps)))) if len(bounds) else 0.0


def scale(pencil: Pencil, rest: Any, factors: Any, unit: float) -> None:
    """Scale the unknowns of a pencil over (x, e) so that neither stiff nor soft strains are lost.

    Those of x are scaled by what soft strains, or where there are none the inertia at a frequency of the size wanted,
    make of them; the equation of each strain by its largest entry.
    """
    indptr, indices, data = factors.getValuesCSR()
    factors.setValuesCSR(indptr, indices, np.abs(data))
    factors.assemble()
    n, d = rest.getLocalSize()[0], pencil.K.createVecRight()
    soft, mass = np.abs(rest.getDiagonal().array), pencil.M.getDiagonal().array[:n]
    size = np.maximum(soft, unit**2 * np.abs(mass))
    d.array[:] = 1.0
    d.array[:n] = power_of_two(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))
    rows, first = factors.copy(), d.copy()
    first.array[n:] = 0.0
    rows.diagonalScale(None, first)
    indptr, indices, data = rows.getValuesCSR()
    largest = np.zeros(len(indptr) - 1)  # of each row
    np.maximum.at(largest, np.repeat(np.arange(len(largest)), np.diff(indptr)), data)
    strains = largest[n:]
    d.array[n:] = power_of_two(1.0 / np.where(strains > 0.0, strains, 1.0))
    pencil.unknowns, pencil.pivots, pencil.unit, pencil.factors = d, True, unit, factors
    pencil.sizes = np.zeros(d.getLocalSize())
    pencil.sizes[:n] = np.sqrt(soft)
