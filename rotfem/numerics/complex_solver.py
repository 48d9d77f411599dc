"""A direct solver of complex systems over real PETSc; no physics.

(A + iB)(x + iy) = f + ig is [[A, −B], [B, A]] (x, y) = (f, g), whose unknowns stand side by side, x₁ y₁ x₂ y₂ …, so
that the factor fills in as that of A does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from rotfem.numerics.linear import DirectSolver
from rotfem.numerics.low_rank import PlusLowRank, Update, sparse_part

Complex = npt.NDArray[np.complex128]


class ComplexSolver:
    """LU factorisation of complex sums of real matrices of one pattern.

    Args:
        matrices: assembled PETSc matrices; one may be `PlusLowRank`. Their entries are those of now.

    Attributes:
        updates: whether solutions are those of another matrix, updated: it must not be singular where the sum is not.
    """

    def __init__(self, matrices: Sequence[Any]):
        self._entries = [sparse_part(A).getValuesCSR()[2] for A in matrices]
        self._added = [(i, A) for i, A in enumerate(matrices) if isinstance(A, PlusLowRank)]
        self.updates = bool(self._added)
        pattern = sparse_part(matrices[0])
        indptr, indices, _ = pattern.getValuesCSR()
        length = np.diff(indptr)
        rows = np.repeat(2 * length, 2)
        self._indptr = np.append(0, np.cumsum(rows)).astype(indptr.dtype)
        pairs = np.stack([2 * indices, 2 * indices + 1], axis=1)
        starts = self._indptr[:-1:2]
        self._upper = (np.repeat(starts - 2 * indptr[:-1], length) + 2 * np.arange(len(indices)))[:, None] + np.arange(
            2
        )
        self._lower = self._upper + np.repeat(2 * length, length)[:, None]
        self._indices = np.empty(4 * len(indices), dtype=indices.dtype)
        self._indices[self._upper] = self._indices[self._lower] = pairs
        self._values = np.zeros(len(self._indices))
        local, size = pattern.getLocalSize()[0], pattern.getSize()[0]
        shape = ((2 * local, 2 * size), (2 * local, 2 * size))
        csr = (self._indptr, self._indices, self._values)
        self._matrix = PETSc.Mat().createAIJ(shape, csr=csr, comm=pattern.comm)
        self._solver = DirectSolver(self._matrix)
        self._update: Update | None = None
        self._x, self._b = self._matrix.createVecs()

    def factor(self, weights: Sequence[complex]) -> None:
        """Factorise Σ weight · matrix."""
        values = np.asarray(sum(w * x for w, x in zip(weights, self._entries, strict=True)), dtype=np.complex128)
        self._values[self._upper] = np.stack([values.real, -values.imag], axis=1)
        self._values[self._lower] = np.stack([values.imag, values.real], axis=1)
        self._matrix.setValuesCSR(self._indptr, self._indices, self._values)
        self._matrix.assemble()
        self._solver.refresh()
        self._update = None
        for i, A in self._added:
            self._update = Update(A.part, weights[i] * A.factor, self._column)

    def _column(self, b: Any) -> Complex:
        return self._solved(b.astype(np.complex128))

    def solve(self, b: Complex) -> Complex:
        """Return the owned part of the solution, of the owned part of a right-hand side.

        Raises:
            ComputationError: the matrix is singular to working precision.
        """
        x = self._solved(b)
        return x if self._update is None else self._update(x)

    def _solved(self, b: Complex) -> Complex:
        self._b.array[:] = np.ascontiguousarray(b).view(np.float64)
        self._solver.solve(self._b, self._x)
        return np.array(self._x.array).view(np.complex128)
