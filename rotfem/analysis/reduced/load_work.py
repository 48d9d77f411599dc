"""What loads do in second-order displacements, beside what the geometric stiffness of a linear theory has of it.

The work of a load f in ½ Θ η η is that of the stresses it causes in D²Γ: where the geometric stiffness K_g is of all of
these, they are the same. Where it is of the axial force alone, the forces f·Θ η − K_g η are what the linear equations
lack: those of a load across a structure that is stretched, for one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.model import ReducedModel
from rotfem.equations.pieces import PRESTRESS
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]


class LoadWork:
    """The forces of loads on second-order displacements of shapes, less those that the linear equations have.

    Args:
        model: reduced model.
        shapes: coordinates of the shapes, (m, r).
        pairs: numbers (i, j), i ≤ j, of the shapes of the products.
        seconds: displacements of unit products, local dof arrays (n, p).
    """

    def __init__(self, model: ReducedModel, shapes: Array, pairs: Sequence[tuple[int, int]], seconds: Array):
        self.model, self.shapes = model, shapes
        pieces, r = model.system.pieces, shapes.shape[1]
        loads = [pieces[i].operator.array[model.owned] for i in model.kinds["f"]]
        work = summed(model.comm, np.array(loads).reshape(len(loads), model.owned.stop) @ seconds[model.owned])
        stiffness = np.zeros((len(loads), r, r))
        for (i, j), of_pair in zip(pairs, np.asarray(work).T, strict=True):
            stiffness[:, i, j] += of_pair
            stiffness[:, j, i] += of_pair
        kinds = model.kinds["K"]
        of_prestress = [k for k, i in enumerate(kinds) if PRESTRESS in pieces[i].of]
        #: Numbers of the pieces, and the stiffness of each between the shapes, (pieces, r, r).
        self.numbers = [*model.kinds["f"], *(kinds[k] for k in of_prestress)]
        self.stiffness: Array = np.concatenate([stiffness, -shapes.T @ model.small["K"][of_prestress] @ shapes])

    def forces(self, c: Array, q: Array) -> Array:
        """Return the forces on the basis, (n, m).

        Args:
            c: factors of all pieces, (n, pieces).
            q: coordinates, (n, m).
        """
        K = np.tensordot(c[:, self.numbers], self.stiffness, 1)
        return np.asarray(np.einsum("nij,nj->ni", K, q @ self.shapes) @ self.shapes.T)
