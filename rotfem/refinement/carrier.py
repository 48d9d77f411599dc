"""Shapes carried from one mesh to another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse
from dolfinx import geometry

Array = npt.NDArray[np.float64]

#: Distance from a cell, relative to the size of the mesh, at which a point still lies in it.
CLOSE = 1e-8


def carrier(of: Any, to: Any) -> Callable[[Array], Array] | None:
    """Return what makes local dof arrays of one system such of another one by interpolation; None where none does.

    Args:
        of: system of the arrays.
        to: system of the same structure on another mesh, or on the same.
    """
    if of.comm.size > 1:
        same = of.model.problem.mesh == to.model.problem.mesh
        return (lambda q: q) if same else None
    here, there = of.held, to.held
    nodes = there.V.tabulate_dof_coordinates()
    if nodes.shape == (known := here.V.tabulate_dof_coordinates()).shape and np.array_equal(nodes, known):
        return lambda q: q
    weights = interpolation(here.V, nodes)
    if weights is None:
        return None
    further = len(of.zeros()) - len(here.zeros())  # the angle of a free hub
    carrying = scipy.sparse.kron(weights, np.eye(here.structure.size))
    carrying = scipy.sparse.block_diag((carrying, np.eye(further))).tocsr() if further else carrying.tocsr()
    return lambda q: np.asarray(carrying @ q)


def interpolation(V: Any, points: Array) -> Any:
    """Return a sparse matrix from values at the nodes of a space to those at points (n, 3) of its mesh, on one process.

    None where a point is not in the mesh, as at curved edges that another mesh has cut.
    """
    mesh, element = V.mesh, V.element.basix_element
    padding = CLOSE * float(np.ptp(mesh.geometry.x, axis=0).max())
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
    shape = len(points), V.dofmap.index_map.size_local
    return scipy.sparse.csr_matrix((values.ravel(), dofs.ravel(), ends), shape)
