"""A few shapes that span what moves the tip: Lanczos vectors of a tangent that start from unit forces at the tip.

What the tip shows of a motion are the modes that have a displacement there, and these are what the Krylov space of
K⁻¹ M from unit forces at the tip holds, the lowest first; the others follow as if they had no mass (load-dependent Ritz
vectors: Wilson, Yuan & Dickens 1982).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg
from petsc4py import PETSc

from rotfem.numerics.linear import DirectSolver

Array = npt.NDArray[np.float64]

#: Vectors from a force along the structure, and from one across it.
ALONG, ACROSS = 2, 6

#: Part of its length a vector must keep when the others are taken out of it.
DEPENDENT = 1e-6


class RitzVectors:
    """Columns V with Vᵀ M V = 1 and Vᵀ K V diagonal, in the locally owned unknowns of a structure.

    Args:
        system: equations of the structure, its hub held.
        M: mass matrix, clamped unknowns 0.
        K: stiffness matrix, clamped unknowns 1.
        shift: K + shift M (1/s²) is what forces are divided by; must be regular.

    Attributes:
        V: shape (n, r).
        massed: M V.
        squares: diagonal of Vᵀ K V, 1/s², increasing.
        tip: displacement of the tip of each column, shape (d, r), on every rank.
        shift: as it was given.
        solver: of K + shift M, until it is released.
        block: number of unknowns of a node.
    """

    def __init__(self, system: Any, M: Any, K: Any, shift: float):
        self.comm: Any = system.comm
        self.block = int(system.V.dofmap.index_map_bs)
        self._x, self._y = M.createVecs()
        A = K.copy()
        A.axpy(shift, M, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self.shift, self._M = shift, M
        self.solver, self._clamped = DirectSolver(A), system.clamped
        moves = [i for i, name in enumerate(system.structure.unknowns) if name.startswith("u")]
        columns: list[Array] = []
        massed: list[Array] = []
        for i in moves:
            x, depth = self._solved(self._force(system, i)), ALONG if i == 0 else ACROSS
            for _ in range(depth):
                if (new := self._new(x, columns, massed)) is None:
                    break
                columns.append(new[0])
                massed.append(new[1])
                x = self._solved(new[1])
        V = np.array(columns).T
        KV = np.stack([self.times(K, x) for x in columns], axis=1)
        self.squares, turn = np.linalg.eigh(_symmetric(self.sum(V.T @ KV)))
        self.V, self.massed = V @ turn, np.array(massed).T @ turn
        values = [system.structure.tip_values(_local(system, x)) for x in self.V.T]
        self.tip = np.array(values).T[moves]

    def turn_to(self, M: Any, K: Any) -> None:
        """Combine the columns so that those of another M and K near by are diagonal."""
        MV, KV = (np.stack([self.times(A, x) for x in self.V.T], axis=1) for A in (M, K))
        stiffness, mass = (_symmetric(self.sum(self.V.T @ AV)) for AV in (KV, MV))
        self.squares, turn = scipy.linalg.eigh(stiffness, mass)
        self.V, self.massed, self.tip = self.V @ turn, MV @ turn, self.tip @ turn

    def sum(self, local: Array) -> Array:
        """Return the sum over all ranks."""
        return local if self.comm.size == 1 else np.asarray(self.comm.allreduce(local))

    def release(self) -> None:
        """Let go of the factor and the matrix, which nothing asks for any more."""
        del self.solver, self._M

    def times(self, A: Any, x: Array) -> Array:
        """Return A x of owned unknowns."""
        self._x.array[:] = x
        A.mult(self._x, self._y)
        return np.array(self._y.array)

    def _force(self, system: Any, component: int) -> Array:
        """Return a unit force at the tip, owned unknowns."""
        values, out = system.structure.tip_values, np.zeros(self._x.getLocalSize())
        if self.comm.rank == values.owner:
            out[values.dofs.start + component] = 1.0
        return out

    def _solved(self, b: Array) -> Array:
        self._x.array[:] = b
        self._x.array[self._clamped] = 0.0
        self.solver.solve(self._x, self._y)
        return np.array(self._y.array)

    def _new(self, x: Array, columns: list[Array], massed: list[Array]) -> tuple[Array, Array] | None:
        """Return x (and M x) of unit mass, without what is in the columns; None if nothing is left."""
        Mx = self.times(self._M, x)
        size = float(self.sum(np.array(x @ Mx)))
        if not size > 0.0:
            return None
        for _ in range(2):
            if columns:
                shares = self.sum(np.array(massed) @ x)
                x = x - shares @ np.array(columns)
        Mx = self.times(self._M, x)
        left = float(self.sum(np.array(x @ Mx)))
        if not left > DEPENDENT**2 * size:
            return None
        return x / np.sqrt(left), Mx / np.sqrt(left)


def _symmetric(A: Array) -> Array:
    return 0.5 * (A + A.T)


def _local(system: Any, owned: Array) -> Array:
    """Return owned unknowns with room for those of other ranks."""
    out: Array = system.zeros()
    out[: len(owned)] = owned
    return out
