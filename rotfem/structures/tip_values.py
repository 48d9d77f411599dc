"""Values of the unknowns at the tip, known on every rank."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from dolfinx import fem


class TipValues:
    """Reads a blocked Lagrange function at the node nearest to a point.

    Args:
        V: blocked function space.
        point: coordinates (3,), m.

    Attributes:
        owner: rank that owns the node.
        dofs: local numbers of its unknowns there.
        size: number of unknowns of a node.
    """

    def __init__(self, V: fem.FunctionSpace, point: npt.ArrayLike):
        self._comm, self.size = V.mesh.comm, V.dofmap.index_map_bs
        owned = V.dofmap.index_map.size_local
        distance = np.linalg.norm(V.tabulate_dof_coordinates()[:owned] - np.asarray(point), axis=1)
        nearest = float(distance.min()) if owned else np.inf
        self.owner: int
        _, self.owner = self._comm.allreduce((nearest, self._comm.rank), op=_closest)
        node = int(distance.argmin()) if owned else 0
        self.dofs = slice(node * self.size, (node + 1) * self.size)

    def __call__(self, values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the (block size,) values at the point from a local dof array of the space."""
        if self._comm.size == 1:
            return values[self.dofs].copy()
        here = values[self.dofs].copy() if self._comm.rank == self.owner else np.empty(self.size)
        self._comm.Bcast(here, root=self.owner)
        return here


def _closest(a: tuple[float, int], b: tuple[float, int]) -> tuple[float, int]:
    return min(a, b)
