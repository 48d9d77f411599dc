"""A symmetric matrix B Bᵀ of few columns that is never written out: beside a sparse one it would fill it.

Equations with A + c B Bᵀ are solved with a factor of A (Sherman, Morrison & Woodbury; Golub & Van Loan 2013, 2.1.4):

    (A + c B Bᵀ)⁻¹ b = x − Z (1 + c BᵀZ)⁻¹ c Bᵀx,    A x = b,  A Z = B.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.numerics.projection import summed

Array = npt.NDArray[Any]


class LowRank:
    """B Bᵀ; to those who multiply by it, it looks like a PETSc matrix.

    Args:
        B: owned rows, shape (n, m).
        like: a PETSc matrix whose rows are shared out as those of B are.

    Attributes:
        B: its columns.
    """

    def __init__(self, B: Array, like: Any):
        self.B, self._like = B, like
        self.comm: MPI.Comm = like.comm.tompi4py()

    def along(self, X: Array) -> Array:
        """Return BᵀX of columns or a vector of owned rows, over all ranks."""
        return np.asarray(summed(self.comm, self.B.T @ X))

    def times(self, X: Array) -> Array:
        """Return B BᵀX of columns or a vector of owned rows."""
        return self.B @ self.along(X)

    def mult(self, x: Any, y: Any) -> None:
        """Write the product with a PETSc vector into another one."""
        y.array[:] = self.times(x.array)

    def createVecs(self) -> tuple[Any, Any]:
        """Return two PETSc vectors that fit."""
        return tuple(self._like.createVecs())

    def norm(self) -> float:
        """Return the Frobenius norm."""
        return float(np.linalg.norm(self.along(self.B)))

    def bound(self) -> float:
        """Return a bound of the largest sum of the sizes of a row's entries."""
        columns = summed(self.comm, np.abs(self.B).sum(axis=0))
        return float(self.comm.allreduce(float(np.max(np.abs(self.B) @ columns, initial=0.0)), op=MPI.MAX))

    def scaled(self, rows: Array) -> LowRank:
        """Return D B Bᵀ D with the owned part of a diagonal D."""
        return LowRank(rows[:, None] * self.B, self._like)

    def bordered(self) -> LowRank:
        """Return it with one unknown more, the last on the last rank, that it has no part in."""
        more = int(self.comm.rank == self.comm.size - 1)
        return LowRank(np.vstack([self.B, np.zeros((more, self.B.shape[1]))]), self._like)


class Update:
    """Makes solutions with A + c B Bᵀ of those with A.

    Args:
        part: B Bᵀ.
        factor: c, real or complex.
        solve: owned rows of b ↦ those of A⁻¹ b.
    """

    def __init__(self, part: LowRank, factor: complex, solve: Callable[[Array], Array]):
        self._part, self._factor = part, factor
        self._Z = np.stack([solve(b) for b in part.B.T], axis=1)
        self._small = np.eye(part.B.shape[1]) + factor * part.along(self._Z)

    def __call__(self, x: Array) -> Array:
        """Return (A + c B Bᵀ)⁻¹ b of x = A⁻¹ b, owned rows."""
        return np.asarray(x - self._Z @ np.linalg.solve(self._small, self._factor * self._part.along(x)))
