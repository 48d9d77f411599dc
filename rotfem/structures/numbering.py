"""Nodes and cells in an order that does not depend on how many processes share a mesh.

dolfinx numbers the nodes of a space and the cells anew for every number of processes; what stays is the number that a
cell had where the mesh was made. So the order is: cell after cell by that number, in each cell the nodes that are new
by their position in it. It needs no permutation of the cells' dofs to be kept, as one by elements would
(adios4dolfinx), and takes nodes apart that lie in the same place, as one by position alone would not.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


class Numbering:
    """The common order of the nodes of a space and of the cells of its mesh. Its methods are called by all processes.

    Attributes:
        positions: of all nodes in the common order, shape (nodes, 3), m; on rank 0.
    """

    def __init__(self, V: Any):
        mesh, nodes = V.mesh, V.dofmap.index_map
        self.comm, self.size = mesh.comm, V.dofmap.index_map_bs
        cells = mesh.topology.index_map(mesh.topology.dim)
        number = np.asarray(mesh.topology.original_cell_index, dtype=np.int64)
        self._all_nodes, self._all_cells = int(nodes.size_global), int(cells.size_global)
        owned = cells.size_local
        self._cells, self._owned_cells = number[: owned + cells.num_ghosts], owned
        mine = np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32)
        known_as = nodes.local_to_global(mine)
        dofmap = V.dofmap.list[:owned]
        around = V.tabulate_dof_coordinates()[dofmap]
        self.positions: Array = np.zeros((0, 3))
        gathered = self.comm.gather((number[:owned], known_as[dofmap], around))
        order: Array | None = None
        if gathered is not None:
            order, self.positions = common_order(*(np.concatenate(part) for part in zip(*gathered, strict=True)))
        order = self.comm.bcast(order)
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        self._nodes, self._owned_nodes = place[known_as], nodes.size_local

    def kind(self, x: Array) -> str:
        """Return what the first axis of a local array goes over: "unknowns", "nodes" or "cells"; "" for none of them.

        With a free hub one more entry, the same on all processes, may follow the unknowns.
        """
        counts = self._counts(len(self._nodes), len(self._cells))
        here = [name for name, count in counts.items() if len(x) == count]
        everywhere = set(here).intersection(*self.comm.allgather(here))
        return next((name for name in counts if name in everywhere), "")

    def count(self, kind: str) -> int:
        """Return the length of the first axis of an array in the common order; -1 if there is no such kind."""
        return self._counts(self._all_nodes, self._all_cells).get(kind, -1)

    def _counts(self, nodes: int, cells: int) -> dict[str, int]:
        unknowns = self.size * nodes
        return {"unknowns": unknowns, "unknowns and hub": unknowns + 1, "nodes": nodes, "cells": cells}

    def gather(self, x: Array, kind: str) -> Array | None:
        """Return a local array of a kind (see `kind`), ghosts after its own, in the common order, on rank 0."""
        hub = x[-1:] if kind.endswith("hub") else x[:0]
        x = x[: len(x) - len(hub)]
        if kind.startswith("unknowns"):
            x = x.reshape(-1, self.size)
        place, owned = (self._cells, self._owned_cells) if kind == "cells" else (self._nodes, self._owned_nodes)
        parts = self.comm.gather((place[:owned], x[:owned]))
        if parts is None:
            return None
        places, values = (np.concatenate(part) for part in zip(*parts, strict=True))
        out: Array = np.empty_like(values)
        out[places] = values
        return np.concatenate([out.ravel(), hub]) if kind.startswith("unknowns") else out

    def local(self, x: Array, kind: str) -> Array:
        """Return the local array of this process, ghosts too, of one in the common order (on every process)."""
        if not kind.startswith("unknowns"):
            return x[self._cells if kind == "cells" else self._nodes]
        count = len(x) // self.size * self.size  # a hub's angle may follow
        own = x[:count].reshape(-1, self.size)[self._nodes].ravel()
        return np.concatenate([own, x[count:]])


def common_order(cells: Array, nodes: Array, positions: Array) -> tuple[Array, Array]:
    """Return the numbers of the nodes in the common order, and their positions.

    Args:
        cells: number of each cell where the mesh was made, shape (cells,).
        nodes: numbers of its nodes, (cells, nodes of a cell).
        positions: of these, (cells, nodes of a cell, 3).
    """
    first = np.argsort(cells, kind="stable")
    nodes, positions = nodes[first], positions[first]
    low = positions.min(axis=1, keepdims=True)
    size = (positions.max(axis=1, keepdims=True) - low).max(axis=2, keepdims=True)
    place, step = np.rint((positions - low) / (1e-6 * size)).astype(np.int64), 2_000_000
    inside = np.argsort((place[..., 0] * step + place[..., 1]) * step + place[..., 2], axis=1, kind="stable")
    flat = np.take_along_axis(nodes, inside, axis=1).ravel()
    _, new = np.unique(flat, return_index=True)
    new.sort()
    return flat[new], np.take_along_axis(positions, inside[..., None], axis=1).reshape(-1, 3)[new]
