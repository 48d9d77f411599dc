"""Matrices of a system times columns of owned unknowns, orthonormal bases, and A + c B Bᵀ with a B of few columns.

B Bᵀ is never written out, as it would fill a sparse matrix. Equations with A + c B Bᵀ are solved with a factor of A
(Sherman, Morrison & Woodbury; Golub & Van Loan 2013, 2.1.4):

    (A + c B Bᵀ)⁻¹ b = x − Z (1 + c BᵀZ)⁻¹ c Bᵀx,    A x = b,  A Z = B.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

Array = npt.NDArray[Any]


def summed(comm: MPI.Comm, local: Any) -> Any:
    """Return the sum over all ranks of an array of each."""
    return comm.allreduce(local, op=MPI.SUM) if comm.size > 1 else local


def with_ghosts(V: fem.FunctionSpace, owned: Array) -> Array:
    """Return local dof arrays, (n,) or (n, k), of owned rows: with those of other processes that are seen here."""
    if V.mesh.comm.size == 1:
        return owned
    if np.iscomplexobj(owned):
        return with_ghosts(V, owned.real) + 1j * with_ghosts(V, owned.imag)
    function, columns = fem.Function(V), owned if owned.ndim > 1 else owned[:, None]
    out = np.empty((len(function.x.array), columns.shape[1]))
    for column, x in zip(out.T, columns.T, strict=True):
        function.x.array[: len(x)] = x
        function.x.scatter_forward()
        column[:] = function.x.array
    return out if owned.ndim > 1 else out[:, 0]


def times(A: Any, X: Array) -> Array:
    """Return A X of a matrix and columns (n, m)."""
    if not isinstance(A, PETSc.Mat):
        return np.asarray(A.times(X))
    if X.shape[1] > 1 and A.getType() in ("seqaij", "mpiaij"):  # all columns at once, which reads each entry once
        out: Array = np.empty((A.getLocalSize()[0], X.shape[1]), order="F")
        A.matMult(dense(A.comm, X), dense(A.comm, out))
        return out
    x, y = A.createVecs()
    out = np.empty_like(X)
    for j in range(X.shape[1]):
        x.array[:] = X[:, j]
        A.mult(x, y)
        out[:, j] = y.array
    return out


def times_transposed(A: Any, X: Array) -> Array:
    """Return Aᵀ X of a matrix and columns (n, m)."""
    if isinstance(A, PlusLowRank):
        return times_transposed(A.sparse, X) + A.added(X)
    y, x = A.createVecs()
    out: Array = np.zeros((y.getLocalSize(), X.shape[1]))
    for product, column in zip(out.T, X.T, strict=True):
        x.array[:] = column
        A.multTranspose(x, y)
        moved = np.flatnonzero(y.array)  # what is not written takes up no memory
        product[moved] = y.array[moved]
    return out


def dense(comm: Any, X: Array) -> Any:
    """Return columns of owned rows (n, m) as a dense PETSc matrix; those in Fortran order are not copied."""
    columns = np.asarray(X, dtype=PETSc.ScalarType, order="F")
    return PETSc.Mat().createDense(((len(X), None), (None, X.shape[1])), array=columns, comm=comm)


def combined(V: Array, factors: Array) -> Array:
    """Return V times a small matrix, in Fortran order, as `dense` does not copy it."""
    return np.asarray((factors.T @ V.T).T)


def new_directions(comm: MPI.Comm, V: Array, W: Array) -> Array:
    """Return an orthonormal basis of what columns W add to the orthonormal V: parts of 1e-8 of a column and more."""
    W = W / np.sqrt(np.maximum(summed(comm, np.einsum("ij,ij->j", W, W)), 1e-300))
    for limit in (1e-16, 0.5):  # twice, as once leaves round-off of what was taken away
        W = W - combined(V, summed(comm, V.T @ W))
        sizes, turns = np.linalg.eigh(summed(comm, W.T @ W))
        W = combined(W, turns[:, sizes > limit] / np.sqrt(sizes[sizes > limit]))
    return W


def spanned(comm: MPI.Comm, columns: Array, least: float = 1e-10) -> Array:
    """Return an orthonormal basis of what columns (n, m) span, but for parts of `least` of a column."""
    size = np.sqrt(summed(comm, np.einsum("ij,ij->j", columns, columns)))
    Q, R = np.linalg.qr(columns[:, size > 0.0] / size[size > 0.0])
    parts = comm.allgather(R)
    U, sizes, _ = np.linalg.svd(np.vstack(parts), full_matrices=False)
    first = sum(len(part) for part in parts[: comm.rank])
    return np.asarray(Q @ U[first : first + len(R), sizes > least * sizes[0]])


# --- few columns ------------------------------------------------------------------------------------------------------


class LowRank:
    """B Bᵀ.

    Attributes:
        B: owned rows, shape (n, m).
        comm: communicator that its rows are distributed over.
    """

    def __init__(self, B: Array, comm: MPI.Comm):
        self.B, self.comm = B, comm

    def along(self, X: Array) -> Array:
        """Return BᵀX of columns or a vector of owned rows, over all ranks."""
        return np.asarray(summed(self.comm, self.B.T @ X))

    def times(self, X: Array) -> Array:
        """Return B BᵀX of columns or a vector of owned rows."""
        return self.B @ self.along(X)

    def norm(self) -> float:
        """Return the Frobenius norm."""
        return float(np.linalg.norm(self.along(self.B)))

    def bound(self) -> float:
        """Return a bound of the largest sum of the sizes of a row's entries."""
        columns = summed(self.comm, np.abs(self.B).sum(axis=0))
        return float(self.comm.allreduce(float(np.max(np.abs(self.B) @ columns, initial=0.0)), op=MPI.MAX))

    def scaled(self, rows: Array) -> LowRank:
        """Return D B Bᵀ D with the owned part of a diagonal D."""
        return LowRank(rows[:, None] * self.B, self.comm)

    def bordered(self) -> LowRank:
        """Return it with one unknown more, the last on the last rank, that it has no part in."""
        more = int(self.comm.rank == self.comm.size - 1)
        return LowRank(np.vstack([self.B, np.zeros((more, self.B.shape[1]))]), self.comm)


