"""Direct solvers over PETSc, and the inertia of a symmetric matrix; no physics.

The inertia is how many eigenvalues are negative: as many as pivots of A = L D Lᵀ (Sylvester).

A complex system (A + iB)(x + iy) = f + ig is [[A, −B], [B, A]] (x, y) = (f, g), whose unknowns stand side by side,
x₁ y₁ x₂ y₂ …, so that the factor fills in as that of A does: a matrix of blocks [[a, −b], [b, a]].
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from rotfem.errors import ComputationError
from rotfem.numerics.projection import PlusLowRank, Update, dense, sparse_part, written_out

Array = npt.NDArray[np.float64]

#: Up to this size, on one process, PETSc's own LU is quicker than MUMPS (findings: 43 against 377 µs at 603 dofs).
SMALL = 5000

#: Where a symmetric matrix has 50 entries in a row, as of plates, MUMPS is quicker from this size on already.
MIDDLE = 1000

#: Units of round-off in an entry of an assembled matrix, in those of √(K_ii K_jj): sums over quadrature points.
ROUNDED = 2 * float(np.finfo(np.float64).eps)

#: Message of a singular matrix.
SINGULAR = "the tangent is singular: the factorisation met a zero pivot"


def combine(target: Any, matrices: list[Any], weights: Array) -> Any:
    """Return Σ weight · matrix, its sparse part in target, which has all their entries; one of them may have B Bᵀ."""
    out, there, structures = target, target.getInfo()["nz_used"], PETSc.Mat.Structure
    target.zeroEntries()
    for A, weight in zip(matrices, weights, strict=True):
        if weight != 0.0:
            part = sparse_part(A)
            same = part.getInfo()["nz_used"] == there
            target.axpy(weight, part, structures.SAME_NONZERO_PATTERN if same else structures.SUBSET_NONZERO_PATTERN)
            out = PlusLowRank(target, A.part, weight * A.factor) if isinstance(A, PlusLowRank) else out
    return out


def restrained(K: Any, numbers: npt.NDArray[Any]) -> None:
    """Hold unknowns of these numbers in a stiffness matrix, by springs as stiff as it is there."""
    d = K.getDiagonal()
    d.array[numbers] = np.where(d.array[numbers] == 0.0, 1.0, 2.0 * d.array[numbers])
    K.setDiagonal(d)


def set_diagonal(numbers: npt.NDArray[Any], A: Any, value: float) -> None:
    """Write a value to the diagonal of a matrix at unknowns of these numbers."""
    d = A.getDiagonal()
    d.array[numbers] = value
    A.setDiagonal(d)


def transposed(A: Any) -> Any:
    """Return Aᵀ as a new matrix (without an argument PETSc would transpose A itself)."""
    return A.transpose(PETSc.Mat())


def use_direct_solver(ksp: Any, size: int, symmetric: bool = False, pivots: bool = False, small: int = SMALL) -> None:
    """Make a KSP apply one factorisation: PETSc's own LU up to SMALL unknowns, MUMPS above."""
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    large = pivots or size > small or ksp.comm.size > 1
    pc.setType(PETSc.PC.Type.CHOLESKY if symmetric and large and not pivots else PETSc.PC.Type.LU)
    pc.setFactorPivot(0.0)  # what is small depends on the units; a singular matrix is seen in the solution
    if large:
        pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)


