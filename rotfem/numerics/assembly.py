"""Matrices of one pattern, assembled from many forms."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

SAME = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


class Assembler:
    """Makes PETSc matrices of forms whose entries are all in one pattern.

    On one process the cells' matrices are added up by dolfinx, which takes less than half of PETSc's time, where its
    entries are those of the pattern one by one.

    Args:
        form: compiled form that has all entries.
        bcs: whose unknowns the pattern has diagonal entries of.

    Attributes:
        pattern: a matrix with the pattern.
    """

    def __init__(self, form: Any, bcs: list[Any]):
        self.pattern = fem_petsc.create_matrix(form)
        fem_petsc.assemble_matrix(self.pattern, form, bcs)
        self.pattern.assemble()
        self._own: Any = None
        if self.pattern.comm.size == 1:
            own = fem.create_matrix(form, la.BlockMode.expanded)
            there = tuple(np.asarray(x, dtype=PETSc.IntType) for x in (own.indptr, own.indices))
            if all(np.array_equal(x, y) for x, y in zip(there, self.pattern.getRowIJ(), strict=True)):
                self._own = own, there

    def __call__(self, form: Any) -> Any:
        """Return a compiled form as a new matrix, nothing held."""
        if self._own is None:
            A = self.pattern.duplicate()
            fem_petsc.assemble_matrix(A, form)
        else:
            own, (rows, columns) = self._own
            own.set_value(0.0)
            fem.assemble_matrix(own, form)
            entries, A, bs = (rows, columns, own.data.copy()), PETSc.Mat(), self.pattern.getBlockSize()
            A.createAIJWithArrays(self.pattern.getSizes(), entries, bs, comm=self.pattern.comm)
        A.assemble()
        return A