class PlusLowRank:
    """S + c B Bᵀ of a sparse S; it can be scaled, and `times` and `DirectSolver` take it, as a PETSc matrix.

    Args:
        sparse: S, a PETSc matrix.
        part: B Bᵀ.
        factor: c.
    """

    def __init__(self, sparse: Any, part: LowRank, factor: float = 1.0):
        self.sparse, self.part, self.factor = sparse, part, factor

    def copy(self) -> PlusLowRank:
        """Return one with a sparse part of its own."""
        return PlusLowRank(self.sparse.copy(), self.part, self.factor)

    def times(self, X: Array) -> Array:
        """Return (S + c B Bᵀ) X of columns of owned rows (n, m)."""
        return times(self.sparse, X) + self.added(X)

    def added(self, X: Array) -> Array:
        """Return c B Bᵀ X of columns or a vector of owned rows."""
        return np.asarray(self.factor * self.part.times(X))

    def norm(self, kind: Any) -> float:
        """Return a bound of the norm of the PETSc kind INFINITY: that of S and that of the rest."""
        return float(self.sparse.norm(kind) + abs(self.factor) * self.part.bound())

    def scale(self, factor: float) -> None:
        """Multiply it by a number."""
        self.sparse.scale(factor)
        self.factor *= factor

    def diagonalScale(self, left: Any, right: Any) -> None:
        """Make it D (S + c B Bᵀ) D of one diagonal D, a PETSc vector, given twice."""
        self.sparse.diagonalScale(left, right)
        self.part = self.part.scaled(left.array)


def sparse_part(A: Any) -> Any:
    """Return the sparse part of a matrix: itself, or S of S + c B Bᵀ."""
    return A.sparse if isinstance(A, PlusLowRank) else A


class Update:
    """Makes solutions with A + c B Bᵀ of those with A.

    Args:
        part: B Bᵀ.
        factor: c.
        solve: columns of owned rows of b ↦ those of A⁻¹ b.
    """

    def __init__(self, part: LowRank, factor: float, solve: Callable[[Array], Array]):
        self._part, self._factor = part, factor
        self._Z = solve(part.B)
        self._small = np.eye(part.B.shape[1]) + factor * part.along(self._Z)

    def __call__(self, x: Array) -> Array:
        """Return (A + c B Bᵀ)⁻¹ b of x = A⁻¹ b, owned rows."""
        return np.asarray(x - self._Z @ np.linalg.solve(self._small, self._factor * self._part.along(x)))


def bordered(A: Any, row: Array, column: Array, corner: float) -> Any:
    """Return [[A, column], [row, corner]] as a new matrix of the kind of A; the last rank holds the new row."""
    if isinstance(A, PlusLowRank):
        return PlusLowRank(bordered(A.sparse, row, column, corner), A.part.bordered(), A.factor)
    comm = A.comm.tompi4py()
    size, last = A.getSize()[0], comm.rank == comm.size - 1
    indptr, indices, data = A.getValuesCSR()
    ends = indptr[1:]
    data, indices = np.insert(data, ends, column), np.insert(indices, ends, size)
    indptr = indptr + np.arange(len(indptr), dtype=indptr.dtype)
    whole = np.concatenate(comm.allgather(row))
    if last:
        data = np.concatenate([data, whole, [corner]])
        indices = np.concatenate([indices, np.arange(size + 1)]).astype(indptr.dtype)
        indptr = np.append(indptr, indptr[-1] + size + 1).astype(indptr.dtype)
    local = len(row) + int(last)
    shape = ((local, size + 1), (local, size + 1))
    return PETSc.Mat().createAIJ(shape, csr=(indptr, indices.astype(indptr.dtype), data), comm=A.comm)


def written_out(matrices: Sequence[Any]) -> list[Any]:
    """Return sparse matrices whose sum, weighed, solves for x as that of these; the first has no B Bᵀ, and a weight.

    Each column b of a B has an unknown y = c b·x more, behind the others: [[A, b], [c bᵀ, −1]] (x, y) = (f, 0).
    """
    out = list(matrices)
    for i, A in enumerate(matrices):
        if isinstance(A, PlusLowRank):
            out[i] = A.sparse
            for column in A.part.B.T:
                b = np.append(column, np.zeros(out[0].getLocalSize()[0] - len(column)))
                borders = {0: (0 * b, b, -1.0), i: (A.factor * b, 0 * b, 0.0)}
                out = [bordered(M, *borders.get(j, (0 * b, 0 * b, 0.0))) for j, M in enumerate(out)]
    return out