class DirectSolver:
    """LU factorisation of a matrix that keeps its pattern; the factor is renewed on request only.

    Args:
        A: assembled PETSc matrix, or `PlusLowRank`, of which the sparse part is factorised.
        symmetric: whether it is symmetric.
        counting: whether its negative eigenvalues are counted whatever its size.
        pivots: whether a factor needs pivots.

    Attributes:
        negative: number of negative eigenvalues of A, by the signs of its pivots (Sylvester); None where none are
            counted: by MUMPS of symmetric matrices.
    """

    negative: int | None = None

    def __init__(self, A: Any, symmetric: bool = False, counting: bool = False, pivots: bool = False):
        self._whole, self.A, self.factorisations = A, sparse_part(A), 0
        self._update: Update | None = None
        A = self.A
        self._ksp, self._solution = PETSc.KSP().create(A.comm), np.zeros(A.getLocalSize()[1])
        self._x = PETSc.Vec().createWithArray(self._solution, (len(self._solution), A.getSize()[1]), comm=A.comm)
        if symmetric:
            A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        size = A.getSize()[0]
        wide = symmetric and A.comm.size == 1 and A.getInfo()["nz_used"] > 50 * size
        use_direct_solver(self._ksp, size, symmetric, pivots, small=0 if counting else MIDDLE if wide else SMALL)
        self._ksp.setErrorIfNotConverged(False)
        self._counting = self._ksp.getPC().getType() == PETSc.PC.Type.CHOLESKY
        self._definite: bool = A.comm.size == 1  # as long as no factor has shown another thing
        self._stale = True

    def refresh(self, A: Any = None) -> None:
        """Say that the entries of A have changed, or that it is another matrix of its pattern now."""
        self._stale = True
        if A is not None and A is not self._whole:
            self._whole, self.A = A, sparse_part(A)

    def factorise(self) -> None:
        """Make the factor of the entries of now."""
        self.factorisations += 1
        if not self._counting:
            self._set_up()
        elif self._definite and self._factorise_definite():
            self.negative = 0
        else:
            self.negative = self._factorise_counting()
        self._stale = False
        whole = self._whole
        self._update = Update(whole.part, whole.factor, self._columns) if isinstance(whole, PlusLowRank) else None

    def _set_up(self) -> None:
        self._ksp.setOperators(self.A)
        self._ksp.setUp()
        if self._ksp.getPC().getFailedReason():
            raise ComputationError(SINGULAR)

    def _factorise_definite(self) -> bool:
        """Make Cholesky's factor by CHOLMOD, in a third of MUMPS's time; return whether there is one, as A is definite.

        Its ordering is AMD alone: that of METIS takes four times as long, and two factors with it are not quicker by as
        much. Without supernodes CHOLMOD would make L D Lᵀ, which indefinite matrices have too.
        """
        # Its own warning of a matrix that is not definite would go to standard output, where summaries are.
        chosen, options = {"nmethods": 1, "factor": "SUPERNODAL", "print": 0}, PETSc.Options("mat_cholmod_")
        for name, value in chosen.items():
            options[name] = value
        try:
            self._ksp.getPC().setFactorSolverType("cholmod")
            self._set_up()
        except PETSc.Error:  # not definite, or a PETSc without CHOLMOD
            self._definite = False
            self._ksp.reset()
            self._ksp.getPC().setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        finally:
            for name in chosen:
                options.delValue(name)
        return self._definite

    def _factorise_counting(self) -> int:
        """Make the factor by MUMPS and return how many pivots are negative."""
        pc = self._ksp.getPC()
        if self._ksp.getOperators()[0] != self.A:
            self._ksp.reset()  # PETSc makes a new factor for another matrix, which does not know the controls
        self._ksp.setOperators(self.A)
        pc.setFactorSetUpSolverType()
        for control in (24, 13):  # a look-out for null pivots, and the last front not left to ScaLAPACK
            pc.getFactorMatrix().setMumpsIcntl(control, 1)
        self._set_up()
        negative, zero, _ = pc.getFactorMatrix().getInertia()
        if zero:
            raise ComputationError(SINGULAR)
        return int(negative)

    def solve(self, b: Any) -> Array:
        """Return the owned rows of the solution of A x = b, a PETSc vector."""
        if self._stale:
            self.factorise()
        self._ksp.solve(b, self._x)
        if self._ksp.getConvergedReason() < 0:
            raise ComputationError(SINGULAR)
        x = self._solution.copy()
        return x if self._update is None else self._update(x)

    def solve_all(self, right: Array) -> Array:
        """Return the solutions for columns of owned rows, (n, m), which is quicker than one after the other."""
        if self._stale:
            self.factorise()
        out = self._columns(right)
        return out if self._update is None else self._update(out)

    def _columns(self, right: Array) -> Array:
        """Return the solutions with the factor alone."""
        out = np.empty_like(right, order="F")
        if right.shape[1]:  # MUMPS knows no solution for no column
            self._ksp.getPC().getFactorMatrix().matSolve(dense(self.A.comm, right), dense(self.A.comm, out))
        return out


