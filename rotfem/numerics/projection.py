"""Matrices of a system times the columns of a basis, and bases that are orthonormal; columns hold owned unknowns."""

from __future__ import annotations

from collections.abc import Callable
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
    function, columns = fem.Function(V), owned.reshape(len(owned), -1)
    out = np.empty((len(function.x.array), columns.shape[1]))
    for column, x in zip(out.T, columns.T, strict=True):
        function.x.array[: len(x)] = x
        function.x.scatter_forward()
        column[:] = function.x.array
    return out.reshape(-1, *owned.shape[1:])


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


def dense(comm: Any, X: Array) -> Any:
    """Return columns of owned rows (n, m) as a dense PETSc matrix; those in Fortran order are not copied."""
    columns = np.asarray(X, dtype=PETSc.ScalarType, order="F")
    return PETSc.Mat().createDense(((len(X), None), (None, X.shape[1])), array=columns, comm=comm)


def new_directions(comm: MPI.Comm, V: Array, W: Array) -> Array:
    """Return an orthonormal basis of what columns W add to the orthonormal V: parts of 1e-8 of a column and more."""
    W = W / np.sqrt(np.maximum(summed(comm, np.einsum("ij,ij->j", W, W)), 1e-300))
    for limit in (1e-16, 0.5):  # twice, as once leaves round-off of what was taken away
        W = W - V @ summed(comm, V.T @ W)
        sizes, turns = np.linalg.eigh(summed(comm, W.T @ W))
        W = W @ (turns[:, sizes > limit] / np.sqrt(sizes[sizes > limit]))
    return np.asarray(W)


def orthonormal(comm: MPI.Comm, columns: Array, product: Callable[[Array], Array]) -> Array:
    """Return an orthonormal basis of what columns (n, m) span, shape (n, k) with k ≤ m.

    Directions whose energy is below 1e-13 of the largest are dropped: the others hold them to round-off. A larger part
    would drop what makes the small differences between modes at two speeds.

    Args:
        comm: communicator that the rows are distributed over.
        columns: of any lengths.
        product: X ↦ B X of the inner product x·B y.
    """
    energies = summed(comm, np.einsum("ij,ij->j", columns, product(columns)))
    V: Array = columns / np.sqrt(np.maximum(energies, 1e-300))
    for _ in range(2):  # once more, as what is left of nearly equal columns is orthogonal only roughly
        gram = summed(comm, V.T @ product(V))
        energies, turns = np.linalg.eigh(0.5 * (gram + gram.T))
        keep = energies > 1e-13 * energies[-1]
        V = np.asarray(V @ (turns[:, keep] / np.sqrt(energies[keep])))
    return V
