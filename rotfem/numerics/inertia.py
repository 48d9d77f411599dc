"""The inertia of a symmetric matrix: how many of its eigenvalues are negative, from one factorisation (Sylvester)."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from rotfem.errors import ComputationError
from rotfem.numerics.eigenproblem import ROUNDED
from rotfem.numerics.linear import COUNTING, SMALL
from rotfem.numerics.low_rank import sparse_part

#: Entries of a row that err together, as the root of their number (see `rotfem.numerics.eigenproblem`).
ROWS = 10.0

#: Asymmetry of an entry, in parts of the root of the two diagonal entries, up to which it is that of round-off.
ROUND_OFF = 1e-13


def symmetric(A: Any) -> bool:
    """Return whether a PETSc matrix, or one with a part B Bᵀ, is symmetric to round-off, whatever its units."""
    A = sparse_part(A)
    d = A.getDiagonal()
    d.array[:] = 1.0 / np.sqrt(np.where(d.array == 0.0, 1.0, np.abs(d.array)))
    scaled = A.copy()
    scaled.diagonalScale(d, d)
    return bool(scaled.isSymmetric(ROUND_OFF))


def negative_eigenvalues(A: Any) -> int:
    """Return how many eigenvalues of a symmetric PETSc matrix are negative, on every rank.

    As many as pivots of A = L D Lᵀ. Without pivoting, as PETSc factors small matrices, positive pivots are a proof;
    where one is not, MUMPS counts, which pivots.

    Raises:
        ComputationError: the matrix is singular or not finite.
    """
    if A.getSize()[0] <= SMALL:
        A = _whole(A)
        try:
            if _pivots(A, PETSc.Mat.SolverType.PETSC) == 0:
                return 0
        except ComputationError:
            pass
    return _pivots(A, PETSc.Mat.SolverType.MUMPS)


def surely_negative(K: Any) -> int | None:
    """Return how many eigenvalues of a stiffness are negative whatever rounding did to it; None where none are counted.

    The error of an entry is at most ROUNDED √(K_ii K_jj) (`rotfem.numerics.eigenproblem`), so that of K is at
    most ROWS · ROUNDED of its diagonal: with that added no eigenvalue that exact arithmetic has positive is negative.
    """
    if not symmetric(K):
        return None
    d, righted = K.getDiagonal(), K.copy()
    d.array[:] *= 1.0 + ROWS * ROUNDED
    righted.setDiagonal(d)
    try:
        return negative_eigenvalues(righted)
    except ComputationError:
        return None


def _whole(A: Any) -> Any:
    """Return a small matrix whole on every rank: far quicker to factor there than shared out."""
    comm = A.comm.tompi4py()
    if comm.size == 1:
        return A
    indptr, indices, data = A.getValuesCSR()
    rows = np.concatenate([[0], *comm.allgather(np.diff(indptr))])
    columns, values = (np.concatenate(comm.allgather(part)) for part in (indices, data))
    csr = (np.cumsum(rows).astype(indptr.dtype), columns, values)
    return PETSc.Mat().createAIJ(A.getSize(), csr=csr, comm=PETSc.COMM_SELF)


def _pivots(A: Any, solver: str) -> int:
    """Return how many pivots of a solver's factor are negative."""
    A = A.copy()  # its entries may be those of another matrix next, that is not symmetric
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    pc = PETSc.PC().create(A.comm)
    pc.setOperators(A)
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType(solver)
    pc.setFactorPivot(0.0)
    try:
        if solver == PETSc.Mat.SolverType.MUMPS:
            pc.setFactorSetUpSolverType()
            for control, value in COUNTING.items():
                pc.getFactorMatrix().setMumpsIcntl(control, value)
        else:
            pc.setFactorOrdering("rcm")
        pc.setUp()
        negative, zero, _ = pc.getFactorMatrix().getInertia()
    except PETSc.Error as error:
        raise ComputationError(f"the stiffness could not be factored to count its pivots: {error}") from None
    finally:
        pc.destroy()
    if zero:
        raise ComputationError("the stiffness is singular: the factorisation met a zero pivot")
    return int(negative)