def symmetric(A: Any) -> bool:
    """Return whether a PETSc matrix, or one with a part B Bᵀ, is symmetric to round-off, whatever its units."""
    scaled = sparse_part(A).copy()
    d = scaled.getDiagonal()
    d.array[:] = 1.0 / np.sqrt(np.where(d.array == 0.0, 1.0, np.abs(d.array)))
    scaled.diagonalScale(d, d)
    return bool(scaled.isSymmetric(1e-13))


def negative_eigenvalues(A: Any) -> int:
    """Return how many eigenvalues of a symmetric PETSc matrix are negative, on every rank.

    A factor of Cholesky is a proof that none is; where there is no such factor MUMPS counts, which pivots.
    """
    # of a copy, as its entries may be those of another matrix next, that is not symmetric
    solver = DirectSolver(A.copy(), symmetric=True, counting=True)
    solver.factorise()
    assert solver.negative is not None
    return solver.negative


def righted(K: Any, sign: float = 1.0) -> Any:
    """Return a stiffness with what rounding may have taken from it added to its diagonal, or given to it taken away.

    The error of an entry is at most ROUNDED √(K_ii K_jj) (`rotfem.numerics.eigenproblem`). Ten entries of a row, as the
    root of their number, err together, so that of K is at most 10 ROUNDED of its diagonal: with that added no
    eigenvalue that exact arithmetic has positive, or zero, is negative.
    """
    d, out = K.getDiagonal(), K.copy()
    d.array[:] *= 1.0 + sign * 10.0 * ROUNDED
    out.setDiagonal(d)
    return out


def negative_count(K: Any, sure: bool = False) -> int | None:
    """Return how many eigenvalues of a stiffness are negative, only those that surely are if so wanted.

    None are counted, and None is returned, where it is singular or not symmetric.
    """
    try:
        return negative_eigenvalues(righted(K) if sure else K) if symmetric(K) else None
    except ComputationError:
        return None


