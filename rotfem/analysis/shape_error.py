"""How far the mesh puts off a deflection, told from its own shape (see `rotfem.analysis.mesh_estimate`)."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from rotfem.analysis.mesh_estimate import SAFE, MeshEstimate
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
        self.system, self.estimate = system, MeshEstimate(system.V)
        names = system.structure.unknowns
        self._size = len(names)
        self._moves = [i for i, name in enumerate(names) if name.startswith("u")]
        self.turns = [i for i, name in enumerate(names) if not name.startswith("u")]
        self._rotations = {i for i, name in enumerate(system.structure.components) if not name.startswith("u")}

    def of_modes(self, shapes: Shapes) -> Array:
        """Return the relative errors of the frequencies of shapes, by what bends or else by what stretches."""
        function, out = fem.Function(self.system.V), []
        for x, bends in zip(shapes.V.T, self.bend(shapes), strict=True):
            function.x.array[: len(x)] = x
            function.x.scatter_forward()
            components = self.turns if bends else self._moves
            out.append(LIKELY / SAFE * self.estimate(function.x.array.reshape(-1, self._size)[:, components]))
        return np.array(out)

    def bend(self, shapes: Shapes) -> npt.NDArray[np.bool_]:
        """Return of which shapes the most kinetic energy is in a family that bends, shape (r,)."""
        structure, r = self.system.structure, shapes.V.shape[1]
        along = [structure.oriented(self._whole(Y.reshape(-1, self._size, r))) for Y in (shapes.V, shapes.massed)]
        energy = summed(shapes.comm, (along[0] * along[1]).sum(axis=0))
        families = [list(components) for components, _ in structure.families.values()]
        leading = np.argmax([energy[components].sum(axis=0) for components in families], axis=0)
        return np.array([bool(set(families[i]) & self._rotations) for i in leading])

    def _whole(self, values: Array) -> Array:
        """Return all components of nodal values (n, unknowns of a node, r), zeros for those left out."""
        return np.swapaxes(self.system.structure.whole_values(np.swapaxes(values, 1, 2)), 1, 2)

    def of_shape(self, q: Array, datum: Any = None) -> float:
        """Return the relative error of a deflection (local dof array): twice that of a frequency.

        Args:
            q: of the deflection.
            datum: what its rotations are counted from; they are no shape of their own where that is another one.
        """
        nodal = q.reshape(-1, self._size)
        sizes = self.system.sizes(q)
        bends = datum is None and self.turns and np.any(sizes[list(self._rotations)] > 0.0)
        return min(1.0, 2.0 / SAFE * self.estimate(nodal[:, self.turns if bends else self._moves]))
