"""Several functionals of the state in one pass over the cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from basix.ufl import element
from dolfinx import fem
from mpi4py import MPI

from rotfem.numerics import forms

Array = npt.NDArray[np.float64]


class Functionals:
    """Values of functionals, compiled as one form with a constant in every cell for each of them.

    The unknowns of a cell are read once, and what functionals share is computed once.

    Args:
        parts: name ↦ UFL form of rank 0.
        mesh: what they are integrated over.
    """

    def __init__(self, parts: dict[str, Any], mesh: Any):
        self.names, self.comm = tuple(parts), mesh.comm
        if not parts:
            return
        constant = element("DG", mesh.basix_cell(), 0, shape=(len(parts),))
        self._V = fem.functionspace(mesh, constant)  # which must outlast its array
        which = ufl.TestFunction(self._V)
        integrals = [
            integral.reconstruct(which[i] * integral.integrand())
            for i, part in enumerate(parts.values())
            for integral in part.integrals()
        ]
        self._form = forms.form(ufl.Form(integrals))
        cells = self._V.dofmap.index_map
        self._of_cells = np.zeros((cells.size_local + cells.num_ghosts, len(parts)))

    def __call__(self) -> dict[str, float]:
        """Return their values over all ranks, at what their forms are evaluated at."""
        if not self.names:
            return {}
        self._of_cells[:] = 0.0
        fem.assemble_vector(self._of_cells.reshape(-1), self._form)
        values = self._of_cells.sum(axis=0)
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, values, op=MPI.SUM)
        return dict(zip(self.names, values.tolist(), strict=True))