class SingularSolver:
    """Solver of A x = b with a singular A and a small K; what A does not feel, A n = 0, follows: n·K x = 0.

    x = (A + K)⁻¹ A (A + K)⁻¹ b, so that round-off of b in these directions, large over a small K, is in no x.

    Args:
        A: symmetric PETSc matrix.
        K: symmetric, regular where A is not.
    """

    def __init__(self, A: Any, K: Any):
        self._A, both = A, A.copy()
        both.axpy(1.0, K, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self._solver, (self._x, self._felt) = DirectSolver(both), A.createVecs()

    def solve(self, b: Any) -> Array:
        """Return the owned rows of the solution for b, a PETSc vector."""
        self._x.array[:] = self._solver.solve(b)
        self._A.mult(self._x, self._felt)
        return self._solver.solve(self._felt)


def is_regular(A: Any, solver: DirectSolver) -> bool:
    """Return whether a solver gives back what A was multiplied with, as it does unless A is singular to round-off."""
    x, b = A.createVecs()
    b.array[:] = np.cos(np.arange(b.getLocalSize()))
    try:
        x.array[:] = solver.solve(b)
        A.mult(x, b)
        change = x.duplicate()
        change.array[:] = solver.solve(b) - x.array
    except ComputationError:
        return False
    return bool(change.norm() <= 1e-2 * x.norm())


Complex = npt.NDArray[np.complex128]


class ComplexSolver:
    """LU factorisation of complex sums of real matrices of one pattern.

    Args:
        matrices: assembled PETSc matrices, whose entries are those of now. All but the first may be `PlusLowRank`; the
            weight of the first must not be zero then.
    """

    def __init__(self, matrices: Sequence[Any]):
        sparse = written_out(matrices)
        self._entries, (local, size) = [A.getValuesCSR()[2] for A in sparse], sparse[0].getSizes()[0]
        self._pattern = sparse[0].getValuesCSR()[:2]
        shape = ((2 * local, 2 * size), (2 * local, 2 * size))
        blocks = np.zeros((len(self._entries[0]), 2, 2))
        self._matrix = PETSc.Mat().createBAIJ(shape, 2, csr=(*self._pattern, blocks), comm=sparse[0].comm)
        self._solver = DirectSolver(self._matrix)
        self._b = self._matrix.createVecLeft()

    def factor(self, weights: Sequence[complex]) -> None:
        """Factorise Σ weight · matrix."""
        z = np.asarray(sum(w * x for w, x in zip(weights, self._entries, strict=True)), dtype=np.complex128)
        blocks = np.stack([z.real, -z.imag, z.imag, z.real], axis=1)
        self._matrix.setValuesBlockedCSR(*self._pattern, blocks)
        self._matrix.assemble()
        self._solver.refresh()

    def solve(self, b: Complex) -> Complex:
        """Return the owned part of the solution, of the owned part of a right-hand side."""
        self._b.array[:] = 0.0
        self._b.array[: 2 * len(b)] = np.ascontiguousarray(b).view(np.float64)
        return self._solver.solve(self._b)[: 2 * len(b)].view(np.complex128)


# --- units of a pencil ------------------------------------------------------------------------------------------------

# With x = D x̂ and λ = u λ̂ the pencil (λ² M + λ C + K) x = 0 becomes that of u² D M D, u D C D and D K D. D makes the
# diagonal of K one, whatever the unknowns are measured in, which for a definite K is within a small factor of the best
# condition a diagonal can give (van der Sluis 1969). All factors are powers of two, so that nothing is rounded.


def power_of_two(x: Any) -> Any:
    """Return the power of two nearest to each positive number."""
    return 2.0 ** np.round(np.log2(x))


def unknown_scale(M: Any, K: Any, unit: float) -> Any:
    """Return D as a PETSc vector of powers of two: 1/√K_ii, and of an unknown without stiffness 1/(u √M_ii)."""
    d, mass = K.getDiagonal(), M.getDiagonal()
    size = np.abs(d.array)
    size = np.where(size > 0.0, size, unit**2 * np.abs(mass.array))
    d.array[:] = power_of_two(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))
    return d


def balanced(M: Any, C: Any, K: Any, unit: float = 1.0, scale: Any = None) -> tuple[tuple[Any, Any, Any], Array]:
    """Return new matrices u² D M D, u D C D and D K D, and the owned part of D."""
    d = unknown_scale(M, K, unit) if scale is None else scale
    M, C, K = M.copy(), C.copy(), K.copy()
    for A, factor in ((M, unit**2), (C, unit), (K, 1.0)):
        A.diagonalScale(d, d)
        A.scale(factor)
    return (M, C, K), d.array.copy()


def least_frequency(M: Any, K: Any, ksp: Any) -> float:
    """Return about the least |ω| of K x = ω² M x, by two steps of inverse iteration; 0 if M is zero."""
    x, f = K.createVecs()
    y = x.duplicate()
    x.array[:] = np.random.default_rng(x.comm.rank).standard_normal(x.getLocalSize())
    square = 0.0
    for _ in range(2):
        M.mult(x, f)
        size = f.norm()
        if not np.isfinite(size) or size == 0.0:
            return 0.0
        f.scale(1.0 / size)
        ksp.solve(f, x)
        M.mult(x, y)
        kinetic = float(x.dot(y))
        square = abs(float(x.dot(f)) / kinetic) if kinetic != 0.0 else 0.0
    return float(np.sqrt(square)) if np.isfinite(square) else 0.0
