"""Integrals at points that no part of a cell has where the whole cell has them, on a refined mesh.

What is compiled for a point mass, a load or a spring at x holds x as a place in its cell, and the part of the cell that
x lies in has it elsewhere. So the shape in that part is continued to the whole cell as the polynomial that it is, E u
of the unknowns u of the part, with the same value and gradient at x. What f and A of the whole cell are there is Eᵀf
and EᵀAE of the part.

What other integrals there are of the same form come along, and are subtracted: of a cell or two that costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
from basix.ufl import element
from dolfinx import fem, mesh
from mpi4py import MPI
from petsc4py import PETSc

from rotfem.numerics import compat

if TYPE_CHECKING:
    from rotfem.numerics.refinement import Refinement

Array = npt.NDArray[np.float64]


class InnerPoint(NamedTuple):
    """A point inside a cell, and inside one of its parts.

    Attributes:
        number: of the integrals that go over it.
        cell: which one of the mesh that is refined, over all processes.
        part: which of its parts.
    """

    number: int
    cell: int
    part: int


class ExtendedCells:
    """The integrals of a form at points inside of parts of cells.

    Args:
        refined: mesh and space.
        points: inside of the parts.
        form: compiled, and as UFL.
        functions: its coefficients ↦ those on the refined mesh, whose values are read when it is assembled.
    """

    def __init__(self, refined: Refinement, points: list[InnerPoint], form: tuple[Any, Any], functions: dict[Any, Any]):
        self._refined, (compiled, f) = refined, form
        x = np.array([refined.corners[p.cell] for p in points])
        gdim, degree = refined.mesh.geometry.dim, refined.mesh.geometry.cmap.degree
        domain = element("Lagrange", refined.mesh.topology.cell_name(), degree, shape=(gdim,))
        nodes = np.arange(x.shape[0] * x.shape[1], dtype=np.int64).reshape(x.shape[:2])
        whole = mesh.create_mesh(MPI.COMM_SELF, cells=nodes, x=x.reshape(-1, 3)[:, :gdim].copy(), e=domain)
        #: In the order of the cells of this mesh.
        self._points = [points[i] for i in whole.topology.original_cell_index]
        self._functions = {}
        for c in f.coefficients():
            fine = functions[c]
            here = fem.Function(fem.functionspace(whole, c.function_space.ufl_element()))
            self._functions[c] = (fine, here, self._extensions(c.function_space))
        V = fem.functionspace(whole, refined.V.ufl_element())
        self._dofs = V.dofmap.list
        cells = {n: [i for i, p in enumerate(self._points) if p.number == n] for n in {p.number for p in points}}
        given = [(n, np.array(cells[n], dtype=np.int32)) for n in sorted(cells)]
        none = [(n, np.empty(0, dtype=np.int32)) for n in sorted(cells)]
        here = {c: function for c, (_, function, _) in self._functions.items()}
        self._with, self._without = (
            compat.form_elsewhere(compiled, f, V, here, {"cell": part}) for part in (given, none)
        )
        size = refined.V.dofmap.index_map_bs
        self._E = [np.kron(E, np.eye(size)) for E in self._extensions(refined.V)]
        self._size = size

    def add_to_matrix(self, A: Any, clamped: npt.NDArray[np.int32]) -> None:
        """Add what the points have to a matrix on the refined mesh, but for clamped unknowns."""
        self._take()
        dense = fem.assemble_matrix(self._with).to_dense() - fem.assemble_matrix(self._without).to_dense()
        for mine, dofs, E in zip(self._local(self._dofs), self._unknowns(), self._E, strict=True):
            block = E.T @ dense[np.ix_(mine, mine)] @ E
            held = np.isin(dofs, clamped)
            block[held] = 0.0
            block[:, held] = 0.0
            A.setValues(dofs, dofs, block, addv=PETSc.InsertMode.ADD_VALUES)

    def add_to_vector(self, b: Any) -> None:
        """Add what the points have to a vector on the refined mesh."""
        self._take()
        dense = fem.assemble_vector(self._with).array - fem.assemble_vector(self._without).array
        for mine, dofs, E in zip(self._local(self._dofs), self._unknowns(), self._E, strict=True):
            b.array[dofs] += E.T @ dense[mine]

    def _take(self) -> None:
        """Continue all functions from the parts to the whole cells."""
        for fine, here, extensions in self._functions.values():
            size = fine.function_space.dofmap.index_map_bs
            to, found = here.x.array.reshape(-1, size), fine.x.array.reshape(-1, size)
            dofmap, mine = fine.function_space.dofmap.list, here.function_space.dofmap.list
            for i, (point, E) in enumerate(zip(self._points, extensions, strict=True)):
                to[mine[i]] = E @ found[dofmap[self._refined.number(point.cell, point.part)]]

    def _extensions(self, space: Any) -> list[Array]:
        """Return E of a space, (nodes of the cell, nodes of its part), of every point."""
        return [self._refined.extension(space, p.part) for p in self._points]

    def _unknowns(self) -> list[npt.NDArray[np.int32]]:
        """Return the unknowns of the parts."""
        numbers = [self._refined.number(p.cell, p.part) for p in self._points]
        return self._local(self._refined.V.dofmap.list[numbers])

    def _local(self, nodes: Any) -> list[npt.NDArray[np.int32]]:
        """Return the unknowns of nodes, cell by cell."""
        return [(row[:, None] * self._size + np.arange(self._size)).ravel().astype(np.int32) for row in nodes]
