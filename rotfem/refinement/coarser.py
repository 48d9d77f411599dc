"""The same problem on half the cells; where nodes are fixed, on a finer mesh.

For smooth solutions strains of elements of degree k converge with order k, displacements with k + 1 and frequencies
with 2k (Strang & Fix 1973, sections 3.4 and 6.3), but not at corners and in thin layers at clamps. The order assumed is
max(2, k).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import geometry
from mpi4py import MPI

from rotfem.equations.compiled import compile_system
from rotfem.errors import InputError
from rotfem.mechanics.problem import Problem
from rotfem.refinement.estimate import error_of

Array = npt.NDArray[np.float64]

#: Ratio of cell sizes from which on two meshes are compared: that of three cells to two, half of the least odd number.
LONGER = 1.5 * (1 - 1e-9)


@dataclass(frozen=True)
class OtherMesh:
    """A problem on another mesh.

    Attributes:
        system: of the problem there.
        ratio: of its cell sizes to the own ones; below 1 it is the finer of the two.
        order: of convergence that is assumed.
    """

    system: Any
    ratio: float
    order: int

    def error(self, difference: float) -> float:
        """Return the relative error of an answer on the own mesh from its relative difference to the other one."""
        if self.ratio > 1.0:
            return error_of(difference, self.order, self.ratio)
        return difference + error_of(difference, self.order, 1.0 / self.ratio)


def on_other_mesh(
    problem: Problem, system: Any, moving: bool = True, finer: bool = False, alone: bool = False
) -> OtherMesh | None:
    """Return a problem on half the cells or on a finer mesh; None where there is no other mesh.

    Half the cells are taken if each is at least 1.5 times as long there. If nodes of a section, a mass or a load
    prevent that, or there is one cell across, all cells are halved. A mesh file gets one degree more. Effects that the
    own system leaves out are left out.

    Args:
        problem: what is computed.
        system: the problem's system on its own mesh.
        moving: whether the other system will be stepped in time.
        finer: whether only a finer mesh is wanted.
        alone: whether each process has the whole mesh.
    """
    problem, own, degree = problem.replace(outputs={}), lines(system), system.V.element.basix_element.degree
    comm = MPI.COMM_SELF if alone else system.comm
    for mesh in _meshes(problem, system, finer):
        try:
            other = compile_system(problem.replace(mesh=mesh), comm, moving, system.held.parted)
            if system.held.left_out:
                other.leave_out(system.held.left_out)
        except InputError:
            continue
        sizes = lengths(lines(other), own) if mesh.degree == problem.mesh.degree else np.array([0.5])
        if (least := float(sizes.min())) >= LONGER or sizes.max() <= 1.0 / LONGER:
            return OtherMesh(other, least if least > 1.0 else float(sizes.max()), max(2, degree))
    return None


def _meshes(problem: Problem, system: Any, finer: bool) -> list[Any]:
    """Return candidates for the other mesh, the preferred one first."""
    mesh, topology, changes = problem.mesh, system.structure.mesh.topology, list[dict[str, Any]]()
    n: Any = mesh.elements
    if getattr(problem.structure, "mesh_file", None) is None:  # a structure of a user need not say it
        n = n if isinstance(n, tuple) else (topology.index_map(topology.dim).size_global,)
        numbers = [tuple(2 * k for k in n)] if finer else [tuple((k + 1) // 2 for k in n), tuple(2 * k for k in n)]
        changes = [{"elements": k if len(k) > 1 else k[0]} for k in numbers]
    higher = {"degree": system.V.element.basix_element.degree + 1}  # a default differs by cell
    return [mesh.model_copy(update=change) for change in (*changes, higher)]


def lines(system: Any) -> list[Array]:
    """Return the coordinates (m) of all vertices of a mesh along each axis, each once and in order."""
    mesh, out = system.structure.mesh, list[Array]()
    for axis in range(mesh.topology.dim):
        x = np.unique(np.concatenate(system.comm.allgather(np.unique(mesh.geometry.x[:, axis]))))
        out.append(x[np.append(True, np.diff(x) > 1e-9 * np.ptp(x))])  # nearer ones are on one line
    return out


def lengths(there: Sequence[npt.ArrayLike], here: Sequence[npt.ArrayLike]) -> Array:
    """Return, for all intervals of some lines, the length there over the length here at their middle, of all axes."""
    ratios = []
    for a, b in zip(map(np.asarray, here), map(np.asarray, there), strict=True):
        middle = (a[1:] + a[:-1]) / 2
        ratios.append(np.diff(b)[np.searchsorted(b, middle) - 1] / np.diff(a))
    return np.concatenate(ratios)


def interpolation(V: Any, points: Array) -> Any:
    """Return a sparse matrix from values at the nodes of a space to those at points (n, 3) of its mesh, on one process.

    None where a point is not in the mesh, as at curved edges that another mesh has cut.
    """
    import scipy.sparse  # slow to load

    mesh, element = V.mesh, V.element.basix_element
    padding = 1e-8 * float(np.ptp(mesh.geometry.x, axis=0).max())
    tree = geometry.bb_tree(mesh, mesh.topology.dim, padding=padding)
    cells = geometry.compute_colliding_cells(mesh, geometry.compute_collisions_points(tree, points), points)
    if np.any(np.diff(cells.offsets) == 0):
        return None
    inside = cells.array[cells.offsets[:-1]]
    dofs, values = V.dofmap.list[inside], np.empty((len(points), V.dofmap.list.shape[1]))
    order = np.argsort(inside, kind="stable")
    for same in np.split(order, 1 + np.flatnonzero(np.diff(inside[order]))):
        corners = mesh.geometry.x[mesh.geometry.dofmap[inside[same[0]]]][:, : mesh.geometry.dim]
        X = mesh.geometry.cmap.pull_back(points[same, : mesh.geometry.dim], corners)
        values[same] = element.tabulate(0, X)[0, :, :, 0]
    ends = np.arange(len(points) + 1) * dofs.shape[1]
    shape = len(points), len(V.tabulate_dof_coordinates())
    return scipy.sparse.csr_matrix((values.ravel(), dofs.ravel(), ends), shape)
