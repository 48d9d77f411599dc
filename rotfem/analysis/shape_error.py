"""How far the mesh puts off a deflection, told from its own shape (see `rotfem.analysis.mesh_estimate`)."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from rotfem.analysis.mesh_estimate import SAFE, mesh_estimate
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]

#: What of an estimate of a frequency is taken, which is 0.2 to 1 of the true error without its margin.
LIKELY = 2.0


class Shapes(Protocol):
    """Some shapes of a structure.

    Attributes:
        V: shapes, locally owned unknowns, (n, r).
        massed: M V.
        comm: MPI communicator.
    """

    V: Array
    massed: Array
    comm: Any


class ShapeError:
    """Errors of the shapes of one structure on its mesh.

    Args:
        system: equations of the structure, its hub held.
    """

    def __init__(self, system: Any):
        self.system, self.estimate = system, mesh_estimate(system.V)
        names = system.structure.unknowns
        self._size = len(names)
        self._moves = [i for i, name in enumerate(names) if name.startswith("u")]
        self.turns = [i for i, name in enumerate(names) if not name.startswith("u")]

    def of_modes(self, shapes: Shapes) -> Array:
        """Return the relative errors of the frequencies of shapes, by what bends or else by what stretches."""
        function, out = fem.Function(self.system.V), []
        for x, bends in zip(shapes.V.T, self.bend(shapes), strict=True):
            function.x.array[: len(x)] = x
            function.x.scatter_forward()
            components = self.turns if bends else self._moves
            out.append(LIKELY / SAFE * self.estimate(function.x.array.reshape(-1, self._size)[:, components]))
        return np.array(out)

    def bend(self, shapes: Shapes, along: Array | None = None) -> npt.NDArray[np.bool_]:
        """Return which shapes bend, shape (r,): less than half of their kinetic energy is along the structure.

        Args:
            shapes: columns and M times them.
            along: directions of the structure in the state they are about; None: undeformed.
        """
        r = shapes.V.shape[1]
        tangents = self.directions() if along is None else along
        moved = [
            self._oriented(Y.reshape(-1, self._size, r))[:, : tangents.shape[1]] for Y in (shapes.V, shapes.massed)
        ]
        shares = [np.einsum("nmd,nmr->ndr", tangents, u) for u in moved]
        stretch = summed(shapes.comm, (shares[0] * shares[1]).sum(axis=(0, 1)))
        return np.asarray(stretch < 0.5)

    def directions(self, q: Array | None = None) -> Array:
        """Return unit vectors along the structure at the owned nodes, shape (n, components of displacement, d).

        Args:
            q: local dof array of a state, which says where the structure lies; None: undeformed.
        """
        place = self._places
        if q is not None:
            place = place + self._oriented(q.reshape(-1, self._size, 1))[:, : place.shape[1], 0]
        gradients = self.estimate.coefficients(place[None])[0, :, 0]
        nodes: Array = np.zeros((len(place), *gradients.shape[1:]))
        np.add.at(nodes, self.estimate.cells, gradients[:, None])
        owned = nodes[: self.system.V.dofmap.index_map.size_local]
        if owned.shape[2] == 1:
            return np.asarray(owned / np.linalg.norm(owned, axis=1, keepdims=True))
        return np.asarray(np.linalg.qr(owned)[0])

    @cached_property
    def _places(self) -> Array:
        """Where the nodes are, m, in as many components as displacements have, shape (n, components)."""
        V, names = self.system.V, self.system.structure.components
        x, dim = V.tabulate_dof_coordinates(), V.mesh.geometry.dim
        out: Array = np.zeros((len(x), sum(name.startswith("u") for name in names)))
        out[:, :dim] = x[:, :dim]
        return out

    def _oriented(self, values: Array) -> Array:
        """Return all components along the undeformed structure of nodal values (n, unknowns of a node, r)."""
        return np.asarray(self.system.structure.oriented(self._whole(values)))

    def _whole(self, values: Array) -> Array:
        """Return all components of nodal values (n, unknowns of a node, r), zeros for those left out."""
        if values.shape[1] == len(self.system.structure.components):
            return values
        return np.swapaxes(self.system.structure.whole_values(np.swapaxes(values, 1, 2)), 1, 2)

    def of_shape(self, q: Array, datum: Any = None) -> float:
        """Return the relative error of a deflection (local dof array): twice that of a frequency.

        Args:
            q: of the deflection.
            datum: what its rotations are counted from; they are no shape of their own where that is another one.
        """
        nodal = q.reshape(-1, self._size)
        sizes = self.system.sizes(q)
        names = self.system.structure.components
        turned = any(size > 0.0 for size, name in zip(sizes, names, strict=True) if not name.startswith("u"))
        bends = datum is None and self.turns and turned
        return min(1.0, 2.0 / SAFE * self.estimate(nodal[:, self.turns if bends else self._moves]))
